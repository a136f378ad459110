"""Every number that a command writes, read as a decimal: its half-width holds what a run with
more digits says.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

import tippedisk_verify as tv
from tests.command_line import answer, printed, rows_of
from tippedisk_verify.flow.contract import GAMMA_TOP
from tippedisk_verify.motion.scenes import INITIAL_STATES
from tippedisk_verify.omega_h.connecting_orbit import _START_DISTANCE
from tippedisk_verify.theory.saddle_manifolds import Saddle

DISK = tv.Disk("table1")


def _slow(words: str) -> object:
    return pytest.param(words, marks=pytest.mark.slow(minutes=0.5))


#: Commands whose JSON is compared with that of the same command to 24 digits.
SAID = [
    "equilibria --omega 30.4",
    "hopf",
    "slow-manifold --order 2 --beta 1.2 --gamma 0.7 --omega 30.4",
    "harmonic-balance --omega 30.4 --harmonics 3",
    "orbit --omega 30.4",
    "orbit --omega 30.4 --friction smooth --parameters calibrated",
    *(f"orbit --below-crit {distance}" for distance in ("0.5", "1e-3", "1/3")),
    *(
        _slow(f"orbit --below-crit {distance}")
        for distance in ("1e-9", "1e-30", "0.837724427921066")
    ),
    "orbit --rotating --omega 30.02",
    "heteroclinic",
    "integrate --omega 30.4 --state pi/2,2,0 --time 3 --events section,turn",
    # Even times that are not doubles, a late start, a ratio, both laws, 20 digits, backward
    "integrate --omega 30.860 --state 1.270,1.846,0.64 --time 0.45 --times 4",
    "integrate --omega 30.4 --state pi/2,pi/2+0.4,0 --time 1000,1003 --times 31",
    "integrate --omega 30.4 --state pi/2,pi/2+0.4,0 --time 1/3 --times 4",
    "integrate --omega 30.4 --state 1.2,2,0 --time 0.7 --times 8 --friction smooth",
    "integrate --omega 30.4 --state 1.2,2,0 --time 0.7 --times 8 --digits 20",
    "integrate --omega 30.4 --state 1.2,2,0 --time 0,-0.05 --times 3",
]
#: Commands whose tables are compared with those of the same command to 24 digits.
SWEPT = [
    "sweep orbit --over omega=30.3,30.6",
    "sweep equilibria --over omega=30.3,30.6 --over mu=0.2,0.3",
    "sweep hopf --over mu=0.2,0.35",
    pytest.param("sweep heteroclinic --over mu=0.3,0.35", marks=pytest.mark.slow(minutes=0.1)),
    "sweep trajectory --over omega=30.3 --over gamma=2,2.1 --over duration=0.7,2",
]


def _pairs(few: Any, many: Any, where: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Yield the numbers of two answers of the same form, by their place."""
    if isinstance(few, dict) and "uncertainty" in few:
        yield where, few, many
    elif isinstance(few, dict):
        for name in few.keys() & many.keys():
            yield from _pairs(few[name], many[name], f"{where}.{name}")
    elif isinstance(few, list) and isinstance(many, list) and len(few) == len(many):
        for number, pair in enumerate(zip(few, many, strict=True)):
            yield from _pairs(*pair, f"{where}[{number}]")


def _assert_held(value: str, width: str, truth: str, doubt: str, where: str) -> None:
    away = abs(Fraction(value) - Fraction(truth))
    assert away <= Fraction(width) + Fraction(doubt), (where, value, width, truth)


@pytest.mark.parametrize("words", SAID)
def test_what_a_command_says_holds_what_it_says_with_more_digits(words: str) -> None:
    answers = [answer(f"{words} --quiet {more}") for more in ("", "--digits 24")]
    compared = 0
    for where, few, many in _pairs(*answers):
        if None not in (few["uncertainty"], many["uncertainty"]) and "defect" not in where:
            _assert_held(
                few["value"], few["uncertainty"], many["value"], many["uncertainty"], where
            )
            compared += 1
    assert compared > 1


