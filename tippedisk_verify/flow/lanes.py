"""Many runs at once in double: heyoka's batch mode, one run in each SIMD lane.

For lists of speeds or starts that need the same thing. Every run has its own speed, start and duration; the lanes of a
batch share the compiled code. Nothing here estimates an error: callers measure it on their runs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any
from weakref import proxy

import numpy

from tippedisk_verify.errors import InputError
from tippedisk_verify.flow.contract import FLAT, SLIDING_REVERSAL, Event, Variation
from tippedisk_verify.flow.one_at_a_time import Kept, OneAtATime, building
from tippedisk_verify.flow.start import LONGEST_WINDOW, START_WINDOW, event_values, start_window, starts_on
from tippedisk_verify.flow.switching import FrictionSigns
from tippedisk_verify.flow.system import (
    SWITCH,
    TURN_OVER,
    constants_of,
    direction_of,
    parameter_names,
    system_of,
)
from tippedisk_verify.model.arrays import Array
from tippedisk_verify.model.equations import field, products, shifted
from tippedisk_verify.model.exact import shown
from tippedisk_verify.model.parameters import Friction, Parameters, checked_friction
from tippedisk_verify.model.precision import DOUBLE, heyoka_module
from tippedisk_verify.model.results import Printable

__all__ = ["BatchResult", "BatchTaylor", "field_constants"]


@dataclass(frozen=True, repr=False)
class BatchResult(Printable):
    """What became of n runs. Arrays are doubles; a run that did not finish has NaN everywhere.

    With the smooth law a run whose branch was in doubt for a moment (two switches closer than events can tell) counts
    as not finished: the Taylor engine, one at a time, can do it.
    """

    states: Array  #: (n, 3) final (beta, gamma, v)
    derivatives: Any = None  #: (n, 3, number of variations) at fixed final time
    divergence: Array | None = None  #: (n,) integral of div f along the orbit [1]
    crossings: tuple[tuple[str, int, float, tuple[float, float, float]], ...] = ()  #: event, run, time [s], state
    finished: Any = None  #: (n,) whether the final time was reached


def field_constants(parameters: Parameters) -> Array:
    """The field's constants in double as an array: (r, e, a, b, g, k), or traction and epsilon instead of k."""
    constants = parameters.at(DOUBLE)
    return numpy.array([getattr(constants, name) for name in parameter_names(parameters.friction)[1:]])


_MOST_LANES = 64  # eight times what the widest registers hold; compiling takes longer with each


class BatchTaylor:
    """The engine for many runs. What a call needs is compiled once per instance and kept.

    ``width`` is the number of lanes; by default what this machine's SIMD registers hold. Threads may share an instance:
    a call waits until what it needs is free.
    """

    def __init__(self, width: int | None = None) -> None:
        if width is not None and not 1 <= width <= _MOST_LANES:
            raise InputError(f"a batch has 1 to {_MOST_LANES} lanes, not {shown(width)}")
        self.width = width or int(heyoka_module().recommended_simd_size())
        self._batches = Kept()

    def __call__(
        self,
        constants: Any,
        omegas: Any,
        states: Any,
        durations: Any,
        *,
        variations: tuple[Variation, ...] = (),
        divergence: bool = False,
        shifted: bool = False,
        friction: Friction = "linear",
        events: tuple[Event, ...] = (),
        max_steps: int = 100_000,
    ) -> BatchResult:
        """Run from ``states`` (n, 3) at speeds ``omegas`` (n,) for ``durations`` (n,).

        ``constants`` is (6,) or (n, 6), as `field_constants` gives them. With ``shifted`` angles are measured
        from pi/2. ``events`` are recorded and end nothing; a start on the surface is no crossing.
        Raises InputError for what is no array of numbers, if the shapes do not match, or if an event is terminal.
        """
        names = parameter_names(checked_friction(friction))
        try:
            given = (numpy.asarray(part, dtype=float) for part in (constants, omegas, states, durations))
            constants, omegas, states, durations = given
        except (TypeError, ValueError, OverflowError):
            raise InputError("constants, speeds, states and durations of many runs are arrays of numbers") from None
        count = omegas.size
        if omegas.shape != (count,) or states.shape != (count, 3) or durations.shape != (count,):
            raise InputError(f"{count} speeds need states ({count}, 3) and as many durations")
        if constants.shape not in ((len(names) - 1,), (count, len(names) - 1)):
            raise InputError(f"the constants of the {friction} law are {len(names) - 1}, or as many for each run")
        if any(event.terminal for event in events):
            raise InputError("events of many runs at once are recorded; they cannot end a run")
        key = (variations, divergence, events, shifted, friction)
        batch = self._batches.get(key)
        if batch is None:
            with building():
                batch = self._batches.get(key)
                if batch is None:  # another thread may have been faster
                    self._batches.make_room()
                    batch = self._batches[key] = OneAtATime(_Batch(self.width, *key))
        given_products = batch.runner.products
        pars = numpy.empty((len(names) + given_products, count))
        pars[0] = omegas
        pars[1 : len(names)] = numpy.broadcast_to(constants, (count, len(names) - 1)).T
        if given_products:
            known = products(constants_of(pars, friction), omegas)[:given_products]
            pars[len(names) :] = numpy.stack(numpy.broadcast_arrays(*known))
        flights: BatchResult = batch.run(pars, states.T, durations, max_steps)
        if not flights.crossings:
            return flights
        start = _Starts(events, pars, states, shifted, friction)
        return replace(
            flights, crossings=tuple(crossing for crossing in flights.crossings if not start.is_all_of(*crossing))
        )


