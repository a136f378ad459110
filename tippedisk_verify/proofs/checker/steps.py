"""The flow, step by step: the equations and what is shown of one step of a certificate.

The equations (Eqs. 3DOF ... lin_lambda_y_3DOF of the paper), their derivatives and the recurrences of their Taylor
coefficients are written down here once more. Angles are beta_bar = beta - pi/2 and gamma_bar = gamma - pi/2.

**A set of states** is middle + lead d + axes q, for all deviations d of the start and the speed and all q of the box
``rest``; the derivatives by the start and the speed are lead + axes s with s in ``spread``.

**A step** of length h has an enclosure E of the states and of the derivatives over the step. With polynomials of order
k from the set's box, and c the Taylor coefficients number k + 1 over E, it is shown that polynomial(t) + t^(k+1) c lies
in E's interior for all t of [0, h]: then every orbit exists on [0, h] and stays in E (Taylor's formula with Lagrange's
remainder). By the mean value theorem the set's image is the middle's image plus the derivatives times the deviations;
it is shown to lie in the next set, whose points and boxes the certificate gives.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from fractions import Fraction
from typing import Any

from flint import arb, arb_mat, arb_series, ctx, fmpq

from tippedisk_verify.proofs.kernel.balls import Unproved, need
from tippedisk_verify.proofs.kernel.field import UNITS

__all__ = [
    "UNITS",
    "Flow",
    "Piece",
    "States",
    "Unproved",
    "after",
    "coefficients",
    "column",
    "context",
    "exact_ball",
    "inside",
    "need",
    "positive",
]


def exact_ball(value: str | Fraction) -> Any:
    number = Fraction(value)
    return arb(fmpq(number.numerator, number.denominator))


def positive(*balls: Any) -> bool:
    """Whether all numbers of the balls are greater than zero; False for what is not finite."""
    return all(x.is_finite() and x > 0 for x in balls)


def inside(x: Any, y: Any) -> bool:
    return bool(x.is_finite() and y.is_finite() and y.contains_interior(x))


def _horner(coefficients: Sequence[Any], variable: Any) -> Any:
    total = coefficients[-1]
    for value in reversed(coefficients[:-1]):
        total = total * variable + value
    return total


@contextmanager
def context(bits: int | None = None, length: int | None = None) -> Iterator[None]:
    """Python-flint's precision and the length of its series within the block: the one place that touches them.

    Another thread may change them all the same. Fewer bits make balls wider. What a shorter length cuts off of a series
    is missed where it is read, by `coefficients`.
    """
    before = ctx.prec, ctx.cap
    try:
        ctx.prec, ctx.cap = bits or before[0], length or before[1]
        yield
    finally:
        ctx.prec, ctx.cap = before


def coefficients(series: Any, length: int) -> list[Any]:
    """The first coefficients of a series; its end is not taken for zeros, as python-flint does. Raises Unproved."""
    need(series.prec >= length, "a series was cut off: something else in this process has changed flint.ctx.cap")
    return [series[k] for k in range(length)]


def _dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    """a_0 b_n + ... + a_n b_0, for b_0 ... b_n."""
    return sum(x * y for x, y in zip(a, reversed(b), strict=False))


class Flow:
    """The equations for exact parameters and a ball of speeds w."""

    def __init__(self, parameters: dict[str, str], speed: Any) -> None:
        r, e, m, A, B, g, mu, epsilon = (Fraction(parameters[name]) for name in UNITS)
        need(0 < e < r and m * e * e < B <= A and min(g, mu, epsilon) > 0 and m > 0, "the parameters are no disk's")
        self.parameters, self.w = parameters, speed
        #: with all forces divided by the mass
        self.r, self.e, self.a, self.b, self.g, self.k = map(
            exact_ball, (r, e, A / m, B / m - e * e, g, mu * g / epsilon)
        )

    def acceleration(self, angles: Sequence[Any], v: Any, partials: bool) -> list[Any]:
        """v' for (sin beta, cos beta, sin gamma, cos gamma); with its derivatives by beta, gamma, v and w."""
        sb, cb, sg, cg = angles
        w, e, k, gap = self.w, self.e, self.k, 2 * (self.a - self.b)
        rho, rho_g, ew = e * sg + self.r, e * cg, e * w
        sb2, cb2, sbcb, sgcg = sb * sb, cb * cb, sb * cb, sg * cg
        inertia = self.a * (cg * cg) + self.b * (sg * sg)
        mass, rho2 = inertia + rho * rho * cb2, rho * rho
        swing = inertia * (w * w) + rho2 * (v * v)
        tilt = 3 * sb2 + (-2)
        cross = gap * sgcg + e * (rho * tilt * cg)
        slip = rho * v - ew * (sb * cg)  # gamma_y / sin beta
        turn = (ew * w) * (sb * cb2 * cb)
        rate = sbcb * swing + turn * (rho * sg) - w * (v * cb * cross) - self.g * (rho * cb) - k * (rho * sb2 * slip)
        try:
            rate = rate / mass
        except ValueError:  # Arb divides no series by a ball that holds zero
            raise Unproved("the mass may vanish over its enclosure") from None
        if not partials:
            return [rate]
        by_beta = (
            (cb2 - sb2) * swing + (ew * w) * (rho * sg * cb2 * (cb2 - 3 * sb2)) + self.g * (rho * sb)
            - w * (v * (6 * e * (rho * sbcb * cb * cg) - sb * cross))
            - k * (rho * sb * (2 * (cb * slip) - ew * (sbcb * cg)))
        )  # fmt: skip
        lean, inertia_g = rho_g * cg - rho * sg, -gap * sgcg
        by_gamma = (
            sbcb * (inertia_g * (w * w) + 2 * (rho * rho_g * (v * v))) + turn * (rho_g * sg + rho * cg)
            - w * (v * cb * (gap * (cg * cg - sg * sg) + e * (tilt * lean))) - self.g * (rho_g * cb)
            - k * (sb2 * (rho_g * slip + rho * (rho_g * v + ew * (sb * sg))))
        )  # fmt: skip
        by_v = 2 * (rho2 * v * sbcb) - w * (cb * cross) - k * (rho2 * sb2)
        by_w = (2 * w) * (sbcb * (inertia + e * (cb2 * rho * sg))) - v * cb * cross + (k * e) * (rho * sb2 * sb * cg)
        mass_b, mass_g = -2 * (rho2 * sbcb), inertia_g + 2 * (rho * rho_g * cb2)
        return [rate, (by_beta - rate * mass_b) / mass, (by_gamma - rate * mass_g) / mass, by_v / mass, by_w / mass]

    def rates(self, state: Sequence[Any], partials: bool = False) -> tuple[list[Any], list[Any]]:
        """(beta', gamma', v') for balls or series; with the derivatives of gamma' by beta and w, and those of v'."""
        beta, gamma, v = state
        sb, cb = beta.cos(), -beta.sin()  # beta = beta_bar + pi/2
        rate, *by = self.acceleration((sb, cb, gamma.cos(), -gamma.sin()), v, partials)
        return [v, cb * -self.w, rate], [sb * self.w, -cb, *by]

    def taylor(self, start: Sequence[Any], order: int) -> list[list[Any]]:
        """Coefficients 0 ... order of the orbits from (beta_bar, gamma_bar, v).

        The start may have the derivatives by beta, gamma, v and w besides, row by row (12); then so have the orbits,
        and at the end stands the integral of the field's divergence.
        """
        columns = [[value] for value in start]
        for k in range(order):
            with context(length=k + 1):
                rates, _ = self.rates([arb_series(column, prec=k + 1) for column in columns[:3]])
            for column, rate in zip(columns, rates, strict=False):
                column.append(coefficients(rate, k + 1)[k] / (k + 1))
        if len(columns) == 3:
            return columns
        with context(length=order):
            _, by = self.rates([arb_series(column, prec=order) for column in columns[:3]], True)
        gb, gw, ab, ag, av, aw = (coefficients(series, order) for series in by)
        for k in range(order):
            for side in range(4):
                first, second, third = columns[3 + side :: 4]
                rates = [third[k], _dot(gb, first), _dot(ab, first) + _dot(ag, second) + _dot(av, third)]
                if side == 3:
                    rates[1], rates[2] = rates[1] + gw[k], rates[2] + aw[k]
                for column, rate in zip((first, second, third), rates, strict=True):
                    column.append(rate / (k + 1))
        return [*columns, [arb(0), *(part / (k + 1) for k, part in enumerate(av))]]


