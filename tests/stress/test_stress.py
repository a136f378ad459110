"""The battery: its cases pass, and wrong results fail. Extreme but allowed input gets one line."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import tippedisk_verify as tv
from tests.command_line import answer, printed, ran
from tippedisk_verify import PRINTED, AccuracyError, InputError, Request
from tippedisk_verify.flow import default_engine
from tippedisk_verify.stress.battery import CASES
from tippedisk_verify.stress.case import (
    CaseOutcome,
    StressCase,
    StressResult,
    check_refusal,
    compare_flight,
)


@pytest.mark.slow(minutes=2.5)
def test_the_whole_battery() -> None:
    result = answer("stress")
    assert [case["name"] for case in result["cases"]] == [case.name for case in CASES]
    assert [case for case in result["cases"] if not case["passed"]] == []


def test_a_wrong_claim_does_not_pass() -> None:
    """An engine whose estimate is a hundred times too small is detected."""
    from dataclasses import replace

    engine = default_engine()

    def boastful(request: Request):
        result = engine(request)
        if result.error is None:
            return result
        return result._replace(error=replace(result.error, state=result.error.state / 1e3))

    # Loose: an error to be seen
    request = Request(PRINTED, 30.4, (1.4, 1.9, 0.5), 2, domain="none", tolerance=1e-9)
    assert compare_flight(request).honest
    assert not compare_flight(request, engine=boastful).honest


def test_what_is_unforeseen_never_passes() -> None:
    def broken() -> CaseOutcome:
        raise ZeroDivisionError("by accident")

    def short() -> CaseOutcome:
        raise AccuracyError("not this close")

    outcome = StressResult.from_case(
        StressCase("x", "x", broken, passing_outcomes=("digits", "unforeseen ZeroDivisionError"))
    )
    assert not outcome.passed
    assert "by accident" in outcome.note
    assert StressResult.from_case(
        StressCase("x", "x", short, passing_outcomes=("AccuracyError",))
    ).passed
    assert not StressResult.from_case(StressCase("x", "x", short, 3)).passed
    assert not StressResult.from_case(
        StressCase("x", "x", lambda: CaseOutcome("digits", 2.9), 3)
    ).passed
    assert not check_refusal(lambda: 1, InputError).honest


def test_the_command_lists_and_runs() -> None:
    assert "expected" in printed("stress --list").splitlines()[0]
    (case,) = answer("stress --only 'epsilon 1, linear'")["cases"]
    assert {"name", "outcome", "error", "expected", "passed"} <= set(case)


def test_the_most_digits_are_had() -> None:
    """The limit is the number of digits asked for, not of those computed beyond; also for integers
    of over 4300 digits.
    """
    for words in ("hopf", "equilibria --below-crit 0.5"):
        done = ran([*words.split(), "--digits", "4000", "--json"])
        assert (done.status, done.err) == (0, "")
    assert tv.Measured.of(10**4400 + 1, 0).decimals() == ("1." + "0" * 4399 + "1e4400", "0")


_SIZES = st.sampled_from(
    ["1e-29", "1e-20", "1e-10", "1e-3", "0.3", "1", "1e3", "1e10", "1e20", "9e29"]
)


@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    st.fixed_dictionaries(dict.fromkeys(("r", "e", "m", "A", "B", "g", "mu", "epsilon"), _SIZES)),
    st.sampled_from(["hopf", "equilibria --omega 30.4"]),
)
def test_disks_beyond_any_workshop(tmp_path: Path, values: dict[str, str], words: str) -> None:
    """Extreme disks get an answer, a shortfall or a refusal: one line, and no traceback."""
    path = tmp_path / "disk.toml"
    path.write_text("".join(f'{name} = "{value}"\n' for name, value in values.items()))
    done = ran([*words.split(), "--parameters", str(path), "--json"])
    assert done.status in (0, 1, 2)
    assert done.err.count("\n") == (1 if done.status else 0)
