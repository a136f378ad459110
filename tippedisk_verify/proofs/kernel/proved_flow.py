"""Proved enclosures of the flow: all orbits from a set of states, followed from step to step.

All states are in shifted angles, (beta - pi/2, gamma - pi/2, v). The section is beta_bar = 0, the
symmetry S is x -> -x, and the equilibria are (0, 0, 0), (0, -pi, 0) and (0, pi, 0). The friction
law is linear; `sliding` has the smooth one. `step` proves one step, and `doubleton` has the sets of
states.

**Who chooses.** The lengths and orders of steps and the axes of sets come from a `StepProposer`. It
searches for them or reads them in a certificate. Any choice that passes the tests is right, and
nothing else is required of a proposer.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import Any, Protocol

from tippedisk_verify.proofs.kernel.balls import (
    BallOps,
    Unproved,
    ball,
    converted_like,
    magnitude_estimate,
    range_of,
    require,
    truncated_for_derivatives,
)
from tippedisk_verify.proofs.kernel.doubleton import Doubleton
from tippedisk_verify.proofs.kernel.step import Step, log2_magnitude
from tippedisk_verify.proofs.kernel.taylor_recurrences import (
    Graph,
    Node,
    System,
    systems_with_derivatives,
)
from tippedisk_verify.proofs.kernel.vector_field import VectorFieldMaker, vector_field

__all__ = [
    "EnclosedField",
    "EnclosedFlight",
    "FlightStopped",
    "FlowStatus",
    "StepProposer",
]

_MAX_RADIUS_BITS = 3  # -log2 of the radius [rad, rad/s] beyond which a box is too wide to go on
_MAX_STEPS = 20_000


class FlowStatus(Enum):
    """The reasons why the flow cannot be followed further.

    Each value is a message with what to try next.
    """

    NO_START = "v < 0 at the start is not proved: start on the other side of the section, or in a narrower box"
    NO_ENCLOSURE = "no step could be enclosed: work in more bits, or start from a narrower box"
    TOO_WIDE = "the enclosure has grown too wide: work in more bits, or start from a narrower box"
    FLAT = "the disk may lie flat (|beta - pi/2| reaches 1.5707): there is no return from here"
    NO_RETURN = "there is no return to the section in the time allowed"
    UNRESOLVED = "the signs of beta_bar and v could not be proved: work in more bits, or start from a narrower box"
    GRAZING = (
        "the sliding velocity is not proved to keep its sign or to change it at a rate other than "
        "zero: work in more "
        "bits, from a narrower box, or at another speed"
    )
    STEP_LIMIT = "the step limit was reached: shorten the run"


class FlightStopped(Unproved):
    """Raised if a flight cannot be followed further.

    The message has the time [s] that was reached, and the reason in words.
    """

    def __init__(self, status: FlowStatus, time_reached: Any) -> None:
        super().__init__(f"t = {float(time_reached):.4g} s: {status.value}")
        self.status, self.time_reached = status, time_reached


class StepProposer(Protocol):
    """The interface of an object that chooses the time steps and axes of a proved flight.

    It is a search or a reader of a certificate. Any choice is safe, because each step is tested.
    """

    def next_step(self, flight: EnclosedFlight, max_length: Any) -> Step | None:
        """Return the flight's next step, of at most ``max_length`` seconds, or None to give up.

        The step is made by a `StepTrial` of the flight. If the flight cannot use it, it asks again
        for a shorter one.
        """

    def after_reversal(self) -> StepProposer:
        """Return the proposer of the part of a step after the sliding velocity has changed its
        sign.
        """

    def new_axes(
        self, moved_axes: Sequence[Sequence[Any]], sizes: Sequence[Any], stiffness: Any
    ) -> Sequence[Sequence[Any]]:
        """Return new axes for the box of a set of states: the columns of a regular matrix of points
        (`doubleton.Doubleton.image_set`).

        Args:
            moved_axes: The old axes as the flow has moved them, a matrix of balls.
            sizes: The sizes of the set along the old axes.
            stiffness: The factor [1/s] that weighs velocities against angles.
        """

    def record_step(self, step: Step, axes: Sequence[Sequence[Any]]) -> None:
        """Record that the flight has taken the step, with these axes at its end."""


class EnclosedField:
    """The vector field on balls (Eq. 3DOF, linear friction) at an enclosed speed, with the systems
    of Taylor series that a step needs.

    Every enclosure holds for all constants and speeds in their balls. A field serves any number of
    flights.

    Args:
        constants: Those of `vector_field.FieldConstants`, as balls or arrays of balls.
        omega: [rad/s], a ball of any radius, a `Jet` of balls, or an array of balls.
        make_vector_field: The equations, if they are not those of the linear law.
        extra_parameters: Further numbers that ``make_vector_field`` takes after the speed.
    """

    def __init__(
        self,
        constants: Any,
        omega: Any,
        make_vector_field: VectorFieldMaker | None = None,
        extra_parameters: Sequence[Any] = (),
    ) -> None:
        self.constants, self.extra_parameters = constants, extra_parameters
        self.omega: Any = ball(omega)
        self.make_vector_field: VectorFieldMaker = make_vector_field or vector_field
        # The speed's radius goes with the box, in mean-value form.
        self.midpoint_system = self.system_at_speed(self.omega.mid())
        graph = Graph()
        variables = [graph.variable() for _ in range(3)]
        numbers = [graph.number(part, active=True) for part in (self.omega, *extra_parameters)]
        rates = self._rates(graph, variables, numbers)
        self.remainder_field: Any = self  #: the field that encloses remainders
        #: The system of the state (3) and its derivatives with respect to beta, gamma, v, Omega and
        #: the further numbers (3 each); ``variational_system_with_divergence`` adds the
        #: divergence's integral
        self.variational_system, self.variational_system_with_divergence = systems_with_derivatives(
            graph, variables, numbers, rates
        )

    def system_at_speed(self, omega: Any) -> System:
        """Return the equations of motion (a `System`) of the states alone, without derivatives, at
        another speed.
        """
        graph = Graph()
        variables = [graph.variable() for _ in range(3)]
        numbers = [graph.number(part) for part in (omega, *self.extra_parameters)]
        return System(graph, variables, self._rates(graph, variables, numbers))

    def flight(
        self, start: Sequence[Any], proposer: StepProposer, *, derivatives: bool = False
    ) -> EnclosedFlight:
        """Return the proved flight, before its first step, of all orbits from a box of states.

        ``proposer`` chooses the steps. With ``derivatives``, the flight carries those of the
        states.
        """
        return EnclosedFlight(self, start, proposer, derivatives=derivatives)

    def _rates(
        self, graph: Graph, variables: Sequence[Node], numbers: Sequence[Node]
    ) -> tuple[Node, ...]:
        constants = type(self.constants)(*map(graph.number, self.constants))
        return tuple(
            graph.number(rate)
            for rate in self.make_vector_field(graph, constants, *numbers)(*variables)
        )

    def rates(self, state: Sequence[Any]) -> tuple[Any, Any, Any]:
        """Return the rates of motion (beta', gamma', v') [rad/s, rad/s, rad/s^2] at a state of
        balls.
        """
        return self.make_vector_field(BallOps, self.constants, self.omega, *self.extra_parameters)(
            *state
        )


class EnclosedFlight:
    """The flight of all orbits from a box, one proved step after another.

    With ``derivatives``, those of the states are computed to the working precision and accumulated
    over the flight, together with the divergence's integral. Without, rough ones serve the
    mean-value form only. The box's parts may be arrays of balls: such a flight takes steps that its
    caller has tested.
    """

    def __init__(
        self,
        field: Any,
        start: Sequence[Any] | Doubleton,
        proposer: Any,
        *,
        derivatives: bool = False,
    ) -> None:
        self.field, self.proposer, self.carries_derivatives = field, proposer, derivatives
        self.state_set = (
            start
            if isinstance(start, Doubleton)
            else Doubleton([ball(part) for part in start], field.omega)
        )
        if len(self.state_set.middle) != 3:
            raise ValueError("a state has three components: beta_bar, gamma_bar, v")
        #: The start of the midpoint's orbit, if it is known separately
        self.midpoint_start: Sequence[Any] | None = None
        self.box = self.state_set.box()
        self.time, self.divergence = (
            converted_like(part, 0)
            for part in (self.box[0], truncated_for_derivatives(self.box[0]))
        )
        self.step_count = 0  #: taken
        self.reversals = 0  #: of the sliding velocity's sign; counted under the smooth law only
        self.latest_tested_step: Step | None = None  #: by its latest trial

    @property
    def derivatives(self) -> tuple[tuple[Any, ...], ...]:
        """The derivatives (3, 4) of the flight's current states with respect to their start and
        Omega.
        """
        return self.state_set.derivative_matrix()

    def step(self, max_length: Any = None) -> Step:
        """Ask the proposer for the next step of the flight, of at most ``max_length`` seconds, and
        return it without taking it.

        Raises FlightStopped if no step is proved.
        """
        status = self._stopping_status()
        step = None if status else self.proposer.next_step(self, max_length)
        if step is None:
            raise FlightStopped(status or FlowStatus.NO_ENCLOSURE, self.time)
        own = self.latest_tested_step
        if own is None or own.state_set is not self.state_set or own.length is not step.length:
            raise ValueError("the proposed step is not the latest trial of this path")
        require(
            own.included,
            "the states and derivatives over it are not shown to stay in its enclosure",
        )
        return own

    def _stopping_status(self) -> FlowStatus | None:
        if not all(part.is_finite() for part in self.box):
            return FlowStatus.NO_ENCLOSURE
        if max(log2_magnitude(part.rad()) for part in self.box) > -_MAX_RADIUS_BITS:
            return FlowStatus.TOO_WIDE
        return FlowStatus.STEP_LIMIT if self.step_count >= _MAX_STEPS else None

    def states_after(self, step: Step, time: Any = None) -> Doubleton:
        """Return the set of the states (a `Doubleton`) after ``time`` [s] in the step, or at the
        step's end if the time is left out.
        """
        stiffness = 1 + magnitude_estimate(
            range_of(step.derivative_polynomials[8][1])
        )  # of d(v)/d(v): its rate at the start
        centre, rows = (
            step.midpoint_end
            if time is None
            else (step.midpoint_orbit_at(time), step.step_derivatives_at(time))
        )
        return step.state_set.image_set(
            centre,
            rows,
            lambda moved_axes, sizes: self.proposer.new_axes(moved_axes, sizes, stiffness),
        )

    def take_step(self, step: Step, time: Any = None) -> None:
        """Move the flight forward to the end of a step, or to ``time`` (a number or ball) within
        the step.
        """
        moment = converted_like(self.time, step.length) if time is None else time
        state_set = self.states_after(step, time)
        self.proposer.record_step(step, [[*row] for row in state_set.axes])
        if self.carries_derivatives:
            self.divergence = self.divergence + step.divergence_at(moment)
        self.state_set, self.box, self.time, self.step_count = (
            state_set,
            state_set.box(),
            self.time + moment,
            self.step_count + 1,
        )
