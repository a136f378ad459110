"""Choices made without sense: what passes the kernel's tests is true all the same."""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Any

import pytest

from tests.proofs.cases import half_flight
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.proofs.kernel.balls import arb, ball, working_precision
from tippedisk_verify.proofs.kernel.flow import Path, Status, short_float
from tippedisk_verify.proofs.kernel.section import HALF, returned
from tippedisk_verify.proofs.kernel.sliding import model_of
from tippedisk_verify.proofs.kernel.step import Step
from tippedisk_verify.proofs.search.steps import Steps

OMEGA, START = "30.4", (1.7, -1.72)


class Careless(Steps):
    """Draws lengths, orders and axes."""

    def __init__(self, draw: random.Random) -> None:
        super().__init__()
        self.draw = draw

    def beyond(self) -> Careless:
        return Careless(self.draw)

    def step(self, path: Path, longest: float | None) -> Step | None:
        for _ in range(60):
            trial = path.trial((self.draw.randint(2, 24), self.draw.randint(2, 12)))
            step = trial.tested(short_float(min(2.0 ** -self.draw.uniform(6, 11), longest or 1.0)))
            if step.included:
                return step
        return None

    def axes(self, turned: Any, sizes: Any, stiffness: Any) -> Sequence[Sequence[Any]]:
        chosen = super().axes(turned, sizes, stiffness)
        return [[entry + self.draw.uniform(-0.1, 0.1) / stiffness for entry in row] for row in chosen]


@pytest.mark.slow(minutes=1)
@pytest.mark.parametrize("friction", ["linear", "smooth"])
def test_what_careless_choices_show_is_true(friction: str) -> None:
    parameters, size = PRINTED.with_friction(friction), arb("1e-9")
    with working_precision(120):
        truth = half_flight(model_of(parameters, ball(OMEGA)), *map(ball, START), derivatives=True)
    shown = 0
    for seed in range(5):
        with working_precision(64):
            box = [part + arb(0, size) for part in map(ball, START)]
            proposer = Careless(random.Random(seed))
            flight = returned(model_of(parameters, ball(OMEGA)), HALF, box, proposer, derivatives=True)
        if flight.status is not Status.RETURNED:
            continue
        shown += 1
        assert flight.reversals == truth.reversals
        for mine, true in (
            (flight.time, truth.time),
            (flight.beta_least, truth.beta_least),
            *zip(flight.image, truth.image, strict=True),
            *zip(flight.by_omega, truth.by_omega, strict=True),
            *zip((*flight.matrix[0], *flight.matrix[1]), (*truth.matrix[0], *truth.matrix[1]), strict=True),
        ):
            assert mine.contains(true.mid())
    assert shown
