"""Half-widths of runs where other estimates failed: tiny states, states that no longer change, derivatives."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from random import Random

import numpy
import pytest

from tippedisk_verify.flow import error_estimate
from tippedisk_verify.flow.contract import SECTION, TURN, Event, Request
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.exact import PI, exact, fraction
from tippedisk_verify.model.parameters import PRINTED, Parameters
from tippedisk_verify.model.precision import DOUBLE, QUADRUPLE

_PASSING = tuple(Event(f"each {event.name}", event.function, terminal=False) for event in (SECTION, TURN))


def held(taylor: Taylor, request: Request) -> list[tuple[str, float, float]]:
    """(what, half-width, error) of every number whose half-width does not hold the same run's in 113 bits."""
    mine = taylor(replace(request, error_estimate=True))
    truth = taylor(replace(request, precision=QUADRUPLE))
    pairs = list(zip(mine.state, mine.error.state, truth.state, strict=True))
    records = zip(mine.events, mine.error.events, truth.events, strict=True)
    pairs += [(record.time, width, true.time) for record, width, true in records]
    if mine.derivatives is not None:
        triples = (mine.derivatives, mine.error.variations, truth.derivatives)
        pairs += list(zip(*(numpy.ravel(part) for part in triples), strict=True))
    away = [(float(width), float(abs(fraction(float(value)) - fraction(true)))) for value, width, true in pairs]
    return [(str(number), width, error) for number, (width, error) in enumerate(away) if error > width]


def next_to(side: int, friction: str) -> Iterator[Request]:
    """Starts down to 1e-22 from an equilibrium: heyoka's tolerance is absolute, and truncation prevails there."""
    random = Random(f"{friction}/{side}")
    quarter = PI * Fraction(1, 2)
    for number in range(20):
        size = 10 ** random.uniform(-22, -6)
        away = [random.choice((0, size * random.uniform(-1, 1))) for _ in range(3)]
        start = [exact(0) + exact(away[0]), PI * Fraction(side - 1, 2) + exact(away[1]), exact(away[2])]
        if number % 2:
            start = [DOUBLE.number(part) for part in start]
        if number % 4 > 1:  # the same from angles that are not shifted
            start = [exact(start[0]) + quarter, exact(start[1]) + quarter, start[2]]
        duration = random.choice(("0.001", "0.1", "0.5", "2", "5"))
        yield Request(PRINTED.with_friction(friction), "30.4", start, duration, shifted=number % 4 < 2, domain="none")


@pytest.mark.slow
@pytest.mark.parametrize("friction", ["linear", "smooth"])
@pytest.mark.parametrize("side", [1, -1], ids=["inverted", "noninverted"])
def test_starts_next_to_an_equilibrium(taylor, friction, side) -> None:
    for request in next_to(side, friction):
        assert not held(taylor, request), request


def test_a_budget_without_the_wider_runs_truncation_is_seen(taylor, monkeypatch) -> None:
    """Truncation is no matter of luck: the distance itself is a little less than the error."""
    monkeypatch.setattr(error_estimate, "DISTANCES", 1)
    assert any(held(taylor, request) for request in next_to(1, "smooth"))


def test_a_run_that_settles(taylor) -> None:
    """gamma no longer changes while the rest still decays: all runs from about the same start round alike there."""
    disk = Parameters(
        r="0.0108827", e="0.0048537712616", m="1.81408", A="0.0002765383633122957452398963574308864",
        B="0.0002407260328563258597383426048", g="10.7732", mu="0.235551", epsilon="0.0328552",
    )  # fmt: skip
    start = (exact("pi/2"), "-5.10015", "-1.45367")
    assert not held(taylor, Request(disk, "293.6", start, "0.387824", events=_PASSING))


@pytest.mark.slow
def test_derivatives_of_many_runs(taylor) -> None:
    """What nine eighths of the distance to a wider run did not always hold."""
    random = Random(3)
    names = ("beta", "gamma", "v", "Omega")
    for number in range(25):
        start = [f"{random.uniform(low, high):.6f}" for low, high in ((0.5, 2.6), (-3, 3), (-4, 4))]
        request = Request(
            PRINTED, f"{random.uniform(28, 33):.4f}", start, f"{random.uniform(0.01, 1):.4f}", variations=names,
            domain="none",
        )  # fmt: skip
        assert not held(taylor, request), number
