"""The box of disks that round to Table 1: enclosures and answers against dense samples, and what stays open."""

from __future__ import annotations

import random
from decimal import Decimal
from fractions import Fraction
from functools import lru_cache
from itertools import product

import pytest
from mpmath import iv

from tippedisk_verify.audit import table_rounding
from tippedisk_verify.audit.catalogue import selected
from tippedisk_verify.audit.table_rounding import (
    CLOSED_FORMS,
    enclosed,
    inside_table,
    noted,
    rounding_box,
    some_set_gives,
)
from tippedisk_verify.model.parameters import CALIBRATED, GEOMETRY, PRINTED, Parameters
from tippedisk_verify.theory import harmonic_balance, hopf
from tippedisk_verify.theory.equilibria import stiff_eigenvalue_estimate

THEORY = {
    "omega_crit": lambda p: hopf.omega_crit(p, 20).value,
    "period_crit": lambda p: hopf.period_crit(p, 20).value,
    "lambda_3": stiff_eigenvalue_estimate,
    "chi": lambda p: harmonic_balance.chi(p.rational(), "printed"),
}


@lru_cache(maxsize=1)
def disks() -> list[Parameters]:
    """All corners of the box, and a thousand disks in it."""
    box, rng = rounding_box(), random.Random(7)
    places = [*product((0, 1), repeat=6), *([Fraction(rng.random()) for _ in box] for _ in range(1000))]
    return [
        PRINTED.changed(
            **{name: low + (high - low) * x for (name, (low, high)), x in zip(box.items(), place, strict=True)}
        )
        for place in places
    ]


@pytest.mark.parametrize("name", THEORY)
def test_the_answers_are_those_of_dense_samples(name: str) -> None:
    """Each closed form grows or falls in each quantity all over the box: its extremes are at corners."""
    values = [THEORY[name](disk) for disk in disks()]
    whole = enclosed(CLOSED_FORMS[name], rounding_box())
    assert all(Fraction(float(whole.a)) <= value <= Fraction(float(whole.b)) for value in values)
    least, greatest = min(values), max(values)
    assert least in values[:64]
    assert greatest in values[:64]
    printed = Decimal(selected([name])[0].printed)
    unit = Fraction(10) ** int(printed.as_tuple().exponent)
    # Decimals as coarse as the printed one, or as the box is wide: those that a sample rounds to, and those beyond.
    step = max(unit, (greatest - least) / 40)
    exponent = Decimal(float(step)).adjusted()
    for text in {f"{round(value / Fraction(10) ** exponent)}e{exponent}" for value in values}:
        assert some_set_gives(CLOSED_FORMS[name], text) is True, text
    for end in (least - (greatest - least) / 10, greatest + (greatest - least) / 10):
        beyond = round(end / Fraction(10) ** exponent)
        assert some_set_gives(CLOSED_FORMS[name], f"{beyond}e{exponent}") is False


@pytest.mark.parametrize("name", THEORY)
def test_the_printed_numbers_can_be_had(name: str) -> None:
    assert some_set_gives(CLOSED_FORMS[name], selected([name])[0].printed) is True


def test_a_disk_is_told_by_its_decimals() -> None:
    assert inside_table(PRINTED)
    assert inside_table(CALIBRATED)
    assert not inside_table(GEOMETRY)
    assert all(map(inside_table, disks()))
    for name, (low, high) in rounding_box().items():
        hair = (high - low) / 10**6
        assert not inside_table(PRINTED.changed(**{name: low - hair}))
        assert not inside_table(PRINTED.changed(**{name: high + hair}))
    assert rounding_box()["e"] == (Fraction("2.45e-3"), Fraction("2.55e-3"))


def test_what_intervals_cannot_tell_stays_open(monkeypatch: pytest.MonkeyPatch) -> None:
    """A number that comes to the edge of what rounds to the decimal, and no further, at one end of r's interval."""
    monkeypatch.setattr(table_rounding, "_MOST_PARTS", 60)
    assert some_set_gives(lambda p: p.r, "0.0455") is True
    assert some_set_gives(lambda p: p.r, "0.0456") is False
    assert some_set_gives(lambda p: p.r + iv.mpf("5e-5"), "0.0456") is None


def test_the_note_says_so() -> None:
    said = noted("omega_crit", "less", "more")
    assert said("30.92") == "less; more"
    assert said("31.92") == "less; no set inside Table 1's rounding gives this"
    assert noted("chi", "as printed")("1.31e-7") == "as printed"
