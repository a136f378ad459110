"""Error against tolerance for both friction laws: what switching branches at gamma_y = 0 gives back.

The smooth law's field is only once differentiable where the disk rolls. The Taylor engine switches its analytic branch
there and keeps the linear law's order; a high-order method that does not (SciPy's DOP853) loses it at tight tolerances.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from tippedisk_verify.flow.baseline import Baseline
from tippedisk_verify.flow.contract import Request
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.exact import PI, Exact, fraction
from tippedisk_verify.model.parameters import Friction, Parameters
from tippedisk_verify.model.precision import QUADRUPLE
from tippedisk_verify.theory.hopf import omega_crit

__all__ = ["OrderPoint", "switching_order"]

_SECONDS = 3
_START = (PI * Fraction(1, 2), Exact(Fraction(2, 5), Fraction(1, 2)), 0)


@dataclass(frozen=True)
class OrderPoint:
    """One run."""

    method: str
    friction: Friction
    tolerance: float
    error: float  #: largest component's, against 113 bits [rad, rad/s]


def switching_order(parameters: Parameters) -> list[OrderPoint]:
    """Taylor and DOP853, both laws, over six tolerances: 3 s from near inverted spinning at Omega_crit - 0.5."""
    omega = omega_crit(parameters, 20).value - Fraction(1, 2)
    taylor, points = Taylor(), []
    laws: tuple[Friction, ...] = ("linear", "smooth")
    for law in laws:
        truth = taylor(Request(parameters.with_friction(law), omega, _START, _SECONDS, precision=QUADRUPLE)).state
        for engine in (taylor, Baseline("DOP853")):
            for power in range(3, 14, 2):
                tolerance = 10.0**-power
                state = engine(
                    Request(parameters.with_friction(law), omega, _START, _SECONDS, tolerance=tolerance)
                ).state
                error = max(abs(float(fraction(a) - fraction(b))) for a, b in zip(state, truth, strict=True))
                points.append(OrderPoint(engine.name, law, tolerance, error))
    return points
