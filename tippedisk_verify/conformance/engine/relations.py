"""Relations between wrong answers and right ones that no change of a program makes: a unit, a place, another question.

A relation predicts an answer from right values alone. It is a cause if every wrong answer is as predicted, and no right
one speaks against it; different quantities may need different relations.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import permutations, product

import numpy as np

from tippedisk_verify.conformance.engine.entries import Array, Sheet
from tippedisk_verify.conformance.engine.places import conditions, inputs, names_of
from tippedisk_verify.conformance.sheet import placed
from tippedisk_verify.model.parameters import SYMBOLS

__all__ = ["Cause", "related"]

_COVERED = 0.4  # of a quantity's wrong answers must have a counterpart, where the relation is to another question
_FREE = 3  # wrong answers of different entries that bear out a number that was read off them
_SIDE = 4  # wrong answers that bear out a condition
_EVIDENCE = 6.0  # digits that a relation explains in all, so that it fits by no accident
_SURE = 1e-4  # of what is allowed: closer answers tell no more
_STATEMENTS = 3  # different relations; more are several mistakes
_CONDITION = 5  # rank of a condition
_LAWS = ("both", "linear", "smooth")


@dataclass(frozen=True, eq=False)
class Cause:
    """What wrong answers are instead of right."""

    name: str  #: a short word for the kind of relation
    says: str
    cells: Array  #: which answers of the sheet it explains
    rank: int  #: lower is simpler


@dataclass(frozen=True, eq=False)
class _Relation:
    """``says`` has {q} for the quantities, and {has}, {is} for verbs; or one text for each quantity of the sheet."""

    name: str
    rank: int
    says: str | Sequence[str]
    predicted: Array  #: over the answers; NaN where there is nothing to compare with
    digits: float = 0.0  #: beyond those that are asked for, which the answers must agree in

    def text(self, group: int) -> str:
        return self.says if isinstance(self.says, str) else self.says[group]


_Numbers = dict[str, float]
_FACTORS: _Numbers = {
    "2": 2.0, "1/2": 0.5, "3": 3.0, "1/3": 1 / 3, "4": 4.0, "1/4": 0.25, "6": 6.0, "1/6": 1 / 6, "8": 8.0, "1/8": 1 / 8,
    "3/2": 1.5, "2/3": 2 / 3, "4/3": 4 / 3, "3/4": 0.75, "-2": -2.0, "-1/2": -0.5, "pi": math.pi, "1/pi": 1 / math.pi,
    "2 pi": 2 * math.pi, "1/(2 pi)": 0.5 / math.pi, "180/pi (degrees)": 180 / math.pi, "pi/180": math.pi / 180,
    "30/pi (turns per minute)": 30 / math.pi, "pi/30": math.pi / 30, "60": 60.0, "1/60": 1 / 60,
    "sqrt 2": math.sqrt(2), "1/sqrt 2": math.sqrt(0.5), "ln 10": math.log(10), "1/ln 10": 1 / math.log(10),
    "ln 2": math.log(2), "1/ln 2": 1 / math.log(2), "g, 9.81": 9.81, "1/g": 1 / 9.81,
    **{f"10^{k}" if abs(k) != 3 else "1000" if k > 0 else "1/1000": 10.0**k for k in range(-12, 13) if k},
}  # fmt: skip
_OFFSETS: _Numbers = {"pi/2": math.pi / 2, "pi": math.pi, "2 pi": 2 * math.pi, "1": 1.0}
_Function = Callable[[Array], Array]
_OF_VALUE: tuple[tuple[str, int, str, _Function], ...] = (
    ("sign", 0, "{q} {has} the wrong sign", lambda x: -x),
    ("modulus", 1, "{q} {is} the modulus of the right value", np.abs),
    ("modulus", 1, "{q} {is} minus the modulus of the right value", lambda x: -np.abs(x)),
    ("zero", 1, "{q} {is} zero", lambda x: 0 * x),
    ("one", 2, "{q} {is} one", lambda x: 0 * x + 1),
    ("root", 2, "{q} {is} the square root of the right value", lambda x: np.sign(x) * np.sqrt(np.abs(x))),
    ("square", 2, "{q} {is} the square of the right value", np.square),
    ("reciprocal", 2, "{q} {is} the reciprocal of the right value", lambda x: 1 / x),
    ("reciprocal", 2, "{q} {is} 2 pi divided by the right value", lambda x: 2 * math.pi / x),
    ("logarithm", 2, "{q} {is} the logarithm of the right value", lambda x: np.log(np.abs(x))),
    ("logarithm", 2, "{q} {is} the common logarithm of the right value", lambda x: np.log10(np.abs(x))),
    ("exponential", 2, "{q} {is} the exponential of the right value", np.exp),
    ("complement", 2, "{q} {is} pi/2 minus the right value", lambda x: math.pi / 2 - x),
    ("complement", 2, "{q} {is} pi minus the right value", lambda x: math.pi - x),
    ("complement", 2, "{q} {is} 1 minus the right value", lambda x: 1 - x),
    ("sine", 3, "{q} {is} the sine of the right value", np.sin),
    ("cosine", 3, "{q} {is} the cosine of the right value", np.cos),
    ("tangent", 3, "{q} {is} the tangent of the right value", np.tan),
)  # fmt: skip
_OF_ANGLE: tuple[tuple[str, _Function], ...] = (
    ("{q} {is} reduced to [0, 2 pi)", lambda x: x % (2 * math.pi)),
    ("{q} {is} reduced to (-pi, pi]", lambda x: math.pi - (math.pi - x) % (2 * math.pi)),
    ("{q} {is} reduced to [-pi/2, pi/2]", lambda x: np.arcsin(np.sin(x))),
    ("{q} {is} reduced to [0, pi]", lambda x: np.arccos(np.cos(x))),
)
_ANGLES = ("beta", "gamma", "crossing_gamma", "gamma_bar_0", "beta_max", "beta_bar_0", "beta_bar_top")
_OF_ORDER: tuple[tuple[str, Callable[[Array, Array], Array]], ...] = (
    ("n! (a factorial)", lambda n, epsilon: np.array([float(math.factorial(int(one))) for one in n])),
    ("1/n!", lambda n, epsilon: np.array([1 / math.factorial(int(one)) for one in n])),
    ("epsilon^n", lambda n, epsilon: epsilon**n), ("epsilon^-n", lambda n, epsilon: epsilon**-n),
    ("(-1)^n", lambda n, epsilon: (-1.0) ** n),
)  # fmt: skip
_OF_TWO: tuple[tuple[int, str, Callable[[Array, Array], Array]], ...] = (  # x the right value, y another one
    (2, "{q} {has} the values of {other}", lambda x, y: y),
    (3, "{q} {has} the values of {other} with the wrong sign", lambda x, y: -y),
    (3, "{q} {is} twice {other}", lambda x, y: 2 * y),
    (3, "{q} {is} half of {other}", lambda x, y: y / 2),
    (4, "{q} {is} the right value plus {other}", lambda x, y: x + y),
    (4, "{q} {is} the right value minus {other}", lambda x, y: x - y),
    (4, "{q} {is} {other} minus the right value", lambda x, y: y - x),
    (4, "{q} {is} the right value times {other}", lambda x, y: x * y),
    (4, "{q} {is} the right value divided by {other}", lambda x, y: x / y),
    (4, "{q} {is} {other} divided by the right value", lambda x, y: y / x),
    (4, "{q} {is} the modulus of the right value and {other}", np.hypot),
    (4, "{q} {is} the right value to the power 1/{other}", lambda x, y: np.abs(x) ** (1 / y)),
    (4, "{q} {is} the exponential of {other}", lambda x, y: np.exp(y)),
    (4, "{q} {is} the logarithm of {other}", lambda x, y: np.log(np.abs(y))),
    (4, "{q} {is} the reciprocal of {other}", lambda x, y: 1 / y),
    (4, "{q} {is} 2 pi divided by {other}", lambda x, y: 2 * math.pi / y),
)  # fmt: skip
_SHARES = {1.0: "", -1.0: "minus ", 2.0: "twice ", -2.0: "minus twice ", 0.5: "half of ", -0.5: "minus half of "}
_LOGARITHMS = ("log_multiplier_slow", "log_multiplier_fast")
_PARTNERS = (
    ("inverted-", "noninverted-", "equilibrium"), ("printed-", "consistent-", "form"),
    ("stable-", "unstable-", "cycle, stable and unstable exchanged"),
)  # fmt: skip
#: Keys that sort eigenvalues; equal ones go by the sign of the imaginary part.
_ORDERS: dict[str, Callable[[Array], Array]] = {
    "descending real parts": lambda z: -z.real, "ascending real parts": lambda z: z.real,
    "ascending moduli": np.abs, "descending moduli": lambda z: -np.abs(z),
    "descending imaginary parts": lambda z: -z.imag, "ascending imaginary parts": lambda z: z.imag,
    "ascending moduli of the imaginary parts": lambda z: np.abs(z.imag),
    "descending moduli of the imaginary parts": lambda z: -np.abs(z.imag),
}  # fmt: skip


class _Grid:
    """The right values by entry, law, quantity and place, so that other questions' are found by index."""

    def __init__(self, sheet: Sheet) -> None:
        self.sheet, self.x = sheet, sheet.truth
        self.names, self.given = names_of(sheet), inputs(sheet)
        self.p = np.concatenate([np.array(table.p)[:, table.rows] for table in sheet.tables], axis=1)
        self.bases: dict[tuple[str, str, str], int] = {}  #: set, kind, name: the same place under each law
        cells: list[tuple[Array, Array]] = []
        for table in sheet.tables:
            ids = [entry.id.split("/") for entry in table.entries]
            base = [self.bases.setdefault((one[0], one[2], one[3]), len(self.bases)) for one in ids]
            law = _LAWS.index(table.friction) if table.friction in _LAWS else 0
            cells.append((np.array(base)[table.rows], np.full(len(table.names), law)))
        self.base, self.law = (np.concatenate(parts) for parts in zip(*cells, strict=True))
        ordered = np.isfinite(self.given["order"])
        plain = np.where(ordered, [name.rsplit("_", 1)[0] for name in self.names.tolist()], self.names)
        self.stems, self.stem = np.unique(plain, return_inverse=True)
        times = np.unique(self.given["t"][np.isfinite(self.given["t"])])
        self.times = times
        place = np.where(np.isfinite(self.given["t"]), np.searchsorted(times, self.given["t"]), 0.0)
        place = np.where(np.isfinite(self.given["n"]), self.given["n"] - 1, place)
        self.place = np.where(ordered, self.given["order"], place).astype(int)
        # One more of each, which stays empty, for what there is not.
        shape = (len(self.bases) + 1, len(_LAWS) + 1, len(self.stems) + 1, self.place.max() + 2)
        self.values = np.full(shape, np.nan)
        self.values[self.base, self.law, self.stem, self.place] = self.x
        self.angle = np.isin(self.names, _ANGLES)

    def at(self, **moved: Array) -> Array:
        """The right values where some indices are others; indices out of range find nothing."""
        where = []
        for name, size in zip(("base", "law", "stem", "place"), self.values.shape, strict=True):
            index = np.asarray(moved.get(name, getattr(self, name)))
            where.append(np.where((index >= 0) & (index < size), index, size - 1))
        return np.asarray(self.values[tuple(where)])

    def other(self, stem: int) -> Array:
        """The right values of another quantity at the same place; some are common to both laws."""
        found = self.at(stem=stem)
        for moved in ({"law": 0}, {"law": 1}, {"law": 2}, {"place": 0}):
            found = np.where(np.isnan(found), self.at(stem=stem, **moved), found)
        return found

    def to(self, rename: Callable[[tuple[str, str, str]], tuple[str, str, str]]) -> Array:
        """For each answer the index of another entry."""
        return np.array([self.bases.get(rename(key), -1) for key in self.bases])[self.base]

    def beside(self, by: int | None) -> Array:
        """For each answer the index of the entry so many places later, or the first or last one of its set and kind."""
        kinds: dict[tuple[str, str], list[int]] = {}
        for (of_set, kind, _), index in self.bases.items():
            kinds.setdefault((of_set, kind), []).append(index)
        moved = np.full(len(self.bases), -1)
        for here in kinds.values():
            for n, index in enumerate(here):
                moved[index] = here[0] if by is None else here[n + by] if 0 <= n + by < len(here) else -1
        return np.asarray(moved[self.base])


