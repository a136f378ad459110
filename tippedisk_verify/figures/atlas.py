"""The plane of one parameter and the speed: its curves and the points on them."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

from tippedisk_verify.atlas.plane import Atlas
from tippedisk_verify.figures.style import BLACK, BLUE, ORANGE, PURPLE, pyplot
from tippedisk_verify.model.parameters import Parameters

__all__ = ["draw_atlas"]

# Folds come close to the other two curves, and are narrow lines on wide ones there.
_CURVES: dict[str, dict[str, Any]] = {
    "hopf": {"color": BLACK, "lw": 2.6, "label": "$\\Omega_\\mathrm{crit}$, Hopf: inverted spinning is stable above"},
    "heteroclinic": {"color": BLUE, "lw": 2.6, "label": "$\\Omega_h$, heteroclinic: the family of cycles ends"},
    "fold": {"color": ORANGE, "lw": 1.2, "label": "fold: a stable and an unstable cycle meet"},
}
_POINTS = {
    "bautin": ("o", "Bautin: cycles are no longer born stable"),
    "neutral-saddle": ("s", "neutral saddle: saddle value 0 on $\\Omega_h$"),
    "hopf-heteroclinic": ("D", "$\\Omega_h = \\Omega_\\mathrm{crit}$"),
}


def draw_atlas(found: Atlas) -> Any:
    """The figure: the curves, and the points over them."""
    plane = found.plane
    name, factor = _axis_label(plane.name, float(plane.highest))
    figure, axis = pyplot().subplots(figsize=(7.2, 5.6), layout="constrained")
    handles: dict[str, Any] = {}
    for curve in sorted(found.curves, key=lambda curve: curve.kind == "fold"):
        x, y = ([float(getattr(point, part)) for point in curve.points] for part in ("value", "omega"))
        (handles[curve.kind],) = axis.plot([factor * value for value in x], y, **_CURVES[curve.kind])
    for point in found.points:
        marker, label = _POINTS[point.kind]
        (handles[point.kind],) = axis.plot(
            factor * float(point.value), float(point.omega), marker,
            color=PURPLE, mec=BLACK, mew=0.7, ms=6.5, label=label, clip_on=False,
        )  # fmt: skip
    axis.set(xlabel=name, ylabel="Ω [rad/s]")
    axis.set_xlim(factor * float(plane.lowest), factor * float(plane.highest))
    axis.ticklabel_format(useOffset=False)
    axis.grid(lw=0.3, alpha=0.5)
    figure.legend(handles=list(handles.values()), loc="outside lower center", ncols=2, frameon=False)
    axis.set_title(_title(plane.parameters, plane.name))
    return figure


def _title(parameters: Parameters, varied: str) -> str:
    """The parameters that all disks of the plane share, with their units."""
    parts = []
    for item in fields(Parameters):
        if item.metadata and item.name not in (varied, "C"):
            label, factor = _axis_label(item.name, float(getattr(parameters, item.name)))
            symbol, _, unit = label.partition(" [")
            parts.append(f"{symbol} = {float(getattr(parameters, item.name)) * factor:g} {unit.rstrip(']')}".strip())
    return "Disks with " + ", ".join(parts[:4]) + ",\n" + ", ".join(parts[4:])


def _axis_label(name: str, largest: float) -> tuple[str, float]:
    """The axis's label for a parameter, with a power of 1000 before its unit, and the factor to the numbers on it."""
    unit = next(item.metadata["unit"] for item in fields(Parameters) if item.name == name)
    unit = "" if unit == "1" else unit.replace("^2", "²")
    power = 3 * round(math.log10(largest) / 3) if unit else 0
    text = f"10{str(power).translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))} {unit}" if power else unit
    symbol = {"mu": "μ", "epsilon": "ε"}.get(name, name)
    return f"{symbol} [{text}]" if text else symbol, 10.0**-power
