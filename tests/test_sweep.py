"""Sweeps: every point once, nothing lost, whatever is killed."""

from __future__ import annotations

import csv
import json
import math
import os
import signal
import subprocess
import sys
import time
from contextlib import nullcontext
from fractions import Fraction
from pathlib import Path

import pytest

from tests.dask_cluster import changed_package, surroundings
from tippedisk_verify import __version__
from tippedisk_verify.cli import main
from tippedisk_verify.errors import InputError
from tippedisk_verify.fingerprint import closure
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.sweep.plan import Plan, axis, computed, here
from tippedisk_verify.sweep.running import swept
from tippedisk_verify.theory.hopf import omega_crit


def _rows(path: Path) -> list[dict[str, str]]:
    with open(path, newline="") as stream:
        return list(csv.DictReader(stream))


# ------------------------------------------------------------------------------------------ points
def test_ranges_are_exact() -> None:
    assert axis("omega=30.1:30.4:4") == ("omega", ("30.1", "30.2", "30.3", "30.4"))
    assert axis("e=0:1:4") == ("e", ("0", "1/3", "2/3", "1"))
    assert axis("gamma=pi/2,1.2") == ("gamma", ("pi/2", "1.2"))


@pytest.mark.parametrize(
    "text", ["", "omega", "omega=", "=1", "a=1:2", "a=1:2:1", "a=1:2:x", "a=b", "a=1:pi:3", "a=1:2:٣"]
)
def test_axes_that_make_no_sense(text: str) -> None:
    with pytest.raises(InputError):
        axis(text)


@pytest.mark.parametrize(
    ("analysis", "axes"),
    [
        ("orbit", ()), ("nothing", (("mu", ("0.3",)),)), ("orbit", (("mu", ("0.3",)),)),
        ("hopf", (("omega", ("30",)),)),
        ("orbit", (("omega", ("30",)), ("below-crit", ("0.5",)))), ("hopf", (("mu", ("1",)), ("mu", ("2",)))),
        ("hopf", (("mu", ("0.3",) * 2000), ("g", ("9.8",) * 2000))),
    ],
)  # fmt: skip
def test_plans_that_make_no_sense(analysis: str, axes: tuple) -> None:
    with pytest.raises(InputError):
        Plan(analysis, PRINTED, axes)


def test_a_point_without_numbers_says_why() -> None:
    row = computed(Plan("orbit", PRINTED, (("omega", ("31.5",)),)), {"omega": "31.5"})
    assert row["status"] != "ok"
    row = computed(Plan("hopf", PRINTED, (("e", ("0.9",)),)), {"e": "0.9"})
    assert "eccentricity" in row["status"]


@pytest.mark.parametrize(
    ("analysis", "point"),
    [
        ("orbit", {"omega": "91/3"}), ("orbit", {"below-crit": "0.5"}), ("equilibria", {"omega": "91/3", "mu": "0.2"}),
        ("hopf", {"e": "1/400", "m": "0.4", "g": "9.8"}), ("heteroclinic", {"epsilon": "0.1"}),
        ("trajectory", {"omega": "91/3", "beta": "pi/2", "gamma": "1.9", "v": "2", "duration": "1/3"}),
    ],
)  # fmt: skip
def test_what_was_given_stays_beside_what_was_found(analysis: str, point: dict[str, str]) -> None:
    axes = tuple((name, (value,)) for name, value in point.items())
    row = computed(Plan(analysis, PRINTED, axes), point)
    assert row["status"] == "ok"
    assert {name: row[name] for name in point} == point
    results = [name for name in row if f"{name}_uncertainty" in row]
    assert results
    assert not set(results) & set(point)


def test_a_trajectory_ends_in_columns_of_its_own() -> None:
    """beta' = v, and gamma' = 0 at beta = pi/2: a moment after the start."""
    point = {"omega": "30", "beta": "pi/2", "gamma": "1.9", "v": "2", "duration": "1e-6"}
    row = computed(Plan("trajectory", PRINTED, tuple((name, (value,)) for name, value in point.items())), point)
    assert float(row["final_beta"]) == pytest.approx(math.pi / 2 + 2e-6, rel=0, abs=1e-9)  # v' is below 1000 rad/s^2
    assert float(row["final_gamma"]) == pytest.approx(1.9, rel=0, abs=1e-9)  # Omega v t^2 is 6e-11
    assert float(row["final_v"]) == pytest.approx(2, rel=0, abs=1e-3)  # v' t, as above


