"""Curves, blocks and cones at the saddle, against the power series of `theory`."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import cache
from typing import Any

import mpmath
import pytest
from flint import arb, arb_mat

from tests.proofs.cases import in_precision
from tippedisk_verify.model.equations import shifted_ops, vector_field
from tippedisk_verify.model.parameters import CALIBRATED, PRINTED, Parameters
from tippedisk_verify.numbers.exact import fraction
from tippedisk_verify.proofs.ball_conversions import ball_constants
from tippedisk_verify.proofs.kernel.balls import (
    BallOps,
    Unproved,
    ball,
    positive,
    working_precision,
)
from tippedisk_verify.proofs.kernel.saddle import (
    FAST,
    SLOW,
    UNSTABLE,
    ManifoldGraph,
    SaddleCoordinates,
    cone_conditions,
    verify_isolating_block,
    verify_unstable_cone,
)
from tippedisk_verify.proofs.search.connection_proof import (
    eigenvectors,
    invariant_curve_series,
    smallest_weights,
)
from tippedisk_verify.proofs.search.proof_search import parameter_texts
from tippedisk_verify.theory.power_series import PowerSeries
from tippedisk_verify.theory.saddle_manifolds import Saddle as Series

SPEED = Fraction(round(Fraction("30.05") * 2**100), 2**100)
BITS, ORDER = 160, 41
THETA = arb(1) / 16
SMOOTH = PRINTED.with_friction("smooth")
#: Truths of 300 bits whose coordinate along the curve is sought to 60 digits; series of order 41
#: have as many where they are used. The balls of 160 bits lose some 20 of them.
SHARP = arb(2) ** -140


_context = in_precision(BITS)


def saddle_at(parameters: Parameters, width: str = "0") -> SaddleCoordinates:
    directions = eigenvectors(parameters, SPEED)[1].tolist()
    return SaddleCoordinates(
        parameter_texts(parameters), parameters.friction, ball(SPEED) + arb(0, width), directions
    )


@cache
def series(parameters: Parameters, along: int, order: int) -> ManifoldGraph:
    values = eigenvectors(parameters, SPEED)[0]
    with working_precision(BITS):
        return invariant_curve_series(saddle_at(parameters), along, order, values)


def curve_of(
    parameters: Parameters, along: int, width: str = "0", order: int = ORDER
) -> ManifoldGraph:
    found = series(parameters, along, order)
    rows = [list(row) for row in found.graph]
    return ManifoldGraph(saddle_at(parameters, width), along, rows, found.side)


def cone_of(curve: ManifoldGraph, factor: int = 16) -> list[Any]:
    """Some times the defect: the gaps between the eigenvalues are larger than 14."""
    defect = curve.relative_defect(THETA)
    return [part * factor / 14 + sum(defect) / 64 + arb(2) ** -150 for part in defect]


@cache
def truth_of(parameters: Parameters, shift: Fraction) -> Series:
    """The power series of `theory`; under the smooth law those of one side."""
    return Series(parameters, SPEED + shift, 300, 41)


def point_of(
    saddle: SaddleCoordinates, series: list[PowerSeries], component: int, wanted: float
) -> list[Any]:
    """z of the curve of `theory` where one coordinate has the value wanted."""
    context = mpmath.MPContext()
    context.prec = 300
    s = context.mpf(wanted)
    for _ in range(60):  # the curve is tangent to the coordinate: simple iteration contracts
        z = saddle.coordinates([ball(fraction(part.value_at(s))) for part in series])
        s -= context.mpf(z[component].mid().str(60, radius=False)) - wanted
    return z


@pytest.mark.parametrize(
    ("parameters", "order", "sharp"),
    [(PRINTED, ORDER, 1e-40), (CALIBRATED, 5, 1e-6), (SMOOTH, ORDER, 1e-20)],
)
def test_the_unstable_branch_is_where_the_power_series_put_it(
    parameters: Parameters, order: int, sharp: float
) -> None:
    """With a short series too, whose defect is all remainder."""
    curve = curve_of(parameters, UNSTABLE, order=order)
    cone = cone_of(curve)
    box, _, _ = verify_unstable_cone(curve, THETA, cone, curve.relative_defect(THETA))
    assert all(float(part) < sharp for part in cone)
    truth = point_of(
        curve.saddle, truth_of(parameters, Fraction(0)).unstable_curve, UNSTABLE, 0.0625
    )
    for mine, true in zip(box, truth, strict=True):
        assert abs(true - mine.mid()) < mine.rad() + SHARP


def test_the_cone_of_an_interval_of_speeds_holds_how_the_branch_moves() -> None:
    """The branches of its ends lie in it, and their difference is within the weights times
    that of the speeds.
    """
    curve, step = curve_of(PRINTED, UNSTABLE, "1e-9"), Fraction(1, 10**9)
    box, whole, matrix = verify_unstable_cone(
        curve, THETA, cone_of(curve), curve.relative_defect(THETA)
    )
    low, middle, high = (
        point_of(curve.saddle, truth_of(PRINTED, shift).unstable_curve, UNSTABLE, 0.0625)
        for shift in (-step, Fraction(0), step)
    )
    for truth in (low, middle, high):
        assert all(mine.contains(true.mid()) for mine, true in zip(box[1:], truth[1:], strict=True))
    by_speed = curve.saddle.rates_and_derivatives(whole)[2]
    weights = smallest_weights(matrix, by_speed)
    assert all(map(positive, cone_conditions(matrix, weights, by_speed)))
    for place in (SLOW, FAST):
        moved = abs(high[place] - low[place]) / (2 * ball(step))
        assert moved < weights[place]
        assert float(moved) > float(weights[place]) / 100  # the bound is not an idle one


@pytest.mark.parametrize(("order", "size", "sharp"), [(ORDER, "1e-30", 1e-32), (5, "1e-7", 1e-8)])
def test_the_slow_stable_curve_lies_within_delta_of_the_block(
    order: int, size: str, sharp: float
) -> None:
    curve = curve_of(PRINTED, SLOW, order=order)
    delta, _, _ = verify_isolating_block(
        curve, (arb("0.06").mid(), arb(size).mid(), arb(size).mid())
    )
    assert float(delta) < sharp
    for theta in (-0.05, -0.01, 0.03):
        w_u, w_f = curve.offset_from_curve(
            point_of(curve.saddle, truth_of(PRINTED, Fraction(0)).stable_curve, SLOW, theta)
        )
        assert abs(w_u) < delta
        assert abs(w_f) < arb(size)


def test_the_slow_curve_of_the_smooth_law_lies_in_the_block_on_both_sides() -> None:
    """Where gamma_y has one sign, and, mirrored, where it has the other."""
    curve, small = curve_of(SMOOTH, SLOW), arb("1e-25").mid()
    delta, _, _ = verify_isolating_block(curve, (arb(0.01), small, small))
    truth = point_of(
        curve.saddle, truth_of(SMOOTH, Fraction(0)).stable_curve, SLOW, -0.008 * (curve.side or 0)
    )
    # Without the mirror one of the two is off by the jump of the curve's second derivative.
    plain, offs = ManifoldGraph(curve.saddle, SLOW, curve.graph, None), []
    for z in (truth, [-part for part in truth]):
        off = curve.offset_from_curve(z)
        assert all(abs(part) < small for part in off)
        assert abs(off[0]) < delta
        offs += map(abs, plain.offset_from_curve(z))
    assert any(off > arb("1e-8") for off in offs)


def test_a_curve_of_the_wrong_side_is_refused() -> None:
    curve, slow = curve_of(SMOOTH, UNSTABLE), curve_of(SMOOTH, SLOW)
    curve.require_side(THETA, (arb(0), arb(0)))
    other, block_of_other = (
        ManifoldGraph(one.saddle, one.along, one.graph, -(one.side or 0)) for one in (curve, slow)
    )
    # gamma_y = 0 cuts the wide cone
    for wrong, cone in ((other, (arb(0), arb(0))), (curve, (arb(1), arb(1)))):
        with pytest.raises(Unproved, match="sign of the sliding velocity"):
            wrong.require_side(THETA, cone)
    with pytest.raises(Unproved):
        verify_isolating_block(block_of_other, (arb(0.01), arb(1e-9), arb(1e-9)))


def test_derivatives_over_boxes_that_both_sides_meet() -> None:
    """Differences of the smooth field itself lie in them, wherever the two states are."""
    size, saddle = arb("0.002"), saddle_at(SMOOTH)
    matrix = arb_mat(saddle.rates_and_derivatives([arb(0, size.upper())] * 3)[1])
    for one, two in (
        ((1, 0, 0), (-1, 0, 0)),
        ((0, 1, 1), (0, 1, -1)),
        ((1, 1, 1), (-1, -1, -1)),
        ((0, 0, 1), (1, 1, 0)),
    ):
        a, b = ([size * part for part in signs] for signs in (one, two))
        moved = matrix * arb_mat([[x - y] for x, y in zip(a, b, strict=True)])
        for row, mine, its in zip(moved.entries(), saddle.rates(a), saddle.rates(b), strict=True):
            assert row.overlaps(mine - its)


def test_what_is_too_large_or_not_finite_is_refused() -> None:
    slow, small = curve_of(PRINTED, SLOW), arb("1e-12").mid()
    verify_isolating_block(slow, (arb(0.05), small, small))
    for extents in (
        (arb(2), small, small),  # beyond the series
        (arb(0.05), small, arb("1e-16").mid()),  # the coupling from w_u wins on the faces w_f = t
        (arb(0.05), arb("1e-16").mid(), small),  # u within delta
        (arb("nan"), small, small),
        (arb("inf"), small, small),
        (arb(0.05), arb("nan"), small),
        (arb(0.05), -small, small),
    ):
        with pytest.raises(Unproved):
            verify_isolating_block(slow, extents)
    curve = curve_of(PRINTED, UNSTABLE, order=5)
    right = cone_of(curve)
    verify_unstable_cone(curve, THETA, right, curve.relative_defect(THETA))
    for theta, cone in (
        (arb(3), right),
        (arb("nan"), right),
        (-THETA, right),
        (THETA, [right[0] / 1000, right[1]]),  # too narrow in one direction
        (THETA, [right[0], right[1] / 1000]),
    ):
        with pytest.raises(Unproved):
            verify_unstable_cone(curve, theta, cone, curve.relative_defect(theta))


def test_the_derivative_across_a_curve_is_that_of_the_rate_of_w() -> None:
    """w' = F_w - W' F_theta by differences in w, for a curve so bent that W' counts."""
    curve = curve_of(PRINTED, SLOW)
    curve.graph[0][3], curve.graph[1][3] = arb(16), arb(-8)
    theta, step = arb("0.125"), arb("1e-12")

    def rate(w: Sequence[Any]) -> list[Any]:
        flow = curve.saddle.rates(curve.point(theta, w))
        return [
            flow[o] - slope * flow[SLOW]
            for o, slope in zip(curve.others, curve.slopes(theta), strict=True)
        ]

    start = [arb("0.001"), arb("0.002")]
    for column in range(2):
        moved = [part + (step if k == column else 0) for k, part in enumerate(start)]
        box = curve.point(theta, [a.union(b) for a, b in zip(start, moved, strict=True)])
        rows = curve.transverse_jacobian(arb_mat(curve.saddle.rates_and_derivatives(box)[1]), theta)
        for row, (after, before) in enumerate(zip(rate(moved), rate(start), strict=True)):
            assert ((after - before) / step).overlaps(rows[row][column])
            assert rows[row][column].rel_accuracy_bits() > 20


