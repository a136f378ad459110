"""Integrators that users bring to the race: functions, a C program over pipes, and a file of
answers.
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import tippedisk_verify as tv
from tests.command_line import answer, assert_refused, ran
from tippedisk_verify.bench.measurement import machine_facts, run_race
from tippedisk_verify.bench.problems import PROBLEMS, Problem, problem_named
from tippedisk_verify.bench.race import program_method
from tippedisk_verify.bench.user_methods import question, user_method

TRANSIENT = problem_named("transient")
PAGE = (Path(__file__).parents[2] / "docs" / "choosing_an_integrator.md").read_text(
    encoding="utf-8"
)
#: The first lines of files of answers.
ERRORS, STATES = "problem,setting,seconds,error\n", "problem,setting,seconds,beta,gamma,v\n"
#: The fourth-order Runge-Kutta method of the page, for its program in C.
ADVANCE = r"""
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
static void advance(double *y, double t, double end, double tolerance) {
    static const double part[] = {0.5, 0.5, 1, 0}, weight[] = {1, 2, 2, 1};
    int steps = (int)(4 / pow(tolerance, 0.25));
    double h = (end - t) / steps;
    for (int n = 0; n < steps; n++) {
        double z[3] = {y[0], y[1], y[2]}, sum[3] = {0, 0, 0}, slope[3];
        for (int stage = 0; stage < 4; stage++) {
            rhs(t, z, slope);
            for (int i = 0; i < 3; i++) {
                sum[i] += weight[stage] * slope[i];
                z[i] = y[i] + part[stage] * h * slope[i];
            }
        }
        for (int i = 0; i < 3; i++) y[i] += h / 6 * sum[i];
    }
}
"""


def blocks(language: str) -> list[str]:
    """Return the code of the page in a language, block by block."""
    return re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)


class Plain(ModuleType):
    """A replacement of numba that compiles nothing."""

    def __init__(self) -> None:
        super().__init__("numba")
        self.njit = lambda function: function


def independent_errors(states: np.ndarray) -> np.ndarray:
    """Return the errors (n, 3) of states at the problem's times, by a run to 20 digits."""
    disk, times = tv.Disk("table1"), TRANSIENT.times
    true = disk.integrate(TRANSIENT.omega, TRANSIENT.start, times[-1], t_eval=times, digits=20)
    return abs(states - true.y.T.astype(float))


# ----------------------------------------------------------------------------------- the page
ANSWERS = re.findall(r"^## ([^\n]+)\n\n```python\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize(
    ("need", "code"),
    [
        pytest.param(
            *answer,
            id=answer[0],
            marks=pytest.mark.slow(minutes=0.1) if answer[0] == "Next to Omega_h" else (),
        )
        for answer in ANSWERS
    ],
)
def test_an_answer_of_the_page_runs_and_is_as_accurate_as_it_says(need: str, code: str) -> None:
    names: dict[str, Any] = {}
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        exec(code, names)
    assert len([line for line in code.splitlines() if line]) <= 5
    for line, said in zip(
        output.getvalue().splitlines(), re.findall(r"  # (.+)$", code, re.MULTILINE), strict=False
    ):
        assert line.startswith(said.removesuffix("..."))
    if "sol" in names:
        bound = float(need.split()[-1]) if need.startswith("An error of") else 1e-8
        sol, disk = names["sol"], names["disk"]
        true = disk.integrate("30.4", names["start"], sol.t[-1], digits=16)
        assert abs(sol.y.astype(float) - true.y.astype(float)).max() < bound


