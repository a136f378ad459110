"""The contract between the users of motions and the engines that compute them: requests, results,
events, and statuses with their messages.

The events that the package knows by name are here: crossings of a section, turns, sliding
reversals, and lying flat. A `Request` describes a run, and an engine returns a `Result`. Nothing is
built or computed that the request does not name. Engines are callables ``engine(request) ->
Result``. `taylor` and `scipy_engine` each provide one kind.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from functools import partial
from inspect import signature
from typing import Any, Literal, NamedTuple, Protocol

from tippedisk_verify.display import Printable, numbers_as_json
from tippedisk_verify.errors import InputError
from tippedisk_verify.model.equations import STATE_NAMES
from tippedisk_verify.model.friction import FrictionLaw
from tippedisk_verify.model.parameters import Constants, Parameters
from tippedisk_verify.numbers.exact import is_one_of, refuse_units_and_masks, short_text
from tippedisk_verify.numbers.precision import DOUBLE, DOUBLE_DIGITS, Precision

__all__ = [
    "BETA_EXTREME",
    "CORRECTED_DIGITS",
    "EXTENDED_DIGITS",
    "FLAT",
    "GAMMA_TOP",
    "MAX_STEPS",
    "SECTION",
    "SLIDING_REVERSAL",
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

#: The variables of derivatives: the initial state and the parameters of the field. A law of a
#: user's own takes m, mu and epsilon.
Variation = Literal[
    "beta", "gamma", "v", "Omega", "r", "e", "a", "b", "g", "k", "traction", "m", "mu", "epsilon"
]
#: The default limit of a run's steps: half an hour of ordinary motion. A run that needs more is
#: usually stuck.
MAX_STEPS = 100_000
#: The number of digits up to which extended numbers carry the estimate of a run's error. A machine
#: without them uses doubles in their place.
EXTENDED_DIGITS = 16
#: The number of digits up to which a run in doubles suffices, once its error is added.
CORRECTED_DIGITS = 25
STATE_VARIATIONS: tuple[Variation, ...] = ("beta", "gamma", "v")


class Status(Enum):
    """The way in which an integration ended. Its value is a message: what happened, and what to try
    next.
    """

    REACHED = "the final time was reached"
    EVENT = "a terminal event ended the run"
    FLAT = "the disk lies flat (sin beta <= 0): the model ends here; shorten the run or start elsewhere"
    NON_FINITE = "the state became infinite or NaN; check the start, or integrate in more bits"
    STEP_LIMIT = (
        "the step limit was reached before the final time; shorten the run, or raise max_steps"
    )
    STEP_TOO_SMALL = (
        "the step size fell below what this arithmetic resolves; integrate in more bits"
    )
    FAILED = "the integrator gave up; try another method or a looser tolerance"

    @property
    def usable(self) -> bool:
        """True if the run ended as requested or at the end of the model's domain."""
        return self in (Status.REACHED, Status.EVENT, Status.FLAT)


_SCIPY_ARGUMENTS = 2  # the arguments of SciPy's event functions: t and y


class _Symbol:
    """A stand-in for a number, with which an event's function is called to see if it uses
    arithmetic only.

    The result of any arithmetic with it is the stand-in itself.
    """

    def _combined(self, other: object = 0) -> _Symbol:
        if other is None:
            raise TypeError("the motion does not depend on the time, and neither may an event")
        return self

    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = (
        _combined
    )
    __pow__ = __neg__ = _combined


class _Symbols:
    """The sine and cosine of a `_Symbol`, the only functions that an event may use."""

    sin = cos = staticmethod(_Symbol._combined)


def _value_at_state(
    function: Callable[..., Any], ops: Any, constants: Any, omega: Any, *state: Any
) -> Any:
    """Return the value of an event function of SciPy's form, ``function(t, y)``, at a state.

    The time is None, because motion and events do not depend on it.
    """
    return function(None, state)