def _relations(grid: _Grid) -> Iterator[_Relation]:
    x, order, epsilon = grid.x, grid.given["order"], grid.p[SYMBOLS.index("epsilon")]
    for name, rank, says, of in _OF_VALUE:
        yield _Relation(name, rank, says, of(x))
    for text, factor in _FACTORS.items():
        yield _Relation("factor", 1, f"{{q}} {{has}} the factor {text}", factor * x)
    for (text, offset), sign in product(_OFFSETS.items(), (1, -1)):
        yield _Relation("offset", 2, f"{{q}} {{is}} {text} too {'large' if sign > 0 else 'small'}", x + sign * offset)
    turns = 2 * math.pi * np.round((grid.sheet.answer - x) / (2 * math.pi))
    for says, of in (*_OF_ANGLE, ("{q} {is} off by whole turns", lambda x: x + turns)):
        yield _Relation("turns", 2, says, np.where(grid.angle, of(x), np.nan))
    if np.isfinite(order).any():
        for text, weight in _OF_ORDER:
            yield _Relation("weight", 3, f"{{q}} {{has}} the factor {text}", weight(np.nan_to_num(order), epsilon) * x)
        for text, share in (("epsilon^k h_k", epsilon), ("h_k", np.ones_like(epsilon))):
            orders = range(grid.values.shape[-1] - 1)
            sums = sum((share**k * np.where(k <= grid.place, grid.at(place=k), 0.0) for k in orders), np.zeros_like(x))
            yield _Relation(
                "sums", 3, f"{{q}} {{is}} partial sums of {text}", np.where(np.isfinite(order), sums, np.nan)
            )
    yield from _places(grid)
    yield from _entries(grid)
    yield from _quantities(grid)
    yield from _orders(grid)
    yield from _rounded(grid)


