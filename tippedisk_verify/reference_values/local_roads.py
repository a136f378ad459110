"""Roads to what is local: the right-hand side, equilibria, the Hopf point, harmonic balance, the slow manifold."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from functools import lru_cache
from typing import Any

from tippedisk_verify.model.equations import field, friction_force, jacobian, shifted, terms
from tippedisk_verify.model.exact import fraction, quotient
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import SYMBOLS, Constants, Parameters
from tippedisk_verify.model.precision import bits, heyoka_module
from tippedisk_verify.reference_values.entries import Case, Method, Values, changed
from tippedisk_verify.theory import harmonic_balance, hopf, slow_manifold
from tippedisk_verify.theory.equilibria import equilibrium, linearization

__all__ = ["BALANCE", "EQUILIBRIUM", "HOPF", "MANIFOLD", "RHS", "by_differences"]

_BITS = 240  # 72 digits for 50 that are kept: near beta = pi/2 some cancel
_WIDER = 304
_DIGITS = 56
_STEP = Fraction(1, 10**12)  # relative, of the differences that give condition numbers

Plain = Callable[[Case], dict[str, Any]]


def by_differences(plain: Plain, step: Fraction = _STEP) -> Callable[[Case, Values], dict[str, dict[str, Any]]]:
    """Condition numbers, dq / (dp / p), by central differences of a function that is cheap to evaluate."""

    def condition(case: Case, values: Values) -> dict[str, dict[str, Any]]:
        slopes: dict[str, dict[str, Any]] = {}
        names = [("parameters", name) for name in SYMBOLS]
        names += [("inputs", name) for name, value in case.inputs.items() if isinstance(value, Fraction) and value]
        for where, name in names:
            ends = []
            for factor in (1 + step, 1 - step):
                if where == "parameters":
                    moved = Case(case.item, changed(case.parameters, name, factor), case.inputs)
                else:
                    inputs = {**case.inputs, name: case.inputs[name] * factor}
                    moved = Case(case.item, case.parameters, inputs)
                ends.append(plain(moved))
            for quantity, above in ends[0].items():
                if quantity in ends[1]:
                    slope = float((above - ends[1][quantity]) / (2 * float(step)))
                    slopes.setdefault(quantity, {})[name] = slope
        return slopes

    return condition


def _compared(rough: dict[str, Any], sharp: dict[str, Any], working: int) -> Values:
    return {
        name: Measured.compared(value, sharp[name], Fraction(1, 1 << (working - 1))) for name, value in rough.items()
    }


def _state(case: Case, ctx: Any) -> tuple[Any, ...]:
    return tuple(quotient(ctx, case.inputs[name]) for name in ("Omega", "beta", "gamma", "v"))


def _constants(parameters: Parameters, ctx: Any) -> Constants:
    return Constants(*(quotient(ctx, value) for value in parameters.rational()))


# ------------------------------------------------------------------------------------------ right-hand side
def _written_out(case: Case, ctx: Any, ops: Any = None, quarter: Any = 0) -> dict[str, Any]:
    """The paper's terms as they stand and the Jacobian by hand; with ``ops`` for angles less ``quarter``."""
    ops = ops or ctx
    c = _constants(case.parameters, ctx)
    omega, beta, gamma, v = _state(case, ctx)
    beta, gamma = beta - quarter, gamma - quarter
    here = terms(ops, c, omega, beta, gamma, v)
    if case.item.friction == "both":
        return {
            "M": here.mass,
            "h": here.gyroscopic,
            "f_G": here.gravity,
            "w_y": here.direction,
            "gamma_y": here.sliding_velocity,
            "gamma_rate": -omega * ops.cos(beta),
        }
    force = friction_force(c, here.sliding_velocity, case.friction)
    slopes = jacobian(ops, c, omega, case.friction)(beta, gamma, v)[2]
    return {
        "lambda_Ty": force,
        "v_rate": (here.gyroscopic + here.gravity + here.direction * force) / here.mass,
        "dv_rate_dbeta": slopes[0],
        "dv_rate_dgamma": slopes[1],
        "dv_rate_dv": slopes[2],
    }


def _rhs_first(case: Case, known: Values) -> Values:
    rough, sharp = (_written_out(case, bits(working).context) for working in (_BITS, _WIDER))
    return _compared(rough, sharp, _BITS)


