"""The six scenes in state space and in projection (the paper's Figures 3D and proj_3D)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

from tippedisk_verify.audit.claims import Audit
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.figures.exhibit import CSV, MOTION_HEADER, Drawing, Exhibit, rounded_rows
from tippedisk_verify.figures.style import BLACK, BLUE, GREEN, GREY, ORANGE, RED, figure_with_axes
from tippedisk_verify.motion.scenes import SCENES, ComputedScene
from tippedisk_verify.numbers.precision import DOUBLE
from tippedisk_verify.theory.equilibria import stiff_eigenvalue_estimate
from tippedisk_verify.theory.slow_manifold import slow_manifold

__all__ = [
    "draw_scenes_2d",
    "draw_scenes_3d",
    "last_period",
    "orbits_within",
    "scene_tables",
    "scenes_2d_exhibit",
    "scenes_3d_exhibit",
]

_ORBITS = (BLUE, ORANGE)
_START: dict[str, Any] = {"color": BLACK, "marker": "x", "ls": "none", "ms": 6, "mew": 1.3}
_STABLE: dict[str, Any] = {"color": RED, "marker": "o", "ls": "none", "ms": 6, "mew": 1.4}
_UNSTABLE = _STABLE | {"color": BLACK, "mfc": "white"}
_MESH = "#606060"
_DRAWN_SECONDS = 30.0
_CSV_SECONDS = 60.0
_CSV_EVERY = 2  # each second sample is written; there are 100 a second


def orbits_within(panel: ComputedScene) -> list[Any]:
    """Return the states of each orbit of a panel that are drawn, cut where the orbit leaves the
    nearest well on either side.

    Further wells repeat the picture.
    """
    import numpy

    orbits = []
    for orbit in panel.orbits:
        states = orbit.states[orbit.times <= _DRAWN_SECONDS]
        far = numpy.flatnonzero(abs(states[:, 1] - math.pi / 2) > 1.6 * math.pi)
        orbits.append(states[: far[0]] if len(far) else states)
    return orbits


def last_period(panel: ComputedScene) -> Any:
    """Return one period of the limit cycle that orbits of a panel approach, from the end of the
    orbit that has settled best.

    A rotating cycle is taken from one noninverted state to the next, in the middle well.

    Returns:
        States of shape (n, 3), or None if no orbit ends on a cycle.
    """
    import numpy

    settled = [orbit for orbit in panel.orbits if orbit.outcome.amplitude]
    if not settled:
        return None
    best = min(
        settled,
        key=lambda orbit: (
            float(orbit.outcome.amplitude.uncertainty) if orbit.outcome.amplitude else 1.0
        ),
    )
    if best.outcome.kind == "rotating limit cycle":
        well = numpy.floor((best.states[:, 1] + math.pi / 2) / (2 * math.pi))
        first, last = numpy.flatnonzero(numpy.diff(well))[-2:] + 1
        return best.states[first:last] - [0, 2 * math.pi * well[first], 0]
    falling = numpy.flatnonzero(
        (best.states[:-1, 0] > math.pi / 2) & (best.states[1:, 0] <= math.pi / 2)
    )
    return best.states[falling[-2] : falling[-1] + 2] if len(falling) > 1 else None


def _draw_panel(
    axis: Any, panel: ComputedScene, orbits: Sequence[Any], dimensions: int
) -> tuple[float, float]:
    """Draw orbits, limit cycle and equilibria in two or three dimensions.

    Return the range of gamma [rad] that they occupy.
    """
    gammas = [
        gamma
        for states in orbits
        for gamma in (float(states[:, 1].min()), float(states[:, 1].max()))
    ]
    low, high = min(-math.pi / 2, *gammas), max(3 * math.pi / 2, *gammas)

    def draw(states: Any, **style: Any) -> None:
        axis.plot(*(states[:, column] for column in range(dimensions)), **style)

    for states, colour in zip(orbits, _ORBITS, strict=False):
        draw(states, color=colour, lw=0.8, zorder=3)
        draw(states[:1], zorder=7, **_START)
    cycle = last_period(panel)
    if cycle is not None:
        draw(cycle, color=GREEN, lw=2.0, zorder=4)
    for turn in range(-3, 4):
        for start, stable in (
            (math.pi / 2, panel.inverted_stable),
            (-math.pi / 2, panel.noninverted_stable),
        ):
            if low - 0.2 <= start + 2 * math.pi * turn <= high + 0.2:
                place = orbits[0][:1] * 0 + [math.pi / 2, start + 2 * math.pi * turn, 0]
                draw(place, zorder=6, **(_STABLE if stable else _UNSTABLE))
    axis.set(xlabel="β [rad]", ylabel="γ [rad]")
    _angle_axis(axis.yaxis, low, high)
    return low, high


def _angle_axis(axis: Any, low: float, high: float) -> None:
    """Set the ticks of a plot's axis at multiples of pi/2 from ``low`` to ``high`` [rad]."""
    first, last = math.ceil(low / (math.pi / 2)), math.floor(high / (math.pi / 2))
    halves = [half for half in range(first, last + 1) if last - first <= 6 or half % 2]
    names = {0: "0", 1: "π/2", 2: "π", -1: "−π/2", -2: "−π"}
    labels = [
        names.get(half, f"{half // 2}π" if half % 2 == 0 else f"{half}π/2".replace("-", "−"))
        for half in halves
    ]
    axis.set_ticks([half * math.pi / 2 for half in halves], labels)


