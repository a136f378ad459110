"""A cache of results from earlier runs: JSON files named by a digest of their inputs.

Each file carries its own checksum. The files lie in the user's cache folder or in the folder that
TIPPEDISK_VERIFY_CACHE names. The value ``off`` turns the cache off. The value ``code`` keeps only
compiled code (`tippedisk_verify.flow.code_cache`), which lies in the same folder. Each file is
replaced in one step, so several runs may use the cache at the same time. A cache that is damaged or
cannot be used is not an error: a missing value is computed again.

Two libraries were considered. joblib's Memory stores pickles, which can run code and have no
checksum. It also keeps only values computed through it, whereas `verify` keeps values that its
workers send. diskcache has had no release since 2023.
"""

from __future__ import annotations

import json
import os
import re
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from tippedisk_verify.errors import InputError
from tippedisk_verify.support.files import read_bytes, write_bytes
from tippedisk_verify.support.provenance import digest

__all__ = ["VARIABLE", "Cache", "code_folder", "default_folder"]

VARIABLE = "TIPPEDISK_VERIFY_CACHE"
_DISABLING_VALUES = ("off", "0", "no", "")
_CODE = "code"
_MAX_ENTRY_BYTES = 64 * 2**20
_DAYS_KEPT_UNUSED = 60
_CACHE_FILE_NAME = re.compile(r"[0-9a-f]{64}\.json|\.[0-9a-f]{64}\.json-[a-z0-9_]{8}")


def default_folder() -> Path | None:
    """Return the folder for cached results: that of the compiled code, unless the variable is
    ``code``; None if results are not to be cached.
    """
    return None if os.environ.get(VARIABLE, "").strip().lower() == _CODE else code_folder()


def code_folder() -> Path | None:
    """Return the folder for compiled code; None if caching is off or no folder can be found.

    Setting the variable to ``code`` keeps compiled code only, in the default folder.
    """
    chosen = os.environ.get(VARIABLE, _CODE)
    if chosen.strip().lower() != _CODE:
        return None if chosen.strip().lower() in _DISABLING_VALUES else Path(chosen)
    named = Path(os.environ.get("XDG_CACHE_HOME", ""))
    try:
        # A relative path counts as unset.
        base = named if named.is_absolute() else Path.home() / ".cache"
    except RuntimeError:
        return None
    return base / "tippedisk-verify"


class Cache:
    """A store of JSON values by key, in files of a folder.

    Args:
        folder: The folder of the files. None makes a cache that keeps nothing.
        fresh: If True, `get` finds nothing and `put` replaces what is stored.
    """

    def __init__(self, folder: Path | None, *, fresh: bool = False) -> None:
        self._folder = folder
        self._fresh = fresh

    def get(self, key: str) -> Any:
        """Return the value stored under ``key``; None if it is missing or damaged.

        Args:
            key: The key, 64 hexadecimal digits.
        """
        if self._folder is None or self._fresh:
            return None
        path = self._folder / f"{key}.json"
        try:
            os.utime(path)  # records the last use, for `remove_unused`
            checksum, _, text = read_bytes(path, _MAX_ENTRY_BYTES).partition(b"\n")
            return json.loads(text) if checksum.decode("ascii") == digest(text) else None
        except (OSError, ValueError, RecursionError, MemoryError):
            return None

    def put(self, key: str, value: Any) -> None:
        """Store a JSON value under ``key`` if the folder can be written.

        The file holds the checksum on its first line and the JSON text on its second.

        Args:
            key: The key, 64 hexadecimal digits.
            value: The value, as JSON data.
        """
        if self._folder is not None:
            text = json.dumps(value, ensure_ascii=False).encode()
            with suppress(OSError, InputError):
                self._folder.mkdir(parents=True, exist_ok=True, mode=0o700)
                write_bytes(self._folder / f"{key}.json", digest(text).encode() + b"\n" + text)

    def remove_unused(self) -> None:
        """Remove values that have not been used for 60 days.

        Only files whose names have this cache's form are touched.
        """
        before = time.time() - _DAYS_KEPT_UNUSED * 86400
        with suppress(OSError):
            for path in () if self._folder is None else self._folder.iterdir():
                with suppress(OSError):
                    if _CACHE_FILE_NAME.fullmatch(path.name) and path.lstat().st_mtime < before:
                        path.unlink()
