"""Limit cycles and their folds: what a certificate claims, and whether its evidence shows it."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from flint import arb, arb_mat

from tippedisk_verify.proofs.checker.connection import CHOICES, end_shown
from tippedisk_verify.proofs.checker.family import CLAIM, EVIDENCE, Mapped, family_shown
from tippedisk_verify.proofs.checker.reading import (
    BOX,
    MEASURED,
    POINT,
    Refused,
    count,
    decimal,
    digest,
    one_of,
    parsed,
)
from tippedisk_verify.proofs.checker.steps import (
    UNITS,
    Flow,
    Piece,
    States,
    Unproved,
    after,
    column,
    context,
    exact_ball,
    inside,
    need,
    positive,
)

__all__ = ["FORMAT", "proved"]

FORMAT = "tippedisk certificate 1"
_STILL = [arb(0)] * 3
_UPRIGHT = arb(0, 1.5706999)  # rad: |beta_bar| lies in it; rounded up, its radius is still below 1.5707 and pi/2


class Lap:
    """A flight from section to section of all orbits from a box: when, where and with which derivatives it ends.

    The box is about a point ``at`` = (gamma_bar, v, speed) on beta_bar = 0, or with ``turning`` (beta_bar, v, speed) on
    gamma_bar = 0, with the balls ``away`` about zero.
    """

    def __init__(
        self, disk: dict[str, str], turning: bool, at: Sequence[Any], away: Sequence[Any], steps: Any, path: str
    ) -> None:
        self.at, self.axis, self.turned, self.flow = at, 0 if turning else 1, turning, Flow(disk, at[2] + away[2])
        need(bool(self.flow.w.mid() == at[2]), f"{path}: the middle speed has more bits than the precision")
        middle, deviation = [at[1]] * 3, [away[1]] * 3
        for vector, given in ((middle, at), (deviation, away)):
            vector[self.axis], vector[1 - self.axis] = given[0], arb(0)
        self.time, self.divergence, self.least, self.least_by = arb(0), arb(0), arb(0), [arb(0)] * 3
        states = States.start(middle, [*deviation, away[2]])
        for number, step in enumerate(steps, 1):
            try:
                moment, last, beta = step["length"], number == len(steps), step["enclosure"][0]
                piece = Piece(self.flow, states, moment, step["orders"], step["enclosure"])
                need(inside(beta, _UPRIGHT) and (not turning or positive(beta)), "beta is not shown to stay upright")
                need((("states" in step) is not last) and (("crossing" in step) is last), "it ends where it must not")
                self._signs(piece, step)
                if last:
                    moment = piece.passes(step["crossing"], 1 - self.axis, 2 * arb.pi() if turning else arb(0))
                else:
                    states = after(piece, step)
                self.time, self.divergence = self.time + moment, self.divergence + piece.divergence(moment)
            except Unproved as fault:
                raise Unproved(f"{path}, step {number}: {fault}") from None
        need(bool(steps) and self.turned, f"{path}: the section is not reached after a turn")
        self.end, self.by = piece.image(moment), piece.derivatives(moment)

    def _signs(self, piece: Piece, step: dict[str, Any]) -> None:
        """beta_bar falls, turns once, or rises, by the signs of v and v' over the step."""
        if not self.axis:  # gamma grows as long as beta_bar > 0
            need("turn" not in step, "beta has no turn on the way")
            return
        v, first, (beta_end, _, last) = piece.enclosure[2], piece.states.box()[2], piece.image(piece.length)
        gains = positive(self.flow.rates(piece.enclosure[:3])[0][2])
        if "turn" in step:
            need(not self.turned and gains and positive(-first, last, -beta_end), "v is not shown to turn once")
            moment, self.turned = piece.passes(step["turn"], 2, arb(0)), True
            # There beta' = 0: moving the moment does not change beta to first order.
            self.least, by = piece.image(moment)[0], piece.derivatives(moment)
            self.least_by = [by[0, column] for column in (1, 2, 3)]
            need("crossing" not in step, "beta turns and crosses the section in one step")
        elif self.turned:
            need(positive(v) or (gains and positive(first)), "beta is not shown to rise")
        else:
            need(positive(-v) or (gains and positive(-last)), "beta is not shown to fall")

    def section(self) -> tuple[list[Any], list[list[Any]], list[Any]]:
        """The section's map: its value, its derivatives and those of the time, by (gamma_bar or beta_bar, v, speed).

        After a half turn S, (beta_bar, gamma_bar, v) -> (-beta_bar, -gamma_bar, -v), leads back to the section.
        """
        end, axis = list(self.end), self.axis
        end[1 - axis] = arb(0)  # that is where the section lies; sine and cosine of 2 pi are those of 0
        rates, _ = self.flow.rates(end)
        columns, sign = (axis, 2, 3), -1 if axis else 1
        times = [-self.by[1 - axis, column] / rates[1 - axis] for column in columns]
        rows = [
            [sign * (self.by[row, column] + rates[row] * time) for column, time in zip(columns, times, strict=True)]
            for row in (axis, 2)
        ]
        return [sign * end[axis], sign * end[2]], rows, times


