"""The diagnosis: planted mistakes are named, several at once, and nothing is said of right or
of random answers.
"""

from __future__ import annotations

import math
import random
import re
from collections.abc import Callable

import numpy as np
import pytest

from tests.conformance.mistakes import (
    DRAWS,
    EQUATION_MISTAKES,
    FORMULA_MISTAKES,
    diagnose_planted,
    draw_mistakes,
    grades_of,
    patched_program,
    question_rows,
)
from tippedisk_verify.conformance.diagnosis import Diagnosis, diagnose
from tippedisk_verify.conformance.diagnosis.dictionary import LINEAR, SMOOTH
from tippedisk_verify.conformance.diagnosis.terms import EquationValues, parse_sum, sum_text
from tippedisk_verify.conformance.grading import grade_answers
from tippedisk_verify.conformance.sheet import Answers
from tippedisk_verify.reference_values.store import ReferenceValue, Store, load_store

STATE = {
    "beta": np.array([1.1, 0.4]),
    "gamma": np.array([0.3, 2.0]),
    "v": np.array([0.2, -1.5]),
    "Omega": 30.5,
}
PARAMETERS = {
    "r": 0.045,
    "e": 0.0025,
    "m": 0.435,
    "A": 0.249e-3,
    "B": 0.227e-3,
    "g": 9.81,
    "mu": 0.3,
    "epsilon": 0.1,
}


def _diagnosed(given: dict[str, str], store: Store) -> list[Diagnosis]:
    return diagnose(
        grade_answers(Answers({id_: ("doubles", answer) for id_, answer in given.items()}), store),
        store,
    )


def _changed(pattern: str, of: Callable[[ReferenceValue], float], store: Store) -> list[Diagnosis]:
    """The diagnosis of right answers of which some are changed."""
    return _diagnosed({one.id: repr(of(one)) for one in store.matching(pattern)}, store)


def test_every_kind_of_mistake_can_be_planted() -> None:
    assert [
        name
        for name, mistake in EQUATION_MISTAKES.items()
        if patched_program([(mistake.old, mistake.new)]) is None
    ] == []


@pytest.mark.parametrize(
    "listed",
    [
        pytest.param(name, marks=[pytest.mark.slow(minutes=0.4)] * (name != "some"))
        for name in DRAWS
    ],
)
def test_mistakes_in_the_equations_are_named_several_at_once(listed: str) -> None:
    differences, id_pattern, sizes = DRAWS[listed]
    draws = [names for count, size in sizes for names in draw_mistakes(1, count, size)]
    found = [
        one
        for names in draws
        if (one := diagnose_planted(names, differences, id_pattern=id_pattern))
    ]
    assert len(found) == len(draws)
    assert sum(len(one.named) == len(one.names) for one in found) >= 0.85 * len(found)
    assert sum(bool(one.named) for one in found) >= 0.95 * len(found)
    assert sum(bool(one.false_causes) for one in found) <= max(1, 0.02 * len(found))


@pytest.mark.parametrize("names", [("Bbar-plus", "inertia-exchanged"), ("h2-B", "h2-sine")])
def test_mistakes_whose_effects_multiply_are_both_named(names: tuple[str, str]) -> None:
    found = diagnose_planted(names)
    assert found.named == set(names)
    assert found.false_causes == ()


def test_a_relation_to_the_values_of_a_program_with_mistakes_is_named(store: Store) -> None:
    program = patched_program([EQUATION_MISTAKES["Bbar-B"][:2]])
    answers = {
        id_: float(text) / (2 * math.pi if "/equilibrium/" in id_ else 1)
        for id_, text in program["answered"](question_rows(range(1, 3))).items()
    }
    level_1, level_2 = _diagnosed({id_: repr(x) for id_, x in answers.items()}, store)
    assert [says for _, says in level_1.causes] == ["Bbar = B, not B - m e^2"]
    assert [says for _, says in level_2.causes] == ["all answers have the factor 1/(2 pi)"]


#: The level at which a mistake shows, by the first word of its name.
LEVELS = {"eigenvalues": 2, "equilibrium": 2, "hopf": 3, "law": 4, "manifold": 5}


@pytest.mark.parametrize("name", FORMULA_MISTAKES)
def test_a_mistake_at_levels_2_to_5_is_named(name: str) -> None:
    old, new, says = FORMULA_MISTAKES[name]
    program = patched_program([(old, new)])
    level = LEVELS[name.partition("-")[0]]
    diagnoses = diagnose(grades_of(program, range(level, level + 1)), load_store())
    causes = " | ".join(cause for one in diagnoses for _, cause in one.causes)
    assert re.search(says, causes), causes


def test_right_programs_have_no_diagnosis() -> None:
    program = patched_program([])
    assert diagnose(grades_of(program, range(1, 6), "."), load_store()) == []


