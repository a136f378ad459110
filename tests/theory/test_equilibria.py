"""Eigenvalues against mpmath, the linearisation against the flow, real roots against products."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from itertools import permutations
from typing import Any

import mpmath
import numpy
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.problems import decimals, paper_rates, physical_parameters
from tippedisk_verify import (
    PRINTED,
    AccuracyError,
    InputError,
    Parameters,
    equilibrium,
    omega_crit,
    precision_of_bits,
)
from tippedisk_verify.display import Eigenvalue
from tippedisk_verify.model import equations
from tippedisk_verify.numbers.exact import fraction, rational_in_context
from tippedisk_verify.theory.equilibria import (
    EquilibriumName,
    Linearization,
    characteristic_polynomial,
    eigenvalues,
    equilibrium_state,
    kind_changes,
    linearization,
    saddle_value_sign,
)
from tippedisk_verify.theory.real_roots import real_roots


@pytest.mark.parametrize("name", ["inverted", "noninverted"])
@settings(max_examples=30)
@given(parameters=physical_parameters(), omega=decimals("1", "60"))
def test_linearization_is_the_jacobian_there(name, parameters, omega) -> None:
    """Derive it a second time: the general Jacobian at the equilibrium, in 200 bits."""
    precision = precision_of_bits(200)
    ctx = precision.context
    constants = type(parameters.constants_in(precision))(
        *(precision.mpf(value) for value in parameters.constants_in(precision))
    )
    state = [precision.mpf(precision.number(part)) for part in equilibrium_state(name)]
    rows = equations.jacobian(ctx, constants, precision.mpf(precision.number(omega)), "linear")(
        *state
    )
    matrix = linearization(parameters, omega, name)
    expected = [[0, 0, 1], [matrix.omega, 0, 0], [matrix.A31, matrix.A32, matrix.A33]]
    for row, expected_row in zip(rows, expected, strict=True):
        for entry, value in zip(row, expected_row, strict=True):
            # pi/2 is rounded to 200 bits, and second derivatives reach some 1e6 times the entries.
            size = 1 + abs(matrix.A31) + abs(matrix.A32) + abs(matrix.A33)
            assert abs(fraction(entry) - Fraction(value)) < size * Fraction(1, 2**170)


Rows = list[list[Any]]


def assert_eigenvalues(values: Sequence[Eigenvalue], rows: Callable[[], Rows], digits: int) -> None:
    """Check order, promised width and agreement with mpmath's eigenvalues in its current precision.

    mpmath's are those of a matrix that is off by less than 10^(12 - dps) of the norm. However close
    they are, their error is at most

        5 (2 norm)^(2/3) (10^(12 - dps) norm)^(1/3) < 10^(5 - dps/3) norm:

    Elsner's bound, with the factor 5 for pairing them. The precision makes that a hundredth of the
    smallest half-width.
    """
    parts = [(value.re, value.im) for value in values]
    centres = [(re.value, im.value) for re, im in parts]
    assert centres == sorted(centres, key=lambda centre: (-centre[0], -centre[1]))
    for re, im in parts:
        assert max(re.uncertainty, im.uncertainty) * 10**digits < max(abs(re.value), abs(im.value))
    # Of exact ones
    smallest = min(max(abs(re.value), abs(im.value)) for re, im in parts) / 10 ** (2 * digits + 40)
    width = min(
        [part.uncertainty for pair in parts for part in pair if part.uncertainty] or [smallest]
    )
    norm = max(sum(abs(entry) for entry in row) for row in rows())
    with mpmath.workdps(3 * (int(mpmath.log10(norm / rational_in_context(mpmath.mp, width))) + 8)):
        truths = mpmath.eig(mpmath.matrix(rows()), left=False, right=False)
        spare = rational_in_context(mpmath.mp, width / 100)

        def inside(value: Eigenvalue, truth: Any) -> bool:
            pairs = ((value.re, mpmath.re(truth)), (value.im, mpmath.im(truth)))
            return all(
                abs(part.mpf() - true) <= rational_in_context(mpmath.mp, part.uncertainty) + spare
                for part, true in pairs
            )

        assert any(all(map(inside, values, order)) for order in permutations(truths)), (
            values,
            truths,
        )


def entries(matrix: Linearization) -> Rows:
    """Return the matrix in mpmath's precision."""
    omega, *last = (rational_in_context(mpmath.mp, Fraction(entry)) for entry in matrix)
    return [[0, 0, 1], [omega, 0, 0], last]


