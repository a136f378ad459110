"""Further methods for limit cycles, their folds and Omega_h, beside those of `Disk`."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from tippedisk_verify.cycles.folds import fold_near
from tippedisk_verify.cycles.section import EXTREME, ROTATING, ROUND
from tippedisk_verify.cycles.spectral import balanced_cycle, spectral_fold, spectral_rotation
from tippedisk_verify.errors import AccuracyError
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.baseline import Baseline
from tippedisk_verify.flow.contract import Event, Request, Status
from tippedisk_verify.model.equations import field
from tippedisk_verify.model.exact import PI, Exact, fraction
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.precision import Precision, bits
from tippedisk_verify.reference_values.entries import Case, Values
from tippedisk_verify.reference_values.truths import shot

__all__ = [
    *("balance", "collocation", "fold_by_collocation", "fold_by_scipy", "fold_from_the_bottom", "omega_h_for"),
    *("scipy", "whole_period"),
]

_BALANCE_ABOVE = Fraction(1, 20)  # rad/s above Omega_h: closer, harmonic balance needs hundreds of harmonics
# Digits asked of the collocation; the state at the top has some fewer, the null vector ten fewer, but 30 at least.
_BALANCED, _COLLOCATED, _COLLOCATED_FOLD = 40, 34, 42
_BITS = 180  # 54 digits; a period of rotating cycles amplifies errors by less than 10^6
_HALF = _BITS // 2  # differences by 2^-_HALF leave a derivative the other half of the bits
_QUARTER = PI * Fraction(1, 2)
_TOP = Event("top", ROUND.function, direction=ROUND.direction, terminal=False)


def omega_h_for(case: Case) -> Fraction:
    """To enough digits to know how far from it a speed written with so many decimals lies."""
    digits = max(14, min(len(str(case.inputs["Omega"].denominator)), 90))
    return case.disk.heteroclinic(digits=digits).omega_h.value


# ------------------------------------------------------------------------------------------ whole periods
def _rotates(case: Case) -> bool:
    return case.item.kind in ("rotating-cycle", "rotation-fold")


class _Period:
    """A flight for a whole period, in the paper's angles and without the symmetry, with its derivatives.

    It starts at beta = pi/2 (librating cycles) or at gamma = -pi/2 next to the saddle (rotating ones), where `Disk`
    never starts them; ``free`` are the other angle less pi/2, and v. Raises AccuracyError if the flight ends early.
    """

    def __init__(self, case: Case, precision: Precision, omega: Fraction, free: Sequence[Fraction], time: Any) -> None:
        self.case, self.precision, self.omega, self.free = case, precision, omega, free
        angle, rotating = Exact(free[0], Fraction(1, 2)), _rotates(case)
        start = [angle, -_QUARTER, free[1]] if rotating else [_QUARTER, angle, free[1]]
        request = Request(
            case.disk, omega, start, time, precision=precision, divergence=True, domain="none",
            variations=("beta", "gamma", "v", "Omega"), events=(EXTREME, _TOP) if rotating else (EXTREME,),
        )  # fmt: skip
        self.result = default_engine()(request)
        if self.result.status is not Status.REACHED:
            raise AccuracyError(f"{case.item.id}: {self.result.status.value}")
        mpf, number, state = precision.mpf, precision.number, self.result.state
        #: Derivatives of (beta, gamma, v) at the end by (beta, gamma, v, Omega).
        self.rows = [[mpf(entry) for entry in row] for row in self.result.derivatives]
        rates = field(precision.ops, case.disk.at(precision), number(omega), case.disk.friction)
        self.flow = [mpf(rate) for rate in rates(*state)]  #: (beta', gamma', v') at the end
        aims = [angle, PI * Fraction(3, 2), free[1]] if rotating else start
        #: The end less the start, of rotating cycles gamma by a turn less; and its derivatives by the free angle and v
        #: at the start, and by the period.
        self.away = [mpf(end - number(aim)) for end, aim in zip(state, aims, strict=True)]
        axes = (0, 2) if rotating else (1, 2)
        self.bordered = [[self.rows[i][j] - (i == j) for j in axes] + [self.flow[i]] for i in range(3)]

    def solved(self, rows: Any, right: Sequence[Any]) -> list[Any]:
        ctx = self.precision.context
        return list(ctx.lu_solve(ctx.matrix(rows), ctx.matrix(list(right))))

    def beta_max(self) -> Fraction:
        quarter = self.precision.number(_QUARTER)
        return max(fraction(abs(one.state[0] - quarter)) for one in self.result.events if one.name == EXTREME.name)

    def at_top(self, change: Sequence[Any], names: tuple[str, str]) -> dict[str, Fraction]:
        """The state at gamma = pi/2, and by these names its change for one of (beta, gamma, v, Omega) at the start."""
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
        """From the monodromy matrix, whose trace they are with 1, and its determinant's logarithm.

        The trace is a sum of entries that may be far larger than the multiplier: nothing is said where too few digits
        are left.
        """
        ctx, divergence = self.precision.context, self.precision.mpf(self.result.divergence)
        half = (sum(self.rows[i][i] for i in range(3)) - 1) / 2  # of the sum of both
        slow = half + ctx.sqrt(half * half - ctx.exp(divergence))  # the fast one may be as small as 1e-50
        largest = max(abs(entry) for row in self.rows for entry in row[:3])
        if fraction(largest) * self.precision.epsilon * 2**20 >= abs(fraction(slow)) / 10**36:
            return {}
        logarithm = ctx.log(abs(slow))
        numbers = {"multiplier_slow": slow, "log_multiplier_slow": logarithm}
        numbers["log_multiplier_fast"] = divergence - logarithm
        return {name: fraction(number) for name, number in numbers.items()}


def _claimed(numbers: dict[str, Fraction], values: Values) -> Values:
    """All steps done, what is left is rounding; 35 digits are claimed."""
    return {name: Measured(value, abs(value) / 10**35 + values[name].uncertainty) for name, value in numbers.items()}


def whole_period(case: Case, values: Values) -> Values:
    """A librating cycle from beta = pi/2, a rotating one from gamma = -pi/2: Newton steps of the bordered system.

    The first leads on from ``values``; where the second starts, the derivatives are those on the cycle.
    """
    zeros = 0  # k for a speed 10^-k above Omega_h: each passage amplifies errors by about the inverse of the distance
    if case.item.kind == "near-heteroclinic":
        above = case.inputs["Omega"] - omega_h_for(case)
        zeros = len(str(above.denominator // above.numerator))
    precision = bits(_BITS if _rotates(case) else 220 + 8 * zeros)
    names = ("beta_bar_0" if _rotates(case) else "gamma_bar_0", "v_0", "period")
    numbers = [values[name].value for name in names]
    for _ in range(2):
        period = _Period(case, precision, case.inputs["Omega"], numbers[:2], numbers[2])
        step = period.solved(period.bordered, period.away)
        numbers = [number - fraction(part) for number, part in zip(numbers, step, strict=True)]
    by_angle, by_v, by_time = period.solved(period.bordered, [-row[3] for row in period.rows])
    found = dict(zip(names, numbers, strict=True)) | {"beta_max": period.beta_max()} | period.multipliers()
    found |= {"dperiod_domega": fraction(by_time)}
    if _rotates(case):
        found |= period.at_top([by_angle, 0, by_v, 1], ("dbeta_bar_top_domega", "dv_top_domega"))
    else:
        found |= {"dgamma_bar_0_domega": fraction(by_angle), "dv_0_domega": fraction(by_v)}
    return _claimed(found, values)


def fold_from_the_bottom(case: Case, values: Values) -> Values:
    """From gamma = -pi/2, Omega free: 1 is a double eigenvalue of the monodromy matrix.

    Its trace is then 2 and the fast multiplier, which Liouville's integral gives. Newton steps with differences in a
    wide arithmetic lead on from the doubles nearest to the values to confirm.
    """
    names, precision = ("beta_bar_0", "v_0", "period", "omega"), bits(_BITS)
    at = [Fraction(float(values[name])) for name in names]

    def flown(beta_bar: Fraction, v: Fraction, time: Fraction, omega: Fraction) -> _Period:
        return _Period(case, precision, omega, (beta_bar, v), time)

    def conditions(period: _Period) -> list[Any]:
        trace = sum(period.rows[i][i] for i in range(3))
        return [*period.away, trace - 2 - precision.context.exp(precision.mpf(period.result.divergence))]

    for _ in range(2):
        period = flown(*at)
        defect = conditions(period)
        columns = []
        for axis in range(4):
            beside = conditions(flown(*(x + Fraction(n == axis, 1 << _HALF) for n, x in enumerate(at))))
            columns.append([(b - a) * (1 << _HALF) for a, b in zip(defect, beside, strict=True)])
        step = period.solved([list(row) for row in zip(*columns, strict=True)], defect)
        at = [x - fraction(part) for x, part in zip(at, step, strict=True)]
    period = flown(*at)
    # Along the family at its turn beta, v and the period at the start change as the null vector of the bordered matrix.
    by_beta, by_rest = [row[0] for row in period.bordered[:2]], [row[1:] for row in period.bordered[:2]]
    v_change, _ = period.solved(by_rest, [-entry for entry in by_beta])
    top = period.at_top([1, 0, v_change, 0], ("beta", "v"))
    slope = top.pop("v") / top.pop("beta")
    found = {**dict(zip(names, at, strict=True)), **top, "beta_max": period.beta_max()}
    divergence = fraction(period.result.divergence)
    return _claimed(found | {"null_vector": slope, "log_multiplier_fast": divergence}, values)


# ------------------------------------------------------------------------------------------ without this integrator
def _attributes(result: Any, *names: str) -> Values:
    return {name: getattr(result, name) for name in names}


def balance(case: Case, values: Values) -> Values:
    omega = case.inputs["Omega"]
    if case.disk.friction != "linear" or omega - omega_h_for(case) < _BALANCE_ABOVE:
        return {}
    cycle = balanced_cycle(case.disk, omega, digits=_BALANCED)
    return _attributes(cycle, "period", "gamma_bar_0", "v_0", "beta_max")


def collocation(case: Case, values: Values) -> Values:
    if case.disk.friction != "linear":
        return {}
    stable = case.inputs["form"] == "stable"
    cycle = spectral_rotation(case.disk, case.inputs["Omega"], stable=stable, digits=_COLLOCATED)
    slow = cycle.multiplier_slow.log()
    numbers = _attributes(cycle, "period", "beta_bar_top", "v_top", "multiplier_slow")
    return numbers | {"log_multiplier_slow": slow, "log_multiplier_fast": cycle.log_multipliers - slow}


def fold_by_collocation(case: Case, values: Values) -> Values:
    if case.disk.friction != "linear":
        return {}
    fold = spectral_fold(case.disk, digits=_COLLOCATED_FOLD)
    return _attributes(fold, "omega", "period", "null_vector") | {"beta_bar_top": fold.angle, "v_top": fold.v}


def scipy(case: Case, values: Values) -> Values:
    """Shooting with another integrator, in double; its nine digits are a claim, the distance is on record."""
    point = shot(case, values, Baseline())
    if case.item.kind == "rotating-cycle":
        numbers = {"period": point.image.time, "beta_bar_top": point.point[0], "v_top": point.point[1]}
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


def fold_by_scipy(case: Case, values: Values) -> Values:
    """In double; its seven digits are a claim, the distance is on record."""
    names = ("beta_bar_top", "v_top", "omega")
    beta_bar, v, omega = (float(values[name]) for name in names)
    at, _ = fold_near(ROTATING, case.disk, (beta_bar, v, omega), Baseline())
    return {name: Measured.of(value, abs(value) * 1e-7) for name, value in zip(names, at, strict=True)}
