"""The folder of graded sheets: small, of one form, and summed up by its page."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import pytest

from graded_programs.make import HERE, SCIPY, table

FILES = sorted(HERE.glob("*.csv"))


def test_the_page_sums_up_the_files() -> None:
    page = (HERE / "README.md").read_text(encoding="utf-8")
    assert table() in page
    assert {path.stem.rsplit("-1e", 1)[0] for path in FILES} >= {
        f"scipy-{method}" for method, _ in SCIPY
    } | {"heyoka-double"}
    assert sum(path.stat().st_size for path in HERE.iterdir() if path.is_file()) < 100_000


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_file_has_the_grades_of_one_program(path: Path) -> None:
    rows = list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))
    assert {(int(row["level"]), row["friction"]) for row in rows} >= {(6, "linear"), (7, "smooth")}
    for row in rows:
        assert int(row["too_few_digits"]) <= int(row["failed"]) <= int(row["answered"])
        assert math.isfinite(float(row["least_digits"]))
    if "1e-12" in path.stem or "heyoka" in path.stem:
        assert not any(int(row["failed"]) for row in rows)
