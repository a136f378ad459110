"""SciPy's integrators behind the contract: a method that shares only the equations with heyoka.

It works in double precision and with every friction law. A run without a tolerance of its own has
`_DEFAULT_TOLERANCE`. A race has the tolerances of `bench.methods`. Under a law with two sides it
keeps its correctness and loses only order, because the field is once continuously differentiable
and no more. Implicit methods and derivatives use the Jacobian of `model.equations`.
"""

from __future__ import annotations

import cmath
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from threading import RLock
from typing import Any, Literal, get_args

import numpy

from tippedisk_verify.errors import InputError
from tippedisk_verify.flow.contract import (
    FLAT,
    STATE_VARIATIONS,
    Build,
    Event,
    EventRecord,
    Request,
    Result,
    Status,
)
from tippedisk_verify.flow.start import Start, starts_at_rest
from tippedisk_verify.flow.system import parameter_names
from tippedisk_verify.model.equations import equation_terms, jacobian, shifted_ops, vector_field
from tippedisk_verify.numbers.exact import is_one_of, short_text
from tippedisk_verify.numbers.numpy_errors import ignore_numpy_errors_in_methods
from tippedisk_verify.numbers.precision import DOUBLE

__all__ = ["SCIPY_METHODS", "ScipyEngine", "ScipyMethod"]

ScipyMethod = Literal["DOP853", "RK45", "Radau", "BDF", "LSODA"]
SCIPY_METHODS: tuple[ScipyMethod, ...] = get_args(ScipyMethod)
_TAKES_JACOBIAN = ("Radau", "BDF", "LSODA")
# solve_ivp refuses a relative tolerance below 100 ulps.
_MIN_TOLERANCE = 100 * 2.0**-52
_DEFAULT_TOLERANCE = 1e-13  # slightly above the tightest; all methods still converge smoothly there

# A complex step whose square is negligible against 1, so that the derivative is exact to round-off.
_COMPLEX_STEP = 1e-40
_MAX_EVALUATIONS_PER_STEP = 40  # no method evaluates the right-hand side more often in a step
# Before SciPy 1.17 LSODA kept the state of its run in the library, one for all threads.
_LSODA_LOCK = RLock()


class _OutOfStepsError(Exception):
    pass


class _CountedRates:
    """The right-hand side of the equations of motion for SciPy, with its evaluations counted and
    limited.
    """

    def __init__(self, rates: Callable[[float, Any], Any], initial: Any, max_calls: int) -> None:
        self._rates, self._max_calls, self.calls = rates, max_calls, 0
        self.time, self.state = 0.0, initial  #: of the last call

    def __call__(self, t: float, y: Any) -> Any:
        self.calls += 1
        self.time, self.state = t, y
        if self.calls > self._max_calls:
            raise _OutOfStepsError
        return self._rates(t, y)


@ignore_numpy_errors_in_methods
class ScipyEngine:
    """An engine that integrates with one of SciPy's methods.

    Args:
        method: One of `SCIPY_METHODS`.

    Raises:
        InputError: If SciPy has no such method, or it is not offered.
    """

    #: This engine gives no half-widths, because SciPy has no reliable error estimate.
    measures_error = False
    #: The integrators that this engine has compiled: none, because SciPy compiles nothing.
    builds: tuple[Build, ...] = ()

    def __init__(self, method: str = "DOP853") -> None:
        if not is_one_of(method, SCIPY_METHODS):
            raise InputError(
                f"method '{short_text(method)}' is not known: use {', '.join(SCIPY_METHODS)}"
            )
        self.method = method

    @property
    def name(self) -> str:
        """The name of this engine in results: ``scipy-`` and the method."""
        return f"scipy-{self.method}"

    def __call__(self, request: Request) -> Result:
        """Integrate the motion that a request describes, with SciPy.

        Args:
            request: The run.

        Returns:
            The result, without half-widths.

        Raises:
            InputError: If the request asks for more than double precision, for the divergence or
                for an error estimate.
        """
        if request.precision != DOUBLE:
            raise InputError(
                f"SciPy integrates in double precision only, not {request.precision.name}"
            )
        if request.divergence:
            raise InputError(
                "a SciPy engine cannot integrate the divergence: use the Taylor engine"
            )
        if request.error_estimate:
            raise InputError(
                "SciPy has no reliable error estimate: use the Taylor engine, or compare with it"
            )
        if request.events and starts_at_rest(request):
            return self(replace(request, events=()))
        start = Start.of(request, DOUBLE)
        initial, duration = numpy.array(start.state), DOUBLE.number(request.duration)
        if request.domain != "none" and start.ops.sin(start.state[0]) <= 0:
            return Result(Status.FLAT, 0.0, initial, 0)
        if not duration:
            samples = None if request.times is None else numpy.array([initial] * len(request.times))
            return Result(Status.REACHED, 0.0, initial, 0, samples=samples)
        return self._integrate(request, start, initial, duration)

    def _integrate(self, request: Request, start: Start, initial: Any, duration: float) -> Result:
        from scipy.integrate import solve_ivp

        law = start.ops, start.constants, start.omega, start.law
        options: dict[str, Any] = {}
        if request.variations:
            rates = _with_variations(request, start)
            identity = [
                [float(row == name) for name in request.variations] for row in STATE_VARIATIONS
            ]
            initial = numpy.concatenate((initial, numpy.ravel(identity)))
        else:
            rhs, slope = vector_field(*law), jacobian(*law)

            def rates(t: float, y: Any) -> Any:
                # Python floats: several times faster than numpy scalars
                return rhs(*y.tolist())

            if self.method in _TAKES_JACOBIAN:
                options["jac"] = lambda t, y: numpy.array(slope(*y.tolist()))
        detected_events = list(request.events)
        if request.domain != "none" and FLAT not in detected_events:
            detected_events.append(FLAT)
        counted = _CountedRates(rates, initial, request.max_steps * _MAX_EVALUATIONS_PER_STEP)
        tolerance = max(request.tolerance or _DEFAULT_TOLERANCE, _MIN_TOLERANCE)
        events = [_event(event, start) for event in detected_events]
        # SciPy's error norms overflow where a motion leaves the doubles. A status reports it.
        silent = numpy.errstate(over="ignore", invalid="ignore", divide="ignore")
        try:
            with silent, _LSODA_LOCK if self.method == "LSODA" else nullcontext():
                solution = solve_ivp(
                    counted,
                    (0.0, duration),
                    initial,
                    method=self.method,
                    dense_output=request.dense or request.times is not None or bool(request.events),
                    rtol=tolerance,
                    atol=tolerance,
                    events=events or None,
                    **options,
                )
        except (_OutOfStepsError, ValueError, OverflowError) as stop:
            # The C library's sine of an infinity is a ValueError. Any other ValueError is a mistake
            # here.
            limited, last = isinstance(stop, _OutOfStepsError), counted.state
            if not limited and numpy.isfinite(last).all() and abs(last).max() < 1e150:
                raise
            status = Status.STEP_LIMIT if limited else Status.NON_FINITE
            return Result(
                status, float(counted.time), numpy.array(last[:3]), 0, evaluations=counted.calls
            )
        return _result(request, solution, detected_events)


