"""Arcs of limit cycles: true orbits, derivatives and cycles lie in what is proved."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from fractions import Fraction
from functools import lru_cache
from itertools import product
from types import SimpleNamespace
from typing import Any

import pytest

from tests.proofs.cases import carry, speed_below
from tippedisk_verify.cli import main
from tippedisk_verify.cycles.section import RETURNS
from tippedisk_verify.errors import InputError
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.contract import Request
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.model.precision import Precision
from tippedisk_verify.proofs.kernel import claims, curves
from tippedisk_verify.proofs.kernel.balls import arb, ball, ball_constants, working_precision
from tippedisk_verify.proofs.kernel.curves import GAMMA_BAR, UNKNOWNS, Arc, arc_test
from tippedisk_verify.proofs.kernel.curves import OMEGA as SPEED
from tippedisk_verify.proofs.kernel.flow import Model
from tippedisk_verify.proofs.kernel.jets import Jet
from tippedisk_verify.proofs.numbers import measured
from tippedisk_verify.proofs.search.curve_choices import StepSearch, family_polynomials
from tippedisk_verify.proofs.search.cycle import OrbitProof, prove_cycle
from tippedisk_verify.proofs.search.interval import IntervalProof, prove_interval
from tippedisk_verify.proofs.search.steps import axes_of_balls

OMEGA = speed_below(PRINTED, "0.5")
GUESS = ("1.7162868", "-1.7100021")
HALF = "0.546422"  # s, half the period there
RADIUS = "1e-3"  # rad/s
#: A disk, and a start from which beta_bar falls to -0.66, with its speed.
WIDE, SWING = PRINTED.changed(e="0.008", C=None), ("2.2", "-5.71", "35.57")


@lru_cache(maxsize=4)
def cycle(s: Fraction) -> OrbitProof:
    return prove_cycle(PRINTED, OMEGA + s * Fraction(RADIUS), GUESS, digits=40)


def curve(radius: str, spread: str, degree: int, start: Any = (*GUESS, OMEGA), half: str = HALF) -> curves.Curve:
    """A line through a start, by default the cycle's, with deviations in all three numbers."""
    middle = [ball(part).mid() for part in start]
    slopes = [ball(radius) * factor for factor in (-3, 2, 1)]
    jets = [Jet([part, slope.mid(), *[arb(0)] * (degree - 1)]) for part, slope in zip(middle, slopes, strict=True)]
    total = Jet([ball(half).mid(), ball(radius).mid(), *[arb(0)] * (degree - 1)])
    return curves.Curve(jets[0], jets[1], jets[2], [arb(0, ball(spread))] * 3, total)


# --------------------------------------------------------------------------------------------------- the set that flows
def even_steps(order: int) -> Any:
    """Steps of one share of the flight."""
    return SimpleNamespace(
        step=lambda path, longest: path.step_of(path.trial((order, 12)), 0.01),
        axes=lambda turned, sizes, stiffness: axes_of_balls(turned, [1.0, 1.0, 1.0], 100.0),
        took=lambda step, axes: None,
    )


def attack(radius: str, spread: str, degree: int, order: int) -> None:
    """Four steps; orbits and derivatives of points of the set, in 120 bits, lie in the set and in its derivatives."""
    with working_precision(64):
        line = curve(radius, spread, degree)
        path = curves.CurvePath(ball_constants(PRINTED), line, even_steps(order))
        for _ in range(4):
            step = path.step()
            assert step is not None
            assert step.included
            path.take(step)
        box, matrix, time = path.box, path.matrix, path.time
    corners = [*product((-1, 1), repeat=3)] if Fraction(spread) else [(0, 0, 0)]
    for s, signs in product((Fraction(-1), Fraction(1, 3), Fraction(1)), corners):
        shift = [sign * Fraction(spread) for sign in signs]
        with working_precision(120):
            start = [
                jet.at(ball(s)) + ball(part)
                for jet, part in zip((line.gamma_bar, line.v, line.omega), shift, strict=True)
            ]
            truth = carry(
                Model(ball_constants(PRINTED), start[2]), (0, *start[:2]), time.at(ball(s)).mid(), derivatives=True
            )
            for row in range(3):
                assert box[row].at(ball(s)).contains(truth.state[row])
                for column in range(3):
                    assert matrix[row][column].at(ball(s)).contains(truth.matrix[row][column + 1])


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(("2e-2", "0", 2, 24), marks=pytest.mark.slow, id="no deviations"),
        # So short, and of so low an order, that what is left over in time is all there is.
        pytest.param(("1e-9", "0", 2, 6), id="a low order"),
        pytest.param(("1e-9", "1e-3", 1, 24), id="deviations"),
    ],
)
def test_orbits_and_their_derivatives_lie_inside(case) -> None:
    attack(*case)


