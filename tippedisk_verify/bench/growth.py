"""How cost grows: with the digits asked for, and as epsilon tends to 0 for the full and the reduced equations."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from fractions import Fraction
from functools import partial
from itertools import pairwise
from typing import Any

from tippedisk_verify.bench.problems import problem_named
from tippedisk_verify.flow.contract import Request
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.model.precision import bits, bits_for_digits
from tippedisk_verify.orbits.heteroclinic import heteroclinic
from tippedisk_verify.orbits.periodic import limit_cycle
from tippedisk_verify.orbits.reduced_flow import ReducedFlow

__all__ = ["Growth", "break_even", "digits_growth", "epsilon_growth", "exponent"]

_DIGITS = (15, 20, 30, 50, 70, 100)
_EPSILONS = ("0.1", "0.01", "0.001", "0.0001", "0.00001")
_SPAN = 0.05  # s of motion
_LONG = 3.0  # s
_BEYOND = 30  # digits from which on the arithmetic, not the overhead, sets the cost


@dataclass(frozen=True)
class Growth:
    """Warm seconds against the quantity that grows, and the exponent fitted to the last points."""

    what: str
    against: str  #: digits or epsilon
    points: tuple[tuple[float, float], ...]  #: (quantity, median seconds)
    exponent: float

    def json(self) -> dict[str, Any]:
        return asdict(self)


def exponent(points: Sequence[tuple[float, float]]) -> float:
    """The slope of log(seconds) against log(quantity), by least squares."""
    x, y = ([math.log(point[part]) for point in points] for part in (0, 1))
    middle = statistics.fmean(x)
    high = statistics.fmean(y)
    return sum((a - middle) * (b - high) for a, b in zip(x, y, strict=True)) / sum((a - middle) ** 2 for a in x)


def _warm(job: Callable[[], Any], repeats: int, engine: Taylor) -> float:
    """Median of repeats after a first run. If that is long, it counts itself, without what the engine built in it."""
    times: list[float] = []
    built = _building(engine)
    while len(times) <= repeats:
        begin = time.perf_counter()
        job()
        times.append(time.perf_counter() - begin)
        if len(times) == 1 and (alone := times[0] - (_building(engine) - built)) > _LONG:
            return alone
    return statistics.median(times[1:])


def _building(engine: Taylor) -> float:
    return sum(build.seconds for build in engine.builds)


def digits_growth(advance: Callable[[str, int], None] = lambda label, steps: None) -> list[Growth]:
    """Trajectory (the transient problem), limit cycle and Omega_h from 15 to 100 digits."""
    engine = Taylor()
    problem = problem_named("transient")
    guess = (1.716, -1.71)

    def trajectory(digits: int) -> Callable[[], Any]:
        request = problem.request(precision=bits(bits_for_digits(digits)))
        return lambda: engine(request)

    jobs: dict[str, Callable[[int], Callable[[], Any]]] = {
        "trajectory": trajectory,
        "limit cycle": lambda digits: (
            lambda: limit_cycle(PRINTED, Fraction(problem.omega), engine, digits=digits, guess=guess)
        ),
        "Omega_h": lambda digits: lambda: heteroclinic(PRINTED, engine, digits=digits),
    }
    growths = []
    for what, job in jobs.items():
        points = []
        for digits in _DIGITS:
            advance(f"{what} at {digits} digits", 0)
            points.append((float(digits), _warm(job(digits), 3, engine)))
        growths.append(Growth(what, "digits", tuple(points), exponent([p for p in points if p[0] >= _BEYOND])))
    return growths


def epsilon_growth() -> list[Growth]:
    """0.05 s of motion from the slow manifold's neighbourhood: full equations to 1e-12, reduced flows of order 1, 2."""
    engine = Taylor()
    omega, start = problem_named("transient").omega, (1.4, 1.9, 0.0)
    reduced = {order: ReducedFlow(order, 1e-12) for order in (1, 2)}
    points: dict[str, list[tuple[float, float]]] = {"full": [], "reduced, order 1": [], "reduced, order 2": []}
    for text in _EPSILONS:
        parameters = PRINTED.changed(epsilon=text)
        request = Request(parameters, omega, start, _SPAN, tolerance=1e-12, domain="none", max_steps=10_000_000)
        points["full"].append((float(text), _warm(partial(engine, request), 5, engine)))
        for order, flow in reduced.items():
            job = partial(flow, parameters, omega, start[:2], _SPAN)
            points[f"reduced, order {order}"].append((float(text), _warm(job, 5, engine)))
    return [Growth(what, "epsilon", tuple(here), exponent(here[2:])) for what, here in points.items()]


def break_even(full: Growth, reduced: Growth) -> float | None:
    """The epsilon below which the reduced flow is the faster one, on straight lines between the points.

    The largest epsilon measured if it is faster everywhere, None if it is so nowhere.
    """
    ratios = [(x, math.log(a / b)) for (x, a), (_, b) in zip(full.points, reduced.points, strict=True)]
    if ratios[0][1] >= 0:
        return ratios[0][0]
    for (x, before), (next_x, after) in pairwise(ratios):
        if before < 0 <= after:
            share = -before / (after - before)
            return math.exp(math.log(x) + share * (math.log(next_x) - math.log(x)))
    return None
