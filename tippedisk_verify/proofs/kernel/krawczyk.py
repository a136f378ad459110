"""Krawczyk's test for fixed points of a section's map, one for each value of a parameter.

Three numbers describe a fixed point: the first coordinate on the section, v and Omega. Two of them,
u, are unknown, and the third, p, is in a ball. Let F = P - 1, let m be the middle of all three, and
take a box of u about it and any regular matrix Y. Then

    K = m_u - Y F(m) - Y F_p (p - m_p) + (1 - Y F_u) (u - m_u)

holds every zero u of F(., p) in the box, for each p of the ball. For by the mean value theorem F(u,
p) = F(m) + F_p (p - m_p) + F_u (u - m_u), with derivatives in the balls over the box. If K lies in
the box's interior, there is exactly one zero for each p, and all matrices F_u are regular (Krawczyk
1969; Moore 1977; Rump 1983).

**The evidence in a certificate.** A flight's log has an entry for each step taken. Its "steps" are
the length and the orders tested. If the sliding velocity changes its sign in the step, those of the
step after the change follow. Its "axes" are those of the set at the step's end. A test has the logs
of two flights, the radii of its box, and Y.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from tippedisk_verify.proofs.kernel.balls import Unproved, arb, inside, require
from tippedisk_verify.proofs.kernel.certificate_format import read_dyadic, read_order, read_radius
from tippedisk_verify.proofs.kernel.poincare_map import (
    PoincareImage,
    PoincareSection,
    enclose_poincare_map,
)
from tippedisk_verify.proofs.kernel.proved_flow import EnclosedFlight, FlightStopped, StepProposer
from tippedisk_verify.proofs.kernel.sliding import field_for_friction
from tippedisk_verify.proofs.kernel.small_matrices import matrix_times_vector
from tippedisk_verify.proofs.kernel.step import Step, StepTrial
from tippedisk_verify.proofs.kernel.vector_field import field_constants

__all__ = [
    "BOX_SHAPE",
    "FLIGHT_SHAPE",
    "KrawczykResult",
    "StepReplay",
    "apply_krawczyk_operator",
    "krawczyk_test",
    "replayed_test",
]


@dataclass(frozen=True)
class KrawczykResult:
    """The result of Krawczyk's test: if a box contains a fixed point of a section's Poincare map.

    If ``included``, the box contains exactly one fixed point for each value of the third number.
    """

    included: bool
    middle: Sequence[Any]  #: m, three points
    shift: Sequence[Any]  #: from the middle to the fixed points, three balls
    preconditioner: Sequence[Sequence[Any]]  #: Y
    residual: Sequence[Any]  #: Y F(m), for choosing the precision
    jacobian: Sequence[Sequence[Any]]  #: (2, 3): the derivatives of F over the box
    centre: PoincareImage  #: the map at the middle
    box: PoincareImage  #: the map over the box, with derivatives

    @property
    def image(self) -> list[Any]:
        """Three balls that hold the fixed points: both coordinates on the section, and Omega."""
        return [middle + part for middle, part in zip(self.middle, self.shift, strict=True)]

    def mean_value_form(self, value: Any, by: Sequence[Any]) -> Any:
        """Enclose a function at the fixed points by the mean value theorem.

        ``value`` is the function at the middle of the box. ``by`` are its derivatives with respect
        to the three numbers, enclosed over the box.
        """
        return value + by[0] * self.shift[0] + by[1] * self.shift[1] + by[2] * self.shift[2]


def krawczyk_test(
    setting: Mapping[str, Any],
    section: PoincareSection,
    middle: Sequence[Any],
    deviations: Sequence[Any],
    unknown_indices: tuple[int, int],
    proposers: tuple[StepProposer, StepProposer],
    inverse: Callable[[Sequence[Sequence[Any]]], Sequence[Sequence[Any]]],
    centre: PoincareImage | None = None,
) -> KrawczykResult:
    """Test by Krawczyk's operator if a section's Poincare map has exactly one fixed point in a box.

    Args:
        setting: Contains the disk and the friction law (``parameters``, ``friction``).
        section: The section of the map.
        middle: The centre of the box, three exact numbers: both coordinates on the section, and
            Omega.
        deviations: Three balls about zero; the box is ``middle`` plus these.
        unknown_indices: The indices of the two unknown numbers.
        proposers: For the flight from the middle, and for the flight over the box.
        inverse: Returns Y, four points, given F_u over the box.
        centre: The map at the middle, if it has already been computed.

    Returns:
        The test's result.

    Raises:
        FlightStopped: If one of the two flights is not shown to return.
    """
    numbers, friction = field_constants(setting["parameters"]), setting["friction"]
    if centre is None:
        centre = enclose_poincare_map(
            field_for_friction(friction, numbers, middle[2]), section, middle[:2], proposers[0]
        )
    whole = [point + part for point, part in zip(middle, deviations, strict=True)]
    box = enclose_poincare_map(
        field_for_friction(friction, numbers, whole[2]),
        section,
        whole[:2],
        proposers[1],
        derivatives=True,
    )
    return apply_krawczyk_operator(middle, deviations, unknown_indices, inverse, centre, box)


def apply_krawczyk_operator(
    middle: Sequence[Any],
    deviations: Sequence[Any],
    unknown_indices: tuple[int, int],
    inverse: Callable[[Sequence[Sequence[Any]]], Sequence[Sequence[Any]]],
    centre: PoincareImage,
    box: PoincareImage,
) -> KrawczykResult:
    """Apply Krawczyk's operator to a section's map that has been enclosed already, and return the
    result of the test.

    Args:
        middle: Three points: the two coordinates on the section, and Omega.
        deviations: Three balls about zero; the box is ``middle`` plus these.
        unknown_indices: The indices of the two unknown numbers.
        inverse: Returns the matrix Y, given F_u over the box: any regular one, best near the
            inverse of F_u.
        centre: The map at the middle.
        box: The map over the box, with derivatives.
    """
    value = [after - before for after, before in zip(centre.image, middle, strict=False)]
    (a, b, e), (c, d, f) = box.image_by_start
    jacobian = (a - 1, b, e), (c, d - 1, f)
    preconditioner = inverse([[row[k] for k in unknown_indices] for row in jacobian])
    (other,) = {0, 1, 2}.difference(unknown_indices)
    width = [deviations[k] for k in unknown_indices]
    rest = [
        [
            int(i == j) - sum(preconditioner[i][k] * jacobian[k][column] for k in range(2))
            for j, column in enumerate(unknown_indices)
        ]
        for i in range(2)
    ]
    residual = matrix_times_vector(preconditioner, value)
    # p's part is one ball that both equations share. Its factors are summed first, because their
    # sum may nearly vanish.
    moved = matrix_times_vector(preconditioner, [row[other] for row in jacobian])
    shift = list(deviations)
    for k, spread, part, factor in zip(
        unknown_indices, matrix_times_vector(rest, width), residual, moved, strict=True
    ):
        shift[k] = spread - part - factor * deviations[other]
    included = all(inside(shift[k], deviations[k]) for k in unknown_indices)
    return KrawczykResult(included, middle, shift, preconditioner, residual, jacobian, centre, box)


def _read_step(value: Any) -> tuple[float, tuple[int, int]]:
    """Return a step's length [s] and its two orders, read from a certificate."""
    if not isinstance(value, list) or len(value) != 3:
        raise ValueError("a length and two orders are needed")
    point = read_dyadic(value[0])
    length = float(point)
    if not arb(length) == point:
        raise ValueError("a length has at most 53 bits")
    return length, (read_order(value[1]), read_order(value[2]))


