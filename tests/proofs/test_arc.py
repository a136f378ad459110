"""Arcs of limit cycles: true orbits, derivatives and cycles lie in what is proved."""

from __future__ import annotations

import json
from collections.abc import Callable
from fractions import Fraction
from functools import lru_cache
from types import SimpleNamespace
from typing import Any

import pytest

from tests.problems import speed_below
from tippedisk_verify import PRINTED, Precision, Request
from tippedisk_verify.cycles.shooting.section import SECTION_RETURN
from tippedisk_verify.flow import default_engine
from tippedisk_verify.proofs.ball_conversions import ball_constants, ball_to_measured
from tippedisk_verify.proofs.kernel import certificates, half_map_of_curves
from tippedisk_verify.proofs.kernel.balls import arb, ball, working_precision
from tippedisk_verify.proofs.kernel.half_map_of_curves import (
    UNKNOWN_INDICES,
    ArcTest,
    krawczyk_test_of_arc,
)
from tippedisk_verify.proofs.kernel.jets import Jet
from tippedisk_verify.proofs.kernel.step import evaluate_polynomial
from tippedisk_verify.proofs.search.arc_evidence import CurveStepSearch, family_polynomials
from tippedisk_verify.proofs.search.cycle_proof import CycleProof, prove_cycle

OMEGA = speed_below(PRINTED, "0.5")
GUESS = ("1.7162868", "-1.7100021")
LIBRATING_SECTION = "0.546422"  # s, half the period there
RADIUS = "1e-3"  # rad/s
#: A disk, and a start from which beta_bar falls to -0.66, with its speed.
WIDE, SWING = PRINTED.changed(e="0.008", C=None), ("2.2", "-5.71", "35.57")


@lru_cache(maxsize=4)
def cycle(s: Fraction) -> CycleProof:
    return prove_cycle(PRINTED, OMEGA + s * Fraction(RADIUS), GUESS, digits=40)


def curve(
    radius: str,
    spread: str,
    degree: int,
    start: Any = (*GUESS, OMEGA),
    half: str = LIBRATING_SECTION,
) -> half_map_of_curves.Curve:
    """A line through a start, by default the cycle's, with deviations in all three numbers."""
    middle = [ball(part).mid() for part in start]
    slopes = [ball(radius) * factor for factor in (-3, 2, 1)]
    jets = [
        Jet([part, slope.mid(), *[arb(0)] * (degree - 1)])
        for part, slope in zip(middle, slopes, strict=True)
    ]
    total = Jet([ball(half).mid(), ball(radius).mid(), *[arb(0)] * (degree - 1)])
    return half_map_of_curves.Curve(jets[0], jets[1], jets[2], [arb(0, ball(spread))] * 3, total)


@lru_cache(maxsize=1)
def flown() -> tuple[
    half_map_of_curves.Curve, half_map_of_curves.HalfMapEnclosure, list[dict[str, Any]]
]:
    """A curve with deviations in all three numbers, its flight and the flight's log."""
    with working_precision(64):
        line, proposer = curve("3e-4", "1e-5", 2, SWING, "0.3086"), CurveStepSearch()
        return (
            line,
            half_map_of_curves.enclose_half_map(ball_constants(WIDE), line, proposer),
            proposer.log,
        )


@pytest.mark.slow(minutes=0.3)
def test_points_of_the_box_return_as_the_integrator_finds() -> None:
    """With the numbers of the flight's first return, in 200 bits, from ends and from inside
    of the box.
    """
    line, half_map, _ = flown()
    for s, signs in (
        (-1, (1, 1, 1)),
        (Fraction(1, 3), (-1, 1, 0)),
        (1, (0, -1, 1)),
        (Fraction(1, 2), (0, 0, 0)),
    ):
        with working_precision(250):
            start = [
                evaluate_polynomial(jet.coefficients, ball(s)) + sign * ball("1e-5")
                for jet, sign in zip((line.gamma_bar, line.v, line.omega), signs, strict=True)
            ]
            *image, time, divergence = integrated(
                *(ball_to_measured(part.mid()).value for part in start)
            )
            assert evaluate_polynomial(half_map.divergence.coefficients, ball(s)).contains(
                divergence
            )
            if not any(signs):
                assert evaluate_polynomial(half_map.curve_time.coefficients, ball(s)).contains(time)
            for own, row, x in zip(
                (*half_map.image, half_map.curve_time),
                (*half_map.image_by_start, half_map.time_by_start),
                (*image, time),
                strict=True,
            ):
                moved = sum(
                    evaluate_polynomial(entry.coefficients, ball(s)) * sign
                    for entry, sign in zip(row, signs, strict=True)
                ) * ball("1e-5")
                assert (evaluate_polynomial(own.coefficients, ball(s)) + moved).contains(x)


@lru_cache(maxsize=4)
def integrated(gamma_bar: Fraction, v: Fraction, omega: Fraction) -> list[Any]:
    """S of the first return (gamma_bar, v), its time and the divergence's integral, by the
    integrator in 200 bits.
    """
    request = Request(
        WIDE,
        omega,
        (0, gamma_bar, v),
        2,
        shifted=True,
        precision=Precision("real", 200),
        domain="none",
        divergence=True,
        events=(SECTION_RETURN,),
    )
    result = default_engine()(request)
    return [
        ball(str(part))
        for part in (-result.state[1], -result.state[2], result.time, result.divergence)
    ]


