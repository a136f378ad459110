"""The checker's branch, flights and return map by the saddles, on motions made up for them: each line is asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from itertools import product
from types import SimpleNamespace
from typing import Any

import pytest
from flint import arb, arb_mat

from tests.proofs.end_entries import BITS, Change, by_hand, disk, put, read
from tests.proofs.test_checker_passage import HAIR, made_up
from tests.proofs.test_connection_certificate import arrivals
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.proofs import checker
from tippedisk_verify.proofs.checker import connection
from tippedisk_verify.proofs.checker.connection import End, ReturnMap
from tippedisk_verify.proofs.checker.passage import F, Passage, S, U
from tippedisk_verify.proofs.checker.steps import column
from tippedisk_verify.proofs.kernel.balls import ball, working_precision


@pytest.fixture(autouse=True)
def _context() -> Iterator[None]:
    with working_precision(BITS):
        yield


# --------------------------------------------------------------------------------------------------------- an entry
def test_an_entry_is_shown_part_by_part(monkeypatch: pytest.MonkeyPatch) -> None:
    """The branch above the graph at the lower speed and below it at the upper one, then the return map."""
    told: list[Any] = []
    monkeypatch.setattr(connection, "Passage", lambda flow, entry: SimpleNamespace(speeds=flow.w))
    monkeypatch.setattr(connection, "_branch", lambda n, saddle, *rest: told.append((saddle.flow.w, *rest[:2])))
    monkeypatch.setattr(connection, "ReturnMap", lambda n, *_: SimpleNamespace(shown=lambda: told.append(n.speeds)))
    entry = by_hand()
    entry["branch"]["steps"] = [7, 9]
    end = connection.end_shown(disk(PRINTED), read(entry))
    value, half = (Fraction(entry["omega_h"][name]) for name in ("value", "uncertainty"))
    assert end == End(Fraction(entry["low"]), Fraction(entry["high"]), value + half, Fraction("0.145"),
                      Fraction("0.28"))  # fmt: skip
    (lower, *first), (upper, *second), speeds = told
    assert (first, second) == ([1, 7], [-1, 9])
    for found, speed in ((lower, value - half), (upper, value + half)):
        assert abs(found - ball(speed)) < HAIR
    assert speeds.contains(ball(entry["low"]))
    assert speeds.contains(ball(entry["high"]))


EMPTY: tuple[Change, ...] = (
    put("low", "30.0485"),  # above the lower one of the speeds claimed for Omega_h only
    put("high", "30.0495"),
    put("low", "0"),
    put("gamma", "0"),
    put("v", "0"),
    put("omega_h", "uncertainty", "-1e-3"),
)


@pytest.mark.parametrize("act", EMPTY)
def test_an_interval_that_is_empty_is_refused(act: Change) -> None:
    entry = by_hand()
    act(entry)
    with pytest.raises(checker.Unproved, match="an interval is empty"):
        connection.end_shown(disk(PRINTED), read(entry))


# -------------------------------------------------------------------------------------------------------- the branch
Flown = tuple[Any, list[Any], list[Any]]  # beta_bar, z about the other saddle and F over a step
FLY: Flown = (arb("0.3"), [arb(0), arb(-3), arb(0)], [arb(1)] * 3)
ENTER: Flown = (arb("0.3"), [arb(0), arb("-0.2", 0.05), arb(0)], [arb(1)] * 3)
STAY: Flown = (arb("0.3"), [arb(0), arb("-0.1"), arb(0)], [arb(1)] * 3)
ABOVE = [arb("0.1"), arb("-0.01"), arb(0)]
GIVEN = {"reach": arb("0.01"), "cone": (arb("0.01"), arb("0.01")), "length": arb(1), "orders": [8, 8]}


def branch(
    monkeypatch: pytest.MonkeyPatch, steps: Sequence[Flown], end: Sequence[Any], sign: int = 1, **given: Any
) -> None:
    """In N of the extents 0.2, 0.2 and 0.3, with k = 0.01; at the branch's saddle DF is diagonal."""
    n = SimpleNamespace(extents=(arb("0.2"), arb("0.2"), arb("0.3")), flat=arb("0.01"))
    pieces = [(SimpleNamespace(enclosure=[beta]), z, rates) for beta, z, rates in steps]
    monkeypatch.setattr(connection, "flown", lambda *_: iter(pieces))
    monkeypatch.setattr(connection, "seen", lambda *_: end)
    saddle = SimpleNamespace(field=lambda z: (None, arb_mat([[6, 0, 0], [0, -8, 0], [0, 0, -100]]), None))
    connection._branch(n, saddle, sign, len(pieces), GIVEN | given)


