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
from typing import Any, Literal, TypeVar

import numpy

from tippedisk_verify.atlas.fold_curves import Nodes, Plane
from tippedisk_verify.connection.bisection import bisect_omega_h
from tippedisk_verify.connection.splitting import splitting_zero, splitting_zero_in_double
from tippedisk_verify.cycles.librating_family import LibratingFamily
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.decimals import decimal_magnitude
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.theory.equilibria import equilibrium, saddle_value_sign
from tippedisk_verify.theory.hopf import omega_crit, omega_crit_squared

__all__ = ["Missing", "Sample", "SpecialPoint", "Work", "attempted", "connected_runs", "omega_h_near", "sampled",
           "special_points"]  # fmt: skip

T = TypeVar("T")
Condition = Literal["neutral-saddle", "hopf-heteroclinic"]
#: What vanishes: lambda_u + lambda_s of the saddles at Omega_h; Omega_h - Omega_crit.
_CONDITIONS: tuple[Condition, ...] = ("neutral-saddle", "hopf-heteroclinic")

_SPARE = 3  # digits of Omega_h beyond those of a point on its curve
_SETTLED = 1e-13  # of the range; doubles know no condition better
_SAMPLES = 17  # disks to begin with
_NARROW = 1 / 512  # of the range: how closely the range is sampled where Omega_h ends
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
    omega_h: float | None  #: [rad/s]; None where there is no connection
    folds: tuple[tuple[float, Any], ...]  #: of its limit cycles, each (s, point) as in `fold_curves.Trace`
    missing: tuple[Missing, ...]  #: why there is no Omega_h, or no family of limit cycles


def attempted(kind: str, value: Fraction, compute: Callable[[], T]) -> T | Missing:
    """What ``compute`` returns, or why it could not."""
    try:
        return compute()
    except (InputError, AccuracyError) as fault:
        return Missing(kind, value, str(fault))


# ------------------------------------------------------------------------------------------------ disks of the range
def sampled(plane: Plane, work: Work) -> list[Sample]:
    """Disks of the range: close together where Omega_h ends, and where it does not follow from its neighbours."""
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
    disk = plane.at(value)
    family = attempted("fold", value, lambda: LibratingFamily(disk, engine))
    guess = None if isinstance(family, Missing) else Fraction(family.limit)
    places = [] if isinstance(family, Missing) else map(family.place, family.folds)
    folds = tuple((one.s, numpy.array([one.start[1] / one.start[0], one.omega, share])) for one in places)
    omega_h = attempted("heteroclinic", value, lambda: _omega_h(disk, guess, engine))
    missing = tuple(one for one in (family, omega_h) if isinstance(one, Missing))
    return Sample(share, None if isinstance(omega_h, Missing) else omega_h, folds, missing)


def _omega_h(disk: Parameters, guess: Fraction | None, engine: Engine) -> float:
    """Omega_h from where the family tends to, else from a bisection."""
    if guess is not None:
        with suppress(InputError, AccuracyError):
            return float(splitting_zero_in_double(disk, guess, engine))
    guess = bisect_omega_h(disk, engine, confirm=False).omega_h.value
    return float(splitting_zero_in_double(disk, guess, engine))


def _unclear(samples: Sequence[Sample]) -> set[float]:
    """The shares of disks whose Omega_h does not follow from that of their neighbours."""
    return {
        float(share)
        for run in connected_runs(samples)
        for k, share in enumerate(run.at)
        if len(run.at) < 3 or abs(run.without(k)(share) - run.values[k])[0] > _PREDICTED
    }


def connected_runs(samples: Sequence[Sample]) -> list[Nodes]:
    """Omega_h [rad/s] against the share, for each run of neighbouring disks that have a connection."""
    runs = (list(run) for connected, run in groupby(samples, key=lambda one: one.omega_h is not None) if connected)
    return [Nodes(numpy.array([one.share for one in run]), numpy.array([[one.omega_h] for one in run])) for run in runs]


# ------------------------------------------------------------------------------------------------ points on the curve
def omega_h_near(disk: Parameters, guess: float, engine: Engine, digits: int) -> Measured:
    """Omega_h [rad/s] to ``digits`` significant digits from an approximation good to some five.

    Raises AccuracyError if it is not found or the digits are not reached, NoConnectionError where there are no saddles.
    """
    omega_h = splitting_zero_in_double(disk, Fraction(guess), engine)
    if omega_h.uncertainty > omega_h.value / 10**digits:
        omega_h = splitting_zero(disk, omega_h.value, engine, digits).omega_h
    return omega_h


def special_points(plane: Plane, samples: Sequence[Sample], digits: int, work: Work) -> list[SpecialPoint | Missing]:
    """The points on the curve at which a condition changes its sign, or why one was not found."""
    changes = []
    for run in connected_runs(samples):
        for kind in _CONDITIONS:
            values = [
                _rough_condition(kind, plane.at(plane.decimal(share)), omega)
                for share, omega in zip(run.at.tolist(), run.values[:, 0].tolist(), strict=True)
            ]
            for ends, (before, after) in zip(pairwise(run.at.tolist()), pairwise(values), strict=True):
                if (before < 0) != (after < 0):
                    changes.append((kind, ends, run))
    return work(partial(_special_point, plane, digits), changes)


def _special_point(
    plane: Plane, digits: int, change: tuple[Condition, tuple[float, float], Nodes]
) -> SpecialPoint | Missing:
    kind, ends, run = change
    return attempted(kind, plane.decimal(sum(ends) / 2), lambda: _refined_point(kind, plane, ends, run, digits))


def _rough_condition(kind: Condition, disk: Parameters, omega_h: float) -> float:
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


def _refined_point(kind: Condition, plane: Plane, ends: tuple[float, float], run: Nodes, digits: int) -> SpecialPoint:
    """The point of that kind between two shares of the range at which its condition differs in sign.

    The half-width of the parameter is a distance at which the condition has its two signs on the two sides, however
    large the errors of what it is computed from. Raises as `omega_h_near` does.
    """
    from scipy.optimize import brentq

    engine = default_engine()

    def rough(share: float) -> float:
        disk, guess = plane.at(plane.value(share)), Fraction(float(run(share)[0]))
        return _rough_condition(kind, disk, float(splitting_zero_in_double(disk, guess, engine)))

    share: float = brentq(rough, *ends, xtol=_SETTLED)
    exact_digits = digits + _SPARE
    value = plane.value(share)
    value = round(value, exact_digits - decimal_magnitude(value))
    for width in (value / 10**digits / 4, value / 10**digits):
        disks = plane.at(value - width), plane.at(value + width)
        left, right = (omega_h_near(disk, float(run(share)[0]), engine, exact_digits) for disk in disks)
        if [_signs(kind, disks[0], left), _signs(kind, disks[1], right)] in ([{-1}, {1}], [{1}, {-1}]):
            # Omega_h is monotonic over so short a distance, but for the errors of its two ends.
            spread = abs(left.value - right.value) + left.uncertainty + right.uncertainty
            return SpecialPoint(kind, Measured(value, width), Measured((left.value + right.value) / 2, spread))
    raise AccuracyError("the two signs of the condition could not be told apart next to it: ask for more digits")
