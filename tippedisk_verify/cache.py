"""Results kept from run to run, as JSON files named by what they depend on, each with its checksum.

They lie in the user's cache folder, or in what TIPPEDISK_VERIFY_CACHE names; ``off`` there keeps nothing, ``code``
nothing but the compiled code (`tippedisk_verify.model.code_cache`), which lies in the same folder. Each file is written
whole, so runs may use the cache at the same time. A cache that is damaged or cannot be used is no error: what is not
found in it is computed.

joblib's Memory keeps pickles, which are programs and have no checksum, and keeps only what was computed by calling it,
where `verify` keeps what its workers send; diskcache has had no release since 2023.
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
from tippedisk_verify.files import read_bytes, write_bytes
from tippedisk_verify.provenance import digest

__all__ = ["VARIABLE", "Cache", "code_folder", "default_folder"]

VARIABLE = "TIPPEDISK_VERIFY_CACHE"
_OFF = ("off", "0", "no", "")
_CODE = "code"
_MOST_BYTES = 64 * 2**20  # of one entry
_KEPT_DAYS = 60  # after its last use
_OURS = re.compile(r"[0-9a-f]{64}\.json|\.[0-9a-f]{64}\.json-[a-z0-9_]{8}")


def default_folder() -> Path | None:
    """Where results are kept: the user's folder for caches; None if they are not to be kept."""
    return None if os.environ.get(VARIABLE, "").strip().lower() == _CODE else code_folder()


def code_folder() -> Path | None:
    """Where compiled code is kept: where results are, also if these are not to be kept; None if nothing is."""
    chosen = os.environ.get(VARIABLE, _CODE)
    if chosen.strip().lower() != _CODE:
        return None if chosen.strip().lower() in _OFF else Path(chosen)
    named = Path(os.environ.get("XDG_CACHE_HOME", ""))
    try:
        base = named if named.is_absolute() else Path.home() / ".cache"  # a relative one counts as unset
    except RuntimeError:
        return None
    return base / "tippedisk-verify"


class Cache:
    """JSON values by key. With ``fresh`` nothing is found, and what is put replaces what there was."""

    def __init__(self, folder: Path | None, *, fresh: bool = False) -> None:
        self._folder = folder
        self._fresh = fresh

    def get(self, key: str) -> Any:
        """Return the value; None if there is none, or it is damaged."""
        if self._folder is None or self._fresh:
            return None
        path = self._folder / f"{key}.json"
        try:
            os.utime(path)  # its last use, for `tidy`
            checksum, _, text = read_bytes(path, _MOST_BYTES).partition(b"\n")
            return json.loads(text) if checksum.decode("ascii") == digest(text) else None
        except (OSError, ValueError, RecursionError, MemoryError):
            return None

    def put(self, key: str, value: Any) -> None:
        """Keep the value if the folder can be written: its checksum and, on a second line, its JSON."""
        if self._folder is not None:
            text = json.dumps(value, ensure_ascii=False).encode()
            with suppress(OSError, InputError):
                self._folder.mkdir(parents=True, exist_ok=True, mode=0o700)
                write_bytes(self._folder / f"{key}.json", digest(text).encode() + b"\n" + text)

    def tidy(self) -> None:
        """Remove values that have not been used for 60 days. Only files that are named like ours are touched."""
        before = time.time() - _KEPT_DAYS * 86400
        with suppress(OSError):
            for path in () if self._folder is None else self._folder.iterdir():
                with suppress(OSError):
                    if _OURS.fullmatch(path.name) and path.lstat().st_mtime < before:
                        path.unlink()
