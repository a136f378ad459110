"""Half maps side by side: their balls hold exact images, whatever lies beside a lane, and planted faults show."""

from __future__ import annotations

import random
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
import pytest

from tests.proofs.cases import half_flight, plant
from tippedisk_verify.cycles.return_map import ReturnMap
from tippedisk_verify.cycles.section import LIBRATING
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.parameters import PRINTED, Constants
from tippedisk_verify.model.precision import bits
from tippedisk_verify.proofs.kernel import batch, flow, frame, section
from tippedisk_verify.proofs.kernel.balls import arb, ball, ball_constants, working_precision
from tippedisk_verify.proofs.kernel.flow import Model, Path
from tippedisk_verify.proofs.kernel.frame import Frame
from tippedisk_verify.proofs.kernel.lanes import Lanes
from tippedisk_verify.proofs.kernel.section import Return, Status, Walk
from tippedisk_verify.proofs.numbers import measured
from tippedisk_verify.proofs.search import lane_flight
from tippedisk_verify.proofs.search.lane_flight import HalfFlights, half_flights, lane_of
from tippedisk_verify.proofs.search.steps import axes_of_lanes

CYCLE = (1.7162868, -1.7100022, 30.3865927)  # gamma_bar, v and Omega of a cycle half a rad/s below Omega_crit


class Boxes(NamedTuple):
    """Midpoints and radii (3, n) of (gamma_bar, v, Omega)."""

    mid: np.ndarray
    rad: np.ndarray

    def fly(self, which=slice(None)) -> HalfFlights:
        constants = Constants(*(Lanes.of([value]) for value in ball_constants(PRINTED)))
        gamma_bar, v, omega = (Lanes(*pair) for pair in zip(self.mid[:, which], self.rad[:, which], strict=True))
        return lane_flight.half_flights(Model(constants, omega), gamma_bar, v)


def random_boxes(seed: int, count: int) -> Boxes:
    """About the cycle, near and far, narrow and wide."""
    rng = random.Random(seed)
    mid = [[part + rng.uniform(-0.1, 0.1) * rng.choice((0, 1)) for _ in range(count)] for part in CYCLE]
    rad = [[rng.choice((0.0, 1e-13, 1e-9, 1e-6, 2e-5)) for _ in range(count)] for _ in CYCLE]
    return Boxes(np.array(mid), np.array(rad))


def exact(boxes: Boxes, lane: int, shares: tuple[Any, ...]) -> Return:
    """The half map of one point of a lane's box, in 120 bits."""
    with working_precision(120):
        parts = [
            arb(float(m)) + arb(float(r)) * ball(Fraction(share))
            for m, r, share in zip(boxes.mid[:, lane], boxes.rad[:, lane], shares, strict=True)
        ]
        gamma_bar, v, omega = parts
        return half_flight(Model(ball_constants(PRINTED), omega), gamma_bar, v, derivatives=True)


def entries(flight: Any) -> list[Any]:
    return [
        flight.time, *flight.image, flight.beta_least, *flight.turn_by_start, *flight.matrix[0], *flight.matrix[1],
        *flight.by_omega, *flight.time_by_state, flight.time_by_omega, flight.divergence,
    ]  # fmt: skip


def assert_holds(found: HalfFlights, lane: int, image: Return) -> None:
    for mine, true in zip(entries(lane_of(found, lane)), entries(image), strict=True):
        assert true.rad() < 1e-15
        assert mine.overlaps(true), (lane, mine, true)


def attacked(found: HalfFlights, boxes: Boxes, lanes: range, tries: int, seed: int) -> None:
    """Corners and other points of the boxes; nine in ten must have returned."""
    assert found.returned.mean() > 0.9
    rng = random.Random(seed)
    for lane in lanes:
        for _ in range(tries):
            if found.returned[lane]:
                assert_holds(found, lane, exact(boxes, lane, some_point(rng)))


def some_point(rng: random.Random) -> tuple[Any, ...]:
    return tuple(rng.choice((-1, 1, rng.uniform(-1, 1))) for _ in CYCLE)


@pytest.mark.slow(minutes=0.4)
def test_the_lanes_hold_exact_half_maps() -> None:
    boxes = random_boxes(1, 3)
    attacked(boxes.fly(), boxes, range(3), 1, 2)


