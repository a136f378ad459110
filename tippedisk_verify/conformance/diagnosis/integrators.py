"""The errors of integrators: methods with a fixed step, and SciPy's at tolerances."""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.entries import Array
from tippedisk_verify.conformance.diagnosis.orbits import ROUND, STATE, Flights, Rates, State
from tippedisk_verify.conformance.diagnosis.trees import Cause

__all__ = ["integrator_errors"]

Step = Callable[[Rates, float, State], State]
_LEAVES = 1e-3  # of the errors: what a method with a fixed step may leave
_SOLVER_LEAVES = 0.02  # of the errors: what one of SciPy's may leave
_SIZES = 10.0  # times
_EVALUATIONS = 60_000
_STEEPEST = 6.0  # the order that no method exceeds
_LOST = (math.nan, math.nan, math.nan)
_RELATIVE = (1e-3, 1e-6, *(10.0**-k for k in (2, 4, 5, 7, 8, 9, 10)), 1.49012e-8)
_TIGHT = (1e-13, 1e-12, 1e-10)
_FIRSTS = (0.01, 2e-3, 0.0, 0.1, 0.05, 0.02, 5e-3, 1e-3, 5e-4, 1e-4)  # s, to the first output; 0: the sample
_SOLVERS = ("odeint", "RK45", "RK23", "LSODA", "BDF", "Radau", "DOP853")


def _moved(y: State, h: float, k: State) -> State:
    return y[0] + h * k[0], y[1] + h * k[1], y[2] + h * k[2]


def _runge_kutta(stages: Sequence[Sequence[float]], weights: Sequence[float]) -> Step:
    rows = [[(n, a) for n, a in enumerate(row) if a] for row in stages]
    shares = [(n, a / sum(weights)) for n, a in enumerate(weights) if a]

    def step(f: Rates, h: float, y: State) -> State:
        slopes: list[State] = []
        for row in rows:
            z = y
            for n, a in row:
                z = _moved(z, a * h, slopes[n])
            slopes.append(f(*z))
        for n, a in shares:
            y = _moved(y, a * h, slopes[n])
        return y

    return step


def _implicit(share: float) -> Step:
    """The slope at the end, and a share of that at the begin, by iteration."""

    def step(f: Rates, h: float, y: State) -> State:
        known, z = _moved(y, share * h, f(*y)), _moved(y, h, f(*y))
        for _ in range(40):
            last, z = z, _moved(known, (1 - share) * h, f(*z))
            if max(abs(a - b) for a, b in zip(z, last, strict=True)) < 1e-13:
                break
        return z

    return step


def _in_turn(*groups: tuple[int, ...]) -> Step:
    """Euler's method with some variables advanced by those that were advanced before."""

    def step(f: Rates, h: float, y: State) -> State:
        z = y
        for group in groups:
            k = f(*z)
            z = tuple(y[n] + h * k[n] if n in group else z[n] for n in range(3))  # type: ignore[assignment]
        return z

    return step


_SECOND = ((), (0.5,), (0, 0.5), (0, 0, 1))  # RK4's stages
_METHODS: dict[str, Step] = {
    "explicit Euler": _runge_kutta(((),), (1,)),
    "semi-implicit Euler, v first": _in_turn((2,), (0, 1)),
    "semi-implicit Euler, angles first": _in_turn((0, 1), (2,)),
    "the midpoint rule": _runge_kutta(((), (0.5,)), (0, 1)),
    "Heun's method": _runge_kutta(((), (1,)), (1, 1)),
    "the trapezoidal rule": _implicit(0.5),
    "implicit Euler": _implicit(0.0),
    "RK4": _runge_kutta(_SECOND, (1, 2, 2, 1)),
    "RK4 with the third stage at a full step": _runge_kutta(((), (0.5,), (0, 1), (0, 0, 1)), (1, 2, 2, 1)),
    "RK4 with k2 for k3 in the sum (k3 missing)": _runge_kutta(_SECOND, (1, 4, 0, 1)),
    "RK4 with k3 for k2 in the sum (k2 missing)": _runge_kutta(_SECOND, (1, 0, 4, 1)),
    "RK4 with k1 for k4 in the sum (k4 missing)": _runge_kutta(_SECOND, (2, 2, 2, 0)),
    "RK4 with the weights 1, 1, 1, 1": _runge_kutta(_SECOND, (1, 1, 1, 1)),
}


