"""The smooth friction law: its flow through sliding reversals, the limit cycles and Omega_h
proved under it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from functools import cache
from typing import Any

import mpmath
import pytest

from tests.proofs.cases import NUMBERS, Flight, carry, half_flight
from tippedisk_verify.flow.contract import Request
from tippedisk_verify.model.parameters import PRINTED, Parameters
from tippedisk_verify.model.precision import bits
from tippedisk_verify.proofs.kernel import sliding
from tippedisk_verify.proofs.kernel.balls import (
    Unproved,
    arb,
    ball,
    ball_constants,
    positive,
    working_precision,
)
from tippedisk_verify.proofs.kernel.certificates.saddle import (
    SLOW,
    UNSTABLE,
    ManifoldGraph,
    SaddleCoordinates,
    block,
    leaving,
)
from tippedisk_verify.proofs.kernel.field import sliding_motion
from tippedisk_verify.proofs.kernel.flow import FlowStatus
from tippedisk_verify.proofs.kernel.sliding import Crossing, SlidingPath, model_of
from tippedisk_verify.proofs.numbers import measured
from tippedisk_verify.proofs.search.certificate import parameter_texts
from tippedisk_verify.proofs.search.cycle import prove_cycle
from tippedisk_verify.proofs.search.heteroclinic import (
    ProvedConnection,
    eigenvectors,
    prove_connection,
    series_of_curve,
)
from tippedisk_verify.proofs.search.steps import Steps
from tippedisk_verify.reference_values.lookup import reference
from tippedisk_verify.theory.saddle_manifolds import Saddle as Series

SMOOTH = PRINTED.with_friction("smooth")
OMEGA = Fraction("30.386592688644")
PLACE = "table1/smooth/limit-cycle/crit-0.5"
GUESS = tuple(
    f"{float(reference(f'{PLACE}/{name}').measured()):.12g}" for name in ("gamma_bar_0", "v_0")
)
#: A hundredth of a second before the first sliding reversal of the limit cycle, and until as long
#: after it.
START, SPAN, SIZE = ("0", "1.725", "-1.7105"), "0.02", Fraction(1, 10**6)


@pytest.fixture(autouse=True)
def _bits() -> Iterator[None]:
    with working_precision(100):
        yield


def flown(start=START, omega=OMEGA, **options) -> Flight:
    """The flow from a start over `SPAN`."""
    flight = carry(model_of(SMOOTH, ball(omega)), [ball(part) for part in start], SPAN, **options)
    assert flight.status is None
    return flight


def gamma_y(constants, omega, state):
    return sliding_motion(sliding.BallOps, constants, omega, state)[0]


def moved(column: int, step: object) -> tuple[list, object]:
    """Start and speed, one of the four moved."""
    values = [ball(part) for part in (*START, OMEGA)]
    values[column] = values[column] + step
    return values[:3], values[3]


# ------------------------------------------------------------------- a crossing and its derivatives
def test_the_integrator_finds_the_same_through_a_reversal(taylor) -> None:
    """In 200 bits, with all derivatives."""
    request = Request(
        SMOOTH,
        OMEGA,
        START,
        SPAN,
        shifted=True,
        precision=bits(200),
        domain="none",
        variations=("beta", "gamma", "v", "Omega"),
        divergence=True,
    )
    ordinary, flight = taylor(request), flown(derivatives=True)
    assert flight.matrix is not None
    rows = zip((flight.state, *flight.matrix), (ordinary.state, *ordinary.derivatives), strict=True)
    for mine, other in [
        *(pair for row in rows for pair in zip(*row, strict=True)),
        (flight.divergence, ordinary.divergence),
    ]:
        assert measured(mine).holds(other)
        assert mine.rad() < 1e-20


def test_flights_through_reversals_hold_orbits_and_derivatives() -> None:
    """The mean value theorem, which knows nothing of crossings: over start boxes and speeds
    of size 1e-6.
    """
    for column in range(4):
        start, omega = moved(column, arb(0, ball(SIZE).upper()))
        whole = flown(start, omega, derivatives=True)
        ends = [flown(*moved(column, side * ball(SIZE))) for side in (1, -1)]
        for row in range(3):
            assert all(whole.state[row].contains(end.state[row].mid()) for end in ends)
            quotient = (ends[0].state[row] - ends[1].state[row]) / (2 * ball(SIZE))
            assert whole.matrix[row][column].overlaps(quotient)
            # v's derivatives change at the kink by some hundreds for each unit of the box, relative
            # to their size.
            assert abs(whole.matrix[row][column] - quotient) < (1 + abs(quotient)) * ball("0.01")
    flight = flown(derivatives=True)
    (a, b, c), (d, e, f), (g, h, i) = (row[:3] for row in flight.matrix)
    determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    assert determinant.overlaps(flight.divergence.exp())


# -------------------------------------------------------------------------- what must not be proved
#: From here the sliding velocity, which is negative, rises to a greatest value close to zero and
#: falls again. It stays negative for a v somewhat below -1.809586 rad/s, and is positive for a
#: while for one above.
GRAZING = ("-0.2527", "1.0417", "-1.809586")
LATER = "0.08"  # s


@pytest.mark.parametrize(
    ("start", "span", "reversals"),
    [
        (START, SPAN, 1),
        ((*GRAZING[:2], "-1.810586"), LATER, 0),
        ((*GRAZING[:2], "-1.808586"), LATER, 2),
    ],
)
def test_reversals_are_counted_and_the_sign_between_them_is_known(
    start: Any, span: str, reversals: int
) -> None:
    path = model_of(SMOOTH, ball(OMEGA)).path([ball(part) for part in start], Steps())
    assert isinstance(path, SlidingPath)
    crossings, before = 0, path.side
    while path.time < ball(span):
        step = path.step()
        assert step is not None
        crossings += isinstance(step, Crossing)
        path.take(step)
        assert positive(path.side * gamma_y(ball_constants(SMOOTH), ball(OMEGA), path.box))
    assert (path.reversals, before, path.side) == (reversals, -1, 1 if reversals == 1 else -1)
    assert crossings == min(reversals, 1) or reversals == 2


def test_a_box_that_holds_a_grazing_orbit_is_not_followed() -> None:
    start = [*map(ball, GRAZING[:2]), ball(GRAZING[2]) + arb(0, "0.001")]
    flight = carry(model_of(SMOOTH, ball(OMEGA)), start, LATER)
    assert flight.status is FlowStatus.GRAZING
    assert flight.path.time < ball(LATER)


def test_a_start_on_both_sides_is_not_followed() -> None:
    """On the section gamma_y = 0 where rho v = -e Omega sin(gamma_bar)."""
    model = model_of(SMOOTH, ball(OMEGA))
    gamma = ball("1.7")
    constants = model.constants
    v = -constants.e * ball(OMEGA) * gamma.sin() / (constants.r + constants.e * gamma.cos())
    flight = half_flight(model, gamma, v)
    assert flight.status is FlowStatus.GRAZING
    assert half_flight(model, gamma, v + arb("0.001")).status is FlowStatus.RETURNED


def test_a_moment_in_doubt_has_no_derivatives() -> None:
    start = [ball(part) + arb(0, "1e-6") for part in START]
    path = model_of(SMOOTH, ball(OMEGA)).path(start, Steps(), derivatives=True)
    step = path.step()
    while not isinstance(step, Crossing):
        assert step is not None
        path.take(step)
        step = path.step()
    doubtful = step.tau.mid()
    assert not any(entry.is_finite() for row in step.rows_at(doubtful) for entry in row)
    assert not step.divergence_at(doubtful).is_finite()
    assert step.at(doubtful) == step.enclosure
    path.take(step, doubtful)
    assert not any(part.is_finite() for part in path.box)


# ------------------------------------------------------------------------------------- limit cycles
@pytest.mark.parametrize(
    ("place", "digits"),
    [
        (PLACE, 8),
        pytest.param(
            "table1/smooth/near-heteroclinic/het+1e-3", 30, marks=pytest.mark.slow(minutes=2)
        ),
        pytest.param(
            "calibrated/smooth/limit-cycle/crit-0.01", 30, marks=pytest.mark.slow(minutes=2)
        ),
    ],
)
def test_reference_cycles_lie_in_the_proved_intervals(place: str, digits: int) -> None:
    """The reference data's half-widths are some 1e-50."""
    disk = Parameters.named(place.partition("/")[0]).with_friction("smooth")
    values = {name: reference(f"{place}/{name}").measured() for name in NUMBERS}
    omega = Fraction(reference(f"{place}/period").inputs["Omega"])
    proof = prove_cycle(
        disk, omega, (values["gamma_bar_0"].value, values["v_0"].value), digits=digits
    )
    assert proof.proved, proof.statement
    assert proof.stable
    assert proof.to_dict()["sliding_reversals"] == proof.reversals == 6
    assert "under the smooth Coulomb friction law" in proof.statement
    assert (
        "gamma_y changes its sign exactly 6 times a period and is 0 nowhere else" in proof.statement
    )
    for name, number in proof.numbers().items():
        assert (
            abs(number.value - values[name].value) <= number.uncertainty + values[name].uncertainty
        ), name
        assert number.uncertainty < max(1, abs(number.value)) / Fraction(10) ** digits, name


