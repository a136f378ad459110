"""Files are whole or absent, links stay links, and what is no regular file is left alone."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from tippedisk_verify.cli import main
from tippedisk_verify.errors import InputError
from tippedisk_verify.files import alone, output_file, printable, write_bytes, write_text


def test_a_link_stays_and_its_target_is_replaced(tmp_path: Path) -> None:
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_text("old")
    link.symlink_to(target)
    write_text(link, "new")
    assert link.is_symlink()
    assert target.read_text() == "new"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes")
def test_special_files_are_refused(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(InputError, match="not a regular file"):
        write_bytes(pipe, b"x")
    with pytest.raises(InputError, match="cannot be written"):
        output_file(str(pipe))
    assert pipe.is_fifo()


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "data"
    path.write_text("old")

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match="data cannot be written: No space left"):
        write_text(path, "new")
    assert [item.name for item in tmp_path.iterdir()] == ["data"]
    assert path.read_text() == "old"


def test_terminals_are_told_nothing() -> None:
    assert printable("a\x1b[31m\nb\ud800é") == "a?[31m?b?é"


# ------------------------------------------------------------------------------------------ one at a time
def test_a_lock_that_is_held_and_one_that_cannot_be_had(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """To wait for another run helps in the first case only."""
    fcntl = pytest.importorskip("fcntl")
    lock = tmp_path / "lock"
    with alone(lock, "another run"), pytest.raises(InputError, match="another run"), alone(lock, "another run"):
        pass
    for number in (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EIO):

        def without_locks(*given: object, number: int = number) -> None:
            raise OSError(number, os.strerror(number))

        monkeypatch.setattr(fcntl, "flock", without_locks)
        with pytest.raises(InputError) as refused, alone(lock, "another run"):
            pass
        assert f"lock cannot be locked ({os.strerror(number)})" in str(refused.value)
        assert "another file system" in str(refused.value)
        assert "another run" not in str(refused.value)
    monkeypatch.undo()
    with alone(lock, "another run"):
        pass


@pytest.mark.parametrize(
    ("arguments", "out", "lock"),
    [
        ("verify --only omega_crit", "out", "out/.lock"),
        ("bench --only cycle", "out", "out/.lock"),
        ("sweep hopf --over mu=0.3 --executor serial", "a.csv", ".a.csv.journal"),
    ],
)
def test_a_second_run_into_one_place_is_refused_at_once(
    arguments: str, out: str, lock: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("fcntl")
    command = [*arguments.split(), "--quiet", "--out", str(tmp_path / out)]
    (tmp_path / lock).parent.mkdir(exist_ok=True)
    with alone(tmp_path / lock, "the first run"):
        assert main(command) == 2
        told = capsys.readouterr().err
        assert "another run is" in told
        assert told.count("\n") == 1
        assert [path.name for path in (tmp_path / lock).parent.iterdir()] == [(tmp_path / lock).name]
    if not arguments.startswith("bench"):  # races for minutes
        assert main(command) == 0
        assert not (tmp_path / lock).exists()
