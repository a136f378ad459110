"""The fixtures of these tests: a copy of the data with few values."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from reference_data.make.generation import write_manifest
from tippedisk_verify.reference_values.store import data_folder


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Make a folder with all data files, and the values of Hopf points, equilibria and a state."""
    shutil.copytree(data_folder(), tmp_path / "data", ignore=shutil.ignore_patterns("make"))
    head, *rows = (tmp_path / "data" / "values.csv").read_text().splitlines(keepends=True)
    kept = [
        row for row in rows if any(part in row for part in ("/hopf/", "/equilibrium/", "/rhs/001/"))
    ]
    (tmp_path / "data" / "values.csv").write_text("".join([head, *kept]))
    write_manifest(tmp_path / "data")
    return tmp_path / "data"
