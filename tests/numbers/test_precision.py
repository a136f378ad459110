"""Numbers are converted exactly in both directions, and printed digits are justified."""

from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction

import heyoka
import mpmath
import numpy
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tippedisk_verify import (
    DOUBLE,
    EXTENDED,
    QUADRUPLE,
    Exact,
    InputError,
    Measured,
    exact,
    precision_of_bits,
)
from tippedisk_verify.numbers.decimals import decimal_magnitude, exact_text, round_down, round_up
from tippedisk_verify.numbers.exact import PI, fraction
from tippedisk_verify.numbers.precision import bits_for_digits, wider_precision

ALL = (
    DOUBLE,
    EXTENDED,
    QUADRUPLE,
    precision_of_bits(24),
    precision_of_bits(200),
    precision_of_bits(1000),
)
decimal_texts = st.builds(
    lambda sign, digits, exponent: f"{sign}{digits}e{exponent}",
    st.sampled_from(["", "-"]),
    st.integers(0, 10**60),
    st.integers(-400, 300),
)


@pytest.mark.parametrize("precision", ALL, ids=lambda p: p.name)
@given(text=decimal_texts)
def test_every_precision_converts_to_mpmath_and_back(precision, text: str) -> None:
    try:
        value = precision.number(text)
    except InputError:
        assert precision.kind == "double"
        assert abs(Fraction(text)) >= 2**1023
        return
    assert precision.number(precision.mpf(value)) == value
    if precision.kind == "double":
        assert value == float(Fraction(text))
    # Correct rounding: no nearer number of that precision exists
    elif abs(Fraction(text)) > 2**-16382:
        assert abs(fraction(value) - Fraction(text)) <= abs(Fraction(text)) / 2**precision.bits
    if precision.kind == "real":  # MPFR's own decimal input is a second, independent rounding
        assert heyoka.real(text, precision.bits) == value


@pytest.mark.parametrize("precision", ALL, ids=lambda p: p.name)
def test_pi_is_rounded_once(precision) -> None:
    # 1100 bits of mpmath's pi are the reference: more than any precision here, so one rounding is
    # visible.
    with mpmath.workprec(1100):
        reference = fraction(+mpmath.pi)
    assert abs(fraction(precision.pi) - reference) <= Fraction(2) ** (1 - precision.bits)
    assert fraction(precision.number(PI * 3)) == fraction(precision.number(exact("3*pi")))


def test_sums_with_pi_round_correctly_even_under_cancellation() -> None:
    near = Fraction(precision_of_bits(300).mpf(precision_of_bits(300).pi).man) / 2 ** (
        -precision_of_bits(300).mpf(precision_of_bits(300).pi).exp
    )
    left_over = DOUBLE.number(Exact(-near, Fraction(1)))
    with mpmath.workprec(800):
        expected = float(+mpmath.pi - mpmath.mpf(near.numerator) / near.denominator)
    assert left_over == expected


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("pi/2 + 0.4", Exact(Fraction(2, 5), Fraction(1, 2))),
        ("-3*pi/2", Exact(Fraction(0), Fraction(-3, 2))),
        ("3 pi/2", Exact(Fraction(0), Fraction(3, 2))),
        ("1/3", Exact(Fraction(1, 3))),
        ("-1e-30", Exact(Fraction(-1, 10**30))),
        (".5", Exact(Fraction(1, 2))),
        (0.1, Exact(Fraction(0.1))),  # a float means its binary value
        (Decimal("0.1"), Exact(Fraction(1, 10))),
        (numpy.longdouble(2) ** -16445, Exact(Fraction(1, 2**16445))),  # a subnormal one
    ],
)
def test_numbers_are_read_exactly(text: object, value: Exact) -> None:
    assert exact(text) == value


@pytest.mark.parametrize(
    "value",
    [
        "",
        " ",
        "nan",
        "inf",
        "abc",
        "1..2",
        "1/0",
        "pi pi",
        "--1",
        "1e-3-",
        "1e400000",
        "1 2",
        "0x10",
        "3 0.0 7",
        *(
            "1" * 5000,
            math.nan,
            -math.inf,
            None,
            [1],
            True,
            heyoka.real("inf", 50),
            numpy.longdouble("inf"),
        ),
    ],
    ids=lambda value: f"{value!s:.10}",
)
def test_texts_that_are_not_numbers_are_refused(value: object) -> None:
    with pytest.raises(InputError):
        exact(value)


