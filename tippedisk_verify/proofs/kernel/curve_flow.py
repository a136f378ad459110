"""The half map over a curve of starts and speeds at once, proved: polynomials in a parameter with balls left over.

For s in [-1, 1] let gamma_bar(s), v(s), Omega(s) be polynomials: a curve of starts on the section beta = pi/2, with a
speed each. Around it there are deviations d = (d_gamma, d_v, d_Omega) in a box of balls about zero. After any time the
states of the orbits that start at (gamma_bar(s), v(s)) + (d_gamma, d_v), at the speed Omega(s) + d_Omega, are in

    middle(s) + lead(s) d + axes q,    q in the box ``rest``,

where middle and lead are polynomials of s with points for coefficients and axes is a matrix of points: the set of
`frame`, with everything that depends on s in a polynomial (`jets`). What is linear in d is never wrapped into a box,
and what depends on s is neither, up to s^D.

**One step.** The Taylor coefficients of the orbits from middle(s) come as jets, and so do those of the derivatives
M(s) by state and Omega, whose starts are all states of the set at that s. *For each s by itself* the argument is that
of `flow`: polynomials in time and the next coefficient over a box E that holds the polynomials' ranges for all s; if
the sum lies in E's interior, all orbits from the set exist and stay in E, and coefficient times power of the time
holds the remainder. The balls in jets are for each s by itself too, so nothing else is needed. With the mean value
theorem from middle(s) to any state of the set, at the speeds Omega(s) to Omega(s) + d_Omega,

    state(h) in  image of middle(s)  +  (M lead + by Omega) d  +  M axes q.

New points are chosen and the difference goes into ``rest``. ``own`` is the part of ``rest`` for d = 0: it follows the
curve's own orbits, whose images Krawczyk's operator needs (`krawczyk`). Derivatives by the start and Omega are
lead(s) + axes spread.

**The first return** to beta = pi/2. beta_bar is 0 at the start. Of every step but the last one of these is proved, from
its E: v < 0 throughout, or beta_bar < 0 throughout. As beta_bar' = v, beta_bar < 0 from the start on. In the last step
v > 0 throughout, and beta_bar > 0 at its end: beta_bar passes 0 once, upwards. Which step is the last follows from a
guess of the time of flight.

*Its moment.* With a time tau(s), any, and w a ball that holds v on all states between tau(s) and the return,
the return is at tau(s) - beta_bar(tau(s)) / w by the mean value theorem; w is E's at first, and then that of the
times so found. On the section time moves with the start by -d(beta)/v, and gamma' = 0.

The coefficients are Arb's balls or `lanes`: then each lane is a curve of its own with step lengths of its own, and the
answers are one for each lane.

Where a ball becomes a point or a float: middle, lead, axes, tau and step lengths are chosen, and any choice is right.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tippedisk_verify.model.parameters import Constants
from tippedisk_verify.proofs.kernel.balls import arb
from tippedisk_verify.proofs.kernel.curve_axes import (
    Matrix,
    added,
    applied,
    floats,
    fresh_axes,
    largest,
    left_over,
    product,
)
from tippedisk_verify.proofs.kernel.flow import Model
from tippedisk_verify.proofs.kernel.jets import Jet, inside, negative, positive, symmetric
from tippedisk_verify.proofs.kernel.section import UPRIGHT

__all__ = ["Curve", "CurveFlight", "duration", "fly", "glide"]

#: Orders of the series: of the states, and of the derivatives, which only multiply deviations.
_ORDER, _ROUGH_ORDER = 24, 12
_TOLERANCE, _ROUGH_TOLERANCE = -56, -30  #: log2 of the last terms
_FIRST_FRACTION, _LONGEST_FRACTION = 0.01, 0.03  #: of the time of flight, for a step
_MOST_STEPS, _MOST_TRIALS = 2000, 15
_LONGEST = 60  # s
_NEWTON_STEPS = 8
_FINEST = 2.0**-9  # part of a step in which an orbit turns
_PAD = arb(2) ** -40


@dataclass(frozen=True)
class Curve:
    """Starts on the section and speeds, polynomials of s whose coefficients are points, and deviations about them."""

    gamma_bar: Jet  #: [rad]
    v: Jet  #: [rad/s]
    omega: Jet  #: [rad/s]
    deviation: Sequence[Any]  #: of the three, balls about zero

    unit: ClassVar = ((1, 0, 0), (0, 1, 0))  #: derivatives of `start` by the three numbers
    columns: ClassVar[tuple[int, ...]] = (2,)  #: of which of the three the equations depend
    equations: ClassVar[Any] = Model  #: for the constants and `numbers`

    @property
    def start(self) -> tuple[Jet, Jet]:
        """Where the orbits begin on the section, and what a fixed point returns to."""
        return self.gamma_bar, self.v

    @property
    def numbers(self) -> tuple[Jet, ...]:
        """The values of `columns`, with the deviation."""
        return (self.omega + self.deviation[2],)

    def trace(self, matrix: Matrix) -> Jet:
        """Of the half map's derivative by gamma_bar and v at a fixed point, from that by the three numbers."""
        trace: Jet = matrix[0][0] + matrix[1][1]
        return trace

    def rise(self, beta_bar: Any, slope: Jet) -> Jet:
        """The sign of how beta_bar changes with gamma_bar_0 at a fixed time, from its change with the first number."""
        return slope


