"""Numbers that round to a printed decimal: within half a unit of its last digit, both ends included."""

from __future__ import annotations

from collections.abc import Mapping
from decimal import Decimal
from fractions import Fraction
from typing import Any

from tippedisk_verify.certified.balls import ball
from tippedisk_verify.errors import Shortfall

__all__ = ["TABLE", "Box", "decided", "meets", "rounding_box", "rounding_interval", "rounds_to"]

#: Table tab:dim_mass, as printed.
TABLE = {"r": "0.045", "e": "2.5e-3", "m": "0.435", "A": "0.249e-3", "B": "0.227e-3"}

Box = Mapping[str, tuple[Fraction, Fraction]]


def rounding_interval(printed: str) -> tuple[Fraction, Fraction]:
    """The closed interval of the numbers that round to the decimal."""
    half = Fraction(10) ** int(Decimal(printed).as_tuple().exponent) / 2
    return Fraction(printed) - half, Fraction(printed) + half


def rounding_box(table: Mapping[str, str] = TABLE) -> dict[str, tuple[Fraction, Fraction]]:
    """The interval of each tabled quantity."""
    return {name: rounding_interval(text) for name, text in table.items()}


def rounds_to(value: Any, printed: str) -> bool | None:
    """Whether every number of a ball rounds to the decimal; False if none does, None if the ball cannot tell."""
    low, high = map(ball, rounding_interval(printed))
    if value >= low and value <= high:
        return True
    return False if value < low or value > high else None


def meets(least: Any, greatest: Any, printed: str) -> bool:
    """Whether some number from the one ball to the other rounds to the decimal. Raises Shortfall if that is open."""
    low, high = map(ball, rounding_interval(printed))
    if greatest < low or least > high:
        return False
    if greatest > low and least < high:
        return True
    raise Shortfall(f"{printed} lies too close to the end of what the table allows")


def decided(answer: bool | None) -> bool:
    """The answer. Raises Shortfall if there is none."""
    if answer is None:
        raise Shortfall("a number lies too close to a rounding boundary")
    return answer
