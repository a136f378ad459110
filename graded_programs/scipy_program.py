"""A program as a user would write it: plain SciPy at one tolerance, in doubles.

It follows docs/grading_equations.md. It answers trajectories and librating cycles, also near the
connection. Crossings are events of `solve_ivp`; Floquet multipliers come from the variational
equations with imaginary steps.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from tippedisk_verify.reference_values.grading_rules import split_name
from tippedisk_verify.reference_values.store import ReferenceValue, Store

_TINY = 1e-30  # the imaginary step
_SECTION = math.pi / 2


def motion(
    ops: Any, p: dict[str, float], omega: Any, smooth: bool, state: Sequence[Any], side: float = 0.0
) -> Any:
    """Return gamma', v' and the sliding velocity.

    Args:
        ops: The module with sin and cos (math or cmath).
        p: The parameters by name [SI units].
        omega: The speed [rad/s].
        smooth: True for the smooth law.
        state: beta, gamma [rad] and v [rad/s].
        side: The sign of the sliding velocity, which a complex number hides; 0 to take it from the
            velocity.
    """
    beta, gamma, v = state
    r, e, m, A, eps = (p[name] for name in ("r", "e", "m", "A", "epsilon"))
    Bbar = p["B"] - m * e**2
    sb, cb, sg, cg = ops.sin(beta), ops.cos(beta), ops.sin(gamma), ops.cos(gamma)
    rho = r + e * sg
    inertia = A * cg**2 + Bbar * sg**2
    h = (
        inertia * omega**2 * sb * cb
        - 2 * (A - Bbar) * omega * v * cb * sg * cg
        + m * rho**2 * v**2 * sb * cb
        + m * e * rho * omega**2 * sb * cb**3 * sg
        - m * e * rho * (3 * sb**2 - 2) * omega * v * cb * cg
    )
    slip = rho * v * sb - e * omega * sb**2 * cg
    reach = eps + (side * slip if side else abs(slip)) if smooth else eps
    force = h - m * p["g"] * rho * cb - rho * sb * p["mu"] * m * p["g"] * slip / reach
    return -omega * cb, force / (inertia + m * rho**2 * cb**2), slip


def _setting(store: Store, quantity: ReferenceValue) -> tuple[dict[str, float], float, bool]:
    parameters = {name: float(value) for name, value in store.parameters[quantity.set].items()}
    return parameters, float(quantity.inputs["Omega"]), quantity.friction == "smooth"


def _trajectory(
    store: Store, asked: Sequence[ReferenceValue], options: dict[str, Any]
) -> dict[str, float]:
    p, omega, smooth = _setting(store, asked[0])

    def rates(t: float, y: Any) -> list[float]:
        gamma_rate, v_rate, _ = motion(math, p, omega, smooth, y.tolist())
        return [y[2], gamma_rate, v_rate]

    def section(t: float, y: Any) -> float:
        return y[0] - _SECTION

    def flat(t: float, y: Any) -> float:
        return math.sin(y[0])

    flat.terminal = True  # type: ignore[attr-defined]
    start = [float(asked[0].inputs[name]) for name in ("beta", "gamma", "v")]
    times = sorted(
        {float(place["t"]) for q in asked if "t" in (place := split_name(q.name, q.kind)[1])}
    )
    run = solve_ivp(rates, (0, 10), start, t_eval=times, events=(section, flat), **options)
    found = {
        f"{name}@{t:g}": value
        for t, y in zip(run.t, run.y.T, strict=True)
        for name, value in zip(("beta", "gamma", "v"), y, strict=True)
    }
    crossings = [(t, y) for t, y in zip(run.t_events[0], run.y_events[0], strict=True) if t > 0.01]
    for n, (t, y) in enumerate(crossings, start=1):
        found |= {f"crossing_time#{n}": t, f"crossing_gamma#{n}": y[1], f"crossing_v#{n}": y[2]}
    return found | ({"flat_time": run.t_events[1][0]} if len(run.t_events[1]) else {})


def _variational(p: dict[str, float], omega: float, smooth: bool) -> Callable[[float, Any], Any]:
    """Return the rates of the state, of its derivatives by (state, Omega), and of log det.

    The last is the divergence of the field.
    """

    def rates(t: float, y: Any) -> Any:
        state = y[:3].tolist()
        gamma_rate, v_rate, slip = motion(math, p, omega, smooth, state)
        jacobian = np.zeros((3, 4))
        jacobian[0, 2] = 1
        for k in range(4):
            moved = [complex(part, _TINY * (n == k)) for n, part in enumerate((*state, omega))]
            slopes = motion(cmath, p, moved[3], smooth, moved[:3], 1.0 if slip >= 0 else -1.0)
            jacobian[1:, k] = [complex(slope).imag / _TINY for slope in slopes[:2]]
        change = jacobian[:, :3] @ y[3:15].reshape(3, 4)
        change[:, 3] += jacobian[:, 3]
        return np.concatenate([[y[2], gamma_rate, v_rate], change.ravel(), [jacobian[2, 2]]])

    return rates


def _cycle(
    store: Store, asked: Sequence[ReferenceValue], options: dict[str, Any]
) -> dict[str, float]:
    """Find a cycle by Newton's method on the half map, from a start a millionth off the cycle."""
    p, omega, smooth = _setting(store, asked[0])
    near = {quantity.name: quantity.for_doubles for quantity in asked}
    x = np.array([near["gamma_bar_0"] * (1 + 1e-6), near["v_0"] * (1 - 1e-6)])
    rates = _variational(p, omega, smooth)

    def section(t: float, y: Any) -> float:
        return y[0] - _SECTION if t > 0.01 else -1.0

    def turn(t: float, y: Any) -> float:
        return y[2]

    section.terminal, section.direction = True, 1  # type: ignore[attr-defined]
    for _ in range(6):
        start = np.concatenate([[_SECTION, _SECTION + x[0], x[1]], np.eye(3, 4).ravel(), [0]])
        run = solve_ivp(rates, (0, 20), start, events=(section, turn), **options)
        if not len(run.t_events[0]):
            return {}  # at this tolerance Newton's steps have left the cycle
        half, y = run.t_events[0][0], run.y_events[0][0]
        speed, change = rates(0, y)[:3], y[3:15].reshape(3, 4)
        dtime = -change[0] / speed[0]
        by = -(change + np.outer(speed, dtime))[1:]
        step = np.linalg.solve(np.eye(2) - by[:, 1:3], [_SECTION - y[1] - x[0], -y[2] - x[1]])
        x = x + step
        if max(abs(step)) < 1e-11:
            break
    by_omega = np.linalg.solve(np.eye(2) - by[:, 1:3], by[:, 3])
    slow = max(abs(np.linalg.eigvals(by[:, 1:3]))) ** 2
    return {
        "period": 2 * half,
        "gamma_bar_0": x[0],
        "v_0": x[1],
        "beta_max": max(abs(z[0] - _SECTION) for z in run.y_events[1]),
        "multiplier_slow": slow,
        "log_multiplier_slow": math.log(slow),
        "log_multiplier_fast": 2 * y[15] - math.log(slow),
        "dperiod_domega": 2 * (dtime[1:3] @ by_omega + dtime[3]),
        "dgamma_bar_0_domega": by_omega[0],
        "dv_0_domega": by_omega[1],
    }


def answered(
    store: Store, prefixes: Iterable[str], method: str, tolerance: float, **options: Any
) -> dict[str, str]:
    """Return answers by id for trajectories and librating cycles whose ids start with a prefix.

    Args:
        store: The reference values.
        prefixes: The beginnings of the ids.
        method: A method of `solve_ivp`.
        tolerance: The relative and absolute tolerance.
        **options: Further options of `solve_ivp`.
    """
    options |= {"method": method, "rtol": tolerance, "atol": tolerance}
    entries: dict[str, list[ReferenceValue]] = {}
    for quantity in (quantity for prefix in prefixes for quantity in store.matching(prefix)):
        if "doubles" in quantity.values:
            entries.setdefault(quantity.id.rsplit("/", 1)[0], []).append(quantity)
    given = {}
    for asked in entries.values():
        numbers = (_trajectory if asked[0].kind == "trajectory" else _cycle)(store, asked, options)
        given |= {q.id: repr(float(numbers[q.name])) for q in asked if q.name in numbers}
    return given
