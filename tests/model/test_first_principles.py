"""The model's equations against a derivation that does not use the published formulas.

The disk is a rigid body with unit vectors e_x, e_y, e_z fixed in it, where e_z is normal to its
face. The centre of gravity S lies a distance e from the geometric centre G along e_x. The inertia
about G is diag(A, B, C). Three rotations turn the inertial axes into the body's: alpha about the
vertical, beta about the line of nodes n and gamma about e_z. The "grinding" axes are those after
the first two. The reduction to one velocity v = beta' rests on these idealisations:

1.  The lowest point C of the rim stays on the plane (permanent contact).
2.  The disk turns about the vertical at a constant rate, alpha' = Omega, maintained by a vertical
    couple.
3.  S does not move horizontally, held by a horizontal force at S.
4.  C does not slide along the line of nodes, held by a force at C along n. Given 3, this is
    gamma' = -Omega cos(beta). Equivalently, the angular velocity has no component along e_z.

The remaining sliding is the velocity of C, as a point of the disk, along the horizontal
perpendicular to n; friction acts there. The reactions that maintain 1 to 4 have no virtual power.
This is tested, not assumed. All other sliding friction and pivoting friction are left out.

Every comparison is an exact identity between polynomials in the sines and cosines, so there is no
tolerance.
"""

from functools import cache
from types import SimpleNamespace
from typing import NamedTuple

import pytest
import sympy as sp
from sympy import Expr, Matrix, Symbol

from tippedisk_verify.model import equations

ALPHA, BETA, GAMMA, V, ACCELERATION = sp.symbols("alpha beta gamma v vdot", real=True)
ALPHA_RATE, BETA_RATE, GAMMA_RATE = sp.symbols("alphadot betadot gammadot", real=True)
OMEGA = Symbol("Omega", real=True)
R, E, M, A, B, C, G, MU, EPSILON = sp.symbols("r e m A B C g mu epsilon", positive=True)

VERTICAL = Matrix([0, 0, 1])

CONSTANTS = SimpleNamespace(
    r=R,
    e=E,
    m=M,
    A=A,
    B=B,
    g=G,
    mu=MU,
    epsilon=EPSILON,
    Bbar=B - M * E**2,
    a=A / M,
    b=(B - M * E**2) / M,
    k=MU * G / EPSILON,
    traction=MU * G,
)


def canonical(expression: Expr) -> Expr:
    """Return the representative of a trigonometric polynomial without squares of a sine.

    Two such polynomials agree for all angles exactly when their representatives are the same
    expression.
    """
    polynomial = sp.sympify(expression)
    for angle in (ALPHA, BETA, GAMMA):
        sine, cosine = sp.symbols(f"s_{angle} c_{angle}")
        polynomial = polynomial.subs({sp.sin(angle): sine, sp.cos(angle): cosine})
        polynomial = sp.rem(sp.expand(polynomial), sine**2 + cosine**2 - 1, sine)
    return sp.expand(polynomial)


def same(left: Expr, right: Expr) -> bool:
    """Return True if two rational expressions are equal where both are defined.

    They are rational in sines and cosines.
    """
    numerator, _ = sp.fraction(sp.together(left - right))
    return canonical(numerator) == 0


def reduced(vector: Matrix) -> Matrix:
    """Simplify a vector or matrix by sin^2 + cos^2 = 1, and restore the angles."""
    back = {
        Symbol(f"{name[0]}_{angle}"): function(angle)
        for angle in (ALPHA, BETA, GAMMA)
        for name, function in (("sin", sp.sin), ("cos", sp.cos))
    }
    return vector.applyfunc(lambda entry: canonical(entry).subs(back))


