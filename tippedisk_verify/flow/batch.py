"""Many runs at once in double precision: heyoka's batch mode, one run in each SIMD lane.

It serves lists of speeds or starts that need the same quantities. Every run has its own speed,
start and duration, and all runs of a batch share the compiled code. No error is estimated here:
callers measure it on their runs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy

from tippedisk_verify.display import Printable
from tippedisk_verify.errors import InputError
from tippedisk_verify.flow.compiled_runners import CompiledRunners
from tippedisk_verify.flow.contract import Event, Variation
from tippedisk_verify.flow.jit import heyoka_module
from tippedisk_verify.flow.start import MAX_TIME_ON_SURFACE, MIN_TIME_ON_SURFACE, Start
from tippedisk_verify.flow.switching import FrictionSigns
from tippedisk_verify.flow.system import (
    FRICTION_SWITCH,
    SIN_BETA_REVERSAL,
    build_system,
    constants_of,
    direction_of,
    parameter_names,
)
from tippedisk_verify.model.equations import shifted_ops
from tippedisk_verify.model.friction import Friction, FrictionLaw, law_of
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.arrays import Array, to_double_array
from tippedisk_verify.numbers.exact import short_text
from tippedisk_verify.numbers.numpy_errors import ignore_numpy_errors_in_methods
from tippedisk_verify.numbers.precision import DOUBLE

__all__ = ["BatchResult", "BatchTaylor", "equation_constants"]


_Crossing = tuple[str, int, float, tuple[float, float, float]]


@dataclass(frozen=True, repr=False)
class BatchResult(Printable):
    """The results of n runs, as arrays of doubles; a run that did not finish has NaN everywhere.

    Under the smooth law a run may have two switches of its side that are closer than events can
    resolve. It then counts as not finished. The Taylor engine, one run at a time, can compute it.
    """

    states: Array  #: (n, 3) final (beta, gamma, v)
    derivatives: Any = None  #: (n, 3, number of variations) at fixed final time
    divergence: Array | None = None  #: (n,) integral of div f along the orbit [1]
    crossings: tuple[_Crossing, ...] = ()  #: event, run, time [s], state
    finished: Any = None  #: (n,) True where the final time was reached


def equation_constants(parameters: Parameters) -> Array:
    """Return a disk's constants in the equations of motion as an array of doubles.

    They are (r, e, a, b, g, k), or traction and epsilon instead of k under the smooth law.

    Args:
        parameters: The disk and its friction law.
    """
    constants = parameters.constants_in(DOUBLE)
    return numpy.array([getattr(constants, name) for name in parameter_names(parameters.law)[1:]])


_MAX_LANES = 64  # eight times the widest registers; compile time grows with the number of lanes


@ignore_numpy_errors_in_methods
class BatchTaylor:
    """The Taylor engine for many runs at once, which keeps what it has compiled.

    Threads may share an instance: a call waits until the integrator that it needs is free.

    Args:
        width: The number of lanes; by default as many as this machine's SIMD registers hold.

    Raises:
        InputError: If the width is not between 1 and 64.
    """

    def __init__(self, width: int | None = None) -> None:
        if width is not None and not 1 <= width <= _MAX_LANES:
            raise InputError(f"a batch has 1 to {_MAX_LANES} lanes, not {short_text(width)}")
        self.width = width or int(heyoka_module().recommended_simd_size())
        self._batches = CompiledRunners()

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
        friction: Friction | FrictionLaw = "linear",
        events: tuple[Event, ...] = (),
        max_steps: int = 100_000,
    ) -> BatchResult:
        """Integrate n motions at once.

        Args:
            constants: (k,) or (n, k), as `equation_constants` gives them: six under the linear law.
            omegas: (n,) speeds [rad/s].
            states: (n, 3) starts: beta, gamma [rad], v [rad/s].
            durations: (n,) [s].
            variations: The variables of the derivatives.
            divergence: True adds the integral of the divergence.
            shifted: True measures angles from pi/2.
            friction: The friction law, or its name.
            events: Events that are recorded and end nothing. A start on the surface is not a
                crossing.
            max_steps: The maximum number of steps of a run.

        Returns:
            The final states (n, 3), derivatives, divergence, crossings, and True for each finished
            run.

        Raises:
            InputError: If an argument is not an array of numbers, the shapes do not match, or an
                event is terminal.
        """
        law = law_of(friction)
        names = parameter_names(law)
        constants, omegas, states, durations = map(
            to_double_array, (constants, omegas, states, durations)
        )
        count = omegas.size
        if omegas.shape != (count,) or states.shape != (count, 3) or durations.shape != (count,):
            raise InputError(f"{count} speeds need states ({count}, 3) and as many durations")
        if constants.shape not in ((len(names) - 1,), (count, len(names) - 1)):
            raise InputError(
                f"the constants of the {law} law are {len(names) - 1}, or as many for each run"
            )
        if any(event.terminal for event in events):
            raise InputError("events of many runs at once are recorded; they cannot end a run")
        constants = numpy.broadcast_to(constants, (count, len(names) - 1))
        key = (variations, divergence, events, shifted, law)
        pars = numpy.vstack((omegas, constants.T))
        with self._batches.reserved(key, lambda: _CompiledBatch(self.width, *key)) as batch:
            result: BatchResult = batch.run(pars, states, durations, max_steps)
        if not result.crossings:
            return result
        by_name = {event.name: event for event in events}
        ops = shifted_ops(math) if shifted else math

        def is_start(name: str, run: int, when: float, state: tuple[float, ...]) -> bool:
            """Return True if a recorded crossing is not a true one: the run starts, or rests, on
            the event's surface.
            """
            if abs(when) > MAX_TIME_ON_SURFACE and state != tuple(states[run]):
                return False
            own_pars = [omegas[run].item(), *constants[run].tolist()]
            start = Start(
                ops,
                constants_of(own_pars, law),
                law,
                own_pars[0],
                states[run].tolist(),
                when >= 0,
            )
            if not start.lies_on(by_name[name], 2.0**-52):
                return False
            return (
                not any(start.rates(start.state))
                or abs(when) <= start.time_on_surface(by_name[name])[0]
            )

        kept = tuple(crossing for crossing in result.crossings if not is_start(*crossing))
        return replace(result, crossings=kept)


class _CompiledBatch:
    """A compiled heyoka integrator for many runs of one kind at once."""

    def __init__(
        self,
        width: int,
        variations: tuple[Variation, ...],
        divergence: bool,
        events: tuple[Event, ...],
        shift: bool,
        law: FrictionLaw,
    ) -> None:
        hy = heyoka_module()
        # Events of the request may coincide with a change of the law's side. Of two events at the
        # same time one is lost, so one serves for both.
        coinciding = {
            own.name: [
                event for event in events if law.two_sided and event.function is own.function
            ]
            for own in (FRICTION_SWITCH, SIN_BETA_REVERSAL)
        }
        self._events = [
            event for event in events if all(event not in own for own in coinciding.values())
        ]
        self._ops, self._law = shifted_ops(numpy) if shift else numpy, law
        self._variations, self._divergence = len(variations), divergence
        self._crossings: list[_Crossing] = []
        watched = (
            (*self._events, FRICTION_SWITCH, SIN_BETA_REVERSAL) if law.two_sided else self._events
        )
        system, functions = build_system(variations, divergence, watched, shift, law)
        recorded = [
            hy.nt_event_batch(
                functions[event.name],
                self._recorder(event.name, width),
                direction=direction_of(event),
            )
            for event in self._events
        ]
        self._signs = FrictionSigns() if law.two_sided else None
        changes = {}
        if self._signs is not None:
            changes[FRICTION_SWITCH.name] = self._signs.set_at_reversal
            changes[SIN_BETA_REVERSAL.name] = self._signs.flip_with_sin_beta
        switches = [
            hy.t_event_batch(
                functions[name],
                callback=self._changer(change, coinciding[name]),
                cooldown=MIN_TIME_ON_SURFACE,
            )
            for name, change in changes.items()
        ]
        self._size = 3 + divergence + law.has_guard
        start = numpy.zeros((self._size, width))
        start[0] = start[1] = 1.0
        pars = numpy.ones((len(parameter_names(law)) + law.two_sided, width))
        self._stepper: Any = hy.taylor_adaptive_batch(
            system, start, pars=pars, t_events=switches, nt_events=recorded
        )
        # After the state, the integral of the divergence starts at 0 and the derivatives at the
        # identity.
        self._rest = self._stepper.state[3:].copy()
        self._reached = hy.taylor_outcome.time_limit

    def run(self, pars: Array, states: Array, durations: Array, max_steps: int) -> BatchResult:
        """Integrate n runs in SIMD lanes, batch by batch, and return their results.

        A run that fails is NaN and not ``finished``.

        Args:
            pars: (m, n) speeds and constants, in the order of `parameter_names`.
            states: (n, 3) starts.
            durations: (n,) [s].
            max_steps: The maximum number of steps of a run.
        """
        count, width = len(durations), self._rest.shape[1]
        final = numpy.full((3 + len(self._rest), count), numpy.nan)
        finished = numpy.zeros(count, dtype=bool)
        crossings: list[_Crossing] = []
        pending = [
            range(first, min(first + width, count)) for first in reversed(range(0, count, width))
        ]
        while pending:
            runs = pending.pop()
            lanes = numpy.resize(runs, width)  # lanes left over repeat the first runs
            reached = self._propagated(pars[:, lanes], states[lanes].T, durations[lanes], max_steps)
            if len(runs) > 1 and not reached.all():
                # A lane that stops early ends the others too. Repeat each of them, alone in all
                # lanes.
                pending += [range(run, run + 1) for run in reversed(runs)]
                continue
            if self._signs is not None:
                reached &= ~self._signs.used_wrong_sign(self._stepper)
            lane_of = numpy.flatnonzero(reached[: len(runs)])
            final[:, lanes[lane_of]] = self._stepper.state[:, lane_of]
            finished[lanes[lane_of]] = True
            crossings += [
                (name, runs[lane], when, state)
                for name, lane, when, state in self._crossings
                if lane < len(runs)
            ]
        derivatives = None
        if self._variations:
            # Leave out the rows of the divergence and the guard.
            rows = final[self._size :].reshape(self._size, self._variations, count)
            derivatives = rows[:3].transpose(2, 0, 1)
        return BatchResult(
            states=final[:3].T,
            derivatives=derivatives,
            divergence=final[3] if self._divergence else None,
            crossings=tuple(crossings),
            finished=finished,
        )

    def _propagated(self, pars: Array, states: Any, durations: Array, max_steps: int) -> Any:
        """Integrate the runs in all lanes, and return a mask (width,) of the lanes that reached
        their end.
        """
        stepper = self._stepper
        stepper.set_time(0.0)
        stepper.pars[: len(pars)] = pars
        stepper.state[:3], stepper.state[3:] = states, self._rest
        constants = constants_of(pars, self._law)
        start = Start(self._ops, constants, self._law, pars[0], states, durations >= 0)
        if self._signs is not None:
            self._signs.begin(stepper, start)
        if stepper.with_events:
            stepper.reset_cooldowns()
        self._crossings.clear()
        if any((start.event_value(event) == 0).any() for event in self._events):
            # If an event function is zero to the last bit, heyoka misses its next crossing in the
            # first step.
            stepper.propagate_until(
                numpy.copysign(numpy.minimum(MIN_TIME_ON_SURFACE, abs(durations) / 2), durations)
            )
        stepper.propagate_until(durations, max_steps=max_steps)
        return numpy.array([outcome == self._reached for outcome, *_ in stepper.propagate_res])

    def _recorder(self, name: str, width: int) -> Any:
        crossings = self._crossings

        def record(stepper: Any, when: float, sign: int, lane: int) -> None:
            stepper.update_d_output([when] * width)
            crossings.append((name, lane, when, tuple(stepper.d_output[:3, lane].tolist())))

        return record

    def _changer(self, change: Callable[[Any, int, int], None], coinciding: Sequence[Event]) -> Any:
        """Return a callback for heyoka that calls ``change`` and records the coinciding events.

        ``change`` switches the friction law's side in one lane. The callback is a bare function,
        because heyoka copies all other callables.
        """
        crossings = self._crossings

        def changed(stepper: Any, sign: int, lane: int) -> bool:
            change(stepper, sign, lane)
            when, state = float(stepper.time[lane]), tuple(stepper.state[:3, lane].tolist())
            crossings.extend(
                (event.name, lane, when, state)
                for event in coinciding
                if event.direction in (0, sign)
            )
            return True

        return changed
