"""The budget of limit cycles: its risk for normal errors, and its bounds where rounding leaves no
digit.
"""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import repeat
from types import SimpleNamespace
from typing import Any

import numpy
import pytest
from scipy import integrate, stats

from tippedisk_verify import DOUBLE, EXTENDED, QUADRUPLE, Disk, Measured, precision_of_bits
from tippedisk_verify.cycles.families import interpolant
from tippedisk_verify.cycles.shooting import error_budget
from tippedisk_verify.cycles.shooting.cycle_numbers import number_names
from tippedisk_verify.cycles.shooting.error_budget import bound_lost_logarithms
from tippedisk_verify.cycles.shooting.return_map import LinearizedReturn
from tippedisk_verify.cycles.shooting.section import LIBRATING, ROTATING
from tippedisk_verify.numbers.exact import fraction
from tippedisk_verify.numbers.precision import wider_precision


def beyond(twins: int, factor: float) -> float:
    """Return P(|x| > factor * range) for x and its twins, independent and normal."""
    density, below = stats.norm.pdf, stats.norm.cdf

    def all_within(x: float) -> float:
        width = x / factor
        lowest_is_a_twin = integrate.quad(
            lambda a: twins * density(a) * (below(a + width) - below(a)) ** (twins - 1),
            x - width,
            x,
        )[0]
        return 2 * density(x) * (lowest_is_a_twin + (below(x + width) - below(x)) ** twins)

    return integrate.quad(all_within, 0, 10, epsabs=1e-14)[0]  # far below the probability


def test_the_risk_is_the_budgets() -> None:
    """2e-6, and 14 in the median, as documented at `TWINS`."""
    assert 1.5e-6 < beyond(error_budget.TWINS, error_budget.TWIN_FACTOR) < 2e-6
    errors = numpy.random.default_rng(1).standard_normal((200_000, error_budget.TWINS + 1))
    ratio = error_budget.TWIN_FACTOR * numpy.ptp(errors, axis=1) / numpy.abs(errors[:, 0])
    assert 13 < numpy.median(ratio) < 15  # 200,000 draws: the median is within a few hundredths


def test_the_risk_in_the_next_wider_arithmetic_is_the_same() -> None:
    """The spread of normal values is the studentized range for a known variance."""
    values = error_budget.WIDER_TWINS + 1
    error = numpy.linspace(0, 10, 501)
    spread = error / error_budget.TWIN_FACTOR
    below = stats.studentized_range.cdf(spread, values, numpy.inf)
    # The trapezoidal rule has a step of a fiftieth of the error's deviation.
    assert 2e-6 < numpy.trapezoid(2 * stats.norm.pdf(error) * below, error) < 2.6e-6


def test_the_risk_on_the_branch_is_its_budgets() -> None:
    """2e-8 beyond a half-width, 2e-4 beyond half of one, and 13 in the median, as documented."""
    random = numpy.random.default_rng(2)
    spreads = (
        numpy.ptp(random.standard_normal((600_000, interpolant.NODE_TWINS + 1)), axis=1)
        .reshape(-1, 3)
        .max(axis=1)
    )
    widths = interpolant.NODE_TWIN_FACTOR * spreads
    assert 1e-8 < numpy.mean(2 * stats.norm.sf(widths)) < 3e-8
    assert numpy.mean(2 * stats.norm.sf(widths / 2)) < 3e-4
    assert 13 < numpy.median(widths / numpy.abs(random.standard_normal(len(widths)))) < 14


def test_a_lost_multiplier_is_bounded_by_its_rounding() -> None:
    """The multiplier is exp(-104), rounding is 1e-15. The logarithm lies between half of the sum
    and that of 1e-15.
    """
    measured = {
        "multiplier_slow": Measured.of(1e-15, 2e-15),
        "log_multiplier_slow": Measured.of(-34.5, 2),
        "log_multiplier_fast": Measured.of(-265.5, 2),
        "log_multipliers": Measured.of(-300, 1e-12),
    }
    bound_lost_logarithms(measured)
    assert "log_multipliers" not in measured
    for truth in (-149.9, -104.0, math.log(2.9e-15)):
        assert measured["log_multiplier_slow"].holds(Fraction(truth))
        assert measured["log_multiplier_fast"].holds(Fraction(-300 - truth))
    assert not measured["log_multiplier_slow"].holds(-33)


