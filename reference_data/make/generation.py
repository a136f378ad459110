"""The making of the reference files, entry by entry, on several cores.

An entry's answer is stored in ``.work`` in the output folder as soon as it is computed. Its name is
a hash of the entry and of the code that computes it, so that a later run of the same code can
reuse it. The files are written when all answers exist, and renamed into place, the manifest last.
Nothing in them depends on time or order, so a second run makes the same bytes on the same machine.
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
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.reference_values.checking import stored_entries
from tippedisk_verify.reference_values.entries import ReferenceEntry
from tippedisk_verify.reference_values.grading_rules import VALUES_COLUMNS
from tippedisk_verify.reference_values.lookup import full_id
from tippedisk_verify.reference_values.manifest import (
    COMPUTED_FILES,
    DATA_FILES,
    HANDWRITTEN_FILES,
    MANIFEST,
    MAX_FILE_BYTES,
    data_folder,
    manifest_text,
    verified_texts,
)
from tippedisk_verify.reference_values.store import load_store, parse_values_csv
from tippedisk_verify.support.cache import Cache
from tippedisk_verify.support.files import (
    csv_text,
    output_folder,
    read_bytes,
    read_text,
    sole_writer,
    write_text,
)
from tippedisk_verify.support.parallel import results_as_completed
from tippedisk_verify.support.provenance import code_version, digest

__all__ = ["DATA_VERSION", "entries_of", "generate", "replace_files", "write_manifest"]

#: The version of the values, not of the program. reference_data/CHANGELOG.md lists its changes.
DATA_VERSION = "2.0.0"
Entries = dict[str, dict[str, Any]]  #: the rows and the proof of each entry, by its id


def generate(
    out: str | Path,
    prefixes: Sequence[str] = (),
    executor: Executor | None = None,
    advance: Callable[[str, int], None] = lambda label, steps: None,
) -> int:
    """Make entries and write the files. Other entries of the folder stay.

    Args:
        out: The output folder.
        prefixes: The beginnings of the ids of the entries to make; if empty, all entries.
        executor: An executor for the computations; None for this process.
        advance: A function that is called with an id and 1 after each entry.

    Returns:
        The number of entries made.

    Raises:
        InputError: If no id starts with a prefix, or the folder cannot be written.
        AccuracyError: If two methods exclude each other.
    """
    wanted = entries_of([full_id(prefix) for prefix in prefixes])
    if not wanted:
        raise InputError(
            f"no entry starts with '{' or '.join(prefixes)[:100]}': try table1/linear/hopf"
        )
    with sole_writer(out) as folder:
        entries = _present(folder)  # reports damage before hours of work
        work = output_folder(folder / ".work")
        for (entry, *_), answer in results_as_completed(
            _computed, [(entry, work, _code()) for entry in wanted], executor
        ):
            entries[entry.id] = answer
            advance(entry.id, 1)
        texts = _texts(entries)
        if folder.resolve() != data_folder().resolve():
            texts |= {
                name: read_text(data_folder() / name, MAX_FILE_BYTES) for name in HANDWRITTEN_FILES
            }
        replace_files(folder, texts)
        # A worker of a killed run may still write into it; the next run removes or reuses that.
        shutil.rmtree(work, ignore_errors=True)
        return len(wanted)


def entries_of(prefixes: Sequence[str] = ()) -> list[ReferenceEntry]:
    """Return the entries of the table whose ids start with one of the prefixes, in its order."""
    return [
        stored.entry
        for stored in stored_entries(load_store())
        if stored.entry.id.startswith(tuple(prefixes) or "")
    ]


def _code() -> str:
    """Return a hash of the code that answers: this package's, and the files in this folder."""
    here = {path.name: digest(path.read_bytes()) for path in Path(__file__).parent.glob("*.py")}
    return digest([code_version(), here])


def _computed(job: tuple[ReferenceEntry, Path, str]) -> dict[str, Any]:
    """Return an entry's answer, from the work folder or computed and stored there.

    Raises:
        AccuracyError: If the code here differs from that of the process that asks.
    """
    entry, work, code = job
    if _code() != code:
        raise AccuracyError(
            "the code, or a numerical package, has changed since this run began: start it again"
        )
    cache, key = Cache(work), digest([code, entry.id, dict(entry.inputs), entry.readings])
    kept: dict[str, Any] | None = cache.get(key)
    if kept is None:
        kept = answered(entry)
        cache.put(key, kept)
    return kept


def _present(folder: Path) -> Entries:
    """Return the entries in the folder.

    Raises:
        InputError: If they are damaged.
    """
    if not (folder / MANIFEST).exists():
        return {}
    texts = verified_texts(folder, COMPUTED_FILES)
    proofs = json.loads(texts["proofs.json"])
    by_entry = groupby(
        parse_values_csv(texts["values.csv"]), key=lambda row: row["id"].rsplit("/", 1)[0]
    )
    return {id_: {"rows": list(rows), "proof": proofs.get(id_)} for id_, rows in by_entry}


def _texts(entries: Entries) -> dict[str, str]:
    """Return the texts of values.csv and proofs.json, by file name.

    Each line holds one quantity or proof, so that differences between versions are small.
    """
    ordered = [entry.id for entry in entries_of() if entry.id in entries]
    rows = [
        [row[name] for name in VALUES_COLUMNS] for id_ in ordered for row in entries[id_]["rows"]
    ]
    proofs = {id_: entries[id_]["proof"] for id_ in ordered if entries[id_]["proof"]}
    lines = ",\n".join(
        f" {json.dumps(id_)}: {json.dumps(proof, ensure_ascii=False)}"
        for id_, proof in proofs.items()
    )
    return {"values.csv": csv_text(VALUES_COLUMNS, rows), "proofs.json": f"{{\n{lines}\n}}\n"}


def replace_files(folder: Path, texts: Mapping[str, str]) -> None:
    """Write files and the manifest, so that the folder is valid at every moment.

    If this is interrupted, the files match the manifest in the folder. In a folder without a
    manifest, the manifest is written last, and shows that all files exist.

    Args:
        folder: The folder.
        texts: The files' texts by name.
    """
    if (folder / MANIFEST).exists():
        write_manifest(folder, texts)
    for name, text in texts.items():
        write_text(folder / name, text)
    write_manifest(folder)


def write_manifest(folder: Path, ahead: Mapping[str, str] | None = None) -> None:
    """Write the manifest with the hashes of the files in a folder.

    Args:
        folder: The folder.
        ahead: The texts of files that are about to be replaced. The manifest accepts such a file in
            its old and its new form.
    """
    files: dict[str, dict[str, Any]] = {}
    for name in (name for name in DATA_FILES if (folder / name).is_file()):
        read = read_bytes(folder / name, MAX_FILE_BYTES)
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
