"""The Hopf point of inverted spinning: where it is, how fast it is crossed, and which cycles are born there.

With a = gamma_bar_0, the largest gamma - pi/2 on a cycle, the family that is born at the Hopf point has

    Omega = Omega_crit + c_1 a^2 + c_2 a^4 + O(a^6)

and c_1 / Omega_crit, c_2 / Omega_crit are rational functions of four ratios:

    W = e / (r + e), the square of the cycle's frequency over Omega_crit      alpha = A / Bbar
    M = m (r + e)^2 / Bbar                                                    f = |A33| / Omega_crit (friction)

They come from the invariance equation x(w, wbar), w' = i nu(|w|^2) w, Omega(|w|^2) with harmonics 1 and 3: the third
harmonic of order a^3 is where friction enters. Tests solve the invariance equation of the full equations as well.

All formulas hold for the linear friction law; the smooth law has the same linear part, but its field is only once
continuously differentiable, so it has no first Lyapunov coefficient.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import Literal, NamedTuple

from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.exact import PI, exact
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import bits_for_digits, checked_digits
from tippedisk_verify.model.results import Printable, quantity
from tippedisk_verify.model.surroundings import undisturbed
from tippedisk_verify.theory.real_roots import square_root

__all__ = [
    "AmplitudeLaw",
    "HopfPoint",
    "amplitude_law",
    "critical_frequency_squared",
    "criticality",
    "frequency_ratio_squared",
    "hopf_point",
    "normal_form",
    "omega_crit",
    "omega_crit_squared",
    "period_crit",
    "period_of",
    "speed_below_crit",
]

Criticality = Literal["supercritical", "subcritical", "degenerate"]


@dataclass(frozen=True, repr=False)
class HopfPoint(Printable):
    """Everything local about the Hopf point, to the digits asked for."""

    omega_crit: Measured = field(
        metadata=quantity("where inverted spinning loses its stability, Eq. approx_omega_crit", "rad/s")
    )
    period: Measured = field(metadata=quantity("limit of the cycle's period at Omega_crit", "s"))
    first_lyapunov_coefficient: Measured = field(
        metadata=quantity("Kuznetsov's l_1, eigenvector of length 1 in (beta, gamma, v)", "SI")
    )
    criticality: Criticality  #: of the first Lyapunov coefficient's sign, decided exactly
    transversality: Measured = field(metadata=quantity("d(Re lambda)/dOmega of the critical pair", "1/rad"))
    quadratic_coefficient: Measured = field(
        metadata=quantity("c_1 of Omega = Omega_crit + c_1 a^2 + c_2 a^4, a = gamma_bar_0", "1/(rad s)")
    )
    quartic_coefficient: Measured = field(metadata=quantity("c_2 of that", "1/(rad^3 s)"))
    second_lyapunov_coefficient: Measured | None = field(
        default=None, metadata=quantity("Kuznetsov's l_2, likewise, where l_1 = 0", "SI")
    )
    amplitude_squared_slope: Measured | None = field(
        default=None, metadata=quantity("limit of beta_max^2 / (Omega_crit - Omega), if l_1 != 0", "rad s")
    )
    period_slope: Measured | None = field(
        default=None, metadata=quantity("limit of (T - T_crit) / (Omega_crit - Omega), if l_1 != 0", "s^2/rad")
    )

    def slopes(self) -> tuple[Measured, Measured]:
        """`amplitude_squared_slope` and `period_slope`. Raises AccuracyError where l_1 = 0."""
        if self.amplitude_squared_slope is None or self.period_slope is None:
            raise AccuracyError("the first Lyapunov coefficient vanishes exactly: amplitude and period have no slopes")
        return self.amplitude_squared_slope, self.period_slope


class AmplitudeLaw(NamedTuple):
    """The law's coefficients over Omega_crit, exactly."""

    quadratic: Fraction  #: c_1 / Omega_crit [1/rad^2]; friction does not enter
    quartic: Fraction  #: c_2 / Omega_crit [1/rad^4]


def frequency_ratio_squared(parameters: Parameters) -> Fraction:
    """W, exactly."""
    return parameters.e / (parameters.r + parameters.e)


def _friction_ratio_squared(parameters: Parameters) -> Fraction:
    """f^2, exactly."""
    c = parameters.rational()
    return Fraction(c.k**2 * (c.r + c.e) ** 2 * c.r / (c.b * c.g))


def amplitude_law(parameters: Parameters) -> AmplitudeLaw:
    """c_1 = -(Omega_crit / 8) delta, where delta = A (r - 2 e) / (Bbar r) - (2 r - e) / (2 (r + e)); c_2 as below."""
    p = parameters
    W, alpha, mass = frequency_ratio_squared(p), p.A / p.Bbar, p.m * (p.r + p.e) ** 2 / p.Bbar
    lift = alpha * (1 - 3 * W) / (1 - W)
    delta = lift - 1 + 3 * W / 2
    third = _friction_ratio_squared(p) + 9 * W  # |A33 - 3 i omega|^2 / Omega_crit^2
    quartic = (
        3 * lift**2 / 128
        - alpha * (19 - 54 * W + 39 * W**2) / (768 * (1 - W))
        + (2 + 57 * W - 6 * W**2) / 1536
        - (2 * W + delta) * (2 + 55 * W + 7 * W**2 - 2 * alpha * (1 + 13 * W) + 64 * mass * W**2) / (256 * third)
    )
    return AmplitudeLaw(quadratic=Fraction(-delta / 8), quartic=Fraction(quartic))


