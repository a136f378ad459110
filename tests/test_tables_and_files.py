"""Results in other tools: data frames, saved files, parameter files and paths of every kind."""

from __future__ import annotations

import csv
import sys
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy
import pytest

import tippedisk_verify as tv
from tippedisk_verify.cli import main

DISK, START = tv.Disk("table1"), ("pi/2", "pi/2 + 0.4", 0)
HOPF = "table1/linear/hopf/point"


def _table(path: Path) -> list[dict[str, str]]:
    with open(path, encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def _assert_as_written(frame: Any, path: Path) -> None:
    """Check that a data frame has the columns of a file, and numbers that its half-widths hold."""
    written = _table(path)
    assert set(frame.columns) == set(written[0])
    assert len(frame) == len(written)
    for name in (name for name in frame.columns if f"{name}_uncertainty" in frame.columns):
        for n, row in enumerate(written):
            if row[name]:
                number = tv.Measured.of(row[name], row[f"{name}_uncertainty"])
                width = Fraction(float(frame[f"{name}_uncertainty"][n]))
                off = abs(number.value - Fraction(float(frame[name][n])))
                assert off <= width + number.uncertainty, (name, row)


# -------------------------------------------------------------------------------------- data frames
def test_a_solutions_data_frame_has_its_arrays_under_the_files_names(tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    solution = DISK.integrate("30.4", START, 1)
    frame = solution.to_dataframe()
    assert (frame["gamma"].to_numpy() == solution.y[1]).all()
    assert (frame["v_uncertainty"].to_numpy() == solution.uncertainty[2]).all()
    out = tmp_path / "motion.csv"
    words = "integrate --omega 30.4 --state pi/2,pi/2+0.4,0 --time 1 --times 201 --quiet --out"
    assert main([*words.split(), str(out)]) == 0
    _assert_as_written(frame, out)


def test_a_branchs_data_frame_has_a_row_for_a_missing_cycle(tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    branch, out = DISK.branch(["30.4", "31"]), tmp_path / "branch.csv"
    frame = branch.to_dataframe()
    assert main(["branch", "--omegas", "30.4,31", "--quiet", "--out", str(out)]) == 0
    _assert_as_written(frame, out)
    assert numpy.isnan(frame["period"][1])
    assert frame["status"][1] == branch.missing[0].status
    # The double next to 30.4 is not 30.4.
    assert Fraction(float(frame["omega_uncertainty"][0])) >= abs(Fraction(30.4) - Fraction("30.4"))
    assert frame["omega_uncertainty"][0] > 0


def test_the_data_frame_next_to_omega_h_has_the_laws_in_columns(tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    out = tmp_path / "near.csv"
    assert main(["heteroclinic", "--near", "1e-2:1e-3:2", "--quiet", "--out", str(out)]) == 0
    frame = DISK.near_heteroclinic(["1e-2", "1e-3"]).to_dataframe()
    # A number without a half-width, which the file leaves out
    _assert_as_written(frame.drop(columns="double_resolves"), out)


def test_grades_and_scores_are_rows() -> None:
    pytest.importorskip("pandas")
    report = tv.grade({f"{HOPF}/omega_crit": 30.88659268864, f"{HOPF}/period": 0.9})
    assert report.to_dataframe().to_dict("records") == [g.to_dict() for g in report.grades]
    race = tv.race({}, against=["taylor"])
    frame = race.to_dataframe()
    assert list(frame["error"]) == [score.error for score in race.scores]
    assert set(frame["method"]) == {"taylor"}


@pytest.mark.parametrize(
    "result",
    [
        lambda: DISK.integrate("30.4", START, 1),
        lambda: DISK.branch(["30.4"]),
        lambda: tv.grade({f"{HOPF}/period": 0.9}),
        lambda: tv.Race(()),
    ],
    ids=["solution", "branch", "grades", "race"],
)
def test_without_pandas_a_data_frame_is_refused_in_one_line(
    result: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(tv.InputError, match=r"^a data frame needs pandas: pip install pandas$"):
        result().to_dataframe()
