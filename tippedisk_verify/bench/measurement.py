"""The measurement of run time and error of several methods.

The methods run in turns, so that a busy machine slows all of them alike.
"""

from __future__ import annotations

import math
import os
import platform
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import dropwhile
from typing import Any, NamedTuple

from tippedisk_verify.bench.methods import BENCH_METHODS, Method, MethodRun, PreparedMethod
from tippedisk_verify.bench.problems import PROBLEMS, ErrorKind, Problem
from tippedisk_verify.bench.truth import Truth, compared_numbers, compute_truth
from tippedisk_verify.display import Printable
from tippedisk_verify.numbers.exact import fraction
from tippedisk_verify.support.parallel import usable_cores
from tippedisk_verify.support.provenance import processor, versions

__all__ = ["Order", "Score", "fitted_order", "machine_facts", "run_race", "run_time_ratios"]

_MAX_REPEATS = 5  # at most
_BRIEF_RUN = 0.03  # s; longer runs are repeated less often
_LONG_RUN = 0.3  # s; longer runs are not repeated
_MAX_REASON = 300  # characters of the reason of a failed run
_ERROR_BOUNDS = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-13)  # of the error, for the ratios
_ROUNDING = 2.0**-49  # rad, rad/s or s; two ulps of the largest components, between 4 and 8
_ABOVE_FLOOR = 10  # then the floor changes the logarithm of an error by a tenth at most
_PLATEAU = 1.5  # less than 2, by which an error of first order falls if the steps are halved
_MIN_POINTS = 3  # two always lie on a line
# The group that each family is compared in.
_GROUPS = {
    "heyoka": "heyoka",
    "scipy": "scipy",
    "cvode": "peer",
    "diffrax": "peer",
    "numbalsoda": "peer",
    "own": "own",
}


@dataclass(frozen=True, repr=False)
class Score(Printable):
    """The result of one integrator at one setting on one problem: its errors and run times.

    Errors are absolute. They are None if the run did not reach the end.

    The order is the exponent p of error ~ cost^-p, or of error ~ setting^p where no cost is counted
    (with a setting that grows towards smaller errors: setting^-p). It is that of all settings of
    the method on the problem, by least squares of the logarithms, and None if fewer than three
    points lie above the reference's uncertainty and rounding (`fitted_order`).
    """

    problem: str
    method: str
    family: str
    setting: str
    status: str  #: "reached", or the reason why it was not
    #: largest over the components at the ends of runs of three lengths [rad, rad/s], or the error
    #: of a cycle's number (``error_of``)
    error: float | None
    #: of the states at the samples, with the method's own interpolation: the largest [rad, rad/s]
    error_over_samples: float | None
    seconds: float | None  #: median of the repeats, warm
    spread: float | None  #: (largest - smallest) / median of the repeats
    #: [s] compiling (or loading from the code cache) and the first run, or the time until it failed
    preparation: float | None
    steps: int | None
    evaluations: int | None
    truth_uncertainty: float
    error_of: ErrorKind = "state"  #: `bench.truth` defines the errors and their units
    order: float | None = None
    order_error: float | None = None  #: the standard error of the order
    order_points: int = 0  #: the number of settings that were fitted
    order_cost: str | None = None  #: "evaluations", "steps" or "setting"


class Order(NamedTuple):
    """The fields of the order in a `Score`."""

    order: float
    order_error: float
    order_points: int
    order_cost: str


@dataclass
class _Entry:
    """The runs of one method at one setting on one problem."""

    problem: Problem
    method: Method
    setting: Any
    status: str = ""
    prepared: PreparedMethod | None = None
    outcome: MethodRun | None = None
    #: by sample index: the end of a separate run
    ends: dict[int, Any] = field(default_factory=dict)
    preparation: float | None = None
    seconds: list[float] = field(default_factory=list)


