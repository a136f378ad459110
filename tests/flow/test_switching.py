"""The smooth law in the Taylor engine: full order, honest estimates and close switches."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy
import pytest

from tests.problems import STARTS
from tippedisk_verify import (
    DOUBLE,
    PRINTED,
    QUADRUPLE,
    BatchTaylor,
    Event,
    Request,
    ScipyEngine,
    Status,
    exact,
)
from tippedisk_verify.flow import switching
from tippedisk_verify.flow.batch import equation_constants
from tippedisk_verify.flow.contract import FLAT, SLIDING_REVERSAL


def smooth(omega, start, duration, **needs) -> Request:
    return Request(PRINTED.with_friction("smooth"), omega, start, duration, **needs)


def test_a_start_on_the_surface(taylor) -> None:
    """Start at gamma_y = 0, in both directions of time.

    The references are quadruple precision, lanes and SciPy. From the last start gamma_y is 0 again
    15 microseconds later.
    """
    lanes, constants = BatchTaylor(), equation_constants(PRINTED.with_friction("smooth"))
    c = PRINTED.constants_in(DOUBLE)
    roundings = 40 * 2.0**-52 * 10  # forty, of states of size 1 to 5, grown by less than ten
    for beta, gamma in ((1.4, 0.3), (1.4, 2.0), (1.4, 4.0), (1.2, 2.4963702)):
        v = c.e * 30.4 * math.sin(beta) * math.cos(gamma) / (c.r + c.e * math.sin(gamma))
        for duration in ("0.5", "-0.02"):
            request = smooth("30.4", (beta, gamma, v), duration)
            mine, truth = taylor(request), taylor(replace(request, precision=QUADRUPLE))
            assert (
                max(abs(float(a) - float(b)) for a, b in zip(mine.state, truth.state, strict=True))
                < roundings
            )
            many = lanes(
                constants, [30.4], [(beta, gamma, v)], [float(duration)], friction="smooth"
            )
            assert many.finished.all()
            assert numpy.abs(many.states[0] - mine.state).max() < roundings
            other = ScipyEngine("DOP853")(request)
            assert (
                max(abs(float(a) - float(b)) for a, b in zip(mine.state, other.state, strict=True))
                < 100 * 1e-13  # SciPy's tolerance, in some hundred steps
            )


def test_careful_runs_give_the_same(taylor, monkeypatch) -> None:
    """Force the slow method, which looks ahead at every switch.

    All outputs agree with those of the fast method.
    """
    times = [0.1 * k for k in range(31)]
    request = smooth("30.4", STARTS[0], 3.0, times=times, dense=True)
    fast = taylor(request)
    monkeypatch.setattr(
        switching.FrictionSign, "used_wrong_sign", lambda sign, stepper: not sign.looks_ahead
    )
    slow = taylor(request)
    assert slow.status is fast.status
    # Both err by some roundings of states of size 10 in each step, which grow by less than ten.
    roundings = 10 * fast.steps * 10 * 10 * 2.0**-53
    assert numpy.abs(slow.state - fast.state).max() < roundings
    assert numpy.abs(slow.samples - fast.samples).max() < roundings
    for most in (1, 7, 20):
        result = taylor(smooth("30.4", STARTS[0], 3.0, max_steps=most))
        assert result.status is Status.STEP_LIMIT
        assert result.steps <= most


@pytest.mark.parametrize(("beta", "gamma"), [(2.0, 0.5075683146572606), (1.2, 2.4962702039703113)])
def test_motions_that_touch_the_surface(taylor, beta: float, gamma: float) -> None:
    """Check where gamma_y and its rate vanish together.

    Two switches then come arbitrarily close, or there is none.
    """
    c, omega = PRINTED.constants_in(DOUBLE), 30.4
    touching = c.e * omega * math.sin(beta) * math.cos(gamma) / (c.r + c.e * math.sin(gamma))
    for offset in (0.0, 1e-16, -1e-14, 1e-12, -1e-12):
        before = taylor(
            smooth("30.4", (beta, gamma, touching + offset), "-0.003", precision=QUADRUPLE)
        ).state
        request = smooth("30.4", [float(x) for x in before], "0.1")
        mine, truth = taylor(request), taylor(replace(request, precision=QUADRUPLE))
        # Some forty units in the last place of 1, for ten steps.
        assert (
            max(abs(float(a) - float(b)) for a, b in zip(mine.state, truth.state, strict=True))
            < 45 * 2.0**-52
        )


_REVERSES = Event("reverses", SLIDING_REVERSAL.function, terminal=False)


def reversals_by_samples(engine, request: Request) -> int:
    """Count the sign changes of gamma_y / sin(beta) on a fine grid of the run, without events."""
    times = numpy.linspace(0, float(request.duration), 20_001)
    beta, gamma, v = engine(replace(request, events=(), times=times)).samples.T
    c = request.parameters.constants_in(DOUBLE)
    slip = SLIDING_REVERSAL.function(numpy, c, float(exact(request.omega)), beta, gamma, v)
    return int((slip[1:] * slip[:-1] < 0).sum())


@pytest.mark.parametrize("precision", [DOUBLE, QUADRUPLE], ids=lambda p: p.name)
def test_all_requested_reversals_are_found(taylor, precision) -> None:
    """Check events at the same time as the switch, of which an integrator may lose one."""
    for start in random_states(12, 3).tolist():
        request = smooth("30.4", start, "0.5", events=(_REVERSES,), precision=precision)
        found = [record for record in taylor(request).events if record.name == _REVERSES.name]
        assert len(found) == reversals_by_samples(taylor, replace(request, precision=DOUBLE))
        c, omega = PRINTED.constants_in(precision), precision.number("30.4")
        for record in found:
            slip = SLIDING_REVERSAL.function(precision.ops, c, omega, *record.state)
            # A few roundings of the state, of terms of about 0.5 m/s.
            assert abs(float(slip)) < 64 * float(precision.epsilon)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-5, 1e-9])
def test_a_loose_tolerance_crosses_the_surface_once(taylor, monkeypatch, tolerance: float) -> None:
    """Check that no crossing is found again just after itself, which would repeat the run."""
    repeats = []
    begin = switching.FrictionSign.begin
    monkeypatch.setattr(
        switching.FrictionSign,
        "begin",
        lambda sign, stepper, start: (
            repeats.append(sign.looks_ahead) or begin(sign, stepper, start)
        ),
    )
    request = smooth("30.4", (math.pi / 2, 3.27, -1.71), 10.0, tolerance=tolerance)
    times = [record.time for record in taylor(replace(request, events=(_REVERSES,))).events]
    assert len(times) > 40
    assert min(numpy.diff(times)) > 1e-3
    assert repeats == [False]


def test_a_reversal_ends_the_run_where_it_should(taylor) -> None:
    """Check terminal events in each direction; the start on the surface is no reversal."""
    whole = smooth("30.4", STARTS[1], 2, events=(_REVERSES,))
    # Any time between the start, which may be on the surface, and the first reversal
    times = [float(record.time) for record in taylor(whole).events if float(record.time) > 1e-6]
    assert len(times) > 4
    ends = {}
    for direction in (0, 1, -1):
        event = Event("ends", SLIDING_REVERSAL.function, direction=direction)
        result = taylor(replace(whole, events=(event,)))
        assert result.status is Status.EVENT
        assert result.events[-1].name == "ends"
        ends[direction] = float(result.time)
    assert ends[0] == min(ends[1], ends[-1])
    # Two compiled programs that take other steps: their events agree to rounding.
    assert {round(ends[1], 12), round(ends[-1], 12)} == {round(time, 12) for time in times[:2]}
    after = replace(
        whole,
        state=[float(part) for part in taylor(replace(whole, events=(SLIDING_REVERSAL,))).state],
    )
    assert float(taylor(replace(after, events=(SLIDING_REVERSAL,))).time) == pytest.approx(
        times[1] - times[0],
        abs=1e-9,  # event times of two step sequences
    )


def random_states(count: int, seed: int) -> numpy.ndarray:
    random = numpy.random.default_rng(seed)
    return numpy.column_stack(
        (
            random.uniform(0.02, 3.12, count),
            random.uniform(-1.5, 4.7, count),
            random.uniform(-10, 10, count),
        )
    )


def test_lanes_agree_with_single_runs_on_reversals_and_flat_disks(taylor) -> None:
    flat = Event("lies flat", FLAT.function, terminal=False)
    starts = random_states(60, 9)
    disk = PRINTED.with_friction("smooth")
    speeds, durations = numpy.full(60, 30.4), numpy.full(60, 4.0)
    found = BatchTaylor()(
        equation_constants(disk),
        speeds,
        starts,
        durations,
        friction="smooth",
        events=(flat, _REVERSES),
    )
    for k, start in enumerate(starts):
        alone = taylor(Request(disk, 30.4, start.tolist(), 4.0, events=(_REVERSES,)))
        if not found.finished[k]:
            continue  # it says so
        mine = {
            name: [when for event, run, when, _ in found.crossings if (event, run) == (name, k)]
            for name in (flat.name, _REVERSES.name)
        }
        assert bool(mine[flat.name]) == (alone.status is Status.FLAT)
        if alone.status is Status.REACHED:
            # The lanes' rounding, grown in four seconds; a missed switch would be off by 1e-3.
            assert numpy.abs(found.states[k] - alone.state).max() < 1e-9
            theirs = [float(record.time) for record in alone.events]
            # Of two step sequences
            assert numpy.allclose(mine[_REVERSES.name], theirs, rtol=0, atol=1e-9)
    assert found.finished.mean() > 0.98
