"""The work-precision diagram: run time against error, one panel a problem, readable without colour."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from tippedisk_verify.evidence.bench.race import Score
from tippedisk_verify.plots import pyplot

__all__ = ["draw_bench"]

# Each method its own mark and line: the colours (Okabe and Ito's) are only a help.
_STYLES = {
    "taylor": ("#0072B2", "o", "-"),
    "taylor, fast math": ("#0072B2", "", "--"),
    "taylor, high accuracy": ("#0072B2", "s", ":"),
    "taylor beyond double": ("#0072B2", "*", ""),
    "scipy RK45": ("#E69F00", "v", "--"),
    "scipy DOP853": ("#D55E00", "^", "-"),
    "scipy DOP853, compiled": ("#D55E00", "2", ":"),
    "scipy LSODA": ("#009E73", "D", "-"),
    "scipy LSODA, compiled": ("#009E73", "1", ":"),
    "scipy Radau": ("#CC79A7", "P", "--"),
    "scipy BDF": ("#56B4E9", "X", "--"),
    "mpmath odefun": ("#000000", "h", ""),
    "reduced flow, order": ("#707070", "p", ":"),
    "CVODE BDF": ("#000000", "<", "-"),
    "CVODE Adams": ("#000000", ">", "--"),
    "diffrax Dopri8": ("#8A6D00", "d", "-."),
    "diffrax Kvaerno5": ("#8A6D00", "H", "-."),
}
_LEAST, _MOST = 1e-18, 1e2  # of the errors shown; a run with more digits sits on the lower edge
_UNFINISHED = 3e1  # where a run without an end is drawn


def draw_bench(scores: Sequence[Score]) -> Any:
    """The figure. Runs that failed or were not finished stand as crosses in a band of their own at the top."""
    plt = pyplot()
    names = list(dict.fromkeys(score.problem for score in scores))
    columns = min(4, len(names) + 1)
    rows = math.ceil((len(names) + 1) / columns)  # one more cell, for the legend
    figure, grid = plt.subplots(rows, columns, figsize=(3.3 * columns, 3.3 * rows), squeeze=False)
    shown: dict[str, Any] = {}
    for axis, name in zip(grid.flat, names, strict=False):
        here = [score for score in scores if score.problem == name]
        for method in dict.fromkeys(score.method for score in here):
            colour, mark, line = _STYLES.get(method, ("#999999", ".", "-"))
            ended = [score for score in here if score.method == method and score.error is not None and score.seconds]
            drawn = axis.plot(
                [score.seconds for score in ended],
                [min(max(score.error or 0.0, _LEAST), _MOST / 10) for score in ended],
                color=colour, marker=mark, linestyle=line or "none", markersize=4.5, linewidth=1, label=method,
            )[0]  # fmt: skip
            shown.setdefault(method, drawn)
            lost = [score for score in here if score.method == method and score.error is None]
            for score in lost:
                spent = score.preparation or max((s.seconds or 0 for s in ended), default=1.0) or 1.0
                axis.plot([spent], [_UNFINISHED], marker="x", color=colour, markersize=5)
        axis.axhspan(_MOST / 10, _MOST, color="0.9")
        axis.text(0.02, 0.975, "no end", transform=axis.transAxes, va="top", fontsize=7)
        uncertainty = max(score.truth_uncertainty for score in here)
        axis.axhspan(_LEAST / 10, max(uncertainty, _LEAST), color="0.8")
        axis.text(0.02, 0.012, f"reference: ± {uncertainty:.0e}", transform=axis.transAxes, fontsize=7)
        axis.set(xscale="log", yscale="log", ylim=(_LEAST / 10, _MOST), title=name)
        axis.grid(True, color="0.9", linewidth=0.5)
    for axis in list(grid.flat)[len(names) :]:
        axis.set_axis_off()
    for place, axis in enumerate(list(grid.flat)[: len(names)]):
        if place + columns >= len(names):  # nothing below it
            axis.set_xlabel("run time, warm [s]")
    for row in grid:
        row[0].set_ylabel("error [rad, rad/s; of T in s]")
    legend = list(grid.flat)[-1]
    legend.legend(shown.values(), shown.keys(), loc="center", frameon=False, fontsize=8)
    figure.tight_layout()
    return figure
