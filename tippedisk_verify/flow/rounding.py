"""Twins of a run: the same but for its last bits, so that their spread shows what rounding does to a result.

Moving the inputs' last bits makes every later rounding another one. Where a run settles that is not enough: all twins
end up in the same few numbers, with the same roundings in every step. Moving the state after each step as well (Monte
Carlo arithmetic: D. S. Parker, *Monte Carlo Arithmetic*, UCLA, 1997) keeps the roundings independent there too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from tippedisk_verify.model.precision import Precision

__all__ = ["Rounding", "nudged", "step_nudges"]

#: Of the numbers that move up, and as many down: they then err by about half a place, as rounding makes them.
_SHARE_MOVED = 1 / 6
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
    # Irrational turns, other ones for each place and pattern, so that no two numbers or patterns move together.
    turns = (place * (0.5698402909980532 + pattern * 0.7548776662466927) % 1 for place in range(1, count + 1))
    return tuple(one - ulp if turn < _SHARE_MOVED else one + ulp if turn >= 1 - _SHARE_MOVED else one for turn in turns)


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
