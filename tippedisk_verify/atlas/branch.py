"""Families of limit cycles: at which speeds."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy

from tippedisk_verify.connection.bisection import bisect_omega_h
from tippedisk_verify.connection.near_connection import DOUBLE_SHOOTS, cycle_at
from tippedisk_verify.cycles.branch_interpolant import BranchInterpolant
from tippedisk_verify.cycles.continuation import cycles_at_speed
from tippedisk_verify.cycles.continuation import paper_sets as sets_of
from tippedisk_verify.cycles.librating_family import LibratingFamily
from tippedisk_verify.cycles.shooting import LimitCycle
from tippedisk_verify.errors import InputError, NoConnectionError, NoSuchCycleError, Shortfall
from tippedisk_verify.flow import default_lanes
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.arrays import Array
from tippedisk_verify.model.equations import checked_speeds
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.results import Printable, plain

__all__ = ["DEFAULT_COUNT", "MANY", "Branch", "family"]

DEFAULT_COUNT = 41  #: speeds of the family that is shown if none are named
_FEWEST = 5  # of them on a piece between folds
_UNRESOLVED = 1e-10  # of a speed; closer to the Hopf point or a fold doubles do not tell cycles apart
_MOST = 1_000_000
MANY = 100  #: speeds from which on it pays to compile for all lanes of the SIMD registers


@dataclass(frozen=True, repr=False)
class Branch(Printable):
    """A family of limit cycles as arrays (n,) in the order of its speeds; ``cycles`` has each with all its numbers."""

    cycles: tuple[LimitCycle, ...]
    omega: Array  #: [rad/s]
    period: Array  #: T [s]
    gamma_bar_0: Array  #: [rad]
    v_0: Array  #: [rad/s]
    beta_max: Array  #: [rad]
    multiplier_slow: Array
    log_multiplier_slow: Array
    log_multiplier_fast: Array
    uncertainty: Mapping[str, Any]  #: the half-widths (n,), under the same names

    @classmethod
    def of(cls, cycles: Iterable[LimitCycle]) -> Branch:
        """The arrays of these cycles."""
        kept = tuple(cycles)
        names = [item.name for item in fields(cls) if item.name not in ("cycles", "uncertainty")]
        numbers = {name: [getattr(cycle, name) for cycle in kept] for name in names}
        columns = {name: numpy.array(column, float) for name, column in numbers.items()}
        widths = {name: numpy.array([_in_double(number) for number in column]) for name, column in numbers.items()}
        return cls(kept, uncertainty=widths, **columns)

    def to_dict(self) -> dict[str, Any]:
        return {"orbits": plain(self.cycles)}


def _in_double(number: Measured) -> float:
    """A half-width for the value as a double: its rounding is added, and the sum is rounded up."""
    width = number.uncertainty + abs(number.value - Fraction(float(number)))
    return math.nextafter(float(width), math.inf) if width else 0.0


def family(
    parameters: Parameters,
    engine: Engine,
    *,
    paper_sets: bool = False,
    omegas: Sequence[object] | None = None,
) -> Iterator[LimitCycle]:
    """The paper's 801 cycles, those at the speeds [rad/s] given, or an overview from the Hopf point to the connection.

    A speed at which several cycles coexist gives all of them, from the smallest amplitude on. Raises InputError for
    speeds that are no positive decimals, NoSuchCycleError where the family has no cycle.
    """
    if paper_sets:
        yield from _papers(parameters, engine)
        return
    if omegas is None:
        try:
            known = LibratingFamily(parameters, engine)
        except NoSuchCycleError as fault:  # no speed was asked for
            raise Shortfall(str(fault)) from None
        yield from _overview(known)
        return
    speeds = checked_speeds(omegas)
    if not 0 < len(speeds) <= _MOST:
        raise InputError(f"a family has 1 to {_MOST} speeds, not {len(speeds)}")
    if len(speeds) >= MANY and parameters.friction == "linear":
        yield from _together(parameters, [float(speed) for speed in speeds], engine)
    else:
        yield from _one_by_one(parameters, speeds, engine)


def _overview(family: LibratingFamily) -> Iterator[LimitCycle]:
    """Cycles along the family, closer together towards the ends of its pieces, a thousandth away from these.

    Not closer to them than doubles can follow; pieces that are too short for that are left out.
    """
    breaks, closest = family.breaks, 2 * float(DOUBLE_SHOOTS)
    for piece, ((_, begin), (name, end)) in enumerate(pairwise(family.ends)):
        share = (breaks[piece + 1] - breaks[piece]) / (breaks[-1] - breaks[0])
        count = max(_FEWEST, round(DEFAULT_COUNT * share))
        away = (end - begin) / 1000
        first = begin + math.copysign(max(abs(away), _UNRESOLVED * begin), away)
        last = end - math.copysign(max(abs(away), closest if name == "Omega_h" else _UNRESOLVED * end), away)
        if (last - first) * away <= 0:
            continue
        for n in range(count):
            place = (2 * n - count + 1) / (count - 1)
            omega = first + (0.5 + 0.5 * place * (1.5 - 0.5 * place * place)) * (last - first)
            yield cycles_at_speed(family, Fraction(omega), piece=piece)[0]


def _papers(parameters: Parameters, engine: Engine) -> Iterator[LimitCycle]:
    """The cycles at the paper's speeds. Raises NoSuchCycleError for a disk with which these do not make sense."""
    omega_h = bisect_omega_h(parameters, engine).omega_h.value
    sets = sets_of(parameters, omega_h)
    if not omega_h < Fraction(sets.start):
        raise NoSuchCycleError(
            f"the paper's sets of speeds begin 0.5 rad/s below Omega_crit, at {sets.start:.10g} rad/s; for this disk "
            f"that lies below Omega_h = {float(omega_h):.10g} rad/s"
        )
    speeds = (sets.start, *sets.increasing, *sets.decreasing)
    if parameters.friction == "linear":
        yield from _together(parameters, speeds, engine, omega_h)
    else:
        yield from _one_by_one(parameters, [Fraction(speed) for speed in speeds], engine)


def _one_by_one(parameters: Parameters, speeds: Sequence[Fraction], engine: Engine) -> Iterator[LimitCycle]:
    """All cycles at each speed, or the one next to the connection that doubles do not hold."""
    known: LibratingFamily | None = None
    with suppress(NoSuchCycleError):
        known = LibratingFamily(parameters, engine)
    for speed in speeds:
        if known is not None and any(known.places(float(speed))):
            yield from cycles_at_speed(known, speed)
        else:
            yield cycle_at(parameters, speed, engine)


def _together(
    parameters: Parameters, speeds: Sequence[float], engine: Engine, omega_h: Fraction | None = None
) -> list[LimitCycle]:
    """All speeds at once on the branch as a function; the Taylor engine's lanes do it, whatever the engine is.

    One after the other where doubles or the branch do not hold them all.
    """
    lanes, low, high = default_lanes(), min(speeds), max(speeds)
    try:
        omega_h = omega_h or bisect_omega_h(parameters, engine).omega_h.value
        return BranchInterpolant(parameters, lanes, float(omega_h), lowest=low, highest=high).limit_cycles(speeds)
    except (NoConnectionError, NoSuchCycleError, Shortfall):
        return list(_one_by_one(parameters, [Fraction(speed) for speed in speeds], engine))
