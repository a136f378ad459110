"""The maps of two sections, proved: from a section along the flow to the next crossing, the first.

**The half map** (`HALF`) goes from beta = pi/2, v < 0 to the next crossing, v > 0, and back by S, x -> -x in shifted
angles. Of every step one of these is shown, from its enclosure and the balls at its ends,

- *falling*: v < 0 throughout, or v' > 0 throughout and v < 0 at the end; then beta_bar falls;
- *turning*: v' > 0 throughout, v < 0 at the start, v > 0 and beta_bar < 0 at the end; then v has exactly one zero in
  the step, where beta_bar is least, and beta_bar < 0 throughout;
- *rising*: v > 0 throughout, or v' > 0 throughout and v > 0 at the start; if beta_bar < 0 at the end the section is not
  reached, if beta_bar > 0 there it is crossed exactly once, with v > 0.

A path that falls, turns once and rises has beta_bar < 0 between the two sections.

**The turn map** (`TURN`) goes from gamma_bar = 0 to gamma_bar = 2 pi. As long as 0 < beta_bar < pi/2, gamma' =
Omega sin(beta_bar) is positive: an orbit of which this is shown passes gamma_bar = 2 pi exactly once.

Of every step it is shown that |beta_bar| < 1.5707: the disk does not lie flat. Of a step in which the friction law
changes (`sliding.Crossing`) v must keep its sign and gamma_bar must stay below 2 pi, so that neither the turn nor the
section lies in it. A shorter step is asked for where none of this can be shown; if that does not help, the proof ends
with a status that says so.

One `Walk` does this for single balls and for batches, where every round tries a step for each start. What is proved
moves on, and the rest stays where it is. What is proved of a start does not depend on those beside it, but for the
orders of the series and the sums that numpy takes in another order.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Self

import numpy as np

from tippedisk_verify.proofs.kernel.balls import alike, arb, choice, inside, negative, positive
from tippedisk_verify.proofs.kernel.batch import among, replaced, some, some_model
from tippedisk_verify.proofs.kernel.flow import Model, Proposer, Status
from tippedisk_verify.proofs.kernel.sliding import Crossing
from tippedisk_verify.proofs.kernel.step import Step, enclosed_moment

__all__ = ["HALF", "TURN", "UPRIGHT", "Return", "Round", "Section", "Status", "Walk", "returned"]

UPRIGHT = 1.5706999  #: rad; as a radius, rounded up to 30 bits, still below 1.5707 and pi/2: sin(beta) > 0 within
_MOST_CUTS = 40


class Section(NamedTuple):
    """A section with its map: which component is zero on it, which are the coordinates, and what comes after."""

    zero: int  #: of the component that is zero on the section
    first: int  #: of the first coordinate on it; the second is v
    laps: int  #: flights a period: after the half map's come S and another one

    @property
    def sign(self) -> int:
        """Of the image under what comes after the flight."""
        return -1 if self.laps == 2 else 1

    def level(self) -> Any:
        """Of the component where the flight ends."""
        return arb(0) if self.laps == 2 else 2 * arb.pi()

    def start(self, first: Any, v: Any) -> list[Any]:
        """The state (beta_bar, gamma_bar, v) of two coordinates."""
        state = [alike(v, 0), alike(v, 0), v]
        state[self.first] = first
        return state


HALF, TURN = Section(0, 1, 2), Section(1, 0, 1)


@dataclass(frozen=True)
class Return:
    """What is proved of all orbits from a box on a section. Only Status.RETURNED makes the rest mean anything.

    The coordinates x are (gamma_bar, v) for the half map and (beta_bar, v) for the turn map.
    """

    status: Status
    reached: Any  #: how far the path was followed [s]
    steps: Any
    reversals: Any = 0  #: changes of the sliding velocity's sign; counted under the smooth law only
    time: Any = None  #: flight time [s]
    image: Any = None  #: x under the map
    beta_least: Any = None  #: of the half map least beta_bar, at the turn [rad]
    turn_by_start: Any = None  #: derivatives of that by (x, Omega)
    matrix: Any = None  #: d(image)/d(x), over the box and the speeds in their ball
    by_omega: Any = None
    time_by_state: Any = None
    time_by_omega: Any = None
    divergence: Any = None  #: integral of div f over the flight


def returned(
    model: Model,
    section: Section,
    box: Sequence[Any],
    proposer: Proposer,
    *,
    derivatives: bool = False,
    longest: float = 60.0,
) -> Return:
    """Enclose a section's map over a box of its two coordinates; ``longest`` [s] ends the flight."""
    walk = Walk(model, section, box, proposer, derivatives=derivatives)
    path = walk.path
    if section == HALF and not negative(alike(path.time, box[1])):
        return Return(Status.NO_START, path.time, 0)
    while path.time < longest:
        length: Any = None
        tried: Round | None = None
        for _ in range(_MOST_CUTS):
            before, tried = tried, walk.advance(length)
            if tried is None or tried.proved:
                break
            length = 0.7 * tried.step.length
        if tried is None or not tried.proved:
            last = tried or before
            status = Status.FLAT if last and not last.upright else Status.UNRESOLVED if tried else path.status
            return Return(status or Status.NO_ENCLOSURE, path.time, path.steps)
        if tried.landing is not None:
            return tried.landing
    return Return(Status.NO_RETURN, path.time, path.steps)


