"""What each of many initial states ends on: a picture of the basins, and fractions with their sampling error.

The states fill a plane of constant v in the strip between two noninverted states, one random state in each cell of a
grid (stratified sampling). They run in SIMD lanes, a portion after the other; states whose disk lies flat leave. What
the others end on follows from |gamma - pi/2|, within their well, at the crossings of beta = pi/2 in the last seconds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy

from tippedisk_verify.errors import InputError, NoSuchCycleError, Shortfall
from tippedisk_verify.flow import default_engine, default_lanes
from tippedisk_verify.flow.contract import FLAT, SECTION, Event, Request, Status
from tippedisk_verify.flow.lanes import field_constants
from tippedisk_verify.model.arrays import Array
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.exact import shown
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.orbits.continuation import followed_cycle
from tippedisk_verify.theory.equilibria import is_stable, linearization

__all__ = ["OUTCOMES", "Basins", "basins", "classified_lanes"]

OUTCOMES = ("lies flat", "limit cycle", "inverted spinning", "undecided")
_PORTION = 2048  # states that one task takes
_STRETCH = 5.0  # s; after each, states whose disk lies flat leave their lanes
_LAST = 4.0  # s of crossings that tell the end
_FLAT = Event("lies flat", FLAT.function, terminal=False)
_SECTION = Event("section", SECTION.function, terminal=False)
_MOST_STATES = 10_000_000  # they take some 1.5 GB
_SPEEDS_OF_STATES = 1000.0  # rad/s


@dataclass(frozen=True)
class Basins:
    """What the states ended on."""

    parameters: Parameters
    omega: Fraction  #: [rad/s]
    duration: float  #: [s]
    v: float  #: [rad/s] of every initial state
    beta: Array  #: (rows, columns) [rad]
    gamma: Array  #: (rows, columns) [rad]
    outcome: Any  #: (rows, columns) index into `OUTCOMES`

    def fractions(self) -> dict[str, tuple[float, float]]:
        """For each outcome its share of the plane and two standard errors, those of unstratified sampling at most."""
        count = self.outcome.size
        shares = {}
        for index, name in enumerate(OUTCOMES):
            share = float(numpy.count_nonzero(self.outcome == index)) / count
            # Nothing seen in n tries: less than 3 / n with 95 %.
            shares[name] = share, max(2 * math.sqrt(share * (1 - share) / count), 3 / count)
        return shares

    def json(self) -> dict[str, object]:
        shares = self.fractions()
        return {
            "omega": str(float(self.omega)),
            "friction": self.parameters.friction,
            "states": int(self.outcome.size),
            "seconds": self.duration,
            "v": self.v,
            "fractions": {name: {"value": f"{a:.6f}", "uncertainty": f"{b:.6f}"} for name, (a, b) in shares.items()},
        }


def basins(
    parameters: Parameters,
    omega: object,
    *,
    count: int = 100_000,
    duration: float = 20.0,
    v: float = 0.0,
    seed: int = 1,
    executor: Executor | None = None,
    advance: Callable[[str, int], None] = lambda label, steps: None,
) -> Basins:
    """Run ``count`` states (rounded up to a full grid) for ``duration`` [s] and say what each ends on.

    With an ``executor`` portions run on it, in any order; the result does not depend on it. Raises InputError for a
    count, duration, seed or speed that makes no sense.
    """
    speed = checked_speed(omega)
    if not isinstance(count, int) or not 1 <= count <= _MOST_STATES:
        raise InputError(f"1 to {_MOST_STATES} states can be run, not {shown(count)}")
    if not _LAST < duration <= 10_000:
        raise InputError(f"the duration must lie between {_LAST:g} and 10000 s, not {duration:g}")
    if not abs(v) <= _SPEEDS_OF_STATES:
        raise InputError(f"v must lie between -{_SPEEDS_OF_STATES:g} and {_SPEEDS_OF_STATES:g} rad/s, not {v:g}")
    if not isinstance(seed, int) or seed < 0:
        raise InputError(f"a seed is a whole number that is not negative, not {shown(seed)}")
    columns = max(1, math.ceil(math.sqrt(2 * count)))  # gamma's range is twice beta's
    rows = math.ceil(count / columns)
    random = numpy.random.default_rng(seed)
    place = random.random((2, rows, columns))
    beta = (numpy.arange(rows)[:, None] + place[0]) / rows * math.pi
    gamma = (numpy.arange(columns)[None, :] + place[1]) / columns * 2 * math.pi - math.pi / 2
    states = numpy.column_stack((beta.ravel(), gamma.ravel(), numpy.full(beta.size, v)))
    amplitude = _cycle_amplitude(parameters, speed)
    outcome = numpy.empty(len(states), dtype=numpy.int8)
    portions = [(first, states[first : first + _PORTION]) for first in range(0, len(states), _PORTION)]
    setting = (parameters, speed, duration, amplitude)
    for first, outcomes in _run(portions, setting, executor):
        outcome[first : first + len(outcomes)] = outcomes
        advance("states", len(outcomes))
    return Basins(parameters, speed, duration, v, beta, gamma, outcome.reshape(beta.shape))


def _run(
    portions: list[tuple[int, Any]], setting: tuple[Any, ...], executor: Executor | None
) -> Iterator[tuple[int, Any]]:
    if executor is None:
        for first, states in portions:
            yield first, classified_lanes(states, *setting)
        return
    waiting = {executor.submit(classified_lanes, states, *setting): first for first, states in portions}
    for portion in as_completed(waiting):
        yield waiting[portion], portion.result()


def _cycle_amplitude(parameters: Parameters, omega: Fraction) -> float | None:
    """gamma_bar_0 of the stable limit cycle at this speed, if one is found."""
    try:
        cycle = followed_cycle(parameters, omega, default_engine(), digits=6)
    except (NoSuchCycleError, Shortfall):
        return None
    return float(cycle.gamma_bar_0) if cycle.stable else None


def classified_lanes(
    states: Any, parameters: Parameters, omega: Fraction, duration: float, amplitude: float | None
) -> Any:
    """Outcomes, as indices into `OUTCOMES`, of one portion of states (n, 3)."""
    constants, speed = field_constants(parameters), float(omega)
    stable = is_stable(linearization(parameters, omega))
    outcome = numpy.full(len(states), OUTCOMES.index("undecided"), dtype=numpy.int8)
    moving = numpy.flatnonzero(numpy.sin(states[:, 0]) > 0)
    outcome[numpy.sin(states[:, 0]) <= 0] = OUTCOMES.index("lies flat")
    now = states[moving]
    elapsed = 0.0
    while elapsed < duration and len(moving):
        stretch = min(_STRETCH, duration - _LAST - elapsed) if elapsed < duration - _LAST else duration - elapsed
        last = elapsed + stretch >= duration
        events = (_FLAT, _SECTION) if last else (_FLAT,)
        flights = default_lanes()(
            constants,
            numpy.full(len(moving), speed),
            now,
            numpy.full(len(moving), stretch),
            friction=parameters.friction,
            events=events,
        )
        flat = numpy.zeros(len(moving), dtype=bool)
        crossings: dict[int, list[float]] = {}
        for name, run, _, state in flights.crossings:
            if name == _FLAT.name:
                flat[run] = True
            else:
                crossings.setdefault(run, []).append(_amplitude(state[1]))
        start, now = now, flights.states.copy()
        for run in numpy.flatnonzero(~flights.finished & ~flat).tolist():
            flat[run], now[run], crossings[run] = _alone(parameters, omega, start[run], stretch, last)
        outcome[moving[flat]] = OUTCOMES.index("lies flat")
        if last:
            for run in numpy.flatnonzero(~flat).tolist():
                outcome[moving[run]] = OUTCOMES.index(_ending(crossings.get(run, []), amplitude, stable))
        moving, now = moving[~flat], now[~flat]
        elapsed += stretch
    return outcome


def _amplitude(gamma: float) -> float:
    """|gamma - pi/2| in the well that the state is in."""
    return abs((gamma + math.pi / 2) % (2 * math.pi) - math.pi)


def _ending(amplitudes: list[float], cycle: float | None, inverted_stable: bool) -> str:
    if len(amplitudes) < 2:
        return "undecided"
    before, after = amplitudes[0], amplitudes[-1]
    if cycle is not None and abs(after - cycle) < max(0.95 * abs(before - cycle), cycle / 100):
        return "limit cycle"
    if inverted_stable and after < min(0.9 * before, 1.0):
        return "inverted spinning"
    return "undecided"


def _alone(
    parameters: Parameters, omega: Fraction, start: Any, duration: float, last: bool
) -> tuple[bool, Any, list[float]]:
    """A run that its lane could not finish, by the engine that looks closer."""
    events = (_SECTION,) if last else ()
    result = default_engine()(Request(parameters, omega, start.tolist(), duration, events=events))
    amplitudes = [_amplitude(float(record.state[1])) for record in result.events if record.name == _SECTION.name]
    return result.status is not Status.REACHED, result.state, amplitudes
