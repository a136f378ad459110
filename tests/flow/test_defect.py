"""The error of a run from its defect, against runs of sixty digits, and its limits."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from itertools import product
from typing import Any

import numpy
import pytest

from tippedisk_verify import (
    EXTENDED,
    PRINTED,
    QUADRUPLE,
    Disk,
    Event,
    Precision,
    Request,
    Taylor,
    precision_of_bits,
)
from tippedisk_verify.flow import half_widths_by_defect
from tippedisk_verify.flow.contract import SECTION, SLIDING_REVERSAL
from tippedisk_verify.flow.defect import Defect
from tippedisk_verify.model.parameters import Friction

TRUTH = precision_of_bits(200)
LAWS: tuple[Friction, ...] = ("linear", "smooth")
START = ("pi/2", "pi/2 + 0.4", 0)
PASSED = (
    Event("each section", SECTION.function, terminal=False),
    Event("each reversal", SLIDING_REVERSAL.function, terminal=False),
)
#: Half a radian from the noninverted state; on the section; on the surface where the smooth law
#: switches; backward.
REQUESTS = [
    Request(PRINTED, "30.4", START, 3, events=PASSED),
    Request(PRINTED, "30.05", ("pi/2", "-pi/2", "1e-3"), 2),
    Request(PRINTED, "31.4", ("1.2", "pi/2", "2"), 1),
    Request(PRINTED, "30.7", ("2.1", "3.0", "0.7"), "-0.05"),
    Request(PRINTED.changed(e="0.02", mu="1.1"), "23", ("1.4", "0.1", "-3"), "0.7", events=PASSED),
]


def series_of(taylor: Taylor, request: Request, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return the series that the engine keeps for an error estimate."""
    kept: list[Any] = []
    monkeypatch.setattr(
        "tippedisk_verify.flow.half_widths_by_defect.half_widths_from_defect",
        lambda _, result: kept.append(result.series),
    )
    taylor(replace(request, error_estimate=True))
    return kept[0]


def missed(found: Defect, wide: Precision, request: Request, truth: Any) -> Any:
    """Return the error of the run and of its estimate at the end, in carried roundings."""
    places, errors, roundings = found.evaluate_at(wide.array([request.duration]))
    exact = [
        TRUTH.mpf(true) - TRUTH.mpf(wide.mpf(place))
        for true, place in zip(truth.state, places[:, 0], strict=True)
    ]
    return (
        numpy.array(
            [float(part - TRUTH.mpf(float(e))) for part, e in zip(exact, errors[:, 0], strict=True)]
        )
        / roundings[:, 0]
    )


@pytest.mark.parametrize("friction", LAWS)
@pytest.mark.slow
def test_more_nodes_and_wider_arithmetic_miss_less(
    taylor: Taylor, friction: Friction, monkeypatch
) -> None:
    request = Request(PRINTED.with_friction(friction), "30.4", START, 3)
    truth = taylor(replace(request, precision=TRUTH))
    series = series_of(taylor, request, monkeypatch)
    found = [
        abs(missed(Defect(request, series, QUADRUPLE, nodes), QUADRUPLE, request, truth)).max()
        for nodes in (3, 5, 8)
    ]
    # What is missed falls with the nodes, by far more than this
    assert found[0] > 4 * found[1] > 16 * found[2]
    # Carried roundings of extended arithmetic are 2^-11 of those of doubles, and a field has some
    # ten of them.
    assert (
        abs(missed(Defect(request, series, EXTENDED, 8), EXTENDED, request, truth)).max()
        < 10 * 2.0**-11
    )


def test_a_second_sweep_removes_the_error_of_second_order(taylor: Taylor, monkeypatch) -> None:
    """Start with an error of 1e-7, whose square is far larger than the roundings."""
    request = Request(PRINTED, "30.4", START, 3)
    series = series_of(taylor, request, monkeypatch)
    away = replace(request, state=("pi/2", "pi/2 + 0.4000001", 0))
    truth = taylor(replace(away, precision=TRUTH))
    found = Defect(away, series, QUADRUPLE, 12)
    before = abs(missed(found, QUADRUPLE, away, truth)).max()
    found.sweep()
    after = abs(missed(found, QUADRUPLE, away, truth)).max()
    assert before > 1
    # The start is moved by 1e-7: what is left is of second order.
    assert after < 1e-4 * before


