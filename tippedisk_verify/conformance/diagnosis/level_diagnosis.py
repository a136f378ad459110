"""The diagnosis of one level: its failed answers, their causes, and what remains unexplained."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from tippedisk_verify.conformance.grading import LEVEL_NAMES, Grade
from tippedisk_verify.reference_values.store import is_optional

__all__ = ["Diagnosis"]


@dataclass(frozen=True)
class Diagnosis:
    """The failed answers to the questions of one level, with their causes as far as
    they are known.
    """

    level: int
    failed: tuple[Grade, ...]
    #: The causes, which act together, each as its sort and its sentence; () if none is known
    causes: tuple[tuple[str, str], ...]
    #: The number of failed answers that follow from mistakes named at earlier levels
    follows: int
    unexplained: int
    no_numbers: int  #: the number of failed answers that are not finite; no mistake predicts them
    where: str = ""  #: the unexplained answers, by quantity and condition
    #: True if unexplained answers may follow from mistakes named at earlier levels
    may_follow: bool = False

    def _parts_of_ids(self, place: int) -> list[str]:
        """Return the parameter sets (place 0) or the friction laws (1) of the failed answers."""
        return sorted({grade.id.split("/")[place] for grade in self.failed})

    @property
    def too_few_digits(self) -> int:
        """The number of failed answers that are right but have too few digits."""
        return sum(grade.verdict == "few-digits" for grade in self.failed)

    @property
    def status(self) -> str:
        """One word: explained, partly, unexplained, follows or may-follow from earlier levels, or
        no-numbers.
        """
        if self.unexplained:
            return (
                "partly"
                if self.causes or self.follows
                else "may-follow"
                if self.may_follow
                else "unexplained"
            )
        return "explained" if self.causes else "follows" if self.follows else "no-numbers"

    def summary(self) -> str:
        """Return the diagnosis of one level in one line of text: the failures, their causes, and
        what is unexplained.
        """
        sets, frictions = self._parts_of_ids(0), self._parts_of_ids(1)
        laws = f"{frictions[0]} friction" if frictions in (["linear"], ["smooth"]) else "both laws"
        text = f"level {self.level}, {LEVEL_NAMES[self.level]} ({' and '.join(sets)}, {laws}): "
        counts = (
            (len(self.failed) - self.too_few_digits, "wrong"),
            (self.too_few_digits, "with too few digits only"),
        )
        text += ", ".join(f"{count} {how}" for count, how in counts if count)
        if any(is_optional(grade.id) for grade in self.failed):
            text += " (with optional answers)"
        if self.no_numbers:
            text += f", {self.no_numbers} of them not finite"
        if len(self.causes) > 1:
            text += "; likely causes, together: " + "; ".join(
                f"({n}) {sentence}" for n, (_, sentence) in enumerate(self.causes, 1)
            )
        elif self.causes:
            text += f"; likely cause: {self.causes[0][1]}"
        if self.follows:
            text += f"; {self.follows} follow from what is named at earlier levels"
        if self.unexplained and self.may_follow:
            text += f"; {self.unexplained} unexplained that may follow from what is named at earlier levels"
        elif self.unexplained:
            text += f"; {self.unexplained} unexplained" + (f" ({self.where})" if self.where else "")
        return text

    def to_dict(self) -> dict[str, Any]:
        return {
            "level": self.level,
            "sets": self._parts_of_ids(0),
            "frictions": self._parts_of_ids(1),
            "failed": len(self.failed),
            "too_few_digits": self.too_few_digits,
            "no_numbers": self.no_numbers,
            "status": self.status,
            "causes": [{"name": name, "cause": sentence} for name, sentence in self.causes],
            "follows": self.follows,
            "unexplained": self.unexplained,
            "where": self.where,
        }
