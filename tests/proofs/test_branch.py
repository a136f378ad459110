"""The family from the Hopf point on: scaled states, pieces, how they are joined, and what the command says."""

from __future__ import annotations

import errno
import json
import random
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import mpmath
import pytest

from tests.proofs.cases import half_flight, speed_below
from tippedisk_verify.atlas.branch import family
from tippedisk_verify.atlas.cycles_at_speed import cycle_at
from tippedisk_verify.cli import main
from tippedisk_verify.disk import Disk
from tippedisk_verify.errors import InputError, NoConnectionError
from tippedisk_verify.figures.proved_family import draw_proved_family
from tippedisk_verify.figures.style import pyplot
from tippedisk_verify.flow import default_engine
from tippedisk_verify.model.equations import field, shifted
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import CALIBRATED, PRINTED, Parameters
from tippedisk_verify.proofs.angles import INVERTED, linearization
from tippedisk_verify.proofs.closed_forms import hopf_balls
from tippedisk_verify.proofs.kernel import field as equations
from tippedisk_verify.proofs.kernel.balls import Unproved, arb, ball, ball_constants, negative, working_precision
from tippedisk_verify.proofs.kernel.claims import family as claims
from tippedisk_verify.proofs.kernel.claims.family import Piece, Status, joined, unique_within
from tippedisk_verify.proofs.kernel.curves import GAMMA_BAR, arc_test, fly
from tippedisk_verify.proofs.kernel.flow import Model
from tippedisk_verify.proofs.kernel.jets import Jet, scaled_sine
from tippedisk_verify.proofs.kernel.scaled import ScaledCurve, ScaledModel
from tippedisk_verify.proofs.search import connection_end, curve_choices
from tippedisk_verify.proofs.search import family as search
from tippedisk_verify.proofs.search.branch import BranchProof
from tippedisk_verify.proofs.search.certificate import parameter_texts
from tippedisk_verify.proofs.search.connection_end import ProvedEnd
from tippedisk_verify.proofs.search.connection_end import Status as EndStatus
from tippedisk_verify.proofs.search.curve_choices import BITS, StepSearch, family_polynomials, piece_entry, prove_piece
from tippedisk_verify.proofs.search.heteroclinic import ProvedConnection, prove_connection
from tippedisk_verify.proofs.search.lane_cycles import prove_cycles
from tippedisk_verify.reference_values.lookup import reference

DISK = parameter_texts(PRINTED)
SUBCRITICAL = PRINTED.changed(A="0.229e-3")
NEAR = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 30)  #: of the reference data's cycles next to Omega_h
HIGH, NEXT = Fraction("0.1"), Fraction("0.11")  # rad: short pieces, so that a low degree will do


# ------------------------------------------------------------------------------------------------------- scaled states
@pytest.mark.parametrize("q", ["0", "1e-20", "0.04", "0.64"])
@pytest.mark.parametrize("x", ["-1.1", "0", "0.3"])
def test_the_scaled_sine_and_its_derivative(q, x) -> None:
    """Against the functions themselves in 60 digits, and central differences of them by q with steps of 1e-15."""
    with mpmath.workdps(60):

        def truth(q: Any) -> tuple[Any, Any]:
            a = mpmath.sqrt(q)  # imaginary for q < 0: the functions of q are the same
            y = mpmath.mpf(x)
            return (mpmath.sin(a * y) / a if a else y), mpmath.cos(a * y)

        step, at = mpmath.mpf(10) ** -15, mpmath.mpf(q)
        slope = (truth(at + step)[0] - truth(at - step)[0]) / (2 * step)
        expected = [mpmath.re(part) for part in (*truth(at), slope)]
    with working_precision(64):
        found = scaled_sine(ball(x), ball(q))
        for mine, theirs in zip(found, expected, strict=True):
            # Differences are off by the third derivative, at most 1, times 1e-30; mpmath's own digits by far less.
            assert (mine + arb(0, 1e-29)).overlaps(arb(mpmath.nstr(theirs, 50)))
            assert mine.rad() < 1e-15
        # Few terms decide little at z = 0.8 and must not decide wrongly: a jet over a wide range of q holds them.
        wide = scaled_sine(Jet([ball(x), arb(0)]), Jet([ball("0.4"), ball("0.4")]))
        for jet, theirs in zip(wide, expected, strict=True):
            assert (jet.at((ball(q) - ball("0.4")) / ball("0.4")) + arb(0, 1e-29)).overlaps(
                arb(mpmath.nstr(theirs, 50))
            )


