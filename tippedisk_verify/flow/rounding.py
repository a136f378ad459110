"""Twins of a run: the same with other last bits of its inputs. Their spread shows what rounding does to a result.

Twins are for what is solved by many runs, such as a limit cycle. Its equations amplify rounding, and no single run's
error tells by how much. A pattern 1, 2, ... says how each number moves.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from random import Random
from typing import Any

from tippedisk_verify.model.precision import Precision

__all__ = ["nudged"]

#: In so many patterns each number moves up once and down once: none stays where it is in all twins of a cycle, and on
#: average they err by half a place, as rounding makes them.
_ROUND = 5


def nudged(values: Sequence[Any], pattern: int, precision: Precision) -> list[Any]:
    """Each number moved by its last bit, up or down or not at all as the pattern says; zero stays."""
    return [value * factor for value, factor in zip(values, _factors(len(values), pattern, precision), strict=True)]


@lru_cache(maxsize=256)
def _factors(count: int, pattern: int, precision: Precision) -> tuple[Any, ...]:
    one, ulp = precision.number(1), precision.number(precision.epsilon)
    block, turn = divmod(pattern, _ROUND)
    random = Random(block)  # another one for each round of patterns, and the same on every machine
    moves = [random.sample(range(_ROUND), 2) for _ in range(count)]
    return tuple(one + ulp if turn == up else one - ulp if turn == down else one for up, down in moves)
