"""Eigenvalues against the characteristic polynomial and the flow's own Jacobian; real roots against their products."""

from __future__ import annotations

import json
from fractions import Fraction
from itertools import combinations

import numpy
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.problems import decimals, physical_parameters
from tippedisk_verify.cli import main
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.model import equations
from tippedisk_verify.model.exact import fraction
from tippedisk_verify.model.parameters import PRINTED, Parameters
from tippedisk_verify.model.precision import bits
from tippedisk_verify.theory.equilibria import (
    EquilibriumName,
    Linearization,
    characteristic_polynomial,
    eigenvalues,
    equilibrium,
    kind_changes,
    linearization,
    location,
    right_eigenvector,
    saddle_value_sign,
)
from tippedisk_verify.theory.hopf import omega_crit
from tippedisk_verify.theory.real_roots import real_roots, square_root


@pytest.mark.parametrize("name", ["inverted", "noninverted"])
@settings(max_examples=30)
@given(parameters=physical_parameters(), omega=decimals("1", "60"))
def test_linearization_is_the_jacobian_there(name, parameters, omega) -> None:
    """Second derivation: the general Jacobian at the equilibrium, in 200 bits."""
    precision = bits(200)
    ctx = precision.context
    constants = type(parameters.at(precision))(*(precision.mpf(value) for value in parameters.at(precision)))
    state = [precision.mpf(precision.number(part)) for part in location(name)]
    rows = equations.jacobian(ctx, constants, precision.mpf(precision.number(omega)), "linear")(*state)
    matrix = linearization(parameters, omega, name)
    expected = [[0, 0, 1], [matrix.omega, 0, 0], [matrix.A31, matrix.A32, matrix.A33]]
    for row, expected_row in zip(rows, expected, strict=True):
        for entry, value in zip(row, expected_row, strict=True):
            # pi/2 is rounded to 200 bits, and second derivatives reach some 1e6 times the entries.
            size = 1 + abs(matrix.A31) + abs(matrix.A32) + abs(matrix.A33)
            assert abs(fraction(entry) - Fraction(value)) < size * Fraction(1, 2**170)


_POWERS = st.integers(-15, 15)
_ENTRIES = st.builds(lambda digits, power: digits * Fraction(10) ** power, st.integers(-99, 99).filter(bool), _POWERS)


@given(matrix=st.builds(Linearization, st.builds(abs, _ENTRIES), _ENTRIES, _ENTRIES, _ENTRIES))
def test_eigenvalues_of_any_size_are_found(matrix) -> None:
    """Entries thirty orders of magnitude apart: what the half-widths hold has the matrix's trace and determinant."""
    _, a2, a1, a0 = characteristic_polynomial(matrix)
    try:
        values = eigenvalues(matrix, 40)
        discs = [(one.re.value, one.im.value, max(one.re.uncertainty, one.im.uncertainty)) for one in values]
    except AccuracyError:
        assert a2**2 * a1**2 - 4 * a1**3 - 4 * a2**3 * a0 + 18 * a2 * a1 * a0 - 27 * a0**2 == 0  # a double one
        return
    assert discs == sorted(discs, key=lambda disc: (-disc[0], -disc[1]))
    assert sum(im for _, im, radius in discs if abs(im) > radius) == 0
    assert numpy.array(values, complex).tolist() == [complex(re, im) for re, im, _ in discs]
    assert abs(sum(re for re, *_ in discs) + a2) <= sum(radius for *_, radius in discs)
    product = (Fraction(1), Fraction(0))
    for re, im, _ in discs:
        product = (product[0] * re - product[1] * im, product[0] * im + product[1] * re)
    # Each centre is off by less than 1e-40 of its size: three of them, and next to nothing from their products.
    assert max(abs(product[0] + a0), abs(product[1])) <= 4 * Fraction(1, 10**40) * abs(a0)
    pairs = [(one[0] * other[0] - one[1] * other[1]) for one, other in combinations(discs, 2)]
    size = sum((abs(one[0]) + abs(one[1])) * (abs(other[0]) + abs(other[1])) for one, other in combinations(discs, 2))
    assert abs(sum(pairs) - a1) <= 4 * Fraction(1, 10**40) * size


def test_eigenvectors_of_the_saddle() -> None:
    matrix = linearization(PRINTED, Fraction("30.4"), "noninverted")
    for value in equilibrium(PRINTED, "30.4", "noninverted", 40).eigenvalues:
        growth = value.re.value
        x, y = right_eigenvector(matrix, growth), ((growth - matrix.A33) * growth, matrix.A32, growth)
        rows = ((0, 0, 1), (matrix.omega, 0, 0), (matrix.A31, matrix.A32, matrix.A33))
        image = [sum(a * b for a, b in zip(row, x, strict=True)) for row in rows]
        transposed = [sum(row[column] * y[index] for index, row in enumerate(rows)) for column in range(3)]
        for got, wanted in zip((*image, *transposed), (*x, *y), strict=True):
            assert abs(got - growth * wanted) < Fraction(1, 10**30)  # the eigenvalue is known to 40 digits


