"""The figures draw the computed numbers, and the disk in motion moves as the equations require."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy
import pytest

from tippedisk_verify import DOUBLE, PRINTED, Audit, Measured, omega_crit, scene_named
from tippedisk_verify.audit.claim_catalogue import claims_drawn_in
from tippedisk_verify.figures.eigenvalue_figure import eigenvalue_rows
from tippedisk_verify.figures.exhibit_catalogue import EXHIBITS
from tippedisk_verify.figures.family_figures import law_rows
from tippedisk_verify.figures.inversion_figure import disk_points
from tippedisk_verify.figures.scene_figures import last_period
from tippedisk_verify.figures.style import pyplot
from tippedisk_verify.model.equations import equation_terms
from tippedisk_verify.motion.scenes import compute_scene
from tippedisk_verify.theory.equilibria import linearization


@pytest.mark.parametrize(
    ("beta", "gamma"), [(1.1, 0.6), (1.5707963, -1.5707963), (2.0, 4.0), (0.3, 1.5)]
)
def test_the_drawn_disk_touches_the_floor_and_carries_its_mass_where_the_model_has_it(
    beta, gamma
) -> None:
    """The height of S must be the model's potential over its weight, (r + e sin gamma) sin beta."""
    points = disk_points(PRINTED, beta, gamma)
    turn = numpy.linspace(0, 2 * math.pi, 2000)[:, None]
    rim = points["G"] + float(PRINTED.r) * (
        numpy.cos(turn) * points["body_x"] + numpy.sin(turn) * points["body_y"]
    )
    # 2000 points miss the lowest by a share of (pi / 2000)^2 / 2
    assert abs(rim[:, 2].min()) < 1e-7
    # The rim is a polygon
    assert rim[:, 2].max() == pytest.approx(2 * float(PRINTED.r) * math.sin(beta), rel=1e-5)
    height = (float(PRINTED.r) + float(PRINTED.e) * math.sin(gamma)) * math.sin(beta)
    assert points["S"][2] == pytest.approx(height, rel=1e-14)  # fifty roundings
    frame = numpy.array([points["body_x"], points["body_y"], points["normal"]])
    assert numpy.allclose(frame @ frame.T, numpy.eye(3), atol=1e-15)  # some roundings
    assert numpy.linalg.det(frame) == pytest.approx(1)


def test_eigenvalues_sum_to_the_trace_and_the_imaginary_parts_to_zero() -> None:
    rows = eigenvalue_rows(PRINTED)
    speeds = [row[0] for row in rows]
    assert speeds == sorted(speeds)
    trace = float(linearization(PRINTED, omega_crit(PRINTED).value).A33)
    for row in rows:
        # Roundings of three eigenvalues
        assert row[1] + row[3] + row[5] == pytest.approx(trace, rel=1e-12)
        assert row[2] + row[4] + row[6] == 0


def test_laws_end_where_the_family_is_born_and_have_no_cycle_above() -> None:
    """C^2 falls to zero like Omega_crit - Omega: a hundredth of the distance is a tenth of
    the amplitude.
    """
    crit = float(omega_crit(PRINTED))
    for form in ("printed", "consistent"):
        near, far = law_rows(PRINTED, [crit - 1e-5, crit - 1e-3, crit + 0.1], form)
        # The next term is of the distance's size
        assert near[1] == pytest.approx(far[1] / 10, rel=1e-3)
        assert near[2] == pytest.approx(far[2], rel=1e-3)


@pytest.mark.slow
def test_axes_carry_units(taylor) -> None:
    """Every axis that shows numbers of the model names a unit in brackets."""
    audit = Audit(PRINTED, taylor)
    for exhibit in EXHIBITS:
        if exhibit.name in ("eigenvalues", "branch", "scenario", "inversion", "scenes_2d"):
            figure = exhibit.draw(audit, claims_drawn_in(exhibit.name)).figure(2)
            axes = [axis for axis in figure.axes if axis.axison and axis.name != "3d"]
            assert all(
                label.endswith("]")
                for axis in axes
                for label in (axis.get_xlabel(), axis.get_ylabel())
            )
            pyplot().close(figure)


def test_a_rotating_cycle_is_drawn_once_across_the_middle_well(taylor) -> None:
    # So that panel a is at 30.02 rad/s, where both ways round occur
    omega_h = Measured(Fraction("30.12"), Fraction(0))
    turn = last_period(compute_scene(scene_named("a"), PRINTED, taylor, omega_h=omega_h))
    gamma = turn[:, 1]
    assert -math.pi / 2 <= gamma.min() < gamma.max() <= 3 * math.pi / 2
    # A sample is missing at either end
    assert abs(gamma[-1] - gamma[0]) == pytest.approx(2 * math.pi, abs=0.3)
    assert numpy.ptp(numpy.sign(numpy.diff(gamma))) == 0


# ------------------------------------------------------------------------------- the disk in motion
_OMEGA = 30.4


def _body(at: float, beta: float, gamma: float, v: float) -> dict[str, numpy.ndarray]:
    """Return the disk a short time after it has this state, to first order in that time."""
    return disk_points(
        PRINTED, beta + v * at, gamma - _OMEGA * math.cos(beta) * at, 0.7 + _OMEGA * at
    )


@pytest.mark.parametrize(
    ("beta", "gamma", "v"), [(1.1, 0.6, 0.8), (1.5707963, -1.5, 2.0), (2.0, 4.0, -3.0)]
)
def test_the_contact_point_slides_as_the_model_says(beta: float, gamma: float, v: float) -> None:
    """gamma_y is the velocity of the disk's point at C across the line of nodes.

    Along that line the point does not slide.
    """
    step = 1e-5
    now, after, before = (_body(at, beta, gamma, v) for at in (0.0, step, -step))
    frame = [now[name] for name in ("body_x", "body_y", "normal")]
    # Where in the disk the lowest point is
    inside = [float((now["C"] - now["G"]) @ axis) for axis in frame]

    def carried(body: dict[str, numpy.ndarray]) -> numpy.ndarray:
        parts = zip(inside, ("body_x", "body_y", "normal"), strict=True)
        return body["G"] + sum(length * body[name] for length, name in parts)

    velocity = (carried(after) - carried(before)) / (2 * step)
    lateral = numpy.cross([0, 0, 1], now["along"])
    sliding = equation_terms(
        math, PRINTED.constants_in(DOUBLE), _OMEGA, beta, gamma, v
    ).sliding_velocity
    # A central difference is off by step^2/6 times the third derivative, which is below 2 (r + e)
    # (Omega + |gamma'| + |v|)^3 = 1e4 m/s^3 here, and by two roundings of positions of 0.1 m over
    # the step.
    error = step**2 / 6 * 1e4 + 2 * 1.4e-17 / step
    assert velocity @ lateral == pytest.approx(float(sliding), abs=error)
    assert velocity @ now["along"] == pytest.approx(0, abs=error)
    assert velocity[2] == pytest.approx(0, abs=error)  # it touches the floor
    assert numpy.abs(now["S"][:2]).max() < 1e-16  # one rounding of its distance from C
    assert abs(now["C"][2]) < 1e-16
