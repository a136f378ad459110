"""heyoka as a compiler, with its code cache guarded and its log silenced."""

from __future__ import annotations

import threading
from functools import lru_cache
from types import ModuleType

from tippedisk_verify.flow.code_cache import use_checked_cache
from tippedisk_verify.numbers.precision import heyoka_types

__all__ = ["heyoka_module"]

_LOAD_LOCK = threading.Lock()
_MEMORY_LIMIT = 256 * 2**20  # bytes of compiled code that a process keeps


@lru_cache(maxsize=1)
def heyoka_module() -> ModuleType:
    """Import heyoka and return it, prepared for compiling: with its cache set up and its messages
    switched off.

    Raises:
        ImportError: If heyoka cannot be imported.
    """
    heyoka = heyoka_types()
    with _LOAD_LOCK:
        heyoka.llvm_state.set_memcache_limit(_MEMORY_LIMIT)
        use_checked_cache(heyoka.llvm_state)
        # It logs to standard output, which is for results. Each run's outcome holds its warnings.
        heyoka.set_logger_level_critical()
    return heyoka
