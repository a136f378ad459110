"""How states move: one `contract`, the Taylor engine (`taylor`; many runs at once: `lanes`), and SciPy (`baseline`)."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tippedisk_verify.flow.contract import Engine

__all__ = ["default_engine"]


@lru_cache(maxsize=1)
def default_engine() -> Engine:
    """The Taylor engine, shared within the process so that it compiles once; it serves both friction laws."""
    from tippedisk_verify.flow.taylor import Taylor

    return Taylor()
