"""A compiled heyoka stepper for one kind of request, with its tolerance, events and restarts.

Without a tolerance in the request, heyoka's default holds: one unit in the last place."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy

from tippedisk_verify.flow.contract import (
    FLAT,
    SLIDING_REVERSAL,
    Build,
    Event,
    EventRecord,
    Request,
    Result,
    Status,
)
from tippedisk_verify.flow.jit import heyoka_module
from tippedisk_verify.flow.start import (
    MIN_TIME_ON_SURFACE,
    NO_SURFACES,
    Start,
    StartSurfaces,
    start_surfaces,
)
from tippedisk_verify.flow.switching import FrictionSign
from tippedisk_verify.flow.system import (
    FRICTION_SWITCH,
    SIN_BETA_REVERSAL,
    build_system,
    direction_of,
    parameter_names,
    perturb_last_bits,
)
from tippedisk_verify.numbers.precision import DOUBLE, Precision

__all__ = ["CompiledStepper", "DenseOutput"]

_MAX_PASSES = 64  # the number of events passed near the start


class DenseOutput:
    """The continuous output of a run: a polynomial for each step, in the time since the step's
    start.

    A call converts times (k,) [s] to states (k, 3), exact to rounding. Threads may share it,
    whereas heyoka's own continuous output hands out memory that its next call overwrites.
    """

    def __init__(self, precision: Precision, start: Any, steps: Sequence[tuple[Any, Any]]) -> None:
        """Store the polynomials of a run.

        Args:
            precision: The arithmetic.
            start: The time of the start [s].
            steps: For each step the time of its end [s] and its polynomials (k, order + 1), those
                of the state first.
        """
        element = precision.element_type
        self._precision = precision
        #: (n + 1,) [s]
        self.times = numpy.array([start, *(end for end, _ in steps)], dtype=element)
        #: (order + 1, k, n), so that all steps' terms of one power lie together
        self.coefficients = (
            numpy.array([terms for _, terms in steps], dtype=element).transpose(2, 1, 0).copy()
        )

    def __call__(self, times: Any) -> Any:
        """Return the states (k, 3) of the run at times (k,) [s]."""
        return self.values(times)[:, :3]

    def values(self, times: Any) -> Any:
        """Return the values of all of the run's polynomials at times (k,) [s], a row for each time.

        Besides the state there may be derivatives and the integral of the divergence.
        """
        wanted = self._precision.as_array(times)
        step = self.step_of(wanted)
        since = wanted - self.times[step]
        total = self.coefficients[-1][:, step]
        for terms in self.coefficients[-2::-1]:
            total = total * since + terms[:, step]
        return total.T.copy()

    def samples(self, request: Request, status: Status) -> Any:
        """Return the values of all of the run's polynomials at those requested sample times that
        the run has reached.

        A run that reached its end has them all, even if rounding puts the last one slightly later.

        Args:
            request: The run.
            status: Its status.

        Returns:
            A row for each time, as in `values`. None if the request has no sample times.
        """
        if request.times is None:
            return None
        times = self._precision.as_array(request.times)
        return self.values(
            times if status is Status.REACHED else times[abs(times) <= abs(self.times[-1])]
        )

    def step_of(self, times: Any) -> Any:
        """Return the number (k,) of the step in which each time lies.

        A time outside the run belongs to the first or the last step.

        Args:
            times: (k,) times [s].
        """
        inside = self.times[1:-1]
        backward = self.times[-1] < self.times[0]
        return numpy.searchsorted(-inside if backward else inside, -times if backward else times)


def _grid_of(request: Request, duration: Any) -> Any:
    """Return a grid of times from 0 to the duration, through a run's sample times, for heyoka to
    sample.

    Returns None unless heyoka is to sample the run. That is a run in doubles with sample times and
    a duration other than zero. It has no events, no continuous output and no error estimate by the
    defect.
    """
    times = request.times
    by_series = request.estimated_by_defect or request.dense or request.events
    if request.precision != DOUBLE or times is None or by_series or not duration:
        return None
    inside = DOUBLE.as_array(times)
    inside = inside[(inside != 0) & (abs(inside) < abs(duration))]
    return numpy.concatenate(([0.0], inside, [duration]))


class CompiledStepper:
    """A compiled heyoka integrator for one kind of request, with the callbacks that record its
    events.
    """

    def __init__(
        self, request: Request, events: tuple[Event, ...], chosen: dict[str, Any], compact: bool
    ) -> None:
        self.precision = precision = request.precision
        number, two_sided = precision.number, request.law.two_sided
        self._events, self._two_sided = events, two_sided
        watched = [
            event for event in events if two_sided and event.function is SLIDING_REVERSAL.function
        ]
        built = [event for event in events if event not in watched]
        system, self._crossings = build_system(
            request.variations,
            request.divergence,
            (*built, FRICTION_SWITCH, SIN_BETA_REVERSAL) if two_sided else built,
            request.shifted,
            request.law,
        )
        self._names = parameter_names(request.law)
        self._records: list[EventRecord] = []
        self._terminal = [event for event in built if event.terminal]
        if two_sided:
            self._friction_sign = FrictionSign(precision, watched, self._records)
        options: dict[str, Any] = {
            "fp_type": precision.number_type,
            "compact_mode": compact,
            **chosen,
        }
        if precision.kind == "real":
            options["prec"] = precision.bits
        if request.tolerance is not None:
            options["tol"] = number(request.tolerance)
        start = [number(1), number(1), number(0)] + [number(0)] * (
            request.divergence + request.law.has_guard
        )
        self._size = len(start)
        self._series_rows = None if request.variations else 3
        hy = heyoka_module()
        self._stepper: Any = hy.taylor_adaptive(
            system,
            start,
            pars=[number(1)] * (len(self._names) + two_sided),
            t_events=self._ending_events(),
            nt_events=[self._passing_event(event) for event in built if not event.terminal],
            **options,
        )
        # After the state, the integral of the divergence and the guard start at 0 and the
        # derivatives at the identity.
        self._identity = self._stepper.state[3:].copy()
        self._zero, self._finished = number(0), hy.taylor_outcome.time_limit
        # The end and the series of each step, if they are needed
        self._step_series: list[tuple[Any, Any]] | None = None
        # The times from start to end at which heyoka samples the run, and the states there
        self._grid: Any = None
        self._grid_states: Any = None
        self.build = Build(
            engine="taylor",
            precision=precision.name,
            friction=request.law.name,
            variations=request.variations,
            divergence=request.divergence,
            events=(
                *(event.name for event in events),
                *((FRICTION_SWITCH.name,) if two_sided else ()),
            ),
            u_variables=len(self._stepper.decomposition) - self._stepper.dim,
        )

    def _ending_events(self) -> list[Any]:
        """Return the events at which heyoka stops, as its terminal events.

        Those of the request come first, then those that change the friction law's side.
        """
        hy, fp_type = heyoka_module(), self.precision.number_type
        # An event that has fired is not seen again for as long as a start on its surface lasts.
        # heyoka's own waiting time comes from the tolerance. It is too short where the orbit only
        # touches the surface. It is too long after a switch of the side at a loose tolerance: the
        # state there is on the surface to rounding, at every tolerance.
        wait = self.precision.number(MIN_TIME_ON_SURFACE)

        def ending(name: str, **options: Any) -> Any:
            return hy.t_event(self._crossings[name], cooldown=wait, fp_type=fp_type, **options)

        events = [ending(event.name, direction=direction_of(event)) for event in self._terminal]
        if self._two_sided:
            # They come last, so that heyoka's numbers of the other events stay. Their callbacks let
            # the run continue, and are bare functions, because heyoka copies all other callables.
            friction_sign = self._friction_sign
            events.append(
                ending(
                    FRICTION_SWITCH.name,
                    callback=lambda stepper, sign: friction_sign.set_at_reversal(stepper, sign),
                )
            )
            if FLAT not in self._terminal:
                events.append(
                    ending(
                        SIN_BETA_REVERSAL.name,
                        callback=lambda stepper, sign: friction_sign.flip_with_sin_beta(stepper),
                    )
                )
        return events

    def _passing_event(self, event: Event) -> Any:
        """Return heyoka's event that records crossings of an event's surface without ending the
        run.
        """
        name, records, owned = event.name, self._records, self.precision.copy_array

        def record(stepper: Any, when: Any, sign: int) -> None:
            stepper.update_d_output(when)
            records.append(EventRecord(name, when, owned(stepper.d_output[:3])))

        return heyoka_module().nt_event(
            self._crossings[name],
            record,
            direction=direction_of(event),
            fp_type=self.precision.number_type,
        )

    def run(self, request: Request) -> Result:
        """Integrate a request of this integrator's kind.

        Args:
            request: The run.

        Returns:
            The result, without half-widths.

        Raises:
            InputError: If the start, the duration or the speed is not finite.
        """
        start = Start.of(request, self.precision)
        duration = self.precision.number(request.duration)
        constants = [getattr(start.constants, name) for name in self._names[1:]]
        if request.perturbation_pattern is not None:
            *state, omega = perturb_last_bits(
                (*start.state, start.omega), request.perturbation_pattern, self.precision
            )
            start = start._replace(state=state, omega=omega)
            constants = perturb_last_bits(
                constants, request.perturbation_pattern + 1, self.precision
            )
        self._stepper.pars[: 1 + len(constants)] = [start.omega, *constants]
        self._grid = _grid_of(request, duration)
        sampled = request.times is not None and self._grid is None
        self._step_series = [] if request.estimated_by_defect or request.dense or sampled else None
        if request.domain != "none" and start.ops.sin(start.state[0]) <= 0:
            self._rewind(start)
            self._grid_states = self._stepper.state[None].copy()
            return self._result(request, Status.FLAT, 0)
        on_surfaces = start_surfaces(request, start) if request.events else NO_SURFACES
        # If an event function is zero to the last bit, heyoka misses its other crossings in the
        # first step.
        careful = self._two_sided or on_surfaces.has_exact_zero
        outcome, smallest_step, steps = self._run_to_end(
            start, on_surfaces if careful else NO_SURFACES, duration, request.max_steps
        )
        if (
            not careful
            and abs(self._stepper.time) <= on_surfaces.time_on_surface
            and (event := self._event_at_end(outcome)) is not None
            and event.name in on_surfaces.names
        ):
            outcome, smallest_step, steps = self._run_to_end(
                start, on_surfaces, duration, request.max_steps
            )
        status = (
            Status.REACHED
            if outcome == self._finished
            else self._stop_status(outcome, smallest_step)
        )
        if on_surfaces.names:  # the start itself is not a crossing
            self._records[:] = [
                record
                for record in self._records
                if record.name not in on_surfaces.names
                or abs(record.time) > on_surfaces.time_on_surface
            ]
        return self._result(request, status, steps)

    def _rewind(self, start: Start) -> None:
        """Reset the stepper to a given start at time 0, and clear the records of the run before."""
        stepper = self._stepper
        stepper.time = self._zero
        if self._step_series:
            self._step_series.clear()
        stepper.state[:3] = start.state
        stepper.state[3:] = self._identity
        if self._crossings:
            stepper.reset_cooldowns()
            self._records.clear()
        if self._two_sided:
            self._friction_sign.begin(stepper, start)

    def _integrate_until(self, target: Any, **options: Any) -> tuple[Any, Any, int]:
        """Integrate until the time ``target`` [s] or the first terminal event.

        The series of the steps are kept if they are needed. If the run has a grid of times, the
        states there are kept.

        Returns:
            heyoka's outcome, the smallest step and the number of steps.
        """
        if self._grid is not None:
            outcome, smallest_step, _, steps, _, self._grid_states = self._stepper.propagate_grid(
                self._grid, **options
            )
            return outcome, smallest_step, steps
        if self._step_series is not None:
            # This takes half the time of heyoka's continuous output. heyoka copies callables that
            # are not bare functions.
            options |= {"callback": self._series_recorder(self._step_series), "write_tc": True}
        outcome, smallest_step, _, steps, _, _ = self._stepper.propagate_until(target, **options)
        if self._step_series is not None and steps:
            options["callback"](self._stepper)
        return outcome, smallest_step, steps

    def _series_recorder(self, kept: list[tuple[Any, Any]]) -> Callable[[Any], bool]:
        """Return a callback for heyoka that appends the series of the last step to ``kept``.

        A step that is there already is not appended again. The callback returns True, so that the
        run continues.
        """
        rows, zero, owned = self._series_rows, self._zero, self.precision.copy_array

        def keep(stepper: Any) -> bool:
            end = stepper.time
            if end != (kept[-1][0] if kept else zero):
                kept.append((end, owned(stepper.tc[:rows])))
            return True  # the run continues

        return keep

    def _run_to_end(
        self, start: Start, on_surfaces: StartSurfaces, duration: Any, max_steps: int
    ) -> tuple[Any, Any, int]:
        """Integrate from a start until the final time or the first terminal event, and return what
        `_integrate_until` returns.

        The start may lie on an event's surface.
        """
        ended = self._leave_surface(start, on_surfaces, duration)
        ran = ended or self._integrate_until(duration, max_steps=max_steps)
        if self._two_sided and not ended and self._friction_sign.used_wrong_sign(self._stepper):
            # Two switches came closer together than events can resolve.
            self._friction_sign.looks_ahead = True
            ran = self._leave_surface(start, on_surfaces, duration) or self._integrate_until(
                duration, max_steps=max_steps
            )
            self._friction_sign.looks_ahead = False
        return ran

    def _leave_surface(
        self, start: Start, on_surfaces: StartSurfaces, duration: Any
    ) -> tuple[Any, Any, int] | None:
        """Move a run that starts on an event's surface off this surface, without recording the
        start as a crossing.

        Rounding decides whether heyoka sees a crossing at the start, so the run must not depend on
        it. Where a function is zero to the last bit, heyoka sees no other crossing of it in its
        first step.

        Returns:
            The outcome, as `_integrate_until` returns it, if the run ended on the way; otherwise
            None.
        """
        self._rewind(start)
        if not on_surfaces.names:
            return None
        # Use at most half of the run, so that the rest can be recorded.
        limit = min(
            self.precision.number(on_surfaces.time_on_surface),
            abs(duration) * self.precision.number(0.5),
        )
        limit = limit if start.runs_forward else -limit
        if self._jump_ahead(start, limit, on_surfaces):
            return None
        for _ in range(_MAX_PASSES):
            # An event that fires starts its cooldown, so the next call continues.
            outcome, smallest_step, _ = self._integrate_until(limit)
            event = self._event_at_end(outcome)
            if event is None or event.name not in on_surfaces.names:
                break
        ended = event is not None and event.name not in on_surfaces.names
        return (
            (outcome, smallest_step, 1)
            if ended or (self._two_sided and self._friction_sign.ended)
            else None
        )

    def _jump_ahead(self, start: Start, target: Any, on_surfaces: StartSurfaces) -> bool:
        """Move from the start to a ``target`` time near it by the first step's series. Return
        True if that is done.

        This passes all events of the start's surfaces. Many small steps from event to event would
        not work: their changes of an angle are lost in its rounding.

        Returns:
            False, with the stepper back at the start, if an event of another surface lies on the
            way too.
        """
        stepper = self._stepper
        stepper.step(target, write_tc=True)
        stepper.update_d_output(target)
        ahead = stepper.d_output.tolist()
        terms = self.precision.copy_array(stepper.tc[: self._series_rows])
        self._rewind(start)
        watched = [event for event in self._events if event.name not in on_surfaces.names]
        # The side, too, must be the same all the way, and not in doubt at the start
        if self._two_sided:
            watched += SLIDING_REVERSAL, FLAT
        if any(
            start.event_value(event) * start.event_value(event, ahead[:3]) <= 0 for event in watched
        ):
            return False
        stepper.time = target
        stepper.state[:] = ahead
        if self._step_series is not None:
            self._step_series.append((target, terms))
        return True

    def _event_at_end(self, outcome: Any) -> Event | None:
        """Return the request's terminal event that ended the run; None if no such event did.

        heyoka numbers them -1, -2, ...
        """
        index = -int(outcome.value) - 1
        return self._terminal[index] if 0 <= index < len(self._terminal) else None

    def _stop_status(self, outcome: Any, smallest_step: Any) -> Status:
        """Return the status of a run that did not reach its end, and record the terminal event if
        there was one.
        """
        if self._two_sided and self._friction_sign.ended:
            return Status.EVENT
        event = self._event_at_end(outcome)
        if event is None:
            if outcome.name == "err_nf_state":
                return Status.NON_FINITE
            resolved = abs(float(self._stepper.time)) * float(self.precision.epsilon)
            return (
                Status.STEP_TOO_SMALL
                if abs(float(smallest_step)) <= resolved
                else Status.STEP_LIMIT
            )
        self._records.append(
            EventRecord(
                event.name, self._stepper.time, self.precision.copy_array(self._stepper.state[:3])
            )
        )
        return Status.FLAT if event.name == FLAT.name else Status.EVENT

    def _result(self, request: Request, status: Status, steps: int) -> Result:
        whole, size = self.precision.copy_array(self._stepper.state), self._size
        derivatives = whole[size:].reshape(size, -1)[:3] if request.variations else None
        series = None
        if self._step_series is not None:
            # A run that has taken no step stands at its start.
            series = DenseOutput(
                self.precision,
                self._zero,
                self._step_series or [(self._zero, whole[: self._series_rows, None])],
            )
        samples = sample_derivatives = None
        if series is not None:
            samples = series.samples(request, status)
        elif self._grid is not None:
            times = DOUBLE.as_array(request.times)
            first, last = (int(times[end] == self._grid[end]) for end in (0, -1))
            samples = self._grid_states[1 - first : len(self._grid) - 1 + last, : self._series_rows]
        if samples is not None and derivatives is not None:
            at_samples = samples[:, size:].reshape(len(samples), size, derivatives.shape[1])
            samples, sample_derivatives = samples[:, :3], at_samples[:, :3]
        return Result(
            status,
            self._stepper.time,
            whole[:3],
            steps,
            samples=samples,
            dense=series if request.dense else None,
            derivatives=derivatives,
            sample_derivatives=sample_derivatives,
            divergence=whole[3] if request.divergence else None,
            events=tuple(self._records) if self._crossings else (),
            built=(self.build,),
            series=series,
        )
