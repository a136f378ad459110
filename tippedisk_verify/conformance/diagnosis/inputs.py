"""What people do wrong with inputs: one table of changes of the parameters, the speed and the state."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.entries import Sheet, Table
from tippedisk_verify.conformance.diagnosis.specimen import specimen
from tippedisk_verify.model.parameters import PRINTED, SYMBOLS

__all__ = ["INPUTS", "Input", "changed"]

Values = dict[str, Any]
_STATE = ("Omega", "beta", "gamma", "v")


@dataclass(frozen=True)
class Input:
    """A change of the inputs by name: parameters, Omega, beta, gamma and v."""

    name: str
    says: str
    change: Callable[[Values], Values]
    rank: int = 0


def _all(names: tuple[str, ...], by: Callable[[Any], Any]) -> Callable[[Values], Values]:
    return lambda values: {name: by(values[name]) for name in names if name in values}


def _from(names: dict[str, str]) -> Callable[[Values], Values]:
    """The values of other names in place of these."""
    return lambda values: {name: values[other] for name, other in names.items()}


def _pairs() -> Iterator[Input]:
    for one, other in itertools.combinations((*SYMBOLS, *_STATE), 2):
        alike = {one, other} <= set(SYMBOLS) or {one, other} <= set(_STATE)
        both = _from({one: other, other: one})
        yield Input(f"{one}-{other}-exchanged", f"{one} and {other} exchanged", both, 0 if alike else 1)
        yield Input(f"{one}-is-{other}", f"{other} in place of {one}", _from({one: other}), 1)
        yield Input(f"{other}-is-{one}", f"{one} in place of {other}", _from({other: one}), 1)


def _printed(form: str, values: Any) -> Any:
    return np.array([float(format(value, form)) for value in values])


def _to_single(values: Any) -> Any:
    return values.astype(np.float32).astype(float)


def _cut(decimals: int, values: Any) -> Any:
    return np.trunc(values * 10.0**decimals) / 10.0**decimals


def _up(decimals: int, values: Any) -> Any:
    return np.ceil(values * 10.0**decimals) / 10.0**decimals


def _slow(values: Values) -> Values:
    """v on the slow manifold's order 0."""
    r, e, gamma = values["r"], values["e"], values["gamma"]
    return {"v": e * values["Omega"] * np.sin(values["beta"]) * np.cos(gamma) / (r + e * np.sin(gamma))}


def _critical(values: Values) -> Values:
    return {"Omega": specimen().space["critical_speed"](tuple(values[name] for name in SYMBOLS))}


def _precisions() -> Iterator[Input]:
    groups = {"the parameters": SYMBOLS, "speed and state": _STATE, "all inputs": (*SYMBOLS, *_STATE)}
    groups["the state"] = _STATE[1:]
    for text, names in (*groups.items(), *((name, (name,)) for name in (*SYMBOLS, *_STATE))):
        slug = text.replace(" ", "-")
        yield Input(f"{slug}-single", f"{text} in single precision", _all(names, _to_single), 2)
        for n in range(1, 12):
            rounded, cut = (_all(names, partial(_printed, f".{n}{form}")) for form in "gf")
            yield Input(f"{slug}-{n}-digits", f"{text} rounded to {n} digits", rounded, 2)
            yield Input(f"{slug}-{n}-decimals", f"{text} rounded to {n} decimals", cut, 2)


def _table_1(values: Values, names: Sequence[str]) -> Values:
    return {name: _TABLE_1[name] + 0 * values[name] for name in names}


