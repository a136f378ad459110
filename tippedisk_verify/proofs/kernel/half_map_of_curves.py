"""The half map over a curve of starts and speeds at once: polynomials in a parameter, with balls.

The set of states
-----------------
For s in [-1, 1] let gamma_bar(s), v(s), Omega(s) be polynomials: a curve of starts on the section
beta = pi/2, each with its speed. Let d = (d_gamma, d_v, d_Omega) be deviations in a box of balls
about zero. The orbits start at (gamma_bar(s), v(s)) + (d_gamma, d_v) and have the speed Omega(s) +
d_Omega. After any time their states are in

    middle(s) + linear_part(s) d + axes q,    q in the box ``remainder``.

This is the set of `doubleton`, with jets for the functions of s. Derivatives only multiply
deviations, so they have a lower degree in s than the middle. *For each s separately* the steps are
those of `step`, whose boxes hold the ranges for all s.

The first return to beta = pi/2
-------------------------------
beta_bar is 0 at the start. For every step but the last, its box E proves v < 0 throughout or
beta_bar < 0 throughout. As beta_bar' = v, beta_bar < 0 from the start on. In the last step v > 0
throughout, and beta_bar > 0 at its end: beta_bar passes 0 once, upwards.

*Its moment.* Choose a time tau(s), and let the ball w hold v on all states between tau(s) and the
return. By the mean value theorem the return is at

    tau(s) - beta_bar(tau(s)) / w.

First w is the range of v over E, then that over the times found with it. On the section time moves
with the start by -d(beta)/v, and gamma' = 0.

An arc of the family of limit cycles
------------------------------------
One Krawczyk test proves exactly one cycle for each value of a parameter. Three numbers describe a
cycle that S maps to itself: gamma_bar and v on the section, and Omega. The first one is the arc's
parameter p = p_0 + R s, |s| <= 1. The other two, u, are unknown. Their two equations are F_p(u) = P
- (gamma_bar, v) = 0 for the half map P (`poincare_map`). Let m(s) be polynomials near the family, r
> 0 two numbers, X(s) the box of all u with |u - m(s)| <= r, and Y(s) regular matrices. *For each s
separately* the theorem of `krawczyk` holds: if

    - Y(s) F(m(s))  +  (1 - Y(s) F'(X(s))) [-r, r]  lies inside  (-r, r),

X(s) holds exactly one zero u(s) of F, and all matrices of F'(X(s)) are regular. One flight over the
curve m(s) with the deviations |d| <= r gives F(m(s)) and F'(X(s)) as jets, functions enclosed for
each s. The test compares their ranges, for all s at once. By the implicit function theorem u(s) is
an analytic curve with u' = -(dF/du)^-1 dF/dp.

Signs along the arc
-------------------
Let c_g, c_v and c_Omega be the columns of P' - 1 and dP/dOmega. The equations, differentiated along
the curve, give c_g + c_v v' + c_Omega Omega' = 0. The determinants of both sides with c_v give

    det(P' - 1) = Omega' det(c_v, c_Omega),

which keeps its relative accuracy where Omega' is small.

Let beta_max be the largest |beta_bar| of a cycle; v = 0 at its moment. The derivative of beta_bar
with respect to gamma_bar_0 *at a fixed time* is enclosed for all times at which v may be 0. If it
is negative, beta_max grows: at the moment when a cycle reaches its beta_max, |beta_bar| is larger
on its neighbours of larger gamma_bar_0. `scaled_half_map` has the same for the state divided by
gamma_bar_0.

Let tau be the trace of P' and delta = exp(integral of div f) = -det P' > 0 (Liouville, see
`certificates.cycle`). P' has one positive and one negative eigenvalue. The values of its
characteristic polynomial at 1 and -1 are 1 - tau - delta = det(P' - 1) and 1 + tau - delta. Both
eigenvalues lie between -1 and 1 if and only if both values are positive; if one of these is
negative, an eigenvalue lies outside.

Where a ball becomes a point or a float: middle, linear part, axes, tau, step lengths, m, Y and r
are chosen. Any choice that passes the test is right.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any, ClassVar

from tippedisk_verify.proofs.kernel.balls import (
    Unproved,
    arb,
    inside,
    negative,
    positive,
    range_of,
    require,
    truncated_for_derivatives,
)
from tippedisk_verify.proofs.kernel.certificate_format import nearby_double
from tippedisk_verify.proofs.kernel.doubleton import Doubleton
from tippedisk_verify.proofs.kernel.jets import Jet, symmetric_hull
from tippedisk_verify.proofs.kernel.poincare_map import BELOW_HALF_PI
from tippedisk_verify.proofs.kernel.proved_flow import EnclosedField, EnclosedFlight
from tippedisk_verify.proofs.kernel.small_matrices import (
    Matrix,
    inverse_of_order_2,
    midpoint_inverse,
)
from tippedisk_verify.proofs.kernel.step import Step, StepTrial
from tippedisk_verify.proofs.kernel.vector_field import FieldConstants

__all__ = [
    "SERIES_ORDERS",
    "UNKNOWN_INDICES",
    "ArcTest",
    "Curve",
    "CurveFlight",
    "CurveReplay",
    "HalfMapEnclosure",
    "beta_extremes",
    "enclose_half_map",
    "krawczyk_test_of_arc",
]

UNKNOWN_INDICES = 1, 2  #: of (gamma_bar, v, Omega); the first one is the parameter
SERIES_ORDERS = 20, 12  #: of the series of the states, and of those of derivatives
_MIN_PART = 2.0**-7  # of a step in which an orbit turns


@dataclass(frozen=True)
class Curve:
    """A curve of starts on the section beta = pi/2, each with its speed, and a box about the curve.

    gamma_bar, v and Omega are polynomials in the parameter s of [-1, 1]. The box contains the
    deviations from these three numbers.
    """

    gamma_bar: Jet  #: [rad]
    v: Jet  #: [rad/s]
    omega: Jet  #: [rad/s]
    deviation: Sequence[Any]  #: of the three numbers, balls about zero
    duration: Jet  #: the half map's approximate duration [s]; steps are shares of it

    start_derivative: ClassVar = ((1, 0, 0), (0, 1, 0))  #: d(`start`)/d(the three numbers)
    parameter_columns: ClassVar[tuple[int, ...]] = (
        2,
    )  #: the indices of the numbers in the equations
    field_class: ClassVar[Any] = (
        EnclosedField  #: called with the constants and `equation_parameters`
    )

    @property
    def start(self) -> tuple[Jet, Jet]:
        """The starts of the orbits on the section, to which a fixed point returns."""
        return self.gamma_bar, self.v

    @property
    def equation_parameters(self) -> tuple[Jet, ...]:
        """The curve's numbers on which the equations of motion depend, each with its deviation.

        They are in the order of `parameter_columns`. Here Omega is the only one.
        """
        return (self.omega + self.deviation[2],)

    def trace(self, matrix: Matrix) -> Jet:
        """Return the trace of the half map's derivative at a fixed point, given the map's
        derivatives with respect to the curve's three numbers.
        """
        trace: Jet = matrix[0][0] + matrix[1][1]
        return trace

    def amplitude_slope(self, beta_bar: Any, slope: Jet) -> Jet:
        """Return a jet with the sign of d(beta_bar)/d(gamma_bar_0) at a fixed time.

        gamma_bar_0 is the start's gamma_bar, the family's amplitude. ``slope`` is the derivative of
        ``beta_bar`` with respect to the curve's parameter.
        """
        return slope


@dataclass(frozen=True)
class HalfMapEnclosure:
    """The proved properties of all orbits from a curve of starts over half a period, as jets in s.

    ``image`` is the image under S of the point (gamma_bar, v) to which the curve's own orbits
    return after ``curve_time``. The others hold for all orbits from the curve and the deviations
    about it. Derivatives are taken with respect to the curve's three numbers.
    """

    image: Sequence[Jet]
    curve_time: Jet  #: of the curve's own orbits [s]
    image_by_start: Matrix  #: (2, 3) jets: of the half map
    time_by_start: Sequence[Jet]  #: (3,)
    divergence: Jet  #: integral of div f over the flight
    beta_least: Any  #: a ball whose lowest number is a lower bound of beta_bar [rad]
    turning_steps: Sequence[Step]  #: the steps that hold all moments with v = 0


class CurveReplay:
    """A source of the steps of one flight, which repeats those that a certificate's log records.

    The log contains, as decimals, the share of each step and, except for the last, the axes.
    """

    def __init__(self, log: Sequence[Mapping[str, Any]]) -> None:
        self.log, self.number = log, 0

    def next_step(self, flight: CurveFlight, max_length: Any) -> Step:
        require(
            self.number < len(self.log), "the return is not reached: there are no further steps"
        )
        self.number += 1
        share = nearby_double(self.log[self.number - 1]["share"])
        return StepTrial(flight, SERIES_ORDERS).tested_step((flight.duration * share).mid())

    def new_axes(self, moved_axes: Any, sizes: Any, stiffness: Any) -> Matrix:
        log = self.log[self.number - 1]
        require("axes" in log, "the axes after it are missing")
        return [[arb(nearby_double(part)) for part in row] for row in log["axes"]]

    def record_step(self, step: Step, axes: Matrix | None) -> None:
        require(
            axes is not None or self.number == len(self.log),
            "the return is reached, and there are further steps",
        )


class _CurveField:
    """The vector field at the speeds of a curve of starts, for each s and over all s at once."""

    def __init__(self, constants: FieldConstants, curve: Curve) -> None:
        self.midpoint_system = curve.field_class(
            constants, *curve.equation_parameters
        ).system_at_speed(curve.omega)
        short_field = curve.field_class(
            constants, *map(truncated_for_derivatives, curve.equation_parameters)
        )
        self.rates, self.variational_system_with_divergence = (
            short_field.rates,
            short_field.variational_system_with_divergence,
        )
        self.remainder_field = curve.field_class(
            constants, *map(range_of, curve.equation_parameters)
        )
        self.remainder_field.midpoint_system = self.remainder_field.system_at_speed(
            self.remainder_field.omega
        )


class CurveFlight(EnclosedFlight):
    """The flight of all orbits that start on a curve or in the box of deviations about it.

    For each parameter s of the curve the steps have lengths of their own.
    """

    def __init__(self, constants: FieldConstants, curve: Curve, proposer: Any) -> None:
        zero = 0 * curve.v.mid()
        zero_ball, short_zero = zero.coefficients[0], truncated_for_derivatives(zero)
        states = Doubleton([zero, *curve.start], curve.omega)
        states.deviation, states.parameter_columns = [*curve.deviation], curve.parameter_columns
        states.linear_part = [
            [short_zero] * 3,
            *([short_zero + entry for entry in row] for row in curve.start_derivative),
        ]
        states.axes = [[zero_ball + int(i == j) for j in range(3)] for i in range(3)]
        states.remainder = states.middle_remainder = [zero_ball] * 3
        states.remainder_derivatives = [[zero_ball] * 3 for _ in range(3)]
        super().__init__(_CurveField(constants, curve), states, proposer, derivatives=True)
        self.duration = curve.duration

    def _stopping_status(self) -> None:
        """Return None: this flight never ends because its boxes are wide.

        Boxes over a whole curve are wide, but the parameter s tells where in them an orbit is.
        """


def beta_extremes(step: Step) -> Iterator[tuple[Any, Sequence[Jet]]]:
    """Yield beta_bar and its derivatives for each part of a step in which v may be 0, so that
    beta_bar may be largest or least.

    The derivatives are those at a fixed time, with respect to the curve's three numbers.
    """
    zero_ball = 0 * step.length.coefficients[0]
    open_parts = [(0.0, 1.0)]
    while open_parts:
        begin, end = open_parts.pop()
        time = step.length * (zero_ball + begin).union(zero_ball + end)
        v = step.component(2, time).range()
        if negative(v) or positive(v):
            continue
        if end - begin > _MIN_PART:
            middle = (begin + end) / 2
            open_parts += [(begin, middle), (middle, end)]
        else:
            only = slice(1)
            yield (
                step.component(0, time).range(),
                step.state_set.derivatives_after_map(step.step_derivatives_at(time, only))[0],
            )


def enclose_half_map(constants: FieldConstants, curve: Curve, proposer: Any) -> HalfMapEnclosure:
    """Enclose the half map, from section to section, for all starts on a curve and in the box about
    it.

    ``proposer`` is a `proved_flow.StepProposer` whose steps are shares of the curve's ``duration``.
    Raises Unproved, with the number of the step that fails.
    """
    flight = CurveFlight(constants, curve, proposer)
    require(negative(flight.box[2].range()), "v is not shown to be negative at the start")
    least, turning_steps = 0 * curve.duration.coefficients[0], []
    try:
        while True:
            step = flight.step()
            beta_bar, _, v = step.enclosure
            require(inside(beta_bar, arb(0, BELOW_HALF_PI)), "beta is not shown to stay upright")
            passed = positive(step.states_at_end()[0].range())
            require(
                positive(v) if passed else negative(v) or negative(beta_bar),
                "beta is not shown to move as it must",
            )
            least = least.union(beta_bar)
            if not (negative(v) or positive(v)):
                turning_steps.append(step)
            if passed:
                proposer.record_step(step, None)
                return _enclosed_return(flight, step, least, turning_steps)
            flight.take_step(step)
    except Unproved as fault:
        raise Unproved(f"step {flight.step_count + 1}: {fault}") from None


def _enclosed_return(
    flight: CurveFlight, step: Step, least: Any, turning_steps: Sequence[Step]
) -> HalfMapEnclosure:
    """Return the proved properties of a flight whose orbits return to the section in its last step.

    The return is enclosed within that step.

    Args:
        flight: The flight up to the last step.
        step: The last step.
        least: A ball whose lowest number is a lower bound of beta_bar so far.
        turning_steps: The steps that hold all moments with v = 0.
    """
    states, length = step.state_set, step.length
    tau = (flight.duration - flight.time).mid()
    centre, rows = step.midpoint_orbit_at(tau), step.step_derivatives_at(tau)
    beta = states.image(centre, rows)[0]
    early = tau + symmetric_hull(beta.range() / step.enclosure[2])
    within = all(positive(part.range()) for part in (tau, length - tau, early, length - early))
    require(within, "the return is not shown to lie within the step")
    v = step.component(2, early)
    moment, own_moment = tau - beta / v, tau - states.image_of_middle(centre, rows)[0] / v
    own = states.image_of_middle(
        step.midpoint_orbit_at(own_moment), step.step_derivatives_at(own_moment)
    )
    rows = step.step_derivatives_at(moment)
    _, gamma_bar, v = map(
        truncated_for_derivatives, states.image(step.midpoint_orbit_at(moment), rows)
    )
    require(positive(v.range()), "v is not shown to be positive at the return")
    acceleration = flight.field.rates((0 * v, gamma_bar, v))[2]
    by_start = states.derivatives_after_map(rows)
    time_by = [-entry / v for entry in by_start[0]]
    v_row = [-(entry + acceleration * t) for entry, t in zip(by_start[2], time_by, strict=True)]
    return HalfMapEnclosure(
        (-own[1], -own[2]),
        own_moment + flight.time,
        ([-entry for entry in by_start[1]], v_row),
        time_by,
        flight.divergence + step.divergence_at(moment),
        least,
        turning_steps,
    )


@dataclass(frozen=True)
class ArcTest:
    """The result of Krawczyk's test of a curve of approximate limit cycles with the parameter s.

    If ``included``, there is exactly one cycle in the box for each s.
    """

    included: bool
    curve: Curve  #: m(s) and r
    half_map: HalfMapEnclosure
    shift: Sequence[Any]  #: K(s) - m(s) for all s: balls of the two unknowns
    slopes: Sequence[Jet]  #: d(the two unknowns)/d(parameter)
    determinant: Jet  #: of d(equations)/d(unknowns)

    def period_slope(self) -> Jet:
        """Return an enclosure of dT/d(gamma_bar_0), with T the cycle's period, for each s."""
        by = self.half_map.time_by_start
        return 2 * (by[0] + by[1] * self.slopes[0] + by[2] * self.slopes[1])

    def trace(self) -> Jet:
        """Return the trace of the half map's derivative with respect to (gamma_bar, v) at the arc's
        cycles, as a jet in s.
        """
        return self.curve.trace(self.half_map.image_by_start)

    def stable(self) -> bool | None:
        """Return True if all limit cycles of the arc are proved asymptotically stable, False if all
        are proved not to be, None if neither is proved.

        For scaled states True means all cycles except the equilibrium at the Hopf point.
        """
        trace, contraction = self.trace().range(), self.half_map.divergence.range().exp()
        below = (self.slopes[1] * self.determinant).range()
        if positive(below) and positive(1 + trace - contraction):
            return True
        # delta > 0, so this is enough.
        return False if negative(1 - trace) or negative(1 + trace) else None

    def speed_falls(self) -> bool | None:
        """Return True if the speed Omega is shown to fall all along the arc as the amplitude
        gamma_bar_0 grows.

        Returns False if Omega rises, and None if neither is shown.
        """
        slope = self.slopes[1].range()
        if negative(slope):
            return True
        return False if positive(slope) else None

    def period_grows(self) -> bool:
        """Return True if the period is shown to grow with the amplitude gamma_bar_0 all along the
        arc.
        """
        return bool(positive(self.period_slope().range()))

    def beta_max_grows(self) -> bool:
        """Return True if beta_max is shown to grow with the amplitude gamma_bar_0 all along the
        arc, except at the Hopf point.
        """
        for beta_bar, row in chain.from_iterable(map(beta_extremes, self.half_map.turning_steps)):
            slope = row[0] + row[1] * self.slopes[0] + row[2] * self.slopes[1]
            if not negative(self.curve.amplitude_slope(beta_bar, slope).range()):
                return False
        return bool(self.half_map.turning_steps)