def run_race(
    problems: Sequence[Problem] = PROBLEMS,
    methods: Sequence[Method] = BENCH_METHODS,
    advance: Callable[[str, int], None] = lambda label, steps: None,
) -> list[Score]:
    """Run every integrator at every setting on every problem that it can solve, and return the
    scores.

    Args:
        problems: The problems.
        methods: The methods.
        advance: A function that is called with a label and 1 before each method.

    Returns:
        A score for each run, failed ones included.
    """
    scores = []
    # Quadruple precision is enough to measure the errors of all settings except these.
    accurate = any({"quadruple", "50 digits"} & set(method.settings) for method in methods)
    for problem in problems:
        entries = []
        for method in methods:
            if method.can_solve(problem):
                advance(f"{problem.name}: {method.name}", 1)
                entries += _first_runs(problem, method)
        for repeat in range(_MAX_REPEATS - 1):
            for entry in entries:
                if (
                    entry.prepared
                    and entry.seconds
                    and entry.seconds[0] <= (_BRIEF_RUN if repeat else _LONG_RUN)
                ):
                    if entry.seconds[0] <= _BRIEF_RUN:
                        entry.prepared.run(problem.duration)  # fill the caches again
                    entry.seconds.append(_timed_run(entry.prepared, problem.duration)[0])
        truth = compute_truth(problem, accurate)
        for method in methods:
            mine = [entry for entry in entries if entry.method is method]
            settings = [entry.setting for entry in mine]
            scores += _with_order([_score(entry, truth) for entry in mine], settings)
    return scores


def _timed(action: Callable[[], Any]) -> tuple[float, Any]:
    begin = time.perf_counter()
    result = action()
    return time.perf_counter() - begin, result


def _timed_run(prepared: PreparedMethod, duration: float) -> tuple[float, Any]:
    """Run a prepared integrator once. Return the seconds of the run, by its own clock if it has
    one, and the state at the end.
    """
    seconds, state = _timed(partial(prepared.run, duration))
    own = prepared.clock() if prepared.clock else None
    return seconds if own is None else own, state


def _first_runs(problem: Problem, method: Method) -> list[_Entry]:
    """Prepare a method, and run it once cold and once warm, at each setting.

    Returns an entry for each setting. After a long run, the tighter settings are left out, and
    their status says so.
    """
    entries = []
    longest = 0.0
    for setting in method.settings:
        entry = _Entry(problem, method, setting)
        entries.append(entry)
        if longest > method.max_run_seconds:
            entry.status = f"not run: the setting before took {longest:.1f} s"
            continue
        begin = time.perf_counter()
        try:
            entry.prepared = method.prepare(problem, setting)
            entry.outcome = entry.prepared.run_with_samples()
            entry.preparation = time.perf_counter() - begin
            entry.status = entry.outcome.status
            if entry.status == "reached":
                for stop in problem.stops:
                    warm, entry.ends[stop] = _timed_run(entry.prepared, problem.times[stop])
                entry.seconds = [warm]
                longest = max(longest, warm)
        except (ArithmeticError, ValueError, RuntimeError) as fault:
            reason = (
                str(fault).splitlines()[0][:_MAX_REASON] if str(fault) else type(fault).__name__
            )
            entry.status = f"failed: {reason}"
            entry.prepared, entry.preparation = None, time.perf_counter() - begin
    return entries


def _score(entry: _Entry, truth: Truth) -> Score:
    error = over_samples = None
    seconds = statistics.median(entry.seconds) if entry.seconds else None
    outcome = entry.outcome
    if entry.status == "reached" and outcome and len(outcome.samples) == len(truth.samples):
        over_samples = max(
            abs(float(fraction(value) - true.value))
            for state, row in zip(outcome.samples, truth.samples, strict=True)
            for value, true in zip(state, row, strict=True)
        )
        try:
            found = compared_numbers(entry.problem, list(entry.ends.values()), truth.precision)
            pairs = zip(found, truth.numbers, strict=True)
            error = max(abs(float(number - true.value)) for number, true in pairs)
        except ArithmeticError as fault:
            entry.status = f"no error: {fault}"
    return Score(
        problem=entry.problem.name,
        method=entry.method.name,
        family=entry.method.family,
        setting=entry.method.label(entry.setting),
        status=entry.status,
        error=error,
        error_over_samples=over_samples,
        seconds=seconds,
        spread=(max(entry.seconds) - min(entry.seconds)) / seconds
        if entry.seconds and seconds
        else None,
        preparation=entry.preparation,
        steps=None if outcome is None else outcome.steps,
        evaluations=None if outcome is None else outcome.evaluations,
        truth_uncertainty=truth.uncertainty,
        error_of=entry.problem.error,
    )