def test_a_branch_flies_enters_and_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    branch(monkeypatch, [FLY, ENTER, STAY], ABOVE)
    branch(monkeypatch, [FLY, ENTER, ENTER, STAY, STAY], ABOVE)
    branch(monkeypatch, [FLY, ENTER, STAY], [-x for x in ABOVE], sign=-1)


@pytest.mark.parametrize(
    ("steps", "end", "line"),
    [
        ([FLY, ENTER, STAY], [-x for x in ABOVE], "the side claimed"),
        # k max(|z_s|, |z_f|) is 1e-4, by z_s and by z_f.
        ([FLY, ENTER, STAY], [arb("5e-5"), arb("-0.01"), arb(0)], "the side claimed"),
        ([FLY, ENTER, STAY], [arb("5e-5"), arb(0), arb("0.01")], "the side claimed"),
        ([FLY, ENTER, STAY, ENTER, STAY], ABOVE, "leaves N again"),
        ([FLY, ENTER], ABOVE, "does not come to N"),
        ([FLY], ABOVE, "does not come to N"),
        ([FLY, (*ENTER[:2], [arb(1), arb(-1), arb(1)]), STAY], ABOVE, "into N"),
        ([FLY, (ENTER[0], [arb("0.25"), ENTER[1][1], arb(0)], ENTER[2]), STAY], ABOVE, "into N"),
        ([FLY, (ENTER[0], [arb(0), ENTER[1][1], arb("0.4")], ENTER[2]), STAY], ABOVE, "into N"),
        # Once it is on its way into N, z_s grows until it is in it, wherever it is.
        ([FLY, ENTER, (*FLY[:2], [arb(1), arb(-1), arb(1)]), STAY], ABOVE, "into N"),
        ([(arb("-0.1"), *FLY[1:]), ENTER, STAY], ABOVE, "beta_bar on the way"),
        ([(arb("1.571"), *FLY[1:]), ENTER, STAY], ABOVE, "beta_bar on the way"),
    ],
)
def test_a_branch_that_moves_otherwise_is_refused(
    monkeypatch: pytest.MonkeyPatch, steps: list[Flown], end: list[Any], line: str
) -> None:
    with pytest.raises(checker.Unproved, match=line):
        branch(monkeypatch, steps, end)


@pytest.mark.parametrize(
    "given",
    [
        {"reach": arb("0.25"), "cone": (arb("0.01"), arb("0.01"))},
        {"cone": (arb(30), arb("0.01"))},
        {"cone": (arb("0.01"), arb(40))},
    ],
)
def test_the_branchs_start_lies_in_n(monkeypatch: pytest.MonkeyPatch, given: dict[str, Any]) -> None:
    """z_u up to the reach, z_s and z_f up to their shares of it."""
    with pytest.raises(checker.Unproved, match="the branch's cone"):
        branch(monkeypatch, [FLY, ENTER, STAY], ABOVE, **given)


