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
)
from tippedisk_verify.commands.quantities import quantities_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tippedisk_verify.model.measured import Measured
    from tippedisk_verify.orbits.atlas import Atlas
    from tippedisk_verify.orbits.disk_plane import DiskAtlas
    from tippedisk_verify.orbits.slices import Slice

__all__ = ["COMMANDS"]


@quantities_of("omega", "gamma_bar_0", "v_0", "period")
@click.command()
@click.option("--plane", default="A,Omega", show_default=True, metavar="NAME,Omega|NAME,NAME", help="The two axes.")
@click.option(
    "--range",
    "ranges",
    nargs=2,
    multiple=True,
    metavar="LOW HIGH",
    help="Of the parameter, and again of a second one; a tenth to both sides if not given.",
)
@click.option("--points", type=int, default=200, show_default=True, metavar="N", help="Points of each curve.")
@click.option("--jobs", type=int, metavar="N", help="Processes; as many as there are cores if not given.")
@click.option("--out", metavar="DIR", help="Write figure, CSV and JSON there.")
@common_options
def atlas(
    common: Common, plane: str, ranges: tuple[tuple[str, str], ...], points: int, jobs: int | None, out: str | None
) -> int:
    """Hopf, fold and heteroclinic curves in two parameters, their special points, and what is stable where.

    Special points are bautin (where cycles are no longer born stable), neutral-saddle (on Omega_h, where the saddle
    value vanishes: curves of folds end there) and hopf-heteroclinic (where Omega_h = Omega_crit). In a plane of two
    parameters of the disk these are the curves. A limit cycle is here one about inverted spinning, not a rotating one.
    """
    from tippedisk_verify.orbits.atlas import atlas as found_in
    from tippedisk_verify.orbits.atlas import checked_atlas, planes_of
    from tippedisk_verify.orbits.disk_plane import DiskPlane, disk_atlas

    planes = planes_of(common.parameters, plane, ranges)
    for one in planes:
        checked_atlas(one, points, common.digits)
    checked_jobs(jobs)
    folder = alone_in(out)
    with progress(common, 0) as advance, processes(jobs) as pool:
        options: Any = {"points": points, "digits": common.digits, "executor": pool, "advance": advance}
        if len(planes) == 2:
            disks = disk_atlas(DiskPlane(*planes), **options)
            result, lines = _disks_as_json(disks), _disk_lines(disks)
        else:
            found = found_in(planes[0], **options)
            result, lines = _as_json(found), _lines(found, common.digits)
    if folder is not None:
        from tippedisk_verify.figures.atlas import draw_atlas
        from tippedisk_verify.figures.disk_plane import draw_disk_plane
        from tippedisk_verify.figures.style import save

        _write(result, folder)
        save(draw_disk_plane(disks) if len(planes) == 2 else draw_atlas(found), folder, "atlas")
    print_result(common, result, lines)
    return 0


def _as_json(found: Atlas) -> dict[str, Any]:
    from tippedisk_verify.model.measured import Measured, exact_text

    plane = found.plane
    name = plane.name
    return {
        "plane": [name, "Omega"],
        "range": [exact_text(plane.lowest), exact_text(plane.highest)],
        "parameters": plane.parameters.decimals(),
        "curves": [
            {
                "kind": curve.kind,
                "points": [
                    {
                        name: Measured.of(point.value, 0).json(),
                        **{
                            part: getattr(point, part).json()
                            for part in ("omega", "gamma_bar_0", "v_0", "period")
                            if getattr(point, part) is not None
                        },
                    }
                    for point in curve.points
                ],
            }
            for curve in found.curves
        ],
        "points": [
            {"kind": point.kind, name: point.value.json(), "omega": point.omega.json()} for point in found.points
        ],
        "regions": [
            {
                "range": [exact_text(region.lowest), exact_text(region.highest)],
                "curves": list(region.bounds),
                "stable": [cell.stable for cell in region.slices[0].cells],
                "examined": [
                    {name: exact_text(plane.decimal(one.share)), "omegas": [cell.omega for cell in one.cells]}
                    for one in region.slices
                ],
            }
            for region in found.regions
        ],
        "gaps": [
            {"range": [exact_text(gap.lowest), exact_text(gap.highest)], "reason": gap.reason} for gap in found.gaps
        ],
    }