def test_the_scaled_field_is_the_field() -> None:
    """At a = 0.7 the rates are those of a y over a, in 40 digits; at a = 0 the linearisation's."""
    state = ("0.3", "0.9", "-1.2")
    with working_precision(64):
        constants, omega = equations.constants(DISK), ball("30.4")
        start = [ball(part) for part in state]
        with mpmath.workdps(40):
            a = mpmath.mpf("0.7")
            rates = field(shifted(mpmath.mp), PRINTED.within(mpmath.mp), mpmath.mpf("30.4"), "linear")
            truth = [rate / a for rate in rates(*(a * mpmath.mpf(part) for part in state))]
        for mine, theirs in zip(ScaledModel(constants, omega, ball("0.49")).rates(start), truth, strict=True):
            assert mine.overlaps(arb(mpmath.nstr(theirs, 35)))
        matrix = linearization(constants, omega, INVERTED)
        for mine, row in zip(ScaledModel(constants, omega, arb(0)).rates(start), matrix, strict=True):
            assert mine.overlaps(sum((a * x for a, x in zip(row, start, strict=True)), arb(0)))


def test_what_is_not_odd_is_refused(monkeypatch) -> None:
    usual = equations.field

    def crooked(*arguments: Any) -> Any:
        rates = usual(*arguments)
        return lambda *state: (*rates(*state)[:2], rates(*state)[2] + rates(*state)[0] * rates(*state)[0])

    monkeypatch.setattr("tippedisk_verify.proofs.kernel.scaled.field", crooked)
    with pytest.raises(ArithmeticError, match="not odd"):
        ScaledModel(equations.constants(DISK), ball(30), arb(0))
    one = Jet([arb(1)])
    with pytest.raises(Unproved, match="less than 1"):
        ScaledCurve(one, -one, one, [arb(0)] * 3, one)


def test_the_scaled_half_map_and_its_derivatives() -> None:
    """Of one orbit at a = 0.3, not on a cycle: from the half map itself; by q from P's homogeneity."""
    with working_precision(64):
        a, w, omega = ball("0.3"), ball("-1.7"), ball("30.8")
        constants = equations.constants(DISK)
        truth = half_flight(Model(constants, omega), a, a * w, derivatives=True)
        curve = ScaledCurve(Jet([a * a]), Jet([w]), Jet([omega]), [arb(0)] * 3, Jet([truth.time.mid()]))
        found = fly(constants, curve, StepSearch())
        image, matrix = [jet.c[0] for jet in found.image], [[jet.c[0] for jet in row] for row in found.matrix]
        assert found.own_time.c[0].overlaps(truth.time)
        assert found.divergence.c[0].overlaps(truth.divergence)
        for k in range(2):
            assert (a * image[k]).overlaps(truth.image[k])
            assert matrix[k][1].overlaps(truth.matrix[k][1])
            assert (a * matrix[k][2]).overlaps(truth.by_omega[k])
            by_q = (truth.matrix[k][0] + w * truth.matrix[k][1] - image[k]) / (2 * a * a)
            assert matrix[k][0].overlaps(by_q)
            # Balls of 64 bits whose radii a flight multiplies by some thousands, and 1 / (2 q) by 6.
            assert matrix[k][0].rad() < 1e-6
        # The formula is for a fixed point, whose image begins with 1.
        trace = curve.trace(found.matrix).c[0] + image[0] - 1
        assert trace.overlaps(truth.matrix[0][0] + truth.matrix[1][1])
        assert trace.rad() < 1e-5  # three of the balls above


