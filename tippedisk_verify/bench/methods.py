"""The methods that are compared, with their tolerances, each prepared for a problem at one setting."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from tippedisk_verify.bench.problems import Problem
from tippedisk_verify.flow.contract import Engine, Status
from tippedisk_verify.flow.jit import heyoka_module
from tippedisk_verify.flow.scipy_engine import ScipyEngine
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.equations import jacobian, vector_field
from tippedisk_verify.numbers.precision import DOUBLE, EXTENDED, QUADRUPLE, precision_of_bits

__all__ = ["BENCH_METHODS", "TOLERANCES", "Method", "MethodRun", "PreparedMethod"]

#: Relative and absolute tolerances of a method for which no others are chosen, loosest first.
TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
_TAYLOR_TOLERANCES = (1e-3, 1e-5, 1e-6, 1e-7, 1e-9, 1e-11, 1e-12, 1e-13, 1e-15)
# For DOP853, the strongest of SciPy's methods.
_FINE_TOLERANCES = (1e-4, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 3e-11, 1e-11, 1e-12, 1e-13)


@dataclass(frozen=True)
class MethodRun:
    """The result of one run of an integrator in the comparison, and its cost other than time."""

    status: str  #: "reached", or the reason why it was not
    samples: Any  #: (n, 3) at the problem's times, in any arithmetic; fewer after an early stop
    steps: int | None = None
    evaluations: int | None = None  #: of the right-hand side


@dataclass(frozen=True)
class PreparedMethod:
    """An integrator set up for a problem of the comparison, ready to run."""

    run: Callable[[float], Any]  #: integrates to a time [s] and returns the state there
    run_with_samples: Callable[[], MethodRun]  #: integrates to the end and returns the samples
    clock: Callable[[], float | None] | None = None  #: seconds of the last run by its own clock


@dataclass(frozen=True)
class Method:
    """An integrator that takes part in the comparison, with its settings."""

    name: str
    family: str  #: heyoka, bare, half-widths, scipy, or the peer's name
    settings: tuple[Any, ...]  #: loosest first
    #: does what is done once: compiling, allocating
    prepare: Callable[[Problem, Any], PreparedMethod]
    can_solve: Callable[[Problem], bool] = lambda problem: True  #: True if it can solve the problem
    max_run_seconds: float = 0.3  #: [s]; after a longer run its tighter settings are left out

    def label(self, setting: Any) -> str:
        """Return a setting of the method, such as a tolerance, as text."""
        if not isinstance(setting, float):
            return str(setting)
        short = f"{setting:.0e}"
        return short if float(short) == setting < 1 else f"{setting:g}"


def _prepare_engine(engine: Engine, problem: Problem, **options: Any) -> PreparedMethod:
    plain = problem.request(**options)
    precision = plain.precision
    times = precision.array(problem.times)
    sampling = problem.request(times=times, **options)

    def sampled() -> MethodRun:
        result = engine(sampling)
        status = "reached" if result.status is Status.REACHED else result.status.value
        samples = [] if result.samples is None else result.samples
        return MethodRun(status, samples, result.steps or engine(plain).steps, result.evaluations)

    def run(duration: float) -> Any:
        return engine(
            plain if duration == problem.duration else replace(plain, duration=duration)
        ).state

    return PreparedMethod(run, sampled)


def _preparing(
    make: Callable[..., Engine], *options: str, **more: bool
) -> Callable[[Problem, float], PreparedMethod]:
    """Return a function for `Method.prepare` that makes a new engine for each problem and
    tolerance.
    """
    return lambda problem, tolerance: _prepare_engine(
        make(*options, **more), problem, tolerance=tolerance
    )


_PRECISIONS = {
    "double": DOUBLE,
    "extended": EXTENDED,
    "quadruple": QUADRUPLE,
    "50 digits": precision_of_bits(170),
}
_DIGITS = (12, 14, 16, 18, 20, 22, 25)  # settings of the runs with half-widths


def _beyond_double(problem: Problem, precision: str) -> PreparedMethod:
    return _prepare_engine(Taylor(), problem, precision=_PRECISIONS[precision])


def _with_half_widths(problem: Problem, digits: int) -> PreparedMethod:
    """Prepare a run with half-widths on a problem of the comparison, like that of `Disk.integrate`.

    It estimates the error, and beyond 12 digits removes it.
    """
    return _prepare_engine(Taylor(), problem, error_estimate=True, digits=digits)


def _heyoka_alone(problem: Problem, name: str) -> PreparedMethod:
    """Prepare a run of heyoka alone on a problem of the comparison, as its manual shows.

    It shows the time that this package adds.
    """
    precision = _PRECISIONS[name]
    constants, omega = problem.parameters.constants_in(precision), precision.number(problem.omega)
    hy, state, rates = _in_symbols(
        problem, lambda ops, *_: vector_field(ops, constants, omega, problem.friction)
    )
    start = precision.array(problem.start)
    options = {"prec": precision.bits} if precision.kind == "real" else {}
    stepper = hy.taylor_adaptive(
        list(zip(state, rates, strict=True)),
        start.tolist(),
        fp_type=precision.number_type,
        compact_mode=precision != DOUBLE,
        **options,
    )

    def states_at(times: Sequence[float]) -> list[Any]:
        stepper.time = precision.number(0)
        stepper.state[:] = start
        ends = []
        for end in times:
            stepper.propagate_until(precision.number(end))
            ends.append(precision.copy_array(stepper.state))
        return ends

    return PreparedMethod(
        lambda duration: states_at([duration])[0],
        lambda: MethodRun("reached", states_at(problem.times)),
    )


def _in_symbols(problem: Problem, formula: Callable[..., Any]) -> tuple[Any, list[Any], Any]:
    """Return the heyoka module, the symbols of (beta, gamma, v), and the value of ``formula`` at
    these symbols.

    Args:
        problem: The problem, with the constants and the speed.
        formula: Called as ``formula(heyoka, constants, omega, "linear")``; it returns a function of
            the state.
    """
    hy = heyoka_module()
    state = hy.make_vars("beta", "gamma", "v")
    constants = problem.parameters.constants_in(DOUBLE)
    return hy, list(state), formula(hy, constants, problem.omega, "linear")(*state)


def _compile(problem: Problem, formula: Callable[..., Any]) -> Callable[[float, Any], Any]:
    """Compile the linear law's right-hand side or its Jacobian to machine code.

    Args:
        problem: The problem, with the constants and the speed.
        formula: The right-hand side or the Jacobian, as `_in_symbols` takes it.

    Returns:
        A function of t and y, shape (3,), that returns dy/dt or a (3, 3) array.
    """
    import numpy

    hy, state, values = _in_symbols(problem, formula)
    entries = numpy.array(values, dtype=object)
    function = hy.cfunc([hy.expression(0.0) + entry for entry in entries.flat], state)
    return lambda t, y: function(numpy.ascontiguousarray(y)).reshape(entries.shape)


def _scipy_compiled(method: str) -> Callable[[Problem, float], PreparedMethod]:
    def prepare(problem: Problem, tolerance: float) -> PreparedMethod:
        from scipy.integrate import solve_ivp

        rates = _compile(problem, vector_field)
        options = (
            {"jac": _compile(problem, jacobian)} if method in ("LSODA", "Radau", "BDF") else {}
        )

        def solve(times: Any = None, duration: float = problem.duration) -> Any:
            span = (0.0, duration)
            return solve_ivp(
                rates,
                span,
                problem.start,
                method=method,
                rtol=tolerance,
                atol=tolerance,
                t_eval=times,
                **options,
            )

        def sampled() -> MethodRun:
            solution = solve(problem.times)
            status = "reached" if solution.status == 0 else str(solution.message)
            return MethodRun(status, solution.y.T, None, int(solution.nfev))

        return PreparedMethod(lambda duration: solve(duration=duration).y[:, -1], sampled)

    return prepare


def _has_linear_law(problem: Problem) -> bool:
    return problem.parameters.law.is_linear


BENCH_METHODS: tuple[Method, ...] = (
    Method("bare heyoka", "bare", tuple(_PRECISIONS), _heyoka_alone, _has_linear_law),
    Method("taylor", "heyoka", _TAYLOR_TOLERANCES, _preparing(Taylor)),
    Method("taylor, fast math", "heyoka", _TAYLOR_TOLERANCES, _preparing(Taylor, fast_math=True)),
    Method(
        "taylor, high accuracy", "heyoka", (1e-13, 1e-15), _preparing(Taylor, high_accuracy=True)
    ),
    Method("taylor beyond double", "heyoka", tuple(_PRECISIONS)[1:], _beyond_double),
    Method("with half-widths, digits", "half-widths", _DIGITS, _with_half_widths),
    *(
        Method(f"scipy {name}", "scipy", TOLERANCES, _preparing(ScipyEngine, name))
        for name in ("RK45", "LSODA", "Radau", "BDF")
    ),
    Method("scipy DOP853", "scipy", _FINE_TOLERANCES, _preparing(ScipyEngine, "DOP853")),
    Method(
        "scipy DOP853, compiled", "scipy", TOLERANCES, _scipy_compiled("DOP853"), _has_linear_law
    ),
    Method("scipy LSODA, compiled", "scipy", TOLERANCES, _scipy_compiled("LSODA"), _has_linear_law),
)
