"""Many limit cycles of a family: at speeds that are asked for, at the paper's, or at those of an overview."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from fractions import Fraction
from html import escape
from itertools import pairwise
from typing import Any, TypeVar

import numpy

from tippedisk_verify.atlas.cycles_at_speed import cycle_at
from tippedisk_verify.atlas.locator import Locator, locator
from tippedisk_verify.connection.near_connection import DOUBLE_SHOOTS
from tippedisk_verify.cycles.family import Family, in_batches
from tippedisk_verify.cycles.folds import rotation_fold
from tippedisk_verify.cycles.interpolant import FamilyInterpolant
from tippedisk_verify.cycles.librating_family import LibratingFamily
from tippedisk_verify.cycles.limit_cycle import Cycle, LimitCycle, RotatingCycle
from tippedisk_verify.cycles.rotating_family import RotatingFamily
from tippedisk_verify.cycles.section import LIBRATING, ROTATING, Section
from tippedisk_verify.errors import AccuracyError, InputError, NoConnectionError, NoSuchCycleError
from tippedisk_verify.flow import default_lanes
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.arrays import Array
from tippedisk_verify.model.equations import checked_speeds
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.results import Printable, as_json, heading
from tippedisk_verify.theory.hopf import omega_crit

__all__ = ["DEFAULT_COUNT", "DEFAULT_ROTATIONS", "PAPER_COUNT", "Branch", "family", "paper_speeds", "rotating_branch"]

C = TypeVar("C", bound=Cycle)
_SHOWN = ("omega", "period", "gamma_bar_0", "beta_max", "multiplier_slow")

DEFAULT_COUNT = 41  #: speeds of the family that is shown if none are named
DEFAULT_ROTATIONS = 40  #: the same of the rotating cycles
_FEWEST = 5  # of them on a piece between folds
_UNRESOLVED = 1e-10  # of a speed; closer to the Hopf point or a fold doubles do not tell cycles apart
_MOST = 1_000_000
_DIGITS_IN_LANES = {"librating": 0, "rotating": 12}  #: fewer, and a speed is solved by itself
_STEPS = 400  # of each of the paper's sets
PAPER_COUNT = 2 * _STEPS + 1  #: speeds of both
_MANY = 100  # speeds from which on it pays to compile for all lanes of the SIMD registers


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

    def __len__(self) -> int:
        return len(self.cycles)

    def __getitem__(self, index: Any) -> Any:
        """A cycle, or the cycles of a slice."""
        return self.cycles[index]

    def plot(self, axes: Any = None) -> Any:
        """The period against the speed, on these matplotlib axes or on new ones; returns the axes."""
        if axes is None:
            from matplotlib import pyplot

            _, axes = pyplot.subplots()
        axes.plot(self.omega, self.period, ".-")
        axes.set(xlabel="Ω [rad/s]", ylabel="period T [s]")
        return axes

    def to_dict(self) -> dict[str, Any]:
        return {"orbits": as_json(self.cycles)}

    def _rows(self) -> list[list[str]]:
        """A heading, and the numbers of the first and last cycles, as many as fit into ten lines with it."""
        chosen = range(len(self)) if len(self) <= 8 else (0, 1, 2, None, -3, -2, -1)
        columns = [getattr(self, name) for name in _SHOWN]
        rows = (["…"] * len(columns) if n is None else [f"{x[n]:.10g}" for x in columns] for n in chosen)
        return [[*map(heading, _SHOWN)], *rows]

    def __repr__(self) -> str:
        whose = f" of {self.cycles[0].parameters.name} ({self.cycles[0].parameters.friction})" if self.cycles else ""
        lines = ["".join(f"{cell:>18}" for cell in row) for row in self._rows()]
        return "\n".join([f"Branch{whose}: {len(self)} limit cycles", *lines])

    def _repr_html_(self) -> str:
        """A table, for notebooks."""
        rows = ("".join(f"<td>{escape(cell)}</td>" for cell in row) for row in self._rows())
        return f"<table><tr>{'</tr><tr>'.join(rows)}</tr></table>"


def _in_double(number: Measured) -> float:
    """A half-width for the value as a double: its rounding is added, and the sum is rounded up."""
    width = number.uncertainty + abs(number.value - Fraction(float(number)))
    return math.nextafter(float(width), math.inf) if width else 0.0


def paper_speeds(parameters: Parameters, omega_h: Fraction) -> tuple[float, ...]:
    """The paper's speeds [rad/s]: Omega_0 = Omega_crit - 0.5, A^in towards Omega_crit and A^de towards ``omega_h``.

    Each set has 400 steps, each a hundredth of the rest. As doubles, because the paper's are. The paper's index set
    I = {1, ..., 400} leaves Omega_1 undefined; this Omega_1 follows from Omega_0 by the same rule. Raises
    NoSuchCycleError for a disk with which the sets do not make sense.
    """
    crit = omega_crit(parameters, 40).value
    start = crit - Fraction(1, 2)
    if not omega_h < start:
        raise NoSuchCycleError(
            f"the paper's sets of speeds begin 0.5 rad/s below Omega_crit, at {float(start):.10g} rad/s; for this disk "
            f"that lies below Omega_h = {float(omega_h):.10g} rad/s"
        )
    steps = (end + (start - end) * Fraction(99, 100) ** n for end in (crit, omega_h) for n in range(1, _STEPS + 1))
    return tuple(map(float, (start, *steps)))


# ------------------------------------------------------------------------------------------------ librating
def family(
    parameters: Parameters,
    engine: Engine,
    *,
    paper_sets: bool = False,
    omegas: Sequence[object] | None = None,
) -> Iterator[LimitCycle]:
    """The paper's 801 cycles, those at these speeds [rad/s], or an overview from the Hopf point to the connection.

    A speed at which several cycles coexist gives all of them, from the smallest amplitude on. Raises InputError for
    speeds that are no positive decimals, NoSuchCycleError where the family has no cycle.
    """
    disk_locator = locator(parameters, engine)
    if paper_sets:
        speeds = [Fraction(speed) for speed in paper_speeds(parameters, disk_locator.omega_h)]
    elif omegas is None:
        return _overview(disk_locator)
    else:
        speeds = checked_speeds(omegas)
        if not 0 < len(speeds) <= _MOST:
            raise InputError(f"a family has 1 to {_MOST} speeds, not {len(speeds)}")

    def singly(speed: Fraction) -> list[LimitCycle]:
        location = disk_locator.librating(speed)
        # The one-harmonic law may lead to a cycle where the family is not followed, or ends too close to the speed.
        return location.cycles() if location.starts else [cycle_at(parameters, speed, engine)]

    return _at(disk_locator, LIBRATING, singly, speeds)


def _at(
    disk_locator: Locator, section: Section[C], singly: Callable[[Fraction], list[C]], speeds: Sequence[Fraction]
) -> Iterator[C]:
    """All cycles of a kind at these speeds; many, of the linear law, as doubles in lanes of the Taylor engine.

    A speed whose cycles lanes do not hold, rotating ones to twelve digits, is solved by itself.
    """
    parameters, engine = disk_locator.parameters, disk_locator.engine
    by_speed: list[list[C] | None] = [None] * len(speeds)
    if len(speeds) >= _MANY and parameters.friction == "linear":
        lanes, doubles = default_lanes(), [float(speed) for speed in speeds]
        speeds = [Fraction(speed) for speed in doubles]
        solve = in_batches(section, parameters, lanes)
        with suppress(NoConnectionError, NoSuchCycleError, AccuracyError):
            followed: Family
            if section is LIBRATING:
                followed = LibratingFamily(parameters, engine, solve)
            else:
                followed = RotatingFamily(parameters, engine, disk_locator.omega_h, solve)
                followed.reach(max(doubles))
            by_speed = FamilyInterpolant(followed, lanes).results(doubles, _DIGITS_IN_LANES[section.name])
    for speed, cycles in zip(speeds, by_speed, strict=True):
        yield from singly(speed) if cycles is None else cycles


def _overview(disk_locator: Locator) -> Iterator[LimitCycle]:
    """Cycles along the family, closer together towards the ends of its pieces and a thousandth short of them.

    Not closer to them than doubles can follow; pieces that are too short for that are left out.
    """
    try:
        family = disk_locator.family
    except NoSuchCycleError as fault:  # no speed was asked for
        raise AccuracyError(str(fault)) from None
    breaks, closest = family.breaks, 2 * float(DOUBLE_SHOOTS)
    for piece, ((_, begin), (name, end)) in enumerate(pairwise(family.ends)):
        share = (breaks[piece + 1] - breaks[piece]) / (breaks[-1] - breaks[0])
        count = max(_FEWEST, round(DEFAULT_COUNT * share))
        margin = (end - begin) / 1000
        first = begin + math.copysign(max(abs(margin), _UNRESOLVED * begin), margin)
        last = end - math.copysign(max(abs(margin), closest if name == "Omega_h" else _UNRESOLVED * end), margin)
        if (last - first) * margin <= 0:
            continue
        for n in range(count):
            place = (2 * n - count + 1) / (count - 1)
            omega = first + (0.5 + 0.5 * place * (1.5 - 0.5 * place * place)) * (last - first)
            location = disk_locator.librating(Fraction(omega))
            yield from (location.cycle(start) for start in location.starts if start.piece == piece)


# ------------------------------------------------------------------------------------------------ rotating
def rotating_branch(
    parameters: Parameters, engine: Engine, omegas: Sequence[object] | None = None
) -> Iterator[RotatingCycle]:
    """The family in double: at each of these speeds [rad/s] the stable cycle, then the unstable one; or an overview.

    The overview goes from just below Omega_h through the fold to half a rad/s above Omega_crit. A hundred speeds and
    more, of the linear law, count as doubles and are solved together. Raises InputError for speeds that are no positive
    decimals, NoSuchCycleError where the family has no cycle at a speed.
    """
    disk_locator = locator(parameters, engine)
    if omegas is None:
        return _rotating_overview(disk_locator)
    return _at(disk_locator, ROTATING, lambda speed: disk_locator.rotating(speed).cycles(), checked_speeds(omegas))


def _rotating_overview(disk_locator: Locator) -> Iterator[RotatingCycle]:
    """Cycles lie closest together, for their speeds, where the family turns round, and Omega_h is never reached."""
    family, half = disk_locator.rotations, DEFAULT_ROTATIONS // 2
    fold = Fraction(float(rotation_fold(family).omega))
    below, beyond = family.omega_h - fold, omega_crit(disk_locator.parameters, 20).value + Fraction(1, 2) - fold
    for n in range(half, 0, -1):
        yield from disk_locator.rotating(fold + below * Fraction(n * n, half * half + 1), stable=True).cycles()
    for n in range(1, half + 1):
        yield from disk_locator.rotating(fold + beyond * Fraction(n * n, half * half), stable=False).cycles()
