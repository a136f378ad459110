"""The maps next to the connection: a flight between the saddles, and a passage by one of them.

**The local map.** A cycle at a distance D from Omega_h spends most of its time next to the saddles,
where doubles lose it. There the charts of `theory.saddle_chart` make the flow linear, so that a
passage is a logarithm (Shilnikov's local map).

**The global map.** The rest is a flight of fixed length. It leads from u = u_1 and a small s =
sigma next to one saddle to a point (u, s, f) next to the other one. It depends analytically on
sigma and on the speed. Its polynomials are fitted once, to some twenty flights in 64 bits about
Omega_h, where u = 0 at sigma = 0 by definition. So u keeps its relative accuracy however small D
is, and no flight grows longer with 1 / D.

**The cycle.** It is a fixed point of sigma. Both maps take complex numbers. An imaginary part far
below rounding carries the derivative with respect to the speed, or to sigma. The latter is the
multiplier.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import lru_cache
from typing import Any, NamedTuple

import numpy
from numpy.polynomial.polynomial import polyval

from tippedisk_verify.connection.splitting import first_arrival
from tippedisk_verify.cycles.shooting.section import RECORDED_BETA_EXTREME
from tippedisk_verify.errors import AccuracyError
from tippedisk_verify.flow.contract import GAMMA_TOP, SLIDING_REVERSAL, Engine, Request, Status
from tippedisk_verify.model.equations import vector_field
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.exact import fraction
from tippedisk_verify.numbers.precision import EXTENDED
from tippedisk_verify.theory.power_series import ANGLE_OPS
from tippedisk_verify.theory.saddle_chart import (
    ChartFamily,
    SaddleChart,
    angles_and_v,
    solve_linear,
)
from tippedisk_verify.theory.saddle_manifolds import Saddle

# The starts of flights off the unstable manifold, in units of the largest sigma.
_START_SIGMAS = (-1.0, -0.5, 0.5, 1.0)
# The speeds of those flights, in units of their reach. Five serve saddle values near zero better,
# but lose digits at the largest distances, which lie outside the reach.
_OFF_MANIFOLD_SPEEDS = (-1.0, 0.0, 1.0)
_MAX_FLIGHT = 30.0  # s, the longest flight
_MAX_FAST = 2.0**-22  # the largest fast coordinate at which the flight may end
_SPLITTING_STEP = 1e-5  # the step of the splitting's derivative, relative to Omega_h
# 1 / the grid [rad/s] of the flights' speeds, so that 64 bits hold these exactly
_SPEED_GRID = 2**30
_MAX_STEPS = 30
_SETTLED = 2.0**-60  # the last relative step of sigma, and of times next to a saddle
_COMPLEX_STEP = 2.0**-100  # a relative imaginary part; its square is far below rounding
_ROUNDING_STEP = 2.0**-40  # a relative step below which only rounding keeps it from shrinking
_DECAYED = 2.0**-60  # the largest fast coordinate at the end of a passage, in units of u_1


_charts = lru_cache(maxsize=16)(ChartFamily)


class PassageSettings(NamedTuple):
    """The settings with which the map between the saddles (`GlobalMap`) is computed."""

    chart_order: int  #: the order of the charts
    chart_bands: int  #: the bands of the charts
    section_ratio: (
        float  #: the place of the sections, in units of the charts' radius of convergence
    )
    #: abs(u / s) at which flights on the unstable manifold arrive, at their outermost speed
    arrival_ratio: float
    speed_count: int  #: the number of speeds of these flights
    #: The largest distance of other flights' starts from the unstable manifold, in units of u_1
    max_start_ratio: float
    #: The reach [rad/s] of the other flights' speeds from Omega_h, and so of cycles
    max_distance: float
    perturbation_pattern: int | None = (
        None  #: the pattern by which the last bits of parameters and starts move
    )


class ChartFlight(NamedTuple):
    """A part of an orbit next to a saddle that lies in one chart, in whose coordinates the flow is
    linear.
    """

    chart: SaddleChart
    start: Any  #: (3,) the point (u, s, f)
    time: Any  #: [s]
    symmetry_sign: (
        int  #: -1 if the part is the point symmetry's image of the one in the chart, otherwise 1
    )

    @property
    def end(self) -> Any:
        return self.chart.flow(self.start, self.time)


class LinearPassage(NamedTuple):
    """An orbit's flight to a saddle and its passage of this saddle, up to the exit."""

    sigma: Any  #: the exit, in the coordinates of the start
    time: Any  #: the time of the passage alone [s]
    #: (7,) u, s, f, the integral of the divergence, beta_max, beta_bar and v at the top
    arrival: Any
    pieces: list[ChartFlight]