def _rhs_shifted(case: Case, known: Values) -> Values:
    twice = []
    for working in (_WIDER, _WIDER + 64):
        ctx = bits(working).context
        twice.append(_written_out(case, ctx, shifted(ctx), ctx.pi / 2))
    return _compared(twice[0], twice[1], _WIDER)


@lru_cache(maxsize=4)
def _compiled(law: Any, working: int) -> Any:
    """The factored field and its symbolic derivatives as heyoka's own code on heyoka's numbers."""
    hy = heyoka_module()
    state = hy.make_vars("beta", "gamma", "v")
    names = ("omega", "r", "e", "a", "b", "g", "k") if law == "linear" else (
        "omega", "r", "e", "a", "b", "g", "traction", "epsilon", "side"
    )  # fmt: skip
    par = dict(zip(names, (hy.par[n] for n in range(len(names))), strict=True))
    constants = Constants(**{name: par.get(name) for name in Constants._fields})
    rate = field(hy, constants, par["omega"], law, *((par["side"],) if law == "smooth" else ()))(*state)[2]
    outputs = [rate, *(hy.diff(rate, variable) for variable in state)]
    return hy.cfunc(outputs, list(state), fp_type=hy.real, prec=working, compact_mode=True), names


def _rhs_symbolic(case: Case, known: Values) -> Values:
    if case.item.friction == "both":
        return {}
    twice = [_symbolic(case, working) for working in (_WIDER, _WIDER + 64)]
    return _compared(twice[0], twice[1], _WIDER)


def _symbolic(case: Case, working: int) -> dict[str, Any]:
    precision = bits(working)
    function, names = _compiled(case.friction, working)
    constants = case.parameters.at(precision)
    state = [precision.number(case.inputs[name]) for name in ("beta", "gamma", "v")]
    ctx = precision.context
    sliding = terms(ctx, _constants(case.parameters, ctx), *_state(case, ctx)).sliding_velocity
    given = {"omega": precision.number(case.inputs["Omega"]), "side": precision.number(1 if sliding >= 0 else -1)}
    values = [given[name] if name in given else getattr(constants, name) for name in names]
    import numpy

    # heyoka's own arrays, which is all that compiled functions take.
    inputs, pars = (numpy.array(numbers, dtype=precision.type) for numbers in (state, values))
    outputs = function(inputs, pars=pars)
    return dict(zip(("v_rate", "dv_rate_dbeta", "dv_rate_dgamma", "dv_rate_dv"), outputs, strict=True))


RHS = (
    Method("written-out", "the paper's terms as they stand, Jacobian by hand, mpmath at 72 digits", _rhs_first),
    Method("shifted", "the same in angles measured from pi/2, mpmath at 91 digits", _rhs_shifted),
    Method("symbolic", "the factored field and its symbolic derivatives, heyoka on MPFR numbers", _rhs_symbolic, True),
)
rhs_condition = by_differences(lambda case: _written_out(case, bits(_BITS).context))


# ------------------------------------------------------------------------------------------ equilibria
def _equilibrium_first(case: Case, known: Values) -> Values:
    state = equilibrium(case.parameters, case.inputs["Omega"], case.inputs["equilibrium"], _DIGITS)
    return {
        f"lambda_{n}_{part}": getattr(value, part)
        for n, value in enumerate(state.eigenvalues, start=1)
        for part in ("re", "im")
    }


