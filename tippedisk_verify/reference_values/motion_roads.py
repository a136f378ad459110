"""Roads to the six scenes' trajectories, sampled and with their crossings of the section."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from tippedisk_verify.errors import Shortfall
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.baseline import Baseline
from tippedisk_verify.flow.contract import SECTION, Engine, Event, Request, Result, Status
from tippedisk_verify.model.exact import PI, exact, fraction
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.precision import DOUBLE, Precision, bits
from tippedisk_verify.reference_values.entries import Case, Method, Values
from tippedisk_verify.reference_values.local_roads import by_differences

__all__ = ["TRAJECTORY", "trajectory_condition", "trajectory_unit"]

_DURATION = 10
_TIMES = tuple(Fraction(n, 2) for n in range(1, 2 * _DURATION + 1))
_CROSSING = Event("crossing", SECTION.function, terminal=False)
_QUARTER = PI * Fraction(1, 2)
# 51 digits, of which a passage or two takes four; and 64 bits more to see the error.
_BITS = 170
_WIDER = 234
_SHIFTED = 202
_NAMES = ("beta", "gamma", "v")
# The starts lie on the section, up to rounding, half of them with v = 0: a crossing before this time [s] is the start
# itself, also when the start is moved by 1e-7 to see what that does.
_START = 0.01


def trajectory_unit(quantity: str) -> str:
    return {"v": "rad/s", "crossing_v": "rad/s", "crossing_time": "s", "flat_time": "s"}.get(
        quantity.split("@")[0].split("#")[0], "rad"
    )


def _run(
    case: Case, precision: Precision, engine: Engine, *, shift: bool = False, tolerance: float | None = None
) -> dict[str, Any]:
    start: list[Any] = [case.inputs[name] for name in _NAMES]
    if shift:
        start[:2] = [exact(angle) - _QUARTER for angle in start[:2]]
    request = Request(
        case.parameters, case.inputs["Omega"], start, _DURATION, shifted=shift, precision=precision,
        tolerance=tolerance, times=[precision.number(time) for time in _TIMES], events=(_CROSSING,),
    )  # fmt: skip
    result = engine(request)
    if result.status not in (Status.REACHED, Status.FLAT):
        raise Shortfall(f"{case.item.id}: {result.status.value}")
    return _numbers(result, precision, shift)


def _numbers(result: Result, precision: Precision, shift: bool) -> dict[str, Any]:
    quarter = precision.number(_QUARTER) if shift else precision.number(0)
    numbers: dict[str, Any] = {}
    for time, state in zip(_TIMES, result.samples, strict=False):
        place = f"{float(time):g}"
        numbers |= {f"beta@{place}": state[0] + quarter, f"gamma@{place}": state[1] + quarter, f"v@{place}": state[2]}
    crossings = [record for record in result.events if record.name == _CROSSING.name and record.time > _START]
    for n, record in enumerate(crossings, start=1):
        numbers |= {
            f"crossing_time#{n}": record.time,
            f"crossing_gamma#{n}": record.state[1] + quarter,
            f"crossing_v#{n}": record.state[2],
        }
    if result.status is Status.FLAT:
        numbers["flat_time"] = result.time
    return numbers


def _first(case: Case, known: Values) -> Values:
    rough, sharp = (_run(case, bits(working), default_engine()) for working in (_BITS, _WIDER))
    if rough.keys() != sharp.keys():
        raise Shortfall(f"{case.item.id}: two precisions see different crossings")
    return {name: Measured.compared(value, sharp[name], bits(_BITS).epsilon) for name, value in rough.items()}


def _shifted(case: Case, known: Values) -> Values:
    """Its own error, with 32 bits more, is far below the half-widths that it is held against."""
    numbers = _run(case, bits(_SHIFTED), default_engine(), shift=True)
    return {name: Measured(fraction(value), known[name].uncertainty) for name, value in numbers.items()}


def _scipy(case: Case, known: Values) -> Values:
    """What a hundredfold looser tolerance changes bounds the error."""
    tight, loose = (_run(case, DOUBLE, Baseline("DOP853"), tolerance=tolerance) for tolerance in (1e-13, 1e-11))
    return {
        name: Measured.of(value, 2 * abs(value - loose[name]) + 1e-11 * max(1.0, abs(value)))
        for name, value in tight.items()
        if name in loose
    }


TRAJECTORY = (
    Method("taylor", "heyoka's Taylor integrator on MPFR numbers of 51 digits, error seen against 70", _first),
    Method("shifted", "the same integrator on angles measured from pi/2, 60 digits", _shifted),
    Method("scipy", "SciPy's DOP853 in double; confirms what double holds", _scipy, True),
)
# 1e-7 of a parameter moves an orbit by some 1e-4 after the passages, and rounding by 1e-9 of that change.
trajectory_condition = by_differences(lambda case: _run(case, DOUBLE, default_engine()), Fraction(1, 10**7))
