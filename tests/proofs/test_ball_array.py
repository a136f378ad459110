"""Balls in doubles: no attack breaks them, the recurrences on them hold Arb's coefficients, planted
faults are noticed.

A fault is a piece of the module's text, which must occur exactly once, what replaces it, and the
attack that is to notice. A mutant that fails in another way than by a false ball counts as noticed
as well: it cannot prove anything.

The balls hold their images as well on a processor that flushes subnormal numbers, results and
operands, to zero. The mode is set for the operations on them only, so what they are held against is
computed without it.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import math
import platform
import random
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numpy as np
import pytest

from tests.proofs.ball_array_attacks import ATTACKS
from tippedisk_verify.model.parameters import PRINTED, Constants
from tippedisk_verify.proofs.ball_conversions import ball_constants
from tippedisk_verify.proofs.kernel import ball_array, doubles
from tippedisk_verify.proofs.kernel.ball_array import BallArray, BallArraySeries
from tippedisk_verify.proofs.kernel.balls import DisturbedError, arb, ball, working_precision
from tippedisk_verify.proofs.kernel.proved_flow import EnclosedField

ORDER = 20
COUNT = 1500  # cases of an attack: enough for each planted fault
WIDTHS = (0.0, 1e-12, 1e-8, 1e-6, 1e-3)


@pytest.mark.parametrize(
    "count", [COUNT, pytest.param(15_000, marks=pytest.mark.slow(minutes=0.5))]
)
@pytest.mark.parametrize("attack", ATTACKS)
def test_no_attack_breaks_the_balls(attack, count) -> None:
    ATTACKS[attack](ball_array, count)


def test_what_is_no_array_of_doubles_is_refused() -> None:
    with pytest.raises(ValueError, match="one-dimensional"):
        BallArray(np.zeros((2, 2)))
    for other in (
        [2**60 + 1],
        3,
        [0.5, 2**60 + 1],
        np.array([1]),
        np.zeros(1, dtype=np.longdouble),
        ["1"],
    ):
        with pytest.raises(TypeError, match="doubles"):
            BallArray(other)
        with pytest.raises(TypeError, match="doubles"):
            BallArray([1.0], other)
    short, long = BallArraySeries(1), BallArraySeries(1)
    long.append(BallArray([1.0]))
    assert short.convolution(short) == 0
    with pytest.raises(ValueError, match="one length"):
        short.convolution(long)


def test_the_variational_coefficients_hold_those_of_arb() -> None:
    """To order 20: those of points of each box, of widths from none to far more than proofs use."""
    rng, count, finite = random.Random(11), 40, []
    columns = [
        [(middle + rng.uniform(-size, size), rng.choice(widths)) for _ in range(count)]
        for middle, size, widths in (
            (0, 1.2, WIDTHS),
            (0, 3, WIDTHS),
            (0, 6, WIDTHS),
            (30, 10, (0.0, 1e-9, 1e-4)),
        )
    ]
    *state, speeds = (BallArray(*np.array(column).T) for column in columns)
    field = EnclosedField(
        Constants(*(BallArray.of([value]) for value in ball_constants(PRINTED))), speeds
    )
    tangents = [int(row == column) for column in range(4) for row in range(3)]
    found = field.variational_system.coefficients(
        [*state, *(BallArray(np.full(count, float(x))) for x in tangents)], ORDER
    )
    thin = field.midpoint_system.coefficients([part.mid() for part in state], ORDER)
    with working_precision(200):
        for place in range(count):
            for turn in range(3):
                shares = [
                    rng.choice((-1.0, 1.0, rng.uniform(-1, 1))) if turn else 0.0 for _ in range(4)
                ]
                *point, omega = (
                    arb(column[place][0]) + arb(column[place][1]) * arb(share)
                    for column, share in zip(columns, shares, strict=True)
                )
                exact = EnclosedField(ball_constants(PRINTED), omega)
                images = exact.variational_system.coefficients(
                    [*point, *map(ball, tangents)], ORDER
                )
                pairs = [
                    *zip(found, images, strict=True),
                    *(() if turn else zip(thin, images[:3], strict=True)),
                ]
                for series, image in pairs:
                    for mine, true in zip(series, image, strict=True):
                        _assert_within(mine, place, true)
                        finite.append(mine.is_finite()[place])
    assert sum(finite) > 0.9 * len(finite)


def _assert_within(found: BallArray, place: int, image: object) -> None:
    radius = float(found.radii[place])
    if radius < math.inf:
        # The exact images are computed in 128 bits and more; they must not decide.
        assert image.rad() < 1e-30 * (1 + abs(image.mid()))
        assert not abs(image - arb(float(found.midpoints[place]))) > arb(radius)


def test_an_earlier_result_is_not_overwritten() -> None:
    constants = Constants(*(BallArray.of([value]) for value in ball_constants(PRINTED)))
    field = EnclosedField(constants, BallArray(np.full(2, 30.4)))
    first = field.midpoint_system.coefficients(
        [BallArray([0.1, 0.2]), BallArray([0.3, 0.4]), BallArray([0.5, 0.6])], 5
    )
    kept = [part.midpoints.copy() for part in first[2]]
    field.midpoint_system.coefficients(
        [BallArray([1.1, 1.2]), BallArray([0.3, 0.4]), BallArray([0.5, 0.6])], 5
    )
    assert all((a == b.midpoints).all() for a, b in zip(kept, first[2], strict=True))


# ----------------------------------------------------------------------------------- planted faults
MODULES = (ball_array, doubles)
SOURCES = {module: Path(module.__file__).read_text(encoding="utf-8") for module in MODULES}


class Fault(NamedTuple):
    name: str
    old: str
    new: str
    attack: str


FAULTS = [
    Fault(
        "radii are rounded down",
        "_RADIUS_FACTOR = 1 + 16 * UNIT_ROUNDOFF",
        "_RADIUS_FACTOR = 1 - 16 * UNIT_ROUNDOFF",
        "binary",
    ),
    Fault(
        "no term for underflow",
        "_UNDERFLOW_ALLOWANCE = 2.0**-1000",
        "_UNDERFLOW_ALLOWANCE = 0.0",
        "binary",
    ),
    Fault("a forgotten ulp: no midpoint's rounding", "    radius += rounding\n", "", "binary"),
    Fault(
        "a sum's radii are subtracted",
        "self._mid + b._mid, self._rad + b._rad",
        "self._mid + b._mid, np.abs(self._rad - b._rad)",
        "binary",
    ),
    Fault("the product's cross term is missing", "        upper += b._rad\n", "", "binary"),
    Fault(
        "integers beyond 2^53 count as floats",
        "_EXACT_INTEGERS = 2**53",
        "_EXACT_INTEGERS = 2**90",
        "unary",
    ),
    Fault("a divisor may hold zero", "~(distance > 0)", "distance == 0", "binary"),
    Fault(
        "the quotient forgets the divisor's radius",
        "        radius *= b._rad / distance + _UNDERFLOW_ALLOWANCE\n",
        "        radius *= _UNDERFLOW_ALLOWANCE\n",
        "binary",
    ),
    Fault("pi ends after its second part", "_HALF_PI_B) - n * _HALF_PI_C", "_HALF_PI_B)", "sines"),
    Fault(
        "the cosine's rounding is dropped",
        "reduction_error + 2.5 * UNIT_ROUNDOFF",
        "reduction_error",
        "sines",
    ),
    Fault("the sine's curvature is dropped", "slope * r + 0.5 * r * r", "slope * r", "sines"),
    Fault(
        "what touches zero is positive",
        "(self._mid > self._rad)",
        "(self._mid >= self._rad)",
        "predicates",
    ),
    Fault(
        "the convolution's sum is not rounded",
        "(self._length + 0.5) * UNIT_ROUNDOFF",
        "0",
        "convolutions",
    ),
    Fault(
        "the convolution's radius is rounded to nearest",
        "1 + (4 * k + 32) * UNIT_ROUNDOFF",
        "1.0",
        "convolutions",
    ),
    Fault(
        "the convolution's radius misses its cross terms",
        "        np.add(size, rad, out=upper)\n",
        "        upper[:] = size\n",
        "convolutions",
    ),
    Fault(
        "what comes in is rounded to nearest",
        "if Fraction(nearest) >= value else",
        "if True else",
        "conversions",
    ),
    Fault(
        "subnormal midpoints come in",
        "        m[small] = 0.0\n",
        "        r[small] = 0.0\n",
        "binary",
    ),
]


def executed(source: str) -> ModuleType:
    """A module of this text."""
    module = ModuleType("copy_of_a_module")
    sys.modules[module.__name__] = module  # dataclasses look there
    try:
        exec(compile(source, module.__name__, "exec"), module.__dict__)
    finally:
        del sys.modules[module.__name__]
    return module


def mutant(old: str, new: str) -> ModuleType:
    """A copy of `ball_array`, with copies of what belongs to it; the fault is planted in the
    one that has its text.
    """
    assert sum(source.count(old) for source in SOURCES.values()) == 1, old
    copies = {original: executed(source.replace(old, new)) for original, source in SOURCES.items()}
    copies[ball_array].sine_and_cosine = copies[doubles].sine_and_cosine
    copies[ball_array].outward_rounded = copies[doubles].outward_rounded
    return copies[ball_array]


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_every_fault_is_noticed(fault) -> None:
    faulty = mutant(fault.old, fault.new)
    with np.errstate(all="ignore"), pytest.raises((AssertionError, ValueError)):
        ATTACKS[fault.attack](faulty, COUNT)


# ------------------------------------------------------- a processor that flushes subnormal numbers
_CONTROL = 28  # offset of the SSE control word in fenv_t on x86-64
_FLUSH = 1 << 15 | 1 << 6  # results, operands


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


WHERE_THE_MODE_CAN_BE_SET = pytest.mark.skipif(
    platform.system() != "Linux" or platform.machine() != "x86_64",
    reason="no way to set the mode is known here",
)


@pytest.fixture(scope="module")
def flushed():
    """A copy of `ball_array` whose operations run in that mode."""
    quietly = '    with np.errstate(all="ignore"):\n        before'
    module = mutant(quietly, quietly.replace(":\n", ", flushing():\n"))
    module.flushing = lambda: control(_FLUSH)
    return module


@WHERE_THE_MODE_CAN_BE_SET
@pytest.mark.parametrize("attack", ATTACKS)
def test_no_attack_breaks_the_balls_where_small_numbers_are_flushed(flushed, attack) -> None:
    ATTACKS[attack](flushed, 600 if attack == "convolutions" else 300)


@WHERE_THE_MODE_CAN_BE_SET
def test_another_rounding_mode_is_refused() -> None:
    x = ball_array.BallArray([1.0])
    for mode in (1 << 13, 2 << 13, 3 << 13):  # down, up, toward zero
        with pytest.raises(DisturbedError, match="nearest"), control(mode):
            x + x
    assert (x + x).is_finite().all()
