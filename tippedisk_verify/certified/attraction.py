"""Which states on the section end on the limit cycle, or on inverted spinning, proved.

Orbits that keep standing come to the slow manifold within a fraction of a second, so they cross the section near one
curve. A `Strip` of cells (boxes in gamma_bar and v) covers that curve; the half map of every cell is enclosed at once
(`lane_flight`), and what follows is combinatorial.

**The cycle.** Let R = {m + T u: |u_1|, |u_2| <= 1} lie in the union of some cells. P's derivative at any point of R is
in the hull D of what is enclosed over these cells. R is convex, so by the mean value theorem P takes m + T u to
m + T (T^-1 (P(m) - m) + T^-1 D' T u) with D' in D. If for each i

    |T^-1 (P(m) - m)|_i + sum over j of |T^-1 D T|_ij < 1,

then P maps R into itself and contracts the norm max |u_i|. By Banach's theorem R holds one fixed point, and every orbit
from R tends to its cycle.

**Inverted spinning.** Let z = T^-1 x and B = {x: |z|_2 <= rho}. The field vanishes at 0, so z' = T^-1 J T z with J in
the hull of the Jacobian over a box around B (mean value theorem; that hull is convex). If the symmetric part of
T^-1 J T is negative definite for each of them (Gershgorin's discs lie left of 0), then |z|_2 falls in B, and every
orbit from B tends to 0.

**Cells.** A cell is decided if the enclosure of its image lies in a region R or B, or in a union of decided cells. By
induction every orbit from a decided cell comes to the region, and of each half map it is proved that the disk keeps
standing (`section`).

What is chosen: the cells, m, T and rho. Any that pass these tests would do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from flint import arb_mat
from numpy.typing import NDArray

from tippedisk_verify.certified.angles import INVERTED, OPS, Turned
from tippedisk_verify.certified.balls import arb, ball, ball_constants, inside, negative
from tippedisk_verify.certified.flow import Model
from tippedisk_verify.certified.lane_flight import HalfFlights, half_flights
from tippedisk_verify.certified.lanes import Lanes
from tippedisk_verify.certified.section import UPRIGHT
from tippedisk_verify.model.equations import jacobian
from tippedisk_verify.model.parameters import Constants, Parameters
from tippedisk_verify.model.precision import DOUBLE

__all__ = ["Strip", "lane_model", "strip"]

Array = NDArray[Any]

_LEAST, _GREATEST, _PROBES = 0.01, 3.0, 300  # gamma_bar [rad] of the starts whose images show the curve
_SHARE = 0.15  # a cell's half-width in units of how far the half map moves it
_NEAREST = 0.005  # rad: how near a fixed point cells still become smaller
_WIDEST = 1e-3  # rad: half-width of a cell; the enclosure of a wider one's image says too little
_FINEST = 0.004  # and in units of gamma_bar: small orbits need small boxes
_SPARE, _SPARES = 1e-3, 1.5  # of v, and in units of the curve's rise: how much further than its curve a cell reaches
_MOST_CELLS = 4000
_UNIT = Lanes([0.0], [1.0])
_CENTRE = 2.0**-22  # radius of the boxes about cells' middles
_RADII = [2.0**-k for k in range(1, 12)]  # rho tried for B, in units of gamma_bar [rad]
_WEIGHTS = [0.01, 0.03, 0.1, 0.3, 1.0, 3.0]  # and how far it reaches along the fast direction


def lane_model(parameters: Parameters, omega: object, count: int) -> Model:
    """The linear law's equations at one exact speed [rad/s] in ``count`` lanes."""
    constants = Constants(*(Lanes.of([value]) for value in ball_constants(parameters)))
    return Model(constants, Lanes.of([ball(omega)])[np.zeros(count, int)])


