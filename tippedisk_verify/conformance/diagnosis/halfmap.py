"""Orbits from a section to its image, with the variational equations and what people write in their place.

By the specimen's `equations`, `derivatives`, `flow` and `runge_kutta_step`, with nothing repeated of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from tippedisk_verify.conformance.diagnosis.entries import Array
from tippedisk_verify.conformance.diagnosis.specimen import specimen

__all__ = ["RINGS", "VARIANTS", "Flight", "Ring", "of"]

_STEP, _QUARTER = 0.005, np.pi / 2


class Ring(NamedTuple):
    """The section of a kind of cycle: its component of (beta, gamma, v), those kept, and what is asked of these."""

    axis: int
    kept: tuple[int, int]
    end: float  #: the section's component after the map
    start: tuple[str, str]
    parts: int  #: maps to a period
    sign: float  #: of the map's symmetry


_HALF = Ring(0, (1, 2), _QUARTER, ("gamma_bar_0", "v_0"), 2, -1.0)
_TURN = Ring(1, (0, 2), 5 * _QUARTER, ("beta_bar_top", "v_top"), 1, 1.0)
RINGS = {"limit-cycle": _HALF, "near-heteroclinic": _HALF, "rotating-cycle": _TURN}
_PLACES = {(1, 3): "dgamma'/dOmega", (2, 3): "dv'/dOmega", (1, 0): "dgamma'/dbeta", (2, 1): "dv'/dgamma",
           (2, 0): "dv'/dbeta", (2, 2): "dv'/dv"}  # fmt: skip
_IN = "in the variational equations"
#: Of the variational equations: what is said, the place, and the view and the factor that are there.
VARIANTS: list[tuple[str, Any, int, float]] = [
    ("", (), 0, 1), ("the variational equations are at 30.92, not at the cycle's Omega", (), 2, 1),
    ("the variational equations are at Omega_crit, not at the cycle's Omega", (), 3, 1),
    ("the variational equations have the other friction law", (), 4, 1),
    *((f"{name} {says} {_IN}", place, 0, f) for place, name in _PLACES.items()
      for says, f in (("is missing", 0), ("has the wrong sign", -1))),
    (f"the friction's part of dv'/dOmega is missing {_IN}", (2, 3), 1, 1), ("", (), 0, 1),
]  # fmt: skip
VARIANTS[-1] = (f"all explicit parts by Omega are missing {_IN}", (slice(None), 3), 0, 0)
_VIEW, _FACTOR = np.zeros((len(VARIANTS), 3, 4), int), np.ones((len(VARIANTS), 3, 4))
for _k, (_, _place, _view, _factor) in enumerate(VARIANTS):
    _VIEW[(_k, *_place)], _FACTOR[(_k, *_place)] = _view, _factor


def of(name: str) -> Any:
    return specimen().space[name]


def _matrices(p: Any, Omega: Array, smooth: bool, s: Array, variants: int) -> tuple[Array, Array]:
    """d(rates)/d(beta, gamma, v, Omega) by variant, and v'."""

    def one(p: Any, Omega: Array, law: bool, s: Array) -> tuple[Array, Array]:
        *slopes, rate = of("derivatives")(p, Omega, law, *s)
        zero = 0 * rate
        fixed = [[zero, zero, zero + 1, zero], [Omega * np.sin(s[0]), zero, zero, -np.cos(s[0])]]
        return np.array([*fixed, slopes]), rate

    if variants == 1:
        matrix, rate = one(p, Omega, smooth, s)
        return matrix[None], rate
    n = Omega.size
    many = [np.tile(parameter, 4) for parameter in p]
    many[6][n : 2 * n] = 0  # no friction
    speeds = np.concatenate([Omega, Omega, 30.92 + 0 * Omega, of("critical_speed")(p)])
    matrix, rate = one(tuple(many), speeds, smooth, np.tile(s, 4))
    views = np.stack([*np.moveaxis(matrix.reshape(3, 4, 4, n), 2, 0), one(p, Omega, not smooth, s)[0]])
    return views[_VIEW, np.arange(3)[:, None], np.arange(4)] * _FACTOR[..., None], rate[:n]


def _rates(variants: int) -> Callable[..., Array]:
    """The rates of a state, of its variations by the start and Omega, and of the divergence's integral."""

    def rates(p: Any, Omega: Array, smooth: bool, y: Array) -> Array:
        if not variants:
            return np.asarray(of("flow")(p, Omega, smooth, y))
        matrix, rate = _matrices(p, Omega, smooth, y[:3], variants)
        by = np.einsum("vikn,vkjn->vijn", matrix[:, :, :3], y[3 : 3 + 9 * variants].reshape(variants, 3, 3, -1))
        by[:, :, 2] += matrix[:, :, 3]
        return np.concatenate([[y[2], -Omega * np.cos(y[0]), rate], by.reshape(9 * variants, -1), matrix[:, 2, 2]])

    return rates


