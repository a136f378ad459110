"""Run time against error: the paper's 801 limit cycles, solved together and by what others would use.

Seconds are per cycle, medians over interleaved repeats in one process; compilation is timed apart. The error is the
largest of T over a sample of the speeds against shooting in extended precision; for the cycles solved together the
forty speeds closest to Omega_h are in it.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from fractions import Fraction
from typing import Any

from tippedisk_verify.flow.baseline import Baseline
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.flow.lanes import BatchTaylor, field_constants
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import EXTENDED
from tippedisk_verify.orbits.bisection import bisect_omega_h
from tippedisk_verify.orbits.branch_interpolant import BranchInterpolant
from tippedisk_verify.orbits.continuation import paper_sets
from tippedisk_verify.orbits.periodic import limit_cycle, shoot

__all__ = ["Run", "race"]

_REPEATS = 5
_SAMPLE = 7
_CLOSEST = 40


@dataclass(frozen=True)
class Run:
    """One method at one setting."""

    method: str
    setting: str
    error: float | None  #: largest |T - truth| over the sample [s]; None where T is not solved for
    seconds: float  #: per cycle, median
    status: str

    def json(self) -> dict[str, Any]:
        return asdict(self)


def _largest(periods: Sequence[float], truths: Sequence[Fraction]) -> float:
    """The largest error."""
    return max(abs(float(Fraction(period) - truth)) for period, truth in zip(periods, truths, strict=True))


def race(parameters: Parameters, advance: Callable[[str, int], None] = lambda text, step: None) -> list[Run]:
    """The paper's sets of speeds: all at once, one by one, by SciPy's DOP853, and heyoka's batch doing nothing else."""
    import numpy

    taylor, scipy, lanes = Taylor(), Baseline("DOP853"), BatchTaylor()
    omega_h = bisect_omega_h(parameters, taylor).omega_h.value
    sets = paper_sets(parameters, omega_h)
    speeds = numpy.array([sets.start, *sets.increasing, *sets.decreasing])

    def together() -> Any:
        branch = BranchInterpolant(parameters, lanes, float(omega_h), lowest=speeds.min(), highest=speeds.max())
        cycles = branch.cycles(speeds.tolist())
        branch.half_widths(cycles)
        return cycles

    cycles = together()  # compiles
    advance("compiled", 1)
    starts = numpy.stack((numpy.zeros(len(speeds)), cycles.gamma_bar_0, cycles.v_0), axis=1)
    constants = field_constants(parameters)

    def bare() -> None:
        flights = (constants, speeds, starts, cycles.period / 2)
        lanes(*flights, shifted=True, variations=("beta", "gamma", "v", "Omega"))

    sample = numpy.linspace(0, len(speeds) - 1, _SAMPLE).astype(int)
    guesses = [(cycles.gamma_bar_0[k] * 1.001, cycles.v_0[k] * 1.001) for k in sample]

    def singly(engine: Engine) -> list[float]:
        shots = [
            shoot(parameters, Fraction(speeds[k]), guess, engine) for k, guess in zip(sample, guesses, strict=True)
        ]
        return [2 * float(shot.map.time) for shot in shots]

    def truth(k: int) -> Fraction:
        guess = (cycles.gamma_bar_0[k], cycles.v_0[k])
        return limit_cycle(parameters, Fraction(speeds[k]), taylor, guess=guess, precision=EXTENDED).period.value

    truths = [truth(k) for k in sample]
    # Closest to Omega_h they are hardest; of the cycles solved together those are in the sample too.
    closest = numpy.argsort(speeds)[:_CLOSEST]
    of_all = _largest([*cycles.period[sample], *cycles.period[closest]], [*truths, *(truth(k) for k in closest)])
    by_taylor, by_scipy = _largest(singly(taylor), truths), _largest(singly(scipy), truths)
    seconds = _interleaved(
        {
            "lanes": (together, len(speeds)),
            "bare": (bare, len(speeds)),
            "taylor": (lambda: singly(taylor), _SAMPLE),
            "scipy": (lambda: singly(scipy), _SAMPLE),
        },
        advance,
    )
    width = f"{lanes.width} lanes"
    few = f"{_SAMPLE} of 801"
    return [
        Run("heyoka batch, one variational half period a cycle", width, None, seconds["bare"], "bare"),
        Run("801 cycles together, with half-widths", width, of_all, seconds["lanes"], "converged"),
        Run("taylor shooting, one by one", few, by_taylor, seconds["taylor"], "converged"),
        Run("scipy-DOP853 shooting", f"{few}, tolerance 1e-13", by_scipy, seconds["scipy"], "converged"),
    ]


def _interleaved(
    jobs: dict[str, tuple[Callable[[], object], int]], advance: Callable[[str, int], None]
) -> dict[str, float]:
    """Median seconds of each job for one of the cycles that it does."""
    times: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(_REPEATS):
        for name, (job, count) in jobs.items():
            begin = time.perf_counter()
            job()
            times[name].append((time.perf_counter() - begin) / count)
            advance(name, 1)
    return {name: statistics.median(values) for name, values in times.items()}
