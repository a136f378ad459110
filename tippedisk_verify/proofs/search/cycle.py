"""Limit cycles, proved: existence, local uniqueness, numbers, stability, by Krawczyk's operator on the half map.

A fixed point x of the half map P (see `section`) lies on a limit cycle that S maps to itself: the orbit goes from x to
-x and, by the symmetry, on to x in the same time again. With F = P - 1, a point m, a box X around it, and any regular
matrix Y,

    K = m - Y F(m) + (1 - Y F'(X)) (X - m)

holds every zero of F in X; if K lies in X's interior there is exactly one, and all matrices of F'(X) are regular
(Krawczyk 1969; Moore 1977; Rump 1983). Where parameters or the speed are balls, this is so for each choice in them.

The numbers follow on balls: period and largest |beta_bar| by the mean value theorem from m, the derivatives from the
run over X. The return map's multipliers are the squares of P's. P's determinant is -exp(integral of div f over the
half period) by Liouville's formula: S after the flow has the derivative -DPhi, with eigenvalue 1 along the field, and
determinant -det DPhi. So P has a positive and a negative real multiplier.

Under the smooth friction law P is continuously differentiable along orbits that cross gamma_y = 0 as `sliding` proves
them to, and nothing above asks for more.

Where a ball becomes a point or a float: m, Y and X's radius are chosen, and any choice that passes the test is right;
iterating towards m uses midpoints, for it only finds m.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from fractions import Fraction
from typing import Any, ClassVar

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.decimals import exact_text, rounded_down
from tippedisk_verify.model.exact import exact
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import bits_for_digits
from tippedisk_verify.proofs.kernel.balls import (
    arb,
    ball,
    measured,
    negative,
    positive,
    working_precision,
)
from tippedisk_verify.proofs.kernel.flow import Model
from tippedisk_verify.proofs.kernel.krawczyk import Flight, Inclusion, inclusion, midpoint_inverse, product
from tippedisk_verify.proofs.kernel.section import HalfFlight, half_flight
from tippedisk_verify.proofs.kernel.section import Status as HalfStatus
from tippedisk_verify.proofs.kernel.sliding import model_of

__all__ = [
    "MANNERS",
    "Attempt",
    "CycleProof",
    "OrbitProof",
    "Status",
    "apart",
    "prove_cycle",
]


_GUARD_DIGITS = 6  # the box is that much smaller than the digits asked for
_GUARD_BITS = 40  # rounding over half a period costs about 10 of them
_FIRST_BITS = 96
_REMOTE_BITS = 64  # enough for the wide boxes that show how far the next fixed point must be
_REMOTE_BOXES = (12, 16, 22, 30, 40)  # -log2 of their radii relative to the state
_MOST_ITERATIONS = 25
_MOST_ATTEMPTS = 6


#: What is said of an orbit in a sentence. One of undecided stability need not be isolated, as a limit cycle is.
MANNERS = {
    True: "a limit cycle, asymptotically stable",
    False: "a limit cycle, unstable",
    None: "a periodic orbit, of undecided stability",
}


class Status(Enum):
    """How an attempted proof of a limit cycle ended. The value says what happened and what to try next."""

    PROVED = "proved"
    NO_GUESS = "the ordinary road finds no limit cycle to start from"
    NOT_FOLLOWED = "the flow could not be followed from section to section"
    NOT_CONVERGED = "the guess could not be sharpened to a fixed point: start closer to a cycle"
    TRIVIAL = "the guess falls onto the equilibrium: start closer to a cycle"
    NOT_INCLUDED = "Krawczyk's image does not lie inside the box: work in more bits, or from a better guess"
    TOO_FEW_DIGITS = (
        "a cycle is proved to exist, but its numbers are not enclosed to the digits asked for: work in more bits"
    )


@dataclass(frozen=True)
class OrbitProof(ABC):
    """What is proved of one limit cycle; every number is a ball that holds the true one. Without a proof: None."""

    unknowns: ClassVar[tuple[str, str]]  #: names of the two coordinates on the section
    main: ClassVar[tuple[str, ...]]  #: names of the numbers that come to the digits asked for
    laps: ClassVar[int]  #: flights a period

    status: Status
    where: str  #: how far the proof came
    parameters: Parameters
    omega: Fraction  #: [rad/s], exact
    bits: int  #: working precision
    unique_within: Any = None  #: distances of the two coordinates within which the map has no other fixed point
    period: Any = None  #: T [s]
    multiplier_slow: Any = None  #: the larger non-trivial Floquet multiplier [1]
    log_multiplier_slow: Any = None  #: natural logarithm of its absolute value
    log_multiplier_fast: Any = None  #: that of the smaller one
    dperiod_domega: Any = None  #: [s^2/rad]
    stable: bool | None = None  #: asymptotically stable (True) or unstable (False), proved; None if not decided
    flights: tuple[HalfFlight, ...] = field(default=(), repr=False)

    @property
    def proved(self) -> bool:
        return self.status is Status.PROVED

    @property
    def statement(self) -> str:
        """What is proved, in one sentence."""
        if not self.proved:
            return f"nothing is proved: {self.status.value} ({self.where})."
        manner = MANNERS[self.stable]
        return self._sentence(manner, *(_decimal_below(distance) for distance in self.unique_within))

    @property
    def reversals(self) -> int:
        """How often the sliding velocity changes its sign in a period, proved under the smooth law only."""
        return self.laps * int(self.flights[-1].reversals)

    @property
    def sliding(self) -> str:
        """What is proved of the sliding velocity, as a part of the statement."""
        if self.parameters.friction == "linear":
            return ""
        count = f"{self.reversals} times a period"
        return f", on which the sliding velocity gamma_y changes its sign exactly {count} and is 0 nowhere else"

    @abstractmethod
    def _sentence(self, manner: str, first: str, second: str) -> str:
        """The statement; the cycle's stability, and how far from it there is no other, are words already."""

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """The names of the numbers."""
        slopes = (f"d{name}_domega" for name in cls.unknowns)
        others = ("multiplier_slow", "log_multiplier_slow", "log_multiplier_fast", "dperiod_domega")
        return *cls.main, *others, *slopes

    def lacking_bits(self, digits: int) -> int:
        """Bits by which the worst number misses ``digits`` significant digits, or decimals if it is no main result."""
        worst = 0
        for name in self.names():
            value = getattr(self, name)
            if not value.is_finite():
                return 64
            size = _exponent(value) if name in self.main else max(0, _exponent(value))
            # 2^size may be twice the value, and 10^-digits is rounded: two bits for that.
            worst = max(worst, _exponent(value.rad()) - size + 2 + math.ceil(digits * math.log2(10)))
        return worst

    def numbers(self) -> dict[str, Measured]:
        """The enclosures as exact rational midpoints and radii. Raises InputError if there is no proof."""
        if not self.proved:
            raise InputError(self.statement)
        return {name: measured(getattr(self, name)) for name in self.names()}

    def to_dict(self) -> dict[str, object]:
        """For the command line: the statement and, if proved, the numbers."""
        entries: dict[str, object] = {"proved": self.proved, "statement": self.statement}
        entries["omega"] = Measured(self.omega, Fraction(0)).to_dict()
        if self.proved:
            entries |= {name: value.to_dict() for name, value in self.numbers().items()}
            entries["stable"] = self.stable
            if self.parameters.friction == "smooth":
                entries["sliding_reversals"] = self.reversals
            distances = zip(self.unknowns, self.unique_within, strict=True)
            entries["unique_within"] = {name: _decimal_below(distance) for name, distance in distances}
        return entries | {"parameters": self.parameters.name, "bits": self.bits, "status": self.status.name}


