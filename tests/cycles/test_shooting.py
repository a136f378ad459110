"""Limit cycles by three methods in four precisions, and Newton's iteration from bad starts."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import pytest
from hypothesis import given, settings

from tests.problems import SETS, decimals, speed_below
from tippedisk_verify import (
    CALIBRATED,
    DOUBLE,
    PRINTED,
    QUADRUPLE,
    Exact,
    InputError,
    Request,
    collocation_cycle,
    omega_crit,
    reference,
    shoot_limit_cycle,
)
from tippedisk_verify.cycles.collocation.collocation_branch import _librating_branch
from tippedisk_verify.cycles.collocation.collocation_cycles import collocation_guess
from tippedisk_verify.cycles.shooting.error_budget import cycle_in_precision
from tippedisk_verify.cycles.shooting.return_map import LinearizedReturn, ReturnMap
from tippedisk_verify.cycles.shooting.section import LIBRATING, ROTATING
from tippedisk_verify.cycles.shooting.shoot import shoot
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.contract import SECTION, Event
from tippedisk_verify.numbers.exact import fraction
from tippedisk_verify.theory.hopf import criticality

MAIN = ("period", "gamma_bar_0", "v_0", "beta_max")
ALL = (
    *MAIN,
    "multiplier_slow",
    "log_multiplier_slow",
    "log_multiplier_fast",
    "dperiod_domega",
    "dgamma_bar_0_domega",
    "dv_0_domega",
)
_ENGINE = default_engine()
#: Librating cycles over whole periods, without the symmetry, on a section from v < 0 to the next
#: v < 0.
WHOLE_PERIOD = replace(
    LIBRATING,
    name="whole period",
    end_event=Event("closes", SECTION.function, direction=1),
    symmetry_sign=1,
    flights_per_period=1,
)


@settings(max_examples=6)
@given(share=decimals("0.01", "0.97", 4), which=decimals("0", "0.999", 3))
def test_half_period_full_period_and_balance_agree(share, which) -> None:
    parameters = SETS[int(which * 3)]
    speed = speed_below(parameters, share * Fraction(8, 10))
    guess = collocation_guess(parameters, speed)
    half = shoot_limit_cycle(parameters, speed, _ENGINE, guess=guess)
    whole = cycle_in_precision(
        shoot(ReturnMap(WHOLE_PERIOD, parameters, speed, _ENGINE), guess), DOUBLE
    )
    # Full-period shooting in double: its own round-off, over a multiplier that may be close to 1.
    loss = 1e-13 / abs(1 - float(half.multiplier_slow))
    for name in ALL:
        one, other = getattr(half, name), getattr(whole, name)
        assert abs(one.value - other.value) <= one.uncertainty + other.uncertainty, name
        if name in ("period", "multiplier_slow"):
            assert abs(one.value - other.value) < loss * abs(one.value), name
    balance = collocation_cycle(parameters, speed)
    for name in MAIN:
        mine, other = getattr(half, name), getattr(balance, name)
        assert abs(mine.value - other.value) <= mine.uncertainty + other.uncertainty, name


@pytest.mark.parametrize(
    ("section", "point"),
    [(LIBRATING, ("1.69", "-1.72")), (ROTATING, ("0.5", "0.1"))],
    ids=lambda value: getattr(value, "name", ""),
)
def test_derivatives_of_the_return_map_against_differences(taylor, section, point) -> None:
    """The derivatives are by both coordinates and Omega. The flight loses four of 33 digits, and
    the quotient's step twelve.
    """
    origin, precision = (*map(Fraction, point), Fraction("30.4")), QUADRUPLE

    def image(first: Fraction, second: Fraction, omega: Fraction) -> LinearizedReturn:
        return_map = ReturnMap(section, PRINTED, omega, taylor, precision)
        return return_map((precision.number(first), precision.number(second)))

    center, step = image(*origin), Fraction(1, 10**12)
    for column in range(3):
        ends = [
            image(*(x + sign * step * (k == column) for k, x in enumerate(origin)))
            for sign in (1, -1)
        ]
        for row in range(2):
            ahead, behind = (fraction(end.residual[row]) for end in ends)
            slope = (ahead - behind) / (2 * step) + (1 if row == column else 0)
            derivative = (*center.jacobian[row], center.by_omega[row])[column]
            assert abs(slope - fraction(derivative)) < Fraction(1, 10**15)
        slope = (fraction(ends[0].time) - fraction(ends[1].time)) / (2 * step)
        derivative = (*center.time_by_state, center.time_by_omega)[column]
        assert abs(slope - fraction(derivative)) < Fraction(1, 10**15)


def test_table_2_converges_quadratically(taylor) -> None:
    """The paper's Table 2 at Omega_crit - 0.5 of the calibrated set, by both forms of shooting."""
    speed = speed_below(CALIBRATED, "0.5")
    shot = shoot(ReturnMap(LIBRATING, CALIBRATED, speed, taylor), (1.69, -1.72))
    assert len(shot.residuals) <= 7
    assert shot.residuals[-1] < 32 * 2.0**-52  # some roundings of 1 to 2
    whole = shoot(ReturnMap(WHOLE_PERIOD, CALIBRATED, speed, taylor), (1.69, -1.72))
    # Two ways to a period of some 1 s: a few thousand roundings
    assert (
        abs(whole.image.time - float(shoot_limit_cycle(CALIBRATED, speed, taylor).period)) < 1e-12
    )
    # Below that a residual is rounding.
    drops = [math.log10(size) for size in whole.residuals if size > 1e-14]
    assert len(whole.residuals) <= 8
    assert drops[-1] < 1.6 * drops[-2] or drops[-1] < -12  # digits nearly double until round-off


@settings(max_examples=40)
@given(gamma=decimals("-3.1", "3.1", 3), v=decimals("-12", "3", 3))
def test_newton_from_anywhere_finds_the_cycle_or_fails(gamma, v) -> None:
    """Starts lie around the cycle, up to twice its size away. The truth is harmonic balance's."""
    size = collocation_guess(PRINTED, speed_below(PRINTED, "0.5"))
    guess = (float(gamma) / 1.55 * size[0], -float(v) / 6 * size[1])
    try:
        shot = shoot(ReturnMap(LIBRATING, PRINTED, speed_below(PRINTED, "0.5"), _ENGINE), guess)
    except NoSuchCycleError:
        return
    assert abs(abs(shot.point[0]) / size[0] - 1) < 1e-6  # what some harmonics leave
    assert abs(shot.point[1] / size[1] - 1) < 1e-6


def test_refusals(taylor) -> None:
    with pytest.raises(InputError):
        shoot_limit_cycle(PRINTED, "0", taylor)
    with pytest.raises(NoSuchCycleError, match="v < 0"):
        shoot(ReturnMap(LIBRATING, PRINTED, "30.4", taylor), (1.7, 1.7))
    with pytest.raises(NoSuchCycleError):
        shoot(ReturnMap(LIBRATING, PRINTED, "31.4", taylor), (0.5, -0.8))


# --------------------------------------------------------------------------------- harmonic balance
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