# -------------------------------------------------------------------------------------------------------------- pieces
@pytest.fixture
def quick(monkeypatch) -> None:
    """Polynomials of degree 2 and no wider box: seconds a piece."""
    monkeypatch.setattr(curve_choices, "_DEGREE", 2)
    monkeypatch.setattr(curve_choices, "_WIDE_SHARES", ())


@lru_cache(maxsize=4)
def first(parameters: Parameters) -> Piece | Status:
    return prove_piece(parameters, Fraction(0), HIGH, search.hopf_guess(parameters))


@lru_cache(maxsize=1)
def second() -> Piece:
    cycle = known("0.0028")
    middle = (HIGH + NEXT) / 2
    # v_0 is nearly proportional to the amplitude, Omega_crit - Omega to its square.
    guess = cycle.v_0.value * middle / cycle.gamma_bar_0.value, cycle.omega.value, cycle.period.value / 2
    found = prove_piece(PRINTED, HIGH, NEXT, guess)
    assert isinstance(found, Piece), found
    return found


@lru_cache(maxsize=4)
def known(below: str) -> Any:
    """The ordinary road's cycle."""
    return cycle_at(PRINTED, speed_below(PRINTED, below), default_engine(), digits=12)


def piece() -> Piece:
    found = first(PRINTED)
    assert isinstance(found, Piece), found
    return found


def on_curve(piece: Piece, gamma_bar: Measured, v: Measured, omega: Measured) -> bool:
    """Whether a cycle that S maps to itself, with numbers in these intervals, is proved to be one of the piece's.

    For each gamma_bar_0 of its interval those of v_0 and Omega must lie inside the box of uniqueness.
    """
    ends = [gamma_bar.value - gamma_bar.uncertainty, gamma_bar.value + gamma_bar.uncertainty]
    if not piece.low <= ends[0] <= ends[1] <= piece.high or ends[0] <= 0:
        return False
    with working_precision(BITS):
        amplitude, *numbers = (ball(x.value) + arb(0, ball(x.uncertainty)) for x in (gamma_bar, v, omega))
        s = (2 * amplitude - ball(piece.low) - ball(piece.high)) / ball(piece.high - piece.low)
        if piece.scaled:
            s, numbers[0] = 2 * amplitude * amplitude / ball(piece.high**2) - 1, numbers[0] / amplitude
        off = [x - Jet([ball(part) for part in row]).at(s) for x, row in zip(numbers, piece.curve, strict=True)]
        return all(negative(abs(x) - ball(room)) for x, room in zip(off, piece.unique_within, strict=True))


def numbers(cycle: Any) -> tuple[Measured, Measured, Measured]:
    return cycle.gamma_bar_0, cycle.v_0, cycle.omega


@pytest.mark.slow
@pytest.mark.usefixtures("quick")
def test_a_piece_begins_at_the_hopf_point_and_holds_known_cycles() -> None:
    found = piece()
    assert BranchProof(PRINTED, (found,)).hopf_closed
    assert not BranchProof(CALIBRATED, (found,)).hopf_closed
    low, high = found.speeds(Fraction(0))
    assert high - low < Fraction("1e-3")
    for below in ("1e-6", "1e-4", "2e-3"):
        cycle = known(below)
        assert 0 < cycle.gamma_bar_0.value < HIGH
        assert on_curve(found, *numbers(cycle))
        low, high = found.speeds(round(cycle.gamma_bar_0.value, 9))
        assert low < cycle.omega.value < high
        # A cycle of another speed is none of the curve's.
        elsewhere = Measured(cycle.omega.value - 3 * found.unique_within[1], Fraction(0))
        assert not on_curve(found, cycle.gamma_bar_0, cycle.v_0, elsewhere)
    assert not on_curve(found, *numbers(known("0.0028")))  # beyond its end


