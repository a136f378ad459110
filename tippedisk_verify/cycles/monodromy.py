"""The monodromy matrix of a limit cycle, and its Floquet vectors, with half-widths."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations
from typing import Any

import numpy

from tippedisk_verify.cycles.limit_cycle import Cycle
from tippedisk_verify.display import Printable, as_json, numbers_as_json
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.contract import STATE_VARIATIONS, Request, Result, raise_unless_usable
from tippedisk_verify.numbers.arrays import numpy_safe, round_to_doubles
from tippedisk_verify.numbers.exact import exact, fraction
from tippedisk_verify.numbers.measured import HALF_WIDTH_FACTOR, Measured
from tippedisk_verify.numbers.precision import DOUBLE, precision_of_bits
from tippedisk_verify.support.progress import report_share

__all__ = ["FloquetVectors", "Monodromy", "monodromy_of"]

Vector = tuple[Measured, Measured, Measured]

# The largest -log2(half-width) for which the monodromy matrix is computed in double.
_DOUBLE_BITS = 60
_MORE_BITS = 16  # bits of the wider arithmetic beyond those of the half-width
# The move of a number, in half-widths. It is large, so that rounding does not hide its effect.
_PERTURBATION_FACTOR = 2**12
# The share of the computing time that the moved flights take; the flight with half-widths follows
_BY_MOVED_FLIGHTS = 0.5


@dataclass(frozen=True, eq=False, repr=False)
class Monodromy(Printable):
    """The monodromy matrix of a limit cycle: d(state at ``time`` + T)/d(state at ``time``).

    Both states are (beta, gamma, v) [rad, rad, rad/s]. ``matrix`` (3, 3) has the half-widths
    ``uncertainty`` (3, 3). `numpy.asarray` converts it to doubles. Its eigenvalues are the Floquet
    multipliers, the same at every point. Multipliers below its half-widths cannot be seen in it.
    ``log_multipliers`` are the natural logarithms of their absolute values.

    >>> import tippedisk_verify as tv
    >>> monodromy = tv.Disk("printed").limit_cycle("30.4").monodromy
    >>> print(monodromy.matrix.round(4)[0], f"{monodromy.log_multipliers[2]:.7g}")
    [1.0135 0.4084 0.0088] -96.12968
    """

    cycle: Cycle  #: the cycle along which it is taken
    time: Any  #: the time [s] since the start of ``cycle.orbit()``
    matrix: Any
    uncertainty: Any

    def __call__(self, time: object) -> Monodromy:
        """Return the monodromy matrix at another time of the cycle.

        Args:
            time: The time [s], within a period.

        Raises:
            InputError: If the time does not lie within a period.
        """
        return monodromy_of(self.cycle, time)

    def to_dict(self) -> dict[str, Any]:
        """Return the monodromy matrix as data for JSON: its time, its entries with half-widths and
        the multipliers' logarithms.
        """
        return {
            "time": as_json(self.time),
            "matrix": numbers_as_json(self.matrix, self.uncertainty),
            "log_multipliers": as_json(self.log_multipliers),
        }

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        return numpy.array(self.matrix, dtype=float if dtype is None else dtype)

    def __getitem__(self, index: Any) -> Any:
        return self.matrix[index]

    @property
    def log_multipliers(self) -> tuple[Measured, Measured, Measured]:
        """The logarithms [1] of the Floquet multipliers: along the flow (0), of the slow and of the
        fast one.
        """
        return (
            Measured(Fraction(0), Fraction(0)),
            self.cycle.log_multiplier_slow,
            self.cycle.log_multiplier_fast,
        )


@dataclass(frozen=True, repr=False)
class FloquetVectors(Printable):
    """The Floquet vectors of a limit cycle at a time: the eigenvectors of its monodromy matrix.

    Each is (beta, gamma, v) [rad, rad, rad/s] of Euclidean length 1, with half-widths. ``flow``
    points along the motion. In ``slow`` and ``fast`` the component of the largest size is positive.
    `numpy.asarray` converts them to doubles, a column for each, in the order of
    `LimitCycle.multipliers`.

    >>> import tippedisk_verify as tv
    >>> vectors = tv.Disk("printed").limit_cycle("30.4").floquet_vectors
    >>> print([f"{component:.6f}" for component in vectors.slow])
    ['-0.521715', '0.236471', '0.819692']
    """

    cycle: Cycle  #: the cycle
    time: Any  #: the time [s] since the start of ``cycle.orbit()``
    flow: Vector  #: of the multiplier 1
    slow: Vector
    fast: Vector
    _listed = ("time", "flow", "slow", "fast")

    @classmethod
    def of(cls, monodromy: Monodromy) -> FloquetVectors:
        """Return the Floquet vectors, the eigenvectors of a monodromy matrix.

        Args:
            monodromy: The matrix.

        Raises:
            AccuracyError: If the slow and the fast multiplier are a complex pair or too close, or
                the matrix has too few digits for a vector.
        """
        cycle, matrix = monodromy.cycle, monodromy.matrix
        slow, log_fast = cycle.multiplier_slow, cycle.log_multiplier_fast
        log_ratio = cycle.log_multiplier_slow - log_fast
        if log_ratio.value <= log_ratio.uncertainty:
            raise AccuracyError(
                "the multipliers are a complex pair, or too close: there are no real vectors"
            )
        rows = [
            [Measured.of(*entry) for entry in zip(*row, strict=True)]
            for row in zip(matrix.tolist(), monodromy.uncertainty.tolist(), strict=True)
        ]
        # The flow keeps the orientation, so both multipliers have one sign.
        fast = log_fast.exp() if slow.value > 0 else -log_fast.exp()
        elapsed = numpy.array([float(exact(monodromy.time))])
        beta_bar, _, v = cycle._states(elapsed, default_engine())[:, 0]
        # beta' and gamma' = -Omega cos(beta), exact to a double's last places even at the saddles
        rates = (float(v), float(cycle.omega) * math.sin(beta_bar))
        flow = _eigenvector(rows, Measured.of(1, 0))
        larger = int(abs(rates[1]) > abs(rates[0]))
        return cls(
            cycle,
            monodromy.time,
            _signed(flow, flow[larger] * rates[larger]),
            *(
                _signed(vector, max(vector, key=lambda component: abs(component.value)))
                for vector in (_eigenvector(rows, slow), _eigenvector(rows, fast))
            ),
        )

    def __call__(self, time: object) -> FloquetVectors:
        """Return the Floquet vectors at another time of the cycle.

        Args:
            time: The time [s], within a period.

        Raises:
            InputError: If the time does not lie within a period.
            AccuracyError: As for `of`.
        """
        return FloquetVectors.of(self.cycle.monodromy(time))

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        return numpy.array([self.flow, self.slow, self.fast], dtype or float).T


def _eigenvector(rows: list[list[Measured]], multiplier: Measured) -> Vector:
    """Return an eigenvector of length 1 of a matrix (3, 3) to a given eigenvalue, with half-widths.

    Its sign is left open. It is perpendicular to all rows of the matrix less the multiplier. The
    two rows whose product is the largest determine it best. Raises AccuracyError if the matrix has
    too few digits.
    """
    rows = [
        [entry - multiplier if n == k else entry for k, entry in enumerate(row)]
        for n, row in enumerate(rows)
    ]
    products = [
        (p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0])
        for p, q in combinations(rows, 2)
    ]
    squares = [x * x + y * y + z * z for x, y, z in products]
    square, (x, y, z) = max(zip(squares, products, strict=True), key=lambda pair: pair[0].value)
    if square.value <= square.uncertainty:
        raise AccuracyError(
            "the monodromy matrix has too few digits for its vectors: ask for a cycle of more digits"
        )
    length = square.sqrt()
    return x / length, y / length, z / length


def _signed(vector: Vector, number: Measured) -> Vector:
    """Return a vector unchanged if a number is positive, and its negative if the number is
    negative.

    Raises AccuracyError if the number's sign is not certain.
    """
    if abs(number.value) <= number.uncertainty:
        raise AccuracyError(
            "the sign of a Floquet vector is not certain: ask for a cycle of more digits"
        )
    x, y, z = vector
    return vector if number.value > 0 else (-x, -y, -z)


def monodromy_of(cycle: Cycle, time: object = 0) -> Monodromy:
    """Return the monodromy matrix of a cycle at a time, by the variational equations over a whole
    period.

    Its half-widths have two parts. One is the flight's own error, by wider arithmetic. The other is
    the effect of the half-widths of the cycle's numbers, by flights with each number moved. Next to
    Omega_h the matrix at the start comes without a flight.

    Args:
        cycle: The cycle.
        time: The time [s] since the start of ``cycle.orbit()``, within a period.

    Raises:
        InputError: If the time does not lie within a period.
        AccuracyError: If the cycle has no half-widths.
    """
    elapsed, period = exact(time), cycle.period
    if not 0 <= float(elapsed) <= float(period):
        raise InputError(f"a point of the cycle has a time from 0 to {float(period):.10g} s")
    if cycle._start_matrix is not None and not float(elapsed):
        return Monodromy(cycle, time, *cycle._start_matrix())
    if not period.is_measured:
        raise AccuracyError("the monodromy matrix needs a cycle with half-widths")
    numbers = [*cycle._start, period, cycle.omega]
    values = [number.value for number in numbers]
    moves = [number.uncertainty for number in numbers]
    finest = max(
        move.denominator.bit_length() - move.numerator.bit_length() for move in moves if move
    )
    precision = DOUBLE if finest < _DOUBLE_BITS else precision_of_bits(finest + _MORE_BITS)

    def flight(state: Any, duration: object, omega: Fraction, **needs: Any) -> Result:
        request = Request(
            cycle.parameters,
            omega,
            state,
            duration,
            shifted=True,
            precision=precision,
            domain="none",
            **needs,
        )
        return raise_unless_usable(default_engine()(request))

    def point(numbers: list[Any]) -> Any:
        return flight(numbers[:3], elapsed, numbers[4]).state if float(elapsed) else numbers[:3]

    def over_a_period(state: Any, numbers: list[Any], error_estimate: bool = False) -> Result:
        return flight(
            state, *numbers[3:], variations=STATE_VARIATIONS, error_estimate=error_estimate
        )

    origin = point(values)
    others, every = list[Result](), list(_each_moved(values, moves))
    for n, moved in enumerate(every, start=1):
        others.append(over_a_period(point(moved), moved))
        report_share(_BY_MOVED_FLIGHTS * n / len(every))
    whole = over_a_period(origin, values, error_estimate=True)
    if float(elapsed):
        error = flight(values[:3], elapsed, values[4], error_estimate=True).error
        assert error is not None
        states = _each_moved(
            [fraction(x) for x in origin], [fraction(float(width)) for width in error.state]
        )
        others += [over_a_period(moved, values) for moved in states]
    assert whole.error is not None
    by_moving = sum(
        round_to_doubles(abs(other.derivatives - whole.derivatives)) for other in others
    )
    width = round_to_doubles(whole.error.derivatives) * (
        1 + HALF_WIDTH_FACTOR * len(others) / _PERTURBATION_FACTOR
    )
    return Monodromy(
        cycle,
        time,
        numpy_safe(whole.derivatives),
        width + by_moving * HALF_WIDTH_FACTOR / _PERTURBATION_FACTOR,
    )


def _each_moved(values: list[Fraction], moves: list[Fraction]) -> Iterator[list[Fraction]]:
    """Yield the values with one of them moved at a time, by `_PERTURBATION_FACTOR` times its entry
    of ``moves``.

    Values whose entry is 0 are not moved.
    """
    for place, move in enumerate(moves):
        if move:
            yield [
                value + _PERTURBATION_FACTOR * move * (n == place) for n, value in enumerate(values)
            ]
