"""The family of limit cycles from the Hopf point on: arcs that form one curve, and its claim.

**An arc** covers an interval of amplitudes a = gamma_bar_0. It is one of `half_map_of_curves` over
an interval of a or, at the Hopf point, one of `scaled_half_map` over an interval of a^2 that begins
at 0. Over a first box about the polynomials the inclusion and all signs of Theorem 5b
(docs/certified_cycles.md) are shown. Over a wider box the inclusion alone is shown: it bounds the
distance of other cycles. The numbers of a `ProvedArc` are exact, because balls are rounded
outwards.

**One curve.** The first arc begins at the Hopf point, gamma_bar_0 = 0, and each next one begins at
the end of the last. By Theorem 5b, two arcs are one curve if the enclosure of one arc's cycle,
where they meet, lies in the other arc's box of uniqueness. The comparison is one of rational
numbers (`are_joined`). So a quantity that falls or grows strictly on each arc does so on the whole
curve. The theorem's proof also joins the last arc to the cycles next to the connection.

**The Hopf point.** At gamma_bar_0 = 0 the pair of imaginary eigenvalues has the half period t with
exp(A t) x = -x; A is the linearisation at inverted spinning. The component beta_bar of this
motion is a sinusoid. The flight shows that it has no zero inside the half period, so the period is
that of the pair. The enclosures are also checked to contain the closed form's Omega_crit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction
from itertools import pairwise
from typing import Any

from tippedisk_verify.proofs.kernel.balls import (
    Unproved,
    arb,
    ball,
    midpoint_and_radius,
    require,
    working_precision,
)
from tippedisk_verify.proofs.kernel.certificate_format import (
    NUMBER_SHAPE,
    one_of,
    read_decimal,
    read_precision,
    read_shape,
    require_claimed_enclosure,
)
from tippedisk_verify.proofs.kernel.certificates import cycles_near_omega_h
from tippedisk_verify.proofs.kernel.half_map_of_curves import (
    ArcTest,
    Curve,
    CurveReplay,
    krawczyk_test_of_arc,
)
from tippedisk_verify.proofs.kernel.jets import Jet
from tippedisk_verify.proofs.kernel.scaled_half_map import ScaledCurve
from tippedisk_verify.proofs.kernel.vector_field import field_constants

__all__ = [
    "KINDS",
    "SHAPES",
    "STEPS_SHAPE",
    "ArcJob",
    "ArcMap",
    "ArcStatus",
    "ProvedArc",
    "are_joined",
    "curve_fault",
    "enclosed_omega_crit",
    "exact_magnitude_bound",
    "first_unproved_sign",
    "krawczyk_test_of_box",
    "last_cycle",
    "sentence",
    "unique_within",
    "verify",
    "verify_arc",
]

#: True for a family that reaches up to the connection
KINDS = {"family of limit cycles": False, "whole family of limit cycles": True}
_UNIQUENESS_KEYS = ("v_0_per_gamma_bar_0", "v_0", "omega")

STEPS_SHAPE = [{"share": read_decimal, "axes?": [[read_decimal, 3], 3]}, None]
BOX_SHAPE = {"radii": [read_decimal, 2], "steps": STEPS_SHAPE}
ARC_SHAPE = {
    "end": read_decimal,
    "curve": [[read_decimal, None], 2],
    "half": [read_decimal, None],
    "bits": read_precision,
    "box": BOX_SHAPE,
    "wide box?": BOX_SHAPE,
}

Pair = tuple[Fraction, Fraction]
CoefficientRows = tuple[
    tuple[Fraction, ...], tuple[Fraction, ...]
]  #: coefficients of two polynomials
#: The disk, the amplitude at which the arc begins, the arc's number, its evidence
ArcJob = tuple[Mapping[str, str], Fraction, int, Mapping[str, Any]]


class ArcStatus(Enum):
    """The reasons why a proof of an arc of limit cycles fails, or why an arc is not joined to the
    one before; each value is a message.
    """

    NOT_FOLLOWED = (
        "the orbits of all these amplitudes could not be followed from section to section"
    )
    NOT_INCLUDED = "Krawczyk's image does not lie inside the box"
    SPEED_GROWS = "Omega grows with the amplitude"
    UNSTABLE = "the limit cycles are unstable"
    NOT_JOINED = "it is not proved that two pieces of the family are one curve"
    SPEED_NOT_FALLING = "it is not proved that Omega falls as the amplitude grows"
    NOT_STABLE = "it is not proved that the limit cycles are asymptotically stable"
    PERIOD_NOT_GROWING = "it is not proved that the period grows with the amplitude"
    BETA_MAX_NOT_GROWING = "it is not proved that beta_max grows with the amplitude"


@dataclass(frozen=True)
class ProvedArc:
    """A proved arc of the family of limit cycles, for all amplitudes from ``low`` to ``high``
    [rad].

    ``curve`` holds two polynomials of s, their coefficients beginning with that of s^0. For an
    ordinary arc they are v_0 [rad/s] and Omega [rad/s], and s = (2 a - low - high) / (high -
    low). A ``scaled`` arc begins at the Hopf point, low = 0. Its first polynomial is v_0 / a
    [1/s], and s = 2 a^2 / high^2 - 1.
    """

    low: Fraction
    high: Fraction
    curve: CoefficientRows
    unique_within: Pair  #: of the polynomials: no other cycle is nearer
    within: Pair  #: of the polynomials: the true values are this near
    #: with the shape `ARC_SHAPE`
    evidence: Mapping[str, Any] = field(default_factory=dict, compare=False, repr=False)

    @property
    def scaled(self) -> bool:
        return not self.low

    def at(self, amplitude: Fraction) -> Pair:
        """Return v_0 [rad/s] and Omega [rad/s] of the arc's polynomials at an amplitude [rad]."""
        s = (2 * amplitude - self.low - self.high) / (self.high - self.low)
        if self.scaled:
            s = 2 * amplitude**2 / self.high**2 - 1
        first, second = (
            sum((c * s**k for k, c in enumerate(row)), Fraction(0)) for row in self.curve
        )
        return self.scaled_to(amplitude, (first, second))

    def scaled_to(self, amplitude: Fraction, values: Pair) -> Pair:
        """Convert values of the arc's two polynomials, or distances from them, to v_0 and Omega.

        For a scaled arc the first polynomial is v_0 / a, so its value is multiplied by the
        amplitude a [rad]. Otherwise both values are returned unchanged.
        """
        return values[0] * (amplitude if self.scaled else 1), values[1]

    def speeds(self, amplitude: Fraction) -> Pair:
        """Return a lower and an upper bound of the speed Omega [rad/s] of the cycle with an
        amplitude [rad].
        """
        middle = self.at(amplitude)[1]
        return middle - self.within[1], middle + self.within[1]


