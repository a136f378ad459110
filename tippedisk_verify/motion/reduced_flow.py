"""Flow on the slow manifold, beta' = h_0 + ... + epsilon^N h_N and gamma' = -Omega cos(beta), by Taylor series.

Two equations instead of three and none of them stiff: the step no longer shrinks with epsilon, but the manifold's
truncation is an error that no tolerance removes.
"""

from __future__ import annotations

from threading import Lock
from typing import Any

import numpy

from tippedisk_verify.errors import InputError
from tippedisk_verify.flow.contract import Status
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE, heyoka_module
from tippedisk_verify.theory.slow_manifold import symbolic_surface

__all__ = ["ReducedFlow"]


class ReducedFlow:
    """The reduced flow of one order, compiled once, in double; linear friction law.

    Threads may share it: one run waits for the other. Raises InputError for an order outside 0 to 3: beyond, the
    expressions grow too large to integrate.
    """

    def __init__(self, order: int, tolerance: float | None = None) -> None:
        if not 0 <= order <= 3:
            raise InputError(f"reduced flows are offered for orders 0 to 3, not {order}")
        hy = heyoka_module()
        surface, (beta, gamma), self._names = symbolic_surface(order)
        system = [(beta, surface), (gamma, -(hy.par[0] * hy.cos(beta)))]
        options = {} if tolerance is None else {"tol": tolerance}
        self._lock = Lock()
        self._stepper: Any = hy.taylor_adaptive(system, [1.0, 1.0], compact_mode=True, **options)
        self._reached = hy.taylor_outcome.time_limit

    def __call__(
        self, parameters: Parameters, omega: float, start: tuple[float, float], duration: float, times: Any = None
    ) -> tuple[Status, Any, Any]:
        """(status, final (beta, gamma), samples (n, 2) at ``times`` or None), from (beta, gamma) at time 0."""
        constants, stepper = parameters.at(DOUBLE), self._stepper
        values = (omega, *(getattr(constants, name) for name in self._names[1:]))
        with self._lock:
            stepper.pars[:] = values[: len(stepper.pars)]  # low orders know fewer parameters
            stepper.time, stepper.state[:] = 0.0, start
            if times is None:
                outcome, samples = stepper.propagate_until(float(duration))[0], None
            else:
                outcome, *_, samples = stepper.propagate_grid(numpy.concatenate(([0.0], times)))
                samples = samples[1:]
            status = Status.REACHED if outcome == self._reached else Status.FAILED
            return status, stepper.state.copy(), samples
