"""Proved enclosures of the flow under the smooth friction law, whose field is analytic on either side of gamma_y = 0.

gamma_y is the sliding velocity. For each sign s of it the law with |gamma_y| replaced by s gamma_y (`field.one_sided`)
is analytic wherever s gamma_y > -epsilon; it is the smooth law where s gamma_y >= 0. An orbit is followed with its own
side's law, by the steps of `flow`, and of every step one of these is shown:

- *kept*: s gamma_y > 0 throughout. The time is cut into pieces; on each s gamma_y is enclosed, or its rate is, so that
  the piece's ends bound it.
- *crossed*: s gamma_y is positive up to a piece at whose end it is negative, and on which its rate is. Then every orbit
  of side s has exactly one zero tau of gamma_y in the step, and up to tau it is an orbit of the smooth law. From the
  states at tau, which the step encloses at the ball of all tau, a step of the other side's law follows. There
  s gamma_y' < 0 throughout: gamma_y has changed its sign and keeps it.

Where neither can be shown, by shorter steps either, the proof ends: an orbit may touch gamma_y = 0 there and turn back.

**The derivatives through a crossing.** Let phi and psi be the flows of the two sides' laws. At a time t after it the
state is psi(t - tau, phi(tau, x)), where tau is an analytic function of the start x (and of Omega), as gamma_y' is not
zero there. Its derivative is

    psi_x phi_x + (psi_x f_s - psi') dtau/dx,       psi' = psi_x f_-s,

f_s and f_-s being the two fields at the crossing: a flow's time derivative is its derivative by state times the field.
They are equal there, because gamma_y = 0. So the bracket vanishes, and derivatives multiply as if tau were a fixed
time; those by Omega are psi_x phi_Omega + psi_Omega. (The jump, or saltation, matrix is the identity.) The products are
taken over the ball of all tau, which differ by as little as the states do.

So the smooth law's flow is continuously differentiable along such orbits, and the mean value theorem puts the image of
a box into the image of its midpoint plus derivatives times deviations, as in `flow`. The midpoint has its own tau,
known to the working precision: no digits are lost.

Where a ball becomes a point or a float: pieces, the iteration for tau and the step's end are free.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from tippedisk_verify.proofs.kernel.balls import BallOps, arb, ball, ball_constants, hull, need, negative, positive
from tippedisk_verify.proofs.kernel.field import field, one_sided, sliding_motion
from tippedisk_verify.proofs.kernel.flow import Model, Path, Proposer, Status, Step, short_float

__all__ = ["Crossing", "SlidingPath", "SmoothModel", "law_model", "model_of"]

_PIECES = 64  # of a step, at most, before the rest of it is left to the next one
_MOST_CUTS = 14
_SHORTEST = 2.0**-40  # s
_BEYOND = 2.0**-8  # of the step: how far it goes on after the crossing
_MOST_ITERATIONS = 100


def law_model(friction: str, constants: Any, omega: Any) -> Model:
    """The equations of motion on balls under the friction law, 'linear' or 'smooth'."""
    return (SmoothModel if friction == "smooth" else Model)(constants, omega)


def model_of(parameters: Any, omega: Any) -> Model:
    """The equations of motion on balls under the parameters' friction law, at the working precision."""
    return law_model(parameters.friction, ball_constants(parameters), omega)


class SmoothModel(Model):
    """The smooth law on balls, with what steps need of its two sides' analytic laws."""

    def __init__(self, constants: Any, omega: Any) -> None:
        super().__init__(constants, omega, one_sided(1))
        #: by the sliding velocity's sign; the law of each is that of its side
        self.sides: dict[int, Model] = {1: self, -1: Model(constants, omega, one_sided(-1))}
        self._middles: dict[int, Model] = {}

    def middle(self, side: int) -> Model:
        """One side's law at the midpoint of the speeds."""
        if side not in self._middles:
            self._middles[side] = Model(self.constants, self.omega.mid(), one_sided(side))
        return self._middles[side]

    def rates(self, state: Sequence[Any]) -> tuple[Any, Any, Any]:
        return field(BallOps, self.constants, self.omega, "smooth")(*state)

    def path(self, start: Sequence[Any], proposer: Proposer, *, derivatives: bool = False) -> Path:
        return SlidingPath(self, start, proposer, derivatives=derivatives)


