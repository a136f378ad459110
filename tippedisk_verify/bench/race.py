"""A race with integrators of one's own: their run time against their error, with the suite's.

A race starts a user's program and speaks with it. The program has `_TIME_LIMIT` for each run.
"""

from __future__ import annotations

import json
import shlex
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from tippedisk_verify.bench.measurement import Score, run_race, run_time_ratios
from tippedisk_verify.bench.methods import BENCH_METHODS, TOLERANCES, Method
from tippedisk_verify.bench.problems import ErrorKind, Problem, problem_named
from tippedisk_verify.bench.truth import cut_at_returns
from tippedisk_verify.bench.user_methods import Solver, question, read_scores, user_method
from tippedisk_verify.display import Printable, data_frame
from tippedisk_verify.errors import InputError
from tippedisk_verify.numbers.exact import as_list, is_one_of, short_text
from tippedisk_verify.support.dialogue import Program, start_program
from tippedisk_verify.support.files import read_text
from tippedisk_verify.support.progress import show_progress

__all__ = ["Race", "program_method", "race"]

_DEFAULT_OPPONENTS = ("taylor", "scipy DOP853", "scipy LSODA", "scipy Radau")
_MAX_FILE_BYTES = 2**24  # bytes of a file of answers
_TIME_LIMIT = 60.0  # s that a program may take for a run


@dataclass(frozen=True, repr=False)
class Race(Printable):
    """The result of a race of integrators: the scores of every method on every problem at every
    setting.
    """

    scores: tuple[Score, ...]

    def __str__(self) -> str:
        head = f"{'problem':<14}{'method':<26}{'setting':<12}{'time [ms]':>10}{'error':>10}"
        with_heyoka = any(score.family == "heyoka" for score in self.scores)
        rows = (_comparison(row, with_heyoka) for row in run_time_ratios(self.scores))
        orders = dict.fromkeys(map(_order, self.scores))
        return "\n".join([head, *map(_line, self.scores), *filter(None, orders), *rows])

    def to_dataframe(self) -> Any:
        """Return a pandas data frame with a row for each score and the fields of `Score` as
        columns.

        Raises:
            InputError: If pandas is not installed.
        """
        return data_frame([score.to_dict() for score in self.scores])

    def plot(self, columns: int = 2) -> Any:
        """Draw the work-precision diagram of the race.

        Args:
            columns: The number of panels side by side.

        Returns:
            The matplotlib figure.
        """
        from tippedisk_verify.figures.race_figure import draw_race

        return draw_race(self.scores, columns)


def _line(score: Score) -> str:
    time = "" if score.seconds is None else f"{1000 * score.seconds:.4f}"
    error = score.status if score.error is None else f"{score.error:.1e}"
    return f"{score.problem:<14}{score.method:<26}{score.setting:<12}{time:>10} {error:>9}"


def _order(score: Score) -> str:
    if score.order is None:
        return ""
    # A tolerance or a step: only the user knows which, so this need not be an order.
    name = "exponent" if score.order_cost == "setting" else "order"
    return (
        f"{score.problem}, {score.method}: {name} {score.order:.2f} ± {score.order_error:.2f} by "
        f"{score.order_cost}, {score.order_points} points"
    )


def race(
    solvers: Mapping[str, Solver | str],
    *,
    problems: str | Problem | Sequence[str | Problem] = "cycle",
    tolerances: float | Sequence[float] = TOLERANCES,
    against: str | Sequence[str | Method] = _DEFAULT_OPPONENTS,
    answers: str | Path | Sequence[str | Path] = (),
    error: ErrorKind = "state",
    progress: bool | None = None,
) -> Race:
    """Compare integrators of one's own with the suite's and SciPy's, in speed and error.

    The methods run in turns, and warm runs are timed.

    Args:
        solvers: By name, functions of a problem and a relative tolerance that return the states
            (n, 3) at ``problem.times`` [s]: beta, gamma [rad] and v [rad/s]. ``problem.rhs(t, y)``
            evaluates the equations of motion, and ``problem.scalar_rhs`` does so for numba.
            ``problem.source("c")`` is their text for this problem, to be compiled. Instead of a
            function, the command of a program that answers over pipes is accepted as text
            (`program_method`).
        problems: Names from `bench --help`, or problems.
        tolerances: The tolerances of the solvers, loosest first. After a run of more than 2 s the
            tighter ones are left out.
        against: The methods that run as well; those of the suite by name.
        answers: CSV files of runs made elsewhere, with the columns problem, setting, seconds, and
            error or beta, gamma, v (the state at the end).
        error: ``"state"`` compares states at the end of runs of three lengths. ``"period"`` [s],
            ``"crossing"`` (gamma [rad] and v [rad/s] on the section beta = pi/2) and
            ``"amplitude"`` (largest beta [rad]) compare what a phase error does not change
            (`bench.truth`). Answers in files have only states.
        progress: False hides the progress bar.

    Returns:
        The scores, with a method that draws them. The status of a solver that fails is the reason.

    Raises:
        InputError: If a solver is neither a function nor a command, a tolerance is not a positive
            number, a problem, method or error is unknown, two of them have the same name, the
            motion has no such error, a file of answers cannot be read, or a program cannot be
            started.
    """
    if not isinstance(solvers, Mapping):
        raise InputError("solvers are a dictionary, such as {'mine': function}")
    for name, solver in solvers.items():
        if not isinstance(name, str) or not (isinstance(solver, str) or callable(solver)):
            raise InputError(
                "solvers are functions or commands by name, such as {'mine': function}, "
                f"not {short_text({name: solver})}"
            )
    if not is_one_of(error, get_args(ErrorKind)):
        raise InputError(
            f"error is one of {', '.join(get_args(ErrorKind))}, not {short_text(error)}"
        )
    chosen = [
        cut_at_returns(entry if isinstance(entry, Problem) else problem_named(entry), error)
        for entry in as_list(problems)
    ]
    methods = [
        entry if isinstance(entry, Method) else _method_named(entry) for entry in as_list(against)
    ]
    files = [_path(file) for file in as_list(answers)]
    if files and error != "state":
        raise InputError(f"files of answers have states only: leave them out for the {error}")
    _refuse_equal("problems", [problem.name for problem in chosen])
    _refuse_equal(
        "curves",
        [*solvers, *(method.name for method in methods), *(file.stem for file in files)],
    )
    elsewhere = [
        score for file in files for score in read_scores(file, read_text(file, _MAX_FILE_BYTES))
    ]
    with ExitStack() as running:
        for name, solver in solvers.items():
            methods.append(
                running.enter_context(program_method(solver, tolerances, name))
                if isinstance(solver, str)
                else user_method(name, solver, tolerances)
            )
        total = sum(method.can_solve(problem) for method in methods for problem in chosen)
        scores = run_race(chosen, methods, running.enter_context(show_progress(total, progress)))
    return Race((*scores, *elsewhere))


