"""The commands `verify`, the main job, and `scene`, its panels one by one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import click

from tippedisk_verify.commands.common import (
    Common,
    alone_in,
    checked_jobs,
    common_options,
    print_json,
    processes,
    progress,
    usable_cores,
)
from tippedisk_verify.errors import InputError

__all__ = ["COMMANDS"]

_MOST_PROCESSES = 8  # there is no more to do at once


@click.command()
@click.option("--out", metavar="DIR", help="Write report, figures and data there.")
@click.option("--only", multiple=True, metavar="CLAIM...", help="Examine these claims only.")
@click.option("--list", "listing", is_flag=True, help="Say which claims there are, and examine none.")
@click.option("--fresh", is_flag=True, help="Compute everything anew, also what was kept from earlier runs.")
@click.option("--jobs", type=int, metavar="N", help="Processes; as many as there are cores, at most 8, if not given.")
@click.argument("more", nargs=-1, metavar="")
@common_options
def verify(
    common: Common,
    out: str | None,
    only: Sequence[str],
    listing: bool,
    fresh: bool,
    jobs: int | None,
    more: Sequence[str],
) -> int:
    """Audit every claim of the paper; write the report, figures and data."""
    import time
    from contextlib import AbstractContextManager, nullcontext

    if more and not only:
        raise InputError(f"'{more[0][:40]}' stands alone: name claims with --only")
    checked_jobs(jobs)
    from tippedisk_verify.audit.catalogue import selected
    from tippedisk_verify.cache import Cache, default_folder

    if listing:
        if out is not None or only or fresh:
            raise InputError("--list stands alone")
        return _listed(common)
    from tippedisk_verify.audit.claims import Finding
    from tippedisk_verify.report.results import results_json, summary
    from tippedisk_verify.report.work import AuditJob, run, tasks_for

    began = time.monotonic()
    names = [name for group in (*only, *more) for name in group.split(",") if name]
    if only and not names:
        raise InputError("--only names no claim")
    claims = selected(names)
    folder = alone_in(out)
    order = AuditJob(common.parameters, common.digits, tuple(claim.name for claim in claims))
    tasks = tasks_for(order, figures=folder is not None)

    def pool(wanted: int) -> AbstractContextManager[Any]:
        workers = jobs or min(usable_cores(), wanted, _MOST_PROCESSES)
        return processes(workers) if workers > 1 else nullcontext(None)

    with progress(common, len(tasks) + (folder is not None)) as advance:
        outcome = run(order, tasks, Cache(default_folder(), fresh=fresh), pool, advance)
        records = {task.name: record for task, record in outcome.records.items() if task.kind == "claim"}
        findings = [(claim, Finding.of_record(records[claim.name])) for claim in claims]
        figures = [outcome.records[task] for task in tasks if task.kind == "figure"]
        this_run = {
            "ended": time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime()),
            "seconds": f"{time.monotonic() - began:.1f}",
            "tasks": len(tasks),
            "kept": len(outcome.kept),
            "computed": len(tasks) - len(outcome.kept),
        }
        results = results_json(order, findings, figures, this_run)
        if folder is not None:
            from tippedisk_verify.report.files import write_report

            advance("report", 0)
            (formulas,) = [record for task, record in outcome.records.items() if task.kind == "formulas"]
            write_report(folder, results, findings, figures, formulas)
            advance("report", 1)
    if common.json:
        print_json(results)
    elif not common.quiet:
        _print_claims(order, results["sets"], findings)
        if folder is not None:
            click.echo(f"report, figures and data: {folder} (open {folder / 'report.html'})")
    failed = summary(findings)["own_checks_failed"]
    if failed:
        click.echo(f"own checks that fell short: {', '.join(failed)}", err=True)
    return 1 if failed else 0


@click.command()
@click.argument("names", nargs=-1, required=True, metavar="NAME...|all")
@click.option("--out", metavar="DIR", help="Write figure and CSV data there.")
@click.option("--omega-h", metavar="X", help="Use this Omega_h [rad/s] instead of finding it.")
@common_options
def scene(common: Common, names: Sequence[str], out: str | None, omega_h: str | None) -> int:
    """The panels a to f of the paper's figures 3D and proj_3D."""
    from fractions import Fraction

    from tippedisk_verify.flow import default_engine
    from tippedisk_verify.model.equations import checked_speed
    from tippedisk_verify.model.measured import Measured
    from tippedisk_verify.orbits.scenes import SCENES, compute, scene_named

    chosen = list(SCENES) if "all" in names else list(dict.fromkeys(scene_named(name) for name in names))
    if common.digits > 12:
        raise InputError(f"scenes hold at most 12 digits, not {common.digits}: their orbits run in double precision")
    given = None
    if omega_h is not None:
        given = Measured(checked_speed(omega_h), Fraction(0))
    folder = alone_in(out)
    engine = default_engine()
    with progress(common, len(chosen)) as advance:
        found_with: tuple[Any, ...] = ()
        if given is None and any(panel.base == "Omega_h" for panel in chosen):
            from tippedisk_verify.orbits.heteroclinic import heteroclinic

            advance("Omega_h", 0)
            given = heteroclinic(common.parameters, engine).omega_h
            found_with = engine.builds
        panels = []
        for panel in chosen:
            advance(f"scene {panel.name}", 0)
            panels.append(compute(panel, common.parameters, engine, omega_h=given))
            advance(f"scene {panel.name}", 1)
        if folder is not None:
            from tippedisk_verify.figures.state_space import draw_scenes_2d, draw_scenes_3d, scene_tables
            from tippedisk_verify.figures.style import save
            from tippedisk_verify.files import write_csv

            save(draw_scenes_3d(panels), folder, "scenes_3d")
            save(draw_scenes_2d(panels), folder, "scenes_2d")
            for drawn in panels:
                for name, (header, rows) in scene_tables(drawn).items():
                    write_csv(folder / name, header, rows)
    if common.json:
        result = {
            "scenes": {panel.scene.name: panel.json() for panel in panels},
            "omega_h": None if given is None else given.json(),
            "compiled_for_omega_h": [build.json() for build in found_with],
            "parameters": common.parameters.name,
            "friction": common.friction,
        }
        print_json(result)
    elif not common.quiet:
        for drawn in panels:
            click.echo(f"scene {drawn.scene.name}: Omega = {drawn.omega} rad/s")
            for start, orbit in enumerate(drawn.orbits, start=1):
                ending = orbit.ending
                detail = f" at {ending.time} s" if ending.time is not None else ""
                click.echo(f"  orbit {start}: {ending.kind}{detail} ({ending.reason})")
    return 0


