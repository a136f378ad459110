"""The half map over a curve of starts and speeds at once: polynomials in a parameter with balls left over.

For s in [-1, 1] let gamma_bar(s), v(s), Omega(s) be polynomials: a curve of starts on the section beta = pi/2, with a
speed each. Around it there are deviations d = (d_gamma, d_v, d_Omega) in a box of balls about zero. After any time the
states of the orbits that start at (gamma_bar(s), v(s)) + (d_gamma, d_v), at the speed Omega(s) + d_Omega, are in

    middle(s) + lead(s) d + axes q,    q in the box ``rest``,

where middle and lead are polynomials of s with points for coefficients and axes is a matrix of points: the set of
`frame`, with everything that depends on s in a polynomial (`jets`). What is linear in d is never wrapped into a box,
and what depends on s is neither. Derivatives, which only multiply deviations, have a lower degree in s than the middle.

**One step.** The Taylor coefficients of the orbits from middle(s) come as jets, and so do those of the derivatives
M(s) by state and Omega, whose starts are all states of the set at that s. *For each s by itself* the argument is that
of `flow`: polynomials in time and the next coefficient over a box E that holds the polynomials' ranges for all s; if
the sum lies in E's interior, all orbits from the set exist and stay in E, and coefficient times power of the time
holds the remainder. The balls in jets are for each s by itself too, so nothing else is needed. With the mean value
theorem from middle(s) to any state of the set, at the speeds Omega(s) to Omega(s) + d_Omega,

    state(h) in  image of middle(s)  +  (M lead + by Omega) d  +  M axes q.

New points are chosen and the difference goes into ``rest``; ``own`` is the part of it for d = 0, for the curve's own
orbits, whose images Krawczyk's operator needs (`arc`). Derivatives by the start and Omega are lead(s) + axes spread.

**The first return** to beta = pi/2. beta_bar is 0 at the start. Of every step but the last one of these is proved, from
its E: v < 0 throughout, or beta_bar < 0 throughout. As beta_bar' = v, beta_bar < 0 from the start on. In the last step
v > 0 throughout, and beta_bar > 0 at its end: beta_bar passes 0 once, upwards.

*Its moment.* With a time tau(s), any, and w a ball that holds v on all states between tau(s) and the return,
the return is at tau(s) - beta_bar(tau(s)) / w by the mean value theorem; w is E's at first, and then that of the
times so found. On the section time moves with the start by -d(beta)/v, and gamma' = 0.

`Choices` proposes the steps and the axes: a search does, or the log of one (`Replay`).

Where a ball becomes a point or a float: middle, lead, axes, tau and step lengths are chosen, and any choice is right.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import mul
from typing import Any, ClassVar, Protocol

from tippedisk_verify.proofs.kernel.balls import Unproved, arb, inside, need, negative, positive
from tippedisk_verify.proofs.kernel.field import Constants
from tippedisk_verify.proofs.kernel.flow import Model
from tippedisk_verify.proofs.kernel.jets import Jet, symmetric
from tippedisk_verify.proofs.kernel.reading import as_float
from tippedisk_verify.proofs.kernel.section import UPRIGHT

__all__ = ["Beginning", "Choices", "Curve", "CurveFlight", "Matrix", "Replay", "Step", "fly", "horner"]

ORDER, ROUGH_ORDER = 20, 12  #: of the series of the states, and of those of derivatives
_DEGREE = 3  # in s of derivatives at most: 2 is too low at both ends of the family, and 4 tightens little
_FINEST = 2.0**-7  # part of a step in which an orbit turns
_ALL, _BETA, _V = slice(3), slice(1), slice(2, 3)  # components of a state
_PAD = arb(2) ** -40

Matrix = Sequence[Sequence[Any]]


@dataclass(frozen=True)
class Curve:
    """Starts on the section and speeds, polynomials of s with points or small balls, and deviations about them."""

    gamma_bar: Jet  #: [rad]
    v: Jet  #: [rad/s]
    omega: Jet  #: [rad/s]
    deviation: Sequence[Any]  #: of the three, balls about zero
    total: Jet  #: about how long the half map takes [s]: steps are shares of it

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
    """What is proved of the orbits from a curve of starts, as jets, for each s.

    ``image`` is S of where the curve's own orbits return, (gamma_bar, v), after ``own_time``; the others hold for all
    orbits from the curve and the deviations about it. Derivatives are by the curve's three numbers.
    """

    image: Sequence[Jet]
    own_time: Jet  #: of the curve's own orbits [s]
    matrix: Matrix  #: (2, 3) jets: of the half map
    time_by: Sequence[Jet]  #: (3,)
    divergence: Jet  #: integral of div f over the flight
    beta_least: Any  #: a ball below whose lowest number beta_bar never is [rad]
    turning: Sequence[Step]  #: those that hold all moments with v = 0


class Choices(Protocol):
    """What proposes the steps of a flight and the axes behind them."""

    def step(self, beginning: Beginning) -> tuple[Step, bool]:
        """One that `Beginning.step` has made, and whether the return is to lie in it."""

    def axes(self, step: Step, turned: Matrix) -> Matrix:
        """A regular matrix of points for the set behind the step; ``turned`` are the images of the old axes."""


class Replay:
    """The choices of a log: of each step the share and, but for the last one, the axes, as decimals."""

    def __init__(self, log: Sequence[Mapping[str, Any]]) -> None:
        self.log, self.number = log, 0

    def step(self, beginning: Beginning) -> tuple[Step, bool]:
        need(bool(self.log), "there are no steps")
        self.number += 1
        return beginning.step(as_float(self.log[self.number - 1]["share"])), self.number == len(self.log)

    def axes(self, step: Step, turned: Matrix) -> Matrix:
        log = self.log[self.number - 1]
        need("axes" in log, "the axes behind it are missing")
        return [[arb(as_float(part)) for part in row] for row in log["axes"]]


class _Systems:
    """The equations of motion for the curve's speeds: for each s, of the orbits and of the derivatives; for all s."""

    def __init__(self, constants: Constants, curve: Curve) -> None:
        self.orbit = curve.equations(constants, *curve.numbers).orbit_at(curve.omega)
        rough = curve.equations(constants, *(part.cut(_DEGREE) for part in curve.numbers))
        self.rates, self.derivatives = rough.rates, rough.with_divergence
        bound = curve.equations(constants, *(part.range() for part in curve.numbers))
        self.orbit_bound, self.derivatives_bound = bound.orbit_at(bound.omega), bound.with_divergence


