"""A limit cycle at an exact speed: the claim, its proof from a Krawczyk test, and its sentence.

By Theorems 5 and 9 of docs/certified_cycles.md a fixed point lies on a cycle. The numbers of the
cycle are then computed on balls. The mean value theorem about the test's middle gives the period
and the largest |beta_bar|. The flight over the test's box gives the multipliers and the derivatives
with respect to the speed.

Let P be the map of the section, f the field, Phi the flow and D = exp(integral of div f). The
determinant of the turn map's P' is D at a fixed point, because the factor gamma'(start) /
gamma'(end) is 1 there. The determinant of the half map's P' is -D: S after the flow has the
derivative -DPhi, with eigenvalue 1 along the field, and determinant -det DPhi.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tippedisk_verify.proofs.kernel.balls import (
    arb,
    ball,
    negative,
    positive,
    require,
    working_precision,
)
from tippedisk_verify.proofs.kernel.certificate_format import (
    FRICTION_LAWS,
    NUMBER_SHAPE,
    STABILITY_WORDS,
    one_of,
    read_count,
    read_decimal,
    read_dyadic,
    read_precision,
    require_claimed_enclosure,
)
from tippedisk_verify.proofs.kernel.krawczyk import (
    BOX_SHAPE,
    FLIGHT_SHAPE,
    KrawczykResult,
    replayed_test,
)
from tippedisk_verify.proofs.kernel.poincare_map import (
    LIBRATING_SECTION,
    ROTATING_SECTION,
    PoincareImage,
    PoincareSection,
)

__all__ = [
    "COORDINATE_NAMES",
    "KINDS",
    "SHAPES",
    "box_centre",
    "claimed_names",
    "cycle_numbers",
    "main_numbers",
    "reversals_per_period",
    "sentence",
    "stability",
    "uniqueness_radii",
    "verify",
]

KINDS = {"limit cycle": LIBRATING_SECTION, "rotating limit cycle": ROTATING_SECTION}
#: the names of a section's coordinates
COORDINATE_NAMES = {
    LIBRATING_SECTION: ("gamma_bar_0", "v_0"),
    ROTATING_SECTION: ("beta_bar_top", "v_top"),
}


def claimed_names(section: PoincareSection) -> tuple[str, ...]:
    """Return the names of the numbers that a certificate claims about a limit cycle.

    ``section`` tells if the cycle is librating or rotating. The names of `main_numbers`, which have
    the requested digits, come first.
    """
    slopes = (f"d{name}_domega" for name in COORDINATE_NAMES[section])
    others = ("multiplier_slow", "log_multiplier_slow", "log_multiplier_fast", "dperiod_domega")
    return *main_numbers(section), *others, *slopes


def main_numbers(section: PoincareSection) -> tuple[str, ...]:
    return (
        "period",
        *COORDINATE_NAMES[section],
        *(["beta_max"] if section == LIBRATING_SECTION else []),
    )


def box_centre(setting: Mapping[str, Any], middle: Sequence[Any]) -> tuple[list[Any], Any]:
    """Return the centre of the box in which a cycle is tested, and the speed's deviation from it.

    Args:
        setting: Contains the exact speed (``omega``).
        middle: Both coordinates of the centre on the section, as exact numbers.

    Returns:
        A list of these coordinates and of the midpoint of a ball that holds the speed. Then that
        ball minus its midpoint.
    """
    speed = ball(setting["omega"])
    return [*middle, speed.mid()], speed - speed.mid()


def cycle_numbers(section: PoincareSection, fixed: KrawczykResult) -> dict[str, Any]:
    """Return enclosures of a limit cycle's numbers by name: period, multipliers, derivatives, ...

    The names are `claimed_names`.

    Args:
        section: The section of the cycle.
        fixed: The enclosed fixed point, with the map's derivatives.
    """
    centre, box, flights = fixed.centre, fixed.box, section.flights_per_period
    (a, b, e), (c, d, f) = box.image_by_start  # by (x, Omega)
    trace, contraction = a + d, box.divergence.exp()
    # For a complex pair, or a turn map's trace of uncertain sign, this is not finite and proves
    # nothing.
    larger = (abs(trace) + (trace * trace - 4 * section.symmetry_sign * contraction).sqrt()) / 2
    sign: Any = 1
    if section != LIBRATING_SECTION and not positive(trace):
        sign = -1 if negative(trace) else arb.nan()
    slow, determinant = flights * larger.log(), (1 - a) * (1 - d) - b * c
    by_omega = [
        ((1 - d) * e + b * f) / determinant,
        ((1 - a) * f + c * e) / determinant,
        1,
    ]
    first, second = COORDINATE_NAMES[section]
    numbers = {
        "period": flights * fixed.mean_value_form(centre.time, box.time_by_start),
        first: fixed.image[0],
        second: fixed.image[1],
        "multiplier_slow": sign * larger**flights,
        "log_multiplier_slow": slow,
        "log_multiplier_fast": flights * box.divergence - slow,
        "dperiod_domega": flights
        * sum(x * y for x, y in zip(box.time_by_start, by_omega, strict=True)),
        f"d{first}_domega": by_omega[0],
        f"d{second}_domega": by_omega[1],
    }
    return numbers | (
        {"beta_max": -fixed.mean_value_form(centre.beta_least, box.beta_least_by_start)}
        if section == LIBRATING_SECTION
        else {}
    )


def stability(numbers: Mapping[str, Any]) -> bool | None:
    """Return True if a limit cycle is proved asymptotically stable, False if it is proved unstable.

    Returns None if neither is proved. The signs of the enclosed ``log_multiplier_slow`` and
    ``log_multiplier_fast`` decide.
    """
    slow, fast = numbers["log_multiplier_slow"], numbers["log_multiplier_fast"]
    if negative(slow) and negative(fast):
        return True
    return False if positive(slow) else None


def uniqueness_radii(fixed: KrawczykResult, radii: Sequence[Any]) -> tuple[Any, Any]:
    """Return two balls: the distances from an enclosed fixed point to the faces of a tested box.

    No other fixed point is nearer than these distances. ``radii`` are those of the box, for the two
    coordinates on the section.
    """
    # The fixed point is up to |K - m| from the box's middle m, so it is nearer to the faces than m.
    first, second = (
        radius.rad() - abs(part) for radius, part in zip(radii, fixed.shift, strict=False)
    )
    return first, second


def reversals_per_period(section: PoincareSection, fixed: KrawczykResult) -> int:
    """Return the number of sign changes of the sliding velocity in a period of a limit cycle
    (smooth law only).
    """
    return int(section.flights_per_period * fixed.box.reversals)


SHAPES = {
    kind: (
        {
            "omega": read_decimal,
            "numbers": dict.fromkeys(claimed_names(section), NUMBER_SHAPE),
            "stable": one_of(True, False, None),
            "unique_within": dict.fromkeys(COORDINATE_NAMES[section], read_decimal),
            "reversals?": read_count,
        },
        {
            "middle": [read_dyadic, 2],
            "centre": FLIGHT_SHAPE,
            "box": BOX_SHAPE,
            "wide box?": BOX_SHAPE | {"bits": read_precision},
        },
    )
    for kind, section in KINDS.items()
}


def verify(claim: Mapping[str, Any], evidence: Mapping[str, Any]) -> None:
    """Check a certificate about one limit cycle: repeat the proof with the evidence that it
    records.

    Args:
        claim: The claim, as read from the file.
        evidence: The evidence, as read from the file.

    Raises:
        Unproved: If the evidence does not prove the claim.
    """
    section = KINDS[claim["kind"]]
    middle, speed_deviation = box_centre(claim, evidence["middle"])

    def test(name: str, centre: PoincareImage | None = None) -> KrawczykResult:
        box, log = evidence[name], evidence["centre"]
        return replayed_test(
            claim, section, middle, [*box["radii"], speed_deviation], (0, 1), log, box, name, centre
        )

    fixed, widest = test("box"), evidence["box"]["radii"]
    numbers = cycle_numbers(section, fixed)
    for name, number in claim["numbers"].items():
        require_claimed_enclosure(number, numbers[name], name)
    require(claim["stable"] in (None, stability(numbers)), "claim: the stability is not shown")
    if FRICTION_LAWS[claim["friction"]].two_sided:
        require(
            claim.get("reversals") == reversals_per_period(section, fixed),
            "claim: the sliding reversals are not shown",
        )
    if "wide box" in evidence:
        widest = evidence["wide box"]["radii"]
        with working_precision(evidence["wide box"]["bits"]):
            test("wide box", fixed.centre)
    for name, distance in zip(
        COORDINATE_NAMES[section], uniqueness_radii(fixed, widest), strict=True
    ):
        least = ball(claim["unique_within"][name])
        require(
            bool(distance >= least > 0), f"claim: it is not shown that no other {name} is so near"
        )


def sentence(claim: Mapping[str, Any], numbers: Mapping[str, str]) -> str:
    """Return the theorem that a certificate claims about one limit cycle, in words.

    The text continues a sentence that has already named the disk and its friction law.

    Args:
        claim: The claim of the certificate.
        numbers: The claimed numbers by name, each as text with its uncertainty.
    """
    section, n, distance = KINDS[claim["kind"]], numbers, claim["unique_within"]
    first, second = COORDINATE_NAMES[section]
    sliding = ""
    if FRICTION_LAWS[claim["friction"]].two_sided:
        changes = (
            f"changes its sign exactly {claim['reversals']} times a period and is 0 nowhere else"
        )
        sliding = f", on which the sliding velocity gamma_y {changes}"
    manner = STABILITY_WORDS[claim["stable"]]
    if section == LIBRATING_SECTION:
        return (
            f" at Omega = {claim['omega']} rad/s, the half-period map, along the flow from beta = "
            "pi/2, v < 0 to the next crossing of beta = pi/2 and then by S, (beta, gamma, v) -> "
            "(pi - beta, pi - "
            f"gamma, -v), has a fixed point (gamma - pi/2, v) = (gamma_bar_0, v_0) with "
            f"gamma_bar_0 = {n[first]} rad "
            f"and v_0 = {n[second]} rad/s, and no other with gamma within {distance[first]} rad and v "
            f"within "
            f"{distance[second]} rad/s of it; through it runs {manner}, which S maps to itself, which "
            f"crosses beta = pi/2 "
            f"exactly twice a period and whose largest |beta - pi/2| is beta_max = {n['beta_max']} "
            f"rad, less than "
            f"1.5707{sliding}; its period is T = {n['period']} s, its larger Floquet multiplier "
            f"other than 1 is "
            f"{n['multiplier_slow']} with the logarithm {n['log_multiplier_slow']}, the logarithm "
            f"of the smaller one "
            f"is {n['log_multiplier_fast']}, dT/dOmega = {n['dperiod_domega']} s^2/rad, "
            f"d(gamma_bar_0)/dOmega = "
            f"{n['dgamma_bar_0_domega']} s and d(v_0)/dOmega = {n['dv_0_domega']}."
        )
    return (
        f" at Omega = {claim['omega']} rad/s, the turn map, along the flow from gamma = pi/2 to "
        f"gamma = 5 pi/2, has a fixed point (beta - pi/2, v) = (beta_bar_top, v_top) with "
        f"beta_bar_top = {n[first]} "
        f"rad and v_top = {n[second]} rad/s, and no other with beta within {distance[first]} rad and v "
        f"within "
        f"{distance[second]} rad/s of it; through it runs {manner}, on which gamma grows all the time, "
        f"by 2 pi a period, "
        f"with 0 < beta - pi/2 < 1.5707{sliding}; its period is T = {n['period']} s, its Floquet "
        f"multiplier other than "
        f"1 of larger absolute value is {n['multiplier_slow']}, the logarithms of the absolute "
        f"values of both are "
        f"{n['log_multiplier_slow']} and {n['log_multiplier_fast']}, dT/dOmega = "
        f"{n['dperiod_domega']} s^2/rad, "
        f"d(beta_bar_top)/dOmega = {n['dbeta_bar_top_domega']} s and d(v_top)/dOmega = "
        f"{n['dv_top_domega']}."
    )
