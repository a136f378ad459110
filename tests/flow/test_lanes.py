"""Many runs at once: the numbers of single runs, and no effect of a failed lane on others."""

from __future__ import annotations

import numpy
import pytest

from tests.problems import SETS
from tippedisk_verify.errors import InputError
from tippedisk_verify.flow.contract import FLAT, TURN, Event, Request
from tippedisk_verify.flow.lanes import BatchTaylor, field_constants
from tippedisk_verify.model.parameters import PRINTED

TURNS = Event("turns", TURN.function, terminal=False)


@pytest.fixture(scope="module")
def lanes() -> BatchTaylor:
    return BatchTaylor()


def starts(count: int) -> tuple[numpy.ndarray, numpy.ndarray, numpy.ndarray]:
    random = numpy.random.default_rng(7)
    states = numpy.column_stack(
        (random.uniform(1.2, 1.9, count), random.uniform(0, 3, count), random.uniform(-1, 1, count))
    )
    return random.uniform(30, 31, count), states, random.uniform(0.1, 0.5, count)


@pytest.mark.parametrize("count", [1, 5, 19])
def test_lanes_agree_with_single_runs(lanes, taylor, count) -> None:
    omegas, states, durations = starts(count)
    constants = numpy.array([field_constants(SETS[k % 3]) for k in range(count)])
    found = lanes(constants, omegas, states, durations, divergence=True, events=(TURNS,))
    assert found.finished.all()
    for k in range(count):
        alone = taylor(
            Request(
                SETS[k % 3],
                omegas[k],
                states[k],
                durations[k],
                divergence=True,
                events=(TURNS,),
                domain="none",
            )
        )
        # Two orders of summation: some tens of roundings, grown by less than ten over half a
        # second.
        assert numpy.abs(found.states[k] - alone.state).max() < 1e-13
        assert abs(found.divergence[k] - alone.divergence) < 1e-12
        mine = [
            (when, state)
            for name, run, when, state in found.crossings
            if run == k and name == "turns"
        ]
        assert len(mine) == len(alone.events)
        for (when, state), record in zip(mine, alone.events, strict=True):
            assert abs(when - record.time) < 1e-13
            assert numpy.abs(numpy.array(state) - record.state).max() < 1e-13


def test_derivatives_are_those_of_single_runs(lanes, taylor) -> None:
    omegas, states, durations = starts(9)
    variations = ("beta", "gamma", "v", "Omega")
    found = lanes(field_constants(PRINTED), omegas, states, durations, variations=variations)
    for k in range(9):
        alone = taylor(
            Request(
                PRINTED, omegas[k], states[k], durations[k], variations=variations, domain="none"
            )
        )
        assert numpy.abs(found.derivatives[k] - alone.derivatives).max() < 1e-12


def test_a_lane_that_stops_early_stops_no_other(lanes) -> None:
    omegas, states, durations = starts(10)
    whole = lanes(field_constants(PRINTED), omegas, states, durations, events=(TURNS,))
    states[3] = [1.5, 1.5, 1e200]
    broken = lanes(field_constants(PRINTED), omegas, states, durations, events=(TURNS,))
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
        assert abs(when - other_when) < 1e-14


def test_refusals(lanes) -> None:
    omegas, states, durations = starts(4)
    with pytest.raises(InputError, match="need states"):
        lanes(field_constants(PRINTED), omegas, states[:3], durations)
    with pytest.raises(InputError, match="cannot end a run"):
        lanes(field_constants(PRINTED), omegas, states, durations, events=(FLAT,))
