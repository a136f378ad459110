"""Rotating cycles in lanes: their half-widths hold, and other cycles are shot one at a time."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy
import pytest

from tippedisk_verify import PRINTED, Request, ScipyEngine
from tippedisk_verify.cycles.branch_cycles import cycles_found, rotating_branch
from tippedisk_verify.cycles.cycle_at_speed import cycles_from_guesses
from tippedisk_verify.cycles.families.rotating_family import RotatingFamily
from tippedisk_verify.cycles.locator import cached_locator
from tippedisk_verify.cycles.shooting.cycle_numbers import number_names
from tippedisk_verify.cycles.shooting.section import GAMMA_BOTTOM, ROTATING

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
