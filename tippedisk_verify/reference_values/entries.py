"""Entries of the reference data, and entries with their inputs read in one way (cases).

An entry is a state, an equilibrium or a cycle that questions are about. Its inputs are decimals. A
user may take them exactly, or as the IEEE doubles nearest to them. Each of the two is a *reading*,
with numbers of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from tippedisk_verify.disk import Disk
from tippedisk_verify.model.parameters import SYMBOLS
from tippedisk_verify.numbers.exact import exact
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.reference_values.drawn_disks import disk_of
from tippedisk_verify.reference_values.store import Reading

__all__ = [
    "READINGS",
    "STORED_DIGITS",
    "Case",
    "MeasuredValues",
    "Reading",
    "ReferenceEntry",
    "case_of",
    "disagreements",
    "disk_in_doubles",
    "rounded_to_digits",
]

READINGS: tuple[Reading, ...] = ("decimals", "doubles")
MeasuredValues = dict[str, Measured]
STORED_DIGITS = 50  #: significant digits of a stored number; Omega_h has more


@dataclass(frozen=True)
class ReferenceEntry:
    """An entry of the reference data: a state to evaluate at, a cycle to find, ..."""

    id: str  #: ``set/friction/kind/entry``
    inputs: Mapping[str, str]  #: other than the parameters: numbers as decimals, the rest as words
    #: Without "doubles" if different inputs would round to the same doubles.
    readings: tuple[Reading, ...] = READINGS

    @property
    def set(self) -> str:
        """The parameter set, the first part of the entry's id."""
        return self.id.split("/")[0]

    @property
    def friction(self) -> str:
        """The friction law: linear, smooth, or both if the law does not matter."""
        return self.id.split("/")[1]

    @property
    def kind(self) -> str:
        """The kind of entry, such as ``limit-cycle``."""
        return self.id.split("/")[2]


@dataclass(frozen=True)
class Case:
    """An entry of the reference data in one reading: its disk and inputs as exact numbers.

    The inputs are read as decimals, or as the doubles nearest to them.
    """

    entry: ReferenceEntry
    disk: Disk
    inputs: Mapping[str, Any]  #: exact rationals, and words


def disk_in_doubles(disk: Disk) -> Disk:
    """Return a copy of a disk whose parameters are the IEEE doubles nearest to those of `disk`."""
    rounded: dict[str, Any] = {name: Fraction(float(getattr(disk, name))) for name in SYMBOLS}
    return Disk(**rounded, name=disk.name, friction=disk.friction)


def case_of(entry: ReferenceEntry, reading: Reading) -> Case:
    """Return the disk and the inputs of an entry as exact numbers, in one reading.

    A reading takes them as decimals, or as the doubles nearest to these.
    """
    disk = replace(
        disk_of(entry.set), friction="smooth" if entry.friction == "smooth" else "linear"
    )
    inputs: dict[str, Any] = {}
    for name, text in entry.inputs.items():
        try:
            number = exact(text).rational
        except ValueError:
            inputs[name] = text
            continue
        inputs[name] = Fraction(float(number)) if reading == "doubles" else number
    return Case(entry, disk_in_doubles(disk) if reading == "doubles" else disk, inputs)


def rounded_to_digits(measured: Measured, digits: int) -> Measured:
    """Round a number with a half-width to ``digits`` significant digits; add the rounding error to
    its half-width.
    """
    size = abs(measured.value)
    places = len(str(size.denominator)) - len(str(size.numerator)) + digits
    return round(measured, places) if size else measured


def disagreements(values: MeasuredValues, others: MeasuredValues) -> list[str]:
    """Return a line for each quantity whose values from two computations exclude each other.

    Args:
        values: Numbers with half-widths by name.
        others: Numbers with half-widths by name; names that `values` lacks are ignored.
    """
    return [
        f"{name}: {values[name]} and {other} exclude each other"
        for name, other in others.items()
        if name in values and not (values[name] - other).holds(0)
    ]
