"""A caller's settings of the process or thread change no result, and no call changes them."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys

import pytest

from tests.surroundings import CALLS, COMMANDS, LONG, SLOW, STATES, computed, public, snapshot

QUICK = [name for name in CALLS if name not in LONG]
#: The states that replace "NumPy raises" and "decimals that trap".
REPLACING = ("NumPy calls", "decimals that trap nothing")


@pytest.fixture(scope="module")
def plain() -> dict[str, str]:
    """Return the quick calls' results under default settings."""
    return {name: computed(name) for name in QUICK}


def test_every_public_function_is_called() -> None:
    called = [name for names in CALLS if names not in COMMANDS for name in names.split()]
    assert sorted(called) == sorted(public())


@pytest.mark.parametrize("replaces_others", [False, True])
def test_states_of_the_caller_neither_change_a_result_nor_are_changed(
    replaces_others: bool, plain: dict[str, str]
) -> None:
    """Two states replace others, so they come by themselves."""
    with contextlib.ExitStack() as stack:
        for name, state in STATES.items():
            if (name in REPLACING) is replaces_others:
                stack.enter_context(state())
        before = snapshot()
        found = {name: computed(name) for name in QUICK}
        after = snapshot()
    assert found == plain
    assert after == before


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.slow(minutes=SLOW[name]) if name in SLOW else ())
        for name in CALLS
        if name in LONG
    ],
)
def test_all_states_together_change_no_result(name: str) -> None:
    """Make the plain call first: some libraries add warning filters when they are loaded."""
    plain = computed(name)
    with contextlib.ExitStack() as stack:
        for state in STATES.values():
            stack.enter_context(state())
        before = snapshot()
        found = computed(name)
        assert snapshot() == before
    assert found == plain


def test_settings_of_the_interpreter_change_no_result(plain: dict[str, str]) -> None:
    """Run without docstrings and assertions, with warnings as errors, and with other settings.

    They are a narrow window, other threads and other hashes.
    """
    settings = {
        "COLUMNS": "20",
        "LC_ALL": "C",
        "PYTHONHASHSEED": "7",
        "OMP_NUM_THREADS": "3",
        "PYTHONOPTIMIZE": "2",
    }
    run = [sys.executable, "-bb", "-W", "error", "-m", "tests.surroundings"]
    done = subprocess.run(
        run, env=os.environ | settings, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert json.loads(done.stdout) == plain
