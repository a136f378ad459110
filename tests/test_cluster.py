"""Sweeps on a Dask cluster: whatever goes wrong with it is one line, and no row is lost, wrong, or of other code."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.dask_cluster import changed_package, scheduler, surroundings, without_package, worker
from tippedisk_verify import __version__
from tippedisk_verify.certified.branch import omega_crit
from tippedisk_verify.cli import main
from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.model.precision import checked_digits
from tippedisk_verify.sweep import answers, cluster, running

pytest.importorskip("distributed")

_HOPF = ["sweep", "hopf", "--over", "g=9.7:9.9:41", "--quiet"]


@pytest.fixture
def serial(tmp_path: Path) -> bytes:
    """The bytes of `_HOPF` in one process."""
    assert main([*_HOPF, "--executor", "serial", "--out", str(tmp_path / "serial.csv")]) == 0
    return (tmp_path / "serial.csv").read_bytes()


def _kept(journal: Path) -> list[int]:
    return [json.loads(line)["point"] for line in journal.read_text().splitlines()[1:]]


class _Sweep:
    """`_HOPF` on a cluster into a file, with little handed out ahead."""

    def __init__(self, folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
        self.out, self.journal = folder / "a.csv", folder / ".a.csv.journal"
        self._capfd = capfd

    def __call__(self, host: str) -> int:
        return main([*_HOPF, "--executor", f"dask://{host}", "--jobs", "1", "--out", str(self.out)])

    def fails(self, host: str, *statuses: int) -> str:
        """What it says on its only line."""
        self._capfd.readouterr()
        assert self(host) in statuses
        said = self._capfd.readouterr()
        assert said.out == ""
        assert said.err.startswith("tippedisk-verify: ")
        assert said.err.count("\n") == 1, said.err
        assert not self.out.exists()
        return said.err

    def ends_as(self, serial: bytes) -> None:
        """Gone on with in one process, it computes what is missing only, and the table is that of a serial run."""
        kept = _kept(self.journal) if self.journal.exists() else []
        assert len(kept) == len(set(kept)) < 41
        computed: list[str] = []
        original = running.computed

        def counted(plan: object, point: dict[str, str]) -> dict[str, str]:
            computed.append(point["g"])
            return original(plan, point)  # type: ignore[arg-type]

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(running, "computed", counted)
            assert main([*_HOPF, "--executor", "serial", "--out", str(self.out)]) == 0
        assert len(kept) + len(computed) == 41
        assert self.out.read_bytes() == serial
        assert not self.journal.exists()


@pytest.fixture
def sweep(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> _Sweep:
    return _Sweep(tmp_path, capfd)


def _after_rows(monkeypatch: pytest.MonkeyPatch, count: int, action: Callable[[], object]) -> None:
    """Do something when so many rows have been kept: at most four more are under way then."""
    original = running._line
    seen: list[int] = []

    def line(index: int, row: dict[str, str]) -> str:
        seen.append(index)
        if len(seen) == count:
            action()
        return original(index, row)

    monkeypatch.setattr(running, "_line", line)


# ------------------------------------------------------------------------------------------ who answers
def _listening(answer: bytes | None) -> str:
    """Something that listens and sends this to whoever comes, or closes at once."""
    server = socket.create_server(("127.0.0.1", 0))
    kept = []

    def serve() -> None:
        while True:
            visitor, _ = server.accept()
            if answer is None:
                visitor.close()
            else:
                visitor.sendall(answer)
                kept.append(visitor)  # open, and silent from now on

    threading.Thread(target=serve, daemon=True).start()
    return f"127.0.0.1:{server.getsockname()[1]}"


@pytest.mark.parametrize(
    "answer", [None, b"", b"HTTP/1.1 400 Bad Request\r\n\r\n", bytes(64), b"SSH-2.0-OpenSSH_9.6\r\n"],
    ids=["closes", "silent", "http", "zeros", "ssh"],
)  # fmt: skip
def test_a_foreign_port(answer: bytes | None, sweep: _Sweep, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "_CONNECT", 1.0)
    host = _listening(answer)
    assert f"no Dask scheduler at {host}" in sweep.fails(host, 2)


def test_a_scheduler_without_workers_and_a_workers_own_port(
    sweep: _Sweep, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "_WORKERLESS", 0.1)
    with scheduler(tmp_path) as (_, host):
        said = sweep.fails(host, 1)
        assert "has no worker" in said
        assert f"dask worker tcp://{host}" in said
        with worker(host, tmp_path):
            (address,) = _addresses(host)
            assert "a Worker answers" in sweep.fails(address, 2)


def _addresses(host: str) -> list[str]:
    from distributed import Client

    with Client(f"tcp://{host}", set_as_default=False) as client:
        return [address.removeprefix("tcp://") for address in client.nthreads()]


# ------------------------------------------------------------------------------------------ workers with threads
_SWEEPS: dict[str, list[str]] = {
    "trajectory": ["--over", "omega=30.2:30.6:8", "--over", "v=0,3,6", "--over", "duration=1"],
    "trajectories of 10 s": ["--over", "omega=30.2:30.6:20", "--over", "v=0,1,2,3,4,5,6,7,8,9"],
    "heteroclinic": ["--over", "mu=0.25:0.35:6"],
    "orbit": ["--over", "below-crit=0.1:0.7:30", "--friction", "smooth"],
    "equilibria": ["--over", "omega=30.1:30.9:40", "--digits", "50"],
}


@pytest.mark.parametrize("what", ["trajectory", *(pytest.param(k, marks=pytest.mark.slow) for k in list(_SWEEPS)[1:])])
def test_a_worker_with_four_threads_gives_the_serial_bytes(what: str, tmp_path: Path) -> None:
    tables = [tmp_path / "serial.csv", tmp_path / "threads.csv"]
    analysis = "trajectory" if what.startswith("traj") else what
    arguments = ["sweep", analysis, *_SWEEPS[what], "--quiet"]
    with scheduler(tmp_path) as (_, host), worker(host, tmp_path, threads=4):
        for executor, table in zip(("serial", f"dask://{host}"), tables, strict=True):
            assert main([*arguments, "--executor", executor, "--out", str(table)]) == 0
    assert tables[1].read_bytes() == tables[0].read_bytes()


# ------------------------------------------------------------------------------------------ whose code
@pytest.mark.slow
def test_a_scheduler_needs_no_package(sweep: _Sweep, tmp_path: Path, serial: bytes) -> None:
    with scheduler(tmp_path, without_package(tmp_path / "without")) as (_, host), worker(host, tmp_path, threads=4):
        assert sweep(host) == 0
    assert sweep.out.read_bytes() == serial


_STRANGERS: dict[str, tuple[tuple[str, str, str], str]] = {
    "version": (
        ("__init__.py", f'__version__ = "{__version__}"', '__version__ = "0.0.1"'),
        f"has tippedisk_verify 0.0.1 instead of {__version__}",
    ),
    "code": (("theory/hopf.py", "from __future__", "# other words\nfrom __future__"), "has changed code"),
    "package": (
        ("fingerprint.py", "return version(package)", 'return "9" if package == "gmpy2" else version(package)'),
        "has gmpy2 9 instead of",
    ),
}  # fmt: skip


@pytest.mark.parametrize(
    "kind", ["none", "code", *(pytest.param(kind, marks=pytest.mark.slow) for kind in ("version", "package"))]
)
def test_a_worker_of_other_code_is_named(kind: str, sweep: _Sweep, tmp_path: Path) -> None:
    if kind == "none":
        path, words = without_package(tmp_path / "other"), "No module named 'tippedisk_verify'"
    else:
        path, words = changed_package(tmp_path / "other", *_STRANGERS[kind][0]), _STRANGERS[kind][1]
    with scheduler(tmp_path) as (_, host), worker(host, tmp_path), worker(host, tmp_path, path):
        said = sweep.fails(host, 1)
        assert words in said
        assert sum(f"tcp://{address} has" in said for address in _addresses(host)) == 1
        assert not sweep.journal.exists()


@pytest.mark.parametrize("kind", ["code", pytest.param("none", marks=pytest.mark.slow)])
def test_a_worker_of_other_code_that_joins_later(
    kind: str, sweep: _Sweep, tmp_path: Path, serial: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It takes the place of the only worker in mid-run: none of its rows is used."""
    if kind == "none":
        path = without_package(tmp_path / "other")
    else:
        # A row that anybody would see: with the old digits, rounded.
        path = changed_package(
            tmp_path / "other", "sweep/plan.py", '    row["status"] = "ok"', '    row["status"] = "old"'
        )
    monkeypatch.setattr(answers, "_PATIENCE", 1.0)
    with scheduler(tmp_path) as (_, host), worker(host, tmp_path) as good:
        stranger = worker(host, tmp_path, path)

        def replace() -> None:
            stranger.__enter__()
            good.kill()

        _after_rows(monkeypatch, 5, replace)
        try:
            said = sweep.fails(host, 1)
        finally:
            stranger.__exit__(None, None, None)
    assert "changed code" in said or "No module named 'tippedisk_verify'" in said
    assert "of 41 points are kept: run again" in said
    assert len(_kept(sweep.journal)) >= 5
    assert "old" not in sweep.journal.read_text()
    sweep.ends_as(serial)


