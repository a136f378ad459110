"""Limit cycles as results: their numbers with half-widths, their orbits and plots."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy

from tippedisk_verify.display import Printable, quantities, quantity
from tippedisk_verify.errors import InputError
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.contract import (
    Engine,
    Request,
    raise_unless_usable,
)
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.result_format import saved_numbers, write_saved
from tippedisk_verify.numbers.arrays import round_to_doubles, to_double_array
from tippedisk_verify.numbers.exact import checked_integer
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.precision import DOUBLE, precision_of_bits
from tippedisk_verify.support.progress import show_share

if TYPE_CHECKING:
    from tippedisk_verify.cycles.monodromy import FloquetVectors, Monodromy
    from tippedisk_verify.cycles.sensitivity import Sensitivity

__all__ = ["Cycle", "LimitCycle", "MissingCycle", "RotatingCycle"]

# An orbit that needs this many bits below 1 or more to be separated from the saddle's manifolds is
# not started in double: the rounding of the start would move it to another orbit.
_LOST_START_BITS = 20
_MAX_POINTS = 10_000_000  # the largest number of points of an orbit


@dataclass(frozen=True, repr=False)
class Cycle(Printable):
    """The base class of limit cycles. The half-width of each number contains its error.

    A subclass names the point of the cycle at which its coordinates are taken.
    """

    coordinates: ClassVar[tuple[str, str]]  #: names of the two coordinates on the section
    zero_component: ClassVar[int]  #: the component of the shifted state that is zero there
    symmetric: ClassVar[bool]  #: True if the cycle is its own image under the point symmetry

    omega: Measured = field(metadata=quantity("the spinning speed", "rad/s"))
    period: Measured = field(metadata=quantity("T, the period", "s"))
    v_0: Measured = field(
        metadata=quantity("v = beta' where gamma_bar_0 or beta_bar_0 is taken", "rad/s")
    )
    beta_max: Measured = field(metadata=quantity("largest abs(beta - pi/2) on the cycle", "rad"))
    multiplier_slow: Measured = field(
        metadata=quantity(
            "the larger nontrivial Floquet multiplier; for a complex pair the modulus", "1"
        )
    )
    log_multiplier_slow: Measured = field(
        metadata=quantity("natural logarithm of its absolute value", "1")
    )
    log_multiplier_fast: Measured = field(
        metadata=quantity(
            "the same for the smaller multiplier, which may lie below any double", "1"
        )
    )
    trivial_multiplier_defect: Measured = field(
        metadata=quantity("distance from 1 of the computed multiplier along the flow, a check", "1")
    )
    dperiod_domega: Measured = field(
        metadata=quantity("dT/dOmega along the family of cycles", "s^2/rad")
    )
    stable: bool | None  #: None if the multiplier's half-width holds 1
    residuals: tuple[float, ...]  #: the residuals of the Newton iteration
    parameters: Parameters  #: the disk, with the friction law
    engine: str  #: the engine that computed it
    precision: str  #: the arithmetic of its numbers
    # the monodromy matrix at the start of the orbit and its half-widths, if a method has them
    # without a flight
    _start_matrix: Callable[[], tuple[Any, Any]] | None = field(
        default=None, kw_only=True, compare=False
    )

    @property
    def multipliers(self) -> tuple[Measured, Measured, Measured]:
        """The Floquet multipliers [1] of the cycle: 1 along the flow, the slow and the fast one;
        for a complex pair the modulus.
        """
        return (
            Measured(Fraction(1), Fraction(0)),
            self.multiplier_slow,
            self.log_multiplier_fast.exp(),
        )

    @property
    def _start(self) -> list[Measured]:
        """The shifted state (beta_bar, gamma_bar, v) of the cycle at time 0, at which `orbit`
        starts.
        """
        start: list[Measured] = [getattr(self, name) for name in self.coordinates]
        start.insert(self.zero_component, Measured(Fraction(0), Fraction(0)))
        return start

    @cached_property
    def monodromy(self) -> Monodromy:
        """The monodromy matrix at the start of `orbit`. ``cycle.monodromy(t)`` is the matrix at
        another time [s]. Raises AccuracyError if the cycle has no half-widths.
        """
        from tippedisk_verify.cycles.monodromy import monodromy_of

        with show_share("monodromy matrix"):
            return monodromy_of(self)

    @cached_property
    def floquet_vectors(self) -> FloquetVectors:
        """The Floquet vectors at the start of `orbit`. ``cycle.floquet_vectors(t)`` returns those
        at another time [s].
        """
        from tippedisk_verify.cycles.monodromy import FloquetVectors

        return FloquetVectors.of(self.monodromy)

    @cached_property
    def sensitivity(self) -> Sensitivity:
        """The derivatives of the period, the coordinates, beta_max and the multipliers with respect
        to every parameter of the disk and the speed, with half-widths.

        They are computed on first use, in some seconds, to about twelve digits. A cycle of more
        than 24 digits gives half as many. Raises AccuracyError within some 1e-8 rad/s of a
        bifurcation.

        >>> import tippedisk_verify as tv
        >>> slopes = tv.Disk("printed").limit_cycle("30.4").sensitivity
        >>> print(f"{slopes['period']['mu']:.8g} {slopes['beta_max']['omega']:.8g}")
        0.049701669 -0.41318559
        """
        from tippedisk_verify.cycles.sensitivity import sensitivity_of

        return sensitivity_of(self)

    def orbit(
        self, count: int = 400, *, shifted: bool = False, engine: Engine | None = None
    ) -> tuple[Any, Any]:
        """Return times over one period, both ends included, and the cycle's states there, in
        double.

        Next to Omega_h the flight is in as many bits as its start needs.

        Args:
            count: The number of points, 2 to 10,000,000.
            shifted: If True, the states are (beta_bar, gamma_bar, v); otherwise (beta, gamma, v).
            engine: The engine of the flight; None for the default one.

        Returns:
            The times (count,) [s] and the states (3, count) [rad, rad, rad/s].

        Raises:
            InputError: If ``count`` is not such a number, or the engine has no continuous output.
            ArithmeticError: If the engine gives up.
        """
        checked_integer(count, 2, _MAX_POINTS, f"an orbit has 2 to {_MAX_POINTS} points, not {{}}")
        times = numpy.linspace(0.0, float(self.period), count)
        states = self._states(times, engine or default_engine())
        if self.symmetric:
            states[:, -1] = states[:, 0]
        if not shifted:
            states[:2] += math.pi / 2
        return times, states

    def __call__(self, t: Any) -> Any:
        """Return the cycle's state (3,) at a time, or its states (3, n) at times (n,), in double.

        Time counts from the start of `orbit`, and goes on periodically to both sides. On a rotating
        cycle gamma grows by 2 pi in each period.

        Args:
            t: A time or times [s].

        Returns:
            beta, gamma [rad] and v [rad/s].

        Raises:
            InputError: If a time is not a finite number.
            ArithmeticError: If the engine gives up.
        """
        times = to_double_array(t)
        if not numpy.isfinite(times).all():
            raise InputError("a time on a cycle is a finite number")
        period = float(self.period)
        laps, since = numpy.divmod(numpy.atleast_1d(times), period)
        states = self._states(since, default_engine())
        states[:2] += math.pi / 2
        if not self.symmetric:
            states[1] += math.tau * laps
        return states if times.ndim else states[:, 0]

    def _states(self, times: Any, engine: Engine) -> Any:
        """Return the cycle's shifted states (3, n) at times within the period.

        The second half of a symmetric cycle is the image of the first.
        """
        laps = 2 if self.symmetric else 1
        flight = float(self.period) / laps
        lap = numpy.minimum(times // flight, laps - 1)
        dense = self._dense_output(self.period.value / laps, engine)
        states = round_to_doubles(
            dense(numpy.minimum(times - lap * flight, flight * (1 - 2.0**-52)))
        ).T
        if self.symmetric:
            states[:, lap == 1] *= -1
        return states

    def _dense_output(self, duration: Fraction, engine: Engine) -> Any:
        """Return the continuous output of a flight from the cycle's start, in an arithmetic with
        enough bits for the start.
        """
        needed = max(0, math.ceil(-math.log2(abs(self.v_0.value)))) if self.v_0.value else 0
        request = Request(
            self.parameters,
            self.omega.value,
            [number.value for number in self._start],
            duration,
            shifted=True,
            precision=DOUBLE if needed < _LOST_START_BITS else precision_of_bits(53 + 2 * needed),
            dense=True,
            domain="none",
        )
        result = raise_unless_usable(engine(request))
        if result.dense is None:
            raise InputError("an orbit needs an engine with continuous output")
        return result.dense

    def save(self, path: str | PathLike[str]) -> Path:
        """Write the cycle as JSON in which every number is exact; `tippedisk_verify.load` reads it.

        The file is described in `tippedisk_verify.model.result_format`. The loaded cycle equals
        this one and can do the same. Next to Omega_h its monodromy matrix comes from flights and
        takes longer.

        Args:
            path: The file; its name ends in ".json".

        Returns:
            The path of the file written.

        Raises:
            InputError: If the friction law is a user's own, or the file cannot be written.
        """
        names = (*quantities(type(self)), "residuals")
        entries = {name: saved_numbers(getattr(self, name)) for name in names}
        entries |= {name: getattr(self, name) for name in ("stable", "engine", "precision")}
        return write_saved(path, type(self).__name__, self.parameters, entries)

    def plot(self, axes: Any = None) -> Any:
        """Plot the cycle's orbit in the (gamma_bar, beta_bar) plane.

        Args:
            axes: The matplotlib axes; None for new ones.

        Returns:
            The matplotlib figure.
        """
        if axes is None:
            from matplotlib import pyplot

            figure, axes = pyplot.subplots(layout="constrained")
            disk = self.parameters
            figure.suptitle(f"{disk.name}, {disk.law} friction, Ω = {self.omega:.6g} rad/s")
        _, (beta_bar, gamma_bar, _) = self.orbit(shifted=True)
        axes.plot(gamma_bar, beta_bar, label=f"Ω = {self.omega:.6g} rad/s")
        axes.set(xlabel=r"$\gamma - \pi/2$ [rad]", ylabel=r"$\beta - \pi/2$ [rad]")
        return axes.figure


@dataclass(frozen=True, repr=False)
class LimitCycle(Cycle):
    """A limit cycle about inverted spinning, with its multipliers and sensitivities.

    The half-width of each number contains its error. gamma oscillates about pi/2 (libration), and
    the cycle is its own image under the point symmetry.
    """

    coordinates, zero_component, symmetric = ("gamma_bar_0", "v_0"), 0, True
    _first = ("omega", "period", *coordinates, "stable")

    gamma_bar_0: Measured = field(
        metadata=quantity("gamma - pi/2 where beta = pi/2 and v < 0, its largest value", "rad")
    )
    dgamma_bar_0_domega: Measured = field(
        metadata=quantity("d(gamma_bar_0)/dOmega along the family", "s")
    )
    dv_0_domega: Measured = field(metadata=quantity("d(v_0)/dOmega along the family", "1"))


@dataclass(frozen=True, repr=False)
class RotatingCycle(Cycle):
    """A rotating limit cycle with its multipliers and sensitivities.

    The half-width of each number contains its error. The disk leans to one side, beta > pi/2, and
    gamma grows by 2 pi a period. The point symmetry takes it to a cycle that leans to the other
    side, with falling gamma.
    """

    coordinates, zero_component, symmetric = ("beta_bar_top", "v_top"), 1, False
    _first = ("omega", "period", *coordinates, "beta_bar_0", "v_0", "stable")

    beta_bar_top: Measured = field(
        metadata=quantity("beta - pi/2 of a rotating cycle where gamma = pi/2", "rad")
    )
    v_top: Measured = field(metadata=quantity("v there", "rad/s"))
    beta_bar_0: Measured = field(
        metadata=quantity(
            "beta - pi/2 of a rotating cycle where gamma = -pi/2, next to the saddle", "rad"
        )
    )
    dbeta_bar_top_domega: Measured = field(
        metadata=quantity("d(beta_bar_top)/dOmega along the family", "s")
    )
    dv_top_domega: Measured = field(metadata=quantity("d(v_top)/dOmega along the family", "1"))


@dataclass(frozen=True, repr=False)
class MissingCycle(Printable):
    """A placeholder in a list of limit cycles, for a speed at which none was found."""

    omega: Measured = field(metadata=quantity("the spinning speed", "rad/s"))
    fault: Exception  #: the error that was raised there

    @property
    def status(self) -> str:
        """The reason why no limit cycle was found at this speed."""
        return str(self.fault)

    def to_dict(self) -> dict[str, Any]:
        return {"omega": self.omega.to_dict(), "status": self.status}
