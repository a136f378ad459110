"""The claim that all printed closed-form numbers follow from Table 1 at once, and what these numbers are."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from tippedisk_verify.audit.claims import Audit, Claim, ProofOffer, rounds_to
from tippedisk_verify.audit.table_rounding import inside_table
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.theory import harmonic_balance
from tippedisk_verify.theory.equilibria import stiff_eigenvalue_estimate
from tippedisk_verify.theory.hopf import omega_crit, period_crit

__all__ = ["TABLE_CLAIMS", "closed_form"]


#: The printed closed forms by claim, of a set, to so many digits.
_NUMBERS: dict[str, Callable[[Parameters, int], Measured]] = {
    "omega_crit": omega_crit,
    "period_crit": period_crit,
    "lambda_3": lambda parameters, digits: Measured(stiff_eigenvalue_estimate(parameters), Fraction(0)),
    "chi": lambda parameters, digits: Measured(harmonic_balance.chi(parameters.rational(), "printed"), Fraction(0)),
}


def closed_form(name: str) -> Callable[[Audit, str], Measured]:
    """The number that a claim prints, of a set."""
    return lambda audit, set_name: _NUMBERS[name](audit.sets[set_name], max(audit.digits, 12))


def _joint(audit: Audit, name: str, printed: str) -> tuple[str, bool]:
    """Whether the set lies inside Table 1's rounding and reproduces all printed closed-form numbers at once."""
    pairs = zip(printed.split(", "), _NUMBERS, strict=True)
    missed = [text for text, claim in pairs if not rounds_to(closed_form(claim)(audit, name), text)]
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
        _joint,
        note="yes: calibrated does, with Omega_h = 30.07 as well (claim omega_h)",
        formula=r"r,\; e,\; m,\; A,\; B \;\mapsto\; \Omega_\text{crit},\; T_\text{crit},\; A_{33},\; \chi",
        proof=ProofOffer(
            "Theorem 3",
            ("certify hopf",),
            "enclosures of the four numbers; whether the disk rounds to Table 1 is seen from its decimals",
            law="linear",
        ),
    ),
)