@pytest.mark.slow
@pytest.mark.usefixtures("quick")
def test_the_hopf_end_agrees_with_the_closed_forms() -> None:
    """The slopes at a = 0 from the flight over the curve, and those of the normal form (Theorem 3).

    To leading order beta_bar = gamma_bar' / Omega, so (beta_max / a)^2 tends to (omega / Omega_crit)^2 = e / (r + e).
    """
    high = Fraction("0.01")
    with working_precision(64):
        constants, closed = equations.constants(DISK), hopf_balls(ball_constants(PRINTED))
        ratio, speed, half = (ball(part).mid() for part in search.hopf_guess(PRINTED))
        middle = ball(high / 2)
        polynomials, total = family_polynomials(
            constants, [middle, ratio, speed], middle.mid(), 2, half, GAMMA_BAR, ScaledCurve
        )
        deviation = [arb(0), *(arb(0, abs(jet.c[1]) / 50) for jet in polynomials[1:])]
        found = arc_test(constants, ScaledCurve(*polynomials, deviation, total), GAMMA_BAR, StepSearch())
        assert found.included
        assert found.stable()
        assert found.falling()
        assert found.slowing()
        assert found.widening()
        falling = -found.slopes[1].at(-1)
        squared = constants.e / (constants.r + constants.e) / closed["amplitude_squared_slope"]
        assert falling.overlaps(squared)
        assert falling.rad() < squared / 50
        slowing = found.period_slope().at(-1)
        assert slowing.overlaps(closed["period_slope"] * squared)
        assert slowing.rad() < abs(slowing) / 50
        assert found.period().at(-1).contains(closed["period"])
        assert (found.curve.omega.at(-1) + found.within[1]).contains(closed["omega_crit"])
        # The pair's multiplier is 1 there, and the determinant of P' is -delta: its trace is 1 - delta.
        assert found.trace().at(-1).overlaps(arb(1) - found.flight.divergence.range().exp())


@pytest.mark.slow
@pytest.mark.usefixtures("quick")
def test_a_subcritical_disk_has_no_such_piece() -> None:
    assert first(SUBCRITICAL) is Status.RISING


@pytest.mark.slow  # a quarter of a minute
@pytest.mark.usefixtures("quick")
def test_a_changed_sign_in_the_field_is_not_proved(monkeypatch) -> None:
    def spoiled(disk: Mapping[str, str]) -> Any:
        honest = equations.constants(disk)
        return honest._replace(g=-honest.g)

    for module in (curve_choices, claims):
        monkeypatch.setattr(module, "constants", spoiled)
    guess = search.hopf_guess(PRINTED)
    assert isinstance(prove_piece(PRINTED, Fraction(0), HIGH, guess), Status)


@pytest.mark.slow
@pytest.mark.usefixtures("quick")
def test_neighbours_are_one_curve_and_a_shifted_box_is_not() -> None:
    a, b = piece(), second()
    assert search.chain([b, a]) == [a, b]
    assert not joined(a, b, NEXT)
    for k in (0, 1):
        rows = [list(row) for row in b.curve]
        rows[k][0] += 10 * b.unique_within[k]
        shifted_piece = replace(b, curve=(tuple(rows[0]), tuple(rows[1])))
        assert not joined(a, shifted_piece, HIGH)
        assert search.chain([a, shifted_piece]) == [a]
    assert search.chain([b]) == []
    assert search.chain([a, replace(b, low=b.low + Fraction(1, 1000))]) == [a]
    assert on_curve(b, *numbers(known("0.0028")))


def test_pieces_are_joined_as_far_as_a_box_reaches_and_no_further() -> None:
    near, room = (Fraction(1, 1000),) * 2, (Fraction(3, 1000),) * 2
    one = replace(_flat("0", "1"), within=near, unique_within=room)
    for off, together in (("0.002", True), ("0.0021", False)):
        for k in (0, 1):
            rows = [(Fraction(0),), (Fraction(30),)]
            rows[k] = (rows[k][0] + Fraction(off),)
            other = Piece(Fraction(1), Fraction(2), (rows[0], rows[1]), room, near)
            assert joined(one, other, Fraction(1)) is together


