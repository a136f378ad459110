"""Rotating limit cycles by two methods, under both laws, on both sides of the fold, and up to
Omega_h.
"""

from __future__ import annotations

import math
from fractions import Fraction

import numpy
import pytest

import tippedisk_verify as tv
from tippedisk_verify import DOUBLE, PRINTED, QUADRUPLE, Request, Status, equilibrium
from tippedisk_verify.cycles.branch_cycles import rotating_branch
from tippedisk_verify.cycles.collocation.collocation_cycles import collocation_rotating_cycle
from tippedisk_verify.cycles.cycle_at_speed import rotating_cycle_at
from tippedisk_verify.cycles.families.folds import rotating_fold
from tippedisk_verify.cycles.locator import cached_locator
from tippedisk_verify.cycles.near_omega_h.cycle_at_distance import rotating_cycle_below_omega_h
from tippedisk_verify.model.equations import normal_force_over_weight, vector_field

#: Stable and unstable ones, and above Omega_crit.
POINTS = (
    ("30.0388", False),
    pytest.param("30.02", True, marks=pytest.mark.slow),
    pytest.param("31.386592688643567", False, marks=pytest.mark.slow),
)
SHARED = ("period", "beta_bar_top", "v_top", "multiplier_slow")


def agree(one: tv.Measured, other: tv.Measured, digits: int) -> bool:
    """Return True if the half-widths overlap and allow ``digits`` digits."""
    apart = abs(one.value - other.value)
    width = one.uncertainty + other.uncertainty
    return apart <= width <= abs(one.value) / 10**digits


@pytest.mark.parametrize(("omega", "stable"), POINTS)
def test_shooting_and_collocation_agree(taylor, omega, stable) -> None:
    shot = rotating_cycle_at(PRINTED, omega, taylor, stable=stable, digits=12)
    other = collocation_rotating_cycle(PRINTED, omega, stable=stable, digits=16)
    for name in SHARED:
        assert agree(getattr(shot, name), other[name], 11), name
    both = shot.log_multiplier_slow + shot.log_multiplier_fast
    assert agree(both, other["log_multipliers"], 11)
    assert shot.stable is stable


@pytest.mark.slow
@pytest.mark.parametrize("friction", ["linear", "smooth"])
def test_the_fold_is_the_end_of_both_families(taylor, friction) -> None:
    """The square-root law holds: sqrt(Omega - Omega_fold) falls with the distance of both states,
    and T is its mean.
    """
    disk = PRINTED.with_friction(friction)
    fold = rotating_fold(cached_locator(disk, taylor).rotating_family)
    apart = []
    for distance in (Fraction(1, 10**4), Fraction(1, 10**6)):
        ends = [
            rotating_cycle_at(disk, fold.omega.value + distance, taylor, stable=stable)
            for stable in (True, False)
        ]
        multipliers = [float(end.multiplier_slow) - 1 for end in ends]
        assert multipliers[0] < 0 < multipliers[1]
        assert sum(multipliers) == pytest.approx(0, abs=0.05 * multipliers[1])
        middle = sum(float(end.beta_bar_top) for end in ends) / 2
        assert middle == pytest.approx(float(fold.beta_bar_top), abs=2 * float(distance))
        apart.append(float(ends[1].beta_bar_top - ends[0].beta_bar_top))
        slope = float(
            (ends[1].v_top - ends[0].v_top) / (ends[1].beta_bar_top - ends[0].beta_bar_top)
        )
        # The next order, sqrt(1e-4)
        assert slope == pytest.approx(float(fold.null_vector), rel=1e-2)
    assert apart[0] / apart[1] == pytest.approx(10, rel=1e-2)  # the same
    with pytest.raises(tv.InputError, match="fold near"):
        rotating_cycle_at(disk, fold.omega.value - Fraction(1, 10**3), taylor)


