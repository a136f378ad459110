"""Uncertainties hold the truth, for random disks, requests and arithmetics; and the draws see it if they do not."""

from __future__ import annotations

import math
import statistics
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

from tests.stress.honesty import kinds, motion_requests
from tests.stress.honesty.arithmetics import ARITHMETICS, DEFAULT, Arithmetic, arithmetic_named
from tests.stress.honesty.comparison import Asked, of_double, printed
from tests.stress.honesty.draws import FAMILIES, FAR, disk, generator
from tests.stress.honesty.kinds import BY_SCIPY, IN_LANES, KINDS, ROWS, Draw, Row, drawn, honesty, kind_of, summary
from tests.stress.honesty.optimism import TERMS, planted
from tests.stress.honesty.study import computed, lines, main
from tippedisk_verify.errors import Shortfall
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.theory.hopf import criticality

#: Two hundred draws around the paper's disk: mostly closed forms and short runs, of the cycles two a kind or more, and
#: what is cheap next to Omega_h.
FEW = (*(index for index in range(205) if index % 100 < 90), *range(90, 99), *(190, 192, 194), *(99, 199, 399, 699))
#: Draws far from it, in every arithmetic that may change them: of what each arithmetic compiles for these, there is
#: little. Half periods have events and derivatives.
RUNS = (2, 5, 102, 104, 209, 300, 301, 302, 303, 309)
HALF_PERIODS = (28, 30, 33, 129, 131, 132, 133, 228, 229, 233, 234, 333)
CYCLES = (49, 50, 51, 52, 53, 55, 56, 58, 59, 60, 61, 62)
BRANCHES = (85, 86, 288)
FINER = (73, 74, 94, 273, 276)  #: what double does not hold to the digits asked for, and Omega_h
#: Those whose compiled code takes seconds, and differs from the default's by chance only.
PLAIN = ("optimisation 1", "optimisation 2", "AVX-512", "packed")


def far_draws(arithmetic: Arithmetic) -> tuple[int, ...]:
    if arithmetic.lanes_only:
        return BRANCHES
    return RUNS if arithmetic.name in PLAIN else (*RUNS, *HALF_PERIODS, *CYCLES)


def assert_honest(draws) -> None:
    found = summary(draws)
    assert found.honest, [(draw.index, draw.kind, draw.asked, draw.reason, draw.worst) for draw in found.violated]
    # Numbers of one draw have their luck in common: only of many draws the median over-estimate says something.
    counts = Counter(draw.kind for draw in draws)
    wide = {kind: ratio for kind, ratio in found.over_estimates.items() if counts[kind] >= 10 and ratio > 100}
    assert not wide
    assert statistics.median(number.ratio for draw in draws for number in draw.numbers) < 30


@pytest.mark.parametrize("half", [0, pytest.param(1, marks=pytest.mark.slow(minutes=1))])
def test_few_draws_hold(half: int) -> None:
    draws = list(honesty(FEW[half::2], seed=1))
    assert len(draws) == 101 - half
    assert_honest(draws)
    # A study that refuses everything would be honest and worthless.
    assert sum(draw.outcome == "holds" for draw in draws) > 82


@pytest.mark.slow(minutes=0.3)
@pytest.mark.parametrize("arithmetic", ARITHMETICS, ids=lambda one: one.name)
def test_far_draws_hold_in(arithmetic: Arithmetic, tmp_path: Path) -> None:
    indices = far_draws(arithmetic) + ((*BRANCHES, *FINER) if arithmetic is DEFAULT else ())
    if arithmetic.here:
        draws = list(honesty(indices, 1, arithmetic, "far"))
        assert_honest(draws)
        assert all(draw.outcome == "holds" for draw in draws)
    else:  # in a process of its own
        found = list(computed(tmp_path, [("far", 1, index, arithmetic.name) for index in indices], 1, set()))
        assert [line.outcome for group in found for line in group] == ["holds"] * len(indices)


@pytest.mark.parametrize(
    ("seed", "index", "name", "row"),
    [
        (1, 250, "lower order", "far"),  # a cycle that attracts so weakly that doubles see it at rest next to itself
        (1, 251, "compensated", "far"),
        (1, 289, "moved bits", "far"),  # interpolated multipliers that are lost in rounding
        (1, 690, "default", "far"),  # a branch whose Chebyshev coefficients fall too slowly to tell what is left out
        (99, 238, "default", "around"),  # backward, where the field stops what rounding has grown to
    ],
)
def test_draws_that_were_claimed_too_small_once(seed: int, index: int, name: str, row: Row) -> None:
    draw = drawn(seed, index, arithmetic_named(name), row)
    assert draw.outcome != "violated", (draw.reason, draw.worst)


@pytest.mark.slow(minutes=6)
@pytest.mark.parametrize("part", range(20))
def test_ten_thousand_draws_hold(part: int) -> None:
    draws = list(honesty(range(500 * part, 500 * part + 500), seed=1))
    assert_honest(draws)
    assert sum(draw.outcome == "holds" for draw in draws) > 400


@pytest.mark.slow(minutes=12)
@pytest.mark.parametrize("arithmetic", ARITHMETICS, ids=lambda one: one.name)
def test_ten_thousand_far_draws_hold_in_all(arithmetic: Arithmetic, tmp_path: Path, capsys) -> None:
    count = math.ceil(10_000 / len(ARITHMETICS))
    chosen = [str(tmp_path), "--draws", str(count), "--jobs", "1", "--arithmetic", arithmetic.name]
    status = main(chosen)
    shown = capsys.readouterr()
    with capsys.disabled():
        print("\n" + shown.out)
    assert status == 0, shown.err
    found = lines(tmp_path / "draws.jsonl")
    asked = {name for _, names in ROWS["far"] for name in names}
    if not (arithmetic is DEFAULT or arithmetic.environment):
        asked -= {*BY_SCIPY}
    assert {line.kind for line in found if line.outcome == "holds"} == set(IN_LANES if arithmetic.lanes_only else asked)


