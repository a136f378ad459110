"""Relations between wrong answers and right ones that no change of a program makes: a unit, a place, another question.

A relation predicts an answer from right values alone. It is a cause if every wrong answer is as predicted, and no right
one speaks against it; different quantities may need different relations.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import permutations, product
from typing import NamedTuple

import numpy as np

from tippedisk_verify.conformance.engine.entries import Array, Sheet
from tippedisk_verify.conformance.engine.places import conditions, inputs, labels, names_of
from tippedisk_verify.model.parameters import SYMBOLS

__all__ = ["Cause", "related"]

_COVERED = 0.4  # of a quantity's wrong answers must have a counterpart, where the relation is to another question
_FREE = 3  # wrong answers of different entries that bear out a number that was read off them
_SIDE = 4  # wrong answers that bear out a condition
_EVIDENCE = 6.0  # digits that a relation explains in all, so that it fits by no accident
_SURE = 1e-4  # of what is allowed: closer answers tell no more
_STATEMENTS = 3  # different relations; more are several mistakes
_CONDITION = 5  # rank of a condition
_AT_STATES = 5  # the last level whose inputs are those of the formula
_TRIED = 3  # answers that a number is read off
_LONG = 3.5  # powers that are as simple as a number of many digits
_LAWS = ("both", "linear", "smooth")
_Function = Callable[[Array], Array]
_OfTwo = Callable[[Array, Array], Array]


@dataclass(frozen=True, eq=False)
class Cause:
    """What wrong answers are instead of right."""

    name: str  #: a short word for the kind of relation
    says: str
    cells: Array  #: which answers of the sheet it explains
    rank: int  #: lower is simpler


class _Relation(NamedTuple):
    """``says`` has {q} for the quantities, and {has}, {is} for verbs; or one text for each quantity of the sheet."""

    name: str
    rank: int
    says: str | Sequence[str]
    predicted: Array  #: over the answers; NaN where there is nothing to compare with
    digits: float = 0.0  #: beyond those that are asked for, which the answers must agree in


_PI = math.pi
_FACTORS = {
    "2": 2.0, "3": 3.0, "4": 4.0, "6": 6.0, "8": 8.0, "3/2": 1.5, "4/3": 4 / 3, "pi": _PI, "2 pi": 2 * _PI,
    "180/pi (degrees)": 180 / _PI, "30/pi (turns per minute)": 30 / _PI, "60": 60.0, "sqrt 2": math.sqrt(2),
    "ln 10": math.log(10), "ln 2": math.log(2), "1000": 1e3, **{f"10^{k}": 10.0**k for k in range(1, 13) if k != 3},
}  # fmt: skip
_FACTORS |= {f"1/({text})" if " " in text else f"1/{text}": 1 / factor for text, factor in _FACTORS.items()}
_FACTORS |= {"-2": -2.0, "-1/2": -0.5}
#: Numbers beside a product of powers: value, and how many powers are as simple as it.
_SHORT = {f"{k / 10:g}": (k / 10, 1.5) for k in range(1, 100)} | {text: (x, 0.6) for text, x in _FACTORS.items()}
_SHORT["1"] = (1.0, 0.0)
_OFFSETS = {"pi/2": _PI / 2, "pi": _PI, "2 pi": 2 * _PI, "1": 1.0}
_PLAIN: dict[str, _Function] = {
    "the modulus of the right value": np.abs, "minus the modulus of the right value": lambda x: -np.abs(x),
    "zero": lambda x: 0 * x, "one": lambda x: 0 * x + 1,
    "rounded to single precision": lambda x: x.astype("f4").astype("f8"),
}  # fmt: skip
_OF_VALUE: dict[str, _Function] = {
    "square": np.square, "square root": lambda x: np.sign(x) * np.sqrt(np.abs(x)), "reciprocal": lambda x: 1 / x,
    "logarithm": lambda x: np.log(np.abs(x)), "common logarithm": lambda x: np.log10(np.abs(x)),
    "exponential": np.exp, "sine": np.sin, "cosine": np.cos, "tangent": np.tan,
    "reciprocal times 2 pi": lambda x: 2 * _PI / x,
}  # fmt: skip
_ANGLES = ("beta", "gamma", "crossing_gamma", "gamma_bar_0", "beta_max", "beta_bar_0", "beta_bar_top")
_OF_ANGLE: dict[str, _Function] = {
    "[0, 2 pi)": lambda x: x % (2 * _PI), "(-pi, pi]": lambda x: _PI - (_PI - x) % (2 * _PI),
    "[-pi/2, pi/2]": lambda x: np.arcsin(np.sin(x)), "[0, pi]": lambda x: np.arccos(np.cos(x)),
}  # fmt: skip
_OF_ORDER: dict[str, _OfTwo] = {
    "n! (a factorial)": lambda n, _: np.vectorize(math.gamma)(n + 1.0), "epsilon^n": lambda n, epsilon: epsilon**n,
    "1/n!": lambda n, _: 1 / np.vectorize(math.gamma)(n + 1.0), "epsilon^-n": lambda n, epsilon: epsilon**-n,
    "(-1)^n": lambda n, _: (-1.0) ** n,
}  # fmt: skip
_OF_TWO: dict[str, _OfTwo] = {  # x the right value, y another one
    "{has} the values of {y}": lambda x, y: y, "{has} the values of {y} with the wrong sign": lambda x, y: -y,
    "{is} twice {y}": lambda x, y: 2 * y, "{is} half of {y}": lambda x, y: y / 2,
    "{is} the right value plus {y}": lambda x, y: x + y, "{is} the right value minus {y}": lambda x, y: x - y,
    "{is} {y} minus the right value": lambda x, y: y - x, "{is} the right value times {y}": lambda x, y: x * y,
    "{is} the right value divided by {y}": lambda x, y: x / y,
    "{is} {y} divided by the right value": lambda x, y: y / x,
    "{is} the modulus of the right value and {y}": np.hypot, "{is} the reciprocal of {y}": lambda x, y: 1 / y,
    "{is} the right value to the power 1/{y}": lambda x, y: np.abs(x) ** (1 / y),
    "{is} the exponential of {y}": lambda x, y: np.exp(y), "{is} 2 pi divided by {y}": lambda x, y: 2 * _PI / y,
    "{is} the logarithm of {y}": lambda x, y: np.log(np.abs(y)),
}  # fmt: skip
_SHARES = {1.0: "", -1.0: "minus ", 2.0: "twice ", -2.0: "minus twice ", 0.5: "half of ", -0.5: "minus half of "}
_LOGARITHMS = ("log_multiplier_slow", "log_multiplier_fast")
_PARTNERS = {
    "equilibrium": ("inverted-", "noninverted-"), "form": ("printed-", "consistent-"),
    "cycle, stable and unstable exchanged": ("stable-", "unstable-"),
}  # fmt: skip
#: Keys that sort eigenvalues; equal ones go by the sign of the imaginary part.
_ORDERS: dict[str, _Function] = {
    "real parts": lambda z: z.real, "moduli": np.abs, "imaginary parts": lambda z: z.imag,
    "moduli of the imaginary parts": lambda z: np.abs(z.imag),
}  # fmt: skip


class _Grid:
    """The right values by entry, law, quantity and place, so that other questions' are found by index."""

    def __init__(self, sheet: Sheet) -> None:
        self.sheet, self.x = sheet, sheet.truth
        self.names, self.given = names_of(sheet), inputs(sheet)
        self.p = np.concatenate([np.array(table.p)[:, table.rows] for table in sheet.tables], axis=1)
        named = labels(sheet)
        keys = np.char.add(np.char.add(named["parameter set"], "/"), named["entry"])
        self.keys, self.base = np.unique(keys, return_inverse=True)
        self.law = np.array([_LAWS.index(law) for law in named["law"]])
        self.sets, self.set = np.unique(named["parameter set"], return_inverse=True)
        order, t = self.given["order"], self.given["t"]
        plain = [name.rsplit("_", 1)[0] if n >= 0 else name for name, n in zip(self.names, order, strict=True)]
        self.stems, self.stem = np.unique(plain, return_inverse=True)
        self.times = np.unique(t[t >= 0])
        place = np.where(t >= 0, np.searchsorted(self.times, t), np.where(order >= 0, order, self.given["n"] - 1))
        self.place = np.nan_to_num(place).astype(int)
        # One more of each, which stays empty, for what there is not.
        shape = (len(self.keys) + 1, len(_LAWS) + 1, len(self.stems) + 1, self.place.max() + 2)
        self.values = np.full(shape, np.nan)
        self.values[self.base, self.law, self.stem, self.place] = self.x

        p = dict(zip(SYMBOLS, self.p, strict=True))
        self.bases = {**p, "Bbar": p["B"] - p["m"] * p["e"] ** 2, "(r + e)": p["r"] + p["e"]}
        if sheet.level <= _AT_STATES:
            self.bases |= {name: self.given[name] for name in ("Omega", "v")}
            for name, angle in ((name, self.given[name]) for name in ("beta", "gamma")):
                self.bases |= {f"sin({name})": np.sin(angle), f"cos({name})": np.cos(angle)}
        with np.errstate(all="ignore"):
            self.logs = np.log(np.abs(list(self.bases.values())))

    def at(self, **moved: Array | int) -> Array:
        """The right values where some indices are others; indices out of range find nothing."""
        where = []
        for name, size in zip(("base", "law", "stem", "place"), self.values.shape, strict=True):
            index = np.asarray(moved.get(name, getattr(self, name)))
            where.append(np.where((index >= 0) & (index < size), index, size - 1))
        found: Array = self.values[tuple(where)]
        return found

    def other(self, stem: int) -> Array:
        """The right values of another quantity at the same place; some are common to both laws."""
        found = self.at(stem=stem)
        for moved in ({"law": 0}, {"law": 1}, {"law": 2}, {"place": 0}):
            found = np.where(np.isnan(found), self.at(**{"stem": stem, **moved}), found)
        return found

    def renamed(self, rename: Callable[[str], str]) -> Array:
        """For each answer the index of another entry."""
        index = {key: n for n, key in enumerate(self.keys.tolist())}
        return np.array([index.get(rename(key), -1) for key in index])[self.base]