class GlobalMap:
    """The flights from next to one saddle to next to the other, as polynomials.

    Their variables are the start's coordinate sigma and the distance from Omega_h.

    Args:
        parameters: The disk and its friction law.
        omega_h: Omega_h [rad/s].
        engine: The engine of the flights.
        settings: Orders, sections and starts.

    Raises:
        AccuracyError: If a flight fails.
    """

    def __init__(
        self, parameters: Parameters, omega_h: Fraction, engine: Engine, settings: PassageSettings
    ) -> None:
        self.parameters, self.settings = parameters, settings
        saddle = Saddle(parameters, omega_h, 80, 1)
        sides = [saddle.law_side(which) for which in (0, 1)]
        #: The charts where an orbit leaves a saddle and where it arrives at the next one.
        self.leaving, self.arriving = (
            _charts(parameters, omega_h, side, settings.chart_order, settings.chart_bands)
            for side in sides
        )
        self.one_sided = sides[0] == sides[1]
        chart = self.leaving.chart_at(EXTENDED.number(0))
        self.u_1 = EXTENDED.number_type(settings.section_ratio * chart.convergence_radius(0))
        self._engine, self._omega_h = engine, omega_h
        self.duration = self._duration(
            chart,
            settings.section_ratio
            * self.arriving.chart_at(EXTENDED.number(0)).convergence_radius(1),
        )
        probe = _rounded_distance(float(omega_h) * _SPLITTING_STEP)
        above, below = (self._arrival(distance, 0.0) for distance in (probe, -probe))
        largest_distance = settings.arrival_ratio * float(
            2 * probe * fraction(abs(above[1] / (above[0] - below[0])))
        )
        # 64 bits hold the flights' speeds exactly: short distances from a double.
        offset = Fraction(float(omega_h)) - omega_h
        on_manifold = [
            _rounded_distance(largest_distance * x) + offset
            for x in _chebyshev_nodes(settings.speed_count)
        ]
        off_manifold = [
            _rounded_distance(settings.max_distance * x) + offset for x in _OFF_MANIFOLD_SPEEDS
        ]
        self._polynomials = self._fitted(on_manifold, off_manifold)

    def at(self, distance: Any) -> Any:
        """Return the polynomials in sigma that map a start next to one saddle to the arrival next
        to the other, at a distance from Omega_h [rad/s].

        The coefficients (5, 7) have a row for each power of sigma, and a column for each number of
        `LinearPassage.arrival`.
        """
        return polyval(distance, self._polynomials)

    @property
    def leading_coefficients(self) -> tuple[tuple[Any, Any], Any]:
        """The first-order coefficients of this map from one saddle to the next, at Omega_h and
        sigma = 0.

        An orbit leaves at u = u_1 and s = sigma. It arrives at (u, s) in the chart of the next
        saddle. The pair has the derivatives of the arriving u with respect to the speed and to
        sigma. The arriving s follows.
        """
        return (self._polynomials[1, 0, 0], self._polynomials[0, 1, 0]), self._polynomials[0, 0, 1]

    def _request(self, chart: SaddleChart, omega: Fraction, sigma: float, **needs: Any) -> Request:
        beta, gamma, v = chart.offset_at(numpy.array([self.u_1, sigma, 0]))
        state = beta, gamma - EXTENDED.pi, v
        return Request(self.parameters, omega, state, shifted=True, domain="none", **needs)

    def _duration(self, chart: SaddleChart, end: float) -> Fraction:
        """Return the fixed duration [s] of the flights from next to one saddle to next to the
        other.

        The flight on the unstable manifold at Omega_h then has come within ``end`` of the other
        saddle. Its fast coordinate there has had time to decay to `_MAX_FAST`. The duration is
        rounded up to a hundredth of a second. Raises AccuracyError if the flight never comes near
        that saddle.

        Args:
            chart: The chart of the first saddle, for the start.
            end: The distance from the other saddle.
        """
        times = numpy.arange(0, _MAX_FLIGHT, 0.01)
        samples = self._engine(
            self._request(chart, self._omega_h, 0.0, duration=float(times[-1]), times=times)
        ).samples
        first = first_arrival(samples, end)
        point = self.arriving.chart_at(EXTENDED.number(0)).coordinates(
            EXTENDED.array(samples[first] - numpy.array([0.0, math.pi, 0.0]))
        )
        # The charts have no third powers of the fast coordinate.
        longer = math.log(max(1.0, abs(float(point[2])) / _MAX_FAST)) / -float(chart.eigenvalues[2])
        return Fraction(first + math.ceil(100 * longer), 100)

    def _arrival(self, distance: Fraction, sigma: float) -> list[Any]:
        """Fly from next to one saddle to next to the other, and return the seven numbers of the
        arrival (`LinearPassage.arrival`).

        The flight starts at s = ``sigma``, at a speed ``distance`` from Omega_h [rad/s]. Raises
        AccuracyError if it fails.
        """
        at = EXTENDED.number(distance)
        request = self._request(
            self.leaving.chart_at(at),
            self._omega_h + distance,
            sigma,
            duration=self.duration,
            precision=EXTENDED,
            divergence=True,
            events=(RECORDED_BETA_EXTREME, GAMMA_TOP),
            perturbation_pattern=self.settings.perturbation_pattern,
        )
        flight = self._engine(request)
        if flight.status is not Status.REACHED:
            raise AccuracyError(f"the unstable manifold: {flight.status.value}")
        beta, gamma, v = flight.state
        point = self.arriving.chart_at(at).coordinates(numpy.array([beta, gamma - EXTENDED.pi, v]))
        extreme = max(
            abs(event.state[0])
            for event in flight.events
            if event.name == RECORDED_BETA_EXTREME.name
        )
        top = next(event.state for event in flight.events if event.name == GAMMA_TOP.name)
        return [*point, flight.divergence, extreme, top[0], top[2]]

    def _fitted(self, distances: list[Fraction], off_manifold: list[Fraction]) -> Any:
        """Fit polynomials to flights between the saddles, and return their coefficients (speeds, 5,
        7).

        The axes are powers of the distance, powers of sigma, and the numbers of
        `LinearPassage.arrival`. ``distances`` are the distances of the speed from Omega_h [rad/s]
        for flights on the unstable manifold, ``off_manifold`` those for flights off it. There are
        as many flights as coefficients. u vanishes exactly at sigma = 0 and Omega_h; the fit's
        rounding there is dropped.
        """
        count, farthest = len(distances), EXTENDED.number(max(distances))
        largest = float(self.u_1) * self.settings.max_start_ratio
        places = [(distance, 0.0) for distance in distances]
        places += [(distance, largest * x) for distance in off_manifold for x in _START_SIGMAS]
        powers = [(k, 0) for k in range(count)]
        powers += [
            (k, n) for k in range(len(off_manifold)) for n in range(1, len(_START_SIGMAS) + 1)
        ]
        scaled = [
            (EXTENDED.number(distance) / farthest, EXTENDED.number(sigma) / largest)
            for distance, sigma in places
        ]
        matrix = numpy.array([[x**k * y**n for k, n in powers] for x, y in scaled])
        values = numpy.array([self._arrival(*place) for place in places])
        coefficients = numpy.zeros(
            (count, len(_START_SIGMAS) + 1, values.shape[1]), EXTENDED.number_type
        )
        for (k, n), row in zip(powers, solve_linear(matrix, values), strict=True):
            coefficients[k, n] = row / farthest**k / EXTENDED.number(largest) ** n
        coefficients[0, 0, 0] = 0
        return coefficients


