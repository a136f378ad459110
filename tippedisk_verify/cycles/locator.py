"""Where the limit cycles of a disk are: its families, the guesses for shooting at a speed, or the
message that there is no cycle.

The Hopf point, the folds and Omega_h bound the pieces of a disk's families. A `CycleLocator` finds
these families in double when it first needs them, and keeps them. It computes Omega_h to more
digits if a speed is so close to Omega_h that doubles do not show the side.
"""

from __future__ import annotations

import threading
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Generic, TypeVar

from tippedisk_verify.connection.bisection import bisect_omega_h
from tippedisk_verify.connection.omega_h_digits import omega_h_resolving
from tippedisk_verify.cycles.families.family import CycleGuess
from tippedisk_verify.cycles.families.librating_family import LibratingFamily
from tippedisk_verify.cycles.families.rotating_family import RotatingFamily
from tippedisk_verify.cycles.limit_cycle import Cycle, LimitCycle, RotatingCycle
from tippedisk_verify.cycles.shooting.error_budget import (
    EXTRA_DIGITS,
    cycle_beyond_double,
    cycle_to_digits,
)
from tippedisk_verify.cycles.shooting.newton import FixedPoint
from tippedisk_verify.cycles.shooting.return_map import ReturnMap
from tippedisk_verify.cycles.shooting.section import LIBRATING, ROTATING, Section
from tippedisk_verify.cycles.shooting.shoot import MIN_SHOOTING_DISTANCE, NEAR_HOPF_DISTANCE, shoot
from tippedisk_verify.errors import AccuracyError, NoConnectionError, NoSuchCycleError
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.decimals import decimal_magnitude
from tippedisk_verify.theory.equilibria import saddle_value_sign
from tippedisk_verify.theory.hopf import distance_below_crit

__all__ = ["CycleLocator", "GuessesAtSpeed", "cached_locator"]

C = TypeVar("C", bound=Cycle)

# The distance [rad/s] from Omega_h within which the period law predicts cycles, where the family
# could not be followed.
_LAW_DISTANCE = Fraction(1, 100)
_FOLD_NEIGHBOURHOOD = 1e-4  # rad, in the first coordinate; two cycles that close are next to a fold
# The largest number of zeros after the point of a distance from the Hopf point. A cycle there takes
# half a minute.
_MAX_NEAR_HOPF_ZEROS = 100
# Nearer to the Hopf point than this many distances of the family's first node, the law of the
# amplitude predicts the cycle.
_AMPLITUDE_LAW_REACH = 2
_MAX_DISKS = 16  # disks in the cache


@dataclass(frozen=True)
class GuessesAtSpeed(Generic[C]):
    """The guesses for shooting the limit cycles of one kind at one speed, or the reason why there
    are no cycles.
    """

    section: Section[C]
    parameters: Parameters
    engine: Engine
    omega: Fraction  #: [rad/s]
    guesses: tuple[CycleGuess, ...]  #: in the order of their pieces
    no_cycle_reason: str = ""  #: the message if there is no guess
    #: [rad/s], to digits that show the side, if a guess has no coordinates
    omega_h: Fraction | None = None

    def shoot(self, guess: CycleGuess, digits: int = 12, *, half_widths: bool = True) -> C:
        """Compute the limit cycle to which a guess with coordinates leads, to ``digits`` digits.

        Args:
            guess: One of the guesses.
            digits: The significant digits wanted.
            half_widths: If False, the numbers have no half-widths.

        Raises:
            NoSuchCycleError: If the search fails.
            AccuracyError: If doubles cannot separate the cycle from its neighbour at a fold, or the
                digits are not reached.
        """
        return_map = ReturnMap(self.section, self.parameters, self.omega, self.engine)
        try:
            if guess.hopf_distance_zeros:
                newborn = FixedPoint(
                    return_map, guess.coordinates, return_map(guess.coordinates), ()
                )
                cycle = cycle_beyond_double(
                    newborn, digits, EXTRA_DIGITS + guess.hopf_distance_zeros
                )
            else:
                cycle = cycle_to_digits(
                    shoot(return_map, guess.coordinates), digits, half_widths=half_widths
                )
        except AccuracyError as fault:
            others = [
                other.coordinates[0]
                for other in self.guesses
                if other.has_coordinates and other is not guess
            ]
            if not any(abs(other - guess.coordinates[0]) < _FOLD_NEIGHBOURHOOD for other in others):
                raise
            raise AccuracyError(
                f"{fault}; the speed is next to a fold, where two cycles meet"
            ) from None
        rate = getattr(cycle, f"d{self.section.coordinate_names[0]}_domega")
        if (
            rate.is_measured
            and not (-rate.value if guess.omega_falls else rate.value) > rate.uncertainty
        ):
            raise AccuracyError(
                f"{float(self.omega):.17g} rad/s is so close to a fold that doubles cannot tell "
                f"its two cycles apart"
            )
        return cycle


