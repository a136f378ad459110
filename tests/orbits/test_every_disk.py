"""Families of limit cycles of disks of every kind: found whole, with half-widths that hold and true sentences."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Any

import numpy
import pytest

from tippedisk_verify.errors import InputError, NoConnectionError, NoSuchCycleError
from tippedisk_verify.flow.lanes import BatchTaylor
from tippedisk_verify.model.exact import fraction
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import PRINTED, Parameters
from tippedisk_verify.model.precision import bits
from tippedisk_verify.orbits.amplitude_family import AmplitudeFamily
from tippedisk_verify.orbits.bisection import bisect_omega_h
from tippedisk_verify.orbits.branch_interpolant import BranchInterpolant
from tippedisk_verify.orbits.continuation import cycles_at_speed
from tippedisk_verify.orbits.folds import libration_folds
from tippedisk_verify.orbits.heteroclinic import METHODS, heteroclinic
from tippedisk_verify.orbits.periodic import cycle_numbers, shoot
from tippedisk_verify.theory.equilibria import equilibrium
from tippedisk_verify.theory.hopf import hopf_point, omega_crit

_LANES = BatchTaylor()
_THIRTY_DIGITS = bits(120)  # 36 digits, of which shooting next to a bifurcation loses some
_INTERPOLATED = ("period", "gamma_bar_0", "v_0", "beta_max", "log_multiplier_slow", "log_multiplier_fast")
_CORRECTED = (*_INTERPOLATED, "multiplier_slow", "dperiod_domega", "dgamma_bar_0_domega", "dv_0_domega")


def steep_disks(count: int) -> Iterator[Parameters]:
    """The paper's disk with A / Bbar from 1.0125, just above what is admissible, to 1.2."""
    for n in range(count):
        ratio = Fraction("1.0125") + Fraction("0.1875") * n / max(1, count - 1)
        yield PRINTED.changed(A=ratio * PRINTED.Bbar, name=f"A = {float(ratio):.4f} Bbar")


def random_disks(count: int, seed: int) -> Iterator[Parameters]:
    """Disks that differ from the paper's in the geometry, the inertia and the friction."""
    random = numpy.random.default_rng(seed)
    while count:
        r = 0.045 * math.exp(random.uniform(-0.4, 0.4))
        e = r * math.exp(random.uniform(math.log(0.01), math.log(0.3)))
        mu, epsilon = 0.3 * math.exp(random.uniform(-1.2, 1.2)), 0.1 * math.exp(random.uniform(-1.2, 1.2))
        B = 0.249e-3 * random.uniform(0.85, 1)
        values = {
            name: f"{value:.6g}" for name, value in {"r": r, "e": e, "mu": mu, "epsilon": epsilon, "B": B}.items()
        }
        try:
            yield PRINTED.changed(**values, name=f"r {r:.4f} e {e:.5f} mu {mu:.3f} epsilon {epsilon:.4f} B {B:.4g}")
        except InputError:
            continue
        count -= 1


# ------------------------------------------------------------------------------------------------ what is checked
def check_disk(disk: Parameters, taylor: Any, count: int, seed: int) -> dict[str, int]:
    """The family of one disk; how many numbers were compared, and how many half-widths did not hold."""
    tally = {"numbers": 0, "violations": 0, "refused": 0, "cycles": 0}
    family = AmplitudeFamily(disk, taylor)
    focus = any(float(value.im) for value in equilibrium(disk, str(family.limit), "noninverted").eigenvalues)
    assert family.connected is not focus, disk.name
    random = numpy.random.default_rng(seed)
    speeds = wanted_speeds(family, random, count)
    if focus:
        check_ends(disk, family, {"that amplitude": [family.limit]}, taylor)
        check_alone(family, speeds, tally)
        for method in METHODS:
            with pytest.raises(NoConnectionError, match="saddle-focus"):
                heteroclinic(disk, taylor, method=method)
        return tally
    omega_h = float(bisect_omega_h(disk, taylor).omega_h)
    assert abs(family.limit - omega_h) < 1e-6, disk.name  # a part of how near it is followed, 1e-5
    unstable, slow, _ = (float(value.re) for value in equilibrium(disk, str(omega_h), "noninverted").eigenvalues)
    falls_at_birth = float(hopf_point(disk).first_lyapunov_coefficient) < 0
    falls_at_the_end = unstable + slow < 0
    assert len(family.folds) % 2 == (falls_at_birth != falls_at_the_end), disk.name
    check_ends(disk, family, {"Omega_h": [omega_h]}, taylor)
    check_alone(family, random.choice(speeds, 3).tolist(), tally)
    check_together(BranchInterpolant(disk, _LANES, omega_h), speeds, taylor, tally)
    return tally


