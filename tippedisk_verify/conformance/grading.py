"""Counting the digits of answers: how far from the truth, relative to what size, and whether that is a failure."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation, localcontext
from fractions import Fraction
from statistics import median
from typing import Any

from tippedisk_verify.conformance.sheet import Answers, placed
from tippedisk_verify.errors import InputError
from tippedisk_verify.files import printable
from tippedisk_verify.model.measured import Bounded
from tippedisk_verify.reference_values.store import Quantity, Reading, Store, reference

__all__ = [
    "FAILS_BELOW",
    "LEVEL_NAMES",
    "TOLERANCES",
    "Grade",
    "LevelGrade",
    "QuantityGrade",
    "answer_text",
    "as_decimal",
    "by_quantity",
    "compare",
    "digits_between",
    "graded",
    "levels_of",
    "needed",
    "scale_of",
]

#: Digits that an answer must have at each level: what a careful implementation in doubles passes easily and a wrong
#: equation does not reach by chance.
FAILS_BELOW = {1: 10, 2: 8, 3: 8, 4: 8, 5: 8, 6: 4, 7: 6, 8: 6, 9: 4, 10: 6}
LEVEL_NAMES = {
    1: "right-hand side", 2: "equilibria", 3: "Hopf point", 4: "harmonic balance", 5: "slow manifold",
    6: "trajectories", 7: "limit cycles", 8: "heteroclinic connection", 9: "near the connection",
    10: "rotating cycles",
}  # fmt: skip
# Angles and speeds are told from zero by their own size where they pass through it.
_UNIT_SIZED = ("beta", "gamma", "v", "crossing_gamma", "crossing_v", "lambda_", "log_multiplier_slow")
_PRECISION = 140  # digits of the arithmetic; Omega_h has 102
_ROUNDING = 2.0**-52
_SOME = 1.0  # digits that even rounded inputs must leave
#: The relative change of all inputs together whose effect no level holds against an answer. Closed forms in doubles
#: leave ten thousand roundings below 1e-12. What an integrator leaves was measured at rtol = atol = 1e-12 and 1e-13 on
#: all orbits and librating cycles of the printed set: at most 5.3e-11 with SciPy's LSODA, 5.0e-11 with DOP853.
TOLERANCES = {level: 1e-12 if level < 6 else 1e-10 for level in FAILS_BELOW}
_LEAST = 0.3  # digits that every question asks for: the value to within its half
_FEW = 0.5  # share of the digits needed that makes an answer imprecise rather than wrong


@dataclass(frozen=True, slots=True)
class Grade:
    """One answer against the truth for what it was computed from."""

    id: str
    level: int
    reading: str
    answer: str
    digits: float  #: -log10 of the error relative to `scale_of`; at most what the reference itself has
    verdict: str  #: exact, agrees, rounding, few-digits, wrong, not-a-number, unreadable, no-truth
    truth: str = ""
    note: str = ""
    needs: float = math.nan  #: digits that the question asks for
    off: float = math.nan  #: the error as a relative change of all inputs together

    @property
    def failed(self) -> bool:
        return self.verdict in ("few-digits", "wrong", "not-a-number", "unreadable")

    def shortfall(self, wanted: float) -> str:
        """In one line how it falls short of ``wanted`` digits."""
        short = f"{self.digits:.1f} digits, not {wanted:.3g}; the truth is {self.truth}"
        return f"{self.id} = {self.answer[:40]}: {short if math.isfinite(self.digits) else self.note}"

    def json(self) -> dict[str, Any]:
        entry = {
            "id": self.id,
            "level": self.level,
            "from": self.reading,
            "digits": round(self.digits, 1) if math.isfinite(self.digits) else None,
            "verdict": self.verdict,
            "answer": self.answer[:120],
            "truth": self.truth,
            **({} if math.isnan(self.needs) else {"needs": round(self.needs, 1)}),
        }
        return entry | ({"note": self.note} if self.note else {})


@dataclass(frozen=True)
class LevelGrade:
    """The answers of one level."""

    level: int
    asked: int
    answered: int
    least: float  #: digits; NaN where no answer is a number
    middle: float  #: median of the digits
    failed: int
    rounded: int = 0  #: answers as far off as rounding the inputs explains
    few: int = 0  #: of the failed ones, those with too few digits only

    @property
    def name(self) -> str:
        return LEVEL_NAMES[self.level]

    @property
    def verdict(self) -> str:
        if not self.answered:
            return "not answered"
        return "agrees" if not self.failed else "too few digits" if self.few == self.failed else "fails"

    def json(self) -> dict[str, Any]:
        return {
            "level": self.level,
            "name": self.name,
            "asked": self.asked,
            "answered": self.answered,
            "least_digits": None if math.isnan(self.least) else round(self.least, 1),
            "median_digits": None if math.isnan(self.middle) else round(self.middle, 1),
            "failed": self.failed,
            "too_few_digits": self.few,
            "rounding": self.rounded,
        }


@dataclass(frozen=True)
class QuantityGrade:
    """The answers for one quantity at one level, under one friction law."""

    level: int
    quantity: str  #: without its place: beta stands for beta@0.5 as well
    friction: str
    answered: int
    failed: int
    few: int  #: of the failed ones, those with too few digits only
    least: float  #: digits; NaN where no answer is a number

    def json(self) -> dict[str, Any]:
        return {
            "level": self.level,
            "quantity": self.quantity,
            "friction": self.friction,
            "answered": self.answered,
            "failed": self.failed,
            "too_few_digits": self.few,
            "least_digits": None if math.isnan(self.least) else round(self.least, 1),
        }


def scale_of(quantity: Quantity, value: Decimal) -> Decimal:
    """What an error is measured against: the value's size.

    At level 1 the largest condition number, if that is larger: it is the size of what cancelled. For angles, angular
    velocities and eigenvalues at least 1 in their unit.
    """
    size = abs(value)
    if quantity.level == 1:
        return max([size, *(abs(Decimal(slope)) for slope in quantity.condition.values())])
    if quantity.level == 2 or placed(quantity.name)[0].startswith(_UNIT_SIZED):
        return max(size, Decimal(1))
    return size


def digits_between(answer: Decimal, truth: Decimal, scale: Decimal, most: float = math.inf) -> float:
    """-log10(|answer - truth| / scale), between -99 and ``most``."""
    away = abs(answer - truth)
    if not away:
        return most
    if not scale:
        return 0.0
    share = away / scale
    near = share.adjusted() + math.log10(float(share.scaleb(-share.adjusted())))
    return min(max(0.0 - near, -99.0), most)


_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eEdD][+-]?\d{1,9})?|[+-]?(nan|inf(inity)?)", re.ASCII | re.IGNORECASE)


def as_decimal(text: str) -> Decimal:
    """The number that an answer says; Fortran's exponents too. Raises decimal.InvalidOperation."""
    if not _NUMBER.fullmatch(text):
        raise InvalidOperation
    if text.lstrip("+-")[:1] in "nNiI":
        return Decimal(text)
    return Decimal(text.replace("d", "e").replace("D", "e"))


