"""What a case of the battery is: something hard to compute, the outcome it must have, and how that is seen."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from tippedisk_verify.errors import AccuracyError, InputError, NoSuchCycleError
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.contract import Engine, Request, Result, Status
from tippedisk_verify.model.exact import fraction
from tippedisk_verify.model.precision import Precision, bits

__all__ = ["Found", "StressCase", "StressResult", "against", "cycle_digits", "digits_between", "flown", "refused"]

_TRUTH = bits(200)
_MOST_DIGITS = 16.0  # what is closer than this is not told apart in doubles


@dataclass(frozen=True)
class Found:
    """What a case came to."""

    outcome: str  #: "digits", or the status or kind of error that was named
    digits: float | None = None  #: correct ones, of the worst number; None where the outcome is no number
    honest: bool = True  #: every claimed half-width held the distance to the higher precision
    note: str = ""


@dataclass(frozen=True)
class StressCase:
    """One of the battery. The outcome must be one of ``may``; where it is digits, at least ``least`` of them."""

    name: str
    says: str
    run: Callable[[], Found]
    least: float = 0.0
    may: tuple[str, ...] = ("digits",)
    quick: bool = True  #: some seconds at most

    def expected(self) -> str:
        texts = [f"{self.least:g} digits or more" if name == "digits" else name for name in self.may]
        return " or ".join(texts)


@dataclass(frozen=True)
class StressResult:
    """A case with what was found."""

    name: str
    says: str
    expected: str
    outcome: str
    digits: float | None
    error: float | None  #: relative, of the worst number
    honest: bool
    passed: bool
    note: str
    seconds: float

    @classmethod
    def of(cls, case: StressCase) -> StressResult:
        """Run it. What no case may do, raise something unforeseen, is an outcome too: it never passes."""
        begin = time.perf_counter()
        try:
            answer = case.run()
        except (InputError, NoSuchCycleError, AccuracyError) as said:
            answer = Found(type(said).__name__, note=str(said))
        except Exception as fault:  # the battery reports it; nothing is hidden
            answer = Found(f"unforeseen {type(fault).__name__}", honest=False, note=str(fault)[:200])
        enough = answer.outcome != "digits" or (answer.digits is not None and answer.digits >= case.least)
        return cls(
            name=case.name,
            says=case.says,
            expected=case.expected(),
            outcome=answer.outcome,
            digits=answer.digits,
            error=None if answer.digits is None else 10.0**-answer.digits,
            honest=answer.honest,
            passed=answer.honest and enough and answer.outcome in case.may,
            note=answer.note,
            seconds=time.perf_counter() - begin,
        )


def digits_between(value: Any, truth: Any, scale: Any = None) -> float:
    """Agreed digits, relative to ``scale`` or the truth; at most 16."""
    away = abs(fraction(value) - fraction(truth))
    size = abs(fraction(truth)) if scale is None else abs(fraction(scale))
    if not away:
        return _MOST_DIGITS
    if not size:
        return 0.0
    return max(0.0, min(_MOST_DIGITS, -_log10(away / size)))


def _log10(ratio: Fraction) -> float:
    """Also of what no double holds."""
    top, bottom = ratio.numerator, ratio.denominator
    return (math.log2(top) - math.log2(bottom)) / math.log2(10)


def flown(request: Request, truth: Precision = _TRUTH, engine: Engine | None = None) -> Found:
    """A run in double with its error estimate, against one in many more bits.

    Digits are of the largest component's size, the angles' scale being 1 rad. Where the estimate says that the digits
    are gone, or that rounding decides the end, that is the outcome, and honest unless the status is wrong.
    """
    engine = engine or default_engine()
    mine = engine(replace(request, error_estimate=True))
    sharp = engine(replace(request, precision=truth, tolerance=None))
    assert mine.error is not None
    if not math.isfinite(mine.error.largest):
        return Found("rounding decides", note=mine.status.value)
    if mine.status is not sharp.status:
        return Found(mine.status.name, honest=False, note=f"in more bits: {sharp.status.value}")
    if not mine.status.usable:
        return Found(mine.status.name, note=mine.status.value)
    return against(mine, sharp)


def against(mine: Result, sharp: Result) -> Found:
    """The claimed half-widths of a result against the same in more bits."""
    error = mine.error
    assert error is not None
    pairs = list(zip(mine.state, sharp.state, error.state, strict=True))
    if mine.samples is not None:
        for rows in zip(mine.samples, sharp.samples, error.samples, strict=True):
            pairs += list(zip(*rows, strict=True))
    scale = max(1.0, *(abs(float(part)) for part in sharp.state))
    honest = all(abs(fraction(a) - fraction(b)) <= fraction(float(width)) for a, b, width in pairs)
    times = [(mine.time, sharp.time, error.time)] if mine.status is not Status.REACHED else []
    times += [(a.time, b.time, w) for a, b, w in zip(mine.events, sharp.events, error.events, strict=True)]
    honest &= all(abs(fraction(a) - fraction(b)) <= fraction(float(width)) for a, b, width in times)
    digits = min(digits_between(a, b, scale) for a, b, _ in pairs)
    claimed = max(float(width) for *_, width in pairs) / scale
    if claimed > 0.1:  # not one decimal digit is sure
        return Found("no digits left", honest=honest, note=f"claimed error {claimed:.1e} of the state's size")
    return Found("digits", digits, honest, f"claimed error {claimed:.1e}; ended: {mine.status.name}")


def cycle_digits(mine: Any, sharp: Any, names: Sequence[str]) -> Found:
    """Measured numbers of two results of the same kind: honest if each pair's half-widths overlap."""
    digits, honest = _MOST_DIGITS, True
    for name in names:
        a, b = getattr(mine, name), getattr(sharp, name)
        honest &= abs(a.value - b.value) <= a.uncertainty + b.uncertainty
        digits = min(digits, digits_between(a.value, b.value))
    return Found("digits", digits, honest)


def refused(action: Callable[[], Any], *kinds: type[Exception]) -> Found:
    """What must be refused with one clear line."""
    try:
        action()
    except kinds as said:
        text = str(said)
        return Found(type(said).__name__, honest=0 < len(text) < 300, note=text)
    return Found("not refused", honest=False)