@dataclass(frozen=True)
class Strip:
    """Cells on the section; [``edges[k]``, ``edges[k + 1]``) x [``low[k]``, ``high[k]``] is cell k [rad, rad/s]."""

    edges: Array
    low: Array
    high: Array
    ends: Array  #: of each cell the index of its attractor, -1 where none is proved
    attractors: tuple[str, ...]  #: "limit cycle" or "inverted spinning"

    def end(self, gamma_bar: Lanes, v: Lanes) -> Array:
        """Of each lane, the index of the attractor on which all its states on the section end; -1 if none is proved."""
        first, last, within = self.cells(gamma_bar, v)
        end = np.full(len(first), -1)
        for index in range(len(self.attractors)):
            passed = np.concatenate([[0], np.cumsum(self.ends == index)])
            end[within & (passed[last + 1] - passed[first] == last + 1 - first)] = index
        return end

    def cells(self, gamma_bar: Lanes, v: Lanes) -> tuple[Array, Array, Array]:
        """The first and the last cell that each lane's box meets, and whether the box lies in the union of these."""
        left, right = _ends(gamma_bar)
        bottom, top = _ends(v)
        within = (left >= self.edges[0]) & (right < self.edges[-1])
        first = np.where(within, np.searchsorted(self.edges, left, "right") - 1, 0)
        last = np.where(within, np.searchsorted(self.edges, right, "right") - 1, 0)
        for offset in range(int(np.max(last - first, initial=0)) + 1):
            cell = np.minimum(first + offset, last)
            within &= (self.low[cell] <= bottom) & (top <= self.high[cell])
        return first, last, within


def strip(parameters: Parameters, omega: object) -> Strip:
    """The strip of the linear law at an exact speed [rad/s]; without a decided cell where nothing is proved."""
    curve = _Curve(parameters, omega)
    edges = curve.edges()
    left, right = edges[:-1], edges[1:]
    ends = curve.v(edges)
    spare = _SPARE * np.minimum(1.0, abs(ends[1:])) + _SPARES * abs(np.diff(ends))
    low, high = np.minimum(ends[:-1], ends[1:]) - spare, np.maximum(ends[:-1], ends[1:]) + spare
    flights = _flights(lane_model(parameters, omega, len(left)), _hull(left, right), _hull(low, high))
    cells = Strip(edges, low, high, np.full(len(left), -1), ())
    names: list[str] = []
    found: list[Array] = []
    spinning = _Spinning.found(parameters, omega)
    if spinning is not None:
        names.append("inverted spinning")
        found.append(spinning.holds(*flights.image))
    for root in curve.attracting():
        region = _Region.found(parameters, omega, cells, flights, (root, float(curve.v(root))))
        if region is not None:
            names.append("limit cycle")
            found.append(region.holds(*flights.image))
    first, last, within = cells.cells(*flights.image)
    for index, decided in enumerate(found):
        ends_there = decided & flights.returned
        while True:
            passed = np.concatenate([[0], np.cumsum(ends_there)])
            more = within & flights.returned & (passed[last + 1] - passed[first] == last + 1 - first) & ~ends_there
            if not more.any():
                break
            ends_there |= more
        cells.ends[ends_there] = index
    return Strip(edges, low, high, cells.ends, tuple(names))


def _flights(model: Model, gamma_bar: Lanes, v: Lanes) -> HalfFlights:
    """The half map of boxes; images in mean-value form, which does not lose how states and moments go together."""
    wide = half_flights(model, gamma_bar, v, derivatives=True)
    middles = [Lanes(part.midpoints) for part in (gamma_bar, v)]
    # A box about the middle that is not too thin takes longer steps.
    centre = half_flights(model, *(Lanes(part.midpoints, _CENTRE) for part in middles))
    away = [part - middle for part, middle in zip((gamma_bar, v), middles, strict=True)]
    images = [part + row[0] * away[0] + row[1] * away[1] for part, row in zip(centre.image, wide.matrix, strict=True)]
    return replace(wide, image=tuple(images))


