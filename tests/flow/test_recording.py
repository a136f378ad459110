"""Samples and continuous output in MPFR numbers, and samples of runs that start on a surface."""

from __future__ import annotations

from fractions import Fraction

import numpy
import pytest

from tippedisk_verify import (
    DOUBLE,
    EXTENDED,
    PRINTED,
    QUADRUPLE,
    InputError,
    Request,
    Status,
    Taylor,
    precision_of_bits,
)
from tippedisk_verify.flow.contract import SECTION
from tippedisk_verify.model.parameters import Friction
from tippedisk_verify.numbers.exact import fraction

R = precision_of_bits(160)
START = ("1.2", "0.4", "-0.5")
ON_SECTION = ("pi/2", "2.1", "-1")
_WIDE = precision_of_bits(224)


def truth(taylor: Taylor, start, time, friction: Friction = "linear", **options) -> list[Fraction]:
    """Return the state at one time, by a separate run without other outputs."""
    if not fraction(_WIDE.number(time)):
        return [fraction(_WIDE.number(part)) for part in start]
    request = Request(
        PRINTED.with_friction(friction), "30.4", start, time, precision=_WIDE, **options
    )
    return [fraction(x) for x in taylor(request).state]


def away(state, exact) -> float:
    return max(
        float(abs(fraction(mine) - theirs)) for mine, theirs in zip(state, exact, strict=True)
    )


@pytest.mark.parametrize(
    ("friction", "times"),
    [
        ("linear", ("0", "0.001", "0.11", "0.2")),
        ("smooth", ("0", "-0.001", "-0.02", "-0.04")),
    ],
)
def test_samples_and_dense_output_are_those_of_single_runs(taylor, friction, times) -> None:
    request = Request(
        PRINTED.with_friction(friction),
        "30.4",
        START,
        times[-1],
        precision=R,
        times=times,
        domain="none",
    )
    plain, both = taylor(request), taylor(Request(**{**vars(request), "dense": True}))
    for k, time in enumerate(times):
        exact = truth(taylor, START, time, friction=friction, domain="none")
        for state in (plain.samples[k], both.samples[k], both.dense([time])[0]):
            # A hundred roundings of 7, times the growth backwards
            assert away(state, exact) < 1e-43
    assert (plain.state == both.state).all()


@pytest.mark.parametrize("precision", [DOUBLE, EXTENDED, R], ids=lambda p: p.name)
@pytest.mark.slow
def test_samples_before_a_start_on_a_surface_is_left(taylor, precision) -> None:
    times = ("0", "1e-10", "9e-10", "0.1")
    wanted = {"precision": precision, "times": times, "events": (SECTION,), "error_estimate": True}
    result = taylor(Request(PRINTED, "30.4", ON_SECTION, "0.1", **wanted))
    assert len(result.samples) == 4
    for state, widths, time in zip(result.samples, result.error.samples, times, strict=True):
        exact = truth(taylor, ON_SECTION, time)
        assert away(state, exact) < 64 * float(precision.epsilon)
        for mine, width, right in zip(state, widths, exact, strict=True):
            assert abs(fraction(mine) - right) <= fraction(width)
    early = taylor(
        Request(
            PRINTED,
            "30.4",
            ON_SECTION,
            "0.1",
            precision=precision,
            times=times[:2],
            events=(SECTION,),
        )
    )
    assert away(early.samples[1], truth(taylor, ON_SECTION, "1e-10")) < 64 * float(
        precision.epsilon
    )


def test_a_run_that_ends_early_has_the_samples_up_to_there(taylor) -> None:
    times = [f"0.{k}" for k in range(1, 10)]
    for events, status in (((SECTION,), Status.EVENT), ((), Status.FLAT)):
        start = START if events else ("0.2", "0.4", "-20")
        results = [
            taylor(
                Request(
                    PRINTED, "30.4", start, "0.9", precision=precision, times=times, events=events
                )
            )
            for precision in (QUADRUPLE, R)
        ]
        assert {result.status for result in results} == {status}
        assert len(results[0].samples) == len(results[1].samples) < 9
        for mine, theirs in zip(results[1].samples, results[0].samples, strict=True):
            # Quadruple precision: a hundred roundings of states of size 10, grown by less than 100
            assert away(mine, [fraction(part) for part in theirs]) < 100 * 10 * 100 * 2.0**-113


def test_the_last_sample_may_be_a_rounding_of_a_double_later_than_the_end(taylor) -> None:
    times = numpy.linspace(0, 0.1, 5)  # 0.1 as a double is more than 0.1
    disk = PRINTED.with_friction("smooth")
    result = taylor(Request(disk, "30.4", START, "0.1", precision=R, times=times))
    assert len(result.samples) == 5
    exact = truth(taylor, START, times[4], friction="smooth")
    # A hundred roundings of 7, grown by less than ten in 0.1 s
    assert away(result.samples[4], exact) < 100 * 7 * 10 * 2.0**-160


def test_times_are_distinguished_in_the_requested_arithmetic(taylor) -> None:
    close = ("0.1", "0.10000000000000000001")
    assert (
        len(taylor(Request(PRINTED, "30.4", START, "0.2", precision=R, times=close)).samples) == 2
    )
    with pytest.raises(InputError, match="monotonic"):
        taylor(Request(PRINTED, "30.4", START, "0.2", times=close))


@pytest.mark.parametrize("precision", [DOUBLE, QUADRUPLE, R], ids=lambda p: p.name)
def test_a_run_of_no_length_stands_at_its_start(taylor, precision) -> None:
    result = taylor(Request(PRINTED, "30.4", START, 0, precision=precision, times=(0,), dense=True))
    for state in (result.samples[0], result.dense([0])[0], result.state):
        assert [fraction(part) for part in state] == [
            fraction(precision.number(part)) for part in START
        ]


@pytest.mark.parametrize("precision", [DOUBLE, EXTENDED, QUADRUPLE, R], ids=lambda p: p.name)
def test_times_may_be_any_sequence_of_numbers(taylor, precision) -> None:
    times = [Fraction(1, 8), Fraction(1, 4)]
    kinds = [
        times,
        precision.array(times),
        numpy.array([0.125, 0.25]),
        ["0.125", "1/4"],
        (0.125, 0.25),
    ]
    results = [
        taylor(Request(PRINTED, "30.4", START, "0.25", precision=precision, times=kind))
        for kind in kinds
    ]
    assert all((result.samples == results[0].samples).all() for result in results)
    dense = taylor(Request(PRINTED, "30.4", START, "0.25", precision=precision, dense=True)).dense
    rows = dense(["0.125", Fraction(1, 8), precision_of_bits(300).number("0.125")])
    assert all((row == results[0].samples[0]).all() for row in rows)
    with pytest.raises(InputError):
        dense([float("nan")])
