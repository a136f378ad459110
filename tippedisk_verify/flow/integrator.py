"""Runs of a compiled integrator: to the end, through sample times, past the start's own crossings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy

from tippedisk_verify.flow.compiled import Compiled
from tippedisk_verify.flow.contract import FLAT, SLIDING_REVERSAL, Event, EventRecord, Request, Result, Status
from tippedisk_verify.flow.recording import Recording, copied, is_native, native_array
from tippedisk_verify.flow.rounding import nudged, step_nudges
from tippedisk_verify.flow.start import LONGEST_WINDOW, NO_SURFACES, StartSurfaces, event_values, surfaces
from tippedisk_verify.flow.switching import Pieces
from tippedisk_verify.model.equations import products
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import heyoka_module

__all__ = ["Integrator"]

_MOST_PASSES = 64  # of events next to the start


class Integrator(Compiled):
    """A compiled integrator and how it is set off again."""

    def __init__(self, request: Request, events: tuple[Event, ...], chosen: dict[str, Any], compact: bool) -> None:
        super().__init__(request, events, chosen, compact)
        self._zero = self.precision.number(0)
        self._finished = heyoka_module().taylor_outcome.time_limit
        self._parameters: Parameters | None = None
        self._speed: Any = None
        self._built = (self.build,)

    def run(self, request: Request) -> Result:
        state, duration, omega = self._inputs(request)
        self._reset(request, omega, state)
        if request.domain != "none" and self._ops.sin(state[0]) <= 0:
            return self._ended(Status.FLAT, self.precision.owned(self._stepper.state), 0)
        if self._smooth or request.dense or request.times is not None or self._on_edge(request, omega, state):
            return self._run_recorded(request, omega, state, duration)
        return self._run_plain(request, omega, state, duration)

    def _inputs(self, request: Request) -> tuple[list[Any], Any, Any]:
        """The start, the duration and the speed in this arithmetic. Raises InputError unless they are finite."""
        number = self.precision.number
        if self.precision.kind != "double":
            return [number(part) for part in request.state], number(request.duration), number(request.omega)
        state = [part if type(part) is float else number(part) for part in request.state]
        duration = request.duration if type(request.duration) is float else number(request.duration)
        omega = request.omega if type(request.omega) is float else number(request.omega)
        if not math.isfinite(state[0] + state[1] + state[2] + duration + omega):
            for value in (*state, duration, omega):
                number(value)  # names the culprit, if it is not only the sum that overflows
        if request.rounding is not None:
            *state, omega = nudged((*state, omega), request.rounding.pattern, self.precision)
        return state, duration, omega

    def _reset(self, request: Request, omega: Any, state: list[Any]) -> None:
        """Parameters that are not those of the run before, and the state and time at the start."""
        stepper = self._stepper
        self._moving: dict[str, Any] = {}
        if omega is not self._speed or request.parameters is not self._parameters or request.rounding is not None:
            constants = request.parameters.at(self.precision)
            values = [getattr(constants, name) for name in self._names[1:]]
            values += products(constants, omega)[: self._products]
            self._parameters, self._speed = request.parameters, omega
            if request.rounding is not None:
                values = nudged(values, request.rounding.pattern + 1, self.precision)
                self._parameters = None  # the next run must not take them over
                if request.rounding.steps:
                    self._moving["callback"] = step_nudges(request.rounding, len(stepper.state), self.precision)
            stepper.pars[: 1 + len(values)] = [omega, *values]
        self._rewind(state)

    def _rewind(self, state: list[Any]) -> None:
        """To the start, at time 0, with nothing recorded."""
        stepper = self._stepper
        stepper.time = self._zero
        if self._identity is None:
            stepper.state[:] = state
        else:
            stepper.state[:3] = state
            stepper.state[3:] = self._identity
        if self._crossings:
            stepper.reset_cooldowns()
            self._records.clear()

    def _on_edge(self, request: Request, omega: Any, state: list[Any]) -> bool:
        """Whether an event function is zero to the last bit."""
        if not request.events:
            return False
        return 0 in event_values(request.events, self._ops, request.parameters.at(self.precision), omega, state)

    def _run_recorded(self, request: Request, omega: Any, state: list[Any], duration: Any) -> Result:
        """A run with samples, continuous output or switches of the friction law's branch."""
        stepper = self._stepper
        if self._smooth:
            self._branch.begin(request, omega, state, duration)
        samples = dense = None
        recorded = self.precision.kind == "real" and (request.times is not None or request.dense)
        left = self._leave_surfaces(request, omega, state, duration)
        if left.ended:
            return self._replay_to_event(request, omega, state, duration, left)
        early = left.samples
        if recorded:
            recording = self._recording(request, duration, early)
            outcome, low, _, steps, _, _ = stepper.propagate_until(
                duration, max_steps=request.max_steps, callback=recording.callback(), write_tc=True
            )
            samples, dense = recording.kept(request, outcome == self._finished)
        elif request.times is not None and not request.dense:
            outcome, low, steps, samples = self._on_grid(request, duration, early)
        else:
            outcome, low, _, steps, dense, _ = stepper.propagate_until(
                duration, max_steps=request.max_steps, c_output=request.dense, **self._moving
            )
            dense = copied(dense, self.precision) if request.dense else None
        if self._smooth and self._branch.lost:
            outcome, low, steps, samples, dense = self._run_switching(request, omega, state, duration)
        result = self._result(outcome, low, left, steps, samples, dense)
        if request.dense and request.times is not None and result.dense is not None and not recorded:
            reached = [t for t in self.precision.array(request.times) if abs(t) <= abs(result.time)]
            return result._replace(samples=result.dense(reached))
        return result

    def _run_plain(self, request: Request, omega: Any, state: list[Any], duration: Any) -> Result:
        """To the end, with nothing to keep on the way. An event close to the start raises the question of surfaces."""
        stepper = self._stepper
        outcome, low, _, steps, _, _ = stepper.propagate_until(duration, max_steps=request.max_steps, **self._moving)
        left = NO_SURFACES
        first = self._records[0].time if self._records else stepper.time
        if self._crossings and abs(first) <= LONGEST_WINDOW:
            left = surfaces(request, self._ops, omega, state, bool(duration >= 0))
            if abs(stepper.time) <= left.window and self._passable(outcome, left.names):
                self._reset(request, omega, state)
                return self._run_recorded(request, omega, state, duration)
        return self._result(outcome, low, left, steps)

    def _replay_to_event(
        self, request: Request, omega: Any, state: list[Any], duration: Any, left: StartSurfaces
    ) -> Result:
        """The run again, keeping what it passes: another event ends it before its start has left the surface."""
        self._reset(request, omega, state)
        if self._smooth:
            self._branch.begin(request, omega, state, duration)
        recording = self._recording(request, duration, [])
        outcome, low = self._finished, self._zero
        for _ in range(_MOST_PASSES):
            outcome, low, *_ = self._stepper.propagate_until(duration, callback=recording.callback(), write_tc=True)
            recording.take()
            if not self._passable(outcome, left.names):
                break
        samples, dense = recording.kept(request, finished=False)
        if self.precision.kind != "real":
            samples, dense = native_array(samples, self.precision), copied(dense, self.precision) if dense else None
        return self._result(outcome, low, left, 1, samples, dense)

    def _run_switching(self, request: Request, omega: Any, state: list[Any], duration: Any) -> tuple[Any, ...]:
        """The run again, looking at the branch after every switch: two of them came closer than events can tell."""
        stepper, branch = self._stepper, self._branch
        self._rewind(state)
        branch.begin(request, omega, state, duration)
        early = self._leave_surfaces(request, omega, state, duration).samples
        wanted = request.times is not None or request.dense
        recording = None
        options: dict[str, Any] = {"c_output": wanted, **self._moving}
        if wanted and self.precision.kind == "real":
            recording = self._recording(request, duration, early)
            options = {"callback": recording.callback(), "write_tc": True}
        pieces: list[tuple[Any, Any]] = []
        steps = 0

        def stretch(target: Any, **limits: int) -> tuple[Any, Any]:
            nonlocal steps
            outcome, low, _, more, piece, _ = stepper.propagate_until(target, **limits, **options)
            if recording is not None:
                recording.take()
            steps += more
            pieces.append((stepper.time, piece))
            return outcome, low

        while True:
            branch.stops = True
            outcome, low = stretch(duration, max_steps=request.max_steps - steps)
            branch.stops = False
            if branch.ended or not branch.stopped or steps >= request.max_steps:
                break
            # A moment later the sign tells which branch it is; until then both are the same to rounding.
            ahead = stepper.time + branch.moment if duration > 0 else stepper.time - branch.moment
            if (ahead >= duration) == (duration > 0):
                ahead = duration
            branch.asleep = True
            outcome, low = stretch(ahead)
            branch.asleep = False
            steps += 1
            if outcome != self._finished or stepper.time == duration or steps >= request.max_steps:
                break
            branch.look()
        if branch.stopped and not branch.ended and steps >= request.max_steps:
            outcome = heyoka_module().taylor_outcome.step_limit
        if recording is not None:
            return outcome, low, steps, *recording.kept(request, outcome == self._finished)
        if not wanted:
            return outcome, low, steps, None, None
        return outcome, low, steps, *self._joined(request, Pieces(pieces, bool(duration > 0)))

    def _joined(self, request: Request, dense: Pieces) -> tuple[Any, Any]:
        """Samples and continuous output, as the request asks for them, of a run in pieces."""
        if request.dense:
            return None, copied(dense, self.precision)
        reached = [t for t in self.precision.array(request.times) if abs(t) <= abs(self._stepper.time)]
        return dense(reached)[:, :3], None

    def _recording(self, request: Request, duration: Any, early: Sequence[list[Any]]) -> Recording:
        times = () if request.times is None else self.precision.array(request.times).tolist()
        return Recording(self._stepper, self.precision, times, request.dense, bool(duration > 0), early)

    def _on_grid(self, request: Request, duration: Any, early: Sequence[list[Any]]) -> tuple[Any, Any, int, Any]:
        """Through the sample times that have no row yet; heyoka wants the present time in front."""
        stepper = self._stepper
        times = request.times if is_native(request.times, self.precision) else self.precision.array(request.times)
        times, now = times[len(early) :], stepper.time
        samples = numpy.empty((0, 3), dtype=times.dtype)
        outcome, low, steps = self._finished, now, 0
        if len(times):
            grid = times if times[0] == now else numpy.concatenate((numpy.array([now], dtype=times.dtype), times))
            outcome, low, _, steps, _, samples = stepper.propagate_grid(
                grid, max_steps=request.max_steps, **self._moving
            )
            samples = samples[len(grid) - len(times) :, :3]
        if outcome == self._finished and stepper.time != duration:
            outcome, low, _, more, _, _ = stepper.propagate_until(duration, max_steps=request.max_steps, **self._moving)
            steps += more
        if early:
            samples = numpy.concatenate((numpy.array(early, dtype=times.dtype), samples))
        return outcome, low, steps, samples

    def _leave_surfaces(self, request: Request, omega: Any, state: list[Any], duration: Any) -> StartSurfaces:
        """Away from the surfaces that the start lies on, past the crossings of them that are the start itself.

        Rounding decides whether heyoka sees a crossing at the start, so it must not decide what the run does; and where
        a function is zero to the last bit, heyoka sees no other crossing of it in its first step.
        """
        left = surfaces(request, self._ops, omega, state, bool(duration >= 0))
        if not left.names:
            return left
        number = self.precision.number
        # At most half of the run, so that a rest is left to be recorded.
        limit = min(number(left.window), abs(duration) * number(0.5))
        times = [] if request.times is None else [t for t in map(number, request.times) if abs(t) <= limit]
        limit = limit if duration > 0 else -limit
        if (samples := self._jumped(request, omega, state, limit, times, left.names)) is not None:
            return left._replace(samples=samples)
        samples, ended = [], False
        for target in times:
            ended = ended or self._ended_before(target, left.names)
            if not ended:
                samples.append(self._stepper.state[:3].tolist() if target != self._zero else list(state))
        ended = ended or self._ended_before(limit, left.names)
        return left._replace(samples=samples, ended=ended)

    def _jumped(
        self, request: Request, omega: Any, state: list[Any], target: Any, times: list[Any], names: tuple[str, ...]
    ) -> list[list[Any]] | None:
        """To a time close to the start by the first step's series, whatever events are there; states at the times.

        None, and back at the start, if an event of another name is there too. (Many steps from event to event would
        not do: what they move an angle by is lost to its rounding.)
        """
        stepper = self._stepper
        stepper.step(target, write_tc=True)

        def at(time: Any) -> Any:
            stepper.update_d_output(time)
            return stepper.d_output

        samples = [list(state) if time == self._zero else at(time)[:3].tolist() for time in times]
        ahead = at(target).tolist()
        self._reset(request, omega, state)
        watched = [event for event in self._events if event.name not in names]
        if self._smooth:  # its branch too must be the same all the way, and not in doubt at the start
            self._branch.begin(request, omega, state, target)
            watched += SLIDING_REVERSAL, FLAT
        constants = request.parameters.at(self.precision)
        begins, ends = (event_values(watched, self._ops, constants, omega, place) for place in (state, ahead[:3]))
        if any(begin * end <= 0 for begin, end in zip(begins, ends, strict=True)):
            return None
        stepper.time = target
        stepper.state[:] = ahead
        return samples

    def _passable(self, outcome: Any, names: tuple[str, ...]) -> bool:
        """Whether what ended the run is an event of these."""
        index = -int(outcome.value) - 1  # heyoka numbers terminal events -1, -2, ...
        return 0 <= index < len(self._terminal) and self._terminal[index].name in names

    def _ended_before(self, target: Any, names: tuple[str, ...]) -> bool:
        """Go to a time close to the start, past events of these names; whether another one ends the run before."""
        outcome = self._finished
        for _ in range(_MOST_PASSES):
            # An event that fires starts its cooldown: the next call goes on.
            outcome = self._stepper.propagate_until(target)[0]
            if not self._passable(outcome, names):
                break
        if self._smooth and self._branch.ended:
            return True
        return 0 <= -int(outcome.value) - 1 < len(self._terminal) and not self._passable(outcome, names)

    def _result(
        self,
        outcome: Any,
        smallest_step: Any,
        left: StartSurfaces,
        steps: int,
        samples: Any = None,
        dense: Any = None,
    ) -> Result:
        final = self.precision.owned(self._stepper.state)
        status = Status.REACHED if outcome == self._finished else self._stopped(outcome, smallest_step, final)
        if left.names:  # what is the start itself is no crossing
            self._records[:] = [
                record for record in self._records if record.name not in left.names or abs(record.time) > left.window
            ]
        return self._ended(status, final, steps, samples, dense)

    def _stopped(self, outcome: Any, smallest_step: Any, final: Any) -> Status:
        """Why a run did not reach its end; a terminal event is recorded."""
        if self._smooth and self._branch.ended:
            return Status.EVENT
        index = -int(outcome.value) - 1  # heyoka numbers terminal events -1, -2, ...
        if not 0 <= index < len(self._terminal):
            if outcome.name == "err_nf_state":
                return Status.NON_FINITE
            resolved = abs(float(self._stepper.time)) * float(self.precision.epsilon)
            return Status.STEP_TOO_SMALL if abs(float(smallest_step)) <= resolved else Status.STEP_LIMIT
        event = self._terminal[index]
        self._records.append(EventRecord(event.name, self._stepper.time, final[:3]))
        return Status.FLAT if event.name == FLAT.name else Status.EVENT

    def _ended(self, status: Status, final: Any, steps: int, samples: Any = None, dense: Any = None) -> Result:
        derivatives = divergence = None
        if self._identity is not None:
            if self._divergence:
                divergence = final[3]
            if self.build.variations:
                derivatives = final[self._size :].reshape(self._size, -1)[:3]
            final = final[:3]
        return Result(
            status,
            self._stepper.time,
            final,
            steps,
            samples=samples,
            dense=dense,
            derivatives=derivatives,
            divergence=divergence,
            events=tuple(self._records) if self._crossings else (),
            built=self._built,
        )
