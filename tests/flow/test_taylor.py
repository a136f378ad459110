"""The integrators that the Taylor engine compiles, and the ends of its runs."""

from __future__ import annotations

import gc
import weakref
from fractions import Fraction
from typing import Any

import numpy
import pytest

from tests.problems import STARTS
from tippedisk_verify import (
    CALIBRATED,
    DOUBLE,
    EXTENDED,
    PRINTED,
    QUADRUPLE,
    Event,
    Request,
    Status,
    Taylor,
    precision_of_bits,
)
from tippedisk_verify.flow import compiled_runners
from tippedisk_verify.flow.contract import SECTION, SLIDING_REVERSAL, raise_unless_usable
from tippedisk_verify.model.parameters import Friction


def test_the_factored_form_is_small() -> None:
    engine = Taylor()
    engine(Request(PRINTED, 30.4, STARTS[1], 0.1, domain="none"))
    assert engine.builds[0].u_variables <= 51


@pytest.mark.parametrize("other", [(PRINTED, 31.0), (CALIBRATED, 30.4)])
def test_one_build_serves_all_speeds_and_parameters(other) -> None:
    engine = Taylor()
    ends = [
        engine(Request(*disk_and_speed, STARTS[1], 1.0)).state
        for disk_and_speed in ((PRINTED, 30.4), other) * 2
    ]
    assert (ends[0] == ends[2]).all()
    assert (ends[1] == Taylor()(Request(*other, STARTS[1], 1.0)).state).all()
    assert len(engine.builds) == 1


def test_only_what_is_needed_is_built() -> None:
    engine = Taylor()
    engine(Request(PRINTED, 30.4, STARTS[1], 0.1, domain="samples"))
    assert [(b.precision, b.events, b.variations) for b in engine.builds] == [("double", (), ())]
    engine(Request(PRINTED, 30.4, STARTS[1], 0.1))
    assert engine.builds[-1].events == ("flat",)
    engine(Request(PRINTED, 30.4, STARTS[1], 0.1, domain="none", error_estimate=True))
    assert len(engine.builds) == 2  # a run's own series show its error
    engine(
        Request(
            PRINTED, 30.4, STARTS[1], 0.1, domain="none", error_estimate=True, variations=("v",)
        )
    )
    assert [build.precision for build in engine.builds[2:]] == ["double", "quadruple"]


@pytest.mark.parametrize(
    "precision",
    [DOUBLE, EXTENDED, QUADRUPLE, precision_of_bits(200), precision_of_bits(400)],
    ids=lambda p: p.name,
)
def test_first_step_from_the_section_has_the_usual_size(precision) -> None:
    """Check for the trap with powers.

    A recurrence that divides by cos(beta) starts with steps of 1e-13 there, or with NaN.
    """
    result = Taylor()(Request(PRINTED, "30.4", STARTS[1], "0.05", precision=precision))
    # The stiff rate of about 130 per second limits a step of any order to some hundredths of a
    # second.
    assert result.status is Status.REACHED
    assert result.steps <= 25


def test_samples_mode_notices_leaving_the_domain(taylor: Taylor) -> None:
    times = numpy.linspace(0, 10, 101)
    for sample_times in (times, None):
        result = taylor(
            Request(PRINTED, "29.9", STARTS[0], 10, times=sample_times, domain="samples")
        )
        assert result.status is Status.FLAT
        assert 5 < result.time < 6


def test_starting_outside_the_domain(taylor: Taylor) -> None:
    result = taylor(Request(PRINTED, 30.4, (-0.1, 0.0, 0.0), 1.0))
    assert (result.status, result.time, result.steps) == (Status.FLAT, 0.0, 0)
    assert list(result.state) == [-0.1, 0.0, 0.0]