def about_vertical(angle: Symbol) -> Matrix:
    """Return the rotation about the third axis."""
    c, s = sp.cos(angle), sp.sin(angle)
    return Matrix([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def about_nodes(angle: Symbol) -> Matrix:
    """Return the rotation about the first axis."""
    c, s = sp.cos(angle), sp.sin(angle)
    return Matrix([[1, 0, 0], [0, c, -s], [0, s, c]])


def rate(quantity: Matrix | Expr, rates: dict[Symbol, Expr]) -> Matrix | Expr:
    """Return the time derivative of a function of the symbols in `rates`, by the chain rule."""
    terms = [quantity.diff(symbol) * speed for symbol, speed in rates.items()]
    return sum(terms[1:], terms[0])


class Kinematics(NamedTuple):
    """Positions and directions in inertial components; positions are relative to G."""

    body: Matrix  # columns: the body's unit vectors
    nodes: Matrix  # unit vector along the line of nodes: horizontal, in the disk's plane
    lateral: Matrix  # the horizontal unit vector across it, along which friction acts
    normal: Matrix  # the disk's normal, e_z
    centre_of_gravity: Matrix  # from G to S
    contact: Matrix  # from G to C
    spin: Matrix  # angular velocity for free rates of the three angles


@cache
def kinematics() -> Kinematics:
    """Return rotations, points and the angular velocity.

    The angular velocity comes from the derivative of the rotation matrix.
    """
    level = about_vertical(ALPHA)
    grinding = level * about_nodes(BETA)
    body = grinding * about_vertical(GAMMA)
    turning = rate(body, {ALPHA: ALPHA_RATE, BETA: BETA_RATE, GAMMA: GAMMA_RATE}) * body.T
    spin = reduced(Matrix([turning[2, 1], turning[0, 2], turning[1, 0]]))
    # At the rim's lowest point the radius lies in the disk, square to the line of nodes, pointing
    # down.
    return Kinematics(
        body, level[:, 0], level[:, 1], grinding[:, 2], E * body[:, 0], -R * grinding[:, 1], spin
    )


class Motion(NamedTuple):
    """Velocities on the constrained motion, as functions of beta, gamma and v."""

    spin: Matrix
    centre_of_gravity: Matrix
    contact: Matrix  # of C as a point of the disk
    rates: dict[Symbol, Expr]


@cache
def motion() -> Motion:
    """Return the one-velocity motion with the horizontal position of S kept fixed.

    gamma' follows from the condition that C does not slide along the line of nodes.
    """
    k = kinematics()
    spin = k.spin.subs({ALPHA_RATE: OMEGA, BETA_RATE: V})
    height = (k.centre_of_gravity - k.contact)[2]
    rising = rate(height, {BETA: V, GAMMA: GAMMA_RATE}) * VERTICAL
    contact = reduced(rising + spin.cross(k.contact - k.centre_of_gravity))
    along_nodes = reduced(Matrix([contact.dot(k.nodes)]))[0]
    (gamma_rate,) = sp.solve(along_nodes, GAMMA_RATE)
    kept = {GAMMA_RATE: gamma_rate}
    spin = reduced(spin.subs(kept))
    rates = {ALPHA: OMEGA, BETA: V, GAMMA: gamma_rate, V: ACCELERATION}
    return Motion(spin, reduced(rising.subs(kept)), reduced(contact.subs(kept)), rates)


@cache
def momentum_rates() -> tuple[Matrix, Matrix]:
    """Return the rates of momentum and of angular momentum about S, in inertial components."""
    k, moving = kinematics(), motion()
    arm = Matrix([E, 0, 0])
    # Parallel axes, from G to S
    about_s = sp.diag(A, B, C) - M * (arm.dot(arm) * sp.eye(3) - arm * arm.T)
    angular = reduced(k.body * about_s * (k.body.T * moving.spin))
    return M * rate(moving.centre_of_gravity, moving.rates), rate(angular, moving.rates)


class Projection(NamedTuple):
    """mass * v' - gyroscopic = gravity + direction * friction, from Jourdain's principle."""

    mass: Expr
    gyroscopic: Expr
    gravity: Expr
    force_direction: Expr
    sliding_velocity: Expr


@cache
def projection() -> Projection:
    """Return the virtual power of inertia, weight and friction for a virtual change of v alone."""
    k, moving = kinematics(), motion()
    momentum_rate, angular_rate = momentum_rates()
    inertia = momentum_rate.dot(moving.centre_of_gravity.diff(V)) + angular_rate.dot(
        moving.spin.diff(V)
    )
    inertia = sp.expand(inertia)
    sliding = moving.contact.dot(k.lateral)
    return Projection(
        inertia.coeff(ACCELERATION, 1),
        -inertia.coeff(ACCELERATION, 0),
        (-M * G * VERTICAL).dot(moving.centre_of_gravity.diff(V)),
        k.lateral.dot(moving.contact.diff(V)),
        sliding,
    )


def test_no_sliding_along_the_nodes_removes_the_spin_about_the_normal() -> None:
    """Check that the fourth idealisation is gamma' = -Omega cos(beta): nothing turns about e_z."""
    assert same(motion().rates[GAMMA], -OMEGA * sp.cos(BETA))
    assert same(motion().spin.dot(kinematics().normal), sp.Integer(0))


def test_reactions_have_no_virtual_power() -> None:
    """Check that normal force, hold along the nodes, hold of S and vertical couple drop out."""
    k, moving = kinematics(), motion()
    virtual_contact, virtual_spin = moving.contact.diff(V), moving.spin.diff(V)
    assert same(virtual_contact.dot(VERTICAL), sp.Integer(0))
    assert same(virtual_contact.dot(k.nodes), sp.Integer(0))
    assert same(moving.centre_of_gravity.diff(V).dot(k.nodes), sp.Integer(0))
    assert same(moving.centre_of_gravity.diff(V).dot(k.lateral), sp.Integer(0))
    assert same(virtual_spin.dot(VERTICAL), sp.Integer(0))


@pytest.mark.parametrize("name", Projection._fields)
def test_terms(name: str) -> None:
    """Compare each coefficient with virtual power; "sin beta^2" turns out to be a square."""
    package = equations.equation_terms(sp, CONSTANTS, OMEGA, BETA, GAMMA, V)
    assert same(getattr(package, name), getattr(projection(), name))


def test_normal_force() -> None:
    """Compare with the vertical momentum balance, in which only weight and normal force act."""
    normal = momentum_rates()[0].dot(VERTICAL) + M * G
    package = equations.normal_force_over_weight(
        sp, CONSTANTS, OMEGA, (BETA, GAMMA, V), ACCELERATION
    )
    assert same(package * M * G, normal)


def test_state_rates() -> None:
    """Check that the first two components are the kinematics under both friction laws."""
    for friction in ("linear", "smooth"):
        beta_rate, gamma_rate, _ = equations.vector_field(sp, CONSTANTS, OMEGA, friction)(
            BETA, GAMMA, V
        )
        assert same(beta_rate, V)
        assert same(gamma_rate, motion().rates[GAMMA])
