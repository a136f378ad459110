"""Omega_h by bisection: its half-width holds, and SciPy finds the same speed."""

from __future__ import annotations

from fractions import Fraction

import pytest

from tests.problems import SETS
from tippedisk_verify.errors import NoConnectionError
from tippedisk_verify.flow.baseline import Baseline
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.model.precision import bits
from tippedisk_verify.orbits.bisection import bisect_omega_h, unstable_branch


@pytest.mark.parametrize("parameters", SETS, ids=lambda p: p.name)
def test_the_half_width_holds_at_200_bits(taylor, parameters) -> None:
    """The branch changes sides inside the interval, seen in 200 bits from a start 2^20 times closer to the saddle."""
    found = bisect_omega_h(parameters, taylor).omega_h
    assert found.uncertainty < Fraction(1, 10**12)
    names = []
    for sign in (-1, 1):
        result = unstable_branch(
            parameters, found.value + sign * found.uncertainty, taylor, precision=bits(200), offset=Fraction(1, 2**37)
        )
        names.append(result.events[-1].name)
    assert names == ["passes", "turns back"]


@pytest.mark.slow
def test_scipy_finds_the_same_speed(taylor) -> None:
    mine = bisect_omega_h(PRINTED, taylor).omega_h
    theirs = bisect_omega_h(PRINTED, Baseline("DOP853")).omega_h
    assert abs(mine.value - theirs.value) <= mine.uncertainty + theirs.uncertainty


def test_a_set_without_connection_is_told_so(taylor) -> None:
    """A disk eight times as inert about one axis: the branch turns back at every speed down to Omega_crit / 2."""
    with pytest.raises(NoConnectionError, match="connection"):
        bisect_omega_h(PRINTED.changed(A="2e-3", C=None), taylor)
