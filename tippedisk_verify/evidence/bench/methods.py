"""What is raced: each method prepared for a problem at a setting, as something that runs and says how it went."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from tippedisk_verify.evidence.bench.problems import Problem
from tippedisk_verify.flow.baseline import Baseline
from tippedisk_verify.flow.contract import Request, Result, Status
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.parameters import Constants
from tippedisk_verify.model.precision import DOUBLE, EXTENDED, QUADRUPLE, Precision, bits, heyoka_module

__all__ = ["METHODS", "Method", "Outcome", "Prepared", "compiled_rates"]

_TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
_ODEFUN_SECONDS = 2.0


@dataclass(frozen=True)
class Outcome:
    """What a run gave: samples as far as it came, and what it cost beside time."""

    status: str  #: reached, or why not
    samples: Any  #: (n, 3) at the problem's times, in any arithmetic; fewer if it broke off
    steps: int | None = None
    evaluations: int | None = None  #: of the right-hand side


@dataclass(frozen=True)
class Prepared:
    """A method set up for a problem: ``run`` only goes to the end, ``sampled`` gives the samples too."""

    run: Callable[[], Any]
    sampled: Callable[[], Outcome]


@dataclass(frozen=True)
class Method:
    """A competitor. ``prepare`` does what is done once: compiling, allocating."""

    name: str
    family: str  #: heyoka, scipy, mpmath, reduced, or the peer's name
    settings: tuple[Any, ...]  #: loosest first
    prepare: Callable[[Problem, Any], Prepared]
    fits: Callable[[Problem], bool] = lambda problem: True

    def label(self, setting: Any) -> str:
        return f"{setting:.0e}" if isinstance(setting, float) else str(setting)


def _by_engine(engine: Any, problem: Problem, **options: Any) -> Prepared:
    plain: Request = problem.request(**options)
    precision: Precision = plain.precision
    times = precision.array(problem.times)
    sampling: Request = problem.request(times=times, **options)

    def sampled() -> Outcome:
        result: Result = engine(sampling)
        status = "reached" if result.status is Status.REACHED else result.status.value
        samples = [] if result.samples is None else result.samples
        steps = result.steps or engine(plain).steps
        return Outcome(status, samples, steps, result.evaluations)

    return Prepared(lambda: engine(plain), sampled)


def _taylor(problem: Problem, tolerance: float) -> Prepared:
    return _by_engine(Taylor(), problem, tolerance=tolerance)


def _taylor_accurate(problem: Problem, tolerance: float) -> Prepared:
    return _by_engine(Taylor(high_accuracy=True), problem, tolerance=tolerance)


_PRECISIONS = {"extended": EXTENDED, "quadruple": QUADRUPLE, "50 digits": bits(170)}


def _taylor_beyond_double(problem: Problem, precision: str) -> Prepared:
    return _by_engine(Taylor(), problem, precision=_PRECISIONS[precision])


def _scipy(method: str) -> Callable[[Problem, float], Prepared]:
    return lambda problem, tolerance: _by_engine(Baseline(method), problem, tolerance=tolerance)


def compiled_rates(problem: Problem) -> Callable[[float, Any], Any]:
    """The linear law's right-hand side as machine code, for packages that call it from Python."""
    import numpy

    from tippedisk_verify.model.equations import field

    hy = heyoka_module()
    state = hy.make_vars("beta", "gamma", "v")
    constants = Constants(*map(float, problem.parameters.rational()))
    rates = field(hy, constants, problem.omega, "linear")(*state)
    function = hy.cfunc(list(rates), list(state))
    return lambda t, y: function(numpy.ascontiguousarray(y))


def compiled_jacobian(problem: Problem) -> Callable[[float, Any], Any]:
    """Its Jacobian likewise."""
    import numpy

    from tippedisk_verify.model.equations import jacobian

    hy = heyoka_module()
    state = hy.make_vars("beta", "gamma", "v")
    constants = Constants(*map(float, problem.parameters.rational()))
    rows = jacobian(hy, constants, problem.omega, "linear")(*state)
    function = hy.cfunc([hy.expression(0.0) + entry for row in rows for entry in row], list(state))
    return lambda t, y: function(numpy.ascontiguousarray(y)).reshape(3, 3)


