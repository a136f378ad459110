"""The branch of limit cycles as a function of Omega, with its own error.

Close to Omega_h every quantity of the branch is a series in log(Omega - Omega_h) and powers of Omega - Omega_h, and at
Omega_crit the squared amplitude is analytic. So one polynomial in s = log(Omega - Omega_h) through Chebyshev nodes
serves the whole branch. The nodes are solved a few at a time, from the Hopf point on, each group predicted from those
before; then a list of any length is predicted by the polynomial and corrected in one step of all lanes.

What is claimed for a number is the sum of what the rounding of the parameters does to it, what round-off in the flow
does to it (through the shooting problem's inverse), what the last Newton step leaves, and for interpolated numbers the
truncation. The first two are measured on some of the nodes, by cycles solved again.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

from tippedisk_verify.errors import InputError, NoSuchCycleError
from tippedisk_verify.flow.lanes import Lanes, field_constants
from tippedisk_verify.model.exact import shown
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE
from tippedisk_verify.orbits.averaged import averaged, constants_rounding
from tippedisk_verify.orbits.periodic import LimitCycle
from tippedisk_verify.orbits.simultaneous import Cycles, Guess, corrected
from tippedisk_verify.theory.harmonic_balance import section_start
from tippedisk_verify.theory.hopf import criticality, omega_crit

__all__ = ["DenseBranch", "Values"]

_GROUP = 8  # nodes that are solved together
_NODES_PER_UNIT = 12  # of s; the coefficients then fall to rounding, a hundredfold with every eight nodes
_EVERY = 8  # nodes between those on which errors are measured
_TWINS = 2
_SHIFT = 1e-3  # of the constants, as a part of the distance to the nearer end of the branch
# What rounding the start gives, in units of 2^-53, for (beta, gamma, v): gamma is up to 3 pi / 2, v up to 10 rad/s.
_START_ROUNDING = (1.0, 4.0, 8.0)
_START_SHIFT = 1e-5  # the same for the starts: so little that Newton's iteration ends after one step
_UNIT = 2.0**-53

_NUMBERS = (
    "period",
    "gamma_bar_0",
    "v_0",
    "beta_max",
    "multiplier_slow",
    "log_multiplier_slow",
    "log_multiplier_fast",
    "dperiod_domega",
    "dgamma_bar_0_domega",
    "dv_0_domega",
)


#: Amplitudes: their squares are analytic at the Hopf point; with the sign of the amplitude itself.
_SQUARED = {"gamma_bar_0": 1, "v_0": -1, "beta_max": 1}


@dataclass(frozen=True)
class Values:
    """Interpolated numbers at n speeds as (n,) arrays, and their half-widths under the same names."""

    omega: Any  #: [rad/s]
    period: Any  #: T [s]
    gamma_bar_0: Any  #: [rad]
    v_0: Any  #: [rad/s]
    beta_max: Any  #: [rad]
    log_multiplier_slow: Any
    log_multiplier_fast: Any
    uncertainty: dict[str, Any]


class DenseBranch:
    """The branch of stable limit cycles between two speeds above ``omega_h`` and below Omega_crit, in double.

    ``lowest`` and ``highest`` [rad/s] bound where it may be asked; by default a thousandth of the branch is left out at
    either end. Raises InputError for bounds outside the branch, NoSuchCycleError for a subcritical Hopf point or where
    the family cannot be followed.
    """

    def __init__(
        self,
        parameters: Parameters,
        lanes: Lanes,
        omega_h: float,
        *,
        lowest: float | None = None,
        highest: float | None = None,
    ) -> None:
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
        import numpy

        angles = (2 * numpy.arange(count) + 1) * numpy.pi / (2 * count)
        omegas = self.omega_h + numpy.exp((top + bottom) / 2 + (top - bottom) / 2 * numpy.cos(angles))
        # The speed is what was rounded: s follows from it, so that no error is left in the abscissa.
        self._s = numpy.log(omegas - self.omega_h)
        self._weights = (-1.0) ** numpy.arange(count) * numpy.sin(angles)
        self._cosines = numpy.cos(numpy.outer(numpy.arange(count - count // 6, count), angles)) * (2 / count)
        known = numpy.empty((0, 4))
        rows = numpy.empty((count, 4))
        solved = 0
        while solved < count:
            ahead = slice(solved, min(solved + _GROUP, count))
            found = corrected(
                self._constants,
                omegas[ahead],
                self._guess(omegas[ahead], known),
                self._lanes,
                whole=False,
                tolerance=3e-8,
            )
            good = int(numpy.argmin(numpy.append(found.converged, False)))
            if not good:
                known = self._between(known, omegas[solved])
                continue
            rows[solved : solved + good] = self._rows(found)[:good]
            known = numpy.concatenate((known, rows[solved : solved + good]))
            solved += good
        # Once more, so that the derivatives are those at the cycle and not at the last guess.
        guess = Guess(*rows[:, 1:].T)
        self.nodes = corrected(self._constants, omegas, guess, self._lanes, tolerance=self._resolved(omegas))
        if not self.nodes.converged.all():
            raise NoSuchCycleError("the family of limit cycles could not be followed")

    def _resolved(self, omegas: Any) -> Any:
        """The relative step after which only rounding is left: it grows as Omega_h comes near."""
        import numpy

        return 1e-11 * numpy.maximum(1.0, 1e-4 / (omegas - self.omega_h))

    def _rows(self, cycles: Cycles) -> Any:
        """What predictions are made from: s, gamma_bar_0, v_0 and the half period."""
        import numpy

        s = numpy.log(cycles.omega - self.omega_h)
        return numpy.stack((s, cycles.gamma_bar_0, cycles.v_0, cycles.period / 2), axis=1)

    def _between(self, known: Any, omega: float) -> Any:
        """More known cycles on the way to a node that was not reached; the last of them is halfway there."""
        import numpy

        target = math.log(omega - self.omega_h)
        begin = known[-1, 0] if len(known) else math.log(self.omega_crit - self.omega_h)
        if abs(target - begin) < 1e-3:
            raise NoSuchCycleError(f"the family of limit cycles could not be followed to {omega:.10g} rad/s")
        steps = begin + (target - begin) * numpy.arange(1, _GROUP + 1) / (2 * _GROUP)
        speeds = self.omega_h + numpy.exp(steps)
        found = corrected(self._constants, speeds, self._guess(speeds, known), self._lanes, whole=False)
        good = int(numpy.argmin(numpy.append(found.converged, False)))
        if not good:
            raise NoSuchCycleError(f"the family of limit cycles could not be followed to {omega:.10g} rad/s")
        return numpy.concatenate((known, self._rows(found)[:good]))

    def _guess(self, omegas: Any, known: Any) -> Guess:
        """From the one-harmonic law, then along what is known, in variables that are straight close to Omega_h."""
        import numpy

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
    def _error_sources(self) -> tuple[Any, dict[str, tuple[Any, ...]]]:
        """On every eighth node and at both ends, in rising s: what moves each number.

        The rounding of the parameters, the flow's round-off, and a wrong start. Each constant in turn is moved a little
        and the cycle solved again: a difference quotient. The flow's round-off is seen on twins, the same cycle solved
        from starts some roundings away. What follows from the derivatives is taken before the last Newton step, so each
        of (gamma_bar_0, v_0, T / 2) is moved in turn too, by much more than rounding, and how the numbers change at
        such a start is measured.
        """
        import numpy

        # Both ends among them: towards the Hopf point sensitivities grow without bound.
        every = numpy.append(numpy.arange(len(self._s) - 1, 0, -_EVERY), 0)
        omegas, count = self.nodes.omega, len(self._constants)
        room = numpy.minimum(omegas - self.omega_h, self.omega_crit - omegas)[every]
        shift = _SHIFT * room / omegas[every]
        which = numpy.tile(every, _TWINS + count + 3)
        constants = numpy.tile(self._constants, (len(which), 1))
        jitter = numpy.ones(len(which))
        for twin in range(_TWINS):
            jitter[twin * len(every) : (twin + 1) * len(every)] += (4 + 3 * twin) * (-1) ** twin * _UNIT
        for index in range(count):
            begin = _TWINS * len(every) + index * len(every)
            constants[begin : begin + len(every), index] *= 1 + shift
        at = self.nodes
        starts = numpy.stack((at.gamma_bar_0, at.v_0, at.period / 2))
        away = _START_SHIFT * room / omegas[every] * numpy.abs(starts[:, every])
        guessed = starts[:, which]
        guessed[:2] *= jitter
        for index in range(3):
            begin = (_TWINS + count + index) * len(every)
            guessed[index, begin : begin + len(every)] += away[index]
        guess = Guess(*guessed)
        found = corrected(constants, omegas[which], guess, self._lanes, tolerance=1e-5)
        roundings = numpy.abs(constants_rounding(self.parameters))
        sources = {}
        for name in _NUMBERS:
            values, base = getattr(found, name), getattr(at, name)
            # Not against the node itself: its own last step is accounted for, and would hide how little this is.
            twins = values[: _TWINS * len(every)].reshape(_TWINS, -1)
            spread = twins.max(axis=0) - twins.min(axis=0)
            moved = values[_TWINS * len(every) :].reshape(count + 3, -1)
            slopes = numpy.abs(moved[:count] - base[every]) / shift
            by_start = numpy.abs(moved[count:] - base[every]) / away
            # A small sample's spread: the largest of five neighbours, four times.
            flow = 4 * _largest_nearby(spread / self._scale(name, at)[every])
            sources[name] = roundings @ slopes, flow, *by_start
        return self._s[every], sources

    def _scale(self, name: str, cycles: Cycles) -> Any:
        """What round-off in the flow is proportional to: for the solved numbers what a rounded start does to them."""
        import numpy

        rows = {"gamma_bar_0": 0, "v_0": 1, "period": 2, "beta_max": 0}
        if name not in rows:
            return numpy.full(len(cycles.omega), _UNIT)
        return numpy.abs(cycles.sensitivity[:, rows[name]]) @ numpy.array(_START_ROUNDING) * _UNIT

    @cached_property
    def _along(self) -> Any:
        """|d(log_multiplier_fast) / d(gamma_bar_0)| along the branch at the nodes: what a wrong start does, roughly."""
        import numpy

        by_s = numpy.gradient(self.nodes.gamma_bar_0, self._s)
        return _largest_nearby(numpy.abs(numpy.gradient(self.nodes.log_multiplier_fast, self._s) / by_s))

    def half_widths(self, cycles: Cycles) -> dict[str, Any]:
        """For each number of cycles on this branch the half-width that holds the truth, as (n,) arrays."""
        return {name: common + own for name, (common, own) in self._widths(cycles).items()}

    def _widths(self, cycles: Cycles) -> dict[str, tuple[Any, Any]]:
        """The same in two parts: what the rounding of the parameters does, and each cycle's own round-off."""
        import numpy

        s = numpy.log(cycles.omega - self.omega_h)
        s_known, sources = self._error_sources
        # At fixed Omega a wrong start counts against Omega - Omega_h itself, along the branch against its square root.
        whole = self.omega_crit - self.omega_h
        near_h = numpy.exp((math.log(whole) - s) / 2)
        wrong = [self._scale(name, cycles) for name in ("gamma_bar_0", "v_0", "period")]
        widths = {}
        for name in _NUMBERS:
            # Chords: these lie above what grows like a power of Omega - Omega_h, and hold what vanishes at Omega_crit.
            parameters, flow, *by_start = (numpy.interp(s, s_known, source) for source in sources[name])
            # The twins' spread is already four times the largest of five neighbours.
            own = (flow + 1) * self._scale(name, cycles) + 2 * _UNIT * numpy.abs(getattr(cycles, name))
            if name not in ("period", "gamma_bar_0", "v_0", "beta_max"):  # those are taken after the last step
                for slope, error, last in zip(by_start, wrong, numpy.abs(cycles.last_step).T, strict=True):
                    own += 2 * slope * (error + last)
            if name == "log_multiplier_fast":
                # The integral of the divergence is taken after the last step: there the start's own error counts.
                along = numpy.interp(s, self._s[::-1], self._along[::-1])
                own += along * (1 + 8 * near_h) * wrong[0]
            widths[name] = 2 * parameters, own
        return widths

    # -------------------------------------------------------------------------------------------- what it gives
    def __call__(self, omegas: Sequence[float]) -> Values:
        """Interpolated numbers, each with a half-width that holds the truth. Raises InputError outside the bounds."""
        import numpy

        speeds = self._checked(omegas)
        ratios = self._ratios(speeds)
        found: dict[str, Any] = {}
        widths: dict[str, Any] = {}
        below = self.omega_crit - speeds
        s = numpy.log(speeds - self.omega_h)
        for name, (scaled, common, own) in self._scaled.items():
            values = ratios @ scaled
            # The parameters' rounding moves all nodes alike, and the polynomial with them; each node's own round-off is
            # independent of the others'. The coefficients fall geometrically: what is left out is less than the
            # largest of the last ones twice.
            moved = numpy.interp(s, self._s[::-1], common[::-1])
            error = moved + numpy.sqrt(ratios**2 @ own**2) + 2 * numpy.abs(self._cosines @ scaled).max()
            if name in _SQUARED:
                found[name] = _SQUARED[name] * numpy.sqrt(values * below)
                widths[name] = error * below / (2 * numpy.abs(found[name]))
            elif name == "log_multiplier_slow":
                found[name], widths[name] = values * below, error * below
            else:
                found[name], widths[name] = values, error
            widths[name] += 4 * _UNIT * numpy.abs(found[name])
        return Values(omega=speeds, uncertainty=widths, **found)

    @cached_property
    def _scaled(self) -> dict[str, tuple[Any, Any, Any]]:
        """Node values of what is analytic up to the Hopf point, with the two parts of their half-widths."""
        import numpy

        nodes, below = self.nodes, self.omega_crit - self.nodes.omega
        parts = self._widths(nodes)
        scaled = {}
        for name in ("gamma_bar_0", "v_0", "beta_max", "period", "log_multiplier_slow", "log_multiplier_fast"):
            values = getattr(nodes, name)
            if name in _SQUARED:
                scale, value = 2 * numpy.abs(values) / below, values**2 / below
            elif name == "log_multiplier_slow":
                scale, value = 1 / below, values / below
            else:
                scale, value = 1.0, values
            scaled[name] = value, scale * parts[name][0], scale * parts[name][1]
        return scaled

    def _checked(self, omegas: Sequence[float]) -> Any:
        import numpy

        speeds = numpy.atleast_1d(numpy.asarray(omegas, dtype=float))
        outside = speeds[~((speeds >= self.lowest) & (speeds <= self.highest))]
        if len(outside):
            raise InputError(
                f"{outside[0]:.10g} rad/s lies outside the branch's bounds {self.lowest:.10g} ... {self.highest:.10g}"
            )
        return speeds

    def _ratios(self, speeds: Any) -> Any:
        """Barycentric weights of every node for every speed, (n, nodes); each row sums to 1."""
        import numpy

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
        import numpy

        speeds = self._checked(omegas)
        ratios = self._ratios(speeds)
        square, ratio, period = (ratios @ self._scaled_values[name] for name in ("gamma_bar_0", "v_0", "period"))
        size = numpy.sqrt(square * (self.omega_crit - speeds))
        guess = Guess(size, ratio * size, period / 2)
        found = corrected(self._constants, speeds, guess, self._lanes, tolerance=self._resolved(speeds))
        return averaged(self.parameters, found, self._lanes)

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
        found = self.cycles(omegas)
        if not found.converged.all():
            lost = found.omega[~found.converged][0]
            raise NoSuchCycleError(f"the iteration has not converged at {lost:.10g} rad/s")
        widths = self.half_widths(found)
        cycles = []
        for index, omega in enumerate(found.omega.tolist()):
            measured = {
                name: Measured(Fraction(float(getattr(found, name)[index])), Fraction(float(widths[name][index])))
                for name in _NUMBERS
            }
            defect = float(found.trivial_multiplier_defect[index])
            slow = measured["multiplier_slow"]
            certain = abs(slow.value - 1) > slow.uncertainty
            cycles.append(
                LimitCycle(
                    omega=Measured(Fraction(omega), Fraction(0)),
                    **measured,
                    trivial_multiplier_defect=Measured.of(defect, 2 * defect + 2 * _UNIT),
                    stable=bool(slow.value < 1) if certain else None,
                    residuals=(float(found.residual[index]),),
                )
            )
        return cycles


def _largest_nearby(values: Any) -> Any:
    """The largest of five neighbours."""
    import numpy

    padded = numpy.pad(values, 2, mode="edge")
    return numpy.max([padded[k : k + len(values)] for k in range(5)], axis=0)


def _extrapolated(s_known: Any, columns: Sequence[Any], s: Any, degree: int) -> list[Any]:
    import numpy

    powers = numpy.vander(s_known - s[0], min(degree, len(s_known) - 1) + 1)
    coefficients = numpy.linalg.lstsq(powers, numpy.stack(columns, axis=1), rcond=None)[0]
    return list((numpy.vander(s - s[0], powers.shape[1]) @ coefficients).T)
