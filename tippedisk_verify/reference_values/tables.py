"""The same numbers for those who would rather not read the files by kind: the tables that lie beside a set's files."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tippedisk_verify.files import csv_text
from tippedisk_verify.reference_values.questions import sheet_with_truths
from tippedisk_verify.reference_values.store import Store

__all__ = ["tables"]

_COLUMNS = (
    *("id", "quantity", "unit", "value", "uncertainty", "value_from_doubles", "uncertainty_from_doubles", "grade"),
)


def tables(documents: Sequence[dict[str, Any]]) -> dict[str, str]:
    """What belongs beside a set's files, by name."""
    rows = []
    for document in documents:
        for entry in document["entries"]:
            for name, quantity in entry["quantities"].items():
                doubles = quantity.get("from_doubles", {"value": "", "uncertainty": ""})
                given = (entry["id"], name, quantity["unit"], quantity["value"], quantity["uncertainty"])
                rows.append((*given, doubles["value"], doubles["uncertainty"], quantity["grade"]))
    return {"values.csv": csv_text(_COLUMNS, rows), "sheet_with_truths.csv": sheet_with_truths(Store.of(documents))}
