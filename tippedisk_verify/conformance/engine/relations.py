"""Relations between wrong answers and right ones that no change of a program makes: a unit, a place, another question.

A relation predicts an answer from right values alone. It is a cause if every wrong answer is as predicted, and no right
one speaks against it; different quantities may need different relations.
"""

from __future__ import annotations

import math
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
        units = np.concatenate([[q.unit for q in table.entries[0].quantities][:1] for table in sheet.tables])
        del units

    def at(self, **moved: Array) -> Array:
        """The right values where some indices are others; indices out of range find nothing."""
        where = []
        for name, size in zip(("base", "law", "stem", "place"), self.values.shape, strict=True):
            index = np.asarray(moved.get(name, getattr(self, name)))
            where.append(np.where((index >= 0) & (index < size), index, size - 1))
        return np.asarray(self.values[tuple(where)])
