"""The plane of one parameter and the speed: Hopf, fold and heteroclinic curves, the points on them, what is stable.

Some disks of the range are examined on their own (`slices`), more of them where they differ from their neighbours;
this finds what curves there are. Curves of folds are then followed by amplitude (`fold_curves`), Omega_h by the
parameter. Points spread evenly over each curve are corrected to the digits asked for. What cannot be had is a gap with
its reason.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from itertools import groupby, pairwise
from typing import Any

import numpy

from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.flow import default_engine
from tippedisk_verify.model.exact import exact, shown
from tippedisk_verify.model.measured import Measured, decimal_magnitude
from tippedisk_verify.model.parameters import SYMBOLS, Parameters
from tippedisk_verify.model.precision import checked_digits
from tippedisk_verify.orbits.connection_curve import CONDITIONS, omega_h_near, refined_point, rough_condition
from tippedisk_verify.orbits.examined_disks import (
    Work,
    connected_runs,
    examined,
    examined_between,
    predicted_omega_h,
)
from tippedisk_verify.orbits.fold_curves import Plane, Trace, fold_at, fold_traces
from tippedisk_verify.orbits.slices import Slice
from tippedisk_verify.theory.codimension_two import BAUTIN_PARAMETERS, bautin_points
from tippedisk_verify.theory.hopf import omega_crit

__all__ = [
    "Atlas",
    "Curve",
    "CurvePoint",
    "Gap",
    "Region",
    "SpecialPoint",
    "all_done",
    "atlas",
    "checked_atlas",
    "planes_of",
]

MOST_POINTS = 10_000
_SAMPLES = 8  # of a curve for each of its points, to spread these
_CHUNK = 8  # points that a process computes at a time

Advance = Callable[[str, int], None]


@dataclass(frozen=True)
class CurvePoint:
    """A point of a curve: an exact value of the parameter, and the speed."""

    value: Fraction
    omega: Measured  #: [rad/s]
    gamma_bar_0: Measured | None = None  #: of the cycle, at a fold [rad]
    v_0: Measured | None = None  #: of the cycle, at a fold [rad/s]
    period: Measured | None = None  #: of the cycle, at a fold [s]


@dataclass(frozen=True)
class Gap:
    """Values of the parameter between which something is not known, or is otherwise than elsewhere."""

    lowest: Fraction
    highest: Fraction
    reason: str


@dataclass(frozen=True)
class Curve:
    """Points of one curve, in their order along it."""

    kind: str  #: hopf, fold or heteroclinic
    points: tuple[CurvePoint, ...]


@dataclass(frozen=True)
class SpecialPoint:
    """A point of codimension two: bautin, neutral-saddle or hopf-heteroclinic."""

    kind: str
    value: Measured
    omega: Measured  #: [rad/s]


@dataclass(frozen=True)
class Region:
    """A stretch of the parameter's range on which the same curves lie in the same order, and what is between them."""

    lowest: Fraction
    highest: Fraction
    bounds: tuple[str, ...]  #: kinds of the curves, by rising speed
    slices: tuple[Slice, ...]  #: the disks of the stretch that were examined


@dataclass(frozen=True)
class Atlas:
    """All that was found in the plane."""

    plane: Plane
    curves: tuple[Curve, ...]
    points: tuple[SpecialPoint, ...]
    regions: tuple[Region, ...]
    gaps: tuple[Gap, ...]


def planes_of(parameters: Parameters, axes: str, ranges: Sequence[tuple[str, str]]) -> tuple[Plane, ...]:
    """The parameters among two axes such as "A,Omega", each over a range of decimals, in that order.

    Without ranges each goes a tenth of its value to both sides, as far as `Parameters` takes it. Raises InputError for
    axes or ranges that are none.
    """
    names = axes.removesuffix(",Omega").split(",")
    if not set(names) <= set(SYMBOLS) or len(set(names)) != len(names) or len(names) != 2 - axes.endswith(",Omega"):
        known = ", ".join(SYMBOLS)
        raise InputError(f"the plane '{shown(axes)}' is not known: give two of {known}, or one of them and Omega")
    if not ranges:
        return tuple(Plane(parameters, name, *_around(parameters, name)) for name in names)
    if len(ranges) != len(names):
        raise InputError(f"{len(ranges)} ranges for {len(names)} parameters: give one for each, or none")
    planes = []
    for name, ends in zip(names, ranges, strict=True):
        low, high = (exact(end) for end in ends)
        if low.pi_multiple or high.pi_multiple:
            raise InputError("the ends of a range must be decimals")
        planes.append(Plane(parameters, name, low.rational, high.rational))
    return tuple(planes)