@pytest.mark.parametrize("friction", ["linear", pytest.param("smooth", marks=pytest.mark.slow)])
def test_the_orbit_turns_once_and_its_image_turns_back(taylor, friction) -> None:
    disk = PRINTED.with_friction(friction)
    omega = {"linear": "30.03", "smooth": "30.06"}[friction]
    cycle = rotating_cycle_at(disk, omega, taylor)
    times, (beta, gamma, v) = cycle.orbit(301)
    assert times[-1] == pytest.approx(float(cycle.period), rel=1e-15)  # a rounding of T to double
    assert gamma[-1] - gamma[0] == pytest.approx(2 * math.pi, abs=1e-12)  # of a flight in double
    assert (numpy.diff(gamma) > 0).all()
    assert beta.min() > math.pi / 2
    assert beta.max() - math.pi / 2 <= float(cycle.beta_max)
    # The flight amplifies rounding
    assert (beta[-1], v[-1]) == pytest.approx((beta[0], v[0]), abs=1e-11)
    lowest = numpy.abs(gamma - 3 * math.pi / 2).argmin()
    # A sample beside
    assert beta[lowest] - math.pi / 2 == pytest.approx(float(cycle.beta_bar_0), abs=1e-2)
    # The image under the point symmetry, flown in a wider arithmetic: gamma falls by a whole turn.
    start = (-cycle.beta_bar_top.value, 0, -cycle.v_top.value)
    image = taylor(
        Request(disk, omega, start, cycle.period.value, shifted=True, precision=QUADRUPLE)
    )
    assert image.status is Status.REACHED
    assert [float(part) for part in image.state] == pytest.approx(
        [float(start[0]), -2 * math.pi, float(start[2])],
        abs=1e-9,  # the start is known to some 1e-12, and a turn amplifies it
    )


@pytest.mark.slow
def test_the_period_grows_like_one_passage_of_the_saddle(taylor) -> None:
    """T = -ln(Omega_h - Omega) / lambda_u + const on this side: one passage a period, two on
    the other side.
    """
    growth = float(
        equilibrium(PRINTED, tv.Disk("table1").heteroclinic().omega_h.value, "noninverted")
        .eigenvalues[0]
        .re
    )
    constants = []
    for zeros in (3, 5, 7):
        cycle = rotating_cycle_below_omega_h(PRINTED, f"1e-{zeros}", taylor)
        assert cycle.stable
        constants.append(float(cycle.period) - zeros * math.log(10) / growth)
        assert float(cycle.dperiod_domega) * 10.0**-zeros * growth == pytest.approx(
            1, abs=0.3 * 10 ** (-0.15 * zeros)
        )
    assert abs(constants[2] - constants[1]) < abs(constants[1] - constants[0]) / 2


@pytest.mark.slow
def test_the_branch_goes_through_the_fold(taylor) -> None:
    cycles = list(rotating_branch(PRINTED, taylor))
    stable = [cycle.stable for cycle in cycles]
    assert stable == [True] * 20 + [False] * 20
    speeds = [float(cycle.omega) for cycle in cycles]
    assert speeds[:20] == sorted(speeds[:20], reverse=True)
    assert speeds[20:] == sorted(speeds[20:])
    leans = [float(cycle.beta_bar_0) for cycle in cycles]
    assert leans == sorted(leans)  # the lean next to the saddle orders the whole family
    at_speeds = list(rotating_branch(PRINTED, taylor, ["30.02", "30.5"]))
    assert [(float(cycle.omega), cycle.stable) for cycle in at_speeds] == [
        (30.02, True),
        (30.02, False),
        (30.5, False),
    ]
    # Next to Omega_h, on either side, where doubles do not see which side it is.
    omega_h = tv.Disk("table1").heteroclinic(digits=20, engine=taylor).omega_h.value
    sides = [omega_h - Fraction(1, 10**12), omega_h + Fraction(1, 10**12)]
    assert [cycle.stable for cycle in rotating_branch(PRINTED, taylor, sides)] == [
        True,
        False,
        False,
    ]


@pytest.mark.parametrize("omega", [30.4, 33.0, 60.0])
def test_the_unstable_cycles_stay_within_the_model(taylor, omega) -> None:
    """At higher speeds too the disk does not lie flat. The contact only pushes, and it does not
    open.
    """
    cycle = rotating_cycle_at(PRINTED, omega, taylor, stable=False)
    assert cycle.beta_max < 1.5
    constants = PRINTED.constants_in(DOUBLE)
    rates = vector_field(math, constants, omega, "linear")
    forces = [
        normal_force_over_weight(math, constants, omega, state, rates(*state)[2])
        for state in cycle.orbit(201)[1].T.tolist()
    ]
    assert 0.8 < min(forces) < 1 < max(forces) < 1.1