@dataclass(frozen=True)
class CurveFlight:
    """What is proved of the orbits from a curve of starts. Only where ``proved`` the rest means anything.

    Jets, for each s: ``image`` is S of where the curve's own orbits return, (gamma_bar, v), after ``own_time``; the
    others hold for all orbits from the curve and the deviations about it. Derivatives are by the curve's three
    numbers.
    """

    proved: Any  #: bool, or one for each lane
    image: Sequence[Jet]
    own_time: Jet  #: of the curve's own orbits [s]
    time: Jet  #: [s]
    matrix: Sequence[Sequence[Jet]]  #: (2, 3): of the half map
    time_by: Sequence[Jet]  #: (3,)
    divergence: Jet  #: integral of div f over the flight
    beta_least: Any  #: a ball below whose lowest number beta_bar never is [rad]
    #: beta_bar, and its derivatives by the three numbers at a fixed time, in times that hold all moments with v = 0
    turning: Sequence[tuple[Any, Sequence[Jet]]]
    #: of each step the share of the time of flight, and the axes of the set behind it, but for the last one
    steps: Sequence[tuple[float, Matrix | None]]


class _Systems:
    """The equations of motion for the curve's speeds."""

    def __init__(self, constants: Constants, curve: Curve) -> None:
        model = curve.equations(constants, *curve.numbers)
        self.rates = model.rates
        self.orbit, self.derivatives = model.orbit_at(curve.omega), model.with_divergence
        bound = curve.equations(constants, *(part.range() for part in curve.numbers))
        self.orbit_bound, self.derivatives_bound = bound.orbit_at(bound.omega), bound.with_divergence


class _Tube:
    """The set, and the derivatives (3, 3) of its states by the curve's three numbers."""

    __slots__ = ("axes", "columns", "deviation", "lead", "middle", "own", "rest", "spread")

    def __init__(self, curve: Curve) -> None:
        zero = 0 * curve.v.mid()
        nothing = zero.c[0]
        self.middle: list[Jet] = [zero, *curve.start]
        self.deviation, self.columns = curve.deviation, curve.columns
        self.lead: Matrix = [[zero] * 3, *([zero + part for part in row] for row in curve.unit)]
        self.axes: Matrix = [[nothing + int(i == j) for j in range(3)] for i in range(3)]
        self.rest: list[Any] = [nothing] * 3
        self.own: list[Any] = [nothing] * 3
        self.spread: Matrix = [[nothing] * 3 for _ in range(3)]

    def box(self) -> list[Jet]:
        """All states, and the middle."""
        wrapped = applied(self.axes, self.rest)
        parts = zip(self.middle, applied(self.lead, self.deviation), wrapped, strict=True)
        return [middle + a + b.union(0 * b) for middle, a, b in parts]

    def image(self, centre: Sequence[Jet], rows: Matrix) -> list[Jet]:
        """Where a map takes the states: ``centre`` holds the middle's image, ``rows`` its derivatives."""
        lead, turned = self._mapped(rows)
        parts = zip(centre, applied(lead, self.deviation), applied(turned, self.rest), strict=True)
        return [a + b + c for a, b, c in parts]

    def own_image(self, centre: Sequence[Jet], rows: Matrix) -> list[Jet]:
        """Where it takes those of the curve itself."""
        return [a + b for a, b in zip(centre, applied(self._mapped(rows)[1], self.own), strict=True)]

    def derivatives(self, rows: Matrix) -> Matrix:
        """(3, 3) jets: those of the images by the three numbers."""
        lead, turned = self._mapped(rows)
        return added(lead, product(turned, self.spread))

    def carried(self, centre: Sequence[Jet], rows: Matrix, stiffness: Any) -> _Tube:
        """The images' set. ``stiffness`` [1/s] weighs velocities against angles when axes are chosen."""
        lead, turned = self._mapped(rows)
        image = object.__new__(_Tube)
        image.deviation, image.columns = self.deviation, self.columns
        image.middle = [part.mid() for part in centre]
        image.lead = [[entry.mid() for entry in row] for row in lead]
        image.axes, inverse = fresh_axes(turned, self.rest, self.spread, stiffness)
        left = product(inverse, left_over(lead, image.lead))
        turned = product(inverse, turned)
        away = applied(inverse, [row[0] for row in left_over([[x] for x in centre], [[x] for x in image.middle])])
        image.own = [a + b for a, b in zip(away, applied(turned, self.own), strict=True)]
        parts = zip(away, applied(left, self.deviation), applied(turned, self.rest), strict=True)
        image.rest = [a + b + c for a, b, c in parts]
        image.spread = added(left, product(turned, self.spread))
        return image

    def _mapped(self, rows: Matrix) -> tuple[Matrix, Matrix]:
        """The images of the lead as jets, with the equations' own part; those of the axes as balls for all s."""
        lead = [list(row) for row in product(rows, self.lead)]
        turned = [[entry.range() for entry in row] for row in product(rows, self.axes)]
        for entries, row in zip(lead, rows, strict=True):
            for column, own in zip(self.columns, row[3:], strict=True):
                entries[column] = entries[column] + own
        return lead, turned