def _equilibrium_numeric(case: Case, known: Values) -> Values:
    """Eigenvalues of the Jacobian of the full equations, by the QR algorithm."""
    rough, sharp = (_eigenvalues(case, working) for working in (_BITS, _WIDER))
    return _compared(rough, sharp, _BITS // 2)  # a pair that nearly coincides costs the algorithm half its digits


def _eigenvalues(case: Case, working: int) -> dict[str, Any]:
    ctx = bits(working).context
    gamma = ctx.pi / 2 if case.inputs["equilibrium"] == "inverted" else -ctx.pi / 2
    rows = jacobian(ctx, _constants(case.parameters, ctx), quotient(ctx, case.inputs["Omega"]), "linear")(
        ctx.pi / 2, gamma, ctx.mpf(0)
    )
    values = ctx.eig(ctx.matrix([list(row) for row in rows]), left=False, right=False)
    small = ctx.mpf(2) ** (-working // 2) * max(abs(value) for value in values)
    pairs = [(ctx.re(value), ctx.im(value) if abs(ctx.im(value)) > small else ctx.mpf(0)) for value in values]
    pairs.sort(key=lambda pair: (-ctx.nint(pair[0] / small), -pair[1]))
    return {
        f"lambda_{n}_{part}": number
        for n, pair in enumerate(pairs, start=1)
        for part, number in zip(("re", "im"), pair, strict=True)
    }


EQUILIBRIUM = (
    Method("polynomial", "roots of the exact characteristic polynomial, with root bounds", _equilibrium_first),
    Method("eigensolver", "eigenvalues of the full equations' Jacobian, QR at 72 digits", _equilibrium_numeric, True),
)
equilibrium_condition = by_differences(lambda case: _eigenvalues(case, _BITS))


# ------------------------------------------------------------------------------------------ Hopf point
def _hopf_first(case: Case, known: Values) -> Values:
    point = hopf.hopf_point(case.parameters, _DIGITS)
    return {
        name: getattr(point, name)
        for name in (
            *("omega_crit", "period", "first_lyapunov_coefficient", "transversality"),
            *("amplitude_squared_slope", "period_slope"),
        )
    }


def _hopf_balance(case: Case, known: Values) -> Values:
    """Without a normal form: Routh-Hurwitz, the polynomial's derivative, the consistent one-harmonic law's slopes."""
    rough, sharp = (_hopf_by_balance(case.parameters, working) for working in (_BITS, _WIDER))
    return _compared(rough, sharp, _BITS - 20)


def _hopf_by_balance(parameters: Parameters, working: int) -> dict[str, Any]:
    ctx = bits(working).context
    square = hopf.omega_crit_squared(parameters)
    speed = ctx.sqrt(quotient(ctx, square))
    matrix = linearization(parameters, fraction(speed))
    # lambda^3 - A33 lambda^2 - A31 lambda - Omega A32 with A31 = const - Omega^2 and A32 proportional to Omega.
    a33, a31, a32 = (quotient(ctx, Fraction(value)) for value in (matrix.A33, matrix.A31, matrix.A32))
    root = ctx.mpc(0, ctx.sqrt(-a31))
    by_root = 3 * root**2 - 2 * a33 * root - a31
    by_speed = 2 * speed * root - 2 * a32
    drift = -by_speed / by_root
    amplitude, period = (
        quotient(ctx, slope.value) for slope in harmonic_balance.slopes(parameters, digits=_DIGITS + 12)
    )
    # beta_max^2 = 4 |z|^2 |q_1|^2 and |z|^2 = -Re(lambda) / Re(c_1), with q = (lambda, Omega, lambda^2) / |...|.
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


HOPF = (
    Method("normal-form", "exact Routh-Hurwitz and Kuznetsov's normal form, mpmath", _hopf_first),
    Method("balance", "implicit differentiation and the consistent one-harmonic law's slopes", _hopf_balance, True),
)
hopf_condition = by_differences(lambda case: hopf.normal_form(case.parameters, _DIGITS))


# ------------------------------------------------------------------------------------------ harmonic balance
def _balance_first(case: Case, known: Values) -> Values:
    cycle = harmonic_balance.one_harmonic(case.parameters, case.inputs["Omega"], case.inputs["form"], _DIGITS)
    return {name: getattr(cycle, name) for name in ("amplitude", "frequency", "period")}


def _balance_floating(case: Case, known: Values) -> Values:
    rough, sharp = (_law(case, working) for working in (_BITS, _WIDER))
    return _compared(rough, sharp, _BITS - 40)  # just below Omega_crit the numerator cancels


def _law(case: Case, working: int) -> dict[str, Any]:
    ctx = bits(working).context
    c, omega, form = _constants(case.parameters, ctx), quotient(ctx, case.inputs["Omega"]), case.inputs["form"]
    square, frequency_squared = harmonic_balance.squares(c, omega, form)
    frequency = ctx.sqrt(frequency_squared)
    return {"amplitude": ctx.sqrt(square), "frequency": frequency, "period": 2 * ctx.pi / frequency}


BALANCE = (
    Method("exact", "the closed law in exact rationals, roots at the end", _balance_first),
    Method("floating", "the same law in floating point at 72 digits", _balance_floating),
)
balance_condition = by_differences(lambda case: _law(case, _BITS))


# ------------------------------------------------------------------------------------------ slow manifold
_HIGHEST = 5


def _manifold_first(case: Case, known: Values) -> Values:
    rough, sharp = (_orders(case, working) for working in (_BITS, _WIDER))
    return _compared(rough, sharp, _BITS - 20)


def _orders(case: Case, working: int, highest: int = _HIGHEST) -> dict[str, Any]:
    ctx = bits(working).context
    c = _constants(case.parameters, ctx)
    omega, beta, gamma = (quotient(ctx, case.inputs[name]) for name in ("Omega", "beta", "gamma"))
    series = slow_manifold.orders(ctx, c, omega, beta, gamma, highest)
    residuals = slow_manifold.invariance_residuals(ctx, c, omega, beta, gamma, highest)
    return {f"h_{n}": h for n, h in enumerate(series)} | {f"residual_{n}": h for n, h in enumerate(residuals)}


def _manifold_differences(case: Case, known: Values) -> Values:
    """Each order from the lower ones and their difference quotients, with the paper's terms written out.

    The invariance condition at order n needs h_0 ... h_(n-1) and their slopes; here these are central differences at a
    distance of 1e-32 in 120 digits, good to 60, and g_1 is taken apart by evaluating M, h and f_G at three velocities.
    """
    ctx = bits(400).context
    c = _constants(case.parameters, ctx)
    omega, beta, gamma = (quotient(ctx, case.inputs[name]) for name in ("Omega", "beta", "gamma"))
    step = ctx.mpf(10) ** -32

    def at(b: Any, g: Any) -> list[Any]:
        return list(slow_manifold.orders(ctx, c, omega, b, g, _HIGHEST))

    here = at(beta, gamma)
    by_beta = _quotients(at(beta + step, gamma), at(beta - step, gamma), step)
    by_gamma = _quotients(at(beta, gamma + step), at(beta, gamma - step), step)
    still, ahead, back = (_inertial(ctx, c, omega, beta, gamma, ctx.mpf(v)) for v in (0, 1, -1))
    q1, q2 = (ahead - back) / 2, (ahead + back) / 2 - still
    drift = omega * ctx.cos(beta)
    # The friction term is -rate (v - h_0) / epsilon.
    rate = -slow_manifold.attraction_rate(ctx, c, beta, gamma) * c.epsilon
    numbers = {"h_0": slow_manifold.critical_manifold(ctx, c, omega, beta, gamma)}
    for n in range(1, _HIGHEST + 1):
        right = (still if n == 1 else 0) + q1 * here[n - 1] + drift * by_gamma[n - 1]
        right += sum(q2 * here[i] * here[n - 1 - i] - by_beta[i] * here[n - 1 - i] for i in range(n))
        numbers[f"h_{n}"] = right / rate
    for n in range(_HIGHEST + 1):
        v, slope_b, slope_g = (sum(c.epsilon**i * part[i] for i in range(n + 1)) for part in (here, by_beta, by_gamma))
        moved = slope_b * v - slope_g * drift
        acceleration = field(ctx, c, omega, "linear")(beta, gamma, v)[2]
        numbers[f"residual_{n}"] = c.epsilon * (moved - acceleration)
    return {name: Measured.of(value, abs(value) / ctx.mpf(10) ** 44) for name, value in numbers.items()}


def _quotients(above: list[Any], below: list[Any], step: Any) -> list[Any]:
    return [(a - b) / (2 * step) for a, b in zip(above, below, strict=True)]


def _inertial(ctx: Any, c: Constants, omega: Any, beta: Any, gamma: Any, v: Any) -> Any:
    """(h + f_G) / M."""
    here = terms(ctx, c, omega, beta, gamma, v)
    return (here.gyroscopic + here.gravity) / here.mass


MANIFOLD = (
    Method("jets", "the recursion on truncated power series, mpmath at 72 digits", _manifold_first),
    Method(
        "differences", "the invariance condition with difference quotients, mpmath at 120 digits", _manifold_differences
    ),
)
manifold_condition = by_differences(lambda case: _orders(case, _BITS))
