"""Limit cycles next to Omega_h by passages, in milliseconds, with half-widths.

`passages` has the maps. The numbers of a cycle are computed with one choice of sections, series and flights in 64 bits,
and with others that round some four times as much. Where the digits do not come, or the maps do not exist,
`near_connection` follows the flow itself.
"""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache, partial
from typing import Any, NamedTuple, TypeVar

import numpy

from tippedisk_verify.connection.bisection import bisect_omega_h
from tippedisk_verify.connection.splitting import MOST_DIGITS, splitting_zero
from tippedisk_verify.cycles.error_budget import cycle_of
from tippedisk_verify.cycles.limit_cycle import Cycle
from tippedisk_verify.cycles.passages import (
    Choice,
    GlobalMap,
    HalfMap,
    half_period_matrix,
    integral_of_divergence,
    to_section,
)
from tippedisk_verify.cycles.section import LIBRATING, Section
from tippedisk_verify.errors import AccuracyError, NoConnectionError, NoSuchCycleError
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.decimals import decimal_magnitude
from tippedisk_verify.model.exact import fraction
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE, EXTENDED, bits, companion
from tippedisk_verify.model.surroundings import undisturbed
from tippedisk_verify.theory.equilibria import saddle_value_sign

__all__ = ["FIRST_DIGITS", "PeriodLaw", "cycle_by_passages", "period_law"]

C = TypeVar("C", bound=Cycle)

_CHOICE = Choice(order=20, bands=5, share=0.10, reach=0.25, speeds=9, sigma=0.016, beside=1e-5)
#: What these leave out is more. Their flights lie closer together, so that rounding weighs some four times as much in
#: the derivatives of u by the speed and by sigma, which matter most.
_OTHERS = tuple(
    Choice(order=17, bands=4, share=share, reach=reach, speeds=7, sigma=0.004, beside=beside, rounding=k)
    for k, (share, reach, beside) in enumerate(
        ((0.09, 0.06, 3e-5), (0.08, 0.07, 5e-5), (0.075, 0.065, 4e-5), (0.07, 0.075, 6e-5)), start=1
    )
)
#: An error beyond so many times the largest distance to the others has a probability of some 1e-6 for normal errors, of
#: which theirs are four times as large.
_DISTANCES = 8
_ULPS = 2.0**-60  # relative; the maps' constants and logarithms are rounded alike in all choices
_LARGEST_POWER = 20  # of the distance from Omega_h, in any number of a cycle
_IMAGINARY = 2.0**-100  # of the distance; its square is far below rounding
_CUT = 2**72  # 1 / [rad/s]; where the maps are made does not depend on the digits of Omega_h beyond
_KEPT = 64  # disks
_MOST_DIGITS = 15  # that 64 bits give with some certainty
_PI_BITS = 96  # beyond those of the half-width
#: Digits of Omega_h: so many, or a multiple more.
FIRST_DIGITS, _MORE_DIGITS = 27, 10
_GUARD_DIGITS = 4
_DISTANCE_DIGITS = 18  # of the distance from Omega_h; then no number shows what is not known of it


@undisturbed
def cycle_by_passages(
    section: Section[C],
    parameters: Parameters,
    place: Fraction,
    engine: Engine,
    digits: int,
    *,
    from_omega_h: bool = False,
) -> C | None:
    """The cycle of the section's kind next to Omega_h, to ``digits`` significant digits.

    Args:
        section: librating cycles lie above Omega_h, stable rotating ones below.
        parameters: the disk and its friction law.
        place: the exact speed [rad/s].
        engine: the engine of the flights.
        digits: of the period, the coordinates and beta_max.
        from_omega_h: the place is a distance from Omega_h, and the speed as uncertain as that.

    Returns:
        The cycle; None where another method may know more. That is where the digits do not come, the machine has no
        numbers of 64 bits, the saddle value is not negative, or a series or an iteration fails.
    """
    if digits > _MOST_DIGITS or not engine.measures_error:
        return None
    try:
        zero = _omega_h(parameters, place, engine, from_omega_h)
        off = place if from_omega_h else place - zero.value
        if (off > 0) != (section is LIBRATING) or not _offered(parameters, engine, zero.value):
            return None
        origin = Fraction(round(zero.value * _CUT), _CUT)
        first, *others = (_numbers(section, flights, off) for flights in _maps(parameters, origin, engine))
    except (AccuracyError, NoConnectionError, ArithmeticError, StopIteration):
        return None
    numbers, sizes = first
    if not all(numpy.isfinite(number) for row, _ in (first, *others) for number in row.values()):
        return None
    measured = _measured(numbers, [row for row, _ in others], zero.uncertainty / abs(off))
    if section is LIBRATING:
        gap = measured["gamma_bar_0"]
        pi = fraction(bits(_PI_BITS + gap.uncertainty.denominator.bit_length()).pi)
        measured["gamma_bar_0"] = Measured(pi + gap.value, gap.uncertainty)
    cycle = cycle_of(
        section,
        zero.value + off,
        measured,
        residuals=tuple(sizes),
        parameters=parameters,
        engine=engine.name,
        precision=EXTENDED.name,
        _start_matrix=partial(monodromy_by_passages, parameters, origin, off) if section is LIBRATING else None,
    )
    main = [measured[name] for name in ("period", *section.names, "beta_max")]
    if any(number.uncertainty > abs(number.value) / 10**digits for number in main) or not cycle.stable:
        return None
    return replace(cycle, omega=Measured(cycle.omega.value, zero.uncertainty)) if from_omega_h else cycle


