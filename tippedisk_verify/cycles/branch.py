"""A branch of limit cycles as arrays, with the special points of its family and its diagram."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from fractions import Fraction
from functools import cached_property
from html import escape
from itertools import groupby, pairwise
from typing import Any

import numpy

from tippedisk_verify.connection.splitting import splitting_zero
from tippedisk_verify.cycles.branch_cycles import (
    DEFAULT_COUNT,
    MAX_SPEEDS,
    cycles_found,
    cycles_of_piece,
)
from tippedisk_verify.cycles.families.folds import librating_folds
from tippedisk_verify.cycles.limit_cycle import LimitCycle, MissingCycle
from tippedisk_verify.cycles.locator import cached_locator
from tippedisk_verify.display import (
    Printable,
    as_json,
    column_heading,
    data_frame,
    half_width_in_double,
    quantity,
)
from tippedisk_verify.errors import InputError
from tippedisk_verify.flow import default_engine
from tippedisk_verify.numbers.arrays import Array
from tippedisk_verify.numbers.exact import checked_integer, fraction, is_one_of, short_text
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.precision import DOUBLE
from tippedisk_verify.theory.hopf import omega_crit, period_crit

__all__ = ["Branch", "SpecialPoint"]

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
        hopf_numbers = omega_crit(locator.parameters), period_crit(locator.parameters), zero, zero
        points = [SpecialPoint("Omega_crit", *hopf_numbers)]
        if locator.family_failure:
            return tuple(points)
        parameters, family, engine = locator.parameters, locator.librating_family, locator.engine
        for number, fold in enumerate(librating_folds(parameters, engine, family=family), start=1):
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
        if not is_one_of(name, going_on):
            raise InputError(
                f"a branch restarts from {', '.join(going_on)}, not {short_text(name)}"
            )
        checked_integer(count, 2, MAX_SPEEDS, f"a branch has 2 to {MAX_SPEEDS} cycles, not {{}}")
        disk = cached_locator(cycles_found(self.cycles)[0].parameters, default_engine())
        return Branch.of(cycles_of_piece(disk, going_on.index(name), count, half_widths=True))

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
        largest_step = numpy.diff(heights).max(initial=0.0)
        joints = [
            point
            for point in self.points
            if point.period is not None
            and heights[0] - largest_step <= _abscissa(point) <= heights[-1]
        ]
        in_order: list[Any] = sorted([*cycles_found(self.cycles), *joints], key=_abscissa)
        steps = [(step, _stability(*step)) for step in pairwise(in_order)]
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
