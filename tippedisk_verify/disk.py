"""The front door: a `Disk`, and what can be asked of it.

A disk is its parameters with the friction law. Each method hands it to the room where the mathematics is, with the
default engine unless another one is given. Results remember the disk that they are about.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.exact import exact, shown
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Friction, Parameters
from tippedisk_verify.model.results import Printable

if TYPE_CHECKING:
    from tippedisk_verify.flow.contract import Engine, Event, EventRecord, Request, Result, Status
    from tippedisk_verify.orbits.basin_boundary import BasinBoundary
    from tippedisk_verify.orbits.basins import Basins
    from tippedisk_verify.orbits.branches import Branch
    from tippedisk_verify.orbits.cycles import LimitCycle, RotatingCycle
    from tippedisk_verify.orbits.folds import LibrationFold, RotationFold
    from tippedisk_verify.orbits.heteroclinic import Heteroclinic
    from tippedisk_verify.theory.codimension_two import BautinPoint
    from tippedisk_verify.theory.equilibria import Equilibrium, EquilibriumName
    from tippedisk_verify.theory.hopf import HopfPoint

__all__ = ["Disk", "Solution"]

_SAMPLES = 201  # of a solution, if no times are named
_DOUBLE_DIGITS = 12


@dataclass(frozen=True, eq=False, repr=False)
class Solution(Printable):
    """A motion, as `scipy.integrate.solve_ivp` gives it, with half-widths that hold the truth.

    ``t`` (n,) [s], ``y`` (3, n) with rows beta, gamma [rad] and v [rad/s], ``uncertainty`` (3, n) the half-widths of
    ``y``, infinite where rounding decides how the run ends. The last column is where the run ended, which is before the
    final time if the disk lies flat or a terminal event ends it: ``status`` and ``message`` say so.
    """

    disk: Parameters
    omega: object  #: [rad/s]
    t: Any
    y: Any
    uncertainty: Any
    status: Status
    time_uncertainty: float  #: half-width of the last time [s]; 0 unless an event ended the run
    events: tuple[EventRecord, ...]
    engine: str
    precision: str
    _request: Request
    _engine: Engine

    @classmethod
    def of(cls, request: Request, result: Result, engine: Engine) -> Solution:
        """What an engine answered: the samples that were reached, and the end."""
        import numpy

        precision, error = result.precision or request.precision, result.error
        samples = numpy.empty((0, 3)) if result.samples is None else result.samples
        times = numpy.empty(0) if request.times is None else precision.sequence(request.times)[: len(samples)]
        widths, last, time = numpy.full(samples.shape, numpy.inf), numpy.full(3, numpy.inf), 0.0
        if error is not None:
            widths, last, time = widths if error.samples is None else error.samples, error.state, error.time
        while len(times) and abs(times[-1]) >= abs(result.time):  # the end itself is the last column
            times, samples, widths = times[:-1], samples[:-1], widths[:-1]
        return cls(
            disk=request.parameters,
            omega=request.omega,
            t=numpy.append(times, result.time),
            y=numpy.vstack((samples, result.state)).T,
            uncertainty=numpy.vstack((widths, last)).T.astype(float),
            status=result.status,
            time_uncertainty=time,
            events=result.events,
            engine=engine.name,
            precision=precision.name,
            _request=request,
            _engine=engine,
        )

    def __getstate__(self) -> dict[str, Any]:
        """For other processes and copies: continuous output is made anew there, by a run that needs no events."""
        kept = {name: value for name, value in self.__dict__.items() if name != "_dense"}
        return kept | {"_request": replace(self._request, events=(), times=None, duration=self.t[-1])}

    @property
    def success(self) -> bool:
        """Whether the run ended as it was asked to, or at the model's own end."""
        return self.status.usable

    @property
    def message(self) -> str:
        """How the run ended, in words."""
        return self.status.value

    @cached_property
    def _dense(self) -> Any:
        result = self._engine(replace(self._request, dense=True, times=None, error_estimate=False))
        if result.dense is None:
            raise InputError(f"{self.engine} gives no continuous output")
        return result.dense

    def __call__(self, t: Any) -> Any:
        """The state (3,) at a time, or (3, n) at times (n,), to the integrator's accuracy or the digits asked for.

        The run is repeated with continuous output when this is first asked. Raises InputError outside the run.
        """
        import numpy

        from tippedisk_verify.flow.error_estimate import PLAIN_DIGITS

        given = numpy.asarray(t)
        if given.ndim > 1:
            raise InputError("a solution is asked for at a time, or at a list of times")
        try:
            times = self._request.precision.array(given.ravel().tolist())
        except (TypeError, OverflowError):
            raise InputError("a solution is asked for at times, which are numbers") from None
        first, last = sorted((0 * self.t[-1], self.t[-1]))
        if any(not first <= time <= last for time in times):
            raise InputError(f"the solution is known from {float(first):.10g} s to {float(last):.10g} s")
        if self._request.digits > PLAIN_DIGITS:  # each time's error is taken out
            order = numpy.unique(times if self.t[-1] >= 0 else -times, return_inverse=True)
            wanted = replace(self._request, times=abs(order[0]) if self.t[-1] >= 0 else -order[0], events=())
            states = self._engine(wanted).samples.T[:, order[1]]
        else:
            states = self._dense(times).T
        return states if given.ndim else states[:, 0]


