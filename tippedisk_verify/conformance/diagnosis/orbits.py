"""Levels 6 to 10: whether orbits and cycles are those of a mended program, and the method that an orbit's errors show.

A cycle is not sought again: it is enough that the answered state comes back to itself in the answered time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.entries import Array, Table, fitted
from tippedisk_verify.conformance.diagnosis.levels import base_of, matrix
from tippedisk_verify.conformance.diagnosis.terms import FUNCTIONS, Term, Values, parsed

__all__ = ["method", "motions"]

Rates = Callable[[Array], Array]
Scheme = tuple[tuple[float, ...], tuple[float, ...]]  #: what each slope after the first steps by, and the weights
_STATE = ("beta", "gamma", "v")
_STEP = 2e-3  # s; friction damps with some 130/s, so that a step of RK4 leaves about 1e-7
_LAST = 1.0  # s, of the samples that a mended program is held against
_CLOSED = 1e-5  # rad, of a cycle that comes back
_NEAR = 1e-4  # rad, from the saddle; and the relative distance on either side of Omega_h
_LEAVES = 0.02  # of the errors: what a method with a fixed step may leave
_TRIED = 3  # orbits that a method is tried on
_STEPS = sorted(f * 10.0**-k for k in range(2, 6) for f in (1, 1.25, 2, 2.5, 4, 5))  # s
_RK4: Scheme = ((0.5, 0.5, 1.0), (1 / 6, 1 / 3, 1 / 3, 1 / 6))
_METHODS: dict[str, tuple[int, Scheme]] = {  # by order
    "the classical Runge-Kutta method": (4, _RK4),
    "Heun's method": (2, ((1.0,), (0.5, 0.5))),
    "the midpoint rule": (2, ((0.5,), (0.0, 1.0))),
    "explicit Euler": (1, ((), (1.0,))),
    "Runge-Kutta with equal weights": (1, ((0.5, 0.5, 1.0), (0.25, 0.25, 0.25, 0.25))),
}


def compiled(values: Values) -> Rates:
    """The rates (beta', gamma', v') of a state as one function, with the other inputs bound."""
    sample = Values(values.definitions, {**values.given, "beta": 0.7, "gamma": 0.3, "v": 0.2})
    for name in ("gamma_rate", "v_rate"):
        sample[name]
    names = {name: f"x{n}" for n, name in enumerate(sample.known)}  # each behind those that go into it

    def product(term: Term) -> str:
        factors = (("*" if power > 0 else "/") + names[name] for name, power in term.factors for _ in range(abs(power)))
        return repr(float(term.number)) + "".join(factors)

    space: dict[str, Any] = {f"f_{name}": function for name, function in FUNCTIONS.items()}
    lines = ["def rates(state):", " beta, gamma, v = state"]
    for name, short in names.items():
        function, _, argument = name[:-1].partition("(")
        total = " + ".join(map(product, sample.terms(name) or parsed(argument if argument else "0")))
        if name in sample.definitions or name.startswith("("):
            lines.append(f" {short} = {total}")
        elif name in _STATE or function == "given" and argument in _STATE:
            lines.append(f" {short} = {argument or name}")
        elif function == "given" or name in sample.given:
            space[short] = sample.given[argument if function == "given" else name]
        else:
            lines.append(f" {short} = f_{function}({total})")
    exec("\n".join([*lines, f" return array([v, {names['gamma_rate']} + 0 * v, {names['v_rate']}])"]), space | {"array": np.array}, space)
    space["rates"].__globals__.update(space)
    return space["rates"]  # type: ignore[no-any-return]


def _stepped(rates: Rates, y: Array, h: Any, scheme: Scheme) -> Array:
    slopes = [rates(y)]
    for share in scheme[0]:
        slopes.append(rates(y + h * share * slopes[-1]))
    return y + h * sum(weight * slope for weight, slope in zip(scheme[1], slopes, strict=True))


def flown(rates: Rates, y: Array, time: Any, step: float = _STEP, scheme: Scheme = _RK4) -> Array:
    """The states after a time [s], which may differ between orbits."""
    count = max(1, int(np.ceil(np.nanmax(time) / step - 1e-9)))
    with np.errstate(all="ignore"):
        for _ in range(count):
            y = _stepped(rates, y, time / count, scheme)
    return y


def _rows(values: Values, rows: Sequence[int] | Array) -> Values:
    given = {name: x[rows] if np.ndim(x) else x for name, x in values.given.items()}
    return Values(values.definitions, given)


def motions(table: Table, definitions: Mapping[str, Any]) -> None:
    """Take out all wrong answers of a table if what is tried of its motions are those of a program."""
    values = base_of(definitions, table)
    follows = {"trajectory": _samples, "limit-cycle": _closed, "near-heteroclinic": _closed, "rotating-cycle": _closed}
    if table.left.any() and follows.get(table.kind, _connected if table.kind == "heteroclinic" else lambda *_: False)(table, values):
        table.left[:] = False


def _samples(table: Table, values: Values) -> bool:
    """Whether the first samples are on the orbits of a program."""
    times = np.array([float(one.get("t", "nan")) for one in table.places])
    rates, y, now = compiled(values), np.array([values[name] for name in _STATE]), 0.0
    predicted = np.full(len(times), np.nan)
    for time in np.unique(times[times <= _LAST]):
        y, now = flown(rates, y, time - now), time
        here = times == time
        which = [_STATE.index(stem) for stem in table.stems[here]]
        predicted[here] = y[which, table.rows[here]]
    tried = np.isfinite(predicted)
    fits = fitted(table.answer, table.truth, table.allowed, table.left, predicted)
    return bool((tried & table.left).any() and fits[tried].all())


def _closed(table: Table, values: Values) -> bool:
    """Whether the answered states come back in the answered times."""
    turning = table.kind == "rotating-cycle"
    x, v, period = (table.column(name, table.answer) for name in (("beta_bar_top", "v_top") if turning else ("gamma_bar_0", "v_0")) + ("period",))
    rows = np.flatnonzero(np.isfinite(x + v + period) & (np.abs(period) < 10))
    wrong = np.isin(rows, table.rows[table.left])
    if not wrong.any():
        return False
    rows, x, v, period = rows[wrong], x[rows[wrong]], v[rows[wrong]], period[rows[wrong]]
    quarter = np.pi / 2 + 0 * x
    start = np.array([quarter + x, quarter, v] if turning else [quarter, quarter + x, v])
    end = flown(compiled(_rows(values, rows)), start, period if turning else period / 2)
    image = [quarter + x, quarter + 2 * np.pi, v] if turning else [quarter, quarter - x, -v]
    return bool((np.abs(end - np.array(image)) < _CLOSED * np.maximum(1, np.abs(v))).all())


def _connected(table: Table, values: Values) -> bool:
    """Whether the saddle's orbit passes its copy below the answered Omega_h, and turns back above it."""
    speed = table.column("omega_h", table.answer)
    if not np.isfinite(speed).all():
        return False
    passes = []
    for side in (1 - _NEAR, 1 + _NEAR):
        at = Values(values.definitions, {**values.given, "Omega": speed * side, "side": -1.0 + 0 * speed})
        eigenvalues, vectors = np.linalg.eig(matrix(at))
        away = np.array([one[:, np.argmax(z.real)].real for z, one in zip(eigenvalues, vectors, strict=True)]).T
        y = np.array([[np.pi / 2], [-np.pi / 2], [0.0]]) + _NEAR * away * np.sign(away[0])
        rates, over, back = compiled(at), np.zeros(len(speed), bool), np.zeros(len(speed), bool)
        for _ in range(int(4 / _STEP)):
            y = _stepped(rates, y, _STEP, _RK4)
            over |= ~back & (y[1] > 1.5 * np.pi)
            back |= ~over & (y[0] < np.pi / 2)
        passes.append(over)
    return bool((passes[0] & ~passes[1]).all())


def method(table: Table, definitions: Mapping[str, Any]) -> str:
    """The method with a fixed step whose own errors are those of the first samples; these answers are taken out."""
    samples = [(row, [table.column(f"{x}@0.5", values) for x in _STATE]) for row in range(len(table.entries)) for values in (table.answer,)]
    answered = [row for row, columns in samples if np.isfinite([column[row] for column in columns]).all()][:_TRIED]
    if not answered or table.kind != "trajectory" or not table.left.any():
        return ""
    values = _rows(base_of(definitions, table), answered)
    rates, start = compiled(values), np.array([values[name] for name in _STATE])
    right = flown(rates, start, 0.5, _STEP / 4)
    error = np.array([table.column(f"{x}@0.5", table.answer)[answered] for x in _STATE]) - right
    for name, (order, scheme) in _METHODS.items():
        size = float(np.linalg.norm(flown(rates, start, 0.5, _STEP, scheme) - right) / np.linalg.norm(error))
        guess = _STEP * max(size, 1e-300) ** (-1 / order)
        for step in sorted(_STEPS, key=lambda step: abs(np.log(step / guess)))[:4]:
            made = flown(rates, start, 0.5, step, scheme) - right
            if np.linalg.norm(made - error) < _LEAVES * np.linalg.norm(error):
                table.left[:] = False
                return f"the orbits have the errors of {name} at a fixed step of {1000 * step:g} ms"
    return ""