class CycleLocator:
    """The families of limit cycles of one disk under its friction law, and Omega_h.

    It locates the cycles at any speed. Families and Omega_h are computed on first use.

    Args:
        parameters: The disk and its friction law.
        engine: The engine of the flights.
    """

    def __init__(self, parameters: Parameters, engine: Engine) -> None:
        self.parameters, self.engine = parameters, engine

    @cached_property
    def omega_h(self) -> Fraction:
        """Omega_h of the disk in double [rad/s].

        Raises:
            NoConnectionError: If there is no connection.
        """
        return bisect_omega_h(self.parameters, self.engine, confirm=False).omega_h.value

    @cached_property
    def connection_attracts(self) -> bool:
        """True if the heteroclinic connection attracts, so that librating cycles begin above
        Omega_h.

        Raises:
            NoConnectionError: If there is no connection.
        """
        return saddle_value_sign(self.parameters, self.omega_h) < 0

    @cached_property
    def librating_family(self) -> LibratingFamily:
        """The family of librating cycles, followed on first use.

        Raises:
            NoSuchCycleError: If they cannot be followed.
        """
        return LibratingFamily(self.parameters, self.engine)

    @cached_property
    def family_failure(self) -> str:
        """The reason why the disk's librating cycles cannot be followed as a family; "" if they
        can.
        """
        try:
            self.librating_family  # noqa: B018
        except NoSuchCycleError as fault:
            return str(fault)
        return ""

    @cached_property
    def rotating_family(self) -> RotatingFamily:
        """The family of rotating cycles, followed on first use.

        Raises:
            NoSuchCycleError: If they cannot be followed.
            NoConnectionError: If there is no connection.
        """
        return RotatingFamily(self.parameters, self.engine, self.omega_h)

    def librating_guesses_at(
        self, omega: Fraction, omega_h: Fraction | None = None
    ) -> GuessesAtSpeed[LimitCycle]:
        """Locate the librating limit cycles, about inverted spinning, at a speed.

        Args:
            omega: The speed [rad/s].
            omega_h: A better Omega_h than the locator's own [rad/s], if the caller has one.

        Returns:
            The guesses for shooting, or the reason why there is none.

        Raises:
            AccuracyError: If the speed is closer to Omega_crit than cycles are offered.
        """
        guesses_at_speed = GuessesAtSpeed(
            LIBRATING, self.parameters, self.engine, omega, (), self.family_failure, omega_h
        )
        if self.family_failure:
            with suppress(NoConnectionError, AccuracyError):
                if abs(omega - self.omega_h) < _LAW_DISTANCE:
                    return self._with_true_side_of_omega_h(
                        guesses_at_speed, 0, above=self.connection_attracts
                    )
            return guesses_at_speed
        family = self.librating_family
        guesses = list(family.guesses(float(omega)))
        if not any(guess.piece == 0 for guess in guesses):
            guesses[:0] = _near_hopf_guesses(family, distance_below_crit(self.parameters, omega))
        no_cycle_reason = _no_libration_message(family, float(omega))
        guesses_at_speed = replace(
            guesses_at_speed, no_cycle_reason=no_cycle_reason, guesses=tuple(guesses)
        )
        if family.connected and abs(omega - Fraction(family.limit)) < 2 * MIN_SHOOTING_DISTANCE:
            with suppress(NoConnectionError, AccuracyError):
                return self._with_true_side_of_omega_h(
                    guesses_at_speed, len(family.folds), above=self.connection_attracts
                )
        return guesses_at_speed

    def rotating_guesses_at(
        self, omega: Fraction, *, stable: bool | None = None, omega_h: Fraction | None = None
    ) -> GuessesAtSpeed[RotatingCycle]:
        """Locate the rotating cycles at a speed, the stable one before the fold first.

        Args:
            omega: The speed [rad/s].
            stable: True for the stable cycle only, False for the unstable one only, None for both.
            omega_h: A better Omega_h than the locator's own [rad/s], if the caller has one.

        Returns:
            The guesses for shooting, or the reason why there is none.

        Raises:
            NoSuchCycleError: If the family cannot be followed.
            NoConnectionError: If there is no connection.
            AccuracyError: If Omega_h has too few digits.
        """
        family, speed = self.rotating_family, float(omega)
        too_close = stable is not False and abs(omega - family.omega_h) < MIN_SHOOTING_DISTANCE
        guesses, no_cycle_reason = list[CycleGuess](), ""
        if not too_close or stable is None:
            try:
                guesses.extend(
                    family.followed_guesses(speed, stable=False if too_close else stable)
                )
                no_cycle_reason = _no_rotation_message(family, omega, stable)
            except NoSuchCycleError as fault:
                no_cycle_reason = str(fault)
        guesses_at_speed = GuessesAtSpeed(
            ROTATING, self.parameters, self.engine, omega, tuple(guesses), no_cycle_reason, omega_h
        )
        return (
            self._with_true_side_of_omega_h(guesses_at_speed, 0, above=False)
            if too_close
            else guesses_at_speed
        )

    def _with_true_side_of_omega_h(
        self, guesses_at_speed: GuessesAtSpeed[C], piece: int, *, above: bool
    ) -> GuessesAtSpeed[C]:
        """Return the ``guesses_at_speed`` of the cycles at a speed so close to Omega_h that doubles
        do not show on which side the speed is, corrected for the true side.

        ``piece`` is the number of the family's piece that ends at Omega_h. Its cycles lie ``above``
        Omega_h, or below. If the speed is on their side, the piece gets a guess without
        coordinates. Otherwise it gets none.

        Raises AccuracyError if Omega_h has too few digits.
        """
        omega, omega_h = guesses_at_speed.omega, guesses_at_speed.omega_h
        if omega_h is None:
            omega_h = omega_h_resolving(self.parameters, omega, self.engine).value
        guesses = [guess for guess in guesses_at_speed.guesses if guess.piece != piece]
        no_cycle_reason = guesses_at_speed.no_cycle_reason
        if (omega > omega_h) is above:
            guesses.insert(piece, CycleGuess.without_coordinates(omega, piece))
        else:
            kind = (
                "limit cycle" if guesses_at_speed.section is LIBRATING else "stable rotating cycle"
            )
            distance, side = float(abs(omega - omega_h)), "below" if above else "above"
            no_cycle_reason = (
                f"no {kind} found at {float(omega):.10g} rad/s, {distance:.2g} rad/s {side} Omega_h"
            )
        return replace(
            guesses_at_speed,
            guesses=tuple(guesses),
            no_cycle_reason=no_cycle_reason,
            omega_h=omega_h,
        )


