"""The six initial-value problems of the comparison."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache, partialmethod
from typing import Any, Literal

from tippedisk_verify.errors import InputError
from tippedisk_verify.flow.contract import Request
from tippedisk_verify.model.array_function import ArrayFunction
from tippedisk_verify.model.equations import vector_field
from tippedisk_verify.model.parameters import PRINTED, Parameters
from tippedisk_verify.numbers.exact import is_one_of, short_text
from tippedisk_verify.numbers.precision import DOUBLE
from tippedisk_verify.theory.hopf import omega_crit

__all__ = ["PROBLEMS", "ErrorKind", "Problem", "problem_named"]

#: What is measured: the state, or on a cycle the period, the crossing of the section or the
#: amplitude.
ErrorKind = Literal["state", "period", "crossing", "amplitude"]

_SAMPLES = 20  # per problem


@dataclass(frozen=True)
class Problem:
    """An initial-value problem for comparing integrators; all numbers are doubles,
    taken exactly.
    """

    name: str
    description: str
    parameters: Parameters
    omega: float  #: [rad/s]
    start: tuple[float, float, float]  #: beta, gamma [rad], v [rad/s]
    duration: float  #: [s]
    error: ErrorKind = "state"  #: what is measured at ``stops`` (`bench.truth`)
    #: Indices of the sample times at which separate runs end. The error of a single end might be
    #: near zero.
    stops: tuple[int, ...] = (5, 12, 19)
    spacing: float | None = None  #: [s] of the sample times, counted back from the end

    @property
    def friction(self) -> str:
        """The friction law's name."""
        return self.parameters.law.name

    @property
    def times(self) -> tuple[float, ...]:
        """The times [s] at which the problem's states are compared, including the end.

        They are 20 even ones, or one at each ``spacing``.
        """
        if self.spacing is not None:
            # A remainder that is only rounding is not a sample time.
            count = math.ceil(self.duration / self.spacing - 1e-6)
            return tuple(self.duration - n * self.spacing for n in reversed(range(count)))
        return (*(self.duration * n / _SAMPLES for n in range(1, _SAMPLES)), self.duration)

    @property
    def rhs(self) -> Callable[[object, Any], Any]:
        """The equations of motion as ``f(t, y)`` in NumPy, for `solve_ivp` and its like (Eq.
        3DOF).
        """
        return ArrayFunction(vector_field, self.parameters, self.omega)

    @property
    def scalar_rhs(self) -> Callable[[object, Any], Any]:
        """The function ``rhs(t, y)`` of ``source("python")``, the same object whenever the text is
        the same.
        """
        return _function(self.source("python"))

    def source(self, language: Language) -> str:
        """Return the equations of motion as a function ``rhs`` with all constants as numbers, to be
        compiled.

        The constants and the speed are those of this problem: each problem has a text of its own.

        Args:
            language: ``"python"`` for ``rhs(t, y)`` with ``math``'s functions. It returns a tuple,
                and numba compiles it as it is. ``"c"`` for ``void rhs(double t, const double *y,
                double *rates)`` with ``math.h``.

        Raises:
            InputError: If the language is another one.
        """
        if not is_one_of(language, _SOURCES):
            raise InputError(f"no source in '{short_text(language)}': use {' or '.join(_SOURCES)}")
        rates = vector_field(
            _SourceExpression, self.parameters.constants_in(DOUBLE), self.omega, self.friction
        )
        rows = rates(*(_SourceExpression(name) for name in ("beta", "gamma", "v")))
        return _SOURCES[language].format(*rows)

    def request(self, **options: Any) -> Request:
        """Return the problem as a request to an engine, with further options of `Request`."""
        return Request(
            self.parameters, self.omega, self.start, self.duration, domain="none", **options
        )


