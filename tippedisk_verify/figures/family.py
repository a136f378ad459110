"""The families of limit cycles (the paper's Figures Shooting and sketch), and the whole scenario."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

from tippedisk_verify.atlas.branch import family, rotating_branch
from tippedisk_verify.audit.claims import Audit
from tippedisk_verify.cycles.limit_cycle import LimitCycle, RotatingCycle
from tippedisk_verify.errors import Shortfall
from tippedisk_verify.figures.exhibit import Drawing, Exhibit
from tippedisk_verify.figures.style import BLACK, BLUE, GREEN, ORANGE, PURPLE, RED, grid
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.motion.scenes import SCENES
from tippedisk_verify.theory.harmonic_balance import one_harmonic
from tippedisk_verify.theory.hopf import omega_crit, period_crit

__all__ = [
    "EXHIBITS",
    "branch_rows",
    "draw_branch",
    "draw_scenario",
    "draw_sketch",
    "law_rows",
    "rotating_rows",
    "scenario",
]

Rows = list[tuple[float, ...]]
_SPEEDS = 24  # of the scenario, on either side of Omega_h
_HEADER = ("Omega [rad/s]", "beta_max [rad]", "T [s]", "slow multiplier")


def branch_rows(parameters: Parameters, cycles: Sequence[LimitCycle]) -> Rows:
    """Omega, beta_max, T and slow multiplier of each cycle, and the Hopf point, where the family is born."""
    rows = [_row(cycle) for cycle in sorted(cycles, key=lambda cycle: cycle.omega.value)]
    return [*rows, (float(omega_crit(parameters)), 0.0, float(period_crit(parameters)), 1.0)]


def rotating_rows(cycles: Sequence[RotatingCycle], fold: Mapping[str, float]) -> tuple[Rows, Rows]:
    """The same of the rotating cycles: of the stable ones and of the unstable ones, both from their fold on."""
    ends = [(fold["omega"], fold["beta_max"], fold["period"], 1.0)]
    stable, unstable = (
        sorted(ends + [_row(cycle) for cycle in cycles if cycle.stable is kind]) for kind in (True, False)
    )
    return stable, unstable


def _row(cycle: LimitCycle | RotatingCycle) -> tuple[float, ...]:
    return tuple(float(getattr(cycle, name)) for name in ("omega", "beta_max", "period", "multiplier_slow"))


def law_rows(parameters: Parameters, speeds: Sequence[float]) -> Rows:
    """Omega, amplitude and period by the printed one-harmonic law, where it has a cycle."""
    rows: Rows = []
    for omega in speeds:
        try:
            cycle = one_harmonic(parameters.with_friction("linear"), Fraction(omega), "printed")
        except Shortfall:
            continue
        rows.append((omega, float(cycle.amplitude), float(cycle.period)))
    return rows


def draw_branch(rows: Rows, law: Rows, columns: int = 3) -> Any:
    """Amplitude, period and slow multiplier of the family against Omega (the paper's Figure Shooting)."""
    figure, axes = grid(3, columns, (3.9, 3.2))
    names = ("largest |β − π/2| [rad]", "period T [s]", "slow Floquet multiplier [1]")
    for column, (axis, name) in enumerate(zip(axes, names, strict=True), start=1):
        axis.plot([r[0] for r in rows], [r[column] for r in rows], color=GREEN, lw=1.8, label="shooting")
        if column < 3:
            axis.plot([r[0] for r in law], [r[column] for r in law], "--", color=BLACK, lw=1.1, label="printed law")
        axis.set(xlabel="Ω [rad/s]", ylabel=name)
        axis.grid(lw=0.3, alpha=0.5)
    axes[0].legend(frameon=False)
    return figure


def draw_scenario(librating: Rows, stable: Rows, unstable: Rows, omega_h: float, columns: int = 2) -> Any:
    """Largest lean and period of all families against Omega, with Hopf point, Omega_h and fold."""
    figure, axes = grid(2, columns, (4.6, 3.6), below=0.9 if columns > 1 else 1.5)
    fold, crit = stable[0][0], librating[-1][0]
    left, right, room = fold - 0.12, unstable[-1][0], omega_h - fold
    curves = (
        (librating, GREEN, "-", "librating cycles, stable"),
        (stable, ORANGE, "-", "rotating cycles, stable"),
        (unstable, ORANGE, "--", "rotating cycles, unstable"),
    )

    def draw(axis: Any, column: int) -> None:
        for rows, colour, style, label in curves:
            axis.plot(
                [r[0] for r in rows], [r[column] for r in rows], style, color=colour, lw=1.8, label=label, zorder=3
            )
        if column == 1:
            axis.plot([left, crit], [0, 0], "--", color=BLACK, lw=1.1, label="inverted spinning, unstable")
            axis.plot([crit, right], [0, 0], "-", color=BLACK, lw=1.8, label="inverted spinning, stable")
        axis.plot([crit], [librating[-1][column]], "s", color=RED, ms=6, label="Hopf point", zorder=5)
        axis.plot([fold], [stable[0][column]], "D", color=PURPLE, ms=6, label="fold", zorder=5)
        axis.axvline(omega_h, color=BLUE, lw=1.0, ls=":", label=r"$\Omega_\mathrm{h}$", zorder=1)
        axis.grid(lw=0.3, alpha=0.5)

    # Where the rotating cycles turn into the librating one the curves are drawn once more.
    near, far = fold - room / 4, omega_h + room / 2
    names = ("largest |β − π/2| [rad]", "period T [s]")
    places = ((0.66, 0.27, 0.31, 0.34), (0.36, 0.46, 0.59, 0.46))
    for column, (axis, name, place) in enumerate(zip(axes, names, places, strict=True), start=1):
        draw(axis, column)
        axis.set(xlim=(left, right), xlabel="Ω [rad/s]", ylabel=name)
        inset = axis.inset_axes(place)
        draw(inset, column)
        heights = [row[column] for rows, *_ in curves for row in rows if near < row[0] < far]
        margin = (max(heights) - min(heights)) / 20
        inset.set(xlim=(near, far), ylim=(min(heights) - margin, max(heights) + margin))
        inset.tick_params(labelsize=7)
        inset.locator_params(axis="x", nbins=3)
        axis.indicate_inset_zoom(inset, edgecolor=BLACK, lw=0.6)
    axes[1].set_ylim(0)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3 if columns > 1 else 2, frameon=False)
    return figure


