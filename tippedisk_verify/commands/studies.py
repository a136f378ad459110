"""The commands `sweep`, `bench` and `stress`: studies at many points, of run time, of hard cases."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from tippedisk_verify.commands.definition import DiskOptions, OutputOptions, command, disk_command
from tippedisk_verify.commands.jobs import (
    checked_executor,
    jobs_option,
    process_pool,
    worker_executor,
)
from tippedisk_verify.commands.options import (
    lock_output_folder,
    option_callback,
    output_file_callback,
)
from tippedisk_verify.commands.tables import table
from tippedisk_verify.numbers.exact import short_text
from tippedisk_verify.support.files import write_csv, write_text
from tippedisk_verify.support.parallel import results_as_completed
from tippedisk_verify.support.progress import with_progress

__all__ = ["COMMANDS"]


# ------------------------------------------------------------------------------------------- sweep
@disk_command(
    """Run an analysis at every combination of the axes' values.

    An interrupted sweep continues where it stopped. The table has the axes, the status, and each
    result with its half-width (NAME_uncertainty). A trajectory ends at final_beta, final_gamma,
    final_v. Every worker of a cluster needs this version of the package.
    """
)
@click.argument("analysis", metavar="orbit|equilibria|hopf|heteroclinic|trajectory")
@click.option(
    "--over",
    multiple=True,
    required=True,
    metavar="NAME=FIRST:LAST:COUNT|NAME=X,X,...",
    help="An axis: omega, below-crit, a parameter, or beta, gamma, v, duration of a trajectory.",
)
@click.option(
    "--out",
    callback=output_file_callback(".csv", ".parquet"),
    required=True,
    metavar="FILE.csv|.parquet",
    help="The table to write.",
)
@click.option(
    "--executor",
    callback=option_callback(checked_executor),
    default="local",
    show_default=True,
    metavar="serial|local|dask://HOST:PORT",
    help="Run in one process, on all cores of this machine, or on a cluster.",
)
@jobs_option
def sweep(
    common: DiskOptions,
    analysis: str,
    over: tuple[str, ...],
    out: Path,
    executor: str,
    jobs: int | None,
) -> int:
    from tippedisk_verify.sweep.plan import SweepPlan, parse_axis
    from tippedisk_verify.sweep.running import run_sweep

    plan = SweepPlan(analysis, common.disk, tuple(parse_axis(text) for text in over), common.digits)
    with common.progress(len(plan)) as advance:
        points, without = run_sweep(plan, out, lambda: worker_executor(executor, jobs), advance)
    line = f"{points} points, {without} of them without results (see their status): {out}"
    common.show({"points": points, "without_numbers": without, "file": str(out)}, [line])
    return 0


# ------------------------------------------------------------------------------------------- bench
@command("Measure run time against error: six initial-value problems.")
@click.option("--peers", is_flag=True, help="Include the integrators of the extra `peers`.")
@click.option(
    "--only",
    multiple=True,
    metavar="PROBLEM",
    help="Run only this problem: cycle, transient, passage, smooth, epsilon-1e-3 or epsilon-1e-4.",
)
@click.option(
    "--error",
    default="state",
    metavar="state|period|crossing|amplitude",
    help="Measure the error of this: the state at the end, or, whatever the phase, the period, the "
    "crossing of beta = pi/2, or the largest beta.",
)
@click.option("--program", metavar="COMMAND", help="Race a program that answers over pipes, too.")
@click.option("--answers", multiple=True, metavar="FILE.csv", help="Show runs made elsewhere, too.")
@click.option("--out", metavar="DIR", help="Write a figure, CSV and JSON there.")
def bench(
    output: OutputOptions,
    peers: bool,
    only: tuple[str, ...],
    error: Any,
    program: str | None,
    answers: tuple[str, ...],
    out: str | None,
) -> int:
    from tippedisk_verify.bench.measurement import machine_facts, run_time_ratios
    from tippedisk_verify.bench.methods import BENCH_METHODS
    from tippedisk_verify.bench.peers import peer_methods
    from tippedisk_verify.bench.problems import PROBLEMS
    from tippedisk_verify.bench.race import race
    from tippedisk_verify.bench.truth import defines_error

    folder = lock_output_folder(out)
    found = race(
        {} if program is None else {program: program},
        problems=tuple(dict.fromkeys(only))
        or [problem for problem in PROBLEMS if defines_error(problem, error)],
        against=(*BENCH_METHODS, *(peer_methods() if peers else ())),
        answers=answers,
        error=error,
        progress=not output.quiet,
    )
    runs = [score.to_dict() for score in found.scores]
    result: dict[str, Any] = {
        "machine": machine_facts(),
        "runs": runs,
        "ratios": run_time_ratios(found.scores),
    }
    if folder is not None:
        from tippedisk_verify.figures.race_figure import race_csv
        from tippedisk_verify.figures.style import save

        write_text(folder / "bench.json", json.dumps(result, indent=1) + "\n")
        write_csv(folder / "bench.csv", *race_csv(found.scores))
        save(found.plot(), folder, "bench")
    output.show(result, str(found).splitlines())
    mine = [score for score in found.scores if score.method == program]
    if mine and all(score.error is None for score in mine):
        click.echo(
            f"no run of {short_text(program)} reached the end; the first {mine[0].status}", err=True
        )
        return 1
    return 0


# ------------------------------------------------------------------------------------------ stress
@command(
    "Try extreme parameters, states, tolerances and speeds: each must give correct digits, or "
    "a clear refusal."
)
@click.option("--only", multiple=True, metavar="CASE", help="Run only this case.")
@click.option("--quick", is_flag=True, help="Run only cases that take some seconds at most.")
@click.option("--list", "list_", is_flag=True, help="List the cases and their required outcomes.")
@jobs_option
def stress(
    output: OutputOptions, only: tuple[str, ...], quick: bool, list_: bool, jobs: int | None
) -> int:
    from tippedisk_verify.stress.battery import cases_named, run_stress_case

    cases = cases_named(only, quick)
    if list_:
        listing = [
            {"name": case.name, "says": case.description, "expected": case.expected()}
            for case in cases
        ]
        lines = table(
            ("case", "what it is", "expected"), (list(entry.values()) for entry in listing)
        )
        replace(output, quiet=False).show({"cases": listing}, lines)
        return 0
    # The long cases first, so that the cores are busy until the end.
    order = [case.name for case in sorted(cases, key=lambda case: case.quick)]
    with process_pool(jobs, needed=len(cases) > 1) as pool:
        by_name = dict(
            with_progress(
                results_as_completed(run_stress_case, order, pool),
                "cases",
                len(cases),
                not output.quiet,
            )
        )
    outcomes = [by_name[case.name] for case in cases]
    failed = [outcome.name for outcome in outcomes if not outcome.passed]
    rows = (
        (
            "ok" if result.passed else "FAIL",
            result.name,
            result.outcome,
            "" if result.digits is None else f"{result.digits:.1f}",
            f"expected: {result.expected}" + (f" ({result.note})" if result.note else ""),
        )
        for result in outcomes
    )
    passed = len(outcomes) - len(failed)
    last = f"{passed} of {len(outcomes)} cases have the required outcome"
    output.show(
        {
            "cases": [outcome.to_dict() for outcome in outcomes],
            "summary": {"cases": len(outcomes), "passed": passed, "failed": failed},
        },
        [*table(("", "case", "outcome", "digits", ""), rows), last],
    )
    return 1 if failed else 0


COMMANDS = (sweep, bench, stress)
