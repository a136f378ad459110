"""Limit cycles at many speeds at once, in double, one in each SIMD lane.

The half-period problem with the flight time as an unknown: the flow over tau followed by the symmetry S must return to
the start on the section. Without an event to stop at, a Newton step costs one variational flight per lane and nothing
else. Runs that have converged leave; the others go on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy

from tippedisk_verify.flow.lanes import BatchResult, BatchTaylor
from tippedisk_verify.flow.system import PARAMETERS
from tippedisk_verify.model.arrays import Array
from tippedisk_verify.model.equations import acceleration, shifted
from tippedisk_verify.model.parameters import Constants
from tippedisk_verify.orbits.half_map import EXTREME, VARIATIONS

__all__ = ["Cycles", "Guess", "corrected", "flight_errors"]

_BACK = (1.0, -1.0, -1.0)  # S, the linear part
_MOST_STEPS = 12
_LONGEST = 60.0  # s; half a period within rounding of Omega_h takes less than 6 s
# A step this small (relative) leaves, by quadratic convergence, an error below rounding.
_SMALL_STEP = 1e-11
#: What a run keeps of its last step, and the shape of it.
_LAST = {"step": (3,), "inverse": (3, 3), "by_omega": (3,), "half_map": (2, 2), "residual": (), "trivial": ()}


@dataclass(frozen=True)
class Guess:
    """Where to start: (n,) arrays."""

    gamma_bar_0: Array  #: [rad]
    v_0: Array  #: [rad/s]
    half_period: Array  #: [s]


@dataclass(frozen=True)
class Cycles:
    """n limit cycles as (n,) arrays of doubles; NaN where none was found."""

    omega: Array  #: [rad/s]
    period: Array  #: T [s]
    gamma_bar_0: Array  #: [rad]
    v_0: Array  #: [rad/s]
    beta_max: Array  #: [rad]
    half_multiplier: Array  #: of the half map, the larger one; of a complex pair its modulus, signed [1]
    multiplier_slow: Array  #: its square [1]
    log_multiplier_slow: Array
    log_multiplier_fast: Array
    trivial_multiplier_defect: Array
    dperiod_domega: Array  #: [s^2/rad]
    dgamma_bar_0_domega: Array  #: [s]
    dv_0_domega: Array  #: [1]
    converged: Any  #: whether Newton's iteration ended
    residual: Array  #: |S(flow) - start| of (beta_bar, gamma_bar, v / 10), summed [rad]
    last_step: Array  #: (n, 3) the last Newton step, of (gamma_bar_0, v_0, T / 2): derivatives were taken before it
    sensitivity: Array  #: (n, 3, 3) d(gamma_bar_0, v_0, tau) / d(end of the flight), what an error in the flow does

    @property
    def log_multipliers(self) -> Any:
        """The sum of both logarithms, which is the integral of the divergence."""
        return self.log_multiplier_slow + self.log_multiplier_fast


def corrected(
    constants: Any, omegas: Any, guess: Guess, lanes: BatchTaylor, *, whole: bool = True, tolerance: Any = _SMALL_STEP
) -> Cycles:
    """Newton's iteration for every speed, then all numbers of the cycles found.

    ``constants`` is (6,) or (n, 6), see `flow.lanes.field_constants`. With ``whole=False`` beta_max and the fast
    multiplier, which take another flight, are left out (NaN). ``tolerance``, one or (n,), is the relative step after
    which it ends.
    """
    omegas = numpy.asarray(omegas, dtype=float)
    count = len(omegas)
    tolerance = numpy.broadcast_to(tolerance, count)
    constants = numpy.broadcast_to(constants, (count, len(PARAMETERS) - 1))
    unknowns = numpy.stack((guess.gamma_bar_0, guess.v_0, guess.half_period), axis=1).astype(float)
    converged, last = _iterated(constants, omegas, unknowns, tolerance, lanes)
    (a, b), (c, d) = last["half_map"].transpose(1, 2, 0)
    trace, determinant = a + d, a * d - b * c
    discriminant = trace**2 / 4 - determinant
    root = numpy.copysign(numpy.sqrt(numpy.abs(discriminant)), trace)
    # Of a complex pair the modulus, with the sign that the larger one has where they meet.
    half = numpy.where(discriminant >= 0, trace / 2 + root, numpy.copysign(numpy.sqrt(numpy.abs(determinant)), trace))
    slow = half**2
    log_slow = numpy.log(slow)
    beta_max = log_fast = numpy.full(count, numpy.nan)
    if whole:
        beta_max, divergence = _turned(constants, omegas, unknowns, converged, lanes)
        log_fast = 2 * divergence - log_slow
    return Cycles(
        omega=omegas,
        period=2 * unknowns[:, 2],
        gamma_bar_0=unknowns[:, 0],
        v_0=unknowns[:, 1],
        beta_max=beta_max,
        half_multiplier=half,
        multiplier_slow=slow,
        log_multiplier_slow=log_slow,
        log_multiplier_fast=log_fast,
        trivial_multiplier_defect=abs(last["trivial"] ** 2 - 1),
        dperiod_domega=2 * last["by_omega"][:, 2],
        dgamma_bar_0_domega=last["by_omega"][:, 0],
        dv_0_domega=last["by_omega"][:, 1],
        converged=converged,
        residual=last["residual"],
        last_step=last["step"],
        sensitivity=last["inverse"],
    )


def _iterated(
    constants: Array, omegas: Array, unknowns: Array, tolerance: Any, lanes: BatchTaylor
) -> tuple[Any, dict[str, Any]]:
    """Which runs converge, and the numbers of their last steps (NaN for others); ``unknowns`` become the solutions.

    The stopping rule is not that of `newton`: each run ends by its own step, and leaves.
    """
    count = len(omegas)
    last = {name: numpy.full((count, *shape), numpy.nan) for name, shape in _LAST.items()}
    converged = numpy.zeros(count, dtype=bool)
    active = numpy.flatnonzero(_possible(unknowns))
    smallest = numpy.abs(unknowns[:, 0]) / 5  # below this the iteration is on its way to the equilibrium
    for _ in range(_MOST_STEPS):
        if not len(active):
            break
        step = _Step(constants[active], omegas[active], unknowns[active], lanes)
        unknowns[active] += step.step
        size = numpy.abs(step.step).max(axis=1)
        inside = _possible(unknowns[active]) & (unknowns[active, 0] > smallest[active])
        small = inside & (size <= tolerance[active] * numpy.abs(unknowns[active]).max(axis=1))
        converged[active[small]] = True
        for name, values in last.items():
            values[active[small]] = getattr(step, name)[small]
        active = active[inside & ~small]
    unknowns[~converged] = numpy.nan
    return converged, last


def _possible(unknowns: Array) -> Any:
    """Which runs may go on: on the right side of the section, within the well, and forward in time."""
    gamma_bar, v, half_period = unknowns.T
    inside = (abs(gamma_bar) < math.pi) & (gamma_bar != 0) & (v < 0) & (half_period > 0) & (half_period < _LONGEST)
    return inside & numpy.isfinite(unknowns).all(axis=1)


def _starts(unknowns: Array) -> Array:
    return numpy.stack((numpy.zeros(len(unknowns)), unknowns[:, 0], unknowns[:, 1]), axis=1)


def _errors(flights: BatchResult, unknowns: Array) -> Array:
    """How far S of each flight's end is from its start: (n, 3) of (beta_bar, gamma_bar, v)."""
    beta, gamma, v = flights.states.T
    return numpy.stack((beta, -gamma - unknowns[:, 0], -v - unknowns[:, 1]), axis=1)


