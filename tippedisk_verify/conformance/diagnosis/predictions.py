"""What an alternative model would answer, in double: enough digits to recognise it by."""

from __future__ import annotations

import cmath
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

from tippedisk_verify.conformance.diagnosis.alternatives import CORRECT, Alternative, spelled
from tippedisk_verify.conformance.sheet import placed
from tippedisk_verify.model import equations
from tippedisk_verify.model.parameters import SYMBOLS, Constants, Parameters
from tippedisk_verify.reference_values.draws import DRAWN_SET, parameters_of
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["Model", "constants_of", "eigenvalues", "predicted"]

_STATE = ("beta", "gamma", "v")
_STEP = 1e-40  # imaginary: the derivative is exact to rounding
_TOLERANCE = 1e-12
_DURATION = 10.0
_EVALUATIONS = 2e4  # a second of an orbit; the right one takes a tenth of this
_RETURNS = 1e-3  # rad, rad/s; the model that answered brings its cycle back closer than that
_SOLVED = 1e-8  # what the smooth law's kink leaves of the tolerance
_FORETOLD = 20.0
_START = 0.01  # s; a crossing before this is the start itself


class Model:
    """The equations as the alternative has them, for one set and law."""

    def __init__(self, alternative: Alternative, set_name: str, friction: str) -> None:
        self.alternative = alternative
        law = alternative.friction or friction
        self.friction = "smooth" if law == "smooth" else "linear"
        exact = parameters_of(set_name)
        values: dict[str, Any] = {name: getattr(exact, name) for name in SYMBOLS}
        if alternative.parameters is not None:
            values |= alternative.parameters(exact)
        if "Bbar" not in values:
            values["Bbar"] = Fraction(values["B"]) - Fraction(values["m"]) * Fraction(values["e"]) ** 2
        self.p = SimpleNamespace(pi=alternative.pi, **{name: float(value) for name, value in values.items()})

    def inputs(self, quantity: Quantity) -> dict[str, Any]:
        given: dict[str, Any] = {}
        for name, text in quantity.inputs.items():
            try:
                given[name] = float(text)
            except ValueError:
                given[name] = text
        return self.alternative.inputs(given) if self.alternative.inputs is not None else given

    def parts(self, ops: Any, omega: Any, state: Sequence[Any], side: Any = None) -> dict[str, Any]:
        return spelled(self.alternative.spelling, ops, self.p, omega, state, self.friction, side)

    def rates(self, omega: float, start: Sequence[float]) -> Callable[[float, Any], list[float]]:
        if self.alternative.spelling == CORRECT and self.alternative.drift is None:  # a tenth of the time
            whole = equations.field(math, self.constants(), omega, "smooth" if self.friction == "smooth" else "linear")
            return lambda t, y: list(whole(*y.tolist()))
        frozen = self.alternative.spelling.smoothed == "frozen"
        side = math.copysign(1.0, self.parts(math, omega, start)["gamma_y"]) if frozen else None

        name, factor = self.alternative.drift or ("", None)

        def function(t: float, y: Any) -> list[float]:
            beta, gamma, v = y.tolist()
            p, speed = self.p, omega
            if factor is not None and name == "Omega":
                speed *= factor(t)
            elif factor is not None:
                p = SimpleNamespace(**vars(p) | {name: factor(t) * getattr(p, name)})
            parts = spelled(self.alternative.spelling, math, p, speed, (beta, gamma, v), self.friction, side)
            return [v, parts["gamma_rate"], parts["v_rate"]]

        return function

    def jacobian(self, omega: float, state: Sequence[float]) -> list[list[float]]:
        """d(gamma', v') / d(state), two rows, by imaginary steps."""
        side = math.copysign(1.0, self.parts(math, omega, state)["gamma_y"])
        rows: list[list[float]] = [[], []]
        for place in range(3):
            moved = [complex(part, _STEP * (n == place)) for n, part in enumerate(state)]
            parts = self.parts(cmath, omega, moved, side)
            for row, name in zip(rows, ("gamma_rate", "v_rate"), strict=True):
                row.append(complex(parts[name]).imag / _STEP)
        return rows

    def constants(self) -> Constants:
        return constants_of(self.p)


def constants_of(p: Any) -> Constants:
    """From parameters with Bbar among them, numbers or arrays."""
    return Constants(
        p.r, p.e, p.m, p.A, p.B, p.Bbar, p.g, p.mu, p.epsilon,
        p.A / p.m, p.Bbar / p.m, p.mu * p.g / p.epsilon, p.mu * p.g,
    )  # fmt: skip


