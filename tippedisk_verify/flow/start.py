"""Starts on an event's surface: which surfaces, and for how long, so that the start itself is no crossing."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from tippedisk_verify.flow.contract import FLAT, Event, Request
from tippedisk_verify.model.equations import Ops, field, shifted
from tippedisk_verify.model.parameters import Constants
from tippedisk_verify.model.precision import DOUBLE

__all__ = [
    "LONGEST_WINDOW",
    "NO_SURFACES",
    "ROUNDINGS",
    "START_WINDOW",
    "StartSurfaces",
    "at_rest",
    "event_values",
    "start_window",
    "starts_on",
    "surfaces",
]

#: The shortest time for which a start on an event's surface lasts [s].
START_WINDOW = 2.0**-30
_WINDOWS = (START_WINDOW, 2.0**-25, 2.0**-20, 2.0**-15)
#: And the longest.
LONGEST_WINDOW = _WINDOWS[-1]
#: So many roundings an event function may show at a start on its surface.
ROUNDINGS = 64


class StartSurfaces(NamedTuple):
    """The surfaces that a start lies on, and what happened on the way off them."""

    names: tuple[str, ...]
    window: float = 0.0  #: for how long it lies there [s]
    ended: tuple[Any, Any] | None = None  #: outcome and smallest step of a run that another event ended on the way


NO_SURFACES = StartSurfaces(())


def at_rest(request: Request) -> bool:
    """Whether the start is an equilibrium to the last bit. Its event functions may vanish, but it crosses nothing."""
    precision = request.precision
    number = precision.number
    if number(request.state[2]) != 0:
        return False
    ops = shifted(precision.ops) if request.shifted else precision.ops
    flow = field(ops, request.parameters.at(precision), number(request.omega), request.friction)
    return not any(flow(*map(number, request.state)))


def starts_on(event: Event, ops: Ops, constants: Constants, omega: Any, state: Sequence[Any], epsilon: float) -> bool:
    """Whether the event function is zero at the start, up to the rounding of the start."""
    return bool(abs(event.function(ops, constants, omega, *state)) <= ROUNDINGS * epsilon)


def start_window(
    event: Event,
    ops: Ops,
    constants: Constants,
    omega: float,
    state: Sequence[float],
    flow: Callable[..., Sequence[float]],
    forward: bool,
    epsilon: float = 2.0**-52,
) -> tuple[float, float]:
    """For how long [s] a start on the event's surface lasts, in doubles, and the function's value then.

    Until the function is no rounding any more: longer where the orbit only touches the surface. A crossing in that time
    is the start itself. ``flow`` gives the rates at a state; the start is rounded by ``epsilon``.
    """
    window = value = 0.0
    for window in _WINDOWS:
        step = window if forward else -window
        middle = [part + step / 2 * rate for part, rate in zip(state, flow(*state), strict=True)]
        ahead = [part + step * rate for part, rate in zip(state, flow(*middle), strict=True)]
        value = float(event.function(ops, constants, omega, *ahead))
        if abs(value) > ROUNDINGS * epsilon:
            break
    return window, value


def event_values(
    events: Sequence[Event], ops: Ops, constants: Constants, omega: Any, state: Sequence[Any]
) -> list[Any]:
    """The event functions at a state (or at many, as arrays)."""
    return [event.function(ops, constants, omega, *state) for event in events]


def surfaces(request: Request, ops: Ops, omega: Any, state: Sequence[Any], forward: bool) -> StartSurfaces:
    """The surfaces that the start of a run lies on.

    A start that floats give is rounded to a double, whatever the arithmetic. As the edge of the domain, sin(beta) = 0
    is always the end of a run.
    """
    epsilon = float(request.precision.epsilon)
    if any(type(part) is float for part in request.state):
        epsilon = max(epsilon, 2.0**-52)
    constants = request.parameters.at(request.precision)
    on = [
        event
        for event in request.events
        if starts_on(event, ops, constants, omega, state, epsilon)
        and (event.name != FLAT.name or request.domain == "none")
    ]
    if not on:
        return NO_SURFACES
    ops, constants = shifted(math) if request.shifted else math, request.parameters.at(DOUBLE)
    start, speed = [float(part) for part in state], float(omega)
    flow = field(ops, constants, speed, request.friction)
    windows = (
        start_window(event, ops, constants, speed, start, flow, forward, max(epsilon, 2.0**-52))[0] for event in on
    )
    return StartSurfaces(tuple(event.name for event in on), max(windows))
