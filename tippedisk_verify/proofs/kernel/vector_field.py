"""The equations of motion on any kind of number (Eqs. 3DOF ... lambda_y_3DOF of the paper), for the
proofs alone.

This transcription is the kernel's own, because the kernel imports nothing outside itself. A test
compares it with `model.equations` at random states.

The angles are shifted, beta_bar = beta - pi/2 and gamma_bar = gamma - pi/2, and all forces are
divided by the mass. Let s = sin(beta_bar) = -cos(beta), C = cos(beta_bar) = sin(beta),
t = sin(gamma_bar) = -cos(gamma), c = cos(gamma_bar) = sin(gamma) and rho = r + e c. The paper's
quantities are

    M       = b + (a - b) t^2 + rho^2 s^2,
    h       = -s [C (rho^2 v^2 + Omega^2 (M - r rho s^2))
                  + Omega v t (2 (a - b) c + e rho (1 - 3 s^2))],
    f_G     = g rho s,       w_y = rho C,       gamma_y = C (rho v + e Omega C t),

because e c = rho - r and 3 C^2 - 2 = 1 - 3 s^2. Derivatives are not written down:
`taylor_recurrences` differentiates the operations that these functions record on its graph.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

from tippedisk_verify.proofs.kernel.balls import ball, require

__all__ = [
    "PARAMETER_UNITS",
    "FieldConstants",
    "VectorFieldMaker",
    "field_constants",
    "one_sided_vector_field",
    "sliding_motion",
    "vector_field",
]

#: Called with (ops, constants, omega), and perhaps further numbers, it returns the vector field: a
#: function of the state that returns its three rates. ``ops`` has sin and cos.
VectorFieldMaker = Callable[..., Callable[[Any, Any, Any], tuple[Any, Any, Any]]]

#: The units of a disk's eight numbers, in the order in which sentences name them
PARAMETER_UNITS = {
    "r": " m",
    "e": " m",
    "m": " kg",
    "A": " kg m^2",
    "B": " kg m^2",
    "g": " m/s^2",
    "mu": "",
    "epsilon": " m/s",
}


class FieldConstants(NamedTuple):
    """The constants of a disk that its equations of motion need, all in one arithmetic."""

    r: Any  #: disk radius [m]
    e: Any  #: eccentricity [m]
    a: Any  #: A / m [m^2]
    b: Any  #: (B - m e^2) / m [m^2]
    g: Any  #: gravity [m/s^2]
    k: Any  #: mu g / epsilon, of the linear law [1/s]
    traction: Any  #: mu g, of the smooth law [m/s^2]
    epsilon: Any  #: smoothing speed of the friction law [m/s]


def field_constants(disk: Mapping[str, str]) -> FieldConstants:
    """Convert the eight exact numbers of a disk to balls of the constants in its equations of
    motion.

    Raises Unproved if no disk has these numbers.
    """
    r, e, m, A, B, g, mu, epsilon = (Fraction(disk[name]) for name in PARAMETER_UNITS)
    require(
        0 < e < r and m * e * e < B <= A and min(m, g, mu, epsilon) > 0,
        "no disk has these parameters",
    )
    return FieldConstants(
        *map(ball, (r, e, A / m, B / m - e * e, g, mu * g / epsilon, mu * g, epsilon))
    )


def vector_field(
    ops: Any, constants: Any, omega: Any, law: Any = "linear"
) -> Callable[[Any, Any, Any], tuple[Any, Any, Any]]:
    """Return the vector field of the motion: a function from states to rates (beta', gamma', v')
    [rad/s, rad/s, rad/s^2].

    Args:
        ops: Provides sin and cos for the numbers of the state.
        constants: The disk's constants in the same arithmetic.
        omega: The speed [rad/s].
        law: 'linear', or 'smooth', which takes an absolute value, or 1 or -1. These two are
            analytic: each is the smooth law where the sliding velocity has that sign.

    Returns:
        A function of the state (beta_bar, gamma_bar, v).
    """
    r, e, a, b, g = constants.r, constants.e, constants.a, constants.b, constants.g
    inertia_difference, twice_inertia_difference, three_e, omega_squared, e_omega = (
        a - b,
        (a - b) + (a - b),
        e + e + e,
        omega * omega,
        e * omega,
    )

    def rates(beta: Any, gamma: Any, v: Any) -> tuple[Any, Any, Any]:
        s, C, t, c = ops.sin(beta), ops.cos(beta), ops.sin(gamma), ops.cos(gamma)
        rho = r + e * c
        rho_s = rho * s
        rho_s_squared = s * rho_s
        mass = b + inertia_difference * (t * t) + rho_s * rho_s
        rho_v = rho * v
        gyroscopic_factor = twice_inertia_difference * c + e * rho - three_e * rho_s_squared
        force = (
            C * (rho_v * rho_v + omega_squared * (mass - r * rho_s_squared))
            + omega * (t * (v * gyroscopic_factor))
            - g * rho
        )
        gamma_y_over_C = rho_v + e_omega * (C * t)  # gamma_y / C
        w_y_gamma_y = (rho - rho_s_squared) * gamma_y_over_C
        if law == "linear":
            friction_term = constants.k * w_y_gamma_y
        else:
            gamma_y = C * gamma_y_over_C
            abs_gamma_y = abs(gamma_y) if law == "smooth" else law * gamma_y
            friction_term = constants.traction * w_y_gamma_y / (abs_gamma_y + constants.epsilon)
        return v, omega * s, -(s * force + friction_term) / mass

    return rates


def one_sided_vector_field(side: int) -> VectorFieldMaker:
    """Return the analytic vector field of one side: the smooth law's where gamma_y has the sign
    ``side``, 1 or -1.
    """
    return lambda ops, constants, omega: vector_field(ops, constants, omega, side)


def sliding_motion(
    ops: Any, constants: Any, omega: Any, state: Sequence[Any], acceleration: Any = None
) -> tuple[Any, Any]:
    """Return the sliding velocity gamma_y [m/s] of a state (beta_bar, gamma_bar, v), and its rate.

    The rate [m/s^2] needs the ``acceleration`` v'. Without it None is returned in its place.
    """
    beta, gamma, v = state
    s, C, t, c = ops.sin(beta), ops.cos(beta), ops.sin(gamma), ops.cos(gamma)
    rho, e_omega = constants.r + constants.e * c, constants.e * omega
    gamma_y_over_C = rho * v + e_omega * (C * t)
    if acceleration is None:
        return C * gamma_y_over_C, None
    # beta' = v and gamma' = Omega s.
    gamma_rate = omega * s
    gamma_y_over_C_rate = (
        rho * acceleration
        - constants.e * t * (gamma_rate * v)
        + e_omega * (C * (c * gamma_rate) - s * (v * t))
    )
    return C * gamma_y_over_C, C * gamma_y_over_C_rate - s * (v * gamma_y_over_C)
