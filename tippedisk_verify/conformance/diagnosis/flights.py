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
from tippedisk_verify.conformance.diagnosis.predictions import Model, constants_of
from tippedisk_verify.model import equations
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = [
    *("RK4", "Field", "Orbits", "Step", "field", "flown", "half_map", "rates_at", "runge_kutta", "states_at"),
]

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
    drifts: Mapping[str, Callable[[Array], Array]] | None = None,
) -> Field:
    """The equations with other parameters, and with factors on their terms; each value may be an array of lanes.

    With ``drifts``, factors of speed and parameters by the time, states have the time as a fourth row.
    """
    right = Model(Alternative("", ""), set_name, friction)
    p = vars(right.p) | dict(parameters or {})
    if "B" in (parameters or {}) or {"m", "e"} & (parameters or {}).keys():
        p["Bbar"] = (parameters or {}).get("Bbar", p["B"] - p["m"] * p["e"] ** 2)
    values = SimpleNamespace(**p)
    if not factors and not drifts:  # in half the time
        whole = equations.field(numpy, constants_of(values), omega, right.friction)  # type: ignore[arg-type]
        return lambda y: numpy.stack(whole(*y))
    spelling = replace(CORRECT, extra=tuple((name, number, ()) for name, number in (factors or {}).items()))

    def rates(y: Array) -> Array:
        parts = spelled(spelling, numpy, values, omega, y, right.friction)
        return numpy.stack([y[2], parts["gamma_rate"], parts["v_rate"]])

    def drifting(y: Array) -> Array:
        now = {name: factor(y[3]) for name, factor in (drifts or {}).items()}
        here = SimpleNamespace(**p | {name: x * p[name] for name, x in now.items() if name != "Omega"})
        parts = spelled(spelling, numpy, here, omega * now.get("Omega", 1.0), y[:3], right.friction)
        return numpy.stack([y[2], parts["gamma_rate"], parts["v_rate"], numpy.ones_like(y[3])])

    return drifting if drifts else rates


def runge_kutta(table: Sequence[Sequence[float]]) -> Step:
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


class Orbits:
    """Right orbits at all times: as far as they are stored, and half a second on."""

    def __init__(self, here: Sequence[Quantity], store: Store) -> None:
        self._first, starts, speeds = list[int](), list[list[float]](), list[float]()
        for quantity in here:
            self._first.append(len(starts))
            entry, time = quantity.id.rsplit("/", 1)[0], 0.0
            state = [float(quantity.inputs[name]) for name in _STATE]
            while True:
                starts.append(state)
                speeds.append(float(quantity.inputs["Omega"]))
                time += _BETWEEN
                stored = [store.get(f"{entry}/{name}@{time:g}") for name in _STATE]
                if any(value is None for value in stored):
                    break
                state = [value.for_doubles for value in stored if value is not None]
        self._last = numpy.array([*self._first[1:], len(starts)]) - 1
        f, y, self._h = (
            field(here[0].set, here[0].friction, numpy.array(speeds)),
            numpy.array(starts).T,
            _BETWEEN / _STEPS,
        )
        states = [y]
        for _ in range(_STEPS):
            states.append(RK4(f, states[-1], self._h))
        self._states, self._rates = numpy.stack(states), numpy.stack([f(y) for y in states])

    def at(self, orbit: Array, times: Array) -> Array:
        """States, with beta, gamma and v as rows, by Hermite's cubics; NaN beyond."""
        first, last = numpy.array(self._first)[orbit], self._last[orbit]
        times = numpy.clip(numpy.nan_to_num(times, nan=-1.0), -1.0, _BETWEEN * (last - first + 2))
        lane = numpy.clip(first + (times // _BETWEEN).astype(int), first, last)
        rest = (times - _BETWEEN * (lane - first)) / self._h
        step = numpy.clip(rest, 0, _STEPS - 1).astype(int)
        x = numpy.where((rest >= 0) & (rest <= _STEPS), rest - step, math.nan)
        (y, z), (f, g) = (
            (numpy.moveaxis(table[step, :, lane], -1, 0), numpy.moveaxis(table[step + 1, :, lane], -1, 0))
            for table in (self._states, self._rates)
        )
        rise = z - y - self._h * f
        bend = self._h * (g - f) - 2 * rise
        moved: Array = y + x * (self._h * f + x * (rise - bend * (1 - x)))
        return moved


def rates_at(sample: Sequence[Quantity], store: Store) -> dict[str, dict[str, float]]:
    """What the equations have at the right states of these samples, by name and id: gamma', v', gamma_y and so on."""
    times = numpy.array([float(quantity.name.split("@")[1]) for quantity in sample])
    states = states_at(sample, times, store)
    speeds = numpy.array([float(quantity.inputs["Omega"]) for quantity in sample])
    model = Model(Alternative("", ""), sample[0].set, sample[0].friction)
    parts = spelled(CORRECT, numpy, model.p, speeds, states, model.friction)
    names = ("gamma_rate", "v_rate", "gamma_y", "M", "h", "f_G", "w_y", "lambda_Ty", "rho")
    return {name: {q.id: float(x) for q, x in zip(sample, parts[name], strict=True)} for name in names}
