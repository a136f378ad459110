"""The cycles next to the connection: each inequality on motions made up for it, and the
flights between the saddles.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from flint import arb, arb_mat

from tests.proofs.cases import in_precision
from tests.proofs.saddle_orbits import DIRECTIONS, DISK, OMEGA_H, TOLERANCE, Orbits
from tests.proofs.test_passage import BITS, EVIDENCE_VALUES, F, S, U, column, made_up_passage
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.proofs.kernel import saddle_passage as flights_module
from tippedisk_verify.proofs.kernel.ball_array import BallArray
from tippedisk_verify.proofs.kernel.balls import Unproved, ball
from tippedisk_verify.proofs.kernel.certificates import cycles_near_omega_h as module
from tippedisk_verify.proofs.kernel.certificates.cycles_near_omega_h import (
    EnclosedCyclesNearOmegaH,
    LoopMap,
    verify_cycles,
)
from tippedisk_verify.proofs.kernel.saddle import SaddleCoordinates
from tippedisk_verify.proofs.kernel.saddle_passage import SaddlePassage
from tippedisk_verify.proofs.kernel.saddle_passage import enclose_arrivals as flown

_context = in_precision(BITS)
#: of D and Q, for the passage of `test_passage`
ENTRY: dict[str, Any] = {
    "lid": arb(0.077),
    "fast": arb(1) / 512,
    "weight": arb(0.25),
    "moment": arb(0.052),
    "gamma": "0.145",
    "v": "0.28",
}


# -------------------------------------------------------------------------------------- the flights
EXTENTS = 1, 1, 0.3  #: larger than those of a proof, so that flights are short
STEPS = 84


def arrival(omega: float, slow: float, fast: float) -> tuple[float, np.ndarray]:
    """Time and z where z_s = -s about the second saddle, in floating point, from z about the
    first.
    """
    u, s, _ = EXTENTS
    orbits = Orbits(PRINTED, DIRECTIONS, omega)
    away = orbits.to_z @ np.array([0, 2 * math.pi, 0])
    time, z, _ = orbits.fly(np.array([u, slow, fast]) - away, (0, 0, 0), lambda z: z[1] + s)
    return time, z


def flights(
    omega: Sequence[Any],
    slow: Sequence[Any],
    fast: Any,
    time: Any,
    count: int = STEPS,
    end: int = STEPS,
) -> list[list[Any]]:
    saddle = SaddleCoordinates(DISK, "linear", BallArray.of(omega), DIRECTIONS)
    lengths = np.asarray(time) / (count - 0.5)
    return flown(saddle, [arb(x) for x in EXTENTS], BallArray.of(slow), fast, lengths, end)


@pytest.mark.slow(minutes=0.3)
def test_flights_arrive_where_they_should() -> None:
    """Against SciPy: errors of some hundred steps, which the flight multiplies by a thousand.

    Derivatives are held against central differences over 1e-4, which divide twice those errors.
    """
    error = 1e5 * TOLERANCE
    omega, slow = float(OMEGA_H) + 0.004, 0.01
    time, z = arrival(omega, slow, 0.0)
    landed = flights([arb(omega)], [arb(slow)], arb(0), [time])
    for row, value in zip(landed, (z[0], z[2], time), strict=False):
        assert abs(float(row[0].mid()) - value) < error + float(row[0].rad())
        # Balls of 53 bits, whose radii a flight multiplies by some ten thousand in 84 steps
        assert float(row[0].rad()) < 1e-5
    for k, (by_slow, by_fast, by_omega) in enumerate(np.eye(3), 1):
        (before, low), (after, high) = (
            arrival(omega + h * by_omega, slow + h * by_slow, h * by_fast) for h in (-5e-5, 5e-5)
        )
        changes = [*((high - low)[[0, 2]] / 1e-4), (after - before) / 1e-4]
        for row, slope in zip(landed, changes, strict=False):
            assert abs(float(row[k].mid()) - slope) < 2 * error / 1e-4 + float(row[k].rad())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("end", "line"), [(STEPS - 2, "in its last step|passes"), (STEPS + 3, "on its way")]
)
def test_flights_that_end_before_the_arrival_or_after_it_are_refused(end: int, line: str) -> None:
    time = arrival(float(OMEGA_H), 0.01, 0.0)[0]
    with pytest.raises(Unproved, match=line):
        flights([arb(float(OMEGA_H))], [arb(0.01)], arb(0), [time], end=end)


@pytest.mark.parametrize("share", [-1, 10, math.nan])
def test_steps_backwards_or_too_long_are_refused_with_their_flight(share: float) -> None:
    time = arrival(float(OMEGA_H), 0.01, 0.0)[0]
    with pytest.raises(Unproved, match="flight 2: the states and derivatives"):
        flights([arb(float(OMEGA_H))] * 2, [arb(0.01)] * 2, arb(0), [time, share * time])


@pytest.mark.parametrize(
    ("beta", "v", "slows", "line"),
    [
        ((0.5, 0.5), (arb(1), arb(-1)), -1, [False, False]),
        ((0.5, 0.5), (arb(1), arb(0, 1)), -1, [False, True]),
        ((0.5, 0.5), (arb(1), arb(0, 1)), 1, "flight 2: v is not shown to pass zero once"),
        ((0.5, 0.5), (arb(1), arb(0, 1)), 0, "flight 2: v is not shown to pass zero once"),
        ((0.5, -0.1), (arb(1), arb(1)), -1, "flight 2: 0 < beta_bar"),
        ((1.571, 0.5), (arb(1), arb(1)), -1, "flight 1: 0 < beta_bar"),
    ],
)
def test_what_is_asked_of_a_step(beta: Any, v: Any, slows: float, line: Any) -> None:
    """beta_bar and v over it, and the sign of v'."""
    field: Any = SimpleNamespace(rates=lambda state: (None, None, BallArray([float(slows)] * 2)))
    step: Any = SimpleNamespace(enclosure=(BallArray(beta), None, BallArray.of(v)))
    if isinstance(line, list):
        assert flights_module._may_have_maximum(field, step).tolist() == line
    else:
        with pytest.raises(Unproved, match=line):
            flights_module._may_have_maximum(field, step)


