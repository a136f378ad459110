"""Limit cycles at many speeds at once, in double, one in each SIMD lane.

With the flight time as an unknown: the flow over tau followed by the section's symmetry must return to the start. For
librating cycles that is the point symmetry S after half a period, for rotating ones a turn of gamma back after a whole
one. Without an event to stop at, a Newton step costs one variational flight per lane and nothing else. Runs that have
converged leave; the others go on.

Either Omega is fixed, or the first coordinate, and Omega is an unknown: a family of cycles may turn round in Omega.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy

from tippedisk_verify.cycles.section import VARIATIONS, Section
from tippedisk_verify.flow.lanes import BatchTaylor
from tippedisk_verify.flow.system import PARAMETERS
from tippedisk_verify.model.arrays import Array
from tippedisk_verify.model.equations import field, shifted
from tippedisk_verify.model.parameters import Constants

__all__ = ["BatchCycles", "shoot_batch"]

_MOST_STEPS = 12
_LONGEST = 60.0  # s; half a period within rounding of Omega_h takes less than 6 s
# A step this small (relative) leaves, by quadratic convergence, an error below rounding.
_SMALL_STEP = 1e-11
_FIRST, _OMEGA = 0, 3  # which of the unknowns, the two coordinates, the flight time and Omega, is fixed


@dataclass(frozen=True)
class BatchCycles:
    """n limit cycles of a section in double; ``cycles[name]`` is a number of each, (n,), NaN where Newton failed.

    Besides omega, the section's `numbers` and the trivial multiplier's defect these are ``log_multipliers``, the sum of
    both logarithms, which is the integral of the divergence, and ``residual``, |image of the flight's end - start| of
    (beta_bar, gamma_bar, v / 10), summed [rad].
    """

    section: Section[Any]
    numbers: Mapping[str, Array]
    converged: Any  #: (n,) whether Newton's iteration ended
    last_step: Array  #: (n, 3) the last Newton step, of the unknowns: derivatives were taken before it

    def __getitem__(self, name: str) -> Array:
        return self.numbers[name]

    @property
    def coordinate(self) -> Array:
        """The section's first coordinate."""
        return self.numbers[self.section.names[0]]

    @property
    def slope(self) -> Any:
        """|dOmega / d(first coordinate)| along the family."""
        return 1 / numpy.abs(self.numbers[f"d{self.section.names[0]}_domega"])

    @property
    def guess(self) -> Any:
        """(3, n): what Newton's iteration starts from to find these cycles again."""
        first, second = (self.numbers[name] for name in self.section.names)
        return numpy.stack((first, second, self.numbers["period"] / self.section.per_period))

    def only(self, which: Any) -> BatchCycles:
        """Some of them."""
        numbers = {name: values[which] for name, values in self.numbers.items()}
        return BatchCycles(self.section, numbers, self.converged[which], self.last_step[which])


def shoot_batch(
    section: Section[Any],
    constants: Any,
    omegas: Any,
    guess: Any,
    lanes: BatchTaylor,
    *,
    whole: bool = True,
    tolerance: Any = _SMALL_STEP,
    free_omega: bool = False,
) -> BatchCycles:
    """Newton's iteration for every speed, then all numbers of its cycle.

    ``constants`` is (6,) or (n, 6), see `flow.lanes.field_constants`, and ``guess`` (3, n): the section's coordinates
    and the flight time. With ``whole=False`` the section's measures and the fast multiplier, which take another
    flight, are left out (NaN). ``tolerance``, one or (n,), is the relative step after which it ends. With
    ``free_omega`` the first coordinate is fixed, and ``omegas`` [rad/s] are guesses.
    """
    unknowns = numpy.stack((*guess, omegas), axis=1).astype(float)
    count = len(unknowns)
    constants = numpy.broadcast_to(constants, (count, len(PARAMETERS) - 1))
    batch = _Batch(section, constants, lanes, _FIRST if free_omega else _OMEGA)
    converged, last = batch.solve(unknowns, numpy.broadcast_to(tolerance, count))
    flown = {name: numpy.full(count, numpy.nan) for name in (*(m.name for m in section.measures), "divergence")}
    if whole and converged.any():
        for name, values in batch.measures(unknowns, numpy.flatnonzero(converged)).items():
            flown[name][converged] = values
    first, second, flight, omega = unknowns.T
    matrix, slopes = last.map.transpose(1, 2, 0), last.by_omega.T
    numbers = section.table((first, second), flight, matrix, slopes, last.trivial, flown, numpy)
    numbers |= {"omega": omega if free_omega else numpy.asarray(omegas, dtype=float), "residual": last.residual}
    return BatchCycles(section, numbers, converged, last.step)


class _Step(NamedTuple):
    """One Newton step of n runs, and what their derivatives tell."""

    step: Array  #: (n, 3) of the three free unknowns
    by_omega: Array  #: (n, 3) derivatives of coordinates and flight time along the family
    map: Array  #: (n, 2, 2) the derivative of the section's map
    residual: Array  #: (n,)
    trivial: Array  #: (n,) the multiplier along the flow


