"""The report as files in a folder, each complete or absent."""

from __future__ import annotations

import json
from base64 import b64decode
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tippedisk_verify.report.audit_pages import html_page, markdown_page
from tippedisk_verify.report.results_json import Findings
from tippedisk_verify.support.files import write_bytes, write_csv, write_text

__all__ = ["write_report"]


def write_report(
    folder: Path,
    results: dict[str, Any],
    findings: Findings,
    figures: Sequence[dict[str, Any]],
    formulas: dict[str, Any],
) -> None:
    """Write the report of an audit: the figures and their data, the numbers, then the pages that
    show them.

    Args:
        folder: The output folder.
        results: The content of results.json.
        findings: The claims with their findings, in the order of ``results["claims"]``.
        figures: The figures, as `figures.exhibit.draw_exhibit` returns them.
        formulas: The formulas, as `draw_formulas` returns them.

    Raises:
        InputError: If a file cannot be written.
    """
    for figure in figures:
        for name, content in figure["files"].items():
            write_bytes(folder / name, b64decode(content))
    write_text(folder / "results.json", json.dumps(results, indent=1, ensure_ascii=False) + "\n")
    texts = (
        "name",
        "source",
        "statement",
        "printed",
        "unit",
        "verdict",
        "class",
        "cause",
        "instead",
        "note",
    )
    rows = [
        [
            *(claim[name] for name in texts),
            *(str(finding.computed.get(name, "")) for name in results["sets"]),
        ]
        for claim, (_, finding) in zip(results["claims"], findings, strict=True)
    ]
    write_csv(
        folder / "claims.csv", (*texts, *(f"computed for {name}" for name in results["sets"])), rows
    )
    write_text(folder / "report.md", markdown_page(results))
    pictures = {figure["entry"]["name"]: figure["embedded"] for figure in figures}
    write_text(folder / "report.html", html_page(results, pictures, formulas))
