"""Boxes of disks: similarity, flights that follow every disk, pieces and ends of a box, and what must be refused."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache
from itertools import product

import mpmath
import pytest

from tippedisk_verify.certified import cover, pieces
from tippedisk_verify.certified.balls import arb, ball, ball_constants, working_precision
from tippedisk_verify.certified.branch import BranchProof, hopf_closed
from tippedisk_verify.certified.connection_end import prove_end
from tippedisk_verify.certified.connection_flight import fly_over
from tippedisk_verify.certified.curve_flow import Curve, fly
from tippedisk_verify.certified.disk_box import SHAPE, Disks, MovingBox, disks_off, each_within
from tippedisk_verify.certified.flow import Model, carry
from tippedisk_verify.certified.heteroclinic import ProvedConnection, Room, prove_connection
from tippedisk_verify.certified.heteroclinic import Status as ConnectionStatus
from tippedisk_verify.certified.jets import Jet
from tippedisk_verify.certified.local_manifolds import Frame
from tippedisk_verify.certified.passage import EXTENTS
from tippedisk_verify.certified.pieces import Piece, joined, prove_piece
from tippedisk_verify.certified.proved_end import ProvedEnd
from tippedisk_verify.certified.proved_end import Status as EndStatus
from tippedisk_verify.certified.scaled import ScaledCurve
from tippedisk_verify.certified.section import half_flight
from tippedisk_verify.cli import main
from tippedisk_verify.commands.piece_file import read_pieces, write_pieces
from tippedisk_verify.errors import InputError
from tippedisk_verify.model.equations import field
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import CALIBRATED, PRINTED, Parameters

OMEGA_H = Fraction("30.067224340577")
SLOPES = tuple(map(Fraction, ("1.635", "-8.497", "-6.555", "0.0735")))  #: of Omega next to the connection
WIDTH, HIGH, NEXT = Fraction("1e-4"), Fraction("0.1"), Fraction("0.11")
CORNERS = tuple(product((-1, 1), repeat=4))
SOME = (CORNERS[0], CORNERS[6], CORNERS[9], CORNERS[15])


def disk(d: tuple[Fraction, ...], middle: Parameters = CALIBRATED) -> Parameters:
    """The disk with r, g, m and epsilon of the middle one whose four numbers are 1 + d times that one's."""
    e, a, b, k = (1 + part for part in d)
    Bbar = b * middle.Bbar
    return middle.changed(e=e * middle.e, A=a * middle.A, B=Bbar + middle.m * (e * middle.e) ** 2, mu=k * middle.mu)


def scaled(signs: tuple[int, ...], width: Fraction = WIDTH) -> tuple[Fraction, ...]:
    return tuple(sign * width for sign in signs)


# ---------------------------------------------------------------------------------------------------------- similarity
@pytest.mark.parametrize("factors", [("2", "1"), ("0.3", "1.7"), ("1.01", "0.4")])
def test_similar_disks_have_the_same_orbits(factors) -> None:
    """v' of a disk, in 40 digits, is tau^-2 times that of the similar disk with r_0 and g_0 at tau Omega, tau v."""
    length, gravity = map(Fraction, factors)
    similar = CALIBRATED
    other = PRINTED.changed(
        r=similar.r * length,
        e=similar.e * length,
        m="0.2",
        A=Fraction("0.2") / similar.m * similar.A * length**2,
        B=Fraction("0.2") / similar.m * similar.B * length**2,
        g=similar.g * gravity,
    )
    with mpmath.workdps(40):
        tau = mpmath.sqrt(mpmath.mpf(length.numerator) / length.denominator)
        tau /= mpmath.sqrt(mpmath.mpf(gravity.numerator) / gravity.denominator)
        mine, theirs = other.within(mpmath.mp), similar.within(mpmath.mp)
        theirs = theirs._replace(k=mine.k * tau)
        omega, v = mpmath.mpf("30.2"), mpmath.mpf("-0.7")
        state = mpmath.mpf("1.9"), mpmath.mpf("0.4")
        found = field(mpmath.mp, mine, omega, "linear")(*state, v)
        truth = field(mpmath.mp, theirs, tau * omega, "linear")(*state, tau * v)
        for part, whole, power in zip(found, truth, (1, 1, 2), strict=True):
            assert abs(part * tau**power - whole) < mpmath.mpf(10) ** -35
        # k sqrt(r / g) is what both have in common.
        ratio = mine.k * mpmath.sqrt(mine.r / mine.g) / (theirs.k * mpmath.sqrt(theirs.r / theirs.g))
        assert abs(ratio - 1) < mpmath.mpf(10) ** -35