FLIGHT_SHAPE = [{"steps": [_read_step, None], "axes": [[read_dyadic, 3], 3]}, None]
BOX_SHAPE = {
    "radii": [read_radius, 2],
    "inverse": [[read_dyadic, 2], 2],
    "flight": FLIGHT_SHAPE,
}  #: of a Krawczyk test


class StepReplay:
    """A source of the steps of one flight, which repeats those of a certificate's log and no
    others.

    Raises Unproved, with the step's number, if a step fails or the log ends too early.
    """

    def __init__(self, log: Sequence[Mapping[str, Any]], name: str) -> None:
        self.log, self.name = log, name
        self.number = 0
        self._is_pending = False  # True while the latest proposed step has not been taken
        self._recorded_parts: Iterator[Any] = iter(())

    def next_step(self, flight: EnclosedFlight, max_length: float | None) -> Step | None:
        require(
            not self._is_pending,
            f"{self._step_name()}: its signs are not shown, or it may touch gamma_y = 0",
        )
        require(self.number < len(self.log), f"{self.name}: its steps end before the flight does")
        self.number, self._is_pending = self.number + 1, True
        self._recorded_parts = iter(self.log[self.number - 1]["steps"])
        return self.next_recorded_step(flight)

    def next_recorded_step(self, flight: EnclosedFlight) -> Step | None:
        """Return the next step that the log's current entry records, after testing it. Return None
        if the entry has no more steps.
        """
        part = next(self._recorded_parts, None)
        if part is None:
            return None
        length, orders = part
        step = StepTrial(flight, orders).tested_step(length)
        require(
            step.included,
            f"{self._step_name()}: the states and derivatives over it are not shown to "
            f"stay in its enclosure",
        )
        return step

    def after_reversal(self) -> Any:
        return SimpleNamespace(next_step=lambda flight, max_length: self.next_recorded_step(flight))

    def new_axes(self, moved_axes: Any, sizes: Any, stiffness: Any) -> Any:
        return self.log[self.number - 1]["axes"]

    def record_step(self, step: Step, axes: Any) -> None:
        self._is_pending = False

    def _step_name(self) -> str:
        return f"{self.name}, step {self.number}"


def replayed_test(
    setting: Mapping[str, Any],
    section: PoincareSection,
    middle: Sequence[Any],
    deviations: Sequence[Any],
    unknown_indices: tuple[int, int],
    log: Sequence[Mapping[str, Any]],
    box: Mapping[str, Any],
    name: str,
    centre: PoincareImage | None = None,
) -> KrawczykResult:
    """Apply `krawczyk_test` with the evidence that a certificate records, and return the passed
    test.

    ``log`` is the log of the flight from the middle, ``box`` has the shape `BOX_SHAPE`, and
    ``name`` begins the messages. Raises Unproved if the test fails, or if a part of the logs is not
    used.
    """
    replays = StepReplay(log, f"{name}, centre"), StepReplay(box["flight"], f"{name}, box")
    try:
        fixed = krawczyk_test(
            setting,
            section,
            middle,
            deviations,
            unknown_indices,
            replays,
            lambda matrix: box["inverse"],
            centre,
        )
    except FlightStopped as fault:
        raise Unproved(f"{name}: at {fault}") from None
    for replay in replays if centre is None else replays[1:]:
        require(replay.number == len(replay.log), f"{replay.name}: it has unused steps")
    require(fixed.included, f"{name}: Krawczyk's image is not shown to lie inside the box")
    return fixed
