"""Roads to rotating limit cycles and to their fold."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple

from tippedisk_verify.atlas.cycles_at_speed import rotating_cycle
from tippedisk_verify.atlas.locator import locator
from tippedisk_verify.cycles.error_budget import cycle_numbers
from tippedisk_verify.cycles.folds import RotationFold, fold_near, fold_to_digits, rotation_fold
from tippedisk_verify.cycles.return_map import FixedPoint, ReturnMap
from tippedisk_verify.cycles.section import EXTREME, ROTATING, ROUND
from tippedisk_verify.cycles.shooting import shoot
from tippedisk_verify.cycles.spectral import spectral_fold, spectral_rotation
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.baseline import Baseline
from tippedisk_verify.flow.contract import Event, Result
from tippedisk_verify.model.equations import field
from tippedisk_verify.model.exact import PI, Exact, fraction
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.precision import DOUBLE, bits
from tippedisk_verify.reference_values.cycle_roads import period_from, period_multipliers
from tippedisk_verify.reference_values.entries import Case, Method, Values
from tippedisk_verify.reference_values.local_roads import by_differences

__all__ = ["FOLD", "ROTATION", "fold_condition", "rotation_condition", "rotation_unit"]

_DIGITS = 36
# Digits asked of the collocation; the state at the top has some fewer, the null vector ten fewer, but 30 at least.
_COLLOCATED, _COLLOCATED_FOLD = 34, 42
_NAMES = (
    *("period", "beta_bar_0", "v_0", "beta_bar_top", "v_top", "beta_max"),
    *("multiplier_slow", "log_multiplier_slow", "log_multiplier_fast"),
    *("dperiod_domega", "dbeta_bar_top_domega", "dv_top_domega"),
)
_FOLD_NAMES = (
    *("omega", "period", "beta_bar_0", "v_0", "beta_bar_top", "v_top", "beta_max"),
    *("null_vector", "log_multiplier_fast"),
)
_UNITS = {
    "omega": "rad/s", "period": "s", "beta_bar_0": "rad", "v_0": "rad/s", "beta_bar_top": "rad", "v_top": "rad/s",
    "beta_max": "rad", "dperiod_domega": "s^2/rad", "dbeta_bar_top_domega": "s", "null_vector": "1/s",
}  # fmt: skip
_BITS = 180  # 54 digits; a period of these cycles amplifies errors by less than 10^6
_HALF = _BITS // 2  # differences by 2^-_HALF leave a derivative the other half of the bits
_TOP = Event("top", ROUND.function, direction=ROUND.direction, terminal=False)


def rotation_unit(quantity: str) -> str:
    return _UNITS.get(quantity, "1")


# ------------------------------------------------------------------------------------------ rotating cycles
def _shooting(case: Case, known: Values) -> Values:
    stable = case.inputs["form"] == "stable"
    cycle = rotating_cycle(case.parameters, case.inputs["Omega"], default_engine(), stable=stable, digits=_DIGITS)
    return {name: getattr(cycle, name) for name in _NAMES}


class _Turn(NamedTuple):
    """A flight for a given time from gamma = -pi/2, where the first road never starts, in the paper's angles."""

    result: Result
    rows: list[list[Any]]  #: derivatives of (beta, gamma, v) by (beta, gamma, v, Omega)
    flow: list[Any]  #: (beta', gamma', v') at its end
    away: list[Any]  #: the end less the start, gamma by a turn less

    @property
    def bordered(self) -> list[list[Any]]:
        """Derivatives of ``away`` by beta and v at the start, and by the period."""
        return [[self.rows[i][j] - (i == j) for j in (0, 2)] + [self.flow[i]] for i in range(3)]


class _Turns:
    """Turns of one disk."""

    def __init__(self, case: Case) -> None:
        self.case, self.precision = case, bits(_BITS)
        self.ctx = self.precision.context

    def __call__(self, omega: Fraction, beta_bar: Fraction, v: Fraction, time: Any) -> _Turn:
        start = [Exact(beta_bar, Fraction(1, 2)), PI * Fraction(-1, 2), v]
        result = period_from(self.case, omega, start, time, self.precision, (EXTREME, _TOP))
        mpf, number = self.precision.mpf, self.precision.number
        rates = field(self.precision.ops, self.case.parameters.at(self.precision), number(omega), self.case.friction)
        round_ = [start[0], PI * Fraction(3, 2), v]
        return _Turn(
            result,
            [[mpf(entry) for entry in row] for row in result.derivatives],
            [mpf(rate) for rate in rates(*result.state)],
            [mpf(end - number(begin)) for begin, end in zip(round_, result.state, strict=True)],
        )

    def solved(self, rows: Any, right: Sequence[Any]) -> list[Any]:
        return list(self.ctx.lu_solve(self.ctx.matrix(rows), self.ctx.matrix(list(right))))

    def carried_up(
        self, omega: Fraction, state: tuple[Fraction, Fraction], time: Any, change: Sequence[Any]
    ) -> list[Any]:
        """Change of (beta, v) at gamma = pi/2 for one of (beta, gamma, v, Omega) at the start; ``time`` leads there."""
        half = self(omega, *state, time)
        moved = [sum(a * b for a, b in zip(row, change, strict=True)) for row in half.rows]
        later = -moved[1] / half.flow[1]
        return [moved[axis] + half.flow[axis] * later for axis in (0, 2)]

    def measures(self, result: Result) -> dict[str, Fraction]:
        """The largest lean, and the state at gamma = pi/2."""
        quarter = self.precision.number(PI * Fraction(1, 2))
        leans = [record.state[0] - quarter for record in result.events if record.name == EXTREME.name]
        top = _at_top(result)
        numbers = {"beta_max": max(leans), "beta_bar_top": top.state[0] - quarter, "v_top": top.state[2]}
        return {name: fraction(value) for name, value in numbers.items()}


