"""heyoka's cache of compiled code, in a folder of its own and with a checksum for each entry.

heyoka runs the machine code that it finds in its SQLite file; damaged code crashes the process or computes something
else. So before the first use every entry is held against the checksum from when it was first seen, and removed if it
does not fit. Where the file cannot be used at all, everything is compiled anew.
"""

from __future__ import annotations

import hashlib
import sqlite3
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

__all__ = ["guarded", "without_damage"]

_LIMIT = 256 * 2**20  # bytes; all of it is read at every start, in about a quarter of a second
_WAIT = 5.0  # s for another process that writes


def guarded(llvm_state: Any) -> None:
    """Give heyoka a folder of this package's own beside its usual one, checked; or no folder if none can be used."""
    llvm_state.set_memcache_limit(_LIMIT)
    try:
        folder = Path(llvm_state.get_diskcache_path()).with_name("tippedisk-verify")
        folder.mkdir(parents=True, exist_ok=True)
        without_damage(folder / "cache.db")
        llvm_state.set_diskcache_path(str(folder))
        llvm_state.set_diskcache_limit(_LIMIT)
    except (OSError, ValueError, RuntimeError, sqlite3.Error):
        llvm_state.set_diskcache_enabled(False)


def without_damage(path: Path) -> int:
    """Remove the entries that have changed since they were first seen; returns their number.

    A file that is no such cache is removed whole. Raises OSError or sqlite3.Error if the file cannot be used.
    """
    if not path.exists():
        return 0
    try:
        return _checked(path)
    except sqlite3.OperationalError:  # locked, read-only, a full disk: another time it may be whole
        raise
    except sqlite3.DatabaseError:
        for name in (path.name, f"{path.name}-wal", f"{path.name}-shm"):
            with suppress(FileNotFoundError):
                path.with_name(name).unlink()
        return 1


def _checked(path: Path) -> int:
    with closing(sqlite3.connect(path, timeout=_WAIT)) as database:
        tables = {name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if "cache" not in tables:
            return 0
        known = dict(database.execute("SELECT hash, digest FROM checks")) if "checks" in tables else {}
        found = {
            key: hashlib.blake2b(code, digest_size=16).digest()
            for key, code in database.execute("SELECT hash, COALESCE(CAST(obj AS BLOB), x'') FROM cache")
        }
        changed = [(key,) for key, digest in found.items() if known.get(key, digest) != digest]
        new = [(key, digest) for key, digest in found.items() if key not in known]
        gone = [(key,) for key in known if key not in found]
        if not (changed or new or gone):
            return 0
        with database:
            database.execute("CREATE TABLE IF NOT EXISTS checks (hash INTEGER PRIMARY KEY, digest BLOB NOT NULL)")
            database.executemany("DELETE FROM cache WHERE hash = ?", changed)
            database.executemany("DELETE FROM checks WHERE hash = ?", changed + gone)
            database.executemany("INSERT OR IGNORE INTO checks VALUES (?, ?)", new)
        return len(changed)
