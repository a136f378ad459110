"""Ten lists of faults planted in an independent program, and what the diagnosis says of each.

    python -m tests.conformance.faults --lists 8-10 --levels 1-5 --names REGEX --processes 2 --cache DIR --out FILE

A line of `faults.jsonl` has a fault: its list and name, what a true diagnosis `says`, what it `must` say at least
(lists 5 to 10), the level that fails `first`, and the `patches` that plant it in `blind_program.py` and
`blind_theory.py`. Where `first` is null no level fails: correct programs, and faults within the digits asked for. All
were written without a look at the diagnosis: lists 5 to 7 by one author, 8 to 10 by another one.

A fault is answered and graded up to the level that fails first. `judged.json` holds the statement that somebody has
judged by list and name, and the verdict: "named", "less" (than the fault), or "false". Other statements are unjudged.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import json
import os
import re
import statistics
import sys
import tempfile
import time
import traceback
import types
import warnings
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from tippedisk_verify.conformance.diagnosis import diagnosed
from tippedisk_verify.conformance.grading import Grade, graded
from tippedisk_verify.conformance.sheet import Answers, Row, collected, questions, sheet_csv
from tippedisk_verify.reference_values.store import Store, stored

HERE = Path(__file__).parent
TEXTS = [(HERE / name).read_text() for name in ("blind_theory.py", "blind_program.py")]
CLEAN = set(TEXTS[1].split("\n# ---- "))
CASES: list[dict[str, Any]] = [json.loads(line) for line in (HERE / "faults.jsonl").read_text().splitlines()]
JUDGED: dict[str, dict[str, str]] = json.loads((HERE / "judged.json").read_text())
GRADERS: list[Graders] = []  # of this process
LAST = 9  # level that the program answers
STATUSES = ("passing", "named", "less", "false", "unexplained", "unjudged", "crashed")


def planted(case: dict[str, Any]) -> list[str]:
    """The texts of theory and program with the patches in them; each has to fit, and in one place."""
    texts = list(TEXTS)
    for old, new in case["patches"]:
        counts = [text.count(old) for text in texts]
        assert max(counts) == 1, (case["name"], old)
        texts = [text.replace(old, new) for text in texts]
    return texts


class Graders:
    """Answers the printed set's sheet with patched programs, and grades it. What is as it was is not run again."""

    def __init__(self, cache: Path) -> None:
        self.store: Store = stored()
        asked = questions(self.store, sets=("printed",), frictions=(), levels=())
        self.rows = list(csv.DictReader(sheet_csv(self.store, asked).splitlines()))
        self.cache = cache
        cache.mkdir(parents=True, exist_ok=True)
        self.kept: dict[Any, Any] = {}  # orbits of the program without patches

    def grades(self, case: dict[str, Any]) -> tuple[list[Grade], float]:
        """Grades up to the first level that fails, and the seconds that the answers took."""
        texts = planted(case)
        file = self.cache / f"{hashlib.sha256(chr(0).join(texts).encode()).hexdigest()[:24]}.json"
        found: dict[str, Any] = json.loads(file.read_text()) if file.exists() else {"level": 0}
        for level in range(max(case.get("first") or LAST, found["level"]), LAST + 1):
            if found["level"] < level:
                start = time.perf_counter()
                found = {"name": case["name"], "level": level, "answers": self._answers(texts, level)}
                found["seconds"] = time.perf_counter() - start
                part = file.with_suffix(f".{os.getpid()}")
                part.write_text(json.dumps(found, indent=0))
                part.replace(file)
            rows: list[Row] = [(id_, "doubles", str(text), {}) for id_, text in found["answers"].items()]
            grades = graded(collected(rows, self.store, None, Answers()), self.store)
            failing = [grade.level for grade in grades if grade.failed]
            if failing:
                return [grade for grade in grades if grade.level <= min(failing)], found["seconds"]
        return grades, found["seconds"]

    def _answers(self, texts: list[str], level: int) -> dict[str, str]:
        for name, text in zip(("blind_theory", "program"), texts, strict=True):
            sys.modules[name] = types.ModuleType(name)
            sys.modules[name].__dict__["TEXT"] = text
            exec(compile(text, name, "exec"), sys.modules[name].__dict__)
        program = sys.modules["program"].__dict__
        program["KEPT"].update(self.kept)
        answers: dict[str, str] = program["answered"](self.rows, range(1, level + 1))
        self.kept = {key: value for key, value in program["KEPT"].items() if CLEAN.issuperset(key[2:])}
        return answers

    def __call__(self, case: dict[str, Any]) -> dict[str, Any]:
        """What is said of a fault, and how long it took; of a crash where it was."""
        row = {name: case.get(name) for name in ("list", "name", "says", "must", "first")}
        row |= {"level": None, "statements": [], "answering": None, "grading": None}
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # what the faults do to the integrator
                grades, row["answering"] = self.grades(case)
                start = time.perf_counter()
                diagnoses = diagnosed(grades, self.store, lambda label, steps: None)
                row["grading"] = time.perf_counter() - start
            row["level"] = min((diagnosis.level for diagnosis in diagnoses), default=None)
            row["statements"] = [cause for diagnosis in diagnoses for _, cause in diagnosis.causes]
            row["said"] = [diagnosis.says() for diagnosis in diagnoses]
        except Exception:
            row["crash"] = traceback.format_exc()
        return row | {"status": status(row)}


