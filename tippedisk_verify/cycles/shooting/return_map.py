"""The return map of a section with its derivatives, and the Newton steps that follow from them.

The unknowns are the section's two coordinates and Omega. Two equations close the orbit: the map P
returns to the start. A third equation holds the speed, the first coordinate or the flight time
fixed. Let r_1, r_2 be the rows of (P' - 1 | dP/dOmega), c the row of the third equation, and g the
change required of the fixed quantity. The step is

    (a r_2 x c + b c x r_1 + g r_1 x r_2) / (c . r_1 x r_2),      (a, b) = -residual.

r_1 x r_2 is the direction of the family of cycles. It is defined where Omega turns round along the
family as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any, Generic, Literal, NamedTuple, TypeVar

from tippedisk_verify.cycles.limit_cycle import Cycle
from tippedisk_verify.cycles.shooting.section import VARIATIONS, Section
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.flow.contract import Engine, Request, Result, Status
from tippedisk_verify.model.equations import shifted_ops, vector_field
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.exact import fraction
from tippedisk_verify.numbers.precision import DOUBLE, Precision

__all__ = ["FixedQuantity", "LinearizedReturn", "ReturnMap"]

C = TypeVar("C", bound=Cycle)

#: What a Newton step holds: the speed, the first coordinate on the section or the flight time.
FixedQuantity = Literal["speed", "coordinate", "time"]

_MAX_FLIGHT = 200.0  # s; half a period at Omega_h + 1e-280
# The order of the power series of a saddle's unstable manifold. Flights start 2^(-bits / 6) from
# the saddle.
_MANIFOLD_ORDER = 7
_MAX_SECTION_MISS = 1.0  # rad; the section's copies are at least a quarter of a turn apart


class LinearizedReturn(NamedTuple):
    """The image of a point of the section under the return map P, with P's derivatives with respect
    to the coordinates and Omega.
    """

    time: Any  #: flight time [s]
    residual: tuple[Any, Any]  #: the coordinates after the map minus before
    jacobian: tuple[tuple[Any, Any], tuple[Any, Any]]  #: P'
    by_omega: tuple[Any, Any]  #: dP/dOmega
    time_by_state: tuple[Any, Any]  #: d(flight time)/d(coordinates)
    time_by_omega: Any
    flow_derivative: Any  #: d(beta, gamma, v)/d(beta, gamma, v, Omega) of the flow at fixed time

    def newton_step(
        self, fixed_quantity: FixedQuantity = "speed", required_change: Any = 0
    ) -> tuple[Any, Any, Any]:
        """Return the Newton step of both coordinates and Omega after which the point is a fixed
        point, to first order.

        Args:
            fixed_quantity: The quantity that the step holds fixed.
            required_change: The change required of that quantity; 0 keeps it fixed.

        Returns:
            The steps of the first coordinate, the second coordinate and Omega.

        Raises:
            ZeroDivisionError: If the equations are singular.
        """
        (first, second), third = self._rows, self._fixed_quantity_row(fixed_quantity)
        along = _cross(first, second)
        determinant = _product(third, along)
        if determinant == 0:
            raise ZeroDivisionError("the equations of a Newton step are singular")
        a, b = self.residual
        columns = zip(_cross(second, third), _cross(third, first), along, strict=True)
        x, y, omega = ((required_change * r - a * p - b * q) / determinant for p, q, r in columns)
        return x, y, omega

    def slopes(self, fixed_quantity: FixedQuantity) -> tuple[Any, Any, Any, Any]:
        """Return derivatives along the curve on which the residual keeps its value, with respect to
        the quantity that is held.

        At a fixed point this is the family of limit cycles.

        Args:
            fixed_quantity: The quantity with respect to which to differentiate.

        Returns:
            The derivatives of the first coordinate, the second coordinate, Omega and the flight
            time.
        """
        along = _cross(*self._rows)
        rate = _product(self._fixed_quantity_row(fixed_quantity), along)
        first, second, omega = (component / rate for component in along)
        return (
            first,
            second,
            omega,
            _product(self._fixed_quantity_row("time"), (first, second, omega)),
        )

    @property
    def _rows(self) -> tuple[tuple[Any, Any, Any], tuple[Any, Any, Any]]:
        """The rows of the matrix (P' - 1 | dP/dOmega), the linear part of a Newton step's
        equations.
        """
        (a, b), (c, d) = self.jacobian
        return (a - 1, b, self.by_omega[0]), (c, d - 1, self.by_omega[1])

    def _fixed_quantity_row(self, fixed_quantity: FixedQuantity) -> tuple[Any, Any, Any]:
        """Return the derivatives of the quantity that a Newton step holds, with respect to both
        coordinates and Omega.
        """
        if fixed_quantity == "time":
            return (*self.time_by_state, self.time_by_omega)
        return (1, 0, 0) if fixed_quantity == "coordinate" else (0, 0, 1)


class ReturnMap(Generic[C]):
    """The return map of one disk at one speed, from a section to its next crossing, in one
    arithmetic.

    Flights and images raise NoSuchCycleError if the start has coordinates that the section does not
    have, or if the orbit does not come back to the section.

    Args:
        section: The section.
        parameters: The disk and its friction law.
        omega: The speed [rad/s].
        engine: The engine of the flights.
        precision: The arithmetic.
    """

    def __init__(
        self,
        section: Section[C],
        parameters: Parameters,
        omega: Any,
        engine: Engine,
        precision: Precision = DOUBLE,
    ) -> None:
        self.section, self.parameters, self.omega = section, parameters, omega
        self.engine, self.precision = engine, precision
        self._omega = precision.number(omega)  # converted once, not at every start
        self._rates = vector_field(
            shifted_ops(precision.ops),
            parameters.constants_in(precision),
            self._omega,
            parameters.friction,
        )
        self._growth = precision.number(0) + 2 * section.rotations * precision.pi
        # The start lies past the section by far less than rounding. If the section's function were
        # zero to the last bit there, heyoka would see no other crossing in its first step. (With
        # the fourth power MPFR's numbers would lose memory.)
        self._edge = precision.number(section.crossing_sign * precision.epsilon**2)
        self._requests: dict[bool, Request] = {}  # with variations, and without

    def in_precision(self, precision: Precision) -> ReturnMap[C]:
        """Return the same return map in another arithmetic."""
        return ReturnMap(self.section, self.parameters, self.omega, self.engine, precision)

    def at_speed(self, omega: Any) -> ReturnMap[C]:
        """Return the return map of the same disk at another speed [rad/s]."""
        return ReturnMap(self.section, self.parameters, omega, self.engine, self.precision)

    def flight(
        self,
        point: Sequence[Any],
        perturbation_pattern: int | None = None,
        *,
        variations: bool = False,
    ) -> Result:
        """Fly from a point of the section to the section's next crossing.

        Args:
            point: Both coordinates on the section.
            perturbation_pattern: The pattern by which last bits are moved; None for no move.
            variations: If True, solve the variational equations, for `image`.

        Returns:
            The flight. Without variations it has the section's `recorded_events` and the integral
            of the divergence.

        Raises:
            NoSuchCycleError: If the orbit does not come back to the section.
        """
        section, state = self.section, self._state(point)
        if variations not in self._requests:
            recorded = () if variations else section.recorded_events
            needs = {"variations": VARIATIONS} if variations else {"divergence": True}
            self._requests[variations] = self._request(
                state, events=(section.end_event, *recorded), **needs
            )
        if not section.allows_start(float(point[0]), float(point[1])):
            raise NoSuchCycleError(section.bad_start_message)
        result = self.engine(self._requests[variations].starting_at(state, perturbation_pattern))
        if result.status is not Status.EVENT:
            raise NoSuchCycleError(f"{section.no_return_message}: {result.status.value}")
        if abs(float(result.state[section.zero_component] - self._growth)) > _MAX_SECTION_MISS:
            raise NoSuchCycleError(section.no_return_message)
        return result

    def __call__(
        self, point: Sequence[Any], perturbation_pattern: int | None = None
    ) -> LinearizedReturn:
        """Return the image of a point under the return map, with derivatives by the variational
        equations.

        Args:
            point: Both coordinates on the section.
            perturbation_pattern: The pattern by which last bits are moved; None for no move.

        Raises:
            NoSuchCycleError: If the orbit does not come back to the section.
        """
        return self.image(point, self.flight(point, perturbation_pattern, variations=True))

    def image(self, point: Sequence[Any], flight: Result) -> LinearizedReturn:
        """Return the image of a point under the return map, with derivatives.

        Args:
            point: Both coordinates on the section.
            flight: The `flight` from this point, with variations.
        """
        rows, end = flight.derivatives, flight.state
        # Python's own floats: arithmetic on numpy's scalars takes longer
        if self.precision == DOUBLE:
            rows, end = rows.tolist(), end.tolist()
        fixed, sign = self.section.zero_component, self.section.symmetry_sign
        arrival = [*end]
        arrival[fixed] = self._growth
        rates = self._rates(*arrival)
        # Time moves with start and speed, dt = -d(fixed component) / its rate, and takes the
        # coordinates along.
        times = [-entry / rates[fixed] for entry in rows[fixed]]
        first, second = (
            [
                sign * (entry + rates[axis] * moved)
                for entry, moved in zip(rows[axis], times, strict=True)
            ]
            for axis in self.section.free_components
        )
        a, b = self.section.free_components
        return LinearizedReturn(
            time=flight.time,
            residual=self.residual(end, point),
            jacobian=((first[a], first[b]), (second[a], second[b])),
            by_omega=(first[3], second[3]),
            time_by_state=(times[a], times[b]),
            time_by_omega=times[3],
            flow_derivative=rows,
        )

    def residual(self, end: Sequence[Any], point: Sequence[Any]) -> tuple[Any, Any]:
        """Return the coordinates of a point's image under the return map, less those of the point.

        Args:
            end: The state (3,) in which the flow arrives.
            point: Both coordinates of the start.
        """
        (a, b), sign = self.section.free_components, self.section.symmetry_sign
        return sign * end[a] - point[0], sign * end[b] - point[1]

    def event_quantities(self, flight: Result) -> dict[str, Any]:
        """Return further numbers of a limit cycle by name, such as the largest lean, from a flight
        with the section's ``recorded_events``.
        """
        return self.section.quantities_at_events(
            ((event.name, event.state) for event in flight.events), abs(0 * flight.time)
        )

    def trivial_multiplier(self, point: Sequence[Any], image: LinearizedReturn) -> Any:
        """Return the multiplier along the flow, 1 but for rounding.

        It is the Rayleigh quotient of the flow followed by the derivative of the symmetry, on the
        flow's direction at the start.

        Args:
            point: Both coordinates of the start.
            image: The image of the point.
        """
        rates = self._rates(*self._state(point))
        moved = (
            sum(entry * rate for entry, rate in zip(row, rates, strict=False))
            for row in image.flow_derivative
        )
        along = sum(a * b for a, b in zip(moved, rates, strict=True))
        return self.section.symmetry_sign * along / sum(rate * rate for rate in rates)

    def unstable_manifold_crossing(self) -> tuple[Any, Any]:
        """Return the coordinates at which a saddle's unstable manifold meets the section.

        The flight starts on the power series of the manifold, so close to the saddle that
        truncation is below rounding.

        Raises:
            NoSuchCycleError: If the flight does not arrive.
        """
        from tippedisk_verify.theory.saddle_manifolds import Saddle

        saddle = Saddle(
            self.parameters, fraction(self.omega), self.precision.bits + 16, _MANIFOLD_ORDER
        )
        # A flight to the librating section starts next to the saddle at gamma_bar = pi, which is
        # the image of the other saddle under the point symmetry.
        state = saddle.start_on_unstable_manifold(
            Fraction(1, 1 << (self.precision.bits // 6)), self.section.symmetry_sign
        )
        # The request is built like those of the cycle's own flights.
        result = self.engine(
            self._request(
                state,
                divergence=True,
                events=(self.section.end_event, *self.section.recorded_events),
            )
        )
        if result.status is not Status.EVENT:
            raise NoSuchCycleError(
                f"the saddle's unstable manifold does not come to the section: {result.status.value}"
            )
        return self.residual(result.state, (0, 0))

    def _state(self, point: Any) -> list[Any]:
        """Return the state (beta_bar, gamma_bar, v) of a point on the section, given by its two
        coordinates.
        """
        state = [*point]
        state.insert(self.section.zero_component, self._edge)
        return state

    def _request(self, state: Sequence[Any], **needs: Any) -> Request:
        return Request(
            self.parameters,
            self._omega,
            state,
            _MAX_FLIGHT,
            shifted=True,
            precision=self.precision,
            domain="none",
            **needs,
        )


def _cross(p: Sequence[Any], q: Sequence[Any]) -> tuple[Any, Any, Any]:
    return p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]


def _product(p: Sequence[Any], q: Sequence[Any]) -> Any:
    return sum(a * b for a, b in zip(p, q, strict=True))
