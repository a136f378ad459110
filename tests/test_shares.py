"""Shares of the slow studies: each study is in exactly one, and all take about as long."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.shares import parsed, shares

pytest_plugins = ["pytester"]
_STUDIES = """
import pytest

@pytest.mark.slow
@pytest.mark.parametrize("n", range(20))
def test_short(n): ...

@pytest.mark.parametrize("n", [0, pytest.param(1, marks=pytest.mark.slow(minutes=9))])
def test_long(n): ...

def test_quick(): ...
"""


@settings(max_examples=15)
@given(st.dictionaries(st.text(), st.floats(0.01, 100)), st.integers(1, 12), st.randoms())
def test_every_study_has_one_share_in_any_order(
    minutes: dict[str, float], count: int, random
) -> None:
    found = shares(minutes, count)
    assert set(found) == set(minutes)
    assert set(found.values()) <= set(range(1, count + 1))
    names = list(minutes)
    random.shuffle(names)
    assert shares({name: minutes[name] for name in names}, count) == found
    loads = [
        sum(minutes[name] for name in minutes if found[name] == share)
        for share in range(1, count + 1)
    ]
    # The share that got the last study of the longest one had least before it. A sum of some
    # hundred numbers is rounded by less than a thousand units of 2^-53.
    assert max(loads) - min(loads) <= max(minutes.values(), default=0) * (1 + 2.0**-40)


def test_the_option_runs_one_share(pytester: pytest.Pytester) -> None:
    pytester.makeini("[pytest]\nmarkers = slow\naddopts = -m 'not slow'\n")
    pytester.makeconftest("from tests.shares import *\n")
    pytester.makepyfile(_STUDIES)
    found = []
    for share in ("1/3", "2,3/3"):
        done = pytester.runpytest_inprocess(
            "-n", "0", "--collect-only", "-q", "-m", "slow", "--slow-share", share
        )
        found += [line for line in done.outlines if "::" in line]
    assert len(found) == len(set(found)) == 21


@pytest.mark.parametrize("text", ["", "3", "0/3", "4/3", "1,4/3", "1/x", "1/0", "-1/3"])
def test_invalid_shares(text: str) -> None:
    with pytest.raises(pytest.UsageError, match="--slow-share is K/N"):
        parsed(text)
