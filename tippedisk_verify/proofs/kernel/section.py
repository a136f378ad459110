"""The half map, proved: from the section beta = pi/2 (v < 0) by the flow to the next crossing (v > 0), and back by S.

The crossing is proved to be the first: of every step one of these is shown, from its enclosure and the balls at its
ends,

- *falling*: v < 0 throughout, or v' > 0 throughout and v < 0 at the end; then beta_bar falls;
- *turning*: v' > 0 throughout, v < 0 at the start, v > 0 and beta_bar < 0 at the end; then v has exactly one zero in
  the step, where beta_bar is least, and beta_bar < 0 throughout;
- *rising*: v > 0 throughout, or v' > 0 throughout and v > 0 at the start; if beta_bar < 0 at the end the section is not
  reached, if beta_bar > 0 there it is crossed exactly once, with v > 0.

A path that falls, turns once and rises has beta_bar < 0 between the two sections. A step of which none of this can be
shown is repeated with a smaller length; if that does not help, the proof ends with a status that says so.

The moment of a zero is enclosed by interval Newton steps T -> t - x(t) / x'(T). Where a ball becomes a point: t is a
midpoint found by bisection and secants, and any t in the step would do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple

from tippedisk_verify.proofs.kernel.balls import alike, arb, ball, choice, inside, negative, positive, within
from tippedisk_verify.proofs.kernel.flow import Model, Path, Step
from tippedisk_verify.proofs.kernel.flow import Status as FlowStatus

__all__ = ["UPRIGHT", "HalfFlight", "Status", "enclosed_moment", "half_flight", "moment_of_zero", "no_step"]

UPRIGHT = 1.5706999  #: rad; as a radius, rounded up to 30 bits, still below 1.5707 and pi/2: sin(beta) > 0 within
_MOST_CUTS = 40
_NEWTON_STEPS = 4


class Status(Enum):
    """How the proof of a half map ended. The value says what happened and what to try next."""

    RETURNED = "the first return to the section is enclosed"
    NO_START = "v < 0 at the start is not proved: start on the other side of the section, or in a narrower box"
    NO_ENCLOSURE = "no step could be enclosed: work in more bits, or start from a narrower box"
    TOO_WIDE = "the enclosure has grown too wide: work in more bits, or start from a narrower box"
    FLAT = "the disk may lie flat (|beta - pi/2| reaches 1.5707): there is no return from here"
    NO_RETURN = "there is no return to the section in the time allowed"
    GRAZING = FlowStatus.GRAZING.value
    UNRESOLVED = "the signs of beta_bar and v could not be proved: work in more bits, or start from a narrower box"


@dataclass(frozen=True)
class HalfFlight:
    """What is proved of all orbits from a box on the section. Only Status.RETURNED makes the rest mean anything.

    ``image`` is S of the end, (gamma_bar, v); ``matrix`` and ``by_omega`` are the half map's derivatives by
    (gamma_bar, v) and by Omega, over the box and the speeds in their ball. For the turn map read beta_bar for
    gamma_bar, and the end itself for its image under S.
    """

    status: Status
    reached: Any  #: how far the path was followed [s]
    steps: int
    reversals: int = 0  #: changes of the sliding velocity's sign; counted under the smooth law only
    time: Any = None  #: flight time [s]
    image: Any = None  #: (gamma_bar, v) [rad, rad/s]
    beta_least: Any = None  #: least beta_bar, at the turn [rad]
    turn_by_start: Any = None  #: derivatives of that by (gamma_bar, v, Omega)
    matrix: Any = None
    by_omega: Any = None
    time_by_state: Any = None
    time_by_omega: Any = None
    divergence: Any = None  #: integral of div f over the flight


def half_flight(
    model: Model,
    gamma_bar: Any,
    v: Any,
    *,
    derivatives: bool = False,
    longest: float = 60.0,
    along: Sequence[Any] = (0, 0),
    watch: Callable[[Step], None] | None = None,
) -> HalfFlight:
    """Enclose the half map over a box on the section, at the working precision; ``longest`` [s] ends the search.

    ``watch`` is called with every step before it is taken.

    Where the model's speed is a ball, the box moves with it, ``along`` [rad s, rad] for each rad/s. The derivatives by
    Omega are then along that line.
    """
    path = model.path((ball(0), gamma_bar, v), derivatives=derivatives, along=(0, *along))
    if not negative(ball(v) + ball(along[1]) * (model.omega - model.omega.mid())):
        return HalfFlight(Status.NO_START, path.time, 0)
    walk = _Walk(model, path)
    while path.time < longest:
        step = _resolved(walk)
        if isinstance(step, Status):
            return HalfFlight(step, path.time, path.steps)
        if watch is not None:
            watch(step)
        if walk.crossing is not None:
            path.take(step, walk.crossing)
            return landed(model, path, walk.beta_least, walk.turn_by_start)
        path.take(step)
    return HalfFlight(Status.NO_RETURN, path.time, path.steps)


class _Walk:
    """Where the path stands between the two sections."""

    def __init__(self, model: Model, path: Path) -> None:
        self.model, self.path = model, path
        self.turned = False
        self.beta_least: Any = None
        self.turn_by_start: Any = None
        self.crossing: Any = None

    def shows(self, step: Step) -> bool:
        """Whether one of the three cases is proved of the step; notes a turn or a crossing."""
        case = cases(self.model, self.path.box, step)
        if self.turned:
            if case.crosses:
                self.crossing, proved = moment_of_crossing(step, _approximate_zero(step, 0, 0), case.speed)
                return bool(proved)
            return bool(case.rises)
        if case.falls or not case.turns:
            return bool(case.falls)
        turn, proved = moment_of_turn(self.model, step, _approximate_zero(step, 2, 0))
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
    length, upright = None, True
    for _ in range(_MOST_CUTS):
        step = walk.path.step(length)
        if step is None:
            break
        upright = inside(step.enclosure[0], arb(0, UPRIGHT))
        if upright and walk.shows(step):
            return step
        length = 0.7 * step.length
    if not upright:
        return Status.FLAT
    if step is not None:
        return Status.UNRESOLVED
    return no_step(walk.path)


def no_step(path: Path) -> Status:
    """Why the path has no next step."""
    known = {FlowStatus.TOO_WIDE: Status.TOO_WIDE, FlowStatus.GRAZING: Status.GRAZING}
    return known.get(path.status, Status.NO_ENCLOSURE) if path.status else Status.NO_ENCLOSURE


def moment_of_zero(step: Step, index: int, slope: Any, slope_at: Callable[[Any], Any], level: Any = 0) -> Any:
    """The moment in the step when a state's component is at a level, given its slope's positive enclosure over it.

    The component is proved to pass the level, so there is such a moment, and only one. None if its slope is not proved.
    """
    guess = _approximate_zero(step, index, level)
    moment, proved = enclosed_moment(
        step, guess, lambda t: step.at(t)[index] - level, slope, lambda t: slope_at(step.at(t))
    )
    return moment if proved else None


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


def _approximate_zero(step: Step, index: int, level: Any) -> Any:
    """A number in the step near the zero, by bisection and then Newton's iteration on the midpoints."""
    low, high = 0.0, step.length
    for _ in range(20):
        middle = (low + high) / 2
        if (step.at(ball(middle))[index] - level).mid() < 0:
            low = middle
        else:
            high = middle
    guess, before = ball((low + high) / 2), ball((low + high) / 2 + 0.01 * step.length)
    f_before = (step.at(before)[index] - level).mid()
    for _ in range(12):  # a secant's order is 1.6: from 20 bits to 20 * 1.6^12 = 5600
        f = (step.at(guess)[index] - level).mid()
        if f == f_before:
            break
        ahead = (guess - f * (guess - before) / (f - f_before)).mid()
        if not 0 < ahead < step.length:
            break
        before, f_before, guess = guess, f, ahead
    return guess.mid()


