"""Faults planted after the right-hand side: eigenvalues, laws, orbits, cycles and the connection.

As in `planted`, the list was written before the code that names faults, and imports none of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from tests.conformance.planted import PARAMETERS, Fault, on, other, outputs, right, shifted, swapped
from tests.conformance.scipy_program import answered, motion
from tippedisk_verify.conformance.sheet import placed
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["LATER", "tight"]

Sheet = dict[str, str]
_EQ = "printed/both/equilibrium/"
_HOPF = ("printed/linear/hopf/", "calibrated/linear/hopf/")
_HB, _SM = "printed/linear/harmonic-balance/", "printed/linear/slow-manifold/"
_FLY = ("printed/linear/trajectory/", "printed/smooth/trajectory/")
_LC = ("printed/linear/limit-cycle/", "printed/smooth/limit-cycle/")
_HET = tuple(f"{name}/{law}/heteroclinic/" for name in ("printed", "calibrated") for law in ("linear", "smooth"))
_NEAR = ("printed/linear/near-heteroclinic/", "printed/smooth/near-heteroclinic/")
_ROT = ("printed/linear/rotating-cycle/", "printed/smooth/rotating-cycle/")


def _reversed(q: Quantity, store: Store) -> float | None:
    """Eigenvalues in ascending order."""
    _, n, part = q.name.split("_")
    return right(store[q.id.rsplit("/", 1)[0] + f"/lambda_{4 - int(n)}_{part}"])


def _modulus(q: Quantity, store: Store) -> float | None:
    stem = q.id.removesuffix("_re").removesuffix("_im")
    size = math.hypot(store[f"{stem}_re"].for_doubles, store[f"{stem}_im"].for_doubles)
    return size if q.id.endswith("_re") else 0.0


def _order(by: int) -> Callable[[Quantity, Store], float | None]:
    """Orders counted from another one."""

    def change(q: Quantity, store: Store) -> float | None:
        head, n = q.id.rsplit("_", 1)
        other = store.get(f"{head}_{int(n) + by}")
        return None if other is None else right(other)

    return change


def _weighted(weight: Callable[[int], float]) -> Callable[[Quantity, Store], float | None]:
    return lambda q, store: right(q) * weight(int(q.name.rsplit("_", 1)[1]))


def _sample(by: int) -> Callable[[Quantity, Store], float | None]:
    """The sample before or after."""

    def change(q: Quantity, store: Store) -> float | None:
        head, mark, t = q.id.partition("@")
        other = store.get(f"{head}@{float(t) + 0.5 * by:g}") if mark else None
        return None if other is None else right(other)

    return change


def _intervals(q: Quantity, store: Store) -> float | None:
    if not q.name.startswith("crossing_time#"):
        return None
    head, _, n = q.id.partition("#")
    before = store.get(f"{head}#{int(n) - 1}")
    return right(q) - (0 if before is None else right(before))


def _half_map(q: Quantity, store: Store) -> float | None:
    value = right(q)
    if q.name == "multiplier_slow":
        return math.sqrt(abs(value))
    return value / 2 if q.name.startswith("log_multiplier") or q.name in ("period", "dperiod_domega") else None


def _neighbour(q: Quantity, store: Store) -> float | None:
    """The cycle of the next speed in the list."""
    speeds = [
        "crit-0.01",
        "crit-0.05",
        "crit-0.1",
        "crit-0.2",
        "crit-0.3",
        "crit-0.4",
        "crit-0.5",
        "crit-0.6",
        "crit-0.7",
    ]
    entry = q.id.split("/")[3]
    place = speeds.index(entry) + 1
    return None if place == len(speeds) else right(store[q.id.replace(entry, speeds[place])])


_ORBITS = ("printed/linear/trajectory/d1", "printed/linear/trajectory/e1", "printed/smooth/trajectory/d2")


def _run(store: Store, prefix: str, change: Callable[[Any, Any, Any], Any], **replaced: Any) -> Sheet:
    """Fixed steps of 1e-3 s or what ``change`` makes of them; crossings by the steps' own straight lines."""
    given: Sheet = {}
    asked = store.matching(prefix + "/")
    p = {**PARAMETERS, "epsilon": PARAMETERS["eps"], **replaced.get("values", {})}
    omega, smooth = float(asked[0].inputs["Omega"]), asked[0].friction == "smooth"

    def rate(y: Any) -> Any:
        gamma_rate, v_rate, _ = motion(math, p, omega, smooth, y.tolist())
        return np.array([y[2], gamma_rate, v_rate])

    step = replaced.get("step", 1e-3)
    y = np.array([float(asked[0].inputs[name]) for name in ("beta", "gamma", "v")])
    states, times = [y], [0.0]
    for n in range(round(10 / step)):
        y = change(rate, y, step)
        states.append(y)
        times.append((n + 1) * step)
        if not 0 < y[0] < math.pi:
            break
    crossings = []
    for n in range(1, len(states)):
        a, b = states[n - 1][0] - math.pi / 2, states[n][0] - math.pi / 2
        if a * b < 0 and times[n] > 0.01:
            share = a / (a - b)
            crossings.append((times[n - 1] + share * step, states[n - 1] + share * (states[n] - states[n - 1])))
    for q in asked:
        name, place = placed(q.name)
        if "t" in place and round(float(place["t"]) / step) < len(states):
            given[q.id] = repr(float(states[round(float(place["t"]) / step)][("beta", "gamma", "v").index(name)]))
        if "n" in place and int(place["n"]) <= len(crossings):
            t, x = crossings[int(place["n"]) - 1]
            given[q.id] = repr(float({"crossing_time": t, "crossing_gamma": x[1], "crossing_v": x[2]}[name]))
    return given


