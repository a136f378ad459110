"""Uncertainties hold the truth, over random disks, speeds and requests; and the study would see it if they did not."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from fractions import Fraction

import pytest
from tippedisk_verify.evidence.stress.comparison import of_double, printed
from tippedisk_verify.evidence.stress.draws import FAMILIES, disk, generator
from tippedisk_verify.evidence.stress.honesty import KINDS, drawn, honesty, kind_of, summary

from tippedisk_verify.errors import Shortfall
from tippedisk_verify.evidence.stress import motion_requests
from tippedisk_verify.flow import default_engine
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.theory.hopf import criticality

#: Three hundred draws of all kinds: mostly closed forms and short runs, of the cycles two a kind or more, and what is
#: cheap next to Omega_h.
FEW = (
    *(index for index in range(318) if index % 100 < 88),
    *(88, 89),
    *range(90, 99),
    *(190, 192, 194),
    *(99, 199, 399, 699),
)


def assert_honest(draws) -> None:
    found = summary(draws)
    assert found.honest, [(draw.index, draw.kind, draw.asked, draw.reason, draw.worst) for draw in found.violated]
    # The over-estimate that is asked of each kind; where there are few numbers the median says little.
    wide = {kind: ratio for kind, ratio in found.over_estimates.items() if ratio > 100}
    assert not wide


def test_few_draws_hold() -> None:
    draws = list(honesty(FEW, seed=1))
    assert len(draws) == 300
    assert_honest(draws)
    # A study that refuses everything would be honest and worthless.
    assert sum(draw.outcome == "holds" for draw in draws) > 250


@pytest.mark.slow
def test_ten_thousand_draws_hold() -> None:
    draws = list(honesty(10_000, seed=1))
    assert_honest(draws)
    assert {draw.kind for draw in draws if draw.outcome == "holds"} == set(KINDS)


def test_shares_of_the_kinds() -> None:
    counts = Counter(map(kind_of, range(10_000)))
    cycles = ("limit-cycle", "limit-cycle in double", "smooth limit-cycle", "harmonic-balance", "branch")
    cheap = ("flow", "right-hand side", "equilibria", "hopf", "one-harmonic", "melnikov", "slow-manifold")
    assert sum(counts[kind] for kind in cheap) == 9000
    assert sum(counts[kind] for kind in cycles) == 900
    assert set(counts) == set(KINDS)


def test_a_draw_can_be_repeated_by_its_number() -> None:
    index = 50
    alone, again = drawn(7, index), list(honesty(range(index - 1, index + 1), seed=7))[1]
    assert alone == again
    assert alone.asked != drawn(8, index).asked


@pytest.mark.parametrize("family", FAMILIES)
def test_disks_are_possible_and_differ(family) -> None:
    disks = [disk(generator(3, index), family) for index in range(30)]
    assert all(found.e < found.r and 0 < found.Bbar <= found.B <= found.A for found in disks)
    assert len({(found.r, found.mu, found.epsilon, found.A) for found in disks}) > (2 if family == "named" else 25)


def test_disks_of_every_kind_of_hopf_point_are_drawn() -> None:
    random = generator(1, 0)
    kinds = Counter(criticality(disk(random, family)) for family in FAMILIES for _ in range(40))
    assert kinds["supercritical"] > 20
    assert kinds["subcritical"] > 20


def test_an_estimate_that_is_too_small_is_seen(monkeypatch) -> None:
    """An engine that claims a hundredth of its half-widths, as an estimate that forgets something would."""

    def boastful(request):
        result = default_engine()(request)
        if result.error is None:
            return result
        return result._replace(error=replace(result.error, state=result.error.state / 100))

    monkeypatch.setattr(motion_requests, "default_engine", lambda: boastful)
    outcomes = Counter(drawn(1, index).outcome for index in range(20))
    assert outcomes["violated"] > 10


def test_defects_are_not_refusals(monkeypatch) -> None:
    def refuses(request):
        raise Shortfall("no digits here")

    def breaks(request):
        raise ZeroDivisionError("somewhere inside")

    assert kind_of(0) == "flow"
    monkeypatch.setattr(motion_requests, "compared_runs", refuses)
    assert (drawn(1, 0).outcome, drawn(1, 0).reason) == ("refused", "no digits here")
    monkeypatch.setattr(motion_requests, "compared_runs", breaks)
    assert (drawn(1, 0).outcome, drawn(1, 0).reason) == ("violated", "ZeroDivisionError: somewhere inside")
    assert not summary([drawn(1, 0)]).honest


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