def _relations(grid: _Grid) -> Iterator[_Relation]:
    x, order, epsilon = grid.x, grid.given["order"], grid.p[SYMBOLS.index("epsilon")]
    yield _Relation("sign", 0, "{q} {has} the wrong sign", -x)
    for text, of in _PLAIN.items():
        yield _Relation("function", 1, f"{{q}} {{is}} {text}", of(x))
    for text, of in _OF_VALUE.items():
        yield _Relation("function", 3, f"{{q}} {{is}} the {text} of the right value", of(x))
    for text, offset in _OFFSETS.items():
        yield _Relation("complement", 3, f"{{q}} {{is}} {text} minus the right value", offset - x)
    for text, factor in _FACTORS.items():
        yield _Relation("factor", 1, f"{{q}} {{has}} the factor {text}", factor * x)
    for (text, offset), (word, sign) in product(_OFFSETS.items(), {"large": 1, "small": -1}.items()):
        yield _Relation("offset", 2, f"{{q}} {{is}} {text} too {word}", x + sign * offset)
    angle = np.where(np.isin(grid.names, _ANGLES), x, np.nan)
    for text, of in _OF_ANGLE.items():
        yield _Relation("turns", 2, f"{{q}} {{is}} reduced to {text}", of(angle))
    turns = 2 * _PI * np.round((grid.sheet.answer - x) / (2 * _PI))
    yield _Relation("turns", 3, "{q} {is} off by whole turns", angle + turns)
    for text, weight in _OF_ORDER.items() if np.isfinite(order).any() else ():
        yield _Relation("weight", 3, f"{{q}} {{has}} the factor {text}", weight(order, epsilon) * x)
    for text, share in {"epsilon^k times": epsilon, "": np.ones_like(epsilon)}.items():
        terms = [np.where(order >= k, share**k * grid.at(place=k), 0 * order) for k in range(grid.values.shape[-1] - 1)]
        yield _Relation("sums", 3, f"{{q}} {{is}} the sum of {text} all orders so far", np.sum(terms, axis=0))
    yield from (*_places(grid), *_entries(grid), *_quantities(grid), *_orders(grid), *_rounded(grid))


