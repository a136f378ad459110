"""The figure of a motion against time."""

from __future__ import annotations

from typing import Any

import numpy

from tippedisk_verify.figures.style import BLUE, ORANGE, pyplot
from tippedisk_verify.model.arrays import doubles
from tippedisk_verify.model.exact import exact
from tippedisk_verify.motion.solution import Solution

__all__ = ["draw_motion"]


def draw_motion(solution: Solution) -> Any:
    """Draw beta, gamma and v against t, with events as dots.

    Returns:
        The Matplotlib figure.
    """
    times = numpy.linspace(float(solution.t[0]), float(solution.t[-1]), 4001)
    states = doubles(solution(times))
    figure, axes = pyplot().subplots(3, sharex=True, figsize=(7.5, 5.5), layout="constrained")
    for row, (axis, name) in enumerate(
        zip(axes, ("β [rad]", "γ [rad]", "dβ/dt [rad/s]"), strict=True)
    ):
        axis.plot(times, states[row], color=BLUE)
        for event in solution.events:
            axis.plot(float(event.time), float(event.state[row]), ".", color=ORANGE)
        axis.set(ylabel=name)
    axes[-1].set(xlabel="t [s]")
    speed = float(exact(solution.omega))
    axes[0].set_title(
        f"{solution.disk.name}, Ω = {speed:.6g} rad/s, {solution.disk.friction} law: "
        f"{solution.message}",
        fontsize=10,
    )
    return figure
