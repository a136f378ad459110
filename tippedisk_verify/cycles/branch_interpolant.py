"""The branch of librating limit cycles as a function of Omega, with its own error.

All numbers of the cycles are polynomials along the `librating_family`. For interpolated numbers the truncation is added
to the budget of corrected ones, see `interpolant`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy

from tippedisk_verify.cycles.batch_shooting import BatchCycles
from tippedisk_verify.cycles.branch_budget import multiplier_widths
from tippedisk_verify.cycles.family import in_batches
from tippedisk_verify.cycles.interpolant import FamilyInterpolant
from tippedisk_verify.cycles.librating_family import LibratingFamily, amplitude
from tippedisk_verify.cycles.limit_cycle import LimitCycle
from tippedisk_verify.cycles.section import LIBRATING
from tippedisk_verify.errors import InputError, NoSuchCycleError, Shortfall
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.lanes import BatchTaylor
from tippedisk_verify.model.arrays import Array
from tippedisk_verify.model.exact import shown
from tippedisk_verify.model.measured import DISTANCES
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.results import Printable
from tippedisk_verify.theory.hopf import omega_crit

__all__ = ["BranchInterpolant", "Values"]

_UNIT = 2.0**-53
_LEFT_OUT = 1 / 1000  # of the branch, at either end, if no bounds are given
_CLOSEST = 1e-5  # rad/s; how near Omega_h is followed for want of bounds
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


class BranchInterpolant(FamilyInterpolant, Printable):
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
        self.parameters, self.omega_h = parameters, omega_h
        if not 0 < omega_h < math.inf:
            raise InputError(f"Omega_h is a positive speed, not {shown(omega_h)}")
        closest = self._closest(lowest, highest)
        solve = in_batches(LIBRATING, parameters, lanes)
        self.family: LibratingFamily = LibratingFamily(parameters, default_engine(), solve, closest)
        self.omega_crit = self.family.omega_crit
        self._check_limit()
        turns = [self.family.place(s).omega for s in self.family.folds]
        ends = (self.omega_crit, *turns, omega_h)
        margin = (max(ends) - min(ends)) * _LEFT_OUT
        self.lowest = min(ends) + margin if lowest is None else lowest
        self.highest = max(ends) - margin if highest is None else highest
        if not min(ends) < self.lowest <= self.highest < max(ends):
            raise InputError(
                f"the branch lies between {min(ends):.10g} and {max(ends):.10g} rad/s: its bounds must too"
            )
        super().__init__(self.family, lanes)

    def _closest(self, *bounds: float | None) -> float:
        """How near its limit the family has to be followed."""
        near = [abs(bound - self.omega_h) for bound in bounds if bound is not None and bound != self.omega_h]
        return 0.9 * min([*near, max(_CLOSEST, _LEFT_OUT * abs(float(omega_crit(self.parameters)) - self.omega_h))])

    def _check_limit(self) -> None:
        limit = self.family.limit
        if not self.family.connected:
            raise NoSuchCycleError(f"the branch is followed to {limit:.7g} rad/s only, where gamma's amplitude is pi")
        if abs(limit - self.omega_h) > _FAR_OFF + abs(limit - self.family.nodes[-1, 3]):
            raise InputError(f"the branch ends near {limit:.8g} rad/s, not at Omega_h = {shown(self.omega_h)}")

    # -------------------------------------------------------------------------------------------- what it gives
    def __call__(self, omegas: Sequence[float]) -> Values:
        """Interpolated numbers, each with a half-width that holds the truth.

        Raises InputError outside the bounds, Shortfall too close to the Hopf point or the connection.
        """
        speeds, s = self._places(omegas)
        ratios, panels = self.family.ratios(s)
        slope = numpy.abs(self.family.at(s)[3]) / self.family.coordinate_rate(s)
        values, widths = self._between(s), {}
        for name, (_, width) in self._scaled.items():
            # The parameters' rounding moves all nodes alike, and the polynomial with them; each node's own round-off is
            # independent of the others'. One width is for both, whichever prevails.
            moved = numpy.interp(s, self._s, width)
            own = (width.reshape(-1, self.family.nodes_per_panel)[panels] ** 2 * ratios**2).sum(axis=1)
            error = (numpy.sqrt(moved**2 + own) + self._truncation[name][panels]) / slope
            widths[name] = error + 4 * _UNIT * numpy.abs(values[name])
        half, both = values.pop("map_multiplier"), values.pop("log_multipliers")
        of_multipliers = multiplier_widths(half, both, widths.pop("map_multiplier"), widths.pop("log_multipliers"), 2)
        del of_multipliers["multiplier_slow"]
        log_slow = 2 * numpy.log(numpy.abs(half))
        return Values(
            omega=speeds,
            log_multiplier_slow=log_slow,
            log_multiplier_fast=both - log_slow,
            uncertainty=self._unless_next_to_a_fold(widths | of_multipliers, s),
            **values,
        )

    @cached_property
    def _scaled(self) -> dict[str, tuple[Any, Any]]:
        """Node values of what is analytic along the family, and the numbers' half-widths there times dOmega/da."""
        widths, slope = self._budget.half_widths(self.nodes, self._s), self.nodes.slope
        return {name: (value, widths[name] * slope) for name, value in self._analytic(self.nodes).items()}

    def _analytic(self, cycles: BatchCycles) -> dict[str, Any]:
        """Those of the cycles' numbers that are interpolated, made analytic up to the Hopf point."""
        a = cycles.coordinate
        scaled = {name: cycles[name] / a**power for name, power in _POWERS.items()}
        return {"gamma_bar_0": a, "map_multiplier": (1 - cycles["map_multiplier"]) / a**2} | scaled

    def _between(self, s: Array) -> dict[str, Any]:
        """The interpolated numbers at abscissas."""
        a = amplitude(s)
        scaled = numpy.stack([scaled for scaled, _ in self._scaled.values()])
        values: dict[str, Any] = dict(zip(self._scaled, self.family.between_nodes(s, scaled), strict=True))
        values |= {name: values[name] * a**power for name, power in _POWERS.items() if power}
        return values | {"gamma_bar_0": a, "map_multiplier": 1 - values["map_multiplier"] * a**2}

    @cached_property
    def _truncation(self) -> dict[str, Any]:
        """What the polynomials leave out, times dOmega/da, on each panel.

        It is twice their largest distance from cycles that are solved midway between the panel's nodes.
        """
        nodes = self._s.reshape(-1, self.family.nodes_per_panel)
        middles = ((nodes[:, 1:] + nodes[:, :-1]) / 2).ravel()
        solved = self.solved(self.family.at(middles)[2], middles)
        widest = {}
        for name, value in self._between(middles).items():
            distance = numpy.abs(value - solved[name]) * solved.slope
            # Next to a fold the cycle is not found at its speed; the panel's others are told.
            widest[name] = DISTANCES * numpy.nan_to_num(distance).reshape(len(nodes), -1).max(axis=1)
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
        first, last = self.family.nodes[[0, -1], 3]
        for name, end, reached in (("Omega_crit", self.omega_crit, first), ("Omega_h", self.omega_h, last)):
            beyond = speeds[(speeds - reached) * (speeds - end) <= 0]
            if len(beyond):
                raise Shortfall(f"{beyond[0]:.12g} rad/s is too close to {name} for the branch in double")
        s = self.family.abscissas(speeds)
        index, piece = numpy.nonzero(numpy.isfinite(s.T))
        return speeds[index], s[piece, index]

    def cycles(self, omegas: Sequence[float]) -> BatchCycles:
        """The cycles at these speeds, corrected by Newton's iteration. Raises as a call does."""
        return self.solved(*self._places(omegas))

    def limit_cycles(self, omegas: Sequence[float]) -> list[LimitCycle]:
        """The same as the result objects that single speeds give.

        Raises NoSuchCycleError if one has not converged, or is too close to a fold for doubles.
        """
        speeds, s = self._places(omegas)
        cycles: list[LimitCycle | None] = self.results(speeds, s)
        for omega, cycle in zip(speeds.tolist(), cycles, strict=True):
            if cycle is None:
                raise NoSuchCycleError(f"the iteration has not converged at {omega:.10g} rad/s")
        return [cycle for cycle in cycles if cycle is not None]
