"""Run time against error: the work-precision diagram, one panel a problem, readable without colour."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from tippedisk_verify.audit.claims import Audit
from tippedisk_verify.bench.methods import METHODS, Method
from tippedisk_verify.bench.problems import problem_named
from tippedisk_verify.bench.race import Score, machine, raced, ratios
from tippedisk_verify.figures.exhibit import Drawing, Exhibit, Table
from tippedisk_verify.figures.style import pyplot

__all__ = ["EXHIBITS", "draw_bench"]

# Each method its own mark and line: the colours (Okabe and Ito's) are only a help.
_STYLES = {
    "taylor": ("#0072B2", "o", "-"),
    "taylor, fast math": ("#0072B2", "", "--"),
    "taylor, high accuracy": ("#0072B2", "s", ":"),
    "taylor beyond double": ("#0072B2", "*", ""),
    "bare heyoka": ("#56B4E9", "+", ""),
    "with half-widths, digits": ("#CC0000", "o", "-"),
    "scipy RK45": ("#E69F00", "v", "--"),
    "scipy DOP853": ("#D55E00", "^", "-"),
    "scipy DOP853, compiled": ("#D55E00", "2", ":"),
    "scipy LSODA": ("#009E73", "D", "-"),
    "scipy LSODA, compiled": ("#009E73", "1", ":"),
    "scipy Radau": ("#CC79A7", "P", "--"),
    "scipy BDF": ("#56B4E9", "X", "--"),
    "mpmath odefun": ("#000000", "h", ""),
    "CVODE BDF": ("#000000", "<", "-"),
    "CVODE Adams": ("#000000", ">", "--"),
    "diffrax Dopri8": ("#8A6D00", "d", "-."),
    "numbalsoda LSODA": ("#8A6D00", "1", "-"),
    "numbalsoda DOP853": ("#8A6D00", "2", "-"),
}
_LEAST, _MOST = 1e-27, 1e2  # of the errors shown; a run with more digits sits on the lower edge
_UNFINISHED = 3e1  # where a run without an end is drawn


#: What the report races: seconds in all. `bench` has the other problems and methods.
_PROBLEMS = ("cycle", "passage")
_METHODS = {
    "bare heyoka": None,
    "taylor": None,
    "with half-widths, digits": None,
    "scipy DOP853": None,
    "scipy LSODA": None,
    "scipy Radau": (1e-4, 1e-6, 1e-8),
}


def draw_bench(scores: Sequence[Score], most_columns: int = 4) -> Any:
    """The figure. Runs that failed or were not finished stand as crosses in a band of their own at the top."""
    plt = pyplot()
    names = list(dict.fromkeys(score.problem for score in scores))
    columns = min(most_columns, len(names) + 1)
    rows = math.ceil((len(names) + 1) / columns)  # one more cell, for the legend
    figure, grid = plt.subplots(rows, columns, figsize=(3.3 * columns, 3.3 * rows), squeeze=False)
    shown: dict[str, Any] = {}
    axes = list(grid.flat)
    for axis, name in zip(axes, names, strict=False):
        axis.set(xscale="log", yscale="log", ylim=(_LEAST / 10, _MOST), title=name)
        shown |= _draw_problem(axis, [score for score in scores if score.problem == name])
    for axis in axes[len(names) :]:
        axis.set_axis_off()
    for place, axis in enumerate(axes[: len(names)]):
        if place + columns >= len(names):  # nothing below it
            axis.set_xlabel("run time, warm [s]")
        if place % columns == 0:
            axis.set_ylabel("error [rad, rad/s]")
    axes[-1].legend(shown.values(), shown.keys(), loc="center", frameon=False, fontsize=8)
    figure.tight_layout()
    return figure


def _draw_problem(axis: Any, scores: Sequence[Score]) -> dict[str, Any]:
    """One panel; the line of each method."""
    drawn = {}
    for method in dict.fromkeys(score.method for score in scores):
        colour, mark, line = _STYLES.get(method, ("#000000", "o", ""))
        mine = [score for score in scores if score.method == method]
        ended = [score for score in mine if score.error is not None and score.seconds]
        (drawn[method],) = axis.plot(
            [score.seconds for score in ended],
            [min(max(score.error or 0.0, _LEAST), _MOST / 10) for score in ended],
            color=colour, marker=mark, linestyle=line or "none", markersize=4.5, linewidth=1,
            label=method,
        )  # fmt: skip
        longest = max((score.seconds or 0 for score in ended), default=1.0) or 1.0
        for score in mine:
            if score.error is None:
                axis.plot([score.preparation or longest], [_UNFINISHED], marker="x", color=colour, markersize=5)
    axis.axhspan(_MOST / 10, _MOST, color="0.9")
    axis.text(0.02, _UNFINISHED, "no end", transform=axis.get_yaxis_transform(), va="center", fontsize=7)
    uncertainty = max(score.truth_uncertainty for score in scores)
    axis.axhspan(_LEAST / 10, max(uncertainty, _LEAST), color="0.8")
    axis.text(0.02, 0.012, f"reference: ± {uncertainty:.0e}", transform=axis.transAxes, fontsize=7)
    axis.grid(True, color="0.9", linewidth=0.5)
    return drawn


def _brief_methods() -> list[Method]:
    """The methods that the report races: ours and the strongest of SciPy's, at settings that take seconds."""
    return [
        method if settings is None else replace(method, settings=settings)
        for method in METHODS
        if (settings := _METHODS.get(method.name, ())) != ()
    ]


