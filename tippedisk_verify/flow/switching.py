"""The analytic side of a two-sided law on which a run moves, and its changes at gamma_y = 0.

**Carrying the state across.** The field is continuous where gamma_y = 0, and so are its first
derivatives. So state and derivatives are carried across unchanged: the saltation matrix is the
identity.

**Events.** gamma_y is sin(beta) times the slip. Each factor has its own event, so lying flat and
switching never coincide. A request's own events of sliding reversal do coincide with the switch. Of
two events at the same time an integrator reports one and may lose the other, so the switch reports
them.

**Missed crossings.** A switch sets the side from the direction of the crossing; it does not flip
the side. Two crossings may lie closer than events can resolve. If one of them is missed, the next
crossing reveals it. Then the run is repeated, and at each crossing the motion a moment later sets
the side.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy

from tippedisk_verify.flow.contract import SLIDING_REVERSAL, Event, EventRecord
from tippedisk_verify.flow.start import MIN_TIME_ON_SURFACE, SURFACE_ROUNDINGS, Start
from tippedisk_verify.numbers.precision import Precision

__all__ = ["FrictionSign", "FrictionSigns"]

# s after a switch; the sides differ by gamma_y squared, so they are equal in doubles until then.
_EQUAL_SIDES_TIME = 2.0 ** (-52 / 3)
_MAX_RESIDUAL_SLIP = 1000  # the slip that may be left at a switch, in roundings of the state


class FrictionSign:
    """The sign of gamma_y with which an integrator evaluates the smooth friction law.

    The sign is the last runtime parameter of the compiled code. It is the product of the signs of
    the slip gamma_y / sin(beta) and of sin(beta).
    """

    def __init__(
        self, precision: Precision, watched: Sequence[Event], records: list[EventRecord]
    ) -> None:
        self._watched, self._records = watched, records
        self._one, self._owned = precision.number(1), precision.copy_array
        self._epsilon = float(precision.epsilon)
        self._window = precision.number(MIN_TIME_ON_SURFACE)
        #: as `_EQUAL_SIDES_TIME`, in this arithmetic
        self._equal_sides_time = precision.number(self._epsilon ** (1 / 3))
        self.looks_ahead = False  #: True if the motion a moment later decides at each switch

    def begin(self, stepper: Any, start: Start) -> None:
        """Set the sign of gamma_y in the friction law for the start of a run.

        If the start is on gamma_y = 0, the sign is that of a moment later.

        Args:
            stepper: heyoka's integrator.
            start: The start of the run.
        """
        self._start = start
        self._missed_crossing = self.ended = self._rests = False
        self._switch_time: Any = None
        self._sin_beta_sign = 1 if start.ops.sin(start.state[0]) >= 0 else -1
        self._from_surface = start.lies_on(SLIDING_REVERSAL, self._epsilon)
        if self._from_surface:
            # At rest gamma_y stays zero: heyoka's events are not switches.
            self._rests = not any(start.rates(start.state))
            self._set(stepper, self._slip_sign_ahead(start.state))
        else:
            self._set(stepper, 1 if start.event_value(SLIDING_REVERSAL) >= 0 else -1)

    def flip_with_sin_beta(self, stepper: Any) -> bool:
        """Change the sign of gamma_y in the friction law where sin(beta) changes its sign.

        Returns True, so that the run continues.

        Args:
            stepper: heyoka's integrator.
        """
        self._sin_beta_sign = -self._sin_beta_sign
        self._set(stepper, self._slip_sign)
        return True

    def set_at_reversal(self, stepper: Any, sign: int) -> bool:
        """Set the sign in the friction law at a crossing of gamma_y / sin(beta) = 0.

        Args:
            stepper: heyoka's integrator.
            sign: The sign of the function's derivative in time.

        Returns:
            True if the run continues.
        """
        if self._rests:
            return True
        time = stepper.time
        slip_sign = (sign if self._start.runs_forward else -sign) or self._slip_sign
        last, self._switch_time = self._switch_time, time
        same = slip_sign == self._slip_sign
        if same and last is not None and abs(time - last) <= self._equal_sides_time:
            # The same crossing again: at a loose tolerance the event's series and that of the state
            # differ by more than rounding. The side is right to rounding in any case.
            return True
        if self.looks_ahead:
            slip_sign = self._slip_sign_ahead(self._owned(stepper.state[:3]))
        elif same and abs(time) > self._window:
            # The run is on this side already: the previous crossing was missed, or this one only
            # touches the surface. At the very beginning it is the start itself, on the surface.
            self._missed_crossing = True
        self._set(stepper, slip_sign)
        self.ended = self._reported(stepper, sign)
        return not self.ended

    def _slip_sign_ahead(self, state: Sequence[Any]) -> int:
        """Return the sign of gamma_y / sin(beta) a moment later.

        It is computed to second order, because the motion may touch the surface.
        """
        step = self._equal_sides_time if self._start.runs_forward else -self._equal_sides_time
        ahead = self._start.state_after(state, step)
        return 1 if self._start.event_value(SLIDING_REVERSAL, ahead) >= 0 else -1

    def _reported(self, stepper: Any, sign: int) -> bool:
        """Record a crossing of gamma_y / sin(beta) = 0 for the run's events with the same surface.

        Returns:
            True if one of these events ends the run.
        """
        time = stepper.time
        if self._from_surface and abs(time) <= self._window:
            return False  # the start itself
        coinciding = [event for event in self._watched if event.direction in (0, sign)]
        for event in coinciding:
            self._records.append(EventRecord(event.name, time, self._owned(stepper.state[:3])))
        return any(event.terminal for event in coinciding)

    def used_wrong_sign(self, stepper: Any) -> bool:
        """Return True if the run used the wrong sign of gamma_y for a while, as the switches or the
        end show.

        Args:
            stepper: heyoka's integrator at the end of the run.
        """
        # A sliding velocity that is NaN counts as wrong too.
        slip = float(self._start.event_value(SLIDING_REVERSAL, stepper.state[:3]))
        right = slip * self._slip_sign >= -_MAX_RESIDUAL_SLIP * self._epsilon
        return self._missed_crossing or not right

    def _set(self, stepper: Any, slip_sign: int) -> None:
        self._slip_sign = slip_sign
        stepper.pars[-1] = self._one if slip_sign * self._sin_beta_sign > 0 else -self._one


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
        self._slip_signs = numpy.where(slip >= 0, 1.0, -1.0)
        self._sin_beta_signs = numpy.where(start.ops.sin(start.state[0]) >= 0, 1.0, -1.0)
        self._missed_crossing = numpy.zeros(len(slip), dtype=bool)
        stepper.pars[-1] = self._slip_signs * self._sin_beta_signs

    def set_at_reversal(self, stepper: Any, sign: int, lane: int) -> None:
        """Set the sign in the friction law for a lane in which gamma_y / sin(beta) has changed its
        sign.

        Args:
            stepper: heyoka's batch integrator.
            sign: The sign of the function's derivative in time.
            lane: The number of the lane.
        """
        known = self._slip_signs[lane]
        slip_sign = float(sign if self._start.runs_forward[lane] else -sign) or known
        if slip_sign == known and abs(stepper.time[lane]) > MIN_TIME_ON_SURFACE:
            self._missed_crossing[lane] = True
        self._slip_signs[lane] = slip_sign
        stepper.pars[-1, lane] = slip_sign * self._sin_beta_signs[lane]

    def flip_with_sin_beta(self, stepper: Any, sign: int, lane: int) -> None:
        """Change the sign of gamma_y in the friction law for a lane in which sin(beta) has changed
        its sign.

        Args:
            stepper: heyoka's batch integrator.
            sign: The sign of the function's derivative in time, which is not used.
            lane: The number of the lane.
        """
        self._sin_beta_signs[lane] = -self._sin_beta_signs[lane]
        stepper.pars[-1, lane] = self._slip_signs[lane] * self._sin_beta_signs[lane]

    def used_wrong_sign(self, stepper: Any) -> Any:
        """Return a mask (n,) of the runs that used the wrong sign of gamma_y for a while.

        Args:
            stepper: heyoka's batch integrator at the end of the runs.
        """
        slip = self._start.event_value(SLIDING_REVERSAL, stepper.state[:3])
        right = slip * self._slip_signs >= -_MAX_RESIDUAL_SLIP * 2.0**-52
        return self._missed_crossing | ~right
