"""Arcs of limit cycles: true orbits, derivatives and cycles lie in what is proved, and planted faults are noticed."""

from __future__ import annotations

import random
import sys
from fractions import Fraction
from functools import lru_cache
from itertools import product
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from tests.proofs.cases import carry, half_flight, speed_below
from tippedisk_verify.cli import main
from tippedisk_verify.errors import InputError
from tippedisk_verify.model.parameters import PRINTED, Constants
from tippedisk_verify.proofs.kernel import curve_flow
from tippedisk_verify.proofs.kernel.balls import arb, ball, ball_constants, working_precision
from tippedisk_verify.proofs.kernel.flow import Model
from tippedisk_verify.proofs.kernel.jets import Jet
from tippedisk_verify.proofs.kernel.lanes import Lanes
from tippedisk_verify.proofs.search import arc as arcs
from tippedisk_verify.proofs.search.cycle import OrbitProof, prove_cycle
from tippedisk_verify.proofs.search.cycle_interval import IntervalProof, Status, failed_interval, prove_interval
from tippedisk_verify.theory.codimension_two import bautin_points

OMEGA = speed_below(PRINTED, "0.5")
GUESS = ("1.7162868", "-1.7100021")
HALF = "0.546422"  # s, half the period there
RADIUS = "1e-3"  # rad/s
SOURCE = Path(curve_flow.__file__).read_text(encoding="utf-8")


@lru_cache(maxsize=1)
def proved() -> IntervalProof:
    return prove_interval(PRINTED, OMEGA, RADIUS, GUESS)


@lru_cache(maxsize=4)
def cycle(s: Fraction) -> OrbitProof:
    return prove_cycle(PRINTED, OMEGA + s * Fraction(RADIUS), GUESS, digits=40)


def curve(radius: str, spread: str, degree: int) -> curve_flow.Curve:
    """A line through the cycle's start, not the family's, with deviations in all three numbers."""
    middle = [ball(part).mid() for part in (*GUESS, OMEGA)]
    slopes = [ball(radius) * factor for factor in (-3, 2, 1)]
    jets = [Jet([part, slope.mid(), *[arb(0)] * (degree - 1)]) for part, slope in zip(middle, slopes, strict=True)]
    return curve_flow.Curve(jets[0], jets[1], jets[2], [arb(0, ball(spread))] * 3)


# --------------------------------------------------------------------------------------------------- the set that flows
def attack(module: Any, radius: str, spread: str, degree: int, order: int) -> None:
    """Four steps; orbits and derivatives of points of the set, in 120 bits, lie in the set and in its derivatives."""
    usual = module._ORDER, module._TOLERANCE
    module._ORDER, module._TOLERANCE = order, -30 if order < usual[0] else usual[1]
    try:
        followed(module, radius, spread, degree)
    finally:
        module._ORDER, module._TOLERANCE = usual


def followed(module: Any, radius: str, spread: str, degree: int) -> None:
    with working_precision(64):
        constants, line = ball_constants(PRINTED), curve(radius, spread, degree)
        tube, total = module._Tube(line), Jet([ball(HALF).mid(), ball(radius).mid(), *[arb(0)] * (degree - 1)])
        steps = module._Steps(module._Systems(constants, line), total)
        time = 0 * total
        for _ in range(4):
            step, _ = steps.step(tube, True)
            assert step.included
            tube, time = step.carried(), time + step.length
        states, matrix = tube.box(), tube.derivatives(unit_rows(total))
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
                assert states[row].at(ball(s)).contains(truth.state[row])
                for column in range(3):
                    assert matrix[row][column].at(ball(s)).contains(truth.matrix[row][column + 1])


def unit_rows(like: Jet) -> list[list[Jet]]:
    return [[0 * like + int(i == j) for j in range(3)] + [0 * like] for i in range(3)]


#: A curve without deviations; one so short that what is left over in time is all there is, also at a low order;
#: deviations.
CASES = (("2e-2", "0", 2, 24), ("1e-9", "0", 2, 24), ("1e-9", "0", 2, 6), ("1e-9", "1e-3", 1, 24))


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_orbits_and_their_derivatives_lie_inside(case) -> None:
    attack(curve_flow, *case)


FAULTS = {
    "what re-centred points lose is forgotten": ("image.rest = [a + b + c for", "image.rest = [b + c for"),
    "the lead's change is forgotten": ("zip(away, applied(left, self.deviation),", "zip(away, [0 * x for x in away],"),
    "derivatives at the middle only": ("[*tube.box(), *unit, nothing]", "[*tube.middle, *unit, nothing]"),
    "the speed's own column is missing": ("entries[column] + own", "entries[column]"),
    "no remainder in time": ("nothing + end] for series, end in zip(thin", "nothing] for series, end in zip(thin"),
    "no remainder in the derivatives": (
        "nothing + end] for series, end in zip(wide",
        "nothing] for series, end in zip(wide",
    ),
    "the derivatives' spread is lost": ("added(left, product(turned, self.spread))", "self.spread"),
}


