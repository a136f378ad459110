"""Relations between wrong answers and right ones that no change of a program makes: a unit, a place, another question.

A relation predicts an answer from right values alone. It is a cause if every wrong answer is as predicted, and no right
one speaks against it; different quantities may need different relations.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np

from tippedisk_verify.conformance.diagnosis.entries import Array, Sheet
from tippedisk_verify.conformance.diagnosis.places import conditions, inputs, labels, names_of, parameters
from tippedisk_verify.conformance.diagnosis.trees import Cause

__all__ = ["related"]

_COVERED = 0.4  # of a quantity's wrong answers must have a counterpart, where the relation is to another question
_FEW = 3  # wrong answers that bear out a relation to another question
_STATEMENTS = 3  # different relations; more are several mistakes
_EVIDENCE = 6.0  # digits that a relation explains in all, so that it fits by no accident
_SURE = 1e-4  # of what is allowed: closer answers tell no more
_CONDITION = 5  # rank of a condition
_LAWS = ("both", "linear", "smooth")
_Function = Callable[[Array], Array]


#: Name, rank, what is said (with {q} for the quantities, and {has}, {is} for verbs), and what is predicted for each
#: answer, NaN where there is nothing to compare with.
_Relation = tuple[str, float, str, Array]
_PI = math.pi
_FACTORS = {
    "2": 2.0, "3": 3.0, "4": 4.0, "6": 6.0, "8": 8.0, "3/2": 1.5, "4/3": 4 / 3, "pi": _PI, "2 pi": 2 * _PI,
    "180/pi (degrees)": 180 / _PI, "30/pi (turns per minute)": 30 / _PI, "60": 60.0, "sqrt 2": math.sqrt(2),
    "ln 10": math.log(10), "ln 2": math.log(2), "1000": 1e3,
}  # fmt: skip
_FACTORS |= {f"1/({text})" if " " in text else f"1/{text}": 1 / factor for text, factor in _FACTORS.items()}
_FACTORS |= {"-2": -2.0, "-1/2": -0.5}
_TENS = {f"10^{k}": 10.0**k for k in range(-12, 13) if k not in (0, 3)}
_OFFSETS = {"pi/2": _PI / 2, "pi": _PI, "2 pi": 2 * _PI, "1": 1.0}
_OF_VALUE: dict[tuple[str, int], dict[str, _Function]] = {  # by kind and rank
    ("sign", 0): {"{has} the wrong sign": np.negative},
    ("plain", 1): {
        "{is} the modulus of the right value": np.abs, "{is} zero": np.zeros_like, "{is} one": np.ones_like,
        "{is} minus the modulus of the right value": lambda x: -np.abs(x),
        "{is} rounded to single precision": lambda x: x.astype("f4").astype("f8"),
    },
    ("factor", 1): {f"{{has}} the factor {text}": partial(np.multiply, x) for text, x in _FACTORS.items()},
    ("factor", 2): {f"{{has}} the factor {text}": partial(np.multiply, x) for text, x in _TENS.items()},
    ("offset", 2): {f"{{is}} {text} too large": partial(np.add, x) for text, x in _OFFSETS.items()}
    | {f"{{is}} {text} too small": partial(np.add, -x) for text, x in _OFFSETS.items()},
    ("offset", 3): {f"{{is}} {text} minus the right value": partial(np.subtract, x) for text, x in _OFFSETS.items()},
    ("turns", 3): {
        "{is} reduced to [0, 2 pi)": lambda x: x % (2 * _PI), "{is} reduced to [0, pi]": lambda x: np.arccos(np.cos(x)),
        "{is} reduced to (-pi, pi]": lambda x: _PI - (_PI - x) % (2 * _PI),
        "{is} reduced to [-pi/2, pi/2]": lambda x: np.arcsin(np.sin(x)),
    },
    ("function", 3): {
        f"{{is}} {text} the right value": of
        for text, of in (
            ("the square of", np.square), ("the square root of", lambda x: np.sign(x) * np.sqrt(np.abs(x))),
            ("the logarithm of", lambda x: np.log(np.abs(x))), ("the exponential of", np.exp), ("the sine of", np.sin),
            ("the common logarithm of", lambda x: np.log10(np.abs(x))), ("the reciprocal of", np.reciprocal),
            ("the cosine of", np.cos), ("2 pi divided by", lambda x: 2 * _PI / x), ("the tangent of", np.tan),
        )
    },
}  # fmt: skip
_OF_TWO: dict[str, Callable[[Array, Array], Array]] = {  # x the right value, y another one
    "{has} the values of {y} with the wrong sign": lambda x, y: -y, "{is} twice {y}": lambda x, y: 2 * y,
    "{is} half of {y}": lambda x, y: y / 2, "{is} half of the sum with {y}": lambda x, y: (x + y) / 2,
    "{is} the right value plus {y}": lambda x, y: x + y, "{is} the right value minus {y}": lambda x, y: x - y,
    "{is} {y} minus the right value": lambda x, y: y - x, "{is} the right value times {y}": lambda x, y: x * y,
    "{is} the right value divided by {y}": np.divide, "{is} {y} divided by the right value": lambda x, y: y / x,
    "{is} the right value to the power 1/{y}": lambda x, y: np.abs(x) ** (1 / y),
    "{is} the modulus of the right value and {y}": np.hypot, "{is} the exponential of {y}": lambda x, y: np.exp(y),
}  # fmt: skip
_NEAR = {"next": 1, "previous": -1, "next but one": 2, "last but one": -2}
_OTHER = {"inverted": "noninverted", "printed": "consistent", "stable": "unstable"}
_OTHER |= {two: one for one, two in _OTHER.items()}
_ORDERS: dict[str, _Function] = {
    "real parts": np.real, "moduli": np.abs, "imaginary parts": np.imag,
    "moduli of the imaginary parts": lambda z: np.abs(z.imag),
}  # fmt: skip


class _Grid:
    """The right values by entry, law, quantity and place, so that other questions' are found by index."""

    def __init__(self, sheet: Sheet) -> None:
        self.sheet, self.x = sheet, sheet.truth
        self.names, self.given, named = names_of(sheet), inputs(sheet), labels(sheet)
        keys = np.char.add(np.char.add(named["parameter set"], "/"), named["entry"])
        self.keys, self.base = np.unique(keys, return_inverse=True)
        self.law = np.array([_LAWS.index(law) for law in named["law"]])
        order, t = self.given["order"], self.given["t"]
        plain = [name.rsplit("_", 1)[0] if n >= 0 else name for name, n in zip(self.names, order, strict=True)]
        self.stems, self.stem = np.unique(plain, return_inverse=True)
        place = np.where(t >= 0, np.searchsorted(np.unique(t), t), np.where(order >= 0, order, self.given["n"] - 1))
        self.place = np.nan_to_num(place).astype(int)
        # One more of each, which stays empty, for what there is not.
        shape = (len(self.keys) + 1, len(_LAWS) + 1, len(self.stems) + 1, self.place.max() + 2)
        self.values = np.full(shape, np.nan)
        self.values[self.base, self.law, self.stem, self.place] = self.x
        self.p = parameters(sheet)

    def at(self, **moved: Array | int) -> Array:
        """The right values where some indices are others; indices out of range find nothing."""
        names = ("base", "law", "stem", "place")
        indices = [np.asarray(moved.get(name, getattr(self, name))) for name in names]
        there = zip(indices, self.values.shape, strict=True)
        found: Array = self.values[tuple(np.where((n >= 0) & (n < size), n, size - 1) for n, size in there)]
        return found


