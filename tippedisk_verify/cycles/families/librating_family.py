"""The family of librating limit cycles, from the Hopf point to the connection.

The amplitude is gamma_bar_0 = pi tanh(s): s = 0 is the Hopf point, and infinite s the connection.
v_0 / gamma_bar_0 and beta_max / gamma_bar_0, the period and Omega are analytic there.

Towards a saddle whose stable eigenvalues are complex, orbits wind. The amplitude then reaches pi at
v_0 != 0, short of the connection. There this family ends.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy

from tippedisk_verify.cycles.families.family import CycleGuess, Family, Solver, sequential_solver
from tippedisk_verify.cycles.shooting.section import LIBRATING
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.theory.hopf import critical_frequency_squared, omega_crit

__all__ = ["LibratingFamily"]

_NODES = 20  # nodes of a panel, with which the polynomials err by rounding only
# The distance [rad/s] from its limit to which Omega is followed. Closer, doubles hold no cycles.
_MIN_DISTANCE = 1e-5
# Bounds of the rate at which the slope of Omega falls towards a connection. It is nearly 2 to 4.
_SLOWEST, _FASTEST = 1.5, 6.0
_MAX_PANELS = 10  # panels, after which the amplitude is within 1e-5 of pi


class LibratingFamily(Family):
    """The family of librating limit cycles of one disk under its friction law, in double.

    Args:
        parameters: The disk and its friction law.
        engine: The engine of the flights.
        solver: Finds cycles of chosen amplitudes. If None, the engine finds them one at a time.
        closest: The distance [rad/s] from its limit to which Omega is followed.

    Raises:
        NoSuchCycleError: If the family cannot be followed.
    """

    section = LIBRATING
    origin = 0.0

    def __init__(
        self,
        parameters: Parameters,
        engine: Engine,
        solver: Solver | None = None,
        closest: float = _MIN_DISTANCE,
    ) -> None:
        self.omega_crit = float(omega_crit(parameters))
        frequency = math.sqrt(critical_frequency_squared(parameters))
        first_row = (
            0.0,
            -(frequency**2) / self.omega_crit,
            math.pi / frequency,
            self.omega_crit,
            0.0,
            0.0,
            0.0,
        )
        solver = solver or sequential_solver(LIBRATING, parameters, engine)
        super().__init__(parameters, engine, solver, _NODES, 0.0, math.pi, first_row)
        while not len(self._panels) or (
            self._distance_to_limit > closest and len(self._panels) < _MAX_PANELS
        ):
            self.extend()
        if not self._distance_to_limit < math.inf:
            raise NoSuchCycleError(self._lost_family_error(self.nodes[-1, 0]))
        first, last = map(float, self.nodes[[0, -1], 3])
        self.unfollowed_speeds = (first, self.omega_crit), (last, 2 * self.limit - last)

    @property
    def _distance_to_limit(self) -> float:
        """The distance [rad/s] of the speed at the family's last node from the speed's limit,
        estimated from the slope's rate of decay.

        It is infinite if the slope does not fall as towards a connection. There Omega - Omega_h
        goes with the distance from the saddle to the power 1 + min(q, 1 / q), where q = |lambda_s|
        / lambda_u. The distance goes like exp(-2 s).
        """
        s, slopes = self.nodes[-3:, 0], numpy.abs(self.nodes[-3:, 6])
        rate = math.log(slopes[0] / slopes[2]) / (s[2] - s[0]) if slopes.all() else 0.0
        return float(slopes[2] / rate) if _SLOWEST < rate < _FASTEST else math.inf

    @property
    def limit(self) -> float:
        """The speed Omega [rad/s] that the family tends to at its end, an estimate.

        Its error is a fraction of the last node's distance from it.
        """
        return float(self.nodes[-1, 3] + math.copysign(self._distance_to_limit, self.nodes[-1, 6]))

    def near_hopf_guess(self, distance: float) -> CycleGuess:
        """Return the approximate cycle (`CycleGuess`) at a distance from the Hopf point, nearer
        than the first node.

        Next to the Hopf point the distance goes like a power of the amplitude: the second, or the
        fourth at a degenerate Hopf point. The first node has that power and its factor.

        Args:
            distance: The distance of the speed from the Hopf point [rad/s].
        """
        s, _, _, omega, _, _, slope = self.nodes[0].tolist()
        node_distance = self.omega_crit - omega
        return self.guess(s * (distance / abs(node_distance)) ** (-node_distance / (s * slope)))

    @cached_property
    def connected(self) -> bool:
        """True if the family is followed to the heteroclinic connection: v_0 falls as the distance
        of gamma_bar_0 from pi does.
        """
        s, ratio = self.nodes[[-3, -1], :2].T
        return bool(math.log(ratio[0] / ratio[1]) > s[1] - s[0])  # the distance falls twice as fast

    @cached_property
    def ends(self) -> tuple[tuple[str, float], ...]:
        """The ends of the pieces by name, with their speeds [rad/s]: the Hopf point, the folds and
        the connection.

        If the family is not `connected`, the last one is the amplitude pi.
        """
        turns = (("a fold", self.guess(s).omega) for s in self.folds)
        return (
            ("Omega_crit", self.omega_crit),
            *turns,
            ("Omega_h" if self.connected else "that amplitude", self.limit),
        )
