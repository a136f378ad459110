"""Disks drawn from a seed, the same on every machine because their decimals come from SHA-256.

A drawn disk is the parameter set ``fresh-SEED-NUMBER``, so a question's id determines all its
inputs.
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from functools import lru_cache

from tippedisk_verify.disk import Disk
from tippedisk_verify.errors import InputError
from tippedisk_verify.model.parameters import SYMBOLS
from tippedisk_verify.numbers.decimals import decimal_arithmetic

__all__ = ["DRAWN_SET", "Draw", "decimal_text", "disk_of", "drawn_disk"]

#: The name of a drawn set: its seed and its number.
DRAWN_SET = re.compile(r"fresh-(0|[1-9][0-9]{0,8})-([1-9][0-9]{0,2})")
# Least value, greatest value (SI units) and decimal places. A follows from `_INERTIA_FACTOR` below.
_RANGES = {
    "r": ("0.038", "0.052", 4),
    "m": ("0.3", "0.6", 3),
    "B": ("0.00019", "0.00027", 6),
    "g": ("9.78", "9.83", 3),
    "mu": ("0.2", "0.45", 3),
    "epsilon": ("0.06", "0.16", 3),
}
_ECCENTRICITY = ("0.04", "0.07")  # e / r
# A / Bbar, divided by the least ratio for which the cycles born at Omega_crit are stable. Close
# to 1 their family turns round in a fold.
_INERTIA_FACTOR = ("1.05", "1.12")


@dataclass(frozen=True)
class Draw:
    """The decimals that a seed and a number determine, for a disk drawn at random.

    A decimal comes from the first twelve hexadecimal digits of the SHA-256 of ``SEED/NUMBER/NAME``.
    """

    seed: int
    number: int

    def unit_fraction(self, name: str) -> Fraction:
        """Return the random rational number in [0, 1) that belongs to a name."""
        text = f"{self.seed}/{self.number}/{name}"
        return Fraction(int(hashlib.sha256(text.encode()).hexdigest()[:12], 16), 16**12)

    def decimal_between(self, name: str, low: object, high: object, places: int) -> str:
        """Return the random decimal between `low` and `high` that belongs to a name.

        It has at most `places` decimal places.
        """
        ends = [Fraction(str(end)) for end in (low, high)]
        return decimal_text(ends[0] + self.unit_fraction(name) * (ends[1] - ends[0]), places)


@lru_cache(maxsize=4096)
def drawn_disk(seed: int, number: int) -> Disk:
    """Return the random disk that a seed and a number determine.

    Its limit cycles are born stable at Omega_crit, as the paper's are. Table 1 lies among these
    disks.
    """
    draw = Draw(seed, number)
    values = {name: draw.decimal_between(name, *bounds) for name, bounds in _RANGES.items()}
    r, m, B = (Fraction(values[name]) for name in ("r", "m", "B"))
    low, high = (r * Fraction(share) for share in _ECCENTRICITY)
    values["e"] = draw.decimal_between("e", low, high, 5)
    e = Fraction(values["e"])
    least = r * (2 * r - e) / (2 * (r + e) * (r - 2 * e)) * (B - m * e**2)
    low, high = (least * Fraction(ratio) for ratio in _INERTIA_FACTOR)
    values["A"] = draw.decimal_between("A", low, high, 7)
    return Disk(**{name: values[name] for name in SYMBOLS}, name=f"fresh-{seed}-{number}")  # type: ignore[arg-type]


def disk_of(set_name: str) -> Disk:
    """Return the disk of a parameter set, drawn or named.

    Raises:
        InputError: If there is no such set.
    """
    if (drawn := DRAWN_SET.fullmatch(set_name)) is not None:
        return drawn_disk(int(drawn[1]), int(drawn[2]))
    if set_name.startswith("fresh-"):
        raise InputError(
            f"'{set_name[:40]}' is not a drawn set: the name is fresh-SEED-NUMBER, "
            f"such as fresh-7-1"
        )
    return Disk(set_name)


def decimal_text(value: Fraction, places: int) -> str:
    """Return a rational number rounded to at most `places` decimal places, as a text without an
    exponent.
    """
    with decimal_arithmetic(400):
        return format((Decimal(round(value * 10**places)) / Decimal(10) ** places).normalize(), "f")