def _around(parameters: Parameters, name: str) -> list[Fraction]:
    """The ends of the default range."""
    own: Fraction = getattr(parameters, name)
    unit = Fraction(10) ** (decimal_magnitude(own) - 3)
    ends = []
    for side in (-1, 1):
        steps = [round(own * (1 + side * Fraction(k, 1000)) / unit) * unit for k in range(1, 101)]
        ends.append([own, *(value for value in steps if _taken(parameters, name, value))][-1])
    return ends


def _taken(parameters: Parameters, name: str, value: Fraction) -> bool:
    try:
        return bool(Plane(parameters, name, value, value).at(value))
    except InputError:
        return False


def atlas(
    plane: Plane,
    *,
    points: int = 200,
    digits: int = 12,
    executor: Executor | None = None,
    advance: Advance = lambda label, steps: None,
) -> Atlas:
    """The atlas of the plane, with so many ``points`` on each curve and their speeds to ``digits`` significant digits.

    Raises InputError for a number of points or digits that is not offered, a range that is none or leaves the disks
    that `Parameters` takes, and the smooth law.
    """
    checked_atlas(plane, points, digits)
    plane.at(plane.lowest), plane.at(plane.highest)  # between two admissible values all are
    work = partial(all_done, executor=executor, advance=advance)
    bautin = _bautin_points(plane, digits)
    slices = examined(plane, work)
    answers = _connection_points(plane, slices, digits, work)
    specials = [answer for answer in answers if isinstance(answer, SpecialPoint)]
    known = sorted(plane.share(point.value.value) for point in (*bautin, *specials))
    slices = examined_between(plane, slices, known, work)
    traces = work(partial(_traces, plane), [(_seeds(slices), tuple(plane.share(p.value.value) for p in bautin))])[0]
    curves, gaps = _curves(plane, slices, traces, points, digits, work)
    return Atlas(
        plane,
        tuple(curves),
        tuple(sorted((*bautin, *specials), key=lambda point: point.value.value)),
        tuple(_regions(plane, slices, known)),
        (
            *(answer for answer in answers if isinstance(answer, Gap)),
            *gaps,
            *_family_gaps(plane, slices),
            *_unlike_the_curves(plane, slices, traces),
        ),
    )


def checked_atlas(plane: Plane, points: int, digits: int) -> None:
    """Raises InputError for what no atlas can be made of."""
    plane.parameters.refuse_smooth("an atlas is")
    checked_digits(digits)
    if isinstance(points, bool) or not isinstance(points, int) or not 5 <= points <= MOST_POINTS:
        raise InputError(f"a curve has 5 to {MOST_POINTS} points, not {shown(points)}")
    if not 0 < plane.lowest < plane.highest:
        raise InputError("a range must rise, from above zero: its lowest value is less than its highest")


# ------------------------------------------------------------------------------------------------ work for processes
def all_done(function: Callable[[Any], Any], jobs: Iterable[Any], executor: Executor | None, advance: Advance) -> Any:
    """The answers to all jobs, in their order."""
    answers = []
    for answer in map(function, jobs) if executor is None else executor.map(function, jobs):
        answers.append(answer)
        advance("", 1)
    return answers


def _traces(plane: Plane, job: tuple[list[tuple[float, Any]], Sequence[float]]) -> list[Trace]:
    return fold_traces(plane, *job, default_engine())


def _refined(plane: Plane, digits: int, job: tuple[Any, tuple[float, float], Any]) -> SpecialPoint | Gap:
    kind, ends, known = job
    try:
        found = refined_point(
            kind, plane, ends, lambda share: predicted_omega_h(known, share), default_engine(), digits
        )
    except (InputError, Shortfall) as fault:
        return Gap(plane.decimal(ends[0]), plane.decimal(ends[1]), f"{kind}: {fault}")
    return SpecialPoint(found.kind, found.value, found.omega)


