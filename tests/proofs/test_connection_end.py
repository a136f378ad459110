"""The end of the family of limit cycles at the connection: its flights, its inequalities, and what it must refuse."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from tippedisk_verify.proofs.search.connection_flight import Landing, fly_over
from tippedisk_verify.proofs.search.local_manifolds import Frame
from tippedisk_verify.proofs.search.passage import EXTENTS

from tests.proofs.saddle_orbits import OMEGA_H, Orbits
from tippedisk_verify.connection.heteroclinic import heteroclinic
from tippedisk_verify.cycles.shooting import limit_cycle
from tippedisk_verify.errors import InputError
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import NAMED_SETS, PRINTED, Parameters
from tippedisk_verify.proofs.kernel.balls import arb, ball, ball_constants, working_precision
from tippedisk_verify.proofs.kernel.flow import Model
from tippedisk_verify.proofs.search import connection_end as module
from tippedisk_verify.proofs.search.connection_end import prove_end
from tippedisk_verify.proofs.search.heteroclinic import ProvedConnection, Room, not_proved, prove_connection
from tippedisk_verify.proofs.search.heteroclinic import Status as ConnectionStatus
from tippedisk_verify.proofs.search.proved_end import ProvedEnd, Status
from tippedisk_verify.reference_values.lookup import reference


def _connection(parameters: Parameters = PRINTED, omega_h: Fraction = OMEGA_H) -> ProvedConnection:
    """As `prove_connection` answers; not proved here."""
    return ProvedConnection(
        ConnectionStatus.PROVED,
        Measured(omega_h, Fraction(1, 10**10)),
        True,
        (),
        Room(Fraction(11, 2000), Fraction(1, 50), Fraction(11, 250)),
        True,
        96,
        parameters=parameters,
    )


def _landing(omega: Any, slow: Any, fast: Any) -> Landing:
    with working_precision(64):
        flown = fly_over(
            Frame(PRINTED, OMEGA_H), Model(ball_constants(PRINTED), omega), list(map(ball, EXTENTS[:2])), slow, fast
        )
    assert flown is not None
    return flown[0]


def _arrival(omega: float, slow: float, fast: float) -> tuple[float, np.ndarray]:
    """Time and z where z_s = -s about the second saddle, in floating point, from z about the first."""
    u, s = (float(extent) for extent in EXTENTS[:2])
    orbits = Orbits(PRINTED, Frame(PRINTED, OMEGA_H), omega)
    away = orbits.to_z @ np.array([0, 2 * math.pi, 0])
    time, z, _ = orbits.fly(np.array([u, slow, fast]) - away, (0, 0, 0), lambda z: z[1] > -s)
    rates = orbits.F(z)
    return time + (-s - z[1]) / rates[1], z + rates * (-s - z[1]) / rates[1]


@pytest.mark.slow
def test_a_flight_arrives_where_it_should() -> None:
    """Against the Runge-Kutta method: interpolation over a step errs by STEP^2 z'' / 2, z'' < 66 s < 14, so 2e-6."""
    omega, slow = OMEGA_H + Fraction(1, 250), Fraction(1, 100)
    landing = _landing(ball(omega), ball(slow), arb(0))
    time, z = _arrival(float(omega), float(slow), 0.0)
    for enclosed, value in ((landing.unstable, z[0]), (landing.fast, z[2]), (landing.time, time)):
        assert abs(float(enclosed.mid()) - value) < 4e-6 + float(enclosed.rad())
    # Derivatives by central differences: over 1e-3 the interpolation's 2e-6 is 4e-3 of them.
    for column, (by_slow, by_fast, by_omega) in enumerate(np.eye(3)):
        ends = [_arrival(float(omega) + h * by_omega, float(slow) + h * by_slow, h * by_fast) for h in (-5e-4, 5e-4)]
        by_time, by_z = (ends[1][0] - ends[0][0]) / 1e-3, (ends[1][1] - ends[0][1]) / 1e-3
        pairs = ((landing.time_by, by_time), (landing.unstable_by, by_z[0]), (landing.fast_by, by_z[2]))
        for row, slope in pairs:
            assert abs(float(row[column].mid()) - slope) < 8e-3 + float(row[column].rad())


@pytest.mark.slow
def test_a_box_of_flights_holds_single_ones() -> None:
    omega, slow, fast = arb(float(OMEGA_H) + 0.003, 1e-3), arb(0.02, 2e-3), arb(0, 0.01)
    landing = _landing(omega, slow, fast)
    for signs in ((1, 1, 1), (-1, 1, -1), (1, -1, 0.5)):
        point = [
            float(x.mid()) + 0.99 * sign * float(x.rad()) for x, sign in zip((omega, slow, fast), signs, strict=True)
        ]
        single = _landing(*(ball(Fraction(part)) for part in point))
        for name in ("time", "unstable", "fast", "beta_most"):
            assert getattr(landing, name).overlaps(getattr(single, name))
        for name in ("unstable_by", "fast_by", "time_by", "beta_most_by"):
            assert all(a.overlaps(b) for a, b in zip(getattr(landing, name), getattr(single, name), strict=True))


def test_what_is_refused() -> None:
    assert prove_end(not_proved(ConnectionStatus.FLOW)).status is Status.NO_CONNECTION
    assert prove_end(not_proved(ConnectionStatus.NO_SADDLE)).to_dict()["proved"] is False
    with pytest.raises(InputError, match="linear friction law"):
        prove_end(_connection(PRINTED.with_friction("smooth")))
    for reach in ("0", "-1", "pi", "2", "soon"):
        with pytest.raises(InputError):
            prove_end(_connection(), reach)
    with pytest.raises(InputError, match="between the ends"):
        prove_end(_connection(), "1e-5", "1e-5")
    with pytest.raises(InputError, match="born below"):
        prove_end(_connection(), "0.9")


@pytest.mark.slow
def test_too_far_is_not_proved() -> None:
    """At Omega_h + 0.05 the cycle passes the saddle outside N."""
    end = prove_end(_connection(), "0.05")
    assert end.status in {Status.NO_LID, Status.INEQUALITY, Status.FLIGHT}
    assert end.statement.startswith("nothing is proved")


END = ProvedEnd(Status.PROVED, _connection(), Fraction("30.0479"), Fraction("30.0569"), Fraction("0.14"),
                Fraction("0.268"))  # fmt: skip


@pytest.mark.parametrize("k", [3, 4, 5, 6, 8, 10, 12])
def test_the_known_cycles_are_the_statements(k: int) -> None:
    name = f"printed/linear/near-heteroclinic/het+1e-{k}"
    gamma_bar, v = (reference(f"{name}/{part}").measured().value for part in ("gamma_bar_0", "v_0"))
    omega = OMEGA_H + Fraction(1, 10**k)
    with working_precision(64):
        assert END.meets(ball(omega), ball(gamma_bar), ball(v)) == (k < 10)  # Omega_h is known to 1e-10 here
        assert not END.meets(ball(omega), ball(gamma_bar) - ball(END.gamma), ball(v))
        assert not END.meets(ball(omega + 1), ball(gamma_bar), ball(v))
        assert not replace(END, status=Status.FLIGHT).meets(ball(omega), ball(gamma_bar), ball(v))


def test_the_statement_stands_by_itself() -> None:
    for part in (PRINTED.definition(), "linear", "30.0569", "3 pi/2 - 0.14", "-0.268"):
        assert part in END.statement
    assert json.loads(json.dumps(END.to_dict()))["to"] == "30.0569"


_PIECES = module._pieces
_SPOILED: dict[str, Callable[[Landing], Landing]] = {
    "R contracts": lambda x: replace(x, unstable_by=(2 * x.unstable_by[0], *x.unstable_by[1:])),
    "heights grow downwards": lambda x: replace(x, unstable_by=(-x.unstable_by[0], *x.unstable_by[1:])),
    "the branch's arrivals fall": lambda x: replace(x, unstable_by=(*x.unstable_by[:2], -x.unstable_by[2])),
    "arrivals above the lid": lambda x: replace(x, unstable=2 * x.unstable),
    "the fast part of arrivals": lambda x: replace(x, fast=3 * x.fast),
    "1 - DR is regular": lambda x: replace(x, fast_by=(100 * x.fast_by[0], *x.fast_by[1:])),
    "the period falls": lambda x: replace(x, time_by=(*x.time_by[:2], x.time_by[2] + 50)),
    "beta_max falls": lambda x: replace(x, beta_most_by=tuple(-part for part in x.beta_most_by)),
    "beta_max is in the flight": lambda x: replace(x, beta_most=x.beta_most / 20),
}


@pytest.mark.slow
def test_no_spoiled_constant_passes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Doubled, or with its sign turned. A few of the flights are enough: what is not proved of these is not of all."""
    with working_precision(64):
        proof = module._End(PRINTED, _connection(), END.low, END.high, None)
        guess = proof._fly(ball(END.high), arb(0), arb(0))
        assert guess is not None
        bounds = proof._bounds(proof._lid(guess))
        assert (bounds.gamma, bounds.v) == (END.gamma, END.v)
        assert module._failing(proof._starts(bounds)) == ""
        monkeypatch.setattr(module, "_pieces", lambda *given: [_PIECES(*given)[k] for k in (0, -1)])
        landing = proof._flights(bounds)
        assert landing is not None
        assert module._failing(proof._ends(bounds, landing, {})) == ""
        for name, spoil in _SPOILED.items():
            failing = [n for n, slack in proof._ends(bounds, spoil(landing), {}) if not module.positive(slack)]
            assert name in failing, (name, failing)
        # Shorter passages than there are contract less, and a lid that is too low lies in the way.
        for change, name in (
            ({"time": -bounds.time}, "R contracts"),
            ({"eta": bounds.eta / 2}, "arrivals above the lid"),
        ):
            failing = [n for n, x in proof._ends(replace(bounds, **change), landing, {}) if not module.positive(x)]
            assert name in failing, (name, failing)
        # A speed that is not Omega_h, claimed to be.
        proof.connection = _connection(omega_h=OMEGA_H + Fraction(1, 1000))
        assert not proof._connected()


