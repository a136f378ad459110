"""What the diagnosis says of orbits and cycles, where an independent program makes the mistake on a few of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from decimal import Decimal
from typing import Any

import numpy as np
import pytest
from scipy.integrate import odeint, solve_ivp
from scipy.optimize import brentq

from tests.conformance.scipy_program import motion
from tippedisk_verify.conformance.diagnosis.causes import _fit
from tippedisk_verify.conformance.diagnosis.closing import closing_of, unclosed
from tippedisk_verify.conformance.diagnosis.connection import searches
from tippedisk_verify.conformance.diagnosis.cycles import cycle_slip_of
from tippedisk_verify.conformance.diagnosis.defects import defects
from tippedisk_verify.conformance.diagnosis.integrators import fixed_steps, tolerances
from tippedisk_verify.conformance.diagnosis.orbits import events_of
from tippedisk_verify.conformance.diagnosis.quotients import quotients_of
from tippedisk_verify.conformance.diagnosis.samples import samples_of
from tippedisk_verify.conformance.diagnosis.scans import orbit_values
from tippedisk_verify.conformance.diagnosis.shooting import Family, HalfOrbits, closed_cycles, half_orbits, newton_step
from tippedisk_verify.conformance.diagnosis.speeds import answered_by, other_speeds, stopped_of
from tippedisk_verify.conformance.grading import Grade, graded
from tippedisk_verify.conformance.sheet import Answers
from tippedisk_verify.reference_values.store import Quantity, Store, stored

STATE = ("beta", "gamma", "v")
ORBITS = ("b1", "b2", "d1")
P = {"r": 0.045, "e": 2.5e-3, "m": 0.435, "A": 0.249e-3, "B": 0.227e-3, "g": 9.81, "mu": 0.3, "epsilon": 0.1}


@pytest.fixture(scope="module")
def store() -> Store:
    return stored()


def _rates(quantity: Quantity, p: dict[str, float] = P) -> Callable[[float, Any], Any]:
    def rates(t: float, y: Any) -> Any:
        gamma_rate, v_rate, _ = motion(math, p, float(quantity.inputs["Omega"]), False, [float(x) for x in y])
        return np.array([y[2], gamma_rate, v_rate])

    return rates


def _samples(store: Store, orbits: Sequence[str] = ORBITS) -> list[list[Quantity]]:
    return [[store[f"printed/linear/trajectory/{orbit}/{name}@0.5"] for name in STATE] for orbit in orbits]


def _start(quantity: Quantity) -> list[float]:
    return [float(quantity.inputs[name]) for name in STATE]


def _answers(samples: Sequence[Sequence[Quantity]], states: Sequence[Any]) -> dict[str, Decimal]:
    return {
        q.id: Decimal(float(x)) for three, y in zip(samples, states, strict=True) for q, x in zip(three, y, strict=True)
    }


def _grades(store: Store, given: dict[str, float]) -> tuple[list[Grade], set[str]]:
    grades = graded(Answers({id_: ("doubles", repr(float(x))) for id_, x in given.items()}), store)
    return grades, {grade.id for grade in grades if grade.failed}


def test_a_fixed_step_is_told_by_the_errors_that_it_makes(store: Store) -> None:
    samples, states, h = _samples(store), [], 2.5e-3
    for three in samples:
        f, y = _rates(three[0]), np.array(_start(three[0]))
        for _ in range(200):
            a = f(0, y)
            y = y + h / 2 * (a + f(0, y + h * a))
        states.append(y)
    here = [quantity for three in samples for quantity in three]
    assert fixed_steps(here, _answers(samples, states)) == "too long a step, Heun's method at a fixed step of 2.5 ms"


def test_tolerances_are_told_by_the_errors_that_they_make(store: Store) -> None:
    samples = _samples(store)
    runs = [
        solve_ivp(_rates(three[0]), (0, 10), _start(three[0]), "RK23", t_eval=[0.5], rtol=1e-4, atol=1e-6).y[:, 0]
        for three in samples
    ]
    here = [quantity for three in samples for quantity in three]
    said = "a loose tolerance, SciPy's RK23 at rtol = 0.0001, atol = 1e-06"
    assert tolerances(here, _answers(samples, runs)) == said


def test_a_tolerance_of_odeint_is_told_though_its_first_step_depends_on_its_output(store: Store) -> None:
    samples, times = _samples(store), np.arange(0, 0.501, 4e-3)
    runs = [odeint(_rates(three[0]), _start(three[0]), times, rtol=1e-4, atol=1e-6, tfirst=True) for three in samples]
    here = [quantity for three in samples for quantity in three]
    said = "a loose tolerance, SciPy's LSODA (odeint or solve_ivp) at rtol = 0.0001, atol = 1e-06"
    assert tolerances(here, _answers(samples, [run[-1] for run in runs])) == said


TIMES = np.arange(0.5, 4.1, 0.5)


def _flights(store: Store, rates: Callable[[Quantity], Callable[[float, Any], Any]] = _rates) -> dict[str, Any]:
    """Dense orbits by entry."""
    asked = [store[f"printed/linear/trajectory/{orbit}/beta@0.5"] for orbit in ORBITS]
    return {
        quantity.id.rsplit("/", 1)[0]: solve_ivp(
            rates(quantity), (0, 4.1), _start(quantity), "DOP853", rtol=1e-12, atol=1e-12, dense_output=True
        ).sol
        for quantity in asked
    }


def _sampled(flights: dict[str, Any], state: Callable[[Any, float], Any]) -> dict[str, float]:
    return {
        f"{entry}/{name}@{t:g}": float(x)
        for entry, flight in flights.items()
        for t in TIMES
        for name, x in zip(STATE, state(flight, t), strict=True)
    }


def _line(flight: Any, t: float, ends: tuple[float, float]) -> Any:
    return flight(ends[0]) + (t - ends[0]) / (ends[1] - ends[0]) * (flight(ends[1]) - flight(ends[0]))


def _on_lines(flight: Any, t: float) -> Any:
    n = math.floor(t / 0.03 + 1e-9)
    return _line(flight, t, (n * 0.03, (n + 1) * 0.03))


def _between_steps(flight: Any, t: float) -> Any:
    n = np.searchsorted(flight.ts, t)
    return _line(flight, t, (flight.ts[n - 1], flight.ts[n]))


@pytest.mark.parametrize(
    ("state", "said"),
    [
        (lambda flight, t: flight(t + 0.01), "samples are taken 0.01 s too late"),
        (lambda flight, t: flight(1.001 * t), "samples are taken at 1.001 times the time asked for"),
        (lambda flight, t: flight(0.03 * (t // 0.03)), "samples are states at the last point of a grid of 0.03 s"),
        (_on_lines, "samples are interpolated linearly between points 0.03 s apart"),
        (_between_steps, "samples are interpolated linearly between the integrator's own steps, or points of an odd "),
        (lambda flight, t: _on_lines(flight, t) * [1.0, 1.0, 1.0001], None),
        (lambda flight, t: (flight(t - 0.015) + flight(t + 0.015)) / 2, None),  # a mean, not points
    ],
)
def test_the_instants_of_samples_are_told(state: Callable[[Any, float], Any], said: str | None, store: Store) -> None:
    found = samples_of(*_grades(store, _sampled(_flights(store), state)), store)
    assert (found is None) == (said is None)
    if found is not None and said is not None:
        assert found[0][0][1].startswith(said)


@pytest.mark.parametrize(("power", "told"), [(1, True), (2, False)])
def test_a_speed_that_drifts_is_solved_for(power: int, told: bool, store: Store) -> None:
    def rates(quantity: Quantity) -> Callable[[float, Any], Any]:
        def function(t: float, y: Any) -> Any:
            speed = float(quantity.inputs["Omega"]) * (1 - 2e-3 * t**power)
            gamma_rate, v_rate, _ = motion(math, P, speed, False, [float(x) for x in y])
            return np.array([y[2], gamma_rate, v_rate])

        return function

    given = _sampled(_flights(store, rates), lambda flight, t: flight(t))
    answers = {id_: Decimal(x) for id_, x in given.items()}
    grades, wrong = _grades(store, given)
    numbers, _ = orbit_values(grades, wrong, answers, store)
    entries = [
        [store[id_] for id_ in given if id_.startswith(entry)] for entry in {id_.rsplit("/", 1)[0] for id_ in given}
    ]
    fits = [one.cause for one in numbers if _fit(one, entries, answers, wrong, store, 6) is not None]
    assert fits == (["Omega falls along orbits, by 0.002 of its first value a second"] if told else [])


@pytest.mark.parametrize(("damping", "tolerance"), [(0.01, 1e-10), (0.0, 1e-4)])
def test_small_changes_of_the_equations_leave_other_defects_than_steps(
    damping: float, tolerance: float, store: Store
) -> None:
    times, here, answers = np.arange(0.5, 10.1, 0.5), list[Quantity](), dict[str, Decimal]()
    for orbit in ("b1", "b2", "d1", "d2", "f1"):
        asked = [[store[f"printed/linear/trajectory/{orbit}/{name}@{t:g}"] for t in times] for name in STATE]
        rates = _rates(asked[0][0])
        run = solve_ivp(
            lambda t, y, rates=rates: rates(t, y) - [0.0, 0.0, damping * y[2]], (0, 10), _start(asked[0][0]), "RK45",
            t_eval=times, rtol=tolerance, atol=tolerance,
        )  # fmt: skip
        here += [quantity for row in asked for quantity in row]
        answers |= {
            q.id: Decimal(float(x)) for row, y in zip(asked, run.y, strict=True) for q, x in zip(row, y, strict=True)
        }
    found = defects(here, answers)
    assert found is not None
    largest, left = found
    # Derivatives have three digits; steps are accepted or rejected without regard to the place.
    assert largest < 0.02
    assert left < 0.03 if damping else left > 0.5


def test_another_value_in_the_orbits_equations_is_found_however_far(store: Store) -> None:
    samples = _samples(store)
    wrong_one, options = P | {"mu": 0.9}, {"method": "DOP853", "rtol": 1e-12, "atol": 1e-12}
    states = [
        solve_ivp(_rates(three[0], wrong_one), (0, 0.5), _start(three[0]), **options).y[:, -1] for three in samples
    ]
    answers = _answers(samples, states)
    grades, wrong = _grades(store, {id_: float(x) for id_, x in answers.items()})
    numbers, terms = orbit_values(grades, wrong, answers, store)
    assert "mu = 0.9 instead of 0.3" in [one.cause for one in numbers]
    assert "lambda_Ty has the extra factor 3" in [one.cause for one in terms]


def test_another_event_is_told_by_what_is_the_same_at_all_of_its_times(store: Store) -> None:
    given = {}
    for orbit in ORBITS:
        first = store[f"printed/linear/trajectory/{orbit}/crossing_time#1"]
        run = solve_ivp(
            _rates(first), (0, 3), _start(first), "DOP853", events=lambda t, y: math.cos(y[1]), rtol=1e-12, atol=1e-12
        )
        passed = [(t, y) for t, y in zip(run.t_events[0], run.y_events[0], strict=True) if t > 0.01]
        for n, (time, y) in enumerate(passed, start=1):
            for name, x in zip(("time", "gamma", "v"), (time, y[1], y[2]), strict=True):
                given[f"printed/linear/trajectory/{orbit}/crossing_{name}#{n}"] = x
    found = events_of(*_grades(store, given), store)
    assert found is not None
    (cause,) = found[0]
    assert cause[1] == "crossings are those of gamma = pi/2 on the right orbits, not of beta = pi/2"


def _cycles(store: Store, *entries: str) -> dict[str, float]:
    return {
        quantity.id: quantity.for_doubles
        for entry in entries
        for quantity in store.matching(f"printed/linear/limit-cycle/{entry}/")
    }


def test_the_fast_multiplier_in_the_slow_ones_place_is_told(store: Store) -> None:
    given = _cycles(store, "crit-0.2", "crit-0.5")
    for id_ in given:
        if id_.endswith("/multiplier_slow"):
            given[id_] = 1e-17
    found = cycle_slip_of(*_grades(store, given), store)
    assert found is not None
    assert "tiny" in found[0][0][1]


def test_right_pieces_give_the_right_derivatives_and_multipliers(store: Store) -> None:
    from tippedisk_verify.conformance.diagnosis.cycles import _pieces, numbers_of

    for friction in ("linear", "smooth"):
        here = [store[f"printed/{friction}/limit-cycle/crit-0.5/dperiod_domega"]]
        for entry, pieces in _pieces(here, store, {"": ("", None)})[""].items():
            for name, value in numbers_of(pieces).items():
                # The equations are integrated to 1e-11; their growth along half a cycle is some hundred.
                assert value == pytest.approx(store[f"{entry}/{name}"].for_doubles, rel=1e-8)


def test_a_state_a_little_off_is_said_not_to_be_closed(store: Store) -> None:
    given = _cycles(store, "crit-0.2", "crit-0.3", "crit-0.5")
    grades, wrong = _grades(store, given)
    assert closing_of(grades, wrong, store) is None
    assert unclosed(grades, wrong, store) is None
    for id_ in list(given):
        if id_.endswith(("gamma_bar_0", "v_0")):
            given[id_] += 1e-5
    found = unclosed(*_grades(store, given), store)
    assert found is not None
    assert "not closed" in found[0][0][1]


def _right(store: Store, entry: str, shift: float = 0.0) -> HalfOrbits:
    """The half orbit of a stored cycle, or of one at another speed."""
    omega = np.array([float(store[f"{entry}/period"].inputs["Omega"]) + shift])
    return closed_cycles("printed", "linear", *Family("printed", "linear", store)(omega), omega)


def _answered(store: Store, runs: dict[str, HalfOrbits]) -> dict[str, float]:
    return {f"{entry}/{name}": x for entry, run in runs.items() for name, x in answered_by(run)[0].items()}


def test_half_orbits_of_stored_cycles_have_the_stored_values(store: Store) -> None:
    entry = "printed/linear/limit-cycle/crit-0.5"
    for id_, value in _answered(store, {entry: _right(store, entry)}).items():
        assert value == pytest.approx(store[id_].for_doubles, rel=1e-8)  # as above


def test_another_origin_of_the_speeds_near_the_connection_is_told(store: Store) -> None:
    near = "printed/linear/near-heteroclinic/het+1e-"
    shift = 30.0495 - store["printed/linear/heteroclinic/point/omega_h"].for_doubles
    given = _answered(store, {f"{near}{k}": _right(store, f"{near}{k}", shift) for k in (1, 2, 3)})
    found = other_speeds(*_grades(store, given), store)
    assert found is not None
    assert "at 30.0495 rad/s plus the distance from Omega_h" in found[0][0][1]
    given[f"{near}3/multiplier_slow"] *= 1.01  # no cycle has this
    assert other_speeds(*_grades(store, given), store) is None


def test_cycles_of_a_newton_method_that_stops_are_told(store: Store) -> None:
    entries = [f"printed/linear/limit-cycle/crit-0.{k}" for k in (3, 5)]
    given, last = {}, {}
    for entry in entries:
        right = _right(store, entry)
        run = right
        for _ in range(4):  # from the guess to the section
            half = run.half + run.left()[0] / run.speed[0]
            run = half_orbits("printed", "linear", half, right.gamma.round(2), right.v.round(2), right.omega)
        given |= _answered(store, {entry: run})
        step = dict(zip(("gamma_bar_0", "v_0"), newton_step(run), strict=True))
        last |= {f"{entry}/{name}": float(x[0]) for name, x in step.items()}
    found = stopped_of(*_grades(store, given), store)
    assert found is not None
    assert "it starts at the answered (gamma_bar_0, v_0)" in found[0][0][1]
    given |= {id_: given[id_] + x for id_, x in last.items()}
    found = stopped_of(*_grades(store, given), store)
    assert found is not None
    assert "a guess of 2 decimals" in found[0][0][1]
    given[f"{entries[0]}/v_0"] += 1e-4  # no step of Newton's method
    assert stopped_of(*_grades(store, given), store) is None


@pytest.mark.parametrize(("step", "told"), [(2e-3, True), (2.7e-3, False)])
def test_differences_are_told_by_a_round_step(step: float, told: bool, store: Store) -> None:
    given = {}
    for entry in ("printed/linear/limit-cycle/crit-0.2", "printed/linear/limit-cycle/crit-0.5"):
        here, there = (_answered(store, {entry: _right(store, entry, shift)}) for shift in (0.0, step))
        names = {f"{entry}/d{name}_domega": f"{entry}/{name}" for name in ("period", "gamma_bar_0", "v_0")}
        given |= here | {id_: (there[of] - here[of]) / step for id_, of in names.items()}
    found = quotients_of(*_grades(store, given), store)
    said = "dperiod_domega, dgamma_bar_0_domega, dv_0_domega: forward differences by Omega with a step of 2e-3 rad/s"
    assert (found is not None and found[0] == (("differences", said),)) == told


def test_a_search_for_the_connection_that_starts_too_far_away_is_told(store: Store) -> None:
    def passes(omega: float) -> bool:
        def rates(t: float, y: Any) -> Any:
            gamma_rate, v_rate, _ = motion(math, P, omega, False, [float(x) for x in y])
            return np.array([y[2], gamma_rate, v_rate])

        # The eigenvector is (1, Omega/lambda, lambda), since beta' = v and gamma' = Omega (beta - pi/2).
        rate = brentq(lambda x: float(rates(0, [math.pi / 2 + 1e-6, 1e-6 * omega / x - math.pi / 2, 1e-6 * x])[2])
                      - 1e-6 * x * x, 4, 9)  # fmt: skip
        far = np.array([1, omega / rate, rate])
        start = np.array([math.pi / 2, -math.pi / 2, 0]) + 0.5 * far / np.linalg.norm(far)
        ends = [lambda t, y: y[0] - math.pi / 2 + 0.05, lambda t, y: y[1] - 3 * math.pi / 2 - 0.1]
        for end in ends:
            end.terminal = True  # type: ignore[attr-defined]
        run = solve_ivp(rates, (0, 9), start, "DOP853", events=ends, rtol=1e-10, atol=1e-10)
        return len(run.t_events[1]) > 0

    low, high = 30.04, 30.06
    right = store["printed/linear/heteroclinic/point/omega_h"].for_doubles
    for _ in range(18):  # to 1e-7
        middle = (low + high) / 2
        low, high = (middle, high) if passes(middle) else (low, middle)
    said = "the search for Omega_h starts too far away: 0.5 from the saddle along the unstable eigenvector"
    assert list(searches("printed", "linear", (low + high) / 2, right)) == [said]
    (other,) = searches("printed", "linear", low + 1e-4, right)
    assert "starts too far" not in other


def test_the_end_of_an_interval_and_few_halvings_of_it_are_told() -> None:
    (text,) = searches("printed", "linear", 30.2 + 3e-13, 30.0489)
    assert text.startswith("omega_h is the round number 30.2")
    (text,) = searches("printed", "linear", 29.8 + 0.6 * 427 / 2**10, 30.0489)  # of 29.8 to 30.4
    assert text == "omega_h is a multiple of 0.1/2^9: a bisection that stops after few steps"
