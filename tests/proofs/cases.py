"""What the tests of proofs share: the numbers of a cycle, exact speeds, and proved states."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from tippedisk_verify.model.exact import exact
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.proofs.kernel.balls import ball, measured, working_precision
from tippedisk_verify.proofs.kernel.flow import Status, carry
from tippedisk_verify.proofs.kernel.sliding import model_of
from tippedisk_verify.theory.hopf import omega_crit

NUMBERS = ("period", "gamma_bar_0", "v_0", "beta_max", "multiplier_slow", "log_multiplier_slow",
           "log_multiplier_fast", "dperiod_domega", "dgamma_bar_0_domega", "dv_0_domega")  # fmt: skip


def speed_below(parameters: Parameters, distance: str | Fraction) -> Fraction:
    """Omega_crit - distance, cut to 40 decimals: an exact speed."""
    return round(omega_crit(parameters, 60).value - Fraction(distance), 40)


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