def _places(grid: _Grid) -> Iterator[_Relation]:
    """Another sample, crossing or order of the same entry."""
    place, t = grid.place, grid.given["t"]
    for key, word in {"t": "sample in time", "n": "crossing", "order": "order"}.items():
        x = np.where(np.isfinite(grid.given[key]), grid.x, np.nan)
        moves = {"next": place + 1, "previous": place - 1, "next but one": place + 2, "last but one": place - 2}
        moves |= {"first": 0 * place}
        if key == "n":
            moves |= {"every second": 2 * place + 1, "every odd": 2 * place, **_one_way(grid)}
        for text, share in {"at half the time": 0.5, "at twice the time": 2.0}.items() if key == "t" else ():
            index = np.searchsorted(grid.times, share * t - 1e-9)
            hit = np.abs(np.append(grid.times, np.inf)[index] - share * t) < 1e-9
            moves[text] = np.where(hit, index, -1)
        for text, index in moves.items() if np.isfinite(x).any() else ():
            says = f"{{q}} {{has}} the values of the {word} {text}" if "at" in text else ""
            says = says or f"{{q}} {{has}} the values of {'' if 'every' in text else 'the '}{text} {word}"
            yield _Relation("place", 3, says, grid.at(place=index) + 0 * x)
        before = np.where(place > 0, grid.at(place=place - 1), 0.0)
        yield _Relation("interval", 4, f"{{q}} {{is}} counted from the previous {word}", x - before)
        yield _Relation("interval", 4, f"{{q}} {{is}} counted from the first {word}", x - grid.at(place=0))


