"""The half map side by side: `flow`'s steps and `section`'s cases on `Lanes`, a step length for each lane.

Every round tries one step in each lane. A lane whose step is proved, with its case, moves on; the others stay where
they are. What is proved of a lane does not depend on the lanes beside it, but for the orders of the series and the sums
that numpy takes in another order.

`LaneProposer` chooses lengths, orders, axes and moments; any choice of which the tests are passed is right.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from tippedisk_verify.proofs.kernel.balls import inside
from tippedisk_verify.proofs.kernel.flow import Model, Path, Step, Trial, Verdict, polynomial
from tippedisk_verify.proofs.kernel.frame import Frame
from tippedisk_verify.proofs.kernel.lanes import Lanes
from tippedisk_verify.proofs.kernel.section import (
    HALF,
    UPRIGHT,
    Cases,
    Return,
    at_turn,
    cases,
    landed,
    moment_of_crossing,
    moment_of_turn,
)

__all__ = ["LanePath", "LaneProposer", "Proposal", "Round", "mapped", "replaced", "some", "some_model"]

Array = NDArray[Any]


class Proposal(NamedTuple):
    """A step proposed for each lane."""

    trial: Trial
    verdict: Verdict  #: the trial's, of the step's length
    wanted: Array  #: whether the lane is to take the step if it is proved


class LaneProposer(Protocol):
    """What a path in lanes asks for its choices; for axes, and that it took a step, as a `flow.Proposer`."""

    def orders(self, box: Sequence[Lanes]) -> tuple[int, int]:
        """Of a trial's series; see `flow.Trial`."""
        ...

    def lengths(self, path: LanePath) -> Proposal:
        """A step for each lane."""
        ...

    def zero(self, value: Callable[[Array], Array], begin: Array, end: Array) -> Array:
        """A point in each lane between two times, near the zero of a function that grows."""
        ...


@dataclass(frozen=True)
class Round:
    """What is proved of one step in each lane, lane by lane."""

    step: Step
    tested: Array  #: the step itself, and it is wanted
    followed: Array  #: and what it does at gamma_y = 0
    upright: Array  #: the disk does not lie flat
    proved: Array  #: all that, with its case: the path has taken the step
    arrived: Array  #: indices of the lanes that have reached the section
    landing: Return | None  #: and what is proved of them


class LanePath(Path):
    """All orbits from a box in each lane, on their way from the section to its next crossing."""

    proposer: Any  #: a `LaneProposer`

    def __init__(self, model: Model, start: Sequence[Lanes], proposer: LaneProposer) -> None:
        super().__init__(model, start, proposer, derivatives=True)  # type: ignore[arg-type]
        self.time = self.divergence = self.beta_least = zero = start[0].constant(0)
        self.turn_by_start: tuple[Any, ...] = (zero, zero, zero)
        count = len(zero)
        self.steps, self.reversals = np.zeros(count, int), np.zeros(count, int)
        self.turned = np.zeros(count, bool)

    def advance(self) -> Round:
        """One step tried in each lane, and taken where it is proved."""
        trial, verdict, wanted = self.proposer.lengths(self)
        if trial.path is not self:
            raise ValueError("a step from elsewhere was proposed")
        step, tested = trial.tested(verdict), verdict.included & wanted
        followed, crossing = self._followed(step, tested)
        upright = inside(step.enclosure[0], Lanes([0.0], [UPRIGHT]))
        case = cases(self.model, self.box, step)
        if crossing:
            crossing.judge(upright, case)
        proved = followed & upright & np.where(self.turned, case.rises | case.crosses, case.falls | case.turns)
        self._turn(step, case, proved)
        arrived, landing = self._land(step, case, proved)
        self.go_on(step, proved, crossing)
        return Round(step, tested, followed, upright, proved, arrived, landing)

    def _followed(self, step: Step, tested: Array) -> tuple[Array, Any]:
        """Of which tested steps the law is known, and those in which it changes."""
        return tested, None

    def _guess(self, step: Step, index: int) -> Lanes:
        """A moment near the zero of the middle orbit's component."""
        coefficients = [part.midpoints for part in step.polynomials[index]]
        length = step.length.midpoints
        return self._zero(lambda time: polynomial(coefficients, time), 0 * length, length)

    def _zero(self, value: Callable[[Array], Array], begin: Array, end: Array) -> Lanes:
        """A point between the times, near the function's zero."""
        return Lanes(np.clip(self.proposer.zero(value, begin, end), begin, end))

    def _turn(self, step: Step, case: Cases, proved: Array) -> None:
        """Note the turns of proved steps; those whose moment cannot be enclosed are no longer proved."""
        which = np.flatnonzero(proved & ~self.turned & case.turns)
        if not len(which):
            return
        part = some(step, which)
        moment, sure = moment_of_turn(self._model_of(which), part, self._guess(part, 2))
        least, by_start = at_turn(part, moment, True)
        proved[which[~sure]] = False
        which = which[sure]
        self.turned[which] = True
        self.beta_least = replaced(self.beta_least, which, least[sure])
        self.turn_by_start = tuple(
            replaced(old, which, new[sure]) for old, new in zip(self.turn_by_start, by_start, strict=True)
        )

    def _land(self, step: Step, case: Cases, proved: Array) -> tuple[Array, Return | None]:
        """The lanes that have reached the section, taken there; the others that cross are no longer proved."""
        which = np.flatnonzero(proved & self.turned & case.crosses)
        if not len(which):
            return which, None
        part = some(step, which)
        moment, sure = moment_of_crossing(part, self._guess(part, 0), case.speed[which])
        proved[which[~sure]] = False
        which, part, moment = which[sure], some(part, sure), moment[sure]
        if not len(which):
            return which, None
        path = self.some(which)
        path.take(part, moment)
        return which, landed(HALF, path, path.beta_least, path.turn_by_start)

    def go_on(self, step: Step, proved: Array, crossing: Any = None) -> None:
        """Take the proved steps."""
        before = copy(self)
        self.take(step)
        if not proved.all():
            for name in ("frame", "box", "divergence", "time", "steps"):
                old, new = getattr(before, name), getattr(self, name)
                setattr(self, name, mapped(lambda x, y: _chosen(proved, x, y), new, old))

    def some(self, which: Array) -> Self:
        """The path of some lanes."""
        path = copy(self)
        for name, value in vars(self).items():
            if name not in ("model", "sharp", "proposer"):
                setattr(path, name, some(value, which))
        path.model = self._model_of(which)
        return path

    def _model_of(self, which: Array) -> Model:
        return some_model(self.model, which)


def some_model(model: Model, which: Array) -> Model:
    """The model of some lanes; constants that are one lane go with any."""
    constants = type(model.constants)(*(part if len(part) == 1 else part[which] for part in model.constants))
    return type(model)(constants, model.omega[which], model.law)


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


def _chosen(mask: Array, x: Any, y: Any) -> Any:
    return x.where(mask, y) if isinstance(x, Lanes) else np.where(mask, x, y)
