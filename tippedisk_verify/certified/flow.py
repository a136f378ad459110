"""Proved enclosures of the flow: an interval Taylor method in mean-value form.

All states are in shifted angles, (beta - pi/2, gamma - pi/2, v): the section is beta_bar = 0, the symmetry S is x -> -x
and the equilibria are (0, 0, 0) and (0, -pi, 0), (0, pi, 0). The friction law is the linear one.

**One step.** Given a box X of states (a vector of balls) and a ball of speeds Omega, let m be X's midpoint.
Recurrences (`series`) give the Taylor coefficients p_0 … p_N of the orbit from m, and those of the orbits from X
together with their derivatives by state and Omega to order K. Over [0, h] the latter polynomials have a range; padded,
it is a box E. With c the coefficients number K + 1 over E, the step is accepted if

    polynomial(t) + t^(K+1) c  lies in the interior of E  for all t in [0, h].

*Then every orbit from X exists on [0, h] and stays in E.* As long as an orbit has been in E, Taylor's formula with
Lagrange's remainder puts it in E's interior (component by component: the remainder is a coefficient at an earlier point
of the same orbit, so within c). It cannot reach the boundary first, nor blow up in a compact box on which the field is
analytic (c is finite, so M has no zero there). The same argument holds for the derivatives, which are part of the
system (Corliss and Rihm 1996; Nedialkov, Jackson and Pryce 2001: a high-order enclosure). Coefficient number N + 1 over
E gives the remainder of the orbit from m.

**Mean-value form.** By the mean value theorem the image of X at time t lies in

    orbit of m at t  +  [derivatives over X](t) (X - m)  +  [derivative by Omega](t) (Omega - its midpoint),

because balls are convex. Balls put straight through the polynomials would grow like exp(|d(v')/d(v)| t), by some 40
digits a second; in this form the strong contraction along v contracts the ball too, and half a period costs 2 digits.

Where a ball becomes a point or a float: m is a midpoint, and any point of X would do; step lengths, orders and paddings
are floats and integers, and any choice that passes the test above is right. Step lengths are exact dyadic numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

from tippedisk_verify.certified.balls import arb, ball, inside, working_precision
from tippedisk_verify.certified.series import Graph, Node, System
from tippedisk_verify.errors import InputError
from tippedisk_verify.model.equations import Ops, field, shifted
from tippedisk_verify.model.parameters import Constants

__all__ = ["Flight", "Model", "Path", "Status", "Step", "carry"]

_REMAINDER_BITS = 64  # a remainder is needed to its first digits only
_MEAN_VALUE_BITS, _MEAN_VALUE_ORDER = 53, 16  # derivatives that only multiply radii
_MEAN_VALUE_TOLERANCE = -24  # log2 of their remainders: a radius is known to 30 bits anyway
_WIDEST = 3  # -log2 of the radius [rad, rad/s] beyond which a box says too little to go on
_SHORTEST_STEP = 2.0**-40  # s
_MOST_TRIALS = 40
_MOST_STEPS = 20_000

#: ``law(ops, constants, omega)`` is a function of the state that returns its three rates.
Law = Callable[[Any, Constants, Any], Callable[[Any, Any, Any], tuple[Any, Any, Any]]]


class Status(Enum):
    """How a proof that follows the flow ended. The value says what happened and what to try next."""

    REACHED = "the end was reached"
    NO_ENCLOSURE = "no step could be enclosed: work in more bits, or start from a narrower box"
    TOO_WIDE = "the enclosure has grown too wide: work in more bits, or start from a narrower box"
    STEP_LIMIT = "the step limit was reached: shorten the run"


class Model:
    """The equations of motion on balls (Eq. 3DOF, linear friction), with the systems that a step needs.

    ``constants`` as from `balls.ball_constants`; ``omega`` [rad/s], a ball of any radius. Built once, used for any
    number of runs; every enclosure holds for all constants and speeds in their balls. ``law`` replaces the equations,
    for tests with exact answers.
    """

    def __init__(self, constants: Constants, omega: Any, law: Law | None = None) -> None:
        self.constants, self.omega = constants, ball(omega)
        self._law = law or _tippedisk
        thin = Graph()
        variables = [thin.variable() for _ in range(3)]
        # The speed's radius goes with the box, in mean-value form.
        self.orbit = System(thin, variables, self._rates(thin, thin.number(self.omega.mid()), variables))
        graph = Graph()
        variables = [graph.variable() for _ in range(3)]
        speed = graph.number(self.omega, active=True)
        rates = self._rates(graph, speed, variables)
        partials = [graph.gradient(rate, [*variables, speed]) for rate in rates]
        unknowns, slopes = [*variables], [*rates]
        for column in range(4):
            tangent = [graph.variable() for _ in range(3)]
            unknowns += tangent
            for row in partials:
                terms = [part * side for part, side in zip(row, tangent, strict=False) if not _absent(part)]
                if column == 3 and not _absent(row[3]):
                    terms.append(row[3])
                slopes.append(sum(terms[1:], terms[0]) if terms else graph.number(0))
        #: state (3), derivatives by beta, gamma, v and Omega (3 each)
        self.variational = System(graph, unknowns, slopes)
        #: the same and the integral of the field's divergence d(v')/d(v)
        self.with_divergence = System(graph, [*unknowns, graph.variable()], [*slopes, partials[2][2]])

    def _rates(self, graph: Graph, omega: Node, variables: Sequence[Node]) -> tuple[Node, ...]:
        constants = Constants(*(graph.number(value) for value in self.constants))
        return tuple(graph.number(rate) for rate in self._law(graph, constants, omega)(*variables))

    def rates(self, state: Sequence[Any]) -> tuple[Any, Any, Any]:
        """``(beta', gamma', v')`` [rad/s, rad/s, rad/s^2] on balls."""
        return self._law(_BallOps, self.constants, self.omega)(*state)


def _tippedisk(ops: Ops, constants: Constants, omega: Any) -> Callable[[Any, Any, Any], tuple[Any, Any, Any]]:
    return field(shifted(ops), constants, omega, "linear")


class _BallOps:
    @staticmethod
    def sin(angle: Any) -> Any:
        return angle.sin()

    @staticmethod
    def cos(angle: Any) -> Any:
        return angle.cos()


def _absent(node: Node) -> bool:
    return node.constant and isinstance(node.c[0], int) and node.c[0] == 0


@dataclass(frozen=True)
class Step:
    """One accepted step: what is proved over [0, length] from where the path stood."""

    begin: Any  #: time at its start [s]
    length: float  #: [s], exact
    enclosure: tuple[Any, Any, Any]  #: holds the state throughout, for every orbit from the box
    deviation: tuple[Any, Any, Any, Any]  #: the box and the speed's ball, minus their midpoints
    polynomials: list[list[Any]]  #: of the midpoint's orbit, the remainder's coefficient last
    derivatives: list[list[Any]]  #: of the twelve derivatives (and the divergence's integral), likewise

    def derivatives_at(self, time: Any) -> tuple[tuple[Any, Any, Any, Any], ...]:
        """d(state at ``time``)/d(state at the start, Omega) for every orbit from the box; ``time`` in [0, length]."""
        entries = [_polynomial(series, time) for series in self.derivatives[:12]]
        return tuple((entries[row], entries[3 + row], entries[6 + row], entries[9 + row]) for row in range(3))

    def divergence_at(self, time: Any) -> Any:
        """Integral of div f from the step's start."""
        return _polynomial(self.derivatives[12], time)

    def at(self, time: Any) -> tuple[Any, Any, Any]:
        """The state after ``time``, a number or ball within [0, length], for every orbit from the box."""
        rows = self.derivatives_at(time)
        centre = (_polynomial(series, time) for series in self.polynomials)
        return tuple(
            middle + sum(entry * part for entry, part in zip(row, self.deviation, strict=True))
            for middle, row in zip(centre, rows, strict=True)
        )


def _polynomial(coefficients: Sequence[Any], time: Any) -> Any:
    result = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        result = result * time + coefficient
    return result


class Path:
    """Follows all orbits from a box, one proved step after the other, at the working precision.

    ``derivatives``: to the working precision and accumulated over the path, with the divergence's integral; without,
    they are computed roughly, for the mean-value form only.
    """

    def __init__(self, model: Model, start: Sequence[Any], *, derivatives: bool = False) -> None:
        if len(start) != 3:
            raise InputError("a state has three components: beta_bar, gamma_bar, v")
        self.model, self.time, self.box = model, ball(0), tuple(ball(part) for part in start)
        self.sharp = derivatives
        one, zero = ball(1), ball(0)
        self.matrix: tuple[tuple[Any, ...], ...] = tuple(
            tuple(one if row == column else zero for column in range(4)) for row in range(3)
        )
        self.divergence = zero
        self.steps = 0
        self.status: Status | None = None  #: why it stopped, if it did
        self._share = 0.75  # of the length that the midpoint's series allows; follows what is accepted

    def step(self, longest: float | None = None) -> Step | None:
        """A proved step of at most ``longest`` seconds, not yet taken; None, with a status, if none is found."""
        if not all(part.is_finite() for part in self.box):
            self.status = Status.NO_ENCLOSURE
        elif max(_magnitude(part.rad()) for part in self.box) > -_WIDEST:
            self.status = Status.TOO_WIDE
        elif self.steps >= _MOST_STEPS:
            self.status = Status.STEP_LIMIT
        else:
            try:
                step = self._trials(longest)
            except _NotFiniteError:
                step = None
            if step is not None:
                return step
            self.status = Status.NO_ENCLOSURE
        return None

    def take(self, step: Step, time: Any = None) -> None:
        """Go to the step's end, or to ``time`` (a number or ball) within it."""
        moment = ball(step.length) if time is None else time
        self.box = step.at(moment)
        if self.sharp:
            rows = step.derivatives_at(moment)
            self.matrix = tuple(
                tuple(
                    sum(row[k] * self.matrix[k][column] for k in range(3)) + (row[3] if column == 3 else 0)
                    for column in range(4)
                )
                for row in rows
            )
            self.divergence = self.divergence + step.divergence_at(moment)
        self.time = self.time + moment
        self.steps += 1

    def _trials(self, longest: float | None) -> Step | None:
        """Steps of falling length until one passes."""
        model, bits = self.model, _precision()
        middle = [part.mid() for part in self.box]
        deviation = (
            *(part - centre for part, centre in zip(self.box, middle, strict=True)),
            model.omega - model.omega.mid(),
        )
        order = _order(bits)
        thin = model.orbit.coefficients(middle, order)
        rough_order = order if self.sharp else _MEAN_VALUE_ORDER
        system, wide = self._wide_series(rough_order, bits)
        allowed, rough_allowed = self._allowed(bits)
        sizes = [max(0, _magnitude(column[0])) for column in wide[3:]]
        reach, share = _length(thin, allowed), self._share
        for _ in range(_MOST_TRIALS):
            length = _short_float(min(reach * share, longest if longest is not None else math.inf))
            if length < _SHORTEST_STEP:
                return None
            try:
                verdict = self._verdict(system, wide, length, order)
            except _NotFiniteError:
                share *= 0.5
                continue
            enclosure, remainders, rough_remainders, included = verdict
            excess = max(
                _excess(remainders, [0, 0, 0], allowed, length, order + 1),
                _excess(rough_remainders[3:], sizes, [rough_allowed] * len(sizes), length, rough_order + 1),
            )
            better = length / reach * 2.0 ** min(1.0, -excess)
            if included and excess <= 0:
                # A step cut short says nothing about how long the next may be.
                if longest is None or length < longest:
                    self._share = 0.97 * better
                return Step(
                    self.time,
                    length,
                    enclosure,
                    deviation,
                    [[*c, r] for c, r in zip(thin, remainders, strict=True)],
                    [[*c, r] for c, r in zip(wide[3:], rough_remainders[3:], strict=True)],
                )
            share = min(0.97 * better, 0.9 * length / reach)
        return None

    def _wide_series(self, order: int, bits: int) -> tuple[System, list[list[Any]]]:
        """The system of all orbits from the box with their derivatives, and its Taylor coefficients."""
        system = self.model.with_divergence if self.sharp else self.model.variational
        start = [*self.box, *(ball(int(row == column)) for column in range(4) for row in range(3))]
        if self.sharp:
            start.append(ball(0))
        with working_precision(bits if self.sharp else _MEAN_VALUE_BITS):
            return system, system.coefficients(start, order)

    def _allowed(self, bits: int) -> tuple[list[int], int]:
        """log2 of how large remainders may be: of the state's components, and of the derivatives."""
        # As large as rounding, or a hundredth of the ball's radius: 70 steps at most double it.
        allowed = [
            max(max(0, _magnitude(part)) - bits, _magnitude(part.rad()) - 7 if not part.is_exact() else -bits - 99)
            for part in self.box
        ]
        if not self.sharp:
            return allowed, _MEAN_VALUE_TOLERANCE
        # The derivatives differ over the box by about its radius.
        return allowed, max(-bits, max(_magnitude(part.rad()) for part in self.box) - 7)

    def _verdict(
        self, system: System, wide: list[list[Any]], length: float, order: int
    ) -> tuple[tuple[Any, Any, Any], list[Any], list[Any], bool]:
        """The padded box E over [0, length], the remainders' coefficients over it, and whether the step is proved."""
        rough_order = len(wide[0]) - 1
        with working_precision(_REMAINDER_BITS):
            span = ball(length / 2) + arb(0, length / 2)
            ranges = [_polynomial(series, span) for series in wide]
            box = [part + arb(0, part.rad() / 256 + _pad(part)) for part in ranges]
            rough = [series[-1] for series in system.coefficients(box, rough_order + 1)]
            if not all(part.is_finite() for part in rough):
                raise _NotFiniteError
            power = span ** (rough_order + 1)
            included = all(inside(part + r * power, room) for part, r, room in zip(ranges, rough, box, strict=True))
            fine = rough[:3]
            if rough_order != order:
                fine = [series[-1] for series in self.model.orbit.coefficients(box[:3], order + 1)]
                if not all(part.is_finite() for part in fine):
                    raise _NotFiniteError
        return (box[0], box[1], box[2]), fine, rough, included


class _NotFiniteError(ArithmeticError):
    """A coefficient's ball is infinite: the step is too long, or the box too wide."""


def _precision() -> int:
    from flint import ctx

    return int(ctx.prec)


def _order(bits: int) -> int:
    """Order of the midpoint's series: cost grows as its square, step length as 2^(-bits/order): flat about 0.3 bits."""
    return max(_MEAN_VALUE_ORDER, round(0.3 * bits))


def _pad(part: Any) -> Any:
    """An absolute pad for a range that has no width of its own."""
    return arb(2) ** (max(-_REMAINDER_BITS, _magnitude(part) - _REMAINDER_BITS // 2) if part.is_finite() else 0)


def _magnitude(x: Any) -> int:
    """An integer k with |x| < 2^k for all x of the ball, the least but for rounding (-10^6 for zero)."""
    if not x.is_finite():
        raise _NotFiniteError
    mantissa, exponent = x.abs_upper().man_exp()
    return int(mantissa).bit_length() + int(exponent) if mantissa else -1_000_000


def _excess(
    remainders: Sequence[Any], sizes: Sequence[int], allowed: Sequence[int], length: float, power: int
) -> float:
    """By how much log2 of the step's length is too large for the remainders, which grow like its ``power``."""
    size = math.log2(length)
    return max(_magnitude(r) + power * size - s - a for r, s, a in zip(remainders, sizes, allowed, strict=True)) / power


def _length(series: list[list[Any]], allowed: Sequence[int]) -> float:
    """How far the last two coefficients stay below what is allowed: an estimate, the test decides."""
    order = len(series[0]) - 1
    exponents = (
        (limit - _magnitude(column[n])) / n
        for column, limit in zip(series, allowed, strict=True)
        for n in (order - 1, order)
    )
    return math.exp2(min(0.0, *exponents))


def _short_float(length: float) -> float:
    """Rounded down to 20 bits: sums of step lengths are exact."""
    mantissa, exponent = math.frexp(length)
    return math.ldexp(math.floor(mantissa * 2**20), exponent - 20)


@dataclass(frozen=True)
class Flight:
    """Where all orbits from a box are after a time, proved. Only Status.REACHED makes the rest mean anything."""

    status: Status
    time: Any  #: [s]
    state: tuple[Any, Any, Any]  #: holds the end of every orbit, (beta_bar, gamma_bar, v)
    matrix: tuple[tuple[Any, ...], ...] | None  #: (3, 4): d(end)/d(beta, gamma, v at the start, Omega)
    divergence: Any  #: integral of div f over the run, or None
    steps: int
    upright: bool  #: |beta_bar| < pi/2 throughout: the disk does not lie flat


def carry(
    model: Model,
    start: Sequence[Any],
    duration: object,
    *,
    derivatives: bool = False,
    watch: Callable[[Step], None] | None = None,
) -> Flight:
    """Enclose the flow for ``duration`` seconds (an exact number or a ball, positive) from a box of states.

    ``watch`` is called with every step before it is taken. Raises InputError for a duration that is not positive.
    """
    span = ball(duration)
    if not span > 0:
        raise InputError("the duration must be positive")
    path = Path(model, start, derivatives=derivatives)
    upright = True
    share = 1.0
    while True:
        left = span - path.time  # positive: what was taken is proved to be shorter
        step = path.step(max(share * _float_above(left), 2 * _SHORTEST_STEP))
        if step is None:
            status = path.status or Status.NO_ENCLOSURE
            break
        if not (left <= step.length or left > step.length):
            share /= 2  # the step ends within the duration's ball
            continue
        share = 1.0
        upright = upright and inside(step.enclosure[0], arb(0, 1.5707))
        if watch is not None:
            watch(step)
        if left <= step.length:
            path.take(step, left)
            status = Status.REACHED
            break
        path.take(step)
    return Flight(
        status,
        path.time,
        path.box,
        path.matrix if derivatives else None,
        path.divergence if derivatives else None,
        path.steps,
        upright,
    )


def _float_above(x: Any) -> float:
    """A float of 20 bits that is not below any point of the ball."""
    return _short_float(float(x.abs_upper()) * (1 + 2.0**-18))
