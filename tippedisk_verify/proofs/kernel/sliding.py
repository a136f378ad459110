"""Proved enclosures of the flow under the smooth friction law, whose field is analytic on either
side of gamma_y = 0.

One law for each side
---------------------
gamma_y is the sliding velocity. For each sign s the law with |gamma_y| replaced by s gamma_y
(`vector_field.one_sided_vector_field`) is analytic wherever s gamma_y > -epsilon. It is the smooth
law where s gamma_y >= 0. As

    traction / (s gamma_y + epsilon) = (s traction) / (gamma_y + s epsilon),

it is the law of side 1 for the constants s traction and s epsilon.

Steps
-----
An orbit is followed with its own side's law, by the steps of `proved_flow`. Their time is cut into
pieces, on which Taylor's formula encloses s gamma_y and its rate. One of these cases is shown:

- *kept*: on each piece s gamma_y > 0, or grows, or falls to a positive end, on the same piece or a
  later one.
- *crossed*: s gamma_y is positive up to pieces on which it falls to a negative end. Then every
  orbit of side s has exactly one zero tau of gamma_y in the step. Up to tau it is an orbit of the
  smooth law. The step encloses the states at the ball of all tau. From there a step of the other
  side's law follows, with s gamma_y' < 0 throughout: gamma_y has changed its sign and keeps it.

If neither case can be shown by shorter steps, the proof ends: an orbit may touch gamma_y = 0 there
and turn back.

The derivatives through a crossing
----------------------------------
Let phi and psi be the flows of the two sides' laws, with fields f_s and f_-s. At a time t after the
crossing the state is psi(t - tau, phi(tau, x)). Here tau is an analytic function of the start x and
of Omega, as gamma_y' is not zero. A flow's time derivative is its derivative with respect to the
state times the field, so

    d(state)/dx = psi_x phi_x + psi_x (f_s - f_-s) dtau/dx,       f_s = f_-s where gamma_y = 0.

Derivatives multiply as if tau were a fixed time. Those with respect to Omega are psi_x phi_Omega +
psi_Omega. (The jump, or saltation, matrix is the identity.) The products are taken over the ball of
all tau. So the smooth law's flow is continuously differentiable along such orbits, and the mean
value theorem applies as in `step`. The midpoint has its own tau, known to the working precision: no
digits are lost.

Where a ball becomes a point or a float: pieces and the step's end are free.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from tippedisk_verify.proofs.kernel.balls import (
    BallOps,
    arb,
    converted_like,
    magnitude_estimate,
    negative,
    positive,
)
from tippedisk_verify.proofs.kernel.certificate_format import FRICTION_LAWS
from tippedisk_verify.proofs.kernel.proved_flow import (
    EnclosedField,
    EnclosedFlight,
    FlightStopped,
    FlowStatus,
    StepProposer,
)
from tippedisk_verify.proofs.kernel.step import Step, enclosed_zero_time, evaluate_polynomial
from tippedisk_verify.proofs.kernel.taylor_recurrences import Graph, System
from tippedisk_verify.proofs.kernel.vector_field import (
    VectorFieldMaker,
    one_sided_vector_field,
    sliding_motion,
)

__all__ = [
    "SlidingFlight",
    "SlidingReversalStep",
    "SmoothField",
    "field_for_friction",
]

_PIECES_PER_STEP = 16  # of a step
# The order of gamma_y's series. Its values are differences of larger numbers, which boxes of states
# would lose.
_VELOCITY_ORDER = 10
_MAX_SHORTENINGS = 14
_MIN_STEP = 2.0**-40  # s
_CROSSING_MARGIN = 2.0**-8  # of the step: its part after the crossing
_LENGTH_MARGIN = 1 + 2.0**-18  # a proposer may round lengths down to 20 bits


def field_for_friction(friction: str, constants: Any, omega: Any) -> EnclosedField:
    """Return the vector field on balls, as an `EnclosedField`, under a friction law.

    ``friction`` is 'linear' or 'smooth'.
    """
    return (SmoothField if FRICTION_LAWS[friction].two_sided else EnclosedField)(constants, omega)


class SmoothField(EnclosedField):
    """The vector field with the analytic friction law of one side of gamma_y = 0.

    This is side 1, unless `for_side` has changed the signs of traction and epsilon.
    """

    def __init__(self, constants: Any, omega: Any, law: VectorFieldMaker | None = None) -> None:
        super().__init__(constants, omega, law or one_sided_vector_field(1))
        self._other_side: SmoothField | None = None
        graph = Graph()
        variables, speed = [graph.variable() for _ in range(3)], graph.number(self.omega)
        numbers = type(self.constants)(*map(graph.number, self.constants))
        rates = self.make_vector_field(graph, numbers, speed)(*variables)
        velocity, _ = sliding_motion(graph, numbers, speed, variables)
        self._system_with_sliding_path = System(
            graph, [*variables, graph.variable()], [*rates, velocity]
        )

    def for_side(self, side: int) -> SmoothField:
        """Return this field for ``side`` >= 0, and the field with the friction law of the other
        side of gamma_y = 0 for a negative ``side``.
        """
        if side >= 0:
            return self
        if self._other_side is None:
            traction, epsilon = -self.constants.traction, -self.constants.epsilon
            self._other_side = SmoothField(
                self.constants._replace(traction=traction, epsilon=epsilon), self.omega
            )
            self._other_side._other_side = self
        return self._other_side

    def sliding_velocity_and_rate(
        self, state: Sequence[Any], *, middle: bool = False
    ) -> tuple[Any, Any]:
        """Return the sliding velocity gamma_y [m/s] of a state and its rate [m/s^2], by this
        field's law.

        If ``middle`` is True, they are those at the midpoint of the ball of speeds; otherwise they
        hold for all speeds in the ball.
        """
        omega = self.omega.mid() if middle else self.omega
        acceleration = self.make_vector_field(BallOps, self.constants, omega)(*state)[2]
        return sliding_motion(BallOps, self.constants, omega, state, acceleration)

    def sliding_velocity_series(self, state: Sequence[Any], order: int) -> list[Any]:
        """Return Taylor coefficients 0 to ``order`` of the sliding velocity gamma_y along orbits
        from a state.
        """
        integral = self._system_with_sliding_path.coefficients(
            [*state, converted_like(state[0], 0)], order + 1
        )[-1]
        return [k * coefficient for k, coefficient in enumerate(integral)][1:]

    def flight(
        self, start: Sequence[Any], proposer: StepProposer, *, derivatives: bool = False
    ) -> EnclosedFlight:
        return SlidingFlight(self, start, proposer, derivatives=derivatives)


@dataclass(frozen=True)
class SlidingReversalStep(Step):
    """An accepted step in which the sliding velocity of every orbit changes its sign, exactly once.

    The derivatives at times that are not shown to be later than all crossings are not finite.
    """

    step_before_reversal: Any = None  #: the step with the first side's law
    reversal_time: Any = None  #: when the orbits cross, from the step's start [s]
    step_after_reversal: Any = (
        None  #: the step from there, with the other side's law and the midpoint's orbit
    )
    midpoint_reversal_time: Any = None  #: when the midpoint's orbit crosses

    def states_at(self, time: Any, components: slice = slice(3)) -> tuple[Any, ...]:
        if positive(self.reversal_time - time):
            return tuple(self.step_before_reversal.states_at(time, components))
        if positive(time - self.reversal_time):
            return super().states_at(time, components)
        return self.enclosure[components]

    def step_derivatives_at(
        self, time: Any, components: slice = slice(3)
    ) -> tuple[tuple[Any, ...], ...]:
        before, after = (
            self.step_before_reversal.step_derivatives_at(self.reversal_time),
            self.step_after_reversal.step_derivatives_at(
                _time_since(self.reversal_time, time), components
            ),
        )
        columns = list(zip(*before, strict=True))
        rows = [[sum(row[k] * column[k] for k in range(3)) for column in columns] for row in after]
        return tuple(
            (*entries[:3], entries[3] + row[3]) for entries, row in zip(rows, after, strict=True)
        )

    def divergence_at(self, time: Any) -> Any:
        return self.step_before_reversal.divergence_at(
            self.reversal_time
        ) + self.step_after_reversal.divergence_at(_time_since(self.reversal_time, time))

    def midpoint_orbit_at(self, time: Any, components: slice = slice(3)) -> Any:
        return self.step_after_reversal.midpoint_orbit_at(
            _time_since(self.midpoint_reversal_time, time), components
        )


class SlidingFlight(EnclosedFlight):
    """The flight of all orbits from a box, through changes of the sliding velocity's sign. At the
    start this sign is the same for all orbits.
    """

    field: SmoothField  #: the law of the current side

    def __init__(
        self,
        field: SmoothField,
        start: Sequence[Any],
        proposer: StepProposer,
        *,
        derivatives: bool = False,
    ) -> None:
        super().__init__(field, start, proposer, derivatives=derivatives)
        velocity, _ = field.sliding_velocity_and_rate(self.box)
        #: The sliding velocity's sign; 0 if it is not known
        self.side = 1 * positive(velocity) - 1 * negative(velocity)
        self.field = field.for_side(self.side)

    def step(self, max_length: float | None = None) -> Step:
        for _ in range(_MAX_SHORTENINGS):
            step = super().step(max_length)
            followed = self._step_of_proved_sign(step)
            if followed is not None and (max_length is None or followed.length <= max_length):
                return followed
            max_length = (followed or step).length / 2
            if max_length < _MIN_STEP or not self.side:
                break
        raise FlightStopped(FlowStatus.GRAZING, self.time)

    def take_step(self, step: Step, time: Any = None) -> None:
        super().take_step(step, time)
        if isinstance(step, SlidingReversalStep):
            self.reversals += 1
            self.side, self.field = -self.side, self.field.for_side(-1)

    def _step_of_proved_sign(self, step: Step) -> Step | None:
        """Return the step if gamma_y keeps its sign in it. If all orbits change this sign, return
        the step through the crossing in its place.

        Returns None if neither is shown.
        """
        if not self.side:
            return None
        if positive(
            _times_sign(self.field.sliding_velocity_and_rate(step.enclosure)[0], self.side)
        ):
            return step
        kept, crossing = self._sign_on_pieces(step)
        if kept:
            return step
        return None if crossing is None else self._reversal_step(step, *crossing)

    def _sign_on_pieces(self, step: Step) -> tuple[bool, tuple[Any, Any] | None]:
        """Divide the step into pieces and test if the sliding velocity gamma_y keeps its sign s.

        Returns (True, None) if it is shown to. If all orbits may cross gamma_y = 0, returns False
        and two balls: the times of the crossing's pieces, and the rate of s gamma_y on them. On
        these pieces s gamma_y falls to an end that is not known to be positive. If neither case is
        shown, returns (False, None).
        """
        start, throughout = (
            self.field.sliding_velocity_series(self.box, _VELOCITY_ORDER),
            self.field.sliding_velocity_series(step.enclosure, _VELOCITY_ORDER + 1),
        )
        velocity = [_times_sign(coefficient, self.side) for coefficient in (*start, throughout[-1])]
        rates = [k * coefficient for k, coefficient in enumerate(velocity)][1:]
        length, waits, run, fall = arb(step.length), False, arb(0), arb(0)
        for piece in range(_PIECES_PER_STEP):
            low, high = (length * (n / _PIECES_PER_STEP) for n in (piece, piece + 1))
            time = low.union(high)
            rate, last = evaluate_polynomial(rates, time), evaluate_polynomial(velocity, high)
            falls = negative(rate)
            run, fall = (run.union(time), fall.union(rate)) if waits else (time, rate)
            if (
                positive(evaluate_polynomial(velocity, time))
                or (not waits and positive(rate))
                or (falls and positive(last))
            ):
                waits = False
                continue
            if not falls:
                return False, None
            if negative(last):  # after the crossing the other side's law holds
                return False, (run, fall)
            waits = True
        return not waits, None

    def _reversal_step(self, step: Step, between: Any, rate: Any) -> SlidingReversalStep | None:
        """Return a step that ends shortly after the sliding velocity of all orbits has changed its
        sign.

        Returns None if the change of sign is not proved.

        Args:
            step: A step with the law of the side before the change.
            between: A ball of times that holds the changes of sign.
            rate: A ball of the rate of s gamma_y at these times, where s is the sign before.
        """

        def zero(states: Callable[[Any], Any], *, middle: bool = False) -> Any:
            def towards(time: Any, k: int) -> Any:
                return -_times_sign(
                    self.field.sliding_velocity_and_rate(states(time), middle=middle)[k], self.side
                )

            return enclosed_zero_time(
                step, between, lambda time: towards(time, 0), -rate, lambda time: towards(time, 1)
            )

        # The middle's orbit is one of them; the rates of all hold for it.
        reversal_time, midpoint_reversal_time = (
            zero(step.states_at),
            zero(step.midpoint_orbit_at, middle=True),
        )
        if reversal_time is None or midpoint_reversal_time is None:
            return None
        until = magnitude_estimate(reversal_time + _CROSSING_MARGIN * step.length)
        left = until - reversal_time
        other = self.field.for_side(-1)
        onwards = EnclosedFlight(
            other,
            step.states_at(reversal_time),
            self.proposer.after_reversal(),
            derivatives=self.carries_derivatives,
        )
        onwards.midpoint_start = step.midpoint_orbit_at(midpoint_reversal_time)
        try:
            second = onwards.step(magnitude_estimate(left * _LENGTH_MARGIN))
        except FlightStopped:
            return None
        if not (positive(left) and positive(second.length - left)):
            return None
        if not negative(
            _times_sign(other.sliding_velocity_and_rate(second.enclosure)[1], self.side)
        ):
            return None
        enclosure = tuple(a.union(b) for a, b in zip(step.enclosure, second.enclosure, strict=True))
        own = (
            step.start_time,
            until,
            enclosure,
            step.state_set,
            step.orders,
            step.polynomials,
            step.derivative_polynomials,
        )
        return SlidingReversalStep(
            *own,
            step_before_reversal=step,
            reversal_time=reversal_time,
            step_after_reversal=second,
            midpoint_reversal_time=midpoint_reversal_time,
        )


def _time_since(moment: Any, time: Any) -> Any:
    """Return the time that has passed since ``moment``, or NaN unless ``time`` is shown to be
    later.
    """
    after = time - moment
    return after if positive(after) else arb.nan()


def _times_sign(x: Any, side: int) -> Any:
    return -x if side < 0 else x
