"""Further methods for limit cycles, their folds and Omega_h, in addition to those of `Disk`."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from tippedisk_verify.cycles.collocation.collocation_cycles import (
    collocation_cycle,
    collocation_fold,
    collocation_rotating_cycle,
)
from tippedisk_verify.cycles.families.folds import fold_near
from tippedisk_verify.cycles.shooting.section import FULL_ROTATION, RECORDED_BETA_EXTREME, ROTATING
from tippedisk_verify.errors import AccuracyError
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.contract import Event, Request, Status
from tippedisk_verify.flow.scipy_engine import ScipyEngine
from tippedisk_verify.model.equations import vector_field
from tippedisk_verify.numbers.exact import PI, Exact, fraction
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.precision import Precision, precision_of_bits
from tippedisk_verify.reference_values.entries import Case, MeasuredValues
from tippedisk_verify.reference_values.truths import shoot_known_cycle

__all__ = [
    "balance",
    "collocation",
    "fold_by_collocation",
    "fold_by_scipy",
    "fold_from_the_bottom",
    "omega_h_for",
    "scipy",
    "whole_period",
]

# rad/s above Omega_h. Closer to it, harmonic balance needs hundreds of harmonics.
_BALANCE_ABOVE = Fraction(1, 20)
# Digits of harmonic balance and collocation. The state at the top has a few digits less, the null
# vector ten less, but both have at least 30.
_COLLOCATED_CYCLE_DIGITS, _COLLOCATED_DIGITS, _COLLOCATED_FOLD_DIGITS = 40, 34, 42
_BITS = 180  # 54 digits; a period of a rotating cycle amplifies errors by less than 10^6
_HALF = _BITS // 2  # a difference quotient with the step 2^-_HALF keeps half of the bits
_QUARTER = PI * Fraction(1, 2)
_TOP = Event("top", FULL_ROTATION.function, direction=FULL_ROTATION.direction, terminal=False)


def omega_h_for(case: Case) -> Fraction:
    """Return Omega_h [rad/s], with enough digits for the distance of the case's speed from it."""
    digits = max(14, min(len(str(case.inputs["Omega"].denominator)), 90))
    return case.disk.heteroclinic(digits=digits).omega_h.value


# ----------------------------------------------------------------------------------- whole periods
def _rotates(case: Case) -> bool:
    return case.entry.kind in ("rotating-cycle", "rotation-fold")


class _Period:
    """An integration over a period with derivatives, in the paper's angles, without symmetry.

    It starts at beta = pi/2 for a librating cycle, and at gamma = -pi/2, next to the saddle, for a
    rotating one. `Disk` never starts a cycle there.

    Args:
        case: The entry in one reading.
        precision: The working precision.
        omega: The speed [rad/s].
        free: The free angle minus pi/2 [rad], and v [rad/s], at the start.
        time: The period [s].

    Raises:
        AccuracyError: If the integration ends early.
    """

    def __init__(
        self,
        case: Case,
        precision: Precision,
        omega: Fraction,
        free: Sequence[Fraction],
        time: Any,
    ) -> None:
        self.case, self.precision, self.omega, self.free = case, precision, omega, free
        angle, rotating = Exact(free[0], Fraction(1, 2)), _rotates(case)
        start = [angle, -_QUARTER, free[1]] if rotating else [_QUARTER, angle, free[1]]
        request = Request(
            case.disk,
            omega,
            start,
            time,
            precision=precision,
            divergence=True,
            domain="none",
            variations=("beta", "gamma", "v", "Omega"),
            events=(RECORDED_BETA_EXTREME, _TOP) if rotating else (RECORDED_BETA_EXTREME,),
        )
        self.result = default_engine()(request)
        if self.result.status is not Status.REACHED:
            raise AccuracyError(f"{case.entry.id}: {self.result.status.value}")
        mpf, number, state = precision.mpf, precision.number, self.result.state
        #: Derivatives of (beta, gamma, v) at the end with respect to the start and Omega.
        self.rows = [[mpf(entry) for entry in row] for row in self.result.derivatives]
        rates = vector_field(
            precision.ops, case.disk.constants_in(precision), number(omega), case.disk.friction
        )
        self.flow = [mpf(rate) for rate in rates(*state)]  #: (beta', gamma', v') at the end
        aims = [angle, PI * Fraction(3, 2), free[1]] if rotating else start
        #: The end minus the start; for a rotating cycle, gamma is first reduced by a turn. The
        #: matrix has its derivatives with respect to the free angle, v at the start, and the
        #: period.
        self.away = [mpf(end - number(aim)) for end, aim in zip(state, aims, strict=True)]
        axes = (0, 2) if rotating else (1, 2)
        self.bordered = [
            [self.rows[i][j] - (i == j) for j in axes] + [self.flow[i]] for i in range(3)
        ]

    def solved(self, rows: Any, right: Sequence[Any]) -> list[Any]:
        """Solve a linear system in the working precision."""
        ctx = self.precision.context
        return list(ctx.lu_solve(ctx.matrix(rows), ctx.matrix(list(right))))

    def beta_max(self) -> Fraction:
        """Return the largest |beta - pi/2| [rad]."""
        quarter = self.precision.number(_QUARTER)
        return max(
            fraction(abs(event.state[0] - quarter))
            for event in self.result.events
            if event.name == RECORDED_BETA_EXTREME.name
        )

    def at_top(self, change: Sequence[Any], names: tuple[str, str]) -> dict[str, Fraction]:
        """Return the state at gamma = pi/2 by name, and how it changes with the start.

        Args:
            change: A change of (beta, gamma, v, Omega) at the start.
            names: The names for the changes of beta and v at the top.
        """
        (top,) = (record for record in self.result.events if record.name == _TOP.name)
        half = _Period(self.case, self.precision, self.omega, self.free, top.time)
        moved = [sum(a * b for a, b in zip(row, change, strict=True)) for row in half.rows]
        later = -moved[1] / half.flow[1]
        return {
            "beta_bar_top": fraction(top.state[0] - self.precision.number(_QUARTER)),
            "v_top": fraction(top.state[2]),
            names[0]: fraction(moved[0] + half.flow[0] * later),
            names[1]: fraction(moved[2] + half.flow[2] * later),
        }

    def multipliers(self) -> dict[str, Fraction]:
        """Return the multipliers from the trace and the determinant of the monodromy matrix.

        The trace is 1 plus the sum of both multipliers. The integral of the divergence is the
        logarithm of the determinant. The entries that add up to the trace may be far larger than
        the multiplier; if too few digits are left, the result is empty.
        """
        ctx, divergence = self.precision.context, self.precision.mpf(self.result.divergence)
        half = (sum(self.rows[i][i] for i in range(3)) - 1) / 2  # half the sum of both multipliers
        # The fast one may be as small as 1e-50
        slow = half + ctx.sqrt(half * half - ctx.exp(divergence))
        largest = max(abs(entry) for row in self.rows for entry in row[:3])
        if fraction(largest) * self.precision.epsilon * 2**20 >= abs(fraction(slow)) / 10**36:
            return {}
        logarithm = ctx.log(abs(slow))
        numbers = {"multiplier_slow": slow, "log_multiplier_slow": logarithm}
        numbers["log_multiplier_fast"] = divergence - logarithm
        return {name: fraction(number) for name, number in numbers.items()}


