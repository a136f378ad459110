"""The derivatives of a cycle's numbers with respect to every parameter of the disk and the speed.

**The derivatives.** A number q of a cycle is a function of the section's point x and of a parameter
p. On the cycle the return map's residual R(x, p) vanishes, so

    dq/dp = q_p - q_x (R_x)^-1 R_p.

R_x is known from the variational equations. The multipliers contain first derivatives of the flow,
so q_x and q_p would need second ones. They are central differences instead, of flights with one
coordinate or parameter moved. No cycle is solved again.

**The half-widths.** The derivatives are computed twice. The first time is in the arithmetic that
the digits need, with four flights for each difference. The second time is in a wider one, with two
flights and a much smaller step. There rounding and the step's error are both far smaller, so the
distance is the error of the first.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from tippedisk_verify.connection.bisection import bisect_omega_h
from tippedisk_verify.connection.splitting import splitting_zero
from tippedisk_verify.cycles.limit_cycle import Cycle
from tippedisk_verify.cycles.shooting.cycle_numbers import number_names
from tippedisk_verify.cycles.shooting.error_budget import iterate_until_rounding, numbers_at
from tippedisk_verify.cycles.shooting.newton import FixedPoint
from tippedisk_verify.cycles.shooting.return_map import ReturnMap
from tippedisk_verify.cycles.shooting.section import LIBRATING, ROTATING, Section
from tippedisk_verify.display import Printable, result_lines
from tippedisk_verify.errors import AccuracyError, NoConnectionError
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.parameters import SYMBOLS, Parameters
from tippedisk_verify.numbers.decimals import decimal_magnitude
from tippedisk_verify.numbers.exact import fraction
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.precision import DOUBLE, DOUBLE_DIGITS, Precision, wider_precision
from tippedisk_verify.theory.hopf import omega_crit_derivatives

__all__ = ["Sensitivity", "sensitivity_of", "sensitivity_of_bifurcations"]

# Weights of the differences q(k h) - q(-k h), k = 1, 2, ..., of a central difference over h.
_FOUR_FLIGHTS = (Fraction(2, 3), Fraction(-1, 12))
_TWO_FLIGHTS = (Fraction(1, 2),)
# A step is shorter than the root of the rounding by a factor of two to this power. Higher
# derivatives matter at about a tenth of the step that the first derivatives suggest.
_STEP_BITS = 4
_MIN_SCALE = 2.0**-30  # below it flights need more than quadruple precision, and minutes
_RESIDUALS = ("first residual", "second residual")


@dataclass(frozen=True, repr=False)
class Sensitivity(Printable):
    """The partial derivatives of numbers with respect to parameters, in SI units, with half-widths.

    ``sensitivity["period"]["mu"]`` is dT/dmu at fixed other parameters and fixed speed. The columns
    are r, e, m, A, B, g, mu and epsilon, and for a cycle also omega.
    """

    derivatives: Mapping[str, Mapping[str, Measured]]  #: by number, then by parameter
    parameters: Parameters  #: the disk, with the friction law

    def __getitem__(self, name: str) -> Mapping[str, Measured]:
        """Return the derivatives of one number with respect to each parameter, by the parameter's
        name.
        """
        return self.derivatives[name]

    def __str__(self) -> str:
        entries = {
            f"d({name})/d({symbol})": slope.to_dict()
            for name, row in self.derivatives.items()
            for symbol, slope in row.items()
        }
        return "\n".join([f"{self._title()}, in SI units", *result_lines(entries, "  ")])


def sensitivity_of(cycle: Cycle) -> Sensitivity:
    """Return the derivatives of a cycle's numbers with respect to the disk's parameters and the
    speed.

    They have about twelve digits, or half of those of the cycle's period if that is more.

    Args:
        cycle: The cycle.

    Raises:
        AccuracyError: If the cycle is too close to a bifurcation, or the iteration for it does not
            settle in a wider arithmetic.
        InputError: If a parameter cannot be moved, such as B = A.
    """
    section: Section[Any] = LIBRATING if cycle.symmetric else ROTATING
    magnitude = decimal_magnitude(cycle.period.uncertainty / cycle.period.value)
    digits = max(DOUBLE_DIGITS, -magnitude / 2)
    scale = _scale(cycle, section)
    if scale < _MIN_SCALE:
        raise AccuracyError(
            "the speed is too close to a bifurcation for derivatives of this cycle: use "
            "Disk.sensitivity, which gives those of Omega_crit and Omega_h"
        )
    # Differences of fourth order keep four fifths of the bits.
    needed = 5 / 4 * digits * math.log2(10) - 2 * math.log2(scale)
    precision = wider_precision(DOUBLE)
    while precision.bits < needed:
        precision = wider_precision(precision)
    wider = wider_precision(precision)
    while wider.bits < 5 / 4 * precision.bits:  # so that its error is the smaller one
        wider = wider_precision(wider)
    coarse = _derivatives(cycle, section, scale, precision, _FOUR_FLIGHTS)
    accurate = _derivatives(cycle, section, scale, wider, _TWO_FLIGHTS)
    return Sensitivity(
        {
            name: {
                symbol: Measured.compared(slope, accurate[name][symbol], precision.epsilon)
                for symbol, slope in row.items()
            }
            for name, row in coarse.items()
        },
        cycle.parameters,
    )


def _scale(cycle: Cycle, section: Section[Any]) -> float:
    """Return the relative change of the speed that changes a cycle's period or a coordinate by as
    much as itself.

    It is small next to Omega_h, a Hopf point and a fold. It is at most 1.
    """
    ratios = (
        cycle.omega.value
        * getattr(cycle, f"d{name}_domega").value
        / (getattr(cycle, name).value or 1)
        for name in ("period", *section.coordinate_names)
    )
    return 1 / max(1.0, *(abs(float(ratio)) for ratio in ratios))


def _derivatives(
    cycle: Cycle,
    section: Section[Any],
    scale: float,
    precision: Precision,
    weights: tuple[Fraction, ...],
) -> dict[str, dict[str, Fraction]]:
    """Return the derivatives of a cycle's numbers with respect to each parameter and the speed, in
    one arithmetic, by number and parameter.
    """
    own = ReturnMap(section, cycle.parameters, cycle.omega.value, default_engine(), precision)
    start = tuple(precision.number(getattr(cycle, name).value) for name in section.coordinate_names)
    point, _ = iterate_until_rounding(own, FixedPoint(own, start, own(start)))
    values = {symbol: getattr(cycle.parameters, symbol) for symbol in SYMBOLS}
    values["omega"] = cycle.omega.value
    steps = {symbol: Fraction(scale) * value for symbol, value in values.items()}
    near_saddle = section.saddle_scale([float(x) for x in point])
    for name, x in zip(section.coordinate_names, map(fraction, point), strict=True):
        values[name], steps[name] = x, Fraction(min(1.0, abs(float(x)), near_saddle))
    step_ratio = Fraction(1, 1 << (precision.bits // (2 * len(weights) + 1) + _STEP_BITS))

    def numbers(moved: str, shift: Fraction) -> dict[str, Fraction]:
        """Return the cycle's numbers and the map's residuals, by name, with one coordinate or
        parameter moved.

        ``moved`` is its name, and ``shift`` the amount.
        """
        at = {**values, moved: values[moved] + shift}
        disk = cycle.parameters.changed(**{symbol: at[symbol] for symbol in SYMBOLS})
        return_map = ReturnMap(section, disk, at["omega"], own.engine, precision)
        image = return_map(
            place := tuple(precision.number(at[name]) for name in section.coordinate_names)
        )
        table = numbers_at(return_map, place, image)
        table |= zip(_RESIDUALS, image.residual, strict=True)
        return {name: fraction(number) for name, number in table.items()}

    def differences(moved: str) -> dict[str, Fraction]:
        step = step_ratio * steps[moved]
        pairs = [
            (weight / step, numbers(moved, times * step), numbers(moved, -times * step))
            for times, weight in enumerate(weights, start=1)
        ]
        return {
            name: sum((w * (ahead[name] - behind[name]) for w, ahead, behind in pairs), Fraction(0))
            for name in pairs[0][1]
        }

    slopes = {moved: differences(moved) for moved in values}
    (a, b), (c, d) = (map(fraction, row) for row in own(point).jacobian)
    by_first, by_second = (slopes.pop(name) for name in section.coordinate_names)
    derivatives: dict[str, dict[str, Fraction]] = {}
    for symbol, row in slopes.items():
        first, second = (row[name] / ((a - 1) * (d - 1) - b * c) for name in _RESIDUALS)
        x, y = b * second - (d - 1) * first, c * first - (a - 1) * second
        for name in number_names(section):
            if not name.startswith("d"):
                slope = row[name] + by_first[name] * x + by_second[name] * y
                derivatives.setdefault(name, {})[symbol] = slope
    return derivatives


def sensitivity_of_bifurcations(
    parameters: Parameters, engine: Engine, digits: int = 12
) -> Sensitivity:
    """Return the derivatives of Omega_crit with respect to the disk's parameters, and of Omega_h if
    there is a connection.

    Those of Omega_crit follow from its closed form, those of Omega_h from the splitting.

    Args:
        parameters: The disk and its friction law.
        engine: The engine of the flights.
        digits: Significant digits of Omega_crit and of most derivatives.

    Raises:
        InputError: If the digits cannot be used, or a parameter cannot be moved, such as B = A.
        AccuracyError: If the digits are not reached.
    """
    rows = {"omega_crit": omega_crit_derivatives(parameters, digits)}
    with suppress(NoConnectionError):
        guess = bisect_omega_h(parameters, engine, confirm=False).omega_h.value
        # Differences keep half of the digits.
        rows["omega_h"] = splitting_zero(
            parameters, guess, engine, 2 * digits
        ).omega_h_derivatives()
    return Sensitivity(rows, parameters)