# -------------------------------------------------------------------------------------------------------- the flights
def flight(
    monkeypatch: pytest.MonkeyPatch,
    arrival: float = 0.4,
    beta: Any = "0.4",
    turns: Sequence[Any] = (arb(1), arb(0, 1), arb(-1)),
    slows: int = -1,
    rates: Sequence[Any] = (arb(1), arb(1), arb(1)),
    levels: Sequence[float] = (0, 0, 0),
    field: Callable[[Sequence[Any]], Sequence[Any]] = lambda z: (arb(2), arb(1), arb(-3)),
    way: Callable[[Any], Any] | None = None,
) -> list[list[Any]]:
    """Three steps of one second: z_s + s is the time, less that of the arrival, or ``way`` in the last step.

    v in each step is in ``turns``, v' has the sign of ``slows``, and F is ``field``; the coordinates are the state's.
    ``levels`` are added to z_s at the steps' ends. F is (2, 1, -3), the derivatives are 1 ... 12 row by row.
    """
    s = arb(0.25)
    derivatives = arb_mat([[4 * row + k for k in range(1, 5)] for row in range(3)])
    pieces = [SimpleNamespace(enclosure=[arb(beta), arb(0), v], number=number, derivatives=lambda time: derivatives)
              for number, v in enumerate(turns)]  # fmt: skip

    def seen(saddle: Any, piece: Any, time: Any) -> list[Any]:
        place = way(time) if way and piece.number == 2 else piece.number + time - 2 - arb(arrival)
        return [time, place - s + levels[piece.number] + arb(0, 1e-9), arb(0)]

    over = [arb(0), -s + arb(0, 1), arb(0)]
    steps = [(piece, over, [arb(2), rate, arb(-3)]) for piece, rate in zip(pieces, rates, strict=True)]
    monkeypatch.setattr(connection, "flown", lambda *_: iter(steps))
    monkeypatch.setattr(connection, "seen", seen)
    returned = object.__new__(ReturnMap)
    returned.n, returned.entry = SimpleNamespace(extents=(arb(0.25), s, arb(0.5))), {"orders": [8, 8]}
    returned.exit_fast = arb(0)
    flow = SimpleNamespace(rates=lambda state: ([arb(0), arb(0), arb(slows)], []))
    saddle = SimpleNamespace(flow=flow, inverse=arb_mat([[int(i == j) for j in range(3)] for i in range(3)]),
                             field=lambda z: (list(field(z)), None, None))  # fmt: skip
    return returned.flight(saddle, arb(0), {"steps": 3, "length": arb(1)})


def test_a_flight_arrives(monkeypatch: pytest.MonkeyPatch) -> None:
    """At 2.4 s. Rows of derivatives are (2, 3, 4), (6, 7, 8), (10, 11, 12): t' = -z_s', and F t' is added to them."""
    unstable, fast, time, beta = flight(monkeypatch)
    assert time[0].contains(arb(2.4))
    # z_s is known to 1e-9, and F_s is 1.
    assert time[0].rad() < 1e-8
    assert unstable[0].overlaps(arb(0.4))
    assert fast[0] == 0
    for k, (first, second, third) in enumerate(((2, 6, 10), (3, 7, 11), (4, 8, 12)), 1):
        assert time[k] == -second
        assert unstable[k] == first - 2 * second
        assert fast[k] == third + 3 * second
        assert beta[k] == first
    assert beta[0].overlaps(arb("0.4"))


def test_a_flight_that_speeds_up_arrives_when_it_does(monkeypatch: pytest.MonkeyPatch) -> None:
    """z_s + s = t^2 + t - 0.56: F_s = 2 t + 1 counts at all moments between the middle of the step and the arrival."""
    found = flight(
        monkeypatch,
        rates=(arb(1), arb(1), arb(2, 1)),
        field=lambda z: (arb(2), 2 * z[U] + 1, arb(-3)),
        way=lambda time: time * time + time - arb("0.56"),
    )
    assert found[2][0].contains(arb(2.4))


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"beta": "-0.1"}, "beta_bar in the flight"),
        ({"beta": arb("0.05", 0.1)}, "beta_bar in the flight"),
        ({"beta": "1.571"}, "beta_bar in the flight"),
        ({"slows": 1}, "v passes zero once"),
        ({"slows": 0}, "v passes zero once"),
        ({"turns": (arb(1), arb(1), arb(-1))}, "no largest value"),
        ({"rates": (arb(1), arb(0, 1), arb(1))}, "on its way"),
        ({"rates": (arb(-1), arb(1), arb(1))}, "on its way"),
        ({"levels": (0, 0.5, 0)}, "on its way"),
        ({"rates": (arb(1), arb(1), arb(0, 1))}, "passes z_s = -s once"),
        ({"field": lambda z: (arb(2), arb(0, 1), arb(-3))}, "passes z_s = -s once"),
        ({"arrival": 1.2}, "in its last step"),
        ({"arrival": -0.2, "levels": (-1, -1, 0)}, "in its last step"),
        # F where z_s is -s, and nowhere else
        ({"field": lambda z: (arb(2), arb(-1 if z[S] == -0.25 else 1), arb(-3))}, "^it arrives:"),
    ],
)
def test_a_flight_that_moves_otherwise_is_refused(
    monkeypatch: pytest.MonkeyPatch, change: dict[str, Any], line: str
) -> None:
    with pytest.raises(checker.Unproved, match=line):
        flight(monkeypatch, **change)


