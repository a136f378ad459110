"""The two sections on which limit cycles are fixed points: their coordinates, events, symmetries
and messages.

From a point of the section the flow goes on to the section's next crossing. A symmetry of the
equations takes it back. That is the return map, see `return_map`.

Librating cycles are their own image under the point symmetry S: (beta_bar, gamma_bar, v) ->
-(beta_bar, gamma_bar, v), so half a period determines them. Rotating cycles close after one turn of
gamma, and their symmetry is the shift by 2 pi.

All states are shifted, (beta_bar, gamma_bar, v).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Generic, Literal, NamedTuple, TypeVar

from tippedisk_verify.cycles.limit_cycle import Cycle, LimitCycle, RotatingCycle
from tippedisk_verify.flow.contract import BETA_EXTREME, GAMMA_TOP, SECTION, Event, Variation

__all__ = [
    "FULL_ROTATION",
    "GAMMA_BOTTOM",
    "LIBRATING",
    "RECORDED_BETA_EXTREME",
    "ROTATING",
    "SECTION_RETURN",
    "VARIATIONS",
    "EventQuantity",
    "Section",
]

C = TypeVar("C", bound=Cycle)

#: The next crossing of beta = pi/2 by a flight that starts there with v < 0.
SECTION_RETURN = Event("returns", SECTION.function, direction=-1)
#: gamma = pi/2 modulo 2 pi, passed upward: a turn of gamma is complete.
FULL_ROTATION = Event("round", GAMMA_TOP.function, direction=-1)
#: gamma = -pi/2 modulo 2 pi, passed upward: next to the saddle.
GAMMA_BOTTOM = Event("bottom", GAMMA_TOP.function, direction=1, terminal=False)
#: beta is extreme.
RECORDED_BETA_EXTREME = Event("extreme", BETA_EXTREME.function, terminal=False)
#: The variables with respect to which flights are differentiated. beta is among them: with four
#: variables heyoka differentiates in reverse, with less work.
VARIATIONS: tuple[Variation, ...] = ("beta", "gamma", "v", "Omega")


class EventQuantity(NamedTuple):
    """A further number of a limit cycle: a component of the state at an event of a flight, such as
    the largest lean.
    """

    name: str  #: the name in the result
    event: Event
    component: int
    largest: bool = False  #: True for the largest absolute value over all such events of a flight


@dataclass(frozen=True, eq=False)
class Section(Generic[C]):
    """A section of the state space for one kind of limit cycle, with the symmetry that closes a
    flight to a cycle.

    Sections compare by identity.
    """

    name: str
    cycle_class: type[C]  #: the class of the cycle through a fixed point of the return map
    crossing_sign: Literal[-1, 1]  #: the sign of the fixed component's rate where a flight starts
    end_event: Event  #: ends a flight
    rotations: int  #: the growth of the fixed component in a flight, in units of 2 pi
    symmetry_sign: Literal[-1, 1]  #: the derivative of the symmetry that follows the flow
    flights_per_period: int  #: flights that make up a period of the cycle
    #: True for coordinates that a start may have, given as doubles; a mask (n,) for arrays (n,)
    allows_start: Callable[[Any, Any], Any]
    bad_start_message: str  #: the message for a start with other coordinates
    no_return_message: str  #: the message for an orbit that does not come back
    event_quantities: tuple[EventQuantity, ...]  #: the numbers that the events of a flight give
    #: the scale of the coordinates next to a saddle, at most 1; its square is the scale of the
    #: speed
    saddle_scale: Callable[[Any], float]

    @property
    def zero_component(self) -> int:
        """The index of the component of the state that is zero on the section."""
        return self.cycle_class.zero_component

    @property
    def free_components(self) -> tuple[int, int]:
        """The indices of the other two components of the state, which are a point's coordinates on
        the section.
        """
        return (1, 2) if self.zero_component == 0 else (0, 2)

    @property
    def coordinate_names(self) -> tuple[str, str]:
        """The names of the two coordinates on the section."""
        return self.cycle_class.coordinates

    @property
    def recorded_events(self) -> tuple[Event, ...]:
        """The events that a flight must record so that `quantities_at_events` can read the
        section's quantities from it.
        """
        return tuple(dict.fromkeys(quantity.event for quantity in self.event_quantities))

    @property
    def growth(self) -> tuple[float, float]:
        """The amount by which the component that is zero on the section grows in a flight, and the
        rounding error of this double [rad].
        """
        return self.rotations * math.tau, self.rotations * 2.4492935982947064e-16

    def quantities_at_events(self, events: Iterable[tuple[str, Any]], zero: Any) -> dict[str, Any]:
        """Return the section's quantities, further numbers of a cycle such as the largest lean, by
        name, from the events of one flight.

        Args:
            events: The (name, state) pairs of the ``recorded_events`` of one flight.
            zero: The zero of the arithmetic.
        """
        numbers = dict.fromkeys((quantity.name for quantity in self.event_quantities), zero)
        for name, state in events:
            for quantity in self.event_quantities:
                if quantity.event.name == name:
                    value = state[quantity.component]
                    numbers[quantity.name] = (
                        max(numbers[quantity.name], abs(value)) if quantity.largest else value
                    )
        return numbers


_BETA_MAX = EventQuantity("beta_max", RECORDED_BETA_EXTREME, 0, largest=True)

#: beta = pi/2 with v < 0, to the next crossing (v > 0), then S. gamma is extreme there: gamma'
#: vanishes.
LIBRATING = Section(
    name="librating",
    cycle_class=LimitCycle,
    crossing_sign=-1,
    end_event=SECTION_RETURN,
    rotations=0,
    symmetry_sign=-1,
    flights_per_period=2,
    # gamma_bar rounds to the saddle's pi next to Omega_h, so pi itself is allowed.
    allows_start=lambda gamma_bar, v: (abs(gamma_bar) <= math.pi) & (gamma_bar != 0) & (v < 0),
    bad_start_message="shooting starts at beta = pi/2 with v < 0, within half a turn of gamma = pi/2: the "
    "guess does not",
    no_return_message="the orbit does not return to beta = pi/2",
    event_quantities=(_BETA_MAX,),
    saddle_scale=lambda point: abs(1 - (point[0] / math.pi) ** 2),
)
#: gamma = pi/2 with a lean to one side, to the same place a turn of gamma later. The section lies
#: opposite the saddle, where gamma' is far from zero.
ROTATING = Section(
    name="rotating",
    cycle_class=RotatingCycle,
    crossing_sign=1,
    end_event=FULL_ROTATION,
    rotations=1,
    symmetry_sign=1,
    flights_per_period=1,
    allows_start=lambda beta_bar, v: (beta_bar > 0) & (beta_bar < 1.5707),
    bad_start_message="a rotating cycle leans to one side, 0 < beta - pi/2 < pi/2: the guess does not",
    no_return_message="gamma does not come round: the orbit turns back, or has not passed the saddle",
    event_quantities=(
        _BETA_MAX,
        EventQuantity("beta_bar_0", GAMMA_BOTTOM, 0),
        EventQuantity("v_0", GAMMA_BOTTOM, 2),
    ),
    saddle_scale=lambda point: 1.0,
)
