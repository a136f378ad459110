"""The slow invariant manifold of the linear law, to any order in epsilon.

v = h_c + epsilon h_1 + ... + epsilon^N h_N + O(epsilon^(N+1)), away from sin(beta) = 0 where attraction vanishes. The
fast equation epsilon v' = -a (v - h_c) + epsilon g_1 has a linear g_0 and a quadratic g_1, so the invariance condition
gives each order explicitly:

    a h_n = [g_1]_(n-1) - sum_(i+j=n-1) (d h_i / d beta) h_j + Omega cos(beta) d h_(n-1) / d gamma.

The series looks divergent (|h_n|^(1/n) grows about linearly in n): it is asymptotic, with a best order at each point.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any, NamedTuple

from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.model.equations import Ops, checked_speed, terms
from tippedisk_verify.model.exact import exact, quotient, shown
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Constants, Parameters
from tippedisk_verify.model.precision import bits, bits_for_digits, checked_digits, heyoka_module
from tippedisk_verify.model.results import Printable
from tippedisk_verify.theory.equilibria import EquilibriumName, location
from tippedisk_verify.theory.hopf import omega_crit
from tippedisk_verify.theory.jets import Jet, coordinate_sine

__all__ = [
    "POINTS",
    "ReducedEquilibrium",
    "SlowManifold",
    "attraction_rate",
    "compiled",
    "critical_manifold",
    "first_correction",
    "invariance_residuals",
    "orders",
    "reduced_equilibrium",
    "reduced_omega_crit",
    "slow_manifold",
    "study",
    "symbolic_orders",
]

_HIGHEST_ORDER = 40
_LARGEST_ANGLE = 1000  # rad
#: Twenty fixed points (beta, gamma) [rad] of the box |beta - pi/2| <= 1, |gamma - pi/2| <= pi, spread by a Kronecker
#: sequence of the plastic number's powers: no pattern of the field can hide from them.
POINTS: tuple[tuple[Fraction, Fraction], ...] = tuple(
    (
        Fraction(15708, 10000) + 2 * (Fraction(7549 * n % 10000, 10000) - Fraction(1, 2)),
        Fraction(15708, 10000) + Fraction(62832, 10000) * (Fraction(5698 * n % 10000, 10000) - Fraction(1, 2)),
    )
    for n in range(1, 21)
)


def critical_manifold(ops: Ops, constants: Constants, omega: Any, beta: Any, gamma: Any) -> Any:
    """h_c [rad/s], the v of pure rolling, gamma_y = 0 (Eq. critical_manifold_tippdisk)."""
    return constants.e * omega * ops.sin(beta) * ops.cos(gamma) / (constants.r + constants.e * ops.sin(gamma))


def first_correction(ops: Ops, constants: Constants, omega: Any, beta: Any, gamma: Any) -> Any:
    """h_1 [rad/m], the paper's formula below Eq. slow_manifold_tippdisk; singular at sin(beta) = 0."""
    rolling = critical_manifold(ops, constants, omega, beta, gamma)
    sin_b, cos_b, sin_g, cos_g = ops.sin(beta), ops.cos(beta), ops.sin(gamma), ops.cos(gamma)
    rho = constants.r + constants.e * sin_g
    by_beta = constants.e * omega * cos_b * cos_g / rho
    by_gamma = -constants.e * omega * sin_b * (sin_g / rho + constants.e * cos_g * cos_g / (rho * rho))
    here = terms(ops, constants, omega, beta, gamma, rolling)
    inertial = (here.gyroscopic + here.gravity) / here.mass  # g_1, Eq. per_g1
    rate = -constants.mu * constants.m * constants.g * here.direction * here.direction / here.mass  # d(g_0)/d(v)
    return (by_beta * rolling - by_gamma * omega * cos_b - inertial) / rate


def slow_manifold(ops: Ops, constants: Constants, omega: Any, beta: Any, gamma: Any, order: int = 1) -> Any:
    """v [rad/s] on the slow manifold, truncated at ``order`` 0 or 1 (Eq. slow_manifold_tippdisk); arrays welcome."""
    surface = critical_manifold(ops, constants, omega, beta, gamma)
    if order == 0:
        return surface
    return surface + constants.epsilon * first_correction(ops, constants, omega, beta, gamma)


