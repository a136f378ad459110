"""Methods with a fixed step, as colleagues write them by hand, and what they get wrong in them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy

from tippedisk_verify.conformance.diagnosis.flights import Array, Field, Step, flown, runge_kutta

__all__ = ["MEMORY", "METHODS", "flights"]

Method = Callable[[Field, Array, float, int], Array]  #: (rates, states, duration, steps) -> states
_TINY = 1e-7
_NEWTON = 4  # iterations of an implicit step: with a difference quotient, of nearly second order
_RK4 = ((0.5,), (0.0, 0.5), (0.0, 0.0, 1.0), (1 / 6, 1 / 3, 1 / 3, 1 / 6))
_SLIPS = {
    "weights 1/4 each": (*_RK4[:3], (0.25,) * 4),
    "weights 1/8, 3/8, 3/8, 1/8": (*_RK4[:3], (1 / 8, 3 / 8, 3 / 8, 1 / 8)),
    "weights 1/3, 1/6, 1/6, 1/3": (*_RK4[:3], (1 / 3, 1 / 6, 1 / 6, 1 / 3)),
    "weights 1/6, 1/6, 1/3, 1/3": (*_RK4[:3], (1 / 6, 1 / 6, 1 / 3, 1 / 3)),
    "weights 1/6, 1/2, 1/6, 1/6": (*_RK4[:3], (1 / 6, 1 / 2, 1 / 6, 1 / 6)),
    "half a step to its last stage": (*_RK4[:2], (0.0, 0.0, 0.5), _RK4[3]),
    "its last stage from the second": (*_RK4[:2], (0.0, 1.0, 0.0), _RK4[3]),
    "its last stage from the first": (*_RK4[:2], (1.0, 0.0, 0.0), _RK4[3]),
    "its third stage from the first": (_RK4[0], (0.5, 0.0), *_RK4[2:]),
    "whole steps to all stages": ((1.0,), (0.0, 1.0), *_RK4[2:]),
    "a whole step to its second stage": ((1.0,), *_RK4[1:]),
    "a whole step to its third stage": (_RK4[0], (0.0, 1.0), *_RK4[2:]),
    "the sum of all slopes for its last stage": (*_RK4[:2], (1 / 3, 1 / 3, 1 / 3), _RK4[3]),
}  # fmt: skip


def _solved(f: Field, y: Array, known: Array, c: Any, guess: Array) -> Array:
    """The z with z = known + c f(z), by Newton's method with the derivative at y."""
    inverse, z = numpy.linalg.inv(numpy.eye(3) - numpy.moveaxis(c * _jacobian(f, y), 2, 0)), guess
    for _ in range(_NEWTON):
        z = z - numpy.einsum("nij,jn->in", inverse, z - known - c * f(z))
    return numpy.asarray(z)


def _jacobian(f: Field, y: Array) -> Array:
    slope = f(y)
    return numpy.stack([(f(y + _TINY * unit[:, None]) - slope) / _TINY for unit in numpy.eye(3)], axis=1)


def _implicit(theta: float) -> Step:
    """y + h (theta f(new) + (1 - theta) f(y)): implicit Euler, or the trapezoidal rule."""

    def step(f: Field, y: Array, h: Any) -> Array:
        slope = f(y)
        return _solved(f, y, y + (1 - theta) * h * slope, theta * h, y + h * slope)

    return step


def _linearly_implicit(f: Field, y: Array, h: Any) -> Array:
    inverse = numpy.linalg.inv(numpy.eye(3) - numpy.moveaxis(h * _jacobian(f, y), 2, 0))
    return numpy.asarray(y + h * numpy.einsum("nij,jn->in", inverse, f(y)))


def _friction_implicit(f: Field, y: Array, h: Any) -> Array:
    """Euler's step with the damping of v taken at its end."""
    slope = f(y)
    damping = (f(y + _TINY * numpy.eye(3)[2][:, None])[2] - slope[2]) / _TINY
    return numpy.asarray(y + h * numpy.stack([slope[0], slope[1], slope[2] / (1 - h * damping)]))


def _midpoint(f: Field, y: Array, h: Any) -> Array:
    return 2 * _implicit(1.0)(f, y, h / 2) - y


def _by_parts(first: str, drifting: bool, stale: bool) -> Step:
    """Euler's step for v, then beta with the new v, or the other way; gamma from the new or the ``stale`` beta."""

    def step(f: Field, y: Array, h: Any) -> Array:
        slope = f(y)
        z = y + h * slope
        if first == "v":
            z[0] = y[0] + h * z[2]
            if drifting:
                z[0] -= h * h / 2 * slope[2]
        else:
            z[2] = y[2] + h * f(numpy.stack([z[0], z[1], y[2]]))[2]
        if not stale:
            z[1] = y[1] + h * f(z)[1]
        return numpy.asarray(z)

    return step


def _verlet(predicted: bool) -> Step:
    """Beta to second order, then gamma and v by the mean of their rates; with Euler's gamma and v at the end or not."""

    def step(f: Field, y: Array, h: Any) -> Array:
        slope = f(y)
        z = y + h * slope if predicted else y.copy()
        z[0] = y[0] + h * y[2] + h * h / 2 * slope[2]
        z[1] = y[1] + h / 2 * (slope[1] + f(z)[1])
        z[2] = y[2] + h / 2 * (slope[2] + f(z)[2])
        return z

    return step


