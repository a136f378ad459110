"""The option ``--slow-share K/N``: one of N parts of the slow studies, each part of about the same length.

A study says with ``pytest.mark.slow(minutes=...)`` how long it keeps a core busy; one that says nothing counts as
short. The longest are handed out first, each to the share that has least so far. So every study belongs to exactly one
share, in whatever order studies are collected, and a new one has its share from the start.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping

import pytest

SHORT = 0.25  #: minutes of a study that does not say; those are between some seconds and one minute


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--slow-share", metavar="K/N", help="With -m slow: the K-th of N shares of the slow studies, or K,L,.../N."
    )


@pytest.hookimpl(tryfirst=True)  # before anything else is left out, on which the shares would depend
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    asked = config.getoption("--slow-share")
    if asked is None:
        return
    wanted, count = parsed(asked)
    marks = {item.nodeid: mark for item in items if (mark := item.get_closest_marker("slow"))}
    share = shares({name: mark.kwargs.get("minutes", SHORT) for name, mark in marks.items()}, count)
    left_out = [item for item in items if share.get(item.nodeid, 0) not in wanted]
    items[:] = [item for item in items if share.get(item.nodeid, 0) in wanted]
    config.hook.pytest_deselected(items=left_out)


def parsed(text: str) -> tuple[set[int], int]:
    """The shares asked for, and how many there are. Raises UsageError."""
    numbers, _, count = text.partition("/")
    try:
        wanted, of = {int(number) for number in numbers.split(",")}, int(count)
    except ValueError:
        wanted, of = set(), 0
    if not wanted or not all(1 <= number <= of for number in wanted):
        raise pytest.UsageError(f"--slow-share is K/N or K,L,.../N with numbers from 1 to N, not '{text}'")
    return wanted, of


def shares(minutes: Mapping[str, float], count: int) -> dict[str, int]:
    """For each study the number of its share, from 1 to ``count``."""
    loads = dict.fromkeys(range(1, count + 1), 0.0)
    found = {}
    # Among studies of the same length the hash spreads those of one kind.
    for name in sorted(minutes, key=lambda name: (-minutes[name], hashlib.sha256(name.encode()).digest())):
        found[name] = min(loads, key=lambda share: (loads[share], share))
        loads[found[name]] += minutes[name]
    return found