# -------------------------------------------------------------------------- Omega_h and the saddles
TRUTH = reference("table1/smooth/heteroclinic/point/omega_h").measured()


@pytest.fixture(scope="module")
def connection() -> ProvedConnection:
    return prove_connection(SMOOTH, TRUTH.value, 8)


def test_the_proved_interval_holds_omega_h(connection: ProvedConnection) -> None:
    assert connection.proved
    assert connection.unique
    assert connection.upright
    assert connection.omega_h is not None
    assert connection.omega_h.holds(TRUTH.value)
    assert 2 * connection.omega_h.uncertainty <= Fraction(1, 10**8)
    assert (
        "under the smooth Coulomb friction law there is exactly one Omega" in connection.statement
    )


def test_nothing_is_said_of_limit_cycles_of_a_field_without_second_derivatives(
    connection: ProvedConnection,
) -> None:
    """All other hypotheses of the theorem are there."""
    assert connection.slowly
    assert connection.limit_cycle is None
    assert replace(connection, parameters=PRINTED).limit_cycle is not None


@cache
def saddle_curve(along: int) -> ManifoldGraph:
    """The series of one side's law."""
    speed = Fraction(round(TRUTH.value * 2**60), 2**60)
    with working_precision(160):
        values, directions = eigenvectors(SMOOTH, speed)
        saddle = SaddleCoordinates(
            parameter_texts(SMOOTH), "smooth", ball(speed), directions.tolist()
        )
        return series_of_curve(saddle, along, 41, values)


