"""The errors of integrators: methods with a fixed step, and SciPy's at tolerances."""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.entries import Array
from tippedisk_verify.conformance.diagnosis.orbits import ROUND, STATE, Flights, Rates, State
from tippedisk_verify.conformance.diagnosis.search import Search
from tippedisk_verify.conformance.diagnosis.trees import Cause

__all__ = ["Integrators"]

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


def moved(y: State, h: float, k: State) -> State:
    return y[0] + h * k[0], y[1] + h * k[1], y[2] + h * k[2]


def runge_kutta(stages: Sequence[Sequence[float]], weights: Sequence[float]) -> Step:
    rows = [[(n, a) for n, a in enumerate(row) if a] for row in stages]
    shares = [(n, a / sum(weights)) for n, a in enumerate(weights) if a]

    def step(f: Rates, h: float, y: State) -> State:
        slopes: list[State] = []
        for row in rows:
            z = y
            for n, a in row:
                z = moved(z, a * h, slopes[n])
            slopes.append(f(*z))
        for n, a in shares:
            y = moved(y, a * h, slopes[n])
        return y

    return step


def implicit(share: float) -> Step:
    """The slope at the end, and a share of that at the begin, by iteration."""

    def step(f: Rates, h: float, y: State) -> State:
        known, z = moved(y, share * h, f(*y)), moved(y, h, f(*y))
        for _ in range(40):
            last, z = z, moved(known, (1 - share) * h, f(*z))
            if max(abs(a - b) for a, b in zip(z, last, strict=True)) < 1e-13:
                break
        return z

    return step


def in_turn(*groups: tuple[int, ...]) -> Step:
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
    "explicit Euler": runge_kutta(((),), (1,)),
    "semi-implicit Euler, v first": in_turn((2,), (0, 1)),
    "semi-implicit Euler, angles first": in_turn((0, 1), (2,)),
    "the midpoint rule": runge_kutta(((), (0.5,)), (0, 1)),
    "Heun's method": runge_kutta(((), (1,)), (1, 1)),
    "the trapezoidal rule": implicit(0.5),
    "implicit Euler": implicit(0.0),
    "RK4": runge_kutta(_SECOND, (1, 2, 2, 1)),
    "RK4 with the third stage at a full step": runge_kutta(((), (0.5,), (0, 1), (0, 0, 1)), (1, 2, 2, 1)),
    "RK4 with k2 for k3 in the sum (k3 missing)": runge_kutta(_SECOND, (1, 4, 0, 1)),
    "RK4 with k3 for k2 in the sum (k2 missing)": runge_kutta(_SECOND, (1, 0, 4, 1)),
    "RK4 with k1 for k4 in the sum (k4 missing)": runge_kutta(_SECOND, (2, 2, 2, 0)),
    "RK4 with the weights 1, 1, 1, 1": runge_kutta(_SECOND, (1, 1, 1, 1)),
}


@dataclass(frozen=True)
class Lane:
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


def stepped(lane: Lane, step: Step, h: float) -> State:
    y, count = lane.start, max(1, math.ceil(lane.time / h - 1e-9))
    for _ in range(count):
        y = step(lane.rates, lane.time / count, y)
    return y


def solved(lane: Lane, name: str, relative: float, absolute: float, run: float) -> Any:
    """SciPy's: odeint, whose first step depends on its first output, or a class, whose depends on the run's end."""
    from scipy import integrate

    def rates(t: float, y: Any) -> State:
        return lane.rates(*y.tolist())

    tolerances = {"rtol": relative, "atol": absolute}
    if name == "odeint":
        times = [0.0, run, lane.time] if 0 < run < lane.time else [0.0, lane.time]
        return integrate.odeint(rates, lane.start, times, tfirst=True, **tolerances)[-1]
    solver = getattr(integrate, name)(rates, 0.0, lane.start, run or lane.time, **tolerances)
    while solver.status == "running" and solver.t < lane.time:
        solver.step()
    return solver.dense_output()(lane.time) if solver.status != "failed" else _LOST


@dataclass(eq=False)
class Integrators:
    """Methods whose own errors are those of the first samples."""

    search: Search
    flights: Flights

    @cached_property
    def lanes(self) -> list[Lane]:
        """Those whose errors are largest first."""
        sheet, flights, found = self.search.sheet, self.flights, []
        for k in range(len(flights.spots)):
            time = float(flights.place[(flights.entry == k) & np.isin(flights.stem, STATE)].min(initial=math.inf))
            if cells := flights.sample(k, time):
                error = (sheet.answer - sheet.truth)[cells]
                found.append(Lane(flights.rates(k), flights.inputs(k)[3], time, sheet.truth[cells], error))
        return sorted((one for one in found if one.error.any()), key=lambda lane: -float(np.linalg.norm(lane.error)))

    def causes(self) -> list[Cause]:
        if len(self.lanes) < 3 or np.abs(self.lanes[0].error).max() > 1 or np.abs(self.lanes[0].error).max() < 1e-9:
            return []
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            text = self.fixed() or self.adaptive()
        return [Cause(f"the integrator's errors: {text}", 2, name="integrator")] if text else []

    def fixed(self) -> str:
        lane = self.lanes[0]
        for name, step in _METHODS.items():
            size, before = 0.0, 1.0
            for h in (h for h in ROUND if h < lane.time / 4 and 3 * lane.time / h < _EVALUATIONS):
                if 1 < size * (h / before) ** _STEEPEST < math.inf:  # too far off still
                    continue
                left, size = lane.off(stepped, step, h)
                if left < _LEAVES and all(one.off(stepped, step, h)[0] < 5 * _LEAVES for one in self.lanes):
                    return f"too long a step, {name} at a fixed step of {1000 * h:.6g} ms"
                if size < 0.2:
                    break
                before = h
        return ""

    def adaptive(self) -> str:
        for name, relative in itertools.product(_SOLVERS, _RELATIVE):
            runs = _FIRSTS if name == "odeint" else (10.0, 0.0)
            size = self.lanes[0].off(solved, name, relative, relative, runs[0])[1]
            if not 1 / _SIZES < size < _SIZES:
                continue
            others = (relative, 1e-6, *(relative * 10.0**k for k in (-1, -2, -3, 1, 2)), 1e-8, *_TIGHT)
            tolerances = [*((relative, one) for one in others), *((tight, relative) for tight in _TIGHT)]
            for pair, run in itertools.product(dict.fromkeys(tolerances), runs):
                if self.same(name, *pair, run):
                    return f"a loose tolerance, SciPy's {name} at rtol = {pair[0]:g}, atol = {pair[1]:g}"
        return ""

    def same(self, name: str, *settings: float) -> bool:
        """Whether most entries have these errors: rounding may change a step."""
        missed = 0
        for n, lane in enumerate(self.lanes):
            left, size = lane.off(solved, name, *settings)
            missed += left > _SOLVER_LEAVES
            if not 1 / _SIZES < size < _SIZES or missed > 0.4 * len(self.lanes) or missed > n == 1:
                return False
        return True
