"""CSV files of the commands beside `verify`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tippedisk_verify.bench.race import Score
from tippedisk_verify.cycles.limit_cycle import LimitCycle, RotatingCycle
from tippedisk_verify.files import write_csv, write_text
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.motion.basins import OUTCOMES, Basins

__all__ = ["write_basins", "write_bench", "write_branch"]


def write_basins(plane: Basins, folder: Path) -> None:
    """``basins.csv``: every initial state and what it ended on."""
    states = zip(plane.beta.ravel().tolist(), plane.gamma.ravel().tolist(), plane.outcome.ravel().tolist(), strict=True)
    rows = [(beta, gamma, plane.v, OUTCOMES[outcome]) for beta, gamma, outcome in states]
    write_csv(folder / "basins.csv", ("beta [rad]", "gamma [rad]", "v [rad/s]", "ends on"), rows)


def write_branch(cycles: Sequence[LimitCycle | RotatingCycle], path: Path) -> None:
    """The family as CSV: for each number its value and its half-width."""
    names = [name for name, value in vars(cycles[0]).items() if isinstance(value, Measured)]
    header = [part for name in names for part in (name, f"{name} uncertainty")]
    rows = [[*(part for name in names for part in getattr(cycle, name).decimals()), cycle.stable] for cycle in cycles]
    write_csv(path, [*header, "stable"], rows)


def write_bench(folder: Path, scores: Sequence[Score], result: dict[str, Any]) -> None:
    """`bench.json` with everything, `bench.csv` and the figure with the initial-value problems."""
    from tippedisk_verify.figures.race import draw_bench, race_csv
    from tippedisk_verify.figures.style import save

    write_text(folder / "bench.json", json.dumps(result, indent=1) + "\n")
    if scores:
        write_csv(folder / "bench.csv", *race_csv(scores))
        save(draw_bench(scores), folder, "bench")