class _Starts:
    """Where the runs start, to tell their crossings from starts on an event's surface."""

    def __init__(self, events: Sequence[Event], pars: Any, states: Any, shift: bool, friction: Friction) -> None:
        self._events = {event.name: event for event in events}
        self._pars, self._states, self._friction = pars, states, friction
        self._ops = shifted(math) if shift else math

    def is_all_of(self, name: str, run: int, when: float, state: tuple[float, float, float]) -> bool:
        """Whether a crossing is only that: the run starts on the surface, or rests on it for ever."""
        start = self._states[run].tolist()
        if abs(when) > LONGEST_WINDOW and state != tuple(start):
            return False
        pars, event = self._pars[:, run].tolist(), self._events[name]
        constants, omega = constants_of(pars, self._friction), pars[0]
        if not starts_on(event, self._ops, constants, omega, start, 2.0**-52):
            return False
        flow = field(self._ops, constants, omega, self._friction)
        if not any(flow(*start)):
            return True
        window, _ = start_window(event, self._ops, constants, omega, start, flow, when >= 0)
        return abs(when) <= window


class _Batch:
    def __init__(
        self,
        width: int,
        variations: tuple[Variation, ...],
        divergence: bool,
        events: Sequence[Event],
        shift: bool,
        friction: Friction,
    ) -> None:
        hy = heyoka_module()
        smooth = friction == "smooth"
        # The smooth law changes its branch at sliding reversals and where the disk lies flat: of two events at the same
        # time one is lost, so one serves for both.
        flat = [event.name for event in events if smooth and event.function is FLAT.function]
        reversals = [event for event in events if smooth and event.function is SLIDING_REVERSAL.function]
        events = [event for event in events if event.name not in flat and event not in reversals]
        system, crossings, self.products = system_of(
            variations, divergence, (*events, SWITCH, TURN_OVER) if smooth else events, shift, smooth
        )
        count = len(parameter_names(friction)) + self.products + smooth
        self._width, self._shift = width, 3 + divergence
        self._variations, self._divergence = len(variations), divergence
        self._events, self._shifted, self._friction = tuple(events), shift, friction
        self._names: list[tuple[str, int, float, tuple[float, float, float]]] = []
        self._first = 0
        options: dict[str, Any] = {}
        if events:
            options["nt_events"] = [
                hy.nt_event_batch(
                    crossings[event.name], self._recorder(event.name), direction=direction_of(hy, event.direction)
                )
                for event in events
            ]
        self._branches = FrictionSigns(friction, shift) if smooth else None
        if self._branches is not None:
            options["t_events"] = [
                hy.t_event_batch(
                    crossings[SWITCH.name], callback=self._reversed(self._branches, reversals), cooldown=START_WINDOW
                ),
                hy.t_event_batch(
                    crossings[TURN_OVER.name], callback=self._turned(self._branches, flat), cooldown=START_WINDOW
                ),
            ]
        start = numpy.zeros((self._shift, width))
        start[0] = start[1] = 1.0
        self._stepper: Any = hy.taylor_adaptive_batch(system, start, pars=numpy.ones((count, width)), **options)
        # What follows the state: the integral of the divergence starts at 0, the derivatives at the identity.
        self._rest = self._stepper.state[3:].copy()
        self._reached = hy.taylor_outcome.time_limit

    def run(self, pars: Any, states: Any, durations: Any, max_steps: int) -> BatchResult:
        count, width, stepper = len(durations), self._width, self._stepper
        final = numpy.empty((len(stepper.state), count))
        finished = numpy.empty(count, dtype=bool)
        self._names.clear()
        for first in range(0, count, width):
            size = min(width, count - first)
            # Lanes left over repeat the last run.
            lanes = (
                numpy.minimum(numpy.arange(first, first + width), count - 1)
                if size < width
                else slice(first, first + width)
            )
            self._first = first
            final[:, first : first + size], finished[first : first + size] = self._propagated(
                pars[:, lanes], states[:, lanes], durations[lanes], size, max_steps
            )
        final[:, ~finished] = numpy.nan
        derivatives = None
        if self._variations:
            # Rows of the divergence, if it was asked for, are not wanted.
            shape = (self._shift, self._variations, count)
            derivatives = final[self._shift :].reshape(shape)[:3].transpose(2, 0, 1)
        return BatchResult(
            states=final[:3].T,
            derivatives=derivatives,
            divergence=final[3] if self._divergence else None,
            crossings=tuple(self._names),
            finished=finished,
        )

    def _propagated(self, pars: Any, states: Any, durations: Any, size: int, max_steps: int) -> tuple[Any, Any]:
        stepper = self._stepper
        stepper.set_time(0.0)
        stepper.pars[: len(pars)] = pars
        stepper.state[:3] = states
        if self._branches is not None:
            self._branches.begin(stepper, durations)
        stepper.state[3:] = self._rest
        if self._names is not None and stepper.with_events:
            stepper.reset_cooldowns()
        mark = len(self._names)
        if self._on_edge(states):
            stepper.propagate_until(numpy.copysign(numpy.minimum(START_WINDOW, abs(durations) / 2), durations))
        stepper.propagate_until(durations, max_steps=max_steps)
        reached = numpy.array([result[0] == self._reached for result in stepper.propagate_res])
        if self._branches is not None and reached.all():
            reached &= self._branches.kept(stepper)
            self._names[mark:] = [entry for entry in self._names[mark:] if entry[1] < self._first + size]
            return stepper.state[:, :size].copy(), reached[:size]
        if not reached.all() and size > 1:
            # One lane that breaks off ends the others too: each of them again, alone in all lanes.
            del self._names[mark:]
            return self._singly(pars, states, durations, size, max_steps)
        self._names[mark:] = [entry for entry in self._names[mark:] if entry[1] < self._first + size]
        return stepper.state[:, :size].copy(), reached[:size]

    def _on_edge(self, states: Any) -> bool:
        """Whether an event function is zero to the last bit in one of the lanes."""
        if not self._events:
            return False
        pars = self._stepper.pars
        ops, constants = shifted(numpy) if self._shifted else numpy, constants_of(pars, self._friction)
        return any(bool((value == 0).any()) for value in event_values(self._events, ops, constants, pars[0], states))

    def _singly(self, pars: Any, states: Any, durations: Any, size: int, max_steps: int) -> tuple[Any, Any]:
        final = numpy.empty((len(self._stepper.state), size))
        finished = numpy.empty(size, dtype=bool)
        first = self._first
        for lane in range(size):
            same = [lane] * self._width
            self._first = first + lane
            column, reached = self._propagated(pars[:, same], states[:, same], durations[same], 1, max_steps)
            final[:, lane], finished[lane] = column[:, 0], reached[0]
        return final, finished

    def _turned(self, branches: FrictionSigns, flat: Sequence[str]) -> Any:
        """For the crossing of sin(beta) = 0: changes the branch, and records what was asked for."""

        batch = proxy(self)  # heyoka holds its callbacks, which no collector of garbage sees

        def turned(stepper: Any, sign: int, lane: int) -> bool:
            branches.turn(stepper, lane)
            batch._note(stepper, lane, flat)
            return True

        return turned

    def _reversed(self, branches: FrictionSigns, reversals: Sequence[Event]) -> Any:
        """The same for gamma_y = 0; a crossing at the start is the start itself."""
        switched, batch = branches.callback(), proxy(self)

        def crossed(stepper: Any, sign: int, lane: int) -> bool:
            switched(stepper, sign, lane)
            if not (branches.from_surface[lane] and abs(stepper.time[lane]) <= START_WINDOW):
                batch._note(stepper, lane, [event.name for event in reversals if event.direction in (0, sign)])
            return True

        return crossed

    def _note(self, stepper: Any, lane: int, names: Sequence[str]) -> None:
        for name in names:
            beta, gamma, v = stepper.state[:3, lane].tolist()
            self._names.append((name, self._first + lane, float(stepper.time[lane]), (beta, gamma, v)))

    def _recorder(self, name: str) -> Any:
        names, batch = self._names, proxy(self)

        def record(stepper: Any, when: float, sign: int, lane: int) -> None:
            stepper.update_d_output([when] * batch._width)
            beta, gamma, v = stepper.d_output[:3, lane].tolist()
            names.append((name, batch._first + lane, when, (beta, gamma, v)))

        return record
