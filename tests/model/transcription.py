"""The published equations of motion, transcribed by hand for comparison with the package.

Each function is one numbered equation, in the order of its terms and with its symbols. The LaTeX
label stands in the docstring. Sums are returned as tuples of their terms, so that a caller can add
them up or measure them. Arguments are plain numbers: no code and no type is shared with the
package. The precision is mpmath's current one.

"sin beta^2" in the sliding velocity is read as sin(beta)^2, as the kinematics of the contact point
require.
"""

from typing import TypeAlias

from mpmath import cos, fabs, mpf, sin

Number: TypeAlias = mpf
Sum: TypeAlias = tuple[Number, ...]


def mass_matrix(
    A: Number, Bbar: Number, m: Number, r: Number, e: Number, beta: Number, gamma: Number
) -> Sum:
    """MassMatrix_3DOF."""
    return (
        A * cos(gamma) ** 2,
        Bbar * sin(gamma) ** 2,
        m * (r + e * sin(gamma)) ** 2 * cos(beta) ** 2,
    )


def gyroscopic_forces(
    A: Number,
    Bbar: Number,
    m: Number,
    r: Number,
    e: Number,
    Omega: Number,
    beta: Number,
    gamma: Number,
    betadot: Number,
) -> Sum:
    """GyroVector_3DOF, one entry to a printed line."""
    return (
        (A * cos(gamma) ** 2 + Bbar * sin(gamma) ** 2) * Omega**2 * sin(beta) * cos(beta),
        -2 * (A - Bbar) * Omega * betadot * cos(beta) * sin(gamma) * cos(gamma),
        m * (r + e * sin(gamma)) ** 2 * betadot**2 * sin(beta) * cos(beta),
        m * e * (r + e * sin(gamma)) * Omega**2 * sin(beta) * cos(beta) ** 3 * sin(gamma),
        -m
        * e
        * (r + e * sin(gamma))
        * (3 * sin(beta) ** 2 - 2)
        * Omega
        * betadot
        * cos(beta)
        * cos(gamma),
    )


def gravitational_force(
    m: Number, g: Number, r: Number, e: Number, beta: Number, gamma: Number
) -> Number:
    """force_3DOF."""
    return -m * g * (r + e * sin(gamma)) * cos(beta)


def force_direction(r: Number, e: Number, beta: Number, gamma: Number) -> Number:
    """gendir_3DOF."""
    return (r + e * sin(gamma)) * sin(beta)


def lateral_sliding_velocity(
    r: Number, e: Number, Omega: Number, beta: Number, gamma: Number, betadot: Number
) -> Sum:
    """gamma_y_3DOF."""
    return (
        (r + e * sin(gamma)) * betadot * sin(beta),
        -e * Omega * sin(beta) ** 2 * cos(gamma),
    )


def smooth_friction(mu: Number, m: Number, g: Number, epsilon: Number, gamma_y: Number) -> Number:
    """lambda_y_3DOF."""
    return -mu * m * g * gamma_y / (fabs(gamma_y) + epsilon)


def linear_friction(mu: Number, m: Number, g: Number, epsilon: Number, gamma_y: Number) -> Number:
    """lin_lambda_y_3DOF."""
    return -mu * m * g / epsilon * gamma_y


def state_rates(
    M: Number,
    h: Number,
    f_G: Number,
    w_y: Number,
    lambda_Ty: Number,
    Omega: Number,
    beta: Number,
    betadot: Number,
) -> tuple[Number, Number, Number]:
    """3DOF with kin_3DOF: the rates of beta, gamma and beta's own rate."""
    return 1 * betadot + 0, 0 * betadot - Omega * cos(beta), (h + f_G + w_y * lambda_Ty) / M
