"""The studies: sweeps, run time against error, hard cases."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import click

from tippedisk_verify.commands.common import Common, Output, alone_in, command, processes, table, workers_of
from tippedisk_verify.parallel import as_done
from tippedisk_verify.progress import watched

__all__ = ["COMMANDS"]


# ------------------------------------------------------------------------------------------------ sweep
@command
@click.argument("analysis", metavar="orbit|equilibria|hopf|heteroclinic|trajectory")
def sweep(
    common: Common, analysis: str, *, over: tuple[str, ...], out: Path, executor: str = "local", jobs: int | None = None
) -> int:
    """Compute an analysis at every combination of the axes' values; interrupted, it goes on where it stopped.

    The table has the axes as they were given, the status, and each result beside its half-width (NAME_uncertainty); a
    trajectory ends at final_beta, final_gamma, final_v. Every worker of a cluster needs this version of the package.

    --over NAME=FIRST:LAST:COUNT|NAME=X,X,...  An axis: omega, below-crit, a parameter, or beta, gamma, v, duration of a
        trajectory.
    --out FILE.csv|.parquet  Where the table goes.
    """
    from tippedisk_verify.sweep.plan import Plan, axis
    from tippedisk_verify.sweep.running import swept

    plan = Plan(analysis, common.disk, tuple(axis(text) for text in over), common.digits)
    with common.progress(len(plan)) as advance:
        points, without = swept(plan, out, lambda: workers_of(executor, jobs), advance)
    line = f"{points} points, {without} of them without numbers (their status says why): {out}"
    common.show({"points": points, "without_numbers": without, "file": str(out)}, [line])
    return 0


# ------------------------------------------------------------------------------------------------ bench
@command
def bench(output: Output, peers: bool = False, only: tuple[str, ...] = (), out: str | None = None) -> int:
    """Measure run time against error: six initial-value problems.

    --peers  Race the integrators of the extra `peers`, too.
    --only PROBLEM  These only.
    --out DIR  Write figure, CSV and JSON there.
    """
    from tippedisk_verify.bench.methods import METHODS
    from tippedisk_verify.bench.peers import peer_methods
    from tippedisk_verify.bench.problems import PROBLEMS, problem_named
    from tippedisk_verify.bench.race import machine, raced, ratios

    problems = [problem_named(name) for name in dict.fromkeys(only)] or PROBLEMS
    methods = (*METHODS, *(peer_methods() if peers else ()))
    folder = alone_in(out)
    total = sum(method.fits(problem) for method in methods for problem in problems)
    # One process beside the one that is timed, for the truths.
    with output.progress(total) as advance, processes(1, needed=len(problems) > 1, beside=True) as pool:
        scores = raced(problems, methods, advance, map if pool is None else pool.map)
    runs = [score.to_dict() for score in scores]
    result: dict[str, Any] = {"machine": machine(), "runs": runs, "ratios": ratios(scores)}
    if folder is not None:
        from tippedisk_verify.report.tables import write_bench

        write_bench(folder, scores, result)
    output.show(result, _bench_lines(result))
    return 0


def _bench_lines(result: dict[str, Any]) -> Iterator[str]:
    def shown(run: dict[str, Any]) -> Iterator[str]:
        yield from (run["problem"], run["method"], run["setting"])
        yield "" if run["seconds"] is None else f"{run['seconds'] * 1e3:.4f}"
        yield "" if run["error"] is None else f"{run['error']:.1e}"
        yield "" if run["status"] == "reached" else run["status"]

    yield from table(
        ("problem", "method", "setting", "time [ms]", "error", "status"), map(list, map(shown, result["runs"]))
    )
    for one in result["ratios"]:
        others = [
            f"{label} {one[name + '_over_heyoka']:.3g} times longer ({one[name]})"
            for name, label in (("scipy", "SciPy"), ("peer", "the best peer"))
            if one[f"{name}_over_heyoka"] is not None
        ]
        ours = "heyoka does not get there" if one["heyoka"] is None else one["heyoka"]
        yield f"{one['problem']}, error at most {one['error_at_most']:.0e}: {'; '.join([ours, *others])}"


# ------------------------------------------------------------------------------------------------ stress
@command
def stress(
    output: Output, only: tuple[str, ...] = (), quick: bool = False, list_: bool = False, jobs: int | None = None
) -> int:
    """Try extreme parameters, states, tolerances and speeds: each must give digits that hold, or say what it cannot.

    --only CASE  These cases only.
    --quick  The cases that take some seconds at most.
    --list  Name the cases and the outcome that each must have.
    """
    from tippedisk_verify.stress.battery import cases_named, outcome_of

    cases = cases_named(only, quick)
    if list_:
        listing = [{"name": case.name, "says": case.says, "expected": case.expected()} for case in cases]
        lines = table(("case", "what it is", "expected"), (list(one.values()) for one in listing))
        replace(output, quiet=False).show({"cases": listing}, lines)
        return 0
    # The long ones first, so that none of them is left alone at the end.
    order = [case.name for case in sorted(cases, key=lambda case: case.quick)]
    with processes(jobs, needed=len(cases) > 1) as pool:
        by_name = dict(watched(as_done(outcome_of, order, pool), "cases", len(cases), not output.quiet))
    outcomes = [by_name[case.name] for case in cases]
    failed = [outcome.name for outcome in outcomes if not outcome.passed]
    rows = (
        (
            *("ok" if one.passed else "FAIL", one.name, one.outcome, "" if one.digits is None else f"{one.digits:.1f}"),
            f"expected: {one.expected}" + (f" ({one.note})" if one.note else ""),
        )
        for one in outcomes
    )
    passed = len(outcomes) - len(failed)
    last = f"{passed} of {len(outcomes)} cases have the outcome they must have"
    output.show(
        {
            "cases": [asdict(outcome) for outcome in outcomes],
            "summary": {"cases": len(outcomes), "passed": passed, "failed": failed},
        },
        [*table(("", "case", "outcome", "digits", ""), rows), last],
    )
    return 1 if failed else 0


COMMANDS = (sweep, bench, stress)
