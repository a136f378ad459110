"""The command `bench`: run time against error."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from tippedisk_verify.commands.common import Common, alone_in, plain_options, print_result, processes, progress

if TYPE_CHECKING:
    from tippedisk_verify.bench.branch_race import Run
    from tippedisk_verify.bench.race import Score

__all__ = ["COMMANDS"]

_COSTS = ("growth", "overhead", "start-up")


@click.command()
@click.option("--peers", is_flag=True, help="Race the integrators of the extra `peers`, too.")
@click.option(
    "--only",
    multiple=True,
    metavar="PROBLEM",
    help="These only: a problem, branch (the paper's 801 cycles), growth, overhead or start-up.",
)
@click.option("--out", metavar="DIR", help="Write figure, CSV and JSON there.")
@plain_options
def bench(common: Common, peers: bool, only: tuple[str, ...], out: str | None) -> int:
    """Run time against error: six initial-value problems, a period solve, the paper's branch of limit cycles."""
    from tippedisk_verify.bench.branch_race import race
    from tippedisk_verify.bench.methods import METHODS
    from tippedisk_verify.bench.problems import PROBLEMS, problem_named
    from tippedisk_verify.bench.race import machine, raced
    from tippedisk_verify.bench.ratios import ratios
    from tippedisk_verify.model.parameters import PRINTED

    names = list(dict.fromkeys(only)) or [*(problem.name for problem in PROBLEMS), "branch"]
    problems = [problem_named(name) for name in names if name not in ("branch", *_COSTS)]
    methods = METHODS
    if peers:
        from tippedisk_verify.bench.peers import peer_methods

        methods = (*METHODS, *peer_methods())
    folder = alone_in(out)
    total = sum(method.fits(problem) for method in methods for problem in problems)
    # One process beside the one that is timed, for the truths.
    with progress(common, total) as advance, processes(1, needed=len(problems) > 1, beside=True) as pool:
        scores = raced(problems, methods, advance, map if pool is None else pool.map)
        branch = race(PRINTED, lambda label, steps: advance(f"branch: {label}", 0)) if "branch" in names else []
    runs: list[dict[str, Any]] = [score.json() for score in scores]
    runs += [{"problem": "branch", **run.json()} for run in branch]
    result: dict[str, Any] = {"machine": machine(), "runs": runs, "ratios": [one.json() for one in ratios(scores)]}
    result |= _costs(names)
    if folder is not None:
        from tippedisk_verify.report.tables import write_bench

        write_bench(folder, scores, result)
    print_result(
        common,
        result,
        [*map(_score_line, scores), *map(_run_line, branch), *_ratio_lines(result), *_cost_lines(result)],
    )
    return 0


def _costs(names: list[str]) -> dict[str, Any]:
    """How cost grows, and what starting costs, where they were asked for by name: each takes a minute."""
    costs: dict[str, Any] = {}
    if "growth" in names:
        from tippedisk_verify.bench.growth import break_even, digits_growth, epsilon_growth

        by_epsilon = epsilon_growth()
        full, *reduced = by_epsilon
        costs["growth"] = [growth.json() for growth in (*digits_growth(), *by_epsilon)]
        costs["break_even_epsilon"] = {one.what: break_even(full, one) for one in reduced}
    if "overhead" in names:
        from tippedisk_verify.bench.overhead import overheads

        costs["overhead"] = [overhead.json() for overhead in overheads()]
    if "start-up" in names:
        from tippedisk_verify.bench.startup import start_up

        costs["start_up"] = start_up().json()
    return costs


def _score_line(score: Score) -> str:
    error = "" if score.error is None else f"error {score.error:8.1e}"
    cost = "" if score.seconds is None else f"{score.seconds * 1e3:10.4f} ms"
    status = "" if score.status == "reached" else score.status
    return f"{score.problem:13s} {score.method:24s} {score.setting:10s} {cost:13s}  {error:14s}  {status}"


def _run_line(run: Run) -> str:
    error = "" if run.error is None else f"error of T {run.error:.1e} s"
    return f"branch        {run.method:48s} {run.setting:28s} {run.seconds * 1e3:9.4f} ms  {error}"


def _ratio_lines(result: dict[str, Any]) -> list[str]:
    lines = []
    for one in result["ratios"]:
        others = [
            f"{label} {one[name + '_over_heyoka']:.3g} times longer ({one[name]})"
            for name, label in (("scipy", "SciPy"), ("peer", "the best peer"))
            if one[f"{name}_over_heyoka"] is not None
        ]
        ours = "heyoka does not get there" if one["heyoka"] is None else one["heyoka"]
        lines.append(f"{one['problem']}, error at most {one['error_at_most']:.0e}: {'; '.join([ours, *others])}")
    return lines


def _cost_lines(result: dict[str, Any]) -> list[str]:
    lines = []
    for growth in result.get("growth", ()):
        cells = ", ".join(f"{x:g}: {seconds * 1e3:.3g} ms" for x, seconds in growth["points"])
        lines.append(f"{growth['what']}: exponent {growth['exponent']:.2f} in {growth['against']} ({cells})")
    for what, epsilon in result.get("break_even_epsilon", {}).items():
        where = "nowhere" if epsilon is None else f"from epsilon = {epsilon:.2g} m/s down"
        lines.append(f"{what}: faster than the full equations {where}")
    lines += [
        f"{one['what']}: {one['over_bare']:.1%} more than a bare integrator's {one['bare_seconds'] * 1e3:.3g} ms"
        for one in result.get("overhead", ())
    ]
    for name, seconds in result.get("start_up", {}).items():
        lines.append(f"{name}: {seconds:.3g}{'' if name.endswith('bare') else ' s'}")
    return lines


COMMANDS = (bench,)
