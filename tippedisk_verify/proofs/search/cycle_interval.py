"""The limit cycles of an interval of speeds, proved at once: `arc` says how, here it is asked and reported.

Where a ball becomes a point or a float: the polynomials are rounded to decimals, which are then exact; radii are
chosen. What is printed of an enclosure holds it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from fractions import Fraction
from typing import Any

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.decimals import exact_text, rounded_up
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.exact import exact
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.proofs.closed_forms import refuse_past_birth
from tippedisk_verify.proofs.kernel.balls import arb, ball, ball_constants, working_precision
from tippedisk_verify.proofs.kernel.claims.words import MANNERS
from tippedisk_verify.proofs.kernel.curve_flow import Curve, duration
from tippedisk_verify.proofs.kernel.flow import Model
from tippedisk_verify.proofs.kernel.jets import Jet
from tippedisk_verify.proofs.numbers import measured
from tippedisk_verify.proofs.search.arc import Arc, family_polynomials, krawczyk_test

__all__ = [
    "IntervalProof",
    "Status",
    "decimal_above",
    "failed_interval",
    "polynomial_text",
    "prove_interval",
    "rounded_jet",
    "two_digits",
]

_BITS, _DEGREE = 64, 4
_UPRIGHT = Fraction(15707, 10000)  # rad: the flights prove that much in any case
_PLACES = 16  # decimals of the polynomials' coefficients
_SHARE = Fraction(1, 10_000)  # of the box's radius in how far the family moves: it widens the enclosures by little
_LEAST = Fraction(1, 10**12)  # a box's radius [rad, rad/s]
_MOST_ATTEMPTS = 3


class Status(Enum):
    """How an attempted proof for an interval of speeds ended. The value says what happened and what to try next."""

    PROVED = "proved"
    NO_GUESS = "the ordinary road finds no limit cycle to start from"
    NO_RETURN = "the guess does not return to beta = pi/2: start closer to a cycle"
    NOT_FOLLOWED = "the orbits of all these speeds could not be followed from section to section: take a smaller radius"
    NOT_INCLUDED = "Krawczyk's image does not lie inside the box: take a smaller radius, or start closer to a cycle"


@dataclass(frozen=True)
class IntervalProof:
    """What is proved of the limit cycles of all speeds with |Omega - omega| <= radius. Without a proof: None.

    With s = (Omega - omega) / radius the ``curve`` holds two polynomials of s, their coefficients beginning with that
    of s^0: gamma_bar_0 and v_0 lie within ``enclosed_within`` of them, and the half map has no other fixed point within
    ``unique_within``. Every other number is a half-width about a value that holds the true one at each of the speeds.
    """

    status: Status
    parameters: Parameters
    omega: Fraction  #: middle of the interval [rad/s], exact
    radius: Fraction  #: [rad/s], exact
    curve: tuple[tuple[Fraction, ...], tuple[Fraction, ...]] = ((), ())  #: [rad], [rad/s]
    unique_within: tuple[Fraction, Fraction] = (Fraction(0), Fraction(0))  #: [rad], [rad/s]
    enclosed_within: tuple[Fraction, Fraction] = (Fraction(0), Fraction(0))
    numbers: tuple[tuple[str, Measured], ...] = ()  #: names as of `cycle.OrbitProof`
    beta_below: Fraction | None = None  #: |beta - pi/2| is less than this [rad]
    stable: bool | None = None  #: all of them (True) or none (False), proved; None if not decided

    @property
    def proved(self) -> bool:
        return self.status is Status.PROVED

    @property
    def statement(self) -> str:
        """What is proved, in one sentence."""
        middle, radius = exact_text(self.omega), exact_text(self.radius)
        if not self.proved:
            return f"nothing is proved of Omega within {radius} rad/s of {middle} rad/s: {self.status.value}."
        manner = MANNERS[self.stable]
        numbers = dict(self.numbers)
        low, high = (exact_text(end) for end in (self.omega - self.radius, self.omega + self.radius))
        return (
            f"for the tippedisk with {self.parameters.definition()} under the linear friction law and for every Omega "
            f"from {low} to {high} rad/s, with s = (Omega - {middle} rad/s) / ({radius} rad/s), the half-period map, "
            "along the flow from beta = pi/2, v < 0 to the next crossing of beta = pi/2 and then by S, (beta, gamma, "
            "v) -> (pi - beta, pi - gamma, -v), has exactly one fixed point (gamma - pi/2, v) = (gamma_bar_0, v_0) "
            f"with |gamma_bar_0 - p(s)| <= {exact_text(self.unique_within[0])} rad and |v_0 - q(s)| <= "
            f"{exact_text(self.unique_within[1])} rad/s, where p(s) = {polynomial_text(self.curve[0])} and q(s) = "
            f"{polynomial_text(self.curve[1])}; it depends analytically on Omega, and the two distances are at most "
            f"{exact_text(self.enclosed_within[0])} rad and {exact_text(self.enclosed_within[1])} rad/s; through it "
            f"runs {manner}, which S maps to itself, which crosses beta = pi/2 exactly twice a period "
            f"and on which |beta - pi/2| is less than {exact_text(self.beta_below or Fraction(0))} rad; for all these "
            f"speeds its period is within {numbers['period']} s, its larger Floquet multiplier other than 1 within "
            f"{numbers['multiplier_slow']}, the logarithm of the smaller one within {numbers['log_multiplier_fast']}, "
            f"and dT/dOmega within {numbers['dperiod_domega']} s^2/rad."
        )

    def to_dict(self) -> dict[str, object]:
        """For the command line: the statement and, if proved, the numbers."""
        entries: dict[str, object] = {"proved": self.proved, "statement": self.statement}
        entries["omega"] = Measured(self.omega, Fraction(0)).to_dict()
        entries["radius"] = exact_text(self.radius)
        if self.proved:
            names = ("gamma_bar_0", "v_0")
            entries |= {name: value.to_dict() for name, value in self.numbers}
            entries["stable"] = self.stable
            entries["beta_below"] = exact_text(self.beta_below or Fraction(0))
            entries["unique_within"] = dict(zip(names, map(exact_text, self.unique_within), strict=True))
            entries["enclosed_within"] = dict(zip(names, map(exact_text, self.enclosed_within), strict=True))
            curve = ([exact_text(part) for part in row] for row in self.curve)
            entries["curve"] = dict(zip(names, curve, strict=True))
        return entries | {"parameters": self.parameters.name, "bits": _BITS, "status": self.status.name}


def failed_interval(
    parameters: Parameters, omega: object, radius: object, status: Status = Status.NO_GUESS
) -> IntervalProof:
    """That nothing is proved. Raises InputError for the smooth law, and for speeds that make no sense for the disk."""
    parameters.refuse_smooth("the limit cycles of an interval of speeds are proved")
    speed, around = checked_speed(omega), exact(radius)
    if around.pi_multiple or not 0 < around.rational < speed:
        raise InputError(f"the radius must be a positive decimal less than Omega, not {str(radius)[:40]}")
    refuse_past_birth(parameters, speed + around.rational)
    return IntervalProof(status, parameters, speed, around.rational)


def prove_interval(parameters: Parameters, omega: object, radius: object, guess: Sequence[object]) -> IntervalProof:
    """Prove the limit cycles of all speeds within ``radius`` of ``omega`` [rad/s].

    ``guess`` = (gamma_bar, v) of the one at ``omega``, to some digits. Raises InputError for input that makes no sense;
    whatever else prevents a proof is a status.
    """
    if len(guess) != 2:
        raise InputError("a guess has two components: gamma_bar and v")
    failed = failed_interval(parameters, omega, radius, Status.NO_RETURN)
    with working_precision(_BITS):
        constants, speed, width = ball_constants(parameters), ball(failed.omega), ball(failed.radius)
        start = [ball(part) for part in guess]
        total = duration(Model(constants, speed.mid()), *start)
        if total is None:
            return failed
        polynomials, half = family_polynomials(constants, [*start, speed], width, _DEGREE, total)
        if not all(part.is_finite() for jet in (*polynomials, half) for part in jet.c):
            return replace(failed, status=Status.NOT_FOLLOWED)
        curve = rounded_jet(polynomials[0]), rounded_jet(polynomials[1])
        path = [Jet([ball(part) for part in row]) for row in curve]
        speeds = Jet([speed, width, *[arb(0)] * (_DEGREE - 1)])
        radii = [two_digits(max(abs(row[1]) * _SHARE, _LEAST)) for row in curve]
        for _ in range(_MOST_ATTEMPTS):
            deviation = [*(arb(0, ball(part)) for part in radii), arb(0)]
            arc = krawczyk_test(constants, Curve(path[0], path[1], speeds, deviation), half)
            # The radii that are printed are the decimals, and arb's are a little larger.
            if not all(part.is_finite() for part in arc.within):
                return replace(failed, status=Status.NOT_FOLLOWED)
            held = [decimal_above(abs(part)) for part in arc.within]
            if arc.proved and all(a <= b for a, b in zip(held, radii, strict=True)):
                around, near = (radii[0], radii[1]), (held[0], held[1])
                return _concluded(replace(failed, curve=curve, unique_within=around, enclosed_within=near), arc)
            radii = [two_digits(2 * part) for part in held]
        return replace(failed, status=Status.NOT_INCLUDED if arc.flight.proved else Status.NOT_FOLLOWED)


def _concluded(proof: IntervalProof, arc: Arc) -> IntervalProof:
    trace, divergence = arc.trace().range(), arc.flight.divergence.range()
    slow = abs(trace) / 2 + (trace * trace / 4 + divergence.exp()).sqrt()
    slow = slow * slow
    places = [jet.range() + part for jet, part in zip((arc.curve.gamma_bar, arc.curve.v), arc.within, strict=True)]
    numbers = {
        "period": arc.period().range(),
        "gamma_bar_0": places[0],
        "v_0": places[1],
        "multiplier_slow": slow,
        "log_multiplier_slow": slow.log(),
        "log_multiplier_fast": 2 * divergence - slow.log(),
        "dperiod_domega": arc.period_slope().range(),
        "dgamma_bar_0_domega": arc.slopes[0].range(),
        "dv_0_domega": arc.slopes[1].range(),
    }
    if not all(part.is_finite() for part in numbers.values()):
        return replace(proof, status=Status.NOT_INCLUDED)
    return replace(
        proof,
        status=Status.PROVED,
        numbers=tuple((name, measured(part)) for name, part in numbers.items()),
        beta_below=min(decimal_above(-arc.flight.beta_least), _UPRIGHT),
        stable=True if arc.stable() else False if arc.unstable() else None,
    )


def rounded_jet(jet: Jet) -> tuple[Fraction, ...]:
    """Decimals near the midpoints."""
    return tuple(round(measured(part.mid()).value, _PLACES) for part in jet.c)


def two_digits(value: Fraction) -> Fraction:
    """The least decimal of two digits that is not smaller."""
    return Fraction(rounded_up(value))


def decimal_above(x: Any) -> Fraction:
    """A decimal of two digits that no number of the finite ball exceeds."""
    enclosure = measured(x)
    return two_digits(max(enclosure.value + enclosure.uncertainty, Fraction(1, 10**30)))


def polynomial_text(coefficients: Sequence[Fraction]) -> str:
    """A polynomial of s in words."""
    terms = [exact_text(part) + ("" if not k else " s" if k == 1 else f" s^{k}") for k, part in enumerate(coefficients)]
    return " + ".join(terms).replace("+ -", "- ")
