"""Limit cycles: three roads, four precisions, and what Newton does from bad starts."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache

import mpmath
import numpy
import pytest
from hypothesis import given, settings

from tests.cycles.full_period import WHOLE_PERIOD
from tests.problems import SETS, decimals
from tippedisk_verify.cli import main
from tippedisk_verify.cycles.error_budget import cycle_in, cycle_numbers
from tippedisk_verify.cycles.return_map import Image, ReturnMap
from tippedisk_verify.cycles.section import LIBRATING, ROTATING
from tippedisk_verify.cycles.shooting import limit_cycle, shoot
from tippedisk_verify.cycles.spectral import approximate_cycle, balanced_cycle
from tippedisk_verify.errors import InputError, NoSuchCycleError
from tippedisk_verify.flow.baseline import Baseline
from tippedisk_verify.flow.contract import Request
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.exact import Exact, fraction
from tippedisk_verify.model.parameters import CALIBRATED, PRINTED
from tippedisk_verify.model.precision import DOUBLE, QUADRUPLE, bits
from tippedisk_verify.theory.hopf import omega_crit

MAIN = ("period", "gamma_bar_0", "v_0", "beta_max")
ALL = (*MAIN, "multiplier_slow", "log_multiplier_slow", "log_multiplier_fast", "dperiod_domega",
       "dgamma_bar_0_domega", "dv_0_domega")  # fmt: skip
_ENGINE = Taylor()


def below(parameters, distance) -> Fraction:
    return omega_crit(parameters, 80).value - Fraction(distance)


# One set at the ends and in the middle, another once: the slow study has them all.


@pytest.mark.slow
@pytest.mark.parametrize("distance", ["1e-6", "0.05", "0.5", "0.8"])
@pytest.mark.parametrize(
    "parameters", [PRINTED, *(pytest.param(p, marks=pytest.mark.slow) for p in SETS[1:])], ids=lambda p: p.name
)
def test_a_double_is_as_good_as_its_inputs(taylor, parameters, distance) -> None:
    """Within 2e-14 and what rounding Omega and the parameters does, 4 * 2^-53 * sum |p dx/dp|, against 113 bits."""
    speed = below(parameters, distance)
    shot = shoot(ReturnMap(LIBRATING, parameters, speed, taylor), approximate_cycle(parameters, speed))
    rough, sharp = (cycle_numbers(shot, precision) for precision in (DOUBLE, QUADRUPLE))
    # Steps by which no critical speed moves by more than a thousandth of the distance to the nearer of them.
    relative = Fraction(distance) / 30_000 / 3
    sums = dict.fromkeys((*MAIN, "multiplier_slow"), Fraction(0))
    for name in ("Omega", "r", "e", "m", "A", "B", "g", "mu", "epsilon"):
        if name == "Omega":
            moved = ReturnMap(LIBRATING, parameters, speed * (1 + relative), taylor)
        else:
            changed = parameters.changed(**{name: getattr(parameters, name) * (1 + relative)})
            moved = ReturnMap(LIBRATING, changed, speed, taylor)
        numbers = cycle_numbers(replace(shot, return_map=moved), QUADRUPLE)
        for key in sums:
            sums[key] += abs(fraction(numbers[key]) - fraction(sharp[key])) / relative
    for key, total in sums.items():
        error = abs(fraction(rough[key]) - fraction(sharp[key]))
        assert error <= Fraction("2e-14") + 4 * total / 2**53, key


@pytest.mark.slow
def test_a_cycle_that_attracts_weakly_is_honest(taylor) -> None:
    """1 - P' is 9e-5 here: rounding of the map leaves the wider run as far off as the double happens to be."""
    stiff, speed = PRINTED.changed(mu="1.76314", epsilon="0.00188734"), Fraction("30.746062089435")
    cycle = limit_cycle(stiff, speed, taylor, digits=9)
    shot = shoot(ReturnMap(LIBRATING, stiff, speed, taylor), (float(cycle.gamma_bar_0), float(cycle.v_0)))
    truth = cycle_numbers(shot, QUADRUPLE)
    for name in (
        "period",
        "gamma_bar_0",
        "v_0",
        "beta_max",
        "multiplier_slow",
        "log_multiplier_slow",
        "dperiod_domega",
    ):
        assert getattr(cycle, name).holds(fraction(truth[name])), name
    assert cycle.period.uncertainty < Fraction(1, 10**13)