def omega_crit_squared(parameters: Parameters) -> Fraction:
    """Omega_crit^2 = (r + e)^2 m g / (r Bbar) [rad^2/s^2], exactly (Eq. approx_omega_crit).

    Where Routh-Hurwitz has a2 a1 = a0; mu and epsilon cancel.
    """
    constants = parameters.rational()
    return Fraction((constants.r + constants.e) ** 2 * constants.g / (constants.r * constants.b))


def critical_frequency_squared(parameters: Parameters) -> Fraction:
    """omega^2 = e Omega_crit^2 / (r + e) [rad^2/s^2] of the imaginary pair (Eq. omega_sol_C2)."""
    return frequency_ratio_squared(parameters) * omega_crit_squared(parameters)


def criticality(parameters: Parameters) -> Criticality:
    """On which side of Omega_crit the cycles are, by the exact sign of c_1; friction does not enter.

    Supercritical where A (r - 2 e) > Bbar r (2 r - e) / (2 (r + e)): equal to chi Omega_crit^2 + m g e (r + e) > 0 with
    the consistent chi.
    """
    quadratic = amplitude_law(parameters).quadratic
    if not quadratic:
        return "degenerate"
    return "supercritical" if quadratic < 0 else "subcritical"


@undisturbed
def omega_crit(parameters: Parameters, digits: int = 15) -> Measured:
    """The critical spinning speed [rad/s] to ``digits`` significant digits. Raises InputError as `checked_digits`."""
    return square_root(omega_crit_squared(parameters), checked_digits(digits) + 5)


def speed_below_crit(parameters: Parameters, distance: object, digits: int) -> Fraction:
    """The decimal speed [rad/s] that lies ``distance`` [rad/s] below Omega_crit.

    Raises InputError for a distance that is no decimal, or leaves no speed.
    """
    below = exact(distance)
    if below.pi_multiple:
        raise InputError("the distance below Omega_crit must be a decimal")
    # With 30 digits more the rounding of Omega_crit stays far below every half-width.
    crit = square_root(omega_crit_squared(parameters), checked_digits(digits) + 35)
    return checked_speed(Fraction(crit.decimals()[0]) - below.rational)


@undisturbed
def period_crit(parameters: Parameters, digits: int = 15) -> Measured:
    """The period 2 pi / omega [s] of the cycle at its birth, to ``digits`` significant digits.

    Raises InputError as `checked_digits` does.
    """
    working = checked_digits(digits) + 5
    return period_of(square_root(critical_frequency_squared(parameters), working), working)


def period_of(frequency: Measured, digits: int) -> Measured:
    """2 pi / ``frequency``, with pi to so many digits."""
    low, high = PI.enclosed(bits_for_digits(digits))
    return Measured(low + high, high - low) / frequency


@undisturbed
def hopf_point(parameters: Parameters, digits: int = 12) -> HopfPoint:
    """The Hopf point to ``digits`` significant digits.

    Where l_1 = 0, at a generalized Hopf point, there is l_2 instead of the two slopes. Raises InputError as
    `checked_digits` does, and under the smooth law.
    """
    parameters.refuse_smooth("the Hopf point's normal form is")
    law = amplitude_law(parameters)
    numbers = normal_form(parameters, checked_digits(digits) + 17, degenerate=not law.quadratic)
    coefficients = {f"{name}_coefficient": numbers["omega_crit"] * number for name, number in law._asdict().items()}
    return HopfPoint(criticality=criticality(parameters), **numbers, **coefficients)


def normal_form(parameters: Parameters, digits: int, *, degenerate: bool = False) -> dict[str, Measured]:
    """Numbers of `HopfPoint`, from square roots and pi to so many digits.

    On the centre manifold x = z q + conj(z q) + ... and z' = lambda(Omega) z + c_1 z |z|^2 + c_2 z |z|^4, with A q =
    i omega q and <q, q> = 1, so q = (i omega, Omega, -omega^2) / |...| (Kuznetsov, Elements of Applied Bifurcation
    Theory, Sections 5.4 and 8.3). On a cycle Re lambda + Re c_1 |z|^2 = 0 to leading order, and its amplitude is
    a = 2 |z| |q_2|: so the amplitude law gives l_1 = Re c_1 / omega. Implicit differentiation of the characteristic
    polynomial gives d(Re lambda)/d(Omega) = -f (1 - W) / (f^2 + W), with the ratios of `amplitude_law`.

    ``degenerate`` takes l_1 as zero. Then Re lambda + Re c_2 |z|^4 = 0 gives l_2 = Re c_2 / omega, and there are no
    slopes.
    """
    law, square = amplitude_law(parameters), omega_crit_squared(parameters)
    ratio, friction_squared = frequency_ratio_squared(parameters), _friction_ratio_squared(parameters)
    speed, root, friction = (square_root(number, digits) for number in (square, ratio, friction_squared))
    drift = -friction * ((1 - ratio) / (friction_squared + ratio))
    share = 4 / (1 + ratio + ratio**2 * square)  # (2 |q_2|)^2
    numbers = {"omega_crit": speed, "period": period_of(speed * root, digits), "transversality": drift}
    if degenerate:
        second = -drift * (share**2 * law.quartic) / root
        return numbers | {"first_lyapunov_coefficient": Measured.of(0, 0), "second_lyapunov_coefficient": second}
    return numbers | {
        "first_lyapunov_coefficient": -drift * (share * law.quadratic) / root,
        # beta_bar' = v and gamma_bar' = Omega beta_bar: beta_max^2 = W a^2.
        "amplitude_squared_slope": -ratio / law.quadratic / speed,
        # (2 pi / T)^2 = W Omega^2 (1 - (1 - W) a^2 / 8 + O(a^4)).
        "period_slope": period_of(root, digits) * ((1 - (1 - ratio) / (16 * law.quadratic)) / square),
    }