def _places(grid: _Grid) -> Iterator[_Relation]:
    """Another sample, crossing or order of the same entry."""
    place = grid.place
    words = {"t": "sample in time", "n": "crossing", "order": "order"}
    for key, word in words.items():
        has = np.isfinite(grid.given[key])
        if not has.any():
            continue
        moves = {"next": place + 1, "previous": place - 1, "next but one": place + 2, "last but one": place - 2}
        moves |= {"first": 0 * place}
        if key == "n":
            moves |= {"every second": 2 * place + 1, "every odd": 2 * place}
            moves |= {f"every {text}": index for text, index in _one_way(grid)}
        if key == "t":
            for text, share in (("half the time", 0.5), ("twice the time", 2.0)):
                index = np.searchsorted(grid.times, share * grid.given["t"] - 1e-9)
                near = np.append(grid.times, np.inf)[index]
                hit = np.isclose(near, share * grid.given["t"])
                moves[f"of {text}, a"] = np.where(hit, index, -1)
        for text, index in moves.items():
            values = np.where(has & (index != place), grid.at(place=index), np.where(has, grid.x, np.nan))
            yield _Relation("place", 3, f"{{q}} {{has}} the values of the {text} {word}", values)
        before = np.where(place > 0, grid.at(place=place - 1), 0.0)
        yield _Relation(
            "interval", 4, f"{{q}} {{is}} counted from the previous {word}", np.where(has, grid.x - before, np.nan)
        )
        first = np.where(has, grid.x - grid.at(place=0), np.nan)
        yield _Relation("interval", 4, f"{{q}} {{is}} counted from the first {word}", first)