class Fixed:
    """Krawczyk's test for a fixed point of the section's map P in two unknowns, places in (coordinate, v, speed).

    K = m - Y F(m) - Y F_p (p - its middle) + (1 - Y F_u) (u - m), with F = P - 1, holds every zero of F in the box. If
    K lies in its interior there is exactly one for each p, and all matrices F_u are regular.
    """

    def __init__(
        self, centre: Lap, away: Sequence[Any], unknown: Sequence[int], box: dict[str, Any], path: str
    ) -> None:
        at, self.centre = centre.at, centre
        self.lap = Lap(centre.flow.parameters, not centre.axis, at, away, box["flight"], path)
        end, _, _ = self.centre.section()
        _, self.rows, self.times = self.lap.section()
        self.slopes = [[entry - int(i == j) for j, entry in enumerate(row)] for i, row in enumerate(self.rows)]
        by = arb_mat([[row[j] for j in unknown] for row in self.slopes])
        (other,) = {0, 1, 2}.difference(unknown)
        inverse, width = arb_mat(box["inverse"]), column([away[j] for j in unknown])
        value = column([end[0] - at[0], end[1] - at[1]])
        moved = inverse * column([row[other] for row in self.slopes])
        shift = (arb_mat([[1, 0], [0, 1]]) - inverse * by) * width - inverse * value - moved * away[other]
        within = all(inside(x, y) for x, y in zip(shift.entries(), width.entries(), strict=True))
        need(within, f"{path}: Krawczyk's image is not shown to lie inside the box")
        #: where the fixed points are, from the middle
        self.shift = list(away)
        self.shift[unknown[0]], self.shift[unknown[1]] = shift.entries()
        self.found = [middle + part for middle, part in zip(at, self.shift, strict=True)]

    def about(self, value: Any, by: Sequence[Any]) -> Any:
        """What is ``value`` in the middle, at the fixed points."""
        return value + by[0] * self.shift[0] + by[1] * self.shift[1] + by[2] * self.shift[2]


def _holds(number: dict[str, str], x: Any, name: str) -> None:
    """Shown: all that the ball stands for lies within the claimed half-width."""
    within = x.is_finite() and abs(x - exact_ball(number["value"])) <= exact_ball(number["uncertainty"])
    need(bool(within), f"claim: {name} is not shown to lie within its uncertainty")