def _connections(plane: Plane, digits: int, job: list[tuple[float, float]]) -> list[CurvePoint | Gap]:
    answers: list[CurvePoint | Gap] = []
    for share, near in job:
        value = plane.decimal(share)
        try:
            answers.append(CurvePoint(value, omega_h_near(plane.at(value), near, default_engine(), digits)))
        except (InputError, Shortfall) as fault:
            answers.append(Gap(value, value, f"heteroclinic: {fault}"))
    return answers


def _folds(plane: Plane, digits: int, job: list[tuple[float, Any]]) -> list[CurvePoint | Gap]:
    answers: list[CurvePoint | Gap] = []
    for s, point in job:
        try:
            fold = fold_at(plane, s, point, default_engine(), digits)
            value = getattr(fold.parameters, plane.name)
            answers.append(CurvePoint(value, fold.omega, fold.gamma_bar_0, fold.v_0, fold.period))
        except (InputError, Shortfall) as fault:
            value = plane.decimal(float(point[2]))
            answers.append(Gap(value, value, f"fold: {fault}"))
    return answers


# ------------------------------------------------------------------------------------------------ special points
def _bautin_points(plane: Plane, digits: int) -> list[SpecialPoint]:
    """The Bautin points in the range."""
    if plane.name not in BAUTIN_PARAMETERS:
        return []
    found = bautin_points(plane.at(plane.lowest), plane.name, digits)
    return [
        SpecialPoint("bautin", point.value, point.omega_crit)
        for point in found
        if plane.lowest <= point.value.value <= plane.highest
    ]


def _connection_points(plane: Plane, slices: Sequence[Slice], digits: int, work: Work) -> list[SpecialPoint | Gap]:
    """The points on the curve of Omega_h, or between which disks one is that cannot be refined."""
    jobs = []
    for run in connected_runs(slices):
        for kind in CONDITIONS:
            values = [rough_condition(kind, plane.at(plane.decimal(share)), omega) for share, omega in run]
            for k, (before, after) in enumerate(pairwise(values)):
                if (before < 0) != (after < 0):
                    jobs.append((kind, (run[k][0], run[k + 1][0]), run))
    return list(work(partial(_refined, plane, digits), jobs))


# ------------------------------------------------------------------------------------------------ curves
def _seeds(slices: Sequence[Slice]) -> list[tuple[float, Any]]:
    return [(s, numpy.array([ratio, omega, one.share])) for one in slices for s, ratio, omega in one.folds]


def _curves(
    plane: Plane, slices: Sequence[Slice], traces: Sequence[Trace], points: int, digits: int, work: Work
) -> tuple[list[Curve], list[Gap]]:
    """All curves with their points, and where points could not be had."""
    shares = numpy.linspace(0, 1, _SAMPLES * points)
    crit = numpy.array([float(omega_crit(plane.at(plane.value(share)))) for share in shares.tolist()])
    connected = []
    for run in connected_runs(slices):
        here = numpy.linspace(run[0][0], run[-1][0], _SAMPLES * points)
        connected.append((run, here, numpy.array([predicted_omega_h(run, share) for share in here.tolist()])))
    folded = [(trace, *_inside(trace, points)) for trace in traces]
    speeds = numpy.concatenate([crit, *(omega for *_, omega in connected), *(found[:, 1] for *_, found in folded)])
    height = max(float(speeds.max() - speeds.min()), 1e-9)
    values = [plane.decimal(share) for share in _spread(shares, shares, crit / height, points)]
    curves = [Curve("hopf", tuple(CurvePoint(value, omega_crit(plane.at(value), digits + 2)) for value in values))]
    jobs: list[tuple[str, list[Any]]] = []
    for run, here, omegas in connected:
        chosen = _spread(here, here, omegas / height, points)
        jobs.append(("heteroclinic", [(share, predicted_omega_h(run, share)) for share in chosen]))
    for trace, s, found in folded:
        chosen = _spread(s, found[:, 2], found[:, 1] / height, points)
        jobs.append(("fold", [(where, trace(where)) for where in chosen]))
    gaps: list[Gap] = []
    for kind, job in jobs:
        chunks = [job[k : k + _CHUNK] for k in range(0, len(job), _CHUNK)]
        correct = _connections if kind == "heteroclinic" else _folds
        answers = [answer for chunk in work(partial(correct, plane, digits), chunks) for answer in chunk]
        curves.append(Curve(kind, tuple(answer for answer in answers if isinstance(answer, CurvePoint))))
        gaps += _joined(answers)
    return curves, gaps