#: of a log's entries: what is done to them, and what is said
SPOILED_LOGS: dict[str, tuple[Callable[[list[Any]], Any], str]] = {
    "a step is three times as long": (
        lambda log: log[5].update(share=str(3 * float(log[5]["share"]))),
        "enclosure|return|move|section|further steps",
    ),
    "a step is negative": (lambda log: log[5].update(share="-0.001"), "enclosure"),
    "a step is missing": (lambda log: log.pop(3), "return|move|section|missing"),
    "the last step is missing": (lambda log: log.pop(), "missing|no further steps"),
    "there are no steps": (lambda log: log.clear(), "no further steps"),
    "axes have no inverse": (
        lambda log: log[4].update(axes=[log[4]["axes"][0], *log[4]["axes"][::2]]),
        "enclosure",
    ),
    "axes are missing": (lambda log: log[4].pop("axes"), "missing"),
}


@pytest.mark.slow(minutes=0.4)
def test_a_log_gives_the_flight_again_and_a_spoiled_one_gives_none() -> None:
    line, half_map, log = flown()
    with working_precision(64):
        again = half_map_of_curves.enclose_half_map(
            ball_constants(WIDE), line, half_map_of_curves.CurveReplay(log)
        )
        assert all(
            a.overlaps(b) and a.contains(b)
            for a, b in zip(
                again.curve_time.coefficients, half_map.curve_time.coefficients, strict=True
            )
        )
        for spoil, said in SPOILED_LOGS.values():
            spoiled = json.loads(json.dumps(log))
            spoil(spoiled)
            with pytest.raises(certificates.Unproved, match=said):
                half_map_of_curves.enclose_half_map(
                    ball_constants(WIDE), line, half_map_of_curves.CurveReplay(spoiled)
                )


def test_a_flight_ends_where_the_disk_lies_flat() -> None:
    with working_precision(64), pytest.raises(certificates.Unproved, match="upright"):
        half_map_of_curves.enclose_half_map(
            ball_constants(PRINTED),
            curve("1e-9", "0", 1, ("0.5", "-400", OMEGA)),
            CurveStepSearch(),
        )


# --------------------------------------------------------------------------------------- the cycles
def arc_of(radius: str, share: str = "1e-3", off: int = 0) -> ArcTest:
    constants, length = ball_constants(PRINTED), ball(radius)
    start = [ball(part) for part in (*GUESS, OMEGA)]
    polynomials, half = family_polynomials(
        constants, start, length, 2, ball(LIBRATING_SECTION), half_map_of_curves.Curve
    )
    deviation = [arb(0), arb(0), arb(0)]
    for k in UNKNOWN_INDICES:
        deviation[k] = arb(0, abs(polynomials[k].coefficients[1]) * ball(share))
        polynomials[k] = polynomials[k] + off * deviation[k].rad()
    g, v, omega = polynomials
    return krawczyk_test_of_arc(
        constants, half_map_of_curves.Curve(g, v, omega, deviation, half), CurveStepSearch()
    )


@pytest.mark.slow
def test_the_amplitude_as_the_parameter() -> None:
    """For each gamma_bar of an interval one pair of v and Omega; the cycle that is known lies
    where it should.
    """
    with working_precision(64):
        found = arc_of("5e-3")
        assert found.included
        assert found.stable() is True
        # det(P' - 1) along the curve, and by the trace and Liouville's formula.
        by_trace = 1 - found.trace().range() - found.half_map.divergence.range().exp()
        assert (found.slopes[1] * found.determinant).range().overlaps(by_trace)
        # The slopes are those by Omega over dgamma_bar_0/dOmega.
        numbers = cycle(Fraction(1)).numbers()
        by_omega = ball(numbers["dgamma_bar_0_domega"].value)
        assert found.slopes[1].range().overlaps(1 / by_omega)
        assert (
            found.period_slope().range().overlaps(ball(numbers["dperiod_domega"].value) / by_omega)
        )
        assert (found.speed_falls(), found.period_grows(), found.beta_max_grows()) == (
            True,
            True,
            True,
        )
        assert not arc_of("1e-6", off=3).included  # a box beside the family
        truth = cycle(Fraction(1)).numbers()
        s = (ball(truth["gamma_bar_0"].value) - ball(found.curve.gamma_bar.coefficients[0])) / ball(
            "5e-3"
        )
        for jet, off, value in zip(
            (found.curve.v, found.curve.omega),
            found.shift,
            (truth["v_0"].value, OMEGA + Fraction(RADIUS)),
            strict=True,
        ):
            assert (evaluate_polynomial(jet.coefficients, s) + off).contains(ball(value))


def test_a_saddle_is_not_stable() -> None:
    """det(P' - 1) < 0; nor is an arc with a multiplier below -1.

    P' has a small determinant and a trace of 0.9.
    """
    slopes = Jet([arb(0)]), Jet([arb(-1)])  # of the unknowns: Omega falls
    half_map = SimpleNamespace(divergence=Jet([arb(-10)]), image_by_start=None)
    for determinant, trace, stable in ((-1, "0.9", True), (1, "0.9", None), (-1, "-1.5", False)):
        curve = SimpleNamespace(trace=lambda matrix, trace=trace: Jet([arb(trace)]))
        arc = ArcTest(True, curve, half_map, (), slopes, Jet([arb(determinant)]))
        assert arc.stable() is stable
