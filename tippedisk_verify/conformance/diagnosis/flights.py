"""Many short flights at once, in double: one step of one method for all of them, as arrays.

A lane is a start, a speed and a model of its own: its parameters, or one factor on each term of the equations.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy

from tippedisk_verify.conformance.diagnosis.alternatives import CORRECT, Alternative, spelled
from tippedisk_verify.conformance.diagnosis.predictions import Model
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["RK4", "Field", "Step", "field", "flown", "half_map", "rates_at", "runge_kutta", "states_at"]

Array = numpy.ndarray[Any, Any]
Field = Callable[[Array], Array]  #: rates of states, both with beta, gamma and v as rows
Step = Callable[[Field, Array, Any], Array]  #: (rates, states, length) -> states; the length may be one for each lane
_DURATION = 10.0  # s, of an orbit
_STATE = ("beta", "gamma", "v")
_BETWEEN = 0.5  # s, of stored samples
_STEPS = 500
_PASSES = 40  # of the secant method on the last step's length


def field(
    set_name: str,
    friction: str,
    omega: Any,
    parameters: Mapping[str, Any] | None = None,
    factors: Mapping[str, Any] | None = None,
) -> Field:
    """The equations with other parameters, and with factors on their terms; each value may be an array of lanes."""
    right = Model(Alternative("", ""), set_name, friction)
    p = vars(right.p) | dict(parameters or {})
    if "B" in (parameters or {}) or {"m", "e"} & (parameters or {}).keys():
        p["Bbar"] = (parameters or {}).get("Bbar", p["B"] - p["m"] * p["e"] ** 2)
    values = SimpleNamespace(**p)
    spelling = replace(CORRECT, extra=tuple((name, number, ()) for name, number in (factors or {}).items()))

    def rates(y: Array) -> Array:
        parts = spelled(spelling, numpy, values, omega, y, right.friction)
        return numpy.stack([y[2], parts["gamma_rate"], parts["v_rate"]])

    return rates


def runge_kutta(table: tuple[tuple[float, ...], ...]) -> Step:
    """An explicit method: its matrix, row by row, and its weights as the last row."""
    *rows, weights = table

    def step(f: Field, y: Array, h: Any) -> Array:
        slopes = [f(y)]
        for row in rows:
            slopes.append(f(y + h * sum(a * k for a, k in zip(row, slopes, strict=False) if a)))
        moved: Array = y + h * sum(b * k for b, k in zip(weights, slopes, strict=True) if b)
        return moved

    return step


RK4 = runge_kutta(((0.5,), (0.0, 0.5), (0.0, 0.0, 1.0), (1 / 6, 1 / 3, 1 / 3, 1 / 6)))


def flown(f: Field, start: Array, duration: Any, count: int, step: Step = RK4) -> Array:
    """The states after ``duration``, in ``count`` steps; NaN where the method blows up."""
    y = start
    with numpy.errstate(all="ignore"):
        for _ in range(count):
            y = step(f, y, duration / count)
    return y


def half_map(f: Field, start: Array, h: float, section: float, longest: float) -> tuple[Array, Array]:
    """Times and states at the return to beta = ``section`` by RK4, its last step to there; NaN if none by ``longest``.

    The start has v < 0, and the return v > 0.
    """
    y, time = start, numpy.zeros(start.shape[1])
    before, begun = numpy.full_like(start, numpy.nan), numpy.full_like(time, numpy.nan)
    gone = numpy.zeros(start.shape[1], dtype=bool)
    with numpy.errstate(all="ignore"):
        for _ in range(int(longest / h)):
            z = RK4(f, y, h)
            home = ~gone & (y[0] < section) & (z[0] >= section)
            before[:, home], begun[home] = y[:, home], time[home]
            gone |= home | ~numpy.isfinite(z[0])
            if gone.all():
                break
            y, time = z, time + h
        rest = (section - before[0]) / before[2]
        for _ in range(_PASSES):
            end = RK4(f, before, rest)
            shift = (section - end[0]) / end[2]
            if not numpy.nanmax(abs(shift), initial=0.0) > 1e-15:
                break
            rest = rest + shift
    return begun + rest, end


def states_at(here: Sequence[Quantity], times: Array, store: Store) -> Array:
    """The right states of the orbits of these questions at these times, three rows; NaN beyond the stored samples."""
    starts = numpy.full((3, len(here)), math.nan)
    rest = numpy.zeros(len(here))
    for lane, (quantity, time) in enumerate(zip(here, times, strict=True)):
        if not 0 <= time <= _DURATION:
            continue
        last = _BETWEEN * math.floor(time / _BETWEEN)
        rest[lane] = time - last
        for row, name in enumerate(_STATE):
            stored = store.get(f"{quantity.id.rsplit('/', 1)[0]}/{name}@{last:g}")
            if not last:
                starts[row, lane] = float(quantity.inputs[name])
            elif stored is not None:
                starts[row, lane] = stored.for_doubles
    speeds = numpy.array([float(quantity.inputs["Omega"]) for quantity in here])
    return flown(field(here[0].set, here[0].friction, speeds), starts, rest, _STEPS)


def rates_at(sample: Sequence[Quantity], store: Store) -> dict[str, dict[str, float]]:
    """What the equations have at the right states of these samples, by name and id: gamma', v', gamma_y and so on."""
    times = numpy.array([float(quantity.name.split("@")[1]) for quantity in sample])
    states = states_at(sample, times, store)
    speeds = numpy.array([float(quantity.inputs["Omega"]) for quantity in sample])
    model = Model(Alternative("", ""), sample[0].set, sample[0].friction)
    parts = spelled(CORRECT, numpy, model.p, speeds, states, model.friction)
    names = ("gamma_rate", "v_rate", "gamma_y", "M", "h", "f_G", "w_y", "lambda_Ty", "rho")
    return {name: {q.id: float(x) for q, x in zip(sample, parts[name], strict=True)} for name in names}
