"""Which integrator's errors the answers have: methods with a fixed step, and SciPy's at a tolerance.

The right equations are integrated by each method from the starts that were asked for to the first samples, with shorter
and shorter steps. A method is named if it gives the answers' errors, not only the answers: nothing else has them.
"""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from statistics import median
from typing import Any

import numpy

from tippedisk_verify.conformance.diagnosis.alternatives import Alternative
from tippedisk_verify.conformance.diagnosis.flights import Array, field, flown
from tippedisk_verify.conformance.diagnosis.predictions import Model
from tippedisk_verify.conformance.diagnosis.shapes import Found
from tippedisk_verify.conformance.diagnosis.steps import MEMORY, METHODS, flights
from tippedisk_verify.conformance.grading import Grade, as_decimal
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["fixed_steps", "integrator_of", "tolerances"]

_STATE = ("beta", "gamma", "v")
_EXACTLY = 1e-4  # of the errors: what rounding leaves of them
_ALIKE = 0.02  # of the errors: what a method may leave of them
_MOST = 10_000  # steps of a flight
_MANY = 2000  # of methods of one evaluation a step
_FEW = 500  # steps where a step is dear, or of high order
_WORTH = 5.0  # times: errors that are so much smaller than the answers' need no shorter step
_SLOW = 1.2  # the reciprocal of the least order that is believed
_NEAR = 10.0  # times; errors at another absolute tolerance than the relative one are no further off
_UNLIKE = 0.4  # of the orbits
_SAME = 1e-3  # of the errors: what rounding leaves of them where the tolerances are the same
_WASTED = 1e-4  # a relative tolerance of that share of the errors is too small to make them
_TIGHT = (1e-13, 1e-12, 1e-10)  # relative tolerances beside which a loose absolute one counts alone
_LOST = 1.0  # rad, rad/s; a method that is further off is unstable
_LEAST = 2  # orbits
_LONGEST = 0.05  # s, of a step
_EXACT = 2.5e-4  # s, of a step of RK4 that leaves some 1e-10
_DURATION = 10.0  # s, that a solver is told
_ENDS = (8.0, 10.5, 11.0, 12.0, 15.0, 20.0)  # s, that it may be told as well
_OUTPUTS = (0.01, 0.0, 0.1, 0.05, 0.02, 5e-3, 2e-3, 1e-3, 5e-4, 1e-4)  # s, to the first output; 0: the sample
_RELATIVE = (1e-3, *(10.0**-k for k in range(2, 11) if k != 3), 1.49012e-8)  # and odeint's own
_TINY = 1e-7
_COUNTS = (10, 20, 25, 40, 50, 80, 100, 125, 200, 250, 400, 500, 800, 1000, 1250, 2000, 2500, 5000, 10_000)
_QUICK = ("explicit Euler", "the midpoint rule", "Heun's method", "semi-implicit Euler, v first")


def integrator_of(usable: Sequence[Grade], wrong: set[str], store: Store) -> Found | None:
    """The integrator whose errors all orbits have, where samples are wrong."""
    here, answers = [store[grade.id] for grade in usable], {grade.id: as_decimal(grade.answer) for grade in usable}
    samples = frozenset(id_ for id_ in wrong if "@" in id_)
    text = fixed_steps(here, answers) or tolerances(here, answers) if samples else None
    return ((("integrator", f"the integrator's errors: {text}"),), samples) if text else None


def fixed_steps(here: Sequence[Quantity], answers: Mapping[str, Decimal]) -> str | None:
    """The method and its step that give the errors of the first samples of all orbits, if one does."""
    starts, speeds, errors, time = _firsts(here, answers)
    if len(speeds) < _LEAST:
        return None
    f, size = field(here[0].set, here[0].friction, speeds), float(abs(errors).max())
    exact = flown(f, starts, time, round(time / _EXACT))

    def left(made: Array) -> float:
        return float((numpy.linalg.norm(made - errors, axis=0) / numpy.linalg.norm(errors, axis=0)).max())

    like: list[tuple[float, str]] = []
    for name in (*METHODS, *MEMORY):
        last, before, wanted = math.inf, 0.0, 0.0
        for count in (count for count in _COUNTS if time / count < _LONGEST):
            if count < wanted / _WORTH:
                continue
            if max(wanted / _WORTH, count) > (_MOST if name in _QUICK else _MANY if name in MEMORY else _FEW):
                break
            made = flights(name, f, starts, time, round(count)) - exact
            if not (off := float(abs(made).max())) < _LOST:
                continue
            if left(made) <= _ALIKE:
                step = f"at a fixed step of {1000 * time / count:.6g} ms"
                if left(made) <= _EXACTLY:
                    others = (other for other in METHODS if other != name)
                    same = [
                        one for one in others if left(flights(one, f, starts, time, round(count)) - exact) <= _EXACTLY
                    ]
                    return f"too long a step, {' or '.join([name, *same])} {step}"
                like.append((left(made), f"{name} has them {step}"))
            if off < size / _WORTH:
                break
            if off < last < _LOST:  # by the order that the last two steps show
                wanted = count * (off / size) ** min(math.log(count / before) / math.log(last / off), _SLOW)
            last, before = off, count
    if like:
        return f"too long a step, or a slip in the method: nearly as {min(like)[1]}, to {100 * min(like)[0]:.1g} %"
    return None