def _cycle(claim: dict[str, Any], evidence: dict[str, Any]) -> None:
    """A limit cycle at an exact speed: existence, uniqueness, numbers, stability."""
    speed, turning = exact_ball(claim["omega"]), _KINDS[claim["kind"]]["turning"]
    first, second = _KINDS[claim["kind"]]["numbers"][1:3]
    at, drift = [*evidence["middle"], speed.mid()], speed - speed.mid()
    centre = Lap(claim["parameters"], turning, at, _STILL, evidence["centre"], "centre")
    names = [name for name in ("box", "wide box") if name in evidence]
    fixed, *_ = (Fixed(centre, [*evidence[name]["radii"], drift], (0, 1), evidence[name], name) for name in names)
    ((a, b, a_w), (c, d, d_w)), times, lap = fixed.rows, fixed.times, fixed.lap
    laps, trace, shrinking = 1 + lap.axis, a + d, lap.divergence.exp()
    # By Liouville's formula the determinant of P' is exp(integral of div f), and of the half map minus that.
    larger = (abs(trace) + (trace * trace + 4 * shrinking * (1 if lap.axis else -1)).sqrt()) / 2
    slow, sign = larger.log() * laps, 1 if lap.axis or trace > 0 else -1 if trace < 0 else arb.nan()
    fast, determinant = laps * lap.divergence - slow, (1 - a) * (1 - d) - b * c
    along = [((1 - d) * a_w + b * d_w) / determinant, ((1 - a) * d_w + c * a_w) / determinant, 1]
    found = {
        "period": laps * fixed.about(fixed.centre.time, times), first: fixed.found[0], second: fixed.found[1],
        "beta_max": -fixed.about(fixed.centre.least, lap.least_by),
        "multiplier_slow": sign * larger**laps, "log_multiplier_slow": slow, "log_multiplier_fast": fast,
        "dperiod_domega": laps * sum(x * y for x, y in zip(times, along, strict=True)),
        f"d{first}_domega": along[0], f"d{second}_domega": along[1],
    }  # fmt: skip
    for name, number in claim["numbers"].items():
        _holds(number, found[name], name)
    shown = {True: positive(-slow, -fast), False: positive(slow), None: True}[claim["stable"]]
    need(shown, "claim: the stability is not shown")
    for index, name in enumerate((first, second)):
        room, least = evidence[names[-1]]["radii"][index].rad() - abs(fixed.shift[index]), claim["unique_within"][name]
        need(bool(room >= exact_ball(least) > 0), f"claim: no other {name} is so near, is not shown")


def _fold(claim: dict[str, Any], evidence: dict[str, Any]) -> None:
    """An arc of cycles over the first coordinate, on which the speed has an extreme value at an inner point."""
    numbers, kind = claim["numbers"], _KINDS[claim["kind"]]
    first, second = kind["numbers"][1:3]
    place, half = (Fraction(numbers[first][part]) for part in ("value", "uncertainty"))
    need(half > 0, f"claim: {first} is no interval")

    def fixed(arc: Any, point: dict[str, Any], path: str) -> Fixed:
        at = [arc.mid(), *point["middle"]]
        centre = Lap(claim["parameters"], kind["turning"], at, _STILL, point["centre"], f"{path}, centre")
        return Fixed(centre, [arc - arc.mid(), *point["box"]["radii"]], (1, 2), point["box"], path)

    whole = fixed(exact_ball(place) + arb(0, exact_ball(half).upper()), evidence, "arc")
    rises = []
    for end, name in zip((place - half, place + half), ("lower end", "upper end"), strict=True):
        point = fixed(exact_ball(end), evidence[name], name)
        same = all(
            inside(x - y, r)
            for x, y, r in zip(point.found[1:], evidence["middle"], evidence["box"]["radii"], strict=True)
        )
        need(same, f"{name}: the cycle is not shown to be the arc's")
        (f, a, b), (g, c, d) = point.slopes
        rises.append((c * f - a * g) / (a * d - b * c))  # d(speed)/d(first coordinate)
    signs = (-1, 1) if claim["extremum"] == "smallest" else (1, -1)
    need(positive(*(x * sign for x, sign in zip(rises, signs, strict=True))), "claim: the speed has no such extremum")
    need(positive(-whole.lap.divergence), "claim: the third multiplier is not shown to be below 1")
    for name, x, middle, room in zip(
        (second, "omega"), whole.found[1:], evidence["middle"], evidence["box"]["radii"], strict=True
    ):
        _holds(numbers[name], x, name)
        printed = abs(exact_ball(numbers[name]["value"]) - middle) + exact_ball(numbers[name]["uncertainty"])
        need(inside(printed, room), f"claim: {name} reaches beyond the box that holds one cycle")
    _holds(numbers["period"], whole.lap.time * (1 + whole.lap.axis), "period")