_TABLE_1 = {name: float(value) for name, value in PRINTED.decimals().items()}
_ANGLES = ("beta", "gamma")
INPUTS: tuple[Input, ...] = (
    Input("degrees", "the angles taken as degrees", _all(_ANGLES, np.radians)),
    Input("beta-degrees", "beta taken as degrees", _all(("beta",), np.radians)),
    Input("gamma-degrees", "gamma taken as degrees", _all(("gamma",), np.radians)),
    Input("to-degrees", "the angles turned into degrees", _all(_ANGLES, np.degrees)),
    Input("rpm", "Omega taken as revolutions per minute", _all(("Omega",), lambda x: x * np.pi / 30)),
    Input("hertz", "Omega taken as revolutions per second", _all(("Omega",), lambda x: x * 2 * np.pi)),
    *(
        Input(f"{'-'.join(names)}-{slug}", f"{' and '.join(names)} {text}", _all(names, by))
        for names in (("beta",), ("gamma",), _ANGLES)
        for slug, text, by in (
            ("shifted", "shifted by -pi/2", lambda x: x - np.pi / 2),
            ("shifted-up", "shifted by pi/2", lambda x: x + np.pi / 2),
            ("complement", "measured from pi/2 the other way", lambda x: np.pi / 2 - x),
            ("supplement", "measured from pi the other way", lambda x: np.pi - x),
            ("turned", "shifted by pi", lambda x: x + np.pi),
        )
    ),
    Input("table-1", "Table 1's parameters where others are asked", lambda values: _table_1(values, SYMBOLS)),
    *(
        Input(f"{name}-of-table-1", f"{name} = {_TABLE_1[name]:g} of Table 1", partial(_table_1, names=(name,)), 1)
        for name in SYMBOLS
    ),
    *(Input(f"{name}-sign", f"the sign of {name}", _all((name,), np.negative)) for name in _STATE),
    *(Input(f"{name}-sign", f"the sign of {name}", _all((name,), np.negative), 2) for name in SYMBOLS),
    *(Input(f"{name}-modulus", f"the modulus of {name}", _all((name,), np.abs), 1) for name in _STATE),
    *(Input(f"{name}-zero", f"{name} = 0", _all((name,), lambda x: 0 * x), 1) for name in (*SYMBOLS, *_STATE)),
    *(
        Input(f"{name}-{slug}", f"{name} of {text}", _all((name,), by), 1)
        for name in _STATE
        for slug, text, by in (
            ("first", "the first entry throughout", lambda x: x[0] + 0 * x),
            ("previous", "the entry before", lambda x: np.roll(x, 1)),
            ("next", "the entry after", lambda x: np.roll(x, -1)),
        )
    ),
    *(
        Input(f"{name}-times-{factor:g}", f"{name} {text}", _all((name,), partial(np.multiply, factor)), rank)
        for name in (*SYMBOLS, *_STATE)
        for factor, text, rank in (
            (2.0, "doubled", 1), (0.5, "halved", 1), (1e3, "times 1000", 3), (1e-3, "by 1000", 3),
            (100.0, "times 100", 3), (0.01, "by 100", 3), (10.0, "times 10", 3), (0.1, "by 10", 3),
        )
    ),
    *(
        Input(f"{name}-{n}-decimals-cut", f"{name} cut off after {n} decimals", _all((name,), partial(_cut, n)), rank)
        for name in _STATE
        for n, rank in ((0, 0), (1, 2), (2, 2), (3, 2), (4, 2), (5, 2), (6, 2))
    ),
    *(
        Input(f"Omega-{n}-up", f"Omega rounded up to {n} decimals", _all(("Omega",), partial(_up, n)), 2)
        for n in range(8)
    ),
    Input("v-slow", "v of the slow manifold, h_0 = e Omega sin(beta) cos(gamma) / rho", _slow),
    Input("omega-crit", "Omega_crit in place of Omega", _critical),
    Input("omega-30.92", "Omega = 30.92 throughout", _all(("Omega",), lambda x: 30.92 + 0 * x), 1),
    Input("g-9.8", "g = 9.8 for 9.81", lambda values: {"g": 9.8 + 0 * values["g"]}),
    Input("g-9.80665", "g = 9.80665 for 9.81", lambda values: {"g": 9.80665 + 0 * values["g"]}),
    *_pairs(),
    *_precisions(),
)  # fmt: skip


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
