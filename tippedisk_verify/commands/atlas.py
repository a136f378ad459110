"""The command `atlas`: the plane of one parameter and the speed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tippedisk_verify.commands.common import (
    Common,
    alone_in,
    checked_jobs,
    common_options,
    print_result,
    processes,
    progress,
    quantities_of,
)
from tippedisk_verify.model.decimals import exact_text
from tippedisk_verify.model.results import as_json
from tippedisk_verify.reference_values.entries import trimmed

if TYPE_CHECKING:
    from collections.abc import Iterator
    from fractions import Fraction

    from tippedisk_verify.atlas.connection_curve import SpecialPoint
    from tippedisk_verify.atlas.plane import Atlas, CurvePoint

__all__ = ["COMMANDS"]


@quantities_of("omega", "gamma_bar_0", "v_0", "period")
@click.command()
@click.option("--plane", "axes", default="A,Omega", show_default=True, metavar="NAME,Omega", help="The two axes.")
@click.option(
    "--range",
    "ends",
    type=(str, str),
    metavar="LOW HIGH",
    help="Of the parameter; a tenth to both sides if not given.",
)
@click.option("--points", type=int, default=200, show_default=True, metavar="N", help="Points of each curve.")
@click.option("--jobs", type=int, metavar="N", help="Processes; as many as there are cores if not given.")
@click.option("--out", metavar="DIR", help="Write figure, CSV and JSON there.")
@common_options
def atlas(
    common: Common, axes: str, ends: tuple[str, str] | None, points: int, jobs: int | None, out: str | None
) -> int:
    """Hopf, fold and heteroclinic curves against one parameter, and their special points.

    Special points are bautin (where cycles are no longer born stable), neutral-saddle (on Omega_h, where the saddle
    value vanishes: curves of folds end there) and hopf-heteroclinic (where Omega_h = Omega_crit). A limit cycle is
    here one about inverted spinning, not a rotating one.
    """
    from tippedisk_verify.atlas.plane import atlas as found_in
    from tippedisk_verify.atlas.plane import checked_atlas, plane_of

    plane = plane_of(common.parameters, axes, ends)
    checked_atlas(plane, points, common.digits)
    checked_jobs(jobs)
    folder = alone_in(out)
    with progress(common, 0) as advance, processes(jobs) as pool:
        found = found_in(plane, points=points, digits=common.digits, executor=pool, advance=advance)
    result = _as_json(found)
    if folder is not None:
        from tippedisk_verify.figures.atlas import draw_atlas
        from tippedisk_verify.figures.style import save

        _write(result, folder)
        save(draw_atlas(found), folder, "atlas")
    print_result(common, result, _lines(found, common.digits))
    return 0


def _as_json(found: Atlas) -> dict[str, Any]:
    plane = found.plane
    name = plane.name

    def told(point: CurvePoint | SpecialPoint) -> dict[str, Any]:
        entries = vars(point).items()
        return {name if key == "value" else key: as_json(entry) for key, entry in entries if entry is not None}

    return {
        "plane": [name, "Omega"],
        "range": [exact_text(plane.lowest), exact_text(plane.highest)],
        "parameters": plane.parameters.decimals(),
        "curves": [{"kind": curve.kind, "points": [told(point) for point in curve.points]} for curve in found.curves],
        "points": [told(point) for point in found.points],
        "missing": [
            {
                "kind": kind,
                "count": len(values),
                "range": [exact_text(values[0]), exact_text(values[-1])],
                "reason": reason,
            }
            for kind, values, reason in _missing(found)
        ],
    }


def _missing(found: Atlas) -> Iterator[tuple[str, list[Fraction], str]]:
    """What was looked for in vain, by kind: at which values of the parameter, and why at the first of them."""
    for kind in dict.fromkeys(one.kind for one in found.missing):
        mine = [one for one in found.missing if one.kind == kind]
        yield kind, [one.value for one in mine], mine[0].reason


def _write(result: dict[str, Any], folder: Path) -> None:
    """``atlas.csv`` with all curves and points, and ``atlas.json``."""
    from tippedisk_verify.files import write_csv, write_text

    names = [result["plane"][0], "omega"]
    listed: list[tuple[str, object, Any]] = [
        (curve["kind"], number, point) for number, curve in enumerate(result["curves"]) for point in curve["points"]
    ]
    listed += [(point["kind"], "", point) for point in result["points"]]
    rows = [
        (kind, number, *(part for name in names for part in (point[name]["value"], point[name]["uncertainty"])))
        for kind, number, point in listed
    ]
    header = ["kind", "curve", *(part for name in names for part in (name, f"{name} uncertainty"))]
    write_csv(folder / "atlas.csv", header, rows)
    write_text(folder / "atlas.json", json.dumps(result, indent=1) + "\n")


def _lines(found: Atlas, digits: int) -> Iterator[str]:
    name = found.plane.name
    for curve in found.curves:
        ends = [f"({float(point.value):.9g}, {float(point.omega):.12g})" for point in curve.points]
        where = f" from ({name}, Omega) = {ends[0]} to {ends[-1]}" if ends else ""
        yield f"{curve.kind} curve: {len(ends)} points{where}"
    for point in found.points:
        # Closed forms have many digits more.
        value, omega = (trimmed(number, digits + 3) for number in (point.value, point.omega))
        yield f"{point.kind}: {name} = {value}, Omega = {omega} rad/s"
    for kind, values, reason in _missing(found):
        first, last = (f"{float(value):.9g}" for value in (values[0], values[-1]))
        where = f"{name} = {first}" if len(values) == 1 else f"{len(values)} values of {name} from {first} to {last}"
        yield f"{kind} missing at {where}: {reason}"


COMMANDS = (atlas,)
