"""The smooth friction law: its flow through sliding reversals, the limit cycles and Omega_h proved under it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from functools import cache
from typing import Any

import mpmath
import pytest

from tests.proofs.cases import NUMBERS, Flight, carry, half_flight, included, plant, speed_below
from tippedisk_verify.atlas.cycles_at_speed import rotating_cycle
from tippedisk_verify.cli import main
from tippedisk_verify.cycles.shooting import limit_cycle
from tippedisk_verify.model.equations import field, jacobian, shifted
from tippedisk_verify.model.parameters import GEOMETRY, PRINTED, Parameters
from tippedisk_verify.proofs.kernel import sliding
from tippedisk_verify.proofs.kernel.balls import Unproved, arb, ball, ball_constants, positive, working_precision
from tippedisk_verify.proofs.kernel.claims.saddle import SLOW, UNSTABLE, Curve, Saddle, block, leaving
from tippedisk_verify.proofs.kernel.field import one_sided, sliding_motion
from tippedisk_verify.proofs.kernel.flow import Status as FlowStatus
from tippedisk_verify.proofs.kernel.section import Status as HalfStatus
from tippedisk_verify.proofs.kernel.sliding import Crossing, SlidingPath, model_of
from tippedisk_verify.proofs.search.certificate import parameter_texts
from tippedisk_verify.proofs.search.cycle import TURN, Status, prove_cycle
from tippedisk_verify.proofs.search.heteroclinic import (
    ProvedConnection,
    eigenvectors,
    prove_connection,
    series_of_curve,
)
from tippedisk_verify.proofs.search.heteroclinic import Status as ConnectionStatus
from tippedisk_verify.proofs.search.steps import Steps
from tippedisk_verify.reference_values.lookup import reference
from tippedisk_verify.theory.saddle_manifolds import Saddle as Series

SMOOTH = PRINTED.with_friction("smooth")
OMEGA = Fraction("30.386592688644")
PLACE = "printed/smooth/limit-cycle/crit-0.5"
GUESS = tuple(f"{float(reference(f'{PLACE}/{name}').measured()):.12g}" for name in ("gamma_bar_0", "v_0"))
#: A hundredth of a second before the first sliding reversal of the limit cycle, and until as long after it.
START, SPAN, SIZE = ("0", "1.725", "-1.7105"), "0.02", Fraction(1, 10**6)


@pytest.fixture(autouse=True)
def _bits() -> Iterator[None]:
    with working_precision(100):
        yield


def flown(start=START, omega=OMEGA, **options) -> Flight:
    """The flow from a start over `SPAN`."""
    flight = carry(model_of(SMOOTH, ball(omega)), [ball(part) for part in start], SPAN, **options)
    assert flight.status is FlowStatus.REACHED
    return flight


def gamma_y(constants, omega, state):
    return sliding_motion(sliding.BallOps, constants, omega, state)[0]


def moved(column: int, step: object) -> tuple[list, object]:
    """Start and speed, one of the four moved."""
    values = [ball(part) for part in (*START, OMEGA)]
    values[column] = values[column] + step
    return values[:3], values[3]


# --------------------------------------------------------------------------------------- a crossing and its derivatives
def test_the_rate_of_the_sliding_velocity_by_hand() -> None:
    """Against Eq. gamma_y_3DOF differentiated by hand, and against differences along the flow."""
    constants, omega = ball_constants(SMOOTH), ball(OMEGA)
    state = beta, gamma, v = tuple(map(ball, ("0.2", "1.1", "-1.3")))
    for side in (1, -1):
        rates = one_sided(side)(sliding.BallOps, constants, omega)(*state)
        # In shifted angles sin(beta) is cos(beta_bar), cos(beta) is -sin(beta_bar), and so on.
        sb, cb, sg, cg = beta.cos(), -beta.sin(), gamma.cos(), -gamma.sin()
        rho = constants.r + constants.e * sg
        slopes = (
            rho * v * cb - 2 * constants.e * omega * sb * cb * cg,
            constants.e * cg * v * sb + constants.e * omega * sb * sb * sg,
            rho * sb,
        )
        by_hand = sum((slope * rate for slope, rate in zip(slopes, rates, strict=True)), arb(0))
        assert sliding_motion(sliding.BallOps, constants, omega, state, rates[2])[1].overlaps(by_hand)
        step = arb(2) ** -40
        ahead = [part + step * rate for part, rate in zip(state, rates, strict=True)]
        quotient = (gamma_y(constants, omega, ahead) - gamma_y(constants, omega, state)) / step
        assert abs(quotient - by_hand) < arb(2) ** -25  # step times a second derivative of some thousands


def test_the_reversal_is_proved_and_counted() -> None:
    path = model_of(SMOOTH, ball(OMEGA)).path([ball(part) for part in START], Steps())
    assert isinstance(path, SlidingPath)
    sides, crossings = [path.side], 0
    while path.time < ball(SPAN):
        step = path.step()
        assert step is not None
        crossings += isinstance(step, Crossing)
        path.take(step)
        now = gamma_y(ball_constants(SMOOTH), ball(OMEGA), path.box)
        assert positive(path.side * now)
        sides.append(path.side)
    assert (crossings, path.reversals, sides[0], sides[-1]) == (1, 1, -1, 1)


def test_states_through_a_reversal_against_an_integrator_that_does_not_know_it() -> None:
    """mpmath's Runge-Kutta method of order 4 with |gamma_y| in the field, in steps so short that its kink is small."""
    context = mpmath.MPContext()
    context.prec = 80
    constants = SMOOTH.within(context)
    speed = context.mpf(OMEGA.numerator) / OMEGA.denominator
    rates, slopes = (make(shifted(context), constants, speed, "smooth") for make in (field, jacobian))

    def slope(state: list) -> list:
        """State and the derivatives by state, columns one after the other."""
        rows = slopes(*state[:3])
        columns = [state[k : k + 3] for k in (3, 6, 9)]
        return [*rates(*state[:3]), *(sum(a * b for a, b in zip(row, c, strict=True)) for c in columns for row in rows)]

    state = [context.mpf(part) for part in START] + [context.mpf(int(i == j)) for i in range(3) for j in range(3)]
    count = 2000
    step = context.mpf(SPAN) / count
    for _ in range(count):
        one = slope(state)
        two = slope([x + step / 2 * k for x, k in zip(state, one, strict=True)])
        three = slope([x + step / 2 * k for x, k in zip(state, two, strict=True)])
        four = slope([x + step * k for x, k in zip(state, three, strict=True)])
        state = [
            x + step / 6 * (a + 2 * b + 2 * c + d) for x, a, b, c, d in zip(state, one, two, three, four, strict=True)
        ]
    flight = flown(derivatives=True)
    assert flight.matrix is not None
    mine = [*flight.state, *(flight.matrix[row][column] for column in range(3) for row in range(3))]
    for enclosed, approximate in zip(mine, state, strict=True):
        # The one step over the kink costs its length cubed, (1e-5 s)^3, times the jump of a second derivative of v'
        # along the orbit, 1e4 a second cubed at most, and is amplified by derivatives of at most 1e3.
        assert abs(float(enclosed.mid()) - float(approximate)) < 1e-8
        assert float(enclosed.rad()) < 1e-20


