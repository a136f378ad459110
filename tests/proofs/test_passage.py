"""The passage by the saddle: its cells, what is asked of N, and what is said of orbits.

Matrices are made up here, near those of the printed disk, so that one number at a time breaks one
inequality.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from fractions import Fraction
from functools import cache
from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from flint import arb, arb_mat

from tests.proofs.cases import hull, in_precision
from tests.proofs.saddle_orbits import DIRECTIONS, DISK, OMEGA_H, Orbits
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.proofs.kernel.ball_array import BallArray
from tippedisk_verify.proofs.kernel.balls import Unproved, ball, working_precision
from tippedisk_verify.proofs.kernel.saddle import (
    FAST,
    SLOW,
    UNSTABLE,
    SaddleCoordinates,
    wedge_product,
)
from tippedisk_verify.proofs.kernel.saddle_passage import SaddlePassage

U, S, F = UNSTABLE, SLOW, FAST
BITS = 64
#: the evidence with which the printed disk's passage is shown
EVIDENCE_VALUES: dict[str, Any] = {
    "extents": [0.2, 0.2, 0.3],
    "steep": [1, 0.125, 1],
    "compound": [0.5, 1],
    "flat": 0.0096,
    "lipschitz": 0.025,
    "thin": 0.125,
    "return": 10,
    "drift": [0.4, 0.1, 0.12],
}


EVIDENCE = {
    name: [arb(x) for x in part] if isinstance(part, list) else arb(part)
    for name, part in EVIDENCE_VALUES.items()
}


def column(entries: Sequence[Any]) -> Any:
    return arb_mat([[entry] for entry in entries])


ROUNDING_ALLOWANCE = arb(2) ** -40  # above the roundings of a handful of operations in 64 bits


_context = in_precision(BITS)


#: A, M, C, B and the stirred products of a made-up passage; off the diagonals of both signs
NUMBERS: dict[str, Any] = {
    "A": [[6.5, 1 / 16, -1 / 32], [-1 / 4, -8, 1 / 16], [4, -2, -100]],
    "M": [[6.5, -1 / 32, 1 / 64], [-1 / 8, -8, -1 / 32], [-2, 1, -100]],
    "C": [[-1.5, 1 / 16, 1 / 32], [-2, -93.5, 1 / 16], [-4, -1 / 4, -108]],
    "B": [1 / 32, 1 / 4, 3],
    "speed_wedge_bounds": [1 / 4, 4, 6],
}
Place = tuple[Any, ...]  # a name and indices


def made_up_passage(
    numbers: dict[Place, Any] | None = None, evidence: dict[Place, Any] | None = None
) -> SaddlePassage:
    """A passage with the ``evidence`` and the ``numbers`` put in their places, shown for its
    weights.
    """
    given: dict[str, Any] = {
        name: [*part] if isinstance(part, list) else part for name, part in EVIDENCE.items()
    }
    given["directions"] = [list(row) for row in DIRECTIONS]
    for (name, *path), x in (evidence or {}).items():
        part: Any = given
        for index in (name, *path)[:-1]:
            part = part[index]
        part[(name, *path)[-1]] = arb(x)
    found = {
        name: arb_mat(x) if isinstance(x[0], list) else [arb(part) for part in x]
        for name, x in NUMBERS.items()
    }
    for (name, *path), x in (numbers or {}).items():
        found[name][path[0] if len(path) == 1 else tuple(path)] = arb(x)
    n = object.__new__(SaddlePassage)
    saddle = SaddleCoordinates(DISK, "linear", arb(30), given["directions"])
    vars(n).update(
        found, saddle=saddle, extents=given["extents"], speed_wedge_extent=given["extents"][F] / 6
    )
    n.verify_weights(given)
    return n


# -------------------------------------------------------------------------------------------- cells
def law(a: Any, i: int, j: int) -> list[Any]:
    """How the products of x = e_i and y = e_j, of which one is 1, move if x' = A x and y' = A y."""
    x, y = (column([arb(int(k == place)) for k in range(3)]) for place in (i, j))
    moved = [(a * x).entries(), y.entries()], [x.entries(), (a * y).entries()]
    return [p + q for p, q in zip(*(wedge_product(*pair) for pair in moved), strict=True)]


@pytest.mark.parametrize(("n", "m"), [(3, 2), (2, 3)])
def test_each_cell_counts_where_it_should(n: int, m: int) -> None:
    """DF is zero but in one cell: A, C and B hold what it is there, and M the share of the ray that
    may pass it.

    On the ray to a point of N, DF at the k-th of n parts is in the cells whose inside meets (k / n)
    N. A cell meets it where in each coordinate its inner end, as a part of the extent, is less than
    k / n.
    """
    extents = [Fraction(1, 5), Fraction(1, 4), Fraction(3, 8)]
    slopes = arb_mat([[1, 2, 3], [4, 5, 6], [7, 8, 9]])
    compound = [law(slopes, *pair) for pair in ((U, S), (U, F), (S, F))]
    places = [[(Fraction(k, n), Fraction(k + 1, n)) for k in range(-n, 0)]]
    places += [
        [(Fraction(k, count), Fraction(k + 1, count)) for k in range(-count, count)]
        for count in (n, m)
    ]
    for cell in product(*places):
        middle = [float(extent * sum(ends) / 2) for extent, ends in zip(extents, cell, strict=True)]

        def marked(z: Sequence[BallArray], at: Sequence[float] = middle) -> Any:
            away = [np.abs(x.midpoints - point) <= x.radii for x, point in zip(z, at, strict=True)]
            here = np.logical_and.reduce(away) * 1.0
            if not len(z[0].radii.nonzero()[0]):  # in the middles F is asked for alone
                return (
                    [BallArray(-1 + 0 * here), BallArray(0 * here), BallArray(0 * here)],
                    None,
                    None,
                )
            rows = [[BallArray(here * float(slopes[i, k])) for k in range(3)] for i in range(3)]
            return [], rows, [BallArray(0 * here), BallArray(here), BallArray(0 * here)]

        passage = SaddlePassage(
            SimpleNamespace(rates_and_derivatives=marked), [ball(x) for x in extents], (n, m)
        )
        inner = [min(abs(low), abs(high)) for low, high in cell]
        parts = sum(max(inner) < Fraction(k, n) for k in range(1, n + 1))
        assert parts
        for row, k in product(range(3), repeat=2):
            for found, exact in (
                (passage.A, slopes[row, k]),
                (passage.M, slopes[row, k] * parts / n),
                (passage.C, compound[k][row]),
            ):
                # From 0 to what it is; the unions' radii have 30 bits, and some of them are added.
                assert found[row, k].contains(exact / 2)
                assert abs(abs(found[row, k]).upper() - abs(exact)) < arb(2) ** -16
        assert all(x >= y for x, y in zip(passage.B, (0, 1, 0), strict=True))
        near = bool(ball(inner[2]) * passage.extents[F] < passage.speed_wedge_extent)
        assert bool(passage.speed_wedge_bounds[0] >= 1) is near


# ------------------------------------------------------------------------------- what is asked of N
SPOILED_NUMBERS: list[tuple[str, dict[Place, Any]]] = [
    ("the stable directions", {("M", S, S): 1}),
    ("the stable directions", {("M", F, F): 1}),
    ("the face of z_u", {("M", U, S): 40}),
    ("the faces of z_s and z_f", {("M", S, U): 9}),
    ("the faces of z_s and z_f", {("M", F, U): 160}),
    ("the cones of the steep weights", {("A", U, S): -60}),
    ("the cones of the steep weights", {("A", S, U): -1.1}),
    ("the cones of the steep weights", {("A", F, U): 98}),
    ("the cones of the steep weights", {("B", U): 6.5}),
    ("the cones of the steep weights", {("B", S): 0.9}),
    ("the cones of the steep weights", {("B", F): 97}),
    ("the cones of the flat weights", {("M", U, F): 0.05}),
    ("the cones of the flat weights", {("M", F, S): 101}),
    ("the cones of the flat weights", {("A", U, F): 0.2}),
    ("the second compound falls", {("C", 0, 0): 0.125}),
    # b_us may fall as fast as 1.53 then, b_uf no faster than 1.25.
    (
        "the second compound falls",
        {("C", 0, 0): -1, ("C", 0, 1): 1, ("C", 1, 0): 0, ("C", 1, 1): -1.25, ("C", 1, 2): 0},
    ),
    # |b_uf| / k_1 and |b_sf| / k_2 fall at 0.5 then, and b_us may fall at 1.56.
    ("the cone of the second compound", {("C", 1, 0): 46.4375}),
    ("the cone of the second compound", {("C", 2, 0): 107.375}),
    ("the variation by the speed", {("C", 1, 0): -14}),
    ("the variation by the speed", {("C", 2, 0): 18}),
    ("the variation by the speed", {("speed_wedge_bounds", 0): 0.625}),
    ("the variation by the speed", {("speed_wedge_bounds", 1): 9}),
    ("the variation by the speed", {("speed_wedge_bounds", 2): 11.5}),
    # |z_f| / k_3 falls at 100 - 8 (11 + 1) or 100 - 8 (2 + 10) only, less than |z_s| with its 8.
    # With what the others' parts take from z_s the first is 4 - 8 - 1/8 - 1/256.
    (r"the thin set: .-4\.129", {("M", F, U): 11}),
    ("the thin set", {("M", F, S): -10}),
]


#: The fast direction divided by four: with it z_f is four times as large, and so may be k_3.
QUARTER = {("directions", 0, F): -0.0025, ("directions", 1, F): 0.0007, ("directions", 2, F): 0.25}
SPOILED_EVIDENCE: list[tuple[str, dict[Place, Any]]] = [
    # |p_f / p_s| k_3 is 1.01 with p_s = -0.123.
    ("the thin set at beta_bar = 0", {("directions", 0, F): -1}),
    ("the signs at beta_bar = 0", {("directions", 0, U): -0.15}),
    ("the signs at beta_bar = 0", {("directions", 1, U): -2}),
    ("the signs at beta_bar = 0", {("directions", 2, U): -3}),
    ("the weights of the graph", {("thin",): 1}),
    ("the weights of the graph", {**QUARTER, ("thin",): 1.05}),
    ("the weights of the graph", {**QUARTER, ("thin",): 1.5}),
    ("the weights of the graph", {("flat",): 1}),
    ("the weights of the graph", {("flat",): 2}),
    # 0.123 - 0.15 k, and 0.123 - 0.15 / 2 - 0.4 / 8
    ("beta_bar on the graph", {("flat",): 0.9}),
    ("beta_bar on the graph", {("flat",): 0.5, ("directions", 0, F): -0.4}),
    ("beta_bar and gamma after a crossing", {("return",): 0}),
    ("beta_bar and gamma after a crossing", {("return",): 200}),
]


@pytest.mark.parametrize(
    ("line", "numbers", "evidence"),
    [
        *((line, numbers, {}) for line, numbers in SPOILED_NUMBERS),
        *((f"{line}:", {}, evidence) for line, evidence in SPOILED_EVIDENCE),
    ],
)
def test_a_number_or_choice_that_is_spoiled_breaks_its_inequality(
    line: str, numbers: dict[Place, Any], evidence: dict[Place, Any]
) -> None:
    with pytest.raises(Unproved, match=rf"^7a\.\d: {line}"):
        made_up_passage(numbers, evidence)


def test_examples_are_passages() -> None:
    """Also with weights of the graph a little below one."""
    made_up_passage()
    made_up_passage(evidence={**QUARTER, ("thin",): 0.95})
    made_up_passage(evidence={("flat",): 0.5})


@pytest.mark.parametrize(
    ("row", "rate"),
    [
        ((20, 0, -12), 5),
        ((-36, 5, -12), 5),
        ((20, 5, 0), 5),
        *(((20, 5, -12), rate) for rate in (0, -1, 14)),
    ],
)
def test_what_is_asked_after_a_crossing(row: Sequence[float], rate: float) -> None:
    """v' falls with y_gamma < 0; 20 - p (p - 12) is positive from p = -1.5 to p = 13.5, and p
    is to be.
    """

    def quadrant_condition(row: Sequence[float], rate: float) -> None:
        unit = arb_mat([[int(i == j) for j in range(3)] for i in range(3)])
        rows = arb_mat([[0, 0, 1], [1, 0, 0], [arb(x) for x in row]])
        saddle = SimpleNamespace(directions=unit, inverse=unit)
        SaddlePassage._verify_quadrant(
            SimpleNamespace(saddle=saddle, M=rows, extents=[arb(0.25)] * 3), arb(rate)
        )

    quadrant_condition((20, 5, -12), 5)
    with pytest.raises(Unproved, match="beta_bar and gamma after a crossing"):
        quadrant_condition(row, rate)


def test_beta_bar_stays_small_in_n() -> None:
    """In other units, 32 times as large, beta_bar would be as large as 1.8 in N."""
    rows = DIRECTIONS
    large = {("directions", i, j): 32 * rows[i][j] for i, j in product(range(3), repeat=2)}
    with pytest.raises(Unproved, match=r"beta_bar and gamma after a crossing: \[-0\.84"):
        made_up_passage(evidence=large)


# --------------------------------------------------------------------------- what is said of orbits
def test_the_rates_in_the_steep_cone() -> None:
    """d_u' / d_u at the cone's corners: at least with a difference of speeds, and at most
    without.
    """
    n = made_up_passage()
    k_u, k_s, k_f = n.steep_weights
    rates, own = [], []
    for x, y, z in product((-1, 1), repeat=3):
        rate = n.A[U, U] + (n.A[U, S] * x * k_s + n.A[U, F] * y * k_f) / k_u
        own.append(rate)
        rates.append(rate + n.B[U] * z / k_u)
    assert abs(n.growth_rates[0] - min(rates)) < ROUNDING_ALLOWANCE
    assert abs(n.growth_rates[1] - max(own)) < ROUNDING_ALLOWANCE


def test_the_products_fall_as_is_said() -> None:
    """Exact solutions of b' = C b, from corners of boxes of which each product may be the
    smallest.
    """
    n = made_up_passage()
    k_1, k_2 = n.compound_weights
    for time in (0, 0.125, 0.5, 2, 8):
        flow = (n.C * arb(time)).exp()
        for signs in product((-1, 0.125, 1), repeat=3):
            b = [arb(sign) * k for sign, k in zip(signs, (1, k_1, k_2), strict=True)]
            moved = [sum(flow[row, k] * b[k] for k in range(3)) for row in range(3)]
            settled = n.compound_bounds(b, arb(time))
            assert all(
                abs(x) < bound + ROUNDING_ALLOWANCE
                for x, bound in zip(moved, settled, strict=False)
            )
            if signs[0] == 1:
                assert (
                    abs(moved[1]) / moved[0]
                    < n.compound_ratio_bound(arb(time)) + ROUNDING_ALLOWANCE
                )


def test_the_stable_parts_fall_as_is_said() -> None:
    """|z_s| at 8 per second to (u / 8 + t / 32) / 8, |z_f| at 100 per second to (2 u + s) / 100."""
    n = made_up_passage()
    u, s, t = n.extents
    for time in (arb(0), arb(0.125), arb(1)):
        slow, fast = n.stable_bounds(arb(0.25), arb(0.5), time)
        assert (
            abs(slow - (arb(0.25) * (-8 * time).exp() + (u / 8 + t / 32) / 8)) < ROUNDING_ALLOWANCE
        )
        assert abs(fast - (arb(0.5) * (-100 * time).exp() + (2 * u + s) / 100)) < ROUNDING_ALLOWANCE


@pytest.mark.parametrize(
    ("by_u", "by_f"), [(0.15, 0.25), (0.15, -0.25), (0.0625, 0.25), (0.0625, -0.25)]
)
def test_where_beta_bar_vanishes_in_the_thin_set(by_u: float, by_f: float) -> None:
    """Points with z_u = 1 and z_f up to 0.99 of what the set allows: z_s = r + q z_f, larger
    than 1 or smaller.
    """
    n = made_up_passage(evidence={("directions", 0, U): by_u, ("directions", 0, F): by_f})
    r, q = (-n.saddle.directions[0, k] / n.saddle.directions[0, S] for k in (U, F))
    for share in (-0.99, -0.5, 0.5, 0.99):
        fast = arb(share) * n.thin_slope
        if abs(r + q * fast) > 1:
            fast = fast * r / (1 - q * fast)  # z_f = share k_3 z_s
        slow = r + q * fast
        assert abs(fast) < n.thin_slope * abs(slow).max(arb(1))
        assert n.crossing_ratios[S].contains(slow)
        assert n.crossing_ratios[F].contains(fast)


def test_the_time_of_a_passage() -> None:
    """The graph may be as low as -k max(s, t) where the orbit leaves N; there d_u is u less
    than that.
    """
    n = made_up_passage()
    u, s, t = n.extents
    least = u - n.flat_slope * s.max(t)
    assert abs(n.min_passage_time(least)) < ROUNDING_ALLOWANCE
    assert (
        abs(n.min_passage_time(least / 2) - arb(2).log() / n.growth_rates[1]) < ROUNDING_ALLOWANCE
    )


def test_a_crossing_is_as_far_from_the_graph_as_both_ends_allow_and_where_z_s_has_fallen_to() -> (
    None
):
    """From z_u = 0, k s from the graph, which is k s from z_u = 0 at the crossing, where z_s falls
    at once.

    Soon after the start, where |z_u| has not grown yet, |z_s| / r is larger; and the moment is not
    the start.
    """
    moment = arb(2) ** -10
    falling = made_up_passage({("M", S, S): -(2.0**20), ("M", F, F): -(2.0**24)})
    assert (
        falling.crossing_bound(arb(0), arb(0), moment)
        >= 2 * falling.flat_slope * falling.extents[S]
    )
    n = made_up_passage()
    found = n.crossing_bound(arb(0), arb(0), moment)
    assert (
        found * n.crossing_ratios[S].lower()
        > n.stable_bounds(n.extents[S], arb(0), moment)[0] - ROUNDING_ALLOWANCE
    )
    for early in (0, -1):
        with pytest.raises(Unproved, match="the moment of crossing"):
            n.crossing_bound(arb(0), arb(0), arb(early))


# ------------------------------------------------------------------------------- the printed disk's
SPEEDS = (OMEGA_H - Fraction(1, 1000), OMEGA_H + Fraction(8, 1000))


@cache
def enclosed() -> SaddlePassage:
    """Of these speeds, with fewer cells than a proof takes."""
    with working_precision(BITS):
        n = SaddlePassage(
            SaddleCoordinates(DISK, "linear", hull(*SPEEDS), DIRECTIONS),
            [arb(x) for x in EVIDENCE_VALUES["extents"]],
            (48, 6),
        )
        n.verify_weights(EVIDENCE)
        return n


def test_the_enclosures_hold_points_and_rays() -> None:
    """A holds DF, B dF/d(Omega), and M a matrix with F(z) = M z; at both signs of z, though
    only one is enclosed.
    """
    rng, n = random.Random(2), enclosed()
    for _ in range(10):
        z = [arb(rng.uniform(-0.999, 0.999) * extent) for extent in EVIDENCE_VALUES["extents"]]
        omega = ball(SPEEDS[0] + (SPEEDS[1] - SPEEDS[0]) * Fraction(rng.randint(0, 100), 100))
        rates, slopes, by = SaddleCoordinates(
            DISK, "linear", omega, DIRECTIONS
        ).rates_and_derivatives(z)
        moved = [
            [sum(a * b for a, b in zip(row, x, strict=True)) for row in slopes]
            for x in ([2, -1, 3], [1, 4, -2])
        ]
        law = [
            p + q
            for p, q in zip(
                wedge_product(moved[0], [1, 4, -2]),
                wedge_product([2, -1, 3], moved[1]),
                strict=True,
            )
        ]
        for row in range(3):
            assert abs(by[row]) <= n.B[row] * (1 + arb(2) ** -40)
            assert sum((n.M[row, k] * z[k] for k in range(3)), arb(0)).overlaps(rates[row])
            assert all(n.A[row, k].overlaps(slopes[row][k]) for k in range(3))
            derivative = sum(
                n.C[row, k] * x for k, x in enumerate(wedge_product([2, -1, 3], [1, 4, -2]))
            )
            assert derivative.overlaps(law[row])
        if abs(z[F]) < n.speed_wedge_extent:
            assert all(
                abs(x) < y
                for x, y in zip(wedge_product(rates, by), n.speed_wedge_bounds, strict=True)
            )


def test_passages_obey_their_bounds() -> None:
    """Random orbits from z_s = -s, down to 1e-6 below the plane z_u = 0, which is near the
    graph.
    """
    rng, n = random.Random(3), enclosed()
    u, s, _ = EVIDENCE_VALUES["extents"]
    for _ in range(4):
        below = 10 ** rng.uniform(-6, -1.2) + float(n.flat_slope) * s
        start = (-below, -s, rng.uniform(-2e-3, 2e-3))
        orbits = Orbits(PRINTED, DIRECTIONS, float(OMEGA_H) + rng.uniform(-1e-3, 8e-3))
        variation = (-1.0, 0.0, rng.uniform(-0.2, 0.2))
        time, z, d = orbits.fly(start, variation, lambda z: -u - z[0])
        least = n.min_passage_time(arb(below) + n.flat_slope * s)
        assert least < time
        assert all(
            abs(x) < bound
            for x, bound in zip(z[1:], n.stable_bounds(arb(s), arb(0.002), least), strict=True)
        )
        first, last = (
            wedge_product(list(orbits.F(np.array(x))), list(y))
            for x, y in ((start, variation), (z, d))
        )
        bounds = n.compound_bounds(list(map(arb, first)), least)
        assert abs(last[0]) < bounds[0]
        assert abs(last[1]) < bounds[1]
        assert last[0] > 0
        assert abs(last[1]) < n.compound_ratio_bound(least) * last[0]


def test_a_large_box_and_too_many_cells_are_refused() -> None:
    """Where z_u = 3, gamma has turned by 2 rad: the linear picture is gone."""
    saddle = SaddleCoordinates(DISK, "linear", hull(*SPEEDS), DIRECTIONS)
    large = SaddlePassage(saddle, [arb(3)] * 3, (6, 6))
    with pytest.raises(Unproved):
        large.verify_weights(EVIDENCE)
    with pytest.raises(Unproved, match="too many cells"):
        SaddlePassage(saddle, [arb(0.2)] * 3, (1000, 1000))
