"""Integrators that users bring to the race: functions, a C program over pipes, and a file of
answers.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tippedisk_verify as tv
from tests.command_line import assert_refused, printed
from tippedisk_verify.bench.problems import PROBLEMS, Problem, problem_named
from tippedisk_verify.bench.race import Score, raced
from tippedisk_verify.figures.own_race import program_method

TRANSIENT = problem_named("transient")
#: A fourth-order Runge-Kutta method behind the equations' C text: one line of numbers in, one line
#: of JSON out.
C_PROGRAM = r"""
#include <stdio.h>
static double number(const char *line, const char *key) {
    double x = 0; const char *at = strstr(line, key);
    if (at) sscanf(at + strlen(key), "%lf", &x);
    return x;
}
int main(void) {
    static char line[65536];
    while (fgets(line, sizeof line, stdin)) {
        double y[3], a[3], b[3], c[3], d[3], z[3], t = 0, times[20];
        const char *at = strstr(line, "\"state\": [") + 10;
        sscanf(at, "%lf, %lf, %lf", y, y + 1, y + 2);
        at = strstr(line, "\"times\": [") + 10;
        for (int n = 0; n < 20; n++) { times[n] = strtod(at, (char **)&at); at++; }
        int steps = (int)(4 / pow(number(line, "\"tolerance\": "), 0.25));
        printf("{\"seconds\": 0.5, \"states\": [");
        for (int n = 0; n < 20; n++) {
            double h = (times[n] - t) / steps;
            for (int k = 0; k < steps; k++) {
                rhs(t, y, a);
                for (int i = 0; i < 3; i++) z[i] = y[i] + h / 2 * a[i];
                rhs(t, z, b);
                for (int i = 0; i < 3; i++) z[i] = y[i] + h / 2 * b[i];
                rhs(t, z, c);
                for (int i = 0; i < 3; i++) z[i] = y[i] + h * c[i];
                rhs(t, z, d);
                for (int i = 0; i < 3; i++) y[i] += h / 6 * (a[i] + 2 * b[i] + 2 * c[i] + d[i]);
            }
            t = times[n];
            printf("%s[%.17g, %.17g, %.17g]", n ? ", " : "", y[0], y[1], y[2]);
        }
        printf("]}\n"); fflush(stdout);
    }
    return 0;
}
"""


def scipys(problem: Problem, tolerance: float) -> np.ndarray:
    options = {"method": "DOP853", "rtol": tolerance, "atol": tolerance, "t_eval": problem.times}
    return solve_ivp(problem.rhs, (0, problem.duration), problem.start, **options).y.T


def runge_kutta(problem: Problem, tolerance: float) -> np.ndarray:
    namespace: dict[str, object] = {}
    exec(problem.source("python"), namespace)
    rhs, y, t, states = namespace["rhs"], np.array(problem.start), 0.0, []
    steps = int(4 / tolerance**0.25)
    for end in problem.times:
        h = (end - t) / steps
        for _ in range(steps):
            a = np.array(rhs(t, y))
            b = np.array(rhs(t, y + h / 2 * a))
            c = np.array(rhs(t, y + h / 2 * b))
            y = y + h / 6 * (a + 2 * b + 2 * c + np.array(rhs(t, y + h * c)))
        t = end
        states.append(y)
    return np.array(states)


def independent_error(problem: Problem, states: np.ndarray) -> float:
    """Return the largest error at the race's stops by a run to 20 digits at the same doubles."""
    disk = tv.Disk(problem.parameters.name, friction=problem.friction)
    found = disk.integrate(
        problem.omega, problem.start, problem.times[-1], t_eval=problem.times, digits=20
    )
    away = [abs(states[n, k] - float(found.y[k, n])) for n in range(20) for k in range(3)]
    return max(away)


@pytest.fixture(scope="module")
def found() -> dict[tuple[str, str], Score]:
    solvers = {"scipy": scipys, "RK4": runge_kutta}
    race = tv.race(
        solvers, problems=["transient"], tolerances=[1e-4, 1e-8], against=["taylor"], progress=False
    )
    assert "RK4" in str(race)
    axes = race.plot(1).axes
    assert len(axes) == 1
    return {(score.method, score.setting): score for score in race.scores}


@pytest.mark.parametrize(("name", "solver"), [("scipy", scipys), ("RK4", runge_kutta)])
@pytest.mark.parametrize("tolerance", [1e-4, 1e-8])
def test_errors_are_those_that_another_run_finds(
    found: dict[tuple[str, str], Score], name: str, solver: object, tolerance: float
) -> None:
    score = found[name, f"{tolerance:.0e}"]
    error = independent_error(TRANSIENT, solver(TRANSIENT, tolerance))  # type: ignore[operator]
    assert score.error_over_samples == pytest.approx(error, rel=0.01, abs=1e-15)
    assert score.seconds is not None