class SaddleToSaddleMap:
    """The map from the coordinate sigma of an orbit at one saddle's exit to that at the next one's.

    It belongs to one distance from Omega_h. Its fixed point is a limit cycle.

    Args:
        global_map: The global map.
        distance: The distance from Omega_h [rad/s]; it may be complex.
        symmetry_sign: -1 for librating cycles, which turn back at each saddle; 1 for rotating ones,
            which pass.
    """

    def __init__(self, global_map: GlobalMap, distance: Any, symmetry_sign: int) -> None:
        self.global_map, self.symmetry_sign, self._distance = global_map, symmetry_sign, distance
        self._arrivals = global_map.at(distance)
        self.leaving, self.arriving = (
            global_map.leaving.chart_at(distance),
            global_map.arriving.chart_at(distance),
        )
        parameters = global_map.parameters
        self._crosses = parameters.law.two_sided and global_map.one_sided == (symmetry_sign == -1)
        self._constants = parameters.constants_in(EXTENDED)
        self._omega = EXTENDED.number(global_map._omega_h) + distance

    def __call__(self, sigma: Any) -> LinearPassage:
        """Return the orbit that leaves one saddle at sigma, up to its exit from the next saddle.

        Raises:
            ArithmeticError: If the orbit leaves the saddle on the other side, or the fast
                coordinate has not decayed.
        """
        arrival = polyval(sigma, self._arrivals)
        point, chart, pieces = arrival[:3], self.arriving, list[ChartFlight]()
        if self._crosses:
            gradient = (0, -self._constants.e * self._omega, self._constants.r - self._constants.e)
            pieces.append(_flight_to_zero(chart, point, self._sliding, gradient))
            point, chart = (
                self.leaving.coordinates(self.symmetry_sign * chart.offset_at(pieces[0].end)),
                self.leaving,
            )
        else:  # the linear law's chart is odd
            point = self.symmetry_sign * point
        if not point[0].real > 0:
            raise ArithmeticError("the orbit leaves the saddle on the other side")
        time = numpy.log(self.global_map.u_1 / point[0]) / chart.eigenvalues[0]
        pieces.append(ChartFlight(chart, point, time, self.symmetry_sign))
        end = pieces[-1].end
        if abs(end[2]) > _DECAYED * self.global_map.u_1:
            raise ArithmeticError("the fast coordinate has not decayed when the passage ends")
        return LinearPassage(end[1], sum(piece.time for piece in pieces), arrival, pieces)

    def _sliding(self, y: Any) -> Any:
        return SLIDING_REVERSAL.function(ANGLE_OPS, self._constants, self._omega, *angles_and_v(y))

    def fixed_point(self) -> tuple[Any, Any, list[float]]:
        """Solve for the map's fixed point, the limit cycle. The distance must be real.

        Returns:
            sigma, the map's derivative there, and the relative sizes of Newton's steps.

        Raises:
            ArithmeticError: If Newton's iteration does not settle.
        """
        sigma, sizes = self._omega * 0, list[float]()
        imaginary = abs(self._distance) * _COMPLEX_STEP
        for _ in range(_MAX_STEPS):
            image = self(sigma + 1j * imaginary).sigma
            slope = image.imag / imaginary
            step = (image.real - sigma) / (1 - slope)
            sigma = sigma + step
            sizes.append(float(abs(step / sigma)))
            if not sizes[-1] > _SETTLED or (
                len(sizes) > 2 and sizes[-2] / 2 < sizes[-1] < _ROUNDING_STEP
            ):
                return sigma, slope, sizes
        raise ArithmeticError("the iteration for sigma does not settle")

    def trivial_multiplier(self, piece: ChartFlight) -> Any:
        """Return the multiplier along the flow over a piece of an orbit, divided by the ratio of
        speeds.

        Its true value is 1, so the difference shows the error.

        Args:
            piece: A piece of a passage.
        """
        rates_of = vector_field(
            ANGLE_OPS, self._constants, self._omega, self.global_map.parameters.friction
        )
        along = []
        for point in (piece.start, piece.end):
            rates = numpy.array(rates_of(*angles_and_v(piece.chart.offset_at(point))))
            along.append(
                piece.chart.derivative(point)
                @ (piece.chart.eigenvalues * point)
                @ rates
                / (rates @ rates)
            )
        return along[1] / along[0]


