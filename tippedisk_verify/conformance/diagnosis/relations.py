"""Relations of a quantity's answers to right values: a factor, a sign, a power, another place,
other digits.

A relation predicts answers from right values, or from those of a program in which the mistakes
found so far are made too. Each quantity is examined separately. A relation holds if it gives every
wrong answer that it says something about.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from itertools import product

import numpy as np

from tippedisk_verify.conformance.diagnosis.entries import Array, Table, fitted
from tippedisk_verify.conformance.sheet import placed
from tippedisk_verify.model.parameters import SYMBOLS

__all__ = ["related", "where"]

# Of a quantity's wrong answers must have a counterpart, where the relation is to another question
_COVERED = 0.4
_FEW = 3  # wrong answers that bear out a relation to another question
_EVIDENCE = 6.0  # digits that a relation explains in all, so that it fits by no accident
_SURE = 1e-4  # of what is allowed: closer answers tell no more
_MOSTLY = 0.9  # of the answers to a quantity that satisfy a condition must be wrong
_PI = math.pi
_Function = Callable[[Array], Array]
_FACTORS = {
    "2": 2.0,
    "3": 3.0,
    "4": 4.0,
    "6": 6.0,
    "8": 8.0,
    "3/2": 1.5,
    "4/3": 4 / 3,
    "pi": _PI,
    "2 pi": 2 * _PI,
    "16": 16.0,
    "180/pi (degrees)": 180 / _PI,
    "30/pi (turns per minute)": 30 / _PI,
    "60": 60.0,
    "sqrt 2": math.sqrt(2),
    "ln 10": math.log(10),
    "ln 2": math.log(2),
    "1000": 1e3,
    "pi/4": _PI / 4,
    "9.81/9.80665": 9.81 / 9.80665,
    "5": 5.0,
}
_FACTORS |= {
    f"1/({text})" if " " in text else f"1/{text}": 1 / factor for text, factor in _FACTORS.items()
}
_FACTORS |= {f"-{text}": -factor for text, factor in _FACTORS.items()}
_TENS = {f"10^{k}": 10.0**k for k in range(-12, 13) if k not in (0, 3, -3)}
_OFFSETS = {"pi/2": _PI / 2, "pi": _PI, "2 pi": 2 * _PI, "1": 1.0}
_OF_VALUE: dict[float, dict[str, _Function]] = {  # by rank
    0: {"has the wrong sign": np.negative},
    1: {
        "is the modulus of the right value": np.abs,
        "is zero": np.zeros_like,
        "is one": np.ones_like,
        "is minus the modulus of the right value": lambda x: -np.abs(x),
        "is rounded to single precision": lambda x: x.astype("f4").astype("f8"),
        "is rounded to half precision": lambda x: x.astype("f2").astype("f8"),
        **{f"has the factor {text}": partial(np.multiply, x) for text, x in _FACTORS.items()},
    },
    2: {
        **{f"is {text} too large": partial(np.add, x) for text, x in _OFFSETS.items()},
        **{f"is {text} too small": partial(np.add, -x) for text, x in _OFFSETS.items()},
    },
    3: {
        **{
            f"is {text} minus the right value": partial(np.subtract, x)
            for text, x in _OFFSETS.items()
        },
        "is reduced to [0, 2 pi)": lambda x: x % (2 * _PI),
        "is reduced to [0, pi]": lambda x: np.arccos(np.cos(x)),
        "is reduced to (-pi, pi]": lambda x: _PI - (_PI - x) % (2 * _PI),
        "is reduced to [0, pi)": lambda x: x % _PI,
        "is reduced to [-pi/2, pi/2]": lambda x: np.arcsin(np.sin(x)),
        **{
            f"is {text} the right value": of
            for text, of in (
                ("the square of", np.square),
                ("the square root of", lambda x: np.sign(x) * np.sqrt(np.abs(x))),
                ("the logarithm of", lambda x: np.log(np.abs(x))),
                ("the exponential of", np.exp),
                ("the common logarithm of", lambda x: np.log10(np.abs(x))),
                ("the reciprocal of", np.reciprocal),
                ("the sine of", np.sin),
                ("the cosine of", np.cos),
                ("the tangent of", np.tan),
                ("2 pi divided by", lambda x: 2 * _PI / x),
                ("the cube of", lambda x: x**3),
            )
        },
    },
    4.5: {f"has the factor {text}": partial(np.multiply, x) for text, x in _TENS.items()},
}
_OF_TWO: dict[str, Callable[[Array, Array], Array]] = {  # x the right value, y another one
    "has the values of {y}": lambda x, y: y,
    "has the values of {y} with the wrong sign": lambda x, y: -y,
    "is twice {y}": lambda x, y: 2 * y,
    "is half of {y}": lambda x, y: y / 2,
    "is half of the sum with {y}": lambda x, y: (x + y) / 2,
    "is the right value plus {y}": lambda x, y: x + y,
    "is the right value minus {y}": lambda x, y: x - y,
    "is {y} minus the right value": lambda x, y: y - x,
    "is the right value times {y}": lambda x, y: x * y,
    "is the right value divided by {y}": np.divide,
    "is {y} divided by the right value": lambda x, y: y / x,
    "is the square of {y}": lambda x, y: y**2,
    "is the right value times the square of {y}": lambda x, y: x * y**2,
    "is the square root of {y}": lambda x, y: np.sqrt(y),
    "is the right value divided by the square of {y}": lambda x, y: x / y**2,
    "is the right value to the power 1/{y}": lambda x, y: np.abs(x) ** (1 / y),
    "is the exponential of {y}": lambda x, y: np.exp(y),
    "is the modulus of the right value and {y}": np.hypot,
    "is the logarithm of {y}": lambda x, y: np.log(np.abs(y)),
    "is the right value plus twice {y}": lambda x, y: x + 2 * y,
    "is half of {y} too small": lambda x, y: x - y / 2,
    "is 2 pi divided by {y}": lambda x, y: 2 * _PI / y,
    "is half of {y} too large": lambda x, y: x + y / 2,
}
_NEAR = {"next": 1, "previous": -1, "next but one": 2, "last but one": -2}
_WORDS = (
    ("inverted", "noninverted"),
    ("printed", "consistent"),
    ("stable", "unstable"),
    ("linear", "smooth"),
)
_SORTED: dict[str, _Function] = {
    "real parts": np.real,
    "moduli": np.abs,
    "imaginary parts": np.imag,
    "moduli of the imaginary parts": lambda z: np.abs(z.imag),
}


def _moved(table: Table, truths: Mapping[str, float]) -> Iterator[tuple[float, str, list[str]]]:
    """Yield exchanged questions: the rank, the sentence, and the ids whose right values stand in
    the wrong places.
    """
    for one, two in _WORDS:
        pattern, other = re.compile(rf"(?<=/)({one}|{two})(?=[-/])"), {one: two, two: one}
        what = "law" if one == "linear" else f"{two}/{one}"
        swap = partial(pattern.sub, lambda m, other=other: other[m[0]])
        yield (
            2.5,
            f"{{q}} has the values of the other {what}",
            ["/".join([a, swap(b)]) for a, b in (x.split("/", 1) for x in table.ids)],
        )
    place = {name: n for n, name in enumerate(dict.fromkeys(table.entries))}
    for text, by in (*_NEAR.items(), ("first", None)):
        moved = [0 if by is None else place[table.entries[row]] + by for row in table.rows]
        ids = [
            f"{table.entries[n]}/{name}" if 0 <= n < len(place) else ""
            for n, name in zip(moved, table.names, strict=True)
        ]
        yield 3, f"{{q}} has the values of the {text} entry", ids
    times = sorted({name.split("@")[1] for name in table.names if "@" in name}, key=float)
    for text, by in _NEAR.items():
        later = dict(zip(times[max(0, -by) :], times[max(0, by) :], strict=False))
        ids = [f"{id_.split('@')[0]}@{later.get(id_.split('@')[-1], '')}" for id_ in table.ids]
        yield 3, f"{{q}} has the values of the {text} sample in time", ids
        yield 3, f"{{q}} has the values of the {text} crossing", _renumbered(table, "#", 1, by)
        yield 3, f"{{q}} has the values of the {text} order", _renumbered(table, "_", 1, by)
    for text, by in {"second, third, fifth": -1, "second, fourth": 0}.items():
        yield (
            3,
            f"{{q}} counts crossings in one direction only ({text}, ...)",
            _renumbered(table, "#", 2, by),
        )


def _renumbered(table: Table, mark: str, factor: int, by: int) -> list[str]:
    """Return the ids with the number after a mark multiplied and shifted; "" if there is no mark."""
    found = (re.fullmatch(rf"(.*{mark})(\d+)", id_) for id_ in table.ids)
    return [f"{match[1]}{factor * int(match[2]) + by}" if match else "" for match in found]


def _predicted(table: Table, truths: Mapping[str, float]) -> Iterator[tuple[float, str, Array]]:
    """Yield the rank, the sentence (with {q} for the quantity) and the predictions, which are NaN
    without a counterpart.
    """
    x, epsilon = table.truth, table.given["epsilon"][table.rows]
    for rank, functions in _OF_VALUE.items():
        for text, of in functions.items():
            yield rank, f"{{q}} {text}", of(x)
    yield 3, "{q} is off by whole turns", x + 2 * _PI * np.round((table.answer - x) / (2 * _PI))
    order = np.array([float(one.get("order", "nan")) for one in table.places])
    factorial = np.array([math.factorial(int(n)) if n >= 0 else np.nan for n in order])
    for text, factor in {
        "epsilon^n": epsilon**order,
        "1/epsilon^n": epsilon**-order,
        "n!": factorial,
        "1/n!": 1 / factorial,
    }.items():
        yield 3, f"{{q}} has the factor {text}", factor * x
    for text, share in {"epsilon^k times ": epsilon, "": 1.0 + 0 * epsilon}.items():
        sums = 0 * order
        for k in range(int(np.nanmax(order, initial=-1)) + 1):
            ids = [re.sub(r"\d+$", str(k), id_) for id_ in table.ids]
            sums = sums + np.where(order >= k, share**k * _looked(truths, ids), 0.0)
        yield 3, f"{{q}} is the sum of {text}all orders so far", sums
    for rank, says, ids in _moved(table, truths):
        yield rank, says, _looked(truths, ids)
    others = {
        str(name): _looked(
            truths,
            [
                f"{table.entries[row]}/{_placed_as(name, full)}"
                for row, full in zip(table.rows, table.names, strict=True)
            ],
        )
        for name in np.unique(table.stems)
    }
    others |= {
        f"the {'parameter' if name in SYMBOLS else 'input'} {name}": table.given[name][table.rows]
        for name in (*SYMBOLS, "Omega", "beta", "gamma", "v")
    }
    if "period" in others:
        others["the angular frequency"] = 2 * _PI / others["period"]
    for name, y in others.items():
        y = np.where(table.stems == name, np.nan, y)
        for n, (text, both) in enumerate(_OF_TWO.items()) if np.isfinite(y).any() else ():
            yield 4 if n else 2, f"{{q}} {text.replace('{y}', name)}", both(x, y)
    if {"lambda_3_re", "lambda_3_im"} <= others.keys():
        yield from _sorted(table, others)
    yield from _rounded(table)


def _placed_as(name: str, full: str) -> str:
    """A quantity's name at the place of another one."""
    return str(name) + full[len(placed(full)[0]) :]


