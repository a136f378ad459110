"""Runs that start where an event function is zero: the start is never a crossing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tippedisk_verify import (
    DOUBLE,
    EXTENDED,
    PRINTED,
    BatchTaylor,
    Event,
    Request,
    ScipyEngine,
    Status,
    Taylor,
    exact,
    precision_of_bits,
)
from tippedisk_verify.flow.batch import equation_constants
from tippedisk_verify.flow.contract import BETA_EXTREME, FLAT, SECTION, SLIDING_REVERSAL
from tippedisk_verify.model.parameters import Friction

WATCHED = Event("passing", SECTION.function, terminal=False)
FALLING = Event("falling", SECTION.function, direction=-1)
LEVEL = Event("gamma at a half", lambda ops, constants, omega, beta, gamma, v: gamma - 0.5)
shared, lanes = Taylor(), BatchTaylor()
#: (beta_bar, gamma_bar, v) with v = 0: dropped at beta = pi/2 (the orbit touches the section), and
#: elsewhere.
DROPPED, TURNING = (0.0, 0.3, 0.0), (0.2, 0.3, 0.0)


@cache
def _event(turn: bool, direction: Any, terminal: bool) -> Event:
    """Return one event of each kind, so that the engines compile for it once."""
    return Event("watched", (BETA_EXTREME if turn else SECTION).function, direction, terminal)


def request(
    state: tuple[float, ...],
    duration: float,
    *events: Event,
    friction: Friction = "linear",
    **more: Any,
) -> Request:
    return Request(
        PRINTED.with_friction(friction),
        "30.5",
        state,
        duration,
        shifted=True,
        events=events,
        domain="none",
        **more,
    )


@pytest.mark.parametrize("make", [Taylor, ScipyEngine])
@pytest.mark.parametrize("duration", [0.3, 1e-6, -0.01])
def test_an_orbit_that_touches_the_surface_at_its_start(
    make: Callable[[], Any], duration: float
) -> None:
    """Drop the disk at rest on the section.

    Both functions vanish there, one of them to first order.
    """
    engine = make()
    free = engine(request(DROPPED, duration))
    for events in ((SECTION,), (FALLING,), (SECTION, WATCHED)):
        result = engine(request(DROPPED, duration, *events))
        assert result.status is Status.REACHED, events
        assert result.time == duration
        assert not result.events or all(record.name == "passing" for record in result.events)
        # A thousand times SciPy's tolerance of a step
        assert abs(result.state - free.state).max() <= 1000 * 1e-13
    turned = engine(request(DROPPED, duration, BETA_EXTREME, SECTION))
    # It swings out, and v is zero for the first time after 0.236 s, far from the section
    if duration == 0.3:
        assert turned.status is Status.EVENT
        assert turned.events[-1].name == "turn"
        assert 0.2 < turned.time < 0.3
    else:
        assert turned.status is Status.REACHED
        assert not turned.events


@pytest.mark.parametrize("duration", [1e-12, -1e-12, 2.0**-31, -(2.0**-30), 1e-8])
@pytest.mark.parametrize(
    ("state", "event"), [(DROPPED, SECTION), (TURNING, BETA_EXTREME), ((0.0, 0.3, -1.0), SECTION)]
)
def test_runs_of_any_short_duration(taylor: Taylor, duration, state, event) -> None:
    end = taylor(request(state, duration)).state
    for more in (
        {},
        {"times": [duration / 4, duration / 2]},
        {"dense": True},
        {"friction": "smooth"},
    ):
        result = taylor(request(state, duration, event, **more))
        assert result.status is Status.REACHED, more
        assert not result.events
        if "friction" not in more:
            for mine, other in zip(result.state, end, strict=True):
                assert abs(mine - other) <= 4 * 2.0**-52 * max(1, abs(other))
        if "times" in more:
            assert len(result.samples) == 2
        if "dense" in more:
            assert [float(part) for part in result.dense([0.0])[0]] == list(state)


@pytest.mark.parametrize("friction", ["linear", "smooth"])
@pytest.mark.parametrize("make", [Taylor, ScipyEngine])
def test_an_orbit_at_rest_crosses_nothing(make: Callable[[], Any], friction) -> None:
    engine = make()
    for duration in (1.0, -1.0):
        for event in (SECTION, BETA_EXTREME, SLIDING_REVERSAL, WATCHED, FALLING):
            result = engine(
                request((0.0, 0.0, 0.0), duration, event, friction=friction, times=[duration / 2])
            )
            assert result.status is Status.REACHED, event
            assert not result.events
            assert numpy.array_equal(result.state, [0.0, 0.0, 0.0])


@pytest.mark.parametrize("friction", ["linear", "smooth"])
def test_many_runs_at_once_start_there_too(friction) -> None:
    """Compare the crossings with single runs.

    One start is at rest, one a rounding away, one on no surface.
    """
    turns = Event("turns", BETA_EXTREME.function, terminal=False)
    states = numpy.array([(0.0, 0.0, 0.0), DROPPED, TURNING, (1e-15, 0.3, -1.0), (0.1, 0.3, -1.0)])
    constants = equation_constants(PRINTED.with_friction(friction))
    for duration in (0.3, -0.02):
        wanted = {"shifted": True, "friction": friction, "events": (WATCHED, turns)}
        many = lanes(constants, numpy.full(5, 30.5), states, numpy.full(5, duration), **wanted)
        for run, state in enumerate(states.tolist()):
            alone = shared(request(tuple(state), duration, WATCHED, turns, friction=friction))
            mine = sorted(
                (abs(when), name) for name, lane, when, _ in many.crossings if lane == run
            )
            assert [name for _, name in mine] == [record.name for record in alone.events]
            for (when, _), record in zip(mine, alone.events, strict=True):
                # Two runs of one start: rounding of the state over its smallest rate at a crossing
                assert abs(when - abs(record.time)) < 1e-12


@pytest.mark.parametrize(
    "more",
    [
        {},
        {"times": [5e-11, 0.05]},
        {"dense": True},
        {"parameters": PRINTED.with_friction("smooth")},
    ],
)
@pytest.mark.parametrize("precision", [DOUBLE, precision_of_bits(100)])
def test_a_disk_that_lies_flat_at_once_ends_the_run(taylor: Taylor, more, precision) -> None:
    """Start 1e-10 s before sin(beta) = 0, on the surface of a terminal event.

    The start is no crossing, the end is one.
    """
    wanted = {
        "parameters": PRINTED,
        "omega": "30.5",
        "state": (1e-10, 0.5, -1.0),
        "duration": 0.1,
    } | more
    result = taylor(Request(**wanted, events=(LEVEL,), precision=precision))
    assert result.status is Status.FLAT
    # beta = 1e-10 falls at the rate 1. Within 1e-10 s the rate changes by 1e-10 of its slope, which
    # is below 1e4 1/s.
    curved = 1e-10 * 1e-10 * 1e4
    assert abs(result.time - 1e-10) < curved
    if "times" in more:
        assert abs(float(result.samples[0][0]) - 5e-11) < curved
        assert len(result.samples) == 1
    if "dense" in more:
        assert abs(float(result.dense([5e-11])[0][0]) - 5e-11) < curved


def test_a_start_on_the_edge_of_the_domain_is_its_end(taylor: Taylor) -> None:
    """Start on the edge up to rounding.

    As an event of a run that does not check the domain, it is a start like any other.
    """
    for more in ({}, {"times": [0.005]}):
        inside = Request(PRINTED, "30.5", (1e-15, 0.3, -1.0), 0.01, events=(FLAT,), **more)
        assert taylor(inside).status is Status.FLAT
        assert len(taylor(inside).events) == 1
        assert taylor(replace(inside, domain="none")).status is Status.REACHED


@pytest.mark.parametrize("more", [{}, {"dense": True}, {"times": [0.05]}])
def test_another_event_next_to_the_start_is_no_start(taylor: Taylor, more) -> None:
    """Start on the section, 1.7e-10 s before v = 0."""
    result = taylor(request((0.0, 0.3, 1e-8), 0.1, SECTION, BETA_EXTREME, **more))
    assert result.status is Status.EVENT
    assert [record.name for record in result.events] == ["turn"]
    # Relative 1e-8: v changes by its rate, which changes by 1e-10 s of its slope.
    assert abs(result.time - 1.656437567775737e-10) < 1e-18


def test_a_crossing_soon_after_the_start_is_one(taylor: Taylor) -> None:
    """Leave the section with v = 3e-4 rad/s.

    With v' of the test above the orbit returns after 2 v / v'.
    """
    result = taylor(request((0.0, 0.3, 3e-4), 0.1, SECTION))
    assert result.status is Status.EVENT
    # Sliding decays with 100 1/s
    assert result.time == pytest.approx(2 * 3e-4 * 1.656e-10 / 1e-8, rel=1e-2)


def test_rounding_of_an_equilibrium_is_no_event(taylor: Taylor) -> None:
    """Compare two arithmetics, neither of which holds pi/2.

    In both the disk turns at the same time, and from the exact start it never does.
    """
    wanted = {
        "events": (_event(True, 0, False),),
        "domain": "none",
        "precision": EXTENDED,
        "error_estimate": True,
    }
    result = taylor(Request(PRINTED, "30.5", (exact("pi/2"), exact("-pi/2"), 0), "0.4", **wanted))
    assert numpy.isinf(result.error.state).all()


@pytest.mark.parametrize("distance", ["0.1", "0.00001"])
def test_a_start_that_touches_the_surface_but_for_rounding(taylor: Taylor, distance) -> None:
    """Start at the double nearest to pi/2.

    An orbit that touches the section then crosses it some 1e-9 s to 1e-7 s later.
    """
    for duration in (0.1, -0.01):
        laws = {"parameters": PRINTED}, {"parameters": PRINTED.with_friction("smooth")}
        for more in (*laws, laws[0] | {"dense": True}, laws[0] | {"times": [duration]}):
            start = (exact("pi/2"), exact("pi/2") - exact(distance), 0)
            wanted = {"omega": "30.5", "state": start, "duration": duration} | more
            result = taylor(Request(**wanted, events=(SECTION,), domain="none"))
            assert result.status is Status.REACHED, more


_SIGNS = st.sampled_from([-1.0, 1.0])


def _away_from_zero(most: float) -> st.SearchStrategy[float]:
    return st.builds(lambda sign, size: sign * size, _SIGNS, st.floats(1e-3, most))


@settings(max_examples=50, deadline=None)
@given(
    which=st.sampled_from([0, 1, 2]),
    direction=st.sampled_from([-1, 0, 1]),
    terminal=st.booleans(),
    gamma=_away_from_zero(1.5),
    power=st.floats(-4, 0.3),
    beta=_away_from_zero(0.4),
    sign=_SIGNS,
    duration=st.sampled_from([0.05, -0.025]),
)
@pytest.mark.slow
def test_events_from_the_surface_are_those_of_scipy(
    which, direction, terminal, gamma, power, beta, sign, duration
) -> None:
    """Check that no later crossing of a function that starts at exactly zero is lost."""
    function = (SECTION, BETA_EXTREME, SECTION)[which].function
    state = ((0.0, gamma, sign * 10**power), (beta, gamma, 0.0), (0.0, gamma, 0.0))[which]
    event = _event(which == 1, direction, terminal)
    assert event.function is function
    mine = shared(request(state, duration, event))
    # The tightest that SciPy keeps
    other = ScipyEngine()(request(state, duration, event, tolerance=1e-12))
    assert mine.status is other.status
    assert len(mine.events) == len(other.events)
    for one, two in zip(mine.events, other.events, strict=True):
        # SciPy's error in the state over the rate of a crossing, which is small near a touching
        assert abs(one.time - two.time) < 1e-7
    if not terminal and not direction:
        many = lanes(
            equation_constants(PRINTED), [30.5], [state], [duration], shifted=True, events=(event,)
        ).crossings
        assert sorted(abs(when) for _, _, when, _ in many) == pytest.approx(
            [abs(e.time) for e in mine.events]
        )
