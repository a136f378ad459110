"""The family of limit cycles: the paper's sets, single speeds and the table that is written."""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise

import numpy
import pytest
from matplotlib.figure import Figure

import tippedisk_verify as tv
from tippedisk_verify import GEOMETRY, PRINTED, Disk, InputError, bisect_omega_h, omega_crit
from tippedisk_verify.cycles.branch import Branch
from tippedisk_verify.cycles.branch_cycles import librating_branch, paper_speeds
from tippedisk_verify.cycles.cycle_at_speed import librating_cycle_at
from tippedisk_verify.cycles.locator import cached_locator


def test_paper_sets_follow_their_rule(taylor) -> None:
    omega_h = bisect_omega_h(PRINTED, taylor).omega_h.value
    start, *speeds = paper_speeds(PRINTED, omega_h)
    assert len(speeds) == 800
    crit = float(omega_crit(PRINTED, 20))
    for end, steps in ((crit, speeds[:400]), (float(omega_h), speeds[400:])):
        for before, after in pairwise((start, *steps)):
            # The recursion in double: an ulp of Omega, 3.6e-15, per step.
            assert abs(after - (before + (end - before) / 100)) < 1e-14


def test_cycles_are_those_of_single_speeds_where_the_family_is_lost(taylor, monkeypatch) -> None:
    monkeypatch.setitem(
        cached_locator(GEOMETRY, taylor).__dict__,
        "family_failure",
        "the family could not be followed",
    )
    (cycle,) = librating_branch(GEOMETRY, taylor, omegas=["30.4"])
    assert cycle == librating_cycle_at(GEOMETRY, "30.4", taylor)
    assert [point.name for point in Branch.of([cycle]).points] == ["Omega_crit"]
    (missing,) = librating_branch(GEOMETRY, taylor, omegas=["31.5"])
    assert "could not be followed" in missing.status


# ---------------------------------------------------------------- special points and the diagram
@lru_cache(maxsize=1)
def _folded() -> Branch:
    """An overview of a family that is born unstable and becomes stable at a fold."""
    return Disk("table1", A="0.229e-3").branch()


@pytest.mark.slow
def test_special_points_are_those_of_their_own_methods() -> None:
    branch = _folded()
    disk = Disk("table1", A="0.229e-3")
    born, fold, connection = branch.points
    assert [point.name for point in branch.points] == ["Omega_crit", "fold 1", "Omega_h"]
    assert (born.omega - disk.omega_crit).holds(0)
    assert (born.period - disk.hopf().period).holds(0)
    assert (fold.omega, fold.period) == (disk.folds()[0].omega, disk.folds()[0].period)
    assert (connection.omega - disk.heteroclinic().omega_h).holds(0)
    assert connection.period is None
    assert connection.gamma_bar_0.holds(tv.precision_of_bits(200).pi)


def test_stability_changes_at_the_fold_alone() -> None:
    branch = _folded()
    fold = branch.points[1]
    for cycle, stable in zip(branch.cycles, branch.stable, strict=True):
        assert stable is (cycle.gamma_bar_0 > fold.gamma_bar_0)
        assert cycle.omega < fold.omega


def test_a_branch_restarts_from_each_point_that_it_goes_on_from() -> None:
    branch = _folded()
    first = branch.restart("Omega_crit", 4)
    second = branch.restart(branch.points[1], 3)
    assert (first.stable, second.stable) == ((False,) * 4, (True,) * 3)
    assert (numpy.diff([*first.gamma_bar_0, *second.gamma_bar_0]) > 0).all()
    for point, count in (("Omega_h", 4), ("fold 2", 4), (3, 4), ("fold 1", 1), ("fold 1", "many")):
        with pytest.raises(InputError):
            branch.restart(point, count)


def test_the_diagram_is_solid_where_stable_and_dashed_where_not() -> None:
    branch = _folded()
    amplitude, period = branch.plot(Figure().subplots(1, 2)).axes
    born, fold, connection = branch.points
    for axis, name in ((amplitude, "beta_max"), (period, "period")):
        unstable, stable = (
            next(line for line in axis.lines if line.get_label() == f"{kind} cycles")
            for kind in ("unstable", "stable")
        )
        assert (unstable.get_linestyle(), stable.get_linestyle()) == ("--", "-")
        at_fold = [float(fold.omega), float(getattr(fold, name))]
        at_birth = [float(born.omega), float(getattr(born, name))]
        points = unstable.get_xydata().tolist()
        assert (points[0], points[-1]) == (at_birth, at_fold)
        assert stable.get_xydata()[0].tolist() == at_fold
        assert len(points) + len(stable.get_xydata()) == len(branch) + 3
        assert {text.get_text() for text in axis.texts} == {"Hopf point", "fold 1", "$Ω_h$"}
        assert axis.get_xlim()[0] < float(connection.omega)
    rest = [line for line in amplitude.lines if not any(line.get_ydata())]
    assert [line.get_linestyle() for line in rest[:2]] == ["--", "-"]


def test_a_branch_of_few_cycles_joins_no_distant_point() -> None:
    branch = Disk("table1").branch(["30.5", "30.4", "31"])
    assert branch.stable == (True, True, None)
    _, period = branch.plot(Figure().subplots(1, 2)).axes
    (line,) = (line for line in period.lines if line.get_label() == "stable cycles")
    assert sorted(line.get_xdata()) == [30.4, 30.5]


# ------------------------------------------------------------------------------- a cycle at a time
@pytest.mark.parametrize("kind", ["librating", "rotating"])
def test_a_cycle_at_a_time_is_its_orbit_and_periodic(kind: str) -> None:
    disk = Disk("table1")
    cycle = disk.limit_cycle("30.4") if kind == "librating" else disk.rotating_cycle("30.03")
    t, y = cycle.orbit(41)
    # Two runs of one start: some hundred roundings of v and gamma, which are of order 10
    assert numpy.allclose(cycle(t[:-1]), y[:, :-1], rtol=0, atol=1e-12)
    period = float(cycle.period)
    turns = numpy.array([[0], [2 * math.pi * (kind == "rotating")], [0]])
    # Rounding of the time, times the largest rate of some hundred
    for laps in (-2, 1, 3):
        assert numpy.allclose(cycle(t[1:-1] + laps * period), y[:, 1:-1] + laps * turns, atol=1e-11)
    since = float(t[7])
    start = [float(x) for x in y[:, 0]]
    flown = disk.integrate(cycle.omega, start, since).end.state
    # The start as doubles, times the growth of its rounding within a period, some thousand
    assert numpy.allclose(cycle(since), flown, rtol=0, atol=1e-10)
    with pytest.raises(InputError):
        cycle([0.1, math.inf])