@lru_cache(maxsize=1)
def flown() -> tuple[curves.Curve, curves.CurveFlight, list[dict[str, Any]]]:
    """A curve with deviations in all three numbers, its flight and the flight's log."""
    with working_precision(64):
        line, choices = curve("3e-4", "1e-5", 2, SWING, "0.3086"), StepSearch()
        return line, curves.fly(ball_constants(WIDE), line, choices), choices.log


def test_points_of_the_box_return_as_the_integrator_finds() -> None:
    """With the numbers of the flight's first return, in 200 bits, from ends and from inside of the box."""
    line, flight, _ = flown()
    for s, signs in ((-1, (1, 1, 1)), (Fraction(1, 3), (-1, 1, 0)), (1, (0, -1, 1)), (Fraction(1, 2), (0, 0, 0))):
        with working_precision(250):
            start = [jet.at(ball(s)) + sign * ball("1e-5")
                     for jet, sign in zip((line.gamma_bar, line.v, line.omega), signs, strict=True)]  # fmt: skip
            *image, time, divergence = integrated(*(measured(part.mid()).value for part in start))
            assert flight.divergence.at(ball(s)).contains(divergence)
            if not any(signs):
                assert flight.own_time.at(ball(s)).contains(time)
            for own, row, x in zip((*flight.image, flight.own_time), (*flight.matrix, flight.time_by),
                                   (*image, time), strict=True):  # fmt: skip
                moved = sum(entry.at(ball(s)) * sign for entry, sign in zip(row, signs, strict=True)) * ball("1e-5")
                assert (own.at(ball(s)) + moved).contains(x)


@lru_cache(maxsize=4)
def integrated(gamma_bar: Fraction, v: Fraction, omega: Fraction) -> list[Any]:
    """S of the first return (gamma_bar, v), its time and the divergence's integral, by the integrator in 200 bits."""
    request = Request(
        WIDE, omega, (0, gamma_bar, v), 2, shifted=True, precision=Precision("real", 200), domain="none",
        divergence=True, events=(RETURNS,),
    )  # fmt: skip
    result = default_engine()(request)
    return [ball(str(part)) for part in (-result.state[1], -result.state[2], result.time, result.divergence)]


#: of a log's entries: what is done to them, and what is said
SPOILED: dict[str, tuple[Callable[[list[Any]], Any], str]] = {
    "a step is three times as long": (
        lambda log: log[5].update(share=str(3 * float(log[5]["share"]))), "enclosure|return|move|section|further steps"
    ),
    "a step is negative": (lambda log: log[5].update(share="-0.001"), "enclosure"),
    "a step is missing": (lambda log: log.pop(3), "return|move|section|missing"),
    "the last step is missing": (lambda log: log.pop(), "missing|no steps"),
    "there are no steps": (lambda log: log.clear(), "no steps"),
    "axes have no inverse": (
        lambda log: log[4].update(axes=[log[4]["axes"][0], *log[4]["axes"][::2]]), "enclosure"
    ),
    "axes are missing": (lambda log: log[4].pop("axes"), "missing"),
}  # fmt: skip


def test_a_log_gives_the_flight_again_and_a_spoiled_one_gives_none() -> None:
    line, flight, log = flown()
    with working_precision(64):
        again = curves.fly(ball_constants(WIDE), line, curves.Replay(log))
        assert all(a.overlaps(b) and a.contains(b) for a, b in zip(again.own_time.c, flight.own_time.c, strict=True))
        for spoil, said in SPOILED.values():
            spoiled = json.loads(json.dumps(log))
            spoil(spoiled)
            with pytest.raises(claims.Unproved, match=said):
                curves.fly(ball_constants(WIDE), line, curves.Replay(spoiled))


def test_a_flight_ends_where_the_disk_lies_flat() -> None:
    with working_precision(64), pytest.raises(claims.Unproved, match="upright"):
        curves.fly(ball_constants(PRINTED), curve("1e-9", "0", 1, ("0.5", "-400", OMEGA)), StepSearch())


# ----------------------------------------------------------------------------------------------------------- the cycles
def arc_of(radius: str, over: int, share: str = "1e-3", off: int = 0) -> Arc:
    constants, length = ball_constants(PRINTED), ball(radius)
    start = [ball(part) for part in (*GUESS, OMEGA)]
    polynomials, half = family_polynomials(constants, start, length, 2, ball(HALF), over, curves.Curve)
    deviation = [arb(0), arb(0), arb(0)]
    for k in UNKNOWNS[over]:
        deviation[k] = arb(0, abs(polynomials[k].c[1]) * ball(share))
        polynomials[k] = polynomials[k] + off * deviation[k].rad()
    g, v, omega = polynomials
    return arc_test(constants, curves.Curve(g, v, omega, deviation, half), over, StepSearch())


