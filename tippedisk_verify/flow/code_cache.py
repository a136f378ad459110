"""heyoka's cache of compiled code, in this package's cache folder, with a checksum for each entry.

heyoka runs the code that it finds in its SQLite file. Damaged code crashes the process or computes
something else. So each entry receives a checksum once it has been compiled, and a note records the
file's size and times when all was sound. If they differ later, each entry is compared with its
checksum. Entries that do not match, or have no checksum, are removed and compiled again. Entries
that are still in SQLite's log have checksums of SQLite's own.
"""

from __future__ import annotations

import atexit
import sqlite3
from contextlib import closing, suppress
from hashlib import sha256
from pathlib import Path
from typing import Any

from tippedisk_verify.support.cache import code_folder

__all__ = ["add_checksums", "use_checked_cache"]

_MAX_CACHE_BYTES = 256 * 2**20  # bytes
# All columns that heyoka reads, except the time of last use: it changes, and only decides which
# entries are removed first.
_READ_COLUMNS = (
    "hash",
    "bitcode",
    "comp_flag",
    "env_fingerprint",
    "opt_bc",
    "opt_ir",
    "obj",
    "size",
)
_COLUMNS = ", ".join(f"CAST({name} AS BLOB)" for name in _READ_COLUMNS)
_ENTRIES = f"SELECT hash, digest, {_COLUMNS} FROM cache LEFT JOIN digests USING (hash)"
_TABLE = "CREATE TABLE IF NOT EXISTS digests (hash INTEGER PRIMARY KEY, digest BLOB NOT NULL)"
_DELETE_ORPHANS = "DELETE FROM digests WHERE hash NOT IN (SELECT hash FROM cache)"
_UPDATE_TOTAL_SIZE = (
    "UPDATE config SET value = (SELECT COALESCE(SUM(size), 0) FROM cache) WHERE key = 'total_size'"
)
# heyoka's state, the file, its note, and the size of all entries when each had a checksum.
_in_use: list[Any] = []


def use_checked_cache(llvm_state: Any) -> None:
    """Let heyoka keep its compiled code in a cache file whose entries have been checked.

    heyoka uses no cache file if none is wanted or can be used.

    Args:
        llvm_state: heyoka's class of that name.
    """
    llvm_state.set_diskcache_enabled(False)
    with suppress(OSError, RuntimeError, sqlite3.Error):
        if folder := code_folder():
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            path, note = (folder.absolute() / name for name in ("cache.db", "cache.db-sound"))
            note.touch()
            if path.exists() and note.read_bytes() != _file_state(path):
                _check_entries(path, note, adding=False, checking=True)
            llvm_state.set_diskcache_path(str(path.parent))
            llvm_state.set_diskcache_limit(_MAX_CACHE_BYTES)
            llvm_state.set_diskcache_enabled(True)
            _in_use[:] = [llvm_state, path, note, llvm_state.get_diskcache_size()]
            atexit.register(add_checksums, ending=True)


def add_checksums(*, ending: bool = False) -> None:
    """Add checksums to new entries of the cache of compiled code, if the cache has changed its size
    since the last call.

    Args:
        ending: True if the process is ending; the file is then always looked at.
    """
    with suppress(OSError, ValueError, RuntimeError, sqlite3.Error):
        llvm_state, path, note, before = _in_use
        _in_use[3] = size = llvm_state.get_diskcache_size()
        if ending or size != before:
            sound = note.read_bytes() == _file_state(path)
            # heyoka closes the file: two SQLite libraries undo each other's locks
            llvm_state.set_diskcache_path(str(path.parent))
            _check_entries(path, note, adding=True, checking=not sound)


def _check_entries(path: Path, note: Path, *, adding: bool, checking: bool) -> None:
    """Add or check checksums in the cache file of compiled code, then note the file's state.

    The state is not noted if another process is changing the file. A file that is not a cache is
    removed. No Python function is registered with SQLite, because it would mistake a Ctrl-C in one
    for a fault of the file and hide it.
    """
    before = _file_state(path)
    try:
        with closing(
            sqlite3.connect(f"{path.as_uri()}?mode=rw", uri=True, isolation_level=None)
        ) as base:
            base.execute("BEGIN IMMEDIATE")
            base.execute(_TABLE)
            if adding:
                new = [
                    (key, _digest(values))
                    for key, _, *values in base.execute(f"{_ENTRIES} WHERE digest IS NULL")
                ]
                base.executemany("INSERT INTO digests VALUES (?, ?)", new)
            if checking:
                wrong = [
                    (key,)
                    for key, digest, *values in base.execute(_ENTRIES)
                    if digest != _digest(values)
                ]
                base.executemany("DELETE FROM cache WHERE hash = ?", wrong)
                base.execute(_DELETE_ORPHANS)
                base.execute(_UPDATE_TOTAL_SIZE)
            base.execute("COMMIT")
            alone = _file_state(path) == before
        if alone and not path.with_name("cache.db-wal").exists():
            note.write_bytes(_file_state(path))
    except sqlite3.DatabaseError as fault:
        if (
            isinstance(fault, sqlite3.OperationalError)
            and fault.sqlite_errorcode != sqlite3.SQLITE_ERROR
        ):
            raise  # locked, read-only or a full disk: the file itself may be sound
        path.unlink(missing_ok=True)


def _digest(values: list[bytes | None]) -> bytes:
    """Return a checksum of a list of values, which changes with each value and its length."""
    parts = [value or b"" for value in values]
    return sha256(b"%a" % [*map(len, parts)] + b"".join(parts)).digest()


def _file_state(path: Path) -> bytes:
    status = path.stat()
    return b"%d %d %d" % (status.st_size, status.st_mtime_ns, status.st_ctime_ns)
