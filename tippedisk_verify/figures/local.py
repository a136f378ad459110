"""Inverted spinning and the cycles near the Hopf point (the paper's Figures bif_dia_3 and HBM)."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Any

from tippedisk_verify.audit.claims import Audit
from tippedisk_verify.cycles.spectral import balanced_cycle
from tippedisk_verify.errors import NoSuchCycleError, Shortfall
from tippedisk_verify.figures.exhibit import Drawing, Exhibit
from tippedisk_verify.figures.style import BLACK, BLUE, GREEN, ORANGE, grid
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.theory.equilibria import equilibrium
from tippedisk_verify.theory.harmonic_balance import one_harmonic, slopes
from tippedisk_verify.theory.hopf import hopf_point, omega_crit, period_crit

__all__ = ["EXHIBITS", "draw_eigenvalues", "draw_harmonic_balance", "eigenvalue_rows", "harmonic_balance_rows"]

#: Omega_crit - Omega [rad/s] at which cycles are balanced, as long as there is one.
_DISTANCES = ("1e-3", "0.01", "0.03", "0.07", "0.12", "0.2", "0.3", "0.4", "0.5", "0.6", "0.7", "0.76", "0.8", "0.82")


def eigenvalue_rows(parameters: Parameters) -> list[tuple[float, ...]]:
    """Omega, then Re and Im of each eigenvalue of inverted spinning, up to twice Omega_crit.

    The pair meets at a square-root point, where 80 even speeds would cut the corner: speeds close up there.
    """
    crit = float(omega_crit(parameters))
    speeds = [crit * step / 40 for step in range(1, 81)]

    def row(omega: float) -> tuple[float, ...]:
        eigenvalues = equilibrium(parameters, omega, "inverted", 12).eigenvalues
        return (omega, *(float(part) for value in eigenvalues for part in (value.re, value.im)))

    rows = [row(omega) for omega in speeds]
    for before, after in pairwise(rows):
        if (before[2] == 0) != (after[2] == 0):  # the imaginary part of the first appears or vanishes
            low, high, real = before[0], after[0], before[2] == 0
            while high - low > 1e-9 * crit:
                middle = (low + high) / 2
                low, high = (middle, high) if (row(middle)[2] == 0) == real else (low, middle)
            gaps = [(after[0] - before[0]) * 4.0**-power for power in range(1, 8)]
            speeds += [low, *(low - gap for gap in gaps), *(high + gap for gap in gaps)]
    return [row(omega) for omega in sorted(speeds)]


def draw_eigenvalues(rows: Sequence[Sequence[float]], crit: float, columns: int = 2) -> Any:
    """Eigenvalues of inverted spinning against Omega (the paper's Figure bif_dia_3)."""
    figure, axes = grid(2, columns, (4.6, 3.2))
    for column, (axis, name) in enumerate(zip(axes, ("Re λ [1/s]", "Im λ [1/s]"), strict=True)):
        for pair, (style, label) in enumerate((("-", "λ₁"), ("--", "λ₂"))):
            axis.plot(
                [row[0] for row in rows],
                [row[1 + 2 * pair + column] for row in rows],
                style,
                color=(BLUE, ORANGE)[pair],
                lw=1.5,
                label=label,
            )
        axis.axvline(crit, color="black", lw=0.7, ls=":", label=r"$\Omega_\mathrm{crit}$")
        axis.axhline(0, color="black", lw=0.6)
        axis.set(xlabel="Ω [rad/s]", ylabel=name)
        axis.grid(lw=0.3, alpha=0.5)
    axes[0].legend(frameon=False)
    return figure


def _eigenvalues(audit: Audit, examined: Sequence[str]) -> Drawing:
    rows = eigenvalue_rows(audit.parameters)
    crit = float(omega_crit(audit.parameters))
    third = [row[5] for row in rows]
    header = ("Omega [rad/s]", *(f"{part} lambda_{n} [1/s]" for n in (1, 2, 3) for part in ("Re", "Im")))
    return Drawing(
        figure=lambda columns: draw_eigenvalues(rows, crit, columns),
        columns=2,
        reading=f"The real part of the pair changes sign at Omega_crit = {crit:.6g} rad/s (grey line); lambda_3, not "
        f"shown, stays between {min(third):.4g} and {max(third):.4g} 1/s.",
        data={"eigenvalues.csv": (header, rows)},
    )


def harmonic_balance_rows(
    parameters: Parameters, distances: Sequence[str] = _DISTANCES
) -> dict[str, list[tuple[float, float, float]]]:
    """Omega, amplitude and period by the printed law, the consistent one, and numerical harmonic balance.

    ``distances`` are Omega_crit - Omega [rad/s], rising. Speeds at which a law or the balance has no cycle are left
    out of its curve.
    """
    parameters = parameters.with_friction("linear")
    crit, birth = omega_crit(parameters, 40).value, float(period_crit(parameters))
    curves = {name: [(float(crit), 0.0, birth)] for name in ("printed", "consistent", "numerical")}
    # The laws are formulas: drawn at many speeds, so that their curves are smooth where the amplitude grows steeply.
    furthest = Fraction(distances[-1])
    for step in range(1, 61):
        speed = crit - furthest * Fraction(step, 60) ** 2
        for form in ("printed", "consistent"):
            try:
                law = one_harmonic(parameters, speed, form)
            except Shortfall:
                continue
            curves[form].append((float(speed), float(law.amplitude), float(law.period)))
    for text in distances:
        speed = crit - Fraction(text)
        try:
            cycle = balanced_cycle(parameters, speed, digits=8)
        except NoSuchCycleError:
            continue
        curves["numerical"].append((float(speed), float(cycle.beta_max), float(cycle.period)))
    return curves


def draw_harmonic_balance(curves: dict[str, list[tuple[float, float, float]]], columns: int = 2) -> Any:
    """Amplitude and period near Omega_crit: the paper's Figure HBM with the truth beside it."""
    figure, axes = grid(2, columns, (4.6, 3.3))
    styles = {"printed": ("--", ORANGE), "consistent": ("-.", BLUE), "numerical": ("o", GREEN)}
    labels = {"printed": "law as printed", "consistent": "consistent law", "numerical": "numerical balance (truth)"}
    for column, (axis, name) in enumerate(zip(axes, ("amplitude of β [rad]", "period T [s]"), strict=True), start=1):
        for key, points in curves.items():
            line, colour = styles[key]
            axis.plot(
                [p[0] for p in points], [p[column] for p in points], line, color=colour, lw=1.5, ms=4, label=labels[key]
            )
        begin = curves["numerical"][0]
        axis.plot(begin[0], begin[column], "D", color=BLACK, ms=5, label="Hopf point")
        axis.set(xlabel="Ω [rad/s]", ylabel=name)
        axis.grid(lw=0.3, alpha=0.5)
    axes[0].margins(y=0.08)
    axes[0].legend(frameon=False)
    return figure


def _harmonic_balance(audit: Audit, examined: Sequence[str]) -> Drawing:
    curves = harmonic_balance_rows(audit.parameters)
    linear = audit.linear(audit.parameters.name)
    law, truth = slopes(linear, "printed"), hopf_point(linear).slopes()
    amplitude, period = (100 * (float(mine) / float(right) - 1) for mine, right in zip(law, truth, strict=True))
    rows = [(key, *point) for key, points in curves.items() for point in points]
    return Drawing(
        figure=lambda columns: draw_harmonic_balance(curves, columns),
        columns=2,
        reading=f"At the Hopf point the printed law's slope is off by {amplitude:+.2g} % for the amplitude squared and "
        f"by {period:+.2g} % for the period; away from it both laws lose the period.",
        data={"harmonic_balance.csv": (("curve", "Omega [rad/s]", "beta_max [rad]", "T [s]"), rows)},
    )


EXHIBITS = (
    Exhibit(
        name="eigenvalues",
        title="Eigenvalues of inverted spinning against the speed",
        source="Figure bif_dia_3",
        alternative="Two panels, real and imaginary part of two eigenvalues against Omega: two real ones meet, "
        "become a complex pair, and cross to negative real part at Omega_crit.",
        draw=_eigenvalues,
    ),
    Exhibit(
        name="harmonic_balance",
        title="Closed-form amplitude and period against the truth",
        source="Figure HBM",
        alternative="Two panels, amplitude and period against Omega below Omega_crit: both one-harmonic laws start at "
        "the Hopf point with the true cycles and fall below them as Omega decreases.",
        draw=_harmonic_balance,
        laws=("linear",),
        cost=3,
    ),
)
