"""Integrators of one's own as methods of a race: functions, the question that a program receives,
and results measured elsewhere. After a slow run, the tighter tolerances of a method are left out.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy

from tippedisk_verify.bench.measurement import Score
from tippedisk_verify.bench.methods import TOLERANCES, Method, MethodRun, PreparedMethod
from tippedisk_verify.bench.problems import Problem, problem_named
from tippedisk_verify.bench.truth import compute_truth
from tippedisk_verify.errors import InputError
from tippedisk_verify.model.equations import STATE_NAMES
from tippedisk_verify.numbers.exact import as_list, fraction, short_text

__all__ = [
    "USER_FAMILY",
    "Solver",
    "checked_states",
    "question",
    "read_scores",
    "user_method",
]

#: A user's integrator: the states (n, 3) at ``problem.times`` to a relative tolerance.
Solver = Callable[[Problem, float], Any]
#: The family of methods that users bring.
USER_FAMILY = "own"
_MAX_RUN_SECONDS = 2.0  # s; after a longer run the tighter tolerances are left out
_COLUMNS = ("problem", "setting", "seconds")


def user_method(
    name: str,
    solver: Solver,
    tolerances: float | Sequence[float] = TOLERANCES,
    clock: Callable[[], float | None] | None = None,
) -> Method:
    """Return a user's integrator as a method of the race.

    Args:
        name: The name in the legend.
        solver: A function of a problem and a tolerance that returns the states (n, 3) at
            ``problem.times``.
        tolerances: Relative tolerances, loosest first.
        clock: The time [s] of the last call by the solver's own clock, or None for the wall clock.

    Raises:
        InputError: If a tolerance is not a positive number, or there is none.
    """

    def states(problem: Problem, tolerance: float) -> Any:
        return checked_states(solver(problem, tolerance), problem)

    def prepare(problem: Problem, tolerance: float) -> PreparedMethod:
        def run(duration: float) -> Any:
            return states(replace(problem, duration=duration), tolerance)[-1]

        return PreparedMethod(run, lambda: MethodRun("reached", states(problem, tolerance)), clock)

    return Method(
        name, USER_FAMILY, _settings(tolerances), prepare, max_run_seconds=_MAX_RUN_SECONDS
    )


def _settings(tolerances: object) -> tuple[float, ...]:
    try:
        settings = tuple(float(fraction(entry)) for entry in as_list(tolerances))
    except (InputError, OverflowError):
        settings = ()
    if not settings or min(settings) <= 0:
        raise InputError(
            f"tolerances are positive numbers such as 1e-6, not {short_text(tolerances)}"
        )
    return settings


def checked_states(answer: Any, problem: Problem) -> Any:
    """Check what a user's integrator has returned, and return it as an array of states (n, 3).

    Raises ValueError unless it has a finite state for each time.
    """
    wanted = (len(problem.times), 3)
    try:
        states = numpy.asarray(answer, float)
        what: object = states.shape
    except TypeError:
        what = type(answer).__name__
    if what != wanted:
        raise ValueError(f"the states at problem.times are an array {wanted}, not {what}")
    if not numpy.isfinite(states).all():
        raise ValueError("a state is not finite")
    return states


def question(problem: Problem, tolerance: float) -> dict[str, Any]:
    """Return a problem and a tolerance as data for one line of JSON, the question to a program over
    pipes.

    All numbers are doubles. The order of the keys is kept, for programs without a reader of JSON.
    """
    return {
        "problem": problem.name,
        "friction": problem.friction,
        "parameters": {
            name: float(value)
            for name, value in problem.parameters.rational_constants()._asdict().items()
        },
        "Omega": problem.omega,
        "tolerance": tolerance,
        "state": list(problem.start),
        "times": list(problem.times),
    }


def read_scores(file: Path, text: str) -> list[Score]:
    """Return the scores of runs that were made elsewhere.

    Args:
        file: The file, for messages. Its name without the ending is the name in the legend.
        text: CSV with the columns problem, setting, seconds, and error or beta, gamma, v (the state
            at the end).

    Raises:
        InputError: If a column is missing, a problem is unknown, or an entry is not a number. The
            message names the file and the line.
    """
    rows = csv.DictReader(text.splitlines(), restval="")
    try:
        columns = set(rows.fieldnames or ())
        if not {*_COLUMNS} <= columns or not ("error" in columns or {*STATE_NAMES} <= columns):
            raise InputError(
                f"answers need the columns {', '.join(_COLUMNS)}, and error or {', '.join(STATE_NAMES)}"
            )
        return [_score_in(file.stem, row) for row in rows]
    except InputError as fault:
        raise InputError(f"{file.name}, line {max(rows.line_num, 1)}: {fault}") from None
    except csv.Error as fault:
        raise InputError(f"{file.name}: {fault}") from None


def _score_in(name: str, row: Mapping[str, str]) -> Score:
    problem = problem_named(row["problem"])
    truth = compute_truth(problem, False)
    seconds = _number_in(row, "seconds")
    if "error" in row:
        error = _number_in(row, "error")
    else:
        error = max(
            abs(_number_in(row, component, true.value))
            for component, true in zip(STATE_NAMES, truth.samples[-1], strict=True)
        )
    if seconds <= 0 or error < 0:
        raise InputError("the time must be positive, and the error not negative")
    return Score(
        problem=problem.name,
        method=name,
        family=USER_FAMILY,
        setting=row["setting"],
        status="reached",
        error=error,
        error_over_samples=None,
        seconds=seconds,
        spread=None,
        preparation=None,
        steps=None,
        evaluations=None,
        truth_uncertainty=truth.uncertainty,
    )


def _number_in(row: Mapping[str, str], column: str, true: Fraction = Fraction(0)) -> float:
    """Return the number in a column of a row of a CSV file, minus its true value.

    The true value is zero in columns of times and errors.
    """
    try:
        return float(fraction(row[column]) - true)
    except (InputError, OverflowError):
        label = {"seconds": "time"}.get(column, column)
        raise InputError(f"the {label} '{short_text(row[column])}' is not a number") from None
