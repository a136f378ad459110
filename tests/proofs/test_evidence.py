"""Evidence made without sense: what passes the kernel's tests is true all the same."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import pytest

from tests.proofs.cases import half_flight
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.proofs.ball_conversions import field_for_disk
from tippedisk_verify.proofs.kernel.balls import arb, ball, working_precision
from tippedisk_verify.proofs.kernel.poincare_map import (
    LIBRATING_SECTION,
    PoincareImage,
    enclose_poincare_map,
)
from tippedisk_verify.proofs.kernel.proved_flow import EnclosedFlight, FlightStopped
from tippedisk_verify.proofs.kernel.step import Step, StepTrial
from tippedisk_verify.proofs.search.step_search import FlightStepSearch, rounded_down_to_20_bits

OMEGA, START = "30.4", (1.7, -1.72)


class CarelessSearch(FlightStepSearch):
    """Draws lengths, orders and axes."""

    def __init__(self, draw: random.Random) -> None:
        super().__init__()
        self.draw = draw

    def after_reversal(self) -> CarelessSearch:
        return CarelessSearch(self.draw)

    def next_step(self, flight: EnclosedFlight, max_length: float | None) -> Step | None:
        for _ in range(60):
            trial = StepTrial(flight, (self.draw.randint(2, 24), self.draw.randint(2, 12)))
            step = trial.tested_step(
                rounded_down_to_20_bits(min(2.0 ** -self.draw.uniform(6, 11), max_length or 1.0))
            )
            if step.included:
                return step
        return None

    def new_axes(self, turned: Any, sizes: Any, stiffness: Any) -> Sequence[Sequence[Any]]:
        chosen = super().new_axes(turned, sizes, stiffness)
        return [
            [entry + self.draw.uniform(-0.1, 0.1) / stiffness for entry in row] for row in chosen
        ]


@pytest.mark.slow(minutes=1)
@pytest.mark.parametrize("friction", ["linear", "smooth"])
def test_what_careless_evidence_shows_is_true(friction: str) -> None:
    parameters, size = PRINTED.with_friction(friction), arb("1e-9")
    with working_precision(120):
        truth = half_flight(
            field_for_disk(parameters, ball(OMEGA)), *map(ball, START), derivatives=True
        )
    shown = 0
    for seed in range(5):
        with working_precision(64):
            box = [part + arb(0, size) for part in map(ball, START)]
            proposer = CarelessSearch(random.Random(seed))
            try:
                image = enclose_poincare_map(
                    field_for_disk(parameters, ball(OMEGA)),
                    LIBRATING_SECTION,
                    box,
                    proposer,
                    derivatives=True,
                )
            except FlightStopped:
                continue
        shown += 1
        assert image.reversals == truth.reversals
        for mine, true in (
            (image.time, truth.time),
            (image.beta_least, truth.beta_least),
            *zip(image.image, truth.image, strict=True),
            *zip(
                (*image.image_by_start[0], *image.image_by_start[1]),
                (*truth.image_by_start[0], *truth.image_by_start[1]),
                strict=True,
            ),
        ):
            assert mine.contains(true.mid())
    assert shown


class StaleTrialSearch(FlightStepSearch):
    """Keeps a trial when the flight has moved on."""

    trial: Any = None

    def next_step(self, flight: EnclosedFlight, max_length: float | None) -> Step | None:
        self.trial = self.trial or StepTrial(flight, (16, 8))
        return self.trial.tested_step(2.0**-9)


class ForgingSearch(FlightStepSearch):
    """Hands over another step than the one that was tested."""

    def __init__(self, forged: Callable[[Step], Step]) -> None:
        super().__init__()
        self.forged = forged

    def next_step(self, flight: EnclosedFlight, max_length: float | None) -> Step | None:
        step = super().next_step(flight, max_length)
        return None if step is None else self.forged(step)


class MeddlingSearch(FlightStepSearch):
    """Writes into what it is shown."""

    def new_axes(self, turned: Any, sizes: Any, stiffness: Any) -> Sequence[Sequence[Any]]:
        chosen = [[*row] for row in super().new_axes([[*row] for row in turned], sizes, stiffness)]
        for row in turned:
            row[:] = [entry / 1024 for entry in row]
        return chosen

    def record_step(self, step: Any, axes: Any) -> None:
        super().record_step(step, [[*row] for row in axes])
        for row in axes:
            row[:] = [entry / 1024 for entry in row]


def flown(proposer: FlightStepSearch) -> PoincareImage:
    with working_precision(96):
        box = [part + arb(0, 2.0**-13) for part in map(ball, ("0.4", "-2"))]
        return enclose_poincare_map(
            field_for_disk(PRINTED, ball("30.4")),
            LIBRATING_SECTION,
            box,
            proposer,
            derivatives=True,
        )


def test_the_kernel_believes_its_own_steps_only() -> None:
    honest = flown(FlightStepSearch())
    doubled = ForgingSearch(lambda step: replace(step, length=2 * step.length))
    for proposer in (StaleTrialSearch(), doubled):
        with pytest.raises(ValueError, match="not the latest trial"):
            flown(proposer)
    shifted = ForgingSearch(
        lambda step: replace(step, polynomials=[[1 + c[0], *c[1:]] for c in step.polynomials])
    )
    for proposer in (shifted, MeddlingSearch()):
        image = flown(proposer)
        for mine, its in zip((image.time, *image.image), (honest.time, *honest.image), strict=True):
            assert (mine.mid(), mine.rad()) == (its.mid(), its.rad())
