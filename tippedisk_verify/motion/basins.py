"""The outcomes of many initial states: the basins, and shares with their sampling error.

The states fill a plane of constant v in the strip between two noninverted states, with one random
state in each cell of a grid (stratified sampling). They run in SIMD lanes, in tasks of `_TASK_SIZE`
states, and states whose disk lies flat leave their lanes. The outcome of the others follows from
|gamma - pi/2|, within their well, at the crossings of beta = pi/2 in the last seconds.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import Any

import numpy

from tippedisk_verify.cycles.cycle_at_speed import librating_cycle_at, rotating_cycle_at
from tippedisk_verify.display import Printable
from tippedisk_verify.errors import AccuracyError, InputError, NoConnectionError, NoSuchCycleError
from tippedisk_verify.flow import default_batch_engine, default_engine
from tippedisk_verify.flow.batch import equation_constants
from tippedisk_verify.flow.contract import FLAT, GAMMA_TOP, SECTION, Event, Request, Status
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.motion.scenes import angle_from_inverted
from tippedisk_verify.numbers.arrays import Array
from tippedisk_verify.numbers.decimals import exact_text
from tippedisk_verify.numbers.exact import checked_integer, short_text
from tippedisk_verify.numbers.numpy_errors import ignore_numpy_errors
from tippedisk_verify.numbers.precision import DOUBLE
from tippedisk_verify.support.parallel import map_of
from tippedisk_verify.theory.equilibria import is_stable, linearization

__all__ = ["MAX_ABS_V", "OUTCOMES", "Basins", "basins", "integrate_outcomes"]

OUTCOMES = ("lies flat", "limit cycle", "rotating cycle", "inverted spinning", "undecided")
_FLAT_INDEX, _UNDECIDED = OUTCOMES.index("lies flat"), OUTCOMES.index("undecided")
_TASK_SIZE = 2048  # the number of states in a task
_STRETCH_TIME = 5.0  # s; after each stretch, states whose disk lies flat leave their lanes
_LAST_SECONDS = 4.0  # s of crossings that decide the outcome
_LAST_PERIODS = 2.5  # periods of the cycle, which decide instead if they take longer
_MAX_RUN = 8  # the longest run of an undecided state, in units of the duration
_FLAT = Event("lies flat", FLAT.function, terminal=False)
_SECTION = Event("section", SECTION.function, terminal=False)
_TOP_OR_BOTTOM = Event("top or bottom", GAMMA_TOP.function, terminal=False)
_MAX_STATES = 10_000_000  # they take about 1.5 GB
MAX_ABS_V = 1000.0  #: rad/s; the largest |v| of a state

_NamedState = tuple[str, Sequence[float]]  # event and state


@dataclass(frozen=True, repr=False)
class Basins(Printable):
    """The outcomes of many initial states with the same v: where each of them ends."""

    parameters: Parameters
    omega: Fraction  #: [rad/s]
    duration: float  #: [s]
    v: float  #: [rad/s] of every initial state
    beta: Array  #: (rows, columns) [rad]
    gamma: Array  #: (rows, columns) [rad]
    outcome: Any  #: (rows, columns) index into `OUTCOMES`

    def shares(self) -> dict[str, tuple[float, float]]:
        """Return the share of the initial states that has each outcome, with two standard errors,
        by outcome.

        The error is that of unstratified sampling, which is an upper bound.
        """
        count = self.outcome.size
        shares = {}
        for index, name in enumerate(OUTCOMES):
            share = float(numpy.count_nonzero(self.outcome == index)) / count
            # If n tries show none, the share is below 3 / n with a probability of 95 %.
            shares[name] = share, max(2 * math.sqrt(share * (1 - share) / count), 3 / count)
        return shares

    def rows(self) -> list[tuple[float, float, float, str]]:
        """Return a row for each initial state: beta [rad], gamma [rad], v [rad/s] and the outcome's
        name.
        """
        states = zip(
            *(part.ravel().tolist() for part in (self.beta, self.gamma, self.outcome)), strict=True
        )
        return [(beta, gamma, self.v, OUTCOMES[outcome]) for beta, gamma, outcome in states]

    def to_dict(self) -> dict[str, object]:
        """Return the outcomes' shares with speed, friction law and sizes as data for JSON."""
        shares = self.shares()
        return {
            "omega": exact_text(self.omega),
            "friction": self.parameters.law.name,
            "states": int(self.outcome.size),
            "seconds": self.duration,
            "v": self.v,
            "shares": {
                name: {"value": f"{a:.6f}", "uncertainty": f"{b:.6f}"}
                for name, (a, b) in shares.items()
            },
        }


