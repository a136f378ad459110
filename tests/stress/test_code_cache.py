"""A damaged cache of compiled code: never run, and the run goes on without it."""

from __future__ import annotations

import random
import shutil
import sqlite3
import sys
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from tests.stress.runs import ORBIT, run, without_rights
from tippedisk_verify.model.code_cache import without_damage

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals, limits and rights are POSIX here")


def _spoil_code(path: Path, draw: random.Random) -> None:
    """Turn three bits in the machine code of every entry, as a bad disk would."""
    with closing(sqlite3.connect(path)) as database, database:
        for key, code in database.execute("SELECT hash, obj FROM cache").fetchall():
            spoilt = bytearray(code)
            for _ in range(3):
                spoilt[draw.randrange(len(spoilt))] ^= 1 << draw.randrange(8)
            database.execute("UPDATE cache SET obj = ? WHERE hash = ?", (bytes(spoilt), key))


def _spoil_bytes(path: Path, draw: random.Random) -> None:
    content = bytearray(path.read_bytes())
    for _ in range(draw.choice((1, 30, 3000))):
        content[draw.randrange(len(content))] ^= 1 << draw.randrange(8)
    path.write_bytes(content[: draw.choice((len(content), len(content), draw.randrange(len(content))))])


def _replace(path: Path, draw: random.Random) -> None:
    path.write_bytes(draw.choice((b"", b"no database" * 500, b"SQLite format 3\0" + bytes(4080))))


def _damage(folder: Path, filled: tuple[Path, str], spoil: Any, draw: random.Random) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(filled[0], folder)
    spoil(folder / "tippedisk-verify" / "cache.db", draw)
    for _ in range(2):  # once with the damage, once with what that run has made of it
        done = run(ORBIT, XDG_CACHE_HOME=str(folder))
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout == filled[1]


@pytest.mark.slow
@pytest.mark.parametrize("spoil", [_spoil_code, _spoil_bytes, _replace])
def test_damaged_code_is_not_run(spoil: Any, filled_cache: tuple[Path, str], tmp_path: Path) -> None:
    _damage(tmp_path / "cache", filled_cache, spoil, random.Random(1))


@pytest.mark.slow
def test_thirty_damaged_caches(
    filled_cache: tuple[Path, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    draw = random.Random(2)
    for n in range(30):
        _damage(tmp_path / "cache", filled_cache, (_spoil_code, _spoil_bytes, _replace)[n % 3], draw)
    with capsys.disabled():
        print("\n30 damaged code caches, 60 runs after them: every one printed what it must")


def test_changed_entries_are_removed_and_others_kept(tmp_path: Path) -> None:
    path, count = tmp_path / "cache.db", 5
    with closing(sqlite3.connect(path)) as database, database:
        database.execute("CREATE TABLE cache (hash INTEGER PRIMARY KEY, obj BLOB NOT NULL)")
        database.executemany("INSERT INTO cache VALUES (?, ?)", [(n, bytes(100)) for n in range(count)])
    assert without_damage(path) == 0
    with closing(sqlite3.connect(path)) as database, database:
        database.execute("UPDATE cache SET obj = x'00' WHERE hash = 3")
    assert without_damage(path) == 1
    with closing(sqlite3.connect(path)) as database:
        assert database.execute("SELECT count(*) FROM cache").fetchone() == (count - 1,)
    assert without_damage(path) == 0
    path.write_text("no database")
    assert without_damage(path) == 1
    assert not path.exists()


@pytest.mark.slow
def test_a_cache_that_cannot_be_had(filled_cache: tuple[Path, str], tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    (tmp_path / "shut").mkdir(mode=0o555)
    (tmp_path / "odd" / "tippedisk-verify" / "cache.db").mkdir(parents=True)
    for place in ("file", "shut", "odd"):
        done = run(ORBIT, without_rights(), XDG_CACHE_HOME=str(tmp_path / place))
        assert (done.returncode, done.stderr, done.stdout) == (0, "", filled_cache[1])