class _States:
    """The set, and the derivatives (3, 3) of its states by the curve's three numbers."""

    __slots__ = ("axes", "columns", "deviation", "lead", "middle", "own", "rest", "spread")

    def __init__(self, curve: Curve) -> None:
        zero = 0 * curve.v.mid()
        nothing, short = zero.c[0], zero.cut(_DEGREE)
        self.middle: list[Jet] = [zero, *curve.start]
        self.deviation, self.columns = curve.deviation, curve.columns
        self.lead: Matrix = [[short] * 3, *([short + entry for entry in row] for row in curve.unit)]
        self.axes: Matrix = [[nothing + int(i == j) for j in range(3)] for i in range(3)]
        self.rest: list[Any] = [nothing] * 3
        self.own: list[Any] = [nothing] * 3
        self.spread: Matrix = [[nothing] * 3 for _ in range(3)]

    def box(self) -> list[Jet]:
        """All states, and the middle."""
        wrapped = _applied(self.axes, self.rest)
        parts = zip(self.middle, _applied(self.lead, self.deviation), wrapped, strict=True)
        return [middle + a + b.union(0 * b) for middle, a, b in parts]

    def image(self, centre: Sequence[Jet], rows: Matrix) -> list[Jet]:
        """Where a map takes the states: ``centre`` holds the middle's image, ``rows`` its derivatives."""
        lead, turned = self.mapped(rows)
        parts = zip(centre, _applied(lead, self.deviation), _applied(turned, self.rest), strict=True)
        return [a + b + c for a, b, c in parts]

    def own_image(self, centre: Sequence[Jet], rows: Matrix) -> list[Jet]:
        """Where it takes those of the curve itself."""
        return [a + b for a, b in zip(centre, _applied(self.mapped(rows)[1], self.own), strict=True)]

    def derivatives(self, rows: Matrix) -> Matrix:
        """(3, 3) jets: those of the images by the three numbers."""
        lead, turned = self.mapped(rows)
        return _added(lead, _product(turned, self.spread))

    def carried(self, centre: Sequence[Jet], lead: Matrix, turned: Matrix, axes: Matrix) -> _States:
        """The images' set, for the middle's image and what `mapped` gives, about other axes."""
        image = object.__new__(_States)
        image.deviation, image.columns, image.axes = self.deviation, self.columns, axes
        image.middle = [entry.mid() for entry in centre]
        image.lead = [[entry.mid() for entry in row] for row in lead]
        inverse = _inverse(axes)
        left = _product(inverse, _left_over(lead, image.lead))
        turned = _product(inverse, turned)
        away = _applied(inverse, [(a - b).range() for a, b in zip(centre, image.middle, strict=True)])
        image.own = [a + b for a, b in zip(away, _applied(turned, self.own), strict=True)]
        parts = zip(away, _applied(left, self.deviation), _applied(turned, self.rest), strict=True)
        image.rest = [a + b + c for a, b, c in parts]
        image.spread = _added(left, _product(turned, self.spread))
        return image

    def mapped(self, rows: Matrix) -> tuple[Matrix, Matrix]:
        """The images of the lead as jets, with the equations' own part; those of the axes as balls for all s."""
        lead = [list(row) for row in _product(rows, self.lead)]
        turned = [[entry.range() for entry in row] for row in _product(rows, self.axes)]
        for entries, row in zip(lead, rows, strict=True):
            for column, own in zip(self.columns, row[3:], strict=True):
                entries[column] = entries[column] + own
        return lead, turned


