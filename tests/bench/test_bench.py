"""The comparison of integrators: honest true values, correct errors, and failures in the figure."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tippedisk_verify.bench.measurement import Score, run_race, run_time_ratios
from tippedisk_verify.bench.methods import BENCH_METHODS, Method, MethodRun, PreparedMethod
from tippedisk_verify.bench.peers import PEERS
from tippedisk_verify.bench.problems import problem_named
from tippedisk_verify.figures.race_figure import draw_race

TRANSIENT = problem_named("transient")
#: Methods of each family, at their loosest and their tightest setting.
RACED = {
    method.name: replace(method, settings=[method.settings[n] for n in (0, -1)])
    for method in BENCH_METHODS
    if method.name in ("taylor", "scipy DOP853", "scipy Radau")
}


@pytest.fixture(scope="module")
def scores() -> list[Score]:
    return run_race([TRANSIENT], list(RACED.values()))


def test_every_method_and_setting_has_a_score(scores: list[Score]) -> None:
    expected = {(m.name, m.label(s)) for m in RACED.values() for s in m.settings}
    assert {(score.method, score.setting) for score in scores} == expected
    assert all((score.error is None) == (score.status != "reached") for score in scores)


@pytest.mark.parametrize("method", RACED)
def test_errors_fall_with_the_tolerance(method: str, scores: list[Score]) -> None:
    mine = [
        (float(s.setting), s.error) for s in scores if s.method == method and s.error is not None
    ]
    loosest, tightest = mine[0], mine[-1]
    assert tightest[1] < loosest[1] / 1e4
    # No method is off by more than its tolerance times what a stiff transient of some 30 steps adds
    # up to, and by some hundred roundings of numbers of order 10.
    for tolerance, error in mine:
        assert error < 1e3 * tolerance + 1e-13


def test_runs_that_stop_early_or_fail_are_reported_and_drawn(tmp_path: Path) -> None:
    def broken(problem: object, setting: object) -> PreparedMethod:
        if setting == "raises":
            raise ArithmeticError("no such luck")
        return PreparedMethod(lambda duration: None, lambda: MethodRun("gave up", []))

    found = run_race([TRANSIENT], [Method("broken", "none", ("stops", "raises"), broken)])
    assert [score.status for score in found] == ["gave up", "failed: no such luck"]
    assert all(score.error is None and score.seconds is None for score in found)
    axis = draw_race(found).axes[0]
    assert [text.get_text() for text in axis.texts] == ["failed"]
    drawn = [line.get_ydata()[0] for line in axis.lines if len(line.get_xdata())]
    assert len(drawn) == 1  # one mark for the method, above all errors
    assert min(drawn) > 1


def test_each_method_has_its_own_look_in_the_order_of_the_curves() -> None:
    own = [f"my {n}" for n in range(12)]
    names = [
        *(method.name for method in BENCH_METHODS),
        *(method.name for _, method in PEERS),
        *own,
    ]
    scores = [
        Score("p", name, "", "1e-6", "reached", 1e-9, None, 99.0 - n, 0.0, 0.0, 1, 1, 1e-9)
        for n, name in enumerate(names)
    ]
    slower = [
        replace(score, seconds=99.0 + n) for n, score in enumerate(scores) if score.method in own
    ]
    figure = draw_race(scores)
    assert [text.get_text() for text in figure.axes[0].texts] == ["reference"]
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == names[::-1]
    looks, alone = (
        {
            line.get_label(): (line.get_color(), line.get_marker(), line.get_markerfacecolor())
            for line in drawn.legends[0].get_lines()
        }
        for drawn in (figure, draw_race(slower))
    )
    assert len(set(looks.values())) == len(names)
    # An own method's look depends neither on its time nor on the suite's methods.
    assert alone == {name: looks[name] for name in own}


def test_ratios_name_the_fastest_within_a_bound() -> None:
    def score(family: str, setting: str, error: float | None, seconds: float) -> Score:
        return Score(
            "p", family, family, setting, "reached", error, error, seconds, 0.0, 0.0, 1, 1, 0.0
        )

    mine = [score("heyoka", "loose", 1e-7, 1.0), score("heyoka", "tight", 5e-13, 2.0)]
    scipy = [
        score("scipy", "loose", 1e-5, 10.0),
        score("scipy", "tight", 1e-9, 300.0),
        score("scipy", "x", None, 1.0),
    ]
    found = run_time_ratios(
        [*mine, *scipy, score("diffrax", "only", 1e-11, 50.0), score("reduced", "x", 1e-16, 0.1)]
    )
    bounds = [row["error_at_most"] for row in found]
    assert bounds == [1e-4, 1e-6, 1e-8, 1e-10, 1e-12]  # nobody gets to 1e-13
    assert [row["heyoka"] for row in found] == ["heyoka loose"] * 2 + ["heyoka tight"] * 3
    assert [row["scipy_over_heyoka"] for row in found] == [10.0, 300.0, 150.0, None, None]
    assert [row["peer_over_heyoka"] for row in found] == [50.0, 50.0, 25.0, 25.0, None]
    assert (found[-1]["scipy"], found[-1]["peer"], found[-1]["heyoka_seconds"]) == (None, None, 2.0)
