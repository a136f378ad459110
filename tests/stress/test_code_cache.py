"""A damaged cache of compiled code: never run, and the run goes on without it."""

from __future__ import annotations

import os
import random
import shutil
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from tests.stress.runs import LONGEST, ORBIT, environment, run, without_rights
from tippedisk_verify.cache import VARIABLE
from tippedisk_verify.model import code_cache

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals, limits and rights are POSIX here")

_SCENE = ["scene", "f", "--json"]


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


def _cut(path: Path, draw: random.Random) -> None:
    path.write_bytes(path.read_bytes()[: draw.randrange(path.stat().st_size)])


def _replace(path: Path, draw: random.Random) -> None:
    path.write_bytes(draw.choice((b"", b"no database" * 500, b"SQLite format 3\0" + bytes(4080))))


def _put_folder(path: Path, draw: random.Random) -> None:
    name = draw.choice((path.name, f"{path.name}-wal", f"{path.name}-shm"))
    path.with_name(name).unlink(missing_ok=True)
    path.with_name(name).mkdir()


_DAMAGE = (_spoil_code, _spoil_bytes, _cut, _replace, _put_folder)


def _two_runs(folder: Path, filled: Path, arguments: list[str], says: str, damage: Any, draw: random.Random) -> None:
    """After a damage: once with it, once with what that run has made of it."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(filled, folder)
    damage(folder / "tippedisk-verify" / "cache.db", draw)
    for _ in range(2):
        done = run(arguments, XDG_CACHE_HOME=str(folder))
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout == says


@pytest.fixture(scope="module")
def small_cache(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """What one run has left, which nobody has looked at since."""
    folder = tmp_path_factory.mktemp("small")
    done = run(_SCENE, XDG_CACHE_HOME=str(folder))
    assert done.returncode == 0
    return folder, done.stdout


@pytest.mark.parametrize("damage", _DAMAGE)
def test_damaged_code_is_not_run(damage: Any, small_cache: tuple[Path, str], tmp_path: Path) -> None:
    _two_runs(tmp_path / "cache", small_cache[0], _SCENE, small_cache[1], damage, random.Random(1))


@pytest.mark.slow(minutes=2)
def test_twenty_damaged_caches(filled_cache: tuple[Path, str], tmp_path: Path) -> None:
    draw = random.Random(2)
    for n in range(20):
        _two_runs(tmp_path / "cache", filled_cache[0], ORBIT, filled_cache[1], _DAMAGE[n % len(_DAMAGE)], draw)


_COLUMNS = "bitcode, comp_flag, env_fingerprint, opt_bc, opt_ir, obj, size, last_access"


@pytest.fixture
def entries(tmp_path: Path) -> Path:
    """A file of heyoka's form with five entries."""
    path = tmp_path / "cache.db"
    with closing(sqlite3.connect(path)) as database, database:
        database.execute("PRAGMA journal_mode = WAL")
        database.execute(f"CREATE TABLE cache (hash INTEGER PRIMARY KEY, {_COLUMNS})")
        database.execute("CREATE TABLE config (key TEXT PRIMARY KEY, value INTEGER NOT NULL)")
        database.execute("INSERT INTO config VALUES ('total_size', 500)")
        row = (b"bit", 3, "version", b"", b"", bytes(100), 100, 7)
        database.executemany(f"INSERT INTO cache VALUES (?{', ?' * 8})", [(n, *row) for n in range(5)])
    return path


def _done(path: Path, *commands: str) -> list[Any]:
    with closing(sqlite3.connect(path)) as database, database:
        return [database.execute(command).fetchone() for command in commands]


def _settled(path: Path, script: str) -> list[Any]:
    """What is left of the entries after this, and their size as heyoka reads it."""
    code_cache._settle(path, path.with_name("cache.db-sound"), script)
    return _done(path, "SELECT count(*) FROM cache", "SELECT value FROM config") if path.exists() else []


@pytest.mark.parametrize("column", ["hash", *_COLUMNS.split(", ")])
def test_changed_entries_are_removed_and_others_kept(column: str, entries: Path) -> None:
    assert _settled(entries, code_cache._ADD) == [(5,), (500,)]
    value = "1003" if column == "hash" else "x'41'"
    _done(entries, f"UPDATE cache SET {column} = {value} WHERE hash = 3")
    # When it was last used decides about nothing but what goes first.
    assert _settled(entries, code_cache._CHECK) == [(5,), (500,)] if column == "last_access" else [(4,), (400,)]


