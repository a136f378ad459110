"""Round-off averaged out close to Omega_h: against extended precision, and against the same without averaging."""

from __future__ import annotations

from fractions import Fraction

import numpy
import pytest

from tests.problems import SETS
from tippedisk_verify.flow.lanes import BatchTaylor, field_constants
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.model.precision import EXTENDED
from tippedisk_verify.orbits.averaged import averaged
from tippedisk_verify.orbits.batch_shooting import Guess, corrected
from tippedisk_verify.orbits.bisection import bisect_omega_h
from tippedisk_verify.orbits.branch_interpolant import BranchInterpolant
from tippedisk_verify.orbits.periodic import limit_cycle


@pytest.mark.slow
@pytest.mark.parametrize(
    "parameters",
    [PRINTED, *(pytest.param(other, marks=pytest.mark.slow) for other in SETS if other is not PRINTED)],
    ids=lambda p: p.name,
)
def test_errors_are_halved_and_below_5e_14(taylor, parameters) -> None:
    """The 24 speeds from 6e-3 to 8e-3 rad/s above Omega_h, as close as the paper's family comes."""
    lanes, constants = BatchTaylor(), field_constants(parameters)
    omega_h = float(bisect_omega_h(parameters, taylor).omega_h)
    branch = BranchInterpolant(parameters, lanes, omega_h, lowest=omega_h + 5e-3)
    speeds = omega_h + numpy.linspace(6e-3, 8e-3, 24)
    found = branch.cycles(speeds)
    single = corrected(constants, speeds, Guess(found.gamma_bar_0, found.v_0, found.period / 2), lanes)
    errors = []
    for k, speed in enumerate(speeds.tolist()):
        guess = (found.gamma_bar_0[k], found.v_0[k])
        truth = limit_cycle(parameters, Fraction(speed), taylor, guess=guess, precision=EXTENDED).period
        assert truth.uncertainty < Fraction(1, 10**15)
        errors.append([float(Fraction(cycles.period[k]) - truth.value) for cycles in (found, single)])
    mean, alone = numpy.sqrt((numpy.array(errors) ** 2).mean(axis=0))
    assert mean < alone / 1.5
    assert numpy.abs(errors, dtype=float)[:, 0].max() < 5e-14


def test_what_feels_no_round_off_is_left_alone(taylor) -> None:
    lanes = BatchTaylor()
    omega_h = float(bisect_omega_h(PRINTED, taylor).omega_h)
    far = BranchInterpolant(PRINTED, lanes, omega_h, lowest=omega_h + 5e-3).cycles([30.4, 30.6])
    assert averaged(PRINTED, far, lanes) is far