def _joined(answers: Sequence[CurvePoint | Gap | None]) -> list[Gap]:
    """The gaps among what was found along a range; neighbours that have the same reason as one."""
    gaps: list[Gap] = []
    for number, answer in enumerate(answers):
        if not isinstance(answer, Gap):
            continue
        if number and gaps and isinstance(answers[number - 1], Gap) and gaps[-1].reason == answer.reason:
            low, high = min(gaps[-1].lowest, answer.lowest), max(gaps[-1].highest, answer.highest)
            gaps[-1] = Gap(low, high, answer.reason)
        else:
            gaps.append(answer)
    return gaps


def _inside(trace: Trace, points: int) -> tuple[Any, Any]:
    """Abscissas close together on the part of a trace that lies in the range, and its points there."""
    ends = list(trace.s[[0, -1]])
    for k, within in enumerate((trace.s[1], trace.s[-2])):  # only the last point on each side may lie outside
        while abs(ends[k] - within) > 1e-12 and not 0 <= trace(ends[k])[2] <= 1:
            middle = (ends[k] + within) / 2
            if 0 <= trace(middle)[2] <= 1:
                within = middle
            else:
                ends[k] = middle
    s = numpy.linspace(ends[0], ends[1], _SAMPLES * points)
    return s, numpy.array([trace(where) for where in s.tolist()])


def _spread(parameter: Any, x: Any, y: Any, count: int) -> list[float]:
    """Values of the parameter at which the points are evenly spread along the curve (x, y), its ends among them."""
    length = numpy.concatenate([[0.0], numpy.cumsum(numpy.hypot(numpy.diff(x), numpy.diff(y)))])
    wanted = numpy.linspace(0, length[-1], count)
    values = numpy.interp(wanted, length, parameter)
    return [float(value) for value in values]


# ------------------------------------------------------------------------------------------------ regions and gaps
def _regions(plane: Plane, slices: Sequence[Slice], known: Sequence[float]) -> list[Region]:
    """The disks grouped by what they have in common; a region ends at a known change, else halfway to the next."""
    groups = [list(run) for _, run in groupby(slices, key=lambda one: one.signature)]
    edges = [0.0]
    for before, after in pairwise(groups):
        left, right = before[-1].share, after[0].share
        between = [share for share in known if left <= share <= right]
        edges.append(between[0] if between else (left + right) / 2)
    edges.append(1.0)
    return [
        Region(plane.decimal(low), plane.decimal(high), tuple(name for name, _ in group[0].bounds), tuple(group))
        for group, low, high in zip(groups, edges, edges[1:], strict=False)
    ]


def _family_gaps(plane: Plane, slices: Sequence[Slice]) -> list[Gap]:
    """Where families do not end in a connection, where there is none, and where cycles change stability otherwise."""
    gaps = []
    for name, what in (
        ("no_family", "limit cycles"),
        ("no_connection", "heteroclinic"),
        ("other_changes", "limit cycles"),
    ):
        for told, run in groupby(slices, key=lambda one: bool(getattr(one, name))):
            if told:
                group = list(run)
                low, high = (plane.decimal(one.share) for one in (group[0], group[-1]))
                gaps.append(Gap(low, high, f"{what}: {getattr(group[len(group) // 2], name)}"))
    return gaps


def _unlike_the_curves(plane: Plane, slices: Sequence[Slice], traces: Sequence[Trace]) -> list[Gap]:
    """Where the disks examined have fewer folds than there are curves, or more."""
    lines = [(trace.points[:, 2], trace.points[:, 1]) for trace in traces]
    gaps: list[Gap | None] = []
    for one in slices:
        crossed = [
            float(omega[k])
            for x, omega in lines
            for k in numpy.flatnonzero((x[:-1] - one.share) * (x[1:] - one.share) < 0)
        ]
        reason = ""
        if len(crossed) < len(one.folds):
            reason = "fold: one that a disk has was not followed"
        elif len(crossed) > len(one.folds) and not one.no_family:
            reason = "regions: a curve of folds runs too close to the end of the family to be told from it"
        value = plane.decimal(one.share)
        gaps.append(Gap(value, value, reason) if reason else None)
    return _joined(gaps)
