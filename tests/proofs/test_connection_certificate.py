"""Certificates of the cycles next to the connection: the checker's passage, flights and branch, and what it refuses."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from flint import arb
from tippedisk_verify.proofs.checker.connection import ReturnMap, flown
from tippedisk_verify.proofs.checker.passage import Passage, Saddle, products
from tippedisk_verify.proofs.search.local_manifolds import Frame
from tippedisk_verify.proofs.search.passage import EXTENTS

from tests.proofs.end_entries import BITS, Change, by_hand, disk, put, read, remember, speeds
from tests.proofs.saddle_orbits import OMEGA_H, Orbits
from tests.proofs.test_connection_end import END, _arrival
from tippedisk_verify.cli import main
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.proofs import checker
from tippedisk_verify.proofs.checker import connection as module
from tippedisk_verify.proofs.kernel.balls import ball, series_length, working_precision

BRANCH = module._branch


@pytest.fixture(autouse=True)
def _context(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    remember(monkeypatch)
    with working_precision(BITS), series_length(10):
        yield


# ---------------------------------------------------------------------------------------------------- what is enclosed
def test_the_passage_holds_orbits_of_the_other_code() -> None:
    """A, M, C and B against the proofs' own field, at random points of all of N; F(z) = M z."""
    entry = by_hand()
    n, frame = Passage(speeds(entry), read(entry)), Frame(PRINTED, OMEGA_H)
    draw = np.random.default_rng(7)
    for _ in range(20):
        shares = [Fraction(round(x * 999), 1000) for x in draw.uniform(-1, 1, 3)]
        z = [ball(share * extent) for share, extent in zip(shares, EXTENTS, strict=True)]
        omega = ball(END.low + (END.high - END.low) * Fraction(round(draw.uniform() * 99), 100))
        slopes, rates = frame.derivative(omega, z), frame.rates(omega, z)
        by_speed = frame.derivative_by_speed(omega, z)
        for row in range(3):
            assert abs(by_speed[row]) < n.B[row] * (1 + arb(2) ** -40)
            assert sum((n.M[row, k] * z[k] for k in range(3)), arb(0)).overlaps(rates[row])
            assert all(n.A[row, k].overlaps(slopes[row, k]) for k in range(3))
        if abs(z[2]) < n.stirred_within:
            assert all(abs(x) < y for x, y in zip(products(rates, by_speed), n.stirred, strict=True))
        # The compound on b = F x d: its law for the matrix DF at this point.
        x, d = [ball(k) for k in (2, -1, 3)], [ball(k) for k in (1, 4, -2)]
        moved = [[sum((slopes[i, k] * y[k] for k in range(3)), arb(0)) for i in range(3)] for y in (x, d)]
        law = [p + q for p, q in zip(products(moved[0], d), products(x, moved[1]), strict=True)]
        for row in range(3):
            assert sum((n.C[row, k] * y for k, y in enumerate(products(x, d))), arb(0)).overlaps(law[row])


def test_passages_obey_the_checkers_bounds() -> None:
    """Orbits of the Runge-Kutta method from z_s = -s below the graph, to z_u = -u."""
    entry = by_hand()
    n = Passage(speeds(entry), read(entry))
    for below in (1e-4, 1e-2, 5e-2):
        start = (-below - float(n.flat) * 0.2, -0.2, 1e-3)
        orbits = Orbits(PRINTED, Frame(PRINTED, OMEGA_H), float(OMEGA_H) + 2e-3)
        time, z, d = orbits.fly(start, (-1.0, 0.0, 0.1), lambda z: z[0] < -0.2)
        least = n.time(ball(Fraction(below)) + 2 * n.flat * n.extents[1])
        assert float(least) < time
        bounds = n.fallen(arb("0.2"), arb("0.001"), least)
        assert all(abs(x) < float(bound) for x, bound in zip(z[1:], bounds, strict=True))
        b = products(list(orbits.F(np.array(start))), [-1.0, 0.0, 0.1])
        assert all(
            abs(x) < float(y)
            for x, y in zip(products(list(orbits.F(z)), list(d))[:2], n.settled(list(map(arb, b)), least), strict=True)
        )


