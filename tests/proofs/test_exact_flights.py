"""Exact answers for boxes without width: remainders, the length of steps, and the frames' inverse, in lanes and in Arb.

Each test is followed by the faults that it is to notice (none of them is noticed by a comparison of wide boxes).
"""

from __future__ import annotations

import random
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
import pytest

from tests.proofs.cases import plant
from tippedisk_verify.model.parameters import PRINTED, Constants
from tippedisk_verify.proofs.kernel import frame
from tippedisk_verify.proofs.kernel.balls import arb, ball, ball_constants, working_precision
from tippedisk_verify.proofs.kernel.flow import Model, Path
from tippedisk_verify.proofs.kernel.frame import Frame
from tippedisk_verify.proofs.kernel.lanes import Lanes
from tippedisk_verify.proofs.kernel.step import Trial
from tippedisk_verify.proofs.numbers import measured
from tippedisk_verify.proofs.search.lane_flight import LaneSteps, half_flights
from tippedisk_verify.proofs.search.steps import Steps, axes_of_balls, axes_of_lanes

COUNT = 3


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


def oscillators_are_held() -> bool:
    """Small orbits: what the midpoint's series leaves out is far larger than what is rounded."""
    sizes, speeds = [2.0**-20, 2.0**-14, 2.0**-24], [2.0, 8.0, 1.0]
    found = half_flights(
        Model(constants(), Lanes(speeds), oscillator), Lanes([0.0] * COUNT), Lanes([-size for size in sizes])
    )
    assert found.returned.all()
    assert (found.time.radii < 1e-8).all()  # or it says nothing
    with working_precision(200):
        quarter = arb.pi() / 2
        return all(
            holds(part, truth, lane)
            for lane, (size, speed) in enumerate(zip(map(Fraction, sizes), map(Fraction, speeds), strict=True))
            for part, truth in (
                (found.time, quarter),
                (found.beta_least, -size / 2),
                (found.image[0], speed * size / 2),
                (found.image[1], -size),
            )
        )


def test_remainders_of_the_middle_are_held() -> None:
    assert oscillators_are_held()


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("[[*c, alike(c[0], r)] for c, r in zip(self.thin, fine, strict=True)]",
         "[list(c) for c in self.thin]"),
        ("[[*c, alike(c[0], r)] for c, r in zip(self.thin, fine, strict=True)]",
         "[[*c, 0 * r] for c, r in zip(self.thin, fine, strict=True)]"),
        ("[[*c, alike(c[0], r)] for c, r in zip(self.thin, fine, strict=True)]",
         "[[*c, r.mid() * 0.5] for c, r in zip(self.thin, fine, strict=True)]"),
    ],
)  # fmt: skip
def test_a_remainder_that_is_dropped_is_noticed(old, new, monkeypatch) -> None:
    plant(monkeypatch, Trial, "_step", old, new)
    assert not oscillators_are_held()


def falling_late(ops: Any, constants: Any, omega: Any) -> Any:
    """From 0: v = t, beta = t^2 / 2, gamma = t^4 / 4. A step's enclosure is the range over it and a 512th of that.

    So gamma leaves it 0.05 % after the step.
    """
    return lambda beta, gamma, v: (v, v * v * v, 1 + 0 * v)


def exactly(time: Fraction) -> tuple[Fraction, ...]:
    return time**2 / 2, time**4 / 4, time


def lanes_steps_are_as_long_as_proved() -> bool:
    zero = Lanes([0.0] * COUNT)
    search = LaneSteps(COUNT)
    search.cuts = np.array([0.75, 0.5, 0.3])
    block = Path(Model(constants(), Lanes([1.0] * COUNT), falling_late), (zero, zero, zero), search)
    step = search.step(block)
    assert step.included.all()
    assert not step.length.radii.any()
    block.take(step, where=step.included)
    return all(
        holds(block.time, length, lane)
        and all(holds(part, truth, lane) for part, truth in zip(block.box, exactly(length), strict=True))
        and all(
            holds(room, truth, lane)
            for share in (0, Fraction(1, 2), 1)
            for room, truth in zip(step.enclosure, exactly(share * length), strict=True)
        )
        for lane, length in enumerate(map(Fraction, map(float, step.length.midpoints)))
    )


def steps_are_as_long_as_proved() -> bool:
    with working_precision(60):
        path = Path(Model(ball_constants(PRINTED), ball(1), falling_late), [0, 0, 0], Steps())
        step = path.step(0.75)
        assert step is not None
        path.take(step)
        length = Fraction(step.length)
        return (
            holds(path.time, length)
            and all(holds(part, truth) for part, truth in zip(path.box, exactly(length), strict=True))
            and all(holds(room, truth) for room, truth in zip(step.enclosure, exactly(length), strict=True))
        )


def test_steps_are_as_long_as_proved() -> None:
    assert lanes_steps_are_as_long_as_proved()
    assert steps_are_as_long_as_proved()


