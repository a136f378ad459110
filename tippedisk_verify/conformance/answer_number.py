"""The number that the text of an answer stands for, or the reason why it is not a number.

`as_decimal` is the only reader. It takes every unambiguous text: decimal numbers with the exponents
of C, Fortran and Mathematica, and every spelling of infinities and NaN. Other texts that programs
and spreadsheets write have a row in `_REASONS`. They are refused with the description in that row.
An answer is written in ASCII characters; the message names any other character.
"""

from __future__ import annotations

import re
import unicodedata
from decimal import Decimal
from functools import cache, lru_cache

from tippedisk_verify.errors import InputError

__all__ = ["as_decimal", "is_missing"]

_MAX_ANSWER = 2_000  # characters of an answer; more than any value has
_SIZE = r"(?:\d+(?:\.\d*)?|\.\d+)"
_MANTISSA = rf"[+-]?{_SIZE}"
_NUMBER = rf"{_MANTISSA}(?:[edq][+-]?\d+)?"
_ANY_TEXT = r"[ -~]*"  # ASCII, so that the rows below leave other characters to be named


@cache
def _pattern(text: str) -> re.Pattern[str]:
    return re.compile(text, re.IGNORECASE | re.ASCII)


_NUMBER_FORMS = (
    _pattern(rf"(?P<mantissa>{_MANTISSA})(?:[edq](?P<exponent>[+-]?\d{{1,9}}))?"),
    # Fortran leaves out the letter before an exponent of three digits.
    _pattern(r"(?P<mantissa>[+-]?(?:\d+\.\d*|\.\d+))(?P<exponent>[+-]\d{3})"),
    # Mathematica's InputForm: a backquote, with the precision behind it or not, and *^ before the
    # exponent.
    _pattern(
        rf"(?P<mantissa>{_MANTISSA})(?:`{{1,2}}{_SIZE}?)?(?:\*\^(?P<exponent>[+-]?\d{{1,9}}))?"
    ),
)
_INFINITE = _pattern(r"(?P<sign>[+-]?)(?:inf(?:inity)?(?:f|16|32|64)?|1\.#(?:inf0*|j)|\.inf)")
# The texts for a missing number: NaN in C's, Microsoft's and Julia's spelling, and other names.
_MISSING = _pattern(
    r"[+-]?[qs]?nan(\([^)]*\)|f|16|32|64)?|[+-]?1\.#(([qs]nan|ind)0*|r|io)|\.nan"
    r"|n/?a|<na>|null|nil|none|nothing|missing|undefined"
)

