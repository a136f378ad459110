"""Files are whole or absent, links stay links, and special files are left alone."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from tests.command_line import assert_refused, ran
from tippedisk_verify.errors import InputError
from tippedisk_verify.support.files import (
    file_lock,
    output_file,
    printable,
    write_bytes,
    write_text,
)


def test_a_link_stays_and_its_target_is_replaced(tmp_path: Path) -> None:
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_text("old")
    link.symlink_to(target)
    write_text(link, "new")
    assert link.is_symlink()
    assert target.read_text() == "new"


_NO_FILES = {
    "folder": "it is a folder",
    "nowhere/a.csv": "there is no folder nowhere",
    "file/a.csv": "there is no folder file",
    "": "that is no name of a file",
}
_NO_FOLDERS = {"file": "it is a file"}
_NEITHER = {"/dev/full": "No space left on device", "/dev/null": "it is not a regular file"}
#: Commands that write a file, or a folder, and what they say of names of neither.
_WRITES = {
    "integrate --omega 30.4 --state pi/2,2,0 --time 1 --out": _NO_FILES,
    "branch --omegas 30.5 --out": _NO_FILES,
    "sweep hopf --over mu=0.3 --out": _NO_FILES,
    "reference export table1/linear/hopf --out": _NO_FILES,
    "heteroclinic --out": _NO_FILES,
    "conformance questions": _NO_FILES,
    "verify --only chi --out": _NO_FOLDERS,
    "bench --only cycle --out": _NO_FOLDERS,
    "scene a --out": _NO_FOLDERS,
    "basin --omega 30.4 --count 3 --out": _NO_FOLDERS,
}


@pytest.mark.parametrize(
    ("command", "out", "says"),
    [
        (command, out, says)
        for command, refused in _WRITES.items()
        for out, says in (refused | _NEITHER).items()
    ],
)
def test_what_cannot_be_written_is_refused_with_the_reason(
    command: str, out: str, says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("folder").mkdir()
    Path("file").touch()
    message = assert_refused([*command.split(), out])
    assert message.endswith(f"cannot be written: {says}\n") or (
        f"cannot be written: {says} but" in message
    )
    assert not Path(out).is_file() or (out, Path(out).stat().st_size) == ("file", 0)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes")
def test_special_files_are_refused(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(InputError, match="not a regular file"):
        write_bytes(pipe, b"x")
    with pytest.raises(InputError, match="cannot be written"):
        output_file(str(pipe))
    assert pipe.is_fifo()


def test_a_failed_write_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "data"
    path.write_text("old")

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match="data cannot be written: No space left"):
        write_text(path, "new")
    assert [item.name for item in tmp_path.iterdir()] == ["data"]
    assert path.read_text() == "old"


def test_no_terminal_code_is_printed() -> None:
    assert printable("a\x1b[31m\nb\ud800é") == "a?[31m?b?é"


# ------------------------------------------------------------------------------------ one at a time
def test_a_lock_that_is_held_and_a_file_system_without_locks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Distinguish two cases: waiting for another run helps only in the first."""
    fcntl = pytest.importorskip("fcntl")
    lock = tmp_path / "lock"
    with (
        file_lock(lock, "another run"),
        pytest.raises(InputError, match="another run"),
        file_lock(lock, "another run"),
    ):
        pass
    for number in (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EIO):

        def without_locks(*given: object, number: int = number) -> None:
            raise OSError(number, os.strerror(number))

        monkeypatch.setattr(fcntl, "flock", without_locks)
        with pytest.raises(InputError) as refused, file_lock(lock, "another run"):
            pass
        assert f"lock cannot be locked ({os.strerror(number)})" in str(refused.value)
        assert "another file system" in str(refused.value)
        assert "another run" not in str(refused.value)
    monkeypatch.undo()
    with file_lock(lock, "another run"):
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
    arguments: str, out: str, lock: str, tmp_path: Path
) -> None:
    pytest.importorskip("fcntl")
    command = [*arguments.split(), "--quiet", "--out", str(tmp_path / out)]
    (tmp_path / lock).parent.mkdir(exist_ok=True)
    with file_lock(tmp_path / lock, "the first run"):
        assert "another run is" in assert_refused(command)
        assert [path.name for path in (tmp_path / lock).parent.iterdir()] == [
            (tmp_path / lock).name
        ]
    if not arguments.startswith("bench"):  # races for minutes
        assert ran(command).status == 0
        assert not (tmp_path / lock).exists()
