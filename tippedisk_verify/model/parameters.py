"""What is studied: the parameters of a tippedisk, exact and validated, and the friction law.

Three named sets describe the paper's disk: ``table1`` (the paper's Table 1 as it stands; ``printed`` names it as well),
``calibrated`` (inside Table 1's rounding, and reproducing the paper's five printed results) and ``geometry`` (derived
from a disk's dimensions). Others come from a TOML file, each number the decimal that stands there.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field, fields, replace
from decimal import Decimal
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.decimals import exact_text
from tippedisk_verify.model.exact import fraction, quotient, shown
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.precision import Precision
from tippedisk_verify.model.results import Printable

__all__ = [
    "CALIBRATED",
    "GEOMETRY",
    "NAMED_SETS",
    "PRINTED",
    "SYMBOLS",
    "Constants",
    "Friction",
    "Parameters",
    "checked_friction",
]

Friction = Literal["linear", "smooth"]
#: The eight numbers that the equations need, in the order of every list.
SYMBOLS = ("r", "e", "m", "A", "B", "g", "mu", "epsilon")

_LARGEST_FILE = 64_000  # bytes; a file has some hundreds, and nine decimals of the longest kind 36,000
_MOST_DOTS = 200  # in a line; the time and the memory that TOML takes for a dotted key go with their square
_SMALLEST = Fraction(1, 10**30)  # of anything that a disk can be; ratios and products of such fit into doubles


class Constants(NamedTuple):
    """The parameters in one arithmetic, each rounded once from its exact value.

    Only mass ratios enter the acceleration, so ``a``, ``b``, ``k`` and ``traction`` are what the field uses.
    """

    r: Any  #: disk radius [m]
    e: Any  #: eccentricity, distance from geometric centre to centre of gravity [m]
    m: Any  #: mass [kg]
    A: Any  #: moment of inertia about the axis through both centres [kg m^2]
    B: Any  #: moment of inertia about the in-plane axis across it, at the geometric centre [kg m^2]
    Bbar: Any  #: B - m e^2, the same at the centre of gravity [kg m^2]
    g: Any  #: gravity [m/s^2]
    mu: Any  #: friction coefficient [1]
    epsilon: Any  #: smoothing speed of the friction law [m/s]
    a: Any  #: A / m [m^2]
    b: Any  #: Bbar / m [m^2]
    k: Any  #: mu g / epsilon, the linear law's friction per mass and sliding speed [1/s]
    traction: Any  #: mu g, the smooth law's greatest friction per mass [m/s^2]


def _quantity(unit: str, source: str) -> Any:
    return field(metadata={"unit": unit, "source": source})


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Parameters(Printable):
    """One tippedisk and its friction law. All values are exact rationals; give strings, Fractions, Decimals, ints or
    floats.

    Two are equal if their equations are: their eight numbers and their law, whatever their names and C. Raises
    InputError with one line for each fault: not finite, not between 1e-30 and 1e30, e >= r, Bbar <= 0, B > A, A > C
    where there is a C, and an unknown friction law.
    """

    _without_numpy = True

    r: Fraction = _quantity("m", "Table tab:dim_mass, disk radius")
    e: Fraction = _quantity("m", "Table tab:dim_mass, eccentricity")
    m: Fraction = _quantity("kg", "Table tab:dim_mass, mass")
    A: Fraction = _quantity("kg m^2", "Table tab:dim_mass, inertia (1,1) at the geometric centre")
    B: Fraction = _quantity("kg m^2", "Table tab:dim_mass, inertia (2,2) at the geometric centre")
    g: Fraction = _quantity("m/s^2", "assumed: the paper gives no value")
    mu: Fraction = _quantity("1", "text below Eq. lin_lambda_y_3DOF, friction coefficient")
    epsilon: Fraction = _quantity("m/s", "text below Eq. lin_lambda_y_3DOF, smoothing parameter")
    C: Fraction | None = field(
        default=None,
        metadata={"unit": "kg m^2", "source": "Table tab:dim_mass, inertia (3,3); enters no equation here"},
    )
    name: str = "custom"
    friction: Friction = "linear"  #: Eq. lin_lambda_y_3DOF, or the smooth Coulomb law that it linearises
    _constants: dict[Precision, Constants] = field(default_factory=dict, init=False, repr=False, compare=False)

    def _given(self) -> dict[str, Any]:
        """The fields without what was computed from them."""
        return {item.name: getattr(self, item.name) for item in fields(self) if item.init}

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(type(self), **self._given()), ()

    def _equations(self) -> tuple[object, ...]:
        return (*(getattr(self, name) for name in SYMBOLS), self.friction)

    def __eq__(self, other: object) -> bool:
        return self._equations() == other._equations() if isinstance(other, Parameters) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._equations())

    def __post_init__(self) -> None:
        faults = []
        for item in fields(self):
            value = getattr(self, item.name)
            if item.name not in _QUANTITIES or (item.name == "C" and value is None):
                continue
            try:
                number = fraction(value)
            except InputError as fault:
                faults.append(f"parameter {item.name}: {fault}")
                continue
            if number <= 0:
                faults.append(f"parameter {item.name} must be positive, not {shown(value)}")
            elif not _SMALLEST <= number <= 1 / _SMALLEST:
                faults.append(f"parameter {item.name} must lie between 1e-30 and 1e30 in SI units, not {shown(value)}")
            object.__setattr__(self, item.name, number)
        checked_friction(self.friction)
        if not faults:
            faults = self._inconsistencies()
        if faults:
            raise InputError(faults)

    def _inconsistencies(self) -> list[str]:
        faults = []
        if self.e >= self.r:
            faults.append("the eccentricity e must be smaller than the radius r")
        if self.Bbar <= 0:
            faults.append("Bbar = B - m e^2 must be positive: B is too small for this m and e")
        if self.B > self.A:
            faults.append("B must not exceed A, the inertia about the axis through both centres")
        if self.C is not None and self.A > self.C:
            faults.append("A must not exceed C, the moment about the disk's normal")
        return faults

    @property
    def Bbar(self) -> Fraction:
        """B - m e^2 [kg m^2]: moment of inertia (2,2) at the centre of gravity. Source: below Table tab:dim_mass."""
        return self.B - self.m * self.e**2

    def at(self, precision: Precision) -> Constants:
        """These parameters in ``precision``, rounded once each from exact values; computed once and kept."""
        constants = self._constants.get(precision)
        if constants is None:
            constants = self._constants[precision] = Constants(*(precision.number(value) for value in self._exact()))
        return constants

    def rational(self) -> Constants:
        """These parameters as exact rationals."""
        return Constants(*self._exact())

    def within(self, ctx: Any) -> Constants:
        """These parameters in an mpmath context."""
        return Constants(*(quotient(ctx, value) for value in self._exact()))

    def _exact(self) -> tuple[Fraction, ...]:
        traction = self.mu * self.g
        return (
            *(self.r, self.e, self.m, self.A, self.B, self.Bbar, self.g, self.mu, self.epsilon),
            *(self.A / self.m, self.Bbar / self.m, traction / self.epsilon, traction),
        )

    def changed(self, **values: object) -> Parameters:
        """A copy with some fields replaced (validated again), named ``custom`` unless named."""
        return replace(self, **{"name": "custom", **values})  # type: ignore[arg-type]

    def with_friction(self, friction: Friction) -> Parameters:
        """The same disk, with the same name, under this friction law."""
        return self if friction == self.friction else replace(self, friction=friction)

    def refuse_smooth(self, what: str) -> None:
        """Raise InputError under the smooth law: ``what``, such as 'harmonic balance is', begins the sentence."""
        if self.friction == "smooth":
            raise InputError(f"{what} for the linear friction law only, not for the smooth one")

    def decimals(self) -> dict[str, str]:
        """Each of the numbers as an exact decimal string (fifty digits where the decimal repeats)."""
        return {
            item.name: Measured(getattr(self, item.name), Fraction(0)).decimals()[0]
            for item in fields(self)
            if item.name in _QUANTITIES and getattr(self, item.name) is not None
        }

    def to_dict(self) -> dict[str, Any]:
        return {**self.decimals(), "name": self.name, "friction": self.friction}

    def _title(self) -> str:
        return f"{type(self).__name__} {self.name} ({self.friction})"

    @property
    def law(self) -> str:
        """The friction law's name in a sentence."""
        return "linear" if self.friction == "linear" else "smooth Coulomb"

    def definition(self) -> str:
        """The eight numbers that the equations need, exactly, with their units: which disk a statement is about."""
        return ", ".join(
            f"{item.name} = {exact_text(getattr(self, item.name))} {item.metadata['unit']}".removesuffix(" 1")
            for item in fields(self)
            if item.name in Constants._fields
        )

    @classmethod
    def named(cls, name_or_path: str) -> Parameters:
        """A named set, or the set in a TOML file (any name with a dot or a path separator).

        Raises InputError if there is no such set, or with what `from_toml` finds.
        """
        name = _ALIASES.get(name_or_path, name_or_path)
        if name in NAMED_SETS:
            return NAMED_SETS[name]
        if "." in name_or_path or "/" in name_or_path or "\\" in name_or_path:
            return cls.from_toml(Path(name_or_path))
        raise InputError(
            f"parameter set '{name_or_path[:60]}' is not known: use {', '.join(NAMED_SETS)} or a .toml file"
        )

    @classmethod
    def from_toml(cls, path: Path) -> Parameters:
        """Parameters from a file with the keys r, e, m, A, B, g, mu, epsilon and optionally C.

        A number is exactly the decimal that stands there, quoted or not; a ratio such as "1/3" needs the quotes.
        Raises InputError if the file cannot be read, is not TOML, lacks a key or has an unknown one, or holds values
        that `Parameters` refuses.
        """
        entries = _toml_entries(path)
        allowed = ", ".join(_QUANTITIES)
        faults = [f"unknown key '{key[:40]}' (allowed: {allowed})" for key in entries if key not in _QUANTITIES]
        faults += [f"key '{key}' is missing" for key in _QUANTITIES if key != "C" and key not in entries]
        if faults:
            raise InputError(f"parameter file {path.name}: {'; '.join(faults)}")
        try:
            return cls(**entries, name=_file_name(path))
        except InputError as fault:
            raise InputError(f"parameter file {path.name}: {line}" for line in fault.faults) from None


