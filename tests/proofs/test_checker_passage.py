"""The checker's passage by the saddle: its cells, what it asks of N, and what it says of orbits.

Matrices are made up here, near those of the printed disk, so that one number at a time breaks one inequality.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from itertools import product
from types import SimpleNamespace
from typing import Any

import pytest
from flint import arb, arb_mat

from tests.proofs.end_entries import BITS, by_hand, read
from tippedisk_verify.proofs import checker
from tippedisk_verify.proofs.checker.passage import F, Passage, S, U, products
from tippedisk_verify.proofs.checker.steps import column
from tippedisk_verify.proofs.kernel.balls import working_precision

HAIR = arb(2) ** -40  # above the roundings of a handful of operations in 64 bits


@pytest.fixture(autouse=True)
def _context() -> Iterator[None]:
    with working_precision(BITS):
        yield


#: A, M, C, B and the stirred products of a made-up passage; off the diagonals of both signs
NUMBERS: dict[str, Any] = {
    "A": [[6.5, 1 / 16, -1 / 32], [-1 / 4, -8, 1 / 16], [4, -2, -100]],
    "M": [[6.5, -1 / 32, 1 / 64], [-1 / 8, -8, -1 / 32], [-2, 1, -100]],
    "C": [[-1.5, 1 / 16, 1 / 32], [-2, -93.5, 1 / 16], [-4, -1 / 4, -108]],
    "B": [1 / 32, 1 / 4, 3],
    "stirred": [1 / 4, 4, 6],
}
Place = tuple[Any, ...]  # a name and indices


def made_up(numbers: dict[Place, Any] | None = None, choices: dict[Place, Any] | None = None) -> Passage:
    """A passage with the entry's ``choices`` (decimals or floats) and the ``numbers`` put in their places."""
    given = read(by_hand())
    for (name, *path), x in (choices or {}).items():
        if path:
            rows = [list(row) if isinstance(row, list) else row for row in given[name]]
            part = rows
            for index in path[:-1]:
                part = part[index]
            part[path[-1]] = arb(x)
            given[name] = rows
        else:
            given[name] = arb(x)
    found = {name: arb_mat(x) if isinstance(x[0], list) else [arb(part) for part in x] for name, x in NUMBERS.items()}
    for (name, *path), x in (numbers or {}).items():
        found[name][path[0] if len(path) == 1 else tuple(path)] = arb(x)

    class Known(Passage):
        def _enclose(self, n: int, m: int) -> None:
            vars(self).update(found, stirred_within=self.extents[F] / m)

    return Known(SimpleNamespace(), given)


# ------------------------------------------------------------------------------------------------------------- cells
def law(a: Any, i: int, j: int) -> list[Any]:
    """How the products of x = e_i and y = e_j, of which one is 1, move if x' = A x and y' = A y."""
    x, y = (column([arb(int(k == place)) for k in range(3)]) for place in (i, j))
    moved = [(a * x).entries(), y.entries()], [x.entries(), (a * y).entries()]
    return [p + q for p, q in zip(*(products(*pair) for pair in moved), strict=True)]


@pytest.mark.parametrize(("n", "m"), [(3, 2), (2, 3)])
def test_each_cell_counts_where_it_should(n: int, m: int) -> None:
    """DF is zero but in one cell: A, C and B hold what it is there, and M the share of the ray that may pass it.

    On the ray to a point of N, DF at the k-th of n parts is in the cells whose inside meets (k / n) N. A cell meets it
    where in each coordinate its inner end, as a part of the extent, is less than k / n.
    """
    extents = [Fraction(1, 5), Fraction(1, 4), Fraction(3, 8)]
    slopes = arb_mat([[1, 2, 3], [4, 5, 6], [7, 8, 9]])
    compound = [law(slopes, *pair) for pair in ((U, S), (U, F), (S, F))]
    places = [[(Fraction(k, n), Fraction(k + 1, n)) for k in range(-n, 0)]]
    places += [[(Fraction(k, count), Fraction(k + 1, count)) for k in range(-count, count)] for count in (n, m)]
    for cell in product(*places):
        middle = [float(extent * sum(ends) / 2) for extent, ends in zip(extents, cell, strict=True)]

        class Marked(Passage):
            def __init__(self) -> None:
                self.extents = [arb(x.numerator) / x.denominator for x in extents]

            def field(self, z: Sequence[Any], at: Sequence[float] = middle) -> Any:
                here = int(all(x.contains(point) for x, point in zip(z, at, strict=True)))
                return None, here * slopes, [arb(0), arb(here), arb(0)]

            def rates(self, z: Sequence[Any]) -> list[Any]:
                return [arb(-1), arb(0), arb(0)]

        passage = Marked()
        passage._enclose(n, m)
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
        near = bool(arb(inner[2].numerator) / inner[2].denominator * passage.extents[F] < passage.stirred_within)
        assert bool(passage.stirred[0] >= 1) is near


# ------------------------------------------------------------------------------------------------ what is asked of N
def test_the_example_is_a_passage() -> None:
    made_up()


