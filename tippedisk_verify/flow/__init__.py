"""How states move: one `contract`, the Taylor engine (`taylor`; many runs at once: `lanes`), and SciPy (`baseline`)."""

from __future__ import annotations

from threading import local
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tippedisk_verify.flow.contract import Engine
    from tippedisk_verify.flow.lanes import BatchTaylor

__all__ = ["default_engine", "default_lanes"]


class _Own(local):
    """What each thread has for itself, so that none waits for another one's run."""

    engine: Engine | None = None
    lanes: BatchTaylor | None = None


_OWN = _Own()


def default_engine() -> Engine:
    """The thread's Taylor engine, kept so that it compiles once; it serves both friction laws."""
    if _OWN.engine is None:
        from tippedisk_verify.flow.taylor import Taylor

        _OWN.engine = Taylor()
    return _OWN.engine


def default_lanes() -> BatchTaylor:
    """The thread's engine for many runs at once, kept for the same reason."""
    if _OWN.lanes is None:
        from tippedisk_verify.flow.lanes import BatchTaylor

        _OWN.lanes = BatchTaylor()
    return _OWN.lanes
