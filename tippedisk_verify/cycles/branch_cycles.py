"""The limit cycles of a branch: an overview of the whole family, the paper's speeds, or given
speeds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from fractions import Fraction
from functools import partial
from typing import TypeVar

from tippedisk_verify.cycles.cycle_at_speed import (
    cycle_from_guess,
    cycles_from_guesses,
    librating_cycles_at,
)
from tippedisk_verify.cycles.families.family import Family, batch_solver
from tippedisk_verify.cycles.families.folds import rotating_fold
from tippedisk_verify.cycles.families.interpolant import FamilyInterpolant
from tippedisk_verify.cycles.families.librating_family import LibratingFamily
from tippedisk_verify.cycles.families.rotating_family import RotatingFamily
from tippedisk_verify.cycles.limit_cycle import Cycle, LimitCycle, MissingCycle, RotatingCycle
from tippedisk_verify.cycles.locator import CycleLocator, cached_locator
from tippedisk_verify.cycles.shooting.section import LIBRATING, ROTATING, Section
from tippedisk_verify.cycles.shooting.shoot import MIN_SHOOTING_DISTANCE
from tippedisk_verify.errors import AccuracyError, InputError, NoConnectionError, NoSuchCycleError
from tippedisk_verify.flow import default_batch_engine
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.equations import checked_speeds
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.theory.hopf import omega_crit

__all__ = [
    "DEFAULT_COUNT",
    "DEFAULT_ROTATING_COUNT",
    "MAX_SPEEDS",
    "PAPER_COUNT",
    "cycles_found",
    "cycles_of_piece",
    "librating_branch",
    "paper_speeds",
    "require_some_cycle",
    "rotating_branch",
]

C = TypeVar("C", bound=Cycle)

DEFAULT_COUNT = 41  #: the number of speeds in the overview of the librating cycles
DEFAULT_ROTATING_COUNT = 40  #: the number of speeds in the overview of the rotating cycles
_MIN_SPEEDS_PER_PIECE = 11  # the least number of speeds on a piece between folds
# A relative distance of speeds. Closer to the Hopf point or a fold doubles do not separate cycles.
_MIN_DISTANCE = 1e-10
MAX_SPEEDS = 1_000_000  #: the largest number of speeds or cycles of a branch
# The digits that a cycle solved in a batch must have. With fewer the speed is solved alone.
_BATCH_DIGITS = {"librating": 0, "rotating": 12}
_STEPS = 400  # the steps of each of the paper's sets
PAPER_COUNT = 2 * _STEPS + 1  #: the number of speeds in both of the paper's sets
# The number of speeds from which on it pays to compile for all lanes of the SIMD registers.
_MIN_BATCH_SIZE = 100


def cycles_found(rows: Iterable[C | MissingCycle]) -> list[C]:
    """Return the limit cycles among some rows, without the missing ones.

    Args:
        rows: Cycles and missing cycles.
    """
    return [row for row in rows if not isinstance(row, MissingCycle)]


def require_some_cycle(rows: Iterable[C | MissingCycle]) -> list[C | MissingCycle]:
    """Return the rows as a list, unless all are missing cycles.

    Args:
        rows: Cycles and missing cycles.

    Raises:
        Exception: If no row is a cycle: the error of the first row.
    """
    kept = list(rows)
    if kept and isinstance(kept[0], MissingCycle) and not cycles_found(kept):
        raise kept[0].fault
    return kept


def paper_speeds(parameters: Parameters, omega_h: Fraction) -> tuple[float, ...]:
    """Return the speeds [rad/s] at which the paper computes limit cycles: Omega_0 = Omega_crit -
    0.5, the set A^in towards Omega_crit and the set A^de towards Omega_h.

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
def librating_branch(
    parameters: Parameters,
    engine: Engine,
    *,
    paper_sets: bool = False,
    omegas: Sequence[object] | None = None,
    half_widths: bool = True,
) -> Iterator[LimitCycle | MissingCycle]:
    """Return an iterator of librating limit cycles: the paper's 801, those at given speeds, or an
    overview from the Hopf point to the connection.

    A speed at which several cycles coexist gives all of them, from the smallest amplitude on. A
    speed without a cycle gives a `MissingCycle`.

    Args:
        parameters: The disk and its friction law.
        engine: The engine of the flights.
        paper_sets: If True, take the paper's speeds.
        omegas: The speeds [rad/s], positive decimals; None for the overview.
        half_widths: If False, the numbers have no half-widths. A hundred or more speeds of the
            linear law always have them, except those that are solved alone.

    Raises:
        InputError: If a speed is not a positive decimal, or there are too many.
    """
    locator = cached_locator(parameters, engine)
    if paper_sets:
        speeds = [Fraction(speed) for speed in paper_speeds(parameters, locator.omega_h)]
    elif omegas is None:
        return _overview(locator, half_widths)
    else:
        speeds = checked_speeds(omegas)
        if not 0 < len(speeds) <= MAX_SPEEDS:
            raise InputError(f"a family has 1 to {MAX_SPEEDS} speeds, not {len(speeds)}")
    return _cycles_at_speeds(
        locator,
        LIBRATING,
        partial(librating_cycles_at, parameters, engine=engine, half_widths=half_widths),
        speeds,
    )