class Disk(Parameters):
    """A tippedisk under a friction law, and what can be asked of it.

    ``Disk("printed")`` is a named set (printed, calibrated, geometry) or a TOML file, ``Disk(r="0.045", ...)``
    one of your own: eight numbers r, e, m, A, B, g, mu, epsilon [SI], as decimal strings or other exact numbers.
    ``friction`` is linear or smooth. A disk is a `Parameters` and goes wherever those go. Raises InputError as they do.

    Speeds are in rad/s, angles in rad, times in s. ``engine`` is the Taylor integrator unless another one is given, and
    ``digits`` are the significant digits wanted of each main result: up to 12 in double, more in wider arithmetic.
    """

    __slots__ = ()

    def __init__(self, named: str | None = None, *, friction: Friction | None = None, **values: Any) -> None:
        if named is not None:
            if values:
                raise InputError(
                    f"a disk has a name or its own numbers, not both '{shown(named)}' and {sorted(values)}"
                )
            if not isinstance(named, str):
                raise InputError(f"a disk is named by a text, not by {shown(named)}")
            known = Parameters.named(named)
            values = {item.name: getattr(known, item.name) for item in fields(known) if item.init}
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
        """The disk in a TOML file of quoted decimals. Raises InputError as `Parameters.from_toml` does."""
        known = Parameters.from_toml(Path(path))
        values = {item.name: getattr(known, item.name) for item in fields(known) if item.init}
        return cls(**values | {"friction": friction})

    # ---------------------------------------------------------------------------------------- closed forms
    @property
    def omega_crit(self) -> Measured:
        """The critical speed Omega_crit [rad/s], where inverted spinning loses stability (Eq. approx_omega_crit)."""
        from tippedisk_verify.theory.hopf import omega_crit

        return omega_crit(self)

    def equilibrium(self, name: EquilibriumName, omega: object, *, digits: int = 15) -> Equilibrium:
        """``inverted`` or ``noninverted`` spinning: state, eigenvalues [1/s], stability."""
        from tippedisk_verify.theory.equilibria import equilibrium

        return equilibrium(self, omega, name, digits)

    def hopf(self, *, digits: int = 12) -> HopfPoint:
        """The Hopf point of inverted spinning with its normal form. Raises InputError under the smooth law."""
        from tippedisk_verify.theory.hopf import hopf_point

        return hopf_point(self, digits)

    def bautin_points(self, parameter: str, *, digits: int = 12) -> tuple[BautinPoint, ...]:
        """The disks with l_1 = 0 as A, B, m, r or e varies, the others held; mostly one. Raises as `hopf`."""
        from tippedisk_verify.theory.codimension_two import bautin_points

        return bautin_points(self, parameter, digits)

    # ---------------------------------------------------------------------------------------- motion
    def integrate(
        self,
        omega: object,
        state: Sequence[object],
        duration: object,
        *,
        times: Any = None,
        digits: int = 12,
        events: tuple[Event, ...] = (),
        shifted: bool = False,
        engine: Engine | None = None,
    ) -> Solution:
        """The motion from ``state`` (beta, gamma, v) for ``duration`` [s], backward if that is negative.

        ``times`` are where the solution is wanted, strictly monotonic from 0 on; 201 even ones if left out. Texts such
        as "pi/2 + 0.4" are exact. Angles are beta_bar and gamma_bar, from pi/2, if ``shifted``. Raises InputError for
        what makes no sense; a run that ends early does not raise.
        """
        import numpy

        from tippedisk_verify.flow.contract import Request
        from tippedisk_verify.flow.error_estimate import CORRECTED_DIGITS, PLAIN_DIGITS
        from tippedisk_verify.model.precision import DOUBLE, bits, bits_for_digits, checked_digits

        flown = self._engine(engine)
        corrected = flown.measures_error and checked_digits(digits) <= CORRECTED_DIGITS
        precision = DOUBLE if corrected or digits <= PLAIN_DIGITS else bits(bits_for_digits(digits + 8))
        if times is None and (end := float(exact(duration))):
            times = numpy.linspace(0, end, _SAMPLES)
        request = Request(
            self,
            omega,
            state,
            duration,
            shifted=shifted,
            precision=precision,
            times=times,
            events=events,
            error_estimate=flown.measures_error,
            digits=digits if corrected else PLAIN_DIGITS,
        )
        return Solution.of(request, flown(request), flown)

    def basins(self, omega: object, **options: Any) -> Basins:
        """What each of many initial states ends on; options as those of `orbits.basins.basins`."""
        from tippedisk_verify.orbits.basins import basins

        return basins(self, omega, **options)

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
        """The limit cycle about inverted spinning at ``omega``, Omega_crit - ``below_crit`` or Omega_h + ``above_het``.

        Where a speed has several it is the stable one, or the one that ``stable`` asks for. Raises InputError unless
        one of the three is given, NoSuchCycleError where there is no such cycle, Shortfall if the digits are not
        reached.
        """
        from tippedisk_verify.orbits.near_connection import cycle_above, cycle_at
        from tippedisk_verify.theory.hopf import speed_below_crit

        if (omega is not None) + (below_crit is not None) + (above_het is not None) != 1:
            raise InputError("give the speed with one of omega, below_crit and above_het")
        if above_het is not None:
            if stable is not None:
                raise InputError("above_het leads to the cycles next to Omega_h: choose with stable at a speed omega")
            return cycle_above(self, above_het, self._engine(engine), digits=digits)
        if below_crit is not None:
            omega = speed_below_crit(self, below_crit, digits)
        return cycle_at(self, omega, self._engine(engine), digits=digits, stable=stable)

    def folds(self, *, digits: int = 12, engine: Engine | None = None) -> tuple[LibrationFold, ...]:
        """Where two limit cycles about inverted spinning meet and end, from the Hopf point on; of many disks none.

        Raises NoSuchCycleError where the family cannot be followed, Shortfall if the digits are not reached.
        """
        from tippedisk_verify.orbits.folds import libration_folds

        return libration_folds(self, self._engine(engine), digits=digits)

    def rotating_cycle(
        self,
        omega: object = None,
        *,
        below_het: object = None,
        stable: bool = True,
        digits: int = 12,
        engine: Engine | None = None,
    ) -> RotatingCycle:
        """The rotating limit cycle at ``omega`` or at Omega_h - ``below_het``: gamma grows by 2 pi a period.

        Stable ones lie between the family's fold and Omega_h, unstable ones (``stable=False``) from the fold upward.
        Raises as `limit_cycle` does.
        """
        from tippedisk_verify.orbits.rotating import rotating_below, rotating_cycle

        if (omega is None) == (below_het is None):
            raise InputError("give the speed with either omega or below_het")
        if below_het is None:
            return rotating_cycle(self, omega, self._engine(engine), stable=stable, digits=digits)
        if not stable:
            raise InputError("below_het leads to stable rotating cycles: give the unstable one's speed with omega")
        return rotating_below(self, below_het, self._engine(engine), digits=digits)

    def rotating_branch(
        self, omegas: Sequence[object] | None = None, *, engine: Engine | None = None
    ) -> list[RotatingCycle]:
        """The family of rotating cycles: at each of these speeds the stable one, if any, and then the unstable one.

        Without speeds an overview, from just below Omega_h through the fold to half a rad/s above Omega_crit.
        """
        from tippedisk_verify.orbits.rotating import rotating_branch

        return list(rotating_branch(self, self._engine(engine), omegas))

    def rotation_fold(self, *, digits: int = 12, engine: Engine | None = None) -> RotationFold:
        """Where the stable and the unstable rotating cycles meet and end. Raises as `rotating_cycle` does."""
        from tippedisk_verify.orbits.folds import rotation_fold

        return rotation_fold(self, self._engine(engine), digits=digits)

    def basin_boundary(self, omega: object, *, engine: Engine | None = None) -> BasinBoundary:
        """What separates starts that keep standing from those that lie flat. Raises as `rotating_cycle` does."""
        from tippedisk_verify.orbits.basin_boundary import BasinBoundary

        return BasinBoundary(self, omega, self._engine(engine))

    def branch(self, omegas: Sequence[object] | None = None, *, engine: Engine | None = None) -> Branch:
        """The family of limit cycles at these speeds, or an even overview of it, as arrays with half-widths.

        A speed with several cycles gives all of them. A hundred speeds and more are rounded to doubles, and the linear
        law's cycles found together, in lanes of the Taylor engine. Raises NoSuchCycleError where there is no cycle.
        """
        from tippedisk_verify.orbits.branches import Branch, family

        return Branch.of(family(self, self._engine(engine), omegas=omegas))

    def heteroclinic(
        self, *, digits: int = 12, method: str = "manifolds", engine: Engine | None = None
    ) -> Heteroclinic:
        """Omega_h, where the saddles are connected. Raises NoConnectionError where there is no connection."""
        from tippedisk_verify.orbits.heteroclinic import heteroclinic

        return heteroclinic(self, self._engine(engine), digits=digits, method=method)

    @staticmethod
    def _engine(engine: Engine | None) -> Engine:
        """The engine given, or the default one: the one place where a disk's methods choose it."""
        if engine is not None:
            if not hasattr(engine, "measures_error") or isinstance(engine, type):
                raise InputError(f"an engine is Taylor() or Baseline(), not {shown(engine)}")
            return engine
        from tippedisk_verify.flow import default_engine

        return default_engine()
