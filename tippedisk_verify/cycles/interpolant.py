"""Many cycles of a family at once: predicted by polynomials through its nodes, and corrected by `batch_shooting`.

All numbers of a family's cycles at its nodes are solved to rounding. Omega(s) is inverted piece by piece, so that a
speed at which two cycles coexist gives both. What is claimed for a number is the subject of `interpolant_budget`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy

from tippedisk_verify.cycles.batch_shooting import BatchCycles, shoot_batch
from tippedisk_verify.cycles.family import Family
from tippedisk_verify.cycles.interpolant_budget import BranchBudget
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.flow.lanes import BatchTaylor, field_constants
from tippedisk_verify.model.arrays import Array

__all__ = ["FamilyInterpolant"]

_FLAT = 0.05  # of the way in the first coordinate to a fold, an error that is no longer linear


class FamilyInterpolant:
    """The cycles of a family of the linear law, as far as it is followed.

    Raises InputError for another law, NoSuchCycleError where one of the family's nodes is not found again.
    """

    def __init__(self, family: Family, lanes: BatchTaylor) -> None:
        family.parameters.refuse_smooth("cycles in batches are")
        self.family, self._lanes = family, lanes
        self._constants = field_constants(family.parameters)
        nodes = family.nodes.T
        self._s = nodes[0]
        first = family.coordinate(self._s)
        guess = numpy.stack((first, nodes[1] * first, nodes[2]))
        #: The cycles at the nodes of the family.
        self.nodes: BatchCycles = shoot_batch(
            family.section, self._constants, nodes[3], guess, lanes, tolerance=1e-9, free_omega=True
        )
        if not self.nodes.converged.all():
            raise NoSuchCycleError(f"the family of {family.section.name} cycles could not be followed")

    @cached_property
    def _budget(self) -> BranchBudget:
        s, slope = self._s, numpy.abs(self.family.nodes[:, 6])
        bend = numpy.abs(numpy.gradient(self.family.nodes[:, 6], s))
        # The way to the Hopf point, to a fold and to the connection, each as the slope there foretells it.
        way = numpy.minimum(numpy.minimum((s - self.family.origin) / 2, 0.25), slope / (2 * bend))
        return BranchBudget(self._constants, self.nodes, s, slope * way, self._lanes)

    def half_widths(self, cycles: BatchCycles) -> dict[str, Array]:
        """For each number of cycles on this family the half-width that holds the truth, as (n,) arrays.

        Infinite next to a fold, where errors in double reach beyond it.
        """
        s = self.family.abscissa(cycles.coordinate)
        widths = self._budget.all_half_widths(cycles, s)
        lost = widths[self.family.section.names[0]] > _FLAT * self.family.to_fold(s)
        return {name: numpy.where(lost, numpy.inf, width) for name, width in widths.items()}

    def solved(self, speeds: Array, s: Array) -> BatchCycles:
        """The cycles at these speeds (n,), next to these abscissas, corrected by Newton's iteration."""
        first, (ratio, flight, _, slope) = self.family.coordinate(s), self.family.at(s)
        # The relative step after which only rounding is left grows as Omega_h or a fold comes near.
        resolved = 1e-11 * numpy.maximum(1.0, 4e-4 / numpy.abs(slope))
        guess = numpy.stack((first, ratio * first, flight))
        section = self.family.section
        cycles = shoot_batch(section, self._constants, speeds, guess, self._lanes, tolerance=resolved)
        # Next to a fold the iteration may have gone beyond it.
        cycles.converged[slope * cycles[f"d{section.names[0]}_domega"] < 0] = False
        return cycles

    def results(self, omegas: Sequence[float], digits: int) -> list[list[Any] | None]:
        """All cycles at each speed [rad/s], from the smallest first coordinate on, as single speeds give them.

        None for a speed that has none, or not only cycles that doubles hold: their period, coordinates and largest lean
        to so many digits, and clear of a fold, where the multiplier says on which side of it they lie.
        """
        speeds = numpy.asarray(omegas, dtype=float)
        s = self.family.abscissas(speeds)
        index, piece = numpy.nonzero(numpy.isfinite(s.T))
        cycles = self.solved(speeds[index], s[piece, index])
        widths = self.half_widths(cycles)
        held = cycles.converged
        for name in ("period", *cycles.section.names, "beta_max"):
            held = held & (widths[name] <= numpy.abs(cycles[name]) * 10.0**-digits)
        measured = iter(
            cycles.only(held).results({name: width[held] for name, width in widths.items()}, self.family.parameters)
        )
        by_speed: list[list[Any]] = [[] for _ in omegas]
        for at, is_held, falls in zip(index.tolist(), held, numpy.array(self.family.falls)[piece], strict=True):
            cycle = next(measured) if is_held else None
            by_speed[at].append(cycle if cycle and cycle.stable is bool(falls) else None)
        lost = numpy.zeros(len(speeds), dtype=bool)
        for gap in self.family.gaps:
            lost |= (min(gap) <= speeds) & (speeds <= max(gap))
        return [None if missing or None in some or not some else some
                for some, missing in zip(by_speed, lost, strict=True)]  # fmt: skip
