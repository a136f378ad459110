"""What users would pick instead, from the extra ``peers``: SUNDIALS CVODE (scikit-sundae) and diffrax.

Each is set up as its authors advise: CVODE with an analytic Jacobian, Adams beside BDF and as many steps as it needs;
diffrax compiled, in 64 bits, with a PID controller, an explicit method of order 8, for stiff problems one of order 5.
numbalsoda (LSODA and DOP853 in compiled loops) is not here: it comes as source that needs a Fortran compiler.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

from tippedisk_verify.bench.methods import Method, Outcome, Prepared, double_rates, guess_of, solving
from tippedisk_verify.bench.problems import Problem
from tippedisk_verify.errors import InputError
from tippedisk_verify.model.equations import field, jacobian, shifted
from tippedisk_verify.model.precision import DOUBLE

__all__ = ["peer_methods"]

_TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
_MOST_STEPS = 1_000_000


def _cvode(kind: str) -> Callable[[Problem, float], Prepared]:
    def prepare(problem: Problem, tolerance: float) -> Prepared:
        import numpy
        from sksundae.cvode import CVODE

        constants = problem.parameters.at(DOUBLE)
        rates = field(math, constants, problem.omega, problem.friction)
        slopes = jacobian(math, constants, problem.omega, problem.friction)

        def right(t: float, y: Any, yp: Any) -> None:
            yp[:] = rates(*y.tolist())

        def slope(t: float, y: Any, yp: Any, matrix: Any) -> None:
            matrix[:, :] = slopes(*y.tolist())

        solver = CVODE(right, method=kind, rtol=tolerance, atol=tolerance, max_num_steps=_MOST_STEPS, jacfn=slope)
        start = numpy.array(problem.start)
        times = numpy.array([0.0, *problem.times])

        def sampled() -> Outcome:
            solution = solver.solve(times, start)
            status = "reached" if solution.success else str(solution.message)
            return Outcome(status, solution.y[1:], None, int(solution.nfev))

        # Three times or more: otherwise every step is kept.
        return Prepared(lambda end: solver.solve(numpy.array([0.0, end / 2, end]), start).y[-1], sampled)

    return prepare


def _diffrax(name: str) -> Callable[[Problem, float], Prepared]:
    def prepare(problem: Problem, tolerance: float) -> Prepared:
        import jax

        jax.config.update("jax_enable_x64", True)
        import diffrax
        import jax.numpy as jnp

        rates = field(jnp, problem.parameters.at(DOUBLE), problem.omega, problem.friction)
        term = diffrax.ODETerm(lambda t, y, args: jnp.stack(rates(y[0], y[1], y[2])))
        solver = getattr(diffrax, name)()
        controller = diffrax.PIDController(rtol=tolerance, atol=tolerance)

        def compiled(save: Any) -> Any:
            def solve(start: Any, duration: Any) -> Any:
                solution = diffrax.diffeqsolve(
                    term, solver, 0.0, duration, None, start, saveat=save, max_steps=_MOST_STEPS,
                    stepsize_controller=controller, throw=False,
                )  # fmt: skip
                return solution.ys, solution.result == diffrax.RESULTS.successful, solution.stats["num_steps"]

            return jax.jit(solve)

        to_end = compiled(diffrax.SaveAt(t1=True))
        at_times = compiled(diffrax.SaveAt(ts=jnp.array(problem.times)))
        start = jnp.array(problem.start)
        to_end(start, problem.duration)[0].block_until_ready()

        def sampled() -> Outcome:
            samples, reached, steps = at_times(start, problem.duration)
            status = "reached" if bool(reached) else "gave up before the end"
            return Outcome(status, samples.tolist(), int(steps))

        return Prepared(lambda end: to_end(start, end)[0].block_until_ready()[0].tolist(), sampled)

    return prepare


def _variational(ops: Any, problem: Problem, stack: Callable[[list[Any]], Any]) -> Callable[[Any], Any]:
    """Rates of state and derivatives by gamma_bar and v, nine numbers, for the period solve."""
    constants = problem.parameters.at(DOUBLE)
    rates = field(shifted(ops), constants, problem.omega, problem.friction)
    slopes = jacobian(shifted(ops), constants, problem.omega, problem.friction)

    def right(y: Any) -> Any:
        state = y[0], y[1], y[2]
        rows = slopes(*state)
        moved = [row[0] * y[3 + n] + row[1] * y[5 + n] + row[2] * y[7 + n] for row in rows for n in (0, 1)]
        return stack([*rates(*state), *moved])

    return right


def _split(y: Any) -> tuple[list[Any], list[list[Any]]]:
    return y[:3], [y[3:5], y[5:7], y[7:9]]


def _period_by_cvode(kind: str) -> Callable[[Problem, float], Prepared]:
    def prepare(problem: Problem, tolerance: float) -> Prepared:
        import numpy
        from sksundae.cvode import CVODE

        rates = _variational(math, problem, list)

        def right(t: float, y: Any, yp: Any) -> None:
            yp[:] = rates(y.tolist())

        solver = CVODE(right, method=kind, rtol=tolerance, atol=tolerance, max_num_steps=_MOST_STEPS)

        def flight(gamma_bar: float, v: float, duration: float) -> Any:
            start = numpy.array([0.0, gamma_bar, v, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0])
            return _split(solver.solve(numpy.array([0.0, duration / 2, duration]), start).y[-1].tolist())

        return solving(flight, double_rates(problem), guess_of(problem), tolerance)

    return prepare


def _period_by_diffrax(name: str) -> Callable[[Problem, float], Prepared]:
    def prepare(problem: Problem, tolerance: float) -> Prepared:
        import jax

        jax.config.update("jax_enable_x64", True)
        import diffrax
        import jax.numpy as jnp

        rates = _variational(jnp, problem, jnp.stack)
        term = diffrax.ODETerm(lambda t, y, args: rates(y))
        solver = getattr(diffrax, name)()
        controller = diffrax.PIDController(rtol=tolerance, atol=tolerance)

        def solve(start: Any, duration: Any) -> Any:
            solution = diffrax.diffeqsolve(
                term, solver, 0.0, duration, None, start, saveat=diffrax.SaveAt(t1=True), max_steps=_MOST_STEPS,
                stepsize_controller=controller, throw=False,
            )  # fmt: skip
            return solution.ys[0]

        compiled = jax.jit(solve)

        def flight(gamma_bar: float, v: float, duration: float) -> Any:
            start = jnp.array([0.0, gamma_bar, v, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0])
            return _split(compiled(start, duration).tolist())

        return solving(flight, double_rates(problem), guess_of(problem), tolerance)

    return prepare


_STIFF = ("transient", "epsilon-1e-3", "epsilon-1e-4")
_METHODS = (
    ("sksundae", Method("CVODE BDF", "cvode", _TOLERANCES, _cvode("BDF"), _period_by_cvode("BDF"))),
    ("sksundae", Method("CVODE Adams", "cvode", _TOLERANCES, _cvode("Adams"), _period_by_cvode("Adams"))),
    ("diffrax", Method("diffrax Dopri8", "diffrax", _TOLERANCES, _diffrax("Dopri8"), _period_by_diffrax("Dopri8"))),
    ("diffrax", Method("diffrax Kvaerno5", "diffrax", (1e-4, 1e-6, 1e-8), _diffrax("Kvaerno5"), None,
                       lambda problem: problem.name in _STIFF)),
)  # fmt: skip


def peer_methods() -> tuple[Method, ...]:
    """The peers that are installed. Raises InputError if none is."""
    methods = tuple(method for module, method in _METHODS if find_spec(module) is not None)
    if not methods:
        raise InputError("no peer is installed: pip install 'tippedisk-verify[peers]'")
    return methods