def test_a_flight_in_which_beta_bar_has_no_largest_value_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """After one step no v has changed its sign; were it shown of one flight, the other one
    would be missed.
    """
    for shown in ([False, False], [True, False]):
        monkeypatch.setattr(
            flights_module, "_may_have_maximum", lambda field, step, shown=shown: np.array(shown)
        )
        with pytest.raises(
            Unproved,
            match=f"flight {1 + shown.count(True)}: beta_bar is not shown to have a largest",
        ):
            flights([ball(OMEGA_H)] * 2, [arb(0.01)] * 2, arb(0), [0.001] * 2, count=1, end=1)


def test_a_flight_that_falls_is_refused() -> None:
    """From z_u = -u gamma falls."""
    saddle = SaddleCoordinates(DISK, "linear", BallArray.of([ball(OMEGA_H)]), DIRECTIONS)
    with pytest.raises(Unproved, match="0 < beta_bar"):
        flown(
            saddle,
            [arb(-0.2), arb(0.2), arb(0.3)],
            BallArray([0.0]),
            arb(0),
            np.array([0.005]),
            201,
        )


def test_the_flights_cover_all_exits_and_speeds(monkeypatch: pytest.MonkeyPatch) -> None:
    cells: list[tuple[Any, Any]] = []

    def record_cells(
        saddle: Any, extents: Any, slow: Any, fast: Any, lengths: Any, count: int, watch: Any
    ) -> None:
        balls = (
            [arb(*map(float, entry)) for entry in zip(x.midpoints, x.radii, strict=True)]
            for x in (saddle.omega, slow)
        )
        cells.extend(zip(*balls, strict=True))

    monkeypatch.setattr(module, "enclose_arrivals", record_cells)
    n = SimpleNamespace(
        saddle=SaddleCoordinates(DISK, "linear", arb(30), DIRECTIONS),
        extents=[arb(x) for x in EVIDENCE_VALUES["extents"]],
    )
    loop_map = SimpleNamespace(passage=n, exit_z_s=(arb(-0.125), arb(0.375)), exit_z_f=arb(0))
    low, high = Fraction("30.0474"), Fraction("30.0569")
    module._flights(
        loop_map, low, high, {"steps": 9, "lengths": [[arb(1)] * 3, [arb(1)] * 2]}, print
    )
    assert len(cells) == 5
    for i, j in product(range(13), range(13)):
        speed, slow = ball(low + (high - low) * Fraction(i, 12)), arb(-0.125) + arb(j) / 24
        assert any(a.contains(speed) and b.contains(slow) for a, b in cells)
    for lengths in ([], [[]], [[arb(1)], []]):
        with pytest.raises(Unproved, match="no flights"):
            module._flights(loop_map, low, high, {"steps": 9, "lengths": lengths}, print)


