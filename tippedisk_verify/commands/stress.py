"""The command `stress`: the numerical-stability battery."""

from __future__ import annotations

from concurrent.futures import as_completed
from dataclasses import asdict
from typing import Any

import click

from tippedisk_verify.commands.common import Common, plain_options, print_json, processes, progress

__all__ = ["COMMANDS"]


@click.command()
@click.option("--only", multiple=True, metavar="CASE", help="These cases only.")
@click.option("--quick", is_flag=True, help="The cases that take some seconds at most.")
@click.option("--list", "listed", is_flag=True, help="Name the cases and the outcome that each must have.")
@click.option("--jobs", type=int, metavar="N", help="Processes to use; all cores by default.")
@plain_options
def stress(common: Common, only: tuple[str, ...], quick: bool, listed: bool, jobs: int | None) -> int:
    """Extreme parameters, states, tolerances and speeds: each must give digits that hold, or say what it cannot."""
    from tippedisk_verify.stress.battery import cases_named, outcome_of

    cases = cases_named(only, quick)
    if listed:
        if common.json:
            print_json({"cases": [{"name": c.name, "says": c.says, "expected": c.expected()} for c in cases]})
        else:
            for case in cases:
                click.echo(f"{case.name}: {case.says}; expected: {case.expected()}")
        return 0
    found: dict[str, Any] = {}
    # The long ones first, so that none of them is left alone at the end.
    order = sorted(cases, key=lambda case: case.quick)
    with progress(common, len(cases)) as advance, processes(jobs, needed=len(cases) > 1) as pool:
        if pool is None:
            for case in order:
                found[case.name] = outcome_of(case.name)
                advance(case.name, 1)
        else:
            for done in as_completed([pool.submit(outcome_of, case.name) for case in order]):
                outcome = done.result()
                found[outcome.name] = outcome
                advance(outcome.name, 1)
    outcomes = [found[case.name] for case in cases]
    failed = [outcome.name for outcome in outcomes if not outcome.passed]
    result = {
        "cases": [asdict(outcome) for outcome in outcomes],
        "summary": {"cases": len(outcomes), "passed": len(outcomes) - len(failed), "failed": failed},
    }
    if common.json:
        print_json(result)
    elif not common.quiet:
        for one in outcomes:
            digits = "" if one.digits is None else f"{one.digits:5.1f}"
            mark = "ok  " if one.passed else "FAIL"
            said = f"  ({one.note})" if one.note else ""
            click.echo(f"{mark}  {one.name:34s} {one.outcome:18s} {digits:6s} expected: {one.expected}{said}")
        click.echo(f"{len(outcomes) - len(failed)} of {len(outcomes)} cases have the outcome they must have")
    return 1 if failed else 0


COMMANDS = (stress,)
