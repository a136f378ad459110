"""An arc of the family of limit cycles, proved: for each speed of an interval exactly one, by one Krawczyk test.

Three numbers describe a cycle that S maps to itself: gamma_bar and v on the section, and Omega. One of them is the
arc's parameter p = p_0 + R s, |s| <= 1; the other two, u, are unknown, with the two equations F_p(u) = P - (gamma_bar,
v) = 0 for the half map P (`section`). Let m(s) be polynomials near the family, r > 0 two numbers, and X(s) the box of
all u with |u - m(s)| <= r: it moves with s. For regular matrices Y(s), which are chosen as well,

    K(s) = m(s) - Y(s) F(m(s)) + (1 - Y(s) F'(X(s))) (X(s) - m(s)),

F and F' at the parameter's value for s. *For each s by itself* this is Krawczyk's operator: if K(s) lies in X(s)'s
interior, the box X(s) holds exactly one zero u(s) of F at this value of the parameter, it lies in K(s), and all
matrices of F'(X(s)) are regular. One flight over the curve m(s) with the deviations |d| <= r about it (`curve_flow`)
gives F(m(s)) and enclosures of F'(X(s)) as jets, functions enclosed for each s. The test takes the ranges over s of

    - Y(s) F(m(s))  +  (1 - Y(s) F'(s)) [-r, r]  =  K(s) - m(s)

and asks whether they lie inside (-r, r). So one test answers for all s of [-1, 1], that is, for all values of the
parameter. F is analytic, and F' by the unknowns is regular, so u(s) is an analytic curve by the implicit function
theorem, and u' = -(dF/du)^-1 dF/dp.

With gamma_bar as the parameter the columns of P' - 1 and dP/dOmega are c_g, c_v and c_Omega, and differentiating the
equations along the curve gives c_g + c_v v' + c_Omega Omega' = 0. The determinants of both sides with c_v say that
det(P' - 1) = Omega' det(c_v, c_Omega), which keeps its relative accuracy where Omega' is small. Let beta_max be the
largest |beta_bar| of a cycle. Where it is taken v = 0, and the derivative of beta_bar by gamma_bar_0 *at a fixed time*
is enclosed for all times at which v may be 0. If it is negative, beta_max grows: at the moment at which one cycle has
its beta_max, its neighbours of larger gamma_bar_0 are further out. `scaled` says how it is with the state divided by
gamma_bar_0.

Period, multipliers and slopes are ranges of jets: they hold for each s the number of that cycle. With tau the trace of
P' and delta = exp(integral of div f) = -det P' > 0 (Liouville, see `cycle`), P' has one positive and one negative
eigenvalue. Both lie between -1 and 1 if and only if 1 - tau - delta = det(P' - 1) > 0 and 1 + tau - delta > 0, the
values of its characteristic polynomial there; if one of these is negative, an eigenvalue lies outside.

Where a ball becomes a point or a float: m, Y and r are chosen, and any choice that passes the test is right.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from tippedisk_verify.model.parameters import Constants
from tippedisk_verify.proofs.kernel.curve_flow import Curve, CurveFlight, fly, glide
from tippedisk_verify.proofs.kernel.jets import Jet, inside, negative, positive

__all__ = ["GAMMA_BAR", "OMEGA", "Arc", "family_polynomials", "krawczyk_test"]

GAMMA_BAR, OMEGA = 0, 2  #: which of (gamma_bar, v, Omega) is the parameter
_TINY = 2.0**-20  # of a number's step, for a derivative of points
_POLISHES = 3  # chord steps towards the cycle at s = 0


@dataclass(frozen=True)
class Arc:
    """What one test says of an arc. Where ``proved`` (of each lane) there is exactly one cycle for each s."""

    proved: Any
    over: int  #: the parameter, GAMMA_BAR or OMEGA
    curve: Curve  #: m(s) and r
    flight: CurveFlight
    within: Sequence[Any]  #: K(s) - m(s) for all s: balls of the two unknowns
    slopes: Sequence[Jet]  #: derivatives of the two unknowns by the parameter
    determinant: Jet  #: of the equations' derivative by the unknowns

    @property
    def unknowns(self) -> tuple[int, int]:
        return _unknowns(self.over)

    def period(self) -> Jet:
        """T [s]."""
        half: Jet = self.flight.own_time
        for k, part in zip(self.unknowns, self.within, strict=True):
            half = half + self.flight.time_by[k] * part
        return 2 * half

    def period_slope(self) -> Jet:
        """dT/dp."""
        first, second = self.unknowns
        by = self.flight.time_by
        return 2 * (by[self.over] + by[first] * self.slopes[0] + by[second] * self.slopes[1])

    def trace(self) -> Jet:
        """Of the half map's derivative by gamma_bar and v."""
        return self.curve.trace(self.flight.matrix)

    def stable(self) -> Any:
        """Whether all the arc's cycles are asymptotically stable; of scaled states: all but that at the Hopf point."""
        trace, rest = self.trace().range(), self.flight.divergence.range() / 16
        # 1 - x <= exp(-x), so exp(16 x) <= (1 - x)^-16 for x < 1.
        shrinking = 1 / (1 - rest)
        for _ in range(4):
            shrinking = shrinking * shrinking
        below = 1 - trace - shrinking if self.over == OMEGA else (self.slopes[1] * self.determinant).range()
        return positive(1 - rest) & positive(below) & positive(1 + trace - shrinking)

    def falling(self) -> Any:
        """Whether Omega falls with gamma_bar_0 all along an arc over it."""
        return negative(self.slopes[1].range())

    def slowing(self) -> Any:
        """Whether the period grows with gamma_bar_0 all along an arc over it."""
        return positive(self.period_slope().range())

    def widening(self) -> Any:
        """Whether beta_max grows with gamma_bar_0 all along an arc over it (not at the Hopf point, where it is 0)."""
        found: Any = bool(self.flight.turning)
        for beta_bar, row in self.flight.turning:
            slope = row[0] + row[1] * self.slopes[0] + row[2] * self.slopes[1]
            found = found & negative(self.curve.rise(beta_bar, slope).range())
        return found

    def unstable(self) -> Any:
        """Whether all are unstable: delta > 0, so this is enough."""
        trace = self.trace().range()
        return negative(1 - trace) | negative(1 + trace)


