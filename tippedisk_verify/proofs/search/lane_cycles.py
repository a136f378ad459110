"""Many limit cycles proved at once, one by one in kind: flights side by side, then `cycle`'s test and numbers of each.

Half maps over a box and over a wide box come from `lane_flight`, and so does that of the box's middle: for more than 10
digits Arb follows the middle (linear law). What they enclose goes through `krawczyk.fixed_points` and
`cycle.Attempt.concluded` as if it came from Arb, so the statements are the same. A cycle of which this does not show
enough is proved on balls of more bits.

Where a ball becomes a point or a float: middles and radii of boxes are doubles, and any that pass the test are right.
Arb rounds a radius up, so Krawczyk's test is made on boxes a little narrower than those flown.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.decimals import decimal_magnitude
from tippedisk_verify.model.parameters import Constants, Parameters
from tippedisk_verify.proofs.kernel.balls import arb, ball, ball_constants, negative, positive, working_precision
from tippedisk_verify.proofs.kernel.batch import some_model
from tippedisk_verify.proofs.kernel.claims.cycle import apart, main
from tippedisk_verify.proofs.kernel.flow import Model
from tippedisk_verify.proofs.kernel.krawczyk import FixedPoints, fixed_points
from tippedisk_verify.proofs.kernel.lane_middle import SharpModel
from tippedisk_verify.proofs.kernel.lanes import Lanes, quiet
from tippedisk_verify.proofs.kernel.section import HALF, Return, Status, returned
from tippedisk_verify.proofs.kernel.sliding import law_model
from tippedisk_verify.proofs.numbers import measured
from tippedisk_verify.proofs.search.cycle import Attempt, OrbitProof, prove_cycle
from tippedisk_verify.proofs.search.lane_flight import HalfFlights, half_flights, lane_of
from tippedisk_verify.proofs.search.steps import Steps, midpoint_inverse

__all__ = ["prove_cycles"]

Array = NDArray[np.float64]

_BITS = 96  # of the balls that the lanes' results pass into: these round nothing that matters
_DOUBLES = 53
_FEW_BITS = 64  # of the balls on which a cycle is tried that doubles do not prove
_DOUBLES_DIGITS = 10  # that doubles give without Arb
#: radii of the boxes, relative to the state, without and with middles that Arb follows
_NARROW = 2.0**-32, 2.0**-36
_WIDE = 2.0**-16
_NEAR = 2.0**-26  # the guess's distance from the cycle, relative to the state, that needs no sharpening
_MOST_SHARPENINGS = 4
_FEW = {"linear": 2, "smooth": 6}  #: cycles that balls of few bits prove sooner than lanes do


def prove_cycles(
    parameters: Parameters, omegas: Sequence[Fraction], guesses: Sequence[Sequence[object]], *, digits: int = 10
) -> list[OrbitProof]:
    """`cycle.prove_cycle` for many speeds [rad/s], each from its guess (gamma_bar, v).

    The main numbers come to ``digits`` significant digits and stability is decided; the others come as they do. Where
    flights side by side do not suffice for that, balls of few bits may; if not, the proof is `prove_cycle`'s to
    ``digits``. Raises InputError for speeds that are not positive, or not as many as guesses.
    """
    if len(omegas) != len(guesses) or not all(omega > 0 for omega in omegas):
        raise InputError("each cycle has a positive speed and a guess of two components")
    if not omegas:
        return []
    middle = np.array([[float(part) for part in guess] for guess in guesses]).T  # type: ignore[arg-type]
    attempts = [Attempt(parameters, Fraction(omega), digits, _DOUBLES) for omega in omegas]

    def singly(lane: int) -> OrbitProof:
        alone = _alone(attempts[lane], middle[:, lane])
        return alone or prove_cycle(parameters, omegas[lane], guesses[lane], digits=digits)

    if len(omegas) <= _FEW[parameters.friction]:
        return [singly(lane) for lane in range(len(omegas))]
    sharp = digits > _DOUBLES_DIGITS and parameters.friction == "linear"
    models, narrow = _Models(parameters, omegas, sharp), _NARROW[sharp]
    proofs = _attempted(attempts, models, middle, _power_of_two(narrow * np.abs(middle)))
    left = np.array([lane for lane, proof in enumerate(proofs) if proof is None], int)
    if len(left):
        models = models.some(left)
        boxes = _sharpened(models.plain, middle[:, left], narrow)
        for lane, proof in zip(left, _attempted([attempts[lane] for lane in left], models, *boxes), strict=True):
            proofs[lane] = proof or singly(int(lane))
    return proofs  # type: ignore[return-value]


def _alone(attempt: Attempt, guess: Array) -> OrbitProof | None:
    """One cycle's proof from flights on balls of few bits."""
    middle = [float(part) for part in guess]
    attempt.bits = _FEW_BITS
    with working_precision(_FEW_BITS):
        model = attempt.model()
        centre = returned(model, HALF, [*map(arb, middle)], Steps())
        boxes = []
        for size in (_NARROW[0], _WIDE):
            radii = [float(part) for part in _power_of_two(size * np.abs(guess))]
            box = returned(model, HALF, [*map(arb, middle, radii)], Steps(), derivatives=True)
            boxes.append((radii, box))
    return _concluded(attempt, middle, centre, boxes)