#: Those that take eight seconds and more to be noticed, but for one of them.
LONG = ("what re-centred points lose is forgotten", "no remainder in the derivatives")


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if name in LONG else ()) for name in FAULTS]
)
def test_planted_faults_are_noticed(name) -> None:
    old, new = FAULTS[name]
    assert SOURCE.count(old) == 1
    module = ModuleType("copy_of_curve_flow")
    sys.modules[module.__name__] = module
    try:
        exec(compile(SOURCE.replace(old, new), module.__name__, "exec"), module.__dict__)
    finally:
        del sys.modules[module.__name__]
    for case in CASES:
        try:
            attack(module, *case)
        except AssertionError:
            return
    raise AssertionError("no case notices the fault")


def test_many_curves_side_by_side_agree_with_one() -> None:
    """Each lane's set of states overlaps the one that Arb finds over steps of the same lengths."""
    line, total = curve("1e-4", "1e-6", 1), ball(HALF)
    with working_precision(64):
        constants = ball_constants(PRINTED)

        def lanes(x: Any) -> Lanes:
            return Lanes.of([x, x])

        many = curve_flow.Curve(
            *(Jet([lanes(part) for part in jet.c]) for jet in (line.gamma_bar, line.v, line.omega)),
            [lanes(part) for part in line.deviation],
        )
        found = []
        for one, values, path in ((Jet([total.mid(), arb(0)]), constants, line),
                                  (Jet([lanes(total.mid()), lanes(arb(0))]),
                                   Constants(*(Lanes.of([part]) for part in constants)), many)):  # fmt: skip
            steps = curve_flow._Steps(curve_flow._Systems(values, path), one)
            step, last = steps.step(curve_flow._Tube(path), True)
            assert not last
            found.append([part.range() for part in step.carried().box()])
        for mine, theirs in zip(*found, strict=True):
            for lane in (0, 1):
                assert theirs.arb(lane).overlaps(mine)
                # Doubles have 11 bits fewer than the balls here; the radii are far above either's rounding.
                assert float(theirs.arb(lane).rad()) < 1.01 * float(mine.rad()) + 1e-13


# ----------------------------------------------------------------------------------------------------------- the cycles
@pytest.mark.slow
def test_an_interval_of_speeds() -> None:
    proof = proved()
    assert proof.proved, proof.statement
    assert proof.stable is True
    numbers = dict(proof.numbers)
    # dT/dOmega is about -0.79 s^2/rad: the range of the period can be no narrower, and is hardly wider.
    assert Fraction("0.78e-3") < numbers["period"].uncertainty < Fraction("0.8e-3")
    assert numbers["gamma_bar_0"].uncertainty < Fraction("2.8e-3")


@pytest.mark.slow(minutes=0.4)
@pytest.mark.parametrize(
    "s",
    [
        pytest.param(Fraction(-1), marks=pytest.mark.slow),
        Fraction(random.Random(11).randint(-999, 999), 1000),
        pytest.param(Fraction(1), marks=pytest.mark.slow),
    ],
)
def test_true_cycles_at_speeds_of_the_interval_lie_inside(s) -> None:
    proof, truth = proved(), cycle(s).numbers()
    for name, value in proof.numbers:
        assert value.holds(truth[name].value), name
    for row, name, near in zip(proof.curve, ("gamma_bar_0", "v_0"), proof.enclosed_within, strict=True):
        at_s = sum(part * s**k for k, part in enumerate(row))
        assert abs(truth[name].value - at_s) <= near, name
    assert truth["beta_max"].value < proof.beta_below


def test_what_the_proof_says() -> None:
    found = proved().to_dict()
    assert (found["proved"], found["status"], found["radius"]) == (True, "PROVED", "0.001")
    for word in ("for every Omega from", "exactly one fixed point", "asymptotically stable", PRINTED.definition()):
        assert word in found["statement"]
    assert all(
        0 < float(found["enclosed_within"][name]) <= float(found["unique_within"][name]) for name in found["curve"]
    )


def arc_of(radius: str, over: int, share: str = "1e-3", off: int = 0) -> arcs.Arc:
    constants, length = ball_constants(PRINTED), ball(radius)
    start = [ball(part) for part in (*GUESS, OMEGA)]
    polynomials, half = arcs.family_polynomials(constants, start, length, 2, ball(HALF), over)
    deviation = [arb(0), arb(0), arb(0)]
    for k in arcs.Arc(None, over, *[None] * 5).unknowns:
        deviation[k] = arb(0, abs(polynomials[k].c[1]) * ball(share))
        polynomials[k] = polynomials[k] + off * deviation[k].rad()
    g, v, omega = polynomials
    return arcs.krawczyk_test(constants, curve_flow.Curve(g, v, omega, deviation), half, over)


