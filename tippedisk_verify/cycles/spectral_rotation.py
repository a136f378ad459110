"""Rotating limit cycles and their slow multiplier by Fourier collocation in time; their fold is in `spectral`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy

from tippedisk_verify.cycles.fourier import Collocation, Kind, at_two_resolutions, chord, resampled, samples_for
from tippedisk_verify.cycles.spectral_branch import newton, unconverged
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import checked_digits

__all__ = ["SpectralRotation", "rotation_on_few_samples", "spectral_rotation"]

_FEWEST = 41  # samples
_REAL = 0.4  # in units of the frequency; the next copies of an exponent are one off
_LEANS = (0.04, 0.08, 0.02, 0.12, 0.2, 0.35, 0.6)  # rad; the first ones lead to the stable cycle, the last to the other


@dataclass(frozen=True)
class SpectralRotation:
    """A rotating limit cycle; each number's half-width is twice its distance from a finer collocation."""

    omega: Fraction  #: [rad/s]
    samples: int
    period: Measured  #: T [s]
    beta_bar_top: Measured  #: beta - pi/2 at gamma = pi/2 [rad]
    v_top: Measured  #: v there [rad/s]
    multiplier_slow: Measured  #: the larger non-trivial Floquet multiplier
    log_multipliers: Measured  #: the sum of both multipliers' logarithms, by Liouville's integral


def spectral_rotation(
    parameters: Parameters, omega: object, *, stable: bool = True, digits: int = 12
) -> SpectralRotation:
    """The rotating limit cycle of the linear law at ``omega`` [rad/s], to about ``digits`` digits of its period.

    Raises InputError for a speed that is not positive, NoSuchCycleError where collocation finds none.
    """
    parameters.refuse_smooth("spectral collocation is")
    speed = checked_speed(omega)
    checked_digits(digits)
    start = rotation_on_few_samples(parameters, float(speed), stable)

    def numbers(a: Collocation) -> dict[str, Any]:
        double = Collocation(parameters, a.kind, a.count)
        point = newton(double, resampled(a.kind, start, a.count))
        if point is None:
            raise unconverged(a.kind, a.count)
        exact, rows = a.number(speed), double.matrix(point[:-1], point[-1])[:, :-1]
        cycle = chord(a, rows, a.number(point[:-1]), lambda unknowns: a.residual(unknowns, exact))
        period = 2 * a.pi / cycle[-1]
        return {
            "period": period,
            "beta_bar_top": cycle[0],
            "v_top": a.motion(cycle, exact)[1][0],
            "multiplier_slow": a.ctx.exp(2 * a.pi * _exponent(a, double, cycle, exact)),
            "log_multipliers": period * a.slopes(cycle, exact)[2].sum() / a.count,
        }

    count = samples_for(Kind.ROTATING, start, digits)
    return SpectralRotation(speed, count, **at_two_resolutions(parameters, Kind.ROTATING, count, digits, numbers))


def rotation_on_few_samples(parameters: Parameters, omega: float, stable: bool) -> Any:
    """The point (beta_bar, frequency, Omega) in double of the stable cycle, or of the unstable one.

    Raises NoSuchCycleError where Newton's iteration leads from none of the rolling disk's rotations to it.
    """
    a = Collocation(parameters, Kind.ROTATING, _FEWEST)
    for lean in _LEANS if stable else _LEANS[::-1]:
        point = newton(a, _rolling(parameters, omega, lean))
        if point is not None and (_exponent_in_double(a, point[:-1], omega)[0] < 0) == stable:
            return point
    raise NoSuchCycleError(f"collocation finds no {'stable' if stable else 'unstable'} rotating cycle here")


