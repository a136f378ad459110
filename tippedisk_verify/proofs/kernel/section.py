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

Of every step it is shown that |beta_bar| < 1.5707: the disk does not lie flat. A shorter step is asked for where none
of this can be shown; if that does not help, the proof ends with a status that says so.

The moment of a zero is enclosed by interval Newton steps T -> t - x(t) / x'(T), from a point t in the step; any would
do.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from tippedisk_verify.proofs.kernel.balls import alike, arb, choice, inside, need, negative, positive, within
from tippedisk_verify.proofs.kernel.flow import Model, Path, Proposer, Status, Step

__all__ = ["HALF", "TURN", "UPRIGHT", "Return", "Section", "Status", "enclosed_moment", "returned"]

UPRIGHT = 1.5706999  #: rad; as a radius, rounded up to 30 bits, still below 1.5707 and pi/2: sin(beta) > 0 within
_MOST_CUTS = 40
_NEWTON_STEPS = 4


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
    steps: int
    reversals: int = 0  #: changes of the sliding velocity's sign; counted under the smooth law only
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
    path = model.path(section.start(*box), proposer, derivatives=derivatives)
    if section == HALF and not negative(alike(path.box[2], box[1])):
        return Return(Status.NO_START, path.time, 0)
    walk = (_HalfWalk if section == HALF else _TurnWalk)(model, path)
    while path.time < longest:
        step = _resolved(walk)
        if isinstance(step, Status):
            return Return(step, path.time, path.steps)
        path.take(step, walk.crossing)
        if walk.crossing is not None:
            return landed(section, path, walk.beta_least, walk.turn_by_start)
    return Return(Status.NO_RETURN, path.time, path.steps)


class _Walk(ABC):
    """Where the path stands between two crossings of the section."""

    def __init__(self, model: Model, path: Path) -> None:
        self.model, self.path = model, path
        self.beta_least: Any = None
        self.turn_by_start: Any = None
        self.crossing: Any = None

    @abstractmethod
    def leans(self, step: Step) -> Any:
        """Whether beta_bar is proved to stay where it must."""

    @abstractmethod
    def shows(self, step: Step) -> bool:
        """Whether what the step must do is proved of it; notes a crossing."""

    def guess(self, step: Step, index: int, level: Any) -> Any:
        """A moment in the step, to begin with."""
        moment = self.path.proposer.moment(step, index, level)
        need(bool(moment >= 0 and moment <= step.length), "a moment is proposed that does not lie in its step")
        return moment


class _TurnWalk(_Walk):
    """From gamma_bar = 0 to 2 pi: the step ends before, or crosses."""

    def leans(self, step: Step) -> Any:
        return positive(step.enclosure[0]) and inside(step.enclosure[0], arb(0, UPRIGHT))

    def shows(self, step: Step) -> bool:
        level = TURN.level()
        ahead = step.at_end()[1] - level
        if not positive(ahead):
            return bool(negative(ahead))
        slope = self.model.rates(step.enclosure)[1]
        self.crossing, proved = enclosed_moment(
            step,
            self.guess(step, 1, level),
            lambda t: step.at(t)[1] - level,
            slope,
            lambda t: self.model.rates(step.at(t))[1],
        )
        return bool(positive(slope) and proved)


class _HalfWalk(_Walk):
    """From beta_bar = 0, v < 0: one of the three cases, and a turn is noted."""

    turned = False

    def leans(self, step: Step) -> Any:
        return inside(step.enclosure[0], arb(0, UPRIGHT))

    def shows(self, step: Step) -> bool:
        case = cases(self.model, self.path.box, step)
        if self.turned:
            if case.crosses:
                self.crossing, proved = moment_of_crossing(step, self.guess(step, 0, 0), case.speed)
                return bool(proved)
            return bool(case.rises)
        if case.falls or not case.turns:
            return bool(case.falls)
        turn, proved = moment_of_turn(self.model, step, self.guess(step, 2, 0))
        if not proved:
            return False
        self.beta_least, self.turn_by_start = at_turn(step, turn, self.path.sharp)
        self.turned = True
        return True