def _relations(grid: _Grid) -> Iterator[_Relation]:
    x, order, epsilon = grid.x, grid.given["order"], grid.p["epsilon"]
    for (name, rank), functions in _OF_VALUE.items():
        for text, of in functions.items():
            yield name, rank, f"{{q}} {text}", of(x)
    turns = 2 * _PI * np.round((grid.sheet.answer - x) / (2 * _PI))
    yield "turns", 3, "{q} {is} off by whole turns", x + turns
    for text, share in {"epsilon^k times ": epsilon, "": np.ones_like(epsilon)}.items():
        terms = [np.where(order >= k, share**k * grid.at(place=k), 0 * order) for k in range(grid.values.shape[-1] - 1)]
        yield "sums", 3, f"{{q}} {{is}} the sum of {text}all orders so far", np.sum(terms, axis=0)
    yield "sums", 3, "{q} {has} the factor epsilon^n", epsilon**order * x
    yield from (*_elsewhere(grid), *_quantities(grid), *_orders(grid), *_rounded(grid))


def _elsewhere(grid: _Grid) -> Iterator[_Relation]:
    """The same quantity at another place or law, of another entry, or in another row."""
    place, law = grid.place, grid.law
    for key, word in {"t": "sample in time", "n": "crossing", "order": "order"}.items():
        x = np.where(np.isfinite(grid.given[key]), grid.x, np.nan)
        for text, by in _NEAR.items():
            yield "place", 3, f"{{q}} {{has}} the values of the {text} {word}", grid.at(place=place + by) + 0 * x
        before = np.where(place > 0, grid.at(place=place - 1), 0.0)
        yield "interval", 4, f"{{q}} {{is}} counted from the previous {word}", x - before
    for text, index in (("linear", 0 * law + 1), ("smooth", 0 * law + 2), ("other", 3 - law)):
        yield "law", 3, f"{{q}} {{has}} the values of the {text} law", np.where(law, grid.at(law=index), np.nan)
    listed = list(dict.fromkeys(grid.keys[grid.base].tolist()))  # as the sheet has them
    kinds = [key.rsplit("/", 1)[0] for key in listed]
    word, names = "equilibrium" if grid.sheet.level == 2 else "form", "|".join(_OTHER)
    moves = {f"the other {word}": [re.sub(f"(?<=/)({names})(?=-)", lambda m: _OTHER[m[0]], key) for key in listed]}
    padded = ["", "", *listed, "", ""]
    for text, by in _NEAR.items():
        pairs = zip(padded[2 + by :], kinds, strict=False)
        moves[f"the {text} entry"] = [key if key.startswith(f"{kind}/") else "" for key, kind in pairs]
    numbers = {key: n for n, key in enumerate(grid.keys.tolist())}
    for text, others in moves.items():
        to = dict(zip(listed, others, strict=True))
        base = np.array([numbers.get(to[key], -1) for key in numbers])[grid.base]
        yield "entry", 3, f"{{q}} {{has}} the values of {text}", grid.at(base=base)


