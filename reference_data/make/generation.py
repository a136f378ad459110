"""Making the reference files: entry by entry, on as many cores as there are.

An entry's answer goes to ``.work`` in the output folder as soon as it is computed, under a name made from what was
asked and the code that answers; a later run of the same code takes it from there. The files are written when all
answers exist, and renamed into place, the manifest last. Nothing in them depends on time or order, so a second run
makes the same bytes on the same machine.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from itertools import groupby
from pathlib import Path
from typing import Any

from reference_data.make.recipes import answered
from tippedisk_verify import __version__
from tippedisk_verify.cache import Cache
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.files import csv_text, output_folder, read_bytes, read_text, sole_writer, write_text
from tippedisk_verify.parallel import as_done
from tippedisk_verify.provenance import code_version, digest
from tippedisk_verify.reference_values.checking import entries_of
from tippedisk_verify.reference_values.entries import Item
from tippedisk_verify.reference_values.manifest import (
    FILES,
    LARGEST,
    MANIFEST,
    STATIC,
    VALUES,
    data_folder,
    manifest_text,
    sound_files,
)
from tippedisk_verify.reference_values.questions import TABLE
from tippedisk_verify.reference_values.store import stored, table_rows

__all__ = ["DATA_VERSION", "generate", "items_of", "replace_files", "write_manifest"]

#: Of the values, apart from the program's; reference_data/CHANGELOG.md says what each version changed.
DATA_VERSION = "1.1.0"
Entries = dict[str, dict[str, Any]]  #: rows and proof by entry


def generate(
    out: str | Path,
    prefixes: Sequence[str] = (),
    executor: Executor | None = None,
    advance: Callable[[str, int], None] = lambda label, steps: None,
) -> int:
    """Make the entries whose ids start so (all if nothing is said) and write the files; how many entries were made.

    Other entries of the folder stay. Raises InputError if no id starts so or the folder cannot be written,
    AccuracyError if two methods exclude each other.
    """
    items = items_of(prefixes)
    if not items:
        raise InputError(f"no entry starts with '{' or '.join(prefixes)[:100]}': try printed/linear/hopf")
    with sole_writer(out) as folder:
        entries = _present(folder)  # damage is told before hours of work
        work = output_folder(folder / ".work")
        for (item, *_), answer in as_done(_computed, [(item, work, _code()) for item in items], executor):
            entries[item.id] = answer
            advance(item.id, 1)
        texts = _texts(entries)
        if folder.resolve() != data_folder().resolve():
            texts |= {name: read_text(data_folder() / name, LARGEST) for name in STATIC}
        replace_files(folder, texts)
        # A worker of a killed run may still be writing into it; what it leaves is taken up or removed next time.
        shutil.rmtree(work, ignore_errors=True)
        return len(items)


def items_of(prefixes: Sequence[str] = ()) -> list[Item]:
    """The questions of the table whose ids start so, in its order."""
    return [entry.item for entry in entries_of(stored()) if entry.item.id.startswith(tuple(prefixes) or "")]


def _code() -> str:
    """The code that answers: this package's, and what stands beside this file."""
    here = {path.name: digest(path.read_bytes()) for path in Path(__file__).parent.glob("*.py")}
    return digest([code_version(), here])


def _computed(job: tuple[Item, Path, str]) -> dict[str, Any]:
    """An entry's answer: from the work folder if it is there, otherwise computed and left there.

    Raises AccuracyError if the code here is not that of the process that asks.
    """
    item, work, code = job
    if _code() != code:
        raise AccuracyError("the code, or a numerical package, has changed since this run began: start it again")
    cache, key = Cache(work), digest([code, item.id, dict(item.inputs), item.readings])
    kept: dict[str, Any] | None = cache.get(key)
    if kept is None:
        kept = answered(item)
        cache.put(key, kept)
    return kept


def _present(folder: Path) -> Entries:
    """The entries that the folder has. Raises InputError if they are damaged."""
    if not (folder / MANIFEST).exists():
        return {}
    texts = sound_files(folder, VALUES)
    proofs = json.loads(texts["proofs.json"])
    by_entry = groupby(table_rows(texts["values.csv"]), key=lambda row: row["id"].rsplit("/", 1)[0])
    return {id_: {"rows": list(rows), "proof": proofs.get(id_)} for id_, rows in by_entry}


def _texts(entries: Entries) -> dict[str, str]:
    """The files with values; one quantity or proof to a line, so that a changed number is a changed line."""
    ordered = [item.id for item in items_of() if item.id in entries]
    rows = [[row[name] for name in TABLE] for id_ in ordered for row in entries[id_]["rows"]]
    proofs = {id_: entries[id_]["proof"] for id_ in ordered if entries[id_]["proof"]}
    lines = ",\n".join(f" {json.dumps(id_)}: {json.dumps(one, ensure_ascii=False)}" for id_, one in proofs.items())
    return {"values.csv": csv_text(TABLE, rows), "proofs.json": f"{{\n{lines}\n}}\n"}


def replace_files(folder: Path, texts: Mapping[str, str]) -> None:
    """Write these files and the manifest.

    Wherever this is cut short, the files fit the manifest that is there, so nothing has to be made anew. In a folder
    without a manifest it comes last, and shows that all is there.
    """
    if (folder / MANIFEST).exists():
        write_manifest(folder, texts)
    for name, text in texts.items():
        write_text(folder / name, text)
    write_manifest(folder)


def write_manifest(folder: Path, ahead: Mapping[str, str] | None = None) -> None:
    """Hash the files and say so; ``ahead`` has those that are about to be replaced, which may be as before or so."""
    files: dict[str, dict[str, Any]] = {}
    for name in (name for name in FILES if (folder / name).is_file()):
        read = read_bytes(folder / name, LARGEST)
        files[name] = {"sha256": digest(read), "bytes": len(read)}
        if ahead and name in ahead:
            files[name]["becoming"] = digest(ahead[name].encode())
    content = {
        "format": 2,
        "data_version": DATA_VERSION,
        "license": "MIT",
        "generator": f"tippedisk-verify {__version__}",
        "command": "python reference_data/make",
        "files": files,
    }
    write_text(folder / MANIFEST, manifest_text(content))
