"""The heteroclinic connection between noninverted spinning and its copy: Omega_h by several methods, its orbit.

*manifolds* finds the zero of the splitting between the unstable and the stable manifold, to any number of digits.
*limit-cycles* follows the limit cycles to infinite period. They share the integrator and nothing else. *bisection* only
looks at which side the unstable branch takes, in double; *scipy* does the same with another integrator.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Literal, get_args

import numpy

from tippedisk_verify.connection.bisection import bisect_omega_h
from tippedisk_verify.connection.splitting import MOST_DIGITS, splitting_zero
from tippedisk_verify.cycles.period_continuation import limit_of_cycles
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.baseline import Baseline
from tippedisk_verify.flow.contract import Engine, Request, Status
from tippedisk_verify.model.exact import shown
from tippedisk_verify.model.measured import DISTANCES, Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import checked_digits
from tippedisk_verify.model.results import Printable, quantity
from tippedisk_verify.model.surroundings import undisturbed
from tippedisk_verify.theory.equilibria import equilibrium
from tippedisk_verify.theory.saddle_manifolds import Saddle

__all__ = ["METHODS", "Heteroclinic", "Method", "heteroclinic"]

Method = Literal["manifolds", "limit-cycles", "bisection", "scipy"]
METHODS: tuple[Method, ...] = get_args(Method)
_DOUBLE_DIGITS = 12


@dataclass(frozen=True, repr=False)
class Heteroclinic(Printable):
    """The connection from (pi/2, -pi/2, 0) to (pi/2, 3 pi/2, 0); by the point symmetry the way back exists too.

    Only the method `manifolds` has the splitting derivative and the budget.
    """

    omega_h: Measured = field(
        metadata=quantity("the speed at which the two noninverted saddles are connected", "rad/s")
    )
    saddle_eigenvalues: tuple[Measured, Measured, Measured] = field(
        metadata=quantity("unstable, slow and fast stable one there", "1/s")
    )
    saddle_value: Measured = field(
        metadata=quantity("sum of the unstable and the slow stable one; below 0 cycles attract", "1/s")
    )
    method: Method
    parameters: Parameters  #: whose connection it is, with the friction law
    engine: str  #: what computed it
    splitting_derivative: Measured | None = field(
        default=None, metadata=quantity("of the distance between the manifolds by Omega, at s = 1", "s/rad")
    )
    budget: dict[str, float] = field(default_factory=dict)  #: of what the half-width of Omega_h is the sum [rad/s]

    def orbit(self, count: int = 401, *, engine: Engine | None = None) -> tuple[Any, Any]:
        """Times (count,) [s], zero where gamma = pi/2, and the states (3, count) along the connection, in double.

        It runs from a distance of 1e-6 to the first saddle to where double leaves the connection, some 1e-4 before the
        second one. Raises InputError for a count below 2, AccuracyError if the branch cannot be followed.
        """
        if count < 2:
            raise InputError(f"an orbit has at least its two ends, not {shown(count)} points")
        saddle = Saddle(self.parameters, self.omega_h.value, 80, 5)
        times = numpy.linspace(0, 12, 6001)
        state = saddle.start_on_branch(Fraction(1, 10**6))
        request = Request(
            self.parameters, self.omega_h.value, state, 12.0, shifted=True, times=times, domain="none", dense=True
        )
        result = (engine or default_engine())(request)
        if result.status is not Status.REACHED or result.dense is None:
            raise AccuracyError(f"the unstable branch: {result.status.value}")
        distances = numpy.abs(result.samples - numpy.array([0, math.pi, 0])).max(axis=1)
        last = times[int(numpy.argmin(distances))]
        crossing = int(numpy.flatnonzero(result.samples[:, 1] > 0)[0])
        before, after = result.samples[crossing - 1 : crossing + 1, 1]
        middle = times[crossing - 1] - before / (after - before) * (times[1] - times[0])
        chosen = numpy.linspace(0, last, count)
        states = result.dense(chosen).T
        states[:2] += math.pi / 2
        return chosen - middle, states


@undisturbed
def heteroclinic(
    parameters: Parameters,
    engine: Engine,
    *,
    digits: int = 12,
    method: str = "manifolds",
) -> Heteroclinic:
    """Omega_h to ``digits`` significant digits by one of `METHODS`.

    Raises InputError for an unknown method or more digits than it can have, NoConnectionError where there is no
    connection, AccuracyError if the digits are not reached.
    """
    if method not in METHODS:
        raise InputError(f"method '{shown(method)}' is not known: use {', '.join(METHODS)}")
    digits = checked_digits(digits)
    if method in ("bisection", "scipy") and digits > _DOUBLE_DIGITS:
        raise InputError(f"{method} runs in double: at most {_DOUBLE_DIGITS} digits, not {digits}; use manifolds")
    if digits > MOST_DIGITS:
        raise InputError(f"Omega_h is offered to {MOST_DIGITS} digits, not {digits}: more would take days")
    derivative, budget = None, {}
    if method == "manifolds":
        guess = bisect_omega_h(parameters, engine, confirm=False).omega_h.value
        zero = splitting_zero(parameters, guess, engine, digits)
        omega_h, derivative, budget = zero.omega_h, zero.derivative, zero.budget
    elif method == "limit-cycles":
        omega_h = limit_of_cycles(parameters, engine, digits)
    else:
        omega_h = bisect_omega_h(parameters, Baseline("DOP853") if method == "scipy" else engine).omega_h
    eigenvalues = _eigenvalues(parameters, omega_h, digits)
    unstable, slow, _ = eigenvalues
    return Heteroclinic(
        omega_h=omega_h,
        saddle_eigenvalues=eigenvalues,
        saddle_value=unstable + slow,
        method=method,
        parameters=parameters,
        engine=engine.name,
        splitting_derivative=derivative,
        budget=budget,
    )


def _eigenvalues(parameters: Parameters, omega_h: Measured, digits: int) -> tuple[Measured, Measured, Measured]:
    """With what the uncertainty of Omega_h does to them: they are smooth in it, so their change is linear."""
    there, moved = (
        equilibrium(parameters, omega, "noninverted", digits + 6).eigenvalues
        for omega in (omega_h.value, omega_h.value + omega_h.uncertainty)
    )
    first, second, third = (
        Measured(a.re.value, a.re.uncertainty + b.re.uncertainty + abs(a.re.value - b.re.value) * DISTANCES)
        for a, b in zip(there, moved, strict=True)
    )
    return first, second, third