# ----------------------------------------------------------------------------------- the connection
def require_branch_in_box(
    *pieces: tuple[float, float, float], room: Sequence[str] = ("0.0055", "0.02", "0.044")
) -> None:
    """Of pieces of a flight with these z about the second saddle."""
    saddle = SaddleCoordinates(DISK, "linear", ball(OMEGA_H), DIRECTIONS)
    n = SimpleNamespace(saddle=saddle, extents=[arb(x) for x in EVIDENCE_VALUES["extents"]])
    offsets = [saddle.offset([arb(x) for x in z]) for z in pieces]
    states = [(beta, y + arb.pi(), v) for beta, y, v in offsets]
    module._require_branch_in_box(
        n, SimpleNamespace(arrival_box=tuple(map(Fraction, room)), branch_boxes=states)
    )


def test_the_connection_stays_in_n() -> None:
    require_branch_in_box((0.5, -3, 0), (0.1, -0.25, 0.1), (0, -0.2, 0.1), (0, -0.1, 0))
    for pieces, line in (
        ([(0, -0.2, 0), (0, -0.1, 0)], "from outside"),
        ([(0, -3, 0), (0.21, -0.15, 0)], "stays in N"),
        ([(0, -3, 0), (0, -0.15, 0), (-0.21, -0.1, 0)], "stays in N"),
        ([(0, -3, 0), (0, -0.15, 0.31)], "stays in N"),
        ([(0, -3, 0), (0, -0.15, 0), (-0.1, 0.1, 0)], "gamma grows"),  # beta_bar < 0
    ):
        with pytest.raises(Unproved, match=line):
            require_branch_in_box(*pieces)
    with pytest.raises(Unproved, match="box lies in N"):
        require_branch_in_box((0, -3, 0), (0, -0.15, 0), room=("0.0055", "0.5", "0.044"))


@pytest.mark.parametrize(
    ("low", "high"), [("30.0485", "30.05"), ("30.04", "30.0495"), ("0", "30.05")]
)
def test_an_interval_that_is_empty_is_refused(low: str, high: str) -> None:
    connection = SimpleNamespace(friction="linear", low=Fraction("30.048"), high=Fraction("30.05"))
    with pytest.raises(Unproved, match="an interval is empty"):
        verify_cycles(connection, Fraction(low), Fraction(high), print)


def test_the_end_that_is_shown_knows_its_cycles() -> None:
    end = EnclosedCyclesNearOmegaH(
        Fraction("30.0479"), Fraction("30.0569"), OMEGA_H, Fraction("0.14"), Fraction("0.268")
    )
    omega = OMEGA_H + Fraction(1, 10**4)
    for speed, below, v, met in (
        (omega, 0.01, -0.02, True),
        (OMEGA_H, 0.01, -0.02, False),
        (end.high + 1, 0.01, -0.02, False),
        (omega, 0.15, -0.02, False),
        (omega, -0.01, -0.02, False),
        (omega, 0.01, -0.3, False),
        (omega, 0.01, 0.01, False),
    ):
        assert end.contains_cycle(ball(speed), arb.pi() - below, arb(v)) is met


