"""The end of the family of limit cycles at the connection, proved of disks, and what must be refused."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction

import pytest

from tests.proofs.saddle_orbits import OMEGA_H
from tippedisk_verify.connection.heteroclinic import heteroclinic
from tippedisk_verify.cycles.shooting import limit_cycle
from tippedisk_verify.errors import InputError
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import PRINTED, Parameters
from tippedisk_verify.proofs.kernel.balls import ball, working_precision
from tippedisk_verify.proofs.search.connection_end import ProvedEnd, Status, prove_end
from tippedisk_verify.proofs.search.heteroclinic import ProvedConnection, Room, prove_connection
from tippedisk_verify.proofs.search.heteroclinic import Status as ConnectionStatus
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


@pytest.fixture(scope="module")
def proof() -> ProvedConnection:
    return prove_connection(PRINTED, OMEGA_H, 9)


def test_what_is_refused(proof: ProvedConnection) -> None:
    assert prove_end(ProvedConnection(ConnectionStatus.FLOW)).status is Status.NO_CONNECTION
    assert prove_end(ProvedConnection(ConnectionStatus.NO_SADDLE)).to_dict()["proved"] is False
    with pytest.raises(InputError, match="linear friction law"):
        prove_end(replace(proof, parameters=PRINTED.with_friction("smooth")))
    for reach in ("0", "-1", "pi", "2", "soon"):
        with pytest.raises(InputError):
            prove_end(proof, reach)
    with pytest.raises(InputError, match="between the ends"):
        prove_end(proof, "1e-5", "1e-5")
    with pytest.raises(InputError, match="born below"):
        prove_end(proof, "0.9")


@pytest.mark.slow
def test_too_far_is_not_proved(proof: ProvedConnection) -> None:
    """At Omega_h + 0.05 the cycle passes the saddle outside N."""
    end = prove_end(proof, "0.05")
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


@pytest.mark.slow(minutes=2)
def test_the_end_is_proved(taylor: Taylor, proof: ProvedConnection) -> None:
    """20 CPU seconds."""
    shares: list[float] = []
    end = prove_end(proof, watch=shares.append)
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


@pytest.mark.slow(minutes=2)
@pytest.mark.parametrize("name", ["calibrated", "geometry"])
def test_the_end_of_the_other_disks_is_proved(taylor: Taylor, name: str) -> None:
    """20 CPU seconds each."""
    omega_h = heteroclinic(Parameters.named(name), taylor, digits=14).omega_h.value
    end = prove_end(prove_connection(Parameters.named(name), omega_h, 9))
    assert end.proved, end.statement
