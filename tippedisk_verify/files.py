"""Writing files so that nothing is ever half written: beside the target first, then renamed over it."""

from __future__ import annotations

import csv
import io
import os
import tempfile
from collections.abc import Iterable, Sequence
from contextlib import suppress
from glob import escape
from pathlib import Path

from tippedisk_verify.errors import InputError

__all__ = ["output_file", "output_folder", "printable", "remains_of", "write_bytes", "write_csv", "write_text"]


def output_folder(path: str | Path) -> Path:
    """The folder, made if it is missing and proved writable. Raises InputError if it cannot be used."""
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        descriptor, probe = tempfile.mkstemp(prefix=".writable-", dir=folder)
        os.close(descriptor)
        os.unlink(probe)
    except OSError as fault:
        raise InputError(f"output folder {folder} cannot be written: {fault.strerror or fault}") from None
    return folder


def write_bytes(path: Path, content: bytes) -> Path:
    """Replace ``path`` by ``content``; a reader sees the old file or the new one, never a part.

    A link stays; what it points to is replaced. Raises InputError for what is no regular file, or cannot be written.
    """
    if path.is_symlink():
        path = path.resolve()
    if path.exists() and not path.is_file():
        raise InputError(f"{path} cannot be written: it is not a regular file")
    try:
        return _write_beside(path, content)
    except OSError as fault:
        raise InputError(f"{path} cannot be written: {fault.strerror or fault}") from None


def _write_beside(path: Path, content: bytes) -> Path:
    descriptor, beside = tempfile.mkstemp(prefix=f".{path.name}-", dir=path.parent)
    try:
        with os.fdopen(descriptor, "wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(beside, 0o666 & ~mask)  # mkstemp makes it private; what a user asked for is not
        os.replace(beside, path)
    except BaseException:
        with suppress(OSError):
            os.unlink(beside)
        raise
    return path


def remains_of(path: Path) -> list[Path]:
    """What an interrupted `write_bytes` of this path left beside it."""
    return sorted(path.parent.glob(f".{escape(path.name)}-" + "[a-z0-9_]" * 8)) if path.parent.is_dir() else []


def printable(text: str) -> str:
    """The text with everything that a terminal would act on, or cannot show, replaced by question marks."""
    return "".join(character if character.isprintable() else "?" for character in text)


def write_text(path: Path, content: str) -> Path:
    """`write_bytes` of UTF-8 text."""
    return write_bytes(path, content.encode())


def write_csv(path: Path, header: Sequence[str], rows: Iterable[Sequence[object]]) -> Path:
    """`write_text` of a comma-separated table; floats with all their digits."""
    stream = io.StringIO(newline="")
    table = csv.writer(stream, lineterminator="\n")
    table.writerow(header)
    table.writerows([repr(cell) if isinstance(cell, float) else cell for cell in row] for row in rows)
    return write_text(path, stream.getvalue())


def output_file(path: str) -> Path:
    """The file to write to. Raises InputError if it cannot be one."""
    found = Path(path)
    if not path or not found.parent.is_dir() or (found.exists() and not found.is_file()):
        raise InputError(f"'{path}' cannot be written: it needs an existing folder and a file name")
    return found
