"""The margins of the fixed cases, half-width over error, in one arithmetic.

    python -m tests.stress.honesty.margins "fast math"

runs every test marked ``honest`` as it stands, with all that it builds built for that arithmetic, and prints the least
margin of each. The exit status is 1 if a test breaks down or rests on less than `LEAST`.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from unittest import mock

import pytest

from tests.stress.honesty.arithmetics import Arithmetic, arithmetic_named
from tippedisk_verify.model.exact import fraction
from tippedisk_verify.model.measured import Measured

__all__ = ["LEAST", "Margins", "main", "margins"]

#: Of the fixed cases: with less, the next processor's roundings decide.
LEAST = 2.0
_TESTS = Path(__file__).parents[2]


class Margins:
    """A plugin that runs tests in an arithmetic, and sees each claim that they hold against a truth."""

    def __init__(self, arithmetic: Arithmetic) -> None:
        self._arithmetic = arithmetic
        self.least: dict[str, float] = {}  #: by test
        self.broken: list[str] = []
        self._test = ""

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self._test = item.nodeid
        with self._arithmetic.active(item.nodeid), mock.patch.object(Measured, "holds", self._seen(Measured.holds)):
            return (yield)

    def pytest_runtest_makereport(self, item: pytest.Item, call: pytest.CallInfo[None]) -> None:
        # What a test demands besides, such as a bound on the half-width, is for the arithmetic that it was written in.
        if call.excinfo is not None and not call.excinfo.errisinstance((AssertionError, pytest.skip.Exception)):
            self.broken.append(f"{item.nodeid}: {call.excinfo.exconly()}")

    def _seen(self, holds: Callable[[Measured, object], bool]) -> Callable[[Measured, object], bool]:
        def seen(claim: Measured, truth: object) -> bool:
            distance = abs(fraction(truth) - claim.value)
            margin = float(claim.uncertainty / distance) if distance else math.inf
            self.least[self._test] = min(margin, self.least.get(self._test, math.inf))
            return holds(claim, truth)

        return seen


def margins(arithmetic: Arithmetic, arguments: Sequence[str] = ()) -> Margins:
    """Run the marked tests, or those that pytest's ``arguments`` name, in this process."""
    found = Margins(arithmetic)
    options = [
        "-n",
        "0",
        "-q",
        "--no-header",
        "--no-summary",
        "-p",
        "no:cacheprovider",
        "--rootdir",
        str(_TESTS.parent),
    ]
    # What runs pytest has imported what is tested: no matter, for the tests themselves are rewritten.
    options += ["-W", "ignore:Module already imported:pytest.PytestAssertRewriteWarning"]
    pytest.main([*options, *(arguments or ("-m", "honest", str(_TESTS)))], plugins=[found])
    return found


def main(arguments: Sequence[str]) -> int:
    name, *rest = arguments
    found = margins(arithmetic_named(name), rest)
    for test, margin in sorted(found.least.items(), key=lambda pair: pair[1]):
        print(f"{margin:10.3g}  {test}")
    print(json.dumps({"arithmetic": name, "least": found.least, "broken": found.broken}))
    return 1 if found.broken or any(margin < LEAST for margin in found.least.values()) else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
