"""The result of `Disk.heteroclinic`: Omega_h, the saddle's eigenvalues, and the connecting orbit."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Literal

import numpy

from tippedisk_verify.connection.splitting import SplittingZero
from tippedisk_verify.display import Printable, quantity
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.contract import GAMMA_TOP, Engine, Request, Result, Status
from tippedisk_verify.model.array_function import ArrayFunction
from tippedisk_verify.model.equations import vector_field as equations_of_motion
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.arrays import round_to_doubles
from tippedisk_verify.numbers.exact import short_text
from tippedisk_verify.numbers.measured import HALF_WIDTH_FACTOR, Measured
from tippedisk_verify.numbers.precision import DOUBLE_DIGITS
from tippedisk_verify.theory.equilibria import equilibrium
from tippedisk_verify.theory.saddle_manifolds import Saddle

__all__ = ["ConnectionMethod", "Heteroclinic", "heteroclinic_at"]

ConnectionMethod = Literal["manifolds", "limit-cycles", "bisection", "scipy"]
# The start's distance from the first saddle, where the branch's series is exact to 30 digits
_START_DISTANCE = Fraction(1, 10**6)
_SADDLE_BITS, _SADDLE_ORDER = 120, 6
_MAX_FLIGHT = 12.0  # s; by then doubles have long left the connection
_OVERVIEW_POINTS = 6001  # samples of the first flight, 0.002 s apart
_ORBIT_DIGITS = 20  # so that the samples are right to a double's last place


@dataclass(frozen=True, repr=False)
class Heteroclinic(Printable):
    """The heteroclinic connection of the saddles (pi/2, -pi/2, 0) and (pi/2, 3 pi/2, 0), with its
    speed Omega_h.

    By the point symmetry the way back exists too. Only the method `manifolds` gives the splitting
    derivative and the budget.
    """

    omega_h: Measured = field(
        metadata=quantity("the speed at which the two noninverted saddles are connected", "rad/s")
    )
    saddle_eigenvalues: tuple[Measured, Measured, Measured] = field(
        metadata=quantity("unstable, slow stable and fast stable eigenvalue there", "1/s")
    )
    saddle_value: Measured = field(
        metadata=quantity(
            "sum of the unstable and the slow stable eigenvalue; below 0 cycles attract", "1/s"
        )
    )
    method: ConnectionMethod
    parameters: Parameters  #: the disk and its friction law
    engine: str  #: the name of the engine that computed it
    splitting_derivative: Measured | None = field(
        default=None,
        metadata=quantity(
            "derivative of the distance between the manifolds with respect to Omega, at s = 1",
            "s/rad",
        ),
    )
    #: the parts of the half-width of Omega_h, by name [rad/s]
    budget: dict[str, float] = field(default_factory=dict)

    def orbit(self, count: int = 401, *, engine: Engine | None = None) -> tuple[Any, Any]:
        """Return times and states along the heteroclinic orbit.

        The orbit begins at a distance of 1e-6 from the first saddle. It ends where doubles leave
        the connection, some 1e-4 before the second saddle.

        Args:
            count: The number of points, at least 2.
            engine: The engine of the flight; None for the default one.

        Returns:
            The times (count,) [s], zero where gamma = pi/2, and the states (3, count) [rad, rad,
            rad/s].

        Raises:
            InputError: If ``count`` is below 2.
            AccuracyError: If the branch cannot be followed.
        """
        times, states, _ = self.samples(count, engine=engine)
        return times, states

    def samples(self, count: int = 401, *, engine: Engine | None = None) -> tuple[Any, Any, Any]:
        """Return times and states along the heteroclinic orbit as `orbit` does, and the half-widths
        of the states at exactly these times.

        The half-widths include the effect of the half-width of Omega_h on a state, which grows
        towards the second saddle. They are infinite for an engine that does not measure its error.

        Args:
            count: The number of points, at least 2.
            engine: The engine of the flight; None for the default one.

        Returns:
            The times (count,) [s], the states (3, count) and their half-widths (3, count) [rad,
            rad, rad/s].

        Raises:
            InputError: If ``count`` is below 2.
            AccuracyError: If the branch cannot be followed.
        """
        if count < 2:
            raise InputError(f"an orbit has at least its two ends, not {short_text(count)} points")
        engine, omega_h = engine or default_engine(), self.omega_h
        overview = numpy.linspace(0, _MAX_FLIGHT, _OVERVIEW_POINTS)
        run = self._follow_unstable_manifold(omega_h.value, overview, engine, measured=False)
        distances = numpy.abs(run.samples - numpy.array([0, math.pi, 0])).max(axis=1)
        since = numpy.linspace(0, overview[int(numpy.argmin(distances))], count)
        run = self._follow_unstable_manifold(omega_h.value, since, engine)
        times = round_to_doubles(since - run.events[0].time)
        states = round_to_doubles(run.samples).T
        states[:2] += math.pi / 2
        if run.error is None:
            return times, states, numpy.full(states.shape, numpy.inf)
        moved = self._follow_unstable_manifold(omega_h.value + omega_h.uncertainty, since, engine)
        earlier = abs(float(moved.events[0].time - run.events[0].time))
        late = numpy.spacing(numpy.abs(times)) + run.error.events[0] + HALF_WIDTH_FACTOR * earlier
        rates = numpy.abs(
            ArrayFunction(equations_of_motion, self.parameters, omega_h.value)(0, states)
        )
        widths = round_to_doubles(
            run.error.samples + HALF_WIDTH_FACTOR * numpy.abs(moved.samples - run.samples)
        ).T
        # Two roundings: that of the flight's number to a double, and that of the sum with pi/2.
        return (
            times,
            states,
            widths + HALF_WIDTH_FACTOR * rates * late + numpy.spacing(2 * numpy.abs(states)),
        )

    def _follow_unstable_manifold(
        self, omega: Fraction, times: Any, engine: Engine, *, measured: bool = True
    ) -> Result:
        """Return the flight at a speed from the first saddle along its unstable manifold, in
        shifted angles.

        Its event is gamma = pi/2. Raises AccuracyError if the flight does not reach the last time.
        """
        start = Saddle(
            self.parameters, omega, _SADDLE_BITS, _SADDLE_ORDER
        ).start_on_unstable_manifold(_START_DISTANCE)
        result = engine(
            Request(
                self.parameters,
                omega,
                start,
                times[-1],
                shifted=True,
                times=times,
                events=(GAMMA_TOP,),
                domain="none",
                error_estimate=measured and engine.measures_error,
                digits=_ORBIT_DIGITS if measured and engine.measures_error else DOUBLE_DIGITS,
            )
        )
        if result.status is not Status.REACHED or not result.events:
            raise AccuracyError(f"the unstable manifold: {result.status.value}")
        return result


def heteroclinic_at(
    parameters: Parameters,
    omega_h: Measured,
    digits: int,
    *,
    method: ConnectionMethod,
    engine: Engine,
    zero: SplittingZero | None = None,
) -> Heteroclinic:
    """Return the heteroclinic connection at a known Omega_h, with its eigenvalues.

    Args:
        parameters: The disk and its friction law.
        omega_h: The speed of the connection [rad/s].
        digits: The significant digits of the eigenvalues.
        method: The method that found Omega_h.
        engine: The engine that found it.
        zero: The zero of the splitting, for its derivative and budget.
    """
    eigenvalues = _eigenvalues(parameters, omega_h, digits)
    unstable, slow, _ = eigenvalues
    return Heteroclinic(
        omega_h=omega_h,
        saddle_eigenvalues=eigenvalues,
        saddle_value=unstable + slow,
        method=method,
        parameters=parameters,
        engine=engine.name,
        splitting_derivative=None if zero is None else zero.derivative,
        budget={} if zero is None else zero.budget,
    )


def _eigenvalues(
    parameters: Parameters, omega_h: Measured, digits: int
) -> tuple[Measured, Measured, Measured]:
    """Return the saddle's eigenvalues [1/s] at Omega_h.

    Their half-widths include the effect of the half-width of Omega_h. The eigenvalues are smooth in
    Omega, so that effect is linear.
    """

    def real_parts(omega: Fraction) -> list[Measured]:
        state = equilibrium(parameters, omega, "noninverted", digits + 6)
        return [eigenvalue.re for eigenvalue in state.eigenvalues]

    if not omega_h.is_measured:
        first, second, third = (
            Measured.without_half_width(x.value, digits) for x in real_parts(omega_h.value)
        )
    else:
        moved = real_parts(omega_h.value + omega_h.uncertainty)
        first, second, third = (
            Measured(
                a.value,
                a.uncertainty + b.uncertainty + abs(a.value - b.value) * HALF_WIDTH_FACTOR,
            )
            for a, b in zip(real_parts(omega_h.value), moved, strict=True)
        )
    return first, second, third