@pytest.mark.slow(minutes=3)
def test_the_end_is_proved(taylor: Taylor) -> None:
    """85 CPU seconds."""
    shares: list[float] = []
    end = prove_end(prove_connection(PRINTED, OMEGA_H, 9), watch=shares.append)
    assert end.proved, end.statement
    assert shares[-1] == 1
    assert (end.high, end.gamma, end.v) == (END.high, END.gamma, END.v)
    kappa, least_time = (float(end.numbers[name]) for name in ("kappa", "T"))
    assert end.high - OMEGA_H > Fraction("5.6e-3")
    for share in (Fraction(9, 10), Fraction(1, 2), Fraction(1, 30)):
        omega = OMEGA_H + (end.high - OMEGA_H) * share
        cycle = limit_cycle(PRINTED, omega, taylor)
        with working_precision(64):
            assert end.meets(ball(omega), ball(cycle.gamma_bar_0.value), ball(cycle.v_0.value))
        assert float(cycle.multiplier_slow) < kappa**2  # of two half maps
        assert float(cycle.period) > 2 * least_time
        assert float(cycle.dperiod_domega) < 0


@pytest.mark.slow(minutes=4)
@pytest.mark.parametrize("name", ["calibrated", "geometry"])
def test_the_end_of_the_other_disks_is_proved(taylor: Taylor, name: str) -> None:
    """85 CPU seconds each."""
    omega_h = heteroclinic(NAMED_SETS[name], taylor, digits=14).omega_h.value
    end = prove_end(prove_connection(NAMED_SETS[name], omega_h, 9))
    assert end.proved, end.statement
