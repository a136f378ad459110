"""The parameters of a tippedisk: the named sets such as Table 1, their checks, and disk files.

Three named sets describe the paper's disk:

- ``table1``, also named ``printed``: the paper's Table 1 as it stands;
- ``calibrated``: inside Table 1's rounding, and reproducing the paper's five printed results;
- ``geometry``: derived from a disk's dimensions.

Other sets come from a TOML file, in which each number is an exact decimal.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field, fields, replace
from decimal import Decimal
from fractions import Fraction
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple, Self

from tippedisk_verify.display import Printable, result_lines
from tippedisk_verify.errors import InputError
from tippedisk_verify.model.friction import LAWS, Friction, FrictionLaw, law_of
from tippedisk_verify.model.friction_checks import refuse_unusable
from tippedisk_verify.numbers.decimals import exact_decimals, exact_text
from tippedisk_verify.numbers.exact import PI, fraction, rational_in_context, short_text
from tippedisk_verify.numbers.precision import Precision
from tippedisk_verify.support.files import file_path, output_file, read_bytes, write_text

__all__ = [
    "CALIBRATED",
    "GEOMETRY",
    "NAMED_SETS",
    "PRINTED",
    "SYMBOLS",
    "Constants",
    "Parameters",
]

#: The eight numbers that the equations need, in the order of every list.
SYMBOLS = ("r", "e", "m", "A", "B", "g", "mu", "epsilon")

_MAX_FILE_BYTES = 64_000  # a usual file has some hundreds; nine decimals of the longest kind 36,000
_MAX_DOTS_PER_LINE = 200  # time and memory of TOML's dotted keys grow with the square of their dots
_MIN_PARAMETER = Fraction(1, 10**30)  # SI; ratios and products of such parameters fit into doubles


class Constants(NamedTuple):
    """The parameters of a disk as numbers of one arithmetic, each rounded once from its exact
    value.

    Only mass ratios enter the acceleration, so the field uses ``a``, ``b``, ``k`` and ``traction``.
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
    k: Any  #: friction per mass and sliding velocity at zero; mu g / epsilon in both laws [1/s]
    traction: Any  #: mu g, the smooth law's greatest friction per mass [m/s^2]
    pi: Any = PI  #: for friction laws


