"""The six panels: their compiled integrators, the attractors of their orbits, their numbers."""

from __future__ import annotations

from fractions import Fraction

import numpy
import pytest

from tippedisk_verify import (
    CALIBRATED,
    PRINTED,
    QUADRUPLE,
    SCENES,
    Event,
    Measured,
    Request,
    Taylor,
    bisect_omega_h,
    scene_named,
)
from tippedisk_verify.cycles.cycle_at_speed import rotating_cycle_at
from tippedisk_verify.cycles.families.folds import rotating_fold
from tippedisk_verify.cycles.locator import cached_locator
from tippedisk_verify.flow.contract import SECTION
from tippedisk_verify.motion.scenes import INITIAL_STATES, compute_scene
from tippedisk_verify.numbers.exact import fraction

GIVEN = Measured(Fraction("30.0488682607"), Fraction(0))
EXPECTED = {
    "a": "flat",
    "b": "limit cycle",
    "c": "limit cycle",
    "d": "limit cycle",
    "e": "limit cycle",
    "f": "inverted spinning",
}


def test_panels_b_to_f_build_one_plain_integrator() -> None:
    engine = Taylor()
    for scene in SCENES[1:]:
        panel = compute_scene(scene, PRINTED, engine, omega_h=GIVEN)
        assert [(b.precision, b.events, b.variations) for b in panel.compiled] == [
            ("double", (), ())
        ]
    assert len(engine.builds) == 1


def test_every_orbit_ends_as_the_paper_says(taylor) -> None:
    omega_h = bisect_omega_h(CALIBRATED, taylor).omega_h
    for scene in SCENES:
        panel = compute_scene(scene, CALIBRATED, taylor, omega_h=omega_h)
        assert [orbit.outcome.kind for orbit in panel.orbits] == [EXPECTED[scene.name]] * 2
        assert panel.inverted_stable == (scene.name == "f")
        assert not panel.noninverted_stable


def test_flat_times_hold(taylor) -> None:
    panel = compute_scene(scene_named("a"), PRINTED, taylor, omega_h=GIVEN)
    for orbit in panel.orbits:
        truth = taylor(Request(PRINTED, panel.omega.value, orbit.start, 60, precision=QUADRUPLE))
        assert orbit.outcome.time.holds(fraction(truth.time))
        assert orbit.outcome.time.uncertainty < Fraction(1, 10**11)  # twelve digits of ten seconds


@pytest.mark.parametrize("name", ["b", "d", "e"])
def test_amplitudes_hold(taylor, name) -> None:
    """Compare with an orbit of 400 s whose crossings are located by events."""
    panel = compute_scene(scene_named(name), PRINTED, taylor, omega_h=GIVEN)
    crossing = Event("crossing", SECTION.function, terminal=False)
    long = taylor(Request(PRINTED, panel.omega.value, INITIAL_STATES[0], 400.0, events=(crossing,)))
    settled = abs(long.events[-1].state[1] - numpy.pi / 2)
    for orbit in panel.orbits:
        assert orbit.outcome.amplitude.holds(float(settled))
        assert orbit.outcome.amplitude.uncertainty < Fraction(1, 1000)


def orbits_at(omega, parameters, engine):
    """Return the orbits of panel a at another speed."""
    return compute_scene(
        scene_named("a"), parameters, engine, omega_h=Measured(omega + Fraction(1, 10), Fraction(0))
    ).orbits


@pytest.mark.parametrize(
    "friction", ["linear", pytest.param("smooth", marks=pytest.mark.slow(minutes=0.3))]
)
def test_between_fold_and_omega_h_orbits_rotate_for_good(taylor, friction) -> None:
    """Compare their lean at the top with shooting, which does not use the orbit."""
    disk = PRINTED.with_friction(friction)
    omega = bisect_omega_h(disk, taylor, confirm=False).omega_h.value - Fraction(1, 50)
    cycle = rotating_cycle_at(disk, omega, taylor)
    for orbit in orbits_at(omega, disk, taylor):
        assert orbit.outcome.kind == "rotating limit cycle"
        assert orbit.outcome.amplitude.contains(cycle.beta_bar_top)
        # An amplitude of an orbit in double, which has forgotten its start: ten digits of it
        assert orbit.outcome.amplitude.uncertainty < Fraction(1, 10**10)
        assert set(orbit.outcome.to_dict()) == {"kind", "reason", "beta_bar_at_top"}


@pytest.mark.slow(minutes=0.3)
@pytest.mark.parametrize("friction", ["linear", "smooth"])
def test_orbits_that_only_slow_down_near_the_fold_are_not_taken_for_cycles(
    taylor, friction
) -> None:
    """Check a speed just below the fold, where orbits linger for longer than a scene lasts."""
    disk = PRINTED.with_friction(friction)
    fold = rotating_fold(cached_locator(disk, taylor).rotating_family).omega.value
    for distance in ("-3e-5", "-1e-7"):
        kinds = {orbit.outcome.kind for orbit in orbits_at(fold + Fraction(distance), disk, taylor)}
        assert kinds <= {"flat", "undecided"}, distance
    for distance in ("1e-5", "1e-3"):
        truth = rotating_cycle_at(disk, fold + Fraction(distance), taylor).beta_bar_top
        for outcome in (
            orbit.outcome for orbit in orbits_at(fold + Fraction(distance), disk, taylor)
        ):
            rotates = outcome.kind == "rotating limit cycle"
            assert rotates or (
                outcome.kind == "undecided" and Fraction(distance) < Fraction("5e-5")
            )
            assert not rotates or outcome.amplitude.contains(truth)


def test_a_cycle_about_another_inverted_state_is_one(taylor) -> None:
    """Check next to Omega_h, where the first orbit turns several times before a well keeps it."""
    far, near = orbits_at(GIVEN.value + Fraction(1, 10**4), PRINTED, taylor)
    assert abs(near.states[-1, 1]) < 3 * numpy.pi / 2 < 3 * numpy.pi < far.states[-1, 1]
    one, other = far.outcome.amplitude, near.outcome.amplitude
    # Ten digits, as above
    assert abs(one.value - other.value) <= one.uncertainty + other.uncertainty < Fraction(1, 10**10)
