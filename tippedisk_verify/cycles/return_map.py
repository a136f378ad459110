"""The return map of a section, with derivatives, and the steps and the stopping rule of Newton's iteration on it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Generic, NamedTuple, TypeVar

from tippedisk_verify.cycles.limit_cycle import Cycle
from tippedisk_verify.cycles.section import VARIATIONS, Section
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.flow.contract import Engine, Event, Request, Result, Status
from tippedisk_verify.model.equations import field, shifted
from tippedisk_verify.model.exact import fraction
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE, Precision
from tippedisk_verify.theory.saddle_manifolds import Saddle

__all__ = ["FixedPoint", "Image", "NewtonIteration", "ReturnMap", "newton_step"]

C = TypeVar("C", bound=Cycle)

_LONGEST_FLIGHT = 200.0  # s; half a period at Omega_h + 1e-280
_BRANCH_ORDER = 7  # of the power series of a saddle's branch, 2^(-bits / 6) out
_OFF = 1.0  # rad; the section's copies are at least a quarter of a turn apart


class Image(NamedTuple):
    """One point's image under the return map P, with P's derivatives by the section's two coordinates and by Omega."""

    time: Any  #: flight time [s]
    residual: tuple[Any, Any]  #: the coordinates after the map minus before
    matrix: tuple[tuple[Any, Any], tuple[Any, Any]]  #: P'
    by_omega: tuple[Any, Any]  #: of P
    time_by_state: tuple[Any, Any]  #: derivatives of the flight time by the coordinates
    time_by_omega: Any
    flow: Any  #: the flow's derivatives at fixed time, (beta, gamma, v) by (beta, gamma, v, Omega)

    @property
    def fixed_point_by_omega(self) -> tuple[Any, Any]:
        """Derivatives of the coordinates by Omega along the family, if this is a fixed point."""
        return newton_step(self.matrix, self.by_omega)

    @property
    def time_along_family(self) -> Any:
        """The derivative of the flight time by Omega along the family, if this is a fixed point."""
        first, second = self.fixed_point_by_omega
        return self.time_by_state[0] * first + self.time_by_state[1] * second + self.time_by_omega


