"""Reading reference data: where they lie, and what an entry says. Imports nothing heavy.

Every byte is held against the manifest on the way in, once in a process.
"""

from __future__ import annotations

import json
import numbers
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.measured import Bounded, Measured
from tippedisk_verify.model.results import Printable, as_json
from tippedisk_verify.reference_values.manifest import sound_files

__all__ = ["Quantity", "Reading", "Store", "data_folder", "stored"]

Reading = Literal["decimals", "doubles"]


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
    inputs: Mapping[str, str]  #: beside the parameters; decimals
    values: Mapping[Reading, tuple[str, str]]  #: (value, uncertainty) as decimals, for each reading
    grade: str  #: proved, two-method, agreed, or single
    methods: Mapping[str, str]  #: how far each road's value lies from the one given
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
    def value(self) -> Fraction:
        return Fraction(self.values[self.reading][0])

    @property
    def uncertainty(self) -> Fraction:
        return Fraction(self.values[self.reading][1])

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

    def __str__(self) -> str:
        """The value with its half-width."""
        return " ± ".join(self.values[self.reading])

    def to_dict(self) -> dict[str, Any]:
        value, uncertainty = self.values["decimals"]
        entry: dict[str, Any] = {"id": self.id, "unit": self.unit, "value": value, "uncertainty": uncertainty}
        if "doubles" in self.values:
            entry["from_doubles"] = dict(zip(("value", "uncertainty"), self.values["doubles"], strict=True))
        names = ("grade", "methods", "condition", "inputs", *["proof"] * (self.proof is not None))
        return entry | {name: as_json(getattr(self, name)) for name in names}


numbers.Real.register(Quantity)  # pytest.approx compares what is a number by this name, inside lists too


class Store(Mapping[str, Quantity]):
    """All reference values, by id, in order of difficulty. Raises InputError for a folder without them, or damaged."""

    def __init__(self, folder: Path) -> None:
        documents = []
        for name, text in sound_files(folder).items():
            try:
                documents.append(json.loads(text))
            except (ValueError, RecursionError):
                raise InputError(f"reference file {folder / name} cannot be read: run reference check") from None
        if not documents:
            raise InputError(f"no reference data in {folder}")
        try:
            documents.sort(key=lambda document: (document["level"], document["set"] != "printed"))
            self._fill(documents)
        except (KeyError, TypeError, AttributeError, ValueError):
            raise InputError(f"the reference data in {folder} are damaged: run reference check") from None

    @classmethod
    def of(cls, documents: Iterable[dict[str, Any]]) -> Store:
        """What documents of the files' form say, in their order."""
        store = cls.__new__(cls)
        store._fill(documents)
        return store

    def joined(self, documents: Iterable[dict[str, Any]]) -> Store:
        """These values and those of more documents."""
        store = self.of(documents)
        store.parameters = self.parameters | store.parameters
        store._quantities = self._quantities | store._quantities
        return store

    def _fill(self, documents: Iterable[dict[str, Any]]) -> None:
        self.parameters: dict[str, dict[str, dict[str, str]]] = {}
        self._quantities: dict[str, Quantity] = {}
        for document in documents:
            self._take(document)

    def _take(self, document: dict[str, Any]) -> None:
        self.parameters[document["set"]] = document["parameters"]
        for entry in document["entries"]:
            for name, told in entry["quantities"].items():
                values: dict[Reading, tuple[str, str]] = {"decimals": (told["value"], told["uncertainty"])}
                if "from_doubles" in told:
                    values["doubles"] = (told["from_doubles"]["value"], told["from_doubles"]["uncertainty"])
                id_ = f"{entry['id']}/{name}"
                self._quantities[id_] = Quantity(
                    id=id_,
                    level=document["level"],
                    kind=document["kind"],
                    set=document["set"],
                    friction=entry["id"].split("/")[1],
                    name=name,
                    unit=told["unit"],
                    inputs=MappingProxyType(entry["inputs"]),
                    values=values,
                    grade=told["grade"],
                    methods=MappingProxyType(told["methods"]),
                    condition=MappingProxyType(told["condition"]),
                    proof=MappingProxyType(told["enclosure"] | entry["proof"]) if "enclosure" in told else None,
                )

    def __getitem__(self, id_: str) -> Quantity:
        return self._quantities[id_]

    def __iter__(self) -> Iterator[str]:
        return iter(self._quantities)

    def __len__(self) -> int:
        return len(self._quantities)

    def matching(self, prefix: str) -> list[Quantity]:
        """Those whose id starts with ``prefix``."""
        return [quantity for id_, quantity in self._quantities.items() if id_.startswith(prefix)]


def data_folder() -> Path:
    """Where the reference data lie: inside the installed package, or beside it in a source checkout.

    Raises InputError if they are in neither place.
    """
    package = Path(__file__).resolve().parent.parent
    for folder in (package / "reference_data", package.parent / "reference_data"):
        if (folder / "schema.json").is_file():
            return folder
    raise InputError("the reference data are not installed with this package: reinstall it, or give their folder")


@lru_cache(maxsize=2)
def stored(folder: Path | None = None) -> Store:
    """The reference data of a folder (the installed ones if None), read once."""
    return Store(folder if folder is not None else data_folder())
