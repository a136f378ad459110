"""Requests for motion: runs in double with their error estimates, against the same runs in quadruple precision."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from random import Random
from typing import Any

from tippedisk_verify.errors import Shortfall
from tippedisk_verify.evidence.stress.comparison import Asked, Number, of_double, unlike
from tippedisk_verify.evidence.stress.draws import FAMILIES, decimal, disk, log_uniform, speed, state, written
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.contract import SECTION, SLIDING_REVERSAL, TURN, Event, Request, Variation
from tippedisk_verify.model.equations import Friction
from tippedisk_verify.model.exact import PI, exact
from tippedisk_verify.model.precision import QUADRUPLE

__all__ = ["compared_runs", "flow"]

_PASSING = tuple(
    Event(f"passing {event.name}", event.function, terminal=False) for event in (SECTION, TURN, SLIDING_REVERSAL)
)
_ALL: tuple[Variation, ...] = ("beta", "gamma", "v", "Omega")


@dataclass(frozen=True)
class _Setting:
    """What is compiled: one of a few, because each takes a moment in each arithmetic."""

    friction: Friction
    shifted: bool = False
    events: tuple[Event, ...] = ()
    variations: tuple[Variation, ...] = ()


_SETTINGS = (
    *(_Setting(law, shifted) for law in ("linear", "smooth") for shifted in (False, True)),
    *(_Setting(law, events=_PASSING) for law in ("linear", "smooth")),
    *(_Setting(law, True, events=(SECTION,)) for law in ("linear", "smooth")),
    *(_Setting(law, variations=_ALL) for law in ("linear", "smooth")),
)  # fmt: skip


def flow(random: Random) -> Asked:
    """A run of at most a second: its end, samples, events and derivatives."""
    setting = random.choice(_SETTINGS)
    parameters = disk(random, random.choice(FAMILIES))
    omega = speed(random, parameters)
    place: tuple[Any, ...] = state(random)
    if random.random() < 0.25:  # on the section, where starts usually are
        place = (exact("pi/2"), *place[1:])
    if setting.shifted:
        place = (exact(place[0]) - PI * Fraction(1, 2), exact(place[1]) - PI * Fraction(1, 2), place[2])
    duration = decimal(random.choice((random.uniform(0.1, 1), log_uniform(random, 1e-4, 1))))
    if random.random() < 0.1:
        duration = -duration / 10  # backward the fast direction explodes
    times = None
    if random.random() < 0.4:
        times = [duration * Fraction(n, 5) for n in range(random.choice((0, 1)), 6)]
    request = Request(
        parameters,
        omega,
        place,
        duration,
        friction=setting.friction,
        shifted=setting.shifted,
        times=times,
        events=setting.events,
        variations=setting.variations,
        error_estimate=True,
    )
    text = (
        f"{setting.friction} flow{' (shifted)' if setting.shifted else ''} of {float(duration)!r} s"
        f" at {float(omega)!r} rad/s from ({', '.join(_text(part) for part in place)}){', sampled' if times else ''}"
        f"{', ' + str(len(setting.events)) + ' events' if setting.events else ''}"
        f"{', derivatives' if setting.variations else ''}, {written(parameters)}"
    )
    return Asked(text, lambda: compared_runs(request))


def _text(value: Any) -> str:
    number = exact(value)
    turns = f"{number.pi_multiple} pi + " if number.pi_multiple else ""
    return f"{turns}{float(number.rational)!r}"


def compared_runs(request: Request) -> list[Number]:
    """Every number of a run in double beside the same run in quadruple precision.

    Raises Shortfall with the status if the run ended otherwise than asked for, or without an estimate.
    """
    engine = default_engine()
    found = engine(request)
    if not found.status.usable:
        raise Shortfall(f"status {found.status.name}")
    error = found.error
    if error is None or not all(width < float("inf") for width in error.state):
        raise Shortfall("the two runs did not end alike")
    truth = engine(replace(request, precision=QUADRUPLE, error_estimate=False))
    if found.status is not truth.status or [r.name for r in found.events] != [r.name for r in truth.events]:
        return [unlike("events")]
    numbers = _columns("state", found.state, error.state, truth.state)
    if error.time:
        numbers.append(of_double("time", float(found.time), error.time, truth.time))
    if found.samples is not None:
        if len(found.samples) != len(truth.samples):
            return [unlike("samples")]
        for n, rows in enumerate(zip(found.samples, error.samples, truth.samples, strict=True)):
            numbers += _columns(f"sample {n}", *rows)
    for record, width, true_record in zip(found.events, error.events, truth.events, strict=True):
        numbers.append(of_double(f"time of {record.name}", float(record.time), width, true_record.time))
    if found.derivatives is not None:
        matrices = zip(found.derivatives, error.variations, truth.derivatives, strict=True)
        for name, (values, widths, truths) in zip(("beta", "gamma", "v"), matrices, strict=True):
            for by, value, width, true in zip(request.variations, values, widths, truths, strict=True):
                numbers.append(of_double(f"d{name}/d{by}", float(value), float(width), true))
    return numbers


def _columns(what: str, values: Any, widths: Any, truths: Any) -> list[Number]:
    return [
        of_double(f"{what} {name}", float(value), float(width), true)
        for name, value, width, true in zip(("beta", "gamma", "v"), values, widths, truths, strict=True)
    ]
