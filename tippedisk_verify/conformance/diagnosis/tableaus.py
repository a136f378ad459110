"""A slip in the table of a Runge-Kutta method: one coefficient, or the weights.

Each lane of one flight has another table. What gives the errors of one orbit is tried on the others.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction

import numpy

from tippedisk_verify.conformance.diagnosis.flights import Array, Field, flown, runge_kutta

__all__ = ["slipped_table"]

Table = list[list[Fraction]]  # stages' rows, and the weights as the last one
_COUNTS = (50, 100, 125, 200, 250, 500)  # steps of 10 ms to 1 ms between samples
_EXACTLY = 1e-8  # rad, rad/s; a table leads to the answers, up to what an orbit makes of rounding
_VALUES = ("0", "1/8", "1/6", "1/4", "1/3", "3/8", "1/2", "2/3", "3/4", "1", "4/3", "3/2", "2", "3")
_MOST = 3  # integer weights
_WIDEST = 13  # what they are divided by is less
_LONG = 20  # a table with such denominators is copied, not remembered
_TABLES = {
    "RK4": "1/2; 0 1/2; 0 0 1; 1/6 1/3 1/3 1/6",
    "Kutta's 3/8 rule": "1/3; -1/3 1; 1 -1 1; 1/8 3/8 3/8 1/8",
    "the midpoint rule": "1/2; 0 1",
    "Heun's method": "1; 1/2 1/2",
    "Ralston's method": "2/3; 1/4 3/4",
    "Kutta's third-order method": "1/2; -1 2; 1/6 2/3 1/6",
    "Heun's third-order method": "1/3; 0 2/3; 1/4 0 3/4",
    "the third-order method of Bogacki and Shampine": "1/2; 0 3/4; 2/9 1/3 4/9",
    "the third-order method of Shu and Osher": "1; 1/4 1/4; 1/6 1/6 2/3",
    "the method of Dormand and Prince":
    "1/5; 3/40 9/40; 44/45 -56/15 32/9; 19372/6561 -25360/2187 64448/6561 -212/729;"
    " 9017/3168 -355/33 46732/5247 49/176 -5103/18656; 35/384 0 500/1113 125/192 -2187/6784 11/84",
    "Fehlberg's method of fourth order":
    "1/4; 3/32 9/32; 1932/2197 -7200/2197 7296/2197; 439/216 -8 3680/513 -845/4104;"
    " 25/216 0 1408/2565 2197/4104 -1/5",
    "Fehlberg's method of fifth order":
    "1/4; 3/32 9/32; 1932/2197 -7200/2197 7296/2197; 439/216 -8 3680/513 -845/4104;"
    " -8/27 2 -3544/2565 1859/4104 -11/40; 16/135 0 6656/12825 28561/56430 -9/50 2/55",
}  # fmt: skip


def slipped_table(rates: Callable[[Array], Field], starts: Array, ends: Array, exact: Array, time: float) -> str | None:
    """The method with a slip, and its step, that lead from these starts to these ends and not to the exact ones.

    ``rates`` has the field of some of the orbits.
    """
    one = numpy.array([int(numpy.argmax(numpy.linalg.norm(ends - exact, axis=0)))])

    def left(tables: Sequence[Table], count: int, some: Array) -> Array:
        """How far from the ends each of these tables leads."""
        lanes = [
            [numpy.array([float(table[i][j]) for table in tables])[:, None] for j in range(len(row))]
            for i, row in enumerate(tables[0])
        ]
        y = numpy.repeat(starts[:, None, some], len(tables), axis=1)
        with numpy.errstate(all="ignore"):
            made = flown(rates(some), y, time, count, runge_kutta(lanes))
            rest = numpy.linalg.norm(made - ends[:, None, some], axis=0)
        return numpy.asarray(numpy.where(numpy.isfinite(rest), rest, math.inf).max(axis=1))

    for name, text in _TABLES.items():
        right = [[Fraction(x) for x in row.split()] for row in text.split(";")]
        slips = list(_slips(right))
        found: list[tuple[float, str]] = []
        for count in _COUNTS:
            near = left([table for _, table in slips], count, one)
            for n in numpy.flatnonzero(near <= _EXACTLY):
                if (rest := left([slips[n][1]], count, numpy.arange(ends.shape[1]))[0]) <= _EXACTLY:
                    step = f"at a fixed step of {1000 * time / count:.6g} ms"
                    found.append((float(rest), f"{name} with {slips[n][0]}, {step}"))
        if found:
            return min(found)[1]
    return None


def _slips(right: Table) -> Iterator[tuple[str, Table]]:
    """(What is changed, the table), once each: one coefficient, two of them exchanged, or the weights."""
    values = [Fraction(x) for x in _VALUES]
    weights, total = right[-1], math.lcm(*(x.denominator for x in right[-1]))
    long = max(x.denominator for row in right for x in row) > _LONG
    for i, row in enumerate(right):
        last = i == len(right) - 1
        what = "weight" if last else f"k_{i + 2} from"
        for j, x in enumerate(row):
            for other in dict.fromkeys([-x, Fraction(0), *_digits(x)] if long else [-x, *values]):
                if other != x and (x or not long):
                    text = f"{what} {other} k_{j + 1} for {x} k_{j + 1}"
                    yield text, [*right[:i], [*row[:j], other, *row[j + 1 :]], *right[i + 1 :]]
            for k in range(j):
                if row[k] != x:
                    moved = list(row)
                    moved[j], moved[k] = moved[k], moved[j]
                    yield _exchange(i, row, (k, j), last), [*right[:i], moved, *right[i + 1 :]]
    if not long:
        usual = [int(x * total) for x in weights]
        for whole in (usual, *itertools.product(range(_MOST + 1), repeat=len(weights))):
            for below in range(1, _WIDEST) if whole is usual else dict.fromkeys((sum(whole), total)):
                row = [Fraction(x, below) for x in whole] if below else weights
                if row != weights:
                    yield f"weights {', '.join(map(str, whole))} over {below}", [*right[:-1], row]


def _exchange(i: int, row: list[Fraction], pair: tuple[int, int], last: bool) -> str:
    """What two exchanged coefficients are to somebody who wrote down one of them."""
    old, new = pair if not row[pair[1]] else pair[::-1]
    if not last and not row[new]:
        return f"k_{i + 2} from {row[old]} k_{new + 1} for {row[old]} k_{old + 1}"
    return f"{'weights' if last else f'k_{i + 2} from coefficients'} of k_{pair[0] + 1} and k_{pair[1] + 1} exchanged"


def _digits(x: Fraction) -> Iterator[Fraction]:
    """With two neighbouring digits exchanged, above or below."""
    for up in (True, False):
        text = str(abs(x.numerator) if up else x.denominator)
        for n in range(len(text) - 1):
            other = int(text[:n] + text[n + 1] + text[n] + text[n + 2 :])
            if other:
                yield Fraction(int(math.copysign(other, x)), x.denominator) if up else Fraction(x.numerator, other)