_VALUE = rf"(?:{_NUMBER}|[+-]?(?:nan|inf(?:inity)?))"
_IMAGINARY = rf"(?:{_SIZE}(?:[edq][+-]?\d+)?|nan|inf(?:inity)?)"
_I = r"(?:im|[ij])"
_MONTH = (
    "(?:jan|feb|f[eé]v|m[aä]r|mrt|apr|abr|avr|ma[iyj]|mei|ju[nliy]|giu|lug|a[uo][gû]|ago|sep|set|o[ckt]t|nov"
    r"|d[eéi][czk])[a-zéû]{0,6}\.?"
)
_UNIT = r"(?:rad(?:ians?)?|deg(?:rees?)?|°|s|sec|seconds?|[mµμu]s|min|hz|rpm|rev|m|[mck]m|kg|g|nm)(?:\^?-?\d)?"
_ALONE = "write the number alone"
_COMPLEX = "a complex number; write its real part"
_DATE = "a date, into which a spreadsheet turns a number; give the cell the format of a number"
_INTERVAL = "an interval or a list of two; write one number"
_LITERAL = "a literal of a programming language; write the digits alone"
_THOUSANDS = "a number with its thousands separated; write the digits alone"
_UNCERTAIN = f"a number with its uncertainty; {_ALONE}"
# Patterns of texts, each with a description and advice. The first row that fits counts.
_REASONS = [
    (
        rf"{_MANTISSA}[edq][+-]?\d{{10,}}",
        "an exponent of more than nine digits; write a number that doubles can hold",
    ),
    (r"\(longer than \d+ characters\)", "more characters than an answer has; write one number"),
    # Dates.
    (rf"\d{{1,4}}[-./ ]*{_MONTH}(?:[-./ ]*\d{{2,4}})?", _DATE),
    (rf"{_MONTH}[-./ ]*\d{{1,4}}(?:[-./, ]+\d{{2,4}})?", _DATE),
    (r"\d{1,4}([-./])\d{1,2}\1\d{1,4}(?:[t ][\d:.z]*)?", _DATE),
    (r"\d{1,2}:\d{2}(?::\d{2}(?:[.,]\d*)?)?(?: ?[ap]m)?", "a time of day; write a number"),
    # Fields without a number.
    (
        r"#+|[+-]?\*+",
        "a field too narrow for its number, as Fortran and spreadsheets show it; make it wider",
    ),
    (r"#[\w/]+[!?]?|err:\d+", "an error of a spreadsheet; mend the cell, or leave it empty"),
    (r"\(?(?:true|false|bool|yes|no|wahr|falsch|vrai|faux)\)?", "a truth value; write a number"),
    (r"\((?:list|dict)\)", "a list or an object of JSON; write one number"),
    # A number with other text, and several numbers.
    (rf"\(?(?:{_VALUE}\s*[+-]\s*)?[+-]?\s*(?:{_IMAGINARY}\s*\*?\s*)?{_I}\s*\)?", _COMPLEX),
    (rf"\(?(?:{_VALUE}\s*[+-]\s*)?[+-]?\s*{_I}\s*\*?\s*{_IMAGINARY}\s*\)?", _COMPLEX),
    (rf"#c\({_ANY_TEXT}\)|{_NUMBER}\s*:\+{_ANY_TEXT}|\(\s*{_VALUE}\s*,\s*{_VALUE}\s*\)", _COMPLEX),
    (rf"[\[(]?\s*{_NUMBER}\s*(?:±|\+/-|\+-|\\pm|pm)\s*{_SIZE}{_ANY_TEXT}", _UNCERTAIN),
    (rf"{_MANTISSA}\s*\(\d+(?:\.\d+)?\)(?:[edq][+-]?\d+)?", _UNCERTAIN),
    (rf"[\[(]\s*{_VALUE}\s*(?:[,;]|\.\.)\s*{_VALUE}\s*[\])]", _INTERVAL),
    (rf"{_NUMBER}\s*\.\.+\s*{_NUMBER}", _INTERVAL),
    (rf"[+-]?\s*{_SIZE}\s*//?\s*{_NUMBER}", "a ratio; write it as a decimal number"),
    (
        rf"(?:{_NUMBER}\s*(?:[x*×·]|\\times|\\cdot)\s*)?10\s*(?:\^|\*\*)\s*[{{(]?\s*[+-]?\d+\s*[}})]?",
        "a power of ten written out; write it with e, as in 3.088e1",
    ),
    (rf"{_NUMBER}\s*(?:%|percent)", "a percentage; write the number in the unit that is asked for"),
    (
        rf"{_NUMBER}\s*[\[(]?(?:1/)?{_UNIT}(?:(?:\s*[*/.]\s*|\s+){_UNIT})*[\])]?",
        f"a number with its unit; {_ALONE}",
    ),
    # Marks between the digits.
    (
        r"[+-]?[1-9]\d{0,2},\d{3}",
        "a comma for decimals or for thousands; write a point, and nothing between thousands",
    ),
    (r"[+-]?(?:\d+,\d*|,\d+)(?:[edq][+-]?\d+)?", "a decimal comma; write a point"),
    (r"[+-]?\d{1,3}(?:[,' _]\d{3})+(?:[.,]\d*)?", _THOUSANDS),
    (r"[+-]?\d{1,3}(?:\.\d{3})+,\d*|[+-]?\d{1,3}(?:\.\d{3}){2,}", _THOUSANDS),
    (
        rf"[+-]?\s*{_SIZE}\s*(?:[edq]\s*[+-]?\s*\d+)?",
        "a number with a space inside; write it without",
    ),
    (rf"{_MANTISSA}[edq][+-]?", "an exponent without its digits; write them"),
    (
        rf"{_MANTISSA}[+-]\d+",
        "a difference, or an exponent without its letter; write it with e, as in 3.088e1",
    ),
    (rf"{_NUMBER}\s*[,;.]+", f"a number with a comma, a semicolon or a point behind it; {_ALONE}"),
    (rf"{_NUMBER}(?:\s*[,;|]\s*|\s+){_NUMBER}{_ANY_TEXT}", "more than one number; write one"),
    # What programming languages write.
    (r"[+-]?0x[0-9a-f]*\.?[0-9a-f]*(?:p[+-]?\d+)?", "a hexadecimal number; write a decimal one"),
    (rf"{_MANTISSA}_?f(?:16|32|64|128)", _LITERAL),
    (rf"{_NUMBER}(?:_\w+|[lu]+)", _LITERAL),
    (
        rf"{_MANTISSA}f(?:[+-]?\d+)?",
        "a number in single precision; compute in double precision, and write e for f",
    ),
    (rf"[bru]?(['\"`]){_ANY_TEXT}\d{_ANY_TEXT}\1", "a number in quotes; write it without"),
    (
        rf"[+-]?[a-z_][\w.:<>]*\s*[\[(]{_ANY_TEXT}[\])]",
        f"how a language shows a number; {_ALONE}, as repr(float(x)) does",
    ),
    (
        rf"[a-z_]\w*\s*(?::=|=>|->|[:=])\s*{_ANY_TEXT}\d{_ANY_TEXT}",
        f"a number with a name before it; {_ALONE}",
    ),
    (rf"[<>~=]+\s*{_ANY_TEXT}\d{_ANY_TEXT}", f"a bound, an estimate or a formula; {_ALONE}"),
    (rf"[\[{{(]{_ANY_TEXT}[\])}}]", f"a list, an array or a number in brackets; {_ALONE}"),
]
# Rows for the remaining texts, after characters beyond ASCII have been named.
_FALLBACK_REASONS = [
    (r"[^\d]*", "no digit in it; write a number, or leave it empty"),
    (rf"{_NUMBER}\s*[^\d\s]{_ANY_TEXT}", f"a number with more behind it; {_ALONE}"),
]