@dataclass(frozen=True)
class CycleProof(OrbitProof):
    """What is proved of a limit cycle that S maps to itself. Names are those of `cycles.limit_cycle.LimitCycle`."""

    unknowns = ("gamma_bar_0", "v_0")
    main = ("period", "gamma_bar_0", "v_0", "beta_max")
    laps = 2

    gamma_bar_0: Any = None  #: gamma - pi/2 at beta = pi/2 with v < 0 [rad]
    v_0: Any = None  #: v there [rad/s]
    beta_max: Any = None  #: largest |beta - pi/2| [rad]
    dgamma_bar_0_domega: Any = None  #: [s]
    dv_0_domega: Any = None  #: [1]

    def _sentence(self, manner: str, first: str, second: str) -> str:
        numbers = self.numbers()
        return (
            f"for the tippedisk with {self.parameters.definition()} under the {self.parameters.law} friction law at "
            f"Omega = {exact_text(self.omega)} rad/s, the half-period map, along the flow from beta = pi/2, v < 0 to "
            "the next crossing of beta = pi/2 and then by S, (beta, gamma, v) -> (pi - beta, pi - gamma, -v), has a "
            f"fixed point (gamma - pi/2, v) = (gamma_bar_0, v_0) with gamma_bar_0 = {numbers['gamma_bar_0']} rad and "
            f"v_0 = {numbers['v_0']} rad/s, and no other with gamma within {first} rad and v within {second} rad/s "
            f"of it; through it runs {manner}, which S maps to itself, which crosses beta = pi/2 "
            f"exactly twice a period and whose largest |beta - pi/2| is beta_max = {numbers['beta_max']} rad, less "
            f"than 1.5707{self.sliding}; its period is T = {numbers['period']} s, its larger Floquet multiplier "
            f"other than 1 is {numbers['multiplier_slow']} with the logarithm {numbers['log_multiplier_slow']}, the "
            f"logarithm of the smaller one is {numbers['log_multiplier_fast']}, dT/dOmega = "
            f"{numbers['dperiod_domega']} s^2/rad, d(gamma_bar_0)/dOmega = {numbers['dgamma_bar_0_domega']} s and "
            f"d(v_0)/dOmega = {numbers['dv_0_domega']}."
        )


