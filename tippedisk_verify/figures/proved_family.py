"""The proved family of limit cycles: its curve and arcs, the width of what is proved, and both ends magnified."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy

from tippedisk_verify.figures.style import BLUE, GREEN, GREY, ORANGE, RED, pyplot
from tippedisk_verify.proofs.kernel.claims.arcs import Piece
from tippedisk_verify.proofs.search.branch import BranchProof, omega_crit

__all__ = ["draw_proved_family"]

_POINTS = 40  # of each arc
_LEAST = 1e-5  # rad: how near to pi amplitudes are shown


def draw_proved_family(proof: BranchProof) -> Any:
    """The figure of a proof whose Hopf end is closed."""
    figure, axes = pyplot().subplots(2, 2, figsize=(8.6, 6.8), layout="constrained")
    crit = float(omega_crit(proof.parameters).value)
    known = proof.connection.omega_h if proof.connection is not None else None
    omega_h = math.nan if known is None else float(known.value)
    _family(axes[0, 0], proof, crit, omega_h)
    _widths(axes[0, 1], proof)
    _hopf_end(axes[1, 0], proof.pieces, crit)
    _connection_end(axes[1, 1], proof, omega_h)
    for axis in axes.flat:
        axis.grid(lw=0.3, alpha=0.5)
    return figure


def _along(piece: Piece) -> tuple[Any, Any]:
    """Amplitudes [rad] and speeds [rad/s] along an arc."""
    a = numpy.linspace(float(piece.low), float(piece.high), _POINTS)
    return a, numpy.array([float(piece.at(Fraction(x))[1]) for x in a.tolist()])


def _family(axis: Any, proof: BranchProof, crit: float, omega_h: float) -> None:
    for count, piece in enumerate(proof.pieces):
        a, omega = _along(piece)
        axis.plot(omega, a, color=(BLUE, ORANGE)[count % 2], lw=2.2, label="arcs, in turns" if count == 1 else None)
    end = proof.end
    if proof.end_closed and end is not None:
        low = math.pi - float(end.gamma)
        axis.fill_between([omega_h, float(end.high)], low, math.pi, color=GREEN, alpha=0.5, lw=0, label="the set Q")
    axis.margins(x=0.12)
    for speed, name, side in ((crit, r"$\Omega_\mathrm{crit}$", "left"), (omega_h, r"$\Omega_h$", "right")):
        axis.axvline(speed, color=GREY, lw=0.9)
        place = {"xytext": (4 if side == "left" else -4, 0), "textcoords": "offset points", "ha": side}
        axis.annotate(name, (speed, 0.12), xycoords=("data", "axes fraction"), **place)
    axis.axhline(math.pi, color=GREY, lw=0.9, ls=":")
    axis.set(xlabel="Ω [rad/s]", ylabel=r"$\bar{\gamma}_0$ [rad]", title=f"The family, {len(proof.pieces)} arcs")
    axis.ticklabel_format(useOffset=False)
    axis.legend(loc="center right", frameon=False)


def _widths(axis: Any, proof: BranchProof) -> None:
    edges = [float(piece.low) for piece in proof.pieces] + [float(proof.pieces[-1].high)]
    for rows, style, manner in (("unique_within", "-", "no other cycle within"), ("within", ":", "enclosed within")):
        for index, unit, colour in ((1, "Ω [rad/s]", BLUE), (0, r"$v_0$ [rad/s]", RED)):
            sizes = [float(piece.scaled_to(piece.high, getattr(piece, rows))[index]) for piece in proof.pieces]
            axis.stairs(sizes, edges, baseline=None, color=colour, ls=style, lw=1.5, label=f"{manner}: {unit}")
    axis.set_yscale("log")
    low, high = axis.get_ylim()
    axis.set_ylim(low, high**1.6 / low**0.6)
    axis.set(xlabel=r"$\bar{\gamma}_0$ [rad]", title="How wide the proved tube is")
    axis.legend(loc="upper center", frameon=False)


def _hopf_end(axis: Any, pieces: tuple[Piece, ...], crit: float) -> None:
    for count, piece in enumerate(pieces[:2]):
        a, omega = _along(piece)
        off, colour = float(piece.unique_within[1]), (BLUE, ORANGE)[count]
        axis.fill_between(a, omega - off, omega + off, color=colour, alpha=0.3, lw=0)
        axis.plot(a, omega, color=colour, lw=1.2)
    axis.axhline(crit, color=GREY, lw=0.9)
    axis.ticklabel_format(useOffset=False)
    axis.set(xlim=(0, None), xlabel=r"$\bar{\gamma}_0$ [rad]", ylabel="Ω [rad/s]")
    axis.set_title("The Hopf end: the first arc begins at 0; shaded, its tube")


def _connection_end(axis: Any, proof: BranchProof, omega_h: float) -> None:
    end = proof.end
    if math.isnan(omega_h):
        axis.set_axis_off()
        return
    if proof.end_closed and end is not None:
        reach = float(end.high) - omega_h
        axis.fill_between(
            [_LEAST, float(end.gamma)], _LEAST / 10, reach, color=GREEN, alpha=0.4, lw=0, label="Q: exactly one cycle"
        )
    for count, piece in enumerate(proof.pieces):
        if math.pi - float(piece.high) < 0.8:
            a, omega = _along(piece)
            axis.plot(math.pi - a, omega - omega_h, color=(BLUE, ORANGE)[count % 2], lw=2.2)
            axis.plot(math.pi - a[-1], omega[-1] - omega_h, "|", color="black", ms=7)
    axis.set(xscale="log", yscale="log", xlim=(_LEAST, 0.8), ylim=(_LEAST / 10, None))
    axis.set(xlabel=r"$\pi - \bar{\gamma}_0$ [rad]", ylabel=r"$\Omega - \Omega_h$ [rad/s]")
    closed = "the set Q holds the rest" if proof.end_closed else "open"
    axis.set_title(f"The heteroclinic end: {closed}")
    if proof.end_closed:
        axis.legend(loc="upper left", frameon=False)