def _one_way(grid: _Grid) -> dict[str, Array]:
    """The places of the crossings in one direction."""
    speeds = grid.values[:, :, int(np.searchsorted(grid.stems, "crossing_v"))]
    found = {}
    for text, sign in {"every upward": 1, "every downward": -1}.items():
        kept = sign * speeds > 0
        listed = np.argsort(~kept, axis=-1, kind="stable")
        listed[np.arange(kept.shape[-1]) >= kept.sum(axis=-1, keepdims=True)] = -1
        found[text] = listed[grid.base, grid.law, grid.place]
    return found


def _entries(grid: _Grid) -> Iterator[_Relation]:
    """The same quantity of another entry."""
    listed = list(dict.fromkeys(grid.keys[grid.base].tolist()))  # as the sheet has them
    kinds = [key.rsplit("/", 1)[0] for key in listed]
    moves: dict[str, Callable[[str], str]] = {}
    for text, (one, two) in _PARTNERS.items():
        other = {f"/{one}": f"/{two}", f"/{two}": f"/{one}"}
        pattern = f"/{one}|/{two}"
        moves[f"the other {text}"] = lambda key, to=other, of=pattern: re.sub(of, lambda m: to[m[0]], key)  # type: ignore[misc]
    for text, by in {"next": 1, "previous": -1, "next but one": 2, "last but one": -2}.items():
        pairs = zip(listed, kinds, range(by, len(listed) + by), strict=True)
        near = {key: listed[n] for key, kind, n in pairs if 0 <= n < len(listed) and kinds[n] == kind}
        moves[f"the {text} entry"] = lambda key, near=near: near.get(key, "")  # type: ignore[misc]
    moves["the first entry"] = lambda key: listed[kinds.index(key.rsplit("/", 1)[0])]
    for name in grid.sets if len(grid.sets) > 1 else ():
        moves[f"the parameter set {name}"] = lambda key, name=name: f"{name}/{key.split('/', 1)[1]}"  # type: ignore[misc]
    for text, rename in moves.items():
        yield _Relation("entry", 3, f"{{q}} {{has}} the values of {text}", grid.at(base=grid.renamed(rename)))
    for text, law in {"linear law": 1, "smooth law": 2, "other law": 3 - grid.law}.items():
        yield _Relation(
            "law", 3, f"{{q}} {{has}} the values of the {text}", np.where(grid.law, grid.at(law=law), np.nan)
        )
    for word, by in {"below": 1, "above": -1}.items():
        rows = np.concatenate([np.roll(np.append(table.truth, np.nan), -by)[:-1] for table in grid.sheet.tables])
        yield _Relation("row", 4, f"{{q}} {{has}} the values of the row {word}", rows)