class _Curve:
    """Near which curve orbits cross the section, and how far the half map moves them along it: guesses, in doubles."""

    def __init__(self, parameters: Parameters, omega: object) -> None:
        constants = parameters.at(DOUBLE)
        starts = np.concatenate([np.geomspace(_LEAST, 0.1, 30), np.linspace(0.1, _GREATEST, _PROBES)[1:]])
        # Pure rolling, Eq. critical_manifold_tippdisk at beta = pi/2.
        rolling = -constants.e * float(ball(omega)) * np.sin(starts) / (constants.r + constants.e * np.cos(starts))
        flights = half_flights(
            lane_model(parameters, omega, len(starts)),
            Lanes(starts, _CENTRE * starts),
            Lanes(rolling, _CENTRE * starts),
        )
        image, v = (part.midpoints for part in flights.image)
        rising = flights.returned & (np.diff(image, prepend=-1.0) > 0)
        self._starts, self._image, self._v = starts[rising], image[rising], v[rising]

    def v(self, gamma_bar: Any) -> Any:
        return np.interp(gamma_bar, self._image, self._v)

    def moved(self, gamma_bar: Any) -> Any:
        return np.interp(gamma_bar, self._starts, self._image) - gamma_bar

    def attracting(self) -> list[float]:
        """Fixed points that the half map comes nearer to from both sides."""
        moved = self._image - self._starts
        falls = np.flatnonzero((moved[:-1] > 0) & (moved[1:] <= 0))
        return [
            float(np.interp(0.0, [-moved[k], -moved[k + 1]], [self._starts[k], self._starts[k + 1]])) for k in falls
        ]

    def edges(self) -> Array:
        """Those of cells, smaller where the half map moves less."""
        if len(self._image) < 2:
            return np.array([0.0, _LEAST])
        roots = self.attracting()
        edges = [max(float(self._image[0]), _LEAST)]
        while edges[-1] < self._image[-1] and len(edges) < _MOST_CELLS:
            here = edges[-1]
            near = [root for root in roots if abs(here - root) < _NEAREST]
            moved = abs(float(self.moved(near[0] - _NEAREST if near else here)))
            edges.append(here + 2 * min(_WIDEST, _FINEST * here, _SHARE * max(moved, 1e-5)))
        return np.array(edges)


