"""Results as they are shown: as data for JSON, which the commands print, in lines with units, and as a table."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import fields
from enum import Enum
from fractions import Fraction
from html import escape
from typing import Any, ClassVar, NamedTuple

from tippedisk_verify.model.measured import Measured

__all__ = ["QUANTITIES", "Printable", "as_json", "heading", "result_lines"]

_MOST_LINES, _WIDEST = 10, 100
_LONGEST = 24  # of an exact number
_MOST_ENTRIES = 4  # of a list, before it is shown by its first and its last


class Quantity(NamedTuple):
    unit: str  #: empty for what has none
    meaning: str


QUANTITIES = {
    "omega": Quantity("rad/s", "Omega, the spinning speed"),
    "Omega": Quantity("rad/s", "the spinning speed"),
    "omega_crit": Quantity("rad/s", "Omega_crit, where inverted spinning loses its stability (the Hopf point)"),
    "omega_h": Quantity("rad/s", "Omega_h, where the two noninverted saddles are connected"),
    "reduced_omega_crit": Quantity("rad/s", "the Hopf speed of the flow on the truncated slow manifold"),
    "eigenvalues": Quantity("1/s", "of the linearisation there; re and im"),
    "kind_changes": Quantity("rad/s", "the speeds at which eigenvalues there turn from real to complex, or back"),
    "period": Quantity("s", "T, the period of the limit cycle (of hopf: its limit at Omega_crit)"),
    "gamma_bar_0": Quantity("rad", "gamma - pi/2 where beta = pi/2 and v < 0"),
    "v_0": Quantity("rad/s", "v = beta' there"),
    "beta_bar_0": Quantity("rad", "beta - pi/2 of a rotating cycle where gamma = -pi/2; v_0 is v there"),
    "beta_bar_top": Quantity("rad", "beta - pi/2 of a rotating cycle where gamma = pi/2"),
    "v_top": Quantity("rad/s", "v there"),
    "null_vector": Quantity("1/s", "d(v_0)/d(gamma_bar_0), or d(v_top)/d(beta_bar_top), along the family, at its fold"),
    "margin": Quantity(
        "rad", "distance in beta from the boundary of the basins; positive where the disk keeps standing"
    ),
    "beta_max": Quantity("rad", "largest abs(beta - pi/2) on the cycle"),
    "multiplier_slow": Quantity("", "the larger nontrivial Floquet multiplier of a full period"),
    "log_multiplier_slow": Quantity("", "its natural logarithm"),
    "log_multiplier_fast": Quantity("", "natural logarithm of the smaller one, which may be below any double"),
    "trivial_multiplier_defect": Quantity("", "distance from 1 of the computed multiplier along the flow: a check"),
    "dperiod_domega": Quantity("s^2/rad", "dT/dOmega along the family of cycles"),
    "dgamma_bar_0_domega": Quantity("s", "d(gamma_bar_0)/dOmega"),
    "dv_0_domega": Quantity("", "d(v_0)/dOmega"),
    "dbeta_bar_top_domega": Quantity("s", "d(beta_bar_top)/dOmega"),
    "dv_top_domega": Quantity("", "d(v_top)/dOmega"),
    "first_lyapunov_coefficient": Quantity("", "Kuznetsov's l_1, eigenvector of length 1 in (beta, gamma, v)"),
    "transversality": Quantity("1/rad", "d(Re lambda)/dOmega of the critical pair"),
    "amplitude_squared_slope": Quantity("rad s", "limit of beta_max^2 / (Omega_crit - Omega)"),
    "period_slope": Quantity("s^2/rad", "limit of (T - T_crit) / (Omega_crit - Omega)"),
    "quadratic_coefficient": Quantity("1/(rad s)", "c_1 of Omega = Omega_crit + c_1 a^2 + c_2 a^4, a = gamma_bar_0"),
    "quartic_coefficient": Quantity("1/(rad^3 s)", "c_2"),
    "second_lyapunov_coefficient": Quantity("", "Kuznetsov's l_2, for the same eigenvector; only where l_1 = 0"),
    "quadratic_coefficient_slope": Quantity("", "c_1' at a Bautin point, by the parameter P; all three in SI units"),
    "fold_amplitude_slope": Quantity("", "limit of a^2 / (P - value) on the fold of cycles; its sign tells the side"),
    "fold_speed_curvature": Quantity("", "limit of (Omega - Omega_crit) / (P - value)^2 on the fold"),
    "lambda_3": Quantity("1/s", "the third eigenvalue at the Hopf point"),
    "chi": Quantity("kg m^3", "the constant of the one-harmonic amplitude law"),
    "saddle_eigenvalues": Quantity("1/s", "at noninverted spinning and this speed: unstable, slow and fast stable"),
    "saddle_value": Quantity("1/s", "sum of the unstable and the slow stable one; below 0 cycles attract"),
    "splitting_derivative": Quantity("s/rad", "of the distance between the manifolds by Omega"),
    "budget": Quantity("rad/s", "what the half-width of Omega_h is made of"),
    "harmonics": Quantity("", "number of odd harmonics"),
    "beta": Quantity("rad", "the disk's inclination"),
    "gamma": Quantity("rad", "the angle of the centre of mass in the disk's plane"),
    "v": Quantity("rad/s", "beta'"),
    "h": Quantity("rad s^(n-1)/m^n", "the orders h_0, h_1, ... of v = h_0 + epsilon h_1 + ... there"),
    "residual": Quantity("m rad/s^3", "largest invariance residual of the orders 0, 1, ... over twenty fixed points"),
    "residual_slope": Quantity("", "its exponent in epsilon as epsilon tends to 0"),
    "best_order": Quantity("", "the order whose term is smallest, at its largest over those points"),
    "smallest_term": Quantity("rad/s", "the size of that term"),
}


class Printable:
    """What results have in common: they say themselves, each from the fields of its dataclass."""

    __slots__ = ()

    #: The entries, and which come first; if empty, all fields but those untold: whose it is, and how it was computed.
    listed: ClassVar[tuple[str, ...]] = ()
    first: ClassVar[tuple[str, ...]] = ()
    untold: ClassVar[tuple[str, ...]] = ("parameters", "disk", "engine", "precision", "residuals")

    def to_dict(self) -> dict[str, Any]:
        """As plain data for JSON. A number with a half-width is a value and an uncertainty, both decimals as texts."""
        names = self.listed or [item.name for item in fields(self) if item.name[0] != "_"]  # type: ignore[arg-type]
        ordered = dict.fromkeys((*self.first, *names))
        return {name: as_json(getattr(self, name)) for name in ordered if name not in self.untold}

    def _title(self) -> str:
        disk = getattr(self, "parameters", getattr(self, "disk", None))
        tools = (getattr(self, name) for name in ("engine", "precision") if hasattr(self, name))
        made = [getattr(tool, "name", tool) for tool in tools]
        whose = "" if disk is None else f" of {disk.name} ({', '.join([disk.friction, *made])})"
        return type(self).__name__ + whose

    def __repr__(self) -> str:
        lines = [self._title(), *result_lines(_brief(self.to_dict()), "  ")]
        if len(lines) > _MOST_LINES:
            lines[_MOST_LINES - 1 :] = [f"  and {len(lines) - _MOST_LINES + 1} more lines: to_dict() has everything"]
        # A number of many digits keeps its half-width, which is at its end.
        return "\n".join(line if len(line) <= _WIDEST else f"{line[: _WIDEST - 20]}…{line[-19:]}" for line in lines)

    def _repr_html_(self) -> str:
        """A table, for notebooks."""
        cells = ((heading(name), _said(entry)) for name, entry in _brief(self.to_dict()).items())
        rows = "".join(f"<tr><th>{escape(name)}</th><td>{escape(text)}</td></tr>" for name, text in cells)
        return f"<table><caption>{escape(self._title())}</caption>{rows}</table>"


def as_json(value: Any) -> Any:
    """A result, or an entry of one, for JSON: no finite number is None, one that is wider than a double is a text."""
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, Mapping):
        return {str(name): as_json(entry) for name, entry in value.items()}
    if isinstance(value, tuple | list):
        return [as_json(entry) for entry in value]
    if isinstance(value, Fraction):
        return Measured(value, Fraction(0)).to_dict()
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, int | str | None):
        return value
    bare = value.tolist() if hasattr(value, "tolist") else value.value if isinstance(value, Enum) else value
    return str(value) if type(bare) is type(value) else as_json(bare)  # NumPy has no other name for a long double


def heading(name: str) -> str:
    """The quantity's name with its unit, if it has one."""
    unit = QUANTITIES[name].unit if name in QUANTITIES else ""
    return f"{name} [{unit}]" if unit else name


