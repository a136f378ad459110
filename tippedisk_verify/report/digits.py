"""Which digits of a computed number agree with the printed one, and which its uncertainty leaves open."""

from __future__ import annotations

from decimal import Decimal, InvalidOperation
from fractions import Fraction
from itertools import groupby, takewhile

__all__ = ["agreed_digits", "decimal_of", "marked", "shortened"]


def decimal_of(text: str) -> Decimal | None:
    """The number that the text is, if it is nothing but a finite number."""
    try:
        value = Decimal(text)
    except InvalidOperation:
        return None
    return value if value.is_finite() else None


def _first_difference(value: Decimal, printed: Decimal) -> tuple[int, int]:
    """(first place where they differ, last place printed): powers of ten; the former is one below the latter if equal.

    The value is rounded to the printed places first.
    """
    last = int(printed.as_tuple().exponent)
    mine, theirs = (round(Fraction(number) / Fraction(10) ** last) for number in (value, printed))
    digits = max(len(str(abs(mine))), len(str(abs(theirs))))
    texts = (f"{number:+0{digits + 1}d}" for number in (mine, theirs))  # with the sign before
    same = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(*texts, strict=True)))
    return last + digits - same, last


def _rounds_up(value: Decimal, last: int) -> bool:
    """Whether rounding to that place changes the digits before it."""
    size = abs(Fraction(value)) / Fraction(10) ** last
    return round(size) > size


def agreed_digits(value: str, printed: str) -> tuple[int, int] | None:
    """(significant digits that agree, significant digits printed), or None if one of them is no number."""
    mine, theirs = decimal_of(value), decimal_of(printed)
    if mine is None or theirs is None or not theirs:
        return None
    place, last = _first_difference(mine, theirs)
    top = theirs.adjusted()
    return max(0, min(top - place, top - last + 1)), top - last + 1


def marked(value: str, uncertainty: str, printed: str = "") -> list[tuple[str, str]]:
    """The value's text in pieces, each with what it is.

    ``agreed``: agrees with the printed number to its places, after rounding (with the digit that rounds up, if it
    does); ``differs``: the places from where it leaves it; ``beyond``: places that are not printed; ``open``: places at
    or below the uncertainty's leading one.
    """
    mine, theirs, width = map(decimal_of, (value, printed, uncertainty))
    if mine is None:
        return [("beyond", value)]
    difference, last = (0, 0) if theirs is None else _first_difference(mine, theirs)
    # Where rounding goes up, the next digit is what says so: it goes with the last place that is printed.
    end = last - _rounds_up(mine, last)

    def against_printed(place: int) -> str:
        if theirs is None or place < end:
            return "beyond"
        return "agreed" if max(place, last) > difference else "differs"

    mantissa, _, exponent = value.partition("e")
    place = len(mantissa.lstrip("-").partition(".")[0]) + int(exponent or 0)
    kinds: list[tuple[str, str]] = []
    for character in mantissa:
        if character.isdigit():
            place -= 1
            kind = "open" if width and place <= width.adjusted() else against_printed(place)
        else:
            kind = kinds[-1][0] if kinds else against_printed(place)
        kinds.append((kind, character))
    pieces = [(kind, "".join(text for _, text in run)) for kind, run in groupby(kinds, key=lambda pair: pair[0])]
    if exponent:
        pieces.append(("agreed" if theirs is not None and pieces[0][0] == "agreed" else "beyond", f"e{exponent}"))
    return pieces


def shortened(value: str, uncertainty: str, printed: str = "", longest: int = 24) -> list[tuple[str, str]]:
    """`marked`, with digits left out (before the exponent, if there is one) where it has more characters."""
    pieces = marked(value, uncertainty, printed)
    tail = [pieces.pop()] if pieces[-1][1].startswith("e") else []
    shown, left = [], longest - sum(len(text) for _, text in tail)
    for kind, text in pieces:
        if left > 0:
            shown.append((kind, text[:left]))
        left -= len(text)
    return [*shown, *([("beyond", "…")] if left < 0 else []), *tail]
