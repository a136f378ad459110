"""The plane of two parameters of a disk: the curves of codimension two, and the disks that were examined."""

from __future__ import annotations

from typing import Any

from tippedisk_verify.figures.atlas import axis_label, disk_title
from tippedisk_verify.figures.style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, RED, pyplot
from tippedisk_verify.orbits.disk_plane import DiskAtlas
from tippedisk_verify.orbits.slices import Slice

__all__ = ["draw_disk_plane"]

_LINES = {
    "bautin": (ORANGE, "Bautin: cycles are born stable on one side, unstable on the other"),
    "neutral-saddle": (BLUE, "saddle value 0 on $\\Omega_h$: curves of folds end"),
    "hopf-heteroclinic": (BLACK, "$\\Omega_h = \\Omega_\\mathrm{crit}$"),
}
_SIGNS = (("o", GREEN), ("s", ORANGE), ("D", BLUE), ("^", PURPLE), ("v", RED), ("P", BLACK))


def draw_disk_plane(found: DiskAtlas) -> Any:
    """The figure: curves, and a sign for each disk that says what is stable at rising speeds."""
    first, second = found.plane.first, found.plane.second
    (xlabel, xfactor), (ylabel, yfactor) = (axis_label(plane.name, float(plane.highest)) for plane in (first, second))
    figure, axis = pyplot().subplots(figsize=(7.2, 6.4), layout="constrained")
    drawn = set()
    for curve in found.curves:
        colour, text = _LINES[curve.kind]
        x = [float(point.first) * xfactor for point in curve.points]
        y = [float(point.second) * yfactor for point in curve.points]
        axis.plot(x, y, color=colour, lw=1.8, label=None if text in drawn else text)
        drawn.add(text)
    kinds = [one and _worded(one) for *_, one in found.disks]
    signs = iter(_SIGNS * (1 + len(set(kinds)) // len(_SIGNS)))
    for kind in dict.fromkeys(kinds):
        sign, colour = next(signs) if kind else ("x", GREY)
        here = [place for place, own in zip(found.disks, kinds, strict=True) if own == kind]
        axis.plot(
            [float(first.value(x)) * xfactor for x, *_ in here],
            [float(second.value(y)) * yfactor for _, y, _ in here],
            sign,
            color=colour,
            mec=BLACK if kind else GREY,
            mew=0.4 if kind else 1.0,
            ms=5,
            ls="none",
            label=kind if kind else "no admissible disk",
            clip_on=False,
        )
    axis.set(xlabel=xlabel, ylabel=ylabel)
    axis.set_xlim(float(first.lowest) * xfactor, float(first.highest) * xfactor)
    axis.set_ylim(float(second.lowest) * yfactor, float(second.highest) * yfactor)
    axis.ticklabel_format(useOffset=False)
    axis.set_title(disk_title(first.parameters, (first.name, second.name)), pad=10)
    figure.legend(loc="outside lower center", ncols=1, frameon=False)
    return figure


def _worded(one: Slice) -> str:
    """What is stable at rising speeds, with the curves between."""
    names = {"hopf": "$\\Omega_\\mathrm{crit}$", "heteroclinic": "$\\Omega_h$"}
    parts = [one.cells[0].stable]
    for (kind, _), cell in zip(one.bounds, one.cells[1:], strict=True):
        parts += [f"– {names.get(kind, kind)} –", cell.stable]
    return "stable: " + " ".join(parts)
