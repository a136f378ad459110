"""The classes of the audit: a claim of the paper, its examination, and its verdict.

A claim is examined on every audited parameter set, which gives a `Finding`. A claim that does not
follow is a result. Only the suite's own cross-checks (``own_check``) can fail.
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

from tippedisk_verify.audit.citations import published_numbers
from tippedisk_verify.cycles.branch_cycles import cycles_found, librating_branch
from tippedisk_verify.cycles.limit_cycle import LimitCycle
from tippedisk_verify.cycles.near_omega_h.period_continuation import PeriodContinuation
from tippedisk_verify.display import Printable
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.friction import Friction
from tippedisk_verify.model.parameters import NAMED_SETS, Parameters
from tippedisk_verify.motion.scenes import ComputedScene, compute_scene, scene_named
from tippedisk_verify.numbers.exact import short_text
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.omega_h.connecting_orbit import Heteroclinic
from tippedisk_verify.omega_h.methods import heteroclinic

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
    "examine_claim",
    "measuring_engine",
    "printed_number",
    "printed_word",
    "rounds_to",
    "sets_with",
]

T = TypeVar("T")


class Verdict(Enum):
    """The verdict on a claim."""

    HOLDS = "holds"
    HOLDS_FOR = "holds-for"
    DOES_NOT_FOLLOW = "does-not-follow"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class Finding:
    """The outcome of examining one claim on all audited parameter sets."""

    computed: dict[str, Measured | str]  #: the computed value, by parameter set
    holds: dict[str, bool | None]  #: whether it holds, by parameter set; None: undecided
    note: str = ""

    @property
    def verdict(self) -> Verdict:
        """The verdict on the claim over all parameter sets."""
        answers = list(self.holds.values())
        if all(answers):
            return Verdict.HOLDS
        if any(answers):
            return Verdict.HOLDS_FOR
        return Verdict.UNDECIDED if None in answers else Verdict.DOES_NOT_FOLLOW

    @property
    def sets(self) -> tuple[str, ...]:
        """The sets for which the claim holds."""
        return tuple(name for name, answer in self.holds.items() if answer)

    def record(self) -> dict[str, Any]:
        """Return the finding as plain data, with numbers as exact fractions."""
        computed = {
            name: value if isinstance(value, str) else [str(value.value), str(value.uncertainty)]
            for name, value in self.computed.items()
        }
        return {"computed": computed, "holds": self.holds, "note": self.note}

    @classmethod
    def of_record(cls, record: dict[str, Any]) -> Finding:
        """Restore a finding from its plain data, as `record` returns it."""
        computed = {
            name: value if isinstance(value, str) else Measured(*map(Fraction, value))
            for name, value in record["computed"].items()
        }
        return cls(computed, record["holds"], record["note"])


class Theorem(NamedTuple):
    """A theorem of docs/certified.md, and the commands that prove it for one disk."""

    name: str
    commands: tuple[str, ...]

    law: Friction | None = None  #: the only law that it covers; None for both
    every_disk: bool = False  #: True if it holds for every disk


class ProofOffer(NamedTuple):
    """A theorem that proves a claim, or a part of it."""

    theorem: Theorem
    proves: str
    not_proved: str = ""  #: the part of the claim that it does not prove


FaultKind = Literal["slip", "follows-from", "differs"]


class Fault(NamedTuple):
    """The reason why a claim does not follow, and the true statement.

    A ``slip`` is a slip of the pen: the paper itself shows what is meant. A fault ``follows-from``
    another claim or a dropped term; its cause then names that claim or term. Any other fault
    ``differs``.
    """

    kind: FaultKind
    cause: str
    instead: str


@dataclass(frozen=True)
class Claim:
    """A sentence, formula or number of the paper, or a cross-check of our own."""

    name: str
    #: LaTeX labels of equations, figures, tables and sections, as `published_numbers` takes them
    labels: str
    statement: str
    printed: str  #: the word, number or formula that the paper prints
    examine: Examination  #: compares one set with what is printed
    note: str = ""
    methods: tuple[str, ...] = ("exact arithmetic",)
    formula: str = ""  #: the paper's formula, or the sentence's mathematical content, in LaTeX
    unit: str = ""  #: the unit of the printed and the computed number
    fault: Fault | None = None  #: the fault, if the claim follows for no disk
    own_check: bool = False
    figures: tuple[str, ...] = ()  #: the exhibits that illustrate it
    proof: ProofOffer | None = None
    cost: float = 0.0  #: time to examine three sets on one core [s], if that is two or more

    @property
    def cited(self) -> str:
        """The published numbers of the claim, then of the equations that it uses."""
        return "own cross-check" if self.own_check else published_numbers(self.labels)

    @property
    def source(self) -> str:
        """The published numbers, followed by the LaTeX labels."""
        return (
            self.cited
            if self.own_check
            else f"{self.cited}, {re.sub('below |from ', '', self.labels)}"
        )


@dataclass(repr=False)
class Audit(Printable):
    """The parameter sets that claims are examined on, and results that several claims share.

    A shared result is computed once.
    """

    parameters: Parameters
    engine: Engine
    digits: int = 12
    _results: dict[tuple[str, ...], Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.parameters.refuse_custom_law("the paper's claims are examined")

    def _shared(self, key: tuple[str, ...], compute: Callable[[], T]) -> T:
        """Return the shared result with this key; compute and store it when it is first needed."""
        if key not in self._results:
            self._results[key] = compute()
        kept: T = self._results[key]
        return kept

    @cached_property
    def sets(self) -> dict[str, Parameters]:
        """The selected set, followed by the sets that describe the paper's disk."""
        return sets_with(self.parameters)

    def _set(self, name: str) -> Parameters:
        if name not in self.sets:
            raise InputError(
                f"parameter set '{short_text(name)}' is not audited: use {', '.join(self.sets)}"
            )
        return self.sets[name]

    def under_linear_law(self, name: str) -> Parameters:
        """Return a set under the linear law, for claims about expansions where the disk rolls.

        Args:
            name: The set's name.

        Raises:
            InputError: If the set is not audited.
        """
        return self._set(name).with_friction("linear")

    def connection(self, name: str) -> Heteroclinic:
        """Return the heteroclinic connection of the disk with an audited parameter set.

        Args:
            name: The set's name.

        Raises:
            InputError: If the set is not audited.
            AccuracyError: If it has no connection.
        """
        return self._shared(
            ("connection", name), lambda: heteroclinic(self._set(name), self.engine)
        )

    def omega_h(self, name: str) -> Measured:
        """Return Omega_h [rad/s] of the disk with an audited parameter set.

        Args:
            name: The set's name.

        Raises:
            InputError: If the set is not audited.
            AccuracyError: If it has no connection.
        """
        return self.connection(name).omega_h

    def period_continuation(self, name: str) -> PeriodContinuation:
        """Return a set's limit cycles, followed towards Omega_h in double precision.

        Args:
            name: The set's name.

        Raises:
            NoSuchCycleError: If there is no cycle to start from.
            AccuracyError: If the continuation fails.
        """
        return self._shared(
            ("approach", name), lambda: PeriodContinuation(self._set(name), self.engine)
        )

    def family(self, name: str) -> tuple[LimitCycle, ...]:
        """Return the limit cycles of a set that `cycles.branch_cycles.librating_branch` finds at its
        default speeds.

        Args:
            name: The set's name.
        """
        return self._shared(
            ("family", name),
            lambda: tuple(cycles_found(librating_branch(self._set(name), self.engine))),
        )

    def computed_scene(self, scene: str, name: str) -> ComputedScene:
        """Return one of the six scenes, computed for a set.

        Args:
            scene: The scene's letter, a to f.
            name: The set's name.
        """
        definition = scene_named(scene)
        omega_h = self.omega_h(name) if definition.base == "Omega_h" else None
        return self._shared(
            (scene, name),
            lambda: compute_scene(definition, self._set(name), self.engine, omega_h=omega_h),
        )