@pytest.mark.slow
def test_a_flight_arrives_where_it_should() -> None:
    """Against the Runge-Kutta method, whose interpolation errs by 2e-6; derivatives by differences, to 4e-3 of them."""
    entry = by_hand()
    given = read(entry)
    returned = ReturnMap(Passage(speeds(entry), given), disk(PRINTED), given)
    returned.exit_fast = arb(0)
    omega, slow = OMEGA_H + Fraction(1, 250), Fraction(1, 100)
    time, _ = _arrival(float(omega), float(slow), 0.0)
    saddle = Saddle(checker.Flow(disk(PRINTED), ball(omega)), given["directions"])
    landed = returned.flight(saddle, ball(slow), {"steps": 201, "length": arb(time / 200.5)})

    def single(omega: float, slow: float, fast: float) -> list[float]:
        time, z = _arrival(omega, slow, fast)
        return [z[0], z[2], time]

    for row, value in zip(landed, single(float(omega), float(slow), 0.0), strict=False):
        assert abs(float(row[0].mid()) - value) < 4e-6 + float(row[0].rad())
        assert float(row[0].rad()) < 1e-5
    for column, (by_slow, by_fast, by_omega) in enumerate(np.eye(3), 1):
        ends = [single(float(omega) + h * by_omega, float(slow) + h * by_slow, h * by_fast) for h in (-5e-4, 5e-4)]
        for row, before, after in zip(landed, *ends, strict=False):
            assert abs(float(row[column].mid()) - (after - before) / 1e-3) < 8e-3 + float(row[column].rad())
    # A last step before the arrival, or after it, and one that is backwards.
    for steps, length in ((199, time / 200.5), (204, time / 200.5), (201, -time / 200.5)):
        with pytest.raises(checker.Unproved):
            returned.flight(saddle, ball(slow), {"steps": steps, "length": arb(length)})


def test_the_branch_passes_on_the_side_that_is_claimed(monkeypatch: pytest.MonkeyPatch) -> None:
    """At Omega_h - 0.001 and Omega_h + 0.001; the other side, too short a flight and a wrong cone are refused."""
    given = read(by_hand())
    n = Passage(speeds(by_hand()), given)
    for sign in (1, -1):
        omega = Fraction(given["omega_h"]["value"]) - sign * Fraction(given["omega_h"]["uncertainty"])
        saddle = Saddle(checker.Flow(disk(PRINTED), ball(omega)), given["directions"])
        known: list[Any] = []

        def noted(*arguments: Any, known: list[Any] = known) -> Iterator[Any]:
            for step in flown(*arguments):
                known.append(step)
                yield step

        monkeypatch.setattr(module, "flown", noted)
        BRANCH(n, saddle, sign, 230, given["branch"])
        monkeypatch.setattr(module, "flown", lambda *arguments, known=known: iter(known[: arguments[-1]]))
        for side, count, line in ((-sign, 230, "the side claimed"), (sign, 100, "does not come to N")):
            with pytest.raises(checker.Unproved, match=line):
                BRANCH(n, saddle, side, count, given["branch"])
        for change in ({"reach": arb(1)}, {"reach": arb(0)}, {"cone": [arb("1e-5")] * 2}, {"cone": [arb(-1), arb(1)]}):
            with pytest.raises(checker.Unproved, match="the branch's cone"):
                BRANCH(n, saddle, sign, 230, given["branch"] | change)


# ---------------------------------------------------------------------------------------------------------- tampered
def turned(row: list[str], place: int) -> list[str]:
    """With one of the dyadic numbers negative if it was positive, and the other way round."""
    other = [f"-{text}".replace("--", "") for text in row]
    return [*row[:place], other[place], *row[place + 1 :]]


def early() -> Iterator[tuple[str, Change]]:
    """Changes that are found before any flight, with the inequality that they break."""
    yield "no disk's", put("parameters", "e", "0.05")
    yield "is empty", put("low", "30.0569")
    yield "is empty", put("high", "30.0488")
    yield "is empty", put("gamma", "-0.145")
    yield "is empty", put("omega_h", "uncertainty", "0")
    yield "is empty", put("omega_h", "value", "30.06")
    yield "no inverse", lambda e: e.update(directions=[["1p0"] * 3] * 3)
    for place in range(3):
        yield "the extents and the weights", put("extents", place, "0")
        yield "the extents and the weights", put("extents", place, "-0.2")
    yield "too many cells", put("cells", [1000, 1000])
    for place, value in ((0, "1e-9"), (1, "1e-9"), (2, "1e-9"), (1, "1e9")):
        yield "the cones of the steep weights", put("steep", place, value)
    for name in ("flat", "lipschitz"):
        yield "the cones of the flat weights", put(name, "1/1000")
        yield "the cones of the flat weights", put(name, "1e6")
    yield "the second compound", put("compound", 0, "1/1000")
    yield "the second compound", put("compound", 0, "30")
    yield "the second compound", put("compound", 1, "1e-4")
    yield "the second compound falls", put("compound", 1, "1e4")
    for place in range(3):
        yield "the variation by the speed", put("drift", place, "1e-6")
        yield "the variation by the speed", put("drift", place, "1e6")
    yield "the thin set", put("thin", "1/1000")
    yield "the thin set", put("thin", "200")
    yield "after a crossing", put("return", "1e-3")
    yield "after a crossing", put("return", "1000")
    for name in ("steep", "compound", "drift"):
        yield "the extents and the weights", put(name, 0, "-1")
    for name in ("flat", "lipschitz", "thin"):
        yield "the extents and the weights", put(name, "0")