def _near_hopf_guesses(family: LibratingFamily, below_crit: Fraction) -> list[CycleGuess]:
    """Return a guess for the limit cycle between the Hopf point and the family's first node, in a
    list.

    The list is empty if no cycle lies there. ``below_crit`` is Omega_crit less the speed [rad/s].

    Raises AccuracyError if the speed is closer to the Hopf point than cycles are offered.
    """
    first_node_distance = Fraction(family.omega_crit - float(family.nodes[0, 3]))
    if not 0 < below_crit / first_node_distance < _AMPLITUDE_LAW_REACH:
        return []
    distance = abs(below_crit)
    zeros = max(0, -decimal_magnitude(distance))
    if zeros > _MAX_NEAR_HOPF_ZEROS:
        raise AccuracyError(
            f"limit cycles are offered down to 1e-{_MAX_NEAR_HOPF_ZEROS} rad/s from Omega_crit: ask "
            f"for one farther away"
        )
    return [
        replace(
            family.near_hopf_guess(float(distance)),
            hopf_distance_zeros=zeros if distance < NEAR_HOPF_DISTANCE else 0,
        )
    ]


def _no_libration_message(family: LibratingFamily, omega: float) -> str:
    """Return the message that no librating cycle was found at a speed.

    It names the family's ends if the speed lies outside them. Otherwise the search has failed.
    """
    lowest, *_, highest = sorted(family.ends, key=lambda end: end[1])
    text = f"no limit cycle found at {omega:.10g} rad/s"
    if lowest[1] <= omega <= highest[1]:
        return text
    distance, side = (
        (omega - highest[1], "above") if omega > highest[1] else (lowest[1] - omega, "below")
    )
    lies = "lies"
    if not family.connected:
        lies = f"is followed to {family.limit:.7g} rad/s only, where gamma's amplitude is pi, and lies so far"
    ends = (
        f"{name} {'=' if name.startswith('Omega') else 'at'} {speed:.7g} rad/s"
        for name, speed in (lowest, highest)
    )
    return f"{text}: that is {distance:.2g} rad/s {side} the family, which {lies} between {' and '.join(ends)}"


def _no_rotation_message(family: RotatingFamily, omega: Fraction, stable: bool | None) -> str:
    """Return the message that no rotating cycle exists at ``omega``.

    If ``stable`` is True and the speed is not below Omega_h, that is the reason. Otherwise the
    reason is the fold, which lies above the speed.

    Raises NoSuchCycleError if the family's fold cannot be found.
    """
    if stable and omega >= family.omega_h:
        return (
            f"no stable rotating cycle found at {float(omega):.10g} rad/s: they are looked for "
            f"below Omega_h, "
            f"{float(family.omega_h):.10g} rad/s"
        )
    fold = family.fold_guess().omega
    return f"the rotating cycles turn round in a fold near {fold:.6g} rad/s, above {float(omega):.10g} rad/s"


class _ThreadLocators(threading.local):
    """The `CycleLocator` objects that each thread keeps, because engines belong to one thread."""

    def __init__(self) -> None:
        self.locators: dict[tuple[type, Parameters, str], CycleLocator] = {}


_LOCATORS = _ThreadLocators()


def cached_locator(parameters: Parameters, engine: Engine) -> CycleLocator:
    """Return this thread's `CycleLocator` of a disk.

    The last few are kept, so calls with the same disk, friction law and engine name share one.

    Args:
        parameters: The disk and its friction law.
        engine: The engine of the flights.
    """
    key, locators = (type(parameters), parameters, engine.name), _LOCATORS.locators
    if key not in locators:
        if len(locators) >= _MAX_DISKS:
            del locators[next(iter(locators))]
        locators[key] = CycleLocator(parameters, engine)
    return locators[key]
