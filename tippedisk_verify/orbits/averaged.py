"""Round-off taken out of limit cycles that feel it: those close to Omega_h.

There the solved numbers amplify every rounding a hundredfold and more. What the flow rounds is averaged out: the same
cycle solved from a start, and at a speed, some roundings away is rounded independently; brought back by the
derivatives, sixteen of them have a quarter of the error in the mean. What the rounded constants do is the same for all
of them: one flight with constants moved along their rounding, only much farther, tells by how much.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy

from tippedisk_verify.flow.lanes import BatchTaylor, field_constants
from tippedisk_verify.flow.system import PARAMETERS
from tippedisk_verify.model.arrays import Array
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.orbits.batch_shooting import Cycles, flight_errors

__all__ = ["averaged", "constants_rounding"]

_REPEATS = 16
_STEPS = (0.7548776662, 0.5698402910, 0.4301597090, 0.2451223338)  # irrational, so that no two repeats are alike
_FARTHEST = 256  # in units of 2^-52; the square of such a step is far below rounding
_MOVED = 2.0**-20  # of the constants: far above rounding, and little beside the distance from Omega_h
_FELT = 256  # where a rounding of Omega moves T by so many of T's own, it is worth it


def constants_rounding(parameters: Parameters) -> Array:
    """(6,) by how much of itself each of the field's constants in double differs from its exact value."""
    exact = parameters.rational()
    names = PARAMETERS[1:]
    return numpy.array(
        [
            float(1 - Fraction(value) / getattr(exact, name))
            for value, name in zip(field_constants(parameters).tolist(), names, strict=True)
        ]
    )


def averaged(parameters: Parameters, cycles: Cycles, lanes: BatchTaylor) -> Cycles:
    """The cycles, with period, gamma_bar_0 and v_0 without most of their round-off where they feel it."""
    felt = numpy.abs(cycles.dperiod_domega) * cycles.omega > _FELT * numpy.abs(cycles.period)
    which = numpy.flatnonzero(cycles.converged & felt)
    if not len(which):
        return cycles
    constants = field_constants(parameters)
    names = ("gamma_bar_0", "v_0", "period")
    halves = numpy.array([1.0, 1.0, 0.5])
    solved = numpy.stack([getattr(cycles, name)[which] for name in names], axis=1) * halves
    by_omega = numpy.stack([getattr(cycles, f"d{name}_domega")[which] for name in names], axis=1) * halves
    omegas, inverse = cycles.omega[which], cycles.sensitivity[which]

    def steps(constants: Array, speeds: Array, starts: Array) -> Any:
        return -(inverse @ flight_errors(constants, speeds, starts, lanes)[:, :, None])[:, :, 0]

    away = numpy.zeros_like(solved)
    for repeat in range(1, _REPEATS + 1):
        moves = numpy.rint((numpy.multiply(repeat, _STEPS) % 1 - 0.5) * 2 * _FARTHEST) * 2.0**-52
        starts, speeds = solved * (1 + moves[:3]), omegas * (1 + moves[3])
        away += (starts - solved) + steps(constants, speeds, starts) - by_omega * (speeds - omegas)[:, None]
    settled = solved + away / _REPEATS
    rounding = constants_rounding(parameters)
    if largest := numpy.abs(rounding).max():
        moved = constants * (1 + _MOVED / largest * rounding)
        by_rounding = (steps(moved, omegas, solved) - steps(constants, omegas, solved)) * (largest / _MOVED)
        settled += by_rounding
    numbers = {name: getattr(cycles, name).copy() for name in names}
    for name, column in zip(names, (settled / halves).T, strict=True):
        numbers[name][which] = column
    return replace(cycles, **numbers)
