"""A fold of limit cycles: an extreme speed on an arc of a family, rotating or librating.

The family is a curve over p, the first coordinate on the section. The second coordinate v and the
speed Omega are unknown. By Theorem 10 of docs/certified_cycles.md it suffices to apply Krawczyk's
test over p in a ball, and to find the signs of dOmega/dp at the arc's ends. The half map includes
the symmetry, so the multipliers of a period are the squares of the map's eigenvalues.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any, Literal

from tippedisk_verify.proofs.kernel.balls import arb, ball, inside, negative, positive, require
from tippedisk_verify.proofs.kernel.certificate_format import (
    NUMBER_SHAPE,
    one_of,
    read_dyadic,
    require_claimed_enclosure,
)
from tippedisk_verify.proofs.kernel.certificates.cycle import COORDINATE_NAMES
from tippedisk_verify.proofs.kernel.krawczyk import (
    BOX_SHAPE,
    FLIGHT_SHAPE,
    KrawczykResult,
    replayed_test,
)
from tippedisk_verify.proofs.kernel.poincare_map import (
    LIBRATING_SECTION,
    ROTATING_SECTION,
    PoincareSection,
)

__all__ = [
    "KINDS",
    "SHAPES",
    "TEST_NAMES",
    "arc_balls",
    "claimed_names",
    "extremum",
    "require_extremum",
    "sentence",
    "speed_slope",
    "verify",
]

KINDS = {
    "fold of limit cycles": LIBRATING_SECTION,
    "fold of rotating limit cycles": ROTATING_SECTION,
}
TEST_NAMES = (
    "arc",
    "lower end",
    "upper end",
)  #: the three tests: over the whole arc, and at its ends
EXTREMA = ("smallest", "largest")


def claimed_names(section: PoincareSection) -> tuple[str, ...]:
    return "omega", *COORDINATE_NAMES[section], "period"


def arc_balls(midpoint: Fraction, half_width: Fraction) -> tuple[Any, Any, Any]:
    """Return three balls of p, the first coordinate on the section: over a whole arc of cycles, at
    its lower and at its upper end.

    The arc contains all p with |p - place| <= half.
    """
    return (
        ball(midpoint) + arb(0, ball(half_width).upper()),
        ball(midpoint - half_width),
        ball(midpoint + half_width),
    )


def speed_slope(fixed: KrawczykResult) -> Any:
    """Return a ball of dOmega/dp along a curve of fixed points, from the result of a passed test.

    p is the first coordinate on the section, and Omega the speed of the cycle through it.
    """
    (f, a, b), (g, c, d) = fixed.jacobian
    return (c * f - a * g) / (a * d - b * c)


def extremum(lower: Any, upper: Any) -> Literal["smallest", "largest"] | None:
    """Return the kind of extremum that Omega is shown to have inside an arc of cycles, or None.

    ``lower`` and ``upper`` are balls of Omega's slope at the arc's lower and upper end. Only their
    signs matter.
    """
    if negative(lower) and positive(upper):
        return "smallest"
    return "largest" if positive(lower) and negative(upper) else None


def require_extremum(
    claim: Mapping[str, Any],
    section: PoincareSection,
    points: Sequence[KrawczykResult],
    radii: Sequence[Any],
) -> None:
    """Raise Unproved unless the passed tests, on a whole arc of cycles and at its ends, prove the
    claim of a fold.

    Args:
        claim: The claim of a fold, with its numbers and the kind of extremum.
        section: The section of the cycles.
        points: The results of the passed tests, in the order of `TEST_NAMES`.
        radii: The radii of the arc's box, in v and Omega.
    """
    whole, numbers = points[0], claim["numbers"]
    for point, name in zip(points[1:], TEST_NAMES[1:], strict=True):
        # The arc's box holds one cycle only.
        deviations = zip(point.image[1:], whole.middle[1:], radii, strict=True)
        require(
            all(inside(x - y, r) for x, y, r in deviations),
            f"{name}: the cycle is not shown to be the arc's",
        )
    require(
        extremum(*map(speed_slope, points[1:])) == claim["extremum"],
        "claim: the speed has no such extremum",
    )
    require(
        negative(whole.box.divergence), "claim: the third multiplier is not shown to be below 1"
    )
    for name, x, middle, box_radius in zip(
        (COORDINATE_NAMES[section][1], "omega"),
        whole.image[1:],
        whole.middle[1:],
        radii,
        strict=True,
    ):
        require_claimed_enclosure(numbers[name], x, name)
        # The printed interval is a little wider than Krawczyk's image. It must lie in the box of
        # one cycle.
        printed = abs(ball(numbers[name]["value"]) - middle) + ball(numbers[name]["uncertainty"])
        require(
            inside(printed, box_radius),
            f"claim: {name} reaches beyond the box that holds one cycle",
        )
    require_claimed_enclosure(
        numbers["period"], section.flights_per_period * whole.box.time, "period"
    )


_TEST_SHAPE = {"middle": [read_dyadic, 2], "centre": FLIGHT_SHAPE, "box": BOX_SHAPE}
SHAPES = {
    kind: (
        {
            "friction": one_of("linear"),  # the smooth law has no analytic curves of cycles
            "numbers": dict.fromkeys(claimed_names(section), NUMBER_SHAPE),
            "extremum": one_of(*EXTREMA),
        },
        dict.fromkeys(TEST_NAMES, _TEST_SHAPE),
    )
    for kind, section in KINDS.items()
}


def verify(claim: Mapping[str, Any], evidence: Mapping[str, Any]) -> None:
    """Check a certificate about a fold: repeat the proof with the evidence that it records.

    Args:
        claim: The claim, as read from the file.
        evidence: The evidence, as read from the file.

    Raises:
        Unproved: If the evidence does not prove the claim.
    """
    section = KINDS[claim["kind"]]
    arc = claim["numbers"][COORDINATE_NAMES[section][0]]
    midpoint, half_width = Fraction(arc["value"]), Fraction(arc["uncertainty"])
    require(half_width > 0, f"claim: {COORDINATE_NAMES[section][0]} is not an interval")
    points = []
    for name, p in zip(TEST_NAMES, arc_balls(midpoint, half_width), strict=True):
        point = evidence[name]
        middle, deviations = [p.mid(), *point["middle"]], [p - p.mid(), *point["box"]["radii"]]
        log, box = point["centre"], point["box"]
        points.append(replayed_test(claim, section, middle, deviations, (1, 2), log, box, name))
    require_extremum(claim, section, points, evidence["arc"]["box"]["radii"])


def sentence(claim: Mapping[str, Any], numbers: Mapping[str, str]) -> str:
    """Return the theorem that a certificate claims about a fold of limit cycles, in words.

    The text continues a sentence that has already named the disk and its friction law.

    Args:
        claim: The claim of the certificate.
        numbers: The claimed numbers by name, each as text with its uncertainty.
    """
    section, n = KINDS[claim["kind"]], numbers
    first, second = COORDINATE_NAMES[section]
    pair = f"there is exactly one pair of v within {n[second]} rad/s and Omega within {n['omega']} rad/s such that"
    if section == LIBRATING_SECTION:
        cycles = (
            f"for each gamma_bar = gamma - pi/2 of the closed interval {n[first]} rad {pair} the "
            f"orbit from (pi/2, "
            "gamma, v) meets beta = pi/2 next in (pi/2, pi - gamma, -v), whence S, (beta, gamma, "
            "v) -> (pi - beta, pi "
            "- gamma, -v), maps it to itself; on it |beta - pi/2| < 1.5707 throughout"
        )
    else:
        cycles = (
            f"for each beta_bar = beta - pi/2 of the closed interval {n[first]} rad {pair} the "
            f"orbit from (beta, pi/2, "
            "v) returns to beta and v when gamma has grown by 2 pi for the first time; on it 0 < "
            "beta - pi/2 < 1.5707 "
            "throughout"
        )
    signs = ("falls", "rises") if claim["extremum"] == "smallest" else ("rises", "falls")
    return (
        f", {cycles}, and these periodic orbits form an analytic curve, on which Omega {signs[0]} "
        f"at the lower end of the interval and {signs[1]} at the upper one: at an inner point "
        f"Omega has its "
        f"{claim['extremum']} value on the curve, and the Floquet multipliers of the orbit there "
        f"are 1, 1 and a number "
        f"between 0 and 1; the periods lie within {n['period']} s."
    )