def _cycles_at_speeds(
    locator: CycleLocator,
    section: Section[C],
    solve_alone: Callable[[Fraction], list[C]],
    speeds: Sequence[Fraction],
) -> Iterator[C | MissingCycle]:
    """Yield all limit cycles of a kind at given speeds.

    Many speeds of the linear law are solved as doubles, in lanes of the Taylor engine. A speed
    whose cycles do not have `_BATCH_DIGITS` there is solved alone, by ``solve_alone``. A speed
    without a cycle gives a `MissingCycle`, and the others go on.
    """
    parameters, engine = locator.parameters, locator.engine
    by_speed: list[list[C] | None] = [None] * len(speeds)
    if len(speeds) >= _MIN_BATCH_SIZE and parameters.law.is_linear:
        batch_engine, doubles = default_batch_engine(), [float(speed) for speed in speeds]
        speeds = [Fraction(speed) for speed in doubles]
        solve = batch_solver(section, parameters, batch_engine)
        with suppress(NoConnectionError, NoSuchCycleError, AccuracyError):
            followed: Family
            if section is LIBRATING:
                followed = LibratingFamily(parameters, engine, solve)
            else:
                followed = RotatingFamily(parameters, engine, locator.omega_h, solve)
                followed.follow_to(max(doubles))
            by_speed = FamilyInterpolant(followed, batch_engine).cycles_at_speeds(
                doubles, _BATCH_DIGITS[section.name]
            )
    for speed, cycles in zip(speeds, by_speed, strict=True):
        rows: Sequence[C | MissingCycle]
        try:
            rows = solve_alone(speed) if cycles is None else cycles
        except (InputError, AccuracyError, ArithmeticError) as fault:
            rows = [MissingCycle(Measured(speed, Fraction(0)), fault)]
        yield from rows


def _overview(locator: CycleLocator, half_widths: bool) -> Iterator[LimitCycle]:
    """Yield librating limit cycles along the whole family, closer together towards the ends of its
    pieces.

    They stay a thousandth of a piece, or as far as doubles need, from its ends. A piece that is too
    short for that is left out.
    """
    try:
        family = locator.librating_family
    except NoSuchCycleError as fault:  # the caller named no speed
        raise AccuracyError(str(fault)) from None
    ends_and_folds = family.ends_and_folds
    for piece in range(len(ends_and_folds) - 1):
        share = (ends_and_folds[piece + 1] - ends_and_folds[piece]) / (
            ends_and_folds[-1] - ends_and_folds[0]
        )
        count = max(_MIN_SPEEDS_PER_PIECE, round(DEFAULT_COUNT * share))
        yield from cycles_of_piece(locator, piece, count, half_widths)


