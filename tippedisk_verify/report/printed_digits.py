"""The comparison of a computed number with the printed one, digit by digit."""

from __future__ import annotations

from decimal import Decimal, InvalidOperation
from fractions import Fraction
from itertools import takewhile

__all__ = ["printed_digits_reached", "split_at_agreement"]


def printed_digits_reached(value: str, printed: str) -> tuple[int, int] | None:
    """Count the digits in which two decimals agree, after rounding the first to the second's last
    place.

    Args:
        value: The computed decimal.
        printed: The printed decimal.

    Returns:
        The significant digits that agree and those printed, or None if a text is not a number.
    """
    try:
        computed, claimed = Decimal(value), Decimal(printed)
    except InvalidOperation:
        return None
    if not (computed.is_finite() and claimed.is_finite() and claimed):
        return None
    place = Fraction(10) ** int(claimed.as_tuple().exponent)
    texts = [f"{round(Fraction(number) / place):+d}" for number in (computed, claimed)]
    pairs = zip(*texts, strict=False) if len(texts[0]) == len(texts[1]) else iter(())
    same = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], pairs))  # counts the sign too
    return max(0, same - 1), len(texts[1]) - 1


def split_at_agreement(value: str, printed: str = "", longest: int = 24) -> tuple[str, str]:
    """Split a number's text into the digits that agree with the printed ones, and the rest.

    Args:
        value: The computed decimal.
        printed: The printed decimal.
        longest: The maximum number of characters to show; a longer mantissa is cut.
    """
    mantissa, e, power = value.partition("e")
    left = longest - len(e + power)
    shown = mantissa if len(mantissa) <= left else f"{mantissa[:left]}…"
    agreed, _ = printed_digits_reached(value, printed) or (0, 0)
    end = len(shown) - len(shown.lstrip("-0.")) if agreed else 0
    while agreed and end < len(shown):
        agreed -= shown[end].isdigit()
        end += 1
    return shown[:end], shown[end:] + e + power
