"""Numbers with half-widths: results hold every possible truth, and are no wider than necessary."""

from __future__ import annotations

import math
import operator
from decimal import Decimal
from fractions import Fraction
from random import Random
from typing import Any

import mpmath
import numpy
import pytest

from tests.honesty.harness import decimal
from tippedisk_verify import AccuracyError, InputError, Measured, exact
from tippedisk_verify.numbers.exact import fraction, rational_in_context

FUNCTIONS = ("sqrt", "log", "log10", "exp", "sin", "cos", "tan")
TWO = (operator.add, operator.sub, operator.mul, operator.truediv, operator.pow)
SHARP = mpmath.MPContext()
SHARP.dps = 400
# Relative: the sine of an argument of 1e100 loses as many digits, cancellation some
_TRUTH = Fraction(1, 10**250)


def leaf(draw: Random) -> tuple[Measured, Any]:
    """Draw a number with its half-width, and a truth at one of its ends or within.

    The number has any size and may be exact or zero.
    """
    size = draw.choice((1, 1, 1, 0, 10.0 ** draw.uniform(-30, 30)))
    value = decimal(draw.uniform(-3, 3) * size, draw.choice((1, 5, 17)))
    width = draw.choice((0, 1, 1, 1)) * decimal(10 ** draw.uniform(-40, 0)) * (abs(value) or 1)
    return Measured(value, width), rational_in_context(
        SHARP, value + width * draw.choice((-1, 1, decimal(draw.uniform(-1, 1))))
    )


def expression(draw: Random, depth: int) -> tuple[Measured, Any]:
    if not depth:
        return leaf(draw)
    mine, truth = expression(draw, depth - 1)
    if truth and not 1e-100 < abs(truth) < 1e100:
        raise InputError("too far from 1 for the truth's digits")
    place, power = draw.randint(-2, 20), draw.randint(-6, 6)
    act, of_truth = draw.choice(
        [
            *((operator.methodcaller(name), getattr(SHARP, name)) for name in FUNCTIONS),
            *((act, act) for act in TWO),
            *(
                (abs, abs),
                (lambda x: round(x, place), lambda x: x),
                (lambda x: x**power, lambda x: x**power),
            ),
        ]
    )
    if act in TWO:
        theirs, other = expression(draw, draw.randrange(depth))
        # What is exact may be a number of another kind.
        left, right = (number if number.uncertainty else number.value for number in (mine, theirs))
        return act(left if theirs.uncertainty else mine, right), act(truth, other)
    return act(mine), of_truth(truth)


def test_the_truth_lies_in_a_thousand_expressions() -> None:
    refused = 0
    for index in range(1000):
        draw = Random(f"expression/{index}")
        try:
            number, truth = expression(draw, draw.randint(1, 3))
        except (InputError, ZeroDivisionError):  # not defined for all that the numbers may be
            refused += 1
            continue
        true = fraction(truth)
        for value, width in ((number.value, number.uncertainty), map(Fraction, number.decimals())):
            assert abs(true - value) <= width + abs(true) * _TRUTH, index
    assert refused < 333


@pytest.mark.parametrize("name", [*FUNCTIONS, *range(-4, 5), Fraction(1, 3), Fraction(-7, 2)])
def test_no_half_width_is_wider_than_it_must_be(name: Any) -> None:
    """Compare with the change from the middle to the ends: less than a tenth wider.

    The numbers are known to 3 to 30 digits.
    """
    draw = Random(f"width/{name}")
    for _ in range(50):
        value = decimal(draw.uniform(0.1, 20), 12)
        number = Measured(value, value * decimal(10 ** draw.uniform(-30, -3)))
        middle, *ends = (
            getattr(SHARP, name)(x)
            if isinstance(name, str)
            else x ** rational_in_context(SHARP, Fraction(name))
            for x in (
                rational_in_context(SHARP, value + sign * number.uncertainty) for sign in (0, -1, 1)
            )
        )
        found = getattr(number, name)() if isinstance(name, str) else number**name
        needed = max(abs(fraction(end - middle)) for end in ends)
        assert all(
            abs(fraction(end) - found.value) <= found.uncertainty * (1 + _TRUTH)
            for end in (middle, *ends)
        )
        assert found.uncertainty <= needed * Fraction(11, 10)


