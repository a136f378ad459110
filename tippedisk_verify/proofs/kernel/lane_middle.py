"""Orbits of exact points side by side, to more digits than doubles have.

A set's middle is a point. Here Arb follows it through a step, for the disk's and the speed's own values, while lanes
enclose everything else: the set's deviations from the middle, the derivatives and the remainders. Those of a middle
alone are as small as the balls of its image, so doubles suffice for them.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from tippedisk_verify.proofs.kernel.balls import arb
from tippedisk_verify.proofs.kernel.batch import some, some_model
from tippedisk_verify.proofs.kernel.field import Law, field
from tippedisk_verify.proofs.kernel.flow import Model, Path
from tippedisk_verify.proofs.kernel.lanes import Lanes
from tippedisk_verify.proofs.kernel.section import Return, Round, Section, Walk
from tippedisk_verify.proofs.kernel.series import Graph, System
from tippedisk_verify.proofs.kernel.step import Step, Trial, polynomial

__all__ = ["SharpModel", "SharpReturn", "SharpWalk"]

Array = NDArray[Any]


class SharpModel:
    """One disk at a speed [rad/s] for each lane; constants and speeds are balls of Arb's. ``law`` as of a `Model`."""

    def __init__(self, constants: Any, speeds: Sequence[Any], law: Law = field) -> None:
        self.lanes = _Lanes(type(constants)(*(Lanes.of([value]) for value in constants)), Lanes.of(speeds), law)
        self.orbits = np.empty(len(speeds), object)  #: the system of each lane
        for lane, speed in enumerate(speeds):
            graph = Graph()
            variables = [graph.variable() for _ in range(3)]
            rates = law(graph, type(constants)(*map(graph.number, constants)), graph.number(speed))(*variables)
            self.orbits[lane] = System(graph, variables, [*map(graph.number, rates)])

    def some(self, which: Array) -> SharpModel:
        """The model of some lanes."""
        model = copy(self)
        model.lanes, model.orbits = some_model(self.lanes, which), self.orbits[which]
        return model

    def path(self, start: Sequence[Lanes], proposer: Any, *, derivatives: bool) -> Path:
        """All orbits from a box in each lane."""
        path = _Path(self.lanes, start, proposer, derivatives=derivatives)
        path.orbits = self.orbits
        return path


class _Lanes(Model):
    """Remainders hold for all speeds of the balls: a middle moves at the exact one, not at a double."""

    def __init__(self, constants: Any, omega: Any, law: Law | None = None) -> None:
        super().__init__(constants, omega, law)
        self.orbit = self.orbit_at(self.omega)


@dataclass(frozen=True)
class SharpReturn(Return):
    """What is proved of boxes, and of their middles alone."""

    middle: Any = None


class SharpWalk(Walk):
    """A `Walk` whose middles Arb follows; beside the box there is the orbit of its middle alone.

    That orbit is one of the box's, so what is proved of a step holds for it.
    """

    def __init__(
        self, model: SharpModel, section: Section, box: Sequence[Lanes], proposer: Any, *, derivatives: bool = False
    ) -> None:
        super().__init__(model, section, box, proposer, derivatives=derivatives)  # type: ignore[arg-type]
        self.middle = Walk(model.lanes, section, [part.mid() for part in box], proposer, derivatives=derivatives)
        # The middle moves at the exact speed, from which nothing deviates.
        for path in (self.path, self.middle.path):
            path.frame.deviation = [*path.frame.deviation[:3], box[0].constant(0)]
            path.box = path.frame.box()

    def some(self, which: Any) -> Self:
        walk = super().some(which)
        walk.middle = self.middle.some(which)
        return walk

    def _of_middle(self, step: Step) -> Step:
        """The step with the set of the middle alone; where its end is does not depend on the set."""
        own = replace(step, frame=self.middle.path.frame)
        vars(own)["end"] = step.end
        return own

    def _advance(self, step: Step) -> Round:
        own = self._of_middle(step)
        tried = super()._advance(step)
        moving = tried.proved & ~tried.arrived
        if moving.any():
            self.middle.path.take(own, where=moving)
        return tried

    def _turn(self, step: Step, turning: Any, proved: Any) -> Any:
        proved = self.middle._turn(self._of_middle(step), turning, proved)
        return super()._turn(step, turning & proved, proved)

    def _land(self, step: Step, crossing: Any, speed: Any) -> tuple[Any, Return | None]:
        among, landed = self.middle._land(self._of_middle(step), crossing, speed)
        arrived, landing = super()._land(step, among, speed)
        if landing is not None:
            landing = SharpReturn(**vars(landing), middle=some(landed, arrived[among]))
        return arrived, landing


class _Path(Path):
    """With the system of each lane's middle."""

    BATCHED = (*Path.BATCHED, "orbits")
    orbits: Array

    def trial(self, orders: tuple[int, int]) -> Trial:
        return _Trial(self, orders)


class _Trial(Trial):
    """Adds the middles' series to the steps that are proved."""

    def _step(self, length: Lanes) -> Step:
        step = super()._step(length)
        columns = np.empty(len(length), object)
        starts = np.array([part.midpoints for part in self.frame.middle]).T
        remainders = [series[-1] for series in step.polynomials]
        for lane in np.flatnonzero(step.included):
            # A middle is a point where it is finite, which it is where the step is proved.
            start = [arb(float(part)) for part in starts[lane]]
            series = self.path.orbits[lane].coefficients(start, self.orders[0])
            columns[lane] = [[*c, r.arb(lane)] for c, r in zip(series, remainders, strict=True)]
        return _Step(**vars(step), columns=columns)


@dataclass(frozen=True)
class _Step(Step):
    """A step with the series of each lane's middle, None where it is not proved."""

    columns: Any = None

    def centre(self, time: Lanes, components: slice = slice(3)) -> Sequence[_Image]:
        empty = [[arb.nan()]] * 3
        images = [
            [polynomial(column, time.arb(lane)) for column in (columns or empty)[components]]
            for lane, columns in enumerate(self.columns)
        ]
        return [_Image(part) for part in zip(*images, strict=True)]


class _Image:
    """A component of the middles' images: a double in each lane, and what the image differs from it."""

    def __init__(self, balls: Sequence[Any]) -> None:
        points = [float(part.mid()) for part in balls]
        self.point = Lanes(points)
        self.rest = Lanes.of([part - arb(point) for part, point in zip(balls, points, strict=True)])

    def mid(self) -> Lanes:
        return self.point.mid()  # of a subnormal double there is a ball

    def __sub__(self, point: Lanes) -> Lanes:
        return self.rest + (self.point - point)

    def __add__(self, other: Lanes) -> Lanes:
        return self.point + (self.rest + other)
