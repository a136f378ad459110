"""One disk of a plane of a parameter and the speed: where its curves are, and what is stable between them.

What is stable is computed, not inferred: inverted spinning by its exact Routh-Hurwitz criterion, a limit cycle by the
multipliers of the half map at the cycles that the librating family has at that speed, and along the whole family, for
it may lose its stability elsewhere than in a fold.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy

from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE
from tippedisk_verify.orbits.amplitude_family import AmplitudeFamily
from tippedisk_verify.orbits.bisection import bisect_omega_h
from tippedisk_verify.orbits.half_map import HalfFlights
from tippedisk_verify.orbits.splitting import splitting_zero_in_double
from tippedisk_verify.theory.equilibria import is_stable, linearization
from tippedisk_verify.theory.hopf import omega_crit

__all__ = ["Cell", "Slice", "slice_of"]

_OUTSIDE = 0.01  # rad/s beyond the outermost curve, where the cells without an end are examined
_EACH = 3  # of the family's nodes so many are skipped from one whose multipliers are looked at to the next
_NEXT_TO_A_FOLD = 0.05  # of s, where the multiplier is too close to 1 to tell anything


@dataclass(frozen=True)
class Cell:
    """What is stable between two curves, at the speed where it was examined."""

    omega: float  #: [rad/s]
    inverted_spinning: bool
    limit_cycle: bool | None  #: None where it is not known, or not the same throughout

    @property
    def stable(self) -> str:
        """What is stable there, in words."""
        if self.limit_cycle is None:
            return "inverted spinning, limit cycle unknown" if self.inverted_spinning else "limit cycle unknown"
        both = self.inverted_spinning, self.limit_cycle
        return {(1, 1): "both", (1, 0): "inverted spinning", (0, 1): "limit cycle", (0, 0): "neither"}[both]


@dataclass(frozen=True)
class Slice:
    """A disk of the plane; speeds in rad/s, in double."""

    share: float  #: of the plane's range
    omega_crit: float
    omega_h: float | None  #: None where no connection is found
    folds: tuple[tuple[float, float, float], ...]  #: (s, v_0 / gamma_bar_0, Omega) of each
    bounds: tuple[tuple[str, float], ...]  #: the curves with their speeds, rising
    cells: tuple[Cell, ...]  #: below, between and above them
    no_family: str = ""  #: why the family cannot be followed to a connection
    no_connection: str = ""  #: why there is no Omega_h
    other_changes: str = ""  #: where cycles change their stability without a fold

    @property
    def signature(self) -> tuple[object, ...]:
        """What two disks have in common if nothing happens between them."""
        return tuple(name for name, _ in self.bounds), tuple(cell.stable for cell in self.cells)


def slice_of(disk: Parameters, share: float, engine: Engine) -> Slice:
    """The disk that is at a share of a plane's range."""
    crit, family, no_family = float(omega_crit(disk)), None, ""
    try:
        family = AmplitudeFamily(disk, engine)
    except (InputError, Shortfall) as fault:
        no_family = str(fault)
    omega_h, no_connection = _connection(disk, family, engine)
    bounds = [("hopf", crit)]
    folds: tuple[tuple[float, float, float], ...] = ()
    if omega_h is not None:
        bounds.append(("heteroclinic", omega_h))
    if family is not None:
        if omega_h is None:
            bounds.append(("end of the family" if family.connected else "amplitude pi", family.limit))
        places = [family.place(s) for s in family.folds]
        folds = tuple((place.s, place.v / place.gamma_bar, place.omega) for place in places)
        bounds += [("fold", place.omega) for place in places]
    bounds.sort(key=lambda bound: bound[1])
    unstable, changes = (None, "") if family is None else _unstable_nodes(family, engine)
    speeds = [speed for _, speed in bounds]
    inner = [(low + high) / 2 for low, high in pairwise(speeds)]
    cells = []
    for low, omega, high in zip(
        [-numpy.inf, *speeds],
        [speeds[0] - _OUTSIDE, *inner, speeds[-1] + _OUTSIDE],
        [*speeds, numpy.inf],
        strict=True,
    ):
        inverted = is_stable(linearization(disk, Fraction(omega)))
        cells.append(Cell(omega, inverted, _cycle_there(family, unstable, low, omega, high, engine)))
    return Slice(share, crit, omega_h, folds, tuple(bounds), tuple(cells), no_family, no_connection, changes)


def _connection(disk: Parameters, family: AmplitudeFamily | None, engine: Engine) -> tuple[float | None, str]:
    """Omega_h from where the family tends to, else from a bisection; or why there is none."""
    if family is not None:
        with suppress(InputError, Shortfall):
            return float(splitting_zero_in_double(disk, Fraction(family.limit), engine)), ""
    try:
        near = bisect_omega_h(disk, engine, confirm=False).omega_h.value
        return float(splitting_zero_in_double(disk, near, engine)), ""
    except (InputError, Shortfall) as fault:
        return None, str(fault)


def _spectral_radius(disk: Parameters, omega: float, state: tuple[float, float], engine: Engine) -> float:
    """The largest modulus of the half map's multipliers at a cycle."""
    matrix = HalfFlights(disk, omega, engine, DOUBLE).map(state).matrix
    return float(numpy.abs(numpy.linalg.eigvals(numpy.array(matrix))).max())


def _unstable_nodes(family: AmplitudeFamily, engine: Engine) -> tuple[Any, str]:
    """(n, 3): Omega, the piece and whether the cycle is unstable, along the family; and what else happens on it."""
    rows = []
    for row in family.nodes[:: _EACH + 1]:
        s, omega = float(row[0]), float(row[3])
        if min((abs(s - turn) for turn in (0.0, *family.folds)), default=1.0) < _NEXT_TO_A_FOLD:
            continue
        place = family.place(s)
        piece = sum(turn < s for turn in family.folds)
        with suppress(InputError, Shortfall):  # next to the connection an orbit may miss the way back
            rows.append((omega, piece, _spectral_radius(family.parameters, omega, place.start, engine) > 1))
    found = numpy.array(rows, dtype=float).reshape(-1, 3)
    changes = []
    for piece in range(len(family.folds) + 1):
        mine = found[found[:, 1] == piece]
        for before, after in pairwise(mine):
            if before[2] != after[2]:
                low, high = sorted((before[0], after[0]))
                changes.append(f"cycles change their stability without a fold between {low:.6g} and {high:.6g} rad/s")
    return found, "; ".join(changes)


def _cycle_there(
    family: AmplitudeFamily | None, unstable: Any, low: float, omega: float, high: float, engine: Engine
) -> bool | None:
    """Whether a stable cycle exists at a speed, if that is so in the whole cell."""
    if family is None:
        return None
    answer = False
    for place in family.places(omega):
        radius = _spectral_radius(family.parameters, omega, place.start, engine)
        inside = unstable[(unstable[:, 0] > low) & (unstable[:, 0] < high) & (unstable[:, 1] == place.piece)]
        if ((inside[:, 2] != 0) != (radius > 1)).any():
            return None
        answer = answer or radius < 1
    # What is not connected goes on beyond what is followed, and may have stable cycles there.
    return answer or (False if family.connected else None)
