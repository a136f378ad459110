"""What is wrong with answers that fail: the one mistake that predicts all of them, or nothing.

At the first level that fails, each alternative predicts the answers given, right ones too. It is accepted only if the
answers would have passed the level with it for the truth, and lie ten times as close to it as to the truth where it
moves them. One free number and the answers' shape are tried likewise. Two mistakes at once therefore stay unexplained.
"""

from __future__ import annotations

import itertools
import math
import random
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import cache, partial
from typing import Any

from tippedisk_verify.conformance.diagnosis.along import along_of
from tippedisk_verify.conformance.diagnosis.alternatives import ALTERNATIVES, CORRECT, Alternative
from tippedisk_verify.conformance.diagnosis.closing import closing_of, unclosed
from tippedisk_verify.conformance.diagnosis.copies import copy_of
from tippedisk_verify.conformance.diagnosis.cycles import cycle_slip_of, following_of
from tippedisk_verify.conformance.diagnosis.factors import OF_ANOTHER, free_values, term_factors
from tippedisk_verify.conformance.diagnosis.integrators import integrator_of
from tippedisk_verify.conformance.diagnosis.orbits import events_of
from tippedisk_verify.conformance.diagnosis.predictions import Model, predicted
from tippedisk_verify.conformance.diagnosis.quotients import quotients_of
from tippedisk_verify.conformance.diagnosis.relations import stem
from tippedisk_verify.conformance.diagnosis.restarts import restarts_of
from tippedisk_verify.conformance.diagnosis.saddle import saddle_of
from tippedisk_verify.conformance.diagnosis.samples import samples_of
from tippedisk_verify.conformance.diagnosis.scaled import factor_of
from tippedisk_verify.conformance.diagnosis.scans import orbit_values
from tippedisk_verify.conformance.diagnosis.shapes import borne_out, formula_of, shape_of
from tippedisk_verify.conformance.diagnosis.sides import one_sided
from tippedisk_verify.conformance.diagnosis.sizes import size_of
from tippedisk_verify.conformance.diagnosis.slipped import slip_of
from tippedisk_verify.conformance.grading import FAILS_BELOW, LEVEL_NAMES, Grade, as_decimal
from tippedisk_verify.conformance.sheet import placed
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["Diagnosis", "diagnosed"]

_MOST_ENTRIES = {1: 40, 2: 16, 3: 1, 4: 8, 5: 10, 6: 3, 7: 3, 8: 2, 9: 6, 10: 3}  # looked at, of each sort
_FORMULAS = (2, 3, 4, 5, 8)  # levels without orbits, but for Omega_h
_MATRICES = 2
_SERIES = 5  # the level of the slow manifold
_CLOSED = (3, 4)  # levels of closed forms, whose terms may have a factor that is solved for
_CYCLES = (7, 9)
_SADDLE = 8
_ORBITS = 6  # the level of trajectories
_OF_MODELS = ("/period", "/gamma_bar_0", "/v_0")  # what a model with a mistake predicts of a cycle
_DURATION = 10.0  # s, of an orbit
_FAR = 20.0  # times; slopes are no further off
_LINEAR = 0.1  # rad, rad/s; they say nothing of larger moves
_DOUBLES = 1e-12  # rad, rad/s; what a program in doubles may be off at the start of an orbit
_BORNE_OUT = 3  # wrong answers that must bear out a number that was read off one of them
_SOLVED = 2  # digits beyond the level's that they must have by it
_KNOWN = frozenset(alternative.name for alternative in ALTERNATIVES)
#: A number of five digits and more that was read off an answer, or a factor that was put together from parameters.
_VAGUE = re.compile(r"\d\.?\d{4}|extra factor")
_PARTS = ("equilibrium", "form")  # inputs that a program may well treat apart
_EQUATIONS_PROVED = 50  # passed answers at level 1 after which the equations are beyond doubt


