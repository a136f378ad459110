"""Proofs about a disk: ordinary methods find candidates, and `proofs` encloses them.

`proofs` imports only the equations. This module supplies the starting numbers of each proof. A
failed proof is a result too: its ``status`` names the step that failed.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any, cast

from tippedisk_verify.errors import AccuracyError, InputError, NoConnectionError, NoSuchCycleError
from tippedisk_verify.numbers.exact import exact, short_text
from tippedisk_verify.numbers.numpy_errors import ignore_numpy_errors_in_methods
from tippedisk_verify.support.progress import show_progress

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from tippedisk_verify.cycles.families.folds import Fold
    from tippedisk_verify.disk import Disk
    from tippedisk_verify.proofs.closed_forms import ProvedEquilibrium, ProvedHopf, ProvedStability
    from tippedisk_verify.proofs.kernel.certificates.family import ArcStatus, ProvedArc
    from tippedisk_verify.proofs.search.connection_proof import ConnectionProof
    from tippedisk_verify.proofs.search.cycle_proof import CycleProof
    from tippedisk_verify.proofs.search.cycles_near_omega_h_proof import CyclesNearOmegaHProof
    from tippedisk_verify.proofs.search.family_proof import FamilyProof
    from tippedisk_verify.proofs.search.family_search import AmplitudeInterval
    from tippedisk_verify.proofs.search.fold_proof import FoldProof
    from tippedisk_verify.theory.equilibria import EquilibriumName

__all__ = ["Certifier"]

_BAR_STEPS_PER_RAD = 1000
_MAX_AMPLITUDE = Fraction("3.1415")  # rad, just below pi, which gamma_bar_0 reaches at Omega_h
# rad/s from Omega_h. At 1e-5 the proof of one cycle takes a minute, closer in it takes longer.
_MIN_DISTANCE = Fraction(1, 10**7)
ExecutorFactory = Callable[[bool], AbstractContextManager["Executor | None"]]


@ignore_numpy_errors_in_methods
@dataclass(frozen=True)
class Certifier:
    """The proofs of one disk: numbers as enclosures, each with the statement that is proved.

    Every result has ``proved``, ``statement`` and ``to_dict()``. The result of a search also has
    ``certificate()``, a text that `check` replays. Speeds are in rad/s. ``digits`` is the number of
    significant digits of each main result.

    Args:
        disk: The disk whose properties are proved.
    """

    disk: Disk

    def __post_init__(self) -> None:
        self.disk.refuse_custom_law("proofs are")

    # --------------------------------------------------------------------------------- closed forms
    def equilibrium(
        self, name: EquilibriumName, omega: object, *, digits: int = 12
    ) -> ProvedEquilibrium:
        """Prove the eigenvalues and the stability of an equilibrium under both friction laws.

        Args:
            name: ``inverted`` or ``noninverted`` spinning.
            omega: The spinning speed [rad/s].
            digits: Significant digits of each eigenvalue [1/s].

        Returns:
            The enclosures, each with its statement.

        Raises:
            InputError: If ``omega`` is not a speed or ``name`` is not an equilibrium.
        """
        from tippedisk_verify.proofs.closed_forms import proved_equilibrium

        return proved_equilibrium(self.disk, omega, name, digits)

    def stability(self, *, digits: int = 12) -> ProvedStability:
        """Prove linear stability at every speed, and Omega_crit, under both friction laws.

        Args:
            digits: Significant digits of Omega_crit [rad/s].

        Returns:
            The enclosures, each with its statement.
        """
        from tippedisk_verify.proofs.closed_forms import proved_stability

        return proved_stability(self.disk, digits)

    def hopf(self, *, digits: int = 12) -> ProvedHopf:
        """Prove the Hopf point, and on which side of it the limit cycles lie.

        Args:
            digits: Significant digits of each main result.

        Returns:
            The enclosures, each with its statement.

        Raises:
            InputError: If the disk has the smooth friction law.
        """
        from tippedisk_verify.proofs.closed_forms import proved_hopf

        self.disk.refuse_unless_linear("the Hopf point's normal form is")
        return proved_hopf(self.disk, digits)

    # -------------------------------------------------------------------------------- single cycles
    def limit_cycle(
        self,
        omega: object,
        *,
        rotating: bool = False,
        stable: bool | None = None,
        guess: tuple[object, object] | None = None,
        digits: int = 12,
    ) -> CycleProof:
        """Prove one limit cycle: existence, local uniqueness, its numbers and its stability.

        The search starts from ``guess``, or from the cycle that `Disk` finds.

        Args:
            omega: The spinning speed [rad/s].
            rotating: Prove a rotating cycle, on which gamma grows by 2 pi a period.
            stable: Choose the stable or the unstable cycle where a speed has both.
            guess: Approximate section coordinates (gamma_bar_0 [rad], v_0 [rad/s]), or for a
                rotating cycle (beta_bar_top [rad], v_top [rad/s]).
            digits: Significant digits of each main result.

        Returns:
            The proof. Without a cycle to start from, its status is ``NO_GUESS``.

        Raises:
            InputError: If the speed lies next to Omega_h and no guess is given; `near_omega_h`
                proves those cycles.
        """
        from tippedisk_verify.proofs.search.cycle_proof import (
            LIBRATING_SECTION,
            ROTATING_SECTION,
            CycleProof,
            CycleStatus,
            prove_cycle,
        )

        section, speed = ROTATING_SECTION if rotating else LIBRATING_SECTION, self.disk.speed(omega)
        try:
            start = guess or self._start_of_proof(speed, rotating, stable)
        except NoSuchCycleError as fault:
            return CycleProof(section, CycleStatus.NO_GUESS, str(fault), self.disk, speed, 0)
        return prove_cycle(self.disk, speed, start, digits=digits, section=section)

    def _start_of_proof(
        self, speed: Fraction, rotating: bool, stable: bool | None
    ) -> tuple[object, object]:
        """Return both section coordinates of the cycle that `Disk` finds, from which a proof
        starts.

        Raises:
            InputError: If the speed lies next to Omega_h.
        """
        from tippedisk_verify.cycles.locator import cached_locator
        from tippedisk_verify.flow import default_engine

        with suppress(NoConnectionError):
            if (
                away := abs(speed - cached_locator(self.disk, default_engine()).omega_h)
            ) < _MIN_DISTANCE:
                raise InputError(
                    f"{float(speed):.12g} rad/s lies {float(away):.2g} from Omega_h, and single"
                    f" cycles are proved from {float(_MIN_DISTANCE):g} on: `certify heteroclinic"
                    " --cycles D` proves all up to a distance D above it"
                )
        if rotating:
            rotation = self.disk.rotating_cycle(speed, stable=stable is not False)
            return rotation.beta_bar_top.value, rotation.v_top.value
        cycle = self.disk.limit_cycle(speed, stable=stable)
        return cycle.gamma_bar_0.value, cycle.v_0.value

    def fold(
        self, number: int | None = None, *, rotating: bool = False, digits: int = 12
    ) -> FoldProof:
        """Prove a fold, where two cycles of the family meet and end.

        Args:
            number: The number of the fold in its family, from 1. It may be left out if the family
                has only one.
            rotating: Prove the fold of the rotating cycles.
            digits: Significant digits of each main result.

        Returns:
            The proof. If no fold was found, it gives the reason.

        Raises:
            InputError: If the disk has the smooth friction law, the family has no such fold, or it
                has several and ``number`` is left out.
        """
        from tippedisk_verify.proofs.kernel.certificates.fold import claimed_names
        from tippedisk_verify.proofs.search.fold_proof import (
            LIBRATING_SECTION,
            ROTATING_SECTION,
            FoldProof,
            prove_fold,
        )

        self.disk.refuse_unless_linear("folds of limit cycles are proved")
        section, folds = (
            ROTATING_SECTION if rotating else LIBRATING_SECTION,
            cast("tuple[Fold, ...]", ()),
        )
        fault = "no fold of this disk's limit cycles about inverted spinning was found"
        try:
            finer = digits + 10
            folds = (
                (self.disk.rotation_fold(digits=finer),)
                if rotating
                else self.disk.folds(digits=finer)
            )
        except (NoSuchCycleError, NoConnectionError, AccuracyError) as error:
            fault = str(error)
        if not folds:
            return FoldProof(section, fault, self.disk, 0)
        speeds = ", ".join(f"{fold.omega:.10g}" for fold in folds)
        if number is None and len(folds) > 1:
            raise InputError(
                f"this family has {len(folds)} folds, at {speeds} rad/s: choose one by its number"
            )
        if not 1 <= (number := number or 1) <= len(folds):
            raise InputError(
                f"there is no fold {number}: this family has {len(folds)} "
                f"fold{'s' if len(folds) > 1 else ''}"
            )
        omega, first, second, _ = claimed_names(section)
        near = [getattr(folds[number - 1], name).value for name in (first, second, omega)]
        return prove_fold(self.disk, near, digits=digits, section=section)

    # ----------------------------------------------------------------------- Omega_h and the family
    def heteroclinic(
        self, near: object = None, *, digits: int = 12, progress: bool | None = None
    ) -> ConnectionProof:
        """Enclose Omega_h in an interval of length 10^-digits or less, and prove it unique there.

        Args:
            near: An approximation of Omega_h [rad/s]. If it is left out, `Disk` computes one.
            digits: Decimal places of the enclosure.
            progress: False hides the progress bar.

        Returns:
            The proof. Without a connection to start from, its status is ``NO_SADDLE``.

        Raises:
            InputError: If the number of digits is larger than a proof offers.
        """
        from tippedisk_verify.proofs.search.connection_proof import (
            MAX_DIGITS,
            ConnectionProof,
            ConnectionStatus,
            prove_connection,
        )

        if digits > MAX_DIGITS:
            raise InputError(f"a proof of Omega_h is offered to {MAX_DIGITS} digits, not {digits}")
        with show_progress(2, progress) as advance:
            try:
                advance("an approximation", 0)
                guess = (
                    self.disk.heteroclinic(digits=digits + 5).omega_h.value
                    if near is None
                    else near
                )
                advance("proof", 1)
                return prove_connection(self.disk, guess, digits)
            except NoConnectionError as fault:
                return ConnectionProof(ConnectionStatus.NO_SADDLE, outcome_detail=str(fault))

    def near_omega_h(
        self,
        distance: object,
        near: object = None,
        *,
        digits: int = 12,
        progress: bool | None = None,
    ) -> CyclesNearOmegaHProof:
        """Prove the limit cycle of every speed up to a distance above Omega_h.

        `heteroclinic` proves Omega_h first.

        Args:
            distance: The greatest distance from Omega_h [rad/s].
            near, digits, progress: As for `heteroclinic`.

        Returns:
            The proof of the cycles, with that of Omega_h.

        Raises:
            InputError: If the disk has the smooth friction law, or an argument cannot be used.
        """
        from tippedisk_verify.proofs.search.cycles_near_omega_h_proof import (
            checked_distance,
            prove_cycles_near_omega_h,
        )

        checked_distance(distance)
        self.disk.refuse_unless_linear("limit cycles next to the connection are proved")
        connection, shares = self.heteroclinic(near, digits=digits, progress=progress), [0]
        with show_progress(100, progress) as advance:

            def watch(share: float) -> None:
                shares.append(int(100 * share))
                advance("limit cycles", shares[-1] - shares[-2])

            return prove_cycles_near_omega_h(connection, distance, on_progress=watch)

    def branch(
        self,
        until: object = None,
        *,
        workers: ExecutorFactory = lambda several: nullcontext(None),
        progress: bool | None = None,
    ) -> FamilyProof:
        """Prove that the limit cycles from the Hopf point to the heteroclinic cycle form one curve.

        Along this curve the cycles are stable and Omega falls.

        Args:
            until: The amplitude gamma_bar_0 [rad] at which to stop. The end at Omega_h is then left
                out.
            workers: Makes a context with an executor, or None, for several jobs (True) or for one
                at a time (False).
            progress: False hides the progress bar.

        Returns:
            The proof; if it fails, its status names the step.

        Raises:
            InputError: If the disk has the smooth friction law, or ``until`` is not an amplitude.
        """
        from tippedisk_verify.cycles.branch_cycles import cycles_found
        from tippedisk_verify.proofs.kernel.certificates.family import ProvedArc
        from tippedisk_verify.proofs.search.family_search import prove_family

        self.disk.refuse_unless_linear("the family of limit cycles is proved as one curve")
        wanted = None if until is None else _amplitude(until)
        count = 0
        with show_progress(
            int(_BAR_STEPS_PER_RAD * (wanted or _MAX_AMPLITUDE)), progress
        ) as advance:

            def watch(proved: ProvedArc | ArcStatus, interval: AmplitudeInterval) -> None:
                nonlocal count
                if isinstance(proved, ProvedArc):
                    count += 1
                    advance(
                        f"arcs: {count}",
                        int(_BAR_STEPS_PER_RAD * interval.high)
                        - int(_BAR_STEPS_PER_RAD * interval.low),
                    )

            def omega_h_at(digits: int) -> Fraction | None:
                try:
                    return self.disk.heteroclinic(digits=digits).omega_h.value
                except (NoConnectionError, AccuracyError):
                    return None

            def cycles_at(speeds: list[Fraction] | None) -> list[Any]:
                try:
                    branch = self.disk.branch(speeds, progress=False)
                except NoSuchCycleError as fault:
                    raise AccuracyError(str(fault)) from None
                if branch.missing:
                    raise AccuracyError(branch.missing[0].status)
                numbers = [
                    (c.gamma_bar_0, c.v_0, c.omega, c.period / 2)
                    for c in cycles_found(branch.cycles)
                ]
                return [tuple(number.value for number in cycle) for cycle in numbers]

            advance("arcs", 0)
            return prove_family(
                self.disk,
                omega_h_at,
                cycles_at,
                until=wanted,
                pool=workers,
                on_interval=watch,
                on_stage=lambda name: advance(name, 0),
            )


def _amplitude(value: object) -> Fraction:
    """Read the amplitude gamma_bar_0 [rad] at which a family is to end, as an exact number.

    Raises:
        InputError: If the value is not a decimal between 0 and 3.1415.
    """
    number = exact(value)
    if number.pi_multiple or not 0 < number.rational < _MAX_AMPLITUDE:
        raise InputError(
            f"an amplitude is a decimal between 0 and {float(_MAX_AMPLITUDE)} "
            f"rad, not {short_text(value)}"
        )
    return number.rational
