"""Omega_h: nested digits, two roads, invariances, slopes, and what is refused."""

from __future__ import annotations

import csv
import json
import math
from fractions import Fraction
from pathlib import Path

import numpy
import pytest

from tests.problems import SETS
from tippedisk_verify.cli import main
from tippedisk_verify.connection.bisection import unstable_branch
from tippedisk_verify.connection.heteroclinic import heteroclinic
from tippedisk_verify.connection.omega_h_slopes import omega_h_slopes
from tippedisk_verify.errors import InputError, NoConnectionError
from tippedisk_verify.flow.contract import Request
from tippedisk_verify.model.parameters import CALIBRATED, PRINTED
from tippedisk_verify.theory.equilibria import equilibrium


@pytest.mark.slow
@pytest.mark.parametrize("parameters", SETS, ids=lambda p: p.name)
def test_50_digits_lie_within_100(taylor, parameters) -> None:
    few, more = (heteroclinic(parameters, taylor, digits=digits) for digits in (50, 100))
    assert few.omega_h.holds(more.omega_h.value)
    assert more.omega_h.uncertainty <= more.omega_h.value / 10**100


def test_two_roads_agree(taylor) -> None:
    manifolds, cycles = (
        heteroclinic(PRINTED, taylor, digits=24, method=method).omega_h for method in ("manifolds", "limit-cycles")
    )
    assert abs(manifolds.value - cycles.value) <= manifolds.uncertainty + cycles.uncertainty


@pytest.mark.slow
@pytest.mark.parametrize("parameters", SETS, ids=lambda p: p.name)
def test_two_roads_agree_to_40_digits(taylor, parameters) -> None:
    manifolds, cycles = (
        heteroclinic(parameters, taylor, digits=41, method=method).omega_h for method in ("manifolds", "limit-cycles")
    )
    assert abs(manifolds.value - cycles.value) <= manifolds.uncertainty + cycles.uncertainty
    assert abs(manifolds.value / cycles.value - 1) < Fraction(1, 10**40)


@pytest.mark.slow
def test_masses_and_friction_scale_out(taylor) -> None:
    here = heteroclinic(CALIBRATED, taylor, digits=15).omega_h
    heavy = CALIBRATED.changed(m=CALIBRATED.m * 7, A=CALIBRATED.A * 7, B=CALIBRATED.B * 7)
    rough = CALIBRATED.changed(mu=CALIBRATED.mu * Fraction(13, 10), epsilon=CALIBRATED.epsilon * Fraction(13, 10))
    for other in (heavy, rough):
        assert abs(heteroclinic(other, taylor, digits=15).omega_h.value - here.value) <= 2 * here.uncertainty


def check_slope(taylor, name: str) -> None:
    omega_h = heteroclinic(PRINTED, taylor, digits=22).omega_h
    slope = omega_h_slopes(PRINTED, omega_h, taylor)[name]
    value = getattr(PRINTED, name)
    step = value / 10**8
    ends = [
        heteroclinic(PRINTED.changed(**{name: value + sign * step}), taylor, digits=22).omega_h.value
        for sign in (1, -1)
    ]
    difference = (ends[0] - ends[1]) / (2 * step)
    # The central difference is off by the square of the relative step times a factor of order 10.
    assert abs(slope.value - difference) <= slope.uncertainty + abs(difference) / 10**13


@pytest.mark.slow
def test_slope_of_epsilon(taylor) -> None:
    check_slope(taylor, "epsilon")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["r", "e", "m", "A", "B", "g", "mu", "epsilon"])
def test_slopes_against_differences(taylor, name) -> None:
    check_slope(taylor, name)


def test_the_unstable_branch_on_both_sides(taylor) -> None:
    """Above it turns back, later by the law the closer it is; below it passes to the next well."""
    connection = heteroclinic(PRINTED, taylor, digits=30)
    growth = float(connection.saddle_eigenvalues[0])
    times = []
    for power in (20, 22):
        omega = connection.omega_h.value + Fraction(1, 2**power)
        result = unstable_branch(PRINTED, omega, taylor)
        assert result.events[-1].name == "turns back"
        times.append(float(result.time))
    # Until the next crossing of beta = pi/2, where both directions share the passage: lambda_u - lambda_s in all.
    slow = -float(connection.saddle_eigenvalues[1])
    assert abs((times[1] - times[0]) * (growth + slow) / math.log(4) - 1) < 0.02
    below = unstable_branch(PRINTED, connection.omega_h.value - Fraction(1, 2**22), taylor)
    assert below.events[-1].name == "passes"


def test_samples_run_from_saddle_to_saddle(taylor, tmp_path: Path) -> None:
    connection = heteroclinic(PRINTED, taylor)
    omega_h = connection.omega_h
    times, states = connection.orbit()
    rows = numpy.column_stack((times, states.T))
    begin, end = rows[0, 1:], rows[-1, 1:]
    assert numpy.abs(begin - [math.pi / 2, -math.pi / 2, 0]).max() < 2e-6
    assert numpy.abs(end - [math.pi / 2, 3 * math.pi / 2, 0]).max() < 1e-4
    growth = float(equilibrium(PRINTED, omega_h.value, "noninverted").eigenvalues[0].re)
    assert abs(math.log(rows[20, 3] / rows[0, 3]) / (rows[20, 0] - rows[0, 0]) / growth - 1) < 1e-6
    run = taylor(Request(PRINTED, omega_h.value, rows[100, 1:].tolist(), float(rows[200, 0] - rows[100, 0])))
    assert numpy.abs(run.state - rows[200, 1:]).max() < 1e-10


def test_refusals(taylor) -> None:
    with pytest.raises(NoConnectionError, match="saddle-focus"):
        heteroclinic(PRINTED.changed(e="0.03", A="0.9e-3", B="0.8e-3", C=None), taylor)
    with pytest.raises(InputError, match="at most 12 digits"):
        heteroclinic(PRINTED, taylor, digits=13, method="scipy")
    with pytest.raises(InputError, match="1000 digits"):
        heteroclinic(PRINTED, taylor, digits=1001)


def test_command(tmp_path: Path, capsys) -> None:
    out = tmp_path / "connection.csv"
    assert main(["heteroclinic", "--digits", "20", "--json", "--out", str(out)]) == 0
    result = json.loads(capsys.readouterr().out)
    assert Fraction(result["omega_h"]["uncertainty"]) < Fraction(result["omega_h"]["value"]) / 10**20
    assert len(result["saddle_eigenvalues"]) == 3
    assert result["method"] == "manifolds"
    assert len(list(csv.reader(out.read_text(encoding="utf-8").splitlines()))) == 402
    for wrong in (
        ["--method", "guess"],
        ["--method", "bisection", "--digits", "20"],
        ["--digits", "2000"],
        ["--out", str(tmp_path / "no" / "where.csv")],
    ):
        assert main(["heteroclinic", *wrong]) == 2
        assert capsys.readouterr().err.count("\n") == 1
