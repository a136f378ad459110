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
]

Criticality = Literal["supercritical", "subcritical", "degenerate"]


@dataclass(frozen=True)
class HopfPoint:
    """Everything local about the Hopf point, to the digits asked for."""

    omega_crit: Measured  #: [rad/s], Eq. approx_omega_crit
    period: Measured  #: [s] of the cycle at its birth
    first_lyapunov_coefficient: Measured  #: Kuznetsov's l_1, <q, q> = 1 in (beta, gamma, v), SI units
    criticality: Criticality  #: of the first Lyapunov coefficient's sign, decided exactly
    transversality: Measured  #: d(Re lambda)/d(Omega) of the critical pair [1/rad]
    amplitude_squared_slope: Measured  #: limit of beta_max^2 / (Omega_crit - Omega) [rad s]
    period_slope: Measured  #: limit of (T - T_crit) / (Omega_crit - Omega) [s^2/rad]

    def json(self) -> dict[str, object]:
        return {
            name: value.json() if isinstance(value, Measured) else value
            for name, value in ((name, getattr(self, name)) for name in self.__dataclass_fields__)
        }


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

    Each quantity is evaluated with 15 digits more than asked for, and again with 20 more to see its error.
    Raises InputError as `checked_digits` does, Shortfall where the first Lyapunov coefficient vanishes, or nearly so.
    """
    parameters.refuse_smooth("the Hopf point's normal form is")
    checked_digits(digits)
    kind = criticality(parameters)
    if kind == "degenerate":
        raise Shortfall("the first Lyapunov coefficient vanishes exactly: the amplitude law has no first-order slope")
    working = bits_for_digits(digits + 15)
    rough, sharp = normal_form(parameters, working), normal_form(parameters, working + 66)
    measured = {
        name: Measured.compared(value, sharp[name], Fraction(1, 2 ** (working - 1))) for name, value in rough.items()
    }
    for name, value in measured.items():
        if value.uncertainty > abs(value.value) * Fraction(1, 10**digits):
            raise Shortfall(f"{name} loses more than 15 digits to cancellation: ask for more digits")
    return HopfPoint(criticality=kind, **measured)


def normal_form(parameters: Parameters, working_bits: int) -> dict[str, Any]:
    """The numbers of `HopfPoint` in an arithmetic of ``working_bits``, as mpmath numbers.

    Kuznetsov, Elements of Applied Bifurcation Theory, Eq. (5.39) without its quadratic terms, which the point symmetry
    removes: c_1 = <p, C(q, q, qbar)> / 2 and l_1 = Re c_1 / omega, with A q = i omega q, A^T p = -i omega p,
    <q, q> = <p, q> = 1. On the centre manifold z' = lambda(Omega) z + c_1 z |z|^2 and x = z q + conj(z q), so
    |z|^2 = -Re lambda / Re c_1 and beta_max = 2 |z| |q_1| to leading order.
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
        return sum(value * _trilinear(powers, right, ctx) for powers, value in coefficients.items())

    acceleration = cubic(cubic_acceleration(derived(constants, speed)))
    kinematic = cubic({(3, 0, 0): -speed / 6})  # gamma_bar' = Omega sin(beta_bar)
    coefficient = (left[1] * kinematic + left[2] * acceleration) / 2
    # d(lambda)/d(Omega) = <p, dA/dOmega q>: dA/dOmega has the entries 1, -2 Omega and A32 / Omega.
    drift = left[1] * right[0] + left[2] * (-2 * speed * right[0] + a32 / speed * right[1])
    growth = drift.real / coefficient.real  # |z|^2 per unit of Omega_crit - Omega
    return {
        "omega_crit": speed,
        "period": 2 * ctx.pi / frequency,
        "first_lyapunov_coefficient": coefficient.real / frequency,
        "transversality": drift.real,
        "amplitude_squared_slope": 4 * abs(right[0]) ** 2 * growth,
        "period_slope": -2 * ctx.pi / frequency**2 * (coefficient.imag * growth - drift.imag),
    }


def _trilinear(powers: tuple[int, int, int], q: list[Any], ctx: Any) -> Any:
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