class _Models:
    """The disk at each speed: in lanes and, if that is to be ``sharp``, with middles that Arb follows (linear law)."""

    def __init__(self, parameters: Parameters, omegas: Sequence[Fraction], sharp: bool) -> None:
        with working_precision(_BITS):
            constants = ball_constants(parameters)
            self.sharp = SharpModel(constants, [*map(ball, omegas)]) if sharp else None
            lanes = Constants(*(Lanes.of([value]) for value in constants))
        self.plain = self.sharp.lanes if self.sharp else law_model(parameters.friction, lanes, Lanes.of(omegas))

    def some(self, which: NDArray[Any]) -> _Models:
        """Those of some lanes."""
        models = copy(self)
        models.sharp = self.sharp and self.sharp.some(which)
        models.plain = models.sharp.lanes if models.sharp else some_model(self.plain, which)
        return models

    def flown(self, middle: Array, radii: Array) -> tuple[HalfFlights, HalfFlights]:
        """The half maps of the middles and over boxes about them."""
        boxes = [Lanes(part, size) for part, size in zip(middle, radii, strict=True)]
        if self.sharp:
            with working_precision(_BITS):
                flights = half_flights(self.sharp, *boxes)
            assert flights.middle is not None
            return flights.middle, flights
        return half_flights(self.plain, *(part.mid() for part in boxes)), half_flights(self.plain, *boxes)


def _attempted(attempts: Sequence[Attempt], models: _Models, middle: Array, radii: Array) -> list[OrbitProof | None]:
    """The proofs that flights from the middles, boxes and wide boxes give; these move side by side."""
    wide = _power_of_two(_WIDE * np.abs(middle))
    centre, box = models.flown(middle, radii)
    remote = half_flights(models.plain, *(Lanes(part, size) for part, size in zip(middle, wide, strict=True)))
    return [
        _concluded(
            attempt,
            [float(part) for part in middle[:, lane]],
            lane_of(centre, lane),
            [
                ([float(part) for part in sizes[:, lane]], lane_of(flights, lane))
                for sizes, flights in ((radii, box), (wide, remote))
            ],
        )
        for lane, attempt in enumerate(attempts)
    ]


def _sharpened(model: Model, middle: Array, narrow: float) -> tuple[Array, Array]:
    """Points near the fixed points by Newton's iteration, and radii for boxes about them."""
    for sharpening in range(_MOST_SHARPENINGS):
        centre = half_flights(model, *(Lanes(part) for part in middle))
        with quiet():
            step, noise = _newton(centre, middle)
            far = (np.abs(step) > _NEAR * np.abs(middle)).any(axis=0)
            if not far.any() or sharpening == _MOST_SHARPENINGS - 1:
                break
            middle = np.where(far, middle - step, middle)
    with quiet():
        size = np.abs(middle)
        radii = np.fmax(narrow * size, np.fmin(8 * (np.abs(step) + noise), size / 8))
        return middle, _power_of_two(radii)


def _newton(centre: HalfFlights, middle: Array) -> tuple[Array, Array]:
    """Newton's step for P(x) = x in doubles, and how far the image's radius moves it."""
    (a, b), (c, d) = ((entry.midpoints for entry in row) for row in centre.matrix)
    a, d = a - 1, d - 1
    inverse = np.array([[d, -b], [-c, a]]) / (a * d - b * c)
    away = np.array([part.midpoints for part in centre.image]) - middle
    spread = np.array([part.radii for part in centre.image])
    return np.einsum("ijn,jn->in", inverse, away), np.einsum("ijn,jn->in", np.abs(inverse), spread)


def _power_of_two(sizes: Array) -> Array:
    """The next above each size, and 1 where there is no size."""
    _, exponents = np.frexp(np.where((sizes > 0) & np.isfinite(sizes), sizes, 1.0))
    powers: Array = np.ldexp(1.0, exponents)  # exact, which exp2 need not be
    return powers


def _concluded(
    attempt: Attempt, middle: list[float], centre: Any, boxes: Sequence[tuple[list[float], Any]]
) -> OrbitProof | None:
    """The proof from the flights at the middle and over the boxes; None if it does not say enough."""
    with working_precision(_BITS):
        radii = [[_narrower(part) for part in sizes] for sizes, _ in boxes]
        tests = [_tested(middle, radii[k], centre, box) for k, (_, box) in enumerate(boxes)]
        if tests[0] is None or not tests[0].included:
            return None
        widest = radii[-1] if tests[-1] is not None and tests[-1].included else radii[0]
        proof = replace(attempt.concluded(tests[0]), unique_within=apart(tests[0], widest))
        enough = all(_to_digits(proof.values[name], attempt.digits) for name in main(HALF))
        return proof if enough and proof.stable is not None else None


def _to_digits(x: Any, digits: int) -> bool:
    """Whether the ball's radius is at most half a unit in that significant digit."""
    if not x.is_finite() or not (positive(x) or negative(x)):
        return False
    number = measured(x)
    unit = Fraction(10) ** (decimal_magnitude(number.value) + 1 - digits)
    return number.uncertainty <= unit * 9 / 20  # in print it is up to a ninth larger


def _narrower(radius: float) -> Any:
    """A ball about zero that reaches less far: Arb rounds a radius up, to 30 bits."""
    return arb(0, arb(radius) * (1 - arb(2) ** -28))


def _tested(middle: list[float], radii: Sequence[Any], centre: Return, box: Return) -> FixedPoints | None:
    """Krawczyk's test on flights that are known, all of them at the exact speed."""
    if not (centre.status is box.status is Status.RETURNED):
        return None
    (a, b), (c, d) = box.matrix
    inverse = midpoint_inverse(((a - 1, b), (c, d - 1)))
    return fixed_points([*map(arb, middle), arb(0)], [*radii, arb(0)], (0, 1), inverse, centre, box)
