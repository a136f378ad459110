"""The family of limit cycles from the Hopf point on: arcs over intervals of the amplitude that are one curve.

The first arc is over q = a^2 from 0 on, with v_0 / a and Omega for unknowns; each next one is over a, with v_0 and
Omega, and begins where the last one ends. Each gives a box in which the signs are shown, and a wider one about the same
polynomials in which there is no other cycle. Two arcs are one curve if the cycle of one at the amplitude that they
share is shown to lie in the other one's wider box. docs/certified.md (Theorem 5b) says why this suffices.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Any

from flint import arb

from tippedisk_verify.proofs.checker.curves import Arc, Curve
from tippedisk_verify.proofs.checker.jets import Jet
from tippedisk_verify.proofs.checker.steps import Flow, context, exact_ball, need
from tippedisk_verify.proofs.kernel.reading import count, decimal, dyadic, parsed

__all__ = ["CLAIM", "EVIDENCE", "Job", "Mapped", "Shown", "arc_shown", "family_shown"]

_UNIQUE = dict.fromkeys(("v_0_per_gamma_bar_0", "v_0", "omega"), decimal)
CLAIM = {
    "amplitude_first": decimal, "amplitude_end": decimal, "omega_end": decimal, "unique_within": _UNIQUE,
}  # fmt: skip
_BOX = {"radii": [decimal, 2], "steps": [{"share": dyadic, "axes?": [[dyadic, 3], 3]}, None]}
_ARC = {
    "end": decimal, "curve": [[decimal, None], 2], "half": [dyadic, None], "bits": count,
    "box": _BOX, "wide box?": _BOX,
}  # fmt: skip
EVIDENCE = {"arcs": [lambda arc: arc, None]}  # what an arc's part has to be is seen where it is shown

Shown = tuple[tuple[int, int], tuple[int, int]]  #: bounds of the distances in both unknowns, as dyadics
Mapped = Callable[[Callable[[Any], Shown], Sequence[Any]], Iterable[Shown]]  #: `map`, or that of a pool of processes
Job = tuple[dict[str, str], Fraction, int, Any]  #: the disk, where the arc begins, its number, its content


def arc_shown(job: Job) -> Shown:
    """One arc: how far its cycles are from the polynomials at most. Raises Unproved or Refused."""
    bits = job[3].get("bits") if isinstance(job[3], dict) else None
    with context(max(2, parsed(bits, count, f"arc {job[2]} bits"))):
        return _arc_shown(*job)


def _arc_shown(disk: dict[str, str], low: Fraction, number: int, content: Any) -> Shown:
    path = f"arc {number}"
    entry = parsed(content, _ARC, path)
    high = Fraction(entry["end"])
    need(low < high, f"{path}: it ends where it must not")
    rows, half = [[exact_ball(part) for part in row] for row in entry["curve"]], entry["half"]
    need(len(half) > 1 and all(len(row) == len(half) for row in rows), f"{path}: its polynomials have unlike degrees")
    ends = (low, high) if low else (low, high**2)
    first = [exact_ball((ends[0] + ends[1]) / 2), exact_ball((ends[1] - ends[0]) / 2), *[arb(0)] * (len(half) - 2)]
    p = [Jet(part) for part in (first, *rows)]

    def shown(name: str) -> Arc:
        need(all(Fraction(part) > 0 for part in entry[name]["radii"]), f"{path}: a radius is not positive")
        away = [arb(0), *(arb(0, exact_ball(part).upper()) for part in entry[name]["radii"])]
        return Arc(Curve(Flow(disk, arb(1)), not low, p, away, Jet(half)), entry[name]["steps"], f"{path}, {name}")

    arc = shown("box")
    arc.signs()
    if "wide box" in entry:
        shown("wide box")
    near = [part.abs_upper().man_exp() for part in arc.within]
    return (int(near[0][0]), int(near[0][1])), (int(near[1][0]), int(near[1][1]))


def family_shown(claim: dict[str, Any], contents: Sequence[Any], mapped: Mapped) -> tuple[Any, Any, Any]:
    """The family up to the claim's amplitude, by `arc_shown` of each arc's part of the file. Raises Unproved.

    Balls of Omega, gamma_bar_0 and v_0 at its end.
    """
    entries = [parsed(content, _ARC, f"arc {number}") for number, content in enumerate(contents, 1)]
    need(bool(entries), "there are no arcs")
    disk = claim["parameters"]
    flow = Flow(disk, arb(1))
    lows = [Fraction(0), *(Fraction(entry["end"]) for entry in entries)]
    jobs = [(disk, low, k, part) for k, (low, part) in enumerate(zip(lows, contents, strict=False), 1)]
    shown = list(mapped(arc_shown, jobs))
    arcs = [_Ends(entry, near, not number) for number, (entry, near) in enumerate(zip(entries, shown, strict=True))]
    omega_crit = (flow.r + flow.e) * (flow.g / (flow.r * flow.b)).sqrt()
    start = omega_crit - arcs[0].low[1]
    need(bool(abs(start) <= arcs[0].within[1]), "arc 1: it is not shown to begin at the Hopf point")
    for number, (first, second) in enumerate(pairwise(arcs), 2):
        off = [abs(a - b) for a, b in zip(first.high, second.low, strict=True)]
        joined = any(
            all(bool(gap + near < room) for gap, near, room in zip(off, mine.within, theirs.room, strict=True))
            for mine, theirs in ((first, second), (second, first))
        )
        need(joined, f"arcs {number - 1} and {number} are not shown to be one curve")
    last, told = arcs[-1], claim["unique_within"]
    for name, text in (("amplitude_first", entries[0]["end"]), ("amplitude_end", entries[-1]["end"])):
        need(Fraction(claim[name]) == Fraction(text), f"claim: {name} is not the amplitude at which an arc ends")
    below = last.high[1] + last.within[1] <= exact_ball(claim["omega_end"])
    need(bool(below), "claim: omega_end is not shown to lie above the last cycle's speed")
    number = claim["numbers"]["omega_crit"]
    held = abs(omega_crit - exact_ball(number["value"])) <= exact_ball(number["uncertainty"])
    need(bool(held), "claim: omega_crit is not shown to lie within its uncertainty")
    for k, arc in enumerate(arcs):
        name = "v_0" if k else "v_0_per_gamma_bar_0"
        for index, least in enumerate((told[name], told["omega"])):
            room = arc.own_room[index] - arc.own_within[index]
            need(bool(room >= exact_ball(least) > 0), f"claim: no other cycle is so near, is not shown of arc {k + 1}")
    v, omega = (point + arb(0, near.upper()) for point, near in zip(last.high, last.within, strict=True))
    return omega, exact_ball(entries[-1]["end"]), v


class _Ends:
    """The polynomials' v_0 and Omega at an arc's ends, and the sizes of its boxes there."""

    def __init__(self, entry: dict[str, Any], near: Shown, scaled: bool) -> None:
        self.own_within = [arb(part) for part in near]
        narrow, wide = (
            [Fraction(part) for part in entry.get(name, entry["box"])["radii"]] for name in ("box", "wide box")
        )
        need(all(0 < a <= b for a, b in zip(narrow, wide, strict=True)), "the wide box does not hold the other one")
        self.own_room = [exact_ball(part) for part in wide]
        rows = [[exact_ball(part) for part in row] for row in entry["curve"]]
        high = exact_ball(entry["end"])
        self.low, self.high = ([sum(part * sign**k for k, part in enumerate(row)) for row in rows] for sign in (-1, 1))
        self.within, self.room = list(self.own_within), list(self.own_room)
        if scaled:  # they are used where a is ``high``
            for pair in (self.high, self.within, self.room):
                pair[0] = pair[0] * high
