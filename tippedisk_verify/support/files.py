"""Reading files up to a size, and writing them as a whole.

A file is written under another name in the same folder and then renamed, so no reader sees a part
of it. click's atomic files do the same, but replace the old file by half of the new one when
writing fails.
"""

from __future__ import annotations

import csv
import errno
import io
import os
import stat
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from importlib.util import find_spec
from os import PathLike
from pathlib import Path

from tippedisk_verify.errors import InputError
from tippedisk_verify.support.interrupts import clean_up_on_ctrl_c, postpone_ctrl_c

__all__ = [
    "checked_file_path",
    "csv_text",
    "file_lock",
    "file_path",
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
    """Return the folder at ``path``, which is created if necessary and checked to be writable.

    Args:
        path: The folder.

    Raises:
        InputError: If the folder cannot be used.
    """
    folder = Path(path)
    with _os_errors_as_input_errors(f"output folder {_shortened_path(folder)} cannot be written"):
        if not str(path) or "\0" in str(path):
            raise OSError("that is no name of a folder")
        if folder.exists() and not folder.is_dir():
            raise OSError(_obstacle(folder))
        folder.mkdir(parents=True, exist_ok=True)
        with postpone_ctrl_c(), tempfile.TemporaryFile(dir=folder):
            pass
    return folder


def file_path(path: str | PathLike[str]) -> Path:
    """Return the path that a text or a path object names.

    Args:
        path: The file.

    Raises:
        InputError: If it is neither.
    """
    text: object = os.fspath(path) if isinstance(path, str | PathLike) else None
    if not isinstance(text, str):
        raise InputError(f"a file is named by a text or a path, not by {type(path).__name__}")
    return Path(text)


def output_file(path: str | PathLike[str]) -> Path:
    """Check that a file may be written at a path, and return the path.

    Args:
        path: The file.

    Raises:
        InputError: If the path cannot be that of a file.
    """
    file = file_path(path)
    with _os_errors_as_input_errors(f"'{_shortened_path(file)}' cannot be written"):
        if not os.fspath(path) or "\0" in str(file):
            raise OSError("that is no name of a file")
        if not file.parent.is_dir():
            raise OSError(f"there is no folder {_shortened_path(file.parent)}")
        if file.exists() and not file.is_file():
            raise OSError(_obstacle(file))
    return file


def _obstacle(path: Path) -> str:
    """Return a description of the object at a path that stands in the way of a file or a folder."""
    status = path.stat()
    # /dev/full stands for a full disk
    if stat.S_ISCHR(status.st_mode) and status.st_rdev == os.makedev(1, 7):
        return os.strerror(errno.ENOSPC)
    if path.is_dir():
        return "it is a folder"
    return (
        "it is a file"
        if path.is_file()
        else "it is not a regular file but a device, a pipe or a socket"
    )


def write_bytes(path: Path, content: bytes) -> Path:
    """Replace the file at ``path`` by ``content``.

    A reader sees the old file or the new one, never a part. If ``path`` is a link, its target is
    replaced and the link stays.

    Args:
        path: The file.
        content: Its new content.

    Returns:
        The path of the file written.

    Raises:
        InputError: If the path is not that of a regular file, or cannot be written.
    """
    path = path.resolve() if path.is_symlink() else path
    with (
        _os_errors_as_input_errors(f"{_shortened_path(path)} cannot be written"),
        postpone_ctrl_c(),
    ):
        if path.exists() and not path.is_file():
            raise OSError(_obstacle(path))
        descriptor, temporary = tempfile.mkstemp(prefix=f".{path.name}-", dir=path.parent)
        try:
            with os.fdopen(descriptor, "wb") as stream:
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
            os.umask(mask := os.umask(0))
            os.chmod(temporary, 0o666 & ~mask)  # mkstemp makes a private file; the result is not
            os.replace(temporary, path)
        except BaseException:
            with suppress(OSError):
                os.unlink(temporary)
            raise
    return path


def write_text(path: Path, content: str) -> Path:
    """Replace the file at ``path`` by text in UTF-8, as `write_bytes` does.

    Args:
        path: The file.
        content: Its new text.

    Returns:
        The path of the file written.

    Raises:
        InputError: If the file cannot be written.
    """
    return write_bytes(path, content.encode())


def csv_text(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a comma-separated table as text, with all digits of floats.

    Args:
        header: The names of the columns.
        rows: The cells of each row.
    """
    stream = io.StringIO(newline="")
    table = csv.writer(stream, lineterminator="\n")
    table.writerow(header)
    table.writerows(
        [repr(cell) if isinstance(cell, float) else cell for cell in row] for row in rows
    )
    return stream.getvalue()


def write_csv(path: Path, header: Sequence[str], rows: Iterable[Sequence[object]]) -> Path:
    """Replace the file at ``path`` by the table that `csv_text` returns.

    Args:
        path: The file.
        header: The names of the columns.
        rows: The cells of each row.

    Returns:
        The path of the file written.

    Raises:
        InputError: If the file cannot be written.
    """
    return write_text(path, csv_text(header, rows))


def checked_file_path(path: str | PathLike[str], *kinds: str) -> Path:
    """Check the path of a file to write and its ending, such as ".csv", and return the path.

    Args:
        path: The file.
        kinds: The allowed endings, in lower case.

    Raises:
        InputError: If the name has another ending, the path cannot be that of a file, or Parquet is
            asked for without pyarrow.
    """
    file = output_file(path)
    if file.suffix.lower() not in kinds:
        listed = " or ".join(filter(None, (", ".join(kinds[:-1]), kinds[-1])))
        raise InputError(f"'{_shortened_path(file)}' must end in {listed}")
    if file.suffix.lower() == ".parquet" and find_spec("pyarrow") is None:
        raise InputError("Parquet needs pyarrow: pip install '.[cluster]', or write .csv")
    return file


def write_table(path: Path, rows: Sequence[Mapping[str, str]]) -> Path:
    """Write rows as .csv or .parquet, with their columns in the order of first appearance.

    Args:
        path: The file; its ending chooses the format.
        rows: The cells of each row by column name. A missing cell is empty.

    Returns:
        The path of the file written.

    Raises:
        InputError: If the file cannot be written.
    """
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
def file_lock(lock: Path, refusal: str) -> Iterator[None]:
    """Hold a lock file, which is created if necessary, while the context is entered.

    The system releases the lock of a run that was killed.

    Args:
        lock: The path of the lock file.
        refusal: The message for the case that another run holds the lock.

    Raises:
        InputError: If another run holds the lock, the file system has no locks, or the path is a
            link or not a regular file.
    """
    import fcntl

    with _os_errors_as_input_errors(f"{_shortened_path(lock)} cannot be written"):
        handle = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK, 0o666)
    with os.fdopen(handle, "rb"):
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # Its last holder may have ended and removed it since it was opened.
            held = os.path.samestat(os.fstat(handle), os.lstat(lock))
        # A network file system raises the second
        except (BlockingIOError, PermissionError, FileNotFoundError):
            held = False
        except OSError as fault:
            reason = f"({fault.strerror or fault}), so two runs could write at once"
            raise InputError(
                f"{_shortened_path(lock)} cannot be locked {reason}: give a place on another file system"
            ) from None
        if not held:
            raise InputError(refusal)
        yield


@contextmanager
def sole_writer(path: str | Path) -> Iterator[Path]:
    """Yield the folder at ``path`` while no other run writes into it through this function.

    Args:
        path: The folder.

    Raises:
        InputError: If another run writes there, or the folder cannot be used.
    """
    folder = output_folder(path)
    remove = partial((folder / ".lock").unlink, missing_ok=True)
    refusal = (
        f"another run is writing into {_shortened_path(folder)}: wait for it, or give another --out"
    )
    with file_lock(folder / ".lock", refusal), clean_up_on_ctrl_c(remove):
        try:
            yield folder
        finally:
            remove()


def read_text(path: Path, largest: int) -> str:
    """Return the text of a regular file in UTF-8, without a byte-order mark.

    Pipes and devices are refused because their length is not known beforehand.

    Args:
        path: The file.
        largest: The largest size in bytes.

    Raises:
        InputError: If the file is too large, is not a regular file in UTF-8, or cannot be read.
    """
    try:
        return read_bytes(path, largest).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{_shortened_path(path)} is not a text file in UTF-8") from None


def read_bytes(path: Path, largest: int) -> bytes:
    """Return the content of a regular file.

    Args:
        path: The file.
        largest: The largest size in bytes.

    Raises:
        InputError: If the file is too large, is not a regular file, or cannot be read.
    """
    with _os_errors_as_input_errors(f"{_shortened_path(path)} cannot be read"):
        if "\0" in str(path) or not path.exists():
            raise OSError("there is no such file")
        if not path.is_file():
            raise InputError(f"{_shortened_path(path)} is not a regular file")
        with open(path, "rb") as stream:
            content = stream.read(largest + 1)
    if len(content) > largest:
        raise InputError(f"{_shortened_path(path)} is larger than {largest} bytes")
    return content


def printable(text: str) -> str:
    """Replace characters that a terminal would act on or cannot show by question marks.

    Args:
        text: Any text.

    Returns:
        A text of the same length.
    """
    return "".join(character if character.isprintable() else "?" for character in text)


def _shortened_path(path: Path) -> str:
    """Return a path for a message: its last 200 characters if it is long."""
    text = printable(str(path))
    return text if len(text) <= 200 else f"...{text[-197:]}"


@contextmanager
def _os_errors_as_input_errors(what: str) -> Iterator[None]:
    """Turn an OSError raised in the context into an InputError, a line that begins with ``what``."""
    try:
        yield
    except OSError as fault:
        raise InputError(f"{what}: {fault.strerror or fault}") from None
