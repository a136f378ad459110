"""Requests for limit cycles: shooting, continuation, harmonic balance, and the branch as a function.

The truth is Newton's iteration with fresh derivatives at every step, in quadruple precision or wider, and the cycle's
numbers in that arithmetic.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from fractions import Fraction
from random import Random
from typing import Any

from tippedisk_verify.errors import NoConnectionError, NoSuchCycleError, Shortfall
from tippedisk_verify.evidence.stress.comparison import Asked, Number, printed, unlike
from tippedisk_verify.evidence.stress.draws import STRUCTURED, decimal, disk, log_uniform, written
from tippedisk_verify.flow import default_engine, default_lanes
from tippedisk_verify.model.equations import Friction
from tippedisk_verify.model.exact import fraction
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE, QUADRUPLE, Precision, bits
from tippedisk_verify.orbits.bisection import bisect_omega_h
from tippedisk_verify.orbits.continuation import followed_cycle
from tippedisk_verify.orbits.dense import DenseBranch
from tippedisk_verify.orbits.half_map import half_map, newton_step
from tippedisk_verify.orbits.periodic import LimitCycle, Shot, cycle_numbers, limit_cycle
from tippedisk_verify.theory.hopf import criticality, omega_crit
from tippedisk_verify.theory.spectral_balance import balanced_cycle

__all__ = [
    "NAMES",
    "balanced",
    "branch",
    "compared_cycle",
    "cycle",
    "cycle_in_double",
    "decimal_near",
    "smooth_cycle",
    "true_cycle",
]

#: What every limit cycle has, whichever road found it.
NAMES = (
    *("period", "gamma_bar_0", "v_0", "beta_max", "multiplier_slow", "log_multiplier_slow", "log_multiplier_fast"),
    *("dperiod_domega", "dgamma_bar_0_domega", "dv_0_domega"),
)
_MOST_STEPS = 12
_LONGEST = 400  # s; shooting, which gives the truth, follows half a period for 200 s
_BEYOND = 50  # bits by which truths are finer than what is claimed: 15 digits


def true_cycle(
    parameters: Parameters, omega: Fraction, guess: Sequence[Any], precision: Precision, friction: Friction
) -> dict[str, Any]:
    """All numbers of the cycle near a guess (gamma_bar, v). Raises NoSuchCycleError if there is none."""
    engine = default_engine()
    state = tuple(precision.number(part) for part in guess)
    first = [abs(float(part)) for part in state]
    for _ in range(_MOST_STEPS):
        here = half_map(parameters, omega, state, engine, precision, friction)
        step = newton_step(here.matrix, here.residual)
        state = (state[0] + step[0], state[1] + step[1])
        size = max(abs(float(part)) / whole for part, whole in zip(step, first, strict=True))
        if size < 2.0 ** (-precision.bits * 0.6):  # the next step would be below rounding
            return cycle_numbers(parameters, omega, Shot(state, (), here), engine, precision, friction)
        if size > 0.5:
            break
    raise NoSuchCycleError("Newton's iteration in the wider arithmetic goes elsewhere")


def compared_cycle(
    parameters: Parameters, found: Any, friction: Friction, working_bits: int | None, names: Sequence[str] = NAMES
) -> list[Number]:
    """Each number of a cycle beside the truth, in an arithmetic wide enough for what is claimed."""
    omega = found.omega if isinstance(found.omega, Fraction) else found.omega.value
    claims = {name: getattr(found, name) for name in names}
    finest = max(
        (math.log2(abs(m.value) / m.uncertainty) for m in claims.values() if m.uncertainty and m.value), default=53
    )
    precision = QUADRUPLE if finest + _BEYOND < QUADRUPLE.bits else bits(64 * math.ceil((finest + _BEYOND) / 64 + 1))
    try:
        truth = true_cycle(parameters, omega, (found.gamma_bar_0.value, found.v_0.value), precision, friction)
    except NoSuchCycleError as fault:
        if found.period.value > _LONGEST:
            raise Shortfall(f"no truth to compare with: {fault}") from None
        return [unlike("cycle")]
    numbers = [printed(name, claim, fraction(truth[name]), working_bits) for name, claim in claims.items()]
    if isinstance(found, LimitCycle):
        numbers.append(printed("trivial_multiplier_defect", found.trivial_multiplier_defect, Fraction(0), working_bits))
        if found.stable not in (None, bool(abs(truth["multiplier_slow"]) < 1)):
            numbers.append(unlike("stable"))
    return numbers


def _place(random: Random, families: Sequence[str], friction: Friction = "linear") -> tuple[Parameters, Fraction, str]:
    """A disk, and a speed on the side of its Omega_crit where cycles are: mostly above Omega_h, where that is known."""
    family = random.choice(families)
    parameters = disk(random, family)
    crit = omega_crit(parameters, 30).value
    side = -1 if criticality(parameters) == "subcritical" else 1
    share = decimal(random.choice((random.uniform(1e-4, 0.02), log_uniform(random, 1e-9, 0.03))))
    omega = crit * (1 - side * share)
    within = decimal(
        random.choice((random.uniform(0.002, 1), 1 - log_uniform(random, 1e-8, 1), log_uniform(random, 1e-4, 1)))
    )
    if family in STRUCTURED and side > 0 and random.random() < 0.9:
        with suppress(NoConnectionError, Shortfall):
            omega_h = bisect_omega_h(parameters, default_engine(), friction=friction, confirm=False).omega_h.value
            omega = omega_h + within * (crit - omega_h)
    omega = decimal_near(omega)
    return parameters, omega, f"at {float(omega)!r} rad/s, {written(parameters)}"


def decimal_near(value: Fraction, places: int = 12) -> Fraction:
    """The nearest decimal of so many places."""
    return Fraction(round(value * 10**places), 10**places)


_MOSTLY = ("named", "nearby", "nearby", "friction", "near-equal", "spread", "tiny-eccentricity", "heavy")


def cycle(random: Random) -> Asked:
    """The linear law's cycle, to a number of digits: in double if it holds them."""
    parameters, omega, text = _place(random, _MOSTLY)
    digits = random.choice((6, 9, 12))

    def numbers() -> list[Number]:
        return compared_cycle(
            parameters, followed_cycle(parameters, omega, default_engine(), digits=digits), "linear", None
        )

    return Asked(f"limit cycle to {digits} digits {text}", numbers)


