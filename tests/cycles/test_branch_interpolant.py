"""The branch as a function: its own errors hold, and so do those of cycles solved together."""

from __future__ import annotations

from fractions import Fraction

import numpy
import pytest

from tests.problems import SETS
from tippedisk_verify.atlas.branch import family
from tippedisk_verify.connection.bisection import bisect_omega_h
from tippedisk_verify.cycles.branch_interpolant import BranchInterpolant
from tippedisk_verify.errors import InputError
from tippedisk_verify.flow.lanes import BatchTaylor
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.theory.hopf import hopf_point

INTERPOLATED = ("period", "gamma_bar_0", "v_0", "beta_max", "log_multiplier_slow", "log_multiplier_fast")
ALL = (*INTERPOLATED, "multiplier_slow", "dperiod_domega", "dgamma_bar_0_domega", "dv_0_domega")
_LANES = BatchTaylor()


def branch_of(parameters, taylor, **bounds) -> BranchInterpolant:
    return BranchInterpolant(parameters, _LANES, float(bisect_omega_h(parameters, taylor).omega_h), **bounds)


def test_it_is_sharp_and_meets_the_hopf_point(taylor) -> None:
    branch = branch_of(PRINTED, taylor)
    values = branch(numpy.linspace(branch.lowest, branch.highest, 500))
    assert values.uncertainty["period"].max() < 1e-9
    assert numpy.median(values.uncertainty["period"]) < 1e-11
    hopf = hopf_point(PRINTED)
    near = branch([branch.highest])
    below = branch.omega_crit - branch.highest
    # One term further the expansion in Omega_crit - Omega (0.0008 rad/s) has coefficients of order 1.
    assert abs(near.beta_max[0] ** 2 / below / float(hopf.amplitude_squared_slope) - 1) < 0.01
    assert abs((near.period[0] - float(hopf.period)) / below / float(hopf.period_slope) - 1) < 0.01


@pytest.mark.parametrize("parameters", SETS, ids=lambda p: p.name)
def test_the_papers_801_cycles(parameters, taylor) -> None:
    cycles = list(family(parameters, taylor, paper_sets=True))
    assert len(cycles) == 801
    assert all(cycle.stable for cycle in cycles)
    for cycle in cycles:
        # Round-off of half a period's flow: hundreds of ulps, and at Omega_h + 0.006 a hundred times as many.
        assert cycle.residuals[-1] < 2e-13
        assert cycle.period.uncertainty < Fraction(1, 10**10)
        assert float(cycle.trivial_multiplier_defect) < 1e-11


def test_bounds(taylor) -> None:
    branch = branch_of(PRINTED, taylor, lowest=30.3, highest=30.6)
    assert numpy.isfinite(branch([30.3, 30.6]).period).all()
    for outside in (30.2999, 30.6001, float("nan")):
        with pytest.raises(InputError, match="outside the branch's bounds"):
            branch([outside])
    with pytest.raises(InputError, match="the branch lies between"):
        BranchInterpolant(PRINTED, _LANES, branch.omega_h, lowest=29.0)
    with pytest.raises(InputError, match=r"the branch ends near 30\.827"):
        BranchInterpolant(PRINTED.changed(A="0.227e-3"), _LANES, branch.omega_h)


def test_a_node_is_interpolated_by_itself(taylor) -> None:
    branch = branch_of(PRINTED, taylor, lowest=30.3, highest=30.6)
    inner = [omega for omega in branch.nodes["omega"] if branch.lowest <= omega <= branch.highest]
    values = branch(inner[3:5])
    assert abs(values.period[0] - branch.nodes["period"][list(branch.nodes["omega"]).index(inner[3])]) < 1e-15
