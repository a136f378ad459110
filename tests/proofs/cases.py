"""What the tests of proofs share: the numbers of a cycle, exact speeds, flights, and faults
planted in the kernel.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cache
from typing import Any, NamedTuple

import pytest

from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.proofs.kernel.balls import arb, ball, inside, working_precision
from tippedisk_verify.proofs.kernel.certificates import digest
from tippedisk_verify.proofs.kernel.krawczyk import KrawczykResult, apply_krawczyk_operator
from tippedisk_verify.proofs.kernel.poincare_map import (
    LIBRATING_SECTION,
    ROTATING_SECTION,
    PoincareImage,
    PoincareSection,
    enclose_poincare_map,
)
from tippedisk_verify.proofs.kernel.proved_flow import (
    EnclosedField,
    EnclosedFlight,
    FlightStopped,
    FlowStatus,
)
from tippedisk_verify.proofs.kernel.small_matrices import midpoint_inverse
from tippedisk_verify.proofs.search.connection_proof import ConnectionProof, prove_connection
from tippedisk_verify.proofs.search.step_search import FlightStepSearch, rounded_down_to_20_bits

MIN_STEP = 2.0**-40  # s
NUMBERS = (
    "period",
    "gamma_bar_0",
    "v_0",
    "beta_max",
    "multiplier_slow",
    "log_multiplier_slow",
    "log_multiplier_fast",
    "dperiod_domega",
    "dgamma_bar_0_domega",
    "dv_0_domega",
)


class FlowOutcome(NamedTuple):
    """Where all orbits from a box are after a time, proved: in the flight's box.

    A status makes the rest mean nothing.
    """

    status: FlowStatus | None  #: why the time is not reached
    flight: EnclosedFlight
    upright: bool = True  #: |beta_bar| < pi/2 throughout: the disk does not lie flat


def flow_for(
    field: EnclosedField, start: Sequence[Any], duration: object, *, derivatives: bool = False
) -> FlowOutcome:
    """The flow for a positive time from a box of states."""
    flight, span = field.flight(start, FlightStepSearch(), derivatives=derivatives), ball(duration)
    upright, share = True, 1.0
    while True:
        left = span - flight.time  # positive: what was taken is proved to be shorter
        length = share * rounded_down_to_20_bits(float(left.abs_upper()) * (1 + 2.0**-18))
        try:
            step = flight.step(max(length, 2 * MIN_STEP))
        except FlightStopped as fault:
            return FlowOutcome(fault.status, flight)
        if not (left <= step.length or left > step.length):
            share /= 2  # the step ends within the duration's ball
            continue
        share = 1.0
        upright = upright and inside(step.enclosure[0], arb(0, 1.5707))
        if left <= step.length:
            flight.take_step(step, left)
            return FlowOutcome(None, flight, upright)
        flight.take_step(step)


#: What tampers with a certificate.
ChangeOfContent = Callable[[dict[str, Any]], None]


def replace_entry(*path: Any) -> ChangeOfContent:
    """The last of the names is the value, or a function of the old one."""

    def act(content: dict[str, Any]) -> None:
        part: Any = content
        for name in path[:-2]:
            part = part[name]
        part[path[-2]] = path[-1](part[path[-2]]) if callable(path[-1]) else path[-1]

    return act


def sealed(content: dict[str, Any]) -> dict[str, Any]:
    """Write the digest of what a certificate says now."""
    content["sha256"] = digest(content)
    return content


def in_precision(bits: int) -> Any:
    """Return a fixture that works in so many bits throughout each test of a module."""

    @pytest.fixture(autouse=True)
    def context() -> Iterator[None]:
        with working_precision(bits):
            yield

    return context


def hull(low: object, high: object) -> Any:
    """Return a ball that holds two numbers and what lies between them."""
    return ball(low).union(ball(high))


def half_flight(field: EnclosedField, gamma_bar: Any, v: Any, **options: Any) -> PoincareImage:
    """The half map over a box."""
    return enclose_poincare_map(
        field, LIBRATING_SECTION, (gamma_bar, v), FlightStepSearch(), **options
    )


def turn_flight(field: EnclosedField, beta_bar: Any, v: Any, **options: Any) -> PoincareImage:
    """The turn map over a box."""
    return enclose_poincare_map(
        field, ROTATING_SECTION, (beta_bar, v), FlightStepSearch(), **options
    )


def krawczyk_result(
    field: EnclosedField,
    middle: Sequence[Any],
    radii: Sequence[Any],
    section: PoincareSection = LIBRATING_SECTION,
) -> KrawczykResult | None:
    """Krawczyk's test for all speeds of the field at once; None if the map could not be
    followed.
    """
    middle, away = [ball(part).mid() for part in middle], [arb(0, radius) for radius in radii]
    box = [point + part for point, part in zip(middle, away, strict=True)]
    try:
        centre = enclose_poincare_map(field, section, middle, FlightStepSearch())
        over = enclose_poincare_map(field, section, box, FlightStepSearch(), derivatives=True)
    except FlightStopped:
        return None
    return apply_krawczyk_operator(
        [*middle, arb(0)], [*away, arb(0)], (0, 1), midpoint_inverse, centre, over
    )


def box_is_included(field: EnclosedField, middle: Sequence[Any], radii: Sequence[Any]) -> bool:
    """Whether the box passes the test."""
    fixed = krawczyk_result(field, middle, radii)
    return fixed is not None and fixed.included


@cache
def proved_connection() -> ConnectionProof:
    """Omega_h of the printed disk to nine digits: a second or two, once for all tests."""
    return prove_connection(PRINTED, "30.0488682607225", 9)