def cycles_of_piece(
    locator: CycleLocator, piece: int, count: int, half_widths: bool
) -> Iterator[LimitCycle]:
    """Yield ``count`` librating limit cycles on one piece of the family, closer together towards
    its ends.

    They stay away from the ends as those of an overview do. A piece that is too short has none.

    Args:
        locator: The families of the disk.
        piece: The number of the piece, from 0 at the Hopf point.
        count: The number of cycles.
        half_widths: If False, the numbers have no half-widths.
    """
    (_, begin), (name, end) = locator.librating_family.ends[piece : piece + 2]
    margin, closest = (end - begin) / 1000, 2 * float(MIN_SHOOTING_DISTANCE)
    first = begin + math.copysign(max(abs(margin), _MIN_DISTANCE * begin), margin)
    last = end - math.copysign(
        max(abs(margin), closest if name == "Omega_h" else _MIN_DISTANCE * end), margin
    )
    if (last - first) * margin <= 0:
        return
    for n in range(count):
        place = (2 * n - count + 1) / (count - 1)
        omega = first + (0.5 + 0.5 * place * (1.5 - 0.5 * place * place)) * (last - first)
        at_speed = locator.librating_guesses_at(Fraction(omega))
        for guess in at_speed.guesses:
            if guess.piece == piece:
                yield cycle_from_guess(at_speed, guess, half_widths=half_widths)


# ----------------------------------------------------------------------------------------- rotating
def rotating_branch(
    parameters: Parameters,
    engine: Engine,
    omegas: Sequence[object] | None = None,
    *,
    half_widths: bool = True,
) -> Iterator[RotatingCycle | MissingCycle]:
    """Return an iterator of rotating cycles: at each speed the stable one, then the unstable one;
    or an overview.

    The overview goes from just below Omega_h through the fold to half a rad/s above Omega_crit. A
    hundred or more speeds of the linear law are rounded to doubles and solved together. A speed
    without a cycle gives a `MissingCycle`.

    Args:
        parameters: The disk and its friction law.
        engine: The engine of the flights.
        omegas: The speeds [rad/s], positive decimals; None for the overview.
        half_widths: If False, the numbers have no half-widths, except where many are solved
            together.

    Raises:
        InputError: If a speed is not a positive decimal.
    """
    locator = cached_locator(parameters, engine)
    if omegas is None:
        return _rotating_overview(locator, half_widths)
    return _cycles_at_speeds(
        locator,
        ROTATING,
        lambda speed: cycles_from_guesses(
            locator.rotating_guesses_at(speed), half_widths=half_widths
        ),
        checked_speeds(omegas),
    )


def _rotating_overview(locator: CycleLocator, half_widths: bool) -> Iterator[RotatingCycle]:
    """Yield an overview of the rotating cycles: stable ones from Omega_h down to the fold, then
    unstable ones upward.

    Speeds lie closest together where the family turns round. They never reach Omega_h.
    """
    family, half = locator.rotating_family, DEFAULT_ROTATING_COUNT // 2
    fold = Fraction(float(rotating_fold(family).omega))
    below, beyond = (
        family.omega_h - fold,
        omega_crit(locator.parameters, 20).value + Fraction(1, 2) - fold,
    )
    for n in range(half, 0, -1):
        speed = fold + below * Fraction(n * n, half * half + 1)
        at_speed = locator.rotating_guesses_at(speed, stable=True)
        yield from cycles_from_guesses(at_speed, half_widths=half_widths)
    for n in range(1, half + 1):
        speed = fold + beyond * Fraction(n * n, half * half)
        at_speed = locator.rotating_guesses_at(speed, stable=False)
        yield from cycles_from_guesses(at_speed, half_widths=half_widths)
