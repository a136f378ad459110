"""The locator: the cycles of a speed, its side of Omega_h, and the families in the cache."""

from __future__ import annotations

from fractions import Fraction

import pytest

from tippedisk_verify.cycles.cycle_at_speed import librating_cycle_at
from tippedisk_verify.cycles.locator import cached_locator
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.model.parameters import PRINTED

FOLDING = PRINTED.changed(A="0.229e-3")  # cycles are born unstable, above Omega_crit


def test_families_are_kept_for_a_disk_and_its_law(taylor) -> None:
    known = cached_locator(PRINTED, taylor)
    assert cached_locator(PRINTED.changed(name="table1"), taylor) is known
    assert cached_locator(PRINTED.with_friction("smooth"), taylor) is not known
    assert cached_locator(FOLDING, taylor) is not known
    assert known.librating_guesses_at(Fraction(30)).guesses == ()
    assert known.__dict__["librating_family"] is known.librating_family


@pytest.mark.parametrize(
    ("omega", "message"),
    [
        (
            "29",
            "1 rad/s below the family, which lies between Omega_h = 30.04887 rad/s and "
            "Omega_crit = 30.88659 rad/s",
        ),
        (
            "31.5",
            "0.61 rad/s above the family, which lies between Omega_h = 30.04887 rad/s and "
            "Omega_crit",
        ),
    ],
)
def test_a_refusal_names_the_ends_of_the_family(taylor, monkeypatch, omega, message) -> None:
    """The family alone decides: no cycle is shot for, and Omega_h is not sought."""
    known = cached_locator(PRINTED, taylor)
    assert known.librating_family.connected
    for name in (
        "cycles.locator.shoot",
        "cycles.locator.bisect_omega_h",
        "cycles.locator.omega_h_resolving",
    ):
        monkeypatch.setattr(f"tippedisk_verify.{name}", None)
    with pytest.raises(NoSuchCycleError, match=message):
        librating_cycle_at(PRINTED, omega, taylor)


def test_a_speed_has_as_many_starts_as_pieces_reach_it(taylor) -> None:
    known = cached_locator(FOLDING, taylor)
    for omega, pieces in (("30.8", [1]), ("30.9", [0, 1]), ("30.96", [])):
        assert [
            start.piece for start in known.librating_guesses_at(Fraction(omega)).guesses
        ] == pieces
    for omega, pieces in (("30.02", [0, 1]), ("30.5", [1]), ("29.9", [])):
        assert [
            start.piece
            for start in cached_locator(PRINTED, taylor)
            .rotating_guesses_at(Fraction(omega))
            .guesses
        ] == pieces


def test_next_to_omega_h_its_digits_show_the_side(taylor) -> None:
    """At a millionth of the resolution of doubles, librating cycles lie above Omega_h and rotating
    ones below.
    """
    known, near = cached_locator(PRINTED, taylor), Fraction(1, 10**20)
    omega_h = known.librating_guesses_at(known.omega_h).omega_h
    assert known.librating_guesses_at(omega_h + near).omega_h != known.omega_h
    above, below = (
        known.librating_guesses_at(omega_h + near),
        known.librating_guesses_at(omega_h - near),
    )
    assert [start.has_coordinates for start in above.guesses] == [False]
    assert not below.guesses
    assert "1e-20 rad/s below Omega_h" in below.no_cycle_reason
    rotating = known.rotating_guesses_at(omega_h - near, stable=True)
    assert [start.has_coordinates for start in rotating.guesses] == [False]
    assert not known.rotating_guesses_at(omega_h + near, stable=True).guesses