def _firsts(here: Sequence[Quantity], answers: Mapping[str, Decimal]) -> tuple[Array, Array, Array, float]:
    """Starts, speeds and the errors of the first sample of each orbit, in columns, and their time."""
    orbits: dict[str, dict[str, Quantity]] = {}
    for quantity in here:
        if "@" in quantity.name:
            orbits.setdefault(quantity.id.rsplit("/", 1)[0], {})[quantity.name] = quantity
    first = min((float(name.split("@")[1]) for orbit in orbits.values() for name in orbit), default=math.nan)
    whole = [[orbit.get(f"{name}@{first:g}") for name in _STATE] for orbit in orbits.values()]
    columns = [[quantity for quantity in three if quantity is not None] for three in whole]
    columns = [three for three in columns if len(three) == len(_STATE)]
    starts = numpy.array([[float(three[0].inputs[name]) for name in _STATE] for three in columns]).T
    speeds = numpy.array([float(three[0].inputs["Omega"]) for three in columns])
    errors = numpy.array([[float(answers[q.id]) - q.for_doubles for q in three] for three in columns]).T
    return starts, speeds, errors, first


@dataclass(frozen=True)
class _Solver:
    """One of SciPy's, and the runs that it may have been used in: first steps and last ones depend on them."""

    name: str
    #: (rates, start, time of the sample, relative and absolute tolerance, run) -> state there
    state: Callable[[Any, Array, float, float, float, float], Array]
    runs: tuple[float, ...]  #: s: to the end of the run, or to its first output; 0 stands for the sample asked for


def _classes(name: str) -> Callable[[Any, Array, float, float, float, float], Array]:
    """A class behind `solve_ivp`; ``run`` is the end that it is told."""

    def state(rates: Any, start: Array, time: float, relative: float, absolute: float, run: float) -> Array:
        from scipy import integrate

        solver = getattr(integrate, name)(rates, 0.0, start, run or time, rtol=relative, atol=absolute)
        while solver.status == "running" and solver.t < time:
            solver.step()
        return numpy.asarray(solver.dense_output()(time)) if solver.status != "failed" else start * math.nan

    return state


def _odeint(rates: Any, start: Array, time: float, relative: float, absolute: float, run: float) -> Array:
    """LSODA, whose first step depends on the first output time ``run``."""
    from scipy.integrate import odeint

    times = [0.0, run, time] if 0 < run < time else [0.0, time]
    return numpy.asarray(odeint(rates, start, times, rtol=relative, atol=absolute, tfirst=True)[-1])


_SOLVERS = (
    _Solver("LSODA (odeint or solve_ivp)", _odeint, _OUTPUTS),
    *(_Solver(name, _classes(name), (_DURATION, 0.0)) for name in ("RK45", "RK23")),
    _Solver("LSODA (odeint or solve_ivp)", _classes("LSODA"), (_DURATION, 0.0, *_ENDS)),
    *(_Solver(name, _classes(name), (_DURATION, 0.0)) for name in ("BDF", "Radau", "DOP853")),
)


def tolerances(here: Sequence[Quantity], answers: Mapping[str, Decimal]) -> str | None:
    """The method of SciPy and the tolerances that give the errors of the first samples of all orbits, if some do."""
    starts, speeds, errors, time = _firsts(here, answers)
    if len(speeds) < _LEAST:
        return None
    sizes = numpy.linalg.norm(errors, axis=0)
    order = numpy.argsort(sizes)[::-1]
    exact = flown(field(here[0].set, here[0].friction, speeds), starts, time, round(time / _EXACT))
    model = Model(Alternative("", ""), here[0].set, here[0].friction)

    def left(solver: _Solver, lane: int, relative: float, absolute: float, run: float) -> tuple[float, float]:
        """How far from one orbit's errors, relatively, and how many times as large or as small as they are."""
        rates = model.rates(speeds[lane], starts[:, lane].tolist())
        made = solver.state(rates, starts[:, lane], time, relative, absolute, run) - exact[:, lane]
        size, mine = (
            max(float(x), _TINY**2) for x in (sizes[lane], numpy.nan_to_num(numpy.linalg.norm(made), nan=1e9))
        )
        return float(numpy.linalg.norm(made - errors[:, lane])) / size, max(mine / size, size / mine)

    def fits(solver: _Solver, *tolerances: float) -> float:
        """How far from the errors of half of the orbits, if they are alike on most: rounding may turn a step down."""
        lefts: list[float] = []
        for lane in order:
            off, times = left(solver, lane, *tolerances)
            lefts.append(off)
            unlike = sum(not off <= _ALIKE for off in lefts)
            if times > _NEAR or unlike > _UNLIKE * len(order) or unlike == len(lefts) == _LEAST:
                return math.inf
        return median(lefts)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of solvers that give up
        hopeful = [relative for relative in _RELATIVE if relative > _WASTED * sizes.max()]
        for solver, relative in itertools.product(_SOLVERS, hopeful):
            if left(solver, order[0], relative, relative, solver.runs[0])[1] > _NEAR:
                continue
            others = (relative, 1e-6, *(relative * 10.0**k for k in (-1, -2, -3, -4, 1, 2)), 1e-8, 1e-9, 1e-10, 1e-12)
            absolutes = dict.fromkeys(float(f"{absolute:.6g}") for absolute in others)
            pairs = [*((relative, absolute) for absolute in absolutes), *((tight, relative) for tight in _TIGHT)]
            tried = itertools.product(pairs, solver.runs)
            best, pair = min((fits(solver, *pair, run), pair) for pair, run in tried)
            if best < _ALIKE:
                about = "about " * (best > _SAME)
                told = f"{about if pair[0] in _TIGHT else ''}{pair[0]:g}, {about}atol = {pair[1]:g}"
                return f"a loose tolerance, SciPy's {solver.name} at rtol = {told}"
    return None
