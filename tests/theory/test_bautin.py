"""The Bautin point by two roads, what its neighbours do, and where eigenvalues change kind."""

from __future__ import annotations

import json
from fractions import Fraction
from itertools import pairwise
from typing import Any

import mpmath
import pytest
from hypothesis import given, settings

from tests.problems import decimals, physical_parameters
from tests.theory.formal_cycles import formal_cycles
from tippedisk_verify.cli import main
from tippedisk_verify.errors import InputError
from tippedisk_verify.model.exact import quotient
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import PRINTED, Parameters
from tippedisk_verify.theory.bautin import BAUTIN_PARAMETERS, bautin_points
from tippedisk_verify.theory.equilibria import (
    EquilibriumName,
    Linearization,
    characteristic_polynomial,
    equilibrium,
    kind_changes,
    linearization,
    saddle_value_sign,
)
from tippedisk_verify.theory.hopf import amplitude_law, criticality, hopf_point, omega_crit

#: r = 4 e: l_1 = 0 where A = 7 Bbar / 5, a decimal.
DEGENERATE = PRINTED.changed(r="0.04", e="0.01", m="0.4", A="0.224e-3", B="0.2e-3", C=None)


# ------------------------------------------------------------------------------------------------ the point itself
@settings(max_examples=8)
@given(parameters=physical_parameters(), e=decimals("0.001", "0.4"))
def test_all_admissible_roots_and_no_others(parameters: Parameters, e: Fraction) -> None:
    parameters = parameters.changed(e=e * parameters.r, B=parameters.B + parameters.m * parameters.r**2, A=parameters.A
                                    + parameters.m * parameters.r**2)  # fmt: skip
    for name in BAUTIN_PARAMETERS:
        start = getattr(parameters, name)
        found = [point.value for point in bautin_points(parameters, name)]
        # Across each root, and nowhere else on a grid, the Hopf point changes its criticality.
        grid = [start * Fraction(n, 20) for n in range(1, 100)]
        admissible = []
        for value in grid:
            try:
                admissible.append((value, criticality(parameters.changed(C=None, **{name: value}))))
            except InputError:
                continue
        for (value, kind), (following, next_kind) in pairwise(admissible):
            if following - value == start / 20:
                between = sum(value < root.value < following for root in found)
                assert (kind != next_kind) == bool(between % 2)


# ------------------------------------------------------------------------------------------------ its numbers
@settings(max_examples=6)
@given(parameters=physical_parameters())
def test_its_numbers_follow_from_the_full_equations(parameters: Parameters) -> None:
    for name in ("A", "B", "r", "e"):
        for point in bautin_points(parameters, name, 25):
            with mpmath.workdps(60):
                disk = point.parameters
                speed, period = omega_crit(disk, 58).mpf(), point.period.mpf()
                frequency = 2 * mpmath.pi / period
                # l_2 is for z with <q, q> = 1, the series' w is q_2 z.
                share = 1 / (1 + (frequency / speed) ** 2 * (1 + frequency**2))
                second = mpmath.re(formal_cycles(disk, normal_form=True).kappa[1]) * share**2 / frequency
                quartic = formal_cycles(disk).amplitude_law()[1]
                step = point.value.value / 10**15
                ends = [disk.changed(**{name: point.value.value + side * step}) for side in (1, -1)]
                above, below = (
                    quotient(mpmath.mp, amplitude_law(end).quadratic) * omega_crit(end, 58).mpf() for end in ends
                )
                slope = (above - below) / (2 * quotient(mpmath.mp, step))
                truths = {
                    "omega_crit": speed,
                    "second_lyapunov_coefficient": second,
                    "quartic_coefficient": quartic,
                    "quadratic_coefficient_slope": slope,
                    "fold_amplitude_slope": -slope / (2 * quartic),
                    "fold_speed_curvature": -(slope**2) / (4 * quartic),
                }
                for quantity, truth in truths.items():
                    # 25 digits, and the central difference errs by 1e-30 times a moderate third derivative.
                    assert abs(getattr(point, quantity).mpf() - truth) < abs(truth) * mpmath.mpf(10) ** -22, quantity
                    assert getattr(point, quantity).uncertainty <= abs(getattr(point, quantity).value) / 10**25


# ------------------------------------------------------------------------------------------------ the Hopf point there
def test_the_hopf_point_of_a_degenerate_disk() -> None:
    assert criticality(DEGENERATE) == "degenerate"
    found = hopf_point(DEGENERATE, 30)
    assert found.first_lyapunov_coefficient.value == found.first_lyapunov_coefficient.uncertainty == 0
    assert found.amplitude_squared_slope is found.period_slope is None
    (point,) = bautin_points(DEGENERATE, "A", 30)
    assert point.value == Measured(DEGENERATE.A, Fraction(0))
    with mpmath.workdps(50):
        frequency = 2 * mpmath.pi / found.period.mpf()
        share = 1 / (1 + (frequency / found.omega_crit.mpf()) ** 2 * (1 + frequency**2))
        second = mpmath.re(formal_cycles(DEGENERATE, normal_form=True).kappa[1]) * share**2 / frequency
        assert found.second_lyapunov_coefficient is not None
        assert abs(found.second_lyapunov_coefficient.mpf() / second - 1) < mpmath.mpf(10) ** -30


