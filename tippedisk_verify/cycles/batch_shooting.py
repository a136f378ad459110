"""Limit cycles at many speeds at once, in double, one in each SIMD lane.

With the flight time as an unknown: the flow over tau followed by the section's symmetry must return to the start. For
librating cycles that is the point symmetry S after half a period, for rotating ones a turn of gamma back after a whole
one. Without an event to stop at, a Newton step costs one variational flight per lane and nothing else. Runs that have
converged leave; the others go on.

Either Omega is given, or the first coordinate, and Omega is an unknown: a family of cycles may turn round in Omega.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from typing import Any, Self

import numpy

from tippedisk_verify.cycles.half_map import EXTREME, VARIATIONS, HalfFlights
from tippedisk_verify.cycles.turn_map import BOTTOM, TurnFlights
from tippedisk_verify.flow.lanes import BatchResult, BatchTaylor
from tippedisk_verify.flow.system import PARAMETERS
from tippedisk_verify.model.arrays import Array
from tippedisk_verify.model.equations import field, shifted
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Constants, Parameters
from tippedisk_verify.model.precision import DOUBLE

__all__ = [
    "LIBRATING",
    "ROTATING",
    "BatchCycles",
    "BatchSection",
    "Cycles",
    "Guess",
    "RotatingCycles",
    "corrected",
    "measured_cycles",
]

_MOST_STEPS = 12
_LONGEST = 60.0  # s; half a period within rounding of Omega_h takes less than 6 s
# A step this small (relative) leaves, by quadratic convergence, an error below rounding.
_SMALL_STEP = 1e-11
_UNIT = 2.0**-53
#: What a run keeps of its last step, and the shape of it.
_LAST = {"step": (3,), "by_omega": (3,), "map": (2, 2), "residual": (), "trivial": ()}
_FIRST, _OMEGA = 0, 3  # which of the two coordinates, the flight time and Omega is given


@dataclass(frozen=True)
class Guess:
    """Where to start: (n,) arrays of the section's two coordinates and of the flight time."""

    first: Array  #: gamma_bar_0, or beta_bar_top [rad]
    second: Array  #: v_0, or v_top [rad/s]
    flight: Array  #: half a period, or a whole one [s]


@dataclass(frozen=True)
class BatchCycles:
    """n limit cycles as (n,) arrays of doubles; NaN where none was found."""

    omega: Array  #: [rad/s]
    period: Array  #: T [s]
    v_0: Array  #: [rad/s]
    beta_max: Array  #: [rad]
    map_multiplier: Array  #: of the section's map, the larger one; of a complex pair its modulus, signed [1]
    multiplier_slow: Array  #: of a whole period [1]
    log_multiplier_slow: Array
    log_multiplier_fast: Array
    trivial_multiplier_defect: Array
    dperiod_domega: Array  #: [s^2/rad]
    converged: Any  #: whether Newton's iteration ended
    residual: Array  #: |image of the flight's end - start| of (beta_bar, gamma_bar, v / 10), summed [rad]
    last_step: Array  #: (n, 3) the last Newton step, of the unknowns: derivatives were taken before it

    @property
    def log_multipliers(self) -> Any:
        """The sum of both logarithms, which is the integral of the divergence."""
        return self.log_multiplier_slow + self.log_multiplier_fast

    def only(self, which: Any) -> Self:
        """Some of them."""
        return replace(self, **{item.name: getattr(self, item.name)[which] for item in fields(self)})


@dataclass(frozen=True)
class Cycles(BatchCycles):
    """Librating ones; `cycles.LimitCycle` says what each number is."""

    gamma_bar_0: Array  #: [rad]
    dgamma_bar_0_domega: Array  #: [s]
    dv_0_domega: Array  #: [1]


@dataclass(frozen=True)
class RotatingCycles(BatchCycles):
    """Rotating ones; `cycles.RotatingCycle` says what each number is."""

    beta_bar_top: Array  #: [rad]
    v_top: Array  #: [rad/s]
    beta_bar_0: Array  #: [rad]
    dbeta_bar_top_domega: Array  #: [s]
    dv_top_domega: Array  #: [1]


