"""The paper's claims, one by one, and what becomes of each.

A claim examines itself on every audited parameter set and returns a `Finding`. A claim that does not follow is a
result; only the suite's own cross-checks (``own_check``) can fail.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from decimal import Decimal
from enum import Enum
from fractions import Fraction
from functools import cached_property
from typing import Any, Literal, NamedTuple, TypeVar

from tippedisk_verify.audit.citations import cited
from tippedisk_verify.connection.heteroclinic import Heteroclinic
from tippedisk_verify.cycles.branch import family, found
from tippedisk_verify.cycles.omega_h import heteroclinic
from tippedisk_verify.cycles.period_continuation import PeriodContinuation
from tippedisk_verify.cycles.shooting import LimitCycle
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.exact import shown
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import NAMED_SETS, Friction, Parameters
from tippedisk_verify.model.results import Printable
from tippedisk_verify.motion.scenes import Panel, compute, scene_named

__all__ = [
    "Answer",
    "Audit",
    "Claim",
    "Examination",
    "Fault",
    "FaultKind",
    "Finding",
    "ProofOffer",
    "Theorem",
    "Verdict",
    "examined",
    "number",
    "rounds_to",
    "sets_with",
    "word",
]

T = TypeVar("T")


class Verdict(Enum):
    """What becomes of a claim."""

    HOLDS = "holds"
    HOLDS_FOR = "holds-for"
    DOES_NOT_FOLLOW = "does-not-follow"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class Finding:
    """The outcome of one claim: what was computed for each set, and for which sets it holds (None: undecided)."""

    computed: dict[str, Measured | str]
    holds: dict[str, bool | None]
    note: str = ""

    @property
    def verdict(self) -> Verdict:
        answers = list(self.holds.values())
        if all(answers):
            return Verdict.HOLDS
        if any(answers):
            return Verdict.HOLDS_FOR
        return Verdict.UNDECIDED if None in answers else Verdict.DOES_NOT_FOLLOW

    @property
    def sets(self) -> tuple[str, ...]:
        """The sets for which it holds."""
        return tuple(name for name, answer in self.holds.items() if answer)

    def record(self) -> dict[str, Any]:
        """As plain data that loses nothing: numbers as exact fractions."""
        computed = {
            name: value if isinstance(value, str) else [str(value.value), str(value.uncertainty)]
            for name, value in self.computed.items()
        }
        return {"computed": computed, "holds": self.holds, "note": self.note}

    @classmethod
    def of_record(cls, record: dict[str, Any]) -> Finding:
        """What `record` gave."""
        computed = {
            name: value if isinstance(value, str) else Measured(*map(Fraction, value))
            for name, value in record["computed"].items()
        }
        return cls(computed, record["holds"], record["note"])


class Theorem(NamedTuple):
    """A theorem of docs/certified.md, and the commands that prove what it says of one disk."""

    name: str
    commands: tuple[str, ...]
    law: Friction | None = None  #: the only one that it covers; None: both
    every_disk: bool = False


class ProofOffer(NamedTuple):
    """What a theorem has to say to a claim."""

    theorem: Theorem
    proves: str
    rest: str = ""  #: what of the claim it leaves unproved


FaultKind = Literal["slip", "follows-from", "differs"]


class Fault(NamedTuple):
    """Why a claim does not follow, and what is true instead.

    A ``slip`` is one of the pen: the paper itself shows what is meant. What ``follows-from`` another claim or a dropped
    term has that one's name as its cause. Anything else ``differs``.
    """

    kind: FaultKind
    cause: str
    instead: str


@dataclass(frozen=True)
class Claim:
    """One sentence, formula or number of the paper (or one cross-check of our own), with all that belongs to it."""

    name: str
    labels: str  #: LaTeX labels of the paper's equations, figures, tables and sections, as `cited` takes them
    statement: str
    printed: str  #: what the paper prints
    examine: Examination  #: of one set of the audit, against what is printed
    note: str = ""
    methods: tuple[str, ...] = ("exact arithmetic",)
    formula: str = ""  #: what the paper writes, in LaTeX: its formula, or the sentence's mathematical content
    unit: str = ""  #: of what is printed and computed, where that is a number
    fault: Fault | None = None  #: where the claim follows for no disk
    own_check: bool = False
    figures: tuple[str, ...] = ()  #: the exhibits that are drawn with it
    proof: ProofOffer | None = None
    cost: float = 0.0  #: what examining three sets takes alone on one core [s], where that is two or more

    @property
    def cited(self) -> str:
        """Published numbers: what the claim is about, and then what it uses."""
        return "own cross-check" if self.own_check else cited(self.labels)

    @property
    def source(self) -> str:
        """Published numbers, with the LaTeX labels behind."""
        return self.cited if self.own_check else f"{self.cited}, {re.sub('below |from ', '', self.labels)}"


@dataclass(repr=False)
class Audit(Printable):
    """What the claims are examined on: the parameter sets, and what several claims share, computed once."""

    parameters: Parameters
    engine: Engine
    digits: int = 12
    _kept: dict[tuple[str, ...], Any] = field(default_factory=dict)

    def _once(self, what: tuple[str, ...], compute: Callable[[], T]) -> T:
        """What is computed when it is first needed, and kept."""
        if what not in self._kept:
            self._kept[what] = compute()
        kept: T = self._kept[what]
        return kept

    @cached_property
    def sets(self) -> dict[str, Parameters]:
        """The selected set first, then those that describe the paper's disk."""
        return sets_with(self.parameters)

    def _set(self, name: str) -> Parameters:
        if name not in self.sets:
            raise InputError(f"parameter set '{shown(name)}' is not audited: use {', '.join(self.sets)}")
        return self.sets[name]

    def linear(self, name: str) -> Parameters:
        """A set under the linear law, for what is said of expansions where the disk rolls."""
        return self._set(name).with_friction("linear")

    def connection(self, name: str) -> Heteroclinic:
        """The heteroclinic connection of a set. Raises InputError for an unknown set, AccuracyError if it has none."""
        return self._once(("connection", name), lambda: heteroclinic(self._set(name), self.engine))

    def omega_h(self, name: str) -> Measured:
        """Omega_h [rad/s] of a set. Raises AccuracyError if there is no connection."""
        return self.connection(name).omega_h

    def approach(self, name: str) -> PeriodContinuation:
        """A set's limit cycles followed towards Omega_h in double. Raises NoSuchCycleError or AccuracyError."""
        return self._once(("approach", name), lambda: PeriodContinuation(self._set(name), self.engine))

    def family(self, name: str) -> tuple[LimitCycle, ...]:
        """An overview of a set's limit cycles."""
        return self._once(("family", name), lambda: tuple(found(family(self._set(name), self.engine))))

    def panel(self, scene: str, name: str) -> Panel:
        """One of the six scenes of a set."""
        panel = scene_named(scene)
        omega_h = self.omega_h(name) if panel.base == "Omega_h" else None
        return self._once((scene, name), lambda: compute(panel, self._set(name), self.engine, omega_h=omega_h))