@pytest.mark.parametrize("column", range(4), ids=("beta", "gamma", "v", "omega"))
def test_differences_of_orbits_lie_in_the_enclosed_derivatives(column: int) -> None:
    """The mean value theorem, which knows nothing of crossings: over start boxes and speeds of size 1e-6."""
    start, omega = moved(column, arb(0, ball(SIZE).upper()))
    whole = flown(start, omega, derivatives=True)
    ends = [flown(*moved(column, side * ball(SIZE))) for side in (1, -1)]
    for row in range(3):
        assert all(whole.state[row].contains(end.state[row].mid()) for end in ends)
        quotient = (ends[0].state[row] - ends[1].state[row]) / (2 * ball(SIZE))
        assert whole.matrix[row][column].overlaps(quotient)
        # v's derivatives change at the kink by some hundreds for each unit of the box, relative to their size.
        assert abs(whole.matrix[row][column] - quotient) < (1 + abs(quotient)) * ball("0.01")


def test_the_determinant_through_a_reversal_is_that_of_liouville() -> None:
    flight = flown(derivatives=True)
    (a, b, c), (d, e, f), (g, h, i) = (row[:3] for row in flight.matrix)
    determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    assert determinant.overlaps(flight.divergence.exp())
    assert float(determinant.rad()) < 1e-20


