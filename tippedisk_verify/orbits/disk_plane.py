"""The plane of two parameters of a disk: which disks do what, and the curves of codimension two between them.

Each curve is where one function of the disk vanishes: the margin of criticality (Bautin), the saddle value on Omega_h
(neutral saddles), Omega_h - Omega_crit. It is followed in double from where its sign changes on a grid of disks; points
spread evenly over it are then corrected in one of the two parameters, with the other an exact decimal.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import Any, Literal

import numpy

from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.flow import default_engine
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.orbits.atlas import Advance, all_done, checked_atlas
from tippedisk_verify.orbits.bisection import bisect_omega_h
from tippedisk_verify.orbits.connection_curve import CONDITIONS, Condition, omega_h_near, refined_point, rough_condition
from tippedisk_verify.orbits.fold_curves import Plane, Trace
from tippedisk_verify.orbits.slices import Slice, slice_of
from tippedisk_verify.theory.codimension_two import BAUTIN_PARAMETERS, bautin_points
from tippedisk_verify.theory.hopf import criticality_margin, omega_crit

__all__ = ["DiskAtlas", "DiskCurve", "DiskPlane", "DiskPoint", "disk_atlas"]

Kind = Literal["bautin"] | Condition
KINDS: tuple[Kind, ...] = ("bautin", *CONDITIONS)
_STEP, _LONGEST_STEP, _SHORTEST_STEP = 0.01, 0.05, 1e-4  # of the sides, along a curve
_BEND = 0.1  # of a step; what it is off by at most
_DIFFERENCE = 1e-4  # of the sides, for the gradient
_SETTLED = 1e-8  # of the sides
_SAME = 0.03  # of the sides; a change of sign this near to a curve belongs to it
_BRACKETS = (1e-6, 1e-5, 1e-4, 1e-3)  # of a side, on both sides of a point

#: What vanishes, and the speed, at (share of one range, share of the other, speed nearby).
Function = Callable[[float, float, float], tuple[float, float]]


@dataclass(frozen=True)
class DiskPlane:
    """Two parameters of a disk, each over a range; `Plane` says what their names and ends are."""

    first: Plane
    second: Plane

    def at(self, x: float, y: float) -> Parameters:
        """The disk at two shares of the ranges, or beyond their ends. Raises InputError as `Parameters`."""
        changes = {self.first.name: self.first.value(x), self.second.name: self.second.value(y)}
        return self.first.parameters.changed(C=None, **changes)


@dataclass(frozen=True)
class DiskPoint:
    """A point of a curve; one of the two parameters is exact."""

    first: Measured
    second: Measured
    omega: Measured  #: Omega_h, or at Bautin points Omega_crit [rad/s]


@dataclass(frozen=True)
class DiskCurve:
    """Points of a curve in their order along it, and where points could not be had: their place and why."""

    kind: str
    points: tuple[DiskPoint, ...]
    gaps: tuple[tuple[Fraction, Fraction, str], ...]


@dataclass(frozen=True)
class DiskAtlas:
    """The curves, and the disks of a grid: what is stable at rising speeds, None where no disk is admissible."""

    plane: DiskPlane
    curves: tuple[DiskCurve, ...]
    disks: tuple[tuple[float, float, Slice | None], ...]  #: (share of the first range, share of the second, disk)


def disk_atlas(
    plane: DiskPlane,
    *,
    points: int = 200,
    digits: int = 12,
    grid: int = 9,
    executor: Executor | None = None,
    advance: Advance = lambda label, steps: None,
) -> DiskAtlas:
    """The plane, with so many ``points`` on each curve, the parameter found to ``digits`` significant digits.

    The disks that are examined have ``grid`` values of either parameter; curves are found where they cross between two.
    Raises InputError as `atlas` does, and where no disk of the grid is admissible.
    """
    for one in (plane.first, plane.second):
        checked_atlas(one, points, digits)
    work = partial(all_done, executor=executor, advance=advance)
    shares = numpy.linspace(0, 1, grid).tolist()
    disks = work(partial(_examined, plane), [(x, y) for y in shares for x in shares])
    if not any(one for *_, one in disks):
        raise InputError("no disk of these ranges is admissible: B must not exceed A, e be less than r, Bbar positive")
    traces = work(partial(_traced, plane, disks), KINDS)
    curves = []
    for kind, found in zip(KINDS, traces, strict=True):
        for trace in found:
            s = numpy.linspace(trace.s[0], trace.s[-1], points).tolist()
            answers = work(partial(_corrected, plane, kind, digits), [tuple(map(float, trace(where))) for where in s])
            kept = tuple(answer for answer in answers if isinstance(answer, DiskPoint))
            curves.append(
                DiskCurve(kind, kept, tuple(answer for answer in answers if not isinstance(answer, DiskPoint)))
            )
    return DiskAtlas(plane, tuple(curves), tuple(disks))


def _examined(plane: DiskPlane, place: tuple[float, float]) -> tuple[float, float, Slice | None]:
    x, y = place
    try:
        disk = plane.at(x, y)
    except InputError:
        return x, y, None
    return x, y, slice_of(disk, 0.0, default_engine())


# ------------------------------------------------------------------------------------------------ curves in double
def _function(plane: DiskPlane, kind: Kind) -> Function:
    if kind == "bautin":

        def margin(x: float, y: float, near: float) -> tuple[float, float]:
            disk = plane.at(x, y)
            return float(criticality_margin(disk) / (disk.A * disk.r)), float(omega_crit(disk))

        return margin

    def condition(x: float, y: float, near: float) -> tuple[float, float]:
        disk = plane.at(x, y)
        try:
            omega = float(omega_h_near(disk, near, default_engine(), 8))
        except Shortfall:
            omega = float(bisect_omega_h(disk, default_engine(), confirm=False).omega_h)
        return rough_condition(kind, disk, omega), omega

    return condition


def _traced(plane: DiskPlane, disks: Sequence[tuple[float, float, Slice | None]], kind: Kind) -> list[Trace]:
    """The curves of one kind against the length along them: shares of both ranges, and the speed."""
    function = _function(plane, kind)
    shares = sorted({x for x, *_ in disks})
    values = {}
    for x, y, one in disks:
        speed = one and (one.omega_crit if kind == "bautin" else one.omega_h)
        if speed:
            value = function(x, y, speed)[0] if kind == "bautin" else rough_condition(kind, plane.at(x, y), speed)
            values[shares.index(x), shares.index(y)] = (x, y, speed, value)
    traces: list[Trace] = []
    for (i, j), (x, y, speed, value) in values.items():
        for other in ((i + 1, j), (i, j + 1)):
            if other not in values or (values[other][3] < 0) == (value < 0):
                continue
            share = value / (value - values[other][3])
            seed = numpy.array([x, y, speed]) * (1 - share) + numpy.array(values[other][:3]) * share
            if not any(numpy.hypot(*(trace.points - seed)[:, :2].T).min() < _SAME for trace in traces):
                traces += _from_seed(function, seed)
    return traces


def _from_seed(function: Function, seed: Any) -> list[Trace]:
    """The curve through a seed in both directions, cut at the border; none where it cannot be followed."""
    try:
        start = _settled(function, seed, _gradient(function, seed)[:, 0])
        slopes = _gradient(function, start)
    except (InputError, Shortfall):
        return []
    backwards, forwards = (_followed(function, start, slopes, side) for side in (-1, 1))
    line = numpy.array([*backwards[:0:-1], *forwards])
    if len(line) < 4:
        return []
    length = numpy.concatenate([[0.0], numpy.cumsum(numpy.hypot(*numpy.diff(line[:, :2], axis=0).T))])
    trace, ends = Trace(length, line), [length[0], length[-1]]
    for k, inner in enumerate((length[1], length[-2])):  # only the last point on each side may lie outside
        low, high = ends[k], inner
        while not _inside(trace(low)) and abs(high - low) > 1e-12:
            middle = (low + high) / 2
            low, high = (low, middle) if _inside(trace(middle)) else (middle, high)
        ends[k] = high if not _inside(trace(ends[k])) else ends[k]
    s = numpy.linspace(ends[0], ends[1], max(len(line), 8))
    return [Trace(s, numpy.array([trace(where) for where in s.tolist()]))]


def _inside(point: Any) -> bool:
    return bool((point[:2] >= 0).all() and (point[:2] <= 1).all())


def _gradient(function: Function, point: Any) -> Any:
    """(2, 2): derivatives by both shares of what vanishes, and of the speed."""
    x, y, near = map(float, point)
    rows, here = [], numpy.array(function(x, y, near))
    for away in ((_DIFFERENCE, 0.0), (0.0, _DIFFERENCE)):
        # Within the square: its border may be that of the admissible disks.
        step = [part if share + part <= 1 else -part for part, share in zip(away, (x, y), strict=True)]
        rows.append((function(x + step[0], y + step[1], near) - here) / sum(step))
    return numpy.array(rows)


def _settled(function: Function, point: Any, gradient: Any) -> Any:
    """The point of the curve on the normal through one nearby. Raises Shortfall if the chord steps do not settle."""
    point = numpy.array(point)
    for _ in range(12):
        value, omega = function(*map(float, point))
        step = value / (gradient @ gradient) * gradient
        point = numpy.array([*(point[:2] - step), omega])
        if numpy.hypot(*step) < _SETTLED:
            return point
    raise Shortfall("the iteration for a point of the curve does not settle")


def _followed(function: Function, start: Any, slopes: Any, side: int) -> list[Any]:
    """Points from the start on to one side; the last one may lie outside."""
    line, step = [start], _STEP
    tangent = side * numpy.array([-slopes[1, 0], slopes[0, 0]]) / numpy.hypot(*slopes[:, 0])
    while _inside(line[-1]) and step > _SHORTEST_STEP:
        guess = line[-1] + step * numpy.array([*tangent, tangent @ slopes[:, 1]])
        try:
            found = _settled(function, guess, slopes[:, 0])
            after = _gradient(function, found)
            off = numpy.hypot(*(found - guess)[:2]) / step
        except (InputError, Shortfall):
            off = _BEND + 1
        if off > _BEND:
            step /= 2
            continue
        line.append(found)
        slopes = after
        turned = numpy.array([-slopes[1, 0], slopes[0, 0]]) / numpy.hypot(*slopes[:, 0])
        tangent = turned if turned @ tangent > 0 else -turned
        if len(line) > 3 and numpy.hypot(*(found - start)[:2]) < step:
            break  # closed
        step = min(2 * step, _LONGEST_STEP) if off < _BEND / 4 else step
    return line


# ------------------------------------------------------------------------------------------------ points to the digits
def _corrected(
    plane: DiskPlane, kind: Kind, digits: int, point: tuple[float, float, float]
) -> DiskPoint | tuple[Fraction, Fraction, str]:
    """The point of the curve with one parameter as it is here: the one along which the function changes less."""
    x, y, _ = point
    function = _function(plane, kind)
    held = plane.first.decimal(x), plane.second.decimal(y)
    try:
        gradient = numpy.abs(_gradient(function, numpy.array(point))[:, 0])
        order = (0, 1) if gradient[0] >= gradient[1] else (1, 0)
        failure = "its sign does not change next to here"
        for free in order:
            one, other = ((plane.first, plane.second), (plane.second, plane.first))[free]
            disk = one.parameters.changed(C=None, **{other.name: held[1 - free]})
            line = Plane(disk, one.name, one.lowest, one.highest)
            value = _crossed(line, kind, function, point, free, digits)
            if value is not None:
                pair = [Measured(held[0], Fraction(0)), Measured(held[1], Fraction(0))]
                pair[free] = value[0]
                return DiskPoint(pair[0], pair[1], value[1])
    except (InputError, Shortfall) as fault:
        failure = str(fault)
    return held[0], held[1], f"{kind}: {failure}"


def _crossed(
    line: Plane, kind: Kind, function: Function, point: tuple[float, float, float], free: int, digits: int
) -> tuple[Measured, Measured] | None:
    """The parameter and the speed where the function vanishes along one parameter, next to a point."""
    here, speed = point[free], point[2]
    if kind == "bautin":
        if line.name not in BAUTIN_PARAMETERS:
            return None
        close = min(
            bautin_points(line.at(line.decimal(here)), line.name, digits),
            key=lambda found: abs(line.share(found.value.value) - here),
            default=None,
        )
        return None if close is None else (close.value, close.omega_crit)
    for away in _BRACKETS:
        ends = max(here - away, 0.0), min(here + away, 1.0)
        places = [(end, point[1]) if free == 0 else (point[0], end) for end in ends]
        signs = [function(x, y, speed)[0] > 0 for x, y in places]
        if signs[0] != signs[1]:
            found = refined_point(kind, line, ends, lambda share: speed, default_engine(), digits)
            return found.value, found.omega
    return None
