"""Claims about Table 1 and the linearisation: equilibria, eigenvalues and the critical speed."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from functools import partial

from tippedisk_verify.audit.claims import (
    Audit,
    Claim,
    Fault,
    ProofOffer,
    Theorem,
    printed_number,
    printed_word,
    rounds_to,
)
from tippedisk_verify.model.equations import equation_terms, jacobian
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.exact import rational_in_context
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.precision import DOUBLE, precision_of_bits
from tippedisk_verify.theory.equilibria import (
    EquilibriumName,
    equilibrium,
    is_stable,
    linearization,
)
from tippedisk_verify.theory.hopf import omega_crit, period_crit
from tippedisk_verify.theory.one_harmonic_law import chi

__all__ = ["EVERY_SPEED", "LINEAR_CLAIMS", "NORMAL_FORM", "closed_form", "table_box"]

EVERY_SPEED = Theorem("Theorem 1", ("certify equilibria --every-speed",), every_disk=True)
NORMAL_FORM = Theorem("Theorem 3", ("certify hopf",), "linear")

# Table tab:dim_mass [SI units], with half a unit of each last digit. g is not printed; mu and
# epsilon are free choices.
_TABLE = {
    "r": ("0.045", "0.5e-3"),
    "e": ("2.5e-3", "0.05e-3"),
    "m": ("0.435", "0.5e-3"),
    "A": ("0.249e-3", "0.5e-6"),
    "B": ("0.227e-3", "0.5e-6"),
    "g": ("9.81", "0.01"),
}

# The closed forms whose values the paper prints, by claim. Each takes a disk and digits.
_CLOSED_FORMS: dict[str, Callable[[Parameters, int], Measured]] = {
    "omega_crit": omega_crit,
    "period_crit": period_crit,
    "lambda_3": lambda parameters, digits: Measured(
        linearization(parameters, Fraction(1)).A33, Fraction(0)
    ),
    "chi": lambda parameters, digits: Measured(
        chi(parameters.rational_constants(), "printed"), Fraction(0)
    ),
}


def closed_form(name: str) -> Callable[[Audit, str], Measured]:
    """Return a function that computes the number of a claim. It takes the audit and a set's name."""
    return lambda audit, set_name: _CLOSED_FORMS[name](audit.sets[set_name], max(audit.digits, 12))


def table_box() -> dict[str, tuple[Fraction, Fraction]]:
    """Return the intervals of r, e, m, A, B and g [SI units] that round to the table."""
    return {
        name: (Fraction(text) - Fraction(half), Fraction(text) + Fraction(half))
        for name, (text, half) in _TABLE.items()
    }


def _table_1_gives_every_number(audit: Audit, set_name: str, printed: str) -> tuple[str, bool]:
    """Check that a set rounds to Table 1 and gives all printed closed-form numbers."""
    pairs = zip(printed.split(", "), _CLOSED_FORMS, strict=True)
    missed = [
        text for text, claim in pairs if not rounds_to(closed_form(claim)(audit, set_name), text)
    ]
    inside = all(
        low <= getattr(audit.sets[set_name], part) <= high
        for part, (low, high) in table_box().items()
    )
    where = "inside" if inside else "outside"
    return f"{where} the rounding, misses {', '.join(missed) or 'none'}", inside and not missed


_EIGHT_SPEEDS = "exact Routh-Hurwitz in rational arithmetic at eight speeds on each side, the nearest 0.4 % away"


def _stability(which: EquilibriumName, sides: tuple[int, ...], audit: Audit, set_name: str) -> str:
    """Return the stability at eight speeds on each given side of Omega_crit, exactly: "stable",
    "unstable" or both.

    The sides are -1 (below) and 1 (above).
    """
    # A rational within 1e-30 of Omega_crit; the shifts are far larger, so the side is certain.
    crit = omega_crit(audit.sets[set_name], 30).value
    speeds = [crit * (1 + side * Fraction(1, 2**power)) for side in sides for power in range(1, 9)]
    answers = {is_stable(linearization(audit.sets[set_name], speed, which)) for speed in speeds}
    return " and ".join("stable" if answer else "unstable" for answer in sorted(answers))


def _dependence_on_friction(audit: Audit, set_name: str) -> str:
    """Return "independent" if the linearisation loses its stability at the same speed for very
    different friction, otherwise "dependent".
    """
    parameters = audit.sets[set_name]
    speed = omega_crit(parameters, 40).value
    nearby = Fraction(1, 10**30)
    others = [
        parameters.changed(mu=parameters.mu * factor, epsilon=parameters.epsilon * other)
        for factor, other in ((Fraction(1, 1000), 1), (10, 1), (1, Fraction(1, 1000)), (3, 7))
    ]
    free = all(
        is_stable(linearization(changed, speed + nearby))
        and not is_stable(linearization(changed, speed - nearby))
        for changed in others
    )
    return "independent" if free else "dependent"


