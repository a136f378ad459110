"""Which analytic branch of the smooth law a run is on, and when it changes.

The field is continuous where gamma_y = 0, and so are its first derivatives, so state and derivatives are carried across
unchanged (the saltation matrix is the identity). A switch sets the branch from the direction of the crossing, not by
flipping it: one that was missed, because two crossings lay closer than events can tell apart, shows at the next.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from tippedisk_verify.flow.contract import START_WINDOW, SWITCH, Request
from tippedisk_verify.model.equations import field
from tippedisk_verify.model.precision import Precision

__all__ = ["Branch", "Pieces"]

_MOST_SWITCHES = 1_000_000  # in one run; ordinary motion has some ten a second


class Branch:
    """The sign of gamma_y that an integrator computes with, kept in its last parameter."""

    def __init__(self, precision: Precision, ops: Any, place: int) -> None:
        self._ops, self._place = ops, place
        self._one = precision.number(1)
        self._epsilon = float(precision.epsilon)
        self._window = precision.number(START_WINDOW)
        #: After a switch the branches differ by gamma_y squared: so long that this is below rounding, and no longer.
        self.moment = precision.number(float(precision.epsilon) ** (1 / 3))
        self.stepper: Any = None
        self.side = 1
        self.stops = self.stopped = self.asleep = False
        self._forward = True
        self._contradicted = False
        self._switches = 0

    def begin(self, request: Request, omega: Any, state: Sequence[Any], duration: Any) -> None:
        """Set the branch for a run. On the surface the sign a moment later decides."""
        self._constants, self._omega = request.parameters.at(request.precision), omega
        self._forward = bool(duration >= 0)
        self._contradicted = self.stopped = False
        self._switches = 0
        velocity = self._velocity(state)
        if abs(float(velocity)) <= 64 * self._epsilon:
            rates = field(self._ops, self._constants, omega, "smooth", self._one)(*state)
            step = self._window if self._forward else -self._window
            velocity = self._velocity([part + step * rate for part, rate in zip(state, rates, strict=True)])
        self._set(1 if velocity >= 0 else -1)

    def callback(self) -> Callable[[Any, int], bool]:
        """For heyoka, as a plain function: it copies whatever else it is given."""
        return lambda stepper, sign: self._switched(sign)

    def _switched(self, sign: int) -> bool:
        """At a crossing; whether the run goes on."""
        if self.asleep:
            return True
        self._switches += 1
        side = self.side if sign == 0 else sign if self._forward else -sign
        if side == self.side:
            # On this branch already: the crossing before was missed (or this one touches the surface only).
            self._contradicted = True
        self._set(side)
        self.stopped = self.stops
        return not self.stops and self._switches < _MOST_SWITCHES

    def look(self) -> None:
        """Take the branch of the present state."""
        self.stopped = False
        self._set(1 if self._velocity(self.stepper.state[:3]) >= 0 else -1)

    @property
    def lost(self) -> bool:
        """Whether the run was on the wrong branch for a while: by its switches, or by where it ended."""
        # A thousand roundings of the state are what may be left of gamma_y at a switch; NaN is lost too.
        return self._contradicted or not (
            float(self._velocity(self.stepper.state[:3])) * self.side >= -1000 * self._epsilon
        )

    def _velocity(self, state: Sequence[Any]) -> Any:
        return SWITCH.function(self._ops, self._constants, self._omega, *state)

    def _set(self, side: int) -> None:
        self.side = side
        self.stepper.pars[self._place] = self._one if side > 0 else -self._one


class Pieces:
    """Continuous output in several parts, each up to its end time."""

    def __init__(self, parts: Sequence[tuple[Any, Any]], forward: bool) -> None:
        self._parts = [(end, output) for end, output in parts if output is not None]
        self._forward = forward

    def __call__(self, times: Any) -> Any:
        import numpy

        rows = []
        for time in times:
            chosen = self._parts[-1][1]
            for end, output in self._parts:
                if (time <= end) if self._forward else (time >= end):
                    chosen = output
                    break
            rows.append(chosen(numpy.array([time], dtype=type(time)))[0].copy())
        return numpy.array(rows)
