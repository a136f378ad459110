"""The search for the proof of Omega_h; the proof itself is in `kernel.certificates.connection`.

An approximation is given, with a few more digits than the interval's length needs. The polynomials
of the invariant curves solve the equation of invariance power by power. The other evidence (cones,
extents, the moment at which the flight ends) follows from the kernel's enclosures. The working
precision is raised if the kernel refuses.

Balls become points and floats everywhere: any evidence that the kernel accepts is right.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction
from typing import Any, ClassVar, NamedTuple

from flint import arb, arb_mat

from tippedisk_verify.display import Printable
from tippedisk_verify.errors import InputError, NoConnectionError
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.decimals import decimal_magnitude, exact_text, round_up
from tippedisk_verify.numbers.exact import exact
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.proofs.angles import NONINVERTED
from tippedisk_verify.proofs.ball_conversions import ball_constants, ball_to_measured, widened
from tippedisk_verify.proofs.closed_forms import (
    characteristic_polynomial,
    exact_polynomial,
    real_root,
)
from tippedisk_verify.proofs.kernel.balls import Unproved, ball, coefficient, working_precision
from tippedisk_verify.proofs.kernel.certificates.connection import (
    EIGENVALUES,
    EVIDENCE_SHAPE,
    OPPOSITE_SIDES_REFUSAL,
    EnclosedConnection,
    arrival_box_contains_branch,
    is_unique_connecting_speed,
    verify_connection,
)
from tippedisk_verify.proofs.kernel.proved_flow import EnclosedFlight
from tippedisk_verify.proofs.kernel.saddle import (
    FAST,
    SLOW,
    UNSTABLE,
    ManifoldGraph,
    SaddleCoordinates,
    magnitude_bound,
    off_diagonal_sums,
    verify_unstable_cone,
)
from tippedisk_verify.proofs.search.proof_search import (
    EvidenceSearch,
    Proof,
    SearchStopped,
    certificate_claim,
    first_success,
    parameter_texts,
)
from tippedisk_verify.proofs.search.step_search import FlightStepSearch

__all__ = [
    "MAX_DIGITS",
    "ArrivalBox",
    "ConnectionProof",
    "ConnectionStatus",
    "eigenvectors",
    "invariant_curve_series",
    "prove_connection",
    "smallest_weights",
]

MAX_DIGITS = 300  #: half an hour; the time grows like the power 2.5 of the digits
_GUARD_BITS = 56  # some 10 digits for the passage, and a few lost by divisions
_MAX_FLIGHT = 30.0  # s
# Of the local series: then about an eighth of their radius of convergence is used
_ORDER_PER_BIT = 0.35
# Passes; bits that each has more than the one before; and the fast coordinate at the flight's end
# relative to the interval's half-width, which each reduces by the same factor again
_MAX_PASSES, _EXTRA_BITS, _FIRST_SHARE = 3, 48, Fraction(1, 64)
_MAX_DOUBLINGS = 12  # doublings of a guessed weight before it is given up
# rad; extents in gamma of the statement's box, if N lies in it. The larger it is, the more is
# unique.
_BOX_EXTENTS = tuple(map(Fraction, ("0.02", "0.01", "0.005", "0.002", "0.001")))
# An interval for fewer digits is too wide to be followed past a saddle. A law with two sides takes
# one digit more, because an orbit's enclosure widens at each sliding reversal.
_MIN_DIGITS = 4


class ConnectionStatus(Enum):
    """The ways in which a proof of the heteroclinic connection can end; each value is a message
    with what to try next.
    """

    PROVED = "proved"
    NO_SADDLE = "there is no connection of saddles to prove"
    UNSTABLE_BRANCH = (
        "the unstable manifold could not be enclosed at the first saddle: ask for more digits"
    )
    FLOW = "the flight between the saddles could not be enclosed: ask for more digits"
    NOT_NEAR = "the branch does not come near the second saddle: try another speed"
    BLOCK = "no isolating block at the second saddle holds the arrivals: ask for more digits"
    SIDES = "the ends of the interval are not proved to pass on opposite sides: is there a connection in it?"
    ROOM = "no box at the second saddle is proved to keep arriving orbits and let them converge: ask for more digits"
    CONES = "the cone conditions at a saddle are not proved: ask for more digits"


class ArrivalBox(NamedTuple):
    """The box about the second saddle in which the branch arrives, given by its half-lengths.

    It consists of the states with |beta - pi/2| <= ``beta``, |gamma - 3 pi/2| <= ``gamma``, |v| <=
    ``v`` [rad, rad, rad/s].
    """

    beta: Fraction
    gamma: Fraction
    v: Fraction


@dataclass(frozen=True, repr=False)
class ConnectionProof(Printable, Proof):
    """The result of a proof of the heteroclinic connection: an interval of Omega_h and its
    properties.

    They are proved if the status is PROVED.
    """

    _listed = (
        "proved",
        "status",
        "statement",
        "limit_cycle",
        "omega_h",
        "unique",
        "saddle_eigenvalues",
        "saddle_value",
        "upright",
        "room",
        "bits",
    )

    status: ConnectionStatus
    omega_h: Measured | None = None  #: [rad/s]; the interval I
    unique: bool = False  #: no second speed of I has a connection of this kind
    #: Unstable, slow stable, fast stable [1/s], for every speed of I
    saddle_eigenvalues: tuple[Measured, ...] = ()
    #: The box in which the branch stays, under its name in JSON
    room: ArrivalBox | None = None
    #: |beta - pi/2| < pi/2 all along: the disk never lies flat; the name is that in JSON
    upright: bool = False
    bits: int = 0  #: working precision of the last pass
    outcome_detail: str = ""  #: the inequality that fails
    parameters: Any = None  #: the disk of the proof
    verified: EnclosedConnection | None = None  #: the kernel's result
    #: What the kernel has accepted
    evidence: Mapping[str, Any] = field(default_factory=dict)

    @property
    def saddle_value(self) -> Measured | None:
        """The saddle value lambda_u + lambda_s [1/s].

        If it is negative, the cycle next to Omega_h attracts.
        """
        if not self.saddle_eigenvalues:
            return None
        unstable, slow, _ = self.saddle_eigenvalues
        return unstable + slow

    @property
    def claim(self) -> dict[str, Any]:
        """The claim of the certificate about Omega_h, as a dictionary. It exists only if the proof
        succeeded.
        """
        assert self.omega_h is not None
        assert self.room is not None
        numbers = dict(
            zip(("omega_h", *EIGENVALUES), (self.omega_h, *self.saddle_eigenvalues), strict=True)
        )
        room = self.room._asdict()
        return certificate_claim(
            "heteroclinic connection",
            self.parameters,
            numbers,
            unique=self.unique,
            upright=self.upright,
            **room,
        )

    @property
    def limit_cycle(self) -> str | None:
        """The conclusion of Shilnikov's theorem about the limit cycle next to Omega_h, in words.

        It is None if one of the theorem's hypotheses is not proved.
        """
        value = self.saddle_value
        if not (
            self.proved
            and self.unique
            and self.verified is not None
            and self.verified.arrives_along_slow_direction
            and value
            and value.value + value.uncertainty < 0
        ):
            return None
        if self.parameters.law.two_sided:
            return None  # the theorem asks for a smoother field
        side, other = "above", "below"
        if not self.verified.gamma_falls_above_omega_h:
            side, other = other, side
        return (
            "for the tippedisk, the friction law and the Omega_h of the statement, by Shilnikov's "
            "theorem: with gamma "
            "in R (not modulo 2 pi) the two connections and the saddles have a neighbourhood in "
            "which, for all speeds "
            f"close enough to Omega_h, there is exactly one periodic orbit {side} "
            f"Omega_h and none {other} "
            "it or at it; the orbit is asymptotically stable, the point symmetry maps it to "
            "itself, and its period "
            "tends to infinity as Omega tends to Omega_h."
        )

    def to_dict(self) -> dict[str, object]:
        room = (
            None
            if self.room is None
            else {name: exact_text(x) for name, x in self.room._asdict().items()}
        )
        return super().to_dict() | {"status": self.status.name.lower(), "room": room}


def prove_connection(parameters: Parameters, near: object, digits: int = 12) -> ConnectionProof:
    """Prove that the heteroclinic connection exists at a speed Omega_h in an interval about
    ``near`` [rad/s], of absolute and relative length up to 10^-digits.

    ``near`` (an exact number) must be correct to two digits more, and to at least seven. Raises
    InputError for digits or speeds out of range, NoConnectionError if the equilibrium is not a
    saddle with real eigenvalues.
    """
    if not 1 <= digits <= MAX_DIGITS:
        raise InputError(f"a proof of Omega_h is offered to 1 to {MAX_DIGITS} digits, not {digits}")
    approximation = exact(near)
    if approximation.pi_multiple or not Fraction(1, 10**6) < approximation.rational < 10**6:
        raise InputError(
            f"Omega_h must be a decimal between 1e-6 and 1e6 rad/s, not {str(near)[:40]}"
        )
    # Decimal ends, so that the printed interval is exactly the proved one.
    least = _MIN_DIGITS + parameters.law.two_sided
    decimals = max(digits, least) + max(0, -decimal_magnitude(approximation.rational))
    middle, half_width = (
        round(approximation.rational, decimals + 2),
        Fraction(4, 10 ** (decimals + 1)),
    )
    bits = (
        math.ceil(-math.log2(half_width))
        + max(0, math.ceil(math.log2(approximation.rational)))
        + _GUARD_BITS
    )
    search = _ConnectionSearch(parameters, middle, half_width)
    try:
        return first_success(search.attempt, (bits, _FIRST_SHARE), _MAX_PASSES)
    except SearchStopped as fault:
        return ConnectionProof(fault.status, bits=search.bits, outcome_detail=str(fault))


def eigenvectors(parameters: Parameters, speed: Fraction) -> tuple[list[Any], Any]:
    """Compute the saddle's eigenvalues [1/s], by descending value, and the matrix P of its
    eigenvectors, at noninverted spinning.

    Both are points near the true numbers.

    P's columns are near the eigenvectors. Their largest component is 1, and the entries in gamma's
    row are positive. Raises NoConnectionError unless the equilibrium is a saddle with one unstable
    and two real stable directions.
    """
    isolated_roots = exact_polynomial(
        parameters.rational_constants(), speed, NONINVERTED
    ).complex_roots()
    roots = [root for root, count in isolated_roots if count == 1 and root.imag.is_zero()]
    if len(roots) != 3:
        raise NoConnectionError(
            "noninverted spinning is a saddle-focus here: its connections are not proved"
        )
    fast, slow, unstable = sorted((root.real.mid() for root in roots), key=float)
    if not slow < 0 < unstable:
        raise NoConnectionError(
            "noninverted spinning is not a saddle with one unstable direction here"
        )
    columns = []
    for value in (unstable, slow, fast):
        vector = [value, ball(speed), value * value]
        largest = max(vector, key=lambda part: abs(float(part)))
        columns.append([(part / largest).mid() for part in vector])
    return [unstable, slow, fast], arb_mat(columns).transpose()


def smallest_weights(matrix: Any, by_speed: Sequence[Any]) -> list[Any]:
    """Return nearly the smallest weights with which the cone conditions hold for a matrix.

    With them, each row's off-diagonal terms and speed term amount to about half of its weighted
    diagonal entry. The kernel tests them with `cone_conditions`.
    """
    weights = [
        magnitude_bound(2 * part) / abs(matrix[k, k].mid()) for k, part in enumerate(by_speed)
    ]
    for _ in range(_MAX_DOUBLINGS):
        rest = [
            x + abs(b) for x, b in zip(off_diagonal_sums(matrix, weights), by_speed, strict=True)
        ]
        weights = [magnitude_bound(2 * x / abs(matrix[k, k].mid())) for k, x in enumerate(rest)]
    return weights


def invariant_curve_series(
    saddle: SaddleCoordinates, along: int, order: int, values: Sequence[Any]
) -> ManifoldGraph:
    """Return the power series of an invariant curve of the saddle at the middle speed, as a
    polynomial graph.

    ``along`` is the index of the coordinate that parametrises it, and ``values`` are points near
    the eigenvalues [1/s].
    """
    side = None
    if saddle.two_sided:
        direction = [arb(int(k == along)) for k in range(3)]
        side = 1 if saddle.sliding_slope([arb(0)] * 3, direction).mid() > 0 else -1
    thin = SaddleCoordinates(
        saddle.disk, saddle.friction, saddle.omega.mid(), saddle.directions.tolist()
    )
    curve = ManifoldGraph(thin, along, [[arb(0)] * (order + 1) for _ in range(2)], side)
    step = 2 if side is None else 1  # the linear law's field is odd about the saddle, and analytic
    for power in range(1 + step, order + 1, step):
        defect = curve.defect(arb(0), power)
        for other, row, rest in zip(curve.others, curve.graph, defect, strict=True):
            row[power] = (coefficient(rest, power) / (power * values[along] - values[other])).mid()
    return curve


class _ConnectionSearch(EvidenceSearch):
    """The search for the evidence with which the kernel proves one interval of Omega_h.

    Each attempt has its own working precision.
    """

    # The status of a failure, by the evidence that was asked for last
    _STAGES: ClassVar = {
        "unstable": ConnectionStatus.UNSTABLE_BRANCH,
        "cone": ConnectionStatus.UNSTABLE_BRANCH,
        "drift": ConnectionStatus.CONES,
        "block": ConnectionStatus.BLOCK,
        "arrival_box": ConnectionStatus.ROOM,
        "apart": ConnectionStatus.ROOM,
    }

    def __init__(
        self,
        parameters: Parameters,
        middle: Fraction,
        half_width: Fraction,
    ) -> None:
        super().__init__()
        self.parameters, self.middle, self.half_width = parameters, middle, half_width

    def attempt(self, choice: tuple[int, Fraction]) -> ConnectionProof:
        """Prove the interval in so many bits.

        The flight ends when the fast coordinate is smaller than a share of the half-width.
        """
        self.bits, self.share = choice
        try:
            with working_precision(self.bits):
                verified = verify_connection(
                    parameter_texts(self.parameters),
                    self.parameters.law.name,
                    (self.middle, self.half_width),
                    self,
                )
        except Unproved as fault:
            status = self.failure_status(fault)
            following = self.bits + _EXTRA_BITS, self.share * _FIRST_SHARE
            near = status is not ConnectionStatus.NOT_NEAR
            raise SearchStopped(status, str(fault), following if near else None) from None
        return ConnectionProof(
            status=ConnectionStatus.PROVED,
            omega_h=Measured(self.middle, self.half_width),
            unique=verified.unique,
            saddle_eigenvalues=tuple(Measured(*pair) for pair in self.log["eigenvalues"]),
            room=ArrivalBox(*verified.arrival_box),
            upright=verified.never_flat,
            bits=self.bits,
            parameters=self.parameters,
            verified=verified,
            evidence={name: self.log[name] for name in EVIDENCE_SHAPE},
        )

    def failure_status(self, fault: Unproved) -> ConnectionStatus:
        """Return the status that names the stage of the proof at which the kernel or this search
        gave up.
        """
        if isinstance(fault, SearchStopped):
            return ConnectionStatus(fault.status)
        if str(fault) == OPPOSITE_SIDES_REFUSAL:
            return ConnectionStatus.SIDES
        return self._STAGES.get(self.latest_name, ConnectionStatus.FLOW)

    def directions(self) -> list[list[Any]]:
        self.values, directions = eigenvectors(self.parameters, self.middle)
        self.order = 2 * math.ceil(_ORDER_PER_BIT * self.bits / 2) + 1
        return list(directions.tolist())

    def eigenvalues(self, saddle: SaddleCoordinates) -> list[tuple[Fraction, Fraction]]:
        polynomial = characteristic_polynomial(
            ball_constants(self.parameters), saddle.omega, NONINVERTED
        )
        roots = [widened(ball_to_measured(real_root(polynomial, value))) for value in self.values]
        printed = (root.decimals() for root in roots)
        return [(Fraction(value), Fraction(half)) for value, half in printed]

    def unstable(self, saddle: SaddleCoordinates) -> dict[str, Any]:
        curve = invariant_curve_series(saddle, UNSTABLE, self.order, self.values)
        return self._graph_evidence(curve) | {"reach": _usable_length(curve)}

    def slow(self, saddle: SaddleCoordinates) -> dict[str, Any]:
        curve = invariant_curve_series(saddle, SLOW, self.order, self.values)
        # Nearer than the series require: the cones there need orbits that differ along the unstable
        # direction. They hold in a box that is wider than N by the ratio of the eigenvectors'
        # components.
        self.arrival_distance = _usable_length(curve) / 16
        return self._graph_evidence(curve)

    def _graph_evidence(self, curve: ManifoldGraph) -> dict[str, Any]:
        return {"graph": curve.graph} | ({} if curve.side is None else {"side": str(curve.side)})

    def cone(self, curve: ManifoldGraph, theta: Any, defect: Sequence[Any]) -> list[Any]:
        gap = [self.values[UNSTABLE] - self.values[other] for other in curve.others]
        least = max(map(magnitude_bound, defect), key=float)
        for doubling in range(_MAX_DOUBLINGS):
            k = [
                magnitude_bound(2**doubling * 2 * (part + least / 16) / room).mid()
                for part, room in zip(defect, gap, strict=True)
            ]
            try:
                verify_unstable_cone(curve, theta, k, defect)
            except Unproved:
                continue
            break
        return k

    def drift(self, matrix: Any, by_speed: Sequence[Any]) -> list[Any]:
        return [part.mid() for part in smallest_weights(matrix, by_speed)]

    def flight(self) -> FlightStepSearch:
        return FlightStepSearch()

    def arrived(self, flight: EnclosedFlight, z: Sequence[Any], curve: ManifoldGraph) -> bool:
        beta, gamma, _ = flight.box
        # gamma falls, or has passed the saddle
        if flight.time > _MAX_FLIGHT or beta < 0 or gamma > arb.pi():
            raise SearchStopped(ConnectionStatus.NOT_NEAR)
        return bool(
            abs(z[SLOW]) < self.arrival_distance
            and abs(curve.offset_from_curve(z)[1].mid()) < ball(self.half_width * self.share)
        )

    def block(self, z: Sequence[Any], curve: ManifoldGraph) -> list[Any]:
        s, u, t = map(magnitude_bound, (z[SLOW], *curve.offset_from_curve(z)))
        # On the faces w_f = t the coupling from w_u, a hundredth of the contraction or less, must
        # not win.
        return [(s * 9 / 8).upper(), 2 * u, 2 * (t + u).upper()]

    def arrival_box(
        self,
        offset: Sequence[Any],
        branch_boxes: Sequence[Any],
        saddle: SaddleCoordinates,
        G: Sequence[Any],
    ) -> tuple[Fraction, Fraction, Fraction]:
        least = _two_digits_above(offset[1])
        for gamma in (*(size for size in _BOX_EXTENTS if size > least), least):
            after = [piece for piece in branch_boxes if not piece[1] - arb.pi() < -ball(gamma)]
            beta, _, v = (
                max(_two_digits_above(state[k]) for state in (offset, *after)) for k in range(3)
            )
            arrival_box = beta, gamma, v
            try:
                if arrival_box_contains_branch(
                    arrival_box, offset, branch_boxes
                ) and is_unique_connecting_speed(
                    saddle, arrival_box, G, lambda name, *context: self.apart(*context)
                ):
                    break
            except Unproved:
                continue
        return arrival_box

    def apart(self, matrix: Any, by_speed: Sequence[Any], G: Sequence[Any]) -> list[Any]:
        weights = [
            abs(G[UNSTABLE]).lower() * 7 / 8,
            magnitude_bound(G[SLOW]) * 2,
            magnitude_bound(G[FAST]) * 2,
        ]
        # A weight may be larger than the difference needs; much smaller ones than the others'
        # coupling are not proved.
        least = smallest_weights(matrix, by_speed)
        return [weights[0].mid(), *(weights[k].max(2 * least[k]).mid() for k in (SLOW, FAST))]


def _usable_length(curve: ManifoldGraph) -> Any:
    """Return the length up to which a curve's power series is used: a power of two, at most 1/4.

    It is near an eighth of the estimated radius of convergence.
    """
    sizes = [float(abs(row[-1])) for row in curve.graph]
    rates = [size ** (-1 / curve.order) for size in sizes if size > 0]
    return ball(Fraction(2) ** math.floor(math.log2(min([2.0, *rates]) / 8)))


def _two_digits_above(x: Any) -> Fraction:
    """Return a decimal of two digits above all sizes in the ball."""
    enclosure = widened(ball_to_measured(abs(x)))
    return Fraction(round_up(enclosure.value + enclosure.uncertainty))
