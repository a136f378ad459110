"""The plan of a sweep: an analysis, and the axes whose combinations are the points.

A point is a set of exact decimals. Its row has the inputs in columns named after the axes, and the
results in other columns.
"""

from __future__ import annotations

import hashlib
import itertools
import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, get_args

from tippedisk_verify.disk import Disk
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.model.parameters import SYMBOLS
from tippedisk_verify.numbers.decimals import exact_text
from tippedisk_verify.numbers.exact import exact
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.precision import checked_digits
from tippedisk_verify.theory.equilibria import EquilibriumName, equilibrium

__all__ = ["SweepPlan", "parse_axis", "run_analysis"]

_MAX_POINTS = 1_000_000
_MAX_BITS = 1_000_000_000  # of all numbers of a range: some hundred megabytes
_START = {"beta": "pi/2", "gamma": "pi/2 + 0.4", "v": "0"}


# ---------------------------------------------------------------------------------------- analyses
def _orbit(disk: Disk, point: Mapping[str, str], digits: int) -> dict[str, Any]:
    cycle = disk.limit_cycle(**_speed(point), digits=digits, progress=False)
    names = (
        "omega",
        "period",
        "gamma_bar_0",
        "v_0",
        "beta_max",
        "multiplier_slow",
        "log_multiplier_slow",
        "log_multiplier_fast",
        "dperiod_domega",
    )
    return {**{name: getattr(cycle, name) for name in names}, "stable": str(cycle.stable)}


def _equilibria(disk: Disk, point: Mapping[str, str], digits: int) -> dict[str, Any]:
    numbers: dict[str, Any] = {}
    speed = disk.speed(**_speed(point), digits=digits)
    for name in get_args(EquilibriumName):
        state = equilibrium(disk, speed, name, digits)
        for n, value in enumerate(state.eigenvalues, start=1):
            numbers |= {f"{name}_{n}_re": value.re, f"{name}_{n}_im": value.im}
        numbers[f"{name}_stable"] = state.stable
    return numbers


def _heteroclinic(disk: Disk, point: Mapping[str, str], digits: int) -> dict[str, Any]:
    connection = disk.heteroclinic(digits=digits, progress=False)
    return {"omega_h": connection.omega_h, "saddle_value": connection.saddle_value}


def _trajectory(disk: Disk, point: Mapping[str, str], digits: int) -> dict[str, Any]:
    solution = disk.integrate(
        disk.speed(**_speed(point), digits=digits),
        [point.get(name, start) for name, start in _START.items()],
        duration := point.get("duration", "10"),
        t_eval=[duration],
        digits=digits,
        progress=False,
    )
    if not solution.success:
        raise AccuracyError(solution.status.value)
    end = solution.end
    if not max(map(float, end.uncertainty)) < float("inf"):
        raise AccuracyError("rounding decides how this orbit ends: ask for more digits")
    ends = zip(_START, end.state, end.uncertainty, strict=True)
    numbers = {f"final_{name}": Measured.of(value, width) for name, value, width in ends}
    time = Measured.of(end.time, end.time_uncertainty)
    return {"ended": solution.status.name, "time": time, **numbers}


def _speed(point: Mapping[str, str]) -> dict[str, Any]:
    """Return the speed of a point, as the arguments of `Disk.speed`."""
    return {"omega": point.get("omega"), "below_crit": point.get("below-crit")}


# Each analysis with the inputs that a point may have in addition to the parameters.
_ANALYSES: dict[
    str, tuple[Callable[[Disk, Mapping[str, str], int], dict[str, Any]], tuple[str, ...]]
] = {
    "orbit": (_orbit, ("omega", "below-crit")),
    "equilibria": (_equilibria, ("omega", "below-crit")),
    "hopf": (lambda disk, point, digits: vars(disk.hopf(digits=digits)), ()),
    "heteroclinic": (_heteroclinic, ()),
    "trajectory": (_trajectory, ("omega", "below-crit", *_START, "duration")),
}