def attraction_rate(ops: Ops, constants: Constants, beta: Any, gamma: Any) -> Any:
    """d(v')/d(v) of the friction term [1/s]: -M^-1 (mu m g / epsilon) rho^2 sin^2(beta), negative, 0 where flat."""
    here = terms(ops, constants, 0, beta, gamma, 0)
    return -constants.mu * constants.m * constants.g * here.direction**2 / here.mass / constants.epsilon


@lru_cache(maxsize=8)
def compiled(order: int) -> Callable[[Any, Any, Constants, Any], Any]:
    """The truncated series as machine code for arrays in double: ``f(beta, gamma, constants, omega) -> v`` [rad/s].

    Compiled once per order. Raises InputError beyond order 5, where the expressions grow too large.
    """
    series, (beta, gamma), par = symbolic_orders(order)
    names = (*par, "epsilon")
    hy = heyoka_module()
    par = {**par, "epsilon": hy.par[len(par)]}
    total, power = series[0], par["epsilon"]
    for term in series[1:]:
        total, power = total + power * term, power * par["epsilon"]
    function = hy.cfunc([total], [beta, gamma], compact_mode=True)

    def surface(beta: Any, gamma: Any, constants: Constants, omega: Any) -> Any:
        import numpy

        points = numpy.array(numpy.broadcast_arrays(beta, gamma), dtype=float)
        flat = numpy.ascontiguousarray(points.reshape(2, -1))
        values = [float(omega), *(float(getattr(constants, name)) for name in names[1:])]
        used = numpy.array(values)[: function.nparams, None]  # low orders know fewer parameters
        pars = numpy.ascontiguousarray(numpy.repeat(used, flat.shape[1], axis=1))
        return function(flat, pars=pars)[0].reshape(points.shape[1:])

    return surface


def symbolic_orders(order: int) -> tuple[list[Any], tuple[Any, Any], dict[str, Any]]:
    """h_0 ... h_order as heyoka expressions, their variables (beta, gamma), and their runtime parameters by name.

    The recursion carried out on expressions and their symbolic derivatives. Raises InputError beyond order 5.
    """
    if not 0 <= order <= 5:
        raise InputError(f"compiled evaluation goes from order 0 to 5, not {order}: use orders() beyond")
    hy = heyoka_module()
    beta, gamma = hy.make_vars("beta", "gamma")
    names = ("omega", "r", "e", "a", "b", "g", "traction")
    par = dict(zip(names, (hy.par[index] for index in range(len(names))), strict=True))
    constants = Constants(**{name: par.get(name) for name in Constants._fields})
    sines = (hy.sin(beta), hy.cos(beta), hy.sin(gamma), hy.cos(gamma))
    series = _expanded(
        _fast(constants, par["omega"], *sines), order, lambda h: hy.diff(h, beta), lambda h: hy.diff(h, gamma)
    )
    return series, (beta, gamma), par


class _Fast(NamedTuple):
    """What the recursion needs: a, h_c, g_1 = q_0 + q_1 v + q_2 v^2, and Omega cos(beta); jets or expressions."""

    rate: Any
    rolling: Any
    q0: Any
    q1: Any
    q2: Any
    drift: Any


def _fast(c: Constants, omega: Any, sin_b: Any, cos_b: Any, sin_g: Any, cos_g: Any) -> _Fast:
    """From Eqs. per_g0 and per_g1, all divided by m."""
    rho = c.e * sin_g + c.r
    lever = rho * cos_b
    inertia = (c.a - c.b) * (cos_g * cos_g) + c.b
    mass = inertia + lever * lever
    grip = rho * sin_b
    constant = omega * omega * (inertia * sin_b * cos_b + c.e * (lever * cos_b * cos_b * sin_b * sin_g)) - c.g * lever
    mixed = 2 * (c.a - c.b) * sin_g + c.e * (rho * (3 * (sin_b * sin_b) - 2))
    return _Fast(
        rate=c.traction * (grip * grip) / mass,
        rolling=c.e * omega * (sin_b * cos_g) / rho,
        q0=constant / mass,
        q1=-omega * (cos_b * cos_g * mixed) / mass,
        q2=lever * rho * sin_b / mass,
        drift=omega * cos_b,
    )


