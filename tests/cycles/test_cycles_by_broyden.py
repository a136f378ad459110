"""Limit cycles close to Omega_h: closure, laws and refusals."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest

from tippedisk_verify import (
    CALIBRATED,
    PRINTED,
    Measured,
    Request,
    cycle_above_omega_h,
    heteroclinic,
    omega_crit,
    precision_of_bits,
)
from tippedisk_verify.cycles.cycle_at_speed import librating_cycle_at
from tippedisk_verify.cycles.near_omega_h.cycles_by_broyden import with_uncertainty_of_omega_h
from tippedisk_verify.cycles.near_omega_h.period_continuation import PeriodContinuation
from tippedisk_verify.cycles.shooting.section import LIBRATING
from tippedisk_verify.numbers.exact import fraction


@pytest.mark.slow(minutes=0.8)
@pytest.mark.parametrize("distance", ["1e-10", "1e-60"])
def test_cycles_close(taylor, distance: str) -> None:
    """In a higher precision, half a period maps the state onto its image, up to its half-width."""
    cycle = cycle_above_omega_h(CALIBRATED, distance, taylor, digits=15)
    assert cycle.period.uncertainty <= cycle.period.value / 10**15
    zeros = -math.log10(float(Fraction(distance)))
    precision = precision_of_bits(int((60 + 1.8 * zeros) * math.log2(10)))
    start = (0, cycle.gamma_bar_0.value, cycle.v_0.value)
    half = cycle.period.value / 2
    end = taylor(
        Request(
            CALIBRATED,
            cycle.omega.value,
            start,
            half,
            shifted=True,
            precision=precision,
            domain="none",
        )
    ).state
    # An error of the state or of Omega grows like 1 / D on the way; that of T moves the end by the
    # speed there.
    grown = (
        cycle.gamma_bar_0.uncertainty + cycle.v_0.uncertainty + cycle.omega.uncertainty
    ) / Fraction(distance)
    moved = cycle.period.uncertainty * (1 + abs(cycle.v_0.value) * 100)
    for there, here in zip(end, start, strict=True):
        assert abs(fraction(there) + fraction(here)) <= 100 * grown + moved


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
