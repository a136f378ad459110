"""Friction laws: the paper's two, and laws of a user's own."""

from __future__ import annotations

import copy
import math
import pickle
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy
import pytest

import tippedisk_verify as tv
from tests.friction_laws import ARCTAN, OWN_LAWS, STRIBECK, TANH
from tippedisk_verify import (
    DOUBLE,
    EXTENDED,
    Audit,
    FrictionLaw,
    InputError,
    Taylor,
    precision_of_bits,
)
from tippedisk_verify.model.friction import LAWS, law_of

START = ("pi/2", "pi/2 + 0.4", 0)


def weight(c: Any) -> Any:
    return c.mu * c.m * c.g


def _tanh_with(ops: Any, x: Any, c: Any, height: float, sharpness: float) -> Any:
    """Return tanh friction with a bump at 2 epsilon, of the width epsilon / sqrt(32 sharpness)."""
    q, one = x / c.epsilon, c.epsilon / c.epsilon
    place = q * q - 4
    bump, at_zero = ops.exp(-sharpness * place * place), ops.exp(-16 * sharpness * one)
    return -weight(c) * ops.tanh(q) * (1 + height * bump) / (1 + height * at_zero)


def _two_levels(ops: Any, x: Any, c: Any, sharpness: int) -> Any:
    """Return friction that rises to a second level at 2 epsilon."""
    q = x / c.epsilon
    rise = ops.tanh(sharpness * (q - 2)) + ops.tanh(sharpness * (q + 2))
    return -weight(c) * (ops.tanh(q) + rise / 4)


@pytest.mark.parametrize("law", [*LAWS.values(), *OWN_LAWS], ids=str)
def test_a_law_is_one_function_in_every_arithmetic(law: FrictionLaw) -> None:
    """The force on both sides of zero, and its derivative against a difference in 200 bits."""
    disk, ctx = tv.Disk("table1", friction=law), precision_of_bits(200).context
    c, wide = disk.constants_in(DOUBLE), disk.constants_in_context(ctx)
    for velocity in (-2.0, -0.03, 0.0, 0.03, 2.0):
        x = ctx.mpf(velocity)
        force = law(ctx, x, wide)
        assert law(ctx, -x, wide) == -force
        # A dozen operations of half a unit each, in numbers of the force's size.
        assert law(math, velocity, c) == pytest.approx(float(force), rel=16 * 2.0**-53)
        slope, step = law.deceleration_slope(ctx, x, wide), ctx.mpf(2) ** -60
        difference = law.deceleration(ctx, x + step, wide) - law.deceleration(ctx, x - step, wide)
        # The second derivative jumps at zero, which a difference sees to first order in the step.
        assert abs(difference / (2 * step) - slope) < 2.0**-50 * abs(wide.k)
        for numbers in (DOUBLE, EXTENDED):
            array = numpy.array([velocity], dtype=numbers.number_type)
            found = law.deceleration_slope(numpy, array, disk.constants_in(numbers))
            assert float(numpy.ravel(found)[0]) == pytest.approx(float(slope), rel=64 * 2.0**-53)


@pytest.mark.parametrize(
    ("law", "problem"),
    [
        (FrictionLaw("even", lambda ops, x, c: -weight(c) * x * x), "not odd"),
        (FrictionLaw("push", lambda ops, x, c: weight(c) * x / c.epsilon), "does not brake"),
        (FrictionLaw("steep", lambda ops, x, c: -2 * weight(c) * x / c.epsilon), "give its slope"),
        (
            FrictionLaw("sign", lambda ops, x, c: -weight(c) * (x / c.epsilon + 1), two_sided=True),
            "not odd",
        ),
        (
            FrictionLaw("root", lambda ops, x, c: -weight(c) * x / c.epsilon / ops.sqrt(2) ** 2),
            "slope",
        ),
        (
            FrictionLaw(
                "double",
                lambda ops, x, c: -weight(c) * ops.tanh(ops.sqrt(2) * x / c.epsilon) / ops.sqrt(2),
            ),
            "rounded to a double",
        ),
        (
            FrictionLaw(
                "rounded pi",
                lambda ops, x, c: -2 * weight(c) / c.pi * ops.atan(math.pi * x / (2 * c.epsilon)),
            ),
            "give its slope",
        ),
        (FrictionLaw("bump", lambda ops, x, c: _tanh_with(ops, x, c, 5, 10**6)), "narrow feature"),
        (FrictionLaw("small", lambda ops, x, c: _tanh_with(ops, x, c, 1 / 4096, 200)), "narrow"),
        (
            FrictionLaw("two levels", lambda ops, x, c: _two_levels(ops, x, c, 100)),
            "narrow feature",
        ),
        (
            FrictionLaw(
                "driving",
                lambda ops, x, c: (
                    -weight(c) * x / c.epsilon * (1 - x * x / (c.epsilon * c.epsilon) / 100)
                ),
            ),
            "does not brake",
        ),
        (FrictionLaw("typo", lambda ops, x, c: -c.nu * x), "cannot be computed"),
        (
            FrictionLaw("abs", lambda ops, x, c: -weight(c) * x / (abs(x) + c.epsilon)),
            "two_sided=True",
        ),
        (
            FrictionLaw(
                "condition", lambda ops, x, c: weight(c) / c.epsilon * (-x if x > -1000 else x)
            ),
            "cannot be compiled",
        ),
        (FrictionLaw("text", lambda ops, x, c: "text"), "cannot be computed"),
        (
            FrictionLaw("root slope", LAWS["linear"].force, slope=lambda c: float(c.mu)),
            "not a positive rational",
        ),
    ],
    ids=lambda part: str(part),
)
def test_a_law_that_a_disk_cannot_take(law: FrictionLaw, problem: str) -> None:
    with pytest.raises(InputError, match=problem):
        tv.Disk("table1", friction=law)


