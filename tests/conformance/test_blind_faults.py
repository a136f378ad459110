"""Faults in an independent program, planted without a look at the diagnosis: `faults` answers and judges all of them.

docs/grading_grades.md has how many of lists 8 to 10 are named. Two readers who did not know the diagnosis judged
what an earlier one said of lists 5 to 10: of 869 faults they found 739 and 740 named, and 8 and 6 statements wrong.
"""

from __future__ import annotations

import pytest

from tests.conformance.faults import CASES, JUDGED, STATUSES, Graders, planted

BY_NAME = {case["name"]: case for case in reversed(CASES)}  # of the earliest list that has the name
#: Correct programs by other means, the first with another integrator and the second with other right-hand sides.
RIGHT = ("dop853-1e-12", "factored", "event-linear")


@pytest.fixture(scope="module")
def graders(tmp_path_factory: pytest.TempPathFactory) -> Graders:
    return Graders(tmp_path_factory.mktemp("blind"))


def test_the_lists_are_whole() -> None:
    assert len({(case["list"], case["name"]) for case in CASES}) == len(CASES) > 1400
    for case in CASES:
        planted(case)
    assert set(JUDGED) <= {f"{case['list']}/{case['name']}" for case in CASES}
    assert {judged["verdict"] for judged in JUDGED.values()} <= {"named", "less", "false"} <= set(STATUSES)


@pytest.mark.parametrize(
    ("name", "level"),
    [
        ("inertia-swapped", 1), ("h1-swapped", 1), ("equilibrium-inverted-only", 2), ("eigenvalues-ascending", 2),
        ("lyapunov-norm", 3), ("chi-e", 4), ("h_0-sine-gamma", 5),
    ],
)  # fmt: skip
def test_a_fault_without_orbits_is_explained(name: str, level: int, graders: Graders) -> None:
    row = graders(BY_NAME[name])
    assert row["first"] == row["level"] == level
    assert row["statements"]
    assert row["status"] in ("named", "less", "unjudged")


def test_eigenvalues_at_another_speed_are_no_traceback(graders: Graders) -> None:
    """No value of a parameter gives them, and a search for one jumps through zero at another order of eigenvalues."""
    row = graders(BY_NAME["eigenvalues-stale-speed"])
    assert (row["level"], row["status"] != "crashed") == (2, True)


def test_a_crash_is_a_row_of_its_own(graders: Graders) -> None:
    patches = [["# ---- jacobian", "import nothing_of_this_name\n# ---- jacobian"]]
    row = graders({"list": 0, "name": "crash", "first": 1, "says": "it does not run", "patches": patches})
    assert row["status"] == "crashed"
    assert "nothing_of_this_name" in row["crash"]


@pytest.mark.slow(minutes=2)
@pytest.mark.parametrize("name", RIGHT)
def test_programs_without_a_fault_in_the_digits_asked_for_pass(name: str, graders: Graders) -> None:
    assert graders(BY_NAME[name])["status"] == "passing"