@dataclass(frozen=True)
class Crossing(Step):
    """An accepted step in which the sliding velocity of every orbit changes its sign, exactly once.

    Of moments that may be before or after the crossing no derivatives are known: those balls are not finite.
    """

    first: Step  #: with the law of the side on which it begins
    tau: Any  #: when the orbits cross, from the step's start [s]
    second: Step  #: from there, with the other side's law
    middle_tau: Any  #: when the midpoint's orbit crosses
    middle: Step  #: from there

    def at(self, time: Any) -> tuple[Any, Any, Any]:
        known = time <= self.tau.lower() or time >= self.tau.upper()
        return super().at(time) if known else self.enclosure

    def rows_at(self, time: Any) -> tuple[tuple[Any, Any, Any, Any], ...]:
        if time <= self.tau.lower():
            return self.first.rows_at(time)
        return self.rows_behind(time) if time >= self.tau.upper() else ((arb.nan(),) * 4,) * 3

    def rows_behind(self, time: Any) -> tuple[tuple[Any, Any, Any, Any], ...]:
        """`rows_at` a time at which all orbits have crossed."""
        before, after = self.first.rows_at(self.tau), self.second.rows_at(time - self.tau)
        columns = list(zip(*before, strict=True))
        rows = [[sum(row[k] * column[k] for k in range(3)) for column in columns] for row in after]
        return tuple((*entries[:3], entries[3] + row[3]) for entries, row in zip(rows, after, strict=True))

    def divergence_at(self, time: Any) -> Any:
        if time <= self.tau.lower():
            return self.first.divergence_at(time)
        return self.divergence_behind(time) if time >= self.tau.upper() else arb.nan()

    def divergence_behind(self, time: Any) -> Any:
        """`divergence_at` a time at which all orbits have crossed."""
        return self.first.divergence_at(self.tau) + self.second.divergence_at(time - self.tau)

    def centre(self, time: Any) -> Sequence[Any]:
        if time <= self.middle_tau.lower():
            return self.first.centre(time)
        return self.middle.at(time - self.middle_tau) if time >= self.middle_tau.upper() else [arb.nan()] * 3