def flight_errors(constants: Array, omegas: Array, unknowns: Array, lanes: BatchTaylor) -> Array:
    """(n, 3) errors at the end of half a period from (gamma_bar_0, v_0, T / 2), as `Cycles.sensitivity` takes them."""
    flights = lanes(constants, omegas, _starts(unknowns), unknowns[:, 2], shifted=True)
    return _errors(flights, unknowns) * _BACK


class _Step:
    """One Newton step of every run that is still under way."""

    def __init__(self, constants: Array, omegas: Array, unknowns: Array, lanes: BatchTaylor) -> None:
        flights = lanes(constants, omegas, _starts(unknowns), unknowns[:, 2], shifted=True, variations=VARIATIONS)
        beta, gamma, v = flights.states.T
        ops = shifted(numpy)
        field = Constants(**dict.fromkeys(Constants._fields) | dict(zip(PARAMETERS[1:], constants.T, strict=True)))
        v_rate = acceleration(ops, field, omegas, beta, gamma, v, "linear")
        gamma_rate = omegas * numpy.sin(beta)
        errors = _errors(flights, unknowns)
        rows = flights.derivatives
        matrix = numpy.empty((len(omegas), 3, 3))
        matrix[:, 0, :2], matrix[:, 0, 2] = rows[:, 0, 1:3], v
        matrix[:, 1, :2], matrix[:, 1, 2] = -rows[:, 1, 1:3], -gamma_rate
        matrix[:, 2, :2], matrix[:, 2, 2] = -rows[:, 2, 1:3], -v_rate
        matrix[:, 1, 0] -= 1
        matrix[:, 2, 1] -= 1
        # The Rayleigh quotient of the half map on the flow's direction (v, 0, v'); the linear part of S is -1.
        beta_start, gamma_start, v_start = _starts(unknowns).T
        start_rate = acceleration(ops, field, omegas, beta_start, gamma_start, v_start, "linear")
        beta_image = rows[:, 0, 0] * v_start + rows[:, 0, 2] * start_rate
        v_image = rows[:, 2, 0] * v_start + rows[:, 2, 2] * start_rate
        self.trivial = -(v_start * beta_image + start_rate * v_image) / (v_start**2 + start_rate**2)
        signs = numpy.array(_BACK)
        self.inverse = _inverse(matrix) * signs
        self.step = -(self.inverse @ (errors * signs)[:, :, None])[:, :, 0]
        self.by_omega = -(self.inverse @ rows[:, :, 3:])[:, :, 0]
        self.residual = numpy.abs(errors) @ numpy.array([1.0, 1.0, 0.1])
        # The map on the section: time moves with the start, dt = -d(beta)/v, and gamma' is zero there.
        flight = -rows[:, 0, 1:3] / v[:, None]
        self.half_map = -numpy.stack((rows[:, 1, 1:3], rows[:, 2, 1:3] + v_rate[:, None] * flight), axis=1)


