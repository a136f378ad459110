"""The search for the proof of the family of limit cycles: the intervals tried, and their order.

An interval of amplitudes that is not proved is halved, unless its proved properties exclude every
part of it. At the Hopf point only the lower half is tried; the rest belongs to the intervals after
it. If an interval is given up, nothing beyond it is useful, because the curve has to begin at the
Hopf point.

Where a ball becomes a point or a float: intervals and guesses are chosen, and no proof depends on
them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.proofs.ball_conversions import ball_constants, ball_to_measured
from tippedisk_verify.proofs.closed_forms import hopf_balls, measured_omega_crit
from tippedisk_verify.proofs.kernel.balls import arb, working_precision
from tippedisk_verify.proofs.kernel.certificates.family import ArcStatus, ProvedArc, are_joined
from tippedisk_verify.proofs.search.arc_evidence import CycleGuess, prove_arc
from tippedisk_verify.proofs.search.connection_proof import ConnectionProof, prove_connection
from tippedisk_verify.proofs.search.cycles_near_omega_h_proof import (
    CyclesNearOmegaHProof,
    prove_cycles_near_omega_h,
)
from tippedisk_verify.proofs.search.family_proof import FamilyProof

__all__ = [
    "HOPF_END",
    "AmplitudeInterval",
    "ApproximateCycle",
    "connected_arcs",
    "guess_at",
    "hopf_guess",
    "prove_family",
    "prove_intervals",
]

HOPF_END = Fraction(4, 5)  #: rad: the largest end of the arc at the Hopf point
_MAX_INTERVAL_LENGTH, _INTERVAL_SHARE = (
    Fraction(3, 10),
    Fraction(1, 7),
)  # length of an interval [rad], and relative to the distance of pi from its beginning
_MAX_HALVINGS = 5
_NEAREST_CYCLES = 5  # known cycles from which a guess is interpolated
_FINAL_FAILURES = (ArcStatus.SPEED_GROWS, ArcStatus.UNSTABLE)
_DEFAULT_END = Fraction("3.06")  # rad: beyond it arcs become short
# Distances above Omega_h [rad/s] up to which cycles are tried, and the share of them that the arcs'
# end uses
_TRIED_DISTANCES = ("0.008", "0.004", "0.002")
_OVERLAP = Fraction(3, 4)
# Known cycles; ratio of successive distances from Omega_h for the last ones
_SPEED_COUNT, _DISTANCE_RATIO = 60, Fraction(4, 5)
_MIN_DISTANCE = Fraction(1, 10**6)  # rad/s from Omega_h
_CONNECTION_DIGITS = 10

#: A cycle's gamma_bar_0, v_0, Omega and half its period
ApproximateCycle = tuple[Fraction, Fraction, Fraction, Fraction]
IntervalResult = tuple[ProvedArc | ArcStatus, "AmplitudeInterval"]
IntervalCallback = Callable[[ProvedArc | ArcStatus, "AmplitudeInterval"], None]
#: A maker of a pool of processes, for several intervals
ExecutorFactory = Callable[[bool], AbstractContextManager[Executor | None]]


def prove_family(
    parameters: Parameters,
    omega_h_at: Callable[[int], Fraction | None],
    cycles_at: Callable[[list[Fraction] | None], list[ApproximateCycle]],
    until: Fraction | None = None,
    pool: ExecutorFactory = lambda several: nullcontext(),
    on_stage: Callable[[str], None] = lambda name: None,
    on_interval: IntervalCallback = lambda result, interval: None,
) -> FamilyProof:
    """Prove as much of the family of limit cycles as possible: up to the amplitude ``until`` [rad],
    or up to the connection.

    Args:
        parameters: The disk.
        omega_h_at: Called with a number of digits; returns Omega_h [rad/s] or None.
        cycles_at: Called with speeds [rad/s], or with None for speeds of its choice; returns
            cycles, which serve as guesses.
        until: The amplitude at which to end [rad].
        pool: Called with True if there are several intervals; returns the executor's context.
        on_stage: Called with the name of each stage.
        on_interval: Called with each interval that is proved or given up, and the arc or the
            reason.
    """
    arcs: list[ProvedArc] = []
    wanted = _DEFAULT_END if until is None else until
    connection: ConnectionProof | None = None
    near_omega_h: CyclesNearOmegaHProof | None = None

    def keep_arc(result: ProvedArc | ArcStatus, interval: AmplitudeInterval) -> None:
        if isinstance(result, ProvedArc):
            arcs.append(result)
        on_interval(result, interval)

    # Without the arc at the Hopf point the others are of no use.
    on_stage("the Hopf point")
    at_hopf = AmplitudeInterval(Fraction(0), min(wanted, HOPF_END))
    stopped = prove_intervals(parameters, [at_hopf], [], on_interval=keep_arc)
    if connected_arcs(arcs):
        on_stage("the connection")
        speeds: list[Fraction] | None = None
        if (approximate_omega_h := omega_h_at(_CONNECTION_DIGITS + 5)) is not None:
            with suppress(AccuracyError):
                connection = prove_connection(parameters, approximate_omega_h, _CONNECTION_DIGITS)
        if connection is not None and connection.omega_h is not None:
            speeds = [round(speed, 12) for speed in _speeds(parameters, connection.omega_h.value)]
        approximate_cycles = cycles_at(speeds)
        if until is None and connection is not None:
            on_stage("the cycles next to the connection")
            near_omega_h = _prove_cycles_near_omega_h(connection)
            wanted = _amplitude_near_omega_h(near_omega_h, approximate_cycles) or wanted
        if stopped is None and (left := [*_subintervals(arcs[0].high, wanted)]):
            on_stage("arcs")
            with pool(len(left) > 1) as executor:
                stopped = prove_intervals(parameters, left, approximate_cycles, executor, keep_arc)
    one_curve = connected_arcs(arcs)
    if stopped is None and one_curve[-1].high < wanted:
        stopped = ArcStatus.NOT_JOINED
    return FamilyProof(parameters, tuple(one_curve), stopped, connection, near_omega_h)


def _prove_cycles_near_omega_h(connection: ConnectionProof) -> CyclesNearOmegaHProof | None:
    """Prove the limit cycles next to a connection up to the largest distance from Omega_h that
    succeeds.

    Returns the last failure if none succeeds, and None if nothing could be tried.
    """
    end = None
    for distance in _TRIED_DISTANCES if connection.proved else ():
        with suppress(InputError):  # for a distance beyond Omega_crit
            end = prove_cycles_near_omega_h(connection, distance)
        if end is not None and end.proved:
            break
    return end


def _amplitude_near_omega_h(
    near_omega_h: CyclesNearOmegaHProof | None, approximate_cycles: Sequence[ApproximateCycle]
) -> Fraction | None:
    """Return an amplitude at which the family's arcs run into the proved cycles next to the
    connection.

    Returns None if those cycles are not proved. ``approximate_cycles`` are approximate cycles of
    the family.
    """
    if near_omega_h is None or not near_omega_h.proved or near_omega_h.connection.omega_h is None:
        return None
    low = near_omega_h.connection.omega_h.value
    inside = [
        cycle
        for cycle in approximate_cycles
        if cycle[2] - low < _OVERLAP * (near_omega_h.high - low)
    ]
    return round(min(inside, default=approximate_cycles[-1])[0], 4)


def _speeds(parameters: Parameters, omega_h: Fraction) -> Iterator[Fraction]:
    """Yield falling speeds above Omega_h at which cycles of the family are to be computed.

    They are chosen so that the cycles' amplitudes lie close together at both ends of the family.
    """
    span = measured_omega_crit(parameters).value - omega_h
    for k in range(_SPEED_COUNT // 10, _SPEED_COUNT - 1):
        left = span * (1 - Fraction(k, _SPEED_COUNT) ** 2)
        yield omega_h + left
    while left > _MIN_DISTANCE:
        left *= _DISTANCE_RATIO
        yield omega_h + left


@dataclass(frozen=True)
class AmplitudeInterval:
    """An interval of amplitudes [rad] for which the family is to be proved. If ``low`` is 0, the
    proof scales states by their amplitude.
    """

    low: Fraction
    high: Fraction
    halvings: int = 0

    def halves(self) -> tuple[AmplitudeInterval, ...]:
        """Return the two halves of the interval.

        If ``low`` is 0, only the lower half is returned, because the other one needs known cycles.
        """
        middle, count = (self.low + self.high) / 2, self.halvings + 1
        lower = AmplitudeInterval(self.low, middle, count)
        return (lower, AmplitudeInterval(middle, self.high, count)) if self.low else (lower,)


def _subintervals(low: Fraction, high: Fraction) -> Iterator[AmplitudeInterval]:
    """Yield the intervals, from ``low`` to ``high`` [rad], on which the family is to be proved."""
    while low < high:
        length = min(
            _MAX_INTERVAL_LENGTH, _INTERVAL_SHARE * max(Fraction(22, 7) - low, Fraction(1, 500))
        )
        # Few digits, and no short last interval.
        until = round(low + length, 4)
        if until + length / 3 > high:
            until = high
        yield AmplitudeInterval(low, until)
        low = until


def connected_arcs(arcs: Iterable[ProvedArc]) -> list[ProvedArc]:
    """Return those of the proved arcs that form one curve from the Hopf point on, in order."""
    curve: list[ProvedArc] = []
    for arc in sorted(arcs, key=lambda arc: (arc.low, arc.high)):
        if not curve:
            if arc.scaled:
                curve.append(arc)
        elif arc.low == curve[-1].high and are_joined(curve[-1], arc, arc.low):
            curve.append(arc)
    return curve


def hopf_guess(parameters: Parameters) -> CycleGuess:
    """Return a guess of the family's cycles next to the Hopf point: v_0 / gamma_bar_0, Omega and
    half the period of the linear flow at Omega_crit.
    """
    with working_precision(64):
        numbers = hopf_balls(ball_constants(parameters))
        speed, period = numbers["omega_crit"], numbers["period"]
        # gamma_bar is a cosine there, and beta_bar its rate over Omega.
        ratio = -((2 * arb.pi() / period) ** 2) / speed
        first, second, third = (ball_to_measured(part).value for part in (ratio, speed, period / 2))
        return first, second, third


def guess_at(approximate_cycles: Sequence[ApproximateCycle], amplitude: Fraction) -> CycleGuess:
    """Return v_0, Omega and half the period at an amplitude, interpolated between known cycles. No
    proof depends on it.
    """
    nearest = sorted(approximate_cycles, key=lambda cycle: abs(cycle[0] - amplitude))[
        :_NEAREST_CYCLES
    ]
    off = [float(cycle[0] - amplitude) for cycle in nearest]
    values = [[float(number) for number in cycle[1:]] for cycle in nearest]
    first, second, third = map(
        Fraction, np.polynomial.polynomial.polyfit(off, values, len(off) - 1)[0].tolist()
    )
    return first, second, third


def prove_intervals(
    parameters: Parameters,
    intervals: Sequence[AmplitudeInterval],
    approximate_cycles: Sequence[ApproximateCycle],
    executor: Executor | None = None,
    on_interval: IntervalCallback = lambda result, interval: None,
) -> ArcStatus | None:
    """Try to prove the family on some intervals of amplitudes, halving intervals that fail.

    Returns None if all are proved, otherwise the reason why the lowest failed one was given up.

    ``approximate_cycles`` are approximate cycles, from which guesses are made. ``on_interval`` is
    called with each interval that is proved or given up, and the arc or the reason.
    """
    given_up: list[tuple[Fraction, ArcStatus]] = []
    jobs = _Jobs(parameters, approximate_cycles, executor, intervals)
    for result, interval in jobs:
        if isinstance(result, ArcStatus):
            if result not in _FINAL_FAILURES and interval.halvings < _MAX_HALVINGS:
                jobs.add(interval.halves())
                continue
            given_up.append((interval.low, result))
            jobs.cancel_from(interval.low)
        on_interval(result, interval)
    return min(given_up, key=lambda entry: entry[0])[1] if given_up else None


class _Jobs:
    """An iterator over intervals of amplitudes and the results of proving them.

    It yields pairs: the proved arc or the reason for the failure, and the interval. The intervals
    are tried here in order, the lowest first, or all at once in other processes.
    """

    def __init__(
        self,
        parameters: Parameters,
        approximate_cycles: Sequence[ApproximateCycle],
        executor: Executor | None,
        intervals: Iterable[AmplitudeInterval],
    ) -> None:
        self.parameters, self.approximate_cycles, self.executor = (
            parameters,
            approximate_cycles,
            executor,
        )
        self.waiting: list[AmplitudeInterval] = []
        self.running: dict[Future[ProvedArc | ArcStatus], AmplitudeInterval] = {}
        self.add(intervals)

    def add(self, intervals: Iterable[AmplitudeInterval]) -> None:
        self.waiting = sorted([*self.waiting, *intervals], key=lambda interval: interval.low)
        if self.executor is not None:
            for interval in self.waiting:
                self.running[self.executor.submit(prove_arc, *self._job(interval))] = interval
            self.waiting = []

    def cancel_from(self, low: Fraction) -> None:
        """Cancel the proofs of intervals beyond the amplitude ``low`` that have not begun."""
        self.waiting = [interval for interval in self.waiting if interval.low < low]
        for future in [
            future
            for future, interval in self.running.items()
            if interval.low >= low and future.cancel()
        ]:
            del self.running[future]

    def __iter__(self) -> Iterator[IntervalResult]:
        while self.waiting or self.running:
            if self.waiting:
                interval = self.waiting.pop(0)
                yield prove_arc(*self._job(interval)), interval
            else:
                for future in wait(self.running, return_when=FIRST_COMPLETED).done:
                    if future in self.running:
                        yield future.result(), self.running.pop(future)

    def _job(
        self, interval: AmplitudeInterval
    ) -> tuple[Parameters, Fraction, Fraction, CycleGuess]:
        """Return the arguments of `prove_arc` for an interval."""
        low, high = interval.low, interval.high
        if not low:
            return self.parameters, low, high, hopf_guess(self.parameters)
        return self.parameters, low, high, guess_at(self.approximate_cycles, (low + high) / 2)