@dataclass(frozen=True)
class BatchSection:
    """Where the cycles of a kind start, and what closes them."""

    flights: type[HalfFlights]  #: the same section for one cycle at a time
    cycles: type[BatchCycles]  #: what many of them are
    across: int  #: the component of the state that is fixed there
    unknowns: list[int]  #: the other two
    moving: tuple[int, ...]  #: those that change there
    image: float  #: the linear part of the symmetry that follows the flow
    turn: tuple[float, float]  #: by how much the fixed component grows, and what its rounding left [rad]
    possible: Callable[[Array, Array], Any]  #: which coordinates a start may have
    measures: tuple[str, ...]  #: what the events of a flight give

    @property
    def laps(self) -> int:
        """Flights that make up a period."""
        return self.flights.per_period

    @property
    def names(self) -> tuple[str, str]:
        """Names of the two coordinates."""
        return self.flights.unknowns

    @property
    def numbers(self) -> tuple[str, ...]:
        """All numbers of a cycle that have half-widths."""
        by_omega = (f"d{name}_domega" for name in ("period", *self.names))
        multipliers = ("multiplier_slow", "log_multiplier_slow", "log_multiplier_fast")
        return ("period", *self.names, *self.measures, *multipliers, *by_omega)

    def guess(self, cycles: BatchCycles) -> Any:
        """(3, n): what Newton's iteration starts from to find these cycles again."""
        first, second = (getattr(cycles, name) for name in self.names)
        return numpy.stack((first, second, cycles.period / self.laps))


#: gamma' is zero on the section, and v < 0 tells its sides apart.
LIBRATING = BatchSection(
    flights=HalfFlights,
    cycles=Cycles,
    across=0,
    unknowns=[1, 2],
    moving=(0, 2),
    image=-1.0,
    turn=(0.0, 0.0),
    possible=lambda gamma_bar, v: (abs(gamma_bar) < math.pi) & (gamma_bar != 0) & (v < 0),
    measures=("beta_max",),
)
#: 2 pi is not a double: the difference is known.
ROTATING = BatchSection(
    flights=TurnFlights,
    cycles=RotatingCycles,
    across=1,
    unknowns=[0, 2],
    moving=(0, 1, 2),
    image=1.0,
    turn=(2 * math.pi, 2.4492935982947064e-16),
    possible=lambda beta_bar, v: (beta_bar > 0) & (beta_bar < math.pi / 2),
    measures=("beta_max", "beta_bar_0", "v_0"),
)


def corrected(
    constants: Any,
    omegas: Any,
    guess: Guess,
    lanes: BatchTaylor,
    *,
    section: BatchSection = LIBRATING,
    whole: bool = True,
    tolerance: Any = _SMALL_STEP,
    free_omega: bool = False,
) -> Any:
    """Newton's iteration for every speed, then all numbers of the cycles found, as the section's ``cycles``.

    ``constants`` is (6,) or (n, 6), see `flow.lanes.field_constants`. With ``whole=False`` the section's ``measures``
    and the fast multiplier, which take another flight, are left out (NaN). ``tolerance``, one or (n,), is the relative
    step after which it ends. With ``free_omega`` the first coordinate is given, and ``omegas`` [rad/s] are guesses.
    """
    omegas = numpy.asarray(omegas, dtype=float)
    count, laps = len(omegas), section.laps
    tolerance = numpy.broadcast_to(tolerance, count)
    constants = numpy.broadcast_to(constants, (count, len(PARAMETERS) - 1))
    unknowns = numpy.stack((guess.first, guess.second, guess.flight, omegas), axis=1).astype(float)
    converged, last = _iterated(constants, unknowns, tolerance, lanes, section, _FIRST if free_omega else _OMEGA)
    if free_omega:
        omegas = unknowns[:, _OMEGA]
    (a, b), (c, d) = last["map"].transpose(1, 2, 0)
    trace, determinant = a + d, a * d - b * c
    discriminant = trace**2 / 4 - determinant
    root = numpy.copysign(numpy.sqrt(numpy.abs(discriminant)), trace)
    # Of a complex pair the modulus, with the sign that the larger one has where they meet.
    larger = numpy.where(discriminant >= 0, trace / 2 + root, numpy.copysign(numpy.sqrt(numpy.abs(determinant)), trace))
    slow = larger**laps
    log_slow = numpy.log(numpy.abs(slow))
    measures = dict.fromkeys(section.measures, numpy.full(count, numpy.nan))
    log_fast = numpy.full(count, numpy.nan)
    if whole:
        measures, divergence = _measured(constants, omegas, unknowns, converged, lanes, section)
        log_fast = laps * divergence - log_slow
    first, second = section.names
    numbers = {first: unknowns[:, 0], second: unknowns[:, 1], **measures}
    for index, name in enumerate(section.names):
        numbers[f"d{name}_domega"] = last["by_omega"][:, index]
    return section.cycles(
        omega=omegas,
        period=laps * unknowns[:, 2],
        map_multiplier=larger,
        multiplier_slow=slow,
        log_multiplier_slow=log_slow,
        log_multiplier_fast=log_fast,
        trivial_multiplier_defect=abs(last["trivial"] ** laps - 1),
        dperiod_domega=laps * last["by_omega"][:, 2],
        converged=converged,
        residual=last["residual"],
        last_step=last["step"],
        **numbers,
    )