def _race(audit: Audit, examined: Sequence[str]) -> Drawing:
    scores = raced([problem_named(name) for name in _PROBLEMS], _brief_methods())
    rows = [score.to_dict() for score in scores]
    shown = [
        (score.problem, score.method, score.setting, score.seconds and score.seconds * 1e3, score.error, score.status)
        for score in scores
    ]
    return Drawing(
        figure=lambda columns: draw_bench(scores, columns),
        columns=3,
        reading=f"{_compared(scores)} {_load()}",
        data={"race.csv": (list(rows[0]), [list(row.values()) for row in rows])},
        tables=(
            Table.of(
                "Median of the warm runs, and the largest true error at the ends of runs of three lengths, of each "
                "method at each setting: its tolerance, or its arithmetic. SciPy's right-hand side is plain Python in "
                "its fastest form. " + _problems(),
                ("problem", "method", "setting", "run time [ms]", "error [rad, rad/s]", "status"),
                shown,
            ),
        ),
        facts={"raced_on": machine()},
    )


def _problems() -> str:
    return " ".join(f"The problem {name}: {problem_named(name).says}." for name in _PROBLEMS)


def _compared(scores: Sequence[Score]) -> str:
    """How much longer the best of SciPy takes, to the error of 1e-8, problem by problem."""
    said = []
    for row in ratios(scores):
        if row["error_at_most"] == 1e-8 and row["scipy_over_heyoka"]:
            ratio = float(f"{row['scipy_over_heyoka']:.2g}")
            said.append(f"{ratio:g} times on the problem {row['problem']}")
    return (
        "To an error of 1e-8 the fastest method of SciPy, with its right-hand side in plain Python, takes, as a "
        "multiple of the Taylor engine's time: " + ", ".join(said) + "."
    )


def _load() -> str:
    """How busy the machine was, where the system tells: what shares a core with others takes longer."""
    if not hasattr(os, "getloadavg"):
        return ""
    return f"The machine's load was {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores."


EXHIBITS = (
    Exhibit(
        name="race",
        title="Run time against error",
        source="",
        alternative="Two panels with logarithmic axes, error against run time: the Taylor engine's "
        "points lie far left of SciPy's at the same error, and go on below where double precision ends.",
        draw=_race,
        alone=True,
    ),
)
