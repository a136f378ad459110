"""`certify equilibria|hopf|heteroclinic` as a user meets them."""

from __future__ import annotations

import json
import subprocess
import sys
from fractions import Fraction

import pytest

from tippedisk_verify.cli import main
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.proofs.search import connection_end
from tippedisk_verify.proofs.search.connection_end import ProvedEnd
from tippedisk_verify.proofs.search.connection_end import Status as EndStatus
from tippedisk_verify.proofs.search.heteroclinic import ProvedConnection


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
    always = _json(capsys, "certify", "equilibria", "--every-speed", "--friction", "smooth", "--digits", "20")
    assert always["proved"] is True
    assert Fraction(always["omega_crit"]["uncertainty"]) < Fraction(1, 10**17)
    assert "unstable at every Omega > 0" in always["statement"]
    # The sentence stands by itself: the disk, and the numbers as above.
    assert PRINTED.definition() in always["statement"]
    assert always["omega_crit"]["value"] in always["statement"]
    below = _json(capsys, "certify", "equilibria", "--below-crit", "-0.5", "--friction", "smooth")
    assert below["inverted"]["stable"] is True


def test_hopf(capsys) -> None:
    result = _json(capsys, "certify", "hopf", "--parameters", "calibrated", "--digits", "20")
    assert (result["proved"], result["criticality"]) == (True, "supercritical")
    assert abs(Fraction(result["omega_crit"]["value"]) - Fraction("30.92")) < Fraction("0.005")
    assert "branch of stable limit cycles" in result["statement"]


def test_heteroclinic_about_a_given_speed(capsys) -> None:
    result = _json(capsys, "certify", "heteroclinic", "--near", "30.2", "--digits", "4", "--quiet", status=1)
    assert (result["proved"], result["status"]) == (False, "not_near")
    assert result["statement"].startswith("nothing is proved")


@pytest.mark.slow
def test_the_cycles_next_to_it(capsys, monkeypatch) -> None:
    """The proof itself is tested elsewhere; what is not proved of the cycles is told beside what is of Omega_h."""
    asked = []

    def prove_end(connection: ProvedConnection, reach: str, *, watch: object) -> ProvedEnd:
        asked.append(reach)
        return ProvedEnd(EndStatus.NO_LID, connection, Fraction(30), Fraction(31))

    monkeypatch.setattr(connection_end, "prove_end", prove_end)
    arguments = ("certify", "heteroclinic", "--near", "30.0488682607225", "--digits", "9", "--cycles", "0.5", "--quiet")
    result = _json(capsys, *arguments, status=1)
    assert asked == ["0.5"]
    assert (result["proved"], result["cycles"]["proved"], result["cycles"]["status"]) == (True, False, "no_lid")
    assert (result["cycles"]["from"], result["cycles"]["to"]) == ("30", "31")


@pytest.mark.slow
def test_heteroclinic_by_the_ordinary_road(capsys) -> None:
    result = _json(capsys, "certify", "heteroclinic", "--digits", "30", "--quiet")
    assert (result["proved"], result["unique"]) == (True, True)
    assert 2 * Fraction(result["omega_h"]["uncertainty"]) <= Fraction(1, 10**30)


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
        (["certify", "equilibria", "--omega", "30", "--every-speed"], "--every-speed takes the place"),
        (["certify", "hopf", "--friction", "smooth"], "smooth"),
        (["certify", "heteroclinic", "--digits", "301"], "300 digits"),
        (["certify", "heteroclinic", "--digits", "0"], "digits"),
        (["certify", "heteroclinic", "--near", "-1"], "between 1e-6 and 1e6"),
        (["certify", "heteroclinic", "--near", "pi"], "between 1e-6 and 1e6"),
        (["certify", "heteroclinic", "--near", "soon"], "not a finite decimal"),
        (["certify", "heteroclinic", "--cycles", "1"], "between 0 and 1"),
        (["certify", "heteroclinic", "--cycles", "soon"], "not a finite decimal"),
        (["certify", "heteroclinic", "--cycles", "0.001", "--friction", "smooth"], "linear friction law"),
        (["certify", "orbit", "--omega", "30.886", "--radius", "1e-3"], "born below Omega_crit = 30.8865926886 rad/s"),
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
    for command in ("orbit", "hopf", "equilibria", "heteroclinic"):
        assert command in ran.stdout
