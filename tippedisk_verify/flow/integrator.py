"""Runs of a compiled integrator: to the end, through sample times, past the start's own crossings."""

from __future__ import annotations

from typing import Any

from tippedisk_verify.flow.compiled import Compiled
from tippedisk_verify.flow.contract import FLAT, SLIDING_REVERSAL, Event, EventRecord, Request, Result, Status
from tippedisk_verify.flow.rounding import nudged
from tippedisk_verify.flow.start import LONGEST_WINDOW, NO_SURFACES, StartSurfaces, event_values, surfaces
from tippedisk_verify.flow.step_polynomials import Series
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
        self._kept: list[tuple[Any, Any]] | None = None  # of each step, its end and its series
        self._built = (self.build,)

    def run(self, request: Request) -> Result:
        state, duration, omega = self._inputs(request)
        wanted = request.estimated_by_defect or request.dense or request.times is not None
        self._kept = [] if wanted else None
        self._reset(request, omega, state)
        if request.domain != "none" and self._ops.sin(state[0]) <= 0:
            return self._ended(request, Status.FLAT, 0)
        # Of an event function that is zero to the last bit heyoka sees no other crossing in its first step.
        constants = request.parameters.at(self.precision)
        if self._smooth or 0 in event_values(request.events, self._ops, constants, omega, state):
            return self._run_careful(request, omega, state, duration)
        return self._run_plain(request, omega, state, duration)

    def _inputs(self, request: Request) -> tuple[list[Any], Any, Any]:
        """The start, the duration and the speed in this arithmetic. Raises InputError unless they are finite."""
        number = self.precision.number
        state = [number(component) for component in request.state]
        duration, omega = number(request.duration), number(request.omega)
        if request.rounding is not None:
            *state, omega = nudged((*state, omega), request.rounding, self.precision)
        return state, duration, omega

    def _reset(self, request: Request, omega: Any, state: list[Any]) -> None:
        """Parameters that are not those of the run before, and the state and time at the start."""
        stepper = self._stepper
        if omega is not self._speed or request.parameters is not self._parameters or request.rounding is not None:
            constants = request.parameters.at(self.precision)
            values = [getattr(constants, name) for name in self._names[1:]]
            values += products(constants, omega)[: self._products]
            self._parameters, self._speed = request.parameters, omega
            if request.rounding is not None:
                values = nudged(values, request.rounding + 1, self.precision)
                self._parameters = None  # the next run must not take them over
            stepper.pars[: 1 + len(values)] = [omega, *values]
        self._rewind(state)

    def _rewind(self, state: list[Any]) -> None:
        """To the start, at time 0, with nothing recorded."""
        stepper = self._stepper
        stepper.time = self._zero
        if self._kept:
            self._kept.clear()
        if self._identity is None:
            stepper.state[:] = state
        else:
            stepper.state[:3] = state
            stepper.state[3:] = self._identity
        if self._crossings:
            stepper.reset_cooldowns()
            self._records.clear()

    def _until(self, target: Any, **options: Any) -> tuple[Any, Any, int]:
        """To a time or a terminal event: the outcome, the smallest step and the number of steps, whose series stay."""
        if self._kept is not None:
            # In half the time of heyoka's continuous output. As a plain function: it copies whatever else it is given.
            options |= {"callback": lambda stepper: self._keep_step(), "write_tc": True}
        outcome, low, _, steps, _, _ = self._stepper.propagate_until(target, **options)
        if self._kept is not None and steps:
            self._keep_step()
        return outcome, low, steps

    def _keep_step(self) -> bool:
        """Keep the last step's series, unless it is there already. True: the run goes on."""
        assert self._kept is not None
        end = self._stepper.time
        if end != (self._kept[-1][0] if self._kept else self._zero):
            self._kept.append((end, self.precision.owned(self._stepper.tc[:3])))
        return True

    def _run_careful(self, request: Request, omega: Any, state: list[Any], duration: Any) -> Result:
        """A run that may start on a surface, or switch the friction law's branch."""
        if self._smooth:
            self._branch.begin(request, omega, state, duration)
        left = self._leave_surfaces(request, omega, state, duration)
        if left.ended is not None:
            return self._result(request, *left.ended, 1, left)
        outcome, low, steps = self._until(duration, max_steps=request.max_steps)
        if self._smooth and self._branch.lost:
            outcome, low, steps = self._run_switching(request, omega, state, duration)
        return self._result(request, outcome, low, steps, left)

    def _run_plain(self, request: Request, omega: Any, state: list[Any], duration: Any) -> Result:
        """Straight to the end. An event close to the start raises the question of surfaces."""
        stepper = self._stepper
        outcome, low, steps = self._until(duration, max_steps=request.max_steps)
        left = NO_SURFACES
        first = self._records[0].time if self._records else stepper.time
        if self._crossings and abs(first) <= LONGEST_WINDOW:
            left = surfaces(request, self._ops, omega, state, bool(duration >= 0))
            if abs(stepper.time) <= left.window and self._passable(outcome, left.names):
                self._reset(request, omega, state)
                return self._run_careful(request, omega, state, duration)
        return self._result(request, outcome, low, steps, left)

    def _run_switching(self, request: Request, omega: Any, state: list[Any], duration: Any) -> tuple[Any, Any, int]:
        """The run again, looking at the branch after every switch: two of them came closer than events can tell."""
        stepper, branch = self._stepper, self._branch
        self._rewind(state)
        branch.begin(request, omega, state, duration)
        self._leave_surfaces(request, omega, state, duration)
        total = 0
        while True:
            branch.stops = True
            outcome, low, steps = self._until(duration, max_steps=request.max_steps - total)
            branch.stops = False
            total += steps
            if branch.ended or not branch.stopped or total >= request.max_steps:
                break
            # A moment later the sign tells which branch it is; until then both are the same to rounding.
            ahead = stepper.time + branch.moment if duration > 0 else stepper.time - branch.moment
            if (ahead >= duration) == (duration > 0):
                ahead = duration
            branch.asleep = True
            outcome, low, steps = self._until(ahead)
            branch.asleep = False
            total += steps + 1
            if outcome != self._finished or stepper.time == duration or total >= request.max_steps:
                break
            branch.look()
        if branch.stopped and not branch.ended and total >= request.max_steps:
            outcome = heyoka_module().taylor_outcome.step_limit
        return outcome, low, total

    def _leave_surfaces(self, request: Request, omega: Any, state: list[Any], duration: Any) -> StartSurfaces:
        """Away from the surfaces that the start lies on, past the crossings of them that are the start itself.

        Rounding decides whether heyoka sees a crossing at the start, so it must not decide what the run does; and where
        a function is zero to the last bit, heyoka sees no other crossing of it in its first step.
        """
        left = surfaces(request, self._ops, omega, state, bool(duration >= 0))
        if not left.names:
            return left
        # At most half of the run, so that a rest is left to be recorded.
        limit = min(self.precision.number(left.window), abs(duration) * self.precision.number(0.5))
        limit = limit if duration > 0 else -limit
        if self._jumped(request, omega, state, limit, left.names):
            return left
        outcome, low = self._finished, self._zero
        for _ in range(_MOST_PASSES):
            # An event that fires starts its cooldown: the next call goes on.
            outcome, low, _ = self._until(limit)
            if not self._passable(outcome, left.names):
                break
        ended = self._index(outcome) is not None and not self._passable(outcome, left.names)
        if ended or (self._smooth and self._branch.ended):
            return left._replace(ended=(outcome, low))
        return left

    def _jumped(self, request: Request, omega: Any, state: list[Any], target: Any, names: tuple[str, ...]) -> bool:
        """To a time close to the start by the first step's series, whatever events are there.

        False, and back at the start, if an event of another name is there too. (Many steps from event to event would
        not do: what they move an angle by is lost to its rounding.)
        """
        stepper = self._stepper
        stepper.step(target, write_tc=True)
        stepper.update_d_output(target)
        ahead, terms = stepper.d_output.tolist(), self.precision.owned(stepper.tc[:3])
        self._reset(request, omega, state)
        watched = [event for event in self._events if event.name not in names]
        if self._smooth:  # its branch too must be the same all the way, and not in doubt at the start
            self._branch.begin(request, omega, state, target)
            watched += SLIDING_REVERSAL, FLAT
        constants = request.parameters.at(self.precision)
        begins, ends = (event_values(watched, self._ops, constants, omega, place) for place in (state, ahead[:3]))
        if any(begin * end <= 0 for begin, end in zip(begins, ends, strict=True)):
            return False
        stepper.time = target
        stepper.state[:] = ahead
        if self._kept is not None:
            self._kept.append((target, terms))
        return True

    def _index(self, outcome: Any) -> int | None:
        """Which of the request's terminal events ended the run. heyoka numbers them -1, -2, ..."""
        index = -int(outcome.value) - 1
        return index if 0 <= index < len(self._terminal) else None

    def _passable(self, outcome: Any, names: tuple[str, ...]) -> bool:
        """Whether what ended the run is an event of these."""
        index = self._index(outcome)
        return index is not None and self._terminal[index].name in names

    def _result(self, request: Request, outcome: Any, smallest_step: Any, steps: int, left: StartSurfaces) -> Result:
        status = Status.REACHED if outcome == self._finished else self._stopped(outcome, smallest_step)
        if left.names:  # what is the start itself is no crossing
            self._records[:] = [
                record for record in self._records if record.name not in left.names or abs(record.time) > left.window
            ]
        return self._ended(request, status, steps)

    def _stopped(self, outcome: Any, smallest_step: Any) -> Status:
        """Why a run did not reach its end; a terminal event is recorded."""
        if self._smooth and self._branch.ended:
            return Status.EVENT
        index = self._index(outcome)
        if index is None:
            if outcome.name == "err_nf_state":
                return Status.NON_FINITE
            resolved = abs(float(self._stepper.time)) * float(self.precision.epsilon)
            return Status.STEP_TOO_SMALL if abs(float(smallest_step)) <= resolved else Status.STEP_LIMIT
        event = self._terminal[index]
        self._records.append(EventRecord(event.name, self._stepper.time, self.precision.owned(self._stepper.state[:3])))
        return Status.FLAT if event.name == FLAT.name else Status.EVENT

    def _ended(self, request: Request, status: Status, steps: int) -> Result:
        final, derivatives, divergence = self.precision.owned(self._stepper.state), None, None
        if self._identity is not None:
            if self._divergence:
                divergence = final[3]
            if self.build.variations:
                derivatives = final[self._size :].reshape(self._size, -1)[:3]
            final = final[:3]
        series = None
        if self._kept is not None:
            # A run that has taken no step stands at its start.
            series = Series(self.precision, self._zero, self._kept or [(self._zero, final[:, None])])
        return Result(
            status,
            self._stepper.time,
            final,
            steps,
            samples=None if series is None or request.estimated_by_defect else series.samples(request, status),
            dense=series if request.dense else None,
            derivatives=derivatives,
            divergence=divergence,
            events=tuple(self._records) if self._crossings else (),
            built=self._built,
            series=series,
        )
