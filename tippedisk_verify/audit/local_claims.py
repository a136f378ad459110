"""Claims of the paper's Sections 2 and 3: model, table, linear analysis, Hopf point, harmonic balance."""

from __future__ import annotations

import math
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction

from tippedisk_verify.audit.claims import Audit, Claim, Examination, ProofOffer, compared, number, per_set, rounds_to
from tippedisk_verify.model.equations import jacobian, terms
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Constants, Parameters
from tippedisk_verify.model.precision import DOUBLE, bits
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


def _stability(which: EquilibriumName, sides: tuple[int, ...]) -> Examination:
    """Stability at eight speeds on each of the given sides of Omega_crit (-1 below, 1 above), exactly."""

    def one(audit: Audit, name: str, printed: str) -> tuple[str, bool]:
        # A rational within 1e-30 of Omega_crit; the shifts are far larger, so the side is certain.
        crit = omega_crit(audit.sets[name], 30).value
        speeds = [crit * (1 + side * Fraction(1, 2**power)) for side in sides for power in range(1, 9)]
        answers = {is_stable(linearization(audit.sets[name], speed, which)) for speed in speeds}
        said = " and ".join("stable" if answer else "unstable" for answer in sorted(answers))
        return said, said == printed

    where = " and ".join({-1: "below", 1: "above"}[side] for side in sides)
    note = f"exact Routh-Hurwitz in rational arithmetic at eight speeds {where} Omega_crit, the nearest 0.4 % away"
    return compared(one, note, _EXACT)


def _friction_free(audit: Audit, name: str, printed: str) -> tuple[str, bool]:
    """With friction changed by large factors, the linearisation loses stability at the same speed."""
    parameters = audit.sets[name]
    square = omega_crit_squared(parameters)
    speed = omega_crit(parameters, 40).value
    nearby = Fraction(1, 10**30)
    others = [
        parameters.changed(mu=parameters.mu * factor, epsilon=parameters.epsilon * other)
        for factor, other in ((Fraction(1, 1000), 1), (10, 1), (1, Fraction(1, 1000)), (3, 7))
    ]
    free = all(
        omega_crit_squared(changed) == square
        and is_stable(linearization(changed, speed + nearby))
        and not is_stable(linearization(changed, speed - nearby))
        for changed in others
    )
    said = "independent" if free else "dependent"
    return said, said == printed


def _square_of_sine(audit: Audit, name: str, printed: str) -> tuple[str, bool]:
    """Which reading of the printed square makes gamma_y the contact point's velocity."""
    c, omega, beta, gamma, v = audit.sets[name].at(DOUBLE), 30.4, 1.2, 0.3, 0.7
    rest = (c.r + c.e * math.sin(gamma)) * v * math.sin(beta)
    velocity = terms(math, c, omega, beta, gamma, v).sliding_velocity
    square = (rest - velocity) / (c.e * omega * math.cos(gamma))
    readings = {"(sin beta)^2": math.sin(beta) ** 2, "sin beta^2": math.sin(beta**2)}  # a tenth apart
    said = next((text for text, value in readings.items() if math.isclose(value, square)), "neither")
    return said, said == printed


def _critical_pair(audit: Audit, name: str, printed: str) -> tuple[str, bool]:
    """The kind of the two eigenvalues that change the sign of their real part at Omega_crit."""
    crit = omega_crit(audit.sets[name], 30).value
    below, above = (
        equilibrium(audit.sets[name], crit * (1 + side * Fraction(1, 1000)), "inverted", 20).eigenvalues
        for side in (-1, 1)
    )
    crossing = [old for old, new in zip(below, above, strict=True) if old.re.value > 0 > new.re.value]
    conjugate = len(crossing) == 2 and crossing[0].im.value == -crossing[1].im.value != 0
    said = "complex conjugate" if conjugate else f"{len(crossing)} real"
    return said, said == printed


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


def _expansion_part(part: str, note: str) -> Examination:
    def one(audit: Audit, name: str) -> tuple[str, bool]:
        constants, speed = audit.sets[name].rational(), Fraction("30.4")
        follows, claimed = (getattr(function(constants, speed), part) for function in (derived, printed))
        wrong = sorted(key for key in {*follows, *claimed} if follows.get(key, 0) != claimed.get(key, 0))
        words = ["".join(f"{s}^{n} " for s, n in zip(("beta", "gamma", "v"), key, strict=True) if n) for key in wrong]
        return ("follows" if not wrong else "differs in " + "and ".join(words)).strip(), not wrong

    return per_set(one, note, _EXACT)


