"""Many orbits of the smooth law side by side: what `sliding` shows of a step, shown on lanes, a side for each lane.

With s = 1 or -1 the law of side s divides by s gamma_y + epsilon, and

    traction / (s gamma_y + epsilon) = (s traction) / (gamma_y + s epsilon).

So it is the law of side 1 for the constants s traction and s epsilon: one graph serves both sides.

A step is kept or crossed as in `sliding`, of equal pieces of time. Of a step that is crossed v must keep its sign, so
that neither the turn nor the section lies in it. Where none of this is shown a shorter step is tried.

Where a ball becomes a point or a float: pieces, guesses of moments, which the proposer chooses, and how far a step goes
on after the crossing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tippedisk_verify.proofs.kernel.balls import BallOps, inside, negative, positive
from tippedisk_verify.proofs.kernel.field import Law, one_sided, sliding_motion
from tippedisk_verify.proofs.kernel.flow import Model, Path, Step, polynomial
from tippedisk_verify.proofs.kernel.lane_path import LanePath, LaneProposer, mapped, replaced, some
from tippedisk_verify.proofs.kernel.lanes import Lanes
from tippedisk_verify.proofs.kernel.section import UPRIGHT, Cases, enclosed_moment
from tippedisk_verify.proofs.kernel.series import Graph, System
from tippedisk_verify.proofs.kernel.sliding import Crossing

__all__ = ["LaneSmoothModel", "SlidingLanes"]

Array = NDArray[Any]

_PIECES = 16  # of a step
_ORDER = 10  # of gamma_y's series: its values are differences of larger numbers, which boxes of states would lose
_BEYOND = 2.0**-8  # of the step: how far it goes on after the crossing


class SlidingLanes(LanePath):
    """A `LanePath` whose orbits change sides; each lane's model has the law of its side."""

    model: LaneSmoothModel

    def __init__(self, model: LaneSmoothModel, start: Sequence[Lanes], proposer: LaneProposer) -> None:
        super().__init__(model, start, proposer)
        velocity, _ = model.motion(self.box)
        self.signs: Array = positive(velocity).astype(int) - negative(velocity)  #: the sliding velocity's
        self.model = model.of_side(self.signs)

    def _followed(self, step: Step, tested: Array) -> tuple[Array, Crossed | None]:
        """The tested steps that are kept or crossed, and the latter."""
        kept, crossed, begin, end, rate = self._by_pieces(step)
        followed, which = tested & kept, np.flatnonzero(tested & crossed)
        if not len(which):
            return followed, None
        through, sure = self.some(which)._crossing(*some([step, begin, end, rate], which))
        followed[which[sure]] = True
        return followed, Crossed(which[sure], some(through, sure)) if sure.any() else None

    def _by_pieces(self, step: Step) -> tuple[Array, Array, Array, Array, Lanes]:
        """Whether the step is kept, or is crossed; and of the piece in which it is: begin, end, the rate."""
        length = step.length.midpoints
        velocity = self._velocity(step)
        rates = [k * coefficient for k, coefficient in enumerate(velocity)][1:]
        kept, crossed = np.ones(len(length), bool), np.zeros(len(length), bool)
        begin, end, slope = 0 * length, length, self.box[0].constant(0)
        for piece in range(_PIECES):
            low, high = (length * (n / _PIECES) for n in (piece, piece + 1))
            time = Lanes(low).union(Lanes(high))
            rate, last = polynomial(rates, time), polynomial(velocity, Lanes(high))
            ahead = positive(polynomial(velocity, time)) | positive(rate)
            falls = negative(rate)
            crosses = kept & ~crossed & ~ahead & falls & negative(last)
            crossed |= crosses
            # What comes after the crossing is the other side's.
            kept &= crossed | ahead | (falls & positive(last))
            begin, end = np.where(crosses, low, begin), np.where(crosses, high, end)
            slope = rate.where(crosses, slope)
        return kept & ~crossed, kept & crossed, begin, end, slope

    def _velocity(self, step: Step) -> list[Lanes]:
        """Coefficients of side * gamma_y in the step, the remainder's last: by Taylor's formula, as `flow`'s states."""
        start, throughout = self.model.velocity(self.box, _ORDER), self.model.velocity(step.enclosure, _ORDER + 1)
        return [_signed(coefficient, self.signs) for coefficient in (*start, throughout[-1])]

    def _crossing(self, step: Step, begin: Array, end: Array, rate: Lanes) -> tuple[LaneCrossing, Array]:
        """The step as far as shortly after its crossing, which lies between the two times; whether it is proved."""
        guess = self._moment(step, begin, end)
        tau, sure = enclosed_moment(
            step,
            guess,
            lambda time: -self._motion(step.at(time))[0],
            -rate,
            lambda time: -self._motion(step.at(time))[1],
        )
        # The middle's orbit is one of them; the rates of all hold for it.
        middle_tau, known = enclosed_moment(
            step,
            guess,
            lambda time: -self._motion(step.centre(time), middle=True)[0],
            -rate,
            lambda time: -self._motion(step.centre(time), middle=True)[1],
        )
        until = tau.midpoints + tau.radii + _BEYOND * step.length.midpoints
        left = Lanes(until) - tau
        other = self.model.of_side(-np.ones(len(until), int))
        onwards = Path(other, step.at(tau), self.proposer, derivatives=True)
        trial = onwards.trial(self.proposer.orders(onwards.box), step.centre(middle_tau))
        verdict = trial.verdict(left.abs_upper())
        second = trial.tested(verdict)
        rate = _signed(other.motion(second.enclosure)[1], self.signs)
        sure = sure & known & verdict.included & positive(left) & negative(rate)
        enclosure = tuple(a.union(b) for a, b in zip(step.enclosure, second.enclosure, strict=True))
        through = LaneCrossing(
            step.begin,
            Lanes(until),
            step.tried,
            enclosure,
            step.frame,
            step.orders,
            step.polynomials,
            step.derivatives,
            first=step,
            tau=tau,
            second=second,
            middle_tau=middle_tau,
            middle=second,
        )
        return through, sure

    def _motion(self, state: Any, *, middle: bool = False) -> tuple[Lanes, Lanes]:
        """Of each lane side * gamma_y and its rate, at all speeds or at their midpoint."""
        velocity, rate = self.model.motion(state, middle=middle)
        return _signed(velocity, self.signs), _signed(rate, self.signs)

    def _moment(self, step: Step, begin: Array, end: Array) -> Lanes:
        """A point between the two near the crossing of the middle's orbit."""
        constants = type(self.model.constants)(*(part.midpoints for part in self.model.constants))
        coefficients = [[part.midpoints for part in column] for column in step.polynomials]

        def behind(time: Array) -> Any:
            state = [polynomial(column, time) for column in coefficients]
            return -self.signs * sliding_motion(np, constants, self.model.omega.midpoints, state)[0]

        return self._zero(behind, begin, end)

    def go_on(self, step: Step, proved: Array, crossing: Crossed | None = None) -> None:
        if crossing is None:
            super().go_on(step, proved, None)
            return
        sure = proved[crossing.which]
        which = crossing.which[sure]
        path = self.some(which)
        super().go_on(step, proved, None)
        path.take(some(crossing.step, sure))
        for name in ("frame", "box", "divergence", "time"):
            moved = mapped(lambda old, new: replaced(old, which, new), getattr(self, name), getattr(path, name))
            setattr(self, name, moved)
        sides = np.ones(len(proved), int)
        sides[which] = -1
        self.reversals = self.reversals + (sides < 0)
        self.signs = self.signs * sides
        self.model = self.model.of_side(sides)


