"""The grading of answers in digits: the correct digits of each answer, and the verdict.

The scale of an error and the digits required are in `reference_values.grading_rules`."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from statistics import median
from typing import Any

from tippedisk_verify.conformance.answer_number import as_decimal
from tippedisk_verify.conformance.sheet import Answers
from tippedisk_verify.display import Printable
from tippedisk_verify.errors import InputError
from tippedisk_verify.numbers.decimals import decimal_arithmetic
from tippedisk_verify.numbers.exact import fraction, is_one_of, plain_number
from tippedisk_verify.reference_values.grading_rules import (
    ROUNDING_CHANGE,
    digits_needed,
    scale_of,
    split_name,
    worst_case_sensitivity,
)
from tippedisk_verify.reference_values.lookup import reference
from tippedisk_verify.reference_values.store import (
    Reading,
    ReferenceValue,
    is_optional,
    optional_ids_of_state,
)
from tippedisk_verify.support.files import printable

__all__ = [
    "LEVEL_NAMES",
    "Grade",
    "Tally",
    "agreeing_digits",
    "answer_text",
    "compare",
    "grade_answers",
    "tally_levels",
    "tally_quantities",
]

LEVEL_NAMES = {
    1: "right-hand side",
    2: "equilibria",
    3: "Hopf point",
    4: "harmonic balance",
    5: "slow manifold",
    6: "trajectories",
    7: "limit cycles",
    8: "heteroclinic connection",
    9: "near the connection",
    10: "rotating cycles",
}
_MIN_DIGITS = 1.0  # digits that even rounded inputs must leave
# The largest power of ten of an answer; arithmetic with larger ones takes long
_MAX_EXPONENT = 100_000
# The share of the digits needed from which on an answer is imprecise rather than wrong.
_IMPRECISE_SHARE = 0.5


@dataclass(frozen=True, slots=True, repr=False)
class Grade(Printable):
    """The grade of one answer: its comparison with the truth for the inputs from which it was
    computed.
    """

    id: str
    level: int
    reading: str
    answer: str
    #: -log10 of the error relative to `scale_of`; at most the digits of the reference itself.
    #: Without a truth for the reading, the error is that from the decimals' truth.
    digits: float
    verdict: str  #: exact, agrees, rounding, few-digits, wrong, not-a-number, unreadable, no-truth
    truth: str = ""
    note: str = ""
    required_digits: float = math.nan  #: digits that the question requires
    input_change: float = math.nan  #: the error as a relative change of all inputs together

    @property
    def failed(self) -> bool:
        return self.verdict in ("few-digits", "wrong", "not-a-number", "unreadable")

    def shortfall(self, wanted: float) -> str:
        """Return one line of text about an answer with fewer than the ``wanted`` digits: how many
        it has, and the truth.

        For an answer that is not a number it has the reason.
        """
        short = f"{self.digits:.1f} digits, not {wanted:.3g}; the truth is {self.truth}"
        return (
            f"{self.id} = {self.answer[:40]}: {short if math.isfinite(self.digits) else self.note}"
        )

    def to_dict(self) -> dict[str, Any]:
        entry = {
            "id": self.id,
            "level": self.level,
            "from": self.reading,
            "digits": round(self.digits, 1) if math.isfinite(self.digits) else None,
            "verdict": self.verdict,
            "answer": self.answer[:120],
            "truth": self.truth,
            **(
                {}
                if math.isnan(self.required_digits)
                else {"needs": round(self.required_digits, 1)}
            ),
        }
        return entry | ({"note": self.note} if self.note else {})


@dataclass(frozen=True, repr=False)
class Tally(Printable):
    """A count of grades: of the answers of one level, or of those to one quantity of a level under
    one friction law.
    """

    level: int
    asked: int
    answered: int
    failed: int
    too_few_digits: int  #: failed answers that only have too few digits
    within_rounding: int  #: answers with an error that rounding the inputs explains
    not_numbers: int  #: failed answers that are not numbers
    least_digits: float  #: the least digits of the numbers; NaN if no answer is a number
    median_digits: float  #: the median of the digits
    quantity: str = ""  #: the quantity without its place: beta stands for beta@0.5 as well
    friction: str = ""

    @classmethod
    def of(
        cls, grades: Sequence[Grade], level: int, asked: int, quantity: str = "", friction: str = ""
    ) -> Tally:
        """Count the grades of a level or of one quantity.

        Args:
            grades: The grades.
            level: Their level.
            asked: The number of questions.
            quantity: The quantity without its place; "" for a level.
            friction: The friction law; "" for a level.
        """
        digits = [grade.digits for grade in grades if math.isfinite(grade.digits)]
        return cls(
            level=level,
            asked=asked,
            answered=len(grades),
            failed=sum(grade.failed for grade in grades),
            too_few_digits=sum(grade.verdict == "few-digits" for grade in grades),
            within_rounding=sum(grade.verdict == "rounding" for grade in grades),
            not_numbers=sum(grade.digits == -math.inf for grade in grades),
            least_digits=min(digits, default=math.nan),
            median_digits=median(digits or [math.nan]),
            quantity=quantity,
            friction=friction,
        )

    @property
    def name(self) -> str:
        return LEVEL_NAMES[self.level]

    @property
    def verdict(self) -> str:
        """The verdict on this level or quantity, in words.

        It is *partial* if nothing failed, and some questions were left out.
        """
        if not self.answered:
            return "not answered"
        if self.failed:
            return "too few digits" if self.too_few_digits == self.failed else "fails"
        return "agrees" if self.answered == self.asked else "partial"

    def to_dict(self) -> dict[str, Any]:
        least, middle = (
            None if math.isnan(digits) else round(digits, 1)
            for digits in (self.least_digits, self.median_digits)
        )
        counts = {"failed": self.failed, "too_few_digits": self.too_few_digits}
        if self.quantity:
            about = {"level": self.level, "quantity": self.quantity, "friction": self.friction}
            return about | {"answered": self.answered} | counts | {"least_digits": least}
        about = {
            "level": self.level,
            "name": self.name,
            "asked": self.asked,
            "answered": self.answered,
        }
        return (
            about
            | {"least_digits": least, "median_digits": middle}
            | counts
            | {"rounding": self.within_rounding}
        )


def agreeing_digits(
    answer: Decimal, truth: Decimal, scale: Decimal, max_digits: float = math.inf
) -> float:
    """Return the number of digits to which an answer agrees with the truth.

    It is -log10(|answer - truth| / scale), between -99 and ``max_digits``.

    Args:
        answer: The answer.
        truth: The true value.
        scale: The size relative to which the error is counted.
        max_digits: The maximum number of digits, and the result for an exact answer.
    """
    error = abs(answer - truth)
    if not error:
        return max_digits
    if not scale:
        return 0.0
    share = error / scale
    near = share.adjusted() + math.log10(float(share.scaleb(-share.adjusted())))
    return min(max(0.0 - near, -99.0), max_digits)


def grade_answers(answers: Answers, store: Mapping[str, ReferenceValue]) -> list[Grade]:
    """Return a grade for each answer, in the order of the questions.

    Args:
        answers: The answers of a sheet.
        store: The questions with their truths.
    """
    ids = dict.fromkeys(one for id_ in store for one in (id_, *optional_ids_of_state(id_)))
    with decimal_arithmetic():
        return [_grade(store[id_], *answers.by_id[id_]) for id_ in ids if id_ in answers.by_id]


def _grade(reference_value: ReferenceValue, reading: str, text: str) -> Grade:
    def failed(verdict: str, note: str) -> Grade:
        return Grade(
            reference_value.id,
            reference_value.level,
            reading,
            shown,
            -math.inf,
            verdict,
            note=note,
            required_digits=needs,
        )

    needs, shown = digits_needed(reference_value), printable(text)
    try:
        answer = as_decimal(text)
    except InputError as fault:
        return failed("unreadable", str(fault))
    if not answer.is_finite():
        return failed(
            "not-a-number",
            "it says that there is no number" if answer.is_nan() else "it is infinite",
        )
    if answer and abs(answer.adjusted()) > _MAX_EXPONENT:
        return failed("not-a-number", f"its exponent is beyond {_MAX_EXPONENT}")
    value = reference_value.values.get(reading)  # type: ignore[call-overload]
    if value is None:
        note = (
            "doubles cannot tell the inputs apart: compute from the decimals, by whose truth these "
            "digits are counted"
        )
        from_decimals = _grade(reference_value, "decimals", text)
        return replace(
            from_decimals, reading=reading, verdict="no-truth", note=note, input_change=math.nan
        )
    truth, uncertainty = Decimal(value[0]), Decimal(value[1])
    scale = scale_of(reference_value, truth)
    max_digits = agreeing_digits(truth + uncertainty, truth, scale, 120.0)
    digits = agreeing_digits(answer, truth, scale, max_digits)
    error = abs(answer - truth)
    half_unit = Decimal(5).scaleb(int(answer.as_tuple().exponent) - 1)
    verdict, note = "wrong", ""
    slopes = worst_case_sensitivity(reference_value)
    close = digits >= min(max_digits, needs)
    if close and (error <= uncertainty + half_unit or _is_nearest_double(answer, truth)):
        verdict = "exact"
    elif digits >= needs:
        verdict = "agrees"
    elif digits >= _MIN_DIGITS and error <= slopes * Decimal(ROUNDING_CHANGE):
        verdict, note = (
            "rounding",
            "as far off as rounding the inputs to doubles makes it",
        )
    elif digits >= _IMPRECISE_SHARE * needs:
        verdict = "few-digits"
    if reading == "decimals" and verdict != "exact" and "doubles" in reference_value.values:
        other, width = (Decimal(part) for part in reference_value.values["doubles"])
        if abs(answer - other) <= width + half_unit:
            note = "the exact answer from doubles: the inputs were rounded"
    as_input_change = float(error / slopes) if slopes else math.nan
    return Grade(
        reference_value.id,
        reference_value.level,
        reading,
        shown,
        digits,
        verdict,
        value[0],
        note,
        needs,
        as_input_change,
    )


def _is_nearest_double(answer: Decimal, truth: Decimal) -> bool:
    """Return True if an answer is the double nearest to the truth, written with 16 or 17 digits.

    The seventeenth digit of such a double may differ from the truth's.
    """
    return 16 <= len(answer.as_tuple().digits) <= 17 and float(answer) == float(truth)


def tally_levels(grades: Iterable[Grade], asked_questions: Iterable[ReferenceValue]) -> list[Tally]:
    """Count the grades by level: return the tallies of all levels that have questions, without
    optional ones.

    Args:
        grades: The grades of a sheet.
        asked_questions: The questions.
    """
    counts = Counter(quantity.level for quantity in asked_questions if not is_optional(quantity.id))
    by_level: dict[int, list[Grade]] = {level: [] for level in counts}
    for grade in grades:
        if grade.verdict != "no-truth" and not is_optional(grade.id):
            by_level.setdefault(grade.level, []).append(grade)
    return [
        Tally.of(own, level, counts.get(level, len(own))) for level, own in sorted(by_level.items())
    ]


def tally_quantities(grades: Iterable[Grade]) -> list[Tally]:
    """Count the grades by level, quantity and friction law: return the tallies in the order of the
    questions.

    Args:
        grades: The grades of a sheet.
    """
    groups: dict[tuple[int, str, str], list[Grade]] = {}
    for grade in grades:
        if grade.verdict != "no-truth":
            _, friction, kind, _, name = grade.id.split("/", 4)
            plain, place = split_name(name, kind)
            quantity = re.sub(r"_\d+$", "", plain) if "order" in place else plain
            groups.setdefault((grade.level, quantity, friction), []).append(grade)
    ordered = sorted(groups.items(), key=lambda item: item[0][0])
    return [
        Tally.of(own, level, len(own), quantity, friction)
        for (level, quantity, friction), own in ordered
    ]


def compare(id_: str, answer: object, *, reading: Reading = "doubles") -> Grade:
    """Return the grade of one answer.

    Args:
        id_: The question's id.
        answer: A number of any kind or a decimal string. A number with a half-width counts by its
            value, an array of one element by that element.
        reading: The inputs from which the answer was computed, decimals or doubles.

    Raises:
        InputError: If the id is unknown, or the answer is not a number.
    """
    quantity = reference(id_)
    if not is_one_of(reading, ("decimals", "doubles")):
        raise InputError(
            f"an answer is computed from decimals or doubles, not from '{reading!s:.40}'"
        )
    with decimal_arithmetic():
        return _grade(quantity, reading, answer_text(answer))


@decimal_arithmetic()
def answer_text(answer: object) -> str:
    """Convert an answer of any kind to the text of its decimal.

    Args:
        answer: A number of any kind or a decimal string.

    Raises:
        InputError: If the answer is not one real number.
    """
    number = plain_number(answer)
    if isinstance(number, str):
        text = number.strip()
        try:
            as_decimal(text)
        except InputError as fault:
            raise InputError(
                f"an answer is a number or a decimal string, not '{printable(text[:40])}': {fault}"
            ) from None
        return text
    if isinstance(number, float):
        return repr(number)
    if isinstance(number, Decimal):
        return str(number)
    value = fraction(number)
    return str(Decimal(value.numerator) / value.denominator)