@dataclass(frozen=True)
class Event:
    """An event of a motion: a zero crossing of ``function(ops, constants, omega, beta, gamma, v)``
    along the flow.

    The function consists of arithmetic, ops.sin and ops.cos. A function of two arguments is SciPy's
    ``function(t, y)``, without t and with arithmetic on y = (beta, gamma, v) only.

    A terminal event ends the run at the crossing; others are recorded. A start on the surface, up
    to rounding, is not a crossing. This holds for as long as the function stays below 64 roundings,
    at most 2^-15 s. The only exception is sin(beta) = 0 as the edge of the domain. An orbit at rest
    on the surface has no crossing.

    A computed level must enter the function as ``float(level)``. Define an event once and pass the
    same object, because engines keep what they compile for it.

    Args:
        name: The name of its records.
        function: The function, as described above.
        direction: +1 for crossings that rise with time (also in backward runs), -1 for falling
            ones, 0 for both.
        terminal: True ends the run at the crossing.

    Raises:
        InputError: If the direction or the function cannot be used.
    """

    name: str
    function: Callable[[Any, Constants, Any, Any, Any, Any], Any]
    direction: Literal[-1, 0, 1] = 0
    terminal: bool = True

    def __post_init__(self) -> None:
        if self.direction not in (-1, 0, 1):
            raise InputError(
                f"an event's direction is -1, 0 or 1, not {short_text(self.direction)}"
            )
        with suppress(TypeError, ValueError):
            if len(signature(self.function).parameters) == _SCIPY_ARGUMENTS:
                object.__setattr__(self, "function", partial(_value_at_state, self.function))
        try:
            self.function(
                _Symbols,
                Constants(*[_Symbol()] * len(Constants._fields)),
                *[_Symbol() for _ in range(4)],
            )
        except (TypeError, AttributeError, ValueError) as fault:
            raise InputError(
                f"the event '{short_text(self.name)}' needs a function of (ops, constants, omega, beta, "
                f"gamma, v) made of "
                f"arithmetic, ops.sin and ops.cos, such as lambda ops, c, omega, beta, gamma, v: "
                f"ops.cos(beta), "
                f"or one of (t, y) made of arithmetic on y: {fault}"
            ) from None

    def __hash__(self) -> int:  # looked up in every run
        return hash(self.name)


#: The disk lies flat, sin(beta) = 0: the edge of the model's domain.
FLAT = Event("flat", lambda ops, constants, omega, beta, gamma, v: ops.sin(beta))
#: beta = pi/2 (cos beta = 0): the Poincare section, where gamma is extreme.
SECTION = Event("section", lambda ops, constants, omega, beta, gamma, v: ops.cos(beta))
#: v = 0: beta is extreme.
BETA_EXTREME = Event("turn", lambda ops, constants, omega, beta, gamma, v: 1 * v)
#: gamma = pi/2 modulo 2 pi, passed upward: the centre of gravity is at its top. The run goes on.
GAMMA_TOP = Event(
    "top",
    lambda ops, constants, omega, beta, gamma, v: ops.cos(gamma),
    direction=-1,
    terminal=False,
)
#: gamma_y / sin(beta) = 0: the sliding velocity changes sign.
SLIDING_REVERSAL = Event(
    "surface",
    lambda ops, constants, omega, beta, gamma, v: (
        (constants.r + constants.e * ops.sin(gamma)) * v
        - constants.e * omega * (ops.sin(beta) * ops.cos(gamma))
    ),
)


