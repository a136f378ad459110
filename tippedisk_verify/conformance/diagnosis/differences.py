"""Derivatives from finite differences whose rounding tells the step.

The difference of two doubles is a whole multiple of their last unit. A derivative that is such a difference over a
step is a whole multiple of that unit over the step, and no other number of its size is one but by chance.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from decimal import Decimal
from statistics import median

from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["difference_of"]

_ROUND = [float(f"{first}e-{n}") for n in range(3, 15) for first in (5, 2, 1)]
_EPS = 2.0**-52
#: Steps that are in use: round ones, powers of two, and roots of the last unit.
_STEPS = {f"{step:g}": step for step in _ROUND} | {f"2^-{n}": 2.0**-n for n in range(10, 46)}
_STEPS |= {"the square root of eps": math.sqrt(_EPS), "the cube root of eps": _EPS ** (1 / 3)}
_SHARES = {
    1.0: "", 2.0: ", divided by half of that: they are twice too large",
    0.5: ", divided by twice that: they are half as large as they should be",
}  # fmt: skip
_LEAST, _MOST = 32, 1e11  # multiples: smaller ones tell less of a step, larger ones are lost in the quotient's rounding
_WHOLE = 0.02  # how far from a whole multiple, for a chance of 0.04 each
_ENOUGH = 12  # answers that bear it out: 0.04^12 against some hundred steps
_MOSTLY = 0.9  # of them are whole multiples; at an end of a binade half of one is left
_ALIKE = 0.05  # relative: how far the middle answer may be from the right one, from its double or its half


def difference_of(here: Sequence[Quantity], answers: Mapping[str, Decimal], store: Store) -> str | None:
    """What finite differences the answers to derivatives of v' are, or None."""
    found = []
    for quantity in here:
        value = store.get(quantity.id.rsplit("/", 1)[0] + "/v_rate")
        if value is not None and value.for_doubles and quantity.for_doubles:
            found.append((float(answers[quantity.id]) / math.ulp(value.for_doubles), quantity.for_doubles))
    for text, step in sorted(_STEPS.items(), key=lambda item: item[1]):  # what holds for a step holds for its multiples
        multiples = [x * step for x, _ in found if _LEAST < abs(x * step) < _MOST]
        whole = [x for x in multiples if abs(x - round(x)) < _WHOLE]
        half = [x for x in multiples if abs(2 * x - round(2 * x)) < 2 * _WHOLE]
        if len(multiples) < _ENOUGH or len(whole) < _MOSTLY * len(multiples) or len(half) < len(multiples):
            continue
        share = median(float(answers[quantity.id]) / quantity.for_doubles for quantity in here if quantity.for_doubles)
        for factor, words in _SHARES.items():
            if abs(share / factor - 1) < _ALIKE:
                return f"finite differences over {text} (a forward step, or twice a central one){words}"
    return None
