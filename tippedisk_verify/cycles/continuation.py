"""Limit cycles at a speed, on the family where no guess is at hand, and the paper's sets of speeds."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction

from tippedisk_verify.cycles.family import Place
from tippedisk_verify.cycles.librating_family import LibratingFamily
from tippedisk_verify.cycles.shooting import LimitCycle, limit_cycle
from tippedisk_verify.errors import NoSuchCycleError, OutsideFamilyError, Shortfall
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.theory.hopf import omega_crit

__all__ = ["PaperSets", "cycles_at_speed", "followed_cycle", "paper_sets"]

_STEPS = 400
_NEXT_TO_A_FOLD = 1e-5  # of the abscissa


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


def followed_cycle(
    parameters: Parameters, omega: Fraction, engine: Engine, *, digits: int = 12, stable: bool | None = None
) -> LimitCycle:
    """The limit cycle at ``omega`` [rad/s] of either law, found on the family where no guess is at hand.

    Where a speed has several it is the stable one, or the one that ``stable`` asks for. Raises as `limit_cycle` does,
    with the speeds between which the family lies.
    """
    found: LimitCycle | None = None
    if stable is not False:
        with suppress(NoSuchCycleError):
            found = limit_cycle(parameters, omega, engine, digits=digits)
            if found.stable:
                return found
    try:
        cycles = cycles_at_speed(LibratingFamily(parameters, engine), omega, digits)
    except NoSuchCycleError:
        if found is None or stable is not None:
            raise
        return found
    wanted = [cycle for cycle in cycles if cycle.stable is (stable is not False)]
    if not wanted and stable is not None:
        kind, other = ("stable", "unstable") if stable else ("unstable", "stable")
        raise NoSuchCycleError(f"no {kind} limit cycle found at {float(omega):.10g} rad/s: the one found is {other}")
    return (wanted or cycles)[0]


def cycles_at_speed(
    family: LibratingFamily, omega: Fraction, digits: int = 12, *, piece: int | None = None
) -> list[LimitCycle]:
    """All cycles of the family at a speed [rad/s], from the smallest amplitude on, each to ``digits`` digits.

    Only that of one piece, if it is named.

    Raises NoSuchCycleError if there is none, or if doubles cannot tell two apart, Shortfall if the digits are not
    reached.
    """
    if family.engine is None:
        raise TypeError("the family needs an engine for its cycles")
    cycles = []
    for place in family.places(float(omega)):
        if piece in (None, place.piece):
            try:
                cycle = limit_cycle(family.parameters, omega, family.engine, digits=digits, guess=place.start)
            except Shortfall as fault:
                if not any(abs(place.s - fold) < _NEXT_TO_A_FOLD for fold in family.folds):
                    raise
                raise Shortfall(f"{fault}; the speed is next to a fold, where two cycles meet") from None
            cycles.append(_on_piece(family, place, cycle))
    if not cycles:
        raise OutsideFamilyError(family.refusal(float(omega)))
    return cycles


def _on_piece(family: LibratingFamily, place: Place, cycle: LimitCycle) -> LimitCycle:
    """The cycle, if it lies on the piece where it was looked for."""
    s = math.atanh(float(cycle.gamma_bar_0) / math.pi)
    low, high = family.breaks[place.piece : place.piece + 2]
    # At the ends, which are no folds, it may lie a little beyond the nodes.
    if (low != family.s_start and s < low) or (high != family.s_end and s > high):
        raise NoSuchCycleError(
            f"{float(cycle.omega):.17g} rad/s is so close to a fold that doubles cannot tell its two cycles apart"
        )
    return cycle
