"""Engines against each other and against more bits; the refusals and statuses of the SciPy engines."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy
import pytest

from tests.problems import STARTS, held
from tippedisk_verify import (
    DOUBLE,
    EXTENDED,
    PRINTED,
    QUADRUPLE,
    Event,
    InputError,
    Parameters,
    Request,
    ScipyEngine,
    Status,
    Taylor,
    exact,
    precision_of_bits,
)
from tippedisk_verify.flow.contract import BETA_EXTREME, SECTION
from tippedisk_verify.flow.scipy_engine import SCIPY_METHODS
from tippedisk_verify.numbers.exact import fraction

ALL_VARIATIONS = ("beta", "gamma", "v", "Omega", "r", "e", "a", "b", "g", "k")


def distance(left, right) -> Fraction:
    return max(
        abs(fraction(a) - fraction(b))
        for a, b in zip(numpy.ravel(left), numpy.ravel(right), strict=True)
    )


def test_a_run_that_settles(taylor: Taylor) -> None:
    """Check an orbit on which gamma rests while the rest decays: all such runs round alike."""
    disk = Parameters(
        r="0.0108827",
        e="0.0048537712616",
        m="1.81408",
        A="0.0002765383633122957452398963574308864",
        B="0.0002407260328563258597383426048",
        g="10.7732",
        mu="0.235551",
        epsilon="0.0328552",
    )
    passing = tuple(
        replace(event, name=f"each {event.name}", terminal=False)
        for event in (SECTION, BETA_EXTREME)
    )
    request = Request(
        disk, "293.6", (exact("pi/2"), "-5.10015", "-1.45367"), "0.387824", events=passing
    )
    mine, truth = (
        taylor(replace(request, error_estimate=True)),
        taylor(replace(request, precision=QUADRUPLE)),
    )
    assert held(mine.state, truth.state, mine.error.state)
    mine_times, true_times = ([record.time for record in run.events] for run in (mine, truth))
    assert held(mine_times, true_times, mine.error.events)


@pytest.mark.parametrize(
    ("law", "engine", "greatest"),
    [
        ("linear", Taylor(), 1.0),
        ("smooth", Taylor(), 1.0),  # switches cost no order
        ("linear", ScipyEngine("DOP853"), 8 / 5),
    ],
    ids=["taylor", "taylor, smooth", "scipy"],
)
def test_error_follows_the_tolerance(taylor: Taylor, law, engine, greatest: float) -> None:
    """Check that the error is a power of the tolerance over eight decades, given by the orders.

    The tolerance bounds a Taylor step's error: the power is 1. DOP853's steps follow an error
    estimate of order 5 to 8 (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I,
    II.10), and its solution has order 8. So the power lies between 1 and 8/5. Step-size control
    leaves a quarter over this range.
    """
    request = Request(PRINTED.with_friction(law), "30.4", STARTS[1], 2)
    truth = taylor(replace(request, precision=QUADRUPLE)).state
    tolerances = [10.0**-k for k in range(4, 13, 2)]
    runs = [engine(replace(request, tolerance=tolerance)) for tolerance in tolerances]
    # An error of zero is one of a rounding
    errors = [max(float(distance(run.state, truth)), 2.0**-53) for run in runs]
    slope = numpy.polyfit(numpy.log(tolerances), numpy.log(errors), 1)[0]
    assert 1 / 1.25 < slope < 1.25 * greatest, errors


def test_more_bits_give_more_digits(taylor: Taylor) -> None:
    truth = taylor(Request(PRINTED, "30.4", STARTS[1], 1, precision=precision_of_bits(200))).state
    for precision in (DOUBLE, EXTENDED, QUADRUPLE, precision_of_bits(60), precision_of_bits(150)):
        result = taylor(Request(PRINTED, "30.4", STARTS[1], 1, precision=precision))
        # One second near the inverted state loses less than two digits.
        assert distance(result.state, truth) < 100 * precision.epsilon, precision.name


@pytest.mark.parametrize("method", SCIPY_METHODS)
@pytest.mark.parametrize("friction", ["linear", "smooth"])
def test_scipy_engines_agree_with_each_other(method: str, friction) -> None:
    disk = PRINTED.with_friction(friction)
    request = Request(disk, "30.4", STARTS[1], 1, tolerance=1e-9)  # any that is not the default
    reference = ScipyEngine("DOP853")(Request(disk, "30.4", STARTS[1], 1))
    # BDF lets about 1e3 of its local tolerance through over a second.
    assert distance(ScipyEngine(method)(request).state, reference.state) < Fraction(1, 10**6) * 2


@pytest.mark.parametrize(
    "variations",
    [("gamma", "Omega", "e"), pytest.param(ALL_VARIATIONS, marks=pytest.mark.slow)],
    ids=["one of each kind", "all"],
)
def test_derivatives_agree_between_engines(taylor: Taylor, variations) -> None:
    request = Request(PRINTED, "30.4", STARTS[1], "0.5", variations=variations)
    mine = taylor(request).derivatives
    theirs = ScipyEngine("DOP853")(request).derivatives
    scale = abs(mine).max(axis=0)
    # DOP853 at a local tolerance of 1e-13, for a hundred steps
    assert (abs(mine - theirs).max(axis=0) < 1e-11 * scale).all()


@pytest.mark.parametrize("make", [Taylor, ScipyEngine], ids=["taylor", "scipy"])
def test_backward_undoes_forward(make) -> None:
    engine = make()
    there = engine(Request(PRINTED, "30.4", STARTS[1], 0.05))
    back = engine(Request(PRINTED, "30.4", there.state, -0.05, times=[-0.01, -0.05]))
    # Backward the stiff direction grows by e^(129 * 0.05), about 630.
    assert distance(back.state, [float(part) for part in STARTS[1]]) < Fraction(1, 10**10)
    assert back.samples.shape == (2, 3)
    assert distance(back.samples[-1], back.state) < Fraction(1, 10**10)


@pytest.mark.parametrize("make", [Taylor, ScipyEngine], ids=["taylor", "scipy"])
def test_samples_dense_output_and_events_agree(make) -> None:
    engine = make()
    times = numpy.linspace(0, 3, 31)
    sampled = engine(Request(PRINTED, "30.4", STARTS[1], 4.0, times=times))
    dense = engine(Request(PRINTED, "30.4", STARTS[1], 4.0, times=times, dense=True))
    assert sampled.samples.shape == dense.samples.shape == (31, 3)
    # DOP853's interpolant has order 7: its error is larger than that of the steps.
    assert abs(sampled.samples - dense.dense(times)).max() < (
        1e-13 if engine.name == "taylor" else 1e-7
    )
    # Two step sequences: DOP853 lets about 1e3 of its tolerance of 1e-13 through in four seconds.
    assert distance(sampled.state, dense.state) < Fraction(1, 10**9)
    crossing = Event("crossing", SECTION.function, -1, terminal=False)
    events = engine(Request(PRINTED, "30.4", STARTS[1], 4.0, events=(crossing,), dense=True))
    assert len(events.events) == 4  # one falling crossing in each period of 0.91 s
    for record in events.events:
        assert record.name == "crossing"
        # The root of an interpolant that errs far less; a wrong crossing would be off by 1e-2.
        assert abs(record.state[0] - numpy.pi / 2) < 1e-9


@pytest.mark.parametrize("change", [{"precision": EXTENDED}, {"error_estimate": True}])
def test_refusals(change) -> None:
    """What an engine refuses that is wrong for every engine is in tests/stress."""
    with pytest.raises(InputError):
        ScipyEngine()(Request(PRINTED, 30.4, STARTS[1], 1.0, **change))


@pytest.mark.parametrize("friction", ["linear", "smooth"])
@pytest.mark.parametrize("make", [Taylor, ScipyEngine], ids=["taylor", "scipy"])
@pytest.mark.parametrize(
    ("change", "status"),
    [
        ({"omega": 29.9, "state": STARTS[0]}, Status.FLAT),
        ({"state": (3.5, 0.0, 0.0)}, Status.FLAT),
        ({"max_steps": 2}, Status.STEP_LIMIT),
        ({"state": (1.5, 0.0, 1e200), "domain": "none"}, Status.NON_FINITE),
    ],
)
def test_how_runs_end(make, friction, change, status) -> None:
    wanted = {"omega": 30.4, "state": STARTS[1], "duration": 10.0} | change
    assert make()(Request(PRINTED.with_friction(friction), **wanted)).status is status


@pytest.mark.parametrize("method", ["DOP853", "RK45", "Radau", "BDF"])
def test_overflow_has_a_status_and_no_warning(method) -> None:
    assert (
        ScipyEngine(method)(Request(PRINTED, 30.4, ("1.5", "0.2", "1e300"), 1e-3)).status
        is Status.NON_FINITE
    )


def test_parameter_derivatives_of_the_smooth_law() -> None:
    request = Request(PRINTED.with_friction("smooth"), 30.4, STARTS[1], 1.0, variations=("Omega",))
    ends = [
        ScipyEngine()(replace(request, omega=30.4 + step, variations=())).state
        for step in (1e-5, -1e-5)
    ]
    # SciPy's error of 1e-11 over the step of the difference.
    assert abs(ScipyEngine()(request).derivatives[:, 0] - (ends[0] - ends[1]) / 2e-5).max() < 1e-5
    with pytest.raises(InputError, match="no derivative with respect to 'k'"):
        ScipyEngine()(
            Request(PRINTED.with_friction("smooth"), 30.4, STARTS[1], 1.0, variations=("k",))
        )
