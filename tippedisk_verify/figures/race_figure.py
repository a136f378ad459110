"""The work-precision diagram of run time and error, with one panel for each problem."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import cycle
from typing import Any

from tippedisk_verify.audit.claims import Audit
from tippedisk_verify.bench.measurement import Score, machine_facts, run_race, run_time_ratios
from tippedisk_verify.bench.methods import BENCH_METHODS, Method
from tippedisk_verify.bench.peers import peer_methods
from tippedisk_verify.bench.problems import ErrorKind, problem_named
from tippedisk_verify.errors import InputError
from tippedisk_verify.figures.exhibit import CSV, Drawing, Exhibit
from tippedisk_verify.figures.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    RED,
    SKY,
    figure_with_axes,
)

__all__ = ["draw_race", "race_csv", "race_exhibit"]

# Colour, mark and line by method. Variants of a method share its colour and have hollow marks.
_LOOKS = {
    "taylor": (BLUE, "o", "-"),
    "taylor, fast math": (BLUE, "o", ":"),
    "taylor, high accuracy": (BLUE, "s", ":"),
    "taylor beyond double": (BLUE, "*", "none"),
    "bare heyoka": (BLUE, "d", "none"),
    "with half-widths, digits": (RED, "D", "-"),
    "scipy DOP853": (ORANGE, "^", "-"),
    "scipy DOP853, compiled": (ORANGE, "^", ":"),
    "scipy RK45": (ORANGE, "<", "--"),
    "scipy LSODA": (GREEN, "v", "-"),
    "scipy LSODA, compiled": (GREEN, "v", ":"),
    "scipy BDF": (PURPLE, "P", "--"),
    "scipy Radau": (PURPLE, "s", "-"),
    "numbalsoda LSODA": (BLACK, "v", "-"),
    "numbalsoda DOP853": (BLACK, "^", "-"),
    "CVODE BDF": (SKY, "P", "--"),
    "CVODE Adams": (SKY, "X", "--"),
    "diffrax Dopri8": (SKY, "h", "-"),
}
# The same for integrators that users bring. A colour that comes back has hollow marks and a dotted
# line.
_OWN_LOOKS = tuple(
    ((BLACK, SKY, RED)[n % 3], ("s", ">", "*", "<")[n % 4], ("-", ":")[(n // 3 + n // 12) % 2])
    for n in range(24)
)
_UNITS = {
    "error_over_samples": "rad or rad/s",
    "seconds": "s",
    "spread": "1",
    "preparation": "s",
    "order": "1",
    "order_error": "1",
}
# The error's name on an axis and its unit.
_ERRORS: dict[ErrorKind, tuple[str, str]] = {
    "state": ("error", "rad or rad/s"),
    "period": ("error of the period", "s"),
    "crossing": ("error at the section", "rad or rad/s"),
    "amplitude": ("error of the largest beta", "rad"),
}
_MIN_SHOWN_ERROR = 1e-27  # the least error shown; a smaller one is drawn there

# The problems and settings of the report, which take seconds in all. `bench` has all of them.
_PROBLEMS = ("cycle", "passage")
_METHODS: dict[str, tuple[Any, ...]] = {
    "bare heyoka": ("double", "extended"),
    "taylor": (1e-3, 1e-6, 1e-9, 1e-12, 1e-15),
    "with half-widths, digits": (12, 16),
    "scipy DOP853": (1e-4, 1e-6, 1e-8, 1e-9, 1e-11, 1e-13),
    "scipy LSODA": (),
    "scipy Radau": (1e-4, 1e-6),
}


def draw_race(scores: Sequence[Score], columns: int = 2) -> Any:
    """Draw the work-precision diagram of a comparison of integrators, with a panel for each
    problem.

    A method with a run that failed has its mark in a band at the top. Errors in a band at the
    bottom are below the uncertainty of the reference.

    Args:
        scores: The scores.
        columns: The number of panels side by side.

    Returns:
        The Matplotlib figure.
    """
    names = list(dict.fromkeys(score.problem for score in scores))
    columns = min(columns, len(names))
    looks = _looks(scores)
    size = (4.0, 3.4) if columns == 1 else (3.0, 3.0)
    figure, axes = figure_with_axes(len(names), columns, size, 0.2 * math.ceil(len(looks) / 2))
    for place, (axis, name) in enumerate(zip(axes, names, strict=True)):
        _draw_panel(axis, [score for score in scores if score.problem == name], looks)
        label = "run time, warm [s]" if place + columns >= len(names) else ""  # nothing below it
        axis.set(title=name, xlabel=label)
        if place % columns == 0:
            axis.set_ylabel("{} [{}]".format(*_ERRORS[scores[0].error_of]))
    marks = [axes[0].plot([], [], label=method, **look)[0] for method, look in looks.items()]
    figure.legend(handles=marks, loc="outside lower center", ncols=2)
    return figure


def _looks(scores: Sequence[Score]) -> dict[str, dict[str, Any]]:
    """Return the style of each integrator's curve in the diagram, in the order of the curves from
    left to right.

    Users' own methods get their styles in the order of the scores, regardless of their times.
    """
    fastest: dict[str, float] = {}
    for score in scores:
        fastest[score.method] = min(fastest.get(score.method, math.inf), score.seconds or math.inf)
    own = (method for method in fastest if method not in _LOOKS)
    dealt = _LOOKS | dict(zip(own, cycle(_OWN_LOOKS), strict=False))
    looks = {}
    for method in sorted(fastest, key=fastest.__getitem__):
        colour, mark, line = dealt[method]
        face = colour if "-" in line else "white"
        looks[method] = {
            "color": colour,
            "marker": mark,
            "ls": line,
            "mfc": face,
            "lw": 1.0 if method in _LOOKS else 1.8,
        }
    return looks


def _draw_panel(axis: Any, scores: Sequence[Score], looks: dict[str, dict[str, Any]]) -> None:
    """Draw the errors and run times of integrators on one problem, with a curve for each method."""
    errors = [
        max(score.error, _MIN_SHOWN_ERROR) for score in scores if score.error is not None
    ] or [1.0]
    bottom, top = min(errors) / 10, max(errors) * 10
    axis.set(xscale="log", yscale="log")
    for method, look in looks.items():
        of_method = [score for score in scores if score.method == method]
        reached = [score for score in of_method if score.error is not None and score.seconds]
        times = [score.seconds for score in reached]
        axis.plot(times, [max(score.error or 0.0, _MIN_SHOWN_ERROR) for score in reached], **look)
    failed = dict.fromkeys(
        s.method for s in scores if s.error is None and s.preparation is not None
    )
    for place, method in enumerate(failed):
        at = {"transform": axis.get_yaxis_transform(), "ls": "none"}
        axis.plot(0.97 - 0.05 * place, 3 * top, **looks[method] | at)
    axis.set_ylim(bottom, 10 * top if failed else top)
    uncertainty = max(score.truth_uncertainty for score in scores)
    bands = {"failed": (top, 10 * top), "reference": (bottom, uncertainty)}
    for label, (low, high) in bands.items():
        if low < min(high, axis.get_ylim()[1]):
            axis.axhspan(low, high, color=GREY, alpha=0.4, lw=0)
            axis.text(0.02, low, label, transform=axis.get_yaxis_transform(), fontsize=7.5)


def _brief_methods() -> list[Method]:
    """Return the integrators that the report compares: ours, SciPy's strongest and compiled peers,
    at fast settings.
    """
    chosen = [method for method in BENCH_METHODS if method.name in _METHODS]
    with suppress(InputError):
        chosen += [method for method in peer_methods() if method.family == "numbalsoda"]
    return [
        replace(method, settings=_METHODS.get(method.name) or method.settings) for method in chosen
    ]


@partial(
    Exhibit,
    name="race",
    title="Run time against error",
    alt_text="Two panels with logarithmic axes, error against run time: the Taylor engine's "
    "points lie left of the "
    "compiled peers', and far left of SciPy's, at the same error.",
    runs_alone=True,
    packages=("numbalsoda",),
)
def race_exhibit(audit: Audit, examined: Sequence[str]) -> Drawing:
    """Run the report's comparison of integrators and draw it."""
    scores = run_race([problem_named(name) for name in _PROBLEMS], _brief_methods())
    return Drawing(
        figure=lambda columns: draw_race(scores, columns),
        columns=2,
        caption=_compared(scores),
        data={"race.csv": race_csv(scores)},
        facts={"raced_on": machine_facts()},
    )


