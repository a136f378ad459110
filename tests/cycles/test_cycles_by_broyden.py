"""Limit cycles close to Omega_h: half-widths and the law of the period."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest

from tippedisk_verify import (
    PRINTED,
    Measured,
    heteroclinic,
    omega_crit,
)
from tippedisk_verify.cycles.cycle_at_speed import librating_cycle_at
from tippedisk_verify.cycles.near_omega_h.cycles_by_broyden import with_uncertainty_of_omega_h
from tippedisk_verify.cycles.near_omega_h.period_continuation import PeriodContinuation
from tippedisk_verify.cycles.shooting.section import LIBRATING


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