@ignore_numpy_errors()
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
    """Integrate many random initial states and return the outcome of each: where it ends.

    Undecided states run on, up to eight times as long.

    Args:
        parameters: The disk.
        omega: The spinning speed [rad/s].
        count: The number of states, which is rounded up to a full grid.
        duration: The time of a run [s].
        v: The velocity of every initial state [rad/s].
        seed: The seed of the random states.
        executor: Runs the tasks; the result does not depend on it.
        advance: Receives the number of finished states.

    Returns:
        The initial states and the outcome of each, as arrays (rows, columns).

    Raises:
        InputError: If an argument cannot be used.
    """
    speed = checked_speed(omega)
    duration, v = DOUBLE.number(duration), DOUBLE.number(v)
    count = checked_integer(
        count, 1, _MAX_STATES, f"1 to {_MAX_STATES} states can be run, not {{}}"
    )
    if not _LAST_SECONDS < duration <= 10_000:
        raise InputError(
            f"the duration must be more than {_LAST_SECONDS:g} s and at most 10000 s, "
            f"not {duration:g}"
        )
    if not abs(v) <= MAX_ABS_V:
        raise InputError(f"v must lie between -{MAX_ABS_V:g} and {MAX_ABS_V:g} rad/s, not {v:g}")
    if not isinstance(seed, int) or seed < 0:
        raise InputError(f"a seed is a whole number that is not negative, not {short_text(seed)}")
    columns = max(1, math.ceil(math.sqrt(2 * count)))  # gamma's range is twice beta's
    rows = math.ceil(count / columns)
    random = numpy.random.default_rng(seed)
    place = random.random((2, rows, columns))
    beta = (numpy.arange(rows)[:, None] + place[0]) / rows * math.pi
    gamma = (numpy.arange(columns)[None, :] + place[1]) / columns * 2 * math.pi - math.pi / 2
    states = numpy.column_stack((beta.ravel(), gamma.ravel(), numpy.full(beta.size, v)))
    classify = partial(
        integrate_outcomes,
        parameters=parameters,
        omega=speed,
        duration=duration,
        attractors=Attractors.at(parameters, speed),
    )
    tasks = [states[first : first + _TASK_SIZE] for first in range(0, len(states), _TASK_SIZE)]
    outcomes = []
    for task_outcomes in map_of(executor)(classify, tasks):
        outcomes.append(task_outcomes)
        advance("states", len(task_outcomes))
    return Basins(
        parameters, speed, duration, v, beta, gamma, numpy.concatenate(outcomes).reshape(beta.shape)
    )


@dataclass(frozen=True)
class Attractors:
    """The attractors of upright orbits at one speed, with the numbers that distinguish them."""

    amplitude: float | None = None  #: gamma_bar_0 of the stable limit cycle [rad]
    lean: float | None = None  #: |beta - pi/2| of the stable rotating cycle at gamma = pi/2 [rad]
    inverted: bool = False  #: True if inverted spinning is stable
    deciding_time: float = _LAST_SECONDS  #: [s] of the crossings that decide

    @classmethod
    def at(cls, parameters: Parameters, omega: Fraction) -> Attractors:
        """Return the attractors at a speed [rad/s]; a cycle that is not found is left out.

        Args:
            parameters: The disk.
            omega: The spinning speed [rad/s].
        """
        amplitude = lean = None
        period = 0.0
        with suppress(NoSuchCycleError, AccuracyError):
            cycle = librating_cycle_at(parameters, omega, default_engine(), digits=6)
            if cycle.stable:
                amplitude, period = float(cycle.gamma_bar_0), float(cycle.period)
        if amplitude is None:
            with suppress(NoSuchCycleError, NoConnectionError, AccuracyError):
                rotating = rotating_cycle_at(parameters, omega, default_engine(), digits=6)
                lean, period = float(rotating.beta_bar_top), float(rotating.period)
        stable = is_stable(linearization(parameters, omega))
        return cls(amplitude, lean, stable, max(_LAST_SECONDS, _LAST_PERIODS * period))

    def outcome_of(self, crossings: Sequence[_NamedState]) -> str:
        """Return the outcome of an orbit, the attractor that it approaches, from its recorded
        crossings.

        It depends on how |gamma - pi/2| at upright states, or |beta - pi/2|, has changed.

        Args:
            crossings: The name and the state of each crossing, in their order.
        """
        amplitudes = [
            abs(angle_from_inverted(state[1])) for name, state in crossings if name == _SECTION.name
        ]
        tops = [
            state
            for name, state in crossings
            if name == _TOP_OR_BOTTOM.name and math.sin(state[1]) > 0
        ]
        leans = [abs(state[0] - math.pi / 2) for state in tops]
        if len(amplitudes) >= 2:
            before, after = amplitudes[0], amplitudes[-1]
            if self.amplitude is not None and _closer(before, after, self.amplitude):
                return "limit cycle"
            if self.inverted and after < min(0.9 * before, 1.0):
                return "inverted spinning"
        elif self.lean is not None and len(leans) >= 2 and _closer(leans[0], leans[-1], self.lean):
            return "rotating cycle"
        return "undecided"