@dataclass(frozen=True)
class Request:
    """A description of an integration of the motion: disk, speed, start, duration and what to
    record.

    ``omega``, ``state`` and ``duration`` are numbers or texts that `numbers.exact.exact` accepts,
    so the same request can run in any precision. Angles are in rad, ``v`` and ``omega`` in rad/s,
    times in s. The run starts at time 0 and goes backward if ``duration`` is negative.

    Args:
        tolerance: The relative tolerance of a step; None is the arithmetic's round-off.
        domain: ``"event"`` locates sin(beta) = 0 and ends the run there (Status.FLAT).
            ``"samples"`` checks only the end and the samples, and repeats the run with the event if
            one of them lies outside. ``"none"`` does not check.

    Raises:
        InputError: If no engine can serve the request.
    """

    parameters: Parameters
    omega: object
    state: Sequence[object]
    duration: object
    #: Angles are beta_bar and gamma_bar, measured from pi/2, in the start and in every result
    shifted: bool = False
    precision: Precision = DOUBLE
    tolerance: float | Fraction | None = None
    times: Any = None  #: sample times, strictly rising from 0 or later (falling for a backward run)
    dense: bool = False  #: a function of time that interpolates to the integrator's accuracy
    variations: tuple[Variation, ...] = ()  #: derivatives of the final state with respect to these
    divergence: bool = (
        #: The integral of div f along the orbit (Liouville: log of the flow's Jacobian determinant)
        False
    )
    events: tuple[Event, ...] = ()
    #: Compute half-widths that hold the error of all numbers (`flow.half_widths_by_defect`).
    error_estimate: bool = False
    #: Significant digits. Beyond `DOUBLE_DIGITS`, in doubles and with an error estimate, the error
    #: is removed from the result.
    digits: int = DOUBLE_DIGITS
    domain: Literal["event", "samples", "none"] = "event"
    #: For a twin of the run: the pattern by which the inputs' last bits move
    #: (`system.perturb_last_bits`).
    perturbation_pattern: int | None = None
    max_steps: int = MAX_STEPS

    def __post_init__(self) -> None:
        _check_state(self.state)
        if not isinstance(self.max_steps, int) or not 1 <= self.max_steps < 2**31:
            raise InputError("max_steps must be a whole number between 1 and 2^31")
        if self.tolerance is not None and not 0 < self.tolerance < 1:
            raise InputError(f"a relative tolerance lies between 0 and 1, not {self.tolerance}")
        if self.times is not None:
            _check_times(self.times, self.precision, DOUBLE.number(self.duration))
        if not is_one_of(self.domain, ("event", "samples", "none")):
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
    def law(self) -> FrictionLaw:
        """The friction law of the requested run."""
        return self.parameters.law

    @property
    def estimated_by_defect(self) -> bool:
        """True if half-widths come from the defect of the run's series, which is then kept."""
        return self.error_estimate and self.precision == DOUBLE and not self.variations

    def starting_at(
        self, state: Sequence[object], perturbation_pattern: int | None = None
    ) -> Request:
        """Return a copy of the request that starts from another state.

        Only the state is checked again, so this takes a fraction of the time of `replace`.

        Args:
            state: The start (beta [rad], gamma [rad], v [rad/s]).
            perturbation_pattern: The pattern of a twin (`system.perturb_last_bits`), or None.

        Raises:
            InputError: If the state does not have three components.
        """
        _check_state(state)
        other = object.__new__(Request)
        other.__dict__.update(self.__dict__, state=state, perturbation_pattern=perturbation_pattern)
        return other


@dataclass(frozen=True, repr=False, eq=False)
class EventRecord(Printable):
    """One recorded crossing of an event's surface: the event's name, the time [s] and the state,
    with any half-widths.
    """

    name: str
    time: Any
    state: Any  #: (3,) beta, gamma [rad] and v [rad/s]
    time_uncertainty: float = math.inf
    #: (3,) half-widths of the state, for every time within ``time_uncertainty``.
    uncertainty: Any = (math.inf,) * 3

    def to_dict(self) -> dict[str, Any]:
        """Return the recorded crossing as data for JSON."""
        state = zip(STATE_NAMES, numbers_as_json(self.state, self.uncertainty), strict=True)
        return {
            "name": self.name,
            "t": numbers_as_json(self.time, self.time_uncertainty),
            **dict(state),
        }


@dataclass(frozen=True, repr=False)
class Build(Printable):
    """A description of one integrator that an engine has compiled, or taken from the cache."""

    _omitted = ()  # engine and precision are its content

    engine: str  #: e.g. ``taylor``
    precision: str  #: e.g. ``double``
    friction: str
    variations: tuple[str, ...]
    divergence: bool
    events: tuple[str, ...]
    #: Elementary operations in the Taylor recurrences, the equations of motion not counted
    u_variables: int


