"""What the states of a plane end on."""

from __future__ import annotations

import math
from typing import Any

from tippedisk_verify.figures.style import BLACK, GREEN, PURPLE, pyplot
from tippedisk_verify.orbits.basins import Basins

__all__ = ["draw_basins"]


def draw_basins(plane: Basins) -> Any:
    """What the states of a plane of constant v end on."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    colours = ("#d9d9d9", GREEN, PURPLE, BLACK)
    figure, axis = pyplot().subplots(figsize=(7.5, 4.4), layout="constrained")
    axis.imshow(
        plane.outcome,
        origin="lower",
        extent=(-math.pi / 2, 3 * math.pi / 2, 0, math.pi),
        aspect="auto",
        interpolation="nearest",
        cmap=ListedColormap(list(colours)),
        vmin=-0.5,
        vmax=3.5,
    )
    shares = plane.fractions()
    patches = [
        Patch(color=colour, label=f"{name}: {100 * share:.2f} ± {100 * error:.2f} %")
        for colour, (name, (share, error)) in zip(colours, shares.items(), strict=True)
    ]
    axis.legend(handles=patches, loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=2, frameon=False)
    axis.set(xlabel="γ [rad]", ylabel="β [rad]")
    axis.set_title(
        f"Ω = {float(plane.omega):.4f} rad/s, {plane.parameters.friction} law, start at dβ/dt = {plane.v:g} rad/s,"
        f" {plane.duration:g} s",
        fontsize=10,
    )
    return figure