def _jets(ops: Ops, c: Constants, omega: Any, beta: Any, gamma: Any, degree: int) -> _Fast:
    return _fast(c, omega, *coordinate_sine(ops, beta, degree, 0), *coordinate_sine(ops, gamma, degree, 1))


def _expanded(
    fast: _Fast,
    highest: int,
    by_beta: Callable[[Any], Any] = Jet.by_beta,
    by_gamma: Callable[[Any], Any] = Jet.by_gamma,
) -> list[Any]:
    """h_0 ... h_highest, whatever the terms are made of."""
    series = [fast.rolling]
    for n in range(1, highest + 1):
        last = series[n - 1]
        right = fast.q1 * last + fast.drift * by_gamma(last)
        if n == 1:
            right = right + fast.q0
        for i in range(n):
            right = right + fast.q2 * (series[i] * series[n - 1 - i]) - by_beta(series[i]) * series[n - 1 - i]
        series.append(right / fast.rate)
    return series


def orders(ops: Ops, constants: Constants, omega: Any, beta: Any, gamma: Any, highest: int) -> list[Any]:
    """[h_0, h_1, ..., h_highest] at one point [rad/s, rad/m, ...], in the arithmetic of the arguments.

    Raises InputError for an order below 0 or above 40.
    """
    _checked_order(highest)
    return [jet.value for jet in _expanded(_jets(ops, constants, omega, beta, gamma, highest), highest)]


def invariance_residuals(ops: Ops, constants: Constants, omega: Any, beta: Any, gamma: Any, highest: int) -> list[Any]:
    """epsilon (dh/dx) f - g [m rad/s^3] of the series truncated at each order up to ``highest``, from one expansion.

    Of the order n it is of size epsilon^(n + 1).
    """
    _checked_order(highest)
    fast = _jets(ops, constants, omega, beta, gamma, highest + 1)
    series = _expanded(fast, highest)
    residuals = []
    for order in range(highest + 1):
        surface = _summed(series[: order + 1], constants.epsilon)
        v = surface.value
        moved = surface.by_beta().value * v - surface.by_gamma().value * fast.drift.value
        inertial = fast.q0.value + fast.q1.value * v + fast.q2.value * v * v
        residuals.append(constants.epsilon * (moved - inertial) + fast.rate.value * (v - fast.rolling.value))
    return residuals


def _summed(series: list[Jet], epsilon: Any) -> Jet:
    """The truncated series as one jet; each order costs one degree."""
    total = series[-1]
    for jet in reversed(series[:-1]):
        total = jet.cut(total.degree) + epsilon * total
    return total


def _checked_order(order: int) -> None:
    if isinstance(order, bool) or not isinstance(order, int) or not 0 <= order <= _HIGHEST_ORDER:
        raise InputError(f"the order of the slow manifold lies between 0 and {_HIGHEST_ORDER}, not {shown(order)}")


# --------------------------------------------------------------------------------------------- the reduced flow
class ReducedEquilibrium(NamedTuple):
    """Linearisation of beta' = h(beta, gamma), gamma' = -Omega cos(beta) at an equilibrium: l^2 - trace l + det = 0."""

    trace: Any  #: dh/d(beta) [1/s]
    determinant: Any  #: -Omega dh/d(gamma) [1/s^2]

    def eigenvalues(self, ctx: Any) -> tuple[Any, Any]:
        root = ctx.sqrt(ctx.mpc(self.trace**2 / 4 - self.determinant))
        return self.trace / 2 + root, self.trace / 2 - root


