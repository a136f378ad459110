"""What the numbers of many cycles of a family may be off: the budget of `interpolant`.

It is derived in docs/error_budgets.md.

On every fourth node of the family, and at both ends, the cycle is solved again a few times with other last bits of the
constants, each time from the solution before (the twins of `error_budget`, in lanes). The largest spread of three
neighbours is the measure of rounding, of the parameters' too. What has a pole at a fold is multiplied by what vanishes
there. Between those nodes it is interpolated by chords, which lie above what grows like a power of Omega - Omega_h, and
hold what vanishes at Omega_crit.

What follows from derivatives is taken before the last Newton step: how it changes with the start is measured as well,
by starts moved much farther than rounding moves them.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy

from tippedisk_verify.cycles.batch_shooting import BatchCycles, shoot_batch
from tippedisk_verify.flow.lanes import BatchTaylor
from tippedisk_verify.model.arrays import Array

__all__ = ["BranchBudget", "multiplier_widths"]

#: With them, and the node itself, nine values each on three neighbouring nodes.
TWINS = 8
#: An error beyond so many times the largest of three spreads of nine values has a probability of 2e-8 for normal
#: errors, one beyond half of that 2e-4: a branch has thousands of numbers. The half-width is 13 times the error in the
#: median.
#: Five twins with a factor of 3.5 have the same risk, but half-widths that are a quarter wider and scatter more.
TWIN_FACTOR = 2.5
_EVERY = 4  # nodes between those where rounding is measured
#: The share of the constants that a twin moves up; as many move down. They then err by half a place, as by rounding.
_SHARE_MOVED = 1 / 8
_START_SHIFT = 1e-5  # of the distance to the nearer end; Newton's iteration then ends after one step
#: What the slope for a moved start may be off, as a factor: the start's effect is linear but for parts of 1e-5.
_SLOPE = 2
_POLE = 3  # of derivatives by Omega at a fold, where each error of Omega counts as 1 / (dOmega/dx)^3
_UNIT = 2.0**-53


class BranchBudget:
    """Half-widths of the numbers of a family's cycles, measured on some of its nodes.

    ``s`` are the abscissas of the nodes, rising, and ``room`` [rad/s] their distances to the nearest end of the family
    or fold. Spreads are interpolated times `BatchCycles.slope`, those of derivatives by Omega times its cube.
    """

    def __init__(self, constants: Array, nodes: BatchCycles, s: Array, room: Array, lanes: BatchTaylor) -> None:
        self._constants, self._nodes, self._s, self._room, self._lanes = constants, nodes, s, room, lanes
        section = nodes.section
        #: Those of the multipliers follow (`multiplier_widths`).
        self._by_omega = tuple(f"d{name}_domega" for name in ("period", *section.names))
        measures = tuple(measure.name for measure in section.measures)
        self._measured = ("period", *section.names, *measures, "log_multipliers", "map_multiplier", *self._by_omega)
        #: Those that are taken before the last Newton step.
        self._before = ("map_multiplier", *self._by_omega)

    def all_half_widths(self, cycles: BatchCycles, s: Array) -> dict[str, Any]:
        """(n,) half-widths of all numbers of n cycles at the abscissas ``s``."""
        widths = self.half_widths(cycles, s)
        larger, both = widths.pop("map_multiplier"), widths.pop("log_multipliers")
        flights = cycles.section.per_period
        return widths | multiplier_widths(cycles["map_multiplier"], cycles["log_multipliers"], larger, both, flights)

    def half_widths(self, cycles: BatchCycles, s: Array) -> dict[str, Any]:
        """The same of the measured numbers."""
        nodes, spreads, slopes = self._sources
        last, widths = numpy.abs(cycles.last_step).T, {}
        for name in self._measured:
            pole = self._pole(name, cycles)
            spread = numpy.interp(s, nodes, spreads[name]) / pole
            widths[name] = TWIN_FACTOR * spread + 2 * _UNIT * numpy.abs(cycles[name])
            for slope, step in zip(slopes.get(name, ()), last, strict=False):
                widths[name] += _SLOPE * numpy.interp(s, nodes, slope) / pole * step
        return widths

    def _pole(self, name: str, cycles: BatchCycles) -> Any:
        """What a spread of that number is multiplied by where it is interpolated."""
        return cycles.slope ** (_POLE if name in self._by_omega else 1)

    @cached_property
    def _sources(self) -> tuple[Any, dict[str, Any], dict[str, list[Any]]]:
        """On some nodes, in rising s: the spread of each number, and its change with the start."""
        # Both ends among them: towards the Hopf point sensitivities grow without bound.
        every = numpy.append(numpy.arange(len(self._s) - 1, 0, -_EVERY), 0)[::-1]
        nodes = self._nodes.only(every)
        omegas, section, start = nodes["omega"], nodes.section, nodes.guess
        constants = numpy.broadcast_to(self._constants, (len(every), len(self._constants)))
        values = {name: [nodes[name]] for name in self._measured}
        random, guess = numpy.random.default_rng(1), start

        def bits(shape: tuple[int, ...]) -> Any:
            turns = random.random(shape)
            return 1 + ((turns < _SHARE_MOVED).astype(float) - (turns >= 1 - _SHARE_MOVED)) * 2 * _UNIT

        for _ in range(TWINS):
            moved = constants * bits(constants.shape)
            twins = shoot_batch(section, moved, omegas, guess, self._lanes, tolerance=1e-5)
            guess = twins.guess
            for name, of_twins in values.items():
                of_twins.append(twins[name])
        poles = {name: self._pole(name, nodes) for name in self._measured}
        spreads = {name: numpy.ptp(numpy.stack(of_twins), axis=0) * poles[name] for name, of_twins in values.items()}
        slopes: dict[str, list[Any]] = {name: [] for name in self._before}
        shift = _START_SHIFT * self._room[every] / omegas * numpy.abs(start)
        for index in range(3):
            guess = start.copy()
            guess[index] += shift[index]
            shifted = shoot_batch(section, constants, omegas, guess, self._lanes, tolerance=1e-5, whole=False)
            for name in self._before:
                slopes[name].append(numpy.abs(shifted[name] - nodes[name]) / shift[index] * poles[name])
        # A node next to a fold is not found again at its speed; what is interpolated is smooth there.
        rows = [*spreads.values(), *(slope for of_name in slopes.values() for slope in of_name)]
        solved = numpy.isfinite(rows).all(axis=0)
        spreads = {name: _largest_nearby(spread[solved]) for name, spread in spreads.items()}
        slopes = {name: [slope[solved] for slope in of_name] for name, of_name in slopes.items()}
        return self._s[every][solved], spreads, slopes


def multiplier_widths(
    larger: Array, both: Array, larger_width: Array, both_width: Array, flights: int
) -> dict[str, Any]:
    """Half-widths of the multipliers' numbers from those of the map's multiplier and of the logarithms' sum.

    ``flights`` of the map make up a period. Where rounding leaves the slow multiplier undecided its logarithm lies
    between half of the sum and what the multiplier may be at most.
    """
    size = numpy.abs(larger)
    with numpy.errstate(divide="ignore", invalid="ignore"):
        log_slow = flights * numpy.log(size)
        resolved = 2 * larger_width < size
        lost = numpy.maximum(log_slow - both / 2 + both_width, flights * numpy.log(size + larger_width) - log_slow)
        width = numpy.where(resolved, flights * larger_width / (size - larger_width), lost)
        width += 8 * _UNIT * numpy.abs(log_slow)
    slow_width = 2 * size * larger_width + larger_width**2 if flights == 2 else larger_width
    return {
        "multiplier_slow": slow_width + 4 * _UNIT * size**flights,
        "log_multiplier_slow": width,
        "log_multiplier_fast": width + both_width,
    }


def _largest_nearby(values: Array) -> Any:
    """The largest of three neighbours."""
    padded = numpy.pad(values, 1, mode="edge")
    return numpy.max([padded[k : k + len(values)] for k in range(3)], axis=0)
