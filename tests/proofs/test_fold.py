"""Proved folds, rotating and librating: against Newton's method in many digits, and what must
not be proved.
"""

from __future__ import annotations

import json
from fractions import Fraction

import pytest

from tippedisk_verify import PRINTED, Measured, shoot_limit_cycle
from tippedisk_verify.cycles.cycle_at_speed import rotating_cycle_at
from tippedisk_verify.cycles.families.folds import (
    Fold,
    LibratingFold,
    fold_to_digits,
    rotating_fold,
)
from tippedisk_verify.cycles.locator import cached_locator
from tippedisk_verify.proofs.kernel.balls import arb
from tippedisk_verify.proofs.kernel.certificates.cycle import COORDINATE_NAMES
from tippedisk_verify.proofs.kernel.certificates.fold import extremum as extremum_of
from tippedisk_verify.proofs.search.fold_proof import (
    LIBRATING_SECTION,
    ROTATING_SECTION,
    FoldProof,
    prove_fold,
)

SUBCRITICAL = PRINTED.changed(A="0.229e-3")  # cycles are born above Omega_crit and turn round
SUBCRITICAL_FOLD = (
    "1.67348480076360242633639025",
    "-1.737725448903898",
    "30.956905829891930640498087550",
)
#: Its saddles have a positive saddle value: cycles are born below Omega_crit and turn round below
#: Omega_h.
POSITIVE = PRINTED.changed(
    r="0.0629052", e="0.000990917", mu="0.221356", epsilon="0.295017", B="0.215884e-3", C=None
)
HALF_LENGTH = Fraction(1, 10**11)  # of the arc, for 12 digits


def held(proof: FoldProof, fold: Fold, digits: int) -> None:
    """The proof holds Newton's fold, and what it prints is what was tested."""
    assert proof.proved, proof.statement
    arc, v = (proof.values[name] for name in COORDINATE_NAMES[proof.section])
    assert all(number.contains(getattr(fold, name)) for name, number in proof.values.items())
    assert proof.values["omega"].uncertainty < proof.values["omega"].value / 10**digits
    # The arc is a hypothesis: its decimals say it exactly. The curve stays inside the intervals
    # printed.
    assert Measured.of(*arc.decimals()) == arc
    assert float(arc.uncertainty) * abs(float(fold.null_vector)) < float(
        Measured.of(*v.decimals()).uncertainty
    )


def moved(fold: Fold, distance: Fraction) -> list[Fraction]:
    """A point beside the fold along the family, but for the square of the distance."""
    first, second = type(fold).section.coordinate_names
    v = getattr(fold, second).value + fold.null_vector.value * distance
    return [getattr(fold, first).value + distance, v, fold.omega.value]


@pytest.fixture(scope="module")
def subcritical_fold(taylor) -> LibratingFold:
    return fold_to_digits(
        LibratingFold, SUBCRITICAL, tuple(map(float, SUBCRITICAL_FOLD)), taylor, 50
    )


# ----------------------------------------------------------------------------------- what is proved
@pytest.mark.slow(minutes=0.3)
def test_a_largest_speed_is_proved() -> None:
    """v is given to 16 digits: the box is wider than what they leave open."""
    proof = prove_fold(SUBCRITICAL, SUBCRITICAL_FOLD, digits=5)
    assert proof.proved, proof.statement
    assert proof.values["omega"].holds(Fraction(SUBCRITICAL_FOLD[2]))
    assert SUBCRITICAL.definition() in proof.statement
    assert (
        "Omega rises at the lower end of the interval and falls at the upper one" in proof.statement
    )
    found = proof.to_dict()
    assert found["extremum"] == proof.extremum == "largest"
    for name in ("omega", "gamma_bar_0", "v_0", "period"):
        assert f"{found[name]['value']} ± {found[name]['uncertainty']}" in proof.statement
    assert json.loads(json.dumps(found)) == found


@pytest.mark.slow(minutes=1)
def test_librating_folds_are_proved(taylor, subcritical_fold) -> None:
    held(
        prove_fold(SUBCRITICAL, moved(subcritical_fold, Fraction(0)), digits=30),
        subcritical_fold,
        30,
    )
    fold = fold_to_digits(
        LibratingFold, POSITIVE, (2.88983290, -0.13685339, 34.44630470), taylor, 50
    )
    proof = prove_fold(POSITIVE, moved(fold, Fraction(0)), digits=12)
    held(proof, fold, 12)
    assert proof.extremum == "smallest"


@pytest.mark.slow(minutes=0.5)
def test_rotating_folds_are_proved(taylor) -> None:
    fold = rotating_fold(cached_locator(PRINTED, taylor).rotating_family, digits=30)
    proof = prove_fold(PRINTED, moved(fold, Fraction(0)), digits=12, section=ROTATING_SECTION)
    held(proof, fold, 12)
    assert proof.extremum == "smallest"
    assert PRINTED.definition() in proof.statement
    assert {"omega", "beta_bar_top", "v_top", "period"} <= set(proof.to_dict())


# ------------------------------------------------------------------------------- what is not proved
def test_slopes_of_one_sign_or_of_unknown_sign_prove_nothing() -> None:
    up, down, open_ended = (
        arb(1) + arb(0, "0.5"),
        arb(-1) + arb(0, "0.5"),
        arb("1e-30") + arb(0, "1e-29"),
    )
    assert extremum_of(up, down) == "largest"
    assert extremum_of(down, up) == "smallest"
    unknown = (open_ended, arb(0), arb("nan"), arb("inf"))
    for ends in (
        (up, up),
        (down, down),
        *((up, end) for end in unknown),
        *((end, down) for end in unknown),
    ):
        assert extremum_of(*ends) is None
        assert extremum_of(*ends[::-1]) is None


def test_the_mirror_image_of_a_fold_is_no_start() -> None:
    """The symmetry takes a fold's cycle to the other side of the section, where no flight
    starts.
    """
    rotating = ("0.4630367294818", "0.5257215484636", "30.00345938271")
    for disk, section, near in (
        (SUBCRITICAL, LIBRATING_SECTION, SUBCRITICAL_FOLD),
        (PRINTED, ROTATING_SECTION, rotating),
    ):
        first, second, omega = map(Fraction, near)
        proof = prove_fold(disk, (-first, -second, omega), digits=6, section=section)
        assert (proof.proved, dict(proof.values)) == (False, {})
        assert "nothing is proved" in proof.statement


@pytest.mark.slow(minutes=1)
def test_no_fold_is_proved_beside_one(taylor, subcritical_fold) -> None:
    """On an arc that ends short of it, by half of its half-length; on a disk without one;
    where no cycle passes.
    """
    short = prove_fold(SUBCRITICAL, moved(subcritical_fold, HALF_LENGTH * 3 / 2))
    assert "not proved to rise at one end" in short.outcome_detail
    held(prove_fold(SUBCRITICAL, moved(subcritical_fold, HALF_LENGTH / 2)), subcritical_fold, 12)
    cycle = shoot_limit_cycle(PRINTED, "30.4", taylor, digits=25)
    without = prove_fold(PRINTED, (cycle.gamma_bar_0.value, cycle.v_0.value, "30.4"), digits=8)
    assert "not proved to rise at one end" in without.outcome_detail
    assert not prove_fold(SUBCRITICAL, ("1.5", "-1.9", "30.957"), digits=8).proved
    rising = rotating_cycle_at(PRINTED, "30.02", taylor, stable=False, digits=25)
    near = (rising.beta_bar_top.value, rising.v_top.value, "30.02")
    assert not prove_fold(PRINTED, near, digits=8, section=ROTATING_SECTION).proved