def _rk4(rate: Any, y: Any, step: float) -> Any:
    a = rate(y)
    b = rate(y + step / 2 * a)
    c = rate(y + step / 2 * b)
    return y + step / 6 * (a + 2 * b + 2 * c + rate(y + step * c))


def _euler(rate: Any, y: Any, step: float) -> Any:
    return y + step * rate(y)


def _rk4_single(rate: Any, y: Any, step: float) -> Any:
    return _rk4(rate, y, step).astype(np.float32).astype(float)


def _fixed(change: Any, **replaced: Any) -> Callable[[Store], Sheet]:
    def answers(store: Store) -> Sheet:
        given = outputs(lambda q, s: None)(store)
        for prefix in _ORBITS:
            given |= _run(store, prefix, change, **replaced)
        return given

    return answers


def _tolerance(method: str, tolerance: float, rhs: bool = True) -> Callable[[Store], Sheet]:
    def answers(store: Store) -> Sheet:
        return (outputs(lambda q, s: None)(store) if rhs else {}) | answered(store, _ORBITS, method, tolerance)

    return answers


def tight(
    rhs: bool = True, start: Callable[[str, float], float] = lambda name, x: x, **values: float
) -> Callable[[Store], Sheet]:
    """Trajectories at a tight tolerance with other parameters or starts; samples in time only."""

    def answers(store: Store) -> Sheet:
        given = outputs(lambda q, s: None)(store) if rhs else {}
        for prefix in _ORBITS:
            asked = [q for q in store.matching(prefix + "/") if "@" in q.name]
            p = {**PARAMETERS, "epsilon": PARAMETERS["eps"], **values}
            smooth = values.get("smooth", asked[0].friction == "smooth")
            inputs = {name: start(name, float(asked[0].inputs[name])) for name in ("Omega", "beta", "gamma", "v")}
            times = sorted({float(placed(q.name)[1]["t"]) for q in asked})

            def rates(
                t: float, y: Any, p: Any = p, omega: float = inputs["Omega"], smooth: Any = smooth
            ) -> Sequence[float]:
                gamma_rate, v_rate, _ = motion(math, p, omega, smooth, y.tolist())
                return [y[2], gamma_rate, v_rate]

            first = [inputs[name] for name in ("beta", "gamma", "v")]
            run = solve_ivp(rates, (0, 10), first, "DOP853", times, rtol=1e-11, atol=1e-11)
            for q in asked:
                name, place = placed(q.name)
                given[q.id] = repr(float(run.y[("beta", "gamma", "v").index(name)][times.index(float(place["t"]))]))
        return given

    return answers


def _rounded_start(name: str, x: float) -> float:
    return round(x, 4)


def _after(name: str, words: str, change: Any, *prefixes: str, rhs: bool = True) -> Fault:
    return Fault(name, words, outputs(change, *prefixes, rhs=rhs))