class _Batch:
    """Runs of one section with constants (n, 6), of whose unknowns (n, 4) the one numbered ``held`` is fixed."""

    def __init__(self, section: Section[Any], constants: Array, lanes: BatchTaylor, held: int) -> None:
        self._section, self._constants, self._lanes, self._held = section, constants, lanes, held
        self._free = numpy.delete(numpy.arange(4), held)

    def solve(self, unknowns: Array, tolerance: Array) -> tuple[Any, _Step]:
        """Which runs converge, and their last steps (NaN for others); ``unknowns`` become the solutions.

        Each run ends by its own step, and leaves the others.
        """
        count = len(unknowns)
        last = _Step(*(numpy.full((count, *shape), numpy.nan) for shape in ((3,), (3,), (2, 2), (), ())))
        converged = numpy.zeros(count, dtype=bool)
        active = numpy.flatnonzero(self._possible(unknowns))
        smallest = numpy.abs(unknowns[:, 0]) / 5  # below this the iteration is on its way to the equilibrium
        for _ in range(_MOST_STEPS):
            if not len(active):
                break
            step = self._step(unknowns[active], active)
            unknowns[numpy.ix_(active, self._free)] += step.step
            now = unknowns[active]
            sizes = numpy.abs(now[:, self._free])
            if self._held == _OMEGA:
                sizes = sizes.max(axis=1, keepdims=True)  # the coordinates and the time are of one order
            relative = (numpy.abs(step.step) / sizes).max(axis=1)
            inside = self._possible(now) & (now[:, 0] >= smallest[active])
            small = inside & (relative <= tolerance[active])
            converged[active[small]] = True
            for values, of_step in zip(last, step, strict=True):
                values[active[small]] = of_step[small]
            active = active[inside & ~small]
        unknowns[~converged] = numpy.nan
        return converged, last

    def _possible(self, unknowns: Array) -> Any:
        """Which runs may go on: within the section, and forward in time."""
        first, second, flight, omega = unknowns.T
        inside = self._section.possible(first, second) & (flight > 0) & (flight < _LONGEST) & (omega > 0)
        return inside & numpy.isfinite(unknowns).all(axis=1)

    def _starts(self, unknowns: Array) -> Array:
        starts = numpy.zeros((len(unknowns), 3))
        starts[:, list(self._section.free)] = unknowns[:, :2]
        return starts

    def _step(self, unknowns: Array, runs: Any) -> _Step:
        section, axes = self._section, list(self._section.free)
        constants, starts, omegas = self._constants[runs], self._starts(unknowns), unknowns[:, _OMEGA]
        flights = self._lanes(constants, omegas, starts, unknowns[:, 2], shifted=True, variations=VARIATIONS)
        rows, rates = flights.derivatives, _rates(constants, omegas, flights.states)
        # How far the image of each flight's end is from its start: (n, 3) of (beta_bar, gamma_bar, v).
        errors = section.image * flights.states - starts
        for growth in section.growth:
            errors[:, section.fixed] -= growth
        matrix = section.image * numpy.concatenate((rows[:, :, axes], rates[:, :, None], rows[:, :, 3:]), axis=2)
        for column, axis in enumerate(axes):
            matrix[:, axis, column] -= 1
        inverse = _inverse(matrix[:, :, self._free])
        by_held = numpy.ones_like(unknowns)
        by_held[:, self._free] = -(inverse @ matrix[:, :, self._held, None])[:, :, 0]
        with numpy.errstate(divide="ignore", invalid="ignore"):  # at a fold
            by_omega = by_held[:, :3] / by_held[:, 3:]
        # The map on the section: time moves with the start, dt = -d(fixed component) / its rate.
        times = -rows[:, section.fixed, axes] / rates[:, section.fixed, None]
        moved = [rows[:, axis, axes] + rates[:, axis, None] * times for axis in axes]
        # The Rayleigh quotient of flow and image on the flow's direction.
        direction = _rates(constants, omegas, starts)
        images = (rows[:, :, :3] * direction[:, None]).sum(axis=2)
        return _Step(
            step=-(inverse @ errors[:, :, None])[:, :, 0],
            by_omega=by_omega,
            map=section.image * numpy.stack(moved, axis=1),
            residual=numpy.abs(errors) @ numpy.array([1.0, 1.0, 0.1]),
            trivial=section.image * (images * direction).sum(axis=1) / (direction**2).sum(axis=1),
        )

    def measures(self, unknowns: Array, runs: Any) -> dict[str, Any]:
        """The section's measures, and the integral of the ``divergence`` over a flight, of these runs."""
        states = unknowns[runs]
        flights = self._lanes(
            self._constants[runs],
            states[:, _OMEGA],
            self._starts(states),
            states[:, 2],
            shifted=True,
            divergence=True,
            events=self._section.recorded,
        )
        events: list[list[tuple[str, Any]]] = [[] for _ in runs]
        for name, run, _, state in flights.crossings:
            events[run].append((name, state))
        rows = [self._section.measured(of_run, 0.0) for of_run in events]
        measures: dict[str, Any] = {name: numpy.array([row[name] for row in rows]) for name in rows[0]}
        return measures | {"divergence": flights.divergence}


def _rates(constants: Array, omegas: Array, states: Array) -> Array:
    """(n, 3): the field at shifted states."""
    by_name = Constants(**dict.fromkeys(Constants._fields) | dict(zip(PARAMETERS[1:], constants.T, strict=True)))
    return numpy.stack(field(shifted(numpy), by_name, omegas, "linear")(*states.T), axis=1)


def _inverse(matrices: Array) -> Any:
    try:
        return numpy.linalg.inv(matrices)
    except numpy.linalg.LinAlgError:
        inverses = numpy.full_like(matrices, numpy.nan)
        for index, matrix in enumerate(matrices):
            if numpy.isfinite(matrix).all() and numpy.linalg.matrix_rank(matrix) == 3:
                inverses[index] = numpy.linalg.inv(matrix)
        return inverses
