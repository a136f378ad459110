"""The turn map: from gamma = pi/2, where the disk leans to one side, to the same place one turn of gamma later.

A fixed point is a rotating limit cycle: beta_bar > 0 throughout, and gamma grows by 2 pi a period. The point symmetry
takes it to the cycle that rotates the other way. The section lies opposite the saddle, where gamma' is far from zero.

Compatibility: this file goes when the families use `section` and `return_map`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from tippedisk_verify.cycles.half_map import HalfFlights
from tippedisk_verify.cycles.limit_cycle import RotatingCycle
from tippedisk_verify.cycles.section import BOTTOM, EXTREME, ROUND
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.flow.contract import Request, Result, Status

__all__ = ["BOTTOM", "ROUND", "TurnFlights", "TurnMap"]


class TurnMap(NamedTuple):
    """One point's image under the turn map, with derivatives by (beta_bar, v) and by Omega."""

    time: Any  #: flight time [s]
    residual: tuple[Any, Any]  #: (beta_bar, v) after the turn minus before [rad, rad/s]
    matrix: tuple[tuple[Any, Any], tuple[Any, Any]]  #: of the map
    by_omega: tuple[Any, Any]  #: of the map
    time_by_state: tuple[Any, Any]
    time_by_omega: Any
    flow: Any  #: the flow's derivatives at fixed time, (beta, gamma, v) by (beta, gamma, v, Omega)


class TurnFlights(HalfFlights):
    """Turns of gamma of one disk at one speed in one arithmetic, each from a (beta_bar, v) at gamma = pi/2.

    They raise NoSuchCycleError for a start with beta_bar outside (0, pi/2), and where gamma does not come round.
    """

    per_period = 1
    result = RotatingCycle
    unknowns = RotatingCycle.unknowns
    returns = ROUND
    recorded = (EXTREME, BOTTOM)

    def map(self, state: Sequence[Any], rounding: int | None = None) -> TurnMap:  # type: ignore[override]
        time, rows, end = self._varied(state, rounding)
        rates = self._rates(*end)
        # On the section time moves with start and speed, dt = -d(gamma) / gamma', and takes beta and v along.
        times = [-entry / rates[1] for entry in rows[1]]
        beta, v = ([entry + rates[axis] * moved for entry, moved in zip(rows[axis], times, strict=True)]
                   for axis in (0, 2))  # fmt: skip
        return TurnMap(
            time=time,
            residual=self.residual(end, state),
            matrix=((beta[0], beta[2]), (v[0], v[2])),
            by_omega=(beta[3], v[3]),
            time_by_state=(times[0], times[2]),
            time_by_omega=times[3],
            flow=rows,
        )

    def residual(self, end: Sequence[Any], state: Sequence[Any]) -> tuple[Any, Any]:
        return end[0] - state[0], end[2] - state[1]

    @staticmethod
    def room(state: Sequence[float]) -> float:
        return 1.0

    @staticmethod
    def measures(flight: Result) -> dict[str, Any]:
        """The largest lean, and (beta_bar, v) at gamma = -pi/2."""
        (bottom,) = (record.state for record in flight.events if record.name == BOTTOM.name)
        return {**HalfFlights.measures(flight), "beta_bar_0": bottom[0], "v_0": bottom[2]}

    def trivial_multiplier(self, state: Sequence[Any], mapped: Any) -> Any:
        """The multiplier along the flow, 1 but for rounding: the Rayleigh quotient of the monodromy matrix there."""
        rates = self._rates(*self._start(state))
        images = (sum(entry * rate for entry, rate in zip(row, rates, strict=False)) for row in mapped.flow)
        return sum(a * b for a, b in zip(images, rates, strict=True)) / sum(rate * rate for rate in rates)

    def _start(self, state: Sequence[Any]) -> tuple[Any, Any, Any]:
        return state[0], -self._edge, state[1]

    def _flown(self, request: Request) -> Result:
        if not 0 < float(request.state[0]) < 1.5707:  # type: ignore[arg-type]
            raise NoSuchCycleError("a rotating cycle leans to one side, 0 < beta - pi/2 < pi/2: the guess does not")
        result = self.engine(request)
        if result.status is not Status.EVENT or not float(result.state[1]) > 3:
            raise NoSuchCycleError("gamma does not come round: the orbit turns back, or has not passed the saddle")
        return result