def other_cells() -> Iterator[tuple[str, Change]]:
    """Changes after which N has to be enclosed anew. A fast direction of the other sign would be as good."""
    for column in (0, 1):
        yield "is not shown", lambda e, k=column: e.update(directions=[turned(row, k) for row in e["directions"]])
    yield "is not shown", lambda e: e.update(directions=[row[::-1] for row in e["directions"]])
    for place, line in enumerate(("D and the graph", "the faces", "the faces")):
        yield "is not shown", put("extents", place, "3")
        yield line, put("extents", place, "1/1000")
    yield "is not shown", put("cells", [1, 1])


def later() -> Iterator[tuple[str, Change]]:
    """Changes of D and Q, found before the flights."""
    for name in ("lid", "fast", "weight"):
        yield "the extents of D", put(name, "0")
        yield "the extents of D", put(name, "-1")
    yield "D and the graph", put("lid", "1/1000")
    yield "D and the graph", put("lid", "0.2")
    yield "crossings lie in Q", put("lid", "0.12")
    yield "D and the graph", put("fast", "1/30")
    yield "crossings lie in Q", put("moment", "0.03")
    yield "crossings lie in Q", put("moment", "0.08")
    yield "the moment", put("moment", "0")
    yield "crossings lie in Q", put("gamma", "0.13")
    yield "crossings lie in Q", put("v", "0.2")
    yield "Q lies in N", put("gamma", "0.3")
    yield "Q lies in N", put("v", "1")


def refused(line: str, act: Change) -> None:
    entry = {**by_hand(), "parameters": disk(PRINTED)}
    act(entry)
    assert entry != {**by_hand(), "parameters": disk(PRINTED)}
    with pytest.raises(checker.Unproved, match=line) as fault:
        module.end_shown(entry.pop("parameters"), read(entry))
    assert "flight" not in str(fault.value), line
    assert str(fault.value).isprintable()


