"""Twins of a run: the same but for its last bits, so that their spread shows what rounding does to a result.

Moving the inputs' last bits makes every later rounding another one. Where a run settles that is not enough: all twins
end up in the same few numbers, with the same roundings in every step. Moving the state after each step as well (Monte
Carlo arithmetic: D. S. Parker, *Monte Carlo Arithmetic*, UCLA, 1997) keeps the roundings independent there too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from random import Random
from typing import Any, NamedTuple

from tippedisk_verify.model.precision import Precision

__all__ = ["Rounding", "nudged", "step_nudges"]

#: In so many patterns each number moves up once and down once: none stays where it is in all twins of a cycle, and on
#: average they err by half a place, as rounding makes them.
_ROUND = 5
_PATTERNS = 64  # of the moves after steps, before they begin anew: more than a result remembers


class Rounding(NamedTuple):
    """Which last bits of a twin are moved, and how."""

    pattern: int  #: 1, 2, ...: each moves the numbers another way
    steps: bool = False  #: the state after each step too, not only start, speed and constants


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


def step_nudges(rounding: Rounding, size: int, precision: Precision) -> Callable[[Any], bool]:
    """A step callback for heyoka that moves the last bits of all ``size`` numbers of the state."""
    factors = list(precision.array(_factors(_PATTERNS * size, -rounding.pattern, precision)).reshape(_PATTERNS, size))
    step = 0

    def nudge(stepper: Any) -> bool:
        nonlocal step
        step += 1
        stepper.state[:] *= factors[step % _PATTERNS]
        return True

    return nudge