@pytest.mark.parametrize(
    ("number", "digits"),
    [
        *((number, 12) for number in range(len(REQUESTS))),
        (3, 25),
        *(
            pytest.param(number, digits, marks=pytest.mark.slow)
            for number, digits in product(range(len(REQUESTS)), (15, 20, 25))
            if (number, digits) != (3, 25)
        ),
    ],
)
def test_half_widths_hold(taylor: Taylor, number: int, digits: int) -> None:
    law = LAWS[(number + digits // 5) % 2]
    request = replace(REQUESTS[number], parameters=REQUESTS[number].parameters.with_friction(law))
    times = [Fraction(request.duration) * Fraction(n, 7) for n in range(8)]
    mine = taylor(replace(request, times=times, error_estimate=True, digits=digits))
    truth = taylor(replace(request, times=times, precision=TRUTH))
    assert mine.status is truth.status
    triples = [
        (mine.state, mine.error.state, truth.state),
        (mine.samples, mine.error.samples, truth.samples),
    ]
    records = zip(mine.events, mine.error.events, truth.events, strict=True)
    triples += [([one.time], [width], [true.time]) for one, width, true in records]
    for values, widths, exact in triples:
        for value, width, true in zip(
            *(numpy.ravel(part) for part in (values, widths, exact)), strict=True
        ):
            assert abs(TRUTH.mpf(value) - TRUTH.mpf(true)) <= float(width)
            # The digits asked for; twelve are not checked, as doubles may lose some
            assert digits == 12 or float(width) <= 10.0 ** (1 - digits) * max(
                1.0, abs(float(value))
            )


def test_half_widths_hold_without_extended_arithmetic(taylor: Taylor, monkeypatch) -> None:
    """Check as on processors without 80-bit registers."""
    monkeypatch.setattr(half_widths_by_defect, "_has_arrays_of", lambda wide: wide is not EXTENDED)
    for digits in (12, 15):
        test_half_widths_hold(taylor, 1, digits)


@pytest.mark.parametrize("law", [pytest.param("linear", marks=pytest.mark.slow), "smooth"])
def test_digits_beyond_the_defect_come_from_wider_runs(taylor: Taylor, law: Friction) -> None:
    """Run backward along the stiff direction: errors in doubles are as large as the state."""
    disk = Disk("table1", friction=law)
    sol = disk.integrate("30.4", ("1.3", "2", "0.3"), "-0.4", digits=20)
    truth = taylor(
        Request(disk, "30.4", ("1.3", "2", "0.3"), "-0.4", precision=precision_of_bits(400))
    )
    for value, width, true in zip(sol.end.state, sol.end.uncertainty, truth.state, strict=True):
        assert not numpy.isfinite(width) or abs(
            precision_of_bits(400).mpf(value) - precision_of_bits(400).mpf(true)
        ) <= float(width)


def test_a_near_touch_is_left_to_wider_runs(taylor: Taylor, monkeypatch) -> None:
    """Check that an event is not denied if the run misses it by less than its error."""
    request = Request(PRINTED, "30.4", START, 1)
    near = taylor(replace(request, events=(Event("extreme", SECTION.function, terminal=False),)))
    extreme = float(near.events[-1].state[1])  # where cos(beta) = 0, gamma turns
    found: list[bool] = []
    estimate = half_widths_by_defect.half_widths_from_defect

    def asked(*both: Any) -> Any:
        answer = estimate(*both)
        found.append(answer is not None)
        return answer

    monkeypatch.setattr(
        "tippedisk_verify.flow.half_widths_by_defect.half_widths_from_defect", asked
    )
    for level in (extreme, extreme + 1e-3, extreme - 1e-3):
        event = Event(
            "level",
            lambda ops, constants, omega, beta, gamma, v, level=level: gamma - level,
            terminal=False,
        )
        taylor(replace(request, events=(event,), error_estimate=True))
    assert found[0] is False
    assert found[1:] == [True, True]
