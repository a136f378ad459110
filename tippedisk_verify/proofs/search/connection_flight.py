"""From one saddle to the other: the flight from near the unstable manifold to the face z_s = -s of the other's box.

The saddles are (0, -pi, 0) and (0, pi, 0) in shifted angles. In the coordinates z = P^-1 y of `local_manifolds.Frame`,
y the offset from the first saddle, a flight starts on z_u = u with z_s and z_f in given balls, at any speed of a ball.
It ends where z_s = -s in the same coordinates about the second saddle. The frame of `flow.Path` starts with the columns
of P for its axes, so the box is followed as it is, and the derivatives are by z and Omega.

Of each step before the last z_s < -s is proved: over all of it, or at its end where F_s > 0 over all of it. The last
step begins before the section and ends after it, with F_s > 0. So the arrival is the first moment at which z_s = -s. It
is enclosed by interval Newton steps. On the section time moves with the start by dT = -d(z_s) / F_s.

Of each step it is proved that 0 < beta_bar < 1.5707, so that gamma grows, and that v > 0, or v < 0, or v' < 0
throughout. So v has at most one zero, where beta_bar is largest; its derivatives there are those at a fixed time,
because beta_bar' = 0.

Where a ball becomes a point or a float: the guess of a moment.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

from flint import arb, arb_mat

from tippedisk_verify.proofs.kernel.balls import ball, negative, positive
from tippedisk_verify.proofs.kernel.flow import Model, Path, Step
from tippedisk_verify.proofs.kernel.frame import Frame as Box
from tippedisk_verify.proofs.kernel.section import UPRIGHT, enclosed_moment
from tippedisk_verify.proofs.search.local_manifolds import FAST, SLOW, UNSTABLE, Frame
from tippedisk_verify.proofs.search.steps import Steps

__all__ = ["Landing", "fly_over", "joined"]

_LONGEST = 10.0  # s
_SHORTEST_STEP = 2.0**-20  # s; a hundredth of what a box's own spread in time allows
_BISECTIONS = 30


@dataclass(frozen=True)
class Landing:
    """What is proved of all flights from a box. Derivatives are by (z_s, z_f, Omega) at the start."""

    time: Any  #: [s]
    unstable: Any  #: z_u on z_s = -s
    fast: Any  #: z_f there
    unstable_by: tuple[Any, ...]
    fast_by: tuple[Any, ...]
    time_by: tuple[Any, ...]
    beta_most: Any  #: the largest beta_bar [rad]
    beta_most_by: tuple[Any, ...]


def joined(landings: Sequence[Landing]) -> Landing:
    """The union of what is proved of each."""

    def union(x: Any, y: Any) -> Any:
        return tuple(map(union, x, y)) if isinstance(x, tuple) else x.union(y)

    def both(one: Landing, other: Landing) -> Landing:
        return Landing(*(union(getattr(one, name), getattr(other, name)) for name in Landing.__dataclass_fields__))

    return reduce(both, landings)


def fly_over(frame: Frame, model: Model, extents: Sequence[Any], slow: Any, fast: Any) -> tuple[Landing, Path] | None:
    """The flights from z = (u, ``slow``, ``fast``) at the model's speeds, u and s being the two ``extents``.

    Returned with their path, which has been taken to the section; None if they are not proved.
    """
    path = _departing(frame, model, (extents[0], slow, fast))
    s = extents[1]
    tops: list[tuple[Any, tuple[Any, ...]]] = []
    longest = None
    while path.time < _LONGEST:
        step = path.step(longest)
        if step is None or not _climbs(model, step, tops):
            return None
        level = seen(frame, path.carried(step))[SLOW] + s
        z, rising = _overall(frame, model, step)
        if negative(level) and (rising or negative(z[SLOW] + s)):
            path.take(step)
            longest = None
        elif positive(level) and rising:
            return _landed(frame, model, path, step, s, tops)
        else:  # the next step is to begin well before the section
            longest = step.length / 2
            if longest < _SHORTEST_STEP:
                return None
    return None


def _departing(frame: Frame, model: Model, z: Sequence[Any]) -> Path:
    """The path of a box of z about the first saddle."""
    path = model.path((arb(0), arb(0), arb(0)), Steps(), derivatives=True)
    box: Box = path.frame
    beta, gamma, v = frame.offset([part.mid() for part in z])
    start = (beta, gamma - arb.pi(), v)
    box.middle = [part.mid() for part in start]
    box.rest = [part - point for part, point in zip(start, box.middle, strict=True)]
    box.lead = [[*(frame.directions[row, k] for k in range(3)), box.lead[row][3]] for row in range(3)]
    box.deviation = [*(part - part.mid() for part in z), box.deviation[3]]
    path.box = box.box()
    return path


def seen(frame: Frame, box: Box) -> list[Any]:
    """z about the second saddle of a set of states, each coordinate in one sum over the set's own axes."""
    beta, gamma, v = box.middle
    middle = frame.coordinates((beta, gamma - arb.pi(), v))
    lead, axes = (frame.inverse * arb_mat([list(row) for row in part]) for part in (box.lead, box.axes))
    return [
        middle[row]
        + sum((lead[row, k] * part for k, part in enumerate(box.deviation)), arb(0))
        + sum((axes[row, k] * box.rest[k] for k in range(3)), arb(0))
        for row in range(3)
    ]


