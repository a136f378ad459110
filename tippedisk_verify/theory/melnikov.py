"""The limit epsilon -> 0 of limit cycles and of Omega_h, by a Melnikov integral.

On the critical manifold rolling conserves the height of the centre of gravity, H = (r + e sin(gamma)) sin(beta), and
every level of H is closed (or connects the saddles). At order epsilon the height changes at the rate
epsilon (r + e sin(gamma)) cos(beta) h_1, so a level survives as a limit cycle at the speed at which

    M = integral of (r + e sin(gamma)) h_1 d(gamma) over half a turn

vanishes; gamma' = -Omega cos(beta) has turned time into gamma. On a level h_1 is a multiple of Omega^2 plus a multiple
of g, so the speed follows from two quadratures. It does not depend on mu.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.model.exact import exact, quotient, shown
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import bits, bits_for_digits, checked_digits
from tippedisk_verify.theory.slow_manifold import first_correction

__all__ = ["limit_period", "limit_speed"]

_MOST_DIGITS = 200


def limit_speed(parameters: Parameters, gamma_bar_0: object = None, digits: int = 12) -> Measured:
    """Omega [rad/s] of the limit cycle whose largest abs(gamma - pi/2) is ``gamma_bar_0`` [rad], as epsilon -> 0.

    Without ``gamma_bar_0`` the limit of Omega_h; towards 0 it is Omega_crit. Raises InputError outside (0, pi) or
    beyond 200 digits, AccuracyError if no speed makes the integral vanish.
    """
    return _in_two_precisions(_Level.speed, parameters, gamma_bar_0, digits)


def limit_period(parameters: Parameters, gamma_bar_0: object, digits: int = 12) -> Measured:
    """T [s] of that limit cycle, from gamma' = -Omega cos(beta) on its level. Raises as `limit_speed` does."""
    return _in_two_precisions(_Level.period, parameters, gamma_bar_0, digits)


def _in_two_precisions(
    quantity: Callable[[_Level], Any], parameters: Parameters, gamma_bar_0: object, digits: int
) -> Measured:
    """A quantity of the level; the second precision shows the error of the first."""
    parameters.refuse_smooth("the Melnikov integral is")
    if checked_digits(digits) > _MOST_DIGITS:
        raise InputError(f"the Melnikov integral is offered to {_MOST_DIGITS} digits, not {digits}")
    working = bits_for_digits(digits) + 40
    rough, sharp = (quantity(_Level(parameters, gamma_bar_0, bits(width).context)) for width in (working, working + 50))
    measured = Measured.compared(rough, sharp, Fraction(2) ** (1 - working))
    if measured.uncertainty > abs(measured.value) / 10**digits:
        raise AccuracyError("the quadrature of the Melnikov integral has not converged: ask for fewer digits")
    return measured


class _Level:
    """A level of H, on the half with cos(beta) < 0, where gamma rises, in an mpmath context.

    gamma_bar = gamma_bar_0 sin(x) takes the square root out of the ends. With rho = r + e cos(gamma_bar) and c its
    value at the ends, cos^2(beta) = (rho - c)(rho + c) / rho^2, and rho - c is a product of two sines: no cancellation.
    """

    def __init__(self, parameters: Parameters, gamma_bar_0: object, ctx: Any) -> None:
        self.ctx, self.constants, self.largest = ctx, parameters.within(ctx), ctx.pi
        if gamma_bar_0 is not None:
            size = exact(gamma_bar_0)
            if size.pi_multiple or not 0 < size.rational < Fraction("3.14159265358979"):
                raise InputError(f"gamma_bar_0 must lie between 0 and pi, not {shown(gamma_bar_0)}")
            self.largest = quotient(ctx, size.rational)

    def _integral(self, integrand: Callable[[Any, Any], Any]) -> Any:
        """Over half a turn of gamma, of a function of rho and a namespace with sines and cosines of the angles."""
        ctx, c, largest = self.ctx, self.constants, self.largest

        def by_x(x: Any) -> Any:
            gamma_bar = largest * ctx.sin(x)
            rho, end = (c.r + c.e * ctx.cos(angle) for angle in (gamma_bar, largest))
            # largest - gamma_bar and largest + gamma_bar, without cancellation at the ends.
            short, long = (2 * largest * ctx.sin((ctx.pi / 2 + side * x) / 2) ** 2 for side in (-1, 1))
            above = 2 * c.e * ctx.sin(long / 2) * ctx.sin(short / 2)
            cosine = -ctx.sqrt(abs(above) * (rho + end)) / rho  # rounding may leave a tiny negative product at the ends
            sines, cosines = (
                {"beta": end / rho, "gamma": ctx.cos(gamma_bar)},
                {"beta": cosine, "gamma": -ctx.sin(gamma_bar)},
            )
            angles = SimpleNamespace(sin=sines.__getitem__, cos=cosines.__getitem__)
            return integrand(rho, angles) * largest * ctx.cos(x)

        return ctx.quad(by_x, [-ctx.pi / 2, 0, ctx.pi / 2])

    def speed(self) -> Any:
        """Where M = I_1 Omega^2 + I_0 vanishes; the values at two speeds, as one complex number, give both."""
        ctx, constants = self.ctx, self.constants

        def integrand(rho: Any, angles: Any) -> Any:
            return rho * ctx.mpc(
                *(first_correction(angles, constants, omega, "beta", "gamma") for omega in (ctx.one, 2 * ctx.one))
            )

        total = self._integral(integrand)
        square = 1 - 3 * total.real / (total.imag - total.real)
        if not square > 0:
            raise AccuracyError("no speed makes the Melnikov integral vanish for these parameters")
        return ctx.sqrt(square)

    def period(self) -> Any:
        """Of the cycle at that speed, by the symmetry of its halves."""
        return 2 * self._integral(lambda rho, angles: -1 / angles.cos("beta")) / self.speed()
