"""The six scenes in state space and projected (the paper's Figures 3D and proj_3D)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from tippedisk_verify.audit.claims import Audit
from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.figures.exhibit import Drawing, Exhibit
from tippedisk_verify.figures.style import BLACK, BLUE, GREEN, GREY, ORANGE, RED, grid
from tippedisk_verify.model.precision import DOUBLE
from tippedisk_verify.motion.scenes import SCENES, Panel
from tippedisk_verify.theory.equilibria import stiff_eigenvalue_estimate
from tippedisk_verify.theory.slow_manifold import slow_manifold

__all__ = ["EXHIBITS", "draw_plane", "draw_scenes_2d", "draw_scenes_3d", "last_turn", "scene_tables"]

_ORBITS = (BLUE, ORANGE)
_STABLE, _UNSTABLE = RED, BLACK
_DRAWN_SECONDS = 30.0
_CSV_SECONDS = 60.0
_CSV_EVERY = 2  # of the 100 samples a second


def _drawn(panel: Panel) -> list[Any]:
    """The states of each orbit that are drawn."""
    return [orbit.states[orbit.times <= _DRAWN_SECONDS] for orbit in panel.orbits]


def _clipped(states: Any) -> Any:
    """The part within one well to either side: further wells repeat it, and would squeeze the picture."""
    import numpy

    far = numpy.flatnonzero(abs(states[:, 1] - math.pi / 2) > 1.6 * math.pi)
    return states[: far[0]] if len(far) else states


def last_turn(panel: Panel) -> Any:
    """One period of the limit cycle, from the end of the orbit that has settled best; None elsewhere.

    A rotating one is taken from one noninverted state to the next, in the middle well.
    """
    import numpy

    settled = [orbit for orbit in panel.orbits if orbit.ending.amplitude]
    if not settled:
        return None
    best = min(settled, key=lambda orbit: float(orbit.ending.amplitude.uncertainty) if orbit.ending.amplitude else 1.0)
    if best.ending.kind == "rotating limit cycle":
        well = numpy.floor((best.states[:, 1] + math.pi / 2) / (2 * math.pi))
        first, last = numpy.flatnonzero(numpy.diff(well))[-2:] + 1
        return best.states[first:last] - [0, 2 * math.pi * well[first], 0]
    falling = numpy.flatnonzero((best.states[:-1, 0] > math.pi / 2) & (best.states[1:, 0] <= math.pi / 2))
    return best.states[falling[-2] : falling[-1] + 2] if len(falling) > 1 else None


def _equilibria(panel: Panel, gammas: Sequence[float]) -> list[tuple[float, bool]]:
    """(gamma, stable) of the equilibria whose gamma lies in the range drawn."""
    low, high = min(gammas), max(gammas)
    states = []
    for turn in range(-3, 4):
        for start, stable in ((math.pi / 2, panel.inverted_stable), (-math.pi / 2, panel.noninverted_stable)):
            gamma = start + 2 * math.pi * turn
            if low - 0.2 <= gamma <= high + 0.2:
                states.append((gamma, stable))
    return states


def _angle_axis(axis: Any, low: float, high: float) -> None:
    """Ticks at multiples of pi/2 from ``low`` to ``high`` [rad]."""
    first, last = math.ceil(low / (math.pi / 2)), math.floor(high / (math.pi / 2))
    halves = [half for half in range(first, last + 1) if last - first <= 6 or half % 2]
    names = {0: "0", 1: "π/2", 2: "π", -1: "−π/2", -2: "−π"}
    labels = [names.get(half, f"{half // 2}π" if half % 2 == 0 else f"{half}π/2".replace("-", "−")) for half in halves]
    axis.set_ticks([half * math.pi / 2 for half in halves], labels)


def draw_scenes_2d(panels: Sequence[Panel], columns: int = 2) -> Any:
    """The panels projected onto the (beta, gamma) plane (the paper's Figure proj_3D)."""
    figure, axes = grid(len(panels), columns, (4.6, 2.9), below=0.6)
    for panel, axis in zip(panels, axes, strict=True):
        draw_plane(axis, panel, _drawn(panel))
        axis.set_title(panel.scene.title)
    _legend(figure, columns if len(panels) > 1 else 1)
    return figure


def draw_plane(axis: Any, panel: Panel, orbits: Sequence[Any]) -> None:
    """These states of orbits, limit cycle and equilibria in the plane of beta and gamma."""
    gammas: list[float] = [-math.pi / 2, 3 * math.pi / 2]
    for states, colour in zip(map(_clipped, orbits), _ORBITS, strict=False):
        axis.plot(states[:, 0], states[:, 1], color=colour, lw=0.7, zorder=2)
        axis.plot(states[0, 0], states[0, 1], "x", color="black", ms=6, mew=1.3, zorder=7)
        gammas += [float(states[:, 1].min()), float(states[:, 1].max())]
    cycle = last_turn(panel)
    if cycle is not None:
        axis.plot(cycle[:, 0], cycle[:, 1], color=GREEN, lw=2.0, zorder=3)
    for gamma, stable in _equilibria(panel, gammas):
        _equilibrium_mark(axis, (math.pi / 2,), (gamma,), stable)
    axis.set(xlabel="β [rad]", ylabel="γ [rad]", xlim=(0, math.pi))
    _angle_axis(axis.xaxis, 0, math.pi)
    _angle_axis(axis.yaxis, min(gammas), max(gammas))
    axis.grid(lw=0.3, alpha=0.5)


def _equilibrium_mark(axis: Any, x: Any, y: Any, stable: bool, **more: Any) -> None:
    """A full red circle if it is stable, an empty black one if not; ``z`` is for axes in space."""
    axis.plot(
        x,
        y,
        *more.pop("z", ()),
        marker="o",
        ls="none",
        ms=6,
        mfc=_STABLE if stable else "white",
        mec=_STABLE if stable else _UNSTABLE,
        mew=1.4,
        zorder=6,
    )


def _legend(figure: Any, columns: int, surface: bool = False) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    def mark(**style: Any) -> Any:
        return Line2D([], [], **style)

    handles = [
        mark(color=_ORBITS[0], lw=1.2, label=r"orbit from $x_0^1 = (\pi/2, -\pi/2, 2)$"),
        mark(color=_ORBITS[1], lw=1.2, label=r"orbit from $x_0^2 = (\pi/2, \pi/2 + 0.4, 0)$"),
        mark(color=GREEN, lw=2.0, label="limit cycle"),
        mark(color="black", marker="x", ls="none", mew=1.3, label="start"),
        mark(marker="o", ls="none", mfc=_STABLE, mec=_STABLE, label="stable equilibrium"),
        mark(marker="o", ls="none", mfc="white", mec=_UNSTABLE, mew=1.4, label="unstable equilibrium"),
    ]
    if surface:
        handles.append(Patch(facecolor=GREY, alpha=0.6, label="slow manifold, order 1"))
        handles.append(mark(color="#606060", lw=0.7, label="critical manifold, order 0"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3 if columns > 1 else 1, frameon=False)


def draw_scenes_3d(panels: Sequence[Panel], columns: int = 2) -> Any:
    """The panels in (beta, gamma, v) with the slow manifold of orders 0 and 1 (the paper's Figure 3D)."""
    import numpy

    figure, axes = grid(len(panels), columns, (4.6, 3.4), below=0.7, projection="3d", computed_zorder=False)
    constants = panels[0].parameters.at(DOUBLE)
    for panel, axis in zip(panels, axes, strict=True):
        omega = float(panel.omega)
        orbits = [_clipped(states) for states in _drawn(panel)]
        low = min(-math.pi / 2, *(float(states[:, 1].min()) for states in orbits))
        high = max(3 * math.pi / 2, *(float(states[:, 1].max()) for states in orbits))
        reach = max(0.75, *(float(abs(states[:, 0] - math.pi / 2).max()) for states in orbits))
        # Close to sin(beta) = 0 the order-1 term diverges: the surface ends where it stops being an approximation.
        reach = min(reach + 0.05, 1.0)
        beta, gamma = numpy.meshgrid(
            numpy.linspace(math.pi / 2 - reach, math.pi / 2 + reach, 33), numpy.linspace(low, high, 65)
        )
        surface = slow_manifold(numpy, constants, omega, beta, gamma, order=1)
        rolling = slow_manifold(numpy, constants, omega, beta, gamma, order=0)
        sheet = axis.plot_surface(beta, gamma, surface, color=GREY, alpha=0.45, lw=0, rstride=1, cstride=1, zorder=1)
        sheet.set_rasterized(True)  # thousands of facets: a vector file of them would be megabytes
        axis.plot_wireframe(beta, gamma, rolling, color="#606060", lw=0.3, alpha=0.6, rstride=8, cstride=8, zorder=1)
        for states, colour in zip(orbits, _ORBITS, strict=True):
            axis.plot(*states.T, color=colour, lw=0.8, zorder=3)
            axis.plot(*states[:1].T, marker="x", ls="none", color="black", ms=6, mew=1.3, zorder=5)
        cycle = last_turn(panel)
        if cycle is not None:
            axis.plot(*cycle.T, color=GREEN, lw=2.0, zorder=4)
        for place, stable in _equilibria(panel, (low, high)):
            _equilibrium_mark(axis, (math.pi / 2,), (place,), stable, z=((0.0,),))
        axis.set_title(panel.scene.title, y=1.03)
        axis.set_xlabel("β [rad]", labelpad=1)
        axis.set_ylabel("γ [rad]", labelpad=3)
        axis.set_zlabel("dβ/dt [rad/s]", labelpad=0)
        axis.set_xticks([math.pi / 2 - 0.5, math.pi / 2, math.pi / 2 + 0.5], ["π/2−0.5", "π/2", "π/2+0.5"])
        _angle_axis(axis.yaxis, low, high)
        axis.tick_params(pad=0, labelsize=8)
        # Near inverted spinning the manifold falls with gamma: seen from this side the orbits on it lie open.
        axis.view_init(elev=30, azim=32)
        axis.set_box_aspect((1, 1.35, 0.8), zoom=1.02)
    _legend(figure, columns if len(panels) > 1 else 1, surface=True)
    # Before Matplotlib 3.11.2 the layout takes ticks in 3D from where the last drawing put them: let there be one.
    layout = figure.get_layout_engine()
    figure.set_layout_engine("none")
    figure.draw_without_rendering()
    figure.set_layout_engine(layout)
    return figure


def scene_tables(panel: Panel) -> dict[str, tuple[Sequence[str], list[Any]]]:
    """Header and rows of ``scene_X_orbit_N.csv`` for each orbit and ``scene_X_slow_manifold.csv`` for the surface."""
    import numpy

    tables: dict[str, tuple[Sequence[str], list[Any]]] = {}
    for index, orbit in enumerate(panel.orbits, start=1):
        kept = (orbit.times <= _CSV_SECONDS).nonzero()[0][::_CSV_EVERY]
        rows = numpy.column_stack((orbit.times[kept], orbit.states[kept])).tolist()
        header = ("t [s]", "beta [rad]", "gamma [rad]", "v [rad/s]")
        tables[f"scene_{panel.scene.name}_orbit_{index}.csv"] = (header, rows)
    constants, omega = panel.parameters.at(DOUBLE), float(panel.omega)
    beta, gamma = numpy.meshgrid(
        numpy.linspace(math.pi / 2 - 1, math.pi / 2 + 1, 33), numpy.linspace(-math.pi / 2, 3 * math.pi / 2, 65)
    )
    surfaces = [slow_manifold(numpy, constants, omega, beta, gamma, order=order).ravel() for order in (0, 1)]
    header = ("beta [rad]", "gamma [rad]", "v at order 0 [rad/s]", "v at order 1 [rad/s]")
    rows = numpy.column_stack((beta.ravel(), gamma.ravel(), *surfaces)).tolist()
    tables[f"scene_{panel.scene.name}_slow_manifold.csv"] = (header, rows)
    return tables


def _panels(audit: Audit, examined: Sequence[str]) -> list[Panel]:
    """The audited set's panels among the claims; one that could not be computed is undecided in the table."""
    panels, reason = [], ""
    for scene in SCENES:
        if f"scene_{scene.name}" in examined:
            try:
                panels.append(audit.panel(scene.name, audit.parameters.name))
            except (Shortfall, ArithmeticError, InputError) as fault:
                reason = reason or str(fault)
    if not panels:
        raise Shortfall(reason)
    return panels


def _endings(panels: Sequence[Panel]) -> str:
    """What the orbits end on, scene by scene."""
    names: dict[tuple[str, ...], list[str]] = {}
    for panel in panels:
        names.setdefault(tuple(dict.fromkeys(orbit.ending.kind for orbit in panel.orbits)), []).append(panel.scene.name)
    said = [f"{', '.join(scenes)}: {' and '.join(kinds)}" for kinds, scenes in names.items()]
    return f"what both orbits end on: {'; '.join(said)}"


def _scenes_3d(audit: Audit, examined: Sequence[str]) -> Drawing:
    panels = _panels(audit, examined)
    rate = -float(stiff_eigenvalue_estimate(audit.parameters))
    return Drawing(
        figure=lambda columns: draw_scenes_3d(panels, columns),
        columns=2,
        reading=f"Orbits fall onto the grey slow manifold, near inverted spinning at a rate of {rate:.3g} 1/s, and "
        f"stay on it; {_endings(panels)}.",
        data={name: table for panel in panels for name, table in scene_tables(panel).items()},
        facts={"scenes": {panel.scene.name: panel.to_dict() for panel in panels}},
        embedded="webp",
    )


def _scenes_2d(audit: Audit, examined: Sequence[str]) -> Drawing:
    panels = _panels(audit, examined)
    orbits = {name: table for panel in panels for name, table in scene_tables(panel).items() if "orbit" in name}
    return Drawing(
        figure=lambda columns: draw_scenes_2d(panels, columns),
        columns=2,
        reading="The same orbits from above: from panel to panel the speed rises, and the cycle (green) shrinks "
        "from one that passes close by both noninverted states to none.",
        data=orbits,
        embedded="webp",
    )


EXHIBITS = (
    Exhibit(
        name="scenes_3d",
        title="Orbits and slow manifold in state space",
        source="Figure 3D",
        alternative="Six panels, one for each speed, with axes beta, gamma and beta's rate: a grey wavy surface, two "
        "orbits from marked starts that drop onto it, the limit cycle where there is one, and the equilibria.",
        draw=_scenes_3d,
        cost=4,
    ),
    Exhibit(
        name="scenes_2d",
        title="The same orbits, projected onto beta and gamma",
        source="Figure proj_3D",
        alternative="Six panels in the plane of beta and gamma: orbits spiral onto a closed curve around inverted "
        "spinning, leave the well in panel a, and spiral into the equilibrium in panel f.",
        draw=_scenes_2d,
    ),
)
