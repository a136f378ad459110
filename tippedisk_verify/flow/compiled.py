"""One stepper of heyoka: compiled for a kind of request, with the callbacks that record its events."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any
from weakref import proxy

from tippedisk_verify.flow.contract import FLAT, SLIDING_REVERSAL, Build, Event, EventRecord, Request
from tippedisk_verify.flow.start import START_WINDOW
from tippedisk_verify.flow.switching import FrictionSign
from tippedisk_verify.flow.system import SWITCH, TURN_OVER, direction_of, parameter_names, system_of
from tippedisk_verify.model.equations import shifted
from tippedisk_verify.model.precision import heyoka_module

__all__ = ["Compiled"]


class Compiled:
    """One stepper of heyoka's, and what is known of it."""

    def __init__(self, request: Request, events: tuple[Event, ...], chosen: dict[str, Any], compact: bool) -> None:
        begin = time.perf_counter()
        self.precision = precision = request.precision
        number, smooth = precision.number, request.friction == "smooth"
        self._ops = shifted(precision.ops) if request.shifted else precision.ops
        self._events, self._smooth, self._divergence = events, smooth, request.divergence
        watched = [event for event in events if smooth and event.function is SLIDING_REVERSAL.function]
        built = [event for event in events if event not in watched]
        system, self._crossings, self._products = system_of(
            request.variations,
            request.divergence,
            (*built, SWITCH, TURN_OVER) if smooth else built,
            request.shifted,
            smooth,
        )
        self._names = parameter_names(request.friction)
        self._records: list[EventRecord] = []
        self._terminal = [event for event in built if event.terminal]
        count = len(self._names) + self._products
        if smooth:
            self._branch = FrictionSign(precision, self._ops, count, watched, self._records)
        options: dict[str, Any] = {"fp_type": precision.type, "compact_mode": compact, **chosen}
        if precision.kind == "real":
            options["prec"] = precision.bits
        if request.tolerance is not None:
            options["tol"] = number(request.tolerance)
        start = [number(1), number(1), number(0)] + [number(0)] * request.divergence
        self._size = len(start)
        self._stepper: Any = heyoka_module().taylor_adaptive(
            system,
            start,
            pars=[number(1)] * (count + smooth),
            t_events=self._ending_events(),
            nt_events=self._passing_events([event for event in built if not event.terminal]),
            **options,
        )
        if smooth:
            # heyoka holds its callbacks where the garbage collector does not see them.
            self._branch.stepper = proxy(self._stepper)
        # What follows the state: the integral of the divergence starts at 0, the derivatives at the identity.
        extended = request.variations or request.divergence
        self._identity = self._stepper.state[3:].copy() if extended else None
        self.build = Build(
            engine="taylor",
            precision=precision.name,
            friction=request.friction,
            variations=request.variations,
            divergence=request.divergence,
            events=(*(event.name for event in events), *((SWITCH.name,) if smooth else ())),
            u_variables=len(self._stepper.decomposition) - self._stepper.dim,
            seconds=time.perf_counter() - begin,
        )

    def _ending_events(self) -> list[Any]:
        """The terminal events of heyoka: those of the request, then those that change the friction law's branch."""
        hy, fp_type = heyoka_module(), self.precision.type
        # An event that has fired is not seen again for as long as a start on its surface lasts. heyoka's own waiting
        # time, made from the tolerance, is too short where the orbit only touches the surface, and too long after a
        # switch of the branch at a loose tolerance: the state there is on the surface to rounding, whatever that is.
        wait = self.precision.number(START_WINDOW)

        def ending(name: str, **options: Any) -> Any:
            return hy.t_event(self._crossings[name], cooldown=wait, fp_type=fp_type, **options)

        events = [ending(event.name, direction=direction_of(event)) for event in self._terminal]
        if self._smooth:  # last, so that heyoka's numbers of the others stay; their callbacks let the run go on
            branch = self._branch  # in plain functions: heyoka copies whatever else it is given
            events.append(ending(SWITCH.name, callback=lambda stepper, sign: branch.switched(sign, stepper.time)))
            if FLAT not in self._terminal:
                events.append(ending(TURN_OVER.name, callback=lambda stepper, sign: branch.turned()))
        return events

    def _passing_events(self, events: Sequence[Event]) -> list[Any]:
        hy, fp_type = heyoka_module(), self.precision.type
        return [
            hy.nt_event(
                self._crossings[event.name],
                self._recorder(event.name),
                direction=direction_of(event),
                fp_type=fp_type,
            )
            for event in events
        ]

    def _recorder(self, name: str) -> Callable[[Any, Any, int], None]:
        records, owned = self._records, self.precision.owned

        def record(stepper: Any, when: Any, sign: int) -> None:
            stepper.update_d_output(when)
            records.append(EventRecord(name, when, owned(stepper.d_output[:3])))

        return record
