"""Samples and continuous output that outlive the run; in MPFR numbers taken step by step as Python objects.

heyoka does not free what the elements of its own arrays of such numbers point to, so a run must not have it make any:
its views are read element by element instead, while the series of the step is still there.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Sequence
from operator import neg
from threading import Lock
from typing import Any

import numpy

from tippedisk_verify.flow.contract import Request
from tippedisk_verify.model.precision import Precision

__all__ = ["Recording", "copied", "is_native", "native_array"]


class Recording:
    """What a run is asked to keep of its steps: the state at given times, and the series of every step."""

    def __init__(
        self,
        stepper: Any,
        precision: Precision,
        times: Sequence[Any],
        dense: bool,
        forward: bool,
        early: Sequence[list[Any]] = (),
    ) -> None:
        """``early`` are the states at the first of the times, which the run has passed before it is recorded."""
        self._stepper, self._precision = stepper, precision
        self._times = times
        self._forward = forward
        self._from = stepper.time
        self._start: list[Any] = stepper.state[:3].tolist()
        self._rows = list(early)
        self._starts: list[Any] = []
        self._series: list[list[list[Any]]] | None = [] if dense else None
        while self._due(self._from):
            self._rows.append(self._start)

    def callback(self) -> Callable[[Any], bool]:
        """For heyoka, as a plain function: it copies whatever else it is given."""
        return lambda stepper: self.take()

    def take(self) -> bool:
        """Keep what is asked for of the last step; nothing if it has been taken. True: the run goes on."""
        stepper = self._stepper
        now = stepper.time
        if now == self._from:
            return True
        while self._due(now):
            stepper.update_d_output(self._times[len(self._rows)])
            self._rows.append(stepper.d_output[:3].tolist())
        if self._series is not None:
            self._starts.append(self._from)
            self._series.append(stepper.tc[:3].tolist())
        self._from = now
        return True

    def _due(self, now: Any) -> bool:
        """Whether the next sample lies at or before the present time."""
        if len(self._rows) == len(self._times):
            return False
        wanted = self._times[len(self._rows)]
        return bool(wanted <= now if self._forward else wanted >= now)

    def kept(self, request: Request, finished: bool) -> tuple[Any, Any]:
        """Samples and continuous output of the run, now that it is over; None for what was not asked for."""
        self.take()
        if finished:
            # The last time and the duration, rounded from different numbers, may lie a rounding of a double apart.
            for time in self._times[len(self._rows) :]:
                self._stepper.update_d_output(time)
                self._rows.append(self._stepper.d_output[:3].tolist())
        samples = None if request.times is None else numpy.array(self._rows, dtype=object).reshape(-1, 3)
        return samples, self._dense() if request.dense else None

    def _dense(self) -> Callable[[Sequence[Any]], Any]:
        # A run that has taken no step stands at its start.
        starts, series = self._starts or [self._from], self._series or [[[part] for part in self._start]]
        array, key = self._precision.array, None if self._forward else neg

        def states(times: Sequence[Any]) -> Any:
            rows = []
            for time in array(list(times)).tolist():
                step = max(bisect_left(starts, time if self._forward else -time, key=key) - 1, 0)
                away = time - starts[step]
                rows.append([_summed(coefficients, away) for coefficients in series[step]])
            return numpy.array(rows, dtype=object).reshape(-1, 3)

        return states


def _summed(coefficients: Sequence[Any], away: Any) -> Any:
    total = coefficients[-1]
    for coefficient in reversed(coefficients[:-1]):
        total = total * away + coefficient
    return total


def is_native(times: Any, precision: Precision) -> bool:
    """Whether times are an array that heyoka takes as it is."""
    dtype = getattr(times, "dtype", None)
    return dtype is not None and precision.kind != "real" and dtype == precision.type


def native_array(values: Any, precision: Precision) -> Any:
    """A copy in this arithmetic; None stays None."""
    return None if values is None else values.astype(object if precision.kind == "real" else precision.type)


def copied(output: Any, precision: Precision) -> Callable[[Any], Any]:
    """heyoka's continuous output hands out its own memory; this hands out copies of the state's part, to any thread."""
    lock = Lock()

    def states(times: Any) -> Any:
        wanted = times if is_native(times, precision) else precision.array(list(times))
        with lock:
            return native_array(output(wanted)[:, :3], precision)

    return states
