"""The study next to Omega_h: its law against periods, and its errors against their definition."""

from __future__ import annotations

import math
from fractions import Fraction
from pathlib import Path

import pytest

from tests.command_line import answer, printed, ran, rows_of
from tippedisk_verify import Disk, InputError

HALF_WIDTH_FACTOR = ["1e-9", "1e-11", "1e-13"]


@pytest.mark.parametrize("law", ["linear", "smooth"])
@pytest.mark.slow
def test_the_laws_remainder_falls_with_its_next_powers(law) -> None:
    """One term leaves the constant, two the power nu - 1, and three twice that power, a hundredth
    short of the next.
    """
    study = Disk("table1", friction=law).near_heteroclinic(HALF_WIDTH_FACTOR)
    terms = study.period_law
    for row in study.rows:
        assert abs(float(row.period - row.law[0] - terms.constant)) < 0.01
    for number, power in ((1, float(terms.exponent)), (2, 2 * float(terms.exponent))):
        left = [abs(float(row.period - row.law[number])) for row in study.rows]
        assert abs(math.log(left[1] / left[2]) / math.log(100) / power - 1) < 0.01
    *_, last = study.rows
    factor = float(terms.coefficient) * 1e-13 ** float(terms.exponent)
    # The next term is D^0.22 smaller: 1.4e-3 at D = 1e-13.
    assert abs(float(last.period - last.law[1]) / factor - 1) < 2e-3


def test_the_resolution_of_a_double_and_answers_at_their_own_speeds(taylor) -> None:
    disk, distance = Disk("table1"), Fraction(1, 10**9)
    omega = float(disk.heteroclinic(digits=27).omega_h.value + distance)
    further = math.nextafter(omega, math.inf)
    answers = [(omega, 7), (further, "7.5")]
    study = disk.near_heteroclinic(str(Fraction(distance)), answers=answers)
    one, other = study.answers
    assert (one.omega.value, one.period_found.value, other.period_found.value) == (
        Fraction(omega),
        7,
        Fraction("7.5"),
    )
    for row in study.answers:
        assert row.error.value == row.period_found.value - row.period.value
    # A unit in the last place is twice half a unit; the period's second derivative adds its share
    # of the distance.
    (row,) = study.rows
    moved = float(one.period - other.period)
    assert (
        abs(moved / (2 * row.double_resolves) - 1) < 2 * (further - omega) / float(distance) + 1e-6
    )


def test_the_figure_and_bad_input() -> None:
    study = Disk("table1").near_heteroclinic(["1e-3", "1e-20"], answers=[("30.0489", "4.5")])
    (axes,) = study.plot().axes
    *_, double, answers = axes.lines
    assert double.get_label() == "effect of half an ulp of Ω in double"
    assert double.get_xdata().tolist() == [1e-3]  # doubles do not resolve 1e-20
    distance = float(study.answers[0].omega - study.rows[0].omega) + 1e-3
    assert answers.get_xdata() == pytest.approx([distance])
    assert answers.get_ydata() == [abs(float(study.answers[0].error))]
    for distances, answers in (
        ("0", None),
        ("pi", None),
        (["x"], None),
        ("1e-3", [("30.05",)]),
        ("1e-3", ["30"]),
    ):
        with pytest.raises(InputError):
            Disk("table1").near_heteroclinic(distances, answers=answers)


def test_a_long_study_is_printed_row_by_row() -> None:
    distances = [f"{n}e-3" for n in range(1, 8)]
    study = Disk("table1").near_heteroclinic(distances, answers=[("30.05", "3")] * 5)
    text = str(study)
    for number, row in enumerate(study.rows, 1):
        assert f"  rows {number}:\n    distance [rad/s]: {float(row.distance):g}\n" in text
    assert text.count("period_found 3,") == 5


def test_the_command_prints_writes_and_draws_the_study(tmp_path: Path) -> None:
    answers, out = tmp_path / "answers.csv", tmp_path / "near.csv"
    answers.write_text("omega,period\n30.05,3.0827\n")
    words = "heteroclinic --near 1e-2:1e-6:3"
    result = answer(f"{words} --answers {answers} --out {out}")
    assert [row["distance"]["value"] for row in result["rows"]] == ["0.01", "0.0001", "1e-6"]
    assert abs(float(result["answers"][0]["error"]["value"]) + 7.3e-5) < 1e-6  # of 3.08277 s
    rows = rows_of(out)
    assert [row["period"] for row in rows] == [row["period"]["value"] for row in result["rows"]]
    assert "error [s]" not in printed(f"{words} --out {tmp_path / 'near.png'}")
    assert (tmp_path / "near.png").read_bytes().startswith(b"\x89PNG")
    answers.write_text("omega,period\n30.05,3.0827\n30.06,x\n")
    refused = ran(f"{words} --answers {answers}".split())
    assert refused.status == 2
    assert "answers.csv, line 3: 'x' is not a finite decimal number" in refused.err
