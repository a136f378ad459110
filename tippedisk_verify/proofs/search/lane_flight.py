"""Many half maps side by side: the steps and cases of `flow` and `section` on `Lanes`, a step length for each lane.

Every round tries one step in each lane. A lane whose step is proved, with its case, moves on; the others stay where
they are and try a shorter one in the next round. Lanes that have returned to the section, or of which nothing more can
be proved, leave. What is proved of a lane does not depend on the lanes beside it, but for the orders of the series and
the sums that numpy takes in another order.

This file chooses, and proves nothing by itself: step lengths, orders, guesses of moments, and which lanes go on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from tippedisk_verify.proofs.kernel.balls import inside
from tippedisk_verify.proofs.kernel.flow import Model, Path, Step, polynomial
from tippedisk_verify.proofs.kernel.frame import Frame
from tippedisk_verify.proofs.kernel.lanes import Lanes, quiet
from tippedisk_verify.proofs.kernel.section import (
    HALF,
    UPRIGHT,
    Cases,
    Return,
    Status,
    at_turn,
    cases,
    landed,
    moment_of_crossing,
    moment_of_turn,
)
from tippedisk_verify.proofs.search.axes import axes_of_lanes

__all__ = [
    "Block",
    "HalfFlights",
    "guess",
    "half_flights",
    "lane_of",
    "mapped",
    "orders",
    "replaced",
    "some",
    "some_model",
]

Array = NDArray[Any]

_BLOCK = 4000  # lanes at a time: some 50 kB each
#: Orders of the series over a box and of the midpoint's. Measured: over a wide box a higher one costs more than its
#: longer steps save, and its derivatives are wider.
_ORDERS, _NARROW_ORDERS = (10, 10), (16, 16)
_NARROW = 2.0**-30  # radius below which a box is narrow
_DAMPED = 1.0  # how often the series over a box decays along v in a step
_TOLERANCE = 1 / 16  # remainders, in units of a box's radius
_LEAST_ROUGH = 2.0**-34  # remainders of derivatives, which multiply radii: as small as this or as the radius
_WIDEST = 2.0**-3  # as in `flow`
_SHORTEST_STEP = 2.0**-40
_MOST_TRIALS = 40
_FIRST_SHARE = 0.75
_U, _TINY = 2.0**-53, 2.0**-1000


@dataclass(frozen=True)
class HalfFlights(Return):
    """A `Return` whose entries are lanes, infinite balls where none is proved, and whose ``status`` is an array."""

    @property
    def returned(self) -> Array:
        """Of each lane, whether its return is proved."""
        return np.array([status is Status.RETURNED for status in self.status], bool)  # type: ignore[attr-defined]


def half_flights(
    model: Model,
    gamma_bar: Lanes,
    v: Lanes,
    *,
    derivatives: bool = False,
    longest: float = 60.0,
) -> HalfFlights:
    """`section.half_flight` for every lane; the model's speeds are as many lanes, its constants as many or one.

    The derivatives come in any case.
    """
    count = len(v)
    status = np.full(count, Status.NO_START)
    reached, landings = np.zeros(count), []
    steps, reversals = np.zeros(count, int), np.zeros(count, int)
    kind: type[Block] = getattr(model, "block", Block)
    with quiet():
        going = np.flatnonzero(v.negative())
        for first in range(0, len(going), _BLOCK):
            lanes = going[first : first + _BLOCK]
            start = gamma_bar[lanes].constant(0), gamma_bar[lanes], v[lanes]
            block = kind(some_model(model, lanes), start, lanes)
            while len(block.lanes):
                ends = block.ended(longest)
                if (ends == None).all():  # noqa: E711
                    ends, found = block.round()
                    landings += found
                gone = ends != None  # noqa: E711
                if gone.any():
                    left = block.lanes[gone]
                    status[left], reached[left] = ends[gone], block.time.midpoints[gone]
                    steps[left], reversals[left] = block.taken[gone], block.changes[gone]
                    block = block.some(np.flatnonzero(~gone))
        return _gathered(landings, status=status, reached=reached, steps=steps, reversals=reversals)


def _gathered(landings: Sequence[tuple[Array, Return]], status: Array, **others: Array) -> HalfFlights:
    """What has landed, in the caller's order; what has not is infinite. Arrays are in that order already."""
    x = Lanes([np.nan])
    unknown = Return(Status.NO_START, None, 0, 0, x, (x, x), x, (x, x, x), ((x, x), (x, x)), (x, x), (x, x), x, x)
    place = np.full(len(status), -1)
    lanes = np.concatenate([which for which, _ in landings] or [np.zeros(0, int)])
    place[lanes] = np.arange(len(lanes))

    def joined(*parts: Lanes) -> Lanes:
        mid, rad = (np.concatenate([getattr(part, name) for part in parts]) for name in ("midpoints", "radii"))
        return Lanes(mid, rad)[place]

    proved = [replace(flight, status=Status.NO_START, reached=None, steps=0, reversals=0) for _, flight in landings]
    whole = mapped(joined, *proved, unknown)
    values = {entry.name: getattr(whole, entry.name) for entry in fields(Return)}
    return HalfFlights(**(values | {"status": status} | others))


