"""Omega_h as a function of one parameter, and the points on it at which its character changes, with half-widths."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

from tippedisk_verify.errors import Shortfall
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.measured import Measured, decimal_magnitude
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.orbits.fold_curves import Plane
from tippedisk_verify.orbits.splitting import splitting_zero, splitting_zero_in_double
from tippedisk_verify.theory.equilibria import equilibrium, saddle_value_sign
from tippedisk_verify.theory.hopf import omega_crit, omega_crit_squared

__all__ = ["CONDITIONS", "Condition", "ConnectionPoint", "omega_h_near", "refined_point", "rough_condition"]

Condition = Literal["neutral-saddle", "hopf-heteroclinic"]
#: What vanishes: lambda_u + lambda_s of the saddles at Omega_h; Omega_h - Omega_crit.
CONDITIONS: tuple[Condition, ...] = ("neutral-saddle", "hopf-heteroclinic")

_SPARE = 3  # digits of Omega_h beyond those of a point on its curve
_MOST_STEPS = 40  # of regula falsi, which gains a digit and more with each


@dataclass(frozen=True)
class ConnectionPoint:
    """Where a condition is met on the curve of Omega_h."""

    kind: Condition
    value: Measured  #: of the parameter [its SI unit]
    omega: Measured  #: Omega_h there [rad/s]


def omega_h_near(disk: Parameters, near: float, engine: Engine, digits: int) -> Measured:
    """Omega_h [rad/s] to ``digits`` significant digits from an approximation good to some five.

    Raises Shortfall if it is not found or the digits are not reached, NoConnectionError where there are no saddles.
    """
    found = splitting_zero_in_double(disk, Fraction(near), engine)
    if found.uncertainty > found.value / 10**digits:
        found = splitting_zero(disk, found.value, engine, digits).omega_h
    return found


def rough_condition(kind: Condition, disk: Parameters, omega_h: float) -> float:
    """What vanishes at a point of that kind, in double [1/s or rad/s]."""
    if kind == "hopf-heteroclinic":
        return omega_h - float(omega_crit(disk))
    unstable, slow, _ = equilibrium(disk, Fraction(omega_h), "noninverted").eigenvalues
    return float(unstable.re + slow.re)


def _signs(kind: Condition, disk: Parameters, omega_h: Measured) -> set[int]:
    """The exact signs of what vanishes at both ends of Omega_h's half-width, between which it changes one at most."""
    ends = (omega_h.value - omega_h.uncertainty, omega_h.value + omega_h.uncertainty)
    if kind == "neutral-saddle":
        return {saddle_value_sign(disk, omega) for omega in ends}
    square = omega_crit_squared(disk)
    return {(omega**2 > square) - (omega**2 < square) for omega in ends}


def refined_point(
    kind: Condition,
    plane: Plane,
    ends: tuple[float, float],
    near: Callable[[float], float],
    engine: Engine,
    digits: int,
) -> ConnectionPoint:
    """The point of that kind between two shares of the range at which its condition differs in sign.

    ``near`` gives Omega_h to some five digits at a share. The half-width of the parameter is a distance at which the
    condition has its two signs on the two sides, however large the errors of what it is computed from. Raises as
    `omega_h_near` does.
    """
    low, high = ends

    def rough(share: float) -> float:
        disk = plane.at(plane.value(share))
        return rough_condition(kind, disk, float(splitting_zero_in_double(disk, Fraction(near(share)), engine)))

    share = _root(rough, low, high)
    value = plane.value(share)
    exact_digits = digits + _SPARE
    value = round(value, exact_digits - decimal_magnitude(value))
    width = value / 10**digits / 4
    while True:
        sides = []
        for side in (value - width, value + width):
            disk = plane.at(side)
            omega = omega_h_near(disk, near(share), engine, exact_digits)
            sides.append((omega, _signs(kind, disk, omega)))
        (left, before), (right, after) = sides
        if (before, after) in (({-1}, {1}), ({1}, {-1})):
            break
        width *= 4
        if width > value / 10**digits:
            raise Shortfall("the two signs of the condition could not be told apart next to it: ask for more digits")
    middle = (left.value + right.value) / 2
    # Omega_h is monotonic over so short a distance, but for the errors of its two ends.
    spread = abs(left.value - right.value) + left.uncertainty + right.uncertainty
    return ConnectionPoint(kind, Measured(value, width), Measured(middle, spread))


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    """By regula falsi, with the value kept at an end halved (Illinois)."""
    f_low, f_high = function(low), function(high)
    kept = 0
    middle = low
    for _ in range(_MOST_STEPS):
        last, middle = middle, high - f_high * (high - low) / (f_high - f_low)
        value = function(middle)
        if not value or abs(middle - last) < 1e-13 or high - low < 1e-13:
            break
        if (value < 0) == (f_low < 0):
            low, f_low = middle, value
            f_high = f_high / 2 if kept == 1 else f_high
            kept = 1
        else:
            high, f_high = middle, value
            f_low = f_low / 2 if kept == -1 else f_low
            kept = -1
    return middle
