"""The rules of grading: the digits required at each level, the scale of an error, and the columns
of sheets and of values.csv.

The row holds everything that grading takes from the data, so a program in any language can grade a
sheet from this one table.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from decimal import Decimal

from tippedisk_verify.model.equations import STATE_NAMES
from tippedisk_verify.model.parameters import SYMBOLS
from tippedisk_verify.numbers.decimals import decimal_arithmetic
from tippedisk_verify.reference_values.store import ReferenceValue, is_optional

__all__ = [
    "ALLOWED_INPUT_CHANGE",
    "DIGITS_REQUIRED",
    "QUESTION_COLUMNS",
    "ROUNDING_CHANGE",
    "VALUES_COLUMNS",
    "digits_needed",
    "question_fields",
    "scale_of",
    "split_name",
    "values_csv_row",
    "worst_case_sensitivity",
]

_INPUTS = ("Omega", *STATE_NAMES)
QUESTION_COLUMNS = (
    "id",
    "level",
    "kind",
    "set",
    "friction",
    "quantity",
    "unit",
    *SYMBOLS,
    *_INPUTS,
    "t",
    "n",
    "order",
    "equilibrium",
    "form",
    "from",
    "answer",
)
#: Correct digits that an answer must have, by level. A careful implementation in doubles passes
#: easily; a wrong equation does not reach them by chance.
DIGITS_REQUIRED = {1: 10, 2: 8, 3: 8, 4: 8, 5: 8, 6: 4, 7: 6, 8: 6, 9: 4, 10: 6}
# Quantities that pass through zero. If they are below 1 in their unit, errors are relative to 1.
_SCALE_AT_LEAST_ONE = (
    "beta",
    "gamma",
    "v",
    "crossing_gamma",
    "crossing_v",
    "lambda_",
    "log_multiplier_slow",
)
#: A relative change of all inputs whose effect on an answer is allowed, by level. 1e-12 allows
#: closed forms in doubles about ten thousand roundings. For integrators the equivalent change was
#: measured at rtol = atol = 1e-12 and 1e-13, on all orbits and librating cycles of the printed set.
#: It is at most 5.3e-11 with SciPy's LSODA and 5.0e-11 with DOP853.
ALLOWED_INPUT_CHANGE = {level: 1e-12 if level < 6 else 1e-10 for level in DIGITS_REQUIRED}
_MIN_DIGITS = 0.3  # digits that every question requires: an error of half the value
ROUNDING_CHANGE = 2.0**-52  #: twice the relative change that rounding to a double makes
#: Columns of values.csv: the question, its numbers as hexadecimal doubles, the value, its grade.
VALUES_COLUMNS = (
    *QUESTION_COLUMNS,
    *(f"{name}_hex" for name in (*SYMBOLS, *_INPUTS, "t")),
    "value_from_decimals",
    "uncertainty_from_decimals",
    "value_from_doubles",
    "uncertainty_from_doubles",
    "scale",
    "digits_needed",
    "rounding",
    "grade",
    "methods",
    "condition",
)


def split_name(name: str, kind: str) -> tuple[str, dict[str, str]]:
    """Split a quantity's name into plain name and place: ``beta@0.5`` is beta at t = 0.5.

    Args:
        name: The quantity's name.
        kind: The kind of question. Only orders of the slow manifold are places: at level 1 ``h_1``
            is the name of a force.
    """
    for mark, what in (("@", "t"), ("#", "n")):
        plain, found, place = name.partition(mark)
        if found:
            return plain, {what: place}
    if kind == "slow-manifold":
        return name, {"order": name.rsplit("_", 1)[1]}
    return name, {}


def question_fields(
    parameters: Mapping[str, str], reference_value: ReferenceValue
) -> dict[str, str]:
    """Return a question as texts by column, without the columns that do not apply.

    Args:
        parameters: The disk's parameters as decimals.
        reference_value: The reference value.
    """
    plain, place = split_name(reference_value.name, reference_value.kind)
    return {
        "id": reference_value.id,
        "level": str(reference_value.level),
        "kind": reference_value.kind,
        "set": reference_value.set,
        "friction": reference_value.friction,
        "quantity": plain,
        "unit": reference_value.unit,
        **{symbol: parameters[symbol] for symbol in SYMBOLS},
        **reference_value.inputs,
        **place,
        **({"form": "optional"} if is_optional(reference_value.id) else {}),
        "from": "decimals" if "doubles" not in reference_value.values else "",
        "answer": "",
    }


def scale_of(reference_value: ReferenceValue, value: Decimal) -> Decimal:
    """Return the size relative to which the error of an answer is measured.

    This is the size of the value. At level 1 it is the largest condition number if that is larger,
    because that is the size of the terms that cancelled. For angles, angular velocities and
    eigenvalues it is at least 1 in their unit.
    """
    size = value.copy_abs()  # abs() would round
    if reference_value.level == 1:
        return max(
            [size, *(Decimal(slope).copy_abs() for slope in reference_value.condition.values())]
        )
    if reference_value.level == 2 or split_name(reference_value.name, reference_value.kind)[
        0
    ].startswith(_SCALE_AT_LEAST_ONE):
        return max(size, Decimal(1))
    return size


@decimal_arithmetic()
def worst_case_sensitivity(reference_value: ReferenceValue) -> Decimal:
    """Return the largest change of a reference value per relative change of its inputs, if each
    changes in its worse direction.
    """
    return sum((abs(Decimal(slope)) for slope in reference_value.condition.values()), Decimal(0))


@decimal_arithmetic()
def digits_needed(reference_value: ReferenceValue) -> float:
    """Return the number of correct digits that an answer to a question must have.

    It is the level's number, or less if a change of the inputs by `ALLOWED_INPUT_CHANGE` spoils
    more digits. If doubles cannot tell the inputs apart, only programs with more digits are asked,
    and they need the level's number.
    """
    digits = float(DIGITS_REQUIRED[reference_value.level])
    scale = scale_of(reference_value, Decimal(reference_value.values["decimals"][0]))
    condition = float(worst_case_sensitivity(reference_value) / scale) if scale else 0.0
    if "doubles" in reference_value.values and condition:
        digits = max(
            min(digits, -math.log10(condition * ALLOWED_INPUT_CHANGE[reference_value.level])),
            _MIN_DIGITS,
        )
    return round(digits, 3)  # the same on every processor


def values_csv_row(
    parameters: Mapping[str, str], reference_value: ReferenceValue
) -> dict[str, str]:
    """Return the row of a reference value in values.csv, by column.

    Args:
        parameters: The disk's parameters as decimals.
        reference_value: The reference value.
    """
    row = question_fields(parameters, reference_value)
    scale = scale_of(reference_value, Decimal(reference_value.values["decimals"][0]))
    row |= {
        **{
            f"{name}_hex": float(row[name]).hex()
            for name in (*SYMBOLS, *_INPUTS, "t")
            if name in row and "doubles" in reference_value.values
        },
        **{
            f"{part}_from_{reading}": text
            for reading, texts in reference_value.values.items()
            for part, text in zip(("value", "uncertainty"), texts, strict=True)
        },
        "scale": f"{scale:.17g}",
        "digits_needed": repr(digits_needed(reference_value)),
        "rounding": f"{float(worst_case_sensitivity(reference_value)) * ROUNDING_CHANGE:.3g}",
        "grade": reference_value.grade,
        "methods": " ".join(map("=".join, reference_value.methods.items())),
        "condition": " ".join(map("=".join, reference_value.condition.items())),
    }
    return {name: row.get(name, "") for name in VALUES_COLUMNS}
