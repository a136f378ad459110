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
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, get_args

from tippedisk_verify.cycles.cycle_at_speed import librating_cycle_at
from tippedisk_verify.cycles.near_omega_h.heteroclinic_methods import heteroclinic
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.flow import default_engine
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.parameters import SYMBOLS, Parameters
from tippedisk_verify.motion.integration import Motion
from tippedisk_verify.numbers.decimals import exact_text
from tippedisk_verify.numbers.exact import exact
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.precision import checked_digits
from tippedisk_verify.theory.equilibria import EquilibriumName, equilibrium
from tippedisk_verify.theory.hopf import hopf_point, speed_below_crit

__all__ = ["SweepPlan", "parse_axis", "run_analysis"]

_MAX_POINTS = 1_000_000
_MAX_BITS = 1_000_000_000  # of all numbers of a range: some hundred megabytes
_START = {"beta": "pi/2", "gamma": "pi/2 + 0.4", "v": "0"}


# ---------------------------------------------------------------------------------------- analyses
def _orbit(parameters: Parameters, point: Mapping[str, str], digits: int) -> dict[str, Any]:
    speed = _speed(parameters, point, digits)
    cycle = replace(
        librating_cycle_at(parameters, speed.value, default_engine(), digits=digits), omega=speed
    )
    names = (
        "omega",
        "period",
        "gamma_bar_0",
        "v_0",
        "beta_max",
        "multiplier_slow",
        "log_multiplier_slow",
    )
    numbers = {
        name: getattr(cycle, name) for name in (*names, "log_multiplier_fast", "dperiod_domega")
    }
    return {**numbers, "stable": str(cycle.stable)}


def _equilibria(parameters: Parameters, point: Mapping[str, str], digits: int) -> dict[str, Any]:
    numbers: dict[str, Any] = {}
    for name in get_args(EquilibriumName):
        state = equilibrium(parameters, _speed(parameters, point, digits).value, name, digits)
        for n, value in enumerate(state.eigenvalues, start=1):
            numbers |= {f"{name}_{n}_re": value.re, f"{name}_{n}_im": value.im}
        numbers[f"{name}_stable"] = state.stable
    return numbers


def _heteroclinic(parameters: Parameters, point: Mapping[str, str], digits: int) -> dict[str, Any]:
    connection = heteroclinic(parameters, default_engine(), digits=digits)
    return {"omega_h": connection.omega_h, "saddle_value": connection.saddle_value}


def _trajectory(parameters: Parameters, point: Mapping[str, str], digits: int) -> dict[str, Any]:
    state, duration = (
        [point.get(name, start) for name, start in _START.items()],
        point.get("duration", "10"),
    )
    omega = _speed(parameters, point, digits).value
    motion = Motion(
        parameters, omega, state, duration, default_engine(), t_eval=[duration], digits=digits
    )
    solution = motion.solution(motion.engine(motion.request))
    if not solution.success:
        raise AccuracyError(solution.status.value)
    end = solution.end
    if not max(map(float, end.uncertainty)) < float("inf"):
        raise AccuracyError("rounding decides how this orbit ends: ask for more digits")
    ends = zip(_START, end.state, end.uncertainty, strict=True)
    numbers = {f"final_{name}": Measured.of(value, width) for name, value, width in ends}
    time = Measured.of(end.time, end.time_uncertainty)
    return {"ended": solution.status.name, "time": time, **numbers}


def _speed(parameters: Parameters, point: Mapping[str, str], digits: int) -> Measured:
    if "omega" in point:
        return Measured(checked_speed(point["omega"]), Fraction(0))
    return speed_below_crit(parameters, point["below-crit"], digits)


# Each analysis with the inputs that a point may have in addition to the parameters.
_ANALYSES: dict[
    str, tuple[Callable[[Parameters, Mapping[str, str], int], dict[str, Any]], tuple[str, ...]]
] = {
    "orbit": (_orbit, ("omega", "below-crit")),
    "equilibria": (_equilibria, ("omega", "below-crit")),
    "hopf": (lambda parameters, point, digits: vars(hopf_point(parameters, digits)), ()),
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
    parameters: Parameters
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
        fixed = [exact_text(getattr(self.parameters, name)) for name in SYMBOLS]
        asked = repr((self.analysis, fixed, self.parameters.law.name, self.digits, self.axes))
        return hashlib.sha256(asked.encode()).hexdigest()


# ------------------------------------------------------------------------------ the row of a point
def run_analysis(
    analysis: str, parameters: Parameters, digits: int, point: Mapping[str, str]
) -> dict[str, str]:
    """Run an analysis at one point.

    Args:
        analysis: The name of the analysis.
        parameters: The disk; a point may replace its parameters.
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
            parameters.changed(**changes) if changes else parameters, point, digits
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
