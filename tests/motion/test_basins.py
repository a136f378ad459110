"""Basins, their shares and files, and the boundary between standing and lying flat."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from pathlib import Path

import numpy
import pytest

import tippedisk_verify as tv
from tests.command_line import answer
from tippedisk_verify import PRINTED, basins, omega_crit
from tippedisk_verify.cycles.cycle_at_speed import rotating_cycle_at
from tippedisk_verify.motion.basin_boundary import BasinBoundary
from tippedisk_verify.motion.basins import OUTCOMES, Attractors, integrate_outcomes
from tippedisk_verify.motion.scenes import INITIAL_STATES


def test_basins() -> None:
    speed, smooth = Fraction("30.4"), PRINTED.with_friction("smooth")
    alone = basins(smooth, speed, count=400)
    with ThreadPoolExecutor(2) as pool:
        pooled = basins(smooth, speed, count=400, executor=pool)
    assert (alone.outcome == pooled.outcome).all()
    shares = alone.shares()
    categories = {"lies flat", "limit cycle", "rotating cycle", "inverted spinning", "undecided"}
    assert set(alone.to_dict()["shares"]) == categories
    # Some roundings of shares below 1
    assert abs(sum(share for share, _ in shares.values()) - 1) < len(shares) * 2.0**-53
    # Another sample of the same plane, within both sampling errors.
    other = basins(smooth, speed, count=400, seed=2).shares()
    for name, (share, error) in shares.items():
        assert abs(share - other[name][0]) <= 1.5 * (error + other[name][1])
    assert shares["undecided"][0] < 0.01
    assert shares["inverted spinning"][0] == 0


@pytest.mark.slow(minutes=0.4)
def test_the_command(tmp_path: Path) -> None:
    out = tmp_path / "basins"
    result = answer(f"basin --omega 30.4 --count 500 --out {out}")
    assert result["states"] >= 500
    assert (out / "basins.png").exists()
    assert (
        len((out / "basins.csv").read_text(encoding="utf-8").splitlines()) == result["states"] + 1
    )


# ------------------------------------------------------------------------------------- the boundary
ABOVE_CRIT = omega_crit(PRINTED, 20).value + Fraction(1, 2)


@pytest.mark.parametrize("omega", ["30.04", ABOVE_CRIT], ids=["below", "above"])
@pytest.mark.parametrize("count", [20, pytest.param(300, marks=pytest.mark.slow)])
def test_starts_on_either_side_end_where_it_says(taylor, omega, count) -> None:
    boundary = BasinBoundary(PRINTED, omega, taylor)
    random = numpy.random.default_rng(5)
    inside, outside = [], []
    for gamma, v in zip(
        random.uniform(-1.5, 4.7, count), random.uniform(-4, 4, count), strict=True
    ):
        lower, upper = map(float, boundary.sheets(gamma, v))
        sheet, outward = (upper, 1) if random.random() < 0.5 else (lower, -1)
        inside.append((sheet - outward * 1e-6, gamma, v))
        outside.append((sheet + outward * 1e-6, gamma, v))
    attractors = Attractors.at(PRINTED, Fraction(omega))
    standing = "rotating cycle" if omega == "30.04" else "inverted spinning"
    for starts, expected in ((inside, standing), (outside, "lies flat")):
        outcomes = integrate_outcomes(
            numpy.array(starts), PRINTED, Fraction(omega), 20.0, attractors
        )
        assert [OUTCOMES[outcome] for outcome in outcomes] == [expected] * count


@pytest.mark.slow
def test_below_the_fold_everything_lies_flat(taylor) -> None:
    """Check panel a of the paper, below the fold of the unstable rotating cycles."""
    with pytest.raises(tv.InputError, match="fold near"):
        BasinBoundary(PRINTED, "29.95", taylor)
    assert basins(PRINTED, "29.95", count=500).shares()["lies flat"][0] == 1


def test_the_papers_starts_stand_inside(taylor) -> None:
    """Check panels b to f: both starts keep standing, and the first is nearer to the boundary."""
    boundary = BasinBoundary(PRINTED, ABOVE_CRIT, taylor)
    margins = [boundary.margin([float(part) for part in start]) for start in INITIAL_STATES]
    assert 0 < margins[0] < margins[1]


def test_the_cycle_itself_lies_on_it(taylor) -> None:
    boundary = BasinBoundary(PRINTED, "30.5", taylor)
    cycle = rotating_cycle_at(PRINTED, "30.5", taylor, stable=False)
    for beta, gamma, v in cycle.orbit(5)[1].T:
        margin = float(boundary.margin((beta, gamma, v)))
        # What an orbit in double is off, over half a turn
        assert margin == pytest.approx(0, abs=1e-12)


def test_the_command_without_files() -> None:
    assert answer("basin --omega 30.4 --count 16 --seconds 5")["states"] >= 16
    shown = answer("basin --omega 30.5 --margin 'pi/2 + 0.4,pi/2,0'")
    assert shown["keeps_standing"] is True
    assert 0.1 < float(shown["margin"]["value"]) < 0.2
