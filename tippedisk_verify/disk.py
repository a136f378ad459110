"""The front door: a `Disk`, and what can be asked of it.

A disk is its parameters with the friction law. Each method hands it to the package where the mathematics is, with the
default engine unless another one is given. Results remember the disk that they are about. The command line calls these
methods and prints what they return.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tippedisk_verify.errors import AccuracyError, InputError, UnknownKeywordError
from tippedisk_verify.model.decimals import decimal_magnitude
from tippedisk_verify.model.equations import checked_speed, checked_speeds, field, jacobian
from tippedisk_verify.model.exact import fraction, shown
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Friction, Parameters
from tippedisk_verify.progress import progress_of, watched

if TYPE_CHECKING:
    from tippedisk_verify.atlas.branch import Branch
    from tippedisk_verify.certify import Certifier
    from tippedisk_verify.connection.heteroclinic import Heteroclinic
    from tippedisk_verify.cycles.folds import Folds, RotationFold
    from tippedisk_verify.cycles.limit_cycle import LimitCycle, RotatingCycle
    from tippedisk_verify.cycles.spectral import BalancedCycle
    from tippedisk_verify.flow.contract import Engine, Event
    from tippedisk_verify.model.arrays import Array
    from tippedisk_verify.motion.basin_boundary import BasinBoundary
    from tippedisk_verify.motion.basins import Basins
    from tippedisk_verify.motion.scenes import Panel
    from tippedisk_verify.motion.solution import Solution
    from tippedisk_verify.theory.equilibria import Equilibrium, EquilibriumName
    from tippedisk_verify.theory.hopf import HopfPoint
    from tippedisk_verify.theory.slow_manifold import SlowManifold

__all__ = ["Disk"]


class Disk(Parameters):
    """A tippedisk under a friction law, and what can be asked of it.

    ``Disk("table1")`` is a named set (table1, calibrated, geometry) or a TOML file, ``Disk("table1", mu="0.4")`` the
    same with another mu, named ``custom``, and ``Disk(r="0.045", ...)`` one of your own: eight numbers
    r, e, m, A, B, g, mu, epsilon [SI], as decimal strings or other exact numbers. C, which no equation needs, may be
    given as well or left out (None). ``friction`` is linear or smooth. A disk is a `Parameters` and goes wherever those
    go. Raises InputError as they do.

    Speeds are in rad/s, angles in rad, times in s. ``engine`` is the Taylor integrator unless another one is given, and
    ``digits`` are the significant digits wanted of each main result: up to 12 in double, more in wider arithmetic.
    """

    __slots__ = ()

    def __init__(self, named: str | None = None, *, friction: Friction | None = None, **values: Any) -> None:
        if named is not None:
            if not isinstance(named, str):
                raise InputError(f"a disk is named by a text, not by {shown(named)}")
            known = Parameters.named(named)
            name = "custom" if values else known.name  # what is known of the named disk is not true of a changed one
            kept = {item.name: getattr(known, item.name) for item in fields(known) if item.init}
            values = kept | {"name": name} | values
        if friction is not None:
            values["friction"] = friction
        names = [item.name for item in fields(Parameters) if item.init]
        missing = [name for name in names if name not in (*values, "C", "name", "friction")]
        unknown = [name for name in values if name not in names]
        if missing or unknown:
            told = [f"a disk has no '{name[:40]}'" for name in unknown] + [f"a disk needs {name}" for name in missing]
            raise InputError(told)
        super().__init__(**values)

    @classmethod
    def read(cls, path: str | Path, friction: Friction = "linear") -> Disk:
        """The disk in a TOML file of decimals. Raises InputError as `Parameters.from_toml` does."""
        known = Parameters.from_toml(Path(path))
        values = {item.name: getattr(known, item.name) for item in fields(known) if item.init}
        return cls(**values | {"friction": friction})

    # ---------------------------------------------------------------------------------------- closed forms
    @property
    def omega_crit(self) -> Measured:
        """The critical speed Omega_crit [rad/s], where inverted spinning loses stability (Eq. approx_omega_crit)."""
        from tippedisk_verify.theory.hopf import omega_crit

        return omega_crit(self)

    def speed(
        self,
        omega: object = None,
        *,
        below_crit: object = None,
        above_het: object = None,
        below_het: object = None,
        digits: int = 12,
    ) -> Fraction:
        """A speed [rad/s] as an exact rational: ``omega``, or that far from Omega_crit or Omega_h.

        The distance from Omega_h has ``digits`` significant digits, so ``disk.speed(above_het="1e-20")`` goes wherever
        a speed goes. Raises InputError unless one of the four is given, and as `heteroclinic` does.
        """
        from tippedisk_verify.theory.hopf import speed_below_crit

        _one_of(omega=omega, below_crit=below_crit, above_het=above_het, below_het=below_het)
        if above_het is None and below_het is None:
            return checked_speed(omega) if below_crit is None else speed_below_crit(self, below_crit, digits)
        distance = fraction(below_het if above_het is None else above_het)
        if distance <= 0:
            raise InputError(f"a distance from Omega_h is a positive decimal, not {shown(distance)}")
        omega_h = self.heteroclinic(digits=digits + 2 + max(0, -decimal_magnitude(distance))).omega_h.value
        return omega_h - distance if above_het is None else omega_h + distance

    def equilibrium(self, name: EquilibriumName, omega: object, *, digits: int = 15) -> Equilibrium:
        """``inverted`` or ``noninverted`` spinning: state, eigenvalues [1/s], stability."""
        from tippedisk_verify.theory.equilibria import equilibrium, kind_changes

        return replace(equilibrium(self, omega, name, digits), kind_changes=kind_changes(self, name, digits))

    def hopf(self, *, digits: int = 12) -> HopfPoint:
        """The Hopf point of inverted spinning with its normal form. Raises InputError under the smooth law."""
        from tippedisk_verify.theory.hopf import hopf_point

        return hopf_point(self, digits)

    def slow_manifold(
        self, order: int, omega: object = None, *, at: tuple[object, object] = ("1.2", "0.3"), digits: int = 12
    ) -> SlowManifold:
        """The orders h_0 ... h_N of the slow manifold at a point (beta, gamma), and how well the truncated series does.

        The speed is Omega_crit - 0.5 if left out. Raises InputError under the smooth law.
        """
        from tippedisk_verify.theory.slow_manifold import analyse_slow_manifold

        speed = self.speed(below_crit="0.5", digits=digits) if omega is None else omega
        return analyse_slow_manifold(self, speed, order, digits, at=at)

    # ---------------------------------------------------------------------------------------- motion
    def integrate(
        self,
        omega: object,
        state: Sequence[object],
        time: object,
        *,
        t_eval: Any = None,
        digits: int = 12,
        events: Event | str | Sequence[Event | str] = (),
        variations: str | Sequence[str] = (),
        shifted: bool = False,
        max_steps: int = 100_000,
        engine: Engine | None = None,
        progress: bool | None = None,
        **unknown: object,
    ) -> Solution:
        """The motion from ``state`` (beta, gamma, v) for a ``time`` [s], or from t0 to t1 of a pair; backward if less.

        ``t_eval`` are where the solution is wanted, strictly monotonic and within that; 201 even ones if left out.
        ``events`` are Events (these end the run unless made with ``terminal=False``), or by their names "section"
        (beta = pi/2), "turn" (v = 0) and "surface" (the sliding velocity gamma_y is zero), whose crossings are
        recorded. ``variations`` of "state" and "omega" add the derivatives of the end by them. Texts such as
        "pi/2 + 0.4" are exact. Angles are beta_bar and gamma_bar, from pi/2, if ``shifted``.
        A run takes at most ``max_steps`` steps, some 2800 s of motion if left out; one that ends early does not raise,
        and its ``status`` says why. Long ones show progress, unless ``progress`` is False. Raises InputError for what
        makes no sense.

        >>> sol = Disk("table1").integrate("30.4", ("pi/2", 2, 0), (0, 10), t_eval=[1, 2], events="section")
        >>> sol.y.shape, sol.end.time, len(sol.events)
        ((3, 2), 10.0, 21)
        """
        from tippedisk_verify.motion.solution import integrated

        if unknown:
            raise UnknownKeywordError(
                f"integrate has no {', '.join(unknown)}: `digits` says how exact the motion is to be, `engine` what "
                "computes it, such as Baseline('DOP853'), and the solution itself, sol(t), is its dense output"
            )
        how = (self._engine(engine), variations, shifted, max_steps, progress)
        return integrated(self, omega, state, time, t_eval, digits, events, *how)

    def rhs(self, omega: object) -> Callable[[object, Any], Array]:
        """The equations of motion as ``f(t, y)`` in doubles, for `solve_ivp` and its like (Eq. 3DOF).

        ``y`` is a state (3,) or states (3, k). Angles in rad, v in rad/s. Raises InputError for a speed <= 0.

        >>> [f("30.4")(0, [1.5, 1.6, 0.0]).shape for f in (Disk("table1").rhs, Disk("table1").jacobian)]
        [(3,), (3, 3)]
        """
        from tippedisk_verify.model.arrays import OnArrays

        return OnArrays(field, self, omega)

    def jacobian(self, omega: object) -> Callable[[object, Any], Array]:
        """The derivative of `rhs` by the state, ``jac(t, y)``: (3, 3), or (3, 3, k) for states (3, k)."""
        from tippedisk_verify.model.arrays import OnArrays

        return OnArrays(jacobian, self, omega)

    def basins(self, omega: object, *, count: int = 100_000, progress: bool | None = None, **options: Any) -> Basins:
        """What each of ``count`` initial states ends on. Options as those of `basins`, progress as that of `branch`."""
        from tippedisk_verify.motion.basins import basins

        with progress_of(count if isinstance(count, int) else 0, progress) as advance:
            return basins(self, omega, count=count, advance=advance, **options)

    def basin_boundary(self, omega: object, *, engine: Engine | None = None) -> BasinBoundary:
        """What separates starts that keep standing from those that lie flat. Raises as `rotating_cycle` does."""
        from tippedisk_verify.motion.basin_boundary import BasinBoundary

        return BasinBoundary(self, omega, self._engine(engine))

    def scene(self, name: str, *, omega_h: object = None, engine: Engine | None = None) -> Panel:
        """One of the panels a to f of the paper's figures 3D and proj_3D; ``omega_h`` [rad/s] saves finding it."""
        from tippedisk_verify.motion.scenes import compute, scene_named

        scene, engine = scene_named(name), self._engine(engine)
        if omega_h is not None:
            omega_h = Measured(checked_speed(omega_h), getattr(omega_h, "uncertainty", Fraction(0)))
        elif scene.base == "Omega_h":
            omega_h = self.heteroclinic(engine=engine).omega_h
        return compute(scene, self, engine, omega_h=omega_h)

    # ---------------------------------------------------------------------------------------- limit cycles
    def limit_cycle(
        self,
        omega: object = None,
        *,
        below_crit: object = None,
        above_het: object = None,
        stable: bool | None = None,
        digits: int = 12,
        engine: Engine | None = None,
    ) -> LimitCycle:
        """The limit cycle about inverted spinning at a speed given as to `speed`.

        Where a speed has several it is the stable one, or the one that ``stable`` asks for. Raises InputError unless
        one of the three is given, NoSuchCycleError where there is no such cycle, AccuracyError without the digits.
        """
        from tippedisk_verify.atlas.cycles_at_speed import cycle_above, cycle_at

        _one_of(omega=omega, below_crit=below_crit, above_het=above_het)
        if above_het is not None:
            if stable is not None:
                raise InputError("above_het leads to the cycles next to Omega_h: choose with stable at a speed omega")
            return cycle_above(self, above_het, self._engine(engine), digits=digits)
        speed = self.speed(omega, below_crit=below_crit, digits=digits)
        return cycle_at(self, speed, self._engine(engine), digits=digits, stable=stable)

    def harmonic_balance(self, omega: object, *, harmonics: int | None = None, digits: int = 12) -> BalancedCycle:
        """The limit cycle at ``omega`` by harmonic balance of the full equations, without an integrator.

        ``harmonics`` is the number of odd harmonics, chosen for the digits if left out. Raises as `limit_cycle` does,
        and InputError under the smooth law.
        """
        from tippedisk_verify.cycles.spectral import balanced_cycle

        return balanced_cycle(self, omega, digits=digits, harmonics=harmonics)

    def folds(self, *, digits: int = 12, engine: Engine | None = None) -> Folds:
        """Where two limit cycles about inverted spinning meet and end, from the Hopf point on; of many disks none.

        Raises AccuracyError where the family cannot be followed, or the digits are not reached.
        """
        from tippedisk_verify.atlas.locator import locator
        from tippedisk_verify.cycles.folds import libration_folds

        found = locator(self, self._engine(engine))
        if found.lost:
            raise AccuracyError(found.lost)
        return libration_folds(self, found.engine, digits=digits, family=found.family)

    def rotating_cycle(
        self,
        omega: object = None,
        *,
        below_crit: object = None,
        below_het: object = None,
        stable: bool = True,
        digits: int = 12,
        engine: Engine | None = None,
    ) -> RotatingCycle:
        """The rotating limit cycle, on which gamma grows by 2 pi a period, at a speed given as to `speed`.

        Stable ones lie between the family's fold and Omega_h, unstable ones (``stable=False``) from the fold upward.
        Raises as `limit_cycle` does.
        """
        from tippedisk_verify.atlas.cycles_at_speed import rotating_below, rotating_cycle

        _one_of(omega=omega, below_crit=below_crit, below_het=below_het)
        if below_het is None:
            speed = self.speed(omega, below_crit=below_crit, digits=digits)
            return rotating_cycle(self, speed, self._engine(engine), stable=stable, digits=digits)
        if not stable:
            raise InputError("below_het leads to stable rotating cycles: give the unstable one's speed with omega")
        return rotating_below(self, below_het, self._engine(engine), digits=digits)

    def rotating_branch(
        self, omegas: Sequence[object] | None = None, *, engine: Engine | None = None, progress: bool | None = None
    ) -> list[RotatingCycle]:
        """The family of rotating cycles: at each of these speeds the stable one, if any, and then the unstable one.

        Without speeds an overview, from just below Omega_h through the fold to half a rad/s above Omega_crit. Speeds
        and progress as those of `branch`.
        """
        from tippedisk_verify.atlas.branch import DEFAULT_ROTATIONS, rotating_branch

        speeds = omegas if omegas is None else checked_speeds(omegas)
        cycles = rotating_branch(self, self._engine(engine), speeds)
        return list(watched(cycles, "limit cycles", 2 * len(speeds or ()) or DEFAULT_ROTATIONS, progress))

    def rotation_fold(self, *, digits: int = 12, engine: Engine | None = None) -> RotationFold:
        """Where the stable and the unstable rotating cycles meet and end. Raises as `rotating_cycle` does."""
        from tippedisk_verify.atlas.locator import locator
        from tippedisk_verify.cycles.folds import rotation_fold

        return rotation_fold(locator(self, self._engine(engine)).rotations, digits=digits)

    def branch(
        self,
        omegas: Sequence[object] | None = None,
        *,
        paper_sets: bool = False,
        engine: Engine | None = None,
        progress: bool | None = None,
    ) -> Branch:
        """The family of limit cycles at these speeds, or an even overview of it, as arrays with half-widths.

        ``paper_sets`` are the paper's speeds A^in and A^de. A speed with several cycles gives all of them; a text or a
        number by itself is one speed. A hundred speeds and more are rounded to doubles, and the linear law's cycles
        are computed together, in lanes of the Taylor engine. What takes longer than two seconds shows its progress on
        standard error, unless ``progress`` is False. Raises NoSuchCycleError where there is no cycle.
        """
        from tippedisk_verify.atlas.branch import DEFAULT_COUNT, PAPER_COUNT, Branch, family

        speeds = omegas if omegas is None else checked_speeds(omegas)
        cycles = family(self, self._engine(engine), paper_sets=paper_sets, omegas=speeds)
        total = PAPER_COUNT if paper_sets else len(speeds or ()) or DEFAULT_COUNT
        return Branch.of(watched(cycles, "limit cycles", total, progress))

    def heteroclinic(
        self, *, digits: int = 12, method: str = "manifolds", engine: Engine | None = None
    ) -> Heteroclinic:
        """Omega_h, where the saddles are connected. Raises NoConnectionError where there is no connection."""
        from tippedisk_verify.connection.heteroclinic import heteroclinic

        return heteroclinic(self, self._engine(engine), digits=digits, method=method)

    @property
    def certify(self) -> Certifier:
        """What can be proved of this disk by ball arithmetic, such as ``disk.certify.limit_cycle("30.4")``."""
        from tippedisk_verify.certify import Certifier

        return Certifier(self)

    @staticmethod
    def _engine(engine: Engine | None) -> Engine:
        """The engine given, or the default one: the one place where a disk's methods choose it."""
        if engine is not None:
            if not hasattr(engine, "measures_error") or isinstance(engine, type):
                raise InputError(f"an engine is Taylor() or Baseline(), not {shown(engine)}")
            return engine
        from tippedisk_verify.flow import default_engine

        return default_engine()


def _one_of(**ways: object) -> None:
    """Raise InputError unless the speed is given in one of these ways."""
    if (number := sum(way is not None for way in ways.values())) != 1:
        *first, last = ways
        several = ", not with several" if number else ""
        raise InputError(f"give the speed with one of {', '.join(first)} and {last}{several}")
