"""One harness for all draws: draw a disk and a question, compute the claim, ask for the truth,
compare half-widths.

A draw is repeatable from its kind, the seed and its index alone: ``run(kind_named("flow"), 7,
seed=3)``. What is claimed is computed in one of the `arithmetics`, the truth in the default one,
with more digits or by another method. A kind is a row of the table in `kinds`.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from fractions import Fraction
from random import Random
from statistics import median
from typing import Any, NamedTuple

from tests.honesty.arithmetics import DEFAULT, MOVED_BITS, Arithmetic
from tippedisk_verify import (
    DOUBLE,
    PRINTED,
    AccuracyError,
    Disk,
    Exact,
    InputError,
    Measured,
    Parameters,
    exact,
    omega_crit,
)
from tippedisk_verify.model.parameters import NAMED_SETS
from tippedisk_verify.numbers.exact import PI
from tippedisk_verify.theory.hopf import criticality

#: Where disks are drawn from: around the paper's, unlike it in one respect, and far from it in
#: everything at once.
FAMILIES = (
    "named",
    "nearby",
    "friction",
    "near-equal",
    "spread",
    "tiny-eccentricity",
    "heavy",
    "far",
)
#: Those that nearly always have the paper's structure: a supercritical Hopf point and a connection
#: below it.
STRUCTURED = ("named", "nearby", "nearby", "friction")
_NAMES = ("r", "e", "m", "A", "B", "g", "mu", "epsilon")


def decimal(value: float, digits: int = 6) -> Fraction:
    """``value`` as a decimal of that many significant digits, exactly: a draw can be written
    down.
    """
    return Fraction(f"{value:.{digits - 1}e}")


# ------------------------------------------------------------------------------------------ drawing
class Draw(Random):
    """The random numbers of one draw, and what is made of them; ``text`` says what was drawn."""

    def __init__(self, number: str) -> None:
        super().__init__(number)
        self.text = ""

    def told(self, drawn: Any) -> Any:
        """What was drawn, noted in the text as well."""
        shown = (
            written(drawn) if isinstance(drawn, Parameters) else repr(float(DOUBLE.number(drawn)))
        )
        self.text += f"{', ' * bool(self.text)}{shown}"
        return drawn

    def log_uniform(self, low: float, high: float) -> float:
        """Between two positive bounds, each decade as likely as the other."""
        return math.exp(self.uniform(math.log(low), math.log(high)))

    def disk(
        self,
        families: Sequence[str] = FAMILIES,
        law: Any = "linear",
        stiffest: float = math.inf,
        born: str | None = None,
    ) -> Disk:
        """A disk that can exist, of one of the families; impossible combinations are drawn again.

        Sliding dies down at no more than ``stiffest`` [1/s]; ``born`` is the criticality of the
        Hopf point.
        """
        while True:
            try:
                known = self._parameters(self.choice(families))
            except InputError:
                continue
            if decay(known) <= stiffest and born in (None, criticality(known)):
                values = {
                    item.name: getattr(known, item.name) for item in fields(known) if item.init
                }
                return self.told(Disk(**values | {"friction": law}))

    def _parameters(self, family: str) -> Parameters:
        if family == "named":
            return NAMED_SETS[self.choice(sorted(NAMED_SETS))]
        if family == "friction":
            mu, epsilon = self.log_uniform(0.01, 3), self.log_uniform(0.001, 3)
            return PRINTED.changed(mu=decimal(mu), epsilon=decimal(epsilon))
        if family == "nearby":
            return PRINTED.changed(
                **{
                    name: decimal(float(getattr(PRINTED, name)) * self.uniform(0.9, 1.1))
                    for name in _NAMES
                }
            )
        if family == "far":
            return self._far()
        r = decimal(self.log_uniform(0.005, 0.5))
        share = {
            "tiny-eccentricity": self.log_uniform(1e-7, 1e-2),
            "heavy": self.uniform(0.4, 0.95),
        }.get(family, self.uniform(0.01, 0.4))
        e, m = r * decimal(share), decimal(self.log_uniform(0.01, 10))
        B = m * e * e + m * r * r * decimal(self.uniform(0.05, 1))
        A = B * (
            1
            + decimal(
                self.log_uniform(1e-9, 0.05) if family == "near-equal" else self.uniform(0, 1)
            )
        )
        mu, epsilon = decimal(self.log_uniform(0.02, 2)), decimal(self.log_uniform(0.01, 1))
        return Parameters(
            r=r, e=e, m=m, A=A, B=B, g=decimal(self.uniform(1, 20)), mu=mu, epsilon=epsilon
        )

    def _far(self) -> Parameters:
        """Radii from 1 to 30 cm, e / r from 0.005 to 0.6, friction over decades, both kinds
        of Hopf point.
        """
        r, share = self.log_uniform(0.01, 0.3), self.log_uniform(0.005, 0.6)
        # Bbar / (m r^2); 1/4 is a thin disk's
        m, inertia = self.log_uniform(0.01, 10), self.uniform(0.1, 0.5)
        least = 1 + share**2 / inertia  # A = B
        # A / Bbar from which on the Hopf point is supercritical; beyond e = r/2 none is.
        bound = (2 - share) / (2 * (1 + share) * (1 - 2 * share)) if share < 0.5 else math.inf
        above = bound < math.inf and (least > bound or self.random() < 0.6)
        ratio = (
            max(least, bound) * (1 + self.log_uniform(1e-3, 1))
            if above
            else self.uniform(least, min(bound, 4))
        )
        bbar = inertia * m * r**2
        values = (r, share * r, m, ratio * bbar, bbar + m * (share * r) ** 2, self.uniform(1, 20))
        friction = self.log_uniform(0.05, 1), self.log_uniform(1e-3, 1)
        return Parameters(
            **{name: decimal(part) for name, part in zip(_NAMES, (*values, *friction), strict=True)}
        )

    def speed(self, disk: Parameters) -> Fraction:
        """Omega [rad/s]: near Omega_crit, next to it, or anywhere within a factor of ten."""
        near, next_to = (
            self.uniform(0.95, 1.05),
            1 + self.choice((-1, 1)) * self.log_uniform(1e-9, 0.1),
        )
        share = self.choice((near, next_to, self.log_uniform(0.1, 10)))
        return self.told(decimal(float(omega_crit(disk)) * share, self.choice((4, 6, 12))))

    def state(self) -> tuple[Exact, Exact, Exact]:
        """(beta, gamma, v) [rad, rad, rad/s] inside the domain, at times next to an
        equilibrium, as near as 1e-24.
        """
        kind = self.random()
        if kind < 0.3:
            away = self.log_uniform(1e-8, 0.3) if kind < 0.2 else self.log_uniform(1e-24, 1e-8)
            beta, gamma, v = (exact(decimal(away * self.uniform(-1, 1))) for _ in range(3))
            return tuple(
                map(
                    self.told,
                    (beta + PI * Fraction(1, 2), gamma + PI * Fraction(self.choice((1, -1)), 2), v),
                )
            )
        # Often asked for
        beta = exact("pi/2") if self.random() < 0.25 else exact(decimal(self.uniform(0.1, 3.04)))
        v = self.uniform(-1, 1) * self.log_uniform(0.1, 50)
        return tuple(map(self.told, (beta, exact(decimal(self.uniform(-7, 7))), exact(decimal(v)))))


def decay(parameters: Parameters) -> float:
    """How fast sliding dies down where the disk spins inverted [1/s], and Omega_crit where
    that is faster.
    """
    p = parameters
    rate = p.mu * p.g / p.epsilon * (p.r + p.e) ** 2 * p.m / p.Bbar
    return max(float(rate), float(omega_crit(parameters)))


def written(parameters: Parameters) -> str:
    """The disk in one line: its name, or its values."""
    if parameters.name in NAMED_SETS:
        return f"{parameters.name} ({parameters.friction})"
    return f"({parameters.friction}) " + ", ".join(
        f"{name} = {x}" for name, x in parameters.decimals().items()
    )


# ---------------------------------------------------------------------------------------- comparing
_NOTHING: AbstractContextManager[Any] = nullcontext()


class Question(NamedTuple):
    """What answers a question, and what gives the truth about that answer; each may refuse."""

    ask: Callable[[], Any]
    truth: Callable[[Any], Any]
    #: Asked if the truth, of unknown error, contradicts the claim
    sharper: Callable[[Any], Any] | None = None


class Kind(NamedTuple):
    """A row of the table."""

    name: str
    pose: Callable[[Draw], Question]
    draws: int  #: in the default tests
    more: int = 0  #: in the slow ones besides
    minutes: float = 0.25  #: that those take
    widest: float = 100  #: what half-widths may be over errors, in the median of many draws
    flown: bool = True  #: whether integrators, and so their arithmetic, are in it


class Number(NamedTuple):
    """A claimed number beside the truth."""

    name: str
    claimed: float  #: half-width, as it is printed
    distance: float  #: of what is printed from the truth
    #: Claimed over distance; of a distance below half of the last printed place that half is taken,
    #: so that an exact hit is not an infinite over-estimate.
    ratio: float
    holds: bool


@dataclass(frozen=True)
class Found:
    """One draw: what was asked, and how the claims in the answer stand to the truth."""

    kind: str
    index: int
    arithmetic: str
    text: str
    outcome: str  #: holds, violated or refused
    reason: str = ""  #: of a refusal, or what went wrong
    numbers: tuple[Number, ...] = ()

    @property
    def worst(self) -> Number | None:
        """The number that comes closest to its half-width, or goes furthest beyond it."""
        return min(self.numbers, key=lambda number: (number.holds, number.ratio), default=None)


def numbers(result: Any, name: str = "") -> dict[str, Any]:
    """All numbers with half-widths and all facts (yes or no, how a run ended) in a result, by
    their names.
    """
    if isinstance(result, Measured | bool | Enum):
        return {name: result}
    if is_dataclass(result) and not isinstance(result, Parameters):
        parts: Iterable[tuple[Any, Any]] = (
            (part.name, getattr(result, part.name)) for part in fields(result)
        )
    elif isinstance(result, dict):
        parts = result.items()
    elif isinstance(result, tuple | list):
        parts = zip(getattr(result, "_fields", range(len(result))), result, strict=True)
    else:
        return {}
    return {
        known: x
        for part, value in parts
        for known, x in numbers(value, f"{name} {part}".strip()).items()
    }


def compared(claims: Any, truths: Any) -> list[Number]:
    """Each number as it is printed beside the truth, which must be known to a hundredth of
    the claim.
    """
    found, known = [], numbers(truths)
    for name, claim in numbers(claims).items():
        if (true := known.get(name)) is None:
            continue
        if not isinstance(claim, Measured):
            found.append(Number(name, 0.0, 0.0 if claim == true else math.inf, 1.0, claim == true))
            continue
        text, width = claim.decimals()
        value, half = Fraction(text), Fraction(width)
        if 100 * true.uncertainty > half > 0:
            known_to, claimed = float(true.uncertainty), float(half)
            raise ArithmeticError(
                f"the truth of {name} is known to {known_to:.1e} only, not {claimed:.1e}"
            )
        away, place = abs(value - true.value), text.lower().partition("e")
        last = Fraction(10) ** (int(place[2] or 0) - len(place[0].partition(".")[2])) / 2
        holds = away <= (half or true.uncertainty)
        # What is exact is neither too wide nor too narrow
        ratio = float(half / max(away, last)) if half else 1.0
        found.append(Number(name, float(half), float(away), ratio, holds))
    if not found:
        raise AccuracyError("nothing to compare")
    return found


def run(
    kind: Kind,
    index: int,
    seed: int = 1,
    arithmetic: Arithmetic | None = None,
    planted: AbstractContextManager[Any] = _NOTHING,
) -> Found:
    """The draw of that number, computed; every other one, if none is given, with moved bits.

    ``planted`` is a context in which the claim, but not the truth, is computed.
    """
    draw = Draw(f"{seed}/{kind.name}/{index}")
    here = arithmetic or (MOVED_BITS if kind.flown and index % 2 else DEFAULT)
    about = (kind.name, index, here.name)
    try:
        with DEFAULT.active("truth"):
            question = kind.pose(draw)
        with here.active(f"{seed}/{index}"), planted:
            answer = question.ask()
        with DEFAULT.active("truth"):
            pairs = compared(answer, question.truth(answer))
            if question.sharper is not None and not all(number.holds for number in pairs):
                pairs = compared(answer, question.sharper(answer))
    except (AccuracyError, InputError) as refusal:
        return Found(*about, draw.text, "refused", str(refusal))
    except Exception as fault:  # a defect, whatever it is
        return Found(*about, draw.text, "violated", f"{type(fault).__name__}: {fault}")
    outcome = "holds" if all(number.holds for number in pairs) else "violated"
    return Found(*about, draw.text, outcome, "", tuple(pairs))


# ----------------------------------------------------------------------------------------- counting
def summary(found: Sequence[Found]) -> str:
    """How many draws of a kind held, were refused and violated, and claimed over true among
    all their numbers.
    """
    counts = Counter(one.outcome for one in found)
    ratios = sorted(number.ratio for one in found for number in one.numbers) or [math.nan]
    spread = f"{ratios[0]:.3g} to {ratios[-1]:.3g}, in the median {median(ratios):.3g}"
    return f"{found[0].kind}: {dict(counts)}, {len(ratios)} numbers, claimed over true {spread}"


def assert_honest(kind: Kind, found: Sequence[Found]) -> None:
    """Every half-width holds, none is hundreds of times too wide in the median, and not everything
    is refused.

    What is wrong is printed with the worst number of each draw.
    """
    wrong, refused = (
        [one for one in found if one.outcome == outcome] for outcome in ("violated", "refused")
    )
    told = [
        f"{one.kind} {one.index} in {one.arithmetic}: {one.text}\n    {one.reason} {one.worst}"
        for one in wrong
    ]
    shown = "\n".join(
        [summary(found), *told, *(f"refused {one.index}: {one.reason}" for one in refused)]
    )
    assert not wrong, shown
    # A study that refuses everything would be honest and worthless.
    assert len(refused) <= len(found) / 2, shown
    # Numbers of one draw have their luck in common: only of many draws the median over-estimate
    # says something.
    few = 10 if len(found) < 10 else 1
    assert median(number.ratio for one in found for number in one.numbers) < few * kind.widest, (
        shown
    )
