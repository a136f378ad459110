"""The same numbers for those who would rather not read the files by kind: tables and lists that lie beside them.

They follow from the files by kind and from `mistakes.json`, so that a check can make them again and compare.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tippedisk_verify.errors import InputError
from tippedisk_verify.files import csv_text, read_text
from tippedisk_verify.reference_values.kinds import KINDS
from tippedisk_verify.reference_values.manifest import LARGEST, MISTAKES, replace_files, sound_files
from tippedisk_verify.reference_values.questions import sheet_with_truths
from tippedisk_verify.reference_values.store import Store

__all__ = ["known_mistakes", "retabulate", "tables"]

_COLUMNS = (
    *("id", "quantity", "unit", "value", "uncertainty", "value_from_doubles", "uncertainty_from_doubles", "grade"),
)
Mistakes = dict[str, list[str]]  # by question, the names of those that it catches


def tables(documents: Sequence[dict[str, Any]], mistakes: Mistakes) -> dict[str, str]:
    """What belongs beside a set's files, by name."""
    rows, lines = [], []
    for document in documents:
        for entry in document["entries"]:
            for name, quantity in entry["quantities"].items():
                doubles = quantity.get("from_doubles", {"value": "", "uncertainty": ""})
                given = (entry["id"], name, quantity["unit"], quantity["value"], quantity["uncertainty"])
                rows.append((*given, doubles["value"], doubles["uncertainty"], quantity["grade"]))
                lines.append(_line(document, entry, name, quantity, mistakes))
    return {
        "values.csv": csv_text(_COLUMNS, rows),
        "values.jsonl": "".join(f"{line}\n" for line in lines),
        "sheet_with_truths.csv": sheet_with_truths(Store.of(documents)),
    }


def _line(
    document: dict[str, Any], entry: dict[str, Any], name: str, quantity: dict[str, Any], mistakes: Mistakes
) -> str:
    id_ = f"{entry['id']}/{name}"
    told = {"id": id_, "level": document["level"], "inputs": entry["inputs"]}
    told |= {key: quantity[key] for key in ("unit", "value", "uncertainty", "from_doubles", "grade") if key in quantity}
    return json.dumps(told | {"catches": mistakes.get(id_, [])}, ensure_ascii=False, separators=(",", ":"))


def retabulate(folder: Path, mistakes: str) -> list[Path]:
    """Write `mistakes.json`, and the tables and the manifest that follow from it; returns what was written."""
    by_set: dict[str, list[dict[str, Any]]] = {}
    rank = {kind.name: place for place, kind in enumerate(KINDS)}
    files = sound_files(folder)
    try:
        documents = [json.loads(text) for text in files.values()]
        for document in sorted(documents, key=lambda document: rank[document["kind"]]):
            by_set.setdefault(document["set"], []).append(document)
        texts = {MISTAKES: mistakes}
        for set_name, here in by_set.items():
            texts |= {f"{set_name}/{name}": text for name, text in tables(here, _read(mistakes)).items()}
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise InputError(f"the reference data in {folder} cannot be read: run reference check") from None
    return replace_files(folder, texts)


def known_mistakes(folder: Path) -> Mistakes:
    """By question, the mistakes that it catches, as the folder's file says, if it has one.

    Raises InputError if that is damaged.
    """
    if not (folder / MISTAKES).exists():
        return {}
    try:
        return _read(read_text(folder / MISTAKES, LARGEST))
    except (ValueError, KeyError, TypeError, AttributeError, IndexError, RecursionError):
        raise InputError(f"{folder / MISTAKES} is damaged: run reference check") from None


def _read(text: str) -> Mistakes:
    told = json.loads(text)
    names = [mistake["name"] for mistake in told["mistakes"]]
    return {id_: [names[number] for number in numbers] for id_, numbers in told["caught"].items()}