def landed(model: Model, path: Path, beta_least: Any, turn_by_start: Any) -> HalfFlight:
    """What is proved of orbits whose path has been taken to the section."""
    _, gamma_bar, v = path.box
    derivatives: dict[str, Any] = {}
    if path.sharp:
        acceleration = model.rates((alike(v, 0), gamma_bar, v))[2]
        columns = (1, 2, 3)
        # On the section time moves with the start, dt = -d(beta)/v; gamma' = -Omega cos(beta) is zero there.
        flight = [-path.matrix[0][k] / v for k in columns]
        gamma_row = [-path.matrix[1][k] for k in columns]
        v_row = [-(path.matrix[2][k] + acceleration * t) for k, t in zip(columns, flight, strict=True)]
        derivatives = {
            "matrix": ((gamma_row[0], gamma_row[1]), (v_row[0], v_row[1])),
            "by_omega": (gamma_row[2], v_row[2]),
            "time_by_state": (flight[0], flight[1]),
            "time_by_omega": flight[2],
            "divergence": path.divergence,
        }
    return HalfFlight(
        Status.RETURNED,
        path.time,
        path.steps,
        path.reversals,
        time=path.time,
        image=(-gamma_bar, -v),
        beta_least=beta_least,
        turn_by_start=turn_by_start,
        **derivatives,
    )