@pytest.mark.slow(minutes=30)
def test_ten_thousand_boxes_hold_their_points(taylor: Taylor) -> None:
    """A point of each by heyoka in 200 bits, and of every fortieth one by Arb in 120 bits, with derivatives."""
    boxes, rng, precision = random_boxes(3, 10_000), random.Random(5), bits(200)
    found = boxes.fly()
    for lane in np.flatnonzero(found.returned):
        rows = zip(boxes.mid[:, lane], boxes.rad[:, lane], some_point(rng), strict=True)
        gamma_bar, v, omega = (Fraction(m) + Fraction(r) * Fraction(share) for m, r, share in rows)
        return_map = ReturnMap(LIBRATING, PRINTED, omega, taylor, precision)
        true = return_map.flight((precision.number(gamma_bar), precision.number(v)))
        mine = lane_of(found, int(lane))
        for ball_, number in zip((mine.time, *mine.image), (true.time, -true.state[1], -true.state[2]), strict=True):
            held = measured(ball_)
            # Over half a period 200 bits lose ten digits at most, of sixty.
            assert abs(Fraction(str(number)) - held.value) <= held.uncertainty + Fraction(1, 10**50), lane
    attacked(found, boxes, range(0, 10_000, 40), 1, 4)


@pytest.mark.slow(minutes=1)
def test_lanes_do_not_depend_on_their_neighbours(monkeypatch) -> None:
    """Alone, in another order or in small blocks: each enclosure holds, so they overlap; about as narrow as Arb's."""
    boxes = random_boxes(5, 3)
    order = [2, 0, 1]
    whole, turned = boxes.fly(), boxes.fly(order)
    monkeypatch.setattr(lane_flight, "_BLOCK", 2)
    parts = boxes.fly()
    with working_precision(53):
        for place, lane in enumerate(order):
            gamma_bar, v, omega = (
                arb(float(m), float(r)) for m, r in zip(boxes.mid[:, lane], boxes.rad[:, lane], strict=True)
            )
            alone = half_flight(Model(ball_constants(PRINTED), omega), gamma_bar, v, derivatives=True)
            others = [lane_of(whole, lane), lane_of(turned, place), lane_of(parts, lane)]
            assert {flight.status for flight in others} == {alone.status}
            for group in zip(*(entries(flight) for flight in (alone, *others)), strict=True):
                assert all(x.overlaps(y) for x in group for y in group)
                # Other step lengths and orders, and remainders up to a sixteenth of a radius: not ten times as wide.
                assert all(x.rad() < 10 * group[0].rad() + 1e-7 * abs(group[0]) for x in group)


@pytest.mark.slow(minutes=1)
def test_what_is_no_number_or_not_followed_ends_with_a_status() -> None:
    inf, nan, tiny = np.inf, np.nan, 5e-324
    gamma_bar = Lanes([1.7, nan, 1.7, 1.7, tiny, 1.7, 1.7], [0.0, 0.0, inf, 0.5, tiny, 0.0, 0.0])
    v = Lanes([-1.7, -1.7, -1.7, -1.7, -tiny, 1.7, -1e300], [0.0] * 7)
    omega = Lanes([30.4, 30.4, 30.4, 30.4, 30.4, 30.4, 30.4])
    constants = Constants(*(Lanes.of([value]) for value in ball_constants(PRINTED)))
    found = half_flights(Model(constants, omega), gamma_bar, v)
    assert list(found.status[:6]) == [
        Status.RETURNED, Status.NO_ENCLOSURE, Status.NO_ENCLOSURE, Status.TOO_WIDE, Status.NO_START, Status.NO_START,
    ]  # fmt: skip
    assert found.status[6] in (Status.NO_ENCLOSURE, Status.TOO_WIDE)
    for entry in entries(found):
        assert list(entry.is_finite()) == list(found.returned)
    strange = half_flights(Model(constants, Lanes([nan, inf, 0.0])), Lanes([1.7] * 3), Lanes([-1.7] * 3))
    assert not strange.returned[:2].any()
    ended = half_flights(Model(constants, Lanes([30.4])), Lanes([1.7]), Lanes([-1.7]), longest=0.05)
    assert list(ended.status) == [Status.NO_RETURN]


# ---------------------------------------------------------------------------------------------------- planted faults
class Fault(NamedTuple):
    name: str
    owner: Any
    function: str
    old: str
    new: str


