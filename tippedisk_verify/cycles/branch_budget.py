"""What the numbers of a branch of limit cycles may be off: the budget of `branch_interpolant`.

It is derived in docs/error_budgets.md. `rotating_interpolant` has it too, for either side of the fold.

On every fourth node (there every third), and at both ends, the cycle is solved again a few times with other last bits
of the constants, each time from the solution before (the twins of `error_budget`, in lanes). The largest spread of
three neighbours is the measure of rounding, of the parameters' too. What has a pole at a fold is multiplied by what
vanishes there. Between those nodes it is interpolated by chords, which lie above what grows like a power of Omega -
Omega_h, and hold what vanishes at Omega_crit.

What follows from derivatives is taken before the last Newton step: how it changes with the start is measured as well,
by starts moved much farther than rounding moves them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy

from tippedisk_verify.cycles.batch_shooting import LIBRATING, BatchCycles, BatchSection, Guess, corrected
from tippedisk_verify.flow.lanes import BatchTaylor
from tippedisk_verify.model.arrays import Array

__all__ = ["BranchBudget", "largest_nearby", "multiplier_widths"]

#: With them, and the node itself, six values each on three neighbouring nodes.
TWINS = 5
#: An error beyond so many times the largest of three spreads of six values has a probability of 2e-8 for normal errors,
#: one beyond half of that 7e-5: a branch has thousands of numbers. The half-width is 17 times the error in the median.
TWIN_FACTOR = 3.5
_EVERY = 4  # nodes between those where rounding is measured
#: The share of the constants that a twin moves up; as many move down. They then err by half a place, as by rounding.
_SHARE_MOVED = 1 / 8
_START_SHIFT = 1e-5  # of the distance to the nearer end; Newton's iteration then ends after one step
#: What the slope for a moved start may be off, as a factor: the start's effect is linear but for parts of 1e-5.
_SLOPE = 2
_UNIT = 2.0**-53


class BranchBudget:
    """Half-widths of the numbers of cycles on a branch, measured on some of its nodes.

    ``s`` are the abscissas of the nodes, monotonic, and ``room`` [rad/s] their distances to the nearest end of the
    branch or fold. Rounding is measured on every so many nodes. ``scale``, of cycles and their abscissas, times a
    spread is what is interpolated; its power ``pole`` is taken for derivatives by Omega.
    """

    def __init__(
        self,
        constants: Array,
        nodes: BatchCycles,
        s: Array,
        room: Array,
        lanes: BatchTaylor,
        *,
        section: BatchSection = LIBRATING,
        every: int = _EVERY,
        scale: Callable[[BatchCycles, Array], Any] = lambda cycles, s: numpy.ones_like(s),
        pole: int = 1,
    ) -> None:
        self._constants, self._nodes, self.s, self._room, self._lanes = constants, nodes, s, room, lanes
        self._section, self._every, self._scale, self._pole = section, every, scale, pole
        by_omega = tuple(f"d{name}_domega" for name in ("period", *section.names))
        # Those of the multipliers follow (`multiplier_widths`).
        self._measured = ("period", *section.names, *section.measures, "log_multipliers", "map_multiplier", *by_omega)
        #: Those that are taken before the last Newton step.
        self._before, self._by_omega = ("map_multiplier", *by_omega), by_omega

    def all_half_widths(self, cycles: BatchCycles, s: Array) -> dict[str, Any]:
        """(n,) half-widths of all numbers of n cycles at the abscissas ``s``."""
        widths = self.half_widths(cycles, s)
        larger, both = widths.pop("map_multiplier"), widths.pop("log_multipliers")
        laps = self._section.laps
        return widths | multiplier_widths(cycles.map_multiplier, cycles.log_multipliers, larger, both, laps)

    def half_widths(self, cycles: BatchCycles, s: Array) -> dict[str, Any]:
        """The same of the measured numbers."""
        s_known, spreads, slopes = self._sources
        last, widths = numpy.abs(cycles.last_step).T, {}
        for name in self._measured:
            scale = self._scaled(name, cycles, s)
            widths[name] = TWIN_FACTOR * numpy.interp(s, s_known, spreads[name]) / scale + 2 * _UNIT * numpy.abs(
                getattr(cycles, name)
            )
            for slope, step in zip(slopes.get(name, ()), last, strict=False):
                widths[name] += _SLOPE * numpy.interp(s, s_known, slope) / scale * step
        return widths

    def _scaled(self, name: str, cycles: BatchCycles, s: Array) -> Any:
        """What a spread of that number is multiplied by where it is interpolated."""
        return self._scale(cycles, s) ** (self._pole if name in self._by_omega else 1)

    @cached_property
    def _sources(self) -> tuple[Any, dict[str, Any], dict[str, list[Any]]]:
        """On some nodes, in rising s: the spread of each number, and its change with the start."""
        # Both ends among them: towards the Hopf point sensitivities grow without bound.
        every = numpy.append(numpy.arange(len(self.s) - 1, 0, -self._every), 0)
        if self.s[0] < self.s[-1]:
            every = every[::-1]
        nodes, omegas, section = self._nodes, self._nodes.omega[every], self._section
        constants = numpy.broadcast_to(self._constants, (len(every), len(self._constants)))
        start = section.guess(nodes)[:, every]
        values = {name: [getattr(nodes, name)[every]] for name in self._measured}
        random, guess = numpy.random.default_rng(1), start

        def bits(shape: tuple[int, ...]) -> Any:
            turns = random.random(shape)
            return 1 + ((turns < _SHARE_MOVED).astype(float) - (turns >= 1 - _SHARE_MOVED)) * 2 * _UNIT

        for _ in range(TWINS):
            moved = constants * bits(constants.shape)
            cycles = corrected(moved, omegas, Guess(*guess), self._lanes, section=section, tolerance=1e-5)
            guess = section.guess(cycles)
            for name, known in values.items():
                known.append(getattr(cycles, name))
        sampled = nodes.only(every)
        scales = {name: self._scaled(name, sampled, self.s[every]) for name in self._measured}
        spreads = {name: numpy.ptp(numpy.stack(known), axis=0) * scales[name] for name, known in values.items()}
        slopes: dict[str, list[Any]] = {name: [] for name in self._before}
        away = _START_SHIFT * self._room[every] / omegas * numpy.abs(start)
        for index in range(3):
            guess = start.copy()
            guess[index] += away[index]
            guessed = Guess(*guess)
            cycles = corrected(constants, omegas, guessed, self._lanes, section=section, tolerance=1e-5, whole=False)
            for name in self._before:
                moved_by = numpy.abs(getattr(cycles, name) - getattr(nodes, name)[every])
                slopes[name].append(moved_by / away[index] * scales[name])
        # A node next to a fold is not found again at its speed; what is interpolated is smooth there.
        found = numpy.isfinite([*spreads.values(), *(part for parts in slopes.values() for part in parts)]).all(axis=0)
        spreads = {name: largest_nearby(spread[found]) for name, spread in spreads.items()}
        slopes = {name: [part[found] for part in parts] for name, parts in slopes.items()}
        return self.s[every][found], spreads, slopes


def multiplier_widths(
    larger: Array, both: Array, larger_width: Array, both_width: Array, laps: int = 2
) -> dict[str, Any]:
    """Half-widths of the multipliers' numbers from those of the map's multiplier and of the logarithms' sum.

    ``laps`` flights of the map make up a period. Where rounding leaves the slow multiplier undecided its logarithm lies
    between half of the sum and what the multiplier may be at most.
    """
    size = numpy.abs(larger)
    with numpy.errstate(divide="ignore", invalid="ignore"):
        log_slow = laps * numpy.log(size)
        resolved = 2 * larger_width < size
        lost = numpy.maximum(log_slow - both / 2 + both_width, laps * numpy.log(size + larger_width) - log_slow)
        width = numpy.where(resolved, laps * larger_width / (size - larger_width), lost)
        width += 8 * _UNIT * numpy.abs(log_slow)
    slow_width = 2 * size * larger_width + larger_width**2 if laps == 2 else larger_width
    return {
        "multiplier_slow": slow_width + 4 * _UNIT * size**laps,
        "log_multiplier_slow": width,
        "log_multiplier_fast": width + both_width,
    }


def largest_nearby(values: Array) -> Any:
    """The largest of three neighbours."""
    padded = numpy.pad(values, 1, mode="edge")
    return numpy.max([padded[k : k + len(values)] for k in range(3)], axis=0)
