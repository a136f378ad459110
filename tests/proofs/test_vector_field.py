"""The kernel's equations against those that the rest of the package uses: two transcriptions,
each differentiated.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import pytest

from tippedisk_verify.model.equations import equation_terms, jacobian, shifted_ops, vector_field
from tippedisk_verify.model.parameters import PRINTED, SYMBOLS, Parameters
from tippedisk_verify.proofs.ball_conversions import ball_constants, ball_to_measured
from tippedisk_verify.proofs.kernel import jets
from tippedisk_verify.proofs.kernel.balls import (
    BallOps,
    Unproved,
    arb,
    ball,
    inside,
    working_precision,
)
from tippedisk_verify.proofs.kernel.proved_flow import EnclosedField
from tippedisk_verify.proofs.kernel.step import evaluate_polynomial
from tippedisk_verify.proofs.kernel.taylor_recurrences import Graph, System
from tippedisk_verify.proofs.kernel.vector_field import (
    field_constants,
    one_sided_vector_field,
    sliding_motion,
)
from tippedisk_verify.proofs.kernel.vector_field import vector_field as kernel_field

LAWS = (
    ("linear", "linear", None),
    ("smooth", "smooth", None),
    (1, "smooth", 1),
    (-1, "smooth", -1),
)
DISK = {name: str(getattr(PRINTED, name)) for name in SYMBOLS}


def same(mine, other) -> bool:
    """Whether two balls share a point, and are narrow."""
    narrow = all(x.rad() < abs(x).upper() * arb(2) ** -90 + arb(2) ** -150 for x in (mine, other))
    return narrow and mine.overlaps(other)


def test_rates_and_derivatives_at_random_points_of_random_disks() -> None:
    draw = random.Random(11)
    with working_precision(200):
        for _ in range(40):
            disk = {
                n: str(Fraction(value) * Fraction(draw.randint(900, 1100), 1000))
                for n, value in DISK.items()
            }
            disk["A"] = str(Fraction(disk["B"]) * Fraction(draw.randint(1000, 1300), 1000))
            mine = field_constants(disk)
            theirs = ball_constants(
                Parameters(**{name: Fraction(value) for name, value in disk.items()})
            )
            state = [
                arb(draw.uniform(-1.5, 1.5)),
                arb(draw.uniform(-7, 7)),
                arb(draw.uniform(-20, 20)),
            ]
            speed = arb(draw.uniform(0.1, 60))
            for law, friction, side in LAWS:
                rates = kernel_field(BallOps, mine, speed, law)(*state)
                others = vector_field(shifted_ops(BallOps), theirs, speed, friction, side)(*state)
                assert all(same(a, b) for a, b in zip(rates, others, strict=True)), law
                if law == "smooth":
                    continue
                unit = [arb(int(row == column)) for column in range(4) for row in range(3)]
                field = EnclosedField(mine, speed, one_sided_vector_field(law) if side else None)
                columns = [
                    part[1]
                    for part in field.variational_system.coefficients([*state, *unit], 1)[3:]
                ]
                rows = jacobian(shifted_ops(BallOps), theirs, speed, friction, side)(*state)
                assert all(
                    same(columns[3 * k + row], arb(rows[row][k]))
                    for row in range(3)
                    for k in range(3)
                ), law
                # A quadratic polynomial in Omega: central differences are exact
                if law == "linear":
                    ahead, behind = (
                        kernel_field(BallOps, mine, speed + h, law)(*state) for h in (1, -1)
                    )
                    assert all(
                        a.overlaps((b - c) / 2)
                        for a, b, c in zip(columns[9:], ahead, behind, strict=True)
                    )
            rates, step = kernel_field(BallOps, mine, speed, 1)(*state), arb(2) ** -80
            velocity, change = sliding_motion(BallOps, mine, speed, state, rates[2])
            ahead = [part + step * rate for part, rate in zip(state, rates, strict=True)]
            quotient = (sliding_motion(BallOps, mine, speed, ahead)[0] - velocity) / step
            assert abs(quotient - change) < arb(2) ** -40  # step times a second derivative
            assert same(
                velocity,
                equation_terms(shifted_ops(BallOps), theirs, speed, *state).sliding_velocity,
            )


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("e", "0.045"),
        ("e", "0"),
        ("m", "0"),
        ("B", "0.25e-3"),
        ("B", "2.7e-6"),
        ("g", "-1"),
        ("mu", "0"),
        ("epsilon", "0"),
    ],
)
def test_what_is_no_disk_is_refused(name: str, value: str) -> None:
    with pytest.raises(Unproved, match="no disk has"):
        field_constants({**DISK, name: value})


def test_a_variable_without_a_rate_is_refused() -> None:
    """Its coefficients would be those that another system left behind."""
    graph = Graph()
    x, y = graph.variable(), graph.variable()
    with pytest.raises(ValueError, match="variable"):
        System(graph, [x], [x * y])


# ----------------------------------------------------------------- polynomials with balls left over
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


def convolved(a: Any, b: Any) -> Any:
    """a b + 2 a a, as the third coefficient of a product of series."""
    left, right = a.series(), b.series()
    for part in (a, a, b):
        left.append(part)
    for part in (a, a, b):
        right.append(part)
    return left.convolution(right)


def drawn(
    rng: random.Random, degree: int, middle: Fraction
) -> tuple[list[tuple[Fraction, Fraction]], list[Fraction]]:
    """Coefficients as midpoints and radii, and a choice of points from them, often the balls'
    ends.
    """
    coefficients = []
    for k in range(degree + 1):
        mid = (middle if not k else 0) + Fraction(rng.randint(-300, 300), 1000 * 3**k)
        coefficients.append((mid, Fraction(rng.choice([0, 0, 1, 20]), 1000 * 4**k)))
    return coefficients, [
        mid + rng.choice([-1, 1, Fraction(1, 3)]) * rad for mid, rad in coefficients
    ]


def at(points: list[Fraction], s: Fraction) -> Any:
    return ball(sum(part * s**k for k, part in enumerate(points)))


def test_exact_results_lie_inside() -> None:
    """Random jets and points of them: each operation's exact result lies in the jet's value
    at s, and in its range.
    """
    rng = random.Random(7)
    for _ in range(300):
        degree, s = (
            rng.choice([0, 1, 2, 2, 3, 5]),
            rng.choice([Fraction(-1), Fraction(1), Fraction(rng.randint(-9, 9), 10)]),
        )
        (first, x), (second, y) = (
            drawn(rng, degree, Fraction(1, 2)),
            drawn(rng, degree, Fraction(2)),
        )
        with working_precision(64):
            jet_a, jet_b = (
                jets.Jet([ball(mid) + arb(0, ball(rad)) for mid, rad in part])
                for part in (first, second)
            )
            results = {name: operation(jet_a, jet_b) for name, operation in OPERATIONS.items()}
            results["convolution"] = convolved(jet_a, jet_b)
            results["cut"] = jet_a.truncated(1) + jet_b
        with working_precision(300):
            a, b = at(x, s), at(y, s)
            exact = {name: operation(a, b) for name, operation in OPERATIONS.items()}
            exact["convolution"], exact["cut"] = 2 * a * b + a * a, a + b
        for name, value in results.items():
            with working_precision(64):
                shown = [
                    ball_to_measured(held)
                    for held in (evaluate_polynomial(value.coefficients, ball(s)), value.range())
                ]
            for wide in shown:
                with working_precision(300):
                    # Its ends are rational: a ball that is a hair wider than what is claimed.
                    claimed = ball(wide.value) + arb(0, ball(wide.uncertainty) + arb(2) ** -250)
                    assert inside(exact[name], claimed), (name, degree, s)
