"""The reference values in values.csv, by id, and the quantities in quantities.csv. This module
imports nothing heavy.

`quantity_definitions` reads the name, unit and definition of each quantity that is asked.
Every file is compared with its hash in the manifest before it is read, once in a process.
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

from tippedisk_verify.display import Printable, as_json
from tippedisk_verify.errors import InputError
from tippedisk_verify.model.equations import STATE_NAMES
from tippedisk_verify.model.parameters import SYMBOLS
from tippedisk_verify.numbers.exact import is_one_of
from tippedisk_verify.numbers.measured import Bounded, HalfWidth, Measured
from tippedisk_verify.reference_values.drawn_disks import disk_of
from tippedisk_verify.reference_values.manifest import data_folder, verified_texts

__all__ = [
    "OPTIONAL_QUANTITIES",
    "Reading",
    "ReferenceValue",
    "Store",
    "definition_of",
    "is_optional",
    "load_store",
    "optional_ids_of_state",
    "parse_values_csv",
    "quantity_definitions",
    "reference_value_of",
]

Reading = Literal["decimals", "doubles"]  #: inputs exactly as written, or rounded to doubles
#: Quantities of level 1 that a program may answer or leave out. They count nowhere. They are closed
#: forms, so the data have no values of them.
OPTIONAL_QUANTITIES = ("Bbar", "h_1", "h_2", "h_3", "h_4", "h_5")


class Definition(NamedTuple):
    """The level, unit and meaning of a quantity in the reference data."""

    level: int  #: of difficulty, from 1 to 10
    unit: str
    meaning: str


@lru_cache(maxsize=1)
def quantity_definitions() -> dict[str, dict[str, Definition]]:
    """Return the definitions of all quantities, by kind in order of difficulty, then by name.

    In a name, ``n`` stands for a number.

    Raises:
        InputError: If the file is damaged.
    """
    kinds: dict[str, dict[str, Definition]] = {}
    text = verified_texts(data_folder(), ["quantities.csv"])["quantities.csv"]
    for row in csv.DictReader(text.splitlines()):
        definition = Definition(int(row["level"]), row["unit"], row["definition"])
        kinds.setdefault(row["kind"], {})[row["quantity"]] = definition
    return kinds


def definition_of(kind: str, quantity: str) -> Definition:
    """Return the definition of a quantity in the reference data; its name may include a place such
    as ``@0.5``.
    """
    name, of_kind = re.split("[@#]", quantity)[0], quantity_definitions()[kind]
    if name in of_kind:
        return of_kind[name]
    number = re.search(r"(?<=_)\d+(?=_|$)", name)
    generic = name if number is None else f"{name[: number.start()]}n{name[number.end() :]}"
    definition = of_kind[generic]
    if number is None or "^n" not in definition.unit:
        return definition
    n = int(number[0])
    return definition._replace(unit=("rad/s", "rad/m")[n] if n < 2 else f"rad s^{n - 1}/m^{n}")


@dataclass(frozen=True, slots=True, repr=False)
class ReferenceValue(Printable, Bounded):
    """A reference value, with its inputs, half-width and grade.

    It behaves as a number: the value of one of its two readings, with its half-width. ``reading``
    chooses the reading for float(), `measured`, `mpf`, str(), format(), arithmetic, comparisons,
    NumPy's functions, numpy.testing.assert_allclose and pytest.approx.
    """

    id: str  #: ``set/friction/kind/entry/quantity``
    level: int
    kind: str
    set: str
    friction: str
    name: str
    unit: str
    inputs: Mapping[str, str]  #: decimals; the value depends on these and `parameters` only
    values: Mapping[Reading, tuple[str, str]]  #: (value, uncertainty) as decimals, for each reading
    grade: str  #: proved, two-method, agreed, or single
    methods: Mapping[str, str]  #: each method's distance from the value, in the worse reading
    condition: Mapping[str, str]  #: change of the value per relative change of a parameter or input
    #: The proved enclosure's value and uncertainty, the statement and the command.
    proof: Mapping[str, str] | None = None
    reading: Reading = "decimals"  #: the entry of `values` that it stands for as a number

    def read_from(self, reading: Reading) -> ReferenceValue:
        """Return the same reference value in another reading of its inputs.

        Args:
            reading: "decimals" takes the inputs exactly, "doubles" as the doubles nearest to them.

        Raises:
            InputError: If there is no value for that reading.
        """
        if not is_one_of(reading, ("decimals", "doubles")):
            raise InputError(f"a value is from decimals or doubles, not from '{reading!s:.40}'")
        if reading not in self.values:
            raise InputError(
                f"{self.id} has no value from {reading}: doubles cannot tell its inputs apart"
            )
        return self if reading == self.reading else replace(self, reading=reading)

    @property
    def definition(self) -> str:
        """The meaning of the reference value, in a sentence."""
        return definition_of(self.kind, self.name).meaning

    @property
    def parameters(self) -> Mapping[str, str]:
        """The parameters r, e, m, A, B, g, mu and epsilon of the disk to which the reference value
        belongs, as decimals [SI].
        """
        decimals = disk_of(self.set).decimals()
        return MappingProxyType({symbol: decimals[symbol] for symbol in SYMBOLS})

    @property
    def value(self) -> Fraction:
        """The reference value, exactly as its decimal is written."""
        return Fraction(self.values[self.reading][0])

    @property
    def uncertainty(self) -> Fraction:
        """The absolute half-width of the reference value, exactly as its decimal is written."""
        return HalfWidth(self.values[self.reading][1])

    def measured(self, reading: Reading | None = None) -> Measured:
        """Return a reference value and its half-width alone, without its inputs and grade.

        Args:
            reading: The reading; if None, the one that this value stands for.

        Raises:
            InputError: If there is no value for that reading.
        """
        chosen = self if reading is None else self.read_from(reading)
        return Measured(chosen.value, chosen.uncertainty)

    @property
    def for_doubles(self) -> float:
        """The best answer of a program in doubles: the double nearest to the value from doubles.

        If doubles cannot tell the inputs apart, it is the double nearest to the value from
        decimals.
        """
        return float(self.values.get("doubles", self.values["decimals"])[0])

    real = property(float)  #: pytest.approx asks numbers for `real` and `imag`
    imag = 0.0

    def __hash__(self) -> int:
        return hash((self.id, self.reading))

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the mappings as dictionaries, because mapping proxies cannot be pickled."""
        values = (getattr(self, item.name) for item in fields(self))
        return ReferenceValue, tuple(
            dict(value) if isinstance(value, Mapping) else value for value in values
        )

    def _title(self) -> str:
        return type(self).__name__

    def __str__(self) -> str:
        """Return the reference value with its half-width as text."""
        return " ± ".join(self.values[self.reading])

    def to_dict(self) -> dict[str, Any]:
        """Return the reference value as data for JSON, in both readings."""
        value, uncertainty = self.values["decimals"]
        names = ("grade", "methods", "condition", "parameters", "inputs")
        return {
            "id": self.id,
            "definition": self.definition,
            "unit": self.unit,
            "value": value,
            "uncertainty": uncertainty,
            **{
                f"from_{reading}": {"value": number, "uncertainty": width}
                for reading, (number, width) in self.values.items()
                if reading == "doubles"
            },
            **{name: as_json(getattr(self, name)) for name in names},
            **({"proof": as_json(self.proof)} if self.proof is not None else {}),
        }