@pytest.mark.slow
@pytest.mark.usefixtures("quick")
def test_a_box_inside_the_first_one_shows_no_uniqueness(monkeypatch) -> None:
    """What a second, narrower test would prove says nothing of the zero that the first one encloses."""
    monkeypatch.setattr(curve_choices, "_WIDE_SHARES", (Fraction(1, 10**9),))
    assert prove_piece(PRINTED, Fraction(0), HIGH, search.hopf_guess(PRINTED)) == first(PRINTED)


@pytest.mark.usefixtures("quick")
def test_what_is_rounded_is_rounded_to_the_safe_side() -> None:
    proof = BranchProof(PRINTED, (piece(), second()))
    highest = second().speeds(NEXT)[1]
    assert highest <= proof.omega_end < highest + Fraction(1, 10**9)
    rooms = [part.unique_within[1] - part.within[1] for part in proof.pieces]
    assert unique_within(proof.pieces)[2] == min(rooms)


@pytest.mark.slow
@pytest.mark.usefixtures("quick")
def test_a_gap_between_pieces_leaves_nothing_proved() -> None:
    late = replace(second(), low=second().low + Fraction(1, 1000))
    holed = BranchProof(PRINTED, (piece(), late), end=_end(PRINTED, "30", "30.8850", "3.05"))
    assert holed.end_closed
    assert not holed.hopf_closed
    assert not holed.proved
    assert holed.statement.startswith("nothing is proved")


# ----------------------------------------------------------------------------------------------- what is said, and kept
@lru_cache(maxsize=1)
def connected() -> ProvedConnection:
    return prove_connection(PRINTED, "30.0488682607225", 6)


def _end(parameters: Parameters, low: str, high: str, gamma: str, status: EndStatus = EndStatus.PROVED) -> ProvedEnd:
    """As if it were proved, of an Omega_h just above ``low`` and a set Q of the gamma_bar from pi - ``gamma`` on."""
    omega_h = Measured(Fraction(low) + Fraction(1, 10**6), Fraction(1, 10**9))
    connection = replace(connected(), omega_h=omega_h, parameters=parameters)
    return ProvedEnd(status, connection, Fraction(low), Fraction(high), Fraction(gamma), Fraction(1))


@pytest.mark.usefixtures("quick")
def test_the_other_end_closes_only_what_it_reaches() -> None:
    """The last piece ends at NEXT, at a speed about 0.00307 below Omega_crit."""
    proof = BranchProof(PRINTED, (piece(), second()))
    assert not proof.end_closed
    low, high = proof.pieces[-1].speeds(NEXT)
    reaches = replace(proof, end=_end(PRINTED, "30", "30.8850", "3.05"))
    assert Fraction(30) < low < high < Fraction("30.8850")
    assert reaches.end_closed
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
        _end(PRINTED, "30", str(float(short)), "3.05"),  # not up to the piece's speed
        _end(PRINTED, "30.8850", "30.89", "3.05"),  # the piece's speed is below Omega_h
        _end(PRINTED, "30", "30.8850", "3.03"),  # the piece does not reach Q
        _end(CALIBRATED, "30", "30.8850", "3.05"),
        _end(PRINTED, "30", "30.8850", "3.05", EndStatus.INEQUALITY),
    ):
        open_proof = replace(proof, end=end)
        assert not open_proof.end_closed
        assert open_proof.to_dict()["ends"]["heteroclinic"]["closed"] is False
        assert "a in (0, pi)" not in open_proof.statement
    assert not replace(reaches, pieces=()).proved


@pytest.mark.usefixtures("quick")
def test_the_picture_says_which_end_is_open() -> None:
    closed = BranchProof(PRINTED, (piece(), second()), end=_end(PRINTED, "30", "30.8850", "3.05"))
    closed = replace(closed, connection=closed.end.connection)
    for proof, word in ((closed, "holds the rest"), (replace(closed, end=None), "open")):
        figure = draw_proved_family(proof)
        assert figure.axes[0].get_title() == "The family, 2 arcs"
        assert word in figure.axes[3].get_title()
        # The tube is as wide as the boxes of uniqueness.
        assert figure.axes[1].patches[0].get_data().values.tolist() == [float(x.unique_within[1]) for x in proof.pieces]
        pyplot().close(figure)