def cycle_in_double(random: Random) -> Asked:
    """The same in double, whatever digits that gives."""
    parameters, omega, text = _place(random, _MOSTLY)

    def numbers() -> list[Number]:
        found = limit_cycle(parameters, omega, default_engine(), precision=DOUBLE)
        return compared_cycle(parameters, found, "linear", 53)

    return Asked(f"limit cycle in double {text}", numbers)


def smooth_cycle(random: Random) -> Asked:
    """The smooth law's cycle."""
    parameters, omega, text = _place(random, ("named", "nearby", "nearby", "friction", "spread"), "smooth")
    digits = random.choice((6, 9, 12))

    def numbers() -> list[Number]:
        found = followed_cycle(parameters, omega, default_engine(), digits=digits, friction="smooth")
        return compared_cycle(parameters, found, "smooth", None)

    return Asked(f"smooth law's limit cycle to {digits} digits {text}", numbers)


def balanced(random: Random) -> Asked:
    """Harmonic balance against shooting."""
    parameters, omega, text = _place(random, _MOSTLY)
    digits = random.choice((6, 9, 12))
    names = ("period", "gamma_bar_0", "v_0", "beta_max")

    def numbers() -> list[Number]:
        found = balanced_cycle(parameters, omega, digits=digits)
        return compared_cycle(parameters, found, "linear", None, names)

    return Asked(f"harmonic balance to {digits} digits {text}", numbers)


def branch(random: Random) -> Asked:
    """The branch as a function: a corrected cycle and interpolated numbers at a speed between its ends."""
    parameters = disk(random, random.choice(("named", "nearby", "nearby", "friction")))
    share = random.choice((random.uniform(0.002, 0.998), log_uniform(random, 0.0011, 0.5)))

    def numbers() -> list[Number]:
        omega_h = float(bisect_omega_h(parameters, default_engine(), confirm=False).omega_h)
        whole = DenseBranch(parameters, default_lanes(), omega_h)
        omega = min(max(omega_h + share * (whole.omega_crit - omega_h), whole.lowest), whole.highest)
        (found,) = whole.limit_cycles([omega])
        compared = compared_cycle(parameters, found, "linear", 53)
        values = whole([omega])
        between: Callable[[str], Measured] = lambda name: Measured.of(  # noqa: E731
            float(getattr(values, name)[0]), float(values.uncertainty[name][0])
        )
        truth = true_cycle(parameters, Fraction(omega), (found.gamma_bar_0.value, found.v_0.value), QUADRUPLE, "linear")
        compared += [
            printed(f"interpolated {name}", between(name), fraction(truth[name]), 53) for name in values.uncertainty
        ]
        return compared

    return Asked(f"branch at {share!r} of the way from Omega_h to Omega_crit, {written(parameters)}", numbers)
