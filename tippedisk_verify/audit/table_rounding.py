"""Disks that round to Table 1, and which printed numbers one of them gives.

Table tab:dim_mass gives r, e, m, A and B to half a unit of the last digit. g is not printed and lies in [9.80, 9.82];
mu and epsilon are choices and exact. Such disks are the points of a box. A closed form is evaluated in interval
arithmetic (mpmath's ``iv``, which rounds outwards), so its interval over a box holds the numbers of all disks there.

Let [c, d] be the numbers that round to a decimal. Some disk gives it if one corner of the box has a number of at
least c and one a number of at most d: closed forms are continuous on the box, where B > m e^2. No disk gives it if
the box can be cut into parts whose intervals all miss [c, d].
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from decimal import Decimal
from fractions import Fraction
from itertools import product
from typing import Any

from mpmath import iv

from tippedisk_verify.audit.claims import Audit
from tippedisk_verify.model.exact import quotient
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import PRINTED, Constants, Parameters
from tippedisk_verify.theory import harmonic_balance
from tippedisk_verify.theory.equilibria import stiff_eigenvalue_estimate
from tippedisk_verify.theory.hopf import omega_crit, period_crit

__all__ = [
    "CLOSED_FORMS",
    "Box",
    "Formula",
    "closed_form",
    "enclosed",
    "inside_table",
    "noted",
    "rounding_box",
    "some_set_gives",
]

_TABLE = {"r": "0.045", "e": "2.5e-3", "m": "0.435", "A": "0.249e-3", "B": "0.227e-3"}
_GRAVITY = Fraction("9.80"), Fraction("9.82")  # m/s^2
_MOST_PARTS = 2000

Box = Mapping[str, tuple[Fraction, Fraction]]
Formula = Callable[[Constants], Any]  #: of constants that are intervals; continuous

#: The printed closed forms by claim, of constants that are intervals. Each constant stands as rarely as can be.
CLOSED_FORMS: Mapping[str, Formula] = {
    "omega_crit": lambda p: iv.sqrt((p.r + p.e) ** 2 * p.g / (p.r * p.b)),
    "period_crit": lambda p: 2 * iv.pi / iv.sqrt(p.e * (p.r + p.e) * p.g / (p.r * p.b)),
    "lambda_3": lambda p: -p.k * (p.r + p.e) ** 2 / p.b,
    "chi": lambda p: p.r * (p.A - p.Bbar) - 2 * p.e * p.A + p.Bbar * (p.e / 2 - p.e**2 / (p.r + p.e)),
}


#: The same as numbers of one set, to so many digits.
_NUMBERS: dict[str, Callable[[Parameters, int], Measured]] = {
    "omega_crit": omega_crit,
    "period_crit": period_crit,
    "lambda_3": lambda parameters, digits: Measured(stiff_eigenvalue_estimate(parameters), Fraction(0)),
    "chi": lambda parameters, digits: Measured(harmonic_balance.chi(parameters.rational(), "printed"), Fraction(0)),
}


def closed_form(name: str) -> Callable[[Audit, str], Measured]:
    """The number that a claim prints, of a set."""
    return lambda audit, set_name: _NUMBERS[name](audit.sets[set_name], max(audit.digits, 12))


def rounding_interval(printed: str) -> tuple[Fraction, Fraction]:
    """The least and the greatest number that round to the decimal."""
    half = Fraction(10) ** int(Decimal(printed).as_tuple().exponent) / 2
    return Fraction(printed) - half, Fraction(printed) + half


def rounding_box() -> Box:
    """The interval of r, e, m, A, B and g [SI units] of the disks that round to the table."""
    return {name: rounding_interval(text) for name, text in _TABLE.items()} | {"g": _GRAVITY}


def inside_table(parameters: Parameters) -> bool:
    """Whether each tabled quantity rounds to what the table prints, and g lies in [9.80, 9.82]."""
    return all(low <= getattr(parameters, name) <= high for name, (low, high) in rounding_box().items())


def enclosed(formula: Formula, box: Box) -> Any:
    """An interval that holds the formula's number of every disk of a box, with mu and epsilon as printed."""
    r, e, m, A, B, g = (_interval(*box[name]) for name in ("r", "e", "m", "A", "B", "g"))
    mu, epsilon = (quotient(iv, value) for value in (PRINTED.mu, PRINTED.epsilon))
    traction = mu * g
    return formula(
        Constants(r, e, m, A, B, B - m * e**2, g, mu, epsilon, A / m, B / m - e**2, traction / epsilon, traction)
    )


def some_set_gives(formula: Formula, printed: str) -> bool | None:
    """Whether a disk that rounds to the table gives a number that rounds to the decimal; None if that stays open."""
    (least, greatest), box = (quotient(iv, end) for end in rounding_interval(printed)), rounding_box()
    corners = (zip(box, ends, strict=True) for ends in product(*box.values()))
    numbers = [enclosed(formula, {name: (end, end) for name, end in corner}) for corner in corners]
    if any(x >= least for x in numbers) and any(x <= greatest for x in numbers):
        return True
    parts = deque([box])
    for _ in range(_MOST_PARTS):
        if not parts:
            return False
        part = parts.popleft()
        whole = enclosed(formula, part)
        if whole < least or whole > greatest:
            continue
        widest = max(part, key=lambda name: (part[name][1] - part[name][0]) / part[name][0])
        low, high = part[widest]
        parts += [{**part, widest: (low, (low + high) / 2)}, {**part, widest: ((low + high) / 2, high)}]
    return None


def noted(claim: str, note: str, mended: str = "") -> Callable[[str], str]:
    """A claim's note and what the table's rounding can do: ``mended`` if a set inside it gives what is printed."""

    def said(printed: str) -> str:
        found = some_set_gives(CLOSED_FORMS[claim], printed)
        rest = {True: mended, False: "no set inside Table 1's rounding gives this", None: ""}[found]
        return "; ".join(filter(None, (note, rest)))

    return said


def _interval(low: Fraction, high: Fraction) -> Any:
    return iv.mpf([quotient(iv, low).a, quotient(iv, high).b])
