"""Curves, blocks and cones at the saddle, against the ordinary road's power series and against orbits."""

from __future__ import annotations

from fractions import Fraction
from functools import cache

import mpmath
import pytest
from flint import arb, arb_mat

from tests.proofs.cases import carry
from tippedisk_verify.errors import NoConnectionError
from tippedisk_verify.model.exact import fraction
from tippedisk_verify.model.parameters import CALIBRATED, PRINTED, Parameters
from tippedisk_verify.proofs.angles import NONINVERTED, OPS, Turned, linearization, rates
from tippedisk_verify.proofs.kernel.balls import ball, ball_constants, positive, working_precision
from tippedisk_verify.proofs.kernel.flow import Model, Status
from tippedisk_verify.proofs.search.local_manifolds import (
    FAST,
    SLOW,
    UNSTABLE,
    Block,
    Curve,
    Frame,
    rates_of_cones,
    smallest_weights,
)
from tippedisk_verify.theory.equilibria import linearization as theory_linearization
from tippedisk_verify.theory.saddle_manifolds import Saddle
from tippedisk_verify.theory.series import PowerSeries

SPEED = Fraction("30.05")
BITS, ORDER = 160, 41
SETS = pytest.mark.parametrize("parameters", [PRINTED, CALIBRATED], ids=lambda p: p.name)


@pytest.fixture(autouse=True)
def _bits():
    with working_precision(BITS):
        yield


@cache
def _saddle(parameters: Parameters, speed: Fraction, working_bits: int, order: int) -> Saddle:
    """The ordinary road's series: to order 41 good to 60 digits where they are used here."""
    return Saddle(parameters, speed, working_bits, order)


def _curve(parameters: Parameters, along: int, width: str = "0", order: int = ORDER) -> Curve:
    frame = Frame(parameters, Fraction(round(SPEED * 2**100), 2**100))
    return Curve(frame, ball(Fraction(round(SPEED * 2**100), 2**100)) + arb(0, width), along, order)


def _point_of(frame: Frame, series: list[PowerSeries], component: int, wanted: float) -> list[object]:
    """z of the ordinary road's curve where one linear coordinate has the value wanted."""
    rows = frame.inverse

    def coordinates(s):
        y = [ball(fraction(part.at(s))) for part in series]
        return [sum((rows[row, k] * y[k] for k in range(3)), arb(0)) for row in range(3)]

    context = mpmath.MPContext()
    context.prec = 300
    s = context.mpf(wanted)
    for _ in range(60):  # the curve is tangent to the coordinate: simple iteration contracts
        s -= (context.mpf(str(coordinates(s)[component].mid().str(60, radius=False))) - wanted) / 1
    return coordinates(s)


def test_turned_angles_make_the_linearisation_exact() -> None:
    for around, name in ((1, "inverted"), (NONINVERTED, "noninverted")):
        rows = linearization(PRINTED.rational(), SPEED, around)
        theirs = theory_linearization(PRINTED, SPEED, name)  # type: ignore[arg-type]
        assert rows[2] == (theirs.A31, theirs.A32, theirs.A33)
        assert (rows[0], rows[1]) == ((0, 0, 1), (SPEED, 0, 0))
    for quarters in range(-4, 5):
        offset = arb("0.3")
        whole = arb.pi() / 2 * quarters + offset
        assert OPS.sin(Turned(quarters, offset)).overlaps(whole.sin())
        assert OPS.cos(Turned(quarters, offset)).overlaps(whole.cos())


def test_an_error_of_a_ball_is_rounded_up() -> None:
    for text in ("0.1", "1e-40", "7.3e5"):
        radius = arb(text)
        assert arb(0, radius).contains(radius)


@SETS
@pytest.mark.parametrize(("order", "sharp"), [(ORDER, 1e-40), (5, 1e-6)])
def test_the_unstable_branch_is_where_the_power_series_put_it(parameters: Parameters, order: int, sharp: float) -> None:
    """With a short series too, whose defect is all remainder."""
    curve = _curve(parameters, UNSTABLE, order=order)
    theta = ball(Fraction(1, 16))
    found = curve.unstable_point(theta)
    assert found is not None
    box, cone = found
    assert all(float(part) < sharp for part in cone)
    saddle = _saddle(parameters, fraction_of(curve.omega), 300, 41)
    truth = _point_of(curve.frame, saddle.unstable_curve, UNSTABLE, 0.0625)
    for mine, true in zip(box, truth, strict=True):
        assert abs(true - mine.mid()) < mine.rad() + arb(2) ** -140


def fraction_of(omega) -> Fraction:
    mantissa, exponent = omega.mid().man_exp()
    return Fraction(int(mantissa)) * Fraction(2) ** int(exponent)


@SETS
def test_the_cone_of_an_interval_of_speeds_holds_the_branches_of_its_ends(parameters: Parameters) -> None:
    curve = _curve(parameters, UNSTABLE, "1e-9")
    theta = ball(Fraction(1, 16))
    found = curve.unstable_point(theta)
    assert found is not None
    for shift in (-1, 0, 1):
        speed = fraction_of(curve.omega) + shift * Fraction(1, 10**9)
        truth = _point_of(curve.frame, _saddle(parameters, speed, 300, 41).unstable_curve, UNSTABLE, 0.0625)
        assert all(mine.contains(true.mid()) for mine, true in zip(found[0][1:], truth[1:], strict=True))


