"""The claim that all printed closed-form numbers follow from Table 1 at once, and what these numbers are."""

from __future__ import annotations

from fractions import Fraction

from tippedisk_verify.audit.claims import EXACT, Audit, Claim, ProofOffer, compared, rounds_to
from tippedisk_verify.audit.table_rounding import inside_table
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.theory import harmonic_balance
from tippedisk_verify.theory.equilibria import stiff_eigenvalue_estimate
from tippedisk_verify.theory.hopf import omega_crit, period_crit

__all__ = ["TABLE_CLAIMS", "chi", "critical_period", "critical_speed", "stiff_eigenvalue"]


def critical_speed(audit: Audit, name: str) -> Measured:
    """Omega_crit of a set [rad/s]."""
    return omega_crit(audit.sets[name], max(audit.digits, 12))


def critical_period(audit: Audit, name: str) -> Measured:
    """The period at the Hopf point of a set [s]."""
    return period_crit(audit.sets[name], max(audit.digits, 12))


def stiff_eigenvalue(audit: Audit, name: str) -> Measured:
    """A_33 of a set [1/s], the leading term of the stiff eigenvalue."""
    return Measured(stiff_eigenvalue_estimate(audit.sets[name]), Fraction(0))


def chi(audit: Audit, name: str) -> Measured:
    """The printed chi of a set [kg m^3]."""
    return Measured(harmonic_balance.chi(audit.sets[name].rational(), "printed"), Fraction(0))


def _joint(audit: Audit, name: str, printed: str) -> tuple[str, bool]:
    """Whether the set lies inside Table 1's rounding and reproduces all printed closed-form numbers at once."""
    pairs = zip(printed.split(", "), (critical_speed, critical_period, stiff_eigenvalue, chi), strict=True)
    missed = [text for text, compute in pairs if not rounds_to(compute(audit, name), text)]
    inside = inside_table(audit.sets[name])
    where = "inside" if inside else "outside"
    return f"{where} the rounding, misses {', '.join(missed) or 'none'}", inside and not missed


#: In the order of the paper.
TABLE_CLAIMS: tuple[Claim, ...] = (
    Claim(
        "table_1",
        "tab:dim_mass, eq:closed_la3, eq:approx_omega_crit, eq:Csol+1",
        "the printed closed-form numbers follow from Table 1",
        "30.92, 0.886, -129.04, 1.31e-7",
        compared(_joint, "yes: calibrated does, with Omega_h = 30.07 as well (claim omega_h)", EXACT),
        formula=r"r,\; e,\; m,\; A,\; B \;\mapsto\; \Omega_\text{crit},\; T_\text{crit},\; A_{33},\; \chi",
        proof=ProofOffer(
            "Theorem 3",
            ("certify hopf",),
            "enclosures of the four numbers; whether the disk rounds to Table 1 is seen from its decimals",
            law="linear",
        ),
    ),
)
