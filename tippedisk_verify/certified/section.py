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

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any

from tippedisk_verify.certified.balls import arb, ball, inside, negative, positive
from tippedisk_verify.certified.flow import Model, Path, Step
from tippedisk_verify.certified.flow import Status as FlowStatus

__all__ = ["UPRIGHT", "HalfFlight", "Status", "half_flight", "moment_of_zero"]

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
    model: Model, gamma_bar: Any, v: Any, *, derivatives: bool = False, longest: float = 60.0
) -> HalfFlight:
    """Enclose the half map over a box on the section, at the working precision; ``longest`` [s] ends the search."""
    path = Path(model, (ball(0), gamma_bar, v), derivatives=derivatives)
    if not negative(path.box[2]):
        return HalfFlight(Status.NO_START, path.time, 0)
    walk = _Walk(model, path)
    while path.time < longest:
        step = _resolved(walk)
        if isinstance(step, Status):
            return HalfFlight(step, path.time, path.steps)
        if walk.crossing is not None:
            return _landed(walk, step)
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
        v_start = self.path.box[2]
        beta_end, _, v_end = step.at(ball(step.length))
        v_all = step.enclosure[2]
        gains = positive(self.model.rates(step.enclosure)[2])
        if not self.turned:
            if negative(v_all) or (gains and negative(v_end)):
                return True
            if not (gains and negative(v_start) and positive(v_end) and negative(beta_end)):
                return False
            return self._turn(step)
        if not positive(v_all):
            if not (gains and positive(v_start) and positive(v_end)):
                return False
            v_all = v_start.union(v_end)  # v rises from one to the other
        if negative(beta_end):
            return True
        if not positive(beta_end):
            return False
        self.crossing = moment_of_zero(step, 0, v_all, lambda state: state[2])
        return self.crossing is not None

    def _turn(self, step: Step) -> bool:
        rates = self.model.rates
        moment = moment_of_zero(step, 2, rates(step.enclosure)[2], lambda state: rates(state)[2])
        if moment is None:
            return False
        self.beta_least = step.at(moment)[0]
        if self.path.sharp:
            # At the turn beta' = 0: moving the moment does not change beta to first order.
            row = step.derivatives_at(moment)[0]
            self.turn_by_start = tuple(
                sum(row[k] * self.path.matrix[k][column] for k in range(3)) + (row[3] if column == 3 else 0)
                for column in (1, 2, 3)
            )
        self.turned = True
        return True


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
    return Status.TOO_WIDE if walk.path.status is FlowStatus.TOO_WIDE else Status.NO_ENCLOSURE


def moment_of_zero(step: Step, index: int, slope: Any, slope_at: Callable[[Any], Any], level: Any = 0) -> Any:
    """The moment in the step when a state's component is at a level, given its slope's positive enclosure over it.

    The component is proved to pass the level, so there is such a moment, and only one. None if its enclosure pokes out
    of the step's time.
    """
    guess = _approximate_zero(step, index, level)
    value = step.at(guess)[index] - level
    moment = guess - value / slope
    for _ in range(_NEWTON_STEPS):
        if not _within(moment, step):
            return None
        # The mean value theorem between the zero and the guess: the slope over both.
        both = moment.union(guess)
        if not _within(both, step):
            return None
        between = slope_at(step.at(both))
        if not positive(between):
            return None
        moment = guess - value / between
    return moment if _within(moment, step) else None


def _within(time: Any, step: Step) -> bool:
    """Whether every moment of the ball lies strictly within the step."""
    return positive(time) and negative(time - step.length)


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


def _landed(walk: _Walk, step: Step) -> HalfFlight:
    path = walk.path
    path.take(step, walk.crossing)
    _, gamma_bar, v = path.box
    derivatives: dict[str, Any] = {}
    if path.sharp:
        acceleration = walk.model.rates((ball(0), gamma_bar, v))[2]
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
        time=path.time,
        image=(-gamma_bar, -v),
        beta_least=walk.beta_least,
        turn_by_start=walk.turn_by_start,
        **derivatives,
    )
