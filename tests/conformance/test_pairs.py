"""What the diagnosis says of orbits from one answered sample to the next, where a program does a little wrong there."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tests.conformance.scipy_program import motion
from tippedisk_verify.conformance.diagnosis.copies import copy_of
from tippedisk_verify.conformance.diagnosis.flights import field
from tippedisk_verify.conformance.diagnosis.orbits import events_of
from tippedisk_verify.conformance.diagnosis.restarts import restarts_of
from tippedisk_verify.conformance.diagnosis.samples import samples_of
from tippedisk_verify.conformance.grading import Grade, graded
from tippedisk_verify.conformance.sheet import Answers
from tippedisk_verify.reference_values.store import Store, stored

STATE = ("beta", "gamma", "v")
ORBITS = tuple(scene + n for scene in "bcdef" for n in "12")
TIMES = np.arange(0.5, 4.1, 0.5)
P = {"r": 0.045, "e": 2.5e-3, "m": 0.435, "A": 0.249e-3, "B": 0.227e-3, "g": 9.81, "mu": 0.3, "epsilon": 0.1}
Rates = Callable[[Any], Any]


@pytest.fixture(scope="module")
def store() -> Store:
    return stored()


def _orbits(store: Store) -> tuple[list[str], Any, Any]:
    """Entries, speeds, and starts in columns."""
    entries = [f"printed/linear/trajectory/{orbit}" for orbit in ORBITS]
    inputs = [store[f"{entry}/beta@0.5"].inputs for entry in entries]
    return (
        entries,
        np.array([float(given["Omega"]) for given in inputs]),
        np.array([[float(given[name]) for given in inputs] for name in STATE]),
    )


def _right(speeds: Any) -> Rates:
    return field("printed", "linear", speeds)


def _step(f: Rates, y: Any, h: float) -> Any:
    a = f(y)
    b = f(y + h / 2 * a)
    c = f(y + h / 2 * b)
    return y + h / 6 * (a + 2 * b + 2 * c + f(y + h * c))


def _sampled(
    store: Store,
    rates: Callable[[Any], Rates] = _right,
    step: Callable[[Rates, Any, float], Any] = _step,
    h: float = 1e-3,
    change: Callable[[float, Any, Any], Any] = lambda time, y, speeds: y,
) -> tuple[list[Grade], set[str]]:
    """Grades of samples; ``change`` is made to the states at each sample's time."""
    entries, speeds, y = _orbits(store)
    f, given = rates(speeds), {}
    y = change(0.0, y, speeds)
    for time in TIMES:
        for _ in range(round(0.5 / h)):
            y = step(f, y, h)
        given |= _said(entries, float(time), y)
        y = change(float(time), y, speeds)
    return _graded(given, store)


def _said(entries: list[str], time: float, y: Any) -> dict[str, str]:
    return {
        f"{entry}/{name}@{time:g}": repr(float(x))
        for name, row in zip(STATE, y, strict=True)
        for entry, x in zip(entries, row, strict=True)
    }


def _graded(given: dict[str, str], store: Store) -> tuple[list[Grade], set[str]]:
    grades = graded(Answers({id_: ("doubles", text) for id_, text in given.items()}), store)
    return grades, {grade.id for grade in grades if grade.failed}


def _rolling(speeds: Any, y: Any) -> Any:
    return P["e"] * speeds * np.sin(y[0]) * np.cos(y[1]) / (P["r"] + P["e"] * np.sin(y[1]))


def _each_second(time: float, y: Any, speeds: Any) -> Any:
    return np.round(y, 4) if time % 1 == 0 else y


def _at_the_start(time: float, y: Any, speeds: Any) -> Any:
    return y if time else np.array([y[0], y[1], _rolling(speeds, y)])


def _unevenly(time: float, y: Any, speeds: Any) -> Any:
    return np.round(y, 4) + 1e-4 * math.sin(9 * time) if time % 1 == 0 else y


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (_each_second, "the integration starts anew every 1 s, and each time the state is rounded to 4 decimals"),
        (_at_the_start, "orbits start in another state than asked: v is set to h_0, on the critical manifold"),
        pytest.param(_unevenly, None, marks=pytest.mark.slow),
    ],
)
def test_what_is_done_to_states_on_the_way_is_told(
    change: Callable[[float, Any, Any], Any], said: str | None, store: Store
) -> None:
    found = restarts_of(*_sampled(store, change=change), store)
    assert (found[0] if found is not None else None) == (None if said is None else (("restart", said),))


@pytest.mark.slow
def test_pure_rolling_and_rounded_speeds_are_told(store: Store) -> None:
    def rolling(speeds: Any) -> Rates:
        return lambda y: np.array([_rolling(speeds, y), -speeds * np.cos(y[0]), 0 * y[2]])

    found = restarts_of(*_sampled(store, rates=rolling), store)
    assert found is not None
    assert found[0][0][1].startswith("the reduced equations are integrated: beta' = h_0, on the critical manifold")
    found = restarts_of(
        *_sampled(store, rates=lambda speeds: _right(np.round(speeds * 30 / math.pi) * math.pi / 30)), store
    )
    assert found is not None
    assert found[0][0][1] == "Omega rounded to 0 decimals in turns per minute at the start"