def _leapfrog(first: str) -> Step:
    """Half a step of v, a whole one of the angles, half a step of v; or half a step of beta first."""

    def step(f: Field, y: Array, h: Any) -> Array:
        z, slope = y.copy(), f(y)
        if first == "v":
            z[2] = y[2] + h / 2 * slope[2]
            z[0] = y[0] + h * z[2]
            z[1] = y[1] + h / 2 * (slope[1] + f(z)[1])
            z[2] = z[2] + h / 2 * f(z)[2]
        else:
            z[0] = y[0] + h / 2 * y[2]
            z[1] = y[1] + h * f(z)[1]
            z[2] = y[2] + h * f(z)[2]
            z[0] = z[0] + h / 2 * z[2]
        return z

    return step


def _frozen(row: int, inner: Step) -> Step:
    """One rate is that of the step's begin throughout."""

    def step(f: Field, y: Array, h: Any) -> Array:
        kept = f(y)[row]

        def held(z: Array) -> Array:
            rates = f(z)
            rates[row] = kept
            return rates

        return inner(held, y, h)

    return step


METHODS: dict[str, Step] = {
    "explicit Euler": runge_kutta(((1.0,),)),
    "the midpoint rule": runge_kutta(((0.5,), (0.0, 1.0))),
    "Heun's method": runge_kutta(((1.0,), (0.5, 0.5))),
    "Ralston's method": runge_kutta(((2 / 3,), (0.25, 0.75))),
    "Kutta's third-order method": runge_kutta(((0.5,), (-1.0, 2.0), (1 / 6, 2 / 3, 1 / 6))),
    "Heun's third-order method": runge_kutta(((1 / 3,), (0.0, 2 / 3), (0.25, 0.0, 0.75))),
    "the third-order method of Bogacki and Shampine": runge_kutta(((0.5,), (0.0, 0.75), (2 / 9, 1 / 3, 4 / 9))),
    "the third-order method of Shu and Osher": runge_kutta(((1.0,), (0.25, 0.25), (1 / 6, 1 / 6, 2 / 3))),
    "RK4": runge_kutta(_RK4),
    "Kutta's 3/8 rule": runge_kutta(((1 / 3,), (-1 / 3, 1.0), (1.0, -1.0, 1.0), (1 / 8, 3 / 8, 3 / 8, 1 / 8))),
    "implicit Euler": _implicit(1.0),
    "the trapezoidal rule": _implicit(0.5),
    "the implicit midpoint rule": _midpoint,
    "the linearly implicit (Rosenbrock) Euler method": _linearly_implicit,
    "Euler's method with v's damping implicit": _friction_implicit,
    "the velocity Verlet method": _verlet(False),
    "the velocity Verlet method with a predicted v": _verlet(True),
    **{f"the leapfrog method, half a step of {first} first": _leapfrog(first) for first in ("v", "beta")},
    **{
        f"semi-implicit Euler, {'v' if first == 'v' else 'beta'} first{', gamma from the old beta' * stale}":
            _by_parts(first, False, stale)
        for first in ("v", "beta") for stale in (False, True)
    },
    "Euler's method with beta to second order": _by_parts("v", True, True),
    **{
        f"RK4 with {name}' of the step's begin in all stages": _frozen(row, runge_kutta(_RK4))
        for row, name in enumerate(("beta", "gamma"))
    },
    **{f"RK4 with a slip, {text}": runge_kutta(table) for text, table in _SLIPS.items()},
}  # fmt: skip
#: Weights of the rates now and before, and of the rate at the step's end if it is corrected.
_ADAMS = {
    "the Adams-Bashforth method of two steps": (1.5, -0.5), "that of three steps": (23 / 12, -4 / 3, 5 / 12),
    "that of four steps": (55 / 24, -59 / 24, 37 / 24, -9 / 24),
}  # fmt: skip
_EVERY = (2, 4, 5, 10, 20)  # steps to the next output, at which a method forgets


def _adams(name: str, every: int, corrected: bool) -> Method:
    """After steps of RK4, or of Euler's method, at the start or after each output."""
    weights = _ADAMS[name.split(" after")[0]]
    start = runge_kutta(_RK4) if name.endswith("RK4") else runge_kutta(((1.0,),))

    def flight(f: Field, y: Array, duration: float, count: int) -> Array:
        h, slopes = duration / count, list[Array]()
        for n in range(count):
            slopes = [] if every and n % every == 0 else slopes
            slopes = [f(y), *slopes][: len(weights)]
            if len(slopes) == len(weights):
                moved = y + h * sum(b * k for b, k in zip(weights, slopes, strict=True))
                y = y + h / 2 * (slopes[0] + f(moved)) if corrected else moved
            else:
                y = start(f, y, h)
        return y

    return flight


def _backward(f: Field, y: Array, duration: float, count: int) -> Array:
    """The backward differentiation formula of second order, after a step of implicit Euler."""
    h, before = duration / count, None
    for _ in range(count):
        if before is None:
            z = _implicit(1.0)(f, y, h)
        else:
            z = _solved(f, y, (4 * y - before) / 3, 2 * h / 3, 2 * y - before)
        before, y = y, z
    return y


#: Methods that use earlier steps.
MEMORY: dict[str, Method] = {
    **{
        f"{name} after {start}{f', which starts anew every {every} steps' * (every > 0)}":
            _adams(f"{name} after {start}", every, False)
        for name in _ADAMS for start in ("Euler", "RK4") for every in (0, *_EVERY)
        if not every or "two steps" in name
    },
    "the predictor and corrector of Adams, of two steps": _adams("the Adams-Bashforth method of two steps", 0, True),
    "BDF2 after implicit Euler": _backward,
}  # fmt: skip


def flights(name: str, f: Field, y: Array, duration: float, count: int) -> Array:
    """The states after so many steps; NaN where the method blows up."""
    with numpy.errstate(all="ignore"):
        if name in MEMORY:
            return MEMORY[name](f, y, duration, count)
        return flown(f, y, duration, count, METHODS[name])