def _overall(frame: Frame, model: Model, step: Step) -> tuple[list[Any], bool]:
    """z about the second saddle throughout a step, and whether F_s > 0 there."""
    beta, gamma, v = step.enclosure
    z = frame.coordinates((beta, gamma - arb.pi(), v))
    return z, bool(positive(frame.rates(model.omega, z)[SLOW]))


def _climbs(model: Model, step: Step, tops: list[tuple[Any, tuple[Any, ...]]]) -> bool:
    """Whether gamma grows throughout and v has at most one zero; notes what beta_bar may be at it."""
    beta, _, v = step.enclosure
    if not (positive(beta) and positive(ball(UPRIGHT) - beta)):
        return False
    if positive(v) or negative(v):
        return True
    if not negative(model.rates(step.enclosure)[2]):
        return False
    half = ball(step.length) / 2
    tops.append((beta, step.derivatives_at(half + arb(0, half))[0][1:]))
    return True


def _landed(
    frame: Frame, model: Model, path: Path, step: Step, s: Any, tops: list[tuple[Any, tuple[Any, ...]]]
) -> tuple[Landing, Path] | None:
    """The arrival on z_s = -s in a step that ends after it, where the path is taken; None if it is not proved."""

    def level(time: Any) -> Any:
        return seen(frame, path.carried(step, time))[SLOW] + s

    def slope(time: Any) -> Any:
        return frame.rates(model.omega, seen(frame, path.carried(step, time)))[SLOW]

    if not (negative(level(arb(0))) and tops):
        return None
    low, high = 0.0, step.length
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        low, high = (middle, high) if level(ball(middle)).mid() < 0 else (low, middle)
    z, _ = _overall(frame, model, step)
    moment, proved = enclosed_moment(step, ball(low), level, frame.rates(model.omega, z)[SLOW], slope)
    if not proved:
        return None
    path.take(step, moment)
    z = seen(frame, path.frame)
    z[SLOW] = -s
    rates = frame.rates(model.omega, z)
    rows = frame.inverse * arb_mat([list(row) for row in path.matrix])
    time_by = tuple(-rows[SLOW, k] / rates[SLOW] for k in (1, 2, 3))
    by = [tuple(rows[row, k] + rates[row] * t for k, t in zip((1, 2, 3), time_by, strict=True)) for row in (0, 2)]
    beta_most, beta_by = tops[0]
    for other, slopes in tops[1:]:
        beta_most, beta_by = beta_most.union(other), tuple(a.union(b) for a, b in zip(beta_by, slopes, strict=True))
    return Landing(path.time, z[UNSTABLE], z[FAST], by[0], by[1], time_by, beta_most, beta_by), path
