"""Sweeps on a Dask cluster: the bytes of a serial sweep, with losses, and no row of other code."""

from __future__ import annotations

import json
import signal
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.dask_cluster import changed_package, scheduler, worker, workers
from tests.stress.runs import Struck, ended_by
from tests.test_sweep import after_rows, asked
from tippedisk_verify.cli import main
from tippedisk_verify.support import workers as module
from tippedisk_verify.sweep import running

pytest.importorskip("distributed")

_HOPF = ["sweep", "hopf", "--over", "g=9.7:9.9:41", "--quiet"]


@pytest.fixture(scope="module")
def host(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Start a scheduler and two workers with four threads each."""
    folder = tmp_path_factory.mktemp("cluster")
    with (
        scheduler(folder) as (_, found),
        worker(found, folder, threads=4),
        worker(found, folder, threads=4),
    ):
        yield found


class _Sweep:
    """The sweep `_HOPF` into a file, with few points handed out ahead."""

    def __init__(self, folder: Path, serial: bytes) -> None:
        self.out, self.journal, self._serial = folder / "a.csv", folder / ".a.csv.journal", serial

    def arguments(self, executor: str) -> list[str]:
        return [*_HOPF, "--executor", executor, "--jobs", "2", "--out", str(self.out)]

    def kept(self) -> int:
        points = [json.loads(line)["point"] for line in self.journal.read_text().splitlines()[1:]]
        assert len(points) == len(set(points))
        return len(points)

    def ends_well(self, executor: str) -> None:
        """Run again: only missing points are computed, and the table is that of a serial run."""
        kept = self.kept() if self.journal.exists() else 0
        with asked() as points:
            assert main(self.arguments(executor)) == 0
        assert len(points) == len(set(points)) == 41 - kept
        assert self.out.read_bytes() == self._serial
        assert not self.journal.exists()


@pytest.fixture
def sweep(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> _Sweep:
    assert main([*_HOPF, "--executor", "serial", "--out", str(tmp_path / "serial.csv")]) == 0
    monkeypatch.setattr(running, "_MAX_QUEUED_POINTS", 4)
    return _Sweep(tmp_path, (tmp_path / "serial.csv").read_bytes())


# -------------------------------------------------------------------------------- the serial bytes
def test_two_workers_with_four_threads_give_the_serial_bytes(host: str, tmp_path: Path) -> None:
    axes = ["trajectory", "--over", "omega=30.2:30.6:5", "--over", "v=0,3", "--over", "duration=1"]
    tables = [tmp_path / "serial.csv", tmp_path / "threads.csv"]
    for executor, table in zip(("serial", f"dask://{host}"), tables, strict=True):
        assert main(["sweep", *axes, "--quiet", "--executor", executor, "--out", str(table)]) == 0
    assert tables[1].read_bytes() == tables[0].read_bytes()


# ------------------------------------------------------------------------------------ what is lost
@pytest.mark.parametrize(
    ("executor", "number"),
    [
        ("serial", signal.SIGKILL),
        pytest.param("local", signal.SIGKILL, marks=pytest.mark.slow),
        ("dask", signal.SIGINT),
    ],
)
def test_a_second_run_computes_missing_points(
    executor: str, number: int, host: str, sweep: _Sweep, tmp_path: Path
) -> None:
    """Interrupt as the twentieth row arrives.

    Its output ends with the last process, so none is left after it.
    """
    executor = f"dask://{host}" if executor == "dask" else executor
    struck = Struck(tmp_path / "hand")
    assert struck.at("call keep 20", sweep.arguments(executor), number)[::2] == ended_by(number)
    assert not sweep.out.exists()
    assert sweep.kept() == 19
    sweep.ends_well(executor)


def test_a_lost_worker_changes_nothing(
    host: str, sweep: _Sweep, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with worker(host, tmp_path, threads=4) as third:
        after_rows(monkeypatch, 5, third.kill)
        sweep.ends_well(f"dask://{host}")
        assert third.poll() is not None


def _fails(sweep: _Sweep, host: str, status: int, capfd: pytest.CaptureFixture[str]) -> str:
    """Return the only line that a sweep on this cluster prints when it fails."""
    capfd.readouterr()
    assert main(sweep.arguments(f"dask://{host}")) == status
    output = capfd.readouterr()
    assert (output.out, output.err.count("\n")) == ("", 1), output.err
    assert not sweep.out.exists()
    return output.err


def test_a_lost_scheduler_is_one_line(
    sweep: _Sweep,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with (
        scheduler(tmp_path) as (process, host),
        worker(host, tmp_path),
        monkeypatch.context() as patch,
    ):
        after_rows(patch, 5, process.kill)
        output = _fails(sweep, host, 1, capfd)
    kept = sweep.kept()
    assert kept >= 5
    assert (
        f"its scheduler is gone, or was started anew; {kept} of 41 points are kept: run again to "
        f"go on" in output
    )
    sweep.ends_well("serial")


# ------------------------------------------------------------------------------------- who answers
def test_no_row_comes_from_a_worker_of_other_code(
    sweep: _Sweep,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Replace the only worker in mid-run by one of other code."""
    change = ("sweep/plan.py", '    row["status"] = "ok"', '    row["status"] = "old"')
    path = changed_package(tmp_path / "other", *change)
    with (
        scheduler(tmp_path) as (_, host),
        worker(host, tmp_path) as good,
        monkeypatch.context() as patch,
    ):
        stranger = worker(host, tmp_path, path)

        def replace() -> None:
            stranger.__enter__()
            good.kill()

        after_rows(patch, 5, replace)
        try:
            output = _fails(sweep, host, 1, capfd)
        finally:
            stranger.__exit__(None, None, None)
    assert "workers need the same code" in output
    assert f"{sweep.kept()} of 41 points are kept: run again" in output
    assert "old" not in sweep.journal.read_text()
    sweep.ends_well("serial")


@pytest.mark.parametrize("who", ["silent", "worker"])
def test_a_port_without_a_scheduler(
    who: str,
    host: str,
    sweep: _Sweep,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:  # accepts, and never says a word
        silent = f"127.0.0.1:{server.getsockname()[1]}"
        if who != "worker":
            # s; nobody will ever answer there
            monkeypatch.setattr(module, "_SCHEDULER_TIMEOUT", 0.2)
        address = silent if who == "silent" else workers(host)[0]
        assert f"no Dask scheduler answers at {address}" in _fails(sweep, address, 2, capfd)
    assert not sweep.journal.exists()
