"""The package's equations against a hand transcription of the published ones, and their point symmetry.

Three kinds of comparison, each of which sees what the others cannot:

*   numbers, in double and at 60 digits, against the transcription, to the rounding that the formulas can accumulate;
*   symbols: the factored acceleration is the quotient (h + f_G + w_y lambda) / M of the package's own terms;
*   rational numbers, in which there is no rounding: the same, and the symmetry, to equality.

The last two replace an angle by its cosine and sine, rational functions of the tangent of half the angle, so that
sin^2 + cos^2 = 1 needs no help.
"""

import math
from fractions import Fraction
from types import SimpleNamespace
from typing import Any, NamedTuple

import mpmath
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mp, mpf

from tests.model import transcription as paper
from tippedisk_verify.model import equations

LAWS = ("linear", "smooth")

DIGITS = 60

# An upper bound on the unit roundoffs that the rounding of any one term of the acceleration amounts to.  Sines and
# cosines count two (one unit in the last place), other operations one, and a, b, k and mu g, which are rounded apart
# from what they are made of, up to four.  r + e sin g then counts 4, there being no cancellation with e <= r/2.
# Multiplied through, no part of the numerator reaches 60, whichever way it is factored; M stays below 22, and three
# times that is its share, see `reference`.
ROUNDINGS = 128
DOUBLE_ROUNDING = mpf(2) ** -53

# The reference is computed with this many bits more, which makes its own error 2^-40 of the bound.
GUARD_BITS = 40


class Parameters(NamedTuple):
    """A disk, its ground and a state, as exact numbers."""

    r: Fraction
    e: Fraction
    m: Fraction
    A: Fraction
    B: Fraction
    g: Fraction
    mu: Fraction
    epsilon: Fraction
    omega: Fraction
    beta: Fraction
    gamma: Fraction
    v: Fraction


def decimals(low: int, high: int, places: int) -> st.SearchStrategy[Fraction]:
    """Decimal fractions between low and high units of the last place."""
    return st.integers(low, high).map(lambda units: Fraction(units, 10**places))


@st.composite
def parameters(draw: st.DrawFn) -> Parameters:
    """Disks from a coin to a wheel, with e <= r/2 and 0 < Bbar <= A, in any orientation, spinning either way."""
    r = draw(decimals(5, 500, 3))
    e = r * draw(decimals(0, 500, 3))
    m = draw(decimals(1, 5000, 3))
    # In units of m r^2, where a uniform disk has 1/4.
    A = m * r**2 * draw(decimals(50, 900, 3))
    B = m * e**2 + A * draw(decimals(50, 1000, 3))
    return Parameters(
        r, e, m, A, B,
        g=draw(decimals(100, 2500, 2)),
        mu=draw(decimals(1, 150, 2)),
        epsilon=draw(decimals(1, 1000, 3)),
        omega=draw(decimals(-10000, 10000, 2)),
        beta=draw(decimals(-4000, 7000, 3)),
        gamma=draw(decimals(-7000, 7000, 3)),
        v=draw(decimals(-20000, 20000, 3)),
    )  # fmt: skip


def constants(p: Parameters, number: Any) -> SimpleNamespace:
    """The constants as the package wants them, every quotient rounded once to the given kind of number.

    Bbar is rounded from its exact value: its cancellation is not what is tested here.
    """
    Bbar = p.B - p.m * p.e**2
    exact = {
        "r": p.r, "e": p.e, "m": p.m, "A": p.A, "B": p.B, "Bbar": Bbar, "g": p.g, "mu": p.mu, "epsilon": p.epsilon,
        "a": p.A / p.m, "b": Bbar / p.m, "k": p.mu * p.g / p.epsilon, "traction": p.mu * p.g,
    }  # fmt: skip
    return SimpleNamespace(**{name: number(value) for name, value in exact.items()})


def multiprecision(value: Fraction) -> mpf:
    """A fraction rounded to mpmath's precision."""
    return mpf(value.numerator) / value.denominator


class Reference(NamedTuple):
    """Values from the transcription, each with the size its rounding is measured by."""

    values: dict[str, mpf]
    sizes: dict[str, mpf]


