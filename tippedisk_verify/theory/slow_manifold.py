"""The slow invariant manifold of the linear law, to any order in epsilon.

**The series.** Away from sin(beta) = 0, where attraction vanishes,

    v = h_c + epsilon h_1 + ... + epsilon^N h_N + O(epsilon^(N+1)).

**The orders.** The fast equation is epsilon v' = -a (v - h_c) + epsilon g_1, with a linear g_0 and
a quadratic g_1. So the invariance condition gives each order explicitly:

    a h_n = [g_1]_(n-1) - sum_(i+j=n-1) (d h_i / d beta) h_j + Omega cos(beta) d h_(n-1) / d gamma.

**Residuals.** The residuals of the invariance equation are taken at twenty fixed points,
`RESIDUAL_POINTS`.

**Convergence.** The series looks divergent: |h_n|^(1/n) grows about linearly in n. It is
asymptotic, with a best order at each point.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from types import SimpleNamespace
from typing import Any, NamedTuple

import gmpy2

from tippedisk_verify.display import Printable, quantity
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.model.equations import Ops, checked_speed, equation_terms
from tippedisk_verify.model.parameters import Constants, Parameters
from tippedisk_verify.numbers.exact import (
    checked_integer,
    exact,
    fraction,
    rational_in_context,
    short_text,
)
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.numpy_errors import ignore_numpy_errors
from tippedisk_verify.numbers.precision import bits_for_digits, checked_digits, precision_of_bits
from tippedisk_verify.theory.equilibria import EquilibriumName, equilibrium_state
from tippedisk_verify.theory.hopf import omega_crit
from tippedisk_verify.theory.power_series import PowerSeries, sine_and_cosine

__all__ = [
    "RESIDUAL_POINTS",
    "ReducedEquilibrium",
    "SlowManifold",
    "SlowManifoldSeries",
    "analyse_slow_manifold",
    "attraction_rate",
    "critical_manifold",
    "first_correction",
    "invariance_residuals",
    "reduced_equilibrium",
    "reduced_omega_crit",
    "series_orders",
    "slow_manifold",
]

_HIGHEST_ORDER = 40
_MAX_ANGLE = 1000  # rad
# The functions of gmpy2's numbers. Series of these take a fifth of the time of mpmath's.
_GMPY2_OPS: Any = SimpleNamespace(sin=gmpy2.sin, cos=gmpy2.cos)
#: Twenty fixed points (beta, gamma) [rad] of the box |beta - pi/2| <= 1, |gamma - pi/2| <= pi. A
#: Kronecker sequence of the plastic number's powers spreads them, so that they miss no pattern of
#: the field.
RESIDUAL_POINTS: tuple[tuple[Fraction, Fraction], ...] = tuple(
    (
        Fraction(15708, 10000) + 2 * (Fraction(7549 * n % 10000, 10000) - Fraction(1, 2)),
        Fraction(15708, 10000)
        + Fraction(62832, 10000) * (Fraction(5698 * n % 10000, 10000) - Fraction(1, 2)),
    )
    for n in range(1, 21)
)


def critical_manifold(ops: Ops, constants: Constants, omega: Any, beta: Any, gamma: Any) -> Any:
    """Return v = h_c [rad/s] on the critical manifold, where the disk rolls: gamma_y = 0 (Eq.
    critical_manifold_tippdisk).

    Args:
        ops: The functions of the kind of number.
        constants: The parameters in the same kind.
        omega: The spinning speed [rad/s].
        beta, gamma: The angles [rad]; arrays are accepted.
    """
    return (
        constants.e
        * omega
        * ops.sin(beta)
        * ops.cos(gamma)
        / (constants.r + constants.e * ops.sin(gamma))
    )


def first_correction(ops: Ops, constants: Constants, omega: Any, beta: Any, gamma: Any) -> Any:
    """Return h_1 [rad/m], the first-order term of the slow manifold's series, by the paper's
    formula below Eq. slow_manifold_tippdisk.

    It is singular at sin(beta) = 0.

    Args:
        ops, constants, omega, beta, gamma: As for `critical_manifold`.
    """
    rolling = critical_manifold(ops, constants, omega, beta, gamma)
    sin_b, cos_b, sin_g, cos_g = ops.sin(beta), ops.cos(beta), ops.sin(gamma), ops.cos(gamma)
    rho = constants.r + constants.e * sin_g
    by_beta = constants.e * omega * cos_b * cos_g / rho
    by_gamma = (
        -constants.e * omega * sin_b * (sin_g / rho + constants.e * cos_g * cos_g / (rho * rho))
    )
    parts = equation_terms(ops, constants, omega, beta, gamma, rolling)
    inertial = (parts.gyroscopic + parts.gravity) / parts.mass  # g_1, Eq. per_g1
    # d(g_0)/d(v)
    rate = (
        -constants.mu
        * constants.m
        * constants.g
        * parts.force_direction
        * parts.force_direction
        / parts.mass
    )
    return (by_beta * rolling - by_gamma * omega * cos_b - inertial) / rate


def slow_manifold(
    ops: Ops, constants: Constants, omega: Any, beta: Any, gamma: Any, order: int = 1
) -> Any:
    """Return v [rad/s] on the slow manifold, truncated at order 0 or 1.

    The formula is Eq. slow_manifold_tippdisk.

    Args:
        ops, constants, omega, beta, gamma: As for `critical_manifold`.
        order: 0 or 1.
    """
    surface = critical_manifold(ops, constants, omega, beta, gamma)
    if order == 0:
        return surface
    return surface + constants.epsilon * first_correction(ops, constants, omega, beta, gamma)


def attraction_rate(ops: Ops, constants: Constants, beta: Any, gamma: Any) -> Any:
    """Return the attraction rate d(v')/d(v) of the friction term [1/s].

    It is -M^-1 (mu m g / epsilon) rho^2 sin^2(beta): negative, and 0 where the disk lies flat.

    Args:
        ops, constants, beta, gamma: As for `critical_manifold`.
    """
    parts = equation_terms(ops, constants, 0, beta, gamma, 0)
    return (
        -constants.mu
        * constants.m
        * constants.g
        * parts.force_direction**2
        / parts.mass
        / constants.epsilon
    )


class SlowManifoldSeries:
    """The orders h_0 ... h_highest of the slow manifold v = h(beta, gamma), as power series about a
    point.

    They come from v' = q_0 + q_1 v + q_2 v^2 - rate (v - h_c) / epsilon (Eqs. per_g0, per_g1). Each
    order costs one degree.

    Args:
        ops: The functions of the kind of number.
        c: The parameters in the same kind.
        omega: The spinning speed [rad/s].
        beta, gamma: The point [rad].
        highest: The highest order.
        slopes: True keeps one degree for the derivatives of the last order.
    """

    def __init__(
        self,
        ops: Ops,
        c: Constants,
        omega: Any,
        beta: Any,
        gamma: Any,
        highest: int,
        *,
        slopes: bool = True,
    ) -> None:
        degree = highest + slopes
        sines: list[PowerSeries] = []
        for axis, angle in enumerate((beta, gamma)):
            coordinate = [0 * angle] * ((degree + 1) * (degree + 2) // 2)
            if degree:
                coordinate[1 + axis] += 1
            sines += sine_and_cosine(PowerSeries(coordinate, 2), ops.sin(angle), ops.cos(angle))
        sin_b, cos_b, sin_g, cos_g = sines
        rho = c.e * sin_g + c.r
        lever, grip = rho * cos_b, rho * sin_b
        inertia = (c.a - c.b) * (cos_g * cos_g) + c.b
        mass = inertia + lever * lever
        push = inertia * sin_b * cos_b + c.e * (lever * cos_b * cos_b * sin_b * sin_g)
        mixed = 2 * (c.a - c.b) * sin_g + c.e * (rho * (3 * (sin_b * sin_b) - 2))
        self.q0 = (omega * omega * push - c.g * lever) / mass
        self.q1 = -omega * (cos_b * cos_g * mixed) / mass
        self.q2 = lever * rho * sin_b / mass
        self.rate = c.traction * (grip * grip) / mass
        self.drift = omega * cos_b  # -gamma'
        self.series = [c.e * omega * (sin_b * cos_g) / rho]  # pure rolling
        for n in range(1, highest + 1):
            last = self.series[n - 1]
            right = self.q1 * last + self.drift * last.partial_derivative(1)
            if n == 1:
                right = right + self.q0
            pairs = list(zip(self.series, reversed(self.series), strict=True))
            right = right + self.q2 * sum(one * other for one, other in pairs)
            right = right - sum(one.partial_derivative(0) * other for one, other in pairs)
            self.series.append(right / self.rate)

    @property
    def orders(self) -> list[Any]:
        """The values [h_0, h_1, ...] of the slow manifold's orders at the point."""
        return [h.coefficients[0] for h in self.series]

    def truncations(self, epsilon: Any) -> Iterator[tuple[Any, Any, Any]]:
        """Yield the slow manifold's v = h and its slopes dh/dbeta and dh/dgamma at the point, with
        the series truncated at each order in turn.

        Args:
            epsilon: The parameter of the series [m/s].
        """
        h = by_beta = by_gamma = 0
        for n, order in enumerate(self.series):
            power = epsilon**n
            h, by_beta, by_gamma = (
                h + power * order.coefficients[0],
                by_beta + power * order.coefficients[1],
                by_gamma + power * order.coefficients[2],
            )
            yield h, by_beta, by_gamma

    def residuals(self, epsilon: Any) -> list[Any]:
        """Return the residuals of the invariance equation, epsilon (dh/dx) f - g [m rad/s^3], of
        each truncation of the slow manifold's series.

        The residual of order n has the size epsilon^(n + 1).

        Args:
            epsilon: The parameter of the series [m/s].
        """
        q0, q1, q2, rate, drift, rolling = (
            term.coefficients[0]
            for term in (self.q0, self.q1, self.q2, self.rate, self.drift, self.series[0])
        )
        return [
            epsilon * (by_beta * v - by_gamma * drift - (q0 + q1 * v + q2 * v * v))
            + rate * (v - rolling)
            for v, by_beta, by_gamma in self.truncations(epsilon)
        ]


def series_orders(
    ops: Ops, constants: Constants, omega: Any, beta: Any, gamma: Any, highest: int
) -> list[Any]:
    """Return the orders [h_0, h_1, ..., h_highest] of the slow manifold's series at one point
    [rad/s, rad/m, ...].

    The result is in the arithmetic of the arguments.

    Args:
        ops, constants, omega, beta, gamma: As for `critical_manifold`.
        highest: The highest order.

    Raises:
        InputError: If the order is not from 0 to 40.
    """
    highest = _checked_order(highest)
    return SlowManifoldSeries(ops, constants, omega, beta, gamma, highest, slopes=False).orders


def invariance_residuals(
    ops: Ops, constants: Constants, omega: Any, beta: Any, gamma: Any, highest: int
) -> list[Any]:
    """Return how far truncations of the slow manifold's series are from invariance at a point, up
    to an order.

    They are the `SlowManifoldSeries.residuals`.

    Args:
        ops, constants, omega, beta, gamma, highest: As for `series_orders`.

    Raises:
        InputError: If the order is not from 0 to 40.
    """
    highest = _checked_order(highest)
    return SlowManifoldSeries(ops, constants, omega, beta, gamma, highest).residuals(
        constants.epsilon
    )


def _checked_order(order: int) -> int:
    """Check the order of the slow manifold's series and return it as an int; raise InputError
    unless it is an integer from 0 to 40.
    """
    complaint = f"the order of the slow manifold lies between 0 and {_HIGHEST_ORDER}, not {{}}"
    return checked_integer(order, 0, _HIGHEST_ORDER, complaint)


# ------------------------------------------------------------------------------ the reduced flow
class ReducedEquilibrium(NamedTuple):
    """The linearisation of the reduced flow on the slow manifold at an equilibrium.

    The flow is beta' = h(beta, gamma), gamma' = -Omega cos(beta). The eigenvalues satisfy l^2 -
    trace l + det = 0.
    """

    trace: Any  #: dh/d(beta) [1/s]
    determinant: Any  #: -Omega dh/d(gamma) [1/s^2]


def reduced_equilibrium(
    parameters: Parameters, omega: Any, name: EquilibriumName, order: int, working_bits: int = 120
) -> ReducedEquilibrium:
    """Return the linearisation of the reduced flow on the slow manifold at an equilibrium.

    Order 0 has trace 0: at every speed noninverted spinning is a saddle and inverted spinning a
    centre.

    Args:
        parameters: The disk.
        omega: The speed [rad/s], a number of any kind.
        name: ``inverted`` or ``noninverted``.
        order: The order of the slow manifold.
        working_bits: The precision.

    Returns:
        The trace and the determinant, as numbers of gmpy2.

    Raises:
        InputError: If the name or the order cannot be used.
    """
    order = _checked_order(order)
    with gmpy2.context(precision=working_bits):
        constants, speed = _constants(parameters), gmpy2.mpfr(fraction(omega))
        beta, gamma, _ = (
            gmpy2.mpfr(angle.pi_multiple) * gmpy2.const_pi() for angle in equilibrium_state(name)
        )
        *_, (_, by_beta, by_gamma) = SlowManifoldSeries(
            _GMPY2_OPS, constants, speed, beta, gamma, order
        ).truncations(constants.epsilon)
        return ReducedEquilibrium(by_beta, -speed * by_gamma)


def reduced_omega_crit(parameters: Parameters, order: int, digits: int = 15) -> Measured:
    """Return the speed of the Hopf point of the reduced flow on the slow manifold [rad/s].

    The trace at inverted spinning vanishes there. At order 1 this is Omega_crit exactly.

    Args:
        parameters: The disk.
        order: The order of the slow manifold.
        digits: Significant digits.

    Raises:
        InputError: If the order cannot be used, or the disk has the smooth friction law.
        AccuracyError: If the order is 0, where the trace vanishes at every speed, or no root lies
            within a tenth of Omega_crit.
    """
    parameters.refuse_unless_linear("the slow manifold's expansion is")
    order = _checked_order(order)
    if order == 0:
        raise AccuracyError(
            "order 0 has no Hopf point: on the critical manifold inverted spinning is a centre at "
            "every speed"
        )
    start = float(omega_crit(parameters))

    def root(working_bits: int) -> Any:
        """Return the speed at which the reduced flow's trace at inverted spinning is zero, by the
        secant method.
        """
        ctx = precision_of_bits(working_bits).context

        def trace(speed: Any) -> Any:
            linearised = reduced_equilibrium(parameters, speed, "inverted", order, working_bits)
            return rational_in_context(ctx, fraction(linearised.trace))

        try:
            return ctx.findroot(
                trace, (ctx.mpf(0.9995 * start), ctx.mpf(1.0005 * start)), tol=ctx.eps**1.5
            )
        except (ValueError, ZeroDivisionError):
            return ctx.inf

    working = bits_for_digits(digits + 15)
    coarse, accurate = map(root, (working, working + 66))
    if not max(abs(coarse / start - 1), abs(accurate / start - 1)) < 0.1:
        raise AccuracyError(
            f"the reduced flow of order {order} has no Hopf point near Omega_crit: epsilon is too "
            f"large"
        )
    return Measured.compared(coarse, accurate, Fraction(1, 2 ** (working - 1)))


# ------------------------------------------------------------------- the accuracy of the series
@dataclass(frozen=True, repr=False)
class SlowManifold(Printable):
    """The truncated series of the slow manifold: its orders at one point, and its accuracy at
    twenty fixed points.

    A residual is |epsilon (dh/dx) f - g|, at this set's epsilon. ``reduced_omega_crit`` belongs to
    the reduced flow of order N. It is None where no Hopf point is found, as at order 0.
    """

    order: int
    omega: Fraction  #: [rad/s]
    beta: Fraction  #: where h is taken [rad]
    gamma: Fraction  #: where h is taken [rad]
    h: tuple[Measured, ...] = field(
        metadata=quantity(
            "the orders h_0, h_1, ... of v = h_0 + epsilon h_1 + ... there", "rad s^(n-1)/m^n"
        )
    )
    residual: tuple[Measured, ...] = field(
        metadata=quantity(
            "largest residual of orders 0, 1, ... over twenty fixed points", "m rad/s^3"
        )
    )
    residual_slope: tuple[Measured, ...] = field(
        metadata=quantity(
            "its exponent in epsilon as epsilon tends to 0, seen at 1e-5 ... 1e-6", "1"
        )
    )
    best_order: int = field(
        metadata=quantity("the order whose term is smallest, at its largest over those points", "1")
    )
    smallest_term: Measured = field(metadata=quantity("the size of that term", "rad/s"))
    reduced_omega_crit: Measured | None = field(
        metadata=quantity("the Hopf speed of the flow on the truncated slow manifold", "rad/s")
    )
    warning: str | None


@ignore_numpy_errors()
def analyse_slow_manifold(
    parameters: Parameters,
    omega: object,
    order: int,
    digits: int = 12,
    *,
    at: tuple[object, object] = ("1.2", "0.3"),
) -> SlowManifold:
    """Return an analysis of the slow manifold's series: its orders at a point, its residuals with
    their observed exponents, and the best order.

    Args:
        parameters: The disk.
        omega: The spinning speed [rad/s].
        order: The highest order, N.
        digits: Significant digits of each order.
        at: The point (beta, gamma) [rad], as decimals.

    Raises:
        InputError: If the order, the speed or the point cannot be used, the disk lies flat at the
            point, or it has the smooth friction law.
    """
    parameters.refuse_unless_linear("the slow manifold's expansion is")
    order = _checked_order(order)
    speed = checked_speed(omega)
    digits = checked_digits(digits)
    point = _point(at)
    working = bits_for_digits(digits + 5)
    with gmpy2.context(precision=working):
        coarse = _expansion(parameters, speed, point, order, slopes=False).orders
    with gmpy2.context(precision=working + 66):
        accurate = _expansion(parameters, speed, point, order, slopes=False).orders
    ulp = Fraction(1, 2 ** (working - 1))
    shrinking = tuple(Fraction(1, 10**k) for k in (5, 6, 7))
    residuals, *sizes = _largest_residuals(
        parameters, speed, order, (parameters.epsilon, *shrinking)
    )
    slopes = []
    for first, second, third in zip(*sizes, strict=True):
        # The error of the two-point exponent is a multiple of epsilon. A decade further a tenth of
        # it is left, so the change towards smaller epsilon shows nine tenths. (The change from
        # larger epsilon may vanish by chance, because the series need not be in its asymptotic
        # range there.)
        exponent, next_exponent = math.log10(first / second), math.log10(second / third)
        slopes.append(
            Measured.of(exponent, 2 * abs(exponent - next_exponent) + exponent * 2.0**-50)
        )
    best, smallest = _best_order(parameters, speed)
    # Rounded to double once, from an evaluation with digits to spare.
    *residual, smallest_term = (
        Measured.of(size, size * 2.0**-50) for size in (*residuals, smallest)
    )
    try:
        reduced = reduced_omega_crit(parameters, order, digits)
    except AccuracyError:
        reduced = None
    return SlowManifold(
        order=order,
        omega=speed,
        beta=point[0],
        gamma=point[1],
        h=tuple(Measured.compared(*pair, ulp) for pair in zip(coarse, accurate, strict=True)),
        residual=tuple(residual),
        residual_slope=tuple(slopes),
        best_order=best,
        smallest_term=smallest_term,
        reduced_omega_crit=reduced,
        warning=None
        if order <= best
        else f"epsilon = {float(parameters.epsilon):g} m/s is too large for order {order}: the "
        f"largest terms over the"
        f" twenty fixed points grow from order {best + 1} on",
    )


def _point(at: tuple[object, object]) -> tuple[Fraction, Fraction]:
    if not isinstance(at, tuple) or len(at) != 2:
        raise InputError(f"a point is a pair (beta, gamma), not {short_text(at)}")
    beta, gamma = map(exact, at)
    if beta.pi_multiple or gamma.pi_multiple:
        raise InputError(
            "beta and gamma of a point of the slow manifold must be numbers without pi, such as 1.2"
        )
    if max(abs(beta.rational), abs(gamma.rational)) > _MAX_ANGLE:
        raise InputError(f"the angles of a point lie between -{_MAX_ANGLE} and {_MAX_ANGLE} rad")
    if math.sin(beta.rational) <= 0:
        raise InputError(
            f"beta lies between 0 and pi, where the disk stands, not at {float(beta.rational):g}"
        )
    return beta.rational, gamma.rational


def _expansion(
    parameters: Parameters,
    omega: Fraction,
    point: tuple[Fraction, Fraction],
    order: int,
    *,
    slopes: bool,
) -> SlowManifoldSeries:
    """Expand the slow manifold at a point, in the precision of gmpy2's present context."""
    speed, beta, gamma = map(gmpy2.mpfr, (omega, *point))
    return SlowManifoldSeries(
        _GMPY2_OPS, _constants(parameters), speed, beta, gamma, order, slopes=slopes
    )


def _constants(parameters: Parameters) -> Constants:
    """Return the disk's parameters in the precision of gmpy2's present context."""
    *rational, _ = parameters.rational_constants()
    return Constants(*map(gmpy2.mpfr, rational))._replace(pi=gmpy2.const_pi())


def _largest_residuals(
    parameters: Parameters, omega: Fraction, order: int, epsilons: Sequence[Fraction]
) -> list[list[float]]:
    """Return the largest residual of the slow manifold's invariance equation over the fixed points,
    for each epsilon and each order.

    The residual is smaller than its terms by some number of digits. The working precision has sixty
    more than that.
    """
    below = (order + 1) * max(0, math.ceil(-math.log10(min(epsilons))))
    largest = []
    with gmpy2.context(precision=bits_for_digits(60 + below)):
        expansions = [
            _expansion(parameters, omega, point, order, slopes=True) for point in RESIDUAL_POINTS
        ]
        for epsilon in map(gmpy2.mpfr, epsilons):
            by_order = zip(*(series.residuals(epsilon) for series in expansions), strict=True)
            largest.append([float(max(map(abs, sizes))) for sizes in by_order])
    return largest


def _best_order(parameters: Parameters, omega: Fraction, highest: int = 10) -> tuple[int, float]:
    """Return the order at which to truncate the slow manifold's series, and the size of its term.

    It is the order whose largest term over the fixed points is smallest.
    """
    with gmpy2.context(precision=120):
        rows = [
            _expansion(parameters, omega, point, highest, slopes=False).orders
            for point in RESIDUAL_POINTS
        ]
        epsilon = gmpy2.mpfr(parameters.epsilon)
        largest = [
            float(max(map(abs, sizes)) * epsilon**n)
            for n, sizes in enumerate(zip(*rows, strict=True))
        ]
    best = min(range(1, highest + 1), key=largest.__getitem__)
    return best, largest[best]
