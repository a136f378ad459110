"""Results in other tools: data frames, saved files, parameter files and paths of every kind."""

from __future__ import annotations

import json
import sys
from dataclasses import fields
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy
import pytest
from matplotlib.figure import Figure

import tippedisk_verify as tv
from tests.command_line import printed, rows_of
from tippedisk_verify.bench.measurement import Score
from tippedisk_verify.figures.style import pyplot
from tippedisk_verify.omega_h.distance_study import PERIOD_LAW_COLUMNS

DISK, START = tv.Disk("table1"), ("pi/2", "pi/2 + 0.4", 0)
HOPF = "table1/linear/hopf/point"
NUMBERS = [field.name for field in fields(Score)][5:]  # after the texts


def _assert_as_written(frame: Any, path: Path) -> None:
    """Check that a data frame has the columns of a file, and numbers that its half-widths hold."""
    written = rows_of(path)
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
with_pandas = pytest.mark.skipif(find_spec("pandas") is None, reason="needs pandas")


@with_pandas
def test_a_solutions_data_frame_has_its_arrays_under_the_files_names(tmp_path: Path) -> None:
    solution = DISK.integrate("30.4", START, 1)
    frame = solution.to_dataframe()
    assert (frame["gamma"].to_numpy() == solution.y[1]).all()
    assert (frame["v_uncertainty"].to_numpy() == solution.uncertainty[2]).all()
    out = tmp_path / "motion.csv"
    words = "integrate --omega 30.4 --state pi/2,pi/2+0.4,0 --time 1 --times 201 --quiet"
    printed(f"{words} --out {out}")
    _assert_as_written(frame, out)


@with_pandas
def test_a_branchs_data_frame_has_a_row_for_a_missing_cycle(tmp_path: Path) -> None:
    branch, out = DISK.branch(["30.4", "31"]), tmp_path / "branch.csv"
    frame = branch.to_dataframe()
    printed(f"branch --omegas 30.4,31 --quiet --out {out}")
    _assert_as_written(frame, out)
    assert numpy.isnan(frame["period"][1])
    assert frame["status"][1] == branch.missing[0].status
    # The double next to 30.4 is not 30.4.
    assert Fraction(float(frame["omega_uncertainty"][0])) >= abs(Fraction(30.4) - Fraction("30.4"))
    assert frame["omega_uncertainty"][0] > 0


@with_pandas
def test_the_data_frame_next_to_omega_h_has_the_laws_in_columns() -> None:
    (row,) = (study := DISK.near_heteroclinic(["1e-2"])).rows
    (line,) = study.to_dataframe().to_dict("records")
    assert (line["period"], line["double_resolves"]) == (float(row.period), row.double_resolves)
    assert [line[name] for name in PERIOD_LAW_COLUMNS] == [float(number) for number in row.law]
    # Twelve digits of a period of some seconds
    assert row.law[2].uncertainty <= line["law_of_three_terms_uncertainty"] < 1e-11


@with_pandas
def test_grades_and_scores_are_rows() -> None:
    report = tv.grade({f"{HOPF}/omega_crit": 30.88659268864, f"{HOPF}/period": 0.9})
    assert report.to_dataframe().to_dict("records") == [g.to_dict() for g in report.grades]
    what = {"problem": "cycle", "method": "mine", "family": "own", "setting": "1e-6"}
    scores = (
        Score(**what, status="reached", **dict.fromkeys(NUMBERS, 1e-7)),
        Score(**what, status="gave up", **dict.fromkeys(NUMBERS)),
    )
    frame = tv.Race(scores).to_dataframe()
    assert list(frame["status"]) == ["reached", "gave up"]
    assert (frame["error"][0], numpy.isnan(frame["error"][1])) == (1e-7, True)


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


# -------------------------------------------------------------------------------------- saved files
LEVEL = tv.Event("level", lambda t, y: y[2] - 0.1, terminal=True)
SMOOTH = tv.Disk("geometry", mu="0.31", B=Fraction(1, 4403), friction="smooth")
SOLUTIONS = {
    "doubles": lambda: DISK.integrate(
        DISK.omega_crit - 0.5, START, 3, variations=("state", "omega")
    ),
    "recorded": lambda: DISK.integrate("30.4", START, 3, events=("section", "turn")),
    "extended": lambda: DISK.integrate("30.4", START, (1, 2), digits=16),
    "wide": lambda: SMOOTH.integrate(
        "30.4", START, 1, digits=20, t_eval=["1/3", "pi/4", 1], events="section"
    ),
    "quadruple": lambda: DISK.integrate("30.4", START, "0.1", digits=18),
    "no sample": lambda: DISK.integrate("30.4", ("0.5", 0, -5), 10, t_eval=[9]),
    "ended": lambda: DISK.integrate("30.4", START, (5, 10), events=LEVEL),
    "unmeasured": lambda: DISK.integrate("30.4", START, 1, half_widths=False),
}
CYCLES = {
    "librating": lambda: DISK.limit_cycle(below_crit="0.5"),
    "wide": lambda: SMOOTH.limit_cycle("30.4", digits=30),
    "rotating": lambda: DISK.rotating_cycle("30.5", stable=False),
    "next to Omega_h": lambda: DISK.limit_cycle(above_het="1e-20"),
    "unmeasured": lambda: DISK.limit_cycle("30.4", half_widths=False),
}