Causes = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Diagnosis:
    """The first level that fails for some parameter sets and friction laws, and why, where that can be told."""

    level: int
    sets: tuple[str, ...]
    frictions: tuple[str, ...]
    failed: frozenset[str]  #: ids
    causes: Causes  #: (name, what to look for); several if they cannot be told apart; () if none is known
    tried: frozenset[str]  #: the failed ones that the cause was tried on, and predicts
    no_numbers: frozenset[str]  #: the failed ones that are no finite number, which no mistake predicts
    where: str = ""  #: if no cause is known: a condition that the wrong answers satisfy and the right ones do not

    def says(self) -> str:
        both = len(self.frictions) > 1 or self.frictions == ("both",)
        laws = "both laws" if both else f"{self.frictions[0]} friction"
        where = f"level {self.level}, {LEVEL_NAMES[self.level]} ({' and '.join(self.sets)}, {laws}): "
        where += f"{len(self.failed)} wrong"
        if self.no_numbers:
            where += f", {len(self.no_numbers)} of them no finite number"
        if self.no_numbers == self.failed:
            return where
        if not self.causes:
            text = f"{where}; unexplained: none of the known mistakes alone gives these answers"
            return text + f"; they are wrong where {self.where}, and only there" * bool(self.where)
        causes = " or ".join(cause for _, cause in self.causes)
        return f"{where}; likely cause: {causes} (predicts all {len(self.tried)} of them that it was tried on)"

    def json(self) -> dict[str, Any]:
        return {
            "level": self.level,
            "sets": list(self.sets),
            "frictions": list(self.frictions),
            "failed": len(self.failed),
            "no_numbers": len(self.no_numbers),
            "status": "explained" if self.causes else "no-numbers" if self.no_numbers == self.failed else "unexplained",
            "causes": [{"name": name, "cause": cause} for name, cause in self.causes],
            "where": self.where,
            "tried_on": len(self.tried),
        }


def diagnosed(
    grades: Sequence[Grade], store: Store, advance: Callable[[str, int], None] = lambda label, steps: None
) -> list[Diagnosis]:
    """A diagnosis for the first failing level of each parameter set and friction law, like ones put together.

    ``advance`` is told what is being tried.
    """
    diagnoses: list[Diagnosis] = []
    for set_name in dict.fromkeys(store[grade.id].set for grade in grades):
        here = [grade for grade in grades if store[grade.id].set == set_name]
        # What is common to both laws goes with each of them that was answered.
        laws = [law for law in ("linear", "smooth") if any(store[grade.id].friction == law for grade in here)]
        for law in laws or ["both"]:
            group = [grade for grade in here if store[grade.id].friction in (law, "both")]
            diagnosis = _first_failure(group, store, set_name, law, advance)
            if diagnosis is not None and not _follows(diagnosis, diagnoses, store):
                _add(diagnoses, diagnosis)
    return diagnoses


def _follows(new: Diagnosis, diagnoses: Sequence[Diagnosis], store: Store) -> bool:
    """Whether what fails is common to both laws, and the other law's equations are known to be wrong already."""
    explained = (old for old in diagnoses if old.causes and old.level == 1 and set(new.sets) <= set(old.sets))
    return new.level > 1 and any(explained) and all(store[id_].friction == "both" for id_ in new.failed)


def _add(diagnoses: list[Diagnosis], new: Diagnosis) -> None:
    """Those of the same level that share a cause, or know none, are one; what only one of them allows goes."""
    for place, old in enumerate(diagnoses):
        common = tuple(cause for cause in old.causes if cause in new.causes)
        if old.level == new.level and (common or not (old.causes or new.causes)):
            diagnoses[place] = Diagnosis(
                old.level,
                tuple(dict.fromkeys((*old.sets, *new.sets))),
                tuple(dict.fromkeys((*old.frictions, *new.frictions))),
                old.failed | new.failed,
                common,
                old.tried | new.tried,
                old.no_numbers | new.no_numbers,
                old.where if old.where == new.where else "",
            )
            return
    diagnoses.append(new)


def _first_failure(
    group: list[Grade], store: Store, set_name: str, friction: str, advance: Callable[[str, int], None]
) -> Diagnosis | None:
    level = min((grade.level for grade in group if grade.failed), default=None)
    if level is None:
        return None
    here = [grade for grade in group if grade.level == level and grade.verdict != "no-truth"]
    usable = [grade for grade in here if math.isfinite(grade.digits)]
    failed = frozenset(grade.id for grade in here if grade.failed)
    wrong = {grade.id for grade in usable if grade.failed}
    causes, tried = _causes(usable, wrong, group, store, level, advance) if wrong else ((), frozenset[str]())
    for part in _PARTS if wrong and not causes else ():
        # What holds for one equilibrium, or one form of a law, is tried as if the other had not been asked.
        values = {store[id_].inputs.get(part) for id_ in wrong}
        some = [grade for grade in usable if store[grade.id].inputs.get(part) in values]
        if len(values) == 1 and None not in values and len(some) < len(usable):
            causes, tried = _causes(some, wrong, group, store, level, advance)
            causes = tuple((name, f"{text} (only {min(map(str, values))})") for name, text in causes)
    asked = [store[grade.id] for grade in usable]
    failing = {stem(quantity) for quantity in asked if quantity.id in wrong}
    where = [] if causes else one_sided([quantity for quantity in asked if stem(quantity) in failing], wrong)
    place = " and ".join(condition for condition, _ in where)
    return Diagnosis(level, (set_name,), (friction,), failed, causes, tried, failed - wrong, place)


