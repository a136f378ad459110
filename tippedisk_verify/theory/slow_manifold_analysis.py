"""How good the slow manifold's truncated series are: residuals, their exponents in epsilon, and the best order."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.exact import exact, quotient, shown
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import bits, bits_for_digits, checked_digits
from tippedisk_verify.model.results import Printable
from tippedisk_verify.theory.slow_manifold import POINTS, Expansion, checked_order, reduced_omega_crit

__all__ = ["SlowManifold", "analyse_slow_manifold"]

_LARGEST_ANGLE = 1000  # rad


@dataclass(frozen=True, repr=False)
class SlowManifold(Printable):
    """What can be said of the truncated series: its orders at one point, and how well it does at twenty fixed ones."""

    order: int
    omega: Fraction  #: [rad/s]
    beta: Fraction  #: where h is taken [rad]
    gamma: Fraction  #: where h is taken [rad]
    h: tuple[Measured, ...]  #: h_0 ... h_N at (beta, gamma) [rad/s, rad/m, ...]
    #: Largest |epsilon (dh/dx) f - g| over the fixed points, of the orders 0 ... N, at this set's epsilon [m rad/s^3].
    residual: tuple[Measured, ...]
    residual_slope: tuple[Measured, ...]  #: exponent of epsilon in that as epsilon tends to 0, seen at 1e-5 ... 1e-6
    best_order: int  #: where |epsilon^n h_n|, at its largest over the points, is smallest
    smallest_term: Measured  #: that size [rad/s]
    reduced_omega_crit: Measured | None  #: of the reduced flow at order N [rad/s]; None at order 0
    warning: str | None


def analyse_slow_manifold(
    parameters: Parameters, omega: object, order: int, digits: int = 12, *, at: tuple[object, object] = ("1.2", "0.3")
) -> SlowManifold:
    """Orders at a point, residuals with their observed exponents, and the best order, at the speed ``omega`` [rad/s].

    ``at`` is the point (beta, gamma) [rad], as decimals. Raises InputError for an order out of range, a speed that is
    not positive, or a point that is none or where the disk lies flat.
    """
    parameters.refuse_smooth("the slow manifold's expansion is")
    checked_order(order)
    speed = checked_speed(omega)
    checked_digits(digits)
    point = _point(at)
    working = bits_for_digits(digits + 5)
    rough, sharp = (_orders_at(parameters, speed, point, order, width) for width in (working, working + 66))
    ulp = Fraction(1, 2 ** (working - 1))
    shrinking = tuple(Fraction(1, 10**k) for k in (5, 6, 7))
    residual, *sizes = _largest_residuals(parameters, speed, order, (parameters.epsilon, *shrinking))
    slopes = []
    for coarse, middle, fine in zip(*sizes, strict=True):
        # The two-point exponent is off by a multiple of epsilon: a decade on a tenth of that is left, so the change
        # towards smaller epsilon shows nine tenths. (The change from larger epsilon, where the series need not be in
        # its asymptotic range yet, may vanish by chance.)
        exponent, next_exponent = math.log10(coarse / middle), math.log10(middle / fine)
        slopes.append(Measured.of(exponent, 2 * abs(exponent - next_exponent) + exponent * 2.0**-50))
    best, smallest = _best_order(parameters, speed)
    try:
        reduced = reduced_omega_crit(parameters, order, digits)
    except Shortfall:
        reduced = None
    return SlowManifold(
        order=order,
        omega=speed,
        beta=point[0],
        gamma=point[1],
        h=tuple(Measured.compared(coarse, fine, ulp) for coarse, fine in zip(rough, sharp, strict=True)),
        residual=tuple(map(_from_sixty_digits, residual)),
        residual_slope=tuple(slopes),
        best_order=best,
        smallest_term=_from_sixty_digits(smallest),
        reduced_omega_crit=reduced,
        warning=None
        if order <= best
        else f"epsilon = {float(parameters.epsilon):g} m/s is too large for order {order}: the largest terms over the"
        f" twenty fixed points grow from order {best + 1} on",
    )


def _point(at: tuple[object, object]) -> tuple[Fraction, Fraction]:
    if not isinstance(at, tuple) or len(at) != 2:
        raise InputError(f"a point is a pair (beta, gamma), not {shown(at)}")
    beta, gamma = map(exact, at)
    if beta.pi_multiple or gamma.pi_multiple:
        raise InputError("beta and gamma of a point of the slow manifold must be numbers without pi, such as 1.2")
    if max(abs(beta.rational), abs(gamma.rational)) > _LARGEST_ANGLE:
        raise InputError(f"the angles of a point lie between -{_LARGEST_ANGLE} and {_LARGEST_ANGLE} rad")
    if not beta.rational:
        raise InputError("at beta = 0 the disk lies flat, and has no slow manifold: try 1.2")
    return beta.rational, gamma.rational


def _from_sixty_digits(value: float) -> Measured:
    """A number that was rounded to double once, from an evaluation with digits to spare."""
    return Measured.of(value, value * 2.0**-50)


def _expansion(
    parameters: Parameters, omega: Fraction, point: tuple[Fraction, Fraction], order: int, working: int, slopes: bool
) -> Expansion:
    ctx = bits(working).context
    speed, beta, gamma = (quotient(ctx, number) for number in (omega, *point))
    return Expansion(ctx, parameters.within(ctx), speed, beta, gamma, order, slopes=slopes)


def _orders_at(
    parameters: Parameters, omega: Fraction, point: tuple[Fraction, Fraction], highest: int, working: int
) -> list[Any]:
    return [h.c[0] for h in _expansion(parameters, omega, point, highest, working, slopes=False).series]


def _largest_residuals(
    parameters: Parameters, omega: Fraction, order: int, epsilons: Sequence[Fraction]
) -> list[list[float]]:
    """For each epsilon and each order up to ``order``, over the fixed points.

    With sixty digits more than the residual lies below its terms.
    """
    below = (order + 1) * max(0, math.ceil(-math.log10(min(epsilons))))
    working = bits_for_digits(60 + below)
    expansions = [_expansion(parameters, omega, point, order, working, slopes=True) for point in POINTS]
    largest = []
    for epsilon in (quotient(bits(working).context, epsilon) for epsilon in epsilons):
        by_order = zip(*(one.residuals(epsilon) for one in expansions), strict=True)
        largest.append([float(max(map(abs, sizes))) for sizes in by_order])
    return largest


def _best_order(parameters: Parameters, omega: Fraction, highest: int = 10) -> tuple[int, float]:
    """Over the fixed points: where the largest term of each order is smallest."""
    rows = [_orders_at(parameters, omega, point, highest, 120) for point in POINTS]
    epsilon = quotient(bits(120).context, parameters.epsilon)
    largest = [float(max(map(abs, sizes)) * epsilon**n) for n, sizes in enumerate(zip(*rows, strict=True))]
    best = min(range(1, highest + 1), key=largest.__getitem__)
    return best, largest[best]
