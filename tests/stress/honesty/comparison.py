"""One claimed number beside the truth."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from tests.stress.honesty.arithmetics import Arithmetic
from tippedisk_verify.model.exact import fraction
from tippedisk_verify.model.measured import Measured

__all__ = ["Asked", "Number", "of_double", "printed", "unlike"]


@dataclass(frozen=True)
class Number:
    """A number's claimed half-width and its true distance from the truth.

    ``ratio`` is the over-estimate, claimed over true. An error that is smaller by chance than half of what the number's
    own notation can tell apart (half a unit in the last place of its arithmetic, or of its decimals if these are
    coarser) counts as that half, so that an exact hit is not an infinite over-estimate.
    """

    name: str
    claimed: float  #: half-width, in the number's unit
    distance: float  #: from the truth, in the same unit
    ratio: float  #: claimed over distance [1]
    holds: bool


@dataclass(frozen=True)
class Asked:
    """A question in words, what answers it in an arithmetic, and what compares an answer with the truth.

    The truth is found once for all arithmetics, in twice the digits of a double or more, and in ``beyond`` bits more
    where it is asked for again. Both functions may raise any refusal.
    """

    text: str
    answer: Callable[[Arithmetic], Any]
    compared: Callable[[Any, int], list[Number]]

    @classmethod
    def closed(cls, text: str, numbers: Callable[[], list[Number]]) -> Asked:
        """What needs no integrator, and so no arithmetic but its own."""
        return cls(text, lambda arithmetic: None, lambda answer, beyond: numbers())


def printed(name: str, claim: Measured, truth: Measured | Fraction, working_bits: int | None = None) -> Number:
    """A number as its decimals are printed; ``working_bits`` is the arithmetic that it was computed in, if known.

    Raises ArithmeticError if the truth itself is not known to a hundredth of the claim.
    """
    value, width = map(Fraction, claim.decimals())
    known = truth if isinstance(truth, Measured) else Measured(truth, Fraction(0))
    if 100 * known.uncertainty > width:
        raise ArithmeticError(f"the truth of {name} is known to {float(known.uncertainty):.1e} only")
    last_digit = Fraction(0)
    if claim.uncertainty and working_bits is None:
        text = claim.decimals()[0].lower().partition("e")
        last_digit = Fraction(10) ** (int(text[2] or 0) - len(text[0].partition(".")[2]))
    ulp = abs(value) / 2 ** (working_bits - 1) if working_bits else last_digit
    return _number(name, width, abs(value - known.value), ulp)


def of_double(name: str, value: float, width: float, truth: object) -> Number:
    """A number that is handed out as a double, with its half-width."""
    exact = Fraction(value)
    return _number(name, Fraction(width), abs(exact - fraction(truth)), abs(exact) / 2**52)


def unlike(name: str) -> Number:
    """What is claimed is of another kind than the truth: another event, another stability, no such thing."""
    return Number(name, 0.0, math.inf, 0.0, False)


def _number(name: str, width: Fraction, away: Fraction, ulp: Fraction) -> Number:
    counted = max(away, ulp / 2)
    ratio = float(width / counted) if counted else 1.0
    return Number(name, float(width), float(away), ratio, away <= width)
