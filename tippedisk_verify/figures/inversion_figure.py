"""The drawing of a disk that inverts (the paper's Figures intro_inversion_COG and intro_inversion).

The reduced model keeps the centre of gravity S on a vertical line and the spinning speed constant,
and so do the pictures.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

from tippedisk_verify.audit.claims import Audit
from tippedisk_verify.figures.exhibit import MOTION_HEADER, Drawing, Exhibit, rounded_rows
from tippedisk_verify.figures.style import BLACK, BLUE, RED, pyplot
from tippedisk_verify.model.parameters import Parameters

__all__ = ["disk_points", "inversion_exhibit"]

_HOLE_RADIUS, _HOLE_OFFSET = 0.33, 0.44  # in units of the disk's radius, as in the set `geometry`
_FRONT, _BACK = "#bcd7ea", "#f4d9a0"  # of the faces
_SHOWN_SECONDS = 12.0
_ELEVATION, _AZIMUTH = 14, -62  # of the viewpoint [degrees]


def disk_points(
    parameters: Parameters, beta: float, gamma: float, alpha: float = 0.0
) -> dict[str, Any]:
    """Return the positions [m] of the disk's points G, S and C in a given attitude, and the frames'
    unit vectors.

    The frame is at rest, with its origin on the floor below S. The angles follow the paper's z-x-z
    convention: the disk is turned by alpha about the vertical, leans by beta about ``along``, and
    is turned by gamma in its own plane. C is the lowest point.

    Args:
        parameters: The disk.
        beta: The angle beta [rad].
        gamma: The angle gamma [rad].
        alpha: The angle alpha [rad].

    Returns:
        Arrays of shape (3,) under the names C, G, S, along, normal, body_x and body_y.
    """
    import numpy

    along = numpy.array([math.cos(alpha), math.sin(alpha), 0.0])
    uphill = math.cos(beta) * numpy.array([-math.sin(alpha), math.cos(alpha), 0.0]) + [
        0.0,
        0.0,
        math.sin(beta),
    ]
    body_x = math.cos(gamma) * along + math.sin(gamma) * uphill
    body_y = -math.sin(gamma) * along + math.cos(gamma) * uphill
    centre = float(parameters.r) * uphill  # from C
    gravity = centre + float(parameters.e) * body_x
    aside = gravity * [1, 1, 0]
    points = {"C": -aside, "G": centre - aside, "S": gravity - aside}
    axes = {
        "along": along,
        "normal": numpy.cross(along, uphill),
        "body_x": body_x,
        "body_y": body_y,
    }
    return points | axes


def _draw_disk(axis: Any, parameters: Parameters, points: dict[str, Any], zoom: float) -> None:
    """Draw the disk on the floor, with its hole opposite to S; its two faces differ in colour."""
    import numpy
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    radius = float(parameters.r)
    turn = numpy.linspace(0, 2 * math.pi, 121)[:, None]
    circle = numpy.cos(turn) * points["body_x"] + numpy.sin(turn) * points["body_y"]
    rim = points["G"] + radius * circle
    hole = points["G"] + radius * (_HOLE_RADIUS * circle - _HOLE_OFFSET * points["body_x"])
    floor = 1.25 * radius * numpy.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    face = numpy.concatenate((rim, hole[::-1]))  # one outline around both: the hole stays open
    up, aside = math.radians(_ELEVATION), math.radians(_AZIMUTH)
    eye = [math.cos(up) * math.cos(aside), math.cos(up) * math.sin(aside), math.sin(up)]
    colour = _FRONT if points["normal"] @ eye > 0 else _BACK
    axis.add_collection3d(
        Poly3DCollection([floor], facecolor="#ececec", edgecolor="#c8c8c8", lw=0.6, zorder=0)
    )
    axis.add_collection3d(
        Poly3DCollection([face], facecolor=colour, edgecolor="none", alpha=0.9, zorder=1)
    )
    for line in (rim, hole):
        axis.plot(*line.T, color=BLUE, lw=1.3, zorder=2)
    axis.plot(*points["S"], "o", color=BLACK, ms=6, zorder=5)
    axis.plot(*points["G"], "+", color=BLACK, ms=7, mew=1.3, zorder=5)
    axis.set(
        xlim=(-1.25 * radius, 1.25 * radius),
        ylim=(-1.25 * radius, 1.25 * radius),
        zlim=(0, 2.2 * radius),
    )
    axis.set_box_aspect((2.5, 2.5, 2.2), zoom=zoom)
    axis.view_init(elev=_ELEVATION, azim=_AZIMUTH)
    axis.set_axis_off()


def _draw_moments(parameters: Parameters, times: Any, states: Any, height: Any, across: int) -> Any:
    """Draw the disk at four moments, and below it the height of S [mm] against time.

    ``across`` is the number of disks in a row.
    """
    # The start, gamma at 0 and at pi/2 for the first time, the end.
    moments = (0, *(int((states[:, 1] >= gamma).argmax()) for gamma in (0.0, math.pi / 2)), -1)
    views = tuple(f"({number})" for number in (1, 2, 3, 4))
    figure, axes = pyplot().subplot_mosaic(
        [
            *(list(views[first : first + across]) for first in range(0, 4, across)),
            ["height"] * across,
        ],
        figsize=(9.4 if across > 2 else 4.6, 2.4 * (4 // across + 1)),
        layout="constrained",
        per_subplot_kw={views: {"projection": "3d", "computed_zorder": False}},
    )
    curve = axes["height"]
    curve.plot(times, height, color=BLUE, lw=1.0)
    for sign, name in ((1, "inverted"), (-1, "noninverted")):
        level = 1e3 * float(parameters.r + sign * parameters.e)
        curve.axhline(level, color=BLACK, lw=0.7, ls=":")
        curve.annotate(
            name, (times[-1], level), xytext=(-4, 3), textcoords="offset points", ha="right"
        )
    for view, moment in zip(views, moments, strict=True):
        _draw_disk(
            axes[view], parameters, disk_points(parameters, *states[moment, :2].tolist()), zoom=1.3
        )
        axes[view].set_title(f"{view}  t = {times[moment]:.2f} s", y=0.98)
        curve.plot(times[moment], height[moment], "o", color=RED, ms=5, zorder=4)
        curve.annotate(
            view, (times[moment], height[moment]), xytext=(5, -10), textcoords="offset points"
        )
    curve.margins(y=0.12)
    curve.set(xlabel="t [s]", ylabel="height of S [mm]")
    return figure


@partial(
    Exhibit,
    name="inversion",
    title="The inversion, computed",
    labels="fig:intro_inversion_COG, fig:intro_inversion",
    alt_text="Four views of a disk with a hole on a floor, as it turns over in its own plane, "
    "and below "
    "them the height of its centre of gravity against time, which rises and settles.",
)
def inversion_exhibit(audit: Audit, examined: Sequence[str]) -> Drawing:
    """Draw the inversion from the paper's first start, at Omega_crit + 0.5 rad/s."""
    import numpy

    r, e = float(audit.parameters.r), float(audit.parameters.e)
    orbit = audit.computed_scene("f", audit.parameters.name).orbits[0]
    kept = orbit.times <= _SHOWN_SECONDS
    times, states = orbit.times[kept], orbit.states[kept]
    height = 1e3 * (r + e * numpy.sin(states[:, 1])) * numpy.sin(states[:, 0])
    return Drawing(
        figure=lambda columns: _draw_moments(
            audit.parameters, times, states, height, 4 if columns > 2 else 2
        ),
        columns=4,
        caption=f"From the paper's first start, at Omega_crit + 0.5 rad/s: the centre of gravity "
        f"(dot) rises from "
        f"{height[0]:.4g} mm and has reached {height[-1]:.4g} mm after {times[-1]:.3g} s, on its "
        f"way to r + e = "
        f"{1e3 * (r + e):.4g} mm; the hole, opposite to it, goes down.",
        data={
            "inversion.csv": (
                (*MOTION_HEADER, "height of S [mm]"),
                rounded_rows(times, states, height),
            )
        },
    )