def numbers(disk: Parameters) -> tuple[Fraction, Fraction, Fraction, Fraction]:
    """The four, the last one squared."""
    lever = disk.e / disk.r
    friction = disk.mu**2 * disk.g * disk.r / disk.epsilon**2
    return lever, disk.A / (disk.m * disk.r**2), disk.B / (disk.m * disk.r**2) - lever**2, friction


@pytest.mark.parametrize("width", ["1e-3", "1e-6"])
def test_disks_with_all_eight_numbers_near_are_in_the_box(width) -> None:
    """At all corners of the eight; somewhere little room is left."""
    box, x = Fraction(width), Fraction(each_within(CALIBRATED, Fraction(width)))
    middle, worst = numbers(CALIBRATED), Fraction(0)
    for signs in product((-1, 1), repeat=8):
        names = ("r", "e", "m", "A", "B", "g", "mu", "epsilon")
        changes = {name: getattr(CALIBRATED, name) * (1 + s * x) for name, s in zip(names, signs, strict=True)}
        near = numbers(replace(CALIBRATED, **changes))
        for part, whole, power in zip(near, middle, (1, 1, 1, 2), strict=True):
            assert (1 - box) ** power <= part / whole <= (1 + box) ** power
            worst = max(worst, abs(part / whole - 1))
    # Two digits, rounded down, of a bound that takes both parts of (B - m e^2) / (m r^2) at their worst.
    assert worst > box * 95 / 100


# ------------------------------------------------------------------------------------------------------------- flights
def test_the_orbits_of_every_disk_lie_in_the_enclosure() -> None:
    """Over 0.2 s, of disks at corners and speeds that move with them; and so do differences, by the derivatives."""
    start = [ball(0), ball("1.7"), ball("-1.1")]
    with working_precision(64):
        disks = Disks(disks_off(WIDTH), [ball(slope) for slope in SLOPES])
        model = Model(ball_constants(CALIBRATED), ball("30.4"), disks=disks)
        found = carry(model, start, "0.2", derivatives=True)
        middle = carry(Model(ball_constants(CALIBRATED), ball("30.4")), start, "0.2", derivatives=True)
        assert found.matrix is not None
        assert len(found.matrix[0]) == 4 + len(SHAPE)
        for signs in SOME[1:3]:
            d = scaled(signs)
            omega = Fraction("30.4") + sum(slope * part for slope, part in zip(SLOPES, d, strict=True))
            truth = carry(Model(ball_constants(disk(d)), ball(omega)), start, "0.2")
            for row in range(3):
                assert found.state[row].contains(truth.state[row])
                moved = sum((found.matrix[row][4 + j] * ball(d[j]) for j in range(4)), arb(0))
                assert (middle.state[row] + moved).overlaps(truth.state[row])
            # The enclosure is not much wider than what it holds: states move by some 1e-4 times numbers below 10.
            assert max(float(part.rad()) for part in found.state) < 5e-3


