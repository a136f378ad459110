"""The family of limit cycles: continuation in Omega with a tangent predictor, and the paper's sets of speeds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction

from tippedisk_verify.errors import InputError, NoConnectionError, NoSuchCycleError, Shortfall
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE
from tippedisk_verify.orbits.bisection import bisect_omega_h
from tippedisk_verify.orbits.periodic import LimitCycle, limit_cycle
from tippedisk_verify.theory.hopf import criticality, omega_crit

__all__ = ["PaperSets", "continued", "followed_cycle", "paper_sets"]

_STEPS = 400
_FEWEST_HALVINGS = 12
_EXPLAINED_AFTER = 3  # halvings; whether the speed is beyond the family's end costs about as much as they do


@dataclass(frozen=True)
class PaperSets:
    """The paper's speeds [rad/s]: 400 steps from Omega_0 = Omega_crit - 0.5 to each end, each a hundredth of the rest.

    As doubles, because the paper's are. The paper's index set I = {1, ..., 400} leaves Omega_1 undefined; here Omega_1
    follows from Omega_0 by the same rule.
    """

    start: float
    increasing: tuple[float, ...]
    decreasing: tuple[float, ...]


def paper_sets(parameters: Parameters, omega_h: Fraction) -> PaperSets:
    """A^in towards Omega_crit and A^de towards the given Omega_h, 400 speeds each besides the common Omega_0."""
    crit = omega_crit(parameters, 40).value
    start = crit - Fraction(1, 2)

    def steps(end: Fraction) -> tuple[float, ...]:
        return tuple(float(end + (start - end) * Fraction(99, 100) ** n) for n in range(1, _STEPS + 1))

    return PaperSets(float(start), steps(crit), steps(omega_h))


def continued(
    parameters: Parameters,
    omegas: Sequence[float | Fraction],
    engine: Engine,
    *,
    first: LimitCycle | None = None,
) -> Iterator[LimitCycle]:
    """Limit cycles at one speed after the other, each predicted along the tangent of the one before.

    ``first`` is a cycle to start from, near the first speed; without it harmonic balance starts the family. Where a
    prediction does not converge, the step is halved, up to twelve times. Raises NoSuchCycleError where that does not
    help, InputError for a first cycle of another disk or friction law.
    """
    if first is not None and first.parameters != parameters:
        raise InputError("the first cycle is of another disk, or of another friction law")
    previous = first
    for omega in omegas:
        target = Fraction(omega)
        if previous is None:
            previous = limit_cycle(parameters, target, engine, precision=DOUBLE)
        else:
            previous = _reached(parameters, previous, target, engine)
        yield previous


def followed_cycle(parameters: Parameters, omega: Fraction, engine: Engine, *, digits: int = 12) -> LimitCycle:
    """The limit cycle at ``omega`` [rad/s] of either law; followed from near the Hopf point where no guess is at hand.

    Raises as `limit_cycle` does; below Omega_h it says so.
    """
    try:
        return _followed(parameters, omega, engine, digits)
    except NoSuchCycleError:
        _refused_outside(parameters, omega, engine)
        raise


def _refused_outside(parameters: Parameters, omega: Fraction, engine: Engine) -> None:
    """Raises NoSuchCycleError with the reason if the speed lies outside the family, as far as that can be told."""
    crit = omega_crit(parameters, 20).value
    if omega > crit and criticality(parameters) == "supercritical":
        raise NoSuchCycleError(
            f"no limit cycle at {float(omega):.10g} rad/s: they are born below Omega_crit = {float(crit):.10g} rad/s,"
            f" which is less by {float(omega - crit):.2g}"
        ) from None
    omega_h = Fraction(0)
    with suppress(NoConnectionError, Shortfall):
        omega_h = bisect_omega_h(parameters, engine, confirm=False).omega_h.value
    if omega < omega_h:
        raise NoSuchCycleError(
            f"no limit cycle at {float(omega):.10g} rad/s: they exist above Omega_h = {float(omega_h):.10g}, which is"
            f" more by {float(omega_h - omega):.2g}, and below Omega_crit = {float(crit):.10g} rad/s"
        ) from None


def _followed(parameters: Parameters, omega: Fraction, engine: Engine, digits: int) -> LimitCycle:
    try:
        return limit_cycle(parameters, omega, engine, digits=digits)
    except NoSuchCycleError:
        crit = omega_crit(parameters, 20).value
        if parameters.friction == "linear" or not omega < crit:
            raise
    # The linear law's balance guesses too far away here: step towards the speed, closer and closer together.
    speeds = [float(crit + (omega - crit) * Fraction(share, 16)) for share in (1, 4, 8, 11, 13, 14, 15)]
    *_, near = continued(parameters, speeds, engine)
    *_, near = continued(parameters, [float(omega)], engine, first=near)
    guess = (float(near.gamma_bar_0), float(near.v_0))
    return limit_cycle(parameters, omega, engine, digits=digits, guess=guess)


def _reached(parameters: Parameters, here: LimitCycle, target: Fraction, engine: Engine) -> LimitCycle:
    for halvings in range(_FEWEST_HALVINGS + 1):
        try:
            cycle = here
            parts = 2**halvings
            begin = here.omega.value
            for part in range(1, parts + 1):
                omega = begin + (target - begin) * part / parts
                guess = _predicted(cycle, omega)
                cycle = limit_cycle(parameters, omega, engine, guess=guess, precision=DOUBLE)
            return cycle
        except NoSuchCycleError:
            if halvings == _FEWEST_HALVINGS:
                raise
            if halvings == _EXPLAINED_AFTER:
                _refused_outside(parameters, target, engine)
    raise AssertionError("unreachable")  # pragma: no cover


def _predicted(here: LimitCycle, omega: Fraction) -> tuple[float, float]:
    step = float(omega - here.omega.value)
    return (
        float(here.gamma_bar_0) + step * float(here.dgamma_bar_0_domega),
        float(here.v_0) + step * float(here.dv_0_domega),
    )