@pytest.fixture
def page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., dict[str, Any]]:
    """Return a function that runs code of the page in a folder, races at given tolerances."""
    if importlib.util.find_spec("numba") is None:
        monkeypatch.setitem(sys.modules, "numba", Plain())
    monkeypatch.chdir(tmp_path)

    def run(code: str, *tolerances: float) -> dict[str, Any]:
        names: dict[str, Any] = {}
        monkeypatch.setattr(tv, "race", partial(tv.race, tolerances=tolerances))
        exec(code, names)
        return names

    return run


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
def test_four_integrators_of_the_page_race_in_one_diagram(
    page: Callable[..., dict[str, Any]],
) -> None:
    """Run SciPy's, numba's (in plain Python without numba), the one in C and the file of answers.

    Errors are compared with those of another run, to two digits.
    """
    (program,), (answers,) = blocks("c"), blocks("text")
    (text_of_problem,) = re.findall(r"`(tv\.problem_named\(.*?\)\.source\(\"c\"\))`", PAGE)
    Path("mine.c").write_text(eval(text_of_problem, {"tv": tv}) + ADVANCE + program)
    subprocess.run(["cc", "-O2", "-o", "mine", "mine.c", "-lm"], check=True)
    Path("elsewhere.csv").write_text(answers)
    *_, bdf, rk4, race, _ = blocks("python")
    for code in (bdf, rk4, program):
        written = [line for line in code.splitlines() if re.search(r"\w", line)]
        assert len([line for line in written if "import" not in line]) <= 15
    names = page(bdf + rk4 + race, 1e-4, 1e-6)
    found = {(score.method, score.setting): score for score in names["race"].scores}
    for tolerance in (1e-4, 1e-6):
        setting = f"{tolerance:.0e}"
        for label, solver in (("my BDF", "my_bdf"), ("my RK4", "my_rk4"), ("my C", "my_rk4")):
            error = independent_errors(np.array(names[solver](TRANSIENT, tolerance))).max()
            assert found[label, setting].error_over_samples == pytest.approx(error, rel=0.01)
            assert found[label, setting].seconds is not None
    end = np.array(answers.splitlines()[1].split(",")[3:], float)
    error = independent_errors(np.tile(end, (20, 1)))[-1].max()
    assert found["elsewhere", "1e-6"].error == pytest.approx(error, rel=0.01)
    assert found["elsewhere", "1e-6"].seconds == 0.02
    assert "times longer (my" in str(names["race"])
    assert Path("race.png").stat().st_size > 10_000
    (panel,) = names["race"].plot().axes
    assert {"my BDF", "my RK4", "my C", "elsewhere"} <= {line.get_label() for line in panel.lines}


def test_the_error_of_the_period_on_the_page(page: Callable[..., dict[str, Any]]) -> None:
    *_, rk4, _, near = blocks("python")
    names = page(rk4 + near, 1e-4, 1e-5, 1e-6)
    mine = [score for score in names["race"].scores if score.method == "my RK4"]
    assert {score.error_of for score in mine} == {"period"}
    # Steps of tolerance^(1/4) and a method of order 4; the first steps are a fifteenth of a period.
    assert mine[0].order == pytest.approx(1, abs=0.1)
    assert Path("period.png").stat().st_size > 10_000
    assert "error of the period [s]" in names["race"].plot().axes[0].get_ylabel()


# ------------------------------------------------------------------------------------ the rest
@pytest.mark.parametrize("language", ["C", "fortran", None, ["c"]], ids=str)
def test_a_source_in_another_language_is_refused(language: Any) -> None:
    with pytest.raises(tv.InputError, match="use python or c"):
        PROBLEMS[0].source(language)


@pytest.mark.parametrize("problem", PROBLEMS, ids=lambda problem: problem.name)
def test_the_text_of_the_equations_is_the_right_hand_side(problem: Problem) -> None:
    random = np.random.default_rng(7)
    for _ in range(20):
        y = random.uniform([0.3, -3, -5], [2.8, 6, 5])
        # Some hundred roundings of a double
        assert np.allclose(problem.scalar_rhs(0, y), problem.rhs(0, y), rtol=1e-13)


