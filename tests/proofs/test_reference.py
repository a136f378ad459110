"""Every stored reference value that has a closed form must contain its enclosure, proved here to more digits."""

from __future__ import annotations

from functools import cache

import pytest

from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.proofs.closed_forms import ProvedEquilibrium, proved_equilibrium, proved_hopf
from tippedisk_verify.reference_values.store import stored

DIGITS = 70  # more than the stored values claim
HOPF = (
    "omega_crit",
    "period",
    "first_lyapunov_coefficient",
    "transversality",
    "amplitude_squared_slope",
    "period_slope",
)


@cache
def _equilibrium(name: str, omega: str, which: str) -> ProvedEquilibrium:
    return proved_equilibrium(Parameters.named(name), omega, which, DIGITS)


@pytest.mark.parametrize("name", ["printed", "calibrated"])
def test_eigenvalues(name: str) -> None:
    seen = 0
    for quantity in stored().matching(f"{name}/both/equilibrium/"):
        place, entry = quantity.id.split("/")[3:]
        if not entry.startswith("lambda_"):
            continue
        which, omega = place.split("-", 1)
        _, index, part = entry.split("_")
        enclosed = getattr(_equilibrium(name, omega, which).eigenvalues[int(index) - 1], part)
        stored_value = quantity.measured()
        assert stored_value.contains(enclosed), quantity.id
        seen += 1
    assert seen >= 50


@pytest.mark.parametrize("name", ["printed", "calibrated"])
def test_the_hopf_point(name: str) -> None:
    proved, seen = proved_hopf(Parameters.named(name), DIGITS), 0
    for quantity in stored().matching(f"{name}/linear/hopf/point/"):
        entry = quantity.id.split("/")[-1]
        if entry in HOPF:
            enclosed, stored_value = getattr(proved, entry), quantity.measured()
            assert stored_value.contains(enclosed), entry
            seen += 1
    assert seen >= 4
