"""Nonsense of every Python type to every public function: InputError, or TypeError where the annotation forbids it."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import pytest

import tippedisk_verify as tv
from tests.stress.nonsense import NO_COUNTS, NO_NUMBERS, NO_OBJECTS, NO_SPEEDS
from tippedisk_verify.flow import default_engine

_OMEGA = Fraction("30.4")
_ID = "printed/linear/hopf/point/omega_crit"
_OMITTED = None  # stands for Omega_h


def _request(friction: Any = "linear", **changes: object) -> tv.Request:
    told: dict[str, Any] = {
        "parameters": tv.PRINTED.with_friction(friction),
        "omega": "30.4",
        "state": ("pi/2", 2, 0),
        "duration": 1,
    }
    return tv.Request(**{**told, **changes})


def _lanes(**changes: object) -> object:
    told: dict[str, Any] = {
        "constants": [0.045, 0.0025, 5e-4, 5e-4, 9.81, 29.0],
        "omegas": [30.4],
        "states": [[1.5, 1.6, 0]],
        "durations": [1.0],
    }
    return _LANES(*{**told, **changes}.values())


_DISK = tv.Disk("printed")
_LANES = tv.BatchTaylor(1)
_TYPED = (tv.InputError, TypeError, AttributeError)  # what a value against the annotation may give
_ENGINES: dict[str, Callable[[tv.Request], Any]] = {"Taylor": default_engine(), "Baseline": tv.Baseline()}

#: Every public function with a parameter to be spoiled; what it must refuse; whether the annotation allows it.
CALLS: list[tuple[str, Callable[[Any], object], tuple[Any, ...], bool]] = [
    ("exact", tv.exact, NO_NUMBERS, True),
    ("exact", lambda x: tv.exact(1) + x, NO_NUMBERS, True),
    ("Exact", lambda x: tv.exact("pi") - x, NO_NUMBERS, True),
    ("Measured", lambda x: tv.Measured.of(x, 0), NO_NUMBERS[:-2], False),
    ("Measured", lambda x: tv.Measured.of(0, x), (-1, float("nan"), -1e-300, float("inf")), True),
    ("Parameters", lambda x: tv.PRINTED.changed(mu=x), (*NO_NUMBERS, 0, -1, "1e40", "1e-40", "pi", 10**5000), True),
    ("Parameters", lambda x: tv.PRINTED.changed(m=x), (*NO_NUMBERS, 0, -1, "1e40", Fraction(1, 10**5000)), True),
    ("Parameters", tv.Parameters.named, ("", "abc", "\0", "a\0.toml", "/", ".", "x" * 5000, "\ud800.toml"), True),
    ("Parameters", tv.Parameters.named, NO_OBJECTS, False),
    ("PRINTED", tv.PRINTED.at, NO_NUMBERS, False),
    ("CALIBRATED", lambda x: tv.CALIBRATED.changed(e=x), ("0.045", "1", "nan", -1), True),
    ("GEOMETRY", lambda x: tv.GEOMETRY.changed(B=x), ("1", "1e-9", "inf"), True),
    ("DOUBLE", tv.DOUBLE.number, (*NO_NUMBERS, "1e400", 10**400), True),
    ("EXTENDED", tv.EXTENDED.number, (*NO_NUMBERS, "1e5000", 10**5000), True),
    ("QUADRUPLE", tv.QUADRUPLE.number, (*NO_NUMBERS, "1e5000", 10**5000), True),
    ("Precision", lambda x: tv.bits(100).number(x), NO_NUMBERS, True),
    ("Precision", lambda x: tv.bits(100).array([x]), NO_NUMBERS, True),
    ("Precision", lambda x: tv.bits(100).mpf(x), NO_OBJECTS[:-2], True),
    ("bits", tv.bits, (*NO_COUNTS, 23, 4_000_001), True),
    ("omega_crit", lambda x: tv.omega_crit(tv.PRINTED, x), NO_COUNTS, True),
    ("period_crit", lambda x: tv.period_crit(tv.PRINTED, x), NO_COUNTS, True),
    ("hopf_point", lambda x: tv.hopf_point(tv.PRINTED, x), NO_COUNTS, True),
    ("hopf_point", lambda x: tv.hopf_point(x), NO_NUMBERS, False),
    ("equilibrium", lambda x: tv.equilibrium(tv.PRINTED, x, "inverted"), NO_SPEEDS, True),
    ("equilibrium", lambda x: tv.equilibrium(tv.PRINTED, "30.4", "inverted", x), NO_COUNTS, True),
    ("equilibrium", lambda x: tv.equilibrium(tv.PRINTED, "30.4", x), NO_NUMBERS, True),
    ("one_harmonic", lambda x: tv.one_harmonic(tv.PRINTED, x), NO_SPEEDS, True),
    ("one_harmonic", lambda x: tv.one_harmonic(tv.PRINTED, _OMEGA, digits=x), NO_COUNTS, True),
    ("one_harmonic", lambda x: tv.one_harmonic(tv.PRINTED, _OMEGA, x), NO_NUMBERS, True),
    (
        "limit_speed",
        lambda x: tv.limit_speed(tv.PRINTED, x),
        (*(x for x in NO_NUMBERS if x is not _OMITTED), 0, -1, 4, "pi", 10**400),
        True,
    ),
    ("limit_speed", lambda x: tv.limit_speed(tv.PRINTED, digits=x), (*NO_COUNTS, 201), True),
    (
        "limit_period",
        lambda x: tv.limit_period(tv.PRINTED, x),
        (*(x for x in NO_NUMBERS if x is not _OMITTED), 0, -1, 4, "pi", 10**400),
        True,
    ),
    ("limit_period", lambda x: tv.limit_period(tv.PRINTED, 1, x), (*NO_COUNTS, 201), True),
    ("study", lambda x: tv.study(tv.PRINTED, x, 1), NO_SPEEDS, True),
    ("study", lambda x: tv.study(tv.PRINTED, "30.4", x), (*NO_OBJECTS, -1, 41, 10**400, 0.5, float("nan")), True),
    ("study", lambda x: tv.study(tv.PRINTED, "30.4", 1, x), NO_COUNTS, True),
    ("balanced_cycle", lambda x: tv.balanced_cycle(tv.PRINTED, x), NO_SPEEDS, True),
    ("balanced_cycle", lambda x: tv.balanced_cycle(tv.PRINTED, _OMEGA, digits=x), NO_COUNTS, True),
    ("balanced_cycle", lambda x: tv.balanced_cycle(tv.PRINTED, _OMEGA, harmonics=x), (0, -1, 1025, 10**400), True),
    ("limit_cycle", lambda x: tv.limit_cycle(tv.PRINTED, x, default_engine()), NO_SPEEDS, True),
    ("limit_cycle", lambda x: tv.limit_cycle(tv.PRINTED, _OMEGA, default_engine(), digits=x), NO_COUNTS, True),
    (
        "limit_cycle",
        lambda x: tv.limit_cycle(tv.PRINTED, _OMEGA, default_engine(), guess=(x, x)),
        (float("nan"), float("inf"), 0, 10**400),
        True,
    ),
    (
        "limit_cycle",
        lambda x: tv.limit_cycle(tv.PRINTED, _OMEGA, default_engine(), guess=x),
        ((), (1.0,), (1.0, -1.0, 2.0)),
        True,
    ),
    ("limit_cycle", lambda x: tv.limit_cycle(tv.PRINTED, _OMEGA, x), NO_NUMBERS, False),
    ("limit_cycle", lambda x: tv.limit_cycle(tv.PRINTED.with_friction(x), _OMEGA, default_engine()), NO_NUMBERS, True),
    (
        "cycle_above",
        lambda x: tv.cycle_above(tv.PRINTED, x, default_engine()),
        (*NO_NUMBERS, 0, -1, 10, 10**400, "1e-900", "pi"),
        True,
    ),
    ("cycle_above", lambda x: tv.cycle_above(tv.PRINTED, "0.1", default_engine(), digits=x), NO_COUNTS, True),
    ("heteroclinic", lambda x: tv.heteroclinic(tv.PRINTED, default_engine(), digits=x), (*NO_COUNTS, 1001), True),
    (
        "heteroclinic",
        lambda x: tv.heteroclinic(tv.PRINTED, default_engine(), method=x),
        ("", "abc", "\0", *NO_OBJECTS),
        True,
    ),
    ("bisect_omega_h", lambda x: tv.bisect_omega_h(tv.PRINTED.with_friction(x), default_engine()), NO_NUMBERS, True),
    ("Disk", tv.Disk, ("", "abc", "\0", *(x for x in NO_OBJECTS if x is not None)), True),
    ("Disk", lambda x: tv.Disk("printed", friction=x), ("", "abc", "\0"), True),
    ("Disk", lambda x: tv.Disk(**dict.fromkeys(("r", "e", "m", "A", "B", "g", "mu", "epsilon"), x)), NO_NUMBERS, True),
    ("Disk", lambda x: _DISK.limit_cycle(x), (*(x for x in NO_SPEEDS if x is not None), None), True),
    ("Disk", lambda x: _DISK.limit_cycle(below_crit=x), (*(x for x in NO_NUMBERS if x is not None), None, 40), True),
    ("Disk", lambda x: _DISK.limit_cycle(_OMEGA, digits=x), NO_COUNTS, True),
    ("Disk", lambda x: _DISK.branch([_OMEGA, x]), NO_SPEEDS, True),
    ("Disk", lambda x: _DISK.equilibrium(x, _OMEGA), ("", "abc", "\0"), True),
    ("Disk", lambda x: _DISK.integrate(x, ("pi/2", 2, 0), 1), NO_NUMBERS, True),
    ("Disk", lambda x: _DISK.integrate("30.4", ("pi/2", x, 0), 1), NO_NUMBERS, True),
    ("Disk", lambda x: _DISK.integrate("30.4", ("pi/2", 2, 0), x), NO_NUMBERS, True),
    ("Disk", lambda x: _DISK.integrate("30.4", ("pi/2", 2, 0), 1, times=x), ([2.0], [0.5, 0.25], ["a"], "ab"), True),
    ("Disk", lambda x: _DISK.integrate("30.4", ("pi/2", 2, 0), 1, digits=x), NO_COUNTS, True),
    ("Solution", lambda x: _DISK.integrate("30.4", ("pi/2", 2, 0), 1)(x), (1.5, -1e-3, [0.5, 2], "a", math.nan), True),
    ("basins", lambda x: tv.basins(tv.PRINTED, x, count=4, duration=5.0), NO_SPEEDS, True),
    ("basins", lambda x: tv.basins(tv.PRINTED, _OMEGA, count=x), (0, -1, 10**9, 10**400, 3.5), True),
    (
        "basins",
        lambda x: tv.basins(tv.PRINTED, _OMEGA, count=4, duration=x),
        (0.0, -1.0, float("nan"), float("inf"), 1e300),
        True,
    ),
    (
        "basins",
        lambda x: tv.basins(tv.PRINTED, _OMEGA, count=4, duration=5.0, v=x),
        (float("nan"), float("inf"), 1e4),
        True,
    ),
    ("basins", lambda x: tv.basins(tv.PRINTED, _OMEGA, count=4, duration=5.0, seed=x), (-1, 1.5), True),
    (
        "BranchInterpolant",
        lambda x: tv.BranchInterpolant(tv.PRINTED, _LANES, x),
        (0.0, -1.0, float("nan"), float("inf"), 31.0, 1.0),
        True,
    ),
    (
        "BranchInterpolant",
        lambda x: tv.BranchInterpolant(tv.PRINTED, _LANES, 30.05, lowest=x),
        (0.0, float("nan"), 31.0, 1e300),
        True,
    ),
    ("BatchTaylor", lambda x: tv.BatchTaylor(x), (0.5, -1, 10**9, 65), True),
    *(
        (
            "BatchTaylor",
            lambda x, name=name: _lanes(**{name: x}),
            (None, "", "abc", [], [[]], ["x"], [1.0, 2.0], [[1.0]], 1j, [10**400], {}),
            True,
        )
        for name in ("constants", "omegas", "states", "durations")
    ),
    (
        "reference",
        tv.reference,
        (*NO_NUMBERS, "../../etc/passwd", "printed", "printed/linear/hopf/point/omega_crit\0"),
        True,
    ),
    ("compare", lambda x: tv.compare(_ID, x), NO_OBJECTS, True),
    ("compare", lambda x: tv.compare(x, 1.0), (*NO_NUMBERS, "printed"), True),
    ("compare", lambda x: tv.compare(_ID, 1.0, reading=x), NO_NUMBERS, True),
    ("references", tv.references, ("abc", "\0", "printed/linear/hopf/point/omega_crit\0", *NO_OBJECTS), True),
    ("references", lambda x: tv.references(_ID, reading=x), ("", "abc", "\0", None, 1), True),
    ("grade", tv.grade, ({}, {"abc": 1.0}, {1: 1.0}, {"fresh-1-1/both/rhs/01/Q": 1.0}, *NO_OBJECTS), True),
    ("grade", lambda x: tv.grade({_ID: 1.0}, reading=x), ("", "abc", "\0", None, 1), True),
    ("scene_named", tv.scene_named, ("", "g", "A", "\0", "aa", "a" * 5000), True),
    ("scene_named", tv.scene_named, NO_OBJECTS, True),
    ("SCENES", lambda x: tv.SCENES[0].omega(tv.PRINTED, x), (None,), True),
    ("Baseline", tv.Baseline, ("", "RK23", "\0", "x" * 5000, *NO_OBJECTS), True),
    ("Audit", lambda x: tv.Audit(tv.PRINTED, default_engine()).omega_h(x), ("", "abc", "\0"), True),
    ("Audit", lambda x: tv.Audit(tv.PRINTED, default_engine()).panel(x, "printed"), ("", "g", "\0"), True),
    ("Audit", lambda x: tv.Audit(tv.PRINTED, default_engine()).panel("d", x), ("", "abc", "\0"), True),
    *(("Request", lambda x, run=run: run(_request(omega=x)), NO_NUMBERS, True) for run in _ENGINES.values()),
    *(("Request", lambda x, run=run: run(_request(duration=x)), NO_NUMBERS, True) for run in _ENGINES.values()),
    *(("Request", lambda x, run=run: run(_request(state=(x, 2, 0))), NO_NUMBERS, True) for run in _ENGINES.values()),
    *(
        ("Request", lambda x, run=run: run(_request(state=x)), ((), (1, 2), (1, 2, 3, 4), "ab"), True)
        for run in _ENGINES.values()
    ),
    *(
        (
            "Request",
            lambda x, run=run: run(_request(times=x)),
            ([], [2.0], [0.5, 0.5], [-1.0], ["x"], [float("nan")], [10**400], [[0.5]]),
            True,
        )
        for run in _ENGINES.values()
    ),
    *(
        (name, lambda x, run=run: run(_request(tolerance=x)), (0.0, 1.0, -1.0, float("nan"), float("inf")), True)
        for name, run in _ENGINES.items()
    ),
    *((name, lambda x, run=run: run(_request(max_steps=x)), (0, -1, 10**400), True) for name, run in _ENGINES.items()),
    *((name, lambda x, run=run: run(_request(friction=x)), ("", "abc", "\0"), True) for name, run in _ENGINES.items()),
    *((name, lambda x, run=run: run(_request(domain=x)), ("", "abc"), True) for name, run in _ENGINES.items()),
    *(
        (name, lambda x, run=run: run(_request(variations=x)), (("abc",), ("beta", "beta")), True)
        for name, run in _ENGINES.items()
    ),
    *((name, lambda x, run=run: run(x), NO_NUMBERS, False) for name, run in _ENGINES.items()),
    *(
        ("Event", lambda x, run=run: run(_request(events=(tv.Event(x, len), tv.Event(x, len)))), ("same", "flat"), True)
        for run in _ENGINES.values()
    ),
]
#: Nothing to be called with anything: an outcome, a verdict, an error.
_PLAIN = {"InputError", "Shortfall", "Result", "Status", "Verdict"}


def test_every_public_name_is_spoiled() -> None:
    assert {name for name, *_ in CALLS} | _PLAIN == set(tv.__all__)


@pytest.mark.parametrize(
    ("name", "call", "wrong", "annotated"), CALLS, ids=lambda value: value if isinstance(value, str) else ""
)
def test_nonsense_from_python(
    name: str, call: Callable[[Any], object], wrong: tuple[Any, ...], annotated: bool
) -> None:
    for value in wrong:
        try:
            found = call(value)
        except tv.InputError as refusal:
            assert len(str(refusal)) < 1000  # noqa: PT017
        except _TYPED:
            assert not annotated, (name, value)
        else:
            pytest.fail(f"{name} took {value!r:.60} and gave {found!r:.60}")