@pytest.mark.slow(minutes=0.5)
def test_the_command_writes_a_program_and_runs_made_elsewhere(tmp_path: Path) -> None:
    program, answers, folder = tmp_path / "mine.py", tmp_path / "elsewhere.csv", tmp_path / "out"
    program.write_text(
        "import json\nwhile True:\n    state = json.loads(input())['state']\n"
        "    print(json.dumps({'states': [state] * 20, 'seconds': 2.5}), flush=True)\n"
    )
    answers.write_text("problem,setting,seconds,error\ntransient,loose,0.02,1e-5\n")
    command = f"bench --only transient --program '{sys.executable} {program}' --answers {answers}"
    result = answer(f"{command} --out {folder}")
    assert result["machine"] == machine_facts()
    runs = result["runs"]
    assert {"problem", "method", "setting", "error", "seconds", "status"} <= set(runs[0])
    assert json.loads((folder / "bench.json").read_text())["runs"] == runs
    assert len((folder / "bench.csv").read_text().splitlines()) == len(runs) + 1
    assert {"bench.png", "bench.svg"} < {path.name for path in folder.iterdir()}
    mine, other = (
        [run for run in runs if run["method"] == name]
        for name in (f"{sys.executable} {program}", "elsewhere")
    )
    assert [run["setting"] for run in mine] == ["1e-04", "1e-06", "1e-08", "1e-10", "1e-12"]
    # By the program's own clock
    assert (mine[0]["status"], mine[0]["seconds"]) == ("reached", 2.5)
    assert mine[1]["status"].startswith("not run: the setting before took 2.5 s")
    assert [(run["seconds"], run["error"]) for run in other] == [(0.02, 1e-5)]


def test_a_file_of_answers_without_times_and_errors_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "elsewhere.csv"
    for text, said in (
        ("problem,setting\ntransient,1\n", "line 1: answers need the columns problem, setting"),
        (
            f"{ERRORS}transient,1,1,1\n\ntransient,1,0.1,x\n",
            "line 4: the error 'x' is not a number",
        ),
        (f"{ERRORS}transient,1,oops,1\n", "line 2: the time 'oops' is not a number"),
        (f"{ERRORS}transient,1\n", "line 2: the time '' is not a number"),
        (f"{ERRORS}transient,1,0,1\n", "line 2: the time must be positive"),
        (f"{ERRORS}transient,1,1,-1\n", "and the error not negative"),
        (f"{ERRORS}transient,1,nan,1\n", "line 2: the time 'nan' is not a number"),
        (f"{ERRORS}nowhere,1,0.1,1\n", "line 2: problem 'nowhere' is not known"),
        (f"{STATES}transient,1,1,1,1,1e400\n", "line 2: the v '1e400' is not a number"),
        (f"{ERRORS}{'1' * 200_000},1,1,1\n", "elsewhere.csv: field larger than field limit"),
    ):
        file.write_text(text)
        line = assert_refused(["bench", "--only", "transient", "--answers", str(file)])
        assert "elsewhere.csv" in line
        assert said in line


@pytest.mark.parametrize(
    ("solver", "said"),
    [
        (
            lambda problem, tolerance: np.zeros((2, 3)),
            "the states at problem.times are an array (20, 3)",
        ),
        (lambda problem, tolerance: problem, "an array (20, 3), not Problem"),
        (lambda problem, tolerance: np.full((20, 3), np.nan), "a state is not finite"),
        (lambda problem, tolerance: 1 / 0, "division by zero"),
    ],
)
def test_a_solver_that_fails_has_a_score_that_says_why(solver: object, said: str) -> None:
    race = tv.race({"bad": solver}, problems="transient", tolerances=1e-6, against=())
    (score,) = race.scores
    assert score.status.startswith("failed: ")
    assert said in score.status
    with pytest.raises(tv.InputError, match="solvers are a dictionary"):
        tv.race(solver)


@pytest.mark.parametrize("command", [False, True])
@pytest.mark.parametrize(
    "tolerances", ["abc", [-1], [], 0, None, [1e-6, "x"], float("nan"), "1e400", [[1e-6]], {}]
)
def test_tolerances_that_are_not_positive_numbers_are_refused(
    tolerances: Any, command: bool
) -> None:
    solver = sys.executable if command else len
    with pytest.raises(tv.InputError, match=r"^tolerances are positive numbers such as 1e-6, not"):
        tv.race({"mine": solver}, tolerances=tolerances, against=())


