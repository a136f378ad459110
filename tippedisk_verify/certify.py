"""What can be proved of a disk: the ordinary methods find where to look, and `proofs` encloses what is there.

`proofs` knows the equations only; here it meets the methods whose numbers it starts from. A proof that fails is a
result too: its ``status`` says where it stopped.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING, Any, cast

from tippedisk_verify.errors import AccuracyError, InputError, NoConnectionError, NoSuchCycleError
from tippedisk_verify.model.exact import exact, shown
from tippedisk_verify.model.surroundings import undisturbed_methods
from tippedisk_verify.progress import progress_of

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from tippedisk_verify.cycles.folds import Fold
    from tippedisk_verify.disk import Disk
    from tippedisk_verify.proofs.closed_forms import ProvedEquilibrium, ProvedHopf, ProvedStability
    from tippedisk_verify.proofs.kernel.claims.family import Piece, Status
    from tippedisk_verify.proofs.search.branch import BranchProof
    from tippedisk_verify.proofs.search.connection_end import ProvedEnd
    from tippedisk_verify.proofs.search.cycle import OrbitProof
    from tippedisk_verify.proofs.search.family import Interval
    from tippedisk_verify.proofs.search.fold import FoldProof
    from tippedisk_verify.proofs.search.heteroclinic import ProvedConnection
    from tippedisk_verify.theory.equilibria import EquilibriumName

__all__ = ["Certifier"]

_UNITS = 1000  # of the bar, for each rad
_FURTHEST = Fraction("3.1415")  # rad
_NEAREST = Fraction(1, 10**7)  # rad/s from Omega_h; at 1e-5 a proof takes a minute, closer more with each decimal
Workers = Callable[[bool], AbstractContextManager["Executor | None"]]


@undisturbed_methods
@dataclass(frozen=True)
class Certifier:
    """The proofs of one disk: numbers as enclosures, each with the statement that is proved.

    A speed is in rad/s. ``digits`` are the significant digits of each main result. Results have ``proved``,
    ``statement`` and ``to_dict()``, and those of a search ``certificate()``, a text that `check` replays.
    """

    disk: Disk

    # ---------------------------------------------------------------------------------------- closed forms
    def equilibrium(self, name: EquilibriumName, omega: object, *, digits: int = 12) -> ProvedEquilibrium:
        """Eigenvalues and stability of ``inverted`` or ``noninverted`` spinning, under both friction laws."""
        from tippedisk_verify.proofs.closed_forms import proved_equilibrium

        return proved_equilibrium(self.disk, omega, name, digits)

    def stability(self, *, digits: int = 12) -> ProvedStability:
        """Linear stability at every speed, and Omega_crit; under both friction laws."""
        from tippedisk_verify.proofs.closed_forms import proved_stability

        return proved_stability(self.disk, digits)

    def hopf(self, *, digits: int = 12) -> ProvedHopf:
        """The Hopf point, and on which side the limit cycles are. Raises InputError under the smooth law."""
        from tippedisk_verify.proofs.closed_forms import proved_hopf

        self.disk.refuse_smooth("the Hopf point's normal form is")
        return proved_hopf(self.disk, digits)

    # ---------------------------------------------------------------------------------------- single cycles
    def limit_cycle(
        self,
        omega: object,
        *,
        rotating: bool = False,
        stable: bool | None = None,
        guess: tuple[object, object] | None = None,
        digits: int = 12,
    ) -> OrbitProof:
        """One limit cycle: existence, uniqueness nearby, its numbers, its stability.

        The search starts from the cycle that `Disk` finds, or from the ``guess`` (gamma_bar_0, v_0), of a rotating
        cycle (beta_bar_top, v_top). Raises InputError for a speed next to Omega_h, where `beside_omega_h` proves them.
        """
        from tippedisk_verify.proofs.search.cycle import HALF, TURN, OrbitProof, Status, prove_cycle

        section, speed = TURN if rotating else HALF, self.disk.speed(omega)
        try:
            start = guess or self._start(speed, rotating, stable)
        except NoSuchCycleError as fault:
            return OrbitProof(section, Status.NO_GUESS, str(fault), self.disk, speed, 0)
        return prove_cycle(self.disk, speed, start, digits=digits, section=section)

    def _start(self, speed: Fraction, rotating: bool, stable: bool | None) -> tuple[object, object]:
        """Both coordinates of the cycle on its section. Raises InputError for a speed next to Omega_h."""
        from tippedisk_verify.atlas.locator import locator
        from tippedisk_verify.flow import default_engine

        with suppress(NoConnectionError):
            if (away := abs(speed - locator(self.disk, default_engine()).omega_h)) < _NEAREST:
                raise InputError(
                    f"{float(speed):.12g} rad/s lies {float(away):.2g} from Omega_h, and single cycles are proved from "
                    f"{float(_NEAREST):g} on: `certify heteroclinic --cycles D` proves all up to a distance D above it"
                )
        if rotating:
            rotation = self.disk.rotating_cycle(speed, stable=stable is not False)
            return rotation.beta_bar_top.value, rotation.v_top.value
        cycle = self.disk.limit_cycle(speed, stable=stable)
        return cycle.gamma_bar_0.value, cycle.v_0.value

    def fold(self, number: int | None = None, *, rotating: bool = False, digits: int = 12) -> FoldProof:
        """A fold, where two cycles of the family meet and end; which one, from 1 on, if the family has several.

        Raises InputError for a fold that the family does not have, or if it has several and none is chosen.
        """
        from tippedisk_verify.proofs.kernel.claims.fold import names
        from tippedisk_verify.proofs.search.fold import HALF, TURN, FoldProof, prove_fold

        self.disk.refuse_smooth("folds of limit cycles are proved")
        section, folds = TURN if rotating else HALF, cast("tuple[Fold, ...]", ())
        fault = "no fold of this disk's limit cycles about inverted spinning was found"
        try:
            finer = digits + 10
            folds = (self.disk.rotation_fold(digits=finer),) if rotating else self.disk.folds(digits=finer)
        except (NoSuchCycleError, NoConnectionError, AccuracyError) as error:
            fault = str(error)
        if not folds:
            return FoldProof(section, fault, self.disk, 0)
        speeds = ", ".join(f"{fold.omega:.10g}" for fold in folds)
        if number is None and len(folds) > 1:
            raise InputError(f"this family has {len(folds)} folds, at {speeds} rad/s: choose one by its number")
        if not 1 <= (number := number or 1) <= len(folds):
            raise InputError(
                f"there is no fold {number}: this family has {len(folds)} fold{'s' if len(folds) > 1 else ''}"
            )
        omega, first, second, _ = names(section)
        near = [getattr(folds[number - 1], name).value for name in (first, second, omega)]
        return prove_fold(self.disk, near, digits=digits, section=section)

    # ---------------------------------------------------------------------------------------- Omega_h and the family
    def heteroclinic(self, near: object = None, *, digits: int = 12, progress: bool | None = None) -> ProvedConnection:
        """Omega_h in an interval no longer than 10^-digits, and that it is the only one there.

        The proof is about the speed ``near`` [rad/s], or about the Omega_h that `Disk` finds. Raises InputError for
        more digits than a proof is offered to.
        """
        from tippedisk_verify.proofs.search.heteroclinic import MOST_DIGITS, ProvedConnection, Status, prove_connection

        if digits > MOST_DIGITS:
            raise InputError(f"a proof of Omega_h is offered to {MOST_DIGITS} digits, not {digits}")
        with progress_of(2, progress) as advance:
            try:
                advance("an approximation", 0)
                guess = self.disk.heteroclinic(digits=digits + 5).omega_h.value if near is None else near
                advance("proof", 1)
                return prove_connection(self.disk, guess, digits)
            except NoConnectionError as fault:
                return ProvedConnection(Status.NO_SADDLE, where=str(fault))

    def beside_omega_h(
        self, distance: object, near: object = None, *, digits: int = 12, progress: bool | None = None
    ) -> ProvedEnd:
        """The limit cycle of every speed up to a ``distance`` [rad/s] above Omega_h, which `heteroclinic` proves first.

        Raises as that does, and InputError under the smooth law.
        """
        from tippedisk_verify.proofs.search.connection_end import checked_distance, prove_end

        checked_distance(distance)
        self.disk.refuse_smooth("limit cycles next to the connection are proved")
        connection, shares = self.heteroclinic(near, digits=digits, progress=progress), [0]
        with progress_of(100, progress) as advance:

            def watch(share: float) -> None:
                shares.append(int(100 * share))
                advance("limit cycles", shares[-1] - shares[-2])

            return prove_end(connection, distance, watch=watch)

    def branch(
        self,
        until: object = None,
        *,
        workers: Workers = lambda several: nullcontext(None),
        progress: bool | None = None,
    ) -> BranchProof:
        """The family of limit cycles from the Hopf point to the heteroclinic cycle: one curve, stable, Omega falls.

        Only up to the gamma_bar_0 ``until`` [rad], without the end at Omega_h, if that is given. ``workers`` makes an
        executor, for several jobs or for one at a time. Raises InputError under the smooth law.
        """
        from tippedisk_verify.proofs.kernel.claims.family import Piece
        from tippedisk_verify.proofs.search.family import prove_family

        self.disk.refuse_smooth("the family of limit cycles is proved as one curve")
        wanted = None if until is None else _amplitude(until)
        count = 0
        with progress_of(int(_UNITS * (wanted or _FURTHEST)), progress) as advance:

            def watch(proved: Piece | Status, interval: Interval) -> None:
                nonlocal count
                if isinstance(proved, Piece):
                    count += 1
                    advance(f"arcs: {count}", int(_UNITS * interval.high) - int(_UNITS * interval.low))

            def connected_at(digits: int) -> Fraction | None:
                try:
                    return self.disk.heteroclinic(digits=digits).omega_h.value
                except (NoConnectionError, AccuracyError):
                    return None

            def cycles_at(speeds: list[Fraction] | None) -> list[Any]:
                try:
                    cycles = self.disk.branch(speeds, progress=False).cycles
                except NoSuchCycleError as fault:
                    raise AccuracyError(str(fault)) from None
                return [(c.gamma_bar_0.value, c.v_0.value, c.omega.value, c.period.value / 2) for c in cycles]

            advance("arcs", 0)
            proved = partial(prove_family, self.disk, connected_at, cycles_at, until=wanted, pool=workers, watch=watch)
            return proved(stage=lambda name: advance(name, 0))


def _amplitude(value: object) -> Fraction:
    """How far a family is followed, as gamma_bar_0 [rad]. Raises InputError for what is none."""
    number = exact(value)
    if number.pi_multiple or not 0 < number.rational < _FURTHEST:
        raise InputError(f"an amplitude is a decimal between 0 and {float(_FURTHEST)} rad, not {shown(value)}")
    return number.rational