def _at_top(result: Result) -> Any:
    (top,) = (record for record in result.events if record.name == _TOP.name)
    return top


def _claimed(numbers: dict[str, Fraction], known: Values) -> Values:
    """All steps done, what is left is rounding; 35 digits are claimed."""
    return {name: Measured(value, abs(value) / 10**35 + known[name].uncertainty) for name, value in numbers.items()}


def _from_the_bottom(case: Case, known: Values) -> Values:
    """From gamma = -pi/2 next to the saddle, for a period in the paper's angles: Newton steps of the bordered system.

    The orbit is followed from the values to confirm, and once more from where the first step leads, so that the
    derivatives are those on the cycle.
    """
    turns, omega = _Turns(case), case.inputs["Omega"]
    beta_bar, v, period = (known[name].value for name in ("beta_bar_0", "v_0", "period"))
    for _ in range(2):
        turn = turns(omega, beta_bar, v, period)
        step = turns.solved(turn.bordered, turn.away)
        beta_bar, v, period = (x - fraction(part) for x, part in zip((beta_bar, v, period), step, strict=True))
    slope = turns.solved(turn.bordered, [-row[3] for row in turn.rows])
    change = [slope[0], 0, slope[1], 1]
    top = turns.carried_up(omega, (beta_bar, v), _at_top(turn.result).time, change)
    numbers = {
        "period": period,
        "beta_bar_0": beta_bar,
        "v_0": v,
        **turns.measures(turn.result),
        "dperiod_domega": fraction(slope[2]),
        "dbeta_bar_top_domega": fraction(top[0]),
        "dv_top_domega": fraction(top[1]),
        **period_multipliers(turn.rows, turns.precision.mpf(turn.result.divergence), turns.precision),
    }
    return _claimed(numbers, known)


def _collocation(case: Case, known: Values) -> Values:
    if case.friction != "linear":
        return {}
    stable = case.inputs["form"] == "stable"
    cycle = spectral_rotation(case.parameters, case.inputs["Omega"], stable=stable, digits=_COLLOCATED)
    numbers = {name: getattr(cycle, name) for name in ("period", "beta_bar_top", "v_top", "multiplier_slow")}
    slow = cycle.multiplier_slow.log()
    return numbers | {"log_multiplier_slow": slow, "log_multiplier_fast": cycle.log_multipliers - slow}


def _in_double(case: Case, known: Values, engine: Any) -> dict[str, float]:
    """The cycle's numbers by shooting in double from the known ones."""
    numbers = cycle_numbers(_shot(case, known, engine), DOUBLE)
    return {name: float(numbers[name]) for name in _NAMES}


def _shot(case: Case, known: Values, engine: Any) -> FixedPoint[Any]:
    return_map = ReturnMap(ROTATING, case.parameters, case.inputs["Omega"], engine)
    return shoot(return_map, (float(known["beta_bar_top"]), float(known["v_top"])))


def _scipy(case: Case, known: Values) -> Values:
    """Shooting with another integrator, in double; its nine digits are a claim, the distance is on record."""
    fixed_point = _shot(case, known, Baseline())
    beta_bar, v = fixed_point.point
    numbers = {"period": fixed_point.image.time, "beta_bar_top": beta_bar, "v_top": v}
    return {name: Measured.of(value, abs(value) * 1e-9 + 1e-12) for name, value in numbers.items()}


def rotation_condition(case: Case, values: Values) -> dict[str, dict[str, Any]]:
    """By shooting in double for parameters moved by 1e-8: the fold moves by 1e-6 at most."""
    return by_differences(lambda moved: _in_double(moved, values, default_engine()), Fraction(1, 10**8))(case, values)


