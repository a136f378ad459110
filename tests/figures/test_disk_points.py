"""The disk in motion moves as the model's equations require."""

from __future__ import annotations

import math

import numpy
import pytest

from tippedisk_verify import DOUBLE, PRINTED
from tippedisk_verify.figures.inversion_figure import disk_points
from tippedisk_verify.model.equations import equation_terms

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
