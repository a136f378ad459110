"""Other integrators to compare with: SUNDIALS CVODE (scikit-sundae), diffrax and numbalsoda.

The extra ``peers`` installs them. Each is set up as its authors advise:

- CVODE has an analytic Jacobian, BDF and Adams methods, and as many steps as it needs.
- diffrax is compiled, in 64 bits, with a PID controller and an explicit method of order 8.
- numbalsoda has a right-hand side compiled by numba. It is built from source, which needs a C++ and
  a Fortran compiler.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

from tippedisk_verify.bench.methods import TOLERANCES, Method, MethodRun, PreparedMethod
from tippedisk_verify.bench.problems import Problem
from tippedisk_verify.errors import InputError
from tippedisk_verify.model.equations import jacobian, vector_field
from tippedisk_verify.numbers.precision import DOUBLE

__all__ = ["PEERS", "peer_methods"]

_MAX_STEPS = 1_000_000  # more than any of these runs takes


def _cvode(kind: str) -> Callable[[Problem, float], PreparedMethod]:
    def prepare(problem: Problem, tolerance: float) -> PreparedMethod:
        import numpy
        from sksundae.cvode import CVODE

        constants = problem.parameters.constants_in(DOUBLE)
        rates = vector_field(math, constants, problem.omega, problem.friction)
        slopes = jacobian(math, constants, problem.omega, problem.friction)

        def right(t: float, y: Any, yp: Any) -> None:
            yp[:] = rates(*y.tolist())

        def slope(t: float, y: Any, yp: Any, matrix: Any) -> None:
            matrix[:, :] = slopes(*y.tolist())

        solver = CVODE(
            right,
            method=kind,
            rtol=tolerance,
            atol=tolerance,
            max_num_steps=_MAX_STEPS,
            jacfn=slope,
        )
        start = numpy.array(problem.start)
        times = numpy.array([0.0, *problem.times])

        def sampled() -> MethodRun:
            solution = solver.solve(times, start)
            status = "reached" if solution.success else str(solution.message)
            return MethodRun(status, solution.y[1:], None, int(solution.nfev))

        # With fewer than three times the solver would store every step.
        return PreparedMethod(
            lambda end: solver.solve(numpy.array([0.0, end / 2, end]), start).y[-1], sampled
        )

    return prepare


def _diffrax(name: str) -> Callable[[Problem, float], PreparedMethod]:
    def prepare(problem: Problem, tolerance: float) -> PreparedMethod:
        import jax

        jax.config.update("jax_enable_x64", True)
        import diffrax
        import jax.numpy as jnp

        rates = vector_field(
            jnp, problem.parameters.constants_in(DOUBLE), problem.omega, problem.friction
        )
        term = diffrax.ODETerm(lambda t, y, args: jnp.stack(rates(y[0], y[1], y[2])))
        solver = getattr(diffrax, name)()
        controller = diffrax.PIDController(rtol=tolerance, atol=tolerance)

        def compiled(save: Any) -> Any:
            def solve(start: Any, duration: Any) -> Any:
                solution = diffrax.diffeqsolve(
                    term,
                    solver,
                    0.0,
                    duration,
                    None,
                    start,
                    saveat=save,
                    max_steps=_MAX_STEPS,
                    stepsize_controller=controller,
                    throw=False,
                )
                return (
                    solution.ys,
                    solution.result == diffrax.RESULTS.successful,
                    solution.stats["num_steps"],
                )

            return jax.jit(solve)

        to_end = compiled(diffrax.SaveAt(t1=True))
        at_times = compiled(diffrax.SaveAt(ts=jnp.array(problem.times)))
        start = jnp.array(problem.start)
        to_end(start, problem.duration)[0].block_until_ready()

        def sampled() -> MethodRun:
            samples, reached, steps = at_times(start, problem.duration)
            status = "reached" if bool(reached) else "gave up before the end"
            return MethodRun(status, samples.tolist(), int(steps))

        return PreparedMethod(
            lambda end: to_end(start, end)[0].block_until_ready()[0].tolist(), sampled
        )

    return prepare


def _numbalsoda(name: str) -> Callable[[Problem, float], PreparedMethod]:
    def prepare(problem: Problem, tolerance: float) -> PreparedMethod:
        import numba
        import numbalsoda
        import numpy

        rates = numba.njit(problem.scalar_rhs)

        @numba.cfunc(numbalsoda.lsoda_sig)  # type: ignore[untyped-decorator]
        def right(t: Any, y: Any, yp: Any, data: Any) -> None:
            yp[0], yp[1], yp[2] = rates(t, (y[0], y[1], y[2]))

        solve, start = getattr(numbalsoda, name), numpy.array(problem.start)

        def states_at(*times: float) -> tuple[Any, bool]:
            return solve(  # type: ignore[no-any-return]
                right.address,
                start,
                numpy.array([0.0, *times]),
                rtol=tolerance,
                atol=tolerance,
                mxstep=_MAX_STEPS,
            )

        def sampled() -> MethodRun:
            states, reached = states_at(*problem.times)
            return MethodRun("reached" if reached else "gave up before the end", states[1:])

        # Keep `right`: it owns the machine code.
        return PreparedMethod(lambda end: states_at(end)[0][-1], sampled)

    return prepare


#: The peers, each with the module that it needs.
PEERS = (
    ("sksundae", Method("CVODE BDF", "cvode", TOLERANCES, _cvode("BDF"))),
    ("sksundae", Method("CVODE Adams", "cvode", TOLERANCES, _cvode("Adams"))),
    ("diffrax", Method("diffrax Dopri8", "diffrax", TOLERANCES, _diffrax("Dopri8"))),
    ("numbalsoda", Method("numbalsoda LSODA", "numbalsoda", TOLERANCES, _numbalsoda("lsoda"))),
    ("numbalsoda", Method("numbalsoda DOP853", "numbalsoda", TOLERANCES, _numbalsoda("dop853"))),
)


def peer_methods() -> tuple[Method, ...]:
    """Return the methods of the comparison that use other people's compiled integrators, as far as
    these are installed.

    Raises:
        InputError: If none is installed.
    """
    methods = tuple(method for module, method in PEERS if find_spec(module) is not None)
    if not methods:
        raise InputError("no peer is installed: pip install '.[peers]'")
    return methods