numbers.Real.register(
    ReferenceValue
)  # so that pytest.approx compares it as a number, inside lists too


# Inputs other than the parameters and the time, in the order of every entry.
_INPUTS = ("Omega", *STATE_NAMES, "equilibrium", "form")


def optional_ids_of_state(id_: str) -> tuple[str, ...]:
    """Return the ids of the optional quantities that may be asked about a state, from the id of the
    state's M; () for other ids.
    """
    return tuple(f"{id_[:-1]}{name}" for name in OPTIONAL_QUANTITIES) if id_.endswith("/M") else ()


def _mass_id(id_: str) -> str:
    """Return the id of M (the mass term) at the state to which an optional quantity belongs."""
    return f"{id_.rsplit('/', 1)[0]}/M"


def is_optional(id_: object) -> bool:
    """Return True if an id is that of an optional quantity."""
    *entry, name = str(id_).split("/")
    return name in OPTIONAL_QUANTITIES and entry[1:3] == ["both", "rhs"]


class Store(Mapping[str, ReferenceValue]):
    """A store of the reference values by id, in order of difficulty.

    Optional quantities are computed when they are looked up; they are not iterated over.

    Args:
        folder: The folder of the reference data.

    Raises:
        InputError: If the folder has no reference data, or they are damaged.
    """

    def __init__(self, folder: Path) -> None:
        texts = verified_texts(folder, ("values.csv", "proofs.json"))
        try:
            proofs, rows = json.loads(texts["proofs.json"]), parse_values_csv(texts["values.csv"])
            self._by_id = {row["id"]: reference_value_of(row, proofs) for row in rows}
            self._optional: dict[str, ReferenceValue] = {}
        except (KeyError, TypeError, AttributeError, ValueError, RecursionError, csv.Error):
            raise InputError(
                f"the reference data in {folder} are damaged: run reference check"
            ) from None
        if not self:
            raise InputError(f"there are no reference values in {folder}")

    @classmethod
    def of(cls, reference_values: Iterable[ReferenceValue]) -> Store:
        """Return a store that holds the given reference values."""
        store = cls.__new__(cls)
        store._by_id = {reference_value.id: reference_value for reference_value in reference_values}
        store._optional = {}
        return store

    def merged_with(self, other: Store) -> Store:
        """Return a store of this store's reference values and those of another one."""
        return Store.of((*self.values(), *other.values()))

    @cached_property
    def parameters(self) -> dict[str, dict[str, str]]:
        """The parameters of the disks in the store, as decimals, by the name of the parameter set.

        Raises:
            InputError: If a set is neither named nor drawn.
        """
        return {
            name: disk_of(name).decimals()
            for name in {reference_value.set: 0 for reference_value in self.values()}
        }

    def __getitem__(self, id_: str) -> ReferenceValue:
        if not is_optional(id_):
            return self._by_id[id_]
        if id_ not in self._optional:
            from tippedisk_verify.reference_values.truths import optional_quantities

            mass = self._by_id[_mass_id(id_)]
            self._optional |= {optional.id: optional for optional in optional_quantities(mass)}
        return self._optional[id_]

    def __contains__(self, id_: object) -> bool:
        """Return True if the store has a reference value or an optional quantity with this id,
        without computing it.
        """
        return (_mass_id(str(id_)) if is_optional(id_) else id_) in self._by_id

    def __iter__(self) -> Iterator[str]:
        return iter(self._by_id)

    def __len__(self) -> int:
        return len(self._by_id)

    def matching(self, prefix: str) -> list[ReferenceValue]:
        """Return the reference values whose id starts with ``prefix``."""
        return [
            reference_value
            for id_, reference_value in self._by_id.items()
            if id_.startswith(prefix)
        ]