def on_curve(curve: ManifoldGraph, along: int, wanted: float) -> list[Any]:
    """z of the power series of `theory` where the coordinate ``along`` has the value wanted."""
    ordinary = Series(SMOOTH, Fraction(round(TRUTH.value * 2**60), 2**60), 240, 41)
    context = mpmath.MPContext()
    context.prec = 240
    s = context.mpf(wanted)
    for _ in range(60):
        parts = ordinary.unstable_curve if along == UNSTABLE else ordinary.stable_curve
        z = curve.saddle.coordinates([ball(str(context.nstr(part.at(s), 60))) for part in parts])
        s -= context.mpf(z[along].mid().str(60, radius=False)) - wanted
    return z


def other_side(curve: ManifoldGraph) -> ManifoldGraph:
    return ManifoldGraph(curve.saddle, curve.along, curve.graph, -(curve.side or 0))


def test_the_unstable_branch_is_where_the_one_sided_power_series_puts_it() -> None:
    with working_precision(160):
        curve, theta = saddle_curve(UNSTABLE), arb(1) / 32
        defect = curve.relative_defect(theta)
        box, _, _ = leaving(curve, theta, [2 * part + arb(2) ** -150 for part in defect], defect)
        for mine, true in zip(box, on_curve(curve, UNSTABLE, 1 / 32), strict=True):
            assert abs(true - mine.mid()) < mine.rad() + arb(2) ** -140
        assert all(float(part) < 1e-20 for part in defect)


def test_the_slow_curve_lies_in_the_block_on_both_sides_of_the_saddle() -> None:
    """Where gamma_y has one sign, and, mirrored, where it has the other."""
    with working_precision(160):
        curve, small = saddle_curve(SLOW), arb("1e-25").mid()
        delta, _, _ = block(curve, (arb(0.01), small, small))
        truth = on_curve(curve, SLOW, -0.008)
        for z in (truth, [-part for part in truth]):
            off = curve.straightened(z)
            assert all(abs(part) < small for part in off)
            assert abs(off[0]) < delta
        # Without the mirror one of the two is off by the jump of the curve's second derivative.
        plain = ManifoldGraph(curve.saddle, SLOW, curve.graph, None)
        offs = [
            max(float(abs(x)) for x in plain.straightened(z))
            for z in (truth, [-part for part in truth])
        ]
        assert max(offs) > 1e-8


def test_a_curve_of_the_wrong_side_is_refused() -> None:
    with working_precision(160):
        theta, curve = arb(1) / 32, saddle_curve(UNSTABLE)
        curve.keeps_side(theta, (arb(0), arb(0)))
        # gamma_y = 0 cuts it
        for wrong, cone in ((other_side(curve), (arb(0), arb(0))), (curve, (arb(1), arb(1)))):
            with pytest.raises(Unproved, match="sign of the sliding velocity"):
                wrong.keeps_side(theta, cone)
        with pytest.raises(Unproved):
            block(other_side(saddle_curve(SLOW)), (arb(0.01), arb(1e-9), arb(1e-9)))


def test_derivatives_over_boxes_that_both_sides_meet() -> None:
    """Differences of the smooth field itself lie in them, wherever the two states are."""
    with working_precision(160):
        size, saddle = arb("0.002"), saddle_curve(SLOW).saddle
        _, matrix, _ = saddle.field([arb(0, size.upper())] * 3)
        for one, two in (
            ((1, 0, 0), (-1, 0, 0)),
            ((0, 1, 1), (0, 1, -1)),
            ((1, 1, 1), (-1, -1, -1)),
            ((0, 0, 1), (1, 1, 0)),
        ):
            a, b = ([size * part for part in signs] for signs in (one, two))
            moved = [x - y for x, y in zip(saddle.rates(a), saddle.rates(b), strict=True)]
            for row in range(3):
                assert sum((matrix[row][k] * (a[k] - b[k]) for k in range(3)), arb(0)).overlaps(
                    moved[row]
                )
