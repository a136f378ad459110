"""Rotating limit cycles, proved, by Krawczyk's operator on the turn map.

The turn map P goes from gamma_bar = 0 along the flow to gamma_bar = 2 pi. As long as 0 < beta_bar < pi/2, gamma' =
Omega sin(beta_bar) is positive: an orbit of which this is proved passes gamma_bar = 2 pi exactly once. A fixed point
lies on a cycle on which gamma grows by 2 pi a period. Along the field the section map's determinant is
exp(integral of div f) gamma'(start) / gamma'(end), and the last factor is 1 at a fixed point.

The rest is that of `cycle`, with one flight a period instead of two.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.decimals import exact_text
from tippedisk_verify.model.exact import exact
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.proofs.kernel.balls import arb, ball, inside, negative, positive
from tippedisk_verify.proofs.kernel.flow import Model, Path, Step
from tippedisk_verify.proofs.kernel.krawczyk import Flight
from tippedisk_verify.proofs.kernel.section import UPRIGHT, HalfFlight, Status, moment_of_zero, no_step
from tippedisk_verify.proofs.search.cycle import Attempt, OrbitProof

__all__ = ["RotationProof", "prove_rotation", "turn_flight"]

_MOST_CUTS = 40


@dataclass(frozen=True)
class RotationProof(OrbitProof):
    """What is proved of a rotating limit cycle. Names are those of `cycles.limit_cycle.RotatingCycle`."""

    unknowns = ("beta_bar_top", "v_top")
    main = ("period", "beta_bar_top", "v_top")
    laps = 1

    beta_bar_top: Any = None  #: beta - pi/2 at gamma = pi/2 [rad]
    v_top: Any = None  #: v there [rad/s]
    dbeta_bar_top_domega: Any = None  #: [s]
    dv_top_domega: Any = None  #: [1]

    def _sentence(self, manner: str, first: str, second: str) -> str:
        numbers = self.numbers()
        return (
            f"for the tippedisk with {self.parameters.definition()} under the {self.parameters.law} friction law at "
            f"Omega = {exact_text(self.omega)} rad/s, the turn map, along the flow from gamma = pi/2 to gamma = 5 "
            "pi/2, has a fixed point (beta - pi/2, v) = (beta_bar_top, v_top) with beta_bar_top = "
            f"{numbers['beta_bar_top']} rad and v_top = {numbers['v_top']} rad/s, and no other with beta within "
            f"{first} rad and v within {second} rad/s of it; through it runs {manner}, on which gamma "
            f"grows all the time, by 2 pi a period, with 0 < beta - pi/2 < 1.5707{self.sliding}; its period is T = "
            f"{numbers['period']} s, its Floquet multiplier other than 1 of larger absolute value is "
            f"{numbers['multiplier_slow']}, the logarithms of the absolute values of both are "
            f"{numbers['log_multiplier_slow']} and {numbers['log_multiplier_fast']}, dT/dOmega = "
            f"{numbers['dperiod_domega']} s^2/rad, d(beta_bar_top)/dOmega = {numbers['dbeta_bar_top_domega']} s and "
            f"d(v_top)/dOmega = {numbers['dv_top_domega']}."
        )


def turn_flight(
    model: Model,
    beta_bar: Any,
    v: Any,
    *,
    derivatives: bool = False,
    longest: float = 60.0,
    watch: Callable[[Step], None] | None = None,
) -> HalfFlight:
    """Enclose the turn map over a box of (beta_bar, v), at the working precision; ``longest`` [s] ends the search.

    ``watch`` is called with every step before it is taken.
    """
    path = model.path((beta_bar, ball(0), v), derivatives=derivatives)
    while path.time < longest:
        step = _leaning_step(path)
        if isinstance(step, Status):
            return HalfFlight(step, path.time, path.steps)
        if watch is not None:
            watch(step)
        if positive(step.at(ball(step.length))[1] - _turn()):
            crossing = moment_of_zero(
                step, 1, model.rates(step.enclosure)[1], lambda state: model.rates(state)[1], _turn()
            )
            if crossing is None:
                return HalfFlight(Status.UNRESOLVED, path.time, path.steps)
            return _landed(path, step, crossing)
        path.take(step)
    return HalfFlight(Status.NO_RETURN, path.time, path.steps)


def _turn() -> Any:
    return 2 * arb.pi()


def _leaning_step(path: Path) -> Step | Status:
    """A step on which 0 < beta_bar < 1.5707 throughout, and at whose end gamma is certainly short of 2 pi or beyond."""
    length, leaning = None, True
    for _ in range(_MOST_CUTS):
        step = path.step(length)
        if step is None:
            return no_step(path)
        beta = step.enclosure[0]
        leaning = positive(beta) and inside(beta, arb(0, UPRIGHT))
        ahead = step.at(ball(step.length))[1] - _turn()
        if leaning and (negative(ahead) or positive(ahead)):
            return step
        length = 0.7 * step.length
    return Status.UNRESOLVED if leaning else Status.FLAT


def _landed(path: Path, step: Step, crossing: Any) -> HalfFlight:
    path.take(step, crossing)
    beta, gamma, v = path.box
    derivatives: dict[str, Any] = {}
    if path.sharp:
        # gamma is 2 pi there; time moves with the start, dt = -d(gamma) / gamma', and takes beta and v along.
        rates = path.model.rates((beta, gamma, v))
        columns = (0, 2, 3)
        times = [-path.matrix[1][k] / rates[1] for k in columns]
        rows = [
            [path.matrix[axis][k] + rates[axis] * moved for k, moved in zip(columns, times, strict=True)]
            for axis in (0, 2)
        ]
        derivatives = {
            "matrix": tuple(tuple(row[:2]) for row in rows),
            "by_omega": tuple(row[2] for row in rows),
            "time_by_state": tuple(times[:2]),
            "time_by_omega": times[2],
            "divergence": path.divergence,
        }
    return HalfFlight(
        Status.RETURNED, path.time, path.steps, path.reversals, time=path.time, image=(beta, v), **derivatives
    )


class _Turning(Attempt):
    proof = RotationProof
    flight: Flight = staticmethod(turn_flight)

    def slow_multiplier(self, box: HalfFlight) -> tuple[Any, Any]:
        """The turn map's have the same sign, that of its trace: det P = exp(divergence) at a fixed point."""
        (a, _), (_, d) = box.matrix
        trace, shrinking = a + d, box.divergence.exp()
        # Of a complex pair, or where the sign is not certain, this is not finite, and nothing is proved.
        larger = (abs(trace) + (trace * trace - 4 * shrinking).sqrt()) / 2
        sign = 1 if positive(trace) else -1 if negative(trace) else arb("nan")
        return larger.log(), sign * larger

    def others(self, centre: HalfFlight, box: HalfFlight, shift: Sequence[Any]) -> dict[str, Any]:
        return {}


def prove_rotation(
    parameters: Parameters, omega: object, guess: Sequence[object], *, digits: int = 12, most_bits: int = 20_000
) -> RotationProof:
    """Prove the rotating limit cycle near ``guess`` = (beta_bar_top, v_top) at ``omega`` [rad/s].

    Period and state come to ``digits`` significant digits, the others to about as many. Raises InputError for input
    that makes no sense; whatever else prevents a proof is a status.
    """
    speed = exact(omega)
    if speed.pi_multiple or speed.rational <= 0:
        raise InputError(f"Omega must be a positive decimal, not {str(omega)[:40]}")
    if len(guess) != 2:
        raise InputError("a guess has two components: beta_bar and v")
    attempt = _Turning(parameters, speed.rational, digits, most_bits)
    proof: RotationProof = attempt.run([exact(part) for part in guess])
    return proof
