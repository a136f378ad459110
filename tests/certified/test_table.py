"""Table 1's rounding box: proved extremes against samples, and what must not be provable."""

from __future__ import annotations

import random
from decimal import Decimal
from fractions import Fraction
from types import SimpleNamespace

import pytest
from flint import arb

from tippedisk_verify.certified import table
from tippedisk_verify.certified.rounding import rounding_box, rounds_to
from tippedisk_verify.certified.table import PRINTED_NUMBERS, study_table
from tippedisk_verify.errors import Shortfall
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import CALIBRATED, GEOMETRY, PRINTED, Parameters
from tippedisk_verify.theory import harmonic_balance, hopf
from tippedisk_verify.theory.equilibria import stiff_eigenvalue_estimate

THEORY = {
    "omega_crit": lambda p: hopf.omega_crit(p, 20).value,
    "period": lambda p: hopf.period_crit(p, 20).value,
    "lambda_3": stiff_eigenvalue_estimate,
    "chi": lambda p: harmonic_balance.chi(p.rational(), "printed"),
}


@pytest.fixture(scope="module")
def study() -> table.TableStudy:
    return study_table()


def _disk(rng: random.Random, *, corner: bool) -> Parameters:
    """A disk that rounds to Table 1: anywhere in the box, or at one of its corners."""
    box = rounding_box()
    values = {
        name: rng.choice(ends) if corner else ends[0] + (ends[1] - ends[0]) * Fraction(rng.random())
        for name, ends in box.items()
    }
    return PRINTED.changed(**values)


def test_the_box_is_half_a_unit_of_the_last_digit_to_either_side() -> None:
    box = rounding_box()
    assert box["e"] == (Fraction("2.45e-3"), Fraction("2.55e-3"))
    assert box["A"] == (Fraction("0.2485e-3"), Fraction("0.2495e-3"))


@pytest.mark.parametrize("corner", [False, True])
def test_no_sample_exceeds_the_proved_extremes(study: table.TableStudy, corner: bool) -> None:
    rng = random.Random(7)
    seen = {number.name: [] for number in study.numbers}
    for _ in range(200):
        disk = _disk(rng, corner=corner)
        assert hopf.criticality(disk) == "supercritical"
        for number in study.numbers:
            value = THEORY[number.name](disk)
            assert number.least.value - number.least.uncertainty <= value + Fraction(1, 10**18)
            assert value - Fraction(1, 10**18) <= number.greatest.value + number.greatest.uncertainty
            seen[number.name].append(value)
    if corner:  # the extremes are taken at corners: 200 draws of 32 corners meet them all but surely
        for number in study.numbers:
            assert abs(min(seen[number.name]) - number.least.value) < Fraction(1, 10**15)
            assert abs(max(seen[number.name]) - number.greatest.value) < Fraction(1, 10**15)


def test_what_follows_from_the_table(study: table.TableStudy) -> None:
    for number in study.numbers:
        assert not number.from_table_follows
        assert number.can_follow
        assert number.from_table.holds(number.from_table.value)
        assert abs(THEORY[number.name](PRINTED) - number.from_table.value) < Fraction(1, 10**18)
        assert number.name in number.statement
    assert study.witness == CALIBRATED
    assert study.alone == ()
    assert study.always_supercritical
    assert len(study.statements) == len(study.numbers) + 3
    assert study.json()["g"] == "9.81"


@pytest.mark.parametrize(
    ("disk", "outside", "missed"),
    [
        (PRINTED, (), ("30.92", "0.886", "-129.04", "1.31e-7")),
        (CALIBRATED, (), ()),
        (GEOMETRY, ("A",), ("1.31e-7",)),
        (PRINTED.changed(mu="0.31"), ("mu",), ("30.92", "0.886", "-129.04", "1.31e-7")),
    ],
    ids=lambda value: getattr(value, "name", None),
)
def test_the_disk_that_was_asked_about_is_judged(
    monkeypatch: pytest.MonkeyPatch, disk: Parameters, outside: tuple[str, ...], missed: tuple[str, ...]
) -> None:
    monkeypatch.setattr(table, "_cover_supercritical", lambda box, fixed: 0)  # seconds, and proved above
    study = study_table(disk)
    assert (study.disk.outside, study.disk.missed) == (outside, missed)
    assert study.disk.statement in study.statements
    assert f"'{disk.name}'" in study.disk.statement
    assert all(name in study.disk.statement for name in (*outside, *missed))


def test_one_quantity_alone(study: table.TableStudy) -> None:
    """Inside each interval the number rounds as printed, a little outside it does not (where the box goes on)."""
    box = rounding_box()
    for number in study.numbers:
        half = Fraction(10) ** int(Decimal(number.printed).as_tuple().exponent) / 2
        for quantity, (low, high) in number.alone.items():
            step = (high - low) / 10**6
            for x, expected in ((low + step, True), (high - step, True), (low - step, False), (high + step, False)):
                if box[quantity][0] <= x <= box[quantity][1]:
                    value = THEORY[number.name](PRINTED.changed(**{quantity: x}))
                    assert (abs(value - Fraction(number.printed)) <= half) == expected, (number.name, quantity)


def test_another_g_is_another_question(monkeypatch) -> None:
    """With g = 9.83 Omega_crit of Table 1 as it stands rounds to 30.92; no disk is named that gives all."""
    monkeypatch.setattr(table, "_cover_supercritical", lambda box, fixed: 0)  # seconds, and proved above
    study = study_table(PRINTED.changed(g="9.83"))
    assert study.numbers[0].from_table_follows
    assert study.witness is None
    assert all(statement != "" for statement in study.statements)


