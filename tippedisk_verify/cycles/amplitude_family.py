"""The family of librating limit cycles by amplitude: from the Hopf point, through any folds, to the connection.

Omega may turn round along the family, the amplitude gamma_bar_0 does not. The abscissa is s with gamma_bar_0 = pi
tanh(s): v_0 / gamma_bar_0, the period and Omega are analytic in s at the Hopf point, s = 0, and in the distance from
the saddle, which falls like exp(-2 s). They are polynomials through Chebyshev nodes on panels of s, each solved from
the panel before, until Omega is as close to its limit as is asked for.

Towards a saddle whose stable eigenvalues are complex, orbits wind: the amplitude then reaches pi at v_0 != 0, short of
the connection. There what is followed here ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any, NamedTuple

import numpy

from tippedisk_verify.cycles.half_map import HalfFlights
from tippedisk_verify.cycles.newton import NewtonIteration
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.arrays import Array
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE
from tippedisk_verify.theory.hopf import critical_frequency_squared, omega_crit

__all__ = ["AmplitudeFamily", "Place", "Solved", "amplitude", "one_at_a_time"]

NODES = 20  #: nodes of a panel; the polynomials then err by rounding
_SHORT, _LONG, _SHORT_PANELS = 0.4, 0.8, 3  # lengths of the first few panels and of the others
_GROUP = 8  # nodes that are solved together
_DEGREE = 7  # of the extrapolation to the next ones, through values and slopes
_CLOSEST = 1e-5  # rad/s; how near its limit Omega is followed: beyond, doubles hold no more cycles
_SLOWEST, _FASTEST = 1.5, 6.0  # rates at which the slope of Omega falls towards a connection: from 2 to 4, nearly
_MOST_PANELS = 10  # the amplitude is then within 1e-5 of pi
_JUMPED = 0.3  # relative; what is found farther than this from where it was looked for is another orbit
_APART = 0.15  # of the change between neighbours
_NEXT_TO_A_NODE = 1e-3  # of s; where nodes would have to be closer together the family is lost
_MOST_STEPS = 10  # of Newton's iteration for an abscissa
_SETTLED = 1e-9  # a relative step that rounding follows


class Solved(NamedTuple):
    """Cycles of given amplitudes as (n,) arrays; NaN where none was found. Slopes are by the amplitude."""

    v: Array  #: v_0 [rad/s]
    half: Array  #: T / 2 [s]
    omega: Array  #: [rad/s]
    v_slope: Array
    half_slope: Array
    omega_slope: Array


#: (gamma_bar_0, v_0, T / 2, Omega), the first given and the others guessed, as (n,) arrays.
Solver = Callable[[Array, Array, Array, Array], Solved]


@dataclass(frozen=True)
class Place:
    """A cycle of the family, in double, as far as the polynomials tell."""

    s: float
    gamma_bar: float  #: [rad]
    v: float  #: [rad/s]
    half_period: float  #: [s]
    omega: float  #: [rad/s]
    piece: int  #: counted from the Hopf point, one more after each fold

    @property
    def start(self) -> tuple[float, float]:
        """(gamma_bar, v) on the section."""
        return self.gamma_bar, self.v


def amplitude(s: Any) -> Any:
    """gamma_bar_0 [rad] at the abscissa."""
    return numpy.pi * numpy.tanh(s)


def _named(name: str, speed: float) -> str:
    """An end of the family and its speed, in words."""
    return f"{name} {'=' if name.startswith('Omega') else 'at'} {speed:.7g} rad/s"


def _by_s(s: Array) -> Any:
    """The amplitude's derivative."""
    return numpy.pi / numpy.cosh(s) ** 2


def _edge(index: int) -> float:
    """Where the panel of that number begins."""
    return _SHORT * min(index, _SHORT_PANELS) + _LONG * max(0, index - _SHORT_PANELS)