def measuring_engine(audit: Audit) -> Engine:
    """Return the engine of an audit if it measures its error, otherwise the default engine."""
    return audit.engine if audit.engine.measures_error else default_engine()


def sets_with(parameters: Parameters) -> dict[str, Parameters]:
    """Return the audited sets by name, all under the friction law of ``parameters``. The selected
    set comes first, then `NAMED_SETS`.
    """
    chosen = {parameters.name: parameters}
    named = {name: disk.with_friction(parameters.friction) for name, disk in NAMED_SETS.items()}
    return chosen | named | chosen


def rounds_to(measured: Measured, printed: str) -> bool | None:
    """Return True if the true value rounds to a printed decimal, and False if it does not.

    Returns:
        None if the half-width leaves it open.
    """
    target = Fraction(printed)
    exponent = Decimal(printed).as_tuple().exponent
    half_unit = Fraction(10) ** int(exponent) / 2
    distance = abs(measured.value - target)
    if distance + measured.uncertainty <= half_unit:
        return True
    return False if distance - measured.uncertainty > half_unit else None


def examine_claim(audit: Audit, claim: Claim) -> Finding:
    """Examine a claim on each audited set; our own checks use the selected set only.

    If a computation fails, its set is undecided, and the finding's note gives the reason. An own
    check then fails.
    """
    computed: dict[str, Measured | str] = {}
    holds: dict[str, bool | None] = {}
    notes = [claim.note]
    for set_name in (audit.parameters.name,) if claim.own_check else audit.sets:
        try:
            computed[set_name], holds[set_name], *remarks = claim.examine(
                audit, set_name, claim.printed
            )
            notes += remarks
        except (AccuracyError, ArithmeticError, InputError) as reason:
            computed[set_name], holds[set_name] = "-", False if claim.own_check else None
            notes.append(f"{set_name}: {reason}")
    return Finding(computed, holds, "; ".join(filter(None, notes)))


def printed_word(compute: Callable[[Audit, str], str]) -> Examination:
    """Return a function that examines a printed word of the paper: the computed word must be the
    same.
    """
    return _comparing(compute, str.__eq__)


def printed_number(compute: Callable[[Audit, str], Measured]) -> Examination:
    """Return a function that examines a printed number of the paper: the computed number must round
    to it.
    """
    return _comparing(compute, rounds_to)


def _comparing(
    compute: Callable[[Audit, str], Any], agrees: Callable[[Any, str], bool | None]
) -> Examination:
    def examine(audit: Audit, set_name: str, printed: str) -> Answer:
        answer = compute(audit, set_name)
        return answer, agrees(answer, printed)

    return examine


#: The computed value for one set, True if the claim holds for it, and an optional note.
Answer = tuple[Measured | str, bool | None] | tuple[Measured | str, bool | None, str]
#: A function of the audit, the name of one of its sets, and the printed text.
Examination = Callable[[Audit, str, str], Answer]
