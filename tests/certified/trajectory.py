"""States along an orbit to any number of digits, proved: the precision is raised until the enclosure is narrow."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from tippedisk_verify.certified.balls import ball, measured, working_precision
from tippedisk_verify.certified.flow import Flight, Status, carry
from tippedisk_verify.certified.sliding import model_of
from tippedisk_verify.errors import InputError
from tippedisk_verify.model.exact import exact
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import bits_for_digits

__all__ = ["ProvedState", "proved_state"]

_FIRST_GUARD = 30  # bits; half a period loses about 10
_MOST_ATTEMPTS = 8


@dataclass(frozen=True)
class ProvedState:
    """Where one orbit is after a time. ``status`` REACHED is the proof; without it the state is None.

    ``state`` is (beta_bar, gamma_bar, v) [rad, rad, rad/s], angles measured from pi/2. ``upright`` says that the disk
    is proved not to lie flat on the way: |beta_bar| < pi/2.
    """

    status: Status
    bits: int
    steps: int
    state: tuple[Measured, Measured, Measured] | None = None
    upright: bool = False


def proved_state(
    parameters: Parameters,
    omega: object,
    state: Sequence[object],
    duration: object,
    *,
    digits: int = 12,
    most_bits: int = 20_000,
) -> ProvedState:
    """The state after ``duration`` seconds from the exact (beta_bar, gamma_bar, v), each to ``digits`` decimals.

    The inputs are whatever `model.exact.exact` takes; raises InputError for what makes no sense.
    """
    if len(state) != 3:
        raise InputError("a state has three components: beta_bar, gamma_bar, v")
    speed, start, span = exact(omega), [exact(part) for part in state], exact(duration)
    wanted = Fraction(1, 10**digits)
    bits = min(most_bits, bits_for_digits(digits) + _FIRST_GUARD)
    for _ in range(_MOST_ATTEMPTS):
        with working_precision(bits):
            flight = carry(model_of(parameters, ball(speed)), [ball(part) for part in start], ball(span))
            end = _measured(flight)
        if end is not None:
            widest = max(part.uncertainty for part in end)
            if widest <= wanted:
                return ProvedState(flight.status, bits, flight.steps, end, flight.upright)
            lacking = math.ceil(widest / wanted).bit_length() + 4
        else:
            lacking = bits  # how much more it takes cannot be told from a run that broke off
        if flight.status is Status.STEP_LIMIT or bits + lacking > most_bits:
            break
        bits += lacking
    status = flight.status if end is None else Status.TOO_WIDE
    return ProvedState(status, bits, flight.steps)


def _measured(flight: Flight) -> tuple[Measured, Measured, Measured] | None:
    if flight.status is not Status.REACHED:
        return None
    beta_bar, gamma_bar, v = flight.state
    return measured(beta_bar), measured(gamma_bar), measured(v)
