"""The true numbers of an entry, and the effect of each input on them.

`true_values` gives the numbers of the published data and of fresh questions. `cross_check_values`
gives the numbers that a check compares them with: from another formulation if there is one,
otherwise from the same method in another precision. `sensitivities` gives the effect of the inputs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from typing import Any

from mpmath import fp

from tippedisk_verify.cycles.shooting.error_budget import numbers_in_precision
from tippedisk_verify.cycles.shooting.newton import FixedPoint
from tippedisk_verify.cycles.shooting.return_map import ReturnMap
from tippedisk_verify.cycles.shooting.section import LIBRATING, ROTATING
from tippedisk_verify.cycles.shooting.shoot import shoot, shoot_limit_cycle
from tippedisk_verify.errors import AccuracyError
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.contract import Build, Engine, Request, Result, Status
from tippedisk_verify.model.equations import STATE_NAMES, equation_terms, jacobian, shifted_ops
from tippedisk_verify.model.parameters import SYMBOLS
from tippedisk_verify.numbers.exact import PI, exact, fraction, rational_in_context
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.precision import DOUBLE, precision_of_bits
from tippedisk_verify.reference_values.drawn_disks import DRAWN_SET
from tippedisk_verify.reference_values.entries import (
    READINGS,
    STORED_DIGITS,
    Case,
    MeasuredValues,
    Reading,
    ReferenceEntry,
    case_of,
    rounded_to_digits,
)
from tippedisk_verify.reference_values.store import (
    OPTIONAL_QUANTITIES,
    ReferenceValue,
    definition_of,
    quantity_definitions,
)
from tippedisk_verify.theory import hopf, one_harmonic_law, slow_manifold

__all__ = [
    "BITS",
    "DIGITS",
    "ORDERS",
    "WIDER_BITS",
    "FixedToleranceEngine",
    "Sensitivities",
    "as_reference_value",
    "as_reference_values",
    "connection_numbers",
    "cross_check_values",
    "evaluate_in_two_precisions",
    "omega_h_values",
    "optional_quantities",
    "sensitivities",
    "sensitivities_by_differences",
    "shoot_known_cycle",
    "trajectory_numbers",
    "trajectory_values",
    "true_values",
]

DIGITS = 56  #: of closed forms, so that 50 can be stored
#: Bits of the working precision, and of the wider one that shows its error. 240 bits are 72 digits;
#: some cancel near beta = pi/2.
BITS, WIDER_BITS = 240, 304
ORDERS = 5  #: of the slow manifold
_RELATIVE_STEP = Fraction(1, 10**12)  # relative step of the differences that give condition numbers
# Relative step of differences in doubles: rounding costs ten digits, and the step twelve.
_STEP_IN_DOUBLE = Fraction(1, 10**6)
# [s] Orbits start on the section up to rounding, half of them with v = 0. A crossing before this
# time is the start itself, even after a start is moved by 1e-7 to find its effect.
_MIN_CROSSING_TIME = 0.01
_HALF_PI = PI * Fraction(1, 2)
Sensitivities = dict[str, dict[str, Any]]  #: by quantity, then by parameter or input


def true_values(case: Case, digits: int) -> MeasuredValues:
    """Compute the true numbers of an entry of the reference data.

    Args:
        case: The entry in one reading.
        digits: Significant digits of the numbers that need an integrator. Closed forms have
            `DIGITS`.
    """
    return _FIRST_METHODS[case.entry.kind](case, digits)


def cross_check_values(case: Case, digits: int) -> MeasuredValues:
    """Compute the true numbers of an entry in a second formulation, if there is one, as a check.

    Args:
        case: The entry in one reading.
        digits: Significant digits of the numbers that need an integrator.
    """
    return {**_FIRST_METHODS, **_SECOND_METHODS}[case.entry.kind](case, digits)


def sensitivities(case: Case, values: MeasuredValues) -> Sensitivities:
    """Return how sensitive the numbers of an entry are: the change of each number per relative
    change of each parameter and input.

    Args:
        case: The entry in one reading.
        values: Its numbers, from which shooting starts.
    """
    evaluate, step = _CHEAP_EVALUATIONS[case.entry.kind]
    return sensitivities_by_differences(case, lambda moved: evaluate(moved, values), step)


def sensitivities_by_differences(
    case: Case,
    evaluate: Callable[[Case], Mapping[str, Any]],
    step: Fraction = _RELATIVE_STEP,
) -> Sensitivities:
    """Return the change of each quantity per relative change of each parameter and input, by
    central differences.

    It is dq / (dp / p) for a quantity q and a parameter or input p.

    Args:
        case: The entry in one reading.
        evaluate: A function of the case that is cheap to evaluate.
        step: The relative step.
    """
    slopes: Sensitivities = {}
    moving = [name for name, value in case.inputs.items() if isinstance(value, Fraction) and value]
    for name in (*SYMBOLS, *moving):
        above, below = (
            evaluate(_with_moved_input(case, name, 1 + sign * step)) for sign in (1, -1)
        )
        for quantity in above.keys() & below.keys():
            slope = float((above[quantity] - below[quantity]) / (2 * float(step)))
            slopes.setdefault(quantity, {})[name] = slope
    return slopes


def _with_moved_input(case: Case, name: str, factor: Fraction) -> Case:
    if name in case.inputs:
        return replace(case, inputs={**case.inputs, name: case.inputs[name] * factor})
    value: Any = getattr(case.disk, name) * factor
    return replace(case, disk=replace(case.disk, **{name: value}))


def evaluate_in_two_precisions(
    evaluate: Callable[[Any], Mapping[str, Any]], lower_bits: int = BITS, correct_bits: int = BITS
) -> MeasuredValues:
    """Evaluate a function in two precisions, and return the values with the error that this shows.

    Args:
        evaluate: A function of an mpmath context.
        lower_bits: Bits of the lower precision; the higher one has 64 more.
        correct_bits: Bits of the values that may be taken as correct.
    """
    coarse, accurate = (
        evaluate(precision_of_bits(working).context)
        for working in (lower_bits, lower_bits + WIDER_BITS - BITS)
    )
    return {
        name: Measured.compared(value, accurate[name], Fraction(2, 1 << correct_bits))
        for name, value in coarse.items()
    }


def _constants_and_inputs(ctx: Any, case: Case, *names: str) -> tuple[Any, ...]:
    """Return the disk's constants and the named inputs of an entry, as numbers of an mpmath
    context.
    """
    return (
        case.disk.constants_in_context(ctx),
        *(rational_in_context(ctx, case.inputs[name]) for name in names),
    )


def as_reference_value(
    entry: ReferenceEntry,
    name: str,
    values: Mapping[Reading, tuple[str, str]],
    slopes: Mapping[str, Any],
    grade: str = "single",
    methods: Mapping[str, str] | None = None,
) -> ReferenceValue:
    """Return computed numbers and their sensitivities as a reference value.

    Args:
        entry: The entry.
        name: The quantity's name.
        values: Value and half-width as decimals, by reading.
        slopes: The change of the value per relative change of each input. Zeros are left out; the
            others are kept to three digits.
        grade: proved, two-method, agreed, or single.
        methods: The distance of each method's value from the one given.
    """
    level, unit, _ = definition_of(entry.kind, name)
    return ReferenceValue(
        id=f"{entry.id}/{name}",
        level=level,
        kind=entry.kind,
        set=entry.set,
        friction=entry.friction,
        name=name,
        unit=unit,
        inputs=entry.inputs,
        values=values,
        grade=grade,
        methods=methods or {},
        condition={symbol: f"{float(slope):.3g}" for symbol, slope in slopes.items() if slope},
    )


def as_reference_values(
    entry: ReferenceEntry,
    names: Iterable[str],
    values: Mapping[Reading, MeasuredValues],
    slopes: Sensitivities,
) -> list[ReferenceValue]:
    """Return the computed numbers of an entry as reference values of `STORED_DIGITS` digits.

    Args:
        entry: The entry.
        names: The names of the quantities.
        values: The numbers by reading, then by name.
        slopes: The sensitivities by name.
    """
    return [
        as_reference_value(
            entry,
            name,
            {
                reading: rounded_to_digits(numbers[name], STORED_DIGITS).decimals()
                for reading, numbers in values.items()
            },
            slopes[name],
        )
        for name in names
    ]


# ------------------------------------------------------------------------------------ closed forms
def _right_hand_side(case: Case, ctx: Any, shift: bool = False) -> dict[str, Any]:
    """Compute the terms of the paper's equations as printed, and the Jacobian, at the state of an
    entry.

    With ``shift`` the calculation uses the angles minus pi/2.
    """
    c, omega, beta, gamma, v = _constants_and_inputs(ctx, case, "Omega", *STATE_NAMES)
    ops, quarter_turn = (shifted_ops(ctx), ctx.pi / 2) if shift else (ctx, 0)
    beta, gamma = beta - quarter_turn, gamma - quarter_turn
    values = equation_terms(ops, c, omega, beta, gamma, v)
    if case.entry.friction == "both":
        return {
            "M": values.mass,
            "h": values.gyroscopic,
            "f_G": values.gravity,
            "w_y": values.force_direction,
            "gamma_y": values.sliding_velocity,
            "gamma_rate": -omega * ops.cos(beta),
        }
    force = case.disk.law(ops, values.sliding_velocity, c)
    slopes = jacobian(ops, c, omega, case.disk.friction)(beta, gamma, v)[2]
    return {
        "lambda_Ty": force,
        "v_rate": (values.gyroscopic + values.gravity + values.force_direction * force)
        / values.mass,
        **dict(zip(("dv_rate_dbeta", "dv_rate_dgamma", "dv_rate_dv"), slopes, strict=True)),
    }


def _optional_terms(case: Case, ctx: Any) -> dict[str, Any]:
    """Compute the optional quantities at the state of an entry, Bbar and the terms of
    h, by name.
    """
    c, omega, beta, gamma, v = _constants_and_inputs(ctx, case, "Omega", *STATE_NAMES)
    parts = equation_terms(ctx, c, omega, beta, gamma, v).gyroscopic_terms
    return dict(zip(OPTIONAL_QUANTITIES, (c.Bbar, *parts), strict=True))


def optional_quantities(reference_value: ReferenceValue) -> list[ReferenceValue]:
    """Compute the optional quantities of a state, in the order of `OPTIONAL_QUANTITIES`.

    Args:
        reference_value: A quantity of the same state.
    """
    entry = ReferenceEntry(reference_value.id.rsplit("/", 1)[0], reference_value.inputs)
    cases = {reading: case_of(entry, reading) for reading in READINGS}
    values = {
        reading: evaluate_in_two_precisions(partial(_optional_terms, case))
        for reading, case in cases.items()
    }
    slopes = sensitivities_by_differences(
        cases["decimals"], lambda moved: _optional_terms(moved, fp), _STEP_IN_DOUBLE
    )
    return as_reference_values(entry, OPTIONAL_QUANTITIES, values, slopes)


def _equilibrium(case: Case, digits: int) -> MeasuredValues:
    state = case.disk.equilibrium(case.inputs["equilibrium"], case.inputs["Omega"], digits=DIGITS)
    return _eigenvalue_parts((value.re, value.im) for value in state.eigenvalues)


def _eigenvalues(case: Case, ctx: Any) -> dict[str, Any]:
    """Compute the eigenvalues of an equilibrium's full Jacobian by the QR algorithm, by name."""
    c, omega = _constants_and_inputs(ctx, case, "Omega")
    gamma = ctx.pi / 2 if case.inputs["equilibrium"] == "inverted" else -ctx.pi / 2
    rows = jacobian(ctx, c, omega, "linear")(ctx.pi / 2, gamma, ctx.mpf(0))
    values = ctx.eig(ctx.matrix([list(row) for row in rows]), left=False, right=False)
    small = ctx.mpf(2) ** (-ctx.prec // 2) * max(abs(value) for value in values)
    pairs = [
        (ctx.re(value), ctx.im(value) if abs(ctx.im(value)) > small else ctx.mpf(0))
        for value in values
    ]
    pairs.sort(key=lambda pair: (-ctx.nint(pair[0] / small), -pair[1]))
    return _eigenvalue_parts(pairs)


def _eigenvalue_parts(pairs: Iterable[tuple[Any, Any]]) -> dict[str, Any]:
    return {
        f"lambda_{n}_{part}": number
        for n, pair in enumerate(pairs, start=1)
        for part, number in zip(("re", "im"), pair, strict=True)
    }


def _one_harmonic_law(case: Case, ctx: Any) -> dict[str, Any]:
    """Return amplitude, frequency and period of the one-harmonic law by name, as numbers of the
    mpmath context ``ctx``.
    """
    c, omega = _constants_and_inputs(ctx, case, "Omega")
    square, frequency_squared = one_harmonic_law.amplitude_and_frequency_squared(
        c, omega, case.inputs["form"]
    )
    frequency = ctx.sqrt(frequency_squared)
    return {"amplitude": ctx.sqrt(square), "frequency": frequency, "period": 2 * ctx.pi / frequency}


def _slow_manifold(case: Case, ctx: Any) -> dict[str, Any]:
    """Compute the slow manifold's orders and residuals at a point by recursion on truncated power
    series, by name.
    """
    arguments = (ctx, *_constants_and_inputs(ctx, case, "Omega", "beta", "gamma"), ORDERS)
    orders, residuals = (
        slow_manifold.series_orders(*arguments),
        slow_manifold.invariance_residuals(*arguments),
    )
    return {f"h_{n}": h for n, h in enumerate(orders)} | {
        f"residual_{n}": h for n, h in enumerate(residuals)
    }


# ------------------------------------------------------------------------------------------ motion
@dataclass(frozen=True)
class FixedToleranceEngine:
    """An engine that integrates at a fixed tolerance and gives no half-widths."""

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


def trajectory_numbers(
    case: Case, digits: int, *, shift: bool = False, engine: Engine | None = None
) -> Mapping[str, tuple[Any, Any]]:
    """Integrate the orbit of an entry, and return its numbers with half-widths, by name.

    Args:
        case: The entry in one reading.
        digits: Significant digits.
        shift: True to integrate in the angles minus pi/2.
        engine: The engine; None for the default.

    Returns:
        Samples, crossings of beta = pi/2 and the time at which the disk lies flat, each as (value,
        half-width).

    Raises:
        AccuracyError: If the orbit neither reaches its end nor lies flat.
    """
    duration = 2 if DRAWN_SET.fullmatch(case.entry.set) else 10
    times = [Fraction(n, 2) for n in range(1, 2 * duration + 1)]
    start = [exact(case.inputs[name]) for name in STATE_NAMES]
    if shift:
        start[:2] = [angle - _HALF_PI for angle in start[:2]]
    run = case.disk.integrate(
        case.inputs["Omega"],
        start,
        duration,
        t_eval=times,
        digits=digits,
        events="section",
        shifted=shift,
        engine=engine,
    )
    if run.status not in (Status.REACHED, Status.FLAT):
        raise AccuracyError(f"{case.entry.id}: {run.message}")
    samples = zip(times, run.y.T, run.uncertainty.T, strict=False)
    numbers = {
        f"{name}@{float(time):g}": pair
        for time, *sample in samples
        for name, pair in zip(STATE_NAMES, zip(*sample, strict=True), strict=True)
    }
    crossings = (event for event in run.events if event.time > _MIN_CROSSING_TIME)
    for n, crossing in enumerate(crossings, start=1):
        numbers[f"crossing_time#{n}"] = crossing.time, crossing.time_uncertainty
        for name, *pair in zip(
            STATE_NAMES[1:], crossing.state[1:], crossing.uncertainty[1:], strict=True
        ):
            numbers[f"crossing_{name}#{n}"] = tuple(pair)
    return numbers | (
        {"flat_time": (run.end.time, run.end.time_uncertainty)} if run.status is Status.FLAT else {}
    )


def trajectory_values(case: Case, digits: int, *, shift: bool = False) -> MeasuredValues:
    """Return the numbers of an orbit in the paper's angles, with half-widths, by name.

    Args:
        case: The entry in one reading.
        digits: Significant digits.
        shift: True to integrate in the angles minus pi/2.
    """
    quarter_turn = sum(_HALF_PI.bounds(WIDER_BITS)) / 2 if shift else Fraction(0)
    return {
        name: Measured.of(
            fraction(value) + quarter_turn * name.startswith(("beta", "gamma", "crossing_gamma")),
            float(width),
        )
        for name, (value, width) in trajectory_numbers(case, digits, shift=shift).items()
    }


def _trajectory_in_double(case: Case, values: MeasuredValues) -> dict[str, Any]:
    return {
        name: value
        for name, (value, _) in trajectory_numbers(
            case, 12, engine=FixedToleranceEngine(default_engine())
        ).items()
    }


# ------------------------------------------------------------------------------ cycles and Omega_h
def _asked_numbers(case: Case, result: Any) -> MeasuredValues:
    """Return those numbers of a result that the reference data contain for this kind of entry,
    by name.
    """
    return {name: getattr(result, name) for name in quantity_definitions()[case.entry.kind]}


def shoot_known_cycle(case: Case, values: Mapping[str, Any], engine: Engine) -> FixedPoint[Any]:
    """Find the fixed point of a limit cycle on its section by shooting in double precision,
    starting from known numbers.
    """
    section = ROTATING if case.entry.kind == "rotating-cycle" else LIBRATING
    names = ("beta_bar_top", "v_top") if section is ROTATING else ("gamma_bar_0", "v_0")
    return shoot(
        ReturnMap(section, case.disk, case.inputs["Omega"], engine),
        [float(values[name]) for name in names],
    )


def _cycle_in_double(case: Case, values: MeasuredValues) -> dict[str, Any]:
    numbers = numbers_in_precision(shoot_known_cycle(case, values, default_engine()), DOUBLE)
    return {name: float(numbers[name]) for name in quantity_definitions()[case.entry.kind]}


def omega_h_values(case: Case, digits: int, method: str = "manifolds") -> MeasuredValues:
    """Compute Omega_h and the saddle's eigenvalues there, by name.

    Args:
        case: The entry in one reading.
        digits: Significant digits.
        method: The method of `Disk.heteroclinic`.
    """
    return connection_numbers(case.disk.heteroclinic(digits=digits, method=method))


def connection_numbers(connection: Any) -> MeasuredValues:
    """Return Omega_h and the saddle's eigenvalues of a computed or proved connection, by name."""
    numbers = (connection.omega_h, *connection.saddle_eigenvalues)
    return dict(zip(quantity_definitions()["heteroclinic"], numbers, strict=True))


_FIRST_METHODS: dict[str, Callable[[Case, int], MeasuredValues]] = {
    "rhs": lambda case, digits: evaluate_in_two_precisions(partial(_right_hand_side, case)),
    "equilibrium": _equilibrium,
    "hopf": lambda case, digits: _asked_numbers(case, case.disk.hopf(digits=DIGITS)),
    "harmonic-balance": lambda case, digits: _asked_numbers(
        case,
        one_harmonic_law.one_harmonic(case.disk, case.inputs["Omega"], case.inputs["form"], DIGITS),
    ),
    "slow-manifold": lambda case, digits: evaluate_in_two_precisions(
        partial(_slow_manifold, case), correct_bits=BITS - 20
    ),
    "trajectory": trajectory_values,
    # On drawn disks the one-harmonic law is a good enough guess.
    "limit-cycle": lambda case, digits: _asked_numbers(
        case,
        shoot_limit_cycle(case.disk, case.inputs["Omega"], default_engine(), digits=digits)
        if DRAWN_SET.fullmatch(case.entry.set)
        else case.disk.limit_cycle(case.inputs["Omega"], digits=digits),
    ),
    "heteroclinic": omega_h_values,
    "near-heteroclinic": lambda case, digits: _asked_numbers(
        case, case.disk.limit_cycle(case.inputs["Omega"], digits=digits)
    ),
    "rotating-cycle": lambda case, digits: _asked_numbers(
        case,
        case.disk.rotating_cycle(
            case.inputs["Omega"], stable=case.inputs["form"] == "stable", digits=digits
        ),
    ),
    "rotation-fold": lambda case, digits: _asked_numbers(
        case, case.disk.rotation_fold(digits=digits)
    ),
}
_SECOND_METHODS: dict[str, Callable[[Case, int], MeasuredValues]] = {
    "rhs": lambda case, digits: evaluate_in_two_precisions(
        partial(_right_hand_side, case, shift=True), WIDER_BITS, WIDER_BITS
    ),
    # Two nearly equal eigenvalues cost the algorithm half its digits. Just below Omega_crit a
    # numerator cancels.
    "equilibrium": lambda case, digits: evaluate_in_two_precisions(
        partial(_eigenvalues, case), correct_bits=BITS // 2
    ),
    "harmonic-balance": lambda case, digits: evaluate_in_two_precisions(
        partial(_one_harmonic_law, case), correct_bits=BITS - 40
    ),
    "trajectory": partial(trajectory_values, shift=True),
}
CheapEvaluation = Callable[[Case, MeasuredValues], Mapping[str, Any]]
# A cheap function for each kind, and the relative step of its differences. A step of 1e-7 moves an
# orbit of ten seconds by about 1e-4 after the passages, and rounding by 1e-9 of that. A step of
# 1e-8 moves Omega_crit by 1e-7 and the fold by 1e-6.
_CHEAP_EVALUATIONS: dict[str, tuple[CheapEvaluation, Fraction]] = {
    "rhs": (
        lambda case, values: _right_hand_side(case, precision_of_bits(BITS).context),
        _RELATIVE_STEP,
    ),
    "equilibrium": (
        lambda case, values: _eigenvalues(case, precision_of_bits(BITS).context),
        _RELATIVE_STEP,
    ),
    "hopf": (lambda case, values: hopf.normal_form(case.disk, DIGITS), _RELATIVE_STEP),
    "harmonic-balance": (
        lambda case, values: _one_harmonic_law(case, precision_of_bits(BITS).context),
        _RELATIVE_STEP,
    ),
    "slow-manifold": (
        lambda case, values: _slow_manifold(case, precision_of_bits(BITS).context),
        _RELATIVE_STEP,
    ),
    "trajectory": (_trajectory_in_double, Fraction(1, 10**7)),
    "limit-cycle": (_cycle_in_double, Fraction(1, 10**8)),
    "rotating-cycle": (_cycle_in_double, Fraction(1, 10**8)),
}
