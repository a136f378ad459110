"""What a caller has set for a whole process or thread changes no result, and no call changes it."""

from __future__ import annotations

import contextlib

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
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name in SLOW)) for name in CALLS if name in LONG]
)
def test_nor_do_all_states_together(name: str) -> None:
    with contextlib.ExitStack() as stack:
        for state in STATES.values():
            stack.enter_context(state())
        before = snapshot()
        found = computed(name)
        assert snapshot() == before
    assert found == computed(name)