def _quantities(grid: _Grid) -> Iterator[_Relation]:
    """What is made of another quantity of the same entry, or of an input."""
    others = {str(stem): grid.other(n) for n, stem in enumerate(grid.stems)}
    for stem in [stem[:-3] for stem in others if f"{stem[:-3]}_im" in others and stem.endswith("_re")]:
        real, imaginary = (np.char.endswith(grid.names, part) for part in ("_re", "_im"))
        parts = [others[f"{stem}_re"], others[f"{stem}_im"]]
        others = {stem: np.select([real, imaginary], parts, np.nan), **others}
    others |= {f"the input {name}": grid.given[name] for name in ("Omega", "beta", "gamma", "v", "t")}
    others |= {f"the parameter {name}": grid.p[n] for n, name in enumerate(SYMBOLS)}
    for name, y in others.items():
        y = np.where((grid.names == name) | ~np.isfinite(y), np.nan, y)
        for text, of in _OF_TWO.items() if np.isfinite(y).any() else ():
            rank = 2 if text.endswith("values of {y}") else 4
            yield _Relation("quantity", rank, f"{{q}} {text.replace('{y}', name)}", of(grid.x, y))
    if set(_LOGARITHMS) <= set(others):
        slow, fast = (np.where(np.isin(grid.names, _LOGARITHMS), others[name], np.nan) for name in _LOGARITHMS)
        for (a, one), (b, two) in product(_SHARES.items(), _SHARES.items()):
            says = f"{{q}} {{is}} {one}{_LOGARITHMS[0]} plus {two}{_LOGARITHMS[1]}"
            yield _Relation("sum", 5, says, a * slow + b * fast)


def _orders(grid: _Grid) -> Iterator[_Relation]:
    """The right eigenvalues in another order."""
    real, imaginary = (
        [n for n, stem in enumerate(grid.stems) if re.fullmatch(f"lambda_._{part}", stem)] for part in ("re", "im")
    )
    if not real or len(real) != len(imaginary):
        return
    z = grid.values[:, 0, real, 0] + 1j * grid.values[:, 0, imaginary, 0]
    own = np.array([int(name[7]) - 1 for name in grid.names]) % len(real)

    def answers(places: Array) -> Array:
        picked = z[grid.base, places[grid.base, own]]
        return np.where(np.char.endswith(grid.names, "_im"), picked.imag, picked.real)

    for (text, key), up, first in product(_ORDERS.items(), (1, -1), (-1, 1)):
        places = np.lexsort((first * z.imag, np.round(up * key(z), 7)), axis=1)
        says = f"the eigenvalues in another order: {'ascending' if up > 0 else 'descending'} {text}"
        also = f", the {'positive' if first < 0 else 'negative'} imaginary part first"
        yield _Relation("order", 2, says if text == "imaginary parts" else says + also, answers(places))
    orders = np.array([np.broadcast_to(one, z.shape) for one in permutations(range(len(real)))])
    bad = [np.bincount(grid.base[~grid.sheet.fitted(answers(places))], minlength=len(z)) for places in orders]
    best = orders[np.argmin(bad, axis=0), np.arange(len(z))]
    yield _Relation("order", 4, "the eigenvalues not sorted: their order differs from entry to entry", answers(best))


def _rounded(grid: _Grid) -> Iterator[_Relation]:
    """Answers with few digits: whole multiples of a unit, within half of it or the whole one of the right values."""
    x, answer, allowed = grid.x, grid.sheet.answer, grid.sheet.allowed
    size = np.floor(np.log10(np.where(x == 0, 1.0, np.abs(x)))) + 1
    for d, (word, share) in product(range(1, 13), {"decimal": 0, "significant digit": 1}.items()):
        unit = 10.0 ** (size * share - d)
        whole = np.abs(answer - unit * np.round(answer / unit)) < 1e-6 * unit + 1e-15 * np.abs(x)
        shorter = np.abs(answer) <= np.abs(x) + allowed
        for rank, text, most, known in ((1, "rounded", 0.5001, True), (2, "truncated", 1.0001, shorter)):
            fits = whole & known & (np.abs(answer - x) < most * unit + allowed)
            says = f"{{q}} {{is}} {text} to {d} {word}{'s' * (d > 1)}"
            yield _Relation("rounded", rank, says, np.where(fits, answer, x))


