"""The smooth law through the same functions: cycles, branch, connection, basins."""

from __future__ import annotations

import json
import math
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from pathlib import Path

import pytest

from tippedisk_verify.cli import main
from tippedisk_verify.cycles.shooting import limit_cycle
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.motion.basins import basins
from tippedisk_verify.theory.hopf import omega_crit


def below(parameters, distance) -> Fraction:
    return omega_crit(parameters, 60).value - Fraction(distance)


@pytest.mark.slow
def test_the_laws_cycles_part_faster_than_they_grow(taylor) -> None:
    """gamma_y vanishes on the critical eigenspace, so the relative difference falls like the
    distance's power 2.5.
    """
    apart = []
    for distance in ("0.004", "0.001"):
        linear, smooth = (
            limit_cycle(PRINTED.with_friction(law), below(PRINTED, distance), taylor, digits=20)
            for law in ("linear", "smooth")
        )
        apart.append(float(abs(smooth.beta_max.value / linear.beta_max.value - 1)))
    assert 2.3 < math.log(apart[0] / apart[1], 4) < 2.7


def test_basins() -> None:
    speed, smooth = below(PRINTED, "0.5"), PRINTED.with_friction("smooth")
    alone = basins(smooth, speed, count=400)
    with ThreadPoolExecutor(2) as pool:
        pooled = basins(smooth, speed, count=400, executor=pool)
    assert (alone.outcome == pooled.outcome).all()
    shares = alone.fractions()
    assert abs(sum(share for share, _ in shares.values()) - 1) < 1e-12
    # Another sample of the same plane, within both sampling errors.
    other = basins(smooth, speed, count=400, seed=2).fractions()
    for name, (share, error) in shares.items():
        assert abs(share - other[name][0]) <= 1.5 * (error + other[name][1])
    assert shares["undecided"][0] < 0.01
    assert shares["inverted spinning"][0] == 0


@pytest.mark.slow(minutes=0.4)
def test_commands(capsys, tmp_path: Path) -> None:
    assert (
        main(["orbit", "--friction", "smooth", "--below-crit", "0.5", "--digits", "20", "--json"])
        == 0
    )
    assert json.loads(capsys.readouterr().out)["stable"] is True
    assert main(["branch", "--friction", "smooth", "--omegas", "30.6,30.3", "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["orbits"]) == 2
    out = tmp_path / "basins"
    assert main(["basin", "--omega", "30.4", "--count", "500", "--json", "--out", str(out)]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["states"] >= 500
    assert (out / "basins.png").exists()
    assert (
        len((out / "basins.csv").read_text(encoding="utf-8").splitlines()) == result["states"] + 1
    )
