"""Folds of librating cycles against collocation, for families of disks of every kind."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.command_line import answer, printed
from tests.honesty.harness import Draw
from tippedisk_verify import (
    GEOMETRY,
    PRINTED,
    AccuracyError,
    Disk,
    InputError,
    Measured,
    bisect_omega_h,
    equilibrium,
    heteroclinic,
    hopf_point,
)
from tippedisk_verify.cycles.branch_cycles import librating_branch
from tippedisk_verify.cycles.collocation.collocation_cycles import collocation_fold
from tippedisk_verify.cycles.collocation.fourier import CycleKind
from tippedisk_verify.cycles.cycle_at_speed import cycles_from_guesses
from tippedisk_verify.cycles.families import folds
from tippedisk_verify.cycles.families.folds import LibratingFold, librating_folds, rotating_fold
from tippedisk_verify.cycles.families.librating_family import LibratingFamily
from tippedisk_verify.cycles.locator import cached_locator
from tippedisk_verify.cycles.shooting.section import LIBRATING
from tippedisk_verify.errors import NoConnectionError, NoSuchCycleError
from tippedisk_verify.numbers.exact import fraction
from tippedisk_verify.omega_h.methods import OMEGA_H_METHODS
from tippedisk_verify.theory.hopf import criticality

FOLDING = PRINTED.changed(A="0.229e-3")
# The A of Table 1's disks at which l_1 = 0: Bbar r (2 r - e) / (2 (r + e) (r - 2 e)) [kg m^2]; and
# the slope of gamma_bar_0^2 at the fold by A there [1/(kg m^2)]. docs/disks.md has both laws.
A_B, FOLD_AMPLITUDE_SLOPE = Fraction("0.00023239668996710526315789473684"), -2798494.76137316
POSITIVE_SADDLE_VALUE = PRINTED.changed(
    r="0.0346", e="0.00064", mu="0.385", epsilon="0.0395", B="0.2124e-3"
)


# -------------------------------------------------------------------------------------- two methods
@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "digits"),
    [
        (CycleKind.LIBRATING, 12),
        (CycleKind.LIBRATING, 30),
        (CycleKind.ROTATING, 12),
    ],
)
def test_the_fold_is_the_one_by_collocation(taylor, kind, digits) -> None:
    disk = FOLDING if kind is CycleKind.LIBRATING else PRINTED
    if kind is CycleKind.LIBRATING:
        (shot,) = found = librating_folds(disk, taylor, digits=digits)
        assert found.followed_to == "Omega_h"
    else:
        shot = rotating_fold(cached_locator(disk, taylor).rotating_family, digits=digits)
    other = collocation_fold(disk, kind, digits=digits + 5)
    for name in ("omega", "period", *type(shot).section.coordinate_names, "null_vector"):
        assert (getattr(shot, name) - other[name]).holds(0), name
    assert other["omega"].uncertainty < Fraction(1, 10**digits)


def test_a_fold_has_the_digits_asked_for_or_is_refused(monkeypatch, taylor) -> None:
    numbers = {
        name: Measured(Fraction(2), Fraction(3, 10**12))
        for name in ("omega", "period", *LIBRATING.coordinate_names)
    }
    monkeypatch.setattr(folds, "_fold_in", lambda *_: SimpleNamespace(**numbers))
    assert (
        folds.fold_to_digits(LibratingFold, FOLDING, (1, 1, 1), taylor, 11).omega
        == numbers["omega"]
    )
    with pytest.raises(AccuracyError, match="fewer than 12 digits"):
        folds.fold_to_digits(LibratingFold, FOLDING, (1, 1, 1), taylor, 12)


def test_collocation_finds_no_fold_where_there_is_none() -> None:
    with pytest.raises(NoSuchCycleError, match="no fold of the librating cycles"):
        collocation_fold(PRINTED, CycleKind.LIBRATING)


# ----------------------------------------------------------------------------------- what a fold is
def test_cycles_meet_at_the_fold(taylor) -> None:
    """Next to the fold both cycles exist, at distances that go with the root of the speed's. Beyond
    it there is no cycle.
    """
    (fold,) = librating_folds(FOLDING, taylor)
    known = cached_locator(FOLDING, taylor)
    apart = []
    for below in ("4e-8", "1e-8", "1e-12"):
        unstable, stable = cycles_from_guesses(
            known.librating_guesses_at(fold.omega.value - Fraction(below))
        )
        assert (unstable.stable, stable.stable) == (False, True)
        apart.append(float(stable.gamma_bar_0.value - unstable.gamma_bar_0.value))
    assert abs(apart[0] / apart[1] / 2 - 1) < 1e-6  # the next term is the square of the distance
    # The speed is that of the fold to twelve digits
    assert abs(apart[1] / apart[2] / 100 - 1) < 1e-3
    with pytest.raises(NoSuchCycleError, match="a fold"):
        cycles_from_guesses(known.librating_guesses_at(fold.omega.value + Fraction(1, 10**8)))


@pytest.mark.slow(minutes=0.1)
def test_a_positive_saddle_value_folds_below_omega_h(taylor) -> None:
    """Cycles are born stable and are unstable next to the connection. In between the speed is
    smallest.
    """
    (fold,) = librating_folds(POSITIVE_SADDLE_VALUE, taylor)
    known = LibratingFamily(POSITIVE_SADDLE_VALUE, taylor)
    assert fold.omega.value < known.limit < known.omega_crit
    halfway = (fold.omega.value + fraction(known.limit)) / 2
    cycles = cycles_from_guesses(
        cached_locator(POSITIVE_SADDLE_VALUE, taylor).librating_guesses_at(halfway)
    )
    assert [cycle.stable for cycle in cycles] == [True, False]


def test_a_small_fold_that_doubles_see_as_well_is_one(monkeypatch, taylor) -> None:
    """Next to l_1 = 0 the fold is on the family's polynomials, and the law of fourth order has it
    too.
    """
    disk = PRINTED.changed(A=A_B - Fraction("3e-9"))
    family = LibratingFamily(disk, taylor)
    assert len(family.folds) == 1

    def at_start(kind, parameters, start, *_):
        return SimpleNamespace(gamma_bar_0=start[0], omega=start[2])

    monkeypatch.setattr(folds, "fold_to_digits", at_start)
    (fold,) = librating_folds(disk, taylor, family=family)
    square = -FOLD_AMPLITUDE_SLOPE * 3e-9  # the next term is a tenth at 1e-7 kg m^2
    assert abs(fold.gamma_bar_0**2 / square - 1) < 0.005


@pytest.mark.slow
def test_next_to_a_generalized_hopf_point_folds_follow_the_closed_form(taylor) -> None:
    """Doubles only see their rounding there."""
    below = "1e-16"
    disk = PRINTED.changed(A=A_B - Fraction(below))
    (fold,) = librating_folds(disk, taylor)
    square = -FOLD_AMPLITUDE_SLOPE * float(below)
    # The next term is in proportion to the distance: a tenth at 1e-7 kg m^2.
    assert abs(float(fold.gamma_bar_0) ** 2 / square - 1) < 1e-4
    assert len(list(librating_branch(disk, taylor))) >= 41


@pytest.mark.slow
def test_another_orbit_is_not_taken_for_one_of_the_family(taylor) -> None:
    """With little friction other orbits are close by. One of them among the nodes turned one fold
    into five.
    """
    first, second = librating_folds(PRINTED.changed(mu="0.015"), taylor)
    assert second.omega.value - first.omega.value > Fraction(1, 10)


# ---------------------------------------------------------------------------- the page of documents
def rows(heading: str) -> list[list[str]]:
    """Return the table of docs/disks.md whose first column has this heading."""
    text = (Path(__file__).parents[2] / "docs" / "disks.md").read_text(encoding="utf-8")
    lines = text[text.index(f"| {heading} |") :].split("\n\n")[0].splitlines()[2:]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def disk_with_hole(
    mass: Fraction,
    radius: Fraction,
    thickness: Fraction,
    hole_radius: Fraction,
    hole_offset: Fraction,
) -> dict[str, Fraction]:
    """r, e, m, A, B and C of a homogeneous sharp-edged disk of this mass with a through-hole beside
    its centre.

    The inertia of the hole's material is taken from that of the full disk (elementary solids and
    Steiner's theorem).
    """
    full = mass * radius**2 / (radius**2 - hole_radius**2)
    hole = full - mass

    def across(body: Fraction, size: Fraction) -> Fraction:
        return body * (size**2 / 4 + thickness**2 / 12)

    A = across(full, radius) - across(hole, hole_radius)
    return {
        "r": radius,
        "e": hole * hole_offset / mass,
        "m": mass,
        "A": A,
        "B": A - hole * hole_offset**2,
        "C": full * radius**2 / 2 - hole * (hole_radius**2 / 2 + hole_offset**2),
    }


def test_the_table_of_holes() -> None:
    named = (GEOMETRY.m, GEOMETRY.r, *(Fraction(text) for text in ("0.010", "0.015", "0.020")))
    assert PRINTED.changed(**disk_with_hole(*named), name="geometry") == GEOMETRY
    radii = ("0.005", "0.010", "0.015", "0.020", "0.030")
    for thickness, *offsets in rows("thickness"):
        for radius, offset in zip(radii, offsets, strict=True):
            limit = Fraction(offset.removesuffix(" mm"))
            for away, kind in (("-0.01", "subcritical"), ("0.01", "supercritical")):
                inertia = disk_with_hole(
                    *(Fraction(text) for text in ("0.435", "0.045")),
                    Fraction(thickness.removesuffix(" mm")) / 1000,
                    Fraction(radius),
                    (limit + Fraction(away)) / 1000,
                )
                assert criticality(PRINTED.changed(**inertia)) == kind


# ---------------------------------------------------------------------------------------- asked for
@pytest.fixture
def folding(tmp_path: Path) -> str:
    path = tmp_path / "folding.toml"
    path.write_text("".join(f'{name} = "{value}"\n' for name, value in FOLDING.decimals().items()))
    return str(path)


def test_a_disk_has_its_folds_and_both_cycles(folding, taylor) -> None:
    disk = Disk.read(folding)
    (fold,) = disk.folds(engine=taylor)
    # The fold of docs/disks.md for this A, to the digits that matter there
    assert abs(float(fold.omega) - 30.95690583) < 1e-6
    unstable = disk.limit_cycle("30.9", stable=False, engine=taylor)
    stable = disk.limit_cycle("30.9", engine=taylor)
    assert (unstable.stable, stable.stable) == (False, True)
    assert unstable.gamma_bar_0 < stable.gamma_bar_0
    assert Disk("table1").folds(engine=taylor) == ()
    with pytest.raises(NoSuchCycleError, match="the one found is stable"):
        disk.limit_cycle("30.8", stable=False, engine=taylor)
    with pytest.raises(InputError, match="choose with stable at a speed omega"):
        disk.limit_cycle(above_het="1e-3", stable=True, engine=taylor)


def test_branch_has_both_cycles_at_a_speed(taylor) -> None:
    """Single speeds and lanes give the same cycles."""
    few = list(librating_branch(FOLDING, taylor, omegas=["30.9", "30.8"]))
    many = list(librating_branch(FOLDING, taylor, omegas=["30.9"] * 60 + ["30.8"] * 60))
    assert [cycle.stable for cycle in few] == [False, True, True]
    assert len(many) == 180
    for one, other in ((few[0], many[0]), (few[1], many[1]), (few[2], many[-1])):
        assert (
            abs(one.period.value - other.period.value)
            <= one.period.uncertainty + other.period.uncertainty
        )


def test_many_speeds_where_lanes_do_not_hold_them_all(taylor, monkeypatch) -> None:
    """One case is next to Omega_h, which lies inside the family's speeds. The other is a disk whose
    saddles are foci.
    """
    monkeypatch.setattr("tippedisk_verify.cycles.branch_cycles._MIN_BATCH_SIZE", 3)
    known = LibratingFamily(POSITIVE_SADDLE_VALUE, taylor)
    close = float(known.limit) + 1e-4
    cycles = list(
        librating_branch(
            POSITIVE_SADDLE_VALUE, taylor, omegas=[str(known.omega_crit - 0.01)] * 2 + [str(close)]
        )
    )
    assert len(cycles) == 3
    assert cycles[-1].stable
    focus = PRINTED.changed(r="0.0415", e="0.00246", mu="0.197", epsilon="0.332", B="0.2231e-3")
    cycles = list(librating_branch(focus, taylor, omegas=["29"] * 3))
    assert {cycle.period.value for cycle in cycles} == {cycles[0].period.value}
    (missing,) = librating_branch(focus, taylor, omegas=["28"])
    assert "rad/s only, where gamma's amplitude is pi" in missing.status


@pytest.mark.slow
def test_command(folding) -> None:
    (fold,) = answer(f"orbit --at-fold --parameters {folding}")["folds"]
    assert {
        "omega",
        "period",
        "gamma_bar_0",
        "v_0",
        "beta_max",
        "null_vector",
        "log_multiplier_fast",
    } <= set(fold)
    assert answer("orbit --at-fold") == {"folds": [], "followed_to": "Omega_h"}
    assert printed("orbit --at-fold") == "folds: none\nfollowed_to: Omega_h\n"


@pytest.mark.slow(minutes=0.5)
@pytest.mark.parametrize(
    "disk",
    [
        *(
            PRINTED.changed(A=Fraction(ratio) * PRINTED.Bbar, name=ratio)
            for ratio in ("1.0125", "1.1", "1.2")
        ),
        *(Draw(f"family/{n}").disk(("nearby", "friction"), stiffest=2e3) for n in range(3)),
    ],
    ids=lambda disk: disk.name,
)
def test_where_the_family_ends_and_how_many_cycles_a_speed_has(taylor, disk) -> None:
    family = cached_locator(disk, taylor).librating_family
    ends = sorted({end for _, end in family.ends})
    for low, high in pairwise(ends):
        speed = (low + high) / 2
        cycles = cycles_from_guesses(
            cached_locator(disk, taylor).librating_guesses_at(Fraction(speed))
        )
        assert len(cycles) == len(list(family.guesses(speed)))
    for beyond, side in ((ends[0] - 0.3, "below"), (ends[-1] + 0.3, "above")):
        with pytest.raises(NoSuchCycleError, match=f"0.3 rad/s {side} the family"):
            cycles_from_guesses(cached_locator(disk, taylor).librating_guesses_at(Fraction(beyond)))
    unstable, slow, _ = equilibrium(disk, str(family.limit), "noninverted").eigenvalues
    assert family.connected is not bool(slow.im.value)
    if not family.connected:
        for method in OMEGA_H_METHODS:
            with pytest.raises(NoConnectionError, match="saddle-focus"):
                heteroclinic(disk, taylor, method=method)
        return
    # A part of how near it is followed
    assert abs(family.limit - float(bisect_omega_h(disk, taylor).omega_h)) < 1e-6
    falls_at_birth = float(hopf_point(disk).first_lyapunov_coefficient) < 0
    falls_at_the_end = unstable.re + slow.re < 0
    assert len(family.folds) % 2 == (falls_at_birth != falls_at_the_end)
