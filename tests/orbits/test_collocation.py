"""The independent continuation: its equations, its order, its errors, and what it says of cycles, folds and Omega_h."""

from __future__ import annotations

import math
from fractions import Fraction

import mpmath
import numpy
import pytest
from mpmath import mpf
from scipy.integrate import solve_bvp
from scipy.interpolate import BarycentricInterpolator

import tippedisk_verify as tv
from tests.model import transcription as paper
from tests.orbits.collocated_connection import omega_h
from tests.orbits.collocated_cycles import (
    Disk,
    cycle_conditions,
    cycle_field,
    cycle_of_amplitude,
    cycles_at_speed,
    fold_curve,
    fold_of_amplitude,
    folds,
    hopf,
    parameter,
    rates,
)
from tests.orbits.collocation import Mesh, Number, Solution, solve
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.exact import fraction
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.model.precision import QUADRUPLE
from tippedisk_verify.orbits.half_map import half_map

PRINTED_DISK = Disk()
FOLDING = Disk(A=0.229e-3)  # its cycles are born unstable and fold


def agrees(number: Number, other: tv.Measured | mpf | float) -> bool:
    """Whether the other value lies within the error, with its own half-width if it has one."""
    value, width = (other.value, other.uncertainty) if isinstance(other, tv.Measured) else (other, 0)
    return bool(abs(mpf(number.value) - mpmath.mpmathify(value)) <= number.error + mpmath.mpmathify(width))


# --- equations and method ---------------------------------------------------------------------------------------------
def test_the_equations_are_the_transcribed_ones() -> None:
    """At random states, to the rounding of some 50 operations on terms of the size that they have."""
    r, e, m, A, B, g, mu, epsilon = (mpf(value) for value in PRINTED_DISK)
    Bbar, Omega = B - m * e**2, mpf(30.4)
    draw = numpy.random.default_rng(1)
    for beta_bar, gamma_bar, v in draw.uniform((-1.5, -7, -10), (1.5, 7, 10), (200, 3)).tolist():
        beta, gamma = beta_bar + mpmath.pi / 2, gamma_bar + mpmath.pi / 2
        inertia = paper.mass_matrix(A, Bbar, m, r, e, beta, gamma)
        gyroscopic = paper.gyroscopic_forces(A, Bbar, m, r, e, Omega, beta, gamma, mpf(v))
        sliding = paper.lateral_sliding_velocity(r, e, Omega, beta, gamma, mpf(v))
        gravity = paper.gravitational_force(m, g, r, e, beta, gamma)
        direction = paper.force_direction(r, e, beta, gamma)
        forces = [paper.linear_friction(mu, m, g, epsilon, part) for part in sliding]
        expected = paper.state_rates(
            sum(inertia), sum(gyroscopic), gravity, direction, sum(forces), Omega, beta, mpf(v)
        )
        size = sum(map(abs, gyroscopic)) + abs(gravity) + direction * sum(map(abs, forces))
        # The cancellation in Bbar and in 3 sin^2 - 2 makes these sums up to some five times too small.
        sizes = (1, Omega, 5 * size / sum(inertia))
        found = rates(PRINTED_DISK, 30.4, numpy.array([beta_bar, gamma_bar, v]))
        for mine, theirs, scale in zip(found.tolist(), expected, sizes, strict=True):
            assert abs(mine - theirs) <= 50 * mpf(2) ** -53 * scale


def sine_problem(intervals: int, points: int) -> Solution:
    """y'' = -q^2 y, y(0) = 0, y'(0) = 1, y(1) = 0: q is pi."""
    times = numpy.linspace(0, 1, 9)
    guess = Solution(times, numpy.array([times * (1 - times), 1 - 2 * times]), numpy.array([3.0]))
    return solve(
        lambda y, q: numpy.array([y[1], -(q[0] ** 2) * y[0]]),
        lambda start, end, q: numpy.array([start[0], start[1] - 1, end[0]]),
        Mesh(intervals, points),
        guess,
    )