def exact_magnitude_bound(x: Any) -> Fraction:
    """Return an upper bound of the absolute values in a finite ball."""
    middle, radius = midpoint_and_radius(x)
    return abs(middle) + radius


def krawczyk_test_of_box(
    disk: Mapping[str, str],
    low: Fraction,
    arc: Mapping[str, Any],
    radii: Sequence[Fraction],
    proposer: Any,
) -> ArcTest:
    """Test if there is one limit cycle in a box about each point of an arc, by Krawczyk's operator.

    The arc is a curve of approximate cycles, given by polynomials of the amplitude.

    Args:
        disk: The eight exact numbers.
        low: The amplitude at which the arc begins [rad].
        arc: Its end, and the coefficients of the two unknown numbers and of half the period.
        radii: The box's radii, for the two unknown numbers.
        proposer: The proposer of the flight's steps.

    Returns:
        The test's result, which may be that the cycles are not included.

    Raises:
        Unproved: If the flight fails.
    """
    high = Fraction(arc["end"])
    require(0 <= low < high, "its end is not above its beginning")
    begin, end = (low, high) if low else (low, high**2)
    first, second, half = (
        Jet([ball(Fraction(text)) for text in row]) for row in (*arc["curve"], arc["half"])
    )
    require(first.degree == second.degree == half.degree > 0, "its polynomials have unlike degrees")
    require(min(radii) > 0, "a box is empty: a radius is not positive")
    parameter = Jet(
        [ball((begin + end) / 2), ball((end - begin) / 2), *[arb(0)] * (half.degree - 1)]
    )
    deviation = [arb(0), *(arb(0, ball(radius)) for radius in radii)]
    curve = (Curve if low else ScaledCurve)(parameter, first, second, deviation, half.mid())
    return krawczyk_test_of_arc(field_constants(disk), curve, proposer)


