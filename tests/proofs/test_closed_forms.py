"""Closed forms: enclosures against the ordinary road's uncertainties, and against a second derivation."""

from __future__ import annotations

from fractions import Fraction

import pytest
from flint import arb, ctx

from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.model.parameters import NAMED_SETS, PRINTED, Parameters
from tippedisk_verify.proofs import angles, closed_forms
from tippedisk_verify.proofs.closed_forms import (
    characteristic_polynomial,
    check_linearization,
    hopf_balls,
    proved_equilibrium,
    proved_hopf,
    proved_stability,
    real_root,
)
from tippedisk_verify.proofs.kernel.balls import ball_constants, working_precision
from tippedisk_verify.theory import hopf
from tippedisk_verify.theory.equilibria import equilibrium

# A and Bbar too close: criticality_margin is negative.
SUBCRITICAL = PRINTED.changed(A="0.2305e-3", B="0.2290e-3")


@pytest.mark.parametrize("parameters", [*NAMED_SETS.values(), SUBCRITICAL], ids=lambda p: p.name)
@pytest.mark.parametrize("digits", [12, 40])
def test_the_hopf_point_is_the_ordinary_roads(parameters: Parameters, digits: int) -> None:
    proved, ordinary = proved_hopf(parameters, digits), hopf.hopf_point(parameters, digits)
    numbers = ("omega_crit", "period", "first_lyapunov_coefficient", "transversality")
    for name in (*numbers, "amplitude_squared_slope", "period_slope"):
        mine, theirs = getattr(proved, name), getattr(ordinary, name)
        assert mine.uncertainty * 10**digits <= abs(mine.value), name
        assert theirs.holds(mine.value), name
    assert proved.criticality == ordinary.criticality == hopf.criticality(parameters)
    assert proved.criticality in proved.statement


@pytest.mark.parametrize("parameters", [*NAMED_SETS.values(), SUBCRITICAL], ids=lambda p: p.name)
def test_the_first_lyapunov_coefficient_has_a_closed_form(parameters: Parameters) -> None:
    """From the amplitude law beta_max^2 = 8 e Bbar r / ((r + e) margin Omega) (Omega_crit - Omega) and d(Re lambda).

    l_1 = - kappa (r+e)^2 Omega^2 omega margin / (2 e Bbar (omega^2 + Omega^2 + omega^4) (omega^2 + kappa^2 (r+e)^4)).
    """
    with working_precision(300):
        c = ball_constants(parameters)
        found = hopf_balls(c)
        reach, kappa = c.r + c.e, c.k / c.b
        square = reach**2 * c.g / (c.r * c.b)
        frequency = c.e / reach * square
        margin = c.A * (c.r - 2 * c.e) - c.Bbar * c.r * (2 * c.r - c.e) / (2 * reach)
        denominator = 2 * c.e * c.Bbar * (frequency + square + frequency**2) * (frequency + kappa**2 * reach**4)
        expected = -kappa * reach**2 * square * frequency.sqrt() * margin / denominator
        assert expected.overlaps(found["first_lyapunov_coefficient"])
        assert found["first_lyapunov_coefficient"].rel_accuracy_bits() > 250
        falling = -kappa * reach * c.r * square.sqrt() / (frequency + kappa**2 * reach**4)
        assert falling.overlaps(found["transversality"])


@pytest.mark.parametrize("name", ["inverted", "noninverted"])
@pytest.mark.parametrize("omega", ["5", "30.4", "31.5", "200"])
def test_eigenvalues_are_the_ordinary_roads(name: str, omega: str) -> None:
    proved = proved_equilibrium(PRINTED, omega, name, 30)
    ordinary = equilibrium(PRINTED, omega, name, 30)  # type: ignore[arg-type]
    assert proved.stable == ordinary.stable
    assert proved.unstable_directions == {"inverted": 0 if ordinary.stable else 2, "noninverted": 1}[name]
    for mine, theirs in zip(proved.eigenvalues, ordinary.eigenvalues, strict=True):
        for part, other in ((mine.re, theirs.re), (mine.im, theirs.im)):
            assert abs(part.value - other.value) <= other.uncertainty + part.uncertainty
    # Vieta: exact relations between the roots, with the radii's part of each.
    total = sum(value.re.value for value in proved.eigenvalues)
    reach = PRINTED.r + (PRINTED.e if name == "inverted" else -PRINTED.e)
    trace = -PRINTED.mu * PRINTED.g * PRINTED.m * reach**2 / (PRINTED.epsilon * PRINTED.Bbar)
    assert abs(total - trace) <= sum(value.re.uncertainty for value in proved.eigenvalues)