def _closer(before: float, after: float, cycle: float) -> bool:
    """Return True if an orbit's coordinate on a section comes closer to that of a limit cycle from
    one crossing to another, or has arrived.
    """
    return abs(after - cycle) < max(0.95 * abs(before - cycle), cycle / 100)


def integrate_outcomes(
    states: Any, parameters: Parameters, omega: Fraction, duration: float, attractors: Attractors
) -> Any:
    """Integrate one portion of initial states and return their outcomes, as indices into
    `OUTCOMES`.

    Args:
        states: (n, 3) beta, gamma [rad], v [rad/s].
        parameters: The disk.
        omega: The spinning speed [rad/s].
        duration: The time of a run [s].
        attractors: The attractors at the speed.
    """
    outcomes = numpy.full(len(states), _UNDECIDED, dtype=numpy.int8)
    moving = numpy.flatnonzero(numpy.sin(states[:, 0]) > 0)
    outcomes[numpy.sin(states[:, 0]) <= 0] = _FLAT_INDEX
    now = states[moving]
    until, elapsed = max(0.0, duration - attractors.deciding_time), 0.0
    while elapsed < _MAX_RUN * duration and len(moving):
        deciding = elapsed >= until
        stretch = attractors.deciding_time if deciding else min(_STRETCH_TIME, until - elapsed)
        now, flat, crossings = _run(parameters, omega, now, stretch, record=deciding)
        outcomes[moving[flat]] = _FLAT_INDEX
        going = ~flat
        if deciding:
            for n in numpy.flatnonzero(going).tolist():
                outcome = attractors.outcome_of(crossings[n])
                outcomes[moving[n]] = OUTCOMES.index(outcome)
                going[n] = outcome == "undecided"
        moving, now = moving[going], now[going]
        elapsed += stretch
    return outcomes


def _run(
    parameters: Parameters, omega: Fraction, now: Any, duration: float, *, record: bool
) -> tuple[Any, Any, dict[int, list[_NamedState]]]:
    """Integrate all states (n, 3) for a duration [s].

    They run in lanes. The default engine, one run at a time, computes what a lane cannot finish.

    Returns:
        The states (n, 3) at the end, a mask (n,) of the disks that lie flat, and the crossings of
        each run by its index. Without ``record`` only crossings into lying flat are recorded.
    """
    events = (_FLAT, _SECTION, _TOP_OR_BOTTOM) if record else (_FLAT,)
    count = len(now)
    batch = default_batch_engine()(
        equation_constants(parameters),
        numpy.full(count, float(omega)),
        now,
        numpy.full(count, duration),
        friction=parameters.friction,
        events=events,
    )
    states, flat = batch.states.copy(), numpy.zeros(count, dtype=bool)
    crossings: dict[int, list[_NamedState]] = defaultdict(list)
    for name, n, _, state in batch.crossings:
        crossings[n].append((name, state))
        flat[n] |= name == _FLAT.name
    for n in numpy.flatnonzero(~batch.finished & ~flat).tolist():
        result = default_engine()(
            Request(parameters, omega, now[n].tolist(), duration, events=events[1:])
        )
        flat[n], states[n] = result.status is not Status.REACHED, result.state
        crossings[n] = [(crossing.name, crossing.state.tolist()) for crossing in result.events]
    return states, flat, crossings