def first_unproved_sign(test: ArcTest) -> ArcStatus | None:
    """Return the status that names the first property of an arc of limit cycles that is not shown.
    Return None if all are shown.

    The properties are, in this order: Omega falls, the cycles are stable, the period grows and
    beta_max grows.
    """
    falling, stable = test.speed_falls(), test.stable()
    if not falling:
        return ArcStatus.SPEED_NOT_FALLING if falling is None else ArcStatus.SPEED_GROWS
    if not stable:
        return ArcStatus.NOT_STABLE if stable is None else ArcStatus.UNSTABLE
    if not test.period_grows():
        return ArcStatus.PERIOD_NOT_GROWING
    return None if test.beta_max_grows() else ArcStatus.BETA_MAX_NOT_GROWING


def verify_arc(job: ArcJob) -> ProvedArc:
    """Check one arc in a certificate about the family of limit cycles, and return it as a proved
    arc.

    ``job`` holds the disk, the amplitude at which the arc begins, the arc's number and its
    evidence. Raises Unproved with the test that fails, and NotACertificate if the evidence has a
    wrong shape.
    """
    disk, low, number, content = job
    arc = read_shape(content, ARC_SHAPE, f"arc {number}")
    names = [name for name in ("box", "wide box") if name in arc]
    tests: list[ArcTest] = []
    with working_precision(arc["bits"]):
        for name in names:
            radii = [Fraction(text) for text in arc[name]["radii"]]
            try:
                tests.append(
                    krawczyk_test_of_box(disk, low, arc, radii, CurveReplay(arc[name]["steps"]))
                )
                require(tests[-1].included, ArcStatus.NOT_INCLUDED.value)
                refusal = None if len(tests) > 1 else first_unproved_sign(tests[0])
                require(refusal is None, refusal.value if refusal else "")
            except Unproved as fault:
                raise Unproved(f"arc {number}, {name}: {fault}") from None
        within = [exact_magnitude_bound(off) for off in tests[0].shift]
    boxes = [[Fraction(text) for text in arc[name]["radii"]] for name in (names[0], names[-1])]
    require(
        all(a <= b for a, b in zip(*boxes, strict=True)),
        f"arc {number}: the wide box does not hold the other one",
    )
    v, omega = (tuple(map(Fraction, row)) for row in arc["curve"])
    return ProvedArc(
        low,
        Fraction(arc["end"]),
        (v, omega),
        (boxes[1][0], boxes[1][1]),
        (within[0], within[1]),
        content,
    )


#: `map`, or that of a pool of processes
ArcMap = Callable[[Callable[[ArcJob], ProvedArc], Sequence[ArcJob]], Iterable[ProvedArc]]


def are_joined(first: ProvedArc, second: ProvedArc, amplitude: Fraction) -> bool:
    """Return True if two arcs of the family provably have the same limit cycle at an amplitude
    [rad].

    Returns False unless both arcs include the amplitude and it is positive.
    """
    if not all(arc.low <= amplitude <= arc.high for arc in (first, second)) or amplitude <= 0:
        return False
    return _cycle_lies_in(first, second, amplitude) or _cycle_lies_in(second, first, amplitude)


def _cycle_lies_in(first: ProvedArc, second: ProvedArc, amplitude: Fraction) -> bool:
    """Return True if the first arc's cycle at this amplitude is certainly the second arc's
    cycle: its enclosure lies in the second arc's box of uniqueness.
    """
    parts = zip(
        first.at(amplitude),
        first.scaled_to(amplitude, first.within),
        second.at(amplitude),
        second.scaled_to(amplitude, second.unique_within),
        strict=True,
    )
    return all(abs(mine - theirs) + near <= distance for mine, near, theirs, distance in parts)


def enclosed_omega_crit(disk: Mapping[str, str]) -> Any:
    """Return a ball that holds the critical speed Omega_crit [rad/s] of a disk, given its exact
    numbers.
    """
    c = field_constants(disk)
    return (c.r + c.e) * (c.g / (c.r * c.b)).sqrt()


