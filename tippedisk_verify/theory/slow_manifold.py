"""The slow invariant manifold of the linear law: orders 0 and 1 in closed form.

v = h_c(beta, gamma) + epsilon h_1(beta, gamma) + O(epsilon^2), away from sin(beta) = 0 where attraction vanishes.
"""

from __future__ import annotations

from typing import Any

from tippedisk_verify.model.equations import terms
from tippedisk_verify.model.parameters import Constants

__all__ = ["critical_manifold", "first_correction", "slow_manifold"]


def critical_manifold(ops: Any, constants: Constants, omega: Any, beta: Any, gamma: Any) -> Any:
    """h_c [rad/s], the v of pure rolling, gamma_y = 0 (Eq. critical_manifold_tippdisk)."""
    return constants.e * omega * ops.sin(beta) * ops.cos(gamma) / (constants.r + constants.e * ops.sin(gamma))


def first_correction(ops: Any, constants: Constants, omega: Any, beta: Any, gamma: Any) -> Any:
    """h_1 [rad/m], the paper's formula below Eq. slow_manifold_tippdisk; singular at sin(beta) = 0."""
    rolling = critical_manifold(ops, constants, omega, beta, gamma)
    sin_b, cos_b, sin_g, cos_g = ops.sin(beta), ops.cos(beta), ops.sin(gamma), ops.cos(gamma)
    rho = constants.r + constants.e * sin_g
    by_beta = constants.e * omega * cos_b * cos_g / rho
    by_gamma = -constants.e * omega * sin_b * (sin_g / rho + constants.e * cos_g * cos_g / (rho * rho))
    here = terms(ops, constants, omega, beta, gamma, rolling)
    inertial = (here.gyroscopic + here.gravity) / here.mass  # g_1, Eq. per_g1
    rate = -constants.mu * constants.m * constants.g * here.direction * here.direction / here.mass  # d(g_0)/d(v)
    return (by_beta * rolling - by_gamma * omega * cos_b - inertial) / rate


def slow_manifold(ops: Any, constants: Constants, omega: Any, beta: Any, gamma: Any, order: int = 1) -> Any:
    """v [rad/s] on the slow manifold, truncated at ``order`` 0 or 1 (Eq. slow_manifold_tippdisk)."""
    surface = critical_manifold(ops, constants, omega, beta, gamma)
    if order == 0:
        return surface
    return surface + constants.epsilon * first_correction(ops, constants, omega, beta, gamma)