def _meaning_of_the_square(audit: Audit, set_name: str) -> str:
    """Return the meaning of the printed square for which gamma_y is the contact point's velocity."""
    c, omega, beta, gamma, v = audit.sets[set_name].constants_in(DOUBLE), 30.4, 1.2, 0.3, 0.7
    rest = (c.r + c.e * math.sin(gamma)) * v * math.sin(beta)
    velocity = equation_terms(math, c, omega, beta, gamma, v).sliding_velocity
    square = (rest - velocity) / (c.e * omega * math.cos(gamma))
    # The two meanings differ by a tenth.
    meanings = {"(sin beta)^2": math.sin(beta) ** 2, "sin beta^2": math.sin(beta**2)}
    return next(
        (text for text, value in meanings.items() if math.isclose(value, square)), "neither"
    )


def _kind_of_critical_pair(audit: Audit, set_name: str) -> str:
    """Return the kind of the two eigenvalues whose real part changes sign at Omega_crit."""
    crit = omega_crit(audit.sets[set_name], 30).value
    below, above = (
        equilibrium(
            audit.sets[set_name], crit * (1 + side * Fraction(1, 1000)), "inverted", 20
        ).eigenvalues
        for side in (-1, 1)
    )
    crossing = [
        old for old, new in zip(below, above, strict=True) if old.re.value > 0 > new.re.value
    ]
    conjugate = len(crossing) == 2 and crossing[0].im.value == -crossing[1].im.value != 0
    return "complex conjugate" if conjugate else f"{len(crossing)} real"


def _linearization_is_jacobian(audit: Audit, set_name: str, printed: str) -> tuple[str, bool]:
    """Compare A31, A32 and A33 with the derivative of the full equations, in 200 bits."""
    ctx, parameters, speed = precision_of_bits(200).context, audit.sets[set_name], Fraction("30.4")
    state = ctx.pi / 2, ctx.pi / 2, ctx.mpf(0)
    row = jacobian(
        ctx, parameters.constants_in_context(ctx), rational_in_context(ctx, speed), "linear"
    )(*state)[2]
    entries = linearization(parameters, speed)[1:]
    # pi/2 carries an error of 2^-200, second derivatives are below 1e6 times the entries.
    close = all(
        abs(a - rational_in_context(ctx, b)) <= abs(a) * 2.0**-150
        for a, b in zip(row, entries, strict=True)
    )
    return "equal" if close else "different", close


def _order_of_lambda_3(audit: Audit, set_name: str, printed: str) -> tuple[str, bool]:
    """Check that the exponent of epsilon in lambda_3 - A33 is 1."""
    gaps = []
    for exponent in (4, 5):
        changed = audit.sets[set_name].changed(epsilon=Fraction(1, 10**exponent))
        stiff = equilibrium(changed, "30.4", "inverted", 40).eigenvalues[2].re.value
        gaps.append(abs(float(stiff - linearization(changed, Fraction("30.4")).A33)))
    slope = math.log10(gaps[0] / gaps[1])
    return f"order {slope:.4f}", abs(slope - 1) < 0.01


