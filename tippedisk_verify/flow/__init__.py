"""How states move: one `contract`, the Taylor engine (`taylor`; many runs at once: `lanes`), and SciPy (`baseline`)."""

from __future__ import annotations

from threading import local
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tippedisk_verify.flow.contract import Engine
    from tippedisk_verify.flow.lanes import BatchTaylor

__all__ = ["default_engine", "default_lanes"]

_OWN: Any = local()  # what each thread has for itself, so that none waits for another one's run


def default_engine() -> Engine:
    """The thread's Taylor engine, kept so that it compiles once; it serves both friction laws."""
    if not hasattr(_OWN, "engine"):
        from tippedisk_verify.flow.taylor import Taylor

        _OWN.engine = Taylor()
    return _OWN.engine  # type: ignore[no-any-return]


def default_lanes() -> BatchTaylor:
    """The thread's engine for many runs at once, kept for the same reason."""
    if not hasattr(_OWN, "lanes"):
        from tippedisk_verify.flow.lanes import BatchTaylor

        _OWN.lanes = BatchTaylor()
    return _OWN.lanes  # type: ignore[no-any-return]
