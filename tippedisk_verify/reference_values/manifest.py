"""The manifest: what files there are, what made them, and the hash that each must have, its own included.

Whoever reads values reads them through `sound_files`: one turned bit of a disk would be a wrong truth otherwise.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from tippedisk_verify import __version__
from tippedisk_verify.errors import InputError
from tippedisk_verify.files import printable, read_bytes, write_text
from tippedisk_verify.provenance import digest

__all__ = [
    "COMMAND",
    "DATA_VERSION",
    "FORMAT",
    "LARGEST",
    "SETS",
    "STATIC",
    "faults_in_files",
    "replace_files",
    "sound_files",
    "write_manifest",
]

FORMAT = 1
#: Of the values, apart from the program's; reference_data/CHANGELOG.md says what each version changed.
DATA_VERSION = "1.0.1"
COMMAND = "tippedisk-verify reference generate --out reference_data"
#: Not made by `generate`, and taken along to where data are generated.
STATIC = ("README.md", "CHANGELOG.md", "CITATION.cff", "LICENSE", "schema.json")
#: The parameter sets that reference data is made for; each has a folder.
SETS = ("printed", "calibrated")
LARGEST = 64_000_000  #: bytes of a reference file; the largest has some three million
_NAME = "manifest.json"
_LARGEST_MANIFEST = 1_000_000
_REMEDY = "install the package anew, or make the folder's data anew with `reference generate`"


def write_manifest(folder: Path, ahead: Mapping[str, str] | None = None) -> Path:
    """Hash all files of the folder and say so; written last, when all others are in place.

    ``ahead`` has the files that are about to be replaced: until they are, the manifest allows what is there and what
    will be.
    """
    files: dict[str, dict[str, Any]] = {
        path.relative_to(folder).as_posix(): {"sha256": digest(read_bytes(path, LARGEST)), "bytes": path.stat().st_size}
        for path in _files(folder)
    }
    for name, text in (ahead or {}).items():
        files.setdefault(name, {"sha256": None, "bytes": 0})["becoming"] = digest(text.encode())
    content = {
        "format": FORMAT,
        "data_version": DATA_VERSION,
        "license": "MIT",
        "generator": f"tippedisk-verify {__version__}",
        "command": COMMAND,
        "files": files,
    }
    return write_text(folder / _NAME, _text(content))


def replace_files(folder: Path, texts: Mapping[str, str]) -> list[Path]:
    """Write these files and the manifest; returns what was written.

    Wherever this is cut short, the files fit the manifest that is there, so nothing has to be made anew. In a folder
    without a manifest it comes last, and shows that all is there.
    """
    if (folder / _NAME).exists():
        write_manifest(folder, texts)
    return [*(write_text(folder / name, text) for name, text in texts.items()), write_manifest(folder)]


def sound_files(folder: Path, among: Collection[str] | None = None) -> dict[str, str]:
    """The text of each set's JSON files, or of those ``among`` these, by name; every byte is as the manifest says.

    Raises InputError in one line if one is changed, missing or unknown.
    """

    def wanted(name: str) -> bool:
        return _holds_values(name) and (among is None or name in among)

    present = [name for path in _files(folder) if wanted(name := path.relative_to(folder).as_posix())]
    if not present and (among is not None or not (folder / _NAME).exists()):
        return {}
    if not (folder / _NAME).exists():
        raise InputError(f"the reference data in {folder} have no {_NAME} that vouches for them: {_REMEDY}")
    files, faults = _manifest_files(folder)
    texts = {}
    for name in sorted({*filter(wanted, files), *present}):
        unknown = f"{printable(name)[:200]} is not in the manifest"
        content = _sound(folder, name, files[name]) if name in files else unknown
        if isinstance(content, bytes):
            try:
                texts[name] = content.decode("utf-8-sig")
            except UnicodeDecodeError:
                faults.append(f"{name} is not a text file in UTF-8")
        elif content is not None:
            faults.append(content)
    if faults:
        raise InputError(f"the reference data in {folder} are damaged ({faults[0]}): {_REMEDY}")
    return texts


def _holds_values(name: str) -> bool:
    parts = name.split("/")
    return len(parts) == 2 and parts[0] in SETS and parts[1].endswith(".json") and not parts[1].startswith(".")


def faults_in_files(folder: Path) -> list[str]:
    """A line for each file that is missing, changed or unknown; the manifest's own bytes are held against its hash."""
    try:
        files, faults = _manifest_files(folder)
    except InputError as fault:
        return list(fault.faults)
    contents = [_sound(folder, name, expected) for name, expected in files.items()]
    faults += [content for content in contents if isinstance(content, str)]
    present = [path.relative_to(folder).as_posix() for path in _files(folder)]
    return faults + [f"{printable(name)[:200]} is not in the manifest" for name in present if name not in files]


def _manifest_files(folder: Path) -> tuple[dict[str, Any], list[str]]:
    """What the manifest says of each file, and what is wrong with its own bytes.

    Raises InputError if it is missing or cannot be read.
    """
    text = read_bytes(folder / _NAME, _LARGEST_MANIFEST)
    try:
        content = json.loads(text.decode("utf-8-sig"))
        if not isinstance(content, dict) or not isinstance(content.get("files"), dict):
            raise ValueError
    except (ValueError, RecursionError):
        raise InputError(f"{folder / _NAME} is damaged: it is not the JSON that reference generate writes") from None
    told = {name: value for name, value in content.items() if name != "sha256"}
    changed = text != _text(told).encode(errors="replace")
    return content["files"], [f"{_NAME} has been changed"] * changed


def _sound(folder: Path, name: str, expected: Any) -> bytes | str | None:
    """The bytes of a file if they are as the manifest says, else what is wrong; None for one that is yet to come."""
    path, said = folder / name, printable(name)[:200]
    hashes = [expected.get("sha256"), expected.get("becoming")] if isinstance(expected, dict) else []
    if ".." in Path(name).parts or Path(name).is_absolute() or not path.is_file():
        return None if hashes and hashes[0] is None and not path.exists() else f"{said} is missing"
    if not hashes or path.stat().st_size > LARGEST:
        return f"{said} has been changed"
    content = read_bytes(path, LARGEST)
    return content if digest(content) in hashes else f"{said} has been changed: its SHA-256 is not the manifest's"


def _files(folder: Path) -> list[Path]:
    """The data: the files written by hand, and all in the sets' folders but what starts with a dot; sorted."""
    paths = [path for name in STATIC if (path := folder / name).is_file()]
    for name in SETS:
        paths += [path for path in (folder / name).glob("*") if path.is_file() and not path.name.startswith(".")]
    return sorted(paths)


def _text(content: dict[str, Any]) -> str:
    """With the hash of everything before it as its last entry."""
    return json.dumps({**content, "sha256": digest(content)}, indent=1) + "\n"
