"""The interval of Omega_h: at exactly one of its speeds noninverted spinning is connected with its
copy.

Theorems 6 and 7 of docs/certified_connection.md show that the following suffices. Both friction
laws are allowed. In shifted angles the saddles are (0, -pi, 0) and (0, pi, 0). The unstable
manifold of the first one that leaves with growing gamma passes z_u = theta_0 at a point p_0(Omega).
Some steps later it is at p(Omega), near the second saddle. Let I be the interval of speeds. P is
the matrix whose columns e_u, e_s, e_f span the coordinates z = (z_u, z_s, z_f) of `saddle`. w_u is
z_u measured from the curve of the slow stable manifold.

1. *Start.* A cone at the first saddle encloses p_0 on all of I. Cones with the speed as a fourth
   coordinate enclose the difference of two of its points:

       p_0(Omega') - p_0(Omega) = (P e_s [-k_s, k_s] + P e_f [-k_f, k_f]) (Omega' - Omega).

2. *Flight.* The derivatives of the flow give p(Omega') - p(Omega) = P G (Omega' - Omega) with an
   enclosed vector G. The set of states also gives p at both ends of I separately.
3. *Arrival.* p(I) lies in an isolating block N of the second saddle
(`saddle.verify_isolating_block`). At one end of
   I w_u < -delta, at the other end w_u > delta.
4. *Uniqueness.* G lies in the unstable cone of a box about the saddle. On this box the
   inequalities of the cones are shown (`saddle.cone_conditions`).
5. *The arrival box*, the box of the statement, |beta_bar| <= b, |gamma_bar - pi| <= c, |v| <= d,
contains N. It
   also contains the branch from its first arrival at gamma_bar = pi - c until the flight's end,
   while gamma grows.

A message of refusal begins with the number of the part of the theorem's proof that fails, such as
6.3.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from flint import arb, arb_mat

from tippedisk_verify.proofs.kernel.balls import Unproved, ball, positive, require
from tippedisk_verify.proofs.kernel.certificate_format import (
    NUMBER_SHAPE,
    one_of,
    read_decimal,
    read_dyadic,
)
from tippedisk_verify.proofs.kernel.krawczyk import FLIGHT_SHAPE, StepReplay
from tippedisk_verify.proofs.kernel.proved_flow import FlightStopped
from tippedisk_verify.proofs.kernel.saddle import (
    FAST,
    SLOW,
    UNSTABLE,
    ManifoldGraph,
    SaddleCoordinates,
    cone_conditions,
    magnitude_bound,
    require_positive,
    verify_isolating_block,
    verify_unstable_cone,
)
from tippedisk_verify.proofs.kernel.step import Step

__all__ = [
    "EIGENVALUES",
    "EVIDENCE_SHAPE",
    "OPPOSITE_SIDES_REFUSAL",
    "SHAPES",
    "EnclosedConnection",
    "arrival_box_contains_branch",
    "is_unique_connecting_speed",
    "recorded_evidence",
    "sentence",
    "verify",
    "verify_connection",
]

#: The names of the eigenvalues, by descending value.
EIGENVALUES = ("lambda_u", "lambda_s", "lambda_ss")
#: The refusal if the interval may hold no connection.
OPPOSITE_SIDES_REFUSAL = "6.3: the ends of the interval are not shown to pass on opposite sides"

_BOXES_PER_STEP = 8  # of a step, for properties all along it
_BELOW_HALF_PI = Fraction("1.5707")

_GRAPH_SHAPE = {"graph": [[read_dyadic, None], 2], "side?": one_of("1", "-1")}
#: The evidence. The speeds, the box of the statement and the eigenvalues are the claim's.
EVIDENCE_SHAPE = {
    "directions": [[read_dyadic, 3], 3],
    "unstable": {**_GRAPH_SHAPE, "reach": read_dyadic},
    "cone": [read_dyadic, 2],
    "slow": _GRAPH_SHAPE,
    "drift": [read_dyadic, 3],
    "flight": FLIGHT_SHAPE,
    "block": [read_dyadic, 3],
    "apart": [read_dyadic, 3],
}


@dataclass(frozen=True)
class EnclosedConnection:
    """A verified interval of speeds: at exactly one (or at least one) of them a heteroclinic orbit
    connects the two saddles.
    """

    disk: dict[str, str]
    friction: str
    low: Fraction  #: [rad/s]
    high: Fraction
    arrival_box: tuple[Fraction, Fraction, Fraction]  #: b [rad], c [rad], d [rad/s]
    unique: bool
    never_flat: bool  #: |beta_bar| < pi/2 all along
    #: The connection comes in along the slow stable direction
    arrives_along_slow_direction: bool
    #: The branch leaves N with falling gamma above Omega_h in I, not below it
    gamma_falls_above_omega_h: bool
    branch_boxes: list[Any]  #: boxes of states along the branch, in order of time


def verify_connection(
    disk: dict[str, str],
    friction: str,
    omega_h: tuple[Fraction, Fraction],
    evidence_source: Callable[..., Any],
) -> EnclosedConnection:
    """Show that an interval of speeds contains one at which a heteroclinic orbit connects the
    saddles.

    Args:
        disk: The eight exact numbers of the disk.
        friction: The name of the friction law.
        omega_h: The interval's middle and half-width [rad/s].
        evidence_source: Returns the evidence of a given name: those of `EVIDENCE_SHAPE`,
            "arrival_box", "eigenvalues", and "arrived", which ends the flight. Further
            arguments are values on which it may depend.

    Returns:
        The interval with its proved properties.

    Raises:
        Unproved: With the inequality that fails.
    """
    middle, half_width = omega_h
    require(0 < half_width < middle, "claim: the interval of speeds is empty, or not above zero")
    low, high = middle - half_width, middle + half_width
    speeds = ball(middle) + arb(0, ball(half_width).upper())
    saddle = SaddleCoordinates(disk, friction, speeds, evidence_source("directions"))
    _require_eigenvalues(saddle, evidence_source("eigenvalues", saddle))
    start, change, never_flat, whole = _enclose_unstable_branch(saddle, evidence_source)
    arriving = _manifold_graph(saddle, SLOW, evidence_source("slow", saddle))
    flight, branch_boxes = saddle.flight(start, evidence_source("flight")), [whole]
    while True:
        try:
            step = flight.step()
        except FlightStopped:
            raise Unproved("6.2: the flight between the saddles could not be enclosed") from None
        branch_boxes += _boxes_along_step(step)
        never_flat = never_flat and _is_never_flat(step.enclosure[0])
        flight.take_step(step)
        z = saddle.enclosed_coordinates(flight.state_set)
        if evidence_source("arrived", flight, z, arriving):
            break
    G = saddle.coordinates(
        [sum(row[k] * x for k, x in enumerate(change)) for row in flight.derivatives]
    )
    extents = evidence_source("block", z, arriving)
    delta, box, matrix = verify_isolating_block(arriving, extents)
    w_u, w_f = arriving.offset_from_curve(z)
    require_positive(
        "6.3: arrivals lie in the block",
        *(x - abs(y) for x, y in zip(extents, (z[SLOW], w_u, w_f), strict=True)),
    )
    # The deviations of the ends of I from the middle of the speeds are points.
    shifts = [ball(end) - speeds.mid() for end in (low, high)]
    ends = [
        saddle.enclosed_coordinates(flight.state_set, [*flight.state_set.deviation[:3], shift])
        for shift in shifts
    ]
    first, last = (arriving.offset_from_curve(end)[0] for end in ends)
    rising = _all_positive(-first - delta, last - delta)
    require(rising or _all_positive(first - delta, -last - delta), OPPOSITE_SIDES_REFUSAL)
    offset = saddle.offset(box)
    arrival_box = evidence_source("arrival_box", offset, branch_boxes, saddle, G)
    require(
        arrival_box_contains_branch(arrival_box, offset, branch_boxes),
        "6.3: the box at the second saddle is not shown to keep what arrives",
    )
    unique = is_unique_connecting_speed(saddle, arrival_box, G, evidence_source)
    never_flat = never_flat and _is_never_flat(ball(arrival_box[0]))
    return EnclosedConnection(
        disk,
        friction,
        low,
        high,
        arrival_box,
        unique,
        never_flat,
        _converges_along_slow_direction(matrix, z),
        not rising,
        branch_boxes,
    )


def _manifold_graph(saddle: SaddleCoordinates, along: int, entry: dict[str, Any]) -> ManifoldGraph:
    require(
        ("side" in entry) == saddle.two_sided,
        "6.5: the smooth law has sides, the linear law does not",
    )
    return ManifoldGraph(
        saddle, along, entry["graph"], int(entry["side"]) if "side" in entry else None
    )


def _enclose_unstable_branch(
    saddle: SaddleCoordinates, evidence_source: Callable[..., Any]
) -> tuple[list[Any], list[Any], bool, list[Any]]:
    """Enclose the unstable manifold of the first saddle up to z_u = theta_0, at all speeds.

    ``evidence_source`` returns the curve with theta_0, and the weights of the cones. Raises
    Unproved if a cone is not shown.

    Returns:
        A box of z at theta_0; an enclosure of d(z, speed)/d(speed) there; True if the disk is
        shown to stay upright up to there; a box of states that holds the branch.
    """
    entry = evidence_source("unstable", saddle)
    curve, theta = _manifold_graph(saddle, UNSTABLE, entry), entry["reach"]
    defect = curve.relative_defect(theta)
    cone = evidence_source("cone", curve, theta, defect)
    start, whole, matrix = verify_unstable_cone(curve, theta, cone, defect)
    by_speed = saddle.rates_and_derivatives(whole, curve.side)[2]
    _, k_s, k_f = weights = evidence_source("drift", matrix, by_speed)
    require_positive(
        "6.4: the cones at the first saddle", *weights, *cone_conditions(matrix, weights, by_speed)
    )
    offset = saddle.offset(whole)
    # All along the cone the offset from the saddle is z_u times one of these directions.
    rows, slopes = saddle.directions.tolist(), curve.secant_slopes(arb(0).union(theta))
    directions = [slope + arb(0, magnitude_bound(k)) for slope, k in zip(slopes, cone, strict=True)]
    for row in rows[:2]:  # where beta_bar > 0, gamma grows
        along = zip(curve.others, directions, strict=True)
        require_positive(
            "6.1: gamma grows where the branch leaves",
            row[UNSTABLE] + sum((row[k] * x for k, x in along), arb(0)),
        )
    state = [offset[0], offset[1] - arb.pi(), offset[2]]
    return (
        start,
        [arb(0), arb(0, magnitude_bound(k_s)), arb(0, magnitude_bound(k_f)), arb(1)],
        _is_never_flat(offset[0]),
        state,
    )


def _all_positive(*balls: Any) -> bool:
    return all(positive(x) for x in balls)


def _is_never_flat(beta: Any) -> bool:
    return _all_positive(ball(_BELOW_HALF_PI) - abs(beta))


def _boxes_along_step(step: Step) -> list[Any]:
    """Divide a step of a flight into parts of equal duration, and return a box of states for each.

    The boxes of (beta_bar, gamma_bar, v) are in order of time. Each one contains all orbits of the
    flight during its part.
    """
    share = arb(step.length) / (2 * _BOXES_PER_STEP)
    return [
        step.states_at((2 * k + 1) * share + arb(0, share.upper())) for k in range(_BOXES_PER_STEP)
    ]


def arrival_box_contains_branch(
    arrival_box: Sequence[Fraction], offset: Sequence[Any], branch_boxes: Sequence[Any]
) -> bool:
    """Return True if a box about the second saddle is shown to contain both the isolating block and
    the flight, from its first arrival in the box on.

    Args:
        arrival_box: The half-lengths of the box in (beta, gamma, v).
        offset: The enclosed offsets of the block from the saddle.
        branch_boxes: Boxes that enclose the flight, in order of time.
    """
    sizes = [ball(extent) for extent in arrival_box]
    offsets = [(beta, gamma - arb.pi(), v) for beta, gamma, v in branch_boxes]
    first = next(
        (place for place, (_, gamma, _) in enumerate(offsets) if not positive(-sizes[1] - gamma)), 0
    )
    late = offsets[first:]
    if not first or not all(_all_positive(beta.sin(), sizes[1] - gamma) for beta, gamma, _ in late):
        return False
    inside = all(_all_positive(sizes[k] - abs(state[k])) for state in late for k in (0, 2))
    return inside and all(
        _all_positive(size - abs(x)) for size, x in zip(sizes, offset, strict=True)
    )


def is_unique_connecting_speed(
    saddle: SaddleCoordinates,
    arrival_box: Sequence[Fraction],
    G: Sequence[Any],
    evidence_source: Callable[..., Any],
) -> bool:
    """Return True if it is shown that the unstable manifold stays in a box about the second saddle
    at one speed at most.

    Args:
        saddle: The coordinates z, with the ball of speeds.
        arrival_box: The half-lengths of the box about the second saddle, in (beta, gamma, v).
        G: The enclosed difference of two speeds' arrivals, in z, per rad/s.
        evidence_source: Called with "apart", and the values on which these weights of a cone may
            depend.

    Raises:
        Unproved: If a branch that stays is not shown to converge to the second saddle.
    """
    box = saddle.coordinates([arb(0, ball(extent).upper()) for extent in arrival_box])
    _, slopes, by_speed = saddle.rates_and_derivatives(box)
    matrix = arb_mat(slopes)
    require_positive(
        "6.4: the cones of the box at the second saddle",
        *cone_conditions(matrix, (arb(1), arb(1), arb(1))),
    )
    weights = evidence_source("apart", matrix, by_speed, G)
    inside = [abs(G[UNSTABLE]) - weights[0], *(weights[k] - abs(G[k]) for k in (SLOW, FAST))]
    return _all_positive(*weights, *inside, *cone_conditions(matrix, weights, by_speed))


def _converges_along_slow_direction(matrix: Any, z: Sequence[Any]) -> bool:
    """Return True if an orbit from the box z is shown to converge along the slow direction (7.3).

    The orbit stays in the isolating block N of the second saddle, and ``matrix`` encloses the
    field's derivative DF over N. By the cones with weights 1 it has |z_u| <= max(|z_s|, |z_f|).
    Let the Gershgorin discs of the rows s and f of ``matrix`` be disjoint. Then |z_f| grows less
    than |z_s| where |z_f| = |z_s|, so |z_f| < |z_s| stays true. The fast eigenvalue lies in the
    fast row's disc, and its eigenvector has |z_f| > |z_s|.
    """
    slow, fast = (
        (matrix[row, row], sum((abs(matrix[row, k]) for k in range(3) if k != row), arb(0)))
        for row in (SLOW, FAST)
    )
    return _all_positive(slow[0] - slow[1] - (fast[0] + fast[1]), abs(z[SLOW]) - abs(z[FAST]))


def _require_eigenvalues(
    saddle: SaddleCoordinates, claimed: Sequence[tuple[Fraction, Fraction]]
) -> None:
    """Raise Unproved unless the claimed intervals enclose the saddle's three eigenvalues.

    At every speed each interval (middle, half-width) [1/s] must contain exactly one of them. The
    intervals must be disjoint, in descending order. The signs of the characteristic polynomial at
    their ends decide.
    """
    c, w = saddle.constants, saddle.omega
    arm = c.r - c.e
    drag = c.k / c.b * arm
    a_2, a_1, a_0 = drag * arm, w * w - c.g * arm / c.b, -drag * c.e * w * w
    signs = []
    for value, half_width in claimed:
        for x in map(ball, (value + half_width, value - half_width)):
            p = ((x + a_2) * x + a_1) * x + a_0
            signs.append(int(positive(p)) - int(positive(-p)))
    ends = [x for value, half_width in claimed for x in (value + half_width, value - half_width)]
    require(
        ends == sorted(ends, reverse=True) and signs == [1, -1, -1, 1, 1, -1],
        "claim: the eigenvalues are not shown",
    )


def recorded_evidence(entries: Mapping[str, Any]) -> Callable[..., Any]:
    """Return a function that returns the recorded evidence of a given name from a certificate.

    The name "flight" gives the proposer of the steps, and "arrived" gives True once all steps of
    its log have been taken.
    """
    replay = StepReplay(entries["flight"], "the flight")
    known = {**entries, "flight": replay}

    def evidence_source(name: str, *context: Any) -> Any:
        return replay.number == len(replay.log) if name == "arrived" else known[name]

    return evidence_source


SHAPES = {
    "heteroclinic connection": (
        {
            "numbers": dict.fromkeys(("omega_h", *EIGENVALUES), NUMBER_SHAPE),
            **dict.fromkeys(("unique", "upright"), one_of(True, False)),
            **dict.fromkeys(("beta", "gamma", "v"), read_decimal),
        },
        EVIDENCE_SHAPE,
    )
}


def verify(claim: Mapping[str, Any], evidence: Mapping[str, Any]) -> None:
    """Check a certificate about Omega_h: repeat the proof with the evidence that it records.

    Args:
        claim: The claim, as read from the file.
        evidence: The evidence, as read from the file.

    Raises:
        Unproved: If the evidence does not prove the claim.
    """
    numbers = {
        name: (Fraction(x["value"]), Fraction(x["uncertainty"]))
        for name, x in claim["numbers"].items()
    }
    claimed = {
        "eigenvalues": [numbers[name] for name in EIGENVALUES],
        "arrival_box": tuple(Fraction(claim[name]) for name in ("beta", "gamma", "v")),
    }
    verified = verify_connection(
        claim["parameters"],
        claim["friction"],
        numbers["omega_h"],
        recorded_evidence({**evidence, **claimed}),
    )
    require(
        not claim["unique"] or verified.unique, "claim: that there is no other speed is not shown"
    )
    require(
        not claim["upright"] or verified.never_flat,
        "claim: that the disk never lies flat is not shown",
    )


def sentence(claim: Mapping[str, Any], numbers: Mapping[str, str]) -> str:
    """Return the theorem that a certificate claims about the heteroclinic connection, in words.

    The text continues a sentence that has already named the disk and its friction law.

    Args:
        claim: The claim of the certificate.
        numbers: The claimed numbers by name, each as text with its uncertainty.
    """
    middle, half_width = (claim["numbers"]["omega_h"][name] for name in ("value", "uncertainty"))
    count = "exactly one" if claim["unique"] else "at least one"
    never_flat = ", with |beta - pi/2| < pi/2 all along" if claim["upright"] else ""
    eigenvalues = ", ".join(numbers[name] for name in EIGENVALUES)
    return (
        f" there is {count} Omega with |Omega - {middle} rad/s| <= {half_width} rad/s "
        "at which the branch of the unstable manifold of (beta, gamma, v) = (pi/2, -pi/2, 0) that "
        "leaves with growing "
        f"gamma, from the moment on at which it first has gamma = 3 pi/2 - {claim['gamma']}, stays "
        f"in the box "
        f"|beta - pi/2| <= {claim['beta']}, |gamma - 3 pi/2| <= {claim['gamma']}, |v| <= "
        f"{claim['v']} rad/s and "
        f"converges to (pi/2, 3 pi/2, 0){never_flat}; by the symmetry "
        "(beta, gamma, v) -> (pi - beta, pi - gamma, -v) the connection back exists at the same "
        "speed, an Omega_h; at "
        f"every speed of the interval the saddle's eigenvalues are {eigenvalues} 1/s."
    )
