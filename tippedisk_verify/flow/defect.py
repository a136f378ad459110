"""The error of a run in doubles from the defect of its Taylor polynomials: to first order, or swept until it is gone.

A run is a polynomial p for each of its steps. Its *defect* f(p) - p' and its jumps from the end of one step to the
start of the next are all that is wrong with it: the true motion is p + e with e' = J e + defect to first order, where
J = f'(p). In doubles the defect is rounding, so f(p) and p' are evaluated in wider arithmetic, with the exact
parameters and the exact start. The rest is in doubles, because e is small: Gauss collocation on the run's own steps.
It is A-stable, and the fast rate times a step is about -5. This is spectral deferred correction (Dutt, Greengard,
Rokhlin, BIT 40, 241, 2000) on Taylor steps. A second sweep takes the defect of p + e and finds what is of second order.

docs/error_of_a_run.md derives what the sweeps miss. It is measured in *carried roundings*: the root mean square of what
random units in the last place of a double at every step, and constant ones of the field, become along the run.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy
from numpy.lib.stride_tricks import sliding_window_view
from numpy.polynomial import legendre

from tippedisk_verify.flow.contract import Request
from tippedisk_verify.flow.integrator import Series
from tippedisk_verify.model.equations import field, jacobian, shifted
from tippedisk_verify.model.precision import DOUBLE, Precision

__all__ = ["Defect"]

#: So many draws have a root mean square of less than a quarter of the true one once in ten million times.
_DRAWS = 16
#: Terms of a polynomial, in parts of the state, that are summed in doubles where the wide arithmetic has 64 bits.
_FEW_BITS = 2.0**-10
#: Steps to both sides over which a distance between two numbers of nodes counts: at one it may be small by chance.
_NEIGHBOURS = 8
#: And shares of a step: inside one the errors are less exact than at its ends.
_PLACES = numpy.linspace(0, 1, 9)


class Defect:
    """What a run in doubles is off, everywhere along it."""

    def __init__(self, request: Request, series: Series, wide: Precision, nodes: int) -> None:
        self._series, self._coefficients, self._wide = series, series.coefficients, wide
        self._places, self._weights, self._basis = _gauss(nodes)
        ends = series.times.astype(wide.type)
        lengths = (ends[1:] - ends[:-1])[:, None]
        self._steps = lengths.astype(float)
        self._terms = abs(series.coefficients * self._steps.T ** numpy.arange(len(series.coefficients))[:, None, None])
        self._sizes = self._terms[0] + self._terms[1]
        small = (self._terms < _FEW_BITS * self._sizes).all(axis=(1, 2))
        #: How many terms of the polynomials are summed in wide arithmetic.
        self._leading = len(small) - int(numpy.argmin(small[::-1])) if wide.kind == "extended" else len(small)
        ops, law = shifted(numpy) if request.shifted else numpy, request.friction
        self._field = field(ops, request.parameters.at(wide), wide.number(request.omega), law)
        places = lengths * self._places.astype(wide.type)
        self._nodes, self._slopes = (self._polynomial(places, derivative=k) for k in (0, 1))
        setting = ops, request.parameters.at(DOUBLE), DOUBLE.number(request.omega), law
        in_doubles = self._nodes.astype(float)
        matrices = _matrices(jacobian(*setting)(*in_doubles))
        self._system = _system(self._steps[:, 0], _integrals(self._places, self._basis), matrices)

        fastest, growing = self._rates_times_steps(matrices)
        self.fastest, self.growing = float(fastest.max()), float(growing.max())
        #: The largest last term of a polynomial, in parts of the state.
        self.last_term = float((self._terms[-1] / (self._sizes + numpy.finfo(float).tiny)).max())
        rates = self.rates(self._nodes)
        defect = numpy.moveaxis((rates - self._slopes).astype(float), 0, 2)
        # What doubles do to the field: parts of it, where it is small beside its terms.
        rounded = abs(numpy.stack(field(*setting)(*in_doubles)) - rates).astype(float) * 2.0**53
        moves = numpy.maximum(abs(rates).astype(float), rounded).max(axis=2) * abs(self._steps.T)
        solved = self._solved(numpy.concatenate((matrices, defect[..., None]), axis=3))
        self._homogeneous = solved[..., :3]
        self._carry = numpy.eye(3) + self._gained(self._homogeneous)
        starts = series.coefficients[0].astype(wide.type)
        gained = self._gained(solved[..., 3:])
        gained[:-1, :, 0] += (self._polynomial(lengths)[:, :-1, 0] - starts[:, 1:]).T.astype(float)
        start = (wide.array(request.state) - starts[:, 0]).astype(float)
        noise = _roundings(numpy.maximum(self._terms[0], abs(in_doubles).max(axis=2)), moves)
        carried = _carried(
            self._carry, numpy.column_stack((start, noise[0])), numpy.concatenate((gained, noise), axis=2)
        )
        self.errors = carried[:, :, 0]  #: (n + 1, 3) at the start of each step, and at the end
        self.roundings = numpy.sqrt(numpy.square(carried[:, :, 1:]).mean(axis=2))  #: (n + 1, 3)
        self._rates = self._rates_of(carried[:, :, 0], solved[..., 3])
        self._left_out = numpy.zeros(self.errors.shape)

    def _rates_times_steps(self, matrices: Any) -> tuple[Any, Any]:
        """(n,) The largest rate times step of each, estimated, and a bound for those of what grows.

        Rates x solve x^3 = j_vv x^2 + j_vb x + j_gb j_vg, and the largest is about that of one term alone. Where j_vv
        damps and x grows, |x - j_vv| exceeds both |x| and |j_vv|. So |x|^2 times either is at most |j_vb x| + |j_gb
        j_vg|, and one of these is at least half of the sum.
        """
        vb, vg, vv = (abs(matrices[:, :, 2, j]) for j in range(3))
        free = abs(matrices[:, :, 1, 0]) * vg
        fastest = numpy.maximum(numpy.maximum(vv, numpy.sqrt(vb)), numpy.cbrt(free))
        with numpy.errstate(divide="ignore", invalid="ignore"):
            first = numpy.fmin(numpy.sqrt(2 * vb), 2 * vb / vv)
            growing = numpy.maximum(first, numpy.fmin(numpy.cbrt(2 * free), numpy.sqrt(2 * free / vv)))
        growing = numpy.where(matrices[:, :, 2, 2] * self._steps > 0, fastest, growing)
        lengths = abs(self._steps)
        return (fastest * lengths).max(axis=1), (growing * lengths).max(axis=1)

    def sweep(self) -> float:
        """Correct the errors by the defect that they leave; by how many carried roundings, at the most."""
        errors = self._along(self._places)
        slopes = self._slopes + numpy.moveaxis(self._rates, 2, 0)
        rest = (self.rates(self._nodes + numpy.moveaxis(errors, 2, 0)) - slopes).astype(float)
        solved = self._solved(numpy.moveaxis(rest, 0, 2)[..., None])
        carried = _carried(self._carry, numpy.zeros((3, 1)), self._gained(solved))[:, :, 0]
        self.errors = self.errors + carried
        self._rates = self._rates + self._rates_of(carried, solved[..., 0])
        return float((numpy.abs(carried[1:]) / self.roundings[1:]).max())

    def compare(self, other: Defect) -> None:
        """Take for what the nodes leave out the distance to errors by fewer nodes, the largest of several steps."""
        distances = abs(self._along(_PLACES) - other._along(_PLACES)).max(axis=1)
        padded = numpy.pad(distances, ((_NEIGHBOURS, _NEIGHBOURS + 1), (0, 0)), mode="edge")
        self._left_out = sliding_window_view(padded, 2 * _NEIGHBOURS + 1, axis=0).max(axis=2)

    def _along(self, shares: Any) -> Any:
        """(n, k, 3): the errors at these shares of every step."""
        return self.errors[:-1, None] + self._steps[:, :, None] * (_integrals(shares, self._basis) @ self._rates)

    def at(self, times: Any) -> tuple[Any, Any, Any, Any]:
        """At wide times (k,), along the run: polynomials, errors, carried roundings, what nodes leave out, (3, k)."""
        counts = numpy.bincount(self._series.step_of(times.astype(float)), minlength=len(self._steps))
        since = times - numpy.repeat(self._series.times[:-1], counts).astype(self._wide.type)
        lengths = numpy.repeat(self._steps[:, 0], counts)
        errors = numpy.repeat(self.errors[:-1].T, counts, axis=1)
        integrals = _integrals(since.astype(float) / lengths, self._basis).T * lengths
        for integral, rates in zip(integrals, self._rates.transpose(1, 2, 0), strict=True):
            errors += integral * numpy.repeat(rates, counts, axis=1)
        roundings, left_out = (numpy.repeat(of, counts, axis=1) for of in self._margins())
        return self._polynomial(since, counts), errors, roundings, left_out

    def at_nodes(self) -> tuple[Any, Any, Any, Any, Any]:
        """Times (k,), and the same at them, at the nodes of all steps in their order."""
        times = self._series.times[:-1, None] + self._steps * self._places
        roundings, left_out = (numpy.repeat(of, len(self._places), axis=1) for of in self._margins())
        errors = self._along(self._places).reshape(-1, 3).T
        return times.ravel(), self._nodes.reshape(3, -1), errors, roundings, left_out

    def _margins(self) -> list[Any]:
        """Carried roundings and what nodes leave out, (3, n) the larger of both ends of each step."""
        return [numpy.maximum(of[:-1], of[1:]).T for of in (self.roundings, self._left_out)]

    def rates(self, states: Any) -> Any:
        """The field (3, k) at wide states (3, k)."""
        return numpy.stack(self._field(*states))

    def _polynomial(self, since: Any, counts: Any = None, derivative: int = 0) -> Any:
        """The polynomials, or their derivatives, at wide times since the starts of their steps.

        (3, n, k) at times (n, k) of all steps, or (3, k) at times (k,), of which so many lie in each step.
        """
        terms = self._coefficients
        first = terms[: self._leading + derivative].astype(self._wide.type)
        if derivative:  # the products of the first terms would be rounded in doubles
            powers = numpy.arange(1, len(terms))[:, None, None]
            terms, first = terms[1:] * powers, first[1:] * powers[: len(first) - 1]

        def spread(term: Any) -> Any:
            return term[:, :, None] if counts is None else numpy.repeat(term, counts, axis=1)

        in_doubles, total = since.astype(float), numpy.zeros((3, *since.shape))
        for term in terms[: len(first) - 1 : -1]:
            total *= in_doubles
            total += spread(term)
        total = total.astype(self._wide.type)
        for term in first[::-1]:
            total *= since
            total += spread(term)
        return total

    def _solved(self, right: Any) -> Any:
        """The errors' rates (n, nodes, 3, k) at the nodes for errors that begin with zero."""
        return numpy.linalg.solve(self._system, right.reshape(*self._system.shape[:2], -1)).reshape(right.shape)

    def _gained(self, rates: Any) -> Any:
        """(n, 3, k): their integrals over each step."""
        count, nodes, _, columns = rates.shape
        gained = self._weights @ rates.reshape(count, nodes, 3 * columns)
        return (self._steps * gained).reshape(count, 3, columns)

    def _rates_of(self, errors: Any, gained: Any) -> Any:
        """(n, nodes, 3): the rates at the nodes of errors that begin each step with these."""
        return (self._homogeneous @ errors[:-1, None, :, None])[..., 0] + gained


