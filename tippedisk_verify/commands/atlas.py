"""The command `atlas`: the plane of one parameter and the speed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tippedisk_verify.commands.common import Common, alone_in, common_options, print_result, processes, progress
from tippedisk_verify.commands.quantities import quantities_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tippedisk_verify.orbits.atlas import Atlas

__all__ = ["COMMANDS"]


@quantities_of("omega", "gamma_bar_0", "period")
@click.command()
@click.option("--plane", default="A,Omega", show_default=True, metavar="NAME,Omega", help="A parameter, and the speed.")
@click.option(
    "--range", "ends", nargs=2, metavar="LOW HIGH", help="Of the parameter; a tenth to both sides if not given."
)
@click.option("--points", type=int, default=200, show_default=True, metavar="N", help="Points of each curve.")
@click.option("--jobs", type=int, metavar="N", help="Processes; as many as there are cores if not given.")
@click.option("--out", metavar="DIR", help="Write figure, CSV and JSON there.")
@common_options
def atlas(
    common: Common, plane: str, ends: tuple[str, str] | None, points: int, jobs: int | None, out: str | None
) -> int:
    """Hopf, fold and heteroclinic curves in two parameters, their special points, and what is stable where.

    Special points are bautin (where cycles are no longer born stable), neutral-saddle (on Omega_h, where the saddle
    value vanishes: curves of folds end there) and hopf-heteroclinic (where Omega_h = Omega_crit).
    """
    from tippedisk_verify.orbits.atlas import atlas as found_in
    from tippedisk_verify.orbits.atlas import plane_of

    chosen = plane_of(common.parameters, plane, ends)
    folder = alone_in(out)
    with progress(common, 0) as advance, processes(jobs) as pool:
        found = found_in(chosen, points=points, digits=common.digits, executor=pool, advance=advance)
    result = _as_json(found)
    if folder is not None:
        _write(found, result, folder)
    print_result(common, result, _lines(found))
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
                            for part in ("omega", "gamma_bar_0", "period")
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


def _write(found: Atlas, result: dict[str, Any], folder: Path) -> None:
    """``atlas.png``, ``atlas.svg``, ``atlas.csv`` with all curves and points, and ``atlas.json``."""
    from tippedisk_verify.figures.atlas import draw_atlas
    from tippedisk_verify.figures.style import save
    from tippedisk_verify.files import write_csv, write_text
    from tippedisk_verify.model.measured import Measured

    name = found.plane.name
    rows: list[tuple[object, ...]] = [
        (curve.kind, number, *Measured.of(point.value, 0).decimals(), *point.omega.decimals())
        for number, curve in enumerate(found.curves)
        for point in curve.points
    ]
    rows += [(point.kind, "", *point.value.decimals(), *point.omega.decimals()) for point in found.points]
    header = ("kind", "curve", name, f"{name} uncertainty", "omega [rad/s]", "omega uncertainty [rad/s]")
    write_csv(folder / "atlas.csv", header, rows)
    write_text(folder / "atlas.json", json.dumps(result, indent=1) + "\n")
    save(draw_atlas(found), folder, "atlas")


def _lines(found: Atlas) -> Iterator[str]:
    name = found.plane.name
    for curve in found.curves:
        ends = [f"({float(point.value):.9g}, {float(point.omega):.12g})" for point in curve.points]
        where = f" from ({name}, Omega) = {ends[0]} to {ends[-1]}" if ends else ""
        yield f"{curve.kind} curve: {len(ends)} points{where}"
    for point in found.points:
        yield f"{point.kind}: {name} = {point.value}, Omega = {point.omega} rad/s"
    for region in found.regions:
        parts = [region.slices[0].cells[0].stable]
        for bound, cell in zip(region.bounds, region.slices[0].cells[1:], strict=True):
            parts += [f"| {bound} |", cell.stable]
        yield (
            f"stable by rising Omega, {name} from {float(region.lowest):.9g} to {float(region.highest):.9g}: "
            + " ".join(parts)
        )
    for gap in found.gaps:
        yield f"gap, {name} from {float(gap.lowest):.9g} to {float(gap.highest):.9g}: {gap.reason}"


COMMANDS = (atlas,)
