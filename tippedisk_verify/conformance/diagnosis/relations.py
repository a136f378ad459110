"""Relations of a quantity's answers to right values: a factor, a sign, a power, another place.

A relation predicts answers from right values, or from the values of the reconstructed program. Each
quantity is examined separately. A relation holds if it gives every wrong answer that it predicts.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from itertools import chain, product
from typing import Any, NamedTuple

import numpy as np

from tippedisk_verify.conformance.diagnosis.regression import program_with_changes
from tippedisk_verify.conformance.diagnosis.tables import Array, Table
from tippedisk_verify.model.equations import STATE_NAMES
from tippedisk_verify.model.parameters import SYMBOLS

__all__ = ["Relation", "condition_phrase", "relation_sentence", "relations_of"]

# The least share of a quantity's wrong answers that a relation to another question must give.
_MIN_COVERED_SHARE = 0.4
_MIN_RELATED_ANSWERS = 3  # the least number of wrong answers that such a relation must give
# Digits by which a relation must beat the truth in all, so that it is no accident
_MIN_EVIDENCE_DIGITS = 6.0
# Share of the allowed error; answers that are closer are no further evidence
_MIN_SEPARATION = 1e-4
_MIN_ALL_ANSWERS = 3  # the least number of quantities that are called "all answers"
_MIN_WRONG_SHARE = 0.9  # the least share of wrong answers among those that satisfy a condition
_SIGNS = {"<": -1, "=": 0, ">": 1}
_PI = math.pi
_ArrayFunction = Callable[[Array], Array]
_FACTORS = {
    "2": 2.0,
    "3": 3.0,
    "4": 4.0,
    "6": 6.0,
    "8": 8.0,
    "3/2": 1.5,
    "4/3": 4 / 3,
    "pi": _PI,
    "2 pi": 2 * _PI,
    "16": 16.0,
    "180/pi (degrees)": 180 / _PI,
    "30/pi (turns per minute)": 30 / _PI,
    "60": 60.0,
    "sqrt 2": math.sqrt(2),
    "ln 10": math.log(10),
    "ln 2": math.log(2),
    "1000": 1e3,
    "pi/4": _PI / 4,
    "9.81/9.80665": 9.81 / 9.80665,
    "5": 5.0,
}
_FACTORS |= {
    f"1/({text})" if " " in text else f"1/{text}": 1 / factor for text, factor in _FACTORS.items()
}
_FACTORS |= {f"-{text}": -factor for text, factor in _FACTORS.items()}
# Functions that round or truncate, by the rest of the sentence
_ROUNDINGS: dict[str, Any] = {
    **{
        f"rounded to {n} decimal{'s' * (n > 1)}": partial(np.round, decimals=n)
        for n in range(1, 13)
    },
    **{
        f"rounded to {n} significant digit{'s' * (n > 1)}": lambda x, form=f".{n - 1}e": np.array(
            [float(format(one, form)) for one in x]
        )
        for n in range(1, 13)
    },
    **{
        f"truncated to {n} decimal{'s' * (n > 1)}": lambda x, u=10.0**n: np.trunc(x * u) / u
        for n in range(1, 13)
    },
}
_TENS = {f"10^{k}": 10.0**k for k in range(-12, 13) if k not in (0, 3, -3)}
_OFFSETS = {"pi/2": _PI / 2, "pi": _PI, "2 pi": 2 * _PI, "1": 1.0}
# Functions of the right value, by rank and sentence
_FUNCTIONS_OF_ONE_VALUE: dict[float, dict[str, _ArrayFunction]] = {
    0: {"has the wrong sign": np.negative},
    1: {
        "is the modulus of the right value": np.abs,
        "is zero": np.zeros_like,
        "is one": np.ones_like,
        "is minus the modulus of the right value": lambda x: -np.abs(x),
        "is rounded to single precision": lambda x: x.astype("f4").astype("f8"),
        "is rounded to half precision": lambda x: x.astype("f2").astype("f8"),
        **{f"has the factor {text}": partial(np.multiply, x) for text, x in _FACTORS.items()},
        **{f"is {text}": function for text, function in _ROUNDINGS.items()},
    },
    2: {
        **{f"is {text} too large": partial(np.add, x) for text, x in _OFFSETS.items()},
        **{f"is {text} too small": partial(np.add, -x) for text, x in _OFFSETS.items()},
    },
    3: {
        **{
            f"is {text} minus the right value": partial(np.subtract, x)
            for text, x in _OFFSETS.items()
        },
        "is reduced to [0, 2 pi)": lambda x: x % (2 * _PI),
        "is reduced to [0, pi]": lambda x: np.arccos(np.cos(x)),
        "is reduced to (-pi, pi]": lambda x: _PI - (_PI - x) % (2 * _PI),
        "is reduced to [0, pi)": lambda x: x % _PI,
        "is reduced to [-pi/2, pi/2]": lambda x: np.arcsin(np.sin(x)),
        **{
            f"is {text} the right value": of
            for text, of in (
                ("the square of", np.square),
                ("the square root of", lambda x: np.sign(x) * np.sqrt(np.abs(x))),
                ("the logarithm of", lambda x: np.log(np.abs(x))),
                ("the exponential of", np.exp),
                ("the common logarithm of", lambda x: np.log10(np.abs(x))),
                ("the reciprocal of", np.reciprocal),
                ("the sine of", np.sin),
                ("the cosine of", np.cos),
                ("the tangent of", np.tan),
                ("2 pi divided by", lambda x: 2 * _PI / x),
                ("the cube of", lambda x: x**3),
            )
        },
    },
    4.5: {f"has the factor {text}": partial(np.multiply, x) for text, x in _TENS.items()},
}
# Functions of the right value x, and of the value y of another quantity or of an input
_FUNCTIONS_OF_TWO_VALUES: dict[str, Callable[[Array, Array], Array]] = {
    "has the values of {y}": lambda x, y: y,
    "has the values of {y} with the wrong sign": lambda x, y: -y,
    "is twice {y}": lambda x, y: 2 * y,
    "is half of {y}": lambda x, y: y / 2,
    "is half of the sum with {y}": lambda x, y: (x + y) / 2,
    "is the right value plus {y}": lambda x, y: x + y,
    "is the right value minus {y}": lambda x, y: x - y,
    "is {y} minus the right value": lambda x, y: y - x,
    "is the right value times {y}": lambda x, y: x * y,
    "is the right value divided by {y}": np.divide,
    "is {y} divided by the right value": lambda x, y: y / x,
    "is the square of {y}": lambda x, y: y**2,
    "is the right value times the square of {y}": lambda x, y: x * y**2,
    "is the square root of {y}": lambda x, y: np.sqrt(y),
    "is the right value divided by the square of {y}": lambda x, y: x / y**2,
    "is the right value to the power 1/{y}": lambda x, y: np.abs(x) ** (1 / y),
    "is the exponential of {y}": lambda x, y: np.exp(y),
    "is the modulus of the right value and {y}": np.hypot,
    "is the logarithm of {y}": lambda x, y: np.log(np.abs(y)),
    "is the right value plus twice {y}": lambda x, y: x + 2 * y,
    "is half of {y} too small": lambda x, y: x - y / 2,
    "is 2 pi divided by {y}": lambda x, y: 2 * _PI / y,
    "is half of {y} too large": lambda x, y: x + y / 2,
}
# Lists of questions, each with the pattern of the place in the list, in an id
_QUESTION_LISTS = {
    "entry": r"[^/]+(?=/[^/]+$)",
    "sample in time": r"(?<=@)[^/@]+$",
    "crossing": r"(?<=#)\d+$",
    "order": r"(?<=/h_)\d+$|(?<=/residual_)\d+$",
}
# Functions from the places of such a list to the places whose values stand there; "" for none
_REORDERINGS: dict[str, Callable[[list[str]], list[str]]] = {
    "the next": lambda places: places[1:],
    "the previous": lambda places: ["", *places],
    "the next but one": lambda places: places[2:],
    "the last but one": lambda places: ["", "", *places],
    "the first": lambda places: places[:1] * len(places),
    "every second": lambda places: places[1::2],
    "every second, from the first on,": lambda places: places[::2],
}
# Words of ids that may be exchanged
_EXCHANGEABLE_WORDS = (
    ("inverted", "noninverted"),
    ("printed", "consistent"),
    ("stable", "unstable"),
    ("linear", "smooth"),
)


class Relation(NamedTuple):
    """A simple relation to right values that the wrong answers to a quantity have."""

    rank: float  #: lower is likelier
    sentence: str  #: sentence with {q} for the quantity
    table: Table
    quantity: str  #: the quantity
    answers: Array  #: mask of the unexplained answers that the relation gives


Prediction = tuple[float, str, Array]  #: rank, sentence, and answers; NaN for no prediction


def _predictions(table: Table, truths: Mapping[str, float]) -> Iterator[Prediction]:
    """Yield the answers that would be given under each known relation to the right values, with the
    relation's rank and sentence.

    Args:
        table: The answers.
        truths: The right values by id.
    """
    x = table.truth
    for rank, functions in _FUNCTIONS_OF_ONE_VALUE.items():
        for text, function in functions.items():
            yield rank, f"{{q}} {text}", function(x)
    yield 3, "{q} is off by whole turns", x + 2 * _PI * np.round((table.answer - x) / (2 * _PI))
    for rank, sentence, ids in _exchanged_questions(table):
        yield rank, sentence, _right_values(truths, ids)
    for name, values in _other_values(table, truths).items():
        y = np.where(table.quantity_names == name, np.nan, values)
        for n, (text, of_two) in (
            enumerate(_FUNCTIONS_OF_TWO_VALUES.items()) if np.isfinite(y).any() else ()
        ):
            yield 4 if n else 2, f"{{q}} {text.replace('{y}', name)}", of_two(x, y)


def _exchanged_questions(table: Table) -> Iterator[tuple[float, str, list[str]]]:
    """Yield the ways in which questions may have been exchanged, each as a rank, a sentence, and a
    list of ids.

    The list has, for each answer, the id of the question whose right value stands in its place.
    """
    for one, two in _EXCHANGEABLE_WORDS:
        what = "law" if one == "linear" else f"{two}/{one}"
        pattern = rf"(?<=/)({one}|{two})(?=[-/])"  # not in the parameter set
        ids = _ids_with_exchanged_words(table, pattern, {one: two, two: one})
        yield 2.5, f"{{q}} has the values of the other {what}", ids
    for what, pattern in _QUESTION_LISTS.items():
        matches = (re.search(pattern, id_) for id_ in table.ids)
        places = list(dict.fromkeys(match[0] for match in matches if match))
        if what != "entry":
            places.sort(key=float)
        for text, moved in _REORDERINGS.items() if places else ():
            others = dict(zip(places, moved(places), strict=False))
            ids = _ids_with_exchanged_words(table, pattern, others)
            yield 3, f"{{q}} has the values of {text} {what}", ids


def _ids_with_exchanged_words(table: Table, pattern: str, others: Mapping[str, str]) -> list[str]:
    """Return the ids of a table's answers with other words in the place of those that a pattern
    finds.

    Args:
        table: The answers.
        pattern: The regular expression.
        others: The new words by the old ones; a word that is missing is removed.
    """
    return [re.sub(pattern, lambda match: others.get(match[0], ""), id_) for id_ in table.ids]


def _other_values(table: Table, truths: Mapping[str, float]) -> dict[str, Array]:
    """Return the values to which answers may be related, by name, one value to an answer.

    They are the right values of the entry's other quantities, the entry's inputs and parameters,
    and a power, a factorial and a sum that depend on the answer's order.

    Args:
        table: The answers.
        truths: The right values by id.
    """
    names = list(zip(table.ids, table.quantity_names, table.names, strict=True))
    values = {
        name: _right_values(
            truths,
            [
                id_.removesuffix(full) + name + full.removeprefix(quantity)
                for id_, quantity, full in names
            ],
        )
        for name in np.unique(table.quantity_names).tolist()
    }
    for sort, symbols in {"parameter": SYMBOLS, "input": ("Omega", *STATE_NAMES)}.items():
        values |= {f"the {sort} {x}": table.inputs[x][table.rows] for x in symbols}
    order = table.order
    values["epsilon^n"] = values["the parameter epsilon"] ** order
    values["n!"] = np.array([math.gamma(n + 1) for n in order])
    so_far = 0 * order
    for k in range(int(np.nanmax(order, initial=-1)) + 1):
        term = _right_values(truths, [re.sub(r"\d+$", str(k), id_) for id_ in table.ids])
        so_far += np.where(order >= k, values["the parameter epsilon"] ** k * term, 0.0)
    values["the sum of epsilon^k times all orders so far"] = so_far
    return values


def _right_values(truths: Mapping[str, float], ids: list[str]) -> Array:
    return np.array([truths.get(id_, np.nan) for id_ in ids])


@np.errstate(all="ignore")
def relations_of(
    table: Table, truths: Mapping[str, float], variants: Mapping[str, Array]
) -> list[Relation]:
    """Return the relations that give the wrong answers to any of a table's quantities.

    A relation may be restricted by a condition on the question, which its sentence then names.

    Args:
        table: The answers.
        truths: The right values by id, of all tables.
        variants: Predicted answers by the sentence about the mistake behind them.
    """
    relations = []
    quantities, group = np.unique(table.quantity_names, return_inverse=True)
    wrong, conditions = np.bincount(group, table.unexplained), list(_conditions(table))
    variant_predictions = ((1, sentence, predicted) for sentence, predicted in variants.items())
    for rank, sentence, predicted in chain(variant_predictions, _predictions(table, truths)):
        is_predicted = np.isfinite(predicted)
        fits = table.agrees_with(predicted) & is_predicted
        explained_mask, contradicted = fits & table.unexplained, is_predicted & ~fits
        distance = np.maximum(np.abs(table.answer - predicted), _MIN_SEPARATION * table.allowed)
        digits = np.where(
            explained_mask, np.log10(np.abs(table.answer - table.truth) / distance), 0.0
        )
        evidence, explained, contradictions = (
            np.bincount(group, one)
            for one in (digits, explained_mask, contradicted & table.unexplained)
        )
        enough = (explained == wrong) | (
            (explained >= _MIN_COVERED_SHARE * wrong) & (explained >= _MIN_RELATED_ANSWERS)
        )
        for n in np.flatnonzero(
            enough & (evidence > _MIN_EVIDENCE_DIGITS) & (contradictions == 0)
        ).tolist():
            in_group = group == n
            for text, mask in conditions:
                if not (in_group & np.where(mask, contradicted, table.unexplained)).any():
                    relations.append(
                        Relation(
                            rank + 5 * bool(text),
                            sentence + text,
                            table,
                            str(quantities[n]),
                            in_group & table.unexplained,
                        )
                    )
                    break
    return relations


def _conditions(table: Table) -> Iterator[tuple[str, Array]]:
    """Yield conditions on questions, each as words and the mask of the answers that satisfy it.

    The first one has no words, and all answers satisfy it.
    """
    inputs = table.inputs
    words = {name: inputs[name] for name in ("equilibrium", "form")}
    words["set"] = np.array([entry.split("/")[0] for entry in table.entries])
    signed = {
        "v": inputs["v"],
        "cos(beta)": np.cos(inputs["beta"]),
        "gamma_y": program_with_changes(table.friction, (), inputs)["gamma_y"],
        "cos(gamma)": np.cos(inputs["gamma"]),
    }
    yield "", np.ones_like(table.unexplained)
    for name, values in words.items():
        for value in np.unique(values):
            yield f" for the {name} {value}", (values == value)[table.rows]
    for (name, values), (symbol, sign) in product(signed.items(), _SIGNS.items()):
        yield f" where {name} {symbol} 0", (np.sign(values) == sign)[table.rows]


def condition_phrase(table: Table) -> str:
    """Return the names of the quantities with unexplained answers, and a condition if there is one.

    Outside the condition, no answer to these quantities is unexplained. Inside it, most of them
    are.

    Args:
        table: The answers.
    """
    quantities = np.unique(table.quantity_names[table.unexplained])
    same = np.isin(table.quantity_names, quantities)
    names = ", ".join(quantities[:6]) + (", ..." if len(quantities) > 6 else "")
    names += f" ({table.friction})" if table.friction != "both" else ""
    for text, mask in _conditions(table):
        inside, outside = table.unexplained[mask & same], table.unexplained[~mask & same]
        if (
            len(outside) > _MIN_RELATED_ANSWERS
            and not outside.any()
            and inside.mean() >= _MIN_WRONG_SHARE
        ):
            return names + text
    return names


def relation_sentence(
    sentence: str, quantities: set[tuple[str, str]], all_quantities: set[tuple[str, str]]
) -> str:
    """Return the sentence about a relation of wrong answers, with the names of their quantities put
    in.

    Args:
        sentence: The sentence, with {q} in place of the quantity.
        quantities: The quantities of the relation, each as friction law and name.
        all_quantities: All quantities of the level, in the same form.
    """
    names, laws = sorted({name for _, name in quantities}), {law for law, _ in quantities}
    whole = quantities == all_quantities and len(quantities) >= _MIN_ALL_ANSWERS
    text = (
        "all answers"
        if whole
        else " and ".join([", ".join(names[:-1]), names[-1]])
        if len(names) > 1
        else names[0]
    )
    if len(names) > 1 or whole:
        sentence = re.sub(
            r"^\{q\} (is|has|counts)\b",
            lambda verb: "{q} " + {"is": "are", "has": "have", "counts": "count"}[verb[1]],
            sentence,
        )
    others = {(law, name) for law, name in all_quantities if name in names} - quantities
    return sentence.replace("{q}", text) + (
        f", under the {min(laws)} law" if others and len(laws) == 1 else ""
    )
