"""Integration of states: one `contract`, the Taylor engine and SciPy's integrators.

`taylor` runs one motion at a time, `batch` many at once, and `scipy_engine` wraps SciPy.
"""

from __future__ import annotations

from threading import local
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tippedisk_verify.flow.batch import BatchTaylor
    from tippedisk_verify.flow.contract import Engine

__all__ = ["default_batch_engine", "default_engine"]

# Each thread has its own engines, so that no run waits for another thread's.
_THREAD_ENGINES: Any = local()


def default_engine() -> Engine:
    """Return the current thread's Taylor engine, which integrates under every friction law.

    It is kept, so that each thread compiles only once.
    """
    if not hasattr(_THREAD_ENGINES, "engine"):
        from tippedisk_verify.flow.taylor import Taylor

        _THREAD_ENGINES.engine = Taylor()
    return _THREAD_ENGINES.engine  # type: ignore[no-any-return]


def default_batch_engine() -> BatchTaylor:
    """Return the thread's Taylor engine for many runs at once, in the lanes of SIMD instructions.

    It is kept, so that each thread compiles only once.
    """
    if not hasattr(_THREAD_ENGINES, "batch_engine"):
        from tippedisk_verify.flow.batch import BatchTaylor

        _THREAD_ENGINES.batch_engine = BatchTaylor()
    return _THREAD_ENGINES.batch_engine  # type: ignore[no-any-return]
