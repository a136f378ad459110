"""The examples run, each as a user runs it, and their own assertions hold."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
SAYS = {
    "close_to_the_connection": "from Omega_h + 1e-10 to Omega_h + 1e-12",
    "from_python": "30.04886826072250",
    "grade_from_python": "digits: agrees",
    "limit_cycles": "",
    "one_limit_cycle": "SciPy comes back to within",
    "scenario_picture": "from a fold at 30.00346 rad/s",
    "scenes_picture": "scene d: limit cycle, scene f: inverted spinning",
}


@pytest.mark.slow
@pytest.mark.parametrize(
    "path",
    [pytest.param(path, marks=pytest.mark.slow if path.stem == "scenario_picture" else ()) for path in EXAMPLES],
    ids=lambda path: path.stem,
)
def test_an_example_runs(path: Path, tmp_path: Path) -> None:
    run = subprocess.run(
        [sys.executable, "-W", "error", path], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    assert run.stderr == ""
    assert SAYS[path.stem] in run.stdout
    for picture in tmp_path.glob("*.png"):
        assert picture.stat().st_size < 300_000  # small enough for a README


def test_the_example_in_the_readme_is_one_of_them() -> None:
    """So it runs as printed, and mypy reads it."""
    code = (ROOT / "examples" / "from_python.py").read_text(encoding="utf-8").partition("\n\n")[2]
    assert textwrap.indent(code, "    ") in README


@pytest.mark.slow(minutes=1.5)
def test_the_commands_of_the_scenario_print_its_numbers(capsys: pytest.CaptureFixture[str]) -> None:
    """Digits are cut off there, so they are a part of what is printed; so are the speeds found."""
    from tippedisk_verify.cli import main

    page = (ROOT / "docs" / "scenario.md").read_text(encoding="utf-8")
    rows = [cells for line in page.splitlines() if len(cells := line.split("|")) == 6 and "`" in cells[4]]
    for speed, *told, command in ([cell.strip() for cell in cells[1:5]] for cells in rows):
        assert main(shlex.split(command.strip("`"))) == 0
        printed = capsys.readouterr().out
        numbers = re.findall(r"[0-9]+\.[0-9]+(?= s| %| 1/s|$)", " ".join(told))
        assert numbers, command
        for number in [*numbers, *re.findall(r"^[0-9.]{12,}$", speed)]:
            assert re.search(rf"(?<![0-9.]){re.escape(number)}", printed), (command, number)
    assert len(rows) == 11


def test_the_headline_digits_of_the_readme() -> None:
    """Each number in the table is the true one, rounded to the places that it has."""
    import tippedisk_verify as tv
    from tippedisk_verify.audit.claims import rounds_to
    from tippedisk_verify.model.measured import Measured
    from tippedisk_verify.theory.equilibria import stiff_eigenvalue_estimate
    from tippedisk_verify.theory.harmonic_balance import chi

    rows = {
        cells[1].split()[0].rstrip(","): cells[3:5]
        for line in README.splitlines()
        if len(cells := line.split("|")) == 6
    }
    for place, (parameters, set_name) in enumerate(((tv.PRINTED, "printed"), (tv.CALIBRATED, "calibrated"))):
        truths = {
            "Omega_crit": tv.omega_crit(parameters, 25),
            "T_crit": tv.period_crit(parameters, 25),
            "A_33": Measured.of(stiff_eigenvalue_estimate(parameters), 0),
            "chi": Measured.of(chi(parameters.rational(), "printed"), 0),
            "Omega_h": tv.reference(f"{set_name}/linear/heteroclinic/point/omega_h").measured(),
        }
        for name, truth in truths.items():
            assert rounds_to(truth, rows[name][place].strip()) is True, (name, parameters.name)
