"""The report as files in a folder. Each is whole or absent."""

from __future__ import annotations

import json
from base64 import b64decode
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tippedisk_verify.files import write_bytes, write_csv, write_text
from tippedisk_verify.report.page import html_page
from tippedisk_verify.report.results import Findings
from tippedisk_verify.report.text import markdown_page

__all__ = ["write_report"]


def write_report(
    folder: Path,
    results: dict[str, Any],
    findings: Findings,
    figures: Sequence[dict[str, Any]],
    formulas: dict[str, Any],
) -> None:
    """Figures and their data first, then the numbers, then the pages that show them."""
    for figure in figures:
        for name, content in figure["files"].items():
            write_bytes(folder / name, b64decode(content))
    write_text(folder / "results.json", json.dumps(results, indent=1, ensure_ascii=False) + "\n")
    sets = results["sets"]
    write_csv(
        folder / "claims.csv",
        ("name", "source", "printed", "verdict", "sets", *sets, "note"),
        [
            (
                claim.name,
                claim.source,
                claim.printed,
                finding.verdict.value,
                " ".join(finding.sets),
                *(str(finding.computed.get(name, "")) for name in sets),
                finding.note,
            )
            for claim, finding in findings
        ],
    )
    write_text(folder / "report.md", markdown_page(results))
    pictures = {figure["entry"]["name"]: figure["embedded"] for figure in figures}
    write_text(folder / "report.html", html_page(results, pictures, formulas))