def test_a_rounding_that_cannot_be_told_is_no_success(monkeypatch: pytest.MonkeyPatch) -> None:
    """A number that r's rounding takes to the edge of the decimal's interval, to within its ball, and e's beyond it.

    Some disk does give it, so only whether r alone suffices is open.
    """

    def edge(p: SimpleNamespace) -> object:
        by_r, by_e = (p.r - arb(45) / 1000) * 2, (p.e - arb(25) / 10000) * 40  # r adds 1e-3 at most, e 2e-3
        return by_r + by_e + arb("30.914", "1e-9")

    monkeypatch.setattr(table, "PRINTED_NUMBERS", (("edge", "30.92", edge),))
    monkeypatch.setattr(table, "_cover_supercritical", lambda box, fixed: 0)
    with pytest.raises(Shortfall, match="alone"):
        study_table()


def test_one_value_for_all_numbers_must_be_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    """One number needs r >= 0.0451, the other r <= 0.0451, to within their balls: whether both can be had is open."""

    def first(p: SimpleNamespace) -> object:
        return arb("30.9149", "1e-9") + (p.r - arb(45) / 1000)

    def second(p: SimpleNamespace) -> object:
        return arb("0.8864", "1e-9") + (p.r - arb(45) / 1000)

    numbers = (("first", "30.92", first), ("second", "0.886", second))
    monkeypatch.setattr(table, "PRINTED_NUMBERS", numbers)
    monkeypatch.setattr(table, "_cover_supercritical", lambda box, fixed: 0)
    with pytest.raises(Shortfall):
        study_table()


def test_each_g_has_its_own_disks() -> None:
    assert table.with_gravity(CALIBRATED, CALIBRATED.g) is CALIBRATED
    other = table.with_gravity(CALIBRATED, Fraction("9.8"))
    assert (other.g, other.name) == (Fraction("9.8"), "calibrated with g = 9.8")
    assert other.changed(g=CALIBRATED.g, name="calibrated") == CALIBRATED


def test_a_number_out_of_reach_is_refused(monkeypatch) -> None:
    changed = (("omega_crit", "31.92", PRINTED_NUMBERS[0][2]),)
    monkeypatch.setattr(table, "PRINTED_NUMBERS", changed)
    monkeypatch.setattr(table, "_cover_supercritical", lambda box, fixed: 0)
    study = study_table()
    assert not study.numbers[0].can_follow
    assert study.numbers[0].statement.startswith("no disk")
    assert study.witness is None


def test_a_formula_that_is_not_monotone_is_not_proved(monkeypatch) -> None:
    """A square about the middle of r's interval: the sign of its slope changes in the box."""
    centre = Fraction("0.045")

    def bowl(p: SimpleNamespace) -> object:
        away = p.r - arb(45) / 1000
        return away * away

    assert table._slope_sign(lambda p: p.r, "r", rounding_box(), {}) == 1
    monkeypatch.setattr(table, "_MOST_BOXES", 300)
    with pytest.raises(Shortfall, match="monotone"):
        table._slope_sign(bowl, "r", rounding_box(), {})
    assert rounding_box()["r"][0] < centre < rounding_box()["r"][1]


def test_a_box_with_subcritical_disks_is_not_proved_supercritical(monkeypatch) -> None:
    monkeypatch.setattr(table, "_MOST_BOXES", 300)
    box = rounding_box() | {"A": (Fraction("0.2295e-3"), Fraction("0.2495e-3"))}
    fixed = {"g": PRINTED.g, "mu": PRINTED.mu, "epsilon": PRINTED.epsilon}
    assert hopf.criticality(PRINTED.changed(A="0.2296e-3")) == "subcritical"
    with pytest.raises(Shortfall, match="Lyapunov"):
        table._cover_supercritical(box, fixed)


def test_rounding_is_decided_only_where_it_can_be() -> None:
    assert rounds_to(arb("30.92"), "30.92") is True
    assert rounds_to(arb("30.93"), "30.92") is False
    assert rounds_to(arb("30.925", "1e-9"), "30.92") is None
    assert rounds_to(arb("nan"), "30.92") is None
    with pytest.raises(Shortfall):
        table.omega_h_statements([(PRINTED, Measured(Fraction("30.075"), Fraction(1, 10**6)))])
    said = table.omega_h_statements([(PRINTED, Measured(Fraction("30.07"), Fraction(1, 10**6)))])
    assert len(said) == 1
    assert "rounds to 30.07" in said[0]
    far = [(PRINTED, Measured(Fraction("30.0489"), Fraction(1, 10**6)))]
    said = table.omega_h_statements(far)
    # Of a connection that was found nothing follows for others.
    assert len(said) == 1
    assert "at 30.0489" in said[0]
    assert said[0].endswith("does not round to 30.07.")
    said = table.omega_h_statements(far, excluded=["printed"])
    assert len(said) == 1
    assert said[0].endswith(
        "does not round to 30.07, and no speed that does has a connection on which gamma grows all the way."
    )
    said = table.omega_h_statements([(CALIBRATED, Measured(Fraction("30.07"), Fraction(1, 10**6)))], CALIBRATED)
    assert said[1].startswith("all 5 printed numbers at once, omega_crit = 30.92,")
    assert "omega_h = 30.07, follow from 'calibrated'," in said[1]