@dataclass(frozen=True)
class _Step:
    """What is proved over [0, length] where ``included``."""

    tube: _Tube
    length: Jet
    enclosure: Sequence[Any]  #: holds all states throughout, for all s
    included: Any
    share: float  #: of the time of flight
    polynomials: list[list[Jet]]  #: of the middle's orbits, the remainder's coefficient last
    derivatives: list[list[Jet]]  #: of the derivatives, 3 to a column, and the divergence's integral, likewise

    def centre(self, time: Any) -> list[Jet]:
        return [_polynomial(series, time) for series in self.polynomials]

    def rows(self, time: Any) -> Matrix:
        """d(state at ``time``)/d(state at the step's start, numbers) for all orbits; a ball or jet of times."""
        entries = [_polynomial(series, time) for series in self.derivatives[:-1]]
        return [entries[row::3] for row in range(3)]

    def turning(self) -> list[tuple[Any, Sequence[Jet]]]:
        """beta_bar and its derivatives by the three numbers at a fixed time, in each part that may have v = 0."""
        found, nothing = [], 0 * self.length.c[0]
        open_parts = [(0.0, 1.0)]
        while open_parts:
            begin, end = open_parts.pop()
            time = self.length * (nothing + begin).union(nothing + end)
            rows = self.rows(time)
            beta_bar, _, v = self.tube.image(self.centre(time), rows)
            if np.all(negative(v.range()) | positive(v.range())):
                continue
            if end - begin > _FINEST:
                middle = (begin + end) / 2
                open_parts += [(begin, middle), (middle, end)]
            else:
                found.append((beta_bar.range(), self.tube.derivatives(rows)[0]))
        return found

    def carried(self) -> _Tube:
        """The set at the step's end."""
        stiffness = np.maximum(1.0, np.abs(floats(self.derivatives[8][1].range())))  # the rate of d(v)/d(v)
        return self.tube.carried(self.centre(self.length), self.rows(self.length), stiffness)


