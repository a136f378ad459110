"""Omega_h by bisection on the side to which the unstable manifold of noninverted spinning goes.

Below Omega_h the branch that leaves (pi/2, -pi/2, 0) towards growing gamma passes the copy at gamma
= 3 pi/2. It then goes on from well to well. Above Omega_h the branch turns back before the copy. By
the point symmetry the other branch does the same.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache, partial

from tippedisk_verify.display import Printable
from tippedisk_verify.errors import AccuracyError, NoConnectionError
from tippedisk_verify.flow.contract import SECTION, Engine, Event, Request, Result, Status
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.exact import Exact
from tippedisk_verify.numbers.measured import HALF_WIDTH_FACTOR, Measured
from tippedisk_verify.numbers.numpy_errors import ignore_numpy_errors
from tippedisk_verify.numbers.precision import DOUBLE, Precision, wider_precision
from tippedisk_verify.theory.equilibria import (
    equilibrium,
    equilibrium_state,
    linearization,
    right_eigenvector,
)
from tippedisk_verify.theory.hopf import omega_crit
from tippedisk_verify.theory.saddle_manifolds import refuse_focus

__all__ = ["BisectedOmegaH", "bisect_omega_h", "follow_unstable_manifold"]

# The branch crosses the section again before it has reached the next saddle: it turns back.
_TURNS_BACK = Event("turns back", SECTION.function, direction=1)
# sin(gamma/2) + cos(gamma/2) vanishes at gamma = -pi/2 + 2 pi n, the noninverted states, and needs
# no pi.
_PASSAGE = Event(
    "passes", lambda ops, c, omega, beta, gamma, v: ops.sin(gamma / 2) + ops.cos(gamma / 2)
)

# The distance of the start from the saddle, along the eigenvector. The symmetry about the saddle
# leaves no quadratic terms, so the start misses the unstable manifold by the cube of the distance,
# most of it along directions that decay.
_START_DISTANCE = Fraction(1, 2**17)
# Relative tolerances of the repeated runs of the SciPy engine, looser than its own, which is 1e-13.
_TOLERANCES = (1.3e-13, 1.7e-13, 2.2e-13, 2.8e-13, 3.6e-13)
# The half-width in spreads of those runs, as in `error_budget`.
_SPREAD_FACTOR = 4
_CACHED_CONNECTIONS = 256  # connections in the cache
# The longest flight [s]. A passage within 1e-16 of the saddle takes less than 12 s.
_MAX_FLIGHT = 60.0


@dataclass(frozen=True, repr=False)
class BisectedOmegaH(Printable):
    """The result of a bisection for Omega_h, the speed of the heteroclinic connection, with its
    method.
    """

    omega_h: Measured  #: the speed at which the two noninverted saddles are connected [rad/s]
    method: str


def follow_unstable_manifold(
    parameters: Parameters,
    omega: Fraction,
    engine: Engine,
    *,
    precision: Precision = DOUBLE,
    offset: Fraction = _START_DISTANCE,
    tolerance: float | None = None,
) -> Result:
    """Follow the unstable manifold of (pi/2, -pi/2, 0) with growing gamma.

    The flight ends when the branch turns back or passes the next saddle.

    Args:
        parameters: The disk and its friction law.
        omega: The speed [rad/s].
        engine: The engine of the flight.
        precision: The arithmetic of the flight.
        offset: The distance of the start from the saddle, along the eigenvector.
        tolerance: The engine's relative tolerance; None for its own.

    Returns:
        The flight. Its status is EVENT, and its last event is named ``turns back`` or ``passes``.
        The status is FLAT if the disk lies flat before either.
    """
    matrix = linearization(parameters, omega, "noninverted")
    growth = equilibrium(parameters, omega, "noninverted", digits=20).eigenvalues[0].re.value
    direction = right_eigenvector(matrix, growth)
    size = max(map(abs, direction))
    start = [
        Exact(origin.rational + offset * component / size, origin.pi_multiple)
        for origin, component in zip(equilibrium_state("noninverted"), direction, strict=True)
    ]
    return engine(
        Request(
            parameters,
            omega,
            start,
            _MAX_FLIGHT,
            precision=precision,
            tolerance=tolerance,
            events=(_TURNS_BACK, _PASSAGE),
        )
    )


@ignore_numpy_errors()
@lru_cache(maxsize=_CACHED_CONNECTIONS)
def bisect_omega_h(
    parameters: Parameters, engine: Engine, *, confirm: bool = True
) -> BisectedOmegaH:
    """Return Omega_h, found by bisection on the side to which the unstable manifold goes.

    The result is accurate to the last digits of double, and it is cached.

    With the Taylor engine the bracket is confirmed. At both its ends the branch is followed again
    in a wider arithmetic, from a start eight times closer to the saddle. The half-width grows until
    both outcomes hold. Another engine has no wider arithmetic. There the spread over looser
    tolerances measures the error.

    Args:
        parameters: The disk and its friction law.
        engine: The engine of the flights.
        confirm: If False, return the bracket as double sees it, as a start for better methods.

    Returns:
        Omega_h [rad/s] and the method.

    Raises:
        NoConnectionError: If the branch does not change sides between Omega_crit / 2 and 3/2
            Omega_crit, or if the saddle is a saddle-focus where it does.
        AccuracyError: If a branch cannot be followed, or the wider arithmetic does not confirm the
            bracket.
    """
    passes = partial(_passes_next_saddle, parameters, engine)
    lower, upper = _bracket(passes, Fraction(float(omega_crit(parameters))))
    centre, half_width = (lower + upper) / 2, (upper - lower) * 2
    # The branch winds about a saddle-focus and passes it without being connected.
    refuse_focus(parameters, centre)
    if not confirm:
        return BisectedOmegaH(Measured(centre, half_width), "bisection in double")
    if not engine.measures_error:
        return BisectedOmegaH(
            Measured(centre, half_width + _spread_of_tolerances(passes, centre)),
            "bisection, tolerances",
        )
    wider = wider_precision(DOUBLE)
    confirmed = partial(passes, precision=wider, offset=_START_DISTANCE / 8)
    while not confirmed(centre - half_width) or confirmed(centre + half_width):
        half_width *= 2
        if half_width > centre / 1000:
            raise AccuracyError(
                "the bisection's bracket could not be confirmed in a wider arithmetic"
            )
    # Twice as wide: close to its ends another processor's wider run may see the other side.
    return BisectedOmegaH(
        Measured(centre, half_width * HALF_WIDTH_FACTOR),
        f"bisection, confirmed in {wider.name} precision",
    )


def _passes_next_saddle(
    parameters: Parameters,
    engine: Engine,
    omega: Fraction,
    precision: Precision = DOUBLE,
    offset: Fraction = _START_DISTANCE,
    tolerance: float | None = None,
) -> bool:
    """Return True if the unstable manifold of a saddle passes the next saddle, False if it turns
    back.

    Raises AccuracyError if the flight fails.
    """
    result = follow_unstable_manifold(
        parameters, omega, engine, precision=precision, offset=offset, tolerance=tolerance
    )
    if result.status not in (Status.EVENT, Status.FLAT):
        raise AccuracyError(
            f"the unstable manifold at Omega = {float(omega):.12g} rad/s: {result.status.value}"
        )
    return result.status is Status.FLAT or result.events[-1].name == _PASSAGE.name


def _spread_of_tolerances(passes: Callable[..., bool], centre: Fraction) -> Fraction:
    """Return a half-width of Omega_h [rad/s] that covers the SciPy engine's truncation error.

    At its tightest tolerance the engine is near round-off. Under the smooth law the field has
    kinks, so the error there does not follow the tolerance: every sequence of steps has a different
    error. Each run at one of `_TOLERANCES` is a draw of that error. All of these are looser than
    the engine's own tolerance. The half-width is the spread of the draws and the answer, times
    `_SPREAD_FACTOR`, as in `error_budget`. It includes sixteen ulps of the speed for the rounding
    that the passage amplifies.
    """
    values = [centre]
    for tolerance in _TOLERANCES:
        loosely = partial(passes, tolerance=tolerance)
        bracket = centre * Fraction(1, 10**9)
        lower, upper = centre - bracket, centre + bracket
        while not loosely(lower):
            upper, lower = lower, lower - 8 * (upper - lower)
        while loosely(upper):
            lower, upper = upper, upper + 8 * (upper - lower)
        values.append(_bisect_to_neighbours(loosely, lower, upper)[0])
    return _SPREAD_FACTOR * (max(values) - min(values)) + centre / 2**48


def _bracket(passes: Callable[..., bool], top: Fraction) -> tuple[Fraction, Fraction]:
    """Return two neighbouring doubles [rad/s] between which the unstable manifold changes sides.

    ``passes`` tells if the branch passes the next saddle at a speed; otherwise it turns back.
    ``top`` is Omega_crit. Raises NoConnectionError if the branch does not change sides between
    Omega_crit / 2 and 3/2 Omega_crit.
    """
    upper, lower = top, top * Fraction(63, 64)
    while passes(upper):
        upper, lower = upper + top / 64, upper
        if upper > top * 3 / 2:
            raise NoConnectionError(
                "the saddle's unstable manifold passes at every speed up to 3/2 Omega_crit: no "
                "connection"
            )
    while not passes(lower):
        upper, lower = lower, lower - top / 64
        if lower < top / 2:
            raise NoConnectionError(
                "the saddle's unstable manifold turns back at every speed down to Omega_crit / 2: no "
                "connection"
            )
    return _bisect_to_neighbours(passes, lower, upper)


def _bisect_to_neighbours(
    passes: Callable[..., bool], lower: Fraction, upper: Fraction
) -> tuple[Fraction, Fraction]:
    """Return two neighbouring doubles [rad/s] between which the branch changes sides, by bisection.

    Args:
        passes: Returns True for a speed at which the branch passes the next saddle.
        lower: A speed at which the branch passes.
        upper: A speed at which the branch turns back.
    """
    while (middle := Fraction(float((lower + upper) / 2))) not in (lower, upper):
        lower, upper = (middle, upper) if passes(middle) else (lower, middle)
    return lower, upper
