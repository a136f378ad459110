"""Omega_h: nested digits, other methods, invariances and refusals."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest

from tippedisk_verify import (
    PRINTED,
    InputError,
    Parameters,
    Request,
    Result,
    ScipyEngine,
    Status,
    bisect_omega_h,
    heteroclinic,
)
from tippedisk_verify.connection import bisection
from tippedisk_verify.connection.bisection import follow_unstable_manifold
from tippedisk_verify.connection.splitting import splitting_zero
from tippedisk_verify.errors import NoConnectionError
from tippedisk_verify.flow.contract import EventRecord


def test_the_unstable_branch_on_both_sides(taylor) -> None:
    """The branch turns back above Omega_h, later by the law the closer the speed is. Below, it
    passes to the next well.
    """
    connection = heteroclinic(PRINTED, taylor)
    growth = float(connection.saddle_eigenvalues[0])
    times = []
    for power in (20, 22):
        omega = connection.omega_h.value + Fraction(1, 2**power)
        result = follow_unstable_manifold(PRINTED, omega, taylor)
        assert result.events[-1].name == "turns back"
        times.append(float(result.time))
    # Until the next crossing of beta = pi/2, where both directions share the passage: lambda_u -
    # lambda_s in all.
    slow = -float(connection.saddle_eigenvalues[1])
    assert abs((times[1] - times[0]) * (growth + slow) / math.log(4) - 1) < 0.02
    below = follow_unstable_manifold(PRINTED, connection.omega_h.value - Fraction(1, 2**22), taylor)
    assert below.events[-1].name == "passes"


def test_a_connection_of_neutral_saddles_is_found(taylor) -> None:
    """The series of the unstable direction has a resonance there. A distance of 1e-16 from it
    leaves no digit.
    """
    disk = PRINTED.changed(epsilon="0.3", e="0.575279602327400e-3")
    found, other = (
        heteroclinic(disk, taylor, digits=6, method=name).omega_h
        for name in ("manifolds", "bisection")
    )
    assert abs(found.value - other.value) <= found.uncertainty + other.uncertainty


def test_refusals(taylor) -> None:
    with pytest.raises(NoConnectionError, match="saddle-focus"):
        heteroclinic(PRINTED.changed(e="0.03", A="0.9e-3", B="0.8e-3", C=None), taylor)
    with pytest.raises(InputError, match="at most 12 digits"):
        heteroclinic(PRINTED, taylor, digits=13, method="scipy")


def test_a_disk_without_connection_is_refused(taylor) -> None:
    """This disk is eight times as inert about one axis. The branch turns back at every speed down
    to Omega_crit / 2.
    """
    with pytest.raises(NoConnectionError, match="connection"):
        bisect_omega_h(PRINTED.changed(A="2e-3", C=None), taylor)


def test_an_engine_without_half_widths_runs_again_at_looser_tolerances() -> None:
    """Each time the branch changes sides at another speed, by some 1e-9 of the speed or a third of
    that.
    """
    speeds = [30 * (1 + Fraction(k, 10**10)) for k in (0, 12, -3, 5, -9, 1)]
    answers = dict(zip((None, *bisection._TOLERANCES), speeds, strict=True))

    def engine(request: Request) -> Result:
        below = Fraction(request.omega) < answers[request.tolerance]
        return Result(
            Status.EVENT,
            1.0,
            None,
            1,
            events=(EventRecord("passes" if below else "turns back", 1.0, None),),
        )

    engine.measures_error = False
    found = bisect_omega_h(PRINTED, engine).omega_h
    spread = max(speeds) - min(speeds)
    # Bisection ends next to the resolution of doubles of 30 rad/s, 2^-48
    assert abs(found.value - speeds[0]) < Fraction(16, 2**48)
    assert 4 * spread < found.uncertainty < Fraction(401, 100) * spread


@pytest.mark.slow
def test_scipys_half_width_holds_with_the_smooth_law(taylor) -> None:
    """Its steps cross the kinks of this law's field, so the error does not follow the tolerance."""
    disk = Parameters(
        r="0.1331",
        e="0.01809",
        m="0.01754",
        A="1.99344e-4",
        B="1.90668e-4",
        g="9.80665",
        mu="0.484",
        epsilon="0.0275",
    )
    truth = splitting_zero(
        disk.with_friction("smooth"), Fraction("12.6157686416"), taylor, 18
    ).omega_h
    found = bisect_omega_h(disk.with_friction("smooth"), ScipyEngine("DOP853")).omega_h
    assert found.holds(truth.value)
    assert found.uncertainty < Fraction(1, 10**10)  # eleven digits of it
