"""The half map's derivative by differences of cycles' starts, to the section or after half the period."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy

from tippedisk_verify.conformance.diagnosis.flights import Array, field, flown, half_map
from tippedisk_verify.reference_values.store import Store

__all__ = ["differenced"]

_STEPS = (0.1, 0.05, 0.02, 0.01, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4)
_SIDES = {"forward": (0, 1), "backward": (-1, 0), "central": (-1, 1)}
_H = 1e-3  # s, of a step of RK4, whose errors are the same on both sides of a difference


def differenced(entries: Sequence[str], store: Store) -> Iterator[tuple[str, Mapping[str, Array]]]:
    """What was done, and the matrix that it gives for each of these cycles."""
    names = ("period", "gamma_bar_0", "v_0")
    period, gamma, v = (numpy.array([store[f"{entry}/{name}"].for_doubles for entry in entries]) for name in names)
    first = store[f"{entries[0]}/period"]
    omega = numpy.array([float(store[f"{entry}/period"].inputs["Omega"]) for entry in entries])
    moves = [(0, 0.0), *((place, side * step) for place in (1, 2) for step in _STEPS for side in (-1, 1))]
    quarters = numpy.full_like(gamma, math.pi / 2)
    starts = numpy.repeat(numpy.stack([quarters, quarters + gamma, v])[:, None], len(moves), axis=1)
    for n, (place, move) in enumerate(moves):
        starts[place, n] += move
    f, flat = field(first.set, first.friction, numpy.tile(omega, len(moves))), starts.reshape(3, -1)
    _, returned = half_map(f, flat, _H, math.pi / 2, float(period.max()))
    after = flown(f, flat, numpy.tile(period / 2, len(moves)), math.ceil(period.max() / 2 / _H))
    at = {move: n for n, move in enumerate(moves)}
    for where, end in (("", returned), (" at a fixed time, not on the section", after)):
        ends = -end[1:].reshape(2, len(moves), len(entries))
        for step in _STEPS:
            for kind, sides in _SIDES.items():
                columns = []
                for place in (1, 2):
                    begin, last = (ends[:, at[place, side * step] if side else 0] for side in sides)
                    columns.append((last - begin) / (step * (sides[1] - sides[0])))
                table = numpy.stack(columns, axis=1)
                if numpy.isfinite(table).all():
                    text = f"the half map's derivative by {kind} differences of {step:g} in the start{where}"
                    yield text, {entry: table[:, :, n] for n, entry in enumerate(entries)}