@pytest.mark.usefixtures("quick")
def test_what_is_covered() -> None:
    proof = BranchProof(PRINTED, (piece(), second()), connection=connected())
    entries = proof.to_dict()
    assert (entries["proved"], entries["ends"]["hopf"]) == (False, {"closed": True})
    assert entries["ends"]["heteroclinic"]["closed"] is False
    # Omega_crit - Omega is about 0.254 a^2 (Theorem 3) of 0.83772 rad/s in all, less the radius of the last box.
    least = 0.25 * float(NEXT) ** 2 - float(second().within[1])
    assert least / 0.83772 < float(entries["covered"]) < 0.26 * float(NEXT) ** 2 / 0.83772
    assert PRINTED.definition() in entries["statement"]
    for word in (
        "asymptotically stable",
        "exactly one of these cycles",
        entries["omega_end"],
        entries["amplitude_end"],
    ):
        assert word in entries["statement"]
    nothing = BranchProof(SUBCRITICAL, (), Status.RISING)
    assert nothing.statement == "nothing is proved: from gamma_bar_0 = 0 rad on Omega grows with the amplitude."
    assert nothing.covered is None


def _flat(low: str, high: str) -> Piece:
    """A piece with no meaning, for what only looks at where pieces lie."""
    near = Fraction(1, 1000), Fraction(1, 1000)
    return Piece(Fraction(low), Fraction(high), ((Fraction(0),), (Fraction(30),)), near, near)


def test_what_is_left_to_prove() -> None:
    end = Fraction("3.06")
    every = search.open_intervals([], end)
    assert (every[0].low, every[0].high, every[-1].high) == (0, search.HOPF_END, end)
    assert all(a.high == b.low for a, b in pairwise(every))
    assert search.open_intervals([], Fraction("0.5")) == [search.Interval(Fraction(0), Fraction("0.5"))]
    held = [_flat("0", "0.8"), _flat("0.8", "1"), _flat("1.5", "1.6")]
    left = search.open_intervals(held, Fraction("1.7"))
    assert (left[0].low, left[-1].high) == (1, Fraction("1.7"))
    assert {interval.high for interval in left} >= {Fraction("1.5"), Fraction("1.7")}
    assert all(interval.high <= Fraction("1.5") or interval.low >= Fraction("1.6") for interval in left)
    assert search.open_intervals(held[:2], Fraction(1)) == []


def test_an_interval_that_fails_is_halved_and_nothing_beyond_is_tried(monkeypatch) -> None:
    tried = []

    def attempt(parameters: Parameters, interval: search.Interval, guess: object) -> Piece | Status:
        tried.append(interval)
        if interval.high > 2:
            return Status.NOT_STABLE
        fits = interval.high - interval.low <= Fraction(1, 4)
        return _flat(str(interval.low), str(interval.high)) if fits else Status.NOT_INCLUDED

    monkeypatch.setattr(search, "_attempt", attempt)
    found: list[object] = []
    cycles = [tuple(Fraction(k) for _ in range(4)) for k in range(6)]
    wanted = [search.Interval(Fraction(k), Fraction(k + 1)) for k in (1, 2, 3)]
    stopped = search.prove_intervals(PRINTED, wanted, cycles, watch=lambda what, where: found.append(what))
    assert stopped is Status.NOT_STABLE
    assert [part.high for part in found if isinstance(part, Piece)] == [Fraction(k, 4) for k in (5, 6, 7, 8)]
    assert max(interval.high for interval in tried) == 3
    found.clear()
    with ThreadPoolExecutor(2) as pool:
        stopped = search.prove_intervals(PRINTED, wanted, cycles, pool, lambda what, where: found.append(what))
    assert stopped is Status.NOT_STABLE
    assert {part.high for part in found if isinstance(part, Piece)} == {Fraction(k, 4) for k in (5, 6, 7, 8)}
    monkeypatch.setattr(search, "_attempt", lambda *_: Status.RISING)
    assert search.prove_intervals(PRINTED, wanted, cycles) is Status.RISING


