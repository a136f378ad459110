"""The integrators that `orbit` needs in double, by heyoka and nothing else: what starting is measured against."""

from __future__ import annotations

from typing import Any

__all__ = ["build"]


def build() -> None:
    import heyoka as hy
    import numpy

    from tippedisk_verify.flow.system import direction_of, system_of
    from tippedisk_verify.orbits.half_map import RETURNS, VARIATIONS
    from tippedisk_verify.orbits.periodic import EXTREME

    # The iteration with derivatives; the numbers with the divergence; both again in extended, and the chord steps.
    shapes: tuple[Any, ...] = ((VARIATIONS, False, (RETURNS,)), ((), True, (RETURNS, EXTREME)), ((), False, (RETURNS,)))
    for number in (float, numpy.longdouble):
        for variations, divergence, events in shapes[: 2 if number is float else 3]:
            system, crossings, products = system_of(variations, divergence, events, True)
            turned = direction_of(hy, RETURNS.direction)
            options = {"t_events": [hy.t_event(crossings[RETURNS.name], direction=turned, fp_type=number)]}
            if EXTREME in events:
                options["nt_events"] = [hy.nt_event(crossings[EXTREME.name], lambda *given: None, fp_type=number)]
            hy.taylor_adaptive(
                system,
                [number(1), number(1), number(0)] + [number(0)] * divergence,
                pars=[number(1)] * (7 + products),
                fp_type=number,
                compact_mode=number is not float,
                **options,
            )