# ------------------------------------------------------------------------------------------------------- planted faults
#: From here the sliding velocity, which is negative, rises to a greatest value close to zero and falls again. It stays
#: negative for a v somewhat below -1.809586 rad/s, and is positive for a while for one above.
GRAZING = ("-0.2527", "1.0417", "-1.809586")
LATER = "0.08"  # s


def after_grazing(by: object) -> Flight:
    start = [*map(ball, GRAZING)]
    start[2] = start[2] + by
    return carry(model_of(SMOOTH, ball(OMEGA)), start, LATER)


@pytest.fixture(scope="module")
def truths() -> tuple[list, list]:
    """Ends of orbits, by the code as it is: tested above against another integrator."""
    with working_precision(100):
        return [flown(*moved(column, side * ball(SIZE))) for column in range(4) for side in (1, -1)], [
            after_grazing(ball("0.001"))
        ]


def time_of_the_reversal_forgotten(self: Crossing, time: Any, components: slice = slice(3)) -> Any:
    """The derivative of the states at the crossing, taken on for a fixed time."""
    rows = ROWS_AT(self, time, components)
    state, constants = self.first.at(self.tau), ball_constants(SMOOTH)
    rates = one_sided(-1)(sliding.BallOps, constants, ball(OMEGA))(*state)
    slope = sliding_motion(sliding.BallOps, constants, ball(OMEGA), state, rates[2])[1]
    shift = [-constants.r * row / slope for row in self.first.rows_at(self.tau)[2]]  # d(gamma_y) is about r d(v)
    return tuple(
        tuple(entry + rate * dt for entry, dt in zip(row, shift, strict=True))
        for row, rate in zip(rows, rates[components], strict=True)
    )


ROWS_AT = Crossing.rows_at
FAULTS = [
    (SlidingPath, "__init__", "model.of_side(self.side)", "model.of_side(-self.side)"),
    (SlidingPath, "_crossing", "self.model.of_side(-1 + 0 * self.side)", "self.model"),
    (SlidingPath, "take", "self.model.of_side(1 - 2 * moved)", "self.model"),
    (SlidingPath, "take", "self.side * (1 - 2 * moved)", "self.side"),
    (SlidingPath, "take", "self.reversals + moved", "self.reversals"),
    (Crossing, "rows_at", "entries[3] + row[3]", "entries[3]"),
    (Crossing, "divergence_at", "self.first.divergence_at(self.tau) + ", ""),
    (Crossing, "centre", "_since(self.middle_tau, time)", "time"),
    # The sign at a step's end is believed to tell what is between.
    (SlidingPath, "_by_pieces", "positive(polynomial(velocity, time)) |", "positive(polynomial(velocity, length)) |"),
    (SlidingPath, "_by_pieces", "falls = negative(rate)", "falls = positive(rate)"),
]