SPOILED: list[tuple[str, dict[Place, Any]]] = [
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
    ("the second compound falls", {("C", 0, 0): -1, ("C", 0, 1): 1, ("C", 1, 0): 0, ("C", 1, 1): -1.25,
                                   ("C", 1, 2): 0}),
    # |b_uf| / k_1 and |b_sf| / k_2 fall at 0.5 then, and b_us may fall at 1.56.
    ("the cone of the second compound", {("C", 1, 0): 46.4375}),
    ("the cone of the second compound", {("C", 2, 0): 107.375}),
    ("the variation by the speed", {("C", 1, 0): -14}),
    ("the variation by the speed", {("C", 2, 0): 18}),
    ("the variation by the speed", {("stirred", 0): 0.625}),
    ("the variation by the speed", {("stirred", 1): 9}),
    ("the variation by the speed", {("stirred", 2): 11.5}),
    # |z_f| / k_3 falls at 100 - 8 (11 + 1) or 100 - 8 (2 + 10) only, less than |z_s| with its 8.
    # With what the others' parts take from z_s the first is 4 - 8 - 1/8 - 1/256.
    (r"the thin set: .-4\.129", {("M", F, U): 11}),
    ("the thin set", {("M", F, S): -10}),
]  # fmt: skip


@pytest.mark.parametrize(("line", "numbers"), SPOILED)
def test_a_number_that_is_spoiled_breaks_its_inequality(line: str, numbers: dict[Place, Any]) -> None:
    with pytest.raises(checker.Unproved, match=f"^{line}"):
        made_up(numbers)


