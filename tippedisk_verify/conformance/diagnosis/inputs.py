"""What people do wrong with inputs: one table of changes of the parameters, the speed and the state."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.entries import Array, Sheet, Table
from tippedisk_verify.conformance.diagnosis.specimen import specimen
from tippedisk_verify.model.parameters import PRINTED, SYMBOLS
from tippedisk_verify.reference_values.store import stored

__all__ = ["INPUTS", "Input", "all_changed", "changed", "known_speeds"]

Values = dict[str, Any]
_STATE = ("Omega", "beta", "gamma", "v")


@dataclass(frozen=True)
class Input:
    """A change of the inputs by name: parameters, Omega, beta, gamma and v."""

    says: str
    change: Callable[[Values], Values]
    rank: int = 0


def _all(names: tuple[str, ...], by: Callable[[Any], Any]) -> Callable[[Values], Values]:
    return lambda values: {name: by(values[name]) for name in names if name in values}


def _from(names: dict[str, str]) -> Callable[[Values], Values]:
    """The values of other names in place of these."""
    return lambda values: {name: values[other] for name, other in names.items()}


def _pairs() -> Iterator[Input]:
    for one, other in itertools.combinations(_EVERY, 2):
        alike = {one, other} <= set(SYMBOLS) or {one, other} <= set(_STATE)
        yield Input(f"{one} and {other} exchanged", _from({one: other, other: one}), 0 if alike else 1)
        yield Input(f"{other} in place of {one}", _from({one: other}), 1)
        yield Input(f"{one} in place of {other}", _from({other: one}), 1)


def _printed(form: str, values: Any) -> Any:
    return np.array([float(format(value, form)) for value in values])


def _whole(to: Callable[[Any], Any], decimals: int, values: Any) -> Any:
    return to(values * 10.0**decimals) / 10.0**decimals


def _slow(values: Values) -> Values:
    """v on the slow manifold's order 0."""
    r, e, gamma = values["r"], values["e"], values["gamma"]
    return {"v": e * values["Omega"] * np.sin(values["beta"]) * np.cos(gamma) / (r + e * np.sin(gamma))}


def _critical(values: Values) -> Values:
    return {"Omega": specimen().space["critical_speed"](tuple(values[name] for name in SYMBOLS))}


def _precisions() -> Iterator[Input]:
    groups = {"the parameters": SYMBOLS, "speed and state": _STATE, "all inputs": _EVERY, "the state": _STATE[1:]}
    for text, names in (*groups.items(), *((name, (name,)) for name in _EVERY)):
        yield Input(f"{text} in single precision", _all(names, lambda x: x.astype(np.float32).astype(float)), 2)
        for n in range(1, 12):
            yield Input(f"{text} rounded to {n} digits", _all(names, partial(_printed, f".{n}g")), 2)
            yield Input(f"{text} rounded to {n} decimals", _all(names, partial(_printed, f".{n}f")), 2)


def _table_1(values: Values, names: Sequence[str]) -> Values:
    return {name: _TABLE_1[name] + 0 * values[name] for name in names}


def _each(names: Sequence[str], by: Mapping[str, tuple[Callable[[Any], Any], int]]) -> Iterator[Input]:
    """The same changes of several inputs: what is said, with {x} for the input, the change and its rank."""
    for name, (says, (change, rank)) in itertools.product(names, by.items()):
        yield Input(says.format(x=name), _all(tuple(name.split(" and ")), change), rank)