def _causes(
    usable: list[Grade],
    wrong: set[str],
    group: list[Grade],
    store: Store,
    level: int,
    advance: Callable[[str, int], None],
) -> tuple[Causes, frozenset[str]]:
    """From what is cheap to try and plain to say to what is neither."""
    passed_rhs = sum(grade.level == 1 and not grade.failed for grade in group)
    outputs_only = level > 1 and passed_rhs >= _EQUATIONS_PROVED
    entries = _entries_to_try(usable, store, level)
    answers = {grade.id: as_decimal(grade.answer) for grade in usable}

    def said(alternative: Alternative) -> str:
        """Equations that are right at level 1 are wrong in the orbits' own copy of them."""
        elsewhere = outputs_only and level == _ORBITS and alternative.spelling != CORRECT
        return alternative.cause + " (in the orbits' equations: those of level 1 are right)" * elsewhere

    def fitting(alternatives: Iterable[Alternative]) -> tuple[Causes, frozenset[str]] | None:
        fits = []
        for alternative in alternatives:
            advance(f"level {level}: {alternative.name}", 1)
            fit = _fit(alternative, entries, answers, wrong, store, level)
            solved = fit is not None and len(fit[1]) >= _BORNE_OUT and fit[0] >= FAILS_BELOW[level] + _SOLVED
            if fit is not None and (solved or alternative.name in _KNOWN):
                fits.append((*fit, alternative))
        # Mistakes whose predictions fit about as well as the best cannot be told apart.
        best = max((digits for digits, _, _ in fits), default=0.0)
        close = [(alternative, tried) for digits, tried, alternative in fits if digits > best - 2]
        close = [(alternative, tried) for alternative, tried in close if alternative.name in _KNOWN] or close
        close = [(one, tried) for one, tried in close if OF_ANOTHER in one.cause] or close
        causes = tuple(dict.fromkeys((alternative.name, said(alternative)) for alternative, _ in close))
        return (causes, frozenset().union(*(tried for _, tried in close))) if causes else None

    slips = cache(
        partial(copy_of, usable, wrong, store, advance)
        if level == _ORBITS and outputs_only
        else partial(slip_of, entries, answers, wrong, advance)
    )
    # What changes the inputs of a right-hand side may differ from what changes those of an orbit.
    models = [
        one
        for one in ALTERNATIVES
        if (one.of_orbits and level >= _ORBITS)
        or (one.of_the_model and not outputs_only)
        or (one.spelling != CORRECT and level == _ORBITS)
    ]
    known = ("@",) if level == _ORBITS else _OF_MODELS
    if level >= _ORBITS and not any(mark in id_ for id_ in wrong for mark in known):
        models = []  # which would have changed other answers
    outputs = [one for one in ALTERNATIVES if one.output or one.counterpart]
    worst = _worst(usable, wrong, store)
    first = _first_sample(worst, usable, store)
    models = [one for one in _distinct(models, entries) if _foretold(one, worst, first, answers, wrong, store)]
    values = partial(free_values, worst, answers, store)
    if level == 1:
        found = fitting(models + outputs)
        if found is None:
            terms = list(term_factors([store[id_] for id_ in sorted(wrong)], answers))
            plain = (term for term in terms if term.name.startswith("term"))
            found = fitting([*values(), *plain]) or slips() or fitting(terms)
    else:
        found = fitting(outputs) or shape_of(usable, wrong, store, by_place=False)
        if found is None and level in _CYCLES:
            advance(f"level {level}: cycles", 1)
            found = shape_of(usable, wrong, store, by_place=True)
            found = found or following_of(usable, wrong, store) or along_of(usable, wrong, store)
            found = found or cycle_slip_of(usable, wrong, store)
            found = found or quotients_of(usable, wrong, store) or closing_of(usable, wrong, store)
        if found is None and level in _FORMULAS:
            found = formula_of(entries, answers, wrong) if level != _MATRICES else None
            found = found or (saddle_of(usable, wrong, store) if level == _SADDLE else None)
            if found is None and outputs_only:  # another number in this level alone
                found = fitting(one for one in ALTERNATIVES if one.parameters or (one.inputs and level == _SERIES))
        if found is None and level == _ORBITS:
            advance(f"level {level}: integrators", 1)
            found = samples_of(usable, wrong, store) or restarts_of(usable, wrong, store)
            found = found or integrator_of(usable, wrong, store) or events_of(usable, wrong, store)
        if found is None:
            # An orbit may have been computed with another number than the right-hand side.
            several = len(wrong) >= _BORNE_OUT
            free = values() if several and level < _ORBITS and (level in (2, 4, 5) or not outputs_only) else ()
            orbits = [one for one in models if one.of_orbits and level >= _ORBITS]
            rest = [one for one in models if one not in orbits]
            found = fitting(orbits) or ((fitting(rest) or slips()) if level < _ORBITS else None)
            found = found or fitting(itertools.chain(rest, free))
            if found is None and level == _ORBITS and several:
                numbers, terms = orbit_values(usable, wrong, answers, store)
                found = fitting(numbers) or fitting(terms)
    if found is None and level == _MATRICES:  # what a parameter says more simply is tried by now
        found = formula_of(entries, answers, wrong)
    if found is None or all(_VAGUE.search(text) for _, text in found[0]):  # a slip says more
        found = slips() or _either(factor_of(entries, answers, wrong) if level in _CLOSED else None, found)
    found = found or shape_of(usable, wrong, store, by_place=True)
    found = found or size_of(usable, wrong, store, outputs_only)
    # Near the connection doubles do not close cycles well enough to tell.
    return found or (unclosed(usable, wrong, store) if level == _CYCLES[0] else None) or ((), frozenset())


