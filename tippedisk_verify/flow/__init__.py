"""How states move: one `contract`, the Taylor engine (`taylor`; many runs at once: `lanes`), and SciPy (`baseline`)."""

from __future__ import annotations

from functools import cached_property
from threading import local
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tippedisk_verify.flow.contract import Engine
    from tippedisk_verify.flow.lanes import BatchTaylor

__all__ = ["default_engine", "default_lanes"]


class _Own(local):
    """What each thread has for itself, so that none waits for another one's run."""

    @cached_property
    def engine(self) -> Engine:
        from tippedisk_verify.flow.taylor import Taylor

        return Taylor()

    @cached_property
    def lanes(self) -> BatchTaylor:
        from tippedisk_verify.flow.lanes import BatchTaylor

        return BatchTaylor()


_OWN = _Own()


def default_engine() -> Engine:
    """The thread's Taylor engine, kept so that it compiles once; it serves both friction laws."""
    return _OWN.engine


def default_lanes() -> BatchTaylor:
    """The thread's engine for many runs at once, kept for the same reason."""
    return _OWN.lanes
