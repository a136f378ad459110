"""The diagrams of the families of limit cycles, librating (Figures HBM and Shooting) and rotating."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from fractions import Fraction
from functools import partial
from typing import Any

from tippedisk_verify.audit.claims import Audit
from tippedisk_verify.cycles.branch_cycles import cycles_found, librating_branch, rotating_branch
from tippedisk_verify.cycles.families.folds import fold_in_double
from tippedisk_verify.cycles.limit_cycle import LimitCycle, RotatingCycle
from tippedisk_verify.cycles.locator import cached_locator
from tippedisk_verify.errors import AccuracyError
from tippedisk_verify.figures.exhibit import Drawing, Exhibit, by_curve
from tippedisk_verify.figures.style import BLACK, BLUE, GREEN, ORANGE, PURPLE, RED, figure_with_axes
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.motion.scenes import SCENES
from tippedisk_verify.theory.hopf import omega_crit, period_crit
from tippedisk_verify.theory.one_harmonic_law import Form, one_harmonic

__all__ = ["draw_branch", "draw_scenario", "family_exhibit", "law_rows", "scenario_exhibit"]

Rows = Sequence[tuple[float, ...]]
_SPEEDS = 24  # of the scenario, on each side of Omega_h
_HEADER = ("Omega [rad/s]", "beta_max [rad]", "T [s]", "slow multiplier [1]")
_AXES = ("largest |β − π/2| [rad]", "period T [s]", "slow Floquet multiplier [1]")
_LAW_STYLES = (("-", GREEN), ("--", ORANGE), ("-.", BLUE))
_LIBRATING, _STABLE, _UNSTABLE = (
    "librating cycles, stable",
    "rotating cycles, stable",
    "rotating cycles, unstable",
)
_FAMILIES = {_LIBRATING: (GREEN, "-"), _STABLE: (ORANGE, "-"), _UNSTABLE: (ORANGE, "--")}


def _rows(cycles: Sequence[LimitCycle | RotatingCycle], *ends: tuple[float, ...]) -> Rows:
    """Return the rows of a plot of limit cycles, sorted by the speed: Omega, beta_max, T and slow
    multiplier of each cycle.

    ``ends`` are further rows, where the family begins or ends.
    """
    names = ("omega", "beta_max", "period", "multiplier_slow")
    return sorted(
        [tuple(float(getattr(cycle, name)) for name in names) for cycle in cycles] + list(ends)
    )


def _hopf_row(parameters: Parameters) -> tuple[float, ...]:
    """Return the row of the Hopf point in a plot of limit cycles: Omega_crit, no amplitude, the
    period there, and the multiplier 1.
    """
    return (float(omega_crit(parameters)), 0.0, float(period_crit(parameters)), 1.0)


def law_rows(parameters: Parameters, speeds: Sequence[float], form: Form) -> Rows:
    """Return the rows of a plot of a one-harmonic law: Omega [rad/s], amplitude [rad] and period
    [s].

    Args:
        parameters: The disk.
        speeds: The speeds [rad/s]; those without a cycle are left out.
        form: The form of the law.
    """
    rows: list[tuple[float, ...]] = []
    for omega in speeds:
        with suppress(AccuracyError):
            cycle = one_harmonic(parameters.with_friction("linear"), Fraction(omega), form)
            rows.append((omega, float(cycle.amplitude), float(cycle.period)))
    return rows


def draw_branch(curves: Mapping[str, Rows], columns: int = 3) -> Any:
    """Draw amplitude, period and slow multiplier of a family of limit cycles against Omega.

    These are the paper's Figures HBM and Shooting.

    Args:
        curves: Rows of Omega, beta_max, T and (optionally) the slow multiplier, by label.
        columns: The number of columns.

    Returns:
        The Matplotlib figure.
    """
    figure, axes = figure_with_axes(3, columns, (3.2, 3.0) if columns > 1 else (4.6, 3.0))
    for column, (axis, name) in enumerate(zip(axes, _AXES, strict=True), start=1):
        for (label, rows), (line, colour) in zip(curves.items(), _LAW_STYLES, strict=True):
            shown = [row for row in rows if len(row) > column]
            axis.plot(
                [r[0] for r in shown], [r[column] for r in shown], line, color=colour, label=label
            )
        axis.set(xlabel="Ω [rad/s]", ylabel=name)
    axes[0].legend()
    return figure


@partial(
    Exhibit,
    name="branch",
    title="The family of limit cycles, and the closed-form laws",
    labels="fig:HBM, fig:Shooting",
    alt_text="Three panels against Omega: amplitude and period of the cycles by shooting, with "
    "both one-harmonic "
    "laws, which start at the Hopf point with the true cycles and fall below them as Omega "
    "decreases; and the slow "
    "multiplier, which rises to one at the Hopf point.",
)
def family_exhibit(audit: Audit, examined: Sequence[str]) -> Drawing:
    """Draw the audited disk's family of limit cycles with both one-harmonic laws."""
    parameters = audit.parameters
    rows = _rows(audit.family(parameters.name), _hopf_row(parameters))
    speeds = [row[0] for row in rows]
    curves = {
        "shooting": rows,
        "law as printed": law_rows(parameters, speeds, "printed"),
        "law with the term kept": law_rows(parameters, speeds, "consistent"),
    }
    first, largest = rows[0], max(row[3] for row in rows[:-1])
    padded = {name: [(*row, "")[:4] for row in curve] for name, curve in curves.items()}
    return Drawing(
        figure=lambda columns: draw_branch(curves, columns),
        columns=3,
        caption=f"From the Hopf point down to Omega = {first[0]:.6g} rad/s the amplitude grows to "
        f"{first[1]:.3g} "
        f"rad and the period to {first[2]:.3g} s; the slow multiplier is at most {largest:.4f}"
        f"{': every cycle attracts' if largest < 1 else ''}. Away from the Hopf point neither law "
        f"gives the period.",
        data={"branch.csv": by_curve(_HEADER, padded)},
    )