def _either(
    one: tuple[Causes, frozenset[str]] | None, other: tuple[Causes, frozenset[str]] | None
) -> tuple[Causes, frozenset[str]] | None:
    """What says no number of many digits, or both."""
    if one is None or other is None or not all(_VAGUE.search(text) for _, text in one[0]):
        return one or other
    return one[0] + other[0], one[1] | other[1]


def _distinct(models: Iterable[Alternative], entries: Sequence[Sequence[Quantity]]) -> Iterator[Alternative]:
    """Of those that only change the inputs, one for each change that these entries see: the first."""
    seen = [_inputs(Alternative("", ""), entries)]
    for model in models:
        if model == Alternative(model.name, model.cause, inputs=model.inputs):
            inputs = _inputs(model, entries)
            if inputs in seen:
                continue
            seen.append(inputs)
        yield model


def _foretold(
    model: Alternative, worst: Quantity, first: Quantity, answers: dict[str, Decimal], wrong: set[str], store: Store
) -> bool:
    """Whether a model may make an orbit's answers: its first sample, which is quickly computed, and the worst one.

    Of a small change of the inputs, the slopes that the reference knows have to allow the worst error.
    """
    if "@" not in worst.name:
        return True
    if model.inputs and not model.parameters and worst.condition:
        (given,), (changed,) = _inputs(Alternative("", ""), [[worst]]), _inputs(model, [[worst]])
        shares = {name: changed[name] / x - 1 for name, x in given.items() if isinstance(x, float) and x}
        move = abs(sum(float(worst.condition.get(name, 0)) * share for name, share in shares.items()))
        error = abs(float(answers[worst.id]) - float(worst))
        small = all(abs(share) < _LINEAR for share in shares.values())
        if small and (error >= _FAR * move or (move >= _FAR * error and move <= _LINEAR)):
            return False
    expected = predicted(model, [first], store, {}).get(first.id, math.nan)
    return borne_out(answers[first.id], expected, first, first.id in wrong) is not None


def _inputs(model: Alternative, entries: Sequence[Sequence[Quantity]]) -> list[dict[str, Any]]:
    return [Model(model, here[0].set, here[0].friction).inputs(here[0]) for here in entries]


def _worst(usable: list[Grade], wrong: set[str], store: Store) -> Quantity:
    """The wrong answer to solve for a free value: where all of the model shows, and early, if it is an orbit's."""

    def rank(grade: Grade) -> tuple[float, float]:
        name, place = placed(store[grade.id].name)
        if grade.level == _SERIES:
            return _cost(name), grade.digits
        return (
            float(place["t"]) if "t" in place else _DURATION if grade.level == _ORBITS else float(name != "v_rate")
        ), grade.digits

    return store[min((grade for grade in usable if grade.id in wrong), key=rank).id]


