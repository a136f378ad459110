"""Stability, the Hopf point and its normal form: closed forms, enclosed to any number of digits.

Linear stability
----------------
Let r, e, m, A, g, mu, epsilon and Bbar = B - m e^2 be positive and e < r. Let b = Bbar / m and
kappa = mu g / (epsilon b). The characteristic polynomial at inverted (+) and noninverted (-)
spinning is lambda^3 + a2 lambda^2 + a1 lambda + a0 with

    a2 = kappa (r +- e)^2,   a1 = Omega^2 - g (r +- e) / b,   a0 = +- kappa e (r +- e) Omega^2.

Noninverted spinning has a0 < 0 < a2: the product of its eigenvalues is positive and their sum
negative. So at every speed one is positive and two have a negative real part. At inverted spinning
a2, a0 > 0 and

    a2 a1 - a0 = kappa (r + e) (r Omega^2 - g (r + e)^2 / b).

By Routh-Hurwitz this is positive exactly where inverted spinning is stable: above Omega_crit, for
every disk. `check_linearization` derives the coefficients from the Jacobian of `model.equations`,
as polynomials in all parameters at once, and refuses a disk outside the hypotheses.

The normal form
---------------
Cubic terms come from Taylor series of the same equations. About an equilibrium the field is odd
(the point symmetry). So Kuznetsov's l_1 is Re <p, C(q, q, qbar)> / (2 omega) (Elements of Applied
Bifurcation Theory, Eq. 5.39).

No ball becomes a point here; `ball_to_measured` returns midpoints with their radii.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache
from typing import Any, Literal

from flint import Ordering, acb, acb_series, arb, fmpq, fmpq_mpoly_ctx, fmpq_poly

from tippedisk_verify.display import Eigenvalue, Printable, quantity
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.parameters import Constants, Parameters
from tippedisk_verify.numbers.decimals import exact_text
from tippedisk_verify.numbers.exact import is_one_of, short_text
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.proofs.angles import INVERTED, NONINVERTED, linearization, rates
from tippedisk_verify.proofs.ball_conversions import ball_constants, ball_to_measured
from tippedisk_verify.proofs.kernel.balls import (
    ball,
    coefficient,
    inside,
    negative,
    positive,
    series_length,
    working_precision,
)

__all__ = [
    "Criticality",
    "ProvedEquilibrium",
    "ProvedHopf",
    "ProvedStability",
    "characteristic_polynomial",
    "check_linearization",
    "chi",
    "exact_polynomial",
    "hopf_balls",
    "measured_omega_crit",
    "proved_equilibrium",
    "proved_hopf",
    "proved_stability",
    "real_root",
    "refuse_past_birth",
    "to_digits",
]

Criticality = Literal["supercritical", "subcritical"]
# Bits in which Omega_crit is enclosed, to tell on which side of it a speed lies
_OMEGA_CRIT_BITS = 128
_EQUILIBRIA = {"inverted": INVERTED, "noninverted": NONINVERTED}


@dataclass(frozen=True, repr=False)
class ProvedEquilibrium(Printable):
    """A proved result: the eigenvalues and the stability of an equilibrium at one speed."""

    _omitted = ("name",)

    name: str
    eigenvalues: tuple[Eigenvalue, ...] = field(
        metadata=quantity(
            "exactly one in each rectangle, by descending real, then imaginary part", "1/s"
        )
    )
    stable: bool
    unstable_directions: int  #: eigenvalues with positive real part
    statement: str


@dataclass(frozen=True, repr=False)
class ProvedHopf(Printable):
    """A proved result: the numbers of the Hopf point of inverted spinning.

    Units and definitions are those of `tippedisk_verify.theory.hopf.HopfPoint`.
    """

    omega_crit: Measured = field(metadata=quantity("Eq. approx_omega_crit", "rad/s"))
    period: Measured = field(metadata=quantity("of the cycle at its birth", "s"))
    lambda_3: Measured = field(
        metadata=quantity("A33, Eq. closed_la3; at Omega_crit the third eigenvalue itself", "1/s")
    )
    chi: Measured = field(
        metadata=quantity(
            "the constant of the one-harmonic amplitude law, below Eq. Csol", "kg m^3"
        )
    )
    #: Kuznetsov's l_1, <q, q> = 1 in (beta, gamma, v), SI units
    first_lyapunov_coefficient: Measured
    transversality: Measured = field(
        metadata=quantity("d(Re lambda)/d(Omega) of the critical pair", "1/rad")
    )
    amplitude_squared_slope: Measured = field(
        metadata=quantity("limit of beta_max^2 / (Omega_crit - Omega)", "rad s")
    )
    period_slope: Measured = field(
        metadata=quantity("limit of (T - T_crit) / (Omega_crit - Omega)", "s^2/rad")
    )
    criticality: Criticality
    statement: str


@dataclass(frozen=True, repr=False)
class ProvedStability(Printable):
    """A proved result: the linear stability at every speed (Theorem 1), with numbers at Omega_crit,
    for both friction laws.
    """

    omega_crit: Measured = field(metadata=quantity("Eq. approx_omega_crit", "rad/s"))
    period: Measured = field(
        metadata=quantity("2 pi / omega for the pair +- i omega at Omega_crit", "s")
    )
    lambda_3: Measured = field(
        metadata=quantity("A33, Eq. closed_la3; at Omega_crit the third eigenvalue itself", "1/s")
    )
    transversality: Measured = field(
        metadata=quantity("d(Re lambda)/d(Omega) of the critical pair", "1/rad")
    )
    statement: str


def characteristic_polynomial(
    constants: Constants, omega: Any, around: int
) -> tuple[Any, Any, Any]:
    """Return (a2, a1, a0) of lambda^3 + a2 lambda^2 + a1 lambda + a0 at an equilibrium (Eq.
    3DOF_lin).

    The Jacobian has the rows (0, 0, 1), (Omega, 0, 0) and (A31, A32, A33).
    """
    matrix = linearization(constants, omega, around)
    return -matrix[2][2], -matrix[2][0], -(matrix[1][0] * matrix[2][1])


def exact_polynomial(constants: Constants, omega: Fraction, around: int) -> Any:
    """Return the characteristic polynomial of an equilibrium, with exact rational coefficients.

    Args:
        constants: The disk's constants, rational numbers.
        omega: The speed [rad/s].
        around: The equilibrium's gamma in units of pi/2.

    Returns:
        The polynomial as a python-flint object (``fmpq_poly``).
    """
    coefficients = (*reversed(characteristic_polynomial(constants, omega, around)), 1)
    return fmpq_poly(
        [fmpq(Fraction(part).numerator, Fraction(part).denominator) for part in coefficients]
    )


def proved_equilibrium(
    parameters: Parameters, omega: object, name: str, digits: int = 12
) -> ProvedEquilibrium:
    """Enclose the eigenvalues of an equilibrium to ``digits`` significant digits and prove its
    stability. ``omega`` [rad/s] is an exact speed.

    Arb isolates the roots of the exact polynomial. Raises InputError for an unknown name or a speed
    out of range, AccuracyError if the stability depends on nonlinear terms or an eigenvalue is
    double.
    """
    if not is_one_of(name, _EQUILIBRIA):
        raise InputError(
            f"equilibrium '{short_text(name)}' is unknown: use inverted or noninverted"
        )
    speed = checked_speed(omega)
    polynomial = exact_polynomial(parameters.rational_constants(), speed, _EQUILIBRIA[name])
    a0, a1, a2, _ = polynomial.coeffs()

    def roots() -> dict[str, Any]:
        return {str(place): root for place, (root, _) in enumerate(polynomial.complex_roots())}

    enclosed: list[Any] = []
    eigenvalues: list[Eigenvalue] = []
    unstable, wanted = 0, digits
    while (
        not _disjoint(eigenvalues) or unstable + sum(negative(root.real) for root in enclosed) != 3
    ):
        # More digits decide every sign, except for a real part of exactly zero or a double root.
        if wanted > 16 * digits + 1000:
            raise AccuracyError(
                f"{name} spinning has an eigenvalue on the imaginary axis, or a double one, here"
            )
        enclosed = list(to_digits(roots, wanted).values())
        eigenvalues = [
            Eigenvalue(ball_to_measured(root.real), ball_to_measured(root.imag))
            for root in enclosed
        ]
        unstable = sum(positive(root.real) for root in enclosed)
        wanted *= 4
    stable = a2 > 0 and a0 > 0 and a2 * a1 > a0
    if stable != (unstable == 0):
        raise AccuracyError(
            "Routh-Hurwitz and the enclosed eigenvalues contradict each other: report this"
        )
    eigenvalues.sort(key=lambda value: (-value.re.value, -value.im.value))
    sign, (first, second, third) = "-" if name == "noninverted" else "", eigenvalues
    statement = (
        f"for the tippedisk with {parameters.definition()} at Omega = {exact_text(speed)} rad/s, "
        f"under the "
        f"linear as under the smooth Coulomb friction law, {name} spinning, (beta, gamma, v) = "
        f"(pi/2, {sign}pi/2, 0), "
        f"has exactly one eigenvalue [1/s] in each of the three disjoint rectangles {first}, "
        f"{second} and {third}, "
        f"{unstable} of them with positive real part; it is "
        f"{'asymptotically stable' if stable else 'unstable'}."
    )
    return ProvedEquilibrium(name, tuple(eigenvalues), stable, unstable, statement)


def real_root(polynomial: tuple[Any, Any, Any], guess: Any) -> Any:
    """Return a ball that holds exactly one root of lambda^3 + a2 lambda^2 + a1 lambda + a0, for all
    coefficients in their balls.

    Interval Newton: N = x - p(x) / p'(X) inside X holds exactly one zero. Raises AccuracyError if
    that is not proved.
    """
    a2, a1, a0 = polynomial
    x = guess.mid()
    value = ((x + a2) * x + a1) * x + a0
    radius = abs(value / ((3 * x + 2 * a2) * x + a1)).upper() * 2
    around = x + arb(0, radius)
    image = x - value / ((3 * around + 2 * a2) * around + a1)
    if not inside(image, around):
        raise AccuracyError(
            "an eigenvalue could not be enclosed over the interval of speeds: ask for more digits"
        )
    return image


def chi(constants: Any) -> Any:
    """Return chi [kg m^3], the constant of the one-harmonic amplitude law, in the paper's form.

    It is A (r - 2 e) - Bbar (2 r^2 + e (r + e)) / (2 (r + e)). The formula stands below Eq. Csol.
    """
    r, e, A, Bbar = constants.r, constants.e, constants.A, constants.Bbar
    return A * (r - 2 * e) - Bbar * (2 * (r * r) + e * (r + e)) / (2 * (r + e))


def proved_hopf(parameters: Parameters, digits: int = 12) -> ProvedHopf:
    """Enclose all numbers of the Hopf point to ``digits`` significant digits, and prove its
    criticality.

    Raises AccuracyError if the first Lyapunov coefficient is too close to zero for its sign or
    these digits.
    """
    parameters.refuse_unless_linear("the Hopf point's normal form is")
    check_linearization(parameters.rational_constants())
    with_balls = to_digits(lambda: hopf_balls(ball_constants(parameters)), digits)
    falling, sign = with_balls["transversality"], with_balls["first_lyapunov_coefficient"]
    if not negative(falling) or not (negative(sign) or positive(sign)):
        raise AccuracyError(
            "the sign of the first Lyapunov coefficient could not be decided: ask for more digits"
        )
    kind: Criticality = "supercritical" if negative(sign) else "subcritical"
    numbers = {name: ball_to_measured(value) for name, value in with_balls.items()}
    return ProvedHopf(
        **numbers, criticality=kind, statement=_hopf_statement(parameters, kind, numbers)
    )


def refuse_past_birth(parameters: Parameters, highest: Fraction) -> None:
    """Raise InputError if speeds up to ``highest`` [rad/s] reach Omega_crit, for a disk whose limit
    cycles are born below Omega_crit.

    If cycles are born above Omega_crit, a range that includes it may well be proved.
    """
    with working_precision(_OMEGA_CRIT_BITS):
        numbers = hopf_balls(ball_constants(parameters))
        crit = numbers["omega_crit"]
        if negative(numbers["first_lyapunov_coefficient"]) and not ball(highest) < crit:
            raise InputError(
                f"this disk's limit cycles are born below Omega_crit = {float(crit):.12g} rad/s: "
                f"the speeds must end "
                f"below it, not at {float(highest):.12g} rad/s"
            )


def _hopf_statement(
    parameters: Parameters, kind: Criticality, numbers: Mapping[str, Measured]
) -> str:
    sign, cycles, side = (
        ("negative", "stable", "below")
        if kind == "supercritical"
        else ("positive", "unstable", "above")
    )
    return (
        f"for the tippedisk with {parameters.definition()} under the linear friction law, inverted "
        f"spinning, "
        f"(beta, gamma, v) = (pi/2, pi/2, 0), has a Hopf point at Omega_crit = "
        f"{numbers['omega_crit']} rad/s: a pair "
        f"of eigenvalues, there +-2 pi i / T_crit with T_crit = {numbers['period']} s, crosses the "
        f"imaginary axis with "
        f"d(Re lambda)/dOmega = {numbers['transversality']} 1/rad, the third eigenvalue is "
        f"lambda_3 = "
        f"{numbers['lambda_3']} 1/s, and the first Lyapunov coefficient (Kuznetsov's, <q, q> = 1 "
        f"in (beta, gamma, v), "
        f"SI units) is l_1 = {numbers['first_lyapunov_coefficient']}, which is {sign}; so the Hopf "
        f"point is {kind}, "
        f"and a branch of {cycles} limit cycles is born {side} Omega_crit, along which beta_max^2 "
        f"/ (Omega_crit - "
        f"Omega) tends to {numbers['amplitude_squared_slope']} rad s and (T - T_crit) / "
        f"(Omega_crit - Omega) to "
        f"{numbers['period_slope']} s^2/rad; and chi = A (r - 2 e) - (B - m e^2) (2 r^2 + e (r + "
        f"e)) / (2 (r + e)) is "
        f"{numbers['chi']} kg m^3."
    )


def _disjoint(roots: list[Eigenvalue]) -> bool:
    """Return True if there are three eigenvalues and the rectangles that enclose them are disjoint
    even when doubled.

    They are doubled because printing widens the rectangles.
    """

    def meet(a: Measured, b: Measured) -> bool:
        return abs(a.value - b.value) <= 2 * (a.uncertainty + b.uncertainty)

    pairs = ((roots[i], roots[k]) for i in range(len(roots)) for k in range(i))
    return len(roots) == 3 and not any(meet(a.re, b.re) and meet(a.im, b.im) for a, b in pairs)


def check_linearization(constants: Constants) -> None:
    """Raise an error unless the stability theorem applies to a disk.

    Checked are the theorem's hypotheses on the disk's constants, and its formulas for the
    coefficients a2, a1, a0 of the characteristic polynomial.

    Raises InputError if the disk does not meet the hypotheses, ArithmeticError if the equations of
    motion have different coefficients.
    """
    names = ("r", "e", "m", "A", "Bbar", "g", "mu", "epsilon")
    wrong = [name for name in names if not getattr(constants, name) > 0]
    if wrong or not constants.e < constants.r:
        fault = f"{wrong[0]} is not positive" if wrong else "e is not smaller than r"
        raise InputError(f"nothing is proved of this disk: {fault}")
    _check_coefficients()


@cache
def _check_coefficients() -> None:
    """Raise ArithmeticError unless the theorem's formulas for a2, a1 and a0 agree with the
    Jacobians of the equations of motion.

    They are compared as polynomials in all parameters and Omega. The unit of length makes b = 1.
    With mu g = k epsilon the smooth law's Jacobian, from either side of gamma_y = 0, is the linear
    law's.
    """
    ring = fmpq_mpoly_ctx.get(("r", "e", "g", "a", "k", "epsilon", "Omega"), Ordering.lex)
    r, e, g, a, k, epsilon, omega = ring.gens()
    constants = Constants(
        r, e, 1, a, None, 1, g, None, epsilon, a, ring.constant(1), k, k * epsilon
    )
    # The heights of the centre of gravity
    for around, height, sign in ((INVERTED, r + e, 1), (NONINVERTED, r - e, -1)):
        expected = (k * height**2, omega**2 - g * height, sign * k * e * height * omega**2)
        linear = linearization(constants, omega, around)
        smooth = [linearization(constants, omega, around, "smooth", side) for side in (1, -1)]
        if characteristic_polynomial(constants, omega, around) != expected or smooth != [
            linear,
            linear,
        ]:
            raise ArithmeticError(
                "the linearisation has other coefficients: the equations of motion have changed"
            )


def proved_stability(parameters: Parameters, digits: int = 12) -> ProvedStability:
    """Prove the linear stability at every speed, and enclose Omega_crit and the numbers there to
    ``digits`` digits.
    """
    check_linearization(parameters.rational_constants())
    names = ("omega_crit", "period", "lambda_3", "transversality")

    def numbers() -> dict[str, Any]:
        values = hopf_balls(ball_constants(parameters))
        return {name: values[name] for name in names}

    values = {name: ball_to_measured(value) for name, value in to_digits(numbers, digits).items()}
    statement = (
        f"for the tippedisk with {parameters.definition()}, under the linear as under the smooth "
        f"Coulomb friction law, "
        "noninverted spinning is unstable at every Omega > 0, with one positive eigenvalue and two "
        "of negative real "
        "part; inverted spinning is asymptotically stable at every Omega > Omega_crit and "
        "unstable, with two "
        "eigenvalues of positive real part, at every Omega < Omega_crit = sqrt((r + e)^2 m g / (r "
        "(B - m e^2))) = "
        f"{values['omega_crit']} rad/s, whatever mu and epsilon are; at Omega_crit a pair of "
        f"complex conjugate "
        f"eigenvalues, there +-2 pi i / T_crit with T_crit = {values['period']} s, crosses the "
        f"imaginary axis with "
        f"d(Re lambda)/dOmega = {values['transversality']} 1/rad, and the third is lambda_3 = "
        f"{values['lambda_3']} 1/s."
    )
    return ProvedStability(**values, statement=statement)


def hopf_balls(constants: Constants) -> dict[str, Any]:
    """Return the numbers of `ProvedHopf` as balls, for constants that are balls.

    With lambda the critical pair, p(lambda, Omega) = 0 gives d(lambda)/d(Omega). On the centre
    manifold z' = lambda z + c_1 z |z|^2. So |z|^2 = -Re lambda / Re c_1, and beta_max = 2 |z| |q_1|
    to leading order.
    """
    r, e = constants.r, constants.e
    square = (r + e) * (r + e) * constants.g / (r * constants.b)  # Eq. approx_omega_crit
    speed = square.sqrt()
    frequency = (e / (r + e) * square).sqrt()
    a2, _, _ = characteristic_polynomial(constants, speed, INVERTED)
    matrix = linearization(constants, speed, INVERTED)
    root = acb(0, frequency)
    # The derivatives of a1 = Omega^2 - g (r + e) / b and of a0, proportional to Omega^2, with
    # respect to Omega. At Omega_crit a1 = frequency^2.
    slope_a0 = -2 * matrix[2][1]
    pair_slope = -(2 * speed * root + slope_a0) / (
        3 * root * root + 2 * a2 * root + frequency * frequency
    )
    # Eigenvectors from the first two rows and the last two columns of the Jacobian.
    right = [root, acb(speed), root * root]
    size = sum((abs(part) ** 2 for part in right), arb(0)).sqrt()
    right = [part / size for part in right]
    left = [(root - matrix[2][2]) * root, acb(matrix[2][1]), root]
    scale = sum((a * c for a, c in zip(left, right, strict=True)), acb(0))
    cubic = _resonant_cubic(constants, speed, right)
    c_1 = sum((a * c for a, c in zip(left, cubic, strict=True)), acb(0)) / (2 * scale)
    falling, damping = pair_slope.real, c_1.real
    growth = falling / damping  # |z|^2 per unit of Omega_crit - Omega
    return {
        "omega_crit": speed,
        "period": 2 * arb.pi() / frequency,
        "lambda_3": -a2,
        "chi": chi(constants),
        "first_lyapunov_coefficient": damping / frequency,
        "transversality": falling,
        "amplitude_squared_slope": 4 * growth * abs(right[0]) ** 2,
        "period_slope": 2
        * arb.pi()
        / (frequency * frequency)
        * (pair_slope.imag - c_1.imag * growth),
    }


def measured_omega_crit(parameters: Parameters) -> Measured:
    """Return an enclosure of Omega_crit [rad/s] as a `Measured` number."""
    with working_precision(_OMEGA_CRIT_BITS):
        return ball_to_measured(hopf_balls(ball_constants(parameters))["omega_crit"])


def _resonant_cubic(constants: Constants, omega: Any, q: list[Any]) -> list[Any]:
    """Return C(q, q, qbar) at inverted spinning, where C is the trilinear third derivative of the
    field and q is a complex vector.

    It comes from cubic Taylor coefficients along four directions. With F(x) = C(x, x, x) / 6, F(q +
    w qbar) has the term w C(q, q, qbar) / 2; w = 1, -1, i, -i isolate it.
    """
    total = [acb(0)] * 3
    for w in (acb(1), acb(0, 1), acb(-1), acb(0, -1)):
        direction = [part + w * part.conjugate() for part in q]
        rate = _along(constants, omega, direction)
        total = [sum_ + coefficient / w for sum_, coefficient in zip(total, rate, strict=True)]
    return [part / 2 for part in total]


def _along(constants: Constants, omega: Any, direction: list[Any]) -> list[Any]:
    """Return the third Taylor coefficients of the three rates along a line of states.

    The state is inverted spinning plus s times a complex ``direction``; the result has the
    coefficients of s^3.
    """
    with series_length(4):
        line = [acb_series([0, part], prec=4) for part in direction]
        return [coefficient(rate, 3) for rate in rates(constants, omega, INVERTED, line)]


def to_digits(compute: Callable[[], Mapping[str, Any]], digits: int) -> Mapping[str, Any]:
    """Call ``compute`` at growing precision until each of its balls has ``digits`` significant
    digits, and return the balls by name.

    An exact zero may have the radius 0. Raises AccuracyError if eight times the digits do not
    suffice.
    """
    guard = 20
    while True:
        with working_precision(math.ceil((digits + guard) * math.log2(10))):
            balls = compute()
            # Twice the radius: printing may add as much again.
            loose = [name for name, value in balls.items() if not _fine(value, digits)]
        if not loose:
            return balls
        guard *= 2
        if guard > 8 * digits + 200:
            raise AccuracyError(
                f"{loose[0]} does not have {digits} digits: it is too close to zero or to its "
                f"neighbour"
            )


def _fine(value: Any, digits: int) -> bool:
    parts = (value.real, value.imag) if isinstance(value, acb) else (value,)
    size = abs(value)
    return all(part.is_finite() and 2 * part.rad() * arb(10) ** digits <= size for part in parts)
