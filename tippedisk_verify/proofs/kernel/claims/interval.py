"""The limit cycles of an interval of speeds: what is claimed, how it follows from one test of an arc, its sentence.

With s = (Omega - omega) / radius the claim's ``curve`` holds two polynomials of s, their coefficients beginning with
that of s^0. ``unique_within`` is the box of the test about them, which Arb rounds up by 2^-29 of it at most;
``enclosed_within`` holds Krawczyk's image of it and is not larger.

Where a ball becomes a point or a float: nowhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

from tippedisk_verify.proofs.kernel.balls import need
from tippedisk_verify.proofs.kernel.claims.family import STEPS, curve_test, upper_bound
from tippedisk_verify.proofs.kernel.curves import OMEGA, Arc, Curve, Replay
from tippedisk_verify.proofs.kernel.reading import MANNERS, MEASURED, decimal, held, one_of

__all__ = ["SHAPES", "UNKNOWNS", "beta_bound", "interval_numbers", "interval_test", "sentence", "show"]

UNKNOWNS = ("gamma_bar_0", "v_0")
_NUMBERS = ("period", *UNKNOWNS, "multiplier_slow", "log_multiplier_slow", "log_multiplier_fast", "dperiod_domega",
            "dgamma_bar_0_domega", "dv_0_domega")  # fmt: skip
_UPRIGHT = Fraction(15707, 10000)  # rad: the flights prove that much in any case


def interval_test(claim: Mapping[str, Any], half: Sequence[str], choices: Any) -> Arc:
    """The test of the claim's box about its polynomials; ``half``: about half the period, a polynomial as well.

    Raises Unproved if the flight fails.
    """
    ends = (Fraction(claim["omega"]) + sign * Fraction(claim["radius"]) for sign in (-1, 1))
    need([*ends] == [Fraction(claim["low"]), Fraction(claim["high"])], "claim: the interval has other ends")
    need(0 < Fraction(claim["low"]) < Fraction(claim["high"]), "claim: the interval is empty, or not above zero")
    parameter, rows = (Fraction(claim["omega"]), Fraction(claim["radius"])), [claim["curve"][name] for name in UNKNOWNS]
    radii = [Fraction(claim["unique_within"][name]) for name in UNKNOWNS]
    return curve_test(claim["parameters"], Curve, OMEGA, parameter, [*rows, half], radii, choices)


def interval_numbers(arc: Arc) -> dict[str, Any]:
    """Balls that hold each number of the cycles of all speeds."""
    trace, divergence = arc.trace().range(), arc.flight.divergence.range()
    slow = abs(trace) / 2 + (trace * trace / 4 + divergence.exp()).sqrt()
    slow = slow * slow
    places = [jet.range() + off for jet, off in zip((arc.curve.gamma_bar, arc.curve.v), arc.within, strict=True)]
    slopes = (arc.period_slope(), *arc.slopes)
    values = (arc.period().range(), *places, slow, slow.log(), 2 * divergence - slow.log(),
              *(slope.range() for slope in slopes))  # fmt: skip
    return dict(zip(_NUMBERS, values, strict=True))


def beta_bound(arc: Arc) -> Fraction:
    """|beta_bar| is less than this on all cycles [rad]."""
    return min(upper_bound(arc.flight.beta_least), _UPRIGHT)


SHAPES = {
    "limit cycles of an interval of speeds": (
        {
            "friction": one_of("linear"),
            "numbers": dict.fromkeys(_NUMBERS, MEASURED),
            **dict.fromkeys(("omega", "radius", "low", "high", "beta_below"), decimal),
            **dict.fromkeys(("unique_within", "enclosed_within"), dict.fromkeys(UNKNOWNS, decimal)),
            "curve": {name: [decimal, None] for name in UNKNOWNS},
            "stable": one_of(True, False, None),
        },
        {"half": [decimal, None], "steps": STEPS},
    )
}


def show(claim: Mapping[str, Any], evidence: Mapping[str, Any]) -> None:
    """Raises Unproved if the evidence does not prove the claim."""
    arc = interval_test(claim, evidence["half"], Replay(evidence["steps"]))
    need(arc.included, "Krawczyk's image is not shown to lie inside the box")
    for name, off in zip(UNKNOWNS, arc.within, strict=True):
        near, room = (Fraction(claim[which][name]) for which in ("enclosed_within", "unique_within"))
        # The box of the test is larger than the room by up to 2^-29 of it: the cycles have to lie in the room itself.
        need(near <= room, f"claim: {name} is not shown to lie where it is said to be the only one")
        need(upper_bound(off) <= near, f"claim: {name} is not shown to be so near to its polynomial")
    for name, x in interval_numbers(arc).items():
        held(claim["numbers"][name], x, name)
    need(beta_bound(arc) <= Fraction(claim["beta_below"]), "claim: beta is not shown to stay so near to upright")
    need(claim["stable"] in (None, arc.stable()), "claim: the stability is not shown")


def sentence(claim: Mapping[str, Any], numbers: Mapping[str, str]) -> str:
    """What is said of the disk, in one sentence."""
    (p, q), radius = (_text(claim["curve"][name]) for name in UNKNOWNS), claim["radius"]
    room, near = ([claim[which][name] for name in UNKNOWNS] for which in ("unique_within", "enclosed_within"))
    return (
        f" and for every Omega from {claim['low']} to {claim['high']} rad/s, with s = (Omega - "
        f"{claim['omega']} rad/s) / ({radius} rad/s), the half-period map, along the flow from beta = pi/2, v < 0 to "
        "the next crossing of beta = pi/2 and then by S, (beta, gamma, v) -> (pi - beta, pi - gamma, -v), has exactly "
        "one fixed point "
        f"(gamma - pi/2, v) = (gamma_bar_0, v_0) with |gamma_bar_0 - p(s)| <= {room[0]} rad and |v_0 - q(s)| <= "
        f"{room[1]} rad/s, where p(s) = {p} and q(s) = {q}; it depends analytically on Omega, and the two distances "
        f"are at most {near[0]} rad and {near[1]} rad/s; through it runs {MANNERS[claim['stable']]}, which S maps to "
        "itself, which crosses beta = pi/2 exactly twice a period and on which |beta - pi/2| is less than "
        f"{claim['beta_below']} rad; for all these speeds its period is within {numbers['period']} s, its larger "
        f"Floquet multiplier other than 1 within {numbers['multiplier_slow']}, the logarithm of the smaller one within "
        f"{numbers['log_multiplier_fast']}, and dT/dOmega within {numbers['dperiod_domega']} s^2/rad."
    )


def _text(coefficients: Sequence[str]) -> str:
    """A polynomial of s in words."""
    terms = [text + ("" if not k else " s" if k == 1 else f" s^{k}") for k, text in enumerate(coefficients)]
    return " + ".join(terms).replace("+ -", "- ")
