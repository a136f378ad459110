"""Which single slip in a level's formulas gives the wrong answers."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from decimal import Decimal
from functools import partial

from tippedisk_verify.conformance.grading import needed, scale_of
from tippedisk_verify.conformance.shapes import Found, borne_out
from tippedisk_verify.conformance.slips import Slip, Written
from tippedisk_verify.conformance.written import Formula, formulas_of
from tippedisk_verify.reference_values.store import Quantity

__all__ = ["slip_of"]

_LEAST_DIGITS = 3.0  # that a question must need before its answer speaks for a slip
#: Digits of all wrong answers together: of some ten thousand slips one in a hundred thousand levels fits by chance.
_EVIDENCE = 9.0
_MOST = 3  # slips that give the same answers and are named
_BESIDE = 1.1  # times; how much the scales of an answer and of what is expected may differ where they agree
_STEPS = 250  # slips between two words to the progress bar


def slip_of(
    entries: Sequence[Sequence[Quantity]],
    answers: Mapping[str, Decimal],
    wrong: set[str],
    advance: Callable[[str, int], None],
) -> Found | None:
    """The simplest slips that explain all answers to these entries, those with wrong answers first; or None."""
    told = [[quantity for quantity in here if needed(quantity) >= _LEAST_DIGITS] for here in entries]
    told = [here for here in told if here]
    blamed = {quantity.id for here in told for quantity in here if quantity.id in wrong}
    bad = [quantity for here in told for quantity in here if quantity.id in blamed]
    if not bad or sum(map(needed, bad)) < _EVIDENCE:
        return None
    told.sort(key=lambda here: blamed.isdisjoint(quantity.id for quantity in here))
    limits = {quantity.id: _limits(answers[quantity.id], quantity) for here in told for quantity in here}
    friction = next((here[0].friction for here in told if here[0].friction != "both"), "both")
    found: list[tuple[int, str]] = []
    for formula in formulas_of(bad[0].kind, friction):
        if not any(quantity.name.startswith(formula.gives) for quantity in bad):
            continue
        for slip, written in _drawn(formula, advance, bad[0].level):
            if _fits(formula, partial(written.run, slip=slip), told, answers, blamed, limits):
                found.append((slip.rank, slip.says()))
        if found:
            break
    best = min((rank for rank, _ in found), default=0)
    texts = list(dict.fromkeys(text for rank, text in found if rank == best))[:_MOST]
    return (tuple(("slip", text) for text in texts), frozenset(blamed)) if texts else None


def _drawn(formula: Formula, advance: Callable[[str, int], None], level: int) -> Iterator[tuple[Slip, Written]]:
    written = Written(formula.source, formula.groups)
    for n, slip in enumerate(written.slips()):
        if n % _STEPS == 0:
            advance(f"level {level}: slips in its formulas", 1)
        yield slip, written


def _limits(answer: Decimal, quantity: Quantity) -> tuple[float, float]:
    """Between which numbers what is expected has to lie."""
    size = max(scale_of(quantity, answer), scale_of(quantity, Decimal(quantity.for_doubles)))
    width = _BESIDE * float(size) * 10 ** -needed(quantity)
    return float(answer) - width, float(answer) + width


def _fits(
    formula: Formula,
    run: Callable[..., dict[str, object]],
    entries: Sequence[Sequence[Quantity]],
    answers: Mapping[str, Decimal],
    blamed: set[str],
    limits: Mapping[str, tuple[float, float]],
) -> bool:
    explained: set[str] = set()
    for here in entries:
        asked = {quantity.name: quantity for quantity in here}
        try:
            with warnings.catch_warnings(action="ignore"):  # what the slip makes of a formula
                for numbers in formula.answers(run, here):
                    for name, number in numbers.items():
                        if (quantity := asked.get(name)) is None:
                            continue
                        low, high = limits[quantity.id]
                        if not low <= number <= high:
                            return False
                        if borne_out(answers[quantity.id], number, quantity, quantity.id in blamed) is None:
                            return False
                        if quantity.id in blamed:
                            explained.add(quantity.id)
        except (ArithmeticError, ValueError, TypeError, LookupError, NameError, AttributeError):
            return False  # the slip leaves no formula, or none that has a value
    return explained == blamed