def _quantity(unit: str, source: str) -> Any:
    return field(metadata={"unit": unit, "source": source})


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Parameters(Printable):
    """One tippedisk and its friction law, with exact rational values.

    Values may be strings, Fractions, Decimals, ints or floats. Two sets are equal if they have the
    same eight numbers and the same law. The name and C do not count.

    Raises:
        InputError: If a value is not finite or not between 1e-30 and 1e30, or if e >= r, Bbar <= 0,
            B > A or A > C. Also if the friction law is unknown or unusable. The message has one
            line for each fault.
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
        metadata={
            "unit": "kg m^2",
            "source": "Table tab:dim_mass, inertia (3,3); enters no equation here",
        },
    )
    name: str = "custom"
    #: Eq. lin_lambda_y_3DOF, the smooth Coulomb law that it linearises, or a law of one's own
    friction: Friction | FrictionLaw = "linear"
    _constants: dict[Precision, Constants] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def _constructor_arguments(self) -> dict[str, Any]:
        """Return the constructor's arguments of this disk by name."""
        return {item.name: getattr(self, item.name) for item in fields(self) if item.init}

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(type(self), **self._constructor_arguments()), ()

    def _defining_values(self) -> tuple[object, ...]:
        return (*(getattr(self, name) for name in SYMBOLS), self.friction)

    def __eq__(self, other: object) -> bool:
        return (
            self._defining_values() == other._defining_values()
            if isinstance(other, Parameters)
            else NotImplemented
        )

    def __hash__(self) -> int:
        return hash(self._defining_values())

    def __post_init__(self) -> None:
        faults = []
        name: object = self.name
        if not isinstance(name, str):
            faults.append(f"a disk's name is a text, not {short_text(name)}")
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
                faults.append(f"parameter {item.name} must be positive, not {short_text(value)}")
            elif not _MIN_PARAMETER <= number <= 1 / _MIN_PARAMETER:
                faults.append(
                    f"parameter {item.name} must lie between 1e-30 and 1e30 in SI units, "
                    f"not {short_text(value)}"
                )
            object.__setattr__(self, item.name, number)
        law = law_of(self.friction)
        if not faults:
            faults = self._inconsistencies()
        if faults:
            raise InputError(faults)
        if law in LAWS.values():
            object.__setattr__(self, "friction", law.name)
        else:
            refuse_unusable(law, self)

    def _inconsistencies(self) -> list[str]:
        conditions = {
            "the eccentricity e must be smaller than the radius r": self.e < self.r,
            "Bbar = B - m e^2 must be positive: B is too small for this m and e": self.Bbar > 0,
            "B must not exceed A, the inertia about the axis through both centres": self.B
            <= self.A,
            "A must not exceed C, the moment about the disk's normal": (
                self.C is None or self.A <= self.C
            ),
        }
        return [fault for fault, met in conditions.items() if not met]

    @property
    def Bbar(self) -> Fraction:
        """B - m e^2 [kg m^2]: moment of inertia (2,2) at the centre of gravity.

        The paper defines it below Table tab:dim_mass.
        """
        return self.B - self.m * self.e**2

    def constants_in(self, precision: Precision) -> Constants:
        """Return the disk's parameters as numbers of the arithmetic ``precision``, each rounded
        once.

        They are computed once and kept.

        Args:
            precision: The arithmetic.
        """
        constants = self._constants.get(precision)
        if constants is None:
            constants = self._constants[precision] = Constants(
                *map(precision.number, self.rational_constants())
            )
        return constants

    def constants_in_context(self, ctx: Any) -> Constants:
        """Return the disk's parameters as numbers of an mpmath context.

        Args:
            ctx: The mpmath context.
        """
        *rational, _ = self.rational_constants()
        return Constants(*(rational_in_context(ctx, value) for value in rational))._replace(
            pi=+ctx.pi
        )

    def rational_constants(self) -> Constants:
        """Return the disk's parameters as exact rationals, and pi as the exact number `PI`."""
        return Constants(
            *(self.r, self.e, self.m, self.A, self.B, self.Bbar, self.g, self.mu, self.epsilon),
            *(self.A / self.m, self.Bbar / self.m),
            *(self.law.slope(self) / self.m, self.mu * self.g),
        )

    def changed(self, **values: object) -> Self:
        """Return a copy of the disk with some parameters replaced, named ``custom`` unless a name
        is given.

        Args:
            values: The new values by field name.

        Raises:
            InputError: If the constructor refuses the new values.
        """
        return replace(self, **{"name": "custom", **values})  # type: ignore[arg-type]

    def with_friction(self, friction: Friction | FrictionLaw) -> Self:
        """Return the same disk, with the same name, under another friction law.

        Args:
            friction: ``linear``, ``smooth`` or a `FrictionLaw`.

        Raises:
            InputError: If there is no such law.
        """
        return self if law_of(friction) == self.law else replace(self, friction=friction)

    def refuse_unless_linear(self, what: str) -> None:
        """Raise InputError unless the friction law is the linear one.

        Args:
            what: The beginning of the message, such as 'harmonic balance is'.

        Raises:
            InputError: If the friction law is not the linear one.
        """
        self._refuse_unless(self.law.is_linear, what, "the linear friction law")

    def refuse_two_sided_law(self, what: str) -> None:
        """Raise InputError unless the friction law is analytic at gamma_y = 0.

        Args:
            what: The beginning of the message, such as 'Fourier collocation is'.

        Raises:
            InputError: If the law has two analytic sides.
        """
        self._refuse_unless(not self.law.two_sided, what, "analytic friction laws")

    def refuse_custom_law(self, what: str) -> None:
        """Raise InputError if the friction law is not one of the paper's.

        Args:
            what: The beginning of the message, such as 'proofs are'.

        Raises:
            InputError: If the friction law is a user's own.
        """
        self._refuse_unless(self.friction in LAWS, what, "the paper's friction laws")

    def _refuse_unless(self, served: bool, what: str, laws: str) -> None:
        if not served:
            own = "the smooth one" if self.friction in LAWS else f"'{self.friction}'"
            raise InputError(f"{what} for {laws} only, not for {own}")

    def decimals(self) -> dict[str, str]:
        """Return the disk's parameters by name, as decimal strings.

        They are exact, except that a repeating decimal is cut after fifty digits.
        """
        return {
            name: exact_decimals(value)[0]
            for name in _QUANTITIES
            if (value := getattr(self, name)) is not None
        }

    def exact_texts(self) -> dict[str, str]:
        """Return the disk's parameters by name, as exact decimals, or as ratios if the decimals
        never end.
        """
        return {
            name: exact_text(value)
            for name in _QUANTITIES
            if (value := getattr(self, name)) is not None
        }

    def to_toml(self, path: str | PathLike[str] | None = None) -> str:
        """Return the disk as the text of a parameter file, and write it if a path is given.

        Its numbers are exact: decimals, or ratios such as "1/3" if the decimals never end.
        `from_toml` reads it. A parameter file does not hold the friction law.

        Args:
            path: The file.

        Raises:
            InputError: If the file cannot be written.
        """
        content = "".join(f'{name} = "{text}"\n' for name, text in self.exact_texts().items())
        if path is not None:
            write_text(output_file(path), content)
        return content

    def to_dict(self) -> dict[str, Any]:
        """Return the disk's parameters as decimal strings, with its name and friction law."""
        return {**self.decimals(), "name": self.name, "friction": str(self.friction)}

    def _title(self) -> str:
        return f"{type(self).__name__} {self.name} ({self.friction})"

    def __str__(self) -> str:
        """Return a title with the disk's name and friction law, then a line for each parameter."""
        return "\n".join([self._title(), *result_lines(self.decimals(), "  ")])

    @property
    def law(self) -> FrictionLaw:
        """The friction law of the disk, as a `FrictionLaw`."""
        return law_of(self.friction)

    def definition(self) -> str:
        """Return a text that identifies the disk to which a statement applies: its eight exact
        numbers with their units.
        """
        return ", ".join(
            f"{item.name} = {exact_text(getattr(self, item.name))} {item.metadata['unit']}".removesuffix(
                " 1"
            )
            for item in fields(self)
            if item.name in Constants._fields
        )

    @classmethod
    def named(cls, name_or_path: str | PathLike[str]) -> Parameters:
        """Return the parameters of a named disk, or those in a TOML file.

        Args:
            name_or_path: A set's name; a text with a dot or a path separator is a path, as is a
                `pathlib.Path`.

        Raises:
            InputError: If there is no such set, or the file cannot be used, as in `from_toml`.
        """
        if not isinstance(name_or_path, str):
            return cls.from_toml(name_or_path)
        name = _ALIASES.get(name_or_path, name_or_path)
        if name in NAMED_SETS:
            return NAMED_SETS[name]
        if "." in name_or_path or "/" in name_or_path or "\\" in name_or_path:
            return cls.from_toml(name_or_path)
        raise InputError(
            f"parameter set '{name_or_path[:60]}' is not known: use {', '.join(NAMED_SETS)} or a "
            f".toml file"
        )

    @classmethod
    def from_toml(cls, path: str | PathLike[str]) -> Parameters:
        """Read parameters from a file with the keys r, e, m, A, B, g, mu, epsilon and optionally C.

        A number is exactly the decimal in the file, quoted or not. A ratio such as "1/3" needs the
        quotes.

        Args:
            path: The file, in SI units.

        Returns:
            The parameters, named by the file's name.

        Raises:
            InputError: If the file cannot be read, is not TOML, lacks a key, has an unknown key, or
                holds values that `Parameters` refuses.
        """
        path = file_path(path)
        entries = _toml_entries(path)
        faults = [
            f"unknown key '{key[:40]}' (allowed: {', '.join(_QUANTITIES)})"
            for key in entries
            if key not in _QUANTITIES
        ]
        faults += [
            f"key '{key}' is missing" for key in _QUANTITIES if key != "C" and key not in entries
        ]
        if faults:
            raise InputError(f"parameter file {path.name}: {'; '.join(faults)}")
        try:
            return cls(**entries, name=_file_name(path))
        except InputError as fault:
            raise InputError(
                f"parameter file {path.name}: {line}" for line in fault.faults
            ) from None


