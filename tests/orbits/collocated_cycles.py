"""The disk's librating cycles and their folds by collocation: a continuation independent of the package.

The equations are written out once more, in the terms of the paper. Nothing is shot, expanded or averaged.

With the angles measured from inverted spinning the field is odd, so that a cycle of amplitude a = gamma_bar(0) is a
times some z, where z, Omega and the period are smooth functions of a^2, down to a = 0. They are followed in
u = -log(1 - (a/pi)^2), which runs from 0 at the Hopf point to infinity at the connection.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy
from scipy.optimize import brentq

from tests.orbits.collocation import Array, Field, Mesh, Number, Solution, estimated, solve

_TINY = 1e-30  # of a complex step: its square is lost against 1
_COARSE = Mesh(24)  # for guesses


class Disk(NamedTuple):
    """The paper's Table 1, with g = 9.81 [SI units]."""

    r: float = 0.045
    e: float = 2.5e-3
    m: float = 0.435
    A: float = 0.249e-3
    B: float = 0.227e-3
    g: float = 9.81
    mu: float = 0.3
    epsilon: float = 0.1

    @classmethod
    def of(cls, values: Array) -> Disk:
        """The disk with these eight parameters."""
        return cls(*values.tolist())


def rates(disk: Disk, Omega: Any, state: Array) -> Array:
    """Eqs. 3DOF, kin_3DOF and lin_lambda_y_3DOF for rows (beta - pi/2, gamma - pi/2, v); of complex numbers too."""
    r, e, m, A, B, g, mu, epsilon = disk
    beta_bar, gamma_bar, v = state
    # Sines and cosines of the paper's own angles.
    sb, cb, sg, cg = numpy.cos(beta_bar), -numpy.sin(beta_bar), numpy.cos(gamma_bar), -numpy.sin(gamma_bar)
    Bbar = B - m * e**2
    arm = r + e * sg
    inertia = A * cg**2 + Bbar * sg**2
    M = inertia + m * arm**2 * cb**2
    h = (
        inertia * Omega**2 * sb * cb
        - 2 * (A - Bbar) * Omega * v * cb * sg * cg
        + m * arm**2 * v**2 * sb * cb
        + m * e * arm * Omega**2 * sb * cb**3 * sg
        - m * e * arm * (3 * sb**2 - 2) * Omega * v * cb * cg
    )
    f_G = -m * g * arm * cb
    gamma_y = arm * v * sb - e * Omega * sb**2 * cg
    return numpy.array([v, -Omega * cb, (h + f_G - arm * sb * mu * m * g / epsilon * gamma_y) / M])


def linearised(disk: Disk, Omega: float, gamma_bar: float) -> Array:
    """The Jacobian at inverted spinning (gamma_bar = 0) or a noninverted state (gamma_bar = pi), by complex steps."""
    start = numpy.array([0.0, gamma_bar, 0.0])
    columns = [rates(disk, Omega, start + 1j * _TINY * unit).imag / _TINY for unit in numpy.eye(3)]
    return numpy.array(columns).T


def hopf(disk: Disk) -> tuple[float, float]:
    """Omega_crit and the frequency there [rad/s], where Routh and Hurwitz see the first change of sign."""

    def hurwitz(Omega: float) -> float:
        _, second, first, none = numpy.poly(linearised(disk, Omega, 0.0)).real
        return float(second * first - none)

    speeds = math.sqrt(disk.g / disk.r) * numpy.geomspace(0.1, 100, 400)
    signs = numpy.sign([hurwitz(speed) for speed in speeds])
    change = int(numpy.flatnonzero(numpy.diff(signs))[0])
    Omega = brentq(hurwitz, speeds[change], speeds[change + 1], xtol=1e-13, rtol=1e-15)  # rounding at 30
    return float(Omega), math.sqrt(numpy.poly(linearised(disk, Omega, 0.0))[2].real)


def amplitude(u: Any) -> Any:
    """The a = gamma_bar(0) that belongs to u; also of a complex step."""
    return math.pi * numpy.sqrt(-numpy.expm1(-u))


def parameter(a: float) -> float:
    """The u that belongs to an amplitude a."""
    return -math.log1p(-((a / math.pi) ** 2))


def cycle_field(disk: Disk) -> Field:
    """d(z)/d(time/(T/2)) with z = state / a; unknowns T/2, Omega, u."""

    def field(z: Array, unknowns: Array) -> Array:
        half, Omega, u = unknowns[:3]
        a = amplitude(u)
        return half * rates(disk, Omega, a * z) / a

    return field


def cycle_conditions(z0: Array, z1: Array) -> Array:
    """At the start beta_bar = 0 and gamma_bar = a; half a period later the state is the opposite one."""
    return numpy.array([z0[0], z0[1] - 1, *(z1 + z0)])


