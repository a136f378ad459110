"""The amplitude law to fourth order: against formal series of the full equations, and against cycles that are shot."""

from __future__ import annotations

import math

import mpmath
import numpy
import pytest
from hypothesis import given, settings

from tests.problems import physical_parameters
from tests.theory.formal_cycles import formal_cycles
from tippedisk_verify.cycles.family import one_at_a_time
from tippedisk_verify.cycles.section import LIBRATING
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.exact import quotient
from tippedisk_verify.model.parameters import PRINTED, Parameters
from tippedisk_verify.theory.hopf import amplitude_law, critical_frequency_squared, omega_crit


@settings(max_examples=25)
@given(parameters=physical_parameters())
def test_it_follows_from_the_full_equations(parameters: Parameters) -> None:
    law = amplitude_law(parameters)
    with mpmath.workdps(70):
        speed = omega_crit(parameters, 68).mpf()
        for mine, derived in zip(law, formal_cycles(parameters).amplitude_law(), strict=True):
            # 70 digits; large friction and small differences of inertias cost some twenty of them.
            assert abs(derived - quotient(mpmath.mp, mine) * speed) < mpmath.mpf(10) ** -45 * (abs(derived) + speed)


@pytest.mark.parametrize(
    "changes",
    [{}, {"A": "0.2324e-3"}, {"A": "0.229e-3", "mu": "0.05"}, {"e": "0.01"}, {"epsilon": "0.02", "m": "0.3"}],
    ids=str,
)
def test_cycles_of_small_amplitude_obey_it(taylor: Taylor, changes: dict[str, str]) -> None:
    """(Omega - Omega_crit) / a^2 through eight cycles, as a polynomial in a^2, gives c_1 and c_2."""
    parameters = PRINTED.changed(C=None, **changes)
    crit, frequency = float(omega_crit(parameters)), math.sqrt(critical_frequency_squared(parameters))
    a = numpy.linspace(0.1, 0.45, 8)
    linear = (-(frequency**2) / crit * a, numpy.full(8, math.pi / frequency), numpy.full(8, crit))
    cycles = one_at_a_time(LIBRATING, parameters, taylor)(a, *linear)
    inverse = numpy.linalg.inv(numpy.vander(a**2, increasing=True))
    # Each Omega is known to some 30 ulps; what the interpolation makes of that exceeds the terms of order a^18.
    widths = abs(inverse) @ (30 * 2.0**-52 * crit / a**2)
    law = [float(part) * crit for part in amplitude_law(parameters)]
    for mine, fitted, width in zip(law, inverse @ ((cycles.omega - crit) / a**2), widths, strict=False):
        assert abs(mine - fitted) < width
