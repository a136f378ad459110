"""Further methods for right-hand sides, the Hopf point, the slow manifold and orbits."""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache, partial
from typing import Any

import numpy

from tippedisk_verify.flow.jit import heyoka_module
from tippedisk_verify.flow.scipy_engine import ScipyEngine
from tippedisk_verify.model.equations import equation_terms, vector_field
from tippedisk_verify.model.parameters import Constants
from tippedisk_verify.numbers.exact import fraction, rational_in_context
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.precision import precision_of_bits
from tippedisk_verify.reference_values.entries import Case, MeasuredValues
from tippedisk_verify.reference_values.truths import (
    BITS,
    DIGITS,
    ORDERS,
    WIDER_BITS,
    FixedToleranceEngine,
    evaluate_in_two_precisions,
    trajectory_numbers,
)
from tippedisk_verify.theory import hopf, one_harmonic_law, slow_manifold
from tippedisk_verify.theory.equilibria import linearization

__all__ = ["differences", "hopf_by_balance", "orbit_by_scipy", "symbolic"]


# --------------------------------------------------------------------------------- right-hand side
@lru_cache(maxsize=4)
def _compiled(law: Any, working: int) -> Any:
    """Compile the factored field and its symbolic derivatives for numbers of `working` bits."""
    hy = heyoka_module()
    state = hy.make_vars("beta", "gamma", "v")
    names = (
        ("omega", "r", "e", "a", "b", "g", "k")
        if law == "linear"
        else ("omega", "r", "e", "a", "b", "g", "traction", "epsilon", "side")
    )
    par = dict(zip(names, (hy.par[n] for n in range(len(names))), strict=True))
    constants = Constants(**{name: par.get(name) for name in Constants._fields})
    rate = vector_field(
        hy, constants, par["omega"], law, *((par["side"],) if law == "smooth" else ())
    )(*state)[2]
    outputs = [rate, *(hy.diff(rate, variable) for variable in state)]
    return hy.cfunc(outputs, list(state), fp_type=hy.real, prec=working, compact_mode=True), names


def symbolic(case: Case, values: MeasuredValues) -> MeasuredValues:
    """Compute the acceleration and its slopes by heyoka's symbolic derivatives."""
    return (
        {}
        if case.entry.friction == "both"
        else evaluate_in_two_precisions(partial(_symbolic, case), WIDER_BITS, WIDER_BITS)
    )


def _symbolic(case: Case, ctx: Any) -> dict[str, Any]:
    precision = precision_of_bits(ctx.prec)
    function, names = _compiled(case.disk.friction, ctx.prec)
    constants, number = case.disk.constants_in(precision), precision.number
    state = [case.inputs[name] for name in ("beta", "gamma", "v")]
    place = (rational_in_context(ctx, value) for value in (case.inputs["Omega"], *state))
    sliding = equation_terms(ctx, case.disk.constants_in_context(ctx), *place).sliding_velocity
    others = {"omega": number(case.inputs["Omega"]), "side": number(1 if sliding >= 0 else -1)}
    pars = [others[name] if name in others else getattr(constants, name) for name in names]
    # Compiled functions take heyoka's own arrays only.
    arrays = (
        numpy.array(numbers, dtype=precision.number_type)
        for numbers in (list(map(number, state)), pars)
    )
    outputs = function(next(arrays), pars=next(arrays))
    return dict(
        zip(("v_rate", "dv_rate_dbeta", "dv_rate_dgamma", "dv_rate_dv"), outputs, strict=True)
    )


# -------------------------------------------------------------------------------------- Hopf point
def hopf_by_balance(case: Case, values: MeasuredValues) -> MeasuredValues:
    """Compute the Hopf point without a normal form."""
    return evaluate_in_two_precisions(partial(_hopf_by_balance, case), correct_bits=BITS - 20)


