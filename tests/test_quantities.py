"""What commands print has the unit that the reference data give it, and help that says what it is."""

from __future__ import annotations

import pytest

from tippedisk_verify.cli import main
from tippedisk_verify.model.results import heading
from tippedisk_verify.reference_values.store import stored


def test_units_are_those_of_the_reference_data() -> None:
    compared = set()
    for quantity in stored().values():
        name = quantity.id.rsplit("/", 1)[-1]
        # What the commands print has the meaning of these kinds; "beta@0.5" and the like have no name here.
        if quantity.kind in ("hopf", "limit-cycle", "heteroclinic") and heading(name) != name:
            assert heading(name) == f"{name} [{quantity.unit}]"
            compared.add(name)
    assert {"omega_crit", "period", "gamma_bar_0", "v_0", "beta_max", "omega_h", "dperiod_domega"} <= compared
    assert heading("multiplier_slow") == "multiplier_slow"


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["hopf"], "omega_crit [rad/s]: 30.88659268864"),
        (["equilibria", "--omega", "30.4"], "    re 0.10917998637"),
        (["harmonic-balance", "--below-crit", "0.5"], "beta_max [rad]: 0.346127892305"),
    ],
)
def test_text_has_units(arguments: list[str], line: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == 0
    said = capsys.readouterr().out
    assert any(one.startswith(line) for one in said.splitlines())


@pytest.mark.parametrize(
    "command", ["hopf", "orbit", "slow-manifold", "heteroclinic", "harmonic-balance", "equilibria"]
)
def test_help_defines_what_is_printed(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command, "--help"]) == 0
    said = capsys.readouterr().out
    assert "Quantities" in said
    assert "\b" not in said
    if command == "orbit":
        assert "largest abs(beta - pi/2) on the cycle" in said
