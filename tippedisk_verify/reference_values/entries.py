"""What a reference value is the answer to: a question (item), and the question in one reading (case).

An item's inputs are decimals. A user may take them as they stand or as the IEEE doubles nearest to them: each is a
*reading*, with its own truth.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from tippedisk_verify.disk import Disk
from tippedisk_verify.model.exact import exact
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import SYMBOLS
from tippedisk_verify.reference_values.draws import disk_of
from tippedisk_verify.reference_values.store import Reading

__all__ = [
    "KEPT",
    "READINGS",
    "ExactItem",
    "Item",
    "Reading",
    "Values",
    "as_doubles",
    "case_of",
    "disagreements",
    "trimmed",
]

READINGS: tuple[Reading, ...] = ("decimals", "doubles")
Values = dict[str, Measured]
KEPT = 50  #: digits of a number; Omega_h keeps more


@dataclass(frozen=True)
class Item:
    """One question: a state to evaluate at, a cycle to find, ..."""

    id: str  #: ``set/friction/kind/name``
    inputs: Mapping[str, str]  #: beside the parameters: numbers as decimals, other inputs as words
    readings: tuple[Reading, ...] = READINGS  #: "doubles" is left out where doubles cannot tell the inputs apart

    @property
    def set(self) -> str:
        return self.id.split("/")[0]

    @property
    def friction(self) -> str:
        """Linear, smooth, or both where the law does not enter."""
        return self.id.split("/")[1]

    @property
    def kind(self) -> str:
        return self.id.split("/")[2]


@dataclass(frozen=True)
class ExactItem:
    """An item in one reading: the disk and the inputs, exact."""

    item: Item
    disk: Disk
    inputs: Mapping[str, Any]  #: exact rationals; words stay words


def as_doubles(disk: Disk) -> Disk:
    """The disk whose parameters are the IEEE doubles nearest to these, each rounded once."""
    rounded: dict[str, Any] = {name: Fraction(float(getattr(disk, name))) for name in SYMBOLS}
    return Disk(**rounded, name=disk.name, friction=disk.friction)


def case_of(item: Item, reading: Reading) -> ExactItem:
    """The item's disk and inputs as that reading takes them."""
    disk = replace(disk_of(item.set), friction="smooth" if item.friction == "smooth" else "linear")
    inputs: dict[str, Any] = {}
    for name, text in item.inputs.items():
        try:
            number = exact(text).rational
        except ValueError:
            inputs[name] = text
            continue
        inputs[name] = Fraction(float(number)) if reading == "doubles" else number
    return ExactItem(item, as_doubles(disk) if reading == "doubles" else disk, inputs)


def trimmed(measured: Measured, digits: int) -> Measured:
    """The value rounded to ``digits`` significant digits; what the rounding takes away is added to the half-width."""
    size = abs(measured.value)
    places = len(str(size.denominator)) - len(str(size.numerator)) + digits
    return round(measured, places) if size else measured


def disagreements(values: Values, others: Values) -> list[str]:
    """The quantities whose intervals do not meet, each said in a line."""
    return [
        f"{name}: {values[name]} and {other} exclude each other"
        for name, other in others.items()
        if name in values and abs(values[name].value - other.value) > values[name].uncertainty + other.uncertainty
    ]
