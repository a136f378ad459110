"""The front door: the class `Disk` and its methods.

A disk is its parameters with the friction law. Each method passes it to the package that does the
mathematics, with the default engine unless another one is given. Results keep a reference to their
disk. The command line calls these methods and prints what they return.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from fractions import Fraction
from os import PathLike
from typing import TYPE_CHECKING, Any, Literal, overload

from tippedisk_verify.errors import AccuracyError, InputError, UnknownKeywordError
from tippedisk_verify.model.equations import (
    checked_speed,
    checked_speeds,
    jacobian,
    require_one_speed,
    vector_field,
)
from tippedisk_verify.model.friction import Friction, FrictionLaw
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.decimals import decimal_magnitude
from tippedisk_verify.numbers.exact import fraction, short_text
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.support.progress import show_progress, show_share, with_progress

if TYPE_CHECKING:
    from tippedisk_verify.certify import Certifier
    from tippedisk_verify.cycles.branch import Branch
    from tippedisk_verify.cycles.collocation.collocation_cycles import CollocationCycle
    from tippedisk_verify.cycles.families.folds import Folds, RotatingFold
    from tippedisk_verify.cycles.limit_cycle import LimitCycle, MissingCycle, RotatingCycle
    from tippedisk_verify.cycles.sensitivity import Sensitivity
    from tippedisk_verify.flow.contract import Engine, Event
    from tippedisk_verify.motion.basin_boundary import BasinBoundary
    from tippedisk_verify.motion.basins import Basins
    from tippedisk_verify.motion.scenes import ComputedScene
    from tippedisk_verify.motion.solution import Solution
    from tippedisk_verify.numbers.arrays import Array
    from tippedisk_verify.omega_h.connecting_orbit import Heteroclinic
    from tippedisk_verify.omega_h.distance_study import NearHeteroclinic
    from tippedisk_verify.theory.equilibria import Equilibrium, EquilibriumName
    from tippedisk_verify.theory.hopf import HopfPoint
    from tippedisk_verify.theory.slow_manifold import SlowManifold

__all__ = ["Disk"]


class Disk(Parameters):
    """A tippedisk under a friction law, with all that the package computes for it.

    ``Disk("table1")`` is a named set (table1, calibrated, geometry) or a TOML file.
    ``Disk("table1", mu="0.4")`` is the same disk with another mu, named ``custom``.
    ``Disk(r="0.045", ...)`` is a disk of your own: eight numbers r, e, m, A, B, g, mu, epsilon
    [SI], as decimal strings or other exact numbers. C enters no equation; it may be given or left
    out (None). ``friction`` is linear, smooth or a law of your own. A disk is a `Parameters` and
    can be used wherever those can.

    In all methods, speeds are in rad/s, angles in rad and times in s. ``engine`` is the integrator,
    the Taylor integrator if left out. ``digits`` is the number of significant digits of each main
    result: up to 12 in double precision, more in wider arithmetic.

    Args:
        named: The name of a set, or the path of a TOML file.
        friction: ``linear``, ``smooth`` or a `FrictionLaw`; linear if left out.
        values: Parameters by name, which replace those of the named set.

    Raises:
        InputError: If a parameter is missing or unknown, or `Parameters` refuses the values.
    """

    __slots__ = ()

    def __init__(
        self,
        named: str | PathLike[str] | None = None,
        *,
        friction: Friction | FrictionLaw | None = None,
        **values: Any,
    ) -> None:
        if named is not None:
            if not isinstance(named, str | PathLike):
                raise InputError(f"a disk is named by a text, not by {short_text(named)}")
            known = Parameters.named(named)
            name = "custom" if values else known.name  # a changed disk is no longer the named one
            values = known._constructor_arguments() | {"name": name} | values
        if friction is not None:
            values["friction"] = friction
        names = [item.name for item in fields(Parameters) if item.init]
        missing = [name for name in names if name not in (*values, "C", "name", "friction")]
        unknown = [name for name in values if name not in names]
        if missing or unknown:
            faults = [f"a disk has no '{name[:40]}'" for name in unknown]
            raise InputError(faults + [f"a disk needs {name}" for name in missing])
        super().__init__(**values)

    @classmethod
    def read(cls, path: str | PathLike[str], friction: Friction | FrictionLaw = "linear") -> Disk:
        """Return the disk that a TOML file of decimals describes.

        Args:
            path: The file, with the keys that `Parameters.from_toml` describes.
            friction: ``linear``, ``smooth`` or a `FrictionLaw`.

        Raises:
            InputError: If the file or its values cannot be used.
        """
        return cls(**Parameters.from_toml(path)._constructor_arguments() | {"friction": friction})

    # --------------------------------------------------------------------------------- closed forms
    @property
    def omega_crit(self) -> Measured:
        """The critical speed Omega_crit [rad/s], where inverted spinning loses stability.

        Its source is Eq. approx_omega_crit.
        """
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
        """Return a speed [rad/s] as an exact rational, given directly or by a distance.

        Exactly one of the first four arguments is given. A distance from Omega_h is kept to
        ``digits`` significant digits, and one from Omega_crit to 35 more. So
        ``disk.speed(above_het="1e-20")`` can be used wherever a speed can. The result is a decimal.

        Args:
            omega: The speed itself [rad/s].
            below_crit: A distance below Omega_crit [rad/s].
            above_het: A distance above Omega_h [rad/s].
            below_het: A distance below Omega_h [rad/s].
            digits: Significant digits of the distance.

        Raises:
            InputError: If not exactly one of the four is given, or it cannot be used.
            NoConnectionError: If the disk has no Omega_h.
        """
        require_one_speed(
            omega=omega, below_crit=below_crit, above_het=above_het, below_het=below_het
        )
        if omega is not None:
            return checked_speed(omega)
        if below_crit is not None:
            return self._speed(omega, below_crit, digits).value
        distance = fraction(below_het if above_het is None else above_het)
        if distance <= 0:
            raise InputError(
                f"a distance from Omega_h is a positive decimal, not {short_text(distance)}"
            )
        omega_h = self.heteroclinic(
            digits=digits + 2 + max(0, -decimal_magnitude(distance))
        ).omega_h.value
        return omega_h - distance if above_het is None else omega_h + distance

    def equilibrium(self, name: EquilibriumName, omega: object, *, digits: int = 15) -> Equilibrium:
        """Return an equilibrium: its state, its eigenvalues [1/s] and its stability.

        Args:
            name: ``inverted`` or ``noninverted`` spinning.
            omega: The spinning speed [rad/s].
            digits: Significant digits of each eigenvalue.

        Raises:
            InputError: If an argument cannot be used.
        """
        from tippedisk_verify.theory.equilibria import equilibrium, kind_changes

        return replace(
            equilibrium(self, omega, name, digits), kind_changes=kind_changes(self, name, digits)
        )

    def hopf(self, *, digits: int = 12) -> HopfPoint:
        """Return the Hopf point of inverted spinning with its normal form.

        Args:
            digits: Significant digits of each main result.

        Raises:
            InputError: If the friction law has two analytic sides, as the smooth law has.
        """
        from tippedisk_verify.theory.hopf import hopf_point

        return hopf_point(self, digits)

    def slow_manifold(
        self,
        order: int,
        omega: object = None,
        *,
        at: tuple[object, object] = ("1.2", "0.3"),
        digits: int = 12,
    ) -> SlowManifold:
        """Return the orders h_0 ... h_N of the slow manifold at a point, and the series' accuracy.

        Args:
            order: N, the highest order.
            omega: The speed [rad/s]; if left out, Omega_crit - 0.5 as the decimal that `speed`
                returns.
            at: The point (beta, gamma) [rad].
            digits: Significant digits of each order.

        Raises:
            InputError: If the friction law is not the linear one, or an argument cannot be used.
        """
        from tippedisk_verify.theory.slow_manifold import analyse_slow_manifold

        speed = self.speed(below_crit="0.5", digits=digits) if omega is None else omega
        return analyse_slow_manifold(self, speed, order, digits, at=at)

    # --------------------------------------------------------------------------------------- motion
    def integrate(
        self,
        omega: object,
        state: Sequence[object],
        time: object,
        *,
        t_eval: Any = None,
        digits: int = 12,
        rtol: object = None,
        events: Event | str | Sequence[Event | str] = (),
        variations: str | Sequence[str] = (),
        shifted: bool = False,
        max_steps: int = 100_000,
        half_widths: bool = True,
        engine: Engine | None = None,
        progress: bool | None = None,
        **unknown: object,
    ) -> Solution:
        """Integrate the motion from an initial state, and return it with half-widths.

        A run that ends early does not raise: its ``status`` gives the reason. Texts such as
        "pi/2 + 0.4" are exact.

        Args:
            omega: The spinning speed [rad/s].
            state: The initial state (beta [rad], gamma [rad], v [rad/s]).
            time: The duration [s] from t = 0, or a pair (t0, t1); backward if negative or t1 < t0.
            t_eval: The times [s] at which the solution is wanted, strictly monotonic and within the
                run; 201 evenly spaced ones if left out.
            digits: Significant digits of the end state.
            rtol: The tolerance of a step in double precision, relative for components above 1 and
                absolute for smaller ones; the rounding of doubles if left out. The half-widths
                include the error that it causes.
            events: Events, which end the run unless made with ``terminal=False``. The names
                "section" (beta = pi/2), "turn" (v = 0) and "surface" (sliding velocity gamma_y = 0)
                record the crossings.
            variations: "state", "omega" and the names of parameters, such as "mu", add the
                derivatives of the end and of the states with respect to them (``by``).
            shifted: True if angles are beta_bar and gamma_bar, measured from pi/2.
            max_steps: The maximum number of steps; the default allows about 2800 s of motion.
            half_widths: If False, integrate once without measuring the error. This takes a fraction
                of the time, and all half-widths are infinite.
            engine: The integrator.
            progress: False hides the progress bar of a long run.

        Returns:
            The solution, with ``t`` (n,), ``y`` (3, n) and ``uncertainty`` (3, n).

        Raises:
            InputError: If an argument cannot be used.

        >>> disk = Disk("table1")
        >>> sol = disk.integrate("30.4", ("pi/2", 2, 0), (0, 10), t_eval=[1, 2], events="section")
        >>> sol.y.shape, sol.end.time, len(sol.events)
        ((3, 2), 10.0, 21)
        """
        from tippedisk_verify.motion.integration import MotionRequest

        if unknown:
            raise UnknownKeywordError(
                f"integrate has no {', '.join(unknown)}: `digits` or `rtol` sets the accuracy, `engine`"
                " the integrator, such as ScipyEngine('DOP853'), and the solution sol(t) the dense output"
            )
        motion = MotionRequest(
            self,
            omega,
            state,
            time,
            self._engine(engine),
            t_eval=t_eval,
            digits=digits,
            rtol=rtol,
            events=events,
            variations=variations,
            shifted=shifted,
            max_steps=max_steps,
            half_widths=half_widths,
        )
        if not motion.is_long:
            return motion.solution(motion.engine(motion.request))
        with show_progress(progress=progress) as advance:
            advance("motion", 0)
            return motion.solution(motion.engine(motion.request))

    def rhs(self, omega: object) -> Callable[[object, Any], Array]:
        """Return the equations of motion as ``f(t, y)`` in doubles, for `solve_ivp` and the like.

        The equation is Eq. 3DOF. ``y`` is a state (3,) or states (3, k), with angles in rad and v
        in rad/s.

        Args:
            omega: The spinning speed [rad/s].

        Raises:
            InputError: If ``omega`` is not a positive decimal.

        >>> disk = Disk("table1")
        >>> [f("30.4")(0, [1.5, 1.6, 0.0]).shape for f in (disk.rhs, disk.jacobian)]
        [(3,), (3, 3)]
        """
        from tippedisk_verify.model.array_function import ArrayFunction

        return ArrayFunction(vector_field, self, omega)

    def jacobian(self, omega: object) -> Callable[[object, Any], Array]:
        """Return the derivative of `rhs` with respect to the state as ``jac(t, y)``.

        Its values have shape (3, 3), or (3, 3, k) for states (3, k).

        Args:
            omega: The spinning speed [rad/s].

        Raises:
            InputError: If ``omega`` is not a positive decimal.
        """
        from tippedisk_verify.model.array_function import ArrayFunction

        return ArrayFunction(jacobian, self, omega)

    def basins(
        self, omega: object, *, count: int = 100_000, progress: bool | None = None, **options: Any
    ) -> Basins:
        """Integrate a random sample of initial states and return where each of them ends.

        Args:
            omega: The spinning speed [rad/s].
            count: The number of initial states.
            progress: False hides the progress bar.
            options: Further options of `tippedisk_verify.motion.basins.basins`.

        Returns:
            The initial states and the outcome of each, as arrays (rows, columns).

        Raises:
            InputError: If an argument cannot be used.
        """
        from tippedisk_verify.motion.basins import basins

        with show_progress(count if isinstance(count, int) else 0, progress) as advance:
            return basins(self, omega, count=count, advance=advance, **options)

    def basin_boundary(self, omega: object, *, engine: Engine | None = None) -> BasinBoundary:
        """Return the boundary between initial states from which the disk stays up and those from
        which it ends up flat.

        Args:
            omega: The spinning speed [rad/s].
            engine: The integrator.

        Raises:
            NoSuchCycleError: If no unstable rotating cycle was found, as in `rotating_cycle`.
        """
        from tippedisk_verify.motion.basin_boundary import BasinBoundary

        return BasinBoundary(self, omega, self._engine(engine))

    def scene(
        self, name: str, *, omega_h: object = None, engine: Engine | None = None
    ) -> ComputedScene:
        """Compute one of the panels a to f of the paper's figures 3D and proj_3D.

        Args:
            name: The panel's letter.
            omega_h: Omega_h [rad/s], if it has already been computed.
            engine: The integrator.

        Returns:
            The panel with both orbits and their attractors.

        Raises:
            InputError: If there is no such panel, or ``omega_h`` is not a speed.
        """
        from tippedisk_verify.motion.scenes import compute_scene, scene_named

        scene, engine = scene_named(name), self._engine(engine)
        if omega_h is not None:
            omega_h = Measured(checked_speed(omega_h), getattr(omega_h, "uncertainty", Fraction(0)))
        elif scene.base == "Omega_h":
            omega_h = self.heteroclinic(engine=engine).omega_h
        return compute_scene(scene, self, engine, omega_h=omega_h)

    # --------------------------------------------------------------------------------- limit cycles
    @overload
    def limit_cycle(
        self,
        omega: object = None,
        *,
        below_crit: object = None,
        above_het: object = None,
        below_het: None = None,
        rotating: Literal[False] = False,
        stable: bool | None = None,
        digits: int = 12,
        half_widths: bool = True,
        engine: Engine | None = None,
        progress: bool | None = None,
    ) -> LimitCycle: ...
    @overload
    def limit_cycle(
        self,
        omega: object = None,
        *,
        below_crit: object = None,
        below_het: object = None,
        rotating: Literal[True],
        stable: bool | None = None,
        digits: int = 12,
        half_widths: bool = True,
        engine: Engine | None = None,
        progress: bool | None = None,
    ) -> RotatingCycle: ...
    @overload
    def limit_cycle(
        self,
        *,
        below_het: str | Fraction,
        stable: bool | None = None,
        digits: int = 12,
        half_widths: bool = True,
        engine: Engine | None = None,
        progress: bool | None = None,
    ) -> RotatingCycle: ...
    def limit_cycle(
        self,
        omega: object = None,
        *,
        below_crit: object = None,
        above_het: object = None,
        below_het: object = None,
        rotating: bool = False,
        stable: bool | None = None,
        digits: int = 12,
        half_widths: bool = True,
        engine: Engine | None = None,
        progress: bool | None = None,
    ) -> LimitCycle | RotatingCycle:
        """Find the limit cycle about inverted spinning at a speed, or a rotating one.

        Exactly one of the first four arguments is given. Where a speed has several cycles, the
        result is the stable one unless ``stable`` is False.

        Args:
            omega: The speed [rad/s].
            below_crit: A distance below Omega_crit [rad/s].
            above_het: A distance above Omega_h [rad/s].
            below_het: A distance below Omega_h [rad/s], where the cycles are rotating.
            rotating: If True, find what `rotating_cycle` finds: gamma grows by 2 pi in each period.
            stable: Ask for the stable or the unstable cycle; not with ``above_het``.
            digits: Significant digits of each main result.
            half_widths: False computes once, in the first arithmetic that holds the digits, and
                does not measure the error. Next to Omega_h half-widths cost nothing, so they are
                always given.
            engine: The integrator.
            progress: False hides the progress bar of a long computation.

        Returns:
            The cycle: its section coordinates, period [s], multipliers and stability, with
                half-widths.

        Raises:
            InputError: If not exactly one speed is given, or it cannot be used.
            NoSuchCycleError: If there is no such cycle, or none was found.
            AccuracyError: If the digits were not reached.
        """
        from tippedisk_verify.cycles.cycle_at_speed import librating_cycle_at

        require_one_speed(
            omega=omega, below_crit=below_crit, above_het=above_het, below_het=below_het
        )
        if rotating or below_het is not None:
            if above_het is not None:
                raise InputError("rotating cycles lie below Omega_h: give below_het")
            return self.rotating_cycle(
                omega,
                below_crit=below_crit,
                below_het=below_het,
                stable=stable is not False,
                digits=digits,
                half_widths=half_widths,
                engine=engine,
                progress=progress,
            )
        if above_het is not None:
            if stable is not None:
                raise InputError(
                    "above_het leads to the cycles next to Omega_h: choose with "
                    "stable at a speed omega"
                )
            from tippedisk_verify.cycles.near_omega_h.cycle_at_distance import cycle_above_omega_h

            with show_share("limit cycle", progress):
                return cycle_above_omega_h(self, above_het, self._engine(engine), digits=digits)
        speed = self._speed(omega, below_crit, digits)
        with show_share("limit cycle", progress):
            cycle = librating_cycle_at(
                self,
                speed.value,
                self._engine(engine),
                digits=digits,
                stable=stable,
                half_widths=half_widths,
            )
        return replace(cycle, omega=speed)

    def harmonic_balance(
        self, omega: object, *, harmonics: int | None = None, digits: int = 12
    ) -> CollocationCycle:
        """Find the limit cycle by harmonic balance of the full equations, without an integrator.

        Args:
            omega: The speed [rad/s].
            harmonics: The number of odd harmonics; chosen for the digits if left out.
            digits: Significant digits of each main result.

        Returns:
            The cycle with its harmonics and half-widths.

        Raises:
            InputError: If the friction law has two analytic sides, as the smooth law has, or an
                argument cannot be used.
            NoSuchCycleError: If there is no such cycle, or none was found.
            AccuracyError: If the digits were not reached.
        """
        from tippedisk_verify.cycles.collocation.collocation_cycles import collocation_cycle

        return collocation_cycle(self, omega, digits=digits, harmonics=harmonics)

    def folds(self, *, digits: int = 12, engine: Engine | None = None) -> Folds:
        """Find the folds, where two limit cycles about inverted spinning meet and end.

        The folds are listed in their order along the family from the Hopf point. Many disks have no
        fold.

        Args:
            digits: Significant digits of each main result.
            engine: The integrator.

        Returns:
            The folds with their speeds [rad/s] and half-widths.

        Raises:
            AccuracyError: If the family cannot be followed, or the digits were not reached.
        """
        from tippedisk_verify.cycles.families.folds import librating_folds
        from tippedisk_verify.cycles.locator import cached_locator

        locator = cached_locator(self, self._engine(engine))
        if locator.family_failure:
            raise AccuracyError(locator.family_failure)
        return librating_folds(self, locator.engine, digits=digits, family=locator.librating_family)

    def rotating_cycle(
        self,
        omega: object = None,
        *,
        below_crit: object = None,
        below_het: object = None,
        stable: bool = True,
        digits: int = 12,
        half_widths: bool = True,
        engine: Engine | None = None,
        progress: bool | None = None,
    ) -> RotatingCycle:
        """Find the rotating limit cycle at a speed, on which gamma grows by 2 pi in each period.

        Exactly one of the first three arguments is given. Stable cycles lie between the family's
        fold and Omega_h; unstable ones lie above the fold.

        Args:
            omega: The speed [rad/s].
            below_crit: A distance below Omega_crit [rad/s].
            below_het: A distance below Omega_h [rad/s], for stable cycles only.
            stable: Ask for the stable or the unstable cycle.
            digits: Significant digits of each main result.
            half_widths: False computes once, in the first arithmetic that holds the digits, and
                does not measure the error. Next to Omega_h half-widths cost nothing, so they are
                always given.
            engine: The integrator.
            progress: False hides the progress bar of a long computation.

        Returns:
            The cycle: its section coordinates, period [s], multipliers and stability, with
                half-widths.

        Raises:
            InputError: If not exactly one speed is given, or it cannot be used.
            NoSuchCycleError: If there is no such cycle, or none was found.
            AccuracyError: If the digits were not reached.
        """
        from tippedisk_verify.cycles.cycle_at_speed import rotating_cycle_at
        from tippedisk_verify.cycles.near_omega_h.cycle_at_distance import (
            rotating_cycle_below_omega_h,
        )

        require_one_speed(omega=omega, below_crit=below_crit, below_het=below_het)
        if below_het is None:
            speed = self._speed(omega, below_crit, digits)
            how: dict[str, Any] = {"stable": stable, "digits": digits, "half_widths": half_widths}
            with show_share("rotating cycle", progress):
                cycle = rotating_cycle_at(self, speed.value, self._engine(engine), **how)
            return replace(cycle, omega=speed)
        if not stable:
            raise InputError(
                "below_het leads to stable rotating cycles: give the unstable one's "
                "speed with omega"
            )
        with show_share("rotating cycle", progress):
            return rotating_cycle_below_omega_h(
                self, below_het, self._engine(engine), digits=digits
            )

    def rotating_branch(
        self,
        omegas: Sequence[object] | None = None,
        *,
        half_widths: bool = True,
        engine: Engine | None = None,
        progress: bool | None = None,
    ) -> list[RotatingCycle | MissingCycle]:
        """Find the rotating cycles at several speeds.

        Each speed yields its stable cycle, if there is one, and then its unstable one.

        Args:
            omegas: The speeds [rad/s]. If left out, an overview runs from just below Omega_h
                through the fold to 0.5 rad/s above Omega_crit.
            half_widths: False leaves out half-widths, as in `branch`.
            engine: The integrator.
            progress: False hides the progress bar.

        Returns:
            The cycles in order; a `MissingCycle` stands for each speed without a cycle.

        Raises:
            InputError: If a speed cannot be used.
            NoSuchCycleError: If no speed has a cycle.
        """
        from tippedisk_verify.cycles.branch_cycles import (
            DEFAULT_ROTATING_COUNT,
            require_some_cycle,
            rotating_branch,
        )

        speeds = omegas if omegas is None else checked_speeds(omegas)
        cycles = rotating_branch(self, self._engine(engine), speeds, half_widths=half_widths)
        total = 2 * len(speeds or ()) or DEFAULT_ROTATING_COUNT
        return require_some_cycle(with_progress(cycles, "limit cycles", total, progress))

    def rotation_fold(self, *, digits: int = 12, engine: Engine | None = None) -> RotatingFold:
        """Find the fold, where the stable and the unstable rotating cycles meet and end.

        Args:
            digits: Significant digits of each main result.
            engine: The integrator.

        Returns:
            The fold with its speed [rad/s] and half-widths.

        Raises:
            NoSuchCycleError: If there is no such fold, or none was found.
            AccuracyError: If the digits were not reached.
        """
        from tippedisk_verify.cycles.families.folds import rotating_fold
        from tippedisk_verify.cycles.locator import cached_locator

        return rotating_fold(
            cached_locator(self, self._engine(engine)).rotating_family, digits=digits
        )

    def branch(
        self,
        omegas: Sequence[object] | None = None,
        *,
        paper_sets: bool = False,
        half_widths: bool = True,
        engine: Engine | None = None,
        progress: bool | None = None,
    ) -> Branch:
        """Find the family of limit cycles at several speeds, as arrays with half-widths.

        A speed with several cycles yields all of them. Under the linear law a hundred speeds or
        more are rounded to doubles, and their cycles are computed together in batches of the
        Taylor engine.

        Args:
            omegas: The speeds [rad/s]; a single text or number is one speed. If left out, an even
                overview of the family.
            paper_sets: Use the paper's speeds A^in and A^de.
            half_widths: False leaves out half-widths, as in `limit_cycle`. Cycles that are computed
                together always have them.
            engine: The integrator.
            progress: False hides the progress bar, which appears on standard error after two
                seconds.

        Returns:
            The branch. A speed without a cycle has a row with the reason.

        Raises:
            InputError: If a speed cannot be used.
            NoSuchCycleError: If no speed has a cycle; the error is that of the first speed.
        """
        from tippedisk_verify.cycles.branch import Branch
        from tippedisk_verify.cycles.branch_cycles import (
            DEFAULT_COUNT,
            PAPER_COUNT,
            librating_branch,
            require_some_cycle,
        )

        speeds = omegas if omegas is None else checked_speeds(omegas)
        cycles = librating_branch(
            self,
            self._engine(engine),
            paper_sets=paper_sets,
            omegas=speeds,
            half_widths=half_widths,
        )
        total = PAPER_COUNT if paper_sets else len(speeds or ()) or DEFAULT_COUNT
        return Branch.of(require_some_cycle(with_progress(cycles, "limit cycles", total, progress)))

    def heteroclinic(
        self,
        *,
        digits: int = 12,
        method: str = "manifolds",
        half_widths: bool = True,
        engine: Engine | None = None,
        progress: bool | None = None,
    ) -> Heteroclinic:
        """Find Omega_h, the speed at which the saddles are connected.

        Args:
            digits: Significant digits of Omega_h [rad/s].
            method: The method's name, such as ``manifolds``.
            half_widths: False leaves out the wider run that measures the error.
            engine: The integrator.
            progress: False hides the progress bar of a long computation.

        Returns:
            Omega_h [rad/s] with its half-width, and numbers of the connection.

        Raises:
            NoConnectionError: If the disk has no connection.
            InputError: If ``method`` is not known.
            AccuracyError: If the digits were not reached.
        """
        from tippedisk_verify.omega_h.methods import heteroclinic

        how: dict[str, Any] = {"digits": digits, "method": method, "half_widths": half_widths}
        with show_share("Omega_h", progress):
            return heteroclinic(self, self._engine(engine), **how)

    def sensitivity(self, *, digits: int = 12, engine: Engine | None = None) -> Sensitivity:
        """Return the derivatives of Omega_crit and Omega_h with respect to the disk's parameters.

        The rows are ``omega_crit`` and, if there is a connection, ``omega_h``. For the numbers of a
        cycle, use `LimitCycle.sensitivity`.

        Args:
            digits: Significant digits of Omega_crit and of most derivatives.
            engine: The integrator.

        Returns:
            The table, in SI units, with half-widths.

        Raises:
            InputError: If the digits cannot be used, or a parameter cannot be moved, such as B = A.
            AccuracyError: If the digits were not reached.

        >>> slopes = Disk("table1").sensitivity()
        >>> print(f"{slopes['omega_crit']['g']:.8g} {slopes['omega_h']['mu']:.8g}")
        1.5742402 0.24436011
        """
        from tippedisk_verify.cycles.sensitivity import sensitivity_of_bifurcations

        return sensitivity_of_bifurcations(self, self._engine(engine), digits)

    def near_heteroclinic(
        self,
        distances: object,
        *,
        answers: Sequence[Sequence[object]] | None = None,
        engine: Engine | None = None,
    ) -> NearHeteroclinic:
        """Compute cycles next to Omega_h, and the accuracy that is possible there.

        Args:
            distances: The distances above Omega_h [rad/s], a list of decimals.
            answers: Pairs of a speed [rad/s] and the period [s] that another program found there.
                Each number is exactly the decimal or the double given.
            engine: The engine of the flights.

        Returns:
            A row for each distance: T, its law with one, two and three terms, the slow multiplier,
            and what a double of Omega resolves. A row for each answer: its error.

        Raises:
            InputError: If a distance or an answer is not such a number.
            NoSuchCycleError: As for `limit_cycle`.
            AccuracyError: As for `limit_cycle` and `heteroclinic`.
        """
        from tippedisk_verify.omega_h.distance_study import near_heteroclinic

        return near_heteroclinic(self, distances, self._engine(engine), answers=answers)

    @property
    def certify(self) -> Certifier:
        """The proofs about this disk in ball arithmetic.

        Example: ``disk.certify.limit_cycle("30.4")``.
        """
        from tippedisk_verify.certify import Certifier

        return Certifier(self)

    def _speed(self, omega: object, below_crit: object, digits: int) -> Measured:
        """Return a speed, given directly or by its distance below Omega_crit, with its half-width."""
        if below_crit is None:
            return Measured(checked_speed(omega), Fraction(0))
        from tippedisk_verify.theory.hopf import speed_below_crit

        return speed_below_crit(self, below_crit, digits)

    @staticmethod
    def _engine(engine: Engine | None) -> Engine:
        """Return the given engine, or the default one.

        A disk's methods choose their engine only here.
        """
        if engine is not None:
            if not hasattr(engine, "measures_error") or isinstance(engine, type):
                raise InputError(
                    f"an engine is Taylor() or ScipyEngine(), not {short_text(engine)}"
                )
            return engine
        from tippedisk_verify.flow import default_engine

        return default_engine()