def test_at_the_hopf_point_only_the_lower_half_is_tried(monkeypatch) -> None:
    def attempt(parameters: Parameters, interval: search.Interval, guess: object) -> Piece | Status:
        fits = interval.high <= Fraction("0.3")
        return _flat(str(interval.low), str(interval.high)) if fits else Status.NOT_INCLUDED

    monkeypatch.setattr(search, "_attempt", attempt)
    found: list[Any] = []
    left = search.open_intervals([], search.HOPF_END)
    assert search.prove_intervals(PRINTED, left, [], watch=lambda what, where: found.append(what)) is None
    assert [part.high for part in found] == [Fraction("0.2")]
    assert search.open_intervals(found, Fraction(1))[0].low == Fraction("0.2")


def _run(capsys, *arguments: str, status: int) -> str:
    assert main(["certify", "branch", *arguments]) == status
    captured = capsys.readouterr()
    return captured.err if status == 2 else captured.out


@pytest.mark.usefixtures("quick")
def test_the_command_says_what_is_proved(capsys, monkeypatch, tmp_path) -> None:
    made = []

    def attempt(parameters: Parameters, interval: search.Interval, guess: object) -> Piece | Status:
        made.append(interval)
        return first(parameters) if not interval.low else second()

    monkeypatch.setattr(search, "_attempt", attempt)
    monkeypatch.setattr(search, "HOPF_END", HIGH)
    numbers = dict.fromkeys(("gamma_bar_0", "v_0", "omega", "period"), Measured(Fraction(1), Fraction(0)))
    monkeypatch.setattr(Disk, "branch", lambda *_, **__: SimpleNamespace(cycles=[SimpleNamespace(**numbers)]))
    monkeypatch.setattr(Disk, "heteroclinic", Mock(side_effect=NoConnectionError("none")))
    pictures = str(tmp_path / "pictures")
    asked = ("--to", str(float(NEXT)))
    result = json.loads(_run(capsys, *asked, "--out", pictures, "--json", status=1))
    assert (tmp_path / "pictures" / "proved_family.svg").stat().st_size > 10_000
    assert len(made) == len(result["arcs"]) == 2
    assert (result["proved"], result["covered"]) == (False, None)
    assert [read_piece(entry) for entry in result["arcs"]] == [piece(), second()]
    said = _run(capsys, *asked, status=1).splitlines()
    assert ("arcs: 2" in said, f"statement: {result['statement']}" in said) == (True, True)
    # If a certificate cannot be written nothing is said.
    asked = (*asked, "--certificate", str(tmp_path / "family.json"))
    monkeypatch.setattr(BranchProof, "certificate", lambda self: "written")
    assert json.loads(_run(capsys, *asked, "--json", status=1)) == result
    with monkeypatch.context() as full:
        full.setattr("os.fsync", Mock(side_effect=OSError(errno.ENOSPC, "No space left on device")))
        assert main(["certify", "branch", *asked]) == 2
    captured = capsys.readouterr()
    assert (captured.out, captured.err.count("\n"), "No space left" in captured.err) == ("", 1, True)


def read_piece(entry: Mapping[str, Any]) -> Piece:
    """An arc of the command's JSON."""
    first, second = (tuple(map(Fraction, row)) for row in entry["curve"])
    unique, near = ((Fraction(x), Fraction(y)) for x, y in (entry["unique_within"], entry["within"]))
    return Piece(Fraction(entry["low"]), Fraction(entry["high"]), (first, second), unique, near)


def test_a_reach_beyond_omega_crit_is_passed_over(monkeypatch) -> None:
    def prove_end(connection: ProvedConnection, reach: str) -> ProvedEnd:
        if reach == "0.002":
            return _end(PRINTED, "30", "30.8850", "3.05")
        raise InputError("born below")

    monkeypatch.setattr(connection_end, "prove_end", prove_end)
    assert search._next_to(connected()).proved


