"""Half maps side by side: their balls hold exact images, whatever lies beside a lane."""

from __future__ import annotations

import random
from fractions import Fraction
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pytest
from flint import fmpq_mat

from tests.proofs.cases import half_flight
from tippedisk_verify.cycles.return_map import ReturnMap
from tippedisk_verify.cycles.section import LIBRATING
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.parameters import PRINTED, Constants
from tippedisk_verify.model.precision import bits
from tippedisk_verify.proofs.kernel import frame
from tippedisk_verify.proofs.kernel.balls import arb, ball, ball_constants, working_precision
from tippedisk_verify.proofs.kernel.flow import Model, Path
from tippedisk_verify.proofs.kernel.frame import Frame
from tippedisk_verify.proofs.kernel.lane_middle import SharpModel
from tippedisk_verify.proofs.kernel.lanes import Lanes
from tippedisk_verify.proofs.kernel.section import Return, Status
from tippedisk_verify.proofs.numbers import measured
from tippedisk_verify.proofs.search import lane_flight
from tippedisk_verify.proofs.search.lane_flight import HalfFlights, LaneSteps, half_flights, lane_of
from tippedisk_verify.proofs.search.steps import Steps, axes_of_balls, axes_of_lanes

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
    """The half map of one point of a lane's box, in 80 bits."""
    with working_precision(80):
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


def some_point(rng: random.Random) -> tuple[Any, ...]:
    return tuple(rng.choice((-1, 1, rng.uniform(-1, 1))) for _ in CYCLE)


def test_the_lanes_hold_exact_half_maps_of_corners() -> None:
    """Two boxes, at speeds of their own."""
    mid = np.array([[part + 0.02 * k for k in range(2)] for part in CYCLE])
    mid[2] = CYCLE[2] + 0.01 * np.array([0, 3])
    boxes = Boxes(mid, np.array([[1e-5, 3e-6]] * 3))
    found = boxes.fly()
    assert found.returned.all()
    for lane, shares in ((0, (-1, 1, 1)), (1, (-1, -1, 1))):
        assert_holds(found, lane, exact(boxes, lane, shares))


@pytest.mark.slow(minutes=2)
def test_hundreds_of_boxes_hold_their_points(taylor: Taylor) -> None:
    """A point of each by heyoka in 200 bits, and of every fortieth one by Arb in 80 bits, with derivatives."""
    boxes, rng, precision = random_boxes(3, 400), random.Random(5), bits(200)
    found = boxes.fly()
    assert found.returned.mean() > 0.9
    for lane in np.flatnonzero(found.returned):
        shares = some_point(rng)
        rows = zip(boxes.mid[:, lane], boxes.rad[:, lane], shares, strict=True)
        gamma_bar, v, omega = (Fraction(m) + Fraction(r) * Fraction(share) for m, r, share in rows)
        return_map = ReturnMap(LIBRATING, PRINTED, omega, taylor, precision)
        true = return_map.flight((precision.number(gamma_bar), precision.number(v)))
        mine = lane_of(found, int(lane))
        for ball_, number in zip((mine.time, *mine.image), (true.time, -true.state[1], -true.state[2]), strict=True):
            held = measured(ball_)
            # Over half a period 200 bits lose ten digits at most, of sixty.
            assert abs(Fraction(str(number)) - held.value) <= held.uncertainty + Fraction(1, 10**50), lane
        if not lane % 40:
            assert_holds(found, int(lane), exact(boxes, int(lane), shares))


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


# -------------------------------------------------------------------------------- exact answers for boxes without width
COUNT = 3
SIZES, SPEEDS = [2.0**-20, 2.0**-14, 2.0**-24], [2.0, 8.0, 1.0]


def constants() -> Constants:
    return Constants(*(Lanes.of([value]) for value in ball_constants(PRINTED)))


def holds(x: Any, truth: Any, lane: int = 0) -> bool:
    """Whether a ball, or a lane's, holds a point that is known to 200 bits (or a rational)."""
    if isinstance(x, Lanes):
        if not x.is_finite()[lane]:
            return False
        mid, rad = Fraction(float(x.midpoints[lane])), Fraction(float(x.radii[lane]))
    else:
        mid, rad = measured(x).value, measured(x).uncertainty
    point = truth if isinstance(truth, Fraction) else measured(truth).value
    slack = 0 if isinstance(truth, Fraction) else measured(truth).uncertainty
    return abs(point - mid) <= rad + slack


def oscillator(ops: Any, constants: Any, omega: Any) -> Any:
    """beta = -(a/2) sin(2 t), v = -a cos(2 t), gamma' = Omega beta: back on the section after pi/2 seconds."""
    return lambda beta, gamma, v: (v, omega * beta, -4 * beta)


def oscillators_return(found: Any, middle: Any, end: Any) -> None:
    """``middle`` holds the numbers of the orbits from v = -size, and ``found`` those of one from a box about it."""
    assert found.returned.all()
    with working_precision(200):
        quarter = arb.pi() / 2
        for lane, (size, speed) in enumerate(zip(SIZES, map(Fraction, SPEEDS), strict=True)):
            size = Fraction(size)
            for part, truth in (
                (middle.time, quarter),
                (found.time, quarter),
                (middle.beta_least, -size / 2),
                (middle.image[0], speed * size / 2),
                (middle.image[1], -size),
                (found.image[1], -size * end),
            ):
                assert holds(part, truth, lane)


