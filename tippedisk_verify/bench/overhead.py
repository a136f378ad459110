"""What the suite costs beside heyoka's own stepping: the same work through the engine and through a bare integrator."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

from tippedisk_verify.bench.problems import problem_named
from tippedisk_verify.flow.contract import Build, Engine, Request, Result
from tippedisk_verify.flow.system import direction_of, system_of
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.equations import products
from tippedisk_verify.model.precision import DOUBLE, heyoka_module
from tippedisk_verify.orbits.periodic import limit_cycle, shoot

__all__ = ["Overhead", "overheads"]

_PAIRS = 300


@dataclass(frozen=True)
class Overhead:
    """Medians of interleaved pairs."""

    what: str
    suite_seconds: float
    bare_seconds: float
    over_bare: float  #: median of the pairs' ratios, less 1

    def json(self) -> dict[str, Any]:
        return asdict(self)


class _Bare:
    """A heyoka integrator for what a request needs, set off with nothing else done."""

    def __init__(self, request: Request) -> None:
        hy = heyoka_module()
        system = system_of(request.variations, request.divergence, request.events, request.shifted)
        constants = request.parameters.at(DOUBLE)
        omega = DOUBLE.number(request.omega)
        pars = [omega, constants.r, constants.e, constants.a, constants.b, constants.g, constants.k]
        pars += products(constants, omega)[: system.products]
        options = {}
        for kind, make in (("t_events", hy.t_event), ("nt_events", partial(hy.nt_event, callback=_nothing))):
            if events := [event for event in request.events if event.terminal is (kind == "t_events")]:
                options[kind] = [
                    make(system.crossings[event.name], direction=direction_of(hy, event.direction)) for event in events
                ]
        extended = bool(request.variations or request.divergence)
        start = [1.0, 1.0, 0.0] + [0.0] * request.divergence
        self.stepper: Any = hy.taylor_adaptive(system.equations, start, pars=pars, **options)
        self._rest = self.stepper.state[3:].copy() if extended else None

    def __call__(self, start: Any, duration: float) -> None:
        stepper = self.stepper
        stepper.time = 0.0
        if self._rest is None:
            stepper.state[:] = start
        else:
            stepper.state[:3] = start
            stepper.state[3:] = self._rest
            stepper.reset_cooldowns()
        stepper.propagate_until(duration)


def _nothing(stepper: Any, when: float, sign: int) -> None:
    """What happens at an event that ends nothing."""


class _Listening:
    """An engine that keeps what it is asked."""

    name, measures_error = "taylor", True
    builds: tuple[Build, ...] = ()

    def __init__(self, engine: Engine, asked: list[Request]) -> None:
        self._engine, self._asked = engine, asked

    def __call__(self, request: Request) -> Result:
        self._asked.append(request)
        return self._engine(request)


def overheads() -> list[Overhead]:
    """A trajectory of 10 s, and a limit cycle, its Newton iteration and its half-widths, against bare flights."""
    engine = Taylor()
    problem = problem_named("cycle")
    request = problem.request()
    bare = _Bare(request)
    period = problem_named("period")
    guess = period.start[1:]
    flights: list[Request] = []
    shoot(period.parameters, period.omega, guess, _Listening(engine, flights))
    kinds = {asked.variations: _Bare(asked) for asked in flights}
    starts = [(kinds[asked.variations], [DOUBLE.number(part) for part in asked.state]) for asked in flights]

    def bare_flights() -> None:
        for flight, start in starts:
            flight(start, 200.0)

    solve = partial(shoot, period.parameters, period.omega, guess, engine)
    measure = partial(limit_cycle, period.parameters, period.omega, engine, guess=guess)
    return [
        _compared("trajectory", partial(engine, request), partial(bare, problem.start, problem.duration)),
        _compared("Newton iteration for a limit cycle", solve, bare_flights),
        _compared("limit cycle with half-widths, over the same flights", measure, bare_flights),
    ]


def _compared(what: str, suite: Callable[[], Any], bare: Callable[[], Any]) -> Overhead:
    suite(), bare()  # compiled, and warm
    pairs = []
    for number in range(_PAIRS):
        times = {}
        for job in (suite, bare) if number % 2 else (bare, suite):
            begin = time.perf_counter()
            job()
            times[job] = time.perf_counter() - begin
        pairs.append((times[suite], times[bare]))
    return Overhead(
        what,
        statistics.median(pair[0] for pair in pairs),
        statistics.median(pair[1] for pair in pairs),
        statistics.median(a / b for a, b in pairs) - 1,
    )
