"""Claims of the paper's Sections 2 and 3: model, table, linear analysis, Hopf point, harmonic balance."""

from __future__ import annotations

import math
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from typing import Any

from tippedisk_verify.evidence.claims import Audit, Claim, Finding, number, per_set, rounds_to, wording
from tippedisk_verify.model.equations import jacobian
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import CALIBRATED, Constants, Parameters
from tippedisk_verify.model.precision import bits
from tippedisk_verify.theory import harmonic_balance, hopf
from tippedisk_verify.theory.equilibria import (
    EquilibriumName,
    equilibrium,
    is_stable,
    linearization,
    location,
    stiff_eigenvalue_estimate,
)
from tippedisk_verify.theory.expansion import derived, printed
from tippedisk_verify.theory.hopf import omega_crit, omega_crit_squared, period_crit

__all__ = ["LOCAL_CLAIMS"]

_CLOSED = ("closed form",)
_EXACT = ("exact arithmetic",)


def _crit(audit: Audit, name: str) -> Measured:
    return omega_crit(audit.sets[name], max(audit.digits, 12))


def _period(audit: Audit, name: str) -> Measured:
    return period_crit(audit.sets[name], max(audit.digits, 12))


def _stiff(audit: Audit, name: str) -> Measured:
    return Measured(stiff_eigenvalue_estimate(audit.sets[name]), Fraction(0))


def _stability(which: EquilibriumName, sides: tuple[int, ...], expected: bool) -> Callable[[Audit], Finding]:
    """Stability at eight speeds on each of the given sides of Omega_crit (-1 below, 1 above), exactly."""

    def one(audit: Audit, name: str) -> tuple[str, bool]:
        # A rational within 1e-30 of Omega_crit; the shifts are far larger, so the side is certain.
        crit = omega_crit(audit.sets[name], 30).value
        speeds = [crit * (1 + side * Fraction(1, 2**power)) for side in sides for power in range(1, 9)]
        answers = {is_stable(linearization(audit.sets[name], speed, which)) for speed in speeds}
        return " and ".join("stable" if answer else "unstable" for answer in sorted(answers)), answers == {expected}

    where = " and ".join({-1: "below", 1: "above"}[side] for side in sides)
    note = f"exact Routh-Hurwitz in rational arithmetic at eight speeds {where} Omega_crit, the nearest 0.4 % away"
    return per_set(one, note, ("exact arithmetic",))


def _friction_free(audit: Audit) -> Finding:
    """With friction changed by large factors, the linearisation loses stability at the same speed."""
    holds: dict[str, bool | None] = {}
    for name, parameters in audit.sets.items():
        square = omega_crit_squared(parameters)
        speed = omega_crit(parameters, 40).value
        nearby = Fraction(1, 10**30)
        others = [
            parameters.changed(mu=parameters.mu * factor, epsilon=parameters.epsilon * other)
            for factor, other in ((Fraction(1, 1000), 1), (10, 1), (1, Fraction(1, 1000)), (3, 7))
        ]
        holds[name] = all(
            omega_crit_squared(changed) == square
            and is_stable(linearization(changed, speed + nearby))
            and not is_stable(linearization(changed, speed - nearby))
            for changed in others
        )
    note = "with mu and epsilon changed a thousandfold, stability changes within 1e-30 rad/s of the same speed (exact)"
    return Finding(dict.fromkeys(audit.sets, "independent"), holds, note, ("exact arithmetic",))


def _jacobian_entries(audit: Audit, name: str) -> tuple[str, bool]:
    """A31, A32, A33 against the derivative of the full equations, in 200 bits."""
    precision = bits(200)
    parameters = audit.sets[name]
    constants = Constants(*(precision.mpf(value) for value in parameters.at(precision)))
    state = [precision.mpf(precision.number(part)) for part in location("inverted")]
    speed = Fraction("30.4")
    row = jacobian(precision.context, constants, precision.mpf(precision.number(speed)), "linear")(*state)[2]
    entries = linearization(parameters, speed)[1:]
    # pi/2 carries an error of 2^-200, second derivatives are below 1e6 times the entries.
    close = all(
        abs(a - precision.mpf(precision.number(b))) <= abs(a) * 2.0**-150 for a, b in zip(row, entries, strict=True)
    )
    return "equal" if close else "different", close