def _one_way(grid: _Grid) -> Iterator[tuple[str, Array]]:
    """The places of the crossings in one direction."""
    if "crossing_v" not in grid.stems:
        return
    speeds = grid.values[:, :, int(np.searchsorted(grid.stems, "crossing_v"))]
    for text, sign in (("upward", 1), ("downward", -1)):
        kept = sign * speeds > 0
        listed = np.argsort(~kept, axis=-1, kind="stable")
        listed[np.arange(kept.shape[-1]) >= kept.sum(axis=-1, keepdims=True)] = -1
        yield text, listed[grid.base, grid.law, np.maximum(grid.place, 0)]


def _entries(grid: _Grid) -> Iterator[_Relation]:
    """The same quantity of another entry."""
    moves = {
        "the next entry": grid.beside(1),
        "the previous entry": grid.beside(-1),
        "the first entry": grid.beside(None),
    }
    moves |= {"the next entry but one": grid.beside(2), "the last entry but one": grid.beside(-2)}
    for one, two, text in _PARTNERS:
        moves[f"the other {text}"] = grid.to(lambda key, one=one, two=two: (*key[:2], _exchanged(key[2], one, two)))  # type: ignore[misc]
    for other in sorted({of_set for of_set, _, _ in grid.bases}):
        moves[f"the parameter set {other}"] = grid.to(lambda key, other=other: (other, *key[1:]))  # type: ignore[misc]
    for text, base in moves.items():
        if (base != grid.base).any() and (base >= 0).any():
            yield _Relation("entry", 3, f"{{q}} {{has}} the values of {text}", grid.at(base=base))
    for law in (1, 2):
        says = f"{{q}} {{has}} the values of the {_LAWS[law]} law"
        yield _Relation("law", 3, says, np.where(grid.law > 0, grid.at(law=law), np.nan))
    yield _Relation("law", 3, "{q} {has} the values of the other law", grid.at(law=3 - grid.law))
    for by in (1, -1):
        rows = np.concatenate([_shifted(table.truth, by) for table in grid.sheet.tables])
        yield _Relation("row", 3, f"{{q}} {{has}} the values of the row {'below' if by > 0 else 'above'}", rows)