def _assert_identical(one: Any, other: Any) -> None:
    """Check that two numbers or arrays have the same type and are equal."""
    assert type(one) is type(other)
    numpy.testing.assert_array_equal(one, other, strict=True)


@pytest.mark.parametrize("kind", SOLUTIONS)
def test_a_loaded_solution_has_equal_numbers(kind: str, tmp_path: Path) -> None:
    solution = SOLUTIONS[kind]()
    loaded = tv.load(solution.save(tmp_path / "motion.json"))
    for name in ("t", "y", "uncertainty", "transition", "transition_uncertainty", "by_omega"):
        _assert_identical(getattr(solution, name), getattr(loaded, name))
    pairs = zip((solution.end, *solution.events), (loaded.end, *loaded.events), strict=True)
    for record, other in pairs:
        assert record.name == other.name
        for name in ("time", "state", "uncertainty"):
            _assert_identical(getattr(record, name), getattr(other, name))
        assert record.time_uncertainty == other.time_uncertainty
    assert tuple(loaded.times) == tuple(solution.times)
    assert (loaded.disk, loaded.to_dict()) == (solution.disk, solution.to_dict())
    assert repr(loaded) == repr(solution)
    again = loaded.save(tmp_path / "again.json")
    assert again.read_bytes() == (tmp_path / "motion.json").read_bytes()
    with pytest.raises(tv.InputError, match="has its samples only: integrate again"):
        loaded("0.5")


@pytest.mark.parametrize("kind", CYCLES)
def test_a_loaded_cycle_equals_the_saved_one(kind: str, tmp_path: Path) -> None:
    cycle = CYCLES[kind]()
    loaded = tv.load(cycle.save(tmp_path / "cycle.json"))
    assert type(loaded) is type(cycle)
    assert loaded == cycle
    assert (loaded.orbit(3)[1] == cycle.orbit(3)[1]).all()


def test_a_saved_number_is_a_decimal_that_another_program_reads(tmp_path: Path) -> None:
    cycle = DISK.limit_cycle("30.4")
    solution = DISK.integrate("30.4", START, 1, t_eval=["1/3", 1])
    saved, motion = (
        json.loads(result.save(tmp_path / "x.json").read_text()) for result in (cycle, solution)
    )
    assert Fraction(saved["period"]["value"]) == cycle.period.value
    assert Fraction(saved["period"]["uncertainty"]) == cycle.period.uncertainty
    assert Fraction(saved["disk"]["r"]) == DISK.r
    assert motion["t"]["numbers"] == ["1/3", "1"]
    assert [Fraction(x) for x in motion["y"]["numbers"][1]] == [Fraction(x) for x in solution.y[1]]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda text: "{", "is not a file with the format 'tippedisk-verify result 1'"),
        (lambda text: "[" * 10**5, "is not a file with the format"),
        (lambda text: text.replace("result 1", "result 0"), "is not a file with the format"),
        (lambda text: text.replace('"LimitCycle"', '"Orbit"'), "KeyError: 'Orbit'"),
        (lambda text: text.replace('"period"', '"perio"'), "KeyError: 'period'"),
        (lambda text: text.replace('"30.4"', '"thirty"'), "is damaged, or not a saved result"),
        (lambda text: text.replace('"30.4"', '"1e99999"'), "a decimal exponent beyond"),
        (lambda text: text.replace('"30.4"', '"1/0"'), "ZeroDivisionError"),
        (lambda text: text.replace('"0.045"', '"-1"'), "parameter r must be positive"),
    ],
)
def test_a_damaged_file_is_refused_in_one_line(change: Any, reason: str, tmp_path: Path) -> None:
    path = DISK.limit_cycle("30.4").save(tmp_path / "cycle.json")
    path.write_text(change(path.read_text()))
    with pytest.raises(tv.InputError, match=reason) as fault:
        tv.load(path)
    assert "\n" not in str(fault.value)


