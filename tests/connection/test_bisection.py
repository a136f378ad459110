"""Omega_h by bisection: its half-width holds, and SciPy finds the same speed."""

from __future__ import annotations

from fractions import Fraction

import pytest

from tests.problems import SETS
from tippedisk_verify.connection.bisection import bisect_omega_h, unstable_branch
from tippedisk_verify.connection.splitting import splitting_zero
from tippedisk_verify.errors import NoConnectionError
from tippedisk_verify.flow.baseline import Baseline
from tippedisk_verify.model.parameters import PRINTED, Parameters
from tippedisk_verify.model.precision import bits


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


@pytest.mark.slow
def test_scipys_half_width_holds_with_the_smooth_law(taylor) -> None:
    """Its steps run over the kinks of this law's field, and the error does not follow the tolerance."""
    disk = Parameters(
        r="0.1331", e="0.01809", m="0.01754", A="1.99344e-4", B="1.90668e-4", g="9.80665", mu="0.484", epsilon="0.0275"
    )
    truth = splitting_zero(disk.with_friction("smooth"), Fraction("12.6157686416"), taylor, 18).omega_h
    found = bisect_omega_h(disk.with_friction("smooth"), Baseline("DOP853")).omega_h
    assert found.holds(truth.value)
    assert found.uncertainty < Fraction(1, 10**10)
