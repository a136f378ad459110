"""Proved Poincare maps of two sections: from a section along the flow to the first crossing.

The half map (`LIBRATING_SECTION`)
---------------------
It goes from beta = pi/2, v < 0 to the next crossing, v > 0, and back by S, which is x -> -x in
shifted angles. For every step one of these cases is shown, from its enclosure and the balls at its
ends:

- *falling*: v < 0 throughout, or v' > 0 throughout and v < 0 at the end. Then beta_bar falls.
- *turning*: v' > 0 throughout, v < 0 at the start, v > 0 and beta_bar < 0 at the end. Then v has
  exactly one zero in the step, where beta_bar is least, and beta_bar < 0 throughout.
- *rising*: v > 0 throughout, or v' > 0 throughout and v > 0 at the start. If beta_bar < 0 at the
  end, the section is not reached. If beta_bar > 0 there, it is crossed exactly once, with v > 0.

An orbit that falls, turns once and rises has beta_bar < 0 between the two sections.

The turn map (`ROTATING_SECTION`)
---------------------
It goes from gamma_bar = 0 to gamma_bar = 2 pi. As long as 0 < beta_bar < pi/2, the rate
gamma' = Omega sin(beta_bar) is positive. An orbit for which this is shown passes gamma_bar = 2 pi
exactly once.

Both maps
---------
For every step |beta_bar| < 1.5707 is shown: the disk does not lie flat. In a step in which the
friction law changes (`sliding.SlidingReversalStep`) v must keep its sign and gamma_bar must stay
below 2 pi. So neither the turn nor the section lies in it. If no case can be shown, a shorter step
is tried. If that does not help, the proof ends with the reason (`FlightStopped`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple

from tippedisk_verify.proofs.kernel.balls import arb, converted_like, inside, negative, positive
from tippedisk_verify.proofs.kernel.proved_flow import (
    EnclosedField,
    FlightStopped,
    FlowStatus,
    StepProposer,
)
from tippedisk_verify.proofs.kernel.sliding import SlidingReversalStep
from tippedisk_verify.proofs.kernel.step import Step, enclosed_zero_time

__all__ = [
    "BELOW_HALF_PI",
    "LIBRATING_SECTION",
    "ROTATING_SECTION",
    "PoincareImage",
    "PoincareSection",
    "enclose_poincare_map",
]

#: rad; as a radius, rounded up to 30 bits, still below 1.5707 and pi/2: sin(beta) > 0 within
BELOW_HALF_PI = 1.5706999
_MAX_SHORTENINGS = 40


class PoincareSection(NamedTuple):
    """A section of the state space with its Poincare map: the coordinates on the section, and the
    symmetry that is applied after the flight.
    """

    zero_component: int  #: index of the component that is zero on the section
    first_coordinate: int  #: index of the first coordinate on it; the second is v
    flights_per_period: int  #: flights in a period: two for the half map, with S between them

    @property
    def symmetry_sign(self) -> int:
        """The sign of the symmetry after the flight: -1 for the half map, 1 for the turn map."""
        return -1 if self.flights_per_period == 2 else 1

    def end_level(self) -> Any:
        """Return the value at which a flight ends of the component that is zero at its start: 0 or
        2 pi.
        """
        return arb(0) if self.flights_per_period == 2 else 2 * arb.pi()

    def state_on(self, first: Any, v: Any) -> list[Any]:
        """Return the state (beta_bar, gamma_bar, v) of the point on the section with these two
        coordinates.
        """
        state = [converted_like(v, 0), converted_like(v, 0), v]
        state[self.first_coordinate] = first
        return state


LIBRATING_SECTION, ROTATING_SECTION = PoincareSection(0, 1, 2), PoincareSection(1, 0, 1)


@dataclass(frozen=True)
class PoincareImage:
    """The proved properties of all orbits from a box on a section at their return to the section.

    The coordinates x are (gamma_bar, v) for the half map and (beta_bar, v) for the turn map.
    Derivatives are taken with respect to (x, Omega), over the box and the speeds in their ball.
    """

    steps: int
    reversals: int  #: changes of the sliding velocity's sign; counted under the smooth law only
    time: Any  #: flight time [s]
    image: Any  #: x under the map
    beta_least: Any = None  #: half map only: the least beta_bar, at the turn [rad]
    beta_least_by_start: Any = None  #: (3,)
    image_by_start: Any = None  #: (2, 3)
    time_by_start: Any = None  #: (3,)
    divergence: Any = None  #: integral of div f over the flight


def enclose_poincare_map(
    field: EnclosedField,
    section: PoincareSection,
    box: Sequence[Any],
    proposer: StepProposer,
    *,
    derivatives: bool = False,
    max_duration: float = 60.0,
) -> PoincareImage:
    """Enclose the Poincare map of a section, for all starts in a box of the section's two
    coordinates.

    Args:
        field: The vector field of the motion.
        section: The section.
        box: Balls of its two coordinates.
        proposer: The source of the steps.
        derivatives: Also enclose the map's derivatives.
        max_duration: The flight's longest duration [s].

    Returns:
        The proved properties.

    Raises:
        FlightStopped: If the orbits are not shown to return.
    """
    poincare_map = PoincareMap(field, section, box, proposer, derivatives=derivatives)
    flight = poincare_map.flight
    if section == LIBRATING_SECTION and not negative(converted_like(flight.time, box[1])):
        raise FlightStopped(FlowStatus.NO_START, flight.time)
    while flight.time < max_duration:
        if (image := poincare_map.advance()) is not None:
            return image
    raise FlightStopped(FlowStatus.NO_RETURN, flight.time)


class SectionCase(Enum):
    """The cases that are distinguished for all orbits in one step: they do not reach the section,
    they turn, or they cross it.

    The module's docstring has the conditions.
    """

    ON_THE_WAY = "they fall, or after the turn rise, and do not reach the section"
    TURNS = "they turn"
    CROSSES = "they cross the section"


class PoincareMap:
    """The flight of all orbits from a box on a section to the next crossing."""

    def __init__(
        self,
        field: EnclosedField,
        section: PoincareSection,
        box: Sequence[Any],
        proposer: StepProposer,
        *,
        derivatives: bool = False,
    ) -> None:
        self.section = section
        self.flight = field.flight(section.state_on(*box), proposer, derivatives=derivatives)
        #: Least beta_bar and its derivatives (gamma_bar, v, Omega); None until the orbits have
        #: turned
        self.turn: tuple[Any, Any] = (None, None)

    def advance(self) -> PoincareImage | None:
        """Take one proved step of the flight, shortened until its case is shown.

        Returns None while the flight goes on. At its end, returns the proved properties of the
        orbits at the section. Raises FlightStopped if no step is proved.
        """
        flight, not_flat, max_length = self.flight, True, None
        for _ in range(_MAX_SHORTENINGS):
            try:
                step = flight.step(max_length)
            except FlightStopped:
                if not_flat:
                    raise
                break
            not_flat, case = self._proved_case(step)
            if not_flat and case is SectionCase.CROSSES:
                if (moment := self._section_crossing_time(step)) is not None:
                    flight.take_step(step, moment)
                    return self._enclosed_return()
            elif not_flat and (
                case is SectionCase.ON_THE_WAY
                or (case is SectionCase.TURNS and self._enclose_turn(step))
            ):
                flight.take_step(step)
                return None
            max_length = 0.7 * step.length
        raise FlightStopped(FlowStatus.UNRESOLVED if not_flat else FlowStatus.FLAT, flight.time)

    def _proved_case(self, step: Step) -> tuple[bool, SectionCase | None]:
        """Return True if the disk is shown to stay upright in the step, and the case that is shown
        for the step: on its way, turning or crossing the section.

        The case is None if none is shown.
        """
        rates, (beta, _, v) = self.flight.field.rates(step.enclosure), step.enclosure
        beta_end, gamma_end, v_end = step.states_at_end()
        has_one_law = not isinstance(step, SlidingReversalStep)
        not_flat = inside(beta, converted_like(beta, arb(0, BELOW_HALF_PI)))
        if self.section == ROTATING_SECTION:
            ahead, not_flat = gamma_end - ROTATING_SECTION.end_level(), not_flat and positive(beta)
            if negative(ahead):
                return not_flat, SectionCase.ON_THE_WAY
            crosses = positive(ahead) and positive(rates[1]) and has_one_law
            return not_flat, SectionCase.CROSSES if crosses else None
        start, v_grows = self.flight.box[2], positive(rates[2]) and has_one_law
        if self.turn[0] is None:
            if negative(v) or (v_grows and negative(v_end)):
                return not_flat, SectionCase.ON_THE_WAY
            turns = v_grows and negative(start) and positive(v_end) and negative(beta_end)
            return not_flat, SectionCase.TURNS if turns else None
        if not (positive(v) or (v_grows and positive(start) and positive(v_end))):
            return not_flat, None
        if negative(beta_end):
            return not_flat, SectionCase.ON_THE_WAY
        return not_flat, SectionCase.CROSSES if positive(beta_end) and has_one_law else None

    def _enclose_turn(self, step: Step) -> bool:
        """Enclose the moment in the step at which v is 0, and store the beta_bar of that moment.

        Returns False if the moment cannot be enclosed.
        """
        field = self.flight.field
        moment = enclosed_zero_time(
            step,
            step.time_span(),
            lambda time: step.component(2, time),
            field.rates(step.enclosure)[2],
            lambda time: field.rates(step.states_at(time))[2],
        )
        if moment is None:
            return False
        # At the turn beta' = 0: moving the moment does not change beta to first order.
        self.turn = (
            step.component(0, moment),
            step.flight_derivatives_at(moment)[0][1:] if self.flight.carries_derivatives else None,
        )
        return True

    def _section_crossing_time(self, step: Step) -> Any:
        """Return a ball of times at which the orbits cross the section in the step.

        Returns None if they cannot be enclosed.
        """
        field, zero, level = (
            self.flight.field,
            self.section.zero_component,
            self.section.end_level(),
        )
        if self.section == ROTATING_SECTION:
            speed = field.rates(step.enclosure)[zero]
        else:
            v = step.enclosure[2]
            # v grows from its value at the start to that at the end.
            speed = v if positive(v) else self.flight.box[2].union(step.states_at_end()[2])
        return enclosed_zero_time(
            step,
            step.time_span(),
            lambda time: step.component(zero, time) - level,
            speed,
            lambda time: field.rates(step.states_at(time))[zero],
        )

    def _enclosed_return(self) -> PoincareImage:
        """Return the proved properties of all orbits at the section, once the flight has been taken
        there.
        """
        flight, section = self.flight, self.section
        first, sign = section.first_coordinate, section.symmetry_sign
        derivatives: dict[str, Any] = {}
        if flight.carries_derivatives:
            state = list(flight.box)
            if sign < 0:  # that is where the section lies
                state[section.zero_component] = converted_like(state[2], 0)
            rates, columns = flight.field.rates(state), (first, 2, 3)
            # On the section the time changes with the start, dt = -d(component) / its rate, and the
            # other components change with it.
            times = [
                -flight.derivatives[section.zero_component][k] / rates[section.zero_component]
                for k in columns
            ]
            rows = [
                [
                    sign * (flight.derivatives[row][k] + rates[row] * time)
                    for k, time in zip(columns, times, strict=True)
                ]
                for row in (first, 2)
            ]
            derivatives = {
                "image_by_start": rows,
                "time_by_start": times,
                "divergence": flight.divergence,
            }
        return PoincareImage(
            flight.step_count,
            flight.reversals,
            flight.time,
            tuple(sign * flight.box[row] for row in (first, 2)),
            beta_least=self.turn[0],
            beta_least_by_start=self.turn[1],
            **derivatives,
        )
