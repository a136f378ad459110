"""The execution of the main job: stored results are right, reused when unchanged, on any number of
cores.
"""

from __future__ import annotations

import json
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

import pytest

from tests.command_line import answer
from tippedisk_verify.audit.claim_catalogue import CLAIMS, select_claims
from tippedisk_verify.audit.claims import Audit, Finding, examine_claim
from tippedisk_verify.commands.jobs import process_pool
from tippedisk_verify.figures.exhibit_catalogue import EXHIBITS
from tippedisk_verify.flow import default_engine
from tippedisk_verify.model.parameters import CALIBRATED, PRINTED
from tippedisk_verify.report import tasks as audit_tasks
from tippedisk_verify.report.tasks import AuditJob, Task, run_tasks, task_key, tasks_for
from tippedisk_verify.support.cache import VARIABLE, Cache

LOCAL = ("omega_crit", "lambda_3", "sliding_velocity", "chi", "period_crit")
HEAVY = (
    "attraction",
    "slow_manifold_h1",
    "order_0_hopf",
    "order_0_noninverted",
    "second_noninverted_state",
)


def quiet(label: str, steps: int) -> None:
    """Show no progress."""


def alone(tasks: int) -> AbstractContextManager[None]:
    """Make no processes."""
    return nullcontext(None)


def test_a_record_loses_nothing() -> None:
    audit = Audit(PRINTED, default_engine())
    for claim in select_claims([*LOCAL, "attraction", "order_1_hopf"]):
        finding = examine_claim(audit, claim)
        record = json.loads(json.dumps(finding.record()))
        assert Finding.of_record(record) == finding
        assert Finding.of_record(record).record() == record


@pytest.mark.slow
def test_kept_and_computed_are_the_same_object(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path / "kept"))
    only = "--only omega_crit,lambda_3,attraction,order_1_hopf"
    results = [
        answer(f"verify {only} --out {tmp_path / name} {more}")
        for name, more in (("one", ""), ("two", ""), ("three", "--fresh"))
    ]
    runs = [result.pop("run") for result in results]
    assert results[0] == results[1] == results[2]
    assert [(run["kept"] > 0, run["computed"] > 0) for run in runs] == [
        (False, True),
        (True, False),
        (False, True),
    ]
    for path in (tmp_path / "one").iterdir():
        if path.name not in ("results.json", "report.html", "report.md"):
            assert path.read_bytes() == (tmp_path / "two" / path.name).read_bytes(), path.name
            assert path.read_bytes() == (tmp_path / "three" / path.name).read_bytes(), path.name


def test_nothing_is_computed_for_what_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    order, cache = AuditJob(PRINTED, 12, LOCAL), Cache(tmp_path)
    tasks = tasks_for(order, figures=False)
    first, _ = run_tasks(order, tasks, cache, alone, quiet)
    monkeypatch.setattr(audit_tasks, "run_task", None)
    assert run_tasks(order, tasks, cache, alone, quiet) == (first, frozenset(tasks))


def test_a_key_is_for_one_question() -> None:
    disks = (
        PRINTED,
        CALIBRATED,
        PRINTED.changed(mu="0.31", name="table1"),
        PRINTED.with_friction("smooth"),
    )
    orders = [AuditJob(disk, digits, LOCAL) for disk in disks for digits in (12, 13)]
    tasks = [Task("claim", name) for name in LOCAL] + [Task("figure", "eigenvalues")]
    keys = [task_key(order, task) for order in orders for task in tasks]
    assert len(set(keys)) == len(keys)
    scenes = [AuditJob(PRINTED, 12, names) for names in (("scene_d",), ("scene_d", "scene_e"))]
    assert task_key(scenes[0], Task("figure", "scenes_3d")) != task_key(
        scenes[1], Task("figure", "scenes_3d")
    )


def test_processes_change_nothing() -> None:
    order = AuditJob(PRINTED, 12, (*LOCAL, *HEAVY))
    tasks = tasks_for(order, figures=False)
    steps = []
    shared, _ = run_tasks(
        order,
        tasks,
        Cache(None),
        lambda tasks: process_pool(2),
        lambda label, more: steps.append(more),
    )
    assert shared == run_tasks(order, tasks, Cache(None), alone, quiet)[0]
    assert sum(steps) == len(tasks)


def test_a_pool_whose_processes_die_is_no_end(monkeypatch: pytest.MonkeyPatch) -> None:
    from concurrent.futures import Future
    from concurrent.futures.process import BrokenProcessPool

    class Dying:
        def submit(self, *arguments: object) -> Future[object]:
            future: Future[object] = Future()
            future.set_exception(BrokenProcessPool("killed"))
            return future

    order = AuditJob(PRINTED, 12, HEAVY)
    outcomes, _ = run_tasks(
        order,
        tasks_for(order, figures=False),
        Cache(None),
        lambda tasks: nullcontext(Dying()),
        quiet,
    )
    assert {task.name for task in outcomes} == set(HEAVY)


def test_every_claim_of_the_paper_has_a_formula_that_can_be_drawn() -> None:
    from tippedisk_verify.figures.formula import draw_formulas

    assert [claim.name for claim in CLAIMS if claim.own_check] == [
        claim.name for claim in CLAIMS if not claim.formula
    ]
    drawn = draw_formulas(claim.formula for claim in CLAIMS if claim.formula)["drawn"]
    assert all(text.startswith("<svg role") for text in drawn.values())
    assert max(text.count("<svg") for text in drawn.values()) > 5  # the longest wraps like text
    with pytest.raises(ValueError, match="nonsense"):
        draw_formulas([r"\nonsense"])


def test_exhibits_belong_to_claims() -> None:
    assert {figure for claim in CLAIMS for figure in claim.figures} == {
        exhibit.name for exhibit in EXHIBITS
    }