def curve_fault(disk: Mapping[str, str], arcs: Sequence[ProvedArc]) -> str:
    """Return the reason why arcs of the family are not proved to be one curve from the Hopf point
    on.

    Returns '' if they are proved to be one curve.
    """
    if not arcs:
        return "there are no arcs"
    off = enclosed_omega_crit(disk) - ball(arcs[0].at(Fraction(0))[1])
    if not (arcs[0].scaled and bool(abs(off) <= ball(arcs[0].within[1]))):
        return "arc 1: it is not shown to begin at the Hopf point"
    for number, (first, second) in enumerate(pairwise(arcs), 2):
        if first.high != second.low or not are_joined(first, second, second.low):
            return f"arcs {number - 1} and {number} are not shown to be one curve"
    return ""


def unique_within(arcs: Sequence[ProvedArc]) -> tuple[Fraction, Fraction, Fraction]:
    """Return three distances within which each limit cycle of the family is unique.

    No second cycle with the same gamma_bar_0 is nearer. They are a distance in v_0 / gamma_bar_0
    [1/s] on the first arc, one in v_0 [rad/s] on all later arcs, and one in Omega [rad/s] on all
    arcs.
    """
    distances = [
        [distance - near for distance, near in zip(arc.unique_within, arc.within, strict=True)]
        for arc in arcs
    ]
    later = [distance[0] for distance in distances[1:]] or [distances[0][0]]
    return distances[0][0], min(later), min(distance[1] for distance in distances)


def last_cycle(arcs: Sequence[ProvedArc]) -> tuple[Any, Any, Any]:
    """Return balls of Omega [rad/s], gamma_bar_0 [rad] and v_0 [rad/s] of the limit cycle at which
    the last arc ends.
    """
    last = arcs[-1]
    middle, off = last.at(last.high), last.scaled_to(last.high, last.within)
    v, omega = (ball(x) + arb(0, 1) * ball(near) for x, near in zip(middle, off, strict=True))
    return omega, ball(last.high), v


_CLAIM_SHAPE: dict[str, Any] = {
    "friction": one_of("linear"),
    "numbers": {"omega_crit": NUMBER_SHAPE},
    **dict.fromkeys(("amplitude_first", "amplitude_end", "omega_end"), read_decimal),
    "unique_within": dict.fromkeys(_UNIQUENESS_KEYS, read_decimal),
}
_WHOLE_CLAIM_SHAPE = {
    **_CLAIM_SHAPE,
    "numbers": {"omega_crit": NUMBER_SHAPE, "omega_h": NUMBER_SHAPE},
    **cycles_near_omega_h.CLAIM_SHAPE,
}
_ARCS_SHAPE = [ARC_SHAPE, None]
SHAPES = {
    "family of limit cycles": (_CLAIM_SHAPE, {"arcs": _ARCS_SHAPE}),
    "whole family of limit cycles": (
        _WHOLE_CLAIM_SHAPE,
        {"arcs": _ARCS_SHAPE, "end": cycles_near_omega_h.EVIDENCE_SHAPE},
    ),
}


def verify(claim: Mapping[str, Any], evidence: Mapping[str, Any], map_arcs: ArcMap = map) -> None:
    """Check a certificate about the family of limit cycles. Raise Unproved unless its evidence
    proves its claim.

    ``map_arcs`` applies `verify_arc` to the arcs, which are independent of each other.
    """
    disk, entries = claim["parameters"], evidence["arcs"]
    lows = [Fraction(0), *(Fraction(entry["end"]) for entry in entries)]
    jobs = [
        (disk, low, k, entry) for k, (low, entry) in enumerate(zip(lows, entries, strict=False), 1)
    ]
    arcs = list(map_arcs(verify_arc, jobs))
    fault = curve_fault(disk, arcs)
    require(not fault, fault)
    for name, amplitude in (
        ("amplitude_first", arcs[0].high),
        ("amplitude_end", arcs[-1].high),
    ):
        require(
            Fraction(claim[name]) == amplitude,
            f"claim: {name} is not the amplitude at which an arc ends",
        )
    highest = arcs[-1].speeds(arcs[-1].high)[1]
    require(
        highest <= Fraction(claim["omega_end"]),
        "claim: omega_end is not shown to lie above the last cycle's speed",
    )
    require_claimed_enclosure(
        claim["numbers"]["omega_crit"], enclosed_omega_crit(disk), "omega_crit"
    )
    for name, distance in zip(_UNIQUENESS_KEYS, unique_within(arcs), strict=True):
        require(
            distance >= Fraction(claim["unique_within"][name]) > 0,
            f"claim: it is not shown that no other {name} is so near",
        )
    if KINDS[claim["kind"]]:
        contains_cycle = cycles_near_omega_h.verify(claim, evidence["end"]).contains_cycle(
            *last_cycle(arcs)
        )
        require(
            contains_cycle,
            "the last arc is not shown to run into the cycles next to the connection",
        )


