"""What a reference entry is: a question (item), the roads that answer it, and the answers with what is known of them.

An item's inputs are decimals. A user may take them as they stand or as the IEEE doubles nearest to them: each is a
*reading*, with its own truth.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, Literal

from tippedisk_verify.errors import Shortfall
from tippedisk_verify.model.exact import exact
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import SYMBOLS, Friction, Parameters
from tippedisk_verify.reference_values.draws import parameters_of

__all__ = [
    "READINGS",
    "Case",
    "Item",
    "Kind",
    "Method",
    "Reading",
    "answered",
    "as_doubles",
    "as_measured",
    "case_of",
    "disagreements",
    "trimmed",
]

Reading = Literal["decimals", "doubles"]
READINGS: tuple[Reading, ...] = ("decimals", "doubles")
Values = dict[str, Measured]
_MOST_DIGITS = 50  # kept of a number; Omega_h keeps more
# What another road must confirm, relative to the number's size, to stand beside the first one.
_CONFIRMED = Fraction(1, 10**30)


@dataclass(frozen=True)
class Item:
    """One question: a state to evaluate at, a cycle to find, ..."""

    id: str  #: ``set/friction/kind/name``
    kind: str
    set: str
    friction: str  #: linear, smooth, or both where the law does not enter
    inputs: Mapping[str, str]  #: numbers as decimals, other inputs as words
    readings: tuple[Reading, ...] = READINGS  #: "doubles" is left out where doubles cannot tell the inputs apart


@dataclass(frozen=True)
class Case:
    """An item in one reading: exact parameters and inputs."""

    item: Item
    parameters: Parameters
    inputs: Mapping[str, Any]  #: exact rationals; words stay words

    @property
    def friction(self) -> Friction:
        """The friction law."""
        return self.parameters.friction


@dataclass(frozen=True)
class Method:
    """One way to the numbers of a kind. The first road of a kind gives the values, the others confirm them."""

    name: str
    says: str  #: what it is, in a sentence
    compute: Callable[[Case, Values], Values]  #: from the case and, for a second road, the values to confirm
    independent: bool = False  #: shares no integrator with the first road (closed form, balance, mpmath, SciPy)


@dataclass(frozen=True)
class Kind:
    """A kind of question."""

    name: str
    level: int  #: of difficulty, from 1
    says: str
    units: Callable[[str], str]  #: the unit of a quantity
    items: Callable[[str], list[Item]]  #: all questions for a parameter set
    roads: tuple[Method, ...]
    condition: Callable[[Case, Values], dict[str, dict[str, Any]]]  #: change of each quantity per relative change
    chunk: int = 1  #: items that are computed together
    digits: int = field(default=_MOST_DIGITS)  #: kept


def as_doubles(parameters: Parameters) -> Parameters:
    """The parameters as the IEEE doubles nearest to them, each rounded once."""
    rounded: dict[str, Any] = {name: Fraction(float(getattr(parameters, name))) for name in SYMBOLS}
    return Parameters(**rounded, name=parameters.name, friction=parameters.friction)


def as_measured(told: Mapping[str, Any]) -> Measured:
    """A number as the files tell it; anything with ``value`` and ``uncertainty``."""
    return Measured(exact(told["value"]).rational, exact(told["uncertainty"]).rational)


def case_of(item: Item, reading: Reading) -> Case:
    """The item's parameters and inputs as that reading takes them."""
    parameters = parameters_of(item.set).with_friction("smooth" if item.friction == "smooth" else "linear")
    if reading == "doubles":
        parameters = as_doubles(parameters)
    inputs: dict[str, Any] = {}
    for name, text in item.inputs.items():
        try:
            number = exact(text).rational
        except ValueError:
            inputs[name] = text
            continue
        inputs[name] = Fraction(float(number)) if reading == "doubles" else number
    return Case(item, parameters, inputs)