class Beginning:
    """The Taylor polynomials from a set of states, of which a step of any length may be tested."""

    def __init__(self, systems: _Systems, states: _States, total: Jet) -> None:
        self.systems, self.states, self.total = systems, states, total
        nothing = 0 * states.middle[2].mid().cut(_DEGREE)
        unit = [nothing + int(row == column) for column in range(3 + len(states.columns)) for row in range(3)]
        self._thin = systems.orbit.coefficients(states.middle, ORDER)
        box = [entry.cut(_DEGREE) for entry in states.box()]
        self._wide = systems.derivatives.coefficients([*box, *unit, nothing], ROUGH_ORDER)

    def step(self, share: float) -> Step:
        """That of a share of the time of flight."""
        length = (self.total * share).mid()
        longest = length.range()
        span = longest.union(0 * longest)
        last_power = span
        for _ in range(ROUGH_ORDER - 1):
            last_power = last_power * span
        ranges, padded = [], []
        for series in self._wide:
            terms = [jet.range() for jet in series]
            ranges.append(horner(terms, span))
            # What the last term contributes is a fair guess of what the rest does.
            last = symmetric(terms[-1] * last_power)
            padded.append(ranges[-1] + symmetric(ranges[-1].rad() / 256 + _PAD) + last)
        rough = [series[-1] for series in self.systems.derivatives_bound.coefficients(padded, ROUGH_ORDER + 1)]
        fine = [series[-1] for series in self.systems.orbit_bound.coefficients(padded[:3], ORDER + 1)]
        # The sets move forward in time.
        included = positive(longest) and all(
            inside(part + remainder * last_power * span, room)
            for part, remainder, room in zip(ranges, rough, padded, strict=True)
        )
        orbit = [[*series, 0 * length + end] for series, end in zip(self._thin, fine, strict=True)]
        short = 0 * length.cut(_DEGREE)
        derivatives = [[*series, short + end] for series, end in zip(self._wide[3:], rough[3:], strict=True)]
        return Step(self.states, length, padded[:3], included, orbit, derivatives)


@dataclass(frozen=True)
class Step:
    """What is proved over [0, length] where ``included``."""

    states: _States
    length: Jet
    enclosure: Sequence[Any]  #: holds all states throughout, for all s
    included: bool
    polynomials: list[list[Jet]]  #: of the middle's orbits, the remainder's coefficient last
    derivatives: list[list[Jet]]  #: of the derivatives, 3 to a column, and the divergence's integral, likewise

    def centre(self, time: Jet, components: slice = _ALL) -> list[Jet]:
        """Where the middle is at ``time``, a jet in the step; all or some of the three components."""
        return [horner(series, time) for series in self.polynomials[components]]

    def rows(self, time: Jet, components: slice = _ALL) -> Matrix:
        """d(state at ``time``)/d(state at the step's start, numbers) for all orbits."""
        short = time.cut(_DEGREE)
        return [[horner(series, short) for series in self.derivatives[row:-1:3]] for row in range(3)[components]]

    def divergence(self, time: Jet) -> Jet:
        """The integral of div f from the step's start to ``time``."""
        integral: Jet = horner(self.derivatives[-1], time.cut(_DEGREE))
        return integral

    def turning(self) -> Iterator[tuple[Any, Sequence[Jet]]]:
        """beta_bar and its derivatives by the three numbers at a fixed time, in each part that may have v = 0."""
        nothing = 0 * self.length.c[0]
        open_parts = [(0.0, 1.0)]
        while open_parts:
            begin, end = open_parts.pop()
            time = self.length * (nothing + begin).union(nothing + end)
            (v,) = self.states.image(self.centre(time, _V), self.rows(time, _V))
            if negative(v.range()) or positive(v.range()):
                continue
            if end - begin > _FINEST:
                middle = (begin + end) / 2
                open_parts += [(begin, middle), (middle, end)]
            else:
                rows = self.rows(time, _BETA)
                (beta_bar,) = self.states.image(self.centre(time, _BETA), rows)
                yield beta_bar.range(), self.states.derivatives(rows)[0]

    def carried(self, choices: Choices) -> _States:
        """The set at the step's end."""
        rows = self.rows(self.length)
        lead, turned = self.states.mapped(rows)
        return self.states.carried(self.centre(self.length), lead, turned, choices.axes(self, turned))


