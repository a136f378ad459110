"""Roads to limit cycles and to Omega_h."""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache
from typing import Any

from tippedisk_verify.atlas.cycles_at_speed import cycle_at
from tippedisk_verify.connection.heteroclinic import heteroclinic
from tippedisk_verify.connection.near_connection import cycle_near
from tippedisk_verify.connection.omega_h_slopes import omega_h_slopes
from tippedisk_verify.cycles.error_budget import cycle_numbers
from tippedisk_verify.cycles.limit_cycle import LimitCycle
from tippedisk_verify.cycles.return_map import ReturnMap
from tippedisk_verify.cycles.section import LIBRATING
from tippedisk_verify.cycles.shooting import shoot
from tippedisk_verify.cycles.spectral import balanced_cycle
from tippedisk_verify.errors import Shortfall
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.baseline import Baseline
from tippedisk_verify.flow.contract import TURN, Engine, Event, Request, Result, Status
from tippedisk_verify.model.equations import field
from tippedisk_verify.model.exact import PI, Exact, fraction
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE, Precision, bits
from tippedisk_verify.reference_values.entries import Case, Item, Method, Values
from tippedisk_verify.reference_values.local_roads import by_differences
from tippedisk_verify.theory.equilibria import equilibrium

__all__ = [
    "CYCLE",
    "HETEROCLINIC",
    "NEAR",
    "cycle_condition",
    "cycle_unit",
    "heteroclinic_condition",
    "named_numbers",
    "near_condition",
    "period_from",
    "period_multipliers",
]

_DIGITS = 36
_QUARTER = PI * Fraction(1, 2)
_NAMES = (
    *("period", "gamma_bar_0", "v_0", "beta_max", "multiplier_slow", "log_multiplier_slow", "log_multiplier_fast"),
    *("dperiod_domega", "dgamma_bar_0_domega", "dv_0_domega"),
)
_UNITS = {
    "period": "s", "gamma_bar_0": "rad", "v_0": "rad/s", "beta_max": "rad", "dperiod_domega": "s^2/rad",
    "dgamma_bar_0_domega": "s", "omega_h": "rad/s", "lambda_u": "1/s", "lambda_s": "1/s", "lambda_ss": "1/s",
}  # fmt: skip
_EXTREME = Event("extreme of the period", TURN.function, terminal=False)
_BALANCE_ABOVE = Fraction(1, 20)  # rad/s above Omega_h: closer, harmonic balance needs hundreds of harmonics
_STEADY = Fraction(1, 1000)  # rad/s above Omega_h: closer, beta_max's slopes at a fixed distance no longer change
_OMEGA_H_DIGITS = 104


def cycle_unit(quantity: str) -> str:
    return _UNITS.get(quantity, "1")


@lru_cache(maxsize=16)
def _omega_h(parameters: Parameters, digits: int) -> Measured:
    return heteroclinic(parameters, default_engine(), digits=digits).omega_h


def named_numbers(cycle: LimitCycle) -> Values:
    """The numbers of a cycle that are asked for."""
    return {name: getattr(cycle, name) for name in _NAMES}


# ------------------------------------------------------------------------------------------ limit cycles
def _shooting(case: Case, known: Values) -> Values:
    return named_numbers(cycle_at(case.parameters, case.inputs["Omega"], default_engine(), digits=_DIGITS))


def _near(case: Case, known: Values) -> Values:
    omega = case.inputs["Omega"]
    omega_h = _omega_h(case.parameters, _distance_digits(omega))
    return named_numbers(cycle_near(LIBRATING, case.parameters, omega, omega_h.value, default_engine(), digits=_DIGITS))


def _distance_digits(omega: Fraction) -> int:
    """Enough digits of Omega_h to know how far above it a speed written with so many decimals lies."""
    return max(14, min(len(str(omega.denominator)), 90))