def _shifted(values: Array, by: int) -> Array:
    moved = np.roll(values, -by)
    moved[-1 if by > 0 else 0] = np.nan
    return moved


def _exchanged(name: str, one: str, two: str) -> str:
    if name.startswith((one, two)):
        return name.replace(one, two, 1) if name.startswith(one) else name.replace(two, one, 1)
    return ""


def _quantities(grid: _Grid) -> Iterator[_Relation]:
    """What is made of another quantity of the same entry, or of an input."""
    others = {str(stem): grid.other(n) for n, stem in enumerate(grid.stems)}
    others |= {f"the input {name}": grid.given[name] for name in ("Omega", "beta", "gamma", "v", "t")}
    others |= {f"the parameter {name}": grid.p[n] for n, name in enumerate(SYMBOLS)}
    for stem in [stem[:-3] for stem in others if stem.endswith("_re")]:
        mine = np.char.endswith(grid.names, "_re")
        part = np.where(np.char.endswith(grid.names, "_im"), others[f"{stem}_im"], np.nan)
        others[stem] = np.where(mine, others[f"{stem}_re"], part)
    for name, y in others.items():
        y = np.where(grid.names == name, np.nan, y)
        for rank, says, of in _OF_TWO if np.isfinite(y).any() else ():
            yield _Relation("quantity", rank, says.replace("{other}", name), of(grid.x, y))
    if set(_LOGARITHMS) <= set(others):
        slow, fast = (others[name] for name in _LOGARITHMS)
        mine = np.isin(grid.names, _LOGARITHMS)
        for (a, one), (b, two) in product(_SHARES.items(), _SHARES.items()):
            says = f"{{q}} {{is}} {one}{_LOGARITHMS[0]} plus {two}{_LOGARITHMS[1]}"
            yield _Relation("sum", 5, says, np.where(mine, a * slow + b * fast, np.nan))


def _orders(grid: _Grid) -> Iterator[_Relation]:
    """The right eigenvalues in another order."""
    numbers = sorted({stem[:-3] for stem in grid.stems if stem.startswith("lambda_") and stem.endswith("_re")})
    found = [[np.flatnonzero(grid.stems == name + part) for part in ("_re", "_im")] for name in numbers]
    if not numbers or any(len(index) != 1 for pair in found for index in pair):
        return
    values = grid.values[:, 0, :, 0]
    z = np.stack([values[:, re[0]] + 1j * values[:, im[0]] for re, im in found], axis=1)
    own = np.array([numbers.index(name[:-3]) for name in grid.names])
    imaginary = np.char.endswith(grid.names, "_im")

    def answers(places: Array) -> Array:
        picked = z[grid.base, places[grid.base, own]]
        return np.where(imaginary, picked.imag, picked.real)

    for (text, key), sign, tie in product(_ORDERS.items(), (-1, 1), (-1, 1)):
        rounded = np.round(key(z), 7)
        first = (
            ""
            if text.endswith("ing imaginary parts")
            else f", the {'positive' if sign < 0 else 'negative'} imaginary part first"
        )
        places = np.lexsort((tie * z.real, sign * z.imag, rounded), axis=1)
        yield _Relation("order", 2, f"the eigenvalues in another order: {text}{first}", answers(places))
    fits = []
    orders = [np.broadcast_to(one, z.shape) for one in permutations(range(len(numbers)))]
    for places in orders:
        bad = ~grid.sheet.fitted(answers(places))
        fits.append(np.bincount(grid.base[bad], minlength=len(z)))
    best = np.array(orders)[np.argmin(fits, axis=0), np.arange(len(z))]
    yield _Relation("order", 4, "the eigenvalues not sorted: their order differs from entry to entry", answers(best))


