"""A case of the battery: a hard computation and the outcome that is required."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from tippedisk_verify.errors import AccuracyError, InputError, NoSuchCycleError
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.contract import Engine, Request, Result, Status
from tippedisk_verify.numbers.decimals import decimal_logarithm
from tippedisk_verify.numbers.exact import fraction
from tippedisk_verify.numbers.precision import Precision, precision_of_bits

__all__ = [
    "TRUTH_PRECISION",
    "CaseOutcome",
    "StressCase",
    "StressResult",
    "check_refusal",
    "compare_flight",
    "compare_numbers",
    "compare_results",
    "double_digits_between",
]

TRUTH_PRECISION = precision_of_bits(200)  #: 60 digits, the precision of the true solution
_MAX_DIGITS = 16.0  # closer values cannot be distinguished in doubles


@dataclass(frozen=True)
class CaseOutcome:
    """The outcome of running a stress case: correct digits, a status, or an error."""

    outcome: str  #: "digits", or the name of the status or error
    digits: float | None = None  #: correct digits of the worst number; None without a number
    honest: bool = True  #: True if no claimed half-width is smaller than the true error
    note: str = ""


@dataclass(frozen=True)
class StressCase:
    """A stress test: a computation under hard conditions, and the outcomes that pass."""

    name: str
    description: str  #: what is hard about it
    run: Callable[[], CaseOutcome]
    required_digits: float = 0.0  #: correct digits that are required if the outcome is "digits"
    passing_outcomes: tuple[str, ...] = ("digits",)  #: the outcomes that pass
    quick: bool = True  #: False if it takes more than some seconds

    def expected(self) -> str:
        """Return the outcome that a stress case must have, in words."""
        return " or ".join(
            [
                f"{self.required_digits:g} digits or more" if name == "digits" else name
                for name in self.passing_outcomes
            ]
        )


@dataclass(frozen=True)
class StressResult:
    """The result of running a stress case: its outcome and the verdict on it."""

    name: str
    description: str
    expected: str
    outcome: str
    digits: float | None
    error: float | None  #: relative, of the worst number
    honest: bool
    passed: bool
    note: str
    seconds: float

    def to_dict(self) -> dict[str, Any]:
        """Return the result as data for JSON."""
        entry = asdict(self)
        return {"says" if key == "description" else key: value for key, value in entry.items()}

    @classmethod
    def from_case(cls, case: StressCase) -> StressResult:
        """Run a stress case and return its result.

        An unexpected exception is an outcome too, one that never passes.
        """
        begin = time.perf_counter()
        try:
            answer = case.run()
        except (InputError, NoSuchCycleError, AccuracyError) as refusal:
            answer = CaseOutcome(type(refusal).__name__, note=str(refusal))
        except Exception as fault:  # the battery reports it
            answer = CaseOutcome(
                f"unforeseen {type(fault).__name__}", honest=False, note=str(fault)[:200]
            )
        enough = answer.outcome != "digits" or (
            answer.digits is not None and answer.digits >= case.required_digits
        )
        return cls(
            name=case.name,
            description=case.description,
            expected=case.expected(),
            outcome=answer.outcome,
            digits=answer.digits,
            error=None if answer.digits is None else 10.0**-answer.digits,
            honest=answer.honest,
            passed=answer.honest and enough and answer.outcome in case.passing_outcomes,
            note=answer.note,
            seconds=time.perf_counter() - begin,
        )


def double_digits_between(value: Any, truth: Any, scale: Any = None) -> float:
    """Return the number of digits in which two values agree, at most 16.

    Args:
        value: The value.
        truth: The true value.
        scale: The size to which the error is relative; None for that of the true value.
    """
    away = abs(fraction(value) - fraction(truth))
    size = abs(fraction(truth)) if scale is None else abs(fraction(scale))
    if not away:
        return _MAX_DIGITS
    if not size:
        return 0.0
    return max(0.0, min(_MAX_DIGITS, -decimal_logarithm(away / size)))


def compare_flight(
    request: Request, truth: Precision = TRUTH_PRECISION, engine: Engine | None = None
) -> CaseOutcome:
    """Run an integration in double precision and in a higher precision, and compare. Return the
    outcome: the correct digits, and if the half-widths are honest.

    Digits are relative to the largest component, or to 1 if that is larger. If the estimate is
    infinite or leaves no digit, this is the outcome, which is honest unless the status is wrong.

    Args:
        request: The run.
        truth: The higher precision.
        engine: The engine; None for the default.
    """
    engine = engine or default_engine()
    result = engine(replace(request, error_estimate=True))
    reference = engine(replace(request, precision=truth, tolerance=None))
    assert result.error is not None
    if not math.isfinite(result.error.largest):
        return CaseOutcome("rounding decides", note=result.status.value)
    if result.status is not reference.status:
        return CaseOutcome(
            result.status.name, honest=False, note=f"in more bits: {reference.status.value}"
        )
    if not result.status.usable:
        return CaseOutcome(result.status.name, note=result.status.value)
    return compare_results(result, reference)


def compare_results(result: Result, reference: Result) -> CaseOutcome:
    """Compare a result and its half-widths with the same run in higher precision, and return the
    outcome.
    """
    error = result.error
    assert error is not None
    pairs = list(zip(result.state, reference.state, error.state, strict=True))
    if result.samples is not None:
        for rows in zip(result.samples, reference.samples, error.samples, strict=True):
            pairs += list(zip(*rows, strict=True))
    scale = max(1.0, *(abs(float(part)) for part in reference.state))
    times = (
        [(result.time, reference.time, error.time)] if result.status is not Status.REACHED else []
    )
    times += [
        (a.time, b.time, w)
        for a, b, w in zip(result.events, reference.events, error.events, strict=True)
    ]
    honest = all(
        abs(fraction(a) - fraction(b)) <= fraction(float(width)) for a, b, width in pairs + times
    )
    digits = min(double_digits_between(a, b, scale) for a, b, _ in pairs)
    claimed = max(float(width) for *_, width in pairs) / scale
    if claimed > 0.1:  # not one decimal digit is certain
        return CaseOutcome(
            "no digits left", honest=honest, note=f"claimed error {claimed:.1e} of the state's size"
        )
    return CaseOutcome(
        "digits", digits, honest, f"claimed error {claimed:.1e}; ended: {result.status.name}"
    )


def compare_numbers(result: Any, reference: Any, names: Sequence[str]) -> CaseOutcome:
    """Compare the numbers of two results, and return the outcome: the digits in which they agree.

    It is honest if the intervals of each pair overlap.

    Args:
        result: The result to judge.
        reference: The same in higher precision.
        names: The attributes to compare.
    """
    digits, honest = _MAX_DIGITS, True
    for name in names:
        a, b = getattr(result, name), getattr(reference, name)
        honest &= (a - b).holds(0)
        digits = min(digits, double_digits_between(a.value, b.value))
    return CaseOutcome("digits", digits, honest)


def check_refusal(action: Callable[[], Any], *kinds: type[Exception]) -> CaseOutcome:
    """Check that an action is refused with one clear line, and return the outcome.

    Args:
        action: The action.
        *kinds: The exceptions that count as a refusal.
    """
    try:
        action()
    except kinds as refusal:
        text = str(refusal)
        return CaseOutcome(type(refusal).__name__, honest=0 < len(text) < 300, note=text)
    return CaseOutcome("not refused", honest=False)