def _unknowns(over: int) -> tuple[int, int]:
    return (0, 1) if over == OMEGA else (1, 2)


def krawczyk_test(constants: Constants, curve: Curve, total: Jet, over: int = OMEGA) -> Arc:
    """Krawczyk's test on a curve of starts and speeds; number ``over`` of the three is the parameter.

    It has no deviation. ``total`` [s]: about half the period.
    """
    with curve.v.quiet():
        flight = fly(constants, curve, total)
        first, second = _unknowns(over)
        radii = [curve.deviation[k] for k in (first, second)]
        value = [after - before for after, before in zip(flight.image, curve.start, strict=True)]
        jacobian = [[entry - own for entry, own in zip(*rows, strict=True)]
                    for rows in zip(flight.matrix, curve.unit, strict=True)]  # fmt: skip
        by_unknowns = [[row[first], row[second]] for row in jacobian]
        inverse = [[entry.mid() for entry in row] for row in _inverse([[x.mid() for x in row] for row in by_unknowns])]
        within, proved = [], flight.proved
        for i in range(2):
            residual = inverse[i][0] * value[0] + inverse[i][1] * value[1]
            image = -residual.range()
            for j in range(2):
                rest = int(i == j) - (inverse[i][0] * by_unknowns[0][j] + inverse[i][1] * by_unknowns[1][j])
                image = image + rest.range() * radii[j]
            within.append(image)
            proved = proved & inside(image, radii[i])
        (a, b), (c, d) = by_unknowns
        exact = _inverse(by_unknowns)
        slopes = [-(row[0] * jacobian[0][over] + row[1] * jacobian[1][over]) for row in exact]
        return Arc(proved, over, curve, flight, within, slopes, a * d - b * c)


def _slope(constants: Constants, kind: type[Curve], point: Sequence[Any], half: Any, moving: int) -> list[Any]:
    """Roughly dF by one of the three numbers."""
    zero = 0 * point[0]
    moved = [Jet([part, zero + _TINY * int(moving == j)]) for j, part in enumerate(point)]
    image, _ = glide(constants, kind(moved[0], moved[1], moved[2], [zero] * 3), Jet.constant(half, 1))
    return [(part.c[1] / _TINY).mid() - own[moving] for part, own in zip(image, kind.unit, strict=True)]


def _inverse(matrix: Sequence[Sequence[Any]]) -> list[list[Any]]:
    (a, b), (c, d) = matrix
    determinant = a * d - b * c
    return [[d / determinant, -b / determinant], [-c / determinant, a / determinant]]


def family_polynomials(
    constants: Constants,
    start: Sequence[Any],
    radius: Any,
    degree: int,
    total: Any,
    over: int = OMEGA,
    kind: type[Curve] = Curve,
) -> tuple[list[Jet], Jet]:
    """Taylor polynomials in s of (gamma_bar, v, Omega) along the family, and of half the period. Points; a guess.

    ``start`` is near the cycle at s = 0. With Y constant, a chord step finds the coefficient of s^k once those before
    it are known.
    """
    zero = 0 * start[0]
    point = [part.mid() for part in start]
    free = _unknowns(over)
    nothing = [zero, zero, zero]
    (a, c), (b, d) = (_slope(constants, kind, point, total, k) for k in free)
    determinant = a * d - b * c
    inverse = ((d / determinant, -b / determinant), (-c / determinant, a / determinant))
    polynomials = [[part] for part in point]
    half = Jet([total])
    for k in (*[0] * _POLISHES, *range(1, degree + 1)):
        if len(polynomials[0]) == k:
            for part in polynomials:
                part.append(zero)
            half = Jet([*half.c, zero])
            if k == 1:
                polynomials[over][1] = radius
        first, v, speed = map(Jet, polynomials)
        curve = kind(first, v, speed, nothing)
        image, half = glide(constants, curve, half)
        value = [after.c[k] - before.c[k] for after, before in zip(image, curve.start, strict=True)]
        for row, index in zip(inverse, free, strict=True):
            polynomials[index][k] = (polynomials[index][k] - row[0] * value[0] - row[1] * value[1]).mid()
    return [Jet(part) for part in polynomials], half
