"""The smooth law in the Taylor engine: full order, honest estimates, and switches that come close together."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import numpy
import pytest

from tests.problems import STARTS, held
from tippedisk_verify.flow.baseline import Baseline
from tippedisk_verify.flow.contract import FLAT, SLIDING_REVERSAL, Event, Request, Status
from tippedisk_verify.flow.lanes import BatchTaylor, field_constants
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.exact import exact, fraction
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.model.precision import DOUBLE, EXTENDED, QUADRUPLE, bits

_ENGINE = Taylor()


def smooth(omega, start, duration, **needs) -> Request:
    return Request(PRINTED.with_friction("smooth"), omega, start, duration, **needs)


@pytest.mark.slow
@pytest.mark.parametrize("omega", ["29.9", "30.4", "31.4"])
@pytest.mark.parametrize("start", STARTS)
def test_estimates_hold_and_are_small(taylor, omega, start) -> None:
    rough = taylor(smooth(omega, start, 10, error_estimate=True))
    truth = taylor(smooth(omega, start, 10, precision=bits(200)))
    assert rough.status is truth.status
    assert held(rough.state, truth.state, rough.error.state)
    assert rough.error.largest < 1e-10


def errors_against_tolerance(friction: str, tolerances: list[float]) -> list[float]:
    truth = _ENGINE(Request(PRINTED.with_friction(friction), "30.4", STARTS[1], 3, precision=QUADRUPLE)).state
    found = []
    for tolerance in tolerances:
        state = _ENGINE(Request(PRINTED.with_friction(friction), "30.4", STARTS[1], 3, tolerance=tolerance)).state
        found.append(max(abs(float(fraction(a) - fraction(b))) for a, b in zip(state, truth, strict=True)))
    return found


def test_convergence_order_is_that_of_the_linear_law() -> None:
    tolerances = [10.0**-k for k in range(4, 12)]
    slopes = [
        numpy.polyfit(numpy.log(tolerances), numpy.log(errors_against_tolerance(law, tolerances)), 1)[0]
        for law in ("linear", "smooth")
    ]
    assert abs(slopes[0] - slopes[1]) < 0.2
    assert slopes[1] > 0.8


@pytest.mark.slow
def test_derivatives_cross_the_switches(taylor) -> None:
    """The saltation matrix is the identity: the variational equations, carried on unchanged, give the differences."""
    precision, step = bits(200), Fraction(1, 10**15)
    start = list(STARTS[1])
    whole = taylor(
        smooth("30.4", start, 1, precision=precision, variations=("beta", "gamma", "v", "Omega"), domain="none")
    )
    for column in range(4):
        ends = []
        for sign in (1, -1):
            moved, omega = list(start), Fraction("30.4")
            if column < 3:
                moved[column] = exact(moved[column]) + exact(sign * step)
            else:
                omega += sign * step
            ends.append(taylor(smooth(omega, moved, 1, precision=precision, domain="none")).state)
        for row in range(3):
            slope = (fraction(ends[0][row]) - fraction(ends[1][row])) / (2 * step)
            # Second derivatives jump at a switch, so the central difference is off by the step to the first power.
            assert abs(slope - fraction(whole.derivatives[row][column])) < Fraction(1, 10**8)


@pytest.mark.parametrize("start", [("pi/2", "pi/2", 0), ("pi/2", "-pi/2", 0), ("pi/2", "3 pi/2", 0)])
def test_equilibria_stay_though_they_lie_on_the_surface(taylor, start) -> None:
    result = taylor(smooth("31.4", start, "0.2"))
    assert result.status is Status.REACHED
    assert max(abs(float(a) - float(exact(b))) for a, b in zip(result.state, start, strict=True)) < 1e-13


def test_a_start_on_the_surface(taylor) -> None:
    """gamma_y = 0 at the start, in both directions of time; against 200 bits and against SciPy."""
    c = PRINTED.at(DOUBLE)
    for gamma in (0.3, 2.0, 4.0):
        v = c.e * 30.4 * math.sin(1.4) * math.cos(gamma) / (c.r + c.e * math.sin(gamma))
        for duration in ("0.5", "-0.02"):
            request = smooth("30.4", (1.4, gamma, v), duration)
            mine, truth = taylor(request), taylor(smooth("30.4", (1.4, gamma, v), duration, precision=bits(200)))
            assert max(abs(float(a) - float(b)) for a, b in zip(mine.state, truth.state, strict=True)) < 1e-11
            other = Baseline("DOP853")(request)
            assert max(abs(float(a) - float(b)) for a, b in zip(mine.state, other.state, strict=True)) < 1e-8


def test_careful_runs_give_the_same(taylor) -> None:
    """The slow path that looks at the branch after every switch, forced, against the fast one: with all outputs."""
    times = [0.1 * k for k in range(31)]
    for needs in ({}, {"times": times}, {"times": times, "dense": True}):
        request = smooth("30.4", STARTS[0], 3.0, **needs)
        fast = taylor(request)
        engine = Taylor()
        engine(request)
        (integrator,) = engine._integrators.kept()
        begin = integrator._branch.begin

        def doubtful(*arguments, begin=begin, branch=integrator._branch, once=[True]) -> None:  # noqa: B006
            begin(*arguments)
            branch._contradicted, once[0] = once[0], False

        integrator._branch.begin = doubtful
        slow = engine(request)
        assert slow.status is fast.status
        assert numpy.abs(slow.state - fast.state).max() < 1e-11
        if needs:
            assert numpy.abs(slow.samples - fast.samples).max() < 1e-11


@pytest.mark.parametrize(("beta", "gamma"), [(2.0, 0.5075683146572606), (1.2, 2.4962702039703113)])
def test_motions_that_touch_the_surface(taylor, beta: float, gamma: float) -> None:
    """Where gamma_y and its rate vanish together two switches come as close as one likes, or there is none."""
    c, omega = PRINTED.at(DOUBLE), 30.4
    touching = c.e * omega * math.sin(beta) * math.cos(gamma) / (c.r + c.e * math.sin(gamma))
    for offset in (0.0, 1e-18, -1e-18, 1e-16, -1e-16, 1e-14, -1e-14, 1e-12, -1e-12):
        before = taylor(smooth("30.4", (beta, gamma, touching + offset), "-0.003", precision=bits(200))).state
        request = smooth("30.4", [float(x) for x in before], "0.1")
        mine, truth = taylor(request), taylor(replace(request, precision=bits(200)))
        # Some forty units in the last place, for ten steps.
        assert max(abs(float(a) - float(b)) for a, b in zip(mine.state, truth.state, strict=True)) < 1e-14


_REVERSES = Event("reverses", SLIDING_REVERSAL.function, terminal=False)


def reversals_by_samples(engine, request: Request) -> int:
    """How often gamma_y / sin(beta) changes its sign on a fine grid of the run, without any event."""
    times = numpy.linspace(0, float(request.duration), 20_001)
    beta, gamma, v = engine(replace(request, events=(), times=times)).samples.T
    c = request.parameters.at(DOUBLE)
    slip = SLIDING_REVERSAL.function(numpy, c, float(exact(request.omega)), beta, gamma, v)
    return int((slip[1:] * slip[:-1] < 0).sum())


@pytest.mark.parametrize("precision", [DOUBLE, EXTENDED, QUADRUPLE], ids=lambda p: p.name)
def test_reversals_that_are_asked_for_are_all_found(taylor, precision) -> None:
    """They happen at the very time at which the branch is switched, and of two events at one time one may be lost."""
    for start in random_states(12, 3).tolist():
        request = smooth("30.4", start, "0.5", events=(_REVERSES,), precision=precision)
        found = [record for record in taylor(request).events if record.name == _REVERSES.name]
        assert len(found) == reversals_by_samples(taylor, replace(request, precision=DOUBLE))
        c, omega = PRINTED.at(precision), precision.number("30.4")
        for record in found:
            slip = SLIDING_REVERSAL.function(precision.ops, c, omega, *record.state)
            # A few roundings of the state, of terms of about 0.5 m/s.
            assert abs(float(slip)) < 64 * float(precision.epsilon)


def test_a_reversal_ends_the_run_where_it_should(taylor) -> None:
    """Terminal, in each direction; the start on the surface is no reversal."""
    whole = smooth("30.4", STARTS[1], 2, events=(_REVERSES,))
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
    after = replace(whole, state=[float(part) for part in taylor(replace(whole, events=(SLIDING_REVERSAL,))).state])
    assert float(taylor(replace(after, events=(SLIDING_REVERSAL,))).time) == pytest.approx(
        times[1] - times[0],
        abs=1e-9,  # event times of two step sequences
    )


def test_lanes_find_the_same_reversals(taylor) -> None:
    starts = random_states(16, 4)
    found = BatchTaylor()(
        field_constants(PRINTED.with_friction("smooth")),
        numpy.full(16, 30.4),
        starts,
        numpy.full(16, 0.5),
        friction="smooth",
        events=(_REVERSES,),
    )
    for k, start in enumerate(starts.tolist()):
        alone = taylor(smooth("30.4", start, "0.5", events=(_REVERSES,), domain="none"))
        mine = [time for name, run, time, _ in found.crossings if run == k and name == _REVERSES.name]
        if found.finished[k]:
            theirs = [float(record.time) for record in alone.events]
            assert numpy.allclose(mine, theirs, rtol=0, atol=1e-10)  # event times of two step sequences
    assert found.finished.sum() > 12


def test_small_states_have_small_errors_and_true_estimates(taylor) -> None:
    """heyoka's tolerance is absolute below 1: the wider run must not truncate small states where it could round them.

    A start a millionth beside noninverted spinning; errors are some 1e-20 and differ from sample to sample.
    """
    for k in range(1, 9):
        start = (Fraction(-k, 7 * 10**6), exact("-pi") + Fraction(k, 10**6), Fraction(3 * k, 10**6))
        times = [Fraction(n, 40) for n in range(1, 13)]
        request = smooth("30.4", start, "0.3", shifted=True, times=times, domain="none", error_estimate=True)
        mine, truth = taylor(request), taylor(replace(request, precision=QUADRUPLE, error_estimate=False))
        assert held(mine.samples, truth.samples, mine.error.samples)


def random_states(count: int, seed: int) -> numpy.ndarray:
    random = numpy.random.default_rng(seed)
    return numpy.column_stack(
        (random.uniform(0.02, 3.12, count), random.uniform(-1.5, 4.7, count), random.uniform(-10, 10, count))
    )


@pytest.mark.slow
def test_100_starts_against_200_bits_and_scipy(taylor) -> None:
    """10 s or to the edge of the domain: within the estimates, which are small unless the orbit itself amplifies."""
    for k, start in enumerate(random_states(100, 11).tolist()):
        omega = (29.9, 30.4, 31.4)[k % 3]
        mine = taylor(smooth(omega, start, 10, error_estimate=True))
        truth = taylor(smooth(omega, start, 10, precision=bits(200)))
        assert mine.status is truth.status
        assert held(mine.state, truth.state, mine.error.state)
        growth = taylor(
            smooth(omega, start, float(mine.time), variations=("beta", "gamma", "v"), domain="none")
        ).derivatives
        amplified = max(1.0, float(numpy.abs(growth).max()))
        assert mine.error.largest < max(1e-10, 1e-12 * amplified)
        other = Baseline("DOP853")(smooth(omega, start, 10))
        assert other.status is mine.status
        # SciPy does not switch: its error of some 1e-10 a switch grows along the orbit, and moves the end if flat.
        assert numpy.abs(other.state - mine.state).max() < 1e-6 * amplified


@pytest.mark.slow
@pytest.mark.parametrize("friction", ["linear", "smooth"])
def test_10000_starts_end_with_a_status(friction) -> None:
    """20 s each, one by one: every run ends, and none leaves the domain unreported."""
    for k, start in enumerate(random_states(10_000, 5)):
        request = Request(PRINTED.with_friction(friction), (29.9, 30.4, 31.4)[k % 3], start.tolist(), 20.0)
        result = _ENGINE(request)
        assert result.status in (Status.REACHED, Status.FLAT)
        assert (numpy.sin(result.state[0]) > 1e-9) == (result.status is Status.REACHED)


@pytest.mark.parametrize("friction", ["linear", "smooth"])
def test_lanes_agree_with_single_runs_and_see_who_lies_flat(taylor, friction) -> None:
    flat = Event("lies flat", FLAT.function, terminal=False)
    starts = random_states(120, 9)
    found = BatchTaylor()(
        field_constants(PRINTED.with_friction(friction)),
        numpy.full(120, 30.4),
        starts,
        numpy.full(120, 4.0),
        friction=friction,
        events=(flat,),
    )
    lying = {run for name, run, _, _ in found.crossings if name == flat.name}
    for k, start in enumerate(starts):
        alone = taylor(Request(PRINTED.with_friction(friction), 30.4, start.tolist(), 4.0))
        if not found.finished[k]:
            continue  # it says so
        assert (k in lying) == (alone.status is Status.FLAT)
        if alone.status is Status.REACHED:
            assert numpy.abs(found.states[k] - alone.state).max() < 1e-9
    assert found.finished.mean() > 0.99