def test_the_flights_cover_all_exits_and_speeds(monkeypatch: pytest.MonkeyPatch) -> None:
    """What arrives is the union of what all of them arrive with."""
    cells: list[tuple[Any, Any]] = []

    def told(self: Any, saddle: Any, slow: Any, given: Any) -> list[list[Any]]:
        cells.append((saddle.flow.w, slow))
        return [[saddle.flow.w, slow]]

    monkeypatch.setattr(ReturnMap, "flight", told)
    returned = object.__new__(ReturnMap)
    entry = read(by_hand())
    returned.parameters, returned.exits = disk(PRINTED), (arb(-0.125), arb(0.375))
    returned.entry = {**entry, "flights": [[{}] * 3, [{}] * 2]}
    ((speeds, exits),) = returned._arrivals()
    assert len(cells) == 5
    low, high = Fraction(entry["low"]), Fraction(entry["high"])
    for i, j in product(range(13), range(13)):
        speed, slow = ball(low + (high - low) * Fraction(i, 12)), arb(-0.125) + arb(j) / 24
        assert any(a.contains(speed) and b.contains(slow) for a, b in cells)
        assert speeds.contains(speed)
        assert exits.contains(slow)
    for rows in ([], [[]], [[{}], []]):
        returned.entry = {**entry, "flights": rows}
        with pytest.raises(checker.Unproved, match="no flights"):
            returned._arrivals()


# ---------------------------------------------------------------------------------------------------- the return map
def returned_by(n: Passage) -> ReturnMap:
    return ReturnMap(n, disk(PRINTED), read(by_hand()))


def changed(matrix: Any, row: int, k: int, x: float) -> Any:
    other = arb_mat(matrix)
    other[row, k] = arb(x)
    return other


BEFORE: list[tuple[str, str, Callable[[Any], Any]]] = [
    ("a passage takes time", "time", lambda n: lambda distance: arb(0)),
    ("the fast part in N", "stirred_within", lambda n: n.forcing[1] + arb(1) / 1024),
    ("the fast part in N", "forcing", lambda n: [n.forcing[0], n.stirred_within]),
    ("the sign of z_s in Q", "inverse", lambda n: changed(n.inverse, S, 1, -1.0)),
    ("beta_bar where N is left", "offset", lambda n: lambda z: [arb(1)] * 3),
    ("gamma where N is left upwards", "offset", lambda n: lambda z: [arb(-1)] * 3),
    # k |z_f| is 0.0176 along y_gamma, k |z_s| is less.
    ("Q lies below the graph", "inverse", lambda n: changed(n.inverse, U, 1, 0.015)),
    ("the saddles' boxes are apart", "inverse", lambda n: changed(n.inverse, S, 1, 0.01)),
]


@pytest.mark.parametrize(("line", "name", "other"), BEFORE)
def test_what_is_asked_before_the_flights(line: str, name: str, other: Callable[[Any], Any]) -> None:
    """One of the passage's answers is another one."""
    n = made_up()
    returned_by(n)
    setattr(n, name, other(n))
    with pytest.raises(checker.Unproved, match=f"^{line}:"):
        returned_by(n)


@pytest.mark.parametrize("swapped", [False, True])
def test_the_exits_hold_those_from_d_and_from_q(swapped: bool) -> None:
    """Beyond the saddle z_s is what is left of D's or of Q's; before it, of what Q's v brings."""
    answers = [(0.125, 0.0078125), (0.0625, 0.015625)]
    rest = iter([*(answers[::-1] if swapped else answers), (0.03125, 0)])
    n = made_up()
    vars(n).update(crossing=lambda *_: arb(0), fallen=lambda *_: [arb(x) for x in next(rest)])
    returned = returned_by(n)
    assert returned.exits == (arb(-0.03125), arb(0.125))
    assert all(returned.exit_fast.contains(x) for x in (-0.015625, 0.015625))
    assert all(returned.leaving[S].contains(x) for x in (0.03125, -0.125))
    assert not returned.leaving[S].contains(0.0625)


