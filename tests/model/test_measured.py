"""Numbers with half-widths behave as numbers, and their results hold what they may stand for."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction

import mpmath
import numpy
import pytest

from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.model.decimals import exact_text
from tippedisk_verify.model.measured import Measured


def test_a_product_is_no_wider_than_it_must_be() -> None:
    product = Measured.of(3, "0.1") * Measured.of(-2, "0.2")
    assert product.uncertainty == Fraction("3.1") * Fraction("2.2") - 6
    assert abs(-product) == Measured.of(6, product.uncertainty)


def test_comparisons_say_when_they_cannot_tell() -> None:
    period = Measured.of("1.0825", "0.0001")
    assert period < 1.1
    assert period > Fraction(1)
    assert Decimal("1.0824") <= period
    assert not period >= 2
    assert sorted([period, Measured.of(1, 0)])[0].value == 1
    for open_question in (lambda: period < Measured.of("1.0826", "0.0001"), lambda: period <= Decimal("1.0825")):
        with pytest.raises(AccuracyError, match="cannot be told apart"):
            open_question()
    with pytest.raises(TypeError):
        _ = period < "1"
    with pytest.raises(InputError, match="finite"):
        _ = period < float("nan")


def test_numbers_of_other_packages_lose_no_half_width() -> None:
    """Whichever side they stand on."""
    number = Measured.of("1.2345", "0.001")
    for two in (mpmath.mpf(2), numpy.float64(2), numpy.longdouble(2), numpy.int64(2), Decimal(2), 2.0):
        for product in (number * two, two * number):
            assert product == Measured.of("2.469", "0.002"), type(two)
        for sum_ in (number + two, two + number):
            assert sum_ == Measured.of("3.2345", "0.001"), type(two)
    with pytest.raises(AccuracyError):
        _ = number < mpmath.mpf("1.2346")


def test_zero_and_widths_beyond_the_value_are_printed() -> None:
    assert str(Measured.of(0, "1e6")) == "0 ± 1000000"
    assert f"{Measured.of(0, 0):.3e}" == "0.000e+00"
    assert str(Measured.of(1, "1e6")).startswith("0 ± ")


@pytest.mark.parametrize("text", ["1000000", "999999.5", "0.00001", "-1000000.0"])
def test_numbers_near_one_are_written_out(text) -> None:
    assert exact_text(Fraction(text)) == text.removesuffix(".0")


@pytest.mark.parametrize("text", ["1.000001e6", "-2e7", "1.23456789e6", "9.99e-6", "1.5e300"])
def test_numbers_far_from_one_have_an_exponent(text) -> None:
    assert exact_text(Fraction(text)) == text
    assert "e" in str(Measured.of(text, "1e-9")).split()[0]


def test_it_is_formatted_and_taken_as_a_number() -> None:
    number = Measured.of("30.88659268864356727833", "1e-20")
    assert f"{number:.10g}" == "30.88659269"
    assert f"{number:12.4f}" == "     30.8866"
    assert f"{number}" == str(number)
    assert repr(number) == f"Measured({number})"
    assert numpy.array([number, number], float).tolist() == [30.886592688643567] * 2
    with mpmath.workdps(30):
        assert abs(number.mpf() - mpmath.mpf("30.88659268864356727833")) < mpmath.mpf(10) ** -28