class _Axes:
    """Who is asked for axes; steps and moments are chosen here."""

    axes = staticmethod(axes_of_lanes)

    def took(self, *_: Any) -> None:
        """Nothing is noted."""


_AXES = _Axes()


class Block(Path):
    """Orbits on their way, lane by lane; lanes whose way has ended are dropped."""

    def __init__(self, model: Model, start: Sequence[Lanes], lanes: Array) -> None:
        zero = start[0].constant(0)
        super().__init__(model, start, _AXES, derivatives=True)  # type: ignore[arg-type]
        self.time = self.divergence = self.beta_least = zero
        self.turn_by_start: tuple[Any, ...] = (zero, zero, zero)
        self.lanes, count = lanes, len(lanes)  #: which of the caller's they are
        self.taken, self.failures = np.zeros(count, int), np.zeros(count, int)
        self.changes = np.zeros(count, int)  #: of the law
        self.turned = np.zeros(count, bool)
        self.shares, self.cuts = np.full(count, _FIRST_SHARE), np.full(count, np.inf)

    def ended(self, longest: float) -> Array:
        """Of each lane a status if it cannot go on."""
        status = np.full(len(self.lanes), None)
        radii = np.max([part.radii for part in self.box], axis=0)
        status[~(self.time - longest).negative()] = Status.NO_RETURN
        status[radii > _WIDEST] = Status.TOO_WIDE
        status[~np.isfinite(radii)] = Status.NO_ENCLOSURE
        return status

    def round(self) -> tuple[Array, list[Any]]:
        """One step tried in each lane: a status where the way ends, and what has landed, with its lanes."""
        step, accepted = self.tried()
        followed, crossing = self._followed(step, accepted)
        upright = inside(step.enclosure[0], Lanes([0.0], [UPRIGHT]))
        case = cases(self.model, self.box, step)
        if crossing:
            crossing.judge(upright, case)
        proved = followed & upright & np.where(self.turned, case.rises | case.crosses, case.falls | case.turns)
        self._turn(step, case, proved)
        landings = self._land(step, case, proved)
        short = ~(step.length.midpoints >= _SHORTEST_STEP)
        self.go_on(step, proved, crossing)
        status = np.full(len(self.lanes), None)
        stuck = ~proved & (short | (self.failures >= _MOST_TRIALS))
        status[stuck] = Status.NO_ENCLOSURE
        status[stuck & accepted] = Status.UNRESOLVED
        status[stuck & accepted & ~upright] = Status.FLAT
        status[stuck & accepted & ~followed] = Status.GRAZING
        for which, _ in landings:
            status[which] = Status.RETURNED
        return status, [(self.lanes[which], flight) for which, flight in landings]

    def tried(self) -> tuple[Step, Array]:
        """A step of each lane, and whether it is proved and narrow enough."""
        radius = np.max([part.radii for part in self.box], axis=0)
        trial = self.trial(orders(self.box))
        (order, rough_order), thin, wide = trial.orders, trial.thin, trial.wide
        # Remainders may be as large as rounding, or a share of the radius.
        allowed = [np.maximum(_U * np.maximum(1.0, _size(part)), part.radii * _TOLERANCE) for part in self.box]
        rough_allowed = np.maximum(_LEAST_ROUGH, radius)
        reach = _reach(thin, allowed)
        longest = np.minimum(self.cuts, _DAMPED / np.maximum(1.0, _size(wide[11][1])))
        free = reach * self.shares
        length = np.minimum(free, longest)
        verdict = trial.verdict(Lanes(length))
        scales = [np.maximum(1.0, _size(column[0])) * rough_allowed for column in wide[3:]]
        excess = np.maximum(
            _excess(verdict.fine, allowed, length, order + 1),
            _excess(verdict.rough[3:], scales, length, rough_order + 1),
        )
        accepted = verdict.included & (excess <= 0)
        # A step cut short says nothing about how long the next may be.
        better = 0.97 * length / reach * np.exp2(np.minimum(1.0, -excess))
        tighter = np.fmin(better, np.where(excess > 0, 0.9, 0.5) * length / reach)
        self.shares = np.where(accepted, np.where(free <= longest, better, self.shares), tighter)
        return trial.tested(Lanes(length), verdict), accepted

    def _followed(self, step: Step, accepted: Array) -> tuple[Array, Any]:
        """Of which accepted steps the law is known, and those in which it changes."""
        return accepted, None

    def _turn(self, step: Step, case: Cases, proved: Array) -> None:
        """Note the turns of proved steps; those whose moment cannot be enclosed are no longer proved."""
        which = np.flatnonzero(proved & ~self.turned & case.turns)
        if not len(which):
            return
        part = some(step, which)
        moment, sure = moment_of_turn(self._model_of(which), part, guess(part, 2))
        least, by_start = at_turn(part, moment, True)
        proved[which[~sure]] = False
        which = which[sure]
        self.turned[which] = True
        self.beta_least = replaced(self.beta_least, which, least[sure])
        self.turn_by_start = tuple(
            replaced(old, which, new[sure]) for old, new in zip(self.turn_by_start, by_start, strict=True)
        )

    def _land(self, step: Step, case: Cases, proved: Array) -> list[tuple[Array, Return]]:
        """The lanes that have reached the section, taken there; the others that cross are no longer proved."""
        which = np.flatnonzero(proved & self.turned & case.crosses)
        if not len(which):
            return []
        part = some(step, which)
        moment, sure = moment_of_crossing(part, guess(part, 0), case.speed[which])
        proved[which[~sure]] = False
        if not sure.any():
            return []
        which, part, moment = which[sure], some(part, sure), moment[sure]
        path = self.some(which)
        path.take(part, moment)
        return [(which, landed(HALF, path, path.beta_least, path.turn_by_start))]

    def go_on(self, step: Step, proved: Array, crossing: Any = None) -> None:
        """Take the proved steps; the other lanes try shorter ones."""
        before = copy(self)
        self.take(step)
        self.taken = before.taken + proved
        if not proved.all():
            for name in ("frame", "box", "divergence", "time"):
                old, new = getattr(before, name), getattr(self, name)
                setattr(self, name, mapped(lambda x, y: x.where(proved, y), new, old))
        self.cuts = np.where(proved, np.inf, 0.7 * step.length.midpoints)
        self.failures = np.where(proved, 0, self.failures + 1)

    def some(self, which: Array) -> Self:
        """The block of some lanes."""
        block = copy(self)
        for name, value in vars(self).items():
            if name not in ("model", "sharp", "proposer"):
                setattr(block, name, some(value, which))
        block.model = self._model_of(which)
        return block

    def _model_of(self, which: Array) -> Model:
        return some_model(self.model, which)


