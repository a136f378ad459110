"""The half-period map: from the section beta = pi/2 with v < 0 to the next crossing, and back by the symmetry.

By the point symmetry S the flow to the next crossing (v > 0), followed by S, is a map of the section into itself whose
square is the return map. A fixed point is a symmetric limit cycle.

Compatibility: this file goes when the families use `section` and `return_map`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from tippedisk_verify.cycles.limit_cycle import LimitCycle
from tippedisk_verify.cycles.return_map import newton_step
from tippedisk_verify.cycles.section import EXTREME, RETURNS, VARIATIONS
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.flow.contract import Engine, Event, Request, Result, Status
from tippedisk_verify.model.equations import field, shifted
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE, Precision

__all__ = ["EXTREME", "RETURNS", "VARIATIONS", "HalfFlights", "HalfMap", "half_map", "newton_step"]

_LONGEST_FLIGHT = 200.0  # s; half a period at Omega_h + 1e-280


class HalfMap(NamedTuple):
    """One point's image, with derivatives.

    ``residual`` is (gamma_bar, v) after the map minus before; ``matrix`` is with respect to (gamma_bar, v).
    """

    time: Any  #: flight time [s]
    residual: tuple[Any, Any]  #: [rad, rad/s]
    matrix: tuple[tuple[Any, Any], tuple[Any, Any]]  #: of the map (S after the flow)
    flow: Any  #: the flow's derivatives at fixed time, (beta, gamma, v) by (beta, gamma, v, Omega)
    arrival: tuple[Any, Any]  #: (v, v') at the next crossing [rad/s, rad/s^2]

    @property
    def time_by_state(self) -> tuple[Any, Any]:
        """Derivatives of the flight time by gamma_bar and v: on the section time moves by dt = -d(beta) / v."""
        return -self.flow[0][1] / self.arrival[0], -self.flow[0][2] / self.arrival[0]

    @property
    def time_by_omega(self) -> Any:
        return -self.flow[0][3] / self.arrival[0]

    @property
    def by_omega(self) -> tuple[Any, Any]:
        """Derivatives of the map by Omega."""
        _, gamma_row, v_row = self.flow
        return -gamma_row[3], -(v_row[3] + self.arrival[1] * self.time_by_omega)


class HalfFlights:
    """Half periods of one disk at one speed in one arithmetic, each from a (gamma_bar, v) on the section.

    They raise NoSuchCycleError for a start with v >= 0, and where the orbit does not return to the section.
    """

    per_period = 2  #: flights that make up a period of the cycle
    result: type[Any] = LimitCycle  #: what a fixed point is
    unknowns = LimitCycle.unknowns  #: names of the two coordinates on the section
    returns = RETURNS  #: the event that ends a flight
    recorded: tuple[Event, ...] = (EXTREME,)  #: events that `measures` reads

    def __init__(self, parameters: Parameters, omega: Any, engine: Engine, precision: Precision) -> None:
        self.parameters, self.engine, self.precision = parameters, engine, precision
        self.omega = omega
        self._omega = precision.number(omega)  # once, not at every start
        self._rates = field(shifted(precision.ops), parameters.at(precision), self._omega, parameters.friction)
        # Past the section by far less than rounding: of a function that is zero to the last bit at the start, heyoka
        # sees no other crossing in its first step. (With the fourth power MPFR's numbers would lose memory.)
        self._edge = precision.number(-(precision.epsilon**2))
        self._mapped: Request | None = None
        self._plain: dict[tuple[bool, tuple[Event, ...]], Request] = {}

    def __call__(
        self,
        state: Sequence[Any],
        *,
        divergence: bool = False,
        events: tuple[Event, ...] = (),
        rounding: int | None = None,
    ) -> Result:
        """To the next crossing, without derivatives."""
        key = (divergence, events)
        if key not in self._plain:
            self._plain[key] = self._request(state, divergence=divergence, events=(self.returns, *events))
        return self._flown(self._plain[key].starting_at(self._start(state), rounding))

    def map(self, state: Sequence[Any], rounding: int | None = None) -> HalfMap:
        """The map and its derivatives at ``state``."""
        time, rows, end = self._varied(state, rounding)
        beta_row, gamma_row, v_row = rows
        v = end[2]
        v_rate = self._rates(*end)[2]
        # On the section time moves with the start, dt = -d(beta)/v; gamma' = -Omega cos(beta) is zero there.
        slope = v_rate / v
        return HalfMap(
            time,
            self.residual(end, state),
            ((-gamma_row[1], -gamma_row[2]), (slope * beta_row[1] - v_row[1], slope * beta_row[2] - v_row[2])),
            rows,
            (v, v_rate),
        )

    def _varied(self, state: Sequence[Any], rounding: int | None) -> tuple[Any, Any, Any]:
        """Time, derivatives and state of a flight with variational equations."""
        if self._mapped is None:
            self._mapped = self._request(state, variations=VARIATIONS, events=(self.returns,))
        result = self._flown(self._mapped.starting_at(self._start(state), rounding))
        if self.precision != DOUBLE:
            return result.time, result.derivatives, result.state
        # Python's own floats: arithmetic on numpy's scalars takes longer.
        return result.time, result.derivatives.tolist(), result.state.tolist()

    def residual(self, end: Sequence[Any], state: Sequence[Any]) -> tuple[Any, Any]:
        """The map's image, given where the flow arrives, less where it started."""
        return -end[1] - state[0], -end[2] - state[1]

    @staticmethod
    def room(state: Sequence[float]) -> float:
        """The scale of a cycle's coordinates next to a saddle, at most 1; its square is the speed's."""
        return abs(1 - (state[0] / math.pi) ** 2)

    @staticmethod
    def measures(flight: Result) -> dict[str, Any]:
        """What a flight with the events ``recorded`` tells of the cycle besides its coordinates."""
        turns = [abs(record.state[0]) for record in flight.events if record.name == EXTREME.name]
        return {"beta_max": max(turns, default=abs(0 * flight.time))}

    def trivial_multiplier(self, state: Sequence[Any], mapped: HalfMap) -> Any:
        """The half map's multiplier along the flow, 1 but for rounding.

        It is the Rayleigh quotient of the flow followed by the linear part of S, -1, on the flow's direction
        (v, 0, v') at the start.
        """
        gamma_bar, v = state
        v_rate = self._rates(0 * v, gamma_bar, v)[2]
        beta_row, _, v_row = mapped.flow
        beta_image = beta_row[0] * v + beta_row[2] * v_rate
        v_image = v_row[0] * v + v_row[2] * v_rate
        return -(v * beta_image + v_rate * v_image) / (v * v + v_rate * v_rate)

    def _start(self, state: Sequence[Any]) -> tuple[Any, Any, Any]:
        """(beta_bar, gamma_bar, v) of a point on the section."""
        return self._edge, state[0], state[1]

    def _request(self, state: Sequence[Any], **needs: Any) -> Request:
        return Request(
            self.parameters,
            self._omega,
            self._start(state),
            _LONGEST_FLIGHT,
            shifted=True,
            precision=self.precision,
            domain="none",
            **needs,
        )

    def _flown(self, request: Request) -> Result:
        if not request.state[2] < 0:  # type: ignore[operator]
            raise NoSuchCycleError(
                "shooting starts at beta = pi/2 with v < 0: the guess has left that side of the section"
            )
        result = self.engine(request)
        if result.status is not Status.EVENT:
            raise NoSuchCycleError(f"the orbit does not return to beta = pi/2: {result.status.value}")
        return result


def half_map(
    parameters: Parameters,
    omega: Any,
    state: Sequence[Any],
    engine: Engine,
    precision: Precision = DOUBLE,
) -> HalfMap:
    """The map and its derivatives at one (gamma_bar, v). Raises NoSuchCycleError without a return."""
    start = tuple(precision.number(part) for part in state)
    return HalfFlights(parameters, omega, engine, precision).map(start)
