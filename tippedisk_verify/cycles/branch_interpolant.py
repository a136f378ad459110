"""The branch of limit cycles as a function of Omega, with its own error.

All numbers of the cycles are polynomials along the `amplitude_family`, from the Hopf point through any folds to the
connection. Omega(s) is inverted piece by piece, so that a speed at which two cycles coexist gives both. A list of any
length is predicted by the polynomials and corrected in one step of all lanes.

What is claimed for a number is the subject of `branch_budget`; for interpolated numbers the truncation is added.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy

from tippedisk_verify.cycles.amplitude_family import NODES, AmplitudeFamily, Solved, Solver, amplitude
from tippedisk_verify.cycles.batch_shooting import LIBRATING, Cycles, Guess, corrected, measured_cycles
from tippedisk_verify.cycles.branch_budget import BranchBudget, multiplier_widths
from tippedisk_verify.cycles.shooting import LimitCycle
from tippedisk_verify.errors import InputError, NoSuchCycleError, Shortfall
from tippedisk_verify.flow.lanes import BatchTaylor, field_constants
from tippedisk_verify.model.arrays import Array
from tippedisk_verify.model.exact import shown
from tippedisk_verify.model.measured import DISTANCES
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.results import Printable

__all__ = ["BranchInterpolant", "Values", "all_at_once"]

_UNIT = 2.0**-53
_LEFT_OUT = 1 / 1000  # of the branch, at either end, if no bounds are given
_CLOSEST = 1e-5  # rad/s; how near Omega_h is followed for want of bounds
_POLE = 3  # of derivatives by Omega at a fold, where each error of Omega counts as 1 / (dOmega/da)^3
_FLAT = 0.05  # of the way in amplitude to a fold, an error that is no longer linear
_FAR_OFF = 1e-6  # rad/s; a limit farther from the given Omega_h is another connection's

#: The numbers that are interpolated, each divided by this power of the amplitude.
_POWERS = {"v_0": 1, "beta_max": 1, "period": 0, "log_multipliers": 0}


@dataclass(frozen=True, repr=False)
class Values(Printable):
    """Interpolated numbers of n cycles as (n,) arrays, and their half-widths under the same names."""

    omega: Array  #: [rad/s]
    period: Array  #: T [s]
    gamma_bar_0: Array  #: [rad]
    v_0: Array  #: [rad/s]
    beta_max: Array  #: [rad]
    log_multiplier_slow: Array
    log_multiplier_fast: Array
    uncertainty: dict[str, Any]


class BranchInterpolant(Printable):
    """The branch of the linear law's limit cycles from the Hopf point to the connection at ``omega_h``, in double.

    Where it turns round in a fold, a speed has several cycles: answers list them from the smallest amplitude on, speed
    after speed. ``lowest`` and ``highest`` [rad/s] bound where it may be asked; by default a thousandth of the branch
    is left out at either end. Raises InputError for bounds outside the branch or where it does not end at ``omega_h``,
    NoSuchCycleError where it cannot be followed.
    """

    told = ("omega_crit", "omega_h", "lowest", "highest")

    def __init__(
        self,
        parameters: Parameters,
        lanes: BatchTaylor,
        omega_h: float,
        *,
        lowest: float | None = None,
        highest: float | None = None,
    ) -> None:
        parameters.refuse_smooth("the branch interpolant is")
        self.parameters, self._lanes, self.omega_h = parameters, lanes, omega_h
        self._constants = field_constants(parameters)
        if not 0 < omega_h < math.inf:
            raise InputError(f"Omega_h is a positive speed, not {shown(omega_h)}")
        closest = self._closest(lowest, highest)
        self._family = AmplitudeFamily(parameters, solve=all_at_once(parameters, lanes), closest=closest)
        self.omega_crit = self._family.omega_crit
        self._check_limit()
        turns = [self._family.place(s).omega for s in self._family.folds]
        ends = (self.omega_crit, *turns, omega_h)
        margin = (max(ends) - min(ends)) * _LEFT_OUT
        self.lowest = min(ends) + margin if lowest is None else lowest
        self.highest = max(ends) - margin if highest is None else highest
        if not min(ends) < self.lowest <= self.highest < max(ends):
            raise InputError(
                f"the branch lies between {min(ends):.10g} and {max(ends):.10g} rad/s: its bounds must too"
            )
        nodes = self._family.nodes
        #: The cycles at the nodes of the family, from the Hopf point on.
        self.nodes: Cycles = corrected(
            self._constants,
            nodes[:, 3],
            Guess(amplitude(nodes[:, 0]), nodes[:, 1] * amplitude(nodes[:, 0]), nodes[:, 2]),
            lanes,
            tolerance=1e-9,
            free_omega=True,
        )
        if not self.nodes.converged.all():
            raise NoSuchCycleError("the family of limit cycles could not be followed")
        self._s = nodes[:, 0]

    def _closest(self, *bounds: float | None) -> float:
        """How near its limit the family has to be followed."""
        near = [abs(bound - self.omega_h) for bound in bounds if bound is not None and bound != self.omega_h]
        return 0.9 * min([*near, max(_CLOSEST, _LEFT_OUT * abs(self._omega_crit() - self.omega_h))])

    def _omega_crit(self) -> float:
        from tippedisk_verify.theory.hopf import omega_crit

        return float(omega_crit(self.parameters))

    def _check_limit(self) -> None:
        limit = self._family.limit
        if not self._family.connected:
            raise NoSuchCycleError(f"the branch is followed to {limit:.7g} rad/s only, where gamma's amplitude is pi")
        if abs(limit - self.omega_h) > _FAR_OFF + abs(limit - self._family.nodes[-1, 3]):
            raise InputError(f"the branch ends near {limit:.8g} rad/s, not at Omega_h = {shown(self.omega_h)}")

    # -------------------------------------------------------------------------------------------- the errors
    @cached_property
    def _budget(self) -> BranchBudget:
        s, slope = self._s, numpy.abs(self._family.nodes[:, 6])
        bend = numpy.abs(numpy.gradient(self._family.nodes[:, 6], s))
        # The way to the Hopf point, to a fold and to the connection, each as the slope there foretells it.
        room = slope * numpy.minimum(numpy.minimum(s / 2, 0.25), slope / (2 * bend))
        return BranchBudget(
            self._constants, self.nodes, s, room, self._lanes, scale=lambda cycles, _: _slope(cycles), pole=_POLE
        )

    def half_widths(self, cycles: Cycles) -> dict[str, Array]:
        """For each number of cycles on this branch the half-width that holds the truth, as (n,) arrays.

        Infinite next to a fold, where errors in double reach beyond it.
        """
        s = numpy.arctanh(cycles.gamma_bar_0 / numpy.pi)
        widths = self._budget.all_half_widths(cycles, s)
        lost = widths["gamma_bar_0"] > _FLAT * self._to_fold(s)
        return {name: numpy.where(lost, numpy.inf, width) for name, width in widths.items()}

    def _to_fold(self, s: Array) -> Any:
        """How far from a fold the amplitude is [rad]."""
        folds = numpy.array([*self._family.folds, numpy.inf])
        away = numpy.abs(numpy.arctanh(numpy.tanh(s)[:, None]) - folds)  # NaN for cycles that were not found
        return away.min(axis=1) * numpy.pi / numpy.cosh(s) ** 2

    # -------------------------------------------------------------------------------------------- what it gives
    def __call__(self, omegas: Sequence[float]) -> Values:
        """Interpolated numbers, each with a half-width that holds the truth.

        Raises InputError outside the bounds, Shortfall too close to the Hopf point or the connection.
        """
        speeds, s = self._places(omegas)
        ratios, panels = self._family.ratios(s)
        slope = numpy.abs(self._family.at(s)[3]) * numpy.cosh(s) ** 2 / numpy.pi
        values, widths = self._between(s), {}
        for name, (_, width) in self._scaled.items():
            # The parameters' rounding moves all nodes alike, and the polynomial with them; each node's own round-off is
            # independent of the others'. One width is for both, whichever prevails.
            moved = numpy.interp(s, self._s, width)
            own = (width.reshape(-1, NODES)[panels] ** 2 * ratios**2).sum(axis=1)
            error = (numpy.sqrt(moved**2 + own) + self._truncation[name][panels]) / slope
            widths[name] = error + 4 * _UNIT * numpy.abs(values[name])
        lost = widths["gamma_bar_0"] > _FLAT * self._to_fold(s)
        half, both = values.pop("map_multiplier"), values.pop("log_multipliers")
        of_multipliers = multiplier_widths(half, both, widths.pop("map_multiplier"), widths.pop("log_multipliers"))
        del of_multipliers["multiplier_slow"]
        log_slow = 2 * numpy.log(numpy.abs(half))
        return Values(
            omega=speeds,
            log_multiplier_slow=log_slow,
            log_multiplier_fast=both - log_slow,
            uncertainty={
                name: numpy.where(lost, numpy.inf, width) for name, width in (widths | of_multipliers).items()
            },
            **values,
        )

    @cached_property
    def _scaled(self) -> dict[str, tuple[Any, Any]]:
        """Node values of what is analytic along the family, and the numbers' half-widths there times dOmega/da."""
        widths, slope = self._budget.half_widths(self.nodes, self._s), _slope(self.nodes)
        return {name: (value, widths[name] * slope) for name, value in self._analytic(self.nodes).items()}

    def _analytic(self, cycles: Cycles) -> dict[str, Any]:
        """Those of the cycles' numbers that are interpolated, made analytic up to the Hopf point."""
        a = cycles.gamma_bar_0
        scaled = {name: getattr(cycles, name) / a**power for name, power in _POWERS.items()}
        return {"gamma_bar_0": a, "map_multiplier": (1 - cycles.map_multiplier) / a**2} | scaled

    def _between(self, s: Array) -> dict[str, Any]:
        """The interpolated numbers at abscissas."""
        a = amplitude(s)
        scaled = numpy.stack([scaled for scaled, _ in self._scaled.values()])
        values: dict[str, Any] = dict(zip(self._scaled, self._family.between_nodes(s, scaled), strict=True))
        values |= {name: values[name] * a**power for name, power in _POWERS.items() if power}
        return values | {"gamma_bar_0": a, "map_multiplier": 1 - values["map_multiplier"] * a**2}

    @cached_property
    def _truncation(self) -> dict[str, Any]:
        """What the polynomials leave out, times dOmega/da, on each panel.

        It is twice their largest distance from cycles that are solved midway between the panel's nodes.
        """
        nodes = self._s.reshape(-1, NODES)
        middles = ((nodes[:, 1:] + nodes[:, :-1]) / 2).ravel()
        solved = self._solved_at(self._family.at(middles)[2], middles)
        widest = {}
        for name, value in self._between(middles).items():
            away = numpy.abs(value - getattr(solved, name)) * _slope(solved)
            # Next to a fold the cycle is not found at its speed; the panel's others are told.
            widest[name] = DISTANCES * numpy.nan_to_num(away).reshape(len(nodes), -1).max(axis=1)
        return widest

    def _places(self, omegas: Sequence[float]) -> tuple[Array, Array]:
        """The speed and the abscissa of each cycle.

        Raises InputError for speeds outside the bounds, Shortfall for those too close to an end of the family.
        """
        speeds = numpy.atleast_1d(numpy.asarray(omegas, dtype=float))
        outside = speeds[~((speeds >= self.lowest) & (speeds <= self.highest))]
        if len(outside):
            raise InputError(
                f"{outside[0]:.10g} rad/s lies outside the branch's bounds {self.lowest:.10g} ... {self.highest:.10g}"
            )
        first, last = self._family.nodes[[0, -1], 3]
        for name, end, reached in (("Omega_crit", self.omega_crit, first), ("Omega_h", self.omega_h, last)):
            beyond = speeds[(speeds - reached) * (speeds - end) <= 0]
            if len(beyond):
                raise Shortfall(f"{beyond[0]:.12g} rad/s is too close to {name} for the branch in double")
        s = self._family.abscissas(speeds)
        index, piece = numpy.nonzero(numpy.isfinite(s.T))
        return speeds[index], s[piece, index]

    def cycles(self, omegas: Sequence[float]) -> Cycles:
        """The cycles at these speeds, corrected by Newton's iteration. Raises as a call does."""
        return self._solved_at(*self._places(omegas))

    def _solved_at(self, speeds: Array, s: Array) -> Cycles:
        ratio, half, _, slope = self._family.at(s)
        a = amplitude(s)
        # The relative step after which only rounding is left grows as Omega_h or a fold comes near.
        flat = numpy.abs(slope) * numpy.cosh(s) ** 2 / numpy.pi
        resolved = 1e-11 * numpy.maximum(1.0, 1e-4 / numpy.minimum(numpy.abs(speeds - self.omega_h), flat))
        guess = Guess(a, ratio * a, half)
        cycles: Cycles = corrected(self._constants, speeds, guess, self._lanes, tolerance=resolved)
        # Next to a fold the iteration may have gone beyond it.
        other = slope * cycles.dgamma_bar_0_domega < 0
        if other.any():
            cycles.converged[other] = False
        return cycles

    def limit_cycles(self, omegas: Sequence[float]) -> list[LimitCycle]:
        """`cycles` as the result objects that single speeds give.

        Raises NoSuchCycleError if one has not converged, or is too close to a fold for doubles.
        """
        solved = self.cycles(omegas)
        widths = self.half_widths(solved)
        held = solved.converged & numpy.isfinite(widths["gamma_bar_0"])
        if not held.all():
            lost = solved.omega[~held][0]
            raise NoSuchCycleError(f"the iteration has not converged at {lost:.10g} rad/s")
        cycles: list[LimitCycle] = measured_cycles(solved, widths, LIBRATING, self.parameters)
        return cycles


def _slope(cycles: Any) -> Any:
    """|dOmega/da|."""
    return 1 / numpy.abs(cycles.dgamma_bar_0_domega)


def all_at_once(parameters: Parameters, lanes: BatchTaylor) -> Solver:
    """Newton's iteration on the half maps of all amplitudes, with v, T and Omega as the unknowns."""
    return partial(_solved, field_constants(parameters), lanes)


def _solved(constants: Array, lanes: BatchTaylor, gamma_bar: Array, v: Array, half: Array, omega: Array) -> Solved:
    guess = Guess(gamma_bar, v, half)
    found = corrected(constants, omega, guess, lanes, whole=False, tolerance=1e-8, free_omega=True)
    slope = 1 / found.dgamma_bar_0_domega
    return Solved(
        found.v_0, found.period / 2, found.omega, found.dv_0_domega * slope, found.dperiod_domega / 2 * slope, slope
    )