def parse_values_csv(text: str) -> list[dict[str, str]]:
    """Return the rows of values.csv, each by column.

    Raises:
        ValueError: If a row is longer or shorter than the header.
    """
    header, *rows = csv.reader(text.splitlines())
    return [dict(zip(header, row, strict=True)) for row in rows]


def reference_value_of(row: Mapping[str, str], proofs: Mapping[str, Any]) -> ReferenceValue:
    """Return the reference value in a row of values.csv.

    Args:
        row: The row, by column.
        proofs: The content of proofs.json.
    """
    entry, name = row["id"].rsplit("/", 1)
    values: dict[Reading, tuple[str, str]] = {
        "decimals": (row["value_from_decimals"], row["uncertainty_from_decimals"])
    }
    if row["value_from_doubles"]:
        values["doubles"] = (row["value_from_doubles"], row["uncertainty_from_doubles"])
    proof = proofs.get(entry, {"enclosures": {}})
    enclosure = proof["enclosures"].get(name)
    plain: dict[str, Any] = {
        column: row[column] for column in ("id", "kind", "set", "friction", "unit", "grade")
    }
    plain |= {column: MappingProxyType(_pairs(row[column])) for column in ("methods", "condition")}
    return ReferenceValue(
        **plain,
        level=int(row["level"]),
        name=name,
        inputs=MappingProxyType({column: row[column] for column in _INPUTS if row[column]}),
        values=values,
        proof=enclosure
        and MappingProxyType(enclosure | {part: proof[part] for part in ("statement", "command")}),
    )


def _pairs(text: str) -> dict[str, str]:
    """Parse a text such as ``r=0.05 e=-0.004`` into a dict."""
    return dict(pair.split("=") for pair in text.split())


@lru_cache(maxsize=1)
def load_store() -> Store:
    """Return the installed reference data, read once in a process."""
    return Store(data_folder())