def _rounded(grid: _Grid) -> Iterator[_Relation]:
    """Answers with few digits: whole multiples of a unit, within half of it or the whole one of the right values."""
    x, answer = grid.x, grid.sheet.answer
    size = np.floor(np.log10(np.where(x == 0, 1.0, np.abs(x))))
    single = x.astype(np.float32).astype(float)
    yield _Relation("rounded", 1, "{q} {is} rounded to single precision", single)
    for d, (word, shift) in product(range(1, 13), (("decimals", 0.0), ("significant digits", 1.0))):
        unit = 10.0 ** (size * shift + shift - d)
        near = unit * np.round(answer / unit)
        whole = np.abs(answer - near) < 1e-6 * unit + 1e-15 * np.abs(x)
        away = np.abs(answer - x) - grid.sheet.allowed
        for text, most in (("rounded", 0.5001), ("truncated", 1.0001)):
            cut = (text == "rounded") | (np.abs(answer) <= np.abs(x) + grid.sheet.allowed)
            says = f"{{q}} {{is}} {text} to {d} {word if d > 1 else word[:-1]}"
            yield _Relation(
                "rounded", 1 if text == "rounded" else 2, says, np.where(whole & cut & (away < most * unit), answer, x)
            )


# ------------------------------------------------------------------------------------------ numbers solved for
def _solved(grid: _Grid, group: Array) -> Iterator[_Relation]:
    """One number for all, and a factor or a summand that is a constant times powers of the inputs."""
    sheet, known = grid.sheet, [np.flatnonzero(group == n) for n in range(group.max() + 1)]
    middle = np.array([np.median(sheet.answer[cells]) for cells in known])
    says = [f"{{q}} {{is}} {one:.9g} throughout" for one in middle]
    yield _Relation("constant", 2, says, np.where(_several(grid, group), middle[group], np.nan))
    bases = {"Omega": grid.given["Omega"], "v": grid.given["v"]} if sheet.level <= 5 else {}
    for name in ("beta", "gamma") if bases else ():
        bases |= {f"sin({name})": np.sin(grid.given[name]), f"cos({name})": np.cos(grid.given[name])}
    for word, start, target in (("factor", 0.0, grid.x), ("summand", 1.0, np.ones_like(grid.x))):
        for some in ({}, bases):
            texts, share = _shares(grid, group, (sheet.answer - start * grid.x) / target, some)
            says = [f"{{q}} {{has}} the {word} {text}" for text in texts]
            yield _Relation(word, 4 + 2 * bool(some), says, start * grid.x + share * target, digits=2.0)


def _several(grid: _Grid, group: Array) -> Array:
    """Which answers are to quantities with wrong answers in enough different entries."""
    pairs = np.unique(np.stack([group, grid.base])[:, grid.sheet.wrong], axis=1)[0]
    return np.asarray(np.bincount(pairs, minlength=group.max() + 1)[group] >= _FREE)


def _shares(grid: _Grid, group: Array, ratio: Array, bases: dict[str, Array]) -> tuple[list[str], Array]:
    """For each quantity the product of powers that a ratio is, in words and as numbers; NaN where it is none."""
    share, texts = np.full(len(ratio), np.nan), [""] * (group.max() + 1)
    usable = grid.sheet.wrong & _several(grid, group) & np.isfinite(ratio) & (ratio != 0)
    sets, of_set = np.unique(np.array([key[0] for key in grid.bases])[grid.base], return_inverse=True)
    for n in range(len(texts)):
        cells = np.flatnonzero(usable & (group == n))
        here = {name: base for name, base in bases.items() if len(cells) and np.ptp(np.abs(base[cells])) > 0}
        here = {name: base for name, base in here.items() if (base[cells] != 0).all()}
        if len(cells) < _FREE + len(here) + len(sets) - 1 or (bases and not here):
            continue
        columns = [np.log(np.abs(base[cells])) for base in here.values()]
        columns += [(of_set[cells] == m).astype(float) for m in range(len(sets)) if (of_set[cells] == m).any()]
        solution = np.linalg.lstsq(np.array(columns).T, np.log(np.abs(ratio[cells])), rcond=None)[0]
        powers = np.round(2 * solution[: len(here)]) / 2
        if np.abs(powers).sum() > 3 or (bases and not powers.any()):
            continue
        product_ = np.ones_like(ratio)
        for base, power in zip(here.values(), powers.tolist(), strict=True):
            product_ = product_ * (base**power if power % 1 == 0 else np.abs(base) ** power)
        numbers = np.array(
            [
                np.median((ratio / product_)[cells[of_set[cells] == m]]) if (of_set[cells] == m).any() else np.nan
                for m in range(len(sets))
            ]
        )
        close = np.clip(
            0.1 * np.median(grid.sheet.allowed[cells] / np.maximum(np.abs(grid.x[cells]), 1e-300)), 1e-11, 1e-7
        )
        places = [cells[of_set[cells] == m][0] for m in range(len(sets)) if np.isfinite(numbers[m])]
        text = _named(grid.p[:, places], numbers[np.isfinite(numbers)], float(close))
        if text is None:
            continue
        words = [text] if text != "1" or not powers.any() else []
        words += [
            name if power == 1 else f"{name}^{power:g}" for name, power in zip(here, powers, strict=True) if power
        ]
        texts[n] = " ".join(words)
        mine = group == n
        share[mine] = (numbers[of_set] * product_)[mine]
    return texts, share


