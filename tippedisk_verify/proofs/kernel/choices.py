"""The choices of a proof as a certificate has them, read again.

A flight's log has an entry for each step taken. "steps": the length and the orders tested, and of a step in which the
sliding velocity changes its sign those of the step behind the change too; and the axes of the set that it ends with.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from types import SimpleNamespace
from typing import Any

from tippedisk_verify.proofs.kernel.balls import Unproved, arb, need
from tippedisk_verify.proofs.kernel.flow import Path
from tippedisk_verify.proofs.kernel.krawczyk import FixedPoints
from tippedisk_verify.proofs.kernel.reading import dyadic, order, radius
from tippedisk_verify.proofs.kernel.section import Return
from tippedisk_verify.proofs.kernel.step import Step

__all__ = ["BOX", "FLIGHT", "Replay", "ReplayedTest"]


def _tested(value: Any) -> tuple[float, tuple[int, int]]:
    """A step's length [s], and its two orders."""
    if not isinstance(value, list) or len(value) != 3:
        raise ValueError("a length and two orders are needed")
    point = dyadic(value[0])
    length = float(point)
    if not arb(length) == point:
        raise ValueError("a length has at most 53 bits")
    return length, (order(value[1]), order(value[2]))


FLIGHT = [{"steps": [_tested, None], "axes": [[dyadic, 3], 3]}, None]
BOX = {"radii": [radius, 2], "inverse": [[dyadic, 2], 2], "flight": FLIGHT}  #: of a Krawczyk test


class Replay:
    """The proposer of a flight that takes the steps of a log, and no others. What fails is said with the step."""

    def __init__(self, log: Sequence[Mapping[str, Any]], name: str) -> None:
        self.log, self.name = log, name
        self.number = 0
        self._open = False  #: whether the step proposed last has not been taken
        self._parts: Iterator[Any] = iter(())

    def step(self, path: Path, longest: float | None) -> Step | None:
        need(not self._open, f"{self._place()}: its signs are not shown, or it may touch gamma_y = 0")
        need(self.number < len(self.log), f"{self.name}: its steps end on the way")
        self.number, self._open = self.number + 1, True
        self._parts = iter(self.log[self.number - 1]["steps"])
        return self.next_part(path)

    def next_part(self, path: Path) -> Step | None:
        """The next of the steps of the present entry, tested; None if there is no other."""
        part = next(self._parts, None)
        if part is None:
            return None
        length, orders = part
        step = path.trial(orders).tested(length)
        need(
            step.included, f"{self._place()}: the states and derivatives over it are not shown to stay in its enclosure"
        )
        return step

    def beyond(self) -> Any:
        return SimpleNamespace(step=lambda path, longest: self.next_part(path))

    def axes(self, turned: Any, sizes: Any, stiffness: Any) -> Any:
        return self.log[self.number - 1]["axes"]

    def took(self, step: Step, axes: Any) -> None:
        self._open = False

    def _place(self) -> str:
        return f"{self.name}, step {self.number}"


class ReplayedTest:
    """The choices of a Krawczyk test, from the evidence about its middle and its box."""

    def __init__(self, centre: Sequence[Any], box: Mapping[str, Any], name: str) -> None:
        self.name = name
        self.centre, self.box = Replay(centre, f"{name}, centre"), Replay(box["flight"], f"{name}, box")
        self._inverse = box["inverse"]

    def inverse(self, matrix: Any) -> Any:
        return self._inverse

    def passed(self, outcome: FixedPoints | Return, *, first: bool = True) -> FixedPoints:
        """The fixed points, if the test was passed and all of the logs was read; of the middle's if it was ``first``.

        Raises Unproved if not.
        """
        if isinstance(outcome, Return):
            raise Unproved(f"{self.name}: at t = {float(outcome.reached):.4g} s: {outcome.status.value}")
        for flight in (self.centre, self.box)[1 - first :]:
            need(flight.number == len(flight.log), f"{flight.name}: it has steps that nothing asks for")
        need(outcome.included, f"{self.name}: Krawczyk's image is not shown to lie inside the box")
        return outcome
