"""Middles that Arb follows while lanes follow the boxes about them: exact answers, and faults that they notice."""

from __future__ import annotations

import inspect
import sys
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from tests.proofs.test_exact_flights import holds, oscillator
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.proofs.kernel import lane_middle
from tippedisk_verify.proofs.kernel.balls import arb, ball, ball_constants, working_precision
from tippedisk_verify.proofs.kernel.flow import Model
from tippedisk_verify.proofs.kernel.lane_middle import SharpModel
from tippedisk_verify.proofs.kernel.lanes import Lanes
from tippedisk_verify.proofs.search import lane_flight
from tippedisk_verify.proofs.search.lane_flight import LaneSteps, half_flights
from tippedisk_verify.proofs.search.steps import Steps

SIZES, SPEEDS = (2.0**-20, 2.0**-14, 2.0**-24), (2.0, 8.0, 1.0)


def flown(kind: type[SharpModel] = SharpModel) -> Any:
    """The oscillators from v = -size, and all those from a box about it."""
    with working_precision(96):
        model = kind(ball_constants(PRINTED), [*map(ball, SPEEDS)], oscillator)
        sizes = np.array(SIZES)
        return half_flights(model, Lanes([0.0] * 3), Lanes(-sizes, sizes * 2.0**-16))


def are_held(found: Any) -> bool:
    with working_precision(200):
        quarter = arb.pi() / 2
        return bool(found.returned.all()) and all(
            holds(part, truth, lane)
            for lane, (size, speed) in enumerate(zip(map(arb, SIZES), map(arb, SPEEDS), strict=True))
            for part, truth in (
                (found.middle.time, quarter), (found.time, quarter),
                (found.middle.beta_least, -size / 2), (found.middle.image[0], speed * size / 2),
                (found.middle.image[1], -size), (found.image[1], -size * (1 + arb(2) ** -17)),
            )
        )  # fmt: skip


def test_middles_are_held_and_known_far_better_than_boxes() -> None:
    found = flown()
    assert are_held(found)
    assert (found.middle.time.radii < 2.0**-50).all()
    assert (found.middle.image[1].radii < 2.0**-48 * np.array(SIZES)).all()  # of a few roundings
    assert (found.image[1].radii > 2.0**-17 * np.array(SIZES)).all()


@pytest.fixture
def short_series(monkeypatch) -> None:
    """Of which the remainders are larger than what is rounded."""
    monkeypatch.setattr(lane_flight, "_SHARP_ORDERS", (8, 8))
    monkeypatch.setattr(lane_flight, "_SHARP", 2.0**-30)


def test_middles_from_short_series_are_held(short_series) -> None:
    assert are_held(flown())


def test_remainders_hold_for_speeds_that_are_no_doubles() -> None:
    """A step of the middle at all speeds of a wide ball, from a series so short that its remainder is seen."""
    length, start = 2.0**-18, (0.0, 0.0, -1.0)
    with working_precision(96):
        model = SharpModel(ball_constants(PRINTED), [arb(32, 0.5)])
        path = model.path([Lanes([part]) for part in start], LaneSteps(1, sharp=True), derivatives=True)
        path.frame.deviation = [*path.frame.deviation[:3], Lanes([0.0])]  # as a walk has it
        path.box = path.frame.box()
        step = path.trial((1, 4)).tested(Lanes([length]))
        assert step.included.all()
        shown = [image.rest.arb(0) + image.point.arb(0) for image in step.centre(Lanes([length]))]
        for share in (-0.999, 0.5, 0.999):
            alone = Model(ball_constants(PRINTED), arb(32) + arb(0.5) * share).path([*map(arb, start)], Steps())
            truth = alone.trial((20, 12)).tested(length).at(arb(length))
            assert all(mine.overlaps(true) for mine, true in zip(shown, truth, strict=True)), share


FAULTS = {
    "the remainder is forgotten": ("[*c, r.arb(lane)]", "list(c)"),
    "another lane's orbit": ("self.path.orbits[lane]", "self.path.orbits[0]"),
    "another start": ("in starts[lane]]", "in starts[lane] * (1 + 2.0**-30)]"),
    "what the image differs from a double is a point": ("self.rest + (self.point", "self.rest.mid() + (self.point"),
    "orbits stay where lanes go": ("self.orbits[which]", "self.orbits[0 * which]"),
    "another lane's middle": ("self.middle.some(which)", "self.middle.some(0 * which)"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FAULTS)
def test_faults_are_noticed(name, short_series, monkeypatch) -> None:
    old, new = FAULTS[name]
    source = inspect.getsource(lane_middle)
    assert source.count(old) == 1
    module: Any = ModuleType(lane_middle.__name__)
    monkeypatch.setitem(sys.modules, lane_middle.__name__, module)  # where dataclasses look for their names
    exec(source.replace(old, new), module.__dict__)
    for kind in ("SharpModel", "SharpWalk"):
        monkeypatch.setattr(lane_flight, kind, getattr(module, kind))
    try:
        assert are_held(flown(module.SharpModel))
    except (AssertionError, IndexError, ValueError):
        return
    pytest.fail("it is not noticed")
