"""What a caller has set for a whole process or thread changes no result, and no call changes it."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys

import pytest

from tests.surroundings import CALLS, COMMANDS, LONG, SLOW, STATES, computed, public, snapshot

QUICK = [name for name in CALLS if name not in LONG]


@pytest.fixture(scope="module")
def plain() -> dict[str, str]:
    """The quick calls' results where nothing is set."""
    return {name: computed(name) for name in QUICK}


def test_every_public_function_is_called() -> None:
    assert {name for name in CALLS if name not in COMMANDS} == set(public())


@pytest.mark.parametrize("state", STATES)
def test_a_state_of_the_caller_neither_changes_a_result_nor_is_changed(state: str, plain: dict[str, str]) -> None:
    with STATES[state]():
        before = snapshot()
        found = {name: computed(name) for name in QUICK}
        after = snapshot()
    assert found == plain
    assert after == before


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.slow(minutes=0.5)] * (name in SLOW)) for name in CALLS if name in LONG],
)
def test_nor_do_all_states_together(name: str) -> None:
    """The plain call is first: some libraries add filters of warnings as they are loaded."""
    plain = computed(name)
    with contextlib.ExitStack() as stack:
        for state in STATES.values():
            stack.enter_context(state())
        before = snapshot()
        found = computed(name)
        assert snapshot() == before
    assert found == plain


def test_nor_do_the_settings_of_the_interpreter(plain: dict[str, str]) -> None:
    """Without docstrings and assertions, in a narrow window, with warnings as errors and other threads and hashes."""
    settings = {"COLUMNS": "20", "LC_ALL": "C", "PYTHONHASHSEED": "7", "OMP_NUM_THREADS": "3", "PYTHONOPTIMIZE": "2"}
    run = [sys.executable, "-bb", "-W", "error", "-m", "tests.surroundings"]
    done = subprocess.run(run, env=os.environ | settings, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    assert json.loads(done.stdout) == plain