OWN = tv.FrictionLaw("own", lambda ops, gamma_y, c: -c.mu * c.m * c.g * gamma_y / c.epsilon)


@pytest.mark.parametrize(
    ("result", "name", "reason"),
    [
        (lambda: DISK.limit_cycle("30.4"), "x.csv", r"x\.csv' must end in \.json"),
        (lambda: DISK.integrate("30.4", START, 1), "x.csv", r"x\.csv' must end in \.json"),
        (
            lambda: tv.Disk("table1", friction=OWN).integrate("30.4", START, "0.1"),
            "x.json",
            "saved for the paper's friction laws only, not for",
        ),
    ],
)
def test_what_is_not_saved_has_a_reason(
    result: Any, name: str, reason: str, tmp_path: Path
) -> None:
    with pytest.raises(tv.InputError, match=reason):
        result().save(tmp_path / name)
    assert not list(tmp_path.iterdir())


# ----------------------------------------------------------------------------------- plots and paths
def test_a_solution_plots_its_states_and_events(tmp_path: Path) -> None:
    solution = DISK.integrate("30.4", START, 1, events="section")
    for drawn in (solution, tv.load(solution.save(tmp_path / "motion.json"))):
        figure = drawn.plot()
        for row, axis in enumerate(figure.axes):
            curve, dots = axis.lines
            ends = solution.y[row, [0, -1]]
            # The curve is the run's continuous output, and the samples are rounded once more.
            assert curve.get_ydata()[[0, -1]] == pytest.approx(ends, abs=1e-12)
            assert list(dots.get_xdata()) == [float(record.time) for record in solution.events]
            assert list(dots.get_ydata()) == [record.state[row] for record in solution.events]
        pyplot().close(figure)
    empty = SOLUTIONS["no sample"]().plot()
    assert not empty.axes[0].lines[0].get_xdata().size
    pyplot().close(empty)


def test_every_plot_returns_its_figure() -> None:
    race = tv.race({}, problems="transient", against="taylor", progress=False)
    drawn = [
        DISK.integrate("30.4", START, 1),
        DISK.limit_cycle("30.4"),
        DISK.branch(["30.4", "30.5"]),
        DISK.near_heteroclinic(["1e-2"]),
        race,
    ]
    for result in drawn:
        figure = result.plot()
        assert isinstance(figure, Figure)
        assert any(axes.lines for axes in figure.axes)
        pyplot().close(figure)


@pytest.mark.parametrize("disk", [DISK, tv.Disk("calibrated"), SMOOTH, DISK.changed(e=1 / 400)])
def test_a_disk_is_written_as_the_file_that_gives_it_back(
    disk: tv.Parameters, tmp_path: Path
) -> None:
    text = disk.to_toml(tmp_path / "disk.toml")
    assert (tmp_path / "disk.toml").read_text() == text
    again = tv.Disk.read(tmp_path / "disk.toml", friction=disk.friction)
    assert (again, again.C) == (disk, disk.C)


@pytest.fixture
def files(tmp_path: Path) -> dict[str, Path]:
    """Write a file of each kind that a function reads."""
    DISK.to_toml(tmp_path / "disk.toml")
    answers = "problem,setting,seconds,error\ncycle,1,1e-3,1e-8\n"
    (tmp_path / "mine.csv").write_text(answers)
    DISK.limit_cycle("30.4").save(tmp_path / "cycle.json")
    return {name: tmp_path / name for name in ("disk.toml", "mine.csv", "cycle.json", "new.json")}


@pytest.mark.parametrize("kind", [str, Path])
def test_a_file_is_named_by_a_text_or_a_path(kind: Any, files: dict[str, Path]) -> None:
    path = {name: kind(file) for name, file in files.items()}
    calls: list[tuple[Any, str]] = [
        (tv.Disk, "disk.toml"),
        (tv.Disk.read, "disk.toml"),
        (tv.Parameters.named, "disk.toml"),
        (tv.Parameters.from_toml, "disk.toml"),
        (tv.load, "cycle.json"),
        (DISK.to_toml, "new.json"),
        (DISK.limit_cycle("30.4").save, "new.json"),
        (DISK.integrate("30.4", START, 1).save, "new.json"),
        (lambda file: tv.race({}, against=[], answers=[file]), "mine.csv"),
    ]
    for call, name in calls:
        assert call(path[name])
        if name == "new.json":
            assert files["new.json"].stat().st_size
            files["new.json"].unlink()
    assert [tv.Disk(path["disk.toml"]), tv.Disk.read(path["disk.toml"])] == [DISK, DISK]
    with pytest.raises(tv.InputError, match="there is no folder"):
        DISK.to_toml(kind(files["new.json"] / "disk.toml"))
