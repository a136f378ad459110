"""How states move: one `contract`, the Taylor engine (`taylor`; many runs at once: `lanes`), and SciPy (`baseline`)."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tippedisk_verify.flow.contract import Engine
    from tippedisk_verify.flow.lanes import Lanes

__all__ = ["default_engine", "default_lanes"]


@lru_cache(maxsize=1)
def default_engine() -> Engine:
    """The Taylor engine, shared within the process so that it compiles once; it serves both friction laws."""
    from tippedisk_verify.flow.taylor import Taylor

    return Taylor()


@lru_cache(maxsize=1)
def default_lanes() -> Lanes:
    """The engine for many runs at once, shared within the process for the same reason."""
    from tippedisk_verify.flow.lanes import Lanes

    return Lanes()
