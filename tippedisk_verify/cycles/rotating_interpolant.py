"""The family of rotating limit cycles as a function of Omega, for many of them at once in double.

With sigma = sqrt(Omega - Omega_fold), negative for the stable ones, the family is analytic through its fold, and close
to Omega_h it is a series in powers and logarithms of sigma_h + sigma, where -sigma_h is sigma at Omega_h. So one
polynomial in s = log(sigma_h + sigma) through Chebyshev nodes serves stable and unstable ones, and predicts them so
well that one Newton step of all lanes is mostly enough.

Half-widths come from `branch_budget`, on either side of the fold by itself. What doubles do not hold to twelve digits,
next to the fold and to Omega_h, is not claimed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy

from tippedisk_verify.cycles.batch_shooting import ROTATING, Guess, RotatingCycles, corrected, measured_cycles
from tippedisk_verify.cycles.branch_budget import BranchBudget
from tippedisk_verify.cycles.limit_cycle import RotatingCycle
from tippedisk_verify.cycles.rotating_family import RotatingFamily, RotationPoint
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.flow.lanes import BatchTaylor, field_constants
from tippedisk_verify.model.arrays import Array

__all__ = ["RotatingInterpolant"]

_NODES_PER_UNIT, _FEWEST_NODES = 12, 16  # of s; interpolation then errs by some roundings
_NEAREST = 1.2e-4  # of Omega_h, the least distance from it: closer, and doubles do not hold T to twelve digits
_HELD = 1e-12  # the relative half-width of a number with twelve digits
_EVERY = 3  # nodes between those where rounding is measured
_AROUND_THE_FOLD = 3  # points on either side that tell where it is, to rounding if they are nodes
_TRIES = 4  # at the nodes
_FLAT = 0.01  # d(Omega) by arclength; |sigma| is some 1e-3 there, and Omega at the fold known to some 1e-10
_NEWTON_STEPS = 8  # from a point next to the fold to where the slope is zero


class RotatingInterpolant:
    """The part of a family, of the linear law, that holds the cycles at ``speeds`` [rad/s], ``stable`` or not (n,).

    Raises NoSuchCycleError if the family does not reach the highest speed.
    """

    def __init__(self, family: RotatingFamily, lanes: BatchTaylor, speeds: Array, stable: Any) -> None:
        self.parameters, self._lanes = family.parameters, lanes
        self._constants = field_constants(family.parameters)
        family.guess(float(speeds.max()), stable=False)  # so that its points reach as far
        points = list(family.points)
        self._omega_h, self._fold = float(family.omega_h), _lowest(points)
        self._sigma_h = math.sqrt(self._omega_h - self._fold)
        self._budgets: dict[bool, BranchBudget] = {}
        within = self._within(speeds, stable)
        if not within.any():
            return
        if (highest := speeds[within & stable].max(initial=0.0)) > points[0].omega:
            with suppress(NoSuchCycleError):
                points.insert(0, family.nearer(float(highest)))
        s = self._abscissas(speeds[within], stable[within])
        # A little room at both ends, where the polynomial is at its worst.
        self._solve(points, s.min() - 0.02, s.max() + 0.02)

    def cycles(self, speeds: Array, stable: Any) -> list[RotatingCycle | None]:
        """Each cycle with its half-widths; None for those that doubles in lanes do not hold to twelve digits."""
        held_cycles: list[RotatingCycle | None] = [None] * len(speeds)
        for side, budget in self._budgets.items():
            which = numpy.flatnonzero((stable == side) & self._within(speeds, stable))
            s = self._abscissas(speeds[which], stable[which])
            # Rounding has been measured no closer to the fold than at the nodes.
            inside = numpy.abs(self._sigma(s)) >= numpy.abs(self._sigma(budget.s)).min()
            which, s = which[inside], s[inside]
            if not len(which):
                continue
            guess = Guess(*(self._ratios(s) @ self._known).T)
            solved = corrected(self._constants, speeds[which], guess, self._lanes, section=ROTATING)
            widths = budget.all_half_widths(solved, s)
            held = solved.converged
            for name in ("period", *ROTATING.names, "beta_max"):
                held &= widths[name] <= _HELD * numpy.abs(getattr(solved, name))
            widths = {name: width[held] for name, width in widths.items()}
            measured = measured_cycles(solved.only(held), widths, ROTATING, self.parameters)
            for index, cycle in zip(which[held].tolist(), measured, strict=True):
                held_cycles[index] = cycle if cycle.stable is side else None  # or else it is the one beyond the fold
        return held_cycles

    # ------------------------------------------------------------------------------------------------- the abscissa
    def _within(self, speeds: Array, stable: Any) -> Any:
        """Which cycles lie beyond the fold, and far enough from Omega_h."""
        return (speeds > self._fold) & ~(stable & (speeds > self._omega_h * (1 - _NEAREST)))

    def _abscissas(self, speeds: Array, stable: Any) -> Array:
        """s, without loss of digits next to Omega_h."""
        size = self._sigma_h + numpy.sqrt(speeds - self._fold)
        return numpy.log(numpy.where(stable, (self._omega_h - speeds) / size, size))

    def _sigma(self, s: Array) -> Array:
        return numpy.exp(s) - self._sigma_h

    def _scale(self, cycles: Any, s: Array) -> Array:
        """What sensitivities, which have a pole at the fold, are multiplied by where they are interpolated."""
        sigma = numpy.abs(self._sigma(s))
        return sigma / (self._sigma_h + sigma)

    # ------------------------------------------------------------------------------------------------- the nodes
    def _solve(self, points: Sequence[RotationPoint], bottom: float, top: float) -> None:
        """The nodes and their budgets; there are none if a node is not found."""
        fewest = max(_FEWEST_NODES, math.ceil(_NODES_PER_UNIT * (top - bottom)))
        # A few more if that keeps them away from the fold, where a cycle at a given speed is badly conditioned.
        count = max(range(fewest, fewest + 4), key=lambda n: numpy.abs(self._sigma(_chebyshev(bottom, top, n))).min())
        s = _chebyshev(bottom, top, count)
        sigma = self._sigma(s)
        stable, omegas = sigma < 0, self._fold + sigma**2
        known = list(points)
        for _ in range(_TRIES):
            guess = Guess(*self._between(known)(s).T)
            nodes = corrected(self._constants, omegas, guess, self._lanes, section=ROTATING)
            if nodes.converged.all():
                break
            # Stiff disks ask for better guesses: those that were found lead to their neighbours.
            known = [*points, *(_point(nodes, k, stable[k]) for k in numpy.flatnonzero(nodes.converged).tolist())]
        else:
            return
        # The nodes tell to more digits than the family's points where the fold is, and s feels that.
        if min(stable.sum(), (~stable).sum()) >= _AROUND_THE_FOLD:
            self._fold = _lowest([_point(nodes, k, stable[k]) for k in range(count)])
            self._sigma_h = math.sqrt(self._omega_h - self._fold)
        self._s, self._known = self._abscissas(omegas, stable), ROTATING.guess(nodes).T
        angles = (2 * numpy.arange(count) + 1) * numpy.pi / (2 * count)
        self._weights = (-1.0) ** numpy.arange(count) * numpy.sin(angles)
        for side in (True, False):
            if (which := stable == side).any():
                self._budgets[side] = self._budget(nodes.only(which), self._s[which], side)

    def _budget(self, nodes: RotatingCycles, s: Array, stable: bool) -> BranchBudget:
        room = nodes.omega - self._fold
        if stable:
            room = numpy.minimum(room, self._omega_h - nodes.omega)
        return BranchBudget(
            self._constants, nodes, s, room, self._lanes, section=ROTATING, every=_EVERY, scale=self._scale
        )

    def _between(self, points: Sequence[RotationPoint]) -> Any:
        """(beta_bar, v, T) over s by cubics between points of the family."""
        from scipy.interpolate import CubicHermiteSpline

        # Next to the fold sigma is lost in rounding.
        told = [point for point in points if abs(point.tangent[2]) > _FLAT]
        told.sort(key=lambda point: math.copysign(point.omega - self._fold, point.tangent[2]))
        omegas, slopes = numpy.array([(point.omega, point.tangent[2]) for point in told]).T
        s = self._abscissas(omegas, slopes < 0)
        values = numpy.array([(*point.at[:2], point.period) for point in told])
        rates = numpy.array([(*point.tangent[:2], point.period_rate) for point in told])
        return CubicHermiteSpline(s, values, rates * (2 * self._sigma(s) * numpy.exp(s) / slopes)[:, None])

    def _ratios(self, s: Array) -> Any:
        """Barycentric weights of every node for every abscissa, (n, nodes); each row sums to 1."""
        away = s[:, None] - self._s
        away[away == 0] = 2.0**-80  # at a node nothing else counts
        ratios = self._weights / away
        return ratios / ratios.sum(axis=1, keepdims=True)


def _chebyshev(bottom: float, top: float, count: int) -> Any:
    """Nodes of the polynomial of that degree, falling."""
    angles = (2 * numpy.arange(count) + 1) * numpy.pi / (2 * count)
    return (top + bottom) / 2 + (top - bottom) / 2 * numpy.cos(angles)


def _point(cycles: RotatingCycles, index: int, stable: bool) -> RotationPoint:
    """One of them as a point of the family."""
    names = ("beta_bar_top", "v_top", "omega", "dbeta_bar_top_domega", "dv_top_domega", "period", "dperiod_domega")
    beta, v, omega, beta_rate, v_rate, period, period_rate = (float(getattr(cycles, name)[index]) for name in names)
    share = (-1 if stable else 1) / math.hypot(beta_rate, v_rate, 1.0)
    return RotationPoint((beta, v, omega), (share * beta_rate, share * v_rate, share), period, share * period_rate)


def _lowest(points: Sequence[RotationPoint]) -> float:
    """Omega at the fold, by the polynomial through the points next to it and their slopes.

    Its variable is the way along the direction that the family has at the lowest point.
    """
    middle = min(range(len(points)), key=lambda k: points[k].omega)
    here, near = points[middle], points[max(0, middle - _AROUND_THE_FOLD) : middle + _AROUND_THE_FOLD + 1]
    away = numpy.array([point.at for point in near]) - here.at
    along = away @ here.tangent
    size = numpy.abs(along).max()
    slopes = [size * point.tangent[2] / numpy.dot(point.tangent, here.tangent) for point in near]
    degree = 2 * len(near) - 1
    powers = numpy.vander(along / size, degree + 1)
    rates = numpy.zeros_like(powers)
    rates[:, :-1] = powers[:, 1:] * numpy.arange(degree, 0, -1)
    polynomial = numpy.linalg.solve(numpy.vstack((powers, rates)), [*away[:, 2], *slopes])
    slope = numpy.polyder(polynomial)
    turn = 0.0
    for _ in range(_NEWTON_STEPS):
        turn -= numpy.polyval(slope, turn) / numpy.polyval(numpy.polyder(slope), turn)
    return here.omega + float(numpy.polyval(polynomial, turn))
