"""The commands `verify`, the main job, and `scene`, its panels one by one."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Any

import click

from tippedisk_verify.commands.common import (
    Common,
    alone_in,
    checked_jobs,
    common_options,
    print_result,
    processes,
    progress,
)
from tippedisk_verify.errors import InputError

if TYPE_CHECKING:
    from pathlib import Path

    from tippedisk_verify.audit.claims import Claim, Finding
    from tippedisk_verify.flow.contract import Build
    from tippedisk_verify.motion.scenes import Panel
    from tippedisk_verify.report.work import AuditJob

__all__ = ["COMMANDS"]

_MOST_PROCESSES = 8  # there is no more to do at once


@click.command()
@click.option("--out", metavar="DIR", help="Write report, figures and data there.")
@click.option("--only", multiple=True, metavar="CLAIM", help="Examine these only: by name, or by equation (eq.7).")
@click.option("--list", "listing", is_flag=True, help="Say which claims there are, and examine none.")
@click.option("--fresh", is_flag=True, help="Compute everything anew, also what was kept from earlier runs.")
@click.option("--long", is_flag=True, help="Say all there is to each verdict.")
@click.option("--jobs", type=int, metavar="N", help="Processes; as many as there are cores, at most 8, if not given.")
@click.argument("more", nargs=-1, metavar="[CLAIM]...")
@common_options
def verify(
    common: Common,
    out: str | None,
    only: Sequence[str],
    listing: bool,
    fresh: bool,
    long: bool,
    jobs: int | None,
    more: Sequence[str],
) -> int:
    """Audit every claim of the paper; write the report, figures and data."""
    import time

    if more and not only:
        raise InputError(f"'{more[0][:40]}' stands alone: name claims with --only")
    checked_jobs(jobs)
    if listing:
        if out is not None or only or fresh:
            raise InputError("--list stands alone")
        return _listed(common)
    from tippedisk_verify.audit.catalogue import selected
    from tippedisk_verify.audit.claims import Finding
    from tippedisk_verify.cache import Cache, default_folder
    from tippedisk_verify.report.results import results_json, run_facts, summary
    from tippedisk_verify.report.work import AuditJob, run, tasks_for

    began = time.monotonic()
    names = [name for group in (*only, *more) for name in group.split(",") if name]
    if only and not names:
        raise InputError("--only names no claim")
    claims = selected(names)
    folder = alone_in(out)
    order = AuditJob(common.parameters, common.digits, tuple(claim.name for claim in claims))
    tasks = tasks_for(order, figures=folder is not None)
    cache = Cache(default_folder(), fresh=fresh)
    if (changed := cache.changes()) and not common.quiet:
        click.echo(f"{', '.join(changed)}: computed anew", err=True)
    with progress(common, len(tasks) + (folder is not None)) as advance:
        outcome = run(order, tasks, cache, lambda wanted: _pool(jobs, wanted), advance)
        records = {task.name: record for task, record in outcome.records.items() if task.kind == "claim"}
        findings = [(claim, Finding.of_record(records[claim.name])) for claim in claims]
        figures = [outcome.records[task] for task in tasks if task.kind == "figure"]
        results = results_json(order, findings, figures, run_facts(began, len(tasks), len(outcome.kept)))
        if folder is not None:
            from tippedisk_verify.report.files import write_report

            advance("report", 0)
            (formulas,) = [record for task, record in outcome.records.items() if task.kind == "formulas"]
            write_report(folder, results, findings, figures, formulas)
            advance("report", 1)
    written = [] if folder is None else [f"report, figures and data: {folder} (open {folder / 'report.html'})"]
    print_result(common, results, (*_verdict_lines(order, findings, long), *written))
    failed = summary(findings)["own_checks_failed"]
    if failed:
        click.echo(f"own checks that fell short: {', '.join(failed)}", err=True)
    return 1 if failed else 0


def _pool(jobs: int | None, wanted: int) -> AbstractContextManager[Any]:
    """Processes for so many tasks at once: as many as were asked for, or as there are cores."""
    from tippedisk_verify.parallel import usable_cores

    workers = jobs or min(usable_cores(), wanted, _MOST_PROCESSES)
    return processes(workers) if workers > 1 else nullcontext(None)


@click.command()
@click.argument("names", nargs=-1, required=True, metavar="NAME...|all")
@click.option("--out", metavar="DIR", help="Write figure and CSV data there.")
@click.option("--animate", is_flag=True, help="Show the disk itself in motion, too: a GIF for each scene, in --out.")
@click.option("--omega-h", metavar="X", help="Use this Omega_h [rad/s] instead of finding it.")
@common_options
def scene(common: Common, names: Sequence[str], out: str | None, animate: bool, omega_h: str | None) -> int:
    """The panels a to f of the paper's figures 3D and proj_3D."""
    from fractions import Fraction

    from tippedisk_verify.flow import default_engine
    from tippedisk_verify.model.equations import checked_speed
    from tippedisk_verify.model.measured import Measured
    from tippedisk_verify.motion.scenes import SCENES, compute, scene_named

    chosen = list(SCENES) if "all" in names else list(dict.fromkeys(scene_named(name) for name in names))
    if common.digits > 12:
        raise InputError(f"scenes hold at most 12 digits, not {common.digits}: their orbits run in double precision")
    if animate and out is None:
        raise InputError("--animate needs a folder to write the GIF to: give one with --out")
    given = None if omega_h is None else Measured(checked_speed(omega_h), Fraction(0))
    folder = alone_in(out)
    engine = default_engine()
    with progress(common, len(chosen)) as advance:
        builds: tuple[Build, ...] = ()
        if given is None and any(panel.base == "Omega_h" for panel in chosen):
            from tippedisk_verify.connection.heteroclinic import heteroclinic

            advance("Omega_h", 0)
            given = heteroclinic(common.parameters, engine).omega_h
            builds = engine.builds
        panels = []
        for panel in chosen:
            advance(f"scene {panel.name}", 0)
            panels.append(compute(panel, common.parameters, engine, omega_h=given))
            advance(f"scene {panel.name}", 1)
        if folder is not None:
            _draw_scenes(panels, folder)
            if animate:
                for shown in panels:
                    _animate(shown, folder, advance)
    result = {
        "scenes": {panel.scene.name: panel.to_dict() for panel in panels},
        "omega_h": None if given is None else given.to_dict(),
        "compiled_for_omega_h": [build.to_dict() for build in builds],
        "parameters": common.parameters.name,
        "friction": common.friction,
    }
    print_result(common, result, (line for panel in panels for line in _endings(panel)))
    return 0


