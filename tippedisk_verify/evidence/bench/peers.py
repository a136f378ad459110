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

from tippedisk_verify.errors import InputError
from tippedisk_verify.evidence.bench.methods import Method, Outcome, Prepared
from tippedisk_verify.evidence.bench.problems import Problem
from tippedisk_verify.model.equations import field, jacobian
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
        # Three times or more: otherwise every step is kept.
        ends = numpy.array([0.0, problem.duration / 2, problem.duration])
        times = numpy.array([0.0, *problem.times])

        def sampled() -> Outcome:
            solution = solver.solve(times, start)
            status = "reached" if solution.success else str(solution.message)
            return Outcome(status, solution.y[1:], None, int(solution.nfev))

        return Prepared(lambda: solver.solve(ends, start), sampled)

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
            def solve(start: Any) -> Any:
                solution = diffrax.diffeqsolve(
                    term, solver, 0.0, problem.duration, None, start, saveat=save, max_steps=_MOST_STEPS,
                    stepsize_controller=controller, throw=False,
                )  # fmt: skip
                return solution.ys, solution.result == diffrax.RESULTS.successful, solution.stats["num_steps"]

            return jax.jit(solve)

        to_end = compiled(diffrax.SaveAt(t1=True))
        at_times = compiled(diffrax.SaveAt(ts=jnp.array(problem.times)))
        start = jnp.array(problem.start)
        to_end(start)[0].block_until_ready()

        def sampled() -> Outcome:
            samples, reached, steps = at_times(start)
            status = "reached" if bool(reached) else "gave up before the end"
            return Outcome(status, [[float(part) for part in row] for row in samples.tolist()], int(steps))

        return Prepared(lambda: to_end(start)[0].block_until_ready(), sampled)

    return prepare


_STIFF = ("transient", "epsilon-1e-3", "epsilon-1e-4")
_METHODS = (
    ("sksundae", Method("CVODE BDF", "cvode", _TOLERANCES, _cvode("BDF"))),
    ("sksundae", Method("CVODE Adams", "cvode", _TOLERANCES, _cvode("Adams"))),
    ("diffrax", Method("diffrax Dopri8", "diffrax", _TOLERANCES, _diffrax("Dopri8"))),
    ("diffrax", Method("diffrax Kvaerno5", "diffrax", (1e-4, 1e-6, 1e-8), _diffrax("Kvaerno5"),
                       lambda problem: problem.name in _STIFF)),
)  # fmt: skip


def peer_methods() -> tuple[Method, ...]:
    """The peers that are installed. Raises InputError if none is."""
    found = tuple(method for module, method in _METHODS if find_spec(module) is not None)
    if not found:
        raise InputError("no peer is installed: pip install 'tippedisk-verify[peers]'")
    return found
