"""What the states of a plane end on, and what separates them."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Any

import numpy

from tippedisk_verify.atlas.cycles_at_speed import cycle_at, rotating_cycle
from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.figures.style import BLACK, BLUE, GREEN, ORANGE, PURPLE, pyplot
from tippedisk_verify.motion.basin_boundary import BasinBoundary
from tippedisk_verify.motion.basins import Basins

__all__ = ["draw_basins", "draw_boundary"]

_COLOURS = ("#d9d9d9", GREEN, ORANGE, PURPLE, BLACK)  # in the order of the outcomes
_CURVE = 81  # points along gamma
_SURFACE = (31, 13)  # points along gamma and v
_HIGHEST_V = 6.0  # rad/s


def draw_basins(plane: Basins, boundary: BasinBoundary | None = None) -> Any:
    """What the states of a plane of constant v end on, and the boundary's two curves in it."""
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
    shares = plane.fractions()
    marks: list[Any] = [
        Patch(color=colour, label=f"{name}: {100 * share:.2f} ± {100 * error:.2f} %")
        for colour, (name, (share, error)) in zip(_COLOURS, shares.items(), strict=True)
    ]
    if boundary is not None:
        gammas = numpy.linspace(-math.pi / 2, 3 * math.pi / 2, _CURVE)
        for sheet in zip(*(boundary.sheets(float(gamma), plane.v) for gamma in gammas), strict=True):
            axis.plot(gammas, [float(beta) for beta in sheet], color=BLUE, lw=1.5)
        marks.append(Line2D([], [], color=BLUE, lw=1.5, label="stable manifolds of the unstable rotating cycles"))
        axis.set(xlim=(-math.pi / 2, 3 * math.pi / 2), ylim=(0, math.pi))
    axis.legend(handles=marks, loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=2, frameon=False)
    axis.set(xlabel="γ [rad]", ylabel="β [rad]")
    axis.set_title(
        f"Ω = {float(plane.omega):.4f} rad/s, {plane.parameters.friction} law, start at dβ/dt = {plane.v:g} rad/s,"
        f" {plane.duration:g} s",
        fontsize=10,
    )
    return figure


def draw_boundary(boundary: BasinBoundary) -> Any:
    """Both sheets in state space, with the limit cycles: starts between the sheets keep standing."""
    gammas = numpy.linspace(-math.pi / 2, 3 * math.pi / 2, _SURFACE[0])
    speeds = numpy.linspace(-_HIGHEST_V, _HIGHEST_V, _SURFACE[1])
    sheets = [[tuple(map(float, boundary.sheets(float(gamma), float(v)))) for v in speeds] for gamma in gammas]
    lower, upper = numpy.array(sheets).transpose(2, 0, 1)
    figure = pyplot().figure(figsize=(7.5, 6.0), layout="constrained")
    axis = figure.add_subplot(projection="3d")
    grid_gamma, grid_v = numpy.meshgrid(gammas, speeds, indexing="ij")
    for sheet in (lower, upper):
        axis.plot_surface(grid_gamma, grid_v, sheet, color=BLUE, alpha=0.25, rstride=1, cstride=1, lw=0.2, ec=BLUE)
    for states, colour, name in _cycles(boundary):
        beta, gamma, v = states
        axis.plot(gamma, v, beta, color=colour, lw=2.0, label=name, zorder=5)
    axis.set(xlabel="γ [rad]", ylabel="dβ/dt [rad/s]", zlabel="β [rad]")
    axis.set_title(
        f"Ω = {float(boundary.omega):.4f} rad/s, {boundary.parameters.friction} law: starts between the sheets keep"
        " standing",
        fontsize=10,
    )
    axis.set_box_aspect((5, 4, 3.2), zoom=1.05)
    axis.view_init(elev=18, azim=-58)
    axis.legend(loc="upper center", bbox_to_anchor=(0.5, 0.02), ncols=2, frameon=False)
    return figure


def _cycles(boundary: BasinBoundary) -> list[tuple[Any, str, str]]:
    """States (3, n), colour and name of the limit cycles at the boundary's speed, rotating ones with their images."""
    disk, omega, engine = boundary.parameters, boundary.omega, boundary.engine
    drawn = [(boundary.cycle, BLACK, "unstable rotating cycles")]
    with suppress(InputError, Shortfall):
        drawn.append((rotating_cycle(disk, omega, engine), ORANGE, "stable rotating cycles"))
    curves = []
    for cycle, colour, name in drawn:
        beta, gamma, v = cycle.orbit()[1]
        # A turn from pi/2 on is drawn within the strip; its image leans to the other side.
        gamma = (gamma + math.pi / 2) % (2 * math.pi) - math.pi / 2
        order = numpy.argsort(gamma)
        curves.append((numpy.array((beta, gamma, v))[:, order], colour, name))
        image = numpy.array((math.pi - beta, (math.pi - gamma + math.pi / 2) % (2 * math.pi) - math.pi / 2, -v))
        curves.append((image[:, numpy.argsort(image[1])], colour, ""))
    with suppress(InputError, Shortfall):
        curves.append((cycle_at(disk, omega, engine).orbit()[1], GREEN, "limit cycle"))
    return curves
