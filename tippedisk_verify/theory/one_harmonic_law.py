"""The paper's one-harmonic law at the Hopf point, as printed and made consistent.

Two differences separate the forms:

- The paper prints kappa_1 with the wrong sign of 2 m e (r + e), though its chi comes from the right
  sign.
- It drops the cubic term of gamma_bar' = Omega sin(beta_bar), which is of the same order as the
  terms that it keeps. With that term the law has the true slopes at the Hopf point.

C is the amplitude of beta_bar [rad], omega the angular frequency of the cycle [rad/s].
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, get_args

from tippedisk_verify.display import Printable
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.exact import is_one_of, short_text
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.numpy_errors import ignore_numpy_errors
from tippedisk_verify.numbers.precision import checked_digits
from tippedisk_verify.theory.hopf import frequency_ratio_squared, omega_crit_squared, period_of
from tippedisk_verify.theory.real_roots import square_root

__all__ = [
    "Form",
    "OneHarmonic",
    "amplitude_and_frequency_squared",
    "chi",
    "delta",
    "hopf_slopes",
    "kappa_1",
    "kappa_2",
    "one_harmonic",
    "section_crossing",
]

Form = Literal["printed", "consistent"]


@dataclass(frozen=True, repr=False)
class OneHarmonic(Printable):
    """A limit cycle at one speed by harmonic balance with one harmonic."""

    amplitude: Measured  #: C [rad], Eq. Csol
    frequency: Measured  #: omega [rad/s], Eq. omega_sol
    period: Measured  #: T = 2 pi / omega [s]


def kappa_1(constants: Any, omega: Any, frequency_squared: Any, form: Form) -> Any:
    """Return kappa_1 [N m], the cubic part of the one-harmonic law's sine balance (Eq. sin_balance
    and below).

    Args:
        constants: The parameters, in any kind of number.
        omega: The spinning speed [rad/s].
        frequency_squared: The square of the cycle's frequency [rad^2/s^2].
        form: ``printed`` or ``consistent``.
    """
    r, e, m, g, A, Bbar = (
        constants.r,
        constants.e,
        constants.m,
        constants.g,
        constants.A,
        constants.Bbar,
    )
    height = r + e
    sign = -1 if form == "printed" else 1
    return (
        (Bbar - 3 * A + sign * 2 * m * e * height) * omega**2 / 4
        - m * height**2 * frequency_squared / 2
        + m * g * e * omega**2 / frequency_squared / 8
        - (Bbar - A) * omega**4 / frequency_squared / 4
        + m * g * height / 8
    )


def kappa_2(constants: Any, omega: Any, frequency_squared: Any, form: Form) -> Any:
    """Return kappa_2 [m^2/s^2], the cubic part of the one-harmonic law's cosine balance (Eq.
    kappa2).

    Args:
        constants, omega, frequency_squared, form: As for `kappa_1`.
    """
    r, e = constants.r, constants.e
    value = (
        -e * (r + 4 * e) * omega**4 / frequency_squared / 2
        + 3 * e * (r + e) * omega**2 / 2
        + (r + e) ** 2 * frequency_squared
    )
    return value if form == "printed" else value - e * (r + e) * omega**2 / 2


def delta(constants: Any, omega: Any, form: Form) -> Any:
    """Return delta [rad^2/s^2], the factor of C^2 in the law omega^2 = e Omega^2 / (r + e) + delta
    C^2.

    It is defined by Eqs. omega_sol_C4 and delta.

    Args:
        constants, omega, form: As for `kappa_1`.
    """
    r, e = constants.r, constants.e
    return -((r - e) if form == "printed" else r) * omega**2 / (8 * (r + e))


def chi(constants: Any, form: Form) -> Any:
    """Return chi [kg m^3], the constant of the amplitude law (below Eq. Csol).

    Args:
        constants, form: As for `kappa_1`.
    """
    r, e, A, Bbar = constants.r, constants.e, constants.A, constants.Bbar
    value = A * (r - 2 * e) - Bbar * (2 * r**2 + e * (r + e)) / (2 * (r + e))
    return value if form == "printed" else value + Bbar * e**2 / (2 * (r + e))


def _checked_form(form: str) -> Form:
    forms: tuple[Form, ...] = get_args(Form)
    if not is_one_of(form, forms):
        raise InputError(f"form '{short_text(form)}' is not known: use printed or consistent")
    return form


def amplitude_and_frequency_squared(constants: Any, omega: Any, form: Form) -> tuple[Any, Any]:
    """Return the squares of amplitude and frequency of the one-harmonic cycle: C^2 [rad^2] and
    omega^2 [rad^2/s^2] (Eqs. Csol, omega_sol).

    The law has a cycle where both are positive.

    Args:
        constants, omega, form: As for `kappa_1`.
    """
    r, e, m, g, Bbar = constants.r, constants.e, constants.m, constants.g, constants.Bbar
    excess = Bbar * r * omega**2 - m * g * (r + e) ** 2
    square = -4 * e / (r + e) * excess / _denominator(constants, omega**2, form)
    return square, e / (r + e) * omega**2 + delta(constants, omega, form) * square


def _denominator(constants: Any, omega_squared: Any, form: Form) -> Any:
    """Return the denominator of the one-harmonic law's squared amplitude, chi Omega^2 + m g e (r +
    e) [kg m^3/s^2] (Eq. Csol).

    Its zero is a pole of the law.
    """
    r, e, m, g = constants.r, constants.e, constants.m, constants.g
    return chi(constants, form) * omega_squared + m * g * e * (r + e)


def section_crossing(constants: Any, omega: float) -> tuple[float, float, float] | None:
    """Return the point where the cycle of the consistent one-harmonic law crosses the section beta
    = pi/2, v < 0, and half its period, in double.

    The result is None where the law has no cycle.

    Args:
        constants: The parameters in double.
        omega: The spinning speed [rad/s].

    Returns:
        gamma_bar [rad], v [rad/s] and half the period [s].
    """
    squared = amplitude_and_frequency_squared(constants, omega, "consistent")
    if not min(squared) > 0:
        return None
    amplitude, frequency = map(math.sqrt, squared)
    # gamma' = Omega sin(beta_bar) for a cosine of this amplitude.
    return omega * amplitude / frequency, -amplitude * frequency, math.pi / frequency


@ignore_numpy_errors()
def one_harmonic(
    parameters: Parameters, omega: object, form: Form = "printed", digits: int = 12
) -> OneHarmonic:
    """Return amplitude, frequency and period of the one-harmonic cycle at a speed, by the closed
    law.

    Args:
        parameters: The disk.
        omega: The spinning speed [rad/s].
        form: ``printed`` or ``consistent``.
        digits: Significant digits of each number.

    Raises:
        InputError: If an argument cannot be used, or the disk has the smooth friction law.
        AccuracyError: If the formula has no real amplitude or frequency.
    """
    parameters.refuse_unless_linear("harmonic balance is")
    form, omega = _checked_form(form), checked_speed(omega)
    digits = checked_digits(digits)
    constants = parameters.rational_constants()
    if not _denominator(constants, omega**2, form):
        raise AccuracyError(f"the one-harmonic law has a pole at Omega = {float(omega):.12g} rad/s")
    square, frequency_squared = amplitude_and_frequency_squared(constants, omega, form)
    if square < 0 or frequency_squared <= 0:
        raise AccuracyError(
            f"the one-harmonic law has no cycle at Omega = {float(omega):.12g} rad/s"
        )
    frequency = square_root(frequency_squared, digits + 5)
    amplitude = square_root(square, digits + 5) if square else Measured.of(0, 0)
    return OneHarmonic(amplitude, frequency, period_of(frequency, digits + 5))


def hopf_slopes(
    parameters: Parameters, form: Form = "consistent", digits: int = 12
) -> tuple[Measured, Measured]:
    """Return the slopes of the one-harmonic law's amplitude and period at the Hopf point with
    respect to Omega_crit - Omega.

    Args:
        parameters: The disk.
        form: ``printed`` or ``consistent``.
        digits: Significant digits of each slope.

    Returns:
        The slopes of C^2 [rad s] and of T - T_crit [s^2/rad].

    Raises:
        InputError: If an argument cannot be used, or the disk has the smooth friction law.
        AccuracyError: If the amplitude law's denominator vanishes at Omega_crit.
    """
    parameters.refuse_unless_linear("harmonic balance is")
    form, square, ratio = (
        _checked_form(form),
        omega_crit_squared(parameters),
        frequency_ratio_squared(parameters),
    )
    denominator = _denominator(parameters.rational_constants(), square, form)
    if not denominator:
        raise AccuracyError("the amplitude law's denominator vanishes at Omega_crit")
    working = checked_digits(digits) + 17
    # d(C^2)/d(-Omega) / Omega_crit
    growth = 8 * ratio * parameters.Bbar * parameters.r / denominator
    # T = 2 pi / omega with omega^2 = W Omega^2 + delta C^2.
    stretch = (1 - delta(parameters, 1, form) * growth * square / ratio / 2) / square
    return growth * square_root(square, working), period_of(
        square_root(ratio, working), working
    ) * stretch