def measured_cycles(
    cycles: BatchCycles, widths: dict[str, Array], section: BatchSection, parameters: Parameters
) -> Any:
    """A list of the result objects that single speeds give, with these half-widths (n,) of the section's numbers."""
    columns = {name: (getattr(cycles, name).tolist(), widths[name].tolist()) for name in section.numbers}
    defects, residuals = cycles.trivial_multiplier_defect.tolist(), cycles.residual.tolist()
    results = []
    for index, omega in enumerate(cycles.omega.tolist()):
        measured = {
            name: Measured(Fraction(values[index]), Fraction(uncertainties[index]))
            for name, (values, uncertainties) in columns.items()
        }
        slow = measured["multiplier_slow"]
        certain = abs(abs(slow.value) - 1) > slow.uncertainty
        results.append(
            section.flights.result(
                omega=Measured(Fraction(omega), Fraction(0)),
                **measured,
                trivial_multiplier_defect=Measured.of(defects[index], 2 * defects[index] + 2 * _UNIT),
                stable=bool(abs(slow.value) < 1) if certain else None,
                residuals=(residuals[index],),
                parameters=parameters,
                engine="lanes",
                precision=DOUBLE.name,
            )
        )
    return results


def _iterated(
    constants: Array, unknowns: Array, tolerance: Any, lanes: BatchTaylor, section: BatchSection, given: int
) -> tuple[Any, dict[str, Any]]:
    """Which runs converge, and the numbers of their last steps (NaN for others); ``unknowns`` become the solutions.

    These are (n, 4): both coordinates, the flight time and Omega, of which the one numbered ``given`` stays. The
    stopping rule is not that of `newton`: each run ends by its own step, and leaves.
    """
    count = len(unknowns)
    last = {name: numpy.full((count, *shape), numpy.nan) for name, shape in _LAST.items()}
    converged = numpy.zeros(count, dtype=bool)
    active = numpy.flatnonzero(_possible(unknowns, section))
    smallest = numpy.abs(unknowns[:, 0]) / 5  # below this the iteration is on its way to the equilibrium
    free = numpy.delete(numpy.arange(4), given)
    for _ in range(_MOST_STEPS):
        if not len(active):
            break
        step = _Step(constants[active], unknowns[active], lanes, section, free, given)
        unknowns[numpy.ix_(active, free)] += step.step
        now = unknowns[active]
        sizes = numpy.abs(now[:, free])
        if given == _OMEGA:
            sizes = sizes.max(axis=1, keepdims=True)  # the coordinates and the time are of one order
        relative = (numpy.abs(step.step) / sizes).max(axis=1)
        inside = _possible(now, section) & (now[:, 0] >= smallest[active])
        small = inside & (relative <= tolerance[active])
        converged[active[small]] = True
        for name, values in last.items():
            values[active[small]] = getattr(step, name)[small]
        active = active[inside & ~small]
    unknowns[~converged] = numpy.nan
    return converged, last


def _possible(unknowns: Array, section: BatchSection) -> Any:
    """Which runs may go on: within the section, and forward in time."""
    first, second, flight, omega = unknowns.T
    inside = section.possible(first, second) & (flight > 0) & (flight < _LONGEST) & (omega > 0)
    return inside & numpy.isfinite(unknowns).all(axis=1)


def _starts(unknowns: Array, section: BatchSection) -> Array:
    starts = numpy.zeros((len(unknowns), 3))
    starts[:, section.unknowns] = unknowns[:, :2]
    return starts


def _errors(flights: BatchResult, starts: Array, section: BatchSection) -> Array:
    """How far the image of each flight's end is from its start: (n, 3) of (beta_bar, gamma_bar, v)."""
    errors = section.image * flights.states - starts
    for part in section.turn:
        errors[:, section.across] -= part
    return errors