def _rolling(parameters: Parameters, omega: float, lean: float) -> Any:
    """A rotation of the rolling disk, which conserves (r + e sin gamma) sin beta; beta_bar = lean at the bottom."""
    r, e = float(parameters.r), float(parameters.e)
    gamma = numpy.linspace(0.0, 2 * math.pi, 4001)  # gamma_bar, from the top
    beta = numpy.arccos((r - e) * math.cos(lean) / (r + e * numpy.cos(gamma)))
    pace = 1 / (omega * numpy.sin(beta))
    times = numpy.concatenate(([0.0], numpy.cumsum((pace[1:] + pace[:-1]) / 2 * numpy.diff(gamma))))
    samples = numpy.interp(numpy.arange(_FEWEST) / _FEWEST * times[-1], times, beta)
    return numpy.append(samples, (2 * math.pi / times[-1], omega))


# ---------------------------------------------------------------------------------------------- the multiplier
def _exponent_in_double(a: Collocation, cycle: Any, omega: float) -> tuple[float, Any]:
    """The slow Floquet exponent, in units of the frequency, and its mode (delta beta, delta gamma)."""
    by_beta, by_gamma, by_v = (numpy.diag(slope / cycle[-1]) for slope in a.slopes(cycle, omega))
    turning, zero = numpy.diag(omega * numpy.cos(cycle[:-1]) / cycle[-1]), numpy.zeros((a.count, a.count))
    rows = [  # of delta beta, delta gamma and delta v
        [-a.slope, zero, numpy.eye(a.count) / cycle[-1]],
        [turning, -a.slope, zero],
        [by_beta, by_gamma, by_v - a.slope],
    ]
    values, vectors = numpy.linalg.eig(numpy.block(rows))
    # One exponent of each is as good as real, the others differ from it by multiples of i; the one of the flow is 0.
    real = numpy.flatnonzero(abs(values.imag) < _REAL)
    chosen = real[abs(values[real].real).argsort()][1]
    mode = vectors[: 2 * a.count, chosen]
    return float(values[chosen].real), (mode / mode[abs(mode[: a.count]).argmax()]).real


def _exponent(a: Collocation, double: Collocation, cycle: Any, omega: Any) -> Any:
    """The slow Floquet exponent in the arithmetic of the cycle, in units of the frequency."""
    n = a.count
    rounded, speed = cycle.astype(float), float(omega)
    exponent, mode = _exponent_in_double(double, rounded, speed)
    largest, w = int(abs(mode[:n]).argmax()), rounded[-1]
    by_beta, by_gamma, by_v = double.slopes(rounded, speed)
    shifted_slope = double.slope + exponent * numpy.eye(n)
    rows = numpy.zeros((2 * n + 1, 2 * n + 1))
    rows[:n, :n] = -numpy.diag(speed / w * numpy.cos(rounded[:-1]))
    rows[:n, n:-1] = shifted_slope
    rows[n:-1, :n] = w * w * shifted_slope @ shifted_slope - numpy.diag(by_beta) - by_v[:, None] * w * shifted_slope
    rows[n:-1, n:-1] = -numpy.diag(by_gamma)
    rows[:n, -1] = mode[n:]
    rows[n:-1, -1] = 2 * w * w * (shifted_slope @ mode[:n]) - by_v * w * mode[:n]
    rows[-1, largest] = 1.0
    sharp_by_beta, sharp_by_gamma, sharp_by_v = a.slopes(cycle, omega)
    turning = omega / cycle[-1] * a.cos(cycle[:-1])

    def residual(unknowns: Any) -> Any:
        """What (delta beta, delta gamma) exp(exponent * angle) leaves of the variational equation."""
        beta, gamma, exponent = unknowns[:n], unknowns[n:-1], unknowns[-1]
        rate = cycle[-1] * (a.differentiated(beta) + exponent * beta)
        acceleration = cycle[-1] * (a.differentiated(rate) + exponent * rate)
        forced = sharp_by_beta * beta + sharp_by_gamma * gamma + sharp_by_v * rate
        turned = a.differentiated(gamma) + exponent * gamma - turning * beta
        return numpy.concatenate((turned, acceleration - forced, [beta[largest] - 1]))

    return chord(a, rows, a.number(numpy.append(mode, exponent)), residual)[-1]
