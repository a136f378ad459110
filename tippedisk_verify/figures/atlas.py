"""The plane of one parameter and the speed: its curves, the points on them, and what is stable between them."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

import numpy

from tippedisk_verify.figures.style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, RED, pyplot
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.orbits.atlas import Atlas, Region

__all__ = ["axis_label", "disk_title", "draw_atlas"]

_COLUMNS = 64  # of each region, from curve to curve
_CLOSE = 0.02  # of the window's height: folds nearer to another curve cannot be seen apart from it
_TINT = 0.78  # share of white in what is filled
_FILLED = {
    "inverted spinning": BLUE,
    "limit cycle": GREEN,
    "both": ORANGE,
    "neither": GREY,
    "inverted spinning, limit cycle unknown": BLUE,
    "limit cycle unknown": GREY,
}
_LINES = {
    "hopf": (BLACK, "-", "Hopf: inverted spinning changes stability"),
    "fold": (RED, "-", "fold of limit cycles"),
    "heteroclinic": (BLUE, "-", "heteroclinic connection, $\\Omega_h$"),
    "amplitude pi": (PURPLE, "--", "γ's amplitude is π: limit cycles followed no further"),
    "end of the family": (PURPLE, ":", "end of the family of limit cycles, no $\\Omega_h$ found"),
}
_MARKS = {
    "bautin": ("o", "Bautin point"),
    "neutral-saddle": ("s", "neutral saddle: saddle value 0 on $\\Omega_h$"),
    "hopf-heteroclinic": ("D", "$\\Omega_h = \\Omega_\\mathrm{crit}$"),
}


def axis_label(name: str, largest: float) -> tuple[str, float]:
    """The axis's label for a parameter, with a power of 1000 before its unit, and the factor to the numbers on it."""
    unit = next(item.metadata["unit"] for item in fields(Parameters) if item.name == name)
    unit = "" if unit == "1" else unit.replace("^2", "²")
    power = 3 * round(math.log10(largest) / 3) if unit else 0
    text = f"10{str(power).translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))} {unit}" if power else unit
    symbol = {"mu": "μ", "epsilon": "ε"}.get(name, name)
    return f"{symbol} [{text}]" if text else symbol, 10.0**-power


