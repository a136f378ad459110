"""The balls in doubles hold their images on a processor that flushes subnormal numbers, results and operands, to zero.

The mode is set for the operations on lanes only, so what they are held against is computed without it. Where the mode
cannot be set from here, there is nothing to test.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import platform
import random
from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction

import numpy as np
import pytest

from tests.proofs.lane_attacks import ATTACKS, LARGEST, NORMAL, SMALLEST
from tests.proofs.test_lanes_mutants import mutant
from tippedisk_verify.proofs.kernel import lanes
from tippedisk_verify.proofs.kernel.balls import DisturbedError

_CONTROL = 28  # offset of the SSE control word in fenv_t on x86-64
_FLUSH = 1 << 15 | 1 << 6  # results, operands
_DIRECTIONS = {"down": 1 << 13, "up": 2 << 13, "toward zero": 3 << 13}


@contextmanager
def control(bits: int) -> Iterator[None]:
    """The bits set in this thread's control word."""
    library = ctypes.CDLL(ctypes.util.find_library("m"))
    before, within = ctypes.create_string_buffer(64), ctypes.create_string_buffer(64)
    library.fegetenv(before)
    library.fegetenv(within)
    word = int.from_bytes(within.raw[_CONTROL : _CONTROL + 4], "little") | bits
    within[_CONTROL : _CONTROL + 4] = word.to_bytes(4, "little")
    library.fesetenv(within)
    try:
        yield
    finally:
        library.fesetenv(before)


pytestmark = pytest.mark.skipif(
    platform.system() != "Linux" or platform.machine() != "x86_64", reason="no way to set the mode is known here"
)


@pytest.fixture(scope="module")
def flushed():
    """A copy of `lanes` whose operations run in that mode."""
    quietly = '    with np.errstate(all="ignore"):\n        before'
    module = mutant(quietly, quietly.replace(":\n", ", flushing():\n"))
    module.flushing = lambda: control(_FLUSH)
    return module


def test_the_mode_is_what_is_said(flushed) -> None:
    small = np.array([SMALLEST, 0.75 * NORMAL])
    with flushed.quiet():
        assert not (small + 0.0).view(np.uint64).any()
        assert not (np.full(2, NORMAL) * 0.5).view(np.uint64).any()
    assert (small + 0.0).view(np.uint64).all()


@pytest.mark.slow
@pytest.mark.parametrize("attack", [name for name in ATTACKS if name != "sines_are_sharp"])
def test_no_attack_breaks_the_balls(flushed, attack) -> None:
    ATTACKS[attack](flushed, 3000)


def test_the_loss_of_small_numbers_is_paid_for(flushed) -> None:
    """What is read as zero, and a large factor behind it."""
    tiny = flushed.Lanes([SMALLEST, 0.75 * NORMAL, -SMALLEST], [0.0, SMALLEST, 0.0])
    product = LARGEST * tiny
    for lane, value in enumerate((SMALLEST, 0.75 * NORMAL, -SMALLEST)):
        assert abs(LARGEST * value - product.midpoints[lane]) <= product.radii[lane]


@pytest.mark.parametrize("direction", _DIRECTIONS)
def test_another_rounding_mode_is_refused(direction) -> None:
    x = lanes.Lanes([1.0])
    with pytest.raises(DisturbedError, match="nearest"), control(_DIRECTIONS[direction]):
        x + x
    assert (x + x).is_finite().all()


def test_convolutions_of_small_numbers_hold(flushed) -> None:
    """What a term's rounding loses in an underflow is multiplied by the other factor."""
    rng, width, k = random.Random(1), 2000, 16
    first, second = (
        [
            np.array([rng.choice((-1, 1)) * rng.uniform(0.5, 1) for _ in range(width)]) * size * 2.0 ** (-decay * i)
            for i in range(k)
        ]
        for size, decay in ((2.0**30, 0.7), (2.0**-975, 0))
    )
    series = flushed.LaneSeries(width), flushed.LaneSeries(width)
    for one, coefficients in zip(series, (first, second), strict=True):
        for part in coefficients:
            one.append(flushed.Lanes(part))
    found = series[0].convolution(series[1])
    for lane in range(width):
        exact = sum(Fraction(float(first[i][lane])) * Fraction(float(second[k - 1 - i][lane])) for i in range(k))
        assert abs(exact - Fraction(float(found.midpoints[lane]))) <= Fraction(float(found.radii[lane]))
