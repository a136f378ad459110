"""The Bautin point in closed form, in any one parameter.

At the Hopf point of inverted spinning the first Lyapunov coefficient vanishes, l_1 = 0, where 2 A (r + e) (r - 2 e) =
Bbar r (2 r - e), Bbar = B - m e^2: linear in A, B and m, quadratic in r, cubic in e; g, mu and epsilon do not enter. On
one side of it the cycles are born stable, on the other unstable, and on one side of it the family has a fold. From
Omega = Omega_crit + c_1 a^2 + c_2 a^4 (`amplitude_law`), with p - p_B the parameter's distance from there and a prime
for d/dp,

    a_fold^2 ~ -(c_1' / (2 c_2)) (p - p_B)        Omega_fold - Omega_crit ~ -(c_1'^2 / (4 c_2)) (p - p_B)^2,

where the first is positive. Source for the bifurcation: Kuznetsov, Elements of Applied Bifurcation Theory, Section 8.3.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.model.exact import shown
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import SYMBOLS, Parameters
from tippedisk_verify.model.precision import checked_digits
from tippedisk_verify.model.results import Printable
from tippedisk_verify.theory.hopf import amplitude_law, normal_form
from tippedisk_verify.theory.real_roots import derivative, real_roots, value_at
from tippedisk_verify.theory.series import PowerSeries

__all__ = ["BAUTIN_PARAMETERS", "BautinPoint", "bautin_points"]

BAUTIN_PARAMETERS = ("A", "B", "m", "r", "e")
_GUARD = 20  # digits of the root beyond those asked for: what is computed from it has some fewer


@dataclass(frozen=True, repr=False)
class BautinPoint(Printable):
    """A disk with l_1 = 0, and what its neighbours do. Derivatives are along the one parameter that varies."""

    parameter: str  #: A, B, m, r or e
    value: Measured  #: of that parameter, exact for A, B and m [SI]
    parameters: Parameters  #: the disk, without C; where the value is irrational, a fraction too close to matter
    omega_crit: Measured  #: of that disk [rad/s]
    period: Measured  #: limit of the cycle's period at Omega_crit [s]
    second_lyapunov_coefficient: Measured  #: Kuznetsov's l_2, eigenvector of length 1 in (beta, gamma, v) [SI]
    quartic_coefficient: Measured  #: c_2 of the law of `HopfPoint` [1/(rad^3 s)]
    quadratic_coefficient_slope: Measured  #: dc_1/dP at the point, P being the parameter [SI]
    fold_amplitude_slope: Measured  #: limit of a^2 / (P - value) on the fold of cycles; its sign tells the side [SI]
    fold_speed_curvature: Measured  #: limit of (Omega - Omega_crit) / (P - value)^2 on the fold [SI]


def bautin_points(parameters: Parameters, name: str, digits: int = 12) -> tuple[BautinPoint, ...]:
    """All admissible values of the parameter ``name`` at which l_1 = 0, the others held; ascending.

    The numbers have ``digits`` significant digits. Empty where no value is admissible (`Parameters`; C is left out, as
    it enters no equation); all of them have e < r / 2. Raises InputError for a parameter that does not enter, for
    digits as `checked_digits` does, and under the smooth law; AccuracyError where cancellation leaves fewer digits.
    """
    parameters.refuse_smooth("the Bautin point is")
    digits = checked_digits(digits)
    if name not in BAUTIN_PARAMETERS:
        fault = "does not enter l_1 = 0" if name in SYMBOLS else "is not known"
        raise InputError(
            f"parameter '{shown(name)}' {fault}: the Bautin point is found in {', '.join(BAUTIN_PARAMETERS)}"
        )
    condition = _condition(parameters, name)
    points = []
    for root in real_roots(condition, digits + _GUARD):
        ends = root.value - root.uncertainty, root.value + root.uncertainty
        disks = [_admitted(parameters, name, end) for end in ends]
        if None not in disks:
            slopes = [value_at(derivative(condition), end) for end in ends]
            points.append(_point(name, root, list(zip(disks, slopes, strict=True)), digits))
    return tuple(points)


def _condition(parameters: Parameters, name: str) -> list[Fraction]:
    """2 A (r + e) (r - 2 e) - Bbar r (2 r - e) as a polynomial in ``name``, of degree 3 at most."""
    constants: dict[str, Any] = {symbol: getattr(parameters, symbol) for symbol in BAUTIN_PARAMETERS}
    constants[name] = PowerSeries([Fraction(power == 1) for power in range(4)])
    A, B, m, r, e = constants.values()
    polynomial: PowerSeries = 2 * A * (r + e) * (r - 2 * e) - (B - m * e * e) * r * (2 * r - e)
    return polynomial.c


def _admitted(parameters: Parameters, name: str, value: Fraction) -> Parameters | None:
    try:
        return parameters.changed(**{"C": None, name: value})
    except InputError:
        return None


def _point(name: str, value: Measured, ends: list[tuple[Any, Fraction]], digits: int) -> BautinPoint:
    # One end is at most as far from the root as from the other end.
    low, high = (_numbers(disk, slope, digits + _GUARD + 2) for disk, slope in ends)  # two digits for the roundings
    numbers = {"value": value}
    for quantity, number in low.items():
        numbers[quantity] = Measured(number.value, number.uncertainty + abs(high[quantity].value - number.value))
    for quantity, number in numbers.items():
        if number.uncertainty * 10**digits > abs(number.value):
            raise AccuracyError(
                f"{quantity} of a Bautin point in {name} loses more than {_GUARD} digits to cancellation"
            )
    return BautinPoint(parameter=name, parameters=ends[0][0], **numbers)


def _numbers(disk: Parameters, slope: Fraction, digits: int) -> dict[str, Measured]:
    """The numbers of `BautinPoint` but for the value; ``slope`` is the condition's derivative."""
    quartic = amplitude_law(disk).quartic
    if not quartic:
        raise AccuracyError("the second Lyapunov coefficient vanishes too: this Bautin point is degenerate itself")
    steep = -slope / (16 * (disk.r + disk.e) * disk.r * disk.Bbar)  # c_1' / Omega_crit, as c_1 = 0
    numbers = normal_form(disk, digits, degenerate=True)
    speed = numbers["omega_crit"]
    return {
        **{name: numbers[name] for name in ("omega_crit", "period", "second_lyapunov_coefficient")},
        "quartic_coefficient": speed * quartic,
        "quadratic_coefficient_slope": speed * steep,
        "fold_amplitude_slope": Measured(-steep / (2 * quartic), Fraction(0)),
        "fold_speed_curvature": speed * (-(steep**2) / (4 * quartic)),
    }