def draw_sketch(rows: Rows, marks: Sequence[tuple[str, float, bool, float | None]], columns: int = 2) -> Any:
    """Where the six scenes lie in the bifurcation diagram (the paper's Figure sketch).

    ``marks`` are (scene, Omega, whether inverted spinning is stable, amplitude of the limit cycle or None); one
    column is for small screens.
    """
    figure, (axis,) = grid(1, 1, (6.4, 3.6) if columns > 1 else (4.2, 3.8))
    axis.plot([r[0] for r in rows], [r[1] for r in rows], color=GREEN, lw=1.8, label="limit cycles", zorder=2)
    crit = rows[-1][0]
    left, right = min(mark[1] for mark in marks) - 0.15, max(mark[1] for mark in marks) + 0.15
    axis.plot([left, crit], [0, 0], "--", color=BLACK, lw=1.1, label="inverted spinning, unstable", zorder=1)
    axis.plot([crit, right], [0, 0], "-", color=RED, lw=1.8, label="inverted spinning, stable", zorder=1)
    for name, omega, stable, top in marks:
        axis.plot([omega], [0], "o", ms=6, mec=RED if stable else BLACK, mfc=RED if stable else "white", zorder=4)
        if top is not None:
            axis.plot([omega], [top], "s", ms=6, color=GREEN, zorder=4)
        place = top if top is not None else 0.0
        axis.annotate(name, (omega, place), xytext=(5, 5), textcoords="offset points", fontsize=10)
    axis.axvline(rows[0][0], color=BLUE, lw=0.8, ls=":", label=r"$\Omega_\mathrm{h}$")
    axis.set(xlim=(left, right), xlabel="Ω [rad/s]", ylabel="largest |β − π/2| [rad]")
    axis.margins(y=0.1)
    axis.grid(lw=0.3, alpha=0.5)
    axis.legend(frameon=False)
    return figure


def _branch(audit: Audit, examined: Sequence[str]) -> Drawing:
    parameters = audit.parameters
    rows = branch_rows(parameters, audit.family(parameters.name))
    law = law_rows(parameters, [row[0] for row in rows[:-1]])
    table = [("shooting", *row) for row in rows] + [("printed law", *row, "") for row in law]
    first, largest = rows[0], max(row[3] for row in rows[:-1])
    return Drawing(
        figure=lambda columns: draw_branch(rows, law, columns),
        columns=3,
        reading=f"From the Hopf point down to Omega = {first[0]:.6g} rad/s the amplitude grows to {first[1]:.3g} "
        f"rad and the period to {first[2]:.3g} s; the slow multiplier is at most {largest:.4f}"
        f"{': every cycle attracts' if largest < 1 else ''}.",
        data={"branch.csv": (("curve", *_HEADER), table)},
    )