class _Steps:
    """One step after the other: fractions of the time of flight, which depends on s; the same ones for all lanes."""

    def __init__(self, systems: _Systems, total: Jet) -> None:
        self.systems, self.total = systems, total
        self.done, self.fraction = 0.0, _FIRST_FRACTION

    def step(self, tube: _Tube, wanted: Any) -> tuple[_Step, bool]:
        """The next one, and whether it is the last. ``wanted``: the lanes that the step should be proved for."""
        systems, nothing = self.systems, 0 * tube.middle[2].mid()
        thin = systems.orbit.coefficients(tube.middle, _ORDER)
        unit = [nothing + int(row == column) for column in range(3 + len(tube.columns)) for row in range(3)]
        wide = systems.derivatives.coefficients([*tube.box(), *unit, nothing], _ROUGH_ORDER)
        for _ in range(_MOST_TRIALS):
            fraction, last = self._next()
            length = (self.total * fraction).mid()
            padded, rough, fine, included = self._verdict(wide, length)
            excess = max(
                _excess(rough[3:], length, _ROUGH_ORDER + 1, _ROUGH_TOLERANCE, wanted),
                _excess(fine, length, _ORDER + 1, _TOLERANCE, wanted),
            )
            # The length that would do, times 0.9 because remainders grow with the box as well.
            self.fraction = fraction * min(1.3, max(0.3, 0.9 * 2.0**-excess))
            if excess <= 0 and np.all(included | ~np.asarray(wanted)):
                break
            self.fraction = min(self.fraction, 0.8 * fraction)
        self.done += fraction
        return _Step(
            tube,
            length,
            padded[:3],
            included,
            fraction,
            [[*series, nothing + end] for series, end in zip(thin, fine, strict=True)],
            [[*series, nothing + end] for series, end in zip(wide[3:], rough[3:], strict=True)],
        ), last

    def _next(self) -> tuple[float, bool]:
        """The fraction to try, and whether the return lies in that step, well off both ends."""
        left = 1 - self.done
        if left <= 0.7 * self.fraction:
            return left + 0.3 * self.fraction, True
        return min(self.fraction, 0.6 * left), False

    def _verdict(self, wide: Sequence[Any], length: Jet) -> tuple[list[Any], list[Any], list[Any], Any]:
        """The padded box E over [0, length], the remainders' coefficients over it, and whether it is proved to hold."""
        longest = length.range()
        span = longest.union(0 * longest)
        powers = [span]
        for _ in range(_ROUGH_ORDER):
            powers.append(powers[-1] * span)
        ranges, padded = [], []
        for series in wide:
            terms = [jet.range() for jet in series]
            ranges.append(_polynomial(terms, span))
            # What the last term contributes is a fair guess of what the rest does.
            last = symmetric(terms[-1] * powers[-2])
            padded.append(ranges[-1] + symmetric(ranges[-1].rad() / 256 + _PAD) + last)
        rough = [series[-1] for series in self.systems.derivatives_bound.coefficients(padded, _ROUGH_ORDER + 1)]
        fine = [series[-1] for series in self.systems.orbit_bound.coefficients(padded[:3], _ORDER + 1)]
        # The sets move forward in time.
        included: Any = positive(longest)
        for part, remainder, room in zip(ranges, rough, padded, strict=True):
            included = included & inside(part + remainder * powers[-1], room)
        return padded, rough, fine, included


def _excess(remainders: Sequence[Any], length: Jet, power: int, tolerance: int, wanted: Any) -> float:
    """By how much log2 of a length is too large for remainders that grow like its ``power``, in the worst lane."""
    with np.errstate(all="ignore"):
        sizes = np.log2(np.max([largest([part]) for part in remainders], axis=0)) + power * np.log2(floats(length.c[0]))
    sizes = np.where(wanted, np.nan_to_num(sizes, nan=np.inf), -np.inf)
    return float(np.max(sizes) - tolerance) / power


def fly(constants: Constants, curve: Curve, total: Jet) -> CurveFlight:
    """Enclose the half map over the curve and its deviations; ``total`` [s] is about how long it takes, points."""
    with curve.v.quiet():
        systems, tube = _Systems(constants, curve), _Tube(curve)
        steps = _Steps(systems, total)
        proved = negative(tube.box()[2].range())
        divergence, time, least, turning = 0 * total, 0 * total, 0 * total.c[0], []
        shares: list[tuple[float, Matrix | None]] = []
        for _ in range(_MOST_STEPS):
            step, last = steps.step(tube, proved)
            beta_bar, _, v = step.enclosure
            proved = proved & step.included & inside(beta_bar, arb(0, UPRIGHT))
            proved = proved & (positive(v) if last else negative(v) | negative(beta_bar))
            least = least.union(beta_bar)
            if not np.all(negative(v) | positive(v)):
                turning += step.turning()
            shares.append((step.share, None))
            if last or not np.any(proved):
                break
            divergence = divergence + _polynomial(step.derivatives[-1], step.length)
            tube, time = step.carried(), time + step.length
            shares[-1] = step.share, tube.axes
        return _landed(systems, step, proved & last, (time, divergence, least, turning, shares))