def graded(answers: Answers, store: Store) -> list[Grade]:
    """A grade for each answer, in the order of the questions."""
    with localcontext() as context:
        context.prec = _PRECISION
        context.Emax, context.Emin = 10**9, -(10**9)
        return [_grade(quantity, *answers.given[id_]) for id_, quantity in store.items() if id_ in answers.given]


def _grade(quantity: Quantity, reading: str, text: str) -> Grade:
    def failed(verdict: str, note: str) -> Grade:
        return Grade(quantity.id, quantity.level, reading, text, -math.inf, verdict, note=note, needs=needs)

    needs = needed(quantity)
    try:
        answer = as_decimal(text)
    except InvalidOperation:
        return failed("unreadable", "not a decimal number")
    if not answer.is_finite() or (answer and abs(answer.adjusted()) > 100_000):
        return failed("not-a-number", "not a finite number")
    told = quantity.values.get(reading)  # type: ignore[call-overload]
    if told is None:
        return Grade(
            quantity.id, quantity.level, reading, text, math.nan, "no-truth",
            note="doubles cannot tell the inputs apart: compute from the decimals", needs=needs,
        )  # fmt: skip
    truth, uncertainty = Decimal(told[0]), Decimal(told[1])
    scale = scale_of(quantity, truth)
    most = digits_between(truth + uncertainty, truth, scale, 120.0)
    digits = digits_between(answer, truth, scale, most)
    away = abs(answer - truth)
    half_unit = Decimal(5).scaleb(int(answer.as_tuple().exponent) - 1)
    verdict, note = "wrong", ""
    slopes = _slopes(quantity)
    close = digits >= min(most, needs)
    if close and (away <= uncertainty + half_unit or _nearest_double(answer, truth)):
        verdict = "exact"
    elif digits >= needs:
        verdict = "agrees"
    elif digits >= _SOME and away <= slopes * Decimal(_ROUNDING):
        verdict, note = "rounding", "as far off as rounding the inputs to doubles makes it"
    elif digits >= _FEW * needs:
        verdict = "few-digits"
    if reading == "decimals" and verdict != "exact" and "doubles" in quantity.values:
        other, width = (Decimal(part) for part in quantity.values["doubles"])
        if abs(answer - other) <= width + half_unit:
            note = "the exact answer from doubles: the inputs were rounded"
    off = float(away / slopes) if slopes else math.nan
    return Grade(quantity.id, quantity.level, reading, text, digits, verdict, told[0], note, needs, off)


