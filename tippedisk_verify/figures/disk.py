"""The disk itself: the model with its angles, and the inversion (the paper's Figures fig1 and intro_inversion)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from tippedisk_verify.audit.claims import Audit
from tippedisk_verify.figures.exhibit import Drawing, Exhibit
from tippedisk_verify.figures.style import BLACK, BLUE, GREEN, ORANGE, PURPLE, RED, grid, pyplot
from tippedisk_verify.model.parameters import Parameters

__all__ = ["EXHIBITS", "draw_disk", "draw_inversion", "draw_model", "points_of", "stage"]

_HOLE_RADIUS, _HOLE_OFFSET = 0.33, 0.44  # of the disk's radius, as in the set `geometry`
_SHOWN_SECONDS = 12.0
_ELEVATION, _AZIMUTH = 14, -62  # of the eye [degrees]
_TOWARDS_EYE = tuple(
    (lambda up, round_: (math.cos(up) * math.cos(round_), math.cos(up) * math.sin(round_), math.sin(up)))(
        math.radians(_ELEVATION), math.radians(_AZIMUTH)
    )
)


def points_of(parameters: Parameters, beta: float, gamma: float, stretch: float = 1.0) -> dict[str, Any]:
    """G, S and C [m] with the frames' unit vectors, in a frame that turns with Omega about the vertical through C.

    The paper's z-x-z convention: the disk leans by beta about e_x, and is turned by gamma in its own plane. C is the
    lowest point; S lies ``stretch`` times e from G.
    """
    import numpy

    radius, offset = float(parameters.r), float(parameters.e) * stretch
    along = numpy.array([1.0, 0.0, 0.0])
    uphill = numpy.array([0.0, math.cos(beta), math.sin(beta)])
    normal = numpy.array([0.0, -math.sin(beta), math.cos(beta)])
    body_x = math.cos(gamma) * along + math.sin(gamma) * uphill
    body_y = -math.sin(gamma) * along + math.cos(gamma) * uphill
    contact = numpy.zeros(3)
    centre = contact + radius * uphill
    return {
        "C": contact,
        "G": centre,
        "S": centre + offset * body_x,
        "along": along,
        "uphill": uphill,
        "normal": normal,
        "body_x": body_x,
        "body_y": body_y,
    }


def draw_disk(axis: Any, parameters: Parameters, points: dict[str, Any]) -> None:
    """The disk's face with its hole, opposite to S, and the floor; its other face has another colour."""
    import numpy
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    radius = float(parameters.r)
    turn = numpy.linspace(0, 2 * math.pi, 121)[:, None]

    def circle(centre: Any, size: float) -> Any:
        return centre + size * (numpy.cos(turn) * points["body_x"] + numpy.sin(turn) * points["body_y"])

    rim = circle(points["G"], radius)
    hole = circle(points["G"] - _HOLE_OFFSET * radius * points["body_x"], _HOLE_RADIUS * radius)
    floor = 1.25 * radius * numpy.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    axis.add_collection3d(Poly3DCollection([floor], facecolor="#ececec", edgecolor="#c8c8c8", lw=0.6, zorder=0))
    face = numpy.concatenate((rim, hole[::-1]))  # one outline around both: the hole stays open
    colour = "#bcd7ea" if points["normal"] @ _TOWARDS_EYE > 0 else "#f4d9a0"
    axis.add_collection3d(Poly3DCollection([face], facecolor=colour, edgecolor="none", alpha=0.9, zorder=1))
    for line in (rim, hole):
        axis.plot(*line.T, color=BLUE, lw=1.3, zorder=2)
    axis.plot(*points["S"], "o", color=BLACK, ms=6, zorder=5)
    axis.plot(*points["G"], "+", color=BLACK, ms=7, mew=1.3, zorder=5)


def stage(axis: Any, radius: float, zoom: float) -> None:
    """Limits and the eye's place, the same for every picture of a disk of this radius [m]."""
    axis.set(xlim=(-1.25 * radius, 1.25 * radius), ylim=(-1.25 * radius, 1.25 * radius), zlim=(0, 2.2 * radius))
    axis.set_box_aspect((2.5, 2.5, 2.2), zoom=zoom)
    axis.view_init(elev=_ELEVATION, azim=_AZIMUTH)
    axis.set_axis_off()


