"""Runs that start where an event function is zero: the start is no crossing, however the orbit leaves it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy
import pytest

from tippedisk_verify.flow.baseline import Baseline
from tippedisk_verify.flow.contract import SECTION, SLIDING_REVERSAL, TURN, Event, Request, Status
from tippedisk_verify.flow.lanes import Lanes, field_constants
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.model.precision import DOUBLE, EXTENDED, bits

WATCHED = Event("passing", SECTION.function, terminal=False)
FALLING = Event("falling", SECTION.function, direction=-1)
#: (beta_bar, gamma_bar, v) with v = 0: dropped at beta = pi/2 (the orbit touches the section), and elsewhere.
DROPPED, TURNING = (0.0, 0.3, 0.0), (0.2, 0.3, 0.0)


def request(state: tuple[float, ...], duration: float, *events: Event, **more: Any) -> Request:
    return Request(PRINTED, "30.5", state, duration, shifted=True, events=events, domain="none", **more)


@pytest.mark.parametrize("make", [Taylor, Baseline])
@pytest.mark.parametrize("duration", [0.3, 1e-4, 1e-6, -1e-4, -0.01])
def test_an_orbit_that_touches_the_surface_at_its_start(make: Callable[[], Any], duration: float) -> None:
    """Dropped at rest on the section, with both of its functions zero there and one of them to first order."""
    engine = make()
    free = engine(request(DROPPED, duration))
    for events in ((SECTION,), (FALLING,), (SECTION, WATCHED)):
        result = engine(request(DROPPED, duration, *events))
        assert result.status is Status.REACHED, events
        assert result.time == duration
        assert not result.events or all(record.name == "passing" for record in result.events)
        assert abs(result.state - free.state).max() <= 1e-10
    turned = engine(request(DROPPED, duration, TURN, SECTION))
    if duration == 0.3:  # it swings out, and v is zero for the first time after 0.236 s, far from the section
        assert turned.status is Status.EVENT
        assert turned.events[-1].name == "turn"
        assert 0.2 < turned.time < 0.3
    else:
        assert turned.status is Status.REACHED
        assert not turned.events


@pytest.mark.parametrize("precision", [DOUBLE, EXTENDED, bits(100)])
@pytest.mark.parametrize("duration", [1e-12, -1e-12, 2.0**-31, -(2.0**-30), 1e-8, -0.02])
@pytest.mark.parametrize(("state", "event"), [(DROPPED, SECTION), (TURNING, TURN), ((0.0, 0.3, -1.0), SECTION)])
def test_runs_as_short_as_you_like(taylor: Taylor, precision, duration, state, event) -> None:
    wanted: dict[str, Any] = {"precision": precision}
    end = taylor(request(state, duration, **wanted)).state
    for more in ({}, {"times": [duration / 4, duration / 2]}, {"dense": True}, {"friction": "smooth"}):
        result = taylor(request(state, duration, event, **wanted, **more))
        assert result.status is Status.REACHED, more
        assert not result.events
        if "friction" not in more:
            for mine, other in zip(result.state, end, strict=True):
                assert abs(mine - other) <= 4 * 2.0**-52 * max(1, abs(other))
        if "times" in more:
            assert len(result.samples) == 2
        if "dense" in more:
            assert max(abs(float(a) - b) for a, b in zip(result.dense([0.0])[0], state, strict=True)) <= 1e-12


@pytest.mark.parametrize("make", [Taylor, Baseline])
def test_a_turn_is_found_backward_too(make: Callable[[], Any]) -> None:
    """v rises from zero in both directions of time's sign, with opposite signs: neither is a crossing."""
    for duration in (0.01, -0.01):
        result = make()(request(TURNING, duration, TURN))
        assert result.status is Status.REACHED
        assert not result.events


@pytest.mark.parametrize("friction", ["linear", "smooth"])
@pytest.mark.parametrize("make", [Taylor, Baseline])
def test_an_orbit_at_rest_crosses_nothing(make: Callable[[], Any], friction) -> None:
    engine = make()
    for duration in (1.0, -1.0):
        for event in (SECTION, TURN, SLIDING_REVERSAL, WATCHED, FALLING):
            result = engine(request((0.0, 0.0, 0.0), duration, event, friction=friction, times=[duration / 2]))
            assert result.status is Status.REACHED, event
            assert not result.events
            assert numpy.array_equal(result.state, [0.0, 0.0, 0.0])


@pytest.mark.parametrize("friction", ["linear", "smooth"])
def test_many_runs_at_once_start_there_too(friction) -> None:
    """The same crossings as one run at a time; one of the starts is at rest, and one on no surface."""
    turns = Event("turns", TURN.function, terminal=False)
    states = numpy.array([(0.0, 0.0, 0.0), DROPPED, TURNING, (0.0, 0.3, -1.0), (0.1, 0.3, -1.0)])
    engine, constants = Taylor(), field_constants(PRINTED, friction)
    for duration in (0.3, -0.02):
        many = Lanes()(
            constants,
            numpy.full(len(states), 30.5),
            states,
            numpy.full(len(states), duration),
            shifted=True,
            friction=friction,
            events=(WATCHED, turns),
        )
        for run, state in enumerate(states.tolist()):
            alone = engine(request(tuple(state), duration, WATCHED, turns, friction=friction))
            mine = sorted((abs(when), name) for name, lane, when, _ in many.crossings if lane == run)
            assert [name for _, name in mine] == [record.name for record in alone.events]
            for (when, _), record in zip(mine, alone.events, strict=True):
                assert abs(when - abs(record.time)) < 1e-12


def test_a_disk_that_lies_flat_at_once_is_not_passed_by(taylor: Taylor) -> None:
    """1e-10 s before sin(beta) = 0, on the surface of a terminal event: that start is no crossing, the end is one."""
    level = Event("gamma at a half", lambda ops, constants, omega, beta, gamma, v: gamma - 0.5)
    result = taylor(Request(PRINTED, "30.5", (1e-10, 0.5, -1.0), 0.1, events=(level,)))
    assert result.status is Status.FLAT
    assert abs(result.time - 1e-10) < 1e-16
