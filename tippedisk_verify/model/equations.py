"""The tippedisk's equations of motion, once, for every kind of number.

State ``(beta, gamma, v)`` with ``v = d(beta)/dt``; angles in rad, ``v`` and the spinning speed ``Omega`` in rad/s. The
functions take ``ops``, a namespace with ``sin`` and ``cos`` for the kind of number at hand (``math``, ``numpy``, an
mpmath context, ``heyoka``, ``sympy``), and work on whatever it works on: floats, arrays, high-precision numbers,
expressions.

`terms` holds the paper's own quantities. `field` is what gets integrated: the same acceleration with its common factors
taken out (51 instead of 75 operations in a Taylor recurrence) and with products instead of powers, because a general
power divides by its base and cos(beta) vanishes at every equilibrium and section. A test proves the two equal.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple, Protocol

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.exact import entries, exact, shown
from tippedisk_verify.model.parameters import Constants, Friction

__all__ = [
    "Ops",
    "Terms",
    "checked_speed",
    "checked_speeds",
    "field",
    "friction_force",
    "jacobian",
    "normal_force_over_weight",
    "shifted",
    "terms",
]

Field = Callable[[Any, Any, Any], tuple[Any, Any, Any]]


class Ops(Protocol):
    """A namespace with the functions of the kind of number at hand."""

    def sin(self, angle: Any, /) -> Any: ...

    def cos(self, angle: Any, /) -> Any: ...


_SLOWEST, _FASTEST = Fraction(1, 10**300), 10**6  # rad/s


class _ShiftedOps:
    def __init__(self, ops: Ops) -> None:
        self.sin = ops.cos
        self.cos = lambda angle: -ops.sin(angle)


def shifted(ops: Ops) -> Ops:
    """``ops`` for angles measured from pi/2, the paper's beta_bar and gamma_bar (Eq. shifted coordinates).

    With it every function here takes shifted angles. Near inverted spinning they are small numbers, which keep the
    relative accuracy that beta and gamma, of size pi/2, lose.
    """
    return _ShiftedOps(ops)


def checked_speed(omega: object) -> Fraction:
    """Omega [rad/s] as the rational that ``omega`` (anything that `exact` takes) stands for.

    Raises InputError unless it is a decimal between 1e-300 and 1e6: slower or faster, doubles and the disk give out.
    """
    if isinstance(omega, list | tuple):
        raise InputError("one speed is needed, not several: `Disk.branch` takes a list of them")
    speed = exact(omega)
    if speed.pi_multiple or not _SLOWEST <= speed.rational < _FASTEST:
        raise InputError(f"Omega must be a positive decimal below 1e6 rad/s, not {shown(omega)}")
    return speed.rational


def checked_speeds(omegas: object) -> list[Fraction]:
    """The speeds [rad/s] of a list, each as `checked_speed` has it; a text or a number by itself is one speed."""
    return [checked_speed(omega) for omega in entries(omegas)]


class Terms(NamedTuple):
    """The paper's quantities at one state, in SI units: M v' - h = f_G + w_y lambda_Ty (Eq. 3DOF)."""

    mass: Any  #: M [kg m^2], Eq. MassMatrix_3DOF
    gyroscopic: Any  #: h [N m], Eq. GyroVector_3DOF
    gravity: Any  #: f_G [N m], Eq. force_3DOF
    direction: Any  #: w_y [m], Eq. gendir_3DOF
    sliding_velocity: Any  #: gamma_y [m/s], Eq. gamma_y_3DOF with its sin(beta)^2 read as (sin beta)^2


def terms(ops: Ops, constants: Constants, omega: Any, beta: Any, gamma: Any, v: Any) -> Terms:
    """M, h, f_G, w_y and gamma_y as the paper writes them."""
    r, e, m, g = constants.r, constants.e, constants.m, constants.g
    A, Bbar = constants.A, constants.Bbar
    sin_b, cos_b, sin_g, cos_g = ops.sin(beta), ops.cos(beta), ops.sin(gamma), ops.cos(gamma)
    rho = r + e * sin_g
    inertia = A * (cos_g * cos_g) + Bbar * (sin_g * sin_g)
    gyroscopic = (
        inertia * (omega * omega) * sin_b * cos_b
        - 2 * (A - Bbar) * omega * v * cos_b * sin_g * cos_g
        + m * (rho * rho) * (v * v) * sin_b * cos_b
        + m * e * rho * (omega * omega) * sin_b * (cos_b * (cos_b * cos_b)) * sin_g
        - m * e * rho * (3 * (sin_b * sin_b) - 2) * omega * v * cos_b * cos_g
    )
    return Terms(
        mass=inertia + m * (rho * rho) * (cos_b * cos_b),
        gyroscopic=gyroscopic,
        gravity=-m * g * rho * cos_b,
        direction=rho * sin_b,
        sliding_velocity=rho * v * sin_b - e * omega * (sin_b * sin_b) * cos_g,
    )


def friction_force(constants: Constants, sliding_velocity: Any, friction: Friction) -> Any:
    """lambda_Ty [N]: Eq. lin_lambda_y_3DOF (linear) or Eq. lambda_y_3DOF (smooth Coulomb)."""
    weight = constants.mu * constants.m * constants.g
    if friction == "linear":
        return -(weight / constants.epsilon) * sliding_velocity
    return -weight * sliding_velocity / (abs(sliding_velocity) + constants.epsilon)


def field(ops: Ops, constants: Constants, omega: Any, friction: Friction, side: Any = None) -> Field:
    """The vector field ``(beta, gamma, v) -> (beta', gamma', v')`` [rad/s, rad/s, rad/s^2] (Eq. 3DOF).

    What does not depend on the state is computed here, once; the function returned has only the rest to do.
    Only ``r, e, a, b, g`` and ``k`` (linear) or ``traction, epsilon`` (smooth) of ``constants`` are used. ``side`` (1
    or -1) takes the smooth law's analytic branch for gamma_y of that sign, wherever the state is.
    """
    sin, cos = ops.sin, ops.cos
    r, e, b, g = constants.r, constants.e, constants.b, constants.g
    # Sums, because an integer factor would widen numbers of fewer bits than it has.
    asymmetry, three_e, omega_squared, e_omega = constants.a - b, e + e + e, omega * omega, e * omega
    twice_asymmetry = asymmetry + asymmetry
    linear = friction == "linear"
    k, traction, epsilon = constants.k, constants.traction, constants.epsilon

    def vector_field(beta: Any, gamma: Any, v: Any) -> tuple[Any, Any, Any]:
        sin_b, cos_b, sin_g, cos_g = sin(beta), cos(beta), sin(gamma), cos(gamma)
        rho = r + e * sin_g
        lever = rho * cos_b
        rho_cos2 = cos_b * lever
        mass = b + asymmetry * (cos_g * cos_g) + lever * lever  # M / m
        sweep = rho * v
        # h + f_G = m cos(beta) * (...): Omega^2 [K + e rho cos^2(beta) sin(gamma)] = Omega^2 [M - r rho cos^2(beta)]
        # because e sin(gamma) = rho - r; the mixed term uses 3 sin^2(beta) - 2 = 1 - 3 cos^2(beta) likewise.
        mixed = twice_asymmetry * sin_g + e * rho - three_e * rho_cos2
        drive = (
            sin_b * (sweep * sweep + omega_squared * (mass - r * rho_cos2)) - omega * (cos_g * (v * mixed)) - g * rho
        )
        # w_y gamma_y = rho sin^2(beta) * slip, and rho sin^2(beta) = rho - rho cos^2(beta).
        slip = sweep - e_omega * (sin_b * cos_g)  # gamma_y / sin(beta)
        grip = (rho - rho_cos2) * slip
        if linear:
            resistance = k * grip
        else:
            sliding = sin_b * slip
            resistance = traction * grip / ((abs(sliding) if side is None else side * sliding) + epsilon)
        return v, -(omega * cos_b), (cos_b * drive - resistance) / mass

    return vector_field


def jacobian(
    ops: Ops, constants: Constants, omega: Any, friction: Friction, side: Any = None
) -> Callable[[Any, Any, Any], tuple[tuple[Any, Any, Any], ...]]:
    """The function ``(beta, gamma, v) -> d(beta', gamma', v')/d(beta, gamma, v)``, differentiated by hand.

    Where gamma_y = 0 the smooth law is continuously differentiable, with the linear law's derivative. ``side``
    as in `field`. It is one piece, so that each line can be held against the line of `field` that it differentiates.
    """
    sin, cos = ops.sin, ops.cos
    r, e, b, g = constants.r, constants.e, constants.b, constants.g
    asymmetry, three_e, omega_squared, e_omega = constants.a - b, e + e + e, omega * omega, e * omega
    twice_asymmetry = asymmetry + asymmetry
    linear = friction == "linear"
    k, traction, epsilon = constants.k, constants.traction, constants.epsilon

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
        slip_b, slip_g, slip_v = -e_omega * cos_b * cos_g, rho_g * v + e_omega * sin_b * sin_g, rho
        width = rho - rho_cos2
        width_b, width_g = 2 * lever * sin_b, rho_g - rho_g * cos_b * cos_b
        grip = width * slip
        grip_b, grip_g, grip_v = width_b * slip + width * slip_b, width_g * slip + width * slip_g, width * slip_v
        if linear:
            resistance, resist_b, resist_g, resist_v = k * grip, k * grip_b, k * grip_g, k * grip_v
        else:
            sliding = sin_b * slip
            size = abs(sliding) if side is None else side * sliding
            yielding = size + epsilon
            resistance = traction * grip / yielding
            # d|gamma_y| = sign(gamma_y) d(gamma_y), and grip = rho sin(beta) gamma_y, so grip * sign(gamma_y) needs no
            # sign function: this holds for every kind of number, and at gamma_y = 0.
            drag = traction * rho * sin_b * size / (yielding * yielding)
            factor = traction / yielding
            resist_b = factor * grip_b - drag * (cos_b * slip + sin_b * slip_b)
            resist_g = factor * grip_g - drag * (sin_b * slip_g)
            resist_v = factor * grip_v - drag * (sin_b * slip_v)
        total = (cos_b * drive - resistance) / mass
        return (
            (0 * v, 0 * v, 1 + 0 * v),
            (omega * sin_b, 0 * v, 0 * v),
            (
                (cos_b * drive_b - sin_b * drive - resist_b - total * mass_b) / mass,
                (cos_b * drive_g - resist_g - total * mass_g) / mass,
                (cos_b * drive_v - resist_v) / mass,
            ),
        )

    return derivative


def normal_force_over_weight(
    ops: Ops, constants: Constants, omega: Any, state: Sequence[Any], acceleration: Any
) -> Any:
    """lambda_N / (m g) = 1 + (d^2 z_S / dt^2) / g [1], where z_S = (r + e sin(gamma)) sin(beta) along the motion.

    z_S is the height of the centre of gravity, ``acceleration`` is dv/dt at the state. A negative value means that the
    contact would open.
    """
    beta, gamma, v = state
    sin_b, cos_b, sin_g, cos_g = ops.sin(beta), ops.cos(beta), ops.sin(gamma), ops.cos(gamma)
    rho, rho_g = constants.r + constants.e * sin_g, constants.e * cos_g
    gamma_rate = -(omega * cos_b)
    gamma_acceleration = omega * sin_b * v
    rho_rate = rho_g * gamma_rate
    rho_acceleration = rho_g * gamma_acceleration - constants.e * sin_g * gamma_rate * gamma_rate
    height_acceleration = (
        rho_acceleration * sin_b + 2 * rho_rate * cos_b * v + rho * (cos_b * acceleration - sin_b * v * v)
    )
    return 1 + height_acceleration / constants.g
