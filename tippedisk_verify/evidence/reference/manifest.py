"""The manifest: what files there are, what made them, and the hash that each must have, its own included."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from tippedisk_verify import __version__
from tippedisk_verify.errors import InputError
from tippedisk_verify.evidence.reference.places import SETS
from tippedisk_verify.evidence.reference.store import LARGEST
from tippedisk_verify.files import printable, read_bytes, read_text, write_text

__all__ = ["COMMAND", "FORMAT", "STATIC", "faults_in_files", "read_manifest", "write_manifest"]

FORMAT = 1
COMMAND = "tippedisk-verify reference generate --out reference_data"
#: Written by hand, and taken along to where data are generated.
STATIC = ("README.md", "schema.json")
_NAME = "manifest.json"
_LARGEST_MANIFEST = 1_000_000


def write_manifest(folder: Path) -> Path:
    """Hash all files of the folder and say so; written last, when all others are in place."""
    files = {
        path.relative_to(folder).as_posix(): {"sha256": _hash(read_bytes(path, LARGEST)), "bytes": path.stat().st_size}
        for path in _files(folder)
    }
    content = {"format": FORMAT, "generator": f"tippedisk-verify {__version__}", "command": COMMAND, "files": files}
    return write_text(folder / _NAME, _text(content))


def read_manifest(folder: Path) -> dict[str, Any]:
    """The manifest as it stands. Raises InputError if it is missing or cannot be read."""
    path = folder / _NAME
    text = read_text(path, _LARGEST_MANIFEST)
    try:
        content = json.loads(text)
        if not isinstance(content, dict) or not isinstance(content.get("files"), dict):
            raise ValueError
    except (ValueError, RecursionError):
        raise InputError(f"{path} is damaged: it is not the JSON that reference generate writes") from None
    return content


def faults_in_files(folder: Path) -> list[str]:
    """A line for each file that is missing, changed or unknown; the manifest's own bytes are held against its hash."""
    try:
        content = read_manifest(folder)
    except InputError as fault:
        return list(fault.faults)
    faults = []
    told = {name: value for name, value in content.items() if name != "sha256"}
    if read_bytes(folder / _NAME, _LARGEST_MANIFEST) != _text(told).encode(errors="replace"):
        faults.append(f"{_NAME} has been changed")
    for name, expected in content["files"].items():
        path, name = folder / name, printable(name)
        if ".." in Path(name).parts or Path(name).is_absolute() or not path.is_file():
            faults.append(f"{name[:200]} is missing")
        elif not isinstance(expected, dict) or path.stat().st_size > LARGEST:
            faults.append(f"{name[:200]} has been changed")
        elif _hash(read_bytes(path, LARGEST)) != expected.get("sha256"):
            faults.append(f"{name[:200]} has been changed: its SHA-256 is not the manifest's")
    known = set(content["files"])
    faults += [
        f"{printable(name)[:200]} is not in the manifest"
        for path in _files(folder)
        if (name := path.relative_to(folder).as_posix()) not in known
    ]
    return faults


def _files(folder: Path) -> list[Path]:
    """The data: the files written by hand, and all in the sets' folders but what starts with a dot; sorted."""
    found = [path for name in STATIC if (path := folder / name).is_file()]
    for name in SETS:
        found += [path for path in (folder / name).glob("*") if path.is_file() and not path.name.startswith(".")]
    return sorted(found)


def _text(content: dict[str, Any]) -> str:
    """With the hash of everything before it as its last entry."""
    own = _hash(json.dumps(content, sort_keys=True).encode())
    return json.dumps({**content, "sha256": own}, indent=1) + "\n"


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
