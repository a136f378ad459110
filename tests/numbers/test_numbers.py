"""The definition of a number: a table of objects, each with its number or the reason for refusal.

A new kind of object is a new row. Classes of packages that the tests do not need are emulated by
their attributes.
"""

from __future__ import annotations

import array
import math
from decimal import Decimal
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import flint
import gmpy2
import heyoka
import mpmath
import numpy as np
import pyarrow
import pytest
import sympy

import tippedisk_verify as tv

ID = "table1/linear/hopf/point/period"
DISK = tv.Disk("table1")
_BATCH = tv.BatchTaylor(1)
NEAR = 0.88671875  # a float of few bits, which narrower kinds of number hold as well
TENTH = Fraction(0.1)


class Scalar:
    """An array of no dimensions like JAX's or PyTorch's.

    It has no ``flat`` and is a number only by ``item``.
    """

    shape, ndim, dtype = (), 0, "float64"

    def __init__(self, held: Any) -> None:
        self.item = lambda: held


class WithUnit(float):
    """A quantity like those of pint, unyt or astropy: a number in all respects, with a unit."""

    units = "rpm"


class Dimensional:
    """A quantity that passes attributes on to its magnitude, and raises for missing ones."""

    dimensionality = "[length] ** 1.0"

    def __getattr__(self, name: str) -> Any:
        return getattr(NEAR, name)


class Masked:
    """A masked scalar of another package than NumPy."""

    mask, shape, ndim = True, (), 0

    def item(self) -> float:
        return NEAR


#: The object, and the number that it stands for.
NUMBERS: dict[str, tuple[Any, Fraction]] = {
    "int": (3, Fraction(3)),
    "float": (0.1, TENTH),
    "Fraction": (Fraction(1, 3), Fraction(1, 3)),
    "Decimal": (Decimal("0.1"), Fraction(1, 10)),
    "text": (" 1/3 ", Fraction(1, 3)),
    "NumPy's text": (np.str_("0.1"), Fraction(1, 10)),
    "float16": (np.float16(NEAR), Fraction(NEAR)),
    "float32": (np.float32(NEAR), Fraction(NEAR)),
    "float64": (np.float64(0.1), TENTH),
    "longdouble": (np.longdouble(1) + np.longdouble(2) ** -52, 1 + Fraction(1, 2**52)),
    "uint64": (np.uint64(2**64 - 1), Fraction(2**64 - 1)),
    "int8": (np.int8(-3), Fraction(-3)),
    "array without dimensions": (np.array(0.1), TENTH),
    "array of one": (np.array([[0.1]]), TENTH),
    "array of one object": (np.array([mpmath.mpf(0.1)], object), TENTH),
    "array of one text": (np.array(["0.1"]), Fraction(1, 10)),
    "masked array with nothing masked": (np.ma.masked_array([0.1], [False]), TENTH),
    "scalar of another package": (Scalar(0.1), TENTH),
    "scalar with a scalar inside": (Scalar(np.array([mpmath.mpf(0.1)], object)), TENTH),
    "mpf": (mpmath.mpf(0.1), TENTH),
    "mpz": (gmpy2.mpz(3), Fraction(3)),
    "mpq": (gmpy2.mpq(1, 3), Fraction(1, 3)),
    "mpfr": (gmpy2.mpfr(0.1), TENTH),
    "fmpz": (flint.fmpz(3), Fraction(3)),
    "fmpq": (flint.fmpq(1, 3), Fraction(1, 3)),
    "arf": (flint.arf(0.1), TENTH),
    "ball without a radius": (flint.arb(0.1), TENTH),
    "SymPy's Integer": (sympy.Integer(3), Fraction(3)),
    "SymPy's Rational": (sympy.Rational(1, 3), Fraction(1, 3)),
    "SymPy's Float": (sympy.Float(0.1), TENTH),
    "PyArrow's double": (pyarrow.scalar(0.1), TENTH),
    "PyArrow's integer": (pyarrow.scalar(3), Fraction(3)),
    "PyArrow's decimal": (pyarrow.scalar(Decimal("0.1")), Fraction(1, 10)),
    "real": (heyoka.real(0.1, 100), TENTH),
    "with a half-width": (tv.Measured.of("1/3", "0.1"), Fraction(1, 3)),
}

#: An object that is no number, and words of the line that says so.
NO_NUMBERS: dict[str, tuple[Any, str]] = {
    "None": (None, "not None"),
    "truth": (True, "not True"),
    "NumPy's truth": (np.True_, "not True"),
    "another package's truth": (Scalar(True), "not True"),
    "PyArrow's truth": (pyarrow.scalar(False), "not False"),
    "SymPy's truth": (sympy.true, "BooleanTrue"),
    "complex": (3 + 0j, "not (3+0j)"),
    "NumPy's complex": (np.complex64(3), "not (3+0j)"),
    "mpc": (mpmath.mpc(3), "type mpc"),
    "acb": (flint.acb(3), "type acb"),
    "bytes": (b"30.4", "type bytes"),
    "list": ([30.4], "type list"),
    "buffer": (array.array("d", [30.4]), "type array"),
    "array of two": (np.array([1.0, 2.0]), "not an array of 2"),
    "empty array": (np.array([]), "not an array of 0"),
    "masked": (np.ma.masked, "masked"),
    "masked array of one": (np.ma.masked_array([1.5], [True]), "masked"),
    "masked integer": (np.ma.masked_array(12, True), "masked"),
    "another package's masked scalar": (Masked(), "masked"),
    "float with a unit": (WithUnit(290.0), "without a unit"),
    "quantity": (Dimensional(), "without a unit"),
    "array with a unit": (SimpleNamespace(unit="s", shape=(), item=lambda: 1.5), "without a unit"),
    "time span": (np.timedelta64(5, "ns"), "without a unit"),
    "date": (np.datetime64("2020-01-01", "ns"), "without a unit"),
    "PyArrow's time span": (pyarrow.scalar(5, pyarrow.duration("us")), "type timedelta"),
    "PyArrow's null": (pyarrow.scalar(None), "not None"),
    "ball": (flint.arb("0.1"), "give its midpoint"),
    "ball about zero": (flint.arb(0, 5), "give its midpoint"),
    "interval": (mpmath.iv.mpf(["0.1", "0.2"]), "type ivmpf"),
    "constant": (mpmath.pi, "type constant"),
    "irrational": (sympy.sqrt(2), "type Pow"),
    "function": (math.sqrt, "type builtin_function_or_method"),
    "object": (object(), "type object"),
}