_POWERS = st.integers(-15, 15)
_ENTRIES = st.builds(
    lambda digits, power: digits * Fraction(10) ** power, st.integers(-99, 99).filter(bool), _POWERS
)


@st.composite
def nearly_double(draw: st.DrawFn) -> Linearization:
    """Draw a matrix with two eigenvalues, real or complex, that are nearly or exactly equal.

    At times a third one is close to them as well.
    """
    root = draw(st.fractions(-100, 100, max_denominator=1000).filter(bool))
    gap, other_gap = (
        root * draw(st.sampled_from((-1, 0, 1, 1, 1))) * Fraction(1, 10 ** draw(st.integers(3, 30)))
        for _ in range(2)
    )
    third = draw(st.one_of(_ENTRIES, st.just(root + other_gap / 7)))
    square = draw(st.sampled_from((-1, 1))) * gap**2
    omega = draw(decimals("0.001", "60"))
    # (x - third) (x^2 - 2 root x + root^2 - square): the two are root +- sqrt(square).
    product = root**2 - square
    return Linearization(
        omega, -product - 2 * root * third, product * third / omega, 2 * root + third
    )


@settings(max_examples=60)
@given(
    matrix=st.one_of(
        st.builds(Linearization, st.builds(abs, _ENTRIES), _ENTRIES, _ENTRIES, _ENTRIES),
        nearly_double(),
    ),
    digits=st.sampled_from((6, 15, 40)),
)
def test_eigenvalues_of_any_matrix(matrix: Linearization, digits: int) -> None:
    """Draw entries thirty orders of magnitude apart; only double eigenvalues are refused."""
    if not discriminant(matrix):
        with pytest.raises(AccuracyError, match="three different eigenvalues were not found"):
            eigenvalues(matrix, digits)
        return
    values = eigenvalues(matrix, digits)
    assert numpy.array(values, complex).tolist() == [
        complex(value.re.value, value.im.value) for value in values
    ]
    assert_eigenvalues(values, lambda: entries(matrix), digits)


@settings(max_examples=40)
@given(
    parameters=physical_parameters(),
    name=st.sampled_from(("inverted", "noninverted")),
    anywhere=decimals("1", "60"),
    side=st.sampled_from((-1, 0, 1)),
    nearness=st.integers(2, 40),
    digits=st.sampled_from((6, 15, 30)),
)
def test_eigenvalues_of_an_equilibrium(parameters, name, anywhere, side, nearness, digits) -> None:
    """Compare with the Jacobian at any speed, and next to Omega_crit and to double eigenvalues."""
    special = [omega_crit(parameters, 50), *kind_changes(parameters, name, 50)]
    omega = (
        special[nearness % len(special)].value * (1 + Fraction(side, 10**nearness))
        if side
        else anywhere
    )

    def jacobian() -> Rows:
        """By complex steps, whose square is below the last digit."""
        size = mpmath.mpf(10) ** -mpmath.mp.dps
        start = (mpmath.pi / 2, mpmath.pi / 2 if name == "inverted" else -mpmath.pi / 2, 0)
        columns = []
        for moved in range(3):
            state = [mpmath.mpc(at, size if axis == moved else 0) for axis, at in enumerate(start)]
            columns.append([part.imag / size for part in paper_rates(parameters, omega, state)])
        return [list(row) for row in zip(*columns, strict=True)]

    found = equilibrium(parameters, omega, name, digits)
    assert_eigenvalues(found.eigenvalues, jacobian, digits)
    first = found.eigenvalues[0].re  # of the largest real part
    if abs(first.value) > first.uncertainty:
        assert found.stable is (first.value < 0)


