"""Limit cycles at many speeds at once, in double, one in each SIMD lane.

The flight time is an unknown. The flow over this time, followed by the section's symmetry, must
return to the start. For librating cycles the symmetry is the point symmetry S after half a period.
For rotating ones it is a turn of gamma back after a whole period.

Without an event to stop at, a Newton step costs one variational flight per lane and nothing else.
Runs that have converged leave the batch; the others go on.

Either Omega or the first coordinate is fixed. With a fixed coordinate Omega is an unknown, because
a family of cycles may turn round in Omega.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy

from tippedisk_verify.cycles.shooting.cycle_numbers import numbers_from_map
from tippedisk_verify.cycles.shooting.section import VARIATIONS, Section
from tippedisk_verify.flow.batch import BatchTaylor
from tippedisk_verify.flow.system import constants_of
from tippedisk_verify.model.equations import shifted_ops, vector_field
from tippedisk_verify.model.friction import LAWS
from tippedisk_verify.numbers.arrays import Array

__all__ = ["BatchCycles", "shoot_batch"]

_MAX_STEPS = 12
_MAX_FLIGHT = 60.0  # s; half a period within rounding of Omega_h takes less than 6 s
# The relative step that leaves, by quadratic convergence, an error below rounding.
_SMALL_STEP = 1e-11
# The places of the unknowns that may be fixed, among the two coordinates, the flight time and
# Omega.
_FIRST, _OMEGA = 0, 3


@dataclass(frozen=True)
class BatchCycles:
    """n limit cycles of a section in double. ``cycles[name]`` is the array (n,) of one number, NaN
    where Newton's iteration failed.

    The names are omega, the section's `number_names` and the trivial multiplier's defect.
    ``log_multipliers`` is the sum of both logarithms, which is the integral of the divergence.
    ``residual`` is the sum of |image of the flight's end - start| over beta_bar, gamma_bar and v /
    10 [rad].
    """

    section: Section[Any]
    numbers: Mapping[str, Array]
    converged: Any  #: (n,) True where Newton's iteration ended
    #: (n, 3) the last Newton step of the unknowns: derivatives were taken before it
    last_step: Array

    def __getitem__(self, name: str) -> Array:
        return self.numbers[name]

    @property
    def coordinate(self) -> Array:
        """The first coordinate on the section of each cycle in the batch (n,)."""
        return self.numbers[self.section.coordinate_names[0]]

    @property
    def slope(self) -> Any:
        """The size of dOmega / d(first coordinate) along the family, at each cycle in the batch
        (n,).
        """
        return 1 / numpy.abs(self.numbers[f"d{self.section.coordinate_names[0]}_domega"])

    @property
    def guess(self) -> Any:
        """The start (3, n) from which Newton's iteration finds these cycles again: both coordinates
        and the flight time.
        """
        first, second = (self.numbers[name] for name in self.section.coordinate_names)
        return numpy.stack(
            (first, second, self.numbers["period"] / self.section.flights_per_period)
        )

    def select(self, which: Any) -> BatchCycles:
        """Return a batch with some of these cycles.

        Args:
            which: The indices or the mask (n,) of the cycles.
        """
        numbers = {name: values[which] for name, values in self.numbers.items()}
        return BatchCycles(self.section, numbers, self.converged[which], self.last_step[which])


def shoot_batch(
    section: Section[Any],
    constants: Any,
    omegas: Any,
    guess: Any,
    batch_engine: BatchTaylor,
    *,
    all_numbers: bool = True,
    tolerance: Any = _SMALL_STEP,
    free_omega: bool = False,
) -> BatchCycles:
    """Solve for the limit cycles at many speeds at once by Newton's iteration, then compute all
    their numbers.

    Args:
        section: The section.
        constants: The constants (6,) or (n, 6), see `flow.batch.equation_constants`.
        omegas: The speeds (n,) [rad/s]; guesses with ``free_omega``.
        guess: The section's coordinates and the flight time, (3, n).
        batch_engine: The engine of the flights.
        all_numbers: If False, leave out (NaN) the section's event quantities and the fast
            multiplier, which take another flight.
        tolerance: The relative step that ends the iteration, one or (n,).
        free_omega: If True, fix the first coordinate instead of Omega.

    Returns:
        The cycles, NaN where the iteration failed.
    """
    unknowns = numpy.stack((*guess, omegas), axis=1).astype(float)
    count = len(unknowns)
    constants = numpy.broadcast_to(constants, (count, numpy.shape(constants)[-1]))
    batch = _SectionBatch(section, constants, batch_engine, _FIRST if free_omega else _OMEGA)
    converged, last = batch.solve(unknowns, numpy.broadcast_to(tolerance, count))
    flown = {
        name: numpy.full(count, numpy.nan)
        for name in (*(m.name for m in section.event_quantities), "divergence")
    }
    if all_numbers and converged.any():
        for name, values in batch.event_quantities(unknowns, numpy.flatnonzero(converged)).items():
            flown[name][converged] = values
    first, second, flight, omega = unknowns.T
    matrix, slopes = last.map.transpose(1, 2, 0), last.family_slopes.T
    numbers = numbers_from_map(
        section, (first, second), flight, matrix, slopes, last.trivial, flown, numpy
    )
    numbers |= {
        "omega": omega if free_omega else numpy.asarray(omegas, dtype=float),
        "residual": last.residual,
    }
    return BatchCycles(section, numbers, converged, last.step)


class _NewtonStep(NamedTuple):
    """One Newton step for n cycles at once, and the numbers that their derivatives give."""

    step: Array  #: (n, 3) the step of the three free unknowns
    family_slopes: Array  #: (n, 3) derivatives of coordinates and flight time along the family
    map: Array  #: (n, 2, 2) the derivative of the section's map
    residual: Array  #: (n,)
    trivial: Array  #: (n,) the multiplier along the flow


class _SectionBatch:
    """Newton's iteration for n cycles of one section at once, each with constants of its own (n,
    6).

    The unknown (n, 4) numbered ``fixed_unknown`` is fixed.
    """

    def __init__(
        self,
        section: Section[Any],
        constants: Array,
        batch_engine: BatchTaylor,
        fixed_unknown: int,
    ) -> None:
        self._section, self._constants = section, constants
        self._batch_engine, self._fixed_unknown = batch_engine, fixed_unknown
        self._free = numpy.delete(numpy.arange(4), fixed_unknown)

    def solve(self, unknowns: Array, tolerance: Array) -> tuple[Any, _NewtonStep]:
        """Solve for all cycles of the batch by Newton's iteration.

        ``unknowns`` has the guesses, and is overwritten by the solutions. Each run ends by its own
        step and leaves the others. Returns a mask of the runs that converge, and their last steps
        (NaN for others).
        """
        count = len(unknowns)
        last = _NewtonStep(
            *(numpy.full((count, *shape), numpy.nan) for shape in ((3,), (3,), (2, 2), (), ()))
        )
        converged = numpy.zeros(count, dtype=bool)
        active = numpy.flatnonzero(self._may_continue(unknowns))
        # Below this the iteration is on its way to the equilibrium.
        smallest = numpy.abs(unknowns[:, 0]) / 5
        for _ in range(_MAX_STEPS):
            if not len(active):
                break
            step = self._step(unknowns[active], active)
            unknowns[numpy.ix_(active, self._free)] += step.step
            now = unknowns[active]
            sizes = numpy.abs(now[:, self._free])
            if self._fixed_unknown == _OMEGA:
                # The coordinates and the time are of one order
                sizes = sizes.max(axis=1, keepdims=True)
            relative = (numpy.abs(step.step) / sizes).max(axis=1)
            inside = self._may_continue(now) & (now[:, 0] >= smallest[active])
            small = inside & (relative <= tolerance[active])
            converged[active[small]] = True
            for values, of_step in zip(last, step, strict=True):
                values[active[small]] = of_step[small]
            active = active[inside & ~small]
        unknowns[~converged] = numpy.nan
        return converged, last

    def _may_continue(self, unknowns: Array) -> Any:
        """Return a mask of the runs whose iteration may go on: their unknowns are finite, the point
        is possible on the section, and flight time and speed are positive.
        """
        first, second, flight, omega = unknowns.T
        inside = (
            self._section.allows_start(first, second)
            & (flight > 0)
            & (flight < _MAX_FLIGHT)
            & (omega > 0)
        )
        return inside & numpy.isfinite(unknowns).all(axis=1)

    def _starts(self, unknowns: Array) -> Array:
        starts = numpy.zeros((len(unknowns), 3))
        starts[:, list(self._section.free_components)] = unknowns[:, :2]
        return starts

    def _step(self, unknowns: Array, runs: Any) -> _NewtonStep:
        section, axes = self._section, list(self._section.free_components)
        constants, starts, omegas = (
            self._constants[runs],
            self._starts(unknowns),
            unknowns[:, _OMEGA],
        )
        flights = self._batch_engine(
            constants, omegas, starts, unknowns[:, 2], shifted=True, variations=VARIATIONS
        )
        rows, rates = flights.derivatives, _rates(constants, omegas, flights.states)
        # The image of each flight's end less its start, (n, 3): (beta_bar, gamma_bar, v).
        errors = section.symmetry_sign * flights.states - starts
        for growth in section.growth:
            errors[:, section.zero_component] -= growth
        matrix = section.symmetry_sign * numpy.concatenate(
            (rows[:, :, axes], rates[:, :, None], rows[:, :, 3:]), axis=2
        )
        for column, axis in enumerate(axes):
            matrix[:, axis, column] -= 1
        inverse = _inverse(matrix[:, :, self._free])
        by_held = numpy.ones_like(unknowns)
        by_held[:, self._free] = -(inverse @ matrix[:, :, self._fixed_unknown, None])[:, :, 0]
        with numpy.errstate(divide="ignore", invalid="ignore"):  # at a fold
            family_slopes = by_held[:, :3] / by_held[:, 3:]
        # The map on the section: time moves with the start, dt = -d(fixed component) / its rate.
        times = -rows[:, section.zero_component, axes] / rates[:, section.zero_component, None]
        moved = [rows[:, axis, axes] + rates[:, axis, None] * times for axis in axes]
        # The Rayleigh quotient of the flow and the symmetry, on the flow's direction.
        direction = _rates(constants, omegas, starts)
        images = (rows[:, :, :3] * direction[:, None]).sum(axis=2)
        return _NewtonStep(
            step=-(inverse @ errors[:, :, None])[:, :, 0],
            family_slopes=family_slopes,
            map=section.symmetry_sign * numpy.stack(moved, axis=1),
            residual=numpy.abs(errors) @ numpy.array([1.0, 1.0, 0.1]),
            trivial=section.symmetry_sign
            * (images * direction).sum(axis=1)
            / (direction**2).sum(axis=1),
        )

    def event_quantities(self, unknowns: Array, runs: Any) -> dict[str, Any]:
        """Return further numbers of the cycles, by name, from one more flight of each.

        They are the section's event quantities, such as the largest lean, and the integral of the
        ``divergence`` over a flight. ``runs`` are the indices (k,) of the cycles, and the numbers
        are arrays (k,).
        """
        states = unknowns[runs]
        flights = self._batch_engine(
            self._constants[runs],
            states[:, _OMEGA],
            self._starts(states),
            states[:, 2],
            shifted=True,
            divergence=True,
            events=self._section.recorded_events,
        )
        events: list[list[tuple[str, Any]]] = [[] for _ in runs]
        for name, run, _, state in flights.crossings:
            events[run].append((name, state))
        rows = [self._section.quantities_at_events(of_run, 0.0) for of_run in events]
        event_quantities: dict[str, Any] = {
            name: numpy.array([row[name] for row in rows]) for name in rows[0]
        }
        return event_quantities | {"divergence": flights.divergence}


def _rates(constants: Array, omegas: Array, states: Array) -> Array:
    """Return the rates of motion (n, 3) under the linear law at shifted states (n, 3), each for its
    own disk and speed.
    """
    law = LAWS["linear"]
    by_name = constants_of((omegas, *constants.T), law)
    return numpy.stack(vector_field(shifted_ops(numpy), by_name, omegas, law)(*states.T), axis=1)


def _inverse(matrices: Array) -> Any:
    try:
        return numpy.linalg.inv(matrices)
    except numpy.linalg.LinAlgError:
        inverses = numpy.full_like(matrices, numpy.nan)
        for index, matrix in enumerate(matrices):
            if numpy.isfinite(matrix).all() and numpy.linalg.matrix_rank(matrix) == 3:
                inverses[index] = numpy.linalg.inv(matrix)
        return inverses