_EVERY = (*SYMBOLS, *_STATE)
_TABLE_1 = {name: float(value) for name, value in PRINTED.decimals().items()}
INPUTS: tuple[Input, ...] = (
    Input("the angles taken as degrees", _all(("beta", "gamma"), np.radians)),
    Input("the angles turned into degrees", _all(("beta", "gamma"), np.degrees)),
    *_each(("beta", "gamma"), {"{x} taken as degrees": (np.radians, 0)}),
    Input("Omega taken as revolutions per minute", _all(("Omega",), lambda x: x * np.pi / 30)),
    Input("Omega taken as revolutions per second", _all(("Omega",), lambda x: x * 2 * np.pi)),
    *_each(
        ("beta", "gamma", "beta and gamma"),
        {
            "{x} shifted by -pi/2": (lambda x: x - np.pi / 2, 0),
            "{x} shifted by pi/2": (lambda x: x + np.pi / 2, 0),
            "{x} measured from pi/2 the other way": (lambda x: np.pi / 2 - x, 0),
            "{x} measured from pi the other way": (lambda x: np.pi - x, 0),
            "{x} shifted by pi": (lambda x: x + np.pi, 0),
        },
    ),
    Input("Table 1's parameters where others are asked", lambda values: _table_1(values, SYMBOLS)),
    *(Input(f"{name} = {_TABLE_1[name]:g} of Table 1", partial(_table_1, names=(name,)), 1) for name in SYMBOLS),
    *_each(_STATE, {"the sign of {x}": (np.negative, 0), "the modulus of {x}": (np.abs, 1)}),
    *_each(SYMBOLS, {"the sign of {x}": (np.negative, 2)}),
    *_each(
        _EVERY,
        {
            "{x} = 0": (lambda x: 0 * x, 1),
            "{x} doubled": (partial(np.multiply, 2.0), 1),
            "{x} halved": (partial(np.multiply, 0.5), 1),
            **{f"{{x}} times {factor:g}": (partial(np.multiply, factor), 3) for factor in (1e3, 100.0, 10.0)},
            **{f"{{x}} by {factor:g}": (partial(np.multiply, 1 / factor), 3) for factor in (1e3, 100.0, 10.0)},
        },
    ),
    *_each(
        _STATE,
        {
            "{x} of the first entry throughout": (lambda x: x[0] + 0 * x, 1),
            "{x} of the entry before": (lambda x: np.roll(x, 1), 1),
            "{x} of the entry after": (lambda x: np.roll(x, -1), 1),
            **{f"{{x}} cut off after {n} decimals": (partial(_whole, np.trunc, n), 2 * (n > 0)) for n in range(7)},
        },
    ),
    Input("v of the slow manifold, h_0 = e Omega sin(beta) cos(gamma) / rho", _slow),
    Input("Omega_crit in place of Omega", _critical),
    Input("Omega = 30.92 throughout", _all(("Omega",), lambda x: 30.92 + 0 * x), 1),
    *(Input(f"g = {g} for 9.81", partial(lambda g, values: {"g": g + 0 * values["g"]}, g)) for g in (9.8, 9.80665)),
    *_pairs(),
    *_precisions(),
    *_each(("Omega",), {f"{{x}} rounded up to {n} decimals": (partial(_whole, np.ceil, n), 2) for n in range(8)}),
)


def changed(table: Table, change: Callable[[Values], Values]) -> Table:
    """The same questions with other inputs behind them."""
    values: Values = {**dict(zip(SYMBOLS, table.p, strict=True)), **table.given}
    try:
        values |= change(values)
    except Exception:  # a change that these inputs do not bear
        return table
    return table.with_inputs([values[name] for name in SYMBOLS], {name: values[name] for name in table.given})


def all_changed(sheet: Sheet, change: Callable[[Values], Values]) -> Sheet:
    return Sheet(tuple(changed(table, change) for table in sheet.tables))


def known_speeds(table: Table, name: str) -> Array:
    """Speeds by name, by entry; NaN where they are not known."""
    if name[0] == "3":
        return np.full(len(table.entries), float(name))
    laws = ("linear", "smooth")
    law = laws[table.smooth != ("other law" in name)]
    place = f"{law}/heteroclinic/point/omega_h" if "Omega_h" in name else "linear/hopf/point/omega_crit"
    place = f"{law}/rotation-fold/point/omega" if "fold" in name else place
    known = [stored().get(f"{one}/{place}") for one in table.sets]
    return np.array([np.nan if one is None else one.for_doubles for one in known])