def scenario(audit: Audit, examined: Sequence[str] = ()) -> Drawing:
    """Every family of limit cycles of the audited disk. Raises Shortfall where no rotating cycles are found."""
    parameters, name, engine = audit.parameters, audit.parameters.name, audit.engine
    omega_h, crit = audit.omega_h(name).value, omega_crit(parameters, 20).value
    fold = audit.rotation_fold(name)
    if fold is None:
        raise Shortfall("no rotating cycles found with a fold")
    lowest = Fraction(fold["omega"])
    room = omega_h - lowest
    # Curves are steepest at the fold and on both sides of Omega_h: speeds lie closest together there.
    steps = [room * Fraction((1 - math.cos(math.pi * n / _SPEEDS)) / 2) for n in range(1, _SPEEDS)]
    librating = branch_rows(
        parameters, [*audit.family(name), *family(parameters, engine, omegas=[omega_h + s for s in steps])]
    )
    beyond = [omega_h + (crit + Fraction(1, 2) - omega_h) * Fraction(n, _SPEEDS) for n in range(1, _SPEEDS + 1)]
    speeds = [*(lowest + s for s in steps), *beyond]
    stable, unstable = rotating_rows(list(rotating_branch(parameters, engine, speeds)), fold)
    families = {"librating": librating, "rotating, stable": stable, "rotating, unstable": unstable}
    return Drawing(
        figure=lambda columns: draw_scenario(librating, stable, unstable, float(omega_h), columns),
        columns=2,
        reading=f"At Omega_h = {float(omega_h):.7g} rad/s the librating cycle is glued from two that rotate, one each "
        f"way, which exist from a fold at {float(lowest):.7g} rad/s on; the unstable ones born there go on past "
        f"Omega_crit = {librating[-1][0]:.7g} rad/s, and what starts beyond their stable manifolds lies flat.",
        data={"scenario.csv": (("family", *_HEADER), [(kind, *r) for kind, rows in families.items() for r in rows])},
    )


def _sketch(audit: Audit, examined: Sequence[str]) -> Drawing:
    import numpy

    parameters = audit.parameters
    rows = branch_rows(parameters, audit.family(parameters.name))
    omega_h, crit = audit.omega_h(parameters.name), float(omega_crit(parameters))
    marks: list[tuple[str, float, bool, float | None]] = []
    for scene in SCENES:
        omega = float(scene.omega(parameters, omega_h))
        inside = float(omega_h) < omega < crit
        top = float(numpy.interp(omega, [r[0] for r in rows], [r[1] for r in rows])) if inside else None
        marks.append((scene.name, omega, omega > crit, top))
    table = [("limit cycles", "", row[0], row[1]) for row in rows]
    table += [("inverted spinning", name, omega, 0.0) for name, omega, _, _ in marks]
    table += [("limit cycle of a scene", name, omega, top) for name, omega, _, top in marks if top is not None]
    return Drawing(
        figure=lambda columns: draw_sketch(rows, marks, columns),
        columns=2,
        reading=_places(marks, float(omega_h), crit),
        data={"sketch.csv": (("what", "scene", "Omega [rad/s]", "largest |beta - pi/2| [rad]"), table)},
    )


def _places(marks: Sequence[tuple[str, float, bool, float | None]], omega_h: float, crit: float) -> str:
    """Which scenes lie where."""
    said = [
        (
            "below Omega_h",
            f"{omega_h:.6g} rad/s, no cycle about inverted spinning",
            [m[0] for m in marks if m[3] is None and not m[2]],
        ),
        ("between them", "a cycle attracts", [m[0] for m in marks if m[3] is not None]),
        ("above Omega_crit", f"{crit:.6g} rad/s, inverted spinning attracts", [m[0] for m in marks if m[2]]),
    ]
    text = "; ".join(f"{where} ({what}): {', '.join(names)}" for where, what, names in said if names)
    return f"{text[0].upper()}{text[1:]}."


EXHIBITS = (
    Exhibit(
        name="branch",
        title="The family of limit cycles",
        source="Figure Shooting",
        alternative="Three panels against Omega: amplitude and period of the cycles by shooting with the printed law "
        "dashed beside them, and the slow multiplier, which rises to one at the Hopf point.",
        draw=_branch,
    ),
    Exhibit(
        name="scenario",
        title="The whole scenario: librating and rotating limit cycles",
        source="",
        alternative="Two panels against Omega, largest lean and period: librating cycles between Omega_h and the Hopf "
        "point, stable rotating cycles in a short range below Omega_h down to a fold, and from it dashed unstable ones "
        "over the whole range of speeds; at Omega_h the periods of both stable families go to infinity.",
        draw=scenario,
        cost=8,
    ),
    Exhibit(
        name="sketch",
        title="Where the six scenes lie",
        source="Figure sketch",
        alternative="Bifurcation diagram: the amplitude of the cycles against Omega, with squares at the scenes' "
        "cycles, and on the axis below circles for inverted spinning, filled where it is stable.",
        draw=_sketch,
    ),
)