def predicted(
    alternative: Alternative,
    quantities: Sequence[Quantity],
    store: Store,
    truth: Mapping[str, float],
    answers: Mapping[str, float] | None = None,
) -> dict[str, float]:
    """The alternative's answers to questions of one entry; those that it cannot tell are missing.

    ``truth`` has the right answers by id. A cycle is looked for where ``answers`` (the right ones if None) have it.
    """
    first = quantities[0]
    if "set" in alternative.counterpart and DRAWN_SET.fullmatch(first.set):  # no stored value is the counterpart
        other = Parameters.named(alternative.counterpart["set"])
        alternative = Alternative("", "", parameters=lambda _: {name: getattr(other, name) for name in SYMBOLS})
    if alternative.counterpart:
        return _counterparts(alternative, quantities, store, truth)
    if alternative.output is not None:
        return {q.id: alternative.output(placed(q.name)[0], truth[q.id]) for q in quantities}
    compute = _BY_KIND.get(first.kind)
    if compute is None and first.kind not in ("limit-cycle", "near-heteroclinic"):
        return {}
    try:
        model = Model(alternative, first.set, first.friction)
        numbers = _cycle(model, quantities, answers or {}) if compute is None else compute(model, quantities)
    except (ArithmeticError, ValueError, RuntimeError):  # the mistaken model has no such thing
        return {}
    return {q.id: numbers[q.name] for q in quantities if q.name in numbers and math.isfinite(numbers[q.name])}


def _counterparts(
    alternative: Alternative, quantities: Sequence[Quantity], store: Store, truth: Mapping[str, float]
) -> dict[str, float]:
    counterparts = {}
    for quantity in quantities:
        set_name, friction, kind, entry, name = quantity.id.split("/", 4)
        change = alternative.counterpart
        set_name = change.get("set", set_name)
        if friction != "both":
            friction = change.get("friction", friction)
        if "form" in change and "form" in quantity.inputs:
            entry = f"{change['form']}-{entry.split('-', 1)[1]}"
        other = store.get(f"{set_name}/{friction}/{kind}/{entry}/{name}")
        if other is not None:
            counterparts[quantity.id] = other.for_doubles
    return counterparts


# ------------------------------------------------------------------------------------------ by kind
def _rhs(model: Model, quantities: Sequence[Quantity]) -> dict[str, float]:
    given = model.inputs(quantities[0])
    omega, state = given["Omega"], [given[name] for name in ("beta", "gamma", "v")]
    values = {name: float(value) for name, value in model.parts(math, omega, state).items()}
    slopes = model.jacobian(omega, state)[1]
    return values | dict(zip(("dv_rate_dbeta", "dv_rate_dgamma", "dv_rate_dv"), slopes, strict=True))


def eigenvalues(model: Model, omega: float, side: int) -> list[complex]:
    """Of inverted (1) or noninverted (-1) spinning, by descending real parts."""
    import numpy

    rows = model.jacobian(omega, (model.p.pi / 2, side * model.p.pi / 2, 0.0))
    values = [complex(value) for value in numpy.linalg.eigvals(numpy.array([[0.0, 0.0, 1.0], *rows]))]
    return sorted(values, key=lambda value: (-round(value.real, 7), -value.imag))


def _equilibrium(model: Model, quantities: Sequence[Quantity]) -> dict[str, float]:
    given = model.inputs(quantities[0])
    side = 1 if given["equilibrium"] == "inverted" else -1
    values = eigenvalues(model, given["Omega"], side)
    return {
        f"lambda_{n}_{part}": getattr(value, name)
        for n, value in enumerate(values, start=1)
        for part, name in (("re", "real"), ("im", "imag"))
    }


def _hopf(model: Model, quantities: Sequence[Quantity]) -> dict[str, float]:
    """Where the pair crosses, searched within a factor of two of 30 rad/s."""
    from scipy.optimize import brentq

    def growth(omega: float) -> float:
        values = eigenvalues(model, omega, 1)
        return max((value.real for value in values if abs(value.imag) > 1e-9), default=math.nan)

    omega = float(brentq(growth, 15.0, 60.0, xtol=1e-13, rtol=1e-14))
    frequency = max(value.imag for value in eigenvalues(model, omega, 1))
    slope = (growth(omega + 1e-4) - growth(omega - 1e-4)) / 2e-4
    return {"omega_crit": omega, "period": 2 * math.pi / frequency, "transversality": slope}


def _balance(model: Model, quantities: Sequence[Quantity]) -> dict[str, float]:
    from tippedisk_verify.theory.harmonic_balance import amplitude_squared, delta

    if model.alternative.spelling != CORRECT:
        return {}
    given, c = model.inputs(quantities[0]), model.constants()
    square = amplitude_squared(c, given["Omega"] ** 2, given["form"])
    frequency = math.sqrt(given["Omega"] ** 2 * c.e / (c.r + c.e) + delta(c, given["Omega"], given["form"]) * square)
    return {"amplitude": math.sqrt(square), "frequency": frequency, "period": 2 * math.pi / frequency}


def _manifold(model: Model, quantities: Sequence[Quantity]) -> dict[str, float]:
    from tippedisk_verify.theory.slow_manifold import invariance_residuals, orders

    if model.alternative.spelling != CORRECT:
        return {}
    given, c = model.inputs(quantities[0]), model.constants()
    place = (given["Omega"], given["beta"], given["gamma"])
    highest = max(int(quantity.name[-1]) for quantity in quantities)
    numbers = {f"h_{n}": float(h) for n, h in enumerate(orders(math, c, *place, highest))}
    if any(quantity.name.startswith("residual") for quantity in quantities):
        residuals = invariance_residuals(math, c, *place, highest)
        numbers |= {f"residual_{n}": float(h) for n, h in enumerate(residuals)}
    return numbers


