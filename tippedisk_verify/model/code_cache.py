"""heyoka's cache of compiled code, in this package's cache folder and with a checksum for each entry.

heyoka runs the machine code that it finds in its SQLite file; damaged code crashes the process or computes something
else. So every entry gets a checksum as soon as it has been written, and before the first use each is held against its
own; what does not fit, or has none because its process was killed, is removed and compiled anew. Where the file cannot
be used at all, nothing is kept.
"""

from __future__ import annotations

import atexit
import hashlib
import sqlite3
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

from tippedisk_verify.cache import code_folder

__all__ = ["guarded", "vouched", "without_damage"]

_LIMIT = 256 * 2**20  # bytes; all of it is read at every start, in about a quarter of a second
_WAIT = 5.0  # s for another process that writes
# All that heyoka reads of an entry. When it was last used changes, and decides about nothing but what has to go first.
_ENTRY = "hash, bitcode, comp_flag, env_fingerprint, opt_bc, opt_ir, obj, size"
_in_use: list[Path] = []


def guarded(llvm_state: Any) -> None:
    """Give heyoka a checked file in this package's cache folder; or none, if none is wanted or can be used."""
    llvm_state.set_memcache_limit(_LIMIT)
    folder = code_folder()
    try:
        if folder is None:
            llvm_state.set_diskcache_enabled(False)
            return
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        without_damage(folder / "cache.db")
        llvm_state.set_diskcache_path(str(folder.absolute()))
        llvm_state.set_diskcache_limit(_LIMIT)
        if not _in_use:
            atexit.register(vouched)
        _in_use[:] = [folder.absolute() / "cache.db"]
    except (OSError, ValueError, RuntimeError, sqlite3.Error):
        llvm_state.set_diskcache_enabled(False)


def vouched() -> None:
    """Give a checksum to what this process has compiled since; what cannot get one is compiled again another time."""
    for path in _in_use:
        with suppress(sqlite3.Error), closing(_opened(path)) as database, database:
            _create(database)
            new = database.execute(f"SELECT {_ENTRY} FROM cache WHERE hash NOT IN (SELECT hash FROM digests)")
            database.executemany("INSERT OR IGNORE INTO digests VALUES (?, ?)", [(row[0], _digest(row)) for row in new])


def without_damage(path: Path) -> int:
    """Remove the entries that are not as they were written; returns their number.

    A file that is no such cache is removed whole. Raises OSError or sqlite3.Error if the file cannot be used.
    """
    if not path.exists():
        return 0
    try:
        with closing(_opened(path)) as database, database:
            return _checked(database)
    except sqlite3.OperationalError:  # locked, read-only, a full disk: another time it may be whole
        raise
    except sqlite3.DatabaseError:
        for name in (path.name, f"{path.name}-wal", f"{path.name}-shm"):
            with suppress(FileNotFoundError):
                path.with_name(name).unlink()
        return 1


def _opened(path: Path) -> sqlite3.Connection:
    """A connection to a file that must exist. A text that is none is damage, not a fault of the program."""
    database = sqlite3.connect(f"{path.absolute().as_uri()}?mode=rw", uri=True, timeout=_WAIT)
    database.text_factory = bytes
    return database


def _create(database: sqlite3.Connection) -> None:
    database.execute("PRAGMA synchronous = NORMAL")  # what a power cut takes away is compiled again
    database.execute("CREATE TABLE IF NOT EXISTS digests (hash INTEGER PRIMARY KEY, digest BLOB NOT NULL)")


def _checked(database: sqlite3.Connection) -> int:
    columns = {name.decode() for _, name, *_ in database.execute("PRAGMA table_info(cache)")}
    if not columns:
        return 0
    if not columns.issuperset(_ENTRY.split(", ")):
        raise sqlite3.DatabaseError("an entry has other columns: it cannot be checked")
    _create(database)
    known = dict(database.execute("SELECT hash, digest FROM digests"))
    digests = {row[0]: _digest(row) for row in database.execute(f"SELECT {_ENTRY} FROM cache")}
    bad = [(key,) for key, digest in digests.items() if known.get(key) != digest]
    gone = [(key,) for key in known if key not in digests]
    database.executemany("DELETE FROM cache WHERE hash = ?", bad)
    database.executemany("DELETE FROM digests WHERE hash = ?", bad + gone)
    if bad:  # heyoka goes by this sum, and would drop good entries too early
        left = "SELECT COALESCE(SUM(size), 0) FROM cache"
        database.execute(f"UPDATE config SET value = ({left}) WHERE key = 'total_size'")
    return len(bad)


def _digest(row: tuple[Any, ...]) -> bytes:
    digest = hashlib.blake2b(digest_size=16)
    for value in row:
        part = value if isinstance(value, bytes) else repr(value).encode()
        digest.update(f"{type(value).__name__} {len(part)} ".encode() + part)
    return digest.digest()