LINEAR_CLAIMS: tuple[Claim, ...] = (
    Claim(
        "table_1",
        "tab:dim_mass, eq:closed_la3, eq:approx_omega_crit, eq:Csol+1",
        "the printed closed-form numbers follow from Table 1",
        "30.92, 0.886, -129.04, 1.31e-7",
        _table_1_gives_every_number,
        note="yes: calibrated does, with Omega_h = 30.07 as well (claim omega_h)",
        formula=r"r,\; e,\; m,\; A,\; B \;\mapsto\; \Omega_\text{crit},\; T_\text{crit},\; "
        r"A_{33},\; \chi",
        proof=ProofOffer(
            NORMAL_FORM,
            "enclosures of the four numbers; the disk's decimals show whether it rounds to Table 1",
        ),
    ),
    Claim(
        "sliding_velocity",
        "eq:gamma_y_3DOF",
        "gamma_y = (r + e sin gamma) v sin beta - e Omega sin beta^2 cos gamma",
        "sin beta^2",
        printed_word(_meaning_of_the_square),
        methods=("reading", "closed form"),
        fault=Fault(
            "slip",
            "the square is at the angle instead of its sine; the contact point's kinematics allow "
            "no other reading",
            "gamma_y = (r + e sin gamma) v sin beta - e Omega sin^2(beta) cos gamma",
        ),
        formula=r"\gamma_y = (r + e\,\sin\gamma)\,\dot{\beta}\,\sin\beta - "
        r"e\,\Omega\,\sin\beta^2\,\cos\gamma",
    ),
    Claim(
        "linearization",
        "eq:3DOF_lin, eq:A_coeff_O",
        "A31, A32 and A33 linearise the equations about inverted spinning",
        "A31, A32, A33",
        _linearization_is_jacobian,
        note="against the derivative of the full equations in 200 bits",
        formula=(
            r"A_{31} = \frac{m g}{\bar{B}}(r+e) - \Omega^2,"
            r"\quad A_{32} = -\frac{\mu m g}{\varepsilon\bar{B}}\,e(r+e)\,\Omega,"
            r"\quad A_{33} = -\frac{\mu m g}{\varepsilon\bar{B}}(r+e)^2"
        ),
    ),
    Claim(
        "omega_crit",
        "eq:approx_omega_crit",
        "Omega_crit = sqrt((r + e)^2 m g/(r Bbar)) = 30.92 rad/s",
        "30.92",
        printed_number(closed_form("omega_crit")),
        note="Table 1 as rounded gives less; a set inside its rounding gives it",
        methods=("closed form",),
        unit="rad/s",
        formula=r"\Omega_\text{crit} = \sqrt{\frac{(r+e)^2}{r}\,\frac{m g}{\bar{B}}}",
        proof=ProofOffer(EVERY_SPEED, "the formula, and an enclosure of the number"),
    ),
    Claim(
        "omega_crit_friction",
        "below eq:approx_omega_crit",
        "the critical speed does not depend on the friction parameters mu and epsilon",
        "independent",
        printed_word(_dependence_on_friction),
        note=(
            "with mu and epsilon changed a thousandfold, stability changes within 1e-30 rad/s of "
            "the same speed (exact)"
        ),
        formula=(
            r"\frac{\partial\Omega_\text{crit}}{\partial\mu}"
            r" = \frac{\partial\Omega_\text{crit}}{\partial\varepsilon} = 0"
        ),
        proof=ProofOffer(EVERY_SPEED, "that the formula is right for all mu and epsilon"),
    ),
    Claim(
        "lambda_3",
        "eq:closed_la3",
        "lambda_3 is about A_33 = -129.04 1/s",
        "-129.04",
        printed_number(closed_form("lambda_3")),
        note="the number is A_33, the leading term; the eigenvalue itself depends on Omega",
        methods=("closed form",),
        unit="1/s",
        formula=r"\lambda_3 \approx -\frac{\mu m g}{\varepsilon\bar{B}}(r+e)^2",
        figures=("eigenvalues",),
        proof=ProofOffer(
            EVERY_SPEED,
            "an enclosure of A_33, which is lambda_3 at Omega_crit",
            "how near lambda_3 is to A_33 at other speeds",
        ),
    ),
    Claim(
        "lambda_3_order",
        "eq:closed_la3",
        "lambda_3 = A_33 + O(epsilon)",
        "O(epsilon)",
        _order_of_lambda_3,
        note="fitted exponent of epsilon between 1e-4 and 1e-5",
        methods=("eigenvalues at 40 digits",),
        formula=r"\lambda_3 = A_{33} + \mathcal{O}(\varepsilon)",
    ),
    Claim(
        "critical_pair",
        "below eq:closed_la3",
        "a pair of convex conjugate eigenvalues crosses the imaginary axis",
        "convex conjugate",
        printed_word(_kind_of_critical_pair),
        methods=("reading", "eigenvalues at 20 digits"),
        fault=Fault("slip", "'convex' stands for 'complex'", "the pair is complex conjugate"),
        formula=r"\lambda_{1,2} = \pm i\,\omega \quad\text{at}\quad \Omega = \Omega_\text{crit}",
        proof=ProofOffer(
            EVERY_SPEED,
            "that a pair of complex conjugate eigenvalues crosses the imaginary axis, with nonzero "
            "speed",
            "that 'convex' is a slip of the pen (read)",
        ),
    ),
    Claim(
        "inverted_stable_above",
        "sec:linear_stab3DOF",
        "inverted spinning is stable above Omega_crit",
        "stable",
        printed_word(partial(_stability, "inverted", (1,))),
        note=_EIGHT_SPEEDS,
        formula=r"\Re\lambda_i < 0 \quad\text{for}\quad \Omega > \Omega_\text{crit}",
        proof=ProofOffer(EVERY_SPEED, "asymptotic stability at every speed above Omega_crit"),
    ),
    Claim(
        "inverted_unstable_below",
        "sec:linear_stab3DOF",
        "inverted spinning is unstable below Omega_crit",
        "unstable",
        printed_word(partial(_stability, "inverted", (-1,))),
        note=_EIGHT_SPEEDS,
        formula=r"\Re\lambda_{1,2} > 0 \quad\text{for}\quad \Omega < \Omega_\text{crit}",
        proof=ProofOffer(EVERY_SPEED, "instability at every speed below Omega_crit"),
    ),
    Claim(
        "noninverted_unstable",
        "sec:linear_stab3DOF",
        "noninverted spinning is always unstable",
        "unstable",
        printed_word(partial(_stability, "noninverted", (-1, 1))),
        note=_EIGHT_SPEEDS,
        formula=r"\max_i \Re\lambda_i > 0 \quad\text{at}\quad (\pi/2,\,-\pi/2,\,0)",
        proof=ProofOffer(EVERY_SPEED, "instability at every speed"),
    ),
)
