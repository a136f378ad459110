"""The errors on a cycle against planted ones, and the fitted order of methods of known order."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import linregress

import tippedisk_verify as tv
from tests.command_line import answer
from tippedisk_verify.bench.measurement import Score, fitted_order, run_race
from tippedisk_verify.bench.methods import BENCH_METHODS, Method, MethodRun, PreparedMethod
from tippedisk_verify.bench.problems import PROBLEMS, ErrorKind, Problem
from tippedisk_verify.bench.race import program_method
from tippedisk_verify.bench.truth import cut_at_returns, defines_error
from tippedisk_verify.bench.user_methods import user_method
from tippedisk_verify.cycles.limit_cycle import LimitCycle

#: Seven periods, in which the distance from the cycle shrinks to 2e-3 (its multiplier is 0.413).
DISK, OMEGA, DURATION = tv.Disk("table1"), 30.08, 15.0
#: The planted relative change of the speed, or of the time.
CHANGE = 1e-6
KINDS: tuple[ErrorKind, ...] = ("period", "crossing", "amplitude")


@cache
def librating_cycle_at(omega: float) -> LimitCycle:
    """Return the limit cycle at a speed."""
    return DISK.limit_cycle(omega)


@pytest.fixture(scope="module")
def problem() -> Problem:
    cycle = librating_cycle_at(OMEGA)
    start = (float(np.pi / 2), float(cycle.gamma_bar_0) + np.pi / 2, float(cycle.v_0))
    return Problem("planted", "", DISK, OMEGA, start, DURATION)


def score_of(solver: Callable[..., Any], problem: Problem, error: ErrorKind) -> Score:
    race = tv.race(
        {"mine": solver}, problems=problem, tolerances=1e-6, against=(), error=error, progress=False
    )
    (score,) = race.scores
    return score


def names_of(code: str) -> dict[str, Any]:
    """Return the names that a text of Python defines."""
    names: dict[str, Any] = {"np": np}
    exec(code, names)
    return names


_RUNGE_KUTTA = """
def runge_kutta(rhs, y, times, steps):
    states, t, y = [], 0.0, np.array(y)
    for end in times:
        h = (end - t) / steps
        for _ in range(steps):
            a = np.array(rhs(0.0, y))
            b = np.array(rhs(0.0, y + h / 2 * a))
            c = np.array(rhs(0.0, y + h / 2 * b))
            y = y + h / 6 * (a + 2 * b + 2 * c + np.array(rhs(0.0, y + h * c)))
        t = end
        states.append(y)
    return states
