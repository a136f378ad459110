"""The Hopf point: where it is, and its first Lyapunov coefficient and laws by derivations that share no formula."""

from __future__ import annotations

import json
from fractions import Fraction

import heyoka
import mpmath
import pytest
from hypothesis import given, settings

from tests.problems import SETS, decimals, physical_parameters
from tests.theory.formal_cycles import formal_cycles
from tippedisk_verify.cli import main
from tippedisk_verify.errors import AccuracyError
from tippedisk_verify.model import equations
from tippedisk_verify.model.parameters import PRINTED, Constants, Parameters
from tippedisk_verify.theory.equilibria import characteristic_polynomial, equilibrium, linearization
from tippedisk_verify.theory.harmonic_balance import slopes
from tippedisk_verify.theory.hopf import (
    critical_frequency_squared,
    criticality,
    hopf_point,
    omega_crit,
    omega_crit_squared,
    period_crit,
)


@given(parameters=physical_parameters(), mu=decimals("0.01", "5"), epsilon=decimals("0.001", "5"))
def test_omega_crit_makes_an_imaginary_pair_whatever_the_friction(parameters, mu, epsilon) -> None:
    """Exactly: lambda^3 + a2 lambda^2 + a1 lambda + a0 with lambda^2 = -w^2 vanishes iff a1 = w^2 and a2 w^2 = a0.

    The entries hold Omega only as Omega^2 (A31, and Omega A32), so the squares make this rational.
    """
    changed = parameters.changed(mu=mu, epsilon=epsilon)
    square = omega_crit_squared(changed)
    assert square == omega_crit_squared(parameters)
    unit = linearization(changed, Fraction(1))
    a2 = -unit.A33
    a1 = -(unit.A31 + 1) + square  # A31 = g (r + e) / b - Omega^2
    a0 = -unit.A32 * square  # Omega A32 is proportional to Omega^2
    frequency = critical_frequency_squared(changed)
    assert a1 == frequency
    assert a2 * frequency == a0
    assert characteristic_polynomial(unit)[1] == a2


@pytest.mark.parametrize("parameters", SETS, ids=lambda p: p.name)
def test_digits_hold(parameters) -> None:
    for function in (omega_crit, period_crit):
        coarse, fine = function(parameters, 12), function(parameters, 60)
        assert coarse.holds(fine.value)
        assert coarse.uncertainty <= coarse.value / 10**12
    with mpmath.workdps(60):
        p = parameters
        ratio = (p.r + p.e) ** 2 * p.m * p.g / (p.r * p.Bbar)
        expected = mpmath.sqrt(mpmath.mpf(ratio.numerator) / ratio.denominator)
        assert abs(mpmath.mpf(omega_crit(p, 50).decimals()[0]) - expected) < mpmath.mpf("1e-45")


def derivative_tensors(parameters: Parameters) -> tuple[dict, dict, mpmath.mpf]:
    """First to third derivatives of the full acceleration at inverted spinning by heyoka, in 200 bits."""
    c = parameters.rational()
    names = ("r", "e", "a", "b", "g", "k")
    state = heyoka.make_vars("beta", "gamma", "v")
    pars = {name: heyoka.par[index + 1] for index, name in enumerate(names)}
    constants = Constants(**{name: pars.get(name) for name in Constants._fields})
    rates = equations.field(heyoka, constants, heyoka.par[0], "linear")(*state)
    tensors = heyoka.diff_tensors([heyoka.expression(rates[2])], list(state), diff_order=3)
    wanted = {
        (i, j, k): tensors[[0, i, j, k]] for i in range(4) for j in range(4) for k in range(4) if 1 <= i + j + k <= 3
    }
    function = heyoka.cfunc(list(wanted.values()), list(state), fp_type=heyoka.real, prec=200)
    with mpmath.workprec(200):
        square = omega_crit_squared(parameters)
        speed = mpmath.sqrt(mpmath.mpf(square.numerator) / square.denominator)
        numbers = [speed, *(mpmath.mpf(getattr(c, n).numerator) / getattr(c, n).denominator for n in names)]
        half = mpmath.pi / 2
        inputs = [heyoka.real(mpmath.nstr(x, 70), 200) for x in (half, half, mpmath.mpf(0))]
        import numpy

        values = function(
            numpy.array(inputs), pars=numpy.array([heyoka.real(mpmath.nstr(x, 70), 200) for x in numbers])
        )
        found = {key: mpmath.mpf(str(value)) for key, value in zip(wanted, values, strict=True)}
    return found, dict(zip(("Omega", *names), numbers, strict=True)), speed


