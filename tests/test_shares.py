"""Shares of the slow studies: each study in exactly one, all about as long."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.shares import parsed, shares

_STUDIES = """
import pytest

@pytest.mark.slow
@pytest.mark.parametrize("n", range(20))
def test_short(n): ...

@pytest.mark.parametrize("n", [0, pytest.param(1, marks=pytest.mark.slow(minutes=9))])
def test_long(n): ...

def test_quick(): ...
"""


@given(st.dictionaries(st.text(), st.floats(0.01, 100)), st.integers(1, 12), st.randoms())
def test_every_study_has_one_share_in_any_order(minutes: dict[str, float], count: int, random) -> None:
    found = shares(minutes, count)
    assert set(found) == set(minutes)
    assert set(found.values()) <= set(range(1, count + 1))
    names = list(minutes)
    random.shuffle(names)
    assert shares({name: minutes[name] for name in names}, count) == found
    loads = [sum(minutes[name] for name in minutes if found[name] == share) for share in range(1, count + 1)]
    # The share that got the last study of the longest one had least before it; what sums round off is far less.
    assert max(loads) - min(loads) <= max(minutes.values(), default=0) * (1 + 1e-9)


def _collected(folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "--collect-only", "-q", *options],
        capture_output=True,
        text=True,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])},
        check=False,
    )


def test_the_option_runs_one_share(tmp_path: Path) -> None:
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers = slow\naddopts = -m 'not slow'\n")
    (tmp_path / "conftest.py").write_text("from tests.shares import *\n")
    (tmp_path / "test_studies.py").write_text(_STUDIES)
    every = _collected(tmp_path, "-m", "slow").stdout.split()
    studies = sorted(word for word in every if "::" in word)
    assert len(studies) == 21
    found = []
    for share in ("1/3", "2,3/3"):
        done = _collected(tmp_path, "-m", "slow", "--slow-share", share)
        assert done.returncode == 0
        found += [word for word in done.stdout.split() if "::" in word]
    assert sorted(found) == studies


@pytest.mark.parametrize("text", ["", "3", "0/3", "4/3", "1,4/3", "1/x", "1/0", "-1/3"])
def test_shares_that_make_no_sense(text: str) -> None:
    with pytest.raises(pytest.UsageError, match="--slow-share is K/N"):
        parsed(text)
