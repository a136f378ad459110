"""Next to the Bautin point the range of hysteresis grows with the square of the distance, as the theory says."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import mpmath

from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.orbits.folds import libration_folds
from tippedisk_verify.theory.codimension_two import bautin_points
from tippedisk_verify.theory.hopf import omega_crit

_SHRINKING = 4  #: of the distance from one fold to the next


def extrapolated(values: Sequence[mpmath.mpf]) -> mpmath.mpf:
    """The limit of f(d), a power series in d, from its values at d, d / 4, d / 16, ... (Richardson)."""
    level, row = 1, list(values)
    while len(row) > 1:
        factor = _SHRINKING**level
        row = [(factor * near - far) / (factor - 1) for far, near in pairwise(row)]
        level += 1
    return row[0]


def test_exponent_and_prefactor_of_the_range_of_hysteresis(taylor: Taylor) -> None:
    """Folds of cycles for A below A_B by 1e-7 kg m^2 and three smaller distances; Omega_crit does not depend on A."""
    (point,) = bautin_points(PRINTED, "A", 20)
    crit = omega_crit(PRINTED, 40)
    with mpmath.workdps(30):
        distances = [mpmath.mpf(10) ** -7 / _SHRINKING**n for n in range(4)]
        ranges, squares = [], []
        for distance in distances:
            A = str(point.value.mpf() - distance)
            (fold,) = libration_folds(PRINTED.changed(A=A, C=None), taylor, digits=20)
            ranges.append((fold.omega - crit).mpf())
            squares.append(fold.gamma_bar_0.mpf() ** 2)
        prefactors = [width / distance**2 for width, distance in zip(ranges, distances, strict=True)]
        limit = extrapolated(prefactors)
        # Each prefactor is off by a term of first order in the distance. What is left of the four after extrapolation
        # is of fourth order: about the product of their errors, up to a factor of order one to the fourth power.
        left = mpmath.fprod(abs(prefactor / limit - 1) for prefactor in prefactors) * 3**4
        assert left < 1e-5
        assert abs(limit / point.fold_speed_curvature.mpf() - 1) < left
        exponents = [mpmath.log(far / near, _SHRINKING) for far, near in pairwise(ranges)]
        off = mpmath.fprod(abs(exponent - 2) for exponent in exponents) * 3**3
        assert off < 1e-2
        assert abs(extrapolated(exponents) - 2) < off
        slope = extrapolated([-square / distance for square, distance in zip(squares, distances, strict=True)])
        assert abs(slope / point.fold_amplitude_slope.mpf() - 1) < left
