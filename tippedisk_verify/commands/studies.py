"""The studies: the plane of one parameter and the speed, sweeps, run time against error, hard cases."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import click

from tippedisk_verify.commands.common import (
    Common,
    alone_in,
    common_options,
    executor_option,
    jobs_option,
    plain_options,
    print_result,
    processes,
    progress,
    table,
    workers_of,
)

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tippedisk_verify.bench.race import Score
    from tippedisk_verify.stress.case import Outcome

__all__ = ["COMMANDS"]


# ------------------------------------------------------------------------------------------------ atlas
@click.command()
@click.option("--plane", "axes", default="A,Omega", show_default=True, metavar="NAME,Omega", help="The two axes.")
@click.option(
    "--range",
    "ends",
    type=(str, str),
    metavar="LOW HIGH",
    help="Of the parameter; a tenth to both sides if not given.",
)
@click.option("--points", type=int, default=200, show_default=True, metavar="N", help="Points of each curve.")
@click.option("--out", metavar="DIR", help="Write figure, CSV and JSON there.")
@jobs_option
@common_options
def atlas(
    common: Common, axes: str, ends: tuple[str, str] | None, points: int, out: str | None, jobs: int | None
) -> int:
    """Draw Hopf, fold and heteroclinic curves against one parameter, and their special points.

    Special points are bautin (where cycles are no longer born stable), neutral-saddle (on Omega_h, where the saddle
    value vanishes: curves of folds end there) and hopf-heteroclinic (where Omega_h = Omega_crit). A limit cycle is
    here one about inverted spinning, not a rotating one.
    """
    folder = alone_in(out)
    with processes(jobs) as pool:
        how = {"ends": ends, "points": points, "digits": common.digits, "executor": pool}
        plane = common.disk.atlas(axes, progress=not common.quiet, **how)
    result = plane.to_dict()
    if folder is not None:
        from tippedisk_verify.figures.atlas import draw_atlas
        from tippedisk_verify.figures.style import save

        _write_atlas(result, folder)
        save(draw_atlas(plane), folder, "atlas")
    print_result(common, result, _atlas_lines(result))
    return 0


def _write_atlas(result: dict[str, Any], folder: Path) -> None:
    """``atlas.csv`` with all curves and points, and ``atlas.json``."""
    from tippedisk_verify.files import write_csv, write_text

    names = [result["plane"][0], "omega"]
    listed: list[tuple[str, object, Any]] = [
        (curve["kind"], number, point) for number, curve in enumerate(result["curves"]) for point in curve["points"]
    ]
    listed += [(point["kind"], "", point) for point in result["points"]]
    rows = [
        (kind, number, *(part for name in names for part in (point[name]["value"], point[name]["uncertainty"])))
        for kind, number, point in listed
    ]
    header = ["kind", "curve", *(part for name in names for part in (name, f"{name} uncertainty"))]
    write_csv(folder / "atlas.csv", header, rows)
    write_text(folder / "atlas.json", json.dumps(result, indent=1) + "\n")


def _atlas_lines(result: dict[str, Any]) -> Iterator[str]:
    name = result["plane"][0]

    def shown(point: dict[str, Any]) -> list[str]:
        return [f"{float(point[name]['value']):.9g}", f"{float(point['omega']['value']):.12g}"]

    rows = [
        [f"{curve['kind']} curve, {len(curve['points'])} points, {word}", *shown(point)]
        for curve in result["curves"]
        for word, point in zip(("from", "to"), curve["points"][:: max(1, len(curve["points"]) - 1)], strict=False)
    ]
    yield from table(("", name, "Omega [rad/s]"), [*rows, *([p["kind"], *shown(p)] for p in result["points"])])
    for one in result["missing"]:
        first, last = (f"{float(value):.9g}" for value in one["range"])
        where = f"{name} = {first}" if one["count"] == 1 else f"{one['count']} values of {name} from {first} to {last}"
        yield f"{one['kind']} missing at {where}: {one['reason']}"


# ------------------------------------------------------------------------------------------------ sweep
@click.command()
@click.argument("analysis", metavar="orbit|equilibria|hopf|heteroclinic|trajectory")
@click.option(
    "--over",
    multiple=True,
    required=True,
    metavar="NAME=FIRST:LAST:COUNT|NAME=X,X,...",
    help="An axis: omega, below-crit, a parameter, or beta, gamma, v, duration of a trajectory.",
)
@click.option("--out", required=True, metavar="FILE.csv|FILE.parquet", help="Where the table goes.")
@executor_option
@jobs_option
@common_options
def sweep(common: Common, analysis: str, over: tuple[str, ...], out: str, executor: str, jobs: int | None) -> int:
    """Compute an analysis at every combination of the axes' values; interrupted, it goes on where it stopped.

    The table has the axes as they were given, the status, and each result beside its half-width (NAME_uncertainty); a
    trajectory ends at final_beta, final_gamma, final_v. Every worker of a cluster needs this version of the package.
    """
    from tippedisk_verify.files import table_file
    from tippedisk_verify.sweep.plan import Plan, axis
    from tippedisk_verify.sweep.running import swept

    plan = Plan(analysis, common.disk, tuple(axis(text) for text in over), common.digits)
    target = table_file(out)
    with progress(common, len(plan)) as advance:
        points, without = swept(plan, target, lambda: workers_of(executor, jobs), advance)
    line = f"{points} points, {without} of them without numbers (their status says why): {target}"
    print_result(common, {"points": points, "without_numbers": without, "file": str(target)}, [line])
    return 0


# ------------------------------------------------------------------------------------------------ bench
@click.command()
@click.option("--peers", is_flag=True, help="Race the integrators of the extra `peers`, too.")
@click.option("--only", multiple=True, metavar="PROBLEM", help="These only.")
@click.option("--out", metavar="DIR", help="Write figure, CSV and JSON there.")
@plain_options
def bench(common: Common, peers: bool, only: tuple[str, ...], out: str | None) -> int:
    """Measure run time against error: six initial-value problems."""
    from tippedisk_verify.bench.methods import METHODS
    from tippedisk_verify.bench.problems import PROBLEMS, problem_named
    from tippedisk_verify.bench.race import machine, raced, ratios

    names = list(dict.fromkeys(only)) or [problem.name for problem in PROBLEMS]
    problems = [problem_named(name) for name in names]
    methods = METHODS
    if peers:
        from tippedisk_verify.bench.peers import peer_methods

        methods = (*METHODS, *peer_methods())
    folder = alone_in(out)
    total = sum(method.fits(problem) for method in methods for problem in problems)
    # One process beside the one that is timed, for the truths.
    with progress(common, total) as advance, processes(1, needed=len(problems) > 1, beside=True) as pool:
        scores = raced(problems, methods, advance, map if pool is None else pool.map)
    result: dict[str, Any] = {
        "machine": machine(),
        "runs": [score.to_dict() for score in scores],
        "ratios": ratios(scores),
    }
    if folder is not None:
        from tippedisk_verify.report.tables import write_bench

        write_bench(folder, scores, result)
    print_result(common, result, _bench_lines(scores, result["ratios"]))
    return 0


def _bench_lines(scores: list[Score], compared: list[dict[str, Any]]) -> Iterator[str]:
    rows = (
        (
            *(score.problem, score.method, score.setting),
            "" if score.seconds is None else f"{score.seconds * 1e3:.4f}",
            "" if score.error is None else f"{score.error:.1e}",
            "" if score.status == "reached" else score.status,
        )
        for score in scores
    )
    yield from table(("problem", "method", "setting", "time [ms]", "error", "status"), rows)
    for one in compared:
        others = [
            f"{label} {one[name + '_over_heyoka']:.3g} times longer ({one[name]})"
            for name, label in (("scipy", "SciPy"), ("peer", "the best peer"))
            if one[f"{name}_over_heyoka"] is not None
        ]
        ours = "heyoka does not get there" if one["heyoka"] is None else one["heyoka"]
        yield f"{one['problem']}, error at most {one['error_at_most']:.0e}: {'; '.join([ours, *others])}"


# ------------------------------------------------------------------------------------------------ stress
@click.command()
@click.option("--only", multiple=True, metavar="CASE", help="These cases only.")
@click.option("--quick", is_flag=True, help="The cases that take some seconds at most.")
@click.option("--list", "listed", is_flag=True, help="Name the cases and the outcome that each must have.")
@jobs_option
@plain_options
def stress(common: Common, only: tuple[str, ...], quick: bool, listed: bool, jobs: int | None) -> int:
    """Try extreme parameters, states, tolerances and speeds: each must give digits that hold, or say what it cannot."""
    from tippedisk_verify.parallel import as_done
    from tippedisk_verify.progress import watched
    from tippedisk_verify.stress.battery import cases_named, outcome_of

    cases = cases_named(only, quick)
    if listed:
        listing = [{"name": case.name, "says": case.says, "expected": case.expected()} for case in cases]
        lines = table(("case", "what it is", "expected"), ([one[key] for key in one] for one in listing))
        print_result(replace(common, quiet=False), {"cases": listing}, lines)
        return 0
    # The long ones first, so that none of them is left alone at the end.
    order = [case.name for case in sorted(cases, key=lambda case: case.quick)]
    with processes(jobs, needed=len(cases) > 1) as pool:
        by_name = dict(watched(as_done(outcome_of, order, pool), "cases", len(cases), not common.quiet))
    outcomes = [by_name[case.name] for case in cases]
    failed = [outcome.name for outcome in outcomes if not outcome.passed]
    result = {
        "cases": [asdict(outcome) for outcome in outcomes],
        "summary": {"cases": len(outcomes), "passed": len(outcomes) - len(failed), "failed": failed},
    }
    print_result(common, result, _stress_lines(outcomes))
    return 1 if failed else 0


def _stress_lines(outcomes: list[Outcome]) -> Iterator[str]:
    passed = sum(outcome.passed for outcome in outcomes)
    rows = (
        (
            *("ok" if one.passed else "FAIL", one.name, one.outcome, "" if one.digits is None else f"{one.digits:.1f}"),
            f"expected: {one.expected}" + (f" ({one.note})" if one.note else ""),
        )
        for one in outcomes
    )
    yield from table(("", "case", "outcome", "digits", ""), rows)
    yield f"{passed} of {len(outcomes)} cases have the outcome they must have"


COMMANDS = (atlas, sweep, bench, stress)
