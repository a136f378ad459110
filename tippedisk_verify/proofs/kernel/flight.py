"""Where all orbits of a path are after a time, proved."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from tippedisk_verify.proofs.kernel.balls import arb, ball, inside
from tippedisk_verify.proofs.kernel.flow import Path, Status, Step, short_float

__all__ = ["Flight", "carry"]

_SHORTEST_STEP = 2.0**-40  # s


@dataclass(frozen=True)
class Flight:
    """Where all orbits from a box are after a time, proved. Only Status.REACHED makes the rest mean anything."""

    status: Status
    time: Any  #: [s]
    state: tuple[Any, Any, Any]  #: holds the end of every orbit, (beta_bar, gamma_bar, v)
    matrix: tuple[tuple[Any, ...], ...] | None  #: (3, 4): d(end)/d(beta, gamma, v at the start, Omega)
    divergence: Any  #: integral of div f over the run, or None
    steps: int
    upright: bool  #: |beta_bar| < pi/2 throughout: the disk does not lie flat


def carry(path: Path, duration: Any, watch: Callable[[Step], None] | None = None) -> Flight:
    """Follow a path for ``duration`` seconds (an exact number or a ball, positive).

    ``watch`` is called with every step before it is taken. Raises ValueError for a duration that is not positive.
    """
    span = ball(duration)
    if not span > 0:
        raise ValueError("the duration must be positive")
    upright = True
    share = 1.0
    while True:
        left = span - path.time  # positive: what was taken is proved to be shorter
        step = path.step(max(share * _float_above(left), 2 * _SHORTEST_STEP))
        if step is None:
            status = path.status or Status.NO_ENCLOSURE
            break
        if not (left <= step.length or left > step.length):
            share /= 2  # the step ends within the duration's ball
            continue
        share = 1.0
        upright = upright and inside(step.enclosure[0], arb(0, 1.5707))
        if watch is not None:
            watch(step)
        if left <= step.length:
            path.take(step, left)
            status = Status.REACHED
            break
        path.take(step)
    return Flight(
        status,
        path.time,
        path.box,
        path.matrix if path.sharp else None,
        path.divergence if path.sharp else None,
        path.steps,
        upright,
    )


def _float_above(x: Any) -> float:
    """A float of 20 bits that is not below any point of the ball."""
    return short_float(float(x.abs_upper()) * (1 + 2.0**-18))