@pytest.mark.parametrize("square", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_the_half_map_of_every_disk(square) -> None:
    """Of an ordinary start and of a scaled one, not on a cycle: image, time and derivatives hold those of corners."""
    a, omega, v = Fraction("0.3"), Fraction("30.8"), Fraction("-0.5")
    along = [(Fraction(k, 3), Fraction(2 - k)) for k in range(4)]
    with working_precision(64):
        kind, first, second = (ScaledCurve, a * a, v / a) if square else (Curve, a, v)
        pace = (arb(0), ball("0.5"), ball("-0.3"), ball("1.25"))
        following = [(Jet([ball(x)]), Jet([ball(y)]), Jet([z.mid()])) for (x, y), z in zip(along, pace, strict=True)]
        curve = kind(
            Jet([ball(first).mid()]),
            Jet([ball(second).mid()]),
            Jet([ball(omega).mid()]),
            [arb(0)] * 3 + disks_off(WIDTH),
            following,
        )
        total = half_flight(Model(ball_constants(CALIBRATED), ball(omega)), ball(a), ball(v)).time
        found = fly(ball_constants(CALIBRATED), curve, Jet([total.mid()]))
        assert found.proved
        unit = a if square else Fraction(1)
        for signs in SOME[1:3]:
            d = scaled(signs)
            moved_v, moved_omega = (sum(pair[k] * part for pair, part in zip(along, d, strict=True)) for k in (0, 1))
            constants = ball_constants(disk(d))
            truth = half_flight(
                Model(constants, ball(omega + moved_omega)), ball(a), ball(v + unit * moved_v), derivatives=True
            )
            assert found.time.c[0].contains(truth.time)
            assert found.divergence.c[0].contains(truth.divergence)
            for k in range(2):
                by_d = sum((found.matrix[k][3 + j].c[0] * ball(d[j]) for j in range(4)), arb(0))
                assert (ball(unit) * (found.image[k].c[0] + by_d)).overlaps(truth.image[k])
                assert found.matrix[k][1].c[0].contains(truth.matrix[k][1])
                assert (ball(unit) * found.matrix[k][2].c[0]).contains(truth.by_omega[k])


@pytest.mark.slow
def test_flights_between_the_saddles_hold_those_of_every_disk() -> None:
    width, sides = Fraction("1e-5"), list(map(ball, EXTENTS[:2]))
    with working_precision(64):
        disks = MovingBox(width, SLOPES).disks()
        constants, speed = ball_constants(CALIBRATED), ball("30.07")
        many = fly_over(Frame(CALIBRATED, OMEGA_H, disks), Model(constants, speed, disks=disks), sides, arb(0), arb(0))
        assert many is not None
        for signs in SOME[:2]:
            d = scaled(signs, width)
            omega = Fraction("30.07") + sum(slope * part for slope, part in zip(SLOPES, d, strict=True))
            # The same coordinates at the saddles, whatever the disk.
            frame = Frame(CALIBRATED, OMEGA_H, Disks([ball(part) for part in d], [arb(0)] * 4))
            one = fly_over(frame, Model(ball_constants(disk(d)), ball(omega)), sides, arb(0), arb(0))
            assert one is not None
            assert many[0].beta_most.overlaps(one[0].beta_most)  # of whole steps, which differ
            for name in ("time", "unstable", "fast"):
                assert getattr(many[0], name).contains(getattr(one[0], name))
            for name in ("unstable_by", "fast_by", "time_by"):
                for mine, theirs in zip(getattr(many[0], name), getattr(one[0], name), strict=True):
                    assert mine.contains(theirs)


# -------------------------------------------------------------------------------------------------------------- pieces
@pytest.fixture
def quick(monkeypatch) -> None:
    """Polynomials of degree 2 and no wider box: seconds a piece."""
    monkeypatch.setattr(pieces, "_DEGREE", 2)
    monkeypatch.setattr(pieces, "_WIDE_SHARES", ())


@lru_cache(maxsize=4)
def first(parameters: Parameters, width: Fraction) -> Piece | pieces.Status:
    return prove_piece(parameters, Fraction(0), HIGH, cover.hopf_guess(parameters), scaled=True, width=width)


def as_if_proved() -> Piece:
    """A piece of a box with the numbers of a real one, not proved here: Omega is about Omega_crit - 0.25 a^2."""
    curve = (Fraction("-0.525"), Fraction(0)), (Fraction("30.91567"), Fraction("-0.00125"))
    slopes = (("0.2", "1.5"), ("0.1", "-0.3"), ("-0.1", "-15.4"), ("0", "0"))
    along = tuple(((Fraction(v), Fraction(0)), (Fraction(omega), Fraction(0))) for v, omega in slopes)
    near, room = (Fraction("1e-5"), Fraction("1e-4")), (Fraction("2e-5"), Fraction("2e-4"))
    return Piece(Fraction(0), HIGH, True, curve, room, near, WIDTH, along)


@pytest.mark.slow  # half a minute
@pytest.mark.usefixtures("quick")
def test_a_piece_holds_the_cycles_of_every_disk() -> None:
    """Each corner's own piece, proved of this disk alone, lies in the box's, which follows the disk."""
    box = first(CALIBRATED, WIDTH)
    assert isinstance(box, Piece), box
    assert hopf_closed(CALIBRATED, box)
    for signs in SOME[:2]:
        d = scaled(signs)
        alone = first(disk(d), Fraction(0))
        assert isinstance(alone, Piece), alone
        for amplitude in (HIGH / 3, HIGH):
            slopes = box.slopes(amplitude)
            for k in range(2):
                centre = box.at(amplitude)[k] + sum(slope[k] * part for slope, part in zip(slopes, d, strict=True))
                off = box.scaled_to(amplitude, box.within)[k] + alone.scaled_to(amplitude, alone.within)[k]
                assert abs(alone.at(amplitude)[k] - centre) <= off
        # What follows the disk is far narrower than what the disks differ by.
        assert box.within[1] < box.moved(HIGH)[1] / 20
        low, high = box.speeds(HIGH)
        assert low < alone.at(HIGH)[1] < high


def test_pieces_of_a_box_are_joined_disk_by_disk(tmp_path) -> None:
    box = as_if_proved()
    later = replace(box, low=HIGH, high=NEXT, scaled=False, curve=_constant(box.at(HIGH)), along=_constants(box))
    later = replace(later, within=box.scaled_to(HIGH, box.within), unique_within=box.scaled_to(HIGH, box.unique_within))
    assert joined(box, later, HIGH)
    for k in (0, 1):
        room = later.unique_within[k] / WIDTH
        rows = [list(row) for row in later.along[2]]
        rows[k][0] += room
        spoiled = replace(later, along=(*later.along[:2], (tuple(rows[0]), tuple(rows[1])), later.along[3]))
        assert not joined(box, spoiled, HIGH)
    assert not joined(box, replace(later, width=WIDTH / 2), HIGH)
    assert not joined(replace(box, width=Fraction(0), along=()), later, HIGH)
    # A box's pieces are kept in a file for this box only.
    path = str(tmp_path / "arcs")
    write_pieces(path, CALIBRATED, [box, later])
    assert read_pieces(path, CALIBRATED, WIDTH) == [box, later]
    for width in (Fraction(0), WIDTH / 2):
        with pytest.raises(InputError, match="another disk or box"):
            read_pieces(path, CALIBRATED, width)
    entry = json.loads(json.dumps(box.json()))
    with pytest.raises(ValueError, match="other numbers"):
        Piece.read(entry | {"along": entry["along"][:3]})


def _constant(values: tuple[Fraction, Fraction]) -> pieces.Rows:
    return (values[0],), (values[1],)


def _constants(box: Piece) -> tuple[pieces.Rows, ...]:
    return tuple(map(_constant, box.slopes(HIGH)))


@pytest.mark.slow  # half a minute
@pytest.mark.usefixtures("quick")
def test_a_box_with_a_subcritical_disk_is_not_proved() -> None:
    """Of the middle disk alone the piece is proved; with A 1 % smaller cycles are born above Omega_crit.

    A / Bbar must be above r (2 r - e) / (2 (r + e) (r - 2 e)) = 1.0362 for cycles below it.
    """
    middle = PRINTED.changed(A="0.2340e-3")
    assert middle.A / middle.Bbar > Fraction("1.0363") > middle.A * Fraction("0.99") / middle.Bbar
    assert isinstance(first(middle, Fraction(0)), Piece)
    found = first(middle, Fraction(1, 100))
    assert not isinstance(found, Piece)
    proof = BranchProof(middle, (), found, width=Fraction(1, 100))
    assert not proof.proved
    assert proof.statement.startswith("nothing is proved")


# ------------------------------------------------------------------------------------------ the other end, and the rest
def end_as_if_proved(box: MovingBox, low: str, high: str) -> ProvedEnd:
    return ProvedEnd(
        EndStatus.PROVED, connection(), Fraction(low), Fraction(high), Fraction("3.05"), Fraction(1), box=box
    )


def connection() -> ProvedConnection:
    """As `prove_connection` answers; not proved here."""
    room = Room(Fraction(11, 2000), Fraction(1, 50), Fraction(11, 250))
    known = Measured(OMEGA_H, Fraction(1, 10**10))
    return ProvedConnection(ConnectionStatus.PROVED, known, True, (), room, True, 96, parameters=CALIBRATED)


def test_the_statement_of_a_box() -> None:
    """As if Q reached to the first piece's end, at speeds about 0.0025 rad/s below Omega_crit, 30.9169 rad/s."""
    piece = as_if_proved()
    slopes = tuple(slope[1] for slope in piece.slopes(HIGH))
    proof = BranchProof(CALIBRATED, (piece,), width=WIDTH)
    assert proof.hopf_closed
    assert not proof.proved
    assert proof.covered is None
    assert "every tippedisk" in proof.statement
    assert "Omega_crit = sqrt(" in proof.statement
    assert "a in (0, pi)" not in proof.statement
    whole = replace(proof, end=end_as_if_proved(MovingBox(WIDTH, slopes), "30", "30.9160"))
    assert whole.proved
    assert whole.covered == 1
    assert "a in (0, pi)" in whole.statement
    assert whole.json()["box"]["width"] == "0.0001"
    # 1e-10, the radius of the middle disk's Omega_h, is said of no other disk.
    assert connection().omega_h.decimals()[0] not in whole.statement
    told = replace(whole, connection=connection()).json()
    assert "omega_h" not in told
    assert "omega_crit" not in told
    assert told["box"]["middle_disk"].keys() == {"omega_crit", "omega_h"}
    # Speeds that do not move with the disk: 15 rad/s times the width is more than the room there is.
    still = MovingBox(WIDTH, (Fraction(0),) * 4)
    high = str(float(piece.at(HIGH)[1] + Fraction("1e-3")))
    assert replace(proof, end=end_as_if_proved(MovingBox(WIDTH, slopes), "30", high)).proved
    assert not replace(proof, end=end_as_if_proved(still, "30", high)).end_closed
    for box in (MovingBox(Fraction(0), ()), MovingBox(WIDTH / 2, slopes)):
        assert not replace(whole, end=end_as_if_proved(box, "30", "30.9160")).proved
    assert not replace(whole, width=WIDTH / 2).proved
    assert not replace(whole, width=Fraction(0)).proved


@pytest.mark.slow
def test_a_box_too_wide_for_the_end_is_refused() -> None:
    end = prove_end(connection(), box=MovingBox(Fraction("1e-3"), SLOPES))
    assert not end.proved
    assert end.statement.startswith("nothing is proved")


@pytest.mark.parametrize("text", ["0", "-1e-6", "1", "pi", "x", "1e-31"])
def test_bad_boxes(text, capsys) -> None:
    assert main(["certify", "branch", "--box", text]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_box_belongs_to_the_curve(capsys) -> None:
    assert main(["certify", "branch", "--at", "A^in", "--box", "1e-6"]) == 2
    assert "--box" in capsys.readouterr().err


@pytest.mark.slow(minutes=4)
def test_the_last_arc_and_the_end_of_a_box() -> None:
    """The end, in 120 CPU seconds, and the last arc, in 50: they meet, at the speed of each disk."""
    width = Fraction("3e-6")
    known = prove_connection(CALIBRATED, OMEGA_H, 9)
    end = prove_end(known, box=MovingBox(width, SLOPES))
    assert end.proved, end.statement
    low, high = end.speeds()
    assert low < OMEGA_H < high
    guess = Fraction("-0.16122482"), Fraction("30.07348247"), Fraction("1.25719954")
    last = prove_piece(CALIBRATED, Fraction("3.0491"), Fraction("3.0541"), guess, width=width)
    assert isinstance(last, Piece), last
    proof = BranchProof(CALIBRATED, (last,), connection=known, end=end, width=width)
    assert proof.end_closed
    assert not proof.hopf_closed
    assert not proof.proved
    # Of disks that are ten times as far off nothing is proved by this.
    assert not replace(proof, width=10 * width).end_closed
