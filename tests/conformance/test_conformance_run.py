"""`conformance run`: programs that answer well, and programs that do everything else. None leaves
anything behind.

Nothing here depends on how fast a program is: where one must be given up, the limit's clock is the
test's own, and runs only once the program has done its mischief.
"""

from __future__ import annotations

import json
import os
import re
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from itertools import count
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tests.command_line import answer, assert_refused, printed, ran
from tests.stress.runs import INTERRUPTED, Struck
from tippedisk_verify.conformance.sheet import question_row
from tippedisk_verify.reference_values.store import load_store
from tippedisk_verify.support import dialogue

EXAMPLES = Path(__file__).parents[2] / "examples" / "answerers"


#: What the programs below are asked: six quantities of one entry, after a first question of the
#: right-hand side.
ASKED = [
    quantity.id
    for quantity in load_store().values()
    if quantity.level == 3 and quantity.set == "table1"
]
RUN = ["conformance", "run", "--set", "table1", "--levels", "3"]
_HEAD = f"""
import json, os, signal, sys, time
TRUTHS = {json.dumps({id_: load_store()[id_].for_doubles for id_ in ASKED})}
def asked():
    return json.loads(sys.stdin.readline() or sys.exit())["id"]
def said(id_, **more):
    print(json.dumps({{"id": id_, "answer": TRUTHS.get(id_), **more}}), flush=True)
def done():
    open(DONE, "w").close()
def forever():
    done()
    while True:
        time.sleep(1000)
said(asked())
"""


@pytest.fixture
def program(tmp_path: Path) -> Callable[[str], list[str]]:
    """The command of a program that has answered the first question, and then does so."""

    def made(body: str) -> list[str]:
        script = tmp_path / "program.py"
        script.write_text(f"DONE = {str(tmp_path / 'done')!r}\n{_HEAD}{body}")
        return [sys.executable, "-I", "-S", str(script)]

    return made