def _quantities(grid: _Grid) -> Iterator[_Relation]:
    """What is made of another quantity of the same entry, or of an input."""
    others = {str(stem): grid.at(stem=n) for n, stem in enumerate(grid.stems)}
    for n, stem in enumerate(grid.stems):
        for law in range(len(_LAWS)):  # some quantities are common to both laws
            others[stem] = np.where(np.isnan(others[stem]), grid.at(stem=n, law=law), others[stem])
    others |= {f"the input {name}": grid.given[name] for name in ("Omega", "beta", "gamma", "v", "t")}
    others |= {f"the parameter {name}": values for name, values in grid.p.items()}
    for name, y in others.items():
        y = np.where(grid.stems[grid.stem] == name, np.nan, y)
        yield "quantity", 2, f"{{q}} {{has}} the values of {name}", y
        for text, of in _OF_TWO.items() if np.isfinite(y).any() else ():
            yield "quantity", 4, f"{{q}} {text.replace('{y}', name)}", of(grid.x, y)


def _orders(grid: _Grid) -> Iterator[_Relation]:
    """The right eigenvalues in another order; equal ones, and conjugates, by the sign of the imaginary part."""
    real, imaginary = (np.flatnonzero(np.char.endswith(grid.stems, part)) for part in ("_re", "_im"))
    if not len(real) or len(real) != len(imaginary):
        return
    z = grid.values[:, 0, real, 0] + 1j * grid.values[:, 0, imaginary, 0]
    own = np.array([int(name[7]) - 1 for name in grid.names]) % len(real)

    def answers(places: Array) -> Array:
        picked = z[grid.base, places[grid.base, own]]
        return np.asarray(np.where(np.char.endswith(grid.names, "_im"), picked.imag, picked.real))

    for (text, key), up, first in product(_ORDERS.items(), (1, -1), (-1, 1)):
        places = np.lexsort((first * z.imag, np.round(up * key(z), 7)), axis=1)
        says = f"the eigenvalues in another order: {'ascending' if up > 0 else 'descending'} {text}"
        also = f", the {'positive' if first < 0 else 'negative'} imaginary part first"
        yield "order", 2, says if text == "imaginary parts" else says + also, answers(places)


def _rounded(grid: _Grid) -> Iterator[_Relation]:
    """Answers with few digits: whole multiples of a unit, within half of it or the whole one of the right values."""
    x, answer, allowed = grid.x, grid.sheet.answer, grid.sheet.allowed
    size = np.floor(np.log10(np.where(x == 0, 1.0, np.abs(x)))) + 1
    shorter = np.abs(answer) <= np.abs(x) + allowed
    for d, (word, share) in product(range(1, 13), {"decimal": 0, "significant digit": 1}.items()):
        unit = 10.0 ** (size * share - d)
        whole = np.abs(answer - unit * np.round(answer / unit)) < 1e-6 * unit + 1e-15 * np.abs(x)
        for rank, text, most, known in ((1, "rounded", 0.5001, True), (2, "truncated", 1.0001, shorter)):
            fits = whole & known & (np.abs(answer - x) < most * unit + allowed)
            says = f"{{q}} {{is}} {text} to {d} {word}{'s' * (d > 1)}"
            yield "rounded", rank + d / 100 + share / 1000, says, np.where(fits, answer, x)


