"""Claims about the third-order expansion, the harmonic balance, and the Hopf point."""

from __future__ import annotations

from fractions import Fraction
from functools import partial

from tippedisk_verify.audit.claims import Answer, Audit, Claim, Fault, ProofOffer, printed_number
from tippedisk_verify.audit.linear_claims import EVERY_SPEED, NORMAL_FORM, closed_form
from tippedisk_verify.audit.local_expansion import derived_expansion, printed_expansion
from tippedisk_verify.model.equations import STATE_NAMES
from tippedisk_verify.theory import hopf, one_harmonic_law

__all__ = ["BALANCE_CLAIMS"]


def _compare_expansion(part: str, audit: Audit, set_name: str, printed: str) -> Answer:
    """Compare a part of the printed expansion with the derived one, coefficient by coefficient, for
    one set.
    """
    constants, speed = audit.sets[set_name].rational_constants(), Fraction("30.4")
    follows, claimed = (
        getattr(function(constants, speed), part)
        for function in (derived_expansion, printed_expansion)
    )
    wrong = sorted(
        key for key in {*follows, *claimed} if follows.get(key, 0) != claimed.get(key, 0)
    )
    words = [
        "".join(f"{s}^{n} " for s, n in zip(STATE_NAMES, key, strict=True) if n) for key in wrong
    ]
    return ("follows" if not wrong else "differs in " + "and ".join(words)).strip(), not wrong


def _compare_balance_constant(which: str, audit: Audit, set_name: str, printed: str) -> Answer:
    """Compare the printed kappa_1, kappa_2 or delta with the value that the expansion gives.

    tests/theory derives that value by projection.
    """
    constants, speed = audit.sets[set_name].rational_constants(), Fraction("30.4")
    square = constants.e / (constants.r + constants.e) * speed**2
    inputs = (constants, speed) if which == "delta" else (constants, speed, square)
    claimed, follows = (
        getattr(one_harmonic_law, which)(*inputs, form) for form in ("printed", "consistent")
    )
    return f"{float(claimed / follows):.4f} times the right value", claimed == follows


def _compare_slope(which: int, audit: Audit, set_name: str, printed: str) -> Answer:
    """Compare the slope of the printed one-harmonic law at the Hopf point with the true slope.

    The true slope follows from the first Lyapunov coefficient.
    """
    parameters = audit.under_linear_law(set_name)
    law = one_harmonic_law.hopf_slopes(parameters, "printed")[which]
    ratio = float(law) / float(hopf.hopf_point(parameters).slopes()[which])
    slope = ("d(C^2)/dOmega", "dT/dOmega")[which]
    return f"{ratio:.4f} times the right slope; {slope} at Omega_crit", abs(ratio - 1) < 1e-9


def _criticality(audit: Audit, set_name: str, printed: str) -> tuple[str, bool]:
    parameters = audit.under_linear_law(set_name)
    kind = hopf.criticality(parameters)
    return (
        f"{kind}, l_1 = {float(hopf.hopf_point(parameters).first_lyapunov_coefficient):.6g}",
        kind == printed,
    )


def _expansion_claim(
    part: str, label: str, expanded: str, formula: str, fault: Fault | None = None
) -> Claim:
    """Return a claim of the catalogue: that the paper's third-order expansion of a part of the
    equations is right.
    """
    examine = partial(_compare_expansion, part)
    return Claim(
        f"expansion_{part}",
        label,
        f"{expanded} to third order",
        "formula",
        examine,
        formula=formula,
        fault=fault,
    )


_MISSING_TERM = "the cubic term of gamma_bar' = Omega sin(beta_bar)"
_CHI_IS_RIGHT = "the paper's chi follows from the correct term, not from the printed one"


