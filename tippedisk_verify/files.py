"""Reading files up to a size, and writing them whole.

A file is written under another name in the same folder and then renamed, so that no reader sees a part of it. click's
atomic files do the same, but replace the old file by half of the new one when writing fails.
"""

from __future__ import annotations

import csv
import io
import os
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from importlib.util import find_spec
from pathlib import Path

from tippedisk_verify.errors import InputError
from tippedisk_verify.interrupts import unbroken, undoing

__all__ = [
    "alone",
    "csv_text",
    "file_ending_in",
    "output_file",
    "output_folder",
    "printable",
    "read_bytes",
    "read_text",
    "sole_writer",
    "write_bytes",
    "write_csv",
    "write_table",
    "write_text",
]


def output_folder(path: str | Path) -> Path:
    """The folder, made if it is missing and proved writable. Raises InputError if it cannot be used."""
    folder = Path(path)
    with _refused(f"output folder {_named(folder)} cannot be written"):
        if not str(path) or "\0" in str(path):
            raise OSError("that is no name of a folder")
        folder.mkdir(parents=True, exist_ok=True)
        with unbroken(), tempfile.TemporaryFile(dir=folder):
            pass
    return folder


def output_file(path: str) -> Path:
    """The file to write to. Raises InputError if it cannot be one."""
    file = Path(path)
    with _refused(f"'{_named(file)}' cannot be written"):
        if not path or "\0" in path or not file.parent.is_dir() or (file.exists() and not file.is_file()):
            raise OSError("it needs an existing folder and a file name")
    return file


def write_bytes(path: Path, content: bytes) -> Path:
    """Replace ``path`` by ``content``; a reader sees the old file or the new one, never a part.

    A link stays; what it points to is replaced. Raises InputError for what is no regular file, or cannot be written.
    """
    path = path.resolve() if path.is_symlink() else path
    with _refused(f"{_named(path)} cannot be written"), unbroken():
        if path.exists() and not path.is_file():
            raise OSError("it is not a regular file")
        descriptor, beside = tempfile.mkstemp(prefix=f".{path.name}-", dir=path.parent)
        try:
            with os.fdopen(descriptor, "wb") as stream:
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
            os.umask(mask := os.umask(0))
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


def csv_text(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A comma-separated table; floats with all their digits."""
    stream = io.StringIO(newline="")
    table = csv.writer(stream, lineterminator="\n")
    table.writerow(header)
    table.writerows([repr(cell) if isinstance(cell, float) else cell for cell in row] for row in rows)
    return stream.getvalue()


def write_csv(path: Path, header: Sequence[str], rows: Iterable[Sequence[object]]) -> Path:
    """`write_text` of `csv_text`."""
    return write_text(path, csv_text(header, rows))


def file_ending_in(path: str, *kinds: str) -> Path:
    """`output_file` whose name ends in one of these. Raises InputError for another one, or without pyarrow."""
    file = output_file(path)
    if file.suffix.lower() not in kinds:
        listed = " or ".join(filter(None, (", ".join(kinds[:-1]), kinds[-1])))
        raise InputError(f"'{_named(file)}' must end in {listed}")
    if file.suffix.lower() == ".parquet" and find_spec("pyarrow") is None:
        raise InputError("Parquet needs pyarrow: pip install '.[cluster]', or write .csv")
    return file


def write_table(path: Path, rows: Sequence[Mapping[str, str]]) -> Path:
    """`write_bytes` of rows as .csv or .parquet, all their columns in the order in which they appear."""
    columns = list(dict.fromkeys(name for row in rows for name in row))
    if path.suffix.lower() == ".csv":
        return write_csv(path, columns, [[row.get(name, "") for name in columns] for row in rows])
    import pyarrow
    import pyarrow.parquet

    # Decimal strings, as everywhere: a double would lose digits.
    table = pyarrow.table({name: [row.get(name) for row in rows] for name in columns})
    stream = io.BytesIO()
    pyarrow.parquet.write_table(table, stream)
    return write_bytes(path, stream.getvalue())


@contextmanager
def alone(lock: Path, refusal: str) -> Iterator[None]:
    """Hold a lock file, made if it is missing; the system forgets the lock of a run that was killed.

    Raises InputError with ``refusal`` if another run holds it, and in other words where there are no locks, and for a
    link or anything else that is no file.
    """
    import fcntl

    with _refused(f"{_named(lock)} cannot be written"):
        handle = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK, 0o666)
    with os.fdopen(handle, "rb"):
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # Whoever held it may have ended and removed it since it was opened.
            held = os.path.samestat(os.fstat(handle), os.lstat(lock))
        except (BlockingIOError, PermissionError, FileNotFoundError):  # the second from a network's file system
            held = False
        except OSError as fault:
            reason = f"({fault.strerror or fault}), so two runs could write at once"
            raise InputError(f"{_named(lock)} cannot be locked {reason}: give a place on another file system") from None
        if not held:
            raise InputError(refusal)
        yield


@contextmanager
def sole_writer(path: str | Path) -> Iterator[Path]:
    """`output_folder`, while no other run writes into it through this. Raises InputError if one does."""
    folder = output_folder(path)
    remove = partial((folder / ".lock").unlink, missing_ok=True)
    refusal = f"another run is writing into {_named(folder)}: wait for it, or give another --out"
    with alone(folder / ".lock", refusal), undoing(remove):
        try:
            yield folder
        finally:
            remove()


def read_text(path: Path, largest: int) -> str:
    """The text of a regular file in UTF-8, of at most ``largest`` bytes; a byte-order mark is left out.

    Pipes and devices have no end that is known beforehand. Raises InputError if the file cannot be read so.
    """
    try:
        return read_bytes(path, largest).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{_named(path)} is not a text file in UTF-8") from None


def read_bytes(path: Path, largest: int) -> bytes:
    """The bytes of a regular file of at most ``largest`` of them. Raises InputError if it cannot be read so."""
    with _refused(f"{_named(path)} cannot be read"):
        if "\0" in str(path) or not path.exists():
            raise OSError("there is no such file")
        if not path.is_file():
            raise InputError(f"{_named(path)} is not a regular file")
        with open(path, "rb") as stream:
            content = stream.read(largest + 1)
    if len(content) > largest:
        raise InputError(f"{_named(path)} is larger than {largest} bytes")
    return content


def printable(text: str) -> str:
    """The text with everything that a terminal would act on, or cannot show, replaced by question marks."""
    return "".join(character if character.isprintable() else "?" for character in text)


def _named(path: Path) -> str:
    """A path in a message: its end, if it is long."""
    text = printable(str(path))
    return text if len(text) <= 200 else f"...{text[-197:]}"


@contextmanager
def _refused(what: str) -> Iterator[None]:
    """Whatever the system says against it becomes an InputError of one line."""
    try:
        yield
    except OSError as fault:
        raise InputError(f"{what}: {fault.strerror or fault}") from None
