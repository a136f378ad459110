"""The certificate of the limit cycles next to the connection: what `checker.connection` needs to prove them again.

Everything in it is a choice, and the checker encloses all of it anew. Extents and most weights are the proof's; the
others follow from what the checker encloses itself. The steps of a flight are equally long, so that it arrives in the
middle of the last one. The claim's set Q may be larger than the proof's by some thousandths. What is written has been
checked.

Where a ball becomes a point or a float: everywhere, and any choice that passes the checker is right.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from itertools import product
from typing import Any

from flint import arb_mat

from tippedisk_verify.errors import Shortfall
from tippedisk_verify.model.decimals import exact_text
from tippedisk_verify.model.parameters import SYMBOLS
from tippedisk_verify.proofs import checker
from tippedisk_verify.proofs.checker.connection import END, FLIGHT, ReturnMap, flown, seen
from tippedisk_verify.proofs.checker.passage import Passage, Saddle, most
from tippedisk_verify.proofs.kernel.balls import (
    arb,
    ball,
    ball_constants,
    hull,
    series_length,
    working_bits,
    working_precision,
)
from tippedisk_verify.proofs.kernel.flow import Model
from tippedisk_verify.proofs.kernel.reading import dyadic_text as dyadic
from tippedisk_verify.proofs.kernel.reading import parsed
from tippedisk_verify.proofs.numbers import measured
from tippedisk_verify.proofs.search.certificate import checked_text
from tippedisk_verify.proofs.search.connection_flight import fly_over
from tippedisk_verify.proofs.search.local_manifolds import Frame
from tippedisk_verify.proofs.search.passage import EXTENTS, RETURN, STEEP, THIN
from tippedisk_verify.proofs.search.proved_end import ProvedEnd

__all__ = ["end_bits", "end_certificate", "end_entry"]

_CELLS = (64, 8)
_STEP = 0.005  # s; a box's enclosure over a longer one is too wide where the fast direction contracts
_ORDERS = (8, 8)
_COMPOUND = ("5/8", "1")  # wider than the proof's: the checker's bounds of the cycle's derivatives are
_SPEED_CELL, _SLOW_CELL = 2e-3, 4e-3  # lengths of the cells in Omega [rad/s] and z_s
_WIDER = arb(33) / 32  # than an inequality needs
_LEAST_BITS, _MORE_BITS = 96, 72  # at least, and than Omega_h is known to
_TIMING_BITS = 53
_LONGEST = 2**13  # steps of a branch's flight
_ROUNDS = 40


def end_bits(end: ProvedEnd) -> int:
    """The precision in which the checker can tell the two ends of Omega_h's interval apart."""
    assert end.connection.omega_h is not None
    return max(_LEAST_BITS, _MORE_BITS - math.floor(math.log2(end.connection.omega_h.uncertainty)))


def end_certificate(end: ProvedEnd) -> str:
    """A certificate of cycles that are proved. Raises Shortfall if none can be written."""
    bits = end_bits(end)
    with working_precision(bits), series_length(10):
        try:
            entry = end_entry(end)
            claim = {name: entry.pop(name) for name in ("low", "high", "gamma", "v")}
            claim |= {"kind": "cycles next to the connection", "parameters": _disk(end)}
            return checked_text(claim | {"numbers": {"omega_h": entry.pop("omega_h")}}, bits, entry)
        except (checker.Unproved, checker.Refused) as fault:
            raise Shortfall(f"no certificate that the checker accepts could be made: {fault}") from None


def end_entry(end: ProvedEnd) -> dict[str, Any]:
    """An entry of the shape `checker.connection.END`, for the working precision.

    Raises checker.Unproved where a choice fails.
    """
    return _Writer(end).written()


def _disk(end: ProvedEnd) -> dict[str, str]:
    return {name: exact_text(getattr(end.connection.parameters, name)) for name in SYMBOLS}