def test_undefined_and_undecided_results_raise() -> None:
    number = Measured.of("2.6", "0.5")
    for error, says, ask in (
        (InputError, "is not defined", lambda: Measured.of(1, 2).sqrt()),
        (InputError, "is not defined", lambda: Measured.of(1, 1).log()),
        (InputError, "is not defined", lambda: Measured.of(-2, 0) ** Fraction(1, 2)),
        (InputError, "may lie beyond", lambda: Measured.of(2, 0) ** Measured.of(10**9, 0)),
        (ZeroDivisionError, "may be zero", lambda: Measured.of(0, 1) ** -1),
        (ZeroDivisionError, "may be zero", lambda: Measured.of("1.5", "0.1").tan()),
        *(
            (AccuracyError, r"to 2 or to 3.*float\(x\)", lambda act=act: act(number))
            for act in (round, int, math.floor)
        ),
        (TypeError, "sqrt.* and tan, not arctan", lambda: numpy.arctan(number)),
        (AccuracyError, "cannot be distinguished", lambda: number < Measured.of("2.7", "0.1")),
        (AccuracyError, "cannot be distinguished", lambda: number <= Decimal("2.6")),
        (AccuracyError, "cannot be distinguished", lambda: number < mpmath.mpf("2.7")),
        (TypeError, "not supported", lambda: number < "1"),
        (InputError, "finite", lambda: number < float("nan")),
    ):
        with pytest.raises(error, match=says):
            ask()


def test_a_measured_number_is_accepted_as_a_number() -> None:
    number = Measured(Fraction(4, 3), Fraction(1, 100))
    assert exact(number).rational == Fraction(4, 3)
    assert exact("pi/2") + number == number + exact("pi/2")
    assert (round(number), int(-number), math.ceil(number), math.trunc(number)) == (1, -1, 2, 1)
    assert math.isclose(number, 4 / 3)
    assert len({number, Measured(Fraction(4, 3), Fraction(1, 100))}) == 1
    assert len({Measured.of("30.5", 0), 30.5, Fraction(61, 2)}) == 1
    assert number not in (Fraction(4, 3), math.nan, Decimal("sNaN"), "4/3")
    assert (numpy.sqrt(number), numpy.add(1, number)) == (number.sqrt(), number + 1)
    assert (bool(numpy.isnan(number)), bool(numpy.isfinite(number))) == (False, True)
    for objects in (
        numpy.array([1.0, 2.0]) * number,
        number * numpy.array([1.0, 2.0], numpy.longdouble),
    ):
        assert objects.tolist() == [number, 2 * number]
    assert numpy.exp(numpy.array([number], object)).tolist() == [number.exp()]
    assert (numpy.array([1.0, 2.0]) < number).tolist() == [True, False]
    for doubles in (
        numpy.asarray(number),
        numpy.asarray([number, number]),
        numpy.array([number], float),
    ):
        assert doubles.dtype == float
    for base in (
        Fraction(1, 3),
        2,
        0.5,
        Decimal("1.5"),
        Fraction(123456789, 10**330),
    ):  # Python 3.11 makes floats of some
        for power in (Fraction(2, 7), Fraction(1)):
            truth = rational_in_context(SHARP, Fraction(base)) ** rational_in_context(SHARP, power)
            assert (base ** Measured(power, Fraction(0))).holds(truth)


def test_decided_comparisons_are_answered() -> None:
    period = Measured.of("1.0825", "0.0001")
    assert period < 1.1
    assert period > Fraction(1)
    assert Decimal("1.0824") <= period
    assert not period >= 2
    assert sorted([period, Measured.of(1, 0)])[0].value == 1


def test_numbers_of_other_packages_lose_no_half_width() -> None:
    """Check numbers of other packages on either side of an operation."""
    number = Measured.of("1.2345", "0.001")
    for two in (
        mpmath.mpf(2),
        numpy.float64(2),
        numpy.longdouble(2),
        numpy.int64(2),
        Decimal(2),
        2.0,
    ):
        for product in (number * two, two * number):
            assert product == Measured.of("2.469", "0.002"), type(two)
        for sum_ in (number + two, two + number):
            assert sum_ == Measured.of("3.2345", "0.001"), type(two)


def test_it_is_formatted_and_converted_like_a_number() -> None:
    number = Measured.of("30.88659268864356727833", "1e-20")
    for shown, text in (
        (f"{number:.10g}", "30.88659269"),
        (f"{number:12.4f}", "     30.8866"),
        (f"{number}", str(number)),
        (f"{Measured.of('1.25', '1e-9'):g} {Measured.of(0, 0):.3e}", "1.25 0.000e+00"),
        (str(Measured.of(0, "1e6")), "0 ± 1000000"),
        (str(Measured.of(1, "1e6"))[:4], "0 ± "),  # the half-width is beyond the value
    ):
        assert shown == text
    with mpmath.workdps(30):
        assert abs(number.mpf() - mpmath.mpf("30.88659268864356727833")) < mpmath.mpf(10) ** -28


def test_containment_covers_the_whole_other_interval() -> None:
    whole = Measured(Fraction(1), Fraction(1, 10))
    assert whole.contains(whole)
    assert whole.contains(Measured(Fraction("1.05"), Fraction("0.05")))
    assert not whole.contains(Measured(Fraction("1.05"), Fraction("0.06")))  # overlap is not enough
    assert not whole.contains(Measured(Fraction(1), Fraction("0.11")))
    sharper = Measured.compared(Fraction(3), Fraction(5, 2), Fraction(1, 8))
    assert sharper == Measured(Fraction(3), 1 + Fraction(3, 8))  # twice the distance, and an ulp
