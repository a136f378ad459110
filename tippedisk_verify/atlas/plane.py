"""The plane of one parameter and the speed: Hopf, fold and heteroclinic curves, and the points of codimension two.

Some disks of the range tell what curves there are (`connection_curve`). Curves of folds are then followed by
amplitude (`fold_curves`), Omega_h by the parameter. Points of each curve, evenly spread over a curve of folds and even
in the parameter elsewhere, are corrected to the digits asked for. What cannot be had is listed with its reason.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import Any, NamedTuple

import numpy

from tippedisk_verify.atlas.connection_curve import (
    Missing,
    Sample,
    SpecialPoint,
    attempted,
    connected_runs,
    omega_h_near,
    sampled,
    special_points,
)
from tippedisk_verify.atlas.fold_curves import Nodes, Plane, Trace, fold_at, fold_traces
from tippedisk_verify.errors import InputError
from tippedisk_verify.flow import default_engine
from tippedisk_verify.model.decimals import decimal_magnitude, exact_text
from tippedisk_verify.model.exact import exact, shown
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import SYMBOLS, Parameters
from tippedisk_verify.model.precision import checked_digits
from tippedisk_verify.model.results import Printable, as_json
from tippedisk_verify.theory.bautin import BAUTIN_PARAMETERS, bautin_points
from tippedisk_verify.theory.hopf import omega_crit

__all__ = ["Atlas", "Curve", "CurvePoint", "atlas", "plane_of"]

MOST_POINTS = 10_000
_SAMPLES = 8  # of a trace for each of its points, to spread these
_CHUNK = 8  # points that a process computes at a time

Advance = Callable[[str, int], None]


@dataclass(frozen=True)
class CurvePoint:
    """A point of a curve: an exact value of the parameter, and the speed."""

    value: Fraction
    omega: Measured  #: Omega on the curve [rad/s]
    gamma_bar_0: Measured | None = None  #: gamma - pi/2 where beta = pi/2 and v < 0, of the cycle at a fold [rad]
    v_0: Measured | None = None  #: v = beta' there [rad/s]
    period: Measured | None = None  #: T, the period of the cycle at a fold [s]


@dataclass(frozen=True)
class Curve:
    """Points of one curve, in their order along it."""

    kind: str  #: hopf, fold or heteroclinic
    points: tuple[CurvePoint, ...]


@dataclass(frozen=True, repr=False)
class Atlas(Printable):
    """All that was found in the plane, and what was looked for in vain.

    Special points are bautin (where cycles are no longer born stable), neutral-saddle (on Omega_h, where the saddle
    value vanishes: curves of folds end there) and hopf-heteroclinic (where Omega_h = Omega_crit).
    """

    plane: Plane
    curves: tuple[Curve, ...]
    points: tuple[SpecialPoint, ...]
    missing: tuple[Missing, ...]

    def to_dict(self) -> dict[str, Any]:
        """As JSON; what is missing by kind: at how many values of the parameter, and why at the first of them."""
        plane, kinds = self.plane, dict.fromkeys(one.kind for one in self.missing)

        def told(point: CurvePoint | SpecialPoint) -> dict[str, Any]:
            entries = vars(point).items()
            return {
                plane.name if key == "value" else key: as_json(entry) for key, entry in entries if entry is not None
            }

        return {
            "plane": [plane.name, "Omega"],
            "range": [exact_text(plane.lowest), exact_text(plane.highest)],
            "parameters": plane.parameters.decimals(),
            "curves": [{"kind": curve.kind, "points": list(map(told, curve.points))} for curve in self.curves],
            "points": list(map(told, self.points)),
            "missing": [
                {
                    "kind": kind,
                    "count": len(mine),
                    "range": [exact_text(mine[0].value), exact_text(mine[-1].value)],
                    "reason": mine[0].reason,
                }
                for kind in kinds
                for mine in [[one for one in self.missing if one.kind == kind]]
            ],
        }


def plane_of(parameters: Parameters, axes: str, ends: tuple[object, object] | None) -> Plane:
    """The plane with axes such as "A,Omega", the parameter between two decimals.

    Without ends it goes a tenth of its value to both sides, as far as `Parameters` takes it. Raises InputError for
    axes or ends that are none.
    """
    name = axes.removesuffix(",Omega")
    if name not in SYMBOLS or name == axes:
        names = ", ".join(SYMBOLS)
        raise InputError(f"the plane '{shown(axes)}' is not known: give one of {names} and Omega, such as A,Omega")
    if ends is None:
        return Plane(parameters, name, *_around(parameters, name))
    if isinstance(ends, str) or len(ends) != 2:
        raise InputError(f"a range has two ends, the lowest value and the highest, not {shown(ends)}")
    low, high = map(exact, ends)
    if low.pi_multiple or high.pi_multiple:
        raise InputError("the ends of a range must be decimals")
    return Plane(parameters, name, low.rational, high.rational)


def _around(parameters: Parameters, name: str) -> tuple[Fraction, Fraction]:
    """The ends of the default range."""
    own: Fraction = getattr(parameters, name)
    unit = Fraction(10) ** (decimal_magnitude(own) - 3)

    def end(side: int) -> Fraction:
        for step in range(100, 0, -1):
            value = round(own * (1 + side * Fraction(step, 1000)) / unit) * unit
            with suppress(InputError):
                Plane(parameters, name, value, value).at(value)
                return value
        return own

    return end(-1), end(1)


def atlas(
    plane: Plane,
    *,
    points: int = 200,
    digits: int = 12,
    executor: Executor | None = None,
    advance: Advance = lambda label, steps: None,
) -> Atlas:
    """The atlas of the plane: so many ``points`` on each curve, their speeds to ``digits`` significant digits.

    Raises InputError for a number of points or digits that is not offered, a range that is none or leaves the disks
    that `Parameters` takes, and the smooth law.
    """
    plane.parameters.refuse_smooth("an atlas is")
    digits = checked_digits(digits)
    if isinstance(points, bool) or not isinstance(points, int) or not 5 <= points <= MOST_POINTS:
        raise InputError(f"a curve has 5 to {MOST_POINTS} points, not {shown(points)}")
    if not 0 < plane.lowest < plane.highest:
        raise InputError("a range must rise, from above zero: its lowest value is less than its highest")
    plane.at(plane.lowest), plane.at(plane.highest)  # between two admissible values all are
    work = partial(_all_done, executor=executor, advance=advance)
    bautin = _bautin_points(plane, digits)
    samples = sampled(plane, work)
    seeds = [fold for one in samples for fold in one.folds]
    traces = fold_traces(plane, seeds, [plane.share(point.value.value) for point in bautin], default_engine())
    answers: list[Any] = special_points(plane, samples, digits, work)
    curves = []
    for line in _lines(plane, samples, traces, points, digits):
        along = work(line.point, line.at, chunksize=_CHUNK)
        curves.append(Curve(line.kind, tuple(point for point in along if isinstance(point, CurvePoint))))
        answers += along
    missing = [
        *(reason for one in samples for reason in one.missing),
        *(answer for answer in answers if isinstance(answer, Missing)),
        *(
            Missing("fold", plane.decimal(float(point[2])), "one that this disk has was not followed")
            for s, point in seeds
            if not any(trace.passes(s, point) for trace in traces)
        ),
        *(
            Missing("fold", plane.decimal(share), "the curve could not be followed further in double")
            for trace in traces
            for share in trace.cut_short
        ),
    ]
    special = [*bautin, *(answer for answer in answers if isinstance(answer, SpecialPoint))]
    return Atlas(
        plane,
        tuple(curves),
        tuple(sorted(special, key=lambda point: point.value.value)),
        tuple(sorted(missing, key=lambda one: one.value)),
    )


def _all_done(
    function: Callable[[Any], Any],
    jobs: Sequence[Any],
    *,
    executor: Executor | None,
    advance: Advance,
    chunksize: int = 1,
) -> list[Any]:
    """The answers to all jobs, in their order."""
    answers = []
    for answer in map(function, jobs) if executor is None else executor.map(function, jobs, chunksize=chunksize):
        answers.append(answer)
        advance("", 1)
    return answers


# ------------------------------------------------------------------------------------------------ special points
def _bautin_points(plane: Plane, digits: int) -> list[SpecialPoint]:
    """The Bautin points in the range."""
    if plane.name not in BAUTIN_PARAMETERS:
        return []
    return [
        SpecialPoint("bautin", point.value, point.omega_crit)
        for point in bautin_points(plane.at(plane.lowest), plane.name, digits)
        if plane.lowest <= point.value.value <= plane.highest
    ]


# ------------------------------------------------------------------------------------------------ curves
class _Line(NamedTuple):
    """A curve in double, and how its points are found to the digits asked for."""

    kind: str
    at: list[float]  #: abscissas of its points: shares of the range, of folds the s of `fold_curves`
    point: Callable[[float], CurvePoint | Missing]  #: at an abscissa


def _lines(
    plane: Plane, samples: Sequence[Sample], traces: Sequence[Trace], points: int, digits: int
) -> Iterator[_Line]:
    """All curves."""
    yield _Line("hopf", numpy.linspace(0, 1, points).tolist(), partial(_hopf_point, plane, digits))
    for run in connected_runs(samples):
        shares = numpy.linspace(run.at[0], run.at[-1], points).tolist()
        yield _Line("heteroclinic", shares, partial(_connection, plane, digits, run))
    for trace in traces:
        yield _Line("fold", _spread(trace, points), partial(_fold, plane, digits, trace))


def _spread(trace: Trace, count: int) -> list[float]:
    """Abscissas of evenly spread points on a trace, its ends in the range among them."""
    from scipy.optimize import brentq

    ends: list[float] = []
    for end, neighbour in ((trace.at[0], trace.at[1]), (trace.at[-1], trace.at[-2])):
        border = min(max(0.0, trace(end)[2]), 1.0)  # only the last node on each side may lie outside
        outside = trace(end)[2] != border
        ends.append(brentq(lambda s, border=border: trace(s)[2] - border, end, neighbour) if outside else end)
    s = numpy.linspace(ends[0], ends[1], _SAMPLES * count)
    folds = numpy.array([trace(where) for where in s.tolist()])[:, 1:]
    length = numpy.concatenate([[0.0], numpy.cumsum(numpy.hypot(*numpy.diff(folds, axis=0).T))])
    chosen: list[float] = numpy.interp(numpy.linspace(0, length[-1], count), length, s).tolist()
    return chosen


def _hopf_point(plane: Plane, digits: int, share: float) -> CurvePoint:
    value = plane.decimal(share)
    return CurvePoint(value, omega_crit(plane.at(value), digits + 2))


def _connection(plane: Plane, digits: int, run: Nodes, share: float) -> CurvePoint | Missing:
    value, guess = plane.decimal(share), float(run(share)[0])
    found = attempted("heteroclinic", value, lambda: omega_h_near(plane.at(value), guess, default_engine(), digits))
    return found if isinstance(found, Missing) else CurvePoint(value, found)


def _fold(plane: Plane, digits: int, trace: Trace, s: float) -> CurvePoint | Missing:
    value = plane.decimal(float(trace(s)[2]))
    fold = attempted("fold", value, lambda: fold_at(plane, s, trace(s), default_engine(), digits))
    if isinstance(fold, Missing):
        return fold
    return CurvePoint(getattr(fold.parameters, plane.name), fold.omega, fold.gamma_bar_0, fold.v_0, fold.period)