def complaint(truths: tuple[list, list]) -> str | None:
    """What the tests above see, in one: the first thing that is wrong."""
    ends, grazing = truths
    for column in range(4):
        start, omega = moved(column, arb(0, ball(SIZE).upper()))
        path = carry(model_of(SMOOTH, ball(omega)), start, SPAN, derivatives=True)
        if path.status is not FlowStatus.REACHED:
            return "not reached"
        for row in range(3):
            plus, minus = (ends[2 * column + k].state[row] for k in (0, 1))
            if not (path.state[row].contains(plus.mid()) and path.state[row].contains(minus.mid())):
                return "an orbit's end lies outside"
            if not path.matrix[row][column].overlaps((plus - minus) / (2 * ball(SIZE))):
                return "a derivative is wrong"
    thin = carry(model_of(SMOOTH, ball(OMEGA)), list(map(ball, START)), SPAN, derivatives=True)
    if thin.status is not FlowStatus.REACHED:
        return "not reached"
    (a, b, c), (d, e, f), (g, h, i) = (row[:3] for row in thin.matrix)
    if not (a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)).overlaps(thin.divergence.exp()):
        return "Liouville's formula fails"
    again = after_grazing(ball("0.001"))
    if again.status is not FlowStatus.REACHED or not again.state[2].overlaps(grazing[0].state[2]):
        return "two reversals in a short time are wrong"
    start = [ball(part) for part in START]
    path = model_of(SMOOTH, ball(OMEGA)).path(start, Steps())
    while path.time < ball(SPAN):
        step = path.step()
        if step is None:
            return "not followed"
        path.take(step)
    return None if path.reversals == 1 else "reversals are not counted"


def test_the_code_as_it_is_has_none_of_the_faults(truths: tuple[list, list]) -> None:
    assert complaint(truths) is None


@pytest.mark.parametrize(
    "fault", [pytest.param(f, id=f"{f[1]} {f[3]}", marks=[pytest.mark.slow] * (n > 2)) for n, f in enumerate(FAULTS)]
)
def test_planted_faults_are_noticed(fault: Any, truths: tuple, monkeypatch: pytest.MonkeyPatch) -> None:
    plant(monkeypatch, *fault)
    assert complaint(truths) is not None


def test_a_moving_time_of_the_reversal_is_noticed(truths: tuple, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Crossing, "rows_at", time_of_the_reversal_forgotten)
    assert complaint(truths) is not None


# ---------------------------------------------------------------------------------------------- what must not be proved
@pytest.mark.parametrize(("by", "reversals"), [("-0.001", 0), ("0.001", 2)])
def test_on_either_side_of_a_grazing_orbit_reversals_are_counted(by: str, reversals: int) -> None:
    path = model_of(SMOOTH, ball(OMEGA)).path([*map(ball, GRAZING[:2]), ball(GRAZING[2]) + ball(by)], Steps())
    while path.time < ball(LATER):
        step = path.step()
        assert step is not None
        path.take(step)
    assert path.reversals == reversals


def test_a_box_that_holds_a_grazing_orbit_is_not_followed() -> None:
    start = [*map(ball, GRAZING[:2]), ball(GRAZING[2]) + arb(0, "0.001")]
    flight = carry(model_of(SMOOTH, ball(OMEGA)), start, LATER)
    assert flight.status is FlowStatus.GRAZING
    assert flight.time < ball(LATER)


def test_a_start_on_both_sides_is_not_followed() -> None:
    """On the section gamma_y = 0 where rho v = -e Omega sin(gamma_bar)."""
    model = model_of(SMOOTH, ball(OMEGA))
    gamma = ball("1.7")
    constants = model.constants
    v = -constants.e * ball(OMEGA) * gamma.sin() / (constants.r + constants.e * gamma.cos())
    flight = half_flight(model, gamma, v)
    assert flight.status is HalfStatus.GRAZING
    assert half_flight(model, gamma, v + arb("0.001")).status is HalfStatus.RETURNED


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


@pytest.mark.slow
def test_the_linear_laws_cycle_is_none_of_the_smooth_law() -> None:
    middle = [ball(reference(f"printed/linear/limit-cycle/crit-0.5/{n}").measured().value) for n in NUMBERS[1:3]]
    own = [ball(reference(f"{PLACE}/{name}").measured().value) for name in NUMBERS[1:3]]
    for law, point, passes in (
        ("smooth", own, True),
        ("linear", own, False),
        ("smooth", middle, False),
        ("linear", middle, True),
    ):
        with working_precision(64):
            model = model_of(PRINTED.with_friction(law), ball(OMEGA))
            assert included(model, point, [abs(part) * ball("1e-9") for part in point]) is passes


