"""The picture of the basins of attraction in a plane of states, with its colours, and the curves
that separate them. `motion.basins` has the grid of starts.
"""

from __future__ import annotations

import math
from typing import Any

import numpy

from tippedisk_verify.figures.style import BLACK, BLUE, GREEN, ORANGE, PURPLE, pyplot
from tippedisk_verify.motion.basin_boundary import BasinBoundary
from tippedisk_verify.motion.basins import Basins

__all__ = ["draw_basins"]

_COLOURS = ("#d9d9d9", GREEN, ORANGE, PURPLE, BLACK)  # in the order of the outcomes
_CURVE = 81  # points of a boundary curve


def draw_basins(plane: Basins, boundary: BasinBoundary | None = None) -> Any:
    """Draw the basins of attraction in a plane of starts with the same v, by the outcome of each
    start, and the boundary's two curves in it.

    Args:
        plane: The outcomes.
        boundary: The boundary, or None to leave it out.

    Returns:
        The Matplotlib figure.
    """
    from matplotlib.colors import ListedColormap
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    figure, axis = pyplot().subplots(figsize=(7.5, 4.4), layout="constrained")
    axis.imshow(
        plane.outcome,
        origin="lower",
        extent=(-math.pi / 2, 3 * math.pi / 2, 0, math.pi),
        aspect="auto",
        interpolation="nearest",
        cmap=ListedColormap(list(_COLOURS)),
        vmin=-0.5,
        vmax=len(_COLOURS) - 0.5,
    )
    shares = plane.shares()
    marks: list[Any] = [
        Patch(color=colour, label=f"{name}: {100 * share:.2f} ± {100 * error:.2f} %")
        for colour, (name, (share, error)) in zip(_COLOURS, shares.items(), strict=True)
    ]
    if boundary is not None:
        gammas = numpy.linspace(-math.pi / 2, 3 * math.pi / 2, _CURVE)
        for sheet in zip(
            *(boundary.sheets(float(gamma), plane.v) for gamma in gammas), strict=True
        ):
            axis.plot(gammas, [float(beta) for beta in sheet], color=BLUE)
        marks.append(
            Line2D([], [], color=BLUE, label="stable manifolds of the unstable rotating cycles")
        )
        axis.set(xlim=(-math.pi / 2, 3 * math.pi / 2), ylim=(0, math.pi))
    axis.legend(handles=marks, loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=2)
    axis.grid(visible=False)
    axis.set(xlabel="γ [rad]", ylabel="β [rad]")
    axis.set_title(
        f"Ω = {float(plane.omega):.4f} rad/s, {plane.parameters.friction} law, start at dβ/dt = "
        f"{plane.v:g} rad/s,"
        f" {plane.duration:g} s",
        fontsize=10,
    )
    return figure
