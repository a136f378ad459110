"""The disk in motion: a scene's first orbit as an animated GIF.

The reduced model says where the disk is. Its states are beta and gamma; the centre of gravity S stays on one vertical
line and alpha = Omega t, because the reduction holds both so; the lowest point of the rim touches the floor. The model
leaves out how S would drift over the floor and how the spinning speed would change, so neither is seen here.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Sequence
from typing import Any

from tippedisk_verify.figures.disk import draw_disk, points_of, stage
from tippedisk_verify.figures.state_space import angle_axis, equilibria, equilibrium_mark, last_turn
from tippedisk_verify.figures.style import BLACK, BLUE, GREEN, GREY, RED, pyplot
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.orbits.scenes import Panel

__all__ = ["animated", "moments_of", "placed"]

_FIRST_SECONDS, _LAST_SECONDS = 2.6, 1.1  # shown of an orbit; a limit cycle's period lies between 0.8 and 3 s
_FRAME = 50  # [ms]; a sample each 10 ms is shown five times slower, and the disk turns by some 18 degrees a frame
_SLOWER = 5
_TRACE = 40  # samples, some two turns of the disk
_ASIDE = -0.55  # alpha of the turning camera [rad]: the face is seen, and so is its lean
_COLOURS = 64
_QUIET = "#505050"


def placed(parameters: Parameters, beta: float, gamma: float, alpha: float) -> dict[str, Any]:
    """`points_of` in a frame at rest: S lies on the vertical through the origin, the disk is turned by alpha [rad]."""
    import numpy

    points = points_of(parameters, beta, gamma)
    aside = points["S"] * [1, 1, 0]
    turn = numpy.array([[math.cos(alpha), -math.sin(alpha), 0], [math.sin(alpha), math.cos(alpha), 0], [0, 0, 1]])
    return {name: turn @ (point - aside if name in "CGS" else point) for name, point in points.items()}


def moments_of(panel: Panel) -> list[int]:
    """Which samples of the first orbit are shown: those of its first and its last seconds."""
    times = panel.orbits[0].times
    shown = (times <= _FIRST_SECONDS) | (times > times[-1] - _LAST_SECONDS)
    return [int(index) for index in shown.nonzero()[0]]


def animated(panel: Panel, moments: Sequence[int], told: Callable[[str], None] = lambda place: None) -> bytes:
    """The GIF: the disk as the room sees it, as a camera sees it that turns with it, and its angles.

    ``moments`` index the samples of the panel's first orbit, 10 ms apart; ``told`` hears which frame is drawn.
    """
    import numpy
    from PIL import Image

    orbit, omega = panel.orbits[0], float(panel.omega)
    plt = pyplot()
    figure = plt.figure(figsize=(8.0, 3.2), dpi=100)
    views = [
        figure.add_axes((left, 0.03, 0.34, 0.83), projection="3d", computed_zorder=False) for left in (0.005, 0.345)
    ]
    trace, dot = _plane(figure.add_axes((0.755, 0.17, 0.15, 0.69)), panel, moments)
    title = figure.text(0.012, 0.985, "", va="top")
    for left, text in ((0.175, "seen from the room"), (0.515, "seen by a camera that turns with it")):
        figure.text(left, 0.84, text, ha="center", color=_QUIET)
    figure.text(
        0.012, 0.015, "dot: centre of gravity S;  plus: centre G;  red: path of the contact point", color=_QUIET
    )
    beta, gamma = orbit.states[:, :2].T.tolist()
    frames = []
    for number, moment in enumerate(moments, start=1):
        told(f"frame {number} of {len(moments)}")
        before = range(max(0, moment - _TRACE), moment + 1)
        for axis, turning in zip(views, (True, False), strict=True):
            alphas = [omega * orbit.times[k] if turning else _ASIDE for k in before]
            places = [
                placed(panel.parameters, beta[k], gamma[k], alpha) for k, alpha in zip(before, alphas, strict=True)
            ]
            axis.clear()
            draw_disk(axis, panel.parameters, places[-1])
            axis.plot(*numpy.array([place["C"] for place in places]).T, color=RED, lw=1.0, zorder=0.5)
            stage(axis, float(panel.parameters.r), 1.2)
        trace.set_data(*_angles(orbit.states[before.start : before.stop]))
        dot.set_data(*_angles(orbit.states[moment : moment + 1]))
        late = f" (in the end: {orbit.ending.kind})" if orbit.times[moment] > _FIRST_SECONDS else ""
        pace = f"shown {_SLOWER} times slower"
        title.set_text(f"{panel.scene.title[4:]},  {pace},  t = {orbit.times[moment]:.2f} s{late}")
        figure.canvas.draw()
        frames.append(Image.fromarray(numpy.asarray(figure.canvas.buffer_rgba())[..., :3]))
    plt.close(figure)
    # One palette for all frames, of moments that show both faces, and no dithering: what stands still stays the same.
    sample = numpy.concatenate([numpy.asarray(frame) for frame in frames[:: max(1, len(frames) // 12)]])
    palette = Image.fromarray(sample).quantize(_COLOURS, dither=Image.Dither.NONE)
    chosen = [
        255 if level > 245 else level for level in (palette.getpalette() or ())[: 3 * _COLOURS]
    ]  # white stays white
    thin = b"".join(bytes.fromhex(colour[1:]) for colour in (RED, GREEN, BLUE))  # too few points to be chosen
    palette.putpalette([*chosen, *thin])
    first, *rest = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    stream = io.BytesIO()
    first.save(stream, "GIF", save_all=True, append_images=rest, duration=_FRAME, loop=0, optimize=True)
    return stream.getvalue()


def _plane(axis: Any, panel: Panel, moments: Sequence[int]) -> tuple[Any, Any]:
    """The plane of the angles with what is shown of the orbit, and the limit cycle.

    Returns two empty lines: for the orbit's latest part, and for its end.
    """
    import numpy

    states = panel.orbits[0].states[list(moments)]
    for part in numpy.split(states, numpy.flatnonzero(numpy.diff(moments) > 1) + 1):
        axis.plot(*_angles(part), color=GREY, lw=0.8)
    cycle = last_turn(panel)
    if cycle is not None:
        axis.plot(*_angles(cycle), color=GREEN, lw=1.5)
    low, high = -math.pi / 2, 3 * math.pi / 2
    for gamma, stable in equilibria(panel, (low, high)):
        equilibrium_mark(axis, (math.pi / 2,), (gamma,), stable)
        height = "S above G" if math.sin(gamma) > 0 else "S below G"
        axis.annotate(height, (1.06, gamma), xycoords=axis.get_yaxis_transform(), va="center", fontsize=8)
    (trace,), (dot,) = axis.plot([], [], color=BLUE, lw=1.5), axis.plot([], [], "o", color=BLACK, ms=6, zorder=9)
    axis.set_xticks([0, math.pi / 4, math.pi / 2, 3 * math.pi / 4, math.pi], ["0", "π/4", "π/2", "3π/4", "π"])
    angle_axis(axis.yaxis, low, high)
    left, right = min(0.7, states[:, 0].min() - 0.1), max(math.pi - 0.7, states[:, 0].max() + 0.1)
    axis.set(xlabel="β [rad]", ylabel="γ [rad]", xlim=(left, right), ylim=(low - 0.5, high + 0.5))
    axis.grid(lw=0.3, alpha=0.5)
    return trace, dot


def _angles(states: Any) -> tuple[Any, Any]:
    """beta, and gamma as an angle from -pi/2 to 3 pi/2; lines break off where it starts anew."""
    import numpy

    turns = numpy.floor((states[:, 1] + math.pi / 2) / (2 * math.pi) + 1e-9)  # the start at -pi/2 is rounded
    gamma = states[:, 1] - 2 * math.pi * turns
    anew = numpy.flatnonzero(abs(numpy.diff(gamma)) > math.pi) + 1
    return numpy.insert(states[:, 0], anew, numpy.nan), numpy.insert(gamma, anew, numpy.nan)