def draw_scenario(
    families: Mapping[str, Rows], scenes: Mapping[str, float], omega_h: float, columns: int = 2
) -> Any:
    """Draw largest lean and period of all families of limit cycles against Omega.

    The Hopf point, Omega_h, the fold and the six scenes are marked.

    Args:
        families: The rows of each family, as `_rows` returns them.
        scenes: The speed [rad/s] of each scene.
        omega_h: Omega_h [rad/s].
        columns: The number of columns.

    Returns:
        The Matplotlib figure.
    """
    figure, axes = figure_with_axes(2, columns, (4.6, 3.8), below=0.9 if columns > 1 else 1.5)
    birth, fold = families[_LIBRATING][-1], families[_STABLE][0]
    left, right = fold[0] - 0.12, families[_UNSTABLE][-1][0] + 0.05

    def draw(axis: Any, column: int) -> None:
        for name, (colour, line) in _FAMILIES.items():
            rows = families[name]
            axis.plot(
                [r[0] for r in rows],
                [r[column] for r in rows],
                line,
                color=colour,
                lw=1.8,
                label=name,
            )
        if column == 1:
            axis.plot(
                [left, birth[0]],
                [0, 0],
                "--",
                color=BLACK,
                lw=1.1,
                label="inverted spinning, unstable",
            )
            axis.plot(
                [birth[0], right],
                [0, 0],
                "-",
                color=BLACK,
                lw=1.8,
                label="inverted spinning, stable",
            )
        axis.plot(birth[0], birth[column], "s", color=RED, ms=6, label="Hopf point", zorder=5)
        axis.plot(fold[0], fold[column], "D", color=PURPLE, ms=6, label="fold", zorder=5)
        axis.axvline(omega_h, color=BLUE, lw=1.0, ls=":", label=r"$\Omega_\mathrm{h}$", zorder=1)

    # An inset magnifies the range where rotating cycles turn into librating ones.
    gap = omega_h - fold[0]
    near, far = fold[0] - gap / 4, omega_h + gap / 2
    for column, place in ((1, (0.66, 0.27, 0.31, 0.34)), (2, (0.36, 0.46, 0.59, 0.46))):
        axis = axes[column - 1]
        draw(axis, column)
        axis.set(xlim=(left, right), xlabel="Ω [rad/s]", ylabel=_AXES[column - 1])
        inset = axis.inset_axes(place)
        draw(inset, column)
        heights = [row[column] for rows in families.values() for row in rows if near < row[0] < far]
        margin = (max(heights) - min(heights)) / 20
        inset.set(xlim=(near, far), ylim=(min(heights) - margin, max(heights) + margin))
        inset.tick_params(labelsize=7)
        inset.locator_params(axis="x", nbins=3)
        axis.indicate_inset_zoom(inset, edgecolor=BLACK, lw=0.6)
    for name, omega in scenes.items():
        axes[0].annotate(name, (omega, 0), xytext=(0, -14), textcoords="offset points", ha="center")
        axes[0].plot(omega, 0, "|", color=BLACK, ms=9, zorder=4)
    axes[0].set_ylim(bottom=-0.07 * max(row[1] for row in families[_UNSTABLE]))
    axes[1].set_ylim(bottom=0)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3 if columns > 1 else 2)
    return figure


