"""The checks of a user's friction law, made when a disk is created with it."""

from __future__ import annotations

import math
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.friction import FORCE_CONSTANTS, FrictionLaw, constants_used
from tippedisk_verify.numbers.exact import rational_in_context
from tippedisk_verify.numbers.precision import (
    DOUBLE,
    EXTENDED,
    heyoka_types,
    precision_of_bits,
    wider_precision,
)

__all__ = ["refuse_unusable"]

_CHECK_BITS = 256
_VELOCITIES = (Fraction(1, 10), Fraction(1), Fraction(7))  # in epsilon
_SLOPE_TOLERANCE = 2.0**-128  # relative; half of the check's bits are left to the force's rounding
# Relative, between the force in quadruple precision and in the check's: a constant that is rounded
# to double differs by some 2^-54, and the rounding of some operations in quadruple by 2^-110.
_WIDE_SLACK = 2.0**-80
# The sliding velocities of the scan for narrow features, in units of mu g / k, where the law bends.
_SCAN_RANGE = (1e-3, 300.0)
# The scan fits a Chebyshev polynomial of this degree to the force on intervals of ln(gamma_y) of
# this length, and compares the two at this number of further places.
_DEGREE, _LENGTH, _PLACES = 24, 0.3, 3000
# The largest distance from the polynomial, relative to the largest force. A step like tanh whose
# width is w of the velocity has its poles at pi w / 2 in ln(gamma_y). Its distance is rho^-24 of
# its height, with rho = d + sqrt(1 + d^2) and d = pi w / 0.3. A step as high as the force has this
# distance at w = 1/6. A Gaussian bump has it at a width of 1/12, and one of a millionth of the
# height at 1/22. Taylor series in double show these from farther away than the third of the
# velocity that the guard allows a step: the steps from 18 widths, the bumps from 8.
_MAX_MISFIT = 1e-13


def refuse_unusable(law: FrictionLaw, parameters: Any) -> None:
    """Raise InputError unless a user's friction law is odd, brakes, can be compiled, and has no
    narrow feature.

    Args:
        law: The law.
        parameters: The disk that takes it.

    Raises:
        InputError: If the force cannot be computed or compiled, or a check fails.
    """
    problem = f"the friction law '{law}'"
    if law.probe_forces != law.force_at_probes():
        raise InputError(f"{problem} has changed since it was made: make a new FrictionLaw")
    try:
        constants_used(law.force)  # raises AttributeError for others
        slope = law.slope(parameters)
        if not isinstance(slope, Fraction) or slope <= 0:
            raise InputError(f"{problem} has a slope that is not a positive rational number")
        _refuse_values(law, parameters, problem)
        _refuse_uncompilable(law, problem)
        _refuse_narrow_features(law, parameters, problem)
    except InputError:
        raise
    except Exception as fault:
        raise InputError(f"{problem} cannot be computed: {fault}") from fault


def _refuse_values(law: FrictionLaw, parameters: Any, problem: str) -> None:
    """Raise InputError unless a friction law's force is odd, brakes, and has the slope that the law
    gives.

    Also refuse a force with a constant that is rounded to a double.
    """
    ctx, wide = precision_of_bits(_CHECK_BITS).context, wider_precision(EXTENDED)
    c, wide_c = parameters.constants_in_context(ctx), parameters.constants_in(wide)
    velocities = [share * parameters.epsilon for share in _VELOCITIES]
    forward = [law.deceleration(ctx, rational_in_context(ctx, x), c) for x in velocities]
    backward = [law.deceleration(ctx, -rational_in_context(ctx, x), c) for x in velocities]
    if not all(ctx.isfinite(rate) for rate in forward + backward):
        raise InputError(f"{problem} has a force that is not a finite number")
    if not all(rate > 0 for rate in forward):
        raise InputError(f"{problem} does not brake: lambda_Ty must be negative for gamma_y > 0")
    still = law.deceleration(ctx, ctx.zero, c, 1)
    if abs(still) > _SLOPE_TOLERANCE * forward[0] or not all(
        abs(plus + minus) <= _SLOPE_TOLERANCE * plus
        for plus, minus in zip(forward, backward, strict=True)
    ):
        raise InputError(f"{problem} is not odd in the sliding velocity")
    slope = law.deceleration_slope(ctx, ctx.zero, c, 1)
    if not abs(slope - c.k) <= _SLOPE_TOLERANCE * slope:
        raise InputError(
            f"{problem} has the slope {float(slope * c.m):.10g} N s/m at zero, which differs from "
            f"its `slope`, {float(c.k * c.m):.10g}, by {float(slope / c.k - 1):.1e}: give its slope, "
            f"or mend a rounded constant"
        )
    for x, rate in zip(velocities, forward, strict=True):
        other = wide.mpf(law.deceleration(wide.ops, wide.number(x), wide_c))
        if not abs(rate - other) <= _WIDE_SLACK * rate:
            raise InputError(
                f"{problem} has a constant that is rounded to a double: use c.pi, and apply "
                f"functions to expressions of gamma_y and c"
            )


def _refuse_narrow_features(law: FrictionLaw, parameters: Any, problem: str) -> None:
    """Raise InputError if a friction law's force varies much within a small part of the sliding
    velocity.

    A step of an integrator could pass such a feature.
    """
    import numpy
    from numpy.polynomial import chebyshev

    c, nodes = parameters.constants_in(DOUBLE), chebyshev.chebpts1(_DEGREE + 1)
    low, high = (math.log(share * c.traction / c.k) for share in _SCAN_RANGE)
    middles = numpy.arange(low, high, _LENGTH)[:, None]
    between = numpy.linspace(-1, 1, _PLACES)
    places = numpy.exp(middles + _LENGTH / 2 * between)
    rates = law.deceleration(numpy, places, c)
    wrong = ~(rates >= 0) | ~numpy.isfinite(rates)
    if wrong.any():
        raise InputError(
            f"{problem} does not brake, or is not finite, at gamma_y = {places[wrong][0]:.3g} m/s"
        )
    fitted = law.deceleration(numpy, numpy.exp(middles + _LENGTH / 2 * nodes), c)
    values_between = numpy.linalg.solve(
        chebyshev.chebvander(nodes, _DEGREE).T, chebyshev.chebvander(between, _DEGREE).T
    )
    away = abs(fitted @ values_between - rates)
    if (away > _MAX_MISFIT * rates.max()).any():
        where = places.flat[away.argmax()]
        raise InputError(
            f"{problem} varies within a small part of the sliding velocity near gamma_y = "
            f"{where:.3g} m/s: an integrator's step could pass such a narrow feature"
        )


def _refuse_uncompilable(law: FrictionLaw, problem: str) -> None:
    """Raise InputError unless a friction law's force can be written as an expression of heyoka's,
    to be compiled.
    """
    hy = heyoka_types()
    values = {name: hy.par[index] for index, name in enumerate(FORCE_CONSTANTS)}
    try:
        law.deceleration(hy, hy.make_vars("sliding"), SimpleNamespace(**values), 1)
    except Exception as fault:
        raise InputError(
            f"{problem} cannot be compiled ({str(fault).splitlines()[0]}): write one formula with "
            f"the functions of ops, without conditions; an absolute value needs two_sided=True"
        ) from fault
