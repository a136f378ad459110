"""The command `verify`, the main job: the audit of the paper's claims, with its report."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Any

import click

from tippedisk_verify.commands.definition import DiskOptions, disk_command
from tippedisk_verify.commands.jobs import checked_jobs, process_pool
from tippedisk_verify.commands.options import lock_output_folder, option_callback
from tippedisk_verify.commands.tables import table
from tippedisk_verify.errors import InputError
from tippedisk_verify.support.cache import Cache, default_folder
from tippedisk_verify.support.parallel import usable_cores

if TYPE_CHECKING:
    from tippedisk_verify.audit.claims import Claim, Finding
    from tippedisk_verify.report.tasks import AuditJob

__all__ = ["COMMANDS"]

_MAX_PROCESSES = 8  # the main job has not enough tasks for more


@disk_command(
    "Audit every claim of the paper; write the report, figures and data.\n\n"
    "All claims take a minute on two cores, with figures. Results are stored, so a second run "
    "takes seconds."
)
@click.argument("more", nargs=-1, metavar="[CLAIM]...")
@click.option("--out", metavar="DIR", help="Write report, figures and data there.")
@click.option(
    "--only",
    multiple=True,
    metavar="CLAIM",
    help="Examine only these claims, by name or by equation (eq.7, or 7).",
)
@click.option("--list", "list_", is_flag=True, help="List the claims without examining them.")
@click.option("--fresh", is_flag=True, help="Compute everything again, without stored results.")
@click.option("--long", is_flag=True, help="Print the details of each verdict.")
@click.option(
    "--jobs",
    type=int,
    metavar="N",
    callback=option_callback(checked_jobs),
    help="Number of processes; the number of cores, at most 8, if not given.",
)
def verify(
    common: DiskOptions,
    more: Sequence[str],
    out: str | None,
    only: tuple[str, ...],
    list_: bool,
    fresh: bool,
    long: bool,
    jobs: int | None,
) -> int:
    if more and not only:
        raise InputError(f"'{more[0][:40]}' is not an option: name claims with --only")
    if list_:
        if out is not None or only or fresh:
            raise InputError("--list goes with no other option")
        return _list_claims(common)
    from tippedisk_verify.audit.claim_catalogue import equations_named, select_claims
    from tippedisk_verify.audit.claims import Finding
    from tippedisk_verify.report.results_json import results_json, run_facts, summary
    from tippedisk_verify.report.tasks import AuditJob, run_tasks, tasks_for

    began = time.monotonic()
    names = [name for group in (*only, *more) for name in group.split(",") if name]
    if only and not names:
        raise InputError("--only names no claim")
    claims = select_claims(names)
    folder = lock_output_folder(out)
    job = AuditJob(common.disk, common.digits, tuple(claim.name for claim in claims))
    tasks = tasks_for(job, figures=folder is not None)
    with common.progress(len(tasks) + (folder is not None)) as advance:
        outcomes, kept = run_tasks(
            job,
            tasks,
            Cache(default_folder(), fresh=fresh),
            lambda wanted: _pool(jobs, wanted),
            advance,
        )
        records = {task.name: record for task, record in outcomes.items() if task.kind == "claim"}
        findings = [(claim, Finding.of_record(records[claim.name])) for claim in claims]
        figures = [outcomes[task] for task in tasks if task.kind == "figure"]
        results = results_json(job, findings, figures, run_facts(began, len(tasks), len(kept)))
        if folder is not None:
            from tippedisk_verify.report.report_folder import write_report

            advance("report", 0)
            (formulas,) = [record for task, record in outcomes.items() if task.kind == "formulas"]
            write_report(folder, results, findings, figures, formulas)
            advance("report", 1)
    lines = list(_verdict_lines(job, findings, long, equations_named(names)))
    if kept:
        lines.append(
            f"{len(kept)} of {len(tasks)} results are from earlier runs: --fresh "
            f"computes them again"
        )
    if folder is not None:
        lines.append(f"report, figures and data: {folder} (open {folder / 'report.html'})")
    common.show(results, lines)
    failed = summary(findings)["own_checks_failed"]
    if failed:
        click.echo(f"own checks that fell short: {', '.join(failed)}", err=True)
    return 1 if failed else 0


def _pool(jobs: int | None, wanted: int) -> AbstractContextManager[Any]:
    """Return a context manager that yields a pool for ``wanted`` tasks, or None for one process.

    The pool has ``jobs`` processes, or as many as there are cores, up to `_MAX_PROCESSES`.
    """
    workers = jobs or min(usable_cores(), wanted, _MAX_PROCESSES)
    return process_pool(workers) if workers > 1 else nullcontext(None)


def _list_claims(common: DiskOptions) -> int:
    from tippedisk_verify.audit.claim_catalogue import CLAIMS

    width = max(len(claim.name) for claim in CLAIMS)
    listing = [
        {"name": claim.name, "source": claim.source, "statement": claim.statement}
        for claim in CLAIMS
    ]
    lines = (
        f"{claim.name:{width}}  {claim.statement} ({claim.source.partition(', ')[0]})"
        for claim in CLAIMS
    )
    common.show({"claims": listing}, lines)
    return 0


def _verdict_lines(
    job: AuditJob,
    findings: Sequence[tuple[Claim, Finding]],
    long: bool,
    equations: Sequence[str] = (),
) -> Iterator[str]:
    """Yield the lines that an audit prints: the verdict on each named equation, then a table of the
    claims.

    If equations are named, or ``long`` is true, the details of each claim replace the table.
    """
    from tippedisk_verify.report.results_json import (
        claim_json,
        summary,
        totals_sentence,
        value_text,
        verdict_words,
    )

    entries = [(claim, finding, claim_json(claim, finding, job)) for claim, finding in findings]
    for number in equations:
        for claim, _, entry in entries:
            if f"({number})" in claim.cited:
                words = f": {verdict_words(entry)}"
                if f"eq. ({number})" in claim.cited.partition("from ")[2]:
                    about = claim.cited.partition(", ")[0]
                    words = f" has no verdict of its own; {about}, which is derived from it, {words[2:]}"
                yield f"eq. ({number}){words}, by the claim {claim.name}"
    yield f"Claims ({job.parameters.name}, {job.parameters.friction} friction)"
    if not (long or equations):
        rows = [
            (claim.name, verdict_words(entry), _computed_text(entry)) for claim, _, entry in entries
        ]
        yield from table(("claim", "verdict", "computed"), rows)
        if any("(proved)" in words for _, words, _ in rows):
            yield "proved: by a theorem of docs/certified.md, whose proof is not repeated here"
    for claim, finding, entry in entries if long or equations else ():
        yield f"{claim.name}: {verdict_words(entry)}"
        yield f"    {claim.statement} ({claim.cited})"
        unit = f" {claim.unit}" if claim.unit else ""
        values = {name: str(value_text(value)) for name, value in finding.computed.items()}
        if len(values) > 1 and len(set(values.values())) == 1:
            values = {"every set": next(iter(values.values()))}
        if claim.printed:
            values = {
                "paper": claim.formula if claim.printed == "formula" else claim.printed,
                **values,
            }
        yield f"    {'; '.join(f'{name}: {text}' for name, text in values.items())}{unit}"
        yield from (
            f"    {part}: {entry[part]}" for part in ("cause", "instead", "note") if entry[part]
        )
        if proof := entry["proof"]:
            yield f"    {entry['grade']} by {proof['theorem']}: {proof['proves']}"
    yield totals_sentence(summary(findings)) + "."


def _computed_text(entry: dict[str, Any]) -> str:
    """Return a text about a claim's entry: the value computed for the selected set, then the number
    in the paper.
    """
    value = entry["computed"]
    if isinstance(value, str):
        return value.partition("; ")[0]
    paper = f" (paper: {entry['printed']})" if entry["printed_digits"] is not None else ""
    return f"{float(value['value']):.6g} {entry['unit']}{paper}"


COMMANDS = (verify,)