@pytest.mark.parametrize(
    "answer",
    [
        pytest.param(lambda: repr(random.gauss(0, 1)), id="random", marks=pytest.mark.slow),
        pytest.param(lambda: "nan", id="nan"),
        pytest.param(lambda: "1", id="1"),
    ],
)
def test_nothing_but_the_constant_is_said_of_answers_without_sense(
    answer: Callable[[], str], store: Store
) -> None:
    random.seed(5)
    # Three states are enough for fits of many terms, and the other levels are whole.
    asked = "table1/(both|linear)/(rhs/00[1-3]|slow-manifold/0[1-3]|(?!rhs|slow-manifold))"
    diagnoses = _diagnosed({id_: answer() for id_ in store if re.match(asked, id_)}, store)
    assert len(diagnoses) == 10
    assert {says for one in diagnoses for _, says in one.causes} <= {"all answers are one"}


def test_fewer_answers_than_unknowns_name_nothing(store: Store) -> None:
    (diagnosis,) = _diagnosed({"table1/both/rhs/001/M": "12.345678901234567"}, store)
    assert diagnosis.causes == ()
    assert diagnosis.unexplained == 1


@pytest.mark.parametrize(
    ("pattern", "change", "says"),
    [
        (
            "table1/linear/limit-cycle/",
            lambda q: q.for_doubles * (2 if q.name == "period" else 1),
            "period has the factor 2",
        ),
        (
            "table1/linear/limit-cycle/",
            lambda q: -q.for_doubles if q.name == "v_0" else q.for_doubles,
            "v_0 has the wrong sign",
        ),
        (
            "table1/linear/limit-cycle/",
            lambda q: q.for_doubles / math.log(10) if q.name.startswith("log") else q.for_doubles,
            "log_multiplier_fast and log_multiplier_slow have the factor 1/(ln 10)",
        ),
        (
            "table1/linear/trajectory/",
            lambda q: q.for_doubles + math.pi * (q.name[:6] == "gamma@"),
            "gamma is pi too large",
        ),
        (
            "table1/linear/trajectory/",
            lambda q: round(q.for_doubles, 2) if q.name[:5] == "beta@" else q.for_doubles,
            "beta is rounded to 2 decimals",
        ),
        (
            "table1/linear/limit-cycle/",
            lambda q: float(f"{q.for_doubles:.3g}"),
            "all answers are rounded to 3 significant digits",
        ),
        (
            "table1/both/rhs/",
            lambda q: (
                -q.for_doubles if q.name == "h" and float(q.inputs["v"]) < 0 else q.for_doubles
            ),
            "h has the wrong sign where v < 0",
        ),
    ],
)
def test_a_relation_to_right_answers_is_named(
    pattern: str, change: Callable[[ReferenceValue], float], says: str, store: Store
) -> None:
    (diagnosis,) = _changed(pattern, change, store)
    assert [cause for _, cause in diagnosis.causes] == [says]
    assert diagnosis.status == "explained"


@pytest.mark.parametrize("definitions", [LINEAR, SMOOTH], ids=["linear", "smooth"])
def test_derivatives_agree_with_differences(definitions: dict[str, tuple[object, ...]]) -> None:
    at = EquationValues(definitions, {**PARAMETERS, **STATE})
    for name in ("beta", "gamma", "v"):
        step = 1e-5
        sides = [
            EquationValues(definitions, {**PARAMETERS, **STATE, name: STATE[name] + sign * step})
            for sign in (1, -1)
        ]
        slope = (sides[0]["v_rate"] - sides[1]["v_rate"]) / (2 * step)
        # A step squared, and rounding over it
        np.testing.assert_allclose(at[f"dv_rate_d{name}"], slope, rtol=1e-6)


@pytest.mark.parametrize(
    "text",
    [
        "-m g rho cos(beta)",
        "A cos(gamma)^2 + Bbar sin(gamma)^2",
        "1/2 e Omega / (r + e)",
        "(3 sin(beta)^2 - 2) v",
    ],
)
def test_sums_are_shown_as_they_are_read(text: str) -> None:
    assert sum_text(parse_sum(text)) == text


def test_levels_without_an_integrator_follow_and_later_ones_may_follow(store: Store) -> None:
    random.seed(5)
    mistake = EQUATION_MISTAKES["Bbar-B"]
    program = patched_program([(mistake.old, mistake.new)])
    assert program is not None
    answers = program["answered"](question_rows(range(1, 3)))
    for quantity in store.matching("table1/linear/limit-cycle/"):
        answers[quantity.id] = repr(quantity.for_doubles * (1 + 0.1 * random.random()))
    diagnoses = _diagnosed(answers, store)
    assert [one.status for one in diagnoses] == ["explained", "follows", "may-follow"]


def test_levels_follow_from_a_wrong_parameter(store: Store) -> None:
    old = "p = tuple(float(entry[0][name]) for name in PARAMETERS)"
    program = patched_program([(old, f"{old}\n        p = (0.054, *p[1:])")])
    assert program is not None
    level_1, *later = diagnose(grades_of(program, range(1, 4)), store)
    assert level_1.causes == (("equations", "the inputs: r = 0.054"),)
    assert [one.status for one in later] == ["follows", "follows"]