# The names of the numbers: the eight that the equations need, and C.
_QUANTITIES = tuple(item.name for item in fields(Parameters) if item.metadata)


def _file_name(path: Path) -> str:
    """Return the name of a parameter file in a form that `Parameters.named` reads as a path, not as
    a set's name.

    A name without a dot gets ``./`` in front.
    """
    name = path.name.encode(errors="replace").decode()
    return name if "." in name else f"./{name}"


def _toml_entries(path: Path) -> dict[str, Any]:
    try:
        content = read_bytes(path, _MAX_FILE_BYTES)
    except InputError as fault:
        raise InputError(f"parameter file {fault}") from None
    if any(line.count(b".") > _MAX_DOTS_PER_LINE for line in content.split(b"\n")):
        raise InputError(
            f"parameter file {path} has a line with more than {_MAX_DOTS_PER_LINE} dots: it is not "
            f"a parameter file"
        )
    try:
        entries = tomllib.loads(content.decode("utf-8-sig"), parse_float=Decimal)
    except (ValueError, RecursionError) as fault:
        reason = str(fault).splitlines()[0][:120]
        raise InputError(f"parameter file {path.name} is not a TOML text file: {reason}") from None
    if not entries:
        raise InputError(
            f"parameter file {path.name} is empty: it needs the keys r, e, m, A, B, g, mu, epsilon"
        )
    return entries


_F = Fraction
_COMMON: dict[str, Any] = {"g": _F("9.81"), "mu": _F("0.3"), "epsilon": _F("0.1")}
_DISK: dict[str, Any] = {"r": _F("0.045"), "e": _F("2.5e-3"), "m": _F("0.435"), **_COMMON}

#: Table 1 of the paper as it stands.
PRINTED = Parameters(**_DISK, A=_F("0.249e-3"), B=_F("0.227e-3"), C=_F("0.468e-3"), name="table1")
#: Inside Table 1's rounding; reproduces all five results that the paper prints.
CALIBRATED = Parameters(**_DISK, A=_F("0.24884e-3"), B=_F("0.22656e-3"), name="calibrated")
#: A sharp-edged disk of radius 45 mm and thickness 10 mm, with a hole of radius 15 mm. The centre
#: of the hole lies 20 mm from that of the disk.
GEOMETRY = Parameters(
    **_DISK, A=_F("0.2483125e-3"), B=_F("0.2265625e-3"), C=_F("0.467625e-3"), name="geometry"
)
#: The sets that describe the paper's disk; the paper's claims are judged on these.
NAMED_SETS = {parameters.name: parameters for parameters in (PRINTED, CALIBRATED, GEOMETRY)}
_ALIASES = {"printed": PRINTED.name}  # the name in the ids of the reference data