_STEADY = (
    _after("eig-ascending", "eigenvalue|lambda_", _reversed, _EQ),
    _after("eig-conjugate", "sign&_im", on(*(f"lambda_{n}_im" for n in (1, 2, 3)), by=lambda x: -x), _EQ),
    _after("eig-sides", "other equilibrium|noninverted", swapped("/inverted-", "/noninverted-"), _EQ),
    _after("eig-modulus", "modulus|absolute", _modulus, _EQ),
    _after("eig-sign", "-1|sign", lambda q, s: -right(q), _EQ),
    _after("eig-hertz", "2 pi", lambda q, s: right(q) / 2 / math.pi, _EQ),
    _after("eig-six-digits", "6 significant digits", lambda q, s: f"{right(q):.6g}", _EQ),
    _after("eig-exchange", "lambda_1|lambda_2|eigenvalue", swapped("lambda_1", "lambda_2"), _EQ),
    _after("crit-hertz", "2 pi|turns", on("omega_crit", by=lambda x: x / 2 / math.pi), *_HOPF),
    _after("crit-half", "half", on("period", by=lambda x: x / 2), *_HOPF),
    _after("crit-frequency", "2 pi/period|2 pi divided|frequency", on("period", by=lambda x: 2 * math.pi / x),
        *_HOPF),
    _after("l1-sign", "first_lyapunov_coefficient&sign|first_lyapunov_coefficient&-1",
        on("first_lyapunov_coefficient", by=lambda x: -x), *_HOPF),
    _after("slope-sign", "-1|sign", on("transversality", "period_slope", "amplitude_squared_slope",
        by=lambda x: -x), *_HOPF),
    _after("slope-root", "root", on("amplitude_squared_slope", by=math.sqrt), *_HOPF),
    _after("balance-printed", "printed one-harmonic", swapped("consistent-", "printed-"), _HB),
    _after("balance-square", "square", on("amplitude", by=lambda x: x * x), _HB),
    _after("balance-peak", "amplitude&2|peak", on("amplitude", by=lambda x: 2 * x), _HB),
    _after("balance-hertz", "2 pi|turns", on("frequency", by=lambda x: x / 2 / math.pi), _HB),
    _after("balance-degrees", "degrees", on("amplitude", by=math.degrees), _HB),
    _after("manifold-index", "order", _order(1), _SM),
    _after("manifold-eps", "epsilon|0.1", _weighted(lambda n: 0.1**n), _SM),
    _after("manifold-factorial", "factorial", _weighted(lambda n: float(math.factorial(n))), _SM),
    _after("manifold-sign", "residual&-1|residual&sign", lambda q, s: -right(q) if "residual" in q.name else None,
        _SM),
    _after("manifold-alternating", "sign", _weighted(lambda n: (-1.0) ** n), _SM),
)  # fmt: skip
_MOTION = (
    _after("fly-rounded", "6 significant digits|decimals", lambda q, s: f"{right(q):.3f}", *_FLY),
    _after("fly-degrees", "degrees", on("beta", "gamma", "crossing_gamma", by=math.degrees), *_FLY),
    _after("fly-modulo", "whole turns|modulo", on("gamma", "crossing_gamma", by=lambda x: x % (2 * math.pi)), *_FLY),
    _after("fly-shifted", "pi/2|_bar", on("beta", "gamma", "crossing_gamma", by=lambda x: x - math.pi / 2), *_FLY),
    _after("fly-late", "sample", _sample(-1), *_FLY),
    _after("fly-early", "sample", _sample(1), *_FLY),
    _after("fly-columns", "gamma&v&exchanged", swapped("/gamma@", "/v@"), *_FLY),
    _after("fly-start-counted", "previous crossing|crossing before|before", shifted(-1), *_FLY),
    _after("fly-one-missed", "next crossing|crossing after|after", shifted(1), *_FLY),
    _after("fly-intervals", "interval|since", _intervals, *_FLY),
    _after("fly-milliseconds", "milliseconds|1000", on("crossing_time", "flat_time", by=lambda x: 1000 * x), *_FLY),
    _after("fly-image", "symmetry|mirror|image|pi minus", lambda q, s: {"beta": math.pi - right(q),
        "gamma": math.pi - right(q), "v": -right(q)}.get(placed(q.name)[0]), *_FLY),
    _after("fly-v-sign", "v&sign|v&-1", on("v", "crossing_v", by=lambda x: -x), *_FLY),
    Fault("fly-1e-4", "tolerance", _tolerance("RK45", 1e-4)),
    Fault("fly-1e-3", "tolerance", _tolerance("LSODA", 1e-3)),
    Fault("fly-1e-5", "tolerance", _tolerance("RK23", 1e-5)),
    Fault("fly-linear-events", "crossing", _fixed(_rk4, step=4e-3)),
    Fault("fly-euler", "tolerance|step", _fixed(_euler)),
    Fault("fly-single", "single precision|tolerance|step", _fixed(_rk4_single)),
    Fault("fly-start", "start&rounded|start", tight(start=_rounded_start)),
    Fault("fly-linear-law", "linear", tight(smooth=False)),
    Fault("fly-mu-alone", "mu&0.31", tight(rhs=False, mu=0.31)),
    Fault("fly-g-alone", "9.80665", tight(rhs=False, g=9.80665)),
    Fault("fly-omega", "sign of omega|pi minus", tight(start=lambda name, x: -x if name == "Omega" else x)),
    Fault("fly-A-alone", "a = 0.00025", tight(rhs=False, A=0.25e-3)),
)  # fmt: skip
_CYCLES = (
    _after("lc-half", "half", on("period", "dperiod_domega", by=lambda x: x / 2), *_LC),
    _after("lc-half-period-only", "half&period|period&1/2", on("period", by=lambda x: x / 2), *_LC),
    _after("lc-half-map", "half map|half&root|root&half", _half_map, *_LC),
    _after("lc-double", "period&2|twice", on("period", by=lambda x: 2 * x), *_LC),
    _after("lc-other-side", "other side|-1|sign", on("gamma_bar_0", "v_0", "dgamma_bar_0_domega", "dv_0_domega",
        by=lambda x: -x), *_LC),
    _after("lc-unshifted", "gamma or beta|pi/2", on("gamma_bar_0", by=lambda x: x + math.pi / 2), *_LC),
    _after("lc-logs", "common logarithm|ln 10", on("log_multiplier_slow", "log_multiplier_fast",
        by=lambda x: x / math.log(10)), *_LC),
    _after("lc-differences", "differences", on("dperiod_domega", "dgamma_bar_0_domega", "dv_0_domega",
        by=lambda x: x * (1 + 3e-5 * math.sin(1e5 * x))), *_LC),
    _after("lc-below", "-1|sign", on("dperiod_domega", "dgamma_bar_0_domega", "dv_0_domega", by=lambda x: -x), *_LC),
    _after("lc-degrees", "degrees", on("beta_max", "gamma_bar_0", by=math.degrees), *_LC),
    _after("lc-peak", "beta_max&2|peak", on("beta_max", by=lambda x: 2 * x), *_LC),
    _after("lc-beta-max-unshifted", "pi/2", on("beta_max", by=lambda x: x + math.pi / 2), *_LC),
    _after("lc-fast-rounding", "rounding|monodromy", on("log_multiplier_fast",
        by=lambda x: -36 - math.sin(1e6 * x)), *_LC),
    _after("lc-frequency", "2 pi/period|frequency", on("period", by=lambda x: 2 * math.pi / x), *_LC),
    _after("lc-neighbour", "another speed|next|neighbour|another entry", _neighbour, *_LC),
    _after("lc-exchanged", "exchanged", swapped("log_multiplier_slow", "log_multiplier_fast"), *_LC),
    _after("lc-five-digits", "5 significant digits", lambda q, s: f"{right(q):.5g}", *_LC),
    _after("lc-exponent", "period|per unit of time|floquet exponent", lambda q,
        s: right(q) / right(s[q.id.rsplit("/", 1)[0] + "/period"]) if q.name.startswith("log_") else None, *_LC),
    _after("lc-reciprocal", "reciprocal|1/", on("multiplier_slow", by=lambda x: 1 / x), *_LC),
    _after("lc-v-sign", "v_0", on("v_0", by=lambda x: -x), *_LC),
    _after("het-hertz", "2 pi|turns", on("omega_h", by=lambda x: x / 2 / math.pi), *_HET),
    _after("het-rpm", "turns per minute", on("omega_h", by=lambda x: x * 30 / math.pi), *_HET),
    _after("het-exchanged", "lambda_s&lambda_ss",
        other(lambda id_: id_ + "s" if id_.endswith("_s") else id_[:-1] if id_.endswith("_ss") else id_), *_HET),
    _after("het-sizes", "-1|sign|absolute", on("lambda_s", "lambda_ss", by=abs), *_HET),
    _after("het-law", "linear", other(lambda id_: id_.replace("/smooth/", "/linear/")), *_HET),
    _after("near-half", "half|period&1/2", on("period", by=lambda x: x / 2), *_NEAR),
    _after("near-root", "half map|root", on("multiplier_slow", by=math.sqrt), *_NEAR),
    _after("near-five-digits", "3 significant digits", lambda q, s: f"{right(q):.3g}", *_NEAR),
    _after("rot-forms", "unstable", swapped("/stable-", "/unstable-"), *_ROT),
    _after("rot-mirror", "-1|sign|mirror", lambda q, s: -right(q) if q.name.startswith(("beta", "v_", "dbeta",
        "dv")) else None, *_ROT),
    _after("rot-sections", "beta_bar_0&beta_bar_top", swapped("beta_bar_0", "beta_bar_top"), *_ROT),
    _after("rot-unshifted", "beta is|beta_bar|pi/2", on("beta_bar_0", "beta_bar_top",
        by=lambda x: x + math.pi / 2), *_ROT),
)  # fmt: skip

LATER = (*_STEADY, *_MOTION, *_CYCLES)
