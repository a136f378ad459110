"""The search for the proof of the cycles near Omega_h, next to the connection
(`kernel.certificates.cycles_near_omega_h`).

Extents and weights of cones fit the three named disks and those near them. Other weights follow
from the kernel's enclosures. The lid eta is a little more than the bound of |z_u| after one round
at the largest speed. It is raised until the worst of the flights arrives above it.

Balls become points and floats everywhere: any evidence that the kernel accepts is right.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction
from typing import Any

import numpy as np
from flint import arb, arb_mat
from numpy.typing import NDArray

from tippedisk_verify.errors import InputError
from tippedisk_verify.model import equations
from tippedisk_verify.numbers.decimals import exact_text
from tippedisk_verify.numbers.exact import exact, short_text
from tippedisk_verify.numbers.precision import DOUBLE
from tippedisk_verify.proofs.ball_conversions import ball_to_measured
from tippedisk_verify.proofs.closed_forms import refuse_past_birth
from tippedisk_verify.proofs.kernel.balls import Unproved, ball, working_precision
from tippedisk_verify.proofs.kernel.certificates.connection import EnclosedConnection
from tippedisk_verify.proofs.kernel.certificates.cycles_near_omega_h import (
    CLAIM_SHAPE,
    LID_REFUSAL,
    EnclosedCyclesNearOmegaH,
    LoopMap,
    verify_cycles,
)
from tippedisk_verify.proofs.kernel.saddle import magnitude_bound
from tippedisk_verify.proofs.kernel.saddle_passage import SaddlePassage
from tippedisk_verify.proofs.search.connection_proof import ConnectionProof, eigenvectors
from tippedisk_verify.proofs.search.proof_search import (
    EvidenceSearch,
    Proof,
    SearchStopped,
    certificate_claim,
    first_success,
)

__all__ = [
    "CyclesNearOmegaHProof",
    "CyclesNearOmegaHStatus",
    "checked_distance",
    "prove_cycles_near_omega_h",
]

# u, s, t: the extent of |z_f| allows starts on the section beta = pi/2 off the slow manifold
_EXTENTS = (Fraction(1, 5), Fraction(1, 5), Fraction(3, 10))
_CELLS = (32, 6)  # numbers of cells along half of z_u and z_s, and along half of z_f
_STEEP_WEIGHTS = (Fraction(1), Fraction(1, 8), Fraction(1))
_COMPOUND_WEIGHTS = (Fraction(1, 2), Fraction(1))
_RETURN_RATE = Fraction(10)  # 1/s, between the two roots of p^2 - a_2 p + a_1
_THIN_SLOPE = Fraction(1, 8)
_SAFETY_FACTOR = arb(17) / 16  # the factor by which an inequality is exceeded
_ENTRY_FAST_EXTENT, _FAST_WEIGHT = Fraction(1, 512), Fraction(1, 4)  # t_0 and w
_SPEED_CELL, _SLOW_CELL = 2e-3, 4e-3  # lengths of the exits' cells in the speed [rad/s] and in z_s
_LID_FACTOR = 1.01  # the lid relative to the bound from the largest speed's orbit
_EXCESS_WIDTH = 0.15  # the excess width of an enclosure relative to a cell's image; measured
_SEARCH_ROUNDS, _ATTEMPTS = 60, 8
# s; over a longer step a box's enclosure is too wide where the fast direction contracts
_MAX_STEP = 0.005
_FLIGHT_STEP, _MAX_FLIGHT_STEPS = (
    1e-3,
    3000,
)  # length [s] and largest number of steps of the single flights

Array = NDArray[np.float64]


class CyclesNearOmegaHStatus(Enum):
    """The ways in which a proof of the limit cycles next to the heteroclinic connection can end;
    each value is a message with what to try next.
    """

    PROVED = "proved"
    NO_CONNECTION = (
        "the connection itself is not proved: give the answer of `prove_connection` with its digits"
    )
    NO_LID = "no cycle passes the saddle near enough at the largest speed: ask for a smaller reach"
    FLIGHT = "the flight between the saddles could not be enclosed: ask for a smaller reach"
    INEQUALITY = "an inequality of the proof does not hold: ask for a smaller reach"
    APART = "the connection could not be followed into the box of its own theorem: prove it to more digits"


@dataclass(frozen=True, repr=False)
class CyclesNearOmegaHProof(Proof):
    """The proof of the limit cycles next to the heteroclinic connection, successful or not.

    If the status is PROVED, it holds at speeds from ``low`` to ``high`` [rad/s].
    """

    status: CyclesNearOmegaHStatus
    connection: ConnectionProof
    low: Fraction = Fraction(0)
    high: Fraction = Fraction(0)
    gamma: Fraction = Fraction(0)  #: c [rad]
    v: Fraction = Fraction(0)  #: d [rad/s]
    numbers: dict[str, str] = field(default_factory=dict)  #: kappa and other sizes in the proof
    outcome_detail: str = ""  #: the inequality that fails
    own_evidence: dict[str, Any] = field(
        default_factory=dict
    )  #: those that the kernel has accepted

    @property
    def bits(self) -> int:  # type: ignore[override]
        return self.connection.bits

    @property
    def claim(self) -> dict[str, Any]:
        """The claim of the certificate about these limit cycles, as a dictionary. It exists only if
        the connection is proved.
        """
        assert self.connection.omega_h is not None
        numbers, texts = (
            {"omega_h": self.connection.omega_h},
            {name: getattr(self, name) for name in CLAIM_SHAPE},
        )
        return certificate_claim(
            "cycles next to the connection", self.connection.parameters, numbers, **texts
        )

    @property
    def evidence(self) -> dict[str, Any]:
        """The evidence that the kernel has accepted, for the certificate, with that of the
        connection's proof and its claim.
        """
        eigenvalues = [
            (number.value, number.uncertainty) for number in self.connection.saddle_eigenvalues
        ]
        claimed = {"eigenvalues": eigenvalues, "room": self.connection.room}
        return self.own_evidence and self.own_evidence | {
            "connection": {**self.connection.evidence, **claimed}
        }

    def contains_cycle(self, omega: Any, gamma_bar: Any, v: Any) -> bool:
        """Return True if a fixed point of the half map in these balls is a limit cycle of this
        proof.

        This must hold at all speeds of the ball ``omega``. Then a curve of cycles that is proved
        for these balls is the same curve.
        """
        if not self.proved or self.connection.omega_h is None:
            return False
        above = self.connection.omega_h.value + self.connection.omega_h.uncertainty
        return EnclosedCyclesNearOmegaH(
            self.low, self.high, above, self.gamma, self.v
        ).contains_cycle(omega, gamma_bar, v)

    def to_dict(self) -> dict[str, object]:
        omega_h, names = self.connection.omega_h, ("from", "to", "gamma", "v")
        return {
            "proved": self.proved,
            "status": self.status.name.lower(),
            "statement": self.statement,
            "omega_h": None if omega_h is None else omega_h.to_dict(),
            **{
                name: exact_text(getattr(self, field))
                for name, field in zip(names, CLAIM_SHAPE, strict=True)
            },
            "numbers": self.numbers,
        }


def prove_cycles_near_omega_h(
    connection: ConnectionProof,
    above: object = "0.008",
    below: object = "0.0015",
    on_progress: Callable[[float], None] = lambda share: None,
) -> CyclesNearOmegaHProof:
    """Prove the limit cycles at speeds just above Omega_h, and their absence just below it.

    The speeds go from ``below`` under a proved connection to ``above`` over it. Both distances
    [rad/s] count from Omega_h rounded to four decimals. ``on_progress`` is called with the share of
    the flights that is done. Raises InputError for the smooth law and for distances out of range,
    and NoConnectionError as `eigenvectors` does.
    """
    parameters, omega_h = connection.parameters, connection.omega_h
    distance_above, distance_below = checked_distance(above), checked_distance(below)
    if not connection.proved or omega_h is None or connection.verified is None:
        return CyclesNearOmegaHProof(CyclesNearOmegaHStatus.NO_CONNECTION, connection)
    parameters.refuse_unless_linear("the cycles next to the connection are proved")
    middle = round(omega_h.value, 4)
    low, high = middle - distance_below, middle + distance_above
    if not low < omega_h.value - omega_h.uncertainty < omega_h.value + omega_h.uncertainty < high:
        raise InputError("Omega_h is not between the ends: give larger numbers")
    refuse_past_birth(parameters, high)
    search = _CyclesSearch(connection, connection.verified, low, high, on_progress)
    try:
        return first_success(search.attempt, 0, _ATTEMPTS)
    except SearchStopped as fault:
        return CyclesNearOmegaHProof(fault.status, connection, low, high, outcome_detail=str(fault))


def checked_distance(number: object) -> Fraction:
    """Return a user's distance from Omega_h [rad/s] as an exact number. Raises InputError unless it
    is between 0 and 1.
    """
    distance = exact(number)
    if distance.pi_multiple or not 0 < distance.rational < 1:
        raise InputError(
            f"the distance up to which cycles are proved is a decimal between 0 and 1 rad/s, not "
            f"{short_text(number)}"
        )
    return distance.rational


class _CyclesSearch(EvidenceSearch):
    """The search for the evidence with which the kernel proves the cycles at speeds from ``low`` to
    ``high`` [rad/s].

    Each attempt multiplies the estimated height of the set D along z_u (its lid) by its own factor.
    """

    def __init__(
        self,
        connection: ConnectionProof,
        verified: EnclosedConnection,
        low: Fraction,
        high: Fraction,
        on_progress: Callable[[float], None],
    ) -> None:
        super().__init__()
        self.connection, self.verified = connection, verified
        self.low, self.high, self.on_progress = low, high, on_progress

    def attempt(self, lids_tried: int) -> CyclesNearOmegaHProof:
        self.lid_factor = _LID_FACTOR**lids_tried
        try:
            with working_precision(self.connection.bits):
                end = verify_cycles(self.verified, self.low, self.high, self, self.on_progress)
        except Unproved as fault:
            following = lids_tried + 1 if str(fault).startswith(LID_REFUSAL) else None
            raise SearchStopped(self.failure_status(fault), str(fault), following) from None
        entry = self.log["entry"]
        numbers = {"kappa": end.kappa, "eta": entry["lid"], "T": end.min_passage_time}
        own_entry = {name: part for name, part in entry.items() if name not in CLAIM_SHAPE}
        return CyclesNearOmegaHProof(
            CyclesNearOmegaHStatus.PROVED,
            self.connection,
            self.low,
            self.high,
            end.gamma,
            end.v,
            {name: f"{float(x):.4g}" for name, x in numbers.items()},
            own_evidence=self.log | {"entry": own_entry},
        )

    def failure_status(self, fault: Unproved) -> CyclesNearOmegaHStatus:
        """Return the status that names the stage of the proof at which the kernel or this search
        gave up.
        """
        if isinstance(fault, SearchStopped):
            return CyclesNearOmegaHStatus(fault.status)
        if "connection" in str(fault):
            return CyclesNearOmegaHStatus.APART
        if str(fault).startswith("flight"):
            return CyclesNearOmegaHStatus.FLIGHT
        return CyclesNearOmegaHStatus.INEQUALITY

    def box(self) -> dict[str, Any]:
        middle = (self.verified.low + self.verified.high) / 2
        directions = eigenvectors(self.connection.parameters, middle)[1]
        extents = [ball(extent).mid() for extent in _EXTENTS]
        return {"directions": directions.tolist(), "extents": extents, "cells": list(_CELLS)}

    def weights(self, passage: SaddlePassage) -> dict[str, Any]:
        flat, lipschitz = (
            magnitude_bound((abs(matrix[0, 1]) + abs(matrix[0, 2])) / matrix[0, 0] * 9 / 8).mid()
            for matrix in (passage.M, passage.A)
        )
        c = passage.C
        bound_matrix = [
            [c[i, j].upper() if i == j else magnitude_bound(c[i, j]) for j in range(3)]
            for i in range(3)
        ]
        drift = arb_mat(bound_matrix).solve(
            arb_mat([[-part * _SAFETY_FACTOR] for part in passage.speed_wedge_bounds])
        )
        return {
            "steep": [ball(weight).mid() for weight in _STEEP_WEIGHTS],
            "compound": [ball(weight).mid() for weight in _COMPOUND_WEIGHTS],
            "drift": [magnitude_bound(x).mid() for x in drift.entries()],
            "flat": flat,
            "lipschitz": lipschitz,
            "thin": ball(_THIN_SLOPE),
            "return": ball(_RETURN_RATE),
        }

    def entry(self, passage: SaddlePassage) -> dict[str, Any]:
        """Choose the sizes of the sets D and Q of the proof, from single flights in doubles.

        D is so high along z_u (the lid) that the flights with the largest speed and z_s arrive
        within it.
        """
        top, cell = float(self.high), float(self.high) - _SPEED_CELL
        _, (arrival, further, slower) = self._fly_in_doubles(
            passage, np.array([top, top, cell]), np.array([0, _SLOW_CELL, 0])
        )
        wide = (abs(further - arrival) + abs(slower - arrival)) * _EXCESS_WIDTH
        lid = abs(arrival)
        for _ in range(_SEARCH_ROUNDS):
            if lid > float(passage.extents[0]) / 2:
                raise SearchStopped(CyclesNearOmegaHStatus.NO_LID)
            cell_count = float(LoopMap(passage, self._entry(passage, lid)).exit_z_s[1]) / _SLOW_CELL
            lid = _LID_FACTOR * (abs(arrival) + abs(further - arrival) * cell_count + wide)
        return self._entry(passage, lid * self.lid_factor)

    def _entry(self, passage: SaddlePassage, lid: float) -> dict[str, Any]:
        """Return the sizes of the sets D and Q of the proof, for a given height of D (the lid).

        The entry ``moment`` is the time that bounds the crossings of beta_bar = 0 best. ``gamma``
        and ``v`` are so large that Q holds these crossings.
        """
        top, fast = ball(lid), ball(_ENTRY_FAST_EXTENT)

        def bound(moment: float) -> Any:
            return passage.crossing_bound(top, fast, ball(moment))

        low, high = 0.0, 1.0
        for _ in range(_SEARCH_ROUNDS):  # the bound falls, and then grows
            first, second = low + (high - low) / 3, high - (high - low) / 3
            low, high = (low, second) if bound(first) < bound(second) else (first, high)
        c, d = (_thousandths_above(bound(low) * passage.crossing_direction(row)) for row in (1, 2))
        return {
            "lid": top,
            "fast": fast,
            "weight": ball(_FAST_WEIGHT),
            "moment": ball(low),
            "gamma": c,
            "v": d,
        }

    def flights(self, loop_map: LoopMap) -> dict[str, Any]:
        """Choose the number and lengths of steps for the flight of each cell of speeds and z_s.

        The last step ends half a step after the orbit from the cell's middle has arrived.
        """
        low, high = float(self.low), float(self.high)
        least, largest = map(float, loop_map.exit_z_s)
        rows, columns = (
            math.ceil((high - low) / _SPEED_CELL),
            math.ceil((largest - least) / _SLOW_CELL),
        )
        speeds, slow = (
            begin + (end - begin) * (np.arange(number) + 0.5) / number
            for begin, end, number in ((low, high, rows), (least, largest, columns))
        )
        times, _ = self._fly_in_doubles(
            loop_map.passage, np.repeat(speeds, columns), np.tile(slow, rows)
        )
        count = math.ceil(float(times.max()) / _MAX_STEP)
        lengths = np.round(times / (count - 0.5) * 2**30) / 2**30
        return {
            "steps": count,
            "lengths": [[arb(float(x)) for x in row] for row in lengths.reshape(rows, columns)],
        }

    def _fly_in_doubles(
        self, passage: SaddlePassage, speeds: Array, slow: Array
    ) -> tuple[Array, Array]:
        """Estimate single flights from one saddle's section z_u = u to the other's z_s = -s, in
        doubles by Runge-Kutta's method. Return their times, and z_u on arrival.

        ``speeds`` and ``slow`` (z_s at the start) have one entry for each flight. Raises Unproved
        if a flight does not arrive.
        """
        constants = self.connection.parameters.constants_in(DOUBLE)
        to_y, to_z = (
            np.array([[float(x) for x in row] for row in m.tolist()])
            for m in (passage.saddle.directions, passage.saddle.inverse)
        )
        rates = equations.vector_field(equations.shifted_ops(np), constants, speeds, "linear")
        u, s, _ = map(float, passage.extents)
        turn = np.array([[0.0], [math.pi], [0.0]])
        x = to_y @ np.array([np.full(len(slow), u), slow, 0 * slow]) - turn
        times, arrived = np.full(len(slow), math.nan), np.full(len(slow), math.nan)
        before = to_z @ (x - turn)
        for k in range(_MAX_FLIGHT_STEPS):
            k1 = np.array(rates(*x))
            k2 = np.array(rates(*(x + _FLIGHT_STEP / 2 * k1)))
            k3 = np.array(rates(*(x + _FLIGHT_STEP / 2 * k2)))
            x = x + _FLIGHT_STEP / 6 * (
                k1 + 2 * k2 + 2 * k3 + np.array(rates(*(x + _FLIGHT_STEP * k3)))
            )
            z = to_z @ (x - turn)
            passed = np.isnan(times) & (before[1] < -s) & (z[1] >= -s)
            share = ((-s - before[1]) / (z[1] - before[1]))[passed]
            times[passed] = (k + share) * _FLIGHT_STEP
            arrived[passed] = before[0][passed] + (z[0] - before[0])[passed] * share
            if not np.isnan(times).any():
                return times, arrived
            before = z
        raise Unproved("flight 1: it does not arrive")


def _thousandths_above(x: Any) -> Fraction:
    """Return a multiple of 1/1000 above all numbers of the ball."""
    enclosure = ball_to_measured(x)
    return Fraction(math.floor((enclosure.value + enclosure.uncertainty) * 1000) + 1, 1000)