FAULTS = [
    Fault("what the start deviates is forgotten", Frame, "carried", "image = copy(self)",
          "image = copy(self)\n    image.deviation = [0 * part for part in self.deviation]"),
    Fault("what fails moves, the rest stays", Path, "take", "chosen(where, after, before)",
          "chosen(where if where is True else ~where, after, before)"),
    Fault("what fails moves as well", Path, "take", "chosen(where, after, before)", "chosen(True, after, before)"),
    Fault("results are in the order of landing", lane_flight, "half_flights", "lanes[tried.arrived]",
          "np.arange(tried.arrived.sum())"),
    Fault("another speed", batch, "some_model", "model.omega[which]",
          "model.omega[0 * np.arange(len(model.omega))[which]]"),
    Fault("speeds are points", batch, "some_model", "model.omega[which]", "model.omega[which].mid()"),
    Fault("the crossing is a point in time", Walk, "_land", "some(moment, sure))", "some(moment, sure).mid())"),
    Fault("the lowest point is a point", Walk, "_turn", "part.component(0, moment)", "part.component(0, moment).mid()"),
]  # fmt: skip


@pytest.fixture(scope="module")
def corners() -> tuple[Boxes, list[tuple[int, Return]]]:
    """Boxes whose corners reach far, and the corners' half maps."""
    mid = np.array([[part + 0.02 * k for k in range(4)] for part in CYCLE])
    mid[2] = CYCLE[2] + 0.01 * np.array([0, 3, 1, 2])
    boxes = Boxes(mid, np.array([[1e-5, 1e-9, 3e-6, 1e-6]] * 3))
    shares = [(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]
    return boxes, [(lane, exact(boxes, lane, share)) for lane in range(4) for share in shares]


def noticed(boxes: Boxes, images: list[tuple[int, Return]]) -> bool:
    try:
        found = boxes.fly()
        assert found.returned.all()
        for lane, image in images:
            assert_holds(found, lane, image)
    except AssertionError:
        return True
    return False


def carried_twice() -> bool:
    """Whether frames in lanes hold the images of points under two linear maps, each any one of a ball of matrices."""
    rng, count = random.Random(7), 200
    start, omega = [Lanes(np.zeros(count), 1.0) for _ in range(3)], Lanes(np.zeros(count), 1.0)
    point = np.array([[rng.choice((-1.0, 1.0)) for _ in range(count)] for _ in range(4)])
    found, state = Frame(start, omega), point[:3]
    for spread in (1.0, 1e-9):  # what the first leaves over, the second turns
        mid = np.array([[[rng.uniform(-1, 1) for _ in range(count)] for _ in range(4)] for _ in range(3)])
        push = np.sign(state)[None] * np.ones((3, 1, 1)) * spread
        rows = [[Lanes(mid[i, j], spread) for j in range(3)] + [Lanes(mid[i, 3])] for i in range(3)]
        axes = lambda turned, sizes: axes_of_lanes(turned, sizes, np.ones(count))  # noqa: E731
        found = found.carried([Lanes(np.zeros(count))] * 3, rows, axes)
        state = np.einsum("ijn,jn->in", mid[:, :3] + push, state) + mid[:, 3] * point[3]
    # In doubles a few ulps of numbers below 100.
    return all((np.abs(s - b.midpoints) <= b.radii + 1e-13).all() for s, b in zip(state, found.box(), strict=True))


@pytest.mark.parametrize(
    ("owner", "function", "old", "new"),
    [
        (Frame, "carried", "a + b + c for", "a + b for"),
        (Frame, "carried", "a + b + c for", "a + c for"),
        (frame, "_inverse", "minors[k][row] / determinant", "minors[k][row] / (9 * determinant)"),
    ],
)
def test_a_frame_that_forgets_is_noticed(owner, function, old, new, monkeypatch) -> None:
    assert carried_twice()
    plant(monkeypatch, owner, function, old, new)
    assert not carried_twice()


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_every_fault_is_noticed(fault, corners, monkeypatch) -> None:
    plant(monkeypatch, *fault[1:])
    if fault.owner is batch:
        for module in (flow, lane_flight, section):
            monkeypatch.setattr(module, fault.function, getattr(batch, fault.function))
    assert noticed(*corners)


@pytest.mark.slow
def test_the_text_as_it_is_passes(corners) -> None:
    assert not noticed(*corners)