# ------------------------------------------------------------------------------------------ numbers solved for
def _solved(grid: _Grid, group: Array) -> Iterator[_Relation]:
    """One number for all, and a factor or a summand that is a number times powers of the inputs."""
    answer, x, groups = grid.sheet.answer, grid.x, range(group.max() + 1)
    entries = np.unique(np.stack([group, grid.base])[:, grid.sheet.wrong], axis=1)[0]
    several = np.bincount(entries, minlength=len(groups))[group] >= _FREE
    middle = np.array([np.median(answer[group == n]) for n in groups])
    says = [f"{{q}} {{is}} {number:.9g} throughout" for number in middle]
    yield _Relation("constant", 2, says, np.where(several, middle[group], np.nan))
    for word, start, unit in (("factor", 0.0, x), ("summand", 1.0, np.ones_like(x))):
        ratio = (answer - start * x) / unit
        usable = grid.sheet.wrong & several & np.isfinite(ratio) & (ratio != 0)
        found = [_power_law(grid, np.flatnonzero(usable & (group == n)), ratio) for n in groups]
        share = np.array([law for _, law in found])[group, np.arange(len(x))]
        says = [f"{{q}} {{has}} the {word} {text}" for text, _ in found]
        yield _Relation(word, 4, says, start * x + share * unit, digits=2.0)


@cache
def _exponents(count: int) -> Array:
    """Of so many bases all whole powers up to three in all, and half of them; the simplest first."""
    units = np.concatenate([np.eye(count), -np.eye(count)])
    whole = np.zeros((1, count))
    for _ in range(3):
        whole = np.unique(np.concatenate([whole, *(whole + unit for unit in units)]), axis=0)
    whole = whole[np.lexsort((-whole.min(axis=1), np.abs(whole).sum(axis=1)))]
    return np.concatenate([whole, whole[1:] / 2])


