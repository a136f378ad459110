"""Many half maps side by side: the search for the lengths and orders of their steps, and what returned.

This file chooses, and proves nothing by itself: step lengths, orders, guesses of moments, and which lanes go on. A lane
whose step is not proved tries a shorter one in the next round. Lanes that have returned to the section, or of which
nothing more can be proved, leave.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tippedisk_verify.proofs.kernel.batch import mapped, replaced, some_model
from tippedisk_verify.proofs.kernel.flow import Model, Path
from tippedisk_verify.proofs.kernel.lane_middle import SharpModel, SharpWalk
from tippedisk_verify.proofs.kernel.lanes import Lanes, quiet
from tippedisk_verify.proofs.kernel.section import HALF, Return, Round, Status, Walk
from tippedisk_verify.proofs.kernel.sliding import SlidingPath
from tippedisk_verify.proofs.kernel.step import Step
from tippedisk_verify.proofs.search.steps import axes_of_lanes

__all__ = ["HalfFlights", "LaneSteps", "half_flights", "lane_of"]

Array = NDArray[Any]

_BLOCK = 4000  # lanes at a time: some 50 kB each
#: Orders of the series over a box and of the midpoint's. Measured: over a wide box a higher one costs more than its
#: longer steps save, and its derivatives are wider.
_ORDERS, _NARROW_ORDERS = (10, 10), (16, 16)
_SHARP_ORDERS, _SHARP = (24, 16), 2.0**-66  # with a middle that Arb follows; and how large its remainders may be
_NARROW = 2.0**-30  # radius below which a box is narrow
_DAMPED = 1.0  # how often the series over a box decays along v in a step
_TOLERANCE = 1 / 16  # remainders, in units of a box's radius
_LEAST_ROUGH = 2.0**-34  # remainders of derivatives, which multiply radii: as small as this or as the radius
_WIDEST = 2.0**-3  # as in `flow`
_SHORTEST_STEP = 2.0**-40
_MOST_TRIALS = 40
_FIRST_SHARE = 0.75
_U, _TINY = 2.0**-53, 2.0**-1000
_ENTRIES = (
    "time", "image", "beta_least", "turn_by_start", "matrix", "by_omega", "time_by_state", "time_by_omega",
    "divergence",
)  # fmt: skip


@dataclass(frozen=True)
class HalfFlights(Return):
    """A `Return` whose entries are lanes, infinite balls where none is proved, and whose ``status`` is an array."""

    middle: HalfFlights | None = None  #: of the boxes' middles alone, if a `SharpModel` moves them

    @property
    def returned(self) -> Array:
        """Of each lane, whether its return is proved."""
        return np.array([status is Status.RETURNED for status in self.status], bool)  # type: ignore[attr-defined]


def half_flights(
    model: Model | SharpModel,
    gamma_bar: Lanes,
    v: Lanes,
    *,
    derivatives: bool = False,
    longest: float = 60.0,
) -> HalfFlights:
    """`section.returned` for every lane; the model's speeds are as many lanes, its constants as many or one.

    The derivatives come in any case.
    """
    count = len(v)
    status = np.full(count, Status.NO_START)
    reached, steps, reversals = np.zeros(count), np.zeros(count, int), np.zeros(count, int)
    x = Lanes(np.full(count, np.nan))
    nothing = [x, (x, x), x, (x, x, x), ((x, x), (x, x)), (x, x), (x, x), x, x]
    values: list[list[Any]] = [nothing, nothing]  # of the boxes, and of their middles
    with quiet():
        going = np.flatnonzero(v.negative())
        for first in range(0, len(going), _BLOCK):
            lanes = going[first : first + _BLOCK]
            sharp, start = isinstance(model, SharpModel), (gamma_bar[lanes], v[lanes])
            search, kind = LaneSteps(len(lanes), sharp=sharp), SharpWalk if sharp else Walk
            walk = kind(some_model(model, lanes), HALF, start, search, derivatives=True)
            while len(lanes):
                path = walk.path
                ends = _ended(path, longest)
                if (ends == None).all() and (tried := walk.advance()):  # noqa: E711
                    ends = search.answered(tried)
                    for k, landing in enumerate((tried.landing, getattr(tried.landing, "middle", None))):
                        if landing is not None:
                            place, landed = lanes[tried.arrived], [getattr(landing, name) for name in _ENTRIES]
                            values[k] = mapped(lambda old, new, at=place: replaced(old, at, new), values[k], landed)
                gone = ends != None  # noqa: E711
                if gone.any():
                    left = lanes[gone]
                    status[left], reached[left] = ends[gone], path.time.midpoints[gone]
                    steps[left], reversals[left] = path.steps[gone], path.reversals[gone]
                    staying = np.flatnonzero(~gone)
                    lanes, walk, search = lanes[staying], walk.some(staying), search.some(staying)
                    walk.path.proposer = search
    boxes, middles = (
        HalfFlights(status, reached, steps, reversals, **dict(zip(_ENTRIES, part, strict=True)))  # type: ignore[arg-type]
        for part in values
    )
    return replace(boxes, middle=middles if isinstance(model, SharpModel) else None)


def _ended(path: Path, longest: float) -> Array:
    """Of each lane a status if it cannot go on."""
    status = np.full(len(path.time), None)
    if isinstance(path, SlidingPath):
        status[path.side == 0] = Status.GRAZING
    radii = np.max([part.radii for part in path.box], axis=0)
    status[~(path.time - longest).negative()] = Status.NO_RETURN
    status[radii > _WIDEST] = Status.TOO_WIDE
    status[~np.isfinite(radii)] = Status.NO_ENCLOSURE
    return status


class LaneSteps:
    """The choices for a path in lanes, from what the kernel shows of it."""

    axes = staticmethod(axes_of_lanes)

    def __init__(self, count: int, *, sharp: bool = False) -> None:
        self.sharp = sharp  #: whether the path is a `SharpPath`
        self.shares = np.full(count, _FIRST_SHARE)  #: of the length that the midpoint's series allows
        self.cuts = np.full(count, np.inf)  #: what the next step may not exceed [s]
        self.failures = np.zeros(count, int)

    def some(self, which: Array) -> LaneSteps:
        """The search for some lanes."""
        search = copy(self)
        for name, value in vars(self).items():
            if name != "sharp":
                setattr(search, name, value[which])
        return search

    def took(self, *_: Any) -> None:
        """Nothing is noted."""

    def beyond(self) -> LaneSteps:
        """Behind a change of side the step is short, and as long as it is to be."""
        return self

    def step(self, path: Path, longest: Any = None) -> Step:
        """Steps whose remainders are narrow enough to be wanted; or steps of that length."""
        radius = np.max([part.radii for part in path.box], axis=0)
        orders = _ORDERS if np.median(radius) > _NARROW else _NARROW_ORDERS
        trial = path.trial(_SHARP_ORDERS if self.sharp else orders)
        if longest is not None:
            return trial.tested(longest)
        (order, rough_order), thin, wide = trial.orders, trial.thin, trial.wide
        # Remainders may be as large as rounding, or a share of the radius.
        if self.sharp:
            allowed = [_SHARP * np.maximum(1.0, _size(part)) for part in path.box]
        else:
            allowed = [np.maximum(_U * np.maximum(1.0, _size(part)), part.radii * _TOLERANCE) for part in path.box]
        rough_allowed = np.maximum(_LEAST_ROUGH, radius)
        reach = _reach(thin, allowed)
        most = np.minimum(self.cuts, _DAMPED / np.maximum(1.0, _size(wide[11][1])))
        free = reach * self.shares
        length = np.minimum(free, most)
        step = trial.tested(Lanes(length))
        scales = [np.maximum(1.0, _size(column[0])) * rough_allowed for column in wide[3:]]
        excess = np.maximum(
            _excess([series[-1] for series in step.polynomials], allowed, length, order + 1),
            _excess([series[-1] for series in step.derivatives], scales, length, rough_order + 1),
        )
        accepted = step.included & (excess <= 0)
        # A step cut short says nothing about how long the next may be.
        better = 0.97 * length / reach * np.exp2(np.minimum(1.0, -excess))
        tighter = np.fmin(better, np.where(excess > 0, 0.9, 0.5) * length / reach)
        self.shares = np.where(accepted, np.where(free <= most, better, self.shares), tighter)
        return replace(step, included=accepted)

    def answered(self, tried: Round) -> Array:
        """Prepare the next steps: a status for each lane whose way ends."""
        length, proved = tried.step.length.midpoints, tried.proved
        self.cuts = np.where(proved, np.inf, 0.7 * length)
        self.failures = np.where(proved, 0, self.failures + 1)
        stuck = ~proved & (~(length >= _SHORTEST_STEP) | (self.failures >= _MOST_TRIALS))
        status = np.full(len(proved), None)
        status[stuck] = Status.NO_ENCLOSURE
        tested = stuck & tried.step.included
        status[tested] = Status.UNRESOLVED
        status[tested & ~tried.upright] = Status.FLAT
        status[tested & ~tried.followed] = Status.GRAZING
        status[tried.arrived] = Status.RETURNED
        return status


def lane_of(flights: HalfFlights, lane: int) -> Return:
    """One lane's flight, on arb's balls."""
    return mapped(lambda part: part.arb(lane) if isinstance(part, Lanes) else part.item(lane), flights)  # type: ignore[no-any-return]


def _size(lanes: Lanes) -> Array:
    return np.abs(lanes.midpoints) + lanes.radii


def _reach(series: Sequence[Sequence[Lanes]], allowed: Sequence[Array]) -> Array:
    """How far the last two coefficients stay below what is allowed, at most a second."""
    order = len(series[0]) - 1
    reaches = [
        (limit / np.maximum(_size(column[n]), _TINY)) ** (1 / n)
        for column, limit in zip(series, allowed, strict=True)
        for n in (order - 1, order)
    ]
    shortest: Array = np.minimum(1.0, np.min(reaches, axis=0))
    return shortest


def _excess(remainders: Sequence[Lanes], allowed: Sequence[Array], length: Array, power: int) -> Array:
    """By how much log2 of the steps is too large for the remainders, which grow like their ``power``."""
    worst = np.max([_size(r) / limit for r, limit in zip(remainders, allowed, strict=True)], axis=0)
    excess: Array = np.log2(np.maximum(worst, _TINY)) / power + np.log2(length)
    return excess