"""  #: One text for the function here and in the program
runge_kutta = names_of(_RUNGE_KUTTA)["runge_kutta"]


def motion(omega: float, stretch: float = 1.0, delay: float = 0.0) -> Callable[..., Any]:
    """Return a solver that gives the true states at another speed, or at other times."""

    def solver(problem: Problem, tolerance: float) -> Any:
        times = np.array(problem.times) * stretch + delay
        run = DISK.integrate(omega, problem.start, times[-1], t_eval=times, half_widths=False)
        return run.y.T

    return solver


@pytest.mark.parametrize("error", KINDS)
def test_the_error_of_another_speed_is_that_of_its_cycle(
    problem: Problem, error: ErrorKind
) -> None:
    other = OMEGA * (1 + CHANGE)
    ours, theirs = librating_cycle_at(OMEGA), librating_cycle_at(other)
    names = {"period": ["period"], "crossing": ["gamma_bar_0", "v_0"], "amplitude": ["beta_max"]}
    expected = max(abs(float(getattr(theirs, n) - getattr(ours, n))) for n in names[error])
    score = score_of(motion(other), problem, error)
    # Two digits: 2e-3 of the way to the other cycle is left, and the phase is 1.3e-3 of the period.
    assert score.error == pytest.approx(expected, rel=0.005)
    assert score.error_of == error
    # The truth of a race in doubles has some 28 digits, of numbers up to some hundred.
    assert score.truth_uncertainty < 1e-25


def test_a_slow_clock_has_an_error_of_the_period_and_no_other(problem: Problem) -> None:
    slow, late = motion(OMEGA, 1 + CHANGE), motion(OMEGA, delay=1e-3)
    period = float(librating_cycle_at(OMEGA).period)
    assert score_of(slow, problem, "period").error == pytest.approx(period * CHANGE, rel=0.005)
    # The state at the end is off by its rate, about 1 rad/s, times the phase of 1.5e-5 s or 1e-3 s.
    assert (score_of(slow, problem, "state").error or 0) > 1e-6
    # Others are off by the rounding of the two runs in doubles only: a few thousand roundings of
    # 15 s, of 2^-49 each.
    for solver, error in (
        (slow, "crossing"),
        (slow, "amplitude"),
        *((late, kind) for kind in KINDS),
    ):
        assert (score_of(solver, problem, error).error or 0) < 1e-11


def test_a_run_far_from_the_true_crossing_has_no_error(problem: Problem) -> None:
    score = score_of(motion(OMEGA, delay=0.5), problem, "period")
    assert (score.error, score.status) == (
        None,
        "no error: the phase is more than half a sample interval off",
    )


def test_a_program_and_the_suites_methods_have_these_errors(tmp_path: Path) -> None:
    cycle = cut_at_returns(tv.problem_named("cycle"), "period")

    def rk4(problem: Problem, tolerance: float) -> Any:
        return runge_kutta(problem.scalar_rhs, problem.start, problem.times, 30)

    script = tmp_path / "mine.py"
    script.write_text(
        f"import json\nimport numpy as np\n{cycle.source('python')}\n\n{_RUNGE_KUTTA}\n"
        "while True:\n    q = json.loads(input())\n"
        "    states = runge_kutta(rhs, q['state'], q['times'], 30)\n"
        "    print(json.dumps({'states': [list(y) for y in states]}), flush=True)\n"
    )
    with program_method(f"{sys.executable} {script}", 1e-6) as program:
        suite = [one for one in BENCH_METHODS if one.name in ("taylor", "scipy LSODA, compiled")]
        scores = run_race([cycle], [program, user_method("mine", rk4, 1e-6), *suite])
    by = {(score.method, score.setting): score.error or 1.0 for score in scores}
    # Both do the same arithmetic. Rounding is below 1e-13 s.
    assert by["program", "1e-06"] == pytest.approx(by["mine", "1e-06"], abs=1e-13)
    for method, loose, tight in (
        ("taylor", "1e-03", "1e-12"),
        ("scipy LSODA, compiled", "1e-04", "1e-10"),
    ):
        assert by[method, tight] < by[method, loose] / 1e3


def test_problems_whose_motion_does_not_return_are_left_out() -> None:
    names = [problem.name for problem in PROBLEMS if defines_error(problem, "crossing")]
    assert names == ["cycle", "passage", "smooth", "epsilon-1e-3"]


def test_the_command_writes_the_error_and_its_unit(tmp_path: Path, monkeypatch: Any) -> None:
    taylor = next(method for method in BENCH_METHODS if method.name == "taylor")
    monkeypatch.setattr("tippedisk_verify.bench.methods.BENCH_METHODS", (taylor,))
    result = answer(f"bench --only cycle --error period --out {tmp_path / 'out'}")
    assert {run["error_of"] for run in result["runs"]} == {"period"}
    header, first, *_ = (tmp_path / "out" / "bench.csv").read_text().splitlines()
    assert {"error [s]", "truth uncertainty [s]", "order [1]"} < set(header.split(","))
    assert first.split(",")[-1] == result["runs"][0]["order_cost"] == "setting"


# ------------------------------------------------------------------------------------- the order
@pytest.mark.parametrize("setting", ["count", "step"])
def test_a_method_of_fixed_steps_has_its_order(setting: str) -> None:
    problem, counts = tv.problem_named("transient"), [8, 16, 32, 64]

    def solver(problem: Problem, value: float) -> Any:
        steps = value if setting == "count" else problem.times[0] / value
        return runge_kutta(problem.scalar_rhs, problem.start, problem.times, round(steps))

    settings = counts if setting == "count" else [problem.times[0] / count for count in counts]
    race = tv.race({"mine": solver}, problems=problem, tolerances=settings, against=())
    assert len({score.order for score in race.scores}) == 1
    score, *_ = race.scores
    assert (score.order_points, score.order_cost) == (4, "setting")
    # The next term of the error is smaller by the largest step times the fast rate, 130 per second.
    assert abs(score.order - 4) < score.order_error + 130 * problem.times[0] / 8
    assert f"exponent {score.order:.2f} ± {score.order_error:.2f} by setting, 4 points" in str(race)


def test_a_fit_is_linear_regression_by_the_counter_that_rises() -> None:
    evaluations, errors = [100, 210, 390, 800], [1e-2, 4e-4, 6e-5, 3e-6]
    fit = fitted_order(evaluations, errors, "evaluations", 0.0)
    line = linregress(np.log(evaluations), np.log(errors))
    # Some hundred roundings; the slope's error is of the residuals, a tenth of the logarithms
    assert fit[:2] == pytest.approx((-line.slope, line.stderr), rel=1000 * 2.0**-53)
    assert fit[2:] == (4, "evaluations")


@pytest.mark.parametrize(
    ("errors", "uncertainty", "points"),
    [
        ([1e-2, 1e-4, 1e-6, 1e-8, 1.2e-8, 0.9e-8], 0.0, 3),  # a plateau at 1e-8
        ([1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12], 1e-9, 3),  # a rough reference
        ([1e-6, 1e-9, 1e-12, 1e-14, 0.0, 1e-18], 0.0, 3),  # the rounding of doubles
        ([1e-2, 1e-4, 1e-4, 1e-4, 1e-4, 1e-4], 0.0, None),
        ([1e-2, 1e-4], 0.0, None),
        ([], 0.0, None),
    ],
)
def test_points_on_a_floor_are_not_fitted(
    errors: list[float], uncertainty: float, points: int | None
) -> None:
    fit = fitted_order([10.0**-n for n in range(len(errors))], errors, "setting", uncertainty)
    assert (fit and fit.order_points) == points
    if fit is not None:
        ratio = errors[1] / errors[0]
        # Some hundred roundings
        assert fit.order == pytest.approx(-np.log10(ratio), rel=100 * 2.0**-53)


def test_a_counter_is_used_if_it_rises_with_each_setting() -> None:
    def method(name: str, evaluations: dict[float, int]) -> Method:
        def prepare(problem: Problem, setting: float) -> PreparedMethod:
            run = motion(problem.omega * (1 + setting))
            return PreparedMethod(
                lambda end: run(replace(problem, duration=end), setting)[-1],
                lambda: MethodRun("reached", run(problem, setting), None, evaluations[setting]),
            )

        return Method(name, "none", tuple(evaluations), prepare)

    rising = method("rising", {1e-2: 10, 1e-3: 20, 1e-4: 40})
    falling = method("falling", {1e-2: 40, 1e-3: 20, 1e-4: 40})
    scores = run_race([tv.problem_named("transient")], [rising, falling])
    costs = {score.method: score.order_cost for score in scores}
    assert costs == {"rising": "evaluations", "falling": "setting"}
    orders = {score.method: score.order for score in scores}
    # The error is proportional to the setting, up to the second order in the largest, 1e-2.
    assert orders["falling"] == pytest.approx(1, abs=0.05)
    assert orders["rising"] == pytest.approx(np.log(10) / np.log(2), rel=0.05)