def _cost(name: str) -> float:
    """Which of a slow manifold's numbers is computed first: low orders, and residuals last."""
    return float(name[-1]) + 10 * name.startswith("residual")


def _first_sample(worst: Quantity, usable: list[Grade], store: Store) -> Quantity:
    """The first sample of the same orbit, or the same question where there is none."""
    entry = [store[grade.id] for grade in usable if grade.id.startswith(worst.id.rsplit("/", 1)[0] + "/")]
    samples = [quantity for quantity in entry if "@" in quantity.name]
    return min(samples, key=lambda quantity: float(quantity.name.split("@")[1]), default=worst)


def _entries_to_try(usable: Iterable[Grade], store: Store, level: int) -> list[list[Quantity]]:
    """Questions by entry: some with wrong answers first, then some whose answers are all right."""
    by_entry: dict[str, list[Grade]] = {}
    for grade in usable:
        by_entry.setdefault(grade.id.rsplit("/", 1)[0], []).append(grade)
    bad = [here for here in by_entry.values() if any(grade.failed for grade in here)]
    good = [here for here in by_entry.values() if not any(grade.failed for grade in here)]
    few = _MOST_ENTRIES[level]
    chosen = [[store[grade.id] for grade in here] for here in (*_some(bad, few), *_some(good, few))]
    if level == _ORBITS and chosen:
        # The first sample that is wrong costs a part of an orbit and rules most mistakes out.
        wrong = {grade.id for grade in usable if grade.failed}

        def first(here: Sequence[Quantity]) -> float:
            times = (float(placed(q.name)[1].get("t", math.inf)) for q in here if q.id in wrong)
            return min(times, default=math.inf)

        chosen.sort(key=first)
        early = [q for q in chosen[0] if float(placed(q.name)[1].get("t", math.inf)) <= first(chosen[0])]
        chosen.insert(0, early or chosen[0])
    return chosen


def _some(entries: list[list[Grade]], count: int) -> list[list[Grade]]:
    """``count`` of them, without the pattern that every n-th would have; the same ones each time."""
    return entries if len(entries) <= count else random.Random(count).sample(entries, count)


def _fit(
    alternative: Alternative,
    entries: list[list[Quantity]],
    answers: dict[str, Decimal],
    wrong: set[str],
    store: Store,
    level: int,
) -> tuple[float, frozenset[str]] | None:
    """(least digits, wrong answers tried) if every answer passes with the alternative for the truth."""
    least, tried = math.inf, set()
    if level == _SERIES:  # low orders rule most mistakes out
        entries = [*([quantity] for quantity in sorted(entries[0], key=lambda one: _cost(one.name))), *entries]
    for quantities in entries:
        truth = {quantity.id: quantity.for_doubles for quantity in quantities}
        given = {quantity.id: near_float(answers[quantity.id]) for quantity in quantities}
        expected = predicted(alternative, quantities, store, truth, given)
        if not expected:
            if any(quantity.id in wrong for quantity in quantities):
                return None
            continue
        nudged: dict[str, float] = {}
        for quantity in quantities:
            if quantity.id not in expected:
                continue
            digits = borne_out(answers[quantity.id], expected[quantity.id], quantity, quantity.id in wrong)
            if digits is None:
                if level != _ORBITS:
                    return None
                nudged = nudged or predicted(_nudged(alternative), quantities, store, truth, given)
                if not _lost(expected[quantity.id], nudged.get(quantity.id, math.nan), quantity):
                    return None
            elif quantity.id in wrong:
                tried.add(quantity.id)
                least = min(least, digits)
    return (least, frozenset(tried)) if tried else None


def _nudged(alternative: Alternative) -> Alternative:
    """The same mistake with a start that is off by what doubles leave of it."""

    def inputs(given: dict[str, Any]) -> dict[str, Any]:
        given = alternative.inputs(given) if alternative.inputs is not None else given
        return {name: value + _DOUBLES if name in ("gamma", "v") else value for name, value in given.items()}

    return replace(alternative, inputs=inputs)


def _lost(expected: float, nudged: float, quantity: Quantity) -> bool:
    """Whether an orbit by the mistaken model has lost the digits that the question needs, next to a saddle."""
    return borne_out(Decimal(nudged), expected, quantity, False) is None if math.isfinite(nudged) else True


def near_float(answer: Decimal) -> float:
    """The nearest double, or infinity for what has none."""
    return float(answer) if not answer or abs(answer.adjusted()) < 300 else math.inf
