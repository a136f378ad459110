"""The analytic branch of a two-sided law on which a run moves, and its changes at gamma_y = 0.

**Carrying the state across.** The field is continuous where gamma_y = 0, and so are its first
derivatives. So state and derivatives are carried across unchanged: the saltation matrix is the
identity.

**Events.** gamma_y is sin(beta) times the slip. Each factor has its own event, so lying flat and
switching never coincide. A request's own events of sliding reversal do coincide with the switch. Of
two events at the same time an integrator reports one and may lose the other, so the switch reports
them.

**Missed crossings.** A switch sets the branch from the direction of the crossing; it does not flip
the branch. Two crossings may lie closer than events can resolve. If one of them is missed, the next
crossing reveals it. Then the run is repeated, and at each crossing the motion a moment later sets
the branch.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy

from tippedisk_verify.flow.contract import SLIDING_REVERSAL, Event, EventRecord
from tippedisk_verify.flow.start import MIN_TIME_ON_SURFACE, SURFACE_ROUNDINGS, Start
from tippedisk_verify.numbers.precision import Precision

__all__ = ["FrictionSign", "FrictionSigns"]

# s after a switch; the branches differ by gamma_y squared, so they are equal in doubles until then.
_EQUAL_SIDES_TIME = 2.0 ** (-52 / 3)
_MAX_RESIDUAL_SLIP = 1000  # the slip that may be left at a switch, in roundings of the state


class FrictionSign:
    """The sign of gamma_y with which an integrator evaluates the smooth friction law.

    The sign is the last runtime parameter of the compiled code.
    """

    def __init__(
        self, precision: Precision, watched: Sequence[Event], records: list[EventRecord]
    ) -> None:
        self._watched, self._records = watched, records
        self._one, self._owned = precision.number(1), precision.copy_array
        self._epsilon = float(precision.epsilon)
        self._window = precision.number(MIN_TIME_ON_SURFACE)
        # The time [s] after a switch for which the branches, which differ by gamma_y squared, agree
        # to rounding.
        self._moment = precision.number(self._epsilon ** (1 / 3))
        self.stepper: Any = None
        self.looks_ahead = False  #: True if the motion a moment later decides at each switch

    def begin(self, start: Start) -> None:
        """Set the sign of gamma_y in the friction law for the start of a run.

        If the start is on gamma_y = 0, the sign is that of a moment later.

        Args:
            start: The start of the run.
        """
        self._start = start
        self._contradicted = self.ended = self._rests = False
        self._switch_time: Any = None
        self._upright = 1 if start.ops.sin(start.state[0]) >= 0 else -1  # the sign of sin(beta)
        self._from_surface = start.lies_on(SLIDING_REVERSAL, self._epsilon)
        if self._from_surface:
            # At rest gamma_y stays zero: heyoka's events are not switches.
            self._rests = not any(start.rates(start.state))
            self._set(self._side_ahead(start.state))
        else:
            self._set(1 if start.event_value(SLIDING_REVERSAL) >= 0 else -1)

    def flip_with_sin_beta(self) -> bool:
        """Change the sign of gamma_y in the friction law where sin(beta) changes its sign.

        Returns True, so that the run continues.
        """
        self._upright = -self._upright
        self._set(self.side)
        return True

    def set_at_reversal(self, sign: int, time: Any) -> bool:
        """Set the sign in the friction law at a crossing of gamma_y / sin(beta) = 0.

        Args:
            sign: The sign of the function's derivative in time.
            time: The time of the crossing [s].

        Returns:
            True if the run continues.
        """
        if self._rests:
            return True
        side = self.side if sign == 0 else sign if self._start.runs_forward else -sign
        last, self._switch_time = self._switch_time, time
        if side == self.side and last is not None and abs(time - last) <= self._moment:
            # The same crossing again: at a loose tolerance the event's series and that of the state
            # differ by more than rounding. The branch is right to rounding in any case.
            return True
        if self.looks_ahead:
            self._set(self._side_ahead(self._owned(self.stepper.state[:3])))
        else:
            if side == self.side and abs(time) > self._window:
                # The run is on this branch already: the previous crossing was missed, or this one
                # only touches the surface. At the very beginning it is the start itself, on the
                # surface.
                self._contradicted = True
            self._set(side)
        self.ended = self._reported(sign, time)
        return not self.ended

    def _side_ahead(self, state: Sequence[Any]) -> int:
        """Return the sign of gamma_y / sin(beta) a moment later.

        It is computed to second order, because the motion may touch the surface.
        """
        step = self._moment if self._start.runs_forward else -self._moment
        return (
            1
            if self._start.event_value(SLIDING_REVERSAL, self._start.state_after(state, step)) >= 0
            else -1
        )

    def _reported(self, sign: int, time: Any) -> bool:
        """Record a crossing of gamma_y / sin(beta) = 0 for the run's events with the same surface.

        Returns:
            True if one of these events ends the run.
        """
        if self._from_surface and abs(time) <= self._window:
            return False  # the start itself
        coinciding = [event for event in self._watched if event.direction in (0, sign)]
        for event in coinciding:
            self._records.append(EventRecord(event.name, time, self._owned(self.stepper.state[:3])))
        return any(event.terminal for event in coinciding)

    @property
    def used_wrong_sign(self) -> bool:
        """True if the run used the wrong sign of gamma_y for a while, as the switches or the end
        show.
        """
        # A sliding velocity that is NaN counts as wrong too.
        slip = float(self._start.event_value(SLIDING_REVERSAL, self.stepper.state[:3]))
        return self._contradicted or not slip * self.side >= -_MAX_RESIDUAL_SLIP * self._epsilon

    def _set(self, side: int) -> None:
        self.side = side  #: the sign of gamma_y / sin(beta)
        self.stepper.pars[-1] = self._one if side * self._upright > 0 else -self._one


class FrictionSigns:
    """The signs of gamma_y with which the runs of a batch evaluate the smooth friction law.

    They are the last row of the runtime parameters.
    """

    def begin(self, stepper: Any, start: Start) -> None:
        """Set the signs of gamma_y in the friction law for the starts of all runs.

        For a start on gamma_y = 0, the sign is that of a moment later.

        Args:
            stepper: heyoka's batch integrator.
            start: The starts of the runs, as arrays.
        """
        slip = start.event_value(SLIDING_REVERSAL)
        on_surface = abs(slip) <= SURFACE_ROUNDINGS * 2.0**-52
        if on_surface.any():
            ahead = start.state_after(
                start.state, numpy.where(start.runs_forward, _EQUAL_SIDES_TIME, -_EQUAL_SIDES_TIME)
            )
            slip = numpy.where(on_surface, start.event_value(SLIDING_REVERSAL, ahead), slip)
        self._start = start
        self._sides = numpy.where(slip >= 0, 1.0, -1.0)  # signs of gamma_y / sin(beta)
        self._upright = numpy.where(start.ops.sin(start.state[0]) >= 0, 1.0, -1.0)
        self._doubtful = numpy.zeros(len(slip), dtype=bool)
        stepper.pars[-1] = self._sides * self._upright

    def set_at_reversal(self, stepper: Any, sign: int, lane: int) -> None:
        """Set the sign in the friction law for a lane in which gamma_y / sin(beta) has changed its
        sign.

        Args:
            stepper: heyoka's batch integrator.
            sign: The sign of the function's derivative in time.
            lane: The number of the lane.
        """
        side = float(sign if self._start.runs_forward[lane] else -sign) or self._sides[lane]
        if side == self._sides[lane] and abs(stepper.time[lane]) > MIN_TIME_ON_SURFACE:
            self._doubtful[lane] = True
        self._sides[lane] = side
        stepper.pars[-1, lane] = side * self._upright[lane]

    def flip_with_sin_beta(self, stepper: Any, sign: int, lane: int) -> None:
        """Change the sign of gamma_y in the friction law for a lane in which sin(beta) has changed
        its sign.

        Args:
            stepper: heyoka's batch integrator.
            sign: The sign of the function's derivative in time, which is not used.
            lane: The number of the lane.
        """
        self._upright[lane] = -self._upright[lane]
        stepper.pars[-1, lane] = self._sides[lane] * self._upright[lane]

    def used_right_sign(self, stepper: Any) -> Any:
        """Return a mask (n,) of the runs that used the right sign of gamma_y all the time.

        Args:
            stepper: heyoka's batch integrator at the end of the runs.
        """
        slip = self._start.event_value(SLIDING_REVERSAL, stepper.state[:3])
        return (slip * self._sides >= -_MAX_RESIDUAL_SLIP * 2.0**-52) & ~self._doubtful