class States:
    """middle + lead d + axes q: points, a column of balls d (4) and one of balls q (3); see the file's docstring."""

    def __init__(self, deviation: Any, middle: Any, lead: Any, axes: Any, rest: Any, spread: Any) -> None:
        self.deviation, self.middle, self.lead, self.axes = deviation, column(middle), arb_mat(lead), arb_mat(axes)
        self.rest, self.spread = column(rest), arb_mat(spread)

    @classmethod
    def start(cls, middle: Sequence[Any], deviation: Sequence[Any]) -> States:
        """At the start: the derivatives are the unit matrix, and none by the speed."""
        unit = [[int(column == row) for column in range(4)] for row in range(3)]
        return cls(column(deviation), middle, unit, [row[:3] for row in unit], [0] * 3, [[0] * 4] * 3)

    def box(self) -> list[Any]:
        """Balls that hold all states, and the middle."""
        away = self.lead * self.deviation + self.axes * self.rest
        return [middle + part.union(arb(0)) for middle, part in zip(self.middle.entries(), away.entries(), strict=True)]


def column(entries: Sequence[Any]) -> Any:
    return arb_mat([[entry] for entry in entries])


class Piece:
    """What is shown over one step: the enclosures of the middle's orbit and of all derivatives, as polynomials."""

    def __init__(
        self, flow: Flow, states: States, length: Any, orders: Sequence[int], enclosure: Sequence[Any] | None
    ) -> None:
        """Raises Unproved if ``enclosure`` (states and twelve derivatives) is not shown to hold them all along.

        Without one it is tried with the ranges of the polynomials, made a little wider.
        """
        need(positive(length), "its length is not positive")
        fine, rough = orders
        wide = flow.taylor(
            [*states.box(), *(int(column == row) + arb(0) for row in range(3) for column in range(4))], rough
        )
        span = arb(0).union(length)
        if enclosure is None:
            ranges = [_horner(series, span) for series in wide[:15]]
            enclosure = [x + arb(0, (x.rad() / 256 + abs(x) / 2**30 + arb(2) ** -60).upper()) for x in ranges]
        self.states, self.length, self.enclosure = states, length, enclosure
        for series, last in zip(wide, flow.taylor(enclosure, rough + 1), strict=True):
            series.append(last[-1])
        for series, room in zip(wide[:15], enclosure, strict=True):
            moved = _horner(series[:-1], span) + series[-1] * span ** (rough + 1)
            need(inside(moved, room), "the states and derivatives over it are not shown to stay in its enclosure")
        thin = Flow(flow.parameters, flow.w.mid())
        self._orbit, self._slopes = thin.taylor(states.middle.entries(), fine), wide[3:]
        for series, last in zip(self._orbit, thin.taylor(enclosure[:3], fine + 1), strict=True):
            series.append(last[-1])

    def mapped(self, time: Any) -> tuple[Any, Any, Any]:
        """The middle's image, the lead's with the speed's own part, and that of the axes."""
        slopes = [_horner(series, time) for series in self._slopes[:12]]
        rows = arb_mat([slopes[4 * row : 4 * row + 3] for row in range(3)])
        own = arb_mat([[0, 0, 0, slopes[4 * row + 3]] for row in range(3)])
        return column([_horner(c, time) for c in self._orbit]), rows * self.states.lead + own, rows * self.states.axes

    def image(self, time: Any) -> list[Any]:
        """The states after ``time``, a point or ball within the step."""
        centre, lead, axes = self.mapped(time)
        return list((centre + lead * self.states.deviation + axes * self.states.rest).entries())

    def derivatives(self, time: Any) -> Any:
        """(3, 4): those of the states after ``time`` by the start of the flight and the speed."""
        _, lead, axes = self.mapped(time)
        return lead + axes * self.states.spread

    def divergence(self, time: Any) -> Any:
        return _horner(self._slopes[12], time)

    def carried(self, middle: Any, lead: Any, axes: Any) -> tuple[Any, Any]:
        """What q and s are at the step's end in a set with these points. Raises ZeroDivisionError for flat axes."""
        centre, led, turned = self.mapped(self.length)
        inverse = axes.inv()
        left, turned = inverse * (led - lead), inverse * turned
        rest = inverse * (centre - middle) + left * self.states.deviation + turned * self.states.rest
        return rest, left + turned * self.states.spread

    def passes(self, moments: Sequence[Any], index: int, level: Any) -> Any:
        """The moments between two, at which a component passes a level upwards."""
        early, late = moments
        below, above = level - self.image(early)[index], self.image(late)[index] - level
        need(
            positive(below, above) and bool(early >= 0 and early <= late and late <= self.length),
            "the component is not shown to pass its level between the two moments",
        )
        return early.union(late)


def after(piece: Piece, step: dict[str, Any]) -> States:
    """The states that a step ends with, shown to hold its image."""
    states = States(piece.states.deviation, **step["states"])
    try:
        carried = piece.carried(states.middle, states.lead, states.axes)
    except ZeroDivisionError:
        raise Unproved("its axes have no inverse") from None
    for image, room in zip(carried, (states.rest, states.spread), strict=True):
        held = all(x.is_finite() and y.contains(x) for x, y in zip(image.entries(), room.entries(), strict=True))
        need(held, "its image is not shown to lie in the states that follow")
    return states
