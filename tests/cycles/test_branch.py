"""The family of limit cycles: the paper's sets, single speeds and the table that is written."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from pathlib import Path

from matplotlib.figure import Figure

from tests.command_line import answer, rows_of
from tippedisk_verify.connection.bisection import bisect_omega_h
from tippedisk_verify.cycles.at_speed import cycle_at
from tippedisk_verify.cycles.branch import Branch, family, paper_speeds
from tippedisk_verify.cycles.locator import locator
from tippedisk_verify.model.parameters import GEOMETRY, PRINTED
from tippedisk_verify.theory.hopf import omega_crit


def test_paper_sets_follow_their_rule(taylor) -> None:
    omega_h = bisect_omega_h(PRINTED, taylor).omega_h.value
    start, *speeds = paper_speeds(PRINTED, omega_h)
    assert len(speeds) == 800
    crit = float(omega_crit(PRINTED, 20))
    for end, steps in ((crit, speeds[:400]), (float(omega_h), speeds[400:])):
        for before, after in pairwise((start, *steps)):
            # The recursion in double: an ulp of Omega, 3.6e-15, per step.
            assert abs(after - (before + (end - before) / 100)) < 1e-14


def test_command(tmp_path: Path) -> None:
    out = tmp_path / "branch.csv"
    result = answer(f"branch --omegas 30.6,30.4 --out {out}")
    assert [float(orbit["omega"]["value"]) for orbit in result["orbits"]] == [30.6, 30.4]
    rows = rows_of(out)
    assert rows[1]["period"] == result["orbits"][1]["period"]["value"]


def test_the_family_has_the_cycles_of_single_speeds_next_to_omega_crit(taylor) -> None:
    # 7e-7 and 1e-7 rad/s below Omega_crit: the family's course ends before these speeds.
    speeds = ["30.886592", "30.88659258"]
    for cycle, speed in zip(family(GEOMETRY, taylor, omegas=speeds), speeds, strict=True):
        assert cycle.omega == Fraction(speed)
        assert (cycle.period - cycle_at(GEOMETRY, speed, taylor).period).holds(0)


def test_cycles_are_those_of_single_speeds_where_the_family_is_lost(taylor, monkeypatch) -> None:
    monkeypatch.setitem(
        locator(GEOMETRY, taylor).__dict__, "lost", "the family could not be followed"
    )
    (cycle,) = family(GEOMETRY, taylor, omegas=["30.4"])
    assert cycle == cycle_at(GEOMETRY, "30.4", taylor)
    (line,) = Branch.of([cycle]).plot(Figure().subplots()).lines
    assert line.get_xydata().tolist() == [[30.4, float(cycle.period)]]
    (missing,) = family(GEOMETRY, taylor, omegas=["31.5"])
    assert "could not be followed" in missing.status
