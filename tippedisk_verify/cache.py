"""Results kept from run to run, as JSON files named by what they depend on.

In the user's cache folder, or in what TIPPEDISK_VERIFY_CACHE names; ``off`` there keeps nothing, ``code`` nothing but
the compiled code (`tippedisk_verify.model.code_cache`), which lies in the same folder. Each file
is written whole with its checksum (`checksums`), so runs may use the cache at the same time. A cache that is damaged or
cannot be used is no error: what is not found in it is computed.

No library does it: the entries of joblib and diskcache are pickles, which are code, and have no checksums.
"""

from __future__ import annotations

import os
import re
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from tippedisk_verify.checksums import read_checked, write_checked
from tippedisk_verify.errors import InputError

__all__ = ["VARIABLE", "Cache", "code_folder", "default_folder"]

VARIABLE = "TIPPEDISK_VERIFY_CACHE"
_OFF = ("off", "0", "no", "")
_CODE = "code"
_MOST_BYTES = 64 * 2**20  # of one entry
_KEPT_DAYS = 60  # after its last use
_OURS = re.compile(r"[0-9a-f]{64}\.json|\.[0-9a-f]{64}\.json-[a-z0-9_]{8}")


def default_folder() -> Path | None:
    """Where results are kept: the platform's folder for caches; None if they are not to be kept."""
    return None if os.environ.get(VARIABLE, "").strip().lower() == _CODE else code_folder()


def code_folder() -> Path | None:
    """Where compiled code is kept: where results are, also if these are not to be kept; None if nothing is."""
    chosen = os.environ.get(VARIABLE, _CODE)
    if chosen.strip().lower() != _CODE:
        return None if chosen.strip().lower() in _OFF else Path(chosen)
    try:
        home = Path.home()
    except RuntimeError:
        return None
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = home / "Library" / "Caches"
    else:
        named = Path(os.environ.get("XDG_CACHE_HOME", ""))
        base = named if named.is_absolute() else home / ".cache"  # a relative one counts as unset
    return base / "tippedisk-verify"


class Cache:
    """JSON values by key. ``fresh`` finds nothing, and replaces what is there by what is put."""

    def __init__(self, folder: Path | None, *, fresh: bool = False) -> None:
        self._folder = folder
        self._fresh = fresh

    def get(self, key: str) -> Any:
        """The value, or None if there is none that can be trusted."""
        if self._folder is None or self._fresh:
            return None
        path = self._folder / f"{key}.json"
        value = read_checked(path, _MOST_BYTES)
        with suppress(OSError):
            os.utime(path)  # its last use, for `tidy`
        return value

    def put(self, key: str, value: Any) -> None:
        """Keep the value, if that can be done."""
        if self._folder is None:
            return
        with suppress(OSError, InputError):
            self._folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            write_checked(self._folder / f"{key}.json", value)

    def tidy(self) -> None:
        """Remove what has not been used for long. Only files that are named like ours are touched."""
        if self._folder is None:
            return
        before = time.time() - _KEPT_DAYS * 86400
        with suppress(OSError):
            for path in self._folder.iterdir():
                with suppress(OSError):
                    if _OURS.fullmatch(path.name) and path.lstat().st_mtime < before:
                        path.unlink()
