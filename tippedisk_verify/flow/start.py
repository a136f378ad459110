"""Starts on an event's surface: which surfaces, and for how long, so that the start itself is no crossing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from tippedisk_verify.flow.contract import FLAT, Event, Request
from tippedisk_verify.model.equations import Ops, field, shifted
from tippedisk_verify.model.parameters import Constants, Friction
from tippedisk_verify.model.precision import DOUBLE, Precision

__all__ = [
    "LONGEST_WINDOW",
    "NO_SURFACES",
    "ROUNDINGS",
    "START_WINDOW",
    "Start",
    "StartSurfaces",
    "at_rest",
    "starts_on_a_surface",
    "surfaces",
]

#: The shortest time for which a start on an event's surface lasts [s].
START_WINDOW = 2.0**-30
_WINDOWS = (START_WINDOW, 2.0**-25, 2.0**-20, 2.0**-15)
#: And the longest.
LONGEST_WINDOW = _WINDOWS[-1]
#: So many roundings an event function may show at a start on its surface.
ROUNDINGS = 64


class Start(NamedTuple):
    """The start of a run in one arithmetic (or of many runs, as arrays), and what it moves by."""

    ops: Ops
    constants: Constants
    friction: Friction
    omega: Any  #: [rad/s]
    state: Sequence[Any]
    forward: Any  #: whether time rises

    @classmethod
    def of(cls, request: Request, precision: Precision) -> Start:
        """That of a request, in an arithmetic with functions for single numbers."""
        number, ops = precision.number, shifted(precision.ops) if request.shifted else precision.ops
        state = [number(x) for x in request.state]
        constants, forward = request.parameters.at(precision), number(request.duration) >= 0
        return cls(ops, constants, request.friction, number(request.omega), state, bool(forward))

    def value(self, event: Event, state: Sequence[Any] | None = None) -> Any:
        """The event's function at the start, or at another state."""
        return event.function(self.ops, self.constants, self.omega, *(self.state if state is None else state))

    def rates(self, state: Sequence[Any]) -> Sequence[Any]:
        """The field at a state."""
        return field(self.ops, self.constants, self.omega, self.friction)(*state)

    def ahead(self, state: Sequence[Any], step: Any) -> Sequence[Any]:
        """The state a short time after this one, to second order."""
        middle = [x + step / 2 * rate for x, rate in zip(state, self.rates(state), strict=True)]
        return [x + step * rate for x, rate in zip(state, self.rates(middle), strict=True)]

    def lies_on(self, event: Event, epsilon: float) -> bool:
        """Whether the event's function is zero at the start, up to the rounding of the start."""
        return bool(abs(self.value(event)) <= ROUNDINGS * epsilon)

    def window(self, event: Event, epsilon: float = 2.0**-52) -> tuple[float, float]:
        """For how long [s] a start on the event's surface lasts, in doubles, and the function's value then.

        Until the function is no rounding any more: longer where the orbit only touches the surface. A crossing in that
        time is the start itself. The start is rounded by ``epsilon``.
        """
        window = value = 0.0
        for window in _WINDOWS:
            value = float(self.value(event, self.ahead(self.state, window if self.forward else -window)))
            if abs(value) > ROUNDINGS * epsilon:
                break
        return window, value


class StartSurfaces(NamedTuple):
    """The surfaces that a start lies on."""

    names: tuple[str, ...]
    window: float = 0.0  #: for how long it lies there [s]
    exactly: bool = False  #: whether one of the functions is zero to the last bit


NO_SURFACES = StartSurfaces(())


def at_rest(request: Request) -> bool:
    """Whether the start is an equilibrium to the last bit. Its event functions may vanish, but it crosses nothing."""
    if request.precision.number(request.state[2]) != 0:
        return False
    start = Start.of(request, request.precision)
    return not any(start.rates(start.state))


def starts_on_a_surface(request: Request) -> bool:
    """Return True if the start lies on the surface of an event, up to rounding in the request's arithmetic."""
    start, epsilon = Start.of(request, request.precision), float(request.precision.epsilon)
    return any(start.lies_on(event, epsilon) for event in request.events)


def surfaces(request: Request, start: Start) -> StartSurfaces:
    """The surfaces that the start of a run lies on.

    A start that floats give is rounded to a double, whatever the arithmetic. As the edge of the domain, sin(beta) = 0
    is always the end of a run.
    """
    epsilon = float(request.precision.epsilon)
    if any(type(x) is float for x in request.state):
        epsilon = max(epsilon, 2.0**-52)
    looked_at = [event for event in request.events if event.name != FLAT.name or request.domain == "none"]
    values = [(event, start.value(event)) for event in looked_at]
    on = [(event, value) for event, value in values if abs(value) <= ROUNDINGS * epsilon]
    if not on:
        return NO_SURFACES
    in_doubles = start._replace(
        ops=shifted(math) if request.shifted else math,
        constants=request.parameters.at(DOUBLE),
        omega=float(start.omega),
        state=[float(x) for x in start.state],
    )
    window = max(in_doubles.window(event, max(epsilon, 2.0**-52))[0] for event, _ in on)
    return StartSurfaces(tuple(event.name for event, _ in on), window, any(value == 0 for _, value in on))
