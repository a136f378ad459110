"""The measurement of run time and error of several methods.

The methods run in turns, so that a busy machine slows all of them alike.
"""

from __future__ import annotations

import os
import platform
import statistics
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from tippedisk_verify.bench.methods import METHODS, Method, MethodRun, Prepared
from tippedisk_verify.bench.problems import PROBLEMS, STOPS, Problem, Truth, truth_of
from tippedisk_verify.model.exact import fraction
from tippedisk_verify.model.results import Printable
from tippedisk_verify.parallel import usable_cores
from tippedisk_verify.provenance import processor, versions

__all__ = ["Score", "machine", "raced", "ratios"]

_MAX_REPEATS = 5  # at most
_BRIEF_RUN = 0.03  # s; longer runs are repeated less often
_LONG_RUN = 0.3  # s; longer runs are not repeated
_MAX_REASON = 300  # characters of the reason of a failed run
_ERROR_BOUNDS = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-13)  # of the error, for the ratios
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

    Errors are absolute, in rad and rad/s. They are None if the run did not reach the end.
    """

    problem: str
    method: str
    family: str
    setting: str
    status: str  #: "reached", or the reason why it was not
    error: float | None  #: largest over the components at the ends of runs of three lengths
    error_over_samples: float | None  #: largest at the samples, with the method's own interpolation
    seconds: float | None  #: median of the repeats, warm
    spread: float | None  #: (largest - smallest) / median of the repeats
    #: [s] compiling (or loading from the code cache) and the first run, or the time until it failed
    preparation: float | None
    steps: int | None
    evaluations: int | None
    truth_uncertainty: float


@dataclass
class _Entry:
    problem: Problem
    method: Method
    setting: Any
    status: str = ""
    prepared: Prepared | None = None
    outcome: MethodRun | None = None
    ends: dict[int, Any] = field(default_factory=dict)  # by sample index: the end of a separate run
    preparation: float | None = None
    seconds: list[float] = field(default_factory=list)


def raced(
    problems: Sequence[Problem] = PROBLEMS,
    methods: Sequence[Method] = METHODS,
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
    sharp = any({"quadruple", "50 digits"} & set(method.settings) for method in methods)
    for problem in problems:
        entries = []
        for method in methods:
            if method.fits(problem):
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
        truth = truth_of(problem, sharp)
        scores += [_score(entry, truth) for entry in entries]
    return scores


def _timed(action: Callable[[], Any]) -> tuple[float, Any]:
    begin = time.perf_counter()
    result = action()
    return time.perf_counter() - begin, result


def _timed_run(prepared: Prepared, duration: float) -> tuple[float, Any]:
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
        if longest > method.patience:
            entry.status = f"not run: the setting before took {longest:.1f} s"
            continue
        begin = time.perf_counter()
        try:
            entry.prepared = method.prepare(problem, setting)
            entry.outcome = entry.prepared.sampled()
            entry.preparation = time.perf_counter() - begin
            entry.status = entry.outcome.status
            if entry.status == "reached":
                for stop in STOPS:
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
    reached = entry.status == "reached" and entry.outcome is not None
    error, over_samples = (
        _errors(entry.outcome, entry.ends, truth) if reached and entry.outcome else (None, None)
    )
    seconds = statistics.median(entry.seconds) if entry.seconds else None
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
        steps=None if entry.outcome is None else entry.outcome.steps,
        evaluations=None if entry.outcome is None else entry.outcome.evaluations,
        truth_uncertainty=truth.uncertainty,
    )


def _errors(
    outcome: MethodRun, stopped: dict[int, Any], truth: Truth
) -> tuple[float | None, float | None]:
    """Return the largest errors of a run's results at the end and at the sample times.

    Both are None if samples are missing. The true values are exact, so differences are exact in any
    precision.
    """
    if len(outcome.samples) != len(truth.samples):
        return None, None

    def away(states: Iterable[Any], right: Iterable[Any]) -> float:
        pairs = (
            pair
            for row, true in zip(states, right, strict=True)
            for pair in zip(row, true, strict=True)
        )
        return max(abs(float(fraction(value) - true.value)) for value, true in pairs)

    return away(stopped.values(), [truth.samples[stop] for stop in stopped]), away(
        outcome.samples, truth.samples
    )


def ratios(scores: Sequence[Score]) -> list[dict[str, Any]]:
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
    for problem in dict.fromkeys(score.problem for score in scores):
        for bound in _ERROR_BOUNDS:
            best: dict[str, Score] = {}
            for score in scores:
                within = (
                    score.problem == problem and score.error is not None and score.error <= bound
                )
                group = _GROUPS.get(score.family)
                if within and group and score.seconds:
                    best[group] = min(
                        best.get(group, score), score, key=lambda run: run.seconds or 0.0
                    )
            if best:
                rows.append({"problem": problem, "error_at_most": bound} | _row(best))
    return rows


def _row(best: dict[str, Score]) -> dict[str, Any]:
    labels = {group: f"{score.method} {score.setting}" for group, score in best.items()}
    seconds = {group: score.seconds or 0.0 for group, score in best.items()}
    ours = seconds.get("heyoka")
    row: dict[str, Any] = {"heyoka": labels.get("heyoka"), "heyoka_seconds": ours}
    for group in ("scipy", "peer", "own"):
        over = None if ours is None or group not in seconds else seconds[group] / ours
        row |= {group: labels.get(group), f"{group}_over_heyoka": over}
    return row


def machine() -> dict[str, Any]:
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
