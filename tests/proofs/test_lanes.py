"""Balls in doubles: no attack breaks them, and the recurrences on them hold Arb's coefficients."""

from __future__ import annotations

import math
import random
from fractions import Fraction

import numpy as np
import pytest

from tests.proofs.lane_attacks import ATTACKS
from tippedisk_verify.model.parameters import PRINTED, Constants
from tippedisk_verify.proofs.kernel import doubles, lanes
from tippedisk_verify.proofs.kernel.balls import DisturbedError, arb, ball, ball_constants, working_precision
from tippedisk_verify.proofs.kernel.flow import Model
from tippedisk_verify.proofs.kernel.lane_series import LaneSeries
from tippedisk_verify.proofs.kernel.lanes import Lanes

ORDER = 20


@pytest.mark.slow(minutes=0.4)
@pytest.mark.parametrize("attack", ATTACKS)
def test_ten_thousand_boxes(attack) -> None:
    ATTACKS[attack](lanes, 10_000)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 120))
@pytest.mark.parametrize("attack", ["binary", "unary", "convolutions", "sines", "compositions"])
def test_other_draws(attack, seed) -> None:
    ATTACKS[attack](lanes, 10_000, seed)


def test_the_reduction_of_angles_uses_these_constants() -> None:
    """What `sine_and_cosine` says of them, and of its coefficients, exactly."""
    a, b, c = (Fraction(x) for x in (doubles._HALF_PI_A, doubles._HALF_PI_B, doubles._HALF_PI_C))
    for part, unit in ((a, 32), (b, 65)):
        assert (part * 2**unit).denominator == 1
        assert part * 2**unit < 2**33
    assert b < Fraction(1, 2**33)
    assert c < Fraction(1, 2**67)
    with working_precision(300):
        assert abs(arb.pi() / 2 - ball(a + b + c)) < arb(2) ** -119
    for coefficients, first in ((doubles._SINE, 3), (doubles._COSINE, 2)):
        for i, coefficient in enumerate(reversed(coefficients)):
            exact = Fraction((-1) ** (i + 1), math.factorial(first + 2 * i))
            assert abs(Fraction(coefficient) - exact) <= abs(exact) / 2**53
    assert len(doubles._SINE) == 8
    assert len(doubles._COSINE) == 9


def test_the_bounds_of_the_sine_follow_from_its_docstring() -> None:
    """The sums of the docstring with all second-order terms, in exact rationals: gamma_m = m u / (1 - m u)."""
    u, z = Fraction(1, 2**53), Fraction(64, 100) * (1 + Fraction(1, 2**50))

    def gamma(m: int) -> Fraction:
        return m * u / (1 - m * u)

    def horner(first: int, count: int) -> tuple[Fraction, Fraction]:
        """Bounds of the rounding error of p and of |p|."""
        sizes = [z**i / math.factorial(first + 2 * i) for i in range(count)]
        counts = [3 * i + (2 if i or first == 3 else 1) for i in range(count)]  # -1/2 is no rounded number
        return sum(gamma(m) * size for m, size in zip(counts, sizes, strict=True)), sizes[0]

    error, size = horner(3, 8)
    w_error = z * (error * (1 + gamma(2)) + gamma(2) * size)
    product_error = w_error * (1 + u) + u * z * size
    y = Fraction(8, 10)
    remainder = y**18 / math.factorial(19)
    assert product_error + u * (1 + product_error) + remainder < 2 * u  # relative to |y|
    error, size = horner(2, 9)
    v_error = z * (error * (1 + gamma(2)) + gamma(2) * size)
    remainder = y**20 / math.factorial(20)
    assert v_error + u * (1 + v_error) + remainder < Fraction(5, 2) * u
    pieces = y + (y + Fraction(1, 2**47)) + (y + Fraction(1, 2**13))
    assert pieces * u + Fraction(1, 2**99) < Fraction(5, 2) * u


def test_another_rounding_mode_is_refused(monkeypatch) -> None:
    """As if a sum had been rounded up, or down."""
    for wrong in (np.nextafter(lanes._STEPPED, 2), np.nextafter(lanes._STEPPED, 0)):
        monkeypatch.setattr(lanes, "_STEPPED", wrong)
        with pytest.raises(DisturbedError, match="nearest"):
            Lanes([1.0])


def test_what_has_no_lanes_is_refused() -> None:
    with pytest.raises(ValueError, match="one-dimensional"):
        Lanes(np.zeros((2, 2)))
    for other in ([2**60 + 1], 3, [0.5, 2**60 + 1], np.array([1]), np.zeros(1, dtype=np.longdouble), ["1"]):
        with pytest.raises(TypeError, match="doubles"):
            Lanes(other)
        with pytest.raises(TypeError, match="doubles"):
            Lanes([1.0], other)
    short, long = LaneSeries(1), LaneSeries(1)
    long.append(Lanes([1.0]))
    assert short.convolution(short) == 0
    with pytest.raises(ValueError, match="one length"):
        short.convolution(long)