class AmplitudeFamily:
    """The family of one disk under its friction law, in double.

    ``solve`` finds cycles of given amplitudes; without one the engine does, one at a time. The family is followed until
    Omega is within ``closest`` [rad/s] of its limit. Raises NoSuchCycleError where it cannot be followed.
    """

    def __init__(
        self,
        parameters: Parameters,
        engine: Engine | None = None,
        solve: Solver | None = None,
        closest: float = _CLOSEST,
    ) -> None:
        self.parameters, self.engine = parameters, engine
        if solve is None:
            if engine is None:
                raise TypeError("a family needs an engine or a solver")
            solve = one_at_a_time(parameters, engine)
        self._solve = solve
        self.omega_crit = float(omega_crit(parameters))
        panels: list[Array] = []
        self._rows = numpy.empty((0, 7))
        while not panels or (self._left(panels[-1]) > closest and len(panels) < _MOST_PANELS):
            panels.append(self._panel(len(panels)))
        if not self._left(panels[-1]) < math.inf:
            raise NoSuchCycleError(self._lost(panels[-1][-1, 0]))
        #: Nodes on each panel, rising, as (panels, nodes, 7): s, v / gamma_bar, T / 2, Omega and their slopes by s.
        self._panels = numpy.stack(panels)

    # ------------------------------------------------------------------------------------------------ the panels
    def _panel(self, index: int) -> Array:
        angles = (2 * numpy.arange(NODES)[::-1] + 1) * numpy.pi / (2 * NODES)
        start = _edge(index)
        wanted = start + (_edge(index + 1) - start) * (1 + numpy.cos(angles)) / 2
        rows = numpy.empty((NODES, 7))
        known, solved = self._rows, 0
        while solved < NODES:
            found = self._solved(wanted[solved : solved + _GROUP], known)
            good = int(numpy.argmin(numpy.append(numpy.isfinite(found[:, 3]), False)))
            if not good:
                known = self._between(known, wanted[solved])
                continue
            rows[solved : solved + good] = found[:good]
            known = numpy.concatenate((known, found[:good]))
            solved += good
        self._rows = rows
        return rows

    def _between(self, known: Array, target: float) -> Array:
        """More known cycles on the way to a node that was not reached; the last of them is halfway there."""
        begin = known[-1, 0] if len(known) else 0.0
        if target - begin < _NEXT_TO_A_NODE:
            raise NoSuchCycleError(self._lost(target))
        found = self._solved(begin + (target - begin) * numpy.arange(1, _GROUP + 1) / (2 * _GROUP), known)
        good = int(numpy.argmin(numpy.append(numpy.isfinite(found[:, 3]), False)))
        if not good:
            raise NoSuchCycleError(self._lost(target))
        return numpy.concatenate((known, found[:good]))

    def _solved(self, s: Array, known: Array) -> Array:
        """Rows as those of the panels; NaN where no cycle of the family was found."""
        guess = self._guess(s, known)
        a, rate = amplitude(s), _by_s(s)
        with numpy.errstate(invalid="ignore"):
            found = Solved(*self._solve(a, guess[0] * a, guess[1], guess[2]))
            values = numpy.stack((found.v / a, found.half, found.omega))
            jumped = (numpy.abs(values - guess) > _JUMPED * numpy.abs(guess)).any(axis=0)
            slopes = numpy.stack(((found.v_slope - found.v / a) / a, found.half_slope, found.omega_slope)) * rate
        rows = numpy.concatenate((s[None], values, slopes)).T
        rows[jumped | _apart(rows, known)] = numpy.nan
        return rows

    def _guess(self, s: Array, known: Array) -> Any:
        """(3, n): v / gamma_bar, T / 2 and Omega on the polynomials through what is known."""
        if not len(known):
            frequency = math.sqrt(critical_frequency_squared(self.parameters))
            linear = (-(frequency**2) / self.omega_crit, math.pi / frequency, self.omega_crit)
            return numpy.repeat(numpy.array(linear)[:, None], len(s), axis=1)
        near = known[-_GROUP:]
        away, size = near[:, 0] - s[0], near[-1, 0] - near[0, 0] + s[0] - near[-1, 0]
        degree = min(_DEGREE, 2 * len(near) - 1)
        powers = numpy.vander(away / size, degree + 1)
        rates = numpy.zeros_like(powers)
        rates[:, :-1] = powers[:, 1:] * numpy.arange(degree, 0, -1)
        right = numpy.concatenate((near[:, 1:4], near[:, 4:] * size))
        coefficients = numpy.linalg.lstsq(numpy.concatenate((powers, rates)), right, rcond=None)[0]
        return (numpy.vander((s - s[0]) / size, degree + 1) @ coefficients).T

    def _left(self, panel: Array) -> float:
        """How far Omega is from its limit at the end of a panel, by how fast its slope falls.

        Infinite if it does not fall as it does towards a connection: there Omega - Omega_h goes with the distance from
        the saddle to the power 1 + min(q, 1 / q), where q = |lambda_s| / lambda_u, and the distance like exp(-2 s).
        """
        slopes = numpy.abs(panel[-3:, 6])
        rate = math.log(slopes[0] / slopes[2]) / (panel[-1, 0] - panel[-3, 0]) if slopes.all() else 0.0
        return float(slopes[2] / rate) if _SLOWEST < rate < _FASTEST else math.inf

    def _lost(self, s: float) -> str:
        return f"the family of limit cycles could not be followed to the amplitude {amplitude(s):.6g} rad"

    # ------------------------------------------------------------------------------------------------ what it tells
    @property
    def nodes(self) -> Array:
        """(n, 7) rows of all nodes, from the Hopf point on."""
        return self._panels.reshape(-1, 7)

    @property
    def limit(self) -> float:
        """Where Omega tends to at the end [rad/s], to some part of its distance from there."""
        last = self._panels[-1]
        return float(last[-1, 3] + math.copysign(self._left(last), last[-1, 6]))

    @cached_property
    def connected(self) -> bool:
        """Whether the family is followed to the connection: v_0 falls towards its end as the distance from pi does."""
        s, ratio = self._panels[-1, [-3, -1], :2].T
        return bool(math.log(ratio[0] / ratio[1]) > s[1] - s[0])  # the distance falls twice as fast

    @cached_property
    def ends(self) -> tuple[tuple[str, float], ...]:
        """What bounds the pieces, by name, and its speed [rad/s]: the Hopf point, the folds and the connection.

        The last one is the amplitude pi, if the family is not `connected`.
        """
        turns = (("a fold", self.place(s).omega) for s in self.folds)
        return ("Omega_crit", self.omega_crit), *turns, ("Omega_h" if self.connected else "that amplitude", self.limit)

    def refusal(self, omega: float) -> str:
        """Why there is no cycle at a speed, if it lies outside the family; that none was found, if not."""
        lowest, highest = (choose(self.ends, key=lambda end: end[1]) for choose in (min, max))
        text = f"no limit cycle found at {omega:.10g} rad/s"
        if lowest[1] <= omega <= highest[1]:
            return text
        away, side = (omega - highest[1], "above") if omega > highest[1] else (lowest[1] - omega, "below")
        text += f": that is {away:.2g} rad/s {side} the family, which "
        if self.connected:
            return text + f"lies between {_named(*lowest)} and {_named(*highest)}"
        last = f"is followed to {self.limit:.7g} rad/s only, where gamma's amplitude is pi"
        return text + f"{last}, and lies so far between {_named(*lowest)} and {_named(*highest)}"

    @property
    def s_end(self) -> float:
        """The abscissa of the last node."""
        return float(self._panels[-1, -1, 0])

    @property
    def s_start(self) -> float:
        """The abscissa of the first node."""
        return float(self._panels[0, 0, 0])

    def between_nodes(self, s: Array, values: Array) -> Any:
        """What has these ``values`` (m, n) at the nodes, (m, k) at the abscissas (k,)."""
        ratios, panels = self.ratios(s)
        by_panel = values.reshape(len(values), -1, NODES)
        middle = by_panel[:, :, NODES // 2]  # without it the sum rounds what varies on the panel only
        return middle[:, panels] + ((by_panel - middle[:, :, None])[:, panels] * ratios).sum(axis=-1)

    def ratios(self, s: Array) -> tuple[Any, Any]:
        """Barycentric weights (k, nodes of a panel), each row with the sum 1, and the panel of each."""
        panels = numpy.searchsorted([_edge(k) for k in range(1, len(self._panels))], s)
        away = s[:, None] - self._panels[panels, :, 0]
        away[away == 0] = 2.0**-80  # at a node nothing else counts
        angles = (2 * numpy.arange(NODES)[::-1] + 1) * numpy.pi / (2 * NODES)
        ratios = (-1.0) ** numpy.arange(NODES) * numpy.sin(angles) / away
        return ratios / ratios.sum(axis=1, keepdims=True), panels

    def at(self, s: Array) -> Any:
        """(4, k): v / gamma_bar, T / 2, Omega and dOmega/ds at abscissas (k,)."""
        return self.between_nodes(s, self.nodes[:, [1, 2, 3, 6]].T)

    @cached_property
    def folds(self) -> tuple[float, ...]:
        """The abscissas at which Omega is extreme, in rising order."""
        s = numpy.linspace(self.s_start, self.s_end, 4 * len(self.nodes))
        slopes = self.at(s)[3]
        turns = []
        for k in numpy.flatnonzero(slopes[:-1] * slopes[1:] < 0):
            low, high = s[k], s[k + 1]
            while (middle := (low + high) / 2) not in (low, high):
                beyond = self.at(numpy.array([middle]))[3, 0] * slopes[k] <= 0
                low, high = (low, middle) if beyond else (middle, high)
            turns.append(float(middle))
        return tuple(turns)

    @property
    def breaks(self) -> tuple[float, ...]:
        """The abscissas between which Omega is monotonic: both ends and the folds."""
        return (self.s_start, *self.folds, self.s_end)

    @cached_property
    def _sampled(self) -> list[tuple[Array, Array]]:
        """Omega, rising, and s on each piece: what inversion starts from."""
        samples = []
        for low, high in zip(self.breaks, self.breaks[1:], strict=False):
            # Closer together towards both ends, at which Omega may be flat.
            s = (low + high) / 2 - (high - low) / 2 * numpy.cos(numpy.linspace(0, numpy.pi, 2 * len(self.nodes)))
            omega = self.at(s)[2]
            samples.append((omega, s) if omega[-1] > omega[0] else (omega[::-1], s[::-1]))
        return samples

    def abscissas(self, omegas: Array) -> Any:
        """(pieces, n): where each piece has these speeds [rad/s]; NaN where it does not."""
        rows = []
        for (known, s_known), low, high in zip(self._sampled, self.breaks, self.breaks[1:], strict=False):
            s = numpy.interp(omegas, known, s_known, left=numpy.nan, right=numpy.nan)
            inside = numpy.isfinite(s)
            here, wanted = s[inside], omegas[inside]
            for _ in range(_MOST_STEPS):  # next to a fold each of the first ones halves the error only
                before, (_, _, omega, slope) = here, self.at(here)
                with numpy.errstate(divide="ignore", invalid="ignore"):
                    here = numpy.clip(numpy.nan_to_num(here - (omega - wanted) / slope, nan=low), low, high)
                if not (numpy.abs(here - before) > _SETTLED).any():
                    break
            s[inside] = here
            rows.append(s)
        return numpy.stack(rows)

    def places(self, omega: float) -> Iterator[Place]:
        """The family's cycles at a speed [rad/s], from the smallest amplitude on."""
        for piece, (s,) in enumerate(self.abscissas(numpy.array([omega]))):
            if math.isfinite(s):
                yield self.place(float(s), piece)

    def place(self, s: float, piece: int = 0) -> Place:
        """The cycle at an abscissa."""
        ratio, half, omega, _ = (float(value) for value in self.at(numpy.array([s]))[:, 0])
        gamma_bar = float(amplitude(s))
        return Place(s, gamma_bar, ratio * gamma_bar, half, omega, piece)


def _apart(rows: Array, known: Array) -> Any:
    """(n,) whether a row does not continue the one before: no value has changed by what the slopes say.

    Over so short a way the trapezoidal rule is off by a few percent of the change on a family; on another orbit by all.
    """
    chain = numpy.concatenate((known[-1:] if len(known) else rows[:1], rows))
    step = numpy.diff(chain[:, 0])[:, None]
    change, slopes = numpy.diff(chain[:, 1:4], axis=0), chain[:, 4:]
    off = numpy.abs(change - step * (slopes[1:] + slopes[:-1]) / 2)
    size = numpy.abs(change) + step * numpy.maximum(numpy.abs(slopes[1:]), numpy.abs(slopes[:-1]))
    with numpy.errstate(invalid="ignore"):
        apart = (off > _APART * size + 1e-9 * numpy.abs(chain[1:, 1:4])).sum(axis=1) >= 2
    return numpy.logical_or.accumulate(apart)


def one_at_a_time(parameters: Parameters, engine: Engine) -> Solver:
    """Newton's iteration on the half map for each amplitude, with v and Omega as the unknowns."""

    def solve(gamma_bar: Array, v: Array, half: Array, omega: Array) -> Solved:
        rows = numpy.full((len(gamma_bar), len(Solved._fields)), numpy.nan)
        for index, (a, *guess) in enumerate(zip(gamma_bar.tolist(), v.tolist(), omega.tolist(), strict=True)):
            try:
                rows[index] = _one(parameters, engine, a, *guess)
            except NoSuchCycleError:
                break
        return Solved(*rows.T)

    return solve


def _one(parameters: Parameters, engine: Engine, gamma_bar: float, v: float, omega: float) -> Any:
    iteration = NewtonIteration(
        10, NoSuchCycleError("the iteration at fixed amplitude does not settle"), small=_SETTLED
    )
    while True:
        if not 0 < omega < math.inf:
            raise NoSuchCycleError("the iteration at fixed amplitude left the positive speeds")
        mapped = HalfFlights(parameters, Fraction(omega), engine, DOUBLE).map((gamma_bar, v))
        (a, b), (c, d) = mapped.matrix
        rows = numpy.array([[b, mapped.by_omega[0]], [d - 1, mapped.by_omega[1]]])
        right = numpy.array([[mapped.residual[0], a - 1], [mapped.residual[1], c]])
        if not numpy.isfinite(rows).all() or not numpy.linalg.det(rows):
            raise NoSuchCycleError("the iteration at fixed amplitude met a singular matrix")
        (v_step, v_slope), (omega_step, omega_slope) = -numpy.linalg.solve(rows, right)
        v, omega = v + v_step, omega + omega_step
        if iteration.converged(abs(v_step / v) + abs(omega_step / omega)):
            by_gamma, by_v = mapped.time_by_state
            rate = by_gamma + by_v * v_slope + mapped.time_by_omega * omega_slope
            return v, mapped.time, omega, v_slope, rate, omega_slope