def result_lines(entries: dict[str, Any], indent: str = "") -> Iterator[str]:
    """A line for each number and sentence of data for JSON; what consists of several goes below its name."""
    for name, value in entries.items():
        if value in (None, [], {}):
            continue
        if isinstance(value, dict) and not _measured(value):
            yield f"{indent}{heading(name)}:"
            yield from result_lines(value, indent + "  ")
        elif isinstance(value, list) and len(value) > 1:
            yield f"{indent}{heading(name)}:"
            yield from (f"{indent}  {_said(entry)}" for entry in value)
        else:
            yield f"{indent}{heading(name)}: {_said(value)}"


def _measured(value: Any) -> bool:
    return isinstance(value, dict) and set(value) == {"value", "uncertainty"}


def _said(value: Any) -> str:
    if _measured(value):
        text, width = str(value["value"]), str(value["uncertainty"])
        return text if width == "0" else f"{text} ± {width}"
    if isinstance(value, dict):
        return ", ".join(f"{name} {_said(entry)}" for name, entry in value.items())
    if isinstance(value, list):
        return "; ".join(_said(entry) for entry in value)
    if isinstance(value, bool | None):
        return {True: "yes", False: "no", None: "unknown"}[value]
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _brief(value: Any) -> Any:
    """Data for JSON with its long lists cut down to their ends, and rows of a matrix beside each other."""
    if _measured(value) and value["uncertainty"] == "0" and len(value["value"]) > _LONGEST:
        return f"{value['value'][:_LONGEST]}…"  # a double has up to 50 digits
    if isinstance(value, dict):
        return {name: _brief(entry) for name, entry in value.items()}
    if not isinstance(value, list):
        return value
    if len(value) > _MOST_ENTRIES:
        return f"{len(value)}, from {_said(_brief(value[0]))} to {_said(_brief(value[-1]))}"
    shorter = [_brief(entry) for entry in value]
    if not any(isinstance(entry, list) for entry in shorter):
        return shorter
    return "; ".join(", ".join(map(_said, entry)) if isinstance(entry, list) else _said(entry) for entry in shorter)