@pytest.mark.parametrize("points", [1, 2, 3])
def test_collocation_at_gauss_points_has_twice_their_order(points: int) -> None:
    coarse, fine = (abs(sine_problem(intervals, points).unknowns[0] - math.pi) for intervals in (8, 16))
    # The next term of the error, of a squared step of (pi/8)^2 less, has a factor of its own below one.
    assert abs(math.log2(coarse / fine) - 2 * points) < (math.pi / 8) ** 2


def test_six_points_reach_rounding() -> None:
    """Some 300 equations, each to a few units of rounding, which add up at worst."""
    assert abs(sine_problem(16, 6).unknowns[0] - math.pi) < 300 * math.pi * 2**-53


def test_scipys_own_collocation_finds_the_same_cycle() -> None:
    """`solve_bvp` shares the equations alone; its tolerance is for residuals, relative and root mean square."""
    cycle, tolerance = cycle_of_amplitude(FOLDING, 1.7), 1e-8
    u, field = parameter(1.7), cycle_field(FOLDING)
    guess = cycle.solution
    theirs = solve_bvp(
        lambda _, z, unknowns: field(z, numpy.append(unknowns, u)),
        lambda start, end, _: cycle_conditions(start, end),
        times := numpy.linspace(0, 1, 101),
        guess.at(times) + 0.01 * numpy.sin(times),
        p=guess.unknowns[:2] + numpy.array([0.01, 0.02]),
        tol=tolerance,
        max_nodes=20_000,
    )
    assert theirs.success
    # Omega, of a size of 30, moves with the residuals by no more than its size times them.
    assert abs(theirs.p[1] - cycle.omega.value) < 31 * tolerance
    assert abs(2 * theirs.p[0] - cycle.period.value) < 31 * tolerance


@pytest.mark.parametrize("intervals", [4, 6, 8, 12])
def test_errors_of_coarse_meshes_hold(intervals: int) -> None:
    rough, sharp = (cycle_of_amplitude(FOLDING, 2.5, mesh) for mesh in (intervals, 48))
    for name in ("omega", "period", "v_0"):
        mine, truth = getattr(rough, name), getattr(sharp, name)
        assert abs(mine.value - truth.value) <= mine.error + truth.error, name
    assert sharp.omega.error < 1e-12 * sharp.omega.value


# --- against the package ----------------------------------------------------------------------------------------------
def test_the_printed_cycle_is_the_reference_one() -> None:
    """Its values are known to 50 digits, for inputs that are the doubles nearest to the decimals."""
    point = "printed/linear/limit-cycle/crit-0.5"
    speed = float(tv.reference(f"{point}/period").inputs["Omega"])
    (cycle,) = cycles_at_speed(PRINTED_DISK, speed)
    for name in ("period", "gamma_bar_0", "v_0"):
        assert agrees(getattr(cycle, name), tv.reference(f"{point}/{name}").measured("doubles")), name
    assert cycle.gamma_bar_0.error < 1e-12


def test_the_printed_connection_is_the_reference_one() -> None:
    speed, _ = omega_h(PRINTED_DISK)
    assert agrees(speed, tv.reference("printed/linear/heteroclinic/point/omega_h").measured("doubles"))
    assert speed.error < 1e-12 * speed.value


def test_the_folding_disks_connection_is_that_of_the_package() -> None:
    """From the printed disk's orbit, as along a curve."""
    _, orbit = omega_h(PRINTED_DISK)
    speed, _ = omega_h(FOLDING, guess=orbit)
    decimals = {name: str(value) for name, value in FOLDING._asdict().items()}
    assert agrees(speed, tv.Disk(**decimals).heteroclinic().omega_h)


def shot(taylor: Taylor, a: Fraction, v: float, Omega: float) -> tuple[mpf, mpf, mpf]:
    """Omega, period and v_0 of a cycle of FOLDING by the package's half map at 113 bits, from good guesses."""
    p, unknowns = PRINTED.changed(A="0.229e-3"), mpmath.matrix([v, Omega])
    for _ in range(3):  # from 12 digits past 30
        image = half_map(p, fraction(unknowns[1]), (a, fraction(unknowns[0])), taylor, QUADRUPLE)
        number = QUADRUPLE.mpf
        matrix = [[image.matrix[0][1], image.by_omega[0]], [image.matrix[1][1] - 1, image.by_omega[1]]]
        jacobian = mpmath.matrix([[number(part) for part in row] for row in matrix])
        unknowns -= mpmath.lu_solve(jacobian, mpmath.matrix([number(part) for part in image.residual]))
    return unknowns[1], 2 * number(image.time), unknowns[0]


