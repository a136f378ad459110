"""The same numbers for those who would rather not read the files by kind: tables and lists that lie beside them.

They follow from the files by kind, so that a check can make them again and compare.
"""

from __future__ import annotations

import json
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
    rows, lines = [], []
    for document in documents:
        for entry in document["entries"]:
            for name, quantity in entry["quantities"].items():
                doubles = quantity.get("from_doubles", {"value": "", "uncertainty": ""})
                given = (entry["id"], name, quantity["unit"], quantity["value"], quantity["uncertainty"])
                rows.append((*given, doubles["value"], doubles["uncertainty"], quantity["grade"]))
                lines.append(_line(document, entry, name, quantity))
    return {
        "values.csv": csv_text(_COLUMNS, rows),
        "values.jsonl": "".join(f"{line}\n" for line in lines),
        "sheet_with_truths.csv": sheet_with_truths(Store.of(documents)),
    }


def _line(document: dict[str, Any], entry: dict[str, Any], name: str, quantity: dict[str, Any]) -> str:
    told = {"id": f"{entry['id']}/{name}", "level": document["level"], "inputs": entry["inputs"]}
    told |= {key: quantity[key] for key in ("unit", "value", "uncertainty", "from_doubles", "grade") if key in quantity}
    return json.dumps(told, ensure_ascii=False, separators=(",", ":"))
