"""Next to l_1 = 0 the range of hysteresis grows with the square of the distance."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise

import mpmath
import pytest

from tippedisk_verify import (
    PRINTED,
    Taylor,
    collocation_cycle,
    hopf_point,
    omega_crit,
    shoot_limit_cycle,
)
from tippedisk_verify.cycles.families.folds import librating_folds
from tippedisk_verify.theory.hopf import speed_below_crit

_SHRINKING = 4  #: of the distance from one fold to the next
#: Of Table 1's disks, the A at which l_1 = 0: Bbar r (2 r - e) / (2 (r + e) (r - 2 e)) [kg m^2].
_A_B = "0.000232396689967105263157894736842105263"
#: With Omega = Omega_crit + c_1 a^2 + c_2 a^4, a prime for d/dA at A_B and d = A_B - A: the limits
#: for d to 0 of (Omega - Omega_crit) / d^2 at the fold, -c_1'^2 / (4 c_2), and of its a^2 / d, c_1'
#: / (2 c_2) [SI].
_FOLD_SPEED_CURVATURE, _FOLD_AMPLITUDE_SLOPE = "21410609282.3273578", "2798494.76137316390"


def extrapolated(values: Sequence[mpmath.mpf]) -> mpmath.mpf:
    """Return the limit of a power series f(d) by Richardson extrapolation.

    The values are at d, d / 4, d / 16, ...
    """
    level, row = 1, list(values)
    while len(row) > 1:
        factor = _SHRINKING**level
        row = [(factor * near - far) / (factor - 1) for far, near in pairwise(row)]
        level += 1
    return row[0]


@pytest.mark.slow
def test_exponent_and_prefactor_of_the_range_of_hysteresis(taylor: Taylor) -> None:
    """Find folds of cycles for A below A_B by 1e-7 kg m^2 and three smaller distances.

    Omega_crit does not depend on A.
    """
    crit = omega_crit(PRINTED, 40)
    with mpmath.workdps(30):
        distances = [mpmath.mpf(10) ** -7 / _SHRINKING**n for n in range(4)]
        ranges, squares = [], []
        for distance in distances:
            A = str(mpmath.mpf(_A_B) - distance)
            (fold,) = librating_folds(PRINTED.changed(A=A, C=None), taylor, digits=20)
            ranges.append((fold.omega - crit).mpf())
            squares.append(fold.gamma_bar_0.mpf() ** 2)
        prefactors = [
            width / distance**2 for width, distance in zip(ranges, distances, strict=True)
        ]
        limit = extrapolated(prefactors)
        # Each prefactor is off by a term of first order in the distance. What is left of the four
        # after extrapolation is of fourth order: about the product of their errors, up to a factor
        # of order one to the fourth power.
        left = mpmath.fprod(abs(prefactor / limit - 1) for prefactor in prefactors) * 3**4
        assert left < 1e-5  # so that the comparison shows five digits
        assert abs(limit / mpmath.mpf(_FOLD_SPEED_CURVATURE) - 1) < left
        exponents = [mpmath.log(far / near, _SHRINKING) for far, near in pairwise(ranges)]
        off = mpmath.fprod(abs(exponent - 2) for exponent in exponents) * 3**3
        # The bound itself is a share of the exponent, 2.
        assert off < 1e-2
        assert abs(extrapolated(exponents) - 2) < off
        slope = extrapolated(
            [square / distance for square, distance in zip(squares, distances, strict=True)]
        )
        assert abs(slope / mpmath.mpf(_FOLD_AMPLITUDE_SLOPE) - 1) < left


@pytest.mark.parametrize(
    "beside",
    [
        pytest.param("0", marks=pytest.mark.slow),
        pytest.param("1e-34", marks=pytest.mark.slow),
        "-1e-34",
    ],
)
def test_cycles_of_a_disk_at_a_generalized_hopf_point_and_next_to_it(
    taylor: Taylor, beside: str
) -> None:
    """Check Omega = Omega_crit + c_2 a^4 for r = 4 e and A = 7 Bbar / 5.

    Shooting and harmonic balance both find the cycles.
    """
    disk = PRINTED.changed(
        r="0.04", e="0.01", m="0.4", B="0.2e-3", A=Fraction("0.224e-3") + Fraction(beside), C=None
    )
    distance = Fraction(1, 10**7)
    speed = speed_below_crit(disk, distance, 12).value
    cycle = shoot_limit_cycle(disk, speed, taylor)
    fourth = float(distance) / -float(hopf_point(disk).quartic_coefficient)
    # The next term of the law is smaller by about a^2, a thousandth.
    assert abs(float(cycle.gamma_bar_0) ** 4 / fourth - 1) < 3e-3
    assert cycle.stable
    balanced = collocation_cycle(disk, speed)
    assert (cycle.period - balanced.period).holds(0)