@np.errstate(all="ignore")
def related(sheet: Sheet) -> list[Cause]:
    """The relations that give all wrong answers of a sheet, simplest first."""
    if not sheet.wrong.any():
        return []
    grid, found = _Grid(sheet), dict[str, _Found]()
    group = np.unique(sheet.stems, return_inverse=True)[1]
    wrong = np.bincount(group, sheet.wrong)
    sides = [("", np.ones_like(sheet.wrong)), *((f" {text}", mask) for text, mask in conditions(sheet))]
    for name, rank, says, predicted in _relations(grid):
        known = np.isfinite(predicted)
        fits = sheet.fitted(predicted) & known
        mine, against = fits & sheet.wrong, known & ~fits
        away = np.maximum(np.abs(sheet.answer - predicted), _SURE * sheet.allowed)
        closer = np.where(mine, np.log10(np.abs(sheet.answer - sheet.truth) / away), 0.0)
        told, explained, spoken = (np.bincount(group, one) for one in (closer, mine, against & sheet.wrong))
        enough = (explained == wrong) | ((explained >= _COVERED * wrong) & (explained >= _FEW))
        held = {}  # conditions where nothing speaks against the relation, and without which nothing is wrong
        for n in np.flatnonzero(enough & (told > _EVIDENCE) & (spoken == 0)).tolist():
            here, tried = group == n, sides if wrong[n] > _FEW else sides[:1]
            held[n] = [text for text, mask in tried if not (here & np.where(mask, against, sheet.wrong)).any()]
        common = [text for text, _ in sides if all(text in some for some in held.values())]
        for n, side in ((n, side) for n, some in held.items() for side in (common or some)[:1]):
            cause = _Found(name, says + side, np.zeros_like(mine), rank + _CONDITION * bool(side))
            found.setdefault(cause.says, cause).cells[mine & (group == n)] = True
    return _joined(sheet, sorted(found.values(), key=lambda cause: cause.rank))


@dataclass(frozen=True, eq=False)
class _Found:
    """What wrong answers are instead of right."""

    name: str  #: a short word for the kind of relation
    says: str
    cells: Array  #: which answers of the sheet it explains
    rank: float  #: lower is simpler


def _joined(sheet: Sheet, found: Sequence[_Found]) -> list[Cause]:
    """Relations that hold for all wrong quantities, or the simplest one for each."""
    blamed, parts = set(sheet.stems[sheet.wrong]), list[tuple[_Found, set[str]]]()
    whole = [cause for cause in found if blamed == set(sheet.stems[cause.cells])]
    if whole:
        return [Cause(_said(sheet, one.says, blamed), one.rank, one.name) for one in whole]
    for cause in found:
        mine = blamed & set(sheet.stems[cause.cells])
        parts += [(cause, mine)] if mine else []
        blamed -= mine
    texts = [_said(sheet, cause.says, mine) for cause, mine in parts]
    # Two quantities that have each other's values are exchanged.
    pairs = set(re.findall(r"^(\w+) has the values of (\w+)$", "\n".join(texts), re.M))
    for one, two in (pair for pair in pairs if pair[::-1] in pairs):
        old = f"{one} has the values of {two}"
        texts = [f"{min(one, two)} and {max(one, two)} are exchanged" if text == old else text for text in texts]
    texts = list(dict.fromkeys(texts))
    if blamed or len(texts) > _STATEMENTS:
        return []
    rank = max(cause.rank for cause, _ in parts) + len(texts) - 1
    return [Cause("; ".join(texts), rank, "-".join(dict.fromkeys(cause.name for cause, _ in parts)))]


def _said(sheet: Sheet, says: str, stems: set[str]) -> str:
    """A relation of some quantities, in words."""
    asked, laws = set(sheet.stems), sorted({stem.split(" ")[0] for stem in stems})
    names = sorted({stem.split(" ")[1] for stem in stems})
    one_law = {f"{law} {name}" for law in _LAWS for name in names} & asked != stems
    for kind, whole, least in ((r"^(lambda_\w+)_(re|im)$", r"\1", 2), (r"^(h|residual)_\d+$", r"\1_n", 3)):
        parts = [re.sub(kind, whole, name) for name in names]
        names = [part if parts.count(part) >= least else name for part, name in zip(parts, names, strict=True)]
    names = list(dict.fromkeys(names)) if stems != asked or len(stems) <= _STATEMENTS else ["all answers"]
    text = ", ".join(names[:-1]) + " and " * (len(names) > 1) + names[-1]
    verbs = {"has": "has", "is": "is"} if len(names) == 1 and names != ["all answers"] else {}
    text = says.format(**{"q": text, "has": "have", "is": "are", **verbs})
    return text + (f" under the {' and '.join(laws)} law" if one_law else "")
