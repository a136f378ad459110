"""Every way to a limit cycle finds the same ones, next to the Hopf point too; a speed without
one loses no other.
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest

import tippedisk_verify as tv
from tests.command_line import answer, printed, rows_of
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.numbers.measured import Measured

#: Speeds [rad/s] between the Hopf point and the family's first node, at a node's distance and far
#: away.
SPEEDS = ["30.886592", "30.88659258", "30.8865915", "30.4"]
#: Speeds without a cycle: above Omega_crit, and below Omega_h.
EMPTY = ["30.8866", "31.4", "30"]


@pytest.mark.parametrize(
    ("law", "speeds"),
    [
        ("linear", SPEEDS[::3]),
        *(
            pytest.param(law, SPEEDS, marks=pytest.mark.slow(minutes=0.3))
            for law in ("linear", "smooth")
        ),
    ],
    ids=["two speeds", "linear", "smooth"],
)
def test_branch_sweep_and_limit_cycle_find_the_same(
    law: str, speeds: list[str], tmp_path: Path
) -> None:
    disk, table = tv.Disk("table1", friction=law), tmp_path / "sweep.csv"
    branch = disk.branch(speeds)
    assert not branch.missing
    axis = f"omega={','.join(speeds)}"
    printed(f"sweep orbit --over {axis} --out {table} --friction {law} --jobs 1")
    rows = rows_of(table)
    for speed, cycle, row in zip(speeds, branch.cycles, rows, strict=True):
        alone = disk.limit_cycle(speed)
        for name in ("period", "gamma_bar_0", "v_0", "beta_max", "multiplier_slow"):
            swept = Measured.of(row[name], row[f"{name}_uncertainty"])
            assert (getattr(cycle, name) - getattr(alone, name)).holds(0), (speed, name)
            assert (swept - getattr(alone, name)).holds(0), (speed, name)


def test_a_long_list_keeps_all_others(tmp_path: Path) -> None:
    """A hundred speeds are solved together. One lies between the Hopf point and the first node;
    some have no cycle.
    """
    speeds = [f"{30.1 + 0.007 * n:.3f}" for n in range(110)]
    asked = [*speeds[:50], "30.886592", *EMPTY, *speeds[50:]]
    branch = tv.Disk("table1").branch(asked, progress=False)
    assert len(branch) == len(asked)
    assert [float(row.omega) for row in branch.missing] == [float(speed) for speed in EMPTY]
    assert [n for n, period in enumerate(branch.period) if period != period] == [51, 52, 53]
    assert branch.uncertainty["omega"].max() < 2.0**-48  # of a decimal as a double: half an ulp
    assert all("no limit cycle found" in row.status for row in branch.missing)
    table = tmp_path / "branch.csv"
    some = ["30.4", *EMPTY, "30.5"]
    orbits = answer(f"branch --omegas {','.join(some)} --out {table}")["orbits"]
    assert ["status" in entry for entry in orbits] == [False, True, True, True, False]
    assert [orbits[n]["omega"]["value"] for n in (0, -1)] == ["30.4", "30.5"]
    rows = rows_of(table)
    assert [row["omega"] for row in rows] == some
    assert (
        [row["status"] == "ok" for row in rows]
        == [bool(row["period"]) for row in rows]
        == [True, *[False] * 3, True]
    )
    with pytest.raises(NoSuchCycleError, match=r"31\.4"):
        tv.Disk("table1").branch(["31.4", "31.5"])


# --------------------------------------------------------------------------- next to the Hopf point
def _slow(distance: str) -> object:
    return pytest.param(distance, marks=pytest.mark.slow(minutes=0.5))


@pytest.mark.parametrize("distance", ["1e-14", *map(_slow, ("1e-16", "1e-40"))])
@pytest.mark.slow
def test_a_cycle_next_to_the_hopf_point_follows_the_normal_form(distance: str) -> None:
    """The law gamma_bar_0^2 = (Omega - Omega_crit) / c_1 and the period's law hold to their next
    order, which is the distance times a few, and the numbers' half-widths.
    """
    disk = tv.Disk("table1")
    hopf, cycle, below = (
        disk.hopf(digits=60),
        disk.limit_cycle(below_crit=distance),
        Fraction(distance),
    )
    for name, law in (
        ("gamma_bar_0", (-below / hopf.quadratic_coefficient).sqrt()),
        ("period", hopf.period + hopf.period_slope * below),
        ("log_multiplier_slow", -2 * (hopf.transversality * -2 * below * hopf.period / 2)),
    ):
        found = getattr(cycle, name)
        assert found.uncertainty <= abs(found.value) / 10**12  # twelve digits are the default
        away = abs(found.value - law.value) - found.uncertainty
        assert away < 10 * below * abs(law.value), name
    assert cycle.stable


def test_closer_than_offered_says_how_close() -> None:
    with pytest.raises(
        tv.AccuracyError, match="down to 1e-100 rad/s from Omega_crit: ask for one farther away"
    ):
        tv.Disk("table1").limit_cycle(below_crit="1e-200")