def test_the_field_in_these_coordinates_is_that_of_the_equations() -> None:
    """F is; differences of F lie in the derivatives over the segment between."""
    saddle, step, z = saddle_at(PRINTED), arb("1e-12"), [arb("0.03"), arb("-0.02"), arb("0.01")]
    beta, gamma, v = saddle.offset(z)
    theirs = vector_field(shifted_ops(BallOps), ball_constants(PRINTED), saddle.omega, "linear")(
        beta, gamma + arb.pi(), v
    )
    start = saddle.rates(z)
    assert all(a.overlaps(b) for a, b in zip(start, saddle.coordinates(theirs), strict=True))
    assert saddle.rates([arb(0)] * 3) == [0, 0, 0]
    for column in range(3):
        other = [part + (step if k == column else 0) for k, part in enumerate(z)]
        matrix = saddle.rates_and_derivatives([a.union(b) for a, b in zip(z, other, strict=True)])[
            1
        ]
        for row, (after, before) in enumerate(zip(saddle.rates(other), start, strict=True)):
            assert ((after - before) / step).overlaps(matrix[row][column])
    faster = SaddleCoordinates(
        saddle.disk, "linear", saddle.omega + step, saddle.directions.tolist()
    )
    both = SaddleCoordinates(
        saddle.disk, "linear", saddle.omega.union(faster.omega), saddle.directions.tolist()
    )
    for after, before, slope in zip(
        faster.rates(z), start, both.rates_and_derivatives(z)[2], strict=True
    ):
        assert ((after - before) / step).overlaps(slope)
        assert slope.rel_accuracy_bits() > 20
