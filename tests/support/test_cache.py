"""The cache returns stored values or nothing: never an error, never a part."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tippedisk_verify.support.cache import VARIABLE, Cache, code_folder, default_folder

KEY = "ab" * 32
VALUE = {"value": "30.88659268864356722", "width": None, "nested": [1, 2.5, "Ω", True]}


def test_stored_values_are_returned(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "folder"
    Cache(folder).put(KEY, VALUE)
    assert Cache(folder).get(KEY) == VALUE
    assert Cache(tmp_path).get(KEY) is None
    fresh = Cache(folder, fresh=True)  # finds nothing but replaces
    assert fresh.get(KEY) is None
    fresh.put(KEY, "newer")
    assert Cache(folder).get(KEY) == "newer"


@pytest.mark.parametrize(
    "damage",
    [
        lambda content: b"",
        lambda content: content[:70],
        lambda content: content.replace(b"30.88", b"30.89"),
        lambda content: b"\xff" * 100,
        lambda content: b"[" * 200_000,
    ],
)
def test_damaged_files_count_as_missing(damage, tmp_path: Path) -> None:
    cache = Cache(tmp_path)
    cache.put(KEY, VALUE)
    (path,) = tmp_path.iterdir()
    path.write_bytes(damage(path.read_bytes()))
    assert cache.get(KEY) is None
    cache.put(KEY, VALUE)
    assert cache.get(KEY) == VALUE


def test_a_cache_that_cannot_be_used_is_no_error(tmp_path: Path) -> None:
    in_the_way = tmp_path / "file"
    in_the_way.write_text("not a folder")
    (tmp_path / f"{KEY}.json").mkdir()
    for folder in (None, in_the_way, in_the_way / "below", Path("/proc/nothing"), tmp_path):
        cache = Cache(folder)
        cache.put(KEY, VALUE)
        assert cache.get(KEY) is None
        cache.remove_unused()
    assert in_the_way.read_text() == "not a folder"


def test_runs_at_the_same_time_see_whole_files(tmp_path: Path) -> None:
    program = (
        "import sys; from pathlib import Path; from tippedisk_verify.support.cache import Cache\n"
        "cache = Cache(Path(sys.argv[1]))\n"
        f"for n in range(15): cache.put('{KEY}', [sys.argv[2]] * 3000); v = cache.get('{KEY}'); "
        "assert v is not None and len(v) == 3000 and len(set(v)) == 1, v and len(v)"
    )
    runs = [subprocess.Popen([sys.executable, "-c", program, str(tmp_path), name]) for name in "ab"]
    assert [run.wait() for run in runs] == [0, 0]
    assert [path.name for path in tmp_path.iterdir()] == [f"{KEY}.json"]


def test_only_old_files_of_the_cache_are_removed(tmp_path: Path) -> None:
    cache = Cache(tmp_path)
    cache.put(KEY, VALUE)
    cache.put("cd" * 32, VALUE)
    remains = tmp_path / f".{KEY}.json-abcd1234"
    foreign = tmp_path / "notes.txt"
    for path in (remains, foreign):
        path.write_text("x")
    long_ago = time.time() - 100 * 86400
    for path in (tmp_path / f"{KEY}.json", remains, foreign):
        os.utime(path, (long_ago, long_ago))
    assert cache.get(KEY) == VALUE  # used now, so no longer old
    cache.remove_unused()
    assert {path.name for path in tmp_path.iterdir()} == {
        f"{KEY}.json",
        f"{'cd' * 32}.json",
        "notes.txt",
    }


def test_the_folder_of_the_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "own"))
    for chosen, results, code in (
        ("off", None, None),
        (str(tmp_path), tmp_path, tmp_path),
        ("code", None, tmp_path / "own" / "tippedisk-verify"),
        (None, *[tmp_path / "own" / "tippedisk-verify"] * 2),
    ):
        monkeypatch.delenv(VARIABLE, raising=False) if chosen is None else monkeypatch.setenv(
            VARIABLE, chosen
        )
        assert (default_folder(), code_folder()) == (results, code)
    monkeypatch.setenv("XDG_CACHE_HOME", "relative/folder")
    assert default_folder() == Path.home() / ".cache" / "tippedisk-verify"
