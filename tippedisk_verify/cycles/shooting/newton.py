"""Newton's iteration for a cycle as a fixed point of a section's return map.

Each caller brings its limits, the largest number of steps and the size at the end (`StoppingRule`).

`return_map` computes the steps, and this module has the loop. The loop may be damped. Its
derivatives are those at each point, or those of one point for all steps (chord steps).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from tippedisk_verify.cycles.limit_cycle import Cycle
from tippedisk_verify.cycles.shooting.return_map import FixedQuantity, LinearizedReturn, ReturnMap
from tippedisk_verify.errors import NoSuchCycleError

__all__ = ["FixedPoint", "StoppingRule", "newton", "section_size"]

C = TypeVar("C", bound=Cycle)

# The least factor of a Newton step. A damped iteration that would need less finds no smaller
# residual.
_MIN_DAMPING = 1e-3
# The size of a residual, relative to the start's, below which rounding may keep it from shrinking.
_ROUNDING_RESIDUAL = 1e-10
# The size of a point, relative to the start's, below which it is on its way to the equilibrium.
_EQUILIBRIUM_SIZE = 0.2


class StoppingRule:
    """The stopping rule of a Newton or chord iteration.

    The caller measures the size of a residual or of a step. The iteration has converged when a size
    is below ``tolerance``. It has also converged when a size below ``stall_tolerance`` is no longer
    half of the one before, because then only rounding is left.

    Args:
        max_sizes: The number of sizes after which ``failure`` is raised.
        failure: The error of an iteration that does not converge.
        tolerance: The size that ends the iteration at once.
        stall_tolerance: The size below which an iteration that no longer shrinks has converged.
        min_sizes: The number of sizes from which the second rule counts.
    """

    def __init__(
        self,
        max_sizes: int,
        failure: Exception,
        *,
        tolerance: Any,
        stall_tolerance: Any = math.inf,
        min_sizes: int = 3,
    ) -> None:
        self.sizes: list[Any] = []
        self._max_sizes, self._failure = max_sizes, failure
        self._tolerance, self._stall_tolerance, self._min_sizes = (
            tolerance,
            stall_tolerance,
            min_sizes,
        )

    def converged(self, size: Any) -> bool:
        """Record a size, and return True if the iteration has converged.

        Args:
            size: The size of the present residual or step.

        Raises:
            Exception: If the largest number of sizes is reached: the rule's ``failure``.
        """
        self.sizes.append(size)
        if size < self._tolerance or (
            len(self.sizes) >= self._min_sizes
            and self.sizes[-2] / 2 <= size < self._stall_tolerance
        ):
            return True
        if len(self.sizes) == self._max_sizes:
            raise self._failure
        return False


@dataclass(frozen=True)
class FixedPoint(Generic[C]):
    """The fixed point of a return map that an iteration has found, with its image and the
    residuals.
    """

    return_map: ReturnMap[C]
    point: tuple[Any, Any]  #: the coordinates on the section
    #: the linearized return of the point, or of one that is closer to it than the last step
    image: LinearizedReturn
    residuals: tuple[float, ...] = ()  #: the sizes seen by the stopping rule, step by step


@dataclass(frozen=True)
class Iterate(FixedPoint[C]):
    """A point of a Newton iteration, with its image and the step that leads to the next point."""

    step: tuple[Any, Any, Any] = (0, 0, 0)  #: the step of both coordinates and Omega

    @property
    def next_point(self) -> tuple[Any, Any, Any]:
        """Both coordinates and Omega after this Newton step."""
        omega = self.return_map.precision.number(self.return_map.omega)
        return self.point[0] + self.step[0], self.point[1] + self.step[1], omega + self.step[2]


def newton(
    return_map: ReturnMap[C],
    point: Sequence[Any],
    stop: StoppingRule,
    size: Callable[[Iterate[C]], Any],
    *,
    fixed_quantity: FixedQuantity = "speed",
    time: Any = None,
    chord: LinearizedReturn | None = None,
    damped: bool = False,
) -> Iterate[C]:
    """Iterate for a fixed point of a return map by Newton or chord steps, until a stopping rule is
    met.

    Args:
        return_map: The map. If the speed is not held, the map's speed is the first guess.
        point: Both coordinates of the start on the section, in the map's arithmetic.
        stop: The stopping rule.
        size: Returns the size that the stopping rule looks at.
        fixed_quantity: The quantity held at its value at the start; the flight time is held at
            ``time``.
        time: The flight time wanted [s], if that is held.
        chord: An image whose derivatives serve at all points, so that flights need no variational
            equations.
        damped: If True, shorten steps until the residual shrinks, at a held speed.

    Returns:
        The last point, whose step has not been taken.

    Raises:
        NoSuchCycleError: If an orbit does not return, the equations are singular, or damping finds
            no smaller residual.
        Exception: If the iteration takes too many steps: the failure of ``stop``.
    """

    def iterate_at(own_map: ReturnMap[C], point: tuple[Any, Any]) -> Iterate[C]:
        flight = own_map.flight(point, variations=chord is None)
        if chord is None:
            image = own_map.image(point, flight)
        else:
            image = chord._replace(residual=own_map.residual(flight.state, point))
        try:
            step = image.newton_step(fixed_quantity, 0 if time is None else time - image.time)
        except ZeroDivisionError:
            raise NoSuchCycleError(
                f"the iteration at fixed {fixed_quantity} met a singular matrix"
            ) from None
        return Iterate(own_map, point, image, step=step)

    iterate, scale = iterate_at(return_map, (point[0], point[1])), section_size(point)
    while not stop.converged(size(iterate)):
        if damped:
            iterate = _damped_point(iterate, iterate_at, scale)
        else:
            x, y, omega = iterate.next_point
            iterate = iterate_at(
                return_map if fixed_quantity == "speed" else return_map.at_speed(omega), (x, y)
            )
    return Iterate(
        iterate.return_map,
        iterate.point,
        iterate.image,
        tuple(map(float, stop.sizes)),
        iterate.step,
    )


def _damped_point(
    iterate: Iterate[C],
    iterate_at: Callable[[ReturnMap[C], tuple[Any, Any]], Iterate[C]],
    scale: float,
) -> Iterate[C]:
    """Return the first point along a Newton step whose residual is smaller, or is rounding.

    The step is halved again and again. Raises NoSuchCycleError if no such point is found, or the
    iteration falls onto the equilibrium.
    """
    before, damping = section_size(iterate.image.residual), 1.0
    while damping >= _MIN_DAMPING:
        point = (
            iterate.point[0] + damping * iterate.step[0],
            iterate.point[1] + damping * iterate.step[1],
        )
        if not all(map(math.isfinite, point)):
            raise NoSuchCycleError(
                "the shooting iteration left the finite numbers: start closer to the cycle"
            )
        if section_size(point) < _EQUILIBRIUM_SIZE * scale:
            raise NoSuchCycleError(
                "the shooting iteration falls onto the equilibrium: start closer to the cycle"
            )
        with suppress(NoSuchCycleError):
            next_point = iterate_at(iterate.return_map, point)
            if (
                section_size(next_point.image.residual) < before
                or before < _ROUNDING_RESIDUAL * scale
            ):
                return next_point
        damping /= 2
    raise NoSuchCycleError(
        "the shooting iteration does not reduce its residual: start closer to the cycle"
    )


def section_size(vector: Sequence[Any]) -> float:
    """Return the size of a point on the section, or of a residual there [rad].

    A cycle's second coordinate [rad/s] is some ten times the first [rad], so it counts a tenth.
    """
    return abs(float(vector[0])) + abs(float(vector[1])) / 10
