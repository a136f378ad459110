"""Uncertainties hold the truth, for random disks and requests; and the draws see it if they
do not.
"""

from __future__ import annotations

import os
from dataclasses import replace
from fractions import Fraction
from typing import Any

import pytest

from tests.honesty.arithmetics import DEFAULT, MOVED_BITS, OTHER_ORDER, Arithmetic
from tests.honesty.harness import Kind, Question, assert_honest, compared, numbers, run
from tests.honesty.kinds import KINDS, kind_named
from tests.honesty.plants import PLANTS, planted
from tippedisk_verify import PRINTED, AccuracyError, Measured, Request
from tippedisk_verify.flow import default_batch_engine, default_engine

#: Other draws than those of every run: DRAWS_SEED=7 python -m pytest tests/honesty -m slow
SEED = int(os.environ.get("DRAWS_SEED", "1"))
#: The factor for the number of draws in the slow tests, such as DRAWS_TIMES=5.
TIMES = int(os.environ.get("DRAWS_TIMES", "1"))
#: Kinds whose draws take some seconds each. The slow tests plant half-widths in their first draws.
LONG = (
    "slow manifold",
    "limit cycle",
    "limit cycle in double",
    "branch",
    "next to Omega_h",
    "by passages",
    "Omega_h by manifolds",
    "Omega_h by limit cycles",
    "fold of rotating cycles",
    "basin boundary",
)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind.draws], ids=lambda kind: kind.name)
def test_draws_hold(kind: Kind) -> None:
    assert_honest(kind, [run(kind, index) for index in range(kind.draws)])


@pytest.mark.parametrize(
    "kind",
    [pytest.param(kind, marks=pytest.mark.slow(minutes=kind.minutes)) for kind in KINDS],
    ids=lambda kind: kind.name,
)
def test_more_draws_hold(kind: Kind) -> None:
    """In each arithmetic in turn."""
    here = (DEFAULT, MOVED_BITS, OTHER_ORDER) if kind.flown else (DEFAULT,)
    indices = range(kind.draws, kind.draws + TIMES * kind.more)
    assert_honest(kind, [run(kind, index, SEED, here[index % len(here)]) for index in indices])


@pytest.mark.parametrize(
    "where",
    [
        pytest.param(where, marks=pytest.mark.slow(minutes=0.5) if PLANTS[where] in LONG else ())
        for where in PLANTS
    ],
)
def test_a_half_width_a_hundred_times_too_narrow_is_noticed(where: str) -> None:
    kind = kind_named(PLANTS[where])
    draws = max(kind.draws, 4)  # not every draw takes the way that is planted
    for index in range(draws):
        found = run(kind, index, planted=planted(where))
        if any(not number.holds for number in found.numbers):
            return
    pytest.fail(f"{draws} draws of '{kind.name}' do not notice")


# ------------------------------------------------------------------------------------------ harness
def test_a_draw_is_repeated_by_its_number() -> None:
    kind = kind_named("flow")
    assert run(kind, 3, arithmetic=MOVED_BITS) == run(kind, 3, arithmetic=MOVED_BITS)
    assert run(kind, 3).text != run(kind, 3, seed=2).text


def test_numbers_are_compared_as_they_are_printed() -> None:
    # Printed 3.00 +- 1.0: half of the last place is 0.005
    claim = Measured(Fraction(3), Fraction(1))
    for truth, ratio, holds in ((3, 200, True), (Fraction(7, 2), 2, True), (5, 0.5, False)):
        (number,) = compared({"x": claim}, {"x": Measured(Fraction(truth), Fraction(0))})
        assert (number.ratio, number.holds) == (ratio, holds)
    with pytest.raises(ArithmeticError, match="the truth of x"):
        compared({"x": claim}, {"x": Measured(Fraction(3), Fraction(1, 10))})
    assert [number.holds for number in compared({"stable": True}, {"stable": False})] == [False]
    assert list(numbers({"a": (claim, {"b": claim}), "c": "text"})) == ["a 0", "a 1 b"]


def test_defects_are_not_refusals() -> None:
    def raising(fault: Exception) -> Kind:
        def ask() -> None:
            raise fault

        return Kind("k", lambda draw: Question(ask, lambda found: found), 1)

    assert run(raising(AccuracyError("no digits here")), 0).outcome == "refused"
    found = run(raising(ZeroDivisionError("inside")), 0)
    assert (found.outcome, found.reason) == ("violated", "ZeroDivisionError: inside")
    honest = replace(found, outcome="holds", reason="")
    for some, told in (([found], "inside"), ([replace(honest, outcome="refused")], "refused")):
        with pytest.raises(AssertionError, match=told):
            assert_honest(kind_named("flow"), some)


# -------------------------------------------------------------------------------------- arithmetics
def test_arithmetics_are_what_they_say() -> None:
    request = Request(PRINTED, "30.4", ("1.4", "1.9", "0.5"), "0.5", domain="none")

    def end(arithmetic: Arithmetic, seed: str) -> Any:
        with arithmetic.active(seed):
            assert arithmetic is not OTHER_ORDER or default_batch_engine().width == 2
            return default_engine()(request).state

    plain, moved = end(DEFAULT, "1"), end(MOVED_BITS, "1")
    assert (moved == end(MOVED_BITS, "1")).all()
    assert (moved != end(MOVED_BITS, "2")).any()
    assert (plain != end(OTHER_ORDER, "1")).any()
    # Some twenty steps of two units each, grown by less than ten over half a second.
    assert 0 < abs(moved - plain).max() < 400 * 2.0**-52
    assert (default_engine()(request).state == plain).all()