def _trajectory(model: Model, quantities: Sequence[Quantity]) -> dict[str, float]:
    from scipy.integrate import solve_ivp

    given = model.inputs(quantities[0])
    places = [placed(quantity.name)[1] for quantity in quantities]
    times = sorted({float(place["t"]) for place in places if "t" in place})
    crossings = any("n" in place for place in places)

    end = _DURATION if crossings or not times else times[-1]
    rates = model.rates(given["Omega"], [given[name] for name in _STATE])
    left = itertools.count(int(_EVALUATIONS * end), -1)

    def function(t: float, y: Any) -> list[float]:
        if not next(left):
            raise ArithmeticError("stiff: another model than the one that answered")
        return rates(t, y)

    def section(t: float, y: Any) -> float:
        return math.sin(model.p.pi / 2 - y[0])

    def flat(t: float, y: Any) -> float:
        return math.sin(y[0])

    flat.terminal = True  # type: ignore[attr-defined]
    solution = solve_ivp(
        function,
        (0.0, end),
        [given[name] for name in ("beta", "gamma", "v")],
        method="DOP853",
        t_eval=times,
        events=(section, flat),
        rtol=_TOLERANCE,
        atol=_TOLERANCE,
    )
    numbers: dict[str, float] = {}
    # Before the first sample time solve_ivp returns empty lists.
    for time, state in zip(solution.t, zip(*solution.y, strict=True), strict=True):
        for name, value in zip(("beta", "gamma", "v"), state, strict=True):
            numbers[f"{name}@{time:g}"] = float(value)
    kept = [(t, y) for t, y in zip(solution.t_events[0], solution.y_events[0], strict=True) if t > _START]
    for n, (time, state) in enumerate(kept, start=1):
        numbers[f"crossing_time#{n}"] = float(time)
        if model.alternative.drift is None:  # which the location of crossings may leave out
            numbers |= {f"crossing_gamma#{n}": float(state[1]), f"crossing_v#{n}": float(state[2])}
    if len(solution.t_events[1]):
        numbers["flat_time"] = float(solution.t_events[1][0])
    return numbers


def _cycle(model: Model, quantities: Sequence[Quantity], near: Mapping[str, float]) -> dict[str, float]:
    """Half-period shooting from the state that was answered; the symmetry survives all the mistakes that are listed.

    A model that does not bring that state back to itself, nearly, is not the one that answered: nothing is predicted.
    """
    from scipy.integrate import solve_ivp
    from scipy.optimize import root

    omega, half_pi = model.inputs(quantities[0])["Omega"], model.p.pi / 2
    answered = {quantity.name: near.get(quantity.id, quantity.for_doubles) for quantity in quantities}
    if not {"gamma_bar_0", "v_0"} <= answered.keys():
        return {}
    period = next((quantity for quantity in quantities if quantity.name == "period"), None)
    shift = omega / float(quantities[0].inputs["Omega"]) - 1
    if shift and period is not None:
        # A quick look at the slope, which holds near the connection within the logarithm of a hundred or so.
        share = (answered["period"] - period.for_doubles) / (float(period.condition["Omega"]) * shift)
        if not 1 / _FORETOLD < share < _FORETOLD:
            return {}
    rates = model.rates(omega, [half_pi, answered["gamma_bar_0"] + half_pi, answered["v_0"]])

    def section(t: float, y: Any) -> float:
        return math.sin(half_pi - y[0]) if t > 1e-3 else math.copysign(1.0, -y[2])

    section.terminal = True  # type: ignore[attr-defined]

    def flight(unknown: Any) -> tuple[float, list[float]]:
        start = [half_pi, half_pi + float(unknown[0]), float(unknown[1])]
        solution = solve_ivp(
            rates, (0.0, 4.0), start, method="DOP853", events=section, rtol=_TOLERANCE, atol=_TOLERANCE
        )
        if not len(solution.t_events[0]):
            raise ArithmeticError("no return")
        end = solution.y_events[0][0]
        return float(solution.t_events[0][0]), [half_pi - end[1] - unknown[0], -end[2] - unknown[1]]

    state = [answered["gamma_bar_0"], answered["v_0"]]
    if not max(map(abs, flight(state)[1])) < _RETURNS:
        return {}
    state = root(lambda unknown: flight(unknown)[1], state, tol=_TOLERANCE).x
    time, residual = flight(state)
    if not max(map(abs, residual)) < _SOLVED or abs(state[0]) < _RETURNS:
        return {}
    return {"period": 2 * time, "gamma_bar_0": float(state[0]), "v_0": float(state[1])}


_BY_KIND: dict[str, Callable[[Model, Sequence[Quantity]], dict[str, float]]] = {
    "rhs": _rhs,
    "equilibrium": _equilibrium,
    "hopf": _hopf,
    "harmonic-balance": _balance,
    "slow-manifold": _manifold,
    "trajectory": _trajectory,
}
