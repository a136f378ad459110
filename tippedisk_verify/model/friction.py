"""Friction laws: the friction force as a function of the sliding velocity.

A law is an object, `FrictionLaw`. The paper's two laws have names and are written out here; a
user's own law is a name and a function. Other modules ask a law what it can do: whether it is
linear, and whether it has two analytic sides.

**Symmetry.** Each law is odd in the sliding velocity gamma_y, because the disk's point symmetry
changes the sign of gamma_y.

**Two sides.** A law such as Coulomb's smoothed by an absolute value is analytic for gamma_y >= 0,
and its continuation across zero is another function. Its two sides are integrated one at a time.

**Slope.** All laws here have the slope -mu m g / epsilon at gamma_y = 0 unless they give another.
Equilibria, their eigenvalues and Omega_crit depend on a law through this slope only.

**Guard.** A law may bend sharply near gamma_y = 0, and a long step could pass over the bend. So a
law gives the rate of a further variable, its guard, which the step size control watches.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache
from typing import Any, ClassVar, Literal, get_args

from tippedisk_verify.errors import InputError
from tippedisk_verify.numbers.exact import fraction, is_one_of, short_text
from tippedisk_verify.numbers.precision import precision_of_bits

__all__ = ["FORCE_CONSTANTS", "LAWS", "Friction", "FrictionLaw", "constants_used", "law_of"]

#: The names of the paper's laws.
Friction = Literal["linear", "smooth"]

_MAX_NAME = 40  # characters, so that a title stays on its line
FORCE_CONSTANTS = ("m", "g", "mu", "epsilon", "pi")  #: the constants that a force may read
_PROBES = (0.001, 0.1, 0.7, 1.0, 2.5, 30.0)  # sliding velocities, for constants of value 1
_GUARD_CONSTANTS = ("k", "traction")
# The weight keeps the guard's variable near the size of the angles in runs of some minutes.
_GUARD_WEIGHT = 2.0**-6
# An imaginary step; its square is far below the rounding of any sliding velocity
_IMAGINARY_STEP = 1e-150


def _default_slope(c: Any) -> Any:
    """Return the slope mu m g / epsilon [N s/m] at zero sliding velocity that both of the paper's
    friction laws have.

    Args:
        c: The parameters.
    """
    return c.mu * c.m * c.g / c.epsilon


@dataclass(frozen=True)
class FrictionLaw:
    """A friction law: lambda_Ty [N] as a function of the sliding velocity gamma_y [m/s].

    ``force`` is called as ``force(ops, gamma_y, c)`` and returns lambda_Ty, which is negative for
    positive gamma_y. It is one expression for every kind of number: floats, arrays, expressions of
    heyoka, numbers of mpmath.

    - ``ops`` has the functions that `precision.FUNCTION_NAMES` lists. Apply them to expressions of
      ``gamma_y`` and ``c``: a function of a plain number, such as ``ops.sqrt(2)``, is rounded to a
      double.
    - ``c`` has the parameters m, g, mu and epsilon, and pi.
    - A decimal such as 0.3 is rounded to the nearest double. ``3 * gamma_y / 10`` is exact.
    - The force is one formula, without conditions and absolute values. It must not depend on
      anything that changes, because it is compiled once.

    A disk that is created with the law checks that the force is odd and brakes. It also checks that
    the force has the given slope and no rounded constant. It refuses a law with features much
    narrower than the sliding velocity at which they lie, because an integrator's step could pass
    one (`friction_checks`).

    Args:
        name: The name in titles and messages.
        force: The function that gives the force [N].
        two_sided: False: the force is analytic at every gamma_y. True: ``force`` is called with
            gamma_y >= 0 only, is analytic there, and is continued as an odd function.
        slope: A function of ``c`` that gives -d(lambda_Ty)/d(gamma_y) at gamma_y = 0 [N s/m]. It
            uses only the four arithmetic operations. If left out it is mu m g / epsilon.

    Raises:
        InputError: If the name is that of one of the paper's laws or not a short line, or if
            ``two_sided`` is not a bool.
    """

    name: str
    force: Callable[[Any, Any, Any], Any]
    two_sided: bool = False
    slope: Callable[[Any], Any] = _default_slope
    #: the values of the force when the law was made; a disk refuses a law whose values have changed
    probe_forces: tuple[Any, ...] = field(default=(), init=False, repr=False)

    is_linear: ClassVar[bool] = False
    has_guard: ClassVar[bool] = True  #: see `guard_rate`

    def __post_init__(self) -> None:
        name = self.name
        if not isinstance(name, str) or not name.isprintable() or not 0 < len(name) <= _MAX_NAME:
            raise InputError(
                f"a friction law's name is one line of at most {_MAX_NAME} characters, not "
                f"{short_text(name)}"
            )
        if not isinstance(self.two_sided, bool):
            raise InputError(f"two_sided is True or False, not {short_text(self.two_sided)}")
        if name in get_args(Friction) and type(self) is FrictionLaw:
            raise InputError(f"'{name}' is one of the paper's laws: choose another name")
        object.__setattr__(self, "probe_forces", self.force_at_probes())

    def force_at_probes(self) -> tuple[Any, ...]:
        """Return the force of the friction law at some sliding velocities, with constants of value
        1.

        Two such tuples show if the function has changed. The tuple is empty if the values cannot be
        computed. A disk refuses such a law.
        """
        try:
            return tuple(self.force(math, velocity, _Recorder()) for velocity in _PROBES)
        except Exception:
            return ()

    def __deepcopy__(self, memo: object) -> FrictionLaw:
        return self

    def __str__(self) -> str:
        return self.name

    @property
    def constants(self) -> tuple[str, ...]:
        """The names of the runtime parameters that this friction law adds to the compiled equations
        of motion.
        """
        return (*constants_used(self.force), *_GUARD_CONSTANTS)

    def guard_rate(self, ops: Any, gamma_y: Any, c: Any) -> Any:
        """Return the rate of a variable that shows an integrator where the law bends.

        A law such as the hyperbolic tangent is constant to rounding at large sliding velocities.
        Its Taylor series there do not show that it bends at zero, and a long step would pass the
        bend. The series of this rate, ln(1 + x^2) with x = k gamma_y / (mu g), show it from any
        distance: they keep a step below a third of the distance. The variable is far smaller than
        the state even in a slow motion, so that it does not loosen the integrator's tolerance.

        Args:
            ops: The functions of the kind of number.
            gamma_y: The sliding velocity [m/s].
            c: The parameters.
        """
        bend = c.k * gamma_y / c.traction
        return _GUARD_WEIGHT * ops.log(1 + bend * bend)

    def __reduce__(self) -> tuple[Any, ...]:
        for function in (self.force, self.slope):
            if "<" in getattr(function, "__qualname__", "<"):
                raise InputError(
                    f"the friction law '{self.name}' cannot be sent to another process: its functions "
                    f"must be defined by `def` at the top of a module"
                )
        return type(self), (self.name, self.force, self.two_sided, self.slope)

    def __call__(self, ops: Any, gamma_y: Any, c: Any, side: Any = None) -> Any:
        """Return the friction force lambda_Ty [N].

        Args:
            ops: The functions of the kind of number.
            gamma_y: The sliding velocity [m/s].
            c: The parameters in the same kind.
            side: 1 or -1 selects the side of a law with two sides; the sign of ``gamma_y`` if left
                out.
        """
        if not self.two_sided:
            return self.force(ops, gamma_y, c)
        sign = 1 - 2 * (gamma_y < 0) if side is None else side
        return sign * self.force(ops, sign * gamma_y, c)

    def deceleration(self, ops: Any, gamma_y: Any, c: Any, side: Any = None) -> Any:
        """Return the friction force per mass against the sliding, -lambda_Ty / m [m/s^2].

        Args:
            ops, gamma_y, c, side: As for a call.
        """
        return -self(ops, gamma_y, c, side) / c.m

    def deceleration_slope(self, ops: Any, gamma_y: Any, c: Any, side: Any = None) -> Any:
        """Return the derivative of `deceleration` with respect to the sliding velocity [1/s].

        heyoka differentiates an expression and mpmath its own numbers. Elsewhere the derivative
        comes from an imaginary step.

        Args:
            ops, gamma_y, c, side: As for a call.
        """
        if hasattr(ops, "taylor_adaptive"):
            sliding = ops.make_vars("sliding")
            rate = self.deceleration(ops, sliding, c, side)
            return ops.subs(ops.diff(rate, sliding), {sliding: gamma_y})
        if getattr(getattr(gamma_y, "dtype", None), "kind", None) == "O":
            import numpy

            return numpy.array(
                [self.deceleration_slope(ops, velocity, c, side) for velocity in gamma_y]
            )
        sign = 1 - 2 * (gamma_y < 0) if side is None else side
        if hasattr(gamma_y, "context"):
            return gamma_y.context.diff(
                lambda velocity: self.deceleration(ops, velocity, c, sign), gamma_y
            )
        moved = gamma_y + complex(0, _IMAGINARY_STEP)
        return (
            self.deceleration(cmath if ops is math else ops, moved, c, sign).imag / _IMAGINARY_STEP
        )

    def friction_term(
        self, ops: Any, c: Any, side: Any, w_y_gamma_y: Any, sin_b: Any, slip: Any, rho: Any
    ) -> Any:
        """Return the friction term of the equation of motion, -w_y lambda_Ty / m [m^2/s^2].

        Args:
            ops, c, side: As for a call.
            w_y_gamma_y: w_y gamma_y [m^2/s].
            sin_b: sin(beta).
            slip: gamma_y / sin(beta) [m/s].
            rho: r + e sin(gamma) [m]; w_y is rho sin(beta).
        """
        return self.deceleration(ops, sin_b * slip, c, side) * (rho * sin_b)

    def taylor_polynomial(
        self, parameters: Any, working_bits: int, order: int, side: Any, number: Callable[..., Any]
    ) -> FrictionLaw:
        """Return a friction law whose deceleration is the Taylor polynomial of this law's at
        gamma_y = 0.

        It accepts a power series as the sliding velocity.

        Args:
            parameters: The disk.
            working_bits: The number of correct bits of the coefficients.
            order: The degree of the polynomial.
            side: 1 or -1 for a law with two sides, otherwise None.
            number: The conversion of a coefficient, a rational, to the numbers of the series.
        """
        terms = _taylor_coefficients(self, parameters, working_bits, order)
        if side is not None:  # -force(-x) on the other side
            terms = tuple(side ** (power + 1) * term for power, term in enumerate(terms, start=1))
        converted = tuple(number(term) for term in terms)
        return _Polynomial(self.name, self.force, self.two_sided, self.slope, converted)


class _Recorder:
    """A stand-in for a disk's parameters, all of value 1, that records which of them a function
    reads.
    """

    def __init__(self) -> None:
        self.names = {"m": None}  # every force is divided by the mass

    def __getattr__(self, name: str) -> float:
        if name not in FORCE_CONSTANTS:
            raise AttributeError(f"there is no constant '{name}': use m, g, mu, epsilon and pi")
        if name != "g":  # the field always has g
            self.names[name] = None
        return 1.0


@lru_cache(maxsize=64)
def constants_used(force: Callable[[Any, Any, Any], Any]) -> tuple[str, ...]:
    """Return the names of the parameters that a friction law's force reads, with m and
    without g.
    """
    recorder = _Recorder()
    force(math, 1.0, recorder)
    return tuple(recorder.names)


@lru_cache(maxsize=64)
def _taylor_coefficients(
    law: FrictionLaw, parameters: Any, working_bits: int, order: int
) -> tuple[Fraction, ...]:
    """Return Taylor coefficients of a friction law's deceleration at gamma_y = 0, for positive
    gamma_y.

    They belong to gamma_y, gamma_y^2, ... mpmath differentiates numerically, with as many bits as
    that needs. The coefficients of even powers are zero for a law that is analytic at zero.
    """
    finest = Fraction(parameters.epsilon)  # the force varies on the scale of epsilon
    spare = 64 + max(0, finest.denominator.bit_length() - finest.numerator.bit_length())
    ctx = precision_of_bits(working_bits + spare).context
    c = parameters.constants_in_context(ctx)
    terms = ctx.taylor(lambda x: -law.force(ctx, x, c) / c.m, 0, order)
    return tuple(
        Fraction(0) if power % 2 == 0 and not law.two_sided else fraction(terms[power])
        for power in range(1, order + 1)
    )


class _PaperLaw(FrictionLaw):
    """One of the paper's friction laws, whose formulas accept power series as they are."""

    has_guard = False

    def taylor_polynomial(self, *args: Any) -> FrictionLaw:
        return self


