"""Making the reference files: in pieces that are kept as soon as they are computed, on as many cores as there are.

A piece is a few items of one kind. Its result goes to ``.work`` in the output folder, under a name made from what was
asked and the code that answers; a later run of the same code takes it from there. Files are put together when all their
pieces exist, and renamed into place, the manifest last. Nothing in them depends on time or order, so a second run makes
the same bytes on the same machine.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tippedisk_verify.cache import read_checked, write_checked
from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.files import output_folder, read_text, remains_of, sole_writer
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import SYMBOLS, Parameters
from tippedisk_verify.parallel import as_done
from tippedisk_verify.provenance import code_version, digest
from tippedisk_verify.reference_values.entries import Item, Kind, answered, as_doubles
from tippedisk_verify.reference_values.kinds import KINDS, kind_named
from tippedisk_verify.reference_values.manifest import FORMAT, LARGEST, SETS, STATIC, replace_files, sound_files
from tippedisk_verify.reference_values.store import data_folder
from tippedisk_verify.reference_values.tables import tables

__all__ = ["Piece", "computed", "document_head", "file_text", "generate", "pieces_of"]

Advance = Callable[[str, int], None]


@dataclass(frozen=True)
class Piece:
    """Some items of one kind and set, computed together."""

    kind: str
    set: str
    items: tuple[Item, ...]

    @property
    def key(self) -> str:
        """A name made from everything that the result depends on."""
        asked = [[item.id, dict(item.inputs), list(item.readings)] for item in self.items]
        everything = [code_version(), FORMAT, self.kind, self.set, asked]
        return f"{self.kind}-{self.set}-{digest(everything)[:24]}"


def pieces_of(kind: Kind, set_name: str) -> list[Piece]:
    """The kind's items for one set, in pieces."""
    items = kind.items(set_name)
    return [Piece(kind.name, set_name, tuple(items[n : n + kind.chunk])) for n in range(0, len(items), kind.chunk)]


def computed(piece: Piece, folder: Path, key: str) -> list[dict[str, Any]]:
    """The piece's entries: from the work folder if they are there, otherwise computed and left there.

    ``key`` is the piece's own, in the process that asks. Raises Shortfall if it is another one here.
    """
    if piece.key != key:
        raise Shortfall("the code, or a numerical package, has changed since this run began: start it again")
    path = folder / f"{key}.json"
    kept: list[dict[str, Any]] | None = read_checked(path, LARGEST)
    if kept is not None:
        return kept
    kind = kind_named(piece.kind)
    entries = [answered(kind, item) for item in piece.items]
    write_checked(path, entries)
    return entries


def _computed(job: tuple[Piece, Path, str]) -> list[dict[str, Any]]:
    return computed(*job)


def generate(
    out: Path,
    *,
    only: Sequence[str] = (),
    sets: Sequence[str] = SETS,
    executor: Executor | None = None,
    advance: Advance = lambda label, steps: None,
) -> list[Path]:
    """Make the files of the kinds named (all if none are) and the manifest; returns what was written.

    Raises InputError for an unknown kind or set or a folder that cannot be written, Shortfall if two roads to a number
    exclude each other.
    """
    kinds = [kind_named(name) for name in dict.fromkeys(only)] or list(KINDS)
    for name in sets:
        if name not in SETS:
            raise InputError(f"reference data are made for {', '.join(SETS)}, not '{name[:40]}'")
    with sole_writer(out) as folder:
        _remove_remains(folder)
        _others(folder, kinds, sets)  # damage is told before hours of work
        return _generate(folder, output_folder(folder / ".work"), kinds, sets, executor, advance)


def _others(folder: Path, kinds: Sequence[Kind], sets: Sequence[str]) -> dict[str, str]:
    """What was there before and stays: it goes into the table and under the new manifest, so the old one vouches."""
    made = {(name, kind.name) for name in sets for kind in kinds}
    names = {f"{name}/{kind.name}.json" for name in SETS for kind in KINDS if (name, kind.name) not in made}
    return sound_files(folder, names)