def reference(c: SimpleNamespace, omega: Any, state: tuple[Any, Any, Any], friction: str) -> Reference:
    """Evaluate the transcription on the very numbers the package got, with guard bits.

    A size is the sum of the absolute values of the terms, of which 3 sin^2 - 2 makes two.  For the acceleration, which
    the package may factor, the sums are those left after any of three rewritings, whose parts cancel:
    sin^2 b = 1 - cos^2 b, e sin g = (r + e sin g) - r, and A cos^2 g + Bbar sin^2 g = Bbar + (A - Bbar) cos^2 g with a
    rounded A - Bbar.  The last gives M parts that add up to at most 3 M while Bbar <= A.
    """
    with mp.workprec(mp.prec + GUARD_BITS):
        A, Bbar, m, r, e, g = (mpf(x) for x in (c.A, c.Bbar, c.m, c.r, c.e, c.g))
        mu, epsilon, Omega = mpf(c.mu), mpf(c.epsilon), mpf(omega)
        beta, gamma, v = (mpf(x) for x in state)
        mass = paper.mass_matrix(A, Bbar, m, r, e, beta, gamma)
        gyroscopic = paper.gyroscopic_forces(A, Bbar, m, r, e, Omega, beta, gamma, v)
        gravity = paper.gravitational_force(m, g, r, e, beta, gamma)
        direction = paper.force_direction(r, e, beta, gamma)
        sliding = paper.lateral_sliding_velocity(r, e, Omega, beta, gamma, v)
        M, h, gamma_y = sum(mass), sum(gyroscopic), sum(sliding)
        law = {"linear": paper.linear_friction, "smooth": paper.smooth_friction}[friction]
        force = law(mu, m, g, epsilon, gamma_y)
        rates = paper.state_rates(M, h, gravity, direction, force, Omega, beta, v)
        beta_rate, gamma_rate, acceleration = rates

        sin_b, cos_b, sin_g, cos_g = mp.sin(beta), mp.cos(beta), mp.sin(gamma), mp.cos(gamma)
        arm = r + e * sin_g
        size_last = m * e * arm * (3 * sin_b**2 + 2) * abs(Omega * v * cos_b * cos_g)
        size_gyroscopic = sum(abs(term) for term in gyroscopic[:4]) + size_last
        size_sliding = sum(abs(term) for term in sliding)
        # An error in gamma_y moves the smooth law by no more than mu m g / (|gamma_y| + epsilon) times the error.
        slope = mu * m * g / (epsilon if friction == "linear" else abs(gamma_y) + epsilon)
        size_force = slope * size_sliding

        size_mass = Bbar + (A + Bbar) * cos_g**2 + m * arm**2 * cos_b**2
        centrifugal = (size_mass + m * r * arm * cos_b**2) * Omega**2 + m * arm**2 * v**2
        mixed = (2 * (A + Bbar) * abs(sin_g) + m * e * arm * (3 + 2)) * abs(Omega * v * cos_g)
        size_drive = abs(cos_b) * (abs(sin_b) * centrifugal + mixed) + abs(gravity)
        size_grip = arm * (arm * abs(v) + e * abs(Omega * sin_b * cos_g))  # direction * sliding, its sin^2 made 1
        size_acceleration = (size_drive + slope * size_grip) / M
        values = {
            "mass": M, "gyroscopic": h, "gravity": gravity, "direction": direction, "sliding_velocity": gamma_y,
            "force": force, "beta_rate": beta_rate, "gamma_rate": gamma_rate, "acceleration": acceleration,
        }  # fmt: skip
        sizes = {name: abs(value) for name, value in values.items()} | {
            "gyroscopic": size_gyroscopic, "sliding_velocity": size_sliding, "force": size_force,
            "acceleration": size_acceleration,
        }  # fmt: skip
    return Reference(values, sizes)


def package_values(
    ops: Any, c: SimpleNamespace, omega: Any, state: tuple[Any, Any, Any], friction: str
) -> dict[str, Any]:
    """Everything the package computes at one state, under the names of `reference`."""
    terms = equations.terms(ops, c, omega, *state)
    beta_rate, gamma_rate, acceleration = equations.field(ops, c, omega, friction)(*state)
    force = equations.friction_force(c, terms.sliding_velocity, friction)
    rates = {"beta_rate": beta_rate, "gamma_rate": gamma_rate, "acceleration": acceleration}
    return terms._asdict() | {"force": force} | rates


def assert_rounded(package: dict[str, Any], exact: Reference, unit_roundoff: mpf) -> None:
    """Every value within the rounding that ROUNDINGS operations can do to terms of its size."""
    with mp.workprec(mp.prec + GUARD_BITS):
        for name, value in exact.values.items():
            error = abs(mpf(package[name]) - value)
            assert error <= ROUNDINGS * unit_roundoff * exact.sizes[name], (name, mp.nstr(error, 3))


@pytest.mark.parametrize("friction", LAWS)
@settings(deadline=None)
@given(p=parameters())
def test_equations_at_sixty_digits(friction: str, p: Parameters) -> None:
    """At 60 digits nothing in the package may be a double: no literal, no function."""
    with mp.workdps(DIGITS):
        c = constants(p, multiprecision)
        omega, *state = (multiprecision(x) for x in (p.omega, p.beta, p.gamma, p.v))
        package = package_values(mpmath.mp, c, omega, tuple(state), friction)
        assert_rounded(package, reference(c, omega, tuple(state), friction), mpf(2) ** -mp.prec)


@pytest.mark.parametrize("friction", LAWS)
@settings(deadline=None)
@given(p=parameters())
def test_equations_in_double(friction: str, p: Parameters) -> None:
    """The same formulas on floats lose no more than their terms' rounding."""
    c = constants(p, float)
    omega, state = float(p.omega), (float(p.beta), float(p.gamma), float(p.v))
    package = package_values(math, c, omega, state, friction)
    assert_rounded(package, reference(c, omega, state, friction), DOUBLE_ROUNDING)