ROTATION = (
    Method("shooting", "turns of gamma from gamma = pi/2 with heyoka on MPFR numbers, error seen in a wider arithmetic",
           _shooting),
    Method("bottom", "the whole period from gamma = -pi/2 in the paper's angles with its derivatives",
           _from_the_bottom),
    Method("collocation", "spectral collocation of the full equations, no integrator, mpmath", _collocation, True),
    Method("scipy", "turns of gamma with SciPy's DOP853 in double; confirms what double holds", _scipy, True),
)  # fmt: skip


# ------------------------------------------------------------------------------------------ their fold
def _fold_by_shooting(case: Case, known: Values) -> Values:
    fold = rotation_fold(locator(case.parameters, default_engine()).rotations, digits=_DIGITS)
    return {name: getattr(fold, name) for name in _FOLD_NAMES}


def _fold_from_the_bottom(case: Case, known: Values) -> Values:
    """Periods from gamma = -pi/2 in the paper's angles, Omega free: 1 is a double eigenvalue of the monodromy matrix.

    Its trace is then 2 and the fast multiplier, which Liouville's integral gives. Newton steps with differences in a
    wide arithmetic lead on from the doubles nearest to the values to confirm.
    """
    turns = _Turns(case)
    ctx, mpf = turns.ctx, turns.precision.mpf
    at = [Fraction(float(known[name])) for name in ("beta_bar_0", "v_0", "period", "omega")]

    def conditions(turn: _Turn) -> list[Any]:
        trace = sum(turn.rows[i][i] for i in range(3))
        return [*turn.away, trace - 2 - ctx.exp(mpf(turn.result.divergence))]

    def turned(beta_bar: Fraction, v: Fraction, period: Fraction, omega: Fraction) -> _Turn:
        return turns(omega, beta_bar, v, period)

    for _ in range(2):
        here = conditions(turned(*at))
        columns = []
        for axis in range(4):
            beside = conditions(turned(*(x + Fraction(n == axis, 1 << _HALF) for n, x in enumerate(at))))
            columns.append([(b - a) * (1 << _HALF) for a, b in zip(here, beside, strict=True)])
        step = turns.solved([list(row) for row in zip(*columns, strict=True)], here)
        at = [x - fraction(part) for x, part in zip(at, step, strict=True)]
    turn = turned(*at)
    # Along the family at its turn beta, v and the period at the start change as the null vector of the bordered matrix.
    by_beta, by_rest = [row[0] for row in turn.bordered[:2]], [row[1:] for row in turn.bordered[:2]]
    v_change, _ = turns.solved(by_rest, [-entry for entry in by_beta])
    top = turns.carried_up(at[3], (at[0], at[1]), _at_top(turn.result).time, [1, 0, v_change, 0])
    numbers = {
        **dict(zip(("beta_bar_0", "v_0", "period", "omega"), at, strict=True)),
        **turns.measures(turn.result),
        "null_vector": fraction(top[1] / top[0]),
        "log_multiplier_fast": fraction(turn.result.divergence),
    }
    return _claimed(numbers, known)


def _fold_by_collocation(case: Case, known: Values) -> Values:
    if case.friction != "linear":
        return {}
    fold = spectral_fold(case.parameters, digits=_COLLOCATED_FOLD)
    numbers = {name: getattr(fold, name) for name in ("omega", "period", "null_vector")}
    return numbers | {"beta_bar_top": fold.angle, "v_top": fold.v}


def _fold_by_scipy(case: Case, known: Values) -> Values:
    """With another integrator, in double: its seven digits are a claim, the distance is on record."""
    beta_bar, v, omega = (float(known[name]) for name in ("beta_bar_top", "v_top", "omega"))
    at, _ = fold_near(ROTATING, case.parameters, (beta_bar, v, omega), Baseline())
    numbers = dict(zip(("beta_bar_top", "v_top", "omega"), at, strict=True))
    return {name: Measured.of(value, abs(value) * 1e-7) for name, value in numbers.items()}


def fold_condition(case: Case, values: Values) -> dict[str, dict[str, Any]]:
    """By the fold to 12 digits and more for parameters moved by 1e-8, from the same start."""

    place = locator(case.parameters, default_engine()).rotations.near_fold()
    near = (*place.start, place.omega)

    def plain(moved: Case) -> dict[str, Any]:
        fold = fold_to_digits(RotationFold, moved.parameters, near, default_engine(), 12)
        return {name: getattr(fold, name).value for name in _FOLD_NAMES}

    return by_differences(plain, Fraction(1, 10**8))(case, values)


FOLD = (
    Method("shooting", "fixed point of the turn map and of its derivative at gamma = pi/2, with heyoka on MPFR numbers",
           _fold_by_shooting),
    Method("bottom", "a double eigenvalue 1 of the monodromy matrix from gamma = -pi/2, by its trace, from doubles on",
           _fold_from_the_bottom),
    Method("collocation", "spectral collocation of the cycle and its null vector, no integrator, mpmath",
           _fold_by_collocation, True),
    Method("scipy", "the first road with SciPy's DOP853 in double; confirms what double holds", _fold_by_scipy, True),
)  # fmt: skip