def trimmed(measured: Measured, digits: int) -> Measured:
    """The value rounded to ``digits`` significant digits; what the rounding takes away is added to the half-width."""
    size = abs(measured.value)
    places = len(str(size.denominator)) - len(str(size.numerator)) + digits
    return round(measured, places) if size else measured


def disagreements(stored: Values, other: Values) -> list[str]:
    """Quantities whose intervals do not meet, said in a line each."""
    return [
        f"{name}: {stored[name]} and {number} exclude each other"
        for name, number in other.items()
        if name in stored and abs(number.value - stored[name].value) > number.uncertainty + stored[name].uncertainty
    ]


def answered(kind: Kind, item: Item) -> dict[str, Any]:
    """The entry: every quantity by the first road, confirmed by the others, in each reading, as JSON.

    Raises Shortfall if two roads exclude each other.
    """
    by_reading: dict[str, Values] = {}
    distances: dict[str, dict[str, Fraction]] = {}
    confirmed: dict[str, bool] = {}
    condition: dict[str, dict[str, Any]] = {}
    for reading in item.readings:
        case = case_of(item, reading)
        first = kind.roads[0].compute(case, {})
        values = {name: trimmed(value, kind.digits) for name, value in first.items()}
        by_reading[reading] = values
        for road in kind.roads[1:]:
            answers = road.compute(case, first)
            if wrong := disagreements(values, answers):
                raise Shortfall(f"{item.id} by {road.name}: {wrong[0]}")
            for name, other in answers.items():
                away = abs(other.value - values[name].value)
                told = distances.setdefault(name, {})
                told[road.name] = max(told.get(road.name, Fraction(0)), away)
                near = away + other.uncertainty <= _CONFIRMED * max(abs(other.value), Fraction(1, 10**6))
                if reading == "decimals" and road.independent and near:
                    confirmed[name] = True
        if reading == "decimals":
            condition = kind.condition(case, first)
    quantities = {
        name: _quantity(
            kind, name, by_reading, distances.get(name, {}), confirmed.get(name, False), condition.get(name, {})
        )
        for name in by_reading[item.readings[0]]
    }
    entry: dict[str, Any] = {"id": item.id, "inputs": dict(item.inputs)}
    if "doubles" in item.readings:
        numbers = case_of(item, "doubles").inputs
        entry["inputs_as_doubles"] = {
            name: float(value).hex() for name, value in numbers.items() if isinstance(value, Fraction)
        }
    entry["quantities"] = quantities
    return entry


def _quantity(
    kind: Kind,
    name: str,
    by_reading: dict[str, Values],
    distances: dict[str, Fraction],
    confirmed: bool,
    condition: dict[str, Any],
) -> dict[str, Any]:
    value, uncertainty = by_reading["decimals"][name].decimals()
    entry: dict[str, Any] = {"unit": kind.units(name), "value": value, "uncertainty": uncertainty}
    if "doubles" in by_reading:
        entry["from_doubles"] = by_reading["doubles"][name].to_dict()
    entry["grade"] = "two-method" if confirmed else "agreed" if distances else "single"
    entry["methods"] = {kind.roads[0].name: "0"} | {road: _short(away) for road, away in distances.items()}
    entry["condition"] = {symbol: _short(slope) for symbol, slope in condition.items() if slope}
    return entry


def _short(value: Any) -> str:
    """Three significant digits, for what needs no more; exponents beyond a double's too."""
    number = exact(value).rational
    if not number:
        return "0"
    try:
        near = float(number)
    except OverflowError:
        near = 0.0
    if 1e-290 < abs(near) < 1e290:
        return f"{near:.3g}"
    return Measured(number, abs(number) / 100).decimals()[0]


def changed(parameters: Parameters, name: str, factor: Fraction) -> Parameters:
    """The parameters with one of them multiplied."""
    values: dict[str, Any] = {name: getattr(parameters, name) * factor}
    return replace(parameters, **values)
