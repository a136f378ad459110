"""The examples run as a user runs them, and their own assertions hold."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.command_line import printed

ROOT = Path(__file__).parent.parent
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
SAYS = {
    "close_to_the_connection": "from Omega_h + 1e-10 to Omega_h + 1e-12",
    "from_python": "(3, 201) True",
    "grade_from_python": "digits: agrees",
    "limit_cycles": "",
    "one_limit_cycle": "SciPy comes back to within",
    "own_friction_law": "Radau closes the cycle to within",
    "scenario_picture": "from a fold at 30.00346 rad/s",
    "scenes_picture": "scene d: limit cycle, scene f: inverted spinning",
    "without_half_widths": "heteroclinic, 30 digits:",
}


def test_every_example_has_its_words() -> None:
    assert {path.stem for path in EXAMPLES} == SAYS.keys()


@pytest.mark.slow
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs(path: Path, tmp_path: Path) -> None:
    run = subprocess.run(
        [sys.executable, "-W", "error", path],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    assert run.stderr == ""
    assert SAYS[path.stem] in run.stdout
    for picture in tmp_path.glob("*.png"):
        assert picture.stat().st_size < 300_000  # small enough for a page


@pytest.mark.slow(minutes=1.5)
def test_the_commands_of_the_scenario_print_its_numbers() -> None:
    """Check that its numbers are the beginnings of printed ones, and so are the speeds found."""

    page = (ROOT / "docs" / "scenario.md").read_text(encoding="utf-8")
    rows = [
        cells
        for line in page.splitlines()
        if len(cells := line.split("|")) == 6 and "`" in cells[4]
    ]
    for speed, *shown, command in ([cell.strip() for cell in cells[1:5]] for cells in rows):
        found = printed(command.strip("`"))
        numbers = re.findall(r"[0-9]+\.[0-9]+(?= s| of all| 1/s|$)", " ".join(shown))
        assert numbers, command
        for number in [*numbers, *re.findall(r"^[0-9.]{12,}$", speed)]:
            assert re.search(rf"(?<![0-9.]){re.escape(number)}", found), (command, number)
    assert len(rows) == 11