@pytest.mark.slow
@pytest.mark.parametrize(
    "parameters", [PRINTED, pytest.param(CALIBRATED, marks=pytest.mark.slow)], ids=lambda p: p.name
)
def test_shooting_and_harmonic_balance_agree_to_40_digits(taylor, parameters) -> None:
    """No shared integrator: the two half-widths overlap."""
    speed = below(parameters, "0.5")
    shot, balance = limit_cycle(parameters, speed, taylor, digits=40), balanced_cycle(parameters, speed, digits=40)
    for name in MAIN:
        mine, other = getattr(shot, name), getattr(balance, name)
        assert abs(mine.value - other.value) <= mine.uncertainty + other.uncertainty


@pytest.mark.slow
def test_50_digit_values_stand_at_70_digits(taylor) -> None:
    speed = below(PRINTED, "0.5")
    coarse, fine = (limit_cycle(PRINTED, speed, taylor, digits=digits) for digits in (50, 70))
    for name in ALL:
        assert getattr(coarse, name).holds(getattr(fine, name).value), name


@pytest.mark.slow
def test_the_orbit_closes_at_higher_precision(taylor) -> None:
    speed = below(PRINTED, "0.7")
    cycle = limit_cycle(PRINTED, speed, taylor, digits=30)
    precision, half = bits(220), Fraction(1, 2)
    start = [Exact(Fraction(0), half), Exact(cycle.gamma_bar_0.value, half), cycle.v_0.value]
    end = taylor(Request(PRINTED, speed, start, cycle.period.value, precision=precision)).state
    for mine, origin in zip(end, start, strict=True):
        assert abs(fraction(mine) - fraction(precision.number(origin))) < Fraction(1, 10**40)


@settings(max_examples=40)
@given(share=decimals("0.01", "0.97", 4), which=decimals("0", "0.999", 3))
def test_half_period_full_period_and_balance_agree(share, which) -> None:
    parameters = SETS[int(which * 3)]
    speed = below(parameters, share * Fraction(8, 10))
    guess = approximate_cycle(parameters, speed)
    half = limit_cycle(parameters, speed, _ENGINE, guess=guess)
    whole = cycle_in(shoot(ReturnMap(WHOLE_PERIOD, parameters, speed, _ENGINE), guess), DOUBLE)
    # Full-period shooting in double: its own round-off, over a multiplier that may be close to 1.
    loss = 1e-13 / abs(1 - float(half.multiplier_slow))
    for name in ALL:
        one, other = getattr(half, name), getattr(whole, name)
        assert abs(one.value - other.value) <= one.uncertainty + other.uncertainty, name
        if name in ("period", "multiplier_slow"):
            assert abs(one.value - other.value) < loss * abs(one.value), name
    balance = balanced_cycle(parameters, speed)
    for name in MAIN:
        mine, other = getattr(half, name), getattr(balance, name)
        assert abs(mine.value - other.value) <= mine.uncertainty + other.uncertainty, name


@pytest.mark.parametrize(
    ("section", "point"),
    [(LIBRATING, ("1.69", "-1.72")), (WHOLE_PERIOD, ("1.69", "-1.72")), (ROTATING, ("0.5", "0.1"))],
    ids=lambda value: getattr(value, "name", ""),
)
def test_derivatives_of_the_return_map_against_differences(taylor, section, point) -> None:
    """By both coordinates and by Omega."""
    origin, precision = (*map(Fraction, point), Fraction("30.4")), bits(200)

    def image(first: Fraction, second: Fraction, omega: Fraction) -> Image:
        return_map = ReturnMap(section, PRINTED, omega, taylor, precision)
        return return_map((precision.number(first), precision.number(second)))

    center, step = image(*origin), Fraction(1, 10**20)
    for column in range(3):
        ends = [image(*(x + sign * step * (k == column) for k, x in enumerate(origin))) for sign in (1, -1)]
        for row in range(2):
            ahead, behind = (fraction(end.residual[row]) for end in ends)
            slope = (ahead - behind) / (2 * step) + (1 if row == column else 0)
            derivative = (*center.matrix[row], center.by_omega[row])[column]
            assert abs(slope - fraction(derivative)) < Fraction(1, 10**30)
        slope = (fraction(ends[0].time) - fraction(ends[1].time)) / (2 * step)
        derivative = (*center.time_by_state, center.time_by_omega)[column]
        assert abs(slope - fraction(derivative)) < Fraction(1, 10**30)


