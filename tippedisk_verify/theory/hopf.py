"""The Hopf point of inverted spinning: its speed, its crossing, and the cycles born there.

**The family.** With a = gamma_bar_0, the largest gamma - pi/2 on a cycle, the family that is born
at the Hopf point has

    Omega = Omega_crit + c_1 a^2 + c_2 a^4 + O(a^6).

**The ratios.** c_1 / Omega_crit and c_2 / Omega_crit are rational functions of four ratios:

    W = e / (r + e)
    alpha = A / Bbar
    M = m (r + e)^2 / Bbar
    f = |A33| / Omega_crit.

W is the square of the ratio of the cycle's frequency to Omega_crit, and f measures friction.

**The derivation.** The coefficients come from the invariance equation for

    x(w, wbar),    w' = i nu(|w|^2) w,    Omega(|w|^2)

with harmonics 1 and 3. Friction enters through the third harmonic, of order a^3. Tests solve the
invariance equation of the full equations as well.

**The friction law.** All formulas hold for every law that is analytic at gamma_y = 0, and depend on
it only through its slope there. On the critical mode omega^2 = W Omega^2 = e Omega^2 / (r + e), so

    gamma_y = (r + e) v + e Omega gamma_bar

vanishes to first order. By the point symmetry it is of order a^3 on a cycle, and a cubic term of
the law is of order a^9. This is also why Omega_crit does not depend on friction. Under a law with
two sides the field is only once continuously differentiable, so it has no first Lyapunov
coefficient.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache
from typing import Literal, NamedTuple

from tippedisk_verify.display import Printable, quantity
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.parameters import SYMBOLS, Parameters
from tippedisk_verify.numbers.decimals import decimal_magnitude
from tippedisk_verify.numbers.exact import PI, exact
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.numpy_errors import ignore_numpy_errors
from tippedisk_verify.numbers.precision import bits_for_digits, checked_digits
from tippedisk_verify.theory.real_roots import square_root

__all__ = [
    "AmplitudeLaw",
    "HopfPoint",
    "amplitude_law",
    "critical_frequency_squared",
    "criticality",
    "distance_below_crit",
    "frequency_ratio_squared",
    "hopf_point",
    "normal_form",
    "omega_crit",
    "omega_crit_derivatives",
    "omega_crit_squared",
    "period_crit",
    "period_of",
    "speed_below_crit",
]

Criticality = Literal["supercritical", "subcritical", "degenerate"]


@dataclass(frozen=True, repr=False)
class HopfPoint(Printable):
    """The Hopf point of inverted spinning and its local properties, to the requested digits."""

    omega_crit: Measured = field(
        metadata=quantity(
            "where inverted spinning loses its stability, Eq. approx_omega_crit", "rad/s"
        )
    )
    period: Measured = field(metadata=quantity("limit of the cycle's period at Omega_crit", "s"))
    first_lyapunov_coefficient: Measured = field(
        metadata=quantity("Kuznetsov's l_1, eigenvector of length 1 in (beta, gamma, v)", "SI")
    )
    criticality: Criticality  #: by the sign of the first Lyapunov coefficient, decided exactly
    transversality: Measured = field(
        metadata=quantity("d(Re lambda)/dOmega of the critical pair", "1/rad")
    )
    quadratic_coefficient: Measured = field(
        metadata=quantity(
            "c_1 of Omega = Omega_crit + c_1 a^2 + c_2 a^4, a = gamma_bar_0", "1/(rad s)"
        )
    )
    quartic_coefficient: Measured = field(
        metadata=quantity("c_2 of the same expansion", "1/(rad^3 s)")
    )
    second_lyapunov_coefficient: Measured | None = field(
        default=None, metadata=quantity("Kuznetsov's l_2, likewise, where l_1 = 0", "SI")
    )
    amplitude_squared_slope: Measured | None = field(
        default=None,
        metadata=quantity("limit of beta_max^2 / (Omega_crit - Omega), if l_1 != 0", "rad s"),
    )
    period_slope: Measured | None = field(
        default=None,
        metadata=quantity("limit of (T - T_crit) / (Omega_crit - Omega), if l_1 != 0", "s^2/rad"),
    )

    def slopes(self) -> tuple[Measured, Measured]:
        """Return the slopes of the squared amplitude and of the period with respect to Omega_crit -
        Omega.

        They are `amplitude_squared_slope` and `period_slope`.

        Raises:
            AccuracyError: If l_1 = 0, where there are no slopes.
        """
        if self.amplitude_squared_slope is None or self.period_slope is None:
            raise AccuracyError(
                "the first Lyapunov coefficient vanishes exactly: amplitude and "
                "period have no slopes"
            )
        return self.amplitude_squared_slope, self.period_slope


class AmplitudeLaw(NamedTuple):
    """The exact coefficients c_1 and c_2 of the amplitude law at the Hopf point, divided by
    Omega_crit.
    """

    quadratic: Fraction  #: c_1 / Omega_crit [1/rad^2]; friction does not enter
    quartic: Fraction  #: c_2 / Omega_crit [1/rad^4]


def frequency_ratio_squared(parameters: Parameters) -> Fraction:
    """Return W = (omega / Omega_crit)^2 = e / (r + e), exactly, where omega is the critical
    frequency.

    Args:
        parameters: The disk.
    """
    return parameters.e / (parameters.r + parameters.e)


def _friction_ratio_squared(parameters: Parameters) -> Fraction:
    """Return f^2 = (A33 / Omega_crit)^2, the squared friction ratio, exactly."""
    c = parameters.rational_constants()
    return Fraction(c.k**2 * (c.r + c.e) ** 2 * c.r / (c.b * c.g))


def amplitude_law(parameters: Parameters) -> AmplitudeLaw:
    """Return the coefficients of the amplitude law at the Hopf point, c_1 / Omega_crit and c_2 /
    Omega_crit, exactly.

    The first is -delta / 8 with

        delta = A (r - 2 e) / (Bbar r) - (2 r - e) / (2 (r + e)).

    The second is written out in the code.

    Args:
        parameters: The disk.
    """
    p = parameters
    W, alpha, mass = frequency_ratio_squared(p), p.A / p.Bbar, p.m * (p.r + p.e) ** 2 / p.Bbar
    lift = alpha * (1 - 3 * W) / (1 - W)
    delta = lift - 1 + 3 * W / 2
    third = _friction_ratio_squared(p) + 9 * W  # |A33 - 3 i omega|^2 / Omega_crit^2
    quartic = (
        3 * lift**2 / 128
        - alpha * (19 - 54 * W + 39 * W**2) / (768 * (1 - W))
        + (2 + 57 * W - 6 * W**2) / 1536
        - (2 * W + delta)
        * (2 + 55 * W + 7 * W**2 - 2 * alpha * (1 + 13 * W) + 64 * mass * W**2)
        / (256 * third)
    )
    return AmplitudeLaw(quadratic=Fraction(-delta / 8), quartic=Fraction(quartic))


def omega_crit_squared(parameters: Parameters) -> Fraction:
    """Return the square of the critical speed, Omega_crit^2 [rad^2/s^2], exactly (Eq.
    approx_omega_crit).

    It is (r + e)^2 m g / (r Bbar). There a2 a1 = a0 in the Routh-Hurwitz criterion, in which mu and
    epsilon cancel.

    Args:
        parameters: The disk.
    """
    constants = parameters.rational_constants()
    return Fraction((constants.r + constants.e) ** 2 * constants.g / (constants.r * constants.b))


def critical_frequency_squared(parameters: Parameters) -> Fraction:
    """Return the square of the critical pair's frequency [rad^2/s^2] (Eq. omega_sol_C2).

    It is omega^2 = e Omega_crit^2 / (r + e).

    Args:
        parameters: The disk.
    """
    return frequency_ratio_squared(parameters) * omega_crit_squared(parameters)


def criticality(parameters: Parameters) -> Criticality:
    """Return the kind of Hopf point, by the exact sign of c_1.

    Friction does not enter. The Hopf point is supercritical where

        A (r - 2 e) > Bbar r (2 r - e) / (2 (r + e)),

    which is equivalent to chi Omega_crit^2 + m g e (r + e) > 0 with the consistent chi.

    Args:
        parameters: The disk.
    """
    quadratic = amplitude_law(parameters).quadratic
    if not quadratic:
        return "degenerate"
    return "supercritical" if quadratic < 0 else "subcritical"


@ignore_numpy_errors()
def omega_crit(parameters: Parameters, digits: int = 15) -> Measured:
    """Return the critical spinning speed [rad/s] to ``digits`` significant digits.

    Args:
        parameters: The disk.
        digits: Significant digits, from 1 to 4000.

    Raises:
        InputError: If the number of digits cannot be used.
    """
    return square_root(omega_crit_squared(parameters), checked_digits(digits) + 5)


def omega_crit_derivatives(parameters: Parameters, digits: int = 15) -> dict[str, Measured]:
    """Return the derivatives of Omega_crit with respect to the disk's parameters [SI], by name.

    They are Omega_crit times half the derivative of log(Omega_crit^2), which is rational. Those
    with respect to A, mu and epsilon are zero.

    Args:
        parameters: The disk.
        digits: Significant digits, from 1 to 4000.

    Raises:
        InputError: If the number of digits cannot be used.
    """
    c, crit = parameters.rational_constants(), omega_crit(parameters, digits)
    logarithmic = {
        "r": 2 / (c.r + c.e) - 1 / c.r,
        "e": 2 / (c.r + c.e) + 2 * c.m * c.e / c.Bbar,
        "m": 1 / c.m + c.e**2 / c.Bbar,
        "B": -1 / c.Bbar,
        "g": 1 / c.g,
    }
    return {symbol: crit * (logarithmic.get(symbol, Fraction(0)) / 2) for symbol in SYMBOLS}


def distance_below_crit(parameters: Parameters, omega: Fraction) -> Fraction:
    """Return the distance Omega_crit - ``omega`` [rad/s] of a speed from the critical speed to 15
    digits, however small it is.

    Args:
        parameters: The disk.
        omega: The speed [rad/s].
    """
    square, crit = _critical_speed(parameters)
    return (square - omega**2) / (crit + omega)


@lru_cache(maxsize=64)
def _critical_speed(parameters: Parameters) -> tuple[Fraction, Fraction]:
    """Return Omega_crit^2 and Omega_crit [rad/s] to 20 digits.

    They are cached, because searches for cycles need them at every speed.
    """
    square = omega_crit_squared(parameters)
    return square, square_root(square, 20).value


def speed_below_crit(parameters: Parameters, distance: object, digits: int) -> Measured:
    """Return the speed Omega_crit - ``distance`` [rad/s] as a decimal with its half-width.

    The speed itself is irrational.

    Args:
        parameters: The disk.
        distance: The distance below Omega_crit [rad/s].
        digits: Significant digits of the distance.

    Raises:
        InputError: If the distance is not a decimal, or the result is not a speed.
    """
    below = exact(distance)
    if below.pi_multiple:
        raise InputError("the distance below Omega_crit must be a decimal")
    # The distance has 35 extra digits. The speed may differ from Omega_h or a fold only in the last
    # decimal of the distance; that difference has 35 extra digits too. So the half-width is far
    # below the effect of rounding on any number.
    places = decimal_magnitude(Fraction(below.rational.denominator))
    crit = square_root(omega_crit_squared(parameters), checked_digits(digits) + 35 + 2 * places)
    value, width = map(Fraction, crit.decimals())
    return Measured(checked_speed(value - below.rational), width)


@ignore_numpy_errors()
def period_crit(parameters: Parameters, digits: int = 15) -> Measured:
    """Return the period 2 pi / omega [s] of the limit cycle at its birth in the Hopf point, to
    ``digits`` digits.

    Args:
        parameters: The disk.
        digits: Significant digits, from 1 to 4000.

    Raises:
        InputError: If the number of digits cannot be used.
    """
    working = checked_digits(digits) + 5
    return period_of(square_root(critical_frequency_squared(parameters), working), working)


def period_of(frequency: Measured, digits: int) -> Measured:
    """Return the period 2 pi / ``frequency`` [s], with pi to ``digits`` digits.

    Args:
        frequency: The angular frequency [rad/s].
        digits: The digits of pi.
    """
    low, high = PI.bounds(bits_for_digits(digits))
    return Measured(low + high, high - low) / frequency


@ignore_numpy_errors()
def hopf_point(parameters: Parameters, digits: int = 12) -> HopfPoint:
    """Return the Hopf point to ``digits`` significant digits.

    At a generalized Hopf point, where l_1 = 0, the result contains l_2 instead of the two slopes.

    Args:
        parameters: The disk.
        digits: Significant digits, from 1 to 4000.

    Raises:
        InputError: If the number of digits cannot be used, or the friction law has two sides.
    """
    parameters.refuse_two_sided_law("the Hopf point's normal form is")
    law = amplitude_law(parameters)
    numbers = normal_form(parameters, checked_digits(digits) + 17, degenerate=not law.quadratic)
    coefficients = {
        f"{name}_coefficient": numbers["omega_crit"] * number
        for name, number in law._asdict().items()
    }
    return HopfPoint(criticality=criticality(parameters), **numbers, **coefficients)


def normal_form(
    parameters: Parameters, digits: int, *, degenerate: bool = False
) -> dict[str, Measured]:
    """Return the numbers of `HopfPoint`, from square roots and pi to ``digits`` digits.

    **Normal form.** On the centre manifold x = z q + conj(z q) + ... and

        z' = lambda(Omega) z + c_1 z |z|^2 + c_2 z |z|^4,

    with A q = i omega q and <q, q> = 1. So q = (i omega, Omega, -omega^2) / |...|. The source is
    Kuznetsov, Elements of Applied Bifurcation Theory, Sections 5.4 and 8.3.

    **First coefficient.** On a cycle Re lambda + Re c_1 |z|^2 = 0 to leading order, and its
    amplitude is a = 2 |z| |q_2|. So the amplitude law gives l_1 = Re c_1 / omega.

    **Transversality.** Implicit differentiation of the characteristic polynomial gives

        d(Re lambda)/d(Omega) = -f (1 - W) / (f^2 + W),

    with the ratios of the module.

    **Degenerate case.** If l_1 is zero, Re lambda + Re c_2 |z|^4 = 0 gives l_2 = Re c_2 / omega,
    and there are no slopes.

    Args:
        parameters: The disk.
        digits: The digits of the square roots and of pi.
        degenerate: True takes l_1 as zero.
    """
    law, square = amplitude_law(parameters), omega_crit_squared(parameters)
    ratio, friction_squared = (
        frequency_ratio_squared(parameters),
        _friction_ratio_squared(parameters),
    )
    speed, root, friction = (
        square_root(number, digits) for number in (square, ratio, friction_squared)
    )
    drift = -friction * ((1 - ratio) / (friction_squared + ratio))
    share = 4 / (1 + ratio + ratio**2 * square)  # (2 |q_2|)^2
    numbers = {
        "omega_crit": speed,
        "period": period_of(speed * root, digits),
        "transversality": drift,
    }
    if degenerate:
        second = -drift * (share**2 * law.quartic) / root
        return numbers | {
            "first_lyapunov_coefficient": Measured.of(0, 0),
            "second_lyapunov_coefficient": second,
        }
    return numbers | {
        "first_lyapunov_coefficient": -drift * (share * law.quadratic) / root,
        # beta_bar' = v and gamma_bar' = Omega beta_bar: beta_max^2 = W a^2.
        "amplitude_squared_slope": -ratio / law.quadratic / speed,
        # (2 pi / T)^2 = W Omega^2 (1 - (1 - W) a^2 / 8 + O(a^4)).
        "period_slope": period_of(root, digits)
        * ((1 - (1 - ratio) / (16 * law.quadratic)) / square),
    }
