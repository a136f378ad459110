"""Whether uncertainties hold: random disks, speeds and requests, each answer held against 30 digits or more.

Of a hundred draws in a row ninety are closed forms, right-hand sides and runs of at most a second, nine are limit
cycles, and one lies at or next to Omega_h. A draw depends on the seed and its index alone, so any one of them can be
repeated by its number: ``drawn(seed, index)``.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from random import Random
from statistics import median
from typing import Literal

from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.evidence.stress import connection_requests, cycle_requests, local_requests, motion_requests
from tippedisk_verify.evidence.stress.comparison import Asked, Number, unlike
from tippedisk_verify.evidence.stress.draws import generator

__all__ = ["KINDS", "Draw", "Summary", "drawn", "honesty", "kind_of", "summary"]

Outcome = Literal["holds", "violated", "refused"]
_BLOCK = 100

_CHEAP: dict[str, tuple[int, Callable[[Random], Asked]]] = {  # how many of ninety, and the request
    "flow": (48, motion_requests.flow),
    "right-hand side": (14, local_requests.right_hand_side),
    "equilibria": (12, local_requests.equilibria),
    "hopf": (7, local_requests.hopf),
    "one-harmonic": (7, local_requests.harmonic),
    "melnikov": (1, local_requests.melnikov),
    "slow-manifold": (1, local_requests.slow_manifold_study),
}
_CYCLES: dict[str, tuple[int, Callable[[Random], Asked]]] = {  # how many of nine
    "limit-cycle": (2, cycle_requests.cycle),
    "limit-cycle in double": (2, cycle_requests.cycle_in_double),
    "smooth limit-cycle": (2, cycle_requests.smooth_cycle),
    "harmonic-balance": (2, cycle_requests.balanced),
    "branch": (1, cycle_requests.branch),
}
_NEAR_OMEGA_H: dict[str, Callable[[Random], Asked]] = {  # one in turn
    "heteroclinic": partial(connection_requests.connection, method="manifolds"),
    "passage": connection_requests.passage,
    "next to Omega_h": connection_requests.cycle_next_to_it,
    "bisection": partial(connection_requests.connection, method="bisection"),
    "smooth heteroclinic": partial(connection_requests.connection, method="manifolds", friction="smooth"),
    "above Omega_h": connection_requests.cycle_closer,
    "smooth passage": partial(connection_requests.passage, friction="smooth"),
    "limit of cycles": partial(connection_requests.connection, method="limit-cycles"),
    "scipy bisection": partial(connection_requests.connection, method="scipy"),
    "smooth next to Omega_h": partial(connection_requests.cycle_next_to_it, friction="smooth"),
}
_TURNS = tuple(name for kinds in (_CHEAP, _CYCLES) for name, (count, _) in kinds.items() for _ in range(count))
_REQUESTS = {name: request for kinds in (_CHEAP, _CYCLES) for name, (_, request) in kinds.items()} | _NEAR_OMEGA_H
KINDS = tuple(_REQUESTS)


@dataclass(frozen=True)
class Draw:
    """One request: what was asked, and how the claims in its answer stand to the truth."""

    index: int
    kind: str
    asked: str
    outcome: Outcome
    reason: str | None = None  #: of a refusal, or what went wrong
    numbers: tuple[Number, ...] = ()

    @property
    def worst(self) -> Number | None:
        """The number that comes closest to its half-width, or goes furthest beyond it."""
        return min(self.numbers, key=lambda number: (number.holds, number.ratio), default=None)

    @property
    def claimed(self) -> float | None:
        """The half-width claimed for the worst number."""
        return None if self.worst is None else self.worst.claimed

    @property
    def distance(self) -> float | None:
        """How far the worst number is from the truth."""
        return None if self.worst is None else self.worst.distance

    @property
    def ratio(self) -> float | None:
        """The over-estimate of the draw: the median of claimed over true over its numbers."""
        return median(number.ratio for number in self.numbers) if self.numbers else None


def kind_of(index: int) -> str:
    """What the draw of that index asks for."""
    block, place = divmod(index, _BLOCK)
    if place == _BLOCK - 1:
        names = tuple(_NEAR_OMEGA_H)
        return names[block % len(names)]
    return _TURNS[place]


def drawn(seed: int, index: int) -> Draw:
    """The draw of that number, computed."""
    kind = kind_of(index)
    asked = _REQUESTS[kind](generator(seed, index))
    try:
        numbers = tuple(asked.numbers())
    except (Shortfall, InputError) as refusal:
        return Draw(index, kind, asked.text, "refused", str(refusal))
    except Exception as fault:  # not a refusal but a defect, and part of the result
        return Draw(index, kind, asked.text, "violated", f"{type(fault).__name__}: {fault}", (unlike("answer"),))
    return Draw(index, kind, asked.text, "holds" if all(n.holds for n in numbers) else "violated", None, numbers)


def honesty(draws: int | Iterable[int], seed: int = 1) -> Iterator[Draw]:
    """The first ``draws`` draws of a seed, or those of the given indices, one after the other."""
    for index in range(draws) if isinstance(draws, int) else draws:
        yield drawn(seed, index)


@dataclass(frozen=True)
class Summary:
    """What many draws say."""

    draws: int
    numbers: int  #: compared with the truth
    violated: tuple[Draw, ...]
    refusals: dict[str, Counter[str]] = field(default_factory=dict)  #: by kind, with figures taken out of the reasons
    over_estimates: dict[str, float] = field(default_factory=dict)  #: median of claimed over true, by kind

    @property
    def honest(self) -> bool:
        """Whether every uncertainty held."""
        return not self.violated


def summary(draws: Sequence[Draw]) -> Summary:
    """Counts, refusals by reason, and the median over-estimate of each kind."""
    refusals: dict[str, Counter[str]] = {}
    ratios: dict[str, list[float]] = {}
    for draw in draws:
        if draw.outcome == "refused":
            reason = re.sub(r"\d[\d.]*(e[+-]?\d+)?", "#", draw.reason or "")
            refusals.setdefault(draw.kind, Counter())[reason] += 1
        ratios.setdefault(draw.kind, []).extend(number.ratio for number in draw.numbers)
    return Summary(
        draws=len(draws),
        numbers=sum(len(draw.numbers) for draw in draws),
        violated=tuple(draw for draw in draws if draw.outcome == "violated"),
        refusals=refusals,
        over_estimates={kind: median(values) for kind, values in ratios.items() if values},
    )