def _looked(truths: Mapping[str, float], ids: list[str]) -> Array:
    return np.array([truths.get(id_, np.nan) for id_ in ids])


def _sorted(table: Table, others: Mapping[str, Array]) -> Iterator[tuple[float, str, Array]]:
    """The right eigenvalues in another order; equal ones, and conjugates, by the sign of the
    imaginary part.
    """
    z = np.array([others[f"lambda_{n}_re"] + 1j * others[f"lambda_{n}_im"] for n in (1, 2, 3)])
    z = np.array([np.where(np.isnan(one), table.truth, one) for one in z])
    own = np.array([int(name[7]) - 1 for name in table.names])
    for (text, key), up, first in product(_SORTED.items(), (1, -1), (-1, 1)):
        places = np.lexsort((first * z.imag, np.round(up * key(z), 7)), axis=0)
        picked = z[places[own, np.arange(len(own))], np.arange(len(own))]
        also = (
            ""
            if text == "imaginary parts"
            else f", the {'positive' if first < 0 else 'negative'} imaginary part first"
        )
        says = f"the eigenvalues are in another order: {'ascending' if up > 0 else 'descending'} {text}{also}"
        yield 1, says, np.where(np.char.endswith(table.names, "_im"), picked.imag, picked.real)


def _rounded(table: Table) -> Iterator[tuple[float, str, Array]]:
    """Answers with few digits: whole multiples of a unit, within half of it or the whole one
    of the right values.
    """
    x, answer, allowed = table.truth, table.answer, table.allowed
    size = np.floor(np.log10(np.where(x == 0, 1.0, np.abs(x)))) + 1
    for d, (word, share) in product(range(1, 13), {"decimal": 0, "significant digit": 1}.items()):
        unit = 10.0 ** (size * share - d)
        whole = np.abs(answer - unit * np.round(answer / unit)) < 1e-6 * unit + 1e-15 * np.abs(x)
        shorter = np.abs(answer) <= np.abs(x) + allowed
        for rank, text, most, known in (
            (1, "rounded", 0.5001, whole),
            (2, "truncated", 1.0001, whole & shorter),
        ):
            fits = known & (np.abs(answer - x) < most * unit + allowed)
            yield (
                rank + d / 100 + share / 1000,
                f"{{q}} is {text} to {d} {word}" + ("s" if d > 1 else ""),
                np.where(fits, answer, x),
            )


