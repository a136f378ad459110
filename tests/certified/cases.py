"""Random limit cycles of the ordinary road, for the proofs to be held against; and states along an orbit, proved."""

from __future__ import annotations

import random
from collections.abc import Sequence
from fractions import Fraction

from tippedisk_verify.certified.balls import ball, measured, working_precision
from tippedisk_verify.certified.flow import Status, carry
from tippedisk_verify.certified.sliding import model_of
from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.exact import exact
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import PRINTED, Parameters
from tippedisk_verify.orbits.periodic import LimitCycle, limit_cycle
from tippedisk_verify.theory.hopf import omega_crit

NUMBERS = ("period", "gamma_bar_0", "v_0", "beta_max", "multiplier_slow", "log_multiplier_slow",
           "log_multiplier_fast", "dperiod_domega", "dgamma_bar_0_domega", "dv_0_domega")  # fmt: skip
_VARIED = ("r", "e", "m", "A", "B", "g", "mu", "epsilon")


def speed_below(parameters: Parameters, distance: str | Fraction) -> Fraction:
    """Omega_crit - distance, cut to 40 decimals: an exact speed."""
    return round(omega_crit(parameters, 60).value - Fraction(distance), 40)


def random_parameters(rng: random.Random) -> Parameters:
    """Each value within 3 % of Table 1's: of these most have a cycle half a radian per second below Omega_crit."""
    while True:
        changed = {
            name: getattr(PRINTED, name) * (1 + Fraction(rng.randint(-30_000, 30_000), 1_000_000)) for name in _VARIED
        }
        try:
            return PRINTED.changed(**changed)
        except InputError:
            continue


def random_cycle(rng: random.Random, taylor: Taylor, digits: int) -> tuple[Parameters, Fraction, LimitCycle]:
    """A set, a speed and its cycle with half-widths, by shooting in a heyoka arithmetic of that many digits."""
    while True:
        parameters = random_parameters(rng)
        omega = speed_below(parameters, Fraction(rng.randint(20, 600), 1000))
        try:
            return parameters, omega, limit_cycle(parameters, omega, taylor, digits=digits)
        except (InputError, Shortfall):  # no cycle there, or not found
            continue


def proved_state(
    parameters: Parameters, omega: object, state: Sequence[object], duration: object, bits: int
) -> list[Measured]:
    """(beta_bar, gamma_bar, v) after ``duration`` from the exact start: an enclosure computed with so many bits."""
    with working_precision(bits):
        flight = carry(
            model_of(parameters, ball(exact(omega))), [ball(exact(part)) for part in state], ball(exact(duration))
        )
        assert flight.status is Status.REACHED
        assert flight.upright
        return [measured(part) for part in flight.state]
