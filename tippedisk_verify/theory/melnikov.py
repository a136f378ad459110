"""The limit epsilon -> 0 of limit cycles and of Omega_h, by a Melnikov integral.

On the critical manifold rolling conserves the height of the centre of gravity, H = (r + e sin(gamma)) sin(beta), and
every level of H is closed (or connects the saddles). At order epsilon the height changes at the rate
epsilon (r + e sin(gamma)) cos(beta) h_1, so a level survives as a limit cycle at the speed at which

    M = integral of (r + e sin(gamma)) h_1 d(gamma) over half a turn

vanishes; gamma' = -Omega cos(beta) has turned time into gamma. On a level h_1 is a multiple of Omega^2 plus a multiple
of g, so the speed follows from two quadratures. It does not depend on mu.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.model.exact import exact, fraction, quotient, shown
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Constants, Parameters
from tippedisk_verify.model.precision import bits, bits_for_digits, checked_digits
from tippedisk_verify.theory.slow_manifold import first_correction

__all__ = ["limit_period", "limit_speed"]

_MOST_DIGITS = 200


def limit_speed(parameters: Parameters, gamma_bar_0: object = None, digits: int = 12) -> Measured:
    """Omega [rad/s] of the limit cycle with largest |gamma - pi/2| = ``gamma_bar_0`` [rad] as epsilon -> 0.

    Without ``gamma_bar_0`` the limit of Omega_h; towards 0 it is Omega_crit. Raises InputError outside (0, pi) or
    beyond 200 digits, Shortfall if no speed makes the integral vanish.
    """
    parameters.refuse_smooth("the Melnikov integral is")
    _checked(digits)
    rough, sharp = (_speed(parameters, gamma_bar_0, working) for working in _working(digits))
    return _measured(rough, sharp, digits)


def limit_period(parameters: Parameters, gamma_bar_0: object, digits: int = 12) -> Measured:
    """T [s] of that limit cycle, from gamma' = -Omega cos(beta) on its level. Raises as `limit_speed` does."""
    parameters.refuse_smooth("the Melnikov integral is")
    _checked(digits)
    periods = []
    for working in _working(digits):
        ctx, constants, largest = _prepared(parameters, gamma_bar_0, working)
        omega = _speed(parameters, gamma_bar_0, working)

        def slowness(x: Any, ctx: Any = ctx, constants: Constants = constants, largest: Any = largest) -> Any:
            _, cosine, weight = _on_level(ctx, constants, largest, x)
            return -weight / cosine

        periods.append(2 * ctx.quad(slowness, [-ctx.pi / 2, 0, ctx.pi / 2]) / omega)
    return _measured(periods[0], periods[1], digits)


def _measured(rough: Any, sharp: Any, digits: int) -> Measured:
    measured = Measured.compared(fraction(rough), fraction(sharp), Fraction(2) ** (1 - _working(digits)[0]))
    if measured.uncertainty > abs(measured.value) / 10**digits:
        raise Shortfall("the quadrature of the Melnikov integral has not converged: ask for fewer digits")
    return measured


def _working(digits: int) -> tuple[int, int]:
    """Bits to compute in, and to see the error."""
    return bits_for_digits(digits) + 40, bits_for_digits(digits) + 90


def _checked(digits: int) -> None:
    if checked_digits(digits) > _MOST_DIGITS:
        raise InputError(f"the Melnikov integral is offered to {_MOST_DIGITS} digits, not {digits}")


def _prepared(parameters: Parameters, gamma_bar_0: object, working: int) -> tuple[Any, Constants, Any]:
    ctx = bits(working).context
    constants = parameters.within(ctx)
    if gamma_bar_0 is None:
        return ctx, constants, ctx.pi
    value = exact(gamma_bar_0)
    if value.pi_multiple or not 0 < value.rational < Fraction("3.14159265358979"):
        raise InputError(f"gamma_bar_0 must lie between 0 and pi, not {shown(gamma_bar_0)}")
    return ctx, constants, quotient(ctx, value.rational)


def _on_level(ctx: Any, constants: Constants, largest: Any, x: Any) -> tuple[Any, Any, Any]:
    """(gamma_bar, cos(beta), d(gamma_bar)/dx) on the half with cos(beta) < 0, where gamma rises.

    gamma_bar = gamma_bar_0 sin(x) takes the square root out of the ends. With rho = r + e cos(gamma_bar) and c its
    value at the ends, cos^2(beta) = (rho - c)(rho + c) / rho^2, and rho - c is a product of two sines: no cancellation.
    """
    gamma_bar = largest * ctx.sin(x)
    rho = constants.r + constants.e * ctx.cos(gamma_bar)
    end = constants.r + constants.e * ctx.cos(largest)
    # largest - gamma_bar, without cancellation at x = pi/2; the other end mirrors it.
    short = 2 * largest * ctx.sin((ctx.pi / 2 - x) / 2) ** 2
    far = 2 * largest * ctx.sin((ctx.pi / 2 + x) / 2) ** 2
    above = 2 * constants.e * ctx.sin(far / 2) * ctx.sin(short / 2)
    cosine = -ctx.sqrt(abs(above) * (rho + end)) / rho  # rounding may leave a tiny negative product at the very ends
    return gamma_bar, cosine, largest * ctx.cos(x)


class _OnLevel:
    """sin and cos of beta and gamma from their values on the level, for formulas that ask for them by angle."""

    def __init__(self, beta: tuple[Any, Any], gamma: tuple[Any, Any]) -> None:
        self._pairs = {"beta": beta, "gamma": gamma}

    def sin(self, angle: str) -> Any:
        return self._pairs[angle][0]

    def cos(self, angle: str) -> Any:
        return self._pairs[angle][1]


def _speed(parameters: Parameters, gamma_bar_0: object, working: int) -> Any:
    ctx, constants, largest = _prepared(parameters, gamma_bar_0, working)

    def integral(omega: Any) -> Any:
        def integrand(x: Any) -> Any:
            gamma_bar, cosine, weight = _on_level(ctx, constants, largest, x)
            sine = (constants.r + constants.e * ctx.cos(largest)) / (constants.r + constants.e * ctx.cos(gamma_bar))
            ops = _OnLevel((sine, cosine), (ctx.cos(gamma_bar), -ctx.sin(gamma_bar)))
            rho = constants.r + constants.e * ctx.cos(gamma_bar)
            return rho * first_correction(ops, constants, omega, "beta", "gamma") * weight

        return ctx.quad(integrand, [-ctx.pi / 2, 0, ctx.pi / 2])

    # M = I_1 Omega^2 + I_0: two speeds give both.
    one, two = integral(ctx.one), integral(2 * ctx.one)
    inertial = (two - one) / 3
    square = -(one - inertial) / inertial
    if not square > 0:
        raise Shortfall("no speed makes the Melnikov integral vanish for these parameters")
    return ctx.sqrt(square)