@np.errstate(all="ignore")
def related(table: Table, truths: Mapping[str, float]) -> Iterator[tuple[float, str, str, Array]]:
    """Yield the relations that give the wrong answers to a quantity: the rank, the sentence, the
    quantity's name, and the mask of these answers.

    ``truths`` are the right values by id, of this and of other tables.
    """
    stems, group = np.unique(table.stems, return_inverse=True)
    wrong, sides = np.bincount(group, table.left), list(_conditions(table))
    for rank, says, predicted in _predicted(table, truths) if table.left.any() else ():
        known = np.isfinite(predicted)
        fits = fitted(table.answer, table.truth, table.allowed, table.left, predicted) & known
        mine, against = fits & table.left, known & ~fits
        away = np.maximum(np.abs(table.answer - predicted), _SURE * table.allowed)
        closer = np.where(mine, np.log10(np.abs(table.answer - table.truth) / away), 0.0)
        told, explained, spoken = (
            np.bincount(group, one) for one in (closer, mine, against & table.left)
        )
        enough = (explained == wrong) | ((explained >= _COVERED * wrong) & (explained >= _FEW))
        for n in np.flatnonzero(enough & (told > _EVIDENCE) & (spoken == 0)).tolist():
            here = group == n
            for text, mask in sides:
                if not (here & np.where(mask, against, table.left)).any():
                    yield rank + 5 * bool(text), says + text, str(stems[n]), here & table.left
                    break


