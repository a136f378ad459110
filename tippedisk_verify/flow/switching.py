"""Which analytic branch of the smooth law a run is on, and when it changes: at gamma_y = 0.

The field is continuous where gamma_y = 0, and so are its first derivatives, so state and derivatives are carried across
unchanged (the saltation matrix is the identity). gamma_y is sin(beta) times the slip, and each factor has its own
event, so that lying flat and switching never coincide. A request's own events of sliding reversal do coincide with the
switch: of two events at the same time an integrator reports one and may lose the other, so the switch reports them. A
switch sets the branch from the direction of the crossing, not by flipping it: one that was missed, because two
crossings lay closer than events can tell apart, shows at the next.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy

from tippedisk_verify.flow.contract import SLIDING_REVERSAL, Event, EventRecord
from tippedisk_verify.flow.start import ROUNDINGS, START_WINDOW, Start
from tippedisk_verify.model.precision import Precision

__all__ = ["FrictionSign", "FrictionSigns"]

_LEFT_OVER = 1000  # roundings of the state: what may be left of the slip at a switch


class FrictionSign:
    """The sign of gamma_y that an integrator computes with, which is its last parameter."""

    def __init__(self, precision: Precision, watched: Sequence[Event], records: list[EventRecord]) -> None:
        self._watched, self._records = watched, records
        self._one, self._owned = precision.number(1), precision.owned
        self._epsilon = float(precision.epsilon)
        self._window = precision.number(START_WINDOW)
        #: How long after a switch the branches, which differ by gamma_y squared, are the same to rounding [s].
        self.moment = precision.number(float(precision.epsilon) ** (1 / 3))
        self.stepper: Any = None

    def begin(self, start: Start) -> None:
        """Set the branch for a run. On the surface the sign a moment later decides."""
        self._start = start
        self._contradicted = False
        self.ended = False  #: by a terminal event of sliding reversal
        self.stops = self.stopped = False  #: whether a switch stops the run, and whether one has
        self.asleep = False  #: whether switches are passed over
        self._upright = 1 if start.ops.sin(start.state[0]) >= 0 else -1  # the sign of sin(beta)
        slip = start.value(SLIDING_REVERSAL)
        self._from_surface = start.lies_on(SLIDING_REVERSAL, self._epsilon)
        if self._from_surface:
            rates = start.rates(start.state)
            step = self._window if start.forward else -self._window
            slip = self._slip([part + step * rate for part, rate in zip(start.state, rates, strict=True)])
            self.asleep = not any(rates)  # at rest gamma_y is zero for ever: no switch, whatever heyoka sees
        self._set(1 if slip >= 0 else -1)

    def turned(self) -> bool:
        """At sin(beta) = 0, where nobody asked for the end of the run."""
        self._upright = -self._upright
        self._set(self.side)
        return True

    def switched(self, sign: int, time: Any) -> bool:
        """At a crossing of gamma_y / sin(beta) = 0; whether the run goes on."""
        if self.asleep:
            return True
        side = self.side if sign == 0 else sign if self._start.forward else -sign
        if side == self.side and abs(time) > self._window:
            # On this branch already: the crossing before was missed (or this one touches the surface only). At the very
            # beginning it is the start itself, on the surface.
            self._contradicted = True
        self._set(side)
        self.stopped = self.stops
        self.ended = self._reported(sign, time)
        return not self.stops and not self.ended

    def _reported(self, sign: int, time: Any) -> bool:
        """Record the crossing for the events that ask for it; whether one of them ends the run."""
        if self._from_surface and abs(time) <= self._window:
            return False  # the start itself
        asking = [event for event in self._watched if event.direction in (0, sign)]
        for event in asking:
            self._records.append(EventRecord(event.name, time, self._owned(self.stepper.state[:3])))
        return any(event.terminal for event in asking)

    def look(self) -> None:
        """Take the branch of the present state."""
        self.stopped = False
        self._set(1 if self._slip(self.stepper.state[:3]) >= 0 else -1)

    @property
    def lost(self) -> bool:
        """Whether the run was on the wrong branch for a while: by its switches, or by where it ended."""
        # NaN is lost too.
        slip = float(self._slip(self.stepper.state[:3]))
        return self._contradicted or not slip * self.side >= -_LEFT_OVER * self._epsilon

    def _slip(self, state: Sequence[Any]) -> Any:
        return self._start.value(SLIDING_REVERSAL, state)

    def _set(self, side: int) -> None:
        self.side = side  #: the sign of gamma_y / sin(beta)
        self.stepper.pars[-1] = self._one if side * self._upright > 0 else -self._one


class FrictionSigns:
    """The same for every run of a batch, in the last row of the parameters."""

    def begin(self, stepper: Any, start: Start) -> None:
        """On the surface the sign a moment later decides."""
        slip = start.value(SLIDING_REVERSAL)
        on_surface = abs(slip) <= ROUNDINGS * 2.0**-52
        if on_surface.any():
            rates = numpy.array(numpy.broadcast_arrays(*start.rates(start.state)))
            step = numpy.where(start.forward, START_WINDOW, -START_WINDOW)
            slip = numpy.where(on_surface, start.value(SLIDING_REVERSAL, start.state + step * rates), slip)
        self._start = start
        self._sides = numpy.where(slip >= 0, 1.0, -1.0)  # signs of gamma_y / sin(beta)
        self._upright = numpy.where(start.ops.sin(start.state[0]) >= 0, 1.0, -1.0)
        self._doubtful = numpy.zeros(len(slip), dtype=bool)
        stepper.pars[-1] = self._sides * self._upright

    def switched(self, stepper: Any, sign: int, lane: int) -> None:
        """gamma_y / sin(beta) has changed its sign."""
        side = float(sign if self._start.forward[lane] else -sign) or self._sides[lane]
        if side == self._sides[lane] and abs(stepper.time[lane]) > START_WINDOW:
            self._doubtful[lane] = True
        self._sides[lane] = side
        stepper.pars[-1, lane] = side * self._upright[lane]

    def turned(self, stepper: Any, sign: int, lane: int) -> None:
        """sin(beta) has changed its sign."""
        self._upright[lane] = -self._upright[lane]
        stepper.pars[-1, lane] = self._sides[lane] * self._upright[lane]

    def kept(self, stepper: Any) -> Any:
        """Which runs were on the right branch all the time."""
        slip = self._start.value(SLIDING_REVERSAL, stepper.state[:3])
        return (slip * self._sides >= -_LEFT_OVER * 2.0**-52) & ~self._doubtful