def _hopf_by_balance(case: Case, ctx: Any) -> dict[str, Any]:
    """Compute the Hopf point without a normal form.

    The equations are Routh-Hurwitz, the derivative of the characteristic polynomial, and the slopes
    of the consistent one-harmonic law.
    """
    speed = ctx.sqrt(rational_in_context(ctx, hopf.omega_crit_squared(case.disk)))
    matrix = linearization(case.disk, fraction(speed))
    # lambda^3 - A33 lambda^2 - A31 lambda - Omega A32 with A31 = const - Omega^2 and A32
    # proportional to Omega.
    a33, a31, a32 = (
        rational_in_context(ctx, Fraction(value)) for value in (matrix.A33, matrix.A31, matrix.A32)
    )
    root = ctx.mpc(0, ctx.sqrt(-a31))
    drift = -(2 * speed * root - 2 * a32) / (3 * root**2 - 2 * a33 * root - a31)
    slopes = one_harmonic_law.hopf_slopes(case.disk, digits=DIGITS + 12)
    amplitude, period = (rational_in_context(ctx, slope.value) for slope in slopes)
    # beta_max^2 = 4 |z|^2 |q_1|^2 and |z|^2 = -Re(lambda) / Re(c_1), with q = (lambda, Omega,
    # lambda^2) / |...|.
    frequency = abs(root)
    share = frequency**2 / (frequency**2 + speed**2 + frequency**4)
    return {
        "omega_crit": speed,
        "period": 2 * ctx.pi / frequency,
        "transversality": ctx.re(drift),
        "first_lyapunov_coefficient": ctx.re(drift) * 4 * share / amplitude / frequency,
        "amplitude_squared_slope": amplitude,
        "period_slope": period,
    }


# ----------------------------------------------------------------------------------- slow manifold
def differences(case: Case, values: MeasuredValues) -> MeasuredValues:
    """Compute each order of the slow manifold from the lower ones and their difference quotients.

    The invariance condition at order n needs h_0 ... h_(n-1) and their slopes. The slopes are
    central differences with a step of 1e-32 in 120 digits, accurate to 60. g_1 is separated by
    evaluating M, h and f_G at three velocities.
    """
    ctx = precision_of_bits(400).context
    c = case.disk.constants_in_context(ctx)
    omega, beta, gamma = (
        rational_in_context(ctx, case.inputs[name]) for name in ("Omega", "beta", "gamma")
    )
    step = ctx.mpf(10) ** -32

    def at(b: Any, g: Any) -> list[Any]:
        return list(slow_manifold.series_orders(ctx, c, omega, b, g, ORDERS))

    def inertial(v: int) -> Any:
        """Return (h + f_G) / M at a velocity."""
        at_v = equation_terms(ctx, c, omega, beta, gamma, ctx.mpf(v))
        return (at_v.gyroscopic + at_v.gravity) / at_v.mass

    orders = at(beta, gamma)
    by_beta = [
        (x - y) / (2 * step)
        for x, y in zip(at(beta + step, gamma), at(beta - step, gamma), strict=True)
    ]
    by_gamma = [
        (x - y) / (2 * step)
        for x, y in zip(at(beta, gamma + step), at(beta, gamma - step), strict=True)
    ]
    still, ahead, back = (inertial(v) for v in (0, 1, -1))
    q1, q2 = (ahead - back) / 2, (ahead + back) / 2 - still
    drift = omega * ctx.cos(beta)
    # The friction term is -rate (v - h_0) / epsilon.
    rate = -slow_manifold.attraction_rate(ctx, c, beta, gamma) * c.epsilon
    numbers = {"h_0": slow_manifold.critical_manifold(ctx, c, omega, beta, gamma)}
    for n in range(1, ORDERS + 1):
        right = (still if n == 1 else 0) + q1 * orders[n - 1] + drift * by_gamma[n - 1]
        right += sum(
            q2 * orders[i] * orders[n - 1 - i] - by_beta[i] * orders[n - 1 - i] for i in range(n)
        )
        numbers[f"h_{n}"] = right / rate
    for n in range(ORDERS + 1):
        v, slope_b, slope_g = (
            sum(c.epsilon**i * x[i] for i in range(n + 1)) for x in (orders, by_beta, by_gamma)
        )
        moved = slope_b * v - slope_g * drift
        acceleration = vector_field(ctx, c, omega, "linear")(beta, gamma, v)[2]
        numbers[f"residual_{n}"] = c.epsilon * (moved - acceleration)
    return {
        name: Measured.of(value, abs(value) / ctx.mpf(10) ** 44) for name, value in numbers.items()
    }


# ------------------------------------------------------------------------------------------ orbits
def orbit_by_scipy(case: Case, values: MeasuredValues) -> MeasuredValues:
    """Integrate an orbit with SciPy.

    The change that a hundredfold looser tolerance makes bounds the error.
    """
    tight, loose = (
        trajectory_numbers(case, 12, engine=FixedToleranceEngine(ScipyEngine("DOP853"), tolerance))
        for tolerance in (1e-13, 1e-11)
    )
    return {
        name: Measured.of(value, 2 * abs(value - loose[name][0]) + 1e-11 * max(1.0, abs(value)))
        for name, (value, _) in tight.items()
        if name in loose
    }
