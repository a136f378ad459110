"""The Hopf point of inverted spinning."""

from __future__ import annotations

from fractions import Fraction

from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import bits, bits_for_digits

__all__ = ["critical_frequency_squared", "omega_crit", "omega_crit_squared", "period_crit"]


def omega_crit_squared(parameters: Parameters) -> Fraction:
    """Omega_crit^2 = (r + e)^2 m g / (r Bbar) [rad^2/s^2], exactly (Eq. approx_omega_crit).

    Where Routh-Hurwitz has a2 a1 = a0; mu and epsilon cancel.
    """
    constants = parameters.rational()
    return Fraction((constants.r + constants.e) ** 2 * constants.g / (constants.r * constants.b))


def critical_frequency_squared(parameters: Parameters) -> Fraction:
    """omega^2 = e Omega_crit^2 / (r + e) [rad^2/s^2] of the imaginary pair (Eq. omega_sol_C2)."""
    return parameters.e / (parameters.r + parameters.e) * omega_crit_squared(parameters)


def omega_crit(parameters: Parameters, digits: int = 15) -> Measured:
    """The critical spinning speed [rad/s] to ``digits`` significant digits."""
    return _from_root(omega_crit_squared(parameters), digits, lambda ctx, root: root)


def period_crit(parameters: Parameters, digits: int = 15) -> Measured:
    """The period 2 pi / omega [s] of the cycle at its birth, to ``digits`` significant digits."""
    return _from_root(critical_frequency_squared(parameters), digits, lambda ctx, root: 2 * ctx.pi / root)


def _from_root(square: Fraction, digits: int, function: object) -> Measured:
    ctx = bits(bits_for_digits(digits + 5)).context
    value = function(ctx, ctx.sqrt(ctx.mpf(square.numerator) / square.denominator))  # type: ignore[operator]
    # Five operations, each correctly rounded: 8 ulps hold them.
    return Measured.of(value, abs(value) * 8 * ctx.eps)