# --------------------------------------------------------------------------------------------------------- limit cycles
def held(place: str, digits: int) -> None:
    """The reference data's cycle, with half-widths of some 1e-50, meets the proved intervals."""
    disk = Parameters.named(place.partition("/")[0]).with_friction("smooth")
    values = {name: reference(f"{place}/{name}").measured() for name in NUMBERS}
    omega = Fraction(reference(f"{place}/period").inputs["Omega"])
    proof = prove_cycle(disk, omega, (values["gamma_bar_0"].value, values["v_0"].value), digits=digits)
    assert proof.proved, proof.statement
    assert proof.stable
    assert proof.to_dict()["sliding_reversals"] == proof.reversals == 6
    for name, number in proof.numbers().items():
        assert abs(number.value - values[name].value) <= number.uncertainty + values[name].uncertainty, name
        assert number.uncertainty < max(1, abs(number.value)) / Fraction(10) ** digits, name


@pytest.mark.slow
def test_a_reference_cycle_lies_in_the_proved_intervals() -> None:
    held(PLACE, 16)


@pytest.mark.slow(minutes=4)
@pytest.mark.parametrize("name", ["printed", "calibrated"])
@pytest.mark.parametrize(
    "place", [f"limit-cycle/crit-{d}" for d in ("0.01", "0.3", "0.7")] + ["near-heteroclinic/het+1e-3"]
)
def test_reference_cycles_to_thirty_digits(name: str, place: str) -> None:
    held(f"{name}/smooth/{place}", 30)


@pytest.mark.slow(minutes=3)
@pytest.mark.parametrize("distance", ["0.01", "0.4", "0.7"])
def test_the_third_disk_against_the_ordinary_road(taylor, distance: str) -> None:
    disk = GEOMETRY.with_friction("smooth")
    omega = speed_below(disk, distance)
    cycle = limit_cycle(disk, omega, taylor, digits=40)
    proof = prove_cycle(disk, omega, (cycle.gamma_bar_0.value, cycle.v_0.value), digits=30)
    assert proof.proved, proof.statement
    for name, number in proof.numbers().items():
        assert number.holds(getattr(cycle, name).value), name


@pytest.mark.slow
def test_a_rotating_cycle_against_the_ordinary_road(taylor) -> None:
    cycle = rotating_cycle(SMOOTH, "30.079", taylor)
    proof = prove_cycle(SMOOTH, "30.079", (cycle.beta_bar_top.value, cycle.v_top.value), digits=12, section=TURN)
    assert proof.proved, proof.statement
    assert (proof.stable, proof.reversals) == (True, 2)
    assert "gamma_y changes its sign exactly 2 times a period and is 0 nowhere else" in proof.statement
    for name, number in proof.numbers().items():
        other = getattr(cycle, name)
        assert abs(number.value - other.value) <= number.uncertainty + other.uncertainty, name