@pytest.mark.parametrize(
    ("share", "precision"), [("0.49", DOUBLE), ("0.51", wider_precision(DOUBLE))]
)
def test_an_arithmetic_answers_that_has_a_factor_of_two_to_spare(
    monkeypatch, share: str, precision
) -> None:
    """Half-widths differ from draw to draw. That must not decide which arithmetic answers."""

    def by_twins(_, arithmetic, doubles):
        number = Measured(
            Fraction(1), Fraction(share) / 10**12 * arithmetic.epsilon / DOUBLE.epsilon
        )
        return SimpleNamespace(coordinates=(), period=number, beta_max=number, precision=arithmetic)

    monkeypatch.setattr(error_budget, "_twins", lambda _: repeat({}))
    monkeypatch.setattr(error_budget, "_by_twins", by_twins)
    assert error_budget.cycle_to_digits(None, 12).precision == precision


class LinearMap:
    """A return map with the fixed point (1/3, 2/7), the residual of which is linear; it
    counts its derivatives.
    """

    truth = (Fraction(1, 3), Fraction(2, 7))

    def __init__(self, *slopes: str) -> None:
        self.precision, self.omega, self.images = precision_of_bits(200), 1, 0
        self._slopes = [self.precision.number(slope) for slope in slopes]

    def flight(self, point: Any, *, variations: bool) -> Any:
        self.images += variations
        return SimpleNamespace(state=point)

    def residual(self, state: Any, _: Any) -> Any:
        number = self.precision.number
        return [
            a * (x - number(t)) for a, x, t in zip(self._slopes, state, self.truth, strict=True)
        ]

    def image(self, point: Any, flight: Any) -> Any:
        zero, (a, b) = self.precision.number(0), self._slopes
        return derivatives(((1 + a, zero), (zero, 1 + b)), self.residual(flight.state, point))


def derivatives(matrix: Any, residual: Any = (0, 0)) -> LinearizedReturn:
    """Return an image that has only a residual and its derivatives by the state."""
    return LinearizedReturn(
        time=0,
        residual=residual,
        jacobian=matrix,
        by_omega=(0, 0),
        time_by_state=(0, 0),
        time_by_omega=0,
        flow_derivative=(),
    )


@pytest.mark.parametrize(
    ("second", "newton"),
    [
        ("-0.5005", False),  # a chord step leaves a thousandth of the second coordinate's error
        ("-0.3", True),  # two fifths: too many steps
        ("-0.05", True),  # nine tenths: a step says little of what is left
        ("-1e-6", True),  # nearly all, as next to a bifurcation
        ("-1.2", True),  # more than there was
        ("-5", True),
    ],
)
@pytest.mark.parametrize("off", [1e-16, 1e-3])
def test_steps_end_when_both_coordinates_rest(second: str, newton: bool, off: float) -> None:
    """The map is linear. Its chord is right in the first coordinate and wrong by any amount in the
    second.
    """
    return_map, truth = LinearMap("-0.5", second), LinearMap.truth
    rows = ((0.5, 0.0), (0.0, 0.5))
    start = SimpleNamespace(point=tuple(float(t) + off for t in truth), image=derivatives(rows))
    point, standing = error_budget.iterate_until_rounding(return_map, start)
    assert max(abs(fraction(x) - t) for x, t in zip(point, truth, strict=True)) < Fraction(
        1, 10**55
    )
    assert standing == (0, 0)
    assert bool(return_map.images) is newton


@pytest.mark.skipif(
    wider_precision(DOUBLE) != EXTENDED, reason="this machine has no extended doubles"
)
@pytest.mark.parametrize(
    ("kind", "omega", "few", "many", "arithmetic"),
    [
        ("librating", "30.4", 15, 20, EXTENDED),
        pytest.param("rotating", "30.02", 20, 40, QUADRUPLE, marks=pytest.mark.slow(minutes=0.2)),
    ],
)
def test_twins_in_double_measure_a_wider_arithmetic(kind, omega, few, many, arithmetic) -> None:
    """Every half-width holds the number with many more digits, and leaves most of the arithmetic's
    digits.
    """
    disk = Disk("table1")
    ask = disk.limit_cycle if kind == "librating" else disk.rotating_cycle
    cycle, sharp = (ask(omega, digits=digits) for digits in (few, many))
    assert cycle.precision == arithmetic.name
    for name in number_names(ROTATING) if kind == "rotating" else number_names(LIBRATING):
        number = getattr(cycle, name)
        assert number.holds(getattr(sharp, name).value), name
        assert number.uncertainty < abs(number.value) / 10 ** (few - 1), name