def _balanced(constants: Constants, speed: Fraction, square: Fraction) -> tuple[Fraction, Fraction, Fraction]:
    """kappa_1, kappa_2 and delta as the expansion gives them, for omega^2 = ``square`` [rad^2/s^2].

    beta_bar = C sin(theta) and v = C omega cos(theta). Of gamma_bar' = Omega sin(beta_bar) the first harmonic is
    Omega (C - C^3/8) sin(theta), so gamma_bar = -(Omega/omega) (C - C^3/8) cos(theta).
    """
    parts = derived(constants, speed)
    inertia = {(i + 1, j, k): square * value for (i, j, k), value in parts.mass.items()}  # -M v'
    sine, cosine = Fraction(0), parts.friction[0, 1, 0] * speed / 8  # of C^3 sin(theta) and C^3 cos(theta) / omega
    for forces in (inertia, parts.gyroscopic, parts.gravity, parts.friction):
        for (i, j, k), value in forces.items():
            if i + j + k == 3:
                # The first harmonic of a cube is 3/4 of its amplitude, of a mixed product 1/4.
                harmonic = value * (-speed) ** j * square ** ((k - j + 1) // 2) * (3 if i in (0, 3) else 1) / 4
                sine, cosine = (sine + harmonic, cosine) if i % 2 else (sine, cosine + harmonic)
    kappa_2 = 4 * cosine / (constants.m * constants.k)
    return -sine, kappa_2, kappa_2 / (4 * (constants.r + constants.e) ** 2)


def _balance_constant(which: int) -> Callable[[Audit, str], tuple[str, bool]]:
    """Printed kappa_1, kappa_2 or delta against what the expansion gives."""

    def one(audit: Audit, name: str) -> tuple[str, bool]:
        constants, speed = audit.sets[name].rational(), Fraction("30.4")
        square = constants.e / (constants.r + constants.e) * speed**2
        follows = _balanced(constants, speed, square)[which]
        claimed = (
            harmonic_balance.kappa_1(constants, speed, square, "printed"),
            harmonic_balance.kappa_2(constants, speed, square, "printed"),
            harmonic_balance.delta(constants, speed, "printed"),
        )[which]
        if which == 0:
            said = f"{float(follows):.6g} N m, printed {float(claimed):.6g} N m, at 30.4 rad/s"
        else:
            said = f"{float(claimed / follows):.4f} of what follows"
        return said, claimed == follows

    return one


def _chi(audit: Audit, name: str) -> Measured:
    return Measured(harmonic_balance.chi(audit.sets[name].rational(), "printed"), Fraction(0))


def _slope_claim(which: int) -> Callable[[Audit, str], tuple[str, bool]]:
    """The printed one-harmonic law's slope at the Hopf point against the first Lyapunov coefficient's."""

    def one(audit: Audit, name: str) -> tuple[str, bool]:
        parameters = audit.linear(name)
        law = harmonic_balance.slopes(parameters, "printed")[which]
        truth = hopf.hopf_point(parameters)
        true = (truth.amplitude_squared_slope, truth.period_slope)[which]
        ratio = float(law) / float(true)
        return f"{ratio:.4f} of the true {('d(C^2)/dOmega', 'dT/dOmega')[which]}", abs(ratio - 1) < 1e-9

    return one


def _supercritical(audit: Audit, name: str, printed: str) -> tuple[str, bool]:
    parameters = audit.linear(name)
    kind = hopf.criticality(parameters)
    return f"{kind}, l_1 = {float(hopf.hopf_point(parameters).first_lyapunov_coefficient):.6g}", kind == printed


_TABLE = {"r": "0.045", "e": "2.5e-3", "m": "0.435", "A": "0.249e-3", "B": "0.227e-3"}


def _inside_table(parameters: Parameters) -> bool:
    """Whether each tabled quantity rounds to what the table prints, and g lies in [9.80, 9.82]."""
    inside = Fraction("9.80") <= parameters.g <= Fraction("9.82")
    for name, text in _TABLE.items():
        half = Fraction(10) ** int(Decimal(text).as_tuple().exponent) / 2
        inside = inside and abs(getattr(parameters, name) - Fraction(text)) <= half
    return inside


def _joint(audit: Audit, name: str, printed: str) -> tuple[str, bool]:
    """Whether the set lies inside Table 1's rounding and reproduces all printed closed-form numbers at once."""
    pairs = zip(printed.split(", "), (_crit, _period, _stiff, _chi), strict=True)
    missed = [text for text, compute in pairs if not rounds_to(compute(audit, name), text)]
    inside = _inside_table(audit.sets[name])
    where = "inside" if inside else "outside"
    return f"{where} the rounding, misses {', '.join(missed) or 'none'}", inside and not missed


def _theorem_1(proves: str, rest: str = "") -> ProofOffer:
    return ProofOffer("Theorem 1", "certify equilibria --every-speed", proves, rest, every_disk=True)


#: In the order of the paper.
LOCAL_CLAIMS: tuple[Claim, ...] = (
    Claim(
        "table_1",
        "Table tab:dim_mass and all printed numbers",
        "the printed closed-form numbers follow from Table 1",
        "30.92, 0.886, -129.04, 1.31e-7",
        compared(_joint, "yes: calibrated does, with Omega_h = 30.07 as well (claim omega_h)", _EXACT),
        formula=r"r,\; e,\; m,\; A,\; B \;\mapsto\; \Omega_\text{crit},\; T_\text{crit},\; A_{33},\; \chi",
        proof=ProofOffer(
            "Theorem 4",
            "certify table",
            "whether the disk rounds to Table 1, and which of the four printed numbers it gives",
            law="linear",
        ),
    ),
    Claim(
        "sliding_velocity",
        "Eq. gamma_y_3DOF",
        "gamma_y = (r + e sin gamma) v sin beta - e Omega sin beta^2 cos gamma",
        "sin beta^2",
        compared(
            _square_of_sine,
            "read as the square of the sine; the contact point's kinematics give no other reading",
            ("reading", "closed form"),
        ),
        reading=True,
        formula=r"\gamma_y = (r + e\,\sin\gamma)\,\dot{\beta}\,\sin\beta - e\,\Omega\,\sin\beta^2\,\cos\gamma",
        figures=("model",),
    ),
    Claim(
        "linearization",
        "Eqs. 3DOF_lin, A_coeff_O",
        "A31, A32 and A33 linearise the equations about inverted spinning",
        "A31, A32, A33",
        per_set(_jacobian_entries, "against the derivative of the full equations in 200 bits", _EXACT),
        formula=(
            r"A_{31} = \frac{m g}{\bar{B}}(r+e) - \Omega^2,"
            r"\quad A_{32} = -\frac{\mu m g}{\varepsilon\bar{B}}\,e(r+e)\,\Omega,"
            r"\quad A_{33} = -\frac{\mu m g}{\varepsilon\bar{B}}(r+e)^2"
        ),
    ),
    Claim(
        "omega_crit",
        "Eq. approx_omega_crit",
        "Omega_crit = sqrt((r+e)^2/r * m g/Bbar) = 30.92 rad/s",
        "30.92",
        number(_crit, "Table 1 as rounded gives less; a set inside its rounding gives it", _CLOSED),
        unit="rad/s",
        formula=r"\Omega_\text{crit} = \sqrt{\frac{(r+e)^2}{r}\,\frac{m g}{\bar{B}}}",
        proof=_theorem_1("the formula, and an enclosure of the number"),
    ),
    Claim(
        "omega_crit_friction",
        "text below Eq. approx_omega_crit",
        "the critical speed does not depend on the friction parameters mu and epsilon",
        "independent",
        compared(
            _friction_free,
            "with mu and epsilon changed a thousandfold, stability changes within 1e-30 rad/s of the same speed"
            " (exact)",
            _EXACT,
        ),
        formula=(
            r"\frac{\partial\Omega_\text{crit}}{\partial\mu}"
            r" = \frac{\partial\Omega_\text{crit}}{\partial\varepsilon} = 0"
        ),
        proof=_theorem_1("that the formula is right whatever mu and epsilon are"),
    ),
    Claim(
        "lambda_3",
        "Eq. closed_la3",
        "lambda_3 is about A_33 = -129.04 1/s",
        "-129.04",
        number(_stiff, "the number is A_33, the leading term; the eigenvalue itself depends on Omega", _CLOSED),
        unit="1/s",
        formula=r"\lambda_3 \approx -\frac{\mu m g}{\varepsilon\bar{B}}(r+e)^2",
        figures=("eigenvalues",),
        proof=_theorem_1(
            "an enclosure of A_33, which is lambda_3 at Omega_crit",
            "how near lambda_3 is to A_33 at other speeds",
        ),
    ),
    Claim(
        "lambda_3_order",
        "Eq. closed_la3",
        "lambda_3 = A_33 + O(epsilon)",
        "O(epsilon)",
        per_set(_stiff_order, "fitted exponent of epsilon between 1e-4 and 1e-5", ("eigenvalues at 40 digits",)),
        formula=r"\lambda_3 = A_{33} + \mathcal{O}(\varepsilon)",
    ),
    Claim(
        "critical_pair",
        "below Eq. closed_la3",
        "a pair of convex conjugate eigenvalues crosses the imaginary axis",
        "convex conjugate",
        compared(
            _critical_pair, "a slip of the pen: the pair is complex conjugate", ("reading", "eigenvalues at 20 digits")
        ),
        reading=True,
        formula=r"\lambda_{1,2} = \pm i\,\omega \quad\text{at}\quad \Omega = \Omega_\text{crit}",
        proof=_theorem_1(
            "that a pair of complex conjugate eigenvalues crosses the imaginary axis, with nonzero speed",
            "that 'convex' is a slip of the pen (read)",
        ),
    ),
    Claim(
        "inverted_stable_above",
        "Section sec:linear_stab3DOF",
        "inverted spinning is stable above Omega_crit",
        "stable",
        _stability("inverted", (1,)),
        formula=r"\Re\lambda_i < 0 \quad\text{for}\quad \Omega > \Omega_\text{crit}",
        proof=_theorem_1("asymptotic stability at every speed above Omega_crit"),
    ),
    Claim(
        "inverted_unstable_below",
        "Section sec:linear_stab3DOF",
        "inverted spinning is unstable below Omega_crit",
        "unstable",
        _stability("inverted", (-1,)),
        formula=r"\Re\lambda_{1,2} > 0 \quad\text{for}\quad \Omega < \Omega_\text{crit}",
        proof=_theorem_1("instability at every speed below Omega_crit"),
    ),
    Claim(
        "noninverted_unstable",
        "Section sec:linear_stab3DOF",
        "noninverted spinning is always unstable",
        "unstable",
        _stability("noninverted", (-1, 1)),
        formula=r"\max_i \Re\lambda_i > 0 \quad\text{at}\quad (\pi/2,\,-\pi/2,\,0)",
        proof=_theorem_1("instability at every speed"),
    ),
    Claim(
        "expansion_mass",
        "Eq. MassMatrix_3DOF_approx",
        "M-tilde is the mass matrix to third order",
        "formula",
        _expansion_part("mass", ""),
        formula=(
            r"\tilde{M} = (A-\bar{B})\,\bar{\gamma}^2 + \bar{B} + m(r+e)^2\,\bar{\beta}^2"
            r" + \mathcal{O}(\|\bar{z}\|^4)"
        ),
    ),
    Claim(
        "expansion_gyroscopic",
        "Eq. GyroVector_3DOF_approx",
        "h-tilde is the vector of gyroscopic forces to third order",
        "formula",
        _expansion_part("gyroscopic", "the mixed term is -[2 (A - Bbar) + m e (r + e)] Omega"),
        formula=(
            r"\tilde{h} = -\bar{B}\Omega^2\bar{\beta} + (\bar{B}-A)\Omega^2\bar{\beta}\bar{\gamma}^2"
            r" + \left[\tfrac{2}{3}\bar{B} - m e(r+e)\right]\Omega^2\bar{\beta}^3"
            r" - 2\left[A-\bar{B}+m e(r+e)\right]\Omega\dot{\bar{\beta}}\bar{\beta}\bar{\gamma}"
            r" - m(r+e)^2\dot{\bar{\beta}}^2\bar{\beta} + \dots"
        ),
    ),
    Claim(
        "expansion_gravity",
        "Eq. force_3DOF_approx",
        "f_G to third order",
        "formula",
        _expansion_part("gravity", "gamma_bar^3 should be gamma_bar^2"),
        formula=(
            r"f_G = m g(r+e)\bar{\beta} - \tfrac{1}{2} m g e\,\bar{\beta}\bar{\gamma}^3"
            r" - \tfrac{1}{6} m g(r+e)\bar{\beta}^3"
            r" + \dots"
        ),
    ),
    Claim(
        "expansion_friction",
        "Eq. genForce_3DOF_approx",
        "w_y lambda_Ty to third order",
        "formula",
        _expansion_part("friction", ""),
        formula=(
            r"w_y\lambda_{Ty} = -\frac{\mu m g}{\varepsilon}\left[-\Omega e\,\tfrac{4e+r}{6}\bar{\gamma}^3"
            r" + (r+e)^2\dot{\bar{\beta}} - \tfrac{3}{2}\Omega e(r+e)\bar{\beta}^2\bar{\gamma}"
            r" - (r+e)^2\dot{\bar{\beta}}\bar{\beta}^2 + e(r+e)\Omega\bar{\gamma}"
            r" - e(r+e)\dot{\bar{\beta}}\bar{\gamma}^2\right]"
            r" + \dots"
        ),
    ),
    Claim(
        "kappa_1",
        "below Eq. cos_balance",
        "kappa_1 is the cubic part of the sine balance",
        "-2 m e (r + e)",
        per_set(_balance_constant(0), "2 m e (r + e) enters with the other sign; the printed chi has it right", _EXACT),
        formula=(
            r"\kappa_1 = \tfrac{1}{4}\left[\bar{B} - 3A - 2 m e(r+e)\right]\Omega^2 - \tfrac{1}{2} m(r+e)^2\omega^2"
            r" + \tfrac{1}{8} m g e\frac{\Omega^2}{\omega^2} - \tfrac{1}{4}(\bar{B}-A)\frac{\Omega^4}{\omega^2}"
            r" + \tfrac{1}{8} m g(r+e)"
        ),
    ),
    Claim(
        "kappa_2",
        "Eq. kappa2",
        "kappa_2 is the cubic part of the cosine balance",
        "formula",
        per_set(
            _balance_constant(1),
            "follows from the ansatz D = -C Omega/omega, which drops a cubic term of gamma_bar' = Omega sin(beta_bar)",
            _EXACT,
        ),
        formula=(
            r"\kappa_2 = -e\,\frac{r+4e}{2}\,\frac{\Omega^4}{\omega^2} + \tfrac{3}{2} e(r+e)\Omega^2"
            r" + (r+e)^2\omega^2"
        ),
    ),
    Claim(
        "delta",
        "Eq. delta",
        "delta = -(1/8) (r - e)/(r + e) Omega^2",
        "-(1/8) (r - e)/(r + e) Omega^2",
        per_set(_balance_constant(2), "-(1/8) r/(r + e) Omega^2 with the cubic kinematic term", _EXACT),
        formula=r"\delta = -\frac{1}{8}\,\frac{r-e}{r+e}\,\Omega^2",
    ),
    Claim(
        "chi",
        "below Eq. Csol",
        "chi = 1.31e-7 kg m^3",
        "1.31e-7",
        number(_chi, "the printed formula", _CLOSED),
        unit="kg m^3",
        formula=r"\chi = A(r-2e) - \bar{B}\,\frac{2r^2+e(r+e)}{2(r+e)}",
        proof=ProofOffer("Theorem 3", "certify hopf", "an enclosure of the number", law="linear"),
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
        formula=(
            r"C = 2\sqrt{\frac{e}{r+e}}\sqrt{-\frac{\bar{B}r\Omega^2 - m g(r+e)^2}{\chi\Omega^2 + m g e(r+e)}}"
            r" + \mathcal{O}(C^4)"
        ),
        figures=("harmonic_balance",),
    ),
    Claim(
        "period_law",
        "Eq. omega_sol",
        "omega is the frequency of the cycle up to O(C^4)",
        "omega + O(C^4)",
        per_set(_slope_claim(1), "as for the amplitude", ("first Lyapunov coefficient", "closed form")),
        formula=(
            r"\omega = \Omega\sqrt{\frac{e}{r+e}\left(1 + \frac{1}{2}\,\frac{r-e}{r+e}\,"
            r"\frac{\bar{B}r\Omega^2 - m g(r+e)^2}{\chi\Omega^2 + m g e(r+e)}\right)}"
        ),
        figures=("harmonic_balance",),
    ),
    Claim(
        "supercritical",
        "Section sec:linear3DOF",
        "the Hopf bifurcation is supercritical",
        "supercritical",
        compared(_supercritical, "the sign of A (r - 2e) - Bbar r (2r - e) / (2 (r + e)), exactly", _EXACT),
        formula=r"\chi\,\Omega_\text{crit}^2 + m g e(r+e) > 0",
        proof=ProofOffer(
            "Theorem 3",
            "certify hopf",
            "the signs of the first Lyapunov coefficient and of d(Re lambda)/dOmega",
            law="linear",
        ),
    ),
    Claim(
        "period_crit",
        "text below Eq. omega_sol",
        "the period at the Hopf point is 0.886 s",
        "0.886",
        number(_period, "0.8867 for Table 1 as rounded", _CLOSED),
        unit="s",
        formula=r"T_\text{crit} = \frac{2\pi}{\Omega_\text{crit}}\sqrt{\frac{r+e}{e}}",
        proof=_theorem_1("an enclosure of 2 pi / omega for the pair +- i omega at Omega_crit"),
    ),
)