def test_theorem_1_is_refused_where_a_hypothesis_fails() -> None:
    """With Bbar < 0 the coefficient a2 is negative: stable above Omega_crit would be false."""
    constants = PRINTED.rational()
    check_linearization(constants)
    tipped = constants._replace(Bbar=-constants.Bbar, b=-constants.b)
    assert characteristic_polynomial(tipped, Fraction(100), angles.INVERTED)[0] < 0
    for changed in (
        {"Bbar": -constants.Bbar, "b": -constants.b},
        {"Bbar": Fraction(0)},
        {"e": constants.r},
        {"e": Fraction(0)},
        {"mu": -constants.mu},
    ):
        with pytest.raises(InputError, match="not"):
            check_linearization(constants._replace(**changed))


def test_theorem_1_knows_other_equations(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that differs in one coefficient of one law: of the linear one, or of the smooth one alone."""
    original = closed_forms.linearization
    for law, (row, column) in (("linear", (2, 0)), ("linear", (2, 1)), ("linear", (2, 2)), ("smooth", (2, 2))):

        def other(constants, omega, around, friction="linear", side=None, law=law, row=row, column=column):
            rows = [list(line) for line in original(constants, omega, around, friction, side)]
            if friction == law:
                rows[row][column] = rows[row][column] * 1001
            return tuple(map(tuple, rows))

        monkeypatch.setattr(closed_forms, "linearization", other)
        closed_forms._check_coefficients.cache_clear()
        with pytest.raises(ArithmeticError, match="equations of motion have changed"):
            check_linearization(PRINTED.rational())
    monkeypatch.undo()
    closed_forms._check_coefficients.cache_clear()
    check_linearization(PRINTED.rational())


@pytest.mark.parametrize("parameters", [*NAMED_SETS.values(), SUBCRITICAL], ids=lambda p: p.name)
def test_the_numbers_at_every_speed_are_the_hopf_points(parameters: Parameters) -> None:
    found, point = proved_stability(parameters, 30), proved_hopf(parameters, 30)
    for name in ("omega_crit", "period", "lambda_3", "transversality"):
        assert getattr(found, name) == getattr(point, name)
    assert found.transversality.value + found.transversality.uncertainty < 0
    # The third eigenvalue at Omega_crit, by another road: the only real one of the three there.
    third = equilibrium(parameters, hopf.omega_crit(parameters, 60).value, "inverted", 30).eigenvalues[2].re
    assert abs(third.value - found.lambda_3.value) < abs(third.value) / 10**25


@pytest.mark.parametrize("side", [-1, 1])
def test_stability_is_decided_next_to_omega_crit(side: int) -> None:
    crit = hopf.omega_crit(PRINTED, 120).value
    proved = proved_equilibrium(PRINTED, crit + side * Fraction(1, 10**80), "inverted", 12)
    assert proved.stable == (side > 0)
    assert proved.unstable_directions == (0 if side > 0 else 2)


def test_at_a_rational_omega_crit_nothing_is_claimed() -> None:
    """(r + e)^2 g / (r b) = 1 with b = B / m - e^2: the speed 1 is Omega_crit exactly."""
    disk = PRINTED.changed(r="0.04", e="0.01", m=1, B="0.0351", A="0.036", C=None, g="0.56")
    assert hopf.omega_crit_squared(disk) == 1
    with pytest.raises(AccuracyError, match="imaginary axis"):
        proved_equilibrium(disk, 1, "inverted")
    assert proved_hopf(disk).omega_crit.holds(1)


def test_bad_input_gets_one_line() -> None:
    for omega, name in (("0", "inverted"), ("-3", "inverted"), ("pi", "inverted"), ("30", "upright")):
        with pytest.raises(InputError):
            proved_equilibrium(PRINTED, omega, name)


def test_the_precision_and_the_series_length_are_left_alone() -> None:
    before = ctx.prec, ctx.cap
    proved_hopf(PRINTED, 50)
    with pytest.raises(AccuracyError):
        real_root((arb(0, 1), arb(0, 1), arb(0, 1)), arb(1))
    assert (ctx.prec, ctx.cap) == before


def test_a_root_is_enclosed_for_all_coefficients_in_their_balls() -> None:
    """(x - 1) (x + 2) (x + 3) = x^3 + 4 x^2 + x - 6."""
    with working_precision(100):
        narrow = real_root((arb(4), arb(1), arb(-6)), arb(1.0001))
        assert narrow.contains(1)
        wide = real_root((arb(4, 1e-6), arb(1, 1e-6), arb(-6, 1e-6)), arb(1))
        for shift in (-1e-6, 1e-6):
            x = real_root((arb(4) + shift, arb(1) + shift, arb(-6) - shift), arb(1) - shift / 4)
            assert wide.contains(x)