class _Linear(_PaperLaw):
    """The paper's linear friction law, Eq. lin_lambda_y_3DOF."""

    is_linear = True
    constants = ("k",)

    def deceleration(self, ops: Any, gamma_y: Any, c: Any, side: Any = None) -> Any:
        return c.k * gamma_y

    def deceleration_slope(self, ops: Any, gamma_y: Any, c: Any, side: Any = None) -> Any:
        return c.k

    def friction_term(
        self, ops: Any, c: Any, side: Any, w_y_gamma_y: Any, sin_b: Any, slip: Any, rho: Any
    ) -> Any:
        return c.k * w_y_gamma_y


class _SmoothCoulomb(_PaperLaw):
    """The paper's smooth Coulomb friction law, Eq. lambda_y_3DOF."""

    constants = ("traction", "epsilon")

    def _speed_plus_epsilon(self, gamma_y: Any, c: Any, side: Any) -> Any:
        return (abs(gamma_y) if side is None else side * gamma_y) + c.epsilon

    def deceleration(self, ops: Any, gamma_y: Any, c: Any, side: Any = None) -> Any:
        return c.traction * gamma_y / self._speed_plus_epsilon(gamma_y, c, side)

    def deceleration_slope(self, ops: Any, gamma_y: Any, c: Any, side: Any = None) -> Any:
        yielding = self._speed_plus_epsilon(gamma_y, c, side)
        return c.traction * c.epsilon / (yielding * yielding)

    def friction_term(
        self, ops: Any, c: Any, side: Any, w_y_gamma_y: Any, sin_b: Any, slip: Any, rho: Any
    ) -> Any:
        return c.traction * w_y_gamma_y / self._speed_plus_epsilon(sin_b * slip, c, side)


