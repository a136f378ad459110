"""Truths: the numbers of a question, through `Disk` and the equations, and how far inputs move them.

`compute` gives the numbers that the published data and fresh questions have. `compute_again` gives those that a check
holds against them: in another formulation where there is one, else by the same method in another precision.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from typing import Any

from tippedisk_verify.cycles.error_budget import cycle_numbers
from tippedisk_verify.cycles.newton import FixedPoint
from tippedisk_verify.cycles.return_map import ReturnMap
from tippedisk_verify.cycles.section import LIBRATING, ROTATING
from tippedisk_verify.cycles.shooting import limit_cycle, shoot
from tippedisk_verify.errors import AccuracyError
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.contract import Build, Engine, Request, Result, Status
from tippedisk_verify.model.equations import friction_force, jacobian, shifted, terms
from tippedisk_verify.model.exact import PI, exact, fraction, quotient
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import SYMBOLS
from tippedisk_verify.model.precision import DOUBLE, bits
from tippedisk_verify.reference_values.draws import DRAWN_SET
from tippedisk_verify.reference_values.entries import Case, Item, Reading, Values
from tippedisk_verify.reference_values.store import Quantity, codebook, definition_of
from tippedisk_verify.theory import harmonic_balance, hopf, slow_manifold

__all__ = [
    *("BITS", "DIGITS", "ORDERS", "WIDER", "PlainEngine", "Slopes", "as_quantity", "by_differences", "compute"),
    *("compute_again", "condition", "connection", "in_two", "motion", "orbit", "shot"),
]

DIGITS = 56  #: of closed forms, for 50 that are kept
BITS, WIDER = 240, 304  #: 72 digits: near beta = pi/2 some cancel; and more, to see the error
ORDERS = 5  #: of the slow manifold
_STEP = Fraction(1, 10**12)  # relative, of the differences that give condition numbers
# The starts lie on the section, up to rounding, half of them with v = 0: a crossing before this time [s] is the start
# itself, also when the start is moved by 1e-7 to see what that does.
_START = 0.01
_STATE = ("beta", "gamma", "v")
_QUARTER = PI * Fraction(1, 2)
Slopes = dict[str, dict[str, Any]]  #: of each quantity, by parameter or input


def compute(case: Case, digits: int) -> Values:
    """The numbers of a question: closed forms to `DIGITS`, what takes an integrator to ``digits``."""
    return _COMPUTE[case.item.kind](case, digits)


def compute_again(case: Case, digits: int) -> Values:
    """The same, in another formulation where there is one."""
    return {**_COMPUTE, **_COMPUTE_AGAIN}[case.item.kind](case, digits)


def condition(case: Case, values: Values) -> Slopes:
    """The change of each number per relative change of each parameter and input, next to ``values``."""
    plain, step = _PLAIN[case.item.kind]
    return by_differences(case, lambda moved: plain(moved, values), step)


def by_differences(case: Case, plain: Callable[[Case], Mapping[str, Any]], step: Fraction = _STEP) -> Slopes:
    """dq / (dp / p) by central differences of a function that is cheap to evaluate."""
    slopes: Slopes = {}
    moving = [name for name, value in case.inputs.items() if isinstance(value, Fraction) and value]
    for name in (*SYMBOLS, *moving):
        above, below = (plain(_moved(case, name, 1 + sign * step)) for sign in (1, -1))
        for quantity in above.keys() & below.keys():
            slope = float((above[quantity] - below[quantity]) / (2 * float(step)))
            slopes.setdefault(quantity, {})[name] = slope
    return slopes


def _moved(case: Case, name: str, factor: Fraction) -> Case:
    if name in case.inputs:
        return replace(case, inputs={**case.inputs, name: case.inputs[name] * factor})
    value: Any = getattr(case.disk, name) * factor
    return replace(case, disk=replace(case.disk, **{name: value}))


def in_two(evaluate: Callable[[Any], Mapping[str, Any]], narrow: int = BITS, kept: int = BITS) -> Values:
    """What a function of an mpmath context gives in ``narrow`` bits, its error seen in 64 more; ``kept`` are right."""
    rough, sharp = (evaluate(bits(working).context) for working in (narrow, narrow + WIDER - BITS))
    return {name: Measured.compared(value, sharp[name], Fraction(2, 1 << kept)) for name, value in rough.items()}


def _in(ctx: Any, case: Case, *names: str) -> tuple[Any, ...]:
    """The disk's constants and these inputs in a context."""
    return (case.disk.within(ctx), *(quotient(ctx, case.inputs[name]) for name in names))