@pytest.fixture
def clock(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The limit's clock: it stands still until the file `done` is there, and then every look
    at it takes a minute.
    """
    ticks = count(0, 60)
    mine = SimpleNamespace(
        perf_counter=time.perf_counter,
        monotonic=lambda: next(ticks) if (tmp_path / "done").exists() else 0,
    )
    monkeypatch.setattr(dialogue, "time", mine)


def _ran(command: list[str], *options: str) -> tuple[int, dict[str, Any], str]:
    done = ran([*RUN, *options, "--json", "--", *command])
    return done.status, json.loads(done.out), done.err


def _agree(graded: dict[str, Any]) -> int:
    assert all(grade["verdict"] in ("exact", "agrees") for grade in graded["grades"])
    return len(graded["grades"])


WELL = "while True: said(asked())\n"


def test_a_question_can_be_cut_out_between_quotes(tmp_path: Path) -> None:
    """As `docs/protocol.md` says, for languages without JSON. The example there is a question."""
    page = (EXAMPLES.parents[1] / "docs" / "protocol.md").read_text(encoding="utf-8")
    example = json.loads(re.findall(r'    (\{"id".*?\})\n', page, re.DOTALL)[0])
    rows = [question_row(load_store(), quantity) for quantity in load_store().values()]
    (asked,) = (row for row in rows if row["id"] == example["id"])
    assert asked.keys() == example.keys()
    assert all(
        float(asked[name]) == float(example[name])
        for name in ("r", "epsilon", "Omega", "beta", "t")
    )
    assert all(
        re.fullmatch(r"[ -~]*", text) and not re.search(r'["\\]', text)
        for row in rows
        for text in row.values()
    )
    kept = tmp_path / "kept"
    assert ran([*RUN, "--", "tee", str(kept)]).status == 0
    cut = [re.findall(r'"(\w+)": "([^"]*)"', line) for line in kept.read_text().splitlines()]
    assert [dict(pairs) for pairs in cut[1:]] == [row for row in rows if row["id"] in ASKED]


def test_a_program_is_graded_and_timed(program: Callable[[str], list[str]], tmp_path: Path) -> None:
    status, graded, err = _ran(program(WELL), "--out", str(tmp_path / "out"), "--require", "3")
    assert (status, err, graded["remarks"][1:]) == (0, "", [])
    assert graded["remarks"][0] == "6 answers do not say from which inputs; graded as from doubles"
    assert _agree(graded) == len(ASKED) == 6
    (kind,) = graded["seconds"]["kinds"]
    assert (kind["level"], kind["kind"], kind["answered"], kind["entries"]) == (3, "hopf", 6, 1)
    assert kind["longest"] == "table1/linear/hopf/point"
    assert graded["seconds"]["start_up"] > 0 < kind["median"] == kind["total"]
    # What it wrote is a sheet with the same grades.
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "answers.jsonl",
        "grades.html",
    ]
    assert "to start up" in (tmp_path / "out" / "grades.html").read_text()
    again = answer(f"conformance grade {tmp_path / 'out' / 'answers.jsonl'}")
    assert again["grades"] == graded["grades"]


@pytest.mark.parametrize(
    ("body", "remark"),
    [
        ("ids = [asked() for _ in range(6)]\nfor id_ in ids[::-1]: said(id_)\nasked()", None),
        (
            "for _ in range(6): id_ = asked(); said(id_); said(id_)\nasked()",
            "second answers, which do not count",
        ),
        (
            "said(asked()); said('table1/linear/hopf/point/none')\n" + WELL,
            "answers to questions that were not asked",
        ),
        ("said('table1/both/rhs/002/M')\n" + WELL, "answers to questions that were not asked"),
        (
            "print('rubbish'); print('{\"id\": 3}'); print('\\x00\\x1b[2J\\xff'); print('[' * "
            "5000)\n" + WELL,
            "lines that are not answers: 4, the first 'rubbish'",
        ),
        (
            "said(ASKED := asked(), **{'from': 'singles'}); said(ASKED)\n" + WELL,
            "lines that are not answers: 1",
        ),
        (
            "for line in sys.stdin:\n"
            "    it = json.loads(line); it['answer'] = TRUTHS[it['id']]; print(json.dumps(it), "
            "flush=True)",
            None,
        ),
        (
            "for _ in range(5): said(asked())\n"
            "id_ = asked(); sys.stdout.write(json.dumps({'id': id_, 'answer': TRUTHS[id_]}))",
            None,
        ),
        ("asked(); os.close(0)\nfor id_ in TRUTHS: said(id_)", None),
        ("sys.stderr.write('murmur ' * 100_000)\n" + WELL, None),
        ("for _ in range(6): said(asked())\nsys.exit(3)", "ended with status 3"),
        (
            "for _ in range(6): said(asked())\nos.kill(os.getpid(), signal.SIGSEGV)",
            "ended with SIGSEGV",
        ),
    ],
    ids=[
        "out of order",
        "twice",
        "unknown",
        "too early",
        "rubbish",
        "odd reading",
        "echo",
        "half a line",
        "closes its input",
        "murmurs",
        "status",
        "signal",
    ],
)
def test_odd_programs_are_graded_in_full(
    body: str, remark: str | None, program: Callable[[str], list[str]]
) -> None:
    status, graded, err = _ran(program(body))
    assert err.count("\n") <= 1
    assert len(err) < 400
    noted = [one for one in graded["remarks"] if "graded as from doubles" not in one]
    assert (status, _agree(graded)) == (0, 6)
    assert [remark is not None and remark in one for one in noted] == (
        [] if remark is None else [True]
    )


BROKEN = [
    ("forever()", f"did not answer {ASKED[2]} within 7 s, and was ended"),
    ("done()\nwhile True: sys.stdout.write('x' * 65536)", "within 7 s, and was ended"),
    ("done()\nwhile True: sys.stderr.write('x\\n' * 30000)", "within 7 s, and was ended"),
    (
        "os.close(1); forever()",
        f"closed its standard output before it answered {ASKED[2]}, and was ended",
    ),
    ("os._exit(3)", f"ended with status 3 before it answered {ASKED[2]}"),
    ("os.kill(os.getpid(), signal.SIGKILL)", f"ended with SIGKILL before it answered {ASKED[2]}"),
    (
        "sys.stdout.write('{\"id\":'); sys.stdout.flush(); os._exit(0)",
        "ended with status 0 before it answered",
    ),
]
_NAMES = ["hangs", "one line", "murmurs", "closed", "status", "signal", "half"]


@pytest.mark.usefixtures("clock")
@pytest.mark.parametrize(("body", "remark"), BROKEN, ids=_NAMES)
def test_what_was_answered_is_graded(
    body: str, remark: str, program: Callable[[str], list[str]], tmp_path: Path
) -> None:
    pid = tmp_path / "pid"
    body = f"open({str(pid)!r}, 'w').write(str(os.getpid()))\nsaid(asked()); said(asked())\n{body}"
    out = tmp_path / "out"
    status, graded, err = _ran(program(body), "--limit", "7", "--out", str(out))
    assert status == 0
    assert remark in graded["remarks"][0]
    assert _agree(graded) == 2
    assert len((out / "answers.jsonl").read_text().splitlines()) == 2
    assert err.count("\n") <= 21  # of its standard error
    with pytest.raises(ProcessLookupError):  # neither running nor a zombie
        os.kill(int(pid.read_text()), 0)


def test_a_gate_does_not_let_pass_what_breaks_off(program: Callable[[str], list[str]]) -> None:
    command = program("said(asked()); os._exit(3)")
    status, graded, _ = _ran(command, "--require", "3")
    assert (status, _agree(graded)) == (1, 1)
    assert "ended with status 3" in graded["shortcomings"][0]
    assert ran([*RUN, "--", *command]).status == 0
    assert_refused([*RUN, "--expected-failures", "/dev/null", "--", *command])


def test_a_program_that_keeps_its_answers_in_a_buffer_is_told_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = tmp_path / "program.py"
    script.write_text(
        "import json, sys\n"
        "sys.stdout = open(1, 'w', buffering=65536)\n"
        "for line in sys.stdin:\n"
        "    print(json.dumps({'id': json.loads(line)['id'], 'answer': 0}))\n"
        f"    open({str(tmp_path / 'done')!r}, 'w').close()\n"
    )
    # Once the limit has passed, the clock stands still: the program ends when its input does.
    ticks = SimpleNamespace(
        perf_counter=time.perf_counter, monotonic=lambda: 1e6 if (tmp_path / "done").exists() else 0
    )
    monkeypatch.setattr(dialogue, "time", ticks)
    words = f"conformance run --set table1 --levels 1 --json -- {sys.executable} {script}"
    graded = json.loads(printed(words))
    assert "it must flush its output after each line" in graded["remarks"][0]
    assert len(graded["grades"]) == 1


@pytest.mark.usefixtures("clock")
def test_a_program_that_stays_when_its_input_ends_is_ended(
    program: Callable[[str], list[str]],
) -> None:
    body = "for _ in range(6): said(asked())\nsys.stdin.read(); forever()"
    status, graded, _ = _ran(program(body), "--require", "3")
    assert (status, _agree(graded)) == (0, 6)
    assert graded["remarks"][0].endswith("went on when its input had ended, and was ended")


@pytest.mark.usefixtures("clock")
@pytest.mark.parametrize("before", ["", "os.close(0)\n"], ids=["open", "closed"])
def test_full_pipes_on_both_sides(before: str, tmp_path: Path) -> None:
    """It never reads, is sent more than a pipe holds, and writes more than one to each of its
    own.
    """
    script = (
        f"import os, time\n{before}for n in (1, 2): os.write(n, b'x' * 1_000_000)\n"
        f"open({str(tmp_path / 'done')!r}, 'w')\ntime.sleep(1000)"
    )
    heard: list[str] = []
    with dialogue.start_program([sys.executable, "-c", script], 7) as one:
        assert "did not answer it within 7 s" in one.ask("?" * 10_000_000, {"it"}, heard.append)
        assert one.finish(heard.append).endswith("and was ended")
        assert len(one.errors()) == 1
    assert heard == []


def wait_for_the_end(pid: str) -> None:
    """Of an orphan: whoever has taken it over may take a moment to hear of its end, and may
    never ask.
    """
    with suppress(OSError):
        while Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z":
            time.sleep(0.01)


def test_children_of_a_program_end_with_it(tmp_path: Path) -> None:
    pid = tmp_path / "pid"
    script = f"sleep 1000 & echo $! > {pid}; echo no more; exit 3"
    refused = assert_refused([*RUN, "--", "sh", "-c", script])
    assert "sh ended with status 3 before it answered" in refused
    wait_for_the_end(pid.read_text().strip())


@pytest.mark.parametrize(
    "name", ["nowhere/program", "no such program", "", "folder", "./file", "./text", "a\0b"]
)
def test_what_cannot_be_started_is_refused_in_one_line(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("#!/bin/sh\n")
    (tmp_path / "text").write_text("no program\n")
    (tmp_path / "text").chmod(0o755)
    assert "cannot be started: " in assert_refused([*RUN, "--out", "out", "--", name])
    assert list((tmp_path / "out").iterdir()) == []


def test_a_program_that_never_answers_is_bad_input() -> None:
    """Its last words are in the line."""
    line = assert_refused([*RUN, "--", sys.executable, "nowhere.py"])
    assert "ended with status 2 before it answered table1/both/rhs/001/M: " in line
    assert "nowhere.py" in line
    line = assert_refused([*RUN, "--limit", "0.01", "--", "sleep", "1000"])
    assert "did not answer table1/both/rhs/001/M within 0.01 s" in line


def test_ctrl_c_loses_no_answer(program: Callable[[str], list[str]], tmp_path: Path) -> None:
    pid, out = tmp_path / "pid", tmp_path / "out"
    out.mkdir()
    command = program(f"open({str(pid)!r}, 'w').write(str(os.getpid()))\n" + WELL)
    # The fifth line is the answer to the fourth question that counts, and not yet taken.
    end = Struck(tmp_path / "hand").at(
        "call parse_answer_line 5", [*RUN, "--out", str(out), "--", *command]
    )
    assert end == (130, "", INTERRUPTED)
    assert [path.name for path in out.iterdir()] == ["answers.jsonl"]
    assert [
        json.loads(line)["id"] for line in (out / "answers.jsonl").read_text().splitlines()
    ] == ASKED[:3]
    printed(f"conformance grade {out / 'answers.jsonl'} --require 3")
    wait_for_the_end(pid.read_text())
