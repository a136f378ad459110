"""An arc of the family of limit cycles: for each value of a parameter exactly one cycle, by one Krawczyk test.

Three numbers describe a cycle that S maps to itself: gamma_bar and v on the section, and Omega. One of them is the
arc's parameter p = p_0 + R s, |s| <= 1; the other two, u, are unknown, with the two equations F_p(u) = P - (gamma_bar,
v) = 0 for the half map P (`section`). Let m(s) be polynomials near the family, r > 0 two numbers, X(s) the box of all u
with |u - m(s)| <= r, and Y(s) regular matrices. *For each s by itself* `krawczyk` says: if

    - Y(s) F(m(s))  +  (1 - Y(s) F'(X(s))) [-r, r]  lies inside  (-r, r),

X(s) holds exactly one zero u(s) of F, and all matrices of F'(X(s)) are regular. One flight over the curve m(s) with the
deviations |d| <= r about it (`curves`) gives F(m(s)) and F'(X(s)) as jets, functions enclosed for each s; the test
compares their ranges, for all s at once. u(s) is an analytic curve by the implicit function theorem, and u' =
-(dF/du)^-1 dF/dp.

With gamma_bar as the parameter the columns of P' - 1 and dP/dOmega are c_g, c_v and c_Omega, and differentiating the
equations along the curve gives c_g + c_v v' + c_Omega Omega' = 0. The determinants of both sides with c_v say that
det(P' - 1) = Omega' det(c_v, c_Omega), which keeps its relative accuracy where Omega' is small. Let beta_max be the
largest |beta_bar| of a cycle. Where it is taken v = 0, and the derivative of beta_bar by gamma_bar_0 *at a fixed time*
is enclosed for all times at which v may be 0. If it is negative, beta_max grows: at the moment at which one cycle has
its beta_max, its neighbours of larger gamma_bar_0 are further out. `scaled` says how it is with the state divided by
gamma_bar_0.

With tau the trace of P' and delta = exp(integral of div f) = -det P' > 0 (Liouville, see `claims.cycle`), P' has one
positive and one negative eigenvalue. Both lie between -1 and 1 if and only if 1 - tau - delta = det(P' - 1) > 0 and
1 + tau - delta > 0, the values of its characteristic polynomial there; if one of these is negative, an eigenvalue lies
outside.

Where a ball becomes a point or a float: m, Y and r are chosen, and any choice that passes the test is right.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

from tippedisk_verify.proofs.kernel.balls import inside, negative, positive
from tippedisk_verify.proofs.kernel.curves import Curve, CurveFlight, fly, turnings
from tippedisk_verify.proofs.kernel.field import Constants
from tippedisk_verify.proofs.kernel.jets import Jet

__all__ = ["GAMMA_BAR", "OMEGA", "UNKNOWNS", "Arc", "arc_test", "inverse"]

GAMMA_BAR, OMEGA = 0, 2  #: which of (gamma_bar, v, Omega) is the parameter
UNKNOWNS = {GAMMA_BAR: (1, 2), OMEGA: (0, 1)}  #: and which are unknown


@dataclass(frozen=True)
class Arc:
    """What one test says of an arc. Where ``included`` there is exactly one cycle for each s."""

    included: bool
    over: int  #: the parameter, GAMMA_BAR or OMEGA
    curve: Curve  #: m(s) and r
    flight: CurveFlight
    within: Sequence[Any]  #: K(s) - m(s) for all s: balls of the two unknowns
    slopes: Sequence[Jet]  #: derivatives of the two unknowns by the parameter
    determinant: Jet  #: of the equations' derivative by the unknowns

    def period(self) -> Jet:
        """T [s]."""
        half: Jet = self.flight.own_time
        for k, off in zip(UNKNOWNS[self.over], self.within, strict=True):
            half = half + self.flight.time_by[k] * off
        return 2 * half

    def period_slope(self) -> Jet:
        """dT/dp."""
        first, second = UNKNOWNS[self.over]
        by = self.flight.time_by
        return 2 * (by[self.over] + by[first] * self.slopes[0] + by[second] * self.slopes[1])

    def trace(self) -> Jet:
        """Of the half map's derivative by gamma_bar and v."""
        return self.curve.trace(self.flight.matrix)

    def stable(self) -> bool | None:
        """Whether all cycles are asymptotically stable (True) or none is (False); None if not decided.

        Of scaled states True is said of all but that at the Hopf point.
        """
        trace, shrinking = self.trace().range(), self.flight.divergence.range().exp()
        below = 1 - trace - shrinking if self.over == OMEGA else (self.slopes[1] * self.determinant).range()
        if positive(below) and positive(1 + trace - shrinking):
            return True
        # delta > 0, so this is enough.
        return False if negative(1 - trace) or negative(1 + trace) else None

    def falling(self) -> bool | None:
        """Whether Omega falls with gamma_bar_0 all along an arc over it (True) or rises (False)."""
        slope = self.slopes[1].range()
        return True if negative(slope) else False if positive(slope) else None

    def slowing(self) -> bool:
        """Whether the period grows with gamma_bar_0 all along an arc over it."""
        return bool(positive(self.period_slope().range()))

    def widening(self) -> bool:
        """Whether beta_max grows with gamma_bar_0 all along an arc over it (not at the Hopf point, where it is 0)."""
        for beta_bar, row in chain.from_iterable(map(turnings, self.flight.turning)):
            slope = row[0] + row[1] * self.slopes[0] + row[2] * self.slopes[1]
            if not negative(self.curve.rise(beta_bar, slope).range()):
                return False
        return bool(self.flight.turning)


def arc_test(constants: Constants, curve: Curve, over: int, choices: Any) -> Arc:
    """Krawczyk's test on a curve of starts and speeds; number ``over`` of the three is the parameter.

    It has no deviation. Raises Unproved if the flight fails.
    """
    flight = fly(constants, curve, choices)
    first, second = UNKNOWNS[over]
    radii = [curve.deviation[k] for k in (first, second)]
    value = [after - before for after, before in zip(flight.image, curve.start, strict=True)]
    jacobian = [[entry - own for entry, own in zip(*rows, strict=True)]
                for rows in zip(flight.matrix, curve.unit, strict=True)]  # fmt: skip
    by_unknowns = [[row[first], row[second]] for row in jacobian]
    chosen = [[entry.mid() for entry in row] for row in inverse([[x.mid() for x in row] for row in by_unknowns])]
    degree = chosen[0][0].degree
    value = [entry.cut(degree) for entry in value]
    within, included = [], True
    for i in range(2):
        image = -(chosen[i][0] * value[0] + chosen[i][1] * value[1]).range()
        for j in range(2):
            rest = int(i == j) - (chosen[i][0] * by_unknowns[0][j] + chosen[i][1] * by_unknowns[1][j])
            image = image + rest.range() * radii[j]
        within.append(image)
        included = included and bool(inside(image, radii[i]))
    (a, b), (c, d) = by_unknowns
    slopes = [-(row[0] * jacobian[0][over] + row[1] * jacobian[1][over]) for row in inverse(by_unknowns)]
    return Arc(included, over, curve, flight, within, slopes, a * d - b * c)


def inverse(matrix: Sequence[Sequence[Any]]) -> list[list[Any]]:
    """Of a matrix (2, 2) of jets or balls."""
    (a, b), (c, d) = matrix
    determinant = a * d - b * c
    return [[d / determinant, -b / determinant], [-c / determinant, a / determinant]]
