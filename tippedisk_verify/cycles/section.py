"""The sections of the state space on which limit cycles are fixed points, one for each kind of cycle.

From a point of the section the flow goes on to the section's next crossing, and a symmetry of the equations takes it
back: that is the return map, see `return_map`. Librating cycles are their own image under the point symmetry
S: (beta_bar, gamma_bar, v) -> -(beta_bar, gamma_bar, v), so half a period holds all of them. Rotating ones close after
one turn of gamma, and the symmetry is the shift by 2 pi.

All states are shifted, (beta_bar, gamma_bar, v).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Literal, NamedTuple, TypeVar

import numpy

from tippedisk_verify.cycles.limit_cycle import Cycle, LimitCycle, RotatingCycle
from tippedisk_verify.flow.contract import SECTION, TURN, Event, Variation

__all__ = ["BOTTOM", "EXTREME", "LIBRATING", "RETURNS", "ROTATING", "ROUND", "VARIATIONS", "Measure", "Section"]

C = TypeVar("C", bound=Cycle)

_LEAST_MULTIPLIER = 2.0**-1022  # the least normal double

#: The next crossing of beta = pi/2 by a flight that starts there with v < 0.
RETURNS = Event("returns", SECTION.function, direction=-1)
#: gamma = pi/2 modulo 2 pi, passed upward.
ROUND = Event("round", lambda ops, constants, omega, beta, gamma, v: ops.cos(gamma), direction=-1)
#: gamma = -pi/2 modulo 2 pi, passed upward: next to the saddle.
BOTTOM = Event("bottom", ROUND.function, direction=1, terminal=False)
#: Where beta is extreme.
EXTREME = Event("extreme", TURN.function, terminal=False)
#: By what flights are differentiated. beta too: with four, heyoka differentiates in reverse, with less work.
VARIATIONS: tuple[Variation, ...] = ("beta", "gamma", "v", "Omega")


class Measure(NamedTuple):
    """A number of the cycle that an event of a flight tells: a component of the state there."""

    name: str  #: as the result calls it
    event: Event
    component: int
    largest: bool = False  #: the largest absolute value over all such events of a flight


@dataclass(frozen=True, eq=False)
class Section(Generic[C]):
    """Where the cycles of a kind start, and what closes them. Sections compare by identity."""

    name: str
    result: type[C]  #: what a fixed point of the return map is
    passed: Literal[-1, 1]  #: the sign of the fixed component's rate where a flight starts
    ends: Event  #: ends a flight
    turns: int  #: by how many times 2 pi the fixed component grows in a flight
    image: Literal[-1, 1]  #: the derivative of the symmetry that follows the flow
    per_period: int  #: flights that make up a period of the cycle
    possible: Callable[[Any, Any], Any]  #: which coordinates a start may have; of doubles or of arrays (n,)
    impossible: str  #: the message for a start with other coordinates
    no_return: str  #: the message for an orbit that does not come back
    measures: tuple[Measure, ...]  #: what the events of a flight tell
    saddle_scale: Callable[[Any], float]  #: of coordinates next to a saddle, at most 1; its square is the speed's

    @property
    def fixed(self) -> int:
        """The component of the state that is zero on the section."""
        return self.result.fixed

    @property
    def free(self) -> tuple[int, int]:
        """The other two, a point's coordinates."""
        return (1, 2) if self.fixed == 0 else (0, 2)

    @property
    def names(self) -> tuple[str, str]:
        """Names of the two coordinates."""
        return self.result.coordinates

    @property
    def recorded(self) -> tuple[Event, ...]:
        """The events that `measured` reads."""
        return tuple(dict.fromkeys(measure.event for measure in self.measures))

    @property
    def growth(self) -> tuple[float, float]:
        """By how much the fixed component grows in a flight, and what rounding left of it [rad]."""
        return self.turns * math.tau, self.turns * 2.4492935982947064e-16

    @property
    def numbers(self) -> tuple[str, ...]:
        """Names of all numbers of a cycle that have half-widths."""
        by_omega = (f"d{name}_domega" for name in ("period", *self.names))
        multipliers = ("multiplier_slow", "log_multiplier_slow", "log_multiplier_fast")
        return ("period", *self.names, *(measure.name for measure in self.measures), *multipliers, *by_omega)

    def table(
        self,
        point: Sequence[Any],
        time: Any,
        matrix: Any,
        slopes: Any,
        trivial: Any,
        flight: Mapping[str, Any],
        ops: Any,
    ) -> dict[str, Any]:
        """Return the numbers of a cycle by their names, or of many cycles as arrays (n,).

        Args:
            point: both coordinates on the section.
            time: the flight time [s].
            matrix: the derivative of the section's map.
            slopes: derivatives of both coordinates and the flight time by Omega, along the family.
            trivial: the multiplier of a flight along the flow, 1 but for rounding.
            flight: the section's measures and the integral of the ``divergence`` over the flight.
            ops: the functions of the arithmetic.
        """
        laps, choose = self.per_period, numpy.where if isinstance(time, numpy.ndarray) else _chosen
        (a, b), (c, d) = matrix
        trace, determinant = a + d, a * d - b * c
        # The larger root of l^2 - trace l + determinant. Mostly the determinant is some 1e-25 and only corrects it.
        # Of a complex pair it is the modulus, with the sign that the larger one has where they meet.
        discriminant = trace * trace / 4 - determinant
        real = abs(trace) / 2 + ops.sqrt(abs(discriminant))
        size = choose(discriminant >= 0, real, ops.sqrt(abs(determinant))) ** laps
        slow = size if laps == 2 else choose(trace >= 0, size, -size)
        # A multiplier that rounding has lost has a logarithm for all that.
        log_slow = ops.log(choose(size == 0, _LEAST_MULTIPLIER, size))
        log_multipliers = laps * flight["divergence"]
        first, second = self.names
        return {
            "period": laps * time,
            first: point[0],
            second: point[1],
            **{measure.name: flight[measure.name] for measure in self.measures},
            "multiplier_slow": slow,
            "log_multiplier_slow": log_slow,
            # det of the flow over a period = slow * fast * 1 (trivial); Liouville gives its logarithm.
            "log_multiplier_fast": log_multipliers - log_slow,
            "log_multipliers": log_multipliers,
            "trivial_multiplier_defect": abs((trivial * trivial if laps == 2 else trivial) - 1),
            "dperiod_domega": laps * slopes[2],
            f"d{first}_domega": slopes[0],
            f"d{second}_domega": slopes[1],
        }

    def measured(self, events: Iterable[tuple[str, Any]], zero: Any) -> dict[str, Any]:
        """The measures, from (name, state) of the ``recorded`` events of one flight; ``zero`` is the arithmetic's."""
        numbers = dict.fromkeys((measure.name for measure in self.measures), zero)
        for name, state in events:
            for measure in self.measures:
                if measure.event.name == name:
                    value = state[measure.component]
                    numbers[measure.name] = max(numbers[measure.name], abs(value)) if measure.largest else value
        return numbers


