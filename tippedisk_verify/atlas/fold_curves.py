"""Curves of folds of librating cycles in the plane of one parameter and the speed, in double, by continuation.

Their parameter is the abscissa s of `librating_family`, with gamma_bar_0 = pi tanh(s). A family never turns back in
it, so neither does a curve of folds, although it may in the disk's parameter. Such a curve begins at a Bautin point,
s = 0, or at the range's border, and ends there too or where the saddle value vanishes on the curve of Omega_h, at
infinite s. It approaches that point with all its derivatives, so it is followed until doubles hold no more of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy
from scipy.interpolate import krogh_interpolate

from tippedisk_verify.cycles.folds import LibrationFold, fold_in, fold_system, fold_to_digits
from tippedisk_verify.cycles.librating_family import amplitude
from tippedisk_verify.cycles.newton import Stop
from tippedisk_verify.cycles.return_map import Image, ReturnMap
from tippedisk_verify.cycles.section import LIBRATING
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE
from tippedisk_verify.theory.hopf import omega_crit

__all__ = ["Nodes", "Plane", "Trace", "fold_at", "fold_traces"]

_LEAST, _MOST = 0.03, 4.0  # of s: amplitudes from 0.1 rad to 2e-3 rad below pi
_FIRST_STEP, _LONGEST_STEP, _SHORTEST_STEP = 0.01, 0.1, 1e-4
_BEND = 1e-3  # how far a prediction may be off; the next step is longer if it was a sixteenth of that (fourth order)
_PREDICTED_FROM = 4  # points, by the cubic through them
_DIFFERENCE = 1e-4  # of unknowns of order one, and less where the cycles come close to the saddles
_SETTLED = 1e-9  # of a step; points are corrected to more digits later
_GRID = 10**12  # shares of a range at which points lie
_SAME = 1e-2  # two folds this close in (v / a, Omega, share of the range) are one


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

    def value(self, share: float | Fraction) -> Fraction:
        """The parameter at a share of the range."""
        return self.lowest + (self.highest - self.lowest) * Fraction(share)

    def decimal(self, share: float) -> Fraction:
        """The same to some twelve digits: a decimal, if the range's ends are, and within the range."""
        return self.value(Fraction(min(max(0, round(share * _GRID)), _GRID), _GRID))

    def share(self, value: Fraction) -> float:
        """The share of the range at a value."""
        return float((value - self.lowest) / (self.highest - self.lowest))


@dataclass(frozen=True)
class Nodes:
    """A curve in double through nodes that are close together: values against a rising abscissa."""

    at: Any  #: (n,)
    values: Any  #: (n, k)

    def __call__(self, where: float) -> Any:
        """(k,) at an abscissa, by the polynomial through the six nearest nodes."""
        first = max(0, min(int(numpy.searchsorted(self.at, where)) - 3, len(self.at) - 6))
        return krogh_interpolate(self.at[first : first + 6], self.values[first : first + 6], where)

    def without(self, k: int) -> Nodes:
        """The same without one of the nodes."""
        return Nodes(numpy.delete(self.at, k), numpy.delete(self.values, k, axis=0))


class Trace(Nodes):
    """A curve of folds: against s the numbers (v_0 / gamma_bar_0, Omega, share of the parameter's range).

    An end beyond the range's border has one node beyond it.
    """

    @property
    def cut_short(self) -> list[float]:
        """The shares at which it was followed no further: its ends inside the range that are no Bautin point."""
        ends = (self.values[-1], *((self.values[0],) if self.at[0] > _LEAST else ()))
        return [float(point[2]) for point in ends if 0 < point[2] < 1]

    def passes(self, s: float, point: Any) -> bool:
        return bool(self.at[0] <= s <= self.at[-1] and numpy.abs(self(s) - point).max() < _SAME)


def fold_at(plane: Plane, s: float, point: Any, engine: Engine, digits: int) -> LibrationFold:
    """The fold next to a point of a trace, of a disk with a decimal parameter, its speed to ``digits`` digits.

    Raises AccuracyError or InputError if it is not found, or another one is.
    """
    a, failure = float(amplitude(s)), AccuracyError("the iteration for the fold arrives at another one")
    # Between its points a trace is good to some eight digits, too few for cycles that come close to the saddles.
    for refined in (False, True):
        try:
            ratio, omega, share = map(float, _fold_at(plane, engine, s, point) if refined else point)
            disk, guess = plane.at(plane.decimal(share)), (a, ratio * a, omega)
            fold: LibrationFold = fold_in(LibrationFold, disk, guess, engine, DOUBLE)
            if fold.omega.uncertainty > fold.omega.value / 10**digits:
                guess = float(fold.gamma_bar_0), float(fold.v_0), float(fold.omega)
                fold = fold_to_digits(LibrationFold, disk, guess, engine, digits)
            if abs(float(fold.gamma_bar_0) - a) < _SAME * min(a, math.pi - a):
                return fold
        except (InputError, AccuracyError) as fault:
            failure = AccuracyError(str(fault))
        except numpy.linalg.LinAlgError:
            failure = AccuracyError("the conditions of the fold are singular in double")
    raise failure