#: The names of the numbers: the eight that the equations need, and C.
_QUANTITIES = tuple(item.name for item in fields(Parameters) if item.metadata)


def checked_friction(friction: str) -> Friction:
    """The friction law of that name. Raises InputError if there is none."""
    if friction not in get_args(Friction):
        raise InputError(f"friction law '{shown(friction)}' is not known: use linear or smooth")
    return friction  # type: ignore[return-value]


def _file_name(path: Path) -> str:
    """The file's name, as `Parameters.named` takes it from its folder, and unlike any named set's."""
    name = path.name.encode(errors="replace").decode()
    return name if "." in name else f"./{name}"


def _toml_entries(path: Path) -> dict[str, Any]:
    try:
        if path.exists() and not path.is_file():
            raise OSError("it is not a file")
        with open(path, "rb") as stream:
            content = stream.read(_LARGEST_FILE + 1)
    except (OSError, ValueError) as fault:  # the latter for a name with a null character
        raise InputError(f"parameter file {path} cannot be read: {getattr(fault, 'strerror', None) or fault}") from None
    if len(content) > _LARGEST_FILE:
        raise InputError(f"parameter file {path} is larger than {_LARGEST_FILE} bytes")
    if any(line.count(b".") > _MOST_DOTS for line in content.split(b"\n")):
        raise InputError(f"parameter file {path} has a line with more than {_MOST_DOTS} dots: it is no such file")
    try:
        entries = tomllib.loads(content.decode("utf-8-sig"), parse_float=Decimal)
    except (ValueError, RecursionError) as fault:
        reason = str(fault).splitlines()[0][:120]
        raise InputError(f"parameter file {path.name} is not a TOML text file: {reason}") from None
    if not entries:
        raise InputError(f"parameter file {path.name} is empty: it needs the keys r, e, m, A, B, g, mu, epsilon")
    return entries