def _disks_as_json(found: DiskAtlas) -> dict[str, Any]:
    from tippedisk_verify.model.measured import exact_text

    planes = (found.plane.first, found.plane.second)
    first, second = (plane.name for plane in planes)
    return {
        "plane": [first, second],
        "range": [[exact_text(plane.lowest), exact_text(plane.highest)] for plane in planes],
        "parameters": planes[0].parameters.decimals(),
        "curves": [
            {
                "kind": curve.kind,
                "points": [
                    {first: point.first.json(), second: point.second.json(), "omega": point.omega.json()}
                    for point in curve.points
                ],
            }
            for curve in found.curves
        ],
        "points": [],
        "disks": [
            {
                first: exact_text(planes[0].decimal(x)),
                second: exact_text(planes[1].decimal(y)),
                "stable": None if one is None else [cell.stable for cell in one.cells],
                "curves": None if one is None else [name for name, _ in one.bounds],
            }
            for x, y, one in found.disks
        ],
        "gaps": [
            {first: exact_text(x), second: exact_text(y), "reason": reason}
            for curve in found.curves
            for x, y, reason in curve.gaps
        ],
    }


def _write(result: dict[str, Any], folder: Path) -> None:
    """``atlas.csv`` with all curves and points, and ``atlas.json``."""
    from tippedisk_verify.files import write_csv, write_text

    names = [name for name in (*result["plane"], "omega") if name != "Omega"]
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


def _disk_lines(found: DiskAtlas) -> Iterator[str]:
    first, second = found.plane.first.name, found.plane.second.name
    for curve in found.curves:
        ends = [f"({float(point.first):.9g}, {float(point.second):.9g})" for point in curve.points]
        where = f" from ({first}, {second}) = {ends[0]} to {ends[-1]}" if ends else ""
        yield f"{curve.kind} curve: {len(ends)} points{where}"
        for x, y, reason in curve.gaps:
            yield f"gap at ({float(x):.9g}, {float(y):.9g}): {reason}"
    kinds = [one and _worded(one) for *_, one in found.disks]
    for kind in dict.fromkeys(kinds):
        yield f"{kinds.count(kind)} of {len(kinds)} disks, stable by rising Omega: {kind or 'not admissible'}"


def _lines(found: Atlas, digits: int) -> Iterator[str]:
    name = found.plane.name
    for curve in found.curves:
        ends = [f"({float(point.value):.9g}, {float(point.omega):.12g})" for point in curve.points]
        where = f" from ({name}, Omega) = {ends[0]} to {ends[-1]}" if ends else ""
        yield f"{curve.kind} curve: {len(ends)} points{where}"
    for point in found.points:
        value, omega = (_short(number, digits) for number in (point.value, point.omega))
        yield f"{point.kind}: {name} = {value}, Omega = {omega} rad/s"
    for region in found.regions:
        stretch = f"{name} from {float(region.lowest):.9g} to {float(region.highest):.9g}"
        yield f"stable by rising Omega, {stretch}: {_worded(region.slices[0])}"
    for gap in found.gaps:
        yield f"gap, {name} from {float(gap.lowest):.9g} to {float(gap.highest):.9g}: {gap.reason}"


def _worded(one: Slice) -> str:
    """What is stable at rising speeds, and the curves between."""
    parts = [one.cells[0].stable]
    for (bound, _), cell in zip(one.bounds, one.cells[1:], strict=True):
        parts += [f"| {bound} |", cell.stable]
    return " ".join(parts)


def _short(number: Measured, digits: int) -> Measured:
    """The same to three digits more than were asked for: closed forms have many."""
    from tippedisk_verify.model.measured import Measured, decimal_magnitude

    value = round(number.value, digits + 3 - decimal_magnitude(number.value))
    return Measured(value, number.uncertainty + abs(number.value - value))


COMMANDS = (atlas,)