class Cases(NamedTuple):
    """What is proved of a step, lane by lane where there are lanes."""

    falls: Any
    turns: Any
    rises: Any  #: and beta_bar < 0 at its end
    crosses: Any
    speed: Any  #: holds v throughout the step, if v rises


def cases(model: Model, box: Sequence[Any], step: Step) -> Cases:
    """The cases of the module's docstring; ``box`` holds the states at the step's start."""
    v_start, v_all = box[2], step.enclosure[2]
    beta_end, _, v_end = step.at_end()
    gains = positive(model.rates(step.enclosure)[2])
    climbs = gains & positive(v_start) & positive(v_end)
    rises = positive(v_all) | climbs
    return Cases(
        falls=negative(v_all) | (gains & negative(v_end)),
        turns=gains & negative(v_start) & positive(v_end) & negative(beta_end),
        rises=rises & negative(beta_end),
        crosses=rises & positive(beta_end),
        speed=choice(positive(v_all), v_all, v_start.union(v_end)),  # v climbs from one to the other
    )


def moment_of_turn(model: Model, step: Step, guess: Any) -> tuple[Any, Any]:
    """When v = 0 in a step that is proved to turn, and whether that is proved."""
    slope = model.rates(step.enclosure)[2]
    return enclosed_moment(step, guess, lambda t: step.at(t)[2], slope, lambda t: model.rates(step.at(t))[2])


def moment_of_crossing(step: Step, guess: Any, speed: Any) -> tuple[Any, Any]:
    """When beta_bar = 0 in a step that is proved to cross the section, and whether that is proved."""
    return enclosed_moment(step, guess, lambda t: step.at(t)[0], speed, lambda t: step.at(t)[2])


def at_turn(step: Step, moment: Any, derivatives: bool) -> tuple[Any, Any]:
    """The least beta_bar, and its derivatives by (gamma_bar, v, Omega) if they are asked for."""
    # At the turn beta' = 0: moving the moment does not change beta to first order.
    return step.at(moment)[0], step.derivatives_at(moment)[0][1:] if derivatives else None


def _resolved(walk: _Walk) -> Step | Status:
    """A step of which one of the cases is proved, cut shorter until it is."""
    length, leans = None, True
    for _ in range(_MOST_CUTS):
        step = walk.path.step(length)
        if step is None:
            break
        leans = walk.leans(step)
        if leans and walk.shows(step):
            return step
        walk.crossing, length = None, 0.7 * step.length
    if not leans:
        return Status.FLAT
    return Status.UNRESOLVED if step is not None else walk.path.status or Status.NO_ENCLOSURE


def enclosed_moment(
    step: Step, guess: Any, value_at: Callable[[Any], Any], slope: Any, slope_at: Callable[[Any], Any]
) -> tuple[Any, Any]:
    """All zeros of functions of time, of which each has one in the step, and whether the enclosure is proved.

    ``value_at`` and ``slope_at`` enclose the functions and their derivatives at a ball of times within the step;
    ``slope`` holds the positive derivatives between the guess and the zeros.
    """
    value = value_at(guess)
    # The zero is in the step: what the quotients hold beyond it is left out.
    moment = within(guess - value / slope, step.length)
    proved = positive(moment + 1)
    for _ in range(_NEWTON_STEPS):
        # The mean value theorem between the zero and the guess: the slope over both.
        between = slope_at(moment.union(guess))
        moment = within(guess - value / between, step.length)
        proved = proved & positive(between) & positive(moment + 1)
    return moment, proved


def landed(section: Section, path: Path, beta_least: Any, turn_by_start: Any) -> Return:
    """What is proved of orbits whose path has been taken to the section."""
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
        beta_least=beta_least,
        turn_by_start=turn_by_start,
        **derivatives,
    )
