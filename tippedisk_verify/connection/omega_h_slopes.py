"""How Omega_h depends on each parameter, from one variational flight along the connection.

The splitting u(Omega, p) vanishes along Omega_h(p), so d(Omega_h)/dp = -(du/dp) / (du/dOmega). Both derivatives come
from the variational equations, started and ended so close to the saddles that how the manifolds' directions there
depend on p no longer counts: a start moved along the unstable direction is only earlier or later, and the rest decays.
"""

from __future__ import annotations

from fractions import Fraction

from tippedisk_verify.connection.splitting import SplittingFunction
from tippedisk_verify.flow.contract import Engine, Variation
from tippedisk_verify.model.exact import fraction
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import QUADRUPLE

__all__ = ["omega_h_slopes"]

_VARIATIONS: tuple[Variation, ...] = ("Omega", "r", "e", "a", "b", "g", "k")
_CLOSE = 1e-6  # of the ordinary distances from the saddles
_CLOSER = 1 / 32  # of that, for the second run, which shows the first one's error


def omega_h_slopes(parameters: Parameters, omega_h: Measured, engine: Engine) -> dict[str, Measured]:
    """d(Omega_h) / d(parameter) for r, e, m, A, B, g, mu and epsilon [rad/s per SI unit of each].

    ``omega_h`` must have some twenty digits. Raises AccuracyError if the branch cannot be followed.
    """
    parameters.refuse_smooth("slopes by the field's constants are")
    rough, sharp = (
        _by_constants_given(parameters, _by_field_constants(parameters, omega_h, engine, closer))
        for closer in (_CLOSE, _CLOSE * _CLOSER)
    )
    return {name: Measured.compared(sharp[name], rough[name], QUADRUPLE.epsilon) for name in sharp}


def _by_field_constants(
    parameters: Parameters, omega_h: Measured, engine: Engine, closer: float
) -> dict[str, Fraction]:
    """d(Omega_h) / d(constant) for the field's own constants."""
    splitting_at = SplittingFunction(parameters, omega_h.value, engine, QUADRUPLE, closer=closer)
    saddle = splitting_at.saddle_at(omega_h.value)
    rows = splitting_at.flight(saddle, _VARIATIONS).derivatives
    along = [fraction(saddle.inverse_directions[0, row]) for row in range(3)]
    u: dict[str, Fraction] = {
        name: sum((along[row] * fraction(rows[row][column]) for row in range(3)), Fraction(0))
        for column, name in enumerate(_VARIATIONS)
    }
    return {name: -u[name] / u["Omega"] for name in _VARIATIONS[1:]}


def _by_constants_given(parameters: Parameters, by: dict[str, Fraction]) -> dict[str, Fraction]:
    """The same for the disk's parameters, by the chain rule."""
    p = parameters
    # The field's own a = A / m, b = B / m - e^2 and k = mu g / epsilon.
    k = p.mu * p.g / p.epsilon
    return {
        "r": by["r"],
        "e": by["e"] - 2 * p.e * by["b"],
        "m": -(by["a"] * p.A + by["b"] * p.B) / p.m**2,
        "A": by["a"] / p.m,
        "B": by["b"] / p.m,
        "g": by["g"] + by["k"] * p.mu / p.epsilon,
        "mu": by["k"] * k / p.mu,
        "epsilon": -by["k"] * k / p.epsilon,
    }