def _end(claim: dict[str, Any], evidence: dict[str, Any]) -> None:
    """The cycles next to the connection of saddles."""
    end_shown(claim["parameters"], {**claim, **claim["numbers"], **evidence})


def _family(claim: dict[str, Any], evidence: dict[str, Any], mapped: Mapped) -> None:
    """The family of limit cycles, and that it runs into the cycles next to the connection, if that is claimed."""
    last = family_shown(claim, evidence["arcs"], mapped)
    if "end" in evidence:
        end = end_shown(claim["parameters"], {**claim, **claim["numbers"], **evidence["end"]})
        need(end.meets(*last), "the last arc is not shown to run into the cycles next to the connection")


with open(os.path.join(os.path.dirname(__file__), "claims.toml"), "rb") as _stream:
    _KINDS: dict[str, dict[str, Any]] = tomllib.load(
        _stream
    )  #: names of the numbers and sentence of each kind of claim


_PROOFS = {"cycle": _cycle, "fold": _fold, "end": _end}


def _shapes(kind: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """What a claim and its evidence have."""
    claim = {
        "kind": str,
        "parameters": dict.fromkeys(UNITS, decimal),
        "numbers": dict.fromkeys(kind["numbers"], MEASURED),
    }
    room = dict.fromkeys(("low", "high", "gamma", "v"), decimal)
    if kind["proof"] == "end":
        return claim | room, CHOICES
    if kind["proof"] == "family":
        return claim | CLAIM, EVIDENCE
    if kind["proof"] == "whole family":
        return claim | CLAIM | room, {**EVIDENCE, "end": CHOICES}
    if kind["proof"] == "fold":
        claim["extremum"] = one_of("smallest", "largest")
        return claim, {**POINT, "lower end": POINT, "upper end": POINT}
    unique = dict.fromkeys(kind["numbers"][1:3], decimal)
    claim |= {"omega": decimal, "stable": one_of(True, False, None), "unique_within": unique}
    return claim, {**POINT, "wide box?": BOX}


def proved(content: Any, mapped: Mapped = map) -> str:
    """The claim in one sentence, if the evidence proves it. Raises Unproved or Refused if not.

    ``mapped`` may be the map of a pool of processes: a family's arcs take most of the time, and are shown one by one.
    """
    if not isinstance(content, dict) or content.get("format") != FORMAT or not isinstance(content.get("claim"), dict):
        raise Refused(f"it is no object with the format '{FORMAT}' and a claim")
    kind = _KINDS[parsed(content["claim"].get("kind"), one_of(*_KINDS), "claim kind")]
    claim, evidence = _shapes(kind)
    shape = {"format": str, "claim": claim, "bits": count, "evidence": evidence, "sha256": str}
    bits = parsed(content.get("bits"), count, "bits")
    need(bits > 1, "one bit is not enough")
    with context(bits):
        file = parsed(content, shape, "the file")
        need(content["sha256"] == digest(content), "the content is not what its digest, sha256, was made of")
        if kind["proof"].endswith("family"):
            _family(file["claim"], file["evidence"], mapped)
        else:
            _PROOFS[kind["proof"]](file["claim"], file["evidence"])
    words = {name: value for name, value in file["claim"].items() if isinstance(value, str)}
    words |= {f"near_{name}": value for name, value in file["claim"].get("unique_within", {}).items()}
    words |= {name: f"{n['value']} ± {n['uncertainty']}" for name, n in file["claim"]["numbers"].items()}
    disk = ", ".join(f"{name} = {file['claim']['parameters'][name]}{unit}" for name, unit in UNITS.items())
    manner = {True: "a limit cycle, asymptotically stable", False: "a limit cycle, unstable"}.get(
        file["claim"].get("stable"), "a periodic orbit, of undecided stability"
    )
    first, last = ("falls", "rises") if words.get("extremum") == "smallest" else ("rises", "falls")
    return str(kind["sentence"].format(disk=disk, manner=manner, first=first, last=last, **words))