def reduced_equilibrium(
    parameters: Parameters, omega: Any, name: EquilibriumName, order: int, working_bits: int = 120
) -> ReducedEquilibrium:
    """The reduced flow's linearisation; ``omega`` is an mpmath number of that many bits or a Fraction.

    Order 0 has trace 0: noninverted is a saddle and inverted a centre, whatever the speed.
    """
    _checked_order(order)
    precision = bits(working_bits)
    ctx = precision.context
    constants = Constants(*(precision.mpf(value) for value in parameters.at(precision)))
    speed = quotient(ctx, omega) if isinstance(omega, Fraction) else ctx.mpf(omega)
    beta, gamma, _ = (precision.mpf(precision.number(part)) for part in location(name))
    surface = _summed(_expanded(_jets(ctx, constants, speed, beta, gamma, order + 1), order), constants.epsilon)
    return ReducedEquilibrium(surface.c[1][0], -speed * surface.c[0][1])


def reduced_omega_crit(parameters: Parameters, order: int, digits: int = 15) -> Measured:
    """The Hopf speed of the reduced flow [rad/s]: where the trace at inverted spinning vanishes.

    At order 1 this is Omega_crit exactly. Raises Shortfall at order 0, where the trace vanishes at every speed, and
    where no root lies within a tenth of Omega_crit.
    """
    parameters.refuse_smooth("the slow manifold's expansion is")
    _checked_order(order)
    if order == 0:
        raise Shortfall(
            "order 0 has no Hopf point: on the critical manifold inverted spinning is a centre at every speed"
        )
    working = bits_for_digits(digits + 15)
    rough, sharp = (_trace_root(parameters, order, bits_used) for bits_used in (working, working + 66))
    return Measured.compared(rough, sharp, Fraction(1, 2 ** (working - 1)))


def _trace_root(parameters: Parameters, order: int, working_bits: int) -> Any:
    """Where the trace at inverted spinning vanishes, by the secant method from Omega_crit's neighbourhood."""
    ctx = bits(working_bits).context

    def trace(speed: Any) -> Any:
        return reduced_equilibrium(parameters, speed, "inverted", order, working_bits).trace

    guess = ctx.mpf(float(omega_crit(parameters)))
    near = (guess * ctx.mpf("0.9995"), guess * ctx.mpf("1.0005"))
    try:
        root = ctx.findroot(trace, near, tol=ctx.eps**1.5)
    except (ValueError, ZeroDivisionError):
        root = ctx.inf
    if not abs(root / guess - 1) < ctx.mpf("0.1"):
        raise Shortfall(f"the reduced flow of order {order} has no Hopf point near Omega_crit: epsilon is too large")
    return root


# ------------------------------------------------------------------------------------------------------ the study
@dataclass(frozen=True, repr=False)
class SlowManifold(Printable):
    """What can be said of the truncated series: its orders at one point, and how well it does at twenty fixed ones."""

    order: int
    omega: Fraction  #: [rad/s]
    beta: Fraction  #: where h is taken [rad]
    gamma: Fraction  #: where h is taken [rad]
    h: tuple[Measured, ...]  #: h_0 ... h_N at (beta, gamma) [rad/s, rad/m, ...]
    residual: tuple[
        Measured, ...
    ]  #: at the fixed points: largest |epsilon (dh/dx) f - g| of the orders 0 ... N at this set's epsilon
    residual_slope: tuple[Measured, ...]  #: exponent of epsilon in that as epsilon tends to 0, seen at 1e-5 ... 1e-6
    best_order: int  #: where |epsilon^n h_n|, at its largest over the points, is smallest
    smallest_term: Measured  #: that size [rad/s]
    reduced_omega_crit: Measured | None  #: of the reduced flow at order N [rad/s]; None at order 0
    warning: str | None


