"""True solutions of the race's problems, and the numbers in which a run is compared with them.

A true solution is computed with 60 digits and compared with a run with 80, or in quadruple
precision and compared with a run with 42. Its inputs are doubles, taken exactly, so no method in
doubles is blamed for rounding them.

The error on a cycle
--------------------
Near a cycle a run drifts along the orbit, and at the end this error of phase hides all others. The
period, the crossing of the section and the amplitude are free of it. They are measured where the
true motion last crosses the section beta = pi/2 with v < 0, one return earlier, and where beta is
largest in between. An integrator is asked for its states at these moments only, as ends of runs, so
that no interpolation is measured.

Such a state lies a little before or after the crossing. The equations of motion take it there in a
time delta. Newton's method solves cos(beta(delta)) = 0, or v(delta) = 0 for the amplitude. Its
first step is the residual divided by its rate. Later ones follow the flow with the package's
integrator, in the arithmetic of the true solution. The true states are treated alike. Then

- the error of the period is the error of delta at the last crossing minus its error one return
  earlier;
- the error of the crossing is the larger one of gamma and v there;
- the error of the amplitude is that of beta where v = 0.

Over the time delta the true equations replace those that the integrator follows in effect. Let the
two differ by a relative eta. The integrator's own orbit crosses after delta (1 + O(eta)), so the
error of the period is known to a relative O(eta). Its size is eta times the period T, so it has two
digits if it is below 1 % of T. The state at the crossing moves by O(eta delta), and its error is
O(eta T). It is known to a relative O(delta / T). In tests with planted errors this was never more
than 2.3 delta / T, so the error has two digits if the phase is within 0.3 % of T. If delta is more
than half the spacing of the sample times, no error is reported for the run, and its status gives
the reason.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from typing import Any

from tippedisk_verify.bench.problems import ErrorKind, Problem
from tippedisk_verify.errors import InputError
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.contract import BETA_EXTREME, SECTION, Event, raise_unless_usable
from tippedisk_verify.model.equations import vector_field
from tippedisk_verify.numbers.exact import fraction
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.precision import QUADRUPLE, Precision, precision_of_bits

__all__ = ["Truth", "compared_numbers", "compute_truth", "cut_at_returns", "defines_error"]

_CROSSING = Event("crossing", SECTION.function, direction=1, terminal=False)  # v < 0
_LARGEST = Event("largest", BETA_EXTREME.function, direction=-1, terminal=False)
_INTERVALS = 20  # of a user's sample times in a run, about
_MAX_NEWTON_STEPS = 10  # two more digits, then four, ...: 60 digits take six


@dataclass(frozen=True)
class Truth:
    """The true states of a problem at its sample times, and the numbers that are compared."""

    samples: tuple[tuple[Measured, ...], ...]  #: (n, 3)
    numbers: tuple[Measured, ...]  #: of `compared_numbers` at the problem's stops
    uncertainty: float  #: the largest half-width
    precision: Precision  #: the arithmetic in which runs are compared with it


@lru_cache(maxsize=16)
def compute_truth(problem: Problem, accurate: bool = True) -> Truth:
    """Compute the true states of a problem at its sample times, with half-widths.

    Args:
        problem: The problem.
        accurate: True for about 55 digits, False for about 28.

    Raises:
        ArithmeticError: If an integration fails.
    """
    working = (
        (precision_of_bits(200), precision_of_bits(266))
        if accurate
        else (QUADRUPLE, precision_of_bits(140))
    )
    samples, numbers = [], []
    for precision in working:
        request = problem.request(precision=precision, times=precision.array(problem.times))
        states = raise_unless_usable(default_engine()(request)).samples
        samples.append([fraction(value) for state in states for value in state])
        numbers.append(
            compared_numbers(problem, [states[stop] for stop in problem.stops], precision)
        )
    cells, compared = (
        [Measured.compared(a, b, working[0].epsilon) for a, b in zip(coarse, wider, strict=True)]
        for coarse, wider in (samples, numbers)
    )
    judged = cells if problem.error == "state" else compared
    return Truth(
        samples=tuple(tuple(cells[n : n + 3]) for n in range(0, len(cells), 3)),
        numbers=tuple(compared),
        uncertainty=float(max(number.uncertainty for number in judged)),
        precision=working[0],
    )


def cut_at_returns(problem: Problem, error: ErrorKind) -> Problem:
    """Return a problem that ends where an error on a cycle is measured.

    The sample times divide a return to the section evenly, so that a method of fixed steps takes
    the same steps in each of its runs.

    Args:
        problem: The problem. A start on the section with v < 0 is a crossing.
        error: The error. For ``"state"`` the problem stays as it is.

    Raises:
        InputError: If the motion does not return to the section.
    """
    if error == "state":
        return problem
    result = raise_unless_usable(default_engine()(problem.request(events=(_CROSSING, _LARGEST))))
    moments = {
        event.name: [float(record.time) for record in result.events if record.name == event.name]
        for event in (_CROSSING, _LARGEST)
    }
    beta, _, v = problem.start
    at_start = [0.0] if abs(math.cos(beta)) < math.ulp(1.0) and v < 0 else []
    crossings = [*at_start, *moments[_CROSSING.name]]
    if len(crossings) < 2:
        raise InputError(
            f"{problem.name} has no error of {error}: its motion does not return to beta = pi/2"
        )
    first, end = crossings[-2:]
    period = end - first
    if error == "amplitude":
        end = max(moment for moment in moments[_LARGEST.name] if moment < end)
    # In at least two, so that Newton's method cannot end at the crossing with v > 0.
    parts = max(2, round(_INTERVALS * period / end))
    return replace(
        problem,
        error=error,
        duration=end,
        stops=(-1 - parts, -1) if error == "period" and first else (-1,),
        spacing=period / parts,
    )


def defines_error(problem: Problem, error: ErrorKind) -> bool:
    """Return True if `cut_at_returns` gives the problem for an error of this kind."""
    with suppress(InputError):
        cut_at_returns(problem, error)
        return True
    return False


def compared_numbers(
    problem: Problem, states: Sequence[Any], precision: Precision
) -> list[Fraction]:
    """Return the numbers of a run that are compared with the true ones.

    Args:
        problem: The problem, which names the error.
        states: (n, 3) the states at the problem's stops, in any arithmetic.
        precision: The arithmetic of the corrections along the flow.

    Returns:
        All components of the states [rad, rad/s]; the time of return minus the time between the
        stops [s]; gamma [rad] and v [rad/s] at the section; or the largest beta [rad].

    Raises:
        ArithmeticError: If an orbit's phase is off by more than half the spacing of the times.
    """
    if problem.error == "state":
        return [fraction(value) for state in states for value in state]
    passages = [_section_crossing(problem, state, precision) for state in states]
    if problem.error == "period":
        shifts = [shift for shift, _ in passages]
        return [fraction(shifts[-1]) - (fraction(shifts[0]) if len(shifts) > 1 else 0)]
    beta, gamma, v = map(fraction, passages[-1][1])
    return [beta] if problem.error == "amplitude" else [gamma, v]


def _section_crossing(
    problem: Problem, state: Iterable[Any], precision: Precision
) -> tuple[Any, Any]:
    """Return the time [s] by which a state precedes the section, or v = 0, and the state there."""
    ops, place, shift = precision.ops, precision.array(list(state)), precision.number(0)
    omega = precision.number(problem.omega)
    rates = vector_field(ops, problem.parameters.constants_in(precision), omega, problem.friction)
    request = problem.request(precision=precision)
    for _ in range(_MAX_NEWTON_STEPS):
        beta, _, v = place
        slopes = precision.array(rates(*place))
        largest = problem.error == "amplitude"
        step = -v / slopes[2] if largest else ops.cos(beta) / (ops.sin(beta) * v)
        shift = shift + step
        if not abs(shift) < (problem.spacing or 0.0) / 2:
            break
        if float(step) ** 2 < precision.epsilon:  # then a straight line is exact
            return shift, place + step * slopes
        run = default_engine()(replace(request, state=place, duration=step))
        place = raise_unless_usable(run).state
    raise ArithmeticError("the phase is more than half a sample interval off")