@partial(
    Exhibit,
    name="scenario",
    title="The whole scenario: librating and rotating limit cycles, and where the six scenes lie",
    labels="fig:sketch",
    alt_text="Two panels against Omega, largest lean and period: librating cycles between "
    "Omega_h and the Hopf "
    "point, stable rotating cycles in a short range below Omega_h down to a fold, and from it "
    "dashed unstable ones "
    "over the whole range of speeds; at Omega_h the periods of both stable families go to "
    "infinity. Letters a to f "
    "mark the speeds of the six scenes.",
    cost=8,
)
def scenario_exhibit(audit: Audit, examined: Sequence[str]) -> Drawing:
    """Draw every family of limit cycles of the audited disk.

    Raises:
        NoSuchCycleError: If no rotating cycles are found.
    """
    parameters, name, engine = audit.parameters, audit.parameters.name, audit.engine
    omega_h, birth = audit.omega_h(name), _hopf_row(parameters)
    fold = fold_in_double(cached_locator(parameters, engine).rotating_family)
    lowest = Fraction(fold["omega"])
    gap = omega_h.value - lowest
    # Curves are steepest at the fold and next to Omega_h, so the speeds are densest there.
    steps = [gap * Fraction((1 - math.cos(math.pi * n / _SPEEDS)) / 2) for n in range(1, _SPEEDS)]
    librating = [
        *audit.family(name),
        *cycles_found(
            librating_branch(parameters, engine, omegas=[omega_h.value + s for s in steps])
        ),
    ]
    speed_range = Fraction(birth[0]) + Fraction(1, 2) - omega_h.value
    beyond = [omega_h.value + speed_range * Fraction(n, _SPEEDS) for n in range(1, _SPEEDS + 1)]
    rotating = cycles_found(
        rotating_branch(parameters, engine, [*(lowest + s for s in steps), *beyond])
    )
    end = (fold["omega"], fold["beta_max"], fold["period"], 1.0)
    families = {
        _LIBRATING: _rows(librating, birth),
        _STABLE: _rows([cycle for cycle in rotating if cycle.stable], end),
        _UNSTABLE: _rows([cycle for cycle in rotating if not cycle.stable], end),
    }
    scenes = {scene.name: float(scene.omega(parameters, omega_h)) for scene in SCENES}
    marks: dict[str, Sequence[Sequence[object]]] = {
        f"scene {scene}": [(omega, 0.0, "", "")] for scene, omega in scenes.items()
    }
    return Drawing(
        figure=lambda columns: draw_scenario(families, scenes, float(omega_h), columns),
        columns=2,
        caption=f"At Omega_h = {float(omega_h):.7g} rad/s the librating cycle is glued from two "
        f"that rotate, one each "
        f"way, which exist from a fold at {float(lowest):.7g} rad/s on. The unstable ones born "
        f"there continue past "
        f"Omega_crit = {birth[0]:.7g} rad/s, and starts beyond their stable manifolds end flat. "
        f"The letters mark "
        "the speeds of the six scenes.",
        data={"scenario.csv": by_curve(_HEADER, {**families, **marks})},
    )