@pytest.mark.slow
def test_the_statement_and_the_command(capsys) -> None:
    words = ["certify", "orbit", "--friction", "smooth", "--omega", f"{float(OMEGA)}", "--guess", *GUESS, "--json"]
    assert main([*words, "--digits", "6"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["proved"] is True
    assert found["sliding_reversals"] == 6
    assert "under the smooth Coulomb friction law" in found["statement"]
    assert "gamma_y changes its sign exactly 6 times a period and is 0 nowhere else" in found["statement"]
    above = prove_cycle(SMOOTH, "31.4", GUESS, digits=8, most_bits=120)
    assert above.status is not Status.PROVED


# ---------------------------------------------------------------------------------------------- Omega_h and the saddles
TRUTH = reference("printed/smooth/heteroclinic/point/omega_h").measured()


@pytest.fixture(scope="module")
def connection() -> ProvedConnection:
    return prove_connection(SMOOTH, TRUTH.value, 8)


@pytest.mark.slow
def test_the_proved_interval_holds_omega_h(connection: ProvedConnection) -> None:
    assert connection.proved
    assert connection.unique
    assert connection.upright
    assert connection.omega_h is not None
    assert connection.omega_h.holds(TRUTH.value)
    assert 2 * connection.omega_h.uncertainty <= Fraction(1, 10**8)
    assert "under the smooth Coulomb friction law there is exactly one Omega" in connection.statement
    for mine, name in zip(connection.saddle_eigenvalues, ("u", "s", "ss"), strict=True):
        other = reference(f"printed/smooth/heteroclinic/point/lambda_{name}").measured()
        assert abs(mine.value - other.value) <= mine.uncertainty + other.uncertainty


def test_nothing_is_said_of_limit_cycles_of_a_field_without_second_derivatives(connection: ProvedConnection) -> None:
    """All other hypotheses of the theorem are there."""
    assert connection.slowly
    assert connection.limit_cycle is None
    assert replace(connection, parameters=PRINTED).limit_cycle is not None


@pytest.mark.slow
def test_no_omega_h_beside_it() -> None:
    for near in ("30.0848425", "30.0488682607"):  # 3e-8 rad/s away; the linear law's
        beside = prove_connection(SMOOTH, near, 8)
        assert not beside.proved
    assert prove_connection(SMOOTH, "30.0488682607", 8).status is ConnectionStatus.NOT_NEAR


@pytest.mark.slow(minutes=2)
@pytest.mark.parametrize(("name", "digits"), [("printed", 30), ("calibrated", 12)])
def test_omega_h_to_many_digits(name: str, digits: int) -> None:
    truth = reference(f"{name}/smooth/heteroclinic/point/omega_h").measured()
    proof = prove_connection(Parameters.named(name).with_friction("smooth"), truth.value, digits)
    assert proof.proved
    assert proof.unique
    assert proof.omega_h.holds(truth.value)
    assert 2 * proof.omega_h.uncertainty <= Fraction(1, 10**digits)


@cache
def saddle_curve(along: int) -> Curve:
    """The series of one side's law."""
    speed = Fraction(round(TRUTH.value * 2**60), 2**60)
    with working_precision(160):
        values, directions = eigenvectors(SMOOTH, speed)
        saddle = Saddle(parameter_texts(SMOOTH), "smooth", ball(speed), directions.tolist())
        return series_of_curve(saddle, along, 41, values)


def on_curve(curve: Curve, along: int, wanted: float) -> list[Any]:
    """z of the ordinary road's power series where the coordinate ``along`` has the value wanted."""
    ordinary = Series(SMOOTH, Fraction(round(TRUTH.value * 2**60), 2**60), 240, 41)
    context = mpmath.MPContext()
    context.prec = 240
    s = context.mpf(wanted)
    for _ in range(60):
        parts = ordinary.unstable_curve if along == UNSTABLE else ordinary.stable_curve
        z = curve.saddle.coordinates([ball(str(context.nstr(part.at(s), 60))) for part in parts])
        s -= context.mpf(z[along].mid().str(60, radius=False)) - wanted
    return z


def other_side(curve: Curve) -> Curve:
    return Curve(curve.saddle, curve.along, curve.graph, -(curve.side or 0))


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
        plain = Curve(curve.saddle, SLOW, curve.graph, None)
        offs = [max(float(abs(x)) for x in plain.straightened(z)) for z in (truth, [-part for part in truth])]
        assert max(offs) > 1e-8


def test_a_curve_of_the_wrong_side_is_refused() -> None:
    with working_precision(160):
        theta, curve = arb(1) / 32, saddle_curve(UNSTABLE)
        curve.keeps_side(theta, (arb(0), arb(0)))
        for wrong, cone in ((other_side(curve), (arb(0), arb(0))), (curve, (arb(1), arb(1)))):  # gamma_y = 0 cuts it
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
                assert sum((matrix[row][k] * (a[k] - b[k]) for k in range(3)), arb(0)).overlaps(moved[row])
