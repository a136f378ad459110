"""The command `bench`: run time against error."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from tippedisk_verify.commands.common import Common, alone_in, plain_options, print_result, processes, progress

if TYPE_CHECKING:
    from tippedisk_verify.bench.race import Score

__all__ = ["COMMANDS"]


@click.command()
@click.option("--peers", is_flag=True, help="Race the integrators of the extra `peers`, too.")
@click.option(
    "--only",
    multiple=True,
    metavar="PROBLEM",
    help="These only.",
)
@click.option("--out", metavar="DIR", help="Write figure, CSV and JSON there.")
@plain_options
def bench(common: Common, peers: bool, only: tuple[str, ...], out: str | None) -> int:
    """Run time against error: six initial-value problems."""
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
    lines = [*map(_score_line, scores), *_ratio_lines(result)]
    print_result(common, result, lines)
    return 0


def _score_line(score: Score) -> str:
    error = "" if score.error is None else f"error {score.error:8.1e}"
    cost = "" if score.seconds is None else f"{score.seconds * 1e3:10.4f} ms"
    status = "" if score.status == "reached" else score.status
    return f"{score.problem:13s} {score.method:24s} {score.setting:10s} {cost:13s}  {error:14s}  {status}"


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


COMMANDS = (bench,)