@pytest.mark.parametrize(
    ("owner", "function", "old", "new"),
    [
        (
            Trial,
            "_step",
            "self.path.time,\n        length,",
            "self.path.time,\n        type(length)(length.midpoints * 1.001),",
        ),
        (Trial, "_test", "whole(length))", "whole(length / 1.001))"),
        (Path, "take", "step.length) if time is None", "step.length * 1.001) if time is None"),
    ],
)
def test_a_step_in_lanes_that_is_too_long_is_noticed(owner, function, old, new, monkeypatch) -> None:
    plant(monkeypatch, owner, function, old, new)
    assert not lanes_steps_are_as_long_as_proved()


@pytest.mark.parametrize(
    ("owner", "function", "old", "new"),
    [
        (Trial, "_test", "whole(length))", "whole(length / 1.001))"),
        (Path, "take", "frame = self.carried(step, time)",
         "frame = self.carried(step, ball(step.length * 1.001) if time is None else time)"),
        (Path, "take", "alike(self.time, step.length) if", "ball(1.001 * step.length) if"),
    ],
)  # fmt: skip
def test_a_step_that_is_too_long_is_noticed(owner, function, old, new, monkeypatch) -> None:
    plant(monkeypatch, owner, function, old, new)
    assert not steps_are_as_long_as_proved()


def _with(axes: Any, stiffness: Any, turned: Any, sizes: Any) -> Any:
    return axes(turned, sizes, stiffness)


def frames_hold_what_is_left_over() -> bool:
    """A point is turned, and its image is known up to a ball along one coordinate: both its ends are in the frame.

    With orthogonal axes A the box about what is left reaches sum_k |A_ik| |A_ik| = 1 along coordinate i; of the
    transposed inverse it would be sum_k |A_ik| |A_ki|, which is less.
    """
    rng, count = random.Random(11), 40
    held = True
    for coordinate in range(3):
        mid = np.array([[[rng.uniform(-1, 1) for _ in range(count)] for _ in range(3)] for _ in range(3)])
        still = Frame([Lanes(np.zeros(count))] * 3, Lanes(np.zeros(count)))
        rows = [[*(Lanes(entry) for entry in row), Lanes(np.zeros(count))] for row in mid]
        centre = [Lanes(np.zeros(count), float(k == coordinate)) for k in range(3)]
        for stiffness in (np.ones(count), np.full(count, 30.0)):
            found = still.carried(centre, rows, partial(_with, axes_of_lanes, stiffness))
            held &= all(holds(found.box()[coordinate], Fraction(end), lane) for lane in range(count) for end in (-1, 1))
        with working_precision(80):
            still = Frame([ball(0)] * 3, ball(0))
            for lane in range(count):
                points = [[*(arb(float(entry)) for entry in row), arb(0)] for row in mid[:, :, lane]]
                box = still.carried(
                    [arb(0, int(k == coordinate)) for k in range(3)], points, partial(_with, axes_of_balls, 1.0)
                ).box()
                held &= all(holds(box[coordinate], Fraction(end)) for end in (-1, 1))
    return held


def inverses_are_inverses() -> bool:
    """Of matrices of small integers: each ball holds the entry of the inverse, and is narrow."""
    rng, held = random.Random(12), True
    for _ in range(30):
        rows = [[rng.randint(-9, 9) for _ in range(3)] for _ in range(3)]
        (a, b, c), (d, e, f), (g, h, i) = rows
        determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
        if not determinant:
            continue
        adjugate = (
            (e * i - f * h, c * h - b * i, b * f - c * e),
            (f * g - d * i, a * i - c * g, c * d - a * f),
            (d * h - e * g, b * g - a * h, a * e - b * d),
        )
        for kind in (lambda x: Lanes([float(x)]), arb):
            inverse = frame._inverse([[kind(x) for x in row] for row in rows])
            for row, exact in zip(inverse, adjugate, strict=True):
                held &= all(holds(x, Fraction(y, determinant)) for x, y in zip(row, exact, strict=True))
                held &= all(float(upper_radius(x)) < 1e-9 for x in row)
    return held


def upper_radius(x: Any) -> Any:
    return x.radii[0] if isinstance(x, Lanes) else x.rad()


def test_frames_hold_what_is_left_over() -> None:
    assert frames_hold_what_is_left_over()
    assert inverses_are_inverses()


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("minors[k][row] / determinant", "minors[row][k] / determinant"),
        ("(a, b, c), cross = axes, _cross", "(a, b, c), cross = tuple(zip(*axes)), _cross"),
        ("cross(c, a), cross(a, b)", "cross(a, b), cross(c, a)"),
    ],
)
def test_a_transposed_inverse_is_noticed(old, new, monkeypatch) -> None:
    plant(monkeypatch, frame, "_inverse", old, new)
    assert not frames_hold_what_is_left_over()
    assert not inverses_are_inverses()
