"""The Hopf point of inverted spinning: where, how fast it is crossed, and what is born there.

All formulas hold for the linear friction law; the smooth law has the same linear part, but its field is only once
continuously differentiable, so it has no first Lyapunov coefficient.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Literal

from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.exact import exact, quotient
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import bits, bits_for_digits, checked_digits
from tippedisk_verify.model.results import Printable
from tippedisk_verify.theory.amplitude_law import amplitude_law
from tippedisk_verify.theory.expansion import cubic_acceleration, derived

__all__ = [
    "HopfPoint",
    "critical_frequency_squared",
    "criticality",
    "criticality_margin",
    "hopf_point",
    "normal_form",
    "omega_crit",
    "omega_crit_decimal",
    "omega_crit_squared",
    "period_crit",
    "speed_below_crit",
    "trilinear",
]

_GUARDS = (15, 60, 240, 960)  # digits more than asked for, in turn
Criticality = Literal["supercritical", "subcritical", "degenerate"]


@dataclass(frozen=True, repr=False)
class HopfPoint(Printable):
    """Everything local about the Hopf point, to the digits asked for."""

    omega_crit: Measured  #: [rad/s], Eq. approx_omega_crit
    period: Measured  #: [s] of the cycle at its birth
    first_lyapunov_coefficient: Measured  #: Kuznetsov's l_1, <q, q> = 1 in (beta, gamma, v), SI units
    criticality: Criticality  #: of the first Lyapunov coefficient's sign, decided exactly
    transversality: Measured  #: d(Re lambda)/d(Omega) of the critical pair [1/rad]
    quadratic_coefficient: Measured  #: c_1 of Omega = Omega_crit + c_1 a^2 + c_2 a^4, a = gamma_bar_0 [1/(rad s)]
    quartic_coefficient: Measured  #: c_2 [1/(rad^3 s)]
    second_lyapunov_coefficient: Measured | None = None  #: Kuznetsov's l_2, likewise; only where l_1 = 0
    amplitude_squared_slope: Measured | None = None  #: limit of beta_max^2 / (Omega_crit - Omega) [rad s], if l_1 != 0
    period_slope: Measured | None = None  #: limit of (T - T_crit) / (Omega_crit - Omega) [s^2/rad], if l_1 != 0

    def slopes(self) -> tuple[Measured, Measured]:
        """`amplitude_squared_slope` and `period_slope`. Raises Shortfall where l_1 = 0."""
        if self.amplitude_squared_slope is None or self.period_slope is None:
            raise Shortfall("the first Lyapunov coefficient vanishes exactly: amplitude and period have no slopes")
        return self.amplitude_squared_slope, self.period_slope


def omega_crit_squared(parameters: Parameters) -> Fraction:
    """Omega_crit^2 = (r + e)^2 m g / (r Bbar) [rad^2/s^2], exactly (Eq. approx_omega_crit).

    Where Routh-Hurwitz has a2 a1 = a0; mu and epsilon cancel.
    """
    constants = parameters.rational()
    return Fraction((constants.r + constants.e) ** 2 * constants.g / (constants.r * constants.b))


def critical_frequency_squared(parameters: Parameters) -> Fraction:
    """omega^2 = e Omega_crit^2 / (r + e) [rad^2/s^2] of the imaginary pair (Eq. omega_sol_C2)."""
    return parameters.e / (parameters.r + parameters.e) * omega_crit_squared(parameters)


def criticality_margin(parameters: Parameters) -> Fraction:
    """A (r - 2 e) - Bbar r (2 r - e) / (2 (r + e)) [kg m^3]: positive where the Hopf point is supercritical.

    Equal to (chi Omega^2 + m g e (r + e)) / Omega^2 at Omega_crit with the consistent chi; friction does not enter.
    """
    p = parameters
    return p.A * (p.r - 2 * p.e) - p.Bbar * p.r * (2 * p.r - p.e) / (2 * (p.r + p.e))


def criticality(parameters: Parameters) -> Criticality:
    """On which side of Omega_crit the cycles are, by the exact sign of `criticality_margin`."""
    margin = criticality_margin(parameters)
    if not margin:
        return "degenerate"
    return "supercritical" if margin > 0 else "subcritical"


def omega_crit(parameters: Parameters, digits: int = 15) -> Measured:
    """The critical spinning speed [rad/s] to ``digits`` significant digits. Raises InputError as `checked_digits`."""
    return _from_root(omega_crit_squared(parameters), checked_digits(digits), lambda ctx, root: root)


def omega_crit_decimal(parameters: Parameters, digits: int) -> Fraction:
    """A decimal so near to Omega_crit [rad/s] that taking it instead changes nothing in ``digits`` digits.

    30 digits more than asked for: the rounding of Omega_crit then stays far below every half-width.
    """
    speed = _from_root(omega_crit_squared(parameters), checked_digits(digits) + 30, lambda ctx, root: root)
    return Fraction(speed.decimals()[0])


def speed_below_crit(parameters: Parameters, distance: object, digits: int) -> Fraction:
    """The decimal speed [rad/s] that lies ``distance`` [rad/s] below Omega_crit.

    Raises InputError for a distance that is no decimal, or leaves no speed.
    """
    below = exact(distance)
    if below.pi_multiple:
        raise InputError("the distance below Omega_crit must be a decimal")
    return checked_speed(omega_crit_decimal(parameters, digits) - below.rational)


def period_crit(parameters: Parameters, digits: int = 15) -> Measured:
    """The period 2 pi / omega [s] of the cycle at its birth, to ``digits`` significant digits.

    Raises InputError as `checked_digits` does.
    """
    return _from_root(
        critical_frequency_squared(parameters), checked_digits(digits), lambda ctx, root: 2 * ctx.pi / root
    )


def _from_root(square: Fraction, digits: int, function: Callable[[Any, Any], Any]) -> Measured:
    ctx = bits(bits_for_digits(digits + 5)).context
    value = function(ctx, ctx.sqrt(quotient(ctx, square)))
    # Five operations, each correctly rounded: 8 ulps hold them.
    return Measured.of(value, abs(value) * 8 * ctx.eps)


def hopf_point(parameters: Parameters, digits: int = 12) -> HopfPoint:
    """The Hopf point to ``digits`` significant digits.

    Each quantity is evaluated with 15 digits more than asked for, or with more where l_1 nearly vanishes, and again
    with 20 more to see its error. Where l_1 = 0, the Bautin point, there is l_2 instead of the two slopes.
    Raises InputError as `checked_digits` does, Shortfall where cancellation leaves fewer digits.
    """
    parameters.refuse_smooth("the Hopf point's normal form is")
    checked_digits(digits)
    for guard in _GUARDS:
        working = bits_for_digits(digits + guard)
        rough, sharp = (_numbers(parameters, width) for width in (working, working + 66))
        least = Fraction(1, 2 ** (working - 1))
        measured = {name: Measured.compared(value, sharp[name], least) for name, value in rough.items()}
        vague = [name for name, number in measured.items() if number.uncertainty * 10**digits > abs(number.value)]
        if not vague:
            return HopfPoint(criticality=criticality(parameters), **measured)
    raise Shortfall(f"{vague[0]} loses more than {_GUARDS[-1]} digits to cancellation")


def _numbers(parameters: Parameters, working_bits: int) -> dict[str, Any]:
    ctx, law = bits(working_bits).context, amplitude_law(parameters)
    numbers = normal_form(parameters, working_bits, degenerate=not law.quadratic)
    coefficients = {f"{name}_coefficient": quotient(ctx, part) for name, part in law._asdict().items()}
    return numbers | {name: part * numbers["omega_crit"] for name, part in coefficients.items()}


def normal_form(parameters: Parameters, working_bits: int, *, degenerate: bool = False) -> dict[str, Any]:
    """Numbers of `HopfPoint` in an arithmetic of ``working_bits``, as mpmath numbers.

    Kuznetsov, Elements of Applied Bifurcation Theory, Eq. (5.39) without its quadratic terms, which the point symmetry
    removes: c_1 = <p, C(q, q, qbar)> / 2 and l_1 = Re c_1 / omega, with A q = i omega q, A^T p = -i omega p,
    <q, q> = <p, q> = 1. On the centre manifold z' = lambda(Omega) z + c_1 z |z|^2 and x = z q + conj(z q), so
    |z|^2 = -Re lambda / Re c_1 and beta_max = 2 |z| |q_1| to leading order.

    ``degenerate`` takes l_1 as zero. The next term of z' is then c_2 z |z|^4 with l_2 = Re c_2 / omega (Section 8.3),
    and |z|^4 = -Re lambda / Re c_2 on the cycles, which gives l_2 by the amplitude law: a = 2 |z| |q_2|.
    """
    ctx = bits(working_bits).context
    constants = parameters.within(ctx)
    square = omega_crit_squared(parameters)
    speed = ctx.sqrt(quotient(ctx, square))
    reach, ratio = constants.r + constants.e, constants.k / constants.b
    frequency = speed * ctx.sqrt(constants.e / reach)
    a32, a33 = -ratio * constants.e * reach * speed, -ratio * reach**2
    root = ctx.mpc(0, frequency)
    right = [root, speed, root**2]
    size = ctx.sqrt(sum(abs(part) ** 2 for part in right))
    right = [part / size for part in right]
    left = [(root - a33) * root, a32, root]  # row vector with left A = i omega left; conj(p) in the formulas
    scale = sum(a * b for a, b in zip(left, right, strict=True))
    left = [part / scale for part in left]

    def cubic(coefficients: dict[tuple[int, int, int], Any]) -> Any:
        """C(q, q, qbar) of one component: the third derivatives applied to q, q and its conjugate."""
        return sum(value * trilinear(powers, right, ctx) for powers, value in coefficients.items())

    acceleration = cubic(cubic_acceleration(derived(constants, speed)))
    kinematic = cubic({(3, 0, 0): -speed / 6})  # gamma_bar' = Omega sin(beta_bar)
    coefficient = (left[1] * kinematic + left[2] * acceleration) / 2
    # d(lambda)/d(Omega) = <p, dA/dOmega q>: dA/dOmega has the entries 1, -2 Omega and A32 / Omega.
    drift = left[1] * right[0] + left[2] * (-2 * speed * right[0] + a32 / speed * right[1])
    numbers = {"omega_crit": speed, "period": 2 * ctx.pi / frequency, "transversality": drift.real}
    if degenerate:
        quartic = speed * quotient(ctx, amplitude_law(parameters).quartic)
        second = -drift.real * quartic * (2 * abs(right[1])) ** 4 / frequency
        return numbers | {"first_lyapunov_coefficient": ctx.zero, "second_lyapunov_coefficient": second}
    growth = drift.real / coefficient.real  # |z|^2 per unit of Omega_crit - Omega
    return numbers | {
        "first_lyapunov_coefficient": coefficient.real / frequency,
        "amplitude_squared_slope": 4 * abs(right[0]) ** 2 * growth,
        "period_slope": -2 * ctx.pi / frequency**2 * (coefficient.imag * growth - drift.imag),
    }


def trilinear(powers: tuple[int, int, int], q: list[Any], ctx: Any) -> Any:
    """The symmetric trilinear form of the monomial x^i y^j z^k (times 3!) at (q, q, conj q).

    Six orderings of three factors: each factor in turn takes the conjugate, twice.
    """
    factors = [index for index, power in enumerate(powers) for _ in range(power)]
    total = ctx.mpc(0)
    for conjugated in range(3):
        product = ctx.mpc(2)
        for position, index in enumerate(factors):
            product *= ctx.conj(q[index]) if position == conjugated else q[index]
        total += product
    return total
