"""How states move: one contract (`contract`), the Taylor engine (`taylor`) and the SciPy baseline (`baseline`)."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tippedisk_verify.flow.contract import Engine
    from tippedisk_verify.model.equations import Friction

__all__ = ["default_engine"]


@lru_cache(maxsize=2)
def default_engine(friction: Friction) -> Engine:
    """The engine that serves a friction law best, shared within the process so that it compiles once.

    The smooth law is not analytic, so it goes to SciPy's DOP853; the linear law goes to the Taylor engine.
    """
    if friction == "smooth":
        from tippedisk_verify.flow.baseline import Baseline

        return Baseline("DOP853")
    from tippedisk_verify.flow.taylor import Taylor

    return Taylor()
