"""The six panels: what each builds, what each orbit ends on, and that the stated numbers hold."""

from __future__ import annotations

from fractions import Fraction

import numpy
import pytest

from tests.problems import SETS
from tippedisk_verify.errors import InputError
from tippedisk_verify.flow.contract import SECTION, Event, Request
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.exact import fraction
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.model.precision import bits
from tippedisk_verify.orbits.bisection import bisect_omega_h
from tippedisk_verify.orbits.scenes import (
    INITIAL_STATES,
    SCENES,
    compute,
    scene_named,
    section_amplitudes,
)

GIVEN = Measured(Fraction("30.0488682607"), Fraction(0))
EXPECTED = {"a": "flat", "b": "limit cycle", "c": "limit cycle", "d": "limit cycle", "e": "limit cycle",
            "f": "inverted spinning"}  # fmt: skip


def test_panels_b_to_f_build_one_plain_integrator() -> None:
    engine = Taylor()
    for scene in SCENES[1:]:
        panel = compute(scene, PRINTED, engine, omega_h=GIVEN)
        assert [(b.precision, b.events, b.variations) for b in panel.compiled] == [("double", (), ())]
    assert len(engine.builds) == 1


@pytest.mark.parametrize("parameters", SETS, ids=lambda p: p.name)
def test_every_orbit_ends_as_the_paper_says(taylor, parameters) -> None:
    omega_h = bisect_omega_h(parameters, taylor).omega_h
    for scene in SCENES:
        panel = compute(scene, parameters, taylor, omega_h=omega_h)
        assert [orbit.ending.kind for orbit in panel.orbits] == [EXPECTED[scene.name]] * 2
        assert panel.inverted_stable == (scene.name == "f")
        assert not panel.noninverted_stable


@pytest.mark.honest
def test_flat_times_hold(taylor) -> None:
    panel = compute(scene_named("a"), PRINTED, taylor, omega_h=GIVEN)
    for orbit in panel.orbits:
        truth = taylor(Request(PRINTED, panel.omega.value, orbit.start, 60, precision=bits(160)))
        assert orbit.ending.time.holds(fraction(truth.time))
        assert orbit.ending.time.uncertainty < Fraction(1, 10**11)


@pytest.mark.parametrize("name", ["b", "d", "e"])
def test_amplitudes_hold(taylor, name) -> None:
    """Against an orbit followed for 400 s, with its crossings located by events instead of by interpolation."""
    panel = compute(scene_named(name), PRINTED, taylor, omega_h=GIVEN)
    crossing = Event("crossing", SECTION.function, terminal=False)
    long = taylor(Request(PRINTED, panel.omega.value, INITIAL_STATES[0], 400.0, events=(crossing,)))
    settled = abs(long.events[-1].state[1] - numpy.pi / 2)
    for orbit in panel.orbits:
        assert orbit.ending.amplitude.holds(float(settled))
        assert orbit.ending.amplitude.uncertainty < Fraction(1, 1000)


def test_interpolated_crossings_against_located_ones(taylor) -> None:
    crossing = Event("crossing", SECTION.function, terminal=False)
    times = numpy.arange(0, 2001) / 100
    sampled = taylor(Request(PRINTED, 30.1, INITIAL_STATES[1], 20.0, times=times, dense=True))
    located = taylor(Request(PRINTED, 30.1, INITIAL_STATES[1], 20.0, events=(crossing,)))
    mine = section_amplitudes(times, sampled)
    theirs = [abs(record.state[1] - numpy.pi / 2) for record in located.events if record.time > 0]
    assert len(mine) == len(theirs)
    assert max(abs(mine - theirs)) < 1e-12  # rounding, over passages that cost two digits


def test_the_smooth_law_has_the_same_outcomes(taylor) -> None:
    omega_h = Measured(Fraction("30.0848424715"), Fraction(1, 10**9))
    for name in SCENES:
        panel = compute(name, PRINTED.with_friction("smooth"), taylor, omega_h=omega_h)
        assert [orbit.ending.kind for orbit in panel.orbits] == [EXPECTED[name.name]] * 2


def test_refusals(taylor) -> None:
    with pytest.raises(InputError, match="a, b, c, d, e, f or all"):
        scene_named("g")
    with pytest.raises(InputError, match="needs Omega_h"):
        compute(scene_named("a"), PRINTED, taylor)
    with pytest.raises(InputError, match="not positive"):
        compute(scene_named("a"), PRINTED, taylor, omega_h=Measured(Fraction(1, 20), Fraction(0)))
