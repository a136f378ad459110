"""Whether uncertainties hold: random disks, speeds and requests, each answer held against 30 digits or more.

There are two rows of draws. Of a hundred ``around`` the paper's disk ninety are closed forms, right-hand sides and runs
of at most a second, nine are limit cycles, and one lies at or next to Omega_h. Of a hundred ``far`` from it, for all of
which an integrator is needed, half are runs, and half are cycles, branches and connections. A draw depends on its row,
the seed and its index alone, so any one of them can be repeated by its number, in any arithmetic.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache, partial
from statistics import median
from typing import Literal

from tests.stress.honesty import connection_requests, cycle_requests, local_requests, motion_requests
from tests.stress.honesty.arithmetics import DEFAULT, Arithmetic
from tests.stress.honesty.comparison import Asked, Number, unlike
from tests.stress.honesty.draws import FAR, generator
from tippedisk_verify.errors import InputError, Shortfall

__all__ = [
    "BY_SCIPY",
    "CLOSED",
    "IN_LANES",
    "KINDS",
    "ROWS",
    "Draw",
    "Row",
    "Summary",
    "drawn",
    "honesty",
    "kind_of",
    "summary",
]

Outcome = Literal["holds", "violated", "refused"]
Row = Literal["around", "far"]
_BLOCK = 100
_SHARPER = 90  # bits by which the truth about a violation is found again

_flow, _connection = motion_requests.flow, connection_requests.connection
_REQUESTS: dict[str, Callable[..., Asked]] = {
    **local_requests.BY_NAME,
    **{name: partial(_flow, what=name) for name in motion_requests.RUNS},
    "limit-cycle": cycle_requests.cycle,
    "limit-cycle in double": cycle_requests.cycle_in_double,
    "smooth limit-cycle": cycle_requests.smooth_cycle,
    "smooth limit-cycle in double": partial(cycle_requests.cycle_in_double, friction="smooth"),
    "harmonic-balance": cycle_requests.balanced,
    "branch": cycle_requests.branch,
    "heteroclinic": partial(_connection, method="manifolds"),
    "passage": connection_requests.passage,
    "next to Omega_h": connection_requests.cycle_next_to_it,
    "bisection": partial(_connection, method="bisection"),
    "smooth heteroclinic": partial(_connection, friction="smooth", method="manifolds"),
    "above Omega_h": connection_requests.cycle_closer,
    "smooth passage": partial(connection_requests.passage, friction="smooth"),
    "limit of cycles": partial(_connection, method="limit-cycles"),
    "scipy bisection": partial(_connection, method="scipy"),
    "smooth next to Omega_h": partial(connection_requests.cycle_next_to_it, friction="smooth"),
    "smooth bisection": partial(_connection, friction="smooth", method="bisection"),
    "smooth scipy bisection": partial(_connection, friction="smooth", method="scipy"),
}
KINDS = tuple(_REQUESTS)
#: Kinds that no arithmetic of the integrators touches, kinds that run in lanes, and kinds that SciPy integrates.
CLOSED, IN_LANES, BY_SCIPY = tuple(local_requests.BY_NAME), ("branch",), ("scipy bisection", "smooth scipy bisection")

#: How many of a hundred draws ask for what: in turn, from one hundred to the next, where it is several things.
ROWS: dict[Row, tuple[tuple[int, tuple[str, ...]], ...]] = {
    "around": (
        (20, ("flow",)), (18, ("events",)), (10, ("derivatives",)),
        (14, ("right-hand side",)), (12, ("equilibria",)), (7, ("hopf",)), (7, ("one-harmonic",)),
        (1, ("melnikov",)), (1, ("slow-manifold",)),
        (2, ("limit-cycle",)), (2, ("limit-cycle in double",)), (2, ("smooth limit-cycle",)),
        (2, ("harmonic-balance",)), (1, ("branch",)),
        (1, ("heteroclinic", "passage", "next to Omega_h", "bisection", "smooth heteroclinic", "above Omega_h",
             "smooth passage", "limit of cycles", "scipy bisection", "smooth next to Omega_h")),
    ),
    "far": (
        (10, ("flow",)), (10, ("events",)), (8, ("derivatives",)), (7, ("half periods",)),
        (5, ("derivatives by parameters",)), (3, ("divergence",)), (6, ("flow at a tolerance",)),
        (16, ("limit-cycle in double",)), (8, ("smooth limit-cycle in double",)),
        (4, ("limit-cycle",)), (4, ("smooth limit-cycle",)), (4, ("harmonic-balance",)), (6, ("branch",)),
        (3, ("bisection", "smooth bisection")), (2, ("heteroclinic", "smooth heteroclinic")),
        (1, ("scipy bisection", "smooth scipy bisection")), (1, ("passage", "smooth passage")),
        (1, ("next to Omega_h", "smooth next to Omega_h")), (1, ("above Omega_h", "limit of cycles")),
    ),
}  # fmt: skip
_TURNS = {row: tuple(names for count, names in shares for _ in range(count)) for row, shares in ROWS.items()}


@dataclass(frozen=True)
class Draw:
    """One request: what was asked, and how the claims in its answer stand to the truth."""

    index: int
    kind: str
    asked: str
    outcome: Outcome
    reason: str | None = None  #: of a refusal, or what went wrong
    numbers: tuple[Number, ...] = ()
    arithmetic: str = DEFAULT.name

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


def kind_of(index: int, row: Row = "around") -> str:
    """What the draw of that index asks for."""
    block, place = divmod(index, _BLOCK)
    names = _TURNS[row][place]
    return names[block % len(names)]


@lru_cache(maxsize=512)
def _asked(seed: int, index: int, row: Row) -> Asked:
    """Kept for a while, so that the truth is found once for all arithmetics."""
    request, random = _REQUESTS[kind_of(index, row)], generator(seed, index)
    return request(random) if row == "around" or kind_of(index, row) in CLOSED else request(random, families=FAR)


def drawn(seed: int, index: int, arithmetic: Arithmetic = DEFAULT, row: Row = "around") -> Draw:
    """The draw of that number, computed. A violation counts if a sharper truth confirms it."""
    kind = kind_of(index, row)
    asked = _asked(seed, index, row)
    try:
        with arithmetic.active(f"{seed}/{index}"):
            answer = asked.answer(arithmetic)
        numbers = tuple(asked.compared(answer, 0))
        if not all(number.holds for number in numbers):
            numbers = tuple(asked.compared(answer, _SHARPER))
    except (Shortfall, InputError) as refusal:
        return Draw(index, kind, asked.text, "refused", str(refusal), arithmetic=arithmetic.name)
    except Exception as fault:  # not a refusal but a defect, and part of the result
        reason = f"{type(fault).__name__}: {fault}"
        return Draw(index, kind, asked.text, "violated", reason, (unlike("answer"),), arithmetic.name)
    outcome: Outcome = "holds" if all(number.holds for number in numbers) else "violated"
    return Draw(index, kind, asked.text, outcome, None, numbers, arithmetic.name)


def honesty(
    draws: int | Iterable[int], seed: int = 1, arithmetic: Arithmetic = DEFAULT, row: Row = "around"
) -> Iterator[Draw]:
    """The first ``draws`` draws of a seed, or those of the given indices, one after the other."""
    for index in range(draws) if isinstance(draws, int) else draws:
        yield drawn(seed, index, arithmetic, row)


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
