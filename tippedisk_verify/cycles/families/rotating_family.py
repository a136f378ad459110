"""The family of rotating limit cycles, from the connection through its fold.

Below Omega_h the unstable manifold of the saddle goes over the top and leads to the stable rotating
cycle. From there on the disk leans more and more at the top of its turn. beta_bar_top rises from
its value at the connection towards pi/2, through the fold in Omega. Beyond the fold the cycles are
unstable and lie at rising speeds. s goes over the whole line.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction

import numpy

from tippedisk_verify.cycles.families.family import CycleGuess, Family, Solver, sequential_solver
from tippedisk_verify.cycles.shooting.return_map import ReturnMap
from tippedisk_verify.cycles.shooting.section import ROTATING
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.parameters import Parameters

__all__ = ["RotatingFamily"]

_NODES = 20  # nodes of a panel, with which the polynomials err by rounding only
_GUESSING_NODES = 10  # nodes of a panel whose polynomials only guess: they err by some 1e-8
# The first speed, relative to Omega_h. Closer, doubles do not hold T to twelve digits.
_FIRST_SPEED = 1 - Fraction(12, 10**5)
_MAX_PANELS = 16  # panels, after which beta_bar_top is within 1e-5 of pi/2


class RotatingFamily(Family):
    """The family of rotating limit cycles of one disk, followed below Omega_h, and beyond the fold
    as far as needed.

    Args:
        parameters: The disk and its friction law.
        engine: The engine of the flights.
        omega_h: The disk's Omega_h [rad/s].
        solver: Finds cycles of chosen beta_bar_top, on nodes that leave rounding only. If None, the
            engine finds them one at a time, on fewer nodes, for guesses.

    Raises:
        NoSuchCycleError: If the family does not begin.
    """

    section = ROTATING

    def __init__(
        self,
        parameters: Parameters,
        engine: Engine,
        omega_h: Fraction,
        solver: Solver | None = None,
    ) -> None:
        self.omega_h = omega_h
        first, singly = omega_h * _FIRST_SPEED, sequential_solver(ROTATING, parameters, engine)
        (lowest, _), (beta, v) = (
            map(float, ReturnMap(ROTATING, parameters, omega, engine).unstable_manifold_crossing())
            for omega in (omega_h, first)
        )
        if not lowest < beta:
            raise NoSuchCycleError(
                "no rotating cycle found below Omega_h: the unstable manifold leans less there"
            )
        # The flight time is not an unknown where the engine meets the section.
        second, flight_time, omega, *slopes = (
            float(values[0])
            for values in singly(*(numpy.array([x]) for x in (beta, v, math.nan, float(first))))
        )
        if math.isnan(omega):
            raise NoSuchCycleError(
                f"no rotating cycle found at {float(first):.10g} rad/s, next to Omega_h"
            )
        centre, half_range = (math.pi / 2 + lowest) / 2, (math.pi / 2 - lowest) / 2
        s = math.atanh((beta - centre) / half_range)
        rate = half_range / math.cosh(s) ** 2
        ratio_slope = (slopes[0] - second / beta) / beta
        first_row = (
            s,
            second / beta,
            flight_time,
            omega,
            *(rate * slope for slope in (ratio_slope, *slopes[1:])),
        )
        nodes = _GUESSING_NODES if solver is None else _NODES
        super().__init__(parameters, engine, solver or singly, nodes, centre, half_range, first_row)
        self.extend()
        self.unfollowed_speeds = ((float(self.nodes[0, 3]), float(omega_h)),)

    def follow_to(self, omega: float) -> None:
        """Follow the family beyond its fold, up to the speed ``omega``.

        Args:
            omega: The speed [rad/s].

        Raises:
            NoSuchCycleError: If the family ends before.
        """
        while self.nodes[-1, 6] < 0 or self.nodes[-1, 3] < omega:
            try:
                if len(self._panels) == _MAX_PANELS:
                    raise NoSuchCycleError("beta_bar_top has reached pi/2")
                self.extend()
            except NoSuchCycleError:
                end = f"the family of rotating cycles ends near {self.nodes[-1, 3]:.6g} rad/s"
                raise NoSuchCycleError(end) from None

    def fold_guess(self) -> CycleGuess:
        """Return an approximation (`CycleGuess`) of the family's fold, where Omega is smallest.

        Raises:
            NoSuchCycleError: If the family has no fold.
        """
        self.follow_to(0.0)
        if not self.folds:
            raise NoSuchCycleError(
                "the speeds of the rotating cycles rise from Omega_h on: they have no fold"
            )
        return self.guess(self.folds[0])

    def followed_guesses(self, omega: float, *, stable: bool | None = None) -> Iterator[CycleGuess]:
        """Yield approximations of the rotating cycles at a speed: the stable one before the fold,
        then the unstable one beyond it.

        The family is followed as far as the speed.

        Args:
            omega: The speed [rad/s].
            stable: True for the stable cycle only, False for the unstable one only, None for both.

        Raises:
            NoSuchCycleError: If the family ends before.
        """
        for side in (True, False) if stable is None else (stable,):
            if side and self.nodes[0, 3] < omega < self.omega_h:
                beta, v = ReturnMap(
                    ROTATING, self.parameters, Fraction(omega), self.engine
                ).unstable_manifold_crossing()
                yield CycleGuess((float(beta), float(v)), omega, 0, self.omega_falls[0])
                continue
            self.follow_to(0.0 if side else omega)
            yield from (
                place for place in self.guesses(omega) if self.omega_falls[place.piece] is side
            )
