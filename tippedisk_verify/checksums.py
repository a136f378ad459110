"""JSON kept on disk with its checksum: written whole, and read back as it was written or not at all.

What becomes of damage is up to who reads. Results (`cache`) and pieces of reference data are computed anew; whole
reference data are refused, with a word on how to get them anew.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from tippedisk_verify.files import read_bytes, write_bytes

__all__ = ["digest", "read_checked", "write_checked"]


def digest(content: object) -> str:
    """The SHA-256 of bytes, or of anything that JSON can hold whatever the order of its keys: 64 hexadecimal digits."""
    text = content if isinstance(content, bytes) else json.dumps(content, sort_keys=True).encode()
    return hashlib.sha256(text).hexdigest()


def write_checked(path: Path, value: object) -> Path:
    """Replace the file by the value's checksum and, on a second line, its JSON. Raises InputError as `write_bytes`."""
    text = json.dumps(value, ensure_ascii=False).encode()
    return write_bytes(path, digest(text).encode() + b"\n" + text)


def read_checked(path: Path, largest: int) -> Any:
    """What `write_checked` wrote; None if there is no such file, or it is damaged or larger than so many bytes."""
    try:
        checksum, _, text = read_bytes(path, largest).partition(b"\n")
        return json.loads(text) if checksum.decode("ascii") == digest(text) else None
    except (OSError, ValueError, RecursionError, MemoryError):
        return None