def test_what_nobody_vouches_for_is_removed(entries: Path) -> None:
    """It may have been damaged as well as not since a run that was killed has written it."""
    assert _settled(entries, code_cache._CHECK) == [(0,), (0,)]


def test_what_is_no_such_file_is_removed_whole(tmp_path: Path) -> None:
    path = tmp_path / "cache.db"
    path.write_text("no database")
    assert _settled(path, code_cache._CHECK) == []
    with closing(sqlite3.connect(path)) as database, database:
        database.execute("CREATE TABLE cache (hash INTEGER PRIMARY KEY, obj BLOB NOT NULL)")
    assert _settled(path, code_cache._CHECK) == []


class _State:
    """What the module asks of heyoka."""

    def __getattr__(self, name: str) -> Any:
        return lambda *given: 500


def test_a_file_that_is_as_it_was_noted_is_not_read(entries: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its size and times are compared, and those of changed bytes differ even if somebody sets them back."""
    monkeypatch.setattr(code_cache, "code_folder", lambda: entries.parent)
    monkeypatch.setattr(code_cache, "_in_use", [])
    settled: list[str] = []
    settle = code_cache._settle
    monkeypatch.setattr(code_cache, "_settle", lambda *given: (settled.append(given[2]), settle(*given)))
    _settled(entries, code_cache._ADD)
    code_cache.guarded(_State())
    assert settled == [code_cache._ADD]
    before = entries.stat()
    content = bytearray(entries.read_bytes())
    content[-50] ^= 1
    entries.write_bytes(content)
    os.utime(entries, ns=(before.st_atime_ns, before.st_mtime_ns))
    code_cache.guarded(_State())
    assert settled == [code_cache._ADD, code_cache._CHECK]


def test_a_killed_run_leaves_what_it_has_compiled(tmp_path: Path) -> None:
    """A checksum follows each entry at once, so that only what is damaged is compiled again."""
    program = (
        "import os, tippedisk_verify as tv\ntv.Taylor()(tv.Request(tv.PRINTED, '30.4', (1.2, 0.3, 0), 1))\nos._exit(9)"
    )
    own = environment(XDG_CACHE_HOME=str(tmp_path))
    assert subprocess.run([sys.executable, "-c", program], env=own, timeout=LONGEST, check=False).returncode == 9
    path = tmp_path / "tippedisk-verify" / "cache.db"
    count = _done(path, "SELECT count(*) FROM cache")[0]
    assert count > (0,)
    assert _settled(path, code_cache._CHECK)[0] == count


@pytest.mark.parametrize("chosen", ["off", "code", "{folder}/named"])
def test_where_code_is_kept(chosen: str, tmp_path: Path) -> None:
    """`off` keeps nothing at all, another folder what is kept, `code` compiled code alone."""
    chosen = chosen.format(folder=tmp_path)
    own = {"XDG_CACHE_HOME": str(tmp_path / "own"), "HOME": str(tmp_path / "home"), VARIABLE: chosen}
    assert run([*_SCENE, "--quiet"], **own).returncode == 0
    assert run(["verify", "--only", "omega_crit", "--quiet"], **own).returncode == 0
    found = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    code = {name for name in found if "/cache.db" in name}
    if chosen == "off":
        assert found == set()
    elif chosen == "code":
        assert "own/tippedisk-verify/cache.db" in code == found
    else:
        assert "named/cache.db" in code < found
        assert {name.partition("/")[0] for name in found} == {"named"}


@pytest.mark.slow
def test_a_cache_that_cannot_be_had(filled_cache: tuple[Path, str], tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    (tmp_path / "shut").mkdir(mode=0o555)
    (tmp_path / "odd" / "tippedisk-verify" / "cache.db").mkdir(parents=True)
    for place in ("file", "shut", "odd"):
        done = run(ORBIT, without_rights(), XDG_CACHE_HOME=str(tmp_path / place))
        assert (done.returncode, done.stderr, done.stdout) == (0, "", filled_cache[1])
