"""Which term of the formulas of levels 3 and 4 has an extra factor, solved for from one wrong answer."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from decimal import Decimal
from functools import partial

from tippedisk_verify.conformance.diagnosis.factors import LONG, critical_speed, model_values, said_factor
from tippedisk_verify.conformance.diagnosis.shapes import Found
from tippedisk_verify.conformance.diagnosis.slipped import borne_out_by, limits_of, told_by
from tippedisk_verify.conformance.diagnosis.slips import Names, Slip, Written
from tippedisk_verify.conformance.diagnosis.written import Formula
from tippedisk_verify.conformance.diagnosis.written_theory import formulas_of
from tippedisk_verify.reference_values.store import Quantity

__all__ = ["factor_of"]

_LOST = 1e-10  # relative: an answer that a factor of two moves by less tells none
_STARTS = (2.0, 1.01, 0.99, 1.0001, 0.9999)  # factors, the first with which a formula has a value
_ITERATIONS = 12
_HALVINGS = 8  # of a step to where a formula has no value
_SOLVED = 1e-14
_PLAIN = 1e-7  # how near to 0 or 1 a factor is meant to be that
_SPARE = 2  # wrong answers that bear out a number that was read off another one


def factor_of(entries: Sequence[Sequence[Quantity]], answers: Mapping[str, Decimal], wrong: set[str]) -> Found | None:
    """The terms whose extra factor explains all answers to these entries, the plainest; or None."""
    told, blamed = told_by(entries, wrong)
    if len(blamed) <= _SPARE:
        return None
    limits, fits = limits_of(told, answers), []
    first = max((quantity for here in told for quantity in here if quantity.id in blamed), key=partial(_off, answers))
    worst = next(here for here in told if first in here)
    values = model_values(first.set)
    for formula in formulas_of(first.kind, first.friction):
        if formula.alone or formula.only:  # the whole text is another one of these
            continue
        written = Written(formula.source, formula.groups)
        for n, slip in enumerate(written.scaled()):
            factor = _wanted(formula, written, slip, worst, blamed, answers)
            if factor is None or abs(factor - 1) < _PLAIN:
                continue
            factor = 0.0 if abs(factor) < _PLAIN else factor
            rank, said = said_factor(factor, values)
            changed = next(itertools.islice(written.scaled(repr(factor)), n, None))
            if borne_out_by(formula, partial(written.run, slip=changed), told, answers, limits, blamed) is not None:
                fits.append((rank, f"{slip.says()} {said}" + _at_speed(slip.says(), factor, first) * (rank >= LONG)))
    best = min((rank for rank, _ in fits), default=0.0)
    causes = tuple(dict.fromkeys(("factor", text) for rank, text in fits if rank == best))
    return (causes, frozenset(blamed)) if causes else None


def _at_speed(text: str, factor: float, quantity: Quantity) -> str:
    """Where a term that has the speed as a factor is taken at one of few digits, or a little beside the Hopf point."""
    if quantity.kind != "hopf" or not re.search(r"\bOmega(?!\^)", text):
        return ""
    right = critical_speed(quantity.set)
    speed, move = factor * right, (factor - 1) * right
    if abs(speed / float(f"{speed:.4g}") - 1) < _PLAIN:
        return f", as at the speed {speed:.4g}"
    if abs(move - float(f"{move:.1g}")) < _PLAIN * right:
        return f", as at Omega_crit {move:+.1g} or in a one-sided difference over {2 * move:.1g}"
    return ""


def _off(answers: Mapping[str, Decimal], quantity: Quantity) -> float:
    """Relatively: where the factor shows best."""
    return abs(float(answers[quantity.id]) / quantity.for_doubles - 1) if quantity.for_doubles else 0.0


def _wanted(
    formula: Formula,
    written: Written,
    slip: Slip,
    here: Sequence[Quantity],
    blamed: set[str],
    answers: Mapping[str, Decimal],
) -> float | None:
    """The factor with which the first wrong answer of an entry that depends on it is as given."""

    def values(factor: float) -> dict[str, float]:
        def run(names: Mapping[str, object]) -> Names:
            return written.run({**names, "free": factor}, slip)

        return next(formula.answers(run, here))

    for quantity in here:
        if quantity.id not in blamed:
            continue
        answer = float(answers[quantity.id])

        def error(factor: float, name: str = quantity.name, answer: float = answer) -> float:
            with suppress(ArithmeticError, ValueError):  # the root of a negative number
                return values(factor)[name] - answer
            return math.nan

        try:
            other = next((c for c in _STARTS if math.isfinite(error(c))), math.nan)
            if math.isnan(other):
                return None
            ends = [(c, error(c)) for c in (1.0, other)]
            if abs(ends[1][1] - ends[0][1]) <= _LOST * abs(float(quantity)):
                continue
            for _ in range(_ITERATIONS):
                (a, at_a), (b, at_b) = ends[-2:]
                if abs(at_b) <= _SOLVED * abs(answer) or at_a == at_b:
                    break
                step = at_b * (b - a) / (at_b - at_a)
                for _ in range(_HALVINGS):
                    ends.append((b - step, error(b - step)))
                    if not math.isnan(ends[-1][1]):
                        break
                    ends.pop()
                    step /= 2
                else:
                    return None
        except (TypeError, LookupError, AttributeError):
            return None
        return ends[-1][0] if math.isfinite(ends[-1][0]) else None
    return None