class SlidingPath(Path):
    """Follows all orbits from a box on which the sliding velocity has one sign, from side to side."""

    def __init__(
        self, model: SmoothModel, start: Sequence[Any], proposer: Proposer, *, derivatives: bool = False
    ) -> None:
        super().__init__(model, start, proposer, derivatives=derivatives)
        sliding, _ = sliding_motion(BallOps, model.constants, model.omega, self.box)
        self.smooth, self.side = model, int(positive(sliding)) - int(negative(sliding))
        self.model = model.sides[self.side or 1]

    def step(self, longest: float | None = None) -> Step | None:
        for _ in range(_MOST_CUTS):
            step = super().step(longest)
            if step is None:
                return None
            followed = self._followed(step, longest) if self.side else None
            if followed is not None:
                return followed
            longest = step.length / 2
            if longest < _SHORTEST or not self.side:
                break
        self.status = Status.GRAZING
        return None

    def take(self, step: Step, time: Any = None) -> None:
        super().take(step, time)
        if isinstance(step, Crossing) and (time is None or not time <= step.tau.lower()):
            self.side, self.reversals = -self.side, self.reversals + 1
            self.model = self.smooth.sides[self.side]

    def _followed(self, step: Step, longest: float | None) -> Step | None:
        """The step as far as the sliding velocity is proved to keep its sign, or through its crossing."""
        kept, end = self._kept(step)
        if end is not None:
            crossing = self._crossing(step, kept, end)
            if crossing is not None and (longest is None or crossing.length <= longest):
                return crossing
        if kept == step.length:
            return step
        length = short_float(kept)
        return replace(step, length=length) if length >= _SHORTEST else None

    def _kept(self, step: Step) -> tuple[float, float | None]:
        """Until when the sign is proved to be kept, and the end of a piece from there on that all orbits cross in."""
        begin, ends = 0.0, [step.length]
        while ends:
            end = ends[-1]
            verdict = self._sign(step, begin, end)
            if verdict > 0:
                begin = ends.pop()
            elif verdict < 0:
                return begin, end
            elif end - begin <= step.length / _PIECES:
                return begin, None
            else:
                ends.append((begin + end) / 2)
        return begin, None

    def _sign(self, step: Step, begin: float, end: float) -> int:
        """1: side * gamma_y > 0 in (begin, end] if it is not negative at the begin; -1: all cross; 0: not decided."""
        states = step.at(hull(begin, end))
        if positive(self._towards(states)):
            return 1
        rate = self._rate(states)
        if positive(rate):
            return 1
        if not negative(rate):
            return 0
        last = self._towards(step.at(ball(end)))
        return int(positive(last)) - int(negative(last))

    def _towards(self, state: Sequence[Any]) -> Any:
        """side * gamma_y."""
        return self.side * sliding_motion(BallOps, self.smooth.constants, self.smooth.omega, state)[0]

    def _rate(self, state: Sequence[Any], model: Model | None = None) -> Any:
        """Its rate by the law of the present side, or of a model."""
        model = model or self.model
        acceleration = model.law(BallOps, model.constants, model.omega)(*state)[2]
        return self.side * sliding_motion(BallOps, model.constants, model.omega, state, acceleration)[1]

    def _crossing(self, step: Step, begin: float, end: float) -> Crossing | None:
        other, thin = self.smooth.sides[-self.side], self.smooth.middle(self.side)
        tau = _zero(lambda time: self._towards(step.at(time)), lambda time: self._rate(step.at(time)), begin, end)
        # The midpoint's orbit is one of them; the rates of all hold for it.
        middle_tau = _zero(
            lambda time: self.side * sliding_motion(BallOps, thin.constants, thin.omega, step.centre(time))[0],
            lambda time: self._rate(step.centre(time), thin),
            begin,
            end,
        )
        until = _rounded_up(float(tau.upper()) + _BEYOND * step.length)
        onwards = Path(other, step.at(tau), self.proposer.beyond(), derivatives=self.sharp)
        second = onwards.step(_rounded_up(until - float(tau.lower()), 2))
        point = Path(self.smooth.middle(-self.side), step.centre(middle_tau), self.proposer.beyond())
        middle = point.step(_rounded_up(until - float(middle_tau.lower()), 2))
        if second is None or middle is None:
            return None
        reached = until >= tau.upper() and until - tau <= second.length and until - middle_tau <= middle.length
        if not (reached and negative(self._rate(second.enclosure, other))):
            return None
        enclosure = tuple(a.union(b) for a, b in zip(step.enclosure, second.enclosure, strict=True))
        return Crossing(
            step.begin,
            until,
            step.tried,
            (enclosure[0], enclosure[1], enclosure[2]),
            step.frame,
            step.orders,
            step.polynomials,
            step.derivatives,
            first=step,
            tau=tau,
            second=second,
            middle_tau=middle_tau,
            middle=middle,
        )


def _zero(value: Callable[[Any], Any], slope: Callable[[Any], Any], begin: float, end: float) -> Any:
    """All zeros of functions that have one each between the moments, and slopes of one sign: interval Newton steps."""
    moment = hull(begin, end)
    for _ in range(_MOST_ITERATIONS):
        guess = moment.mid()
        better = guess - value(guess) / slope(moment)
        if not better.is_finite():
            break
        need(moment.overlaps(better), "the enclosures of a change of side contradict each other")
        before, moment = moment.rad(), moment.intersection(better)
        if 2 * moment.rad() > before:
            break
    return moment


def _rounded_up(length: float, times: int = 1) -> float:
    """Of 20 bits, like all lengths of steps; ``times`` units further on."""
    mantissa, exponent = math.frexp(length)
    return math.ldexp(math.ceil(mantissa * 2**20) + times - 1, exponent - 20)
