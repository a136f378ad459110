"""The Bautin point in closed form in any one parameter, and the speeds at which eigenvalues change kind.

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
from itertools import pairwise
from typing import Any

from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.model.decimals import decimal_magnitude
from tippedisk_verify.model.exact import fraction, quotient, shown
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import SYMBOLS, Parameters
from tippedisk_verify.model.precision import bits, bits_for_digits, checked_digits
from tippedisk_verify.model.results import Printable
from tippedisk_verify.theory.amplitude_law import amplitude_law
from tippedisk_verify.theory.equilibria import EquilibriumName, linearization, location
from tippedisk_verify.theory.hopf import NORMAL_FORM_ULPS, normal_form

__all__ = ["BAUTIN_PARAMETERS", "BautinPoint", "bautin_points", "kind_changes"]

BAUTIN_PARAMETERS = ("A", "B", "m", "r", "e")
_GUARD = 20  # digits of the root beyond those asked for: what is computed from it has some fewer
_FASTEST = Fraction(10) ** 6  # rad/s, as for all speeds
_LARGEST = Fraction(10) ** 30  # what `Parameters` takes


@dataclass(frozen=True, repr=False)
class BautinPoint(Printable):
    """A disk with l_1 = 0, and what its neighbours do. Derivatives are along the one parameter that varies."""

    parameter: str  #: A, B, m, r or e
    value: Measured  #: of that parameter [its SI unit]; exact where it is rational
    parameters: Parameters  #: the disk, without C; where the value is irrational, a fraction too near to matter
    omega_crit: Measured  #: [rad/s]
    period: Measured  #: [s] of the cycle at its birth
    second_lyapunov_coefficient: Measured  #: Kuznetsov's l_2, <q, q> = 1 in (beta, gamma, v), SI units
    quartic_coefficient: Measured  #: c_2 [1/(rad^3 s)]
    quadratic_coefficient_slope: Measured  #: c_1' [1/(rad s) per unit of the parameter]
    fold_amplitude_slope: Measured  #: limit of a_fold^2 / (p - p_B) [rad^2 per unit]; its sign is the fold's side
    fold_speed_curvature: Measured  #: limit of (Omega_fold - Omega_crit) / (p - p_B)^2 [rad/s per unit squared]


def bautin_points(parameters: Parameters, name: str, digits: int = 12) -> tuple[BautinPoint, ...]:
    """All admissible values of the parameter ``name`` at which l_1 = 0, the others held; ascending.

    The numbers have ``digits`` significant digits. Empty where no value is admissible (`Parameters`; C is left out, as
    it enters no equation); all of them have e < r / 2. Raises InputError for a parameter that does not enter, for
    digits as `checked_digits` does, and under the smooth law; Shortfall where cancellation leaves fewer digits.
    """
    parameters.refuse_smooth("the Bautin point is")
    checked_digits(digits)
    if name not in BAUTIN_PARAMETERS:
        fault = "does not enter l_1 = 0" if name in SYMBOLS else "is not known"
        raise InputError(
            f"parameter '{shown(name)}' {fault}: the Bautin point is found in {', '.join(BAUTIN_PARAMETERS)}"
        )
    condition = _condition(parameters, name)
    points = []
    for low, high in _roots(condition, _LARGEST, digits + _GUARD):
        disks = [_admitted(parameters, name, value) for value in (low, high)]
        if None not in disks:
            slopes = [_at(_derivative(condition), value) for value in (low, high)]
            points.append(_point(name, Measured(low, high - low), list(zip(disks, slopes, strict=True)), digits))
    return tuple(points)


def _condition(parameters: Parameters, name: str) -> list[Fraction]:
    """2 A (r + e) (r - 2 e) - Bbar r (2 r - e) as a polynomial in ``name``; coefficients ascend."""
    p = parameters
    r, e, m, A, B = p.r, p.e, p.m, p.A, p.B
    with_A, with_Bbar = 2 * (r + e) * (r - 2 * e), r * (2 * r - e)
    return {
        "A": [-p.Bbar * with_Bbar, with_A],
        "B": [A * with_A + m * e**2 * with_Bbar, -with_Bbar],
        "m": [A * with_A - B * with_Bbar, e**2 * with_Bbar],
        "r": [-4 * A * e**2, (p.Bbar - 2 * A) * e, 2 * (A - p.Bbar)],
        "e": [2 * r**2 * (A - B), r * (B - 2 * A), 2 * m * r**2 - 4 * A, -m * r],
    }[name]


def _admitted(parameters: Parameters, name: str, value: Fraction) -> Parameters | None:
    try:
        return parameters.changed(**{"C": None, name: value})
    except InputError:
        return None


def _point(name: str, value: Measured, ends: list[tuple[Any, Fraction]], digits: int) -> BautinPoint:
    working = bits_for_digits(digits + _GUARD + 2)  # as many for the ulps
    # One end is at most as far from the root as from the other end.
    at_low, at_high = (_numbers(disk, slope, working) for disk, slope in ends)
    rounding = NORMAL_FORM_ULPS * fraction(bits(working).context.eps)
    measured = {"value": value}
    for quantity, number in at_low.items():
        low, high = fraction(number), fraction(at_high[quantity])
        measured[quantity] = Measured(low, abs(high - low) + abs(low) * rounding)
    for quantity, number in measured.items():
        if number.uncertainty * 10**digits > abs(number.value):
            raise Shortfall(f"{quantity} of a Bautin point in {name} loses more than {_GUARD} digits to cancellation")
    return BautinPoint(parameter=name, parameters=ends[0][0], **measured)


def _numbers(disk: Parameters, slope: Fraction, working: int) -> dict[str, Any]:
    """The numbers of `BautinPoint` but for the value, as mpmath numbers; ``slope`` is the condition's derivative."""
    ctx = bits(working).context
    quartic = amplitude_law(disk).quartic
    if not quartic:
        raise Shortfall("the second Lyapunov coefficient vanishes too: this Bautin point is degenerate itself")
    steep = -slope / (16 * (disk.r + disk.e) * disk.r * disk.Bbar)  # c_1' / Omega_crit, as c_1 = 0
    numbers = normal_form(disk, working, degenerate=True)
    speed = numbers["omega_crit"]
    return {
        **{name: numbers[name] for name in ("omega_crit", "period", "second_lyapunov_coefficient")},
        "quartic_coefficient": speed * quotient(ctx, quartic),
        "quadratic_coefficient_slope": speed * quotient(ctx, steep),
        "fold_amplitude_slope": quotient(ctx, -steep / (2 * quartic)),
        "fold_speed_curvature": speed * quotient(ctx, -(steep**2) / (4 * quartic)),
    }