def _nearest_double(answer: Decimal, truth: Decimal) -> bool:
    """Whether a double has no better answer: its seventeenth digit is not always the truth's."""
    return 16 <= len(answer.as_tuple().digits) <= 17 and float(answer) == float(truth)


def _slopes(quantity: Quantity) -> Decimal:
    return sum((abs(Decimal(slope)) for slope in quantity.condition.values()), Decimal(0))


def needed(quantity: Quantity) -> float:
    """Digits that an answer must have: its level's, or what `TOLERANCES` leaves of them.

    Where doubles cannot tell the inputs apart, only programs with more digits are asked, and asked for the level's.
    """
    digits = float(FAILS_BELOW[quantity.level])
    scale = scale_of(quantity, Decimal(quantity.values["decimals"][0]))
    condition = float(_slopes(quantity) / scale) if scale else 0.0
    if "doubles" in quantity.values and condition:
        digits = max(min(digits, -math.log10(condition * TOLERANCES[quantity.level])), _LEAST)
    return digits


def levels_of(grades: Iterable[Grade], asked: Iterable[Quantity]) -> list[LevelGrade]:
    """The grades by level, for all levels that were asked."""
    counts: dict[int, int] = {}
    for quantity in asked:
        counts[quantity.level] = counts.get(quantity.level, 0) + 1
    by_level: dict[int, list[Grade]] = {level: [] for level in counts}
    for grade in grades:
        if grade.verdict != "no-truth":
            by_level.setdefault(grade.level, []).append(grade)
    levels = []
    for level in sorted(by_level):
        here = by_level[level]
        digits = [grade.digits for grade in here if math.isfinite(grade.digits)]
        levels.append(
            LevelGrade(
                level=level,
                asked=counts.get(level, len(here)),
                answered=len(here),
                least=min(digits, default=math.nan),
                middle=median(digits) if digits else math.nan,
                failed=sum(grade.failed for grade in here),
                few=sum(grade.verdict == "few-digits" for grade in here),
                rounded=sum(grade.verdict == "rounding" for grade in here),
            )
        )
    return levels


def by_quantity(grades: Iterable[Grade]) -> list[QuantityGrade]:
    """The grades by level, quantity and friction law, in the order of the questions."""
    groups: dict[tuple[int, str, str], list[Grade]] = {}
    for grade in grades:
        if grade.verdict != "no-truth":
            _, friction, _, _, name = grade.id.split("/", 4)
            plain, place = placed(name)
            groups.setdefault(
                (grade.level, re.sub(r"_\d+$", "", plain) if "order" in place else plain, friction), []
            ).append(grade)
    return [
        QuantityGrade(
            *key,
            answered=len(here),
            failed=sum(grade.failed for grade in here),
            few=sum(grade.verdict == "few-digits" for grade in here),
            least=min((grade.digits for grade in here if math.isfinite(grade.digits)), default=math.nan),
        )
        for key, here in sorted(groups.items(), key=lambda item: item[0][0])
    ]


def compare(id_: str, answer: object, *, reading: Reading = "doubles") -> Grade:
    """The grade of one answer: a number of any kind or a decimal string. ``reading`` is what it was computed from.

    Of a number with a half-width the value is graded; an array of one element stands for that element. Raises
    InputError for an unknown id or something that is not a number.
    """
    quantity = reference(id_)
    if reading not in ("decimals", "doubles"):
        raise InputError(f"an answer is computed from decimals or doubles, not from '{reading!s:.40}'")
    text = answer_text(answer)
    with localcontext() as context:
        context.prec = _PRECISION
        return _grade(quantity, reading, text)


def answer_text(answer: Any) -> str:
    """An answer as the decimal that it stands for. Raises InputError for what is not one real number."""
    if isinstance(answer, str):
        text = answer.strip()[:2_001]
        if len(text) > 2_000 or not _NUMBER.fullmatch(text):
            raise InputError(f"an answer is a number or a decimal string, not '{printable(text)[:40]}'")
        return text
    if hasattr(answer, "flat"):  # NumPy takes an array of one element as a number in most places
        if answer.size != 1:
            raise InputError(f"an answer is one number, not an array of {answer.size}")
        answer = answer.flat[0]
    if isinstance(answer, Bounded):
        answer = answer.value
    if answer is None or isinstance(answer, bool | complex):
        raise InputError(f"an answer is a real number, not {answer}")
    if isinstance(answer, float):
        return repr(float(answer))
    if isinstance(answer, int | Decimal):
        return str(Decimal(answer))
    from tippedisk_verify.model.exact import fraction, mantissa_exponent

    if not isinstance(answer, Fraction) and mantissa_exponent(answer) is None:
        return "nan"  # an infinity or NaN of another kind of number
    value = fraction(answer)
    with localcontext() as context:
        context.prec = _PRECISION
        return str(Decimal(value.numerator) / value.denominator)
