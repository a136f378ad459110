"""Level 6: recognise a fixed-step integrator by the errors of the answered trajectories."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from tippedisk_verify.conformance.diagnosis.tables import Array, Table
from tippedisk_verify.model.equations import STATE_NAMES, vector_field
from tippedisk_verify.model.parameters import Constants

__all__ = ["recognise_step_method"]

_MAX_TRAJECTORIES = 3  # trajectories that a method is tried on
_MAX_UNEXPLAINED_SHARE = 0.02  # share of the errors that a method may leave unexplained
_STEPS = sorted(factor * 10.0**-k for k in range(2, 6) for factor in (1, 1.25, 2, 2.5, 4, 5))  # s
# Steps that are tried, nearest to the step that the order of the method suggests
_MAX_STEP_SIZES = 4
_REFERENCE_STEP = 2e-3  # s, from which errors are extrapolated; friction damps at about 130/s
# Methods by name: the order, the share of the step at which each slope after the first is
# evaluated, and the weights of the slopes.
_METHODS = {
    "the classical Runge-Kutta method": (4, (0.5, 0.5, 1.0), (1 / 6, 1 / 3, 1 / 3, 1 / 6)),
    "Heun's method": (2, (1.0,), (0.5, 0.5)),
    "the midpoint rule": (2, (0.5,), (0.0, 1.0)),
    "the explicit Euler method": (1, (), (1.0,)),
    "a Runge-Kutta method with equal weights": (1, (0.5, 0.5, 1.0), (0.25, 0.25, 0.25, 0.25)),
}


# The inputs of a trajectory: the constants, the speed, and the initial state
_INPUTS = ("r", "e", "m", "A", "B", "g", "mu", "epsilon", "Omega", *STATE_NAMES)
#: A Runge-Kutta method: its order, shares of the step, and weights
Scheme = tuple[int, tuple[float, ...], tuple[float, ...]]


def _integrated(
    rates: Callable[..., Sequence[Array]], state: Array, time: float, step: float, scheme: Scheme
) -> Array:
    """Return the states after a time, computed by a Runge-Kutta method with a fixed step.

    Args:
        rates: The function from beta, gamma and v to their time derivatives.
        state: The initial states, of shape (3, trajectories).
        time: The time [s].
        step: The step [s].
        scheme: The method.
    """
    _, shares, weights = scheme
    for _ in range(max(1, round(time / step))):
        slopes = [np.array(rates(*state))]
        for share in shares:
            slopes.append(np.array(rates(*(state + step * share * slopes[-1]))))
        state = state + step * np.asarray(np.tensordot(weights, slopes, axes=1))
    return state


@np.errstate(all="ignore")
def recognise_step_method(table: Table) -> str:
    """Return a sentence that names the fixed-step integrator whose errors the answers have.

    The sentence is empty if none is recognised. The errors of the first sample in time are
    compared, for up to three trajectories. If a method is found, all answers in the table are
    marked as explained.

    Args:
        table: The answers about trajectories.
    """
    time = min((float(place["t"]) for place in table.places if "t" in place), default=np.nan)
    columns = [table.column(f"{x}@{time:g}") for x in STATE_NAMES]
    truths = np.array([column.truth for column in columns])
    errors = np.array([column.answer for column in columns]) - truths
    rows = np.flatnonzero(np.isfinite(errors).all(axis=0))[:_MAX_TRAJECTORIES]
    truths, errors = truths[:, rows], errors[:, rows]
    if not errors.any() or not table.unexplained.any():
        return ""
    r, e, m, A, B, g, mu, epsilon, omega, *start = (table.inputs[x][rows] for x in _INPUTS)
    Bbar = B - m * e**2
    rhs = vector_field(
        np,
        Constants(r, e, m, A, B, Bbar, g, mu, epsilon, A / m, Bbar / m, mu * g / epsilon, mu * g),
        omega,
        table.friction,
    )

    def errors_of(scheme: Scheme, step: float) -> Array:
        return np.asarray(_integrated(rhs, np.array(start), time, step, scheme) - truths)

    size = float(np.linalg.norm(errors))
    for name, scheme in _METHODS.items():
        own = float(np.linalg.norm(errors_of(scheme, _REFERENCE_STEP)))
        guess = _REFERENCE_STEP * (size / own) ** (1 / scheme[0])
        for step in sorted(_STEPS, key=lambda step: abs(np.log(step / guess)))[:_MAX_STEP_SIZES]:
            if np.linalg.norm(errors_of(scheme, step) - errors) < _MAX_UNEXPLAINED_SHARE * size:
                table.unexplained[:] = False
                step_ms = f"{1000 * step:g} ms"
                return f"the trajectories have the errors of {name} at a fixed step of {step_ms}"
    return ""
