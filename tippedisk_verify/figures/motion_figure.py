"""The figure of a motion against time."""

from __future__ import annotations

from typing import Any

from tippedisk_verify.figures.style import pyplot
from tippedisk_verify.motion.solution import Solution
from tippedisk_verify.numbers.exact import exact

__all__ = ["draw_motion"]


def draw_motion(solution: Solution) -> Any:
    """Draw a computed motion: beta, gamma and v against t, with events as dots.

    Returns:
        The Matplotlib figure.
    """
    figure, axes = pyplot().subplots(3, sharex=True, figsize=(7.5, 5.5), layout="constrained")
    solution.plot(axes)
    speed = float(exact(solution.omega))
    axes[0].set_title(
        f"{solution.disk.name}, Ω = {speed:.6g} rad/s, {solution.disk.friction} law: "
        f"{solution.message}",
        fontsize=10,
    )
    return figure
