"""Sweeps: every point once, with invalid requests and with damaged remains of earlier runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor
from contextlib import contextmanager, nullcontext
from fractions import Fraction
from multiprocessing import active_children
from pathlib import Path
from typing import Any

import pytest

from tests.command_line import answer, printed, rows_of
from tippedisk_verify import AccuracyError, Disk, InputError, omega_crit
from tippedisk_verify.sweep import running
from tippedisk_verify.sweep.plan import SweepPlan, parse_axis, run_analysis

DISK = Disk("table1")


def after_rows(patch: pytest.MonkeyPatch, count: int, action: Callable[[], object]) -> None:
    """Call a function once a number of rows has been computed.

    The last of them is not in the journal yet.
    """
    original, seen = running._journal_line, []

    def line(index: int, row: dict[str, str]) -> bytes:
        seen.append(index)
        if len(seen) == count:
            action()
        return original(index, row)

    patch.setattr(running, "_journal_line", line)


@contextmanager
def asked() -> Iterator[list[int]]:
    """Yield the list of the points that sweeps compute in the context, in their order."""
    original, points = running._run, []

    def run(*given: Any) -> Iterator[Any]:
        for index, row in original(*given):
            points.append(index)
            yield index, row

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(running, "_run", run)
        yield points


# ------------------------------------------------------------------------------------------ points
def test_ranges_are_exact() -> None:
    assert parse_axis("omega=30.1:30.4:4") == ("omega", ("30.1", "30.2", "30.3", "30.4"))
    assert parse_axis("e=0:1:4") == ("e", ("0", "1/3", "2/3", "1"))
    assert parse_axis("gamma=pi/2,1.2") == ("gamma", ("pi/2", "1.2"))


@pytest.mark.parametrize(
    ("analysis", "name", "value"), [("orbit", "omega", "31.5"), ("hopf", "e", "0.9")]
)
def test_a_point_without_numbers_has_a_reason(analysis: str, name: str, value: str) -> None:
    row = run_analysis(analysis, DISK, 12, {name: value})
    assert list(row) == [name, "status"]
    assert ("eccentricity" in row["status"]) == (name == "e")


@pytest.mark.parametrize(
    ("analysis", "point", "found"),
    [
        ("orbit", {"omega": "91/3"}, {"stable": "true"}),
        ("orbit", {"below-crit": "0.5"}, {"stable": "true"}),
        (
            "equilibria",
            {"omega": "91/3", "mu": "0.2"},
            {"inverted_stable": "false", "noninverted_stable": "false"},
        ),
        ("hopf", {"e": "1/400", "m": "0.4", "g": "9.8"}, {"criticality": "supercritical"}),
        ("heteroclinic", {"epsilon": "0.1"}, {}),
        (
            "trajectory",
            {"omega": "91/3", "beta": "pi/2", "v": "2", "duration": "1/3"},
            {"ended": "reached"},
        ),
    ],
)
def test_a_row_holds_its_inputs_and_its_results(
    analysis: str, point: dict[str, str], found: dict[str, str]
) -> None:
    row = run_analysis(analysis, DISK, 12, point)
    expected = {**point, "status": "ok", **found}
    assert {name: row[name] for name in expected} == expected
    results = [name for name in row if f"{name}_uncertainty" in row]
    assert results
    assert not set(results) & set(point)


# ------------------------------------------------------------------------------------------ tables
def test_a_table_in_the_order_of_the_points(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    words = "sweep hopf --over e=0.001:0.003:3 --over g=9.7,9.81 --digits 25 --jobs 2"
    for name, executor in (("a.csv", "serial"), ("b.csv", "local"), ("a.parquet", "serial")):
        found = answer(f"{words} --executor {executor} --out {tmp_path / name}")
        assert found["points"] == 6
    rows = rows_of(tmp_path / "a.csv")
    assert [(row["e"], row["g"]) for row in rows][:3] == [
        ("0.001", "9.7"),
        ("0.001", "9.81"),
        ("0.002", "9.7"),
    ]
    for row in rows:
        found = omega_crit(DISK.changed(e=Fraction(row["e"]), g=Fraction(row["g"])), 60)
        assert (
            abs(Fraction(row["omega_crit"]) - found.value)
            <= Fraction(row["omega_crit_uncertainty"]) * 2
        )
    assert (tmp_path / "b.csv").read_bytes() == (tmp_path / "a.csv").read_bytes()
    assert parquet.read_table(tmp_path / "a.parquet").to_pylist() == rows
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv", "a.parquet", "b.csv"]


# ---------------------------------------------------------------------------------------- journals
_TEN = SweepPlan("hopf", DISK, (parse_axis("g=9.0:9.9:10"),), digits=3)


def _swept(out: Path) -> list[int]:
    """Sweep `_TEN` in this process and return the points that were computed."""
    with asked() as points:
        assert running.run_sweep(_TEN, out, lambda: nullcontext(None)) == (10, 0)
    return points


@pytest.fixture
def interrupted(tmp_path: Path) -> tuple[Path, bytes, bytes]:
    """Return a file that does not exist yet, its journal with four rows, and its final bytes."""
    assert _swept(tmp_path / "whole.csv") == list(range(10))
    lines = [
        running._journal_line(n, row) for n, row in enumerate(rows_of(tmp_path / "whole.csv")[:4])
    ]
    (tmp_path / ".a.csv.journal").write_bytes(running._journal_header(_TEN) + b"".join(lines))
    return (
        tmp_path / "a.csv",
        (tmp_path / ".a.csv.journal").read_bytes(),
        (tmp_path / "whole.csv").read_bytes(),
    )


def test_a_journal_is_continued_up_to_its_last_whole_line(
    interrupted: tuple[Path, bytes, bytes],
) -> None:
    """Check a last line without its end, left by a kill, and a line that has changed."""
    out, content, whole = interrupted
    lines = content.splitlines(keepends=True)
    assert len(lines) == 5
    kept = {
        content: 4,
        content[:-1]: 3,
        content[:-20]: 3,
        content + b'{"point": 4, "row": {"g": "9': 4,
        lines[0]: 0,
        lines[0][:30]: 0,
        b"": 0,
        content.replace(b'"ok"', b'"no"', 1): 0,
        lines[0] + b"".join(lines[2:]): 3,
    }
    for left, count in kept.items():
        out.with_name(".a.csv.journal").write_bytes(left)
        assert len(_swept(out)) == 10 - count
        assert out.read_bytes() == whole
        assert not out.with_name(".a.csv.journal").exists()


@pytest.mark.parametrize(
    ("what", "words"),
    [("code_version", "other code, named in its first line"), ("_journal_header", "another sweep")],
)
def test_a_journal_of_another_run_is_refused_and_kept(
    what: str, words: str, interrupted: tuple[Path, bytes, bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    out, content, whole = interrupted
    with monkeypatch.context() as patch:
        patch.setattr(
            running,
            what,
            lambda *given: "another" if what == "code_version" else b'{"plan": "another"}\n',
        )
        with pytest.raises(InputError, match=words):
            _swept(out)
    assert out.with_name(".a.csv.journal").read_bytes() == content
    assert len(_swept(out)) == 6
    assert out.read_bytes() == whole


# --------------------------------------------------------------------------------------- processes
_HOPF = "sweep hopf --over g=9.7:9.9:41 --quiet --jobs 2"


def test_a_process_that_is_killed_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    printed(f"{_HOPF} --executor serial --out {tmp_path / 'serial.csv'}")
    monkeypatch.setattr(running, "_MAX_QUEUED_POINTS", 4)
    after_rows(monkeypatch, 5, lambda: active_children()[0].kill())
    printed(f"{_HOPF} --out {tmp_path / 'a.csv'}")
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "serial.csv").read_bytes()


def test_processes_that_always_die_end_the_sweep(tmp_path: Path) -> None:
    class Dead(Executor):
        def submit(self, *given: Any, **named: Any) -> Any:
            raise BrokenExecutor("it died")

    with pytest.raises(AccuracyError, match="it died; 0 of 10 points are kept"):
        running.run_sweep(_TEN, tmp_path / "a.csv", Dead)
    assert list(tmp_path.iterdir()) == []
