"""Reference values and grades in Python: numbers for NumPy, pytest and arithmetic, in one
reading at a time.
"""

from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction

import mpmath
import numpy as np
import pytest

import tippedisk_verify as tv
from tippedisk_verify.conformance.gate import grade_changes
from tippedisk_verify.errors import InputError

OMEGA_CRIT = "table1/linear/hopf/point/omega_crit"
NEAR = "table1/linear/near-heteroclinic/het+1e-8/period"
pytest_plugins = ["pytester"]

# Six roundings of doubles and a root: far fewer than the 45 that this allows.
DOUBLES = 1e-14


def own_omega_crit() -> float:
    r, e, m, B, g = 0.045, 2.5e-3, 0.435, 0.227e-3, 9.81
    return math.sqrt((r + e) ** 2 * m * g / (r * (B - m * e**2)))


@pytest.mark.parametrize("reading", ["decimals", "doubles"])
def test_a_value_is_of_one_reading_in_all_that_it_does(reading) -> None:
    """Eight zeros above Omega_h the two readings differ in the seventh digit, so a slip would
    show.
    """
    quantity = tv.reference(NEAR, reading=reading)
    value, uncertainty = (Fraction(text) for text in quantity.values[reading])
    other = tv.reference(NEAR, reading="doubles" if reading == "decimals" else "decimals")
    # The seventh digit of 2.6 s is 1e-7.
    assert abs(other - quantity) > 1e-8
    assert (quantity.value, quantity.uncertainty) == (value, uncertainty)
    assert quantity.measured() == quantity.measured(reading)
    assert (
        float(quantity) == float(quantity.measured()) == float(np.asarray(quantity)) == float(value)
    )
    assert str(quantity).split(" ± ")[0] == quantity.values[reading][0]
    assert f"{quantity:.20g}" == f"{quantity.measured():.20g}"
    assert quantity.mpf() == quantity.measured().mpf()
    assert (quantity - value).value == 0
    assert quantity.for_doubles == float(tv.reference(NEAR, reading="doubles"))


@pytest.mark.parametrize(
    "place", ["table1/both/rhs/001", "calibrated/both/rhs/002", "fresh-7-1/both/rhs/01"]
)
def test_a_value_says_all_that_it_depends_on(place: str) -> None:
    """A formula in the published names, on the decimals of the value alone, gives the value."""
    quantity = tv.reference(f"{place}/gamma_y")
    r, e, omega, beta, gamma, v = (
        mpmath.mpf((quantity.parameters | quantity.inputs)[name])
        for name in ("r", "e", "Omega", "beta", "gamma", "v")
    )
    sine = mpmath.sin(beta)
    mine = (r + e * mpmath.sin(gamma)) * v * sine - e * omega * sine**2 * mpmath.cos(gamma)
    assert tv.compare(quantity.id, float(mine), reading="decimals").digits > 14
    assert tv.Disk(**quantity.parameters) == tv.Disk(**quantity.to_dict()["parameters"])
    with pytest.raises(TypeError):
        quantity.parameters["r"] = "1"


@pytest.mark.parametrize("distance", ["1e-16", "1e-20", "1e-30"])
@pytest.mark.parametrize("name", ["period", "multiplier_slow", "dperiod_domega"])
def test_where_doubles_have_no_truth_the_digits_are_those_of_the_decimals(
    distance: str, name: str
) -> None:
    id_ = f"table1/linear/near-heteroclinic/het+{distance}/{name}"
    truth = tv.reference(id_)
    answer = truth.for_doubles * (1 + 1e-3)
    grade, from_decimals = (
        tv.compare(id_, answer, reading=reading) for reading in ("doubles", "decimals")
    )
    assert (grade.verdict, grade.failed) == ("no-truth", False)
    assert (grade.digits, grade.truth) == (from_decimals.digits, from_decimals.truth)
    # The error typed above, to the rounding of a double
    assert grade.digits == pytest.approx(3, abs=1e-9)
    assert "compute from the decimals" in grade.note
    assert not tv.grade({id_: answer}).passed
    assert grade_changes([grade], [tv.compare(id_, 1.0)]) == []


def test_numpy_and_pytest_compare_on_either_side() -> None:
    quantity, mine = tv.reference(OMEGA_CRIT), own_omega_crit()
    for left, right in (
        (mine, quantity),
        (quantity, mine),
        ([mine, mine], quantity),
        (np.array([mine]), [quantity]),
    ):
        np.testing.assert_allclose(left, right, rtol=DOUBLES)
    with pytest.raises(AssertionError, match="Not equal to tolerance"):
        # 30.9 is off by 4e-4 of Omega_crit.
        np.testing.assert_allclose(30.9, quantity, rtol=1e-6)
    for own in (mine, np.float64(mine), np.array([mine]), mpmath.mpf(mine)):
        assert own == pytest.approx(quantity, rel=DOUBLES)
        assert quantity == pytest.approx(own, rel=DOUBLES)
    assert [mine] == pytest.approx([quantity], rel=DOUBLES)
    assert {"crit": quantity} == pytest.approx({"crit": mine}, rel=DOUBLES)
    # A change of ten tolerances is seen from either side.
    assert mine * (1 + 1e-12) != pytest.approx(quantity, rel=1e-13)
    assert quantity != pytest.approx(mine * (1 + 1e-12), rel=1e-13)
    # Thirty rad/s times a hundred roundings
    assert np.array([mine, mine]) - quantity == pytest.approx([0, 0], abs=1e-12)