def _claimed(numbers: dict[str, Fraction], values: MeasuredValues) -> MeasuredValues:
    """Return the numbers with half-widths that claim 35 digits, plus the half-widths of `values`.

    After the last Newton step only rounding is left.
    """
    return {
        name: Measured(value, abs(value) / 10**35 + values[name].uncertainty)
        for name, value in numbers.items()
    }


def whole_period(case: Case, values: MeasuredValues) -> MeasuredValues:
    """Solve for a cycle over a whole period, by two Newton steps of the bordered system.

    A librating cycle starts at beta = pi/2, a rotating one at gamma = -pi/2. The first step starts
    from `values`. The second starts on the cycle, to working accuracy, so its derivatives are the
    cycle's.

    Args:
        case: The entry in one reading.
        values: The numbers to confirm.
    """
    # k for a speed 10^-k above Omega_h: each passage amplifies errors by about 10^k.
    zeros = 0
    if case.entry.kind == "near-heteroclinic":
        above = case.inputs["Omega"] - omega_h_for(case)
        zeros = len(str(above.denominator // above.numerator))
    precision = precision_of_bits(_BITS if _rotates(case) else 220 + 8 * zeros)
    names = ("beta_bar_0" if _rotates(case) else "gamma_bar_0", "v_0", "period")
    numbers = [values[name].value for name in names]
    for _ in range(2):
        period = _Period(case, precision, case.inputs["Omega"], numbers[:2], numbers[2])
        step = period.solved(period.bordered, period.away)
        numbers = [number - fraction(part) for number, part in zip(numbers, step, strict=True)]
    by_angle, by_v, by_time = period.solved(period.bordered, [-row[3] for row in period.rows])
    results = dict(zip(names, numbers, strict=True)) | period.multipliers()
    results |= {"beta_max": period.beta_max(), "dperiod_domega": fraction(by_time)}
    if _rotates(case):
        results |= period.at_top([by_angle, 0, by_v, 1], ("dbeta_bar_top_domega", "dv_top_domega"))
    else:
        results |= {"dgamma_bar_0_domega": fraction(by_angle), "dv_0_domega": fraction(by_v)}
    return _claimed(results, values)


def fold_from_the_bottom(case: Case, values: MeasuredValues) -> MeasuredValues:
    """Solve for the fold of the rotating cycles from gamma = -pi/2, with Omega free.

    At a fold 1 is a double eigenvalue of the monodromy matrix, so its trace is 2 plus the fast
    multiplier, which Liouville's integral gives. Newton steps, with difference quotients in a wide
    arithmetic, start from the doubles nearest to `values`.

    Args:
        case: The entry in one reading.
        values: The numbers to confirm.
    """
    names, precision = ("beta_bar_0", "v_0", "period", "omega"), precision_of_bits(_BITS)
    at = [Fraction(float(values[name])) for name in names]

    def flown(beta_bar: Fraction, v: Fraction, time: Fraction, omega: Fraction) -> _Period:
        return _Period(case, precision, omega, (beta_bar, v), time)

    def conditions(period: _Period) -> list[Any]:
        trace = sum(period.rows[i][i] for i in range(3))
        return [
            *period.away,
            trace - 2 - precision.context.exp(precision.mpf(period.result.divergence)),
        ]

    for _ in range(2):
        period = flown(*at)
        defect = conditions(period)
        columns = []
        for axis in range(4):
            moved = conditions(
                flown(*(x + Fraction(n == axis, 1 << _HALF) for n, x in enumerate(at)))
            )
            columns.append([(b - a) * (1 << _HALF) for a, b in zip(defect, moved, strict=True)])
        step = period.solved([list(row) for row in zip(*columns, strict=True)], defect)
        at = [x - fraction(part) for x, part in zip(at, step, strict=True)]
    period = flown(*at)
    # At its turn the family's tangent in beta, v and the period is the null vector of the bordered
    # matrix.
    by_beta, by_rest = (
        [row[0] for row in period.bordered[:2]],
        [row[1:] for row in period.bordered[:2]],
    )
    v_change, _ = period.solved(by_rest, [-entry for entry in by_beta])
    top = period.at_top([1, 0, v_change, 0], ("beta", "v"))
    slope = top.pop("v") / top.pop("beta")
    results = {**dict(zip(names, at, strict=True)), **top, "beta_max": period.beta_max()}
    divergence = fraction(period.result.divergence)
    return _claimed(results | {"null_vector": slope, "log_multiplier_fast": divergence}, values)


# ----------------------------------------------------------------------------------- other methods
def balance(case: Case, values: MeasuredValues) -> MeasuredValues:
    """Compute a librating cycle by harmonic balance.

    Returns {} for the smooth law and close to Omega_h.
    """
    omega = case.inputs["Omega"]
    if case.disk.friction != "linear" or omega - omega_h_for(case) < _BALANCE_ABOVE:
        return {}
    cycle = collocation_cycle(case.disk, omega, digits=_COLLOCATED_CYCLE_DIGITS)
    return {name: getattr(cycle, name) for name in ("period", "gamma_bar_0", "v_0", "beta_max")}


def collocation(case: Case, values: MeasuredValues) -> MeasuredValues:
    """Compute a rotating cycle by collocation; returns {} for the smooth law."""
    if case.disk.friction != "linear":
        return {}
    stable = case.inputs["form"] == "stable"
    numbers = collocation_rotating_cycle(
        case.disk, case.inputs["Omega"], stable=stable, digits=_COLLOCATED_DIGITS
    )
    both, slow = numbers.pop("log_multipliers"), numbers["multiplier_slow"].log()
    return numbers | {"log_multiplier_slow": slow, "log_multiplier_fast": both - slow}


def fold_by_collocation(case: Case, values: MeasuredValues) -> MeasuredValues:
    """Compute the fold of the rotating cycles by collocation; returns {} for the smooth law."""
    if case.disk.friction != "linear":
        return {}
    return collocation_fold(case.disk, digits=_COLLOCATED_FOLD_DIGITS)


def scipy(case: Case, values: MeasuredValues) -> MeasuredValues:
    """Compute a cycle by shooting with SciPy in double precision.

    The method claims nine digits; the data record its distance from the value.
    """
    point = shoot_known_cycle(case, values, ScipyEngine())
    if case.entry.kind == "rotating-cycle":
        numbers = {
            "period": point.image.time,
            "beta_bar_top": point.point[0],
            "v_top": point.point[1],
        }
    else:
        slopes = point.image.slopes("speed")
        numbers = {
            "period": 2 * point.image.time,
            "gamma_bar_0": point.point[0],
            "v_0": point.point[1],
            "dperiod_domega": 2 * slopes[3],
            "dgamma_bar_0_domega": slopes[0],
            "dv_0_domega": slopes[1],
        }
    return {name: Measured.of(value, abs(value) * 1e-9 + 1e-12) for name, value in numbers.items()}


def fold_by_scipy(case: Case, values: MeasuredValues) -> MeasuredValues:
    """Compute the fold of the rotating cycles with SciPy in double precision.

    The method claims seven digits; the data record its distance from the value.
    """
    names = ("beta_bar_top", "v_top", "omega")
    beta_bar, v, omega = (float(values[name]) for name in names)
    at, _ = fold_near(ROTATING, case.disk, (beta_bar, v, omega), ScipyEngine())
    return {
        name: Measured.of(value, abs(value) * 1e-7) for name, value in zip(names, at, strict=True)
    }
