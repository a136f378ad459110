"""The option ``--slow-share K/N``: one of N parts of the slow studies, each part of about the same
length.

A study says with ``pytest.mark.slow(minutes=...)`` how long it keeps a core busy; one that says
nothing counts as short. The longest are handed out first, each to the share that has least so far.
So every study belongs to exactly one share, in whatever order studies are collected, and a new one
has its share from the start.

After a run of slow studies the summary holds what they declared against what they took. It is told,
and fails nothing: a busy machine takes longer.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Mapping

import pytest

SHORT = 0.25  #: minutes of a study that does not say; those are between some seconds and one minute


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--slow-share",
        metavar="K/N",
        help="With -m slow: the K-th of N shares of the slow studies, or K,L,.../N.",
    )


# Before anything else is left out, on which the shares would depend
@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    minutes = {}
    for item in items:
        if mark := item.get_closest_marker("slow"):
            minutes[item.nodeid] = mark.kwargs.get("minutes", SHORT)
            # Travels with the report
            item.user_properties.append(("minutes", minutes[item.nodeid]))
    asked = config.getoption("--slow-share")
    if asked is None:
        return
    wanted, count = parsed(asked)
    share = shares(minutes, count)
    left_out = [item for item in items if share.get(item.nodeid, 0) not in wanted]
    items[:] = [item for item in items if share.get(item.nodeid, 0) in wanted]
    config.hook.pytest_deselected(items=left_out)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """What slow studies declared against what they took, setup included."""
    took, declared = Counter[str](), {}
    for report in (report for reports in terminalreporter.stats.values() for report in reports):
        if isinstance(report, pytest.TestReport) and "minutes" in (
            said := dict(report.user_properties)
        ):
            took[report.nodeid] += report.duration / 60
            declared[report.nodeid] = said["minutes"]
    if declared:
        terminalreporter.section("slow studies")
        sums = (
            f"declare {sum(declared.values()):.1f} core-minutes and took {sum(took.values()):.1f}"
        )
        terminalreporter.line(f"{len(declared)} studies {sums}")
    for name in sorted(name for name in declared if took[name] > 2 * declared[name] + SHORT):
        terminalreporter.line(f"{name} declares {declared[name]:g} and took {took[name]:.1f}")


def parsed(text: str) -> tuple[set[int], int]:
    """The shares asked for, and how many there are. Raises UsageError."""
    numbers, _, count = text.partition("/")
    try:
        wanted, of = {int(number) for number in numbers.split(",")}, int(count)
    except ValueError:
        wanted, of = set(), 0
    if not wanted or not all(1 <= number <= of for number in wanted):
        raise pytest.UsageError(
            f"--slow-share is K/N or K,L,.../N with numbers from 1 to N, not '{text}'"
        )
    return wanted, of


def shares(minutes: Mapping[str, float], count: int) -> dict[str, int]:
    """For each study the number of its share, from 1 to ``count``."""
    loads = dict.fromkeys(range(1, count + 1), 0.0)
    found = {}
    # Among studies of the same length the hash spreads those of one kind.
    for name in sorted(
        minutes, key=lambda name: (-minutes[name], hashlib.sha256(name.encode()).digest())
    ):
        found[name] = min(loads, key=lambda share: (loads[share], share))
        loads[found[name]] += minutes[name]
    return found
