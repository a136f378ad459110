"""Which limit cycles a disk has at a speed, where to shoot for them, and what is said where there are none.

The Hopf point, the folds and Omega_h bound the pieces of a disk's families. A `Locator` finds these families in double
when a question first needs them, and keeps them; Omega_h is taken to more digits where a speed is so close to it that
doubles do not tell the side.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Generic, TypeVar

from tippedisk_verify.connection.bisection import bisect_omega_h
from tippedisk_verify.connection.near_connection import DOUBLE_SHOOTS, cycle_near
from tippedisk_verify.connection.splitting import splitting_zero
from tippedisk_verify.cycles.error_budget import cycle_to_digits
from tippedisk_verify.cycles.family import Place
from tippedisk_verify.cycles.librating_family import LibratingFamily, amplitude
from tippedisk_verify.cycles.limit_cycle import Cycle, LimitCycle, RotatingCycle
from tippedisk_verify.cycles.return_map import ReturnMap
from tippedisk_verify.cycles.rotating_family import RotatingFamily
from tippedisk_verify.cycles.section import LIBRATING, ROTATING, Section
from tippedisk_verify.cycles.shooting import shoot
from tippedisk_verify.errors import NoConnectionError, NoSuchCycleError, Shortfall
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.theory.equilibria import saddle_value_sign

__all__ = ["Location", "Locator", "Start", "locator"]

C = TypeVar("C", bound=Cycle)

_UNFOLLOWED = Fraction(1, 100)  # rad/s; so close to Omega_h its law leads to cycles of a family that was not followed
_ABOUT_TO_MEET = 1e-4  # of the first coordinate; two cycles so close together are next to a fold
_MOST_DISKS = 16  # whose families are kept


@dataclass(frozen=True)
class Start(Generic[C]):
    """Where to shoot for one cycle of a family."""

    guess: tuple[float, float] | None  #: of the section's coordinates; None next to Omega_h, where doubles have none
    piece: int = 0  #: of the family, counted from its beginning; one more after each fold
    holds: Callable[[C], bool] = lambda cycle: True  #: whether a cycle lies on that piece


@dataclass(frozen=True)
class Location(Generic[C]):
    """The cycles of one kind at one speed: where to shoot for them, or why there are none."""

    section: Section[C]
    parameters: Parameters
    engine: Engine
    omega: Fraction  #: [rad/s]
    starts: tuple[Start[C], ...]  #: in the order of their pieces
    refusal: str  #: what is said if there are none
    omega_h: Fraction | None = None  #: [rad/s], to digits that tell the side, where a start has no guess

    def cycles(self, digits: int = 12) -> list[C]:
        """All of them, to ``digits`` digits. Raises NoSuchCycleError if there are none, and as `cycle` does."""
        if not self.starts:
            raise NoSuchCycleError(self.refusal)
        return [self.cycle(start, digits) for start in self.starts]

    def cycle(self, start: Start[C], digits: int = 12) -> C:
        """The cycle of one start, to ``digits`` digits.

        Raises NoSuchCycleError if it is not found, Shortfall if doubles do not tell it from its neighbour at a fold, or
        the digits are not reached.
        """
        if start.guess is None:
            assert self.omega_h is not None
            return cycle_near(self.section, self.parameters, self.omega, self.omega_h, self.engine, digits=digits)
        return_map = ReturnMap(self.section, self.parameters, self.omega, self.engine)
        try:
            cycle = cycle_to_digits(shoot(return_map, start.guess), digits)
        except Shortfall as fault:
            others = [other.guess[0] for other in self.starts if other.guess and other is not start]
            if not any(abs(other - start.guess[0]) < _ABOUT_TO_MEET for other in others):
                raise
            raise Shortfall(f"{fault}; the speed is next to a fold, where two cycles meet") from None
        if not start.holds(cycle):
            raise Shortfall(
                f"{float(self.omega):.17g} rad/s is so close to a fold that doubles cannot tell its two cycles apart"
            )
        return cycle


class Locator:
    """The families of one disk under its friction law, and Omega_h."""

    def __init__(self, parameters: Parameters, engine: Engine) -> None:
        self.parameters, self.engine = parameters, engine

    @cached_property
    def omega_h(self) -> Fraction:
        """As doubles see it [rad/s]. Raises NoConnectionError if there is none."""
        return bisect_omega_h(self.parameters, self.engine, confirm=False).omega_h.value

    @cached_property
    def family(self) -> LibratingFamily:
        """The librating cycles. Raises NoSuchCycleError where they cannot be followed."""
        return LibratingFamily(self.parameters, self.engine)

    @cached_property
    def rotations(self) -> RotatingFamily:
        """The rotating cycles. Raises NoSuchCycleError or NoConnectionError where they are not found."""
        return RotatingFamily(self.parameters, self.engine, self.omega_h)

    def omega_h_beside(self, omega: Fraction) -> Fraction:
        """Omega_h [rad/s] to six digits of its distance from a speed. Raises as its methods do."""
        digits = 20
        while True:
            omega_h = splitting_zero(self.parameters, self.omega_h, self.engine, digits).omega_h
            if abs(omega - omega_h.value) > omega_h.uncertainty * 10**6:
                return omega_h.value
            digits *= 2

    def librating(self, omega: Fraction, omega_h: Fraction | None = None) -> Location[LimitCycle]:
        """The cycles about inverted spinning at a speed [rad/s]; ``omega_h`` is the caller's better Omega_h."""
        starts: list[Start[LimitCycle]] = []
        speed, last = float(omega), 0
        limit: Fraction | None = None
        try:
            family = self.family
        except NoSuchCycleError as fault:
            refusal, reach = str(fault), _UNFOLLOWED
            with suppress(NoConnectionError):
                limit = self.omega_h
        else:
            refusal, reach, last = family.refusal(speed), 2 * DOUBLE_SHOOTS, len(family.folds)
            starts = [_start(family, place) for place in family.places(speed)]
            limit = Fraction(family.limit) if family.connected else None
        if limit is not None and abs(omega - limit) < reach:
            with suppress(NoConnectionError, Shortfall):
                omega_h = omega_h or self.omega_h_beside(omega)
                starts = [start for start in starts if start.piece < last]
                attracts = saddle_value_sign(self.parameters, omega_h) < 0
                if (omega > omega_h) is attracts:
                    starts.append(Start(None, last))
                else:  # the reason in double may be off by more than the distance
                    distance, side = float(abs(omega_h - omega)), "below" if attracts else "above"
                    refusal = f"no limit cycle found at {speed:.10g} rad/s, {distance:.2g} rad/s {side} Omega_h"
        return Location(LIBRATING, self.parameters, self.engine, omega, tuple(starts), refusal, omega_h)

    def rotating(
        self, omega: Fraction, *, stable: bool | None = None, omega_h: Fraction | None = None
    ) -> Location[RotatingCycle]:
        """The rotating cycles at a speed [rad/s], the stable one before the fold first; or only one of them.

        Raises NoSuchCycleError or NoConnectionError where the family is not found.
        """
        starts: list[Start[RotatingCycle]] = []
        refusal, speed = "", float(omega)
        beside = stable is not False and abs(omega - self.rotations.omega_h) < DOUBLE_SHOOTS
        if beside:
            omega_h = omega_h or self.omega_h_beside(omega)
            if omega < omega_h:
                starts.append(Start(None))
            else:
                distance = float(omega - omega_h)
                refusal = f"no stable rotating cycle found at {speed:.10g} rad/s, {distance:.2g} rad/s above Omega_h"
        for piece, side in enumerate((True, False)):
            if stable in (None, side) and not (side and beside):
                try:
                    guess = self.rotations.guess(speed, stable=side)
                except NoSuchCycleError as fault:
                    refusal = str(fault)
                else:
                    starts.append(Start(guess, piece, _is_stable if side else _is_unstable))
        return Location(ROTATING, self.parameters, self.engine, omega, tuple(starts), refusal, omega_h)


def _start(family: LibratingFamily, place: Place) -> Start[LimitCycle]:
    """At the family's ends, which are no folds, a cycle may lie a little beyond the nodes."""
    low, high = family.breaks[place.piece : place.piece + 2]
    lowest = float(amplitude(low)) if place.piece else -math.inf
    highest = math.inf if place.piece == len(family.folds) else float(amplitude(high))
    return Start(place.start, place.piece, lambda cycle: lowest <= float(cycle.gamma_bar_0) <= highest)


def _is_stable(cycle: Cycle) -> bool:
    return cycle.stable is True


def _is_unstable(cycle: Cycle) -> bool:
    return cycle.stable is False


class _Own(threading.local):
    """A thread's locators: engines are a thread's own."""

    def __init__(self) -> None:
        self.locators: dict[tuple[type, Parameters, str], Locator] = {}


_OWN = _Own()


def locator(parameters: Parameters, engine: Engine) -> Locator:
    """The disk's locator, the same whenever disk, law and engine's name are."""
    key, locators = (type(parameters), parameters, engine.name), _OWN.locators
    if key not in locators:
        if len(locators) >= _MOST_DISKS:
            del locators[next(iter(locators))]
        locators[key] = Locator(parameters, engine)
    return locators[key]