# ------------------------------------------------------------------------------------------ points
def parse_axis(text: str) -> tuple[str, tuple[str, ...]]:
    """Parse the text of one axis of a sweep: a parameter's name and its values.

    Args:
        text: ``name=first:last:count`` or ``name=value,value,...``.

    Returns:
        The name, and the values as exact decimals or ratios.

    Raises:
        InputError: If the text is not an axis.
    """
    name, _, values = text.partition("=")
    name = name.strip()
    if not name or not values.strip():
        raise InputError(
            f"an axis is NAME=FIRST:LAST:COUNT or NAME=VALUE,VALUE,..., not '{text[:60]}'"
        )
    if ":" not in values:
        chosen = tuple(value.strip() for value in values.split(","))
        for value in chosen:
            exact(value)
        return name, chosen
    if not (parts := re.fullmatch(r"([^:]*):([^:]*):\s*([0-9]{1,9})\s*", values)):
        raise InputError(f"a range is FIRST:LAST:COUNT, not '{values[:60]}'")
    first, last, count = exact(parts[1]), exact(parts[2]), int(parts[3])
    if not 2 <= count <= _MAX_POINTS or first.pi_multiple or last.pi_multiple:
        raise InputError(
            f"a range has decimal ends and 2 to {_MAX_POINTS} points, not '{values[:60]}'"
        )
    step = (last.rational - first.rational) / (count - 1)
    if count * max(step.denominator.bit_length(), step.numerator.bit_length()) > _MAX_BITS:
        raise InputError(
            f"the ends of '{values[:60]}' have too many digits for {count} points: round them"
        )
    return name, tuple(exact_text(first.rational + n * step) for n in range(count))


@dataclass(frozen=True)
class SweepPlan:
    """The description of a parameter sweep: an analysis, a disk, and the axes whose combinations
    are the points.

    Raises:
        InputError: If the analysis or an axis is not known, or the number of points is out of
            range.
    """

    analysis: str
    disk: Disk
    axes: tuple[tuple[str, tuple[str, ...]], ...]
    digits: int = 12

    def __post_init__(self) -> None:
        if self.analysis not in _ANALYSES:
            raise InputError(
                f"analysis '{self.analysis[:40]}' is not known: use {', '.join(_ANALYSES)}"
            )
        names, own = [name for name, _ in self.axes], _ANALYSES[self.analysis][1]
        known = (*SYMBOLS, *own)
        for name in names:
            if name not in known:
                raise InputError(
                    f"{self.analysis} cannot be swept over '{name[:40]}': use {', '.join(known)}"
                )
        if len(set(names)) != len(names):
            raise InputError("an axis is given twice")
        if own and ("omega" in names) == ("below-crit" in names):
            raise InputError(
                f"{self.analysis} needs either omega or below-crit as an axis (one value will do)"
            )
        checked_digits(self.digits)
        if not self.axes or len(self) > _MAX_POINTS:
            raise InputError(
                f"a sweep has 1 to {_MAX_POINTS} points, not {len(self) if self.axes else 0}"
            )

    def __len__(self) -> int:
        return math.prod(len(values) for _, values in self.axes)

    def points(self) -> Iterator[dict[str, str]]:
        """Yield every point of the sweep, a value for each axis by name; the last axis varies
        fastest.
        """
        names = [name for name, _ in self.axes]
        for values in itertools.product(*(values for _, values in self.axes)):
            yield dict(zip(names, values, strict=True))

    @property
    def key(self) -> str:
        """A hash of everything that determines the sweep."""
        fixed = [exact_text(getattr(self.disk, name)) for name in SYMBOLS]
        asked = repr((self.analysis, fixed, self.disk.law.name, self.digits, self.axes))
        return hashlib.sha256(asked.encode()).hexdigest()


# ------------------------------------------------------------------------------ the row of a point
def run_analysis(
    analysis: str, disk: Disk, digits: int, point: Mapping[str, str]
) -> dict[str, str]:
    """Run an analysis at one point.

    Args:
        analysis: The name of the analysis.
        disk: The disk; a point may replace its parameters.
        digits: Significant digits.
        point: The inputs by name.

    Returns:
        The row: the point, the numbers with their half-widths, and ``status``. The status is ok, or
        the reason why there are no numbers.
    """
    row = dict(point)
    changes = {name: value for name, value in point.items() if name in SYMBOLS}
    try:
        numbers = _ANALYSES[analysis][0](
            disk.changed(**changes) if changes else disk, point, digits
        )
    except (InputError, AccuracyError, ArithmeticError) as fault:
        return row | {"status": " ".join(str(fault).split())[:200] or type(fault).__name__}
    row["status"] = "ok"
    for name, value in numbers.items():
        if isinstance(value, Measured) and name not in point:
            row[name], row[f"{name}_uncertainty"] = value.decimals()
        elif isinstance(value, str | bool):
            row[name] = str(value).lower()
    return row
