"""Folds of limit cycles: where two cycles of a family, rotating or librating, meet and end.

The two coordinates on the section and Omega are the unknowns. A fold is a fixed point of the
section's map P at which det(1 - P') = 0. The determinant's gradient is taken by differences, mostly
in double. It serves in chord steps of any precision, which gain some seven digits each. So second
derivatives of the flow are never needed to more digits than doubles give.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, ClassVar

import numpy

from tippedisk_verify.cycles.families.librating_family import LibratingFamily
from tippedisk_verify.cycles.families.rotating_family import RotatingFamily
from tippedisk_verify.cycles.shooting.newton import StoppingRule
from tippedisk_verify.cycles.shooting.return_map import LinearizedReturn, ReturnMap
from tippedisk_verify.cycles.shooting.section import LIBRATING, ROTATING, Section
from tippedisk_verify.display import Printable, as_json, quantity
from tippedisk_verify.errors import AccuracyError, NoSuchCycleError
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.exact import fraction
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.precision import (
    DOUBLE,
    Precision,
    bits_for_digits,
    checked_digits,
    precision_of_bits,
    wider_precision,
)
from tippedisk_verify.theory.equilibria import saddle_value_sign
from tippedisk_verify.theory.hopf import (
    amplitude_law,
    critical_frequency_squared,
    criticality,
    omega_crit,
)

__all__ = [
    "Fold",
    "Folds",
    "LibratingFold",
    "RotatingFold",
    "fold_in_double",
    "fold_near",
    "fold_to_digits",
    "librating_folds",
    "rotating_fold",
]

# The step of the differences, for unknowns of order one. Rounding and the third derivatives then
# err alike, by some 1e-9.
_DIFFERENCE_STEP = 1e-5
_MAX_MOVE = 0.01  # the largest relative distance of a fold from its start
_SECOND_PRECISION = precision_of_bits(192)  # the arithmetic of the second attempt
# The amplitude [rad] below which the law of fourth order is a better start than doubles are.
_SMALL_FOLD = 0.1
_GUARD_DIGITS = 12  # digits that two nearly parallel conditions and the flight cost


@dataclass(frozen=True, repr=False)
class Fold(Printable):
    """A fold of limit cycles: the extreme speed of a family, where two cycles merge.

    The half-width of each number contains its error.
    """

    section: ClassVar[Section[Any]]  #: the section whose map has the fold's cycle as a fixed point

    omega: Measured = field(metadata=quantity("the speed, extreme on the family", "rad/s"))
    period: Measured = field(metadata=quantity("T, the period of the cycle there", "s"))
    v_0: Measured = field(metadata=quantity("v next to the saddle", "rad/s"))
    beta_max: Measured = field(metadata=quantity("largest abs(beta - pi/2)", "rad"))
    null_vector: Measured = field(
        metadata=quantity(
            "d(v_0)/d(gamma_bar_0), or d(v_top)/d(beta_bar_top), along the family", "1/s"
        )
    )
    log_multiplier_fast: Measured = field(
        metadata=quantity("natural logarithm of the multiplier that is not 1", "1")
    )
    parameters: Parameters  #: the disk, with the friction law
    engine: str  #: the engine that computed it
    precision: str  #: the arithmetic of its numbers


@dataclass(frozen=True, repr=False)
class LibratingFold(Fold):
    """A fold of the librating limit cycles, which go about inverted spinning.

    ``null_vector`` is d(v_0) / d(gamma_bar_0).
    """

    section = LIBRATING
    _first = ("omega", "period", *LIBRATING.coordinate_names)

    gamma_bar_0: Measured = field(
        metadata=quantity("gamma - pi/2 where beta = pi/2 and v < 0; v_0 is v there", "rad")
    )


@dataclass(frozen=True, repr=False)
class RotatingFold(Fold):
    """The fold of the rotating limit cycles, at their lowest speed.

    ``null_vector`` is d(v_top) / d(beta_bar_top).
    """

    section = ROTATING
    _first = ("omega", "period", *ROTATING.coordinate_names)

    beta_bar_top: Measured = field(metadata=quantity("beta - pi/2 at gamma = pi/2", "rad"))
    v_top: Measured = field(metadata=quantity("v there", "rad/s"))
    beta_bar_0: Measured = field(
        metadata=quantity("beta - pi/2 at gamma = -pi/2; v_0 is v there", "rad")
    )


class Folds(tuple[LibratingFold, ...]):
    """The folds of a family of librating cycles, in their order from the Hopf point on."""

    followed_to: str  #: the end of the family

    def to_dict(self) -> dict[str, Any]:
        return {"folds": as_json(tuple(self)), "followed_to": self.followed_to}


def rotating_fold(family: RotatingFamily, *, digits: int = 12) -> RotatingFold:
    """Return the fold of the rotating limit cycles, to ``digits`` significant digits of its speed
    and cycle.

    Args:
        family: The rotating cycles.
        digits: The significant digits wanted.

    Raises:
        NoSuchCycleError: If the family has no fold.
        AccuracyError: If the digits are not reached.
    """
    digits = checked_digits(digits)
    guess = family.fold_guess()
    fold: RotatingFold = fold_to_digits(
        RotatingFold, family.parameters, (*guess.coordinates, guess.omega), family.engine, digits
    )
    return fold


def librating_folds(
    parameters: Parameters,
    engine: Engine,
    *,
    digits: int = 12,
    family: LibratingFamily | None = None,
) -> Folds:
    """Return the folds of the librating limit cycles from the Hopf point on; often there are none.

    They are the folds that `LibratingFamily` passes.

    Args:
        parameters: The disk and its friction law.
        engine: The engine of the flights.
        digits: The significant digits wanted.
        family: The disk's family, if it has been followed already.

    Raises:
        AccuracyError: If the family cannot be followed, or the digits are not reached. Also if
            doubles do not see a fold that the exact signs at the ends require.
    """
    digits = checked_digits(digits)
    try:
        family = family or LibratingFamily(parameters, engine)
    except NoSuchCycleError as fault:
        raise AccuracyError(str(fault)) from None
    starts = [(*guess.coordinates, guess.omega) for guess in map(family.guess, family.folds)]
    if parameters.law.is_linear:
        small = _small_fold(parameters)
        if small is not None:  # near a small fold doubles only see their rounding
            starts = [small, *(start for start in starts if start[0] > 2 * _SMALL_FOLD)]
        if family.connected and len(starts) % 2 != _parity_of_folds(parameters, family.limit):
            raise AccuracyError(
                "this family has a fold too close to its end for doubles: they give no digits of it"
            )
    folds = [fold_to_digits(LibratingFold, parameters, start, engine, digits) for start in starts]
    for fold, (a, _, omega) in zip(folds, starts, strict=True):
        # A start on polynomials through twenty nodes is right to some digits. A fold far from it is
        # another one.
        if (
            abs(float(fold.gamma_bar_0) - a) > _MAX_MOVE * a
            or abs(float(fold.omega) - omega) > _MAX_MOVE * omega
        ):
            raise AccuracyError(
                f"the fold near {omega:.8g} rad/s was not found again in a finer arithmetic"
            )
    result = Folds(folds)
    result.followed_to = (
        "Omega_h" if family.connected else f"an amplitude of pi at {family.limit:.7g} rad/s"
    )
    return result


def _parity_of_folds(parameters: Parameters, omega_h: float) -> int:
    """Return 1 if the librating family must have an odd number of folds, otherwise 0.

    The number is odd if Omega falls at one end of the family and rises at the other. Exact signs
    decide.
    """
    born_below = criticality(parameters) == "supercritical"
    return int(born_below is not (saddle_value_sign(parameters, Fraction(omega_h)) < 0))


def _small_fold(parameters: Parameters) -> tuple[float, float, float] | None:
    """Return an approximation of a fold of small librating cycles: both coordinates on the section
    and the speed.

    The law of fourth order predicts them. Returns None if there is no small fold.
    """
    quadratic, quartic = map(float, amplitude_law(parameters))
    square = -quadratic / (2 * quartic) if quartic else 0.0
    if not 0 < square < _SMALL_FOLD**2:
        return None
    crit, a = float(omega_crit(parameters)), math.sqrt(square)
    v = -a * float(critical_frequency_squared(parameters)) / crit
    return a, v, crit * (1 + quadratic * square / 2)


def fold_in_double(family: RotatingFamily) -> dict[str, float]:
    """Return the numbers of the rotating family's fold to some ten digits, by their names in
    `RotatingFold`.

    It compiles nothing that the cycles' family does not need.

    Args:
        family: The rotating cycles.

    Raises:
        NoSuchCycleError: If the family has no fold.
        AccuracyError: If the iteration does not settle.
    """
    guess = family.fold_guess()
    start, jacobian = fold_near(
        ROTATING, family.parameters, (*guess.coordinates, guess.omega), family.engine
    )
    numbers = _numbers(ROTATING, family.parameters, start, jacobian, family.engine, DOUBLE)
    return {name: float(number) for name, number in numbers.items()}


def fold_to_digits(
    kind: type[Fold],
    parameters: Parameters,
    guess: tuple[float, float, float],
    engine: Engine,
    digits: int,
) -> Any:
    """Return the fold of limit cycles next to a point, to ``digits`` significant digits.

    Args:
        kind: The class of the fold.
        parameters: The disk and its friction law.
        guess: Both coordinates on the section and Omega [rad/s].
        engine: The engine of the flights.
        digits: The significant digits wanted.

    Raises:
        AccuracyError: If the fold is not found, or the digits are not reached.
    """
    fold = _fold_in(
        kind, parameters, guess, engine, precision_of_bits(bits_for_digits(digits + _GUARD_DIGITS))
    )
    for name in ("omega", "period", *kind.section.coordinate_names):
        number = getattr(fold, name)
        if number.uncertainty > abs(number.value) / 10**digits:
            raise AccuracyError(
                f"{name} of the fold has fewer than {digits} digits: ask for {digits + 20}"
            )
    return fold


def _fold_in(
    kind: type[Fold],
    parameters: Parameters,
    guess: tuple[float, float, float],
    engine: Engine,
    precision: Precision,
) -> Any:
    """Compute the fold of a family next to a point in the arithmetic ``precision``, with
    half-widths by comparison with the next wider one.

    ``kind`` is the class of the fold. Raises AccuracyError if it is not found.
    """
    for arithmetic in (
        DOUBLE,
        _SECOND_PRECISION,
    ):  # the second serves if the conditions nearly coincide
        try:
            start, jacobian = fold_near(kind.section, parameters, guess, engine, arithmetic)
            coarse = _numbers(kind.section, parameters, start, jacobian, engine, precision)
            accurate = _numbers(
                kind.section, parameters, start, jacobian, engine, wider_precision(precision)
            )
        except (AccuracyError, NoSuchCycleError, numpy.linalg.LinAlgError):
            if arithmetic is _SECOND_PRECISION:
                raise
        else:
            break
    numbers = {
        name: Measured.compared(value, accurate[name], precision.epsilon)
        for name, value in coarse.items()
    }
    return kind(**numbers, parameters=parameters, engine=engine.name, precision=precision.name)


def _conditions(image: LinearizedReturn) -> tuple[Any, Any, Any]:
    """Return three numbers that are zero at a fold: the return map's residual and det(1 - P')."""
    (a, b), (c, d) = image.jacobian
    return (*image.residual, (1 - a) * (1 - d) - b * c)


def _fold_system(
    mapped: Callable[[Sequence[Any]], LinearizedReturn], point: Sequence[Any], shifts: Sequence[Any]
) -> tuple[tuple[Any, Any, Any], list[list[Any]]]:
    """Return the conditions of a fold, which are zero there, and the matrix (3, 3) of their
    derivatives.

    ``mapped`` gives the image at both coordinates and Omega. The residual's derivatives come with
    the image. Those of the determinant are central differences, each over the unknown's entry of
    ``shifts``.
    """
    image, by_determinant = mapped(point), []
    (a, b), (c, d) = image.jacobian
    for axis, shift in enumerate(shifts):
        moved = [[x + sign * shift * (k == axis) for k, x in enumerate(point)] for sign in (1, -1)]
        above, below = (_conditions(mapped(unknowns))[2] for unknowns in moved)
        by_determinant.append((above - below) / (2 * shift))
    by_first, by_second = image.by_omega
    return _conditions(image), [[a - 1, b, by_first], [c, d - 1, by_second], by_determinant]


def _mapped(
    section: Section[Any], parameters: Parameters, engine: Engine, precision: Precision
) -> Callable[[Sequence[Any]], LinearizedReturn]:
    return lambda at: ReturnMap(section, parameters, at[2], engine, precision)(at[:2])


def fold_near(
    section: Section[Any],
    parameters: Parameters,
    point: Sequence[Any],
    engine: Engine,
    precision: Precision = DOUBLE,
) -> tuple[tuple[float, float, float], Any]:
    """Solve for the fold of limit cycles next to a point, by Newton's iteration.

    Args:
        section: The section of the kind of cycle.
        parameters: The disk and its friction law.
        point: Both coordinates on the section and Omega [rad/s].
        engine: The engine of the flights.
        precision: The arithmetic of the computation.

    Returns:
        Both coordinates and Omega of the fold, and the derivative (3, 3) of its conditions there,
        as doubles.

    Raises:
        AccuracyError: If the iteration does not settle.
    """
    lost = AccuracyError("the iteration for the fold of the limit cycles does not settle")
    stop = StoppingRule(
        20, lost, tolerance=1e-13 * min(1.0, abs(float(point[0]))), stall_tolerance=1e-9
    )
    point, mapped = (
        [precision.number(float(x)) for x in point],
        _mapped(section, parameters, engine, precision),
    )
    step_ratio = _DIFFERENCE_STEP if precision == DOUBLE else float(precision.epsilon) ** (1 / 3)
    while True:
        # A cycle next to the Hopf point is small. One that comes close to a saddle must not miss
        # it.
        near_saddle = section.saddle_scale([float(x) for x in point])
        scales = (
            min(1.0, abs(float(x)), near_saddle**power)
            for x, power in zip(point, (1, 1, 2), strict=True)
        )
        shifts = [precision.number(step_ratio * scale) for scale in scales]
        conditions, rows = _fold_system(mapped, point, shifts)
        jacobian = numpy.array([[float(x) for x in row] for row in rows])
        step = numpy.linalg.solve(jacobian, [float(x) for x in conditions])
        point = [x - precision.number(float(change)) for x, change in zip(point, step, strict=True)]
        if stop.converged(float(numpy.abs(step).max())):
            return (float(point[0]), float(point[1]), float(point[2])), jacobian


def _numbers(
    section: Section[Any],
    parameters: Parameters,
    start: Sequence[float],
    jacobian: Any,
    engine: Engine,
    precision: Precision,
) -> dict[str, Any]:
    """Compute all numbers of a fold in one arithmetic, by chord steps from its approximation in
    doubles.
    """
    inverse = [
        [precision.number(float(entry)) for entry in row] for row in numpy.linalg.inv(jacobian)
    ]
    at, mapped = (
        [precision.number(float(x)) for x in start],
        _mapped(section, parameters, engine, precision),
    )
    lost = AccuracyError(
        f"the iteration for the fold has not converged in {precision.name} precision"
    )
    stop = StoppingRule(
        precision.bits // 8 + 8, lost, tolerance=1000 * precision.epsilon, min_sizes=2
    )
    while True:
        conditions = _conditions(mapped(at))
        steps = [sum(a * b for a, b in zip(row, conditions, strict=True)) for row in inverse]
        at = [x - step for x, step in zip(at, steps, strict=True)]
        if stop.converged(sum((fraction(abs(step)) for step in steps), Fraction(0))):
            break
    return_map = ReturnMap(section, parameters, at[2], engine, precision)
    image = return_map(at[:2])
    flight = return_map.flight(at[:2])
    (a, b), _ = image.jacobian
    return {
        "omega": at[2],
        "period": section.flights_per_period * image.time,
        **dict(zip(section.coordinate_names, at, strict=False)),
        **return_map.event_quantities(flight),
        "null_vector": (1 - a) / b,
        "log_multiplier_fast": section.flights_per_period * flight.divergence,
    }