def test_refusals() -> None:
    for omega in ("0", "-3", "nan", "pi", 0.0, 10**6):
        with pytest.raises(InputError):
            equilibrium(PRINTED, omega, "inverted")
    with pytest.raises(InputError, match="inverted or noninverted"):
        equilibrium(PRINTED, 30, "sideways")


def discriminant(matrix: Linearization) -> Fraction:
    """Return the characteristic polynomial's discriminant.

    It is positive where all eigenvalues are real, negative where two are not.
    """
    _, a2, a1, a0 = characteristic_polynomial(matrix)
    return Fraction(18 * a2 * a1 * a0 - 4 * a2**3 * a0 + a2**2 * a1**2 - 4 * a1**3 - 27 * a0**2)


@given(parameters=physical_parameters(), share=decimals("0.1", "2"))
def test_saddle_value_and_kind_against_eigenvalues(parameters: Parameters, share: Fraction) -> None:
    speed = round(omega_crit(parameters).value * share, 6)
    unstable, slow, _ = equilibrium(parameters, speed, "noninverted").eigenvalues
    value = unstable.re + slow.re
    assert saddle_value_sign(parameters, speed) == (1 if value > 0 else -1)
    for name in ("inverted", "noninverted"):
        kinds = [part.im.value for part in equilibrium(parameters, speed, name).eigenvalues]
        assert (discriminant(linearization(parameters, speed, name)) < 0) == any(kinds)


def test_the_saddle_value_vanishes_where_it_should() -> None:
    """Check where lambda^2 = -a1 solves the cubic (a2 a1 = a0), so that lambda_u = -lambda_s.

    Omega is rational for this disk.
    """
    # Bbar = 1.5e-3
    disk = PRINTED.changed(r="0.04", e="0.01", m=1, B="1.6e-3", A="2e-3", g="10", C=None)
    square = disk.m * disk.g * (disk.r - disk.e) ** 2 / (disk.r * disk.Bbar)
    disk = disk.changed(g=disk.g * 100 / square)
    beside = (Fraction(10) + Fraction(side, 10**20) for side in (-1, 0, 1))
    assert [saddle_value_sign(disk, speed) for speed in beside] == [1, 0, -1]


@pytest.mark.parametrize("name", ["inverted", "noninverted"])
@settings(max_examples=25)
@given(parameters=physical_parameters())
def test_eigenvalues_change_kind_at_these_speeds(
    name: EquilibriumName, parameters: Parameters
) -> None:
    speeds = kind_changes(parameters, name, 20)
    kinds = [discriminant(linearization(parameters, Fraction(1, 10**9), name)) > 0]
    for speed in speeds:
        assert speed.uncertainty <= speed.value / 10**20  # twenty digits, as asked
        low, high = (speed.value * (1 + side * Fraction(1, 10**15)) for side in (-1, 1))
        before, after = (
            discriminant(linearization(parameters, end, name)) > 0 for end in (low, high)
        )
        assert before is kinds[-1]
        assert after is not before
        kinds.append(after)
    assert (discriminant(linearization(parameters, Fraction(10**6), name)) > 0) is kinds[-1]


_DECIMALS = st.builds(
    lambda digits, power: Fraction(digits) * Fraction(10) ** power,
    st.integers(-999, 999),
    st.integers(-6, 6),
)


def product(roots: list[Fraction]) -> list[Fraction]:
    polynomial = [Fraction(3, 7)]
    for root in roots:
        polynomial = [a - root * b for a, b in zip([0, *polynomial], [*polynomial, 0], strict=True)]
    return polynomial


@given(roots=st.lists(_DECIMALS, min_size=2, max_size=3))
def test_decimal_roots_are_exact_and_double_ones_are_found(roots: list[Fraction]) -> None:
    assert [root.value for root in real_roots(product(roots), 30)] == sorted(set(roots))
