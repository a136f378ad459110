"""The type of arrays of doubles."""

from __future__ import annotations

import numpy
from numpy.typing import NDArray

__all__ = ["Array"]

Array = NDArray[numpy.float64]