def _listed(common: Common) -> int:
    from tippedisk_verify.audit.catalogue import selected

    claims = selected(())
    if common.json:
        print_json({"claims": [{"name": claim.name, "statement": claim.statement} for claim in claims]})
    elif not common.quiet:
        width = max(len(claim.name) for claim in claims)
        for claim in claims:
            click.echo(f"{claim.name:{width}}  {claim.statement}")
    return 0


def _print_claims(order: Any, sets: Sequence[str], findings: Sequence[tuple[Any, Any]]) -> None:
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    from tippedisk_verify.audit.claim_proofs import proof_of
    from tippedisk_verify.audit.claims import sets_with
    from tippedisk_verify.report.results import shown, summary, totals

    colours = {"holds": "green", "holds-for": "yellow", "does-not-follow": "red", "undecided": "magenta"}
    audited = sets_with(order.parameters)
    table = Table(
        title=escape(f"Claims ({order.parameters.name}, {order.parameters.friction} friction)"), title_justify="left"
    )
    for heading in ("claim", "paper", *sets, "verdict"):
        table.add_column(escape(heading), overflow="fold")
    for claim, finding in findings:
        verdict = finding.verdict.value
        text = f"[{colours[verdict]}]{verdict}[/]" + (
            ": " + escape(", ".join(finding.sets)) if verdict == "holds-for" else ""
        )
        proof = proof_of(claim, finding, audited)
        verdict_text = text + (f" [dim]({proof.grade})[/]" if proof else "")
        cells = [escape(shown(finding.computed[name])) if name in finding.computed else "" for name in sets]
        label = f"{claim.name} [{claim.unit}]" if claim.unit else claim.name
        table.add_row(escape(label), escape(claim.printed), *cells, verdict_text)
    console = Console()
    if not console.is_terminal:
        console = Console(width=160)  # a file has no width of its own; keep rows on one line
    console.print(table)
    console.print(totals(summary([*findings])) + ".", highlight=False)


COMMANDS = (verify, scene)