@pytest.mark.usefixtures("quick")
def test_the_command_has_no_sentence_for_a_subcritical_disk(capsys, monkeypatch, tmp_path) -> None:
    monkeypatch.setattr(search, "_attempt", lambda *_: first(SUBCRITICAL))
    (tmp_path / "disk.toml").write_text(
        "\n".join(f'{name} = "{value}"' for name, value in SUBCRITICAL.decimals().items()), encoding="utf-8"
    )
    said = json.loads(_run(capsys, "--parameters", str(tmp_path / "disk.toml"), "--json", status=1))
    assert (said["proved"], said["covered"], said["arcs"]) == (False, None, [])
    assert said["statement"].startswith("nothing is proved")
    assert said["ends"]["hopf"]["closed"] is False


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("--friction", "smooth"), "linear friction law only"),
        (("--to", "pi"), "amplitude"),
        (("--to", ""), "not a finite decimal"),
        (("--to", "-1"), "amplitude"),
        (("--jobs", "0"), "--jobs"),
    ],
)
def test_bad_input(arguments, word, capsys) -> None:
    assert word in _run(capsys, *arguments, status=2)


def test_arcs_are_told_without_loss() -> None:
    one = _flat("0.1", "1/3")
    assert read_piece(json.loads(json.dumps(piece_entry(one)))) == one


@pytest.mark.slow(minutes=20)
def test_the_whole_of_the_printed_disk(capsys) -> None:
    """The command's own sentence; cycles of the reference data, and a hundred that are proved one by one, are its."""
    said = json.loads(_run(capsys, "--json", status=0))
    end = said["ends"]["heteroclinic"]
    assert (said["proved"], said["covered"], said["ends"]["hopf"], end["closed"]) == (True, "1", {"closed": True}, True)
    proved = [read_piece(entry) for entry in said["arcs"]]
    assert search.chain(proved) == proved

    def known(gamma_bar: Measured, v: Measured, omega: Measured) -> bool:
        """Whether a cycle is one of the arcs', or next to the connection."""
        beside = (
            omega.value <= Fraction(end["to"])
            and gamma_bar.value - gamma_bar.uncertainty > Fraction("3.141592654") - Fraction(end["gamma"])
            and -Fraction(end["v"]) <= v.value - v.uncertainty
        )
        return beside or any(on_curve(part, gamma_bar, v, omega) for part in proved)

    for name in ("limit-cycle/crit-0.01", "limit-cycle/crit-0.7", *(f"near-heteroclinic/het+1e-{k}" for k in NEAR)):
        v, gamma_bar = (reference(f"printed/linear/{name}/{part}") for part in ("v_0", "gamma_bar_0"))
        assert known(gamma_bar.measured(), v.measured(), Measured(Fraction(v.inputs["Omega"]), Fraction(0))), name
    rng = random.Random(24)
    least, highest = (Fraction(said[name]["value"]) for name in ("omega_h", "omega_crit"))
    speeds = [round(least + (highest - least) * Fraction(rng.randint(1, 10**6 - 1), 10**6), 12) for _ in range(100)]
    cycles = list(family(PRINTED, default_engine(), omegas=speeds))
    guesses = [(cycle.gamma_bar_0.value, cycle.v_0.value) for cycle in cycles]
    for cycle in prove_cycles(PRINTED, [cycle.omega.value for cycle in cycles], guesses):
        found = cycle.numbers()
        assert cycle.proved
        assert known(found["gamma_bar_0"], found["v_0"], Measured(cycle.omega, Fraction(0))), cycle.omega
        # A cycle of another amplitude is not known.
        elsewhere = replace(found["gamma_bar_0"], value=found["gamma_bar_0"].value * Fraction(9, 10))
        assert not known(elsewhere, found["v_0"], Measured(cycle.omega, Fraction(0)))