def test_names_of_laws() -> None:
    for name in ("", "two\nlines", "x" * 41, 3):
        with pytest.raises(InputError, match="one line"):
            FrictionLaw(name, ARCTAN.force)
    with pytest.raises(InputError, match="True or False"):
        FrictionLaw("tanh", TANH.force, two_sided="yes")
    with pytest.raises(InputError, match="choose another"):
        FrictionLaw("smooth", ARCTAN.force)
    with pytest.raises(InputError, match="is not known"):
        law_of("arctan")
    assert tv.Disk("table1", friction=LAWS["smooth"]) == tv.Disk("table1", friction="smooth")


@pytest.mark.slow
def test_the_smooth_law_as_a_law_of_ones_own(taylor: Taylor) -> None:
    """A run under it has the paper's law's numbers, to the sum of both half-widths."""
    law = FrictionLaw("own", lambda ops, x, c: -weight(c) * x / (x + c.epsilon), two_sided=True)
    own, papers = (
        tv.Disk("table1", friction=friction).integrate("30.4", START, 2, engine=taylor)
        for friction in (law, "smooth")
    )
    assert (abs(own.y - papers.y) <= own.uncertainty + papers.uncertainty).all()


def run_held(taylor: Taylor, request: tv.Request, wider: tv.Precision) -> tv.Result:
    """Return a run in double; its half-widths must hold the end in a wider arithmetic."""
    found = taylor(replace(request, error_estimate=True))
    truth = taylor(replace(request, precision=wider))
    distance = abs(found.state - truth.state.astype(float))
    assert (distance <= found.error.state + abs(found.state) * 2.0**-53).all()
    return found


def test_a_bend_that_no_series_shows_is_not_passed(taylor: Taylor) -> None:
    """The start slides 300 epsilon fast, where tanh is 1 to rounding, and the run passes zero.

    Its half-widths hold the end in quadruple precision, and are those of a resolved bend: below a
    thousand roundings of the state.
    """
    values = {"r": "0.19", "e": "0.002", "m": "5.7", "A": "0.077", "B": "0.076", "g": "7.5"}
    disk = tv.Disk(**values, mu="0.3", epsilon="0.0163", friction=TANH)
    request = tv.Request(disk, "5.448", ("2.727", "0.7144", "26.226"), "0.45")
    found = run_held(taylor, request, tv.QUADRUPLE)
    assert (found.error.state <= 1000 * abs(found.state) * 2.0**-53).all()


def test_a_feature_that_is_accepted_is_resolved(taylor: Taylor) -> None:
    """A bump of a quarter of the force, 1/8 of the velocity wide, which the run slides through."""
    law = FrictionLaw("bump", lambda ops, x, c: _tanh_with(ops, x, c, 0.25, 0.5))
    disk = tv.Disk("table1", friction=law)
    request = tv.Request(disk, "30.4", ("pi/2", "pi/2 + 0.4", 20), "0.22")
    found = run_held(taylor, request, tv.precision_of_bits(200))
    assert found.error.state.max() < 1e-10  # the bump itself moves the end by 1e-2


