"""A program that can only be asked, on the problems of the race: one point in each panel."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping, Sequence
from decimal import Decimal
from fractions import Fraction

from tippedisk_verify.bench.problems import STOPS, Problem, truth_of
from tippedisk_verify.bench.race import Score
from tippedisk_verify.model.parameters import SYMBOLS

__all__ = ["Ask", "scores_by_asking"]

#: Asks questions at once: the answers that are numbers, by id, and the seconds until the last of them.
Ask = Callable[[Sequence[Mapping[str, str]]], tuple[Mapping[str, Decimal], float]]
_STATE = (("beta", "rad"), ("gamma", "rad"), ("v", "rad/s"))
_REPEATS = 5
_LONG = 1.0  # s; what takes longer is not repeated


def scores_by_asking(
    name: str, ask: Ask, problems: Sequence[Problem], advance: Callable[[str, int], None]
) -> list[Score]:
    """Its time to the end of each problem, warm, and its error at the ends of runs of three lengths.

    The time is that of three questions, for beta, gamma and v, with their way there and back. A program may remember
    its runs, so each repeat starts elsewhere, by 1e-9 in gamma. A problem that it does not answer is left out.
    """
    scores = []
    for problem in problems:
        advance(f"{problem.name}: {name}", 1)
        state, cold = _asked(ask, problem, problem.duration, _REPEATS)
        if not state:
            continue
        runs = [_asked(ask, problem, problem.duration, 0)]
        more = range(1, _REPEATS if runs[0][1] < _LONG else 1)
        runs += [_asked(ask, problem, problem.duration, repeat) for repeat in more]
        stopped = [runs[0][0], *(_asked(ask, problem, problem.times[stop], 0)[0] for stop in STOPS[:-1])]
        if not all(stopped):
            continue
        right = [truth_of(problem).samples[stop] for stop in (STOPS[-1], *STOPS[:-1])]
        seconds = [spent for _, spent in runs]
        middle = statistics.median(seconds)
        scores.append(
            Score(
                problem=problem.name,
                method=name,
                family="asked",
                setting="as asked",
                status="reached",
                error=max(
                    abs(float(Fraction(part) - truth.value))
                    for state, row in zip(stopped, right, strict=True)
                    for part, truth in zip(state, row, strict=True)
                ),
                error_over_samples=None,
                phase=None,
                shape=None,
                seconds=middle,
                spread=(max(seconds) - min(seconds)) / middle,
                preparation=cold,
                steps=None,
                evaluations=None,
                truth_uncertainty=truth_of(problem).uncertainty,
            )
        )
    return scores


def _asked(ask: Ask, problem: Problem, t: float, repeat: int) -> tuple[list[Decimal], float]:
    """The state that it gives at t, or nothing if any of it is missing, and the seconds."""
    beta, gamma, v = problem.start
    parameters = problem.parameters.decimals()
    inputs = {"Omega": problem.omega, "beta": beta, "gamma": gamma + 1e-9 * repeat, "v": v, "t": t}
    rows = [
        {
            "id": f"race/{problem.name}/{repeat}/{quantity}@{t!r}",
            "level": "6",
            "kind": "trajectory",
            "set": problem.parameters.name,
            "friction": problem.friction,
            "quantity": quantity,
            "unit": unit,
            **{name: parameters[name] for name in SYMBOLS},
            # Exactly the doubles, so that a program with more digits starts from the same state.
            **{name: f"{Decimal(value):f}" for name, value in inputs.items()},
            "from": "",
            "answer": "",
        }
        for quantity, unit in _STATE
    ]
    answers, seconds = ask(rows)
    state = [answers[row["id"]] for row in rows if row["id"] in answers]
    return state if len(state) == len(rows) else [], seconds