def split_at_section(
    pieces: Sequence[ChartFlight], component: int
) -> tuple[ChartFlight, Sequence[ChartFlight]]:
    """Split an orbit's passage of a saddle in two, where a component of its offset y from the
    saddle vanishes.

    Args:
        pieces: The passage.
        component: The index of the component of y.

    Returns:
        The part up to the section, and the rest of the passage. The part begins where the piece
        with the section begins.

    Raises:
        ArithmeticError: If the passage does not meet its section.
    """
    gradient = numpy.eye(3)[component]
    for place, piece in enumerate(pieces):
        part = _flight_to_zero(piece.chart, piece.start, lambda y: y[component], gradient)
        if part.time.real <= piece.time.real or place == len(pieces) - 1:
            break
    rest = piece._replace(start=part.end, time=piece.time - part.time)
    return part._replace(symmetry_sign=piece.symmetry_sign), (rest, *pieces[place + 1 :])


def half_period_matrix(rest: Sequence[ChartFlight], multiplier: Any, time_by_sigma: Any) -> Any:
    """Return the derivative (3, 3) of half a period of a librating cycle: of the flow, then the
    point symmetry.

    It is in the offset y from the saddle, and taken where the rest of a passage begins. There a
    basis consists of F along the flow, w in the chart's direction of s, and the fast direction L. L
    contracts most in all that follows, so it is that of the last chart, carried back. The image of
    L is far below rounding. At the exit w = kappa x_sigma + rho F. The cycle's half maps x_sigma to
    multiplier * x_sigma - time_by_sigma * F.

    Args:
        rest: The rest of the passage.
        multiplier: The derivative of the half map with respect to sigma.
        time_by_sigma: The derivative of the passage's time with respect to sigma [s].
    """
    first, last = rest[0], rest[-1]
    slow, fast = numpy.eye(3)[1:].astype(EXTENDED.number_type)
    ahead = first.chart.flow(slow, first.time)
    if first is not last:
        turned = first.symmetry_sign * last.symmetry_sign * first.chart.derivative(first.end)
        over = solve_linear(last.chart.derivative(last.start), turned)
        fast = first.chart.flow(solve_linear(over, fast[:, None])[:, 0], -first.time)
        ahead = last.chart.flow(over @ ahead, last.time)
    exit_rates, rates = last.chart.eigenvalues * last.end, first.chart.eigenvalues * first.start
    rho = ahead[0] / exit_rates[0]
    kappa = ahead[1] - rho * exit_rates[1]
    basis = first.chart.derivative(first.start) @ numpy.stack(
        (rates, slow, fast / abs(fast).max()), axis=1
    )
    along = rho * (1 - multiplier) - kappa * time_by_sigma
    images = basis @ numpy.array(
        [[1, along, 0], [0, multiplier, 0], [0, 0, 0]], EXTENDED.number_type
    )
    return solve_linear(basis.T, images.T).T