@pytest.mark.slow
def test_multipliers_are_those_of_the_full_monodromy_matrix(taylor) -> None:
    """At 160 digits the full matrix has its three eigenvalues: slow, 1 and about 1e-42."""
    speed = below(PRINTED, "0.5")
    cycle = limit_cycle(PRINTED, speed, taylor, digits=30)
    precision, half = bits(560), Fraction(1, 2)
    fine = limit_cycle(PRINTED, speed, taylor, digits=130)
    start = [Exact(Fraction(0), half), Exact(fine.gamma_bar_0.value, half), fine.v_0.value]
    request = Request(
        PRINTED, speed, start, fine.period.value, precision=precision, variations=("beta", "gamma", "v"), domain="none"
    )
    matrix = taylor(request).derivatives
    ctx = precision.context
    rows = ctx.matrix([[precision.mpf(entry) for entry in row] for row in matrix])
    eigenvalues = sorted(ctx.eig(rows, left=False, right=False), key=abs)
    with mpmath.workdps(120):
        fast, slow, trivial = (mpmath.mpf(value.real) for value in eigenvalues)
        assert abs(trivial - 1) < mpmath.mpf(10) ** -100
        assert abs(slow - mpmath.mpf(cycle.multiplier_slow.decimals()[0])) < mpmath.mpf(10) ** -30
        assert abs(mpmath.log(fast) - mpmath.mpf(cycle.log_multiplier_fast.decimals()[0])) < mpmath.mpf(10) ** -28


def test_trivial_multiplier_in_double(taylor) -> None:
    cycle = limit_cycle(PRINTED, below(PRINTED, "0.5"), taylor)
    start = (math.pi / 2, math.pi / 2 + float(cycle.gamma_bar_0), float(cycle.v_0))
    request = Request(
        PRINTED,
        cycle.omega.value,
        start,
        float(cycle.period),
        variations=("beta", "gamma", "v", "Omega"),
        domain="none",
    )
    eigenvalues = numpy.linalg.eigvals(taylor(request).derivatives[:, :3])
    assert min(abs(eigenvalues - 1)) < 1e-12


def test_table_2_converges_quadratically(taylor) -> None:
    """The paper's Table 2 at Omega_crit - 0.5 of the calibrated set, by both forms of shooting."""
    speed = below(CALIBRATED, "0.5")
    shot = shoot(ReturnMap(LIBRATING, CALIBRATED, speed, taylor), (1.69, -1.72))
    assert len(shot.residuals) <= 7
    assert shot.residuals[-1] < 1e-14
    whole = shoot(ReturnMap(WHOLE_PERIOD, CALIBRATED, speed, taylor), (1.69, -1.72))
    assert abs(whole.image.time - float(limit_cycle(CALIBRATED, speed, taylor).period)) < 1e-12
    drops = [math.log10(size) for size in whole.residuals if size > 1e-14]
    assert len(whole.residuals) <= 8
    assert drops[-1] < 1.6 * drops[-2] or drops[-1] < -12  # digits nearly double until round-off


@pytest.mark.parametrize("method", ["DOP853", pytest.param("Radau", marks=pytest.mark.slow)])
def test_scipy_shoots_to_the_same_cycle(taylor, method) -> None:
    speed, guess = below(PRINTED, "0.5"), (1.69, -1.72)
    mine, theirs = (shoot(ReturnMap(LIBRATING, PRINTED, speed, engine), guess) for engine in (taylor, Baseline(method)))
    # SciPy's tolerance of 1e-13 per step; Radau's local error is of a lower order.
    loss = 1e-12 if method == "DOP853" else 1e-10
    assert abs(2 * mine.image.time - 2 * theirs.image.time) < loss
    assert abs(mine.point[0] - theirs.point[0]) < 10 * loss
    assert abs(mine.point[1] - theirs.point[1]) < 10 * loss
    assert abs(mine.image.matrix[0][0] - theirs.image.matrix[0][0]) < 100 * loss


