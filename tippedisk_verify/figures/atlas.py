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
_SYMBOLS = {"mu": "μ", "epsilon": "ε"}


def draw_atlas(found: Atlas) -> Any:
    """The figure: the curves, and the points over them."""
    plane = found.plane
    units = {item.name: item.metadata["unit"] for item in fields(Parameters) if item.metadata}
    unit = units[plane.name] if units[plane.name] != "1" else ""
    power = 3 * round(math.log10(float(plane.highest)) / 3) if unit else 0  # thousandths and the like go to the unit
    factor = 10.0**-power
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
    scaled = f"$10^{{{power}}}$ {unit}" if power else unit
    name = _SYMBOLS.get(plane.name, plane.name)
    axis.set(xlabel=f"{name} [{scaled}]" if unit else name, ylabel="Ω [rad/s]")
    axis.set_xlim(factor * float(plane.lowest), factor * float(plane.highest))
    axis.ticklabel_format(useOffset=False)
    figure.legend(handles=list(handles.values()), loc="outside lower center", ncols=2)
    shared = [
        f"{_SYMBOLS.get(other, other)} = {float(getattr(plane.parameters, other)):g} {units[other]}".removesuffix(" 1")
        for other in units
        if other not in (plane.name, "C")
    ]
    axis.set_title("Disks with " + ", ".join(shared[:4]) + ",\n" + ", ".join(shared[4:]))
    return figure
