"""From one saddle to the next, many flights side by side: from z_u = u about the first to z_s = -s about the second.

Notation as in `saddle`; the linear law. Each lane is a cell of starts (z_s, z_f) and of speeds, and all lanes take the
same number of steps, each lane with its own length of step. A step is that of `kernel.flow`, in doubles.

Of each step before the last z_s < -s is shown: over all of it, or at its end where F_s > 0 over all of it. The last
step begins before the section and ends after it, with F_s > 0. So the arrival is the first moment at which z_s = -s. On
the section time moves with the start by dT = -d(z_s) / F_s. Of each step it is shown that 0 < beta_bar < 1.5707, so
that gamma grows, and that v > 0, or v < 0, or v' < 0 throughout. So v has at most one zero, where beta_bar is largest;
its derivatives there are those at a fixed time, because beta_bar' = 0.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tippedisk_verify.proofs.kernel.balls import Unproved, ball
from tippedisk_verify.proofs.kernel.claims.saddle import FAST, SLOW, UNSTABLE, Saddle, hull_of_lanes
from tippedisk_verify.proofs.kernel.flow import Model, Path
from tippedisk_verify.proofs.kernel.lanes import Lanes
from tippedisk_verify.proofs.kernel.section import UPRIGHT
from tippedisk_verify.proofs.kernel.step import Step

__all__ = ["arrivals"]

U, S, F = UNSTABLE, SLOW, FAST
_ORDER = 8


def arrivals(
    saddle: Saddle,
    extents: Sequence[Any],
    slow: Lanes,
    fast: Any,
    lengths: NDArray[np.float64],
    count: int,
    watch: Callable[[float], None] = lambda share: None,
) -> list[list[Any]]:
    """What holds for all the flights: z_u, z_f and the time on arrival, and the largest beta_bar, as balls of Arb's.

    Each has its derivatives by z_s, z_f and the speed at the start besides. The saddle's speeds are lanes. Raises
    Unproved with the first lane of which it is not shown.
    """
    path, s = saddle.path([slow.constant(extents[U]), slow, slow.constant(fast)], _Axes()), extents[S]
    tops: list[list[Any]] = []
    turned = np.zeros(len(lengths), bool)
    for number in range(1, count + 1):
        step = _step(path, lengths)
        turning = _climbs(path.model, step)
        if turning.any():
            half = step.length / 2
            by = step.derivatives_at(half + half.around_zero())[0][1:]
            tops.append([hull_of_lanes(x[turning]) for x in (step.enclosure[0], *by)])
        turned |= turning
        watch(number / count)
        if number == count:
            break
        path.take(step)
        z = saddle.arrived(step.enclosure)
        rate, level = saddle.rates(z)[S], saddle.seen(path.frame)[S] + s
        _all("it is not shown to be on its way", (-level).positive(), rate.positive() | (-s - z[S]).positive())
    _all("beta_bar is not shown to have a largest value on the way", turned)
    beta = tops[0]
    for other in tops[1:]:
        beta = [x.union(y) for x, y in zip(beta, other, strict=True)]
    time, *landed = _landed(saddle, path, step, s)
    begin = step.length * (count - 1)
    rows = [*landed, [begin + time[0], *time[1:]]]
    return [*([hull_of_lanes(x) for x in row] for row in rows), beta]


class _Axes:
    """The axes of the sets follow a rule, which no choice changes: the lead's for z_u and z_s, and that of v."""

    def axes(self, turned: Sequence[Sequence[Any]], sizes: Any, stiffness: Any) -> list[list[Any]]:
        return [[*row[: S + 1], row[F].constant(int(k == 2))] for k, row in enumerate(turned)]

    def took(self, *_: Any) -> None:
        """Nothing is noted."""


def _all(what: str, *shown: NDArray[np.bool_]) -> None:
    """Raises Unproved unless all is shown of all lanes."""
    lanes = np.logical_and.reduce(shown)
    if not lanes.all():
        raise Unproved(f"flight {int(np.argmin(lanes)) + 1}: {what}")


def _step(path: Path, lengths: NDArray[np.float64]) -> Step:
    step = path.trial((_ORDER, _ORDER)).tested(Lanes(lengths))
    _all("the states and derivatives over a step are not shown to stay in its enclosure", step.included)
    return step


def _climbs(model: Model, step: Step) -> NDArray[np.bool_]:
    """Shown: gamma grows throughout and v has at most one zero. In which lanes it may have one."""
    beta, _, v = step.enclosure
    _all("0 < beta_bar < 1.5707 is not shown", beta.positive(), (ball(UPRIGHT) - beta).positive())
    turning: NDArray[np.bool_] = ~(v.positive() | v.negative())
    if turning.any():
        _all("v is not shown to pass zero once", ~turning | model.rates(step.enclosure)[2].negative())
    return turning


def _landed(saddle: Saddle, path: Path, step: Step, s: Any) -> list[list[Any]]:
    """The time of the arrival in a step, z_u and z_f, with their derivatives."""
    # By the mean value theorem about the middle of the step.
    middle = step.length / 2
    level = saddle.seen(path.carried(step, middle))[S] + s
    rate = saddle.rates(saddle.arrived(step.enclosure))[S]
    for _ in range(2):
        _all("it is not shown to pass z_s = -s once", rate.positive())
        time = middle - level / rate
        _all("it is not shown to arrive in its last step", time.positive(), (step.length - time).positive())
        rate = saddle.rates(saddle.seen(path.carried(step, time.union(middle))))[S]
    frame = path.carried(step, time)
    z = saddle.seen(frame)
    z[S] = z[S].constant(-s)
    rates, rows = saddle.rates(z), saddle.columns(frame.matrix())
    _all("it is not shown to arrive", rates[S].positive())
    by_time = [-rows[S][k] / rates[S] for k in (1, 2, 3)]
    by_u, by_f = ([rows[i][k] + rates[i] * by_time[k - 1] for k in (1, 2, 3)] for i in (U, F))
    return [[time, *by_time], [z[U], *by_u], [z[F], *by_f]]
