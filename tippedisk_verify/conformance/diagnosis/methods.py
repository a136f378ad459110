"""Level 6: the method with a fixed step whose errors the answered states along trajectories
show.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tippedisk_verify.conformance.diagnosis.entries import Array, Table
from tippedisk_verify.model.equations import field
from tippedisk_verify.model.parameters import Constants

__all__ = ["method"]

_STATE = ("beta", "gamma", "v")
_TRIED = 3  # trajectories that a method is tried on
_LEAVES = 0.02  # of the errors: what a method may leave, where orders beyond its own enter
_STEPS = sorted(factor * 10.0**-k for k in range(2, 6) for factor in (1, 1.25, 2, 2.5, 4, 5))  # s
_NEAREST = 4  # steps about the one that the order of the method suggests
_REFERENCE_STEP = 2e-3  # s, that an order is extrapolated from; friction damps with some 130/s
#: By name: the order, the share of the step at which each slope after the first is taken, and the
#: weights.
_METHODS = {
    "the classical Runge-Kutta method": (4, (0.5, 0.5, 1.0), (1 / 6, 1 / 3, 1 / 3, 1 / 6)),
    "Heun's method": (2, (1.0,), (0.5, 0.5)),
    "the midpoint rule": (2, (0.5,), (0.0, 1.0)),
    "the explicit Euler method": (1, (), (1.0,)),
    "a Runge-Kutta method with equal weights": (1, (0.5, 0.5, 1.0), (0.25, 0.25, 0.25, 0.25)),
}


def _flown(
    rates: Callable[..., Array],
    state: Array,
    time: float,
    step: float,
    scheme: tuple[int, tuple[float, ...], tuple[float, ...]],
) -> Array:
    """Return the states after a time [s] by a method with a fixed step [s]."""
    _, shares, weights = scheme
    count = max(1, round(time / step))
    for _ in range(count):
        slopes = [rates(state)]
        for share in shares:
            slopes = [*slopes, rates(state + step * share * slopes[-1])]
        state = state + step * sum(
            weight * slope for weight, slope in zip(weights, slopes, strict=True)
        )
    return state


def method(table: Table) -> str:
    """Name the method whose own errors are those of the first samples, and take these out; ""
    if none has them.
    """
    times = [float(place["t"]) for place in table.places if "t" in place]
    if table.kind != "trajectory" or not times or not table.left.any():
        return ""
    first = f"{min(times):g}"
    columns = [table.column(f"{x}@{first}") for x in _STATE]
    answers, truths = (
        np.array([getattr(column, x) for column in columns]) for x in ("answer", "truth")
    )
    rows = np.flatnonzero(np.isfinite(answers + truths).all(axis=0))[:_TRIED]
    errors = (answers - truths)[:, rows]
    if not rows.size or not errors.any():
        return ""
    r, e, m, A, B, g, mu, epsilon, omega, *start = (table.given[x][rows] for x in _INPUTS)
    Bbar = B - m * e**2
    constants = Constants(
        r, e, m, A, B, Bbar, g, mu, epsilon, A / m, Bbar / m, mu * g / epsilon, mu * g
    )
    vector_field = field(np, constants, omega, table.friction)  # type: ignore[arg-type]

    def rates(state: Array) -> Array:
        return np.array(vector_field(*state))

    with np.errstate(all="ignore"):
        for name, scheme in _METHODS.items():
            own = (
                _flown(rates, np.array(start), min(times), _REFERENCE_STEP, scheme)
                - truths[:, rows]
            )
            guess = _REFERENCE_STEP * float(np.linalg.norm(errors) / np.linalg.norm(own)) ** (
                1 / scheme[0]
            )
            for step in sorted(_STEPS, key=lambda step: abs(np.log(step / guess)))[:_NEAREST]:
                made = _flown(rates, np.array(start), min(times), step, scheme) - truths[:, rows]
                if np.linalg.norm(made - errors) < _LEAVES * np.linalg.norm(errors):
                    table.left[:] = False
                    return f"the trajectories have the errors of {name} at a fixed step of {1000 * step:g} ms"
    return ""


_INPUTS = ("r", "e", "m", "A", "B", "g", "mu", "epsilon", "Omega", *_STATE)
