"""The command `stress`: the numerical-stability battery."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import TYPE_CHECKING

import click

from tippedisk_verify.commands.common import Common, plain_options, print_result, processes

if TYPE_CHECKING:
    from tippedisk_verify.stress.case import Outcome

__all__ = ["COMMANDS"]


@click.command()
@click.option("--only", multiple=True, metavar="CASE", help="These cases only.")
@click.option("--quick", is_flag=True, help="The cases that take some seconds at most.")
@click.option("--list", "listed", is_flag=True, help="Name the cases and the outcome that each must have.")
@click.option("--jobs", type=int, metavar="N", help="Processes to use; all cores by default.")
@plain_options
def stress(common: Common, only: tuple[str, ...], quick: bool, listed: bool, jobs: int | None) -> int:
    """Extreme parameters, states, tolerances and speeds: each must give digits that hold, or say what it cannot."""
    from tippedisk_verify.parallel import as_done
    from tippedisk_verify.progress import watched
    from tippedisk_verify.stress.battery import cases_named, outcome_of

    cases = cases_named(only, quick)
    if listed:
        listing = [{"name": case.name, "says": case.says, "expected": case.expected()} for case in cases]
        lines = map("{name}: {says}; expected: {expected}".format_map, listing)
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
    total = f"{len(outcomes) - len(failed)} of {len(outcomes)} cases have the outcome they must have"
    print_result(common, result, [*map(_line, outcomes), total])
    return 1 if failed else 0


def _line(outcome: Outcome) -> str:
    digits = "" if outcome.digits is None else f"{outcome.digits:5.1f}"
    mark = "ok  " if outcome.passed else "FAIL"
    note = f"  ({outcome.note})" if outcome.note else ""
    return f"{mark}  {outcome.name:34s} {outcome.outcome:18s} {digits:6s} expected: {outcome.expected}{note}"


COMMANDS = (stress,)