class LaneSmoothModel(Model):
    """The law of one side in each lane: side 1, unless `of_side` has given traction and epsilon other signs."""

    def __init__(self, constants: Any, omega: Any, law: Law | None = None) -> None:
        super().__init__(constants, omega, law or one_sided(1))
        graph = Graph()
        variables, speed = [graph.variable() for _ in range(3)], graph.number(self.omega)
        numbers = type(constants)(*map(graph.number, constants))
        rates = self.law(graph, numbers, speed)(*variables)
        velocity, _ = sliding_motion(graph, numbers, speed, variables)
        self._with_path = System(graph, [*variables, graph.variable()], [*rates, velocity])

    def of_side(self, sides: Array) -> LaneSmoothModel:
        """The model with the other side's law in the lanes whose factor is negative."""
        every = np.zeros(len(sides), int)
        traction, epsilon = (
            _signed(value if len(value) == len(sides) else value[every], sides)
            for value in (self.constants.traction, self.constants.epsilon)
        )
        return LaneSmoothModel(self.constants._replace(traction=traction, epsilon=epsilon), self.omega)

    def motion(self, state: Sequence[Any], *, middle: bool = False) -> tuple[Lanes, Lanes]:
        """gamma_y [m/s] and its rate [m/s^2] by the lanes' laws, at all speeds or at their midpoints."""
        omega = self.omega.mid() if middle else self.omega
        acceleration = self.law(BallOps, self.constants, omega)(*state)[2]
        return sliding_motion(BallOps, self.constants, omega, state, acceleration)

    def velocity(self, state: Sequence[Any], order: int) -> list[Lanes]:
        """Taylor coefficients 0 to ``order`` of gamma_y along orbits of the lanes' laws."""
        integral = self._with_path.coefficients([*state, state[0].constant(0)], order + 1)[-1]
        return [k * coefficient for k, coefficient in enumerate(integral)][1:]


@dataclass(frozen=True)
class LaneCrossing(Crossing):
    """A crossing in each lane, asked for its end only. Its second step follows the middle's orbit as well."""

    def centre(self, time: Any) -> Any:
        return self.middle.centre(time - self.middle_tau)

    def rows_at(self, time: Any) -> Any:
        return self.rows_behind(time)

    def divergence_at(self, time: Any) -> Any:
        return self.divergence_behind(time)


@dataclass(frozen=True)
class Crossed:
    """The lanes of a block whose step is crossed, and their steps."""

    which: Array
    step: LaneCrossing

    def judge(self, upright: Array, case: Cases) -> None:
        """What is proved of these steps, entered where it was said of steps that keep their side."""
        v, beta = self.step.enclosure[2], self.step.at_end()[0]
        upright[self.which] = inside(self.step.enclosure[0], Lanes([0.0], [UPRIGHT]))
        case.falls[self.which] = negative(v)
        case.rises[self.which] = positive(v) & negative(beta)
        case.turns[self.which] = case.crosses[self.which] = False


def _signed(lanes: Lanes, side: Array) -> Lanes:
    return (-lanes).where(side < 0, lanes)
