"""Limit cycles that are hard to compute: near the family's ends, or with tiny multipliers."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import partial

from tippedisk_verify.connection.bisection import bisect_omega_h
from tippedisk_verify.cycles.near_omega_h.cycle_at_distance import cycle_above_omega_h
from tippedisk_verify.cycles.near_omega_h.cycles_by_broyden import cycle_by_broyden
from tippedisk_verify.cycles.shooting.section import LIBRATING
from tippedisk_verify.cycles.shooting.shoot import shoot_limit_cycle
from tippedisk_verify.errors import AccuracyError, NoSuchCycleError
from tippedisk_verify.flow import default_engine
from tippedisk_verify.model.parameters import PRINTED, Parameters
from tippedisk_verify.numbers.exact import exact
from tippedisk_verify.omega_h.methods import heteroclinic
from tippedisk_verify.stress.case import CaseOutcome, StressCase, check_refusal, compare_numbers
from tippedisk_verify.theory.hopf import omega_crit

__all__ = ["CASES"]

_MAIN_NUMBERS = ("period", "gamma_bar_0", "v_0", "beta_max")
_EXPONENTS = ("log_multiplier_slow", "log_multiplier_fast")


def _below_hopf(distance: str) -> Fraction:
    # The speed is an exact decimal, so Omega_crit is rounded to far less than the distance.
    return Fraction(omega_crit(PRINTED, 60).decimals()[0]) - exact(distance).rational


def _near_hopf(distance: str) -> CaseOutcome:
    speed = _below_hopf(distance)
    answer, reference = (
        shoot_limit_cycle(PRINTED, speed, default_engine(), digits=digits) for digits in (12, 40)
    )
    return compare_numbers(answer, reference, _MAIN_NUMBERS)


def _near_omega_h(distance: str) -> CaseOutcome:
    answer, reference = (
        cycle_above_omega_h(PRINTED, exact(distance).rational, default_engine(), digits=digits)
        for digits in (12, 25)
    )
    return compare_numbers(answer, reference, ("period", "gamma_bar_0", "v_0"))


def _omega_h_by_two_methods() -> CaseOutcome:
    """Compute Omega_h by bisection in doubles and to 40 digits by another method, and compare.

    Return how many digits agree, and whether the half-widths overlap.
    """
    return compare_numbers(
        bisect_omega_h(PRINTED, default_engine()),
        heteroclinic(PRINTED, default_engine(), digits=40),
        ("omega_h",),
    )


def _one_ulp_above() -> CaseOutcome:
    """Compute the period at the next double above Omega_h, and compare it with more digits.

    T must be right for exactly this double.
    """
    engine = default_engine()
    omega_h = heteroclinic(PRINTED, engine, digits=50).omega_h
    speed = Fraction(float(omega_h))
    if speed <= omega_h.value:
        speed = Fraction(math.nextafter(float(speed), math.inf))
    answer = cycle_by_broyden(LIBRATING, PRINTED, speed, omega_h.value, engine, digits=12)
    reference = cycle_above_omega_h(PRINTED, speed - omega_h.value, engine, digits=14)
    return compare_numbers(answer, reference, ("period",))


def _one_ulp_below() -> CaseOutcome:
    """Check that a cycle at the next double below Omega_h is refused, because none exists there."""
    engine = default_engine()
    omega_h = heteroclinic(PRINTED, engine, digits=30).omega_h
    speed = Fraction(float(omega_h))
    if speed >= omega_h.value:
        speed = Fraction(math.nextafter(float(speed), 0.0))
    return check_refusal(
        lambda: shoot_limit_cycle(PRINTED, speed, engine), NoSuchCycleError, AccuracyError
    )


def _underflow() -> CaseOutcome:
    """Compute a cycle at epsilon = 1e-3, and compare it with more digits.

    The fast multiplier (about 1e-5000) underflows, but its logarithm does not.
    """
    parameters = PRINTED.changed(epsilon="1e-3")
    answer, reference = (
        shoot_limit_cycle(parameters, _below_hopf("0.3"), default_engine(), digits=digits)
        for digits in (12, 30)
    )
    outcome = compare_numbers(answer, reference, (*_MAIN_NUMBERS, *_EXPONENTS))
    exponent = float(answer.log_multiplier_fast) / 2.302585092994046
    return CaseOutcome(
        outcome.outcome,
        outcome.digits,
        outcome.honest and exponent < -324,
        f"fast multiplier 1e{exponent:.0f}",
    )


def _subcritical() -> Parameters:
    """Return a disk whose limit cycles are born above Omega_crit, unstable.

    It has A / Bbar = 1.02, below the limit of 1.036.
    """
    return PRINTED.changed(A=PRINTED.Bbar * Fraction(102, 100))


def _beyond_the_fold() -> CaseOutcome:
    parameters = _subcritical()
    speed = Fraction(omega_crit(parameters, 30).decimals()[0]) - Fraction(1, 10)
    answer, reference = (
        shoot_limit_cycle(parameters, speed, default_engine(), digits=digits) for digits in (12, 30)
    )
    return compare_numbers(answer, reference, _MAIN_NUMBERS)


def _no_cycle_above() -> CaseOutcome:
    return check_refusal(
        lambda: shoot_limit_cycle(PRINTED, _below_hopf("-0.01"), default_engine()), NoSuchCycleError
    )


def _subcritical_connection() -> CaseOutcome:
    answer, reference = (
        heteroclinic(_subcritical(), default_engine(), digits=digits) for digits in (12, 30)
    )
    outcome = compare_numbers(answer, reference, ("omega_h",))
    return CaseOutcome(
        outcome.outcome, outcome.digits, outcome.honest, f"Omega_h = {answer.omega_h}"
    )


CASES: tuple[StressCase, ...] = (
    *(
        StressCase(
            f"Hopf - {text}",
            "the cycle this close below Omega_crit [rad/s]",
            partial(_near_hopf, text),
            11,
        )
        for text in ("1e-3", "1e-6")
    ),
    *(
        StressCase(
            f"Hopf - {text}",
            "amplitude about its square root; Newton's matrix nearly singular",
            partial(_near_hopf, text),
            11,
            ("digits", "NoSuchCycleError", "AccuracyError"),
            quick=False,
        )
        for text in ("1e-10", "1e-14")
    ),
    *(
        StressCase(
            f"Omega_h + {text}",
            "the cycle this close above Omega_h [rad/s]",
            partial(_near_omega_h, text),
            11,
            quick=text == "1e-6",
        )
        for text in ("1e-6", "1e-12", "1e-30")
    ),
    StressCase(
        "Omega_h in double",
        "bisection in double against 40 digits",
        _omega_h_by_two_methods,
        14,
    ),
    StressCase(
        "an ulp above Omega_h",
        "the next double: its distance is known only if Omega_h is known beyond double",
        _one_ulp_above,
        11,
        quick=False,
    ),
    StressCase(
        "an ulp below Omega_h",
        "no cycle exists: the request must be refused",
        _one_ulp_below,
        0,
        ("NoSuchCycleError", "AccuracyError"),
        quick=False,
    ),
    StressCase(
        "multipliers that underflow",
        "epsilon = 1e-3: logarithms with all their digits",
        _underflow,
        11,
        quick=False,
    ),
    StressCase(
        "subcritical, below",
        "a disk whose cycles are born above Omega_crit: beyond their fold",
        _beyond_the_fold,
        11,
    ),
    StressCase(
        "above Omega_crit",
        "no cycle of the printed disk",
        _no_cycle_above,
        0,
        ("NoSuchCycleError",),
    ),
    StressCase(
        "connection of a subcritical disk",
        "a connection exists for such a disk too",
        _subcritical_connection,
        11,
        quick=False,
    ),
)