@pytest.mark.parametrize("friction", ["linear", "smooth"])
@pytest.mark.parametrize(
    ("start", "duration", "times"),
    [
        (("pi/2", "pi/2 + 0.4", "0"), 2.0, [0.0, 0.7, 2.0]),
        (("pi/2", "pi/2 + 0.4", "0"), 2.0, [0.5, 1.5]),
        (("pi/2", "pi/2 + 0.4", "0"), -0.1, [-0.01, -0.1]),
        (("0.1", "1", "-8"), 1.0, [0.0, 0.001, 0.5, 1.0]),
        (("-0.1", "1", "0"), 1.0, [0.0, 1.0]),
    ],
    ids=["all", "inside", "backward", "lies flat", "outside"],
)
def test_heyokas_samples_are_those_of_the_series(
    taylor: Taylor, friction: Friction, start, duration: float, times
) -> None:
    disk = PRINTED.changed(friction=friction)
    variations = () if duration < 0 else ("beta",)
    by_series, by_grid = (
        taylor(
            Request(disk, "30.4", start, duration, times=times, dense=dense, variations=variations)
        )
        for dense in (True, False)
    )
    assert by_grid.status is by_series.status
    assert by_grid.samples.shape == by_series.samples.shape
    assert (by_grid.state == by_series.state).all()
    # Horner's scheme and heyoka's compensated sum differ by some roundings of states of size 10.
    assert abs(by_grid.samples - by_series.samples).max(initial=0) < 16 * 10 * 2.0**-53
    if variations and by_grid.status is Status.REACHED:
        apart = abs(by_grid.sample_derivatives - by_series.sample_derivatives)
        # Some hundred roundings of the largest derivative
        assert apart.max() < 100 * 2.0**-53 * abs(by_series.sample_derivatives).max()


def test_the_message_of_the_step_limit(taylor: Taylor) -> None:
    with pytest.raises(ArithmeticError, match="raise max_steps"):
        raise_unless_usable(taylor(Request(PRINTED, 30.4, STARTS[1], 10.0, max_steps=5)))


# ------------------------------------------------------------------------------------- what is kept
@pytest.fixture
def three_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled_runners, "_MAX_KEPT", 3)


def _tolerances(count: int, friction: Friction = "linear", **options: Any) -> list[Request]:
    tolerances, disk = (
        [Fraction(n + 1, 10**12) for n in range(count)],
        PRINTED.with_friction(friction),
    )
    return [
        Request(disk, "30.4", (1.2, 0.3, 0), 0.1, tolerance=one, **options) for one in tolerances
    ]


@pytest.mark.usefixtures("three_kept")
def test_the_least_recently_used_integrator_is_removed() -> None:
    engine = Taylor()
    first, second, third, fourth = _tolerances(4)
    for request in (first, second, third, first, fourth):
        engine(request)
    assert {key[2] for key in engine._integrators._slots} == {
        first.tolerance,
        third.tolerance,
        fourth.tolerance,
    }
    builds = engine.builds
    assert len(builds) == 3
    for request in (third, fourth, first):
        engine(request)
    assert engine.builds == builds  # none of these was compiled again
    assert (engine(second).state == Taylor()(second).state).all()
    assert {key[2] for key in engine._integrators._slots} == {
        second.tolerance,
        fourth.tolerance,
        first.tolerance,
    }


@pytest.mark.usefixtures("three_kept")
@pytest.mark.parametrize("friction", ["linear", "smooth"])
def test_a_removed_integrator_is_freed(friction: Friction) -> None:
    """Check that heyoka's callbacks do not keep their integrator alive."""
    engine, left = Taylor(), []
    events = (SECTION, Event("reverses", SLIDING_REVERSAL.function, terminal=False))
    for request in _tolerances(6, friction=friction, events=events, times=[0.05]):
        engine(request)
        (newest,) = (
            one.runner
            for key, one in engine._integrators._slots.items()
            if key[2] == request.tolerance
        )
        left += [weakref.ref(newest), weakref.ref(newest._stepper)]
    del newest
    gc.collect()
    assert sum(one() is not None for one in left) == 2 * 3
