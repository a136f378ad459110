"""A second way to enclose orbits, for tests: Picard's iteration on polynomials in time with a remainder.

It shares no code with the kernel but Arb's sums, products, sines and cosines of numbers: its equations are the paper's
(M, h, f_G, w_y, gamma_y of Eq. 3DOF, in beta and gamma themselves), and its functions of time are a polynomial of fixed
degree plus a ball that holds what is left, on [0, h]. If x_0 plus the integral of f(P + R) lies in P + R, Picard's
operator maps a closed convex set of continuous functions into itself, so the solution is there (Schauder), and it is
the only one, f being smooth. Sets of states are boxes: it is for short flights from points.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from flint import arb, fmpq

__all__ = ["flight"]

DEGREE = 10
Numbers = dict[str, Any]


def number(value: object) -> Any:
    exact = Fraction(str(value))
    return arb(fmpq(exact.numerator, exact.denominator))


class Track:
    """A function on [0, h]: a polynomial with balls for coefficients, plus a ball about zero."""

    def __init__(self, h: Any, terms: Sequence[Any], rest: Any = 0) -> None:
        self.h, self.rest = h, arb(0) + rest
        self.terms = [*terms, *[arb(0)] * (DEGREE + 1 - len(terms))]

    def span(self) -> Any:
        """A ball that holds all its values."""
        time, total = arb(0).union(self.h), arb(0)
        for term in reversed(self.terms):
            total = total * time + term
        return total + self.rest

    def __add__(self, other: Any) -> Track:
        if not isinstance(other, Track):
            return Track(self.h, [self.terms[0] + other, *self.terms[1:]], self.rest)
        return Track(self.h, [a + b for a, b in zip(self.terms, other.terms, strict=True)], self.rest + other.rest)

    def __mul__(self, other: Any) -> Track:
        if not isinstance(other, Track):
            return Track(self.h, [other * a for a in self.terms], other * self.rest)
        time, low, high = arb(0).union(self.h), [arb(0)] * (DEGREE + 1), arb(0)
        for i, a in enumerate(self.terms):
            for j, b in enumerate(other.terms):
                if i + j <= DEGREE:
                    low[i + j] += a * b
                else:
                    high += a * b * time ** (i + j)
        mine, theirs = Track(self.h, self.terms).span(), Track(self.h, other.terms).span()
        return Track(self.h, low, high + mine * other.rest + theirs * self.rest + self.rest * other.rest)

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self) -> Track:
        return self * -1

    def __sub__(self, other: Any) -> Track:
        return self + -other

    def series(self, coefficients: Sequence[Any], rest: Any) -> Track:
        """sum c_k u^k + rest, where u is the track without its constant."""
        u = self - self.terms[0]
        total = Track(self.h, [coefficients[-1]])
        for c in reversed(coefficients[:-1]):
            total = total * u + c
        return total + Track(self.h, [], rest)

    def size(self) -> Any:
        """A point that |u| does not reach beyond."""
        return abs((self - self.terms[0]).span()).upper()

    def turned(self, quarters: int) -> Track:
        """sin(x + quarters pi/2), by Taylor's formula with Lagrange's remainder."""
        start, factor, coefficients = self.terms[0], arb(1), []
        for k in range(DEGREE + 1):
            factor = factor / max(k, 1)
            coefficients.append(factor * (start + (quarters + k) * arb.pi() / 2).sin())
        return self.series(coefficients, arb(0, 1) * (self.size() ** (DEGREE + 1) * factor / (DEGREE + 1)))

    def inverse(self) -> Track:
        """1 / x, by the geometric series."""
        start, ratio = self.terms[0], abs(self.size() / self.terms[0])
        coefficients = [(-1) ** k / start ** (k + 1) for k in range(DEGREE + 1)]
        return self.series(coefficients, arb(0, 1) * (ratio ** (DEGREE + 1) / (start * (1 - ratio))))

    def integral(self, start: Any) -> Track:
        terms = [start, *(a / (k + 1) for k, a in enumerate(self.terms))]
        time = arb(0).union(self.h)
        return Track(self.h, terms[:-1], terms[-1] * time ** (DEGREE + 1) + self.rest * time)


def rates(disk: Numbers, omega: Any, state: Sequence[Track], side: int) -> list[Track]:
    """The paper's equations; ``side`` 0: linear law, 1 or -1: the smooth one where gamma_y has that sign."""
    beta, gamma, v = state
    r, e, m, A, g, mu, epsilon = (disk[name] for name in ("r", "e", "m", "A", "g", "mu", "epsilon"))
    Bbar = disk["B"] - m * e * e
    sb, cb, sg, cg = beta.turned(0), beta.turned(1), gamma.turned(0), gamma.turned(1)
    rho = sg * e + r
    inertia = cg * cg * A + sg * sg * Bbar
    mass = inertia + rho * rho * cb * cb * m
    h = (
        inertia * sb * cb * omega * omega
        - v * cb * sg * cg * (2 * (A - Bbar) * omega)
        + rho * rho * v * v * sb * cb * m
        + rho * sb * cb * cb * cb * sg * (m * e * omega * omega)
        - rho * (sb * sb * 3 - 2) * v * cb * cg * (m * e * omega)
    )
    sliding = rho * v * sb - sb * sb * cg * (e * omega)
    force = sliding * (-mu * m * g)
    force = force * (sliding * side + epsilon).inverse() if side else force * (1 / epsilon)
    return [v, -(cb * omega), (h - rho * cb * (m * g) + rho * sb * force) * mass.inverse()]


def step(disk: Numbers, omega: Any, start: Sequence[Any], h: Any, side: int) -> list[Any]:
    """Balls that hold the orbits at h, proved; an AssertionError if they are not."""
    tracks = [Track(h, [part]) for part in start]
    for _ in range(DEGREE + 1):  # each time one more coefficient is right
        images = zip(rates(disk, omega, tracks, side), start, strict=True)
        tracks = [Track(h, image.integral(x).terms) for image, x in images]
    for inflation in range(1, 12):
        images = [f.integral(x) for f, x in zip(rates(disk, omega, tracks, side), start, strict=True)]
        away = [image - Track(h, track.terms) for image, track in zip(images, tracks, strict=True)]
        if all(track.rest.contains_interior(left.span()) for left, track in zip(away, tracks, strict=True)):
            return [_end(image, h) for image in images]
        tracks = [
            Track(h, track.terms, arb(0, (abs(left.span()) * (1 + inflation)).upper() + arb(2) ** -200))
            for left, track in zip(away, tracks, strict=True)
        ]
    raise AssertionError("Picard's operator does not map the set into itself")


def _end(track: Track, h: Any) -> Any:
    total = arb(0)
    for term in reversed(track.terms):
        total = total * h + term
    return total + track.rest


def flight(disk: dict[str, object], omega: object, start: Sequence[Any], steps: int, h: object, side: int = 0) -> list:
    """Balls that hold (beta_bar, gamma_bar, v) after so many steps of h seconds, from balls of them."""
    quarter, exact = arb.pi() / 2, {name: number(value) for name, value in disk.items()}
    state = [start[0] + quarter, start[1] + quarter, start[2]]
    for _ in range(steps):
        state = step(exact, number(omega), state, number(h), side)
    return [state[0] - quarter, state[1] - quarter, state[2]]