@dataclass(frozen=True)
class _Polynomial(FrictionLaw):
    """A friction law whose deceleration is a Taylor polynomial, for sliding velocities that are
    power series.
    """

    terms: tuple[Any, ...] = ()  #: the coefficients of gamma_y, gamma_y^2, ...

    def _sum(self, terms: tuple[Any, ...], sliding: Any) -> Any:
        """Return the polynomial terms[0] + terms[1] sliding + ... of a power series, up to the
        degree that the series keeps.

        For a law without sides every other term is zero, and the polynomial is in the square of
        ``sliding``.
        """
        step = 1 if self.two_sided else 2
        *lower, total = terms[: sliding.degree : step]
        variable = sliding if self.two_sided else sliding * sliding
        for term in reversed(lower):
            total = total * variable + term
        return total

    def deceleration(self, ops: Any, gamma_y: Any, c: Any, side: Any = None) -> Any:
        return gamma_y * self._sum(self.terms, gamma_y)

    def deceleration_slope(self, ops: Any, gamma_y: Any, c: Any, side: Any = None) -> Any:
        slopes = tuple(power * term for power, term in enumerate(self.terms, start=1))
        return self._sum(slopes, gamma_y)


#: The paper's laws by name.
LAWS: dict[str, FrictionLaw] = {
    "linear": _Linear("linear", lambda ops, gamma_y, c: -_default_slope(c) * gamma_y),
    "smooth": _SmoothCoulomb(
        "smooth",
        lambda ops, gamma_y, c: -c.mu * c.m * c.g * gamma_y / (abs(gamma_y) + c.epsilon),
        two_sided=True,
    ),
}


def law_of(friction: object) -> FrictionLaw:
    """Return the friction law of a name; a `FrictionLaw` is returned unchanged.

    Args:
        friction: ``linear``, ``smooth`` or a `FrictionLaw`.

    Raises:
        InputError: If there is no such law.
    """
    if isinstance(friction, FrictionLaw):
        return friction
    if not is_one_of(friction, LAWS):
        raise InputError(
            f"friction law '{short_text(friction)}' is not known: use linear or smooth, or a FrictionLaw"
        )
    return LAWS[friction]
