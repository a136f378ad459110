"""A family of limit cycles, librating or rotating, with the first coordinate on its section as the
parameter.

Omega may turn round along a family; the first coordinate does not. The abscissa is s, with

    first coordinate = centre + half_range tanh(s).

The ratio of the two coordinates, the flight time and Omega are analytic in s. They are analytic
towards the connection as well, where the distance from the saddle goes like exp(-2 |s|). They are
polynomials through Chebyshev nodes on panels of s, each solved from the panel before.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, partial
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple

import numpy

from tippedisk_verify.cycles.families.batch_shooting import shoot_batch
from tippedisk_verify.cycles.shooting.newton import Iterate, StoppingRule, newton
from tippedisk_verify.cycles.shooting.return_map import ReturnMap
from tippedisk_verify.cycles.shooting.section import Section
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.flow.batch import BatchTaylor, equation_constants
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.arrays import Array

__all__ = ["CycleGuess", "Family", "SolvedCycles", "Solver", "batch_solver", "sequential_solver"]

_SHORT, _LONG, _SHORT_PANELS = 0.4, 0.8, 3  # lengths of the first few panels and of the others
_GROUP_SIZE = 8  # nodes that are solved together
_DEGREE = 7  # degree of the extrapolation to the next nodes, through values and slopes
_MAX_JUMP = 0.3  # relative distance from the guess; a cycle farther away belongs to another family
# Largest misfit of values and slopes, relative to the change between neighbours
_MAX_MISFIT = 0.15
_MIN_NODE_DISTANCE = 1e-3  # in s; the family is lost if nodes would have to be closer together
_MAX_STEPS = 10  # steps of Newton's iteration for an abscissa
_SETTLED = 1e-9  # a relative step after which only rounding is left


class SolvedCycles(NamedTuple):
    """Limit cycles that were solved for at chosen first coordinates, as arrays (n,).

    They are NaN where the search failed. Slopes are derivatives with respect to the first
    coordinate.
    """

    second: Array  #: the section's other coordinate [rad/s]
    flight_time: Array  #: flight time of the section's map [s]
    omega: Array  #: [rad/s]
    second_slope: Array
    flight_time_slope: Array
    omega_slope: Array


#: A function that solves for cycles. Its arguments are the first coordinate, the second one, the
#: flight time and Omega, as arrays (n,). The first is fixed, the others are guesses.
Solver = Callable[[Array, Array, Array, Array], SolvedCycles]


@dataclass(frozen=True)
class CycleGuess:
    """An approximate limit cycle of a family, in double: the start from which to shoot for the
    cycle.
    """

    #: Both coordinates; NaN next to Omega_h, where doubles do not have them
    coordinates: tuple[float, float]
    omega: float  #: [rad/s]
    piece: int  #: counted from where the family begins, one more after each fold
    omega_falls: bool  #: True if Omega falls along that piece, with a rising first coordinate
    flight_time: float = math.nan  #: flight time of the section's map [s]
    #: zeros after the point of the distance from the Hopf point, if it is too small for doubles
    hopf_distance_zeros: int = 0

    @classmethod
    def without_coordinates(cls, omega: Fraction, piece: int = 0) -> CycleGuess:
        """Return a `CycleGuess` for a cycle so close to the connection that doubles cannot separate
        them.

        It has no coordinates (NaN).

        Args:
            omega: The speed [rad/s].
            piece: The piece of the family that ends at the connection.
        """
        return cls((math.nan, math.nan), float(omega), piece, omega_falls=True)

    @property
    def has_coordinates(self) -> bool:
        """True if this approximate cycle has coordinates: doubles separate it from the
        connection.
        """
        return not math.isnan(self.coordinates[0])


class Family:
    """A family of limit cycles of one disk, interpolated in double on panels of nodes.

    Args:
        parameters: The disk and its friction law.
        engine: The engine of the flights.
        solver: Finds cycles of chosen first coordinates.
        nodes: The number of nodes of a panel.
        centre: The first coordinate at s = 0 [rad].
        half_range: The factor of tanh(s) in the first coordinate [rad].
        first_row: One cycle: s, second coordinate / first, flight time, Omega, and the derivatives
            of the last three with respect to s.

    Raises:
        NoSuchCycleError: If the family cannot be followed.
    """

    section: ClassVar[Section[Any]]
    #: The abscissa at which the family, continued before its first node, ends: librating cycles
    #: vanish there. Linear estimates hold within half the distance from it.
    origin: ClassVar[float] = -math.inf
    #: Pairs of speeds [rad/s] between which the family has a cycle beyond its last node.
    unfollowed_speeds: tuple[tuple[float, float], ...]

    def __init__(
        self,
        parameters: Parameters,
        engine: Engine,
        solver: Solver,
        nodes: int,
        centre: float,
        half_range: float,
        first_row: Any,
    ) -> None:
        self.parameters, self.engine, self.nodes_per_panel = parameters, engine, nodes
        self._solver, self._centre, self._half_range = solver, centre, half_range
        # The rows from which the next panel is solved
        self._rows = numpy.array([first_row], dtype=float)
        self._first_abscissa = float(first_row[0])
        self._panels = numpy.empty((0, nodes, 7))
        angles = (2 * numpy.arange(nodes)[::-1] + 1) * numpy.pi / (2 * nodes)
        self._chebyshev = (1 + numpy.cos(angles)) / 2
        self._weights = (-1.0) ** numpy.arange(nodes) * numpy.sin(angles)

    def coordinate(self, s: Any) -> Any:
        """Return the first coordinate [rad] of the family's cycle with the parameter
        (abscissa) s.
        """
        return self._centre + self._half_range * numpy.tanh(s)

    def coordinate_rate(self, s: Any) -> Any:
        """Return the derivative of the cycles' first coordinate [rad] with respect to the family's
        parameter (abscissa) s.
        """
        return self._half_range / numpy.cosh(s) ** 2

    def abscissa(self, coordinate: Any) -> Any:
        """Return the parameter (abscissa) s of the family's cycle with a first coordinate [rad].

        It is the inverse of `coordinate`.
        """
        return numpy.arctanh((coordinate - self._centre) / self._half_range)

    # ----------------------------------------------------------------------------------- the panels
    def extend(self) -> None:
        """Follow the family further: solve for the cycles on the nodes of one more panel, and add
        it.

        Raises:
            NoSuchCycleError: If the family is lost.
        """
        index = len(self._panels)
        start, end = self._panel_edge(index), self._panel_edge(index + 1)
        wanted, rows = (
            start + (end - start) * self._chebyshev,
            numpy.empty((self.nodes_per_panel, 7)),
        )
        rows_before, solved = self._rows, 0
        while solved < self.nodes_per_panel:
            group = self._solve_at(wanted[solved : solved + _GROUP_SIZE], rows_before)
            if not len(group):
                rows_before = self._insert_between(rows_before, wanted[solved])
                continue
            rows[solved : solved + len(group)] = group
            rows_before = numpy.concatenate((rows_before, group))
            solved += len(group)
        self._rows = rows
        self._panels = numpy.concatenate((self._panels, rows[None]))
        for name in ("folds", "_inversion_samples"):
            self.__dict__.pop(name, None)

    def _panel_edge(self, index: int) -> float:
        """Return the abscissa at which the family's panel with the number ``index`` begins."""
        return (
            self._first_abscissa
            + _SHORT * min(index, _SHORT_PANELS)
            + _LONG * max(0, index - _SHORT_PANELS)
        )

    def _insert_between(self, rows: Array, target: float) -> Array:
        """Return the solved cycles ``rows`` and more of them, on the way to an abscissa that was
        not reached.

        The last of them is halfway there. Raises NoSuchCycleError if the family is lost.
        """
        begin = rows[-1, 0]
        if target - begin < _MIN_NODE_DISTANCE:
            raise NoSuchCycleError(self._lost_family_error(target))
        group = self._solve_at(
            begin + (target - begin) * numpy.arange(1, _GROUP_SIZE + 1) / (2 * _GROUP_SIZE), rows
        )
        if not len(group):
            raise NoSuchCycleError(self._lost_family_error(target))
        return numpy.concatenate((rows, group))

    def _solve_at(self, s: Array, rows: Array) -> Array:
        """Solve for the family's cycles at abscissas (n,), and return them as rows (k, 7) like
        those of the panels.

        ``rows`` are cycles already solved, from which guesses are extrapolated. The result ends
        before the first abscissa that has no cycle of the family.
        """
        guess = self._guess(s, rows)
        x, rate = self.coordinate(s), self.coordinate_rate(s)
        with numpy.errstate(invalid="ignore"):
            solved = SolvedCycles(*self._solver(x, guess[0] * x, guess[1], guess[2]))
            values = numpy.stack((solved.second / x, solved.flight_time, solved.omega))
            jumped = (numpy.abs(values - guess) > _MAX_JUMP * numpy.abs(guess)).any(axis=0)
            ratio_slope = (solved.second_slope - values[0]) / x
        slopes = numpy.stack((ratio_slope, solved.flight_time_slope, solved.omega_slope)) * rate
        new = numpy.concatenate((s[None], values, slopes)).T
        good = numpy.isfinite(new[:, 3]) & ~jumped & ~_discontinuous_rows(new, rows)
        return new[: int(numpy.argmin(numpy.append(good, False)))]

    def _guess(self, s: Array, rows: Array) -> Any:
        """Predict the family's cycles at abscissas (n,): second coordinate / first, flight time and
        Omega, (3, n).

        Polynomials through the last of the solved cycles ``rows`` give them.
        """
        last = rows[-_GROUP_SIZE:]
        offset, size = last[:, 0] - s[0], last[-1, 0] - last[0, 0] + s[0] - last[-1, 0]
        size = size or 1.0
        degree = min(_DEGREE, 2 * len(last) - 1)
        powers, rates = _powers_and_rates(offset / size, degree)
        right = numpy.concatenate((last[:, 1:4], last[:, 4:] * size))
        coefficients = numpy.linalg.lstsq(numpy.concatenate((powers, rates)), right, rcond=None)[0]
        return (numpy.vander((s - s[0]) / size, degree + 1) @ coefficients).T

    def _lost_family_error(self, s: float) -> str:
        name, first = self.section.coordinate_names[0], self.coordinate(s)
        return f"the family of {self.section.name} limit cycles could not be followed to {name} = {first:.6g} rad"

    # ---------------------------------------------------------------------------------- its numbers
    @property
    def nodes(self) -> Array:
        """The family's cycles at all nodes, as rows (n, 7).

        A row has s, second coordinate / first, flight time, Omega, and the derivatives of the last
        three with respect to s.
        """
        return self._panels.reshape(-1, 7)

    def at(self, s: Array) -> Any:
        """Interpolate the family at abscissas (k,): return second coordinate / first, flight time,
        Omega and dOmega/ds, (4, k).
        """
        panels = numpy.searchsorted([self._panel_edge(k) for k in range(1, len(self._panels))], s)
        offset = s[:, None] - self._panels[panels, :, 0]
        offset[offset == 0] = 2.0**-80  # at a node only its own value counts
        ratios = self._weights / offset
        ratios /= ratios.sum(axis=1, keepdims=True)
        by_panel = self._panels[:, :, [1, 2, 3, 6]].transpose(2, 0, 1)
        # Without the middle the sum rounds only the variation on the panel.
        middle = by_panel[:, :, self.nodes_per_panel // 2]
        return middle[:, panels] + ((by_panel - middle[:, :, None])[:, panels] * ratios).sum(
            axis=-1
        )

    @cached_property
    def folds(self) -> tuple[float, ...]:
        """The abscissas of the family's folds, at which Omega is extreme, in rising order."""
        s = numpy.linspace(self.nodes[0, 0], self.nodes[-1, 0], 4 * len(self.nodes))
        slopes = self.at(s)[3]
        turns = []
        for k in numpy.flatnonzero(slopes[:-1] * slopes[1:] < 0):
            low, high = s[k], s[k + 1]
            while (middle := (low + high) / 2) not in (low, high):
                beyond = self.at(numpy.array([middle]))[3, 0] * slopes[k] <= 0
                low, high = (low, middle) if beyond else (middle, high)
            turns.append(float(middle))
        return tuple(turns)

    def distance_to_fold(self, s: Array) -> Any:
        """Return the distance of cycles from the family's nearest fold, in the first coordinate
        [rad].

        The cycles are given by abscissas (k,). The distance is infinite if there is no fold.
        """
        folds = numpy.array([*self.folds, numpy.inf])
        return numpy.abs(s[:, None] - folds).min(axis=1) * self.coordinate_rate(s)

    @property
    def ends_and_folds(self) -> tuple[float, ...]:
        """The abscissas of the family's ends and folds. Between two of them Omega is monotonic."""
        s = self.nodes[:, 0]
        return (float(s[0]), *self.folds, float(s[-1]))

    @property
    def omega_falls(self) -> list[bool]:
        """A list with True for each piece of the family on which Omega falls with s, otherwise
        False.

        Where Omega falls, cycles are stable.
        """
        omega = self.at(numpy.array(self.ends_and_folds))[2]
        return [bool(end < begin) for begin, end in pairwise(omega)]

    @cached_property
    def _inversion_samples(self) -> list[tuple[Array, Array]]:
        """Samples of the family from which Omega(s) is inverted: Omega in rising order, and s, for
        each piece.
        """
        samples = []
        for low, high in pairwise(self.ends_and_folds):
            # Closer together towards both ends, at which Omega may be flat.
            s = (low + high) / 2 - (high - low) / 2 * numpy.cos(
                numpy.linspace(0, numpy.pi, 2 * len(self.nodes))
            )
            omega = self.at(s)[2]
            samples.append((omega, s) if omega[-1] > omega[0] else (omega[::-1], s[::-1]))
        return samples

    def abscissas_at_speeds(self, omegas: Array) -> Any:
        """Return the abscissas s of the family's cycles at given speeds, one for each piece of the
        family.

        Args:
            omegas: The speeds (n,) [rad/s].

        Returns:
            The abscissas (pieces, n); NaN if a piece does not reach the speed.
        """
        rows = []
        for (speeds, abscissas_at_speeds), (low, high) in zip(
            self._inversion_samples, pairwise(self.ends_and_folds), strict=True
        ):
            s = numpy.interp(omegas, speeds, abscissas_at_speeds, left=numpy.nan, right=numpy.nan)
            inside = numpy.isfinite(s)
            root, wanted = s[inside], omegas[inside]
            # Next to a fold each of the first steps only halves the error
            for _ in range(_MAX_STEPS):
                before, (_, _, omega, slope) = root, self.at(root)
                with numpy.errstate(divide="ignore", invalid="ignore"):
                    root = numpy.clip(
                        numpy.nan_to_num(root - (omega - wanted) / slope, nan=low), low, high
                    )
                if not (numpy.abs(root - before) > _SETTLED).any():
                    break
            s[inside] = root
            rows.append(s)
        return numpy.stack(rows)

    def guesses(self, omega: float) -> Iterator[CycleGuess]:
        """Yield approximations (`CycleGuess`) of the family's cycles at a speed [rad/s], from the
        smallest first coordinate on.
        """
        for piece, (s,) in enumerate(self.abscissas_at_speeds(numpy.array([omega]))):
            if math.isfinite(s):
                yield self.guess(float(s), piece)

    def guess(self, s: float, piece: int = 0) -> CycleGuess:
        """Return an approximation (`CycleGuess`) of the family's cycle at an abscissa on a piece."""
        ratio, flight_time, omega, _ = (float(value) for value in self.at(numpy.array([s]))[:, 0])
        first = float(self.coordinate(s))
        return CycleGuess(
            (first, ratio * first), omega, piece, self.omega_falls[piece], flight_time
        )


def _powers_and_rates(x: Array, degree: int) -> tuple[Array, Array]:
    """Return the matrices that map a polynomial's coefficients to its values and derivatives at x
    (n,).
    """
    powers = numpy.vander(x, degree + 1)
    rates = numpy.zeros_like(powers)
    rates[:, :-1] = powers[:, 1:] * numpy.arange(degree, 0, -1)
    return powers, rates


def _discontinuous_rows(new: Array, rows: Array) -> Any:
    """Return a mask (n,) of the new rows that do not continue the family from the row before.

    In such a row at least two values do not change as the slopes predict. Over so short a way the
    trapezoidal rule is off by a few percent of the change on a family; on another orbit it is off
    by all of it. A row after such a row is masked as well.
    """
    chain = numpy.concatenate((rows[-1:], new))
    step = numpy.diff(chain[:, 0])[:, None]
    change, slopes = numpy.diff(chain[:, 1:4], axis=0), chain[:, 4:]
    off = numpy.abs(change - step * (slopes[1:] + slopes[:-1]) / 2)
    size = numpy.abs(change) + step * numpy.maximum(numpy.abs(slopes[1:]), numpy.abs(slopes[:-1]))
    with numpy.errstate(invalid="ignore"):
        broken = (off > _MAX_MISFIT * size + 1e-9 * numpy.abs(chain[1:, 1:4])).sum(axis=1) >= 2
    return numpy.logical_or.accumulate(broken)


# -------------------------------------------------------------------------------------- the solvers
def batch_solver(
    section: Section[Any], parameters: Parameters, batch_engine: BatchTaylor
) -> Solver:
    """Return a function that solves for many limit cycles of given first coordinates at once.

    It runs Newton's iteration on all flights together. The second coordinate, the flight time and
    Omega are the unknowns.

    Args:
        section: The section.
        parameters: The disk, under the linear law.
        batch_engine: The engine of the flights.
    """
    return partial(_solve_batch, section, equation_constants(parameters), batch_engine)


def _solve_batch(
    section: Section[Any], constants: Array, batch_engine: BatchTaylor, *guess: Array
) -> SolvedCycles:
    *start, omega = guess
    cycles = shoot_batch(
        section,
        constants,
        omega,
        start,
        batch_engine,
        all_numbers=False,
        tolerance=1e-8,
        free_omega=True,
    )
    first, second = section.coordinate_names
    slope, flights = 1 / cycles[f"d{first}_domega"], section.flights_per_period
    return SolvedCycles(
        second=cycles[second],
        flight_time=cycles["period"] / flights,
        omega=cycles["omega"],
        second_slope=cycles[f"d{second}_domega"] * slope,
        flight_time_slope=cycles["dperiod_domega"] / flights * slope,
        omega_slope=slope,
    )


def sequential_solver(section: Section[Any], parameters: Parameters, engine: Engine) -> Solver:
    """Return a function that solves for limit cycles of given first coordinates, one after the
    other.

    It runs Newton's iteration on the return map. The second coordinate and Omega are the unknowns.

    Args:
        section: The section.
        parameters: The disk and its friction law.
        engine: The engine of the flights.
    """

    def solve(first: Array, second: Array, flight_time: Array, omega: Array) -> SolvedCycles:
        rows = numpy.full((len(first), len(SolvedCycles._fields)), numpy.nan)
        for index, (x, *guess) in enumerate(
            zip(first.tolist(), second.tolist(), omega.tolist(), strict=True)
        ):
            try:
                rows[index] = _solve_one(section, parameters, engine, x, *guess)
            except NoSuchCycleError:
                break
        return SolvedCycles(*rows.T)

    return solve


def _solve_one(
    section: Section[Any], parameters: Parameters, engine: Engine, x: float, y: float, omega: float
) -> Any:
    held = f"the iteration at fixed {section.coordinate_names[0]}"

    def size(iterate: Iterate[Any]) -> float:
        _, second, speed = iterate.next_point
        if not 0 < speed < math.inf:
            raise NoSuchCycleError(f"{held} left the positive speeds")
        return float(abs(iterate.step[1] / second) + abs(iterate.step[2] / speed))

    stop = StoppingRule(10, NoSuchCycleError(f"{held} does not settle"), tolerance=_SETTLED)
    found = newton(
        ReturnMap(section, parameters, omega, engine),
        (x, y),
        stop,
        size,
        fixed_quantity="coordinate",
    )
    (_, second, speed), (_, second_slope, omega_slope, flight_slope) = (
        found.next_point,
        found.image.slopes("coordinate"),
    )
    return second, found.image.time, speed, second_slope, flight_slope, omega_slope