class ReturnMap(Generic[C]):
    """The return map of one disk at one speed, in one arithmetic.

    Flights and images raise NoSuchCycleError for a start with coordinates that the section does not have, and where the
    orbit does not come back to the section.
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
        self._omega = precision.number(omega)  # once, not at every start
        self._rates = field(shifted(precision.ops), parameters.at(precision), self._omega, parameters.friction)
        self._growth = precision.number(0) + 2 * section.turns * precision.pi
        # Past the section by far less than rounding: of a function that is zero to the last bit at the start, heyoka
        # sees no other crossing in its first step. (With the fourth power MPFR's numbers would lose memory.)
        self._edge = precision.number(section.passed * precision.epsilon**2)
        self._requests: dict[tuple[Event, ...], Request] = {}

    def within(self, precision: Precision) -> ReturnMap[C]:
        """The same map in another arithmetic."""
        return ReturnMap(self.section, self.parameters, self.omega, self.engine, precision)

    def flight(self, point: Sequence[Any], rounding: int | None = None) -> Result:
        """From a point to the section's next crossing, its `recorded` events and the integral of the divergence."""
        return self._run(point, rounding, self.section.recorded, divergence=True)

    def __call__(self, point: Sequence[Any], rounding: int | None = None) -> Image:
        """The image of a point, by the variational equations."""
        result = self._run(point, rounding, (), variations=VARIATIONS)
        rows, end = result.derivatives, result.state
        if self.precision == DOUBLE:  # Python's own floats: arithmetic on numpy's scalars takes longer
            rows, end = rows.tolist(), end.tolist()
        fixed, free, image = self.section.fixed, self.section.free, self.section.image
        arrival = [*end]
        arrival[fixed] = self._growth
        rates = self._rates(*arrival)
        # Time moves with start and speed, dt = -d(fixed component) / its rate, and takes the coordinates along.
        times = [-entry / rates[fixed] for entry in rows[fixed]]
        first, second = (
            [image * (entry + rates[axis] * moved) for entry, moved in zip(rows[axis], times, strict=True)]
            for axis in free
        )
        a, b = free
        return Image(
            time=result.time,
            residual=self.residual(end, point),
            matrix=((first[a], first[b]), (second[a], second[b])),
            by_omega=(first[3], second[3]),
            time_by_state=(times[a], times[b]),
            time_by_omega=times[3],
            flow=rows,
        )

    def residual(self, end: Sequence[Any], point: Sequence[Any]) -> tuple[Any, Any]:
        """The image's coordinates, from where the flow arrives, less those of the point."""
        (a, b), image = self.section.free, self.section.image
        return image * end[a] - point[0], image * end[b] - point[1]

    def measures(self, flight: Result) -> dict[str, Any]:
        """What a flight with the section's ``recorded`` events tells of the cycle besides its coordinates."""
        return self.section.measured(((one.name, one.state) for one in flight.events), abs(0 * flight.time))

    def trivial_multiplier(self, point: Sequence[Any], image: Image) -> Any:
        """The multiplier along the flow, 1 but for rounding.

        It is the Rayleigh quotient of the flow followed by the derivative of the symmetry, on the flow's direction at
        the start.
        """
        rates = self._rates(*self._state(point))
        moved = (sum(entry * rate for entry, rate in zip(row, rates, strict=False)) for row in image.flow)
        along = sum(a * b for a, b in zip(moved, rates, strict=True))
        return self.section.image * along / sum(rate * rate for rate in rates)

    def end_of_branch(self) -> tuple[Any, Any]:
        """Where a saddle's unstable branch meets the section, as the coordinates of a point.

        The branch starts on its power series, so far out that its truncation is below rounding. Raises NoSuchCycleError
        if it does not arrive.
        """
        saddle = Saddle(self.parameters, fraction(self.omega), self.precision.bits + 16, _BRANCH_ORDER)
        # A flight from the librating section starts next to the saddle at gamma_bar = pi: the other's image.
        state = saddle.start_on_branch(Fraction(1, 1 << (self.precision.bits // 6)), self.section.image)
        # As the cycle's own flights are built.
        result = self.engine(self._request(state, divergence=True, events=(self.section.ends, *self.section.recorded)))
        if result.status is not Status.EVENT:
            raise NoSuchCycleError(f"the saddle's unstable branch does not come to the section: {result.status.value}")
        return self.residual(result.state, (0, 0))

    def _state(self, point: Any) -> list[Any]:
        """(beta_bar, gamma_bar, v) of a point on the section."""
        state = [*point]
        state.insert(self.section.fixed, self._edge)
        return state

    def _request(self, state: Sequence[Any], **needs: Any) -> Request:
        return Request(
            self.parameters,
            self._omega,
            state,
            _LONGEST_FLIGHT,
            shifted=True,
            precision=self.precision,
            domain="none",
            **needs,
        )

    def _run(self, point: Sequence[Any], rounding: int | None, events: tuple[Event, ...], **needs: Any) -> Result:
        section, state = self.section, self._state(point)
        if events not in self._requests:
            self._requests[events] = self._request(state, events=(section.ends, *events), **needs)
        if not section.possible(float(point[0]), float(point[1])):
            raise NoSuchCycleError(section.impossible)
        result = self.engine(self._requests[events].starting_at(state, rounding))
        if result.status is not Status.EVENT:
            raise NoSuchCycleError(f"{section.no_return}: {result.status.value}")
        if abs(float(result.state[section.fixed] - self._growth)) > _OFF:
            raise NoSuchCycleError(section.no_return)
        return result


@dataclass(frozen=True)
class FixedPoint(Generic[C]):
    """Where an iteration for a fixed point of a return map ended, and how it went."""

    return_map: ReturnMap[C]
    point: tuple[Any, Any]  #: the coordinates on the section
    image: Image  #: of the point, or of one that it has not left by more than the last step
    residuals: tuple[float, ...]  #: their sizes, step by step


def newton_step(matrix: Any, residual: Any) -> tuple[Any, Any]:
    """Solve (1 - P') step = residual for the two unknowns, in the arithmetic of the residual."""
    a, b, c, d = 1 - matrix[0][0], -matrix[0][1], -matrix[1][0], 1 - matrix[1][1]
    determinant = a * d - b * c
    return (d * residual[0] - b * residual[1]) / determinant, (a * residual[1] - c * residual[0]) / determinant


class NewtonIteration:
    """When a Newton or chord iteration has converged, by the sizes of its residuals or steps, and when it gives up.

    It has converged when a size is below ``small``, or when a size below ``near`` is no longer half of the one before,
    because then only rounding is left; that is looked at from the size number ``fewest`` on. ``failure`` is raised
    after ``most`` sizes.
    """

    def __init__(self, most: int, failure: Exception, *, small: Any, near: Any = math.inf, fewest: int = 3) -> None:
        self.sizes: list[Any] = []
        self._most, self._failure = most, failure
        self._small, self._near, self._fewest = small, near, fewest

    def converged(self, size: Any) -> bool:
        """Whether this size is the last one."""
        self.sizes.append(size)
        if size < self._small or (len(self.sizes) >= self._fewest and self.sizes[-2] / 2 <= size < self._near):
            return True
        if len(self.sizes) == self._most:
            raise self._failure
        return False
