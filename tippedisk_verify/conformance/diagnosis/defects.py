"""Whether some equations of motion give the answered orbits, or none do.

The right equations, started in each answered state, miss the next one by a defect. Equations that are a little wrong
leave the same defect wherever an orbit passes the same state; an integrator that chooses its steps does not.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from decimal import Decimal

import numpy

from tippedisk_verify.conformance.diagnosis.flights import Array, field, flown
from tippedisk_verify.reference_values.store import Quantity

__all__ = ["defects"]

_STATE = ("beta", "gamma", "v")
_SMALL = 1e-5  # of a changed term: defects are proportional to it
_STEPS = 100  # of 5 ms, as friction decays at some 130 1/s, for derivatives of three digits
_FINE = 500
_RULES = 135  # changed terms
_LARGE = 1.0  # rad, rad/s; such defects are not proportional to what makes them
_PLENTY = 2  # times as many defects must be known
_ELSEWHERE = 1e-2  # of the first defects: where all the others are smaller, starts are wrong


def _terms(y: Array) -> list[Array]:
    """Changes of a rate: smooth functions of the state, more than there are terms in the equations."""
    beta, gamma, v = y
    one, level = numpy.ones_like(beta), numpy.cos(beta)
    turns = (one, numpy.sin(gamma), numpy.cos(gamma), numpy.sin(2 * gamma), numpy.cos(2 * gamma))
    return [a * b * c for a in (one, level, level**2) for b in turns for c in (one, v, v * v)]


def defects(here: Sequence[Quantity], answers: Mapping[str, Decimal]) -> tuple[float, float] | None:
    """The largest defect, and the share of all that no smooth changes of the equations explain, where it is known."""
    states: dict[tuple[str, float], dict[str, Quantity]] = {}
    for quantity in here:
        name, time = quantity.name.split("@")
        states.setdefault((quantity.id.rsplit("/", 1)[0], float(time)), {})[name] = quantity
    whole = {place: three for place, three in states.items() if len(three) == len(_STATE)}
    between = min((time for _, time in whole), default=math.nan)
    given = {place: [float(answers[three[name].id]) for name in _STATE] for place, three in whole.items()}
    pairs = [(entry, time) for entry, time in whole if time == between or (entry, round(time - between, 9)) in whole]
    first = numpy.array([time == between for _, time in pairs])
    if len(_STATE) * (~first).sum() < _PLENTY * _RULES:
        return None
    begun = [
        [float(three["beta"].inputs[name]) for name in _STATE] if begins else given[entry, round(time - between, 9)]
        for (entry, time), begins in zip(pairs, first.tolist(), strict=True)
        for three in (whole[entry, time],)
    ]
    starts = numpy.array(begun).T
    speeds = numpy.array([float(whole[place]["beta"].inputs["Omega"]) for place in pairs])
    right = field(here[0].set, here[0].friction, speeds)
    missed = numpy.array([given[place] for place in pairs]).T - flown(right, starts, between, _FINE)
    largest = float(numpy.nan_to_num(abs(missed), nan=math.inf).max())
    if largest > _LARGE:
        return None
    begin, later = (float(numpy.linalg.norm(missed[:, part])) for part in (first, ~first))
    if later < _ELSEWHERE * begin:
        return None

    def changed(y: Array) -> Array:
        rates = numpy.array(right(y))
        for n, term in enumerate(_terms(y[:, 0]) * len(_STATE)):
            rates[n // (_RULES // len(_STATE)), 1 + n] += _SMALL * term
        return rates

    ends = flown(changed, numpy.repeat(starts[:, None], _RULES + 1, axis=1), between, _STEPS)
    moved = numpy.moveaxis((ends[:, 1:] - ends[:, :1])[:, :, ~first] / _SMALL, 1, 2).reshape(-1, _RULES)
    size = abs(moved).sum(axis=1)
    weights, wanted = 1 / numpy.maximum(size, _ELSEWHERE * size.max()), missed[:, ~first].reshape(-1)
    found = numpy.linalg.lstsq(moved * weights[:, None], wanted * weights, rcond=1e-8)[0]
    left = numpy.linalg.norm((wanted - moved @ found) * weights) / numpy.linalg.norm(wanted * weights)
    return largest, float(left) * math.sqrt(len(wanted) / (len(wanted) - _RULES))