ANYWHERE = {"gamma": decimals("-3.1", "3.1", 3), "v": decimals("-12", "3", 3)}


@settings(max_examples=100)
@given(**ANYWHERE)
def test_newton_from_anywhere_finds_the_cycle_or_says_that_it_did_not(gamma, v) -> None:
    check_start(PRINTED, "0.5", gamma, v)


@pytest.mark.slow
@pytest.mark.parametrize("parameters", SETS, ids=lambda p: p.name)
@pytest.mark.parametrize("distance", ["1e-6", "0.05", "0.5", "0.8"])
@settings(max_examples=1000)
@given(**ANYWHERE)
def test_newton_from_a_thousand_starts(parameters, distance, gamma, v) -> None:
    check_start(parameters, distance, gamma, v)


@lru_cache(maxsize=16)
def balance_at(parameters, distance):
    return balanced_cycle(parameters, below(parameters, distance))


def check_start(parameters, distance: str, gamma: Fraction, v: Fraction) -> None:
    """Around the cycle: a start of its size times up to two, either way. The truth is harmonic balance's."""
    cycle = balance_at(parameters, distance)
    size = float(cycle.gamma_bar_0), float(cycle.v_0)
    guess = (float(gamma) / 1.55 * size[0], -float(v) / 6 * size[1])
    try:
        shot = shoot(ReturnMap(LIBRATING, parameters, below(parameters, distance), _ENGINE), guess)
    except NoSuchCycleError:
        return
    # Near the Hopf point the amplitude reacts to rounding of Omega by its half over the distance.
    loss = 1e-9 + 1e-13 / float(Fraction(distance))
    assert abs(abs(shot.point[0]) / size[0] - 1) < loss
    assert abs(shot.point[1] / size[1] - 1) < loss


@pytest.mark.slow
def test_sensitivities_against_neighbouring_cycles(taylor) -> None:
    speed, step = below(PRINTED, "0.5"), Fraction(1, 10**12)
    here = limit_cycle(PRINTED, speed, taylor, digits=40)
    ends = [limit_cycle(PRINTED, speed + sign * step, taylor, digits=40) for sign in (1, -1)]
    for name, slope in (("period", "dperiod_domega"), ("gamma_bar_0", "dgamma_bar_0_domega"), ("v_0", "dv_0_domega")):
        difference = (getattr(ends[0], name).value - getattr(ends[1], name).value) / (2 * step)
        # Central difference: step^2 times a third derivative of up to 1e3.
        assert abs(difference - getattr(here, slope).value) < Fraction(1, 10**19)


@pytest.mark.parametrize("inertia", ["0.227e-3", "0.229e-3", "0.231e-3"])
def test_subcritical_cycles_are_unstable(taylor, inertia) -> None:
    thin = PRINTED.changed(A=inertia)
    cycle = limit_cycle(thin, omega_crit(thin, 40).value + Fraction(1, 100), taylor)
    assert cycle.stable is False
    assert cycle.multiplier_slow.value > 1


@pytest.mark.slow
def test_command(capsys) -> None:
    assert main(["orbit", "--below-crit", "1e-6", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    for name in MAIN:
        assert Fraction(result[name]["uncertainty"]) <= abs(Fraction(result[name]["value"])) / 10**12 * Fraction(11, 10)
    assert result["stable"] is True
    for wrong in (["--omega", "31"], ["--omega", "29"], ["--omega", "-3"], ["--below-crit", "x"], []):
        assert main(["orbit", *wrong]) == 2
        assert capsys.readouterr().err.count("\n") == 1


def test_refusals(taylor) -> None:
    with pytest.raises(InputError):
        limit_cycle(PRINTED, "0", taylor)
    with pytest.raises(NoSuchCycleError, match="v < 0"):
        shoot(ReturnMap(LIBRATING, PRINTED, "30.4", taylor), (1.7, 1.7))
    with pytest.raises(NoSuchCycleError):
        shoot(ReturnMap(LIBRATING, PRINTED, "31.4", taylor), (0.5, -0.8))