def fold_traces(
    plane: Plane, seeds: Iterable[tuple[float, Any]], bautin: Sequence[float], engine: Engine
) -> list[Trace]:
    """The curves of folds through the seeds, each (s, point as in `Trace`), and through Bautin points.

    The latter are given as shares of the range. A seed that lies on a curve already followed starts no other.
    """
    traces: list[Trace] = []
    for s, point in [*((_LEAST, _small_fold(plane, share)) for share in bautin), *seeds]:
        if not any(trace.passes(s, point) for trace in traces):
            traces += _from_seed(plane, engine, s, point)
    return traces


def _small_fold(plane: Plane, share: float) -> Any:
    """What the folds next to a Bautin point tend to: small oscillations at Omega_crit."""
    disk = plane.at(plane.value(share))
    crit = float(omega_crit(disk))
    return numpy.array([-float(disk.e / (disk.r + disk.e)) * crit, crit, share])


def _from_seed(plane: Plane, engine: Engine, s: float, seed: Any) -> list[Trace]:
    """The curve in both directions, as one trace; none where the seed is no fold that double can tell."""

    def solve(at: float, guess: Any) -> Any:
        return _fold_at(plane, engine, at, guess)

    try:
        start = solve(s, seed)
    except (InputError, AccuracyError, numpy.linalg.LinAlgError):
        return []
    falling, rising = (_followed(solve, s, start, end) for end in (_LEAST, _MOST))
    nodes = [*falling[:0:-1], *rising]
    if len(nodes) < 2:
        return []
    return [Trace(numpy.array([at for at, _ in nodes]), numpy.array([point for _, point in nodes]))]


def _followed(solve: Callable[[float, Any], Any], start: float, point: Any, end: float) -> list[tuple[float, Any]]:
    """From ``start`` towards ``end``, until no step succeeds or a point is beyond the range; that one is the last.

    Each point is predicted by the polynomial through those before it and corrected by ``solve``; how far the two are
    apart decides the next step.
    """
    at, points = [start], [point]
    step = math.copysign(_FIRST_STEP, end - start)
    # A start on the border may lie beyond it by rounding.
    while at[-1] != end and (len(at) == 1 or 0 <= points[-1][2] <= 1) and abs(step) > _SHORTEST_STEP:
        where = at[-1] + step if (end - at[-1] - step) * step > 0 else end
        predicted = krogh_interpolate(at[-_PREDICTED_FROM:], points[-_PREDICTED_FROM:], where)
        try:
            corrected = solve(where, predicted)
            off = float(numpy.abs(corrected - predicted).max())
        except (InputError, AccuracyError, numpy.linalg.LinAlgError):
            off = math.inf
        if not off < _BEND:
            step /= 2
            continue
        at.append(where)
        points.append(corrected)
        if off < _BEND / 16:
            step = math.copysign(min(2 * abs(step), _LONGEST_STEP), step)
    return list(zip(at, points, strict=True))


def _fold_at(plane: Plane, engine: Engine, s: float, guess: Any) -> Any:
    """(v_0 / gamma_bar_0, Omega, share) of the fold of that amplitude, by Newton's iteration on three conditions."""
    a, slope = float(amplitude(s)), 1 / math.cosh(s) ** 2  # the slope of a / pi by s
    scales = numpy.array([a, 1.0, 1.0])  # of v_0, Omega and the share

    def mapped(at: Sequence[float]) -> Image:
        return ReturnMap(LIBRATING, plane.at(plane.value(at[3])), at[2], engine)(at[:2])

    iteration = Stop(8, AccuracyError("the iteration for a fold of given amplitude does not settle"),
                                small=_SETTLED * slope)  # fmt: skip
    unknowns = numpy.array(guess, dtype=float)
    while True:
        at = [a, *(unknowns * scales).tolist()]
        shifts = [None, abs(at[1]) * _DIFFERENCE, slope**2 * _DIFFERENCE, slope**2 * _DIFFERENCE]
        conditions, jacobian = fold_system(mapped, at, shifts)
        step = numpy.linalg.solve(jacobian, conditions) / scales
        unknowns = unknowns - step
        if iteration.converged(float(numpy.abs(step).max())):
            return unknowns