def _conditions(table: Table) -> Iterator[tuple[str, Array]]:
    """No condition, and conditions on a question that the wrong answers satisfy."""
    yield "", np.ones_like(table.left)
    sets = np.array([entry.split("/")[0] for entry in table.entries])
    for name, values in {
        "equilibrium": table.given["equilibrium"],
        "form": table.given["form"],
        "set": sets,
    }.items():
        picked = np.unique(values[table.rows][table.left])
        if len(picked) == 1 and (values != picked[0]).any():
            yield f" for the {name} {picked[0]}", values[table.rows] == picked[0]


def where(table: Table, gamma_y: Array) -> str:
    """The quantities that are wrong, and the simplest condition on the state that they
    satisfy and others do not.
    """
    stems = np.unique(table.stems[table.left])
    same = np.isin(table.stems, stems)
    names = (
        ", ".join(stems[:6])
        + (", ..." if len(stems) > 6 else "")
        + (f" ({table.friction})" if table.friction != "both" else "")
    )
    given = table.given
    sides = [(text[1:], mask) for text, mask in _conditions(table) if text]
    for key, x in {
        "v": given["v"],
        "cos(beta)": np.cos(given["beta"]),
        "gamma_y": gamma_y,
        "cos(gamma)": np.cos(given["gamma"]),
    }.items():
        x = (x + 0 * given["r"])[table.rows]
        sides += [
            (f"where {key} {sign} 0", mask)
            for sign, mask in (("<", x < 0), ("=", x == 0), (">", x > 0))
        ]
    for text, mask in sides:
        if (
            (~mask & same).sum() > _FEW
            and not (table.left & ~mask).any()
            and table.left[mask & same].mean() >= _MOSTLY
        ):
            return f"{names} {text}"
    return names