BALANCE_CLAIMS: tuple[Claim, ...] = (
    _expansion_claim(
        "mass",
        "eq:MassMatrix_3DOF_approx",
        "M-tilde is the mass matrix",
        (
            r"\tilde{M} = (A-\bar{B})\,\bar{\gamma}^2 + \bar{B} + m(r+e)^2\,\bar{\beta}^2"
            r" + \mathcal{O}(\|\bar{z}\|^4)"
        ),
    ),
    _expansion_claim(
        "gyroscopic",
        "eq:GyroVector_3DOF_approx",
        "h-tilde is the vector of gyroscopic forces",
        (
            r"\tilde{h} = -\bar{B}\Omega^2\bar{\beta} + "
            r"(\bar{B}-A)\Omega^2\bar{\beta}\bar{\gamma}^2"
            r" + \left[\tfrac{2}{3}\bar{B} - m e(r+e)\right]\Omega^2\bar{\beta}^3"
            r" - 2\left[A-\bar{B}+m e(r+e)\right]\Omega\dot{\bar{\beta}}\bar{\beta}\bar{\gamma}"
            r" - m(r+e)^2\dot{\bar{\beta}}^2\bar{\beta} + \dots"
        ),
        fault=Fault(
            "slip",
            f"a factor 2 stands before the whole bracket instead of its first term; "
            f"{_CHI_IS_RIGHT}",
            "the mixed term is -[2 (A - Bbar) + m e (r + e)] Omega v beta_bar gamma_bar",
        ),
    ),
    _expansion_claim(
        "gravity",
        "eq:force_3DOF_approx",
        "f_G",
        (
            r"f_G = m g(r+e)\bar{\beta} - \tfrac{1}{2} m g e\,\bar{\beta}\bar{\gamma}^3"
            r" - \tfrac{1}{6} m g(r+e)\bar{\beta}^3"
            r" + \dots"
        ),
        fault=Fault(
            "slip",
            f"gamma_bar^3 stands for gamma_bar^2; {_CHI_IS_RIGHT}",
            "the mixed term is -(1/2) m g e beta_bar gamma_bar^2",
        ),
    ),
    _expansion_claim(
        "friction",
        "eq:genForce_3DOF_approx",
        "w_y lambda_Ty",
        (
            r"w_y\lambda_{Ty} = -\frac{\mu m g}{\varepsilon}[-\Omega "
            r"e\,\tfrac{4e+r}{6}\bar{\gamma}^3"
            r" + (r+e)^2\dot{\bar{\beta}} - \tfrac{3}{2}\Omega e(r+e)\bar{\beta}^2\bar{\gamma}"
            r" - (r+e)^2\dot{\bar{\beta}}\bar{\beta}^2 + e(r+e)\Omega\bar{\gamma}"
            r" - e(r+e)\dot{\bar{\beta}}\bar{\gamma}^2]"
            r" + \dots"
        ),
    ),
    Claim(
        "kappa_1",
        "eq:cos_balance+1",
        "kappa_1 is the cubic part of the sine balance",
        "-2 m e (r + e)",
        partial(_compare_balance_constant, "kappa_1"),
        formula=(
            r"\kappa_1 = \tfrac{1}{4}\left[\bar{B} - 3A - 2 m e(r+e)\right]\Omega^2 - \tfrac{1}{2} "
            r"m(r+e)^2\omega^2"
            r" + \tfrac{1}{8} m g e\frac{\Omega^2}{\omega^2} - "
            r"\tfrac{1}{4}(\bar{B}-A)\frac{\Omega^4}{\omega^2}"
            r" + \tfrac{1}{8} m g(r+e)"
        ),
        fault=Fault(
            "slip", f"a sign; {_CHI_IS_RIGHT}", "the first bracket is [Bbar - 3 A + 2 m e (r + e)]"
        ),
    ),
    Claim(
        "kappa_2",
        (
            "eq:kappa2, from eq:kin_rel, from eq:kin_rel+1, from eq:kin_rel+2, from "
            "eq:harmonic_ansatz,"
            " from eq:harmonic_ansatz+1"
        ),
        "kappa_2 is the cubic part of the cosine balance",
        "formula",
        partial(_compare_balance_constant, "kappa_2"),
        note=(
            "eqs. (27) to (30) are an ansatz, a choice that cannot fail; with D = -C Omega/omega "
            "it drops the"
            " cubic term of eq. (26), which gives the printed kappa_2"
        ),
        formula=(
            r"\kappa_2 = -e\,\frac{r+4e}{2}\,\frac{\Omega^4}{\omega^2} + \tfrac{3}{2} "
            r"e(r+e)\Omega^2"
            r" + (r+e)^2\omega^2"
        ),
        fault=Fault(
            "follows-from",
            _MISSING_TERM,
            "the middle term is e (r + e) Omega^2, without the factor 3/2",
        ),
    ),
    Claim(
        "delta",
        "eq:delta",
        "delta = -(1/8) (r - e)/(r + e) Omega^2",
        "-(1/8) (r - e)/(r + e) Omega^2",
        partial(_compare_balance_constant, "delta"),
        formula=r"\delta = -\frac{1}{8}\,\frac{r-e}{r+e}\,\Omega^2",
        fault=Fault("follows-from", _MISSING_TERM, "delta = -(1/8) r/(r + e) Omega^2"),
    ),
    Claim(
        "chi",
        "eq:Csol+1",
        "chi = 1.31e-7 kg m^3",
        "1.31e-7",
        printed_number(closed_form("chi")),
        note="the printed formula",
        methods=("closed form",),
        unit="kg m^3",
        formula=r"\chi = A(r-2e) - \bar{B}\,\frac{2r^2+e(r+e)}{2(r+e)}",
        proof=ProofOffer(NORMAL_FORM, "an enclosure of the number"),
    ),
    Claim(
        "amplitude_law",
        "eq:Csol",
        "C is the amplitude up to O(C^4)",
        "C + O(C^4)",
        partial(_compare_slope, 0),
        note="the dropped term is of the same order as those kept, so it changes the leading order",
        methods=("first Lyapunov coefficient", "closed form"),
        formula=(
            r"C = 2\sqrt{\frac{e}{r+e}}\sqrt{-\frac{\bar{B}r\Omega^2 - m g(r+e)^2}{\chi\Omega^2 + "
            r"m g e(r+e)}}"
            r" + \mathcal{O}(C^4)"
        ),
        fault=Fault(
            "follows-from", _MISSING_TERM, "C is C + O(C^3) with Bbar e^2/(2 (r + e)) added to chi"
        ),
        figures=("branch",),
    ),
    Claim(
        "period_law",
        "eq:omega_sol",
        "omega is the frequency of the cycle up to O(C^4)",
        "omega + O(C^4)",
        partial(_compare_slope, 1),
        methods=("first Lyapunov coefficient", "closed form"),
        formula=(
            r"\omega = \Omega\sqrt{\frac{e}{r+e}\left(1 + \frac{1}{2}\,\frac{r-e}{r+e}\,"
            r"\frac{\bar{B}r\Omega^2 - m g(r+e)^2}{\chi\Omega^2 + m g e(r+e)}\right)}"
        ),
        fault=Fault(
            "follows-from", _MISSING_TERM, "r - e becomes r, with Bbar e^2/(2 (r + e)) added to chi"
        ),
        figures=("branch",),
    ),
    Claim(
        "supercritical",
        "below eq:Csol+2",
        "the Hopf bifurcation is supercritical",
        "supercritical",
        _criticality,
        note="the sign of A (r - 2e) - Bbar r (2r - e) / (2 (r + e)), exactly",
        formula=r"\chi\,\Omega_\text{crit}^2 + m g e(r+e) > 0",
        proof=ProofOffer(
            NORMAL_FORM, "the signs of the first Lyapunov coefficient and of d(Re lambda)/dOmega"
        ),
    ),
    Claim(
        "period_crit",
        "below eq:omega_sol",
        "the period at the Hopf point is 0.886 s",
        "0.886",
        printed_number(closed_form("period_crit")),
        note="0.8867 for Table 1 as rounded",
        methods=("closed form",),
        unit="s",
        formula=r"T_\text{crit} = \frac{2\pi}{\Omega_\text{crit}}\sqrt{\frac{r+e}{e}}",
        proof=ProofOffer(
            EVERY_SPEED, "an enclosure of 2 pi / omega for the pair +- i omega at Omega_crit"
        ),
    ),
)
