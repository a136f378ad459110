"""The proved family of limit cycles: its arcs, the width of the proved tube, and both ends."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy

from tippedisk_verify.figures.style import BLACK, BLUE, GREEN, GREY, ORANGE, RED, figure_with_axes
from tippedisk_verify.proofs.closed_forms import measured_omega_crit
from tippedisk_verify.proofs.kernel.certificates.family import ProvedArc
from tippedisk_verify.proofs.search.family_proof import FamilyProof

__all__ = ["draw_proved_family"]

_POINTS = 40  # of each arc
_MIN_DISTANCE = 1e-5  # the least distance of an amplitude from pi that is shown [rad]
_AMPLITUDE, _SPEED = r"$\bar{\gamma}_0$ [rad]", "Ω [rad/s]"


def draw_proved_family(proof: FamilyProof) -> Any:
    """Draw a proved family of limit cycles in four panels. The proof must reach the Hopf point.

    Returns:
        The Matplotlib figure.
    """
    figure, axes = figure_with_axes(4, 2, (4.5, 3.4))
    crit = float(measured_omega_crit(proof.parameters).value)
    enclosure = proof.connection.omega_h if proof.connection is not None else None
    omega_h = math.nan if enclosure is None else float(enclosure.value)
    for draw, axis in zip(
        (_draw_family, _draw_widths, _draw_hopf_end, _draw_connection_end), axes, strict=True
    ):
        draw(axis, proof, crit, omega_h)
    return figure


def _arcs(proof: FamilyProof) -> list[tuple[ProvedArc, str, Any, Any]]:
    """Return each proved arc of the family with its colour, amplitudes [rad] and speeds [rad/s],
    for the plots.
    """
    arcs = []
    for count, arc in enumerate(proof.arcs):
        a = numpy.linspace(float(arc.low), float(arc.high), _POINTS)
        arcs.append(
            (
                arc,
                (BLUE, ORANGE)[count % 2],
                a,
                numpy.array([float(arc.at(Fraction(x))[1]) for x in a]),
            )
        )
    return arcs


def _draw_family(axis: Any, proof: FamilyProof, crit: float, omega_h: float) -> None:
    for _, colour, a, omega in _arcs(proof):
        axis.plot(omega, a, color=colour, lw=2.2)
    if proof.heteroclinic_closed and proof.near_omega_h is not None:
        low = math.pi - float(proof.near_omega_h.gamma)
        axis.fill_between(
            [omega_h, float(proof.near_omega_h.high)], low, math.pi, color=GREEN, alpha=0.6, lw=0
        )
    axis.margins(x=0.12)
    for speed, name, side in ((crit, r"$\Omega_\mathrm{crit}$", 1), (omega_h, r"$\Omega_h$", -1)):
        if not math.isnan(speed):
            axis.axvline(speed, color=GREY, lw=0.9)
            axis.annotate(
                name,
                (speed, 0.12),
                xycoords=("data", "axes fraction"),
                xytext=(4 * side, 0),
                textcoords="offset points",
                ha="left" if side > 0 else "right",
            )
    axis.axhline(math.pi, color=GREY, lw=0.9, ls=":")
    axis.annotate(
        "π",
        (1, math.pi),
        xycoords=("axes fraction", "data"),
        xytext=(4, -3),
        textcoords="offset points",
    )
    axis.set(xlabel=_SPEED, ylabel=_AMPLITUDE, title=f"The family, {len(proof.arcs)} arcs")
    axis.ticklabel_format(useOffset=False)


def _draw_widths(axis: Any, proof: FamilyProof, crit: float, omega_h: float) -> None:
    edges = [float(arc.low) for arc in proof.arcs] + [float(proof.arcs[-1].high)]
    for rows, style, manner in (
        ("unique_within", "-", "no other cycle within"),
        ("within", ":", "enclosed within"),
    ):
        for index, unit, colour in ((1, _SPEED, BLUE), (0, r"$v_0$ [rad/s]", RED)):
            sizes = [
                float(arc.scaled_to(arc.high, getattr(arc, rows))[index]) for arc in proof.arcs
            ]
            axis.stairs(
                sizes,
                edges,
                baseline=None,
                color=colour,
                ls=style,
                lw=1.5,
                label=f"{manner}: {unit}",
            )
    axis.set_yscale("log")
    low, high = axis.get_ylim()
    axis.set_ylim(low / (high / low) ** 0.45, high)  # space for the legend
    axis.set(xlabel=_AMPLITUDE, title="How wide the proved tube is")
    axis.legend(loc="lower left")


def _draw_hopf_end(axis: Any, proof: FamilyProof, crit: float, omega_h: float) -> None:
    for arc, colour, a, omega in _arcs(proof)[:2]:
        off = float(arc.unique_within[1])
        axis.fill_between(a, omega - off, omega + off, color=colour, alpha=0.3, lw=0)
        axis.plot(a, omega, color=colour, lw=1.2)
    axis.axhline(crit, color=GREY, lw=0.9)
    axis.annotate(
        r"$\Omega_\mathrm{crit}$",
        (1, crit),
        xycoords=("axes fraction", "data"),
        va="bottom",
        ha="right",
    )
    axis.ticklabel_format(useOffset=False)
    axis.set(xlim=(0, None), xlabel=_AMPLITUDE, ylabel=_SPEED)
    axis.set_title("The Hopf end: the first arc begins at 0; shaded, its tube")


def _draw_connection_end(axis: Any, proof: FamilyProof, crit: float, omega_h: float) -> None:
    closed = "the set Q holds the rest" if proof.heteroclinic_closed else "open"
    axis.set_title(f"The heteroclinic end: {closed}")
    near = [arc for arc in _arcs(proof) if math.pi - float(arc[0].high) < 0.8]
    if math.isnan(omega_h) or not (near or proof.heteroclinic_closed):
        axis.set_axis_off()
        return
    if proof.heteroclinic_closed and proof.near_omega_h is not None:
        distance = float(proof.near_omega_h.high) - omega_h
        axis.fill_between(
            [_MIN_DISTANCE, float(proof.near_omega_h.gamma)],
            _MIN_DISTANCE / 10,
            distance,
            color=GREEN,
            alpha=0.4,
            lw=0,
            label="Q: exactly one cycle",
        )
        axis.legend(loc="upper left")
    for _, colour, a, omega in near:
        axis.plot(math.pi - a, omega - omega_h, color=colour, lw=2.2)
        axis.plot(math.pi - a[-1], omega[-1] - omega_h, "|", color=BLACK, ms=7)
    axis.set(xscale="log", yscale="log", xlim=(_MIN_DISTANCE, 0.8), ylim=(_MIN_DISTANCE / 10, None))
    axis.set(xlabel=r"$\pi - \bar{\gamma}_0$ [rad]", ylabel=r"$\Omega - \Omega_h$ [rad/s]")