@cache
def _products() -> tuple[Array, list[str]]:
    """Powers of the parameters, of Bbar and r + e, up to three in all, and their roots."""
    names = (*SYMBOLS, "Bbar", "(r + e)")
    powers = {(0,) * len(names)}
    for _ in range(3):
        powers |= {
            (*one[:n], one[n] + by, *one[n + 1 :]) for one in powers for n in range(len(names)) for by in (1, -1)
        }
    listed = sorted(powers, key=lambda one: (sum(map(abs, one)), min(one) < 0, one))
    table = np.array([*listed, *(np.array(one) / 2 for one in listed)], dtype=float)
    return table, [
        " ".join(name if k == 1 else f"{name}^{k:g}" for name, k in zip(names, one, strict=True) if k) for one in table
    ]


def _named(p: Array, numbers: Array, close: float) -> str | None:
    """A number that is a product of parameters, in words; the number itself if it is the same for all sets."""
    table, words = _products()
    r, e, m, _, B = p[:5]
    logs = table @ np.log(np.concatenate([p, [B - m * e**2, r + e]]))
    for text, factor in {
        "1": 1.0,
        "2": 2.0,
        "1/2": 0.5,
        "4": 4.0,
        "1/4": 0.25,
        "pi": math.pi,
        "2 pi": 2 * math.pi,
    }.items():
        hit = np.flatnonzero((np.abs(np.log(np.abs(numbers)) - math.log(factor) - logs) < close).all(axis=1))
        if len(hit):
            sign = "-" if numbers[0] < 0 else ""
            return sign + " ".join([text] * (text != "1" or not words[hit[0]]) + [words[hit[0]]] * bool(words[hit[0]]))
    return f"{numbers[0]:.9g}" if (np.abs(numbers / numbers[0] - 1) < close).all() else None


# ------------------------------------------------------------------------------------------ what fits
def related(sheet: Sheet) -> list[Cause]:
    """The relations that give all wrong answers of a sheet, simplest first."""
    if not sheet.wrong.any():
        return []
    grid = _Grid(sheet)
    stems, group = np.unique(sheet.stems, return_inverse=True)
    count = len(stems)
    wrong = np.bincount(group[sheet.wrong], minlength=count)
    blamed = set(np.flatnonzero(wrong).tolist())
    sides = list(conditions(sheet))
    found: dict[tuple[str, str], tuple[_Relation, int, Array, set[int]]] = {}
    with np.errstate(all="ignore"):
        for relation in (*_relations(grid), *_solved(grid, group)):
            known = np.isfinite(relation.predicted)
            fits = sheet.fitted(relation.predicted, relation.digits) & known
            if not (fits & sheet.wrong).any():
                continue
            away = np.abs(sheet.answer - relation.predicted)
            told = np.log10(np.abs(sheet.answer - sheet.truth) / np.maximum(away, _SURE * sheet.allowed))
            mine = fits & sheet.wrong
            told = np.bincount(group[mine], told[mine], minlength=count)
            explained = np.bincount(group[mine], minlength=count)
            against = known & ~fits
            spoken = np.bincount(group[against & sheet.wrong], minlength=count)
            enough = (explained == wrong) | ((explained >= _COVERED * wrong) & (explained >= _FREE))
            for n in np.flatnonzero((wrong > 0) & (spoken == 0) & enough & (told > _EVIDENCE)).tolist():
                here = group == n
                side = "" if not (against & here).any() else _side(sheet, sides, here, against, int(explained[n]))
                if side is not None:
                    rank = relation.rank + _CONDITION * bool(side)
                    entry = found.setdefault((relation.text(n), side), (relation, rank, np.zeros_like(mine), set()))
                    entry[2][mine & here] = True
                    entry[3].add(n)
    return _causes(sheet, stems, blamed, found)


