"""Writing files so that nothing is ever half written: beside the target first, then renamed over it."""

from __future__ import annotations

import csv
import io
import os
import tempfile
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path

from tippedisk_verify.errors import InputError

__all__ = ["output_file", "output_folder", "write_bytes", "write_csv", "write_text"]


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
    """Replace ``path`` by ``content``; a reader sees the old file or the new one, never a part."""
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
    if not path or not found.parent.is_dir() or found.is_dir():
        raise InputError(f"'{path}' cannot be written: it needs an existing folder and a file name")
    return found