@dataclass(frozen=True)
class Round:
    """What is proved of one step; of a batch, box by box."""

    step: Step
    upright: Any  #: the disk does not lie flat
    followed: Any  #: the step itself is proved, and what it does at gamma_y = 0
    proved: Any  #: all that, with its case: the path has taken the step, or landed
    arrived: Any  #: the section is reached
    landing: Return | None  #: and what is proved of those that have reached it


class Cases(NamedTuple):
    """What is proved of a step; of a batch, box by box."""

    upright: Any  #: beta_bar stays where it must
    on: Any  #: it falls, or after the turn rises, and the section is not reached
    turns: Any
    crosses: Any
    speed: Any  #: holds the rate of the section's component throughout a step that crosses


class Walk:
    """All orbits from a box on a section, or from each of a batch, on their way to the next crossing."""

    def __init__(
        self, model: Model, section: Section, box: Sequence[Any], proposer: Proposer, *, derivatives: bool = False
    ) -> None:
        self.section = section
        self.path = model.path(section.start(*box), proposer, derivatives=derivatives)
        self.turned = 0 * self.path.steps != 0
        #: least beta_bar, and its derivatives by (gamma_bar, v, Omega), where the path has turned
        self.turn: tuple[Any, Any] = (self.path.time, (self.path.time,) * 3) if section == HALF else (None, None)

    def some(self, which: Any) -> Self:
        """The walk of some boxes of a batch, by mask or indices."""
        walk = copy(self)
        walk.path = self.path.some(which)
        walk.turned, walk.turn = some((self.turned, self.turn), which)
        return walk

    def advance(self, longest: float | None = None) -> Round | None:
        """One step, taken where it is proved; None if the path has none."""
        step = self.path.step(longest)
        if step is None:
            return None
        if step.aside is None:
            return self._advance(step)
        which, crossing = step.aside
        others = self.some(which)  # they take a step of their own, and neither turn nor land
        tried, theirs = self._advance(replace(step, aside=None)), others._advance(crossing)
        self.path.put(which, others.path)
        parts = ((tried.upright, theirs.upright), (tried.followed, theirs.followed), (tried.proved, theirs.proved))
        upright, followed, proved = (replaced(old, which, new) for old, new in parts)
        return Round(step, upright, followed, proved, tried.arrived, tried.landing)

    def _advance(self, step: Step) -> Round:
        case, followed = self._cases(step), step.included & step.followed
        proved = followed & case.upright & (case.on | case.turns | case.crosses)
        proved = self._turn(step, proved & case.turns, proved)
        arrived, landing = self._land(step, proved & case.crosses, case.speed)
        proved = proved & (arrived | (case.crosses ^ True))
        moving = proved & (arrived ^ True)
        if np.any(moving):
            self.path.take(step, where=moving)
        return Round(step, case.upright, followed, proved, arrived, landing)

    def _cases(self, step: Step) -> Cases:
        """The cases of the module's docstring."""
        rates, (beta, _, v) = self.path.model.rates(step.enclosure), step.enclosure
        beta_end, gamma_end, v_end = step.at_end()
        one_law = not isinstance(step, Crossing)
        upright = inside(beta, alike(beta, arb(0, UPRIGHT)))
        if self.section == TURN:
            ahead = gamma_end - TURN.level()
            passed = positive(ahead) & positive(rates[1]) & one_law
            return Cases(upright & positive(beta), negative(ahead), False, passed, rates[1])
        start, gains = self.path.box[2], positive(rates[2]) & one_law
        falls = negative(v) | (gains & negative(v_end))
        turns = gains & negative(start) & positive(v_end) & negative(beta_end)
        rises = positive(v) | (gains & positive(start) & positive(v_end))
        # v climbs from one to the other.
        speed = choice(positive(v), v, start.union(v_end))
        before = self.turned ^ True
        return Cases(
            upright,
            (before & falls) | (self.turned & rises & negative(beta_end)),
            before & turns,
            self.turned & rises & positive(beta_end) & one_law,
            speed,
        )

    def _turn(self, step: Step, turning: Any, proved: Any) -> Any:
        """Notes turns; what is ``proved`` without those whose moment cannot be enclosed."""
        if not np.any(turning):
            return proved
        part, model = some(step, turning), some_model(self.path.model, turning)
        moment, sure = enclosed_moment(
            part,
            part.span(),
            lambda time: part.component(2, time),
            model.rates(part.enclosure)[2],
            lambda time: model.rates(part.at(time))[2],
        )
        enclosed = among(turning, sure)
        # At the turn beta' = 0: moving the moment does not change beta to first order.
        turn = part.component(0, moment), part.derivatives_at(moment)[0][1:] if self.path.sharp else None
        self.turn, self.turned = replaced(self.turn, enclosed, some(turn, sure)), self.turned | enclosed
        return proved & (enclosed | (turning ^ True))

    def _land(self, step: Step, crossing: Any, speed: Any) -> tuple[Any, Return | None]:
        """Which of those that are crossing have arrived, by an enclosed moment; and what is proved of these."""
        if not np.any(crossing):
            return crossing, None
        part, model, section = some(step, crossing), some_model(self.path.model, crossing), self.section
        level = section.level()
        moment, sure = enclosed_moment(
            part,
            part.span(),
            lambda time: part.component(section.zero, time) - level,
            some(speed, crossing),
            lambda time: model.rates(part.at(time))[section.zero],
        )
        arrived = among(crossing, sure)
        if not np.any(arrived):
            return arrived, None
        there = self.some(arrived)
        there.path.take(some(part, sure), some(moment, sure))
        return arrived, there._landed()

    def _landed(self) -> Return:
        """What is proved of orbits whose path has been taken to the section."""
        path, section = self.path, self.section
        first, sign = section.first, section.sign
        derivatives: dict[str, Any] = {}
        if path.sharp:
            state = list(path.box)
            if sign < 0:  # that is where the section lies
                state[section.zero] = alike(state[2], 0)
            rates, columns = path.model.rates(state), (first, 2, 3)
            # On the section time moves with the start, dt = -d(component) / its rate, and takes the others along.
            times = [-path.matrix[section.zero][k] / rates[section.zero] for k in columns]
            rows = [
                [sign * (path.matrix[row][k] + rates[row] * time) for k, time in zip(columns, times, strict=True)]
                for row in (first, 2)
            ]
            derivatives = {
                "matrix": tuple(tuple(row[:2]) for row in rows),
                "by_omega": tuple(row[2] for row in rows),
                "time_by_state": tuple(times[:2]),
                "time_by_omega": times[2],
                "divergence": path.divergence,
            }
        return Return(
            Status.RETURNED,
            path.time,
            path.steps,
            path.reversals,
            time=path.time,
            image=tuple(sign * path.box[row] for row in (first, 2)),
            beta_least=self.turn[0],
            turn_by_start=self.turn[1],
            **derivatives,
        )
