"""The check of reference data: files against hashes, rows against each other, values recomputed."""

from __future__ import annotations

import random
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

from tippedisk_verify.display import Printable
from tippedisk_verify.errors import InputError
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.reference_values.entries import (
    MeasuredValues,
    Reading,
    ReferenceEntry,
    case_of,
    disagreements,
)
from tippedisk_verify.reference_values.grading_rules import values_csv_row
from tippedisk_verify.reference_values.manifest import (
    DATA_FILES,
    MANIFEST,
    faults_in_files,
    verified_texts,
)
from tippedisk_verify.reference_values.store import ReferenceValue, Store, parse_values_csv
from tippedisk_verify.reference_values.truths import cross_check_values
from tippedisk_verify.support.parallel import results_as_completed

__all__ = ["CheckReport", "StoredEntry", "check", "recompute_and_compare", "stored_entries"]

# Above this level an entry costs seconds: at most a twentieth of a sample.
_CHEAP_LEVEL = 5
_DIGITS = 20  # of numbers from an integrator; the published values come from wider arithmetic


@dataclass(frozen=True, repr=False)
class CheckReport(Printable):
    """The result of checking the reference data: how much was checked, and a line for
    each fault.
    """

    files: int
    numbers: int  #: stored in the files, in all readings
    recomputed: int  #: of them that were computed again
    faults: tuple[str, ...]


@dataclass(frozen=True)
class StoredEntry:
    """An entry of the reference data, with the stored numbers that belong to it."""

    entry: ReferenceEntry
    reference_values: tuple[ReferenceValue, ...]

    def values(self, reading: Reading) -> MeasuredValues:
        """Return the stored numbers for one reading of the inputs, by name."""
        return {
            reference_value.name: reference_value.measured(reading)
            for reference_value in self.reference_values
        }


def stored_entries(store: Store, prefix: str = "") -> list[StoredEntry]:
    """Group the reference values of a store by entry.

    Args:
        store: The store.
        prefix: The beginning of the ids to include.

    Returns:
        The entries with their stored numbers, in order of difficulty.
    """
    entries = []
    for id_, group in groupby(
        store.matching(prefix), key=lambda reference_value: reference_value.id.rsplit("/", 1)[0]
    ):
        reference_values = tuple(group)
        entries.append(
            StoredEntry(
                ReferenceEntry(
                    id_, dict(reference_values[0].inputs), tuple(reference_values[0].values)
                ),
                reference_values,
            )
        )
    return entries


def check(
    folder: Path,
    *,
    sample: int | None = 20,
    seed: int = 0,
    executor: Executor | None = None,
    advance: Callable[[str, int], None] = lambda label, steps: None,
) -> CheckReport:
    """Check a folder of reference data: its files, its columns, and a sample of its numbers by
    computing them again.

    Args:
        folder: The folder.
        sample: The number of entries to compute again; None for all.
        seed: The seed that chooses the sample.
        executor: An executor for the computations; None for this process.
        advance: A function that is called with an id and 1 after each entry.

    Raises:
        InputError: If the folder holds no reference data, or `sample` is negative.
    """
    if sample is not None and sample < 0:
        raise InputError(f"the sample must not be negative, not {sample}")
    if not (folder / MANIFEST).is_file():
        raise InputError(f"no reference data in {folder}: there is no {MANIFEST}")
    try:
        if faults := faults_in_files(folder):
            raise InputError(faults)
        store = Store(folder)
        faults = _faults_in_rows(folder, store)
    except (InputError, AttributeError, ArithmeticError) as fault:
        return CheckReport(
            len(DATA_FILES),
            0,
            0,
            getattr(fault, "faults", (f"the files are not reference data: {fault}",)),
        )
    recomputed = 0
    for stored, (count, wrong) in results_as_completed(
        recompute_and_compare, _random_sample(stored_entries(store), sample, seed), executor
    ):
        recomputed += count
        faults += wrong
        advance(stored.entry.id, 1)
    numbers = sum(len(reference_value.values) for reference_value in store.values())
    return CheckReport(len(DATA_FILES), numbers, recomputed, tuple(faults))


def _faults_in_rows(folder: Path, store: Store) -> list[str]:
    """Return the faults found in the rows of values.csv, the table of reference values.

    A fault is a derived column that does not follow from the others, or an interval that does not
    contain the proved enclosure.
    """
    faults = []
    rows = parse_values_csv(verified_texts(folder, ["values.csv"])["values.csv"])
    for row, reference_value in zip(rows, store.values(), strict=True):
        derived = values_csv_row(store.parameters[reference_value.set], reference_value)
        faults += [
            f"{reference_value.id}: {name} does not follow from the other columns"
            for name, text in derived.items()
            if text != row[name]
        ]
        proof = reference_value.proof
        if proof and not reference_value.measured().contains(
            Measured.of(proof["value"], proof["uncertainty"])
        ):
            faults.append(f"{reference_value.id} does not contain its proved enclosure")
    return faults


def _random_sample(entries: list[StoredEntry], sample: int | None, seed: int) -> list[StoredEntry]:
    if sample is None:
        return entries
    draw = random.Random(seed)
    cheap = [stored for stored in entries if stored.reference_values[0].level <= _CHEAP_LEVEL]
    costly = [stored for stored in entries if stored.reference_values[0].level > _CHEAP_LEVEL]
    few = min(len(costly), -(-sample // 20))
    return draw.sample(cheap, min(len(cheap), sample - few)) + draw.sample(costly, few)


def recompute_and_compare(stored: StoredEntry) -> tuple[int, list[str]]:
    """Compute the numbers of an entry again in each of its readings, and compare them with the
    stored ones.

    Returns:
        How many numbers were computed, and a line for each that excludes the stored one.
    """
    count, faults = 0, []
    for reading in stored.entry.readings:
        try:
            answers = cross_check_values(case_of(stored.entry, reading), _DIGITS)
        except (ArithmeticError, RuntimeError, ValueError) as fault:
            faults.append(f"{stored.entry.id} from {reading}: {fault}")
            continue
        count += len(answers)
        faults += [
            f"{stored.entry.id} from {reading}: {line}"
            for line in disagreements(stored.values(reading), answers)
        ]
    return count, faults
