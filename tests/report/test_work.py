"""What is kept is what would be computed; what is unchanged is not computed again; cores change nothing."""

from __future__ import annotations

import json
from contextlib import nullcontext
from pathlib import Path

import pytest

from tippedisk_verify.audit.catalogue import CLAIMS, selected
from tippedisk_verify.audit.claims import Audit, Finding, examined
from tippedisk_verify.cache import VARIABLE, Cache
from tippedisk_verify.cli import main
from tippedisk_verify.commands.common import processes
from tippedisk_verify.figures.catalogue import EXHIBITS, exhibits_for
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.parameters import CALIBRATED, PRINTED
from tippedisk_verify.report import work
from tippedisk_verify.report.work import AuditJob, Task, key, run, tasks_for

LOCAL = ("omega_crit", "lambda_3", "sliding_velocity", "chi", "period_crit")
HEAVY = ("attraction", "slow_manifold_h1", "order_0_hopf", "order_0_noninverted", "second_noninverted_state")


def quiet(label: str, steps: int) -> None:
    """No bar."""


def test_a_record_loses_nothing() -> None:
    audit = Audit(PRINTED, Taylor())
    for claim in selected([*LOCAL, "attraction", "order_1_hopf"]):
        finding = examined(audit, claim)
        record = json.loads(json.dumps(finding.record()))
        assert Finding.of_record(record) == finding
        assert Finding.of_record(record).record() == record


@pytest.mark.parametrize(
    "record",
    [
        {},
        [],
        "text",
        {"computed": {}, "holds": {"printed": "yes"}, "note": ""},
        {"computed": {"printed": ["1/0", "0"]}, "holds": {}, "note": ""},
        {"computed": {"printed": ["x", "0"]}, "holds": {}, "note": ""},
        {"computed": {"printed": 3}, "holds": {}, "note": ""},
        {"computed": {}, "holds": {}},
    ],
)
def test_a_record_of_another_shape_is_computed_again(record, tmp_path: Path) -> None:
    order, task, cache = AuditJob(PRINTED, 12, ("omega_crit",)), Task("claim", "omega_crit"), Cache(tmp_path)
    cache.put(key(order, task), record)
    outcome = run(order, [task], cache, lambda tasks: nullcontext(None), quiet)
    assert not outcome.kept
    assert Finding.of_record(outcome.records[task]).sets == ("calibrated", "geometry")
    assert run(order, [task], cache, lambda tasks: nullcontext(None), quiet).kept == {task}


@pytest.mark.slow
def test_kept_and_computed_are_the_same_object(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path / "kept"))
    only = ["--only", "omega_crit,lambda_3,attraction,order_1_hopf"]
    results = []
    for name, options in (("one", []), ("two", []), ("three", ["--fresh"])):
        assert main(["verify", "--json", "--out", str(tmp_path / name), *only, *options]) == 0
        results.append(json.loads(capsys.readouterr().out))
    runs = [result.pop("run") for result in results]
    assert results[0] == results[1] == results[2]
    tasks = len(tasks_for(AuditJob(PRINTED, 12, tuple(only[1].split(","))), figures=True))
    assert [(run["kept"], run["computed"]) for run in runs] == [(0, tasks), (tasks, 0), (0, tasks)]
    for path in (tmp_path / "one").iterdir():
        if path.name not in ("results.json", "report.html", "report.md"):
            assert path.read_bytes() == (tmp_path / "two" / path.name).read_bytes() == (
                tmp_path / "three" / path.name
            ).read_bytes(), path.name  # fmt: skip


def test_nothing_is_computed_for_what_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    order, cache = AuditJob(PRINTED, 12, LOCAL), Cache(tmp_path)
    tasks = tasks_for(order, figures=False)
    run(order, tasks, cache, lambda tasks: nullcontext(None), quiet)

    def never(*arguments: object) -> None:
        raise AssertionError("computed again")

    monkeypatch.setattr(work, "compute", never)
    assert run(order, tasks, cache, never, quiet).kept == set(tasks)


def test_a_key_is_for_one_question(tmp_path: Path) -> None:
    orders = [
        AuditJob(PRINTED, 12, LOCAL),
        AuditJob(CALIBRATED, 12, LOCAL),
        AuditJob(PRINTED.changed(mu="0.31", name="table1"), 12, LOCAL),
        AuditJob(PRINTED.changed(name="other"), 12, LOCAL),
        AuditJob(PRINTED.with_friction("smooth"), 12, LOCAL),
        AuditJob(PRINTED, 13, LOCAL),
    ]
    tasks = [Task("claim", name) for name in LOCAL] + [Task("figure", "eigenvalues")]
    keys = [key(order, task) for order in orders for task in tasks]
    assert len(set(keys)) == len(keys)
    scenes = [AuditJob(PRINTED, 12, names) for names in (("scene_d",), ("scene_d", "scene_e"))]
    assert key(scenes[0], Task("figure", "scenes_3d")) != key(scenes[1], Task("figure", "scenes_3d"))


def test_processes_change_nothing() -> None:
    order = AuditJob(PRINTED, 12, (*LOCAL, *HEAVY))
    tasks = tasks_for(order, figures=False)
    labels: list[str] = []
    steps = 0

    def advance(label: str, more: int) -> None:
        nonlocal steps
        labels.append(label)
        steps += more

    alone = run(order, tasks, Cache(None), lambda tasks: nullcontext(None), quiet)
    shared = run(order, tasks, Cache(None), lambda tasks: processes(2), advance)
    assert shared.records == alone.records
    assert steps == len(tasks)
    assert set(LOCAL) <= set(labels)


def test_a_pool_whose_processes_die_is_no_end(monkeypatch: pytest.MonkeyPatch) -> None:
    from concurrent.futures import Future
    from concurrent.futures.process import BrokenProcessPool

    class Dying:
        def submit(self, *arguments: object) -> Future[object]:
            future: Future[object] = Future()
            future.set_exception(BrokenProcessPool("killed"))
            return future

    order = AuditJob(PRINTED, 12, HEAVY)
    outcome = run(order, tasks_for(order, figures=False), Cache(None), lambda tasks: nullcontext(Dying()), quiet)  # type: ignore[arg-type]
    assert {task.name for task in outcome.records} == set(HEAVY)


def test_every_claim_of_the_paper_has_a_formula_that_can_be_drawn() -> None:
    from tippedisk_verify.figures.formula import formulas_drawn

    assert [claim.name for claim in CLAIMS if claim.own_check] == [claim.name for claim in CLAIMS if not claim.formula]
    drawn = formulas_drawn(claim.formula for claim in CLAIMS if claim.formula)["drawn"]
    assert all(text.startswith("<svg role") for text in drawn.values())
    assert max(text.count("<svg") for text in drawn.values()) > 5  # the longest wraps like text
    with pytest.raises(ValueError, match="nonsense"):
        formulas_drawn([r"\nonsense"])


def test_exhibits_belong_to_claims() -> None:
    known = {claim.name for claim in CLAIMS}
    assert {figure for claim in CLAIMS for figure in claim.figures} == {exhibit.name for exhibit in EXHIBITS}
    everything = exhibits_for(sorted(known), "linear")
    assert everything == EXHIBITS
    assert {"near_omega_h"}.isdisjoint(e.name for e in exhibits_for(sorted(known), "smooth"))