def status(row: dict[str, Any]) -> str:
    """How well a fault is explained: one of `STATUSES`."""
    if "crash" in row or row["level"] is None:
        return "crashed" if "crash" in row else "passing"
    if not row["statements"]:
        return "unexplained"
    judged = JUDGED.get(f"{row['list']}/{row['name']}", {"statement": "", "verdict": ""})
    return judged["verdict"] if judged["statement"] == " | ".join(row["statements"]) else "unjudged"


def table(rows: list[dict[str, Any]], by: str) -> Iterator[str]:
    """How many of each status, by list or by the level that fails first, and the seconds of the diagnosis."""
    for group in [*sorted({row[by] for row in rows}, key=lambda value: value or 0), "all"]:
        here = [row for row in rows if group in ("all", row[by])]
        counts = ", ".join(f"{sum(row['status'] == name for row in here)} {name}" for name in STATUSES)
        wrong = sum(row["level"] != row["first"] and row["status"] != "crashed" for row in here)
        times = [row["grading"] for row in here if row["grading"] is not None] or [0.0]
        took = f"{statistics.median(times):.2f} s in the median, {max(times):.2f} s at most"
        yield f"{by} {group}: {len(here)} faults, {counts}, level wrong of {wrong}; {took}"


def _start(cache: Path) -> None:
    os.environ["TIPPEDISK_VERIFY_CACHE"] = "code"  # what was kept from earlier runs makes no diagnosis faster
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # where the integrator complains
    GRADERS.append(Graders(cache))


def _row(case: dict[str, Any]) -> dict[str, Any]:
    return GRADERS[0](case)


def main() -> None:
    def numbers(text: str) -> range:
        low, _, high = text.partition("-")
        return range(int(low), int(high or low) + 1)

    parser = argparse.ArgumentParser(description="What the diagnosis says of planted faults.")
    parser.add_argument("--lists", type=numbers, default="1-10", help="such as 8-10")
    parser.add_argument("--levels", type=numbers, help="that the faults fail first, such as 1-5")
    parser.add_argument("--names", type=re.compile, default="", help="a regular expression that is in the name")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--cache", type=Path, help="folder that keeps the answers")
    parser.add_argument("--out", type=Path, default=os.devnull, help="a line of JSON for each fault")
    asked = parser.parse_args()
    cases = [case for case in CASES if case["list"] in asked.lists and asked.names.search(case["name"])]
    cases, rows = [case for case in cases if asked.levels is None or case["first"] in asked.levels], []
    with tempfile.TemporaryDirectory() as folder, asked.out.open("w") as out:
        given = (asked.cache or Path(folder),)
        with ProcessPoolExecutor(asked.processes, get_context("spawn"), _start, given) as pool:
            for row in pool.map(_row, cases):
                rows.append(row)
                print(json.dumps(row, ensure_ascii=False), file=out, flush=True)
                print(f"{row['list']}/{row['name']}: level {row['level']}, {row['status']}", flush=True)
    for by in ("list", "first"):
        print("", *table(rows, by), sep="\n")


if __name__ == "__main__":
    main()