def _power_law(grid: _Grid, cells: Array, ratio: Array) -> tuple[str, Array]:
    """The simplest number times powers that a ratio is at some answers: in words, and at all answers."""
    if len(cells) < _FREE:
        return "", np.full(len(ratio), np.nan)
    some = cells[:: max(1, len(cells) // _TRIED)]  # the others have to bear it out
    here = grid.logs[:, some]
    here = np.where(np.isfinite(here), here, 1e6 * np.arange(len(some)))  # so that no power of what is not there fits
    exponents = _exponents(len(here))
    left = np.log(np.abs(ratio[some]))[:, None] - np.einsum("bc,eb->ce", here, exponents)  # no threads
    close = np.clip(np.median(grid.sheet.allowed[some] / np.abs(ratio * grid.x)[some]), 1e-11, 1e-7)
    fits = np.flatnonzero(np.ptp(left, axis=0) < close)
    if not len(fits):
        return "", np.full(len(ratio), np.nan)
    sizes = np.exp(left[:, fits].mean(axis=0)).tolist()
    numbers = [
        next(
            ((text, cost) for text, (one, cost) in _SHORT.items() if abs(one / size - 1) < close),
            (f"{size:.9g}", _LONG),
        )
        for size in sizes
    ]
    best = int(np.argmin(np.abs(exponents[fits]).sum(axis=1) + [cost for _, cost in numbers]))
    powers = exponents[fits[best]]
    law = np.ones_like(ratio)
    for base, k in zip(grid.bases.values(), powers.tolist(), strict=True):
        law = law * (base if k % 1 == 0 else np.abs(base)) ** k
    sign = np.sign((ratio * law)[some[0]])
    words = [name if k == 1 else f"{name}^{k:g}" for name, k in zip(grid.bases, powers, strict=True) if k]
    words = words if words and numbers[best][0] == "1" else [numbers[best][0], *words]
    return ("-" if sign < 0 else "") + " ".join(words), sign * sizes[best] * law


# ------------------------------------------------------------------------------------------ what fits
def related(sheet: Sheet) -> list[Cause]:
    """The relations that give all wrong answers of a sheet, simplest first."""
    if not sheet.wrong.any():
        return []
    stems, group = np.unique(sheet.stems, return_inverse=True)
    grid, sides = _Grid(sheet), list(conditions(sheet))

    def count(some: Array, weights: Array | None = None) -> Array:
        return np.bincount(group[some], None if weights is None else weights[some], len(stems))

    found: dict[str, Cause] = {}
    with np.errstate(all="ignore"):
        for relation in (*_relations(grid), *_solved(grid, group)):
            known = np.isfinite(relation.predicted)
            fits = sheet.fitted(relation.predicted, relation.digits) & known
            mine, against = fits & sheet.wrong, known & ~fits
            away = np.maximum(np.abs(sheet.answer - relation.predicted), _SURE * sheet.allowed)
            told = count(mine, np.log10(np.abs(sheet.answer - sheet.truth) / away))
            wrong, explained = count(sheet.wrong), count(mine)
            enough = (explained == wrong) | ((explained >= _COVERED * wrong) & (explained >= _FREE))
            good = enough & (told > _EVIDENCE) & (count(against & sheet.wrong) == 0)
            for n in np.flatnonzero(good).tolist():
                side = _side(sheet, sides, group == n, against)
                if side is not None:
                    says = (relation.says if isinstance(relation.says, str) else relation.says[n]) + side
                    rank = relation.rank + _CONDITION * bool(side)
                    found.setdefault(says, Cause(relation.name, says, np.zeros_like(mine), rank))
                    found[says].cells[mine & (group == n)] = True
    return _joined(sheet, sorted(found.values(), key=lambda cause: cause.rank))


def _side(sheet: Sheet, sides: Sequence[tuple[str, Array]], here: Array, against: Array) -> str | None:
    """The first condition that holds where a quantity's answers are wrong, and not where they speak against it."""
    if not (here & against).any():
        return ""
    for text, mask in sides if (here & sheet.wrong).sum() >= _SIDE else ():
        if not (here & mask & against).any() and not (here & ~mask & sheet.wrong).any():
            return f" {text}"
    return None


def _joined(sheet: Sheet, found: Sequence[Cause]) -> list[Cause]:
    """Relations that hold for all wrong quantities, or the simplest one for each."""
    blamed = set(sheet.stems[sheet.wrong])
    whole = [cause for cause in found if blamed == set(sheet.stems[cause.cells])]
    if whole:
        return [replace(cause, says=_said(sheet, cause.says, blamed)) for cause in whole]
    parts: list[tuple[Cause, set[str]]] = []
    for cause in found:
        mine = blamed & set(sheet.stems[cause.cells])
        parts += [(cause, mine)] if mine else []
        blamed -= mine
    texts = _exchanges([_said(sheet, cause.says, mine) for cause, mine in parts])
    if blamed or len(texts) > _STATEMENTS:
        return []
    cells = np.any([cause.cells & np.isin(sheet.stems, list(mine)) for cause, mine in parts], axis=0)
    rank = max(cause.rank for cause, _ in parts) + len(texts) - 1
    return [Cause("-".join(dict.fromkeys(cause.name for cause, _ in parts)), "; ".join(texts), cells, rank)]


def _exchanges(texts: Sequence[str]) -> list[str]:
    """Two quantities that have each other's values are exchanged."""
    pairs = re.findall(r"^((\w+) ha(?:s|ve) the values of (\w+))$", "\n".join(texts), re.M)
    taken = {(one, two) for _, one, two in pairs}
    said = {text: " and ".join(sorted((one, two))) for text, one, two in pairs if (two, one) in taken}
    return list(dict.fromkeys(f"{said[text]} are exchanged" if text in said else text for text in texts))


def _said(sheet: Sheet, says: str, stems: set[str]) -> str:
    """A relation of some quantities, in words."""
    asked = set(sheet.stems)
    laws, names = zip(*(stem.split(" ", 1) for stem in sorted(stems)), strict=True)
    under = {f"{law} {name}" for law in _LAWS for name in names} & asked != stems
    listed = list(dict.fromkeys(names))
    for whole, kind, least in ((r"\1", r"(lambda_\w+)_(re|im)", 2), (r"\1_n", r"(h|residual)_\d+", 3)):
        parts = [re.sub(f"^{kind}$", whole, name) for name in listed]
        listed = list(
            dict.fromkeys(
                part if parts.count(part) >= least else name for part, name in zip(parts, listed, strict=True)
            )
        )
    verbs = {"has": "have", "is": "are"} if len(listed) > 1 else {"has": "has", "is": "is"}
    text = " and ".join(text for text in (", ".join(listed[:-1]), listed[-1]) if text)
    text = "all answers" if stems == asked and len(stems) > _STATEMENTS else text
    return says.format(q=text, **verbs) + (f" under the {' and '.join(sorted(set(laws)))} law" if under else "")
