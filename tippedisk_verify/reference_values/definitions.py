"""What each quantity is: unit and meaning, as the data's quantities.csv says them."""

from __future__ import annotations

import csv
import re
from functools import lru_cache
from typing import NamedTuple

from tippedisk_verify.reference_values.manifest import data_folder, sound_files

__all__ = ["Definition", "codebook", "definition_of"]


class Definition(NamedTuple):
    level: int  #: of difficulty, from 1
    unit: str
    meaning: str


@lru_cache(maxsize=1)
def codebook() -> dict[str, dict[str, Definition]]:
    """By kind, in order of difficulty, then by name; ``n`` stands for a number in it. Raises InputError if damaged."""
    kinds: dict[str, dict[str, Definition]] = {}
    text = sound_files(data_folder(), ["quantities.csv"])["quantities.csv"]
    for row in csv.DictReader(text.splitlines()):
        told = Definition(int(row["level"]), row["unit"], row["definition"])
        kinds.setdefault(row["kind"], {})[row["quantity"]] = told
    return kinds


def definition_of(kind: str, quantity: str) -> Definition:
    """Of a quantity of that kind, by its name with or without a place."""
    name, of_kind = re.split("[@#]", quantity)[0], codebook()[kind]
    if name in of_kind:
        return of_kind[name]
    number = re.search(r"(?<=_)\d+(?=_|$)", name)
    told = of_kind[name if number is None else f"{name[: number.start()]}n{name[number.end() :]}"]
    if number is None or "^n" not in told.unit:
        return told
    n = int(number[0])
    return told._replace(unit=("rad/s", "rad/m")[n] if n < 2 else f"rad s^{n - 1}/m^{n}")