# ----------------------------------------------------------------------------------- the return map
def loop_map_of(n: SaddlePassage) -> LoopMap:
    return LoopMap(n, ENTRY)


def changed(matrix: Any, row: int, k: int, x: float) -> Any:
    other = arb_mat(matrix)
    other[row, k] = arb(x)
    return other


FAULTS_BEFORE_FLIGHTS: list[tuple[str, str, Callable[[Any], Any]]] = [
    ("a passage takes time", "min_passage_time", lambda n: lambda distance: arb(0)),
    ("the fast part in N", "speed_wedge_extent", lambda n: n.forcing[1] + arb(1) / 1024),
    ("the fast part in N", "forcing", lambda n: [n.forcing[0], n.speed_wedge_extent]),
    ("the sign of z_s in Q", "saddle.inverse", lambda n: changed(n.saddle.inverse, S, 1, -1.0)),
    ("beta_bar where N is left", "saddle.offset", lambda n: lambda z: [arb(1)] * 3),
    ("gamma where N is left upwards", "saddle.offset", lambda n: lambda z: [arb(-1)] * 3),
    # k |z_f| is 0.0176 along y_gamma, k |z_s| is less.
    ("Q lies below the graph", "saddle.inverse", lambda n: changed(n.saddle.inverse, U, 1, 0.015)),
    (
        "the saddles' boxes are apart",
        "saddle.inverse",
        lambda n: changed(n.saddle.inverse, S, 1, 0.01),
    ),
]


@pytest.mark.parametrize(("line", "name", "other"), FAULTS_BEFORE_FLIGHTS)
def test_what_is_asked_before_the_flights(
    line: str, name: str, other: Callable[[Any], Any]
) -> None:
    """One of the passage's answers is another one."""
    n = made_up_passage()
    loop_map_of(n)
    owner = n.saddle if name.startswith("saddle.") else n
    setattr(owner, name.removeprefix("saddle."), other(n))
    with pytest.raises(Unproved, match=rf"^7a\.\d: {line}:"):
        loop_map_of(n)


@pytest.mark.parametrize("swapped", [False, True])
def test_the_exits_hold_those_from_d_and_from_q(swapped: bool) -> None:
    """Beyond the saddle z_s is what is left of D's or of Q's; before it, of what Q's v brings."""
    answers = [(0.125, 0.0078125), (0.0625, 0.015625)]
    rest = iter([*(answers[::-1] if swapped else answers), (0.03125, 0)])
    n = made_up_passage()
    vars(n).update(
        crossing_bound=lambda *_: arb(0), stable_bounds=lambda *_: [arb(x) for x in next(rest)]
    )
    loop_map = loop_map_of(n)
    assert loop_map.exit_z_s == (arb(-0.03125), arb(0.125))
    assert all(loop_map.exit_z_f.contains(x) for x in (-0.015625, 0.015625))
    assert all(loop_map.exit_box[S].contains(x) for x in (0.03125, -0.125))
    assert not loop_map.exit_box[S].contains(0.0625)


def before_flights() -> tuple[LoopMap, Any]:
    """With a linear field, and arrivals that fit; what is changed in the passage now does not
    change its answers.
    """
    n = made_up_passage()
    loop_map = loop_map_of(n)
    answers = {
        name: getattr(n, name)
        for name in ("compound_bounds", "compound_ratio_bound", "stable_bounds")
    }
    known = SimpleNamespace(
        **{**vars(n), **answers, "rates": lambda z: list((n.M * column(z)).entries())}
    )
    loop_map.passage = known
    return loop_map, known


