"""Wrong answers to one quantity as a function of the place: the right value, or a term of it, times a monomial.

The ratio of answer and truth, or what is missing divided by a term, may be c x^a y^b ... with whole powers of the
speed, the sines and cosines, rho, M and the right value itself. The powers come from a linear fit of logarithms. What
is found so is a guess, which all answers to the quantity then have to bear out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from decimal import Decimal

from tippedisk_verify.conformance.diagnosis.alternatives import CORRECT, Alternative
from tippedisk_verify.conformance.diagnosis.factors import factor_said, monomial, named_values
from tippedisk_verify.conformance.diagnosis.predictions import Model
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["place_shapes"]

_ITSELF = "the right value"
_CYCLES = (7, 9)  # levels whose questions are about a cycle, with a period
_BY_STATE = (1, 5)  # levels whose questions are about a place of the state space
_PLAIN = 1e-6  # relative, as powers and constants are fitted
_SPARE = 3  # places more than unknowns
_SOME_SIZE = 1e-3  # of the value; a smaller term says little about its factor
_RATES = {f"dv_rate_d{name}": n for n, name in enumerate(("beta", "gamma", "v"))}
_HELD = {
    "M": "M", "rho": "rho", "h": "h", "f_G": "f_G", "w_y": "w_y", "lambda_Ty": "lambda_Ty", "gamma_y": "gamma_y",
    "abs(gamma_y)": "abs(gamma_y)", "v_rate friction": "w_y lambda_Ty", "h 1": "h's term 1", "h 2": "h's term 2",
    "h 3": "h's term 3", "h 4": "h's term 4", "h 5": "h's term 5", "v_rate": "v'",
}  # fmt: skip


def place_shapes(
    here: Sequence[Quantity], answers: Mapping[str, Decimal], wrong: set[str], store: Store
) -> Iterator[tuple[str, dict[str, float]]]:
    """(What the answers to one quantity are, these answers), the fewest factors first: many terms fit with more."""
    for _, text, expected in sorted(_fits(here, answers, wrong, store), key=lambda fit: fit[0]):
        yield text, expected


def _fits(
    here: Sequence[Quantity], answers: Mapping[str, Decimal], wrong: set[str], store: Store
) -> Iterator[tuple[int, str, dict[str, float]]]:
    """How many factors, and what they make of it."""
    right = {quantity.id: quantity.for_doubles for quantity in here}
    factors = {quantity.id: _factors(quantity, store) for quantity in here}
    values, names = named_values(here[0].set), list(factors[here[0].id])
    bases = {"": right} | {f"the derivative of {label}": part for label, part in _parts(here)}
    if here[0].level in _BY_STATE:
        bases["1"] = dict.fromkeys(right, 1.0)
    for text, part in bases.items():
        found = [
            ((float(answers[id_]) - (x if text else 0.0)) / part[id_], list(factors[id_].values()))
            for id_, x in right.items()
            if id_ in wrong and abs(part[id_]) > _SOME_SIZE * abs(x) and all(factors[id_].values())
        ]
        if len(found) < len(names) + 1 + _SPARE or (fit := monomial(found)) is None:
            continue
        constant, powers = fit
        product = {name: power for name, power in zip(names, powers, strict=True) if power}
        if not product and not text.startswith("the"):
            continue  # a plain factor or offset
        expected = {}
        for id_, x in right.items():
            if all(factors[id_][name] for name in product):
                share = constant * math.prod(factors[id_][name] ** power for name, power in product.items())
                expected[id_] = share * part[id_] + (x if text else 0.0)
        power = product.pop(_ITSELF, 0)
        words, unknown = factor_said(constant, tuple(product.items()), values, "the factor")
        rank = len(words.split())
        words, mark = words.removeprefix("has the factor "), "~" if unknown else ""
        if not text:
            times = f" times {_ITSELF}" + f" to the power {power + 1}" * (power != 0) if power != -1 else ""
            yield rank, f"{mark}{words}{times}", expected
        elif text == "1":
            yield rank, f"{mark}{_ITSELF} plus {words}", expected
        elif not product and abs(constant + 1) < _PLAIN:
            yield rank, f"those in which {text} is missing", expected
        elif not product and abs(constant + 2) < _PLAIN:
            yield rank, f"those in which {text} has the wrong sign", expected
        else:
            yield rank, f"{mark}{_ITSELF} plus {text} times {words}", expected


def _factors(quantity: Quantity, store: Store) -> dict[str, float]:
    """What a factor may be made of at a quantity's place: the inputs that its row has."""
    inputs = quantity.inputs
    found = {name: float(inputs[name]) for name in ("Omega",) if inputs.get(name)}
    if quantity.level not in _BY_STATE:
        found[_ITSELF] = abs(quantity.for_doubles)  # a power of it, as of a root that is forgotten
        if quantity.level in _CYCLES and quantity.name != "period":
            found["period"] = store[quantity.id.replace(f"/{quantity.name}", "/period")].for_doubles
        return found
    model = Model(Alternative("", ""), quantity.set, quantity.friction)
    state = [float(inputs.get(name) or 0.0) for name in ("beta", "gamma", "v")]
    parts = model.parts(math, found["Omega"], state)
    for name, angle in (("beta", state[0]), ("gamma", state[1])):
        found |= {f"sin {name}": math.sin(angle), f"cos {name}": math.cos(angle)}
    found |= {"rho": parts["rho"], "M": parts["M"]}
    if quantity.level == 1:
        found["v"] = state[2]
    return found


def _parts(here: Sequence[Quantity]) -> Iterator[tuple[str, dict[str, float]]]:
    """For a derivative of v', what each term contributes to it."""
    if here[0].name not in _RATES:
        return
    for name, label in _HELD.items():
        model = Model(Alternative("", "", replace(CORRECT, held=name)), here[0].set, here[0].friction)
        found = {}
        for quantity in here:
            given = model.inputs(quantity)
            rows = model.jacobian(given["Omega"], [given[key] for key in ("beta", "gamma", "v")])
            found[quantity.id] = quantity.for_doubles - rows[1][_RATES[quantity.name]]
        yield label, found