def sentence(claim: Mapping[str, Any], numbers: Mapping[str, str]) -> str:
    """Return the theorem that a certificate claims about the family of limit cycles, in words.

    The text continues a sentence that has already named the disk and its friction law.

    Args:
        claim: The claim of the certificate.
        numbers: The claimed numbers by name, each as text with its uncertainty.
    """
    last, distance, whole = (
        f"{claim['amplitude_end']} rad",
        claim["unique_within"],
        KINDS[claim["kind"]],
    )
    if whole:
        amplitudes = "(0, pi)"
        speeds = (
            f"as a tends to pi Omega tends to Omega_h = {numbers['omega_h']} rad/s, at which "
            f"(pi/2, -pi/2, 0) and "
            "(pi/2, 3 pi/2, 0) are connected by a heteroclinic orbit, and by its image under S; "
            "the period tends to "
            "infinity, and v_0 to 0; each Omega with Omega_h < Omega < Omega_crit"
        )
        low, high = claim["low"], claim["high"]
        beyond = (
            f" P has no fixed point with 3 pi/2 - {claim['gamma']} <= gamma < 3 pi/2 and "
            f"-{claim['v']} rad/s <= v < 0 "
            f"for any Omega from {low} rad/s to Omega_h, and none but these cycles' for any Omega "
            f"from there to {high} "
            f"rad/s. Of the speeds from {low} to {high} rad/s Omega_h is the only one at which the "
            f"branch of the "
            "unstable manifold of (beta, gamma, v) = (pi/2, -pi/2, 0) that leaves with growing "
            "gamma converges to "
            "(pi/2, 3 pi/2, 0) with gamma growing all the way."
        )
    else:
        amplitudes, beyond = f"(0, {last.removesuffix(' rad')}] rad", ""
        speeds = (
            f"at a = {last} Omega is at most {claim['omega_end']} rad/s, so that each Omega from "
            f"there up to, but "
            "without, Omega_crit"
        )
    return (
        f", gamma being a real number, not an angle, there are analytic functions v_0(a) < 0 and "
        f"Omega(a) of a in {amplitudes} such that at the speed Omega(a) the orbit from beta = "
        f"pi/2, gamma = pi/2 + a "
        "with beta' = v_0(a) is an asymptotically stable limit cycle, which S, (beta, gamma, v) -> "
        "(pi - beta, pi - "
        "gamma, -v), maps to itself, which crosses beta = pi/2 exactly twice a period, and on "
        "which |beta - pi/2| is "
        "less than pi/2; as a grows Omega falls strictly, and the period and the largest |beta - "
        "pi/2| grow strictly; "
        "as a tends to 0 the cycle shrinks to inverted spinning, Omega tends to Omega_crit = "
        f"{numbers['omega_crit']} rad/s, where a pair of eigenvalues crosses the imaginary axis, "
        f"and the period tends "
        "to 2 pi over their imaginary part; "
        f"{speeds} is the speed of exactly one of these cycles. Let P be the half-period map, "
        f"along the flow at the "
        "speed Omega from beta = pi/2, v < 0 to the next crossing of beta = pi/2, with |beta - "
        "pi/2| < pi/2 between, "
        f"and then by S. For no a with 0 < a <= {last} there is another (v, Omega), v < 0, for "
        f"which P has the fixed "
        f"point gamma = pi/2 + a, v, with |Omega - Omega(a)| <= {distance['omega']} rad/s and, where a "
        f"<= "
        f"{claim['amplitude_first']} rad, |v - v_0(a)| <= {distance['v_0_per_gamma_bar_0']} a/s, where "
        f"a is larger, |v - "
        f"v_0(a)| <= {distance['v_0']} rad/s.{beyond}"
    )
