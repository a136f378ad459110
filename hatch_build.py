"""What `pip` builds: the package with its reference data, the table of values compressed."""

from __future__ import annotations

import gzip
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class PackedData(BuildHookInterface):
    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Add the data's files, unless the package stays where it is, with its data beside it."""
        if version == "editable":
            return
        data, packed = Path(self.root, "reference_data"), Path(self.directory, "values.csv.gz")
        packed.parent.mkdir(parents=True, exist_ok=True)
        packed.write_bytes(gzip.compress((data / "values.csv").read_bytes(), mtime=0))
        files = {
            path.name: path
            for path in data.iterdir()
            if path.is_file() and path.name != "values.csv"
        }
        for name, path in {**files, packed.name: packed}.items():
            build_data["force_include"][str(path)] = f"tippedisk_verify/reference_data/{name}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        Path(self.directory, "values.csv.gz").unlink(missing_ok=True)