def _matrices(rows: Any) -> Any:
    """(n, nodes, 3, 3) out of three rows of three arrays."""
    matrices = numpy.empty((*rows[2][2].shape, 3, 3))
    for i, row in enumerate(rows):
        for j, entry in enumerate(row):
            matrices[..., i, j] = entry
    return matrices


def _system(steps: Any, inner: Any, matrices: Any) -> Any:
    """(n, 3 nodes, 3 nodes): the equations of collocation, rates = J errors + defect at each node."""
    count, nodes = matrices.shape[:2]
    coupled = (-steps[:, None, None] * inner)[:, :, None, :, None] * matrices[:, :, :, None, :]
    system = coupled.reshape(count, 3 * nodes, 3 * nodes)
    system[:, range(3 * nodes), range(3 * nodes)] += 1
    return system


def _roundings(states: Any, moves: Any) -> Any:
    """(n, 3, draws): a unit in the last place of the state, up or down, and one of the field's that stays the same.

    ``states`` and ``moves`` (3, n) are the largest of each step.
    """
    each, same = states.T[..., None], moves.T[..., None]
    signs = _signs(1 << max(len(each) - 1, 1).bit_length())
    return 2.0**-53 * (each * signs[: len(each)] + same * signs[0])


@lru_cache(maxsize=4)
def _signs(count: int) -> Any:
    """(count, 3, draws), the same at every call."""
    return numpy.random.default_rng(1).choice([-1.0, 1.0], size=(count, 3, _DRAWS))


