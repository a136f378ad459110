"""The equations of motion about inverted spinning, to third order in (beta_bar, gamma_bar, v).

`derived_expansion` follows from the full equations, and `printed_expansion` is the paper's version.
Claims state where they differ. There are no terms of even order, by the point symmetry. Arguments
may be numbers of any kind or symbols.
"""

from __future__ import annotations

from typing import Any, NamedTuple

__all__ = ["LocalExpansion", "derived_expansion", "printed_expansion"]

#: The coefficients of beta_bar^i gamma_bar^j v^k, with keys (i, j, k).
Coefficients = dict[tuple[int, int, int], Any]


class LocalExpansion(NamedTuple):
    """The expansion of the equation of motion M v' - h = f_G + w_y lambda_Ty about inverted
    spinning, in its four parts (Eq. eqm_quartic).

    The friction law is linear.
    """

    mass: Coefficients  #: M-tilde [kg m^2]
    gyroscopic: Coefficients  #: h-tilde [N m]
    gravity: Coefficients  #: f_G [N m]
    friction: Coefficients  #: w_y lambda_Ty [N m]


def derived_expansion(constants: Any, omega: Any) -> LocalExpansion:
    """Return the local expansion of the equation of motion about inverted spinning that follows
    from Eqs. MassMatrix_3DOF to lin_lambda_y_3DOF.

    Args:
        constants: The parameters, in any kind of number.
        omega: The spinning speed [rad/s].
    """
    r, e, m, g, A, Bbar = (
        constants.r,
        constants.e,
        constants.m,
        constants.g,
        constants.A,
        constants.Bbar,
    )
    height = r + e
    strength = -constants.mu * m * g / constants.epsilon
    return LocalExpansion(
        mass={(0, 0, 0): Bbar, (0, 2, 0): A - Bbar, (2, 0, 0): m * height**2},
        gyroscopic={
            (1, 0, 0): -Bbar * omega**2,
            (1, 2, 0): (Bbar - A) * omega**2,
            (3, 0, 0): (Bbar * 2 / 3 - m * e * height) * omega**2,
            (1, 1, 1): -(2 * (A - Bbar) + m * e * height) * omega,
            (1, 0, 2): -m * height**2,
        },
        gravity={
            (1, 0, 0): m * g * height,
            (1, 2, 0): -m * g * e / 2,
            (3, 0, 0): -m * g * height / 6,
        },
        friction={
            (0, 0, 1): strength * height**2,
            (0, 1, 0): strength * e * height * omega,
            (0, 3, 0): -strength * omega * e * (4 * e + r) / 6,
            (2, 1, 0): -strength * 3 * omega * e * height / 2,
            (2, 0, 1): -strength * height**2,
            (0, 2, 1): -strength * e * height,
        },
    )


def printed_expansion(constants: Any, omega: Any) -> LocalExpansion:
    """Return the local expansion of the equation of motion about inverted spinning as the paper
    prints it.

    Its source is Eqs. MassMatrix_3DOF_approx to genForce_3DOF_approx. Two entries differ from
    `derived_expansion`:

    - h-tilde's mixed term has 2 m e (r + e) instead of m e (r + e);
    - f_G has gamma_bar^3 (a fourth-order term) where gamma_bar^2 follows.

    All entries are copied from the paper, so their agreement with `derived_expansion` is evidence.

    Args:
        constants: The parameters, in any kind of number.
        omega: The spinning speed [rad/s].
    """
    c, r, e, height = constants, constants.r, constants.e, constants.r + constants.e
    bracket = {
        (0, 3, 0): -omega * e * (4 * e + r) / 6,
        (0, 0, 1): height**2,
        (2, 1, 0): -3 * omega * e * height / 2,
        (2, 0, 1): -(height**2),
        (0, 1, 0): e * height * omega,
        (0, 2, 1): -e * height,
    }
    return LocalExpansion(
        mass={(0, 2, 0): c.A - c.Bbar, (0, 0, 0): c.Bbar, (2, 0, 0): c.m * height**2},
        gyroscopic={
            (1, 0, 0): -c.Bbar * omega**2,
            (1, 2, 0): (c.Bbar - c.A) * omega**2,
            (3, 0, 0): (2 * c.Bbar / 3 - c.m * e * height) * omega**2,
            (1, 1, 1): -2 * (c.A - c.Bbar + c.m * e * height) * omega,
            (1, 0, 2): -c.m * height**2,
        },
        gravity={
            (1, 0, 0): c.m * c.g * height,
            (1, 3, 0): -c.m * c.g * e / 2,
            (3, 0, 0): -c.m * c.g * height / 6,
        },
        friction={
            powers: -c.mu * c.m * c.g / c.epsilon * value for powers, value in bracket.items()
        },
    )
