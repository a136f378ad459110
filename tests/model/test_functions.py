"""Powers, functions and roundings of numbers with half-widths hold what the true values give, and are no wider."""

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
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.model.exact import exact, fraction, quotient
from tippedisk_verify.model.measured import Measured

FUNCTIONS = ("sqrt", "log", "exp", "sin", "cos", "tan")
TWO = (operator.add, operator.sub, operator.mul, operator.truediv, operator.pow)
SHARP = mpmath.MPContext()
SHARP.dps = 400
_TRUTH = Fraction(1, 10**250)  # relative: the sine of an argument of 1e100 loses as many digits, cancellation some


def leaf(draw: Random) -> tuple[Measured, Any]:
    """A number of any size and half-width, at times exact or zero, and a truth: at an end of it or within."""
    size = draw.choice((1, 1, 1, 0, 10.0 ** draw.uniform(-30, 30)))
    value = decimal(draw.uniform(-3, 3) * size, draw.choice((1, 5, 17)))
    width = draw.choice((0, 1, 1, 1)) * decimal(10 ** draw.uniform(-40, 0)) * (abs(value) or 1)
    return Measured(value, width), quotient(SHARP, value + width * draw.choice((-1, 1, decimal(draw.uniform(-1, 1)))))


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
            *((abs, abs), (lambda x: round(x, place), lambda x: x), (lambda x: x**power, lambda x: x**power)),
        ]
    )
    if act in TWO:
        theirs, other = expression(draw, draw.randrange(depth))
        # What is exact may be a number of another kind.
        left, right = (number if number.uncertainty else number.value for number in (mine, theirs))
        return act(left if theirs.uncertainty else mine, right), act(truth, other)
    return act(mine), of_truth(truth)


def test_the_truth_lies_in_ten_thousand_expressions() -> None:
    refused = 0
    for index in range(10_000):
        draw = Random(f"expression/{index}")
        try:
            number, truth = expression(draw, draw.randint(1, 3))
        except (InputError, ZeroDivisionError):  # not defined for all that the numbers may be
            refused += 1
            continue
        true = fraction(truth)
        for value, width in ((number.value, number.uncertainty), map(Fraction, number.decimals())):
            assert abs(true - value) <= width + abs(true) * _TRUTH, index
    assert refused < 10_000 / 3


@pytest.mark.parametrize("name", [*FUNCTIONS, *range(-4, 5), Fraction(1, 3), Fraction(-7, 2)])
def test_no_half_width_is_wider_than_it_must_be(name: Any) -> None:
    """By less than a tenth, of numbers known to 3 to 30 digits: against the change from the middle to the ends."""
    draw = Random(f"width/{name}")
    for _ in range(200):
        value = decimal(draw.uniform(0.1, 20), 12)
        number = Measured(value, value * decimal(10 ** draw.uniform(-30, -3)))
        middle, *ends = (
            getattr(SHARP, name)(x) if isinstance(name, str) else x ** quotient(SHARP, Fraction(name))
            for x in (quotient(SHARP, value + sign * number.uncertainty) for sign in (0, -1, 1))
        )
        found = getattr(number, name)() if isinstance(name, str) else number**name
        needed = max(abs(fraction(end - middle)) for end in ends)
        assert all(abs(fraction(end) - found.value) <= found.uncertainty * (1 + _TRUTH) for end in (middle, *ends))
        assert found.uncertainty <= needed * Fraction(11, 10)


def test_what_is_not_defined_or_open_says_so() -> None:
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
        (TypeError, "arctan", lambda: numpy.arctan(number)),
    ):
        with pytest.raises(error, match=says):
            ask()


def test_it_goes_wherever_a_number_goes() -> None:
    number = Measured(Fraction(4, 3), Fraction(1, 100))
    assert exact(number).rational == Fraction(4, 3)
    assert exact("pi/2") + number == number + exact("pi/2")
    assert (round(number), int(-number), math.ceil(number), math.trunc(number)) == (1, -1, 2, 1)
    assert math.isclose(number, 4 / 3)
    assert len({number, Measured(Fraction(4, 3), Fraction(1, 100))}) == 1
    assert (numpy.sqrt(number), numpy.add(1, number)) == (number.sqrt(), number + 1)
    for objects in (numpy.array([1.0, 2.0]) * number, number * numpy.array([1.0, 2.0], numpy.longdouble)):
        assert objects.tolist() == [number, 2 * number]
    assert numpy.exp(numpy.array([number], object)).tolist() == [number.exp()]
    assert (numpy.array([1.0, 2.0]) < number).tolist() == [True, False]
    for doubles in (numpy.asarray(number), numpy.asarray([number, number]), numpy.array([number], float)):
        assert doubles.dtype == float
    for base in (Fraction(1, 3), 2, 0.5, Decimal("1.5")):  # Python 3.11 makes a float of a Fraction
        assert (base ** Measured(Fraction(2, 7), Fraction(0))).holds(
            quotient(SHARP, Fraction(base)) ** (SHARP.mpf(2) / 7)
        )


def test_what_numpy_and_python_ask_of_a_number() -> None:
    number, tiny = Measured.of("1.25", "1e-9"), Fraction(123456789, 10**330)
    assert not numpy.isnan(number)
    assert numpy.isfinite(number)
    assert sorted([number, number]) == [number, number]
    assert (f"{number:g}", f"{number:.3e}") == ("1.25", "1.250e+0")
    assert (tiny ** Measured.of(1, 0)).holds(tiny)  # which Python 3.11 rounds to a subnormal double first
