"""Cycles solved together, in lanes: their half-widths hold, and other cycles are shot one at a time."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy
import pytest

from tippedisk_verify import CALIBRATED, PRINTED, Parameters, Request, ScipyEngine, hopf_point
from tippedisk_verify.cycles.branch_cycles import cycles_found, librating_branch, rotating_branch
from tippedisk_verify.cycles.cycle_at_speed import cycles_from_guesses
from tippedisk_verify.cycles.families.family import batch_solver
from tippedisk_verify.cycles.families.interpolant import FamilyInterpolant
from tippedisk_verify.cycles.families.librating_family import LibratingFamily
from tippedisk_verify.cycles.families.rotating_family import RotatingFamily
from tippedisk_verify.cycles.locator import cached_locator
from tippedisk_verify.cycles.shooting.cycle_numbers import number_names
from tippedisk_verify.cycles.shooting.section import GAMMA_BOTTOM, LIBRATING, ROTATING
from tippedisk_verify.flow import default_batch_engine

_FAR = 1.6  # rad/s above the fold: beyond Omega_crit


@pytest.fixture(scope="module")
def family(taylor) -> RotatingFamily:
    return cached_locator(PRINTED, taylor).rotating_family


def test_many_speeds_through_lanes_are_those_of_single_solutions(taylor, family) -> None:
    fold, omega_h = 30.00346, float(family.omega_h)
    inside = numpy.linspace(fold + 1e-3, omega_h - 0.006, 40).tolist()
    beyond = numpy.linspace(omega_h + 1e-4, fold + _FAR, 58).tolist()
    speeds = [fold + 3e-6, *inside, *beyond, omega_h - 1e-3]
    cycles = list(rotating_branch(PRINTED, taylor, speeds))
    order = [
        (speed, side) for speed in speeds for side in (True, False) if speed < omega_h or not side
    ]
    assert [(float(cycle.omega), cycle.stable) for cycle in cycles] == order
    # Next to the fold, and to Omega_h on the stable side, doubles do not hold a speed's cycles.
    singly = [(float(cycle.omega), cycle.stable) for cycle in cycles if cycle.engine != "lanes"]
    assert singly == [
        (speeds[0], True),
        (speeds[0], False),
        (speeds[-1], True),
        (speeds[-1], False),
    ]
    for index in (2, 3, 41, 80, 81, 100, len(cycles) - 1):
        omega, side = order[index]
        (alone,) = cycles_from_guesses(
            cached_locator(PRINTED, taylor).rotating_guesses_at(Fraction(omega), stable=side)
        )
        for name in number_names(ROTATING):
            one, other = getattr(cycles[index], name), getattr(alone, name)
            assert abs(one.value - other.value) <= one.uncertainty + other.uncertainty, (
                name,
                omega,
            )
        for name in ("period", *ROTATING.coordinate_names, "beta_max"):
            number = getattr(cycles[index], name)
            assert number.uncertainty <= abs(number.value) / 10**12, (name, omega)


@pytest.mark.parametrize(
    "changes",
    [pytest.param({"friction": "smooth"}, marks=pytest.mark.slow), {"e": "5e-3"}],
    ids=str,
)
def test_the_family_is_found_from_omega_h_on(taylor, changes) -> None:
    """The family falls to one fold and rises from there. A place on it is a cycle up to the error
    of few nodes.
    """
    disk = PRINTED.with_friction("smooth") if "friction" in changes else PRINTED.changed(**changes)
    known = cached_locator(disk, taylor)
    family = known.rotating_family
    fold = family.fold_guess()
    assert fold.omega < family.omega_h
    family.follow_to(float(family.omega_h) + 1)
    assert family.omega_falls == [True, False]
    for omega, stable in (
        ((fold.omega + float(family.omega_h)) / 2, True),
        (float(family.omega_h) + 0.5, False),
    ):
        (cycle,) = cycles_from_guesses(known.rotating_guesses_at(Fraction(omega), stable=stable))
        (place,) = family.followed_guesses(omega, stable=stable)
        top = (float(cycle.beta_bar_top), float(cycle.v_top))
        # A place on a family is a start for shooting, with some digits; another cycle is off by
        # 1e-2.
        assert numpy.abs(numpy.subtract(place.coordinates, top)).max() < 1e-6
        run = Request(
            disk,
            omega,
            (top[0], 0, top[1]),
            10,
            shifted=True,
            events=(replace(GAMMA_BOTTOM, terminal=True),),
        )
        beta, _, v = ScipyEngine()(run).state
        # SciPy's error, grown
        assert max(abs(beta - float(cycle.beta_bar_0)), abs(v - float(cycle.v_0))) < 1e-6


def test_speeds_below_the_fold_are_refused(taylor) -> None:
    missing, *cycles = rotating_branch(PRINTED, taylor, [30.001 + 0.01 * n for n in range(100)])
    assert "fold near" in missing.status
    assert len(cycles_found(cycles)) == len(cycles) > 99


# --------------------------------------------------------------------------------- librating cycles
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
