"""Reference data with a changed bit: no reader takes them as right."""

from __future__ import annotations

import random
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from reference_data.make import generation
from reference_data.make.generation import generate, replace_files
from tests.command_line import answer, assert_refused, printed
from tippedisk_verify import InputError, compare, reference
from tippedisk_verify.conformance.sheet import questions, read_answers, sheet_csv, sheet_json
from tippedisk_verify.reference_values import store as reading
from tippedisk_verify.reference_values.manifest import faults_in_files
from tippedisk_verify.reference_values.store import Store

_ID = "table1/linear/hopf/point/omega_crit"
pytest_plugins = ["pytester"]


@pytest.fixture
def installed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Install the small folder in place of the data."""
    monkeypatch.setattr(reading, "data_folder", lambda: folder)
    reading.load_store.cache_clear()
    yield folder
    reading.load_store.cache_clear()


def _flip(path: Path, draw: random.Random) -> bytes:
    """Turn one bit of a file, and return the old content."""
    content = path.read_bytes()
    changed = bytearray(content)
    changed[draw.randrange(len(content))] ^= 1 << draw.randrange(8)
    path.write_bytes(changed)
    return content


def _one_line(fault: InputError) -> None:
    assert len(fault.faults) == 1
    assert "\n" not in str(fault)
    assert "install the package anew" in str(fault)


def test_ninety_flipped_bits_change_nothing_silently(folder: Path) -> None:
    """A file with values that is accepted is silent, even if the change is harmless."""
    whole = Store(folder)
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    read = {folder / name for name in ("values.csv", "proofs.json", "manifest.json")}
    draw, refused = random.Random(5), 0
    for n in range(90):
        path = paths[n % len(paths)]
        content = _flip(path, draw)
        try:
            found = Store(folder)
        except InputError as fault:
            _one_line(fault)
            refused += 1
        else:
            assert path not in read
            assert (dict(found), found.parameters) == (dict(whole), whole.parameters)
        path.write_bytes(content)
    assert refused > 20  # three of the ten files are read, and the files take turns


@pytest.mark.parametrize("name", ["values.csv", "proofs.json", "manifest.json"])
def test_whoever_reads_refuses(
    name: str,
    installed: Path,
    tmp_path: Path,
    pytester: pytest.Pytester,
) -> None:
    sheet = tmp_path / "answers.csv"
    sheet.write_text(f"id,answer\n{_ID},30.886592688643567\n")
    commands = [
        f"reference show {_ID}",
        "reference list",
        f"conformance grade {sheet}",
        f"conformance questions {tmp_path / 'q.csv'}",
    ]
    for words in commands:
        printed(words)
    reading.load_store.cache_clear()
    (tmp_path / "q.csv").unlink()
    _flip(installed / name, random.Random(6))
    for words in commands:
        assert Path(name).name in assert_refused(words.split())
    for ask in (lambda: reference(_ID), lambda: compare(_ID, 30.9)):
        with pytest.raises(InputError) as refused:
            ask()
        _one_line(refused.value)
    pytester.makepyfile(
        f"def test_mine(tippedisk_reference): tippedisk_reference({_ID!r})\n"
        f"def test_yours(tippedisk_agrees): tippedisk_agrees({_ID!r}, 30.886592688643567)\n"
    )
    done = pytester.runpytest_inprocess("-n", "0", "-p", "no:cacheprovider")
    done.assert_outcomes(failed=2)
    done.stdout.fnmatch_lines(["*: the reference data in * are damaged *"])


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (lambda data: (data / "values.csv").unlink(), "values.csv is missing"),
        (lambda data: (data / "proofs.json").unlink(), "proofs.json is missing"),
        (lambda data: (data / "values.csv").write_text("id\n"), "values.csv has been changed"),
    ],
)
def test_files_that_come_or_go(damage: object, says: str, folder: Path) -> None:
    damage(folder)
    with pytest.raises(InputError, match=says) as refused:
        Store(folder)
    _one_line(refused.value)


@pytest.mark.parametrize("form", ["csv", "json"])
def test_a_turned_bit_in_a_question_is_reported(form: str, tmp_path: Path) -> None:
    """An answer stays that of its question, or a message appears: an id may turn into another valid
    one.
    """
    store = reading.load_store()
    asked = questions(store, sets=["table1"], levels=[1])[::80]
    written, empty, filled = {
        "csv": (sheet_csv, r"(?m),,$", ",doubles,1.5"),
        "json": (sheet_json, r'"from": "", "answer": ""', '"from": "doubles", "answer": "1.5"'),
    }[form]
    text = written(store, asked)
    rows = [
        re.split(empty, line)[0].encode() for line in text.splitlines() if re.search(empty, line)
    ]
    path, draw, told = tmp_path / f"sheet.{form}", random.Random(8), 0
    path.write_text(re.sub(empty, filled, text))
    whole, content = read_answers(path, store), path.read_bytes()
    assert len(whole.by_id) == len(asked)
    assert not whole.altered_rows
    for _ in range(100):
        question = draw.choice(rows)
        at = content.index(question) + draw.randrange(len(question))
        path.write_bytes(
            content[:at] + bytes([content[at] ^ 1 << draw.randrange(8)]) + content[at + 1 :]
        )
        try:
            found = read_answers(path, store)
        except InputError:
            told += 1
            continue
        if found.altered_rows or found.unknown_ids or found.repeated_ids or found.short_rows:
            told += 1
        else:
            assert found.by_id == whole.by_id
    # The rest are names in JSON that nobody needs, and numbers that are the same double
    assert told > 40


def test_a_remark_says_which_row_asks_something_else(tmp_path: Path) -> None:
    store = reading.load_store()
    text = sheet_csv(store, [store[_ID], store["table1/both/rhs/001/M"]]).replace(",,\n", ",,1\n")
    path = tmp_path / "sheet.csv"
    for change, remark in (
        (("0.0025", "2.50e-3"), None),
        (
            ("-0.93072", "-0.93073"),
            "1 row does not ask what the id stands for, such as table1/both/rhs/001/M, gamma:",
        ),
        (("rhs/001", "rhs/002"), "such as table1/both/rhs/002/M, Omega:"),
    ):
        path.write_text(text.replace(*change))
        found = answer(f"conformance grade {path}")
        remarks = [one for one in found["remarks"] if "stands for" in one]
        assert len(remarks) == (remark is not None)
        assert remark is None or remark in remarks[0]


def test_damage_gets_no_new_manifest(folder: Path) -> None:
    """A command that adds to a folder computes all hashes, and must not accept damaged files."""
    _flip(folder / "values.csv", random.Random(7))
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    with pytest.raises(InputError, match=r"values\.csv has been changed"):
        generate(folder, ("table1/linear/hopf",))
    assert {path: path.read_bytes() for path in before} == before


def test_at_every_step_of_a_replacement_the_files_fit_the_manifest(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run that is killed at any step leaves valid data."""
    texts = {"values.csv": "id\n", "proofs.json": "{}\n", "methods.csv": "kind\n"}
    written, steps = generation.write_text, []

    def watched(path: Path, content: str) -> Path:
        done = written(path, content)
        steps.append(path.name)
        assert faults_in_files(folder) == []
        return done

    monkeypatch.setattr(generation, "write_text", watched)
    replace_files(folder, texts)
    assert steps == ["manifest.json", *texts, "manifest.json"]
    assert {name: (folder / name).read_text() for name in texts} == texts
    assert "becoming" not in (folder / "manifest.json").read_text()
