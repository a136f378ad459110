"""Relations between wrong answers and right ones that no change of a program makes: a unit, a place, another question.

A relation predicts an answer from right values alone. It is a cause if every wrong answer is as predicted, and no right
one speaks against it; different quantities may need different relations.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
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
    """One number for all, and a factor or a summand that is a constant times powers of the inputs."""
    answer, x, count = grid.sheet.answer, grid.x, group.max() + 1
    pairs = np.unique(np.stack([group, grid.base])[:, grid.sheet.wrong], axis=1)[0]
    several = np.bincount(pairs, minlength=count)[group] >= _FREE
    middle = np.array([np.median(answer[group == n]) for n in range(count)])
    says = [f"{{q}} {{is}} {one:.9g} throughout" for one in middle]
    yield _Relation("constant", 2, says, np.where(several, middle[group], np.nan))
    bases = {name: grid.given[name] for name in ("Omega", "v")}
    for name, angle in ((name, grid.given[name]) for name in ("beta", "gamma")):
        bases |= {f"sin({name})": np.sin(angle), f"cos({name})": np.cos(angle)}
    for rank, some in ((4, {}), (6, bases)) if grid.sheet.level <= _AT_STATES else ((4, {}),):
        for word, start, unit in (("factor", 0.0, x), ("summand", 1.0, np.ones_like(x))):
            texts, share = [""] * count, np.full(len(x), np.nan)
            ratio = (answer - start * x) / unit
            usable = grid.sheet.wrong & several & np.isfinite(ratio) & (ratio != 0)
            for n in range(count):
                cells = np.flatnonzero(usable & (group == n))
                found = _power_law(grid, cells, ratio, some) if len(cells) >= _FREE else None
                if found is not None:
                    texts[n], share = found[0], np.where(group == n, found[1], share)
            says = [f"{{q}} {{has}} the {word} {text}" for text in texts]
            yield _Relation(word, rank, says, start * x + share * unit, digits=2.0)


def _power_law(grid: _Grid, cells: Array, ratio: Array, bases: Mapping[str, Array]) -> tuple[str, Array] | None:
    """A constant for each parameter set times powers, as a ratio is at some answers: in words, and at all answers."""
    varied = {name: base for name, base in bases.items() if (base[cells] != 0).all() and np.ptp(np.abs(base[cells]))}
    varied = {name: base for name, base in varied.items() if np.isfinite(base[cells]).all()}
    sets = np.unique(grid.set[cells])
    if len(cells) < len(varied) + len(sets) + 2 * bool(varied) or (bases and not varied):
        return None
    columns = [np.log(np.abs(base[cells])) for base in varied.values()] + [grid.set[cells] == one for one in sets]
    powers = np.linalg.lstsq(np.array(columns, dtype=float).T, np.log(np.abs(ratio[cells])), rcond=None)[0]
    powers = np.round(2 * powers[: len(varied)]) / 2
    if np.abs(powers).sum() > 3 or (bases and not powers.any()):
        return None
    law = np.ones_like(ratio)
    for base, power in zip(varied.values(), powers.tolist(), strict=True):
        law = law * (base if power % 1 == 0 else np.abs(base)) ** power
    numbers = np.full(len(grid.sets), np.nan)
    numbers[sets] = [np.median((ratio / law)[cells[grid.set[cells] == one]]) for one in sets]
    loose = np.median(grid.sheet.allowed[cells] / np.abs(ratio * grid.x)[cells])
    places = [cells[grid.set[cells] == one][0] for one in sets]
    text = _named(grid.p[:, places], numbers[sets], float(np.clip(loose, 1e-11, 1e-7)))
    if text is None or (not powers.any() and text in ("1", "-1")):
        return None
    words = [text.removesuffix("1") if text in ("1", "-1") else text, *_powers(tuple(varied), powers.tolist())]
    return " ".join(words).strip(), numbers[grid.set] * law


def _powers(names: Sequence[str], powers: Sequence[float]) -> list[str]:
    return [name if k == 1 else f"{name}^{k:g}" for name, k in zip(names, powers, strict=True) if k]


@cache
def _products() -> tuple[Array, list[str]]:
    """Powers of the parameters, of Bbar and r + e, up to three in all, and their roots."""
    names = (*SYMBOLS, "Bbar", "(r + e)")
    units = [one for n in range(len(names)) for one in (np.eye(len(names))[n], -np.eye(len(names))[n])]
    powers = {tuple(0.0 * units[0])}
    for _ in range(3):
        powers |= {tuple(np.array(one) + unit) for one in powers for unit in units}
    whole = sorted(powers, key=lambda one: (sum(map(abs, one)), -min(one), one))
    listed = np.array([*whole, *np.array(whole) / 2])
    return listed, [" ".join(_powers(names, one)) for one in listed.tolist()]


def _named(p: Array, numbers: Array, close: float) -> str | None:
    """A number for each set in words: itself if it is the same and short, a product of parameters, or itself."""
    plain = f"{numbers[0]:.9g}" if (np.abs(numbers / numbers[0] - 1) < close).all() else None
    if plain is not None and abs(float(f"{numbers[0]:.3g}") / numbers[0] - 1) < close:
        return plain  # round parameters have round products
    exponents, words = _products()
    r, e, m, _, B = p[:5]
    logs = exponents @ np.log(np.array([*p, B - m * e**2, r + e]))
    for text, factor in {
        "": 1.0,
        "2 ": 2.0,
        "1/2 ": 0.5,
        "4 ": 4.0,
        "1/4 ": 0.25,
        "pi ": _PI,
        "2 pi ": 2 * _PI,
    }.items():
        hit = np.flatnonzero((np.abs(np.log(np.abs(numbers) / factor) - logs) < close).all(axis=1))
        if len(hit):
            return "-" * int(numbers[0] < 0) + text + words[hit[0]]
    return plain


# ------------------------------------------------------------------------------------------ what fits
_Found = dict[tuple[str, str], Cause]  #: by what is said and under which condition


def related(sheet: Sheet) -> list[Cause]:
    """The relations that give all wrong answers of a sheet, simplest first."""
    if not sheet.wrong.any():
        return []
    grid, (stems, group) = _Grid(sheet), np.unique(sheet.stems, return_inverse=True)
    wrong = np.bincount(group[sheet.wrong], minlength=len(stems))
    sides, found = list(conditions(sheet)), _Found()
    with np.errstate(all="ignore"):
        for relation in (*_relations(grid), *_solved(grid, group)):
            known = np.isfinite(relation.predicted)
            fits = sheet.fitted(relation.predicted, relation.digits) & known
            mine, against = fits & sheet.wrong, known & ~fits
            away = np.maximum(np.abs(sheet.answer - relation.predicted), _SURE * sheet.allowed)
            told = np.log10(np.abs(sheet.answer - sheet.truth) / away)
            told = np.bincount(group[mine], told[mine], minlength=len(stems))
            explained = np.bincount(group[mine], minlength=len(stems))
            spoken = np.bincount(group[against & sheet.wrong], minlength=len(stems))
            enough = (explained == wrong) | ((explained >= _COVERED * wrong) & (explained >= _FREE))
            for n in np.flatnonzero((wrong > 0) & (spoken == 0) & enough & (told > _EVIDENCE)).tolist():
                side = _side(sheet, sides, group == n, against)
                if side is not None:
                    says = relation.says if isinstance(relation.says, str) else relation.says[n]
                    rank = relation.rank + _CONDITION * bool(side)
                    new = Cause(relation.name, says, np.zeros_like(mine), rank)
                    found.setdefault((says, side), new).cells[mine & (group == n)] = True
    return _causes(sheet, found)


def _side(sheet: Sheet, sides: Sequence[tuple[str, Array]], here: Array, against: Array) -> str | None:
    """The first condition that holds where a quantity's answers are wrong, and not where they speak against it."""
    if not (here & against).any():
        return ""
    for text, mask in sides if (here & sheet.wrong).sum() >= _SIDE else ():
        if not (here & mask & against).any() and not (here & ~mask & sheet.wrong).any():
            return text
    return None


