"""Branches of limit cycles: many speeds of a family (an overview, the paper's sets), its special
points, and their diagram.

The speeds are given, or the paper's, or those of an overview of the whole family.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields
from fractions import Fraction
from functools import cached_property, partial
from html import escape
from itertools import groupby, pairwise
from typing import Any, TypeVar

import numpy

from tippedisk_verify.connection.splitting import splitting_zero
from tippedisk_verify.cycles.cycle_at_speed import (
    cycle_from_guess,
    cycles_from_guesses,
    librating_cycles_at,
)
from tippedisk_verify.cycles.families.family import Family, batch_solver
from tippedisk_verify.cycles.families.folds import libration_folds, rotation_fold
from tippedisk_verify.cycles.families.interpolant import FamilyInterpolant
from tippedisk_verify.cycles.families.librating_family import LibratingFamily
from tippedisk_verify.cycles.families.rotating_family import RotatingFamily
from tippedisk_verify.cycles.limit_cycle import Cycle, LimitCycle, MissingCycle, RotatingCycle
from tippedisk_verify.cycles.locator import CycleLocator, cached_locator
from tippedisk_verify.cycles.shooting.section import LIBRATING, ROTATING, Section
from tippedisk_verify.cycles.shooting.shoot import MIN_SHOOTING_DISTANCE
from tippedisk_verify.errors import AccuracyError, InputError, NoConnectionError, NoSuchCycleError
from tippedisk_verify.flow import default_batch_engine, default_engine
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.arrays import Array
from tippedisk_verify.model.equations import checked_speeds
from tippedisk_verify.model.exact import fraction, integer_between, short_text
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE
from tippedisk_verify.model.results import (
    Printable,
    as_json,
    column_heading,
    data_frame,
    half_width_in_double,
    quantity,
)
from tippedisk_verify.theory.hopf import omega_crit, period_crit

__all__ = [
    "DEFAULT_COUNT",
    "DEFAULT_ROTATING_COUNT",
    "PAPER_COUNT",
    "Branch",
    "SpecialPoint",
    "cycles_found",
    "librating_branch",
    "paper_speeds",
    "require_some_cycle",
    "rotating_branch",
]

C = TypeVar("C", bound=Cycle)
# The line style and the legend of a stretch by its stability.
_STYLES = {
    True: ("-", "stable cycles"),
    False: ("--", "unstable cycles"),
    None: (":", "not decided"),
}
# The labels of the two vertical axes.
_AXES = ("largest |β − π/2| [rad]", "period T [s]")
# The labels of special points; folds keep their names.
_LABELS = {"Omega_crit": "Hopf point", "Omega_h": "$Ω_h$"}
_SHOWN_COLUMNS = ("omega", "period", "gamma_bar_0", "beta_max", "multiplier_slow")

DEFAULT_COUNT = 41  #: the number of speeds in the overview of the librating cycles
DEFAULT_ROTATING_COUNT = 40  #: the number of speeds in the overview of the rotating cycles
_MIN_SPEEDS_PER_PIECE = 11  # the least number of speeds on a piece between folds
# A relative distance of speeds. Closer to the Hopf point or a fold doubles do not separate cycles.
_MIN_DISTANCE = 1e-10
_MAX_SPEEDS = 1_000_000
# The digits that a cycle solved in a batch must have. With fewer the speed is solved alone.
_BATCH_DIGITS = {"librating": 0, "rotating": 12}
_STEPS = 400  # the steps of each of the paper's sets
PAPER_COUNT = 2 * _STEPS + 1  #: the number of speeds in both of the paper's sets
# The number of speeds from which on it pays to compile for all lanes of the SIMD registers.
_MIN_BATCH_SIZE = 100


@dataclass(frozen=True, repr=False)
class SpecialPoint(Printable):
    """A point at which a piece of the family of limit cycles begins or ends, with its name and
    numbers.
    """

    name: str  #: ``Omega_crit`` (the Hopf point), ``fold 1``, ``fold 2``, ... or ``Omega_h``
    omega: Measured = field(metadata=quantity("the speed there", "rad/s"))
    period: Measured | None = field(metadata=quantity("T there; None at Omega_h, infinite", "s"))
    gamma_bar_0: Measured = field(
        metadata=quantity("gamma - pi/2 there where beta = pi/2 and v < 0; pi at Omega_h", "rad")
    )
    beta_max: Measured | None = field(
        metadata=quantity("largest abs(beta - pi/2) there; None at Omega_h", "rad")
    )


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
        """Collect cycles into a branch, with their numbers and half-widths as arrays.

        A number that a row does not have is NaN.

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
        """A `MissingCycle` for each speed at which no cycle was found."""
        return tuple(row for row in self.cycles if isinstance(row, MissingCycle))

    @property
    def stable(self) -> tuple[bool | None, ...]:
        """The stability of each cycle; None where it is not certain, or no cycle was found."""
        return tuple(getattr(cycle, "stable", None) for cycle in self.cycles)

    @cached_property
    def points(self) -> tuple[SpecialPoint, ...]:
        """The special points of the whole family, in its order: the Hopf point, the folds and the
        connection. They are computed on first use.

        Of a family that cannot be followed only the Hopf point is known.

        Raises:
            AccuracyError: If a fold does not have 12 digits.
        """
        locator = cached_locator(cycles_found(self.cycles)[0].parameters, default_engine())
        zero = Measured(Fraction(0), Fraction(0))
        born = omega_crit(locator.parameters), period_crit(locator.parameters), zero, zero
        points = [SpecialPoint("Omega_crit", *born)]
        if locator.family_failure:
            return tuple(points)
        parameters, family, engine = locator.parameters, locator.librating_family, locator.engine
        for number, fold in enumerate(libration_folds(parameters, engine, family=family), start=1):
            numbers = fold.omega, fold.period, fold.gamma_bar_0, fold.beta_max
            points.append(SpecialPoint(f"fold {number}", *numbers))
        if family.connected:
            zero_of_splitting = splitting_zero(parameters, locator.omega_h, engine, 12)
            half_turn = Measured(fraction(DOUBLE.pi), DOUBLE.epsilon)
            connection = zero_of_splitting.omega_h, None, half_turn, None
            points.append(SpecialPoint("Omega_h", *connection))
        return tuple(points)

    def restart(self, point: SpecialPoint | str, count: int = DEFAULT_COUNT) -> Branch:
        """Return the branch of limit cycles from a special point on, to the next one or to the
        family's end.

        Args:
            point: One of `points`, or its name.
            count: The number of cycles. A piece that is too short for doubles has none.

        Raises:
            InputError: If the family does not go on from there, or ``count`` is not 2 to 1,000,000.
            NoSuchCycleError: If the family cannot be followed.
        """
        going_on = [special.name for special in self.points if special.name != "Omega_h"]
        name = getattr(point, "name", point)
        if name not in going_on:
            raise InputError(
                f"a branch restarts from {', '.join(going_on)}, not {short_text(name)}"
            )
        if integer_between(count, 2, _MAX_SPEEDS) is None:
            raise InputError(f"a branch has 2 to {_MAX_SPEEDS} cycles, not {short_text(count)}")
        disk = cached_locator(cycles_found(self.cycles)[0].parameters, default_engine())
        return Branch.of(_piece(disk, going_on.index(name), count, half_widths=True))

    def __len__(self) -> int:
        return len(self.cycles)

    def __getitem__(self, index: Any) -> Any:
        """Return one of the branch's cycles, or the cycles of a slice.

        A speed without a cycle has a `MissingCycle`.
        """
        return self.cycles[index]

    def plot(self, axes: Any = None) -> Any:
        """Plot the bifurcation diagram: the largest lean and the period against the speed.

        Lines are solid where cycles, or inverted spinning, are stable, and dashed where they are
        not. The special points are marked with their names.

        Args:
            axes: Two matplotlib axes; None for new ones.

        Returns:
            The matplotlib figure.

        Raises:
            AccuracyError: If a fold of the family does not have 12 digits.
        """
        if axes is None:
            from matplotlib import pyplot

            figure, axes = pyplot.subplots(2, figsize=(6, 7), layout="constrained")
            disk = cycles_found(self.cycles)[0].parameters
            figure.suptitle(f"{disk.name}, {disk.law} friction")
        speeds = [float(cycle.omega) for cycle in cycles_found(self.cycles)]
        speeds += [float(point.omega) for point in self.points]
        low, high, crit = min(speeds), max(speeds), float(self.points[0].omega)
        # Room for the names: of the connection on the left, of the other points on the right
        low, high = low - 0.1 * (high - low), high + 0.3 * (high - low)
        axes[0].plot([low, crit], [0, 0], "--", color="0.4")
        axes[0].plot([crit, high], [0, 0], "-", color="0.4", label="inverted spinning")
        for axis, name, text in zip(axes, ("beta_max", "period"), _AXES, strict=True):
            for style, label, (omega, height) in self._lines(name):
                axis.plot(omega, height, style, color="C0", label=label)
            for point in self.points:
                omega_there, value = float(point.omega), getattr(point, name)
                label = _LABELS.get(point.name, point.name)
                if value is None:  # the connection
                    axis.axvline(omega_there, color="0.6", linestyle=":", linewidth=1)
                    axis.annotate(
                        label,
                        (omega_there, 0.5),
                        xycoords=axis.get_xaxis_transform(),
                        xytext=(-4, 0),
                        textcoords="offset points",
                        ha="right",
                    )
                else:
                    axis.plot(omega_there, float(value), "o", color="C3")
                    axis.annotate(
                        label,
                        (omega_there, float(value)),
                        xytext=(6, -13),
                        textcoords="offset points",
                    )
            axis.set(xlabel="Ω [rad/s]", ylabel=text, xlim=(low, high))
            axis.margins(y=0.1)
            axis.locator_params(axis="x", nbins=6)
        axes[0].legend(loc="upper right")
        return axes[0].figure

    def to_dataframe(self) -> Any:
        """Return a pandas data frame with a row for each cycle, as `branch --out` writes them.

        Each number is rounded to a double. Its half-width, in the column NAME_uncertainty, includes
        this rounding. A speed without a cycle has only ``omega`` and the reason as ``status``.

        Raises:
            InputError: If pandas is not installed.
        """
        return data_frame(
            [
                {name: value for name, value in vars(row).items() if isinstance(value, Measured)}
                | {"stable": getattr(row, "stable", None), "status": getattr(row, "status", "ok")}
                for row in self.cycles
            ]
        )

    def _lines(self, name: str) -> Iterator[tuple[str, str, tuple[list[float], list[float]]]]:
        """Yield the lines of a plot: for each stretch of cycles of one stability its style, label
        and points.

        ``name`` is the number that is plotted against the speed. The stretches meet in the special
        points between their cycles. A line begins in the Hopf point if that is no farther away than
        the cycles are from each other.
        """
        heights = numpy.sort(self.gamma_bar_0[numpy.isfinite(self.gamma_bar_0)])
        reach = numpy.diff(heights).max(initial=0.0)
        joints = [
            point
            for point in self.points
            if point.period is not None and heights[0] - reach <= _abscissa(point) <= heights[-1]
        ]
        course: list[Any] = sorted([*cycles_found(self.cycles), *joints], key=_abscissa)
        steps = [(step, _stability(*step)) for step in pairwise(course)]
        labelled: set[str] = set()
        for stable, stretch in groupby(steps, lambda step: step[1]):
            pairs = [pair for pair, _ in stretch]
            places = [pairs[0][0], *(after for _, after in pairs)]
            style, label = _STYLES[stable]
            omega, height = ([float(getattr(x, key)) for x in places] for key in ("omega", name))
            yield style, "" if label in labelled else label, (omega, height)
            labelled.add(label)

    def to_dict(self) -> dict[str, Any]:
        return {"orbits": as_json(self.cycles)}

    def _rows(self) -> list[list[str]]:
        """Return rows of text for a table: a heading and the numbers of the first and last cycles.

        There are at most nine rows.
        """
        chosen = range(len(self)) if len(self) <= 8 else (0, 1, 2, None, -3, -2, -1)
        columns = [getattr(self, name) for name in _SHOWN_COLUMNS]
        rows = (
            ["…"] * len(columns) if n is None else [f"{x[n]:.10g}" for x in columns] for n in chosen
        )
        return [[*map(column_heading, _SHOWN_COLUMNS)], *rows]

    def __repr__(self) -> str:
        cycles, missing = cycles_found(self.cycles), len(self.missing)
        whose = (
            f" of {cycles[0].parameters.name} ({cycles[0].parameters.friction})" if cycles else ""
        )
        lines = ["".join(f"{cell:>18}" for cell in row) for row in self._rows()]
        without = f", at {missing} more speeds none" if missing else ""
        return "\n".join([f"Branch{whose}: {len(cycles)} limit cycles{without}", *lines])

    def _repr_html_(self) -> str:
        """Return an HTML table of the first and last cycles, for notebooks."""
        rows = ("".join(f"<td>{escape(cell)}</td>" for cell in row) for row in self._rows())
        return f"<table><tr>{'</tr><tr>'.join(rows)}</tr></table>"


def _abscissa(place: LimitCycle | SpecialPoint) -> float:
    """Return the number by which a family is ordered: gamma_bar_0 [rad] of a cycle or special
    point.

    It rises along the family, even where the speeds do not.
    """
    return float(place.gamma_bar_0)


def _stability(*places: LimitCycle | SpecialPoint) -> bool | None:
    """Return the stability of the first limit cycle among some cycles and special points; the
    points are skipped.

    Returns None if there is no limit cycle, or if its stability is uncertain.
    """
    return next((place.stable for place in places if isinstance(place, LimitCycle)), None)


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
        if not 0 < len(speeds) <= _MAX_SPEEDS:
            raise InputError(f"a family has 1 to {_MAX_SPEEDS} speeds, not {len(speeds)}")
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
                followed.reach(max(doubles))
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
        yield from _piece(locator, piece, count, half_widths)


def _piece(
    locator: CycleLocator, piece: int, count: int, half_widths: bool
) -> Iterator[LimitCycle]:
    """Yield ``count`` librating limit cycles on one piece of the family, closer together towards
    its ends.

    They stay away from the ends as those of `_overview` do. A piece that is too short has none.
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
    fold = Fraction(float(rotation_fold(family).omega))
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