@pytest.mark.parametrize("a", [0.3, 1.7, 3.0])
def test_cycles_of_given_amplitude_are_shot_too(taylor: Taylor, a: float) -> None:
    """Stable and unstable ones of a disk whose family folds."""
    cycle = cycle_of_amplitude(FOLDING, a)
    with mpmath.workdps(34):
        found = shot(taylor, Fraction(a), cycle.v_0.value, cycle.omega.value)
        for name, truth in zip(("omega", "period", "v_0"), found, strict=True):
            assert agrees(getattr(cycle, name), truth), name
            assert getattr(cycle, name).error < 1e-12 * max(abs(truth), 1), name  # v is of order one on the cycle


def test_the_fold_is_where_shooting_sees_the_highest_speed(taylor: Taylor) -> None:
    (fold,) = folds(FOLDING)
    v = fold.gamma_bar_0.value * float(fold.solution.values[2, 0])
    a, step = Fraction(fold.gamma_bar_0.value), Fraction(1, 10**6)
    with mpmath.workdps(34):
        below, here, above = (shot(taylor, a + k * step, v, fold.omega.value)[0] for k in (-1, 0, 1))
        assert below < here > above
        # The parabola through the three: its top is off by a third derivative of order one times the squared step,
        # a twelfth of which is 1e-13, and by 34 digits over the squared step.
        shift = mpf(step.numerator) / step.denominator * (below - above) / (2 * (above - 2 * here + below))
        assert abs(shift) < fold.gamma_bar_0.error + 1e-12
        assert agrees(fold.omega, here)
    assert fold.gamma_bar_0.error < 1e-11
    assert fold.omega.error < 1e-12 * fold.omega.value


# --- folds ------------------------------------------------------------------------------------------------------------
def test_disks_born_stable_do_not_fold() -> None:
    assert folds(PRINTED_DISK) == []


def test_the_fold_curve_ends_in_the_bautin_point() -> None:
    """A / Bbar = r (2 r - e) / (2 (r + e) (r - 2 e)), where the first Lyapunov coefficient vanishes."""
    r, e, m, _, B = PRINTED_DISK[:5]
    bautin = (B - m * e**2) * r * (2 * r - e) / (2 * (r + e) * (r - 2 * e))
    (fold,) = folds(FOLDING)
    squares, values = [], []
    for a in (1.2, 0.8, 0.4, 0.3, 0.2, 0.1):
        fold = fold_of_amplitude(FOLDING, "A", a, fold)
        squares.append(a**2)
        values.append(fold.value.value)
    # A is a smooth function of a^2: the polynomial through the last four, and through the last five.
    ends = [float(BarycentricInterpolator(squares[-n:], values[-n:])(0.0)) for n in (4, 5)]
    assert abs(ends[1] - bautin) < 1e-10 * bautin
    assert abs(ends[1] - bautin) < abs(ends[0] - bautin) + 1e-14
    assert abs(fold.omega.value - hopf(PRINTED_DISK)[0]) < 1e-6


def test_the_fold_curve_is_the_same_both_ways() -> None:
    """By A with steps so large that they must be halved, and back by amplitude with A unknown."""
    curve = fold_curve(PRINTED_DISK, "A", [0.2322e-3, 0.2272e-3])
    back = fold_of_amplitude(FOLDING, "A", curve[1].gamma_bar_0.value, curve[1])
    assert abs(back.value.value - 0.2272e-3) < back.value.error + 1e-3 * curve[1].gamma_bar_0.error
    assert abs(back.omega.value - curve[1].omega.value) < back.omega.error + curve[1].omega.error
    assert curve[0].gamma_bar_0.value < curve[1].gamma_bar_0.value
    with pytest.raises(ArithmeticError, match="no fold"):
        fold_curve(PRINTED_DISK, "A", [0.249e-3])