def _stiff_order(audit: Audit, name: str) -> tuple[str, bool]:
    """The observed exponent of epsilon in lambda_3 - A33."""
    gaps = []
    for exponent in (4, 5):
        changed = audit.sets[name].changed(epsilon=Fraction(1, 10**exponent))
        stiff = equilibrium(changed, "30.4", "inverted", 40).eigenvalues[2].re.value
        gaps.append(abs(float(stiff - linearization(changed, Fraction("30.4")).A33)))
    slope = math.log10(gaps[0] / gaps[1])
    return f"order {slope:.4f}", abs(slope - 1) < 0.01


def _expansion_part(part: str, note: str) -> Callable[[Audit], Finding]:
    def one(audit: Audit, name: str) -> tuple[str, bool]:
        constants, speed = audit.sets[name].rational(), Fraction("30.4")
        follows, claimed = (getattr(function(constants, speed), part) for function in (derived, printed))
        wrong = sorted(key for key in {*follows, *claimed} if follows.get(key, 0) != claimed.get(key, 0))
        words = ["".join(f"{s}^{n} " for s, n in zip(("beta", "gamma", "v"), key, strict=True) if n) for key in wrong]
        return ("follows" if not wrong else "differs in " + "and ".join(words)).strip(), not wrong

    return per_set(one, note, _EXACT)


def _kappa_1(audit: Audit, name: str) -> tuple[str, bool]:
    constants, speed = audit.sets[name].rational(), Fraction("30.4")
    frequency = constants.e / (constants.r + constants.e) * speed**2
    claimed, follows = (
        harmonic_balance.kappa_1(constants, speed, frequency, form) for form in ("printed", "consistent")
    )
    return f"{float(follows):.6g} N m, printed {float(claimed):.6g} N m, at 30.4 rad/s", claimed == follows


def _form_difference(function: Callable[..., Any]) -> Callable[[Audit, str], tuple[str, bool]]:
    """The printed form of a one-harmonic constant against the consistent one."""

    def one(audit: Audit, name: str) -> tuple[str, bool]:
        constants, speed = audit.sets[name].rational(), Fraction("30.4")
        frequency = constants.e / (constants.r + constants.e) * speed**2
        claimed, follows = (function(constants, speed, frequency, form) for form in ("printed", "consistent"))
        return f"{float(claimed / follows):.4f} of what follows", claimed == follows

    return one


def _chi(audit: Audit, name: str) -> Measured:
    return Measured(harmonic_balance.chi(audit.sets[name].rational(), "printed"), Fraction(0))


def _slope_claim(which: int) -> Callable[[Audit, str], tuple[str, bool]]:
    """The printed one-harmonic law's slope at the Hopf point against the first Lyapunov coefficient's."""

    def one(audit: Audit, name: str) -> tuple[str, bool]:
        parameters = audit.sets[name]
        law = harmonic_balance.slopes(parameters, "printed")[which]
        truth = hopf.hopf_point(parameters)
        true = (truth.amplitude_squared_slope, truth.period_slope)[which]
        ratio = float(law) / float(true)
        return f"{ratio:.4f} of the true {('d(C^2)/dOmega', 'dT/dOmega')[which]}", abs(ratio - 1) < 1e-9

    return one


def _supercritical(audit: Audit, name: str) -> tuple[str, bool]:
    parameters = audit.sets[name]
    kind = hopf.criticality(parameters)
    return f"{kind}, l_1 = {float(hopf.hopf_point(parameters).first_lyapunov_coefficient):.6g}", kind == "supercritical"


#: What the paper prints of the model's numbers, for the joint question.
_PRINTED_NUMBERS: tuple[tuple[str, Callable[[Parameters], Measured]], ...] = (
    ("30.92", lambda p: omega_crit(p, 20)),
    ("0.886", lambda p: period_crit(p, 20)),
    ("-129.04", lambda p: Measured(stiff_eigenvalue_estimate(p), Fraction(0))),
    ("1.31e-7", lambda p: Measured(harmonic_balance.chi(p.rational(), "printed"), Fraction(0))),
)
_TABLE = {"r": "0.045", "e": "2.5e-3", "m": "0.435", "A": "0.249e-3", "B": "0.227e-3"}


