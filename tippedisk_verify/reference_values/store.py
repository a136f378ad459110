"""Reading reference data: the rows of values.csv as numbers, by id. Imports nothing heavy.

Every byte is held against the manifest on the way in, once in a process.
"""

from __future__ import annotations

import csv
import json
import numbers
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from functools import cached_property, lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, NamedTuple

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.measured import Bounded, HalfWidth, Measured
from tippedisk_verify.model.parameters import SYMBOLS
from tippedisk_verify.model.results import Printable, as_json
from tippedisk_verify.reference_values.draws import disk_of
from tippedisk_verify.reference_values.manifest import data_folder, sound_files

__all__ = ["Quantity", "Reading", "Store", "codebook", "definition_of", "quantity_of", "stored", "table_rows"]

Reading = Literal["decimals", "doubles"]


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


@dataclass(frozen=True, slots=True, repr=False)
class Quantity(Printable, Bounded):
    """One reference value with what is known of it.

    It behaves as a number: the value, with its half-width, of one of its two readings. ``reading`` says which, and
    everything goes by it: float(), `measured`, `mpf`, str(), format(), arithmetic and comparisons, NumPy's functions,
    numpy.testing.assert_allclose, pytest.approx.
    """

    id: str  #: ``set/friction/kind/entry/quantity``
    level: int
    kind: str
    set: str
    friction: str
    name: str
    unit: str
    inputs: Mapping[str, str]  #: decimals; with `parameters` all that the value depends on
    values: Mapping[Reading, tuple[str, str]]  #: (value, uncertainty) as decimals, for each reading
    grade: str  #: proved, two-method, agreed, or single
    methods: Mapping[str, str]  #: how far each method's value lies from the one given, in the worse reading
    condition: Mapping[str, str]  #: change of the value per relative change of a parameter or input
    proof: Mapping[str, str] | None = None  #: the enclosure's value and uncertainty, the statement and the command
    reading: Reading = "decimals"  #: which of `values` this is as a number

    def read_from(self, reading: Reading) -> Quantity:
        """The same from the decimals as they stand, or from the doubles nearest to them.

        Raises InputError where there is no value for that reading.
        """
        if reading not in ("decimals", "doubles"):
            raise InputError(f"a value is from decimals or doubles, not from '{reading!s:.40}'")
        if reading not in self.values:
            raise InputError(f"{self.id} has no value from {reading}: doubles cannot tell its inputs apart")
        return self if reading == self.reading else replace(self, reading=reading)

    @property
    def definition(self) -> str:
        """What it is, in a sentence."""
        return definition_of(self.kind, self.name).meaning

    @property
    def parameters(self) -> Mapping[str, str]:
        """The parameters r, e, m, A, B, g, mu and epsilon of its disk, as decimals [SI]."""
        decimals = disk_of(self.set).decimals()
        return MappingProxyType({symbol: decimals[symbol] for symbol in SYMBOLS})

    @property
    def value(self) -> Fraction:
        return Fraction(self.values[self.reading][0])

    @property
    def uncertainty(self) -> Fraction:
        return HalfWidth(self.values[self.reading][1])

    def measured(self, reading: Reading | None = None) -> Measured:
        """Value and half-width alone, from ``reading`` if one is given. Raises InputError as `read_from`."""
        chosen = self if reading is None else self.read_from(reading)
        return Measured(chosen.value, chosen.uncertainty)

    @property
    def for_doubles(self) -> float:
        """What a program in doubles should say: the double nearest to the value from doubles.

        It is the one from decimals where doubles cannot tell the inputs apart.
        """
        return float(self.values.get("doubles", self.values["decimals"])[0])

    real = property(float)  # these two are asked of a number by pytest.approx
    imag = 0.0

    def __hash__(self) -> int:
        return hash((self.id, self.reading))

    def __reduce__(self) -> tuple[Any, ...]:
        """For other processes: views of mappings do not travel."""
        values = (getattr(self, item.name) for item in fields(self))
        return Quantity, tuple(dict(value) if isinstance(value, Mapping) else value for value in values)

    def _title(self) -> str:
        return type(self).__name__

    def __str__(self) -> str:
        """The value with its half-width."""
        return " ± ".join(self.values[self.reading])

    def to_dict(self) -> dict[str, Any]:
        value, uncertainty = self.values["decimals"]
        entry: dict[str, Any] = {"id": self.id, "definition": self.definition, "unit": self.unit}
        entry |= {"value": value, "uncertainty": uncertainty}
        if "doubles" in self.values:
            entry["from_doubles"] = dict(zip(("value", "uncertainty"), self.values["doubles"], strict=True))
        names = ("grade", "methods", "condition", "parameters", "inputs", *["proof"] * (self.proof is not None))
        return entry | {name: as_json(getattr(self, name)) for name in names}


