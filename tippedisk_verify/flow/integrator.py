"""One compiled Taylor integrator: the field with what a kind of request needs, and how it is set off again."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

from tippedisk_verify.flow.contract import (
    FLAT,
    SLIDING_REVERSAL,
    START_WINDOW,
    Build,
    EventRecord,
    Request,
    Result,
    Status,
    starts_on,
)
from tippedisk_verify.flow.recording import Recording
from tippedisk_verify.flow.switching import Branch, Pieces
from tippedisk_verify.flow.system import PARAMETERS, SMOOTH_PARAMETERS, SWITCH, TURN_OVER, direction_of, system_of
from tippedisk_verify.model.equations import checked_friction, products, shifted
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import Precision, heyoka_module

__all__ = ["Integrator"]


class Integrator:
    """One compiled integrator and what is needed to set it off again."""

    def __init__(self, request: Request, events: tuple[Any, ...], chosen: dict[str, Any], compact: bool) -> None:
        self._smooth = checked_friction(request.friction) == "smooth"
        self.precision = precision = request.precision
        begin = time.perf_counter()
        hy = heyoka_module()
        number, fp_type = precision.number, precision.type
        self._ops = shifted(precision.ops) if request.shifted else precision.ops
        smooth = self._smooth
        self._events = events
        watched = [event for event in events if smooth and event.function is SLIDING_REVERSAL.function]
        built = [event for event in events if event not in watched]
        system, self._crossings, self._products = system_of(
            request.variations,
            request.divergence,
            (*built, SWITCH, TURN_OVER) if smooth else built,
            request.shifted,
            smooth,
        )
        self._names = SMOOTH_PARAMETERS if smooth else PARAMETERS
        self._records: list[EventRecord] = []
        self._terminal = [event for event in built if event.terminal]
        options: dict[str, Any] = {"fp_type": fp_type, "compact_mode": compact, **chosen}
        if precision.kind == "real":
            options["prec"] = precision.bits
        if request.tolerance is not None:
            options["tol"] = number(request.tolerance)
        # An event that has fired is not seen again for as long as a start on its surface lasts. heyoka's own waiting
        # time, made from the tolerance, is too short where the orbit only touches the surface.
        wait = number(START_WINDOW)
        if self._terminal:
            options["t_events"] = [
                hy.t_event(
                    self._crossings[event.name],
                    direction=direction_of(hy, event.direction),
                    cooldown=wait,
                    fp_type=fp_type,
                )
                for event in self._terminal
            ]
        if smooth:
            # Last, so that heyoka's numbers of the others stay; its callback changes the branch and goes on.
            place = len(self._names) + self._products
            self._branch = Branch(self.precision, self._ops, place, watched, self._records)
            own = [(SWITCH, self._branch.callback())]
            if FLAT not in self._terminal:
                own.append((TURN_OVER, self._branch.flat_callback()))
            # The state at a switch is on the surface to rounding, whatever the tolerance; heyoka's own waiting time
            # would hide the next switch at loose ones.
            options["t_events"] = [
                *options.get("t_events", ()),
                *(
                    hy.t_event(self._crossings[event.name], callback=back, cooldown=wait, fp_type=fp_type)
                    for event, back in own
                ),
            ]
        if passing := [event for event in built if not event.terminal]:
            options["nt_events"] = [
                hy.nt_event(
                    self._crossings[event.name],
                    self._recorder(event.name),
                    direction=direction_of(hy, event.direction),
                    fp_type=fp_type,
                )
                for event in passing
            ]
        start = [number(1), number(1), number(0)] + [number(0)] * request.divergence
        self._size = len(start)
        self._stepper: Any = hy.taylor_adaptive(
            system, start, pars=[number(1)] * (len(self._names) + self._products + smooth), **options
        )
        stepper = self._stepper
        if smooth:
            self._branch.stepper = stepper
        self._divergence = request.divergence
        # What follows the state: the integral of the divergence starts at 0, the derivatives at the identity.
        extended = request.variations or request.divergence
        self._identity = stepper.state[3:].copy() if extended else None
        self._zero = number(0)
        self._finished = hy.taylor_outcome.time_limit
        self._parameters: Parameters | None = None
        self._speed: Any = None
        self.build = Build(
            engine="taylor",
            precision=precision.name,
            friction=request.friction,
            variations=request.variations,
            divergence=request.divergence,
            events=(*(event.name for event in events), *((SWITCH.name,) if smooth else ())),
            u_variables=len(stepper.decomposition) - stepper.dim,
            seconds=time.perf_counter() - begin,
        )
        self._built = (self.build,)

    def run(self, request: Request) -> Result:
        state, duration, omega = self._inputs(request)
        self._set_off(request, omega, state)
        if request.domain != "none" and self._ops.sin(state[0]) <= 0:
            return self._ended(Status.FLAT, self.precision.owned(self._stepper.state), 0)
        if self._smooth or request.dense or request.times is not None:
            return self._keeping(request, omega, state, duration)
        outcome, low, steps, on_surface = self._plainly(request, omega, state, duration)
        return self._result(outcome, low, on_surface, steps)

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
        return state, duration, omega

    def _set_off(self, request: Request, omega: Any, state: list[Any]) -> None:
        """Parameters that are not those of the run before, and the state and time at the start."""
        stepper = self._stepper
        pars = stepper.pars
        if request.parameters is not self._parameters:
            constants = request.parameters.at(self.precision)
            for index, name in enumerate(self._names[1:], start=1):
                pars[index] = getattr(constants, name)
            self._parameters, self._speed = request.parameters, None
        if omega is not self._speed:
            self._speed = pars[0] = omega
            first = len(self._names)
            if self._products:
                constants = request.parameters.at(self.precision)
                pars[first : first + self._products] = products(constants, omega)[: self._products]
        stepper.time = self._zero
        if self._identity is None:
            stepper.state[:] = state
        else:
            stepper.state[:3] = state
            stepper.state[3:] = self._identity
        if self._crossings:
            stepper.reset_cooldowns()
            self._records.clear()

    def _keeping(self, request: Request, omega: Any, state: list[Any], duration: Any) -> Result:
        """A run with samples, continuous output or switches of the friction law's branch."""
        stepper = self._stepper
        if self._smooth:
            self._branch.begin(request, omega, state, duration)
        samples = dense = None
        recorded = self.precision.kind == "real" and (request.times is not None or request.dense)
        on_surface, early = self._leave_surfaces(request, omega, state, duration) if request.events else ((), [])
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
                duration, max_steps=request.max_steps, c_output=request.dense
            )
            dense = _copied(dense, self.precision) if request.dense else None
        if self._smooth and self._branch.lost:
            outcome, low, steps, samples, dense = self._carefully(request, omega, state, duration)
        result = self._result(outcome, low, on_surface, steps, samples, dense)
        if request.dense and request.times is not None and result.dense is not None and not recorded:
            reached = [t for t in self.precision.array(request.times) if abs(t) <= abs(result.time)]
            return result._replace(samples=result.dense(reached))
        return result

    def _plainly(
        self, request: Request, omega: Any, state: list[Any], duration: Any
    ) -> tuple[Any, Any, int, tuple[str, ...]]:
        """To the end, with nothing to keep on the way. Only what happens at the start asks what the start lies on."""
        stepper = self._stepper
        outcome, low, _, steps, _, _ = stepper.propagate_until(duration, max_steps=request.max_steps)
        names: tuple[str, ...] = ()
        if self._crossings and (self._records or abs(stepper.time) <= START_WINDOW):
            names = self._surfaces(request, omega, state)
            # An event that fires starts its cooldown: the next call goes on.
            for _ in self._terminal if self._starts_on_terminal(names) else ():
                if abs(stepper.time) > START_WINDOW or not self._passable(outcome):
                    break
                outcome, low, _, more, _, _ = stepper.propagate_until(duration, max_steps=request.max_steps)
                steps += more
        return outcome, low, steps, names

    def _carefully(self, request: Request, omega: Any, state: list[Any], duration: Any) -> tuple[Any, ...]:
        """The run again, looking at the branch after every switch: two of them came closer than events can tell."""
        stepper, branch = self._stepper, self._branch
        stepper.time = self._zero
        stepper.state[:3] = state
        if self._identity is not None:
            stepper.state[3:] = self._identity
        stepper.reset_cooldowns()
        self._records.clear()
        branch.begin(request, omega, state, duration)
        early = self._leave_surfaces(request, omega, state, duration)[1] if request.events else []
        wanted = request.times is not None or request.dense
        recorded = wanted and self.precision.kind == "real"
        recording = self._recording(request, duration, early) if recorded else None
        options: dict[str, Any] = {"c_output": wanted}
        if recording is not None:
            options = {"callback": recording.callback(), "write_tc": True}
        pieces: list[tuple[Any, Any]] = []
        steps, low = 0, None
        while True:
            branch.stops = True
            outcome, low, _, more, piece, _ = stepper.propagate_until(
                duration, max_steps=request.max_steps - steps, **options
            )
            branch.stops = False
            if recording is not None:
                recording.take()
            steps += more
            pieces.append((stepper.time, piece))
            if branch.ended or not branch.stopped or steps >= request.max_steps:
                break
            # A moment later the sign tells which branch it is; until then both are the same to rounding.
            ahead = stepper.time + branch.moment if duration > 0 else stepper.time - branch.moment
            if (ahead >= duration) == (duration > 0):
                ahead = duration
            branch.asleep = True
            outcome, low, _, more, piece, _ = stepper.propagate_until(ahead, **options)
            branch.asleep = False
            if recording is not None:
                recording.take()
            steps += more + 1
            pieces.append((stepper.time, piece))
            if outcome != self._finished or stepper.time == duration or steps >= request.max_steps:
                break
            branch.look()
        if branch.stopped and not branch.ended and steps >= request.max_steps:
            outcome = heyoka_module().taylor_outcome.step_limit
        if recording is not None:
            return outcome, low, steps, *recording.kept(request, outcome == self._finished)
        if not wanted:
            return outcome, low, steps, None, None
        dense = Pieces(pieces, bool(duration > 0))
        samples = None
        if request.times is not None and not request.dense:
            times = self.precision.array(request.times)
            reached = [t for t in times if abs(t) <= abs(stepper.time)]
            samples = dense(reached)[:, :3]
        return outcome, low, steps, samples, _copied(dense, self.precision) if request.dense else None

    def _recording(self, request: Request, duration: Any, early: list[list[Any]]) -> Recording:
        times = () if request.times is None else self.precision.array(request.times).tolist()
        return Recording(self._stepper, self.precision, times, request.dense, bool(duration > 0), early)

    def _on_grid(self, request: Request, duration: Any, early: list[list[Any]]) -> tuple[Any, Any, int, Any]:
        """Through the sample times, but for those of the rows already there; heyoka wants the present time in front."""
        import numpy

        stepper = self._stepper
        times = request.times if _native(request.times, self.precision) else self.precision.array(request.times)
        times, now = times[len(early) :], stepper.time
        samples = numpy.empty((0, 3), dtype=times.dtype)
        outcome, low, steps = self._finished, now, 0
        if len(times):
            grid = times if times[0] == now else numpy.concatenate((numpy.array([now], dtype=times.dtype), times))
            outcome, low, _, steps, _, samples = stepper.propagate_grid(grid, max_steps=request.max_steps)
            samples = samples[len(grid) - len(times) :, :3]
        if outcome == self._finished and stepper.time != duration:
            outcome, low, _, more, _, _ = stepper.propagate_until(duration, max_steps=request.max_steps)
            steps += more
        if early:
            samples = numpy.concatenate((numpy.array(early, dtype=times.dtype), samples))
        return outcome, low, steps, samples

    def _leave_surfaces(
        self, request: Request, omega: Any, state: list[Any], duration: Any
    ) -> tuple[tuple[str, ...], list[list[Any]]]:
        """Names of the events whose surface the start lies on; passes by the terminal ones that fire there.

        Rounding decides whether heyoka sees a crossing at the start, so it must not decide what the run does. Also
        returned are the states at the sample times that are passed by.
        """
        names = self._surfaces(request, omega, state)
        early: list[list[Any]] = []
        if self._starts_on_terminal(names):
            number = self.precision.number
            # Of a run that is as short as that, the half: the rest of it is recorded.
            limit = min(number(START_WINDOW), abs(duration) * number(0.5))
            for time in () if request.times is None else map(number, request.times):
                if abs(time) > limit:
                    break
                early.append(list(state) if time == self._zero else self._passed(time))
            self._passed(limit if duration > 0 else -limit)
        return names, early

    def _surfaces(self, request: Request, omega: Any, state: list[Any]) -> tuple[str, ...]:
        """Names of the events whose surface the start lies on."""
        constants, epsilon = request.parameters.at(self.precision), float(self.precision.epsilon)
        return tuple(
            event.name for event in request.events if starts_on(event, self._ops, constants, omega, state, epsilon)
        )

    def _starts_on_terminal(self, names: tuple[str, ...]) -> bool:
        return any(event.name in names for event in self._terminal)

    def _passable(self, outcome: Any) -> bool:
        """Whether a terminal event ended the run, and not the disk lying flat."""
        index = -int(outcome.value) - 1  # heyoka numbers terminal events -1, -2, ...
        return 0 <= index < len(self._terminal) and self._terminal[index].name != FLAT.name

    def _passed(self, target: Any) -> list[Any]:
        """The state at a time close to the start. An event that fires starts its cooldown: the next call goes on."""
        for _ in self._events:
            if not self._passable(self._stepper.propagate_until(target)[0]):
                break
        return self._stepper.state[:3].tolist()  # type: ignore[no-any-return]

    def _result(
        self,
        outcome: Any,
        smallest_step: Any,
        on_surface: tuple[str, ...],
        steps: int,
        samples: Any = None,
        dense: Any = None,
    ) -> Result:
        final = self.precision.owned(self._stepper.state)
        status = Status.REACHED if outcome == self._finished else self._stopped(outcome, smallest_step, final)
        if on_surface:  # what is the start itself is no crossing
            self._records[:] = [
                record for record in self._records if record.name not in on_surface or abs(record.time) > START_WINDOW
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

    def _recorder(self, name: str) -> Callable[[Any, Any, int], None]:
        records, owned = self._records, self.precision.owned

        def record(stepper: Any, when: Any, sign: int) -> None:
            stepper.update_d_output(when)
            records.append(EventRecord(name, when, owned(stepper.d_output[:3])))

        return record


def _native(times: Any, precision: Precision) -> bool:
    dtype = getattr(times, "dtype", None)
    return dtype is not None and precision.kind != "real" and dtype == precision.type


def _copied(output: Any, precision: Precision) -> Callable[[Any], Any]:
    """heyoka's continuous output hands out its own memory; this hands out copies of the state's part."""

    def states(times: Any) -> Any:
        return output(times if _native(times, precision) else precision.array(list(times)))[:, :3].copy()

    return states