def _causes(sheet: Sheet, found: _Found) -> list[Cause]:
    """Relations that hold for all quantities, or the simplest one for each."""
    blamed = np.unique(sheet.stems[sheet.wrong])
    has = {key: frozenset(np.unique(sheet.stems[cause.cells])) for key, cause in found.items()}
    ranked = sorted(found, key=lambda key: found[key].rank)
    whole = [key for key in ranked if len(has[key]) == len(blamed)]
    if whole:
        return [
            Cause(found[key].name, _said(sheet, *key, has[key]), found[key].cells, found[key].rank) for key in whole
        ]
    chosen: dict[tuple[str, str], set[str]] = {}
    for stem in blamed:
        key = next((key for key in ranked if stem in has[key]), None)
        if key is None:
            return []
        chosen.setdefault(key, set()).add(stem)
    texts = _exchanges([_said(sheet, *key, stems) for key, stems in chosen.items()])
    if len(texts) > _STATEMENTS:
        return []
    cells = np.any([found[key].cells & np.isin(sheet.stems, list(stems)) for key, stems in chosen.items()], axis=0)
    name = "exchanged" if "exchanged" in texts[0] else "-".join(dict.fromkeys(found[key].name for key in chosen))
    return [Cause(name, "; ".join(texts), cells, max(found[key].rank for key in chosen) + len(texts) - 1)]


def _exchanges(texts: Sequence[str]) -> list[str]:
    """Two quantities that have each other's values are exchanged."""
    pairs = dict(re.findall(r"^(\w+) ha(?:s|ve) the values of (\w+)$", "\n".join(texts), re.M))
    pairs = {f"{one} {word} the values of {two}": f"{' and '.join(sorted((one, two)))} are exchanged"
             for one, two in pairs.items() if pairs.get(two) == one for word in ("has", "have")}  # fmt: skip
    return list(dict.fromkeys(pairs.get(text, text) for text in texts))


def _said(sheet: Sheet, says: str, side: str, stems: set[str] | frozenset[str]) -> str:
    """A relation of some quantities, in words."""
    asked = [tuple(stem.split(" ", 1)) for stem in np.unique(sheet.stems).tolist()]
    mine = [(law, name) for law, name in asked if f"{law} {name}" in stems]
    names = list(dict.fromkeys(name for _, name in mine))
    laws = (
        sorted({law for law, _ in mine})
        if any(name in names and (law, name) not in mine for law, name in asked)
        else []
    )
    for whole, kind, least in (("lambda_{}", r"lambda_(\w+)_(?:re|im)", 2), ("{}_n", r"(h|residual)_\d+", 3)):
        found = [re.fullmatch(kind, name) for name in names]
        parts = [match[1] for match in found if match]
        names = list(dict.fromkeys(
            whole.format(match[1]) if match and parts.count(match[1]) >= least else name
            for match, name in zip(found, names, strict=True)
        ))  # fmt: skip
    several = len(names) > 1
    if len(stems) == len(asked) > 3:
        names = ["all answers"]
    listed = " and ".join(text for text in (", ".join(names[:-1]), names[-1]) if text)
    text = says.format(q=listed, has="have" if several else "has", **{"is": "are" if several else "is"})
    return " ".join([text, *(f"under the {law} law" for law in laws), *([side] if side else [])])
