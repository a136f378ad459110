"""Which known mistakes a question catches: those whose answer to it would be graded as a failure.

The mistakes are those that a diagnosis can name, and each computes its answers from doubles. From level 6 on only those
are tried that change what is answered, not the equations: an orbit by wrong equations costs seconds, and level 1 has
caught them.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Sequence

from tippedisk_verify.conformance.diagnosis.alternatives import ALTERNATIVES
from tippedisk_verify.conformance.diagnosis.predictions import predicted
from tippedisk_verify.conformance.grading import compare
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["catches", "mistakes_json"]

_CHEAP_LEVEL = 5


def catches(quantities: Sequence[Quantity], store: Store) -> dict[str, list[str]]:
    """The names of the mistakes that questions of one entry catch, by id; of roundings to n places the finest only."""
    truth = {quantity.id: quantity.for_doubles for quantity in quantities}
    caught: dict[str, dict[str, str]] = {}
    for alternative in ALTERNATIVES:
        if quantities[0].level > _CHEAP_LEVEL and alternative.of_the_model:
            continue
        for id_, answer in predicted(alternative, quantities, store, truth).items():
            if compare(id_, answer).failed:
                family = re.sub(r"-\d+-(?=digits|decimals)", "-n-", alternative.name)
                caught.setdefault(id_, {})[family] = alternative.name
    return {id_: list(names.values()) for id_, names in caught.items()}


def mistakes_json(store: Store, advance: Callable[[str, int], None] = lambda label, steps: None) -> str:
    """The file that says so of all questions: a list of the mistakes, and by question their places in it."""
    places = {alternative.name: place for place, alternative in enumerate(ALTERNATIVES)}
    lines = []
    for quantities in _entries(store.values()):
        found = catches(quantities, store)
        lines += [f"  {json.dumps(id_)}: {[places[name] for name in names]}" for id_, names in found.items()]
        advance(quantities[0].id.rsplit("/", 1)[0], 1)
    named = ",\n".join(f"  {json.dumps({'name': one.name, 'cause': one.cause})}" for one in ALTERNATIVES)
    caught = ",\n".join(lines)
    return f'{{\n "format": 1,\n "mistakes": [\n{named}\n ],\n "caught": {{\n{caught}\n }}\n}}\n'


def _entries(quantities: Iterable[Quantity]) -> list[list[Quantity]]:
    by_entry: dict[str, list[Quantity]] = {}
    for quantity in quantities:
        by_entry.setdefault(quantity.id.rsplit("/", 1)[0], []).append(quantity)
    return list(by_entry.values())
