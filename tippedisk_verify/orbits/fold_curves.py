"""Curves of folds of librating cycles in a plane of one parameter and the speed, in double, by continuation.

The amplitude parametrises them. With a = gamma_bar_0 and u = -log(1 - (a / pi)^2) the librating family of a disk is a
smooth curve Omega(u) from the Hopf point, u = 0, to the connection of the saddles, u = infinity, and its folds are the
zeros of dOmega/du. A curve of folds therefore cannot turn back in u where it turns back in the parameter; it begins at
a Bautin point, u = 0, at the range's border, or where u is so large that its speed is Omega_h to the digits of doubles.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy

from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE
from tippedisk_verify.orbits.half_map import HalfFlights
from tippedisk_verify.orbits.newton import NewtonIteration
from tippedisk_verify.theory.hopf import omega_crit

__all__ = ["FamilyScan", "Plane", "Trace", "amplitude", "fold_traces", "interpolated", "scanned"]

_LEAST, _MOST = 1e-3, 9.0  # of u: amplitudes from 0.1 rad to 2e-4 rad below pi
_FIRST_STEP, _LONGEST_STEP, _HALVINGS = 1e-2, 0.25, 12
_BEND = 1e-3  # how far a prediction may be off; the next step is longer if it was a sixteenth of that (fourth order)
_PREDICTED_FROM = 4  # points, by the cubic through them
_DIFFERENCE = 1e-6  # of unknowns of order one
_SETTLED = 1e-9  # of a step; points are corrected to more digits later
_SEEN = 1e-2  # two folds this near in (v / a, Omega, parameter) are one


@dataclass(frozen=True)
class Plane:
    """One parameter of a disk over a range, against the speed."""

    parameters: Parameters  #: the disk that all others of the plane come from
    name: str  #: which parameter varies
    lowest: Fraction  #: [SI unit of the parameter]
    highest: Fraction

    def at(self, value: Fraction) -> Parameters:
        """The disk with that value; C, which enters no equation, is left out. Raises InputError as `Parameters`."""
        return self.parameters.changed(**{self.name: value, "C": None})

    def value(self, share: float) -> Fraction:
        """The parameter at a share of the range."""
        return self.lowest + (self.highest - self.lowest) * Fraction(share)


@dataclass(frozen=True)
class Trace:
    """Points of a smooth curve in the order of its parameter."""

    at: Any  #: (n,) values of the curve's parameter
    points: Any  #: (n, k)

    def __call__(self, where: float) -> Any:
        """(k,) at a value between the points, by the polynomial through the six nearest."""
        first = int(numpy.searchsorted(self.at, where)) - 3
        first = max(0, min(first, len(self.at) - 6))
        return interpolated(self.at[first : first + 6], self.points[first : first + 6], where)


@dataclass(frozen=True)
class FamilyScan:
    """The librating family of one disk: for each u the numbers (v_0 / a, Omega) and det(1 - P') / u."""

    share: float  #: where in the plane's range the disk is
    trace: Trace
    determinants: Any  #: (n,) zero at folds
    unstable_otherwise: bool  #: whether a multiplier of the half map is -1 or beyond it, or of a complex pair, somewhere


def amplitude(u: float) -> float:
    """gamma_bar_0 [rad]."""
    return math.pi * math.sqrt(-math.expm1(-u))


def interpolated(at: Any, points: Any, where: float) -> Any:
    """The polynomial through all points, at ``where`` (Neville's scheme)."""
    values = [numpy.asarray(point, dtype=float) for point in points]
    for reach in range(1, len(values)):
        for k in range(len(values) - reach):
            span = at[k + reach] - at[k]
            values[k] = ((where - at[k]) * values[k + 1] + (at[k + reach] - where) * values[k]) / span
    return values[0]


def scanned(plane: Plane, share: float, engine: Engine) -> FamilyScan:
    """The librating family of the disk at a share of the range, as far as double can follow it."""
    disk = plane.at(plane.value(share))
    crit = float(omega_crit(disk))
    slope = -float(disk.e / (disk.r + disk.e)) * crit  # v_0 / a of small oscillations
    maps: dict[float, Any] = {}

    def solve(u: float, guess: Any) -> Any:
        a, (ratio, omega) = amplitude(u), guess
        iteration = NewtonIteration(8, Shortfall("no cycle"), small=_SETTLED)
        while True:
            mapped = HalfFlights(disk, omega, engine, DOUBLE).map((a, ratio * a))
            (_, b), (_, d) = mapped.matrix
            jacobian = numpy.array([[b, mapped.by_omega[0] / a], [d - 1, mapped.by_omega[1] / a]])
            step = numpy.linalg.solve(jacobian, numpy.array(mapped.residual) / a)
            ratio, omega = ratio - step[0], omega - step[1]
            if iteration.converged(float(numpy.abs(step).max())):
                maps[u] = mapped.matrix
                return numpy.array([ratio, omega])

    trace = _traced(solve, _LEAST, numpy.array([slope, crit]), _MOST)
    kept = [maps[u] for u in trace.at.tolist()]
    multipliers = [numpy.linalg.eigvals(matrix) for matrix in kept]
    return FamilyScan(
        share,
        trace,
        numpy.array([_determinant(matrix) / u for matrix, u in zip(kept, trace.at.tolist(), strict=True)]),
        any(numpy.abs(pair[(pair.imag != 0) | (pair.real < 0)]).max(initial=0.0) >= 1 for pair in multipliers),
    )


def fold_traces(plane: Plane, scans: Sequence[FamilyScan], bautin: Sequence[float], engine: Engine) -> list[Trace]:
    """All curves of folds that begin at a Bautin point (shares of the range) or cross one of the disks scanned.

    Against u each has the numbers (v_0 / a, Omega, share of the range); an end beyond the border is one point beyond.
    """
    traces: list[Trace] = []
    for share in bautin:
        disk = plane.at(plane.value(share))
        crit = float(omega_crit(disk))
        start = numpy.array([-float(disk.e / (disk.r + disk.e)) * crit, crit, share])
        traces.append(_from_seed(plane, engine, _LEAST, start))
    for scan in scans:
        for k in numpy.flatnonzero(scan.determinants[1:] * scan.determinants[:-1] < 0):
            before, after = scan.determinants[k : k + 2]
            u = float(scan.trace.at[k] + (scan.trace.at[k + 1] - scan.trace.at[k]) * before / (before - after))
            seed = numpy.append(scan.trace(u), scan.share)
            if not any(_passes(trace, u, seed) for trace in traces):
                traces.append(_from_seed(plane, engine, u, seed))
    return [trace for trace in traces if len(trace.at) > 1]


def _passes(trace: Trace, u: float, seed: Any) -> bool:
    return bool(trace.at[0] <= u <= trace.at[-1] and numpy.abs(trace(u) - seed).max() < _SEEN)


def _from_seed(plane: Plane, engine: Engine, u: float, seed: Any) -> Trace:
    """The curve in both directions; empty where the seed is no fold that double can tell."""

    def solve(at: float, guess: Any) -> Any:
        return _fold_at(plane, engine, at, guess)

    def inside(point: Any) -> bool:
        return bool(0 <= point[2] <= 1)

    try:
        start = solve(u, seed)
    except (InputError, Shortfall):
        return Trace(numpy.array([]), numpy.array([]))
    up = _traced(solve, u, start, _MOST, inside)
    down = _traced(solve, u, start, _LEAST, inside)
    return Trace(numpy.concatenate((down.at[:0:-1], up.at)), numpy.concatenate((down.points[:0:-1], up.points)))


def _fold_at(plane: Plane, engine: Engine, u: float, guess: Any) -> Any:
    """(v_0 / a, Omega, share) of the fold of that amplitude, by Newton's iteration on its three conditions."""
    a = amplitude(u)

    def conditions(unknowns: Any) -> Any:
        ratio, omega, share = map(float, unknowns)
        mapped = HalfFlights(plane.at(plane.value(share)), omega, engine, DOUBLE).map((a, ratio * a))
        return numpy.array([mapped.residual[0] / a, mapped.residual[1] / a, _determinant(mapped.matrix) / u])

    iteration = NewtonIteration(8, Shortfall("no fold"), small=_SETTLED)
    unknowns = numpy.array(guess, dtype=float)
    while True:
        columns = []
        for axis in range(3):
            away = numpy.zeros(3)
            away[axis] = _DIFFERENCE
            columns.append((conditions(unknowns + away) - conditions(unknowns - away)) / (2 * _DIFFERENCE))
        step = numpy.linalg.solve(numpy.array(columns).T, conditions(unknowns))
        unknowns = unknowns - step
        if iteration.converged(float(numpy.abs(step).max())):
            return unknowns


def _determinant(matrix: Any) -> float:
    """det(1 - P')."""
    (a, b), (c, d) = matrix
    return float((1 - a) * (1 - d) - b * c)


def _traced(
    solve: Callable[[float, Any], Any],
    start: float,
    guess: Any,
    end: float,
    inside: Callable[[Any], bool] = lambda point: True,
) -> Trace:
    """From ``start`` towards ``end``, until no step succeeds or a point is outside; that one is the last.

    Each point is predicted by the polynomial through those before it and corrected by ``solve``; how far the two are
    apart decides the next step. Raises what ``solve`` raises at the start.
    """
    at, points = [start], [solve(start, guess)]
    step, halvings = math.copysign(_FIRST_STEP, end - start), 0
    if start < -step:
        step = -start / 4
    while at[-1] != end and inside(points[-1]) and halvings < _HALVINGS:
        where = at[-1] + step
        if (end - where) * step < 0:
            where = end
        predicted = interpolated(at[-_PREDICTED_FROM:], points[-_PREDICTED_FROM:], where)
        try:
            found = solve(where, predicted)
            off = float(numpy.abs(found - predicted).max())
        except (InputError, Shortfall, numpy.linalg.LinAlgError):
            off = math.inf
        if not off < _BEND:
            step, halvings = step / 2, halvings + 1
            continue
        at.append(where)
        points.append(found)
        halvings = 0
        if off < _BEND / 16:
            step = math.copysign(min(2 * abs(step), _LONGEST_STEP), step)
    order = numpy.argsort(at)
    return Trace(numpy.array(at)[order], numpy.array(points)[order])
