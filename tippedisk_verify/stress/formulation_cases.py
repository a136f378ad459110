"""The same question asked otherwise must have the same answer: other units, other variables, other compilations."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.contract import Request
from tippedisk_verify.flow.lanes import BatchTaylor, field_constants
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.exact import exact
from tippedisk_verify.model.parameters import PRINTED, Parameters
from tippedisk_verify.model.precision import bits, heyoka_module
from tippedisk_verify.stress.case import Case, Found, against, digits_between

__all__ = ["CASES"]

_REQUEST = Request(PRINTED, "30.4", ("1.4", "1.9", "0.5"), "2", domain="none", error_estimate=True)
_BETA, _GAMMA, _V = (exact(str(part)) for part in _REQUEST.state)
_HALF_PI = exact("pi/2")


def _asked_otherwise(factors: Sequence[float], offsets: Sequence[float], **changes: Any) -> Callable[[], Found]:
    """The request with these changes: its end, times ``factors`` plus ``offsets``, is the usual one.

    Each of the two answers in double must lie within both half-widths of the other.
    """

    def run() -> Found:
        mine, other = (default_engine()(request) for request in (_REQUEST, replace(_REQUEST, **changes)))
        assert mine.error is not None
        assert other.error is not None
        digits, honest = 16.0, True
        rows = zip(mine.state, other.state, mine.error.state, other.error.state, factors, offsets, strict=True)
        for usual, end, width, its_width, factor, offset in rows:
            back = offset + factor * float(end)
            rounding = 2.0**-52 * (abs(back) + 4 * abs(offset))  # of what is scaled and added
            claimed = float(width) + abs(factor) * float(its_width) + rounding
            honest &= abs(float(usual) - back) <= claimed
            digits = min(digits, digits_between(usual, back, 1))
        return Found("digits", digits, honest)

    return run


def _other_units() -> dict[str, Any]:
    """Millimetres, grams, milliseconds: lengths times 1e3, masses 1e3, inertias 1e9, g 1e-3, rates 1e-3, times 1e3."""
    p = PRINTED
    scaled = Parameters(
        r=p.r * 1000, e=p.e * 1000, m=p.m * 1000, A=p.A * 10**9, B=p.B * 10**9, g=p.g / 1000, mu=p.mu,
        epsilon=p.epsilon, name="mm, g, ms",
    )  # fmt: skip
    # epsilon is a speed, mm/ms = m/s.
    omega, v = (exact(str(value)).rational / 1000 for value in (_REQUEST.omega, _REQUEST.state[2]))
    return {"parameters": scaled, "omega": omega, "state": (*_REQUEST.state[:2], v), "duration": 2000}


_UNITS = _asked_otherwise((1, 1, 1000), (0, 0, 0), **_other_units())
_MIRRORED = _asked_otherwise(
    (-1, -1, -1), (math.pi, 3 * math.pi, 0), state=(exact("pi") - _BETA, exact("3 pi") - _GAMMA, -_V)
)
_SHIFTED = _asked_otherwise(
    (1, 1, 1), (math.pi / 2, math.pi / 2, 0), state=(_BETA - _HALF_PI, _GAMMA - _HALF_PI, _V), shifted=True
)


def _compiled(**options: Any) -> Callable[[], Found]:
    """Options of the compilation change nothing beyond round-off: the estimate holds against the usual 60 digits."""

    def run() -> Found:
        mine = Taylor(**options)(_REQUEST)
        return against(mine, default_engine()(replace(_REQUEST, precision=bits(200), error_estimate=False)))

    return run


def _lanes_of_all_kinds() -> Found:
    """Disks whose rates differ by 1e4 side by side in one batch: each as if it were alone."""
    import numpy

    sets = [PRINTED.changed(epsilon=text) for text in ("0.1", "1e-5", "10", "1e-3", "1e-4", "0.01", "1", "3e-5")]
    lanes = BatchTaylor(len(sets))
    constants = numpy.array([field_constants(parameters) for parameters in sets])
    start = (1.4, 1.9, 0.5)
    count = len(sets)
    together = lanes(
        constants, numpy.full(count, 30.4), numpy.tile(start, (count, 1)), numpy.full(count, 0.05), max_steps=1_000_000
    )
    digits = 16.0
    engine = default_engine()
    for parameters, state in zip(sets, together.states, strict=True):
        alone = engine(Request(parameters, 30.4, start, 0.05, domain="none"))
        digits = min(digits, *(digits_between(a, b, 1) for a, b in zip(state, alone.state, strict=True)))
    return Found("digits", digits, bool(together.finished.all()))


def _pole() -> Found:
    """x' = x^2 from 1 has its pole at t = 1: the first step is the known fraction of the way to it.

    heyoka's order is ceil(-log(tol)/2 + 1) and its step rho e^-2 exp(-0.7 / (order - 1)), with the radius rho from the
    last two coefficients, which are all 1 here (A. Jorba, M. Zou, Experimental Mathematics 14, 2005, Sec. 3.2).
    """
    hy = heyoka_module()
    x = hy.make_vars("x")
    digits, notes = 16.0, []
    for tolerance in (1e-6, 1e-12, 2.0**-52):
        stepper = hy.taylor_adaptive([(x, x * x)], [1.0], tol=tolerance)
        expected = math.ceil(-math.log(tolerance) / 2 + 1)
        step = stepper.step()[1]
        known = math.exp(-2.0) * math.exp(-0.7 / (expected - 1))
        digits = min(digits, digits_between(step, known)) if stepper.order == expected else 0.0
        stepper.propagate_until(0.999)
        # x = 1/(1 - t): the condition at 0.999 is 1e3, for each of some hundred steps' errors.
        away = abs(stepper.state[0] - 1 / (1 - 0.999)) / 1e3
        notes.append(f"tolerance {tolerance:.0e}: order {stepper.order}, error {away:.0e} next to the pole")
        if away > 1e5 * tolerance:
            digits = 0.0
    return Found("digits", digits, note="; ".join(notes))


CASES: tuple[Case, ...] = (
    Case("units mm, g, ms", "the same run in other units", _UNITS, 11),
    Case("symmetric image", "the point symmetry's image and a turn of gamma", _MIRRORED, 11),
    Case("shifted angles", "angles from pi/2: another right-hand side, cosines for sines", _SHIFTED, 11),
    Case("compiled compact", "loops instead of unrolled code", _compiled(compact=True), 11),
    Case("compiled with fast_math", "sums in any order", _compiled(fast_math=True), 11),
    Case("compensated sums", "high_accuracy", _compiled(high_accuracy=True), 11),
    *(Case(f"optimisation level {level}", "of the compiler", _compiled(optimisation=level), 11) for level in (0, 1, 2)),
    Case("lanes of all kinds", "one batch, rates from 1 to 1e6 per second", _lanes_of_all_kinds, 10),
    Case("known pole", "order and step of the Taylor series", _pole, 14),
)