def _stepped(variants: int, p: Any, Omega: Array, smooth: bool, y: Array, h: Array, speeds: list[Array]) -> Array:
    """A step, in two parts where gamma_y at one of the speeds passes zero: there second derivatives jump."""
    step = of("runge_kutta_step")
    if not speeds:
        return np.asarray(step(_rates(variants), p, Omega, smooth, y, h))
    after = _stepped(variants, p, Omega, smooth, y, h, speeds[1:])
    slips = [of("equations")(p, speeds[0], smooth, *z[:3])[4] for z in (y, after)]
    cut = slips[0] * slips[1] < 0
    if cut.any():
        some, start, last = (tuple(one[cut] for one in p), Omega[cut], smooth), y[:, cut], h[cut]
        first, other, (speed, *more) = slips[0][cut], slips[1][cut], [one[cut] for one in speeds]
        part = last * first / (first - other)
        for _ in range(3):
            now = of("equations")(some[0], speed, smooth, *step(_rates(0), *some, start[:3], part))[4]
            move = np.nan_to_num(-now * (part - last) / (now - other), posinf=0, neginf=0)
            part, last, other = part + move, part, now
        middle = _stepped(variants, *some, start, part, more)
        after[:, cut] = _stepped(variants, *some, middle, h[cut] - part, more)
    return after


@dataclass(frozen=True, eq=False)
class Flight:
    """Orbits from the section for given times, one to a column, with variants of the variational equations."""

    ring: Ring
    p: tuple[Array, ...]
    Omega: Array
    smooth: bool
    start: Array
    time: Array
    variants: int = 1

    @cached_property
    def rows(self) -> Array:
        y = np.zeros((3 + 10 * self.variants, self.Omega.size))
        y[:2] = _QUARTER
        for k, one in enumerate(self.ring.kept):
            y[one] += self.start[k]
            y[[3 + 9 * v + 3 * one + k for v in range(self.variants)]] = 1
        h = _STEP / 2 if self.smooth and np.max(self.time) > 1 else _STEP  # rounding's share grows near a saddle
        rows, count = [y], int(np.ceil(np.max(self.time) / h))
        speeds = [self.Omega] if self.smooth else []
        if self.variants > 1:
            speeds = [self.Omega, 30.92 + 0 * self.Omega, of("critical_speed")(self.p)]
        for _ in range(count):
            rows.append(_stepped(self.variants, self.p, self.Omega, self.smooth, rows[-1], self.time / count, speeds))
        return np.array(rows)

    @property
    def period(self) -> Array:
        return self.ring.parts * self.time

    def divergence(self, variant: int = 0) -> Array:
        """The integral of d(v')/dv over a period."""
        last = self.rows[-1][3 + 9 * self.variants :]
        return np.asarray(self.ring.parts * last[variant] if variant < self.variants else np.nan * self.time)

    def slope(self) -> Array:
        """d(v')/dv at the start."""
        return np.asarray(of("derivatives")(self.p, self.Omega, self.smooth, *self.rows[0, :3])[2])

    def flow(self, state: Array, law: bool | None = None) -> Array:
        return np.asarray(of("flow")(self.p, self.Omega, self.smooth if law is None else law, state[:3]))

    @cached_property
    def missed(self) -> Array:
        """How far the end is from the section, and its image from the start."""
        end = self.rows[-1][:3]
        image = self.ring.sign * (end - [[_QUARTER], [_QUARTER], [0]])[list(self.ring.kept)]
        return np.concatenate([[end[self.ring.axis] - self.ring.end], image - self.start])

    def change(self, variant: int = 0, row: Array | None = None) -> Array:
        """d(state) / d(start, Omega) at the end, or of another row, by entry."""
        y = self.rows[-1] if row is None else row
        return np.moveaxis(y[3 + 9 * variant : 12 + 9 * variant].reshape(3, 3, -1), 2, 0)

    def image(self) -> Array:
        """The start's image on the section."""
        y, tau, i = self.rows[-1], 0 * self.time, self.ring.axis
        for _ in range(4):
            there = self.moved(y, tau)
            tau = tau - (there[i] - self.ring.end) / self.flow(there)[i]
        return self.ring.sign * (self.moved(y, tau)[:3] - [[_QUARTER], [_QUARTER], [0]])[list(self.ring.kept)]

    def instant(self, index: int, target: float, sign: int = 0) -> tuple[Array, Array]:
        """Time and state where a component first passes the target, upward for sign 1, either way for 0."""
        over = self.rows[1:, index] - target
        row = np.argmax((over[1:] * over[:-1] <= 0) & (sign * (over[1:] - over[:-1]) >= 0), axis=0) + 1
        y, h = self.rows[row, :, np.arange(self.Omega.size)].T, self.time / (len(self.rows) - 1)
        tau = 0 * h
        for _ in range(5):
            there = self.moved(y, tau)
            tau = tau - (there[index] - target) / self.flow(there)[index]
        return row * h + tau, self.moved(y, tau)

    def moved(self, y: Array, tau: Array) -> Array:
        return np.asarray(of("runge_kutta_step")(_rates(self.variants), self.p, self.Omega, self.smooth, y, tau))