def test_tolerances_may_be_numbers_of_any_kind() -> None:
    kinds = (1e-6, "1e-6", ["1e-4", 1e-6], np.array([1e-4, 1e-6]), (np.float32(0.5), 1))
    assert [user_method("mine", len, one).settings for one in kinds] == [
        (1e-6,),
        (1e-6,),
        (1e-4, 1e-6),
        (1e-4, 1e-6),
        (0.5, 1.0),
    ]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"solvers": {"x": 3}}, "solvers are functions or commands by name, .*not {'x': 3}"),
        ({"solvers": {3: len}}, "solvers are functions or commands by name"),
        ({"problems": 3}, "problem '3' is not known: use cycle"),
        ({"problems": [["cycle"]]}, "is not known: use cycle"),
        ({"against": 3}, "method '3' is not known: use bare heyoka"),
        ({"against": [["taylor"]]}, "is not known: use bare heyoka"),
        ({"answers": 3}, "answers are files, not 3"),
        ({"error": "phase"}, "error is one of state, period, crossing, amplitude, not phase"),
        ({"error": "period", "answers": "x.csv"}, "files of answers have states only"),
        (
            {"error": "period", "problems": "transient"},
            "transient has no error of period: its motion does not return to beta = pi/2",
        ),
        ({"problems": ["cycle", "cycle"]}, "2 problems are called 'cycle': use distinct names"),
        ({"against": ["taylor"], "solvers": {"taylor": len}}, "2 curves are called 'taylor'"),
        ({"answers": ["a/x.csv", "b/x.csv"]}, "2 curves are called 'x': use distinct names"),
    ],
)
def test_what_cannot_race_is_refused(wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(tv.InputError, match=said) as refused:
        tv.race(**{"solvers": {}, "against": (), "problems": (), **wrong})
    assert len(str(refused.value).splitlines()) == 1


def test_a_program_without_an_answer_ends_the_command_with_status_1(tmp_path: Path) -> None:
    script, command = tmp_path / "mine.py", f"{sys.executable} {tmp_path / 'mine.py'}"
    script.write_text("import sys\nsys.exit('there is no file of coefficients')\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tippedisk_verify.bench.methods.BENCH_METHODS", ())
        done = ran(["bench", "--only", "transient", "--quiet", "--program", command])
        assert (done.status, done.out) == (1, "")
        (line,) = done.err.splitlines()
        assert line.endswith("before it answered transient: there is no file of coefficients")
        assert line.startswith(f"no run of {command[:40]}")
        answers = tmp_path / "elsewhere.csv"
        answers.write_text(f"{ERRORS}transient,1,1,1\n")
        assert ran(["bench", "--only", "transient", "--answers", str(answers)]).status == 0


def test_the_page_has_the_problems_and_all_keys_of_a_question() -> None:
    asked = question(TRANSIENT, 1e-6)
    keys = re.findall(r"^\| `(\w+)` \|", PAGE, re.MULTILINE)
    assert keys == list(asked)
    (names,) = re.findall(r"^\| `problem` \| (.*) \|$", PAGE, re.MULTILINE)
    assert re.findall(r"`(.*?)`", names) == [problem.name for problem in PROBLEMS]
    (constants,) = re.findall(r"^(The `parameters` are .*?)\n\n", PAGE, re.DOTALL | re.MULTILINE)
    _, *described = re.findall(r"`(\w+)`", constants)
    assert sorted(described) == sorted(asked["parameters"])
    assert f"--only {TRANSIENT.name} --program ./mine" in PAGE


def test_a_program_that_cannot_race_says_why(tmp_path: Path) -> None:
    for text, said in (
        ("pass", "ended with status 0 before it answered"),
        ("import sys; sys.exit('no licence')", "status 1 before it answered transient: no licence"),
        (
            "import os, sys, time; os.close(1); time.sleep(0.1); sys.exit('shut')",
            "status 1 before it answered transient: shut",
        ),
        ("input(); print('states')", "its answer is not a line of JSON with the key states: "),
        ("""input(); print('{"states": [[1, 2, 3]]}')""", "are an array (20, 3), not (1, 3)"),
    ):
        script = tmp_path / "program.py"
        script.write_text(text)
        with program_method(f"{sys.executable} {script}", [1e-6]) as method:
            (score,) = run_race([TRANSIENT], [method])
        assert said in score.status
