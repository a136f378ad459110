"""Orbits of exact points side by side, to more digits than doubles have.

A set's middle is a point. Here Arb follows it through a step, for the disk's and the speed's own values, while lanes
enclose everything else: the set's deviations from the middle, the derivatives and the remainders. Those of a middle
alone are as small as the balls of its image, so doubles suffice for them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tippedisk_verify.proofs.kernel.balls import arb
from tippedisk_verify.proofs.kernel.field import Law, field
from tippedisk_verify.proofs.kernel.flow import Model, Step, Trial, Verdict, polynomial
from tippedisk_verify.proofs.kernel.lane_path import LanePath, LaneProposer, some, some_model
from tippedisk_verify.proofs.kernel.lanes import Lanes
from tippedisk_verify.proofs.kernel.section import Cases, Return
from tippedisk_verify.proofs.kernel.series import Graph, System

__all__ = ["SharpModel", "SharpPath", "SharpReturn"]

Array = NDArray[Any]


class SharpModel:
    """One disk at a speed [rad/s] for each lane; constants and speeds are balls of Arb's. ``law`` as of a `Model`."""

    def __init__(self, constants: Any, speeds: Sequence[Any], law: Law = field) -> None:
        self.lanes = Model(type(constants)(*(Lanes.of([value]) for value in constants)), Lanes.of(speeds), law)
        self.orbits = np.empty(len(speeds), object)  #: the system of each lane
        for lane, speed in enumerate(speeds):
            graph = Graph()
            variables = [graph.variable() for _ in range(3)]
            rates = law(graph, type(constants)(*map(graph.number, constants)), graph.number(speed))(*variables)
            self.orbits[lane] = System(graph, variables, [*map(graph.number, rates)])

    def some(self, which: Array) -> SharpModel:
        """The model of some lanes."""
        model = object.__new__(SharpModel)
        model.lanes, model.orbits = some_model(self.lanes, which), self.orbits[which]
        return model


@dataclass(frozen=True)
class SharpReturn(Return):
    """What is proved of boxes, and of their middles alone."""

    middle: Any = None


class SharpPath(LanePath):
    """A `LanePath` whose middles Arb follows; beside the box there is the orbit of its middle alone.

    That orbit is one of the box's, so what is proved of a step holds for it.
    """

    def __init__(self, model: SharpModel, start: Sequence[Lanes], proposer: LaneProposer) -> None:
        super().__init__(model.lanes, start, proposer)
        self.orbits = model.orbits
        self.middle = LanePath(model.lanes, [part.mid() for part in start], proposer)
        # The middle moves at the exact speed, from which nothing deviates.
        for path in (self, self.middle):
            path.frame.deviation = [*path.frame.deviation[:3], start[0].constant(0)]
            path.box = path.frame.box()

    def trial(self, orders: tuple[int, int], middle: Sequence[Any] | None = None) -> Trial:
        return _Trial(self, orders, middle)

    def _of_middle(self, step: Step) -> Step:
        """The step with the set of the middle alone; where its end is does not depend on the set."""
        own = replace(step, frame=self.middle.frame)
        vars(own)["end"] = step.end
        return own

    def _turn(self, step: Step, case: Cases, proved: Array) -> None:
        self.middle._turn(self._of_middle(step), case, proved)
        super()._turn(step, case, proved)

    def _land(self, step: Step, case: Cases, proved: Array) -> tuple[Array, Return | None]:
        among, landed = self.middle._land(self._of_middle(step), case, proved)
        arrived, landing = super()._land(step, case, proved)
        if landing is not None:
            landing = SharpReturn(**vars(landing), middle=some(landed, np.isin(among, arrived)))
        return arrived, landing

    def go_on(self, step: Step, proved: Array, crossing: Any = None) -> None:
        self.middle.go_on(self._of_middle(step), proved)
        super().go_on(step, proved, crossing)

    def some(self, which: Array) -> SharpPath:
        path = super().some(which)
        path.middle = self.middle.some(which)
        return path


class _Trial(Trial):
    """Adds the middles' series to the steps that are proved."""

    path: SharpPath

    def tested(self, verdict: Verdict) -> Step:
        step = super().tested(verdict)
        columns = np.empty(len(verdict.included), object)
        starts = np.array([part.midpoints for part in self.path.frame.middle]).T
        for lane, proved in enumerate(verdict.included):
            # A middle is a point where it is finite, which it is where the step is proved.
            if proved:
                start = [arb(float(part)) for part in starts[lane]]
                series = self.path.orbits[lane].coefficients(start, self.orders[0])
                columns[lane] = [[*c, r.arb(lane)] for c, r in zip(series, verdict.fine, strict=True)]
        return _Step(**vars(step), columns=columns)


@dataclass(frozen=True)
class _Step(Step):
    """A step with the series of each lane's middle, None where it is not proved."""

    columns: Array

    def centre(self, time: Lanes) -> Sequence[_Image]:
        images = [
            [arb.nan()] * 3 if columns is None else [polynomial(column, time.arb(lane)) for column in columns]
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