def some_model(model: Model, which: Array) -> Model:
    """The model of some lanes; constants that are one lane go with any."""
    constants = type(model.constants)(*(part if len(part) == 1 else part[which] for part in model.constants))
    return type(model)(constants, model.omega[which], model.law)


def orders(box: Sequence[Lanes]) -> tuple[int, int]:
    """Of the midpoint's series and of that over the box."""
    return _ORDERS if np.median(np.max([part.radii for part in box], axis=0)) > _NARROW else _NARROW_ORDERS


def lane_of(flights: HalfFlights, lane: int) -> Return:
    """One lane's flight, on arb's balls."""
    return mapped(lambda part: part.arb(lane) if isinstance(part, Lanes) else part[lane], flights)  # type: ignore[no-any-return]


def some(tree: Any, which: Array) -> Any:
    """Some lanes of whatever holds lanes and arrays of them."""
    return mapped(lambda part: part[which], tree)


def mapped(function: Callable[..., Any], tree: Any, *others: Any) -> Any:
    """The same structure with the function of its lanes and arrays; the others have the same structure."""
    if isinstance(tree, Lanes | np.ndarray):
        return function(tree, *others)
    if isinstance(tree, list | tuple):
        return type(tree)([mapped(function, *parts) for parts in zip(tree, *others, strict=True)])
    if isinstance(tree, Frame | Step | Return):
        names = Frame.__slots__ if isinstance(tree, Frame) else [entry.name for entry in fields(tree)]
        images = {n: mapped(function, *(getattr(part, n) for part in (tree, *others))) for n in names}
        if not isinstance(tree, Frame):
            return replace(tree, **images)
        image = copy(tree)
        for name, value in images.items():
            setattr(image, name, value)
        return image
    return tree


def replaced(lanes: Lanes, which: Array, values: Lanes) -> Lanes:
    mid, rad = lanes.midpoints.copy(), lanes.radii.copy()
    mid[which], rad[which] = values.midpoints, values.radii
    return Lanes(mid, rad)


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


def guess(step: Step, index: int) -> Lanes:
    """A point in each step near the zero of the middle orbit's component, by bisection in doubles."""
    coefficients = [part.midpoints for part in step.polynomials[index]]
    low, high = np.zeros(len(step.length)), step.length.midpoints
    for _ in range(54):
        middle = (low + high) / 2
        below = polynomial(coefficients, middle) < 0
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return Lanes((low + high) / 2)
