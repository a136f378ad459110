"""Cycles solved together: the paper's sets, and the speeds that are left to single solutions."""

from __future__ import annotations

from fractions import Fraction

import numpy

from tippedisk_verify import CALIBRATED, PRINTED, Parameters, hopf_point
from tippedisk_verify.cycles.branch_cycles import librating_branch
from tippedisk_verify.cycles.families.family import batch_solver
from tippedisk_verify.cycles.families.interpolant import FamilyInterpolant
from tippedisk_verify.cycles.families.librating_family import LibratingFamily
from tippedisk_verify.cycles.shooting.section import LIBRATING
from tippedisk_verify.flow import default_batch_engine


def followed(parameters: Parameters, taylor) -> LibratingFamily:
    return LibratingFamily(
        parameters, taylor, batch_solver(LIBRATING, parameters, default_batch_engine())
    )


def test_the_papers_801_cycles(taylor) -> None:
    cycles = list(librating_branch(CALIBRATED, taylor, paper_sets=True))
    assert len(cycles) == 801
    assert all(cycle.stable and cycle.engine == "lanes" for cycle in cycles)
    for cycle in cycles:
        # Round-off of half a period's flow: hundreds of ulps, and at Omega_h + 0.006 a hundred
        # times as many.
        assert cycle.residuals[-1] < 2e-13
        # At D = 0.006 T moves by 2 / (lambda_u D) = 50 times the residual, and a half-width is some
        # ten errors.
        assert cycle.period.uncertainty < Fraction(1, 10**10)
        # The monodromy matrix moves as much as T does.
        assert float(cycle.trivial_multiplier_defect) < 1e-11


def test_cycles_are_sharp_and_meet_the_hopf_point(taylor) -> None:
    branch = followed(PRINTED, taylor)
    below = 0.0008
    omegas = numpy.linspace(branch.limit + below, branch.omega_crit - below, 500)
    cycles = [
        cycle
        for (cycle,) in FamilyInterpolant(branch, default_batch_engine()).cycles_at_speeds(
            omegas, 0
        )
    ]
    widths = [float(cycle.period.uncertainty) for cycle in cycles]
    # At the last speed 1 - mu_slow is 3e-4, which the residual of some 1e-14 is divided by; a
    # half-width is some ten errors. In the middle 1 - mu_slow is 0.1 and more.
    assert max(widths) < 10 * 1e-14 / 3e-4
    assert numpy.median(widths) < 10 * 1e-14 / 0.1
    hopf, near = hopf_point(PRINTED), cycles[-1]
    # One term further the expansion in Omega_crit - Omega (0.0008 rad/s) has coefficients of order
    # 1.
    assert abs(float(near.beta_max) ** 2 / below / float(hopf.amplitude_squared_slope) - 1) < 0.01
    assert (
        abs((float(near.period) - float(hopf.period)) / below / float(hopf.period_slope) - 1) < 0.01
    )


def test_speeds_whose_cycles_doubles_do_not_hold_are_left_out(taylor) -> None:
    """They lie outside the family, between its last nodes and its ends, and next to a fold."""
    branch = followed(PRINTED.changed(A="0.229e-3"), taylor)
    fold = branch.guess(branch.folds[0]).omega
    speeds = [fold + 0.1, fold, 30.9, branch.limit + 1e-9, branch.limit - 0.1]
    by_speed = FamilyInterpolant(branch, default_batch_engine()).cycles_at_speeds(speeds, 0)
    assert [some and [cycle.stable for cycle in some] for some in by_speed] == [
        None,
        None,
        [False, True],
        None,
        None,
    ]
