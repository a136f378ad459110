"""The work-precision diagram of run time and error, with one panel for each problem."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import cycle
from typing import Any

from tippedisk_verify.audit.claims import Audit
from tippedisk_verify.bench.methods import METHODS, Method
from tippedisk_verify.bench.own import OWN
from tippedisk_verify.bench.peers import peer_methods
from tippedisk_verify.bench.problems import problem_named
from tippedisk_verify.bench.race import Score, machine, raced, ratios
from tippedisk_verify.errors import InputError
from tippedisk_verify.figures.exhibit import CSV, Drawing, Exhibit
from tippedisk_verify.figures.style import BLACK, BLUE, GREEN, ORANGE, PURPLE, RED, grid

__all__ = ["draw_bench", "race", "race_csv"]

#: Colour and line by family. Each method has its own mark, so no reader needs the colours.
_FAMILIES = {
    "heyoka": (BLUE, "-"),
    "bare": (BLACK, "none"),
    "half-widths": (RED, ":"),
    "numbalsoda": (GREEN, "-"),
    "cvode": (PURPLE, "-."),
    "diffrax": (PURPLE, ":"),
    "scipy": (ORANGE, "--"),
}
_OWN_COLOURS = (GREEN, PURPLE, RED, ORANGE)  # of a user's integrators
_MARKS = "os^Dv<>PXphd*8H12+"
_UNITS = dict.fromkeys(("error", "error_over_samples", "truth_uncertainty"), "rad or rad/s") | {
    "seconds": "s",
    "spread": "1",
    "preparation": "s",
}
_LEAST = 1e-27  # the least error shown; a smaller one is drawn on the lower edge

#: The problems and settings of the report, which take seconds in all. `bench` has all of them.
_PROBLEMS = ("cycle", "passage")
_METHODS: dict[str, tuple[Any, ...]] = {
    "bare heyoka": ("double", "extended"),
    "taylor": (1e-3, 1e-6, 1e-9, 1e-12, 1e-15),
    "with half-widths, digits": (12, 16),
    "scipy DOP853": (1e-4, 1e-6, 1e-8, 1e-9, 1e-11, 1e-13),
    "scipy LSODA": (),
    "scipy Radau": (1e-4, 1e-6),
}


def draw_bench(scores: Sequence[Score], most_columns: int = 4) -> Any:
    """Draw the work-precision diagram; failed and unfinished runs are crosses on the upper edge.

    Args:
        scores: The scores.
        most_columns: The most columns.

    Returns:
        The Matplotlib figure.
    """
    names = list(dict.fromkeys(score.problem for score in scores))
    methods = list(dict.fromkeys((score.method, score.family) for score in scores))
    columns = min(most_columns, len(names))
    legend_columns = max(1, min(4, 2 * columns))
    below = 0.25 * -(-len(methods) // legend_columns)
    figure, axes = grid(len(names), columns, (4.6, 4.0) if columns < 3 else (3.4, 3.6), below)
    shown: dict[str, Any] = {}
    own = dict(
        zip(
            [method for method, family in methods if family == OWN],
            cycle(_OWN_COLOURS),
            strict=False,
        )
    )
    for place, (axis, name) in enumerate(zip(axes, names, strict=True)):
        highest = 10 * (max(score.error or 0.0 for score in scores if score.problem == name) or 1.0)
        for (method, family), mark in zip(methods, cycle(_MARKS), strict=False):
            mine = [score for score in scores if (score.problem, score.method) == (name, method)]
            points = [
                (s.seconds, max(s.error, _LEAST)) for s in mine if s.error is not None and s.seconds
            ]
            colour, line = _FAMILIES.get(family, (own.get(method, BLACK), "-"))
            (shown[method],) = axis.plot(
                [x for x, _ in points],
                [y for _, y in points],
                color=colour,
                marker=mark,
                ls=line,
                lw=1.0,
                label=method,
            )
            slowest = max((x for x, _ in points), default=1.0)
            for score in mine:
                if score.error is None:
                    axis.plot(
                        score.preparation or slowest,
                        highest,
                        "x",
                        color=colour,
                        ms=6,
                        clip_on=False,
                    )
        label = "run time, warm [s]" if place + columns >= len(names) else ""  # nothing below it
        axis.set(xscale="log", yscale="log", title=name, xlabel=label)
        axis.set_ylim(top=highest)
        if place % columns == 0:
            axis.set_ylabel("error [rad or rad/s]")
    figure.legend(shown.values(), shown.keys(), loc="outside lower center", ncols=legend_columns)
    return figure


def _brief_methods() -> list[Method]:
    """Return the report's methods: ours, SciPy's strongest and compiled peers, at fast settings."""
    chosen = [method for method in METHODS if method.name in _METHODS]
    with suppress(InputError):
        chosen += [method for method in peer_methods() if method.family == "numbalsoda"]
    return [
        replace(method, settings=_METHODS.get(method.name) or method.settings) for method in chosen
    ]


@partial(
    Exhibit,
    name="race",
    title="Run time against error",
    alternative="Two panels with logarithmic axes, error against run time: the Taylor engine's "
    "points lie left of the "
    "compiled peers', and far left of SciPy's, at the same error.",
    alone=True,
    packages=("numbalsoda",),
)
def race(audit: Audit, examined: Sequence[str]) -> Drawing:
    """Run the report's comparison and draw it."""
    scores = raced([problem_named(name) for name in _PROBLEMS], _brief_methods())
    return Drawing(
        figure=lambda columns: draw_bench(scores, columns),
        columns=2,
        reading=_compared(scores),
        data={"race.csv": race_csv(scores)},
        facts={"raced_on": machine()},
    )


def race_csv(scores: Sequence[Score]) -> CSV:
    """Return all measured numbers as a table."""
    rows = [score.to_dict() for score in scores]
    header = [
        f"{name.replace('_', ' ')} [{_UNITS[name]}]" if name in _UNITS else name for name in rows[0]
    ]
    return header, [list(row.values()) for row in rows]


def _compared(scores: Sequence[Score]) -> str:
    """Compare the fastest compiled peer's and SciPy's times with the Taylor engine's, in words."""
    comparisons = []
    rows = [row for row in ratios(scores) if row["error_at_most"] == 1e-6 and row["heyoka_seconds"]]
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
    return f"To an error of 1e-6, as a multiple of the Taylor engine's time, {'; '.join(comparisons)}.{missing}"