def test_a_series_is_a_sequence() -> None:
    series = Lanes(np.zeros(3)).series()
    for k in range(20):
        series.append(Lanes(np.full(3, float(k)), 0.5))
    assert [part.midpoints[0] for part in series] == list(range(20))
    assert [part.midpoints[2] for part in series[1::3]] == list(range(1, 20, 3))
    with pytest.raises(ValueError, match="order"):
        series[::-1]
    assert series[-1].radii[1] == 0.5
    with pytest.raises(IndexError):
        series[20]
    again = Lanes(np.zeros(3)).series(series)
    assert again is series
    assert len(again) == 0
    assert Lanes(np.zeros(2)).series(series) is not series


def random_states(rng: random.Random, count: int) -> list[list[tuple[float, float]]]:
    """Boxes of states and speeds, of widths from none to far more than proofs use."""
    columns = [
        [(rng.uniform(-size, size), rng.choice((0.0, 1e-12, 1e-8, 1e-6, 1e-3))) for _ in range(count)]
        for size in (1.2, 3.0, 6.0)
    ]
    columns.append([(rng.uniform(20, 40), rng.choice((0.0, 1e-9, 1e-4))) for _ in range(count)])
    return columns


def test_the_variational_coefficients_hold_those_of_arb() -> None:
    coefficients_hold_those_of_arb(11, 40, 3)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 110))
def test_other_variational_coefficients(seed) -> None:
    coefficients_hold_those_of_arb(seed, 200, 5)


def coefficients_hold_those_of_arb(seed: int, count: int, tries: int) -> None:
    """To order 20: those of random points of each lane's box, corners included, lie within the lane's balls."""
    rng = random.Random(seed)
    *state, speeds = random_states(rng, count)
    constants = Constants(*(Lanes.of([value]) for value in ball_constants(PRINTED)))
    model = Model(constants, Lanes(*np.array(speeds).T))
    start = [Lanes(*np.array(column).T) for column in state]
    start += [Lanes(np.full(count, float(row == column))) for column in range(4) for row in range(3)]
    found = model.variational.coefficients(start, ORDER)
    thin = model.orbit.coefficients([part.mid() for part in start[:3]], ORDER)
    finite = 0
    with working_precision(200):
        for lane in range(count):
            for turn in range(tries):
                shares = [rng.choice((-1.0, 1.0, rng.uniform(-1, 1))) if turn else 0.0 for _ in range(4)]
                point, omega = [], speeds[lane]
                for column, share in zip((*state, speeds), shares, strict=True):
                    point.append(arb(column[lane][0]) + arb(column[lane][1]) * arb(share))
                *point, omega = point
                exact = Model(ball_constants(PRINTED), omega)
                tangents = [ball(int(row == column)) for column in range(4) for row in range(3)]
                images = exact.variational.coefficients([*point, *tangents], ORDER)
                for series, image in zip(found, images, strict=True):
                    assert len(series) == ORDER + 1
                    for k in range(ORDER + 1):
                        _assert_within(series[k], lane, image[k])
                        finite += bool(series[k].is_finite()[lane])
                if turn == 0:
                    for series, image in zip(thin, images[:3], strict=False):
                        for k in range(ORDER + 1):
                            _assert_within(series[k], lane, image[k])
                            assert series[k].is_finite()[lane]
    assert finite > 0.9 * count * tries * len(found) * (ORDER + 1)


def _assert_within(found: Lanes, lane: int, image: object) -> None:
    radius = float(found.radii[lane])
    if radius < math.inf:
        assert image.rad() < 1e-30 * (1 + abs(image.mid()))
        assert not abs(image - arb(float(found.midpoints[lane]))) > arb(radius)


def test_an_earlier_result_is_not_overwritten() -> None:
    constants = Constants(*(Lanes.of([value]) for value in ball_constants(PRINTED)))
    model = Model(constants, Lanes(np.full(2, 30.4)))
    first = model.orbit.coefficients([Lanes([0.1, 0.2]), Lanes([0.3, 0.4]), Lanes([0.5, 0.6])], 5)
    kept = [part.midpoints.copy() for part in first[2]]
    model.orbit.coefficients([Lanes([1.1, 1.2]), Lanes([0.3, 0.4]), Lanes([0.5, 0.6])], 5)
    assert all((a == b.midpoints).all() for a, b in zip(kept, first[2], strict=True))


def test_lanes_are_no_wider_than_balls_of_as_many_bits() -> None:
    """A box as proofs use it: the radii are those of Arb at 53 bits, up to a tenth, and the order of operations."""
    box = [(-0.1, 1e-6), (1.2, 1e-6), (-1.5, 1e-6)]
    constants = Constants(*(Lanes.of([value]) for value in ball_constants(PRINTED)))
    tangents = [int(row == column) for column in range(4) for row in range(3)]
    found = Model(constants, Lanes([30.4])).variational.coefficients(
        [Lanes([m], [r]) for m, r in box] + [Lanes([float(x)]) for x in tangents], 16
    )
    with working_precision(53):
        wide = Model(ball_constants(PRINTED), ball(Fraction(30.4))).variational.coefficients(
            [arb(m, r) for m, r in box] + [ball(x) for x in tangents], 16
        )
    for mine, other in zip(found, wide, strict=True):
        for k in range(1, 17):
            assert mine[k].radii[0] <= 1.1 * float(other[k].rad()) + 1e-13 * float(abs(other[k].mid()) + 1)