_F = Fraction
_COMMON: dict[str, Any] = {"g": _F("9.81"), "mu": _F("0.3"), "epsilon": _F("0.1")}
_DISK: dict[str, Any] = {"r": _F("0.045"), "e": _F("2.5e-3"), "m": _F("0.435"), **_COMMON}

#: Table 1 of the paper as it stands.
PRINTED = Parameters(**_DISK, A=_F("0.249e-3"), B=_F("0.227e-3"), C=_F("0.468e-3"), name="table1")
#: Inside Table 1's rounding; reproduces all five results that the paper prints.
CALIBRATED = Parameters(**_DISK, A=_F("0.24884e-3"), B=_F("0.22656e-3"), name="calibrated")
#: A sharp-edged disk of radius 45 mm, 10 mm thick, with a hole of radius 15 mm whose centre lies 20 mm from the disk's.
GEOMETRY = Parameters(**_DISK, A=_F("0.2483125e-3"), B=_F("0.2265625e-3"), C=_F("0.467625e-3"), name="geometry")
#: The sets that describe the paper's disk: what the paper claims is judged on these.
NAMED_SETS = {parameters.name: parameters for parameters in (PRINTED, CALIBRATED, GEOMETRY)}
_ALIASES = {"printed": PRINTED.name}  # as the ids of the reference data have it