@given(
    value=st.fractions(),
    width=st.fractions(min_value=Fraction(1, 10**60), max_value=10**6),
    offset=st.fractions(-1, 1),
)
def test_printed_intervals_hold_what_the_numbers_hold(
    value: Fraction, width: Fraction, offset: Fraction
) -> None:
    measured = Measured(value, width)
    text, printed_width = measured.decimals()
    truth = value + offset * width
    assert abs(Fraction(text) - truth) <= Fraction(printed_width)
    # Two digits of the half-width (10 % at worst) and the rounding of the value (5 %).
    assert Fraction(printed_width) <= width * Fraction(116, 100)


def test_names_and_bounds() -> None:
    assert [precision.name for precision in ALL[2:4]] == ["quadruple", "real24"]
    assert [precision.digits for precision in ALL[:3]] == [15, 18, 33]
    assert all(wider_precision(precision).bits >= precision.bits + 11 for precision in ALL)
    assert [bits_for_digits(digits) for digits in (1, 15, 34)] == [24, 51, 114]
    for digits in (0, -1, 10**9):
        with pytest.raises(InputError):
            bits_for_digits(digits)
    with pytest.raises(InputError):
        precision_of_bits(1)


@pytest.mark.parametrize("count", [24, 53, 200])
def test_functions_agree_with_heyokas_and_undefined_values_are_nan(count: int) -> None:
    precision = precision_of_bits(count)
    ops = precision.ops
    for name in ("sin", "cos", "exp", "log", "sqrt"):
        for text in ("0.3", "7", "1e-20", "12345.678"):
            value = precision.number(text)
            theirs = getattr(numpy, name)(value)
            assert abs(fraction(getattr(ops, name)(value)) - fraction(theirs)) <= abs(
                fraction(theirs)
            ) * 2 * Fraction(precision.epsilon)
    minus, zero = precision.number(-1), precision.number(0)
    for found in (
        ops.sqrt(minus),
        ops.log(minus),
        ops.log(zero),
        ops.sin(minus / 0),
        ops.exp(zero / 0),
    ):
        assert found != found


def test_large_exponents_are_exact_in_few_bits() -> None:
    few, many = precision_of_bits(24), precision_of_bits(200)
    for value in (Fraction(2) ** 20_000_001, Fraction(3, 2**20_000_001)):  # more than 24 bits hold
        assert fraction(few.number(value)) == fraction(many.number(value)) == value


positive_rationals = st.one_of(
    st.fractions(min_value=Fraction(1, 10**40), max_value=10**40),
    # Next to the powers of ten, where a logarithm in double goes wrong.
    st.builds(
        lambda power, off, sign: Fraction(10) ** power * (1 + sign * Fraction(1, 10**off)),
        st.integers(-40, 40),
        st.integers(1, 40),
        st.sampled_from([-1, 0, 1]),
    ),
).filter(lambda value: value > 0)


@given(value=positive_rationals)
def test_roundings_to_two_digits_are_to_their_side_and_no_further_than_the_second_digit(
    value: Fraction,
) -> None:
    magnitude = decimal_magnitude(value)
    assert Fraction(10) ** magnitude <= value < Fraction(10) ** (magnitude + 1)
    low, high = Fraction(round_down(value)), Fraction(round_up(value))
    assert low <= value <= high
    unit = Fraction(10) ** (magnitude - 1)
    assert value - low < unit
    assert high - value < unit


@given(value=st.fractions())
def test_an_exact_text_is_the_number_itself(value: Fraction) -> None:
    """Check that a result is cut after fifty digits if its decimals never end, with the error."""
    assert exact(exact_text(value)).rational == value
    text, width = Measured(value, Fraction(0)).decimals()
    assert abs(Fraction(text) - value) <= Fraction(width)


@pytest.mark.parametrize(
    "text",
    [
        "0.3",
        "1/3",
        "30",
        "1000000",
        "999999.5",
        "0.00001",
        "1.000001e6",
        "-2e7",
        "9.99e-6",
        "1.5e300",
        "1e-30",
    ],
)
def test_numbers_near_one_are_written_out_and_others_have_an_exponent(text: str) -> None:
    assert exact_text(Fraction(text)) == text