def sets_with(parameters: Parameters) -> dict[str, Parameters]:
    """The audited sets, all under one friction law: the selected one first, then `NAMED_SETS`."""
    chosen = {parameters.name: parameters}
    return chosen | {name: one.with_friction(parameters.friction) for name, one in NAMED_SETS.items()} | chosen


def rounds_to(measured: Measured, printed: str) -> bool | None:
    """Whether the true value rounds to the printed decimal; None if the half-width leaves that open."""
    target = Fraction(printed)
    exponent = Decimal(printed).as_tuple().exponent
    half_unit = Fraction(10) ** int(exponent) / 2
    distance = abs(measured.value - target)
    if distance + measured.uncertainty <= half_unit:
        return True
    return False if distance - measured.uncertainty > half_unit else None


def examined(audit: Audit, claim: Claim) -> Finding:
    """What becomes of one claim, set by set; our own checks look at the selected set only.

    A computation that falls short leaves its set undecided, with the reason, and the others' answers alone.
    """
    computed: dict[str, Measured | str] = {}
    holds: dict[str, bool | None] = {}
    notes = [claim.note]
    for name in (audit.parameters.name,) if claim.own_check else audit.sets:
        try:
            computed[name], holds[name], *said = claim.examine(audit, name, claim.printed)
            notes += said
        except (AccuracyError, ArithmeticError, InputError) as reason:
            computed[name], holds[name] = "-", False if claim.own_check else None
            notes.append(f"{name}: {reason}")
    return Finding(computed, holds, "; ".join(filter(None, notes)))


def word(compute: Callable[[Audit, str], str]) -> Examination:
    """The examination of a printed word: whether what is computed comes to the same word."""
    return _against(compute, str.__eq__)


def number(compute: Callable[[Audit, str], Measured]) -> Examination:
    """The examination of a printed number: whether the computed one rounds to it."""
    return _against(compute, rounds_to)


def _against(compute: Callable[[Audit, str], Any], agrees: Callable[[Any, str], bool | None]) -> Examination:
    def examine(audit: Audit, name: str, printed: str) -> Answer:
        answer = compute(audit, name)
        return answer, agrees(answer, printed)

    return examine


#: What is computed for one set, whether the claim holds for it, and what is to be noted.
Answer = tuple[Measured | str, bool | None] | tuple[Measured | str, bool | None, str]
#: From the audit, the name of one of its sets, and what is printed.
Examination = Callable[[Audit, str, str], Answer]