@pytest.mark.parametrize("parameters", SETS, ids=lambda p: p.name)
def test_against_kuznetsovs_full_formula_with_heyokas_derivatives(parameters) -> None:
    """Kuznetsov's Eq. (5.39) with the quadratic terms kept; heyoka differentiates the unexpanded field."""
    d, numbers, speed = derivative_tensors(parameters)
    with mpmath.workprec(200):
        w = speed * mpmath.sqrt(numbers["e"] / (numbers["r"] + numbers["e"]))
        # gamma' = -Omega cos(beta) at beta = pi/2: first derivative Omega, third derivative -Omega, no second.
        matrix = mpmath.matrix([[0, 0, 1], [speed, 0, 0], [d[1, 0, 0], d[0, 1, 0], d[0, 0, 1]]])
        q = mpmath.matrix([1j * w, speed, (1j * w) ** 2])
        q /= mpmath.norm(q)
        adjoint = mpmath.matrix([[mpmath.conj(matrix[j, i]) for j in range(3)] for i in range(3)])
        # The adjoint eigenvector by inverse iteration, not by its closed form.
        shifted = adjoint - (-1j * w + mpmath.mpf(10) ** -30) * mpmath.eye(3)
        p = mpmath.matrix([1, 1, 1])
        for _ in range(6):
            p = mpmath.lu_solve(shifted, p)
            p /= mpmath.norm(p)

        def inner(a, b):
            return sum(mpmath.conj(x) * y for x, y in zip(a, b, strict=True))

        p /= mpmath.conj(inner(p, q))

        def form(order, *vectors):
            total = mpmath.mpc(0)
            for n in range(3**order):
                index = [(n // 3**k) % 3 for k in range(order)]
                key = tuple(index.count(axis) for axis in range(3))
                product = mpmath.mpc(1)
                for vector, axis in zip(vectors, index, strict=True):
                    product *= vector[axis]
                total += d[key] * product
            kinematic = -speed * vectors[0][0] * vectors[1][0] * vectors[2][0] if order == 3 else 0
            return mpmath.matrix([0, kinematic, total])

        qc = q.apply(mpmath.conj)
        bilinear_1 = form(2, q, mpmath.lu_solve(matrix, form(2, q, qc)))
        bilinear_2 = form(2, qc, mpmath.lu_solve(2j * w * mpmath.eye(3) - matrix, form(2, q, q)))
        full = inner(p, form(3, q, q, qc)) - 2 * inner(p, bilinear_1) + inner(p, bilinear_2)
        truth = mpmath.re(full) / (2 * w)
        mine = hopf_point(parameters, 25).first_lyapunov_coefficient
        # 200 bits hold 60 digits; the inverse iteration and the sums lose some twenty of them.
        assert abs(mpmath.mpf(mine.decimals()[0]) - truth) < abs(truth) * mpmath.mpf(10) ** -25


@settings(max_examples=25)
@given(parameters=physical_parameters())
def test_the_laws_follow_from_the_full_equations(parameters) -> None:
    """By formal series: l_1 from the normal form, the period's slope from the family of cycles."""
    point = hopf_point(parameters, 40)
    with mpmath.workdps(70):
        frequency = 2 * mpmath.pi / point.period.mpf()
        # l_1 is for z with <q, q> = 1, the series' w is q_2 z.
        share = 1 / (1 + (frequency / point.omega_crit.mpf()) ** 2 * (1 + frequency**2))
        coefficient = mpmath.re(formal_cycles(parameters, normal_form=True).kappa[0]) * share / frequency
        family = formal_cycles(parameters)
        slope = 2 * mpmath.pi / frequency**2 * mpmath.im(family.kappa[0]) / family.omega[0]
        # Large friction and small differences of inertias cost some twenty of the 70 digits.
        assert abs(point.first_lyapunov_coefficient.mpf() / coefficient - 1) < mpmath.mpf(10) ** -38
        assert abs(point.slopes()[1].mpf() / slope - 1) < mpmath.mpf(10) ** -38
    assert point.criticality == ("supercritical" if coefficient < 0 else "subcritical")
    if parameters.e < parameters.r / 2:
        p = parameters
        bound = p.r * (2 * p.r - p.e) / (2 * (p.r + p.e) * (p.r - 2 * p.e))
        assert (p.A / p.Bbar > bound) == (point.criticality == "supercritical")
    else:
        assert point.criticality == "subcritical"


@given(parameters=physical_parameters())
def test_slopes_of_two_theories_agree(parameters) -> None:
    """Normal form against the consistent one-harmonic law, for any disk, on either side."""
    for exact, balanced in zip(hopf_point(parameters).slopes(), slopes(parameters, "consistent"), strict=True):
        assert (exact - balanced).holds(0)


@given(parameters=physical_parameters())
def test_transversality_against_a_difference(parameters) -> None:
    """d(Re lambda)/d(Omega) from the cubic's roots on both sides of Omega_crit."""
    crit = omega_crit(parameters, 60).value
    step = crit / 10**12
    ends = []
    for speed in (crit + step, crit - step):
        pair = [v for v in equilibrium(parameters, speed, "inverted", 50).eigenvalues if v.im.value != 0]
        ends.append(pair[0].re.value)
    slope = (ends[0] - ends[1]) / (2 * step)
    # Central difference: relative error of about step^2 / crit^2 times a moderate third derivative.
    assert abs(slope / hopf_point(parameters, 30).transversality.value - 1) < Fraction(1, 10**15)


def test_a_degenerate_point_has_no_slopes() -> None:
    """A chosen so that the first Lyapunov coefficient vanishes exactly."""
    p = PRINTED
    A = p.Bbar * p.r * (2 * p.r - p.e) / (2 * (p.r + p.e)) / (p.r - 2 * p.e)
    odd = PRINTED.changed(A=A, C=None)
    assert criticality(odd) == "degenerate"
    with pytest.raises(AccuracyError, match="vanishes exactly"):
        hopf_point(odd).slopes()


def test_command(capsys, tmp_path) -> None:
    assert main(["hopf", "--json", "--digits", "20"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["criticality"] == "supercritical"
    for name in ("omega_crit", "period", "first_lyapunov_coefficient", "amplitude_squared_slope", "period_slope"):
        assert Fraction(result[name]["uncertainty"]) <= abs(Fraction(result[name]["value"])) / 10**20
    path = tmp_path / "thick.toml"
    path.write_text("\n".join(f'{k} = "{v}"' for k, v in {**PRINTED.decimals(), "A": "0.227e-3"}.items()), "utf-8")
    assert main(["hopf", "--json", "--parameters", str(path)]) == 0
    assert json.loads(capsys.readouterr().out)["criticality"] == "subcritical"
    assert main(["hopf", "--friction", "smooth"]) == 2
