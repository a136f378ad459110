"""A run as the Taylor polynomials of its steps: samples, continuous output and error estimates are taken from these."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy

from tippedisk_verify.flow.contract import Request, Status
from tippedisk_verify.model.precision import Precision

__all__ = ["Series"]


class Series:
    """Polynomials of the time since each step's start. As a function: times (k,) -> states (k, 3), to rounding.

    Threads may share it. heyoka's own continuous output hands out memory that its next call writes over.
    """

    def __init__(self, precision: Precision, start: Any, steps: Sequence[tuple[Any, Any]]) -> None:
        """``steps`` are the times at which they end, each with its polynomials (3, order + 1)."""
        element = object if precision.kind == "real" else precision.type
        self._precision = precision
        self.times = numpy.array([start, *(end for end, _ in steps)], dtype=element)  #: (n + 1,) [s]
        #: (order + 1, 3, n), so that all steps' terms of one power lie together
        self.coefficients = numpy.array([terms for _, terms in steps], dtype=element).transpose(2, 1, 0).copy()

    def __call__(self, times: Any) -> Any:
        wanted = self._precision.sequence(times)
        step = self.step_of(wanted)
        since = wanted - self.times[step]
        total = self.coefficients[-1][:, step]
        for terms in self.coefficients[-2::-1]:
            total = total * since + terms[:, step]
        return total.T.copy()

    def samples(self, request: Request, status: Status) -> Any:
        """(n, 3) at the request's sample times, of those that were reached; None if it has none.

        A run that reached its end has them all: the last one may be a rounding of a double later.
        """
        if request.times is None:
            return None
        times = self._precision.sequence(request.times)
        return self(times if status is Status.REACHED else times[abs(times) <= abs(self.times[-1])])

    def step_of(self, times: Any) -> Any:
        """(k,) the number of the step that each time lies in; of the first or last one for times outside."""
        inside = self.times[1:-1]
        backward = self.times[-1] < self.times[0]
        return numpy.searchsorted(-inside if backward else inside, -times if backward else times)