def draw_model(parameters: Parameters, columns: int = 2) -> Any:
    """The disk with its angles (the paper's Figure fig1); the eccentricity is drawn six times as large."""
    import numpy

    beta, gamma = 1.1, 0.6
    points = points_of(parameters, beta, gamma, stretch=6.0)
    radius = float(parameters.r)
    figure, (axis,) = grid(1, 1, (5.6, 4.6) if columns > 1 else (4.0, 3.6), projection="3d", computed_zorder=False)
    draw_disk(axis, parameters, points)
    stage(axis, radius, 1.25)

    def vector(begin: Any, end: Any, colour: str, name: str, style: str = "-") -> None:
        axis.plot(*numpy.array([begin, end]).T, style, color=colour, lw=1.5, zorder=4)
        axis.text(*(end + 0.07 * (end - begin)), name, color=colour, fontsize=10, zorder=6)

    def arc(centre: Any, start: Any, towards: Any, angle: float, size: float, colour: str, name: str) -> None:
        turn = numpy.linspace(0, angle, 40)[:, None]
        line = centre + size * (numpy.cos(turn) * start + numpy.sin(turn) * towards)
        axis.plot(*line.T, color=colour, lw=1.8, zorder=5)
        middle = centre + 1.22 * size * (math.cos(angle / 2) * start + math.sin(angle / 2) * towards)
        axis.text(*middle, name, color=colour, fontsize=12, ha="center", va="center", zorder=6)

    up, back = numpy.array([0.0, 0.0, 1.0]), numpy.array([0.0, 1.0, 0.0])
    # The floor's line away from the disk and the disk's line of steepest ascent enclose beta.
    axis.plot(*numpy.array([points["C"], 1.1 * radius * back]).T, "--", color=RED, lw=1.0, zorder=4)
    axis.plot(*numpy.array([points["C"], points["G"]]).T, color=GREEN, lw=1.5, zorder=4)
    axis.text(*(0.78 * points["G"] + 0.06 * radius * points["along"]), "r", color=GREEN, fontsize=11, zorder=6)
    arc(points["C"], back, up, beta, 0.55 * radius, RED, "β")
    vector(points["G"], points["G"] + 0.72 * radius * points["along"], BLACK, r"$e_x^G$", "--")
    vector(points["G"], points["G"] + 0.72 * radius * points["body_x"], PURPLE, r"$e_x^B$")
    arc(points["G"], points["along"], points["uphill"], gamma, 0.5 * radius, PURPLE, "γ")
    axis.plot(*numpy.array([numpy.zeros(3), 2.15 * radius * up]).T, "-.", color=ORANGE, lw=1.0, zorder=3)
    arc(1.95 * radius * up, points["along"], back, 1.6 * math.pi, 0.22 * radius, ORANGE, "")
    axis.text(*(2.0 * radius * up + 0.4 * radius * points["along"]), "α = Ω t", color=ORANGE, fontsize=11, zorder=6)
    for name, shift in (
        ("G", -0.16 * points["along"]),
        ("S", 0.12 * points["body_y"]),
        ("C", 0.16 * (points["along"] - up)),
    ):
        axis.text(*(points[name] + radius * shift), name, fontsize=11, weight="bold", ha="center", zorder=6)
    return figure