def _flight_to_zero(
    chart: SaddleChart, start: Any, function: Callable[[Any], Any], gradient: Any
) -> ChartFlight:
    """Return the flight in a saddle's chart from a point to the zero of a function of the offset y.

    ``gradient`` is the function's at the saddle. It gives the zero of the linear part at once.
    Chord steps then correct the time, and each gains a factor of the distance from the saddle.

    Raises ArithmeticError if the orbit does not meet a zero on its way from the stable to the
    unstable manifold.
    """
    row = chart.gradient_in_chart(gradient)
    growth = chart.eigenvalues[0] - chart.eigenvalues[1]
    ratio = -row[1] * start[1] / (row[0] * start[0])
    if not ratio.real > 0:
        raise ArithmeticError("the passage does not meet its section")
    time = numpy.log(ratio) / growth
    for _ in range(_MAX_STEPS):
        point = chart.flow(start, time)
        step = function(chart.offset_at(point)) / (row @ (chart.eigenvalues * point))
        time = time - step
        if abs(step) < _SETTLED * (1 + abs(time)):
            return ChartFlight(chart, start, time, 1)
    raise ArithmeticError("the passage does not meet its section")


def integral_of_divergence(pieces: Sequence[ChartFlight]) -> Any:
    """Return the integral of the field's divergence over an orbit's passage of a saddle [1].

    It is the logarithm of the determinant of the flow's derivative, and follows from the charts'
    determinants.

    Args:
        pieces: The passage.
    """
    total = 0
    for piece in pieces:
        ends = (_determinant(piece.chart.derivative(point)) for point in (piece.end, piece.start))
        total += piece.chart.eigenvalues.sum() * piece.time + numpy.log(next(ends) / next(ends))
    return total


def _determinant(rows: Any) -> Any:
    return rows[0] @ numpy.cross(rows[1], rows[2])


def _chebyshev_nodes(count: int) -> Any:
    """Return Chebyshev nodes between -1 and 1, in falling order."""
    return numpy.cos(numpy.pi * (numpy.arange(count) + 0.5) / count)


def _rounded_distance(distance: float) -> Fraction:
    return Fraction(round(distance * _SPEED_GRID), _SPEED_GRID)