class _Writer:
    """Choices for one proof, at the working precision."""

    def __init__(self, end: ProvedEnd) -> None:
        parameters, omega_h = end.connection.parameters, end.connection.omega_h
        assert parameters is not None
        assert omega_h is not None
        self.end, self.disk, self.constants = end, _disk(end), ball_constants(parameters)
        self.frame = Frame(parameters, omega_h.value)
        self.entry: dict[str, Any] = {
            "low": exact_text(end.low),
            "high": exact_text(end.high),
            "omega_h": omega_h.to_dict(),
            "directions": [[dyadic(part) for part in row] for row in self.frame.directions.tolist()],
            "extents": [exact_text(extent) for extent in EXTENTS],
            "cells": list(_CELLS),
            "steep": [exact_text(part) for part in STEEP],
            "compound": list(_COMPOUND),
            "flat": "0.015",
            "lipschitz": "0.04",
            "thin": exact_text(THIN),
            "return": str(RETURN),
            "drift": ["1", "1", "1"],
            "fast": "1/512",
            "weight": "1/4",
            "orders": list(_ORDERS),
        }

    def written(self) -> dict[str, Any]:
        speeds = checker.Flow(self.disk, hull(self.end.low, self.end.high))
        self._tighten(Passage(speeds, self._read()))
        self.passage = Passage(speeds, self._read())
        self._return_map(Fraction(self.end.numbers["eta"]))
        low, high = (measured(part).value for part in self.map.exits)
        counts = [
            math.ceil(float(span) / cell)
            for span, cell in ((self.end.high - self.end.low, _SPEED_CELL), (high - low, _SLOW_CELL))
        ]
        self.entry["flights"] = [
            [
                _steps(self.times((Fraction(2 * i + 1, 2 * counts[0]), Fraction(2 * j + 1, 2 * counts[1]))))
                for j in range(counts[1])
            ]
            for i in range(counts[0])
        ]
        self.entry["branch"] = self._branch()
        return self.entry

    def _read(self) -> dict[str, Any]:
        shape = {name: part for name, part in END.items() if name in self.entry}
        return dict(parsed(self.entry, shape, "the entry"))

    def _tighten(self, loose: Passage) -> None:
        """The smallest weights and bounds that what was enclosed allows, or nearly so."""
        for name, a in (("flat", loose.M), ("lipschitz", loose.A)):
            self.entry[name] = _text(most((abs(a[0, 1]) + abs(a[0, 2])) / a[0, 0]) * _WIDER)
        c = loose.C
        grows = [[c[i, j].upper() if i == j else most(c[i, j]) for j in range(3)] for i in range(3)]
        solved = arb_mat(grows).solve(arb_mat([[-part * _WIDER] for part in loose.stirred]))
        self.entry["drift"] = [_text(most(part)) for part in solved.entries()]

    def _return_map(self, lid: Fraction) -> None:
        """D, Q and the exits: with the least lid that lets the flight of the largest speed and z_s arrive above it."""
        speeds = hull(self.end.high - Fraction(_SPEED_CELL), self.end.high)
        saddle = Saddle(checker.Flow(self.disk, speeds), self._read()["directions"])
        for attempt in range(_ROUNDS):
            self.entry["lid"] = exact_text(round(lid, 6))
            self._crossing()
            self.map = ReturnMap(self.passage, self.disk, self._read())
            if not attempt:
                self.times = self._times()  # a little beyond what they are interpolated from, they are as good
            given, slow = _steps(self.times((Fraction(1), Fraction(1)))), self.map.exits[1]
            arrival = self.map.flight(saddle, slow.union(slow - _SLOW_CELL), parsed(given, FLIGHT, "a flight"))
            if arrival[0][0] + ball(lid) * 399 / 400 > 0:
                return
            lid *= Fraction(101, 100)

    def _crossing(self) -> None:
        """The moment that bounds the crossings of beta_bar = 0 best, and c and d."""
        given = self._read()

        def bound(moment: float) -> Any:
            return self.passage.crossing(given["lid"], given["fast"], arb(moment))

        low, high = 0.0, 1.0
        for _ in range(_ROUNDS):  # the bound falls, and then grows
            first, second = low + (high - low) / 3, high - (high - low) / 3
            low, high = (low, second) if bound(first) < bound(second) else (first, high)
        moment = Fraction(round(low * 10**4), 10**4)
        self.entry["moment"] = exact_text(moment)
        crossing = bound(float(moment))
        for row, name in ((1, "gamma"), (2, "v")):
            self.entry[name] = _above(crossing * self.passage.at_crossing(row))

    def _times(self) -> Callable[[tuple[Fraction, Fraction]], float]:
        """The time of flight by the shares of the way through the speeds and through z_s: quadratic in both."""
        least, largest = (measured(part).value for part in self.map.exits)
        low, high = self.end.low, self.end.high
        nodes = (Fraction(0), Fraction(1, 2), Fraction(1))
        extents = [ball(extent) for extent in EXTENTS[:2]]
        known = {}
        for x, y in product(nodes, nodes):
            with working_precision(_TIMING_BITS):
                model = Model(self.constants, ball(low + (high - low) * x))
                flown_over = fly_over(self.frame, model, extents, ball(least + (largest - least) * y), arb(0))
            if flown_over is None:
                raise checker.Unproved("a flight between the saddles could not be followed")
            known[x, y] = float(flown_over[0].time.mid())

        def weight(node: Fraction, x: Fraction) -> Fraction:
            return math.prod(((x - other) / (node - other) for other in nodes if other != node), start=Fraction(1))

        return lambda at: sum(float(weight(x, at[0]) * weight(y, at[1])) * time for (x, y), time in known.items())

    def _branch(self) -> dict[str, Any]:
        """The cone at the first saddle, and how many steps it takes each of the two branches to show its side."""
        bits, given = working_bits(), self._read()
        reach, length, orders = arb(2) ** -math.ceil(bits / 6), arb(2) ** -7, [10 + bits // 7] * 2
        omega_h, half = (Fraction(self.entry["omega_h"][name]) for name in ("value", "uncertainty"))
        both = Saddle(checker.Flow(self.disk, hull(omega_h - half, omega_h + half)), given["directions"])
        _, slopes, _ = both.field([arb(0, reach), arb(0, reach**2), arb(0, reach**2)])
        cone = [(4 * most(slopes[k, 0]) / most(slopes[k, k])).upper() for k in (1, 2)]
        box = [reach, *(arb(0, (part * reach).upper()) for part in cone)]
        counts = []
        for speed, sign in ((omega_h - half, 1), (omega_h + half, -1)):
            saddle = Saddle(checker.Flow(self.disk, ball(speed)), given["directions"])
            for number, (piece, z, _) in enumerate(flown(saddle, box, length, orders, _LONGEST), 1):
                if all(extent > abs(x) for extent, x in zip(given["extents"], z, strict=True)):
                    u, s, f = seen(saddle, piece, length)
                    if sign * u > 2 * given["flat"] * abs(s).max(abs(f)):
                        counts.append(number)
                        break
            else:
                raise checker.Unproved("the branch does not show on which side it passes")
        return {
            "reach": dyadic(reach), "cone": [dyadic(part) for part in cone], "length": dyadic(length),
            "orders": orders, "steps": counts,
        }  # fmt: skip


def _steps(time: float) -> dict[str, Any]:
    """Equal steps that end half a step after the time."""
    count = round(time / _STEP + 0.5)
    return {"steps": count, "length": dyadic(arb(round(time / (count - 0.5) * 2**24)) / 2**24)}


def _text(point: Any) -> str:
    """A few digits, rounded up."""
    return exact_text(Fraction(math.ceil(measured(point).value * 10**5), 10**5))


def _above(x: Any) -> str:
    """A multiple of 1/1000 that no number of the ball is above."""
    found = measured(x)
    return exact_text(Fraction(math.ceil((found.value + found.uncertainty) * 1000), 1000))