def test_shares_of_the_kinds() -> None:
    counts = Counter(map(kind_of, range(10_000)))
    cycles = ("limit-cycle", "limit-cycle in double", "smooth limit-cycle", "harmonic-balance", "branch")
    assert sum(counts[kind] for kind in cycles) == 900
    far = Counter(kind_of(index, "far") for index in range(10_000))
    assert sum(far[kind] for kind in motion_requests.RUNS) == 4900
    assert set(counts) | set(far) == set(KINDS)
    assert [sum(count for count, _ in ROWS[row]) for row in ("around", "far")] == [100, 100]


def test_a_draw_can_be_repeated_by_its_number() -> None:
    index = 50
    alone, again = drawn(7, index), list(honesty(range(index - 1, index + 1), seed=7))[1]
    assert alone == again
    assert alone.asked != drawn(8, index).asked


@pytest.mark.parametrize("family", [*FAMILIES, *FAR])
def test_disks_are_possible_and_differ(family) -> None:
    disks = [disk(generator(3, index), family) for index in range(30)]
    assert all(found.e < found.r and 0 < found.Bbar <= found.B <= found.A for found in disks)
    assert len({(found.r, found.mu, found.epsilon, found.A) for found in disks}) > (2 if family == "named" else 25)


def test_disks_of_every_kind_of_hopf_point_are_drawn() -> None:
    random = generator(1, 0)
    for families in (FAMILIES, FAR * 7):
        found = Counter(criticality(disk(random, family)) for family in families for _ in range(40))
        assert found["supercritical"] > 20
        assert found["subcritical"] > 20


@pytest.mark.slow
def test_an_estimate_that_is_too_small_is_seen() -> None:
    """An engine that claims a hundredth of its half-widths, as an estimate that forgets something would."""

    class Boastful(Arithmetic):
        @property
        def engine(self):
            def run(request):
                result = DEFAULT.engine(request)
                return result._replace(error=replace(result.error, state=result.error.state / 100))

            return run

    boastful = Boastful("boastful", "a hundredth")
    outcomes = Counter(drawn(1, index, boastful).outcome for index in range(20))
    assert outcomes["violated"] > 10


#: Terms that take their draws ten seconds and more to miss.
LONG = ("truncation between the nodes", "the distance", "the spread", "most of the spread", "the shift of the zero")


@pytest.mark.slow(minutes=0.9)
@pytest.mark.parametrize(
    "term",
    [pytest.param(term, marks=pytest.mark.slow if term.what in LONG else ()) for term in TERMS],
    ids=lambda term: f"{term.module}: {term.what}",
)
def test_planted_optimism_is_noticed(term) -> None:
    """Without one of its terms a half-width is too small, and the draws of the default run see it.

    What a wider run may be off is seen where it is off as far as its budget allows, by 128 units after every step.
    """
    moved = arithmetic_named("moved bits")
    rough = Arithmetic("rough", "wider runs are as rough as they may be", last_bits=128, moved=("extended",))

    def without(index: int, arithmetic: Arithmetic) -> Draw:
        with planted(term):
            return drawn(1, index, arithmetic, "far")

    assert any(without(index, here).outcome == "violated" for index in term.draws for here in (rough, DEFAULT, moved))


def test_a_term_that_has_gone_is_seen_to_have_gone() -> None:
    with pytest.raises(LookupError), planted(replace(TERMS[0], name="budgeted", old="a text that stands nowhere")):
        pass


def test_defects_are_not_refusals(monkeypatch) -> None:
    def asked(fault: Exception) -> Callable[..., Asked]:
        def numbers():
            raise fault

        return lambda random: Asked.closed("nothing", numbers)

    index = next(index for index in range(100) if kind_of(index) == "hopf")
    for seed, fault, outcome, reason in (
        (11, Shortfall("no digits here"), "refused", "no digits here"),
        (12, ZeroDivisionError("somewhere inside"), "violated", "ZeroDivisionError: somewhere inside"),
    ):
        monkeypatch.setitem(kinds._REQUESTS, "hopf", asked(fault))
        draw = drawn(seed, index)
        assert (draw.outcome, draw.reason) == (outcome, reason)
    assert not summary([draw]).honest


def test_over_estimates_count_exact_hits_as_half_a_place() -> None:
    hit = of_double("x", 1.0, 2.0**-52, Fraction(1))
    assert hit.holds
    assert hit.ratio == 2
    # Printed 3.00 +- 0.010: half a unit in the last place is 0.005.
    claim = Measured(Fraction(3), Fraction(1))
    assert printed("x", claim, Fraction(3)).ratio == pytest.approx(200)
    assert printed("x", claim, Fraction(3) + Fraction(1, 2)).ratio == pytest.approx(2)
    away = printed("x", claim, Fraction(5))
    assert not away.holds
    assert away.distance == 2
    with pytest.raises(ArithmeticError, match="the truth of x"):
        printed("x", claim, Measured(Fraction(3), Fraction(1, 10)))


def test_refusals_are_counted_by_reason_without_figures() -> None:
    draws = [
        replace(drawn(1, 48), kind="k", outcome="refused", reason=f"no cycle at {figure} rad/s")
        for figure in ("30.4", "1e-5", "7")
    ]
    found = summary(draws)
    assert found.refusals == {"k": {"no cycle at # rad/s": 3}}
    assert math.isfinite(found.numbers)