def check_ends(disk: Parameters, family: AmplitudeFamily, last: dict[str, list[float]], taylor: Any) -> None:
    """What is said beyond the family's ends, which are found by other roads."""
    folds = [float(fold.omega) for fold in libration_folds(disk, taylor)]
    true = {"Omega_crit": [float(omega_crit(disk))], "a fold": folds} | last
    ends = [speed for speeds in true.values() for speed in speeds]
    for beyond, extreme in ((min(ends) - 0.3, min(ends)), (max(ends) + 0.3, max(ends))):
        with pytest.raises(NoSuchCycleError) as caught:
            cycles_at_speed(family, Fraction(beyond))
        told = str(caught.value)
        said = re.search(r"between (.+) (?:=|at) (\S+) rad/s and (.+) (?:=|at) (\S+) rad/s$", told)
        assert said, (disk.name, told)
        assert min(ends) in true[said[1]], (disk.name, told)
        assert max(ends) in true[said[3]], (disk.name, told)
        assert f"0.3 rad/s {'below' if extreme == min(ends) else 'above'} the family" in told
        numbers = {said[2]: min(ends), said[4]: max(ends)}
        if not family.connected:
            only = re.search(r"is followed to (\S+) rad/s only, where gamma's amplitude is pi", told)
            assert only, (disk.name, told)
            numbers[only[1]] = family.limit
        for printed, speed in numbers.items():
            assert abs(speed / float(printed) - 1) < 1e-6, (disk.name, told, speed)  # seven digits are printed


def wanted_speeds(family: AmplitudeFamily, random: Any, count: int) -> list[float]:
    """Evenly drawn ones, and as many crowded towards the ends and the folds."""
    ends = [end for _, end in family.ends]
    low, high = min(ends), max(ends)
    share = (high - low) / 1000  # what the interpolant leaves out
    even = random.uniform(low, high, count)
    near = random.choice(ends, count) + random.choice((-1, 1), count) * 10 ** random.uniform(-9, -1, count)
    reached = family.nodes[[0, -1], 3]
    return [
        speed
        for speed in (*even, *near)
        if low + share < speed < high - share
        and abs(speed - ends[-1]) > share
        and all((speed - end) * (speed - last) > 0 for end, last in zip((ends[0], ends[-1]), reached, strict=True))
    ]


def check_alone(family: AmplitudeFamily, speeds: Sequence[float], tally: dict[str, int]) -> None:
    """Cycles as a user asks for them, one speed at a time: as many as the pieces have, and the stable one first."""
    for speed in speeds:
        places = list(family.places(speed))
        try:
            cycles = cycles_at_speed(family, Fraction(speed))
        except NoSuchCycleError as fault:
            if "doubles cannot tell" not in str(fault):
                raise
            tally["refused"] += 1
            continue
        assert len(cycles) == len(places)
        for cycle, place in zip(cycles, places, strict=True):
            truth = true_cycle(family.parameters, speed, place.start, family.engine)
            compare(family.parameters.name, cycle, truth, {name: getattr(cycle, name) for name in _CORRECTED}, tally)
            assert cycle.stable in (None, float(truth["log_multiplier_slow"]) < 0), (family.parameters.name, speed)


def check_together(branch: BranchInterpolant, speeds: list[float], taylor: Any, tally: dict[str, int]) -> None:
    """The same in lanes, and interpolated."""
    cycles, values = branch.cycles(speeds), branch(speeds)
    widths = branch.half_widths(cycles)
    for k, omega in enumerate(cycles.omega.tolist()):
        tally["cycles"] += 1
        if not (cycles.converged[k] and math.isfinite(widths["gamma_bar_0"][k])):
            tally["refused"] += 1
            continue
        truth = true_cycle(branch.parameters, omega, (cycles.gamma_bar_0[k], cycles.v_0[k]), taylor)
        corrected = {name: Measured.of(getattr(cycles, name)[k], widths[name][k]) for name in _CORRECTED}
        compare(branch.parameters.name, omega, truth, corrected, tally)
        between = {name: Measured.of(getattr(values, name)[k], values.uncertainty[name][k]) for name in _INTERPOLATED}
        compare(branch.parameters.name, omega, truth, between, tally)


def true_cycle(disk: Parameters, speed: float, start: Any, taylor: Any) -> dict[str, Any]:
    shot = shoot(disk, Fraction(speed), start, taylor)
    return cycle_numbers(disk, Fraction(speed), shot, taylor, _THIRTY_DIGITS)


def compare(name: str, at: Any, truth: dict[str, Any], found: dict[str, Measured], tally: dict[str, int]) -> None:
    for number, measured in found.items():
        tally["numbers"] += 1
        if not measured.holds(fraction(truth[number])):
            tally["violations"] += 1
            print(f"{name} at {at}: {number} {measured} does not hold {truth[number]}")


# ------------------------------------------------------------------------------------------------ the studies
def check_disks(disks: Iterator[Parameters], taylor: Any, count: int) -> None:
    total = {"numbers": 0, "violations": 0, "refused": 0, "cycles": 0}
    for seed, disk in enumerate(disks):
        for name, number in check_disk(disk, taylor, count, seed).items():
            total[name] += number
    print(total)
    assert total["violations"] == 0
    assert total["refused"] <= total["cycles"] / 20  # next to folds doubles cannot tell two cycles apart


@pytest.mark.slow
@pytest.mark.honest
def test_some_disks(taylor) -> None:
    check_disks(steep_disks(3), taylor, 4)
    check_disks(random_disks(3, 1), taylor, 4)


@pytest.mark.slow
def test_the_papers_disk_with_forty_ratios_of_inertia(taylor) -> None:
    check_disks(steep_disks(40), taylor, 20)


@pytest.mark.slow
def test_a_hundred_random_disks(taylor) -> None:
    check_disks(random_disks(100, 2), taylor, 20)
