"""Which analytic branch of the smooth law a run is on, and when it changes: at gamma_y = 0.

The field is continuous where gamma_y = 0, and so are its first derivatives, so state and derivatives are carried across
unchanged (the saltation matrix is the identity). gamma_y is sin(beta) times the slip, and each factor has its own
event, so that lying flat and switching never coincide. A request's own events of sliding reversal do coincide with the
switch: of two events at the same time an integrator reports one and may lose the other, so the switch reports them. A
switch sets the branch from the direction of the crossing, not by flipping it: one that was missed, because two
crossings lay closer than events can tell apart, shows at the next. Then the run is repeated, and at each of its
crossings the motion a moment later sets the branch.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy

from tippedisk_verify.flow.contract import SLIDING_REVERSAL, Event, EventRecord
from tippedisk_verify.flow.start import ROUNDINGS, START_WINDOW, Start
from tippedisk_verify.model.precision import Precision

__all__ = ["FrictionSign", "FrictionSigns"]

_MOMENT = 2.0 ** (-52 / 3)  # s after a switch, in which the branches, apart by gamma_y squared, are the same in doubles
_LEFT_OVER = 1000  # roundings of the state: what may be left of the slip at a switch


class FrictionSign:
    """The sign of gamma_y that an integrator computes with, which is its last parameter."""

    def __init__(self, precision: Precision, watched: Sequence[Event], records: list[EventRecord]) -> None:
        self._watched, self._records = watched, records
        self._one, self._owned = precision.number(1), precision.owned
        self._epsilon = float(precision.epsilon)
        self._window = precision.number(START_WINDOW)
        # How long after a switch the branches, which differ by gamma_y squared, are the same to rounding [s].
        self._moment = precision.number(self._epsilon ** (1 / 3))
        self.stepper: Any = None
        self.looks_ahead = False  #: whether the motion a moment later decides at each switch

    def begin(self, start: Start) -> None:
        """Set the branch for a run. On the surface the motion a moment later decides."""
        self._start = start
        self._contradicted = self.ended = self._rests = False
        self._upright = 1 if start.ops.sin(start.state[0]) >= 0 else -1  # the sign of sin(beta)
        self._from_surface = start.lies_on(SLIDING_REVERSAL, self._epsilon)
        if self._from_surface:
            self._rests = not any(start.rates(start.state))  # gamma_y is zero for ever: no switch, whatever heyoka sees
            self._set(self._side_ahead(start.state))
        else:
            self._set(1 if start.value(SLIDING_REVERSAL) >= 0 else -1)

    def turned(self) -> bool:
        """At sin(beta) = 0, where nobody asked for the end of the run."""
        self._upright = -self._upright
        self._set(self.side)
        return True

    def switched(self, sign: int, time: Any) -> bool:
        """At a crossing of gamma_y / sin(beta) = 0; whether the run goes on."""
        if self._rests:
            return True
        if self.looks_ahead:
            self._set(self._side_ahead(self._owned(self.stepper.state[:3])))
        else:
            side = self.side if sign == 0 else sign if self._start.forward else -sign
            if side == self.side and abs(time) > self._window:
                # On this branch already: the crossing before was missed (or this one touches the surface only). At the
                # very beginning it is the start itself, on the surface.
                self._contradicted = True
            self._set(side)
        self.ended = self._reported(sign, time)
        return not self.ended

    def _side_ahead(self, state: Sequence[Any]) -> int:
        """The sign of gamma_y / sin(beta) a moment later, to second order, because the motion may touch the surface."""
        step = self._moment if self._start.forward else -self._moment
        return 1 if self._start.value(SLIDING_REVERSAL, self._start.ahead(state, step)) >= 0 else -1

    def _reported(self, sign: int, time: Any) -> bool:
        """Record the crossing for the events that ask for it; whether one of them ends the run."""
        if self._from_surface and abs(time) <= self._window:
            return False  # the start itself
        asking = [event for event in self._watched if event.direction in (0, sign)]
        for event in asking:
            self._records.append(EventRecord(event.name, time, self._owned(self.stepper.state[:3])))
        return any(event.terminal for event in asking)

    @property
    def lost(self) -> bool:
        """Whether the run was on the wrong branch for a while: by its switches, or by where it ended."""
        # NaN is lost too.
        slip = float(self._start.value(SLIDING_REVERSAL, self.stepper.state[:3]))
        return self._contradicted or not slip * self.side >= -_LEFT_OVER * self._epsilon

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
            ahead = start.ahead(start.state, numpy.where(start.forward, _MOMENT, -_MOMENT))
            slip = numpy.where(on_surface, start.value(SLIDING_REVERSAL, ahead), slip)
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
