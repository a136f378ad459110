"""Omega_h as a function of one parameter, and the points on it at which its character changes, with half-widths.

A few disks of the range are looked at to begin with, and more of them where Omega_h ends or does not follow from its
neighbours. The folds of their families tell which curves of folds there are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from itertools import groupby, pairwise
from typing import Any, Literal

import numpy

from tippedisk_verify.atlas.fold_curves import Plane, interpolated
from tippedisk_verify.connection.bisection import bisect_omega_h
from tippedisk_verify.connection.splitting import splitting_zero, splitting_zero_in_double
from tippedisk_verify.cycles.librating_family import LibratingFamily
from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.decimals import decimal_magnitude
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.theory.equilibria import equilibrium, saddle_value_sign
from tippedisk_verify.theory.hopf import omega_crit, omega_crit_squared

__all__ = [
    "CONDITIONS",
    "Condition",
    "Missing",
    "Sample",
    "SpecialPoint",
    "Work",
    "connected_runs",
    "omega_h_near",
    "predicted_omega_h",
    "refined_point",
    "rough_condition",
    "sampled",
]

Condition = Literal["neutral-saddle", "hopf-heteroclinic"]
#: What vanishes: lambda_u + lambda_s of the saddles at Omega_h; Omega_h - Omega_crit.
CONDITIONS: tuple[Condition, ...] = ("neutral-saddle", "hopf-heteroclinic")

_SPARE = 3  # digits of Omega_h beyond those of a point on its curve
_SETTLED = 1e-13  # of the range; doubles know no condition better
_SAMPLES = 17  # disks to begin with
_NARROW = 1 / 512  # of the range: how closely it is found where Omega_h ends
_PREDICTED = 64e-4  # rad/s; how well each disk's Omega_h must follow from its neighbours'

#: A function of one argument and its arguments, to the list of answers in their order.
Work = Callable[..., list[Any]]


@dataclass(frozen=True)
class SpecialPoint:
    """A point of codimension two: bautin, neutral-saddle or hopf-heteroclinic."""

    kind: str
    value: Measured  #: of the parameter [its SI unit]
    omega: Measured  #: Omega_h, at a Bautin point Omega_crit [rad/s]


@dataclass(frozen=True)
class Missing:
    """A value of the parameter at which a curve or a special point was looked for in vain."""

    kind: str  #: of the curve or the point
    value: Fraction
    reason: str


@dataclass(frozen=True)
class Sample:
    """A disk of the range, in double."""

    share: float  #: of the range
    omega_h: float | None  #: [rad/s]; None where no connection is found
    folds: tuple[tuple[float, Any], ...]  #: of its limit cycles, each (s, point) as in `fold_curves.Trace`
    missing: tuple[Missing, ...]  #: why there is no Omega_h, or no family of limit cycles


# ------------------------------------------------------------------------------------------------ disks of the range
def sampled(plane: Plane, work: Work) -> list[Sample]:
    """Disks of the range: close together where Omega_h ends, and where it could not be told from its neighbours."""
    samples: list[Sample] = work(partial(_sample, plane), numpy.linspace(0, 1, _SAMPLES).tolist())
    while True:
        unclear = _unclear(samples)
        wanted = [
            (before.share + after.share) / 2
            for before, after in pairwise(samples)
            if after.share - before.share > _NARROW
            and ((before.omega_h is None) != (after.omega_h is None) or {before.share, after.share} & unclear)
        ]
        if not wanted:
            return samples
        samples = sorted([*samples, *work(partial(_sample, plane), wanted)], key=lambda one: one.share)


def _sample(plane: Plane, share: float) -> Sample:
    value, engine = plane.decimal(share), default_engine()
    disk, guess, omega_h = plane.at(value), None, None
    folds: tuple[tuple[float, Any], ...] = ()
    missing = []
    try:
        family = LibratingFamily(disk, engine)
        guess = Fraction(family.limit)
        places = map(family.place, family.folds)
        folds = tuple((one.s, numpy.array([one.start[1] / one.start[0], one.omega, share])) for one in places)
    except (InputError, Shortfall) as fault:
        missing.append(Missing("fold", value, str(fault)))
    try:
        omega_h = _omega_h(disk, guess, engine)
    except (InputError, Shortfall) as fault:
        missing.append(Missing("heteroclinic", value, str(fault)))
    return Sample(share, omega_h, folds, tuple(missing))


def _omega_h(disk: Parameters, guess: Fraction | None, engine: Engine) -> float:
    """Omega_h from where the family tends to, else from a bisection."""
    if guess is not None:
        with suppress(InputError, Shortfall):
            return float(splitting_zero_in_double(disk, guess, engine))
    guess = bisect_omega_h(disk, engine, confirm=False).omega_h.value
    return float(splitting_zero_in_double(disk, guess, engine))


def _unclear(samples: Sequence[Sample]) -> set[float]:
    """The shares of disks whose Omega_h could not be told from that of their neighbours."""
    return {
        share
        for run in connected_runs(samples)
        for share, omega in run
        if len(run) < 3
        or abs(predicted_omega_h([pair for pair in run if pair[0] != share], share) - omega) > _PREDICTED
    }


def connected_runs(samples: Sequence[Sample]) -> list[list[tuple[float, float]]]:
    """(share, Omega_h) of neighbouring disks that have a connection."""
    runs = (
        [(one.share, one.omega_h) for one in run if one.omega_h is not None]
        for _, run in groupby(samples, key=lambda one: one.omega_h is None)
    )
    return [run for run in runs if run]


def predicted_omega_h(run: Sequence[tuple[float, float]], share: float) -> float:
    """Omega_h at a share by the polynomial through the six nearest disks."""
    near = sorted(run, key=lambda pair: abs(pair[0] - share))[:6]
    at, omega = (numpy.array(column) for column in zip(*near, strict=True))
    return float(interpolated(at, omega[:, None], share)[0])


# ------------------------------------------------------------------------------------------------ points on the curve
def omega_h_near(disk: Parameters, guess: float, engine: Engine, digits: int) -> Measured:
    """Omega_h [rad/s] to ``digits`` significant digits from an approximation good to some five.

    Raises Shortfall if it is not found or the digits are not reached, NoConnectionError where there are no saddles.
    """
    omega_h = splitting_zero_in_double(disk, Fraction(guess), engine)
    if omega_h.uncertainty > omega_h.value / 10**digits:
        omega_h = splitting_zero(disk, omega_h.value, engine, digits).omega_h
    return omega_h


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
    speed_at: Callable[[float], float],
    engine: Engine,
    digits: int,
) -> SpecialPoint:
    """The point of that kind between two shares of the range at which its condition differs in sign.

    ``speed_at`` gives Omega_h to some five digits at a share. The half-width of the parameter is a distance at which
    the condition has its two signs on the two sides, however large the errors of what it is computed from. Raises as
    `omega_h_near` does.
    """
    from scipy.optimize import brentq

    def rough(share: float) -> float:
        disk = plane.at(plane.value(share))
        return rough_condition(kind, disk, float(splitting_zero_in_double(disk, Fraction(speed_at(share)), engine)))

    share: float = brentq(rough, *ends, xtol=_SETTLED)
    value = plane.value(share)
    exact_digits = digits + _SPARE
    value = round(value, exact_digits - decimal_magnitude(value))
    width = value / 10**digits / 4
    while True:
        sides = []
        for side in (value - width, value + width):
            disk = plane.at(side)
            omega = omega_h_near(disk, speed_at(share), engine, exact_digits)
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
    return SpecialPoint(kind, Measured(value, width), Measured(middle, spread))
