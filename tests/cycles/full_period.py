"""Librating cycles over whole periods, without the symmetry, on a section from v < 0 to the next v
< 0.
"""

from __future__ import annotations

from dataclasses import replace

from tippedisk_verify.cycles.shooting.section import LIBRATING
from tippedisk_verify.flow.contract import SECTION, Event

WHOLE_PERIOD = replace(
    LIBRATING,
    name="whole period",
    end_event=Event("closes", SECTION.function, direction=1),
    symmetry_sign=1,
    flights_per_period=1,
)