# ------------------------------------------------------------------------------------------ runs
def test_a_table_in_the_order_of_the_points(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "hopf.csv"
    arguments = ["sweep", "hopf", "--over", "e=0.001:0.003:3", "--over", "g=9.7,9.81", "--executor", "serial"]
    assert main([*arguments, "--digits", "25", "--out", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["points"] == 6
    rows = _rows(out)
    assert [(row["e"], row["g"]) for row in rows][:3] == [("0.001", "9.7"), ("0.001", "9.81"), ("0.002", "9.7")]
    for row in rows:
        found = omega_crit(PRINTED.changed(e=Fraction(row["e"]), g=Fraction(row["g"])), 60)
        assert abs(Fraction(row["omega_crit"]) - found.value) <= Fraction(row["omega_crit_uncertainty"]) * 2
    assert [path.name for path in tmp_path.iterdir()] == ["hopf.csv"]


def test_cycles_and_trajectories(tmp_path: Path) -> None:
    assert (
        main(["sweep", "orbit", "--over", "below-crit=0.3,0.5", "--out", str(tmp_path / "a.csv"), "--jobs", "1"]) == 0
    )
    assert [row["stable"] for row in _rows(tmp_path / "a.csv")] == ["true", "true"]
    over = ["--over", "omega=30.4", "--over", "v=0,2", "--over", "duration=1"]
    assert main(["sweep", "trajectory", *over, "--out", str(tmp_path / "b.csv"), "--jobs", "1"]) == 0
    assert [row["ended"] for row in _rows(tmp_path / "b.csv")] == ["reached", "reached"]


def test_parquet_holds_the_same_strings(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    arguments = ["sweep", "equilibria", "--over", "omega=30.1:30.5:3", "--executor", "serial", "--quiet", "--out"]
    for name in ("a.csv", "a.parquet"):
        assert main([*arguments, str(tmp_path / name)]) == 0
    assert parquet.read_table(tmp_path / "a.parquet").to_pylist() == _rows(tmp_path / "a.csv")


def test_an_interrupted_sweep_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = Plan("hopf", PRINTED, (("g", tuple(f"9.{n}" for n in range(10))),))
    calls: list[str] = []

    def broken(plan: Plan, point: dict[str, str]) -> dict[str, str]:
        if len(calls) == 4:
            raise KeyboardInterrupt
        calls.append(point["g"])
        return {"g": point["g"], "status": "ok"}

    monkeypatch.setattr("tippedisk_verify.sweep.running.computed", broken)
    out = tmp_path / "a.csv"
    with pytest.raises(KeyboardInterrupt):
        swept(plan, out, pool=lambda: nullcontext(None))
    assert not out.exists()
    journal = tmp_path / ".a.csv.journal"
    with open(journal, "ab") as stream:
        stream.write(b'{"point": 4, "row": {"g": "9')  # the line that a power cut leaves
    calls.append("no interrupt any more")
    assert swept(plan, out, pool=lambda: nullcontext(None)) == (10, 0)
    assert [call for call in calls if call.startswith("9")] == [f"9.{n}" for n in range(10)]
    assert [row["g"] for row in _rows(out)] == [f"9.{n}" for n in range(10)]
    assert not journal.exists()


def test_no_row_comes_from_code_that_its_origin_leaves_out() -> None:
    """What is really imported while rows of all kinds are computed."""
    points = [
        ("orbit", {"below-crit": "0.5"}, ("linear", "smooth")), ("equilibria", {"omega": "30"}, ("linear",)),
        ("hopf", {"g": "9.8"}, ("linear",)), ("heteroclinic", {"g": "9.81"}, ("linear",)),
        ("trajectory", {"omega": "30", "duration": "1"}, ("linear", "smooth")),
    ]  # fmt: skip
    program = (
        "import sys\nfrom tippedisk_verify.sweep.plan import Plan, computed\n"
        "from tippedisk_verify.model.parameters import PRINTED\n"
        f"for analysis, point, laws in {points}:\n"
        "    axes = tuple((name, (value,)) for name, value in point.items())\n"
        "    for law in laws:\n"
        "        assert computed(Plan(analysis, PRINTED.with_friction(law), axes), point)['status'] == 'ok'\n"
        "print('\\n'.join(name for name in sys.modules if name.startswith('tippedisk_verify.')))"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert set(run.stdout.split()) <= set(closure("tippedisk_verify.sweep.plan"))


def _interrupted(out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A sweep of ten points into this file, of which four were computed."""
    calls: list[object] = []

    def broken(plan: Plan, point: dict[str, str]) -> dict[str, str]:
        if len(calls) == 4:
            raise KeyboardInterrupt
        calls.append(point)
        return computed(plan, point)

    plan = Plan("hopf", PRINTED, _TEN)
    with monkeypatch.context() as patch:
        patch.setattr("tippedisk_verify.sweep.running.computed", broken)
        with pytest.raises(KeyboardInterrupt):
            swept(plan, out, pool=lambda: nullcontext(None))


_TEN = (("g", tuple(f"9.{n}" for n in range(10))),)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("theory/hopf.py", "from __future__", "# other words\nfrom __future__"), "has rows from changed code"),
        (("__init__.py", f'"{__version__}"', '"0.0.1"'), f"from tippedisk_verify {__version__} instead of 0.0.1"),
    ],
    ids=["code", "version"],
)  # fmt: skip
def test_other_code_does_not_go_on_with_a_journal(
    change: tuple[str, str, str], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    swept(Plan("hopf", PRINTED, _TEN), tmp_path / "b.csv", pool=lambda: nullcontext(None))
    out, journal = tmp_path / "a.csv", tmp_path / ".a.csv.journal"
    _interrupted(out, monkeypatch)
    before = journal.read_bytes()
    over = f"g={','.join(_TEN[0][1])}"
    run = subprocess.run(
        [sys.executable, "-m", "tippedisk_verify", "sweep", "hopf", "--over", over, "--out", str(out)],
        capture_output=True, text=True, cwd=tmp_path, env=surroundings(changed_package(tmp_path / "other", *change)),
    )  # fmt: skip
    assert run.returncode == 2
    assert words in run.stderr
    assert "remove the file" in run.stderr
    assert run.stderr.count("\n") == 1
    assert journal.read_bytes() == before
    swept(Plan("hopf", PRINTED, _TEN), out, pool=lambda: nullcontext(None))
    assert out.read_bytes() == (tmp_path / "b.csv").read_bytes()


def test_rows_of_a_process_with_other_code_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As when a new version is installed while a pool's processes start."""
    old = here() | {"numpy": "1.0"}
    monkeypatch.setattr("tippedisk_verify.sweep.answers.origin", lambda module: old)
    arguments = ["sweep", "hopf", "--over", "g=9.7:9.9:9", "--jobs", "2", "--out", str(tmp_path / "a.csv")]
    assert main(arguments) == 1
    told = capsys.readouterr().err
    assert f"numpy {here()['numpy']} instead of 1.0" in told
    assert told.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_journal_of_another_sweep_is_not_used(tmp_path: Path) -> None:
    (tmp_path / ".a.csv.journal").write_text('{"plan": "other"}\n')
    plan = Plan("hopf", PRINTED, (("g", ("9.8",)),))
    with pytest.raises(InputError, match="another sweep"):
        swept(plan, tmp_path / "a.csv", pool=lambda: nullcontext(None))


_SWEEP = ["sweep", "orbit", "--over", "below-crit=0.1:0.7:40", "--quiet"]


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc to find the processes")
def test_killed_workers_lose_nothing(tmp_path: Path) -> None:
    """One process of the pool is killed in mid-run; the pool is made anew and each point is in the table once."""
    out = tmp_path / "a.csv"
    command = [sys.executable, "-m", "tippedisk_verify", *_SWEEP, "--jobs", "2", "--out", str(out)]
    run = subprocess.Popen(command, start_new_session=True)
    journal = tmp_path / ".a.csv.journal"
    until = time.monotonic() + 240  # s, against hanging only
    while time.monotonic() < until and not (journal.exists() and journal.read_bytes().count(b"\n") > 5):
        time.sleep(0.02)
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = int(path.read_text().rsplit(")", 1)[1].split()[1])
            worker = b"spawn_main" in (path.parent / "cmdline").read_bytes()
        except OSError:
            continue
        if parent == run.pid and worker:
            os.kill(int(path.parent.name), signal.SIGKILL)
            break
    assert run.wait(timeout=240) == 0
    speeds = [row["below-crit"] for row in _rows(out)]
    assert len(speeds) == len(set(speeds)) == 40
    assert {row["status"] for row in _rows(out)} == {"ok"}


_CLUSTER = """
import os, signal, sys
from distributed import LocalCluster
from tippedisk_verify.cli import main

if __name__ == "__main__":
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        victim = cluster.workers[0].process.process.pid
        write_through, kept = os.fsync, []

        def kill_at_the_sixth(stream):  # each row is written through to the disk
            write_through(stream)
            kept.append(None)
            if len(kept) == 6:
                os.kill(victim, signal.SIGKILL)
                print("killed", flush=True)

        os.fsync = kill_at_the_sixth
        address = cluster.scheduler_address.removeprefix("tcp://")
        status = main(sys.argv[2:] + ["--executor", "dask://" + address, "--out", sys.argv[1]])
    sys.exit(status)
"""


def test_a_cluster_that_loses_a_worker_loses_no_point(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    script = tmp_path / "cluster.py"
    script.write_text(_CLUSTER)
    out = tmp_path / "a.csv"
    run = subprocess.run(
        [sys.executable, str(script), str(out), *_SWEEP], capture_output=True, text=True, timeout=240, cwd=Path.cwd(),
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])},
    )  # fmt: skip
    assert run.returncode == 0, run.stderr[-2000:]
    assert "killed" in run.stdout
    speeds = [row["below-crit"] for row in _rows(out)]
    assert len(speeds) == len(set(speeds)) == 40
    assert {row["status"] for row in _rows(out)} == {"ok"}


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--executor", "nowhere"], "executor 'nowhere' is not known"), (["--out", "a.txt"], "must end in"),
        (["--executor", "dask://127.0.0.1:1"], "Dask scheduler"), (["--out", "nowhere/a.csv"], "existing folder"),
        (["--jobs", "0"], "--jobs"),
    ],
)  # fmt: skip
def test_bad_input(
    options: list[str], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("tippedisk_verify.sweep.cluster._CONNECT", 0.5)  # s; longer, it is only tried again
    arguments = ["sweep", "hopf", "--over", "g=9.8", *([] if "--out" in options else ["--out", "a.csv"]), *options]
    assert main(arguments) == 2
    told = capsys.readouterr().err
    assert says in told
    assert not (tmp_path / "a.csv").exists()