def _zeros(case: Case) -> int:
    """k for a speed 10^-k above Omega_h, 0 for the branch away from it."""
    if case.item.kind != "near-heteroclinic":
        return 0
    omega = case.inputs["Omega"]
    above = omega - _omega_h(case.parameters, _distance_digits(omega)).value
    return len(str(above.denominator // above.numerator))


def _full_period(case: Case, known: Values) -> Values:
    """The paper's own form, without the symmetry and in the paper's angles: Newton steps of the bordered system.

    The orbit is followed for a whole period with its derivatives, from the values to confirm and once more from where
    the first step leads, so that the derivatives are those on the cycle.
    """
    # Each of the two passages amplifies errors by about the inverse of the distance from Omega_h.
    precision = bits(220 + 8 * _zeros(case))
    ctx = precision.context
    gamma_bar, v, period = (known[name].value for name in ("gamma_bar_0", "v_0", "period"))
    for _ in range(2):
        start = [_QUARTER, Exact(gamma_bar, Fraction(1, 2)), v]
        result = period_from(case, case.inputs["Omega"], start, period, precision, (_EXTREME,))
        rows = [[precision.mpf(entry) for entry in row] for row in result.derivatives]
        rates = field(
            precision.ops, case.parameters.at(precision), precision.number(case.inputs["Omega"]), case.friction
        )
        flow = [precision.mpf(rate) for rate in rates(*result.state)]
        away = [precision.mpf(end - precision.number(begin)) for begin, end in zip(start, result.state, strict=True)]
        # Unknowns: the changes of gamma and v on the section, and of the period.
        matrix = ctx.matrix([[rows[i][j] - (i == j) for j in (1, 2)] + [flow[i]] for i in range(3)])
        change = ctx.lu_solve(matrix, ctx.matrix([-part for part in away]))
        gamma_bar, v, period = (
            value + fraction(step) for value, step in zip((gamma_bar, v, period), change, strict=True)
        )
    slope = ctx.lu_solve(matrix, ctx.matrix([-rows[i][3] for i in range(3)]))
    turns = [abs(record.state[0] - precision.number(_QUARTER)) for record in result.events]
    numbers = {
        "period": period,
        "gamma_bar_0": gamma_bar,
        "v_0": v,
        "dperiod_domega": fraction(slope[2]),
        "dgamma_bar_0_domega": fraction(slope[0]),
        "dv_0_domega": fraction(slope[1]),
        "beta_max": fraction(max(turns)),
        **period_multipliers(rows, precision.mpf(result.divergence), precision),
    }
    # Both steps done, what is left is rounding; 35 digits are claimed.
    return {name: Measured(value, abs(value) / 10**35 + known[name].uncertainty) for name, value in numbers.items()}


def period_multipliers(rows: list[list[Any]], divergence: Any, precision: Precision) -> dict[str, Fraction]:
    """The multipliers from the monodromy matrix, whose trace they are with 1, and its determinant's logarithm.

    The trace is a sum of entries that may be far larger than the multiplier: nothing is said where too few digits are
    left.
    """
    ctx = precision.context
    half = (sum(rows[i][i] for i in range(3)) - 1) / 2  # of the sum of both
    slow = half + ctx.sqrt(half * half - ctx.exp(divergence))  # the fast one may be as small as 1e-50
    lost = fraction(max(abs(entry) for row in rows for entry in row[:3])) * precision.epsilon * 2**20
    if lost >= abs(fraction(slow)) / 10**36:
        return {}
    logarithm = ctx.log(abs(slow))
    return {
        "multiplier_slow": fraction(slow),
        "log_multiplier_slow": fraction(logarithm),
        "log_multiplier_fast": fraction(divergence - logarithm),
    }


def period_from(
    case: Case, omega: Any, start: list[Any], period: Any, precision: Precision, events: tuple[Event, ...]
) -> Result:
    """A flight for a given time in the paper's angles, with its derivatives and its divergence.

    Raises Shortfall if it ends early.
    """
    request = Request(
        case.parameters, omega, start, period, precision=precision,
        variations=("beta", "gamma", "v", "Omega"), divergence=True, events=events, domain="none",
    )  # fmt: skip
    result = default_engine()(request)
    if result.status is not Status.REACHED:
        raise Shortfall(f"{case.item.id}: {result.status.value}")
    return result


def _balance(case: Case, known: Values) -> Values:
    if case.friction != "linear":
        return {}
    omega = case.inputs["Omega"]
    if omega - _omega_h(case.parameters, 14).value < _BALANCE_ABOVE:
        return {}
    cycle = balanced_cycle(case.parameters, omega, digits=40)
    return {name: getattr(cycle, name) for name in ("period", "gamma_bar_0", "v_0", "beta_max")}


def _scipy(case: Case, known: Values) -> Values:
    """Shooting with another integrator, in double; its nine digits are a claim, the distance is on record."""
    return {
        name: Measured.of(value, abs(value) * 1e-9 + 1e-12) for name, value in _shot(case, known, Baseline()).items()
    }


def _shot(case: Case, known: Values, engine: Engine) -> dict[str, float]:
    guess = (float(known["gamma_bar_0"]), float(known["v_0"]))
    fixed_point = shoot(ReturnMap(LIBRATING, case.parameters, case.inputs["Omega"], engine), guess)
    image, by_omega = fixed_point.image, fixed_point.image.fixed_point_by_omega
    return {
        "period": 2 * image.time,
        "gamma_bar_0": fixed_point.point[0],
        "v_0": fixed_point.point[1],
        "dperiod_domega": 2 * image.time_along_family,
        "dgamma_bar_0_domega": by_omega[0],
        "dv_0_domega": by_omega[1],
    }


CYCLE = (
    Method("shooting", "half-period shooting with heyoka on MPFR numbers, error seen in a wider arithmetic", _shooting),
    Method(
        "full-period", "the whole period in the paper's angles with its derivatives, another precision", _full_period
    ),
    Method("balance", "harmonic balance of the full equations, no integrator, mpmath", _balance, True),
    Method("scipy", "half-period shooting with SciPy's DOP853 in double; confirms what double holds", _scipy, True),
)
NEAR = (
    Method("shooting", "half-period shooting from the predicted passage, error seen in a wider arithmetic", _near),
    *CYCLE[1:3],
)


def cycle_condition(case: Case, values: Values) -> dict[str, dict[str, Any]]:
    """By shooting in double for parameters moved by 1e-8: Omega_crit moves by 1e-7 at most."""

    def plain(moved: Case) -> dict[str, Any]:
        guess = (float(values["gamma_bar_0"]), float(values["v_0"]))
        return_map = ReturnMap(LIBRATING, moved.parameters, moved.inputs["Omega"], default_engine())
        numbers = cycle_numbers(shoot(return_map, guess), DOUBLE)
        return {name: float(value) for name, value in numbers.items() if name in _NAMES}

    return by_differences(plain, Fraction(1, 10**8))(case, values)


def near_condition(case: Case, values: Values) -> dict[str, dict[str, Any]]:
    """Everything depends on Omega - Omega_h, and on the parameters through Omega_h, up to terms smaller by that much.

    dq/dOmega is the secant to the cycle a hundredth further from Omega_h, the slopes of Omega_h do the rest. Only
    beta_max, which tends to the connection's own, needs its slopes at a fixed distance from Omega_h too.
    """
    omega = case.inputs["Omega"]
    omega_h = _omega_h(case.parameters, _distance_digits(omega))
    step = (omega - omega_h.value) / 100
    ahead = cycle_near(LIBRATING, case.parameters, omega + step, omega_h.value, default_engine(), digits=10)
    by = _slopes(case.parameters)
    condition: dict[str, dict[str, Any]] = {}
    for name, value in values.items():
        slope = (getattr(ahead, name).value - value.value) / step
        # Fractions: near Omega_h these exceed a double's range of sense long before its range.
        condition[name] = {"Omega": slope * omega} | {symbol: -slope * part for symbol, part in by.items()}
    at_a_distance = _beta_max_slopes(case.parameters, max(omega - omega_h.value, _STEADY))
    for symbol, part in at_a_distance.items():
        condition["beta_max"][symbol] += part
    return condition


@lru_cache(maxsize=32)
def _beta_max_slopes(parameters: Parameters, above: Fraction) -> dict[str, Fraction]:
    """d(beta_max) / (dp / p) at Omega_h(p) + ``above`` [rad], by shooting in double."""
    omega_h = _omega_h(parameters, 14).value
    by = _slopes(parameters)
    here = cycle_near(LIBRATING, parameters, omega_h + above, omega_h, default_engine(), digits=10)
    guess = (float(here.gamma_bar_0), float(here.v_0))

    def plain(moved: Case) -> dict[str, Any]:
        change = {name: getattr(moved.parameters, name) / getattr(parameters, name) - 1 for name in by}
        omega = omega_h + above + sum(slope * change[name] for name, slope in by.items())
        return_map = ReturnMap(LIBRATING, moved.parameters, omega, default_engine())
        numbers = cycle_numbers(shoot(return_map, guess), DOUBLE)
        return {"beta_max": numbers["beta_max"]}

    case = Case(Item("", "", parameters.name, parameters.friction, {}), parameters, {})
    relative = by_differences(plain, Fraction(1, 10**7))(case, {})
    return {name: Fraction(slope) for name, slope in relative["beta_max"].items()}


@lru_cache(maxsize=8)
def _slopes(parameters: Parameters) -> dict[str, Fraction]:
    """d(Omega_h) / (dp / p) for each parameter [rad/s]."""
    if parameters.friction == "linear":
        slopes = omega_h_slopes(parameters, _omega_h(parameters, 24), default_engine())
        return {name: slope.value * getattr(parameters, name) for name, slope in slopes.items()}
    case = Case(Item("", "", parameters.name, parameters.friction, {}), parameters, {})
    relative = by_differences(lambda moved: {"omega_h": _omega_h(moved.parameters, 12).value}, Fraction(1, 10**5))(
        case, {}
    )
    return {name: Fraction(slope) for name, slope in relative["omega_h"].items()}


# ------------------------------------------------------------------------------------------ the connection
def _connection(case: Case, digits: int, method: str) -> Values:
    connection = heteroclinic(case.parameters, default_engine(), digits=digits, method=method)
    names = ("lambda_u", "lambda_s", "lambda_ss")
    return {"omega_h": connection.omega_h} | dict(zip(names, connection.saddle_eigenvalues, strict=True))


HETEROCLINIC = (
    Method("manifolds", "zero of the splitting of the saddles' manifolds", lambda case, known: _connection(
        case, _OMEGA_H_DIGITS, "manifolds")),
    Method("limit-cycles", "limit of the limit cycles, to 60 digits; shares the integrator only", lambda case, known: (
        _connection(case, 60, "limit-cycles"))),
    Method("scipy", "bisection with SciPy's DOP853 in double", lambda case, known: _connection(case, 11, "scipy"),
           True),
)  # fmt: skip


def heteroclinic_condition(case: Case, values: Values) -> dict[str, dict[str, Any]]:
    """Omega_h's slopes, and the eigenvalues along with it."""
    slopes = _slopes(case.parameters)
    omega_h = values["omega_h"].value

    def plain(moved: Case) -> dict[str, Any]:
        shift = sum(
            (slope * (getattr(moved.parameters, name) / getattr(case.parameters, name) - 1))
            for name, slope in slopes.items()
        )
        speed = omega_h + shift
        eigenvalues = equilibrium(moved.parameters, speed, "noninverted", 30).eigenvalues
        names = ("lambda_u", "lambda_s", "lambda_ss")
        return {"omega_h": speed} | {n: value.re.value for n, value in zip(names, eigenvalues, strict=True)}

    return by_differences(plain)(case, values)