@pytest.mark.slow
def test_the_amplitude_as_the_parameter() -> None:
    """For each gamma_bar of an interval one pair of v and Omega; the cycle that is known lies where it should."""
    with working_precision(64):
        found = arc_of("5e-3", GAMMA_BAR)
        assert found.included
        assert found.stable() is True
        # det(P' - 1) along the curve, and by the trace and Liouville's formula.
        by_trace = 1 - found.trace().range() - found.flight.divergence.range().exp()
        assert (found.slopes[1] * found.determinant).range().overlaps(by_trace)
        # The slopes are those by Omega over dgamma_bar_0/dOmega.
        numbers = cycle(Fraction(1)).numbers()
        by_omega = ball(numbers["dgamma_bar_0_domega"].value)
        assert found.slopes[1].range().overlaps(1 / by_omega)
        assert found.period_slope().range().overlaps(ball(numbers["dperiod_domega"].value) / by_omega)
        assert (found.falling(), found.slowing(), found.widening()) == (True, True, True)
        assert not arc_of("1e-6", SPEED, off=3).included  # a box beside the family
        truth = cycle(Fraction(1)).numbers()
        s = (ball(truth["gamma_bar_0"].value) - ball(found.curve.gamma_bar.c[0])) / ball("5e-3")
        for jet, off, value in zip(
            (found.curve.v, found.curve.omega),
            found.within,
            (truth["v_0"].value, OMEGA + Fraction(RADIUS)),
            strict=True,
        ):
            assert (jet.at(s) + off).contains(ball(value))
        assert found.period().at(s).contains(ball(truth["period"].value))


def test_a_saddle_is_not_stable() -> None:
    """det(P' - 1) < 0; nor is an arc with a multiplier below -1. P' has a small determinant and a trace of 0.9."""
    over = Jet([arb(0)]), Jet([arb(-1)])  # the unknowns' slopes: Omega falls
    flight = SimpleNamespace(divergence=Jet([arb(-10)]), matrix=None)
    for determinant, trace, stable in ((-1, "0.9", True), (1, "0.9", None), (-1, "-1.5", False)):
        curve = SimpleNamespace(trace=lambda matrix, trace=trace: Jet([arb(trace)]))
        arc = Arc(True, GAMMA_BAR, curve, flight, (), over, Jet([arb(determinant)]))
        assert arc.stable() is stable


# ---------------------------------------------------------------------------------- the cycles of an interval of speeds
@lru_cache(maxsize=1)
def proved() -> IntervalProof:
    return prove_interval(PRINTED, OMEGA, RADIUS, GUESS)


def test_an_interval_of_speeds() -> None:
    proof = proved()
    assert proof.proved, proof.statement
    assert proof.claim["stable"] is True
    numbers = proof.numbers
    # dT/dOmega is about -0.79 s^2/rad: the range of the period can be no narrower, and is hardly wider.
    assert Fraction("0.78e-3") < numbers["period"].uncertainty < Fraction("0.8e-3")
    assert numbers["gamma_bar_0"].uncertainty <= Fraction("2.8e-3")
    found = proof.to_dict()
    assert (found["proved"], found["status"], found["radius"]) == (True, "PROVED", "0.001")
    for word in ("for every Omega from", "exactly one fixed point", "asymptotically stable", PRINTED.definition()):
        assert word in found["statement"]
    for name in found["curve"]:
        assert 0 < float(found["enclosed_within"][name]) <= float(found["unique_within"][name])


@pytest.mark.slow(minutes=0.4)
def test_a_true_cycle_at_a_speed_of_the_interval_lies_inside() -> None:
    s = Fraction(random.Random(11).randint(-999, 999), 1000)
    proof, truth = proved(), cycle(s).numbers()
    for name, value in proof.numbers.items():
        assert value.holds(truth[name].value), name
    for name, near in proof.claim["enclosed_within"].items():
        at_s = sum(Fraction(part) * s**k for k, part in enumerate(proof.claim["curve"][name]))
        assert abs(truth[name].value - at_s) <= Fraction(near), name
    assert truth["beta_max"].value < Fraction(proof.claim["beta_below"])