def _decimal_below(x: Any) -> str:
    """A decimal of two digits that no number of the ball is below; 0 if some are not positive."""
    enclosure = measured(x)
    least = enclosure.value - enclosure.uncertainty
    return rounded_down(least) if least > 0 else "0"


def prove_cycle(
    parameters: Parameters, omega: object, guess: Sequence[object], *, digits: int = 12, most_bits: int = 20_000
) -> CycleProof:
    """Prove the limit cycle near ``guess`` = (gamma_bar, v) at ``omega`` [rad/s] and enclose its numbers.

    Period, state and beta_max come to ``digits`` significant digits, the others to about as many. The guess, of a few
    digits or more, is sharpened here; ``most_bits`` bounds the working precision. Raises InputError for input that
    makes no sense; whatever else prevents a proof is a status.
    """
    speed = exact(omega)
    if speed.pi_multiple or speed.rational <= 0:
        raise InputError(f"Omega must be a positive decimal, not {str(omega)[:40]}")
    if len(guess) != 2:
        raise InputError("a guess has two components: gamma_bar and v")
    attempt = Attempt(parameters, speed.rational, digits, most_bits)
    proof: CycleProof = attempt.run([exact(part) for part in guess])
    return proof


class Attempt:
    """A proof under way: the precision and box in use, and how to report an end. A subclass has another section."""

    proof: type[OrbitProof] = CycleProof
    flight: Flight = staticmethod(half_flight)

    def __init__(self, parameters: Parameters, omega: Fraction, digits: int, most_bits: int) -> None:
        self.parameters, self.omega, self.digits, self.most_bits = parameters, omega, digits, most_bits
        self.box_bits = bits_for_digits(digits + _GUARD_DIGITS)
        self.bits = min(most_bits, self.box_bits + _GUARD_BITS)

    def ended(self, status: Status, where: str) -> Any:
        return self.proof(status, where, self.parameters, self.omega, self.bits)

    def not_followed(self, flight: HalfFlight) -> Any:
        return self.ended(Status.NOT_FOLLOWED, f"at t = {float(flight.reached):.4g} s: {flight.status.value}")

    def model(self) -> Model:
        """At the working precision, which must be in force."""
        return model_of(self.parameters, ball(self.omega))

    def run(self, guess: Sequence[Any]) -> Any:
        middle = self.sharpened(guess)
        if isinstance(middle, OrbitProof):
            return middle
        outcome: OrbitProof | None = None
        for _ in range(_MOST_ATTEMPTS):
            with working_precision(self.bits):
                radii = [abs(part) * arb(2) ** -self.box_bits for part in middle]
                verdict = inclusion(self.model(), middle, radii, flight=self.flight)
                if verdict.included:
                    proof = self.concluded(verdict, radii)
                    lacking = proof.lacking_bits(self.digits)
                    if not lacking:
                        return replace(proof, unique_within=self.neighbourhood(verdict, radii))
                    outcome = self.ended(Status.TOO_FEW_DIGITS, f"{lacking} bits are lacking")
                    self.box_bits += lacking + 4
                    wanted = self.bits + lacking + 4
                    middle = [part.mid() for part in verdict.image]
                elif verdict.failed is not None:
                    outcome = self.not_followed(verdict.failed)
                    wanted = self.bits + 64
                else:
                    outcome = self.ended(Status.NOT_INCLUDED, f"in {self.bits} bits")
                    wanted = self.bits + _shortage(verdict.residual, radii)
                    if all(part.is_finite() for part in verdict.image):
                        middle = [part.mid() for part in verdict.image]
            if wanted > self.most_bits:
                return outcome
            self.bits = wanted
        assert outcome is not None
        return outcome

    def sharpened(self, guess: Sequence[Any]) -> Any:
        """A point within the box's radius of the fixed point, by Newton's iteration on midpoints; or how that ended."""
        with working_precision(self.bits):
            state = [ball(part).mid() for part in guess]
        scale = float(abs(state[0])) + float(abs(state[1])) / 10
        if not scale > 0:
            return self.ended(Status.TRIVIAL, "the guess is the equilibrium")
        matrix: Any = None
        known, gain = 0, 0  # -log2 of the last step's size relative to the state, and of the matrix's error
        for _ in range(_MOST_ITERATIONS):
            with working_precision(min(self.bits, max(_FIRST_BITS, 2 * known + 64))):
                flight = self.flight(self.model(), *state, derivatives=matrix is None)
                if flight.status is not HalfStatus.RETURNED:
                    return self.not_followed(flight)
                if matrix is None:
                    (a, b), (c, d) = flight.matrix
                    matrix = ((a - 1, b), (c, d - 1))
                inverse = midpoint_inverse(matrix)
                step = product(inverse, [new - old for new, old in zip(flight.image, state, strict=True)])
                if not all(part.is_finite() for part in step):
                    return self.ended(Status.NOT_CONVERGED, "the derivative of the half map is singular")
            with working_precision(self.bits):
                state = [(old - part).mid() for old, part in zip(state, step, strict=True)]
            if float(abs(state[0])) + float(abs(state[1])) / 10 < scale / 5:
                return self.ended(Status.TRIVIAL, "in Newton's iteration")
            size = max(_exponent(part) for part in step) - max(_exponent(part) for part in state)
            previous, known = known, -size
            if known < 20:  # far away: a fresh derivative for the next step
                matrix, gain = None, 0
                continue
            gain = gain or known
            # Within the box's radius, or within what this precision can tell.
            if known + min(gain, known) > min(self.box_bits + 4, self.bits - 16):
                return state
            if known <= previous:  # a stale derivative
                matrix, gain = None, 0
        return self.ended(Status.NOT_CONVERGED, f"after {_MOST_ITERATIONS} steps of Newton's iteration")

    def neighbourhood(self, verdict: Inclusion, radii: Sequence[Any]) -> tuple[Any, Any]:
        """Distances within which there is no other fixed point: from the widest box that passes the test."""
        assert verdict.centre is not None
        widest = radii
        with working_precision(_REMOTE_BITS):
            model = self.model()
            for size in _REMOTE_BOXES:
                wide = [abs(part) * arb(2) ** -size for part in verdict.middle]
                if (
                    size < self.box_bits
                    and inclusion(model, verdict.middle, wide, verdict.centre, self.flight).included
                ):
                    widest = wide
                    break
        return apart(verdict, widest)

    def concluded(self, verdict: Inclusion, radii: Sequence[Any]) -> OrbitProof:
        """The cycle's numbers from an inclusion, on balls."""
        centre, box = verdict.centre, verdict.box
        assert centre is not None
        assert box is not None
        shift = [part - point for part, point in zip(verdict.image, verdict.middle, strict=True)]
        laps = self.proof.laps
        log_slow, slow = self.slow_multiplier(box)
        log_fast = laps * box.divergence - log_slow
        # (1 - P') x' = P_Omega
        (a, b), (c, d) = box.matrix
        determinant = (1 - a) * (1 - d) - b * c
        by_omega = (
            ((1 - d) * box.by_omega[0] + b * box.by_omega[1]) / determinant,
            ((1 - a) * box.by_omega[1] + c * box.by_omega[0]) / determinant,
        )
        time_by = box.time_by_state
        stable = None
        if negative(log_slow) and negative(log_fast):
            stable = True
        elif positive(log_slow):
            stable = False
        return self.proof(
            Status.PROVED,
            f"in {self.bits} bits, {centre.steps} + {box.steps} steps",
            self.parameters,
            self.omega,
            self.bits,
            unique_within=tuple(radii),
            period=laps * (centre.time + _along(time_by, shift)),
            multiplier_slow=slow,
            log_multiplier_slow=log_slow,
            log_multiplier_fast=log_fast,
            dperiod_domega=laps * (_along(time_by, by_omega) + box.time_by_omega),
            stable=stable,
            flights=(centre, box),
            **dict(zip(self.proof.unknowns, verdict.image, strict=True)),
            **{f"d{name}_domega": part for name, part in zip(self.proof.unknowns, by_omega, strict=True)},
            **self.others(centre, box, shift),
        )

    def slow_multiplier(self, box: HalfFlight) -> tuple[Any, Any]:
        """The larger one's logarithm and itself. The half map's have opposite signs: det P = -exp(divergence)."""
        (a, _), (_, d) = box.matrix
        trace, shrinking = a + d, box.divergence.exp()
        root = (trace * trace / 4 + shrinking).sqrt()
        # The root of larger size; where the trace's sign is not certain the sum holds both signs' cases.
        larger = abs(trace) / 2 + root
        slow = larger * larger
        return slow.log(), slow

    def others(self, centre: HalfFlight, box: HalfFlight, shift: Sequence[Any]) -> dict[str, Any]:
        """What this kind of cycle has besides."""
        return {"beta_max": -(centre.beta_least + _along(box.turn_by_start, shift))}


def apart(verdict: Inclusion, radii: Sequence[Any]) -> tuple[Any, Any]:
    """Distances from the fixed point of an inclusion within which a box of these radii, that passed too, reaches."""
    # The fixed point lies within K of m, so a distance from it reaches that much less far from m.
    near, far = (
        radius - abs(part - point) for radius, part, point in zip(radii, verdict.image, verdict.middle, strict=True)
    )
    return near, far


def _along(derivatives: Sequence[Any], shift: Sequence[Any]) -> Any:
    return derivatives[0] * shift[0] + derivatives[1] * shift[1]


def _exponent(x: Any) -> int:
    """An integer k with |x| < 2^k for all x of the finite ball, the least but for rounding (-10^6 for zero)."""
    mantissa, exponent = x.abs_upper().man_exp()
    return int(mantissa).bit_length() + int(exponent) if mantissa else -1_000_000


def _shortage(residual: Sequence[Any], radii: Sequence[Any]) -> int:
    """Bits that would bring the rounding errors of Y F(m) well below the box's radius; at least 16."""
    if not all(part.is_finite() for part in residual):
        return 64
    return max(16, 8 + max(_exponent(part.rad()) - _exponent(r) for part, r in zip(residual, radii, strict=True)))