def _draw_scenes(panels: Sequence[Panel], folder: Path) -> None:
    from tippedisk_verify.figures.state_space import draw_scenes_2d, draw_scenes_3d, scene_tables
    from tippedisk_verify.figures.style import save
    from tippedisk_verify.files import write_csv

    save(draw_scenes_3d(panels), folder, "scenes_3d")
    save(draw_scenes_2d(panels), folder, "scenes_2d")
    for panel in panels:
        for name, (header, rows) in scene_tables(panel).items():
            write_csv(folder / name, header, rows)


def _animate(panel: Panel, folder: Path, advance: Callable[[str, int], None]) -> None:
    from tippedisk_verify.figures.disk import animated
    from tippedisk_verify.files import write_bytes

    file = folder / f"scene_{panel.scene.name}.gif"
    write_bytes(file, animated(panel, lambda place: advance(f"{file.name}, {place}", 0)))


def _endings(panel: Panel) -> list[str]:
    """What the panel's orbits end on, as lines."""
    lines = [f"scene {panel.scene.name}: Omega = {panel.omega} rad/s"]
    for start, orbit in enumerate(panel.orbits, start=1):
        ending = orbit.ending
        when = f" at {ending.time} s" if ending.time is not None else ""
        lines.append(f"  orbit {start}: {ending.kind}{when} ({ending.reason})")
    return lines


def _listed(common: Common) -> int:
    from tippedisk_verify.audit.catalogue import CLAIMS

    width = max(len(claim.name) for claim in CLAIMS)
    listing = [{"name": claim.name, "source": claim.source, "statement": claim.statement} for claim in CLAIMS]
    lines = (f"{claim.name:{width}}  {claim.statement} ({claim.source.partition(', ')[0]})" for claim in CLAIMS)
    print_result(common, {"claims": listing}, lines)
    return 0


def _verdict_lines(order: AuditJob, findings: Sequence[tuple[Claim, Finding]], long: bool) -> Iterator[str]:
    """A line of at most 80 characters for each claim: its name, its verdict and one number; or all there is to say."""
    from tippedisk_verify.report.results import claim_json, shown, summary, totals

    yield f"Claims ({order.parameters.name}, {order.parameters.friction} friction)"
    for claim, finding in findings:
        entry, value = claim_json(claim, finding, order), finding.computed[order.parameters.name]
        text = value.partition("; ")[0] if isinstance(value, str) else f"{shown(value)} {claim.unit}".rstrip()
        yield f"{claim.name:24}  {_verdict_words(entry):22}  {textwrap.shorten(text, 30, placeholder=' ...')}"
        if long:
            yield f"    {claim.statement} ({claim.source})"
            unit = f" {claim.unit}" if claim.unit else ""
            values = [f"{name}: {shown(one)}" for name, one in finding.computed.items()]
            yield f"    {'; '.join([f'paper: {claim.printed}'] * bool(claim.printed) + values)}{unit}"
            yield from (f"    {part}: {entry[part]}" for part in ("cause", "instead", "note") if entry[part])
            if proof := entry["proof"]:
                yield f"    {entry['grade']} by {proof['theorem']}: {proof['proves']}"
    yield totals(summary(findings)) + "."


def _verdict_words(entry: dict[str, Any]) -> str:
    """The verdict in at most 22 characters."""
    if entry["verdict"] == "holds-for":
        named = f"holds for {', '.join(entry['sets'])}"
        return named if len(named) <= 22 else f"holds for {len(entry['sets'])} of {len(entry['computed_by_set'])} sets"
    why = {"slip": " (slip)", "follows-from": " (term)"}.get(entry["class"], "")
    proved = " (proved)" if entry["grade"] == "proved" else ""
    return str(entry["verdict"]).replace("-", " ") + (why or proved)


COMMANDS = (verify, scene)
