"""Polynomials with balls left over: exact functions of s from inside stay inside, and planted faults are noticed."""

from __future__ import annotations

import random
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from tests.proofs.cases import executed
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.proofs.kernel import jets
from tippedisk_verify.proofs.kernel.balls import arb, ball, ball_constants, inside, working_precision
from tippedisk_verify.proofs.kernel.flow import Model
from tippedisk_verify.proofs.kernel.series import Graph, System
from tippedisk_verify.proofs.numbers import measured

SOURCE = Path(jets.__file__).read_text(encoding="utf-8")
OPERATIONS: dict[str, Callable[[Any, Any], Any]] = {
    "sum": lambda a, b: a + b,
    "difference": lambda a, b: 1 - a - b,
    "product": lambda a, b: a * b,
    "square": lambda a, b: a * a,
    "quotient": lambda a, b: a / b,
    "reciprocal": lambda a, b: 1 / b,
    "sine": lambda a, b: a.sin(),
    "cosine": lambda a, b: a.cos(),
    "several": lambda a, b: (a * b - 2 * a).sin() / b,
}


def convolved(module: ModuleType, a: Any, b: Any) -> Any:
    """a b + 2 a a, as the third coefficient of a product of series."""
    left, right = a.series(), b.series()
    for part in (a, a, b):
        left.append(part)
    for part in (a, a, b):
        right.append(part)
    return left.convolution(right)


def drawn(rng: random.Random, degree: int, middle: Fraction) -> tuple[list[tuple[Fraction, Fraction]], list[Fraction]]:
    """Coefficients as midpoints and radii, and a choice of points from them, often the balls' ends."""
    coefficients = []
    for k in range(degree + 1):
        mid = (middle if not k else 0) + Fraction(rng.randint(-300, 300), 1000 * 3**k)
        coefficients.append((mid, Fraction(rng.choice([0, 0, 1, 20]), 1000 * 4**k)))
    return coefficients, [mid + rng.choice([-1, 1, Fraction(1, 3)]) * rad for mid, rad in coefficients]


def at(points: list[Fraction], s: Fraction) -> Any:
    return ball(sum(part * s**k for k, part in enumerate(points)))


def attack(module: ModuleType, draws: int) -> None:
    """Random jets and points of them: each operation's exact result lies in the jet's value at s, and in its range."""
    rng = random.Random(7)
    for _ in range(draws):
        degree, s = (
            rng.choice([0, 1, 2, 2, 3, 5]),
            rng.choice([Fraction(-1), Fraction(1), Fraction(rng.randint(-9, 9), 10)]),
        )
        (first, x), (second, y) = drawn(rng, degree, Fraction(1, 2)), drawn(rng, degree, Fraction(2))
        jet_a, jet_b = (module.Jet([ball(mid) + arb(0, ball(rad)) for mid, rad in part]) for part in (first, second))
        results = {name: operation(jet_a, jet_b) for name, operation in OPERATIONS.items()}
        results["convolution"] = convolved(module, jet_a, jet_b)
        results["cut"] = jet_a.cut(1) + jet_b
        with working_precision(300):
            a, b = at(x, s), at(y, s)
            exact = {name: operation(a, b) for name, operation in OPERATIONS.items()}
            exact["convolution"], exact["cut"] = 2 * a * b + a * a, a + b
        for name, value in results.items():
            for held in (value.at(ball(s)), value.range()):
                wide = measured(held)
                with working_precision(300):
                    # Its ends are rational: a ball that is a hair wider than what is claimed.
                    claimed = ball(wide.value) + arb(0, ball(wide.uncertainty) + arb(2) ** -250)
                    assert inside(exact[name], claimed), (name, degree, s)


def test_exact_results_lie_inside() -> None:
    with working_precision(64):
        attack(jets, 300)


def test_a_smooth_function_comes_out_sharp() -> None:
    """The remainder of degree D is about (1/10)^(D+1): it may be ten times that, plain balls would be at (1/10)."""
    with working_precision(64):
        for degree in (1, 2, 3, 4):
            a = jets.Jet([arb(1), arb(1) / 10, *[arb(0)] * (degree - 1)])
            for value in (a.sin() * a, 1 / a):
                assert sum(float(part.rad()) for part in value.c) < 10.0**-degree


def test_coefficients_of_orbits() -> None:
    """The Taylor coefficients in time of orbits from a line of starts hold those from each point of it."""
    with working_precision(64):
        graph = Graph()
        x, y = graph.variable(), graph.variable()
        system = System(graph, (x, y), (y * graph.cos(x), (x - y * y) / (2 + graph.sin(y))))
        line = [jets.Jet([arb(part), arb(1) / 16, arb(0)]) for part in (1, 2)]
        found = [list(part) for part in system.coefficients(line, 6)]
        for s in (-1, Fraction(1, 3), 1):
            exact = system.coefficients([part.at(ball(s)) for part in line], 6)
            for mine, theirs in zip(found, exact, strict=True):
                assert all(a.at(ball(s)).contains(b) for a, b in zip(mine[:2], theirs[:2], strict=False))
                assert all(a.at(ball(s)).overlaps(b) for a, b in zip(mine, theirs, strict=True))


FAULTS = {
    "a tail is dropped": (
        "return Jet(self.c[: degree + 1])._wider(sum(map(symmetric, self.c[degree + 1 :])))",
        "return Jet(self.c[: degree + 1])"),
    "a tail keeps its sign": ("sum(map(symmetric, self.c[degree + 1 :]))", "sum(self.c[degree + 1 :])"),
    "a ball is its own mirror image": ("return x * _BOTH", "return x"),
    "a sum of products is not turned round": ("reversed(other._polynomials)", "other._polynomials"),
    "a quotient's remainder is dropped": ("        if top:\n            over", "        if False:\n            over"),
    "the sine's remainder is dropped": ("result._wider(symmetric(last", "result._wider(0 * symmetric(last"),
    "a missing factor 1/2": ("derivatives[(n + quarters) % 4] / factorial", "derivatives[(n + quarters) % 4]"),
    "the sine's slope is the cosine's": ("% 4] / factorial", "% 2] / factorial"),
    "odd powers are positive": ("x.union(0 * x) if k % 2 else symmetric(x)", "x.union(0 * x)"),
    "even powers are left out": ("x.union(0 * x) if k % 2 else symmetric(x)", "0 * x if k % 2 else symmetric(x)"),
    "a number is added to all coefficients": (
        "return Jet([self.c[0] + other, *self.c[1:]])", "return Jet([x + other for x in self.c])"),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_planted_faults_are_noticed(name) -> None:
    old, new = FAULTS[name]
    assert SOURCE.count(old) == 1
    with working_precision(64), pytest.raises(AssertionError):
        attack(executed(SOURCE.replace(old, new)), 300)


def test_a_model_takes_a_jet_of_speeds() -> None:
    with working_precision(64):
        constants = ball_constants(PRINTED)
        state = (arb("-0.1"), arb("0.5"), arb("-1"))
        moving = Model(constants, jets.Jet([arb(30), arb(1) / 4]))
        rates = moving.rates([jets.Jet([part, arb(0)]) for part in state])
        for s in (-1, 0, 1):
            still = Model(constants, 30 + arb(s) / 4).rates(state)
            for mine, theirs in zip(rates[1:], still[1:], strict=True):
                assert mine.at(arb(s)).overlaps(theirs)