def _scipy_compiled(method: str) -> Callable[[Problem, float], Prepared]:
    def prepare(problem: Problem, tolerance: float) -> Prepared:
        from scipy.integrate import solve_ivp

        rates = compiled_rates(problem)
        options = {"jac": compiled_jacobian(problem)} if method in ("LSODA", "Radau", "BDF") else {}

        def solve(times: Any = None) -> Any:
            span = (0.0, problem.duration)
            return solve_ivp(
                rates, span, problem.start, method=method, rtol=tolerance, atol=tolerance, t_eval=times, **options
            )

        def sampled() -> Outcome:
            solution = solve(problem.times)
            status = "reached" if solution.status == 0 else str(solution.message)
            return Outcome(status, solution.y.T, None, int(solution.nfev))

        return Prepared(solve, sampled)

    return prepare


def _odefun(problem: Problem, digits: int) -> Prepared:
    """mpmath's Taylor series method, given up after some seconds; it has no tolerance but the working precision."""

    def sampled() -> Outcome:
        import mpmath

        from tippedisk_verify.model.equations import field

        begin = time.perf_counter()
        found: list[Any] = []
        with mpmath.workdps(digits):
            constants = Constants(*(mpmath.mpf(v.numerator) / v.denominator for v in problem.parameters.rational()))
            rates = field(mpmath, constants, mpmath.mpf(problem.omega), problem.friction)
            solution = mpmath.odefun(lambda t, y: list(rates(*y)), 0, [mpmath.mpf(part) for part in problem.start])
            for moment in problem.times:
                if time.perf_counter() - begin > _ODEFUN_SECONDS:
                    return Outcome(f"unfinished after {_ODEFUN_SECONDS:g} s", found)
                found.append([+part for part in solution(mpmath.mpf(moment))])
        return Outcome("reached", found)

    return Prepared(sampled, sampled)


def _reduced(problem: Problem, order: int) -> Prepared:
    """beta and gamma only; v is what the manifold has there."""
    import math

    import numpy

    from tippedisk_verify.orbits.reduced_flow import ReducedFlow
    from tippedisk_verify.theory.slow_manifold import orders

    flow = ReducedFlow(order)
    constants = problem.parameters.at(DOUBLE)
    begin = (problem.start[0], problem.start[1])

    def sampled() -> Outcome:
        times = numpy.array(problem.times)
        status, _, samples = flow(problem.parameters, problem.omega, begin, problem.duration, times)
        rows = []
        for beta, gamma in samples.tolist():
            series = orders(math, constants, problem.omega, beta, gamma, order)
            rows.append([beta, gamma, sum(h * constants.epsilon**n for n, h in enumerate(series))])
        return Outcome("reached" if status is Status.REACHED else status.value, rows)

    return Prepared(lambda: flow(problem.parameters, problem.omega, begin, problem.duration), sampled)


def _linear(problem: Problem) -> bool:
    return problem.friction == "linear"


METHODS: tuple[Method, ...] = (
    Method("taylor", "heyoka", (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-12, 1e-13, 1e-15), _taylor),
    Method("taylor, high accuracy", "heyoka", (1e-13, 1e-15), _taylor_accurate),
    Method("taylor beyond double", "heyoka", ("extended", "quadruple", "50 digits"), _taylor_beyond_double),
    *(
        Method(f"scipy {name}", "scipy", _TOLERANCES, _scipy(name))
        for name in ("RK45", "DOP853", "LSODA", "Radau", "BDF")
    ),
    *(
        Method(f"scipy {name}, compiled", "scipy", _TOLERANCES, _scipy_compiled(name), _linear)
        for name in ("DOP853", "LSODA")
    ),
    Method("mpmath odefun", "mpmath", (20,), _odefun, _linear),
    Method("reduced flow, order", "reduced", (0, 1, 2), _reduced, _linear),
)
