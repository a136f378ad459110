"""Many runs at once: the numbers of single runs, and no effect of a failed lane on others."""

from __future__ import annotations

import numpy
import pytest

from tests.problems import SETS
from tippedisk_verify import PRINTED, BatchTaylor, Event, InputError, Request
from tippedisk_verify.flow.batch import equation_constants
from tippedisk_verify.flow.contract import BETA_EXTREME, FLAT

TURNS = Event("turns", BETA_EXTREME.function, terminal=False)
#: Of two orders of summation: some forty roundings of states of size 1 to 3, grown by less than
#: ten over half a second.
_ROUNDINGS = 40 * 2.0**-52 * 10


@pytest.fixture(scope="module")
def lanes() -> BatchTaylor:
    return BatchTaylor()


def starts(count: int) -> tuple[numpy.ndarray, numpy.ndarray, numpy.ndarray]:
    random = numpy.random.default_rng(7)
    states = numpy.column_stack(
        (random.uniform(1.2, 1.9, count), random.uniform(0, 3, count), random.uniform(-1, 1, count))
    )
    return random.uniform(30, 31, count), states, random.uniform(0.1, 0.5, count)


@pytest.mark.parametrize(
    ("count", "wanted"),
    [
        *((count, {"divergence": True, "events": (TURNS,)}) for count in (1, 5, 19)),
        (9, {"variations": ("beta", "gamma", "v", "Omega")}),
    ],
)
@pytest.mark.slow
def test_lanes_agree_with_single_runs(lanes, taylor, count, wanted) -> None:
    omegas, states, durations = starts(count)
    constants = numpy.array([equation_constants(SETS[k % 3]) for k in range(count)])
    found = lanes(constants, omegas, states, durations, **wanted)
    assert found.finished.all()
    for k in range(count):
        request = Request(SETS[k % 3], omegas[k], states[k], durations[k], domain="none", **wanted)
        alone = taylor(request)
        assert numpy.abs(found.states[k] - alone.state).max() < _ROUNDINGS
        # The divergence is an integral of about 130 1/s; derivatives by v and Omega are below 10.
        for many, one in (
            (found.divergence, alone.divergence),
            (found.derivatives, alone.derivatives),
        ):
            assert many is None or numpy.abs(many[k] - one).max() < 10 * _ROUNDINGS
        mine = [
            (when, state)
            for name, run, when, state in found.crossings
            if run == k and name == "turns"
        ]
        assert len(mine) == len(alone.events)
        for (when, state), record in zip(mine, alone.events, strict=True):
            assert abs(when - record.time) < _ROUNDINGS
            assert numpy.abs(numpy.array(state) - record.state).max() < _ROUNDINGS


def test_a_lane_that_stops_early_stops_no_other(lanes) -> None:
    omegas, states, durations = starts(10)
    whole = lanes(equation_constants(PRINTED), omegas, states, durations, events=(TURNS,))
    states[3] = [1.5, 1.5, 1e200]
    broken = lanes(equation_constants(PRINTED), omegas, states, durations, events=(TURNS,))
    others = numpy.arange(10) != 3
    assert not broken.finished[3]
    assert numpy.isnan(broken.states[3]).all()
    assert broken.finished[others].all()
    assert (broken.states[others] == whole.states[others]).all()

    def crossings(found) -> list[tuple[int, float]]:
        return sorted((run, when) for _, run, when, _ in found.crossings if run != 3)

    for (run, when), (other_run, other_when) in zip(
        crossings(broken), crossings(whole), strict=True
    ):
        assert run == other_run
        assert abs(when - other_when) < 32 * 2.0**-53  # some roundings of half a second


def test_refusals(lanes) -> None:
    omegas, states, durations = starts(4)
    with pytest.raises(InputError, match="need states"):
        lanes(equation_constants(PRINTED), omegas, states[:3], durations)
    with pytest.raises(InputError, match="cannot end a run"):
        lanes(equation_constants(PRINTED), omegas, states, durations, events=(FLAT,))
