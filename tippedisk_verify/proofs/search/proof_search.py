"""The outline of every search for a proof, and its result: a proof with its certificate as a file.

A search makes attempts. An attempt works with one choice, such as a precision, the radii of a box
or the height of a set, and returns what is proved. If it stops, it may name the choice of the next
attempt, which follows from what was refused. The searches differ in the formulas of their attempts;
the loop stands here (`first_success`).

A certificate has a claim, the evidence with which the kernel proved it, and a digest.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any, ClassVar, TypeVar

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.parameters import SYMBOLS, Parameters
from tippedisk_verify.numbers.decimals import exact_text
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.proofs.kernel.balls import Unproved, arb
from tippedisk_verify.proofs.kernel.certificate_format import digest, dyadic_text
from tippedisk_verify.proofs.kernel.certificates import CERTIFICATE_FORMAT, sentence
from tippedisk_verify.proofs.search.step_search import FlightStepSearch

__all__ = [
    "EvidenceSearch",
    "Proof",
    "SearchStopped",
    "certificate_claim",
    "first_success",
    "parameter_texts",
]

Result = TypeVar("Result")


_PRINTED_NAMES = {"reversals": "sliding_reversals"}  # names that differ from those in the claim


class SearchStopped(Unproved):
    """Raised if an attempt gives up; the message may give details.

    Args:
        status: The reason.
        detail: The message.
        next_choice: The choice of the next attempt; None if no other choice would help.
    """

    def __init__(self, status: Any, detail: str = "", next_choice: Any = None) -> None:
        super().__init__(detail)
        self.status, self.next_choice = status, next_choice


def first_success(attempt: Callable[[Any], Result], choice: Any, max_attempts: int) -> Result:
    """Repeat an attempt with other choices until it succeeds, and return its result.

    Raises the last attempt's SearchStopped if none succeeds.

    Args:
        attempt: Called with a choice.
        choice: The choice of the first attempt.
        max_attempts: The largest number of attempts.
    """
    for _ in range(max_attempts):
        try:
            return attempt(choice)
        except SearchStopped as fault:
            stopped, choice = fault, fault.next_choice
        if choice is None:
            break
    stopped.next_choice = None  # an attempt may itself repeat attempts, which have ended
    raise stopped


class Proof:
    """The result of a search for a proof, successful or not, with its statement and certificate.

    Each kind of proof provides its ``status``, the ``claim`` of its certificate, and the
    ``evidence`` that the kernel has accepted.
    """

    status: Any
    outcome_detail: Any  #: the place at which the proof ended
    parameters: Any
    bits: int  #: working precision
    claim: Any
    evidence: Any

    # Entries of the claim that are printed besides the numbers
    _printed_claim_entries: ClassVar[tuple[str, ...]] = ()

    @property
    def proved(self) -> bool:
        return bool(self.status.name == "PROVED")

    @property
    def reason(self) -> str:
        """The reason why nothing is proved, in words."""
        reason = str(self.status.value)
        return f"{reason} ({self.outcome_detail})" if self.outcome_detail else reason

    @property
    def input_entries(self) -> dict[str, object]:
        """The entries of `to_dict` that name what was to be proved, such as the speed of a cycle.

        They are printed after the statement. By default this is empty.
        """
        return {}

    @property
    def statement(self) -> str:
        """The proved theorem in words. If the proof failed, a sentence with the reason why nothing
        is proved.
        """
        return sentence(self.claim) if self.proved else f"nothing is proved: {self.reason}."

    def __repr__(self) -> str:
        return f"{type(self).__name__}: {self.statement}"

    __str__ = __repr__

    def certificate(self) -> str:
        """Return the text of a certificate file for this proof, which the kernel alone can check.

        Raises InputError if nothing is proved.
        """
        if not self.evidence:
            raise InputError(f"no certificate: {self.statement}")
        content: dict[str, Any] = {
            "format": CERTIFICATE_FORMAT,
            "claim": self.claim,
            "bits": self.bits,
        }
        content["evidence"] = _as_text(self.evidence)
        return json.dumps(content | {"sha256": digest(content)}, separators=(",", ":")) + "\n"

    def to_dict(self) -> dict[str, Any]:
        """Return this proof as a dictionary for the command line: the statement and, if proved, the
        numbers.
        """
        entries: dict[str, Any] = {
            "proved": self.proved,
            "statement": self.statement,
        } | self.input_entries
        if self.proved:
            claim = self.claim
            entries |= claim["numbers"]
            entries |= {
                _PRINTED_NAMES.get(name, name): claim[name]
                for name in self._printed_claim_entries
                if name in claim
            }
        entries |= {"parameters": self.parameters.name, "bits": self.bits}
        return entries | ({"status": self.status.name} if self.status else {})


def certificate_claim(
    kind: str, parameters: Parameters, numbers: Mapping[str, Measured], **more: Any
) -> dict[str, Any]:
    """Return the claim of a certificate about a disk, as a dictionary.

    Args:
        kind: The kind of theorem.
        parameters: The disk and its friction law.
        numbers: The enclosed numbers, by name.
        more: Further entries by name; rational numbers become exact texts.
    """
    texts = {
        name: exact_text(entry) if isinstance(entry, Fraction) else entry
        for name, entry in more.items()
    }
    about = {
        "kind": kind,
        "parameters": parameter_texts(parameters),
        "friction": parameters.friction,
    }
    return about | texts | {"numbers": {name: number.to_dict() for name, number in numbers.items()}}


def parameter_texts(parameters: Parameters) -> dict[str, str]:
    return {name: exact_text(getattr(parameters, name)) for name in SYMBOLS}


class EvidenceSearch:
    """A source of the evidence that a verification in the kernel needs, such as weights and radii.

    It is called with the name of a piece of evidence and the values on which it may depend.
    Subclasses have a method for each name. ``log`` contains the latest answers.
    """

    def __init__(self) -> None:
        self.log: dict[str, Any] = {}
        self.latest_name = ""  #: of what the kernel asked for

    def __call__(self, name: str, *context: Any) -> Any:
        self.latest_name = name
        self.log[name] = getattr(self, name)(*context)
        return self.log[name]


def _as_text(value: Any) -> Any:
    """Convert the evidence of a proof to its form in a certificate file.

    Exact points and rational numbers become texts; lists and dictionaries are converted entry by
    entry.
    """
    if isinstance(value, Mapping):
        return {name: _as_text(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_as_text(part) for part in value]
    if isinstance(value, FlightStepSearch):
        return value.log
    if isinstance(value, arb):
        return dyadic_text(value)
    return exact_text(value) if isinstance(value, Fraction) else value
