"""Families of limit cycles: at which speeds."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from fractions import Fraction
from typing import Any

import numpy

from tippedisk_verify.errors import InputError, NoSuchCycleError
from tippedisk_verify.flow import default_lanes
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.arrays import Array
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.orbits.bisection import bisect_omega_h
from tippedisk_verify.orbits.branch_interpolant import BranchInterpolant
from tippedisk_verify.orbits.continuation import continued, followed_cycle
from tippedisk_verify.orbits.continuation import paper_sets as sets_of
from tippedisk_verify.orbits.near_connection import cycle_at
from tippedisk_verify.orbits.periodic import LimitCycle
from tippedisk_verify.theory.hopf import omega_crit

__all__ = ["DEFAULT_COUNT", "MANY", "Branch", "family"]

DEFAULT_COUNT = 41  #: speeds of the family that is shown if none are named
_MOST = 1_000_000
MANY = 100  #: speeds from which on it pays to compile for all lanes of the SIMD registers


@dataclass(frozen=True)
class Branch:
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
    """The paper's 801 cycles, those at the speeds [rad/s] given, or an even overview.

    Raises InputError for speeds that are no positive decimals, NoSuchCycleError where the family ends.
    """
    if omegas is not None:
        speeds = [checked_speed(omega) for omega in omegas]
        if not 0 < len(speeds) <= _MOST:
            raise InputError(f"a family has 1 to {_MOST} speeds, not {len(speeds)}")
        if len(speeds) >= MANY and parameters.friction == "linear":
            yield from _together(parameters, [float(speed) for speed in speeds], engine)
        else:
            yield from _one_by_one(parameters, speeds, engine)
        return
    omega_h = bisect_omega_h(parameters, engine).omega_h.value
    if not paper_sets:
        crit = omega_crit(parameters, 20).value
        # From just below Omega_crit down to a thousandth of the way above Omega_h, closer together towards both ends.
        shares = [(2 * n - DEFAULT_COUNT + 1) / (DEFAULT_COUNT - 1) for n in range(DEFAULT_COUNT)]
        spread = [0.5 + 0.499 * share * (1.5 - 0.5 * share * share) for share in shares]
        yield from continued(parameters, [float(crit) - share * float(crit - omega_h) for share in spread], engine)
        return
    sets = sets_of(parameters, omega_h)
    if parameters.friction == "linear":
        yield from _together(parameters, (sets.start, *sets.increasing, *sets.decreasing), engine, omega_h)
        return
    start = followed_cycle(parameters, Fraction(sets.start), engine)
    yield start
    yield from continued(parameters, sets.increasing, engine, first=start)
    yield from continued(parameters, sets.decreasing, engine, first=start)


def _one_by_one(parameters: Parameters, speeds: Sequence[Fraction], engine: Engine) -> Iterator[LimitCycle]:
    """Each from the one before, or by itself where that does not lead there."""
    here = None
    for speed in speeds:
        try:
            if here is None:
                raise NoSuchCycleError("there is none before")
            (here,) = continued(parameters, [speed], engine, first=here)
        except NoSuchCycleError:
            here = cycle_at(parameters, speed, engine)
        yield here


def _together(
    parameters: Parameters, speeds: Sequence[float], engine: Engine, omega_h: Fraction | None = None
) -> list[LimitCycle]:
    """All speeds at once on the branch as a function; the Taylor engine's lanes do it, whatever the engine is."""
    if omega_h is None:
        omega_h = bisect_omega_h(parameters, engine).omega_h.value
    branch = BranchInterpolant(parameters, default_lanes(), float(omega_h), lowest=min(speeds), highest=max(speeds))
    return branch.limit_cycles(speeds)
