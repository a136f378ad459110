"""Speeds without a connection, proved: over whole intervals the unstable branch misses the second saddle.

The branch of the unstable manifold of (0, -pi, 0) (shifted angles) that leaves with growing gamma is enclosed where it
passes z_u = theta_0, for all speeds of a piece of the interval (`local_manifolds`), and followed from there (`flow`)
until one of these is proved for all of them at once:

- *it turns back*: beta_bar < 0 at some moment, where gamma' = -Omega cos(beta) = Omega sin(beta_bar) is negative;
- *it goes past*: gamma_bar > pi at some moment.

Either way it does not converge to (0, pi, 0) with gamma growing all the way, which is what a connection at Omega_h does
(`heteroclinic`). Of connections on which gamma falls for a while nothing is said. The pieces are closed intervals with
exact ends, each beginning where the last one ends, so they cover the interval.

Where a ball becomes a point here: theta_0 and the pieces' ends are exact numbers chosen freely.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

from flint import arb

from tippedisk_verify.certified.balls import hull, inside, negative, positive, working_precision
from tippedisk_verify.certified.local_manifolds import UNSTABLE, Curve, Frame
from tippedisk_verify.certified.sliding import model_of
from tippedisk_verify.errors import InputError, NoConnectionError
from tippedisk_verify.model.exact import exact
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters

__all__ = ["ProvedAbsence", "prove_absence"]

_BITS = 53  # far more than intervals as wide as these need
_ORDER = 19  # of the local series, a third of the bits
_LONGEST = 30.0  # s
_UPRIGHT = 1.5707  # rad, below pi/2: |beta_bar| less than this means that sin(beta) > 0
_FIRST_SHARE = Fraction(1, 4)  # of the interval; halved until it works
_WIDENED = Fraction(5, 4)
_SMALLEST_SHARE = Fraction(1, 2**12)


@dataclass(frozen=True)
class ProvedAbsence:
    """What is proved of a disk on the closed interval of speeds from ``low`` to ``high`` [rad/s], both exact."""

    parameters: Parameters
    low: Fraction
    high: Fraction
    reached: Fraction  #: up to here the pieces are proved to hold no connection; ``high`` if all are
    outcomes: tuple[str, ...]  #: "turns back", "goes past 3 pi/2"
    pieces: int
    detail: str = ""  #: why it ended, if it did

    @property
    def proved(self) -> bool:
        return self.reached == self.high

    @property
    def statement(self) -> str:
        if not self.proved:
            return f"nothing is proved: {self.detail}."
        low, high = (_decimal(end) for end in (self.low, self.high))
        return (
            f"for the tippedisk with {self.parameters.definition()} under the {self.parameters.law} friction law, at "
            f"every Omega from {low} to {high} rad/s, gamma on the branch of the unstable manifold of (beta, gamma, "
            f"v) = (pi/2, -pi/2, 0) that leaves with growing gamma {' or '.join(self.outcomes)}: there is no "
            "connection to (pi/2, 3 pi/2, 0) on which gamma grows all the way."
        )

    def json(self) -> dict[str, object]:
        return {
            "proved": self.proved,
            "statement": self.statement,
            "low": _decimal(self.low),
            "high": _decimal(self.high),
            "outcomes": list(self.outcomes),
            "pieces": self.pieces,
        }


def _decimal(number: Fraction) -> str:
    return Measured(number, Fraction(0)).decimals()[0]


def prove_absence(
    parameters: Parameters, low: object, high: object, watch: Callable[[float], None] | None = None
) -> ProvedAbsence:
    """Prove that no speed from ``low`` to ``high`` [rad/s] has a connection on which gamma grows all the way.

    ``watch`` is told after each piece which share of the interval is done. Raises InputError for ends
    that make no sense.
    """
    start, end = (_checked(number) for number in (low, high))
    if not start < end:
        raise InputError("the first speed must be less than the second")
    reached, share = start, _FIRST_SHARE
    outcomes: dict[str, None] = {}
    pieces = 0
    while reached < end:
        following = min(end, reached + share * (end - start))
        try:
            outcome = _outcome(parameters, reached, following)
        except NoConnectionError as fault:
            return ProvedAbsence(parameters, start, end, reached, (*outcomes,), pieces, str(fault))
        if outcome is not None:
            reached, share, pieces = following, share * _WIDENED, pieces + 1
            outcomes[outcome] = None
            if watch is not None:
                watch(float((reached - start) / (end - start)))
        elif share > _SMALLEST_SHARE:
            share /= 2
        else:
            where = f"the branch could not be shown to miss the second saddle next to {float(reached):.12g} rad/s"
            return ProvedAbsence(parameters, start, end, reached, (*outcomes,), pieces, where)
    return ProvedAbsence(parameters, start, end, reached, (*outcomes,), pieces)


def _checked(number: object) -> Fraction:
    given = exact(number)
    if given.pi_multiple or not Fraction(1, 10**6) < given.rational < 10**6:
        raise InputError(f"a speed must be a decimal between 1e-6 and 1e6 rad/s, not {str(number)[:40]}")
    return given.rational


def _outcome(parameters: Parameters, low: Fraction, high: Fraction) -> str | None:
    """How the branch misses the second saddle at every speed from ``low`` to ``high``; None if that is not proved."""
    with working_precision(_BITS):
        speeds = hull(low, high)
        frame = Frame(parameters, (low + high) / 2)
        curve = Curve(frame, speeds, UNSTABLE, _ORDER)
        start = curve.unstable_point(curve.share_of_reach())
        if start is None:
            return None
        beta, gamma, v = frame.offset(start[0])
        path = model_of(parameters, speeds).path((beta, gamma - arb.pi(), v))
        while path.time < _LONGEST:
            step = path.step()
            # Where sin(beta) = 0 the disk lies flat and the model ends.
            if step is None or not inside(step.enclosure[0], arb(0, _UPRIGHT)):
                return None
            path.take(step)
            beta, gamma, _ = path.box
            if negative(beta):
                return "turns back"
            if positive(gamma - arb.pi()):
                return "goes past 3 pi/2"
    return None
