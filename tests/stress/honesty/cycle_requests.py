"""Requests for limit cycles: shooting, continuation, harmonic balance, and the branch as a function."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from fractions import Fraction
from random import Random
from typing import Any

from tests.stress.honesty.arithmetics import Arithmetic
from tests.stress.honesty.comparison import Asked, Number, printed, unlike
from tests.stress.honesty.draws import STRUCTURED, decay, decimal, disk, log_uniform, written
from tests.stress.honesty.truths import rough_omega_h, true_cycle
from tippedisk_verify.errors import NoConnectionError, NoSuchCycleError, Shortfall
from tippedisk_verify.model.exact import fraction
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Friction, Parameters
from tippedisk_verify.model.precision import DOUBLE, QUADRUPLE, Precision, bits
from tippedisk_verify.orbits.bisection import bisect_omega_h
from tippedisk_verify.orbits.branch_interpolant import BranchInterpolant
from tippedisk_verify.orbits.continuation import followed_cycle
from tippedisk_verify.orbits.periodic import LimitCycle, limit_cycle
from tippedisk_verify.theory.hopf import criticality, omega_crit
from tippedisk_verify.theory.spectral_balance import balanced_cycle

__all__ = ["NAMES", "Truths", "balanced", "branch", "cycle", "cycle_in_double", "decimal_near", "smooth_cycle"]

#: What every limit cycle has, whichever road found it.
NAMES = (
    *("period", "gamma_bar_0", "v_0", "beta_max", "multiplier_slow", "log_multiplier_slow", "log_multiplier_fast"),
    *("dperiod_domega", "dgamma_bar_0_domega", "dv_0_domega"),
)
_LONGEST = 400  # s; shooting follows half a period for 200 s
_BEYOND = 50  # bits by which truths are finer than what is claimed: 15 digits
_STIFFEST = 2e3  # 1/s; the truth about a stiffer disk's cycle takes minutes


@dataclass
class Truths:
    """The cycle of one draw in every arithmetic that was asked for, found once."""

    parameters: Parameters
    _found: dict[tuple[Fraction, Precision], dict[str, Any]] = field(default_factory=dict)

    def compared(
        self, found: Any, beyond: int, working_bits: int | None = None, names: Sequence[str] = NAMES
    ) -> list[Number]:
        """Each number of a cycle beside the truth, in an arithmetic wide enough for what is claimed."""
        claims = {name: getattr(found, name) for name in names}
        finest = beyond + max(
            (math.log2(abs(m.value) / m.uncertainty) for m in claims.values() if m.uncertainty and m.value), default=53
        )
        wide = finest + _BEYOND
        precision = QUADRUPLE if wide < QUADRUPLE.bits else bits(64 * math.ceil(wide / 64 + 1))
        try:
            truth = self(found, precision)
        except NoSuchCycleError as fault:
            if found.period.value > _LONGEST:
                raise Shortfall(f"no truth to compare with: {fault}") from None
            return [unlike("cycle")]
        numbers = [printed(name, claim, fraction(truth[name]), working_bits) for name, claim in claims.items()]
        if isinstance(found, LimitCycle):
            defect = found.trivial_multiplier_defect
            numbers.append(printed("trivial_multiplier_defect", defect, Fraction(0), working_bits))
            if found.stable not in (None, bool(abs(truth["multiplier_slow"]) < 1)):
                numbers.append(unlike("stable"))
        return numbers

    def __call__(self, found: Any, precision: Precision = QUADRUPLE) -> dict[str, Any]:
        omega = found.omega if isinstance(found.omega, Fraction) else found.omega.value
        known = self._found.get((omega, precision))
        if known is None:
            guess = (found.gamma_bar_0.value, found.v_0.value, found.period.value / 2)
            known = true_cycle(self.parameters, omega, guess, precision)
            self._found[omega, precision] = known
        return known


def _place(random: Random, families: Sequence[str], friction: Friction = "linear") -> tuple[Parameters, Fraction, str]:
    """A disk, and a speed on the side of its Omega_crit where cycles are: mostly above Omega_h, where that is known."""
    family = random.choice(families)
    while decay(parameters := disk(random, family)) > _STIFFEST:
        pass
    parameters = parameters.with_friction(friction)
    crit = omega_crit(parameters, 30).value
    side = -1 if criticality(parameters) == "subcritical" else 1
    share = decimal(random.choice((random.uniform(1e-4, 0.02), log_uniform(random, 1e-8, 0.03))))
    if side < 0:  # such a family turns back within some 1e-4 of Omega_crit
        share = share / 40
    omega = crit * (1 - side * share)
    within = decimal(
        random.choice((random.uniform(0.002, 1), 1 - log_uniform(random, 1e-6, 1), log_uniform(random, 1e-4, 1)))
    )
    if family in (*STRUCTURED, "far") and side > 0 and random.random() < 0.9:
        with suppress(NoConnectionError, Shortfall):
            omega_h = rough_omega_h(parameters)
            omega = omega_h + within * (crit - omega_h)
    omega = decimal_near(omega)
    return parameters, omega, f"at {float(omega)!r} rad/s, {written(parameters)}"


def decimal_near(value: Fraction, places: int = 12) -> Fraction:
    """The nearest decimal of so many places."""
    return Fraction(round(value * 10**places), 10**places)


def _asked(
    text: str,
    truths: Truths,
    answer: Callable[[Arithmetic], Any],
    working_bits: int | None = None,
    names: Sequence[str] = NAMES,
) -> Asked:
    return Asked(text, answer, lambda found, beyond: truths.compared(found, beyond, working_bits, names))


#: Disks around the paper's and unlike it.
_MOSTLY = ("named", "nearby", "nearby", "friction", "near-equal", "spread", "tiny-eccentricity", "heavy")


def cycle(random: Random, families: Sequence[str] = _MOSTLY) -> Asked:
    """The linear law's cycle, to a number of digits: in double if it holds them."""
    parameters, omega, text = _place(random, families)
    digits = random.choice((6, 9, 12))
    return _asked(
        f"limit cycle to {digits} digits {text}",
        Truths(parameters),
        lambda here: followed_cycle(parameters, omega, here.engine, digits=digits),
    )