def krawczyk_test_of_arc(constants: FieldConstants, curve: Curve, proposer: Any) -> ArcTest:
    """Test by Krawczyk's operator if one limit cycle lies in the box about each point of a curve.

    The curve consists of starts and speeds with a parameter s; all s are tested at once.

    Args:
        constants: Balls of the disk's constants.
        curve: The curve and its box; its first number, the parameter, has no deviation.
        proposer: The proposer of the flight's steps.

    Returns:
        The test's result, which may be that the cycles are not included.

    Raises:
        Unproved: If the flight fails.
    """
    half_map = enclose_half_map(constants, curve, proposer)
    radii = [curve.deviation[k] for k in UNKNOWN_INDICES]
    value = [after - before for after, before in zip(half_map.image, curve.start, strict=True)]
    jacobian = [
        [entry - own for entry, own in zip(*rows, strict=True)]
        for rows in zip(half_map.image_by_start, curve.start_derivative, strict=True)
    ]
    by_unknowns = [[row[k] for k in UNKNOWN_INDICES] for row in jacobian]
    preconditioner = midpoint_inverse(by_unknowns)
    degree = preconditioner[0][0].degree
    value = [entry.truncated(degree) for entry in value]
    shift, included = [], True
    for i in range(2):
        image = -(preconditioner[i][0] * value[0] + preconditioner[i][1] * value[1]).range()
        for j in range(2):
            rest = int(i == j) - (
                preconditioner[i][0] * by_unknowns[0][j] + preconditioner[i][1] * by_unknowns[1][j]
            )
            image = image + rest.range() * radii[j]
        shift.append(image)
        included = included and bool(inside(image, radii[i]))
    (a, b), (c, d) = by_unknowns
    slopes = [
        -(row[0] * jacobian[0][0] + row[1] * jacobian[1][0])
        for row in inverse_of_order_2(by_unknowns)
    ]
    return ArcTest(included, curve, half_map, shift, slopes, a * d - b * c)
