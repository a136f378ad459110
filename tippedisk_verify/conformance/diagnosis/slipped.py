"""Which single slip in a level's formulas gives the wrong answers."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from decimal import Decimal
from functools import partial
from typing import Any

from tippedisk_verify.conformance.diagnosis.shapes import Found, borne_out
from tippedisk_verify.conformance.diagnosis.slips import Names, Slip, Written
from tippedisk_verify.conformance.diagnosis.written import MEANINGS, Formula
from tippedisk_verify.conformance.diagnosis.written_theory import formulas_of
from tippedisk_verify.conformance.grading import needed, scale_of
from tippedisk_verify.reference_values.store import Quantity

__all__ = ["borne_out_by", "limits_of", "simplest", "slip_of", "told_by", "with_meanings"]

_LEAST_DIGITS = 3.0  # that a question must need before its answer speaks for a slip
#: Digits of all wrong answers together: of some ten thousand slips one in a hundred thousand levels fits by chance.
_EVIDENCE = 9.0
_MOST = 3  # slips that give the same answers and are named
_BESIDE = 1.1  # times; how much the scales of an answer and of what is expected may differ where they agree
_CLOSE = 2.0  # digits between slips that fit about as well
_STEPS = 250  # slips between two words to the progress bar


def slip_of(
    entries: Sequence[Sequence[Quantity]],
    answers: Mapping[str, Decimal],
    wrong: set[str],
    advance: Callable[[str, int], None],
) -> Found | None:
    """The simplest slips that explain all answers to these entries, those with wrong answers first; or None."""
    told, blamed = told_by(entries, wrong)
    bad = [quantity for here in told for quantity in here if quantity.id in blamed]
    if not bad:
        return None
    limits = limits_of(told, answers)
    friction = next((here[0].friction for here in told if here[0].friction != "both"), "both")
    fits: list[tuple[float, int, int, str]] = []  # digits, rank, statement, words
    given: set[str] = set()
    for formula in formulas_of(bad[0].kind, friction):
        given = {quantity.id for quantity in bad if quantity.name.startswith(formula.gives)}
        if not (given if formula.alone else given == blamed):
            continue
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what a slip makes of a formula
            for slip, written in _drawn(formula, advance, bad[0].level):
                run = partial(written.run, slip=slip)
                if (digits := borne_out_by(formula, run, told, answers, limits, given)) is not None:
                    text = with_meanings(slip.says())
                    if formula.alone:  # one number alone does not tell which of several slips gives it
                        mine = next(quantity for quantity in bad if quantity.id in given)
                        share = float(answers[mine.id]) / mine.for_doubles
                        text = f"{mine.name} is {share:.9g} times what it should be, as by this slip: {text}"
                    fits.append((digits, slip.rank, slip.place, text))
            written = Written(formula.source, formula.groups)
            for text, instead in formula.others():
                run = partial(_instead, written, instead)
                if (digits := borne_out_by(formula, run, told, answers, limits, given)) is not None:
                    fits.append((digits, 0, -1, text))
        if fits:
            break
    texts = simplest(fits)
    return (tuple(("slip", text) for text in texts), frozenset(given)) if texts else None


def told_by(entries: Sequence[Sequence[Quantity]], wrong: set[str]) -> tuple[list[list[Quantity]], set[str]]:
    """The questions whose answers say something, entries with wrong ones first, and the wrong ones among them."""
    told = [[quantity for quantity in here if needed(quantity) >= _LEAST_DIGITS] for here in entries]
    told = [here for here in told if here]
    told.sort(key=lambda here: wrong.isdisjoint(quantity.id for quantity in here))
    return told, {quantity.id for here in told for quantity in here if quantity.id in wrong}


def limits_of(entries: Sequence[Sequence[Quantity]], answers: Mapping[str, Decimal]) -> dict[str, tuple[float, float]]:
    return {quantity.id: _limits(answers[quantity.id], quantity) for here in entries for quantity in here}


def simplest(fits: Sequence[tuple[float, int, int, str]]) -> list[str]:
    """Those that fit about as well as the best, are as simple as the simplest, and differ: one in each statement."""
    best = max((digits for digits, *_ in fits), default=0.0)
    close = [(rank, place, text) for digits, rank, place, text in fits if digits > best - _CLOSE]
    least = min((rank for rank, *_ in close), default=0)
    alike = [(place, text) for rank, place, text in close if rank == least]
    first = dict(reversed(alike))
    # Names and numbers that stand for each other in one statement are different mistakes, and so are terms that are
    # missing; signs and factors are not.
    others = [text for _, text in alike if least or "is missing in" in text]
    return list(dict.fromkeys([*reversed(first.values()), *others]))[:_MOST]


def with_meanings(text: str) -> str:
    functions = re.findall(r"\b(?:down|up)\b(?!\()", text)  # these words of a sentence are no names
    names = [name for name in dict.fromkeys(re.findall(r"\w+", text)) if name in MEANINGS and name not in functions]
    known = [f"{name}: {MEANINGS[name]}" for name in names]
    return f"{text} ({'; '.join(known)})" if known else text


def _drawn(formula: Formula, advance: Callable[[str, int], None], level: int) -> Iterator[tuple[Slip, Written]]:
    written = Written(formula.source, formula.groups)
    for n, slip in enumerate(written.slips(formula.only)):
        if n % _STEPS == 0:
            advance(f"level {level}: slips in its formulas", 1)
        yield slip, written


def _instead(written: Written, instead: Callable[[Mapping[str, Any]], Names], names: Mapping[str, Any]) -> Names:
    return written.run(instead(names))


def _limits(answer: Decimal, quantity: Quantity) -> tuple[float, float]:
    """Between which numbers what is expected has to lie."""
    size = max(scale_of(quantity, answer), scale_of(quantity, Decimal(quantity.for_doubles)))
    width = _BESIDE * float(size) * 10 ** -needed(quantity)
    return float(answer) - width, float(answer) + width


def _expected(
    formula: Formula,
    run: Callable[..., dict[str, object]],
    entries: Sequence[Sequence[Quantity]],
    limits: Mapping[str, tuple[float, float]],
) -> dict[str, float]:
    """What the slip makes of all answers by id; nothing as soon as one is out of its limits."""
    expected: dict[str, float] = {}
    try:
        for here in entries:
            asked = {quantity.name: quantity.id for quantity in here}
            for numbers in formula.answers(run, here):
                for name, number in numbers.items():
                    if (id_ := asked.get(name)) is not None:
                        low, high = limits[id_]
                        either = number if isinstance(number, tuple) else (number,)
                        if not (near := [one for one in either if low <= one <= high]):
                            return {}
                        expected[id_] = near[0]
    except (ArithmeticError, ValueError, TypeError, LookupError, NameError, AttributeError):
        return {}  # the slip leaves no formula, or none that has a value
    return expected


def borne_out_by(
    formula: Formula,
    run: Callable[..., dict[str, object]],
    entries: Sequence[Sequence[Quantity]],
    answers: Mapping[str, Decimal],
    limits: Mapping[str, tuple[float, float]],
    blamed: set[str],
) -> float | None:
    """The least digits of the wrong answers, if every answer is as expected, and they by too many for a chance."""
    expected, found = _expected(formula, run, entries, limits), []
    if not blamed <= expected.keys():
        return None
    for quantity in (quantity for here in entries for quantity in here if quantity.id in expected):
        digits = borne_out(answers[quantity.id], expected[quantity.id], quantity, quantity.id in blamed)
        if digits is None:
            return None
        if quantity.id in blamed:
            found.append(digits)
    return min(found) if sum(found) >= _EVIDENCE else None