def cycle_in_double(random: Random, families: Sequence[str] = _MOSTLY, friction: Friction = "linear") -> Asked:
    """A cycle in double, whatever digits that gives."""
    parameters, omega, text = _place(random, families, friction)
    return _asked(
        f"limit cycle ({friction}) in double {text}",
        Truths(parameters),
        lambda here: limit_cycle(parameters, omega, here.engine, precision=DOUBLE),
        53,
    )


def smooth_cycle(
    random: Random, families: Sequence[str] = ("named", "nearby", "nearby", "friction", "spread")
) -> Asked:
    """The smooth law's cycle."""
    parameters, omega, text = _place(random, families, "smooth")
    digits = random.choice((6, 9, 12))
    return _asked(
        f"smooth law's limit cycle to {digits} digits {text}",
        Truths(parameters),
        lambda here: followed_cycle(parameters, omega, here.engine, digits=digits),
    )


def balanced(random: Random, families: Sequence[str] = _MOSTLY) -> Asked:
    """Harmonic balance against shooting."""
    parameters, omega, text = _place(random, families)
    digits = random.choice((6, 9, 12))
    return _asked(
        f"harmonic balance to {digits} digits {text}",
        Truths(parameters),
        lambda here: balanced_cycle(parameters, omega, digits=digits),
        names=("period", "gamma_bar_0", "v_0", "beta_max"),
    )


def branch(
    random: Random, families: Sequence[str] = ("named", "nearby", "nearby", "friction"), speeds: int = 3
) -> Asked:
    """The branch as a function: corrected cycles and interpolated numbers at speeds between its ends."""
    family = random.choice(families)
    parameters = disk(random, family)
    while decay(parameters) > _STIFFEST or criticality(parameters) != "supercritical":
        parameters = disk(random, family)
    shares = [random.choice((random.uniform(0.002, 0.998), log_uniform(random, 0.0011, 0.5))) for _ in range(speeds)]
    truths = Truths(parameters)

    def answer(here: Arithmetic) -> Any:
        omega_h = float(bisect_omega_h(parameters, here.engine, confirm=False).omega_h)
        whole = BranchInterpolant(parameters, here.lanes, omega_h)
        span = whole.omega_crit - omega_h
        omegas = [min(max(omega_h + share * span, whole.lowest), whole.highest) for share in shares]
        return whole.limit_cycles(omegas), whole(omegas)

    def compared(found: Any, beyond: int) -> list[Number]:
        cycles, values = found
        numbers: list[Number] = []
        for n, one in enumerate(cycles):
            numbers += truths.compared(one, beyond, 53)
            truth = truths(one)
            for name, widths in values.uncertainty.items():
                between = Measured.of(float(getattr(values, name)[n]), float(widths[n]))
                numbers.append(printed(f"interpolated {name}", between, fraction(truth[name]), 53))
        return numbers

    places = ", ".join(f"{share!r}" for share in shares)
    return Asked(f"branch at {places} of the way from Omega_h to Omega_crit, {written(parameters)}", answer, compared)
