"""Friction laws of a user's, for the tests."""

from __future__ import annotations

from typing import Any

from tippedisk_verify.model.friction import FrictionLaw


def _arctan(ops: Any, gamma_y: Any, c: Any) -> Any:
    return -2 * c.mu * c.m * c.g / c.pi * ops.atan(c.pi * gamma_y / (2 * c.epsilon))


def _tanh(ops: Any, gamma_y: Any, c: Any) -> Any:
    return -c.mu * c.m * c.g * ops.tanh(gamma_y / c.epsilon)


def _stribeck(ops: Any, gamma_y: Any, c: Any) -> Any:
    """Return the smooth Coulomb force, half as large again near rest, for gamma_y >= 0."""
    excess = ops.exp(-gamma_y / (10 * c.epsilon)) / 2
    return -c.mu * c.m * c.g * gamma_y / (gamma_y + c.epsilon) * (1 + excess)


def _stribeck_slope(c: Any) -> Any:
    return 3 * c.mu * c.m * c.g / (2 * c.epsilon)


ARCTAN = FrictionLaw("arctan", _arctan)
TANH = FrictionLaw("tanh", _tanh)
STRIBECK = FrictionLaw("Stribeck", _stribeck, two_sided=True, slope=_stribeck_slope)
#: Two analytic laws with the paper's slope at zero, and one with two sides and another slope.
OWN_LAWS = (ARCTAN, TANH, STRIBECK)
