"""Folds of limit cycles: where two cycles of a family, rotating or librating, meet and end.

Unknown are the two coordinates on the section and Omega; a fixed point of the section's map P is wanted at which
det(1 - P') = 0. That determinant's gradient is taken by differences in double. It serves in chord steps of any
precision, each of which gains some seven digits, so that second derivatives of the flow are never needed to more digits
than doubles give.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

import numpy

from tippedisk_verify.errors import Shortfall
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.exact import fraction
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE, Precision, bits, bits_for_digits, checked_digits, companion
from tippedisk_verify.orbits.amplitude_family import AmplitudeFamily
from tippedisk_verify.orbits.half_map import HalfFlights
from tippedisk_verify.orbits.newton import NewtonIteration
from tippedisk_verify.orbits.rotating_family import RotatingFamily
from tippedisk_verify.orbits.turn_map import TurnFlights

__all__ = [
    "Fold",
    "LibrationFold",
    "RotationFold",
    "fold_in",
    "fold_in_double",
    "fold_near",
    "fold_to_digits",
    "libration_folds",
    "rotation_fold",
]

_DIFFERENCE = 1e-5  # of unknowns of order one: rounding and the third derivatives then err alike, by some 1e-9
_GUARD = 12  # digits that two nearly parallel conditions and the flight cost


@dataclass(frozen=True)
class Fold:
    """What folds have in common; each number's half-width holds the truth."""

    section: ClassVar[type[HalfFlights]]  #: whose map has the fold's cycle as a fixed point

    omega: Measured  #: the speed, extreme on the family [rad/s]
    period: Measured  #: T of the cycle there [s]
    v_0: Measured  #: v next to the saddle [rad/s]
    beta_max: Measured  #: largest |beta - pi/2| [rad]
    null_vector: Measured  #: derivative of the second coordinate by the first along the family [1/s]
    log_multiplier_fast: Measured  #: natural logarithm of the multiplier that is not 1
    parameters: Parameters  #: whose fold it is, with the friction law
    engine: str  #: what computed it
    precision: str  #: the arithmetic of its numbers

    def json(self) -> dict[str, object]:
        return {
            name: value.json()
            for name, value in ((name, getattr(self, name)) for name in self.__dataclass_fields__)
            if isinstance(value, Measured)
        }


@dataclass(frozen=True)
class LibrationFold(Fold):
    """A fold of the cycles about inverted spinning; ``null_vector`` is d(v_0) / d(gamma_bar_0)."""

    section = HalfFlights

    gamma_bar_0: Measured  #: gamma - pi/2 at beta = pi/2 with v < 0 [rad]; v_0 is v there


@dataclass(frozen=True)
class RotationFold(Fold):
    """The fold of the rotating cycles, their lowest speed; ``null_vector`` is d(v_top) / d(beta_bar_top)."""

    section = TurnFlights

    beta_bar_top: Measured  #: beta - pi/2 at gamma = pi/2 [rad]
    v_top: Measured  #: v there [rad/s]
    beta_bar_0: Measured  #: beta - pi/2 at gamma = -pi/2 [rad]; v_0 is v there


def rotation_fold(
    parameters: Parameters, engine: Engine, *, digits: int = 12, family: RotatingFamily | None = None
) -> RotationFold:
    """The fold of the rotating limit cycles, to ``digits`` significant digits of its speed and cycle.

    Raises NoSuchCycleError or NoConnectionError where the disk has no such family, Shortfall if the digits are not
    reached.
    """
    checked_digits(digits)
    near = (family or RotatingFamily(parameters, engine)).near_fold().at
    fold: RotationFold = fold_to_digits(RotationFold, parameters, near, engine, digits)
    return fold


def libration_folds(
    parameters: Parameters, engine: Engine, *, digits: int = 12, family: AmplitudeFamily | None = None
) -> tuple[LibrationFold, ...]:
    """The folds of the librating limit cycles from the Hopf point on, to ``digits`` significant digits; often none.

    They are those of the part of the family that `AmplitudeFamily` follows. Raises NoSuchCycleError where the family
    cannot be followed, Shortfall if the digits are not reached.
    """
    checked_digits(digits)
    family = family or AmplitudeFamily(parameters, engine)
    places = [family.place(s) for s in family.folds]
    return tuple(
        fold_to_digits(LibrationFold, parameters, (*place.start, place.omega), engine, digits) for place in places
    )


def fold_in_double(family: RotatingFamily) -> dict[str, float]:
    """The numbers of the family's fold to some ten digits, by their names in `RotationFold`. Raises as that does.

    Nothing is compiled for them that the cycles' family does not need.
    """
    near, jacobian = fold_near(TurnFlights, family.parameters, family.near_fold().at, family.engine)
    numbers = _numbers(TurnFlights, family.parameters, near, jacobian, family.engine, DOUBLE)
    return {name: float(number) for name, number in numbers.items()}


