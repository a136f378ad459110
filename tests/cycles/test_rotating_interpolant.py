"""Rotating cycles in lanes: their half-widths hold, and what lanes cannot do is shot one at a time."""

from __future__ import annotations

from fractions import Fraction

import numpy
import pytest
from tippedisk_verify.cycles.rotating_interpolant import RotatingInterpolant

from tippedisk_verify.atlas.rotating_cycle import of_family, rotating_branch
from tippedisk_verify.cycles.batch_shooting import ROTATING
from tippedisk_verify.cycles.rotating_family import RotatingFamily
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.flow.lanes import BatchTaylor
from tippedisk_verify.model.parameters import PRINTED

_LANES = BatchTaylor()
_FAR = 1.6  # rad/s above the fold: beyond Omega_crit


def drawn(family: RotatingFamily, count: int, seed: int) -> tuple[numpy.ndarray, numpy.ndarray]:
    """Speeds and sides of the fold: even ones, and as many crowded towards the fold, as far as lanes go."""
    random = numpy.random.default_rng(seed)
    fold = family.near_fold().omega  # less than 1e-4 rad/s above it
    stable = random.random(count) < 0.5
    # No closer than 5e-4 rad/s to the fold and a tenth of the stable family to Omega_h: there lanes hold twelve digits.
    width = numpy.where(stable, 0.9 * (float(family.omega_h) - fold), _FAR)
    crowded = 5e-4 * (width / 5e-4) ** random.random(count)
    return fold + numpy.where(
        random.random(count) < 0.5, numpy.maximum(random.random(count) * width, 5e-4), crowded
    ), stable


@pytest.fixture(scope="module")
def family(taylor) -> RotatingFamily:
    return RotatingFamily(PRINTED, taylor)


def test_many_speeds_through_lanes_are_those_of_the_single_road(taylor, family) -> None:
    fold, omega_h = 30.00346, float(family.omega_h)
    inside = numpy.linspace(fold + 1e-3, omega_h - 0.006, 40).tolist()
    beyond = numpy.linspace(omega_h + 1e-4, fold + _FAR, 58).tolist()
    speeds = [fold + 3e-6, *inside, *beyond, omega_h - 1e-3]
    cycles = list(rotating_branch(PRINTED, taylor, speeds))
    order = [(speed, side) for speed in speeds for side in (True, False) if speed < omega_h or not side]
    assert [(float(cycle.omega), cycle.stable) for cycle in cycles] == order
    # Next to the fold, and to Omega_h on the stable side, doubles do not hold the cycles.
    singly = [(float(cycle.omega), cycle.stable) for cycle in cycles if cycle.engine != "lanes"]
    assert singly == [(speeds[0], True), (speeds[0], False), (speeds[-1], True)]
    for index in (2, 3, 41, 80, 81, 100, len(cycles) - 1):
        omega, side = order[index]
        alone = of_family(family, Fraction(omega), stable=side, digits=12)
        for name in ROTATING.numbers:
            one, other = getattr(cycles[index], name), getattr(alone, name)
            assert abs(one.value - other.value) <= one.uncertainty + other.uncertainty, (name, omega)
        for name in ("period", *ROTATING.names, "beta_max"):
            number = getattr(cycles[index], name)
            assert number.uncertainty <= abs(number.value) / 10**12, (name, omega)


def test_the_polynomial_errs_by_little_more_than_rounding(family) -> None:
    """So one Newton step suffices. Nodes next to the fold and to Omega_h feel rounding a hundredfold."""
    speeds, stable = drawn(family, 60, 3)
    found = RotatingInterpolant(family, _LANES, speeds, stable)
    s = found._abscissas(speeds, stable)
    cycles = found.cycles(speeds, stable)
    for column, name in enumerate((*ROTATING.names, "period")):
        away = numpy.abs(
            (found._ratios(s) @ found._known)[:, column] - [float(getattr(cycle, name)) for cycle in cycles]
        )
        assert away.max() < 1e-10, name
        assert numpy.median(away) < 1e-12, name


def test_speeds_below_the_fold_are_refused(taylor) -> None:
    with pytest.raises(NoSuchCycleError, match="fold near"):
        list(rotating_branch(PRINTED, taylor, [30.001 + 0.01 * n for n in range(100)]))
