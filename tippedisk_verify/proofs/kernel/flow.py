"""Proved enclosures of the flow: an interval Taylor method in mean-value form.

All states are in shifted angles, (beta - pi/2, gamma - pi/2, v): the section is beta_bar = 0, the symmetry S is x -> -x
and the equilibria are (0, 0, 0) and (0, -pi, 0), (0, pi, 0). The friction law is linear (the smooth
one: `sliding`).

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
from functools import cached_property, reduce
from operator import and_
from typing import Any

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.equations import Ops, field, shifted
from tippedisk_verify.model.parameters import Constants
from tippedisk_verify.proofs.kernel.balls import (
    BallOps,
    alike,
    arb,
    around_zero,
    ball,
    inside,
    side_by_side,
    upper,
    working_bits,
    working_precision,
)
from tippedisk_verify.proofs.kernel.frame import Frame
from tippedisk_verify.proofs.kernel.jets import Jet
from tippedisk_verify.proofs.kernel.lanes import Lanes
from tippedisk_verify.proofs.kernel.series import Graph, Node, System, with_derivatives

__all__ = ["Flight", "Law", "Model", "Path", "Status", "Step", "carry"]

_REMAINDER_BITS = 64  # a remainder is needed to its first digits only
_MEAN_VALUE_BITS, _MEAN_VALUE_ORDER = 53, 16  # derivatives that only multiply radii
#: Over a wide box, the order of the series and how often it decays along v in a step: balls add up what alternates, so
#: that derivatives over the box are exp(twice that) times as wide as they are.
_WIDE_ORDER, _DAMPED = 8, 0.5
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
    GRAZING = (
        "the sliding velocity is not proved to keep its sign or to change it at a rate other than zero: work in more "
        "bits, from a narrower box, or at another speed"
    )
    STEP_LIMIT = "the step limit was reached: shorten the run"


class Model:
    """The equations of motion on balls (Eq. 3DOF, linear friction), with the systems that a step needs.

    ``constants`` as from `balls.ball_constants`; ``omega`` [rad/s], a ball of any radius or a `Jet` of such; or `Lanes`
    for both. Built once, used for any number of runs; every enclosure holds for all constants and speeds in their
    balls. ``law`` replaces the equations, for tests with exact answers.
    """

    def __init__(self, constants: Constants, omega: Any, law: Law | None = None) -> None:
        self.constants = constants
        self.omega: Any = omega if isinstance(omega, Lanes | Jet) else ball(omega)
        self.law = law or _tippedisk
        # The speed's radius goes with the box, in mean-value form.
        self.orbit = self.orbit_at(self.omega.mid())
        graph = Graph()
        variables = [graph.variable() for _ in range(3)]
        speed = graph.number(self.omega, active=True)
        rates = self._rates(graph, speed, variables)
        #: state (3), derivatives by beta, gamma, v and Omega (3 each); the other has the divergence's integral too
        self.variational, self.with_divergence = with_derivatives(graph, variables, [speed], rates)

    def at_middle(self) -> Model:
        """The model at the midpoint of the speeds."""
        return Model(self.constants, self.omega.mid(), self.law)

    def orbit_at(self, omega: Any) -> System:
        """The states alone, without derivatives, at another speed."""
        graph = Graph()
        variables = [graph.variable() for _ in range(3)]
        return System(graph, variables, self._rates(graph, graph.number(omega), variables))

    def path(self, start: Sequence[Any], *, derivatives: bool = False, along: Sequence[Any] = (0, 0, 0)) -> Path:
        """All orbits from a box of states, to be followed; see `Path`."""
        return Path(self, start, derivatives=derivatives, along=along)

    def _rates(self, graph: Graph, omega: Node, variables: Sequence[Node]) -> tuple[Node, ...]:
        constants = Constants(*(graph.number(value) for value in self.constants))
        return tuple(graph.number(rate) for rate in self.law(graph, constants, omega)(*variables))

    def rates(self, state: Sequence[Any]) -> tuple[Any, Any, Any]:
        """``(beta', gamma', v')`` [rad/s, rad/s, rad/s^2] on balls."""
        return self.law(BallOps, self.constants, self.omega)(*state)


def _tippedisk(ops: Ops, constants: Constants, omega: Any) -> Callable[[Any, Any, Any], tuple[Any, Any, Any]]:
    return field(shifted(ops), constants, omega, "linear")


@dataclass(frozen=True)
class Step:
    """One accepted step: what is proved over [0, length] from where the path stood."""

    begin: Any  #: time at its start [s]
    length: Any  #: [s], exact: a float, or lanes
    enclosure: tuple[Any, Any, Any]  #: holds the state throughout, for every orbit from the box
    frame: Frame  #: of the states at its start
    polynomials: list[list[Any]]  #: of the midpoint's orbit, the remainder's coefficient last
    derivatives: list[list[Any]]  #: of the derivatives, 3 to a column (and the divergence's integral), likewise

    def rows_at(self, time: Any) -> tuple[tuple[Any, ...], ...]:
        """d(state at ``time``)/d(state at the start, Omega) for every orbit from the box; ``time`` in the step."""
        count = len(self.derivatives)
        entries = [polynomial(series, time) for series in self.derivatives[: count - count % 3]]
        return tuple(tuple(entries[row::3]) for row in range(3))

    def derivatives_at(self, time: Any) -> tuple[tuple[Any, ...], ...]:
        """d(state at ``time``)/d(start of the path, Omega) for every orbit."""
        return self.frame.derivatives(self.rows_at(time))

    def divergence_at(self, time: Any) -> Any:
        """Integral of div f from the step's start."""
        return polynomial(self.derivatives[-1], time)

    def at(self, time: Any) -> tuple[Any, Any, Any]:
        """The state after ``time``, a number or ball within [0, length], for every orbit from the box."""
        return self.frame.image(self.centre(time), self.rows_at(time))

    def at_end(self) -> tuple[Any, Any, Any]:
        """The state at the step's end, for every orbit from the box."""
        return self.frame.image(*self._end)

    @cached_property
    def _end(self) -> tuple[Sequence[Any], tuple[tuple[Any, ...], ...]]:
        time = alike(self.enclosure[0], self.length)
        return self.centre(time), self.rows_at(time)

    def carried(self, time: Any = None) -> Frame:
        """The frame of the states after ``time``, or at the step's end."""
        stiffness = 1 + upper(self.derivatives[8][1])  # of d(v)/d(v): its rate at the start
        centre, rows = self._end if time is None else (self.centre(time), self.rows_at(time))
        return self.frame.carried(centre, rows, stiffness)

    def centre(self, time: Any) -> Sequence[Any]:
        """Where the midpoint's orbit is after ``time``."""
        return [polynomial(series, time) for series in self.polynomials]


def polynomial(coefficients: Sequence[Any], time: Any) -> Any:
    result = coefficients[-1]
    for coefficient in reversed(coefficients[:-1]):
        result = result * time + coefficient
    return result


class Path:
    """Follows all orbits from a box, one proved step after the other, at the working precision.

    ``derivatives``: to the working precision and accumulated over the path, with the divergence's integral; without,
    they are computed roughly, for the mean-value form only.
    """

    def __init__(
        self, model: Model, start: Sequence[Any], *, derivatives: bool = False, along: Sequence[Any] = (0, 0, 0)
    ) -> None:
        if len(start) != 3:
            raise InputError("a state has three components: beta_bar, gamma_bar, v")
        self.model, self.time, self.sharp = model, ball(0), derivatives
        self.frame = Frame([ball(part) for part in start], model.omega, along)
        self.box = self.frame.box()
        self.divergence = ball(0)
        self.steps = 0
        self.reversals = 0  #: how often the sliding velocity has changed its sign; counted under the smooth law only
        self.status: Status | None = None  #: why it stopped, if it did
        self._share = 0.75  # of the length that the midpoint's series allows; follows what is accepted

    @property
    def matrix(self) -> tuple[tuple[Any, ...], ...]:
        """(3, 4): d(state)/d(start, Omega)."""
        return self.frame.matrix()

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
        self.frame = step.carried(time)
        self.box = self.frame.box()
        if self.sharp:
            self.divergence = self.divergence + step.divergence_at(moment)
        self.time = self.time + moment
        self.steps += 1

    def _trials(self, longest: float | None) -> Step | None:
        """Steps of falling length until one passes."""
        model, bits = self.model, working_bits()
        order = _order(bits)
        thin = model.orbit.coefficients(self.frame.middle, order)
        allowed, rough_allowed = self._allowed(bits)
        rough_order = min(order, _order(-rough_allowed, _WIDE_ORDER)) if self.sharp else _MEAN_VALUE_ORDER
        system, wide = self._wide_series(rough_order, bits)
        if rough_order < order:
            stiffness = float(abs(wide[11][1]).abs_upper())
            longest = min(math.inf if longest is None else longest, _short_float(_DAMPED / max(1.0, stiffness)))
        sizes = [max(0, _magnitude(column[0])) for column in wide[3:]]
        reach, share = _length(thin, allowed), self._share
        for _ in range(_MOST_TRIALS):
            length = _short_float(min(reach * share, longest if longest is not None else math.inf))
            if length < _SHORTEST_STEP:
                return None
            try:
                found = self._verdict(system, wide, length, order)
            except _NotFiniteError:
                share *= 0.5
                continue
            enclosure, remainders, rough_remainders, included = found
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
                    self.frame,
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
        with working_precision(_REMAINDER_BITS):
            found = verdict(self.model, system, wide, length, order)
        if not all(part.is_finite() for part in (*found[1], *found[2])):
            raise _NotFiniteError
        return found


def verdict(
    model: Model, system: System, wide: list[list[Any]], length: Any, order: int
) -> tuple[tuple[Any, Any, Any], list[Any], list[Any], Any]:
    """The padded box E over [0, length], the remainders' coefficients over it, and whether the step is proved.

    ``wide`` holds the coefficients of ``system`` over the box of states; ``order`` is that of the midpoint's series.
    """
    rough_order = len(wide[0]) - 1
    length = alike(wide[0][0], length)
    ranges = [polynomial(series, _from_zero(length)) for series in wide]
    box = [part + around_zero(part.rad() / 256 + _pad(part)) for part in ranges]
    rough = [series[-1] for series in system.coefficients(box, rough_order + 1)]
    fine = rough[:3]
    if rough_order != order:
        fine = [series[-1] for series in model.orbit.coefficients(box[:3], order + 1)]
    # An infinite coefficient is in no interior.
    power = _from_zero(length ** (rough_order + 1))
    included = [inside(part + r * power, room) for part, r, room in zip(ranges, rough, box, strict=True)]
    return (box[0], box[1], box[2]), fine, rough, reduce(and_, included)


def _from_zero(length: Any) -> Any:
    """A ball that holds 0, ``length`` and what lies between."""
    half = length / 2
    return half + around_zero(half)


class _NotFiniteError(ArithmeticError):
    """A coefficient's ball is infinite: the step is too long, or the box too wide."""


def _order(bits: int, least: int = _MEAN_VALUE_ORDER) -> int:
    """Order of a series: its cost grows as the square, the step's length as 2^(-bits/order): flat about 0.3 bits."""
    return max(least, round(0.3 * bits))


def _pad(part: Any) -> Any:
    """An absolute pad for a range that has no width of its own."""
    if side_by_side(part):
        return part.abs_upper() * 2.0 ** -(_REMAINDER_BITS // 2) + 2.0**-_REMAINDER_BITS
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
    path = model.path(start, derivatives=derivatives)
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
