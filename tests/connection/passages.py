"""The time that a cycle spends past the saddles, and between them."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import lru_cache
from typing import Any

from tippedisk_verify.cycles.shooting import LimitCycle
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.flow.contract import Engine, Event, Request, Status
from tippedisk_verify.model.precision import bits


def passage_times(cycle: LimitCycle, engine: Engine, distance: Fraction) -> tuple[Any, Any]:
    """Return the times [s] of one passage and of one flight: within ``distance`` of a saddle, and
    outside.

    A period has two of each. The distance is sqrt(cos(beta)^2 + 2 (1 + sin(gamma))). If it is
    small, it is that of the angles to the nearest saddle [rad].

    Raises NoSuchCycleError if the cycle does not come that near.
    """
    held = cycle.gamma_bar_0.uncertainty
    precision = bits(
        max(113, 40 + math.ceil(-math.log2(held.numerator) + math.log2(held.denominator)))
    )
    result = engine(
        Request(
            cycle.parameters,
            cycle.omega.value,
            (0, cycle.gamma_bar_0.value, cycle.v_0.value),
            cycle.period.value / 2,
            shifted=True,
            precision=precision,
            events=(_rim(distance),),
            domain="none",
        )
    )
    times = [record.time for record in result.events]
    if result.status is not Status.REACHED or len(times) != 2:
        raise NoSuchCycleError(f"the cycle does not pass the saddles within {float(distance):g}")
    leaves, enters = times
    return leaves + (result.time - enters), enters - leaves


@lru_cache(maxsize=8)
def _rim(distance: Fraction) -> Event:
    """Return the event at which the orbit crosses a saddle's neighbourhood.

    It is cached, so that engines keep what they build for it.
    """
    square = float(distance) ** 2

    def function(ops: Any, constants: Any, omega: Any, beta: Any, gamma: Any, v: Any) -> Any:
        cosine = ops.cos(beta)
        return cosine * cosine + 2 * (1 + ops.sin(gamma)) - square

    return Event(f"rim {float(distance):g}", function, terminal=False)