def fly(constants: Constants, curve: Curve, choices: Choices) -> CurveFlight:
    """Enclose the half map over the curve and its deviations. Raises Unproved, with the step that fails."""
    systems, states = _Systems(constants, curve), _States(curve)
    need(negative(states.box()[2].range()), "v is not shown to be negative at the start")
    divergence = 0 * curve.total.cut(_DEGREE)
    time, least, number, last = 0 * curve.total, 0 * curve.total.c[0], 0, False
    turning: list[Step] = []
    try:
        while not last:
            number += 1
            step, last = choices.step(Beginning(systems, states, curve.total))
            beta_bar, _, v = step.enclosure
            need(step.included, "the states and derivatives over it are not shown to stay in its enclosure")
            need(inside(beta_bar, arb(0, UPRIGHT)), "beta is not shown to stay upright")
            signs = positive(v) if last else negative(v) or negative(beta_bar)
            need(signs, "beta is not shown to move as it must")
            least = least.union(beta_bar)
            if not (negative(v) or positive(v)):
                turning.append(step)
            if not last:
                divergence, time = divergence + step.divergence(step.length), time + step.length
                states = step.carried(choices)
        return _landed(systems, step, curve.total, (time, divergence, least, turning))
    except Unproved as fault:
        raise Unproved(f"step {number}: {fault}") from None


def _landed(systems: _Systems, step: Step, total: Jet, so_far: tuple[Any, ...]) -> CurveFlight:
    """The return within the last step, and the half map's derivatives."""
    states, length = step.states, step.length
    time, divergence, least, turning = so_far
    passed = positive(states.image(step.centre(length), step.rows(length))[0].range())
    need(passed, "beta is not shown to have passed the section")
    tau = (total - time).mid()
    centre, rows = step.centre(tau), step.rows(tau)
    beta = states.image(centre, rows)[0]
    early = tau + symmetric(beta.range() / step.enclosure[2])
    within = all(positive(part.range()) for part in (tau, length - tau, early, length - early))
    need(within, "the return is not shown to lie within the step")
    v = states.image(step.centre(early), step.rows(early))[2]
    moment, own_moment = tau - beta / v, tau - states.own_image(centre, rows)[0] / v
    own = states.own_image(step.centre(own_moment), step.rows(own_moment))
    rows = step.rows(moment)
    _, gamma_bar, v = (part.cut(_DEGREE) for part in states.image(step.centre(moment), rows))
    need(positive(v.range()), "v is not shown to be positive at the return")
    acceleration = systems.rates((0 * v, gamma_bar, v))[2]
    by_start = states.derivatives(rows)
    time_by = [-entry / v for entry in by_start[0]]
    v_row = [-(entry + acceleration * t) for entry, t in zip(by_start[2], time_by, strict=True)]
    return CurveFlight(
        (-own[1], -own[2]),
        own_moment + time,
        ([-entry for entry in by_start[1]], v_row),
        time_by,
        divergence + step.divergence(moment),
        least,
        turning,
    )


def horner(coefficients: Sequence[Any], time: Any) -> Any:
    """A polynomial in time."""
    result = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        result = result * time + coefficient
    return result


def _product(a: Matrix, b: Matrix) -> Matrix:
    """Of the first three columns of ``a`` with three rows."""
    return [[row[0] * x + row[1] * y + row[2] * z for x, y, z in zip(*b, strict=True)] for row in a]


def _applied(matrix: Matrix, vector: Sequence[Any]) -> list[Any]:
    return [sum(map(mul, row[1:], vector[1:]), row[0] * vector[0]) for row in matrix]


def _added(a: Matrix, b: Matrix) -> Matrix:
    return [[x + y for x, y in zip(*rows, strict=True)] for rows in zip(a, b, strict=True)]


def _left_over(balls: Matrix, points: Matrix) -> Matrix:
    """Balls that hold, for all s, what jets differ from their midpoints by."""
    return [[(a - b).range() for a, b in zip(*rows, strict=True)] for rows in zip(balls, points, strict=True)]


def _inverse(axes: Matrix) -> Matrix:
    """By Cramer's rule."""
    a, b, c = ([row[k] for row in axes] for k in range(3))
    minors = (_cross(b, c), _cross(c, a), _cross(a, b))
    determinant = sum(map(mul, a, minors[0]))
    need(positive(determinant) or negative(determinant), "its axes have no inverse")
    return [[entry / determinant for entry in minor] for minor in minors]


def _cross(x: Sequence[Any], y: Sequence[Any]) -> list[Any]:
    return [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]
