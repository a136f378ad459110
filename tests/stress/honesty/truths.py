"""The truth about a cycle and about Omega_h, by other means than those that claim it.

A cycle is Newton's iteration on the flow over a fixed time, with the flight time as a third unknown and derivatives
taken anew at every step. Its multipliers come from the trace of the half period's matrix, whose third eigenvalue is 1,
and from Liouville's integral. What is claimed stops at an event and takes the multipliers from a matrix on the section.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache
from typing import Any

from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.contract import TURN, Event, Request, Status
from tippedisk_verify.model.equations import field, shifted
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import Precision, bits
from tippedisk_verify.orbits.bisection import bisect_omega_h, unstable_branch
from tippedisk_verify.orbits.splitting import splitting_zero

__all__ = ["rough_omega_h", "true_cycle", "true_omega_h"]

_TURNS = Event("turns", TURN.function, terminal=False)
_MOST_STEPS = 12


def true_cycle(parameters: Parameters, omega: Fraction, guess: Sequence[Any], precision: Precision) -> dict[str, Any]:
    """All numbers of the cycle near a guess (gamma_bar, v, T / 2). Raises NoSuchCycleError if there is none."""
    rates = field(shifted(precision.ops), parameters.at(precision), precision.number(omega), parameters.friction)
    unknown = [precision.number(part) for part in guess]
    first = [abs(float(part)) for part in unknown]
    for _ in range(_MOST_STEPS):
        run = _flown(parameters, omega, unknown, precision, variations=("beta", "gamma", "v", "Omega"))
        (beta, gamma, v), (by_beta, by_gamma, by_v) = run.state.tolist(), run.derivatives.tolist()
        beta_rate, gamma_rate, v_rate = rates(beta, gamma, v)
        # S(flow) - start of (beta, gamma, v) by (gamma_bar, v, T / 2), and by Omega.
        matrix = (
            (by_beta[1], by_beta[2], beta_rate),
            (-by_gamma[1] - 1, -by_gamma[2], -gamma_rate),
            (-by_v[1], -by_v[2] - 1, -v_rate),
        )
        step = _solved(matrix, (-beta, gamma + unknown[0], v + unknown[1]))
        unknown = [part + change for part, change in zip(unknown, step, strict=True)]
        size = max(abs(float(part)) / whole for part, whole in zip(step, first, strict=True))
        if not size < 0.5:
            break
        if size < 2.0 ** (-precision.bits * 0.6):  # the next step would be below rounding
            slopes = _solved(matrix, (-by_beta[3], by_gamma[3], by_v[3]))
            passing = _flown(parameters, omega, unknown, precision, divergence=True, events=(_TURNS,))
            turns = [abs(record.state[0]) for record in passing.events]
            trace = -by_beta[0] - by_gamma[1] - by_v[2] - 1
            return _named(unknown, slopes, max(turns, default=0 * beta), trace, passing.divergence, precision)
    raise NoSuchCycleError("Newton's iteration in the wider arithmetic goes elsewhere")


def _flown(
    parameters: Parameters,
    omega: Fraction,
    unknown: Sequence[Any],
    precision: Precision,
    **more: Any,
) -> Any:
    gamma_bar, v, half_period = unknown
    if not half_period > 0:
        raise NoSuchCycleError("Newton's iteration in the wider arithmetic goes back in time")
    common: dict[str, Any] = {"shifted": True, "precision": precision, "domain": "none"}
    run = default_engine()(Request(parameters, omega, (0, gamma_bar, v), half_period, **common, **more))
    if run.status is not Status.REACHED:
        raise NoSuchCycleError(f"half a period in the wider arithmetic: {run.status.value}")
    return run


def _named(
    unknown: Sequence[Any], slopes: Sequence[Any], beta_max: Any, trace: Any, divergence: Any, precision: Precision
) -> dict[str, Any]:
    """``trace`` is the sum of the half period's multipliers but for the one along the flow; their product is -e^D."""
    functions = precision.ops
    product = -functions.exp(divergence)
    root = functions.sqrt(trace * trace / 4 - product)
    slow = (trace / 2 + (root if trace > 0 else -root)) ** 2
    log_slow = functions.log(slow)
    return {
        "period": 2 * unknown[2],
        "gamma_bar_0": unknown[0],
        "v_0": unknown[1],
        "beta_max": beta_max,
        "multiplier_slow": slow,
        "log_multiplier_slow": log_slow,
        "log_multiplier_fast": 2 * divergence - log_slow,
        "dperiod_domega": 2 * slopes[2],
        "dgamma_bar_0_domega": slopes[0],
        "dv_0_domega": slopes[1],
    }


def _solved(matrix: Any, right: Any) -> list[Any]:
    """Cramer's rule for three unknowns."""
    whole = _determinant(matrix)
    columns = list(zip(*matrix, strict=True))
    return [_determinant(list(zip(*columns[:k], right, *columns[k + 1 :], strict=True))) / whole for k in range(3)]


def _determinant(rows: Any) -> Any:
    (a, b, c), (d, e, f), (g, h, i) = rows
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


@lru_cache(maxsize=64)
def rough_omega_h(parameters: Parameters) -> Fraction:
    """Omega_h as double sees it. Raises NoConnectionError or Shortfall."""
    return bisect_omega_h(parameters, default_engine(), confirm=False).omega_h.value


@lru_cache(maxsize=64)
def true_omega_h(parameters: Parameters, digits: int = 30) -> Any:
    """The zero of the splitting to so many digits, with the unstable branch seen to change sides next to it.

    Raises ArithmeticError if it does not.
    """
    found = splitting_zero(parameters, rough_omega_h(parameters), default_engine(), digits)
    # The closer to Omega_h, the longer the branch stays next to the saddle: with small eigenvalues longer than it is
    # followed.
    for power in (24, 19, 15, 6):
        aside = found.omega_h.value / 10**power
        below, above = (_side(parameters, found.omega_h.value + step) for step in (-aside, aside))
        if (below, above) == ("passes", "turns back"):
            return found
        if "nowhere" not in (below, above):
            break
    raise ArithmeticError(f"the unstable branch does not change sides at {Measured(found.omega_h.value, aside)}")


def _side(parameters: Parameters, omega: Fraction) -> str:
    """Where the unstable branch goes; a start 2^-40 from the saddle misses the manifold by the cube of that."""
    run = unstable_branch(parameters, omega, default_engine(), precision=bits(160), offset=Fraction(1, 2**40))
    if run.status is Status.FLAT:
        return "passes"
    return run.events[-1].name if run.status is Status.EVENT else "nowhere"
