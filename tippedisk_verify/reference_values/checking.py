"""Checking reference files: bytes against the manifest, form against the schema, numbers against the other roads."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tippedisk_verify.errors import InputError
from tippedisk_verify.files import printable, read_text
from tippedisk_verify.model.results import Printable
from tippedisk_verify.parallel import as_done
from tippedisk_verify.reference_values.entries import Item, Reading, Values, as_measured, case_of, disagreements
from tippedisk_verify.reference_values.kinds import KINDS, kind_named
from tippedisk_verify.reference_values.manifest import LARGEST, SETS, faults_in_files
from tippedisk_verify.reference_values.store import data_folder
from tippedisk_verify.reference_values.tables import tables

__all__ = ["CheckReport", "check", "recomputed", "stored_entries"]

# Above this level an entry costs seconds: at most a twentieth of a sample.
_CHEAP_LEVEL = 5


@dataclass(frozen=True, repr=False)
class CheckReport(Printable):
    """What was looked at, and a line for each thing that is wrong."""

    files: int
    numbers: int  #: of the files
    recomputed: int  #: by a second road
    faults: tuple[str, ...]


@dataclass(frozen=True)
class StoredEntry:
    """An entry of a file, as a question and the answers to hold against it."""

    item: Item
    quantities: dict[str, Any]

    def values(self, reading: Reading) -> Values:
        return {
            name: as_measured(told)
            for name, quantity in self.quantities.items()
            for told in (quantity if reading == "decimals" else quantity["from_doubles"],)
        }


def stored_entries(folder: Path) -> list[StoredEntry]:
    """All entries of a folder's files, in order of difficulty."""
    entries = []
    for kind in KINDS:
        for path in sorted(folder.glob(f"*/{kind.name}.json")):
            document = json.loads(read_text(path, LARGEST))
            for entry in document["entries"]:
                readings: tuple[Reading, ...] = (
                    ("decimals", "doubles") if "inputs_as_doubles" in entry else ("decimals",)
                )
                friction = entry["id"].split("/")[1]
                item = Item(entry["id"], kind.name, document["set"], friction, entry["inputs"], readings)
                entries.append(StoredEntry(item, entry["quantities"]))
    return entries


def check(
    folder: Path,
    *,
    sample: int | None = 20,
    seed: int = 0,
    executor: Executor | None = None,
    advance: Callable[[str, int], None] = lambda label, steps: None,
) -> CheckReport:
    """Check a folder; ``sample`` entries are computed again by the other roads, all of them if it is None.

    Raises InputError for a folder that holds no reference data.
    """
    if sample is not None and sample < 0:
        raise InputError(f"the sample must not be negative, not {sample}")
    if not (folder / "manifest.json").is_file():
        raise InputError(f"no reference data in {folder}: there is no manifest.json")
    files = sum(1 for path in folder.rglob("*") if path.is_file())
    entries, faults = _sound_entries(folder)
    if faults:
        return CheckReport(files, 0, 0, tuple(faults))
    faults = [fault for entry in entries for fault in _beyond_proofs(entry)]
    numbers = sum(len(entry.quantities) * len(entry.item.readings) for entry in entries)
    chosen = _chosen(entries, sample, seed)
    redone = 0
    for entry, (count, wrong) in as_done(recomputed, chosen, executor):
        redone += count
        faults += wrong
        advance(entry.item.id, 1)
    return CheckReport(files, numbers, redone, tuple(faults))


def _sound_entries(folder: Path) -> tuple[list[StoredEntry], list[str]]:
    """The folder's entries, or what is wrong with its files: numbers of a changed file need no second look."""
    if faults := faults_in_files(folder):
        return [], faults
    try:
        faults = _faults_in_form(folder)
        entries = [] if faults else stored_entries(folder)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as fault:
        # With hashes that fit: someone has written a manifest for files that are not of this program's making.
        return [], [f"the files are not reference data: {printable(str(fault))[:160]}"]
    return entries, faults if faults or entries else ["there are no reference values"]


def _beyond_proofs(entry: StoredEntry) -> list[str]:
    """Values that are wrong by their own proof, or claim more than it proves."""
    values = entry.values("decimals")
    return [
        f"{entry.item.id}/{name} does not contain its proved enclosure"
        for name, quantity in entry.quantities.items()
        if "enclosure" in quantity and not values[name].contains(as_measured(quantity["enclosure"]))
    ]


def _chosen(entries: list[StoredEntry], sample: int | None, seed: int) -> list[StoredEntry]:
    if sample is None:
        return entries
    draw = random.Random(seed)
    levels = {kind.name: kind.level for kind in KINDS}
    cheap = [entry for entry in entries if levels[entry.item.kind] <= _CHEAP_LEVEL]
    costly = [entry for entry in entries if levels[entry.item.kind] > _CHEAP_LEVEL]
    few = min(len(costly), -(-sample // 20))
    return draw.sample(cheap, min(len(cheap), sample - few)) + draw.sample(costly, few)


def recomputed(entry: StoredEntry) -> tuple[int, list[str]]:
    """The entry by every road but the first, in each reading: how many numbers, and which of them do not agree."""
    kind = kind_named(entry.item.kind)
    count, faults = 0, []
    for reading in entry.item.readings:
        case, values = case_of(entry.item, reading), entry.values(reading)
        for road in kind.roads[1:]:
            try:
                answers = road.compute(case, values)
            except (ArithmeticError, RuntimeError, ValueError) as fault:
                faults.append(f"{entry.item.id} from {reading} by {road.name}: {fault}")
                continue
            count += len(answers)
            faults += [
                f"{entry.item.id} from {reading} by {road.name}: {line}" for line in disagreements(values, answers)
            ]
    return count, faults


def _faults_in_form(folder: Path) -> list[str]:
    import fastjsonschema

    faults = []
    # The package's own schema: compiling one makes a program of it and runs that, so a folder's must be the same.
    schema = read_text(data_folder() / "schema.json", LARGEST)
    if read_text(folder / "schema.json", LARGEST) != schema:
        return ["schema.json is not the one of this version"]
    valid = fastjsonschema.compile(json.loads(schema))
    for set_folder in (folder / name for name in SETS if (folder / name).is_dir()):
        documents = []
        for kind in KINDS:
            path = set_folder / f"{kind.name}.json"
            if not path.exists():
                continue
            document = json.loads(read_text(path, LARGEST))
            try:
                valid(document)
            except fastjsonschema.JsonSchemaValueException as fault:
                faults.append(f"{set_folder.name}/{kind.name}.json is not of the form of schema.json: {fault.message}")
                continue
            documents.append(document)
        if faults:  # what is not of the form cannot be tabulated
            continue
        for name, text in tables(documents).items():
            path = set_folder / name
            if not path.exists() or read_text(path, LARGEST) != text:
                faults.append(f"{set_folder.name}/{name} does not hold the same numbers as the JSON files")
    return faults