def draw_atlas(found: Atlas) -> Any:
    """The figure: regions filled, curves and points over them."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    plane = found.plane
    label, factor = axis_label(plane.name, float(plane.highest))
    lines = _lines(found)
    distances = _distances(lines)
    rows, height = (2, 7.6) if distances else (1, 5.6)
    figure, axes = pyplot().subplots(
        rows, 1, figsize=(7.2, height), height_ratios=(3, 1)[:rows], sharex=True, squeeze=False, layout="constrained"
    )
    axis, lowest = axes[0, 0], axes[-1, 0]
    speeds = numpy.concatenate([line[1] for _, line in lines])
    room = 0.08 * max(float(speeds.max() - speeds.min()), 0.01)
    low, high = speeds.min() - room, speeds.max() + room
    labels = set()
    for region in found.regions:
        labels |= _fill(axis, region, lines, (low, high), factor)
    marks: list[Any] = [
        Patch(facecolor=_tinted(name), edgecolor=GREY, hatch="///" if "unknown" in name else None, label=_worded(name))
        for name in _FILLED
        if name in labels
    ]
    for kind, line in lines:
        colour, style, text = _LINES[kind]
        axis.plot(line[0] * factor, line[1], style, color=colour, lw=1.6, zorder=3)
        if text not in [mark.get_label() for mark in marks]:
            marks.append(Line2D([], [], color=colour, ls=style, lw=1.6, label=text))
    for kind, (sign, text) in _MARKS.items():
        here = [point for point in found.points if point.kind == kind]
        axis.plot(
            [float(point.value) * factor for point in here],
            [float(point.omega) for point in here],
            sign, color=PURPLE, mec=BLACK, mew=0.7, ms=6.5, zorder=4, ls="none",
        )  # fmt: skip
        if here:
            marks.append(Line2D([], [], ls="none", marker=sign, color=PURPLE, mec=BLACK, mew=0.7, ms=6.5, label=text))
    if distances:
        for name, x, away in distances:
            lowest.semilogy(x * factor, away, color=_LINES[name][0], lw=1.4)
        lowest.set_ylabel("distance of the folds\nfrom both [rad/s]")
        lowest.grid(lw=0.3, alpha=0.5)
    lowest.set_xlabel(label)
    axis.set(ylabel="Ω [rad/s]", ylim=(low, high))
    axis.set_xlim(float(plane.lowest) * factor, float(plane.highest) * factor)
    axis.ticklabel_format(useOffset=False)
    figure.legend(handles=marks, loc="outside lower center", ncols=2, frameon=False)
    axis.set_title(disk_title(plane.parameters, (plane.name,)))
    return figure


def _distances(lines: list[tuple[str, Any]]) -> list[tuple[str, Any, Any]]:
    """How far folds are from the other curves, as (which, parameter, distance); none unless they come close."""
    window = numpy.concatenate([line[1] for _, line in lines])
    found = []
    for name in ("hopf", "heteroclinic"):
        others = [line for kind, line in lines if kind == name]
        if others:
            x, speed = numpy.concatenate(others, axis=1)
            order = numpy.argsort(x)
            for fold in (line for kind, line in lines if kind == "fold"):
                there = numpy.interp(fold[0], x[order], speed[order], left=numpy.nan, right=numpy.nan)
                found.append((name, fold[0], numpy.abs(fold[1] - there)))
    smallest = min((numpy.nanmin(away) for *_, away in found if numpy.isfinite(away).any()), default=math.inf)
    return found if smallest < _CLOSE * numpy.ptp(window) else []


def disk_title(parameters: Parameters, varied: tuple[str, ...]) -> str:
    """The parameters that all disks of a plane share, with their units."""
    parts = []
    for item in fields(Parameters):
        if item.metadata and item.name not in (*varied, "C"):
            label, factor = axis_label(item.name, float(getattr(parameters, item.name)))
            symbol, _, unit = label.partition(" [")
            parts.append(f"{symbol} = {float(getattr(parameters, item.name)) * factor:g} {unit.rstrip(']')}".strip())
    return "Disks with " + ", ".join(parts[:4]) + ",\n" + ", ".join(parts[4:])


def _worded(stable: str) -> str:
    return {
        "inverted spinning": "stable: inverted spinning",
        "limit cycle": "stable: limit cycle",
        "both": "stable: inverted spinning and limit cycle",
        "neither": "stable: neither of the two",
        "inverted spinning, limit cycle unknown": "stable: inverted spinning; limit cycle not known",
        "limit cycle unknown": "inverted spinning unstable, limit cycle not known",
    }.get(stable, stable)


def _tinted(stable: str) -> str:
    from matplotlib.colors import to_hex, to_rgb

    red, green, blue = (_TINT + (1 - _TINT) * part for part in to_rgb(_FILLED[stable]))
    return to_hex((red, green, blue))


def _lines(found: Atlas) -> list[tuple[str, Any]]:
    """(kind, (2, n) parameter and speed) of what is drawn as a line, in SI units."""
    lines = []
    for curve in found.curves:
        if curve.points:
            line = numpy.array([(float(point.value), float(point.omega)) for point in curve.points]).T
            lines.append((curve.kind, line))
    for region in found.regions:
        for other in {"amplitude pi", "end of the family"} & set(region.bounds):
            ends = [(float(found.plane.value(one.share)), dict(one.bounds)[other]) for one in region.slices]
            lines.append((other, numpy.array(ends).T))
    return lines


def _fill(axis: Any, region: Region, lines: list[tuple[str, Any]], window: tuple[float, float], factor: float) -> Any:
    """Fill the cells of a region; returns what is stable in them."""
    at = numpy.linspace(float(region.lowest), float(region.highest), _COLUMNS)
    edges = [numpy.full(len(at), window[0])]
    for number, kind in enumerate(region.bounds):
        which = region.bounds[:number].count(kind)
        mine = [line for name, line in lines if name == kind]
        edges.append(numpy.array([_speed(mine, value, which) for value in at.tolist()]))
    edges.append(numpy.full(len(at), window[1]))
    cells = region.slices[0].cells
    for cell, low, high in zip(cells, edges, edges[1:], strict=False):
        colour = _tinted(cell.stable)  # of the edges too: without them two regions of one kind have a seam
        look = (
            {"hatch": "///", "fc": colour, "ec": GREY, "lw": 0}
            if "unknown" in cell.stable
            else {"color": colour, "lw": 0.5}
        )
        axis.fill_between(at * factor, low, high, zorder=1, **look)
    return {cell.stable for cell in cells}


def _speed(lines: list[Any], value: float, which: int) -> float:
    """The speed of the line of that number, from below, at a value; next to where all end, that of the nearest end."""
    met = []
    for x, y in lines:
        for k in numpy.flatnonzero((x[:-1] - value) * (x[1:] - value) <= 0):
            share = (value - x[k]) / (x[k + 1] - x[k]) if x[k + 1] != x[k] else 0.0
            met.append(float(y[k] + share * (y[k + 1] - y[k])))
    met = sorted(set(met))
    if which < len(met):
        return met[which]
    nearest = min(((abs(float(a) - value), float(b)) for x, y in lines for a, b in zip(x, y, strict=True)))
    return nearest[1]