class _SourceExpression:
    """An expression that is built up as text by arithmetic, in the notation that Python and C
    share.
    """

    def __init__(self, text: str) -> None:
        self.text = text

    def __str__(self) -> str:
        return self.text

    def _joined(self, sign: str, other: object) -> _SourceExpression:
        return _SourceExpression(f"({self} {sign} {_number(other)})")

    def _joined_after(self, sign: str, other: object) -> _SourceExpression:
        return _SourceExpression(f"({_number(other)} {sign} {self})")

    __add__, __radd__ = partialmethod(_joined, "+"), partialmethod(_joined_after, "+")
    __sub__, __rsub__ = partialmethod(_joined, "-"), partialmethod(_joined_after, "-")
    __mul__, __rmul__ = partialmethod(_joined, "*"), partialmethod(_joined_after, "*")
    __truediv__, __rtruediv__ = partialmethod(_joined, "/"), partialmethod(_joined_after, "/")

    def __neg__(self) -> _SourceExpression:
        return _SourceExpression(f"(-{self})")

    def __abs__(self) -> _SourceExpression:
        return _SourceExpression(f"fabs({self})")

    @staticmethod
    def sin(angle: object) -> _SourceExpression:
        return _SourceExpression(f"sin({angle})")

    @staticmethod
    def cos(angle: object) -> _SourceExpression:
        return _SourceExpression(f"cos({angle})")


def _number(operand: object) -> str:
    return operand.text if isinstance(operand, _SourceExpression) else repr(float(operand))  # type: ignore[arg-type]


Language = Literal["python", "c"]
_SOURCES: dict[Language, str] = {
    "python": """from math import cos, fabs, sin


def rhs(t, y):
    beta, gamma, v = y[0], y[1], y[2]
    return {}, {}, {}
""",
    "c": """#include <math.h>

void rhs(double t, const double *y, double *rates) {{
    double beta = y[0], gamma = y[1], v = y[2];
    rates[0] = {};
    rates[1] = {};
    rates[2] = {};
}}
""",
}


@lru_cache(maxsize=16)
def _function(source: str) -> Callable[[object, Any], Any]:
    names: dict[str, Any] = {}
    exec(source, names)
    return names["rhs"]  # type: ignore[no-any-return]


def _with_epsilon(value: str) -> Parameters:
    return PRINTED.changed(epsilon=Fraction(value), name=f"epsilon {value}")


_HALF_PI = 1.5707963267948966
_OMEGA = float(omega_crit(PRINTED, 20).value - Fraction(1, 2))

PROBLEMS: tuple[Problem, ...] = (
    Problem(
        "cycle",
        "10 s near the limit cycle at 30.4 rad/s",
        PRINTED,
        30.4,
        (_HALF_PI, 3.27, -1.71),
        10.0,
    ),
    Problem(
        "transient",
        "0.3 s from far off the slow manifold onto it",
        PRINTED,
        _OMEGA,
        (1.3, 2.2, 6.0),
        0.3,
    ),
    Problem(
        "passage",
        "the passage by both saddles, 1e-8 above Omega_h",
        PRINTED,
        30.0488682707225,
        (_HALF_PI, _HALF_PI + 3.1415462925806426, -8.312208533583e-05),
        6.661564053801862,
    ),
    Problem(
        "smooth",
        "10 s near the limit cycle, smooth friction",
        PRINTED.with_friction("smooth"),
        30.4,
        (_HALF_PI, 3.27, -1.71),
        10.0,
    ),
    Problem(
        "epsilon-1e-3",
        "2 s with epsilon = 1e-3: rates of 1.3e4 per second",
        _with_epsilon("0.001"),
        _OMEGA,
        (_HALF_PI, 2.0, 0.0),
        2.0,
    ),
    Problem(
        "epsilon-1e-4",
        "0.2 s with epsilon = 1e-4: rates of 1.3e5 per second",
        _with_epsilon("0.0001"),
        _OMEGA,
        (_HALF_PI, 2.0, 0.0),
        0.2,
    ),
)


def problem_named(name: str) -> Problem:
    """Return the problem of the race with a name.

    Args:
        name: ``cycle``, ``transient``, ``passage``, ``smooth``, ``epsilon-1e-3`` or
            ``epsilon-1e-4``.

    Raises:
        InputError: If the name is not known.
    """
    by_name = {problem.name: problem for problem in PROBLEMS}
    if not is_one_of(name, by_name):
        raise InputError(f"problem '{short_text(name)}' is not known: use {', '.join(by_name)}")
    return by_name[name]