def _carried(carry: Any, start: Any, gained: Any) -> Any:
    """(n + 1, 3, k): a start that each step carries on, with what the step adds."""
    errors = numpy.empty((len(carry) + 1, *start.shape))
    errors[0] = start
    for n, (matrix, more) in enumerate(zip(carry, gained, strict=True)):
        errors[n + 1] = matrix @ errors[n] + more
    return errors


@lru_cache(maxsize=16)
def _gauss(nodes: int) -> tuple[Any, Any, Any]:
    """Gauss-Legendre collocation on [0, 1]: the nodes, the weights, and the basis in Legendre polynomials."""
    at, weights = legendre.leggauss(nodes)
    return (at + 1) / 2, weights / 2, legendre.legvander(at, nodes - 1).T * (weights / 2)


def _integrals(shares: Any, basis: Any) -> Any:
    """(k, nodes): the basis integrated from 0 to these shares of a step.

    By the discrete orthogonality on Gauss nodes, and (2 k + 1) P_k = P_(k+1)' - P_(k-1)'. Powers would lose digits.
    """
    polynomials = legendre.legvander(2 * shares - 1, len(basis))
    lower = numpy.column_stack((-polynomials[:, 0], polynomials[:, :-2]))
    return (polynomials[:, 1:] - lower) / 2 @ basis