def fold_to_digits(
    kind: type[Fold], parameters: Parameters, near: tuple[float, float, float], engine: Engine, digits: int
) -> Any:
    """The fold of that kind near a point (both coordinates on the section, Omega), to ``digits`` significant digits.

    Raises Shortfall if it is not found, or the digits are not reached.
    """
    fold = fold_in(kind, parameters, near, engine, bits(bits_for_digits(digits + _GUARD)))
    for name in ("omega", "period", *kind.section.unknowns):
        number = getattr(fold, name)
        if number.uncertainty > abs(number.value) / 10**digits:
            raise Shortfall(f"{name} of the fold has fewer than {digits} digits: ask for {digits + 20}")
    return fold


def fold_in(
    kind: type[Fold], parameters: Parameters, near: tuple[float, float, float], engine: Engine, precision: Precision
) -> Any:
    """The fold of that kind near a point, computed in ``precision`` and compared with the next wider arithmetic.

    Raises Shortfall if it is not found.
    """
    near, jacobian = fold_near(kind.section, parameters, near, engine)
    rough = _numbers(kind.section, parameters, near, jacobian, engine, precision)
    sharp = _numbers(kind.section, parameters, near, jacobian, engine, companion(precision))
    numbers = {name: Measured.compared(value, sharp[name], precision.epsilon) for name, value in rough.items()}
    return kind(**numbers, parameters=parameters, engine=engine.name, precision=precision.name)


def _conditions(mapped: Any) -> tuple[Any, Any, Any]:
    """The map's residual and det(1 - P'), which are zero at the fold."""
    (a, b), (c, d) = mapped.matrix
    return (*mapped.residual, (1 - a) * (1 - d) - b * c)


def _mapped(
    section: type[HalfFlights], parameters: Parameters, at: Sequence[Any], engine: Engine, precision: Precision
) -> Any:
    return section(parameters, at[2], engine, precision).map(at[:2])


def fold_near(
    section: type[HalfFlights], parameters: Parameters, at: tuple[float, float, float], engine: Engine
) -> tuple[tuple[float, float, float], Any]:
    """Both coordinates and Omega of the fold near a point, in double, and the derivative of its conditions there.

    Raises Shortfall if the iteration does not settle.
    """
    lost = Shortfall("the iteration for the fold of the limit cycles does not settle")
    iteration = NewtonIteration(20, lost, small=1e-13, near=1e-9)
    while True:
        mapped = _mapped(section, parameters, at, engine, DOUBLE)
        (a, b), (c, d) = mapped.matrix
        gradient = []
        for axis in range(3):
            # A cycle near the Hopf point is small, one that comes close to a saddle must not miss it.
            away = _DIFFERENCE * min(1.0, abs(at[axis]), section.room(at) ** (2 if axis == 2 else 1))
            beside = [tuple(x + sign * away * (k == axis) for k, x in enumerate(at)) for sign in (1, -1)]
            above, below = (_conditions(_mapped(section, parameters, state, engine, DOUBLE))[2] for state in beside)
            gradient.append((above - below) / (2 * away))
        jacobian = numpy.array([[a - 1, b, mapped.by_omega[0]], [c, d - 1, mapped.by_omega[1]], gradient])
        step = numpy.linalg.solve(jacobian, _conditions(mapped))
        at = (at[0] - step[0], at[1] - step[1], at[2] - step[2])
        if iteration.converged(float(numpy.abs(step).max())):
            return at, jacobian


def _numbers(
    section: type[HalfFlights],
    parameters: Parameters,
    near: Sequence[float],
    jacobian: Any,
    engine: Engine,
    precision: Precision,
) -> dict[str, Any]:
    """All numbers of the fold in one arithmetic, by chord steps from doubles."""
    inverse = [[precision.number(float(entry)) for entry in row] for row in numpy.linalg.inv(jacobian)]
    at = [precision.number(float(part)) for part in near]
    lost = Shortfall(f"the iteration for the fold has not converged in {precision.name} precision")
    iteration = NewtonIteration(precision.bits // 8 + 8, lost, small=1000 * precision.epsilon, fewest=2)
    while True:
        conditions = _conditions(_mapped(section, parameters, at, engine, precision))
        steps = [sum(a * b for a, b in zip(row, conditions, strict=True)) for row in inverse]
        at = [part - step for part, step in zip(at, steps, strict=True)]
        if iteration.converged(sum((fraction(abs(step)) for step in steps), Fraction(0))):
            break
    flights = section(parameters, at[2], engine, precision)
    mapped = flights.map(at[:2])
    flight = flights(at[:2], divergence=True, events=flights.recorded)
    (a, b), _ = mapped.matrix
    return {
        "omega": at[2],
        "period": section.per_period * mapped.time,
        **dict(zip(section.unknowns, at, strict=False)),
        **flights.measures(flight),
        "null_vector": (1 - a) / b,
        "log_multiplier_fast": section.per_period * flight.divergence,
    }
