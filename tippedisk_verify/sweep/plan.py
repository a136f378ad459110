"""What a sweep computes: an analysis, the axes whose every combination is a point, and the row of one point.

A point is a set of exact decimals. Its row has what was given in columns named after the axes, and the results in
columns of their own.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from typing import Any

from tippedisk_verify.checksums import digest
from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.fingerprint import origin
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.exact import exact
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import SYMBOLS, Parameters
from tippedisk_verify.model.precision import checked_digits

__all__ = ["ANALYSES", "Plan", "axis", "computed", "here"]

_MOST_POINTS = 1_000_000
_MOST_BITS = 1_000_000_000  # of a range's numbers


# ------------------------------------------------------------------------------------------ what can be swept
def _cycle(parameters: Parameters, point: Mapping[str, str], digits: int) -> dict[str, Any]:
    from tippedisk_verify.flow import default_engine
    from tippedisk_verify.orbits.near_connection import cycle_at

    cycle = cycle_at(parameters, _speed(parameters, point, digits), default_engine(), digits=digits)
    speed = {} if "omega" in point else {"omega": cycle.omega}
    names = ("period", "gamma_bar_0", "v_0", "beta_max", "multiplier_slow", "log_multiplier_slow")
    numbers: dict[str, Any] = {name: getattr(cycle, name) for name in (*names, "log_multiplier_fast", "dperiod_domega")}
    return {**speed, **numbers, "stable": str(cycle.stable).lower()}


def _equilibria(parameters: Parameters, point: Mapping[str, str], digits: int) -> dict[str, Any]:
    from tippedisk_verify.theory.equilibria import equilibrium

    numbers: dict[str, Any] = {}
    for name in ("inverted", "noninverted"):
        state = equilibrium(parameters, _speed(parameters, point, digits), name, digits)
        for n, value in enumerate(state.eigenvalues, start=1):
            numbers |= {f"{name}_{n}_re": value.re, f"{name}_{n}_im": value.im}
        numbers[f"{name}_stable"] = str(state.stable).lower()
    return numbers


def _hopf(parameters: Parameters, point: Mapping[str, str], digits: int) -> dict[str, Any]:
    from tippedisk_verify.theory.hopf import hopf_point

    hopf = hopf_point(parameters, digits)
    numbers = {name: getattr(hopf, name) for name in hopf.__dataclass_fields__}
    return {name: value for name, value in numbers.items() if value is not None}


def _heteroclinic(parameters: Parameters, point: Mapping[str, str], digits: int) -> dict[str, Any]:
    from tippedisk_verify.flow import default_engine
    from tippedisk_verify.orbits.heteroclinic import heteroclinic

    connection = heteroclinic(parameters, default_engine(), digits=digits)
    return {"omega_h": connection.omega_h, "saddle_value": connection.saddle_value}


def _trajectory(parameters: Parameters, point: Mapping[str, str], digits: int) -> dict[str, Any]:
    from tippedisk_verify.flow import default_engine
    from tippedisk_verify.flow.contract import Request
    from tippedisk_verify.model.precision import DOUBLE, bits, bits_for_digits

    # Four digits go in a passage or two; the error estimate tells if they were more.
    precision = DOUBLE if digits <= 12 else bits(bits_for_digits(digits + 8))
    state = [point.get(name, default) for name, default in (("beta", "pi/2"), ("gamma", "pi/2 + 0.4"), ("v", "0"))]
    request = Request(
        parameters, _speed(parameters, point, digits), state, point.get("duration", "10"),
        precision=precision, error_estimate=True,
    )  # fmt: skip
    result = default_engine()(request)
    if result.error is None or not all(float(width) < float("inf") for width in result.error.state):
        raise Shortfall("rounding decides how this orbit ends: ask for more digits")
    numbers = {
        f"final_{name}": Measured.of(value, width)
        for name, value, width in zip(("beta", "gamma", "v"), result.state, result.error.state, strict=True)
    }
    return {"ended": result.status.name.lower(), "time": Measured.of(result.time, result.error.time), **numbers}


def _speed(parameters: Parameters, point: Mapping[str, str], digits: int) -> Fraction:
    from tippedisk_verify.theory.hopf import speed_below_crit

    if "omega" in point:
        return checked_speed(point["omega"])
    return speed_below_crit(parameters, point["below-crit"], digits)


@dataclass(frozen=True)
class Analysis:
    """What is done at a point, and what a point may or must say beside the parameters."""

    says: str
    compute: Callable[[Parameters, Mapping[str, str], int], dict[str, Any]]
    needs_speed: bool = True
    takes: tuple[str, ...] = ()


ANALYSES: dict[str, Analysis] = {
    "orbit": Analysis("the limit cycle at a speed", _cycle),
    "equilibria": Analysis("eigenvalues of both equilibria at a speed", _equilibria),
    "hopf": Analysis("the Hopf point", _hopf, needs_speed=False),
    "heteroclinic": Analysis("Omega_h", _heteroclinic, needs_speed=False),
    "trajectory": Analysis("the end of a trajectory", _trajectory, takes=("beta", "gamma", "v", "duration")),
}


# ------------------------------------------------------------------------------------------ points
def axis(text: str) -> tuple[str, tuple[str, ...]]:
    """``name=first:last:count`` or ``name=value,value,...`` as (name, exact decimals or ratios).

    Raises InputError with what is wrong.
    """
    name, sign, values = text.partition("=")
    name = name.strip()
    if not sign or not name or not values.strip():
        raise InputError(f"an axis is NAME=FIRST:LAST:COUNT or NAME=VALUE,VALUE,..., not '{text[:60]}'")
    if ":" not in values:
        chosen = tuple(value.strip() for value in values.split(","))
        for value in chosen:
            exact(value)
        return name, chosen
    parts = values.split(":")
    if len(parts) != 3 or not parts[2].strip().isascii() or not parts[2].strip().isdecimal() or len(parts[2]) > 9:
        raise InputError(f"a range is FIRST:LAST:COUNT, not '{values[:60]}'")
    first, last, count = exact(parts[0]), exact(parts[1]), int(parts[2])
    if not 2 <= count <= _MOST_POINTS or first.pi_multiple or last.pi_multiple:
        raise InputError(f"a range has decimal ends and 2 to {_MOST_POINTS} points, not '{values[:60]}'")
    step = (last.rational - first.rational) / (count - 1)
    if count * max(step.denominator.bit_length(), step.numerator.bit_length()) > _MOST_BITS:
        raise InputError(f"the ends of '{values[:60]}' are too long for so many points: round them")
    return name, tuple(_text(first.rational + n * step) for n in range(count))


def _text(value: Fraction) -> str:
    """An exact decimal if there is one, otherwise the ratio."""
    text, rest = Measured(value, Fraction(0)).decimals()
    # Decimal writes integers of any length.
    return text if rest == "0" else f"{Decimal(value.numerator)}/{Decimal(value.denominator)}"


@dataclass(frozen=True)
class Plan:
    """A sweep: the analysis, what stays, and the axes whose every combination is a point."""

    analysis: str
    parameters: Parameters
    axes: tuple[tuple[str, tuple[str, ...]], ...]
    digits: int = 12

    def __post_init__(self) -> None:
        if self.analysis not in ANALYSES:
            raise InputError(f"analysis '{self.analysis[:40]}' is not known: use {', '.join(ANALYSES)}")
        analysis = ANALYSES[self.analysis]
        names = [name for name, _ in self.axes]
        known = (*SYMBOLS, *(("omega", "below-crit") if analysis.needs_speed else ()), *analysis.takes)
        for name in names:
            if name not in known:
                raise InputError(f"{self.analysis} cannot be swept over '{name[:40]}': use {', '.join(known)}")
        if len(set(names)) != len(names):
            raise InputError("an axis is given twice")
        if analysis.needs_speed and ("omega" in names) == ("below-crit" in names):
            raise InputError(f"{self.analysis} needs either omega or below-crit as an axis (one value will do)")
        checked_digits(self.digits)
        if not 0 < len(self) <= _MOST_POINTS:
            raise InputError(f"a sweep has 1 to {_MOST_POINTS} points, not {len(self)}")

    def __len__(self) -> int:
        count = 1
        for _, values in self.axes:
            count *= len(values)
        return count if self.axes else 0

    def points(self) -> Iterator[dict[str, str]]:
        """Every combination, the last axis fastest."""
        names = [name for name, _ in self.axes]
        for values in itertools.product(*(values for _, values in self.axes)):
            yield dict(zip(names, values, strict=True))

    @property
    def key(self) -> str:
        """A hash of all that is asked for."""
        fixed = [_text(getattr(self.parameters, name)) for name in SYMBOLS]
        return digest([self.analysis, fixed, self.axes, self.digits, self.parameters.friction])


def computed(plan: Plan, point: Mapping[str, str]) -> dict[str, str]:
    """A row: the point, the numbers with their half-widths, and ``status``: ok, or why there are no numbers."""
    row = dict(point)
    try:
        changes = {name: value for name, value in point.items() if name in SYMBOLS}
        parameters = plan.parameters.changed(**changes) if changes else plan.parameters
        numbers = ANALYSES[plan.analysis].compute(parameters, point, plan.digits)
    except (InputError, Shortfall, ArithmeticError) as fault:
        return row | {"status": " ".join(str(fault).split())[:200] or type(fault).__name__}
    row["status"] = "ok"
    for name, value in numbers.items():
        if isinstance(value, Measured):
            row[name], row[f"{name}_uncertainty"] = value.decimals()
        else:
            row[name] = str(value)
    return row


def here() -> dict[str, str]:
    """The `origin` of the rows that this process computes."""
    return origin(__name__)
