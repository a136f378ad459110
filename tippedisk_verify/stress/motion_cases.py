"""Motions that are hard to compute.

These have extreme parameters or states, backward time, events that barely happen, or extreme
tolerances.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from functools import partial
from typing import Any

from tippedisk_verify.connection.bisection import bisect_omega_h
from tippedisk_verify.cycles.shooting.shoot import shoot_limit_cycle
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.contract import FLAT, Event, Request
from tippedisk_verify.model.parameters import PRINTED, Parameters
from tippedisk_verify.numbers.exact import exact
from tippedisk_verify.numbers.precision import QUADRUPLE, Precision, precision_of_bits
from tippedisk_verify.stress.case import (
    TRUTH_PRECISION,
    CaseOutcome,
    StressCase,
    compare_flight,
    double_digits_between,
)

__all__ = ["CASES"]

_START: tuple[Any, Any, Any] = ("1.4", "1.9", "0.5")
_OMEGA = "30.4"
# Outcomes of a run that stopped early
_STOPPED_EARLY = ("NON_FINITE", "STEP_LIMIT", "STEP_TOO_SMALL")
_DIGITS_MAY_BE_LOST = ("digits", "no digits left", "rounding decides")  # allowed outcomes


def _compared_run(
    duration: Any,
    parameters: Parameters = PRINTED,
    start: Any = _START,
    omega: Any = _OMEGA,
    truth: Precision = TRUTH_PRECISION,
    **more: Any,
) -> Any:
    """Return the action of a stress case: an integration in double precision, compared with 60
    digits or ``truth``.
    """
    return partial(
        compare_flight,
        Request(parameters, omega, start, duration, **{"max_steps": 1_000_000, **more}),
        truth,
    )


def _parameters(**values: object) -> Callable[[], Parameters]:
    return lambda: PRINTED.changed(**values)


def _deferred_run(
    duration: Any, make: Callable[[], Parameters], **more: Any
) -> Callable[[], CaseOutcome]:
    """Return the action of a stress case that makes the disk's parameters only when it runs, so
    their refusal is an outcome.
    """
    return lambda: _compared_run(duration, make(), **more)()


def _thin_ring(share: str) -> Callable[[], Parameters]:
    """Return a function that makes a disk with an eccentricity close to its radius, e = r (1 -
    share), and with inertias of a possible body.
    """

    def make() -> Parameters:
        e = PRINTED.r * (1 - Fraction(share))
        B = PRINTED.m * e**2 + PRINTED.Bbar
        return PRINTED.changed(e=e, B=B, A=B * Fraction(11, 10), C=None)

    return make


def _friction_cases() -> list[StressCase]:
    # At epsilon = 0.1 a tenth of a second is 13 decay times; at 1e-6, 0.001 s is about 1e4.
    durations = (
        ("1e-6", "0.001", QUADRUPLE),
        ("1e-5", "0.01", QUADRUPLE),
        ("1e-4", "0.1", QUADRUPLE),
        ("1e-3", "0.5", TRUTH_PRECISION),
        ("0.01", "1", TRUTH_PRECISION),
        ("1", "1", TRUTH_PRECISION),
        ("10", "1", TRUTH_PRECISION),
    )
    return [
        *(
            StressCase(
                f"epsilon {text}, {friction}",
                f"{duration} s with epsilon = {text} m/s",
                _deferred_run(
                    duration,
                    _parameters(epsilon=text, friction=friction),
                    domain="none",
                    truth=truth,
                ),
                9,
                quick=truth is TRUTH_PRECISION,
            )
            for text, duration, truth in durations
            for friction in ("linear", "smooth")
        ),
        *(
            StressCase(
                f"mu {text}",
                f"0.5 s with mu = {text}",
                _deferred_run("0.5", _parameters(mu=text), domain="none"),
                10,
            )
            for text in ("1e-6", "10")
        ),
    ]


def _shape_cases() -> list[StressCase]:
    near = PRINTED.Bbar * (1 + Fraction(1, 10**12))
    sets: tuple[tuple[str, str, Callable[[], Parameters]], ...] = (
        ("e 1e-6 m", "hardly eccentric", _parameters(e="1e-6")),
        ("e 1e-15 m", "an eccentricity that rounding loses in r + e", _parameters(e="1e-15")),
        ("e near r", "e = r (1 - 1e-6)", _thin_ring("1e-6")),
        (
            "A next to Bbar",
            "A = Bbar (1 + 1e-12)",
            lambda: PRINTED.changed(A=near + PRINTED.m * PRINTED.e**2),
        ),
    )
    return [
        StressCase(name, says, _deferred_run("1", make, domain="none"), 10)
        for name, says, make in sets
    ]


def _speed_cases() -> list[StressCase]:
    return [
        *(
            StressCase(
                f"Omega {omega}",
                f"{duration} s at Omega = {omega} rad/s",
                _compared_run(duration, omega=omega, domain="none"),
                8,
            )
            for omega, duration in (("1e-3", "0.5"), ("1", "0.5"), ("300", "0.5"), ("1e4", "0.02"))
        ),
        *(
            StressCase(
                f"v {v}",
                f"{duration} s from v = {v} rad/s",
                _compared_run(duration, start=("1.4", "1.9", v), domain="none"),
                9,
            )
            for v, duration in (("1e3", "0.01"), ("1e6", "1e-5"), ("-1e6", "1e-5"))
        ),
    ]


def _start_cases() -> list[StressCase]:
    half = exact("pi/2")
    tiny = Fraction(1, 10**12)
    shift: dict[str, Any] = {"shifted": True, "domain": "none"}
    return [
        StressCase(
            "next to inverted spinning",
            "1e-12 from the equilibrium, in shifted angles, which keep its digits",
            _compared_run("2", start=(tiny, -tiny, 0), **shift),
            10,
        ),
        StressCase(
            "on inverted spinning",
            "starts on it in plain angles: pi/2 is not a double",
            _compared_run("1", start=(half, half, 0), domain="none"),
            10,
        ),
        StressCase(
            "next to noninverted spinning",
            "1e-12 from the saddle: expands by e^6.6t",
            _compared_run("1", start=(half + exact(tiny), exact("-pi/2"), 0), domain="none"),
            8,
        ),
        StressCase(
            "next to lying flat",
            "sin(beta) = 1e-12 and v away from it",
            _compared_run("0.2", start=(tiny, "1.9", "5"), domain="event"),
            8,
        ),
        StressCase(
            "next to lying flat, falling",
            "sin(beta) = 1e-12 and v towards it: ends within 1e-12 s",
            _compared_run("0.2", start=(tiny, "1.9", "-5"), domain="event"),
            3,
            _DIGITS_MAY_BE_LOST,
        ),
        StressCase(
            "flat",
            "starts at sin(beta) = 0: the model has no such state",
            _compared_run("0.2", start=(0, "1.9", "5")),
            0,
            ("FLAT", *_DIGITS_MAY_BE_LOST),
        ),
        StressCase(
            "on the stable manifold",
            "passes the saddle within rounding, which then decides the side",
            _stable_manifold,
            0,
            _DIGITS_MAY_BE_LOST,
        ),
    ]


def _stable_manifold() -> CaseOutcome:
    """Compare a run along the unstable manifold to the other saddle and beyond with 400 bits.

    The speed is the double that bisection finds for Omega_h.
    """
    omega = bisect_omega_h(PRINTED, default_engine()).omega_h.value
    return compare_flight(
        Request(
            PRINTED, omega, (exact("pi/2") - exact("1e-9"), exact("-pi/2"), 0), "12", domain="none"
        ),
        precision_of_bits(400),
    )


def _backward_cases() -> list[StressCase]:
    """Return stress cases that integrate backward in time from the limit cycle.

    Errors grow by about e^(100 t) there, so after 0.5 s hardly a digit is left, and this must be
    reported. Whether a digit is left depends on the last bits of the start: on their distance from
    the cycle, and on rounding.
    """

    def back(duration: str) -> CaseOutcome:
        cycle = shoot_limit_cycle(PRINTED, exact(_OMEGA).rational, default_engine())
        return compare_flight(
            Request(
                PRINTED,
                _OMEGA,
                (0.0, float(cycle.gamma_bar_0), float(cycle.v_0)),
                duration,
                shifted=True,
                domain="none",
                max_steps=5000,
            )
        )

    return [
        StressCase(
            f"backward {duration} s",
            "backward from the cycle",
            partial(back, duration),
            least,
            ("digits",) if least else (*_DIGITS_MAY_BE_LOST, *_STOPPED_EARLY),
        )
        for duration, least in (
            ("-0.05", 12.0),
            ("-0.1", 8.0),
            ("-0.2", 5.0),
            ("-0.3", 2.0),
            ("-0.5", 0.0),
        )
    ]


def _crossing(level: float) -> Event:
    return Event(
        f"beta at {level!r}", lambda ops, c, omega, beta, gamma, v: beta - level, terminal=False
    )


def _event_cases() -> list[StressCase]:
    # beta has a maximum within half a second. A surface touches it, or cuts it just below.
    turn = Event("turn", lambda ops, c, omega, beta, gamma, v: 1 * v, direction=-1)

    def below(ulps: float) -> CaseOutcome:
        to_top = Request(
            PRINTED, _OMEGA, _START, "2", events=(turn,), domain="none", precision=TRUTH_PRECISION
        )
        top = float(default_engine()(to_top).state[0])
        return compare_flight(
            Request(
                PRINTED,
                _OMEGA,
                _START,
                "0.5",
                events=(_crossing(top - ulps * 2.0**-53),),
                domain="none",
            )
        )

    def pair() -> CaseOutcome:
        first, second = _crossing(1.45), _crossing(1.45 + 2.0**-52)
        return compare_flight(
            Request(PRINTED, _OMEGA, _START, "0.5", events=(first, second), domain="none")
        )

    return [
        StressCase(
            "events a rounding apart",
            "two surfaces an ulp apart, crossed one after the other",
            pair,
            10,
            _DIGITS_MAY_BE_LOST,
        ),
        StressCase(
            "grazing, missed",
            "a surface 100 ulps above the highest point",
            partial(below, -100),
            10,
        ),
        StressCase(
            "grazing, touched",
            "a surface at the highest point, to rounding",
            partial(below, 0),
            10,
            _DIGITS_MAY_BE_LOST,
        ),
        StressCase(
            "grazing, cut",
            "crossed twice within some 1e-6 s, 1000 ulps below the top",
            partial(below, 1000),
            10,
            _DIGITS_MAY_BE_LOST,
        ),
        StressCase(
            "flat twice",
            "the run ends at the first crossing of sin(beta) = 0",
            _compared_run(
                "60", start=(exact("pi/2"), exact("-pi/2"), 2), omega="29.9", events=(FLAT,)
            ),
            6,
        ),
    ]


def _tolerance_cases() -> list[StressCase]:
    """Return stress cases that integrate at several tolerances; the error estimate must hold at
    each.
    """
    return [
        *(
            StressCase(
                f"tolerance {tolerance:.1e}",
                "1 s at this tolerance",
                _compared_run("1", tolerance=tolerance, domain="none"),
                least,
            )
            for tolerance, least in (
                (0.1, 0.5),
                (1e-3, 2.0),
                (1e-6, 5.0),
                (1e-9, 8.0),
                (1e-13, 12.0),
                (2.0**-53, 12.0),
            )
        ),
        StressCase(
            "tolerance below round-off",
            "1e-30 in double: no better than 1e-16, and no worse",
            _compared_run("1", tolerance=1e-30, domain="none"),
            12,
        ),
    ]


def _long_run() -> CaseOutcome:
    """Measure the phase error after N periods of the limit cycle, up to about 1e5 s of motion. The
    outcome is honest if the error grows at most linearly.

    The true solution needs no integration: after N periods the cycle is where it was. Rounding acts
    on the period, so the error grows linearly. A faster growth would be a fault of the integrator.
    """
    import numpy

    engine = default_engine()
    cycle = shoot_limit_cycle(PRINTED, exact(_OMEGA).rational, engine, digits=30)
    start = (0.0, float(cycle.gamma_bar_0), float(cycle.v_0))
    points = []
    for decade in range(6):
        periods = round(10**decade / float(cycle.period))
        duration = float(periods * cycle.period.value)
        end = engine(
            Request(PRINTED, _OMEGA, start, duration, shifted=True, domain="none", max_steps=10**8)
        ).state
        late = float(Fraction(duration) - periods * cycle.period.value)
        # On the section beta_bar changes at the rate v, so beta_bar / v is the error of time. The
        # rounding of the duration is known.
        points.append((10.0**decade, abs(float(end[0]) / start[2] - late)))
    far = points[-1][1]
    times, errors = numpy.log10([(time, max(error, 1e-16)) for time, error in points]).T
    slope = float(numpy.polyfit(times, errors, 1)[0])
    # The random errors at short times make the fitted exponent uncertain by about 0.1.
    return CaseOutcome(
        "digits",
        double_digits_between(far + 1.0, 1.0),
        slope < 1.15,
        f"phase error {far:.1e} s after 1e5 s, growing with exponent {slope:.2f}",
    )


CASES: tuple[StressCase, ...] = (
    *_friction_cases(),
    *_shape_cases(),
    *_speed_cases(),
    *_start_cases(),
    *_backward_cases(),
    *_event_cases(),
    *_tolerance_cases(),
    StressCase(
        "100,000 s",
        "on the limit cycle: the phase error grows linearly, not worse",
        _long_run,
        7,
        quick=False,
    ),
)
