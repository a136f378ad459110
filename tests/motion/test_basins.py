"""Basins: the same with and without processes, shares that add up, and the files of a command."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from pathlib import Path

import pytest

from tests.command_line import answer
from tippedisk_verify import PRINTED, basins


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