@pytest.mark.slow
def test_over_a_tiny_interval_it_agrees_with_the_first_order_road() -> None:
    with working_precision(64):
        short = arc_of("1e-6", arcs.OMEGA)
        assert short.proved
        line = short.curve
        model = Model(ball_constants(PRINTED), ball(OMEGA) + arb(0, ball("1e-6")))
        flight = half_flight(model, line.gamma_bar.range(), line.v.range(), derivatives=True)
        for mine, theirs in zip(short.flight.matrix, flight.matrix, strict=True):
            for a, b in zip(mine[:2], theirs, strict=True):
                assert b.contains(a.range()) or a.range().overlaps(b)
        for a, b in zip((row[2] for row in short.flight.matrix), flight.by_omega, strict=True):
            assert a.range().overlaps(b)
        assert short.flight.divergence.range().overlaps(flight.divergence)


@pytest.mark.slow
def test_a_box_beside_the_family_is_not_proved() -> None:
    with working_precision(64):
        beside = arc_of("1e-6", arcs.OMEGA, off=3)
        assert beside.flight.proved
        assert not beside.proved


@pytest.mark.slow
def test_the_amplitude_as_the_parameter() -> None:
    """For each gamma_bar of an interval one pair of v and Omega; the cycle that is known lies where it should."""
    with working_precision(64):
        found = arc_of("5e-3", arcs.GAMMA_BAR)
        assert found.proved
        assert found.stable()
        assert not found.unstable()
        # det(P' - 1) along the curve, and by the trace and Liouville's formula.
        by_trace = 1 - found.trace().range() - found.flight.divergence.range().exp()
        assert (found.slopes[1] * found.determinant).range().overlaps(by_trace)
        # The slopes are those by Omega over dgamma_bar_0/dOmega.
        numbers = cycle(Fraction(1)).numbers()
        by_omega = ball(numbers["dgamma_bar_0_domega"].value)
        assert found.slopes[1].range().overlaps(1 / by_omega)
        assert found.period_slope().range().overlaps(ball(numbers["dperiod_domega"].value) / by_omega)
        assert (found.falling(), found.slowing(), found.widening()) == (True, True, True)
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
    for determinant, trace, stable in ((-1, "0.9", True), (1, "0.9", False), (-1, "-1.5", False)):
        curve = SimpleNamespace(trace=lambda matrix, trace=trace: Jet([arb(trace)]))
        arc = arcs.Arc(True, arcs.GAMMA_BAR, curve, flight, (), over, Jet([arb(determinant)]))
        assert bool(arc.stable()) is stable


@pytest.mark.slow
def test_too_wide_an_interval_is_not_proved() -> None:
    failed = prove_interval(PRINTED, OMEGA, "0.49", GUESS)
    assert failed.status in (Status.NOT_FOLLOWED, Status.NOT_INCLUDED)
    assert failed.statement.startswith("nothing is proved")


def test_bad_input() -> None:
    for radius in ("0", "-1", "31", "pi", "wide"):
        with pytest.raises(InputError):
            prove_interval(PRINTED, OMEGA, radius, GUESS)
    with pytest.raises(InputError, match="born below"):
        prove_interval(PRINTED, OMEGA, "0.5", GUESS)
    with pytest.raises(InputError, match="two components"):
        prove_interval(PRINTED, OMEGA, RADIUS, ("1",))
    with pytest.raises(InputError, match="smooth"):
        prove_interval(PRINTED.with_friction("smooth"), OMEGA, RADIUS, GUESS)


def test_where_cycles_are_born_above_omega_crit_a_range_may_hold_it() -> None:
    """Where that is not known, as at the Bautin point itself, too. The second speed is that of stable cycles."""
    for inertia, speed in ((bautin_points(PRINTED, "A")[0].value.value, "30.9"), ("0.229e-3", "30.8866")):
        failed_interval(PRINTED.changed(A=inertia), speed, "0.1")


def test_from_the_command_line(capsys, monkeypatch) -> None:
    monkeypatch.setattr("tippedisk_verify.proofs.search.cycle_interval.prove_interval", lambda *_: proved())
    arguments = ["certify", "orbit", "--omega", str(OMEGA), "--radius", RADIUS, "--guess", *GUESS]
    arguments[3] = "30.386592688644"
    assert main(arguments) == 0
    assert "for every Omega from" in capsys.readouterr().out
    assert main([*arguments, "--rotating"]) == 2
    assert "--radius" in capsys.readouterr().err