@dataclass(frozen=True)
class _Region:
    """R of the module: around a fixed point of the half map, which attracts all of it."""

    middle: tuple[Any, Any]
    inverse: Any  #: T^-1, exact

    @classmethod
    def found(
        cls, parameters: Parameters, omega: object, cells: Strip, flights: HalfFlights, guess: tuple[float, float]
    ) -> _Region | None:
        for reach in (4 * _NEAREST, 2 * _NEAREST, _NEAREST):
            region = cls._tried(parameters, omega, cells, flights, guess, reach)
            if region is not None:
                return region
        return None

    @classmethod
    def _tried(
        cls,
        parameters: Parameters,
        omega: object,
        cells: Strip,
        flights: HalfFlights,
        guess: Sequence[float],
        reach: float,
    ) -> _Region | None:
        covering = np.flatnonzero(
            (cells.edges[1:] > guess[0] - 1.2 * reach) & (cells.edges[:-1] < guess[0] + 1.2 * reach)
        )
        if not flights.returned[covering].all() or len(covering) < 2:
            return None
        here = covering[len(covering) // 2]
        (a, b), (c, d) = ((float(entry.midpoints[here]) for entry in row) for row in flights.matrix)
        value, vectors = np.linalg.eig(np.array([[a, b], [c, d]]))
        slow, fast = vectors[:, np.argmax(abs(value))], vectors[:, np.argmin(abs(value))]
        if np.iscomplexobj(value):
            return None
        columns = np.column_stack([slow / slow[0] * reach, fast / fast[1] * _SPARE / 2])
        inverse = arb_mat([[arb(float(entry)) for entry in row] for row in np.linalg.inv(columns)])
        directions = inverse.inv()
        middle = Lanes([guess[0]]), Lanes([guess[1]])
        flight = half_flights(lane_model(parameters, omega, 1), *middle)
        if not flight.returned.all():
            return None
        # D, over cells in whose union R lies.
        spread = [[_around(entry, covering) for entry in row] for row in flights.matrix]
        region = cls((arb(guess[0]), arb(guess[1])), inverse)
        if not region._covered(directions, cells, covering):
            return None
        offset = inverse * arb_mat([[part.arb(0) - mid] for part, mid in zip(flight.image, region.middle, strict=True)])
        slopes = inverse * arb_mat(spread) * directions
        shrinks = all(negative(abs(offset[row, 0]) + abs(slopes[row, 0]) + abs(slopes[row, 1]) - 1) for row in range(2))
        return region if shrinks else None

    def _covered(self, directions: Any, cells: Strip, covering: Array) -> bool:
        """Whether R lies in the union of these cells, which follow each other."""
        (along, tilt), (rise, across) = directions.tolist()
        half = abs(along) + abs(tilt)
        reach = self.middle[0] + half * arb(0, 1)
        if not inside(reach, _interval(cells.edges[covering[0]], cells.edges[covering[-1] + 1])):
            return False
        slope = rise / along
        thick = abs(across - slope * tilt) * arb(0, 1)
        for cell in covering:
            part = _interval(cells.edges[cell], cells.edges[cell + 1]) - self.middle[0]
            if not inside(self.middle[1] + slope * part + thick, _interval(cells.low[cell], cells.high[cell])):
                return False
        return True

    def holds(self, gamma_bar: Lanes, v: Lanes) -> Array:
        """Of each lane, whether its box lies in R."""
        first, second = (part - mid for part, mid in zip((gamma_bar, v), self.middle, strict=True))
        rows = [first * self.inverse[row, 0] + second * self.inverse[row, 1] for row in range(2)]
        return np.asarray(rows[0].inside(_UNIT) & rows[1].inside(_UNIT))


@dataclass(frozen=True)
class _Spinning:
    """B of the module: around inverted spinning, which attracts all of it."""

    inverse: Any  #: T^-1, exact
    square: Any  #: of rho

    @classmethod
    def found(cls, parameters: Parameters, omega: object) -> _Spinning | None:
        constants, speed = ball_constants(parameters), ball(omega)
        derivative = jacobian(OPS, constants, speed, "linear")

        def linear(box: Sequence[Any]) -> Any:
            rows = derivative(Turned(1, box[0]), Turned(INVERTED, box[1]), box[2])
            return arb_mat([[arb(entry) for entry in row] for row in rows])

        at_rest = np.array([[float(entry.mid()) for entry in row] for row in linear([arb(0)] * 3).tolist()])
        basis = _real_basis(at_rest)
        for radius, weight in product(_RADII, _WEIGHTS):
            inverse = arb_mat([[arb(float(entry)) for entry in row] for row in np.linalg.inv(basis * [1, 1, weight])])
            directions = inverse.inv()
            lengths = [sum((entry * entry for entry in row), arb(0)).sqrt() for row in directions.tolist()]
            turned = inverse * linear([length * arb(0, radius) for length in lengths]) * directions
            symmetric = (turned + turned.transpose()) / 2
            if inside(lengths[0] * radius, arb(0, UPRIGHT)) and all(
                negative(symmetric[k, k] + sum((abs(symmetric[k, j]) for j in range(3) if j != k), arb(0)))
                for k in range(3)
            ):
                return cls(inverse, arb(radius) ** 2)
        return None

    def holds(self, gamma_bar: Lanes, v: Lanes) -> Array:
        """Of each lane, whether its box on the section lies in B."""
        rows = [gamma_bar * self.inverse[row, 1] + v * self.inverse[row, 2] for row in range(3)]
        return np.asarray((sum((row.square() for row in rows), Lanes([0.0])) - self.square).negative())


def _real_basis(matrix: Array) -> Array:
    """Columns in which a matrix is diagonal but for turns, the fastest last, of size 1 in gamma (the second row)."""
    values, vectors = np.linalg.eig(matrix)
    order = np.argsort(abs(values.real), kind="stable")
    values, vectors = values[order], vectors[:, order] / vectors[1, order]
    if values[0].imag:
        vectors[:, 1] = (vectors[:, 0] * 1j).real
    return np.asarray(vectors.real)


def _ends(lanes: Lanes) -> tuple[Array, Array]:
    """Doubles that are not above the least and not below the greatest number of each ball."""
    # A sum to nearest is less than one double away from the exact one.
    with np.errstate(invalid="ignore"):
        low = np.nextafter(lanes.midpoints - lanes.radii, -np.inf)
        high = np.nextafter(lanes.midpoints + lanes.radii, np.inf)
    finite = lanes.is_finite()
    return np.where(finite, low, -np.inf), np.where(finite, high, np.inf)


def _hull(low: Array, high: Array) -> Lanes:
    return Lanes(low).union(Lanes(high))


def _interval(low: float, high: float) -> Any:
    return arb(float(low)).union(arb(float(high)))


def _around(entry: Lanes, lanes: Array) -> Any:
    """A ball that holds all of some lanes."""
    low, high = _ends(entry[lanes])
    return _interval(low.min(), high.max())
