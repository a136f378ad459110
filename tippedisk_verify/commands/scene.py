"""The command `scene`: the panels of the paper's figures one by one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from tippedisk_verify.commands.definition import DiskOptions, disk_command
from tippedisk_verify.commands.options import decimal_callback, lock_output_folder
from tippedisk_verify.errors import InputError
from tippedisk_verify.support.files import write_csv

if TYPE_CHECKING:
    from pathlib import Path

    from tippedisk_verify.motion.scenes import ComputedScene

__all__ = ["COMMANDS"]


@disk_command("Compute the panels a to f of the paper's figures 3D and proj_3D.")
@click.argument("names", nargs=-1, required=True, metavar="NAME...|all")
@click.option("--out", metavar="DIR", help="Write the figures and CSV data there.")
@click.option(
    "--omega-h",
    callback=decimal_callback,
    metavar="X",
    help="Use this Omega_h [rad/s] instead of finding it.",
)
def scene(common: DiskOptions, names: Sequence[str], out: str | None, omega_h: str | None) -> int:
    if common.digits > 12:
        raise InputError(
            f"scenes have at most 12 digits, not {common.digits}: their orbits run in "
            f"double precision"
        )
    from tippedisk_verify.motion.scenes import SCENES, scene_named

    every = [scene.name for scene in SCENES]
    disk, chosen = (
        common.disk,
        every if "all" in names else dict.fromkeys(scene_named(name).name for name in names),
    )
    panels = {}
    with common.progress(len(chosen)) as advance:
        folder = lock_output_folder(out)
        for name in chosen:
            advance(f"scene {name}", 0)
            panels[name] = disk.scene(name, omega_h=omega_h)
            advance(f"scene {name}", 1)
        if folder is not None:
            _write_scenes(list(panels.values()), folder)
    result = {
        "scenes": {name: panel.to_dict() for name, panel in panels.items()},
        "parameters": disk.name,
        "friction": disk.law.name,
    }
    common.show(result, (line for panel in panels.values() for line in _outcome_lines(panel)))
    return 0


def _write_scenes(panels: Sequence[ComputedScene], folder: Path) -> None:
    from tippedisk_verify.figures.scene_figures import draw_scenes_2d, draw_scenes_3d, scene_tables
    from tippedisk_verify.figures.style import save

    save(draw_scenes_3d(panels), folder, "scenes_3d")
    save(draw_scenes_2d(panels), folder, "scenes_2d")
    for panel in panels:
        for name, (header, rows) in scene_tables(panel).items():
            write_csv(folder / name, header, rows)


def _outcome_lines(panel: ComputedScene) -> list[str]:
    """Return lines of text that tell what each orbit of a scene ends on."""
    lines = [f"scene {panel.scene.name}: Omega = {panel.omega} rad/s"]
    for start, orbit in enumerate(panel.orbits, start=1):
        outcome = orbit.outcome
        when = f" at {outcome.time} s" if outcome.time is not None else ""
        lines.append(f"  orbit {start}: {outcome.kind}{when} ({outcome.reason})")
    return lines


COMMANDS = (scene,)
