"""Families of limit cycles of disks of every kind: found whole, with true sentences about their ends."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy
import pytest

from tippedisk_verify.atlas.locator import locator
from tippedisk_verify.connection.bisection import bisect_omega_h
from tippedisk_verify.connection.heteroclinic import METHODS, heteroclinic
from tippedisk_verify.cycles.folds import libration_folds
from tippedisk_verify.cycles.librating_family import LibratingFamily
from tippedisk_verify.errors import InputError, NoConnectionError, NoSuchCycleError
from tippedisk_verify.model.parameters import PRINTED, Parameters
from tippedisk_verify.theory.equilibria import equilibrium
from tippedisk_verify.theory.hopf import hopf_point, omega_crit


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
def check_disk(disk: Parameters, taylor: Any) -> None:
    """Where the family of one disk ends, how often it turns round, and how many cycles a speed has."""
    family = locator(disk, taylor).family
    focus = any(float(value.im) for value in equilibrium(disk, str(family.limit), "noninverted").eigenvalues)
    assert family.connected is not focus, disk.name
    check_cycles(family)
    if focus:
        check_ends(disk, family, {"that amplitude": [family.limit]}, taylor)
        for method in METHODS:
            with pytest.raises(NoConnectionError, match="saddle-focus"):
                heteroclinic(disk, taylor, method=method)
        return
    omega_h = float(bisect_omega_h(disk, taylor).omega_h)
    assert abs(family.limit - omega_h) < 1e-6, disk.name  # a part of how near it is followed, 1e-5
    unstable, slow, _ = (float(value.re) for value in equilibrium(disk, str(omega_h), "noninverted").eigenvalues)
    falls_at_birth = float(hopf_point(disk).first_lyapunov_coefficient) < 0
    falls_at_the_end = unstable + slow < 0
    assert len(family.folds) % 2 == (falls_at_birth != falls_at_the_end), disk.name
    check_ends(disk, family, {"Omega_h": [omega_h]}, taylor)


def check_cycles(family: LibratingFamily) -> None:
    """Between two ends or folds as many cycles as the pieces have."""
    ends = sorted({end for _, end in family.ends})
    for low, high in pairwise(ends):
        speed = (low + high) / 2
        cycles = locator(family.parameters, family.engine).librating(Fraction(speed)).cycles()
        assert len(cycles) == len(list(family.places(speed)))


def check_ends(disk: Parameters, family: LibratingFamily, last: dict[str, list[float]], taylor: Any) -> None:
    """What is said beyond the family's ends, which are found by other roads."""
    folds = [float(fold.omega) for fold in libration_folds(disk, taylor)]
    true = {"Omega_crit": [float(omega_crit(disk))], "a fold": folds} | last
    ends = [speed for speeds in true.values() for speed in speeds]
    for beyond, extreme in ((min(ends) - 0.3, min(ends)), (max(ends) + 0.3, max(ends))):
        with pytest.raises(NoSuchCycleError) as caught:
            locator(disk, taylor).librating(Fraction(beyond)).cycles()
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


# ------------------------------------------------------------------------------------------------ the studies
@pytest.mark.slow
@pytest.mark.parametrize("disk", [*steep_disks(3), *random_disks(3, 1)], ids=lambda disk: disk.name)
def test_some_disks(taylor, disk) -> None:
    check_disk(disk, taylor)


@pytest.mark.slow
def test_the_papers_disk_with_forty_ratios_of_inertia(taylor) -> None:
    for disk in steep_disks(40):
        check_disk(disk, taylor)


@pytest.mark.slow
def test_a_hundred_random_disks(taylor) -> None:
    for disk in random_disks(100, 2):
        check_disk(disk, taylor)