def test_remainders_of_the_middle_are_held() -> None:
    """Small orbits: what the midpoint's series leaves out is far larger than what is rounded."""
    found = half_flights(Model(constants(), Lanes(SPEEDS), oscillator), Lanes([0.0] * COUNT), Lanes(-np.array(SIZES)))
    oscillators_return(found, found, 1)
    assert (found.time.radii < 1e-8).all()  # or it says nothing


@pytest.mark.parametrize("short", [False, True])
def test_middles_are_held_and_known_far_better_than_boxes(short: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """With short series too, of which the remainders are larger than what is rounded."""
    if short:
        monkeypatch.setattr(lane_flight, "_SHARP_ORDERS", (8, 8))
        monkeypatch.setattr(lane_flight, "_SHARP", 2.0**-30)
    sizes = np.array(SIZES)
    with working_precision(96):
        model = SharpModel(ball_constants(PRINTED), [*map(ball, SPEEDS)], oscillator)
        found = half_flights(model, Lanes([0.0] * COUNT), Lanes(-sizes, sizes * 2.0**-16))
    oscillators_return(found, found.middle, 1 + Fraction(1, 2**17))
    assert (found.image[1].radii > 2.0**-17 * sizes).all()
    if not short:
        assert (found.middle.time.radii < 2.0**-50).all()
        assert (found.middle.image[1].radii < 2.0**-48 * sizes).all()  # of a few roundings


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


def falling_late(ops: Any, constants: Any, omega: Any) -> Any:
    """From 0: v = t, beta = t^2 / 2, gamma = t^4 / 4. A step's enclosure is the range over it and a 512th of that.

    So gamma leaves it 0.05 % after the step.
    """
    return lambda beta, gamma, v: (v, v * v * v, 1 + 0 * v)


def exactly(time: Fraction) -> tuple[Fraction, ...]:
    return time**2 / 2, time**4 / 4, time


def test_steps_are_as_long_as_proved() -> None:
    with working_precision(60):
        path = Path(Model(ball_constants(PRINTED), ball(1), falling_late), [0, 0, 0], Steps())
        step = path.step(0.75)
        assert step is not None
        path.take(step)
        length = Fraction(step.length)
        assert holds(path.time, length)
        for held in (path.box, step.enclosure):
            assert all(holds(*pair) for pair in zip(held, exactly(length), strict=True))


def _with(axes: Any, stiffness: Any, turned: Any, sizes: Any) -> Any:
    return axes(turned, sizes, stiffness)


def test_frames_hold_what_is_left_over() -> None:
    """A point is turned, and its image is known up to a ball along one coordinate: both its ends are in the frame.

    With orthogonal axes A the box about what is left reaches sum_k |A_ik| |A_ik| = 1 along coordinate i; of the
    transposed inverse it would be sum_k |A_ik| |A_ki|, which is less.
    """
    rng, count = random.Random(11), 40
    for coordinate in range(3):
        mid = np.array([[[rng.uniform(-1, 1) for _ in range(count)] for _ in range(3)] for _ in range(3)])
        still = Frame([Lanes(np.zeros(count))] * 3, Lanes(np.zeros(count)))
        rows = [[*(Lanes(entry) for entry in row), Lanes(np.zeros(count))] for row in mid]
        centre = [Lanes(np.zeros(count), float(k == coordinate)) for k in range(3)]
        for stiffness in (np.ones(count), np.full(count, 30.0)):
            box = still.carried(centre, rows, partial(_with, axes_of_lanes, stiffness)).box()
            assert all(holds(box[coordinate], Fraction(end), lane) for lane in range(count) for end in (-1, 1))
        with working_precision(80):
            centre = [arb(0, int(k == coordinate)) for k in range(3)]
            for lane in range(count):
                points = [[*(arb(float(entry)) for entry in row), arb(0)] for row in mid[:, :, lane]]
                box = Frame([ball(0)] * 3, ball(0)).carried(centre, points, partial(_with, axes_of_balls, 1.0)).box()
                assert all(holds(box[coordinate], Fraction(end)) for end in (-1, 1))


def test_inverses_hold_those_of_rationals() -> None:
    """Of matrices of small integers; and they are narrow."""
    rng = random.Random(12)
    for _ in range(30):
        rows = [[rng.randint(-9, 9) for _ in range(3)] for _ in range(3)]
        if not fmpq_mat(rows).det():
            continue
        exact = fmpq_mat(rows).inv().tolist()
        for kind in (lambda x: Lanes([float(x)]), arb):
            inverse = frame._inverse([[kind(x) for x in row] for row in rows])
            for mine, true in zip(inverse, exact, strict=True):
                assert all(holds(x, Fraction(int(y.p), int(y.q))) for x, y in zip(mine, true, strict=True))
                assert all(float(upper_radius(x)) < 1e-9 for x in mine)


def upper_radius(x: Any) -> Any:
    return x.radii[0] if isinstance(x, Lanes) else x.rad()