def draw_inversion(parameters: Parameters, times: Any, states: Any, moments: Sequence[int], columns: int = 4) -> Any:
    """The disk at four moments of an orbit, and the height of S (the paper's Figures intro_inversion and _COG)."""
    radius = float(parameters.r)
    plt = pyplot()
    across = min(columns, 4)
    rows = 4 // across
    figure = plt.figure(figsize=(2.6 * across if across > 2 else 4.6, 2.5 * rows + 2.5), layout="constrained")
    cells = figure.add_gridspec(rows + 1, across, height_ratios=[2.5] * rows + [2.3])
    for place, moment in enumerate(moments):
        axis = figure.add_subplot(cells[place // across, place % across], projection="3d", computed_zorder=False)
        beta, gamma, _ = states[moment]
        draw_disk(axis, parameters, points_of(parameters, float(beta), float(gamma)))
        stage(axis, radius, 1.3)
        axis.set_title(f"({place + 1})  t = {times[moment]:.2f} s", y=0.98)
    axis = figure.add_subplot(cells[rows, :])
    height = _height(parameters, states)
    axis.plot(times, 1e3 * height, color=BLUE, lw=1.0)
    for value, name in ((radius + float(parameters.e), "inverted"), (radius - float(parameters.e), "noninverted")):
        axis.axhline(1e3 * value, color=BLACK, lw=0.7, ls=":")
        axis.annotate(name, (times[-1], 1e3 * value), xytext=(-4, 3), textcoords="offset points", ha="right")
    for place, moment in enumerate(moments):
        axis.plot(times[moment], 1e3 * height[moment], "o", color=RED, ms=5, zorder=4)
        axis.annotate(
            f"({place + 1})", (times[moment], 1e3 * height[moment]), xytext=(5, -10), textcoords="offset points"
        )
    axis.margins(y=0.12)
    axis.set(xlabel="t [s]", ylabel="height of S [mm]")
    axis.grid(lw=0.3, alpha=0.5)
    return figure


def _height(parameters: Parameters, states: Any) -> Any:
    """Of the centre of gravity above the support [m]: (r + e sin gamma) sin beta."""
    import numpy

    return (float(parameters.r) + float(parameters.e) * numpy.sin(states[:, 1])) * numpy.sin(states[:, 0])


def _model(audit: Audit, examined: Sequence[str]) -> Drawing:
    points = points_of(audit.parameters, 1.1, 0.6, stretch=6.0)
    rows = [(name, *map(float, points[name])) for name in "CGS"]
    return Drawing(
        figure=lambda columns: draw_model(audit.parameters, columns),
        columns=2,
        reading="The disk turns at the given speed about the vertical, leans by beta, and rolls by gamma in its "
        "own plane; C touches the support, G is the centre, S the centre of gravity (its distance from G is drawn "
        "six-fold).",
        data={"model.csv": (("point", "x [m]", "y [m]", "z [m]"), rows)},
    )


def _inversion(audit: Audit, examined: Sequence[str]) -> Drawing:
    import numpy

    orbit = audit.panel("f", audit.parameters.name).orbits[0]
    kept = orbit.times <= _SHOWN_SECONDS
    times, states = orbit.times[kept], orbit.states[kept]

    def first(gamma: float) -> int:
        passed = numpy.flatnonzero(states[:, 1] >= gamma)
        return int(passed[0]) if len(passed) else len(times) - 1

    moments = (0, first(0.0), first(math.pi / 2), len(times) - 1)
    height = 1e3 * _height(audit.parameters, states)
    table = numpy.column_stack((times, states, height)).tolist()
    return Drawing(
        figure=lambda columns: draw_inversion(audit.parameters, times, states, moments, columns if columns > 1 else 2),
        columns=4,
        reading=f"From the paper's first start, at Omega_crit + 0.5 rad/s: the centre of gravity (dot) rises from "
        f"{height[0]:.4g} mm and has reached {height[-1]:.4g} mm after {times[-1]:.3g} s, on its way to r + e = "
        f"{1e3 * float(audit.parameters.r + audit.parameters.e):.4g} mm; the hole, opposite to it, "
        "goes down.",
        data={
            "inversion.csv": (("t [s]", "beta [rad]", "gamma [rad]", "v [rad/s]", "height of S [mm]"), table),
        },
    )


EXHIBITS = (
    Exhibit(
        name="inversion",
        title="The inversion, computed",
        source="Figures intro_inversion_COG and intro_inversion",
        alternative="Four views of a disk with a hole on a floor, as it turns over in its own plane, and below "
        "them the height of its centre of gravity against time, which rises and settles.",
        draw=_inversion,
    ),
    Exhibit(
        name="model",
        title="The model and its angles",
        source="Figure fig1",
        alternative="A leaning disk on a floor with its contact point C, centre G and centre of gravity S, and the "
        "angles alpha about the vertical, beta between disk and floor, gamma in the disk's plane.",
        draw=_model,
    ),
)