#: The fast direction divided by four: with it z_f is four times as large, and so may be k_3.
QUARTER = {("directions", 0, F): -0.0025, ("directions", 1, F): 0.0007, ("directions", 2, F): 0.25}
CHOSEN: list[tuple[str, dict[Place, Any]]] = [
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


@pytest.mark.parametrize(("line", "choices"), CHOSEN)
def test_a_choice_that_is_spoiled_breaks_its_inequality(line: str, choices: dict[Place, Any]) -> None:
    with pytest.raises(checker.Unproved, match=f"^{line}:"):
        made_up(choices=choices)


def test_weights_of_the_graph_below_one_are_accepted() -> None:
    made_up(choices={**QUARTER, ("thin",): 0.95})
    made_up(choices={("flat",): 0.5})


#: the third row of the mean of Df, and the rate p; z are the coordinates y here
AFTER_A_CROSSING = {"row": (20, 5, -12), "rate": 5}


@pytest.mark.parametrize(
    "change",
    [{"row": (20, 0, -12)}, {"row": (-36, 5, -12)}, {"row": (20, 5, 0)}, {"rate": 0}, {"rate": -1}, {"rate": 14}],
)
def test_what_is_asked_after_a_crossing(change: dict[str, Any]) -> None:
    """v' falls with y_gamma < 0; 20 - p (p - 12) is positive from p = -1.5 to p = 13.5, and p is to be."""

    def asked(row: Sequence[float], rate: float) -> None:
        unit = arb_mat([[int(i == j) for j in range(3)] for i in range(3)])
        rows = arb_mat([[0, 0, 1], [1, 0, 0], [arb(x) for x in row]])
        Passage._quadrant(SimpleNamespace(directions=unit, M=rows, inverse=unit, extents=[arb(0.25)] * 3), arb(rate))

    asked(**AFTER_A_CROSSING)
    with pytest.raises(checker.Unproved, match="beta_bar and gamma after a crossing"):
        asked(**(AFTER_A_CROSSING | change))


def test_beta_bar_stays_small_in_n() -> None:
    """In other units, 32 times as large, beta_bar would be as large as 1.8 in N."""
    rows = made_up().directions.tolist()
    large = {("directions", i, j): 32 * rows[i][j] for i, j in product(range(3), repeat=2)}
    with pytest.raises(checker.Unproved, match=r"beta_bar and gamma after a crossing: \[-0\.84"):
        made_up(choices=large)


# ---------------------------------------------------------------------------------------------- what is said of orbits
def test_the_rates_in_the_steep_cone() -> None:
    """d_u' / d_u at the cone's corners: at least with a difference of speeds, and at most without."""
    n = made_up()
    k_u, k_s, k_f = n.steep
    rates, own = [], []
    for x, y, z in product((-1, 1), repeat=3):
        rate = n.A[U, U] + (n.A[U, S] * x * k_s + n.A[U, F] * y * k_f) / k_u
        own.append(rate)
        rates.append(rate + n.B[U] * z / k_u)
    assert abs(n.grows[0] - min(rates)) < HAIR
    assert abs(n.grows[1] - max(own)) < HAIR


def spectrum() -> Passage:
    """With C of two rows apart by 1: b_uf falls to what b_us feeds it with, and the bounds are nearly reached."""
    return made_up(
        {("C", 0, 0): -1, ("C", 0, 1): 0, ("C", 0, 2): 0, ("C", 1, 0): 1, ("C", 1, 1): -2, ("C", 1, 2): -1 / 64,
         ("C", 2, 0): 1 / 64, ("C", 2, 1): 1 / 64, ("stirred", 0): 0.125, ("stirred", 1): 0},
        {("compound", 0): 2, ("drift", 0): 0.25, ("drift", 1): 1},
    )  # fmt: skip


@pytest.mark.parametrize("passage", [made_up, spectrum])
def test_the_products_fall_as_is_said(passage: Callable[[], Passage]) -> None:
    """Exact solutions of b' = C b, from corners of boxes of which each product may be the smallest."""
    n = passage()
    k_1, k_2 = n.compound
    for time in (0, 0.125, 0.5, 2, 8):
        flow = (n.C * arb(time)).exp()
        for signs in product((-1, 0.125, 1), repeat=3):
            b = [arb(sign) * k for sign, k in zip(signs, (1, k_1, k_2), strict=True)]
            moved = [sum(flow[row, k] * b[k] for k in range(3)) for row in range(3)]
            settled = n.settled(b, arb(time))
            assert all(abs(x) < bound + HAIR for x, bound in zip(moved, settled, strict=False))
            if signs[0] == 1:
                assert abs(moved[1]) / moved[0] < n.ratio(arb(time)) + HAIR


def test_the_bounds_of_the_products_are_no_worse_than_they_should_be() -> None:
    """With rates 1 and 2, k_1 = 2, and 1 + 1/64 by which b_us and b_sf feed b_uf."""
    n, fed = spectrum(), 1 + arb(1) / 64
    for time in (arb(0), arb(0.5), arb(4)):
        once, twice = (-time).exp(), (-2 * time).exp()
        first, second = n.settled([arb(1), arb(0), arb(0)], time)
        assert abs(first - once) < HAIR
        assert abs(second - (2 * twice + fed * once)) < HAIR
        assert abs(n.ratio(time) - (2 * once + fed)) < HAIR


def test_the_stable_parts_fall_as_is_said() -> None:
    """|z_s| at 8 per second to (u / 8 + t / 32) / 8, |z_f| at 100 per second to (2 u + s) / 100."""
    n = made_up()
    u, s, t = n.extents
    for time in (arb(0), arb(0.125), arb(1)):
        slow, fast = n.fallen(arb(0.25), arb(0.5), time)
        assert abs(slow - (arb(0.25) * (-8 * time).exp() + (u / 8 + t / 32) / 8)) < HAIR
        assert abs(fast - (arb(0.5) * (-100 * time).exp() + (2 * u + s) / 100)) < HAIR


@pytest.mark.parametrize(("by_u", "by_f"), [(0.15, 0.25), (0.15, -0.25), (0.0625, 0.25), (0.0625, -0.25)])
def test_where_beta_bar_vanishes_in_the_thin_set(by_u: float, by_f: float) -> None:
    """Points with z_u = 1 and z_f up to 0.99 of what the set allows: z_s = r + q z_f, larger than 1 or smaller."""
    n = made_up(choices={("directions", 0, U): by_u, ("directions", 0, F): by_f})
    r, q = (-n.directions[0, k] / n.directions[0, S] for k in (U, F))
    for share in (-0.99, -0.5, 0.5, 0.99):
        fast = arb(share) * n.thin
        if abs(r + q * fast) > 1:
            fast = fast * r / (1 - q * fast)  # z_f = share k_3 z_s
        slow = r + q * fast
        assert abs(fast) < n.thin * abs(slow).max(arb(1))
        assert n.ratios[S].contains(slow)
        assert n.ratios[F].contains(fast)


def test_the_time_of_a_passage() -> None:
    """The graph may be as low as -k max(s, t) where the orbit leaves N; there d_u is u less than that."""
    n = made_up()
    u, s, t = n.extents
    least = u - n.flat * s.max(t)
    assert abs(n.time(least)) < HAIR
    assert abs(n.time(least / 2) - arb(2).log() / n.grows[1]) < HAIR


def test_a_crossing_is_as_far_from_the_graph_as_both_ends_allow() -> None:
    """From z_u = 0, k s from the graph, which is k s from z_u = 0 at the crossing; z_s falls at once."""
    n = made_up({("M", S, S): -(2.0**20), ("M", F, F): -(2.0**24)})
    found = n.crossing(arb(0), arb(0), arb(2) ** -10)
    assert found >= 2 * n.flat * n.extents[S]


def test_a_crossing_is_where_z_s_has_fallen_to() -> None:
    """Soon after the start, where |z_u| has not grown yet, |z_s| / r is larger; and the moment is not the start."""
    n, moment = made_up(), arb(2) ** -10
    found = n.crossing(arb(0), arb(0), moment)
    assert found * n.ratios[S].lower() > n.fallen(n.extents[S], arb(0), moment)[0] - HAIR
    for early in (0, -1):
        with pytest.raises(checker.Unproved, match="the moment of crossing"):
            n.crossing(arb(0), arb(0), arb(early))