def study(
    parameters: Parameters, omega: object, order: int, digits: int = 12, *, at: tuple[object, object] = ("1.2", "0.3")
) -> SlowManifold:
    """Orders at a point, residuals with their observed exponents, and the best order, at the speed ``omega`` [rad/s].

    ``at`` is the point (beta, gamma) [rad], as decimals. Raises InputError for an order out of range, a speed that is
    not positive, or a point that is none or where the disk lies flat.
    """
    parameters.refuse_smooth("the slow manifold's expansion is")
    _checked_order(order)
    speed = checked_speed(omega)
    checked_digits(digits)
    beta, gamma = _point(at)
    working = bits_for_digits(digits + 5)
    rough, sharp = (_at(parameters, speed, bits_used, beta, gamma, order) for bits_used in (working, working + 66))
    ulp = Fraction(1, 2 ** (working - 1))
    h = tuple(Measured.compared(coarse, fine, ulp) for coarse, fine in zip(rough, sharp, strict=True))
    residual = _largest_residuals(parameters, speed, order)
    sizes = [_largest_residuals(parameters.changed(epsilon=Fraction(1, 10**k)), speed, order) for k in (5, 6, 7)]
    slopes = []
    for coarse, middle, fine in zip(*sizes, strict=True):
        # The two-point exponent is off by a multiple of epsilon: a decade on a tenth of that is left, so the change
        # towards smaller epsilon shows nine tenths. (The change from larger epsilon, where the series need not be in
        # its asymptotic range yet, may vanish by chance.)
        here, next_one = (math.log10(large / small) for large, small in ((coarse, middle), (middle, fine)))
        slopes.append(Measured.of(here, 2 * abs(here - next_one) + here * 2.0**-50))
    best, smallest = _best_order(parameters, speed)
    warning = None
    if order > best:
        warning = (
            f"epsilon = {float(parameters.epsilon):g} m/s is too large for order {order}: the largest terms over the"
            f" twenty fixed points grow from order {best + 1} on"
        )
    hopf = None if order == 0 else _hopf_or_none(parameters, order, digits)
    return SlowManifold(
        order,
        speed,
        beta,
        gamma,
        h,
        tuple(map(_from_sixty_digits, residual)),
        tuple(slopes),
        best,
        _from_sixty_digits(smallest),
        hopf,
        warning,
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


def _hopf_or_none(parameters: Parameters, order: int, digits: int) -> Measured | None:
    try:
        return reduced_omega_crit(parameters, order, digits)
    except Shortfall:
        return None


def _numbers(parameters: Parameters, omega: Fraction, working_bits: int) -> tuple[Any, Constants, Any]:
    precision = bits(working_bits)
    ctx = precision.context
    constants = Constants(*(precision.mpf(value) for value in parameters.at(precision)))
    return ctx, constants, quotient(ctx, omega)


def _at(
    parameters: Parameters, omega: Fraction, working_bits: int, beta: Fraction, gamma: Fraction, highest: int
) -> list[Any]:
    ctx, constants, speed = _numbers(parameters, omega, working_bits)
    place = [quotient(ctx, part) for part in (beta, gamma)]
    return orders(ctx, constants, speed, place[0], place[1], highest)


def _largest_residuals(parameters: Parameters, omega: Fraction, order: int) -> tuple[float, ...]:
    """For each order up to the given one, with sixty digits more than the residual lies below its terms."""
    below = (order + 1) * max(0, math.ceil(-math.log10(parameters.epsilon)))
    ctx, constants, speed = _numbers(parameters, omega, bits_for_digits(60 + below))
    places = [[quotient(ctx, part) for part in point] for point in POINTS]
    rows = [
        [abs(value) for value in invariance_residuals(ctx, constants, speed, place[0], place[1], order)]
        for place in places
    ]
    return tuple(float(max(column)) for column in zip(*rows, strict=True))


def _best_order(parameters: Parameters, omega: Fraction, highest: int = 10) -> tuple[int, float]:
    """Over the fixed points: where the largest term of each order is smallest."""
    ctx, constants, speed = _numbers(parameters, omega, 120)
    largest = [0.0] * (highest + 1)
    for point in POINTS:
        place = [quotient(ctx, part) for part in point]
        for n, value in enumerate(orders(ctx, constants, speed, place[0], place[1], highest)):
            largest[n] = max(largest[n], float(abs(value) * constants.epsilon**n))
    best = min(range(1, highest + 1), key=largest.__getitem__)
    return best, largest[best]