def rates_of(n: Any, row: int, x: Any, leaving: bool = False) -> Callable[[Any], Any]:
    """The linear field, but for one number where orbits enter N (z_s = -s there), or where
    they leave it.
    """
    usual = n.rates

    def rates(z: Any) -> Any:
        found = usual(z)
        if bool(z[U] < -n.extents[U] * arb(0.99)) is leaving:
            found[row] = arb(x)
        return found

    return rates


def settled_of(n: Any, place: int, answer: Sequence[float]) -> Callable[[Any, Any], Any]:
    """As it is, but for products of which that one is exactly zero: those with a variation
    along an axis.
    """
    usual = n.compound_bounds
    return lambda b, time: [arb(x) for x in answer] if b[place] == 0 else usual(b, time)


def directed(n: Any, row: int, k: int, x: float) -> Any:
    """The saddle with another entry of P, where P itself is asked for."""
    return SimpleNamespace(
        **{
            **vars(n.saddle),
            "directions": changed(n.saddle.directions, row, k, x),
            "offset": n.saddle.offset,
        }
    )


def arrivals() -> list[list[Any]]:
    """About what flights arrive with: z_u, z_f, time and largest beta_bar, with derivatives
    by z_s, z_f and Omega.
    """
    return [
        [arb(-0.035, 0.04), arb(-0.5, 0.06), arb(0, 5e-4), arb(-3.8, 0.15)],
        [arb(0, 1.5e-3), arb(0, 0.09), arb(0, 1e-3), arb(0, 0.4)],
        [arb(1.005, 0.01), arb(0, 0.03), arb(0, 3e-4), arb(0, 0.08)],
        [arb(0.45, 0.02), arb(-0.01, 1e-3), arb(0, 2e-5), arb(-0.04, 6e-3)],
    ]


FAULTS_AFTER_FLIGHTS: list[
    tuple[str, dict[str, Callable[[Any], Any]], dict[tuple[int, int], Any]]
] = [
    ("orbits enter N and leave it", {"rates": lambda n: rates_of(n, S, -1)}, {}),
    ("orbits enter N and leave it", {"rates": lambda n: rates_of(n, U, 1, leaving=True)}, {}),
    # kappa is below one; 1 + L w is not.
    ("R contracts", {"lipschitz_slope": lambda n: arb(100)}, {}),
    # k_1 F_s is 0.8.
    ("the cone on entry", {"rates": lambda n: rates_of(n, F, 1)}, {(0, 1): arb(-0.1)}),
    # The graph rises by L times what z_f gains, 0.15 at least.
    (
        "heights grow downwards",
        {"lipschitz_slope": lambda n: arb(1)},
        {(0, 1): arb(-0.125), (1, 1): arb(0.15)},
    ),
    (
        "heights grow downwards",
        {"compound_ratio_bound": lambda n: lambda time: arb(1)},
        {(0, 2): arb(0.5)},
    ),
    # A variation of z_f comes back twice as large, in the answers to this question alone.
    ("1 - DR is regular", {"compound_bounds": lambda n: settled_of(n, 0, [0, 1e5])}, {}),
    # A variation of z_u alone leaves such a z_f that the fixed point's slope is out of the cone.
    (
        "the cone of the derivative",
        {"compound_bounds": lambda n: settled_of(n, 2, [0, 1600])},
        {(0, 2): arb(0)},
    ),
    (
        "the compound's cone of the derivative",
        {"compound_weights": lambda n: (n.compound_weights[0], arb(1e-9))},
        {},
    ),
    # k_1 F_s is 0.8 again: more than F_f, but less than with what z_u adds.
    (
        "the compound's cone of the derivative",
        {"rates": lambda n: rates_of(n, F, 0.79)},
        {(0, 1): arb(-0.1)},
    ),
    # A variation of z_u alone comes back larger.
    ("the cycle's entry falls", {"compound_bounds": lambda n: settled_of(n, 2, [4, 0])}, {}),
    ("gamma_bar_0 falls", {"saddle": lambda n: directed(n, 1, S, 6)}, {}),
    ("gamma_bar_0 falls", {"saddle": lambda n: directed(n, 1, S, -6)}, {}),
    ("gamma_bar_0 falls", {"saddle": lambda n: directed(n, 1, F, 1)}, {}),
    ("the period falls", {"growth_rates": lambda n: (arb(-1000), n.growth_rates[1])}, {}),
]