# ------------------------------------------------------------------------------------- many answers
def test_grades_by_id() -> None:
    answers = {q.id: q.for_doubles for q in tv.references("table1/linear/rhs/00")}
    report = tv.grade(answers)
    assert report.passed, report
    assert str(report).startswith(f"{len(answers)} answers agree")
    assert report.failed == []
    assert (
        tv.grade({OMEGA_CRIT: str(tv.reference(OMEGA_CRIT)).split()[0]}, reading="decimals")
        .grades[0]
        .digits
        > 40
    )


def test_grades_come_with_a_diagnosis() -> None:
    def slip(quantity: tv.Measured) -> float:
        omega, beta, gamma, v = (
            float(quantity.inputs[name]) for name in ("Omega", "beta", "gamma", "v")
        )
        rho = 0.045 + 2.5e-3 * math.sin(gamma)
        return rho * v * math.sin(beta) - 2.5e-3 * omega * math.sin(beta) * math.cos(gamma)

    report = tv.grade(
        {q.id: slip(q) for q in tv.references("table1/both/rhs/0") if q.name == "gamma_y"}
    )
    assert not report.passed
    (diagnosis,) = report.diagnoses
    lines = str(report).splitlines()
    assert (
        "in gamma_y: -e Omega sin(beta) cos(gamma) for -e Omega sin(beta)^2 cos(gamma)"
        in diagnosis.summary()
    )
    assert any(
        line.startswith("table1/both/rhs/0") and "digits, not 10; the truth is" in line
        for line in lines
    )
    assert len(lines) == 10
    # Beside the headline and the diagnosis
    assert lines[-1] == f"and {len(report.failed) - 7} more"


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (None, "a real number is needed, not None"),
        (1 + 2j, r"not \(1\+2j\)"),
        (np.complex128(3), r"not \(3\+0j\)"),
        (True, "not True"),
        (np.array([1.0, 2.0]), "one number is needed, not an array of 2"),
        (np.array([]), "not an array of 0"),
        ([30.9], "not an object of type list"),
        ("30,9", "not '30,9'"),
        (object(), "of type object"),
        (np.array([None]), "not None"),
        ({}, "type dict"),
        (b"1", "type bytes"),
        ("1_000", "not '1_000'"),
        ("", "not ''"),
        ("9" * 3000, "not '999"),
    ],
)
def test_what_is_no_number_is_one_failure(answer: object, says: str) -> None:
    with pytest.raises(InputError, match=says) as refused:
        tv.compare(OMEGA_CRIT, answer)
    assert "\n" not in str(refused.value)
    report = tv.grade({OMEGA_CRIT: answer, "table1/linear/hopf/point/period": 0.886720334405982})
    (failed,) = report.failed
    assert (failed.id, failed.verdict) == (OMEGA_CRIT, "unreadable")
    assert str(report).splitlines()[-1].startswith(f"{OMEGA_CRIT} = ({type(answer).__name__}): ")


def test_what_is_a_number_by_another_name() -> None:
    mine = own_omega_crit()
    assert tv.compare(OMEGA_CRIT, f" {mine!r} ".replace("e", "d")) == tv.compare(OMEGA_CRIT, mine)
    with pytest.raises(InputError, match="decimals or doubles"):
        tv.compare(OMEGA_CRIT, 1.0, reading="floats")
    # These say more digits than a double is printed with, all of them counted.
    for answer in (
        *(
            Decimal(mine),
            Fraction(mine),
            tv.Measured.of(mine, 0),
            np.longdouble(mine),
            mpmath.mpf(mine),
        ),
        np.array([mpmath.mpf(mine)]),
    ):
        assert tv.compare(OMEGA_CRIT, answer).answer == str(Decimal(mine))
    assert tv.compare(OMEGA_CRIT, tv.reference(OMEGA_CRIT), reading="decimals").verdict == "exact"
    assert tv.compare(OMEGA_CRIT, tv.Disk("table1").omega_crit, reading="decimals").digits > 15


@pytest.mark.parametrize(
    "answers", [{}, None, 3, [(OMEGA_CRIT, 3.0)], {"table1/linear/hopf": 3.0}, {7: 3.0}]
)
def test_answers_that_belong_to_no_question(answers) -> None:
    with pytest.raises(InputError) as refused:
        tv.grade(answers)
    assert "\n" not in str(refused.value)
    with pytest.raises(InputError, match="from decimals or doubles"):
        tv.grade({OMEGA_CRIT: 30.9}, reading="halves")


def test_the_fixtures_fail_in_one_line(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        f"""
        import numpy, pytest
        ID = {OMEGA_CRIT!r}
        @pytest.mark.parametrize("id_, answer", [
            (ID, None), (ID, 1j), (ID, "x"), (ID, [1.0]), (ID, float("nan")), (ID, 30.9),
            ("no/such/id", 30.9), (None, 3)])
        def test_wrong(tippedisk_agrees, id_, answer): tippedisk_agrees(id_, answer)
        def test_unknown(tippedisk_reference): tippedisk_reference("no/such/id")
        def test_right(tippedisk_agrees, tippedisk_reference):
            q = tippedisk_reference(ID, reading="doubles")
            for answer in (q, float(q), numpy.array([q])):
                assert tippedisk_agrees(ID, answer).verdict == "exact"
        """
    )
    done = pytester.runpytest_inprocess("-n", "0", "-p", "no:cacheprovider", "--tb=long", "-ra")
    done.assert_outcomes(failed=9, passed=1)
    bodies = done.stdout.str().split("= FAILURES =")[1].split("short test summary")[0]
    for body in bodies.split("\n____")[1:]:
        assert len(body.strip("\n= ").splitlines()) == 2, body  # its name, and the line
