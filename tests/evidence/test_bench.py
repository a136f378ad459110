"""The race: truths that hold, errors that are true, failures that stay in the picture."""

from __future__ import annotations

import json
import math
from pathlib import Path

import mpmath
import pytest

from tests.problems import paper_rates
from tippedisk_verify.bench_figure import draw_bench
from tippedisk_verify.cli import main
from tippedisk_verify.evidence.bench.growth import Growth, break_even, exponent
from tippedisk_verify.evidence.bench.methods import METHODS, Method, Outcome, Prepared
from tippedisk_verify.evidence.bench.problems import PROBLEMS, problem_named, truth_of
from tippedisk_verify.evidence.bench.race import Score, machine, raced
from tippedisk_verify.model.exact import exact
from tippedisk_verify.orbits.reduced_flow import ReducedFlow

TRANSIENT = problem_named("transient")


@pytest.fixture(scope="module")
def scores() -> list[Score]:
    return raced([TRANSIENT])


def test_the_truth_is_that_of_another_integrator_and_transcription() -> None:
    """mpmath's Taylor series method on the tests' own equations, to the first sample."""
    truth = truth_of(TRANSIENT)
    with mpmath.workdps(45):
        start = [mpmath.mpf(part) for part in TRANSIENT.start]
        speed = exact(TRANSIENT.omega).rational

        def rates(t: object, y: list[mpmath.mpf]) -> list[mpmath.mpf]:
            return paper_rates(TRANSIENT.parameters, speed, tuple(y))

        state = mpmath.odefun(rates, 0, start)(mpmath.mpf(TRANSIENT.times[0]))
        for value, held in zip(state, truth.samples[0], strict=True):
            assert abs(value - mpmath.mpf(held.value.numerator) / held.value.denominator) < mpmath.mpf(10) ** -38
    assert truth.uncertainty < 1e-50


def test_every_method_and_setting_has_a_score(scores: list[Score]) -> None:
    expected = {(m.name, m.label(s)) for m in METHODS if m.fits(TRANSIENT) for s in m.settings}
    assert {(score.method, score.setting) for score in scores} == expected
    for score in scores:
        assert (score.error is None) == (score.status != "reached")
        if score.error is not None:
            assert score.error_over_samples >= score.error
            assert score.seconds is not None
            assert score.seconds > 0


@pytest.mark.parametrize("method", ["taylor", "scipy DOP853", "scipy RK45", "scipy LSODA", "scipy Radau", "scipy BDF"])
def test_errors_fall_with_the_tolerance(method: str, scores: list[Score]) -> None:
    mine = [(float(s.setting), s.error) for s in scores if s.method == method and s.error is not None]
    loosest, tightest = mine[0], mine[-1]
    assert tightest[1] < loosest[1] / 1e4
    # No method is off by more than its tolerance times what a stiff transient of some 30 steps adds up to.
    for tolerance, error in mine:
        assert error < 1e3 * tolerance + 1e-13


def test_more_bits_give_more_digits(scores: list[Score]) -> None:
    errors = {s.setting: s.error for s in scores if s.method == "taylor beyond double"}
    assert errors["extended"] < 1e-17
    assert errors["quadruple"] < 1e-31
    assert errors["50 digits"] < 1e-47


def test_phase_and_shape_make_up_the_error(scores: list[Score]) -> None:
    speed = math.sqrt(sum(rate**2 for rate in truth_of(TRANSIENT).rates))
    for score in scores:
        if score.error:
            whole = math.hypot(score.phase * speed, score.shape)
            assert score.error <= whole * 1.001
            assert whole <= score.error * math.sqrt(3) * 1.001


def test_what_breaks_off_or_fails_is_told_and_drawn(tmp_path: Path) -> None:
    def broken(problem: object, setting: object) -> Prepared:
        if setting == "raises":
            raise ArithmeticError("no such luck")
        return Prepared(lambda: None, lambda: Outcome("gave up", []))

    found = raced([TRANSIENT], [Method("broken", "none", ("stops", "raises"), broken)])
    assert [score.status for score in found] == ["gave up", "failed: no such luck"]
    assert all(score.error is None and score.seconds is None for score in found)
    figure = draw_bench(found)
    (axis,) = [axis for axis in figure.axes if axis.get_visible()]
    assert sum(line.get_marker() == "x" for line in axis.lines) == 2


def test_reduced_flows_come_closer_with_each_order() -> None:
    """From a point on the manifold, at small epsilon: the end differs by the first order left out."""
    from tippedisk_verify.flow.contract import Request
    from tippedisk_verify.flow.taylor import Taylor
    from tippedisk_verify.model.precision import DOUBLE
    from tippedisk_verify.theory.slow_manifold import orders

    parameters = problem_named("epsilon-1e-3").parameters
    constants = parameters.at(DOUBLE)
    beta, gamma, omega = 1.4, 1.9, 30.4
    series = orders(math, constants, omega, beta, gamma, 6)
    v = sum(h * constants.epsilon**n for n, h in enumerate(series))
    full = Taylor()(Request(parameters, omega, (beta, gamma, v), 0.5, domain="none")).state
    errors = []
    for order in range(3):
        _, end, _ = ReducedFlow(order)(parameters, omega, (beta, gamma), 0.5)
        errors.append(max(abs(end - full[:2])))
    assert errors[1] < errors[0] / 50
    assert errors[2] < errors[1] / 50


def test_the_command_writes_figure_and_data(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "--only", "transient", "--json", "--out", str(tmp_path)]) == 0
    result = json.loads(capsys.readouterr().out)
    assert {"problem", "method", "setting", "error", "seconds", "status"} <= set(result["runs"][0])
    assert result["machine"] == machine()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bench.csv", "bench.json", "bench.png", "bench.svg"]


def test_problems_are_named_once_and_bad_names_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert len({problem.name for problem in PROBLEMS}) == len(PROBLEMS)
    assert main(["bench", "--only", "nothing"]) == 2
    assert "problem 'nothing' is not known" in capsys.readouterr().err


def test_fitted_exponents_and_break_even() -> None:
    assert exponent([(x, 3 * x**1.7) for x in (10.0, 20.0, 40.0, 80.0)]) == pytest.approx(1.7)
    full = Growth("full", "epsilon", tuple((x, 1e-4 / x) for x in (1e-1, 1e-2, 1e-3)), -1.0)
    reduced = Growth("reduced", "epsilon", tuple((x, 1e-2 / 3) for x in (1e-1, 1e-2, 1e-3)), 0.0)
    never = Growth("slow", "epsilon", tuple((x, 1.0) for x in (1e-1, 1e-2, 1e-3)), 0.0)
    always = Growth("fast", "epsilon", tuple((x, 1e-9) for x in (1e-1, 1e-2, 1e-3)), 0.0)
    assert break_even(full, reduced) == pytest.approx(0.03)
    assert break_even(full, never) is None
    assert break_even(full, always) == 0.1


@pytest.mark.slow
def test_growth_and_start_up_are_reported(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "--only", "growth", "--only", "start-up", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert {growth["what"] for growth in result["growth"]} >= {"trajectory", "limit cycle", "Omega_h", "full"}
    assert set(result["start_up"]) >= {"python", "imports", "orbit_cold", "orbit_cached"}