def test_the_made_up_return_map_is_shown() -> None:
    assert before_flights()[0].verify(arrivals()) < 1


#: Row and column of the arrivals, what is done to the number, and the inequality that rests on it.
SPOILED_ARRIVALS: list[tuple[int, int, Callable[[Any], Any], str]] = [
    (0, 0, lambda x: x - arb(0.005), "arrivals above the lid of D"),
    (0, 0, lambda x: x + arb(0.25), "arrivals in D"),
    (1, 0, lambda x: 2 * x, "arrivals in D"),
    (0, 1, lambda x: 3 * x, "R contracts"),
    (1, 1, lambda x: 9 * x, "R contracts"),
    (0, 1, lambda x: -x, "heights grow downwards"),
    (0, 1, lambda x: 0 * x, "heights grow downwards"),
    (0, 3, lambda x: -x, "the branch's arrivals fall"),
    (0, 3, lambda x: x / 8, "the branch's arrivals fall"),
    (1, 3, lambda x: 30 * x, "the branch's arrivals fall"),
    (1, 3, lambda x: 6 * x, "(the|the compound's) cone of the derivative"),
    (2, 3, lambda x: x + 50, "the period falls"),
    (2, 1, lambda x: 1000 * x, "the period falls"),
    (3, 3, lambda x: -x, "beta_max falls"),
    (3, 1, lambda x: -9 * x, "beta_max falls"),
    (3, 0, lambda x: x / 20, "beta_max is in the flight"),
]
FAULTS_AFTER_FLIGHTS += [
    (line, {}, {(row, column): spoil(arrivals()[row][column])})
    for row, column, spoil, line in SPOILED_ARRIVALS
]


@pytest.mark.parametrize(("line", "others", "moved"), FAULTS_AFTER_FLIGHTS)
def test_what_is_asked_after_the_flights(
    line: str,
    others: dict[str, Callable[[Any], Any]],
    moved: dict[tuple[int, int], Any],
) -> None:
    """One of the passage's answers or one number of the arrivals is another one."""
    loop_map, n = before_flights()
    for name, other in others.items():
        setattr(n, name, other(n))
    rows = arrivals()
    for (row, k), x in moved.items():
        rows[row][k] = x
    with pytest.raises(Unproved, match=rf"^7a\.\d: {line}:"):
        loop_map.verify(rows)


@pytest.mark.parametrize(
    ("name", "x", "line"),
    [
        *(
            (name, x, "the extents of D")
            for name in ("lid", "fast", "weight")
            for x in (arb(0), arb(-1))
        ),
        ("lid", arb(0.001), "D and the graph"),
        ("lid", arb(0.2), "D and the graph"),
        ("lid", arb(0.12), "crossings lie in Q"),
        ("fast", arb(1) / 30, "D and the graph"),
        ("moment", arb(0.03), "crossings lie in Q"),
        ("moment", arb(0.08), "crossings lie in Q"),
        ("moment", arb(0), "the moment"),
        ("gamma", "0.1", "crossings lie in Q"),
        ("v", "0.2", "crossings lie in Q"),
        ("gamma", "0.3", "Q lies in N"),
        ("v", "1", "Q lies in N"),
        ("gamma", "0", "the extents of D"),
        ("v", "-0.28", "the extents of D"),
    ],
)
def test_what_is_asked_of_d_and_q(name: str, x: Any, line: str) -> None:
    """Every number of D and Q, changed so that its inequality breaks."""
    n = made_up_passage()
    loop_map_of(n)
    with pytest.raises(Unproved, match=rf"^7a\.\d: {line}"):
        LoopMap(n, ENTRY | {name: x})
