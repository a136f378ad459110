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
from typing import NamedTuple

import numpy as np

from tippedisk_verify.conformance.diagnosis.entries import Array, Table
from tippedisk_verify.model.parameters import SYMBOLS

__all__ = ["Relation", "related", "where"]

# The least share of a quantity's wrong answers that a relation to another question must give.
_COVERED = 0.4
_FEW = 3  # wrong answers that bear out a relation to another question
_EVIDENCE = 6.0  # digits that a relation explains in all, so that it fits by no accident
_SURE = 1e-4  # of the allowed distance; closer answers are no further evidence
_MOSTLY = 0.9  # the least share of wrong answers among those that satisfy a condition
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
#: Functions of the right value, by rank and sentence
_OF_VALUE: dict[float, dict[str, _Function]] = {
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
#: Functions of the right value x and of another quantity's, or an input's, y
_OF_TWO: dict[str, Callable[[Array, Array], Array]] = {
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
#: Neighbours in a list of questions, by how far they are away
_NEAR = {"next": 1, "previous": -1, "next but one": 2, "last but one": -2}
#: Words of ids that may be exchanged
_WORDS = (
    ("inverted", "noninverted"),
    ("printed", "consistent"),
    ("stable", "unstable"),
    ("linear", "smooth"),
)
#: Keys that eigenvalues may be sorted by
_SORTED: dict[str, _Function] = {
    "real parts": np.real,
    "moduli": np.abs,
    "imaginary parts": np.imag,
    "moduli of the imaginary parts": lambda z: np.abs(z.imag),
}


class Relation(NamedTuple):
    """A relation that gives the wrong answers to a quantity."""

    rank: float  #: lower is likelier
    says: str  #: sentence with {q} for the quantity
    table: Table
    stem: str  #: the quantity
    answers: Array  #: mask of the answers that the relation gives


Prediction = tuple[float, str, Array]  #: rank, sentence, and answers; NaN without a counterpart


def _predictions(table: Table, truths: Mapping[str, float]) -> Iterator[Prediction]:
    """Yield the answers that each relation predicts."""
    x = table.truth
    for rank, functions in _OF_VALUE.items():
        for text, function in functions.items():
            yield rank, f"{{q}} {text}", function(x)
    turns = np.round((table.answer - x) / (2 * _PI))
    yield 3, "{q} is off by whole turns", x + 2 * _PI * turns
    if any("order" in place for place in table.places):
        yield from _of_orders(table, truths)
    for rank, says, ids in _exchanged(table):
        yield rank, says, _right_values(truths, ids)
    others = _other_values(table, truths)
    for name, values in others.items():
        y = np.where(table.stems == name, np.nan, values)
        for n, (text, of_two) in enumerate(_OF_TWO.items()) if np.isfinite(y).any() else ():
            yield 4 if n else 2, f"{{q}} {text.replace('{y}', name)}", of_two(x, y)
    if {"lambda_3_re", "lambda_3_im"} <= others.keys():
        yield from _sorted(table, others)
    yield from _rounded(table)


def _of_orders(table: Table, truths: Mapping[str, float]) -> Iterator[Prediction]:
    """Yield the orders of the slow manifold with a power of epsilon or a factorial, and their
    partial sums.
    """
    epsilon = table.given["epsilon"][table.rows]
    order = np.array([float(place.get("order", "nan")) for place in table.places])
    factorial = np.array([math.factorial(int(n)) if n >= 0 else np.nan for n in order])
    for text, factor in {
        "epsilon^n": epsilon**order,
        "1/epsilon^n": epsilon**-order,
        "n!": factorial,
        "1/n!": 1 / factorial,
    }.items():
        yield 3, f"{{q}} has the factor {text}", factor * table.truth
    for text, share in {"epsilon^k times ": epsilon, "": np.ones_like(epsilon)}.items():
        sums = 0 * order
        for k in range(int(np.nanmax(order)) + 1):
            term = _right_values(truths, [re.sub(r"\d+$", str(k), id_) for id_ in table.ids])
            sums = sums + np.where(order >= k, share**k * term, 0.0)
        yield 3, f"{{q}} is the sum of {text}all orders so far", sums


def _exchanged(table: Table) -> Iterator[tuple[float, str, list[str]]]:
    """Yield exchanged questions: the rank, the sentence, and the ids whose right values stand in
    the wrong places; "" where there is none.
    """
    for one, two in _WORDS:
        what = "law" if one == "linear" else f"{two}/{one}"
        yield 2.5, f"{{q}} has the values of the other {what}", _with_words(table, one, two)
    first = [f"{table.entries[0]}/{name}" for name in table.names]
    yield 3, "{q} has the values of the first entry", first
    times = sorted({name.split("@")[1] for name in table.names if "@" in name}, key=float)
    for text, by in _NEAR.items():
        entries = dict(enumerate(table.entries))
        moved = [
            f"{entries.get(row + by)}/{name}"
            for row, name in zip(table.rows, table.names, strict=True)
        ]
        later = dict(zip(times[max(0, -by) :], times[max(0, by) :], strict=False))
        samples = [f"{id_.split('@')[0]}@{later.get(id_.split('@')[-1])}" for id_ in table.ids]
        for what, ids in {
            "entry": moved,
            "sample in time": samples,
            "crossing": _renumbered(table, "#", 1, by),
            "order": _renumbered(table, "_", 1, by),
        }.items():
            yield 3, f"{{q}} has the values of the {text} {what}", ids
    for text, by in {"second, third, fifth": -1, "second, fourth": 0}.items():
        says = f"{{q}} counts crossings in one direction only ({text}, ...)"
        yield 3, says, _renumbered(table, "#", 2, by)


def _with_words(table: Table, one: str, two: str) -> list[str]:
    """Return the ids with two words exchanged, wherever they stand behind the parameter set."""
    pattern, other = re.compile(rf"(?<=/)({one}|{two})(?=[-/])"), {one: two, two: one}
    return [pattern.sub(lambda match: other[match[0]], id_) for id_ in table.ids]


def _renumbered(table: Table, mark: str, factor: int, by: int) -> list[str]:
    """Return the ids with the number after a mark multiplied and shifted; "" if there is no mark."""
    found = (re.fullmatch(rf"(.*{mark})(\d+)", id_) for id_ in table.ids)
    return [f"{match[1]}{factor * int(match[2]) + by}" if match else "" for match in found]


def _other_values(table: Table, truths: Mapping[str, float]) -> dict[str, Array]:
    """Return what an answer may be related to, by name: the right values of the other quantities
    of its entry, and the entry's inputs.
    """
    found = {}
    for name in np.unique(table.stems).tolist():
        places = [
            full.removeprefix(stem) for full, stem in zip(table.names, table.stems, strict=True)
        ]
        ids = [
            f"{table.entries[row]}/{name}{place}"
            for row, place in zip(table.rows, places, strict=True)
        ]
        found[name] = _right_values(truths, ids)
    for name in (*SYMBOLS, "Omega", "beta", "gamma", "v"):
        sort = "parameter" if name in SYMBOLS else "input"
        found[f"the {sort} {name}"] = table.given[name][table.rows]
    if "period" in found:
        found["the angular frequency"] = 2 * _PI / found["period"]
    return found


def _right_values(truths: Mapping[str, float], ids: list[str]) -> Array:
    return np.array([truths.get(id_, np.nan) for id_ in ids])


def _sorted(table: Table, others: Mapping[str, Array]) -> Iterator[Prediction]:
    """Yield the right eigenvalues in another order; equal ones, and conjugates, by the sign of the
    imaginary part.
    """
    z = np.array([others[f"lambda_{n}_re"] + 1j * others[f"lambda_{n}_im"] for n in (1, 2, 3)])
    answers, number = np.arange(len(table.names)), [int(name[7]) - 1 for name in table.names]
    for (text, key), up, first in product(_SORTED.items(), (1, -1), (-1, 1)):
        order = np.lexsort((first * z.imag, np.round(up * key(z), 7)), axis=0)
        picked = z[order[number, answers], answers]
        says = f"the eigenvalues are in another order: {'ascending' if up > 0 else 'descending'} {text}"
        if text != "imaginary parts":
            says += f", the {'positive' if first < 0 else 'negative'} imaginary part first"
        yield 1, says, np.where(np.char.endswith(table.names, "_im"), picked.imag, picked.real)


def _rounded(table: Table) -> Iterator[Prediction]:
    """Yield answers with few digits: whole multiples of a unit, within half of it or the whole one
    of the right values.
    """
    x, answer, allowed = table.truth, table.answer, table.allowed
    size = np.floor(np.log10(np.where(x == 0, 1.0, np.abs(x)))) + 1
    shorter = np.abs(answer) <= np.abs(x) + allowed
    for digits, (word, share) in product(
        range(1, 13), {"decimal": 0, "significant digit": 1}.items()
    ):
        unit = 10.0 ** (size * share - digits)
        whole = np.abs(answer - unit * np.round(answer / unit)) < 1e-6 * unit + 1e-15 * np.abs(x)
        away, words = np.abs(answer - x) - allowed, f"{digits} {word}{'s' if digits > 1 else ''}"
        rank = 1 + digits / 100 + share / 1000
        rounded, truncated = (
            whole & (away < 0.5001 * unit),
            whole & (away < 1.0001 * unit) & shorter,
        )
        yield rank, f"{{q}} is rounded to {words}", np.where(rounded, answer, x)
        yield rank + 1, f"{{q}} is truncated to {words}", np.where(truncated, answer, x)


@np.errstate(all="ignore")
def related(table: Table, truths: Mapping[str, float]) -> list[Relation]:
    """Return the relations that give the wrong answers to a quantity.

    Args:
        table: The answers.
        truths: The right values by id, of this and of other tables.
    """
    found = []
    stems, group = np.unique(table.stems, return_inverse=True)
    wrong, conditions = np.bincount(group, table.left), list(_conditions(table))
    for rank, says, predicted in _predictions(table, truths) if table.left.any() else ():
        known = np.isfinite(predicted)
        fits = table.fitted(predicted) & known
        mine, against = fits & table.left, known & ~fits
        away = np.maximum(np.abs(table.answer - predicted), _SURE * table.allowed)
        digits = np.where(mine, np.log10(np.abs(table.answer - table.truth) / away), 0.0)
        told, explained, spoken = (
            np.bincount(group, one) for one in (digits, mine, against & table.left)
        )
        enough = (explained == wrong) | ((explained >= _COVERED * wrong) & (explained >= _FEW))
        for n in np.flatnonzero(enough & (told > _EVIDENCE) & (spoken == 0)).tolist():
            here = group == n
            for text, mask in conditions:
                if not (here & np.where(mask, against, table.left)).any():
                    found.append(
                        Relation(
                            rank + 5 * bool(text),
                            says + text,
                            table,
                            str(stems[n]),
                            here & table.left,
                        )
                    )
                    break
    return found


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
    names = ", ".join(stems[:6]) + (", ..." if len(stems) > 6 else "")
    names += f" ({table.friction})" if table.friction != "both" else ""
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
