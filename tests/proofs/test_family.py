"""The family from the Hopf point on: scaled states, arcs, how they are joined, and what the
command says.
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache
from typing import Any

import mpmath
import pytest

from tests.command_line import answer, printed
from tests.problems import speed_below
from tests.proofs.cases import half_flight, proved_connection
from tippedisk_verify import CALIBRATED, PRINTED, Measured, Parameters, reference
from tippedisk_verify.cycles.branch_cycles import librating_branch
from tippedisk_verify.cycles.cycle_at_speed import librating_cycle_at
from tippedisk_verify.flow import default_engine
from tippedisk_verify.proofs.angles import INVERTED, linearization
from tippedisk_verify.proofs.kernel import vector_field as equations
from tippedisk_verify.proofs.kernel.balls import Unproved, arb, ball, negative, working_precision
from tippedisk_verify.proofs.kernel.certificates import check
from tippedisk_verify.proofs.kernel.certificates.family import ArcStatus, ProvedArc, unique_within
from tippedisk_verify.proofs.kernel.half_map_of_curves import enclose_half_map
from tippedisk_verify.proofs.kernel.jets import Jet, scaled_sine
from tippedisk_verify.proofs.kernel.proved_flow import EnclosedField
from tippedisk_verify.proofs.kernel.scaled_half_map import ScaledCurve, ScaledField
from tippedisk_verify.proofs.kernel.step import evaluate_polynomial
from tippedisk_verify.proofs.search import arc_evidence
from tippedisk_verify.proofs.search import family_search as search
from tippedisk_verify.proofs.search.arc_evidence import BITS, CurveStepSearch, prove_arc
from tippedisk_verify.proofs.search.cycle_proof import prove_cycle
from tippedisk_verify.proofs.search.cycles_near_omega_h_proof import (
    CyclesNearOmegaHProof,
    CyclesNearOmegaHStatus,
)
from tippedisk_verify.proofs.search.family_proof import FamilyProof
from tippedisk_verify.proofs.search.proof_search import parameter_texts

DISK = parameter_texts(PRINTED)
SUBCRITICAL = PRINTED.changed(A="0.229e-3")
NEAR = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 30)  #: of the reference data's cycles next to Omega_h
HIGH, NEXT = Fraction("0.1"), Fraction("0.11")  # rad: short arcs, so that a low degree will do


# ------------------------------------------------------------------------------------ scaled states
@pytest.mark.parametrize("q", ["0", "1e-20", "0.04", "0.64"])
def test_the_scaled_sine_and_its_derivative(q) -> None:
    """Against the functions themselves in 60 digits, and central differences of them by q
    with steps of 1e-15.
    """
    x = "-1.1"
    with mpmath.workdps(60):

        def truth(q: Any) -> tuple[Any, Any]:
            a = mpmath.sqrt(q)  # imaginary for q < 0: the functions of q are the same
            y = mpmath.mpf(x)
            return (mpmath.sin(a * y) / a if a else y), mpmath.cos(a * y)

        step, at = mpmath.mpf(10) ** -15, mpmath.mpf(q)
        slope = (truth(at + step)[0] - truth(at - step)[0]) / (2 * step)
        # Differences are off by the third derivative, at most 1, times 1e-30; mpmath's own digits
        # by far less.
        expected = [arb(mpmath.nstr(mpmath.re(part), 50), 1e-29) for part in (*truth(at), slope)]
    with working_precision(64):
        found = scaled_sine(ball(x), ball(q))
        # Few terms decide little at z = 0.8 and must not decide wrongly: a jet over a wide range of
        # q holds them.
        wide = scaled_sine(Jet([ball(x), arb(0)]), Jet([ball("0.4"), ball("0.4")]))
        for mine, jet, theirs in zip(found, wide, expected, strict=True):
            assert mine.overlaps(theirs)
            assert mine.rad() < 2.0**-50  # 64 bits, of which the series and the quotient lose some
            assert evaluate_polynomial(
                jet.coefficients, (ball(q) - ball("0.4")) / ball("0.4")
            ).overlaps(theirs)


def test_the_scaled_field_at_the_equilibrium_is_the_linearisation() -> None:
    with working_precision(64):
        constants, omega = equations.field_constants(DISK), ball("30.4")
        start = [ball(part) for part in ("0.3", "0.9", "-1.2")]
        matrix = linearization(constants, omega, INVERTED)
        for mine, row in zip(
            ScaledField(constants, omega, arb(0)).rates(start), matrix, strict=True
        ):
            assert mine.overlaps(sum((a * x for a, x in zip(row, start, strict=True)), arb(0)))


def test_what_is_not_odd_is_refused(monkeypatch) -> None:
    usual = equations.vector_field

    def crooked(*arguments: Any) -> Any:
        rates = usual(*arguments)
        return lambda *state: (
            *rates(*state)[:2],
            rates(*state)[2] + rates(*state)[0] * rates(*state)[0],
        )

    monkeypatch.setattr("tippedisk_verify.proofs.kernel.scaled_half_map.vector_field", crooked)
    with pytest.raises(ArithmeticError, match="not odd"):
        ScaledField(equations.field_constants(DISK), ball(30), arb(0))
    one = Jet([arb(1)])
    with pytest.raises(Unproved, match="less than 1"):
        ScaledCurve(one, -one, one, [arb(0)] * 3, one)


def test_the_scaled_half_map_and_its_derivatives() -> None:
    """Of one orbit at a = 0.3, not on a cycle: from the half map itself; by q from P's
    homogeneity.
    """
    with working_precision(64):
        a, w, omega = ball("0.3"), ball("-1.7"), ball("30.8")
        constants = equations.field_constants(DISK)
        truth = half_flight(EnclosedField(constants, omega), a, a * w, derivatives=True)
        curve = ScaledCurve(
            Jet([a * a]), Jet([w]), Jet([omega]), [arb(0)] * 3, Jet([truth.time.mid()])
        )
        found = enclose_half_map(constants, curve, CurveStepSearch())
        image, matrix = (
            [jet.coefficients[0] for jet in found.image],
            [[jet.coefficients[0] for jet in row] for row in found.image_by_start],
        )
        assert found.curve_time.coefficients[0].overlaps(truth.time)
        assert found.divergence.coefficients[0].overlaps(truth.divergence)
        for k in range(2):
            assert (a * image[k]).overlaps(truth.image[k])
            assert matrix[k][1].overlaps(truth.image_by_start[k][1])
            assert (a * matrix[k][2]).overlaps(truth.image_by_start[k][2])
            by_q = (truth.image_by_start[k][0] + w * truth.image_by_start[k][1] - image[k]) / (
                2 * a * a
            )
            assert matrix[k][0].overlaps(by_q)
            # Balls of 64 bits whose radii a flight multiplies by some thousands, and 1 / (2 q) by
            # 6.
            assert matrix[k][0].rad() < 1e-6
        # The formula is for a fixed point, whose image begins with 1.
        trace = curve.trace(found.image_by_start).coefficients[0] + image[0] - 1
        assert trace.overlaps(truth.image_by_start[0][0] + truth.image_by_start[1][1])
        assert trace.rad() < 1e-5  # three of the balls above


# --------------------------------------------------------------------------------------------- arcs
@pytest.fixture
def quick(monkeypatch) -> None:
    """Polynomials of degree 2 and no wider box: seconds an arc."""
    monkeypatch.setattr(arc_evidence, "_DEGREE", 2)
    monkeypatch.setattr(arc_evidence, "_WIDE_SHARES", ())


@lru_cache(maxsize=4)
def first(parameters: Parameters) -> ProvedArc | ArcStatus:
    return prove_arc(parameters, Fraction(0), HIGH, search.hopf_guess(parameters))


@lru_cache(maxsize=1)
def second() -> ProvedArc:
    cycle = known("0.0028")
    middle = (HIGH + NEXT) / 2
    # v_0 is nearly proportional to the amplitude, Omega_crit - Omega to its square.
    guess = (
        cycle.v_0.value * middle / cycle.gamma_bar_0.value,
        cycle.omega.value,
        cycle.period.value / 2,
    )
    found = prove_arc(PRINTED, HIGH, NEXT, guess)
    assert isinstance(found, ProvedArc), found
    return found


@lru_cache(maxsize=4)
def known(below: str) -> Any:
    """The cycle of shooting."""
    return librating_cycle_at(PRINTED, speed_below(PRINTED, below), default_engine(), digits=12)


def first_arc() -> ProvedArc:
    found = first(PRINTED)
    assert isinstance(found, ProvedArc), found
    return found


def on_curve(arc: ProvedArc, gamma_bar: Measured, v: Measured, omega: Measured) -> bool:
    """Whether a cycle that S maps to itself, with numbers in these intervals, is proved to be one
    of the arc's.

    For each gamma_bar_0 of its interval those of v_0 and Omega must lie inside the box of
    uniqueness.
    """
    ends = [gamma_bar.value - gamma_bar.uncertainty, gamma_bar.value + gamma_bar.uncertainty]
    if not arc.low <= ends[0] <= ends[1] <= arc.high or ends[0] <= 0:
        return False
    with working_precision(BITS):
        amplitude, *numbers = (
            ball(x.value) + arb(0, ball(x.uncertainty)) for x in (gamma_bar, v, omega)
        )
        s = (2 * amplitude - ball(arc.low) - ball(arc.high)) / ball(arc.high - arc.low)
        if arc.scaled:
            s, numbers[0] = (
                2 * amplitude * amplitude / ball(arc.high**2) - 1,
                numbers[0] / amplitude,
            )
        off = [
            x - evaluate_polynomial([ball(part) for part in row], s)
            for x, row in zip(numbers, arc.curve, strict=True)
        ]
        return all(
            negative(abs(x) - ball(room)) for x, room in zip(off, arc.unique_within, strict=True)
        )


#: An arc that is not proved: that of `second`, with its polynomials in fewer digits.
ASSUMED = ProvedArc(
    HIGH,
    NEXT,
    (
        (Fraction("-0.17042236"), Fraction("-0.00808996"), Fraction("1.81e-6")),
        (Fraction("30.88379614"), Fraction("-0.00026592"), Fraction("-6.29e-6")),
    ),
    (Fraction("7e-7"), Fraction("2e-5")),
    (Fraction("4e-7"), Fraction("1e-5")),
)


# --------------------------------------------------------------------------- what is said, and kept
def _end(
    parameters: Parameters,
    low: str,
    high: str,
    gamma: str,
    status: CyclesNearOmegaHStatus = CyclesNearOmegaHStatus.PROVED,
) -> CyclesNearOmegaHProof:
    """As if it were proved, of an Omega_h just above ``low`` and a set Q of the gamma_bar
    from pi - ``gamma`` on.
    """
    omega_h = Measured(Fraction(low) + Fraction(1, 10**6), Fraction(1, 10**9))
    connection = replace(proved_connection(), omega_h=omega_h, parameters=parameters)
    return CyclesNearOmegaHProof(
        status, connection, Fraction(low), Fraction(high), Fraction(gamma), Fraction(1)
    )


@pytest.mark.usefixtures("quick")
def test_the_other_end_closes_only_what_it_reaches() -> None:
    """The last arc ends at NEXT, at a speed about 0.00307 below Omega_crit."""
    proof = FamilyProof(PRINTED, (first_arc(), ASSUMED))
    assert not proof.heteroclinic_closed
    low, high = proof.arcs[-1].speeds(NEXT)
    reaches = replace(proof, near_omega_h=_end(PRINTED, "30", "30.8850", "3.05"))
    assert Fraction(30) < low < high < Fraction("30.8850")
    assert reaches.heteroclinic_closed
    assert reaches.proved
    assert reaches.covered == 1
    for word in (
        "a in (0, pi)",
        "Omega_h < Omega < Omega_crit",
        "tends to infinity",
        "none but these cycles'",
    ):
        assert word in reaches.statement
    ends = reaches.to_dict()["ends"]
    assert (ends["hopf"], ends["heteroclinic"]["closed"]) == ({"closed": True}, True)
    assert Fraction(ends["heteroclinic"]["to"]) == Fraction("30.885")
    short = round(low, 9) - Fraction(1, 10**8)
    for end in (
        _end(PRINTED, "30", str(float(short)), "3.05"),  # not up to the arc's speed
        _end(PRINTED, "30.8850", "30.89", "3.05"),  # the arc's speed is below Omega_h
        _end(PRINTED, "30", "30.8850", "3.03"),  # the arc does not reach Q
        _end(CALIBRATED, "30", "30.8850", "3.05"),
        _end(PRINTED, "30", "30.8850", "3.05", CyclesNearOmegaHStatus.INEQUALITY),
    ):
        open_proof = replace(proof, near_omega_h=end)
        assert not open_proof.heteroclinic_closed
        assert open_proof.to_dict()["ends"]["heteroclinic"]["closed"] is False
        assert "a in (0, pi)" not in open_proof.statement
    assert not replace(reaches, arcs=()).proved


@pytest.mark.usefixtures("quick")
def test_what_is_covered() -> None:
    proof = FamilyProof(PRINTED, (first_arc(), ASSUMED), connection=proved_connection())
    entries = proof.to_dict()
    assert (entries["proved"], entries["ends"]["hopf"]) == (False, {"closed": True})
    assert entries["ends"]["heteroclinic"]["closed"] is False
    # Omega_crit - Omega is about 0.254 a^2 (Theorem 3) of 0.83772 rad/s in all, less the radius of
    # the last box.
    least = 0.25 * float(NEXT) ** 2 - float(ASSUMED.within[1])
    assert least / 0.83772 < float(entries["covered"]) < 0.26 * float(NEXT) ** 2 / 0.83772
    # What is rounded is rounded to the safe side.
    highest = ASSUMED.speeds(NEXT)[1]
    assert highest <= proof.omega_end < highest + Fraction(1, 10**9)
    rooms = [
        [room - near for room, near in zip(part.unique_within, part.within, strict=True)]
        for part in proof.arcs
    ]
    assert unique_within(proof.arcs) == (rooms[0][0], rooms[1][0], min(room[1] for room in rooms))
    assert PRINTED.definition() in entries["statement"]
    for word in ("asymptotically stable", "exactly one of these cycles", entries["omega_end"]):
        assert word in entries["statement"]
    holed = replace(
        proof, arcs=(first_arc(), replace(ASSUMED, low=ASSUMED.low + Fraction(1, 1000)))
    )
    assert holed.statement.startswith("nothing is proved")
    nothing = FamilyProof(SUBCRITICAL, (), ArcStatus.SPEED_GROWS)
    assert (
        nothing.statement
        == "nothing is proved: from gamma_bar_0 = 0 rad on Omega grows with the amplitude."
    )
    assert nothing.covered is None


@pytest.mark.usefixtures("quick")
def test_the_command_says_and_draws_what_is_proved(monkeypatch, tmp_path) -> None:
    proof = FamilyProof(PRINTED, (first_arc(), ASSUMED), connection=proved_connection())
    monkeypatch.setattr(search, "prove_family", lambda *_, **__: proof)
    words = f"certify branch --to {float(NEXT)}"
    result = answer(f"{words} --out {tmp_path}", status=1)
    assert (tmp_path / "proved_family.svg").stat().st_size > 10_000
    assert (result["proved"], result["covered"]) == (False, proof.to_dict()["covered"])
    assert [read_arc(entry) for entry in result["arcs"]] == [first_arc(), ASSUMED]
    said = printed(words, status=1).splitlines()
    assert ("arcs: 2" in said, f"statement: {result['statement']}" in said) == (True, True)


def read_arc(entry: Mapping[str, Any]) -> ProvedArc:
    """An arc of the command's JSON."""
    first, second = (tuple(map(Fraction, row)) for row in entry["curve"])
    unique, near = (
        (Fraction(x), Fraction(y)) for x, y in (entry["unique_within"], entry["within"])
    )
    return ProvedArc(Fraction(entry["low"]), Fraction(entry["high"]), (first, second), unique, near)


