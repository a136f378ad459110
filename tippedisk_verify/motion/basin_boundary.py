"""What separates starts that keep standing from those that lie flat: the unstable rotating cycles' stable manifolds.

An orbit next to such a surface follows the unstable rotating cycle for some turns and then leaves it to one side. Which
one, and how far, tells its coordinate along the cycle's unstable direction, taken at gamma = pi/2 after as many turns
as the fast direction takes to be forgotten. It grows with beta and is zero on the surface. The point symmetry gives the
sheet of the other lean.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

from tippedisk_verify.atlas.cycles_at_speed import rotating_cycle
from tippedisk_verify.cycles.return_map import ReturnMap
from tippedisk_verify.cycles.section import ROTATING, ROUND
from tippedisk_verify.errors import InputError
from tippedisk_verify.flow.contract import SECTION, Engine, Event, Request, Result, Status
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE
from tippedisk_verify.model.results import Printable
from tippedisk_verify.motion.basins import SPEEDS_OF_STATES

__all__ = ["BasinBoundary"]

_FORGOTTEN = 37.0  # of the fast direction exp(-this) is left, which is below a double's rounding
_FEWEST_TURNS, _MOST_TURNS = 2, 60
_TRANSIENT = 0.5  # s after which a start with any v is on the slow manifold
_DIFFERENCES = 4  # of roots after different numbers of turns, for a half-width: as for cycles, see `error_budget`
_BESIDE = 1e-6  # rad; a root after another number of turns is looked for so close to the first one
_FARTHEST = math.pi  # rad; stands for an infinite distance from the sheet
_ROUNDINGS = Fraction(1, 10**14)  # rad; what the last bits of the start and of pi do
_TOP = Event("top", ROUND.function, direction=-1, terminal=False)
_UPRIGHT = Event("upright", SECTION.function)


class BasinBoundary(Printable):
    """The boundary at one speed [rad/s], in double: two sheets, each a graph of beta over (gamma, v).

    Starts between the sheets keep standing, the others lie flat. Raises NoSuchCycleError where there is no unstable
    rotating cycle: below the rotating cycles' fold everything lies flat.
    """

    _listed = ("omega", "cycle")

    def __init__(self, parameters: Parameters, omega: object, engine: Engine) -> None:
        self.parameters, self.engine, self.omega = parameters, engine, checked_speed(omega)
        #: The unstable rotating cycle whose stable manifold the sheet of larger beta is.
        self.cycle = rotating_cycle(parameters, self.omega, engine, stable=False)
        self._top = float(self.cycle.beta_bar_top), float(self.cycle.v_top)
        (_, b), (_, d) = ReturnMap(ROTATING, parameters, self.omega, engine)(self._top).matrix
        # (1, w) is the left eigenvector of the turn map's derivative, which takes that coordinate from a difference.
        self._weight = b / (float(self.cycle.multiplier_slow) - d)
        forgotten = _FORGOTTEN / -float(self.cycle.log_multiplier_fast)
        self._turns = min(_MOST_TURNS, max(_FEWEST_TURNS, math.ceil(forgotten)))

    def margin(self, state: Sequence[float]) -> Measured:
        """The distance in beta [rad] of a state (beta, gamma, v) from the boundary: positive if it keeps standing."""
        beta, gamma, v = DOUBLE.array(state).tolist()
        if not 0 < beta < math.pi:
            raise InputError(f"beta lies between 0 and pi, not at {beta:g}")
        if not abs(v) <= SPEEDS_OF_STATES:
            raise InputError(f"v must lie between -{SPEEDS_OF_STATES:g} and {SPEEDS_OF_STATES:g} rad/s, not {v:g}")
        lower, upper = self.sheets(gamma, v)
        lean = Measured(Fraction(beta), Fraction(0))
        return min(lean - lower, upper - lean, key=lambda margin: margin.value)

    def sheets(self, gamma: float, v: float) -> tuple[Measured, Measured]:
        """beta on both sheets at (gamma, v); 0 or pi with a sheet that is beyond the disk's lying flat."""
        gamma, v = DOUBLE.number(gamma), DOUBLE.number(v)
        pi = Measured(Fraction(math.pi), Fraction(1, 2**52))
        return pi - self._upper(math.pi - gamma, -v), self._upper(gamma, v)

    def _upper(self, gamma: float, v: float) -> Measured:
        """beta on the sheet of larger beta."""
        root = self._root(gamma, v, self._turns, (0.0, math.pi))
        again = self._root(gamma, v, self._turns + 1, (max(0.0, root - _BESIDE), min(math.pi, root + _BESIDE)))
        width = _DIFFERENCES * abs(Fraction(root) - Fraction(again)) + _ROUNDINGS
        return Measured(Fraction(root), width)

    def _root(self, gamma: float, v: float, turns: int, between: tuple[float, float]) -> float:
        """Where `_beyond` changes its sign. The ends of the interval stand for states on either side of the sheet."""
        from scipy.optimize import brentq

        def beyond(beta: float) -> float:
            if beta in between:
                return -_FARTHEST if beta == between[0] else _FARTHEST
            return min(max(self._beyond((beta, gamma, v), turns), -_FARTHEST), _FARTHEST)

        return float(brentq(beyond, *between, xtol=1e-15, rtol=1e-15))

    def _beyond(self, state: tuple[float, float, float], turns: int) -> float:
        """How far the orbit from a state is beyond the sheet of larger beta, after so many turns [rad].

        Infinite if the disk lies flat on that side before, minus infinity if it comes upright or lies on the other.
        """
        first = self._flight(state, _TRANSIENT, ())
        beta, gamma, v = first.state.tolist()
        if first.status is Status.FLAT:
            return math.inf if beta > math.pi / 2 else -math.inf
        if beta < math.pi / 2:
            return -math.inf
        long = (turns + 2) * 4 * float(self.cycle.period)  # the turns of orbits farther inside take longer
        result = self._flight((beta, gamma, v), long, (_TOP, _UPRIGHT))
        tops = [record.state.tolist() for record in result.events if record.name == _TOP.name]
        if len(tops) < turns:
            return math.inf if result.status is Status.FLAT else -math.inf
        beta, _, v = tops[turns - 1]
        return float(beta - math.pi / 2 - self._top[0] + self._weight * (v - self._top[1]))

    def _flight(self, state: tuple[float, float, float], duration: float, events: tuple[Event, ...]) -> Result:
        """A run to the disk's lying flat, or to an event. One that stands still takes too many steps; it is inside."""
        return self.engine(Request(self.parameters, self.omega, state, duration, events=events, domain="event"))
