"""Many cycles of a family at once: predicted by polynomials through its nodes, and corrected by
`batch_shooting`.

**The cycles.** All numbers of a family's cycles at its nodes are solved to rounding. Omega(s) is
inverted piece by piece, so that a speed at which two cycles coexist gives both.

**The half-widths.** docs/error_budgets.md derives them. On every fourth node of the family, and at
both ends, the cycle is solved again a few times with other last bits of the constants. Each
solution starts from the one before (the twins of `error_budget`, in lanes). The largest spread of
three neighbours measures rounding, that of the parameters included.

**Interpolation.** A number that has a pole at a fold is multiplied by a factor that vanishes there.
Between those nodes spreads are interpolated by chords. Chords lie above a function that grows like
a power of Omega - Omega_h, and hold one that vanishes at Omega_crit.

**Derivatives.** Numbers that follow from derivatives are taken before the last Newton step. Their
change with the start is measured as well, by starts moved much farther than rounding moves them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy

from tippedisk_verify.cycles.families.batch_shooting import BatchCycles, shoot_batch
from tippedisk_verify.cycles.families.family import Family
from tippedisk_verify.cycles.shooting.cycle_numbers import number_names
from tippedisk_verify.cycles.shooting.error_budget import cycle_from_numbers
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.flow.batch import BatchTaylor, equation_constants
from tippedisk_verify.numbers.arrays import Array
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.precision import DOUBLE

__all__ = ["FamilyInterpolant"]

# The error of the first coordinate, relative to its distance from a fold, from which on the error
# is no longer linear.
_NONLINEAR_ERROR = 0.05
#: The twins of a node. With the node itself they give nine values on each of three neighbouring
#: nodes.
NODE_TWINS = 8
#: The half-width in units of the largest of three spreads of nine values. For normal errors an
#: error beyond it has a probability of 2e-8, and one beyond half of it 2e-4: a branch has thousands
#: of numbers. The half-width is 13 times the error in the median. Five twins with a factor of 3.5
#: have the same risk, but half-widths a quarter wider that scatter more.
NODE_TWIN_FACTOR = 2.5
_ROUNDING_SPACING = 4  # the spacing, in nodes, of those where rounding is measured
# The share of the constants that a twin moves up; as many move down. Each then errs by half a
# place, as by rounding.
_MOVED_SHARE = 1 / 8
# The displacement of a start, relative to the distance from the nearer end. It is so small that
# Newton's iteration ends after one step.
_START_SHIFT = 1e-5
# A factor for the error of the derivative with respect to the start. The start's effect is linear
# but for parts of 1e-5.
_START_SLOPE_FACTOR = 2
# The order of the pole at a fold of a derivative with respect to Omega: an error of Omega counts as
# 1 / (dOmega/dx)^3.
_POLE_ORDER = 3
_UNIT_ROUNDOFF = 2.0**-53  # the unit round-off of a double


class FamilyInterpolant:
    """A family of limit cycles of the linear law, for computing cycles and half-widths at many
    speeds.

    It reaches as far as the family is followed.

    Args:
        family: The family.
        batch_engine: The engine of the flights.

    Raises:
        InputError: If the law is not linear.
        NoSuchCycleError: If one of the family's nodes is lost.
    """

    def __init__(self, family: Family, batch_engine: BatchTaylor) -> None:
        family.parameters.refuse_unless_linear("cycles in batches are")
        self.family, self._batch_engine, self._section = family, batch_engine, family.section
        self._constants = equation_constants(family.parameters)
        nodes = family.nodes.T
        self._s = nodes[0]
        first = family.coordinate(self._s)
        guess = numpy.stack((first, nodes[1] * first, nodes[2]))
        #: The cycles at the nodes of the family.
        self.nodes = self._shoot(nodes[3], guess, tolerance=1e-9, free_omega=True)
        if not self.nodes.converged.all():
            raise NoSuchCycleError(
                f"the family of {self._section.name} cycles could not be followed"
            )
        # The numbers that are taken before the last Newton step. (The fast multiplier's logarithm
        # moves with the slow one's: their sum does not come from derivatives.)
        self._by_omega = tuple(
            f"d{name}_domega" for name in ("period", *self._section.coordinate_names)
        )
        self._names_before_step = ("multiplier_slow", "log_multiplier_slow", *self._by_omega)
        self._measured = (*number_names(self._section), "log_multipliers")

    def _shoot(
        self, omegas: Array, guess: Array, constants: Any = None, **options: Any
    ) -> BatchCycles:
        constants = self._constants if constants is None else constants
        return shoot_batch(self._section, constants, omegas, guess, self._batch_engine, **options)

    # ----------------------------------------------------------------------------------- the cycles
    def cycles_at_speeds(self, omegas: Sequence[float], digits: int) -> list[list[Any] | None]:
        """Return all cycles at each speed, from the smallest first coordinate on, as objects of the
        kind that single speeds give.

        A cycle must have its period, coordinates and largest lean to ``digits`` digits. It must be
        clear of a fold, so that the multiplier shows the side of the fold.

        Args:
            omegas: The speeds [rad/s].
            digits: The significant digits that a cycle must have.

        Returns:
            A list of cycles for each speed, or None if the speed has no cycle, or has one that
            doubles do not hold.
        """
        speeds = numpy.asarray(omegas, dtype=float)
        s = self.family.abscissas_at_speeds(speeds)
        index, piece = numpy.nonzero(numpy.isfinite(s.T))
        cycles = self.solve_at_speeds(speeds[index], s[piece, index])
        widths = self.half_widths(cycles)
        held = cycles.converged
        for name in ("period", *self._section.coordinate_names, "beta_max"):
            held = held & (widths[name] <= numpy.abs(cycles[name]) * 10.0**-digits)
        measured = iter(
            self._cycles(cycles.select(held), {name: width[held] for name, width in widths.items()})
        )
        by_speed: list[list[Any]] = [[] for _ in omegas]
        for at, is_held, falls in zip(
            index.tolist(), held, numpy.array(self.family.omega_falls)[piece], strict=True
        ):
            cycle = next(measured) if is_held else None
            by_speed[at].append(cycle if cycle and cycle.stable is bool(falls) else None)
        lost = numpy.zeros(len(speeds), dtype=bool)
        for gap in self.family.unfollowed_speeds:
            lost |= (min(gap) <= speeds) & (speeds <= max(gap))
        return [
            None if missing or None in own or not own else own
            for own, missing in zip(by_speed, lost, strict=True)
        ]

    def _cycles(self, cycles: BatchCycles, widths: dict[str, Any]) -> Iterator[Any]:
        """Yield a limit cycle object for each cycle of a batch, as a single speed gives it.

        ``widths`` are the half-widths, arrays (n,) by name; the trivial multiplier's is added.
        """
        widths["trivial_multiplier_defect"] = (
            2 * cycles["trivial_multiplier_defect"] + 2 * _UNIT_ROUNDOFF
        )
        columns = [(name, cycles[name].tolist(), width.tolist()) for name, width in widths.items()]
        for index, (omega, residual) in enumerate(
            zip(cycles["omega"], cycles["residual"], strict=True)
        ):
            measured = {
                name: Measured(Fraction(values[index]), Fraction(uncertainties[index]))
                for name, values, uncertainties in columns
            }
            yield cycle_from_numbers(
                self._section,
                Fraction(omega),
                measured,
                residuals=(float(residual),),
                parameters=self.family.parameters,
                engine="lanes",
                precision=DOUBLE.name,
            )

    def solve_at_speeds(self, speeds: Array, s: Array) -> BatchCycles:
        """Solve for the limit cycles at given speeds, by Newton's iteration from the interpolated
        family.

        Args:
            speeds: The speeds (n,) [rad/s].
            s: Abscissas (n,) next to them.
        """
        first, (ratio, flight_time, _, slope) = self.family.coordinate(s), self.family.at(s)
        # The relative step after which only rounding is left grows towards Omega_h and towards a
        # fold.
        resolved = 1e-11 * numpy.maximum(1.0, 4e-4 / numpy.abs(slope))
        cycles = self._shoot(
            speeds, numpy.stack((first, ratio * first, flight_time)), tolerance=resolved
        )
        # Next to a fold the iteration may have gone beyond it.
        cycles.converged[slope * cycles[f"d{self._section.coordinate_names[0]}_domega"] < 0] = False
        return cycles

    # ------------------------------------------------------------------------------ the half-widths
    def half_widths(self, cycles: BatchCycles) -> dict[str, Any]:
        """Return half-widths that hold the true values, for each number of n cycles on this family.

        Args:
            cycles: The cycles.

        Returns:
            The half-widths (n,) by name. They are infinite next to a fold, where errors in double
            reach beyond it.
        """
        s = self.family.abscissa(cycles.coordinate)
        nodes, spreads, slopes = self._node_errors
        last, widths = numpy.abs(cycles.last_step).T, dict[str, Any]()
        for name in self._measured:
            pole = self._pole_factors(name, cycles)
            spread = numpy.interp(s, nodes, spreads[name]) / pole
            widths[name] = NODE_TWIN_FACTOR * spread + 2 * _UNIT_ROUNDOFF * numpy.abs(cycles[name])
            for slope, step in zip(slopes.get(name, ()), last, strict=False):
                widths[name] += _START_SLOPE_FACTOR * numpy.interp(s, nodes, slope) / pole * step
        for name in ("log_multiplier_slow", "log_multiplier_fast"):
            widths[name] += 4 * _UNIT_ROUNDOFF  # of the multiplier, relative
        lost = widths[
            self._section.coordinate_names[0]
        ] > _NONLINEAR_ERROR * self.family.distance_to_fold(s)
        return {name: numpy.where(lost, numpy.inf, width) for name, width in widths.items()}

    def _pole_factors(self, name: str, cycles: BatchCycles) -> Any:
        """Return the factors (n,) by which a number's spread is multiplied before it is
        interpolated.

        They vanish at a fold, where the spread has a pole.
        """
        return cycles.slope ** (_POLE_ORDER if name in self._by_omega else 1)

    @cached_property
    def _node_errors(self) -> tuple[Any, dict[str, Any], dict[str, list[Any]]]:
        """The data from which half-widths are interpolated: abscissas (k,) in rising order, the
        scatter of each number there, and its change with the start.

        The scatter and changes are multiplied by the factors of `_pole_factors`.
        """
        from scipy.ndimage import maximum_filter1d

        # Both ends among them: towards the Hopf point sensitivities grow without bound.
        every = numpy.append(numpy.arange(len(self._s) - 1, 0, -_ROUNDING_SPACING), 0)[::-1]
        nodes = self.nodes.select(every)
        omegas, start = nodes["omega"], nodes.guess
        poles = {name: self._pole_factors(name, nodes) for name in self._measured}
        values = {name: [nodes[name]] for name in self._measured}
        random, guess = numpy.random.default_rng(1), start
        for _ in range(NODE_TWINS):
            draws = random.random((len(every), len(self._constants)))
            moves = (draws < _MOVED_SHARE).astype(float) - (draws >= 1 - _MOVED_SHARE)
            twins = self._shoot(
                omegas, guess, self._constants * (1 + moves * 2 * _UNIT_ROUNDOFF), tolerance=1e-5
            )
            guess = twins.guess
            for name, of_twins in values.items():
                of_twins.append(twins[name])
        spreads = {
            name: numpy.ptp(numpy.stack(of_twins), axis=0) * poles[name]
            for name, of_twins in values.items()
        }
        slopes: dict[str, list[Any]] = {name: [] for name in self._names_before_step}
        shift = _START_SHIFT * self._distances_to_end[every] / omegas * numpy.abs(start)
        for index in range(3):
            guess = start.copy()
            guess[index] += shift[index]
            shifted = self._shoot(omegas, guess, tolerance=1e-5, all_numbers=False)
            for name in self._names_before_step:
                slopes[name].append(
                    numpy.abs(shifted[name] - nodes[name]) / shift[index] * poles[name]
                )
        slopes["log_multiplier_fast"] = slopes["log_multiplier_slow"]
        # A node next to a fold is lost at its speed. The interpolated numbers are smooth there.
        rows = [*spreads.values(), *(slope for of_name in slopes.values() for slope in of_name)]
        solved = numpy.isfinite(rows).all(axis=0)
        spreads = {
            name: maximum_filter1d(spread[solved], 3, mode="nearest")
            for name, spread in spreads.items()
        }
        slopes = {name: [slope[solved] for slope in of_name] for name, of_name in slopes.items()}
        return self._s[every][solved], spreads, slopes

    @property
    def _distances_to_end(self) -> Any:
        """The distance [rad/s] of each of the family's nodes from the nearest end of its piece, as
        predicted by its slope.

        An end is the Hopf point, a fold or the connection.
        """
        slope = numpy.abs(self.family.nodes[:, 6])
        bend = numpy.abs(numpy.gradient(self.family.nodes[:, 6], self._s))
        way = numpy.minimum(
            numpy.minimum((self._s - self.family.origin) / 2, 0.25), slope / (2 * bend)
        )
        return slope * way
