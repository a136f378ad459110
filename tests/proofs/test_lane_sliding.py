"""The smooth law side by side: orbits through a reversal against those of single proofs, and planted faults."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from tests.proofs.cases import Flight, carry, half_flight, plant
from tests.proofs.test_sliding import GUESS, OMEGA, SMOOTH
from tippedisk_verify.model.parameters import Constants
from tippedisk_verify.proofs.kernel.balls import arb, ball, ball_constants, working_precision
from tippedisk_verify.proofs.kernel.flow import Status as FlowStatus
from tippedisk_verify.proofs.kernel.lanes import Lanes, quiet
from tippedisk_verify.proofs.kernel.section import HALF, Round, Status, Walk
from tippedisk_verify.proofs.kernel.sliding import SlidingPath, SmoothModel, model_of
from tippedisk_verify.proofs.search.lane_flight import LaneSteps, half_flights, lane_of

START = np.array([[float(part)] for part in (*GUESS, OMEGA)])  # gamma_bar, v and Omega of a limit cycle
#: A point, a narrow and a wide box; and one that begins on the other side.
RADII = np.array([0.0, 1e-9, 1e-6, 1e-9])
MIDDLES = START + np.array([[0.0], [1.0], [0.0]]) * np.array([0.0, 0.0, 0.0, 0.2])
SPAN = 0.012  # s: the first reversal of the cycle is 0.01 s after the section


def model(middles: np.ndarray, radii: np.ndarray | float = 0.0) -> SmoothModel:
    with working_precision(96):
        constants = Constants(*(Lanes.of([value]) for value in ball_constants(SMOOTH)))
    return SmoothModel(constants, Lanes(middles[2], radii))


def followed() -> SlidingPath:
    """All lanes followed beyond `SPAN`."""
    start = [Lanes(part, RADII) for part in MIDDLES[:2]]
    with quiet():
        walk = Walk(model(MIDDLES, RADII), HALF, start, search := LaneSteps(len(RADII)), derivatives=True)
        for _ in range(30):
            tried = walk.advance()
            assert isinstance(tried, Round)
            assert (search.answered(tried) == None).all()  # noqa: E711
            if (walk.path.time.midpoints > SPAN).all():
                assert isinstance(walk.path, SlidingPath)
                return walk.path
    raise AssertionError("not followed")


def end_of(lane: int, time: Any, shares: tuple[int, ...]) -> Flight:
    """A corner of a lane's box, flown for as long, in 100 bits."""
    gamma_bar, v, omega = (
        arb(float(m)) + share * arb(float(RADII[lane])) for m, share in zip(MIDDLES[:, lane], shares, strict=True)
    )
    flight = carry(model_of(SMOOTH, omega), (ball(0), gamma_bar, v), time, derivatives=True)
    assert flight.status is FlowStatus.REACHED
    return flight


def complaint(block: SlidingPath) -> str | None:
    """The first thing that is wrong with the block: it must hold the ends of corners, and their derivatives."""
    matrix = block.matrix
    with working_precision(100):
        for lane, shares in ((0, (0, 0, 0)), (1, (1, -1, 1)), (2, (-1, 1, 1)), (2, (1, 1, -1)), (3, (1, 1, 1))):
            true = end_of(lane, block.time.arb(lane), shares)
            if not all(mine.arb(lane).overlaps(part) for mine, part in zip(block.box, true.state, strict=True)):
                return "an orbit's end lies outside"
            for row, others in zip(matrix, true.matrix or (), strict=True):
                if not all(mine.arb(lane).overlaps(part) for mine, part in zip(row, others, strict=True)):
                    return "a derivative is wrong"
            if not block.divergence.arb(lane).overlaps(true.divergence):
                return "the divergence is wrong"
    return None if list(block.reversals) == [1, 1, 1, 0] and list(block.side) == [1] * 4 else "reversals are wrong"


@pytest.mark.slow
def test_orbits_through_a_reversal_are_held() -> None:
    block = followed()
    assert complaint(block) is None
    assert block.box[2].radii[0] < 1e-12  # of a point, no digits are lost: some hundred operations of 1e-16 each
    assert block.box[2].radii[2] < 1e-4


FAULTS = [
    (SlidingPath, "put", "turned * self.side", "turned * turned"),
    (SlidingPath, "_followed", "among(crossed, through.included)", "among(crossed, through.included)[::-1]"),
    (
        SmoothModel,
        "of_side",
        "every = np.zeros(np.shape(side), int)",
        "every, side = np.zeros(np.shape(side), int), -side",
    ),
    (Walk, "advance", "self.path.put(which, others.path)", "pass"),
]


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault[1])
def test_planted_faults_are_noticed(fault: Any, monkeypatch) -> None:
    """Those that `test_sliding` cannot see: of what lies side by side."""
    plant(monkeypatch, *fault)
    try:
        block = followed()
    except (AssertionError, IndexError):
        return
    assert complaint(block) is not None


def test_what_is_not_followed_ends_with_a_status() -> None:
    """A box on both sides of gamma_y = 0; no number; the wrong sign of v."""
    e_over_r = Fraction(SMOOTH.e) / Fraction(SMOOTH.r)
    # gamma_y = 0 on the section where rho v = -e Omega sin(gamma_bar): near gamma_bar = 0.1 for v = -e Omega 0.1 / rho.
    grazing = -float(e_over_r) * START[2, 0] * 0.1
    middles = np.array([[0.1, 1.7, 1.7], [grazing, np.nan, 1.7], np.repeat(START[2], 3)])
    found = half_flights(model(middles), Lanes(middles[0], [0.05, 0.0, 0.0]), Lanes(middles[1], [0.05, 0.0, 0.0]))
    assert list(found.status) == [Status.GRAZING, Status.NO_START, Status.NO_START]


@pytest.mark.slow(minutes=3)
def test_half_maps_hold_those_of_single_proofs() -> None:
    """On a cycle and beside it, narrow and wide: about as narrow as Arb's, with as many reversals."""
    middles = START + np.array([[1.0], [1.0], [1.0]]) * np.array([0.0, 0.0, 0.01, -0.02])
    radii = np.array([0.0, 1e-9, 1e-6, 1e-9])
    found = half_flights(model(middles), Lanes(middles[0], radii), Lanes(middles[1], radii))
    assert found.returned.all()
    for lane, radius in enumerate(radii):
        gamma_bar, v, omega = (float(part) for part in middles[:, lane])
        mine = lane_of(found, lane)
        with working_precision(80):
            one = model_of(SMOOTH, ball(omega))
            corner = half_flight(one, arb(gamma_bar) + arb(radius), arb(v) - arb(radius), derivatives=True)
            alone = half_flight(one, arb(gamma_bar, radius), arb(v, radius), derivatives=True)
        assert mine.reversals == corner.reversals
        for name in ("time", "beta_least", "divergence"):
            assert getattr(mine, name).overlaps(getattr(corner, name)), name
        for row, true, single in zip(
            (mine.image, *mine.matrix), (corner.image, *corner.matrix), (alone.image, *alone.matrix), strict=True
        ):
            for x, y, z in zip(row, true, single, strict=True):
                assert x.overlaps(y)
                # Doubles, and other step lengths and orders: not ten times as wide.
                assert x.rad() < 10 * z.rad() + 1e-7 * abs(z)
