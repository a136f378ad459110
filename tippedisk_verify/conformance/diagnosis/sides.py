"""Where answers are wrong: on one side of a surface, for one kind of input, or everywhere."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from tippedisk_verify.conformance.diagnosis.alternatives import Alternative
from tippedisk_verify.conformance.diagnosis.predictions import Model
from tippedisk_verify.reference_values.store import Quantity

__all__ = ["one_sided"]

_FEW = 4  # on each side, so that a side is no accident
_MOSTLY = 0.9  # of one side's answers are wrong; some may be right by chance, where a change is small
_STATES = ("rhs", "slow-manifold")


def one_sided(here: Sequence[Quantity], wrong: set[str]) -> Iterator[tuple[str, list[Quantity]]]:
    """(A condition, the questions that satisfy it), where nearly all of these are answered wrongly and no others."""
    bad = sum(quantity.id in wrong for quantity in here)
    if bad < _FEW or len(here) - bad < _FEW:
        return
    held: dict[str, list[Quantity]] = {}
    for quantity in here:
        for condition in _conditions(quantity):
            held.setdefault(condition, []).append(quantity)
    for condition, some in held.items():
        inside = sum(quantity.id in wrong for quantity in some)
        if inside == bad >= _MOSTLY * len(some) and len(here) - len(some) >= _FEW:
            yield condition, some


def _conditions(quantity: Quantity) -> Iterator[str]:
    numbers: dict[str, float] = {}
    for name, text in quantity.inputs.items():
        try:
            numbers[name] = float(text)
        except ValueError:
            yield f"{name} is {text}"
    model = Model(Alternative("", ""), quantity.set, quantity.friction)
    signs = {name: number for name, number in numbers.items() if name == "v"}
    if "beta" in numbers and "gamma" in numbers:
        signs |= {"cos beta": math.cos(numbers["beta"])}
        signs |= {"sin gamma": math.sin(numbers["gamma"]), "cos gamma": math.cos(numbers["gamma"])}
        if quantity.kind in _STATES and "v" in numbers:
            state = [numbers[name] for name in ("beta", "gamma", "v")]
            signs["gamma_y"] = model.parts(math, numbers["Omega"], state)["gamma_y"]
    if "Omega" in numbers:
        p = model.p
        signs["Omega - Omega_crit"] = numbers["Omega"] - (p.r + p.e) * math.sqrt(p.m * p.g / (p.r * p.Bbar))
    signs["the right value"] = quantity.for_doubles
    for name, number in signs.items():
        if number:
            yield f"{name} {'>' if number > 0 else '<'} 0"