def _result(request: Request, solution: Any, detected_events: list[Event]) -> Result:
    end, final, dense = float(solution.t[-1]), solution.y[:, -1], solution.sol
    records = [
        EventRecord(event.name, float(when), state[:3].copy())
        for event, times, states in zip(
            detected_events, solution.t_events or (), solution.y_events or (), strict=True
        )
        for when, state in zip(times, states, strict=True)
    ]
    records.sort(key=lambda record: abs(record.time))
    if solution.status == 0:
        status = Status.REACHED
    elif solution.status == 1:
        ending = {event.name for event in detected_events if event.terminal} & {
            record.name for record in records if record.time == end
        }
        status = Status.FLAT if FLAT.name in ending else Status.EVENT
    elif not numpy.isfinite(final).all():
        status = Status.NON_FINITE
    else:
        status = (
            Status.STEP_TOO_SMALL if "step size" in str(solution.message).lower() else Status.FAILED
        )
    samples = sample_derivatives = None
    if request.times is not None:
        times = numpy.array([DOUBLE.number(time) for time in request.times])
        reached = times[abs(times) <= abs(end)]
        # SciPy's interpolant refuses an empty array.
        rows = dense(reached).T if reached.size else numpy.empty((0, len(final)))
        samples = rows[:, :3].copy()
        if request.variations:
            sample_derivatives = rows[:, 3:].reshape(len(rows), 3, len(request.variations))
    return Result(
        status=status,
        time=end,
        state=final[:3].copy(),
        steps=len(solution.t) - 1,
        samples=samples,
        dense=(lambda t: dense(numpy.asarray(t))[:3].T) if request.dense else None,
        derivatives=final[3:].reshape(3, -1).copy() if request.variations else None,
        sample_derivatives=sample_derivatives,
        events=tuple(records),
        evaluations=int(solution.nfev),
    )


def _event(event: Event, start: Start) -> Callable[[float, Any], float]:
    at_start: float | None = None
    if event.name != FLAT.name and start.lies_on(event, 2.0**-52):
        # Rounding decides the sign there. Use the sign a moment later, so that the start is no
        # crossing.
        _, at_start = start.time_on_surface(event)

    def crossing(t: float, y: Any) -> float:
        if t == 0.0 and at_start is not None:
            return at_start
        return float(start.event_value(event, y[:3].tolist()))

    crossing.terminal = event.terminal  # type: ignore[attr-defined]
    # SciPy means the order of its steps, the contract that of time.
    crossing.direction = event.direction if start.runs_forward else -event.direction  # type: ignore[attr-defined]
    return crossing


def _with_variations(request: Request, start: Start) -> Callable[[float, Any], Any]:
    """Return a function of (t, y) that gives the rates of the flow and of its first-order
    variations, Y' = (df/dx) Y + df/dp.

    The derivatives come from an imaginary step along each of the variations.
    """
    step, ops = complex(0.0, _COMPLEX_STEP), shifted_ops(cmath) if request.shifted else cmath
    constants, omega, law = start.constants, start.omega, start.law
    names = parameter_names(law)
    fields = []
    for name in request.variations:
        if name not in (*STATE_VARIATIONS, *names):
            raise InputError(
                f"no derivative with respect to '{name}': use beta, gamma, v, {', '.join(names)}"
            )
        moved = (
            constants._replace(**{name: getattr(constants, name) + step})
            if name in names[1:]
            else constants
        )
        speed = omega + step if name == "Omega" else omega
        # The absolute value has no complex derivative; the sign of gamma_y replaces it.
        fields.append({side: vector_field(ops, moved, speed, law, side) for side in (1, -1)})
    real_field = vector_field(start.ops, constants, omega, law)

    def rates(t: float, y: Any) -> Any:
        state, columns = y[:3].tolist(), y[3:].reshape(3, -1).T.tolist()
        side = (
            1 if equation_terms(start.ops, constants, omega, *state).sliding_velocity >= 0 else -1
        )
        changes = []
        for sides, column in zip(fields, columns, strict=True):
            varied = [x + step * variation for x, variation in zip(state, column, strict=True)]
            changes.append([complex(rate).imag / _COMPLEX_STEP for rate in sides[side](*varied)])
        return numpy.concatenate((real_field(*state), numpy.transpose(changes).ravel()))

    return rates
