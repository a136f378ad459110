"""The eigenvalues of inverted spinning against the speed (the paper's Figure bif_dia_3)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

from tippedisk_verify.audit.claims import Audit
from tippedisk_verify.figures.exhibit import Drawing, Exhibit
from tippedisk_verify.figures.style import BLACK, BLUE, ORANGE, figure_with_axes
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.theory.equilibria import equilibrium
from tippedisk_verify.theory.hopf import omega_crit

__all__ = ["draw_eigenvalues", "eigenvalue_exhibit", "eigenvalue_rows"]

_STEPS = 200  # up to Omega_crit; where the two real eigenvalues meet they change like a square root


def eigenvalue_rows(parameters: Parameters) -> list[tuple[float, ...]]:
    """Return the rows of a plot of inverted spinning's three eigenvalues: Omega [rad/s], and their
    Re and Im [1/s].

    The speeds go up to 2 Omega_crit.
    """
    rows, crit = [], float(omega_crit(parameters))
    for omega in (crit * step / _STEPS for step in range(1, 2 * _STEPS + 1)):
        eigenvalues = equilibrium(parameters, omega, "inverted", 12).eigenvalues
        rows.append(
            (omega, *(float(part) for value in eigenvalues for part in (value.re, value.im)))
        )
    return rows


def draw_eigenvalues(rows: Sequence[Sequence[float]], crit: float, columns: int = 2) -> Any:
    """Draw the eigenvalues of inverted spinning against Omega.

    Args:
        rows: The rows of `eigenvalue_rows`.
        crit: Omega_crit [rad/s].
        columns: The number of columns.

    Returns:
        The Matplotlib figure.
    """
    figure, axes = figure_with_axes(2, columns, (4.6, 3.2))
    omega, *parts = zip(*rows, strict=True)
    for column, (axis, name) in enumerate(zip(axes, ("Re λ [1/s]", "Im λ [1/s]"), strict=True)):
        axis.axhline(0, color=BLACK, lw=0.6)
        axis.plot(omega, parts[column], color=BLUE, label="λ₁")
        axis.plot(omega, parts[column + 2], "--", color=ORANGE, label="λ₂")
        axis.axvline(crit, color=BLACK, lw=0.7, ls=":", label=r"$\Omega_\mathrm{crit}$")
        axis.set(xlabel="Ω [rad/s]", ylabel=name)
    axes[0].legend()
    return figure


@partial(
    Exhibit,
    name="eigenvalues",
    title="Eigenvalues of inverted spinning against the speed",
    labels="fig:bif_dia_3",
    alt_text="Two panels, real and imaginary part of two eigenvalues against Omega: two real "
    "ones meet, "
    "become a complex pair, and cross to negative real part at Omega_crit.",
)
def eigenvalue_exhibit(audit: Audit, examined: Sequence[str]) -> Drawing:
    """Draw the eigenvalues of inverted spinning of the audited disk against the speed."""
    rows = eigenvalue_rows(audit.parameters)
    crit = float(omega_crit(audit.parameters))
    third = [row[5] for row in rows]
    header = (
        "Omega [rad/s]",
        *(f"{part} lambda_{n} [1/s]" for n in (1, 2, 3) for part in ("Re", "Im")),
    )
    return Drawing(
        figure=lambda columns: draw_eigenvalues(rows, crit, columns),
        columns=2,
        caption=f"The real part of the pair changes sign at Omega_crit = {crit:.6g} rad/s (dotted "
        f"line); lambda_3, not "
        f"shown, stays between {min(third):.4g} and {max(third):.4g} 1/s.",
        data={"eigenvalues.csv": (header, rows)},
    )