def test_a_force_that_changes_is_another_law() -> None:
    factor = [1]
    force = lambda ops, x, c: -weight(c) * ops.tanh(factor[0] * x / c.epsilon) / factor[0]  # noqa: E731
    before = FrictionLaw("mine", force)
    factor[0] = 2
    assert FrictionLaw("mine", force) != before
    with pytest.raises(InputError, match="has changed"):
        tv.Disk("table1", friction=before)
    assert copy.deepcopy(before) is before


def test_laws_of_one_name_are_never_confused(taylor: Taylor) -> None:
    """The engine has compiled the first when it runs the second."""
    other = FrictionLaw("arctan", TANH.force)
    assert other != ARCTAN
    first, second, third = (
        tv.Disk("table1", friction=law).integrate("30.4", START, 1, engine=taylor).y[:, -1]
        for law in (ARCTAN, other, TANH)
    )
    assert (second == third).all()
    assert (first != second).any()


def test_a_law_travels_by_its_functions_names() -> None:
    disk = tv.Disk("table1", friction=STRIBECK)
    assert pickle.loads(pickle.dumps(disk)) == disk
    local = tv.Disk(
        "table1", friction=FrictionLaw("local", lambda ops, x, c: ARCTAN.force(ops, x, c))
    )
    with ProcessPoolExecutor(1) as pool, pytest.raises(InputError, match="another process"):
        pool.submit(str, local).result()


def test_omega_crit_and_the_hopf_point_depend_on_the_slope_only() -> None:
    """gamma_y vanishes on the critical mode, so that a law enters with its slope at zero."""
    linear, own = (tv.Disk("table1", friction=law) for law in ("linear", ARCTAN))
    assert own.omega_crit == linear.omega_crit
    assert own.hopf().first_lyapunov_coefficient == linear.hopf().first_lyapunov_coefficient
    steep = tv.Disk("table1", friction=STRIBECK)
    assert steep.omega_crit == linear.omega_crit
    assert steep.rational_constants().k == Fraction(3, 2) * linear.rational_constants().k
    with pytest.raises(InputError, match="analytic friction laws only, not for 'Stribeck'"):
        steep.hopf()


def test_what_is_for_the_papers_laws_is_refused() -> None:
    disk = tv.Disk("table1", friction=ARCTAN)
    for ask, laws in (
        (lambda: disk.certify, "the paper's friction laws"),
        (lambda: Audit(disk, Taylor()), "the paper's friction laws"),
        (lambda: disk.slow_manifold(1), "linear friction law"),
        (lambda: tv.one_harmonic(disk, "30.4"), "linear friction law"),
    ):
        with pytest.raises(InputError, match=f"{laws} only, not for 'arctan'"):
            ask()


@pytest.mark.slow(minutes=0.4)
def test_cycles_near_the_hopf_point_feel_the_law_at_high_order(taylor: Taylor) -> None:
    """Cycles of two laws with one slope, next to the Hopf point, to 24 digits.

    On a cycle of amplitude a, the third harmonic of gamma_y is of order a^3 and the first one of
    order a^5. So the first harmonic of its cube is of order a^11, and the cubic term of the
    arctangent changes a by order a^11 / a^2. The distance from Omega_crit is proportional to a^2:
    distances in the ratio 4 give changes in the ratio 2^9.
    """
    linear, own = (tv.Disk("table1", friction=law) for law in ("linear", ARCTAN))

    def change(distance: Fraction) -> Fraction:
        first, second = (
            disk.limit_cycle(below_crit=distance, digits=24, engine=taylor).beta_max.value
            for disk in (linear, own)
        )
        return first - second

    ratio = change(Fraction(1, 2500)) / change(Fraction(1, 10000))
    # The next order is a^2 larger, a factor of 1 + O(4e-4).
    assert float(ratio) == pytest.approx(2.0**9, rel=0.01)


def test_a_law_with_another_number_of_constants(taylor: Taylor) -> None:
    """A force that reads neither pi nor epsilon, and a replaced copy of a law."""
    law = FrictionLaw(
        "viscous", lambda ops, x, c: -10 * weight(c) * x, slope=lambda c: 10 * weight(c)
    )
    assert law.constants == ("m", "mu", "k", "traction")
    sol = tv.Disk("table1", friction=law).integrate("30.4", START, 1, engine=taylor)
    linear = tv.Disk("table1").integrate("30.4", START, 1, engine=taylor)  # epsilon = 1/10
    assert (abs(sol.y - linear.y) <= sol.uncertainty + linear.uncertainty).all()
    assert replace(law, name="other").constants == law.constants
