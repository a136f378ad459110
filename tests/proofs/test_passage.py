"""The passage by the saddle: its inequalities against orbits, and what happens to them with a constant spoiled."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from tests.proofs.saddle_orbits import OMEGA_H, Orbits
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.proofs.kernel.balls import arb, ball, hull, positive, working_precision
from tippedisk_verify.proofs.search import passage as module
from tippedisk_verify.proofs.search.local_manifolds import FAST, SLOW, UNSTABLE, Frame
from tippedisk_verify.proofs.search.passage import EXTENTS, Passage, enclosed_passage, products

SPEEDS = (OMEGA_H - Fraction(1, 1000), OMEGA_H + Fraction(8, 1000))


@pytest.fixture(scope="module")
def bits() -> Iterator[None]:
    with working_precision(64):
        yield


@pytest.fixture(scope="module")
def passage(bits: None) -> Passage:
    return enclosed_passage(Frame(PRINTED, OMEGA_H), hull(*SPEEDS))


def _random_z(rng: random.Random) -> list[Fraction]:
    return [Fraction(rng.randint(-999, 999), 1000) * extent for extent in EXTENTS]


@pytest.mark.slow
def test_the_inequalities_hold(passage: Passage) -> None:
    assert [name for name, slack in passage.slacks() if not positive(slack)] == []


def test_the_second_compound_is_the_products_law() -> None:
    """b(A x, y) + b(x, A y) = C b(x, y) for integer matrices and vectors, exactly."""
    rng = random.Random(1)
    for _ in range(20):
        a = module.arb_mat([[rng.randint(-9, 9) for _ in range(3)] for _ in range(3)])
        x, y = ([arb(rng.randint(-9, 9)) for _ in range(3)] for _ in range(2))
        image = [[sum((a[row, k] * part[k] for k in range(3)), arb(0)) for row in range(3)] for part in (x, y)]
        moved = [p + q for p, q in zip(products(image[0], y), products(x, image[1]), strict=True)]
        compound, b = module._second_compound(a), products(x, y)
        assert moved == [sum((compound[row, k] * b[k] for k in range(3)), arb(0)) for row in range(3)]


def test_the_enclosures_hold_points_and_rays(passage: Passage) -> None:
    """A holds DF, B dF/d(Omega), and M a matrix with F(z) = M z; at both signs of z, though only one is enclosed."""
    rng = random.Random(2)
    for _ in range(30):
        z = list(map(ball, _random_z(rng)))
        omega = ball(SPEEDS[0] + (SPEEDS[1] - SPEEDS[0]) * Fraction(rng.randint(0, 100), 100))
        exact, at, by = (
            f(omega, z) for f in (passage.frame.rates, passage.frame.derivative, passage.frame.derivative_by_speed)
        )
        compound = module._second_compound(at)
        for row in range(3):
            assert sum((passage.mean[row, k] * z[k] for k in range(3)), arb(0)).overlaps(exact[row])
            assert passage.by_speed[row].overlaps(by[row])
            for k in range(3):
                assert passage.spread[row, k].overlaps(at[row, k])
                assert passage.second[row, k].overlaps(compound[row, k])
        if abs(z[FAST]) < passage.stirred_within:
            for bound, part in zip(passage.stirred, products(exact, by), strict=True):
                assert abs(part) < bound


def test_the_mean_over_rays_is_no_wider_than_the_spread(passage: Passage) -> None:
    """It is the mean of unions over smaller boxes; in the corners of N half as wide at least."""
    for row in range(3):
        for k in range(3):
            assert passage.spread[row, k].contains(passage.mean[row, k])
    assert passage.mean[FAST, UNSTABLE].rad() < passage.spread[FAST, UNSTABLE].rad() / 2


def test_passages_obey_their_bounds(passage: Passage) -> None:
    """Random orbits from z_s = -s, down to 1e-6 below the plane z_u = 0, which is near the graph."""
    rng = random.Random(3)
    u, s, _ = (float(part) for part in EXTENTS)
    for _ in range(12):
        below = 10 ** rng.uniform(-6, -1.2) + float(passage.flat) * s
        start = (-below, -s, rng.uniform(-2e-3, 2e-3))
        orbits = Orbits(PRINTED, passage.frame, float(OMEGA_H) + rng.uniform(-1e-3, 8e-3))
        variation = (-1.0, 0.0, rng.uniform(-0.2, 0.2))
        # A step beyond z_u = -u: so times are too long by a step at most, and by this share of u.
        time, z, d = orbits.fly(start, variation, lambda z: z[0] < -u)
        least = passage.time(ball(Fraction(below)) + passage.flat * passage.extents[SLOW])
        assert least < time
        slow, fast = passage.fallen(passage.extents[SLOW], ball(Fraction("0.002")), least)
        assert abs(z[1]) < slow
        assert abs(z[2]) < fast
        first, last = (products(list(orbits.F(np.array(x))), list(y)) for x, y in ((start, variation), (z, d)))
        size = passage.norm([arb(part) for part in first])
        bounds = passage.settled(size, least)
        assert abs(last[0]) < bounds[0]
        assert abs(last[1]) < bounds[1]
        assert last[0] > 0
        assert abs(last[1]) < passage.ratio(least) * last[0]


def test_the_products_by_the_speed_stay_below_the_drift(passage: Passage) -> None:
    """Variations by Omega as differences of two orbits, from the same start: the error is of the order of 1e-4."""
    apart = 1e-4
    u, s, _ = (float(part) for part in EXTENTS)
    for below in (0.004, 0.02, 0.06):
        ends = []
        for shift in (-apart / 2, apart / 2):
            orbits = Orbits(PRINTED, passage.frame, float(OMEGA_H) + shift)
            time = float(passage.time(ball(Fraction(below)) + passage.flat * passage.extents[SLOW]))
            ends.append(orbits.fly((-below, -s, 0.0), (0, 0, 0), lambda z: False, time)[1])
        d = (ends[1] - ends[0]) / apart
        b = products(list(orbits.F(ends[0])), list(d))
        assert all(abs(part) < bound for part, bound in zip(b, passage.drift, strict=True))
        assert -u < ends[0][0]


def test_beta_bar_is_zero_once_and_the_signs_are_as_proved(passage: Passage) -> None:
    s = float(EXTENTS[1])
    orbits = Orbits(PRINTED, passage.frame, float(OMEGA_H))
    share, fast = passage.at_crossing()
    for below in (0.003, 0.02, 0.06):
        _, z, _ = orbits.fly((-below, -s, 0.0), (0, 0, 0), lambda z: (orbits.to_y @ z)[0] < 0)
        # beta_bar is zero within a step: z_s / z_u moves by (lambda_u - lambda_s) STEP = 0.8 % in it.
        assert abs(z[1] / z[0] / float(share.mid()) - 1) < 0.01 + float(share.rad())
        assert abs(z[2] / z[0]) < float(fast.abs_upper())
        y = orbits.to_y @ z
        assert y[1] < 0
        assert y[2] < 0


def _spoiled(passage: Passage) -> dict[str, Passage]:
    """A constant halved, doubled or turned the wrong way, and the inequality that it is to break."""
    mean, spread, second = (module.arb_mat(part) for part in (passage.mean, passage.spread, passage.second))
    spread[SLOW, SLOW] = spread[SLOW, SLOW] + 4 * abs(spread[SLOW, SLOW])
    second[0, 0] = -second[0, 0]
    mean[FAST, UNSTABLE] = 400 * mean[FAST, UNSTABLE]
    (u, s, t), (k_1, k_2) = passage.extents, passage.compound
    unequal = module.arb_mat(passage.mean)
    unequal[UNSTABLE, UNSTABLE] = arb(1) / 1000
    return {
        "the face of z_u": replace(passage, mean=unequal),
        "the face of z_s": replace(passage, extents=(u, s / 100, t)),
        "the face of z_f": replace(passage, mean=mean),
        "the cones of the steep weights": replace(passage, spread=spread),
        "the second compound falls": replace(passage, second=second),
        "the cone of the second compound": replace(passage, compound=(k_1 / 128, k_2)),
        "the variation by the speed": replace(passage, second=second),
        "the set K": replace(passage, mean=-passage.mean),
    }


@pytest.mark.parametrize(
    "name",
    ["the face of z_u", "the face of z_s", "the face of z_f", "the cones of the steep weights",
     "the second compound falls", "the cone of the second compound", "the variation by the speed", "the set K"],
)  # fmt: skip
def test_a_spoiled_constant_breaks_an_inequality(passage: Passage, name: str) -> None:
    spoiled = _spoiled(passage)[name]
    assert name in {failing for failing, slack in spoiled.slacks() if not positive(slack)}


def test_a_thin_set_that_is_not_thin_breaks_its_inequality(passage: Passage, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where |q| k_3 >= 1 for z_s = r z_u + q z_f, the last term of z_s may be as large as z_s itself."""
    p, name = passage.frame.directions, "the thin set at beta_bar = 0"
    size = abs(p[0, FAST] / p[0, SLOW])
    for share, holds in (("0.99", True), ("1.01", False), ("3", False)):
        monkeypatch.setattr(Passage, "thin", ball(share) / size)
        assert all(positive(slack) for found, slack in passage.signs() if found == name) is holds


def test_a_large_box_is_not_proved(bits: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where z_u = 3, gamma has turned by 2 rad: the linear picture is gone."""
    monkeypatch.setattr(module, "_CELLS", 6)
    wide = enclosed_passage(Frame(PRINTED, OMEGA_H), hull(*SPEEDS), (Fraction(3), Fraction(3), Fraction(3)))
    assert any(not positive(slack) for _, slack in wide.slacks())