def is_missing(text: str) -> bool:
    """Return True if a text stands for a missing number, such as NaN in any spelling, NA or null.

    Args:
        text: The text of an answer, without space at its ends.
    """
    return _MISSING.fullmatch(text) is not None


@lru_cache(maxsize=4096)
def as_decimal(text: str) -> Decimal:
    """Return the number that the text of an answer stands for, exactly; NaN for a missing number.

    Args:
        text: The text of an answer, without space at its ends.

    Raises:
        InputError: If the text is not a number, with a description of the text and advice.
    """
    if len(text) > _MAX_ANSWER:
        raise InputError("more characters than an answer has; write one number")
    for form in _NUMBER_FORMS:
        if found := form.fullmatch(text):
            return Decimal(f"{found['mantissa']}e{found['exponent'] or 0}")
    if found := _INFINITE.fullmatch(text):
        return Decimal(f"{found['sign']}Infinity")
    if is_missing(text):
        return Decimal("NaN")
    raise InputError(_reason(text))


def _reason(text: str) -> str:
    """Return a description of what is wrong with a text that is not a number, with advice."""
    text = re.sub(" +", " ", text)  # a thousand spaces would have every row tried at each of them
    for row, reason in _REASONS:
        if _pattern(row).fullmatch(text):
            return reason
    strange = next((character for character in text if not " " <= character <= "~"), None)
    if strange is not None:
        name = unicodedata.name(strange, "a control character")
        return f"it has U+{ord(strange):04X}, {name}; write digits, point and signs in ASCII characters"
    return next(
        (reason for row, reason in _FALLBACK_REASONS if _pattern(row).fullmatch(text)),
        "no decimal number; write one",
    )