# ------------------------------------------------------------------------------ where eigenvalues meet
def kind_changes(parameters: Parameters, name: EquilibriumName, digits: int = 12) -> tuple[Measured, ...]:
    """The speeds [rad/s], ascending, at which eigenvalues of an equilibrium turn from real to complex, or back.

    The discriminant of the characteristic polynomial is a cubic in Omega^2. Raises InputError for an unknown name, and
    for digits as `checked_digits` does.
    """
    location(name)
    checked_digits(digits)
    unit = linearization(parameters, Fraction(1), name)
    a2, c, h = -unit.A33, unit.A31 + 1, -unit.A32  # a1 = Omega^2 - c and a0 = h Omega^2
    cubic = [
        c**2 * (a2**2 + 4 * c),
        -2 * c * (9 * a2 * h + a2**2 + 6 * c) - 4 * a2**3 * h,
        18 * a2 * h + a2**2 + 12 * c - 27 * h**2,
        Fraction(-4),
    ]
    ctx = bits(bits_for_digits(digits + _GUARD)).context
    speeds = []
    for low, high in _roots(cubic, _FASTEST**2, digits + _GUARD):
        rough, sharp = (ctx.sqrt(quotient(ctx, end)) for end in (low, high))
        speeds.append(Measured.compared(rough, sharp, 4 * fraction(ctx.eps)))
    return tuple(speeds)


# ------------------------------------------------------------------------------ roots of polynomials of low degree
def _roots(polynomial: list[Fraction], top: Fraction, digits: int) -> list[tuple[Fraction, Fraction]]:
    """(low, high) around each root between 0 and ``top``, ascending; ``polynomial`` ascends, of degree 3 at most.

    high - low is at most 10**-digits of low, and zero where the root is a fraction of small numbers, as double ones are
    for decimals. Two roots that are closer to one another than that can be missed.
    """
    while polynomial and not polynomial[-1]:
        polynomial = polynomial[:-1]
    if len(polynomial) < 3:
        root = -polynomial[0] / polynomial[1] if len(polynomial) == 2 else top + 1
        return [(root, root)] if 0 < root <= top else []
    # Between the roots of the derivative the polynomial is monotonic.
    turns = _roots(_derivative(polynomial), top, digits)
    roots = [turn for turn in turns if not _at(polynomial, turn[0])]
    for low, high in pairwise([Fraction(0), *(end for turn in turns for end in turn), top]):
        if _at(polynomial, low) * _at(polynomial, high) < 0:
            roots.append(_bisected(polynomial, low, high, digits))
    return sorted(roots)


def _bisected(polynomial: list[Fraction], low: Fraction, high: Fraction, digits: int) -> tuple[Fraction, Fraction]:
    rising, slope = _at(polynomial, high) > 0, _derivative(polynomial)
    while (high - low) * 10**digits > low:
        middle = (low + high) / 2
        if (high - low) * 2**20 < low and _at(slope, middle):  # Newton's step squares the share; signs decide
            reach = max((high - low) ** 2 * 2**8 / low, low / 10**digits / 16)
            unit = 10 ** max(0, 3 - decimal_magnitude(reach))
            guess = Fraction(round((middle - _at(polynomial, middle) / _at(slope, middle)) * unit), unit)
            below, above = guess - reach, guess + reach
            if low < below and above < high and _at(polynomial, below) * _at(polynomial, above) < 0:
                low, high = (Fraction(round(end * unit), unit) for end in (below - reach, above + reach))
                continue
        if (_at(polynomial, middle) > 0) == rising:
            high = middle
        else:
            low = middle
    simple = ((low + high) / 2).limit_denominator(10 ** (digits // 2))
    return (simple, simple) if low <= simple <= high and not _at(polynomial, simple) else (low, high)


def _derivative(polynomial: list[Fraction]) -> list[Fraction]:
    return [n * coefficient for n, coefficient in enumerate(polynomial)][1:]


def _at(polynomial: list[Fraction], x: Fraction) -> Fraction:
    total = Fraction(0)
    for coefficient in reversed(polynomial):
        total = total * x + coefficient
    return total