@pytest.mark.parametrize("problem", PROBLEMS, ids=lambda problem: problem.name)
def test_the_text_of_the_equations_is_the_right_hand_side(problem: Problem) -> None:
    namespace: dict[str, object] = {}
    exec(problem.source("python"), namespace)
    random = np.random.default_rng(7)
    for _ in range(20):
        y = random.uniform([0.3, -3, -5], [2.8, 6, 5])
        assert np.allclose(namespace["rhs"](0, y), problem.rhs(0, y), rtol=1e-13)  # type: ignore[operator]


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
@pytest.mark.slow(minutes=0.3)
def test_a_program_in_c_races_over_pipes(tmp_path: Path) -> None:
    source, program = tmp_path / "rk4.c", tmp_path / "rk4"
    source.write_text(
        "#include <stdlib.h>\n#include <string.h>\n" + TRANSIENT.source("c") + C_PROGRAM
    )
    subprocess.run(["cc", "-O2", "-o", str(program), str(source), "-lm"], check=True)
    folder = tmp_path / "out"
    printed(f"bench --only transient --program {program} --out {folder} --quiet")
    runs = json.loads((folder / "bench.json").read_text())["runs"]
    mine = {run["setting"]: run for run in runs if run["method"] == "rk4"}
    assert list(mine) == ["1e-04", "1e-06", "1e-08", "1e-10", "1e-12"]
    assert mine["1e-04"]["status"] == "reached"
    # By the program's own clock
    assert mine["1e-06"]["status"].startswith("not run: the setting before took 0.5 s")
    expected = independent_error(TRANSIENT, runge_kutta(TRANSIENT, 1e-4))
    assert mine["1e-04"]["error_over_samples"] == pytest.approx(expected, rel=0.01)
    assert mine["1e-04"]["seconds"] == 0.5


def test_runs_made_elsewhere_are_shown(tmp_path: Path) -> None:
    file = tmp_path / "elsewhere.csv"
    beta, gamma, v = map(float, scipys(TRANSIENT, 1e-6)[-1])
    file.write_text(
        f"problem,setting,seconds,beta,gamma,v\ntransient,1e-6,0.02,{beta!r},{gamma!r},{v!r}\n"
    )
    race = tv.race({}, problems=["transient"], against=[], answers=[file], progress=False)
    (score,) = race.scores
    right = (
        tv.Disk("table1")
        .integrate(TRANSIENT.omega, TRANSIENT.start, TRANSIENT.duration, digits=20)
        .end.state
    )
    away = max(abs(mine - float(true)) for mine, true in zip((beta, gamma, v), right, strict=True))
    assert (score.method, score.seconds) == ("elsewhere", 0.02)
    assert score.error == pytest.approx(away, rel=0.01)
    for text, said in (
        ("problem,setting\ntransient,1\n", "need the columns problem, setting, seconds"),
        ("problem,setting,seconds,error\ntransient,1,0.1,x\n", "has no time and error"),
        ("problem,setting,seconds,error\nnowhere,1,0.1,1\n", "problem 'nowhere' is not known"),
    ):
        file.write_text(text)
        assert said in assert_refused(["bench", "--only", "transient", "--answers", str(file)])


@pytest.mark.parametrize(
    ("solver", "said"),
    [
        (
            lambda problem, tolerance: np.zeros((2, 3)),
            "the states at problem.times are an array (20, 3)",
        ),
        (lambda problem, tolerance: np.full((20, 3), np.nan), "a state is not finite"),
        (lambda problem, tolerance: 1 / 0, "division by zero"),
    ],
)
def test_a_solver_that_fails_has_a_score_that_says_why(solver: object, said: str) -> None:
    race = tv.race(
        {"bad": solver}, problems=["transient"], tolerances=[1e-6], against=[], progress=False
    )
    (score,) = race.scores
    assert score.status.startswith("failed: ")
    assert said in score.status


def test_a_program_that_cannot_race_says_why(tmp_path: Path) -> None:
    for text, said in (
        ("pass", "ended with status 0 before it answered"),
        ("input(); print('states')", "its line of JSON has no states"),
        ("""input(); print('{"states": [[1, 2, 3]]}')""", "are an array (20, 3), not (1, 3)"),
    ):
        script = tmp_path / "program.py"
        script.write_text(text)
        with program_method(f"{sys.executable} {script}", [1e-6]) as method:
            (score,) = raced([TRANSIENT], [method])
        assert said in score.status