def as_quantity(
    item: Item,
    name: str,
    values: Mapping[Reading, tuple[str, str]],
    slopes: Mapping[str, Any],
    grade: str = "single",
    methods: Mapping[str, str] | None = None,
) -> Quantity:
    """A computed number as a reference value; the slopes to three digits, without those that are 0."""
    level, unit, _ = definition_of(item.kind, name)
    return Quantity(
        id=f"{item.id}/{name}", level=level, kind=item.kind, set=item.set, friction=item.friction, name=name, unit=unit,
        inputs=item.inputs, values=values, grade=grade, methods=methods or {},
        condition={symbol: f"{float(slope):.3g}" for symbol, slope in slopes.items() if slope},
    )  # fmt: skip


# ------------------------------------------------------------------------------------------ closed forms
def _right_hand_side(case: Case, ctx: Any, shift: bool = False) -> dict[str, Any]:
    """The paper's terms as they stand and the Jacobian by hand; with ``shift`` in angles less pi/2."""
    c, omega, beta, gamma, v = _in(ctx, case, "Omega", *_STATE)
    ops, quarter = (shifted(ctx), ctx.pi / 2) if shift else (ctx, 0)
    beta, gamma = beta - quarter, gamma - quarter
    values = terms(ops, c, omega, beta, gamma, v)
    if case.item.friction == "both":
        return {
            "M": values.mass,
            "h": values.gyroscopic,
            "f_G": values.gravity,
            "w_y": values.direction,
            "gamma_y": values.sliding_velocity,
            "gamma_rate": -omega * ops.cos(beta),
        }
    force = friction_force(c, values.sliding_velocity, case.disk.friction)
    slopes = jacobian(ops, c, omega, case.disk.friction)(beta, gamma, v)[2]
    return {
        "lambda_Ty": force,
        "v_rate": (values.gyroscopic + values.gravity + values.direction * force) / values.mass,
        **dict(zip(("dv_rate_dbeta", "dv_rate_dgamma", "dv_rate_dv"), slopes, strict=True)),
    }


def _equilibrium(case: Case, digits: int) -> Values:
    state = case.disk.equilibrium(case.inputs["equilibrium"], case.inputs["Omega"], digits=DIGITS)
    return _of_places((value.re, value.im) for value in state.eigenvalues)