def _remove_remains(folder: Path) -> None:
    """What a killed run left unfinished beside its own targets."""
    targets = [folder / name for name in (*STATIC, "manifest.json")]
    targets += [folder / name / f"{kind.name}.json" for name in SETS for kind in KINDS]
    targets += [folder / name / table for name in SETS for table in tables([])]
    remains = [path for target in targets for path in remains_of(target)]
    for path in (*remains, *(folder / ".work").glob(".*.json-*")):  # nobody else writes into .work
        path.unlink(missing_ok=True)


def _generate(
    folder: Path,
    work: Path,
    kinds: Sequence[Kind],
    sets: Sequence[str],
    executor: Executor | None,
    advance: Advance,
) -> list[Path]:
    keys: dict[tuple[Kind, str], list[str]] = {(kind, name): [] for kind in kinds for name in sets}

    def jobs() -> Iterator[tuple[Piece, Path, str]]:
        """One by one: where the questions of the last kinds are put takes minutes, and the first need not wait."""
        for (kind, name), so_far in keys.items():
            for piece in pieces_of(kind, name):
                so_far.append(piece.key)
                yield piece, work, piece.key

    entries = {}
    for (piece, _, key), answers in as_done(_computed, jobs(), executor):
        entries[key] = answers
        advance(piece.items[0].id, len(piece.items))
    texts = {
        f"{name}/{kind.name}.json": file_text(kind, name, [entry for key in of_kind for entry in entries[key]])
        for (kind, name), of_kind in keys.items()
    }
    whole = _others(folder, kinds, sets) | texts
    for set_name in sets:
        output_folder(folder / set_name)
        present = [whole[name] for kind in KINDS if (name := f"{set_name}/{kind.name}.json") in whole]
        try:
            beside = tables([json.loads(text) for text in present])
            texts |= {f"{set_name}/{name}": text for name, text in beside.items()}
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
            raise InputError(f"a file in {folder / set_name} is damaged: generate all kinds again") from None
    if folder.resolve() != data_folder().resolve():
        texts |= {name: read_text(data_folder() / name, LARGEST) for name in STATIC}
    written = replace_files(folder, texts)
    # A worker of a killed run may still be writing into it; what it leaves is taken up or removed next time.
    shutil.rmtree(work, ignore_errors=True)
    return written


def document_head(kind: Kind, set_name: str, parameters: Parameters) -> dict[str, Any]:
    """What a reference file says before its entries."""
    doubles = as_doubles(parameters)
    return {
        "format": FORMAT,
        "kind": kind.name,
        "level": kind.level,
        "says": kind.says,
        "set": set_name,
        "parameters": {
            name: {
                "decimal": Measured.of(getattr(parameters, name), 0).decimals()[0],
                "double": float(getattr(doubles, name)).hex(),
            }
            for name in SYMBOLS
        },
        "methods": {road.name: {"says": road.says, "independent": road.independent} for road in kind.roads},
    }


def file_text(kind: Kind, set_name: str, entries: list[dict[str, Any]]) -> str:
    """A reference file: one quantity to a line, so that a changed number is a changed line."""
    head = document_head(kind, set_name, Parameters.named(set_name))
    lines = ["{"]
    lines += [f" {_json(name)}: {_json(value)}," for name, value in head.items()]
    lines.append(' "entries": [')
    for n, entry in enumerate(entries):
        lines.append("  {")
        lines += [f"   {_json(name)}: {_json(value)}," for name, value in entry.items() if name != "quantities"]
        lines.append('   "quantities": {')
        quantities = [f"    {_json(name)}: {_json(value)}" for name, value in entry["quantities"].items()]
        lines.append(",\n".join(quantities))
        lines.append("   }")
        lines.append("  }" + "," * (n < len(entries) - 1))
    return "\n".join([*lines, " ]", "}", ""])


def _json(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False)
