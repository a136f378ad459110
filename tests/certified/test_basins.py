"""Basins proved: cells, regions that attract, and boxes of states that reach them."""

import math
import random
from fractions import Fraction

import numpy as np
import pytest

from tippedisk_verify.certified import attraction
from tippedisk_verify.certified.attraction import Strip, strip
from tippedisk_verify.certified.balls import arb, ball, ball_constants, hull, measured, within
from tippedisk_verify.certified.basins import proved_outcomes
from tippedisk_verify.certified.flow import Model
from tippedisk_verify.certified.lanes import Lanes
from tippedisk_verify.cli import main
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.orbits.basins import OUTCOMES, Attractors, classified_lanes

CELLS = Strip(
    np.array([0.0, 1.0, 2.0, 3.0]),
    np.array([-1.0, -1.5, -1.0]),
    np.array([1.0, 1.5, 1.0]),
    np.array([0, 0, -1]),
    ("limit cycle",),
)


@pytest.mark.parametrize(
    ("gamma_bar", "v", "end"),
    [
        ((0.5, 0.25), (0.0, 0.9), 0),
        ((1.0, 0.5), (0.0, 0.9), 0),
        ((1.0, 0.5), (0.0, 1.1), -1),  # above the first cell
        ((1.5, 0.4), (0.0, 1.4), 0),
        ((1.5, 0.6), (0.0, 0.9), -1),  # reaches into the third cell
        ((2.5, 0.1), (0.0, 0.1), -1),  # which is not decided
        ((0.1, 0.2), (0.0, 0.1), -1),  # beyond the strip
        ((2.9, 0.2), (0.0, 0.1), -1),
        ((math.nan, 0.0), (0.0, 0.1), -1),
        ((0.5, 0.1), (0.0, math.inf), -1),
    ],
)
def test_boxes_are_decided_by_all_the_cells_they_meet(gamma_bar, v, end) -> None:
    lanes = [Lanes([mid], [rad]) for mid, rad in (gamma_bar, v)]
    assert CELLS.end(*lanes).tolist() == [end]


def test_what_a_ball_shares_with_an_interval_is_held() -> None:
    draw = random.Random(5)
    for _ in range(300):
        mid, rad, length = draw.uniform(-2, 3), draw.choice([0.0, 1e-17, 0.3, 2.0]), draw.uniform(0.1, 2)
        low, high = (Fraction(mid) + sign * Fraction(rad) for sign in (-1, 1))
        low, high = max(low, Fraction(0)), min(high, Fraction(length))
        found = [within(arb(mid, rad), length), within(Lanes([mid], [rad]), Lanes([length])).arb(0)]
        for shared in found:
            if low > high:
                assert not shared.is_finite() or shared.contains(arb(0)) or shared.contains(arb(length))
            else:
                assert all(shared.contains(arb(float(end))) for end in (low, high) if Fraction(float(end)) == end)
                number = measured(shared)
                # An intersection's radius has 16 bits or more in python-flint; and the rounding of sums of doubles.
                assert number.uncertainty <= (high - low) / 2 * (1 + Fraction(1, 2**15)) + Fraction(1, 2**50)
    assert within(arb.nan(), 1.0).contains(hull(0, 1))
    assert within(Lanes([math.nan]), Lanes([1.0])).arb(0).contains(hull(0, 1))
    assert not within(Lanes([5.0]), Lanes([1.0])).is_finite().any()


@pytest.mark.parametrize("omega", ["31", "34", "60"])
def test_the_distance_from_inverted_spinning_falls_in_its_region(omega) -> None:
    region = attraction._Spinning.found(PRINTED, Fraction(omega))
    assert region is not None
    model = Model(ball_constants(PRINTED), ball(omega))
    draw, radius = np.random.default_rng(2), math.sqrt(float(region.square))
    for direction in draw.normal(size=(40, 3)):
        z = direction / np.linalg.norm(direction) * radius * draw.uniform(0.01, 1)
        state = [sum(region.inverse.inv()[row, k] * float(z[k]) for k in range(3)) for row in range(3)]
        rates = model.rates(state)
        towards = sum(float(z[row]) * sum(region.inverse[row, k] * rates[k] for k in range(3)) for row in range(3))
        assert towards < 0


def test_an_unstable_equilibrium_has_no_such_region() -> None:
    assert attraction._Spinning.found(PRINTED, Fraction("30.8")) is None


@pytest.fixture(scope="module")
def cells() -> Strip:
    with pytest.MonkeyPatch.context() as patch:
        for name, value in {"_WIDEST": 4e-3, "_FINEST": 0.02, "_PROBES": 80, "_SHARE": 0.3}.items():
            patch.setattr(attraction, name, value)
        return strip(PRINTED, Fraction(34))


def states(count: int) -> np.ndarray:
    draw = np.random.default_rng(7).random((count, 2)) * [math.pi, 2 * math.pi] - [0, math.pi / 2]
    return np.column_stack([draw, np.zeros(count)])


@pytest.mark.slow(minutes=2)
def test_proved_ends_are_the_true_ones(cells) -> None:
    assert cells.attractors == ("inverted spinning",)
    assert (cells.ends == 0).all()
    starts = np.concatenate([states(10), [[1e-3, 1.0, 0.0], [1.6, 1.7, 0.0]]])
    proved = proved_outcomes(starts, OUTCOMES, cells, PRINTED, Fraction(34), 4.0)
    ordinary = classified_lanes(starts, PRINTED, Fraction(34), 20.0, Attractors.at(PRINTED, Fraction(34)))
    decided = proved != OUTCOMES.index("undecided")
    assert (proved[decided] == ordinary[decided]).all()
    assert [OUTCOMES[k] for k in proved[-2:]] == ["lies flat", "inverted spinning"]


@pytest.mark.slow
@pytest.mark.parametrize(("index", "end"), [(0, "limit cycle"), (-1, "undecided")])
def test_boxes_are_followed_to_the_cells_and_no_further(index, end) -> None:
    one = Strip(np.array([0.0, 3.1]), np.array([-9.0]), np.array([0.0]), np.array([index]), ("limit cycle",))
    starts = np.array([[0.2, 1.0, 0.0], [1.6, 1.9, 0.0], [1.6, 1.9 + 8 * math.pi, 0.0]])
    found = proved_outcomes(starts, OUTCOMES, one, PRINTED, Fraction("30.4"), 0.9)
    assert [OUTCOMES[k] for k in found] == ["lies flat", end, end]


def test_the_smooth_law_is_refused(capsys) -> None:
    assert main(["basin", "--omega", "30.4", "--proved", "--friction", "smooth", "--count", "10"]) == 2
    assert "basins are proved for the linear friction law only" in capsys.readouterr().err


@pytest.mark.slow(minutes=6)
@pytest.mark.parametrize("omega", ["30.386592688643567", "31.386592688643567"])
def test_the_papers_scenes(omega) -> None:
    cells = strip(PRINTED, Fraction(omega))
    starts = states(400)
    proved = proved_outcomes(starts, OUTCOMES, cells, PRINTED, Fraction(omega), 20.0)
    ordinary = classified_lanes(starts, PRINTED, Fraction(omega), 20.0, Attractors.at(PRINTED, Fraction(omega)))
    decided = proved != OUTCOMES.index("undecided")
    assert (proved[decided] == ordinary[decided]).all()
    assert decided.mean() > 0.9
