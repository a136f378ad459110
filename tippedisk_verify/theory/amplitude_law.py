"""The family of limit cycles at its birth, to fourth order in the amplitude, in closed form (linear friction law).

With a = gamma_bar_0, the largest gamma - pi/2 on a cycle, the family that is born at the Hopf point has

    Omega = Omega_crit + c_1 a^2 + c_2 a^4 + O(a^6)

and c_1 / Omega_crit, c_2 / Omega_crit are rational functions of four ratios:

    W = e / (r + e), the square of the cycle's frequency over Omega_crit      alpha = A / Bbar
    M = m (r + e)^2 / Bbar                                                    f = |A33| / Omega_crit (friction)

They come from the invariance equation x(w, wbar), w' = i nu(|w|^2) w, Omega(|w|^2) with harmonics 1 and 3: the third
harmonic of order a^3 is where friction enters. Tests solve the invariance equation of the full equations as well.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

from tippedisk_verify.model.parameters import Parameters

__all__ = ["AmplitudeLaw", "amplitude_law", "frequency_ratio_squared", "friction_ratio_squared"]


class AmplitudeLaw(NamedTuple):
    """The law's coefficients over Omega_crit, exactly."""

    quadratic: Fraction  #: c_1 / Omega_crit [1/rad^2]; friction does not enter
    quartic: Fraction  #: c_2 / Omega_crit [1/rad^4]


def frequency_ratio_squared(parameters: Parameters) -> Fraction:
    """W, exactly."""
    return parameters.e / (parameters.r + parameters.e)


def friction_ratio_squared(parameters: Parameters) -> Fraction:
    """f^2, exactly."""
    c = parameters.rational()
    return Fraction(c.k**2 * (c.r + c.e) ** 2 * c.r / (c.b * c.g))


def amplitude_law(parameters: Parameters) -> AmplitudeLaw:
    """c_1 = -(Omega_crit / 8) delta, where delta = A (r - 2 e) / (Bbar r) - (2 r - e) / (2 (r + e)); c_2 as below."""
    p = parameters
    W, alpha, mass = frequency_ratio_squared(p), p.A / p.Bbar, p.m * (p.r + p.e) ** 2 / p.Bbar
    lift = alpha * (1 - 3 * W) / (1 - W)
    delta = lift - 1 + 3 * W / 2
    third = friction_ratio_squared(p) + 9 * W  # |A33 - 3 i omega|^2 / Omega_crit^2
    quartic = (
        3 * lift**2 / 128
        - alpha * (19 - 54 * W + 39 * W**2) / (768 * (1 - W))
        + (2 + 57 * W - 6 * W**2) / 1536
        - (2 * W + delta) * (2 + 55 * W + 7 * W**2 - 2 * alpha * (1 + 13 * W) + 64 * mass * W**2) / (256 * third)
    )
    return AmplitudeLaw(quadratic=Fraction(-delta / 8), quartic=Fraction(quartic))