@pytest.mark.parametrize(("slip", "told"), [("gravity", True), pytest.param("damping", False, marks=pytest.mark.slow)])
def test_a_slip_in_the_orbits_own_equations_is_told(slip: str, told: bool, store: Store) -> None:
    def rates(speeds: Any) -> Rates:
        def slipped(y: Any) -> Any:
            gamma_rate, v_rate, _ = motion(np, P, speeds, False, y)
            beta, gamma, v = y
            rho = P["r"] + P["e"] * np.sin(gamma)
            mass = P["A"] * np.cos(gamma) ** 2 + (P["B"] - P["m"] * P["e"] ** 2) * np.sin(gamma) ** 2
            mass += P["m"] * rho**2 * np.cos(beta) ** 2
            missing = P["m"] * P["g"] * (rho - P["r"]) * np.cos(beta) / mass
            return np.array([v, gamma_rate, v_rate + (missing if slip == "gravity" else -0.05 * v * abs(v))])

        return slipped

    found = copy_of(*_sampled(store, rates=rates), store, lambda label, steps: None)
    assert (found is not None) == told
    if found is not None:
        assert found[0][0][1].startswith("in f_G: -m g r cos(beta) for -m g rho cos(beta)")


def _at(store: Store, times: Any) -> Any:
    """The right states of all orbits at these times."""
    _, speeds, starts = _orbits(store)
    y, f, h = starts, _right(speeds), times / 4000
    for _ in range(4000):
        y = _step(f, y, h)
    return y


@pytest.mark.parametrize(
    ("v", "said"),
    [
        (lambda y, z: (z[0] - y[0]) / 2e-3, "v of samples is a forward difference of beta over 0.002 s"),
        (lambda y, z: z[2], "v of samples is that 0.002 s after the others; the others are right"),
        pytest.param(lambda y, z: z[2] + 1e-3, None, marks=pytest.mark.slow),
    ],
)
def test_one_part_of_another_instant_is_told(v: Callable[[Any, Any], float], said: str | None, store: Store) -> None:
    given, entries = {}, _orbits(store)[0]
    for time in (0.5, 1.0, 1.5):
        y, z = (_at(store, time + by) for by in (0.0, 2e-3))
        given |= _said(entries, time, (y[0], y[1], v(y, z)))
    found = samples_of(*_graded(given, store), store)
    assert (found[0] if found is not None else None) == (None if said is None else (("samples", said),))


def test_samples_at_a_multiple_of_the_time_are_told(store: Store) -> None:
    given, entries = {}, _orbits(store)[0]
    for time in (0.5, 1.0, 1.5, 2.0):
        given |= _said(entries, time, _at(store, 0.8 * time))
    found = samples_of(*_graded(given, store), store)
    assert found is not None
    assert found[0] == (("samples", "samples are taken at 0.8 times the time asked for"),)


def _crossings(store: Store) -> dict[str, list[tuple[str, ...]]]:
    names = ("crossing_time", "crossing_gamma", "crossing_v")
    return {
        entry: [
            tuple(repr(store[q.id.replace("crossing_time", name)].for_doubles) for name in names)
            for q in sorted(store.matching(f"{entry}/crossing_time#"), key=lambda q: q.for_doubles)
        ]
        for entry in _orbits(store)[0]
    }


def _events(crossings: dict[str, list[tuple[str, ...]]], store: Store) -> str | None:
    given = {
        f"{entry}/{name}#{n}": x
        for entry, here in crossings.items()
        for n, numbers in enumerate(here, start=1)
        for name, x in zip(("crossing_time", "crossing_gamma", "crossing_v"), numbers, strict=True)
        if f"{entry}/{name}#{n}" in store
    }
    found = events_of(*_graded(given, store), store)
    return None if found is None else found[0][0][1]


def test_which_crossings_are_counted_is_told(store: Store) -> None:
    right = _crossings(store)
    assert _events({entry: [x for x in here for _ in (0, 1)] for entry, here in right.items()}, store) == (
        "each crossing is counted twice"
    )
    apart: dict[str, list[tuple[str, ...]]] = {}
    for entry, here in right.items():
        for one in here:
            if not apart.get(entry) or float(one[0]) - float(apart[entry][-1][0]) > 0.6:
                apart.setdefault(entry, []).append(one)
    said = _events(apart, store)
    assert said is not None
    assert said.startswith("crossings are left out where the time since the last one that was counted")
    any_rule = {entry: [x for n, x in enumerate(here) if n % 5 not in (1, 2)] for entry, here in right.items()}
    assert _events(any_rule, store) is None


@pytest.mark.parametrize(("off", "told"), [(0.0, True), (1e-4, False)])
def test_the_grid_that_crossings_are_on_is_told(off: float, told: bool, store: Store) -> None:
    right, before = _crossings(store), []
    for n in range(3):
        times = np.array([0.01 * math.floor(float(here[n][0]) / 0.01) for here in right.values()])
        before.append((times + off, *_at(store, times)[1:]))
    crossings = {entry: [tuple(repr(float(x[k])) for x in one) for one in before] for k, entry in enumerate(right)}
    said = _events(crossings, store)
    assert (said is not None and "on a grid of 0.01 s, " in said and "at the point before" in said) == told
