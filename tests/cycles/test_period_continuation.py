"""The family by its period: the same cycles, the way to Omega_h, and the half-widths there."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import pairwise

import pytest

from tippedisk_verify import (
    CALIBRATED,
    DOUBLE,
    PRINTED,
    Measured,
    bisect_omega_h,
    equilibrium,
    heteroclinic,
    omega_crit,
    shoot_limit_cycle,
)
from tippedisk_verify.cycles.cycle_at_speed import librating_cycle_at
from tippedisk_verify.cycles.near_omega_h.cycles_by_broyden import with_uncertainty_of_omega_h
from tippedisk_verify.cycles.near_omega_h.period_continuation import (
    PeriodContinuation,
    cycle_at_half_period,
    cycles_of_rising_period,
)
from tippedisk_verify.cycles.shooting.section import LIBRATING
from tippedisk_verify.errors import NoSuchCycleError


def first_of(parameters, taylor):
    cycle = shoot_limit_cycle(parameters, "30.3", taylor, precision=DOUBLE)
    guess = (float(cycle.gamma_bar_0), float(cycle.v_0), 30.3)
    return cycle, cycle_at_half_period(parameters, float(cycle.period) / 2, guess, taylor)


def test_a_cycle_and_its_slopes(taylor) -> None:
    cycle, point = first_of(PRINTED, taylor)
    by_gamma_bar, by_v, by_omega = point.slopes  # along the half period
    # A half-width is some ten times the error, and the point is as sharp as the cycle.
    assert abs(point.omega - 30.3) < abs(by_omega) * cycle.period.uncertainty + 2 * 2.0**-49
    assert cycle.dperiod_domega.holds(2 / by_omega)
    assert cycle.dgamma_bar_0_domega.holds(by_gamma_bar / by_omega)
    assert cycle.dv_0_domega.holds(by_v / by_omega)


@pytest.mark.parametrize(
    "parameters",
    [pytest.param(PRINTED, marks=pytest.mark.slow(minutes=0.1)), CALIBRATED],
    ids=lambda p: p.name,
)
def test_lengthening_leads_to_omega_h(taylor, parameters) -> None:
    """Steps in the period reach Omega_h + 2e-10 in double; T grows like -2 / lambda_u
    log(Omega - Omega_h).
    """
    omega_h = bisect_omega_h(parameters, taylor).omega_h
    points = list(
        cycles_of_rising_period(parameters, first_of(parameters, taylor)[1], taylor, longest=8.0)
    )
    assert len(points) < 25
    above = [point.omega - float(omega_h) for point in points]
    assert above[-1] < 2e-10
    assert all(a > b for a, b in pairwise(above))
    growth = max(
        float(eigenvalue.re)
        for eigenvalue in equilibrium(parameters, omega_h.value, "noninverted").eigenvalues
    )
    slope = 2 * (points[-1].half_period - points[-2].half_period) / math.log(above[-1] / above[-2])
    # The law's remainder falls like the power |lambda_s| / lambda_u - 1 = 0.22: at 2e-7 it is 0.03
    # of 7.6.
    assert abs(slope * growth / -2 - 1) < 0.01
    alone = shoot_limit_cycle(parameters, Fraction(float(points[-4].omega)), taylor, digits=20)
    # T reacts to a rounding of Omega by 2 / (lambda_u (Omega - Omega_h)).
    loss = 50 * 2**-53 * 30 * 2 / growth / above[-4]
    assert abs(2 * points[-4].half_period - float(alone.period)) < loss


def test_a_message_names_the_period_at_which_double_drowns(taylor) -> None:
    with pytest.raises(NoSuchCycleError, match="rounding swamps"):
        list(cycles_of_rising_period(PRINTED, first_of(PRINTED, taylor)[1], taylor, longest=14.0))


def test_a_bad_guess_is_refused(taylor) -> None:
    with pytest.raises(NoSuchCycleError):
        cycle_at_half_period(PRINTED, 0.6, (0.1, -5.0, 35.0), taylor)


# ------------------------------------------------------------- the speed's uncertainty, and the law
@pytest.mark.parametrize("above", [pytest.param("1e-7", marks=pytest.mark.slow), "0.01", "0.8"])
def test_every_half_width_holds_the_speeds_uncertainty(taylor, above) -> None:
    """The reference is the cycle at a speed moved by its half-width, near Omega_h, between, and
    near Omega_crit.
    """
    omega_h = heteroclinic(PRINTED, taylor, digits=20).omega_h
    distance = Fraction(above)
    room = omega_crit(PRINTED, 20).value - omega_h.value
    off = min(distance, room - distance) / 1000
    here, there = (
        librating_cycle_at(PRINTED, omega_h.value + distance + change, taylor, digits=9)
        for change in (0, off)
    )
    widened = with_uncertainty_of_omega_h(
        here, LIBRATING, Measured(omega_h.value, off), distance, room, taylor
    )
    over = []
    for name in widened.__dataclass_fields__:
        number = getattr(widened, name)
        if isinstance(number, Measured) and name != "trivial_multiplier_defect":
            change = abs(getattr(there, name).value - number.value)
            assert change <= number.uncertainty, name
            over.append(float(number.uncertainty / change))
    assert sorted(over)[len(over) // 2] < 20


def test_the_periods_slope_tends_to_the_laws(taylor) -> None:
    """Cycle by cycle in double, the difference of the slopes falls with the power of the law's
    remainder.
    """
    unstable, slow, _ = (float(v) for v in heteroclinic(PRINTED, taylor).saddle_eigenvalues)
    rows = PeriodContinuation(PRINTED, taylor).law_rows(unstable)
    lacking = [ratio - 1 for _, _, ratio in rows]
    assert lacking == sorted(lacking, reverse=True)
    # The rows reach as close to Omega_h as doubles resolve.
    assert rows[-1][0] < 1e-9
    power = math.log(lacking[-2] / lacking[-1]) / math.log(rows[-2][0] / rows[-1][0])
    # The next power of the remainder is twice the first
    assert abs(power / (-slow / unstable - 1) - 1) < 0.05
