"""The defect of a run's Taylor polynomials, and the error that it causes, carried from step to
step.

**Definition.** A run is a polynomial p for each of its steps. Only two things are wrong with it:
its *defect* f(p) - p', and its jumps from the end of one step to the start of the next. The true
motion is p + e, and to first order

    e' = J e + defect,    J = f'(p).

**Arithmetic.** In doubles the defect is rounding. So f(p) and p' are evaluated in wider arithmetic,
with the exact parameters and the exact start. The rest is in doubles, because e is small.

**Method.** The equation is solved by Gauss collocation on the run's own steps. It is A-stable, and
the fast rate times a step is about -5. This is spectral deferred correction (Dutt, Greengard,
Rokhlin, BIT 40, 241, 2000) on Taylor steps. A second sweep takes the defect of p + e and finds the
error of second order.

**Remaining error.** docs/error_of_a_run.md derives what the sweeps miss. It is measured in *carried
roundings*. Take random units in the last place of a double at every step, and constant ones of the
field. Their effect along the run has a root mean square, which is one carried rounding.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy
from numpy.lib.stride_tricks import sliding_window_view
from numpy.polynomial import legendre

from tippedisk_verify.flow.contract import Request
from tippedisk_verify.flow.stepper import DenseOutput
from tippedisk_verify.model.equations import jacobian, shifted_ops, vector_field
from tippedisk_verify.numbers.measured import HALF_WIDTH_FACTOR
from tippedisk_verify.numbers.precision import DOUBLE, Precision

__all__ = ["Defect"]

# The number of random draws. Their root mean square is less than a quarter of the true one once in
# ten million times.
_RANDOM_DRAWS = 16
# The size of a polynomial's terms, in parts of the state, below which they are summed in doubles
# if the wide arithmetic has 64 bits.
_SMALL_TERM = 2.0**-10
# The number of steps on both sides over which a distance between two numbers of nodes counts. At a
# single step it may be small by chance.
_NEIGHBOUR_STEPS = 8
# The places of the distance, as shares of a step: inside a step errors are less exact than at its
# ends.
_STEP_SHARES = numpy.linspace(0, 1, 9)


class Defect:
    """The estimated error of a run in doubles, everywhere along it, from the defect of its
    polynomials.

    Args:
        request: The run.
        series: The polynomials of its steps.
        wide: The arithmetic of the defect.
        nodes: The number of collocation nodes in a step.
    """

    def __init__(self, request: Request, series: DenseOutput, wide: Precision, nodes: int) -> None:
        self._series, self._coefficients, self._wide_precision = series, series.coefficients, wide
        self._places, self._weights, self._basis = _gauss(nodes)
        ends = series.times.astype(wide.number_type)
        lengths = (ends[1:] - ends[:-1])[:, None]
        self._steps = lengths.astype(float)
        self._terms = abs(
            series.coefficients
            * self._steps.T ** numpy.arange(len(series.coefficients))[:, None, None]
        )
        self._sizes = self._terms[0] + self._terms[1]
        small = (self._terms < _SMALL_TERM * self._sizes).all(axis=(1, 2))
        # The number of terms of the polynomials that are summed in wide arithmetic.
        self._wide_terms = (
            len(small) - int(numpy.argmin(small[::-1])) if wide.kind == "extended" else len(small)
        )
        ops, law = shifted_ops(numpy) if request.shifted else numpy, request.law
        self._vector_field = vector_field(
            ops, request.parameters.constants_in(wide), wide.number(request.omega), law
        )
        places = lengths * self._places.astype(wide.number_type)
        self._nodes, self._slopes = (self._polynomial(places, derivative=k) for k in (0, 1))
        setting = ops, request.parameters.constants_in(DOUBLE), DOUBLE.number(request.omega), law
        in_doubles = self._nodes.astype(float)
        rows = [numpy.stack(row, axis=-1) for row in jacobian(*setting)(*in_doubles)]
        matrices = numpy.stack(rows, axis=-2)
        self._system = _system(self._steps[:, 0], _integrals(self._places, self._basis), matrices)

        fastest, growing = self._rates_times_steps(matrices)
        self.max_rate_times_step, self.max_growth_times_step = (
            float(fastest.max()),
            float(growing.max()),
        )
        #: The largest last term of a polynomial, in parts of the state.
        self.last_term = float((self._terms[-1] / (self._sizes + numpy.finfo(float).tiny)).max())
        rates = self.rates(self._nodes)
        defect = numpy.moveaxis((rates - self._slopes).astype(float), 0, 2)
        # The rounding of the field in doubles, which exceeds its last place where terms cancel.
        rounded = (
            abs(numpy.stack(vector_field(*setting)(*in_doubles)) - rates).astype(float) * 2.0**53
        )
        moves = numpy.maximum(abs(rates).astype(float), rounded).max(axis=2) * abs(self._steps.T)
        solved = self._solve_collocation(numpy.concatenate((matrices, defect[..., None]), axis=3))
        self._homogeneous = solved[..., :3]
        self._propagators = numpy.eye(3) + self._error_gains(self._homogeneous)
        starts = series.coefficients[0].astype(wide.number_type)
        gained = self._error_gains(solved[..., 3:])
        gained[:-1, :, 0] += (self._polynomial(lengths)[:, :-1, 0] - starts[:, 1:]).T.astype(float)
        start = (wide.array(request.state) - starts[:, 0]).astype(float)
        noise = _roundings(numpy.maximum(self._terms[0], abs(in_doubles).max(axis=2)), moves)
        carried = _propagated_errors(
            self._propagators,
            numpy.column_stack((start, noise[0])),
            numpy.concatenate((gained, noise), axis=2),
        )
        self.errors = carried[:, :, 0]  #: (n + 1, 3) at the start of each step, and at the end
        self.roundings = numpy.sqrt(numpy.square(carried[:, :, 1:]).mean(axis=2))  #: (n + 1, 3)
        self._rates = self._rates_of(carried[:, :, 0], solved[..., 3])
        self._collocation_errors = numpy.zeros(self.errors.shape)
        #: The uncertainty of the errors, collocation apart, in carried roundings.
        self.uncertainty_in_roundings = 1.0

    def _rates_times_steps(self, matrices: Any) -> tuple[Any, Any]:
        """Return two numbers (n,) for each step of length h: an estimate of h |x| for the largest
        eigenvalue x of the Jacobian, and an upper bound of h |x| for growing eigenvalues.

        The eigenvalues solve

            x^3 = j_vv x^2 + j_vb x + j_gb j_vg,

        and the largest is about that of one term alone. Where j_vv damps and Re x > 0, |x - j_vv|
        exceeds both |x| and |j_vv|. So |x|^2 times either is at most |j_vb x| + |j_gb j_vg|, and
        one of these two terms is at least half of the sum.
        """
        vb, vg, vv = (abs(matrices[:, :, 2, j]) for j in range(3))
        free = abs(matrices[:, :, 1, 0]) * vg
        fastest = numpy.maximum(numpy.maximum(vv, numpy.sqrt(vb)), numpy.cbrt(free))
        with numpy.errstate(divide="ignore", invalid="ignore"):
            first = numpy.fmin(numpy.sqrt(2 * vb), 2 * vb / vv)
            growing = numpy.maximum(
                first, numpy.fmin(numpy.cbrt(2 * free), numpy.sqrt(2 * free / vv))
            )
        growing = numpy.where(matrices[:, :, 2, 2] * self._steps > 0, fastest, growing)
        lengths = abs(self._steps)
        return (fastest * lengths).max(axis=1), (growing * lengths).max(axis=1)

    def sweep(self) -> float:
        """Correct the estimated errors of the run by the defect that polynomial plus error still
        has.

        This is one sweep of deferred correction.

        Returns:
            The largest correction, in carried roundings.
        """
        errors = self._evaluate(self._places)
        slopes = self._slopes + numpy.moveaxis(self._rates, 2, 0)
        rest = (self.rates(self._nodes + numpy.moveaxis(errors, 2, 0)) - slopes).astype(float)
        solved = self._solve_collocation(numpy.moveaxis(rest, 0, 2)[..., None])
        carried = _propagated_errors(
            self._propagators, numpy.zeros((3, 1)), self._error_gains(solved)
        )[:, :, 0]
        self.errors = self.errors + carried
        self._rates = self._rates + self._rates_of(carried, solved[..., 0])
        return float((numpy.abs(carried[1:]) / self.roundings[1:]).max())

    def measure_collocation_error(self, other: Defect) -> None:
        """Estimate how wrong the estimated errors are, by comparison with those computed with fewer
        collocation nodes.

        The largest distance of several neighbouring steps counts.

        Args:
            other: The error of the same run with fewer nodes.
        """
        distances = abs(self._evaluate(_STEP_SHARES) - other._evaluate(_STEP_SHARES)).max(axis=1)
        padded = numpy.pad(
            distances, ((_NEIGHBOUR_STEPS, _NEIGHBOUR_STEPS + 1), (0, 0)), mode="edge"
        )
        self._collocation_errors = sliding_window_view(
            padded, 2 * _NEIGHBOUR_STEPS + 1, axis=0
        ).max(axis=2)

    def _evaluate(self, shares: Any) -> Any:
        """Return the estimated errors (n, k, 3) of the run at given shares of every step."""
        return self.errors[:-1, None] + self._steps[:, :, None] * (
            _integrals(shares, self._basis) @ self._rates
        )

    def evaluate_at(self, times: Any) -> tuple[Any, Any, Any]:
        """Return the run's states, their estimated errors and the uncertainty of these errors, at
        given times.

        Args:
            times: (k,) times [s] in the wide arithmetic, monotonic along the run.

        Returns:
            The values of the polynomials, their errors and the uncertainty of these, each (3, k).
        """
        counts = numpy.bincount(
            self._series.step_of(times.astype(float)), minlength=len(self._steps)
        )
        since = times - numpy.repeat(self._series.times[:-1], counts).astype(
            self._wide_precision.number_type
        )
        lengths = numpy.repeat(self._steps[:, 0], counts)
        errors = numpy.repeat(self.errors[:-1].T, counts, axis=1)
        integrals = _integrals(since.astype(float) / lengths, self._basis).T * lengths
        for integral, rates in zip(integrals, self._rates.transpose(1, 2, 0), strict=True):
            errors += integral * numpy.repeat(rates, counts, axis=1)
        uncertainty = numpy.repeat(self._error_uncertainty(), counts, axis=1)
        return self._polynomial(since, counts), errors, uncertainty

    def evaluate_at_nodes(self) -> tuple[Any, Any, Any, Any]:
        """Return the run's states and their estimated errors at the collocation nodes of all steps,
        in order.

        Returns:
            The times (k,). Then the values of the polynomials, their errors and the uncertainty of
            these, each (3, k).
        """
        times = self._series.times[:-1, None] + self._steps * self._places
        uncertainty = numpy.repeat(self._error_uncertainty(), len(self._places), axis=1)
        errors = self._evaluate(self._places).reshape(-1, 3).T
        return times.ravel(), self._nodes.reshape(3, -1), errors, uncertainty

    def _error_uncertainty(self) -> Any:
        """Return the uncertainty (3, n) of the errors in each step, collocation included.

        The larger of the two ends of each step counts.
        """
        roundings, collocation_errors = (
            numpy.maximum(of[:-1], of[1:]).T for of in (self.roundings, self._collocation_errors)
        )
        return self.uncertainty_in_roundings * roundings + HALF_WIDTH_FACTOR * collocation_errors

    def rates(self, states: Any) -> Any:
        """Return the rates of motion (3, k) at states (3, k), in the wide arithmetic.

        Args:
            states: (3, k) states in wide arithmetic.
        """
        return numpy.stack(self._vector_field(*states))

    def _polynomial(self, since: Any, counts: Any = None, derivative: int = 0) -> Any:
        """Return the values of the steps' polynomials, or of their derivatives, in the wide
        arithmetic.

        Args:
            since: Times since the steps' starts [s]: (n, k) for all steps, or (k,).
            counts: The number of the times (k,) in each step; None for times (n, k).
            derivative: 1 for derivatives, 0 for values.

        Returns:
            An array (3, n, k) or (3, k).
        """
        terms = self._coefficients
        first = terms[: self._wide_terms + derivative].astype(self._wide_precision.number_type)
        if derivative:  # in doubles the products of the first terms would be rounded
            powers = numpy.arange(1, len(terms))[:, None, None]
            terms, first = terms[1:] * powers, first[1:] * powers[: len(first) - 1]

        def spread(term: Any) -> Any:
            return term[:, :, None] if counts is None else numpy.repeat(term, counts, axis=1)

        in_doubles, total = since.astype(float), numpy.zeros((3, *since.shape))
        for term in terms[: len(first) - 1 : -1]:
            total *= in_doubles
            total += spread(term)
        total = total.astype(self._wide_precision.number_type)
        for term in first[::-1]:
            total *= since
            total += spread(term)
        return total

    def _solve_collocation(self, right: Any) -> Any:
        """Solve the collocation equations for errors that are zero at the start of each step.

        Args:
            right: The right-hand sides at the nodes, such as the defect.

        Returns:
            The rates of the errors at the nodes, (n, nodes, 3, k).
        """
        return numpy.linalg.solve(self._system, right.reshape(*self._system.shape[:2], -1)).reshape(
            right.shape
        )

    def _error_gains(self, rates: Any) -> Any:
        """Return the integrals (n, 3, k) of the errors' rates over each step: the errors gained in
        it.
        """
        count, nodes, _, columns = rates.shape
        gained = self._weights @ rates.reshape(count, nodes, 3 * columns)
        return (self._steps * gained).reshape(count, 3, columns)

    def _rates_of(self, errors: Any, gained: Any) -> Any:
        """Return the rates (n, nodes, 3) at the nodes of errors that begin each step with
        ``errors``.

        ``gained`` holds the rates of errors that begin with zero.
        """
        return (self._homogeneous @ errors[:-1, None, :, None])[..., 0] + gained


def _system(steps: Any, inner: Any, matrices: Any) -> Any:
    """Return the matrices (n, 3 nodes, 3 nodes) of the collocation equations.

    The equations are rates = J errors + defect at each node.
    """
    count, nodes = matrices.shape[:2]
    coupled = (-steps[:, None, None] * inner)[:, :, None, :, None] * matrices[:, :, :, None, :]
    system = coupled.reshape(count, 3 * nodes, 3 * nodes)
    system[:, range(3 * nodes), range(3 * nodes)] += 1
    return system


def _roundings(states: Any, moves: Any) -> Any:
    """Return random roundings (n, 3, draws): units in the last place of the state and of the field.

    Those of the state change their sign from step to step; those of the field keep it. ``states``
    and ``moves`` (3, n) are the largest of each step.
    """
    each, same = states.T[..., None], moves.T[..., None]
    signs = _signs(1 << max(len(each) - 1, 1).bit_length())
    return 2.0**-53 * (each * signs[: len(each)] + same * signs[0])


@lru_cache(maxsize=4)
def _signs(count: int) -> Any:
    """Return an array of random signs (count, 3, draws), the same at every call."""
    return numpy.random.default_rng(1).choice([-1.0, 1.0], size=(count, 3, _RANDOM_DRAWS))


def _propagated_errors(carry: Any, start: Any, gained: Any) -> Any:
    """Add up errors along a run: return them at the start and after each step, (n + 1, 3, k).

    Each step multiplies the errors by its matrix ``carry`` and adds its own, ``gained``.
    """
    errors = numpy.concatenate((start[None], gained))
    for matrix, before, after in zip(carry, errors[:-1], errors[1:], strict=True):
        after += matrix.dot(before)
    return errors


@lru_cache(maxsize=16)
def _gauss(nodes: int) -> tuple[Any, Any, Any]:
    """Return the nodes and weights of Gauss-Legendre collocation on [0, 1], and its basis.

    The basis consists of Legendre polynomials.
    """
    at, weights = legendre.leggauss(nodes)
    return (at + 1) / 2, weights / 2, legendre.legvander(at, nodes - 1).T * (weights / 2)


def _integrals(shares: Any, basis: Any) -> Any:
    """Return the integrals (k, nodes) of the collocation's basis functions from 0 to each of these
    shares of a step.

    It uses the discrete orthogonality on Gauss nodes and

        (2 k + 1) P_k = P_(k+1)' - P_(k-1)'.

    Powers would lose digits.
    """
    polynomials = legendre.legvander(2 * shares - 1, len(basis))
    lower = numpy.column_stack((-polynomials[:, 0], polynomials[:, :-2]))
    return (polynomials[:, 1:] - lower) / 2 @ basis