@SETS
def test_the_cones_bound_how_the_branch_moves_with_the_speed(parameters: Parameters) -> None:
    """Two branches at equal z_u: their difference is within the weights times the difference of speeds."""
    curve = _curve(parameters, UNSTABLE, "1e-9")
    theta = ball(Fraction(1, 16))
    found = curve.unstable_point(theta)
    assert found is not None
    whole = curve.point(arb(0).union(theta), [arb(0, part * theta) for part in found[1]])
    matrix = curve.frame.derivative(curve.omega, whole)
    by_speed = curve.frame.derivative_by_speed(curve.omega, whole)
    weights = smallest_weights(matrix, by_speed)
    assert all(map(positive, rates_of_cones(matrix, by_speed, weights)))
    step = Fraction(1, 10**9)
    low, high = (
        _point_of(curve.frame, _saddle(parameters, fraction_of(curve.omega) + shift, 300, 41).unstable_curve, 0, 0.0625)
        for shift in (-step, step)
    )
    for place in (SLOW, FAST):
        moved = abs(high[place] - low[place]) / (2 * ball(step))
        assert moved < weights[place]
        assert float(moved) > float(weights[place]) / 100  # the bound is not an idle one


@SETS
@pytest.mark.parametrize(("order", "size", "sharp"), [(ORDER, "1e-30", 1e-32), (5, "1e-7", 1e-8)])
def test_the_slow_stable_curve_lies_within_delta_of_the_block(
    parameters: Parameters, order: int, size: str, sharp: float
) -> None:
    curve = _curve(parameters, SLOW, order=order)
    block = Block.around(curve, (arb("0.06"), arb(size), arb(size)))
    assert block is not None
    assert float(block.delta) < sharp
    saddle = _saddle(parameters, fraction_of(curve.omega), 300, 41)
    for theta in (-0.05, -0.01, 0.03):
        truth = _point_of(curve.frame, saddle.stable_curve, SLOW, theta)
        _, (w_u, w_f) = curve.straightened(truth)
        assert abs(w_u) < block.delta
        assert abs(w_f) < arb(size)


@pytest.mark.parametrize("side", [-1, 1])
def test_orbits_leave_the_block_through_the_face_that_is_proved(side: int) -> None:
    curve = _curve(PRINTED, SLOW)
    block = Block.around(curve, (arb("0.06"), arb("1e-12"), arb("1e-12")))
    assert block is not None
    start = curve.point(arb("-0.05"), (side * 2 * block.delta, arb("1e-12")))
    beta, gamma, v = curve.frame.offset(start)
    # The rate is within a tenth of lambda_u: after this time w_u has grown tenfold at the very least.
    flight = carry(Model(ball_constants(PRINTED), curve.omega), (beta, gamma - arb.pi(), v), "0.5")
    assert flight.status is Status.REACHED
    beta, gamma, v = flight.state
    _, (w_u, _) = curve.straightened(curve.frame.coordinates((beta, gamma + arb.pi(), v)))
    assert positive(side * w_u - 10 * block.delta)


def test_a_block_too_large_or_not_finite_is_not_proved() -> None:
    curve = _curve(PRINTED, SLOW)
    small = arb("1e-12")
    assert Block.around(curve, (arb("0.05"), small, small)) is not None
    for extents in (
        (arb(2), small, small),  # beyond the series
        (arb("0.05"), small, arb("1e-16")),  # the coupling from w_u wins on the faces w_f = t
        (arb("0.05"), arb("1e-16"), small),  # u within delta
        (arb("nan"), small, small),
        (arb("inf"), small, small),
        (arb("0.05"), arb("nan"), small),
    ):
        assert Block.around(curve, extents) is None
    assert _curve(PRINTED, UNSTABLE).unstable_point(arb(3)) is None
    assert _curve(PRINTED, UNSTABLE).unstable_point(arb("nan")) is None


def test_the_derivative_across_a_curve_is_that_of_the_rate_of_w() -> None:
    """w' = F_w - W' F_theta by differences in w, for a curve so bent that W' counts."""
    curve = _curve(PRINTED, SLOW)
    curve.graph[0][3], curve.graph[1][3] = arb(16), arb(-8)
    theta, step = arb("0.125"), arb("1e-12")

    def rate(w):
        flow = curve.frame.rates(curve.omega, curve.point(theta, w))
        return [flow[o] - slope * flow[SLOW] for o, slope in zip(curve.others, curve.slopes(theta), strict=True)]

    start = [arb("0.001"), arb("0.002")]
    for column in range(2):
        moved = [part + (step if k == column else 0) for k, part in enumerate(start)]
        box = curve.point(theta, [a.union(b) for a, b in zip(start, moved, strict=True)])
        rows = curve.across(curve.frame.derivative(curve.omega, box), theta)
        for row, (after, before) in enumerate(zip(rate(moved), rate(start), strict=True)):
            assert ((after - before) / step).overlaps(rows[row][column])
            assert rows[row][column].rel_accuracy_bits() > 20


