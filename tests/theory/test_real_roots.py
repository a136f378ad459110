"""Enclosed roots against polynomials made from their roots."""

from __future__ import annotations

from fractions import Fraction

from hypothesis import given
from hypothesis import strategies as st

from tippedisk_verify.theory.real_roots import real_roots, square_root, value_at

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
    cubic = [-root * square, square, -root, Fraction(1)]
    assert not value_at(cubic, root)
    (only,) = real_roots(cubic, 20)
    assert only.holds(root)
    assert (square_root(square, 20) ** 2 - square).holds(0)
