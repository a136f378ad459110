"""Many limit cycles of a family: at given speeds, at the paper's, or at those of an overview."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from fractions import Fraction
from functools import partial
from html import escape
from itertools import pairwise
from typing import Any, TypeVar

import numpy

from tippedisk_verify.cycles.at_speed import cycles_at
from tippedisk_verify.cycles.family import Family, in_batches
from tippedisk_verify.cycles.folds import rotation_fold
from tippedisk_verify.cycles.interpolant import FamilyInterpolant
from tippedisk_verify.cycles.librating_family import LibratingFamily
from tippedisk_verify.cycles.limit_cycle import Cycle, LimitCycle, MissingCycle, RotatingCycle
from tippedisk_verify.cycles.locator import Locator, locator
from tippedisk_verify.cycles.near_connection import DOUBLE_SHOOTS
from tippedisk_verify.cycles.rotating_family import RotatingFamily
from tippedisk_verify.cycles.section import LIBRATING, ROTATING, Section
from tippedisk_verify.errors import AccuracyError, InputError, NoConnectionError, NoSuchCycleError
from tippedisk_verify.flow import default_lanes
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.arrays import Array
from tippedisk_verify.model.equations import checked_speeds
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.results import (
    Printable,
    as_json,
    data_frame,
    half_width_in_double,
    heading,
)
from tippedisk_verify.theory.hopf import omega_crit

__all__ = [
    "DEFAULT_COUNT",
    "DEFAULT_ROTATIONS",
    "PAPER_COUNT",
    "Branch",
    "family",
    "found",
    "not_all_missing",
    "paper_speeds",
    "rotating_branch",
]

C = TypeVar("C", bound=Cycle)
_SHOWN = ("omega", "period", "gamma_bar_0", "beta_max", "multiplier_slow")

DEFAULT_COUNT = 41  #: the number of speeds in the overview of the librating cycles
DEFAULT_ROTATIONS = 40  #: the number of speeds in the overview of the rotating cycles
_FEWEST_ON_PIECE = 5  # the least number of speeds on a piece between folds
# A relative distance of speeds. Closer to the Hopf point or a fold doubles do not separate cycles.
_UNRESOLVED = 1e-10
_MOST_SPEEDS = 1_000_000
# The digits that a cycle from the lanes must have. With fewer a speed is solved alone.
_DIGITS_IN_LANES = {"librating": 0, "rotating": 12}
_STEPS = 400  # the steps of each of the paper's sets
PAPER_COUNT = 2 * _STEPS + 1  #: the number of speeds in both of the paper's sets
# The number of speeds from which on it pays to compile for all lanes of the SIMD registers.
_FEWEST_FOR_LANES = 100


@dataclass(frozen=True, repr=False)
class Branch(Printable):
    """A family of limit cycles as arrays (n,) in the order of its speeds.

    ``cycles`` has each cycle with all its numbers. A speed without a cycle has a `MissingCycle`
    there, whose ``status`` gives the reason, and NaN in the arrays.
    """

    cycles: tuple[LimitCycle | MissingCycle, ...]
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
    def of(cls, cycles: Iterable[LimitCycle | MissingCycle]) -> Branch:
        """Return the branch of these cycles.

        Args:
            cycles: The cycles in the order of the speeds.
        """
        kept = tuple(cycles)
        names = [item.name for item in fields(cls) if item.name not in ("cycles", "uncertainty")]
        numbers = {name: [getattr(cycle, name, math.nan) for cycle in kept] for name in names}
        columns = {name: numpy.array(column, float) for name, column in numbers.items()}
        widths = {
            name: numpy.array(
                [
                    half_width_in_double(number) if isinstance(number, Measured) else number
                    for number in column
                ]
            )
            for name, column in numbers.items()
        }
        return cls(kept, uncertainty=widths, **columns)

    @property
    def missing(self) -> tuple[MissingCycle, ...]:
        """The speeds at which no cycle was found."""
        return tuple(row for row in self.cycles if isinstance(row, MissingCycle))

    def __len__(self) -> int:
        return len(self.cycles)

    def __getitem__(self, index: Any) -> Any:
        """Return a cycle, or the cycles of a slice; a missing one as in ``cycles``."""
        return self.cycles[index]

    def plot(self, axes: Any = None) -> Any:
        """Plot the period against the speed.

        Args:
            axes: The matplotlib axes; None for new ones.

        Returns:
            The axes.
        """
        if axes is None:
            from matplotlib import pyplot

            _, axes = pyplot.subplots()
        axes.plot(self.omega, self.period, ".-")
        axes.set(xlabel="Ω [rad/s]", ylabel="period T [s]")
        return axes

    def to_dataframe(self) -> Any:
        """Return a pandas data frame with a row for each cycle, as `branch --out` writes them.

        Each number is rounded to a double. Its half-width, in the column NAME_uncertainty, includes
        this rounding. A speed without a cycle has only ``omega`` and the reason as ``status``.

        Raises:
            InputError: pandas is not installed.
        """
        return data_frame(
            [
                {name: value for name, value in vars(row).items() if isinstance(value, Measured)}
                | {"stable": getattr(row, "stable", None), "status": getattr(row, "status", "ok")}
                for row in self.cycles
            ]
        )

    def to_dict(self) -> dict[str, Any]:
        return {"orbits": as_json(self.cycles)}

    def _rows(self) -> list[list[str]]:
        """Return a heading and the numbers of the first and last cycles, in at most ten lines."""
        chosen = range(len(self)) if len(self) <= 8 else (0, 1, 2, None, -3, -2, -1)
        columns = [getattr(self, name) for name in _SHOWN]
        rows = (
            ["…"] * len(columns) if n is None else [f"{x[n]:.10g}" for x in columns] for n in chosen
        )
        return [[*map(heading, _SHOWN)], *rows]

    def __repr__(self) -> str:
        cycles, missing = found(self.cycles), len(self.missing)
        whose = (
            f" of {cycles[0].parameters.name} ({cycles[0].parameters.friction})" if cycles else ""
        )
        lines = ["".join(f"{cell:>18}" for cell in row) for row in self._rows()]
        without = f", at {missing} more speeds none" if missing else ""
        return "\n".join([f"Branch{whose}: {len(cycles)} limit cycles{without}", *lines])

    def _repr_html_(self) -> str:
        """Return a table, for notebooks."""
        rows = ("".join(f"<td>{escape(cell)}</td>" for cell in row) for row in self._rows())
        return f"<table><tr>{'</tr><tr>'.join(rows)}</tr></table>"


def found(rows: Iterable[C | MissingCycle]) -> list[C]:
    """Return the cycles, without the missing ones.

    Args:
        rows: Cycles and missing cycles.
    """
    return [row for row in rows if not isinstance(row, MissingCycle)]


def not_all_missing(rows: Iterable[C | MissingCycle]) -> list[C | MissingCycle]:
    """Return the rows if any of them is a cycle.

    Args:
        rows: Cycles and missing cycles.

    Raises:
        Exception: The error of the first row, if no row is a cycle.
    """
    kept = list(rows)
    if kept and isinstance(kept[0], MissingCycle) and not found(kept):
        raise kept[0].fault
    return kept


def paper_speeds(parameters: Parameters, omega_h: Fraction) -> tuple[float, ...]:
    """Return the paper's speeds [rad/s]: Omega_0 = Omega_crit - 0.5, A^in towards Omega_crit and
    A^de towards Omega_h.

    Each set has 400 steps, each a hundredth of the rest. The speeds are doubles, because the
    paper's are. The paper's index set I = {1, ..., 400} leaves Omega_1 undefined. This Omega_1
    follows from Omega_0 by the same rule.

    Args:
        parameters: The disk.
        omega_h: The speed of the connection [rad/s].

    Returns:
        The 801 speeds.

    Raises:
        NoSuchCycleError: If the sets make no sense for the disk.
    """
    crit = omega_crit(parameters, 40).value
    start = crit - Fraction(1, 2)
    if not omega_h < start:
        raise NoSuchCycleError(
            f"the paper's sets of speeds begin 0.5 rad/s below Omega_crit, at {float(start):.10g} "
            f"rad/s; for this disk "
            f"that lies below Omega_h = {float(omega_h):.10g} rad/s"
        )
    steps = (
        end + (start - end) * Fraction(99, 100) ** n
        for end in (crit, omega_h)
        for n in range(1, _STEPS + 1)
    )
    return tuple(map(float, (start, *steps)))


# ---------------------------------------------------------------------------------------- librating
def family(
    parameters: Parameters,
    engine: Engine,
    *,
    paper_sets: bool = False,
    omegas: Sequence[object] | None = None,
    half_widths: bool = True,
) -> Iterator[LimitCycle | MissingCycle]:
    """Return the paper's 801 cycles, those at given speeds, or an overview from the Hopf point to
    the connection.

    A speed at which several cycles coexist gives all of them, from the smallest amplitude on. A
    speed without a cycle gives a `MissingCycle`.

    Args:
        parameters: The disk and its friction law.
        engine: The engine of the flights.
        paper_sets: If True, take the paper's speeds.
        omegas: The speeds [rad/s], positive decimals; None for the overview.
        half_widths: If False, the numbers have no half-widths.

    Raises:
        InputError: If a speed is not a positive decimal, or there are too many.
    """
    disk_locator = locator(parameters, engine)
    if paper_sets:
        speeds = [Fraction(speed) for speed in paper_speeds(parameters, disk_locator.omega_h)]
    elif omegas is None:
        return _overview(disk_locator)
    else:
        speeds = checked_speeds(omegas)
        if not 0 < len(speeds) <= _MOST_SPEEDS:
            raise InputError(f"a family has 1 to {_MOST_SPEEDS} speeds, not {len(speeds)}")
    return _at(
        disk_locator,
        LIBRATING,
        partial(cycles_at, parameters, engine=engine, half_widths=half_widths),
        speeds,
    )


def _at(
    disk_locator: Locator,
    section: Section[C],
    singly: Callable[[Fraction], list[C]],
    speeds: Sequence[Fraction],
) -> Iterator[C | MissingCycle]:
    """Yield all cycles of a kind at these speeds.

    Many speeds of the linear law are solved as doubles, in lanes of the Taylor engine. A speed
    whose cycles do not have `_DIGITS_IN_LANES` there is solved alone. A speed without a cycle gives
    a `MissingCycle`, and the others go on.
    """
    parameters, engine = disk_locator.parameters, disk_locator.engine
    by_speed: list[list[C] | None] = [None] * len(speeds)
    if len(speeds) >= _FEWEST_FOR_LANES and parameters.law.is_linear:
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
            by_speed = FamilyInterpolant(followed, lanes).results(
                doubles, _DIGITS_IN_LANES[section.name]
            )
    for speed, cycles in zip(speeds, by_speed, strict=True):
        rows: Sequence[C | MissingCycle]
        try:
            rows = singly(speed) if cycles is None else cycles
        except (InputError, AccuracyError, ArithmeticError) as fault:
            rows = [MissingCycle(Measured(speed, Fraction(0)), fault)]
        yield from rows


def _overview(disk_locator: Locator) -> Iterator[LimitCycle]:
    """Yield cycles along the family, closer together towards the ends of its pieces.

    They stay a thousandth of a piece, or as far as doubles need, from its ends. A piece that is too
    short for that is left out.
    """
    try:
        family = disk_locator.family
    except NoSuchCycleError as fault:  # the caller named no speed
        raise AccuracyError(str(fault)) from None
    breaks, closest = family.breaks, 2 * float(DOUBLE_SHOOTS)
    for piece, ((_, begin), (name, end)) in enumerate(pairwise(family.ends)):
        share = (breaks[piece + 1] - breaks[piece]) / (breaks[-1] - breaks[0])
        count = max(_FEWEST_ON_PIECE, round(DEFAULT_COUNT * share))
        margin = (end - begin) / 1000
        first = begin + math.copysign(max(abs(margin), _UNRESOLVED * begin), margin)
        last = end - math.copysign(
            max(abs(margin), closest if name == "Omega_h" else _UNRESOLVED * end), margin
        )
        if (last - first) * margin <= 0:
            continue
        for n in range(count):
            place = (2 * n - count + 1) / (count - 1)
            omega = first + (0.5 + 0.5 * place * (1.5 - 0.5 * place * place)) * (last - first)
            location = disk_locator.librating(Fraction(omega))
            yield from (location.cycle(start) for start in location.starts if start.piece == piece)


# ----------------------------------------------------------------------------------------- rotating
def rotating_branch(
    parameters: Parameters, engine: Engine, omegas: Sequence[object] | None = None
) -> Iterator[RotatingCycle | MissingCycle]:
    """Return the family in double: at each speed the stable cycle, then the unstable one; or an
    overview.

    The overview goes from just below Omega_h through the fold to half a rad/s above Omega_crit.
    From a hundred speeds on those of the linear law are taken as doubles and solved together. A
    speed without a cycle gives a `MissingCycle`.

    Args:
        parameters: The disk and its friction law.
        engine: The engine of the flights.
        omegas: The speeds [rad/s], positive decimals; None for the overview.

    Raises:
        InputError: If a speed is not a positive decimal.
    """
    disk_locator = locator(parameters, engine)
    if omegas is None:
        return _rotating_overview(disk_locator)
    return _at(
        disk_locator,
        ROTATING,
        lambda speed: disk_locator.rotating(speed).cycles(),
        checked_speeds(omegas),
    )


def _rotating_overview(disk_locator: Locator) -> Iterator[RotatingCycle]:
    """Yield an overview of the rotating cycles.

    Speeds lie closest together where the family turns round. They never reach Omega_h.
    """
    family, half = disk_locator.rotations, DEFAULT_ROTATIONS // 2
    fold = Fraction(float(rotation_fold(family).omega))
    below, beyond = (
        family.omega_h - fold,
        omega_crit(disk_locator.parameters, 20).value + Fraction(1, 2) - fold,
    )
    for n in range(half, 0, -1):
        yield from disk_locator.rotating(
            fold + below * Fraction(n * n, half * half + 1), stable=True
        ).cycles()
    for n in range(1, half + 1):
        yield from disk_locator.rotating(
            fold + beyond * Fraction(n * n, half * half), stable=False
        ).cycles()