def test_bad_input() -> None:
    with pytest.raises(InputError, match="born below"):
        prove_interval(PRINTED, OMEGA, "0.5", GUESS)
    with pytest.raises(InputError, match="two components"):
        prove_interval(PRINTED, OMEGA, RADIUS, ("1",))
    with pytest.raises(InputError, match="smooth"):
        prove_interval(PRINTED.with_friction("smooth"), OMEGA, RADIUS, GUESS)
    with pytest.raises(InputError):
        prove_interval(PRINTED, OMEGA, "0", GUESS)


def test_the_command_writes_a_certificate_and_checks_it(capsys, monkeypatch, tmp_path) -> None:
    monkeypatch.setattr("tippedisk_verify.proofs.search.interval.prove_interval", lambda *_: proved())
    arguments = ["certify", "orbit", "--omega", "30.386592688644", "--radius", RADIUS, "--guess", *GUESS]
    path = str(tmp_path / "interval.json")
    assert main([*arguments, "--certificate", path]) == 0
    assert "for every Omega from" in capsys.readouterr().out
    assert main(["certify", "check", path]) == 0
    assert proved().statement in capsys.readouterr().out
    spoiled = json.loads(proved().certificate())
    TAMPERED["nearer than shown"][0](spoiled["claim"], spoiled["evidence"])
    with pytest.raises(claims.Unproved, match="digest"):
        claims.proved(spoiled)
    assert main([*arguments, "--rotating"]) == 2
    assert "--radius" in capsys.readouterr().err


#: of a certificate: what is done to its claim, evidence or both, and what is said
TAMPERED: dict[str, tuple[Callable[[Any, Any], Any], str]] = {
    "another speed": (lambda claim, evidence: claim.update(omega="30.3"), "other ends"),
    "another interval": (
        lambda claim, evidence: claim.update(omega="30.387", radius="0.001", low="30.386", high="30.388"), "Krawczyk"
    ),
    "no radius": (
        lambda claim, evidence: claim.update(radius="0", low=claim["omega"], high=claim["omega"]), "interval is empty"
    ),
    "further off than it is alone": (lambda claim, evidence: claim["enclosed_within"].update(v_0="1"), "the only one"),
    "a wider interval": (lambda claim, evidence: claim.update(high="30.4"), "other ends"),
    "another disk": (lambda claim, evidence: claim["parameters"].update(e="0.0026"), "Krawczyk|return|move|section"),
    "no disk": (lambda claim, evidence: claim["parameters"].update(e="0.05"), "no disk's"),
    "a smaller box": (lambda claim, evidence: claim["unique_within"].update(v_0="1e-12"), "Krawczyk"),
    "an empty box": (lambda claim, evidence: claim["unique_within"].update(v_0="0"), "empty"),
    "nearer than shown": (lambda claim, evidence: claim["enclosed_within"].update(v_0="1e-13"), "v_0 is not"),
    "another period": (lambda claim, evidence: claim["numbers"]["period"].update(value="1.094"), "period"),
    "a multiplier with too many digits": (
        lambda claim, evidence: claim["numbers"]["multiplier_slow"].update(uncertainty="1e-9"), "multiplier_slow"
    ),
    "beta too near": (lambda claim, evidence: claim.update(beta_below="0.2"), "upright"),
    "unstable": (lambda claim, evidence: claim.update(stable=False), "stability"),
    "the curve is moved": (lambda claim, evidence: _moved(claim["curve"]["gamma_bar_0"]), "Krawczyk"),
    "the degrees differ": (lambda claim, evidence: claim["curve"]["v_0"].pop(), "unlike degrees"),
    "half the period is another one": (lambda claim, evidence: evidence.update(half=["1", "0", "0", "0", "0"]),
                                       "return|move|section|enclosure"),
    "a step is missing": (lambda claim, evidence: evidence["steps"].pop(7), "return|move|section|missing"),
}  # fmt: skip


def _moved(coefficients: list[str]) -> None:
    coefficients[0] = str(Fraction(coefficients[0]) + Fraction(1, 10**6))


#: of which it is said early
EARLY = ("another speed", "no radius", "a wider interval", "no disk", "an empty box", "the degrees differ",
         "half the period is another one", "a step is missing", "unstable")  # fmt: skip


@pytest.mark.parametrize(
    "names", [EARLY, pytest.param([name for name in TAMPERED if name not in EARLY], marks=pytest.mark.slow)]
)
def test_what_is_tampered_with_is_not_accepted(names) -> None:
    content = json.loads(proved().certificate())
    for name in names:
        spoil, said = TAMPERED[name]
        spoiled = json.loads(json.dumps(content))
        spoil(spoiled["claim"], spoiled["evidence"])
        spoiled["sha256"] = claims.digest(spoiled)
        with pytest.raises((claims.Unproved, claims.Refused), match=said):
            claims.proved(spoiled)