@dataclass(frozen=True)
class _Sample:
    """The first sample of an entry."""

    rates: Rates
    start: State
    time: float
    truth: Array
    error: Array

    def off(self, way: Callable[..., Any], *settings: Any) -> tuple[float, float]:
        """How much of the errors a method leaves, and how large its own are, both by their size."""
        try:
            made = np.asarray(way(self, *settings)) - self.truth
        except (ArithmeticError, ValueError):
            return math.inf, math.inf
        size = float(np.linalg.norm(self.error))
        found = float(np.linalg.norm(made - self.error)) / size, float(np.linalg.norm(made)) / size
        return found if np.isfinite(made).all() else (math.inf, math.inf)


def _stepped(sample: _Sample, step: Step, h: float) -> State:
    y, count = sample.start, max(1, math.ceil(sample.time / h - 1e-9))
    for _ in range(count):
        y = step(sample.rates, sample.time / count, y)
    return y


def _solved(sample: _Sample, name: str, relative: float, absolute: float, run: float) -> Any:
    """SciPy's: odeint, whose first step depends on its first output, or a class, whose depends on the run's end."""
    from scipy import integrate

    def rates(t: float, y: Any) -> State:
        return sample.rates(*y.tolist())

    tolerances = {"rtol": relative, "atol": absolute}
    if name == "odeint":
        times = [0.0, run, sample.time] if 0 < run < sample.time else [0.0, sample.time]
        return integrate.odeint(rates, sample.start, times, tfirst=True, **tolerances)[-1]
    solver = getattr(integrate, name)(rates, 0.0, sample.start, run or sample.time, **tolerances)
    while solver.status == "running" and solver.t < sample.time:
        solver.step()
    return solver.dense_output()(sample.time) if solver.status != "failed" else _LOST


def integrator_errors(flights: Flights) -> list[Cause]:
    """Methods whose own errors are those of the first samples; of these the largest come first."""
    sheet, samples = flights.sheet, []
    for k in range(len(flights.spots)):
        here = (flights.entry == k) & np.isin(flights.stem, STATE)
        time = float(flights.place[here].min(initial=math.inf))
        if cells := flights.sample(k, time):
            error = (sheet.answer - sheet.truth)[cells]
            samples.append(_Sample(flights.rates(k), flights.start(k), time, sheet.truth[cells], error))
    samples = [one for one in samples if one.error.any()]
    samples.sort(key=lambda sample: -float(np.linalg.norm(sample.error)))
    if len(samples) < 3 or not 1e-9 <= np.abs(samples[0].error).max() <= 1:
        return []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        text = _fixed(samples) or _adaptive(samples)
    return [Cause(f"the integrator's errors: {text}", 2, name="integrator")] if text else []


def _fixed(samples: Sequence[_Sample]) -> str:
    first = samples[0]
    for name, step in _METHODS.items():
        size, before = 0.0, 1.0
        for h in (h for h in ROUND if h < first.time / 4 and 3 * first.time / h < _EVALUATIONS):
            if 1 < size * (h / before) ** _STEEPEST < math.inf:  # too far off still
                continue
            left, size = first.off(_stepped, step, h)
            if left < _LEAVES and all(one.off(_stepped, step, h)[0] < 5 * _LEAVES for one in samples):
                return f"too long a step, {name} at a fixed step of {1000 * h:.6g} ms"
            if size < 0.2:
                break
            before = h
    return ""


def _adaptive(samples: Sequence[_Sample]) -> str:
    for name, relative in itertools.product(_SOLVERS, _RELATIVE):
        runs = _FIRSTS if name == "odeint" else (10.0, 0.0)
        size = samples[0].off(_solved, name, relative, relative, runs[0])[1]
        if not 1 / _SIZES < size < _SIZES:
            continue
        others = (relative, 1e-6, *(relative * 10.0**k for k in (-1, -2, -3, 1, 2)), 1e-8, *_TIGHT)
        tolerances = [*((relative, one) for one in others), *((tight, relative) for tight in _TIGHT)]
        for pair, run in itertools.product(dict.fromkeys(tolerances), runs):
            if _same(samples, name, *pair, run):
                return f"a loose tolerance, SciPy's {name} at rtol = {pair[0]:g}, atol = {pair[1]:g}"
    return ""


def _same(samples: Sequence[_Sample], *settings: Any) -> bool:
    """Whether a solver's errors are those of most samples: rounding may change a step."""
    missed = 0
    for n, sample in enumerate(samples):
        left, size = sample.off(_solved, *settings)
        missed += left > _SOLVER_LEAVES
        if not 1 / _SIZES < size < _SIZES or missed > 0.4 * len(samples) or missed > n == 1:
            return False
    return True