def _side(sheet: Sheet, sides: list[tuple[str, Array]], here: Array, against: Array, explained: int) -> str | None:
    """The first condition that holds where a quantity's answers are wrong, and not where they speak against it."""
    if explained < _SIDE:
        return None
    for text, mask in sides:
        if not (here & mask & against).any() and not (here & ~mask & sheet.wrong).any():
            return text
    return None


def _causes(
    sheet: Sheet, stems: Array, blamed: set[int], found: dict[tuple[str, str], tuple[_Relation, int, Array, set[int]]]
) -> list[Cause]:
    whole = [
        Cause(relation.name, _said(says, side, sheet, stems, groups), cells, rank)
        for (says, side), (relation, rank, cells, groups) in found.items()
        if groups == blamed
    ]
    if whole:
        return sorted(whole, key=lambda cause: cause.rank)
    chosen: dict[tuple[str, str], set[int]] = {}
    for n in sorted(blamed):
        fitting = [(entry[1], key) for key, entry in found.items() if n in entry[3]]
        if not fitting:
            return []
        chosen.setdefault(min(fitting, key=lambda one: one[0])[1], set()).add(n)
    texts = [_said(*key, sheet, stems, groups) for key, groups in chosen.items()]
    parts = [found[key] for key in chosen]
    texts = _exchanges(texts)
    if len(texts) > _STATEMENTS:
        return []
    cells = np.any(
        [
            entry[2] & np.isin(sheet.stems, stems[list(groups)])
            for entry, groups in zip(parts, chosen.values(), strict=True)
        ],
        axis=0,
    )
    name = "exchanged" if "exchanged" in texts[0] else "-".join(dict.fromkeys(entry[0].name for entry in parts))
    return [Cause(name, "; ".join(texts), cells, max(entry[1] for entry in parts) + len(texts) - 1)]


_VALUES_OF = re.compile(r"(\w+) ha(?:s|ve) the values of (\w+)$")


def _exchanges(texts: list[str]) -> list[str]:
    """Two quantities that have each other's values are exchanged."""
    pairs = {match[1]: match[2] for text in texts if (match := _VALUES_OF.match(text))}
    said = []
    for text in texts:
        match = _VALUES_OF.match(text)
        if match and pairs.get(match[2]) == match[1]:
            text = f"{' and '.join(sorted(match.groups()))} are exchanged"
        said.append(text)
    return list(dict.fromkeys(said))


def _said(says: str, side: str, sheet: Sheet, stems: Array, groups: set[int]) -> str:
    """A relation of some quantities, in words."""
    names: dict[str, set[str]] = {}
    for n in sorted(groups):
        law, name = str(stems[n]).split(" ", 1)
        names.setdefault(name, set()).add(law)
    asked: dict[str, set[str]] = {}
    for stem in stems.tolist():
        law, name = stem.split(" ", 1)
        asked.setdefault(name, set()).add(law)
    laws = {law for name in names for law in names[name] if names[name] != asked[name]}
    under = f" under the {' and '.join(sorted(laws))} law" if laws else ""
    listed = list(names)
    for name in [name[:-3] for name in names if name.endswith("_re")]:
        if f"{name}_im" in names:
            listed = [name if one == f"{name}_re" else one for one in listed if one != f"{name}_im"]
    for kind in ("h", "residual"):
        orders = [name for name in asked if name.startswith(f"{kind}_")]
        if orders and len(orders) - 1 <= sum(name in names for name in orders) > 2:
            listed = [*(name for name in listed if name not in orders), f"{kind}_n"]
    if len(listed) > 3 and len(listed) == len(asked):
        listed = ["all answers"]
    several = len(listed) > 1 or listed == ["all answers"]
    text = ", ".join(listed[:-1]) + " and " + listed[-1] if len(listed) > 1 else listed[0]
    verbs = {"has": "have" if several else "has", "is": "are" if several else "is"}
    return says.format(q=text, **verbs) + under + (f" {side}" if side else "")
