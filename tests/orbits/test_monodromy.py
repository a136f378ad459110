"""The monodromy matrix, anywhere on a cycle."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import numpy
import pytest

import tippedisk_verify as tv
from tippedisk_verify.model.precision import bits
from tippedisk_verify.orbits.cycles import Cycle


def _cycles(friction: str, digits: int) -> list[Cycle]:
    disk = tv.Disk("printed", friction=friction)
    found: list[Cycle] = [disk.limit_cycle("30.4", digits=digits)]
    return found if friction == "smooth" else [*found, disk.rotating_cycle("30.02", digits=digits)]


@pytest.mark.parametrize("friction", ["linear", "smooth"])
def test_it_is_what_difference_quotients_of_long_numbers_give(friction: str) -> None:
    """Motions of forty digits over a period from a point of the cycle, with each number of that moved by 1e-15."""
    step = Fraction(1, 10**15)
    for mine, sharp in zip(_cycles(friction, 12), _cycles(friction, 40), strict=True):
        period = sharp.period.value
        for share in (Fraction(0), Fraction(1, 3)):
            disk, omega = tv.Disk("printed", friction=friction), sharp.omega.value
            point = [number.value for number in sharp.start]
            since = tv.exact(f"{float(share * period):.3f}").rational
            if since:
                flown = disk.integrate(omega, point, since, digits=40, shifted=True).end.state
                point = [tv.exact(value).rational for value in flown]
            columns = []
            for place in range(3):
                ends = [
                    disk.integrate(
                        omega,
                        [value + sign * step * (n == place) for n, value in enumerate(point)],
                        period,
                        digits=40,
                        shifted=True,
                    ).end.state
                    for sign in (1, -1)
                ]
                columns.append(((ends[0] - ends[1]) / bits(160).number(2 * step)).astype(float))
            truth, found = numpy.column_stack(columns), mine.monodromy(since)
            assert (abs(found.matrix - truth) <= found.uncertainty + numpy.spacing(abs(truth))).all()
            assert (found.uncertainty <= 1e-9 * abs(truth).max()).all()
            slow = sorted(abs(numpy.linalg.eigvals(found)))[-2]
            assert slow == pytest.approx(float(mine.multiplier_slow), abs=1e-8)


@pytest.mark.slow(minutes=0.5)
def test_its_determinant_is_liouvilles() -> None:
    """The product of the multipliers, e^-96, is a difference of numbers of order 1: it takes 90 digits to see it."""
    cycle = tv.Disk("printed").limit_cycle("30.4", digits=90)
    long = bits(600)
    entries = [[long.mpf(entry) for entry in row] for row in cycle.monodromy.matrix]
    determinant = long.context.det(long.context.matrix(entries))
    logarithms = cycle.monodromy.log_multipliers
    assert mpmath.almosteq(mpmath.log(determinant), (logarithms[1] + logarithms[2]).mpf(), rel_eps=1e-14)


def test_next_to_omega_h_the_logarithms_are_left() -> None:
    found = tv.Disk("printed").limit_cycle(above_het="1e-3").monodromy
    assert float(found.log_multipliers[2]) < -200
    assert abs(numpy.linalg.det(found)) < found.uncertainty.max()
    with pytest.raises(tv.InputError, match="a time from 0 to"):
        found(100)
