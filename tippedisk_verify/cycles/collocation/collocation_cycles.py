"""Limit cycles and their folds by Fourier collocation in time, to any number of digits.

No integrator is used. Each answer is computed at two resolutions. The equations are in `fourier`.
`collocation_branch` leads to a cycle in double, from which chord steps continue.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy

from tippedisk_verify.cycles.collocation.collocation_branch import (
    collocation_fold_near,
    first_fold,
    floquet_mode,
    fold_residual,
    fold_system,
    librating_point_at,
    not_converged_error,
    rotating_point_at,
    solve_on_plane,
)
from tippedisk_verify.cycles.collocation.fourier import (
    MAX_SAMPLES,
    Collocation,
    CycleKind,
    resample,
    samples_for,
)
from tippedisk_verify.display import Printable, quantity
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.exact import checked_integer, fraction
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.numpy_errors import ignore_numpy_errors
from tippedisk_verify.numbers.precision import checked_digits

__all__ = [
    "CollocationCycle",
    "collocation_cycle",
    "collocation_fold",
    "collocation_guess",
    "collocation_rotating_cycle",
]

_MAX_HARMONICS = MAX_SAMPLES // 2
# A relative half-width of the period above which there may be no cycle at all
_MAX_HALF_WIDTH = 0.02
_GUARD_DIGITS = 15  # guard digits
_FINER_DIGITS = 6  # extra digits of the finer collocation: more samples alone would add to rounding
_MAX_PASSES = 60
_SETTLED = 1e-9  # a step after which only rounding in double is left


# --------------------------------------------------------------------------------- librating cycles
@dataclass(frozen=True, repr=False)
class CollocationCycle(Printable):
    """A librating limit cycle by Fourier collocation, which balances its harmonics.

    Half-widths are from a collocation with more harmonics.
    """

    omega: Fraction  #: the spinning speed [rad/s]
    harmonics: int = field(metadata=quantity("number of odd harmonics", "1"))
    period: Measured = field(metadata=quantity("T, the period", "s"))
    gamma_bar_0: Measured = field(
        metadata=quantity("gamma - pi/2 where beta = pi/2 and v < 0", "rad")
    )
    v_0: Measured = field(metadata=quantity("v = beta' there", "rad/s"))
    beta_max: Measured = field(metadata=quantity("largest abs(beta - pi/2) on the cycle", "rad"))


@ignore_numpy_errors()
def collocation_cycle(
    parameters: Parameters, omega: object, *, digits: int = 12, harmonics: int | None = None
) -> CollocationCycle:
    """Return the librating limit cycle at a speed by harmonic balance, to ``digits`` significant
    digits of its period.

    If a speed has several cycles, it is the first one from the Hopf point on.

    Args:
        parameters: The disk, under an analytic friction law.
        omega: The speed [rad/s].
        digits: The significant digits of the period.
        harmonics: The number of odd harmonics, 1 to 1024. If None, it grows until the half-widths
            allow the digits.

    Raises:
        InputError: If the law has two sides, the speed is not positive, or the number of harmonics
            is out of range.
        NoSuchCycleError: If there is no cycle at this speed, or the balance does not converge.
    """
    parameters.refuse_two_sided_law("harmonic balance is")
    speed = checked_speed(omega)
    if harmonics is not None:
        complaint = f"the number of harmonics lies between 1 and {_MAX_HARMONICS}, not {{}}"
        checked_integer(harmonics, 1, _MAX_HARMONICS, complaint)
    digits = checked_digits(digits)
    start = librating_point_at(parameters, speed)

    def numbers(collocation: Collocation) -> dict[str, Any]:
        cycle = _solve_cycle(collocation, start, speed)
        gamma, v = collocation.motion(cycle)
        beta_max = _beta_max(collocation, cycle[:-2], digits)
        return {
            "period": 2 * collocation.pi / cycle[-2],
            "gamma_bar_0": gamma[0],
            "v_0": v[0],
            "beta_max": beta_max,
        }

    count = 2 * harmonics if harmonics else samples_for(CycleKind.LIBRATING, start, digits)
    while True:
        result = _at_two_resolutions(parameters, CycleKind.LIBRATING, count, digits, numbers)
        if result["period"].uncertainty > Fraction(_MAX_HALF_WIDTH) * result["period"].value:
            raise not_converged_error(count)
        worst = max(number.uncertainty / abs(number.value) for number in result.values())
        if harmonics is not None or worst * 10**digits <= 1:
            return CollocationCycle(speed, count // 2, **result)
        if count >= MAX_SAMPLES:
            raise NoSuchCycleError(
                f"the balance did not converge with {count // 2} harmonics: this close to Omega_h "
                f"use shooting"
            )
        # Digits grow in proportion to the harmonics, and a tenth more is for the half-widths.
        more = 1.1 * digits / max(digits / 2, -math.log10(worst))
        count = min(MAX_SAMPLES, CycleKind.LIBRATING.samples(more * count))


def _beta_max(collocation: Collocation, beta: Any, digits: int) -> Any:
    """Return the largest |beta_bar| between the samples of a librating cycle, by Newton's iteration
    on the derivative.

    Let f_j be n samples at the angles t_j = pi j / n. The trigonometric polynomial with odd
    harmonics through them is

        sum over j of (-1)^j f_j sin(n t) / (n sin(t - t_j)).
    """
    n, first = collocation.count, int(abs(beta).argmax())
    at, signs = collocation.pi * numpy.arange(n) / n, (-1) ** numpy.arange(n)
    slope = collocation.derivative_at_samples(beta)
    curve = collocation.derivative_at_samples(slope)
    angle = at[first] - slope[first] / curve[first]
    for _ in range(6 + digits.bit_length()):
        weights = signs / collocation.sin(angle - at)
        angle -= (weights * slope).sum() / (weights * curve).sum()
    return abs(
        (signs / collocation.sin(angle - at) * beta).sum() * collocation.ctx.sin(n * angle) / n
    )


def collocation_guess(parameters: Parameters, omega: Fraction) -> tuple[float, float]:
    """Return approximate coordinates (gamma_bar, v) of a librating limit cycle on the section beta
    = pi/2, v < 0.

    They come from harmonic balance and are good enough to start shooting. A two-sided friction law
    gets the cycle of the linear law, which differs little.

    Args:
        parameters: The disk.
        omega: The speed [rad/s].

    Raises:
        NoSuchCycleError: If there is no cycle at this speed, or the balance does not converge.
    """
    if parameters.law.two_sided:  # its cycles differ little from those of the linear law
        parameters = parameters.with_friction("linear")
    point = librating_point_at(parameters, omega)
    gamma, v = Collocation(parameters, CycleKind.LIBRATING, len(point) - 2).motion(point)
    return float(gamma[0]), float(v[0])


# ---------------------------------------------------------------------------------- rotating cycles
def collocation_rotating_cycle(
    parameters: Parameters, omega: object, *, stable: bool, digits: int
) -> dict[str, Measured]:
    """Return numbers of the rotating limit cycle of the linear law at a speed, to about ``digits``
    digits of its period.

    Args:
        parameters: The disk, under an analytic friction law.
        omega: The speed [rad/s].
        stable: True for the stable cycle, False for the unstable one.
        digits: The digits of the period.

    Returns:
        By their names in `RotatingCycle`: the period, the state at the top and the slow multiplier.
        ``log_multipliers`` is the sum of both multipliers' logarithms, by Liouville's integral.
        Each half-width is twice the distance from a finer collocation.

    Raises:
        InputError: If the law has two sides, or the speed is not positive.
        NoSuchCycleError: If collocation finds no such cycle.
    """
    parameters.refuse_two_sided_law("Fourier collocation is")
    speed = checked_speed(omega)
    digits = checked_digits(digits)
    start = rotating_point_at(parameters, float(speed), stable)

    def numbers(collocation: Collocation) -> dict[str, Any]:
        cycle = _solve_cycle(collocation, start, speed)
        period = 2 * collocation.pi / cycle[-2]
        return {
            "period": period,
            "beta_bar_top": cycle[0],
            "v_top": collocation.motion(cycle)[1][0],
            "multiplier_slow": collocation.ctx.exp(
                2 * collocation.pi * _exponent(collocation, cycle)
            ),
            "log_multipliers": period
            * collocation.acceleration_gradient(cycle)[2].sum()
            / collocation.count,
        }

    count = samples_for(CycleKind.ROTATING, start, digits)
    return _at_two_resolutions(parameters, CycleKind.ROTATING, count, digits, numbers)


def _exponent(collocation: Collocation, cycle: Any) -> Any:
    """Return the slow Floquet exponent of a limit cycle, in units of the frequency and in the
    arithmetic of the cycle.
    """
    exponent, mode, rows = floquet_mode(collocation.double, cycle.astype(float))
    pivot, identity = int(abs(mode).argmax()), numpy.eye(3 * collocation.count)
    system = numpy.block([[rows - exponent * identity, -mode[:, None]], [identity[pivot], 0.0]])
    by_beta, by_gamma, by_v = collocation.acceleration_gradient(cycle)
    turning = cycle[-1] * collocation.cos(cycle[:-2])

    def residual(unknowns: Any) -> Any:
        """Return the residual of the variational equation for a mode that grows like exp(exponent *
        angle).
        """
        mode, exponent = unknowns[:-1], unknowns[-1]
        beta, gamma, v = mode.reshape(3, -1)
        rates = (
            numpy.concatenate((v, turning * beta, by_beta * beta + by_gamma * gamma + by_v * v))
            / cycle[-2]
        )
        slopes = numpy.concatenate(
            [collocation.derivative_at_samples(samples) for samples in (beta, gamma, v)]
        )
        return numpy.append(rates - slopes - exponent * mode, mode[pivot] - 1)

    return _chord_iteration(collocation, system, numpy.append(mode, exponent), residual)[-1]


# -------------------------------------------------------------------------------------------- folds
def collocation_fold(
    parameters: Parameters, kind: CycleKind = CycleKind.ROTATING, *, digits: int = 12
) -> dict[str, Measured]:
    """Return numbers of the fold of the linear law's rotating limit cycles, or of the first one of
    the librating cycles.

    At a fold the variational equation has a second periodic solution. So the null vector of the
    collocation's derivative is an unknown too.

    Args:
        parameters: The disk, under an analytic friction law.
        kind: The kind of cycle.
        digits: The approximate digits of the fold's numbers.

    Returns:
        By their names in `RotatingFold` or `LibratingFold`: the speed, the period, the state on the
        section and the null vector. Each half-width is twice the distance from a finer collocation.

    Raises:
        InputError: If the law has two sides.
        NoSuchCycleError: If collocation finds no fold.
    """
    parameters.refuse_two_sided_law("Fourier collocation is")
    digits = checked_digits(digits)
    start = first_fold(parameters, kind)

    def numbers(collocation: Collocation) -> dict[str, Any]:
        n, double = collocation.count, collocation.double
        fold = collocation_fold_near(double, resample(kind, start, n))
        if fold is None:
            raise NoSuchCycleError("the collocation of the fold does not converge")
        pivot = int(abs(fold[n + 2 :]).argmax())
        fold = _chord_iteration(
            collocation,
            fold_system(double, fold, pivot),
            fold,
            lambda fold: fold_residual(collocation, fold, pivot),
        )
        cycle, null = fold[: n + 2], fold[n + 2 :]
        gamma, v = collocation.motion(cycle)
        turned, rate = collocation.motion_derivative(cycle, null)
        if kind is CycleKind.ROTATING:
            state, by_family = {"beta_bar_top": cycle[0], "v_top": v[0]}, null
        else:
            state, by_family = {"gamma_bar_0": gamma[0], "v_0": v[0]}, turned
        return {
            "omega": cycle[-1],
            "period": 2 * collocation.pi / cycle[-2],
            **state,
            "null_vector": rate[0] / by_family[0],
        }

    count = samples_for(kind, start, digits)
    return _at_two_resolutions(parameters, kind, count, digits, numbers)


# ------------------------------------------------------------------------------------- above double
def _at_two_resolutions(
    parameters: Parameters,
    kind: CycleKind,
    count: int,
    digits: int,
    numbers: Callable[[Collocation], dict[str, Any]],
) -> dict[str, Measured]:
    """Return the numbers of a cycle from collocation at ``count`` samples, with half-widths by
    comparison with a finer one.

    The half-width is twice the distance. The error falls geometrically with the samples. A
    librating cycle may have few samples, and an error that is small by chance. So its relative
    half-widths are at least the relative distance of the two periods.

    Args:
        parameters: The disk.
        kind: The kind of cycle.
        count: The number of samples.
        digits: The digits wanted.
        numbers: A function that computes the numbers from a collocation.
    """
    finer = kind.samples(count + max(0.3 * count, min(count, 12)))
    coarse = numbers(Collocation(parameters, kind, count, digits + _GUARD_DIGITS))
    accurate = numbers(Collocation(parameters, kind, finer, digits + _GUARD_DIGITS + _FINER_DIGITS))
    least = (
        abs(fraction(accurate["period"]) / fraction(coarse["period"]) - 1)
        if kind is CycleKind.LIBRATING
        else Fraction(0)
    )
    return {name: Measured.compared(value, accurate[name], least) for name, value in coarse.items()}


def _solve_cycle(collocation: Collocation, start: Any, speed: Fraction) -> Any:
    """Solve for the limit cycle at a speed by collocation, and return its point (n + 2,) in the
    collocation's arithmetic.

    ``start`` is a nearby point in double, with any number of samples. Raises NoSuchCycleError if
    the iteration does not converge.
    """
    double, exact = collocation.double, collocation.number(speed)
    point = solve_on_plane(double, resample(collocation.kind, start, collocation.count))
    if point is None:
        raise not_converged_error(collocation.count)
    unknowns = _chord_iteration(
        collocation,
        double.jacobian(point)[:, :-1],
        point[:-1],
        lambda x: collocation.residual(numpy.append(x, exact)),
    )
    return numpy.append(unknowns, exact)


def _chord_iteration(
    collocation: Collocation, system: Any, start: Any, residual: Callable[[Any], Any]
) -> Any:
    """Solve the equations ``residual`` = 0 in mpmath numbers, by chord steps with their derivative
    ``system`` in double.

    Each pass gains some ten digits. Raises NoSuchCycleError if the passes do not settle below the
    resolution of doubles.
    """
    from scipy.linalg import lu_factor, lu_solve

    factored, unknowns = lu_factor(system), collocation.number(start)
    smallest = math.inf
    for _ in range(_MAX_PASSES):
        right = residual(unknowns)
        scale = max(abs(right))
        if not scale:
            return unknowns
        # A residual of any size is scaled to one, solved for in double, and scaled back.
        step = scale * collocation.number(lu_solve(factored, (right / scale).astype(float)))
        unknowns = unknowns - step
        size = max(abs(step))
        if not size or (size >= smallest / 2 and size < _SETTLED):
            return unknowns
        smallest = min(smallest, size)
    raise not_converged_error(collocation.count)