def _chosen(condition: Any, one: Any, other: Any) -> Any:
    return one if condition else other


_BETA_MAX = Measure("beta_max", EXTREME, 0, largest=True)

#: beta = pi/2 with v < 0, to the next crossing (v > 0), then S. gamma is extreme there, for gamma' vanishes.
LIBRATING = Section(
    name="librating",
    result=LimitCycle,
    passed=-1,
    ends=RETURNS,
    turns=0,
    image=-1,
    per_period=2,
    # As a double gamma_bar may be the saddle's, pi, which it is not.
    possible=lambda gamma_bar, v: (abs(gamma_bar) <= math.pi) & (gamma_bar != 0) & (v < 0),
    impossible="shooting starts at beta = pi/2 with v < 0, within half a turn of gamma = pi/2: the guess does not",
    no_return="the orbit does not return to beta = pi/2",
    measures=(_BETA_MAX,),
    saddle_scale=lambda point: abs(1 - (point[0] / math.pi) ** 2),
)
#: gamma = pi/2 with a lean to one side, to the same place a turn of gamma later. It lies opposite the saddle, where
#: gamma' is far from zero.
ROTATING = Section(
    name="rotating",
    result=RotatingCycle,
    passed=1,
    ends=ROUND,
    turns=1,
    image=1,
    per_period=1,
    possible=lambda beta_bar, v: (beta_bar > 0) & (beta_bar < 1.5707),
    impossible="a rotating cycle leans to one side, 0 < beta - pi/2 < pi/2: the guess does not",
    no_return="gamma does not come round: the orbit turns back, or has not passed the saddle",
    measures=(_BETA_MAX, Measure("beta_bar_0", BOTTOM, 0), Measure("v_0", BOTTOM, 2)),
    saddle_scale=lambda point: 1.0,
)
