"""What the tests of proofs share: the numbers of a cycle, exact speeds, flights, and faults planted in the kernel."""

from __future__ import annotations

import inspect
import sys
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from types import ModuleType
from typing import Any

from tippedisk_verify.model.exact import exact
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.proofs.kernel.balls import arb, ball, inside, working_precision
from tippedisk_verify.proofs.kernel.flow import Model, Status, short_float
from tippedisk_verify.proofs.kernel.krawczyk import FixedPoints, fixed_points
from tippedisk_verify.proofs.kernel.section import HALF, TURN, Return, Section, returned
from tippedisk_verify.proofs.kernel.sliding import model_of
from tippedisk_verify.proofs.kernel.step import Step
from tippedisk_verify.proofs.numbers import measured
from tippedisk_verify.proofs.search.steps import Steps, midpoint_inverse
from tippedisk_verify.theory.hopf import omega_crit

SHORTEST_STEP = 2.0**-40  # s
NUMBERS = ("period", "gamma_bar_0", "v_0", "beta_max", "multiplier_slow", "log_multiplier_slow",
           "log_multiplier_fast", "dperiod_domega", "dgamma_bar_0_domega", "dv_0_domega")  # fmt: skip


def plant(monkeypatch: Any, owner: Any, function: str, old: str, new: str) -> None:
    """Replace one piece of the text of a module's or a class's function."""
    original = getattr(owner, function)
    source = textwrap.dedent(inspect.getsource(original))
    assert source.count(old) == 1, old
    names: dict[str, Any] = {}
    source = source.replace(old, new).replace("super()", f"super({getattr(owner, '__name__', '')}, self)")
    exec(source, original.__globals__, names)
    monkeypatch.setattr(owner, function, names[function])


def executed(source: str) -> ModuleType:
    """A module of this text."""
    module = ModuleType("copy_of_a_module")
    sys.modules[module.__name__] = module  # dataclasses look there
    try:
        exec(compile(source, module.__name__, "exec"), module.__dict__)
    finally:
        del sys.modules[module.__name__]
    return module


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


@dataclass(frozen=True)
class Flight:
    """Where all orbits from a box are after a time, proved. Only Status.REACHED makes the rest mean anything."""

    status: Status
    time: Any  #: [s]
    state: tuple[Any, Any, Any]  #: holds the end of every orbit, (beta_bar, gamma_bar, v)
    matrix: tuple[tuple[Any, ...], ...] | None  #: (3, 4): d(end)/d(beta, gamma, v at the start, Omega)
    divergence: Any  #: integral of div f over the run, or None
    steps: int
    upright: bool  #: |beta_bar| < pi/2 throughout: the disk does not lie flat


def carry(
    model: Model,
    start: Sequence[Any],
    duration: object,
    *,
    derivatives: bool = False,
    watch: Callable[[Step], None] | None = None,
) -> Flight:
    """The flow for a positive time from a box of states; ``watch`` is called with every step before it is taken."""
    path, span = model.path(start, Steps(), derivatives=derivatives), ball(duration)
    assert span > 0
    upright = True
    share = 1.0
    while True:
        left = span - path.time  # positive: what was taken is proved to be shorter
        step = path.step(max(share * short_float(float(left.abs_upper()) * (1 + 2.0**-18)), 2 * SHORTEST_STEP))
        if step is None:
            status = path.status or Status.NO_ENCLOSURE
            break
        if not (left <= step.length or left > step.length):
            share /= 2  # the step ends within the duration's ball
            continue
        share = 1.0
        upright = upright and inside(step.enclosure[0], arb(0, 1.5707))
        if watch is not None:
            watch(step)
        if left <= step.length:
            path.take(step, left)
            status = Status.REACHED
            break
        path.take(step)
    return Flight(
        status,
        path.time,
        path.box,
        path.matrix if path.sharp else None,
        path.divergence if path.sharp else None,
        path.steps,
        upright,
    )


def half_flight(model: Model, gamma_bar: Any, v: Any, **options: Any) -> Return:
    """The half map over a box."""
    return returned(model, HALF, (gamma_bar, v), Steps(), **options)


def turn_flight(model: Model, beta_bar: Any, v: Any, **options: Any) -> Return:
    """The turn map over a box."""
    return returned(model, TURN, (beta_bar, v), Steps(), **options)


def fixed_in(model: Model, middle: Sequence[Any], radii: Sequence[Any], section: Section = HALF) -> FixedPoints | None:
    """Krawczyk's test for all speeds of the model at once; None if the map could not be followed."""
    middle, away = [ball(part).mid() for part in middle], [arb(0, radius) for radius in radii]
    box = [point + part for point, part in zip(middle, away, strict=True)]
    centre = returned(model, section, middle, Steps())
    over = returned(model, section, box, Steps(), derivatives=True)
    if not centre.status is over.status is Status.RETURNED:
        return None
    (a, b), (c, d) = over.matrix
    inverse = midpoint_inverse(((a - 1, b), (c, d - 1)))
    return fixed_points([*middle, arb(0)], [*away, arb(0)], (0, 1), inverse, centre, over)


def included(model: Model, middle: Sequence[Any], radii: Sequence[Any]) -> bool:
    """Whether the box passes the test."""
    fixed = fixed_in(model, middle, radii)
    return fixed is not None and fixed.included