@pytest.mark.parametrize("words", SWEPT)
def test_a_sweeps_table_holds_that_with_more_digits(words: str, tmp_path: Path) -> None:
    tables = []
    for digits in ("12", "24"):
        out = tmp_path / f"{digits}.csv"
        printed(f"{words} --out {out} --digits {digits} --executor serial --quiet")
        tables.append(rows_of(out))
    for few, many in zip(*tables, strict=True):
        widths = [name for name in few if name.endswith("_uncertainty")]
        assert widths
        for name in widths:
            value = name.removesuffix("_uncertainty")
            _assert_held(few[value], few[name], many[value], many[name], value)


@pytest.mark.parametrize(
    ("kind", "omega"),
    [("", "30.886592"), pytest.param("--rotating", "30.5", marks=pytest.mark.slow)],
)
def test_a_branchs_table_holds_the_cycles_with_more_digits(
    kind: str, omega: str, tmp_path: Path
) -> None:
    out = tmp_path / "branch.csv"
    printed(f"branch {kind} --omegas {omega} --out {out} --quiet")
    for row in rows_of(out):
        stable = row["stable"] == "True"
        if kind:
            truth = DISK.rotating_cycle(omega, stable=stable, digits=24)
        else:
            truth = DISK.limit_cycle(omega, stable=stable, digits=24)
        for name in (name for name in row if f"{name}_uncertainty" in row and "defect" not in name):
            _assert_held(
                row[name], row[f"{name}_uncertainty"], *getattr(truth, name).decimals(), name
            )


@pytest.mark.parametrize("friction", ["linear", "smooth"])
@pytest.mark.slow(minutes=0.2)
def test_the_connections_table_holds_a_run_at_a_sharper_omega_h(
    friction: tv.Friction, tmp_path: Path
) -> None:
    out = tmp_path / "connection.csv"
    printed(f"heteroclinic --friction {friction} --out {out} --quiet")
    rows = rows_of(out)[::40]
    disk = tv.Disk("table1", friction=friction)
    omega_h = disk.heteroclinic(digits=30).omega_h.value
    start = Saddle(disk, omega_h, 180, 8).start_on_unstable_manifold(_START_DISTANCE)
    found = disk.integrate(omega_h, start, 4, events=GAMMA_TOP, shifted=True, digits=25)
    middle = tv.exact(found.events[0].time).rational
    times = [Fraction(row["t"]) + middle for row in rows]
    times[0] = max(times[0], Fraction(0))
    truth = disk.integrate(omega_h, start, times[-1], t_eval=times, shifted=True, digits=25)
    upright = [tv.exact("pi/2"), tv.exact("pi/2"), tv.exact(0)]
    for row, state in zip(rows, truth.y.T, strict=True):
        for name, number, angle in zip(("beta", "gamma", "v"), state, upright, strict=True):
            shown = Fraction((tv.exact(number) + angle).bounds(200)[0])
            _assert_held(
                row[name], row[f"{name}_uncertainty"], str(shown), "1e-30", f"{name} at {row['t']}"
            )


@pytest.mark.parametrize(
    "scene", ["f", *(pytest.param(scene, marks=pytest.mark.slow(minutes=0.1)) for scene in "ad")]
)
def test_a_scenes_tables_are_right_to_their_last_decimal(scene: str, tmp_path: Path) -> None:
    printed(f"scene {scene} --out {tmp_path} --quiet")
    omega = DISK.scene(scene).omega.value
    for number, start in enumerate(INITIAL_STATES, start=1):
        rows = rows_of(tmp_path / f"scene_{scene}_orbit_{number}.csv")[1::100]
        times = [Fraction(row["t [s]"]) for row in rows]
        truth = DISK.integrate(omega, start, times[-1], t_eval=times, digits=16)
        for row, state in zip(rows, truth.y.T, strict=True):
            for name, true in zip(("beta [rad]", "gamma [rad]", "v [rad/s]"), state, strict=True):
                _assert_held(  # to ten decimals
                    row[name],
                    "1e-10",
                    str(tv.exact(true).rational),
                    "0",
                    f"{name} of orbit {number}",
                )
