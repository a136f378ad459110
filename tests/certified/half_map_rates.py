"""Half maps with derivatives per second and core, beside the scalar road: the table of docs/certified.md.

    python -m tests.certified.half_map_rates

The printed disk half a rad/s below Omega_crit, speed balls of 1e-5 rad/s, boxes of 1e-6 about the section point of the
cycle.
"""

from __future__ import annotations

import time

import numpy as np

from tippedisk_verify.certified.balls import arb, ball, ball_constants, working_precision
from tippedisk_verify.certified.flow import Model
from tippedisk_verify.certified.lane_flight import half_flights
from tippedisk_verify.certified.lanes import Lanes
from tippedisk_verify.certified.section import half_flight
from tippedisk_verify.model.parameters import PRINTED, Constants

POINT, OMEGA = (1.71628680486, -1.71000216164), 30.38659268864
BOX, SPEEDS = 1e-6, 1e-5


def scalar() -> tuple[float, float]:
    """CPU seconds, and the width of the derivative's first entry."""
    began = time.process_time()
    with working_precision(53):
        model = Model(ball_constants(PRINTED), ball(OMEGA) + arb(0, SPEEDS))
        flight = half_flight(model, *(ball(part) + arb(0, BOX) for part in POINT), derivatives=True)
    return time.process_time() - began, 2 * float(flight.matrix[0][0].rad())


def side_by_side(count: int) -> tuple[float, float]:
    """The same for each of ``count`` boxes, whose middles differ by the last digits of POINT."""
    began = time.process_time()
    constants = Constants(*(Lanes.of([value]) for value in ball_constants(PRINTED)))
    shift = np.linspace(0, 1e-11, count)
    start = [Lanes(part + shift, BOX) for part in POINT]
    found = half_flights(Model(constants, Lanes(np.full(count, OMEGA), SPEEDS)), *start)
    assert found.returned.all()
    return (time.process_time() - began) / count, 2 * float(found.matrix[0][0].radii.max())


def main() -> None:
    alone, width = scalar()
    print(f"| scalar, 53 bits | {1 / alone:.1f} | 1 | {width:.2g} |")
    for count in (1, 100, 10_000):
        seconds, width = side_by_side(count)
        print(f"| {count} | {1 / seconds:.3g} | {alone / seconds:.2g} | {width:.2g} |", flush=True)


if __name__ == "__main__":
    main()
