"""Powers, functions and roundings of numbers with half-widths hold what the true values give, and are no wider."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from random import Random
from typing import Any

import mpmath
import numpy
import pytest

from tests.honesty.harness import decimal
from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.model.exact import exact, fraction, quotient
from tippedisk_verify.model.measured import Measured

EXPRESSIONS = 10_000
ONE = ("sqrt", "log", "exp", "sin", "cos", "tan", "abs", "round", "power")
TWO = (operator.add, operator.sub, operator.mul, operator.truediv, operator.pow)
SHARP = mpmath.MPContext()
SHARP.dps = 400
_TRUTH = Fraction(
    1, 10**250
)  # relative: the sine of an argument of 1e100 loses as many of the digits, cancellation some


def leaf(draw: Random) -> tuple[Measured, Any]:
    """A number of any size and half-width, at times exact or zero, and a truth: at an end of it or within."""
    size = draw.choice((1, 1, 1, 0, 10.0 ** draw.uniform(-30, 30)))
    value = decimal(draw.uniform(-3, 3) * size, draw.choice((1, 5, 17)))
    width = draw.choice((0, 1, 1, 1)) * decimal(10 ** draw.uniform(-40, 0)) * (abs(value) or 1)
    return Measured(value, width), quotient(SHARP, value + width * draw.choice((-1, 1, decimal(draw.uniform(-1, 1)))))


def applied(name: str, number: Any, place: int, power: int) -> Any:
    """One of `ONE`, of a number with a half-width or of a truth."""
    if name == "abs":
        return abs(number)
    if name == "power":
        return number**power
    if name == "round":  # to a multiple of a power of ten it is a number again: the truth stays what it was
        return round(number, place) if isinstance(number, Measured) else number
    return getattr(number if isinstance(number, Measured) else SHARP, name)(
        *(() if isinstance(number, Measured) else (number,))
    )


def expression(draw: Random, depth: int) -> tuple[Measured, Any]:
    if not depth:
        return leaf(draw)
    mine, truth = expression(draw, depth - 1)
    if truth and not 1e-100 < abs(truth) < 1e100:
        raise InputError("too far from 1 for the truth's digits")
    if draw.random() < 0.5:
        name, place, power = draw.choice(ONE), draw.randint(-2, 20), draw.randint(-6, 6)
        return applied(name, mine, place, power), applied(name, truth, place, power)
    theirs, other = expression(draw, draw.randrange(depth))
    act: Callable[[Any, Any], Any] = draw.choice(TWO)
    return act(mine, theirs), act(truth, other)


def test_the_truth_lies_in_every_expression() -> None:
    refused = 0
    for index in range(EXPRESSIONS):
        draw = Random(f"expression/{index}")
        try:
            number, truth = expression(draw, draw.randint(1, 3))
        except (InputError, ZeroDivisionError):  # not defined for all that the numbers may be
            refused += 1
            continue
        true = fraction(truth)
        assert abs(true - number.value) <= number.uncertainty + abs(true) * _TRUTH, index
        for text, width in [number.decimals()]:
            assert abs(true - Fraction(text)) <= Fraction(width) + abs(true) * _TRUTH, index
    assert refused < EXPRESSIONS / 3


@pytest.mark.parametrize("name", [*ONE[:6], *range(-4, 5), Fraction(1, 3), Fraction(-7, 2)])
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
        if name in ("sin", "cos") and needed < number.uncertainty / 50:
            continue  # next to a turning point, where the bound is by the second derivative
        assert needed * (1 - Fraction(1, 10**6)) <= found.uncertainty <= needed * Fraction(11, 10)


def test_what_is_not_defined_says_so() -> None:
    for open_question in (
        lambda: Measured.of(1, 2).sqrt(), lambda: Measured.of(1, 1).log(), lambda: Measured.of(-2, 0) ** Fraction(1, 2),
        lambda: Measured.of(10**6, 1).exp(), lambda: Measured.of(2, 0) ** Measured.of(10**9, 0),
    ):  # fmt: skip
        with pytest.raises(InputError, match=r"is not defined|may lie beyond"):
            open_question()
    for quotient_by_zero in (lambda: Measured.of(0, 1) ** -1, lambda: Measured.of("1.5", "0.1").tan()):
        with pytest.raises(ZeroDivisionError, match="may be zero"):
            quotient_by_zero()
    assert Measured.of(0, 0) ** 0 == Measured.of(1, 0)
    assert Measured.of(0, 0).sqrt() == Measured.of(0, 0)
    assert (Measured.of(4, 0) ** 0.5).uncertainty < Fraction(1, 10**48)


def test_integers_say_when_they_are_open() -> None:
    number = Measured.of("2.4", "0.05")
    assert (round(number), int(number), math.floor(number), math.ceil(number), math.trunc(-number)) == (2, 2, 2, 3, -2)
    for ask in (round, int, math.floor):
        with pytest.raises(Shortfall, match=r"may be rounded to 2 or to 3.*float\(x\)"):
            ask(Measured.of("2.6", "0.5"))
    assert round(number, 0) == Measured.of(2, "0.45")


def test_numpy_keeps_half_widths_but_for_arrays_of_doubles() -> None:
    number = Measured.of("1.25", "1e-9")
    assert numpy.sqrt(number) == number.sqrt()
    assert numpy.add(number, 1) == number + 1
    for objects in (numpy.array([1.0, 2.0]) * number, number * numpy.array([1.0, 2.0], numpy.longdouble)):
        assert objects.tolist() == [number, 2 * number]
    assert numpy.exp(numpy.array([number], object)).tolist() == [number.exp()]
    assert (numpy.array([1.0, 2.0]) < number).tolist() == [True, False]
    for doubles in (numpy.asarray(number), numpy.asarray([number, number]), numpy.array([number], float)):
        assert doubles.dtype == float
        assert (doubles == 1.25).all()
    with pytest.raises(TypeError):
        numpy.arctan(number)


def test_it_is_an_input_by_its_middle() -> None:
    """At every precision the same rational, which no decimal of a few digits is."""
    third = Measured(Fraction(1, 3), Fraction(1, 100))
    assert exact(third).rational == Fraction(1, 3)
    assert exact("pi/2") + third == third + exact("pi/2")
    assert math.isclose(third, 1 / 3)
    assert {third: 1}[Measured(Fraction(1, 3), Fraction(1, 100))] == 1
    for base in (Fraction(1, 3), 2, 0.5, Decimal("1.5")):  # Python 3.11 makes a float of a Fraction
        power = base ** Measured(Fraction(2, 7), Fraction(0))
        assert power.holds(quotient(SHARP, Fraction(base)) ** (SHARP.mpf(2) / 7))