def test_refusals() -> None:
    for omega in ("0", "-3", "nan", "pi", 0.0, 10**6):
        with pytest.raises(InputError):
            equilibrium(PRINTED, omega, "inverted")
    with pytest.raises(InputError, match="inverted or noninverted"):
        equilibrium(PRINTED, 30, "sideways")  # type: ignore[arg-type]


def test_equilibria_command(capsys) -> None:
    assert main(["equilibria", "--omega", "31.5", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["inverted"]["stable"] is True
    assert result["noninverted"]["stable"] is False
    assert set(result["inverted"]["eigenvalues"][0]) == {"re", "im"}


def discriminant(matrix: Linearization) -> Fraction:
    """Of the characteristic polynomial: positive where all eigenvalues are real, negative where two are not."""
    _, a2, a1, a0 = characteristic_polynomial(matrix)
    return Fraction(18 * a2 * a1 * a0 - 4 * a2**3 * a0 + a2**2 * a1**2 - 4 * a1**3 - 27 * a0**2)


@given(parameters=physical_parameters(), share=decimals("0.1", "2"))
def test_saddle_value_and_kind_against_eigenvalues(parameters: Parameters, share: Fraction) -> None:
    speed = round(omega_crit(parameters).value * share, 6)
    unstable, slow, _ = equilibrium(parameters, speed, "noninverted").eigenvalues
    value = unstable.re + slow.re
    assert saddle_value_sign(parameters, speed) == (1 if value > 0 else -1)
    for name in ("inverted", "noninverted"):
        kinds = [part.im.value for part in equilibrium(parameters, speed, name).eigenvalues]  # type: ignore[arg-type]
        assert (discriminant(linearization(parameters, speed, name)) < 0) == any(kinds)  # type: ignore[arg-type]


def test_the_saddle_value_vanishes_where_it_should() -> None:
    """lambda^2 = -a1 solves the cubic if a2 a1 = a0: then lambda_u = -lambda_s. Omega is rational for this disk."""
    disk = PRINTED.changed(r="0.04", e="0.01", m=1, B="1.6e-3", A="2e-3", g="10", C=None)  # Bbar = 1.5e-3
    square = disk.m * disk.g * (disk.r - disk.e) ** 2 / (disk.r * disk.Bbar)
    disk = disk.changed(g=disk.g * 100 / square)
    beside = (Fraction(10) + Fraction(side, 10**20) for side in (-1, 0, 1))
    assert [saddle_value_sign(disk, speed) for speed in beside] == [1, 0, -1]


@pytest.mark.parametrize("name", ["inverted", "noninverted"])
@settings(max_examples=25)
@given(parameters=physical_parameters())
def test_eigenvalues_change_kind_at_these_speeds(name: EquilibriumName, parameters: Parameters) -> None:
    speeds = kind_changes(parameters, name, 20)
    kinds = [discriminant(linearization(parameters, Fraction(1, 10**9), name)) > 0]
    for speed in speeds:
        assert speed.uncertainty <= speed.value / 10**20
        low, high = (speed.value * (1 + side * Fraction(1, 10**15)) for side in (-1, 1))
        before, after = (discriminant(linearization(parameters, end, name)) > 0 for end in (low, high))
        assert before is kinds[-1]
        assert after is not before
        kinds.append(after)
    assert (discriminant(linearization(parameters, Fraction(10**6), name)) > 0) is kinds[-1]


_DECIMALS = st.builds(
    lambda digits, power: Fraction(digits) * Fraction(10) ** power, st.integers(-999, 999), st.integers(-6, 6)
)
_RATIONALS = st.fractions(-1000, 1000, max_denominator=1000)


def product(roots: list[Fraction]) -> list[Fraction]:
    polynomial = [Fraction(3, 7)]
    for root in roots:
        polynomial = [a - root * b for a, b in zip([0, *polynomial], [*polynomial, 0], strict=True)]
    return polynomial


@given(roots=st.lists(_RATIONALS, min_size=1, max_size=4, unique=True))
def test_all_roots_are_enclosed_once(roots: list[Fraction]) -> None:
    all_enclosed = real_roots(product(roots), 30)
    assert len(all_enclosed) == len(roots)
    for enclosed, root in zip(all_enclosed, sorted(roots), strict=True):
        assert enclosed.holds(root)
        assert enclosed.uncertainty * 10**30 <= abs(root)


@given(roots=st.lists(_DECIMALS, min_size=2, max_size=3))
def test_decimals_are_exact_and_double_ones_found(roots: list[Fraction]) -> None:
    assert [root.value for root in real_roots(product(roots), 30)] == sorted(set(roots))


@given(root=_RATIONALS, square=st.fractions("1e-9", 10**9))
def test_what_has_no_other_root(root: Fraction, square: Fraction) -> None:
    """(x - root) (x^2 + square) has one, and x^2 = square the root that squares to it."""
    (only,) = real_roots([-root * square, square, -root, Fraction(1)], 20)
    assert only.holds(root)
    assert (square_root(square, 20) ** 2 - square).holds(0)
