"""The disks of a range that are examined: a few to begin with, more of them where they differ from their neighbours."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from typing import Any

import numpy

from tippedisk_verify.flow import default_engine
from tippedisk_verify.orbits.fold_curves import Plane, interpolated
from tippedisk_verify.orbits.slices import Slice, slice_of

__all__ = ["connected_runs", "examined", "examined_between", "predicted_omega_h"]

_SLICES = 17  # disks examined to begin with
_NARROW = 1 / 512  # of the range: how closely it is found where things change
_PREDICTED = 64e-4  # rad/s; how well each disk's Omega_h must follow from its neighbours'

#: A function of one argument and its arguments, to the answers in their order.
Work = Callable[[Callable[[Any], Any], Sequence[Any]], Any]


def _slice(plane: Plane, share: float) -> Slice:
    return slice_of(plane.at(plane.decimal(share)), share, default_engine())


def examined(plane: Plane, work: Work) -> list[Slice]:
    """Disks of the range: close together where Omega_h ends, and where it could not be told from its neighbours."""
    slices: list[Slice] = work(partial(_slice, plane), numpy.linspace(0, 1, _SLICES).tolist())
    while wanted := [
        (before.share + after.share) / 2
        for before, after in pairwise(slices)
        if after.share - before.share > _NARROW
        and ((before.omega_h is None) != (after.omega_h is None) or _uncertain(slices, before, after))
    ]:
        slices = sorted([*slices, *work(partial(_slice, plane), wanted)], key=lambda one: one.share)
    return slices


def _uncertain(slices: Sequence[Slice], before: Slice, after: Slice) -> bool:
    """Whether either disk's Omega_h could not be told from that of its neighbours."""
    for one in (before, after):
        if one.omega_h is None:
            continue
        others = [pair for pair in _run(slices, one) if pair[0] != one.share]
        if len(others) < 2 or abs(predicted_omega_h(others, one.share) - one.omega_h) > _PREDICTED:
            return True
    return False


def _run(slices: Sequence[Slice], one: Slice) -> list[tuple[float, float]]:
    """(share, Omega_h) of the disks that have a connection, from one of them on to both sides."""
    return next(run for run in connected_runs(slices) if any(share == one.share for share, _ in run))


def connected_runs(slices: Sequence[Slice]) -> list[list[tuple[float, float]]]:
    """(share, Omega_h) of neighbouring disks that have a connection."""
    runs: list[list[tuple[float, float]]] = [[]]
    for one in slices:
        if one.omega_h is None:
            runs.append([])
        else:
            runs[-1].append((one.share, one.omega_h))
    return [run for run in runs if run]


def predicted_omega_h(known: Sequence[tuple[float, float]], share: float) -> float:
    """Omega_h at a share by the polynomial through the six nearest disks."""
    near = sorted(known, key=lambda pair: abs(pair[0] - share))[:6]
    at, omega = (numpy.array(column) for column in zip(*near, strict=True))
    return float(interpolated(at, omega[:, None], share)[0])


def examined_between(plane: Plane, slices: list[Slice], known: Sequence[float], work: Work) -> list[Slice]:
    """More disks: one between any two known changes, and closer together where things change otherwise."""
    edges = [0.0, *known, 1.0]
    wanted = [
        (low + high) / 2
        for low, high in pairwise(edges)
        if high > low and not any(low < one.share < high for one in slices)
    ]
    while True:
        slices = sorted([*slices, *work(partial(_slice, plane), wanted)], key=lambda one: one.share)
        wanted = [
            (before.share + after.share) / 2
            for before, after in pairwise(slices)
            if before.signature != after.signature
            and after.share - before.share > _NARROW
            and not any(before.share <= share <= after.share for share in known)
        ]
        if not wanted:
            return slices
