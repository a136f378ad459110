"""The data files and the manifest with their hashes.

Each file is compared with its hash before it is read, because one changed bit could turn into a
wrong reference value. The manifest also holds its own hash. A file may be compressed, as NAME.gz;
its hash is that of the uncompressed content.
"""

from __future__ import annotations

import gzip
import json
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from tippedisk_verify.errors import InputError
from tippedisk_verify.support.files import read_bytes
from tippedisk_verify.support.provenance import digest

__all__ = [
    "COMPUTED_FILES",
    "DATA_FILES",
    "HANDWRITTEN_FILES",
    "MANIFEST",
    "MAX_FILE_BYTES",
    "data_folder",
    "faults_in_files",
    "manifest_text",
    "read_manifest",
    "verified_texts",
]

COMPUTED_FILES = ("values.csv", "proofs.json")  #: files that `reference_data/make` writes
#: Files that are written by hand.
HANDWRITTEN_FILES = (
    "quantities.csv",
    "methods.csv",
    "schema.json",
    "README.md",
    "CHANGELOG.md",
    "CITATION.cff",
    "LICENSE",
)
DATA_FILES = (*COMPUTED_FILES, *HANDWRITTEN_FILES)  #: all files with a hash in the manifest
MANIFEST = "manifest.json"
MAX_FILE_BYTES = 64_000_000  #: bytes that a file may have; the largest has about ten million
_MAX_MANIFEST = 1_000_000  # bytes


def data_folder() -> Path:
    """Return the folder of the reference data, in the package or next to it in a checkout.

    Raises:
        InputError: If the data are in neither place.
    """
    package = Path(__file__).resolve().parent.parent
    for folder in (package / "reference_data", package.parent / "reference_data"):
        if (folder / MANIFEST).is_file():
            return folder
    raise InputError(
        "the reference data are not installed with this package: reinstall it, or give their folder"
    )


def verified_texts(folder: Path, names: Iterable[str]) -> dict[str, str]:
    """Return the texts of some files by name, after comparing each with its hash.

    Args:
        folder: The folder of the reference data.
        names: The files' names.

    Raises:
        InputError: If a file is missing, has been changed, or is not UTF-8.
    """
    contents, faults = _verified_contents(folder, names)
    try:
        if not faults:
            return {name: content.decode() for name, content in contents.items()}
    except UnicodeDecodeError:
        faults = ["they are not all texts in UTF-8"]
    raise _damaged_error(folder, faults[0])


def _damaged_error(folder: Path, fault: str) -> InputError:
    return InputError(
        f"the reference data in {folder} are damaged ({fault}): install the package anew"
    )


def faults_in_files(folder: Path) -> list[str]:
    """Return a line for each file of the reference data that is missing or changed, the manifest
    included.
    """
    try:
        return _verified_contents(folder, DATA_FILES)[1]
    except InputError as fault:
        return list(fault.faults)


def _verified_contents(folder: Path, names: Iterable[str]) -> tuple[dict[str, bytes], list[str]]:
    manifest, faults = read_manifest(folder)
    contents = {}
    for name in names:
        try:
            contents[name] = _verified_bytes(folder, name, manifest)
        except ValueError as fault:
            faults.append(str(fault))
    return contents, faults


def read_manifest(folder: Path) -> tuple[dict[str, Any], list[str]]:
    """Read the manifest of the reference data, which has a hash for each file.

    Returns:
        Its content, and a line if its own bytes do not match its hash.

    Raises:
        InputError: If it cannot be read.
    """
    text = read_bytes(folder / MANIFEST, _MAX_MANIFEST)
    try:
        content = json.loads(text)
        if not isinstance(content, dict) or not isinstance(content.get("files"), dict):
            raise ValueError
    except (ValueError, RecursionError):
        raise _damaged_error(folder, f"{MANIFEST} is not a manifest") from None
    hashed = {name: value for name, value in content.items() if name != "sha256"}
    changed = text != manifest_text(hashed).encode(errors="replace")
    return content, [f"{MANIFEST} has been changed"] * changed


def manifest_text(content: dict[str, Any]) -> str:
    """Return the text of the manifest of the reference data: its content, followed by its hash."""
    return json.dumps({**content, "sha256": digest(content)}, indent=1) + "\n"


def _verified_bytes(folder: Path, name: str, manifest: dict[str, Any]) -> bytes:
    """Return the bytes of a file of the reference data, compressed or not, after comparing them
    with their hash.

    Raises:
        ValueError: If it is missing, cannot be read, or its hash is not in the manifest. The
            message names the fault.
    """
    path, compressed = folder / name, folder / f"{name}.gz"
    entry = manifest["files"].get(name)
    if not path.is_file() and not compressed.is_file():
        raise ValueError(f"{name} is missing")
    try:
        if path.is_file():
            content = read_bytes(path, MAX_FILE_BYTES)
        else:
            with gzip.open(compressed) as stream:
                content = stream.read(MAX_FILE_BYTES + 1)
    except (OSError, EOFError, zlib.error, InputError):
        raise ValueError(f"{name} has been changed") from None
    # A run that makes new values first writes the hash that each file is going to have
    # ("becoming"), so that the data are valid at every moment.
    hashes = [entry.get("sha256"), entry.get("becoming")] if isinstance(entry, dict) else []
    if digest(content) not in hashes:
        raise ValueError(f"{name} has been changed: its SHA-256 is not the manifest's")
    return content