def _with_order(scores: list[Score], settings: Sequence[Any]) -> list[Score]:
    """Return one method's scores on one problem with the order that they show."""
    if not all(isinstance(setting, float) for setting in settings):
        return scores  # of precisions and digits there is none
    pairs = [pair for pair in zip(scores, settings, strict=True) if pair[0].error is not None]
    found = [score for score, _ in pairs]
    errors = [score.error or 0.0 for score in found]
    costs: dict[str, list[float]] = {
        "evaluations": [score.evaluations or 0 for score in found],
        "steps": [score.steps or 0 for score in found],
        "setting": [setting for _, setting in pairs],
    }
    # The steps of a method whose own order grows with the tolerance may fall.
    rising = (name for name, counts in costs.items() if sorted({*counts, 0}) == [0, *counts])
    cost = next(rising, "setting")
    floor = max((score.truth_uncertainty for score in found), default=0.0)
    order = fitted_order(costs[cost], errors, cost, floor)
    return scores if order is None else [replace(score, **order._asdict()) for score in scores]


def fitted_order(
    costs: Sequence[float], errors: Sequence[float], cost: str, uncertainty: float
) -> Order | None:
    """Fit the exponent by which errors fall with the cost, or with the setting.

    A point counts if its error is ten times above three floors: the uncertainty of the reference,
    the rounding of a state in doubles, and the plateau of the method. The plateau begins with the
    first error below 1.5 times the smallest one, if more follow, and is as high as the largest.

    Args:
        costs: (n,) the counts or settings, loosest first.
        errors: (n,) the errors.
        cost: The name of what is counted; "setting" stands for tolerances, steps or step counts.
        uncertainty: The uncertainty of the reference.

    Returns:
        The order, positive if errors fall; None with fewer than three points.
    """
    smallest = min(errors, default=0.0)
    after = dropwhile(lambda error: error >= _PLATEAU * smallest, errors)
    _, *rest = plateau = list(after) or [0.0]
    floor = max(uncertainty, _ROUNDING, max(plateau) if rest else 0.0)
    points = [
        (math.log(count), math.log(error))
        for count, error in zip(costs, errors, strict=True)
        if error > _ABOVE_FLOOR * floor
    ]
    if len({count for count, _ in points}) < _MIN_POINTS:
        return None
    import numpy

    x, y = numpy.transpose(points)
    (slope, _), covariance = numpy.polyfit(x, y, 1, cov=True)
    falls = -1 if cost != "setting" or x[-1] > x[0] else 1
    return Order(falls * float(slope), math.sqrt(abs(float(covariance[0, 0]))), len(points), cost)


def run_time_ratios(scores: Sequence[Score]) -> list[dict[str, Any]]:
    """Compare the run times of groups of integrators: the fastest runs within each bound of the
    error.

    Args:
        scores: The scores.

    Returns:
        A row for each problem and bound, with the fastest method and setting of each group.
        ``scipy_over_heyoka``, ``peer_over_heyoka`` and ``own_over_heyoka`` are ratios of run times.
        An entry is None if no run of a group is within the bound. Bounds that no run reaches are
        left out.
    """
    rows: list[dict[str, Any]] = []
    timed = (score for score in scores if score.seconds and score.family in _GROUPS)
    slowest_first = sorted(timed, key=lambda score: score.seconds or 0.0)[::-1]
    for problem in dict.fromkeys(score.problem for score in scores):
        for bound in _ERROR_BOUNDS:
            best = {
                _GROUPS[score.family]: score
                for score in slowest_first
                if score.problem == problem and score.error is not None and score.error <= bound
            }
            if best:
                rows.append({"problem": problem, "error_at_most": bound} | _run_time_row(best))
    return rows


def _run_time_row(best: dict[str, Score]) -> dict[str, Any]:
    labels = {group: f"{score.method} {score.setting}" for group, score in best.items()}
    seconds = {group: score.seconds or 0.0 for group, score in best.items()}
    ours = seconds.get("heyoka")
    row: dict[str, Any] = {"heyoka": labels.get("heyoka"), "heyoka_seconds": ours}
    for group in ("scipy", "peer", "own"):
        over = None if ours is None or group not in seconds else seconds[group] / ours
        row |= {group: labels.get(group), f"{group}_over_heyoka": over}
    return row


def machine_facts() -> dict[str, Any]:
    """Return the processor, cores and package versions of this machine."""
    from tippedisk_verify.flow.jit import heyoka_module

    return {
        "processor": processor(),
        "cores": os.cpu_count(),
        "usable_cores": usable_cores(),
        "simd_lanes": int(heyoka_module().recommended_simd_size()),
        "python": platform.python_version(),
        **versions(("tippedisk-verify", "heyoka", "numpy", "scipy")),
    }
