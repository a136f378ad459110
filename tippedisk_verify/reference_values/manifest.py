"""The data's files, each held against its hash in the manifest before it is read, and the manifest against its own.

One turned bit of a disk would be a wrong truth otherwise. A file may lie there compressed, as NAME.gz; the hash is that
of what it holds.
"""

from __future__ import annotations

import gzip
import json
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from tippedisk_verify.errors import InputError
from tippedisk_verify.files import read_bytes
from tippedisk_verify.provenance import digest

__all__ = [
    "FILES",
    "LARGEST",
    "MANIFEST",
    "STATIC",
    "VALUES",
    "data_folder",
    "faults_in_files",
    "manifest_text",
    "read_manifest",
    "sound_files",
]

#: What the manifest vouches for: the values, what is known of them, and what was written by hand.
VALUES = ("values.csv", "proofs.json")
STATIC = ("quantities.csv", "methods.csv", "schema.json", "README.md", "CHANGELOG.md", "CITATION.cff", "LICENSE")
FILES = (*VALUES, *STATIC)
MANIFEST = "manifest.json"
LARGEST = 64_000_000  #: bytes of a file; the largest has some ten million
_LARGEST_MANIFEST = 1_000_000


def data_folder() -> Path:
    """Where the reference data lie: inside the installed package, or beside it in a source checkout.

    Raises InputError if they are in neither place.
    """
    package = Path(__file__).resolve().parent.parent
    for folder in (package / "reference_data", package.parent / "reference_data"):
        if (folder / MANIFEST).is_file():
            return folder
    raise InputError("the reference data are not installed with this package: reinstall it, or give their folder")


def sound_files(folder: Path, names: Iterable[str]) -> dict[str, str]:
    """The text of these files by name; every byte is as the manifest says. Raises InputError in one line otherwise."""
    contents, faults = _contents(folder, names)
    try:
        if not faults:
            return {name: content.decode() for name, content in contents.items()}
    except UnicodeDecodeError:
        faults = ["they are not all texts in UTF-8"]
    raise _damaged(folder, faults[0])


def _damaged(folder: Path, fault: str) -> InputError:
    return InputError(f"the reference data in {folder} are damaged ({fault}): install the package anew")


def faults_in_files(folder: Path) -> list[str]:
    """A line for each file that is missing or changed; the manifest's own bytes are held against its hash."""
    try:
        return _contents(folder, FILES)[1]
    except InputError as fault:
        return list(fault.faults)


def _contents(folder: Path, names: Iterable[str]) -> tuple[dict[str, bytes], list[str]]:
    manifest, faults = read_manifest(folder)
    contents = {}
    for name in names:
        try:
            contents[name] = _sound(folder, name, manifest)
        except ValueError as fault:
            faults.append(str(fault))
    return contents, faults


def read_manifest(folder: Path) -> tuple[dict[str, Any], list[str]]:
    """What the manifest says, and what is wrong with its own bytes. Raises InputError if it cannot be read."""
    text = read_bytes(folder / MANIFEST, _LARGEST_MANIFEST)
    try:
        content = json.loads(text)
        if not isinstance(content, dict) or not isinstance(content.get("files"), dict):
            raise ValueError
    except (ValueError, RecursionError):
        raise _damaged(folder, f"{MANIFEST} is no manifest") from None
    told = {name: value for name, value in content.items() if name != "sha256"}
    changed = text != manifest_text(told).encode(errors="replace")
    return content, [f"{MANIFEST} has been changed"] * changed


def manifest_text(content: dict[str, Any]) -> str:
    """With the hash of everything before it as its last entry."""
    return json.dumps({**content, "sha256": digest(content)}, indent=1) + "\n"


def _sound(folder: Path, name: str, manifest: dict[str, Any]) -> bytes:
    """The bytes of a file. Raises ValueError, with what is wrong, if they are not as the manifest says."""
    path, packed = folder / name, folder / f"{name}.gz"
    told = manifest["files"].get(name)
    if not path.is_file() and not packed.is_file():
        raise ValueError(f"{name} is missing")
    try:
        if path.is_file():
            content = read_bytes(path, LARGEST)
        else:
            with gzip.open(packed) as stream:
                content = stream.read(LARGEST + 1)
    except (OSError, EOFError, zlib.error, InputError):
        raise ValueError(f"{name} has been changed") from None
    # A run that makes values anew first says what each file is becoming, so that none is damaged at any moment.
    hashes = [told.get("sha256"), told.get("becoming")] if isinstance(told, dict) else []
    if digest(content) not in hashes:
        raise ValueError(f"{name} has been changed: its SHA-256 is not the manifest's")
    return content
