"""What orbits from many boxes of states end on, proved: the disk lies flat, or the orbit reaches a decided cell.

Every box moves in a lane by proved steps (`flow`) until one of these is shown:

- *Lies flat.* |beta_bar| > pi/2 at the end of a step. The field is analytic there too, so the orbit has passed
  sin(beta) = 0 before, where the model ends.
- *A decided cell.* In a step beta_bar rises through 0 and v > 0 throughout; until its end |beta_bar| < pi/2 is proved.
  The state at the crossing, mapped back by the symmetry and by whole turns of gamma, lies in cells of the
  `attraction.Strip` that end on one attractor.

What shows neither in the time allowed, or can no longer be enclosed, is undecided. The boxes are those around the
doubles that are asked for, of radius 2^-20; all states of a box share what is said of it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tippedisk_verify.certified.attraction import Strip, lane_model
from tippedisk_verify.certified.balls import arb, inside, negative, positive
from tippedisk_verify.certified.lane_flight import MOST_TRIALS, SHORTEST_STEP, Block, guess, some
from tippedisk_verify.certified.lanes import Lanes, quiet
from tippedisk_verify.certified.section import UPRIGHT, moment_of_crossing
from tippedisk_verify.model.parameters import Parameters

__all__ = ["proved_outcomes"]

Array = NDArray[Any]

_UNDECIDED, _FLAT = -1, -2  # where a box ends, besides the indices of the strip's attractors
_RADIUS = 2.0**-20  # rad, rad/s
_UPRIGHT_STATE = np.array([math.pi / 2, math.pi / 2, 0.0])
_BLOCK = 2000  # lanes at a time


def proved_outcomes(
    states: Array,
    names: tuple[str, ...],
    strip: Strip,
    parameters: Parameters,
    omega: object,
    duration: float,
) -> Array:
    """Of states (n, 3) the index in ``names`` of what all states of each one's box end on within ``duration`` [s]."""
    meaning = {_UNDECIDED: "undecided", _FLAT: "lies flat", **dict(enumerate(strip.attractors))}
    ends = np.full(len(states), _UNDECIDED)
    with quiet():
        for first in range(0, len(states), _BLOCK):
            lanes = np.arange(first, min(first + _BLOCK, len(states)))
            path = _Wandering(lane_model(parameters, omega, len(lanes)), states[lanes] - _UPRIGHT_STATE, lanes)
            path.follow(ends, strip, duration)
    return np.array([names.index(meaning[end]) for end in ends.tolist()], dtype=np.int8)


class _Wandering(Block):
    """Orbits that have not ended yet."""

    def __init__(self, model: Any, states: Array, lanes: Array) -> None:
        super().__init__(model, [Lanes(part, _RADIUS) for part in states.T], (0, 0), lanes)
        self.upright = inside(self.box[0], Lanes([0.0], [UPRIGHT]))  #: throughout what was followed

    def follow(self, ends: Array, strip: Strip, duration: float) -> None:
        """Note where every lane ends."""
        path = self
        while len(path.lanes):
            stuck = path.ended(duration) != None  # noqa: E711
            if stuck.any():
                path = path.some(np.flatnonzero(~stuck))
                continue
            found, gone = path._round(strip)
            ends[path.lanes[gone]] = found[gone]
            if gone.any():
                path = path.some(np.flatnonzero(~gone))

    def _round(self, strip: Strip) -> tuple[Array, Array]:
        """One step tried in each lane: where it ends, and whether it is not followed any further."""
        step, accepted = self.tried()
        found = np.full(len(self.lanes), _UNDECIDED)
        beta_end = step.at_end()[0]
        right = Lanes.of([arb.pi() / 2])
        found[accepted & (positive(beta_end - right) | negative(beta_end + right))] = _FLAT
        self.upright &= ~accepted | inside(step.enclosure[0], Lanes([0.0], [UPRIGHT]))
        v = step.enclosure[2]
        rising = accepted & self.upright & negative(self.box[0]) & positive(beta_end) & positive(v)
        which = np.flatnonzero(rising)
        if len(which):
            found[which] = _ended(some(step, which), strip)
        short = ~(step.length.midpoints >= SHORTEST_STEP)
        self.go_on(step, accepted)
        return found, (found != _UNDECIDED) | ~accepted & (short | (self.failures >= MOST_TRIALS))


def _ended(step: Any, strip: Strip) -> Array:
    """Of lanes that cross the section upwards in a step, on which attractor they end."""
    moment, sure = moment_of_crossing(step, guess(step, 0), step.enclosure[2])
    _, gamma_bar, v = step.at(moment)
    turns = np.rint(gamma_bar.midpoints / (2 * math.pi))
    gamma_bar = gamma_bar - Lanes(np.where(np.isfinite(turns), turns, 0.0)) * Lanes.of([2 * arb.pi()])
    return np.where(sure, strip.end(-gamma_bar, -v), _UNDECIDED)
