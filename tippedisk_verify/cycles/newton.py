"""One stopping rule for Newton and chord iterations: when the last size says converged, and after how many to give up.

Its numbers, and what a step is, stand where the iteration is: for one cycle in double in `shooting`. Two iterations
have rules of their own: that of `batch_shooting`, which ends lane by lane, and that of `spectral_branch`, which shares
nothing with shooting on purpose.
"""

from __future__ import annotations

import math
from typing import Any

__all__ = ["NewtonIteration"]


class NewtonIteration:
    """The sizes of an iteration's residuals or steps, and whether they say that it has converged.

    It has when a size is below ``small``, or when a size below ``near`` is no longer half of the one before, because
    then only rounding is left; that is looked at from the size number ``fewest`` on. ``failure`` is raised after
    ``most`` sizes.
    """

    def __init__(self, most: int, failure: Exception, *, small: Any, near: Any = math.inf, fewest: int = 3) -> None:
        self.sizes: list[Any] = []
        self._left, self._failure = most, failure
        self._small, self._near, self._fewest = small, near, fewest

    def converged(self, size: Any) -> bool:
        """Whether this size is the last one."""
        self.sizes.append(size)
        self._left -= 1
        if size < self._small or (len(self.sizes) >= self._fewest and self.sizes[-2] / 2 <= size < self._near):
            return True
        if not self._left:
            raise self._failure
        return False