@pytest.mark.parametrize("narrow", [SLOW, FAST])
def test_a_cone_too_narrow_in_one_direction_is_refused(narrow: int) -> None:
    """A wrong eigenvalue makes the guess for one of the weights a hundredth of what it should be."""
    curve = _curve(PRINTED, UNSTABLE)
    theta = ball(Fraction(1, 16))
    defect = curve.relative_defect(theta)
    assert curve._cone(theta, defect, 1) is not None
    values = list(curve.frame.eigenvalues)
    values[narrow] = 200 * values[narrow]
    curve.frame.eigenvalues = tuple(values)
    assert curve._cone(theta, defect, 1) is None


def test_a_wrong_curve_has_a_defect() -> None:
    """One coefficient off by 1e-20: the cone must widen to hold the truth all the same."""
    curve = _curve(PRINTED, UNSTABLE)
    theta = ball(Fraction(1, 16))
    right = curve.unstable_point(theta)
    curve.graph[0][3] += arb("1e-20")
    wrong = curve.unstable_point(theta)
    assert right is not None
    assert wrong is not None
    assert float(wrong[1][0]) > 1e-23
    assert all(after.contains(before.mid()) for after, before in zip(wrong[0], right[0], strict=True))


def test_the_field_in_linear_coordinates_is_the_equations() -> None:
    curve = _curve(PRINTED, UNSTABLE)
    z = [arb("0.03"), arb("-0.02"), arb("0.01")]
    moved = curve.frame.coordinates(rates(curve.frame.constants, curve.omega, NONINVERTED, curve.frame.offset(z)))
    assert all(a.overlaps(b) for a, b in zip(curve.frame.rates(curve.omega, z), moved, strict=True))
    # Differences of rates against the derivatives enclosed over the segment between.
    step = arb("1e-12")
    for column in range(3):
        other = [part + (step if k == column else 0) for k, part in enumerate(z)]
        hull = [a.union(b) for a, b in zip(z, other, strict=True)]
        matrix = curve.frame.derivative(curve.omega, hull)
        pairs = zip(curve.frame.rates(curve.omega, other), curve.frame.rates(curve.omega, z), strict=True)
        for row, (after, before) in enumerate(pairs):
            assert ((after - before) / step).overlaps(matrix[row, column])
    hull = [part.union(part) for part in z]
    faster = curve.omega + step
    by_speed = curve.frame.derivative_by_speed(curve.omega.union(faster), hull)
    pairs = zip(curve.frame.rates(faster, z), curve.frame.rates(curve.omega, z), strict=True)
    for (after, before), slope in zip(pairs, by_speed, strict=True):
        assert ((after - before) / step).overlaps(slope)
        assert slope.rel_accuracy_bits() > 20


def test_cones_need_a_saddle_and_weights_that_fit() -> None:
    diagonal = arb_mat([[2, 0.125, 0.125], [0.125, -3, 0.125], [0.125, 0.125, -9]])
    nothing, ones = [arb(0)] * 3, [arb(1)] * 3
    assert all(map(positive, rates_of_cones(diagonal, nothing, ones)))
    mu, nu_s, nu_f = rates_of_cones(diagonal, nothing, ones)
    assert mu.contains(1.75)
    assert nu_s.contains(2.75)
    assert nu_f.contains(8.75)
    assert not all(map(positive, rates_of_cones(diagonal, nothing, [arb("0.01"), arb(1), arb(1)])))
    assert not all(map(positive, rates_of_cones(diagonal, [arb(3), arb(0), arb(0)], ones)))
    assert not all(map(positive, rates_of_cones(arb_mat([[arb("nan")] * 3] * 3), nothing, ones)))
    turned = arb_mat([[2, 0.1, 0.1], [0.1, 3, 0.1], [0.1, 0.1, -9]])
    assert not all(map(positive, rates_of_cones(turned, nothing, ones)))
    drift = [arb("0.1"), arb("0.2"), arb("0.3")]
    assert all(map(positive, rates_of_cones(diagonal, drift, smallest_weights(diagonal, drift))))


def test_a_saddle_focus_is_refused() -> None:
    with pytest.raises(NoConnectionError, match="saddle-focus"):
        Frame(PRINTED.changed(mu="0.03"), SPEED)


def test_the_directions_belong_to_the_eigenvalues() -> None:
    frame = Frame(PRINTED, SPEED)
    matrix = frame.derivative(ball(SPEED), [arb(0)] * 3)
    # Entries of the Jacobian up to 1e3, a condition of the directions below 1e3, a few roundings.
    rounding = arb(2) ** (24 - BITS)
    for row in range(3):
        for column in range(3):
            expected = frame.eigenvalues[row] if row == column else arb(0)
            assert abs(matrix[row, column] - expected) < rounding
    assert all(positive(frame.directions[1, column]) for column in (UNSTABLE, SLOW, FAST))