@dataclass(frozen=True)
class ErrorEstimate:
    """The half-widths of all numbers of a run's result.

    They hold the error, rounding of the inputs included. They are infinite if the two runs compared
    did not end alike: then rounding decides the outcome.
    """

    state: Any  #: (3,) of the final state
    time: float  #: [s] of the final time; 0 unless an event ended the run
    samples: Any = None  #: (n, 3) of the samples
    events: tuple[float, ...] = ()  #: [s] of the time of each recorded event
    event_states: tuple[Any, ...] = ()  #: (3,) of the state of each recorded event
    derivatives: Any = None  #: of the derivatives, with their shape
    sample_derivatives: Any = None  #: of the derivatives at the samples, with their shape

    @property
    def largest(self) -> float:
        """The largest half-width of the final state's components."""
        return float(max(self.state))


class Result(NamedTuple):
    """The result of integrating a motion.

    Arrays are in the request's precision, and consist of objects if its numbers are MPFR's.
    """

    status: Status
    time: Any  #: the end of the run [s]
    state: Any  #: (3,) final (beta, gamma, v)
    steps: int
    samples: Any = None  #: (n, 3) states at the sample times that were reached
    dense: Callable[[Any], Any] | None = None  #: times (n,) -> states (n, 3)
    #: (3, number of variations) d(final state)/d(variations), at fixed final time
    derivatives: Any = None
    sample_derivatives: Any = None  #: (n, 3, number of variations), the same at the sample times
    divergence: Any = None  #: integral of d(v')/d(v) over the run [1]
    events: tuple[EventRecord, ...] = ()
    error: ErrorEstimate | None = None
    evaluations: int | None = None  #: of the right-hand side, if the method counts them
    built: tuple[Build, ...] = ()  #: the compiled integrators used
    series: Any = None  #: the steps' polynomials (`flow.stepper.DenseOutput`), if they are needed
    precision: Precision | None = None  #: the arithmetic of its numbers, if not the request's


class Engine(Protocol):
    """The interface of an engine, which integrates the motion that a request describes."""

    @property
    def name(self) -> str:
        """The name of the engine for reports, e.g. ``taylor`` or ``scipy-DOP853``."""

    @property
    def measures_error(self) -> bool:
        """True if the engine can give half-widths of its results, in every precision."""

    @property
    def builds(self) -> tuple[Build, ...]:
        """The integrators that the engine has compiled and keeps."""

    def __hash__(self) -> int:
        """Return a hash by identity, which distinguishes engines."""

    def __call__(self, request: Request) -> Result:
        """Integrate the motion that a request describes.

        Args:
            request: The run.

        Returns:
            The result; its status gives the reason for an early end.

        Raises:
            InputError: If this engine cannot serve the request.
        """


def raise_unless_usable(result: Result) -> Result:
    """Raise an error unless the run of a result ended as requested or at the end of the model's
    domain; return the result.

    Args:
        result: The result of a run.

    Raises:
        ArithmeticError: If the run ended otherwise; the message gives the time and the status.
    """
    if not result.status.usable:
        raise ArithmeticError(f"at t = {float(result.time):.6g} s {result.status.value}")
    return result


def _check_state(state: Sequence[object]) -> None:
    refuse_units_and_masks(state)
    try:
        count = len(state)
    except TypeError:  # a single number
        count = 1
    if count != 3:
        raise InputError("a state has three components: beta, gamma, v")


def _check_times(times: Any, precision: Precision, duration: float) -> None:
    """Raise InputError unless sample times are strictly monotonic, from 0 to the duration."""
    if not len(times):
        raise InputError("the list of sample times is empty: leave it out instead")
    try:
        # Above double, times that are equal as doubles may still differ.
        values = precision.as_array(times)
    except (TypeError, ValueError) as fault:
        raise InputError(f"sample times must be numbers: {fault}") from None
    if values.ndim != 1:
        raise InputError("sample times must be a list of numbers")
    ahead = values if duration >= 0 else -values
    if not (ahead[0] >= 0 and (ahead[1:] > ahead[:-1]).all() and float(ahead[-1]) <= abs(duration)):
        raise InputError(
            "sample times must be strictly monotonic, from the start on and up to the "
            "end of the run"
        )
