"""The branch of limit cycles as a function of Omega, with its own error.

Close to Omega_h every quantity of the branch is a series in log(Omega - Omega_h) and powers of Omega - Omega_h, and at
Omega_crit the squared amplitude is analytic. So one polynomial in s = log(Omega - Omega_h) through Chebyshev nodes
serves the whole branch. The nodes are solved a few at a time, from the Hopf point on, each group predicted from those
before; then a list of any length is predicted by the polynomial and corrected in one step of all lanes.

What is claimed for a number is the subject of `branch_budget`; for interpolated numbers the truncation is added.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy

from tippedisk_verify.errors import InputError, NoSuchCycleError
from tippedisk_verify.flow.lanes import BatchTaylor, field_constants
from tippedisk_verify.model.arrays import Array
from tippedisk_verify.model.exact import shown
from tippedisk_verify.model.measured import DISTANCES
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE
from tippedisk_verify.orbits.averaged import averaged
from tippedisk_verify.orbits.batch_shooting import LIBRATING, Cycles, Guess, corrected, measured_cycles
from tippedisk_verify.orbits.branch_budget import BranchBudget, largest_nearby, multiplier_widths
from tippedisk_verify.orbits.periodic import LimitCycle
from tippedisk_verify.theory.harmonic_balance import section_start
from tippedisk_verify.theory.hopf import criticality, omega_crit

__all__ = ["BranchInterpolant", "Values"]

_GROUP = 8  # nodes that are solved together
_NODES_PER_UNIT = 12  # of s; the coefficients then fall to rounding, a hundredfold with every eight nodes
_UNIT = 2.0**-53

#: Amplitudes: their squares are analytic at the Hopf point; with the sign of the amplitude itself.
_SQUARED = {"gamma_bar_0": 1, "v_0": -1, "beta_max": 1}


@dataclass(frozen=True)
class Values:
    """Interpolated numbers at n speeds as (n,) arrays, and their half-widths under the same names."""

    omega: Array  #: [rad/s]
    period: Array  #: T [s]
    gamma_bar_0: Array  #: [rad]
    v_0: Array  #: [rad/s]
    beta_max: Array  #: [rad]
    log_multiplier_slow: Array
    log_multiplier_fast: Array
    uncertainty: dict[str, Any]


class BranchInterpolant:
    """The branch of stable limit cycles between two speeds above ``omega_h`` and below Omega_crit, in double.

    ``lowest`` and ``highest`` [rad/s] bound where it may be asked; by default a thousandth of the branch is left out at
    either end. Raises InputError for bounds outside the branch, NoSuchCycleError for a subcritical Hopf point or where
    the family cannot be followed.
    """

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
        self.omega_crit = float(omega_crit(parameters))
        if criticality(parameters) != "supercritical":
            raise NoSuchCycleError("the Hopf point is not supercritical: there is no stable branch below Omega_crit")
        if not 0 < omega_h < self.omega_crit:
            raise InputError(f"Omega_h lies between 0 and {self.omega_crit:.10g} rad/s, not {shown(omega_h)}")
        margin = (self.omega_crit - omega_h) / 1000
        self.lowest = omega_h + margin if lowest is None else lowest
        self.highest = self.omega_crit - margin if highest is None else highest
        if not omega_h < self.lowest <= self.highest < self.omega_crit:
            raise InputError(
                f"the branch lies between {omega_h:.10g} and {self.omega_crit:.10g} rad/s: its bounds must too"
            )
        self._constants = field_constants(parameters)
        # A little room at both ends, where the polynomial is at its worst.
        top = math.log(self.highest - omega_h) + 0.02 * (self.omega_crit - self.highest)
        bottom = math.log(self.lowest - omega_h) - 0.02
        count = _GROUP * max(3, math.ceil(_NODES_PER_UNIT * (top - bottom) / _GROUP))
        self._solve(top, bottom, count)

    # -------------------------------------------------------------------------------------------- the nodes
    def _solve(self, top: float, bottom: float, count: int) -> None:
        angles = (2 * numpy.arange(count) + 1) * numpy.pi / (2 * count)
        omegas = self.omega_h + numpy.exp((top + bottom) / 2 + (top - bottom) / 2 * numpy.cos(angles))
        # The speed is what was rounded: s follows from it, so that no error is left in the abscissa.
        self._s = numpy.log(omegas - self.omega_h)
        self._weights = (-1.0) ** numpy.arange(count) * numpy.sin(angles)
        known = numpy.empty((0, 4))
        rows = numpy.empty((count, 4))
        solved = 0
        while solved < count:
            ahead = slice(solved, min(solved + _GROUP, count))
            group = corrected(
                self._constants,
                omegas[ahead],
                self._guess(omegas[ahead], known),
                self._lanes,
                whole=False,
                tolerance=3e-8,
            )
            good = int(numpy.argmin(numpy.append(group.converged, False)))
            if not good:
                known = self._between(known, omegas[solved])
                continue
            rows[solved : solved + good] = self._rows(group)[:good]
            known = numpy.concatenate((known, rows[solved : solved + good]))
            solved += good
        # Once more, so that the derivatives are those at the cycle and not at the last guess.
        guess = Guess(*rows[:, 1:].T)
        self.nodes = corrected(self._constants, omegas, guess, self._lanes, tolerance=self._resolved(omegas))
        if not self.nodes.converged.all():
            raise NoSuchCycleError("the family of limit cycles could not be followed")

    def _resolved(self, omegas: Array) -> Array:
        """The relative step after which only rounding is left: it grows as Omega_h comes near."""
        return 1e-11 * numpy.maximum(1.0, 1e-4 / (omegas - self.omega_h))

    def _rows(self, cycles: Cycles) -> Array:
        """What predictions are made from: s, gamma_bar_0, v_0 and the half period."""
        s = numpy.log(cycles.omega - self.omega_h)
        return numpy.stack((s, cycles.gamma_bar_0, cycles.v_0, cycles.period / 2), axis=1)

    def _between(self, known: Array, omega: float) -> Array:
        """More known cycles on the way to a node that was not reached; the last of them is halfway there."""
        target = math.log(omega - self.omega_h)
        begin = known[-1, 0] if len(known) else math.log(self.omega_crit - self.omega_h)
        if abs(target - begin) < 1e-3:
            raise NoSuchCycleError(f"the family of limit cycles could not be followed to {omega:.10g} rad/s")
        steps = begin + (target - begin) * numpy.arange(1, _GROUP + 1) / (2 * _GROUP)
        speeds = self.omega_h + numpy.exp(steps)
        cycles = corrected(self._constants, speeds, self._guess(speeds, known), self._lanes, whole=False)
        good = int(numpy.argmin(numpy.append(cycles.converged, False)))
        if not good:
            raise NoSuchCycleError(f"the family of limit cycles could not be followed to {omega:.10g} rad/s")
        return numpy.concatenate((known, self._rows(cycles)[:good]))

    def _guess(self, omegas: Array, known: Array) -> Guess:
        """From the one-harmonic law, then along what is known, in variables that are straight close to Omega_h."""
        if not len(known):
            constants = self.parameters.at(DOUBLE)
            starts = [start for omega in omegas.tolist() if (start := section_start(constants, omega))]
            if len(starts) < len(omegas):
                raise NoSuchCycleError("the one-harmonic law has no cycle to start from: Omega_h is far off")
            return Guess(*numpy.transpose(starts))
        s = numpy.log(omegas - self.omega_h)
        if known[:, 1].max() < 2:
            s_known, gamma_bar, v, half_period = known[-_GROUP:].T
            below = self.omega_crit - omegas
            below_known = self.omega_crit - self.omega_h - numpy.exp(s_known)
            columns = (gamma_bar**2 / below_known, v / gamma_bar, half_period)
            square, ratio, half = _extrapolated(s_known, columns, s, 5)
            size = numpy.sqrt(numpy.maximum(square * below, 0))
            return Guess(size, ratio * size, half)
        s_known, gamma_bar, v, half_period = known[-6:].T
        left, speed, half = _extrapolated(s_known, (numpy.log(numpy.pi - gamma_bar), numpy.log(-v), half_period), s, 3)
        with numpy.errstate(over="ignore"):
            return Guess(numpy.pi - numpy.exp(left), -numpy.exp(speed), half)

    # -------------------------------------------------------------------------------------------- the errors
    @cached_property
    def _budget(self) -> BranchBudget:
        omegas = self.nodes.omega
        room = numpy.minimum(omegas - self.omega_h, self.omega_crit - omegas)
        return BranchBudget(self._constants, self.nodes, self._s, room, self._lanes)

    def half_widths(self, cycles: Cycles) -> dict[str, Array]:
        """For each number of cycles on this branch the half-width that holds the truth, as (n,) arrays."""
        return self._budget.all_half_widths(cycles, numpy.log(cycles.omega - self.omega_h))

    # -------------------------------------------------------------------------------------------- what it gives
    def __call__(self, omegas: Sequence[float]) -> Values:
        """Interpolated numbers, each with a half-width that holds the truth. Raises InputError outside the bounds."""
        speeds = self._checked(omegas)
        ratios = self._ratios(speeds)
        values: dict[str, Any] = {}
        widths: dict[str, Any] = {}
        below = self.omega_crit - speeds
        s = numpy.log(speeds - self.omega_h)
        for name, (scaled, width) in self._scaled.items():
            at = ratios @ scaled
            # The parameters' rounding moves all nodes alike, and the polynomial with them; each node's own round-off is
            # independent of the others'. One width is for both, whichever prevails.
            moved = numpy.interp(s, self._s[::-1], width[::-1])
            truncation = numpy.interp(s, *self._truncation[name])
            error = numpy.sqrt(moved**2 + ratios**2 @ width**2) + truncation
            if name in _SQUARED:
                values[name] = _SQUARED[name] * numpy.sqrt(at * below)
                widths[name] = error * below / (2 * numpy.abs(values[name]))
            elif name == "map_multiplier":
                values[name], widths[name] = 1 - at * below, error * below
            else:
                values[name], widths[name] = at, error
            widths[name] += 4 * _UNIT * numpy.abs(values[name])
        half, both = values.pop("map_multiplier"), values.pop("log_multipliers")
        of_multipliers = multiplier_widths(half, both, widths.pop("map_multiplier"), widths.pop("log_multipliers"))
        del of_multipliers["multiplier_slow"]
        log_slow = 2 * numpy.log(numpy.abs(half))
        return Values(
            omega=speeds,
            log_multiplier_slow=log_slow,
            log_multiplier_fast=both - log_slow,
            uncertainty=widths | of_multipliers,
            **values,
        )

    @cached_property
    def _scaled(self) -> dict[str, tuple[Any, Any]]:
        """Node values of what is analytic up to the Hopf point, with their half-widths."""
        nodes, below = self.nodes, self.omega_crit - self.nodes.omega
        widths = self._budget.half_widths(nodes, self._s)
        for name in _SQUARED:
            widths[name] = widths[name] * 2 * numpy.abs(getattr(nodes, name)) / below
        widths["map_multiplier"] = widths["map_multiplier"] / below
        return {name: (value, widths[name]) for name, value in self._analytic(nodes).items()}

    def _analytic(self, cycles: Cycles) -> dict[str, Any]:
        """Those of the cycles' numbers that are interpolated, made analytic up to the Hopf point."""
        below = self.omega_crit - cycles.omega
        scaled = {name: getattr(cycles, name) ** 2 / below for name in _SQUARED}
        scaled["map_multiplier"] = (1 - cycles.map_multiplier) / below
        return scaled | {"period": cycles.period, "log_multipliers": cycles.log_multipliers}

    @cached_property
    def _truncation(self) -> dict[str, tuple[Any, Any]]:
        """What the polynomial leaves out: twice its distance from cycles that are solved midway between the nodes.

        There it is about as wrong as anywhere between them. Abscissas, rising, and the largest of three neighbours.
        """
        middles = (self._s[1:] + self._s[:-1])[::-1] / 2
        speeds = self.omega_h + numpy.exp(middles)
        ratios, solved = self._ratios(speeds), self._analytic(self._solved_at(speeds))
        away = {name: numpy.abs(ratios @ scaled - solved[name]) for name, (scaled, _) in self._scaled.items()}
        return {
            name: (middles, DISTANCES * largest_nearby(numpy.nan_to_num(distance, nan=numpy.inf)))
            for name, distance in away.items()
        }

    def _checked(self, omegas: Sequence[float]) -> Array:
        speeds = numpy.atleast_1d(numpy.asarray(omegas, dtype=float))
        outside = speeds[~((speeds >= self.lowest) & (speeds <= self.highest))]
        if len(outside):
            raise InputError(
                f"{outside[0]:.10g} rad/s lies outside the branch's bounds {self.lowest:.10g} ... {self.highest:.10g}"
            )
        return speeds

    def _ratios(self, speeds: Array) -> Any:
        """Barycentric weights of every node for every speed, (n, nodes); each row sums to 1."""
        away = numpy.log(speeds - self.omega_h)[:, None] - self._s
        hit = away == 0
        with numpy.errstate(divide="ignore", invalid="ignore"):
            ratios = self._weights / away
            ratios /= ratios.sum(axis=1, keepdims=True)
        struck = hit.any(axis=1)
        ratios[struck] = hit[struck]
        return ratios

    def cycles(self, omegas: Sequence[float]) -> Cycles:
        """The cycles at these speeds, corrected by Newton's iteration. Raises InputError outside the bounds."""
        return self._solved_at(self._checked(omegas))

    def _solved_at(self, speeds: Array) -> Cycles:
        ratios = self._ratios(speeds)
        square, ratio, period = (ratios @ self._scaled_values[name] for name in ("gamma_bar_0", "v_0", "period"))
        size = numpy.sqrt(square * (self.omega_crit - speeds))
        guess = Guess(size, ratio * size, period / 2)
        cycles = corrected(self._constants, speeds, guess, self._lanes, tolerance=self._resolved(speeds))
        return averaged(self.parameters, cycles, self._lanes)

    @cached_property
    def _scaled_values(self) -> dict[str, Any]:
        nodes = self.nodes
        return {
            "gamma_bar_0": nodes.gamma_bar_0**2 / (self.omega_crit - nodes.omega),
            "v_0": nodes.v_0 / nodes.gamma_bar_0,
            "period": nodes.period,
        }

    def limit_cycles(self, omegas: Sequence[float]) -> list[LimitCycle]:
        """`cycles` as the result objects that single speeds give. Raises NoSuchCycleError if one has not converged."""
        solved = self.cycles(omegas)
        if not solved.converged.all():
            lost = solved.omega[~solved.converged][0]
            raise NoSuchCycleError(f"the iteration has not converged at {lost:.10g} rad/s")
        cycles: list[LimitCycle] = measured_cycles(solved, self.half_widths(solved), LIBRATING, self.parameters)
        return cycles


def _extrapolated(s_known: Array, columns: Sequence[Any], s: Array, degree: int) -> list[Any]:
    powers = numpy.vander(s_known - s[0], min(degree, len(s_known) - 1) + 1)
    coefficients = numpy.linalg.lstsq(powers, numpy.stack(columns, axis=1), rcond=None)[0]
    return list((numpy.vander(s - s[0], powers.shape[1]) @ coefficients).T)