def test_what_is_found_before_the_flights(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every number of the passage, D and Q, changed so that its inequality breaks."""
    monkeypatch.setattr(module, "_branch", lambda *_: None)  # has a test of its own
    ReturnMap(Passage(speeds(by_hand()), read(by_hand())), disk(PRINTED), read(by_hand()))
    for line, act in (*early(), *later()):
        refused(line, act)


def arrivals() -> list[list[Any]]:
    """About what flights arrive with: z_u, z_f, time and largest beta_bar, with derivatives by z_s, z_f and Omega."""
    return [
        [arb(-0.035, 0.04), arb(-0.5, 0.06), arb(0, 5e-4), arb(-3.8, 0.15)],
        [arb(0, 1.5e-3), arb(0, 0.09), arb(0, 1e-3), arb(0, 0.4)],
        [arb(1.005, 0.01), arb(0, 0.03), arb(0, 3e-4), arb(0, 0.08)],
        [arb(0.45, 0.02), arb(-0.01, 1e-3), arb(0, 2e-5), arb(-0.04, 6e-3)],
    ]


@pytest.mark.parametrize(
    ("row", "column", "spoil", "line"),
    [
        (0, 0, lambda x: x - arb(0.005), "arrivals in D"),
        (0, 0, lambda x: x + arb(0.25), "arrivals in D"),
        (1, 0, lambda x: 2 * x, "arrivals in D"),
        (0, 1, lambda x: 3 * x, "R contracts"),
        (1, 1, lambda x: 9 * x, "R contracts"),
        (0, 1, lambda x: -x, "heights grow downwards"),
        (0, 1, lambda x: 0 * x, "heights grow downwards"),
        (0, 3, lambda x: -x, "the branch's arrivals fall"),
        (0, 3, lambda x: x / 8, "the branch's arrivals fall"),
        (1, 3, lambda x: 30 * x, "the branch's arrivals fall"),
        (1, 3, lambda x: 6 * x, "cone of the derivative"),
        (2, 3, lambda x: x + 50, "the period falls"),
        (2, 1, lambda x: 1000 * x, "the period falls"),
        (3, 3, lambda x: -x, "beta_max falls"),
        (3, 1, lambda x: -9 * x, "beta_max falls"),
        (3, 0, lambda x: x / 20, "beta_max is in the flight"),
    ],
)  # fmt: skip
def test_what_is_found_after_the_flights(
    monkeypatch: pytest.MonkeyPatch, row: int, column: int, spoil: Callable[[Any], Any], line: str
) -> None:
    """A number of the arrivals, doubled or with its sign turned, breaks the inequality that rests on it."""
    entry = read(by_hand())
    returned = ReturnMap(Passage(speeds(by_hand()), entry), disk(PRINTED), entry)
    monkeypatch.setattr(ReturnMap, "_arrivals", lambda self: arrivals())
    returned.shown()
    spoiled = arrivals()
    spoiled[row][column] = spoil(spoiled[row][column])
    monkeypatch.setattr(ReturnMap, "_arrivals", lambda self: spoiled)
    with pytest.raises(checker.Unproved, match=line):
        returned.shown()


@pytest.mark.slow
def test_other_cells_are_not_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    """15 CPU seconds."""
    monkeypatch.setattr(module, "_branch", lambda *_: None)
    for line, act in other_cells():
        refused(line, act)


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (put("directions", [["1p0"] * 3] * 2), "directions: a list of 3"),
        (put("directions", 0, 0, 1.0), "directions 1 1: a dyadic number"),
        (put("extents", 0, 0.2), "extents 1: an exact decimal"),
        (put("extents", ["0.2", "0.2"]), "extents: a list of 3"),
        (put("lid", "nan"), "lid: an exact decimal"),
        (put("lid", "1/0"), "lid: an exact decimal"),
        (put("cells", 0, 0), "cells 1: a whole number"),
        (put("cells", 0, 1001), "cells 1: an order"),
        (put("orders", 1, True), "orders 2: a whole number"),
        (put("flights", [{"steps": 1}]), "flights 1: a list"),
        (put("flights", 0, 0, {"steps": 1}), "flights 1 1: an object"),
        (put("flights", 0, 0, "steps", 0), "flights 1 1 steps: a whole number"),
        (put("branch", "steps", [1, 2, 3]), "branch steps: a list of 2"),
        (put("branch", "reach", "1"), "branch reach: a dyadic number"),
        (put("branch", None), "branch: an object"),
        (lambda e: e.pop("moment"), "exactly the members"),
        (lambda e: e.update(note="1"), "exactly the members"),
    ],
)
def test_what_is_no_entry_is_refused(tmp_path, capsys, change: Change, line: str) -> None:
    evidence = by_hand()
    claim = {name: evidence.pop(name) for name in ("low", "high", "gamma", "v")}
    claim |= {"kind": "cycles next to the connection", "parameters": disk(PRINTED)}
    claim |= {"numbers": {"omega_h": evidence.pop("omega_h")}}
    change(evidence)
    content = {"format": checker.FORMAT, "claim": claim, "bits": BITS, "evidence": evidence}
    path = tmp_path / "end.json"
    path.write_text(json.dumps({**content, "sha256": checker.digest(content)}))
    assert main(["certify", "check", str(path)]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert len(captured.err.splitlines()) == 1
    assert line in captured.err or "a number is written as" in captured.err


def test_the_end_that_was_shown_knows_its_cycles() -> None:
    """As the proof does: the same cycles are in Q, at speeds proved to be above Omega_h."""
    end = module.End(END.low, END.high, OMEGA_H + Fraction(1, 10**10), END.gamma, END.v)
    for omega, gamma_bar, v in (
        (OMEGA_H + Fraction(1, 10**4), math.pi - 0.01, -0.02),
        (OMEGA_H, math.pi - 0.01, -0.02),
        (END.high + 1, math.pi - 0.01, -0.02),
        (OMEGA_H + Fraction(1, 10**4), math.pi - 0.15, -0.02),
        (OMEGA_H + Fraction(1, 10**4), math.pi + 0.01, -0.02),
        (OMEGA_H + Fraction(1, 10**4), math.pi - 0.01, -0.3),
        (OMEGA_H + Fraction(1, 10**4), math.pi - 0.01, 0.01),
    ):
        balls = ball(omega), arb(gamma_bar), arb(v)
        assert end.meets(*balls) == END.meets(*balls)


def test_the_command_asks_for_the_cycles(tmp_path, capsys) -> None:
    target = tmp_path / "end.json"
    assert main(["certify", "heteroclinic", "--certificate", str(target)]) == 2
    assert "give --cycles" in capsys.readouterr().err
    assert main(["certify", "heteroclinic", "--cycles", "0.008", "--certificate", str(tmp_path / "no" / "c.json")]) == 2
    assert "cannot be written" in capsys.readouterr().err
    assert not target.exists()