class Cycle(NamedTuple):
    """A librating cycle; ``solution`` has z = state / a over half a period and the unknowns T/2, Omega, u."""

    gamma_bar_0: Number  #: amplitude a [rad]
    omega: Number  #: [rad/s]
    period: Number  #: [s]
    v_0: Number  #: v where beta = pi/2 and gamma_bar = a [rad/s]
    solution: Solution


def solve_cycle(disk: Disk, mesh: Mesh, guess: Solution, which: int, value: float) -> Solution:
    """The cycle with a given Omega (``which`` = 1) or u (``which`` = 2)."""

    def conditions(z0: Array, z1: Array, unknowns: Array) -> Array:
        return numpy.append(cycle_conditions(z0, z1), unknowns[which] - value)

    return solve(cycle_field(disk), conditions, mesh, guess)


def born(disk: Disk, mesh: Mesh) -> Solution:
    """The limit of the cycles at the Hopf point, u = 0: gamma_bar' = Omega beta_bar and beta_bar' = v."""
    Omega, frequency = hopf(disk)
    times = mesh.times()
    cosine, sine = numpy.cos(math.pi * times), numpy.sin(math.pi * times)
    values = numpy.array([-frequency / Omega * sine, cosine, -(frequency**2) / Omega * cosine])
    return Solution(times, values, numpy.array([math.pi / frequency, Omega, 0.0]))


def family(disk: Disk, u_last: float, mesh: Mesh = _COARSE) -> list[Solution]:
    """The cycles from the Hopf point to a given u, each predicted by a cubic through the last four.

    All on one mesh: they serve as guesses.
    """
    found = [born(disk, mesh)]
    for u in numpy.append(numpy.arange(min(1e-4, u_last / 2), u_last - 0.05, 0.15), u_last):
        last = found[-4:]
        at = [one.unknowns[2] for one in last]
        shares = [math.prod((u - b) / (a - b) for b in at if b != a) for a in at]
        values = sum(share * one.values for share, one in zip(shares, last, strict=True))
        unknowns = sum(share * one.unknowns for share, one in zip(shares, last, strict=True))
        guess = Solution(last[0].times, values, numpy.append(unknowns[:2], u))
        found.append(solve_cycle(disk, mesh, guess, 2, u))
    return found


def _cycle(disk: Disk, which: int, value: float, intervals: int, guess: Solution) -> Cycle:
    solution, errors = estimated(
        lambda inputs, *run: solve_cycle(Disk.of(inputs), *run, which, value), disk, intervals, guess
    )
    half, Omega, u = solution.unknowns
    a, v = float(amplitude(u)), solution.values[2, 0]
    a_error = math.pi**2 * math.exp(-u) / (2 * a) * errors[2]  # da/du
    return Cycle(
        Number.of(a, a_error),
        Number.of(Omega, errors[1]),
        Number.of(2 * half, 2 * errors[0]),
        Number.of(a * v, a * errors[5] + abs(v) * a_error),
        solution,
    )


def cycle_of_amplitude(disk: Disk, a: float, intervals: int = 32) -> Cycle:
    """The librating cycle on which gamma_bar is a where beta = pi/2, 0 < a < pi."""
    u = parameter(a)
    return _cycle(disk, 2, u, intervals, family(disk, u)[-1])


def cycles_at_speed(disk: Disk, Omega: float, intervals: int = 32, u_max: float = 5.0) -> list[Cycle]:
    """All librating cycles at a speed with u below ``u_max``, by amplitude."""
    return [
        _cycle(disk, 1, Omega, intervals, other)
        for one, other in pairwise(family(disk, u_max))
        if (one.unknowns[1] - Omega) * (other.unknowns[1] - Omega) <= 0
    ]


class Fold(NamedTuple):
    """A fold; ``solution`` has z and dz/du, and the unknowns T/2, Omega, u, d(T/2)/du and the parameter's share."""

    disk: Disk  #: with the value found, if a parameter was free
    value: Number  #: of the named parameter
    omega: Number  #: [rad/s]
    gamma_bar_0: Number  #: [rad]
    period: Number  #: [s]
    solution: Solution