numbers.Real.register(Quantity)  # pytest.approx compares what is a number by this name, inside lists too


#: Beside the parameters and the time, in the order of every entry.
_INPUTS = ("Omega", "beta", "gamma", "v", "equilibrium", "form")


class Store(Mapping[str, Quantity]):
    """All reference values, by id, in order of difficulty. Raises InputError for a folder without them, or damaged."""

    def __init__(self, folder: Path) -> None:
        texts = sound_files(folder, ("values.csv", "proofs.json"))
        try:
            proofs, rows = json.loads(texts["proofs.json"]), table_rows(texts["values.csv"])
            self._quantities = {row["id"]: quantity_of(row, proofs) for row in rows}
        except (KeyError, TypeError, AttributeError, ValueError, RecursionError, csv.Error):
            raise InputError(f"the reference data in {folder} are damaged: run reference check") from None
        if not self:
            raise InputError(f"there are no reference values in {folder}")

    @classmethod
    def of(cls, quantities: Iterable[Quantity]) -> Store:
        """These values."""
        store = cls.__new__(cls)
        store._quantities = {quantity.id: quantity for quantity in quantities}
        return store

    def joined(self, other: Store) -> Store:
        """These values and those of another store."""
        return Store.of((*self.values(), *other.values()))

    @cached_property
    def parameters(self) -> dict[str, dict[str, str]]:
        """Of each set's disk, as decimals. Raises InputError for a set that is neither named nor drawn."""
        return {name: disk_of(name).decimals() for name in {quantity.set: 0 for quantity in self.values()}}

    def __getitem__(self, id_: str) -> Quantity:
        return self._quantities[id_]

    def __iter__(self) -> Iterator[str]:
        return iter(self._quantities)

    def __len__(self) -> int:
        return len(self._quantities)

    def matching(self, prefix: str) -> list[Quantity]:
        """Those whose id starts with ``prefix``."""
        return [quantity for id_, quantity in self._quantities.items() if id_.startswith(prefix)]


def table_rows(text: str) -> list[dict[str, str]]:
    """The rows of values.csv by column. Raises ValueError if one is longer or shorter than the header."""
    header, *rows = csv.reader(text.splitlines())
    return [dict(zip(header, row, strict=True)) for row in rows]


def quantity_of(row: Mapping[str, str], proofs: Mapping[str, Any]) -> Quantity:
    """A row of values.csv, and its entry's proof if there is one."""
    entry, name = row["id"].rsplit("/", 1)
    values: dict[Reading, tuple[str, str]] = {
        "decimals": (row["value_from_decimals"], row["uncertainty_from_decimals"])
    }
    if row["value_from_doubles"]:
        values["doubles"] = (row["value_from_doubles"], row["uncertainty_from_doubles"])
    proof = proofs.get(entry, {"enclosures": {}})
    enclosure = proof["enclosures"].get(name)
    plain: dict[str, Any] = {column: row[column] for column in ("id", "kind", "set", "friction", "unit", "grade")}
    plain |= {column: MappingProxyType(_pairs(row[column])) for column in ("methods", "condition")}
    return Quantity(
        **plain,
        level=int(row["level"]),
        name=name,
        inputs=MappingProxyType({column: row[column] for column in _INPUTS if row[column]}),
        values=values,
        proof=enclosure and MappingProxyType(enclosure | {part: proof[part] for part in ("statement", "command")}),
    )


def _pairs(text: str) -> dict[str, str]:
    """``r=0.05 e=-0.004`` by name."""
    return dict(pair.split("=") for pair in text.split())


@lru_cache(maxsize=2)
def stored(folder: Path | None = None) -> Store:
    """The reference data of a folder (the installed ones if None), read once."""
    return Store(folder if folder is not None else data_folder())