def race_csv(scores: Sequence[Score]) -> CSV:
    """Return all measured numbers of a comparison of integrators as the header and rows of a CSV
    table.
    """
    rows = [score.to_dict() for score in scores]
    _, unit = _ERRORS[scores[0].error_of]
    units = _UNITS | {"error": unit, "truth_uncertainty": unit}
    header = [
        f"{name.replace('_', ' ')} [{units[name]}]" if name in units else name for name in rows[0]
    ]
    return header, [list(row.values()) for row in rows]


def _compared(scores: Sequence[Score]) -> str:
    """Return a sentence that compares run times with the Taylor engine's: those of the fastest
    compiled peer and of SciPy.
    """
    comparisons = []
    rows = [
        row
        for row in run_time_ratios(scores)
        if row["error_at_most"] == 1e-6 and row["heyoka_seconds"]
    ]
    for group, subject in (
        ("peer", "the fastest compiled peer"),
        ("scipy", "SciPy's fastest, called from Python,"),
    ):
        times = [
            f"{float(format(row[group + '_over_heyoka'], '.2g')):g} times on the {row['problem']}"
            for row in rows
            if row[group]
        ]
        if times:
            comparisons.append(f"{subject} takes " + " and ".join(times))
    missing = (
        ""
        if any(score.family == "numbalsoda" for score in scores)
        else (" No compiled peer is installed here; the extra `peers` brings numbalsoda.")
    )
    return (
        f"To an error of 1e-6, as a multiple of the Taylor engine's time, {'; '.join(comparisons)}."
        f"{missing} Methods that failed have their marks in a grey band at the top. A grey band at "
        "the bottom is the uncertainty of the reference."
    )