def _eigenvalues(case: Case, ctx: Any) -> dict[str, Any]:
    """Eigenvalues of the Jacobian of the full equations, by the QR algorithm."""
    c, omega = _in(ctx, case, "Omega")
    gamma = ctx.pi / 2 if case.inputs["equilibrium"] == "inverted" else -ctx.pi / 2
    rows = jacobian(ctx, c, omega, "linear")(ctx.pi / 2, gamma, ctx.mpf(0))
    values = ctx.eig(ctx.matrix([list(row) for row in rows]), left=False, right=False)
    small = ctx.mpf(2) ** (-ctx.prec // 2) * max(abs(value) for value in values)
    pairs = [(ctx.re(value), ctx.im(value) if abs(ctx.im(value)) > small else ctx.mpf(0)) for value in values]
    pairs.sort(key=lambda pair: (-ctx.nint(pair[0] / small), -pair[1]))
    return _of_places(pairs)


def _of_places(pairs: Iterable[tuple[Any, Any]]) -> dict[str, Any]:
    return {
        f"lambda_{n}_{part}": number
        for n, pair in enumerate(pairs, start=1)
        for part, number in zip(("re", "im"), pair, strict=True)
    }


def _law(case: Case, ctx: Any) -> dict[str, Any]:
    """The one-harmonic law in floating point."""
    c, omega = _in(ctx, case, "Omega")
    square, frequency_squared = harmonic_balance.squares(c, omega, case.inputs["form"])
    frequency = ctx.sqrt(frequency_squared)
    return {"amplitude": ctx.sqrt(square), "frequency": frequency, "period": 2 * ctx.pi / frequency}


def _manifold(case: Case, ctx: Any) -> dict[str, Any]:
    """The slow manifold's orders and residuals, by the recursion on truncated power series."""
    arguments = (ctx, *_in(ctx, case, "Omega", "beta", "gamma"), ORDERS)
    orders, residuals = slow_manifold.orders(*arguments), slow_manifold.invariance_residuals(*arguments)
    return {f"h_{n}": h for n, h in enumerate(orders)} | {f"residual_{n}": h for n, h in enumerate(residuals)}


# ------------------------------------------------------------------------------------------ motion
@dataclass(frozen=True)
class PlainEngine:
    """An engine at a tolerance, without half-widths."""

    engine: Engine
    tolerance: float | None = None
    measures_error = False

    @property
    def name(self) -> str:
        return self.engine.name

    @property
    def builds(self) -> tuple[Build, ...]:
        return self.engine.builds

    def __call__(self, request: Request) -> Result:
        return self.engine(replace(request, tolerance=self.tolerance))


def orbit(
    case: Case, digits: int, *, shift: bool = False, engine: Engine | None = None
) -> Mapping[str, tuple[Any, Any]]:
    """An orbit's samples, its crossings of beta = pi/2, and when the disk lies flat, each with its half-width.

    With ``shift`` angles are less pi/2. Raises AccuracyError if it ends otherwise.
    """
    duration = 2 if DRAWN_SET.fullmatch(case.item.set) else 10
    times = [Fraction(n, 2) for n in range(1, 2 * duration + 1)]
    start = [exact(case.inputs[name]) for name in _STATE]
    if shift:
        start[:2] = [angle - _QUARTER for angle in start[:2]]
    run = case.disk.integrate(
        case.inputs["Omega"], start, duration,
        t_eval=times, digits=digits, events="section", shifted=shift, engine=engine,
    )  # fmt: skip
    if run.status not in (Status.REACHED, Status.FLAT):
        raise AccuracyError(f"{case.item.id}: {run.message}")
    samples = zip(times, run.y.T, run.uncertainty.T, strict=False)
    numbers = {
        f"{name}@{float(time):g}": pair
        for time, *sample in samples
        for name, pair in zip(_STATE, zip(*sample, strict=True), strict=True)
    }
    for n, one in enumerate((one for one in run.events if one.time > _START), start=1):
        numbers[f"crossing_time#{n}"] = one.time, one.time_uncertainty
        for name, *pair in zip(_STATE[1:], one.state[1:], one.uncertainty[1:], strict=True):
            numbers[f"crossing_{name}#{n}"] = tuple(pair)
    return numbers | ({"flat_time": (run.end.time, run.end.time_uncertainty)} if run.status is Status.FLAT else {})


def motion(case: Case, digits: int, *, shift: bool = False) -> Values:
    """The orbit's numbers; with ``shift`` they come from angles less pi/2."""
    quarter = sum(_QUARTER.enclosed(WIDER)) / 2 if shift else Fraction(0)
    return {
        name: Measured.of(
            fraction(value) + quarter * name.startswith(("beta", "gamma", "crossing_gamma")), float(width)
        )
        for name, (value, width) in orbit(case, digits, shift=shift).items()
    }


def _moved_orbit(case: Case, values: Values) -> dict[str, Any]:
    return {name: value for name, (value, _) in orbit(case, 12, engine=PlainEngine(default_engine())).items()}


# ------------------------------------------------------------------------------------------ cycles and Omega_h
def _named(case: Case, result: Any) -> Values:
    """The numbers of a result that its kind is asked for."""
    return {name: getattr(result, name) for name in codebook()[case.item.kind]}


def shot(case: Case, values: Mapping[str, Any], engine: Engine) -> FixedPoint[Any]:
    """The cycle's point on its section, by shooting in double from its numbers."""
    section = ROTATING if case.item.kind == "rotating-cycle" else LIBRATING
    names = ("beta_bar_top", "v_top") if section is ROTATING else ("gamma_bar_0", "v_0")
    return shoot(ReturnMap(section, case.disk, case.inputs["Omega"], engine), [float(values[name]) for name in names])


def _cycle_in_double(case: Case, values: Values) -> dict[str, Any]:
    numbers = cycle_numbers(shot(case, values, default_engine()), DOUBLE)
    return {name: float(numbers[name]) for name in codebook()[case.item.kind]}


def connection(case: Case, digits: int, method: str = "manifolds") -> Values:
    """Omega_h and the saddle's eigenvalues there."""
    point = case.disk.heteroclinic(digits=digits, method=method)
    return dict(zip(codebook()["heteroclinic"], (point.omega_h, *point.saddle_eigenvalues), strict=True))


_COMPUTE: dict[str, Callable[[Case, int], Values]] = {
    "rhs": lambda case, digits: in_two(partial(_right_hand_side, case)),
    "equilibrium": _equilibrium,
    "hopf": lambda case, digits: _named(case, case.disk.hopf(digits=DIGITS)),
    "harmonic-balance": lambda case, digits: _named(
        case, harmonic_balance.one_harmonic(case.disk, case.inputs["Omega"], case.inputs["form"], DIGITS)
    ),
    "slow-manifold": lambda case, digits: in_two(partial(_manifold, case), kept=BITS - 20),
    "trajectory": motion,
    # By the law's guess where that leads to the cycle, as on all drawn disks.
    "limit-cycle": lambda case, digits: _named(
        case,
        limit_cycle(case.disk, case.inputs["Omega"], default_engine(), digits=digits)
        if DRAWN_SET.fullmatch(case.item.set)
        else case.disk.limit_cycle(case.inputs["Omega"], digits=digits),
    ),
    "heteroclinic": connection,
    "near-heteroclinic": lambda case, digits: _named(case, case.disk.limit_cycle(case.inputs["Omega"], digits=digits)),
    "rotating-cycle": lambda case, digits: _named(
        case, case.disk.rotating_cycle(case.inputs["Omega"], stable=case.inputs["form"] == "stable", digits=digits)
    ),
    "rotation-fold": lambda case, digits: _named(case, case.disk.rotation_fold(digits=digits)),
}
_COMPUTE_AGAIN: dict[str, Callable[[Case, int], Values]] = {
    "rhs": lambda case, digits: in_two(partial(_right_hand_side, case, shift=True), WIDER, WIDER),
    # A pair that nearly coincides costs the algorithm half its digits; just below Omega_crit a numerator cancels.
    "equilibrium": lambda case, digits: in_two(partial(_eigenvalues, case), kept=BITS // 2),
    "harmonic-balance": lambda case, digits: in_two(partial(_law, case), kept=BITS - 40),
    "trajectory": partial(motion, shift=True),
}
Plain = Callable[[Case, Values], Mapping[str, Any]]
#: What is cheap to evaluate, and the step of its differences. 1e-7 of a parameter moves an orbit of ten seconds by some
#: 1e-4 after the passages, and rounding by 1e-9 of that change; 1e-8 moves Omega_crit by 1e-7 and the fold by 1e-6.
_PLAIN: dict[str, tuple[Plain, Fraction]] = {
    "rhs": (lambda case, values: _right_hand_side(case, bits(BITS).context), _STEP),
    "equilibrium": (lambda case, values: _eigenvalues(case, bits(BITS).context), _STEP),
    "hopf": (lambda case, values: hopf.normal_form(case.disk, DIGITS), _STEP),
    "harmonic-balance": (lambda case, values: _law(case, bits(BITS).context), _STEP),
    "slow-manifold": (lambda case, values: _manifold(case, bits(BITS).context), _STEP),
    "trajectory": (_moved_orbit, Fraction(1, 10**7)),
    "limit-cycle": (_cycle_in_double, Fraction(1, 10**8)),
    "rotating-cycle": (_cycle_in_double, Fraction(1, 10**8)),
}
