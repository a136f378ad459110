"""Shapes of wrong answers: differences by their rounding, one side of a surface, exchanged statements, factors."""

from __future__ import annotations

import math
from collections.abc import Callable
from decimal import Decimal
from functools import partial

import pytest

from tippedisk_verify.conformance.diagnosis.alternatives import Alternative
from tippedisk_verify.conformance.diagnosis.differences import difference_of
from tippedisk_verify.conformance.diagnosis.predictions import Model
from tippedisk_verify.conformance.diagnosis.scaled import factor_of
from tippedisk_verify.conformance.diagnosis.shapes import shape_of
from tippedisk_verify.conformance.diagnosis.sides import one_sided
from tippedisk_verify.conformance.diagnosis.slips import Written
from tippedisk_verify.conformance.diagnosis.written_theory import formulas_of
from tippedisk_verify.conformance.grading import graded
from tippedisk_verify.conformance.sheet import Answers
from tippedisk_verify.reference_values.store import Quantity, Store, stored


def slopes(store: Store) -> list[Quantity]:
    found = store.matching("printed/linear/rhs/")
    return [quantity for quantity in found if quantity.name == "dv_rate_dgamma"]


def rate(quantity: Quantity, move: float) -> float:
    model = Model(Alternative("", ""), quantity.set, quantity.friction)
    given = model.inputs(quantity)
    state = [given["beta"], given["gamma"] + move, given["v"]]
    return float(model.parts(math, given["Omega"], state)["v_rate"])


def forward(step: float, quantity: Quantity) -> float:
    return (rate(quantity, step) - rate(quantity, 0.0)) / step


def central(step: float, divisor: float, quantity: Quantity) -> float:
    return (rate(quantity, step) - rate(quantity, -step)) / (divisor * step)


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (partial(forward, 1e-11), "over 1e-11 "),
        (partial(forward, 2.0**-26), r"over 2\^-26 "),
        (partial(central, 1e-6, 2), "over 2e-06 "),
        (partial(central, 1e-6, 1), "over 1e-06 .* twice too large"),
        (lambda quantity: forward(1e-8, quantity) / 2, "over 2e-08 .* half as large"),
    ],
)
def test_a_difference_tells_its_step(answer: Callable[[Quantity], float], words: str) -> None:
    import re

    store = stored()
    here = slopes(store)
    text = difference_of(here, {quantity.id: Decimal(answer(quantity)) for quantity in here}, store)
    assert text is not None
    assert re.search(words, text)


@pytest.mark.parametrize("noise", [1e-12, 1e-9, 1e-6])
def test_errors_of_the_size_of_a_differences_are_none(noise: float) -> None:
    store = stored()
    here = slopes(store)
    answers = {q.id: Decimal(q.for_doubles * (1 + noise * math.sin(7919.0 * n))) for n, q in enumerate(here)}
    assert difference_of(here, answers, store) is None


def by_side(store: Store, wrong_where: Callable[[Quantity], bool]) -> tuple[list[Quantity], dict[str, float]]:
    here = slopes(store)
    return here, {q.id: q.for_doubles * (-1.0 if wrong_where(q) else 1.0) for q in here}


def test_one_side_of_a_surface_is_said_with_the_shape_there() -> None:
    store = stored()
    here, answers = by_side(store, lambda quantity: float(quantity.inputs["v"]) < 0)
    grades = graded(Answers({id_: ("doubles", repr(x)) for id_, x in answers.items()}), store)
    wrong = {grade.id for grade in grades if grade.failed}
    assert [condition for condition, _ in one_sided(here, wrong)] == ["v < 0"]
    found = shape_of(grades, wrong, store, by_place=False)
    assert found is not None
    assert found[0] == (("shape", "dv_rate_dgamma: the answers are of the wrong sign where v < 0"),)


def test_answers_wrong_here_and_there_have_no_side() -> None:
    store = stored()
    here = slopes(store)
    assert not list(one_sided(here, {quantity.id for quantity in here[::3]}))


def test_two_statements_are_exchanged() -> None:
    text = Written("a = x\nb = 2 * x\nfor n in range(2):\n    a += n\n    b += x\ny = a - b\n", ())
    found = {
        slip.says(): text.run({"x": 5.0, "range": range}, slip)["y"] for slip in text.slips() if "exch" in slip.says()
    }
    assert found["a and b are exchanged"] == (2 * 5 + 0 + 1) - (5 + 5 + 5)
    assert found["what a and b are is exchanged"] == (5 + 5 + 5) - (2 * 5 + 0 + 1)
    assert text.run({"x": 5.0, "range": range})["y"] == (5 + 0 + 1) - (10 + 5 + 5)


@pytest.mark.parametrize(
    ("kind", "old", "new", "words"),
    [
        ("hopf", "/ 6 * third(gamma", "/ 60 * third(gamma", "has the extra factor epsilon or 0.1"),
        ("harmonic-balance", "1 / 8 * (stiff", "1 / 7 * (stiff", "has the extra factor 1.1428571"),
    ],
)
def test_a_terms_factor_is_solved_for(kind: str, old: str, new: str, words: str) -> None:
    store = stored()
    entries: dict[str, list[Quantity]] = {}
    for quantity in store.values():
        if quantity.kind == kind and quantity.set == "printed" and quantity.friction == "linear":
            entries.setdefault(quantity.id.rsplit("/", 1)[0], []).append(quantity)
    formula = next(formula for formula in formulas_of(kind, "linear") if old in formula.source)
    run = Written(formula.source.replace(old, new), ()).run
    answers = {}
    for here in entries.values():
        for numbers in formula.answers(run, here):
            answers |= {f"{here[0].id.rsplit('/', 1)[0]}/{name}": Decimal(number) for name, number in numbers.items()}
    given = {id_: ("doubles", repr(float(x))) for id_, x in answers.items()}
    wrong = {grade.id for grade in graded(Answers(given), store) if grade.failed}
    found = factor_of(list(entries.values()), answers, wrong)
    assert found is not None
    assert any(words in cause for _, cause in found[0])
    # Two terms with a factor each are no single factor.
    broken = answers | {id_: answers[id_] * Decimal("1.01") for id_ in sorted(wrong)[::2]}
    assert factor_of(list(entries.values()), broken, wrong) is None
