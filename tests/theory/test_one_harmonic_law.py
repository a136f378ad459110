"""The one-harmonic law against projections of the third-order equations, by quadrature.

The equations are the tests' own transcription of the paper. They are cut after third order
numerically, so that no expansion by hand is shared with the package.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any, NamedTuple

import mpmath
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.problems import decimals, paper_terms, physical_parameters
from tippedisk_verify import AccuracyError, Parameters, omega_crit, one_harmonic
from tippedisk_verify.numbers.exact import rational_in_context
from tippedisk_verify.theory.one_harmonic_law import (
    Form,
    amplitude_and_frequency_squared,
    chi,
    delta,
    hopf_slopes,
    kappa_1,
    kappa_2,
    section_crossing,
)

FORMS: tuple[Form, ...] = ("printed", "consistent")
DIGITS = 200
#: The trapezoidal rule of eight nodes is exact for products of up to seven sines and cosines; here
#: there are four.
NODES = 8


def projection(function: Any) -> tuple[Any, Any]:
    """Return (1/pi) times the integrals of f sin and f cos over a period."""
    angles = [2 * mpmath.pi * n / NODES for n in range(NODES)]
    values = [function(angle) for angle in angles]
    sine, cosine = (
        sum(value * wave(angle) for value, angle in zip(values, angles, strict=True)) * 2 / NODES
        for wave in (mpmath.sin, mpmath.cos)
    )
    return sine, cosine


def imbalance(
    parameters: Parameters, omega: Any, frequency: Any, size: Any, form: Form, turned: bool
) -> Any:
    """Return the projections of M beta'' - h - f_G - w_y lambda_Ty.

    beta_bar = ``size`` sin(theta) with theta = omega t. gamma_bar is the first harmonic that
    follows from gamma_bar' = Omega beta_bar, as printed, or from Omega sin(beta_bar). ``turned``
    changes the signs of the terms of h with m e, the last two of Eq. GyroVector_3DOF.
    """
    swing = size
    if form == "consistent":
        swing, _ = projection(lambda theta: mpmath.sin(size * mpmath.sin(theta)))

    def at(theta: Any) -> Any:
        sine, cosine = mpmath.sin(theta), mpmath.cos(theta)
        beta, gamma = (
            mpmath.pi / 2 + size * sine,
            mpmath.pi / 2 - omega / frequency * swing * cosine,
        )
        there = paper_terms(parameters, omega, (beta, gamma, size * frequency * cosine))
        *first, fourth, fifth = there.gyroscopic
        gyroscopic = sum(first) + (-1 if turned else 1) * (fourth + fifth)
        force = gyroscopic + there.gravity + there.direction * there.friction
        return -sum(there.mass) * size * frequency**2 * sine - force

    return projection(at)


def third_order(
    parameters: Parameters, omega: Any, frequency: Any, form: Form, turned: bool = False
) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
    """Return for sine and cosine the coefficients of C and C^3 of `imbalance`.

    It is an odd function of the amplitude C. The step is 1e-40. So the truncation error has its
    square, 1e-80, and so has rounding, 1e-200 over 1e-120.
    """
    step = mpmath.mpf(10) ** -40
    near, far = (
        imbalance(parameters, omega, frequency, size, form, turned) for size in (step, 2 * step)
    )
    parts = []
    for one, two in zip(near, far, strict=True):
        cubic = (two / 2 - one) / (3 * step**3)
        parts.append((one / step - cubic * step**2, cubic))
    return parts[0], parts[1]


@settings(max_examples=10)
@given(
    parameters=physical_parameters(),
    omega=decimals("1", "60"),
    frequency=decimals("0.5", "60"),
    amplitude=decimals("0.01", "2"),
)
def test_the_balances_are_projections(parameters, omega, frequency, amplitude) -> None:
    """Compare C^2 kappa_1, C^2 kappa_2 and the linear parts with the projections.

    The printed kappa_1 is the projection with the opposite sign of the terms of h with m e.
    """
    with mpmath.workdps(DIGITS):
        c = parameters.constants_in_context(mpmath.mp)
        speed, w, C = (
            rational_in_context(mpmath.mp, number) for number in (omega, frequency, amplitude)
        )
        reach = c.r + c.e
        for form in FORMS:
            sine, _ = third_order(parameters, speed, w, form, turned=form == "printed")
            _, cosine = third_order(parameters, speed, w, form)
            # Before the paper's cosine balance stands the friction's own factor.
            cosine = tuple(-part * c.epsilon / (c.mu * c.m * c.g) for part in cosine)
            stated_sine = (
                c.Bbar * (speed**2 - w**2) - c.m * c.g * reach,
                kappa_1(c, speed, w**2, form),
            )
            stated_cosine = (
                reach * (c.e * speed**2 / w - reach * w),
                kappa_2(c, speed, w**2, form) / (4 * w),
            )
            for found, stated in ((sine, stated_sine), (cosine, stated_cosine)):
                derived, claimed = (part[0] + C**2 * part[1] for part in (found, stated))
                # Some ten of eighty digits are lost to unlike speeds, masses and lengths.
                size = abs(stated[0]) + abs(C**2 * stated[1])
                assert abs(derived - claimed) < size * mpmath.mpf(10) ** -60


class Law(NamedTuple):
    """The one-harmonic law by projections."""

    square: Any  #: C^2
    frequency_squared: Any
    delta: Any
    chi: Any


def derived_law(parameters: Parameters, omega: Any, form: Form) -> Law:
    """Return C^2 and omega^2 from both balances to first order in C^2.

    The frequency is that at which the linear cosine part vanishes. The linear sine part and omega
    times the linear cosine part are linear in omega^2, so two frequencies determine them.
    """

    def linear(frequency_squared: Any) -> tuple[Any, Any]:
        frequency = mpmath.sqrt(frequency_squared)
        (sine, _), (cosine, _) = third_order(parameters, omega, frequency, form)
        return sine, cosine * frequency

    c, base = parameters.constants_in_context(mpmath.mp), omega**2
    (sine, cosine), (next_sine, next_cosine) = linear(base), linear(2 * base)
    sine_slope, cosine_slope = (next_sine - sine) / base, (next_cosine - cosine) / base
    birth = base - cosine / cosine_slope
    (sine, sine_cubic), (_, cosine_cubic) = third_order(parameters, omega, mpmath.sqrt(birth), form)
    shift = -cosine_cubic * mpmath.sqrt(birth) / cosine_slope
    denominator = sine_cubic + shift * sine_slope
    square = -sine / denominator
    constant = (4 * c.e * denominator - c.m * c.g * c.e * (c.r + c.e)) / base
    return Law(square, birth + shift * square, shift, constant)


@settings(max_examples=7)
@given(
    parameters=physical_parameters(),
    share=decimals("0.001", "0.1"),
    form=st.sampled_from(FORMS),
    digits=st.sampled_from((6, 12, 20)),
)
def test_the_law_solves_both_balances(parameters, share, form, digits) -> None:
    """Check both sides of Omega_crit; on one of them there is mostly no cycle, which is refused."""
    rational, crit = parameters.rational_constants(), omega_crit(parameters).value
    with mpmath.workdps(DIGITS):
        for omega in (crit * (1 - share), crit * (1 + share)):
            law = derived_law(parameters, rational_in_context(mpmath.mp, omega), form)
            stated = (
                *amplitude_and_frequency_squared(rational, omega, form),
                delta(rational, omega, form),
                chi(rational, form),
            )
            for claimed, derived in zip(stated, law, strict=True):
                # Some thirty of eighty digits are lost next to the law's pole, where few draws come
                # near.
                assert (
                    abs(rational_in_context(mpmath.mp, claimed) - derived)
                    < abs(derived) * mpmath.mpf(10) ** -50
                )
            if min(law.square, law.frequency_squared) < 0:
                assert form == "printed" or section_crossing(rational, omega) is None
                with pytest.raises(AccuracyError, match="no cycle"):
                    one_harmonic(parameters, omega, form, digits)
                continue
            cycle = one_harmonic(parameters, omega, form, digits)
            amplitude, frequency = mpmath.sqrt(law.square), mpmath.sqrt(law.frequency_squared)
            truths = (amplitude, frequency, 2 * mpmath.pi / frequency)
            for number, truth in zip(
                (cycle.amplitude, cycle.frequency, cycle.period), truths, strict=True
            ):
                assert number.holds(truth)
                assert number.uncertainty < abs(number.value) / 10**digits
            if form == "consistent":
                start = (
                    rational_in_context(mpmath.mp, omega) * amplitude / frequency,
                    -amplitude * frequency,
                    truths[2] / 2,
                )
                # Three roundings of the roots, products and quotients.
                assert section_crossing(rational, omega) == pytest.approx(
                    tuple(map(float, start)), rel=8 * 2.0**-52
                )


@settings(max_examples=6)
@given(
    parameters=physical_parameters(), form=st.sampled_from(FORMS), digits=st.sampled_from((6, 12))
)
def test_the_slopes_are_difference_quotients_of_the_law(parameters, form, digits) -> None:
    """Compare at Omega_crit, for C^2, which vanishes there, and for the period.

    The step is 1e-25, so its square is left out, and rounding is 1e-80 over 1e-25. Both lie far
    below the half-widths.
    """
    with mpmath.workdps(DIGITS):
        crit = omega_crit(parameters, 100).mpf()
        step = crit * mpmath.mpf(10) ** -25
        below, above = (derived_law(parameters, crit + side * step, form) for side in (-1, 1))
        found = hopf_slopes(parameters, form, digits)
        periods = [2 * mpmath.pi / mpmath.sqrt(law.frequency_squared) for law in (below, above)]
        truths = (
            (below.square - above.square) / (2 * step),
            (periods[0] - periods[1]) / (2 * step),
        )
        for number, truth in zip(found, truths, strict=True):
            assert number.holds(truth)
            assert number.uncertainty < abs(number.value) * Fraction(1, 10**digits)
