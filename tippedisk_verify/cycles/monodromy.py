"""The monodromy matrix of a limit cycle, at any point of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy

from tippedisk_verify.errors import InputError
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.contract import STATE_VARIATIONS, Request, Result, raise_unless_usable
from tippedisk_verify.model.exact import exact, fraction
from tippedisk_verify.model.measured import DISTANCES, Measured
from tippedisk_verify.model.precision import DOUBLE, bits
from tippedisk_verify.model.results import Printable

__all__ = ["Monodromy", "monodromy"]

_DOUBLE_BITS = 60  # below 1, down to which what a cycle's numbers may be off lies beside a double's rounding
_MORE_BITS = 16
_MOVED = 2**12  #: half-widths by which a number is moved, so that rounding does not hide what that does


@dataclass(frozen=True, eq=False, repr=False)
class Monodromy(Printable):
    """d(state at ``time`` + T)/d(state at ``time``) along a limit cycle, both (beta, gamma, v) [rad, rad, rad/s].

    ``matrix`` (3, 3) has the half-widths ``uncertainty`` (3, 3); `numpy.asarray` gives it in doubles. Its eigenvalues
    are the Floquet multipliers, the same at every point. Those below its half-widths cannot be seen in it, but in
    ``log_multipliers``, the natural logarithms of their absolute values.

    >>> import tippedisk_verify as tv
    >>> monodromy = tv.Disk("printed").limit_cycle("30.4").monodromy
    >>> print(monodromy.matrix.round(4)[0], f"{monodromy.log_multipliers[2]:.7g}")
    [1.0135 0.4084 0.0088] -96.12968
    """

    listed = ("time", "matrix", "uncertainty", "log_multipliers")

    cycle: Any  #: the `Cycle`, whose file needs this one
    time: Any  #: [s] since the start of ``cycle.orbit()``
    matrix: Any
    uncertainty: Any

    def __call__(self, time: object) -> Monodromy:
        """The matrix at another time [s] of the cycle. Raises InputError unless it lies within a period."""
        return monodromy(self.cycle, time)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        return numpy.array(self.matrix, dtype=float if dtype is None else dtype)

    def __getitem__(self, index: Any) -> Any:
        return self.matrix[index]

    @property
    def log_multipliers(self) -> tuple[Measured, Measured, Measured]:
        """Along the flow (0), of the slow and of the fast one [1]."""
        return Measured(Fraction(0), Fraction(0)), self.cycle.log_multiplier_slow, self.cycle.log_multiplier_fast


def monodromy(cycle: Any, time: object = 0) -> Monodromy:
    """The matrix at a ``time`` [s] within a period, by the variational equations over a whole period from there.

    Its half-widths are the flight's, by wider arithmetic, and what those of the cycle's numbers make of it, by flights
    with each number moved.
    """
    since, period = exact(time), cycle.period
    if not 0 <= float(since) <= float(period):
        raise InputError(f"a point of the cycle has a time from 0 to {float(period):.10g} s")
    numbers = [*cycle._start, period, cycle.omega]
    values = [number.value for number in numbers]
    moves = [number.uncertainty for number in numbers]
    finest = max(move.denominator.bit_length() - move.numerator.bit_length() for move in moves if move)
    precision = DOUBLE if finest < _DOUBLE_BITS else bits(finest + _MORE_BITS)

    def flight(state: Any, duration: object, omega: Fraction, **needs: Any) -> Result:
        request = Request(
            cycle.parameters, omega, state, duration, shifted=True, precision=precision, domain="none", **needs
        )
        return raise_unless_usable(default_engine()(request))

    def point(numbers: list[Any]) -> Any:
        return flight(numbers[:3], since, numbers[4]).state if float(since) else numbers[:3]

    def over_a_period(state: Any, numbers: list[Any], error_estimate: bool = False) -> Result:
        return flight(state, *numbers[3:], variations=STATE_VARIATIONS, error_estimate=error_estimate)

    origin = point(values)
    whole = over_a_period(origin, values, error_estimate=True)
    others = [over_a_period(point(moved), moved) for moved in _each_moved(values, moves)]
    if float(since):
        error = flight(values[:3], since, values[4], error_estimate=True).error
        assert error is not None
        states = _each_moved([fraction(x) for x in origin], [fraction(float(width)) for width in error.state])
        others += [over_a_period(moved, values) for moved in states]
    assert whole.error is not None
    by_moving = sum(abs(other.derivatives - whole.derivatives).astype(float) for other in others)
    width = whole.error.variations.astype(float) * (1 + DISTANCES * len(others) / _MOVED)
    return Monodromy(cycle, time, whole.derivatives, width + by_moving * DISTANCES / _MOVED)


def _each_moved(values: list[Fraction], moves: list[Fraction]) -> Iterator[list[Fraction]]:
    """The values, one of them moved at a time."""
    for place, move in enumerate(moves):
        if move:
            yield [value + _MOVED * move * (n == place) for n, value in enumerate(values)]
