"""Every file that is read, with damaged bytes: data only, one line, never a traceback."""

from __future__ import annotations

import ast
import gzip
import json
import random
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import tippedisk_verify
from reference_data.make.generation import generate
from tests.command_line import TABLE_1_FILE, Ran, assert_refused, ran
from tippedisk_verify.errors import InputError
from tippedisk_verify.reference_values.manifest import MAX_FILE_BYTES, faults_in_files
from tippedisk_verify.reference_values.store import Store, data_folder

_ID = "table1/linear/hopf/point/omega_crit"
_TOKENS = (
    *(bytes([code]) for code in b"\0\"'\\\n\r,;{}[]=-#"),
    *(
        b"\xff\xfe",
        b"\xef\xbb\xbf",
        b"\xed\xa0\x80",
        b"\xe2\x80\xae",
        b"\x1b[31m",
        b"\x80\x04",
        b"'''",
        b'"""',
    ),
    *(
        b"nan",
        b"inf",
        b"null",
        b"true",
        b"1e400",
        b"1e99999",
        b"9" * 5000,
        b"[" * 2000,
        b'{"a":' * 500,
    ),
    b"../",
    b"__import__('os')",
    b"!!python/object",
    b"cos\nsystem\n",
)


def damaged(content: bytes, draw: random.Random) -> bytes:
    """Damage a file: turn a bit of pieces, or cut, double, replace, move or copy them."""
    found = bytearray(content)
    for _ in range(draw.randint(1, 4)):
        at, size = draw.randrange(len(found) + 1), draw.choice((1, 1, 2, 5, 20, 200, len(found)))
        old = bytes(found[at : at + size])
        turned = bytes(byte ^ 1 << draw.randrange(8) for byte in old[:1]) + old[1:]
        token, noise = draw.choice(_TOKENS) + old, draw.randbytes(len(old))
        found[at : at + size] = draw.choice((turned, b"", old * 2, noise, token))
        to = draw.randrange(len(found) + 1)
        found[to:to] = draw.choice((b"", b"", old))
    return bytes(found)


_FILLED = {
    ".json": (r'"answer": ""', '"answer": "30.9"'),
    ".csv": (r"(?m)^(table1/.*)$", r"\g<1>30.9"),
}


def _sheet(path: Path) -> bytes:
    """Return a sheet of questions with an answer to each."""
    words = ["conformance", "questions", str(path), "--set", "table1", "--levels", "4"]
    assert ran(words).status == 0
    return re.sub(*_FILLED[path.suffix], path.read_text(encoding="utf-8")).encode()


# ------------------------------------------------------------------------------ one file at a time
def _parameter_files(folder: Path, draws: int) -> Iterator[Ran]:
    path, draw = folder / "disk.toml", random.Random(1)
    for _ in range(draws):
        path.write_bytes(damaged(TABLE_1_FILE.encode(), draw))
        yield ran(["hopf", "--json", "--parameters", str(path)])


def _sheets(folder: Path, draws: int) -> Iterator[Ran]:
    draw = random.Random(2)
    sheets = [
        *((name, _sheet(folder / name)) for name in ("a.csv", "a.json")),
        ("b.json", json.dumps({"from": "doubles", "answers": {_ID: 30.9}}).encode()),
        ("b.csv", f"id,answer\n{_ID},30.9\n".encode()),
    ]
    for n in range(draws):
        name, content = sheets[n % len(sheets)]
        (folder / name).write_bytes(damaged(content, draw))
        page = ["--json", "--html", str(folder / "page.html")]
        yield ran(["conformance", "grade", str(folder / name), *page])


_FUZZERS: dict[str, Callable[[Path, int], Iterator[Ran]]] = {
    "parameter files": _parameter_files,
    "answer sheets": _sheets,
}


@pytest.mark.parametrize("draws", [8, pytest.param(200, marks=pytest.mark.slow(minutes=0.5))])
@pytest.mark.parametrize("what", _FUZZERS)
def test_damaged_files(what: str, draws: int, tmp_path: Path) -> None:
    for done in _FUZZERS[what](tmp_path, draws):
        assert done.status in (0, 1, 2), done
        assert "Traceback" not in done.err
        if done.status:
            assert done.out == ""
            assert done.err.count("\n") == 1, done
            assert done.err.rstrip("\n").isprintable()


# ------------------------------------------------------------------------------- shapes of trouble
@pytest.mark.parametrize("suffix", [".toml", ".csv"])
def test_a_gigabyte_is_refused_unread(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"huge{suffix}"
    with open(path, "wb") as stream:
        stream.truncate(1 << 30)
    command = ["hopf", "--parameters"] if suffix == ".toml" else ["conformance", "grade"]
    assert "larger than" in assert_refused([*command, str(path)])


@pytest.mark.parametrize("spoil", ["bomb", "cut", "text"])
def test_a_bad_compressed_file_is_refused(spoil: str, tmp_path: Path) -> None:
    """The installed package has compressed files. A file that would fill the memory is read up to a
    size.
    """
    data = tmp_path / "data"
    shutil.copytree(data_folder(), data)
    text = (data / "values.csv").read_bytes()
    (data / "values.csv").unlink()
    packed = {
        "bomb": gzip.compress(bytes(MAX_FILE_BYTES + 10), 1),
        "cut": gzip.compress(text, 1)[:-9],
        "text": text,
    }[spoil]
    (data / "values.csv.gz").write_bytes(packed)
    (fault,) = faults_in_files(data)
    assert fault.startswith("values.csv has been changed")
    with pytest.raises(InputError, match=r"values\.csv has been changed"):
        Store(data)


def test_no_file_is_unpickled_or_evaluated() -> None:
    """The package has no call that would execute the content of a file."""
    forbidden = {
        "eval",
        "exec",
        "compile",
        "__import__",
        "pickle",
        "marshal",
        "shelve",
        "dill",
        "yaml",
        "runpy",
    }
    found = set()
    for path in Path(tippedisk_verify.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = (
                [node.func.id]
                if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
                else []
            )
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            found |= {(path.name, name.split(".")[0]) for name in names}
    # A cluster's workers are sent pickles; here only Dask itself reads what they answer. The text
    # of a problem's equations is written by the package, with numbers that are doubles.
    assert {one for one in found if one[1] in forbidden} == {
        ("workers.py", "pickle"),
        ("problems.py", "exec"),
    }


def test_links_in_a_data_folder_lead_nowhere_else(tmp_path: Path) -> None:
    """A lock or a journal that is a link would be made, or emptied, elsewhere."""
    (tmp_path / "secret").write_text("mine")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / ".lock").symlink_to(tmp_path / "secret")
    with pytest.raises(InputError):
        generate(tmp_path / "out", ("table1/linear/hopf",))
    (tmp_path / ".a.csv.journal").symlink_to(tmp_path / "elsewhere")
    assert_refused(
        [
            "sweep",
            "hopf",
            "--over",
            "mu=0.3",
            "--executor",
            "serial",
            "--out",
            str(tmp_path / "a.csv"),
        ]
    )
    assert (tmp_path / "secret").read_text() == "mine"
    assert not (tmp_path / "elsewhere").exists()
