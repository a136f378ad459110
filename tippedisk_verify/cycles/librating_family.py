"""The family of librating limit cycles: where it begins, at the Hopf point, and where it ends, at the connection.

The amplitude is gamma_bar_0 = pi tanh(s): s = 0 is the Hopf point, and infinite s the connection. v_0 / gamma_bar_0
and beta_max / gamma_bar_0, the period and Omega are analytic there.

Towards a saddle whose stable eigenvalues are complex, orbits wind: the amplitude then reaches pi at v_0 != 0, short of
the connection. There this family ends.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy

from tippedisk_verify.cycles.family import Family, Solver, one_at_a_time
from tippedisk_verify.cycles.section import LIBRATING
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.theory.hopf import critical_frequency_squared, omega_crit

__all__ = ["LibratingFamily"]

_NODES = 20  # of a panel; the polynomials then err by rounding
_CLOSEST = 1e-5  # rad/s; how close to its limit Omega is followed: beyond, doubles hold no more cycles
_SLOWEST, _FASTEST = 1.5, 6.0  # rates at which the slope of Omega falls towards a connection: from 2 to 4, nearly
_MOST_PANELS = 10  # the amplitude is then within 1e-5 of pi


class LibratingFamily(Family):
    """The family of one disk under its friction law, in double.

    It is followed until Omega is within ``closest`` [rad/s] of its limit. ``solve`` finds cycles of chosen amplitudes,
    by default one at a time. Raises NoSuchCycleError where the family cannot be followed.
    """

    section = LIBRATING
    origin = 0.0

    def __init__(
        self, parameters: Parameters, engine: Engine, solve: Solver | None = None, closest: float = _CLOSEST
    ) -> None:
        self.omega_crit = float(omega_crit(parameters))
        frequency = math.sqrt(critical_frequency_squared(parameters))
        begin = (0.0, -(frequency**2) / self.omega_crit, math.pi / frequency, self.omega_crit, 0.0, 0.0, 0.0)
        solve = solve or one_at_a_time(LIBRATING, parameters, engine)
        super().__init__(parameters, engine, solve, _NODES, 0.0, math.pi, begin)
        while not len(self._panels) or (self._left > closest and len(self._panels) < _MOST_PANELS):
            self.extend()
        if not self._left < math.inf:
            raise NoSuchCycleError(self._lost(self.nodes[-1, 0]))
        first, last = map(float, self.nodes[[0, -1], 3])
        self.gaps = (first, self.omega_crit), (last, 2 * self.limit - last)

    @property
    def _left(self) -> float:
        """How far Omega is from its limit at the last node, by how fast its slope falls.

        Infinite if it does not fall as it does towards a connection: there Omega - Omega_h goes with the distance from
        the saddle to the power 1 + min(q, 1 / q), where q = |lambda_s| / lambda_u, and the distance like exp(-2 s).
        """
        s, slopes = self.nodes[-3:, 0], numpy.abs(self.nodes[-3:, 6])
        rate = math.log(slopes[0] / slopes[2]) / (s[2] - s[0]) if slopes.all() else 0.0
        return float(slopes[2] / rate) if _SLOWEST < rate < _FASTEST else math.inf

    @property
    def limit(self) -> float:
        """Where Omega tends to at the end [rad/s], to a fraction of its distance from there."""
        return float(self.nodes[-1, 3] + math.copysign(self._left, self.nodes[-1, 6]))

    @cached_property
    def connected(self) -> bool:
        """Whether the family is followed to the connection: v_0 falls towards its end as the distance from pi does."""
        s, ratio = self.nodes[[-3, -1], :2].T
        return bool(math.log(ratio[0] / ratio[1]) > s[1] - s[0])  # the distance falls twice as fast

    @cached_property
    def ends(self) -> tuple[tuple[str, float], ...]:
        """What bounds the pieces, by name, and its speed [rad/s]: the Hopf point, the folds and the connection.

        The last one is the amplitude pi, if the family is not `connected`.
        """
        turns = (("a fold", self.place(s).omega) for s in self.folds)
        return ("Omega_crit", self.omega_crit), *turns, ("Omega_h" if self.connected else "that amplitude", self.limit)