# --- exact arithmetic -------------------------------------------------------------------------------------------------


class Angle(NamedTuple):
    """An angle known by its cosine and sine, which are numbers of any exact kind."""

    cosine: Any
    sine: Any

    @classmethod
    def from_half_tangent(cls, t: Any) -> "Angle":
        """All angles but pi; for rational t the cosine and sine are rational."""
        return cls((1 - t**2) / (1 + t**2), 2 * t / (1 + t**2))

    def supplement(self) -> "Angle":
        """Pi minus the angle."""
        return Angle(-self.cosine, self.sine)


class CircleOps:
    """The package's `ops` for such angles."""

    @staticmethod
    def cos(angle: Angle) -> Any:
        """The stored cosine."""
        return angle.cosine

    @staticmethod
    def sin(angle: Angle) -> Any:
        """The stored sine."""
        return angle.sine


HALF_TANGENTS = decimals(-5000, 5000, 3)


def quotient(c: SimpleNamespace, terms: Any, force: Any) -> Any:
    """The acceleration as the equation of motion defines it."""
    return (terms.gyroscopic + terms.gravity + terms.direction * force) / terms.mass


@pytest.mark.parametrize("friction", LAWS)
@settings(deadline=None)
@given(p=parameters(), half_beta=HALF_TANGENTS, half_gamma=HALF_TANGENTS)
def test_acceleration_is_the_quotient_in_rationals(
    friction: str, p: Parameters, half_beta: Fraction, half_gamma: Fraction
) -> None:
    """Factoring changed no value: equality of fractions, on both sides of gamma_y = 0 and on it."""
    c = constants(p, Fraction)
    state = (Angle.from_half_tangent(half_beta), Angle.from_half_tangent(half_gamma), p.v)
    terms = equations.terms(CircleOps, c, p.omega, *state)
    force = equations.friction_force(c, terms.sliding_velocity, friction)
    assert equations.field(CircleOps, c, p.omega, friction)(*state)[2] == quotient(c, terms, force)


@pytest.mark.parametrize("friction", LAWS)
@settings(deadline=None)
@given(p=parameters(), half_beta=HALF_TANGENTS, half_gamma=HALF_TANGENTS)
def test_point_symmetry(friction: str, p: Parameters, half_beta: Fraction, half_gamma: Fraction) -> None:
    """(beta, gamma, v) -> (pi - beta, pi - gamma, -v) maps solutions to solutions: it reverses all three rates."""
    c = constants(p, Fraction)
    beta, gamma = Angle.from_half_tangent(half_beta), Angle.from_half_tangent(half_gamma)
    rates = equations.field(CircleOps, c, p.omega, friction)(beta, gamma, p.v)
    image = (beta.supplement(), gamma.supplement(), -p.v)
    assert equations.field(CircleOps, c, p.omega, friction)(*image) == tuple(-rate for rate in rates)


@pytest.mark.parametrize(("friction", "branch"), [("linear", 1), ("smooth", 1), ("smooth", -1)])
def test_acceleration_is_the_quotient_in_symbols(friction: str, branch: int) -> None:
    """The identity behind the rational test, for all states and constants, on each side of gamma_y = 0.

    On one side |x| is gamma_y, on the other -gamma_y, given that what is inside squares to gamma_y^2.
    """
    r, e, m, A, Bbar, g, mu, epsilon = sp.symbols("r e m A Bbar g mu epsilon", positive=True)
    c = SimpleNamespace(
        r=r, e=e, m=m, A=A, B=Bbar + m * e**2, Bbar=Bbar, g=g, mu=mu, epsilon=epsilon,
        a=A / m, b=Bbar / m, k=mu * g / epsilon, traction=mu * g,
    )  # fmt: skip
    omega, v, cb, sb, cg, sg = sp.symbols("Omega v cb sb cg sg", real=True)
    state = (Angle(cb, sb), Angle(cg, sg), v)
    terms = equations.terms(CircleOps, c, omega, *state)
    force = equations.friction_force(c, terms.sliding_velocity, friction)
    factored = equations.field(CircleOps, c, omega, friction)(*state)[2]
    magnitude = branch * terms.sliding_velocity
    for value in factored.atoms(sp.Abs) | force.atoms(sp.Abs):
        assert sp.expand(value.args[0] ** 2 - magnitude**2) == 0
    factored, force = (x.replace(sp.Abs, lambda inside: magnitude) for x in (factored, force))
    numerator, _ = sp.fraction(sp.together(factored - quotient(c, terms, force)))
    remainder = sp.rem(sp.expand(numerator), sb**2 + cb**2 - 1, sb)
    assert sp.expand(sp.rem(sp.expand(remainder), sg**2 + cg**2 - 1, sg)) == 0