#: Infinite, or not a number: no input, and graded as an answer.
NOT_FINITE = {
    "nan": math.nan,
    "infinity": -math.inf,
    "longdouble": np.longdouble("inf"),
    "float16": np.float16("nan"),
    "mpf": mpmath.inf + 0,
    "mpfr": gmpy2.mpfr("nan"),
    "arf": flint.arf("inf"),
    "real": heyoka.real("nan", 60),
    "Decimal": Decimal("NaN"),
    "PyArrow's": pyarrow.scalar(math.nan),
    "another package's": Scalar(math.inf),
    "enormous": mpmath.ldexp(mpmath.mpf(1), 10**9),
}


@pytest.mark.parametrize("kind", NUMBERS)
def test_a_number_of_any_kind_is_taken_exactly(kind: str) -> None:
    value, number = NUMBERS[kind]
    assert tv.exact(value) == tv.Exact(number)
    assert tv.DOUBLE.number(value) == float(number)
    assert tv.exact(tv.precision_of_bits(100).number(value)) == tv.exact(
        tv.precision_of_bits(100).number(number)
    )
    # As an answer a text is a decimal
    if not isinstance(value, str) and kind != "array of one text":
        assert tv.compare(ID, value).digits == tv.compare(ID, number).digits


@pytest.mark.parametrize("kind", NO_NUMBERS)
def test_other_objects_are_refused_in_one_line(kind: str) -> None:
    value, words = NO_NUMBERS[kind]
    for enter in (tv.exact, lambda answer: tv.compare(ID, answer)):
        with pytest.raises(tv.InputError) as refused:
            enter(value)
        assert words in str(refused.value)
        assert str(refused.value).isprintable()
    failed = tv.grade({ID: value}, progress=False).grades[0]
    assert (failed.verdict, words in failed.note) == ("unreadable", True)


@pytest.mark.parametrize("kind", NOT_FINITE)
def test_infinities_and_nan_are_refused_as_inputs_and_graded_as_answers(kind: str) -> None:
    with pytest.raises(tv.InputError, match="finite"):
        tv.exact(NOT_FINITE[kind])
    if kind != "enormous":
        assert tv.compare(ID, NOT_FINITE[kind]).verdict == "not-a-number"


class ArrayWithUnit(np.ndarray):
    """An array of a package for units: its elements are plain doubles, and it has a unit."""

    units = "rpm"


LISTS = {
    "masked array": np.ma.masked_array([1.5, 1.6, 3.0], [False, False, True]),
    "a masked one": [1.5, 1.6, np.ma.masked],
    "complex": np.array([1.5, 1.6, 3.0], complex),
    "truths": np.array([1, 1, 1], bool),
    "objects with units": np.array([1.5, 1.6, WithUnit(1.7)], object),
    "floats with units": [WithUnit(1.5), WithUnit(1.6), WithUnit(1.7)],
    "array with a unit": np.ones(3).view(ArrayWithUnit),
    "time spans": np.array([1, 2, 3], "m8[s]"),
    "a null": pyarrow.array([1.5, 1.6, None]),
}


@pytest.mark.parametrize("kind", LISTS)
def test_a_list_with_entries_other_than_numbers_is_refused(kind: str) -> None:
    values: Any = LISTS[kind]
    motion = DISK.integrate("30.4", (1.5, 1.6, 0), 4)
    for enter in (
        lambda: DISK.integrate("30.4", values, "0.01"),
        lambda: DISK.integrate("30.4", (1.5, 1.6, 0), 4, t_eval=values),
        lambda: tv.Request(DISK, "30.4", (1.5, 1.6, 0), 4, times=values),
        lambda: DISK.branch(values),
        lambda: motion(values),
        lambda: _BATCH([0.045, 0.0025, 5e-4, 5e-4, 9.81, 29.0], [30.4], [values], [0.01]),
        lambda: _BATCH(
            [0.045, 0.0025, 5e-4, 5e-4, 9.81, 29.0], values, [[1.5, 1.6, 0.0]] * 3, [0.01] * 3
        ),
    ):
        with pytest.raises(tv.InputError) as refused:
            enter()
        assert str(refused.value).isprintable()


def test_the_equations_in_doubles_take_no_masked_states_and_no_units() -> None:
    for values in (LISTS["masked array"], LISTS["array with a unit"]):
        with pytest.raises(tv.InputError):
            DISK.rhs("30.4")(0, values)


def test_arithmetic_with_an_array_goes_by_its_elements() -> None:
    product = DISK.omega_crit * np.array([2.0])
    assert isinstance(product, np.ndarray)
    assert product.shape == (1,)
