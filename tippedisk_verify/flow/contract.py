"""The contract between those who need trajectories and the engines that compute them.

A `Request` says what is wanted, an engine returns a `Result`; nothing that the request does not name is built or
computed. Engines are callables ``engine(request) -> Result``; `taylor` and `baseline` each offer one kind.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from typing import Any, Literal, NamedTuple, Protocol

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.exact import refuse_qualified, shown
from tippedisk_verify.model.parameters import Constants, Friction, Parameters
from tippedisk_verify.model.precision import DOUBLE, Precision
from tippedisk_verify.model.results import Printable, with_widths

__all__ = [
    "FLAT",
    "MOST_STEPS",
    "SECTION",
    "SLIDING_REVERSAL",
    "TURN",
    "Build",
    "Engine",
    "ErrorEstimate",
    "Event",
    "EventRecord",
    "Request",
    "Result",
    "Status",
    "Variation",
    "raise_unless_usable",
]

#: What derivatives can be taken with respect to: the initial state, and the parameters that the field knows.
Variation = Literal["beta", "gamma", "v", "Omega", "r", "e", "a", "b", "g", "k"]
#: Steps of a run, unless it asks for more: half an hour of ordinary motion. A run that needs more is mostly stuck.
MOST_STEPS = 100_000
STATE_VARIATIONS: tuple[Variation, ...] = ("beta", "gamma", "v")


class Status(Enum):
    """How an integration ended. The value is the message: what happened, and what to try next."""

    REACHED = "the final time was reached"
    EVENT = "a terminal event ended the run"
    FLAT = "the disk lies flat (sin beta <= 0): the model ends here; shorten the run or start elsewhere"
    NON_FINITE = "the state became infinite or NaN; check the start, or integrate in more bits"
    STEP_LIMIT = "the step limit was reached before the final time; shorten the run, or raise max_steps"
    STEP_TOO_SMALL = "the step size fell below what this arithmetic resolves; integrate in more bits"
    FAILED = "the integrator gave up; try another method or a looser tolerance"

    @property
    def usable(self) -> bool:
        """Whether the result is what was asked for (or the model's own end)."""
        return self in (Status.REACHED, Status.EVENT, Status.FLAT)


class _Symbol:
    """A number without a value: it takes part in arithmetic, so that an event's function can be tried out."""

    def _combined(self, other: object = None) -> _Symbol:
        return self

    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = _combined
    __pow__ = __neg__ = _combined


class _Symbols:
    """The functions of `_Symbol`; anything else is not among those that an event may use."""

    sin = cos = staticmethod(_Symbol._combined)


@dataclass(frozen=True)
class Event:
    """A zero crossing of ``function(ops, constants, omega, beta, gamma, v)`` along the flow, with ops.sin and ops.cos.

    ``direction`` is +1 (rising with time, in backward runs too), -1 (falling) or 0 (both). A terminal event ends the
    run on the crossing; others are recorded. A start on the surface, up to rounding, is no crossing for as long as the
    function stays below 64 roundings, at most 2^-15 s (but for sin(beta) = 0 as the edge of the domain), and an orbit
    at rest there has none. A level that was computed goes into the function as ``float(level)``. Define an event once
    and pass the same object: engines keep what they built for it.
    """

    name: str
    function: Callable[[Any, Constants, Any, Any, Any, Any], Any]
    direction: Literal[-1, 0, 1] = 0
    terminal: bool = True

    def __post_init__(self) -> None:
        if self.direction not in (-1, 0, 1):
            raise InputError(f"an event's direction is -1, 0 or 1, not {shown(self.direction)}")
        try:
            self.function(_Symbols, Constants(*[_Symbol()] * len(Constants._fields)), *[_Symbol() for _ in range(4)])
        except (TypeError, AttributeError, ValueError) as fault:
            raise InputError(
                f"the event '{shown(self.name)}' needs a function of (ops, constants, omega, beta, gamma, v) made of "
                f"arithmetic, ops.sin and ops.cos, such as lambda ops, c, omega, beta, gamma, v: ops.cos(beta): {fault}"
            ) from None

    def __hash__(self) -> int:  # looked up in every run
        return hash(self.name)


#: The disk lies flat, sin(beta) = 0: the edge of the model's domain.
FLAT = Event("flat", lambda ops, constants, omega, beta, gamma, v: ops.sin(beta))
#: beta = pi/2 (cos beta = 0): the Poincare section, and where gamma is extreme.
SECTION = Event("section", lambda ops, constants, omega, beta, gamma, v: ops.cos(beta))
#: v = 0: beta is extreme.
TURN = Event("turn", lambda ops, constants, omega, beta, gamma, v: 1 * v)
#: gamma_y / sin(beta) = 0: the sliding velocity changes sign.
SLIDING_REVERSAL = Event(
    "surface",
    lambda ops, constants, omega, beta, gamma, v: (
        (constants.r + constants.e * ops.sin(gamma)) * v - constants.e * omega * (ops.sin(beta) * ops.cos(gamma))
    ),
)


@dataclass(frozen=True)
class Request:
    """What is wanted of an engine.

    ``omega``, ``state`` and ``duration`` take whatever `model.exact.exact` takes, so that the same request can be
    run in any precision. Angles in rad, ``v`` and ``omega`` in rad/s, times in s; the run starts at time 0 and goes
    backward if ``duration`` is negative.

    ``tolerance`` is relative, per step; None is the arithmetic's own round-off. ``domain`` says how leaving the model's
    domain is noticed: ``"event"`` locates sin(beta) = 0 and ends there (Status.FLAT); ``"samples"`` looks at the end
    and at the samples, and repeats the run with the event only if one of them lies outside; ``"none"`` does not look.
    Raises InputError for what no engine can do.
    """

    parameters: Parameters
    omega: object
    state: Sequence[object]
    duration: object
    shifted: bool = False  #: angles are beta_bar and gamma_bar, measured from pi/2, in the start and in every result
    precision: Precision = DOUBLE
    tolerance: float | Fraction | None = None
    times: Any = None  #: sample times, strictly rising from 0 or later (falling for a backward run)
    dense: bool = False  #: a function of time that interpolates to the integrator's accuracy
    variations: tuple[Variation, ...] = ()  #: derivatives of the final state with respect to these
    divergence: bool = (
        False  #: the integral of div f along the orbit (Liouville: log of the flow's Jacobian determinant)
    )
    events: tuple[Event, ...] = ()
    error_estimate: bool = False  #: half-widths that hold the error of all numbers (`flow.error_estimate`)
    digits: int = 12  #: beyond 12, in doubles and with an error estimate: the error is taken out of the result
    domain: Literal["event", "samples", "none"] = "event"
    rounding: int | None = None  #: a twin of the run: the pattern by which inputs' last bits move (`system.nudged`)
    max_steps: int = MOST_STEPS

    def __post_init__(self) -> None:
        _check_state(self.state)
        if not isinstance(self.max_steps, int) or not 1 <= self.max_steps < 2**31:
            raise InputError("max_steps must be a whole number between 1 and 2^31")
        if self.tolerance is not None and not 0 < self.tolerance < 1:
            raise InputError(f"a relative tolerance lies between 0 and 1, not {self.tolerance}")
        if self.times is not None:
            _check_times(self.times, self.precision, DOUBLE.number(self.duration))
        if self.domain not in ("event", "samples", "none"):
            raise InputError(f"domain is event, samples or none, not '{self.domain}'")
        if self.events:
            names = [event.name for event in self.events]
            if len(set(names)) != len(names):
                raise InputError("two events of one request have the same name")
            if FLAT.name in names and FLAT not in self.events:
                raise InputError(f"the event name '{FLAT.name}' is taken by sin(beta) = 0")
        if len(set(self.variations)) != len(self.variations):
            raise InputError("a variation is asked for twice")

    @property
    def friction(self) -> Friction:
        """The friction law."""
        return self.parameters.friction

    @property
    def estimated_by_defect(self) -> bool:
        """Whether half-widths come from the defect of the run's series, which gives the samples too."""
        return self.error_estimate and self.precision == DOUBLE and not self.variations

    def starting_at(self, state: Sequence[object], rounding: int | None = None) -> Request:
        """The same from another state, for a fraction of what `replace` takes: nothing else is checked again."""
        _check_state(state)
        other = object.__new__(Request)
        other.__dict__.update(self.__dict__, state=state, rounding=rounding)
        return other


@dataclass(frozen=True, repr=False, eq=False)
class EventRecord(Printable):
    """One crossing: the event's name, the time [s] and the state there, with half-widths where a `Solution` has it."""

    name: str
    time: Any
    state: Any  #: (3,) beta, gamma [rad] and v [rad/s]
    time_uncertainty: float = math.inf
    uncertainty: Any = (math.inf,) * 3  #: of the state at the crossing, wherever in its half-width that lies

    def to_dict(self) -> dict[str, Any]:
        state = zip(("beta", "gamma", "v"), with_widths(self.state, self.uncertainty), strict=True)
        return {"name": self.name, "t": with_widths(self.time, self.time_uncertainty), **dict(state)}


@dataclass(frozen=True, repr=False)
class Build(Printable):
    """One thing that was compiled (or taken from what was compiled before) for a request."""

    _untold = ()  # engine and precision are what it is

    engine: str  #: e.g. ``taylor``
    precision: str  #: e.g. ``double``
    friction: str
    variations: tuple[str, ...]
    divergence: bool
    events: tuple[str, ...]
    u_variables: int  #: elementary operations in the Taylor recurrences, the equations of motion not counted


@dataclass(frozen=True)
class ErrorEstimate:
    """Half-widths that hold the error of a result, rounding of the inputs included.

    ``state`` has the state's shape, ``samples`` that of the samples (or is None), ``time`` is a scalar (0 unless an
    event ended the run), ``events`` holds one half-width of the time of each recorded event and ``event_states`` the
    three of its state. ``infinity`` says that the two runs did not end alike: then rounding decides what happens.
    """

    state: Any
    time: float
    samples: Any = None
    events: tuple[float, ...] = ()
    event_states: tuple[Any, ...] = ()
    variations: Any = None

    @property
    def largest(self) -> float:
        """The largest half-width of the final state's components."""
        return float(max(self.state))


class Result(NamedTuple):
    """What an engine computed. Arrays are in the request's precision, of objects where its numbers are MPFR's."""

    status: Status
    time: Any  #: where the run ended [s]
    state: Any  #: (3,) final (beta, gamma, v)
    steps: int
    samples: Any = None  #: (n, 3) states at the sample times that were reached
    dense: Callable[[Any], Any] | None = None  #: times (n,) -> states (n, 3)
    derivatives: Any = None  #: (3, number of variations) d(final state)/d(variations), at fixed final time
    divergence: Any = None  #: integral of d(v')/d(v) over the run [1]
    events: tuple[EventRecord, ...] = ()
    error: ErrorEstimate | None = None
    evaluations: int | None = None  #: of the right-hand side, where the method counts them
    built: tuple[Build, ...] = ()  #: what the engine used for it
    series: Any = None  #: the polynomials of the steps (`flow.integrator.Series`), where something is taken from them
    precision: Precision | None = None  #: the arithmetic of its numbers, if not the request's


class Engine(Protocol):
    """Anything that answers requests."""

    @property
    def name(self) -> str:
        """For reports, e.g. ``taylor`` or ``scipy-DOP853``."""

    @property
    def measures_error(self) -> bool:
        """Whether it answers requests for an error estimate, and in every precision."""

    @property
    def builds(self) -> tuple[Build, ...]:
        """What it has compiled and keeps."""

    def __hash__(self) -> int:
        """Engines are distinguished by identity."""

    def __call__(self, request: Request) -> Result:
        """Compute what was asked for. Raises InputError for what this engine cannot do."""


def raise_unless_usable(result: Result) -> Result:
    """The result itself, if its status is one that was asked for. Raises ArithmeticError with the status otherwise."""
    if not result.status.usable:
        raise ArithmeticError(f"at t = {float(result.time):.6g} s {result.status.value}")
    return result


def _check_state(state: Sequence[object]) -> None:
    refuse_qualified(state)
    try:
        count = len(state)
    except TypeError:  # a number by itself
        count = 1
    if count != 3:
        raise InputError("a state has three components: beta, gamma, v")


def _check_times(times: Any, precision: Precision, duration: float) -> None:
    """Sample times must be strictly monotonic and lie between 0 and the duration."""
    if not len(times):
        raise InputError("the list of sample times is empty: leave it out instead")
    try:
        # Above double, times that a double cannot tell apart may well be meant.
        values = precision.sequence(times)
    except (TypeError, ValueError) as fault:
        raise InputError(f"sample times must be numbers: {fault}") from None
    if values.ndim != 1:
        raise InputError("sample times must be a list of numbers")
    ahead = values if duration >= 0 else -values
    if not (ahead[0] >= 0 and (ahead[1:] > ahead[:-1]).all() and float(ahead[-1]) <= abs(duration)):
        raise InputError("sample times must be strictly monotonic, from the start on and up to the end of the run")
