"""`certify equilibria|hopf|table|heteroclinic` as a user meets them."""

from __future__ import annotations

import json
import subprocess
import sys
from fractions import Fraction

import pytest

from tippedisk_verify.certified import table
from tippedisk_verify.cli import main


def _json(capsys, *arguments: str, status: int = 0) -> dict:
    assert main([*arguments, "--json"]) == status
    captured = capsys.readouterr()
    assert captured.err == ""
    return json.loads(captured.out)


def test_equilibria(capsys) -> None:
    result = _json(capsys, "certify", "equilibria", "--omega", "30.4", "--digits", "30")
    assert result["proved"] is True
    assert (result["inverted"]["stable"], result["noninverted"]["unstable_directions"]) == (False, 1)
    for value in result["inverted"]["eigenvalues"]:
        assert Fraction(value["re"]["uncertainty"]) <= abs(Fraction(value["re"]["value"])) / 10**27
    below = _json(capsys, "certify", "equilibria", "--below-crit", "-0.5", "--friction", "smooth")
    assert below["inverted"]["stable"] is True


def test_hopf(capsys) -> None:
    result = _json(capsys, "certify", "hopf", "--parameters", "calibrated", "--digits", "20")
    assert (result["proved"], result["criticality"]) == (True, "supercritical")
    assert abs(Fraction(result["omega_crit"]["value"]) - Fraction("30.92")) < Fraction("0.005")
    assert "branch of stable limit cycles" in result["statement"]


def test_table(capsys, monkeypatch) -> None:
    monkeypatch.setattr(table, "_cover_supercritical", lambda box, fixed: 0)  # proved in test_table
    result = _json(capsys, "certify", "table")
    assert [number["printed"] for number in result["numbers"]] == ["30.92", "0.886", "-129.04", "1.31e-7"]
    assert main(["certify", "table"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 6


def test_heteroclinic_about_a_given_speed(capsys) -> None:
    result = _json(capsys, "certify", "heteroclinic", "--near", "30.2", "--digits", "4", status=1)
    assert (result["proved"], result["status"]) == (False, "not_near")
    assert result["statement"].startswith("nothing is proved")


@pytest.mark.slow
def test_heteroclinic_and_table_by_the_ordinary_road(capsys) -> None:
    result = _json(capsys, "certify", "heteroclinic", "--digits", "30")
    assert (result["proved"], result["unique"]) == (True, True)
    assert 2 * Fraction(result["omega_h"]["uncertainty"]) <= Fraction(1, 10**30)
    result = _json(capsys, "certify", "table", "--omega-h")
    assert any("'calibrated'" in line and "rounds to 30.07" in line for line in result["statements"])
    assert any("'printed'" in line and "does not round to 30.07" in line for line in result["statements"])


def test_without_a_saddle_nothing_is_proved(capsys, tmp_path) -> None:
    disk = tmp_path / "slippery.toml"
    disk.write_text(
        'r = "0.045"\ne = "0.0025"\nm = "0.435"\nA = "0.249e-3"\nB = "0.227e-3"\n'
        'g = "9.81"\nmu = "0.03"\nepsilon = "0.1"\n'
    )
    arguments = ("certify", "heteroclinic", "--near", "30", "--parameters", str(disk))
    result = _json(capsys, *arguments, status=1)
    assert result["status"] == "no_saddle"


def test_at_omega_crit_itself_one_line_says_why(capsys, tmp_path) -> None:
    """A disk whose Omega_crit is 1 exactly: eigenvalues on the imaginary axis, no verdict on stability."""
    disk = tmp_path / "critical.toml"
    disk.write_text(
        'r = "0.04"\ne = "0.01"\nm = "1"\nA = "0.036"\nB = "0.0351"\ng = "0.56"\nmu = "0.3"\nepsilon = "0.1"\n'
    )
    assert main(["certify", "equilibria", "--omega", "1", "--parameters", str(disk)]) == 1
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "imaginary axis" in captured.err
    assert len(captured.err.splitlines()) == 1


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["certify", "equilibria"], "--omega or --below-crit"),
        (["certify", "equilibria", "--omega", "fast"], "not a finite decimal"),
        (["certify", "hopf", "--friction", "smooth"], "smooth"),
        (["certify", "heteroclinic", "--friction", "smooth"], "linear friction law"),
        (["certify", "table", "--friction", "smooth"], "linear friction law"),
        (["certify", "heteroclinic", "--digits", "301"], "300 digits"),
        (["certify", "heteroclinic", "--digits", "0"], "digits"),
        (["certify", "heteroclinic", "--near", "-1"], "between 1e-6 and 1e6"),
        (["certify", "heteroclinic", "--near", "pi"], "between 1e-6 and 1e6"),
        (["certify", "heteroclinic", "--near", "soon"], "not a finite decimal"),
        (["certify", "hopf", "--parameters", "unheard"], "not known"),
        (["certify", "proof"], "proof"),
    ],
)
def test_bad_input_gets_one_line(capsys, arguments: list[str], said: str) -> None:
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert len(captured.err.splitlines()) == 1
    assert said in captured.err


def test_without_python_flint_one_line_says_what_to_install() -> None:
    program = (
        "import sys; sys.modules['flint'] = None\nfrom tippedisk_verify.cli import main\n"
        "sys.exit(main(['certify', 'hopf']))"
    )
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stdout) == (2, "")
    assert ran.stderr == "tippedisk-verify: proofs need python-flint: install '.[certify]'\n"


def test_the_help_loads_no_flint(capsys) -> None:
    program = (
        "import sys; from tippedisk_verify.cli import main; main(['certify', '--help'])\n"
        "sys.exit('flint' in sys.modules)"
    )
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert ran.returncode == 0
    for command in ("orbit", "hopf", "equilibria", "heteroclinic", "table"):
        assert command in ran.stdout
