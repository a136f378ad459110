"""The tippedisk's equations of motion, written once for every kind of number.

The state is ``(beta, gamma, v)`` with ``v = d(beta)/dt``. Angles are in rad, ``v`` and the spinning
speed ``Omega`` in rad/s. The functions take ``ops``, a namespace with ``sin`` and ``cos`` for one
kind of number (``math``, ``numpy``, an mpmath context, ``heyoka``, ``sympy``). They work on the
same kind: floats, arrays, high-precision numbers, expressions.

`equation_terms` holds the paper's own quantities. `vector_field` is the function that is
integrated. It is the same acceleration in another form:

- Common factors are taken out, which leaves 51 instead of 75 operations in a Taylor recurrence.
- Products replace powers, because a general power divides by its base and cos(beta) vanishes at
  every equilibrium and section.

A test proves the two forms equal.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple, Protocol

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.friction import FrictionLaw, law_of
from tippedisk_verify.model.parameters import Constants
from tippedisk_verify.numbers.exact import as_list, exact, short_text

__all__ = [
    "STATE_NAMES",
    "EquationTerms",
    "Ops",
    "checked_speed",
    "checked_speeds",
    "equation_terms",
    "jacobian",
    "normal_force_over_weight",
    "require_one_speed",
    "shifted_ops",
    "vector_field",
]

#: The names of the state's components, in order
STATE_NAMES = ("beta", "gamma", "v")


class Ops(Protocol):
    """A namespace with the functions of one kind of number, such as sin and cos of floats or of
    mpmath numbers.
    """

    def sin(self, angle: Any, /) -> Any: ...

    def cos(self, angle: Any, /) -> Any: ...


_SLOWEST, _FASTEST = Fraction(1, 10**300), 10**6  # rad/s


class _ShiftedOps:
    def __init__(self, ops: Ops) -> None:
        self.plain = ops
        self.sin = ops.cos
        self.cos = lambda angle: -ops.sin(angle)


def shifted_ops(ops: Ops) -> Ops:
    """Return ``ops`` for angles measured from pi/2, the paper's beta_bar and gamma_bar.

    Eq. shifted coordinates defines them. With the result, every function of this module takes
    shifted angles. Near inverted spinning these are small numbers, and so keep the relative
    accuracy that beta and gamma, of size pi/2, lose.

    Args:
        ops: The functions of the kind of number.
    """
    return _ShiftedOps(ops)


def checked_speed(omega: object) -> Fraction:
    """Check a spinning speed that a user has given, and return it [rad/s] as an exact rational.

    Args:
        omega: A number or text that `exact` accepts.

    Raises:
        InputError: If ``omega`` is not one decimal between 1e-300 and 1e6. Beyond these limits
            doubles or the model fail.
    """
    if isinstance(omega, list | tuple):
        raise InputError("one speed is needed, not several: `Disk.branch` takes a list of them")
    speed = exact(omega)
    if speed.pi_multiple or not _SLOWEST <= speed.rational < _FASTEST:
        raise InputError(
            f"Omega must be a positive decimal below 1e6 rad/s, not {short_text(omega)}"
        )
    return speed.rational


def require_one_speed(**ways: object) -> None:
    """Raise InputError unless exactly one of several ways to give a speed is used.

    Args:
        ways: The values of the ways, by the names that the message uses. None and False mean
            unused.

    Raises:
        InputError: If none of them is used, or several are.
    """
    if (number := sum(way is not None and way is not False for way in ways.values())) != 1:
        *first, last = ways
        several = ", not with several" if number else ""
        raise InputError(f"give the speed with one of {', '.join(first)} and {last}{several}")


def checked_speeds(omegas: object) -> list[Fraction]:
    """Return the speeds [rad/s] of a list as exact rationals; a single text or number is one speed.

    Args:
        omegas: A list or an array of speeds, or one speed.

    Raises:
        InputError: If an entry is not a speed, as in `checked_speed`.
    """
    return [checked_speed(omega) for omega in as_list(omegas)]


class EquationTerms(NamedTuple):
    """The terms of the paper's equation of motion at one state, in SI units.

    They satisfy M v' - h = f_G + w_y lambda_Ty (Eq. 3DOF).
    """

    mass: Any  #: M [kg m^2], Eq. MassMatrix_3DOF
    gyroscopic: Any  #: h [N m], Eq. GyroVector_3DOF
    gravity: Any  #: f_G [N m], Eq. force_3DOF
    force_direction: Any  #: w_y [m], Eq. gendir_3DOF
    #: gamma_y [m/s], Eq. gamma_y_3DOF with its sin(beta)^2 read as (sin beta)^2
    sliding_velocity: Any
    gyroscopic_terms: tuple[Any, ...]  #: h_1 ... h_5 [N m], the terms of h in the paper's order


def equation_terms(
    ops: Ops, constants: Constants, omega: Any, beta: Any, gamma: Any, v: Any
) -> EquationTerms:
    """Return the terms of the equation of motion at a state as the paper writes them: M, h and its
    terms, f_G, w_y and gamma_y.

    Args:
        ops: The functions of the kind of number.
        constants: The parameters in the same kind.
        omega: The spinning speed [rad/s].
        beta, gamma: The angles [rad].
        v: d(beta)/dt [rad/s].
    """
    r, e, m, g = constants.r, constants.e, constants.m, constants.g
    A, Bbar = constants.A, constants.Bbar
    sin_b, cos_b, sin_g, cos_g = ops.sin(beta), ops.cos(beta), ops.sin(gamma), ops.cos(gamma)
    rho = r + e * sin_g
    inertia = A * (cos_g * cos_g) + Bbar * (sin_g * sin_g)
    h_1 = inertia * (omega * omega) * sin_b * cos_b
    h_2 = -2 * (A - Bbar) * omega * v * cos_b * sin_g * cos_g
    h_3 = m * (rho * rho) * (v * v) * sin_b * cos_b
    h_4 = m * e * rho * (omega * omega) * sin_b * (cos_b * (cos_b * cos_b)) * sin_g
    h_5 = -m * e * rho * (3 * (sin_b * sin_b) - 2) * omega * v * cos_b * cos_g
    return EquationTerms(
        mass=inertia + m * (rho * rho) * (cos_b * cos_b),
        gyroscopic=h_1 + h_2 + h_3 + h_4 + h_5,
        gravity=-m * g * rho * cos_b,
        force_direction=rho * sin_b,
        sliding_velocity=rho * v * sin_b - e * omega * (sin_b * sin_b) * cos_g,
        gyroscopic_terms=(h_1, h_2, h_3, h_4, h_5),
    )


def vector_field(
    ops: Ops, constants: Constants, omega: Any, friction: str | FrictionLaw, side: Any = None
) -> Callable[[Any, Any, Any], tuple[Any, Any, Any]]:
    """Return the vector field of the motion, a function ``(beta, gamma, v) -> (beta', gamma', v')``
    (Eq. 3DOF).

    Its values are in rad/s, rad/s and rad/s^2. Terms that do not depend on the state are computed
    once, here.

    Args:
        ops: The functions of the kind of number.
        constants: The parameters in the same kind. Only ``r, e, a, b, g`` and the law's own
            ``constants`` are used.
        omega: The spinning speed [rad/s].
        friction: The friction law, or its name.
        side: 1 or -1 selects the analytic side of a law that has two, for gamma_y of that sign at
            every state.
    """
    sin, cos = ops.sin, ops.cos
    r, e, b, g = constants.r, constants.e, constants.b, constants.g
    # Sums, because an integer factor would widen numbers of fewer bits than it has.
    asymmetry, three_e, omega_squared, e_omega = (
        constants.a - b,
        e + e + e,
        omega * omega,
        e * omega,
    )
    twice_asymmetry = asymmetry + asymmetry
    law, plain = law_of(friction), getattr(ops, "plain", ops)

    def evaluate(beta: Any, gamma: Any, v: Any) -> tuple[Any, Any, Any]:
        sin_b, cos_b, sin_g, cos_g = sin(beta), cos(beta), sin(gamma), cos(gamma)
        rho = r + e * sin_g
        lever = rho * cos_b
        rho_cos2 = cos_b * lever
        mass = b + asymmetry * (cos_g * cos_g) + lever * lever  # M / m
        sweep = rho * v
        # h + f_G = m cos(beta) * (...): Omega^2 [K + e rho cos^2(beta) sin(gamma)] = Omega^2 [M - r
        # rho cos^2(beta)] because e sin(gamma) = rho - r; the mixed term uses 3 sin^2(beta) - 2 = 1
        # - 3 cos^2(beta) likewise.
        mixed = twice_asymmetry * sin_g + e * rho - three_e * rho_cos2
        drive = (
            sin_b * (sweep * sweep + omega_squared * (mass - r * rho_cos2))
            - omega * (cos_g * (v * mixed))
            - g * rho
        )
        # w_y gamma_y = rho sin^2(beta) * slip, and rho sin^2(beta) = rho - rho cos^2(beta).
        slip = sweep - e_omega * (sin_b * cos_g)  # gamma_y / sin(beta)
        w_y_gamma_y = (rho - rho_cos2) * slip
        friction_term = law.friction_term(plain, constants, side, w_y_gamma_y, sin_b, slip, rho)
        return v, -(omega * cos_b), (cos_b * drive - friction_term) / mass

    return evaluate


def jacobian(
    ops: Ops, constants: Constants, omega: Any, friction: str | FrictionLaw, side: Any = None
) -> Callable[[Any, Any, Any], tuple[tuple[Any, Any, Any], ...]]:
    """Return the Jacobian of the motion's vector field, a function ``(beta, gamma, v) -> d(beta',
    gamma', v')/d(beta, gamma, v)``.

    The rows of its value are tuples. It is differentiated by hand, and kept in one piece so that
    each line can be compared with the line of `vector_field` that it differentiates. At gamma_y = 0
    a law with two sides is continuously differentiable.

    Args:
        ops, constants, omega, friction, side: As for `vector_field`.
    """
    sin, cos = ops.sin, ops.cos
    r, e, b, g = constants.r, constants.e, constants.b, constants.g
    asymmetry, three_e, omega_squared, e_omega = (
        constants.a - b,
        e + e + e,
        omega * omega,
        e * omega,
    )
    twice_asymmetry = asymmetry + asymmetry
    law, plain = law_of(friction), getattr(ops, "plain", ops)

    def derivative(beta: Any, gamma: Any, v: Any) -> tuple[tuple[Any, Any, Any], ...]:
        sin_b, cos_b, sin_g, cos_g = sin(beta), cos(beta), sin(gamma), cos(gamma)
        rho, rho_g = r + e * sin_g, e * cos_g
        lever = rho * cos_b
        rho_cos2 = cos_b * lever
        mass = b + asymmetry * (cos_g * cos_g) + lever * lever
        mass_b = -2 * lever * rho * sin_b
        mass_g = 2 * lever * rho_g * cos_b - twice_asymmetry * (cos_g * sin_g)
        sweep = rho * v
        mixed = twice_asymmetry * sin_g + e * rho - three_e * rho_cos2
        mixed_b = 2 * three_e * (lever * sin_b)
        mixed_g = twice_asymmetry * cos_g + e * rho_g - three_e * (rho_g * cos_b * cos_b)
        bracket = sweep * sweep + omega_squared * (mass - r * rho_cos2)
        bracket_b = omega_squared * (mass_b + 2 * r * lever * sin_b)
        bracket_g = 2 * sweep * rho_g * v + omega_squared * (mass_g - r * rho_g * cos_b * cos_b)
        drive = sin_b * bracket - omega * (cos_g * (v * mixed)) - g * rho
        drive_b = cos_b * bracket + sin_b * bracket_b - omega * cos_g * v * mixed_b
        drive_g = sin_b * bracket_g - omega * v * (cos_g * mixed_g - sin_g * mixed) - g * rho_g
        drive_v = 2 * sin_b * sweep * rho - omega * cos_g * mixed

        slip = sweep - e_omega * (sin_b * cos_g)
        slip_b, slip_g = -e_omega * cos_b * cos_g, rho_g * v + e_omega * sin_b * sin_g
        w_y, w_y_b, w_y_g = rho * sin_b, rho * cos_b, rho_g * sin_b
        gamma_y = sin_b * slip
        gamma_y_b, gamma_y_g, gamma_y_v = cos_b * slip + sin_b * slip_b, sin_b * slip_g, sin_b * rho
        deceleration = law.deceleration(plain, gamma_y, constants, side)
        friction_slope = w_y * law.deceleration_slope(plain, gamma_y, constants, side)
        friction_term = w_y * deceleration
        friction_b = w_y_b * deceleration + friction_slope * gamma_y_b
        friction_g = w_y_g * deceleration + friction_slope * gamma_y_g
        friction_v = friction_slope * gamma_y_v
        acceleration = (cos_b * drive - friction_term) / mass
        return (
            (0 * v, 0 * v, 1 + 0 * v),
            (omega * sin_b, 0 * v, 0 * v),
            (
                (cos_b * drive_b - sin_b * drive - friction_b - acceleration * mass_b) / mass,
                (cos_b * drive_g - friction_g - acceleration * mass_g) / mass,
                (cos_b * drive_v - friction_v) / mass,
            ),
        )

    return derivative


def normal_force_over_weight(
    ops: Ops, constants: Constants, omega: Any, state: Sequence[Any], acceleration: Any
) -> Any:
    """Return the normal force over the weight, lambda_N / (m g) [1].

    It is 1 + (d^2 z_S / dt^2) / g along the motion, where z_S = (r + e sin(gamma)) sin(beta) is the
    height of the centre of gravity. A negative value means that the contact would open.

    Args:
        ops: The functions of the kind of number.
        constants: The parameters in the same kind.
        omega: The spinning speed [rad/s].
        state: (beta [rad], gamma [rad], v [rad/s]).
        acceleration: dv/dt at the state [rad/s^2].
    """
    beta, gamma, v = state
    sin_b, cos_b, sin_g, cos_g = ops.sin(beta), ops.cos(beta), ops.sin(gamma), ops.cos(gamma)
    rho, rho_g = constants.r + constants.e * sin_g, constants.e * cos_g
    gamma_rate = -(omega * cos_b)
    gamma_acceleration = omega * sin_b * v
    rho_rate = rho_g * gamma_rate
    rho_acceleration = rho_g * gamma_acceleration - constants.e * sin_g * gamma_rate * gamma_rate
    height_acceleration = (
        rho_acceleration * sin_b
        + 2 * rho_rate * cos_b * v
        + rho * (cos_b * acceleration - sin_b * v * v)
    )
    return 1 + height_acceleration / constants.g
