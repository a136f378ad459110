"""Coordinates about noninverted spinning in which the flow is linear, as power series in 64 bits.

The state is y = (beta_bar, gamma + pi/2, v), and y = W(u, s, f) with

    field(W) = DW (lambda_u u, lambda_s s, lambda_f f),

so that u, s and f grow and decay like exponentials. u = 0 is the stable manifold, s = f = 0 the
unstable one. The monomials u^a s^b f^c with min(a, b) + 2 c up to a number of bands are enough:
along a passage u s is small and f smaller. Terms of one total degree follow from those of lower
degrees, by the divisors a lambda_u + b lambda_s + c lambda_f less an eigenvalue. Small divisors
belong to high bands, whose monomials are tiny. Where the monomials are not tiny, two truncations
differ.

A law with two sides has one chart for either sign of gamma_y. The point symmetry takes one to the
other. The charts of a disk at several speeds are computed at once, and depend on the speed as
polynomials.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise, product
from typing import Any

import numpy
from numpy.polynomial.polynomial import polyval

from tippedisk_verify.model.equations import vector_field
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.exact import fraction
from tippedisk_verify.numbers.precision import EXTENDED
from tippedisk_verify.theory.power_series import ANGLE_OPS
from tippedisk_verify.theory.saddle_manifolds import Saddle

__all__ = ["ChartFamily", "SaddleChart", "angles_and_v", "solve_linear"]

_WORKING_BITS = 96  # of eigenvalues and eigenvectors, beyond the 64 of the series
_SPEED_NODES = 6  # at Chebyshev's nodes: charts hardly bend with the speed
_SPEED_REACH = 2.5e-4  # of the origin, within which these lie
_MAX_CHORD_STEPS = 60  # at most, for the coordinates of a point
_LAST_TERMS = 3  # powers below the order, whose terms show the radius of convergence
# In units of the largest coordinate; a smaller step that does not shrink is rounding.
_ROUNDING_STEP = 2.0**-50


def angles_and_v(y: Sequence[Any]) -> tuple[Any, Any, Any]:
    """Return the angles beta and gamma and v at a point y about the saddle.

    Each angle is a pair of its sine and cosine.
    """
    return (numpy.cos(y[0]), -numpy.sin(y[0])), (-numpy.cos(y[1]), numpy.sin(y[1])), y[2]


class Monomials:
    """The monomials u^a s^b f^c of a truncated series, sorted by total degree, with a table of
    their products.
    """

    def __init__(self, order: int, bands: int) -> None:
        triples = product(range(order + 1), repeat=2)
        kept = [
            (a, b, c)
            for a, b in triples
            for c in range(bands // 2 + 1)
            if a + b + c <= order and min(a, b) + 2 * c <= bands
        ]
        kept.sort(key=sum)
        self.order, self.powers = order, numpy.array(kept)
        self.degrees = self.powers.sum(axis=1)
        ends = numpy.searchsorted(self.degrees, numpy.arange(order + 2))
        self.of_degree = [slice(*pair) for pair in pairwise(ends)]
        places = {triple: place for place, triple in enumerate(kept)}
        self._factors = [self._pairs(kept[of], places) for of in self.of_degree]

    @staticmethod
    def _pairs(
        wanted: Sequence[tuple[int, int, int]], places: dict[Any, int]
    ) -> tuple[Any, Any, Any]:
        """Return the pairs of monomials whose products are these monomials: the indices of the left
        and of the right factors, and the index at which each monomial's pairs begin.
        """
        left, right, begins = list[int](), list[int](), list[int]()
        for triple in wanted:
            begins.append(len(left))
            for factor in product(*(range(power + 1) for power in triple)):
                # Divisors of a kept monomial are kept.
                left.append(places[factor])
                right.append(
                    places[tuple(power - own for power, own in zip(triple, factor, strict=True))]
                )
        return numpy.array(left), numpy.array(right), numpy.array(begins)

    def product(self, p: Any, q: Any, degree: int) -> Any:
        """Return the terms of one total ``degree`` of the product of two series (k, m)."""
        left, right, begins = self._factors[degree]
        return numpy.add.reduceat(p[:, left] * q[:, right], begins, axis=1)

    def at(self, point: Any) -> Any:
        """Return the values of all monomials (m,) at a point (u, s, f)."""
        u, s, f = (table[powers] for table, powers in self._tables(point))
        return u * s * f

    def slopes(self, point: Any) -> Any:
        """Return the derivatives (m, 3) of all monomials at a point (u, s, f)."""
        pairs = self._tables(point)
        u, s, f = (table[powers] for table, powers in pairs)
        by_u, by_s, by_f = (powers * table[powers - (powers > 0)] for table, powers in pairs)
        return numpy.stack((by_u * s * f, u * by_s * f, u * s * by_f), axis=1)

    def _tables(self, point: Any) -> list[tuple[Any, Any]]:
        """Return for each variable a table of its powers at a point, and the exponents (m,) that
        the monomials have.
        """
        tables = (numpy.cumprod([variable**0] + [variable] * self.order) for variable in point)
        return list(zip(tables, self.powers.T, strict=True))


@lru_cache(maxsize=16)
def _monomials(order: int, bands: int) -> Monomials:
    return Monomials(order, bands)


class _Tape:
    """A record of power series (k, m) for k speeds, in the order in which they are computed.

    Each has the rule that gives its terms of one degree.
    """

    def __init__(self, count: int, monomials: Monomials) -> None:
        self.count, self.monomials, self.series = count, monomials, list[_TapeSeries]()

    def extend(self, degree: int) -> None:
        """Compute the terms of one ``degree`` of all recorded series, from those of lower degrees
        and of the variables.
        """
        of = self.monomials.of_degree[degree]
        for series in self.series:
            if series.rule:
                series.terms[:, of] = series.rule(degree, of)

    def sine_and_cosine(
        self, angle: _TapeSeries, sine: int, cosine: int
    ) -> tuple[_TapeSeries, _TapeSeries]:
        """Return the sine and cosine of an angle as series on the tape.

        ``sine`` and ``cosine`` are those of the angle's constant term. Along rays s' = c a' and c'
        = -s a', where a derivative multiplies a term by its degree.
        """
        pair = _TapeSeries(self), _TapeSeries(self)

        def rule(start: int, other: _TapeSeries, sign: int) -> Callable[[int, slice], Any]:
            def terms(degree: int, of: slice) -> Any:
                if not degree:
                    return start
                slope = angle.terms * self.monomials.degrees
                return sign * self.monomials.product(slope, other.terms, degree) / degree

            return terms

        pair[0].rule, pair[1].rule = rule(sine, pair[1], 1), rule(cosine, pair[0], -1)
        return pair


class _TapeSeries:
    """A power series on a tape, with arithmetic. Numbers in its arithmetic are the same for all
    speeds, or have the shape (k, 1).
    """

    __array_ufunc__ = None

    def __init__(self, tape: _Tape, rule: Callable[[int, slice], Any] | None = None) -> None:
        self.tape, self.rule = tape, rule
        self.terms = numpy.zeros((tape.count, len(tape.monomials.powers)), EXTENDED.number_type)
        tape.series.append(self)

    @property
    def degree(self) -> int:
        """The highest total degree that the series keeps."""
        return self.tape.monomials.order

    def __add__(self, other: Any) -> _TapeSeries:
        if isinstance(other, _TapeSeries):
            return _TapeSeries(self.tape, lambda degree, of: self.terms[:, of] + other.terms[:, of])
        return _TapeSeries(
            self.tape, lambda degree, of: self.terms[:, of] + (0 if degree else other)
        )

    __radd__ = __add__

    def __neg__(self) -> _TapeSeries:
        return _TapeSeries(self.tape, lambda degree, of: -self.terms[:, of])

    def __sub__(self, other: Any) -> _TapeSeries:
        return self.__add__(-other)

    def __rsub__(self, other: Any) -> _TapeSeries:
        return (-self).__add__(other)

    def __mul__(self, other: Any) -> _TapeSeries:
        if isinstance(other, _TapeSeries):
            multiply = self.tape.monomials.product
            return _TapeSeries(
                self.tape, lambda degree, of: multiply(self.terms, other.terms, degree)
            )
        return _TapeSeries(self.tape, lambda degree, of: self.terms[:, of] * other)

    __rmul__ = __mul__

    def __truediv__(self, other: _TapeSeries) -> _TapeSeries:
        quotient = _TapeSeries(self.tape)

        def terms(degree: int, of: slice) -> Any:
            quotient.terms[:, of] = 0
            rest = self.tape.monomials.product(other.terms, quotient.terms, degree)
            return (self.terms[:, of] - rest) / other.terms[:, :1]

        quotient.rule = terms
        return quotient


@dataclass(frozen=True)
class SaddleChart:
    """Coordinates (u, s, f) about the saddle at one speed in which the flow is linear.

    W maps them to the offset y from the saddle. A complex speed gives complex numbers, and thus
    derivatives with respect to the speed.
    """

    monomials: Monomials
    coefficients: Any  #: (3, m) of W
    eigenvalues: Any  #: (3,) unstable, slow and fast stable one [1/s]
    inverse_eigenvectors: Any  #: (3, 3) of the matrix of eigenvectors

    def offset_at(self, point: Any) -> Any:
        """Convert chart coordinates (u, s, f) to the offset y (3,) of a state from the saddle."""
        return self.coefficients @ self.monomials.at(point)

    def derivative(self, point: Any) -> Any:
        """Return the derivative DW (3, 3) of the offset y from the saddle with respect to the chart
        coordinates, at a point (u, s, f).
        """
        return self.coefficients @ self.monomials.slopes(point)

    def gradient_in_chart(self, gradient: Sequence[Any]) -> Any:
        """Convert the gradient (3,) of a function at the saddle from the offset y to the chart
        coordinates (u, s, f).
        """
        return numpy.asarray(gradient) @ self.derivative(self.eigenvalues * 0)

    def convergence_radius(self, variable: int) -> float:
        """Estimate the radius of convergence of the chart's series in u (0) or s (1), from the last
        terms that are nearly pure powers of it.
        """
        last = self.monomials.powers[:, variable] >= self.monomials.order - _LAST_TERMS
        sizes, degrees = abs(self.coefficients[:, last]).max(axis=0), self.monomials.degrees[last]
        return float((sizes[sizes > 0] ** (-1 / degrees[sizes > 0])).min())

    def flow(self, point: Any, time: Any) -> Any:
        """Return the chart coordinates (u, s, f) that a motion reaches from given ones after a time
        [s].

        In the chart the flow is linear.
        """
        return point * numpy.exp(self.eigenvalues * time)

    def coordinates(self, y: Any) -> Any:
        """Convert the offset y (3,) of a state from the saddle to chart coordinates (u, s, f), by
        iteration.

        Raises ArithmeticError if the iteration does not settle.
        """
        point, before = self.inverse_eigenvectors @ y, numpy.inf
        for _ in range(_MAX_CHORD_STEPS):
            step = self.inverse_eigenvectors @ (y - self.offset_at(point))
            point, size = point + step, abs(step).max()
            if before / 2 <= size < _ROUNDING_STEP * abs(point).max() or not size:
                return point
            before = size
        raise ArithmeticError("the point is too far from the saddle for its chart")


class ChartFamily:
    """The charts about the saddle at speeds near a speed ``origin`` [rad/s], as polynomials in the
    distance from it.

    ``side`` is the sign of gamma_y whose analytic law they belong to; None for a law without sides.
    """

    def __init__(
        self, parameters: Parameters, origin: Fraction, side: int | None, order: int, bands: int
    ) -> None:
        self.monomials = monomials = _monomials(order, bands)
        reach = float(origin) * _SPEED_REACH
        distances = [
            Fraction(reach * math.cos((k + 0.5) * math.pi / _SPEED_NODES))
            for k in range(_SPEED_NODES)
        ]
        saddles = [
            Saddle(parameters, origin + distance, _WORKING_BITS, 1) for distance in distances
        ]
        eigenvalues = _extended(saddle.eigenvalues for saddle in saddles)
        directions, inverse = (
            _extended(getattr(saddle, name) for saddle in saddles).reshape(-1, 3, 3)
            for name in ("eigenvectors", "inverse_eigenvectors")
        )
        speeds = _extended([saddle.omega] for saddle in saddles)
        terms = _chart_terms(parameters, monomials, side, speeds, eigenvalues, directions, inverse)
        values = numpy.concatenate(
            (eigenvalues, inverse.reshape(-1, 9), terms.reshape(_SPEED_NODES, -1)), axis=1
        )
        steps = _extended([distance] for distance in distances)
        self._polynomials = solve_linear(steps ** numpy.arange(_SPEED_NODES), values)

    def chart_at(self, distance: Any) -> SaddleChart:
        """Return the chart at a given distance of the speed from the origin [rad/s]."""
        values = polyval(distance, self._polynomials)
        return SaddleChart(
            self.monomials, values[12:].reshape(3, -1), values[:3], values[3:12].reshape(3, 3)
        )


def _chart_terms(
    parameters: Parameters,
    monomials: Monomials,
    side: int | None,
    speeds: Any,
    eigenvalues: Any,
    directions: Any,
    inverse: Any,
) -> Any:
    """Return the series terms (k, 3, m) of the chart W at k speeds, computed degree by degree.

    W maps coordinates in which the flow is linear to the offset from the saddle.
    """
    tape = _Tape(len(speeds), monomials)
    beta, gamma, v = (_TapeSeries(tape) for _ in range(3))
    deviations = tape.sine_and_cosine(beta, 1, 0), tape.sine_and_cosine(gamma, -1, 0), v
    # With y from the equilibrium: beta = pi/2 + y, gamma = -pi/2 + y, whose sines and cosines are
    # those of the tape.
    law = parameters.law.taylor_polynomial(
        parameters, _WORKING_BITS, monomials.order, side, EXTENDED.number
    )
    rates = vector_field(ANGLE_OPS, parameters.constants_in(EXTENDED), speeds, law, side)(
        *deviations
    )
    growth = eigenvalues @ monomials.powers.T
    tape.extend(0)
    for degree, of in enumerate(monomials.of_degree[1:], start=1):
        if degree == 1:
            column = directions @ monomials.powers[of].T
        else:
            tape.extend(degree)  # without the unknown terms; the linearisation adds their part
            rest = numpy.stack([rate.terms[:, of] for rate in rates], axis=1)
            column = directions @ (inverse @ rest / (growth[:, None, of] - eigenvalues[:, :, None]))
        for component, terms in zip((beta, gamma, v), numpy.moveaxis(column, 1, 0), strict=True):
            component.terms[:, of] = terms
        tape.extend(degree)
    return numpy.stack([component.terms for component in (beta, gamma, v)], axis=1)


def solve_linear(matrix: Any, right: Any) -> Any:
    """Solve linear equations (n, n) with right sides (n, k), in the arithmetic of the arrays."""
    rows = numpy.concatenate((matrix, right), axis=1)
    for place in range(len(rows)):
        pivot = place + int(numpy.argmax(abs(rows[place:, place])))
        rows[[place, pivot]] = rows[[pivot, place]]
        rows[place] /= rows[place, place]
        others = numpy.arange(len(rows)) != place
        rows[others] -= rows[others, place, None] * rows[place]
    return rows[:, len(rows) :]


def _extended(rows: Iterable[Iterable[Any]]) -> Any:
    return numpy.array([[EXTENDED.number(fraction(number)) for number in row] for row in rows])
