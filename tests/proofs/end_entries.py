"""Entries of the cycles next to the connection, for the checker's tests."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from flint import ctx
from tippedisk_verify.proofs.checker.connection import ReturnMap
from tippedisk_verify.proofs.checker.passage import Passage
from tippedisk_verify.proofs.search.local_manifolds import Frame

from tests.proofs.saddle_orbits import OMEGA_H
from tippedisk_verify.model.decimals import exact_text
from tippedisk_verify.model.parameters import PRINTED, SYMBOLS, Parameters
from tippedisk_verify.proofs import checker
from tippedisk_verify.proofs.checker import connection as module
from tippedisk_verify.proofs.kernel.balls import hull, working_precision
from tippedisk_verify.proofs.kernel.reading import parsed
from tippedisk_verify.proofs.search.certificate import dyadic

BITS = 64


def disk(parameters: Parameters) -> dict[str, str]:
    return {name: exact_text(getattr(parameters, name)) for name in SYMBOLS}


def by_hand() -> dict[str, Any]:
    """An entry with fewer cells, a wider interval of Omega_h, and one flight; the rest as it has to be."""
    with working_precision(BITS):
        directions = [[dyadic(part) for part in row] for row in Frame(PRINTED, OMEGA_H).directions.tolist()]
    return {
        "low": "30.0474", "high": "30.0569", "gamma": "0.145", "v": "0.28",
        "omega_h": {"value": "30.04886826", "uncertainty": "1e-3"},
        "directions": directions, "extents": ["0.2", "0.2", "0.3"], "cells": [48, 6], "steep": ["1", "1/8", "1"],
        "compound": ["1/2", "1"], "flat": "0.0096", "lipschitz": "0.025", "thin": "1/8", "return": "10",
        "drift": ["0.4", "0.1", "0.12"], "lid": "0.077", "fast": "1/512", "weight": "1/4", "moment": "0.052",
        "orders": [8, 8], "flights": [[{"steps": 201, "length": "1p-8"}]],
        "branch": {"reach": "1p-7", "cone": ["1p-7"] * 2, "length": "1p-7", "orders": [12, 12], "steps": [230] * 2},
    }  # fmt: skip


def read(entry: dict[str, Any]) -> dict[str, Any]:
    return dict(parsed(entry, module.END, "entry"))


def speeds(entry: dict[str, Any]) -> checker.Flow:
    return checker.Flow(disk(PRINTED), hull(entry["low"], entry["high"]))


Change = Callable[[dict[str, Any]], None]


def put(*path: Any) -> Change:
    """The last of the names is the value."""

    def act(content: dict[str, Any]) -> None:
        part: Any = content
        for name in path[:-2]:
            part = part[name]
        part[path[-2]] = path[-1]

    return act


_KNOWN: dict[Any, Any] = {}


def _exactly(*balls: Any) -> tuple[Any, ...]:
    return tuple((*x.mid().man_exp(), *x.rad().man_exp()) if x.is_finite() else str(x) for x in balls)


def remember(monkeypatch: pytest.MonkeyPatch) -> None:
    """What was enclosed once is not enclosed again: most of a tampered entry is as it was."""
    enclose, flight, branch = Passage._enclose, ReturnMap.flight, module._branch

    def once(key: Any, make: Callable[[], Any]) -> Any:
        if key not in _KNOWN:
            try:
                _KNOWN[key] = make()
            except checker.Unproved as fault:
                _KNOWN[key] = fault
        if isinstance(_KNOWN[key], checker.Unproved):
            raise checker.Unproved(str(_KNOWN[key]))
        return _KNOWN[key]

    def enclosed(self: Any, n: int, m: int) -> None:
        def make() -> dict[str, Any]:
            enclose(self, n, m)
            return {name: getattr(self, name) for name in ("A", "M", "C", "B", "stirred", "stirred_within")}

        key = (n, m, ctx.prec, *self.flow.parameters.values(),
               *_exactly(self.flow.w, *self.extents, *self.directions.entries()))  # fmt: skip
        self.__dict__ |= once(key, make)

    def flight_once(self: Any, saddle: Any, slow: Any, given: Any) -> Any:
        key = (ctx.prec, *saddle.flow.parameters.values(), *self.entry["orders"], given["steps"],
               *_exactly(saddle.flow.w, *saddle.directions.entries(), *self.n.extents, slow, self.exit_fast,
                         given["length"]))  # fmt: skip
        return once(key, lambda: flight(self, saddle, slow, given))

    def branch_once(n: Any, saddle: Any, sign: int, count: int, given: Any) -> None:
        key = (ctx.prec, *saddle.flow.parameters.values(), sign, count, *given["orders"],
               *_exactly(saddle.flow.w, *saddle.directions.entries(), *n.extents, n.flat, given["reach"],
                         *given["cone"], given["length"]))  # fmt: skip
        once(key, lambda: branch(n, saddle, sign, count, given))

    monkeypatch.setattr(Passage, "_enclose", enclosed)
    monkeypatch.setattr(ReturnMap, "flight", flight_once)
    monkeypatch.setattr(module, "_branch", branch_once)