def before_shown() -> tuple[ReturnMap, Any]:
    """With a linear field, and arrivals that fit; what is changed in the passage now does not change its answers."""
    n = made_up()
    returned = returned_by(n)
    answers = {name: getattr(n, name) for name in ("offset", "settled", "ratio", "fallen")}
    known = SimpleNamespace(**{**vars(n), **answers, "rates": lambda z: list((n.M * column(z)).entries())})
    returned.n = known
    return returned, known


def rates_of(n: Any, row: int, x: Any, leaving: bool = False) -> Callable[[Any], Any]:
    """The linear field, but for one number where orbits enter N (z_s = -s there), or where they leave it."""
    usual = n.rates

    def rates(z: Any) -> Any:
        found = usual(z)
        if bool(z[U] < -n.extents[U] * arb(0.99)) is leaving:
            found[row] = arb(x)
        return found

    return rates


def settled_of(n: Any, place: int, answer: Sequence[float]) -> Callable[[Any, Any], Any]:
    """As it is, but for products of which that one is exactly zero: those with a variation along an axis."""
    usual = n.settled
    return lambda b, time: [arb(x) for x in answer] if b[place] == 0 else usual(b, time)


AFTER: list[tuple[str, dict[str, Callable[[Any], Any]], dict[tuple[int, int], Any]]] = [
    ("orbits enter N and leave it", {"rates": lambda n: rates_of(n, S, -1)}, {}),
    ("orbits enter N and leave it", {"rates": lambda n: rates_of(n, U, 1, leaving=True)}, {}),
    # kappa is below one; 1 + L w is not.
    ("R contracts", {"lipschitz": lambda n: arb(100)}, {}),
    # k_1 F_s is 0.8.
    ("the cone on entry", {"rates": lambda n: rates_of(n, F, 1)}, {(0, 1): arb(-0.1)}),
    # The graph rises by L times what z_f gains, 0.15 at least.
    ("heights grow downwards", {"lipschitz": lambda n: arb(1)}, {(0, 1): arb(-0.125), (1, 1): arb(0.15)}),
    ("heights grow downwards", {"ratio": lambda n: lambda time: arb(1)}, {(0, 2): arb(0.5)}),
    # A variation of z_f comes back twice as large, in the answers to this question alone.
    ("1 - DR is regular", {"settled": lambda n: settled_of(n, 0, [0, 1e5])}, {}),
    # A variation of z_u alone leaves such a z_f that the fixed point's slope is out of the cone.
    ("the cone of the derivative", {"settled": lambda n: settled_of(n, 2, [0, 1600])}, {(0, 2): arb(0)}),
    ("the compound's cone of the derivative", {"compound": lambda n: (n.compound[0], arb(1e-9))}, {}),
    # k_1 F_s is 0.8 again: more than F_f, but less than with what z_u adds.
    ("the compound's cone of the derivative", {"rates": lambda n: rates_of(n, F, 0.79)}, {(0, 1): arb(-0.1)}),
    # A variation of z_u alone comes back larger.
    ("the cycle's entry falls", {"settled": lambda n: settled_of(n, 2, [4, 0])}, {}),
    ("gamma_bar_0 falls", {"directions": lambda n: changed(n.directions, 1, S, 6)}, {}),
    ("gamma_bar_0 falls", {"directions": lambda n: changed(n.directions, 1, S, -6)}, {}),
    ("gamma_bar_0 falls", {"directions": lambda n: changed(n.directions, 1, F, 1)}, {}),
    ("the period falls", {"grows": lambda n: (arb(-1000), n.grows[1])}, {}),
]  # fmt: skip


def test_the_made_up_return_map_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ReturnMap, "_arrivals", lambda self: arrivals())
    before_shown()[0].shown()


@pytest.mark.parametrize(("line", "others", "moved"), AFTER)
def test_what_is_asked_after_the_flights(
    monkeypatch: pytest.MonkeyPatch,
    line: str,
    others: dict[str, Callable[[Any], Any]],
    moved: dict[tuple[int, int], Any],
) -> None:
    """One of the passage's answers is another one, where it has to be with other arrivals."""
    returned, n = before_shown()
    for name, other in others.items():
        setattr(n, name, other(n))
    rows = arrivals()
    for (row, k), x in moved.items():
        rows[row][k] = x
    monkeypatch.setattr(ReturnMap, "_arrivals", lambda self: rows)
    with pytest.raises(checker.Unproved, match=f"^{line}:"):
        returned.shown()