def _omega_h(parameters: Parameters, place: Fraction, engine: Engine, from_omega_h: bool) -> Measured:
    """Omega_h [rad/s] to what the distance needs."""
    guess = bisect_omega_h(parameters, engine, confirm=False).omega_h.value
    wanted = _digits_for(place) if from_omega_h else FIRST_DIGITS
    while True:
        zero = splitting_zero(parameters, guess, engine, wanted).omega_h
        off = place if from_omega_h else place - zero.value
        if zero.uncertainty * 10**_DISTANCE_DIGITS < abs(off):
            return zero
        # A speed may be Omega_h itself to many digits.
        wanted = max(wanted + _MORE_DIGITS, _digits_for(off)) if abs(off) > zero.uncertainty else 2 * wanted
        if wanted > MOST_DIGITS:
            raise AccuracyError("the distance from Omega_h needs more digits than Omega_h is offered to")


def _digits_for(distance: Fraction) -> int:
    """Digits of Omega_h for a distance from it [rad/s], on a grid that most distances share.

    Guard digits make Omega_h better than asked for, mostly by those that are missing here.
    """
    lacking = _DISTANCE_DIGITS - _GUARD_DIGITS - decimal_magnitude(distance) - FIRST_DIGITS
    return FIRST_DIGITS + _MORE_DIGITS * max(0, math.ceil(lacking / _MORE_DIGITS))


def _measured(numbers: dict[str, Any], others: list[dict[str, Any]], share: Fraction) -> dict[str, Measured]:
    """The numbers with half-widths; ``share`` is what is not known of the distance from Omega_h, relative."""
    measured = {}
    for name, number in numbers.items():
        apart = max(abs(number - row[name]) for row in others)
        width = fraction(_DISTANCES * apart + _ULPS * abs(number))
        # A logarithm of the distance changes by more than itself where it is small.
        size = max(abs(number), 1) if name.startswith(("period", "log")) else abs(number)
        measured[name] = Measured(fraction(number), width + _LARGEST_POWER * fraction(size) * share)
    return measured


class PeriodLaw(NamedTuple):
    """T = slope log(D) + constant + coefficient D^exponent + ..., of librating cycles a distance D above Omega_h."""

    slope: Measured  #: -2 / lambda_u [s]
    constant: Measured  #: [s], with D in rad/s
    coefficient: Measured  #: [s], with D in rad/s
    exponent: Measured  #: -lambda_s / lambda_u - 1; the powers that are left out begin with its double

    def at(self, distance: Fraction) -> tuple[Measured, Measured, Measured]:
        """T [s] by one, two and three terms."""
        size = Measured(distance, Fraction(0))
        one = self.slope * size.log()
        return one, one + self.constant, one + self.constant + self.coefficient * size**self.exponent


