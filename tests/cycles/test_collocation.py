"""Harmonic balance against the laws at the Hopf point, against itself, and against the flow."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest

from tests.problems import speed_below
from tippedisk_verify import (
    PRINTED,
    QUADRUPLE,
    Exact,
    Request,
    collocation_cycle,
    omega_crit,
    reference,
)
from tippedisk_verify.cycles.collocation.collocation_branch import _librating_branch
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.numbers.exact import fraction
from tippedisk_verify.theory.hopf import criticality


def test_cycles_close_under_the_flow(taylor) -> None:
    """An integrator tests the defining property: after T the state is back, to the digits
    claimed.
    """
    speed = speed_below(PRINTED, "0.7")
    cycle = collocation_cycle(PRINTED, speed, digits=25)
    half = Fraction(1, 2)
    start = [Exact(Fraction(0), half), Exact(cycle.gamma_bar_0.value, half), cycle.v_0.value]
    end = taylor(Request(PRINTED, speed, start, cycle.period.value, precision=QUADRUPLE)).state
    # Over one period errors transverse to the attracting cycle shrink; along it they stay, times
    # speeds below 50.
    for mine, origin in zip(end, start, strict=True):
        assert abs(fraction(mine) - fraction(QUADRUPLE.number(origin))) < Fraction(1, 10**22)


@pytest.mark.parametrize("harmonics", [3, 6])
def test_few_harmonics_are_honest(harmonics) -> None:
    """The estimate bounds the true error even if that is large."""
    speed = speed_below(PRINTED, "0.5")
    truth = collocation_cycle(PRINTED, speed, digits=30)
    rough = collocation_cycle(PRINTED, speed, harmonics=harmonics)
    for name in ("period", "gamma_bar_0", "v_0", "beta_max"):
        assert getattr(rough, name).holds(getattr(truth, name).value), name


def test_too_few_harmonics_find_nothing_rather_than_something() -> None:
    """Four harmonics meet the discrete equations at a speed below Omega_h, where no cycle
    exists.
    """
    for distance, harmonics, word in (
        ("0.5", 1, "did not converge"),
        (
            "0.84",
            4,
            r"the branch "
            r"ends near 30\.049",
        ),
    ):
        with pytest.raises(NoSuchCycleError, match=word):
            collocation_cycle(PRINTED, speed_below(PRINTED, distance), harmonics=harmonics)


def test_subcritical_disks_have_their_cycles_above() -> None:
    thin = PRINTED.changed(A="0.227e-3")
    assert criticality(thin) == "subcritical"
    cycle = collocation_cycle(thin, omega_crit(thin, 40).value + Fraction(1, 100))
    assert cycle.beta_max.value > Fraction(1, 20)
    below = omega_crit(thin, 40).value - Fraction(1, 100)
    assert collocation_cycle(thin, below).beta_max.value > Fraction(1, 5)  # beyond the fold


@pytest.mark.parametrize("inertia", ["0.228e-3", "0.229e-3", "0.23e-3"])
def test_the_branch_passes_its_fold_in_order(inertia: str) -> None:
    """Either of the points before and after a fold may be the nearer one."""
    points = [point for point, _ in _librating_branch(PRINTED.changed(A=inertia), math.inf)]
    amplitudes = [abs(point[:-2]).max() for point in points]
    assert amplitudes == sorted(amplitudes)
    speeds = [point[-1] for point in points]
    top = speeds.index(max(speeds))
    assert speeds == sorted(speeds[:top]) + sorted(speeds[top:], reverse=True)


def test_the_branch_goes_on_where_periods_are_long() -> None:
    """It reaches the speed at which periods are five times the shortest, 1e-5 rad/s above
    Omega_h.
    """
    speed = float(reference("table1/linear/near-heteroclinic/het+1e-5/period").inputs["Omega"])
    assert any(point[-1] < speed for point, _ in _librating_branch(PRINTED, speed))
