"""Fair grades: what correct programs in doubles leave passes, and a sheet's form is no reason
to fail.
"""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from graded_programs.scipy_program import answered
from tippedisk_verify.conformance.diagnosis import diagnose
from tippedisk_verify.conformance.gate import shortcomings
from tippedisk_verify.conformance.grade_pages import Report
from tippedisk_verify.conformance.grading import (
    Grade,
    compare,
    grade_answers,
    tally_levels,
)
from tippedisk_verify.conformance.sheet import Answers, read_answers
from tippedisk_verify.reference_values.grading_rules import DIGITS_REQUIRED, digits_needed
from tippedisk_verify.reference_values.store import Store

HET = "near-heteroclinic/het+1e-8"
CRIT = "table1/linear/hopf/point/omega_crit"


def _grades(given: dict[str, str], store: Store) -> list[Grade]:
    return grade_answers(
        Answers({id_: ("doubles", answer) for id_, answer in given.items()}), store
    )


def _report(given: dict[str, str], store: Store) -> Report:
    grades = _grades(given, store)
    return Report("a", Answers(), grades, tally_levels(grades, store.values()), [])


@pytest.mark.slow(minutes=0.1)
def test_a_tight_tolerance_passes_where_the_condition_is_worst(store: Store) -> None:
    given = answered(store, [f"table1/linear/{HET}"], "LSODA", 1e-12)
    assert not [grade.id for grade in _grades(given, store) if grade.failed]
    assert _report(given, store).remarks() == []


def test_a_loose_tolerance_is_told_and_where(store: Store) -> None:
    """The smooth law's kink makes an explicit method's tolerance visible; nothing is wrong
    with the answers.
    """
    given = answered(store, ["table1/smooth/trajectory/f2"], "DOP853", 1e-9)
    report = _report(given, store)
    assert report.first_failure is None
    (said,) = report.remarks()
    assert said.startswith("level 6: a tolerance shows")
    assert "table1/smooth/trajectory/f2/" in said


def test_a_question_asks_for_what_its_condition_leaves(store: Store) -> None:
    """By the definition: the error that a relative change of all inputs by the allowance
    makes, in digits.
    """
    worst = store[f"table1/linear/{HET}/multiplier_slow"]
    slopes = sum(abs(float(slope)) for slope in worst.condition.values())
    # The table has three decimals
    assert digits_needed(worst) == round(-math.log10(slopes * 1e-10 / float(worst)), 3)
    assert digits_needed(worst) < 0.5  # next to nothing can be asked for
    period = store[f"table1/linear/{HET}/period"]
    slopes = sum(abs(float(slope)) for slope in period.condition.values())
    assert digits_needed(period) == round(-math.log10(slopes * 1e-10 / float(period)), 3)
    # Programs that keep all digits are asked for the level's, and well-conditioned questions ask
    # for no less.
    assert (
        digits_needed(store["table1/linear/near-heteroclinic/het+1e-30/multiplier_slow"])
        == DIGITS_REQUIRED[9]
    )


def test_too_few_digits_are_not_wrong(store: Store) -> None:
    truth = float(store[CRIT])
    verdicts = [compare(CRIT, truth * (1 + error)).verdict for error in (1e-7, 1e-5, 1e-3)]
    # Eight digits are asked for, four of them suffice
    assert verdicts == ["few-digits", "few-digits", "wrong"]
    report = _report({CRIT: repr(truth * (1 + 1e-6))}, store)
    assert "too few digits: 1 of 1 answer" in report.headline()
    (level,) = [level for level in report.levels if level.answered]
    assert (level.verdict, level.failed, level.too_few_digits) == ("too few digits", 1, 1)
    (diagnosis,) = diagnose(report.grades, store)
    assert "1 with too few digits only" in diagnosis.summary()
    assert "wrong" not in diagnosis.summary()


def test_a_level_agrees_only_if_all_of_it_was_answered(store: Store) -> None:
    hopf = {
        quantity.id: repr(quantity.for_doubles)
        for quantity in store.values()
        if quantity.level == 3
    }
    some = dict(list(hopf.items())[:-1])
    for given, verdict in (
        (hopf, "agrees"),
        (some, "partial"),
        (some | {CRIT: "1"}, "fails"),
        ({}, "not answered"),
    ):
        report = _report(given | {"table1/both/rhs/001/h_3": "1"}, store)  # an optional one
        first, level = (level for level in report.levels if level.level in (1, 3))
        assert (first.verdict, level.verdict, level.answered, level.asked) == (
            "not answered",
            verdict,
            len(given),
            len(hopf),
        )
        assert [
            report.passed,
            not shortcomings(report.levels, report.grades, [3], frozenset()),
        ] == 2 * [verdict in ("agrees", "partial")]


def test_an_entry_of_nothing_but_nan_is_not_answered(store: Store, tmp_path: Path) -> None:
    rows = ["table1/linear/hopf/point/period,NaN", f"{CRIT},NA"]
    other = "table1/linear/limit-cycle/crit-0.5"
    rows += [f"{other}/period,nan", f"{other}/v_0,{store[f'{other}/v_0'].for_doubles!r}"]
    path = tmp_path / "a.csv"
    path.write_text("id,answer\n" + "\n".join(rows) + "\n")
    answers = read_answers(path, store)
    assert answers.missing_entries == ["table1/linear/hopf/point"]
    verdicts = {
        grade.id.rsplit("/", 1)[1]: grade.verdict for grade in grade_answers(answers, store)
    }
    assert verdicts == {"period": "not-a-number", "v_0": "exact"}
    assert any("not answered" in said for said in Report("a", answers, [], [], []).remarks())
