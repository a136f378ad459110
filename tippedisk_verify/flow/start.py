"""The start of a run on an event's surface, which must not count as a crossing of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from tippedisk_verify.flow.contract import FLAT, Event, Request
from tippedisk_verify.model.equations import Ops, shifted_ops, vector_field
from tippedisk_verify.model.friction import FrictionLaw
from tippedisk_verify.model.parameters import Constants
from tippedisk_verify.numbers.precision import DOUBLE, Precision

__all__ = [
    "MAX_TIME_ON_SURFACE",
    "MIN_TIME_ON_SURFACE",
    "NO_SURFACES",
    "SURFACE_ROUNDINGS",
    "Start",
    "StartSurfaces",
    "start_surfaces",
    "starts_at_rest",
    "starts_on_a_surface",
]

#: The shortest time for which a start on an event's surface lasts [s].
MIN_TIME_ON_SURFACE = 2.0**-30
_TIMES_ON_SURFACE = (MIN_TIME_ON_SURFACE, 2.0**-25, 2.0**-20, 2.0**-15)
#: The longest such time [s].
MAX_TIME_ON_SURFACE = _TIMES_ON_SURFACE[-1]
#: The largest value of an event function at a start on its surface, in roundings.
SURFACE_ROUNDINGS = 64


class Start(NamedTuple):
    """The start of a run: state, speed, constants and friction law in one arithmetic, or of many
    runs as arrays.
    """

    ops: Ops
    constants: Constants
    law: FrictionLaw
    omega: Any  #: [rad/s]
    state: Sequence[Any]
    runs_forward: Any  #: True if time rises

    @classmethod
    def of(cls, request: Request, precision: Precision) -> Start:
        """Convert the start of a requested run to numbers of one arithmetic.

        Args:
            request: The run.
            precision: The arithmetic.
        """
        number, ops = (
            precision.number,
            shifted_ops(precision.ops) if request.shifted else precision.ops,
        )
        state = [number(x) for x in request.state]
        constants, forward = (
            request.parameters.constants_in(precision),
            number(request.duration) >= 0,
        )
        return cls(ops, constants, request.law, number(request.omega), state, bool(forward))

    def event_value(self, event: Event, state: Sequence[Any] | None = None) -> Any:
        """Return the value of an event's function at the run's start, or at another state.

        Args:
            event: The event.
            state: (beta [rad], gamma [rad], v [rad/s]); the start if left out.
        """
        return event.function(
            self.ops, self.constants, self.omega, *(self.state if state is None else state)
        )

    def rates(self, state: Sequence[Any]) -> Sequence[Any]:
        """Return the rates of motion at a state [rad/s, rad/s, rad/s^2].

        Args:
            state: (beta [rad], gamma [rad], v [rad/s]).
        """
        return vector_field(self.ops, self.constants, self.omega, self.law)(*state)

    def state_after(self, state: Sequence[Any], step: Any) -> Sequence[Any]:
        """Return the state that a motion reaches from a state after a short time, to second order.

        Args:
            state: (beta [rad], gamma [rad], v [rad/s]).
            step: The time [s]; negative for a backward run.
        """
        middle = [x + step / 2 * rate for x, rate in zip(state, self.rates(state), strict=True)]
        return [x + step * rate for x, rate in zip(state, self.rates(middle), strict=True)]

    def lies_on(self, event: Event, epsilon: float) -> bool:
        """Return True if the run's start lies on an event's surface: the event's function is zero
        there, up to rounding.

        Args:
            event: The event.
            epsilon: The relative rounding of the start.
        """
        return bool(abs(self.event_value(event)) <= SURFACE_ROUNDINGS * epsilon)

    def time_on_surface(self, event: Event, epsilon: float = 2.0**-52) -> tuple[float, float]:
        """Return how long the orbit from a start on an event's surface stays on it to rounding, and
        the event function's value after that time.

        This takes longer where the orbit only touches the surface. A crossing within this time is
        the start itself.

        Args:
            event: The event.
            epsilon: The relative rounding of the start.

        Returns:
            The duration [s] and the value, both as doubles.
        """
        window = value = 0.0
        for window in _TIMES_ON_SURFACE:
            value = float(
                self.event_value(
                    event, self.state_after(self.state, window if self.runs_forward else -window)
                )
            )
            if abs(value) > SURFACE_ROUNDINGS * epsilon:
                break
        return window, value


class StartSurfaces(NamedTuple):
    """The surfaces on which a run's start lies: events whose functions are zero there."""

    names: tuple[str, ...]
    time_on_surface: float = 0.0  #: the duration of its stay there [s]
    has_exact_zero: bool = False  #: True if one of the functions is zero to the last bit


NO_SURFACES = StartSurfaces(())


def starts_at_rest(request: Request) -> bool:
    """Return True if a run's start is an equilibrium to the last bit.

    Its event functions may vanish, but it crosses no surface.

    Args:
        request: The run.
    """
    if request.precision.number(request.state[2]) != 0:
        return False
    start = Start.of(request, request.precision)
    return not any(start.rates(start.state))


def starts_on_a_surface(request: Request) -> bool:
    """Return True if a run's start lies on an event's surface, up to rounding in its arithmetic.

    Args:
        request: The run.
    """
    start, epsilon = Start.of(request, request.precision), float(request.precision.epsilon)
    return any(start.lies_on(event, epsilon) for event in request.events)


def start_surfaces(request: Request, start: Start) -> StartSurfaces:
    """Return the event surfaces on which the start of a run lies.

    The surface of an event consists of the zeros of its function. A start given by floats is
    rounded to a double in every arithmetic. sin(beta) = 0 counts only if the domain is not checked;
    as the edge of the domain it always ends a run.

    Args:
        request: The run.
        start: Its start in the request's arithmetic.
    """
    epsilon = float(request.precision.epsilon)
    if any(type(x) is float for x in request.state):
        epsilon = max(epsilon, 2.0**-52)
    on = [
        (event, value)
        for event in request.events
        if (event.name != FLAT.name or request.domain == "none")
        and abs(value := start.event_value(event)) <= SURFACE_ROUNDINGS * epsilon
    ]
    if not on:
        return NO_SURFACES
    in_doubles = start._replace(
        ops=shifted_ops(math) if request.shifted else math,
        constants=request.parameters.constants_in(DOUBLE),
        omega=float(start.omega),
        state=[float(x) for x in start.state],
    )
    window = max(in_doubles.time_on_surface(event, max(epsilon, 2.0**-52))[0] for event, _ in on)
    return StartSurfaces(
        tuple(event.name for event, _ in on), window, any(value == 0 for _, value in on)
    )
