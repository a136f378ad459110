"""No false proof: random tries with wrong boxes and poor precisions, against the ordinary road."""

from __future__ import annotations

import random
from fractions import Fraction

import pytest

from tests.certified.cases import NUMBERS, random_cycle
from tippedisk_verify.certified.balls import ball, ball_constants, measured, working_precision
from tippedisk_verify.certified.cycle import prove_cycle
from tippedisk_verify.certified.flow import Model
from tippedisk_verify.certified.krawczyk import inclusion
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.orbits.periodic import LimitCycle


def agree(mine: Measured, other: Measured) -> bool:
    """Both claim to hold the same number."""
    return abs(mine.value - other.value) <= mine.uncertainty + other.uncertainty


def one_try(rng: random.Random, cycles: list[tuple[object, Fraction, LimitCycle]]) -> tuple[bool, bool]:
    """Krawczyk's test on a box that may or may not hold the cycle: (whether it does, whether the test says so)."""
    parameters, omega, cycle = rng.choice(cycles)
    truth = (cycle.gamma_bar_0, cycle.v_0)
    off = 10 ** rng.uniform(-12, -2)
    size = off * 10 ** rng.uniform(-1, 3)  # from a tenth of the distance to a thousand times it
    with working_precision(rng.randint(30, 64)):
        model = Model(ball_constants(parameters), ball(omega))
        middle = [ball(part.value * (1 + Fraction(off * rng.uniform(-1, 1)))).mid() for part in truth]
        radii = [abs(part) * ball(Fraction(size)) for part in middle]
        found = inclusion(model, middle, radii)
        inside = all(
            abs(part.value - measured(point).value) <= measured(radius.lower()).value
            for part, point, radius in zip(truth, middle, radii, strict=True)
        )
        if found.included:
            # What is proved: a fixed point in K, which is part of the box. The box is small enough for it to be ours.
            for part, image in zip(truth, found.image, strict=True):
                assert agree(measured(image), part), (parameters, omega, off, size)
    return inside, found.included


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_a_thousand_boxes_of_about_eight_digits(taylor, seed) -> None:
    """50 tries for each of 20 seeds. A box without the cycle is never said to hold one."""
    rng = random.Random(seed)
    cycles = [random_cycle(rng, taylor, 12) for _ in range(3)]
    outcomes = [one_try(rng, cycles) for _ in range(50)]
    assert (False, True) not in outcomes
    assert (False, False) in outcomes
    assert (True, True) in outcomes


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 120))
def test_twenty_proofs_of_forty_digits(taylor, seed) -> None:
    """A random set and speed from a guess that is up to 1 % wrong; whatever is proved holds the 50-digit values."""
    rng = random.Random(seed)
    parameters, omega, cycle = random_cycle(rng, taylor, 50)
    spoilt = 10 ** rng.uniform(-12, -2)
    guess = [part.value * (1 + Fraction(spoilt * rng.uniform(-1, 1))) for part in (cycle.gamma_bar_0, cycle.v_0)]
    proof = prove_cycle(parameters, omega, guess, digits=40)
    assert proof.proved, proof.statement
    assert proof.stable is cycle.stable
    for name, mine in proof.numbers().items():
        assert agree(mine, getattr(cycle, name)), name
    for name in NUMBERS[:4]:
        mine = proof.numbers()[name]
        assert mine.uncertainty <= abs(mine.value) / 10**40, name