def _inside_table(parameters: Parameters) -> bool:
    """Whether each tabled quantity rounds to what the table prints, and g lies in [9.80, 9.82]."""
    inside = Fraction("9.80") <= parameters.g <= Fraction("9.82")
    for name, text in _TABLE.items():
        half = Fraction(10) ** int(Decimal(text).as_tuple().exponent) / 2
        inside = inside and abs(getattr(parameters, name) - Fraction(text)) <= half
    return inside


def _joint(audit: Audit) -> Finding:
    """Does a set inside Table 1's rounding reproduce all printed closed-form numbers at once?"""
    computed: dict[str, Measured | str] = {}
    holds: dict[str, bool | None] = {}
    for name, parameters in (audit.sets | {"calibrated": CALIBRATED}).items():
        missed = [text for text, compute in _PRINTED_NUMBERS if not rounds_to(compute(parameters), text)]
        inside = _inside_table(parameters)
        where = "inside" if inside else "outside"
        computed[name] = f"{where} the rounding, misses {', '.join(missed) if missed else 'none'}"
        holds[name] = inside and not missed
    return Finding(
        computed,
        holds,
        "yes: calibrated does, with Omega_h = 30.07 as well (claim omega_h)",
        _EXACT,
    )


#: In the order of the paper.
LOCAL_CLAIMS: tuple[Claim, ...] = (
    Claim(
        "table_1",
        "Table tab:dim_mass and all printed numbers",
        "the printed closed-form numbers follow from Table 1",
        "30.92, 0.886, -129.04, 1.31e-7",
        _joint,
    ),
    Claim(
        "sliding_velocity",
        "Eq. gamma_y_3DOF",
        "gamma_y = (r + e sin gamma) v sin beta - e Omega sin beta^2 cos gamma",
        "sin beta^2",
        wording("(sin beta)^2", "read as the square of the sine; the contact point's kinematics give no other reading"),
    ),
    Claim(
        "linearization",
        "Eqs. 3DOF_lin, A_coeff_O",
        "A31, A32 and A33 linearise the equations about inverted spinning",
        "A31, A32, A33",
        per_set(_jacobian_entries, "against the derivative of the full equations in 200 bits", _EXACT),
    ),
    Claim(
        "omega_crit",
        "Eq. approx_omega_crit",
        "Omega_crit = sqrt((r+e)^2/r * m g/Bbar) = 30.92 rad/s",
        "30.92",
        number("30.92", _crit, "Table 1 as rounded gives less; a set inside its rounding gives it", _CLOSED),
        unit="rad/s",
    ),
    Claim(
        "omega_crit_friction",
        "text below Eq. approx_omega_crit",
        "the critical speed does not depend on the friction parameters mu and epsilon",
        "independent",
        _friction_free,
    ),
    Claim(
        "lambda_3",
        "Eq. closed_la3",
        "lambda_3 is about A_33 = -129.04 1/s",
        "-129.04",
        number(
            "-129.04", _stiff, "the number is A_33, the leading term; the eigenvalue itself depends on Omega", _CLOSED
        ),
        unit="1/s",
    ),
    Claim(
        "lambda_3_order",
        "Eq. closed_la3",
        "lambda_3 = A_33 + O(epsilon)",
        "O(epsilon)",
        per_set(_stiff_order, "fitted exponent of epsilon between 1e-4 and 1e-5", ("eigenvalues at 40 digits",)),
    ),
    Claim(
        "critical_pair",
        "below Eq. closed_la3",
        "a pair of convex conjugate eigenvalues crosses the imaginary axis",
        "convex conjugate",
        wording("complex conjugate", "a slip of the pen: the pair is complex conjugate"),
    ),
    Claim(
        "inverted_stable_above",
        "Section sec:linear_stab3DOF",
        "inverted spinning is stable above Omega_crit",
        "stable",
        _stability("inverted", (1,), True),
    ),
    Claim(
        "inverted_unstable_below",
        "Section sec:linear_stab3DOF",
        "inverted spinning is unstable below Omega_crit",
        "unstable",
        _stability("inverted", (-1,), False),
    ),
    Claim(
        "noninverted_unstable",
        "Section sec:linear_stab3DOF",
        "noninverted spinning is always unstable",
        "unstable",
        _stability("noninverted", (-1, 1), False),
    ),
    Claim(
        "expansion_mass",
        "Eq. MassMatrix_3DOF_approx",
        "M-tilde is the mass matrix to third order",
        "formula",
        _expansion_part("mass", ""),
    ),
    Claim(
        "expansion_gyroscopic",
        "Eq. GyroVector_3DOF_approx",
        "h-tilde is the vector of gyroscopic forces to third order",
        "formula",
        _expansion_part("gyroscopic", "the mixed term is -[2 (A - Bbar) + m e (r + e)] Omega"),
    ),
    Claim(
        "expansion_gravity",
        "Eq. force_3DOF_approx",
        "f_G to third order",
        "formula",
        _expansion_part("gravity", "gamma_bar^3 should be gamma_bar^2"),
    ),
    Claim(
        "expansion_friction",
        "Eq. genForce_3DOF_approx",
        "w_y lambda_Ty to third order",
        "formula",
        _expansion_part("friction", ""),
    ),
    Claim(
        "kappa_1",
        "below Eq. cos_balance",
        "kappa_1 is the cubic part of the sine balance",
        "-2 m e (r + e)",
        per_set(_kappa_1, "2 m e (r + e) enters with the other sign; the printed chi has it right", _EXACT),
    ),
    Claim(
        "kappa_2",
        "Eq. kappa2",
        "kappa_2 is the cubic part of the cosine balance",
        "formula",
        per_set(
            _form_difference(harmonic_balance.kappa_2),
            "follows from the ansatz D = -C Omega/omega, which drops a cubic term of gamma_bar' = Omega sin(beta_bar)",
            _EXACT,
        ),
    ),
    Claim(
        "delta",
        "Eq. delta",
        "delta = -(1/8) (r - e)/(r + e) Omega^2",
        "-(1/8) (r - e)/(r + e) Omega^2",
        per_set(
            _form_difference(lambda constants, omega, frequency, form: harmonic_balance.delta(constants, omega, form)),
            "-(1/8) r/(r + e) Omega^2 with the cubic kinematic term",
            _EXACT,
        ),
    ),
    Claim(
        "chi",
        "below Eq. Csol",
        "chi = 1.31e-7 kg m^3",
        "1.31e-7",
        number("1.31e-7", _chi, "the printed formula", _CLOSED),
        unit="kg m^3",
    ),
    Claim(
        "amplitude_law",
        "Eq. Csol",
        "C is the amplitude up to O(C^4)",
        "C + O(C^4)",
        per_set(
            _slope_claim(0),
            "the cubic term of gamma_bar' = Omega sin(beta_bar) is of the order of what is kept and changes the leading"
            " order; with it (the consistent form) the next term is O(C^3)",
            ("first Lyapunov coefficient", "closed form"),
        ),
    ),
    Claim(
        "period_law",
        "Eq. omega_sol",
        "omega is the frequency of the cycle up to O(C^4)",
        "omega + O(C^4)",
        per_set(_slope_claim(1), "as for the amplitude", ("first Lyapunov coefficient", "closed form")),
    ),
    Claim(
        "supercritical",
        "Section sec:linear3DOF",
        "the Hopf bifurcation is supercritical",
        "supercritical",
        per_set(_supercritical, "the sign of A (r - 2e) - Bbar r (2r - e) / (2 (r + e)), exactly", _EXACT),
    ),
    Claim(
        "period_crit",
        "text below Eq. omega_sol",
        "the period at the Hopf point is 0.886 s",
        "0.886",
        number("0.886", _period, "0.8867 for Table 1 as rounded", _CLOSED),
        unit="s",
    ),
)
