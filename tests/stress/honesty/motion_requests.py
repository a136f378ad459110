"""Requests for motion: runs in double with their error estimates, against the same runs in quadruple precision."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from random import Random
from typing import Any

from tests.stress.honesty.comparison import Asked, Number, of_double, unlike
from tests.stress.honesty.draws import FAMILIES, decay, decimal, disk, log_uniform, speed, state, written
from tippedisk_verify.errors import Shortfall
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.contract import SECTION, SLIDING_REVERSAL, TURN, Event, Request, Variation
from tippedisk_verify.model.exact import PI, exact
from tippedisk_verify.model.parameters import Friction
from tippedisk_verify.model.precision import QUADRUPLE, bits
from tippedisk_verify.orbits.half_map import RETURNS, VARIATIONS

__all__ = ["RUNS", "asked_run", "flow"]

_PASSING = tuple(
    Event(f"passing {event.name}", event.function, terminal=False) for event in (SECTION, TURN, SLIDING_REVERSAL)
)
_RETURNS = (Event("next section", SECTION.function), Event("next turn", TURN.function, terminal=False))
_STATE = VARIATIONS
_EVERY: tuple[Variation, ...] = (*_STATE, "r", "e", "a", "b", "g", "k")
_DECAYS = 1000  # of sliding, the longest run: a stiffer disk is followed for a shorter time


@dataclass(frozen=True)
class _Setting:
    """What is compiled: one of a few, because each takes a moment in each arithmetic."""

    friction: Friction
    shifted: bool = False
    events: tuple[Event, ...] = ()
    variations: tuple[Variation, ...] = ()
    divergence: bool = False
    loose: bool = False  #: at a tolerance above round-off
    section: bool = False  #: from beta = pi/2 with v < 0, to the next crossing


_LAWS: tuple[Friction, ...] = ("linear", "smooth")
#: The kinds of runs.
RUNS = {
    "flow": tuple(_Setting(law, shifted) for law in _LAWS for shifted in (False, True)),
    "events": (
        *(_Setting(law, events=_PASSING) for law in _LAWS),
        *(_Setting(law, True, events=_RETURNS) for law in _LAWS),
    ),
    "derivatives": tuple(_Setting(law, variations=_STATE) for law in _LAWS),
    "divergence": tuple(_Setting(law, divergence=True) for law in _LAWS),
    # What Newton's iteration on the half-period map flies, and so is compiled for it already.
    "half periods": tuple(_Setting(law, True, (RETURNS,), _STATE, section=True) for law in _LAWS),
    "derivatives by parameters": (_Setting("linear", variations=_EVERY),),
    "flow at a tolerance": (_Setting("linear", loose=True), _Setting("smooth", loose=True)),
}


def flow(random: Random, what: str, families: Sequence[str] = FAMILIES) -> Asked:
    """A run of a second, or up to ten: its end, samples, events and derivatives."""
    setting = random.choice(RUNS[what])
    parameters = disk(random, random.choice(families))
    omega = speed(random, parameters)
    place = state(random)
    if setting.section:
        place = (exact("pi/2"), place[1], exact(decimal(-log_uniform(random, 1e-3, 20))))
    if setting.shifted:
        place = (place[0] - PI * Fraction(1, 2), place[1] - PI * Fraction(1, 2), place[2])
    longest = min(random.choice((1.0, 1.0, 10.0)), _DECAYS / decay(parameters))
    duration = decimal(longest * random.choice((random.uniform(0.1, 1), log_uniform(random, 1e-4, 1))))
    if random.random() < 0.1:
        duration = -duration / 10  # backward the fast direction explodes
    times = None
    if random.random() < 0.4:
        times = [duration * Fraction(n, 5) for n in range(random.choice((0, 1)), 6)]
    tolerance = random.choice((1e-6, 1e-9, 1e-12, 1e-14)) if setting.loose else None  # each is compiled
    request = Request(
        parameters.with_friction(setting.friction),
        omega,
        place,
        duration,
        shifted=setting.shifted,
        times=times,
        events=setting.events,
        variations=setting.variations,
        divergence=setting.divergence,
        tolerance=tolerance,
        error_estimate=True,
        domain="none" if setting.section else "event",
    )
    text = (
        f"{setting.friction} flow{' (shifted)' if setting.shifted else ''} of {float(duration)!r} s"
        f" at {float(omega)!r} rad/s from ({', '.join(_text(part) for part in place)}){', sampled' if times else ''}"
        f"{', ' + str(len(setting.events)) + ' events' if setting.events else ''}"
        f"{', ' + str(len(setting.variations)) + ' derivatives' if setting.variations else ''}"
        f"{f', tolerance {tolerance}' if tolerance else ''}, {written(parameters)}"
    )
    return asked_run(text, lambda: request)


def _text(value: Any) -> str:
    number = exact(value)
    turns = f"{number.pi_multiple} pi + " if number.pi_multiple else ""
    return f"{turns}{float(number.rational)!r}"


def asked_run(text: str, wanted: Any) -> Asked:
    """Every number of a run in double beside the same run in quadruple precision or wider.

    A refusal says the status, if the run ended otherwise than asked for, or that there is no estimate.
    """
    wanted = cache(wanted)

    @cache
    def truth(beyond: int) -> Any:
        precision = bits(QUADRUPLE.bits + beyond) if beyond else QUADRUPLE
        return default_engine()(replace(wanted(), precision=precision, tolerance=None, error_estimate=False))

    def compared(found: Any, beyond: int) -> list[Number]:
        if not found.status.usable:
            raise Shortfall(f"status {found.status.name}")
        if found.error is None or not all(width < float("inf") for width in found.error.state):
            raise Shortfall("the two runs did not end alike")
        return _compared(wanted(), found, truth(beyond))

    return Asked(text, lambda arithmetic: arithmetic.engine(wanted()), compared)


def _compared(request: Request, found: Any, truth: Any) -> list[Number]:
    error = found.error
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
    if (width := getattr(error, "divergence", None)) is not None:
        numbers.append(of_double("divergence", float(found.divergence), float(width), truth.divergence))
    return numbers


def _columns(what: str, values: Any, widths: Any, truths: Any) -> list[Number]:
    return [
        of_double(f"{what} {name}", float(value), float(width), true)
        for name, value, width, true in zip(("beta", "gamma", "v"), values, widths, truths, strict=True)
    ]