def _landed(systems: _Systems, step: _Step, proved: Any, so_far: tuple[Any, ...]) -> CurveFlight:
    """The return within the last step, and the half map's derivatives."""
    tube, length = step.tube, step.length
    passed = positive(tube.image(step.centre(length), step.rows(length))[0].range())
    tau = _moment(step.polynomials, length / 2)
    centre, rows = step.centre(tau), step.rows(tau)
    beta = tube.image(centre, rows)[0]
    slowest = step.enclosure[2]
    early = tau + symmetric(beta.range() / slowest)
    within = positive(early.range()) & positive((length - early).range())
    v = tube.image(step.centre(early), step.rows(early))[2]
    moment = tau - beta / v
    time, divergence, least, turning, shares = so_far
    own_time = tau - tube.own_image(centre, rows)[0] / v
    own = tube.own_image(step.centre(own_time), step.rows(own_time))
    rows = step.rows(moment)
    _, gamma_bar, v = tube.image(step.centre(moment), rows)
    acceleration = systems.rates((0 * v, gamma_bar, v))[2]
    by_start = tube.derivatives(rows)
    time_by = [-entry / v for entry in by_start[0]]
    v_row = [-(entry + acceleration * t) for entry, t in zip(by_start[2], time_by, strict=True)]
    return CurveFlight(
        proved & passed & within & positive(v.range()) & positive(slowest),
        (-own[1], -own[2]),
        own_time + time,
        moment + time,
        ([-entry for entry in by_start[1]], v_row),
        time_by,
        divergence + _polynomial(step.derivatives[-1], moment),
        least,
        turning,
        shares,
    )


def glide(constants: Constants, curve: Curve, total: Jet) -> tuple[Sequence[Jet], Jet]:
    """Roughly the image (gamma_bar, v) of the curve itself and its time: midpoints, for finding curves. No proof."""
    with curve.v.quiet():
        orbit = curve.equations(constants, *curve.numbers).orbit_at(curve.omega)
        state, time, done = [0 * curve.v.mid(), *curve.start], 0 * total, 0.0
        for _ in range(_MOST_STEPS):
            series = [list(part) for part in orbit.coefficients(state, _ORDER)]
            # In longer steps the balls left over would swamp the midpoints.
            reach = min(_LONGEST_FRACTION, float(np.min(_reach(series) / floats(total.c[0]))))
            if 1 - done < reach / 2:
                break
            length = (total * min(reach, 1 - done)).mid()
            state, time, done = [_polynomial(part, length).mid() for part in series], time + length, done + reach
        tau = _moment(series, 0 * total)
        return [-_polynomial(part, tau).mid() for part in series[1:]], (tau + time).mid()


def duration(model: Model, gamma_bar: Any, v: Any) -> Any:
    """About how long a half map takes from one point [s]; None if it does not return within a minute."""
    state, time = [Jet([arb(0)]), Jet([arb(gamma_bar).mid()]), Jet([arb(v).mid()])], arb(0)
    for _ in range(_MOST_STEPS):
        series = [list(part) for part in model.orbit.coefficients(state, _ORDER)]
        length = arb(float(_reach(series)[0]))
        if not (length > 0 and time < _LONGEST):
            return None
        end = [_polynomial(part, length).mid() for part in series]
        if not all(part.c[0].is_finite() for part in end):
            return None
        if end[0].c[0] > 0 and end[2].c[0] > 0:
            return (time + _moment(series, Jet([length / 2])).c[0]).mid()
        state, time = end, (time + length).mid()
    return None


def _reach(series: Sequence[Sequence[Jet]]) -> NDArray[np.float64]:
    """For how long [s] the last two terms stay below 2^_TOLERANCE, roughly, of each lane."""
    order = len(series[0]) - 1
    sizes = [(largest([part[n].c[0]]), n) for part in series for n in (order - 1, order)]
    with np.errstate(all="ignore"):
        longest = np.min([(2.0**_TOLERANCE / x) ** (1 / n) for x, n in sizes], axis=0)
    return np.asarray(np.nan_to_num(np.minimum(1.0, longest)))


def _moment(polynomials: Sequence[Sequence[Jet]], guess: Jet) -> Jet:
    """About when beta_bar is 0 in a step: points."""
    beta, _, v = ([jet.mid() for jet in part] for part in polynomials)
    tau = guess.mid()
    for _ in range(_NEWTON_STEPS):
        tau = (tau - _polynomial(beta, tau) / _polynomial(v, tau)).mid()
    return tau


def _polynomial(coefficients: Sequence[Any], time: Any) -> Any:
    result = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        result = result * time + coefficient
    return result