@pytest.mark.parametrize("same", [True, False])
def test_each_answer_is_held_against_the_code_of_its_function(same: bool, tmp_path: Path) -> None:
    """A worker with another proof of the branch is trusted with sweeps, and not with arcs."""
    changed = ("certified/branch.py", "from __future__", "# other words\nfrom __future__")
    path = None if same else changed_package(tmp_path / "other", *changed)
    with (
        scheduler(tmp_path) as (_, host), worker(host, tmp_path, path),
        cluster.executor_at(f"dask://{host}") as there, answers.Compared(there) as compared,
    ):  # fmt: skip
        asked = compared.submit(omega_crit, PRINTED)
        if same:
            assert asked.result(60) == omega_crit(PRINTED)
            with pytest.raises(InputError, match="digits"):
                compared.submit(checked_digits, 0).result(60)
        else:
            with pytest.raises(Shortfall, match=r"an answer came from process .* has changed code"):
                asked.result(60)


@pytest.mark.slow(minutes=2)
def test_arcs_are_proved_by_a_cluster(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """The first arc is proved here, the second one there; it is that of this machine."""
    found = []
    with scheduler(tmp_path) as (_, host), worker(host, tmp_path):
        for executor in ("serial", f"dask://{host}"):
            arcs = ["--arcs", str(tmp_path / executor[:4]), "--executor", executor]
            assert main(["certify", "branch", "--to", "0.85", "--quiet", "--json", *arcs]) == 1
            found.append(json.loads(capfd.readouterr().out)["arcs"])
    assert len(found[0]) == 2
    assert found[1] == found[0]


# ------------------------------------------------------------------------------------------ gone in mid-run
@pytest.mark.parametrize(
    "number",
    [signal.SIGKILL, *(pytest.param(n, marks=pytest.mark.slow) for n in (signal.SIGTERM, signal.SIGSTOP))],
)
def test_a_scheduler_that_goes_away(
    number: int, sweep: _Sweep, tmp_path: Path, serial: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(answers, "_PATIENCE", 1.0)
    monkeypatch.setattr(cluster, "_ANSWER", 5.0)
    with scheduler(tmp_path) as (process, host), worker(host, tmp_path):
        _after_rows(monkeypatch, 5, lambda: process.send_signal(number))
        said = sweep.fails(host, 1)
    kept = len(_kept(sweep.journal))
    assert kept >= 5
    assert f"{kept} of 41 points are kept: run again" in said
    sweep.ends_as(serial)


@pytest.mark.slow
def test_workers_that_go_away(sweep: _Sweep, tmp_path: Path, serial: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(answers, "_PATIENCE", 0.5)
    monkeypatch.setattr(cluster, "_WORKERLESS", 1.0)
    with scheduler(tmp_path) as (_, host), worker(host, tmp_path) as only:
        _after_rows(monkeypatch, 5, only.kill)
        assert "has no worker" in sweep.fails(host, 1)
    sweep.ends_as(serial)


def test_the_longest_waits_stay_below_a_minute() -> None:
    """Asking who is there, the client's connection, no worker, the question to the workers; then leaving."""
    assert 3 * cluster._CONNECT + cluster._WORKERLESS + cluster._ANSWER < 60
    # In mid-run: two looks, the second of which finds the cluster still without workers.
    assert 2 * answers._PATIENCE + cluster._WORKERLESS + cluster._CONNECT < 60
    assert answers._PATIENCE + cluster._ANSWER + cluster._CONNECT < 60


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["silent", "no worker", "dead scheduler", "stopped scheduler"])
def test_the_program_ends(kind: str, tmp_path: Path) -> None:
    """As a process, with its own waiting times and all that libraries write at its end."""
    out, journal = tmp_path / "a.csv", tmp_path / ".a.csv.journal"
    over = ["--over", "g=9.7:9.9:1000", "--over", "r=0.045,0.046,0.047", "--jobs", "1"]
    command = [sys.executable, "-m", "tippedisk_verify", "sweep", "hopf", *over, "--out", str(out), "--executor"]

    def started(host: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [*command, f"dask://{host}"], stderr=subprocess.PIPE, text=True, cwd=tmp_path, env=surroundings(None)
        )

    def told(run: subprocess.Popen[str]) -> None:
        _, err = run.communicate(timeout=240)
        assert run.returncode in (1, 2), err
        assert err.count("\n") == 1, err

    if kind == "silent":
        told(started(_listening(b"")))
        return
    with scheduler(tmp_path) as (process, host):
        if kind == "no worker":
            told(started(host))
            return
        with worker(host, tmp_path):
            run = started(host)
            while not (journal.exists() and journal.read_bytes().count(b"\n") > 5):
                assert run.poll() is None
            process.send_signal(signal.SIGKILL if kind == "dead scheduler" else signal.SIGSTOP)
            told(run)
    assert len(_kept(journal)) >= 5
