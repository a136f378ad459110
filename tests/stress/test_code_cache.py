"""A damaged cache of compiled code is never run, and the program works without it."""

from __future__ import annotations

import random
import shutil
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from tests.stress.runs import LONGEST, environment, run
from tippedisk_verify.flow import code_cache
from tippedisk_verify.support.cache import VARIABLE

pytestmark = pytest.mark.skipif(
    sys.platform == "win32", reason="signals, limits and rights are POSIX here"
)

_SCENE = ["scene", "f", "--json", "--quiet"]
_FILE = "tippedisk-verify/cache.db"


def _done(path: Path, *commands: str) -> list[Any]:
    with closing(sqlite3.connect(path)) as database, database:
        return [database.execute(command).fetchone() for command in commands]


def _is_noted(path: Path) -> bool:
    return path.with_name("cache.db-sound").read_bytes() == code_cache._file_state(path)


def _spoil_code(path: Path, draw: random.Random) -> None:
    """Turn bits in the machine code of every entry, as a bad disk would."""
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
    path.write_bytes(content[: draw.choice((len(content), draw.randrange(len(content))))])


def _replace(path: Path, draw: random.Random) -> None:
    path.write_bytes(draw.choice((b"", b"no database" * 500, b"SQLite format 3\0" + bytes(4080))))


_DAMAGE = (_spoil_code, _spoil_bytes, _replace)


@pytest.fixture(scope="module")
def small_cache(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Make a cache by two runs; the second compiles nothing and notes that all is sound."""
    folder = tmp_path_factory.mktemp("small")
    done = [run(_SCENE, XDG_CACHE_HOME=str(folder)) for _ in range(2)]
    assert done[0].stdout == done[1].stdout
    assert _is_noted(folder / _FILE)
    return folder, done[0].stdout


@pytest.mark.parametrize(
    "seed",
    [0, *(pytest.param(n, marks=pytest.mark.slow(minutes=0.1)) for n in range(1, 6))],
)
def test_damaged_code_is_not_run(seed: int, small_cache: tuple[Path, str], tmp_path: Path) -> None:
    """Run once with the damage, and once with what that run has made of it."""
    filled, says = small_cache
    shutil.copytree(filled, tmp_path / "cache")
    _DAMAGE[seed % len(_DAMAGE)](tmp_path / "cache" / _FILE, random.Random(seed))
    for _ in range(2):
        done = run(_SCENE, XDG_CACHE_HOME=str(tmp_path / "cache"))
        assert (done.returncode, done.stderr, done.stdout) == (0, "", says)


_COLUMNS = "bitcode, comp_flag, env_fingerprint, opt_bc, opt_ir, obj, size, last_access"


@pytest.fixture
def entries(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Make a file of heyoka's form with five entries, as a finished run leaves it."""
    path = tmp_path / "cache.db"
    row = "x'00', 3, 'version', x'', x'', zeroblob(100), 100, 7"
    _done(
        path,
        "PRAGMA journal_mode = WAL",
        f"CREATE TABLE cache (hash INTEGER PRIMARY KEY, {_COLUMNS})",
        "CREATE TABLE config (key TEXT PRIMARY KEY, value INTEGER)",
        "INSERT INTO config VALUES ('total_size', 500)",
        f"INSERT INTO cache VALUES (9, {row})",
    )
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    monkeypatch.setattr(code_cache, "_in_use", [])
    monkeypatch.setattr(code_cache.atexit, "register", lambda *given, **named: None)
    assert _starts(path) == (0, 0)  # nobody vouches for what a run that was killed has left
    _done(path, *(f"INSERT INTO cache VALUES ({n}, {row})" for n in range(5)))
    code_cache.add_checksums(ending=True)
    return path


def _starts(path: Path) -> tuple[int, int]:
    """Return how many entries are left after a start, and their size according to heyoka."""
    heyoka = Mock()
    code_cache.use_checked_cache(heyoka)
    assert heyoka.set_diskcache_enabled.call_args.args == (True,)
    (count,), (size,) = _done(path, "SELECT count(*) FROM cache", "SELECT value FROM config")
    return count, size


@pytest.mark.parametrize("ends", [False, True])
@pytest.mark.parametrize("column", ["hash", *_COLUMNS.split(", ")])
def test_changed_entries_are_removed_and_others_kept(
    column: str, ends: bool, entries: Path
) -> None:
    """Include entries that change during a run: at its end it notes what it found and added."""
    changed = "1003" if column == "hash" else "x'41'"
    _done(entries, f"UPDATE cache SET {column} = {changed} WHERE hash = 3")
    if ends and column != "hash":  # by another name it is a new one
        code_cache.add_checksums(ending=True)
    # When an entry was last used decides about nothing but what goes first.
    assert _starts(entries) == ((5, 500) if column == "last_access" else (4, 400))
    assert _is_noted(entries)


@pytest.mark.parametrize("seed", range(9))
@pytest.mark.parametrize("damage", _DAMAGE[1:])
def test_a_damaged_file_keeps_whole_entries_or_none(
    damage: Callable[[Path, random.Random], None], seed: int, entries: Path
) -> None:
    damage(entries, random.Random(seed))
    heyoka = Mock()
    code_cache.use_checked_cache(heyoka)
    assert heyoka.set_diskcache_enabled.call_args.args == (True,)
    changed = (
        "SELECT count(*) FROM cache WHERE obj <> zeroblob(100) OR env_fingerprint <> 'version'"
    )
    assert not entries.exists() or _done(entries, changed) == [(0,)]


def test_a_killed_run_leaves_what_it_has_compiled(tmp_path: Path) -> None:
    """A checksum follows each entry at once, so only damaged entries are compiled again."""
    program = (
        "import os, tippedisk_verify as tv\ntv.Taylor()(tv.Request(tv.PRINTED, '30.4', (1.2, 0.3, "
        "0), 1))\nos._exit(9)"
    )
    own = environment(XDG_CACHE_HOME=str(tmp_path))
    assert (
        subprocess.run(
            [sys.executable, "-c", program], env=own, timeout=LONGEST, check=False
        ).returncode
        == 9
    )
    left, sound = _done(
        tmp_path / _FILE, "SELECT count(*) FROM cache", "SELECT count(*) FROM digests"
    )
    assert left == sound > (0,)