def _inverse(matrices: Array) -> Any:
    try:
        return numpy.linalg.inv(matrices)
    except numpy.linalg.LinAlgError:
        inverses = numpy.full_like(matrices, numpy.nan)
        for index, matrix in enumerate(matrices):
            if numpy.isfinite(matrix).all() and numpy.linalg.matrix_rank(matrix) == 3:
                inverses[index] = numpy.linalg.inv(matrix)
        return inverses


def _turned(
    constants: Array, omegas: Array, unknowns: Array, converged: Any, lanes: BatchTaylor
) -> tuple[Array, Array]:
    """beta_max and the integral of the divergence over half a period."""
    beta_max, divergence = numpy.full(len(omegas), numpy.nan), numpy.full(len(omegas), numpy.nan)
    solved = numpy.flatnonzero(converged)
    if len(solved):
        states = unknowns[solved]
        flights = lanes(
            constants[solved],
            omegas[solved],
            _starts(states),
            states[:, 2],
            shifted=True,
            divergence=True,
            events=(EXTREME,),
        )
        divergence[solved] = flights.divergence
        largest = numpy.zeros(len(solved))
        for _, run, _, (beta, _, _) in flights.crossings:
            largest[run] = max(largest[run], abs(beta))
        beta_max[solved] = largest
    return beta_max, divergence