def _refuse_equal(kind: str, names: Sequence[str]) -> None:
    """Raise InputError if a name occurs twice."""
    for name, count in Counter(names).items():
        if count > 1:
            raise InputError(f"{count} {kind} are called '{short_text(name)}': use distinct names")


def _method_named(name: object) -> Method:
    for method in BENCH_METHODS:
        if method.name == name:
            return method
    known = "; ".join(method.name for method in BENCH_METHODS)  # names have commas
    raise InputError(f"method '{short_text(name)}' is not known: use {known}")


def _path(file: Any) -> Path:
    try:
        return Path(file)
    except TypeError:
        raise InputError(f"answers are files, not {short_text(file)}") from None


def _comparison(row: Mapping[str, Any], with_heyoka: bool) -> str:
    """Return a row of `run_time_ratios` as text; ``with_heyoka`` is True if heyoka took part."""
    parts = [row["heyoka"] or "heyoka does not reach it"] if with_heyoka else []
    for name, label in (("scipy", "SciPy"), ("peer", "the best peer"), ("own", "yours")):
        over = row[f"{name}_over_heyoka"]
        if over is not None:
            parts.append(f"{label} {over:.3g} times longer ({row[name]})")
        elif row[name]:
            parts.append(f"{label}: {row[name]}")
    return f"{row['problem']}, error at most {row['error_at_most']:.0e}: {'; '.join(parts)}"


@contextmanager
def program_method(
    command: str, tolerances: float | Sequence[float] = TOLERANCES, name: str = "program"
) -> Iterator[Method]:
    """Start a program that integrates, and yield it as a method of the race.

    It reads a line of JSON with the keys of `bench.user_methods.question` for each run. It writes
    one with the ``states`` (n, 3) at the ``times``, and with ``seconds`` if its own clock counts.

    Raises InputError if the program cannot be started.
    """
    try:
        words = shlex.split(command)
    except ValueError as fault:
        raise InputError(
            f"the command {short_text(command)} cannot be split into words: {fault}"
        ) from None
    if not words:
        raise InputError("a program needs a command")
    with start_program(words, _TIME_LIMIT) as program:
        dialogue = _ExternalIntegrator(program)
        yield user_method(name, dialogue.solve, tolerances, lambda: dialogue.seconds)


class _ExternalIntegrator:
    """An external integrator that runs as a program.

    `solve` sends it a problem and returns its states. ``seconds`` is the time that it reported for
    its last answer, or None.
    """

    def __init__(self, program: Program) -> None:
        self._program = program
        self.seconds: float | None = None

    def solve(self, problem: Problem, tolerance: float) -> Any:
        """Send a problem and a tolerance to the external program, and return the states that it
        computes.

        Raises ArithmeticError if it gives none.
        """
        waiting, lines = {problem.name}, list[str]()

        def take(line: str) -> None:
            if line.strip():
                lines.append(line)
                waiting.clear()

        broken = self._program.ask(json.dumps(question(problem, tolerance)) + "\n", waiting, take)
        if broken:
            raise ArithmeticError(self._program.end_reason(broken))
        try:
            answer = json.loads(lines[0])
            self.seconds = float(answer["seconds"]) if "seconds" in answer else None
            return answer["states"]
        except (ValueError, KeyError, TypeError) as fault:
            raise ArithmeticError(
                f"its answer is not a line of JSON with the key states: {lines[0][:40]!r}"
            ) from fault