def draw_scenes_2d(panels: Sequence[ComputedScene], columns: int = 2) -> Any:
    """Draw the orbits of the paper's scenes, projected onto the (beta, gamma) plane, a panel for
    each (the paper's Figure proj_3D).

    Args:
        panels: The panels.
        columns: The largest number of columns.

    Returns:
        The Matplotlib figure.
    """
    figure, axes = figure_with_axes(len(panels), columns, (4.6, 2.9), below=0.6)
    for panel, axis in zip(panels, axes, strict=True):
        _draw_panel(axis, panel, orbits_within(panel), 2)
        axis.set_xlim(0, math.pi)
        _angle_axis(axis.xaxis, 0, math.pi)
        axis.set_title(panel.scene.title)
    _add_legend(figure, columns if len(panels) > 1 else 1)
    return figure


def _add_legend(figure: Any, columns: int, surface: bool = False) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    marks: list[tuple[str, dict[str, Any]]] = [
        (r"orbit from $x_0^1 = (\pi/2, -\pi/2, 2)$", {"color": _ORBITS[0], "lw": 1.2}),
        (r"orbit from $x_0^2 = (\pi/2, \pi/2 + 0.4, 0)$", {"color": _ORBITS[1], "lw": 1.2}),
        ("limit cycle", {"color": GREEN, "lw": 2.0}),
        ("start", _START),
        ("stable equilibrium", _STABLE),
        ("unstable equilibrium", _UNSTABLE),
    ]
    handles: list[Any] = [Line2D([], [], label=label, **style) for label, style in marks]
    if surface:
        handles.append(Patch(facecolor=GREY, alpha=0.6, label="slow manifold, order 1"))
        handles.append(Line2D([], [], color=_MESH, lw=0.7, label="critical manifold, order 0"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3 if columns > 1 else 1)


def draw_scenes_3d(panels: Sequence[ComputedScene], columns: int = 2) -> Any:
    """Draw the orbits of the paper's scenes in space, with the slow manifold of orders 0 and 1, a
    panel for each (the paper's Figure 3D).

    Args:
        panels: The panels.
        columns: The largest number of columns.

    Returns:
        The Matplotlib figure.
    """
    figure, axes = figure_with_axes(
        len(panels), columns, (4.6, 3.4), below=0.7, projection="3d", computed_zorder=False
    )
    for panel, axis in zip(panels, axes, strict=True):
        orbits = orbits_within(panel)
        low, high = _draw_panel(axis, panel, orbits, 3)
        half_range = max(0.75, *(float(abs(states[:, 0] - math.pi / 2).max()) for states in orbits))
        # The order-1 term diverges at sin(beta) = 0, so the surface ends before that.
        beta, gamma, critical, slow = _surfaces(panel, min(half_range + 0.05, 1.0), low, high)
        sheet = axis.plot_surface(
            beta, gamma, slow, color=GREY, alpha=0.45, lw=0, rstride=1, cstride=1, zorder=1
        )
        sheet.set_rasterized(True)  # thousands of facets would make a vector file of megabytes
        axis.plot_wireframe(
            beta, gamma, critical, color=_MESH, lw=0.3, alpha=0.6, rstride=8, cstride=8, zorder=1
        )
        axis.set_title(panel.scene.title, y=1.03)
        axis.set_zlabel("dβ/dt [rad/s]", labelpad=0)
        axis.xaxis.labelpad, axis.yaxis.labelpad = 1, 3
        axis.set_xticks(
            [math.pi / 2 - 0.5, math.pi / 2, math.pi / 2 + 0.5], ["π/2−0.5", "π/2", "π/2+0.5"]
        )
        axis.tick_params(pad=0, labelsize=8)
        # Near inverted spinning the manifold falls with gamma: its orbits are visible from here.
        axis.view_init(elev=30, azim=32)
        axis.set_box_aspect((1, 1.35, 0.8), zoom=1.02)
    _add_legend(figure, columns if len(panels) > 1 else 1, surface=True)
    # Before Matplotlib 3.11.2 the layout takes 3D ticks from the last drawing, so draw once first.
    layout = figure.get_layout_engine()
    figure.set_layout_engine("none")
    figure.draw_without_rendering()
    figure.set_layout_engine(layout)
    return figure


def _surfaces(panel: ComputedScene, half_range: float, low: float, high: float) -> tuple[Any, ...]:
    """Return beta, gamma, and v on the slow manifold of orders 0 and 1, as arrays over a grid.

    The grid reaches ``half_range`` [rad] from beta = pi/2.
    """
    import numpy

    beta, gamma = numpy.meshgrid(
        numpy.linspace(math.pi / 2 - half_range, math.pi / 2 + half_range, 33),
        numpy.linspace(low, high, 65),
    )
    constants, omega = panel.parameters.constants_in(DOUBLE), float(panel.omega)
    return (
        beta,
        gamma,
        *(slow_manifold(numpy, constants, omega, beta, gamma, order=order) for order in (0, 1)),
    )


def scene_tables(panel: ComputedScene) -> dict[str, CSV]:
    """Return the tables of a scene's orbits and of its slow manifold as headers and rows, by file
    name.

    The files are ``scene_X_orbit_N.csv`` and ``scene_X_slow_manifold.csv``. States and heights are
    rounded: a picture's data have no half-widths. `integrate` gives states with half-widths.
    """
    import numpy

    tables: dict[str, CSV] = {}
    for index, orbit in enumerate(panel.orbits, start=1):
        kept = (orbit.times <= _CSV_SECONDS).nonzero()[0][::_CSV_EVERY]
        rows = rounded_rows(orbit.times[kept], orbit.states[kept])
        tables[f"scene_{panel.scene.name}_orbit_{index}.csv"] = (MOTION_HEADER, rows)
    beta, gamma, *heights = (
        part.ravel() for part in _surfaces(panel, 1.0, -math.pi / 2, 3 * math.pi / 2)
    )
    tables[f"scene_{panel.scene.name}_slow_manifold.csv"] = (
        ("beta [rad]", "gamma [rad]", "v at order 0 [rad/s]", "v at order 1 [rad/s]"),
        rounded_rows(numpy.column_stack((beta, gamma)), *heights),
    )
    return tables


def _panels(audit: Audit, examined: Sequence[str]) -> list[ComputedScene]:
    """Return the panels of the scenes among the examined claims, for the audited parameter set.

    Panels that could not be computed are left out.

    Raises:
        AccuracyError: If no panel could be computed.
    """
    panels, reason = [], ""
    for scene in SCENES:
        if f"scene_{scene.name}" in examined:
            try:
                panels.append(audit.computed_scene(scene.name, audit.parameters.name))
            except (AccuracyError, ArithmeticError, InputError) as fault:
                reason = reason or str(fault)
    if not panels:
        raise AccuracyError(reason)
    return panels


@partial(
    Exhibit,
    name="scenes_3d",
    title="Orbits and slow manifold in state space",
    labels="fig:3D",
    alt_text="Six panels, one for each speed, with axes beta, gamma and beta's rate: a grey "
    "wavy surface, two "
    "orbits from marked starts that drop onto it, the limit cycle where there is one, and the "
    "equilibria.",
    cost=4,
)
def scenes_3d_exhibit(audit: Audit, examined: Sequence[str]) -> Drawing:
    """Draw the orbits of the paper's scenes in the space of beta, gamma and v."""
    panels = _panels(audit, examined)
    rate = -float(stiff_eigenvalue_estimate(audit.parameters))
    return Drawing(
        figure=lambda columns: draw_scenes_3d(panels, columns),
        columns=2,
        caption=f"Orbits fall onto the grey slow manifold, near inverted spinning at a rate of "
        f"{rate:.3g} 1/s, and "
        "stay on it, until they reach the limit cycle or an equilibrium, or leave for other wells "
        "(a).",
        data={name: table for panel in panels for name, table in scene_tables(panel).items()},
        facts={"scenes": {panel.scene.name: panel.to_dict() for panel in panels}},
        embedded="webp",
    )


@partial(
    Exhibit,
    name="scenes_2d",
    title="The same orbits, projected onto beta and gamma",
    labels="fig:proj_3D",
    alt_text="Six panels in the plane of beta and gamma: orbits spiral onto a closed curve "
    "around inverted "
    "spinning, leave the well in panel a, and spiral into the equilibrium in panel f.",
)
def scenes_2d_exhibit(audit: Audit, examined: Sequence[str]) -> Drawing:
    """Draw the orbits of the paper's scenes in the plane of beta and gamma."""
    panels = _panels(audit, examined)
    orbits = {
        name: table
        for panel in panels
        for name, table in scene_tables(panel).items()
        if "orbit" in name
    }
    return Drawing(
        figure=lambda columns: draw_scenes_2d(panels, columns),
        columns=2,
        caption="The same orbits from above: from panel to panel the speed rises, and the cycle "
        "(green) shrinks "
        "from one that passes close by both noninverted states to none.",
        data=orbits,
        embedded="webp",
    )
