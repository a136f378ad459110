"""Cycles by passages against flights over the whole cycle."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import pytest

from tippedisk_verify import (
    DOUBLE,
    EXTENDED,
    PRINTED,
    ScipyEngine,
    bisect_omega_h,
    cycle_above_omega_h,
)
from tippedisk_verify.connection.splitting import splitting_zero
from tippedisk_verify.cycles.near_omega_h.cycles_by_broyden import cycle_by_broyden
from tippedisk_verify.cycles.near_omega_h.cycles_by_passages import cycle_by_passages
from tippedisk_verify.cycles.shooting.cycle_numbers import number_names
from tippedisk_verify.cycles.shooting.section import LIBRATING, ROTATING, Section
from tippedisk_verify.numbers.precision import wider_precision

pytestmark = pytest.mark.skipif(
    wider_precision(DOUBLE) != EXTENDED, reason="needs numbers of 64 bits"
)


def compare(taylor, parameters, section: Section, distance: str) -> None:
    """Assert that each half-width holds the number of quadruple precision, and is not 10,000
    times too wide.
    """
    guess = bisect_omega_h(parameters, taylor, confirm=False).omega_h.value
    omega_h = splitting_zero(parameters, guess, taylor, 20).omega_h.value
    omega = omega_h + (1 if section is LIBRATING else -1) * Fraction(distance)
    quick = cycle_by_passages(section, parameters, omega, taylor, 12)
    flown = cycle_by_broyden(section, parameters, omega, omega_h, taylor, digits=16)
    assert flown.precision == "quadruple"
    assert quick.precision == "extended"
    for name in number_names(section):
        mine, truth = getattr(quick, name), getattr(flown, name)
        assert mine.holds(truth.value), name
        assert 100 * truth.uncertainty < mine.uncertainty, name
        assert mine.uncertainty < 10**4 * (
            abs(mine.value - truth.value) + abs(truth.value) / 2**64
        ), name


@pytest.mark.parametrize(
    ("law", "section"),
    [
        pytest.param("smooth", LIBRATING, id="smooth", marks=pytest.mark.slow),
        pytest.param("linear", ROTATING, id="linear"),
    ],
)
def test_half_widths_hold(taylor, law, section) -> None:
    compare(taylor, PRINTED.changed(friction=law), section, "1e-6")


@pytest.mark.slow(minutes=0.2)
@pytest.mark.parametrize("section", [LIBRATING, ROTATING], ids=["librating", "rotating"])
@pytest.mark.parametrize("law", ["linear", "smooth"])
def test_half_widths_hold_at_the_largest_distance(taylor, law, section) -> None:
    compare(taylor, PRINTED.changed(friction=law), section, "3.9e-5")


def test_distances_share_one_omega_h(taylor) -> None:
    cycle_above_omega_h(PRINTED, "1e-2", taylor)
    computed = splitting_zero.cache_info().misses
    for distance in ("3e-3", "1e-4", "1e-6", "1e-12"):
        cycle_above_omega_h(PRINTED, distance, taylor)
    assert splitting_zero.cache_info().misses == computed


def test_orbits_close(taylor) -> None:
    """Half a period leads to the image of the start, in doubles and in the bits that a closer start
    needs.
    """
    for distance in ("1e-6", "1e-12"):
        _, states = cycle_above_omega_h(PRINTED, distance, taylor).orbit(3, shifted=True)
        # Rounding of the state, 1e-16, grows by 1 / D = 1e6 past the saddle.
        assert abs(states[:, 1] + states[:, 0]).max() < 1e-9


@pytest.mark.slow(minutes=0.3)
def test_passages_give_no_answer_beyond_their_reach(taylor) -> None:
    """They fail for more digits than 64 bits have, on the other side of Omega_h, and without
    numbers of 64 bits.
    """
    above = Fraction(1, 10**7)
    for place, engine, digits in (
        (above, taylor, 16),
        (-above, taylor, 12),
        (above, ScipyEngine("DOP853"), 12),
    ):
        assert (
            cycle_by_passages(LIBRATING, PRINTED, place, engine, digits, from_omega_h=True) is None
        )
    assert cycle_above_omega_h(PRINTED, above, taylor, digits=16).precision != "extended"


@pytest.mark.slow(minutes=1.5)
@pytest.mark.parametrize("law", ["linear", "smooth"])
def test_monodromy_matrix(taylor, law) -> None:
    """The reference is a run of the variational equations along a whole period, from a start of
    more digits.
    """
    parameters = PRINTED.changed(friction=law)
    quick = cycle_above_omega_h(parameters, "1e-6", taylor).monodromy
    flown = replace(
        cycle_above_omega_h(parameters, "1e-6", taylor, digits=20), _start_matrix=None
    ).monodromy
    truth = EXTENDED.array(flown.matrix.ravel().tolist()).reshape(3, 3)
    assert (abs(quick.matrix - truth) <= quick.uncertainty + flown.uncertainty).all()
    # As the cycle itself, the matrix comes with 13 digits and more.
    assert (quick.uncertainty < 1e-12).all()
    assert (flown.uncertainty < quick.uncertainty).all()