@pytest.mark.parametrize("distance", ["1e-30", "1e-100", "-1e-30"])
def test_next_to_it_cancellation_costs_no_digits(distance: str) -> None:
    """l_1 is linear in A, and so is c_1: a hundred digits nearer, both are as much smaller."""
    near, far = (DEGENERATE.changed(A=DEGENERATE.A + Fraction(shift)) for shift in (distance, "1e-6"))
    ratio = Fraction(distance) * 10**6
    found, reference = hopf_point(near, 20), hopf_point(far, 40)
    for name in ("first_lyapunov_coefficient", "quadratic_coefficient"):
        number = getattr(found, name)
        assert (number - getattr(reference, name) * ratio).holds(0)
        assert number.uncertainty * 10**20 <= abs(number.value)
    assert found.criticality == ("supercritical" if ratio > 0 else "subcritical")


# ------------------------------------------------------------------------------------------------ eigenvalues
def discriminant(matrix: Linearization) -> Fraction:
    """Of the characteristic polynomial: positive where all eigenvalues are real, negative where two are not."""
    _, a2, a1, a0 = characteristic_polynomial(matrix)
    return Fraction(18 * a2 * a1 * a0 - 4 * a2**3 * a0 + a2**2 * a1**2 - 4 * a1**3 - 27 * a0**2)


@given(parameters=physical_parameters(), share=decimals("0.1", "2"))
def test_saddle_value_and_kind_against_eigenvalues(parameters: Parameters, share: Fraction) -> None:
    speed = round(omega_crit(parameters).value * share, 6)
    unstable, slow, _ = equilibrium(parameters, speed, "noninverted").eigenvalues
    value = unstable.re + slow.re
    assert saddle_value_sign(parameters, speed) == (1 if value > 0 else -1)
    for name in ("inverted", "noninverted"):
        kinds = [part.im.value for part in equilibrium(parameters, speed, name).eigenvalues]  # type: ignore[arg-type]
        assert (discriminant(linearization(parameters, speed, name)) < 0) == any(kinds)  # type: ignore[arg-type]


def test_the_saddle_value_vanishes_where_it_should() -> None:
    """lambda^2 = -a1 solves the cubic if a2 a1 = a0: then lambda_u = -lambda_s. Omega is rational for this disk."""
    disk = DEGENERATE.changed(r="0.04", e="0.01", m=1, B="1.6e-3", A="2e-3", g="10")  # Bbar = 1.5e-3
    square = disk.m * disk.g * (disk.r - disk.e) ** 2 / (disk.r * disk.Bbar)
    disk = disk.changed(g=disk.g * 100 / square)
    beside = (Fraction(10) + Fraction(side, 10**20) for side in (-1, 0, 1))
    assert [saddle_value_sign(disk, speed) for speed in beside] == [1, 0, -1]


@pytest.mark.parametrize("name", ["inverted", "noninverted"])
@settings(max_examples=25)
@given(parameters=physical_parameters())
def test_eigenvalues_change_kind_at_these_speeds(name: EquilibriumName, parameters: Parameters) -> None:
    speeds = kind_changes(parameters, name, 20)
    kinds = [discriminant(linearization(parameters, Fraction(1, 10**9), name)) > 0]
    for speed in speeds:
        assert speed.uncertainty <= speed.value / 10**20
        low, high = (speed.value * (1 + side * Fraction(1, 10**15)) for side in (-1, 1))
        before, after = (discriminant(linearization(parameters, end, name)) > 0 for end in (low, high))
        assert before is kinds[-1]
        assert after is not before
        kinds.append(after)
    assert (discriminant(linearization(parameters, Fraction(10**6), name)) > 0) is kinds[-1]


# ------------------------------------------------------------------------------------------------ the command
def told(capsys: Any, *arguments: str) -> dict[str, Any]:
    assert main(["hopf", "--json", *arguments]) == 0
    result: dict[str, Any] = json.loads(capsys.readouterr().out)
    return result


def test_command_with_bautin_points(capsys: Any) -> None:
    (point,) = told(capsys, "--bautin", "A", "--digits", "50")["bautin"]
    assert point["parameter"] == "A"
    p = PRINTED
    truth = p.Bbar * p.r * (2 * p.r - p.e) / (2 * (p.r + p.e) * (p.r - 2 * p.e))
    assert Measured.of(**point["value"]).holds(truth)
    assert Fraction(point["value"]["uncertainty"]) < truth / 10**50
    assert told(capsys, "--bautin", "m")["bautin"] == []
