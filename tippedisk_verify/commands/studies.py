"""The studies: the plane of one parameter and the speed, sweeps, run time against error, hard cases."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import click

from tippedisk_verify.commands.common import Common, Output, alone_in, command, processes, table, workers_of
from tippedisk_verify.files import write_csv, write_text
from tippedisk_verify.parallel import as_done
from tippedisk_verify.progress import watched

__all__ = ["COMMANDS"]


# ------------------------------------------------------------------------------------------------ atlas
@command
def atlas(
    common: Common,
    plane: str = "A,Omega",
    range_: tuple[str, str] | None = None,
    points: int = 200,
    out: str | None = None,
    jobs: int | None = None,
) -> int:
    """Draw Hopf, fold and heteroclinic curves against one parameter, and their special points.

    Special points are bautin (where cycles are no longer born stable), neutral-saddle (on Omega_h, where the saddle
    value vanishes: curves of folds end there) and hopf-heteroclinic (where Omega_h = Omega_crit). A limit cycle is
    here one about inverted spinning, not a rotating one.

    --plane NAME,Omega  The two axes.
    --range LOW HIGH  Of the parameter; a tenth to both sides if not given.
    --points N  Points of each curve.
    --out DIR  Write figure, CSV and JSON there.
    """
    folder = alone_in(out)
    with processes(jobs) as pool:
        how = {"ends": range_, "points": points, "digits": common.digits, "executor": pool}
        drawn = common.disk.atlas(plane, progress=not common.quiet, **how)
    result = drawn.to_dict()
    if folder is not None:
        from tippedisk_verify.figures.atlas import draw_atlas
        from tippedisk_verify.figures.style import save

        _write_atlas(result, folder)
        save(draw_atlas(drawn), folder, "atlas")
    common.show(result, _atlas_lines(result))
    return 0


def _write_atlas(result: dict[str, Any], folder: Path) -> None:
    """``atlas.csv`` with all curves and points, and ``atlas.json``."""
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


COMMANDS = (atlas, sweep, bench, stress)