@undisturbed
def period_law(parameters: Parameters, engine: Engine) -> PeriodLaw:
    """The law from the maps: sigma = -s (u / u_1)^nu, with u and s where the unstable manifold arrives.

    With u = a D + b sigma the third term is the first power of sigma in -log(u). Raises NoSuchCycleError where passages
    are not offered, NoConnectionError where there is no connection, AccuracyError where the flights fail.
    """
    guess = bisect_omega_h(parameters, engine, confirm=False).omega_h.value
    zero = splitting_zero(parameters, guess, engine, FIRST_DIGITS).omega_h.value
    if not _offered(parameters, engine, zero):
        raise NoSuchCycleError("the law of the period with its corrections needs a negative saddle value and 64 bits")
    rows = []
    for flights in _maps(parameters, Fraction(round(zero * _CUT), _CUT), engine):
        unstable, slow, _ = flights.arriving.at(EXTENDED.number(0)).eigenvalues
        (by_omega, by_sigma), s = flights.slopes
        nu, scale = -slow / unstable, flights.u_1 / -by_omega
        constant = 2 * (EXTENDED.number(flights.duration) + numpy.log(scale) / unstable)
        coefficient = 2 * by_sigma * s / (unstable * by_omega * scale**nu)
        rows.append({"slope": -2 / unstable, "constant": constant, "coefficient": coefficient, "exponent": nu - 1})
    return PeriodLaw(**_measured(rows[0], rows[1:], Fraction(0)))


def _offered(parameters: Parameters, engine: Engine, omega_h: Fraction) -> bool:
    """Return True if the machine and the engine fly in 64 bits, and cycles attract next to Omega_h."""
    extended = companion(DOUBLE) == EXTENDED and engine.measures_error
    return extended and saddle_value_sign(parameters, omega_h) < 0


@lru_cache(maxsize=_KEPT)
def _maps(parameters: Parameters, omega_h: Fraction, engine: Engine) -> tuple[GlobalMap, ...]:
    return tuple(GlobalMap(parameters, omega_h, engine, choice) for choice in (_CHOICE, *_OTHERS))


@undisturbed
def monodromy_by_passages(parameters: Parameters, origin: Fraction, distance: Fraction) -> tuple[Any, Any]:
    """The monodromy matrix (3, 3) of a librating cycle at its section, and its half-widths.

    ``origin`` is where the maps are made, and the distance that from Omega_h [rad/s].
    """
    first, *others = (_period_matrix(flights, distance) for flights in _maps(parameters, origin, default_engine()))
    apart = numpy.max([abs(first - other) for other in others], axis=0)
    share = _ULPS + _LARGEST_POWER / 10**_DISTANCE_DIGITS
    return first, (_DISTANCES * apart + share * abs(first)).astype(float)


def _period_matrix(flights: GlobalMap, distance: Fraction) -> Any:
    at = EXTENDED.number(distance)
    half = HalfMap(flights, at, LIBRATING.image)
    sigma, multiplier, _ = half.fixed_point()
    imaginary = abs(at) * _IMAGINARY
    time_by_sigma = half(sigma + 1j * imaginary).time.imag / imaginary
    _, rest = to_section(half(sigma).pieces, LIBRATING.fixed)
    matrix = half_period_matrix(rest, multiplier, time_by_sigma)
    return matrix @ matrix


def _numbers(section: Section[Any], flights: GlobalMap, distance: Fraction) -> tuple[dict[str, Any], list[float]]:
    """The numbers of a cycle, gamma_bar_0 less pi, and the sizes of the iteration's steps.

    The speed has an imaginary part far below rounding, and the imaginary parts are derivatives by it.
    """
    image = section.image
    at = EXTENDED.number(distance)
    sigma, multiplier, sizes = HalfMap(flights, at, image).fixed_point()
    imaginary = abs(at) * _IMAGINARY
    moved = HalfMap(flights, at + 1j * imaginary, image)
    sigma = sigma + (moved(sigma).sigma - sigma) / (1 - multiplier)
    passage = moved(sigma)
    arrival, pieces = passage.arrival, passage.pieces
    part, _ = to_section(pieces, section.fixed)
    beside = part.image * part.chart.at(part.end)
    point = (beside[1], beside[2]) if section is LIBRATING else (arrival[5], arrival[6])
    time = EXTENDED.number(flights.duration) + passage.time
    along = numpy.prod([moved.along_the_flow(piece) for piece in pieces])
    measures = {
        "beta_max": arrival[4].real,
        "beta_bar_0": beside[0].real,
        "v_0": beside[2].real,
        "divergence": (arrival[3] + integral_of_divergence(pieces)).real,
    }
    return section.table(
        [coordinate.real for coordinate in point],
        time.real,
        ((multiplier, 0), (0, 0)),
        [number.imag / imaginary for number in (*point, time)],
        along.real,
        measures,
        numpy,
    ), sizes
