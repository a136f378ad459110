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

**Who chooses.** The lengths and orders of steps and the axes of sets come from a `Proposer`, which searches for them or
reads them in a certificate. Any choice that passes the test above is right, and nothing else is asked of a proposer.

Where a ball becomes a point or a float: m is a midpoint, and any point of X would do; paddings are free. Step lengths
are exact dyadic numbers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property, reduce
from operator import and_
from typing import Any, NamedTuple, Protocol

from tippedisk_verify.proofs.kernel.balls import (
    BallOps,
    Unproved,
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
from tippedisk_verify.proofs.kernel.field import Law, field
from tippedisk_verify.proofs.kernel.frame import Frame
from tippedisk_verify.proofs.kernel.jets import Jet
from tippedisk_verify.proofs.kernel.lanes import Lanes
from tippedisk_verify.proofs.kernel.series import Graph, Node, System, with_derivatives

__all__ = [
    "Law",
    "Model",
    "Path",
    "Proposer",
    "Status",
    "Step",
    "Trial",
    "magnitude",
    "polynomial",
    "short_float",
    "verdict",
]

_REMAINDER_BITS = 64  # a remainder is needed to its first digits only
_MEAN_VALUE_BITS = 53  # of derivatives that only multiply radii
_WIDEST = 3  # -log2 of the radius [rad, rad/s] beyond which a box says too little to go on
_SHORTEST_STEP = 2.0**-40  # s
_MOST_STEPS = 20_000


class Status(Enum):
    """How a proof that follows the flow ended. The value says what happened and what to try next."""

    REACHED = "the end was reached"
    RETURNED = "the first return to the section is enclosed"
    NO_START = "v < 0 at the start is not proved: start on the other side of the section, or in a narrower box"
    NO_ENCLOSURE = "no step could be enclosed: work in more bits, or start from a narrower box"
    TOO_WIDE = "the enclosure has grown too wide: work in more bits, or start from a narrower box"
    FLAT = "the disk may lie flat (|beta - pi/2| reaches 1.5707): there is no return from here"
    NO_RETURN = "there is no return to the section in the time allowed"
    UNRESOLVED = "the signs of beta_bar and v could not be proved: work in more bits, or start from a narrower box"
    GRAZING = (
        "the sliding velocity is not proved to keep its sign or to change it at a rate other than zero: work in more "
        "bits, from a narrower box, or at another speed"
    )
    STEP_LIMIT = "the step limit was reached: shorten the run"


class Proposer(Protocol):
    """What a flight asks for its choices. A search may answer with anything; a reader has a certificate's answers."""

    def step(self, path: Path, longest: float | None) -> Step | None:
        """A step of the path, made by its `Path.trial`, of at most ``longest`` seconds; None to give up.

        It is asked again, for a shorter one, if what the flight needs is not shown of the step.
        """
        ...

    def beyond(self) -> Proposer:
        """Who is asked for the steps behind a change of side."""
        ...

    def moment(self, step: Step, index: int, level: Any) -> Any:
        """A point within the step, near the moment at which a component of the state passes a level."""
        ...

    def axes(self, turned: Sequence[Sequence[Any]], sizes: Sequence[Any], stiffness: Any) -> Sequence[Sequence[Any]]:
        """The axes of a set, points, columns of a regular matrix; see `frame.Frame.carried`.

        ``stiffness`` [1/s] weighs velocities against angles.
        """
        ...

    def took(self, step: Step, axes: Sequence[Sequence[Any]]) -> None:
        """The path has taken the step."""
        ...


class Model:
    """The equations of motion on balls (Eq. 3DOF, linear friction), with the systems that a step needs.

    ``constants`` as from `field.constants` or `balls.ball_constants`; ``omega`` [rad/s], a ball of any radius or a
    `Jet` of such; or `Lanes` for both. Built once, used for any number of runs; every enclosure holds for all constants
    and speeds in their balls. ``law`` replaces the equations, for tests with exact answers.
    """

    def __init__(self, constants: Any, omega: Any, law: Law | None = None) -> None:
        self.constants = constants
        self.omega: Any = omega if isinstance(omega, Lanes | Jet) else ball(omega)
        self.law: Law = law or field
        # The speed's radius goes with the box, in mean-value form.
        self.orbit = self.orbit_at(self.omega.mid())
        graph = Graph()
        variables = [graph.variable() for _ in range(3)]
        speed = graph.number(self.omega, active=True)
        rates = self._rates(graph, speed, variables)
        #: state (3), derivatives by beta, gamma, v and Omega (3 each); the other has the divergence's integral too
        self.variational, self.with_divergence = with_derivatives(graph, variables, [speed], rates)

    def orbit_at(self, omega: Any) -> System:
        """The states alone, without derivatives, at another speed."""
        graph = Graph()
        variables = [graph.variable() for _ in range(3)]
        return System(graph, variables, self._rates(graph, graph.number(omega), variables))

    def path(self, start: Sequence[Any], proposer: Proposer, *, derivatives: bool = False) -> Path:
        """All orbits from a box of states, to be followed; see `Path`."""
        return Path(self, start, proposer, derivatives=derivatives)

    def _rates(self, graph: Graph, omega: Node, variables: Sequence[Node]) -> tuple[Node, ...]:
        constants = type(self.constants)(*(graph.number(value) for value in self.constants))
        return tuple(graph.number(rate) for rate in self.law(graph, constants, omega)(*variables))

    def rates(self, state: Sequence[Any]) -> tuple[Any, Any, Any]:
        """``(beta', gamma', v')`` [rad/s, rad/s, rad/s^2] on balls."""
        return self.law(BallOps, self.constants, self.omega)(*state)


@dataclass(frozen=True)
class Step:
    """One accepted step: what is proved over [0, length] from where the path stood."""

    begin: Any  #: time at its start [s]
    length: Any  #: [s], exact: a float, or lanes
    tried: Any  #: the length that was tested, not shorter [s]
    enclosure: tuple[Any, Any, Any]  #: holds the state throughout, for every orbit from the box
    frame: Frame  #: of the states at its start
    orders: tuple[int, int]  #: of the midpoint's series, and of that over the box
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
        return self.frame.image(*self.end)

    @cached_property
    def end(self) -> tuple[Sequence[Any], tuple[tuple[Any, ...], ...]]:
        """The midpoint's image at the step's end, and `rows_at` it."""
        time = alike(self.enclosure[0], self.length)
        return self.centre(time), self.rows_at(time)

    def centre(self, time: Any) -> Sequence[Any]:
        """Where the midpoint's orbit is after ``time``."""
        return [polynomial(series, time) for series in self.polynomials]


def polynomial(coefficients: Sequence[Any], time: Any) -> Any:
    result = coefficients[-1]
    for coefficient in reversed(coefficients[:-1]):
        result = result * time + coefficient
    return result


class Verdict(NamedTuple):
    """What the test of a step's length says."""

    length: Any  #: [s], exact: a float, or lanes
    enclosure: tuple[Any, Any, Any]  #: the padded box E over [0, length]
    fine: list[Any]  #: the remainders' coefficients over it, of the midpoint's orbit
    rough: list[Any]  #: and of all orbits with their derivatives
    included: Any  #: whether the step is proved


class Trial:
    """The series of all orbits from where a path stands, with orders that are chosen, on which lengths are tried.

    ``middle`` holds where the midpoint's orbit begins, if that is known by itself.
    """

    def __init__(self, path: Path, orders: tuple[int, int], middle: Sequence[Any] | None = None) -> None:
        self.path, self.orders, model = path, orders, path.model
        self.thin = model.orbit.coefficients(middle or path.frame.middle, orders[0])
        self.system = model.with_divergence if path.sharp else model.variational
        zero, one = (alike(path.box[0], k) for k in (0, 1))
        start = [*path.box, *(one if row == column else zero for column in range(4) for row in range(3))]
        if path.sharp:
            start.append(zero)
        with working_precision(working_bits() if path.sharp else _MEAN_VALUE_BITS):
            self.wide = self.system.coefficients(start, orders[1])

    def verdict(self, length: Any) -> Verdict:
        """What the test says of a length."""
        with working_precision(_REMAINDER_BITS):
            return verdict(self.path.model, self.system, self.wide, length, self.orders[0])

    def step(self, length: float, verdict: Verdict | None = None) -> Step:
        """The step of that length, whose verdict may be passed. Raises Unproved if the test does not prove it."""
        verdict = verdict or (self.verdict(length) if length > 0 else None)
        if verdict is None or verdict.length != length or verdict.included is not True:
            raise Unproved("the states and derivatives over it are not shown to stay in its enclosure")
        return self.tested(verdict)

    def tested(self, verdict: Verdict) -> Step:
        """The step of the verdict's length, which is proved where the verdict says so."""
        return Step(
            self.path.time,
            verdict.length,
            verdict.length,
            verdict.enclosure,
            self.path.frame,
            self.orders,
            [[*c, r] for c, r in zip(self.thin, verdict.fine, strict=True)],
            [[*c, r] for c, r in zip(self.wide[3:], verdict.rough[3:], strict=True)],
        )


class Path:
    """Follows all orbits from a box, one proved step after the other, at the working precision.

    ``derivatives``: to the working precision and accumulated over the path, with the divergence's integral; without,
    they are computed roughly, for the mean-value form only.
    """

    def __init__(self, model: Model, start: Sequence[Any], proposer: Proposer, *, derivatives: bool = False) -> None:
        if len(start) != 3:
            raise ValueError("a state has three components: beta_bar, gamma_bar, v")
        self.model, self.proposer, self.time, self.sharp = model, proposer, ball(0), derivatives
        self.frame = Frame([ball(part) for part in start], model.omega)
        self.box = self.frame.box()
        self.divergence = ball(0)
        self.steps: Any = 0  #: taken
        self.reversals: Any = (
            0  #: how often the sliding velocity has changed its sign; counted under the smooth law only
        )
        self.status: Status | None = None  #: why it stopped, if it did

    @property
    def matrix(self) -> tuple[tuple[Any, ...], ...]:
        """(3, 4): d(state)/d(start, Omega)."""
        return self.frame.matrix()

    def trial(self, orders: tuple[int, int], middle: Sequence[Any] | None = None) -> Trial:
        """The series from here, for steps to be tried."""
        return Trial(self, orders, middle)

    def step(self, longest: float | None = None) -> Step | None:
        """A proved step of at most ``longest`` seconds, not yet taken; None, with a status, if none is found."""
        if not all(part.is_finite() for part in self.box):
            self.status = Status.NO_ENCLOSURE
        elif max(magnitude(part.rad()) for part in self.box) > -_WIDEST:
            self.status = Status.TOO_WIDE
        elif self.steps >= _MOST_STEPS:
            self.status = Status.STEP_LIMIT
        else:
            step = self.proposer.step(self, longest)
            if step is not None:
                if step.frame is not self.frame:
                    raise ValueError("a step from elsewhere was proposed")
                return step
            self.status = Status.NO_ENCLOSURE
        return None

    def carried(self, step: Step, time: Any = None) -> Frame:
        """The set of the states after ``time`` in the step, or at its end."""
        stiffness = 1 + upper(step.derivatives[8][1])  # of d(v)/d(v): its rate at the start
        centre, rows = step.end if time is None else (step.centre(time), step.rows_at(time))
        return step.frame.carried(centre, rows, lambda turned, sizes: self.proposer.axes(turned, sizes, stiffness))

    def take(self, step: Step, time: Any = None) -> None:
        """Go to the step's end, or to ``time`` (a number or ball) within it."""
        moment = ball(step.length) if time is None else time
        self.frame = self.carried(step, time)
        self.proposer.took(step, self.frame.axes)
        self.box = self.frame.box()
        if self.sharp:
            self.divergence = self.divergence + step.divergence_at(moment)
        self.time = self.time + moment
        self.steps = self.steps + 1


def verdict(model: Model, system: System, wide: list[list[Any]], length: Any, order: int) -> Verdict:
    """The test of a step.

    ``wide`` holds the coefficients of ``system`` over the box of states; ``order`` is that of the midpoint's series.
    """
    rough_order = len(wide[0]) - 1
    time = alike(wide[0][0], length)
    ranges = [polynomial(series, _from_zero(time)) for series in wide]
    box = [part + around_zero(part.rad() / 256 + _pad(part)) for part in ranges]
    rough = [series[-1] for series in system.coefficients(box, rough_order + 1)]
    fine = rough[:3]
    if rough_order != order:
        fine = [series[-1] for series in model.orbit.coefficients(box[:3], order + 1)]
    # An infinite coefficient is in no interior.
    power = _from_zero(time ** (rough_order + 1))
    included = [inside(part + r * power, room) for part, r, room in zip(ranges, rough, box, strict=True)]
    included += [r.is_finite() for r in fine]
    return Verdict(length, (box[0], box[1], box[2]), fine, rough, reduce(and_, included))


def _from_zero(length: Any) -> Any:
    """A ball that holds 0, ``length`` and what lies between."""
    half = length / 2
    return half + around_zero(half)


def _pad(part: Any) -> Any:
    """An absolute pad for a range that has no width of its own."""
    if side_by_side(part):
        return part.abs_upper() * 2.0 ** -(_REMAINDER_BITS // 2) + 2.0**-_REMAINDER_BITS
    return arb(2) ** (max(-_REMAINDER_BITS, magnitude(part) - _REMAINDER_BITS // 2) if part.is_finite() else 0)


def magnitude(x: Any) -> int:
    """An integer k with |x| < 2^k for all x of the ball, the least but for rounding (-10^6 for zero).

    Raises OverflowError for a ball that is not finite.
    """
    if not x.is_finite():
        raise OverflowError("an infinite ball has no size")
    mantissa, exponent = x.abs_upper().man_exp()
    return int(mantissa).bit_length() + int(exponent) if mantissa else -1_000_000


def short_float(length: float) -> float:
    """Rounded down to 20 bits: sums of step lengths are exact."""
    mantissa, exponent = math.frexp(length)
    return math.ldexp(math.floor(mantissa * 2**20), exponent - 20)