def solve_fold(disk: Disk, mesh: Mesh, guess: Solution, name: str, which: int, value: float) -> Solution:
    """The cycle with dOmega/du = 0, with a given u (``which`` = 2) or share of a parameter (``which`` = 4).

    The variational equation is the derivative of the cycle's along (z, T/2, Omega, u) by (dz/du, d(T/2)/du, 0, 1),
    which a complex step takes to the last digit.
    """

    def tangent(unknowns: Array) -> Array:
        half, Omega, u, half_slope, _ = unknowns
        return numpy.array([half + 1j * _TINY * half_slope, Omega, u + 1j * _TINY])

    def field(both: Array, unknowns: Array) -> Array:
        changed = disk._replace(**{name: getattr(disk, name) * unknowns[4]})
        rate = cycle_field(changed)(both[:3] + 1j * _TINY * both[3:], tangent(unknowns))
        return numpy.concatenate([rate.real, rate.imag / _TINY])

    def conditions(start: Array, end: Array, unknowns: Array) -> Array:
        met = cycle_conditions(*(both[:3] + 1j * _TINY * both[3:] for both in (start, end)))
        return numpy.concatenate([met.real, met.imag / _TINY, [unknowns[which] - value]])

    return solve(field, conditions, mesh, guess)


def fold_guesses(disk: Disk, u_max: float = 5.0) -> list[Solution]:
    """Starts for `solve_fold`, one for each extremum of Omega in the family, the one of least amplitude first."""
    along, guesses = family(disk, u_max), []
    for three in zip(along, along[1:], along[2:], strict=False):
        before, here, after = (one.unknowns[1] for one in three)
        if (here - before) * (after - here) > 0:
            continue
        # The parabola through the three, and where its Omega is extreme.
        powers = numpy.vander([one.unknowns[2] for one in three], 3, increasing=True)
        unknowns = numpy.linalg.solve(powers, [one.unknowns for one in three])
        values = numpy.linalg.solve(powers, [one.values.ravel() for one in three])
        u = -unknowns[1, 1] / (2 * unknowns[2, 1])
        here, slope = numpy.array([1, u, u**2]), numpy.array([0, 1, 2 * u])
        both = numpy.concatenate([here @ values, slope @ values]).reshape(6, -1)
        guesses.append(Solution(three[0].times, both, numpy.append(here @ unknowns, [(slope @ unknowns)[0], 1.0])))
    return guesses


def _fold(disk: Disk, name: str, which: int, value: float, intervals: int, guess: Solution) -> Fold:
    solution, errors = estimated(
        lambda inputs, *run: solve_fold(Disk.of(inputs), *run, name, which, value), disk, intervals, guess
    )
    half, Omega, u, _, share = solution.unknowns
    a, whole = float(amplitude(u)), getattr(disk, name)
    return Fold(
        disk._replace(**{name: float(share * whole)}),
        Number.of(share * whole, errors[4] * whole),
        Number.of(Omega, errors[1]),
        Number.of(a, math.pi**2 * math.exp(-u) / (2 * a) * errors[2]),
        Number.of(2 * half, 2 * errors[0]),
        solution,
    )


def folds(disk: Disk, intervals: int = 24) -> list[Fold]:
    """All folds of the librating family with u below 5, the one of least amplitude first."""
    return [_fold(disk, "A", 4, 1.0, intervals, guess) for guess in fold_guesses(disk)]


def fold_of_amplitude(disk: Disk, name: str, a: float, guess: Fold, intervals: int = 24) -> Fold:
    """The fold of a given amplitude, with the named parameter free, from a fold next to it on the curve.

    With a down to 0 it is the road to the Bautin point: all unknowns are smooth functions of a^2 there.
    """
    share = getattr(guess.disk, name) / getattr(disk, name)
    start = guess.solution._replace(unknowns=numpy.append(guess.solution.unknowns[:4], share))
    return _fold(disk, name, 2, parameter(a), intervals, start)


def fold_curve(disk: Disk, name: str, values: Sequence[float], intervals: int = 24) -> list[Fold]:
    """The fold of least amplitude at the first value of the named parameter, continued to the others in turn.

    Where Newton's method does not reach the next value from the last one, it goes by way of their mean. Raises
    ArithmeticError if the first disk has no fold, or where the curve does not reach a value.
    """
    guesses = fold_guesses(disk._replace(**{name: values[0]}))
    if not guesses:
        raise ArithmeticError(f"no fold at {name} = {values[0]}")
    found: list[Fold] = []
    start, last = guesses[0], values[0]
    for value in values:
        found.append(_continued(disk, name, value, intervals, start, last))
        start, last = found[-1].solution, value
    return found


def _continued(
    disk: Disk, name: str, value: float, intervals: int, start: Solution, last: float, halvings: int = 6
) -> Fold:
    """The fold at one value of a parameter, from the one at the last value."""
    start = start._replace(unknowns=numpy.append(start.unknowns[:4], 1.0))
    try:
        return _fold(disk._replace(**{name: value}), name, 4, 1.0, intervals, start)
    except ArithmeticError:
        if not halvings:
            raise
    middle = (last + value) / 2
    half_way = _continued(disk, name, middle, intervals, start, last, halvings - 1)
    return _continued(disk, name, value, intervals, half_way.solution, middle, halvings - 1)