@pytest.mark.slow(minutes=8)
def test_the_whole_of_the_printed_disk(tmp_path) -> None:
    """The command's own sentence, also by its certificate; cycles of the reference data, and six
    that are proved one by one, are its.
    """
    certificate = tmp_path / "family.json"
    said = answer(f"certify branch --certificate {certificate}")
    assert check(str(certificate)) == said["statement"]
    end = said["ends"]["heteroclinic"]
    assert (said["proved"], said["covered"], said["ends"]["hopf"], end["closed"]) == (
        True,
        "1",
        {"closed": True},
        True,
    )
    proved = [read_arc(entry) for entry in said["arcs"]]
    assert search.connected_arcs(proved) == proved

    def known(gamma_bar: Measured, v: Measured, omega: Measured) -> bool:
        """Whether a cycle is one of the arcs', or next to the connection."""
        beside = (
            omega.value <= Fraction(end["to"])
            and gamma_bar.value - gamma_bar.uncertainty
            > Fraction("3.141592654") - Fraction(end["gamma"])
            and -Fraction(end["v"]) <= v.value - v.uncertainty
        )
        return beside or any(on_curve(part, gamma_bar, v, omega) for part in proved)

    for name in (
        "limit-cycle/crit-0.01",
        "limit-cycle/crit-0.7",
        *(f"near-heteroclinic/het+1e-{k}" for k in NEAR),
    ):
        v, gamma_bar = (
            reference(f"table1/linear/{name}/{part}") for part in ("v_0", "gamma_bar_0")
        )
        assert known(
            gamma_bar.measured(), v.measured(), Measured(Fraction(v.inputs["Omega"]), Fraction(0))
        ), name
    rng = random.Random(24)
    least, highest = (Fraction(said[name]["value"]) for name in ("omega_h", "omega_crit"))
    speeds = [
        round(least + (highest - least) * Fraction(rng.randint(1, 10**6 - 1), 10**6), 12)
        for _ in range(6)
    ]
    cycles = list(librating_branch(PRINTED, default_engine(), omegas=speeds))
    for start in cycles:
        cycle = prove_cycle(PRINTED, start.omega.value, (start.gamma_bar_0.value, start.v_0.value))
        found = cycle.numbers()
        assert cycle.proved
        assert known(found["gamma_bar_0"], found["v_0"], Measured(cycle.omega, Fraction(0))), (
            cycle.omega
        )
        # A cycle of another amplitude is not known.
        elsewhere = replace(
            found["gamma_bar_0"], value=found["gamma_bar_0"].value * Fraction(9, 10)
        )
        assert not known(elsewhere, found["v_0"], Measured(cycle.omega, Fraction(0)))