def _rates(constants: Array, omegas: Array, states: Array) -> Array:
    """(n, 3): the field at shifted states."""
    by_name = Constants(**dict.fromkeys(Constants._fields) | dict(zip(PARAMETERS[1:], constants.T, strict=True)))
    return numpy.stack(field(shifted(numpy), by_name, omegas, "linear")(*states.T), axis=1)


class _Step:
    """One Newton step of every run that is still under way."""

    def __init__(
        self,
        constants: Array,
        unknowns: Array,
        lanes: BatchTaylor,
        section: BatchSection,
        free: Any,
        given: int,
    ) -> None:
        starts, omegas = _starts(unknowns, section), unknowns[:, _OMEGA]
        flights = lanes(constants, omegas, starts, unknowns[:, 2], shifted=True, variations=VARIATIONS)
        rates = _rates(constants, omegas, flights.states)
        errors = _errors(flights, starts, section)
        rows, moved_axes = flights.derivatives, section.unknowns
        matrix = numpy.empty((len(omegas), 3, 4))
        matrix[:, :, :2], matrix[:, :, 2] = section.image * rows[:, :, moved_axes], section.image * rates
        matrix[:, :, 3] = section.image * rows[:, :, 3]
        for column, axis in enumerate(moved_axes):
            matrix[:, axis, column] -= 1
        # The Rayleigh quotient of flow and image on the flow's direction.
        direction = _rates(constants, omegas, starts)
        along = [direction[:, k, None] for k in range(3)]
        images = rows[:, :, 0] * along[0] + rows[:, :, 1] * along[1] + rows[:, :, 2] * along[2]
        self.trivial = section.image * _summed(images * direction) / _summed(direction**2)
        inverse = _inverse(matrix[:, :, free]) * section.image
        self.step = -(inverse @ (errors * section.image)[:, :, None])[:, :, 0]
        by_given = numpy.ones_like(unknowns)
        by_given[:, free] = -(inverse @ (section.image * matrix[:, :, given])[:, :, None])[:, :, 0]
        with numpy.errstate(divide="ignore", invalid="ignore"):  # at a fold
            self.by_omega = by_given[:, :3] / by_given[:, 3:]
        self.residual = numpy.abs(errors) @ numpy.array([1.0, 1.0, 0.1])
        # The map on the section: time moves with the start, dt = -d(fixed component) / its rate.
        flight = -rows[:, section.across, moved_axes] / rates[:, section.across, None]
        moved = [
            rows[:, k, moved_axes] + (rates[:, k, None] * flight if k in section.moving else 0.0) for k in moved_axes
        ]
        self.map = section.image * numpy.stack(moved, axis=1)


def _summed(parts: Array) -> Any:
    return parts[:, 0] + parts[:, 1] + parts[:, 2]


def _inverse(matrices: Array) -> Any:
    try:
        return numpy.linalg.inv(matrices)
    except numpy.linalg.LinAlgError:
        inverses = numpy.full_like(matrices, numpy.nan)
        for index, matrix in enumerate(matrices):
            if numpy.isfinite(matrix).all() and numpy.linalg.matrix_rank(matrix) == 3:
                inverses[index] = numpy.linalg.inv(matrix)
        return inverses


def _measured(
    constants: Array, omegas: Array, unknowns: Array, converged: Any, lanes: BatchTaylor, section: BatchSection
) -> tuple[dict[str, Array], Array]:
    """The section's measures, and the integral of the divergence over a flight."""
    measures = {name: numpy.full(len(omegas), numpy.nan) for name in section.measures}
    divergence = numpy.full(len(omegas), numpy.nan)
    solved = numpy.flatnonzero(converged)
    if len(solved):
        states = unknowns[solved]
        flights = lanes(
            constants[solved],
            omegas[solved],
            _starts(states, section),
            states[:, 2],
            shifted=True,
            divergence=True,
            events=section.flights.recorded,
        )
        divergence[solved] = flights.divergence
        largest = numpy.zeros(len(solved))
        for name, run, _, (beta, _, v) in flights.crossings:
            if name == EXTREME.name:
                largest[run] = max(largest[run], abs(beta))
            elif name == BOTTOM.name:
                measures["beta_bar_0"][solved[run]], measures["v_0"][solved[run]] = beta, v
        measures["beta_max"][solved] = largest
    return measures, divergence
